/*
 * The plan of a run: what the stages will hold in memory and on disk (pipeline/plan), for all of
 * its results and for what comes besides, cleaning and recording. What will not do is refused
 * before anything is done.
 */
#include "run/run.h"

#include "io/mesh_write.h"

/* ---- the plan ----------------------------------------------------------------------------- */

/* Of a body that could be used in place, when rply reads it all the same. */
static uint64_t rply_bytes(const wh_run *r)
{
	const wh_source *s = &r->input.source;
	const uint64_t vertex = (s->is_double ? 24 : 12) + r->input.attributes.bytes;
	if (!r->rply || s->ffd < 0 || s->ffd != r->input.ply.fd)
		return 0;
	return s->nv * vertex + s->nf * (s->nv > UINT32_MAX ? 24 : 12);
}

static wh_plan make_plan(const wh_run *r)
{
	const wh_plan_query q = {.source = wh_input_joined(&r->input),
	                         .doubled = wh_run_style(r).doubled,
	                         .rewrite_bytes = wh_input_temp_bytes(&r->input) +
	                                          wh_run_clean_disk(r) + rply_bytes(r),
	                         .sizes = r->sizes,
	                         .share = wh_run_target_ratio(r),
	                         .state = wh_run_state_bytes(r),
	                         .memory = r->memory,
	                         .threads = r->exec.workers};
	wh_plan p;
	wh_plan_make(&q, &p);
	return p;
}

/* What a run through two plans needs. */
static void join_plans(wh_plan *p, const wh_plan *q)
{
	for (int i = 0; i < WH_PLAN_STAGES; i++) {
		if (q->stage[i].need > p->stage[i].need)
			p->stage[i].need = q->stage[i].need;
		if (q->stage[i].expect > p->stage[i].expect)
			p->stage[i].expect = q->stage[i].expect;
	}
	p->rounds = q->rounds > p->rounds ? q->rounds : p->rounds;
	p->streams = p->streams || q->streams;
	p->least = q->least > p->least ? q->least : p->least;
	p->peak_ram = q->peak_ram > p->peak_ram ? q->peak_ram : p->peak_ram;
	p->peak_disk = q->peak_disk > p->peak_disk ? q->peak_disk : p->peak_disk;
}

/* The last result's plan, and those of the levels before it. */
static void make_plans(wh_run *r)
{
	r->plan = make_plan(r);
	for (size_t i = 0; i < r->params->levels; i++) {
		wh_run_aim(r, i);
		const wh_plan p = make_plan(r);
		if (!wh_run_is_no_smaller(r))
			join_plans(&r->plan, &p);
	}
	wh_run_aim(r, r->params->levels);
}

/* ---- what it has to fit ------------------------------------------------------------------- */

/* A result has no fewer faces than its target, and hardly ever less than half as many vertices. */
static void least_counts(const wh_run *r, uint64_t *nv, uint64_t *nf)
{
	const wh_reduce_report *t = r->report;
	*nf = t->target_faces < t->input_faces ? t->target_faces : t->input_faces;
	*nv = t->target_vertices < t->input_vertices ? t->target_vertices : t->input_vertices;
	if (*nv < *nf / 2)
		*nv = *nf / 2;
}

/* What GLB has no room for is told before it is made. */
static wh_code fits_format(wh_run *r)
{
	uint64_t nv, nf;
	least_counts(r, &nv, &nf);
	return r->to == WH_FORMAT_GLB ? wh_glb_fits(r->c, wh_run_style(r), nv, nf) : WH_OK;
}

/* And what its disk has no room for; how much is left of it when it is packed nobody knows. */
static wh_code fits_disk(wh_run *r)
{
	uint64_t nv, nf;
	least_counts(r, &nv, &nf);
	if (r->packing != WH_PACKING_NONE || r->params->progressive ||
	    (!wh_run_is_last(r) && wh_run_is_no_smaller(r)))
		return WH_OK;
	return wh_outfile_foresee(r->c, r->aim.output,
	                          wh_mesh_least_bytes(wh_run_style(r), nv, nf));
}

static wh_code for_all_results(wh_run *r, wh_code (*fits)(wh_run *r))
{
	wh_code code = WH_OK;
	for (size_t i = 0; code == WH_OK && i < wh_run_results(r); i++) {
		wh_run_aim(r, i);
		code = fits(r);
	}
	wh_run_aim(r, r->params->levels);
	return code;
}

wh_code wh_run_foresee_disks(wh_run *r)
{
	r->spill.planned = r->plan.peak_disk;
	return wh_spill_foresee(r->c, &r->spill) == WH_OK ? for_all_results(r, fits_disk)
	                                                  : r->c->err.code;
}

/* Smoothing and normals are for results that are whole in memory. */
static wh_code fits_polish(wh_run *r)
{
	const wh_polish polish = wh_run_polish(r);
	const wh_ply_style style = wh_run_style(r);
	if (wh_polish_check(r->c, &polish, &style) != WH_OK)
		return r->c->err.code;
	return r->plan.streams && wh_polish_is_any(&polish) ? wh_run_refuse_polish(r) : WH_OK;
}

/* Cleaning comes before the stages of the plan. */
static wh_code fits_cleaning(wh_run *r)
{
	const size_t need = wh_run_clean_bytes(r);
	if (need && r->plan.least < need + WH_PLAN_BASE)
		r->plan.least = need + WH_PLAN_BASE;
	return need > wh_run_budget(r) ? wh_run_too_small(r, "cleaning the vertices", need) : WH_OK;
}

static wh_code fits_stages(wh_run *r)
{
	int most = 0;
	for (int i = 1; i < WH_PLAN_STAGES; i++)
		if (r->plan.stage[i].need > r->plan.stage[most].need)
			most = i;
	if (r->plan.stage[most].need <= wh_run_budget(r))
		return WH_OK;
	return wh_run_too_small(r, wh_plan_stage_name((wh_plan_stage)most), 0);
}

wh_code wh_run_plan(wh_run *r)
{
	make_plans(r);
	if (for_all_results(r, fits_format) != WH_OK || fits_polish(r) != WH_OK)
		return r->c->err.code;
	wh_run_plan_record(r);
	if (fits_cleaning(r) != WH_OK || fits_stages(r) != WH_OK)
		return r->c->err.code;
	return wh_run_refuse_record(r);
}
