/*
 * The order of the stages of a reduction, and the budget that each of them gets. What the stages
 * do is in pipeline/.
 *
 *     open -> ingest -> [survey -> decimate -> (recut -> survey -> decimate)*] -> stitch
 *          -> final pass -> check -> write
 */
#define _GNU_SOURCE
#include "whittle.h"

#include "base/timer.h"
#include "exec/topo.h"
#include "mesh/check.h"
#include "mesh/order.h"
#include "pipeline/emit.h"
#include "pipeline/finish.h"
#include "pipeline/ingest.h"
#include "pipeline/inspect.h"
#include "pipeline/normalise.h"
#include "pipeline/plan.h"
#include "pipeline/round.h"
#include "pipeline/settle.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

/* A round to the exact count that leaves more than this is the last one, reached or not. */
static const double SETTLE_NO_PROGRESS = 0.99;
/* A trial goes on to this share of the target, as a survey is not exact ... */
static const double TRIAL_MARGIN = 0.92;
/* ... and where it falls short, to this many times the cost, before it goes as far as it can. */
static const double TRIAL_RAISE = 64;
enum {
	MOST_SIZE = 100 * 1000 * 1000,
	MOST_LOWERINGS = 12,        /* of a round's cost limit, by a factor of 8 each */
	ROUNDS_BEFORE_SETTLING = 2, /* with the last one, three different partitions */
	PATIENCE = 4,               /* rounds that wait for a partition that frees every vertex */
	MOST_SETTLINGS = 64,
	OPEN_BYTES = 32 * 1024 * 1024 /* enough to look at the input and to refuse it in words */
};

typedef struct run {
	wh_ctx *c;
	const wh_reduce_params *params;
	wh_reduce_report *report;
	wh_exec exec;
	wh_progress progress;
	wh_spill spill;
	wh_input input;
	bool input_open;
	wh_ingest_result ingest;
	wh_store store; /* what the mesh lies in now */
	uint64_t faces; /* of it */
	uint32_t generations, recuts;
	wh_patch patch;
	double max_err;
	double phase_start;
	size_t memory; /* ceiling */
	wh_plan_sizes sizes;
	wh_plan plan;
	wh_simplify_result work; /* of all stages */
} run;

const char *wh_phase_name(wh_phase phase)
{
	static const char *const name[WH_PHASES] = {"open",  "ingest", "survey", "decimate",
	                                            "recut", "settle", "stitch", "final",
	                                            "check", "write"};
	return name[phase];
}

wh_reduce_params wh_reduce_defaults(void)
{
	return (wh_reduce_params){.cluster_faces = 256ULL * 1024, .micro_faces = 16ULL * 1024};
}

static wh_plan_sizes sizes_of(const wh_reduce_params *p)
{
	return (wh_plan_sizes){p->cluster_faces, p->micro_faces, p->final_faces};
}

static void phase_begin(run *r)
{
	r->phase_start = wh_seconds();
}

static wh_code phase_end(run *r, wh_phase phase, wh_code code)
{
	r->report->seconds[phase] += wh_seconds() - r->phase_start;
	return code;
}

/* ---- budget ------------------------------------------------------------------------------- */

static size_t budget(const run *r)
{
	return r->memory > WH_PLAN_BASE ? r->memory - WH_PLAN_BASE : 0;
}

/* A refusal names a ceiling that does for all stages. */
static wh_code too_small(run *r, const char *what, size_t need)
{
	if (need + WH_PLAN_BASE < r->plan.least)
		need = r->plan.least - WH_PLAN_BASE;
	const size_t mib = ((need + WH_PLAN_BASE) >> 20) + 2;
	return wh_fail(r->c, WH_E_PLAN,
	               "%s needs more memory than the ceiling of %zu MiB: use --memory %zuM", what,
	               r->memory >> 20, mib);
}

/* As many workers as fit when each takes `each` bytes. */
static wh_code fit_workers(run *r, const char *what, size_t each, wh_exec *ex)
{
	const size_t fits = budget(r) / each;
	if (fits == 0)
		return too_small(r, what, each);
	*ex = r->exec;
	if ((size_t)ex->workers > fits)
		ex->workers = (int)fits;
	return WH_OK;
}

/* ---- targets ------------------------------------------------------------------------------ */

