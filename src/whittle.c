/*
 * The order of the stages of a reduction. How each is run is in run/, what it does in pipeline/.
 *
 *     open -> ingest -> [survey -> decimate -> (recut -> survey -> decimate)*]
 *          -> stitch -> final pass -> check -> write           a result that fits memory
 *          -> (recut -> round)* -> recut -> settle -> check -> write     a larger one
 *
 * Of several results, each goes on from the one before: behind "open -> ingest", or at the final
 * pass once there was one.
 */
#define _GNU_SOURCE
#include "whittle.h"

#include "base/timer.h"
#include "exec/topo.h"
#include "io/outfile.h"
#include "io/rply_read.h"
#include "pipeline/skins.h"
#include "run/run.h"

#include <string.h>

enum {
	MOST_SIZE = 100 * 1000 * 1000,
	OPEN_BYTES = 32 * 1024 * 1024 /* enough to look at the input and to refuse it in words */
};

const char *wh_phase_name(wh_phase phase)
{
	static const char *const name[WH_PHASES] = {"open",  "ingest", "survey", "decimate",
	                                            "recut", "settle", "stitch", "final",
	                                            "check", "write"};
	return name[phase];
}

wh_reduce_params wh_reduce_defaults(void)
{
	return (wh_reduce_params){.cluster_faces = 128ULL * 1024, .micro_faces = 16ULL * 1024};
}

/* What the outputs' names tell. */
static wh_code name_formats(wh_run *r)
{
	const wh_reduce_params *p = r->params;
	if (p->seams && wh_format_only(r->c, p->seams, "ply") != WH_OK)
		return r->c->err.code;
	return p->progressive && p->output
	           ? wh_format_only(r->c, p->output, "pmesh")
	           : wh_format_of_output(r->c, p->to, p->output, &r->to, &r->packing);
}

/* The formats that the caller names, or the outputs' names tell. */
static wh_code take_formats(wh_run *r)
{
	const char *reader = r->params->reader;
	const char *from = r->params->from;
	if (name_formats(r) != WH_OK)
		return r->c->err.code;
	if (r->params->quantize && r->to != WH_FORMAT_GLB)
		return wh_fail(r->c, WH_E_USAGE,
		               "only GLB is written with quantized positions: name the output "
		               "*.glb, or say --to glb");
	if (from && (!wh_format_parse(from, &r->from) || r->from == WH_FORMAT_GLB))
		return wh_fail(r->c, WH_E_USAGE,
		               "'%s' is no format that can be read: give ply, "
		               "obj, off or stl",
		               from);
	r->rply = reader && strcmp(reader, "rply") == 0;
	if (reader && !r->rply && strcmp(reader, "whittle") != 0)
		return wh_fail(r->c, WH_E_USAGE, "'%s' is no reader: give whittle or rply", reader);
	return r->rply ? wh_rply_available(r->c) : WH_OK;
}

static wh_code open_all(wh_run *r, wh_outfile **out)
{
	if (take_formats(r) != WH_OK || wh_run_take_policy(r) != WH_OK)
		return r->c->err.code;
	if (r->params->stage == WH_STAGE_PLAN || wh_run_is_part(r)) /* which have no outputs */
		return wh_run_open_spill(r);
	if (!r->params->run_dir && wh_run_open_output(r, out) != WH_OK)
		return r->c->err.code;
	if (wh_run_open_spill(r) != WH_OK || wh_run_try_output(r) != WH_OK ||
	    wh_run_open_seams(r) != WH_OK)
		return r->c->err.code;
	return WH_OK;
}

static wh_code open_input(wh_run *r)
{
	wh_run_phase_begin(r);
	return wh_run_phase_end(r, WH_PHASE_OPEN,
	                        wh_run_is_begun(r) ? wh_run_reopen_input(r) : wh_run_open_input(r));
}

/* Reduces the mesh to the aim. */
static wh_code reach(wh_run *r)
{
	if (!r->stitched && wh_run_rounds(r) != WH_OK)
		return r->c->err.code;
	const bool streams =
	    !r->stitched && wh_plan_streams(&r->sizes, r->store.clusters, r->faces);
	if (streams && r->params->progressive)
		return wh_run_refuse_streamed(r);
	if (streams && (r->params->smooth || r->params->normals))
		return wh_run_refuse_polish(r);
	if (streams)
		return wh_run_settle(r) == WH_OK ? wh_run_end_rounds(r) : r->c->err.code;
	if (!r->stitched && (wh_run_end_rounds(r) != WH_OK || wh_run_stitch(r) != WH_OK))
		return r->c->err.code;
	return wh_run_final_pass(r) == WH_OK ? wh_run_order(r) : r->c->err.code;
}

