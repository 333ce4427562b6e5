/*
 * Edge collapse in near-greedy order with memoryless quadrics.
 *
 * Idea. The cost of collapsing edge uv is measured against the faces of the mesh as it is now,
 * not against the original (Lindstrom & Turk, "Fast and memory efficient polygonal
 * simplification", 1998; Hoppe, "New quadric metric", 1999, "memoryless"): the sum over the faces
 * around u and v of the squared volume between the face and the new vertex. Boundary edges add
 * the squared area swept on either side. The new vertex minimises that sum, and keeps the volume
 * under the surface as it was. No quadric is stored with the mesh, so a vertex on a cut needs no
 * special care.
 *
 * Around vertex u every face plane passes through u. So with x the new position, A(u) the sum of
 * n n' over the faces of u (n: their area vectors) and S the same over the one or two faces
 * shared by u and v,
 *
 *     cost(x) = (x-u)' A(u) (x-u) + (x-v)' A(v) (x-v) - (x-u)' S (x-u)
 *
 * exactly: six numbers a vertex, and no file coordinates anywhere. A and the sum of area vectors
 * are kept for every vertex that may move, and summed afresh when a face around it changes.
 *
 * Order. Candidates wait in a bucket queue (queue.h). A collapse re-evaluates the edges of the
 * vertex it made; costs of edges further away go stale, and an entry is evaluated again when it
 * is taken: if it got dearer it goes back. An entry is dead when the edges of one of its ends
 * were pushed anew since (generation stamps).
 *
 * Invariants. pool[first[v] .. first[v]+count[v]) are the faces of v, each once; normal[f] is the
 * area vector of f; sum[v] is current for every vertex that is not locked. A dead face has
 * tri[3f] == WH_NONE.
 *
 * Cost: about 8 evaluations a collapse; 150 to 170 bytes a face at the start.
 */
#include "algo/simplify.h"

#include "algo/queue.h"
#include "base/real.h"
#include "geom/tri.h"

#include <math.h>
#include <string.h>

/* A boundary edge e swept along d weighs 4 |e|^2 |e x d|^2. Lindstrom & Turk's two terms at equal
 * weights would give 9, with the length of the collapsed edge for that of e; measured on three
 * scans with boundary, 4 has the least error on all (2 and 40 the most). */
static const double BOUNDARY_WEIGHT = 4.0;
/* Pulls the new vertex to the edge's midpoint where the faces leave a direction free. Stronger
 * pulls cost error: 1e-3 gives 8 % more than 1e-5 on a dragon of 87 k faces. */
static const double MIDPOINT_PULL = 1e-6;
/* Prefers short edges where the faces do not tell (flat regions). */
static const double LENGTH_TIE = 1e-6;
/* A face may turn by at most acos of this in one collapse. There is no rule against thin faces:
 * scans are full of them, and collapses that pass through them are needed (refusing to thin a
 * face below 2 area / sum of squared edges = 0.02 stopped a dragon at eight times its count). */
static const double MIN_COSINE = 0.2;

/* What the faces and boundary edges around a vertex add up to. */
typedef struct vertex_sum {
	double xx, xy, xz, yy, yz, zz; /* A, boundary terms included */
	wh_vec3 n;                     /* sum of area vectors */
} vertex_sum;

/* A neighbour of a vertex, and the faces it shares with it. */
typedef struct neighbour {
	uint32_t id;
	uint32_t outgoing, incoming; /* faces that run vertex -> id, and id -> vertex */
	uint32_t face[2];            /* the first two of them */
} neighbour;

typedef struct ring {
	neighbour *item;
	uint32_t n;
	size_t cap;
} ring;

struct wh_simplify_work {
	wh_queue queue;
	uint32_t *first, *count, *generation; /* per vertex */
	vertex_sum *sum;
	uint64_t *mark; /* tick << 32 | index in the ring being gathered */
	size_t cap_v;
	wh_vec3 *normal; /* per face */
	size_t cap_f;
	uint32_t *pool;
	size_t pool_cap, pool_used;
	ring ring_u, ring_v, ring_w;
	uint32_t tick;
};

/* One run. */
typedef struct engine {
	wh_ctx *c;
	struct wh_simplify_work *w;
	wh_patch *p;
	const wh_simplify_params *params;
	wh_simplify_result *result;
	uint32_t faces, vertices; /* alive */
	double highest_weight;    /* of the faces of the collapse with the highest cost */
} engine;

/* A collapse worked out: u goes, v moves to x. */
typedef struct plan {
	uint32_t u, v;
	uint32_t shared[2]; /* faces on uv */
	uint32_t nshared;
	wh_vec3 x;
	double cost, weight;
} plan;

wh_simplify_work *wh_simplify_work_new(wh_ctx *c)
{
	return wh_calloc(c, 1, sizeof(wh_simplify_work));
}

