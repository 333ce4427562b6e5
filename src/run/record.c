/*
 * A run that is recorded. Its collapses are kept as they are made, cluster by cluster; at the end
 * they are put in order, and what is written is not the result but the way there.
 *
 * What the collapses do not tell is refused: changes of topology, and what faces carry. So is a
 * base that would be streamed, before anything is done.
 */
#include "run/run.h"

#include "pipeline/finish.h"
#include "pipeline/splits.h"

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
	if (p->smooth || p->normals)
		return wh_fail(c, WH_E_USAGE,
		               "smoothing and normals are no collapses, and cannot be recorded: "
		               "leave them out");
	if (p->to || p->ascii || p->quantize)
		return wh_fail(c, WH_E_USAGE,
		               "the form of a mesh is chosen when it is replayed: leave it out");
	return WH_OK;
}

/* ---- before it begins --------------------------------------------------------------------- */

/* Temporary disk that a face takes while the splits are sorted (measured), of floats and nothing
 * else. */
static const double SORTED = 200;

static uint64_t sorted_bytes(const wh_run *r)
{
	const wh_source *s = &r->input.source;
	const uint32_t attr = s->attributes ? s->attributes->bytes : 0;
	return (uint64_t)((SORTED + (s->is_double ? 6 * 4 : 0) + 2.0 * attr) * (double)s->nf);
}

/* Of a round over clusters that are not all of one size; of the last pass, and of what is left of
 * it while the splits are sorted. */
static size_t least_bytes(const wh_run *r)
{
	const wh_source *s = &r->input.source;
	const uint32_t attr = s->attributes ? s->attributes->bytes : 0;
	const uint64_t n = r->plan.clusters, last = wh_plan_final_limit(&r->sizes);
	const uint64_t nf = n > 1 ? 5 * (s->nf / n) / 4 : s->nf,
	               nv = n > 1 ? 5 * (s->nv / n) / 4 : s->nv;
	const uint64_t last_f = last < s->nf ? last : s->nf,
	               last_v = last_f < s->nv ? last_f : s->nv;
	const size_t round = r->plan.stage[WH_PLAN_ROUND].need ? r->plan.stage[WH_PLAN_ROUND].need +
	                                                             wh_sequence_bytes(nv, nf, attr)
	                                                       : 0;
	const size_t final =
	    r->plan.stage[WH_PLAN_FINAL].need + wh_sequence_bytes(last_v, last_f, attr);
	const size_t sorting = wh_patch_bytes(last_v, last_f, attr, sizeof(wh_trace_face)) +
	                       last_v * sizeof(wh_vec3) + WH_SPLITS_LEAST;
	const size_t most = round > final ? round : final;
	return most > sorting ? most : sorting;
}

void wh_run_plan_record(wh_run *r)
{
	if (!r->params->progressive)
		return;
	const size_t least = least_bytes(r) + WH_PLAN_BASE;
	const uint64_t sorted = sorted_bytes(r);
	r->plan.least = r->plan.least > least ? r->plan.least : least;
	r->plan.peak_disk = r->plan.peak_disk > sorted ? r->plan.peak_disk : sorted;
}

wh_code wh_run_refuse_record(wh_run *r)
{
	const wh_source *s = &r->input.source;
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
	if (r->plan.streams)
		return wh_run_refuse_streamed(r);
	const size_t need = least_bytes(r);
	return need > wh_run_budget(r) ? wh_run_too_small(r, "recording the collapses", need)
	                               : WH_OK;
}

wh_code wh_run_refuse_streamed(wh_run *r)
{
	return wh_fail(r->c, WH_E_USAGE,
	               "the base of a progressive mesh goes through one last pass, from %llu faces "
	               "at most: ask for fewer, or raise --final-faces",
	               (unsigned long long)wh_plan_final_limit(&r->sizes));
}

void wh_run_begin_record(wh_run *r)
{
	const wh_source *s = &r->input.source;
	if (!r->params->progressive)
		return;
	r->recorded = r->faces;
	r->sequence = (wh_sequence){.spill = &r->spill,
	                            .attributes = r->store.attr_bytes ? s->attributes : NULL,
	                            .coord_bytes = s->is_double ? 8 : 4,
	                            .unscale = 1 / r->ingest.scale};
}

/* ---- at the end --------------------------------------------------------------------------- */

wh_code wh_run_write_record(wh_run *r, wh_outfile **out)
{
	const size_t budget = wh_run_budget(r), base = (size_t)r->patch.nv * sizeof(wh_vec3),
	             held = wh_patch_bytes(r->patch.nv, r->patch.nf, r->patch.attr_bytes,
	                                   r->patch.face_bytes) +
	                    base;
	const wh_splits s = {.sequence = &r->sequence,
	                     .base = &r->patch,
	                     .faces = r->recorded,
	                     .collapses = r->work.collapses,
	                     .input_bytes = r->report->input_bytes,
	                     .diagonal = r->report->diagonal,
	                     .memory =
	                         held + WH_SPLITS_LEAST < budget ? budget - held : WH_SPLITS_LEAST};
	wh_run_phase_begin(r);
	wh_mem_trim(r->c);
	wh_code code = wh_splits_write(r->c, &r->progress, *out, &s);
	r->report->collapses = r->work.collapses;
	r->report->output_vertices = r->patch.nv;
	r->report->output_faces = r->patch.nf;
	if (code == WH_OK)
		code = wh_run_commit(r, out);
	return wh_run_phase_end(r, WH_PHASE_WRITE, code);
}
