/*
 * page: up to 512 triangles that lie together, as a record of bytes and opened for queries.
 *
 * A surface of any size is a row of pages (mesh/bvh). A record is what lies on disk, in the byte
 * order of the machine, without gaps:
 *
 *     4  vertices, 4  faces
 *     for each vertex   x, y, z       floats or doubles, in the units of whoever made the page
 *     for each vertex   r, g, b       floats from 0 to 255; coloured surfaces only
 *     for each vertex   id            8 bytes; numbered surfaces only
 *     for each face     three corners of 2 bytes each
 *
 * Vertices that an earlier page of the same soup has too come last. Opened, a page has positions in
 * a frame and boxes around its faces, eight by eight. A face that is a copy of the one before it
 * has no box: no search has to look at both.
 */
#ifndef WH_MESH_PAGE_H
#define WH_MESH_PAGE_H

#include "mesh/face_order.h"
#include "mesh/frame.h"
#include "mesh/mesh.h"

enum {
	WH_PAGE_FACES = 512, /* a power of eight */
	WH_PAGE_VERTICES = 3 * WH_PAGE_FACES,
	WH_PAGE_LEVELS = 3,
	WH_BOXES = 8
};

/* Eight boxes, one axis after the other; missing ones are inside out. Rounded outwards. */
typedef struct wh_boxes {
	float lo[3][WH_BOXES];
	float hi[3][WH_BOXES];
} wh_boxes;

/* What the records of a surface hold. */
typedef struct wh_page_layout {
	bool is_double; /* positions */
	bool coloured;
	bool numbered;
} wh_page_layout;

/* What is known of a page without reading it. */
typedef struct wh_page_entry {
	uint64_t at; /* of its record, in whatever holds them */
	uint32_t nv, nf;
	uint32_t own;   /* vertices that no earlier page of the soup has: they come first */
	wh_vec3 lo, hi; /* around its faces, in the units of the record, as is the next */
	double area;
	uint64_t copies; /* a hash of the one triangle that all its faces are; 0: they differ */
} wh_page_entry;

/* The faces that pages are made of. */
typedef struct wh_page_soup {
	uint32_t nv;
	const wh_vec3 *pos;
	const uint32_t *tri;
	const float *colour; /* 3 nv; of coloured layouts */
	const uint64_t *id;  /* nv; of numbered layouts; NULL: the number in the soup */
} wh_page_soup;

/* Scratch of making pages of one soup, in their order. */
typedef struct wh_page_maker {
	uint32_t *place; /* nv: in the page at hand; see page.c */
	size_t cap;
	uint32_t vertex[WH_PAGE_VERTICES]; /* of the page at hand, in the soup */
} wh_page_maker;

wh_code wh_page_maker_begin(wh_ctx *c, wh_page_maker *m, uint32_t nv);
void wh_page_maker_free(wh_ctx *c, wh_page_maker *m);
/* True when a page made so far has this vertex of the soup. */
bool wh_page_maker_has(const wh_page_maker *m, uint32_t v);

/* Bytes of a record. */
size_t wh_page_record_bytes(const wh_page_layout *l, uint32_t nv, uint32_t nf);

/* Writes the record of n <= WH_PAGE_FACES faces, and all of the entry but `at`. Returns the
 * record's bytes: no more than those of as many vertices as corners. */
size_t wh_page_make(wh_page_maker *m, const wh_page_layout *l, const wh_page_soup *soup,
                    const wh_face_item *items, uint32_t n, uint8_t *record, wh_page_entry *e);

/* An opened page. Its arrays lie in the caller's block. */
typedef struct wh_page {
	uint32_t nv, nf;
	wh_vec3 *pos;    /* local */
	wh_boxes *boxes; /* level by level, from the one whose boxes are triangles; NULL: none */
	float *colour;   /* NULL: none */
	uint64_t *id;
	uint16_t *tri;
	int levels;
	uint32_t first[WH_PAGE_LEVELS]; /* of each level */
} wh_page;

/* Bytes of a block for a page of these counts, a multiple of 64. */
size_t wh_page_bytes(const wh_page_layout *l, uint32_t nv, uint32_t nf);

/*
 * Opens a record into a block of wh_page_bytes, aligned to 64 bytes: positions become
 * pos * mul - sub. Without boxes it is good for nothing but looking at its faces. False when the
 * record is not one of these counts.
 */
bool wh_page_open(const wh_page_layout *l, const wh_page_entry *e, const uint8_t *record,
                  double mul, wh_vec3 sub, bool boxes, void *block, wh_page *p);

/* Position of a record's vertex, in its units. */
wh_vec3 wh_page_vertex(const wh_page_layout *l, const uint8_t *record, uint32_t v);

/* Nodes over so many children, and all levels of a tree over them: first[k] is where level k
 * begins. Returns the sum. */
uint32_t wh_boxes_over(uint32_t children);
uint32_t wh_boxes_layout(uint32_t children, uint32_t *first, int *levels);

/* Sets one box of a node: around lo .. hi, or around all boxes of a child. */
void wh_boxes_set(wh_boxes *n, uint32_t slot, wh_vec3 lo, wh_vec3 hi);
void wh_boxes_set_child(wh_boxes *n, uint32_t slot, const wh_boxes *child);
void wh_boxes_set_missing(wh_boxes *n, uint32_t slot);

#endif
