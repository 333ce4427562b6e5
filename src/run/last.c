#include "run/run.h"

#include "mesh/order.h"
#include "mesh/separate.h"
#include "pipeline/finish.h"

#include <math.h>

wh_code wh_run_stitch(wh_run *r)
{
	uint64_t unreferenced;
	wh_run_phase_begin(r);
	const wh_code code =
	    wh_finish_stitch(r->c, &r->store, &r->progress, &r->patch, &unreferenced);
	wh_run_note_unreferenced(r, unreferenced);
	r->report->never_free_vertices = 0; /* no vertex is on a cut now */
	if (code == WH_OK && !r->journaled) /* else whoever resumes this needs them */
		wh_run_forget(r, &r->store);
	r->stitched = true;
	return wh_run_phase_end(r, WH_PHASE_STITCH, code);
}

static uint32_t no_more_than(uint64_t count, uint32_t most)
{
	return count < most ? (uint32_t)count : most;
}

/* Where the topology may change, a vertex that is not manifold is doubled: kept, it would be in the
 * way. */
static wh_code separate(wh_run *r)
{
	wh_separated done = {0};
	if (!r->params->simplify_topology)
		return WH_OK;
	const wh_code code = wh_separate(r->c, &r->patch, r->report->input_vertices, &done);
	r->report->nonmanifold_split += done.doubled;
	r->work.changes[WH_SHELL] += done.pillows;
	return code;
}

/* The last collapses; of a progressive mesh they are kept. */
static wh_code simplify(wh_run *r, wh_simplify_workspace *w, const wh_simplify_params *p,
                        wh_simplify_result *done)
{
	if (!r->params->progressive)
		return wh_simplify(r->c, w, &r->patch, p, done);
	const uint32_t generation = r->generations++;
	wh_sequence_writer writer = {0};
	const wh_collapse_sink sink = {wh_sequence_put, &writer};
	wh_code code = wh_sequence_begin(r->c, &writer, &r->sequence, generation, 0, &r->patch, 0);
	wh_simplify_params kept = *p;
	kept.sink = &sink;
	if (code == WH_OK)
		code = wh_simplify(r->c, w, &r->patch, &kept, done);
	code = wh_sequence_end(r->c, &writer, &r->patch, code);
	wh_sequence_writer_free(r->c, &writer);
	r->patch.turnable = true; /* faces have ids */
	return code == WH_OK ? wh_sequence_keep(r->c, &r->sequence, generation, 1) : code;
}

wh_code wh_run_final_pass(wh_run *r)
{
	wh_reduce_report *t = r->report;
	wh_run_phase_begin(r);
	if (separate(r) != WH_OK)
		return wh_run_phase_end(r, WH_PHASE_FINAL, r->c->err.code);
	wh_simplify_params p = wh_run_engine(r);
	p.target_faces = no_more_than(t->target_faces, r->patch.nf);
	p.target_vertices = no_more_than(t->target_vertices, r->patch.nv);
	p.insist = true;
	wh_progress_phase(&r->progress, "final pass", r->patch.nf);
	wh_simplify_result done = {0};
	wh_simplify_workspace *w = wh_simplify_workspace_new(r->c);
	wh_code code = w ? WH_OK : r->c->err.code;
	if (code == WH_OK)
		code = simplify(r, w, &p, &done);
	wh_simplify_workspace_free(r->c, w);
	if (code == WH_OK) {
		wh_simplify_result_add(&r->work, &done);
		t->nonmanifold_kept = done.fixed;
		t->exhausted = done.exhausted && (t->target_faces || t->target_vertices) &&
		               !isfinite(r->max_err);
		t->one_less = t->target_faces && !t->target_vertices &&
		              (uint64_t)r->patch.nf + 1 == t->target_faces;
	}
	return wh_run_phase_end(r, WH_PHASE_FINAL, code);
}

wh_code wh_run_check(wh_run *r)
{
	const wh_mesh m = {
	    .nv = r->patch.nv, .nf = r->patch.nf, .pos = r->patch.pos, .tri = r->patch.tri};
	wh_check found;
	wh_run_phase_begin(r);
	wh_progress_phase(&r->progress, "check", m.nf);
	if (wh_run_phase_end(r, WH_PHASE_CHECK, wh_check_mesh(r->c, &m, &found)) != WH_OK)
		return r->c->err.code;
	wh_run_note_check(r, &found);
	return WH_OK;
}

wh_code wh_run_order(wh_run *r)
{
	wh_run_phase_begin(r);
	wh_progress_phase(&r->progress, "order", r->patch.nv);
	wh_order_workspace work = {0};
	const wh_code code = wh_patch_order(r->c, &r->patch, &work);
	wh_order_workspace_free(r->c, &work);
	return wh_run_phase_end(r, WH_PHASE_WRITE, code);
}

wh_code wh_run_write(wh_run *r, wh_outfile **out)
{
	const wh_polish polish = wh_run_polish(r);
	wh_polished shown = {.patch = r->patch};
	wh_ply_style style = wh_run_style(r);
	wh_code code = WH_OK;
	wh_run_phase_begin(r);
	if (wh_polish_is_any(&polish))
		code = wh_polish_patch(r->c, &r->patch, &polish, &style, &shown);
	if (code == WH_OK)
		code = wh_finish_write(r->c, &r->progress, *out, style, &shown.patch,
		                       r->ingest.scale, &r->report->output_vertices);
	if (wh_polish_is_any(&polish))
		wh_polished_free(r->c, &shown);
	r->report->output_faces = r->patch.nf;
	if (code == WH_OK)
		code = wh_run_commit(r, out);
	return wh_run_phase_end(r, WH_PHASE_WRITE, code);
}
