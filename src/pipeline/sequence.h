/*
 * sequence: all collapses of a run in the order in which they were made, kept in files of the spill
 * folder: one for each cluster of each round. Vertices go by their global ids.
 */
#ifndef WH_PIPELINE_SEQUENCE_H
#define WH_PIPELINE_SEQUENCE_H

#include "io/spill.h"
#include "mesh/collapse.h"

typedef struct wh_sequence_item {
	uint64_t u, v; /* u goes, v stays */
	wh_vec3 at;    /* where v is then, in units of the run */
	float cost, err;
} wh_sequence_item;

/* A round. */
typedef struct wh_sequence_part {
	uint32_t generation, clusters;
} wh_sequence_part;

/* Zero-initialise but for the first two. */
typedef struct wh_sequence {
	wh_spill *spill;
	uint32_t attr_bytes; /* of a vertex */
	wh_sequence_part *part;
	size_t n, cap;
} wh_sequence;

/* Takes down what a worker does to one patch after the other. Zero-initialise; free `buf`. */
typedef struct wh_sequence_writer {
	wh_spill *spill;
	const wh_patch *patch; /* at hand */
	uint8_t *buf;
	size_t cap;
	uint32_t used; /* collapses */
	uint64_t off;
	int fd;
} wh_sequence_writer;

enum { WH_SEQUENCE_BUFFER = 2048 }; /* collapses */

/* Begins the file of a cluster; sink.to is the writer then, until the end. */
wh_code wh_sequence_begin(wh_ctx *c, wh_sequence_writer *w, wh_spill *spill, uint32_t generation,
                          uint32_t cluster, const wh_patch *patch);
/* A wh_collapse_sink's put; `to` is the wh_sequence_writer. */
wh_code wh_sequence_put(wh_ctx *c, void *to, const wh_collapse *one, const uint8_t *attr);
/* Ends it, after a failure too; `code`: how it went. */
wh_code wh_sequence_end(wh_ctx *c, wh_sequence_writer *w, wh_code code);

/* The files of a generation are what comes next. */
wh_code wh_sequence_keep(wh_ctx *c, wh_sequence *s, uint32_t generation, uint32_t clusters);
/* They are not. */
void wh_sequence_drop(wh_spill *spill, uint32_t generation, uint32_t clusters);
void wh_sequence_free(wh_ctx *c, wh_sequence *s);

/* How many collapses there are. */
wh_code wh_sequence_count(wh_ctx *c, const wh_sequence *s, uint64_t *n);
/* Shows them all to `see`, in their order, with v's attributes behind each. */
wh_code wh_sequence_each(wh_ctx *c, const wh_sequence *s,
                         wh_code (*see)(wh_ctx *c, void *to, const wh_sequence_item *item,
                                        const uint8_t *attr),
                         void *to);

#endif
