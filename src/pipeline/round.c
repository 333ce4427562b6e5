#include "pipeline/round.h"

#include "base/sort.h"
#include "pipeline/dispatch.h"
#include "pipeline/round_workspace.h"
#include "pipeline/ledger.h"
#include "pipeline/pieces.h"
#include "pipeline/rerun.h"
#include "pipeline/sequence.h"

#include <string.h>

/* ---- survey ------------------------------------------------------------------------------- */

enum { SURVEY_CLUSTERS = 8, SURVEY_LEAST = 4, SURVEY_SHARE = 64 };

typedef struct survey_run {
	const wh_store *store;
	wh_progress *progress;
	wh_round_workspace *workspace;
	const wh_simplify_params *params;
	uint32_t piece_faces;
	uint32_t samples; /* clusters surveyed */
	uint32_t pieces;  /* in each */
	uint64_t max_v, max_f;
	wh_survey *part; /* one for each sample */
} survey_run;

static uint32_t survey_cluster(const survey_run *r, int64_t index)
{
	return (uint32_t)((2 * (uint64_t)index + 1) * r->store->clusters /
	                  (2 * (uint64_t)r->samples));
}

static wh_code survey_job(wh_ctx *c, void *arg, int64_t index, int worker)
{
	const survey_run *r = arg;
	wh_round_workspace *ws = &r->workspace[worker];
	if (wh_round_workspace_ready(c, ws) != WH_OK ||
	    wh_store_load(c, r->store, survey_cluster(r, index), &ws->load, &ws->patch) != WH_OK ||
	    wh_cluster_survey(c, ws->cluster, &ws->patch, r->piece_faces, r->pieces, r->params,
	                      &r->part[index]) != WH_OK)
		return c->err.code;
	wh_progress_add(r->progress, 1);
	return WH_OK;
}

/* How many pieces in how many clusters: a share of all, spread over the whole store. */
static wh_code survey_size(wh_ctx *c, survey_run *r)
{
	uint64_t faces, vertices;
	if (wh_round_extent(c, r->store, &r->max_v, &r->max_f, &faces, &vertices) != WH_OK)
		return c->err.code;
	const uint64_t all = faces / r->piece_faces + 1;
	uint64_t pieces = all / SURVEY_SHARE;
	pieces = pieces < SURVEY_LEAST ? SURVEY_LEAST : pieces > 64 ? 64 : pieces;
	r->samples = r->store->clusters < SURVEY_CLUSTERS ? r->store->clusters : SURVEY_CLUSTERS;
	if (r->samples > pieces)
		r->samples = (uint32_t)pieces;
	r->pieces = (uint32_t)((pieces + r->samples - 1) / r->samples);
	return WH_OK;
}

static wh_code survey_parts(wh_ctx *c, survey_run *r)
{
	r->part = wh_calloc(c, r->samples, sizeof *r->part);
	for (uint32_t i = 0; r->part && i < r->samples; i++)
		if (!(r->part[i].log = wh_calloc(c, 1, sizeof(wh_cost_log))))
			break;
	return c->err.code;
}

static void survey_sum(const survey_run *r, wh_survey *survey)
{
	for (uint32_t i = 0; i < r->samples; i++) {
		survey->free_vertices += r->part[i].free_vertices;
		for (uint32_t b = 0; b < WH_LOG_BINS; b++)
			survey->log->collapses[b] += r->part[i].log->collapses[b];
	}
}

wh_code wh_round_survey(wh_ctx *c, const wh_exec *ex, wh_progress *progress, const wh_store *store,
                        uint32_t piece_faces, const wh_simplify_params *params, wh_survey *survey)
{
	survey_run r = {
	    .store = store, .progress = progress, .params = params, .piece_faces = piece_faces};
	if (survey_size(c, &r) != WH_OK)
		return c->err.code;
	wh_progress_phase(progress, "survey", r.samples);
	r.workspace = wh_round_workspaces_make(c, ex->workers, store, r.max_v, r.max_f);
	wh_code code = survey_parts(c, &r);
	if (code == WH_OK)
		code = wh_exec_for(c, ex, r.samples, survey_job, &r);
	if (code == WH_OK)
		survey_sum(&r, survey);
	for (uint32_t i = 0; r.part && i < r.samples; i++)
		wh_free(c, r.part[i].log);
	wh_free(c, r.part);
	wh_round_workspaces_free(c, r.workspace, ex->workers);
	return code;
}

