/*
 * Edge collapse in near-greedy order with memoryless quadrics.
 *
 * Idea. The cost of collapsing edge uv is measured against the faces of the mesh as it is now,
 * not against the original (Lindstrom & Turk, "Fast and memory efficient polygonal
 * simplification", 1998; Hoppe, "New quadric metric", 1999, "memoryless"): the sum over the faces
 * around u and v of the squared volume between the face and the new vertex, large faces weighing a
 * little less than that. Boundary edges add the squared area swept on either side. The new vertex
 * minimises that sum, and keeps the volume under the surface as it was. No quadric is stored with
 * the mesh, so a vertex on a cut needs no special care.
 *
 * Stars are in star.c, costs in fan.c, what may be collapsed in trial.c, and what may be where the
 * topology is free in surgery.c. Another cost or place than these is a policy's (policy.h): the
 * loop is the same, but vertices are evaluated as soon as they or what is around them change.
 *
 * Order. Every free vertex waits in a bucket queue (queue.h) at the cost of its cheapest edge, or,
 * before it was first evaluated, at a guess from its own faces. Where a collapse changes the faces
 * of a vertex, what is known of its cost grows with their sum. A vertex is evaluated when it is
 * taken: if it is dearer than its place says it goes back. Edges that may not be collapsed are
 * passed over for the next one; a vertex without any leaves the queue, and its edges are looked at
 * from their other ends as long as those are in it. A last pass goes through all again while that
 * helps, and in the end with faces that turn over, where nothing else leads to the count.
 *
 * Invariants. Every free vertex has its ring, and its sum is current. A vertex that is gone has no
 * ring.
 *
 * Cost: two vertices evaluated for each collapse; 120 bytes a face at the start.
 */
#include "algo/simplify_engine.h"
#include "io/attributes.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

wh_simplify_workspace *wh_simplify_workspace_new(wh_ctx *c)
{
	return wh_calloc(c, 1, sizeof(wh_simplify_workspace));
}

void wh_simplify_workspace_free(wh_ctx *c, wh_simplify_workspace *w)
{
	if (!w)
		return;
	wh_queue_free(c, &w->queue);
	wh_free(c, w->star);
	wh_free(c, w->mark);
	wh_free(c, w->first);
	wh_free(c, w->corner);
	wh_free(c, w->overflow);
	wh_free(c, w->slot);
	wh_free(c, w->overflow_slot);
	wh_free(c, w->wedge);
	wh_gradients_free(c, w->gradients);
	wh_free(c, w->quadric);
	wh_free(c, w);
}

size_t wh_simplify_bytes(uint64_t nv, uint64_t nf, uint32_t face_bytes)
{
	const size_t slots = face_bytes ? WH_RING_INLINE * sizeof(uint32_t) : 0;
	const size_t vertex =
	    sizeof(wh_star) + sizeof(wh_mark) + sizeof(wh_queue_link) + sizeof(uint32_t);
	const size_t corners = 3 * sizeof(uint32_t);
	return (size_t)nv * (vertex + slots) + (size_t)nf * corners +
	       sizeof(wh_simplify_workspace) + 64;
}

/* ---- time, error, shape ------------------------------------------------------------------- */

/*
 * Evaluations a collapse, and RMS over that of Lindstrom-Turk (median of 11 meshes at 10, 1 and
 * 0.1 %), with a pull of 1e-6 and a tie of 1e-10:
 *
 *     share 0.25, slack 8     3.0    0.991
 *     share 0.5,  slack 8     1.9    0.993    the default
 *     share 0.5,  slack 16    1.7    0.997
 *     share 1,    slack 16    1.3    1.009    fast
 *
 * Fast stands beside Garland-Heckbert, whose error is larger and whose faces are more regular. RMS,
 * mean and 5th percentile of the radius ratio over those, with the order of fast (medians over the
 * same):
 *
 *     pull 1e-6, tie 1e-10    0.70    0.92    0.78
 *     pull 1e-3, tie 5e-4     0.74    0.99    1.03
 *     pull 1e-3, tie 1e-3     0.75    1.01    1.13    fast
 *     pull 2e-3, tie 1e-3     0.77    1.03    1.21
 */
static const wh_manner usual = {0.5, 8, 1e-6, 1e-10}, fast = {1.0, 16, 1e-3, 1e-3};

