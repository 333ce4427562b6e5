/*
 * What may be collapsed. Topology by the link condition (Dey, Edelsbrunner, Guha, Nekhayev 1999);
 * geometry by how far faces turn and, with an error limit, by how far the surface moves.
 */
#include "algo/simplify_engine.h"

#include "geom/tri.h"

/* A face may turn by at most acos of this in one collapse. There is no rule against thin faces:
 * scans are full of them, and collapses that pass through them are needed (refusing to thin a
 * face below 2 area / sum of squared edges = 0.02 stopped a dragon at eight times its count).
 * Against turning over in several steps a face may not pass to the other side of the mean direction
 * around the edge. */
static const double MIN_COSINE = 0.2;

static const wh_neighbour *ring_find(const wh_ring *r, uint32_t id)
{
	for (uint32_t i = 0; i < r->n; i++)
		if (r->item[i].id == id)
			return &r->item[i];
	return NULL;
}

/* True when the faces of v without the shared ones include one on both apexes. */
static bool has_face_on(const wh_engine *e, uint32_t v, uint32_t a, uint32_t b)
{
	const wh_simplify_work *w = e->w;
	for (uint32_t i = 0; i < w->count[v]; i++) {
		uint32_t p, q;
		face_others(e->p, w->pool[w->first[v] + i], v, &p, &q);
		if ((p == a && q == b) || (p == b && q == a))
			return true;
	}
	return false;
}

/* The link condition, with all boundary loops closed by an imaginary vertex: the links of u and
 * v meet in the link of uv and nowhere else. Leaves both rings gathered. */
wh_code wh_link_condition(wh_engine *e, const wh_collapse *k, bool *ok)
{
	wh_simplify_work *w = e->w;
	*ok = false;
	if (wh_gather(e, k->u, &w->ring_u) != WH_OK || wh_gather(e, k->v, &w->ring_v) != WH_OK)
		return e->c->err.code;
	/* marks now tell the neighbours of v */
	const bool v_locked = (e->p->flag[k->v] & WH_LOCKED) != 0;
	uint32_t common = 0;
	bool u_boundary = false;
	uint32_t apex[2] = {apex_of(e, k, k->shared[0]), WH_NONE};
	if (k->nshared == 2)
		apex[1] = apex_of(e, k, k->shared[1]);
	for (uint32_t i = 0; i < w->ring_u.n; i++) {
		const wh_neighbour *b = &w->ring_u.item[i];
		u_boundary = u_boundary || on_boundary(b);
		if (b->id == k->v)
			continue;
		if (w->mark[b->id] >> 32 == w->tick)
			common++;
		/* Another piece could make the edge or face that this would make. */
		if (v_locked && (e->p->flag[b->id] & WH_LOCKED) && b->id != apex[0] &&
		    b->id != apex[1])
			return WH_OK;
	}
	if (common != k->nshared || apex[0] == apex[1])
		return WH_OK;
	if (k->nshared == 2 && u_boundary && (v_locked || ring_has_boundary(&w->ring_v)))
		return WH_OK;
	for (uint32_t i = 0; i < k->nshared; i++) {
		/* A face on two boundary edges would leave an edge without faces; one on a boundary
		 * edge and a non-manifold edge would leave that edge with a face less. */
		const wh_neighbour *a = ring_find(&w->ring_u, apex[i]);
		const wh_neighbour *b = ring_find(&w->ring_v, apex[i]);
		if (!a || !b || (on_boundary(a) && faces_on(b) != 2) ||
		    (on_boundary(b) && faces_on(a) != 2))
			return WH_OK;
	}
	if (k->nshared == 2 && has_face_on(e, k->u, apex[0], apex[1])) {
		const uint8_t *flag = e->p->flag;
		if (has_face_on(e, k->v, apex[0], apex[1]))
			return WH_OK; /* a tetrahedron would become two faces on each other */
		if (v_locked && (flag[apex[0]] & WH_LOCKED) && (flag[apex[1]] & WH_LOCKED))
			return WH_OK; /* so would two caps on the same three locked vertices */
	}
	*ok = true;
	return WH_OK;
}

