/*
 * plain: a source as the steps before the ingest write it anew (pipeline/clean, pipeline/atlas).
 *
 * One scratch file holds, each in a row: positions (floats or doubles, as they were), the
 * attributes of vertices, and triangles: three indices (4 bytes, or 8 above 2^32 vertices) with
 * what the face and its corners carry behind them.
 */
#ifndef WH_PIPELINE_PLAIN_H
#define WH_PIPELINE_PLAIN_H

#include "io/attributes.h"
#include "io/wedges.h"

/* Lays out `to` in the file fd: nv vertices with those attributes, and no faces yet, which carry
 * what `wedges` says. Both may be NULL, and have to outlive it. Positions are as wide as those of
 * `from`.
 */
void wh_plain_lay_out(wh_source *to, const wh_source *from, uint64_t nv,
                      const wh_attributes *attributes, const wh_wedges *wedges, int fd);

/* Writes a vertex, or a triangle with what it carries, at `at`; each takes vstride or fstride
 * bytes. */
void wh_plain_put_position(const wh_source *s, unsigned char *at, const double xyz[3]);
void wh_plain_put_face(const wh_source *s, unsigned char *at, const uint64_t corner[3],
                       const void *carried);

static inline bool wh_plain_is_degenerate(const uint64_t corner[3])
{
	return corner[0] == corner[1] || corner[1] == corner[2] || corner[2] == corner[0];
}

/*
 * The ids that a chunk of faces waits for while windows of ids go by: a chunk that has nothing to
 * do with the window at hand need not be read.
 */
typedef struct wh_plain_span {
	uint64_t lo, hi; /* lo > hi: it waits for none */
} wh_plain_span;

static inline wh_plain_span wh_plain_no_span(void)
{
	return (wh_plain_span){UINT64_MAX, 0};
}

static inline void wh_plain_span_add(wh_plain_span *s, uint64_t id)
{
	s->lo = id < s->lo ? id : s->lo;
	s->hi = id > s->hi ? id : s->hi;
}

static inline bool wh_plain_span_misses(const wh_plain_span *s, uint64_t first, uint64_t window)
{
	return s->hi < first || s->lo >= first + window;
}

#endif
