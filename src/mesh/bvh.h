/*
 * bvh: the nearest point of a surface of any size, fast.
 *
 * The triangles of a surface lie in pages (mesh/page), neighbours in space together, as records in
 * memory or in a file. A tree of boxes over the pages is always in memory, with a quarter of a byte
 * a face; the pages are all in memory, opened, or a few at a time in a reader's cache. Which of
 * the two changes nothing but the time.
 *
 *     begin -> add ... -> finish -> (open all) -> readers: page, nearest -> free
 *
 * Read-only once finished: any number of threads may query it, each with a reader of its own.
 */
#ifndef WH_MESH_BVH_H
#define WH_MESH_BVH_H

#include "mesh/page.h"

enum { WH_BVH_LEVELS = 11 }; /* 8^11 > 2^32 */

/* Reads the record at `at` into `record`, which has room for it. Called by several threads. */
typedef wh_code (*wh_page_fetch)(wh_ctx *c, void *user, uint64_t at, size_t bytes, uint8_t *record);

typedef struct wh_bvh {
	wh_page_layout layout;
	double unit; /* a power of two that the records' positions were multiplied by */
	uint32_t pages;
	wh_page_entry *entry;
	size_t cap;
	uint64_t faces;
	uint64_t vertices; /* in use; the caller sets it */
	uint64_t ids;      /* of vertices are below it */
	wh_page_fetch fetch;
	void *user;
	uint8_t *records; /* of surfaces built in memory: what is fetched from */
	/* once finished: */
	wh_frame frame;
	double *area;    /* pages + 1: of all pages before this one, local */
	wh_boxes *nodes; /* level by level, from the one whose boxes are pages */
	int levels;
	uint32_t first[WH_BVH_LEVELS];
	wh_page *open; /* all pages; NULL: readers fetch them */
	uint8_t *blocks;
} wh_bvh;

/* A page of the surface is added; entries come in their order. */
wh_code wh_bvh_add(wh_ctx *c, wh_bvh *t, const wh_page_entry *e);

/* Some points of the surface, evenly spread over its pages, in the coordinates of the world:
 * WH_BVH_SAMPLE at most, appended to points[*n ...]. */
enum { WH_BVH_SAMPLE = 32 * 1024 };
wh_code wh_bvh_sample(wh_ctx *c, const wh_bvh *t, wh_vec3 *points, size_t *n);

/* Around all faces, in the coordinates of the world. */
void wh_bvh_bounds(const wh_bvh *t, wh_vec3 *lo, wh_vec3 *hi);

/* All pages are there, one at least: makes the tree. Queries are in the coordinates of the
 * frame. Once more, with none open, for another frame. */
wh_code wh_bvh_finish(wh_ctx *c, wh_bvh *t, const wh_frame *f);

/* Opens all pages for queries, and closes them again. */
wh_code wh_bvh_open_all(wh_ctx *c, const wh_exec *ex, wh_bvh *t);
void wh_bvh_close_all(wh_ctx *c, wh_bvh *t);
/* Bytes that this takes. */
size_t wh_bvh_open_bytes(const wh_bvh *t);

void wh_bvh_free(wh_ctx *c, wh_bvh *t);

/*
 * A surface of a mesh in memory, whose faces are valid, at least one, and whose used vertices are
 * finite; degenerate faces count as the segments or points they are. Ends before finish; keeps no
 * reference to the mesh. The result does not depend on ex. On failure *t is empty.
 */
wh_code wh_bvh_build(wh_ctx *c, const wh_exec *ex, const wh_mesh *m, wh_bvh *t);

/* All leaves (eight faces each) that are no farther than `radius` from a point: queries near it
 * need no others. */
enum { WH_BVH_AROUND = 64 };

typedef struct wh_bvh_around {
	wh_vec3 centre;
	double radius;  /* 0: nothing is known */
	wh_vec3 last;   /* point */
	double step;    /* from point to point, about */
	uint32_t n;     /* leaves */
	uint32_t uses;  /* queries that did with them */
	uint32_t pause; /* queries to wait before the next try */
	wh_boxes boxes[WH_BVH_AROUND / WH_BOXES];
	struct {
		uint32_t page, node;
	} leaf[WH_BVH_AROUND];
} wh_bvh_around;

/* Reads the pages of a surface, and keeps some. One per thread. */
typedef struct wh_bvh_reader {
	const wh_bvh *t;
	bool boxes;      /* opened for queries */
	uint32_t slots;  /* pages that it keeps; 0: all are open anyway */
	uint32_t *slot;  /* of each page + 1; 0: it is not there */
	uint32_t *holds; /* page of each slot */
	bool *used;      /* since the hand came by */
	wh_page *page;
	uint8_t *blocks;
	size_t each; /* bytes of a block */
	uint8_t *record;
	uint32_t filled, hand;
	uint64_t fetched; /* pages so far */
	uint64_t tried;   /* faces whose distance was found so far */
	wh_bvh_around around;
} wh_bvh_reader;

enum { WH_BVH_SLOTS_LEAST = 2 };

/* `slots` pages are kept, at least two; none where all are open and boxes are wanted. The surface
 * must stay as it is. */
wh_code wh_bvh_reader_open(wh_ctx *c, wh_bvh_reader *r, const wh_bvh *t, uint32_t slots,
                           bool boxes);
void wh_bvh_reader_close(wh_ctx *c, wh_bvh_reader *r);
/* Bytes of a reader without slots, and of one slot. */
size_t wh_bvh_reader_bytes(const wh_bvh *t);
size_t wh_bvh_slot_bytes(const wh_bvh *t);

/* That page, of a reader that keeps some. */
const wh_page *wh_bvh_bring(wh_ctx *c, wh_bvh_reader *r, uint32_t page);
/* A page, which stays until the next page is asked for, by whoever asks this reader.
 * NULL: it could not be read, which is recorded. */
static inline const wh_page *wh_bvh_page(wh_ctx *c, wh_bvh_reader *r, uint32_t page)
{
	return r->slots == 0 ? &r->t->open[page] : wh_bvh_bring(c, r, page);
}

/* A face of the surface. */
typedef struct wh_bvh_face {
	uint32_t page, face; /* page: WH_NONE for no face */
} wh_bvh_face;

/*
 * Squared distance of p (local) from the surface, exact up to rounding. *near is the nearest face
 * of the point before, or none for a first point; it becomes the nearest one. Points that follow
 * each other in space are faster. Which of several faces at one distance it is depends on the
 * surface and the points since the first one alone. Far out, where boxes
 * tell faces apart no better than their distances do, the distance may be up to 2^-41 of it too
 * large; amid thousands of faces that floats take for a point, up to 2^-20 of the bulk's size.
 */
wh_code wh_bvh_nearest(wh_ctx *c, wh_bvh_reader *r, wh_vec3 p, wh_bvh_face *near, double *d2);

#endif
