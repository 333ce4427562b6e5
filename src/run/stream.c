#include "run/run.h"

#include "pipeline/emit.h"
#include "pipeline/inspect.h"
#include "pipeline/settle.h"

#include <math.h>

/* A round to the exact count that leaves more than this is the last one, reached or not. */
static const double SETTLE_NO_PROGRESS = 0.99;
/* A trial goes on to this share of the target, as a survey is not exact ... */
static const double TRIAL_MARGIN = 0.92;
/* ... and where it falls short, to this many times the cost, before it goes as far as it can. */
static const double TRIAL_RAISE = 8;
enum {
	TRIALS = 4,   /* the last one as far as it can */
	PATIENCE = 4, /* rounds that wait for a partition that frees every vertex */
	MOST_SETTLINGS = 64
};

/* Faces and vertices that are too many for the targets; 0 where there is no such target. */
static wh_settle_params to_give_up(const wh_run *r)
{
	const wh_reduce_report *t = r->report;
	const uint64_t vertices = wh_run_vertices(r);
	return (wh_settle_params){.faces = t->target_faces ? r->faces - t->target_faces : 0,
	                          .vertices =
	                              t->target_vertices ? vertices - t->target_vertices : 0,
	                          .all = wh_run_engine(r)};
}

static bool is_reached(const wh_run *r)
{
	const wh_reduce_report *t = r->report;
	return (t->target_faces && r->faces <= t->target_faces) ||
	       (t->target_vertices && wh_run_vertices(r) <= t->target_vertices);
}

/* Costs that a trial may go to, one after the other while the one before was not enough. */
static wh_code trial_costs(wh_run *r, double cost[TRIALS])
{
	wh_cluster_params p = {.all = wh_run_engine(r)};
	p.all.log_in_order = true; /* rather too much than too little */
	if (wh_run_survey(r, TRIAL_MARGIN * wh_run_target_ratio(r), &p) != WH_OK)
		return r->c->err.code;
	cost[0] = p.all.max_cost;
	for (int i = 1; i + 1 < TRIALS; i++)
		cost[i] = TRIAL_RAISE * cost[i - 1];
	cost[TRIALS - 1] = INFINITY;
	return WH_OK;
}

/* One trial, and the round where it was enough or `partly` is true: then kept. */
static wh_code settle_at(wh_run *r, wh_store *next, const wh_settle_params *p, bool partly,
                         wh_step *step)
{
	wh_exec ex;
	wh_settle_result done = {0};
	if (wh_run_recall_step(r, WH_STEP_SETTLE, step)) {
		*next = step->store;
		next->spill = &r->spill;
		return WH_OK;
	}
	next->ledger = wh_run_ledger(r, r->store.clusters, WH_LEDGER_TRIAL);
	if (r->c->err.code != WH_OK || wh_run_cluster_workers(r, &ex) != WH_OK)
		return r->c->err.code;
	wh_run_phase_begin(r);
	const wh_code code = wh_settle(r->c, &ex, &r->progress, &r->store, next, p, partly, &done);
	next->ledger = NULL;
	if (wh_run_phase_end(r, WH_PHASE_SETTLE, wh_run_end_part(r, code)) != WH_OK)
		return wh_failed(r->c);
	*step = (wh_step){.kind = WH_STEP_SETTLE,
	                  .kept = done.reached || partly,
	                  .store = *next,
	                  .faces = done.round.faces,
	                  .unreferenced = done.round.unreferenced,
	                  .work = done.round.work,
	                  .reached = done.reached,
	                  .one_less = done.one_less};
	return wh_run_note_step(r, step);
}

