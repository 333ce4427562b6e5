#include "pipeline/settle.h"

#include "pipeline/round_workspace.h"
#include "pipeline/ledger.h"
#include "pipeline/quota.h"
#include "pipeline/rerun.h"

#include <string.h>

typedef struct settle {
	const wh_store *from;
	wh_store *to;
	wh_progress *progress;
	const wh_settle_params *params;
	wh_round_workspace *workspace; /* one for each worker, as are the next two */
	wh_cost_log *costs;
	wh_rerun *rerun;
	uint64_t *order;   /* of the clusters */
	wh_quota_log *log; /* one for each cluster, as are those below */
	wh_quota *share;
	wh_round_result *part;
	bool *open; /* the cluster has boundary edges */
} settle;

/* The store that is filled. */
static wh_store result_store(const settle *s)
{
	wh_store to = {
	    .spill = s->to->spill, .generation = s->to->generation, .ledger = s->to->ledger};
	wh_store_lay_out(s->from, &to);
	return to;
}

/* ---- trials of an earlier process --------------------------------------------------------- */

/* What the ledger says of a trial; the log's bins follow. */
typedef struct trial_entry {
	uint64_t size, checksum; /* of the file of collapses */
	uint32_t open, bins;
} trial_entry;

static wh_code note_trial(wh_ctx *c, const settle *s, uint32_t k)
{
	const wh_quota_log *log = &s->log[k];
	const size_t bytes = log->n * sizeof *log->item;
	trial_entry e = {.open = s->open[k], .bins = log->n};
	wh_rerun_file name;
	if (!s->to->ledger)
		return WH_OK;
	uint8_t *entry = wh_alloc(c, sizeof e + bytes, 1);
	if (!entry || wh_spill_checksum(c, s->to->spill, wh_rerun_name(k, name), &e.size,
	                                &e.checksum) != WH_OK) {
		wh_free(c, entry);
		return c->err.code;
	}
	memcpy(entry, &e, sizeof e);
	if (bytes)
		memcpy(entry + sizeof e, log->item, bytes);
	const wh_code code = wh_ledger_put(c, s->to->ledger, WH_LEDGER_TRIAL, k, entry,
	                                   (uint32_t)(sizeof e + bytes));
	wh_free(c, entry);
	return code;
}

/* Takes the log from the ledger. */
static bool recall_log(wh_ctx *c, settle *s, uint32_t k, trial_entry *e)
{
	const wh_ledger *l = s->to->ledger;
	const uint32_t n = wh_ledger_bytes(c, l, WH_LEDGER_TRIAL, k);
	uint8_t *entry = n >= sizeof *e ? wh_alloc(c, n, 1) : NULL;
	bool ok = entry && wh_ledger_get(c, l, WH_LEDGER_TRIAL, k, entry, n) == WH_OK;
	if (ok) {
		wh_quota_log *log = &s->log[k];
		memcpy(e, entry, sizeof *e);
		const size_t bytes = e->bins * sizeof *log->item;
		ok = n == sizeof *e + bytes;
		log->item = ok ? wh_alloc(c, e->bins + 1, sizeof *log->item) : NULL;
		ok = log->item;
		if (ok && bytes)
			memcpy(log->item, entry + sizeof *e, bytes);
		log->n = ok ? e->bins : 0;
	}
	wh_free(c, entry);
	return ok;
}

/* True when the trial of cluster k need not be done again: its collapses are still there, or are
 * not needed any more. */
static bool recall_trial(wh_ctx *c, settle *s, uint32_t k, wh_store_workspace *ws)
{
	trial_entry e;
	uint64_t size, checksum;
	wh_rerun_file name;
	wh_round_result result;
	wh_ctx own = wh_ctx_fork(c);
	if (!recall_log(&own, s, k, &e))
		return false;
	s->open[k] = e.open != 0;
	if (wh_spill_checksum(&own, s->to->spill, wh_rerun_name(k, name), &size, &checksum) ==
	        WH_OK &&
	    size == e.size && checksum == e.checksum)
		return true;
	const wh_store whole = result_store(s);
	if (wh_ledger_is_saved(c, &whole, k, ws, &result, sizeof result))
		return true;
	wh_free(c, s->log[k].item);
	s->log[k] = (wh_quota_log){0};
	return false;
}

