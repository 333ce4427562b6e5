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
 * How the cost is kept is in collapse_cost.c, what may be collapsed in collapse_rule.c.
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
#include "algo/simplify_engine.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

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
	const size_t vertex = 3 * sizeof(uint32_t) + sizeof(wh_vertex_sum) + sizeof(uint64_t);
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

/* ---- setting up --------------------------------------------------------------------------- */

/* True when the faces of v, whose ring is r, form one fan: walking from face to face around v
 * meets them all. With every edge in at most two faces, a fan is a path or a cycle, and several
 * fans show as more than two boundary edges or as a cycle shorter than the face count. */
static bool one_fan(const wh_engine *e, uint32_t v, const wh_ring *r)
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
		const wh_neighbour *b = &r->item[at];
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

/* A collapse looks at all faces around both its ends and their neighbours. A vertex with more faces
 * than this is locked until it has fewer, no other is made, and none is collapsed into it: else a
 * hub of n faces would take time n^2. */
enum { MOST_FACES_AROUND = 1024 };

/* Classifies a vertex whose faces are all here: on the boundary, or not manifold (then fixed). */
static wh_code classify(wh_engine *e, uint32_t v)
{
	wh_ring *r = &e->w->ring_w;
	uint8_t *flag = &e->p->flag[v];
	if (wh_gather(e, v, r) != WH_OK)
		return e->c->err.code;
	bool manifold = true;
	for (uint32_t i = 0; i < r->n; i++)
		manifold = manifold && r->item[i].outgoing <= 1 && r->item[i].incoming <= 1;
	*flag &= (uint8_t) ~(WH_BORDER | WH_HUB);
	if (e->w->count[v] > MOST_FACES_AROUND)
		*flag |= WH_HUB;
	if (ring_has_boundary(r)) {
		*flag |= WH_BORDER;
		e->result->border++;
	}
	if (!manifold || (r->n > 0 && !one_fan(e, v, r))) {
		if (!(*flag & WH_FIXED))
			e->result->fixed++;
		*flag |= WH_FIXED;
	}
	if ((*flag & WH_BORDER) && e->params->lock_boundary)
		*flag |= WH_FIXED;
	if (!(*flag & WH_LOCKED))
		wh_sum_renew(e, v, r);
	return WH_OK;
}

/* ---- the loop ----------------------------------------------------------------------------- */

/* Orders the ends so that a locked one survives; false when the edge can never be collapsed. */
static bool orient(const wh_engine *e, wh_collapse *k)
{
	if (e->p->flag[k->u] & WH_LOCKED) {
		const uint32_t t = k->u;
		k->u = k->v;
		k->v = t;
	}
	if ((e->p->flag[k->u] & WH_LOCKED) ||
	    e->w->count[k->u] + e->w->count[k->v] > MOST_FACES_AROUND)
		return false;
	/* An inner edge between two boundary vertices: collapsing it would pinch the surface. */
	return !(k->nshared == 2 && (e->p->flag[k->u] & WH_BORDER) &&
	         (e->p->flag[k->v] & WH_BORDER));
}

static wh_code push(wh_engine *e, const wh_collapse *k)
{
	wh_simplify_work *w = e->w;
	if (!(k->cost <= e->params->max_cost))
		return WH_OK;
	return wh_queue_push(e->c, &w->queue, wh_queue_bucket(&w->queue, k->cost), k->u, k->v,
	                     w->generation[k->u] + w->generation[k->v]);
}

/* Evaluates the n collapses at the free vertex v that wait in the lanes, and pushes them. */
static wh_code push_lanes(wh_engine *e, uint32_t v, wh_collapse *waiting, int n)
{
	wh_lanes *l = &e->w->lanes;
	wh_lanes_evaluate(l, &e->w->sum[v]);
	for (int i = 0; i < n; i++) {
		wh_lanes_get(e, l, i, &waiting[i]);
		if (push(e, &waiting[i]) != WH_OK)
			return e->c->err.code;
	}
	return WH_OK;
}

/* Pushes the edges from v to its ring: to all of it, or only to where v is the lower end, so that
 * a sweep over all vertices takes each free edge once. */
