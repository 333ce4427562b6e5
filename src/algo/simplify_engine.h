/*
 * simplify_engine: what the files of the engine share; nobody else includes it.
 *
 *     simplify.c       the queue loop: from candidates to collapses
 *     star.c           face lists and rings: who is around a vertex
 *     collapse_cost.c  sums around a vertex; place and cost of a collapse
 *     collapse_rule.c  what may be collapsed: link condition, turning faces, distance
 */
#ifndef WH_ALGO_SIMPLIFY_ENGINE_H
#define WH_ALGO_SIMPLIFY_ENGINE_H

#include "algo/queue.h"
#include "algo/simplify.h"

/* What the faces and boundary edges around a vertex add up to. */
typedef struct wh_vertex_sum {
	double xx, xy, xz, yy, yz, zz; /* A, boundary terms included */
	wh_vec3 n;                     /* sum of area vectors */
} wh_vertex_sum;

/* A neighbour of a vertex, and the faces it shares with it. */
typedef struct wh_neighbour {
	uint32_t id;
	uint32_t outgoing, incoming; /* faces that run vertex -> id, and id -> vertex */
	uint32_t face[2];            /* the first two of them */
} wh_neighbour;

typedef struct wh_ring {
	wh_neighbour *item;
	uint32_t n;
	size_t cap;
} wh_ring;

enum { WH_LANES = 8 };

/* Evaluations side by side: edges from one vertex, the hub, to others (collapse_cost.c). */
typedef struct wh_lanes {
	double ex[WH_LANES], ey[WH_LANES], ez[WH_LANES]; /* edge: from the hub to the other end */
	double xx[WH_LANES], xy[WH_LANES], xz[WH_LANES]; /* the other end's sums */
	double yy[WH_LANES], yz[WH_LANES], zz[WH_LANES];
	double nx[WH_LANES], ny[WH_LANES], nz[WH_LANES];
	double px[WH_LANES], py[WH_LANES], pz[WH_LANES]; /* area vectors of the shared faces, */
	double qx[WH_LANES], qy[WH_LANES], qz[WH_LANES]; /* the second 0 on the boundary */
	double rim[WH_LANES];                            /* 1 on the boundary, else 0 */
	/* results: new place relative to the hub, cost, weight of the faces */
	double to_x[WH_LANES], to_y[WH_LANES], to_z[WH_LANES];
	double cost[WH_LANES], weight[WH_LANES];
} wh_lanes;

struct wh_simplify_work {
	wh_queue queue;
	wh_lanes lanes;                       /* unused lanes hold what they held before */
	uint32_t *first, *count, *generation; /* per vertex */
	wh_vertex_sum *sum;
	uint64_t *mark; /* tick << 32 | index in the ring being gathered */
	size_t cap_v;
	wh_vec3 *normal; /* per face */
	size_t cap_f;
	uint32_t *pool;
	size_t pool_cap, pool_used;
	wh_ring ring_u, ring_v, ring_w;
	uint32_t tick;
};

/* One run. */
typedef struct wh_engine {
	wh_ctx *c;
	struct wh_simplify_work *w;
	wh_patch *p;
	const wh_simplify_params *params;
	wh_simplify_result *result;
	uint32_t faces, vertices; /* alive */
	double highest_weight;    /* of the faces of the collapse with the highest cost */
} wh_engine;

/* A collapse worked out: u goes, v moves to x. */
typedef struct wh_collapse {
	uint32_t u, v;
	uint32_t shared[2]; /* faces on uv */
	uint32_t nshared;
	wh_vec3 x;
	double cost, weight;
} wh_collapse;

/* ---- faces and edges ---------------------------------------------------------------------- */

static inline wh_vec3 area_vector(wh_vec3 a, wh_vec3 b, wh_vec3 d)
{
	return wh_cross(wh_sub(b, a), wh_sub(d, a));
}

static inline wh_vec3 face_normal(const wh_patch *p, uint32_t f)
{
	const uint32_t *t = &p->tri[3 * (size_t)f];
	return area_vector(p->pos[t[0]], p->pos[t[1]], p->pos[t[2]]);
}