/* Counts a cluster of which half is done already. */
static wh_code pass_over(wh_ctx *c, const settle *s, uint32_t k)
{
	uint64_t faces, vertices;
	const wh_code code = wh_store_counts(c, s->from, k, &faces, &vertices);
	wh_progress_add(s->progress, faces);
	return code;
}

/* ---- on trial ----------------------------------------------------------------------------- */

/* Reduces the patch at hand, which is cluster k, and records what is done to it. */
static wh_code reduce_on_trial(wh_ctx *c, const settle *s, wh_round_workspace *ws, wh_rerun *rerun,
                               uint32_t k, wh_cost_log *log, wh_simplify_result *done)
{
	const wh_collapse_sink sink = {wh_rerun_put, rerun};
	wh_cluster_params p = {.all = s->params->all};
	p.all.log = log;
	p.all.log_in_order = true;
	p.all.sink = &sink;
	memset(log, 0, sizeof *log);
	if (wh_rerun_begin(c, rerun, s->from->spill, k) != WH_OK)
		return c->err.code;
	return wh_rerun_end(c, rerun, wh_cluster_reduce(c, ws->cluster, &ws->patch, &p, done));
}

/* True for a cluster of another part whose trial is done. */
static bool is_elsewhere(const settle *s, uint32_t k)
{
	wh_rerun_file name;
	return !wh_ledger_owns(s->to->ledger, k) &&
	       wh_spill_has(s->to->spill, wh_rerun_name(k, name));
}

static wh_code trial_job(wh_ctx *c, void *arg, int64_t index, int worker)
{
	settle *s = arg;
	wh_round_workspace *ws = &s->workspace[worker];
	wh_cost_log *log = &s->costs[worker];
	uint32_t k;
	if (!wh_round_turn(s->from, s->to, s->order, index, &k) || is_elsewhere(s, k))
		return WH_OK;
	if (wh_round_workspace_ready(c, ws) != WH_OK)
		return c->err.code;
	if (s->to->ledger && recall_trial(c, s, k, &ws->load))
		return pass_over(c, s, k);
	if (wh_store_load(c, s->from, k, &ws->load, &ws->patch) != WH_OK)
		return c->err.code;
	const uint32_t before = ws->patch.nf;
	wh_simplify_result done = {0};
	if (reduce_on_trial(c, s, ws, &s->rerun[worker], k, log, &done) != WH_OK)
		return c->err.code;
	s->open[k] = done.border > 0;
	wh_progress_add(s->progress, before);
	if (wh_quota_note(c, &s->log[k], log) != WH_OK)
		return c->err.code;
	return note_trial(c, s, k);
}

/* ---- in earnest --------------------------------------------------------------------------- */

/* As on trial, up to the cluster's share. Where faces carry something, collapses cannot be done
 * again from two vertices alone: they are found again, which gives the same ones. The topology
 * stays, as it does where there is a sink. */
static wh_code find_again(wh_ctx *c, const settle *s, wh_round_workspace *ws, uint32_t k,
                          wh_simplify_result *done)
{
	wh_rerun_file name;
	wh_cluster_params p = {.all = s->params->all};
	p.all.free_topology = false;
	p.all.most_faces = s->share[k].faces;
	p.all.most_collapses = s->share[k].vertices;
	*done = (wh_simplify_result){0};
	wh_code code = WH_OK;
	if (p.all.most_faces && p.all.most_collapses)
		code = wh_cluster_reduce(c, ws->cluster, &ws->patch, &p, done);
	wh_spill_remove(s->from->spill, wh_rerun_name(k, name));
	return code;
}

