/*
 * rply_read: bodies of PLY files through rply (Diego Nehab's reader, one call for each value),
 * where the build found it: another opinion of what a file holds.
 *
 * The header is parsed twice, by rply and by ours (io/ply.h): ours says what vertices and faces
 * are, rply delivers their values. Serial.
 */
#ifndef WH_IO_RPLY_READ_H
#define WH_IO_RPLY_READ_H

#include "io/attributes.h"

/* WH_OK, or WH_E_USAGE with words about what to install when this build has no rply. */
wh_code wh_rply_available(wh_ctx *c);

/* What takes the values. */
typedef struct wh_rply_sink {
	void *arg;
	/* n vertices from number `first` on: positions, which may be destroyed, and records */
	wh_code (*vertices)(wh_ctx *c, void *arg, uint64_t first, double *xyz,
	                    const uint8_t *records, size_t n);
	/* all vertices have come; faces, if any, come next */
	wh_code (*faces_next)(wh_ctx *c, void *arg);
	/* the corners of one face, or of one strip, negative ones as 2^64 - |v|; `elem` and `item`
	   say which it is */
	wh_code (*face)(wh_ctx *c, void *arg, int elem, uint64_t item, const uint64_t *ids,
	                size_t n);
} wh_rply_sink;

/*
 * Reads the file that p describes, which is PLY: vertices, then faces and strips, in the order of
 * the file; twice where faces come before vertices. Stops at the first failure of the sink.
 * `attributes` (NULL: none): what records hold. WH_E_INPUT with rply's words for a file that rply
 * does not read.
 */
wh_code wh_rply_read(wh_ctx *c, const wh_ply *p, const wh_attributes *attributes,
                     const wh_rply_sink *sink);

#endif
