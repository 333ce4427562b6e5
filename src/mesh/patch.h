/*
 * patch: a piece of a larger mesh in memory, with what must survive being cut out of it.
 *
 * Positions are in the run's units. A vertex that other pieces use too is a cut
 * vertex: it may not move or vanish, and the faces seen around it may be only some of its faces.
 */
#ifndef WH_MESH_PATCH_H
#define WH_MESH_PATCH_H

#include "mesh/mesh.h"

/* Why a vertex is special; zero for an ordinary interior vertex. */
enum {
	WH_CUT = 1,    /* used by another piece: locked, faces may be missing here */
	WH_FIXED = 2,  /* locked for good: non-manifold, or a boundary the user wants kept */
	WH_BORDER = 4, /* on a true boundary edge of the surface */
	WH_HUB = 8,    /* locked while it has very many faces */
	WH_LOCKED = WH_CUT | WH_FIXED | WH_HUB
};

typedef struct wh_patch {
	uint32_t nv, nf;
	uint32_t cap_v, cap_f; /* room in the arrays below */
	wh_vec3 *pos;          /* nv */
	uint32_t *tri;         /* 3 nf corners, counter-clockwise */
	uint64_t *gid;         /* nv global ids: what makes a cut vertex the same in two pieces */
	uint8_t *flag;         /* nv, of the enum above */
	float *err;            /* nv accumulated distance bounds, in units of the positions */
} wh_patch;

/* Makes room for nv vertices and nf faces (contents lost) and sets the counts. An empty patch
 * ({0}) may grow. On failure the patch keeps its old arrays. */
wh_code wh_patch_reset(wh_ctx *c, wh_patch *p, uint32_t nv, uint32_t nf);
void wh_patch_free(wh_ctx *c, wh_patch *p);

/* Drops vertices without faces; keeps the order. `map` is scratch for nv entries. Returns the
 * number dropped. */
uint32_t wh_patch_compact(wh_patch *p, uint32_t *map);

#endif