/* The two corners of f after v, in the face's direction. Which corner v is follows no pattern, so
 * nothing here is left to be predicted: two bits in each of two small tables tell the others. */
static inline void face_others(const wh_patch *p, uint32_t f, uint32_t v, uint32_t *a, uint32_t *b)
{
	enum { NEXT = 1 | 2 << 2 | 0 << 4, LAST = 2 | 0 << 2 | 1 << 4 };
	const uint32_t *t = &p->tri[3 * (size_t)f];
	const unsigned shift = (unsigned)(t[1] == v) * 2 + (unsigned)(t[2] == v) * 4;
	*a = t[(unsigned)NEXT >> shift & 3];
	*b = t[(unsigned)LAST >> shift & 3];
}

static inline uint32_t faces_on(const wh_neighbour *b)
{
	return b->outgoing + b->incoming;
}

static inline bool on_boundary(const wh_neighbour *b)
{
	return faces_on(b) == 1;
}

static inline bool ring_has_boundary(const wh_ring *r)
{
	for (uint32_t i = 0; i < r->n; i++)
		if (on_boundary(&r->item[i]))
			return true;
	return false;
}

static inline bool is_shared(const wh_collapse *k, uint32_t f)
{
	return f == k->shared[0] || (k->nshared == 2 && f == k->shared[1]);
}

static inline uint32_t apex_of(const wh_engine *e, const wh_collapse *k, uint32_t f)
{
	const uint32_t *t = &e->p->tri[3 * (size_t)f];
	for (int i = 0; i < 3; i++)
		if (t[i] != k->u && t[i] != k->v)
			return t[i];
	return WH_NONE;
}

/* ---- star.c ------------------------------------------------------------------------------- */

/* Lists the faces of each vertex. */
void wh_lists_build(wh_engine *e);

/* The neighbours of v, with the faces that join them. Marks them in the workspace. */
wh_code wh_gather(wh_engine *e, uint32_t v, wh_ring *r);

/* v's list becomes its own faces and u's, without the shared ones. */
wh_code wh_lists_join(wh_engine *e, const wh_collapse *k);

/* Takes the shared faces off the mesh. */
void wh_faces_drop(wh_engine *e, const wh_collapse *k);

/* The faces that were u's become v's; area vectors follow. */
void wh_faces_move(wh_engine *e, const wh_collapse *k);

/* ---- collapse_cost.c ---------------------------------------------------------------------- */

/* Sums of a free vertex from its faces; r, its ring, may be NULL when it is not on the boundary. */
void wh_sum_renew(wh_engine *e, uint32_t v, const wh_ring *r);

/* The same for any free vertex; gathers the ring itself when it is needed. */
wh_code wh_sum_renew_any(wh_engine *e, uint32_t v);

/* Place and cost of the collapse of k's edge, whose shared faces are known. v is the locked end
 * when there is one. */
void wh_collapse_evaluate(wh_engine *e, wh_collapse *k);

/* The same for up to WH_LANES edges at the free vertex v, the hub, with free other ends u: set each
 * lane, evaluate, read each lane. */
void wh_lanes_set(const wh_engine *e, wh_lanes *l, int lane, const wh_collapse *k);
void wh_lanes_evaluate(wh_lanes *l, const wh_vertex_sum *hub);
void wh_lanes_get(const wh_engine *e, const wh_lanes *l, int lane, wh_collapse *k);

/* ---- collapse_rule.c ---------------------------------------------------------------------- */

/* The link condition, with all boundary loops closed by an imaginary vertex: the links of u and
 * v meet in the link of uv and nowhere else. Leaves both rings gathered. */
wh_code wh_link_condition(wh_engine *e, const wh_collapse *k, bool *ok);

/* True when no face around `moving` but the shared ones turns too much at x. */
bool wh_faces_stay_sound(const wh_engine *e, const wh_collapse *k, uint32_t moving);

/* Estimate of the distance between the original surface and the one after the collapse. Needs
 * both rings gathered. */
double wh_accumulated(const wh_engine *e, const wh_collapse *k);

#endif
