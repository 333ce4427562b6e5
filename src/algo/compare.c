/*
 * Idea. Either surface is a row of pages in spatial order under a tree of boxes (mesh/bvh), both in
 * one common frame. The cumulated areas, in that order, are cut into n equal strata with one
 * sample in each: the samples are spread evenly in space and follow each other in space too, and,
 * put in order within a chunk, closely: the nearest face of one is a good first guess for the
 * next, and the pages that they need are mostly those that the ones before needed.
 *
 * The side that points are on is gone through page by page; of the side that they are measured
 * from, all pages are open where they fit, and else each worker keeps as many as it may. Points
 * are taken in chunks of fixed contents; a chunk's sums start from nothing and its first query
 * without a guess, and the sums of chunks are added exactly. So neither the schedule nor the
 * memory leaves a trace. Percentiles come from a histogram by the leading bits of the distance,
 * 128 bins an octave.
 *
 * Compare Metro (Cignoni, Rocchini, Scopigno 1998), which samples face by face in proportion to
 * area with a uniform grid below, by default ten times as many points as the larger mesh has faces;
 * MeshLab takes as many as the sampled mesh has vertices. The error of a mean of n samples falls
 * with the root of n, whatever the faces: with 4 million it is below a thousandth where the
 * distances vary by twice their mean, and vertices, which find the maximum, are measured anyway.
 *
 * Cost. Memory: a MiB a worker, and the pages; least 100 KiB. Time: queries about a
 * microsecond each, and a page to be read again costs some 20.
 */
#include "algo/compare.h"

#include "algo/compare_band.h"
#include "algo/compare_sums.h"
#include "base/rng.h"
#include "geom/morton.h"
#include "geom/tri.h"

#include <string.h>

enum {
	CHUNK = 4096,            /* samples of a chunk, ... */
	CHUNK_PAGES = 8,         /* ... or pages whose vertices are one */
	SAMPLES_LEAST = 1000000, /* where none are asked for */
	SAMPLES_MOST = 4000000,
	JOBS = 64,    /* a worker, at least, before a job is more than a chunk: ... */
	JOB_MOST = 64 /* ... chunks next to each other need the same pages */
};

/* A sample, with what is asked of its face. */
typedef struct probe {
	wh_vec3 p;
	wh_vec3 normal; /* twice as long as the face's area */
	double rgb[3];  /* where the surface has colours */
	wh_bvh_face at;
} probe;

/* What one worker needs. */
typedef struct workspace {
	wh_bvh_reader from, to;
	wh_tally *tally;
	probe *probe;                   /* CHUNK */
	uint32_t *order[2];             /* CHUNK each: of the probes, and room to sort them */
	uint32_t *key;                  /* CHUNK */
	double area[WH_PAGE_FACES + 1]; /* of the faces before this one in the page at hand */
} workspace;

/* One side: points of `from`, distances to `to`. Chunks of samples come first, then those of
 * vertices. */
typedef struct side {
	const wh_bvh *from, *to;
	const wh_compare_params *params;
	bool from_a;         /* points of a */
	const uint8_t *band; /* of b; NULL: not asked for */
	uint64_t seed, samples;
	uint64_t sample_chunks, chunks, job_chunks;
	uint32_t regions;
	workspace *workspace;
} side;

/* ---- faces ---------------------------------------------------------------------------------- */

typedef struct corners {
	wh_vec3 a, b, c;
} corners;

static corners corners_of(const wh_page *g, uint32_t f)
{
	const uint16_t *t = g->tri + 3 * (size_t)f;
	return (corners){g->pos[t[0]], g->pos[t[1]], g->pos[t[2]]};
}

/* Normal of a face, twice as long as its area. */
static wh_vec3 face_normal(const wh_page *g, uint32_t f)
{
	const corners k = corners_of(g, f);
	return wh_cross(wh_sub(k.b, k.a), wh_sub(k.c, k.a));
}

/* Area of a face, in the common frame; its scale keeps it from over- or underflow. */
static double face_area(const wh_page *g, uint32_t f)
{
	return 0.5 * wh_norm(face_normal(g, f));
}

