/*
 * Distances are measured where they are seen: from the point that each pixel's nearest sample
 * shows, so that their number is that of the pixels, whatever the mesh, and a large flat face has
 * its error inside of it and not that of its corners. Their precision is that of a sample's depth,
 * some 10^-7 of the mesh's size.
 */
#include "mesh/bvh.h"
#include "pipeline/picture_parts.h"

#include <string.h>

static const double BEYOND = 0.005;     /* share of the pixels that may be beyond the last colour */
static const double RANGE_LEAST = 1e-6; /* of the diagonal: what precision allows */

typedef struct measuring {
	wh_draw *d;
	const wh_bvh *tree;
	const wh_frame *frame;
	wh_draw_cell *cell;
} measuring;

static wh_vec3 place_of(const wh_draw *d, const wh_draw_cell *cell, uint32_t x, uint32_t y)
{
	const uint32_t w = d->p->width, h = d->p->height;
	const wh_pixel *p = cell->pixels + (size_t)y * w + x;
	return wh_camera_unproject(&cell->camera, wh_render_point(w, h, d->p->samples, x, y, p));
}

/* The box around the other mesh and all that is seen. */
static wh_box box_of_all(const wh_draw *d, const wh_mesh *m)
{
	wh_box b = wh_fit_none().box;
	for (size_t i = 0; i < 3 * (size_t)m->nf; i++) {
		b.lo = wh_lower(b.lo, m->pos[m->tri[i]]);
		b.hi = wh_upper(b.hi, m->pos[m->tri[i]]);
	}
	for (int i = 0; i < d->p->ncells; i++)
		for (uint32_t y = 0; y < d->p->height; y++)
			for (uint32_t x = 0; x < d->p->width; x++) {
				const wh_draw_cell *cell = &d->cell[i];
				if (!cell->pixels[(size_t)y * d->p->width + x].covered)
					continue;
				const wh_vec3 at = place_of(d, cell, x, y);
				b.lo = wh_lower(b.lo, at);
				b.hi = wh_upper(b.hi, at);
			}
	return b;
}

static wh_code measure_job(wh_ctx *c, void *arg, int64_t index, int worker)
{
	const measuring *s = arg;
	const uint32_t w = s->d->p->width, y = (uint32_t)index;
	float *out = s->cell->distance + (size_t)y * w;
	uint32_t hint = WH_NONE;
	(void)c;
	(void)worker;
	for (uint32_t x = 0; x < w; x++) {
		out[x] = 0;
		if (!s->cell->pixels[(size_t)y * w + x].covered)
			continue;
		const wh_vec3 p = wh_frame_local(s->frame, place_of(s->d, s->cell, x, y));
		out[x] = (float)(sqrt(wh_bvh_dist2(s->tree, p, &hint)) / s->frame->scale);
	}
	wh_progress_add(&s->d->progress, w);
	return WH_OK;
}

static wh_code measure_cells(wh_draw *d, const wh_bvh *tree, const wh_frame *frame)
{
	const uint32_t h = d->p->height;
	const size_t pixels = (size_t)d->p->width * h;
	wh_code code = WH_OK;
	wh_progress_phase(&d->progress, "distance", pixels * (uint64_t)d->p->ncells);
	for (int i = 0; code == WH_OK && i < d->p->ncells; i++) {
		measuring s = {d, tree, frame, &d->cell[i]};
		s.cell->distance = wh_alloc(d->c, pixels, sizeof *s.cell->distance);
		code = s.cell->distance ? wh_exec_for(d->c, d->ex, h, measure_job, &s)
		                        : d->c->err.code;
	}
	return code;
}

static wh_code measure_from(wh_draw *d, const wh_mesh *m)
{
	wh_bvh tree = {0};
	const wh_box all = box_of_all(d, m);
	const wh_frame frame = wh_frame_of_box(all.lo, all.hi);
	wh_code code = wh_bvh_build(d->c, d->ex, m, &frame, &tree);
	if (code == WH_OK)
		code = measure_cells(d, &tree, &frame);
	wh_bvh_free(d->c, &tree);
	return code;
}

/* ---- range ---------------------------------------------------------------------------------- */

enum { BINS = 4096 };

/* A number with few digits that is no less. */
static double round_up(double x)
{
	static const double steps[] = {1, 1.5, 2, 3, 4, 5, 6, 8, 10};
	double unit = 1;
	while (unit * 10 <= x)
		unit *= 10;
	while (unit > x)
		unit /= 10;
	size_t i = 0;
	while (steps[i] * unit < x && i + 1 < sizeof steps / sizeof *steps)
		i++;
	return steps[i] * unit;
}

/* Distances of the pixels, counted in equal bins up to the largest. */
static uint64_t count_distances(const wh_draw *d, double most, uint64_t bins[BINS])
{
	uint64_t n = 0;
	const size_t pixels = (size_t)d->p->width * d->p->height;
	for (int i = 0; i < d->p->ncells; i++)
		for (size_t k = 0; k < pixels; k++) {
			if (!d->cell[i].pixels[k].covered)
				continue;
			const double x = (double)d->cell[i].distance[k] / most * BINS;
			bins[x < BINS ? (size_t)x : BINS - 1]++;
			n++;
		}
	return n;
}

static double find_most(const wh_draw *d)
{
	const size_t pixels = (size_t)d->p->width * d->p->height;
	double most = 0;
	for (int i = 0; i < d->p->ncells; i++)
		for (size_t k = 0; k < pixels; k++)
			most = fmax(most, (double)d->cell[i].distance[k]);
	return most;
}

static double suitable_range(const wh_draw *d, double most)
{
	uint64_t bins[BINS] = {0};
	double range = 0;
	if (most > 0) {
		uint64_t left = (uint64_t)((double)count_distances(d, most, bins) * BEYOND);
		int k = BINS - 1;
		while (k > 0 && bins[k] <= left)
			left -= bins[k--];
		range = most * (k + 1) / BINS;
	}
	return round_up(fmax(range, RANGE_LEAST * 2 * d->cell[0].camera.unit));
}

/* ---- the whole ------------------------------------------------------------------------------ */

wh_code wh_draw_distances(wh_draw *d)
{
	wh_mesh m = {0};
	wh_progress_phase(&d->progress, "distance", 1);
	wh_code code =
	    wh_load_mesh(d->c, d->ex, &d->spill, d->p->distance_to, WH_FORMAT_ANY, &m, NULL, NULL);
	if (code == WH_OK)
		code = measure_from(d, &m);
	wh_mesh_free(d->c, &m);
	if (code != WH_OK)
		return code;
	const double most = find_most(d);
	d->r->distance_max = most;
	d->r->range = d->p->range > 0 ? d->p->range : suitable_range(d, most);
	return WH_OK;
}
