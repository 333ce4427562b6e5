#include "pipeline/inspect.h"

#include "exec/topo.h"
#include "mesh/check_pieces.h"
#include "mesh/coincident.h"
#include "pipeline/clean.h"
#include "pipeline/duplicates.h"
#include "pipeline/ingest.h"
#include "pipeline/normalise.h"
#include "pipeline/round.h"

#include <math.h>

enum {
	BASE_BYTES = 12 * 1024 * 1024, /* program, libraries, stacks, small allocations */
	OPEN_BYTES = 32 * 1024 * 1024, /* enough to look at the input and to refuse it in words */
	REWRITE_BYTES = 20 * 1024 * 1024, /* a worker that rewrites text or polygons */
	LOADER_BYTES = 6 * 1024 * 1024,   /* a worker that loads */
	CUT_BYTES = 330,                  /* for a cut vertex, its faces and their other corners */
	FACE_BYTES = 125,                 /* of a cluster, generously */
	FACES_LEAST = 32 * 1024,
	FACES_MOST = 1024 * 1024 /* larger ones have shorter cuts but fit no cache */
};

typedef struct inspection {
	wh_ctx *c;
	const wh_inspect_params *params;
	const wh_exec *exec;
	size_t memory;
	wh_progress progress;
	wh_spill spill;
	wh_input input;
	bool input_open;
	wh_clean_result cleaned;
	wh_check *r;
} inspection;

/* ---- clusters of a store ------------------------------------------------------------------ */

/* What one worker needs. */
typedef struct workspace {
	wh_store_workspace load;
	wh_patch patch;
	wh_check_workspace *check;
} workspace;

typedef struct store_run {
	const wh_store *store;
	wh_progress *progress;
	workspace *workspace;
	uint64_t *order; /* of the clusters */
	wh_check_pieces *sum;
} store_run;

static wh_code look_job(wh_ctx *c, void *arg, int64_t index, int worker)
{
	const store_run *s = arg;
	workspace *ws = &s->workspace[worker];
	if (wh_store_load(c, s->store, (uint32_t)s->order[index], &ws->load, &ws->patch) != WH_OK)
		return c->err.code;
	return wh_check_look(c, ws->check, &ws->patch);
}

static wh_code look_commit(wh_ctx *c, void *arg, int64_t index, int worker)
{
	(void)index;
	store_run *s = arg;
	const workspace *ws = &s->workspace[worker];
	wh_progress_add(s->progress, ws->patch.nf);
	return wh_check_pieces_add(c, s->sum, ws->check);
}

/* With room for the largest cluster. */
static wh_code workspaces_make(wh_ctx *c, store_run *s, int workers, uint64_t max_v, uint64_t max_f)
{
	s->workspace = wh_calloc(c, (size_t)workers, sizeof *s->workspace);
	for (int i = 0; s->workspace && i < workers; i++) {
		workspace *ws = &s->workspace[i];
		ws->check = wh_check_workspace_new(c);
		ws->patch.attr_bytes = s->store->attr_bytes;
		ws->patch.face_bytes = s->store->face_bytes;
		if (!ws->check ||
		    wh_store_workspace_fit(c, s->store, &ws->load, max_v, max_f) != WH_OK ||
		    wh_patch_reset(c, &ws->patch, (uint32_t)max_v, (uint32_t)max_f) != WH_OK)
			break;
	}
	return c->err.code;
}

static void workspaces_free(wh_ctx *c, store_run *s, int workers)
{
	for (int i = 0; s->workspace && i < workers; i++) {
		wh_store_workspace_free(c, &s->workspace[i].load);
		wh_patch_free(c, &s->workspace[i].patch);
		wh_check_workspace_free(c, s->workspace[i].check);
	}
	wh_free(c, s->workspace);
	s->workspace = NULL;
}