/* The angle between the normals of two faces; none when one is degenerate. */
static void measure_normals(wh_vec3 m, wh_vec3 n, wh_chunk_sums *s)
{
	const double mm = wh_norm(m), nn = wh_norm(n);
	if (!(mm > 0) || !(nn > 0))
		return;
	const wh_vec3 u = wh_scale(m, 1 / mm), v = wh_scale(n, 1 / nn);
	const double angle = atan2(wh_norm(wh_cross(u, v)), wh_dot(u, v));
	s->sum[WH_SUM_ANGLE] += angle;
	s->sum[WH_SUM_ANGLE2] += angle * angle;
	s->count[WH_COUNT_ANGLES]++;
}

/* The colour that a face has in the point nearest to p. */
static void colour_at(const wh_page *g, uint32_t f, wh_vec3 p, double rgb[3])
{
	const uint16_t *t = g->tri + 3 * (size_t)f;
	double w[3];
	wh_tri_nearest(p, g->pos[t[0]], g->pos[t[1]], g->pos[t[2]], w);
	for (size_t k = 0; k < 3; k++)
		rgb[k] = w[0] * (double)g->colour[3 * (size_t)t[0] + k] +
		         w[1] * (double)g->colour[3 * (size_t)t[1] + k] +
		         w[2] * (double)g->colour[3 * (size_t)t[2] + k];
}

/* ---- sampling ------------------------------------------------------------------------------- */

/* Where the walk over the samples of a chunk is. */
typedef struct walk {
	uint32_t page, face;
	const wh_page *at; /* NULL: not there yet */
} walk;

/* The last page that starts at or before this much area. */
static uint32_t page_at(const wh_bvh *t, double area)
{
	uint32_t lo = 0, hi = t->pages;
	while (hi - lo > 1) {
		const uint32_t mid = lo + (hi - lo) / 2;
		if (t->area[mid] <= area)
			lo = mid;
		else
			hi = mid;
	}
	return lo;
}

/* Goes on to the page, and the face, that this much area is in. */
static wh_code walk_to(wh_ctx *c, workspace *ws, walk *w, double area)
{
	const wh_bvh *t = ws->from.t;
	uint32_t page = w->page;
	while (page + 1 < t->pages && t->area[page + 1] <= area)
		page++;
	if (page != w->page || !w->at) {
		w->at = wh_bvh_page(c, &ws->from, page);
		if (!w->at)
			return wh_failed(c);
		w->page = page;
		w->face = 0;
		ws->area[0] = 0;
		for (uint32_t f = 0; f < w->at->nf; f++)
			ws->area[f + 1] = ws->area[f] + face_area(w->at, f);
	}
	const double share = (area - t->area[page]) / (t->area[page + 1] - t->area[page]);
	const double in_page = share * ws->area[w->at->nf];
	while (w->face + 1 < w->at->nf && ws->area[w->face + 1] <= in_page)
		w->face++;
	return WH_OK;
}

/* Uniform in a triangle (Turk 1990). */
static wh_vec3 point_in_face(const wh_page *g, uint32_t f, double r1, double r2)
{
	const corners k = corners_of(g, f);
	const double s = sqrt(r1);
	const wh_vec3 ab = wh_scale(wh_sub(k.b, k.a), s * (1 - r2));
	const wh_vec3 ac = wh_scale(wh_sub(k.c, k.a), s * r2);
	return wh_add(k.a, wh_add(ab, ac));
}

/* Sample i: somewhere in the i-th of equal shares of the area. */
static wh_code sample(wh_ctx *c, const side *s, workspace *ws, uint64_t i, walk *w, probe *x)
{
	wh_rng g = wh_rng_seed(s->seed ^ wh_mix64(i));
	const double total = s->from->area[s->from->pages];
	const double at = ((double)i + wh_rng_unit(&g)) / (double)s->samples * total;
	if (walk_to(c, ws, w, at) != WH_OK)
		return c->err.code;
	const double r1 = wh_rng_unit(&g);
	x->p = point_in_face(w->at, w->face, r1, wh_rng_unit(&g));
	x->normal = face_normal(w->at, w->face);
	x->at = (wh_bvh_face){w->page, w->face};
	if (w->at->colour)
		colour_at(w->at, w->face, x->p, x->rgb);
	return WH_OK;
}