void wh_simplify_work_free(wh_ctx *c, wh_simplify_work *w)
{
	if (!w)
		return;
	wh_queue_free(c, &w->queue);
	wh_free(c, w->first);
	wh_free(c, w->count);
	wh_free(c, w->generation);
	wh_free(c, w->sum);
	wh_free(c, w->mark);
	wh_free(c, w->normal);
	wh_free(c, w->pool);
	wh_free(c, w->ring_u.item);
	wh_free(c, w->ring_v.item);
	wh_free(c, w->ring_w.item);
	wh_free(c, w);
}

size_t wh_simplify_bytes(uint64_t nv, uint64_t nf)
{
	const size_t vertex = 3 * sizeof(uint32_t) + sizeof(vertex_sum) + sizeof(uint64_t);
	/* a normal, list entries (twice while they are compacted), and two to three queue entries
	 * for each face */
	const size_t face = sizeof(wh_vec3) + 9 * sizeof(uint32_t) + 3 * sizeof(wh_candidate);
	return (size_t)nv * vertex + (size_t)nf * face + sizeof(wh_simplify_work);
}

static wh_code renew(wh_ctx *c, void *array_ptr, size_t count, size_t size)
{
	void *block;
	memcpy(&block, array_ptr, sizeof block);
	wh_free(c, block);
	block = wh_alloc(c, count, size);
	memcpy(array_ptr, &block, sizeof block);
	return block ? WH_OK : c->err.code;
}

/* Makes the workspace fit a patch; contents are lost. */
static wh_code work_fit(wh_ctx *c, wh_simplify_work *w, const wh_patch *p)
{
	if (p->nv > w->cap_v) {
		w->cap_v = 0;
		if (renew(c, &w->first, p->nv, sizeof *w->first) ||
		    renew(c, &w->count, p->nv, sizeof *w->count) ||
		    renew(c, &w->generation, p->nv, sizeof *w->generation) ||
		    renew(c, &w->sum, p->nv, sizeof *w->sum) ||
		    renew(c, &w->mark, p->nv, sizeof *w->mark))
			return c->err.code;
		w->cap_v = p->nv;
	}
	if (p->nf > w->cap_f) {
		w->cap_f = 0;
		if (renew(c, &w->normal, p->nf, sizeof *w->normal))
			return c->err.code;
		w->cap_f = p->nf;
	}
	/* Lists move to the end of the pool when they grow: half as much again as at the start
	 * keeps the compactions few. */
	const size_t need = 3 * (size_t)p->nf + 3 * (size_t)p->nf / 2 + 64;
	if (need > w->pool_cap) {
		w->pool_cap = 0;
		if (renew(c, &w->pool, need, sizeof *w->pool))
			return c->err.code;
		w->pool_cap = need;
	}
	return WH_OK;
}

/* ---- geometry of faces ------------------------------------------------------------------- */

static wh_vec3 area_vector(wh_vec3 a, wh_vec3 b, wh_vec3 d)
{
	return wh_cross(wh_sub(b, a), wh_sub(d, a));
}

static wh_vec3 face_normal(const wh_patch *p, uint32_t f)
{
	const uint32_t *t = &p->tri[3 * (size_t)f];
	return area_vector(p->pos[t[0]], p->pos[t[1]], p->pos[t[2]]);
}

/* The two corners of f after v, in the face's direction. */
static void face_others(const wh_patch *p, uint32_t f, uint32_t v, uint32_t *a, uint32_t *b)
{
	const uint32_t *t = &p->tri[3 * (size_t)f];
	if (t[0] == v) {
		*a = t[1];
		*b = t[2];
	} else if (t[1] == v) {
		*a = t[2];
		*b = t[0];
	} else {
		*a = t[0];
		*b = t[1];
	}
}

static void sum_outer(vertex_sum *s, wh_vec3 n, double w)
{
	s->xx += w * n.x * n.x;
	s->xy += w * n.x * n.y;
	s->xz += w * n.x * n.z;
	s->yy += w * n.y * n.y;
	s->yz += w * n.y * n.z;
	s->zz += w * n.z * n.z;
}

static void sum_face(vertex_sum *s, wh_vec3 n)
{
	sum_outer(s, n, 1.0);
	s->n = wh_add(s->n, n);
}

/* |e x d|^2 = d' (|e|^2 I - e e') d */
static void sum_boundary_edge(vertex_sum *s, wh_vec3 e)
{
	const double len2 = wh_norm2(e);
	const double w = BOUNDARY_WEIGHT * len2;
	s->xx += w * len2;
	s->yy += w * len2;
	s->zz += w * len2;
	sum_outer(s, e, -w);
}

/* ---- rings -------------------------------------------------------------------------------- */

static neighbour *ring_entry(engine *e, ring *r, uint32_t id)
{
	wh_simplify_work *w = e->w;
	if (w->mark[id] >> 32 == w->tick)
		return &r->item[(uint32_t)w->mark[id]];
	if (wh_reserve(e->c, &r->item, &r->cap, (size_t)r->n + 1, sizeof *r->item) != WH_OK)
		return NULL;
	w->mark[id] = (uint64_t)w->tick << 32 | r->n;
	neighbour *b = &r->item[r->n++];
	*b = (neighbour){.id = id, .face = {WH_NONE, WH_NONE}};
	return b;
}

