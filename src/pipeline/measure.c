#include "pipeline/measure.h"

#include "exec/topo.h"
#include "pipeline/points.h"
#include "pipeline/surface.h"

enum {
	BASE_BYTES = 12 * 1024 * 1024, /* program, libraries, stacks, small allocations */
	OPEN_BYTES = 32 * 1024 * 1024  /* enough to look at the input and to refuse it in words */
};

typedef struct measuring {
	wh_ctx *c;
	const wh_exec *ex;
	wh_spill *spill;
	wh_progress *progress;
	const wh_measure_job *job;
	size_t held; /* by others, when it began */
} measuring;

/* Bytes that are left. */
static size_t room(const measuring *m)
{
	const size_t held = atomic_load(&m->c->mem->used) - m->held;
	return m->job->budget > held ? m->job->budget - held : 1;
}

static wh_code open_surface(const measuring *m, const char *path, wh_format from, bool numbered,
                            uint32_t number, wh_surface *s)
{
	const wh_surface_params p = {.path = path,
	                             .from = from,
	                             .colours = true,
	                             .numbered = numbered,
	                             .number = number,
	                             .budget = room(m)};
	return wh_surface_open(m->c, m->ex, m->spill, m->progress, &p, m->job->ceiling, s);
}

static void tell(void *user, uint64_t n)
{
	wh_progress_add(user, n);
}

static wh_code compare(const measuring *m, wh_surface *a, wh_surface *b, wh_compare *r)
{
	const wh_measure_job *job = m->job;
	const wh_compare_params p = {.samples = job->samples,
	                             .seed = job->seed,
	                             .ncuts = job->ncuts,
	                             .fetch_cuts = job->cuts,
	                             .cuts_user = job->cuts_user,
	                             .memory = room(m),
	                             .tell = tell,
	                             .tell_user = m->progress};
	wh_progress_phase(m->progress, "measure",
	                  2 * wh_compare_samples(&a->tree, &b->tree, &p) + a->tree.vertices +
	                      b->tree.vertices);
	return wh_compare_surfaces(m->c, m->ex, &a->tree, &b->tree, &p, r);
}

/* Opens another file and measures a against it. */
static wh_code compare_with(const measuring *m, wh_surface *a, const wh_measure_other *other,
                            uint32_t number)
{
	wh_surface b;
	wh_code code = open_surface(m, other->path, other->from, m->job->cuts != NULL, number, &b);
	if (code == WH_OK)
		code = compare(m, a, &b, other->result);
	wh_surface_close(m->c, &b);
	return code;
}

wh_code wh_measure(wh_ctx *c, const wh_exec *ex, wh_spill *spill, wh_progress *progress,
                   const wh_measure_job *job, uint32_t number)
{
	const measuring m = {c, ex, spill, progress, job, atomic_load(&c->mem->used)};
	wh_surface a;
	wh_code code = open_surface(&m, job->a, job->from, false, number, &a);
	for (size_t i = 0; code == WH_OK && i < job->others; i++)
		code = compare_with(&m, &a, &job->other[i], number + 1 + (uint32_t)i);
	wh_surface_close(c, &a);
	return code;
}

/* ---- as a process of its own ---------------------------------------------------------------- */

static wh_code measure_in(wh_ctx *c, const wh_exec *ex, wh_spill *spill, const wh_measure_params *p,
                          size_t memory)
{
	wh_progress progress = {
	    .fn = p->progress, .user = p->progress_user, .telling = ATOMIC_FLAG_INIT};
	wh_measure_job job = {.a = p->a,
	                      .from = p->from,
	                      .other = p->other,
	                      .others = p->others,
	                      .samples = p->samples,
	                      .seed = p->seed,
	                      .ceiling = memory,
	                      .budget = memory > BASE_BYTES ? memory - BASE_BYTES : 1};
	wh_points points = {0};
	if (p->seams && wh_points_open(c, p->seams, &points) != WH_OK)
		return c->err.code;
	if (p->seams) {
		job.cuts = wh_points_get;
		job.cuts_user = &points;
		job.ncuts = points.n;
	}
	const wh_code code = wh_measure(c, ex, spill, &progress, &job, 0);
	wh_points_close(c, &points);
	return code;
}

wh_code wh_measure_files(wh_ctx *c, const wh_exec *ex, const wh_measure_params *p)
{
	const size_t memory = p->memory ? p->memory : wh_topo_memory() / 2;
	const size_t old_limit = c->mem->limit;
	wh_spill spill;
	c->mem->limit = memory > OPEN_BYTES ? memory - BASE_BYTES / 2 : OPEN_BYTES;
	wh_code code = wh_spill_open(c, &spill, p->temp_dir, p->fallback ? p->fallback : "/tmp");
	if (code == WH_OK) {
		code = measure_in(c, ex, &spill, p, memory);
		wh_spill_close(c, &spill);
	}
	wh_mem_trim(c);
	c->mem->limit = old_limit;
	return code;
}
