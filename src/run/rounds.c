#include "run/run.h"

#include <math.h>

enum { MOST_LOWERINGS = 12 }; /* of a round's cost limit, by a factor of 8 each */

/* Workers for stages that hold one cluster each. */
wh_code wh_run_cluster_workers(wh_run *r, wh_exec *ex)
{
	uint64_t max_v, max_f, faces, vertices;
	if (wh_round_extent(r->c, &r->store, &max_v, &max_f, &faces, &vertices) != WH_OK)
		return r->c->err.code;
	const size_t trace =
	    r->params->progressive ? wh_sequence_bytes(max_v, max_f, r->store.attr_bytes) : 0;
	*ex = wh_run_workers(r, wh_round_bytes(&r->store, max_v, max_f, wh_run_state_bytes(r)) +
	                            trace);
	return WH_OK;
}

/* The cost limits of a round that is to keep this share of the faces. */
static wh_code survey(wh_run *r, double keep, wh_cluster_params *p)
{
	wh_exec ex;
	if (wh_run_cluster_workers(r, &ex) != WH_OK)
		return r->c->err.code;
	wh_run_phase_begin(r);
	wh_survey s = {.log = wh_calloc(r->c, 1, sizeof *s.log)};
	wh_code code = r->c->err.code;
	if (code == WH_OK)
		code = wh_round_survey(r->c, &ex, &r->progress, &r->store, WH_PLAN_SURVEY_FACES,
		                       &p->all, &s);
	if (code == WH_OK) {
		p->all.max_cost = wh_survey_cost(&s, keep);
		p->micro_cost = wh_survey_cost(&s, wh_plan_keep_micro(&r->sizes, keep));
	}
	wh_free(r->c, s.log);
	return wh_run_phase_end(r, WH_PHASE_SURVEY, code);
}

wh_code wh_run_survey(wh_run *r, double keep, wh_cluster_params *p)
{
	wh_step step;
	if (wh_run_recall_step(r, WH_STEP_SURVEY, &step)) {
		p->all.max_cost = step.max_cost;
		p->micro_cost = step.micro_cost;
		return WH_OK;
	}
	if (wh_run_alone(r) != WH_OK || survey(r, keep, p) != WH_OK)
		return r->c->err.code;
	step = (wh_step){
	    .kind = WH_STEP_SURVEY, .max_cost = p->all.max_cost, .micro_cost = p->micro_cost};
	return wh_run_note_step(r, &step);
}

/* All clusters into `next`; kept: not too much of them went. */
static wh_code reduce(wh_run *r, wh_store *next, const wh_cluster_params *p, uint64_t least,
                      wh_step *step)
{
	wh_exec ex;
	wh_round_result done;
	if (wh_run_recall_step(r, WH_STEP_REDUCE, step)) {
		*next = step->store;
		next->spill = &r->spill;
		return WH_OK;
	}
	next->ledger = wh_run_ledger(r, r->store.clusters, WH_LEDGER_SAVED);
	if (r->c->err.code != WH_OK || wh_run_cluster_workers(r, &ex) != WH_OK)
		return r->c->err.code;
	wh_run_phase_begin(r);
	const wh_code code = wh_round_reduce(r->c, &ex, &r->progress, &r->store, next, p, &done);
	next->ledger = NULL;
	if (wh_run_phase_end(r, WH_PHASE_DECIMATE, wh_run_end_part(r, code)) != WH_OK)
		return wh_failed(r->c);
	*step = (wh_step){.kind = WH_STEP_REDUCE,
	                  .kept = done.faces > least || !isfinite(p->all.max_cost),
	                  .store = *next,
	                  .faces = done.faces,
	                  .unreferenced = done.unreferenced,
	                  .work = done.work};
	return wh_run_note_step(r, step);
}

/* Decimates all clusters down to the shared cost limit. A limit that turns out to take too much
 * is lowered, and the round done again. Where that does not help either, as too many collapses
 * cost nothing at all, the mesh is left as it was. */