/* In a last pass so few vertices are taken in exact order: the fewer are left the more each choice
 * counts. At 0.1 % of 100 k to 500 k faces the median RMS over that of Lindstrom-Turk goes from
 * 1.013 to 1.009 with 1000, and on to 1.00 with 4000; but single meshes scatter by 10 %, and more
 * so with those. */
enum { EXACT_BELOW = 1000 };
static const double EXACT_SHARE = 0.25;

static bool is_exact(const wh_engine *e)
{
	return e->params->insist && e->vertices < EXACT_BELOW;
}

static double guess_share(const wh_engine *e)
{
	return is_exact(e) ? EXACT_SHARE : e->manner->guess_share;
}

static uint32_t slack(const wh_engine *e)
{
	return is_exact(e) || e->policy ? 0 : e->manner->slack;
}

/* ---- the loop ----------------------------------------------------------------------------- */

static bool reached(const wh_engine *e)
{
	const wh_simplify_params *s = e->params;
	return e->full || (s->most_collapses && e->result->collapses >= s->most_collapses) ||
	       (s->target_faces && e->faces <= s->target_faces) ||
	       (s->target_vertices && e->vertices <= s->target_vertices);
}

static uint32_t cheapest(const wh_fan *f)
{
	uint32_t best = 0;
	for (uint32_t i = 1; i < f->n; i++)
		if (f->cost.at[i] < f->cost.at[best])
			best = i;
	return best;
}

/* The same with what attributes add, which is looked at only where the edge would be the cheapest
 * without it. */
static uint32_t cheapest_weighted(const wh_engine *e, uint32_t v, wh_fan *f)
{
	uint32_t i;
	do
		i = cheapest(f);
	while (f->cost.at[i] < INFINITY && wh_blend_weigh(e, v, f, i));
	return i;
}

/* Puts v into the queue at this cost of its cheapest edge. */
static void enqueue_at(wh_engine *e, uint32_t v, double cost)
{
	wh_queue *q = &e->w->queue;
	e->w->star[v].guess = cost;
	if (cost <= e->params->max_cost && cost < INFINITY)
		wh_queue_push(q, v, wh_queue_bucket(q, cost));
}

/* A vertex that was not evaluated yet: where the guess is above the cost limit the truth may be
 * below it. For policies there are no guesses. */
static void enqueue_unseen(wh_engine *e, uint32_t v)
{
	if (e->policy) {
		enqueue_at(e, v, wh_policy_least(e, v));
		return;
	}
	const double guess = guess_share(e) * e->w->star[v].guess;
	enqueue_at(e, v, fmin(guess, fmin(e->params->max_cost, DBL_MAX)));
}

/* The dearest and the farthest so far. */
static void raise_to(wh_simplify_result *r, double cost, double weight, double err)
{
	r->highest_err = fmax(r->highest_err, err);
	if (cost > r->highest_cost) {
		r->highest_cost = cost;
		r->cost_distance = weight > 0 ? sqrt(cost / weight) : 0;
	}
}

/* Where a collapse of this cost that was just noted is logged. */
static int64_t log_bin(const wh_engine *e, double cost)
{
	const double at = e->params->log_in_order ? e->result->highest_cost : cost;
	int64_t bits;
	memcpy(&bits, &at, sizeof bits);
	return bits >> (52 - WH_LOG_MANTISSA);
}

static void note_collapse(wh_engine *e, const wh_trial *t, double err)
{
	wh_simplify_result *r = e->result;
	wh_simplify_result_note(r, t->cost, t->weight, err);
	if (e->params->log) {
		const int64_t bin = log_bin(e, t->cost);
		e->params->log->collapses[bin]++;
		e->params->log->faces[bin] += t->nshared;
	}
}

/* A change of topology, at the cost that it waited at. */
static void note_change(wh_engine *e, wh_topology kind, double cost, double weight, double err,
                        uint32_t faces, int32_t vertices)
{
	wh_simplify_result *r = e->result;
	raise_to(r, cost, weight, err);
	r->changes[kind]++;
	r->vertices += vertices;
	e->faces -= faces;
	e->vertices -= (uint32_t)vertices;
	if (e->params->log)
		e->params->log->faces[log_bin(e, cost)] += faces;
}

static wh_code tell(const wh_engine *e, const wh_trial *t, double err)
{
	const wh_collapse_sink *sink = e->params->sink;
	const wh_collapse r = {.u = t->u,
	                       .v = t->v,
	                       .at = t->x,
	                       .cost = t->cost,
	                       .weight = t->weight,
	                       .err = (float)err,
	                       .faces = t->nshared};
	if (!sink)
		return WH_OK;
	return sink->put(e->c, sink->to, &r, e->p->attr_bytes ? wh_patch_attr(e->p, t->v) : NULL);
}

