/*
 * Several results of one run. Each is reached from where the one before ended: what a store holds
 * after its count was settled, or the patch of the last pass. So the rounds of a level are those
 * that a run of its own would have gone through from there.
 *
 * A level is delivered when its output is whole; with a run directory that is a step. Whoever
 * resumes the run reaches the levels of the last pass again, as their patch is kept nowhere, but
 * does not deliver them again.
 */
#include "run/run.h"

#include <string.h>

size_t wh_run_results(const wh_run *r)
{
	return r->params->levels + 1;
}

wh_level wh_run_result(const wh_run *r, size_t i)
{
	const wh_reduce_params *p = r->params;
	if (i < p->levels)
		return p->level[i];
	return (wh_level){.faces = p->faces,
	                  .face_ratio = p->face_ratio,
	                  .vertices = p->vertices,
	                  .vertex_ratio = p->vertex_ratio,
	                  .error = p->error,
	                  .error_share = p->error_share,
	                  .output = p->output};
}

void wh_run_aim(wh_run *r, size_t i)
{
	wh_reduce_report *t = r->report;
	r->at = i;
	r->aim = wh_run_result(r, i);
	r->recuts_begun = i > 0 && t->rounds > 0 ? r->recuts + 1 : r->recuts;
	t->streamed = t->one_less = t->exhausted = t->checked = false;
	wh_run_targets(r);
	wh_run_limit_error(r);
}

bool wh_run_leaves_out(wh_run *r)
{
	const wh_reduce_report *t = r->report;
	if (wh_run_is_last(r) || !wh_run_is_no_smaller(r))
		return false;
	r->report->level[r->at] = (wh_level_report){.target_faces = t->target_faces,
	                                            .target_vertices = t->target_vertices,
	                                            .left_out = true};
	return true;
}

bool wh_run_is_delivered(wh_run *r)
{
	wh_step step;
	if (wh_run_is_last(r) || !wh_run_recall_step(r, WH_STEP_WRITE, &step))
		return false;
	r->report->level[r->at] = step.level;
	return true;
}

void wh_run_note_level(wh_run *r, const wh_written *w)
{
	const wh_reduce_report *t = r->report;
	const double unit = 1 / r->ingest.scale;
	wh_level_report *l = &r->report->level[r->at];
	*l = (wh_level_report){.target_faces = t->target_faces,
	                       .target_vertices = t->target_vertices,
	                       .vertices = t->output_vertices,
	                       .faces = t->output_faces,
	                       .bytes = w->output_bytes,
	                       .cost_distance = r->work.cost_distance * unit,
	                       .accumulated_error = r->work.highest_err * unit,
	                       .checked = t->checked,
	                       .streamed = t->streamed,
	                       .one_less = t->one_less,
	                       .exhausted = t->exhausted};
	if (t->checked) {
		l->boundary_edges = t->boundary_edges;
		l->nonmanifold_edges = t->nonmanifold_edges;
		l->components = t->components;
	}
	memcpy(l->checksum, w->output, sizeof l->checksum);
}