/* Checks it and writes it. */
static wh_code deliver(wh_run *r, wh_outfile **out)
{
	if (wh_run_is_delivered(r))
		return WH_OK;
	if (r->stitched && (wh_run_check(r) != WH_OK || wh_run_open_output(r, out) != WH_OK))
		return r->c->err.code;
	if (r->stitched)
		return r->params->progressive ? wh_run_write_record(r, out) : wh_run_write(r, out);
	return wh_run_check_clusters(r) == WH_OK && wh_run_open_output(r, out) == WH_OK
	           ? wh_run_emit(r, out)
	           : r->c->err.code;
}

/* `last`: the last one's output, which may be open already. */
static wh_code one_result(wh_run *r, wh_outfile **last)
{
	wh_outfile *own = NULL;
	if (reach(r) != WH_OK)
		return r->c->err.code;
	const wh_code code = deliver(r, wh_run_is_last(r) ? last : &own);
	wh_outfile_abort(r->c, &own);
	return code;
}

static wh_code all_stages(wh_run *r, wh_outfile **out)
{
	if (open_all(r, out) != WH_OK || wh_run_stage(r) != WH_OK || open_input(r) != WH_OK)
		return r->c->err.code;
	if (wh_run_copies(r)) {
		if (wh_run_end_rounds(r) != WH_OK || wh_run_write_seams(r, false) != WH_OK ||
		    wh_run_open_output(r, out) != WH_OK)
			return r->c->err.code;
		return wh_run_copy_input(r, out);
	}
	wh_run_list_carried(r);
	wh_run_phase_begin(r);
	if (wh_run_phase_end(r, WH_PHASE_INGEST, wh_run_ingest(r)) != WH_OK ||
	    wh_run_write_seams(r, false) != WH_OK)
		return r->c->err.code;
	for (size_t i = 0; i < wh_run_results(r); i++) {
		wh_run_aim(r, i);
		if (!wh_run_leaves_out(r) && one_result(r, out) != WH_OK)
			return r->c->err.code;
	}
	return WH_OK;
}

/* What the output names of that which lies beside the input. Not being able to tell is no failure.
 */
static void list_references(wh_run *r)
{
	char *list = r->report->refers;
	const size_t size = sizeof r->report->refers;
	const char *texture = wh_run_style(r).texture;
	wh_ctx own = wh_ctx_fork(r->c);
	if (r->input.wedges.bytes && (r->to == WH_FORMAT_OBJ || r->to == WH_FORMAT_PLY))
		(void)wh_skins_list_files(&own, &r->input, list, size);
	else if (r->to == WH_FORMAT_GLB && texture)
		wh_list_name(list, size, texture);
}

/* What may reach a target that was missed: the next step of what is given up for it. */
static const char *remedy(const wh_run *r, bool wedged)
{
	if (!r->params->simplify_topology)
		return "; --topology simplify may reach it";
	return wedged ? "; --attributes none may reach it" : "";
}

/* What an unfinished target means to the caller; the mesh is written already. `wedged`: faces and
 * their corners carry something, which may be what is in the way. */
static wh_code verdict(wh_run *r, bool wedged)
{
	const wh_reduce_report *t = r->report;
	if (!t->exhausted)
		return WH_OK;
	return wh_fail(
	    r->c, WH_E_TARGET,
	    "%s: stopped at %llu faces, more than asked for: every further collapse would "
	    "%sturn faces over%s%s%s; this best mesh was written%s",
	    r->params->output, (unsigned long long)t->output_faces,
	    r->params->simplify_topology ? "" : "change the topology or ",
	    r->params->lock_boundary ? ", or move the locked boundary" : "",
	    t->nonmanifold_kept ? ", or move non-manifold vertices, which are kept" : "",
	    wedged ? ", or break what faces and their corners carry" : "", remedy(r, wedged));
}

static bool is_sensible(const wh_level *l)
{
	return (l->faces || l->face_ratio > 0 || l->vertices || l->vertex_ratio > 0 ||
	        l->error > 0 || l->error_share > 0) &&
	       l->face_ratio <= 1 && l->vertex_ratio <= 1 && l->output &&
	       strcmp(l->output, "-") != 0;
}