static uint64_t loosest_limit(uint64_t count, double share, uint64_t of)
{
	uint64_t limit = count;
	if (share > 0) {
		const double exact = share * (double)of;
		const uint64_t by_share = exact < 1 ? 1 : (uint64_t)(exact + 0.5);
		limit = limit == 0 || by_share > limit ? by_share : limit;
	}
	return limit;
}

/* Several limits: the first reached stops, so of two counts the larger one holds. */
static void work_out_targets(run *r)
{
	const wh_reduce_params *p = r->params;
	r->report->target_faces = loosest_limit(p->faces, p->face_ratio, r->report->input_faces);
	r->report->target_vertices =
	    loosest_limit(p->vertices, p->vertex_ratio, r->report->input_vertices);
}

static double larger_of(double a, double b)
{
	return a > b ? a : b;
}

/* Share of `faces` that the targets ask to keep; 0 when no count limits it. */
static double wanted_share(const run *r)
{
	const wh_reduce_report *t = r->report;
	double share = 0;
	if (t->target_faces)
		share = (double)t->target_faces / (double)r->faces;
	if (t->target_vertices) {
		const double as_faces =
		    (double)t->target_vertices * (double)t->input_faces / (double)t->input_vertices;
		share = larger_of(share, as_faces / (double)r->faces);
	}
	return share;
}

static bool nothing_to_do(const run *r)
{
	const wh_reduce_report *t = r->report;
	return (t->target_faces && t->target_faces >= t->input_faces) ||
	       (t->target_vertices && t->target_vertices >= t->input_vertices);
}

/* Vertices that are left: each collapse takes one. */
static uint64_t vertices_now(const run *r)
{
	return r->report->input_vertices - r->report->unreferenced_vertices - r->work.collapses;
}

static wh_ply_style style(const run *r)
{
	return (wh_ply_style){.ascii = r->params->ascii, .is_double = r->input.source.is_double};
}

static wh_simplify_params engine_params(const run *r)
{
	return (wh_simplify_params){.max_cost = INFINITY,
	                            .max_err = r->max_err * r->ingest.scale,
	                            .lock_boundary = r->params->lock_boundary,
	                            .float_positions = !r->input.source.is_double,
	                            .step = r->ingest.step};
}

/* ---- stages ------------------------------------------------------------------------------- */

/* The folder of the output: where temporary files go when nothing else is said. */
static wh_code open_spill(run *r)
{
	char *folder = wh_strdup(r->c, r->params->output);
	if (!folder)
		return r->c->err.code;
	char *slash = strrchr(folder, '/');
	const char *place = ".";
	if (slash) {
		slash[slash == folder ? 1 : 0] = '\0';
		place = folder;
	}
	struct stat st;
	/* beside a device or a pipe nobody wants temporary files */
	if (stat(r->params->output, &st) == 0 && !S_ISREG(st.st_mode))
		place = ".";
	const wh_code code = wh_spill_open(r->c, &r->spill, r->params->temp_dir, place);
	wh_free(r->c, folder);
	return code;
}

static wh_code open_input(run *r, bool rewrite)
{
	if (r->input_open)
		wh_input_close(r->c, &r->spill, &r->input);
	r->input_open = false;
	wh_progress_phase(&r->progress, "open", 1);
	wh_exec ex = r->exec;
	if ((size_t)ex.workers > budget(r) / WH_PLAN_REWRITE)
		ex.workers = budget(r) < WH_PLAN_REWRITE ? 1 : (int)(budget(r) / WH_PLAN_REWRITE);
	if (wh_input_open(r->c, &ex, &r->spill, r->params->input, rewrite, &r->input) != WH_OK)
		return r->c->err.code;
	r->input_open = true;
	wh_reduce_report *t = r->report;
	t->input_bytes = r->input.ply.size;
	t->input_vertices = r->input.source.nv;
	t->input_faces = r->input.source.nf;
	t->polygons = r->input.polygons;
	t->degenerate_faces = r->input.degenerate;
	r->faces = t->input_faces;
	work_out_targets(r);
	return WH_OK;
}

/* Appends a name to the list of what is dropped; a list too long ends in "...". */
static void note_dropped(wh_reduce_report *t, const char *name)
{
	const size_t used = strlen(t->dropped), room = sizeof t->dropped - used;
	if (strlen(name) + sizeof ", ..." < room)
		(void)snprintf(t->dropped + used, room, "%s%s", used ? ", " : "", name);
	else if (used < 3 || strcmp(t->dropped + used - 3, "...") != 0)
		(void)snprintf(t->dropped + used, room, ", ...");
}

