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
	WH_NEVER = 16, /* a cut vertex that was one in every round so far: it never was free */
	WH_EDGED = 32, /* while faces carry something: on an edge where that is not the same on both
	                  sides, or on the boundary (algo/wedge.c) */
	WH_LOCKED = WH_CUT | WH_FIXED | WH_HUB
};

/* Counts that a patch may have: corners are numbered by 32 bits, and the queue of a reduction keeps
 * one of them for itself. */
#define WH_PATCH_MOST_VERTICES ((uint32_t)INT32_MAX)
#define WH_PATCH_MOST_FACES (UINT32_MAX / 3 - 1)

typedef struct wh_patch {
	uint32_t nv, nf;
	uint32_t cap_v, cap_f; /* room in the arrays below */
	wh_vec3 *pos;          /* nv */
	uint32_t *tri;         /* 3 nf corners, counter-clockwise */
	uint64_t *gid;         /* nv global ids: what makes a cut vertex the same in two pieces */
	uint8_t *flag;         /* nv, of the enum above */
	float *err;            /* nv accumulated distance bounds, in units of the positions */
	uint8_t *attr;         /* nv records of attr_bytes each: what else a vertex carries */
	uint32_t attr_bytes;   /* 0: nothing; to be set before room is made */
	size_t cap_attr;       /* bytes */
	uint8_t *face;         /* nf records of face_bytes each: what a face and its corners carry
	                          (io/wedges.h) */
	uint32_t face_bytes;   /* 0: nothing; to be set before room is made */
	bool turnable;         /* that is the same whichever corner comes first */
	size_t cap_face;       /* bytes */
} wh_patch;

static inline uint8_t *wh_patch_attr(const wh_patch *p, uint32_t v)
{
	return p->attr + (size_t)v * p->attr_bytes;
}

static inline uint8_t *wh_patch_face(const wh_patch *p, uint32_t f)
{
	return p->face + (size_t)f * p->face_bytes;
}

/* Makes room for nv vertices and nf faces (contents lost) and sets the counts. An empty patch
 * ({0}) may grow. On failure the patch is fit for nothing but another reset, or to be freed. */
wh_code wh_patch_reset(wh_ctx *c, wh_patch *p, uint32_t nv, uint32_t nf);

/* Bytes of a patch of these counts. */
static inline size_t wh_patch_bytes(uint64_t nv, uint64_t nf, uint32_t attr_bytes,
                                    uint32_t face_bytes)
{
	return (size_t)nv * (37 + (size_t)attr_bytes) + (size_t)nf * (12 + (size_t)face_bytes);
}

void wh_patch_free(wh_ctx *c, wh_patch *p);

/* Drops vertices without faces; keeps the order. `map` has room for nv entries. Returns the
 * number dropped. */
uint32_t wh_patch_compact(wh_patch *p, uint32_t *map);

#endif
