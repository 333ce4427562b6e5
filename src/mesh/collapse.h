/*
 * collapse: records of edge collapses, and doing them again without looking for them.
 *
 * What a collapse does to the mesh follows from which vertex goes into which and where that one is
 * then: the faces that used both vanish, all others stay. So a run of collapses can be done again,
 * or the beginning of it, for a hundredth of what it took to find it.
 */
#ifndef WH_MESH_COLLAPSE_H
#define WH_MESH_COLLAPSE_H

#include "mesh/patch.h"

/* Vertices are places in the patch as it was before the first collapse; in a last pass, which goes
 * through a patch several times, as it was at the beginning of that time. */
typedef struct wh_collapse {
	uint32_t u, v; /* u goes, v stays */
	wh_vec3 at;    /* where v is then */
	double cost;
	double weight;  /* of the faces that the cost is the sum over */
	float err;      /* v's accumulated distance */
	uint32_t faces; /* that vanish: 1 or 2 */
} wh_collapse;

/* Where a run's collapses go, one after the other, with the attributes that v has then. */
typedef struct wh_collapse_sink {
	wh_code (*put)(wh_ctx *c, void *to, const wh_collapse *r, const uint8_t *attr);
	void *to;
} wh_collapse_sink;

/* Before the first collapse: every vertex of p into itself. `into` has room for p->nv. */
void wh_redo_begin(const wh_patch *p, uint32_t *into);

/* One collapse; faces are looked at in the end. The caller sees to attributes. */
static inline void wh_redo(wh_patch *p, uint32_t *into, const wh_collapse *r)
{
	into[r->u] = r->v;
	p->pos[r->v] = r->at;
	p->err[r->v] = r->err;
}

/* After the last: drops faces that vanished and vertices without faces. O(nv + nf). */
void wh_redo_end(wh_patch *p, uint32_t *into);

#endif
