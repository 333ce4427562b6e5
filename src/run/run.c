#define _GNU_SOURCE
#include "run/run.h"

#include "base/timer.h"
#include "io/mesh_write.h"

#include <math.h>

_Static_assert((int)WH_SCALING == (int)WH_EXEC_POWERS, "the report holds what exec foretells");

/* Below it smaller clusters are no advice to give. */
enum { SMALL_CLUSTER = 64 * 1024 };

wh_code wh_run_needs_files(wh_ctx *c, const wh_reduce_params *p)
{
	if (!p->input || !p->output)
		return wh_fail(c, WH_E_USAGE, "no %s is named", p->input ? "output" : "input");
	return WH_OK;
}

static uint64_t bytes_read(wh_run *r)
{
	return r->report->bytes_read + atomic_load(&r->spill.bytes_read);
}

uint64_t wh_run_bytes_written(wh_run *r)
{
	uint64_t n = r->report->output_bytes + atomic_load(&r->spill.bytes_written);
	for (size_t i = 0; i < r->params->levels; i++)
		n += r->report->level[i].bytes;
	return n;
}

void wh_run_phase_begin(wh_run *r)
{
	r->stats = (wh_exec_stats){0};
	r->phase_read = bytes_read(r);
	r->phase_written = wh_run_bytes_written(r);
	r->phase_start = wh_seconds();
	atomic_store(&r->c->mem->high, atomic_load(&r->c->mem->used));
}

wh_code wh_run_phase_end(wh_run *r, wh_phase phase, wh_code code)
{
	const double seconds = wh_seconds() - r->phase_start, serial = seconds - r->stats.loops;
	wh_phase_report *p = &r->report->phase[phase];
	p->seconds += seconds;
	p->serial += serial;
	p->busy += serial + r->stats.busy;
	for (int k = 0; k < WH_SCALING; k++)
		p->model[k] += serial + r->stats.model[k];
	p->bytes_read += bytes_read(r) - r->phase_read;
	p->bytes_written += wh_run_bytes_written(r) - r->phase_written;
	const uint64_t high = atomic_load(&r->c->mem->high);
	p->memory_peak = high > p->memory_peak ? high : p->memory_peak;
	return code;
}

/* ---- budget ------------------------------------------------------------------------------- */

size_t wh_run_budget(const wh_run *r)
{
	return r->memory > WH_PLAN_BASE ? r->memory - WH_PLAN_BASE : 0;
}

/* A refusal names a ceiling that does for all stages. */
wh_code wh_run_too_small(wh_run *r, const char *what, size_t need)
{
	const size_t least = ((need + WH_PLAN_BASE) >> 20) + 2, planned = r->plan.least >> 20;
	const uint64_t each = r->params->cluster_faces;
	return wh_fail(r->c, WH_E_PLAN,
	               "%s needs more memory than the ceiling of %zu MiB: use --memory %zuM%s",
	               what, r->memory >> 20, least > planned ? least : planned,
	               each == 0 || each > SMALL_CLUSTER
	                   ? ", or less with smaller clusters (--cluster-faces 64k)"
	                   : "");
}