wh_code wh_inspect_store(wh_ctx *c, const wh_exec *ex, wh_progress *progress, const wh_store *store,
                         wh_check *r)
{
	store_run s = {.store = store, .progress = progress};
	uint64_t max_v, max_f, faces, vertices;
	wh_code code = wh_round_extent(c, store, &max_v, &max_f, &faces, &vertices);
	if (code != WH_OK)
		return code;
	wh_progress_phase(progress, "check", faces);
	s.sum = wh_check_pieces_new(c);
	s.order = wh_round_longest_first(c, store);
	code = workspaces_make(c, &s, ex->workers, max_v, max_f);
	if (code == WH_OK)
		code = wh_exec_gather(c, ex, store->clusters, look_job, look_commit, &s);
	workspaces_free(c, &s, ex->workers); /* before the rim is counted */
	wh_free(c, s.order);
	if (code == WH_OK)
		code = wh_check_pieces_end(c, s.sum, r);
	wh_check_pieces_free(c, s.sum);
	return code;
}

size_t wh_inspect_bytes(const wh_store *store, uint64_t nv, uint64_t nf)
{
	return wh_store_workspace_bytes(store, nv, nf) +
	       wh_patch_bytes(nv, nf, store->attr_bytes, store->face_bytes) +
	       wh_check_piece_bytes(nv, nf);
}

/* ---- budget ------------------------------------------------------------------------------- */

static size_t budget(const inspection *n)
{
	return n->memory > BASE_BYTES ? n->memory - BASE_BYTES : 0;
}

static wh_code too_small(const inspection *n, const char *what, size_t need)
{
	return wh_fail(n->c, WH_E_PLAN,
	               "%s needs more memory than the ceiling of %zu MiB: use --memory %zuM", what,
	               n->memory >> 20, ((need + BASE_BYTES) >> 20) + 2);
}

/* As many workers as fit when each takes `each` bytes of `bytes`; one at least. */
static wh_exec fit_workers(const inspection *n, size_t bytes, size_t each)
{
	const size_t fits = each ? bytes / each : SIZE_MAX;
	wh_exec ex = *n->exec;
	if ((size_t)ex.workers > fits)
		ex.workers = fits ? (int)fits : 1;
	return ex;
}

/* What a check in memory takes, but for the workers that load. SIZE_MAX: it cannot be. */
static size_t whole_bytes(const inspection *n)
{
	const uint64_t nv = n->input.source.nv, nf = n->input.source.nf;
	if (n->params->cluster_faces || nv >= WH_NONE || nf >= WH_NONE)
		return SIZE_MAX;
	const size_t coincident = (size_t)nv * 16, rest = wh_check_piece_bytes(nv, nf);
	return (size_t)nv * 24 + (size_t)nf * 12 + (coincident > rest ? coincident : rest);
}

static bool fits_memory(const inspection *n)
{
	return budget(n) > LOADER_BYTES && whole_bytes(n) <= budget(n) - LOADER_BYTES;
}

/* Faces of a cluster when there are so many bytes: the workers' clusters take half of them, and
 * the other half is for the cuts. */
static uint64_t cluster_faces(const inspection *n, size_t bytes)
{
	if (n->params->cluster_faces)
		return n->params->cluster_faces;
	const uint64_t each = bytes / 2 / (size_t)n->exec->workers / FACE_BYTES;
	return each < FACES_LEAST ? FACES_LEAST : each > FACES_MOST ? FACES_MOST : each;
}

static uint32_t cluster_count(const inspection *n, uint64_t each)
{
	const uint64_t k = (n->input.source.nf + each - 1) / each;
	return k < 1 ? 1 : k > WH_MAX_CLUSTERS ? WH_MAX_CLUSTERS : (uint32_t)k;
}

/* What one worker will take if the mesh is a surface that folds little. A guess, good for words:
 * a cluster of n faces has some 2 sqrt(n) cut vertices that are its own. */