static wh_code take_samples(wh_ctx *c, const side *s, workspace *ws, uint64_t first, uint32_t n)
{
	const double total = s->from->area[s->from->pages];
	walk w = {.page = page_at(s->from, (double)first / (double)s->samples * total)};
	wh_code code = WH_OK;
	for (uint32_t i = 0; code == WH_OK && i < n; i++)
		code = sample(c, s, ws, first + i, &w, &ws->probe[i]);
	return code;
}

/* ---- the order of the samples of a chunk ---------------------------------------------------- */

enum { KEY_BITS = 10, DIGIT_BITS = 10, DIGITS = 1 << DIGIT_BITS }; /* of each axis, of a pass */

/* Places along the Z curve through the box around the samples. */
static void find_keys(const probe *x, uint32_t n, uint32_t *key)
{
	wh_vec3 lo = x[0].p, hi = x[0].p;
	for (uint32_t i = 1; i < n; i++) {
		lo = wh_lower(lo, x[i].p);
		hi = wh_upper(hi, x[i].p);
	}
	const double size = wh_largest_coordinate(wh_sub(hi, lo));
	const double scale = size > 0 ? ((1 << KEY_BITS) - 1) / size : 0;
	for (uint32_t i = 0; i < n; i++)
		key[i] = (uint32_t)wh_morton_key(x[i].p, lo, scale);
}

/* One pass of a radix sort. */
static void sort_digit(const uint32_t *key, uint32_t n, int shift, const uint32_t *from,
                       uint32_t *to)
{
	uint32_t start[DIGITS + 1] = {0};
	for (uint32_t i = 0; i < n; i++)
		start[(key[i] >> shift & (DIGITS - 1)) + 1]++;
	for (uint32_t d = 0; d < DIGITS; d++)
		start[d + 1] += start[d];
	for (uint32_t i = 0; i < n; i++)
		to[start[key[from[i]] >> shift & (DIGITS - 1)]++] = from[i];
}

/* Samples that follow each other are near each other: most of them need what the one before did.
 * Strata are no finer than faces, so they come in any order within one. */
static void order_samples(workspace *ws, uint32_t n)
{
	find_keys(ws->probe, n, ws->key);
	for (uint32_t i = 0; i < n; i++)
		ws->order[1][i] = i;
	for (int k = 0; k < 3; k++)
		sort_digit(ws->key, n, k * DIGIT_BITS, ws->order[(k + 1) % 2], ws->order[k % 2]);
}

/* ---- measuring ------------------------------------------------------------------------------ */

/* A point on one face, and the face of the other surface that is nearest to it. */
typedef struct pair {
	const probe *from;
	const wh_page *to;
	wh_bvh_face near;
	double d2;
} pair;

static uint32_t region_of(const side *s, uint32_t from, uint32_t to)
{
	const uint32_t page = s->from_a ? from : to;
	const uint32_t pages = s->from_a ? s->from->pages : s->to->pages;
	return (uint32_t)((uint64_t)page * s->regions / pages);
}

/* Which zone of b the point belongs to. */
static int zone_of(const side *s, const pair *x)
{
	const wh_bvh_face *f = s->from_a ? &x->near : &x->from->at;
	return wh_band_has(s->band, f->page, f->face);
}

/* The squared difference of colour. False when there is none. */
static bool colour_difference(const side *s, const pair *x, double *d2)
{
	double v[3];
	if (!s->from->layout.coloured || !x->to->colour)
		return false;
	colour_at(x->to, x->near.face, x->from->p, v);
	*d2 = 0;
	for (int k = 0; k < 3; k++)
		*d2 += (x->from->rgb[k] - v[k]) * (x->from->rgb[k] - v[k]) / 3;
	return isfinite(*d2);
}

static void add_colours(const side *s, const pair *x, wh_chunk_sums *sums)
{
	double d2 = 0;
	if (!colour_difference(s, x, &d2))
		return;
	sums->sum[WH_SUM_COLOUR] += sqrt(d2);
	sums->sum[WH_SUM_COLOUR2] += d2;
	sums->count[WH_COUNT_COLOURS]++;
	if (s->band) {
		sums->sum[WH_SUM_ZONE_COLOUR2 + zone_of(s, x)] += d2;
		sums->count[WH_COUNT_ZONE_COLOURS + zone_of(s, x)]++;
	}
}

static void raise(double *most, double x)
{
	*most = x > *most ? x : *most;
}