wh_exec wh_run_workers(const wh_run *r, size_t each)
{
	const size_t fits = wh_run_budget(r) / each;
	wh_exec ex = r->exec;
	if ((size_t)ex.workers > fits)
		ex.workers = fits > 1 ? (int)fits : 1;
	return ex;
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
void wh_run_targets(wh_run *r)
{
	const wh_level *a = &r->aim;
	r->report->target_faces = loosest_limit(a->faces, a->face_ratio, r->report->input_faces);
	r->report->target_vertices = loosest_limit(
	    a->vertices, a->vertex_ratio, r->report->input_vertices - r->report->joined_vertices);
}

void wh_run_limit_error(wh_run *r)
{
	r->max_err = INFINITY;
	if (r->aim.error > 0)
		r->max_err = r->aim.error;
	if (r->aim.error_share > 0)
		r->max_err = fmin(r->max_err, r->aim.error_share * r->report->diagonal);
}

static double larger_of(double a, double b)
{
	return a > b ? a : b;
}

double wh_run_target_ratio(const wh_run *r)
{
	const wh_reduce_report *t = r->report;
	double ratio = 0;
	if (t->target_faces)
		ratio = (double)t->target_faces / (double)r->faces;
	if (t->target_vertices) {
		const double as_faces = (double)t->target_vertices * (double)t->input_faces /
		                        (double)(t->input_vertices - t->joined_vertices);
		ratio = larger_of(ratio, as_faces / (double)r->faces);
	}
	return ratio;
}

bool wh_run_is_no_smaller(const wh_run *r)
{
	const wh_reduce_report *t = r->report;
	return (t->target_faces && t->target_faces >= t->input_faces) ||
	       (t->target_vertices && t->target_vertices >= t->input_vertices);
}

bool wh_run_copies(const wh_run *r)
{
	if (r->to != r->input.ply.kind || wh_run_has_hygiene(r) || r->params->progressive ||
	    r->params->smooth || r->params->normals)
		return false;
	if (r->params->ascii && r->input.ply.format != WH_PLY_ASCII)
		return false;
	return wh_run_is_no_smaller(r);
}

/* Vertices that are left. */
uint64_t wh_run_vertices(const wh_run *r)
{
	const wh_reduce_report *t = r->report;
	return t->input_vertices + t->nonmanifold_split - t->unreferenced_vertices -
	       t->invalid_vertices - t->welded_vertices - t->joined_vertices -
	       t->component_vertices - (uint64_t)r->work.vertices;
}

wh_wanted wh_run_wanted(const wh_run *r)
{
	uint32_t holds = wh_mesh_holds(r->to);
	if (r->rply) /* takes along nothing of faces */
		holds &= ~(uint32_t)(WH_HOLDS_FACES | WH_HOLDS_CORNERS);
	/* what is cleaned is what the file has: its vertices along the borders of charts, too */
	if (wh_run_has_hygiene(r))
		holds |= WH_HOLDS_APART;
	return (wh_wanted){r->params->attributes, holds};
}

/* The attributes of vertices that are doubled where their corners differ, as the input or the
 * output has them; NULL: corners have their own, or nothing. */
static const wh_attributes *doubled(const wh_run *r)
{
	const wh_input *in = &r->input;
	const wh_wedges *w = &in->wedges;
	const bool vertices_only =
	    r->to == WH_FORMAT_OFF || r->to == WH_FORMAT_GLB ||
	    (r->to == WH_FORMAT_PLY && (w->of_vertices || w->corner.has_normal));
	return w->corner.n && vertices_only ? &in->whole : NULL;
}

/* The one texture that the input names; the texture of one among several belongs to no mesh. */
static const char *only_texture(const wh_run *r)
{
	const wh_names *l = r->input.wedges.textures;
	return r->input.wedges.corner.n && l && l->n == 1 ? l->item[0] : NULL;
}

wh_ply_style wh_run_style(const wh_run *r)
{
	return (wh_ply_style){.ascii = r->params->ascii,
	                      .is_double = r->input.source.is_double,
	                      .format = r->to,
	                      .quantize = r->params->quantize,
	                      .attributes = r->input.source.attributes,
	                      .wedges = r->input.source.wedges,
	                      .doubled = doubled(r),
	                      .texture = only_texture(r)};
}

wh_polish wh_run_polish(const wh_run *r)
{
	return (wh_polish){r->params->smooth, r->params->normals};
}

wh_code wh_run_refuse_polish(wh_run *r)
{
	return wh_fail(r->c, WH_E_PLAN,
	               "a result is smoothed, and gets normals, in memory, from %llu faces at most "
	               "before the last pass: ask for fewer, or raise --final-faces",
	               (unsigned long long)wh_plan_final_limit(&r->sizes));
}

wh_code wh_run_take_policy(wh_run *r)
{
	const wh_reduce_params *p = r->params;
	wh_policy_choice *k = &r->policy;
	if (p->cost && !wh_cost_parse(p->cost, &k->cost))
		return wh_fail(r->c, WH_E_USAGE,
		               "'%s' is no cost: give memoryless, qem, qem-normals, melax or "
		               "edge-length",
		               p->cost);
	if (p->face_weight && !wh_weight_parse(p->face_weight, &k->weight))
		return wh_fail(r->c, WH_E_USAGE, "'%s' is no weight: give area, uniform or angle",
		               p->face_weight);
	if (p->placement && !wh_placement_parse(p->placement, &k->placement))
		return wh_fail(r->c, WH_E_USAGE,
		               "'%s' is no placement: give optimal, midpoint or endpoint",
		               p->placement);
	k->own = p->own;
	k->cost = p->own ? WH_COST_OWN : k->cost;
	if (k->cost == WH_COST_MEMORYLESS)
		return WH_OK;
	/* what those two weigh against collapses is in the units of the memoryless cost */
	if (p->simplify_topology || p->weights)
		return wh_fail(r->c, WH_E_USAGE,
		               "%s goes with the memoryless cost only: leave out the one or the "
		               "other",
		               p->weights ? "a weight of properties" : "--topology simplify");
	return WH_OK;
}

size_t wh_run_state_bytes(const wh_run *r)
{
	return wh_policy_bytes(&r->policy) +
	       wh_simplify_attribute_bytes(r->input.source.attributes);
}

wh_simplify_params wh_run_engine(const wh_run *r)
{
	wh_policy_choice policy = r->policy;
	policy.unscale = 1 / r->ingest.scale;
	return (wh_simplify_params){.max_cost = INFINITY,
	                            .max_err = r->max_err * r->ingest.scale,
	                            .track_err = r->params->progressive,
	                            .fast = r->params->fast,
	                            .free_topology = r->params->simplify_topology,
	                            .lock_boundary = r->params->lock_boundary,
	                            .float_positions = !r->input.source.is_double,
	                            .step = r->ingest.step,
	                            .policy = policy,
	                            .attributes = r->input.source.attributes,
	                            .wedges = r->input.source.wedges,
	                            .attribute_unit = r->report->diagonal * r->ingest.scale / 100};
}

void wh_run_note_unreferenced(wh_run *r, uint64_t n)
{
	if (n)
		r->report->unreferenced_vertices = n;
}

/* ---- the result --------------------------------------------------------------------------- */

wh_plan_sizes wh_run_sizes(const wh_reduce_params *p)
{
	return (wh_plan_sizes){p->cluster_faces, p->micro_faces, p->final_faces, p->round_keep};
}

void wh_run_note_check(wh_run *r, const wh_check *found)
{
	wh_reduce_report *t = r->report;
	t->checked = true;
	t->boundary_edges = found->boundary_edges;
	t->nonmanifold_edges = found->nonmanifold_edges;
	t->misoriented_edges = found->misoriented_edges;
	t->nonmanifold_vertices = found->nonmanifold_vertices;
	t->output_duplicate_faces = found->duplicate_faces;
	t->output_zero_area_faces = found->zero_area_faces;
	t->folded_edges = found->folded_edges;
	t->components = found->components;
	t->boundary_loops = found->boundary_loops;
	t->euler = found->euler;
}