static void neighbour_add_face(neighbour *b, uint32_t f)
{
	if (b->face[0] == WH_NONE)
		b->face[0] = f;
	else if (b->face[1] == WH_NONE)
		b->face[1] = f;
}

/* A new tick makes all marks old. */
static void next_tick(engine *e)
{
	wh_simplify_work *w = e->w;
	if (++w->tick == 0) {
		memset(w->mark, 0, w->cap_v * sizeof *w->mark);
		w->tick = 1;
	}
}

/* The neighbours of v, with the faces that join them. */
static wh_code gather(engine *e, uint32_t v, ring *r)
{
	const wh_simplify_work *w = e->w;
	next_tick(e);
	r->n = 0;
	for (uint32_t i = 0; i < w->count[v]; i++) {
		const uint32_t f = w->pool[w->first[v] + i];
		uint32_t a, b;
		face_others(e->p, f, v, &a, &b);
		neighbour *to = ring_entry(e, r, a);
		if (!to)
			return e->c->err.code;
		to->outgoing++;
		neighbour_add_face(to, f);
		neighbour *from = ring_entry(e, r, b);
		if (!from)
			return e->c->err.code;
		from->incoming++;
		neighbour_add_face(from, f);
	}
	return WH_OK;
}

static uint32_t faces_on(const neighbour *b)
{
	return b->outgoing + b->incoming;
}

static bool on_boundary(const neighbour *b)
{
	return faces_on(b) == 1;
}

static bool ring_has_boundary(const ring *r)
{
	for (uint32_t i = 0; i < r->n; i++)
		if (on_boundary(&r->item[i]))
			return true;
	return false;
}

/* Sums of a free vertex from its faces; its ring is needed only when it lies on the boundary. */
static void sum_renew(engine *e, uint32_t v, const ring *r)
{
	const wh_simplify_work *w = e->w;
	vertex_sum s = {0};
	for (uint32_t i = 0; i < w->count[v]; i++)
		sum_face(&s, w->normal[w->pool[w->first[v] + i]]);
	for (uint32_t i = 0; r && i < r->n; i++)
		if (on_boundary(&r->item[i]))
			sum_boundary_edge(&s, wh_sub(e->p->pos[r->item[i].id], e->p->pos[v]));
	e->w->sum[v] = s;
}

static wh_code sum_renew_any(engine *e, uint32_t v)
{
	if (!(e->p->flag[v] & WH_BORDER)) {
		sum_renew(e, v, NULL);
		return WH_OK;
	}
	if (gather(e, v, &e->w->ring_w) != WH_OK)
		return e->c->err.code;
	sum_renew(e, v, &e->w->ring_w);
	return WH_OK;
}

/* ---- setting up --------------------------------------------------------------------------- */

static void lists_build(engine *e)
{
	wh_simplify_work *w = e->w;
	const wh_patch *p = e->p;
	memset(w->count, 0, p->nv * sizeof *w->count);
	for (size_t i = 0; i < 3 * (size_t)p->nf; i++)
		w->count[p->tri[i]]++;
	uint32_t at = 0;
	for (uint32_t v = 0; v < p->nv; v++) {
		w->first[v] = at;
		at += w->count[v];
		w->count[v] = 0;
	}
	for (uint32_t f = 0; f < p->nf; f++)
		for (int k = 0; k < 3; k++) {
			const uint32_t v = p->tri[3 * (size_t)f + (size_t)k];
			w->pool[w->first[v] + w->count[v]++] = f;
		}
	w->pool_used = 3 * (size_t)p->nf;
}

/* True when the faces of v, whose ring is r, form one fan: walking from face to face around v
 * meets them all. With every edge in at most two faces, a fan is a path or a cycle, and several
 * fans show as more than two boundary edges or as a cycle shorter than the face count. */
static bool one_fan(const engine *e, uint32_t v, const ring *r)
{
	const wh_simplify_work *w = e->w;
	uint32_t start = 0, ends = 0;
	for (uint32_t i = 0; i < r->n; i++)
		if (on_boundary(&r->item[i])) {
			ends++;
			if (r->item[i].outgoing)
				start = i;
		}
	if (ends > 2)
		return false;
	uint32_t at = start, walked = 0;
	do {
		const neighbour *b = &r->item[at];
		uint32_t f = WH_NONE, a = WH_NONE, next = WH_NONE;
		for (int k = 0; k < 2; k++) { /* the face that runs v -> b */
			if (b->face[k] == WH_NONE)
				continue;
			face_others(e->p, b->face[k], v, &a, &next);
			if (a == b->id) {
				f = b->face[k];
				break;
			}
		}
		if (f == WH_NONE)
			break;
		walked++;
		at = (uint32_t)w->mark[next];
	} while (at != start && walked <= w->count[v]);
	return walked == w->count[v];
}