static wh_code perform_share(wh_ctx *c, const settle *s, wh_round_workspace *ws, wh_rerun *rerun,
                             uint32_t k, wh_simplify_result *done)
{
	const wh_rerun_limit share = {s->share[k].faces, s->share[k].vertices};
	if (s->from->face_bytes)
		return find_again(c, s, ws, k, done);
	return wh_rerun_perform(c, rerun, s->from->spill, k, share, &ws->patch, done);
}

static wh_code perform_job(wh_ctx *c, void *arg, int64_t index, int worker)
{
	settle *s = arg;
	wh_round_workspace *ws = &s->workspace[worker];
	const uint32_t k = (uint32_t)s->order[index];
	wh_round_result *out = &s->part[k];
	if (wh_round_workspace_ready(c, ws) != WH_OK)
		return c->err.code;
	if (wh_ledger_is_saved(c, s->to, k, &ws->load, out, sizeof *out))
		return pass_over(c, s, k);
	if (wh_store_load(c, s->from, k, &ws->load, &ws->patch) != WH_OK)
		return c->err.code;
	const uint32_t before = ws->patch.nf;
	if (perform_share(c, s, ws, &s->rerun[worker], k, &out->work) != WH_OK ||
	    wh_store_save(c, s->to, k, &ws->patch) != WH_OK)
		return c->err.code;
	out->unreferenced = ws->load.unreferenced;
	out->faces = ws->patch.nf;
	out->vertices = ws->patch.nv;
	wh_progress_add(s->progress, before);
	return wh_ledger_saved(c, s->to, k, out, sizeof *out);
}

/* ---- the last face ------------------------------------------------------------------------ */

/* Takes one more face off cluster k of the result, or two where `overshoot` allows it. Returns in
 * *taken how many went. */
static wh_code take_one(wh_ctx *c, settle *s, uint32_t k, bool overshoot, uint32_t *taken)
{
	wh_round_workspace *ws = &s->workspace[0];
	*taken = 0;
	if (wh_round_workspace_ready(c, ws) != WH_OK ||
	    wh_store_load(c, s->to, k, &ws->load, &ws->patch) != WH_OK)
		return c->err.code;
	const uint32_t before = ws->patch.nf;
	if (before < 2)
		return WH_OK;
	wh_cluster_params p = {.all = s->params->all};
	p.all.max_cost = INFINITY;
	p.all.target_faces = before - 1;
	p.all.no_overshoot = !overshoot;
	wh_simplify_result done;
	if (wh_cluster_reduce(c, ws->cluster, &ws->patch, &p, &done) != WH_OK)
		return c->err.code;
	*taken = before - ws->patch.nf;
	if (*taken == 0)
		return WH_OK;
	s->part[k].faces -= *taken;
	s->part[k].vertices = ws->patch.nv;
	wh_simplify_result_add(&s->part[k].work, &done);
	return wh_store_save(c, s->to, k, &ws->patch);
}

/* One face too many is left: an inner collapse takes two. A cluster with a boundary can give up
 * one; where none can, one of them gives up two. */
static wh_code take_last(wh_ctx *c, settle *s, bool *one_less)
{
	uint32_t taken = 0;
	for (int overshoot = 0; overshoot < 2; overshoot++)
		for (uint32_t k = 0; k < s->from->clusters; k++) {
			if (!overshoot && !s->open[k])
				continue;
			if (take_one(c, s, k, overshoot, &taken) != WH_OK)
				return c->err.code;
			if (taken == 0)
				continue;
			*one_less = taken == 2;
			return WH_OK;
		}
	return WH_OK;
}

/* ---- all of it ---------------------------------------------------------------------------- */