static void add_pair(const side *s, const pair *x, wh_chunk_sums *sums, uint64_t *bins)
{
	const double d = sqrt(x->d2);
	const uint32_t region = region_of(s, x->from->at.page, x->near.page);
	sums->sum[WH_SUM_D] += d;
	sums->sum[WH_SUM_D2] += x->d2;
	sums->sum[WH_SUM_REGION_D2 + region] += x->d2;
	sums->count[WH_COUNT_REGION + region]++;
	raise(&sums->max2[region], x->d2);
	bins[wh_bin_of(d)]++;
	measure_normals(x->from->normal, face_normal(x->to, x->near.face), sums);
	if (s->band) {
		sums->sum[WH_SUM_ZONE_D2 + zone_of(s, x)] += x->d2;
		sums->count[WH_COUNT_ZONE + zone_of(s, x)]++;
	}
	add_colours(s, x, sums);
}

static void tell(const side *s, uint64_t n)
{
	if (s->params->tell)
		s->params->tell(s->params->tell_user, n);
}

static wh_code measure_samples(wh_ctx *c, const side *s, workspace *ws, uint64_t chunk,
                               wh_chunk_sums *sums)
{
	const uint64_t first = chunk * CHUNK, left = s->samples - first;
	const uint32_t n = left < CHUNK ? (uint32_t)left : CHUNK;
	pair x = {.near = {WH_NONE, 0}};
	wh_code code = take_samples(c, s, ws, first, n);
	if (code == WH_OK)
		order_samples(ws, n);
	for (uint32_t i = 0; code == WH_OK && i < n; i++) {
		x.from = &ws->probe[ws->order[0][i]];
		code = wh_bvh_nearest(c, &ws->to, x.from->p, &x.near, &x.d2);
		x.to = code == WH_OK ? wh_bvh_page(c, &ws->to, x.near.page) : NULL;
		if (!x.to)
			return wh_failed(c);
		add_pair(s, &x, sums, ws->tally->bins);
	}
	tell(s, n);
	return code;
}

/* The vertices that no earlier page has. */
static wh_code measure_page(wh_ctx *c, const side *s, workspace *ws, uint32_t page,
                            wh_bvh_face *near, wh_chunk_sums *sums)
{
	const uint32_t own = s->from->entry[page].own;
	const wh_page *g = wh_bvh_page(c, &ws->from, page);
	if (!g)
		return wh_failed(c);
	for (uint32_t v = 0; v < own; v++) {
		double d2;
		if (wh_bvh_nearest(c, &ws->to, g->pos[v], near, &d2) != WH_OK)
			return c->err.code;
		raise(&sums->max2[region_of(s, page, near->page)], d2);
	}
	tell(s, own);
	return WH_OK;
}

static wh_code measure_vertices(wh_ctx *c, const side *s, workspace *ws, uint64_t chunk,
                                wh_chunk_sums *sums)
{
	const uint32_t first = (uint32_t)chunk * CHUNK_PAGES;
	wh_bvh_face near = {WH_NONE, 0};
	wh_code code = WH_OK;
	for (uint32_t i = first; code == WH_OK && i < s->from->pages && i - first < CHUNK_PAGES;
	     i++)
		code = measure_page(c, s, ws, i, &near, sums);
	return code;
}

static wh_code measure_chunk(wh_ctx *c, const side *s, workspace *ws, uint64_t chunk)
{
	wh_chunk_sums sums = {0};
	const wh_code code = chunk < s->sample_chunks
	                         ? measure_samples(c, s, ws, chunk, &sums)
	                         : measure_vertices(c, s, ws, chunk - s->sample_chunks, &sums);
	if (code == WH_OK)
		wh_tally_add(ws->tally, &sums);
	return code;
}

static wh_code measure_job(wh_ctx *c, void *arg, int64_t index, int worker)
{
	const side *s = arg;
	const uint64_t first = (uint64_t)index * s->job_chunks;
	wh_code code = WH_OK;
	for (uint64_t i = first; code == WH_OK && i < s->chunks && i - first < s->job_chunks; i++) {
		code = wh_poll(c);
		if (code == WH_OK)
			code = measure_chunk(c, s, &s->workspace[worker], i);
	}
	return code;
}

/* ---- memory --------------------------------------------------------------------------------- */