/* Positions and triangles are carried over; everything else the file holds is named. */
static void list_dropped(run *r)
{
	const wh_ply *p = &r->input.ply;
	for (size_t i = 0; i < p->nelems; i++) {
		const wh_ply_elem *e = &p->elems[i];
		const bool vertex = (int)i == p->vertex, face = (int)i == p->face;
		if (!vertex && !face && (int)i != p->strips)
			note_dropped(r->report, e->name);
		for (int k = 0; (vertex || face) && k < (int)e->nprops; k++)
			if (vertex ? k != p->x && k != p->y && k != p->z : k != p->corners)
				note_dropped(r->report, e->props[k].name);
	}
}

static wh_plan make_plan(const run *r)
{
	const wh_plan_query q = {.source = r->input.source,
	                         .rewrite_bytes = wh_input_temp_bytes(&r->input),
	                         .sizes = r->sizes,
	                         .share = wanted_share(r),
	                         .memory = r->memory,
	                         .threads = r->exec.workers};
	wh_plan p;
	wh_plan_make(&q, &p);
	return p;
}

/* Before the work begins: a ceiling that will not do is refused with one that will. */
static wh_code refuse_early(run *r)
{
	r->plan = make_plan(r);
	for (int i = 0; i < WH_PLAN_STAGES; i++)
		if (r->plan.stage[i].need > budget(r))
			return too_small(r, wh_plan_stage_name((wh_plan_stage)i), 0);
	return WH_OK;
}

static wh_code ingest_once(run *r)
{
	wh_exec ex = r->exec;
	if (refuse_early(r) != WH_OK)
		return r->c->err.code;
	wh_ingest_params p = {.clusters = r->plan.clusters};
	(void)wh_ingest_fit(&r->input.source, budget(r), &ex, &p);
	r->store = (wh_store){.spill = &r->spill, .generation = r->generations++};
	return wh_ingest(r->c, &ex, &r->progress, &r->input.source, &p, &r->store, &r->ingest);
}

static void count_input_reads(run *r)
{
	const wh_source *s = &r->input.source;
	r->report->bytes_read += 3 * s->nv * s->vstride + r->ingest.face_reads * s->fstride;
}

static wh_code ingest(run *r)
{
	wh_code code = ingest_once(r);
	if (code == WH_E_IRREGULAR) { /* faces that are not triangles behind a triangle's size */
		if (open_input(r, true) != WH_OK)
			return r->c->err.code;
		code = ingest_once(r);
	}
	if (code == WH_OK)
		code = wh_ply_unchanged(r->c, &r->input.ply);
	if (code != WH_OK)
		return code;
	count_input_reads(r);
	wh_input_drop_temp(&r->spill, &r->input);
	wh_reduce_report *t = r->report;
	r->faces = r->ingest.faces;
	t->degenerate_faces += r->ingest.degenerate;
	t->cut_vertices = r->ingest.cut_vertices;
	t->clusters = r->store.clusters;
	t->windows = r->ingest.windows;
	const double scale = r->ingest.scale;
	t->diagonal = wh_norm(wh_sub(wh_scale(r->ingest.hi, scale), wh_scale(r->ingest.lo, scale)));
	t->diagonal /= scale;
	if (r->faces == 0)
		return wh_fail(r->c, WH_E_INPUT,
		               "%s: all %llu faces are degenerate: nothing to reduce",
		               r->params->input, (unsigned long long)t->input_faces);
	r->max_err = INFINITY;
	if (r->params->error > 0)
		r->max_err = r->params->error;
	if (r->params->error_share > 0)
		r->max_err = fmin(r->max_err, r->params->error_share * t->diagonal);
	return WH_OK;
}

/* Workers for stages that hold one cluster each. */
static wh_code cluster_workers(run *r, wh_exec *ex)
{
	uint64_t max_v, max_f, faces, vertices;
	if (wh_round_extent(r->c, &r->store, &max_v, &max_f, &faces, &vertices) != WH_OK)
		return r->c->err.code;
	const size_t load = wh_store_scratch_bytes(&r->store, max_v, max_f);
	return fit_workers(r, "a cluster", load + wh_cluster_bytes(max_v, max_f), ex);
}