double wh_survey_cost(const wh_survey *survey, double keep)
{
	const double gone = (1.0 - keep) * (double)survey->free_vertices;
	uint64_t sum = 0;
	uint32_t last = 0;
	for (uint32_t b = 0; b < WH_LOG_BINS; b++) {
		if (survey->log->collapses[b] == 0)
			continue;
		sum += survey->log->collapses[b];
		if ((double)sum > gone) /* this bin would take too many: the one before it */
			return wh_log_cost(last);
		last = b;
	}
	return wh_log_cost(last);
}

/* ---- counts ------------------------------------------------------------------------------- */

/* Faces and vertices of every cluster: so many numbers each, in one block. */
static uint64_t *all_counts(wh_ctx *c, const wh_store *store)
{
	const uint32_t n = store->clusters;
	uint64_t *count = wh_alloc(c, n, 2 * sizeof *count);
	if (!count)
		return NULL;
	wh_code code = WH_OK;
	if (store->parts) /* where asking for one cluster after the other takes long */
		code = wh_pieces_all_counts(c, store, count, count + n);
	for (uint32_t k = 0; code == WH_OK && !store->parts && k < n; k++)
		code = wh_store_counts(c, store, k, &count[k], &count[n + k]);
	if (code == WH_OK)
		return count;
	wh_free(c, count);
	return NULL;
}

/* ---- decimation --------------------------------------------------------------------------- */

typedef struct reduce_run {
	const wh_store *from, *to;
	wh_progress *progress;
	wh_round_workspace *workspace;
	wh_sequence_writer *writer; /* one for each worker; NULL: collapses are not kept */
	uint64_t *first;            /* face of each cluster, where they are numbered now */
	const wh_cluster_params *params;
	const uint64_t *order; /* of the clusters */
	wh_round_result *part; /* one for each cluster */
} reduce_run;

/* Counts a cluster that is done already. */
static wh_code pass_over(wh_ctx *c, const reduce_run *r, uint32_t k)
{
	uint64_t faces, vertices;
	const wh_code code = wh_store_counts(c, r->from, k, &faces, &vertices);
	wh_progress_add(r->progress, faces);
	return code;
}

/* True for a cluster of another part that is done. */
static bool is_elsewhere(const wh_ctx *c, const reduce_run *r, uint32_t k)
{
	wh_ctx own = wh_ctx_fork(c);
	uint64_t checksum;
	return !wh_ledger_owns(r->to->ledger, k) &&
	       wh_store_checksum(&own, r->to, k, &checksum) == WH_OK;
}

/* Reduces the patch at hand, which is cluster k, and keeps the collapses where that is asked for.
 */
static wh_code reduce_patch(wh_ctx *c, const reduce_run *r, wh_round_workspace *ws, uint32_t k,
                            int worker, wh_simplify_result *done)
{
	if (!r->writer)
		return wh_cluster_reduce(c, ws->cluster, &ws->patch, r->params, done);
	wh_sequence_writer *w = &r->writer[worker];
	const wh_collapse_sink sink = {wh_sequence_put, w};
	wh_cluster_params p = *r->params;
	p.all.sink = &sink;
	wh_code code = wh_sequence_begin(c, w, r->to->sequence, r->to->generation, k, &ws->patch,
	                                 (uint32_t)r->first[k]);
	if (code == WH_OK)
		code = wh_cluster_reduce(c, ws->cluster, &ws->patch, &p, done);
	return wh_sequence_end(c, w, &ws->patch, code);
}

static wh_code reduce_job(wh_ctx *c, void *arg, int64_t index, int worker)
{
	const reduce_run *r = arg;
	wh_round_workspace *ws = &r->workspace[worker];
	uint32_t k;
	if (!wh_round_turn(r->from, r->to, r->order, index, &k) || is_elsewhere(c, r, k))
		return WH_OK;
	if (wh_round_workspace_ready(c, ws) != WH_OK)
		return c->err.code;
	wh_round_result *out = &r->part[k];
	if (wh_ledger_is_saved(c, r->to, k, &ws->load, out, sizeof *out))
		return pass_over(c, r, k);
	if (wh_store_load(c, r->from, k, &ws->load, &ws->patch) != WH_OK)
		return c->err.code;
	const uint32_t before = ws->patch.nf;
	out->unreferenced = ws->load.unreferenced;
	if (reduce_patch(c, r, ws, k, worker, &out->work) != WH_OK ||
	    wh_store_save(c, r->to, k, &ws->patch) != WH_OK)
		return c->err.code;
	out->faces = ws->patch.nf;
	out->vertices = ws->patch.nv;
	wh_progress_add(r->progress, before);
	return wh_ledger_saved(c, r->to, k, out, sizeof *out);
}