/* Classifies a vertex whose faces are all here: on the boundary, or not manifold (then fixed). */
static wh_code classify(engine *e, uint32_t v)
{
	ring *r = &e->w->ring_w;
	uint8_t *flag = &e->p->flag[v];
	if (gather(e, v, r) != WH_OK)
		return e->c->err.code;
	bool manifold = true;
	for (uint32_t i = 0; i < r->n; i++)
		manifold = manifold && r->item[i].outgoing <= 1 && r->item[i].incoming <= 1;
	*flag &= (uint8_t)~WH_BORDER;
	if (ring_has_boundary(r))
		*flag |= WH_BORDER;
	if (!manifold || (r->n > 0 && !one_fan(e, v, r))) {
		if (!(*flag & WH_FIXED))
			e->result->fixed++;
		*flag |= WH_FIXED;
	}
	if ((*flag & WH_BORDER) && e->params->lock_boundary)
		*flag |= WH_FIXED;
	if (!(*flag & WH_FIXED))
		sum_renew(e, v, r);
	return WH_OK;
}

/* ---- evaluation --------------------------------------------------------------------------- */

/* Inverse of a symmetric 3 x 3 matrix, by cofactors: one division. Its condition is bounded by the
 * shift on the diagonal, so nothing is lost in doubles. */
typedef struct inverse {
	double xx, xy, xz, yy, yz, zz;
} inverse;

static inverse invert(const vertex_sum *h, double shift)
{
	const double a = h->xx + shift, d = h->yy + shift, f = h->zz + shift;
	const double b = h->xy, c = h->xz, e = h->yz;
	const double xx = d * f - e * e, xy = c * e - b * f, xz = b * e - c * d;
	const double det = a * xx + b * xy + c * xz;
	const double r = 1.0 / det;
	return (inverse){
	    xx * r, xy * r, xz * r, (a * f - c * c) * r, (b * c - a * e) * r, (a * d - b * b) * r};
}

static wh_vec3 inverse_times(const inverse *m, wh_vec3 v)
{
	return wh_v3(m->xx * v.x + m->xy * v.y + m->xz * v.z,
	             m->xy * v.x + m->yy * v.y + m->yz * v.z,
	             m->xz * v.x + m->yz * v.y + m->zz * v.z);
}

static wh_vec3 sum_times(const vertex_sum *s, wh_vec3 d)
{
	return wh_v3(s->xx * d.x + s->xy * d.y + s->xz * d.z,
	             s->xy * d.x + s->yy * d.y + s->yz * d.z,
	             s->xz * d.x + s->yz * d.y + s->zz * d.z);
}

static double sum_form(const vertex_sum *s, wh_vec3 d)
{
	return wh_dot(d, sum_times(s, d));
}

static double sum_trace(const vertex_sum *s)
{
	return s->xx + s->yy + s->zz;
}

/* A(u) + A(v) less what both count: the shared faces and, on the boundary, the edge itself. */
static vertex_sum sum_joined(const engine *e, const plan *k, wh_vec3 edge)
{
	const vertex_sum *a = &e->w->sum[k->u], *b = &e->w->sum[k->v];
	vertex_sum h = {a->xx + b->xx, a->xy + b->xy, a->xz + b->xz,     a->yy + b->yy,
	                a->yz + b->yz, a->zz + b->zz, wh_add(a->n, b->n)};
	for (uint32_t i = 0; i < k->nshared; i++) {
		const wh_vec3 n = e->w->normal[k->shared[i]];
		sum_outer(&h, n, -1.0);
		h.n = wh_sub(h.n, n);
	}
	if (k->nshared == 1) {
		const double len2 = wh_norm2(edge);
		const double w = BOUNDARY_WEIGHT * len2;
		h.xx -= w * len2;
		h.yy -= w * len2;
		h.zz -= w * len2;
		sum_outer(&h, edge, w);
	}
	return h;
}

/* Where the vertex made of a free edge goes, relative to u. */
static wh_vec3 best_place(const engine *e, const plan *k, const vertex_sum *h, wh_vec3 edge)
{
	const vertex_sum *b = &e->w->sum[k->v];
	const double pull = MIDPOINT_PULL * sum_trace(h);
	if (!(pull > 0))
		return wh_scale(edge, 0.5);
	const inverse inv = invert(h, pull);
	const wh_vec3 g = wh_add(sum_times(b, edge), wh_scale(edge, 0.5 * pull));
	wh_vec3 y = inverse_times(&inv, g);
	/* Lindstrom & Turk's first constraint: the volume under the surface stays. */
	const wh_vec3 m = inverse_times(&inv, h->n);
	const double nm = wh_dot(h->n, m);
	if (nm > 0) {
		const double gap = wh_dot(b->n, edge) - wh_dot(h->n, y);
		y = wh_add(y, wh_scale(m, gap / nm));
	}
	/* A minimum far away is an artefact of a nearly singular sum. */
	if (!(wh_norm2(wh_sub(y, wh_scale(edge, 0.5))) <= 4.0 * wh_norm2(edge)))
		return wh_scale(edge, 0.5);
	return y;
}

static wh_vec3 round_position(const engine *e, wh_vec3 x)
{
	if (e->params->float_positions)
		return wh_v3(wh_round_float(x.x), wh_round_float(x.y), wh_round_float(x.z));
	return x;
}