static wh_code perform(wh_ctx *c, const wh_exec *ex, settle *s, uint64_t faces, const wh_quota *sum,
                       wh_settle_result *result)
{
	*s->to = result_store(s);
	if (wh_exec_for(c, ex, s->from->clusters, perform_job, s) != WH_OK)
		return c->err.code;
	uint64_t left = 0;
	for (uint32_t k = 0; k < s->from->clusters; k++)
		left += s->part[k].faces;
	/* the vertices were exact, or faces were what counted */
	const bool by_faces = s->params->faces && sum->faces >= s->params->faces;
	if (by_faces && faces - left + 1 == s->params->faces &&
	    take_last(c, s, &result->one_less) != WH_OK)
		return c->err.code;
	for (uint32_t k = 0; k < s->from->clusters; k++)
		wh_round_result_add(&result->round, &s->part[k]);
	return WH_OK;
}

static wh_code share_out(wh_ctx *c, const wh_exec *ex, settle *s, wh_quota *sum)
{
	const wh_settle_params *p = s->params;
	const uint32_t turns = wh_ledger_turns(s->to->ledger, s->from->clusters);
	if (wh_exec_for(c, ex, turns, trial_job, s) != WH_OK)
		return c->err.code;
	if (s->to->ledger && s->to->ledger->parts) /* nobody knows of the other trials yet */
		return WH_OK;
	return wh_quota_share(c, s->log, s->from->clusters, p->faces, p->vertices, s->share, sum);
}

static wh_code settle_open(wh_ctx *c, const wh_exec *ex, settle *s, uint64_t max_v, uint64_t max_f)
{
	const uint32_t n = s->from->clusters;
	s->workspace = wh_round_workspaces_make(c, ex->workers, s->from, max_v, max_f);
	s->costs = wh_alloc(c, (size_t)ex->workers, sizeof *s->costs);
	s->rerun = wh_calloc(c, (size_t)ex->workers, sizeof *s->rerun);
	s->order = wh_round_longest_first(c, s->from);
	s->log = wh_calloc(c, n, sizeof *s->log);
	s->share = wh_calloc(c, n, sizeof *s->share);
	s->part = wh_calloc(c, n, sizeof *s->part);
	s->open = wh_calloc(c, n, sizeof *s->open);
	for (int i = 0; s->rerun && i < ex->workers; i++)
		s->rerun[i].attr_bytes = s->from->attr_bytes;
	return c->err.code;
}

static void settle_close(wh_ctx *c, const wh_exec *ex, settle *s)
{
	for (uint32_t k = 0; s->log && k < s->from->clusters; k++)
		wh_free(c, s->log[k].item);
	for (int i = 0; s->rerun && i < ex->workers; i++)
		wh_rerun_free(c, &s->rerun[i]);
	wh_free(c, s->rerun);
	wh_free(c, s->open);
	wh_free(c, s->part);
	wh_free(c, s->share);
	wh_free(c, s->log);
	wh_free(c, s->order);
	wh_free(c, s->costs);
	wh_round_workspaces_free(c, s->workspace, ex->workers);
}

wh_code wh_settle(wh_ctx *c, const wh_exec *ex, wh_progress *progress, const wh_store *from,
                  wh_store *to, const wh_settle_params *params, bool partly,
                  wh_settle_result *result)
{
	*result = (wh_settle_result){0};
	settle s = {.from = from, .to = to, .progress = progress, .params = params};
	uint64_t max_v, max_f, faces, vertices;
	wh_quota sum = {0};
	if (wh_round_extent(c, from, &max_v, &max_f, &faces, &vertices) != WH_OK)
		return c->err.code;
	wh_progress_phase(progress, "settle", 2 * faces);
	wh_code code = settle_open(c, ex, &s, max_v, max_f);
	if (code == WH_OK)
		code = share_out(c, ex, &s, &sum);
	result->reached = (params->faces && sum.faces >= params->faces) ||
	                  (params->vertices && sum.vertices >= params->vertices);
	if (s.to->ledger && s.to->ledger->parts)
		partly = result->reached = false;
	if (code == WH_OK && (result->reached || partly))
		code = perform(c, ex, &s, faces, &sum, result);
	settle_close(c, ex, &s);
	return code;
}