/* Keeps a vertex that is gone at hand. */
static void bury(wh_engine *e, uint32_t v)
{
	e->w->star[v].ring[0] = e->dead;
	e->dead = v;
}

static void enqueue_anew(wh_engine *e, uint32_t v)
{
	wh_queue_remove(&e->w->queue, v);
	enqueue_unseen(e, v);
}

/* The neighbours of a new vertex, where a policy has other costs for them now. */
static void enqueue_around(wh_engine *e, const wh_trial *t)
{
	for (uint32_t i = 0; i < t->n; i++)
		if (!wh_is_locked(e, t->id[i]))
			enqueue_anew(e, t->id[i]);
}

/* What is around a vertex has changed by surgery. */
static void renew(wh_engine *e, uint32_t v)
{
	if (e->weighted)
		wh_blend_changed(e, v);
	enqueue_anew(e, v);
}

/* Nothing that was added up around these is true any more. */
static void forget_sums(wh_engine *e, const wh_trial *t)
{
	wh_blend_changed(e, t->v);
	for (uint32_t i = 0; i < t->n; i++)
		wh_blend_changed(e, t->id[i]);
}

static void blend(const wh_engine *e, const wh_trial *t)
{
	if (!e->params->attributes || t->into_locked)
		return;
	if (e->policy && e->placement == WH_PLACE_ENDPOINT)
		wh_blend_take(e, t);
	else
		wh_blend(e, t);
}

static wh_code perform(wh_engine *e, wh_trial *t, double err)
{
	blend(e, t);
	if (e->wedges)
		wh_wedges_before(e, t);
	if (e->policy)
		wh_policy_merge(e, t);
	if (wh_trial_commit(e, t) != WH_OK || (e->wedges && wh_wedges_after(e, t) != WH_OK) ||
	    tell(e, t, err) != WH_OK)
		return e->c->err.code;
	if (e->weighted)
		forget_sums(e, t);
	e->p->err[t->v] = (float)err;
	e->faces -= t->nshared;
	e->taken += t->nshared;
	e->vertices--;
	note_collapse(e, t, err);
	wh_queue_remove(&e->w->queue, t->u);
	if (e->surgery)
		bury(e, t->u);
	if (e->policy && wh_policy_is_wide(e))
		enqueue_around(e, t);
	if (t->into_locked)
		return WH_OK;
	if (e->weighted)
		e->w->star[t->v].guess += wh_blend_guess(e, t->v);
	enqueue_anew(e, t->v);
	return WH_OK;
}

/* True when this takes more faces than are left to take. */
static bool overshoots(const wh_engine *e, uint32_t faces)
{
	return e->params->target_faces && e->faces - faces < e->params->target_faces;
}

typedef enum verdict {
	TAKEN,
	REJECTED,
	SPARED,  /* one face more than is left to take */
	DEFERRED /* it is dearer than it seemed */
} verdict;

/* ---- changes of topology ------------------------------------------------------------------ */

/*
 * The squared size counts for so much: what is closed or cut moves by less than half of it. RMS in
 * millionths, CT skull at 1 and 0.1 %, dragon at 0.1 %, mouse skull at 1 %:
 *
 *     cut 1, shell 1          1551    10901    2376    4330
 *     cut 0.25, shell 1       1391     7581    2230    3700
 *     cut 0.15, shell 2       1311     7573    2158    3608
 *     cut 0.1, shell 2        1358     8089    2404    3822
 *     cut 0.05, shell 1       1473     6426    2087    4188
 */
static const double CUT_SHARE = 0.15, SHELL_SHARE = 2;

static wh_code operate(wh_engine *e, wh_surgery *s, double cost, double weight, double err)
{
	if (e->wedges)
		wh_wedges_before_surgery(e);
	if (e->params->attributes)
		wh_blend_ends(e, &e->w->trial);
	if (wh_surgery_perform(e, s, err) != WH_OK ||
	    (e->wedges && wh_wedges_after_surgery(e, s) != WH_OK))
		return e->c->err.code;
	note_change(e, s->kind, cost, weight, err, s->nshared,
	            s->kind == WH_HOLE   ? 1
	            : s->kind == WH_NECK ? -1
	                                 : 0);
	if (s->kind == WH_HOLE) {
		wh_queue_remove(&e->w->queue, s->u);
		bury(e, s->u);
	}
	wh_surgery_each(e, s, renew, e);
	return WH_OK;
}