size_t wh_round_bytes(const wh_store *store, uint64_t nv, uint64_t nf, size_t state)
{
	return wh_store_workspace_bytes(store, nv, nf) +
	       wh_cluster_bytes(nv, nf, store->attr_bytes, store->face_bytes) + (size_t)nv * state +
	       wh_rerun_bytes(nv, store->attr_bytes);
}

void wh_round_result_add(wh_round_result *sum, const wh_round_result *one)
{
	sum->faces += one->faces;
	sum->vertices += one->vertices;
	sum->unreferenced += one->unreferenced;
	wh_simplify_result_add(&sum->work, &one->work);
}

/* Faces carry what the traces leave them; a writer for each worker, and the number of the first
 * face of each cluster. */
static wh_code begin_record(wh_ctx *c, reduce_run *r, wh_store *to, int workers)
{
	to->face_bytes = sizeof(wh_trace_face);
	r->writer = wh_calloc(c, (size_t)workers, sizeof *r->writer);
	r->first = all_counts(c, r->from);
	if (!r->writer || !r->first)
		return wh_failed(c);
	uint64_t sum = 0;
	for (uint32_t k = 0; k < r->from->clusters; k++) {
		const uint64_t n = r->first[k];
		r->first[k] = sum;
		sum += n;
	}
	return c->err.code;
}

wh_code wh_round_reduce(wh_ctx *c, const wh_exec *ex, wh_progress *progress, const wh_store *from,
                        wh_store *to, const wh_cluster_params *params, wh_round_result *result)
{
	uint64_t max_v, max_f, faces, vertices;
	if (wh_round_extent(c, from, &max_v, &max_f, &faces, &vertices) != WH_OK)
		return c->err.code;
	wh_store_lay_out(from, to);
	wh_progress_phase(progress, "decimate", faces);
	reduce_run r = {.from = from, .to = to, .progress = progress, .params = params};
	r.workspace = wh_round_workspaces_make(c, ex->workers, from, max_v, max_f);
	r.part = wh_calloc(c, from->clusters, sizeof *r.part);
	uint64_t *order = wh_round_longest_first(c, from);
	r.order = order;
	wh_code code = to->sequence ? begin_record(c, &r, to, ex->workers) : c->err.code;
	if (code == WH_OK)
		code =
		    wh_exec_for(c, ex, wh_ledger_turns(to->ledger, from->clusters), reduce_job, &r);
	*result = (wh_round_result){0};
	for (uint32_t k = 0; code == WH_OK && k < from->clusters; k++)
		wh_round_result_add(result, &r.part[k]);
	wh_free(c, order);
	for (int i = 0; r.writer && i < ex->workers; i++)
		wh_sequence_writer_free(c, &r.writer[i]);
	wh_free(c, r.writer);
	wh_free(c, r.first);
	wh_free(c, r.part);
	wh_round_workspaces_free(c, r.workspace, ex->workers);
	return code;
}

void wh_round_remove(const wh_store *store)
{
	for (uint32_t k = 0; k < store->clusters; k++)
		wh_store_remove(store, k);
}

wh_code wh_round_extent(wh_ctx *c, const wh_store *store, uint64_t *max_vertices,
                        uint64_t *max_faces, uint64_t *faces, uint64_t *vertices)
{
	const uint32_t n = store->clusters;
	*max_vertices = *max_faces = *faces = *vertices = 0;
	uint64_t *count = all_counts(c, store);
	if (!count)
		return wh_failed(c);
	for (uint32_t k = 0; k < n; k++) {
		const uint64_t nf = count[k], nv = count[n + k];
		*faces += nf;
		*vertices += nv;
		*max_faces = nf > *max_faces ? nf : *max_faces;
		*max_vertices = nv > *max_vertices ? nv : *max_vertices;
	}
	wh_free(c, count);
	return WH_OK;
}

_Static_assert(WH_MAX_CLUSTERS <= UINT16_MAX + 1, "16 bits tell which cluster it is");

uint64_t *wh_round_longest_first(wh_ctx *c, const wh_store *store)
{
	const uint32_t n = store->clusters;
	uint64_t *order = all_counts(c, store);
	if (!order)
		return NULL;
	for (uint32_t k = 0; k < n; k++)
		order[k] = ~order[k] << 16 | k;
	(void)wh_sort_unique(order, n);
	for (uint32_t i = 0; i < n; i++)
		order[i] &= UINT16_MAX;
	return order;
}

bool wh_round_turn(const wh_store *from, const wh_store *to, const uint64_t *order, int64_t turn,
                   uint32_t *cluster)
{
	const wh_ledger *l = to->ledger;
	if (!wh_ledger_turn(l, from->clusters, turn, cluster))
		return false;
	if (!l || l->parts == 0)
		*cluster = (uint32_t)order[turn];
	return true;
}
