/*
 * A run that is recorded. Its collapses are kept as they are made, and with them the mesh as it was
 * ingested; at the end both go, in memory, through algo/progressive, and what is written is not the
 * result but the way there.
 *
 * What the collapses do not tell is refused: changes of topology, and what faces carry. So is a
 * result that is streamed, and a mesh for which the ceiling has no room, before anything is done.
 */
#include "run/run.h"

#include "algo/progressive.h"

#include <string.h>

wh_code wh_run_sensible_record(wh_ctx *c, const wh_reduce_params *p)
{
	if (!p->progressive)
		return WH_OK;
	if (p->levels)
		return wh_fail(c, WH_E_USAGE,
		               "a progressive mesh has all levels in it: leave them out");
	if (p->run_dir || p->stage != WH_STAGE_ALL)
		return wh_fail(c, WH_E_USAGE,
		               "a run that is recorded cannot be resumed or shared yet: leave out "
		               "the run directory");
	if (p->simplify_topology)
		return wh_fail(c, WH_E_USAGE,
		               "changes of topology cannot be recorded: leave out --topology "
		               "simplify");
	if (p->to || p->ascii || p->quantize)
		return wh_fail(c, WH_E_USAGE,
		               "the form of a mesh is chosen when it is replayed: leave it out");
	return WH_OK;
}

/* ---- before it begins --------------------------------------------------------------------- */

/* Of loading the ingested mesh, cluster by cluster, beside the final patch. */
static size_t loading_bytes(const wh_run *r)
{
	const wh_source *s = &r->input.source;
	const uint32_t attr = s->attributes ? s->attributes->bytes : 0;
	const uint64_t n = r->plan.clusters, last = wh_plan_final_limit(&r->sizes);
	/* clusters are not all of one size */
	const uint64_t nf = n > 1 ? 2 * (s->nf / n) : s->nf, nv = n > 1 ? 2 * (s->nv / n) : s->nv;
	const uint64_t final_f = n > 1 && last < s->nf ? last : s->nf,
	               final_v = final_f < s->nv ? final_f : s->nv;
	wh_store store = {0};
	wh_ingest_describe(s, r->plan.clusters, &store);
	return wh_store_scratch_bytes(&store, nv, nf) + wh_patch_bytes(nv, nf, attr, 0) +
	       wh_patch_bytes(final_v, final_f, attr, 0);
}

wh_code wh_run_refuse_record(wh_run *r)
{
	const wh_source *s = &r->input.source;
	const uint32_t attr = s->attributes ? s->attributes->bytes : 0;
	if (!r->params->progressive)
		return WH_OK;
	if (s->wedges)
		return wh_fail(
		    r->c, WH_E_USAGE,
		    "'%s': texture coordinates, normals and materials of faces cannot be "
		    "recorded: leave them out with --attributes none, or name the "
		    "properties of vertices that matter",
		    r->params->input);
	if (s->nv >= UINT32_MAX || s->nf >= UINT32_MAX / 4)
		return wh_fail(r->c, WH_E_PLAN,
		               "'%s' has more than 1 G faces: too many to be recorded",
		               r->params->input);
	const size_t need = wh_progressive_bytes(s->nv, s->nf, attr) + loading_bytes(r);
	if (r->plan.least < need + WH_PLAN_BASE)
		r->plan.least = need + WH_PLAN_BASE;
	if (need > wh_run_budget(r))
		return wh_run_too_small(r, "recording the collapses", need);
	return r->plan.streams ? wh_run_refuse_streamed(r) : WH_OK;
}

wh_code wh_run_refuse_streamed(wh_run *r)
{
	return wh_fail(r->c, WH_E_USAGE,
	               "the base of a progressive mesh goes through one last pass, from %llu faces "
	               "at most: ask for fewer, or raise --final-faces",
	               (unsigned long long)wh_plan_final_limit(&r->sizes));
}

void wh_run_keep_origin(wh_run *r)
{
	if (!r->params->progressive)
		return;
	r->origin = r->store;
	r->sequence = (wh_sequence){.spill = &r->spill, .attr_bytes = r->store.attr_bytes};
}

bool wh_run_is_origin(const wh_run *r, const wh_store *store)
{
	return r->params->progressive && store->generation == r->origin.generation;
}

/* ---- the finest mesh and its collapses ---------------------------------------------------- */

/* Arrays on their way to algo/progressive. */
typedef struct record {
	wh_run *r;
	wh_progressive_run run;
	double unscale;
} record;

static bool make_room(wh_ctx *c, record *k, uint64_t nf, uint64_t steps)
{
	wh_progressive_run *run = &k->run;
	if (nf >= UINT32_MAX / 4 || steps >= UINT32_MAX) {
		(void)wh_fail(c, WH_E_PLAN, "too many faces to be recorded");
		return false;
	}
	run->nf = (uint32_t)nf;
	run->pos = wh_alloc(c, run->nv, sizeof *run->pos);
	run->tri = wh_alloc(c, 3 * (size_t)nf, sizeof *run->tri);
	run->step = wh_calloc(c, (size_t)steps + 1, sizeof *run->step);
	if (run->attr_bytes) {
		run->attr = wh_alloc(c, run->nv, run->attr_bytes);
		run->step_attr = wh_alloc(c, (size_t)steps, run->attr_bytes);
	}
	return run->pos && run->tri && run->step &&
	       (run->attr_bytes == 0 || (run->attr && run->step_attr));
}

