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
#include "pipeline/finish.h"
#include "pipeline/ingest.h"
#include "pipeline/normalise.h"
#include "pipeline/round.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

/* A round leaves this many times the target: what it leaves undone, the final pass does in the
 * right order; what it overdoes, nobody can undo. */
static const double ROUND_MARGIN = 1.25;
/* The vertices on cluster borders, which a round cannot move, add about this to what it leaves. */
static const double BORDER_MARGIN = 1.08;
/* A round takes away no more than this in one go: its survey would see too few survivors. */
static const double ROUND_KEEP_LEAST = 0.02;
/* Micro-clusters, smaller still, stop earlier. */
static const double MICRO_KEEP_LEAST = 0.125;
/* Above this share there is too little to do for a round to be worth its passes. */
static const double ROUND_KEEP_MOST = 0.85;
/* A round that leaves more than this is the last one. */
static const double ROUND_NO_PROGRESS = 0.9;
/* Share of the cells left of a cut when cutting anew; the first partition has 0.5. */
static const double RECUT_SKEW = 0.4;

enum {
	SURVEY_FACES = 16 * 1024,      /* a piece of a survey */
	BASE_BYTES = 12 * 1024 * 1024, /* program, libraries, stacks, small allocations */
	MOST_SIZE = 100 * 1000 * 1000,
	MOST_LOWERINGS = 12,              /* of a round's cost limit, by a factor of 8 each */
	REWRITE_BYTES = 20 * 1024 * 1024, /* a worker that rewrites text or polygons */
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
	uint32_t generations;
	wh_patch patch;
	double max_err;
	double phase_start;
	size_t memory;           /* ceiling */
	wh_simplify_result work; /* of all stages */
} run;

const char *wh_phase_name(wh_phase phase)
{
	static const char *const name[WH_PHASES] = {
	    "open", "ingest", "survey", "decimate", "recut", "stitch", "final", "check", "write"};
	return name[phase];
}

wh_reduce_params wh_reduce_defaults(void)
{
	return (wh_reduce_params){
	    .cluster_faces = 256ULL * 1024, .micro_faces = 16ULL * 1024, .final_faces = 1000000};
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
	return r->memory > BASE_BYTES ? r->memory - BASE_BYTES : 0;
}

