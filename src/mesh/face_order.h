/*
 * face_order: faces in an order in which neighbours in space are neighbours in it.
 *
 * Faces are split by the widest axis of their centres, at the multiple of a power of eight nearest
 * to the middle, over and over: aligned runs of 8, 64, 512 ... faces are compact, whatever the
 * distribution, unlike those of a space-filling curve of fixed resolution.
 */
#ifndef WH_MESH_FACE_ORDER_H
#define WH_MESH_FACE_ORDER_H

#include "exec/exec.h"
#include "mesh/mesh.h"

typedef struct wh_face_item {
	float at[3]; /* centre of the face, thrice, from one of the vertices */
	uint32_t face;
} wh_face_item;

/* Items of nf >= 1 faces, in their order; coordinates are below 2^100. */
void wh_face_items(const wh_vec3 *pos, const uint32_t *tri, uint32_t nf, wh_face_item *items);

/* Puts them in order, on one thread or on several; the order is the same. */
void wh_face_order(wh_face_item *items, size_t n);
wh_code wh_face_order_parallel(wh_ctx *c, const wh_exec *ex, wh_face_item *items, size_t n);

#endif