/* The cost limits of a round that is to keep this share of the faces. */
static wh_code survey(run *r, const wh_exec *ex, double keep, wh_cluster_params *p)
{
	phase_begin(r);
	wh_survey s = {.log = wh_calloc(r->c, 1, sizeof *s.log)};
	wh_code code = r->c->err.code;
	if (code == WH_OK)
		code = wh_round_survey(r->c, ex, &r->progress, &r->store, WH_PLAN_SURVEY_FACES,
		                       &p->all, &s);
	if (code == WH_OK) {
		p->all.max_cost = wh_survey_cost(&s, keep);
		p->micro_cost = wh_survey_cost(&s, wh_plan_keep_micro(&r->sizes, keep));
	}
	wh_free(r->c, s.log);
	return phase_end(r, WH_PHASE_SURVEY, code);
}

/* Only the files that ingest wrote hold vertices of no face. */
static void note_unreferenced(run *r, uint64_t n)
{
	if (n)
		r->report->unreferenced_vertices = n;
}

/* Decimates all clusters down to the shared cost limit. A limit that turns out to take too much
 * is lowered, and the round done again. Where that does not help either, as too many collapses
 * cost nothing at all, the mesh is left as it was. */
static wh_code decimate(run *r, const wh_exec *ex, wh_cluster_params *p, double share)
{
	wh_store next = {.spill = &r->spill};
	wh_round_result done;
	const uint64_t least = (uint64_t)(1.02 * share * (double)r->faces);
	uint64_t last = 0;
	for (int lowered = 0;; lowered++) {
		next.generation = r->generations++;
		phase_begin(r);
		const wh_code code =
		    wh_round_reduce(r->c, ex, &r->progress, &r->store, &next, p, &done);
		if (phase_end(r, WH_PHASE_DECIMATE, code) != WH_OK)
			return code;
		note_unreferenced(r, done.unreferenced);
		if (done.faces > least || !isfinite(p->all.max_cost))
			break;
		wh_round_remove(&next);
		if (lowered == MOST_LOWERINGS || done.faces == last)
			return WH_OK;
		last = done.faces;
		p->all.max_cost /= 8;
		p->micro_cost /= 8;
	}
	wh_round_remove(&r->store);
	r->store = next;
	r->faces = done.faces;
	r->report->rounds++;
	wh_simplify_result_add(&r->work, &done.work);
	return WH_OK;
}

/* Cuts anew; `free_all`: so that no vertex is on a cut that always was. */
static wh_code recut(run *r, bool free_all)
{
	wh_recut_params p = {.skew = wh_plan_skew(++r->recuts), .free_all = free_all};
	wh_store next = {.spill = &r->spill, .generation = r->generations++};
	next.clusters = wh_plan_clusters(&r->sizes, r->faces);
	wh_exec ex = r->exec;
	size_t need;
	if (wh_round_recut_fit(r->c, &r->store, next.clusters, budget(r), &ex, &p.buffer, &need) !=
	    WH_OK)
		return r->c->err.code;
	if (need > budget(r))
		return too_small(r, "cutting anew", need);
	phase_begin(r);
	const wh_code code = wh_round_recut(r->c, &ex, &r->progress, &r->store, &next, &p,
	                                    &r->report->never_free_vertices);
	if (phase_end(r, WH_PHASE_RECUT, code) != WH_OK)
		return code;
	wh_round_remove(&r->store);
	r->store = next;
	return WH_OK;
}

/* Decimates all clusters so that a share of the faces is left, or to the error limit. */
static wh_code one_round(run *r, double keep)
{
	const double share = wanted_share(r);
	wh_cluster_params params = {.micro_faces = (uint32_t)r->params->micro_faces,
	                            .micro_cost = INFINITY,
	                            .all = engine_params(r)};
	wh_exec ex;
	if (cluster_workers(r, &ex) != WH_OK ||
	    (share > 0 && survey(r, &ex, keep, &params) != WH_OK))
		return r->c->err.code;
	return decimate(r, &ex, &params, share);
}

