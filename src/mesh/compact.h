/*
 * compact: a mesh in few bytes, to be looked at.
 *
 * Positions are rounded to a grid of 65536 steps along the longest side of a box, so that no vertex
 * moves by more than half a step a coordinate; faces keep their order and their corners' order,
 * vertices are numbered anew in the order in which faces come upon them, and those of no face are
 * left out. For meshes whose faces follow each other, as whittle writes them, that takes some 6
 * bytes a face.
 *
 * The bytes: for each face, for each of its three corners, a number n, then, where n is 0, three
 * differences x, y, z. A number is written in groups of 7 bits, the lowest first, all but the last
 * with their high bit set. n = 0 is a vertex not met before; else the corner is the vertex met n
 * ago: 1 is the latest. A difference d is from the corner before this one in the bytes (at the
 * very first: 0, 0, 0), on the grid, and stands as the number 2 d, or -2 d - 1 when it is
 * negative.
 */
#ifndef WH_MESH_COMPACT_H
#define WH_MESH_COMPACT_H

#include "mesh/mesh.h"

enum { WH_COMPACT_STEPS = 65535 }; /* the largest grid coordinate */

/* A place on the grid g is at origin + step * g. */
typedef struct wh_compact_grid {
	wh_vec3 origin;
	double step;
} wh_compact_grid;

typedef struct wh_compact {
	uint8_t *at; /* owned: wh_compact_free */
	size_t bytes, cap;
	uint32_t nv, nf; /* of them */
} wh_compact;

/* The grid of a box; of a box without size one whose every place is the same. */
wh_compact_grid wh_compact_grid_of(wh_vec3 lo, wh_vec3 hi);

/* Encodes a mesh into *out, which is emptied first. Positions of used vertices outside the grid are
 * drawn in to its nearest place; one that is no number becomes its origin. WH_OK or the failure
 * recorded: memory, or the caller's wish to stop. */
wh_code wh_compact_encode(wh_ctx *c, const wh_mesh *m, const wh_compact_grid *g, wh_compact *out);
void wh_compact_free(wh_ctx *c, wh_compact *m);

/* Bytes that encoding takes beside the mesh, the result included, at most. */
size_t wh_compact_bytes(uint64_t nv, uint64_t nf);

#endif