/* True when no face around `moving` but the shared ones turns too much at x. */
bool wh_faces_stay_sound(const wh_engine *e, const wh_collapse *k, uint32_t moving)
{
	const wh_simplify_work *w = e->w;
	wh_vec3 mean = w->sum[k->u].n; /* sums are current for free vertices, as u always is */
	if (!(e->p->flag[k->v] & WH_LOCKED))
		mean = wh_add(mean, w->sum[k->v].n);
	for (uint32_t i = 0; i < w->count[moving]; i++) {
		const uint32_t f = w->pool[w->first[moving] + i];
		if (is_shared(k, f))
			continue;
		uint32_t a, b;
		face_others(e->p, f, moving, &a, &b);
		const wh_vec3 n0 = w->normal[f];
		const wh_vec3 n1 = area_vector(k->x, e->p->pos[a], e->p->pos[b]);
		const double d = wh_dot(n0, n1), q0 = wh_norm2(n0), q1 = wh_norm2(n1);
		if (q0 > 0 && !(d > 0 && d * d >= MIN_COSINE * MIN_COSINE * q0 * q1))
			return false;
		if (wh_dot(n1, mean) < 0 && wh_dot(n0, mean) >= 0)
			return false;
	}
	return true;
}

/* How far one collapse moves the surface: the largest distance, over some points of one star,
 * from the other star. Squared. Looking stops once the limit is passed. */
typedef struct stretch {
	double far2, limit2;
} stretch;

/* Raises the stretch to the distance of `at` + `by` from the faces around u and v, as they are
 * now, or (`after`) as they will be with both at x. A face that is near enough to change nothing
 * ends the search. All is seen from `at`, a vertex: far from zero a middle between two vertices
 * may not be a double. */
static void stretch_to(const wh_engine *e, const wh_collapse *k, wh_vec3 at, wh_vec3 by, bool after,
                       stretch *s)
{
	const wh_vec3 *pos = e->p->pos;
	const wh_simplify_work *w = e->w;
	const uint32_t ends[2] = {k->u, k->v};
	double least = INFINITY;
	if (!(s->far2 <= s->limit2))
		return;
	for (int j = 0; j < 2; j++)
		for (uint32_t i = 0; i < w->count[ends[j]]; i++) {
			const uint32_t f = w->pool[w->first[ends[j]] + i];
			if (after && is_shared(k, f))
				continue;
			uint32_t a, b;
			face_others(e->p, f, ends[j], &a, &b);
			const wh_vec3 tip = after ? k->x : pos[ends[j]];
			least = fmin(least, wh_tri_dist2(by, wh_sub(tip, at), wh_sub(pos[a], at),
			                                 wh_sub(pos[b], at)));
			if (least <= s->far2)
				return;
		}
	s->far2 = least;
}

/* The middles of the edges from `end` to its ring, before the collapse and after it. */
static void stretch_to_spokes(const wh_engine *e, const wh_collapse *k, uint32_t end,
                              const wh_ring *r, stretch *s)
{
	for (uint32_t i = 0; i < r->n; i++) {
		const uint32_t id = r->item[i].id;
		if (id == k->u || id == k->v)
			continue;
		const wh_vec3 q = e->p->pos[id];
		stretch_to(e, k, q, wh_scale(wh_sub(k->x, q), 0.5), false, s);
		stretch_to(e, k, q, wh_scale(wh_sub(e->p->pos[end], q), 0.5), true, s);
	}
}

/* Estimate of the distance between the original surface and the one after the collapse, near the
 * new vertex: the worse of the two ends' estimates plus how far this step moves the surface,
 * probed at the vertices and the middles of the edges of both stars. Measured on four scans with
 * limits of 0.02 to 1 % of the diagonal, the real maximum is 0.5 to 1.9 times the limit, mostly
 * 0.8 to 1.2. */
double wh_accumulated(const wh_engine *e, const wh_collapse *k)
{
	const double base = fmax((double)e->p->err[k->u], (double)e->p->err[k->v]);
	const double left = e->params->max_err - base;
	const wh_vec3 here = wh_v3(0, 0, 0);
	stretch s = {.far2 = 0, .limit2 = left > 0 ? left * left : 0};
	stretch_to(e, k, e->p->pos[k->u], here, true, &s);
	if (!(e->p->flag[k->v] & WH_LOCKED)) {
		stretch_to(e, k, e->p->pos[k->v], here, true, &s);
		stretch_to(e, k, k->x, here, false, &s);
	}
	stretch_to_spokes(e, k, k->u, &e->w->ring_u, &s);
	if (!(e->p->flag[k->v] & WH_LOCKED))
		stretch_to_spokes(e, k, k->v, &e->w->ring_v, &s);
	return base + sqrt(s.far2);
}