static size_t likely_bytes(const inspection *n, uint64_t each)
{
	const double cuts = 2.1 * sqrt((double)each) * cluster_count(n, each);
	return (size_t)(1.3 * FACE_BYTES * (double)each + CUT_BYTES * cuts);
}

/* Refuses for want of `least` bytes before the work begins, with a size that does for all. */
static wh_code refuse_early(const inspection *n, size_t least)
{
	size_t need = least;
	while (likely_bytes(n, cluster_faces(n, need)) > need)
		need += need / 8;
	return too_small(n, "reading the input", need);
}

/* ---- in memory ---------------------------------------------------------------------------- */

static wh_code check_in_memory(inspection *n, uint64_t *degenerate)
{
	const wh_source *src = &n->input.source;
	const wh_exec ex = fit_workers(n, budget(n) - whole_bytes(n), LOADER_BYTES);
	wh_mesh m;
	wh_progress_phase(&n->progress, "check", src->nf);
	wh_code code = wh_source_mesh(n->c, &ex, src, &m);
	if (code != WH_OK)
		return code;
	*degenerate = src->nf - m.nf;
	code = wh_check_mesh(n->c, &m, n->r);
	wh_mesh_free(n->c, &m);
	return code;
}

/* ---- in clusters -------------------------------------------------------------------------- */

static wh_code ingest(inspection *n, wh_store *store, wh_ingest_result *cut)
{
	const wh_source *src = &n->input.source;
	wh_ingest_params p = {.clusters = cluster_count(n, cluster_faces(n, budget(n)))};
	wh_exec ex = *n->exec;
	const size_t need = wh_ingest_fit(src, budget(n), &ex, &p);
	if (need > budget(n))
		return refuse_early(n, need);
	return wh_ingest(n->c, &ex, &n->progress, src, &p, store, cut);
}

static wh_code look_at_clusters(inspection *n, const wh_store *store, uint64_t cut_vertices)
{
	uint64_t max_v, max_f, faces, vertices;
	if (wh_round_extent(n->c, store, &max_v, &max_f, &faces, &vertices) != WH_OK)
		return n->c->err.code;
	const size_t each = wh_inspect_bytes(store, max_v, max_f);
	const size_t cuts = (size_t)cut_vertices * CUT_BYTES;
	if (cuts + each > budget(n))
		return too_small(n, "a cluster, and the faces along the cuts,", cuts + 2 * each);
	const wh_exec ex = fit_workers(n, budget(n) - cuts, each);
	return wh_inspect_store(n->c, &ex, &n->progress, store, n->r);
}

static wh_code check_in_clusters(inspection *n, uint64_t *degenerate)
{
	const wh_source *src = &n->input.source;
	wh_store store = {.spill = &n->spill};
	wh_ingest_result cut = {0};
	wh_check *r = n->r;
	wh_code code = ingest(n, &store, &cut);
	if (code == WH_OK)
		code = look_at_clusters(n, &store, cut.cut_vertices);
	if (code != WH_OK)
		return code;
	wh_round_remove(&store);
	*degenerate = cut.degenerate;
	r->vertices = src->nv;
	r->unreferenced_vertices = src->nv - r->referenced_vertices;
	const double unit = 1 / cut.scale;
	r->lo = wh_scale(r->lo, unit);
	r->hi = wh_scale(r->hi, unit);
	r->area *= unit * unit;
	return wh_duplicate_vertices(n->c, n->exec, &n->progress, src, budget(n),
	                             &r->duplicate_vertices);
}

/* ---- the whole ---------------------------------------------------------------------------- */

/* Vertices that are not finite go with their faces, and near ones where that is asked for. */
static wh_code clean_input(inspection *n)
{
	const wh_clean_params p = {.drop_invalid = true,
	                           .weld = n->params->weld,
	                           .distance = n->params->weld_distance,
	                           .distance_share = n->params->weld_share};
	const size_t need = wh_clean_bytes(&n->input.source, &p, 1);
	wh_source cleaned;
	int fd;
	if (need > budget(n))
		return refuse_early(n, need);
	const wh_code code = wh_clean(n->c, n->exec, &n->progress, &n->spill, &n->input.source, &p,
	                              budget(n), &cleaned, &fd, &n->cleaned);
	if (code == WH_OK && fd >= 0)
		wh_input_replace(&n->spill, &n->input, &cleaned, fd);
	wh_mem_trim(n->c);
	return code;
}