/* Each has a limit and a file of its own. */
static wh_code sensible_levels(wh_ctx *c, const wh_reduce_params *p)
{
	if (p->levels && (p->stage != WH_STAGE_ALL || p->parts))
		return wh_fail(c, WH_E_USAGE, "several levels are not for runs in parts");
	if (p->levels > WH_LEVELS_MOST)
		return wh_fail(c, WH_E_USAGE, "more than %d levels", WH_LEVELS_MOST);
	for (size_t i = 0; i < p->levels; i++) {
		const wh_level *l = &p->level[i];
		if (!is_sensible(l))
			return wh_fail(c, WH_E_USAGE, "level %zu has no limit, or no file to go to",
			               i + 1);
		bool twice =
		    (p->output && wh_outfile_same(l->output, p->output)) ||
		    (p->seams && wh_outfile_same(l->output, p->seams)) ||
		    (!wh_ply_is_read_once(p->input) && wh_outfile_same(l->output, p->input));
		for (size_t k = 0; k < i; k++)
			twice = twice || wh_outfile_same(l->output, p->level[k].output);
		if (twice)
			return wh_fail(
			    c, WH_E_USAGE,
			    "'%s' is the output of two levels, the input, or the list of "
			    "cut vertices",
			    l->output);
	}
	return WH_OK;
}

static wh_code sensible(wh_ctx *c, const wh_reduce_params *p)
{
	if (!p->faces && !(p->face_ratio > 0) && !p->vertices && !(p->vertex_ratio > 0) &&
	    !(p->error > 0) && !(p->error_share > 0))
		return wh_fail(c, WH_E_USAGE,
		               "no target: give --faces, --vertices, --ratio or --error");
	if (p->face_ratio > 1 || p->vertex_ratio > 1)
		return wh_fail(c, WH_E_USAGE, "a share of what there is cannot be above 1");
	if (sensible_levels(c, p) != WH_OK)
		return c->err.code;
	if (p->run_dir && wh_ply_is_read_once(p->input))
		return wh_fail(c, WH_E_USAGE,
		               "a run directory, or several processes, need an input that can be "
		               "read again: save %s to a file first",
		               strcmp(p->input, "-") == 0 ? "standard input" : p->input);
	if (p->resume && !p->run_dir)
		return wh_fail(c, WH_E_USAGE, "--resume needs the --run-dir that is to be resumed");
	if (wh_run_sensible_record(c, p) != WH_OK || wh_run_sensible_stage(c, p) != WH_OK)
		return c->err.code;
	if (p->threads < 0 || p->cluster_faces > MOST_SIZE || p->micro_faces > MOST_SIZE)
		return wh_fail(c, WH_E_USAGE,
		               "threads, cluster or micro-cluster size out of range");
	if (!(p->round_keep >= 0) || p->round_keep >= 0.9)
		return wh_fail(c, WH_E_USAGE, "a round keeps a share of the faces below 0.9");
	return WH_OK;
}

wh_code wh_reduce(wh_ctx *c, const wh_reduce_params *params, wh_reduce_report *report)
{
	*report = (wh_reduce_report){0};
	c->err = (wh_error){0};
	if (wh_run_needs_files(c, params) != WH_OK || sensible(c, params) != WH_OK)
		return c->err.code;
	wh_run r = {.c = c,
	            .start = wh_seconds(),
	            .params = params,
	            .report = report,
	            .progress = {.fn = params->progress,
	                         .user = params->progress_user,
	                         .telling = ATOMIC_FLAG_INIT},
	            .exec = {.workers = wh_exec_threads(params->threads)},
	            .memory = params->memory ? params->memory : wh_topo_memory() / 2,
	            .cuts = {.fd = -1},
	            .sizes = wh_run_sizes(params)};
	r.exec.stats = &r.stats;
	wh_run_aim(&r, params->levels);
	const size_t old_limit = c->mem->limit;
	atomic_store(&c->mem->peak, atomic_load(&c->mem->used));
	c->mem->limit = r.memory > OPEN_BYTES ? r.memory - WH_PLAN_BASE / 2 : OPEN_BYTES;
	wh_outfile *out = NULL;
	wh_code code = all_stages(&r, &out);
	wh_outfile_abort(c, &out);
	wh_run_close_seams(&r);
	const double unit = r.ingest.scale > 0 ? 1 / r.ingest.scale : 1;
	report->cost_distance = r.work.cost_distance * unit;
	report->accumulated_error = r.work.highest_err * unit;
	report->shells = r.work.changes[WH_SHELL];
	report->holes = r.work.changes[WH_HOLE];
	report->necks = r.work.changes[WH_NECK];
	report->bridges = r.work.changes[WH_BRIDGE];
	report->threads = r.exec.workers;
	report->memory_ceiling = r.memory;
	report->memory_peak = atomic_load(&c->mem->peak);
	report->temp_bytes_peak = atomic_load(&r.spill.peak);
	report->bytes_read += atomic_load(&r.spill.bytes_read);
	report->bytes_written = wh_run_bytes_written(&r);
	wh_patch_free(c, &r.patch);
	wh_sequence_free(c, &r.sequence);
	const bool wedged = r.input.wedges.bytes > 0;
	if (r.input_open) {
		list_references(&r);
		wh_input_close(c, &r.spill, &r.input);
	}
	wh_run_close_folder(&r, code);
	wh_spill_close(c, &r.spill);
	c->mem->limit = old_limit;
	report->seconds_total = wh_seconds() - r.start;
	if (report->paused) {
		c->err = (wh_error){0};
		return WH_OK;
	}
	return code == WH_OK ? verdict(&r, wedged) : code;
}