/* Rounds, until the mesh fits the final pass or a round no longer helps. */
static wh_code rounds(run *r)
{
	const uint64_t micro = r->params->micro_faces;
	if (r->store.clusters == 1 && (micro == 0 || r->faces <= 2 * micro))
		return WH_OK;
	for (bool on = wh_plan_round_pays(wanted_share(r)); on;) {
		const uint32_t clusters = r->store.clusters;
		const uint64_t before = r->faces;
		if (r->report->rounds > 0 && recut(r, false) != WH_OK)
			return r->c->err.code;
		if (one_round(r, wh_plan_keep(&r->sizes, r->faces, wanted_share(r))) != WH_OK)
			return r->c->err.code;
		on = wh_plan_go_on(&r->sizes, clusters, before, r->faces, wanted_share(r));
	}
	return WH_OK;
}

/* ---- a result that is streamed ------------------------------------------------------------- */

/* Faces and vertices that are too many for the targets; 0 where there is no such target. */
static wh_settle_params to_give_up(const run *r)
{
	const wh_reduce_report *t = r->report;
	const uint64_t vertices = vertices_now(r);
	return (wh_settle_params){.faces = t->target_faces ? r->faces - t->target_faces : 0,
	                          .vertices =
	                              t->target_vertices ? vertices - t->target_vertices : 0,
	                          .all = engine_params(r)};
}

static bool is_reached(const run *r)
{
	const wh_reduce_report *t = r->report;
	return (t->target_faces && r->faces <= t->target_faces) ||
	       (t->target_vertices && vertices_now(r) <= t->target_vertices);
}

/* Costs that a trial may go to, one after the other while the one before was not enough. */
static wh_code trial_costs(run *r, const wh_exec *ex, double cost[3])
{
	wh_cluster_params p = {.all = engine_params(r)};
	if (survey(r, ex, TRIAL_MARGIN * wanted_share(r), &p) != WH_OK)
		return r->c->err.code;
	cost[0] = p.all.max_cost;
	cost[1] = TRIAL_RAISE * p.all.max_cost;
	cost[2] = INFINITY;
	return WH_OK;
}

/* A round that ends at the exact count, or as near to it as its clusters can come. */
static wh_code settle_once(run *r)
{
	wh_exec ex;
	double cost[3];
	wh_settle_result done = {0};
	wh_store next = {.spill = &r->spill, .generation = r->generations++};
	wh_settle_params p = to_give_up(r);
	if (cluster_workers(r, &ex) != WH_OK || trial_costs(r, &ex, cost) != WH_OK)
		return r->c->err.code;
	phase_begin(r);
	wh_code code = WH_OK;
	for (int i = 0; code == WH_OK && i < 3 && !done.reached; i++) {
		p.all.max_cost = cost[i];
		code = wh_settle(r->c, &ex, &r->progress, &r->store, &next, &p, i == 2, &done);
	}
	if (phase_end(r, WH_PHASE_SETTLE, code) != WH_OK)
		return code;
	wh_round_remove(&r->store);
	r->store = next;
	r->faces = done.round.faces;
	note_unreferenced(r, done.round.unreferenced);
	r->report->one_less = done.one_less;
	r->report->rounds++;
	wh_simplify_result_add(&r->work, &done.round.work);
	return WH_OK;
}

/* Another round to the error limit, which is all that there is to hold. */
static wh_code exhaust_once(run *r)
{
	return one_round(r, 1);
}

/* Rounds over cut after cut until the count is exact, or no round helps, and no vertex is left
 * that was on every cut. */