/* Place and cost of the collapse of k's edge; shared faces are known. v is the locked end when
 * there is one, and then it stays where it is: only the faces of u change. */
static void evaluate(const engine *e, plan *k)
{
	const wh_vec3 pu = e->p->pos[k->u], pv = e->p->pos[k->v];
	const wh_vec3 edge = wh_sub(pv, pu);
	const vertex_sum *a = &e->w->sum[k->u];
	double cost;
	if (e->p->flag[k->v] & WH_LOCKED) {
		k->x = pv;
		cost = sum_form(a, edge);
		k->weight = sum_trace(a);
	} else {
		const vertex_sum h = sum_joined(e, k, edge);
		k->x = round_position(e, wh_add(pu, best_place(e, k, &h, edge)));
		const wh_vec3 y = wh_sub(k->x, pu);
		cost = sum_form(&h, y) - 2.0 * wh_dot(sum_times(&e->w->sum[k->v], edge), y) +
		       sum_form(&e->w->sum[k->v], edge);
		k->weight = sum_trace(&h);
	}
	k->cost = fmax(cost, 0.0) + LENGTH_TIE * k->weight * wh_norm2(edge);
}

/* Orders the ends so that a locked one survives; false when the edge can never be collapsed. */
static bool orient(const engine *e, plan *k)
{
	if (e->p->flag[k->u] & WH_LOCKED) {
		const uint32_t t = k->u;
		k->u = k->v;
		k->v = t;
	}
	if (e->p->flag[k->u] & WH_LOCKED)
		return false;
	/* An inner edge between two boundary vertices: collapsing it would pinch the surface. */
	return !(k->nshared == 2 && (e->p->flag[k->u] & WH_BORDER) &&
	         (e->p->flag[k->v] & WH_BORDER));
}

static wh_code push_edge(engine *e, uint32_t v, const neighbour *b)
{
	plan k = {.u = b->id, .v = v, .shared = {b->face[0], b->face[1]}};
	k.nshared = faces_on(b);
	if (k.nshared > 2 || !orient(e, &k))
		return WH_OK;
	evaluate(e, &k);
	if (!(k.cost <= e->params->max_cost))
		return WH_OK;
	wh_simplify_work *w = e->w;
	return wh_queue_push(e->c, &w->queue, wh_queue_bucket(&w->queue, k.cost), k.u, k.v,
	                     w->generation[k.u] + w->generation[k.v]);
}

/* ---- legality ----------------------------------------------------------------------------- */

static bool find_shared(const engine *e, plan *k)
{
	const wh_simplify_work *w = e->w;
	k->nshared = 0;
	for (uint32_t i = 0; i < w->count[k->u]; i++) {
		const uint32_t f = w->pool[w->first[k->u] + i];
		const uint32_t *t = &e->p->tri[3 * (size_t)f];
		if (t[0] != k->v && t[1] != k->v && t[2] != k->v)
			continue;
		if (k->nshared == 2)
			return false;
		k->shared[k->nshared++] = f;
	}
	return k->nshared > 0;
}

static uint32_t apex_of(const engine *e, const plan *k, uint32_t f)
{
	const uint32_t *t = &e->p->tri[3 * (size_t)f];
	for (int i = 0; i < 3; i++)
		if (t[i] != k->u && t[i] != k->v)
			return t[i];
	return WH_NONE;
}

static const neighbour *ring_find(const ring *r, uint32_t id)
{
	for (uint32_t i = 0; i < r->n; i++)
		if (r->item[i].id == id)
			return &r->item[i];
	return NULL;
}

/* True when the faces of v without the shared ones include one on both apexes. */
static bool has_face_on(const engine *e, uint32_t v, uint32_t a, uint32_t b)
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
static wh_code link_condition(engine *e, const plan *k, bool *ok)
{
	wh_simplify_work *w = e->w;
	*ok = false;
	if (gather(e, k->u, &w->ring_u) != WH_OK || gather(e, k->v, &w->ring_v) != WH_OK)
		return e->c->err.code;
	/* marks now tell the neighbours of v */
	const bool v_locked = (e->p->flag[k->v] & WH_LOCKED) != 0;
	uint32_t common = 0;
	bool u_boundary = false;
	uint32_t apex[2] = {apex_of(e, k, k->shared[0]), WH_NONE};
	if (k->nshared == 2)
		apex[1] = apex_of(e, k, k->shared[1]);
	for (uint32_t i = 0; i < w->ring_u.n; i++) {
		const neighbour *b = &w->ring_u.item[i];
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
		const neighbour *a = ring_find(&w->ring_u, apex[i]);
		const neighbour *b = ring_find(&w->ring_v, apex[i]);
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

static bool is_shared(const plan *k, uint32_t f)
{
	return f == k->shared[0] || (k->nshared == 2 && f == k->shared[1]);
}

/* True when no face around `moving` but the shared ones turns too much at x. */
static bool faces_stay_sound(const engine *e, const plan *k, uint32_t moving)
{
	const wh_simplify_work *w = e->w;
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
	}
	return true;
}

/* How far one collapse moves the surface: the largest distance, over some points of one star,
 * from the other star. Squared. Looking stops once the limit is passed. */
typedef struct stretch {
	double far2, limit2;
} stretch;

/* Raises the stretch to the distance of q from the faces around u and v, as they are now, or
 * (`after`) as they will be with both at x. A face that is near enough to change nothing ends the
 * search. */
static void stretch_to(const engine *e, const plan *k, wh_vec3 q, bool after, stretch *s)
{
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
			const wh_vec3 tip = after ? k->x : e->p->pos[ends[j]];
			least = fmin(least, wh_tri_dist2(q, tip, e->p->pos[a], e->p->pos[b]));
			if (least <= s->far2)
				return;
		}
	s->far2 = least;
}