/* ---- the plan ----------------------------------------------------------------------------- */

/* Opens the input for a look: where its body has to be rewritten, only the counts are known. */
static wh_code look_at_input(wh_run *r, wh_plan_report *report)
{
	wh_ply *ply = &r->input.ply;
	wh_source *src = &r->input.source;
	const char *temp_dir = r->params->temp_dir;
	if (take_formats(r) != WH_OK || wh_run_take_policy(r) != WH_OK ||
	    (temp_dir && wh_spill_open(r->c, &r->spill, temp_dir, NULL) != WH_OK) ||
	    wh_input_look(r->c, &r->exec, &r->spill, r->params->input, r->from, wh_run_wanted(r),
	                  &r->input) != WH_OK)
		return r->c->err.code;
	r->input_open = true;
	if (wh_attributes_weigh(r->c, r->input.ply.path, r->params->weights,
	                        &r->input.attributes) != WH_OK)
		return r->c->err.code;
	report->rewritten = src->ffd != ply->fd;
	report->input_bytes = r->input.file_bytes;
	r->report->input_vertices = report->input_vertices = src->nv;
	r->report->input_faces = report->input_faces = src->nf;
	r->faces = src->nf;
	wh_run_targets(r);
	return WH_OK;
}

static void fill_plan(const wh_run *r, wh_plan_report *report)
{
	report->target_faces = r->report->target_faces;
	report->target_vertices = r->report->target_vertices;
	report->unchanged = wh_run_copies(r);
	report->threads = r->exec.workers;
	report->memory_ceiling = r->memory;
	report->clusters = r->plan.clusters;
	report->windows = r->plan.windows;
	report->rounds = r->plan.rounds;
	report->passes = r->plan.passes;
	report->streamed = r->plan.streams;
	report->shared_input = !report->unchanged && wh_run_shares_input(r);
	report->memory_least = r->plan.least;
	report->peak_rss = r->plan.peak_ram;
	report->temp_bytes_peak = r->plan.peak_disk;
}

wh_code wh_plan_reduce(wh_ctx *c, const wh_reduce_params *params, wh_plan_report *report)
{
	*report = (wh_plan_report){0};
	c->err = (wh_error){0};
	if (!params->input)
		return wh_fail(c, WH_E_USAGE, "no input is named");
	if (sensible(c, params) != WH_OK)
		return c->err.code;
	wh_reduce_report counts = {0};
	wh_run r = {.c = c,
	            .params = params,
	            .report = &counts,
	            .exec = {.workers = wh_exec_threads(params->threads)},
	            .memory = params->memory ? params->memory : wh_topo_memory() / 2,
	            .sizes = wh_run_sizes(params)};
	wh_run_aim(&r, params->levels);
	wh_code code = look_at_input(&r, report);
	if (code == WH_OK) {
		if (!wh_run_copies(&r))
			code = wh_run_plan(&r);
		fill_plan(&r, report);
	}
	if (r.input_open)
		wh_input_close(c, &r.spill, &r.input);
	wh_spill_close(c, &r.spill);
	return code;
}
