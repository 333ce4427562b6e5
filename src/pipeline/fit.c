#include "pipeline/fit.h"

#include <string.h>

enum {
	CHUNK = 32 * 1024,  /* vertices a job */
	SAMPLE = 64 * 1024, /* vertices in the sample, up to twice as many */
	FENCE_WIDTH = 25,   /* on each side, in sizes of the bulk */
	BULK_SHARE = 100,   /* one in so many is left out at either end of an axis, ... */
	BULK_FROM = 8       /* ... and one at least in samples of this size */
};

typedef struct workspace {
	double *xyz;
	void *raw;
	wh_box box;
	double lo[2], hi[2];
} workspace;

typedef struct pass {
	const wh_source *src;
	wh_progress *progress;
	const wh_camera *camera; /* NULL: the first pass */
	const wh_fit *fit;
	workspace *workspace;
	double *sample[3]; /* one axis after the other */
	uint64_t stride;
} pass;

wh_fit wh_fit_none(void)
{
	const wh_vec3 far = {INFINITY, INFINITY, INFINITY};
	const wh_box none = {far, wh_scale(far, -1)};
	return (wh_fit){none, none, {INFINITY, INFINITY}, {-INFINITY, -INFINITY}};
}

static void widen(wh_box *a, const wh_box *b)
{
	a->lo = wh_lower(a->lo, b->lo);
	a->hi = wh_upper(a->hi, b->hi);
}

static bool inside(const wh_box *b, wh_vec3 p)
{
	return p.x >= b->lo.x && p.x <= b->hi.x && p.y >= b->lo.y && p.y <= b->hi.y &&
	       p.z >= b->lo.z && p.z <= b->hi.z;
}

static size_t sample_size(const pass *p)
{
	return (size_t)((p->src->nv + p->stride - 1) / p->stride);
}

/* ---- passes --------------------------------------------------------------------------------- */

static wh_vec3 vertex_at(const workspace *ws, size_t i)
{
	return wh_v3(ws->xyz[3 * i], ws->xyz[3 * i + 1], ws->xyz[3 * i + 2]);
}

static void look_for_box(const pass *p, workspace *ws, uint64_t first, size_t n)
{
	for (size_t i = 0; i < n; i++) {
		const wh_vec3 v = vertex_at(ws, i);
		ws->box.lo = wh_lower(ws->box.lo, v);
		ws->box.hi = wh_upper(ws->box.hi, v);
	}
	const uint64_t from = (first + p->stride - 1) / p->stride;
	for (uint64_t k = from; k * p->stride < first + n; k++)
		for (size_t axis = 0; axis < 3; axis++)
			p->sample[axis][k] = ws->xyz[3 * (k * p->stride - first) + axis];
}

static void look_for_places(const pass *p, workspace *ws, size_t n)
{
	for (size_t i = 0; i < n; i++) {
		const wh_vec3 v = vertex_at(ws, i);
		if (!inside(&p->fit->fence, v))
			continue;
		const wh_pixel_point q = wh_camera_project(p->camera, v);
		if (isnan(q.depth))
			continue;
		const double at[2] = {q.x, q.y};
		for (int k = 0; k < 2; k++) {
			ws->lo[k] = at[k] < ws->lo[k] ? at[k] : ws->lo[k];
			ws->hi[k] = at[k] > ws->hi[k] ? at[k] : ws->hi[k];
		}
	}
}

static wh_code look_job(wh_ctx *c, void *arg, int64_t index, int worker)
{
	const pass *p = arg;
	workspace *ws = &p->workspace[worker];
	const uint64_t first = (uint64_t)index * CHUNK, left = p->src->nv - first;
	const size_t n = left < CHUNK ? (size_t)left : CHUNK;
	if (wh_source_vertices(c, p->src, first, n, ws->xyz, ws->raw) != WH_OK)
		return c->err.code;
	if (p->camera)
		look_for_places(p, ws, n);
	else
		look_for_box(p, ws, first, n);
	wh_progress_add(p->progress, n);
	return WH_OK;
}

size_t wh_fit_bytes(const wh_source *s, const wh_exec *ex)
{
	const size_t each =
	    (size_t)CHUNK * 24 + wh_source_vertex_bytes(s, CHUNK) + sizeof(workspace);
	return (size_t)ex->workers * each + (size_t)2 * SAMPLE * 24;
}

static wh_code open_pass(wh_ctx *c, const wh_exec *ex, pass *p)
{
	p->stride = p->src->nv / SAMPLE + 1;
	p->workspace = wh_calloc(c, (size_t)ex->workers, sizeof *p->workspace);
	for (int i = 0; p->workspace && i < ex->workers; i++) {
		const wh_fit none = wh_fit_none();
		workspace *ws = &p->workspace[i];
		*ws = (workspace){.box = none.box,
		                  .lo = {none.lo[0], none.lo[1]},
		                  .hi = {none.hi[0], none.hi[1]}};
		ws->xyz = wh_alloc(c, CHUNK, 3 * sizeof *ws->xyz);
		ws->raw = wh_alloc(c, wh_source_vertex_bytes(p->src, CHUNK), 1);
	}
	for (int axis = 0; !p->camera && axis < 3; axis++)
		p->sample[axis] = wh_alloc(c, sample_size(p), sizeof(double));
	return c->err.code;
}