/* The middles of the edges from `end` to its ring, before the collapse and after it. */
static void stretch_to_spokes(const engine *e, const plan *k, uint32_t end, const ring *r,
                              stretch *s)
{
	for (uint32_t i = 0; i < r->n; i++) {
		const uint32_t id = r->item[i].id;
		if (id == k->u || id == k->v)
			continue;
		const wh_vec3 q = e->p->pos[id];
		stretch_to(e, k, wh_scale(wh_add(q, k->x), 0.5), false, s);
		stretch_to(e, k, wh_scale(wh_add(q, e->p->pos[end]), 0.5), true, s);
	}
}

/* Estimate of the distance between the original surface and the one after the collapse, near the
 * new vertex: the worse of the two ends' estimates plus how far this step moves the surface,
 * probed at the vertices and the middles of the edges of both stars. Measured on four scans with
 * limits of 0.02 to 1 % of the diagonal, the real maximum is 0.5 to 1.9 times the limit, mostly
 * 0.8 to 1.2. */
static double accumulated(const engine *e, const plan *k)
{
	const double base = fmax((double)e->p->err[k->u], (double)e->p->err[k->v]);
	const double left = e->params->max_err - base;
	stretch s = {.far2 = 0, .limit2 = left > 0 ? left * left : 0};
	stretch_to(e, k, e->p->pos[k->u], true, &s);
	if (!(e->p->flag[k->v] & WH_LOCKED)) {
		stretch_to(e, k, e->p->pos[k->v], true, &s);
		stretch_to(e, k, k->x, false, &s);
	}
	stretch_to_spokes(e, k, k->u, &e->w->ring_u, &s);
	if (!(e->p->flag[k->v] & WH_LOCKED))
		stretch_to_spokes(e, k, k->v, &e->w->ring_v, &s);
	return base + sqrt(s.far2);
}

/* ---- performing --------------------------------------------------------------------------- */

static void list_remove(wh_simplify_work *w, uint32_t v, uint32_t f)
{
	uint32_t *list = &w->pool[w->first[v]];
	const uint32_t n = w->count[v];
	uint32_t i = 0;
	while (i < n && list[i] != f)
		i++;
	for (; i + 1 < n; i++)
		list[i] = list[i + 1];
	if (n > 0)
		w->count[v] = n - 1;
}

/* Moves all lists to the front of the pool, in the order in which they lie. */
static wh_code pool_compact(engine *e)
{
	wh_simplify_work *w = e->w;
	uint32_t *fresh = wh_alloc(e->c, w->pool_cap, sizeof *fresh);
	if (!fresh)
		return e->c->err.code;
	size_t at = 0;
	for (uint32_t v = 0; v < e->p->nv; v++) {
		memcpy(&fresh[at], &w->pool[w->first[v]], w->count[v] * sizeof *fresh);
		w->first[v] = (uint32_t)at;
		at += w->count[v];
	}
	wh_free(e->c, w->pool);
	w->pool = fresh;
	w->pool_used = at;
	return WH_OK;
}

/* v's list becomes its own faces and u's, without the shared ones. */
static wh_code lists_join(engine *e, const plan *k)
{
	wh_simplify_work *w = e->w;
	const size_t need = (size_t)w->count[k->u] + w->count[k->v];
	if (w->pool_used + need > w->pool_cap && pool_compact(e) != WH_OK)
		return e->c->err.code;
	if (w->pool_used + need > w->pool_cap)
		return wh_fail(e->c, WH_E_RUN, "internal error: face lists do not fit");
	uint32_t *list = &w->pool[w->pool_used];
	uint32_t n = 0;
	const uint32_t ends[2] = {k->v, k->u};
	for (int j = 0; j < 2; j++)
		for (uint32_t i = 0; i < w->count[ends[j]]; i++) {
			const uint32_t f = w->pool[w->first[ends[j]] + i];
			if (!is_shared(k, f))
				list[n++] = f;
		}
	w->first[k->v] = (uint32_t)w->pool_used;
	w->count[k->v] = n;
	w->count[k->u] = 0;
	w->pool_used += n;
	return WH_OK;
}

static void faces_drop(engine *e, const plan *k)
{
	for (uint32_t i = 0; i < k->nshared; i++) {
		const uint32_t f = k->shared[i];
		list_remove(e->w, apex_of(e, k, f), f);
		e->p->tri[3 * (size_t)f] = WH_NONE;
	}
	e->faces -= k->nshared;
	e->vertices--;
}