/* How a side is gone through. */
typedef struct means {
	wh_exec ex;
	bool open;      /* all pages of `to` */
	uint32_t slots; /* of each worker, else */
} means;

static size_t workspace_bytes(const side *s)
{
	return sizeof(workspace) + sizeof(wh_tally) +
	       CHUNK * (sizeof(probe) + 3 * sizeof(uint32_t)) + wh_bvh_reader_bytes(s->from) +
	       WH_BVH_SLOTS_LEAST * wh_bvh_slot_bytes(s->from) + wh_bvh_reader_bytes(s->to);
}

/* Makes the most of so many bytes. */
static wh_code find_means(wh_ctx *c, const wh_exec *ex, const side *s, size_t memory, means *m)
{
	const size_t each = workspace_bytes(s), slot = wh_bvh_slot_bytes(s->to);
	const size_t least = each + WH_BVH_SLOTS_LEAST * slot;
	*m = (means){.ex = *ex, .open = true};
	if (memory == 0 || (size_t)ex->workers * each + wh_bvh_open_bytes(s->to) <= memory)
		return WH_OK;
	const size_t fit = memory / least, asked = (size_t)ex->workers;
	const size_t workers = asked < fit ? asked : fit;
	if (workers == 0)
		return wh_fail(c, WH_E_PLAN,
		               "comparing needs more memory than the ceiling leaves: use a "
		               "--memory that is %zu MiB larger",
		               ((least - memory) >> 20) + 1);
	const size_t slots = (memory / workers - each) / slot;
	m->open = false;
	m->ex.workers = (int)workers;
	m->slots = slots < UINT32_MAX ? (uint32_t)slots : UINT32_MAX;
	return WH_OK;
}

static wh_code workspaces_make(wh_ctx *c, side *s, const means *m)
{
	s->workspace = wh_calloc(c, (size_t)m->ex.workers, sizeof *s->workspace);
	for (int i = 0; s->workspace && i < m->ex.workers; i++) {
		workspace *ws = &s->workspace[i];
		ws->tally = wh_calloc(c, 1, sizeof *ws->tally);
		ws->probe = wh_alloc(c, CHUNK, sizeof *ws->probe);
		ws->order[0] = wh_alloc(c, CHUNK, sizeof *ws->order[0]);
		ws->order[1] = wh_alloc(c, CHUNK, sizeof *ws->order[1]);
		ws->key = wh_alloc(c, CHUNK, sizeof *ws->key);
		if (c->err.code != WH_OK ||
		    wh_bvh_reader_open(c, &ws->from, s->from, 0, false) != WH_OK ||
		    wh_bvh_reader_open(c, &ws->to, s->to, m->slots, true) != WH_OK)
			break;
	}
	return c->err.code;
}

static void workspaces_free(wh_ctx *c, side *s, const means *m)
{
	for (int i = 0; s->workspace && i < m->ex.workers; i++) {
		wh_bvh_reader_close(c, &s->workspace[i].from);
		wh_bvh_reader_close(c, &s->workspace[i].to);
		wh_free(c, s->workspace[i].tally);
		wh_free(c, s->workspace[i].probe);
		wh_free(c, s->workspace[i].order[0]);
		wh_free(c, s->workspace[i].order[1]);
		wh_free(c, s->workspace[i].key);
	}
	wh_free(c, s->workspace);
	s->workspace = NULL;
}

/* ---- one side ------------------------------------------------------------------------------- */

static uint64_t pieces_of(uint64_t n, uint64_t each)
{
	return n / each + (n % each != 0);
}

static wh_code measure(wh_ctx *c, side *s, const means *m, wh_tally *sum)
{
	const uint64_t jobs = (uint64_t)(m->ex.workers > 1 ? m->ex.workers : 1) * JOBS;
	s->sample_chunks = pieces_of(s->samples, CHUNK);
	s->chunks = s->sample_chunks + pieces_of(s->from->pages, CHUNK_PAGES);
	s->job_chunks = s->chunks / jobs + 1;
	s->job_chunks = s->job_chunks > JOB_MOST ? JOB_MOST : s->job_chunks;
	const wh_code code =
	    wh_exec_for(c, &m->ex, (int64_t)pieces_of(s->chunks, s->job_chunks), measure_job, s);
	for (int i = 0; code == WH_OK && i < m->ex.workers; i++)
		wh_tally_join(sum, s->workspace[i].tally);
	return code;
}