static void close_pass(wh_ctx *c, const wh_exec *ex, pass *p)
{
	for (int axis = 0; axis < 3; axis++)
		wh_free(c, p->sample[axis]);
	for (int i = 0; p->workspace && i < ex->workers; i++) {
		wh_free(c, p->workspace[i].xyz);
		wh_free(c, p->workspace[i].raw);
	}
	wh_free(c, p->workspace);
}

static wh_code run_pass(wh_ctx *c, const wh_exec *ex, pass *p)
{
	wh_code code = open_pass(c, ex, p);
	wh_progress_phase(p->progress, "fit", p->src->nv);
	if (code == WH_OK)
		code = wh_exec_for(c, ex, (int64_t)((p->src->nv + CHUNK - 1) / CHUNK), look_job, p);
	return code;
}

/* ---- fence ---------------------------------------------------------------------------------- */

/* The value of rank k; the values end up in another order (Hoare 1961). */
static double select_rank(double *v, size_t n, size_t k)
{
	size_t lo = 0, hi = n - 1;
	while (lo < hi) {
		const double pivot = v[lo + (hi - lo) / 2];
		size_t i = lo, j = hi;
		for (;;) {
			while (v[i] < pivot)
				i++;
			while (pivot < v[j])
				j--;
			if (i >= j)
				break;
			const double t = v[i];
			v[i++] = v[j];
			v[j--] = t;
		}
		if (k <= j)
			hi = j;
		else
			lo = j + 1;
	}
	return v[k];
}

/* Around a copy's bulk: the sample stays in its order. */
static wh_code find_fence(wh_ctx *c, const pass *p, wh_box *fence)
{
	const size_t n = sample_size(p);
	size_t cut = n / BULK_SHARE;
	double lo[3], hi[3], size = 0;
	double *copy = wh_alloc(c, n, sizeof *copy);
	if (!copy)
		return c->err.code;
	if (cut == 0 && n >= BULK_FROM)
		cut = 1;
	for (int axis = 0; axis < 3; axis++) {
		memcpy(copy, p->sample[axis], n * sizeof *copy);
		lo[axis] = select_rank(copy, n, cut);
		hi[axis] = select_rank(copy, n, n - 1 - cut);
		size = fmax(size, hi[axis] - lo[axis]);
	}
	wh_free(c, copy);
	const double away = size > 0 ? FENCE_WIDTH * size : INFINITY;
	*fence = (wh_box){wh_v3(lo[0] - away, lo[1] - away, lo[2] - away),
	                  wh_v3(hi[0] + away, hi[1] + away, hi[2] + away)};
	return WH_OK;
}

/* The box around the vertices inside the fence: of all when all are, else of the sample's. */
static wh_box box_inside(const pass *p, const wh_box *all, const wh_box *fence)
{
	if (inside(fence, all->lo) && inside(fence, all->hi))
		return *all;
	wh_box b = wh_fit_none().box;
	for (size_t i = 0; i < sample_size(p); i++) {
		const wh_vec3 v = wh_v3(p->sample[0][i], p->sample[1][i], p->sample[2][i]);
		if (inside(fence, v))
			widen(&b, &(wh_box){v, v});
	}
	return b;
}

/* ---- the whole ------------------------------------------------------------------------------ */

wh_code wh_fit_box(wh_ctx *c, const wh_exec *ex, wh_progress *progress, const wh_source *s,
                   wh_fit *f)
{
	pass p = {.src = s, .progress = progress};
	wh_box all = wh_fit_none().box, fence = all;
	if (s->nv == 0)
		return WH_OK;
	wh_code code = run_pass(c, ex, &p);
	if (code == WH_OK)
		code = find_fence(c, &p, &fence);
	if (code == WH_OK) {
		for (int i = 0; i < ex->workers; i++)
			widen(&all, &p.workspace[i].box);
		const wh_box box = box_inside(&p, &all, &fence);
		widen(&f->box, &box);
		widen(&f->fence, &fence);
	}
	close_pass(c, ex, &p);
	return code;
}

wh_code wh_fit_camera(wh_ctx *c, const wh_exec *ex, wh_progress *progress, const wh_source *s,
                      const wh_camera *k, wh_fit *f)
{
	pass p = {.src = s, .progress = progress, .camera = k, .fit = f};
	const wh_code code = run_pass(c, ex, &p);
	for (int i = 0; code == WH_OK && i < ex->workers; i++)
		for (int axis = 0; axis < 2; axis++) {
			f->lo[axis] = fmin(f->lo[axis], p.workspace[i].lo[axis]);
			f->hi[axis] = fmax(f->hi[axis], p.workspace[i].hi[axis]);
		}
	close_pass(c, ex, &p);
	return code;
}
