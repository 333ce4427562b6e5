/*
 * Distances are measured where they are seen: from the point that each pixel's nearest sample
 * shows, so that their number is that of the pixels, whatever the mesh, and a large flat face has
 * its error inside of it and not that of its corners. Their precision is that of a sample's depth,
 * some 10^-7 of the mesh's size.
 */
#include "pipeline/picture_parts.h"
#include "pipeline/surface.h"

#include <string.h>

static const double BEYOND = 0.005;     /* share of the pixels that may be beyond the last colour */
static const double RANGE_LEAST = 1e-6; /* of the diagonal: what precision allows */

/* Pages that a worker keeps, at least, where they do not all fit. */
enum { SLOTS = 16 };

typedef struct measuring {
	wh_draw *d;
	const wh_bvh *tree;
	wh_bvh_reader *reader; /* one a worker */
	wh_draw_cell *cell;
} measuring;

static wh_vec3 place_of(const wh_draw *d, const wh_draw_cell *cell, uint32_t x, uint32_t y)
{
	const uint32_t w = d->p->width, h = d->p->height;
	const wh_pixel *p = cell->pixels + (size_t)y * w + x;
	return wh_camera_unproject(&cell->camera, wh_render_point(w, h, d->p->samples, x, y, p));
}

static wh_code measure_job(wh_ctx *c, void *arg, int64_t index, int worker)
{
	const measuring *s = arg;
	const wh_frame *frame = &s->tree->frame;
	const uint32_t w = s->d->p->width, y = (uint32_t)index;
	float *out = s->cell->distance + (size_t)y * w;
	wh_bvh_face near = {WH_NONE, 0};
	for (uint32_t x = 0; x < w; x++) {
		double d2;
		out[x] = 0;
		if (!s->cell->pixels[(size_t)y * w + x].covered)
			continue;
		const wh_vec3 p = wh_frame_local(frame, place_of(s->d, s->cell, x, y));
		if (wh_bvh_nearest(c, &s->reader[worker], p, &near, &d2) != WH_OK)
			return c->err.code;
		out[x] = (float)(sqrt(d2) / frame->scale);
	}
	wh_progress_add(&s->d->progress, w);
	return WH_OK;
}

static wh_code measure_cells(wh_draw *d, const wh_exec *ex, const wh_bvh *tree,
                             wh_bvh_reader *reader)
{
	const uint32_t h = d->p->height;
	const size_t pixels = (size_t)d->p->width * h;
	wh_code code = WH_OK;
	wh_progress_phase(&d->progress, "distance", pixels * (uint64_t)d->p->ncells);
	for (int i = 0; code == WH_OK && i < d->p->ncells; i++) {
		measuring s = {d, tree, reader, &d->cell[i]};
		code = wh_exec_for(d->c, ex, h, measure_job, &s);
	}
	return code;
}

static wh_code make_tree(wh_draw *d, wh_bvh *t)
{
	wh_vec3 *points = wh_alloc(d->c, WH_BVH_SAMPLE, sizeof *points), lo, hi;
	size_t n = 0;
	wh_code code = points ? wh_bvh_sample(d->c, t, points, &n) : d->c->err.code;
	if (code == WH_OK) {
		wh_bvh_bounds(t, &lo, &hi);
		const wh_frame f = wh_frame_of_points(points, n, lo, hi);
		code = wh_bvh_finish(d->c, t, &f);
	}
	wh_free(d->c, points);
	return code;
}

/* Readers that make the most of what is left, one for each worker of *ex. */
static wh_code open_readers(wh_draw *d, wh_bvh *t, wh_exec *ex, wh_bvh_reader **reader)
{
	const size_t each = wh_bvh_reader_bytes(t), slot = wh_bvh_slot_bytes(t),
	             left = wh_draw_budget(d);
	const size_t fit = left / (each + SLOTS * slot);
	uint32_t slots = 0;
	wh_code code = WH_OK;
	if (wh_bvh_open_bytes(t) + each * (size_t)ex->workers <= left) {
		code = wh_bvh_open_all(d->c, ex, t);
	} else {
		ex->workers = (size_t)ex->workers > fit ? (int)fit : ex->workers;
		ex->workers = ex->workers < 1 ? 1 : ex->workers;
		const size_t share = left / (size_t)ex->workers;
		slots = share > each ? (uint32_t)((share - each) / slot) : SLOTS;
	}
	*reader = wh_calloc(d->c, (size_t)ex->workers, sizeof **reader);
	for (int i = 0; *reader && code == WH_OK && i < ex->workers; i++)
		code = wh_bvh_reader_open(d->c, &(*reader)[i], t, slots, true);
	return d->c->err.code;
}