static wh_code push_edges(wh_engine *e, uint32_t v, const wh_ring *r, bool upward)
{
	wh_collapse waiting[WH_LANES];
	int n = 0;
	for (uint32_t i = 0; i < r->n; i++) {
		const wh_neighbour *b = &r->item[i];
		wh_collapse k = {.u = b->id, .v = v, .shared = {b->face[0], b->face[1]}};
		k.nshared = faces_on(b);
		if (upward && b->id < v && !(e->p->flag[b->id] & WH_LOCKED))
			continue;
		if (k.nshared > 2 || !orient(e, &k))
			continue;
		if (e->p->flag[k.v] & WH_LOCKED) {
			wh_collapse_evaluate(e, &k);
			if (push(e, &k) != WH_OK)
				return e->c->err.code;
			continue;
		}
		wh_lanes_set(e, &e->w->lanes, n, &k);
		waiting[n++] = k;
		if (n == WH_LANES) {
			if (push_lanes(e, v, waiting, n) != WH_OK)
				return e->c->err.code;
			n = 0;
		}
	}
	return n ? push_lanes(e, v, waiting, n) : WH_OK;
}

/* Renews the sums around the new vertex, then the costs of its edges. */
static wh_code ring_renew(wh_engine *e, uint32_t v)
{
	wh_simplify_work *w = e->w;
	wh_ring *r = &w->ring_v;
	if (wh_gather(e, v, r) != WH_OK)
		return e->c->err.code;
	if (!(e->p->flag[v] & WH_LOCKED))
		wh_sum_renew(e, v, e->p->flag[v] & WH_BORDER ? r : NULL);
	for (uint32_t i = 0; i < r->n; i++)
		if (!(e->p->flag[r->item[i].id] & WH_LOCKED) &&
		    wh_sum_renew_any(e, r->item[i].id) != WH_OK)
			return e->c->err.code;
	return push_edges(e, v, r, false);
}

static void note_collapse(wh_engine *e, const wh_collapse *k, double err)
{
	wh_simplify_result *r = e->result;
	r->collapses++;
	if (k->cost > r->highest_cost) {
		r->highest_cost = k->cost;
		e->highest_weight = k->weight;
	}
	r->highest_err = fmax(r->highest_err, err);
	if (e->params->log) {
		int64_t bits;
		memcpy(&bits, &r->highest_cost, sizeof bits);
		const int64_t bin = bits >> (52 - WH_LOG_MANTISSA);
		e->params->log->collapses[bin]++;
		e->params->log->faces[bin] += k->nshared;
	}
}

static wh_code perform(wh_engine *e, const wh_collapse *k, double err)
{
	wh_faces_drop(e, k);
	if (wh_lists_join(e, k) != WH_OK)
		return e->c->err.code;
	e->p->pos[k->v] = k->x;
	e->p->err[k->v] = (float)err;
	if (!(e->p->flag[k->v] & WH_LOCKED))
		e->p->flag[k->v] |= e->p->flag[k->u] & WH_BORDER;
	wh_faces_move(e, k);
	e->w->generation[k->u]++;
	e->w->generation[k->v]++;
	note_collapse(e, k, err);
	return ring_renew(e, k->v);
}

static bool find_shared(const wh_engine *e, wh_collapse *k)
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

static bool reached(const wh_engine *e)
{
	const wh_simplify_params *s = e->params;
	return (s->target_faces && e->faces <= s->target_faces) ||
	       (s->target_vertices && e->vertices <= s->target_vertices);
}

/* True when this collapse takes one face more than is left to take. */
static bool overshoots(const wh_engine *e, const wh_collapse *k)
{
	return e->params->target_faces && e->faces - k->nshared < e->params->target_faces;
}

typedef enum verdict { TAKEN, REJECTED, SPARED } verdict;

