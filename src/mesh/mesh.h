/*
 * mesh: an indexed triangle mesh in memory.
 *
 * Positions are doubles in file coordinates unless said otherwise; corners are counter-clockwise
 * seen from outside. Local ids are 32-bit: a mesh in memory holds fewer than 2^32 - 1 vertices.
 */
#ifndef WH_MESH_MESH_H
#define WH_MESH_MESH_H

#include "base/mem.h"
#include "geom/vec3.h"

#define WH_NONE UINT32_MAX

typedef struct wh_mesh {
	uint32_t nv;   /* vertices */
	uint32_t nf;   /* triangles */
	wh_vec3 *pos;  /* nv positions, owned */
	uint32_t *tri; /* 3 nf corner vertices, owned */
	float *colour; /* 3 nv: red, green and blue from 0 to 255, owned; NULL: none are known */
} wh_mesh;

/* Reserves positions and corners (contents undefined). On failure *m is empty. */
wh_code wh_mesh_alloc(wh_ctx *c, wh_mesh *m, uint32_t nv, uint32_t nf);

/* Frees the arrays and empties *m; an empty mesh is allowed. */
void wh_mesh_free(wh_ctx *c, wh_mesh *m);

#endif