/* A round that ends at the exact count, or as near to it as its clusters can come. */
static wh_code settle_once(wh_run *r)
{
	double cost[TRIALS] = {0};
	wh_step done = {0};
	wh_store next = {.spill = &r->spill, .generation = r->generations++};
	wh_settle_params p = to_give_up(r);
	if (trial_costs(r, cost) != WH_OK)
		return r->c->err.code;
	for (int i = 0; i < TRIALS && !done.reached; i++) {
		p.all.max_cost = cost[i];
		if (settle_at(r, &next, &p, i == TRIALS - 1, &done) != WH_OK)
			return r->c->err.code;
	}
	wh_run_forget(r, &r->store);
	r->store = next;
	r->faces = done.faces;
	wh_run_note_unreferenced(r, done.unreferenced);
	r->report->one_less = done.one_less;
	r->report->rounds++;
	wh_simplify_result_add(&r->work, &done.work);
	return WH_OK;
}

/* Another round to the error limit, which is all that there is to hold. */
static wh_code exhaust_once(wh_run *r)
{
	return wh_run_round(r, 1);
}

/* Rounds over cut after cut until the count is exact, or no round helps, and no vertex is left
 * that was on every cut. */
wh_code wh_run_settle(wh_run *r)
{
	const bool counted = wh_run_target_ratio(r) > 0;
	for (int i = 0; i < MOST_SETTLINGS; i++) {
		const bool near = r->recuts >= r->recuts_begun + WH_PLAN_ROUNDS_BEFORE_SETTLING - 1;
		if ((i > 0 || r->report->rounds > 0) && wh_run_recut(r, near) != WH_OK)
			return r->c->err.code;
		const uint64_t before = r->faces;
		const bool last = near && (r->report->never_free_vertices == 0 || i >= PATIENCE);
		wh_code code;
		if (!counted)
			code = exhaust_once(r);
		else if (last)
			code = is_reached(r) ? WH_OK : settle_once(r);
		else
			code = wh_run_round(r, wh_plan_keep_near(wh_run_target_ratio(r)));
		if (code != WH_OK)
			return code;
		if (last && ((counted && is_reached(r)) ||
		             (double)r->faces > SETTLE_NO_PROGRESS * (double)before))
			break;
	}
	r->report->streamed = true;
	r->report->exhausted = counted && !is_reached(r) && !isfinite(r->max_err);
	return WH_OK;
}

wh_code wh_run_check_clusters(wh_run *r)
{
	uint64_t max_v, max_f, faces, vertices;
	wh_check found;
	if (wh_round_extent(r->c, &r->store, &max_v, &max_f, &faces, &vertices) != WH_OK)
		return r->c->err.code;
	const wh_exec ex = wh_run_workers(r, wh_inspect_bytes(&r->store, max_v, max_f));
	wh_run_phase_begin(r);
	wh_code code = wh_inspect_store(r->c, &ex, &r->progress, &r->store, &found);
	if (code == WH_OK)
		wh_run_note_check(r, &found);
	if (code ==
	    WH_E_PLAN) { /* the cuts are too long to be held; the result is none the worse */
		r->c->err = (wh_error){0};
		code = WH_OK;
	}
	return wh_run_phase_end(r, WH_PHASE_CHECK, code);
}

wh_code wh_run_emit(wh_run *r, wh_outfile **out)
{
	uint64_t max_v, max_f, faces, vertices;
	wh_reduce_report *t = r->report;
	if (wh_round_extent(r->c, &r->store, &max_v, &max_f, &faces, &vertices) != WH_OK)
		return r->c->err.code;
	const wh_ply_style style = wh_run_style(r);
	const wh_exec ex = wh_run_workers(r, wh_emit_bytes(&r->store, style.doubled, max_v, max_f));
	t->output_vertices = wh_run_vertices(r);
	t->output_faces = r->faces;
	wh_run_phase_begin(r);
	wh_code code = wh_emit(r->c, &ex, &r->progress, &r->store, *out, style, r->ingest.scale,
	                       &t->output_vertices, t->output_faces);
	if (code == WH_OK)
		code = wh_run_commit(r, out);
	return wh_run_phase_end(r, WH_PHASE_WRITE, code);
}