/* Appends a cluster's faces, and puts its vertices where their global ids say. */
static wh_code add_cluster(wh_ctx *c, record *k, const wh_patch *p, uint32_t *nf)
{
	wh_progressive_run *run = &k->run;
	const size_t n = run->attr_bytes;
	if (p->nf > run->nf - *nf)
		return wh_fail(c, WH_E_RUN, "a temporary file has too many faces");
	for (uint32_t v = 0; v < p->nv; v++) {
		if (p->gid[v] >= run->nv)
			return wh_fail(c, WH_E_RUN, "a temporary file has a vertex too many");
		run->pos[p->gid[v]] = wh_scale(p->pos[v], k->unscale);
		if (n)
			memcpy(run->attr + p->gid[v] * n, wh_patch_attr(p, v), n);
	}
	uint32_t *to = &run->tri[3 * (size_t)*nf];
	for (size_t i = 0; i < 3 * (size_t)p->nf; i++)
		to[i] = (uint32_t)p->gid[p->tri[i]];
	*nf += p->nf;
	return WH_OK;
}

static wh_code load_mesh(wh_ctx *c, record *k)
{
	const wh_store *store = &k->r->origin;
	wh_store_scratch scratch = {0};
	wh_patch one = {.attr_bytes = store->attr_bytes};
	uint32_t nf = 0;
	wh_code code = WH_OK;
	for (uint32_t i = 0; code == WH_OK && i < store->clusters; i++) {
		code = wh_store_load(c, store, i, &scratch, &one);
		if (code == WH_OK)
			code = add_cluster(c, k, &one, &nf);
		wh_progress_add(&k->r->progress, one.nf);
	}
	wh_store_scratch_free(c, &scratch);
	wh_patch_free(c, &one);
	if (code == WH_OK)
		wh_round_remove(store);
	return code;
}

static wh_code add_step(wh_ctx *c, void *to, const wh_sequence_item *item, const uint8_t *attr)
{
	record *k = to;
	wh_progressive_run *run = &k->run;
	(void)c;
	const uint32_t none = WH_NONE;
	run->step[run->steps] =
	    (wh_progressive_step){.u = item->u < run->nv ? (uint32_t)item->u : none,
	                          .v = item->v < run->nv ? (uint32_t)item->v : none,
	                          .at = wh_scale(item->at, k->unscale),
	                          .cost = item->cost,
	                          .err = item->err * (float)k->unscale};
	if (run->attr_bytes)
		memcpy(run->step_attr + (size_t)run->steps * run->attr_bytes, attr,
		       run->attr_bytes);
	run->steps++;
	return WH_OK;
}

static wh_code load_all(wh_ctx *c, record *k)
{
	uint64_t max_v, max_f, faces, vertices, steps;
	if (wh_round_extent(c, &k->r->origin, &max_v, &max_f, &faces, &vertices) != WH_OK ||
	    wh_sequence_count(c, &k->r->sequence, &steps) != WH_OK)
		return c->err.code;
	if (!make_room(c, k, faces, steps) || load_mesh(c, k) != WH_OK)
		return wh_failed(c);
	return wh_sequence_each(c, &k->r->sequence, add_step, k);
}

static wh_code write_record(wh_run *r, wh_outfile *out)
{
	const wh_source *s = &r->input.source;
	record k = {.r = r,
	            .unscale = 1 / r->ingest.scale,
	            .run = {.nv = (uint32_t)s->nv,
	                    .attr_bytes = r->origin.attr_bytes,
	                    .attributes = r->origin.attr_bytes ? s->attributes : NULL,
	                    .base = &r->patch,
	                    .coord_bytes = s->is_double ? 8 : 4,
	                    .input_bytes = r->report->input_bytes,
	                    .diagonal = r->report->diagonal}};
	wh_code code = load_all(r->c, &k);
	if (code == WH_OK)
		code = wh_progressive_write(r->c, out, &k.run);
	wh_free(r->c, k.run.pos);
	wh_free(r->c, k.run.tri);
	wh_free(r->c, k.run.attr);
	wh_free(r->c, k.run.step);
	wh_free(r->c, k.run.step_attr);
	return code;
}

wh_code wh_run_write_record(wh_run *r, wh_outfile **out)
{
	wh_run_phase_begin(r);
	wh_progress_phase(&r->progress, "record", r->ingest.faces);
	wh_code code = write_record(r, *out);
	r->report->output_vertices = r->patch.nv;
	r->report->output_faces = r->patch.nf;
	r->report->collapses = r->work.collapses;
	if (code == WH_OK)
		code = wh_run_commit(r, out);
	return wh_run_phase_end(r, WH_PHASE_WRITE, code);
}