static wh_code decimate(wh_run *r, wh_cluster_params *p, double ratio)
{
	wh_store next = {.spill = &r->spill,
	                 .sequence = r->params->progressive ? &r->sequence : NULL};
	wh_step done;
	const uint64_t least = (uint64_t)(1.02 * ratio * (double)r->faces);
	uint64_t last = 0;
	for (int lowered = 0;; lowered++) {
		next.generation = r->generations++;
		if (reduce(r, &next, p, least, &done) != WH_OK)
			return r->c->err.code;
		wh_run_note_unreferenced(r, done.unreferenced);
		if (done.kept)
			break;
		wh_run_forget(r, &next);
		wh_sequence_drop(&r->spill, next.generation, next.sequence ? next.clusters : 0);
		if (lowered == MOST_LOWERINGS || done.faces == last)
			return WH_OK;
		last = done.faces;
		p->all.max_cost /= 8;
		p->micro_cost /= 8;
	}
	if (next.sequence &&
	    wh_sequence_keep(r->c, &r->sequence, next.generation, next.clusters) != WH_OK)
		return r->c->err.code;
	wh_run_forget(r, &r->store);
	r->store = next;
	r->faces = done.faces;
	r->report->rounds++;
	wh_simplify_result_add(&r->work, &done.work);
	return WH_OK;
}

static wh_code recut(wh_run *r, const wh_recut_params *params, wh_store *next)
{
	wh_recut_params p = *params;
	wh_exec ex = r->exec;
	size_t need;
	if (wh_recut_fit(r->c, &r->store, next->clusters, wh_run_budget(r), &ex, &p.buffer,
	                 &need) != WH_OK)
		return r->c->err.code;
	wh_run_phase_begin(r);
	const wh_code code =
	    wh_recut(r->c, &ex, &r->progress, &r->store, next, &p, &r->report->never_free_vertices);
	return wh_run_phase_end(r, WH_PHASE_RECUT, code);
}

/* Cuts anew; `free_all`: so that no vertex is on a cut that always was. */
wh_code wh_run_recut(wh_run *r, bool free_all)
{
	const wh_recut_params p = {.skew = wh_plan_skew(++r->recuts), .free_all = free_all};
	wh_store next = {.spill = &r->spill, .generation = r->generations++};
	wh_step step;
	next.clusters = wh_plan_clusters(&r->sizes, r->faces);
	if (wh_run_recall_step(r, WH_STEP_RECUT, &step)) {
		next = step.store;
		next.spill = &r->spill;
		r->report->never_free_vertices = step.never_free;
	} else {
		if (wh_run_alone(r) != WH_OK || recut(r, &p, &next) != WH_OK)
			return r->c->err.code;
		step = (wh_step){.kind = WH_STEP_RECUT,
		                 .kept = true,
		                 .store = next,
		                 .never_free = r->report->never_free_vertices};
		if (wh_run_note_step(r, &step) != WH_OK)
			return r->c->err.code;
	}
	wh_run_forget(r, &r->store);
	r->store = next;
	return WH_OK;
}

/* Decimates all clusters so that a share of the faces is left, or to the error limit. */
wh_code wh_run_round(wh_run *r, double keep)
{
	const double ratio = wh_run_target_ratio(r);
	wh_cluster_params params = {.micro_faces = (uint32_t)r->params->micro_faces,
	                            .micro_cost = INFINITY,
	                            .all = wh_run_engine(r)};
	if ((ratio > 0 || r->sizes.round_keep > 0) && wh_run_survey(r, keep, &params) != WH_OK)
		return r->c->err.code;
	return decimate(r, &params, ratio);
}

/* Rounds, until the mesh fits the final pass or a round no longer helps. */
wh_code wh_run_rounds(wh_run *r)
{
	const uint64_t micro = r->params->micro_faces;
	if (r->store.clusters == 1 && (micro == 0 || r->faces <= 2 * micro))
		return WH_OK;
	for (bool on = wh_plan_round_pays(wh_run_target_ratio(r)); on;) {
		const uint32_t clusters = r->store.clusters;
		const uint64_t before = r->faces;
		if (r->report->rounds > 0 && wh_run_recut(r, false) != WH_OK)
			return r->c->err.code;
		if (wh_run_round(r, wh_plan_keep(&r->sizes, r->faces, wh_run_target_ratio(r))) !=
		    WH_OK)
			return r->c->err.code;
		on = wh_plan_go_on(&r->sizes, clusters, before, r->faces, wh_run_target_ratio(r));
	}
	return WH_OK;
}