static void faces_move(engine *e, const plan *k)
{
	const wh_simplify_work *w = e->w;
	for (uint32_t i = 0; i < w->count[k->v]; i++) {
		const uint32_t f = w->pool[w->first[k->v] + i];
		uint32_t *t = &e->p->tri[3 * (size_t)f];
		for (int j = 0; j < 3; j++)
			if (t[j] == k->u)
				t[j] = k->v;
		w->normal[f] = face_normal(e->p, f);
	}
}

/* Renews the sums around the new vertex, then the costs of its edges. */
static wh_code ring_renew(engine *e, uint32_t v)
{
	wh_simplify_work *w = e->w;
	ring *r = &w->ring_v;
	if (gather(e, v, r) != WH_OK)
		return e->c->err.code;
	if (!(e->p->flag[v] & WH_LOCKED))
		sum_renew(e, v, e->p->flag[v] & WH_BORDER ? r : NULL);
	for (uint32_t i = 0; i < r->n; i++)
		if (!(e->p->flag[r->item[i].id] & WH_LOCKED) &&
		    sum_renew_any(e, r->item[i].id) != WH_OK)
			return e->c->err.code;
	for (uint32_t i = 0; i < r->n; i++)
		if (push_edge(e, v, &r->item[i]) != WH_OK)
			return e->c->err.code;
	return WH_OK;
}

static void note_collapse(engine *e, const plan *k, double err)
{
	wh_simplify_result *r = e->result;
	r->collapses++;
	if (k->cost > r->highest_cost) {
		r->highest_cost = k->cost;
		e->highest_weight = k->weight;
	}
	r->highest_err = fmax(r->highest_err, err);
	if (e->params->histogram) {
		int64_t bits;
		memcpy(&bits, &r->highest_cost, sizeof bits);
		e->params->histogram[bits >> (52 - WH_HIST_MANTISSA)]++;
	}
}

static wh_code perform(engine *e, const plan *k, double err)
{
	faces_drop(e, k);
	if (lists_join(e, k) != WH_OK)
		return e->c->err.code;
	e->p->pos[k->v] = k->x;
	e->p->err[k->v] = (float)err;
	if (!(e->p->flag[k->v] & WH_LOCKED))
		e->p->flag[k->v] |= e->p->flag[k->u] & WH_BORDER;
	faces_move(e, k);
	e->w->generation[k->u]++;
	e->w->generation[k->v]++;
	note_collapse(e, k, err);
	return ring_renew(e, k->v);
}

/* ---- the loop ----------------------------------------------------------------------------- */

static bool reached(const engine *e)
{
	const wh_simplify_params *s = e->params;
	return (s->target_faces && e->faces <= s->target_faces) ||
	       (s->target_vertices && e->vertices <= s->target_vertices);
}

/* True when this collapse takes one face more than is left to take. */
static bool overshoots(const engine *e, const plan *k)
{
	return e->params->target_faces && e->faces - k->nshared < e->params->target_faces;
}

typedef enum verdict { TAKEN, REJECTED, SPARED } verdict;

/* Checks one candidate and performs it when it is current, legal and within the limits. */
static wh_code try_candidate(engine *e, plan *k, uint32_t bucket, bool allow_overshoot,
                             verdict *out)
{
	wh_simplify_work *w = e->w;
	*out = REJECTED;
	if (!find_shared(e, k))
		return WH_OK;
	evaluate(e, k);
	if (!(k->cost <= e->params->max_cost))
		return WH_OK;
	const uint32_t now = wh_queue_bucket(&w->queue, k->cost);
	if (now > bucket)
		return wh_queue_push(e->c, &w->queue, now, k->u, k->v,
		                     w->generation[k->u] + w->generation[k->v]);
	if (!faces_stay_sound(e, k, k->u) ||
	    (!(e->p->flag[k->v] & WH_LOCKED) && !faces_stay_sound(e, k, k->v)))
		return WH_OK;
	bool ok;
	if (link_condition(e, k, &ok) != WH_OK)
		return e->c->err.code;
	if (!ok)
		return WH_OK;
	const double err = isfinite(e->params->max_err) ? accumulated(e, k) : 0;
	if (!(err <= e->params->max_err))
		return WH_OK;
	if (overshoots(e, k) && !allow_overshoot) {
		*out = SPARED;
		return WH_OK;
	}
	*out = TAKEN;
	return perform(e, k, err);
}

/* Entries pile up as costs are renewed; drop the dead ones when they outnumber the edges. */
static void queue_trim(engine *e)
{
	wh_queue *q = &e->w->queue;
	if (q->size > 1024 && q->size > 3 * (size_t)e->faces)
		wh_queue_purge(q, e->w->generation);
}