typedef struct comparison {
	wh_ctx *c;
	const wh_exec *ex;
	const wh_compare_params *params;
	size_t held; /* by all, when it began */
	wh_bvh *t[2];
	uint64_t samples;
	uint32_t regions;
	uint8_t *band;
	wh_tally *tally; /* of both sides */
} comparison;

static wh_code mark_band(comparison *k, const side *s, const means *m)
{
	wh_bvh_reader *reader = wh_calloc(k->c, (size_t)m->ex.workers, sizeof *reader);
	k->band = wh_alloc(k->c, wh_band_bytes(s->to), 1);
	wh_code code = k->c->err.code;
	for (int i = 0; code == WH_OK && i < m->ex.workers; i++)
		code = wh_bvh_reader_open(k->c, &reader[i], s->to, m->slots, true);
	if (code == WH_OK)
		code = wh_compare_band(k->c, &m->ex, reader, k->params, k->band);
	for (int i = 0; reader && i < m->ex.workers; i++)
		wh_bvh_reader_close(k->c, &reader[i]);
	wh_free(k->c, reader);
	return code;
}

static bool has_cuts(const wh_compare_params *p)
{
	return p->cuts || p->fetch_cuts;
}

/* Bytes beside those of the sides: of the trees' upper boxes and the tallies, which are there, and
 * of the band, which may be to come. */
static size_t other_bytes(const comparison *k)
{
	const size_t band = has_cuts(k->params) && !k->band ? wh_band_bytes(k->t[1]) : 0;
	const size_t now = atomic_load(&k->c->mem->used);
	return (now > k->held ? now - k->held : 0) + band;
}

/* What a side may take. WH_E_PLAN where that is nothing. */
static wh_code room_of(const comparison *k, bool marks, size_t *room)
{
	const size_t taken = other_bytes(k) + (marks ? wh_band_work_bytes(k->t[1], k->ex) : 0) + 1;
	*room = k->params->memory;
	if (*room == 0)
		return WH_OK;
	if (*room < taken)
		return wh_fail(k->c, WH_E_PLAN,
		               "comparing needs more memory than the ceiling leaves: use a "
		               "--memory that is %zu MiB larger",
		               ((taken - *room) >> 20) + 4);
	*room -= taken;
	return WH_OK;
}

/* Points of surface `which`. */
static wh_code measure_side(comparison *k, int which, wh_tally *sum)
{
	wh_ctx *c = k->c;
	side s = {.from = k->t[which],
	          .to = k->t[1 - which],
	          .params = k->params,
	          .from_a = which == 0,
	          .seed = wh_mix64(k->params->seed) + (uint64_t)which,
	          .regions = k->regions};
	const bool marks = which == 0 && has_cuts(k->params);
	means m;
	size_t room;
	if (room_of(k, marks, &room) != WH_OK || find_means(c, k->ex, &s, room, &m) != WH_OK)
		return c->err.code;
	s.samples = s.from->area[s.from->pages] > 0 ? k->samples : 0;
	wh_code code = m.open ? wh_bvh_open_all(c, &m.ex, k->t[1 - which]) : WH_OK;
	if (code == WH_OK && marks)
		code = mark_band(k, &s, &m);
	s.band = k->band;
	if (code == WH_OK)
		code = workspaces_make(c, &s, &m);
	if (code == WH_OK)
		code = measure(c, &s, &m, sum);
	workspaces_free(c, &s, &m);
	wh_bvh_close_all(c, k->t[1 - which]);
	return code;
}

/* ---- reporting ------------------------------------------------------------------------------ */

/* Faces and area of the zones. */
static wh_code measure_zones(comparison *k, double unit, wh_compare *r)
{
	const wh_bvh *t = k->t[1];
	wh_compare_zone *const zone[2] = {&r->interior, &r->band};
	wh_bvh_reader reader;
	if (wh_bvh_reader_open(k->c, &reader, t, 0, false) != WH_OK)
		return k->c->err.code;
	for (uint32_t page = 0; k->c->err.code == WH_OK && page < t->pages; page++) {
		const wh_page *g = wh_bvh_page(k->c, &reader, page);
		for (uint32_t f = 0; g && f < g->nf; f++) {
			wh_compare_zone *z = zone[wh_band_has(k->band, page, f)];
			z->faces++;
			z->area += face_area(g, f) * unit * unit;
		}
	}
	wh_bvh_reader_close(k->c, &reader);
	return k->c->err.code;
}