/* Performs the collapse of edge i of the fan, which the link condition forbids, when its time has
 * come; else its cost becomes what it has to wait for. */
static wh_code try_surgery(wh_engine *e, uint32_t i, uint32_t bucket, verdict *out)
{
	wh_fan *f = &e->w->fan;
	wh_surgery *s = &e->w->surgery;
	if (!wh_surgery_find(e, &e->w->trial, s) || overshoots(e, s->nshared))
		return WH_OK;
	const double err = isfinite(e->params->max_err) ? wh_surgery_distance(e, s) : 0;
	if (!(err <= e->params->max_err))
		return WH_OK;
	const double weight = f->weight.at[i],
	             cost = fmax(f->cost.at[i], CUT_SHARE * weight * s->size2);
	if (!(cost <= e->params->max_cost))
		return WH_OK;
	f->cost.at[i] = cost;
	*out = DEFERRED;
	if (wh_queue_bucket(&e->w->queue, cost) > bucket + slack(e))
		return WH_OK;
	if (e->wedges && !wh_wedges_plan_surgery(e, s, &e->w->trial)) {
		*out = REJECTED;
		return WH_OK;
	}
	*out = TAKEN;
	return operate(e, s, cost, weight, err);
}

/* A vertex without any collapse: when it is in a part of a few faces, the part goes when its time
 * has come. */
static wh_code try_shell(wh_engine *e, uint32_t v, uint32_t bucket, verdict *out)
{
	wh_shell s;
	if (!wh_shell_find(e, v, &s) || overshoots(e, s.faces))
		return WH_OK;
	const double cost = SHELL_SHARE * s.weight * s.size2, err = (double)s.err + sqrt(s.size2);
	if (!(cost <= e->params->max_cost) || !(err <= e->params->max_err))
		return WH_OK;
	if (wh_queue_bucket(&e->w->queue, cost) > bucket + slack(e)) {
		enqueue_at(e, v, cost);
		return WH_OK;
	}
	for (uint32_t i = 0; i < s.n; i++) {
		wh_queue_remove(&e->w->queue, s.id[i]);
		if (e->wedges)
			wh_wedges_drop(e, s.id[i]);
		if (wh_ring_set(e, s.id[i], NULL, 0) != WH_OK)
			return e->c->err.code;
		bury(e, s.id[i]);
	}
	*out = TAKEN;
	note_change(e, WH_SHELL, cost, s.weight, isfinite(e->params->max_err) ? err : 0, s.faces,
	            (int32_t)s.n);
	return WH_OK;
}

/* ---- the loop, on ------------------------------------------------------------------------- */

/* The accumulated distance where somebody asks for it. Of a collapse that leaves no face to be near
 * to, which only a limit forbids, the edge's length counts. */
static double distance(const wh_engine *e, const wh_trial *t)
{
	const bool limited = isfinite(e->params->max_err);
	if (!limited && !e->params->track_err)
		return 0;
	const double err = wh_trial_distance(e, t);
	if (limited || isfinite(err))
		return err;
	return fmax((double)e->p->err[t->u], (double)e->p->err[t->v]) + wh_norm(t->edge);
}

/* A collapse whose place is this many times as far from the planes of its faces, in the root mean
 * square, as the surface may still move. Of those within the limit one in ten thousand is so far,
 * of those beyond it most are: time with an error limit falls to 0.65, and 0 to 0.15 % more faces
 * stay. */
static const double FAR_FROM_PLANES = 1.5;

/* True when edge i of the fan need not be worked out: its collapse would move the surface too far.
 * Its cost over its weight is that mean square, where it is whittle's own and nothing else is in
 * it. */
static bool is_far(const wh_engine *e, uint32_t hub, uint32_t i)
{
	const wh_fan *f = &e->w->fan;
	if (!isfinite(e->params->max_err) || e->policy || e->weighted)
		return false;
	const double err = fmax((double)e->p->err[hub], (double)e->p->err[f->id[i]]);
	const double most = FAR_FROM_PLANES * (e->params->max_err - err);
	return f->cost.at[i] > f->weight.at[i] * most * most;
}