/* Takes candidates until a limit is reached or none is left. */
static wh_code drain(engine *e)
{
	wh_simplify_work *w = e->w;
	wh_candidate cand;
	uint32_t bucket;
	plan spare = {0};
	bool have_spare = false;
	uint32_t polls = 0;
	while (!reached(e) && wh_queue_pop(&w->queue, &cand, &bucket)) {
		if ((++polls & 0xfff) == 0) {
			if (wh_poll(e->c) != WH_OK)
				return e->c->err.code;
			queue_trim(e);
		}
		if (cand.stamp != w->generation[cand.u] + w->generation[cand.v])
			continue;
		plan k = {.u = cand.u, .v = cand.v};
		verdict found;
		if (try_candidate(e, &k, bucket, false, &found) != WH_OK)
			return e->c->err.code;
		if (found == SPARED && !have_spare) {
			spare = k;
			have_spare = true;
		}
	}
	if (reached(e) || !have_spare)
		return WH_OK;
	/* One face too many, and no boundary edge to take it: one less then. */
	verdict found;
	return try_candidate(e, &spare, WH_QUEUE_BUCKETS, true, &found);
}

static wh_code push_all(engine *e)
{
	wh_simplify_work *w = e->w;
	for (uint32_t v = 0; v < e->p->nv; v++) {
		if (w->count[v] == 0 || (e->p->flag[v] & WH_LOCKED))
			continue;
		if (gather(e, v, &w->ring_v) != WH_OK)
			return e->c->err.code;
		for (uint32_t i = 0; i < w->ring_v.n; i++) {
			const neighbour *b = &w->ring_v.item[i];
			/* each free edge once, from its lower end */
			if (b->id < v && !(e->p->flag[b->id] & WH_LOCKED))
				continue;
			if (push_edge(e, v, b) != WH_OK)
				return e->c->err.code;
		}
	}
	return WH_OK;
}

/* Cost that no collapse inside the patch's bounding box can exceed by much: diagonal^6. */
static double cost_scale(const wh_patch *p)
{
	if (p->nv == 0)
		return 1;
	wh_vec3 lo = p->pos[0], hi = p->pos[0];
	for (uint32_t v = 1; v < p->nv; v++) {
		const wh_vec3 q = p->pos[v];
		lo = wh_v3(fmin(lo.x, q.x), fmin(lo.y, q.y), fmin(lo.z, q.z));
		hi = wh_v3(fmax(hi.x, q.x), fmax(hi.y, q.y), fmax(hi.z, q.z));
	}
	const double d2 = wh_norm2(wh_sub(hi, lo));
	return d2 > 0 ? d2 * d2 * d2 : 1;
}

/* Drops dead faces and vertices without faces; the rest keeps its order. */
static void pack(engine *e)
{
	wh_patch *p = e->p;
	uint32_t nf = 0;
	for (uint32_t f = 0; f < p->nf; f++) {
		const uint32_t *t = &p->tri[3 * (size_t)f];
		if (t[0] == WH_NONE)
			continue;
		memmove(&p->tri[3 * (size_t)nf++], t, 3 * sizeof *t);
	}
	p->nf = nf;
	(void)wh_patch_compact(p, e->w->first);
}

static wh_code set_up(engine *e)
{
	wh_simplify_work *w = e->w;
	wh_patch *p = e->p;
	if (work_fit(e->c, w, p) != WH_OK)
		return e->c->err.code;
	memset(w->mark, 0, p->nv * sizeof *w->mark);
	memset(w->generation, 0, p->nv * sizeof *w->generation);
	w->tick = 0;
	lists_build(e);
	for (uint32_t f = 0; f < p->nf; f++)
		w->normal[f] = face_normal(p, f);
	for (uint32_t v = 0; v < p->nv; v++)
		if (!(p->flag[v] & WH_CUT) && classify(e, v) != WH_OK)
			return e->c->err.code;
	wh_queue_reset(&w->queue,
	               isfinite(e->params->max_cost) ? e->params->max_cost : cost_scale(p));
	return WH_OK;
}

wh_code wh_simplify(wh_ctx *c, wh_simplify_work *w, wh_patch *p, const wh_simplify_params *params,
                    wh_simplify_result *result)
{
	*result = (wh_simplify_result){0};
	engine e = {.c = c,
	            .w = w,
	            .p = p,
	            .params = params,
	            .result = result,
	            .faces = p->nf,
	            .vertices = p->nv};
	if (reached(&e))
		return WH_OK;
	if (p->nf == 0) {
		result->exhausted = true;
		return WH_OK;
	}
	if (set_up(&e) != WH_OK)
		return c->err.code;
	/* A candidate turned down once may be legal later: start over while that helps. */
	uint64_t before;
	do {
		before = result->collapses;
		if (push_all(&e) != WH_OK || drain(&e) != WH_OK)
			return c->err.code;
	} while (params->insist && !reached(&e) && result->collapses > before);
	result->exhausted = !reached(&e);
	if (e.highest_weight > 0)
		result->cost_distance = sqrt(result->highest_cost / e.highest_weight);
	pack(&e);
	return WH_OK;
}

double wh_histogram_cost(int bin)
{
	const int64_t bits = ((int64_t)bin + 1) << (52 - WH_HIST_MANTISSA);
	double cost;
	memcpy(&cost, &bits, sizeof cost);
	return cost;
}