static wh_code too_small(run *r, const char *what, size_t need)
{
	const size_t mib = ((need + BASE_BYTES) >> 20) + 2;
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

static wh_simplify_params engine_params(const run *r)
{
	return (wh_simplify_params){.max_cost = INFINITY,
	                            .max_err = r->max_err,
	                            .lock_boundary = r->params->lock_boundary,
	                            .float_positions = !r->input.source.is_double};
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
	if ((size_t)ex.workers > budget(r) / REWRITE_BYTES)
		ex.workers = budget(r) < REWRITE_BYTES ? 1 : (int)(budget(r) / REWRITE_BYTES);
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

static uint32_t cluster_count(uint64_t faces, uint64_t cluster_faces)
{
	if (cluster_faces == 0)
		return 1;
	const uint64_t n = (faces + cluster_faces / 2) / cluster_faces;
	return n < 1 ? 1 : n > WH_MAX_CLUSTERS ? WH_MAX_CLUSTERS : (uint32_t)n;
}

/* How much of the budget ingest takes, and how. */
static size_t fit_ingest(const run *r, wh_exec *ex, wh_ingest_params *p)
{
	*ex = r->exec;
	*p = (wh_ingest_params){.clusters =
	                            cluster_count(r->input.source.nf, r->params->cluster_faces)};
	return wh_ingest_fit(&r->input.source, budget(r), ex, p);
}

/* What the last pass will take, 0 when no count tells. It starts from a little more than the
 * target: what a round leaves, and the borders of its clusters. */
static size_t last_pass_bytes(const run *r)
{
	const double all = (double)r->faces, share = wanted_share(r);
	if (!(share > 0))
		return 0;
	const bool no_rounds = ROUND_MARGIN * share > ROUND_KEEP_MOST;
	const double last = no_rounds ? all : fmin(all, BORDER_MARGIN * ROUND_MARGIN * share * all);
	return wh_finish_bytes((uint64_t)(last / 2), (uint64_t)last);
}

/* What the largest cluster is likely to take. */
static size_t cluster_bytes(const run *r)
{
	const double all = (double)r->faces, each = (double)r->params->cluster_faces;
	const uint64_t nf = (uint64_t)(each > 0 ? fmin(1.3 * each, all) : all), nv = nf / 5 * 3;
	return (size_t)nf * 12 + (size_t)nv * 40 + wh_cluster_bytes(nv, nf);
}

/* Refuses for want of `need` bytes before the work begins, with a size that does for all of it. */
static wh_code refuse_early(run *r, const char *what, size_t need)
{
	wh_exec ex;
	wh_ingest_params p;
	const size_t stage[] = {fit_ingest(r, &ex, &p), cluster_bytes(r), last_pass_bytes(r)};
	for (size_t i = 0; i < sizeof stage / sizeof *stage; i++)
		need = need > stage[i] ? need : stage[i];
	return too_small(r, what, need);
}

static wh_code ingest_once(run *r)
{
	wh_exec ex;
	wh_ingest_params p;
	const size_t need = fit_ingest(r, &ex, &p);
	if (need > budget(r))
		return refuse_early(r, "reading the input", need);
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
	if (code != WH_OK)
		return code;
	count_input_reads(r);
	wh_reduce_report *t = r->report;
	r->faces = r->ingest.faces;
	t->degenerate_faces += r->ingest.degenerate;
	t->cut_vertices = r->ingest.cut_vertices;
	t->clusters = r->store.clusters;
	t->windows = r->ingest.windows;
	t->diagonal = wh_norm(wh_sub(r->ingest.hi, r->ingest.lo));
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
	wh_survey s = {.histogram = wh_calloc(r->c, WH_HIST_BINS, sizeof *s.histogram)};
	wh_code code = r->c->err.code;
	if (code == WH_OK)
		code =
		    wh_round_survey(r->c, ex, &r->progress, &r->store, SURVEY_FACES, &p->all, &s);
	if (code == WH_OK) {
		p->all.max_cost = wh_survey_cost(&s, keep);
		p->micro_cost = wh_survey_cost(&s, larger_of(keep, MICRO_KEEP_LEAST));
	}
	wh_free(r->c, s.histogram);
	return phase_end(r, WH_PHASE_SURVEY, code);
}

/* Decimates all clusters down to the shared cost limit. A limit that turns out to take too much
 * is lowered, and the round done again. Where that does not help either, as too many collapses
 * cost nothing at all, the mesh is left as it was. */
static wh_code decimate(run *r, const wh_exec *ex, wh_cluster_params *p, double share)
{
	wh_store next = {.spill = &r->spill};
	wh_round_result done;
	const uint64_t least = (uint64_t)(1.02 * share * (double)r->faces);
	for (int lowered = 0;; lowered++) {
		next.generation = r->generations++;
		phase_begin(r);
		const wh_code code =
		    wh_round_reduce(r->c, ex, &r->progress, &r->store, &next, p, &done);
		if (phase_end(r, WH_PHASE_DECIMATE, code) != WH_OK)
			return code;
		if (done.faces > least || !isfinite(p->all.max_cost))
			break;
		wh_round_remove(&next);
		if (lowered == MOST_LOWERINGS)
			return WH_OK;
		p->all.max_cost /= 8;
		p->micro_cost /= 8;
	}
	wh_round_remove(&r->store);
	r->store = next;
	r->faces = done.faces;
	r->report->unreferenced_vertices += done.unreferenced;
	r->report->rounds++;
	wh_simplify_result_add(&r->work, &done.work);
	return WH_OK;
}

static wh_code recut(run *r)
{
	wh_store next = {.spill = &r->spill, .generation = r->generations++};
	next.clusters = cluster_count(r->faces, r->params->cluster_faces);
	wh_exec ex = r->exec;
	size_t buffer, need;
	if (wh_round_recut_fit(r->c, &r->store, next.clusters, budget(r), &ex, &buffer, &need) !=
	    WH_OK)
		return r->c->err.code;
	if (need > budget(r))
		return too_small(r, "cutting anew", need);
	phase_begin(r);
	const wh_code code =
	    wh_round_recut(r->c, &ex, &r->progress, &r->store, &next, RECUT_SKEW, buffer);
	if (phase_end(r, WH_PHASE_RECUT, code) != WH_OK)
		return code;
	wh_round_remove(&r->store);
	r->store = next;
	return WH_OK;
}

/* Rounds, until the mesh fits the final pass or a round no longer helps. */
static wh_code rounds(run *r)
{
	const wh_reduce_params *p = r->params;
	if (r->store.clusters == 1 && (p->micro_faces == 0 || r->faces <= 2 * p->micro_faces))
		return WH_OK;
	for (;;) {
		const double share = wanted_share(r);
		const double keep = larger_of(ROUND_MARGIN * share, ROUND_KEEP_LEAST);
		if (share > 0 && keep > ROUND_KEEP_MOST)
			return WH_OK;
		wh_cluster_params params = {.micro_faces = (uint32_t)p->micro_faces,
		                            .micro_cost = INFINITY,
		                            .all = engine_params(r)};
		wh_exec ex;
		const uint64_t before = r->faces;
		if (cluster_workers(r, &ex) != WH_OK ||
		    (share > 0 && survey(r, &ex, keep, &params) != WH_OK) ||
		    decimate(r, &ex, &params, share) != WH_OK)
			return r->c->err.code;
		if (r->store.clusters == 1 || r->faces <= p->final_faces ||
		    (double)r->faces > ROUND_NO_PROGRESS * (double)before ||
		    ROUND_MARGIN * wanted_share(r) > ROUND_KEEP_MOST)
			return WH_OK;
		if (recut(r) != WH_OK)
			return r->c->err.code;
	}
}

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
	r->report->unreferenced_vertices += unreferenced;
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
	wh_reduce_report *t = r->report;
	const wh_mesh m = {
	    .nv = r->patch.nv, .nf = r->patch.nf, .pos = r->patch.pos, .tri = r->patch.tri};
	wh_check found;
	phase_begin(r);
	wh_progress_phase(&r->progress, "check", m.nf);
	if (phase_end(r, WH_PHASE_CHECK, wh_check_mesh(r->c, &m, &found)) != WH_OK)
		return r->c->err.code;
	t->boundary_edges = found.boundary_edges;
	t->nonmanifold_edges = found.nonmanifold_edges;
	t->components = found.components;
	t->boundary_loops = found.boundary_loops;
	t->euler = found.euler;
	return WH_OK;
}

static wh_code commit(run *r, wh_outfile **out)
{
	r->report->output_bytes = wh_outfile_bytes(*out);
	wh_outfile_checksum(*out, r->report->checksum);
	return wh_outfile_commit(r->c, out);
}

static wh_code write_result(run *r, wh_outfile **out)
{
	const wh_ply_style style = {.ascii = r->params->ascii,
	                            .is_double = r->input.source.is_double};
	phase_begin(r);
	wh_code code = wh_finish_order(r->c, &r->patch);
	if (code == WH_OK)
		code =
		    wh_finish_write(r->c, &r->progress, *out, style, &r->patch, r->ingest.origin);
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
	if (last_pass_bytes(r) > budget(r)) /* not after all the work */
		return refuse_early(r, "the final pass", 0);
	phase_begin(r);
	if (phase_end(r, WH_PHASE_INGEST, ingest(r)) != WH_OK || rounds(r) != WH_OK ||
	    stitch(r) != WH_OK || final_pass(r) != WH_OK || check(r) != WH_OK ||
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
	         .memory = params->memory ? params->memory : wh_topo_memory() / 2};
	const size_t old_limit = c->mem->limit;
	c->mem->limit = r.memory > OPEN_BYTES ? r.memory - BASE_BYTES / 2 : OPEN_BYTES;
	wh_outfile *out = NULL;
	wh_code code = all_stages(&r, &out);
	wh_outfile_abort(c, &out);
	report->cost_distance = r.work.cost_distance;
	report->accumulated_error = r.work.highest_err;
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