/* Performs the collapse of an edge of the fan when it is legal and within the limits. */
static wh_code try_edge(wh_engine *e, uint32_t hub, uint32_t i, uint32_t bucket,
                        bool allow_overshoot, verdict *out)
{
	struct wh_simplify_workspace *w = e->w;
	wh_trial *t = &w->trial;
	*out = REJECTED;
	if (is_far(e, hub, i))
		return WH_OK;
	if (!wh_trial_make(e, &w->fan, hub, i, t))
		return e->surgery ? try_surgery(e, i, bucket, out) : WH_OK;
	if (!wh_trial_sound(e, t) || (e->wedges && !wh_wedges_plan(e, hub, &w->fan, i, t)))
		return WH_OK;
	const double err = distance(e, t);
	if (!(err <= e->params->max_err))
		return WH_OK;
	if (e->params->most_faces && e->taken + t->nshared > e->params->most_faces) {
		e->full = true;
		return WH_OK;
	}
	*out = overshoots(e, t->nshared) && !allow_overshoot ? SPARED : TAKEN;
	return *out == TAKEN ? perform(e, t, err) : WH_OK;
}

/* Takes the cheapest legal edge of a vertex, while it is hardly dearer than the vertex's place in
 * the queue says; else the vertex goes back to where it belongs. */
static wh_code try_vertex(wh_engine *e, uint32_t v, uint32_t bucket, bool allow_overshoot,
                          verdict *out)
{
	wh_fan *f = &e->w->fan;
	bool spared = false;
	wh_fan_gather(e, v, f);
	if (e->wedges)
		wh_wedges_bar(e, v, f);
	if (e->policy)
		wh_policy_evaluate(e, v, f);
	else
		wh_fan_evaluate(f, &e->w->star[v].sum, e->manner);
	if (e->weighted)
		wh_blend_fan(e);
	for (;;) {
		const uint32_t i = e->weighted ? cheapest_weighted(e, v, f) : cheapest(f);
		const double cost = f->cost.at[i];
		*out = spared ? SPARED : REJECTED;
		if (e->surgery && !(cost < INFINITY))
			return try_shell(e, v, bucket, out);
		if (!(cost <= e->params->max_cost && cost < INFINITY))
			return WH_OK;
		if (wh_queue_bucket(&e->w->queue, cost) > bucket + slack(e)) {
			enqueue_at(e, v, cost);
			return WH_OK;
		}
		if (try_edge(e, v, i, bucket, allow_overshoot, out) != WH_OK)
			return e->c->err.code;
		if (*out == TAKEN || e->full)
			return WH_OK;
		if (*out == DEFERRED)
			continue;
		spared = spared || *out == SPARED;
		f->cost.at[i] = (double)INFINITY;
	}
}

/* What is around a vertex may have changed since it was evaluated: with the sum of its faces its
 * costs have grown, about. Where that tells that it got dearer it goes back unseen. */
static bool goes_back(wh_engine *e, uint32_t v, uint32_t bucket)
{
	wh_queue *q = &e->w->queue;
	const uint32_t now = wh_queue_bucket(q, e->w->star[v].guess);
	if (now <= bucket + slack(e) || e->policy)
		return false;
	wh_queue_push(q, v, now);
	return true;
}

/* Takes vertices until a limit is reached or none is left. */
static wh_code drain(wh_engine *e)
{
	wh_queue *q = &e->w->queue;
	uint32_t v, bucket, spare = WH_NONE, polls = 0;
	verdict found;
	while (!reached(e) && wh_queue_pop(q, &v, &bucket)) {
		if ((++polls & 0xfff) == 0 && wh_poll(e->c) != WH_OK)
			return e->c->err.code;
		if (goes_back(e, v, bucket))
			continue;
		if (try_vertex(e, v, bucket, false, &found) != WH_OK)
			return e->c->err.code;
		if (found == SPARED && spare == WH_NONE)
			spare = v;
	}
	/* One face too many, and no boundary edge to take it: one less then. */
	if (reached(e) || spare == WH_NONE || e->params->no_overshoot)
		return WH_OK;
	return try_vertex(e, spare, WH_QUEUE_BUCKETS, true, &found);
}

