/*
 * order: a patch's vertices along a space-filling curve (Morton), its faces by their first vertex.
 *
 * For locality and for outputs that do not depend on how a patch came about: the same vertices
 * and faces, in whatever order, give the same bytes when no two vertices share a curve cell.
 */
#ifndef WH_MESH_ORDER_H
#define WH_MESH_ORDER_H

#include "mesh/patch.h"

/* A vertex on the curve. */
typedef struct wh_order_place {
	uint64_t key;
	uint32_t v;
} wh_order_place;

/* A workspace, grown as needed and reused; zero-initialise. */
typedef struct wh_order_workspace {
	wh_order_place *at; /* twice the vertices */
	uint32_t *map;
	wh_vec3 *room;
	uint32_t *tri;
	uint8_t *face;
	size_t at_cap, map_cap, room_cap, tri_cap, face_cap;
} wh_order_workspace;

/* Reorders p in place; faces that carry nothing, or what need not turn with them, are turned so
 * that their least vertex comes first. */
wh_code wh_patch_order(wh_ctx *c, wh_patch *p, wh_order_workspace *w);
void wh_order_workspace_free(wh_ctx *c, wh_order_workspace *w);

/* Bytes that takes besides the patch. */
size_t wh_patch_order_bytes(uint64_t nv, uint64_t nf, uint32_t face_bytes);

#endif