static wh_code measure_from(wh_draw *d, wh_bvh *t)
{
	wh_exec ex = *d->ex;
	wh_bvh_reader *reader = NULL;
	wh_code code = make_tree(d, t);
	if (code == WH_OK)
		code = open_readers(d, t, &ex, &reader);
	if (code == WH_OK)
		code = measure_cells(d, &ex, t, reader);
	for (int i = 0; reader && i < ex.workers; i++)
		wh_bvh_reader_close(d->c, &reader[i]);
	wh_free(d->c, reader);
	return code;
}

static wh_code make_room_for_distances(wh_draw *d)
{
	const size_t pixels = (size_t)d->p->width * d->p->height;
	for (int i = 0; d->c->err.code == WH_OK && i < d->p->ncells; i++)
		d->cell[i].distance = wh_alloc(d->c, pixels, sizeof *d->cell[i].distance);
	return d->c->err.code;
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

/* Cells that have one range. */
typedef struct cells {
	int from, to;
} cells;

/* Distances of the pixels, counted in equal bins up to the largest. */
static uint64_t count_distances(const wh_draw *d, cells of, double most, uint64_t bins[BINS])
{
	uint64_t n = 0;
	const size_t pixels = (size_t)d->p->width * d->p->height;
	for (int i = of.from; i < of.to; i++)
		for (size_t k = 0; k < pixels; k++) {
			if (!d->cell[i].pixels[k].covered)
				continue;
			const double x = (double)d->cell[i].distance[k] / most * BINS;
			bins[x < BINS ? (size_t)x : BINS - 1]++;
			n++;
		}
	return n;
}

static double find_most(const wh_draw *d, cells of)
{
	const size_t pixels = (size_t)d->p->width * d->p->height;
	double most = 0;
	for (int i = of.from; i < of.to; i++)
		for (size_t k = 0; k < pixels; k++)
			most = fmax(most, (double)d->cell[i].distance[k]);
	return most;
}

static double suitable_range(const wh_draw *d, cells of, double most)
{
	uint64_t bins[BINS] = {0};
	double range = 0;
	if (most > 0) {
		uint64_t left = (uint64_t)((double)count_distances(d, of, most, bins) * BEYOND);
		int k = BINS - 1;
		while (k > 0 && bins[k] <= left)
			left -= bins[k--];
		range = most * (k + 1) / BINS;
	}
	return round_up(fmax(range, RANGE_LEAST * 2 * d->cell[0].camera.unit));
}

/* One for all cells of a picture. */
static void find_ranges(wh_draw *d)
{
	const int step = d->p->take ? 1 : d->p->ncells;
	for (int i = 0; i < d->p->ncells; i += step) {
		const cells of = {i, i + step};
		const double most = find_most(d, of);
		const double range = d->p->range > 0 ? d->p->range : suitable_range(d, of, most);
		for (int k = of.from; k < of.to; k++) {
			d->cell[k].range = range;
			d->cell[k].distance_max = most;
		}
		d->r->distance_max = fmax(d->r->distance_max, most);
		d->r->range = fmax(d->r->range, range);
	}
}

/* ---- the whole ------------------------------------------------------------------------------ */

wh_code wh_draw_distances(wh_draw *d)
{
	wh_surface s = {.fd = -1};
	wh_code code = make_room_for_distances(d);
	if (code == WH_OK) {
		const wh_surface_params p = {.path = d->p->distance_to,
		                             .budget = wh_draw_budget(d)};
		code = wh_surface_open(d->c, d->ex, &d->spill, &d->progress, &p, d->memory, &s);
	}
	if (code == WH_OK)
		code = measure_from(d, &s.tree);
	wh_surface_close(d->c, &s);
	if (code == WH_OK)
		find_ranges(d);
	return code;
}