static void enqueue_all(wh_engine *e)
{
	for (uint32_t v = 0; v < e->p->nv; v++) {
		wh_star *s = &e->w->star[v];
		if (s->n && e->weighted)
			s->guess += wh_blend_guess(e, v);
		if (s->n)
			enqueue_unseen(e, v);
	}
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

/* The top of the queue's window: diagonal^5, which no collapse inside the patch's bounding box
 * exceeds by much; but what lies far outside the rest must not push the rest below the window. */
static double cost_scale(const wh_patch *p)
{
	if (p->nv == 0)
		return 1;
	wh_vec3 lo = p->pos[0], hi = p->pos[0];
	for (uint32_t v = 1; v < p->nv; v++) {
		lo = wh_lower(lo, p->pos[v]);
		hi = wh_upper(hi, p->pos[v]);
	}
	const double box2 = wh_norm2(wh_sub(hi, lo)), mid = width(p);
	const double d2 = mid > 0 ? fmin(box2, mid * mid * FAR_OUT * FAR_OUT) : box2;
	return d2 > 0 ? d2 * d2 * sqrt(d2) : 1;
}

/* The same where costs are a policy's, in whatever unit: far above the dearest of some vertices. */
static double policy_scale(const wh_engine *e)
{
	enum { PROBES = 257 };
	const uint32_t step = e->p->nv / PROBES + 1;
	double most = 0;
	for (uint32_t v = 0; v < e->p->nv; v += step) {
		const double cost = e->w->star[v].n ? wh_policy_least(e, v) : 0;
		if (cost < INFINITY)
			most = fmax(most, cost);
	}
	return most > 0 ? fmin(0x1p60 * most, DBL_MAX) : 1;
}

static double queue_top(const wh_engine *e)
{
	if (isfinite(e->params->max_cost))
		return e->params->max_cost;
	return e->policy ? policy_scale(e) : cost_scale(e->p);
}

static wh_code pass(wh_engine *e)
{
	e->dead = WH_NONE;
	if (wh_stars_build(e) != WH_OK ||
	    wh_queue_reset(e->c, &e->w->queue, e->p->nv, queue_top(e)) != WH_OK)
		return e->c->err.code;
	if (e->weighted && wh_blend_begin(e) != WH_OK)
		return e->c->err.code;
	enqueue_all(e);
	if (drain(e) != WH_OK)
		return e->c->err.code;
	wh_stars_unbuild(e);
	return WH_OK;
}

/* A count counts for more than faces that turn over; a distance does not. */
static bool must_reach(const wh_simplify_params *p)
{
	return (p->target_faces || p->target_vertices) && !isfinite(p->max_err);
}

wh_code wh_simplify(wh_ctx *c, wh_simplify_workspace *w, wh_patch *p,
                    const wh_simplify_params *params, wh_simplify_result *result)
{
	*result = (wh_simplify_result){0};
	wh_engine e = {.c = c,
	               .w = w,
	               .p = p,
	               .params = params,
	               .manner = params->fast ? &fast : &usual,
	               .result = result,
	               .surgery = params->free_topology && !params->sink,
	               .wedges = params->wedges,
	               .weighted = params->attributes && params->attributes->weighted,
	               .faces = p->nf,
	               .vertices = p->nv};
	wh_policy_choose(&e);
	if (reached(&e))
		return WH_OK;
	if (p->nf == 0) {
		result->exhausted = true;
		return WH_OK;
	}
	/* An edge turned down once may be legal later: start over while that helps. */
	for (;;) {
		const uint32_t before = e.faces;
		result->border = 0;
		if (pass(&e) != WH_OK)
			return c->err.code;
		const bool stuck = e.faces == before;
		if (!params->insist || reached(&e) || (stuck && (e.lenient || !must_reach(params))))
			break;
		e.lenient = stuck;
	}
	result->exhausted = !reached(&e);
	return WH_OK;
}

double wh_log_cost(uint32_t bin)
{
	const int64_t bits = ((int64_t)bin + 1) << (52 - WH_LOG_MANTISSA);
	double cost;
	memcpy(&cost, &bits, sizeof cost);
	return cost;
}

void wh_simplify_result_note(wh_simplify_result *r, double cost, double weight, double err)
{
	r->collapses++;
	r->vertices++;
	raise_to(r, cost, weight, err);
}

void wh_simplify_result_add(wh_simplify_result *sum, const wh_simplify_result *one)
{
	sum->collapses += one->collapses;
	sum->vertices += one->vertices;
	for (int k = 0; k < WH_TOPOLOGIES; k++)
		sum->changes[k] += one->changes[k];
	sum->highest_err = fmax(sum->highest_err, one->highest_err);
	if (one->highest_cost > sum->highest_cost) {
		sum->highest_cost = one->highest_cost;
		sum->cost_distance = one->cost_distance;
	}
}