static double sum_of(const wh_tally *t, int which)
{
	return wh_exact_value(&t->sum[which]);
}

static double root_of_mean(double sum, uint64_t n)
{
	return n > 0 ? sqrt(sum / (double)n) : 0;
}

static void describe_zones(const wh_tally *both, double unit, wh_compare *r)
{
	wh_compare_zone *const zone[2] = {&r->interior, &r->band};
	for (int z = 0; z < 2; z++) {
		zone[z]->samples = both->count[WH_COUNT_ZONE + z];
		zone[z]->rms =
		    root_of_mean(sum_of(both, WH_SUM_ZONE_D2 + z), zone[z]->samples) * unit;
		zone[z]->colours = both->count[WH_COUNT_ZONE_COLOURS + z];
		zone[z]->colour_rms =
		    root_of_mean(sum_of(both, WH_SUM_ZONE_COLOUR2 + z), zone[z]->colours);
	}
}

double wh_compare_rms_ratio(const wh_compare *r)
{
	return r->band.samples > 0 && r->interior.rms > 0 ? r->band.rms / r->interior.rms : NAN;
}

double wh_compare_density_ratio(const wh_compare *r)
{
	if (!(r->band.area > 0) || !(r->interior.area > 0))
		return NAN;
	return (double)r->band.faces / r->band.area /
	       ((double)r->interior.faces / r->interior.area);
}

/* Boxes, faces and areas of the regions of a. */
static void outline_regions(const comparison *k, wh_compare *r)
{
	const wh_bvh *t = k->t[0];
	r->regions = k->regions;
	for (uint32_t i = 0; i < t->pages; i++) {
		const wh_page_entry *e = &t->entry[i];
		wh_compare_region *g = &r->region[(uint64_t)i * k->regions / t->pages];
		const double unit = 1 / t->unit;
		const wh_vec3 lo = wh_scale(e->lo, unit), hi = wh_scale(e->hi, unit);
		g->lo = g->faces ? wh_lower(g->lo, lo) : lo;
		g->hi = g->faces ? wh_upper(g->hi, hi) : hi;
		g->faces += e->nf;
		g->area += e->area * unit * unit;
	}
}

static void describe_regions(const comparison *k, double unit, wh_compare *r)
{
	outline_regions(k, r);
	for (uint32_t i = 0; i < k->regions; i++) {
		wh_compare_region *g = &r->region[i];
		const wh_tally *const t[2] = {k->tally, k->tally + 1};
		g->a_to_b.samples = t[0]->count[WH_COUNT_REGION + i];
		g->b_to_a.samples = t[1]->count[WH_COUNT_REGION + i];
		g->a_to_b.rms =
		    root_of_mean(sum_of(t[0], WH_SUM_REGION_D2 + (int)i), g->a_to_b.samples) * unit;
		g->b_to_a.rms =
		    root_of_mean(sum_of(t[1], WH_SUM_REGION_D2 + (int)i), g->b_to_a.samples) * unit;
		g->a_to_b.max = sqrt(t[0]->max2[i]) * unit;
		g->b_to_a.max = sqrt(t[1]->max2[i]) * unit;
	}
}

/* Adds the first side's tally to the second one's at last. */
static wh_code describe(comparison *k, wh_compare *r)
{
	const double unit = 1 / k->t[0]->frame.scale;
	wh_distance *const out[2] = {&r->a_to_b, &r->b_to_a};
	for (int i = 0; i < 2; i++) {
		const wh_bvh *t = k->t[i];
		const uint64_t samples = t->area[t->pages] > 0 ? k->samples : 0;
		*out[i] = wh_tally_describe(&k->tally[i], samples, t->vertices, unit);
	}
	describe_regions(k, unit, r);
	wh_tally_join(&k->tally[1], &k->tally[0]);
	r->both = wh_tally_describe(&k->tally[1], out[0]->samples + out[1]->samples,
	                            out[0]->vertices + out[1]->vertices, unit);
	r->rms = fmax(r->a_to_b.rms, r->b_to_a.rms);
	r->normal_rms = fmax(r->a_to_b.normal_rms, r->b_to_a.normal_rms);
	r->colour_rms = fmax(r->a_to_b.colour_rms, r->b_to_a.colour_rms);
	r->banded = k->band;
	if (!k->band)
		return WH_OK;
	describe_zones(&k->tally[1], unit, r);
	return measure_zones(k, unit, r);
}