/* Checks one candidate and performs it when it is current, legal and within the limits. */
static wh_code try_candidate(wh_engine *e, wh_collapse *k, uint32_t bucket, bool allow_overshoot,
                             verdict *out)
{
	wh_simplify_work *w = e->w;
	*out = REJECTED;
	if (w->count[k->u] + w->count[k->v] > MOST_FACES_AROUND || !find_shared(e, k))
		return WH_OK;
	wh_collapse_evaluate(e, k);
	if (!(k->cost <= e->params->max_cost))
		return WH_OK;
	const uint32_t now = wh_queue_bucket(&w->queue, k->cost);
	if (now > bucket)
		return wh_queue_push(e->c, &w->queue, now, k->u, k->v,
		                     w->generation[k->u] + w->generation[k->v]);
	if (!wh_faces_stay_sound(e, k, k->u) ||
	    (!(e->p->flag[k->v] & WH_LOCKED) && !wh_faces_stay_sound(e, k, k->v)))
		return WH_OK;
	bool ok;
	if (wh_link_condition(e, k, &ok) != WH_OK)
		return e->c->err.code;
	if (!ok)
		return WH_OK;
	const double err = isfinite(e->params->max_err) ? wh_accumulated(e, k) : 0;
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
static void queue_trim(wh_engine *e)
{
	wh_queue *q = &e->w->queue;
	if (q->size > 1024 && q->size > 3 * (size_t)e->faces)
		wh_queue_purge(q, e->w->generation);
}

/* Takes candidates until a limit is reached or none is left. */
static wh_code drain(wh_engine *e)
{
	wh_simplify_work *w = e->w;
	wh_candidate cand;
	uint32_t bucket;
	wh_collapse spare = {0};
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
		wh_collapse k = {.u = cand.u, .v = cand.v};
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
	if (e->params->no_overshoot)
		return WH_OK;
	verdict found;
	return try_candidate(e, &spare, WH_QUEUE_BUCKETS, true, &found);
}

static wh_code push_all(wh_engine *e)
{
	wh_simplify_work *w = e->w;
	for (uint32_t v = 0; v < e->p->nv; v++) {
		if (wh_poll_at(e->c, v) != WH_OK)
			return e->c->err.code;
		if ((e->p->flag[v] & WH_HUB) && w->count[v] <= MOST_FACES_AROUND &&
		    classify(e, v) != WH_OK)
			return e->c->err.code;
		if (w->count[v] == 0 || (e->p->flag[v] & WH_LOCKED))
			continue;
		if (wh_gather(e, v, &w->ring_v) != WH_OK)
			return e->c->err.code;
		if (push_edges(e, v, &w->ring_v, true) != WH_OK)
			return e->c->err.code;
	}
	return WH_OK;
}

/* Costs of a patch this many times as wide as most of it are told apart. */
static const double FAR_OUT = 1024;

static int compare_coordinates(const void *a, const void *b)
{
	const double x = *(const double *)a, y = *(const double *)b;
	return (x > y) - (x < y);
}

/* Width of the middle nine tenths of some vertices, evenly spaced, along their widest axis: a few
 * far out do not count. */
static double width(const wh_patch *p)
{
	enum { PROBES = 257 };
	double most = 0, value[PROBES];
	const uint32_t n = p->nv < PROBES ? p->nv : PROBES;
	for (int axis = 0; axis < 3; axis++) {
		for (uint32_t i = 0; i < n; i++) {
			const wh_vec3 q = p->pos[(size_t)i * (p->nv / n)];
			value[i] = axis == 0 ? q.x : axis == 1 ? q.y : q.z;
		}
		qsort(value, n, sizeof *value, compare_coordinates);
		if (n)
			most = fmax(most, value[n - 1 - n / 20] - value[n / 20]);
	}
	return most;
}

/* The top of the queue's window: diagonal^6, which no collapse inside the patch's bounding box
 * exceeds by much; but what lies far outside the rest must not push the rest below the window. */
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
	const double box2 = wh_norm2(wh_sub(hi, lo)), mid = width(p);
	const double d2 = mid > 0 ? fmin(box2, mid * mid * FAR_OUT * FAR_OUT) : box2;
	return d2 > 0 ? d2 * d2 * d2 : 1;
}

/* Drops dead faces and vertices without faces; the rest keeps its order. */
static void pack(wh_engine *e)
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

static wh_code set_up(wh_engine *e)
{
	wh_simplify_work *w = e->w;
	wh_patch *p = e->p;
	if (work_fit(e->c, w, p) != WH_OK)
		return e->c->err.code;
	memset(w->mark, 0, p->nv * sizeof *w->mark);
	memset(w->generation, 0, p->nv * sizeof *w->generation);
	w->tick = 0;
	wh_lists_build(e);
	for (uint32_t f = 0; f < p->nf; f++)
		w->normal[f] = face_normal(p, f);
	for (uint32_t v = 0; v < p->nv; v++)
		if (wh_poll_at(e->c, v) != WH_OK ||
		    (!(p->flag[v] & WH_CUT) && classify(e, v) != WH_OK))
			return e->c->err.code;
	wh_queue_reset(&w->queue,
	               isfinite(e->params->max_cost) ? e->params->max_cost : cost_scale(p));
	return WH_OK;
}

wh_code wh_simplify(wh_ctx *c, wh_simplify_work *w, wh_patch *p, const wh_simplify_params *params,
                    wh_simplify_result *result)
{
	*result = (wh_simplify_result){0};
	wh_engine e = {.c = c,
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

double wh_log_cost(uint32_t bin)
{
	const int64_t bits = ((int64_t)bin + 1) << (52 - WH_LOG_MANTISSA);
	double cost;
	memcpy(&cost, &bits, sizeof cost);
	return cost;
}

void wh_simplify_result_add(wh_simplify_result *sum, const wh_simplify_result *one)
{
	sum->collapses += one->collapses;
	sum->highest_err = fmax(sum->highest_err, one->highest_err);
	if (one->highest_cost > sum->highest_cost) {
		sum->highest_cost = one->highest_cost;
		sum->cost_distance = one->cost_distance;
	}
}
