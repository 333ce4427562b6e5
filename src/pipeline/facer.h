/*
 * facer: corners come in, triangles come out as the bytes of a rewritten body.
 *
 * Polygons are cut into triangles, strips unrolled, triangles with repeated corners left out.
 * One per worker: not thread-safe.
 */
#ifndef WH_PIPELINE_FACER_H
#define WH_PIPELINE_FACER_H

#include "geom/polygon.h"
#include "io/wedges.h"
#include "pipeline/positions.h"

typedef struct wh_facer {
	const wh_source *source; /* vertices: where polygons get their corners' positions */
	uint32_t index_size;     /* bytes of an index: 4 or 8 */
	const wh_wedges *wedges; /* the source's; NULL: faces carry nothing */
	const uint8_t *carried; /* by the next face: records of its corners, then its own; NULL: not
	                           known */
	wh_positions positions; /* opened by the first polygon, as is all below it */
	wh_polygon_workspace *cutter;
	uint64_t *ids;       /* WH_POLYGON_MOST corners of the polygon at hand, ... */
	uint32_t *which;     /* ... their places among all that it was given with, ... */
	wh_vec3 *pos;        /* ... their positions, ... */
	uint32_t *cut;       /* ... and its triangles */
	unsigned char *out;  /* triangles not yet taken */
	size_t out_n;        /* of them, in triangles */
	size_t out_cap;      /* in bytes */
	uint64_t polygons;   /* faces of more than three corners so far */
	uint64_t degenerate; /* faces of fewer than three different corners so far, left out */
	uint64_t invalid;    /* polygons with a corner that is not finite so far, left out */
	/* the strip at hand */
	uint64_t a, b; /* its last two corners */
	int have;      /* how many of them there are */
	bool odd;      /* the next triangle is wound the other way */
} wh_facer;

/* Nothing is allocated yet. */
void wh_facer_init(wh_facer *f, const wh_source *source);
void wh_facer_close(wh_ctx *c, wh_facer *f);

/* Adds a face of n corners, all ids < nv; its triangles share what it carries. */
wh_code wh_facer_add(wh_ctx *c, wh_facer *f, const uint64_t *ids, size_t n);

/* Adds one triangle unless two of its corners are the same; counts nothing. */
wh_code wh_facer_put(wh_ctx *c, wh_facer *f, uint64_t a, uint64_t b, uint64_t d);

/* A strip: start it (or restart it in the middle), then give it corner by corner. */
void wh_facer_strip_start(wh_facer *f);
wh_code wh_facer_strip_corner(wh_ctx *c, wh_facer *f, uint64_t id);

#endif