static wh_code settle(run *r)
{
	const bool counted = wanted_share(r) > 0;
	for (int i = 0; i < MOST_SETTLINGS; i++) {
		const bool near = r->recuts >= ROUNDS_BEFORE_SETTLING - 1;
		if ((i > 0 || r->report->rounds > 0) && recut(r, near) != WH_OK)
			return r->c->err.code;
		const uint64_t before = r->faces;
		const bool last = near && (r->report->never_free_vertices == 0 || i >= PATIENCE);
		wh_code code;
		if (!counted)
			code = exhaust_once(r);
		else if (last)
			code = is_reached(r) ? WH_OK : settle_once(r);
		else
			code = one_round(r, wh_plan_keep_near(wanted_share(r)));
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

static void note_check(run *r, const wh_check *found)
{
	wh_reduce_report *t = r->report;
	t->boundary_edges = found->boundary_edges;
	t->nonmanifold_edges = found->nonmanifold_edges;
	t->components = found->components;
	t->boundary_loops = found->boundary_loops;
	t->euler = found->euler;
}

static wh_code check_store(run *r)
{
	uint64_t max_v, max_f, faces, vertices;
	wh_check found;
	wh_exec ex;
	if (wh_round_extent(r->c, &r->store, &max_v, &max_f, &faces, &vertices) != WH_OK ||
	    fit_workers(r, "checking a cluster", wh_inspect_bytes(&r->store, max_v, max_f), &ex) !=
	        WH_OK)
		return r->c->err.code;
	phase_begin(r);
	const wh_code code = wh_inspect_store(r->c, &ex, &r->progress, &r->store, &found);
	if (code == WH_OK)
		note_check(r, &found);
	return phase_end(r, WH_PHASE_CHECK, code);
}

static wh_code commit(run *r, wh_outfile **out)
{
	r->report->output_bytes = wh_outfile_bytes(*out);
	wh_outfile_checksum(*out, r->report->checksum);
	return wh_outfile_commit(r->c, out);
}

static wh_code emit(run *r, wh_outfile **out)
{
	uint64_t max_v, max_f, faces, vertices;
	wh_exec ex;
	wh_reduce_report *t = r->report;
	if (wh_round_extent(r->c, &r->store, &max_v, &max_f, &faces, &vertices) != WH_OK ||
	    fit_workers(r, "writing a cluster", wh_emit_bytes(max_v, max_f), &ex) != WH_OK)
		return r->c->err.code;
	t->output_vertices = vertices_now(r);
	t->output_faces = r->faces;
	phase_begin(r);
	wh_code code = wh_emit(r->c, &ex, &r->progress, &r->store, *out, style(r), r->ingest.scale,
	                       t->output_vertices, t->output_faces);
	if (code == WH_OK)
		code = commit(r, out);
	return phase_end(r, WH_PHASE_WRITE, code);
}

/* ---- a result that fits one last pass ------------------------------------------------------ */

static wh_code stitch(run *r)
{
	uint64_t max_v, max_f, faces, vertices;
	if (wh_round_extent(r->c, &r->store, &max_v, &max_f, &faces, &vertices) != WH_OK)
		return r->c->err.code;
	const size_t load =
	    wh_store_scratch_bytes(&r->store, max_v, max_f) + wh_patch_bytes(max_v, max_f);
	const size_t need = load + wh_finish_bytes(vertices, faces);
	if (need > budget(r))
		return too_small(r, "the final pass", need);
	uint64_t unreferenced;
	phase_begin(r);
	const wh_code code =
	    wh_finish_stitch(r->c, &r->store, &r->progress, &r->patch, &unreferenced);
	note_unreferenced(r, unreferenced);
	r->report->never_free_vertices = 0; /* no vertex is on a cut now */
	if (code == WH_OK)
		wh_round_remove(&r->store);
	return phase_end(r, WH_PHASE_STITCH, code);
}

static uint32_t no_more_than(uint64_t count, uint32_t most)
{
	return count < most ? (uint32_t)count : most;
}

static wh_code final_pass(run *r)
{
	wh_reduce_report *t = r->report;
	wh_simplify_params p = engine_params(r);
	p.target_faces = no_more_than(t->target_faces, r->patch.nf);
	p.target_vertices = no_more_than(t->target_vertices, r->patch.nv);
	p.insist = true;
	phase_begin(r);
	wh_progress_phase(&r->progress, "final pass", r->patch.nf);
	wh_simplify_result done = {0};
	wh_simplify_work *w = wh_simplify_work_new(r->c);
	wh_code code = w ? WH_OK : r->c->err.code;
	if (code == WH_OK)
		code = wh_simplify(r->c, w, &r->patch, &p, &done);
	wh_simplify_work_free(r->c, w);
	if (code == WH_OK) {
		wh_simplify_result_add(&r->work, &done);
		t->nonmanifold_kept = done.fixed;
		t->exhausted = done.exhausted && (t->target_faces || t->target_vertices) &&
		               !isfinite(r->max_err);
		t->one_less = t->target_faces && !t->target_vertices &&
		              (uint64_t)r->patch.nf + 1 == t->target_faces;
	}
	return phase_end(r, WH_PHASE_FINAL, code);
}

static wh_code check(run *r)
{
	const wh_mesh m = {
	    .nv = r->patch.nv, .nf = r->patch.nf, .pos = r->patch.pos, .tri = r->patch.tri};
	wh_check found;
	phase_begin(r);
	wh_progress_phase(&r->progress, "check", m.nf);
	if (phase_end(r, WH_PHASE_CHECK, wh_check_mesh(r->c, &m, &found)) != WH_OK)
		return r->c->err.code;
	note_check(r, &found);
	return WH_OK;
}

static wh_code write_result(run *r, wh_outfile **out)
{
	phase_begin(r);
	wh_progress_phase(&r->progress, "order", r->patch.nv);
	wh_code code = wh_patch_order(r->c, &r->patch);
	if (code == WH_OK)
		code =
		    wh_finish_write(r->c, &r->progress, *out, style(r), &r->patch, r->ingest.scale);
	r->report->output_vertices = r->patch.nv;
	r->report->output_faces = r->patch.nf;
	if (code == WH_OK)
		code = commit(r, out);
	return phase_end(r, WH_PHASE_WRITE, code);
}

/* The target is no smaller than the input: its bytes are the result. */
static wh_code copy_input(run *r, wh_outfile **out)
{
	enum { COPY = 1 << 20 };
	wh_reduce_report *t = r->report;
	t->unchanged = true;
	t->output_vertices = t->input_vertices;
	t->output_faces = t->input_faces;
	uint8_t *buf = wh_alloc(r->c, COPY, 1);
	phase_begin(r);
	wh_code code = r->c->err.code;
	for (uint64_t at = 0; code == WH_OK && at < t->input_bytes; at += COPY) {
		const uint64_t left = t->input_bytes - at;
		const size_t n = left < COPY ? (size_t)left : COPY;
		code = wh_poll(r->c);
		if (code == WH_OK)
			code = wh_ply_pread(r->c, r->params->input, r->input.ply.fd, buf, n, at);
		if (code == WH_OK)
			code = wh_outfile_write(r->c, *out, buf, n);
	}
	wh_free(r->c, buf);
	if (code == WH_OK)
		code = wh_ply_unchanged(r->c, &r->input.ply);
	if (code == WH_OK)
		code = commit(r, out);
	return phase_end(r, WH_PHASE_WRITE, code);
}

static wh_code all_stages(run *r, wh_outfile **out)
{
	if (wh_outfile_open(r->c, out, r->params->output, r->params->force) != WH_OK ||
	    open_spill(r) != WH_OK)
		return r->c->err.code;
	phase_begin(r);
	if (phase_end(r, WH_PHASE_OPEN, open_input(r, false)) != WH_OK)
		return r->c->err.code;
	if (nothing_to_do(r) && !(r->params->ascii && r->input.ply.format != WH_PLY_ASCII))
		return copy_input(r, out);
	list_dropped(r);
	phase_begin(r);
	if (phase_end(r, WH_PHASE_INGEST, ingest(r)) != WH_OK || rounds(r) != WH_OK)
		return r->c->err.code;
	if (wh_plan_streams(&r->sizes, r->store.clusters, r->faces)) {
		if (settle(r) != WH_OK || check_store(r) != WH_OK || emit(r, out) != WH_OK)
			return r->c->err.code;
		return WH_OK;
	}
	if (stitch(r) != WH_OK || final_pass(r) != WH_OK || check(r) != WH_OK ||
	    write_result(r, out) != WH_OK)
		return r->c->err.code;
	return WH_OK;
}

/* What an unfinished target means to the caller; the mesh is written already. */
static wh_code verdict(run *r)
{
	const wh_reduce_report *t = r->report;
	if (!t->exhausted)
		return WH_OK;
	return wh_fail(
	    r->c, WH_E_TARGET,
	    "%s: stopped at %llu faces, more than asked for: every further collapse would "
	    "change the topology or turn faces over%s%s; this best mesh was written",
	    r->params->output, (unsigned long long)t->output_faces,
	    r->params->lock_boundary ? ", or move the locked boundary" : "",
	    t->nonmanifold_kept ? ", or move non-manifold vertices, which are kept" : "");
}

static wh_code sensible(wh_ctx *c, const wh_reduce_params *p)
{
	if (!p->faces && !(p->face_ratio > 0) && !p->vertices && !(p->vertex_ratio > 0) &&
	    !(p->error > 0) && !(p->error_share > 0))
		return wh_fail(c, WH_E_USAGE,
		               "no target: give --faces, --vertices, --ratio or --error");
	if (p->face_ratio > 1 || p->vertex_ratio > 1)
		return wh_fail(c, WH_E_USAGE, "a share of what there is cannot be above 1");
	if (p->threads < 0 || p->cluster_faces > MOST_SIZE || p->micro_faces > MOST_SIZE)
		return wh_fail(c, WH_E_USAGE,
		               "threads, cluster or micro-cluster size out of range");
	return WH_OK;
}

wh_code wh_reduce(wh_ctx *c, const wh_reduce_params *params, wh_reduce_report *report)
{
	*report = (wh_reduce_report){0};
	c->err = (wh_error){0};
	if (sensible(c, params) != WH_OK)
		return c->err.code;
	const double start = wh_seconds();
	run r = {.c = c,
	         .params = params,
	         .report = report,
	         .progress = {.fn = params->progress,
	                      .user = params->progress_user,
	                      .telling = ATOMIC_FLAG_INIT},
	         .exec = {.workers = wh_exec_threads(params->threads)},
	         .memory = params->memory ? params->memory : wh_topo_memory() / 2,
	         .sizes = sizes_of(params)};
	const size_t old_limit = c->mem->limit;
	c->mem->limit = r.memory > OPEN_BYTES ? r.memory - WH_PLAN_BASE / 2 : OPEN_BYTES;
	wh_outfile *out = NULL;
	wh_code code = all_stages(&r, &out);
	wh_outfile_abort(c, &out);
	const double unit = r.ingest.scale > 0 ? 1 / r.ingest.scale : 1;
	report->cost_distance = r.work.cost_distance * unit;
	report->accumulated_error = r.work.highest_err * unit;
	report->threads = r.exec.workers;
	report->memory_ceiling = r.memory;
	report->memory_peak = atomic_load(&c->mem->peak);
	report->temp_bytes_peak = atomic_load(&r.spill.peak);
	report->bytes_read += atomic_load(&r.spill.bytes_read);
	report->bytes_written = atomic_load(&r.spill.bytes_written) + report->output_bytes;
	wh_patch_free(c, &r.patch);
	if (r.input_open)
		wh_input_close(c, &r.spill, &r.input);
	wh_spill_close(c, &r.spill);
	c->mem->limit = old_limit;
	report->seconds_total = wh_seconds() - start;
	return code == WH_OK ? verdict(&r) : code;
}

/* ---- the plan ----------------------------------------------------------------------------- */

/* Opens the input for a look: where its body has to be rewritten, only the counts are known. */
static wh_code look_at_input(run *r, wh_plan_report *report)
{
	wh_ply *ply = &r->input.ply;
	wh_source *src = &r->input.source;
	if (wh_input_look(r->c, r->params->input, &r->input) != WH_OK)
		return r->c->err.code;
	r->input_open = true;
	report->rewritten = src->ffd != ply->fd;
	report->input_bytes = ply->size;
	r->report->input_vertices = report->input_vertices = src->nv;
	r->report->input_faces = report->input_faces = src->nf;
	r->faces = src->nf;
	work_out_targets(r);
	return WH_OK;
}

static void fill_plan(const run *r, wh_plan_report *report)
{
	report->target_faces = r->report->target_faces;
	report->target_vertices = r->report->target_vertices;
	report->unchanged = nothing_to_do(r);
	report->threads = r->exec.workers;
	report->memory_ceiling = r->memory;
	report->clusters = r->plan.clusters;
	report->windows = r->plan.windows;
	report->rounds = r->plan.rounds;
	report->passes = r->plan.passes;
	report->streamed = r->plan.streams;
	report->memory_least = r->plan.least;
	report->peak_rss = r->plan.peak_ram;
	report->temp_bytes_peak = r->plan.peak_disk;
}

wh_code wh_plan_reduce(wh_ctx *c, const wh_reduce_params *params, wh_plan_report *report)
{
	*report = (wh_plan_report){0};
	c->err = (wh_error){0};
	if (sensible(c, params) != WH_OK)
		return c->err.code;
	wh_reduce_report counts = {0};
	run r = {.c = c,
	         .params = params,
	         .report = &counts,
	         .exec = {.workers = wh_exec_threads(params->threads)},
	         .memory = params->memory ? params->memory : wh_topo_memory() / 2,
	         .sizes = sizes_of(params)};
	wh_code code = look_at_input(&r, report);
	if (code == WH_OK) {
		code = refuse_early(&r);
		fill_plan(&r, report);
	}
	if (r.input_open)
		wh_input_close(c, &r.spill, &r.input);
	return code;
}