/* Puts what was taken out into the counts. */
static void add_cleaned(inspection *n, uint64_t degenerate)
{
	wh_check *r = n->r;
	const wh_clean_result *k = &n->cleaned;
	r->vertices += k->invalid_vertices + k->welded_vertices;
	r->nonfinite_vertices = k->invalid_vertices;
	r->nonfinite_faces = k->invalid_faces + n->input.invalid_polygons;
	r->welded_vertices = k->welded_vertices;
	r->collapsed_faces = k->collapsed_faces;
	r->degenerate_faces += degenerate + n->input.degenerate + k->degenerate_faces;
	r->faces += degenerate + n->input.degenerate + k->degenerate_faces + r->nonfinite_faces +
	            k->collapsed_faces;
}

static wh_code open_input(inspection *n)
{
	wh_progress_phase(&n->progress, "open", 1);
	const wh_exec ex = fit_workers(n, budget(n), REWRITE_BYTES);
	const wh_input_how how = {.from = n->params->from,
	                          .attributes = {"none", 0},
	                          .rply = n->params->rply,
	                          .keep_invalid = true};
	if (wh_input_open_how(n->c, &ex, &n->spill, n->params->path, &how, &n->input) != WH_OK)
		return n->c->err.code;
	n->input_open = true;
	return WH_OK;
}

static wh_code rewrite_input(inspection *n)
{
	const wh_exec ex = fit_workers(n, budget(n), REWRITE_BYTES);
	return wh_input_rewrite(n->c, &ex, &n->spill, &n->input);
}

static wh_code check_input(inspection *n)
{
	uint64_t degenerate = 0;
	wh_code code = clean_input(n);
	if (code == WH_OK && n->input.source.nf > 0)
		code = fits_memory(n) ? check_in_memory(n, &degenerate)
		                      : check_in_clusters(n, &degenerate);
	if (code != WH_OK)
		return code;
	if (n->r->faces == 0)
		return wh_fail(n->c, WH_E_INPUT,
		               "'%s' has nothing to check: none of its faces has three different "
		               "corners that are finite",
		               n->params->path);
	add_cleaned(n, degenerate);
	return WH_OK;
}

wh_code wh_inspect_file(wh_ctx *c, const wh_exec *ex, const wh_inspect_params *p, wh_check *r,
                        bool *is_double)
{
	*r = (wh_check){0};
	inspection n = {
	    .c = c,
	    .params = p,
	    .exec = ex,
	    .memory = p->memory ? p->memory : wh_topo_memory() / 2,
	    .progress = {.fn = p->progress, .user = p->progress_user, .telling = ATOMIC_FLAG_INIT},
	    .r = r};
	const size_t old_limit = c->mem->limit;
	c->mem->limit = n.memory > OPEN_BYTES ? n.memory - BASE_BYTES / 2 : OPEN_BYTES;
	wh_code code = wh_spill_open(c, &n.spill, p->temp_dir, "/tmp");
	if (code == WH_OK)
		code = open_input(&n);
	if (code == WH_OK)
		code = check_input(&n);
	if (code == WH_E_IRREGULAR) { /* faces that are not triangles behind a triangle's size */
		code = rewrite_input(&n);
		if (code == WH_OK)
			code = check_input(&n);
	}
	if (is_double)
		*is_double = n.input.source.is_double;
	if (n.input_open)
		wh_input_close(c, &n.spill, &n.input);
	wh_spill_close(c, &n.spill);
	c->mem->limit = old_limit;
	return code;
}