/* ---- the whole ------------------------------------------------------------------------------ */

/* Both surfaces in one frame. */
static wh_code finish_both(comparison *k, wh_compare *r)
{
	wh_vec3 lo[2], hi[2];
	size_t n = 0;
	wh_vec3 *points = wh_alloc(k->c, 2 * (size_t)WH_BVH_SAMPLE, sizeof *points);
	wh_code code = points ? WH_OK : k->c->err.code;
	for (int i = 0; code == WH_OK && i < 2; i++) {
		wh_bvh_bounds(k->t[i], &lo[i], &hi[i]);
		code = wh_bvh_sample(k->c, k->t[i], points, &n);
	}
	if (code == WH_OK) {
		const wh_frame f =
		    wh_frame_of_points(points, n, wh_lower(lo[0], lo[1]), wh_upper(hi[0], hi[1]));
		r->diagonal =
		    wh_norm(wh_sub(wh_scale(hi[0], f.scale), wh_scale(lo[0], f.scale))) / f.scale;
		code = wh_bvh_finish(k->c, k->t[0], &f);
		if (code == WH_OK)
			code = wh_bvh_finish(k->c, k->t[1], &f);
	}
	wh_free(k->c, points);
	return code;
}

uint64_t wh_compare_samples(const wh_bvh *a, const wh_bvh *b, const wh_compare_params *params)
{
	const uint64_t faces = a->faces > b->faces ? a->faces : b->faces;
	if (params->samples)
		return params->samples;
	return faces < SAMPLES_LEAST ? SAMPLES_LEAST : faces > SAMPLES_MOST ? SAMPLES_MOST : faces;
}

wh_code wh_compare_surfaces(wh_ctx *c, const wh_exec *ex, wh_bvh *a, wh_bvh *b,
                            const wh_compare_params *params, wh_compare *r)
{
	comparison k = {.c = c,
	                .ex = ex,
	                .params = params,
	                .held = atomic_load(&c->mem->used),
	                .t = {a, b},
	                .samples = wh_compare_samples(a, b, params),
	                .regions = a->pages < WH_REGIONS ? a->pages : WH_REGIONS};
	*r = (wh_compare){0};
	wh_code code = finish_both(&k, r);
	if (code == WH_OK) {
		k.tally = wh_calloc(c, 2, sizeof *k.tally);
		code = c->err.code;
	}
	for (int i = 0; code == WH_OK && i < 2; i++)
		code = measure_side(&k, i, &k.tally[i]);
	if (code == WH_OK)
		code = describe(&k, r);
	wh_free(c, k.tally);
	wh_free(c, k.band);
	return code;
}

static wh_code build(wh_ctx *c, const wh_exec *ex, const wh_mesh *m, const char *which, wh_bvh *t)
{
	if (m->nf == 0)
		return wh_fail(c, WH_E_INPUT, "the %s mesh has no faces to compare", which);
	for (size_t i = 0; i < 3 * (size_t)m->nf; i++) {
		const wh_vec3 p = m->pos[m->tri[i]];
		if (!isfinite(p.x) || !isfinite(p.y) || !isfinite(p.z))
			return wh_fail(c, WH_E_INPUT, "vertex %u of the %s mesh is not finite",
			               m->tri[i], which);
	}
	return wh_bvh_build(c, ex, m, t);
}

wh_code wh_compare_meshes(wh_ctx *c, const wh_exec *ex, const wh_mesh *a, const wh_mesh *b,
                          const wh_compare_params *params, wh_compare *r)
{
	wh_bvh t[2] = {{.pages = 0}, {.pages = 0}};
	wh_code code = build(c, ex, a, "first", &t[0]);
	if (code == WH_OK)
		code = build(c, ex, b, "second", &t[1]);
	if (code == WH_OK)
		code = wh_compare_surfaces(c, ex, &t[0], &t[1], params, r);
	wh_bvh_free(c, &t[1]);
	wh_bvh_free(c, &t[0]);
	return code;
}
