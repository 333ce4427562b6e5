/*
 * Idea. Either surface gets a tree of boxes (mesh/bvh) in one common frame, whose copy of the
 * mesh is in spatial order. Its cumulated areas, in that order, are cut into n equal strata with
 * one sample in each: the samples are spread evenly in space and follow each other in space too,
 * so that the nearest face of one is a good first guess for the next.
 *
 * Points are taken in chunks of fixed size; a chunk's sums start from nothing and its first query
 * without a guess, and sums are added in the order of chunks. So the schedule leaves no trace.
 * Percentiles come from a histogram by the leading bits of the distance, 128 bins an octave.
 *
 * Compare Metro (Cignoni, Rocchini, Scopigno 1998), which samples face by face in proportion to
 * area with a uniform grid below.
 *
 * Cost. Memory: what the trees take, and 8 bytes a face for areas. Time: trees n log n, queries
 * about a microsecond each.
 */
#include "algo/compare.h"

#include "algo/compare_band.h"
#include "base/rng.h"
#include "geom/tri.h"
#include "mesh/bvh.h"

#include <string.h>

enum {
	CHUNK = 4096, /* points of one job */
	BIN_BITS = 7, /* of the mantissa: bins within an octave */
	OCTAVES = 64, /* below the largest distance, 4 in the common frame */
	NBINS = OCTAVES << BIN_BITS
};

#define DEGREES (180 / 3.14159265358979323846) /* of a radian */

typedef struct surface {
	wh_bvh tree;
	double *area;  /* nf + 1: of all faces before this one */
	uint8_t *band; /* nf: 1 in the band along the cuts; NULL: no band is asked for, or of the
	                * other surface */
} surface;

/* What the points of a chunk add up to, in the common frame. */
typedef struct sums {
	double d, d2, max2;
	double angle, angle2; /* between normals, radians */
	uint64_t angles;      /* samples that have one */
	double colour, colour2;
	uint64_t colours;  /* samples that have one at either end */
	double zone_d2[2]; /* interior, band */
	uint64_t zone_samples[2];
	double zone_colour2[2];
	uint64_t zone_colours[2];
} sums;

/* ---- preparing
 * ------------------------------------------------------------------------------------ */

typedef struct box {
	wh_vec3 lo, hi;
} box;

static bool is_finite(wh_vec3 p)
{
	return isfinite(p.x) && isfinite(p.y) && isfinite(p.z);
}

/* The box around all corners. */
static wh_code bound(wh_ctx *c, const wh_mesh *m, const char *which, box *b)
{
	if (m->nf == 0)
		return wh_fail(c, WH_E_INPUT, "the %s mesh has no faces to compare", which);
	*b = (box){m->pos[m->tri[0]], m->pos[m->tri[0]]};
	for (size_t i = 0; i < 3 * (size_t)m->nf; i++) {
		const wh_vec3 p = m->pos[m->tri[i]];
		if (!is_finite(p))
			return wh_fail(c, WH_E_INPUT, "vertex %u of the %s mesh is not finite",
			               m->tri[i], which);
		*b = (box){wh_lower(b->lo, p), wh_upper(b->hi, p)};
	}
	return WH_OK;
}

/* Normal of a face, twice as long as its area. */
static wh_vec3 face_normal(const wh_mesh *m, uint32_t f)
{
	const uint32_t *t = m->tri + 3 * (size_t)f;
	const wh_vec3 a = m->pos[t[0]];
	return wh_cross(wh_sub(m->pos[t[1]], a), wh_sub(m->pos[t[2]], a));
}

/* Area of a face, in the common frame; the scaling of the frame keeps it from over- or underflow.
 */
static double face_area(const wh_mesh *m, uint32_t f)
{
	return 0.5 * wh_norm(face_normal(m, f));
}

static wh_code prepare(wh_ctx *c, const wh_exec *ex, const wh_mesh *m, const wh_frame *f,
                       surface *s)
{
	if (wh_bvh_build(c, ex, m, f, &s->tree) != WH_OK)
		return c->err.code;
	s->area = wh_alloc(c, (size_t)m->nf + 1, sizeof *s->area);
	if (!s->area)
		return c->err.code;
	s->area[0] = 0;
	for (uint32_t i = 0; i < m->nf; i++)
		s->area[i + 1] = s->area[i] + face_area(&s->tree.mesh, i);
	return WH_OK;
}

static void release(wh_ctx *c, surface *s)
{
	wh_free(c, s->band);
	wh_free(c, s->area);
	wh_bvh_free(c, &s->tree);
}

/* ---- sampling
 * ------------------------------------------------------------------------------------- */

/* The last face that starts at or before this much area. */
static uint32_t face_at(const surface *s, double area)
{
	uint32_t lo = 0, hi = s->tree.mesh.nf;
	while (hi - lo > 1) {
		const uint32_t mid = lo + (hi - lo) / 2;
		if (s->area[mid] <= area)
			lo = mid;
		else
			hi = mid;
	}
	return lo;
}

/* Uniform in a triangle (Turk 1990). */
static wh_vec3 point_in_face(const wh_mesh *m, uint32_t f, double r1, double r2)
{
	const uint32_t *t = m->tri + 3 * (size_t)f;
	const wh_vec3 a = m->pos[t[0]];
	const double s = sqrt(r1);
	const wh_vec3 ab = wh_scale(wh_sub(m->pos[t[1]], a), s * (1 - r2));
	const wh_vec3 ac = wh_scale(wh_sub(m->pos[t[2]], a), s * r2);
	return wh_add(a, wh_add(ab, ac));
}

/* Sample i of n: somewhere in the i-th of n equal shares of the area. *face is where the sample
 * before was, which is where to go on from. */
static wh_vec3 sample(const surface *s, uint64_t seed, uint64_t i, uint64_t n, uint32_t *face)
{
	wh_rng g = wh_rng_seed(seed ^ wh_mix64(i));
	const uint32_t nf = s->tree.mesh.nf;
	const double at = ((double)i + wh_rng_unit(&g)) / (double)n * s->area[nf];
	while (*face + 1 < nf && s->area[*face + 1] <= at)
		++*face;
	const double r1 = wh_rng_unit(&g);
	return point_in_face(&s->tree.mesh, *face, r1, wh_rng_unit(&g));
}

/* ---- measuring
 * ------------------------------------------------------------------------------------ */

/* One side: points of `from`, distances to `to`. Points 0 .. samples-1 are on its area, the rest
 * are its vertices. */
typedef struct side {
	const surface *from;
	const surface *to;
	uint64_t seed;
	uint64_t samples;
	uint64_t sample_chunks; /* chunks of samples come first, then those of vertices */
	uint64_t chunks;
	sums *sums;     /* one a chunk */
	uint64_t *bins; /* NBINS a worker */
} side;

static uint32_t bin_of(double d)
{
	const uint64_t top = (UINT64_C(1023) + 2) << BIN_BITS; /* 4 and above */
	uint64_t bits;
	memcpy(&bits, &d, sizeof bits);
	bits >>= 52 - BIN_BITS;
	if (bits >= top)
		return NBINS - 1;
	return bits < top - NBINS ? 0 : (uint32_t)(bits - (top - NBINS));
}

/* The upper end of a bin. */
static double bin_end(uint32_t bin)
{
	const uint64_t top = (UINT64_C(1023) + 2) << BIN_BITS;
	const uint64_t bits = (top - NBINS + bin + 1) << (52 - BIN_BITS);
	double d;
	memcpy(&d, &bits, sizeof d);
	return d;
}

/* The angle between the normals of two faces; none when one is degenerate. */
static void measure_normals(const wh_mesh *a, uint32_t f, const wh_mesh *b, uint32_t g, sums *sum)
{
	const wh_vec3 m = face_normal(a, f), n = face_normal(b, g);
	const double mm = wh_norm(m), nn = wh_norm(n);
	if (!(mm > 0) || !(nn > 0))
		return;
	const wh_vec3 u = wh_scale(m, 1 / mm), v = wh_scale(n, 1 / nn);
	const double angle = atan2(wh_norm(wh_cross(u, v)), wh_dot(u, v));
	sum->angle += angle;
	sum->angle2 += angle * angle;
	sum->angles++;
}

/* The colour that a face has in the point nearest to p. */
static void colour_at(const wh_mesh *m, uint32_t f, wh_vec3 p, double rgb[3])
{
	const uint32_t *t = m->tri + 3 * (size_t)f;
	double w[3];
	wh_tri_nearest(p, m->pos[t[0]], m->pos[t[1]], m->pos[t[2]], w);
	for (size_t k = 0; k < 3; k++)
		rgb[k] = w[0] * (double)m->colour[3 * (size_t)t[0] + k] +
		         w[1] * (double)m->colour[3 * (size_t)t[1] + k] +
		         w[2] * (double)m->colour[3 * (size_t)t[2] + k];
}

/* The squared difference of colour between two faces in their points nearest to p. False when
 * there is none. */
static bool compare_colours(const wh_mesh *a, uint32_t f, const wh_mesh *b, uint32_t g, wh_vec3 p,
                            double *d2)
{
	double x[3], y[3];
	if (!a->colour || !b->colour)
		return false;
	colour_at(a, f, p, x);
	colour_at(b, g, p, y);
	*d2 = 0;
	for (int k = 0; k < 3; k++)
		*d2 += (x[k] - y[k]) * (x[k] - y[k]) / 3;
	return isfinite(*d2);
}

static void add_to_zone(sums *sum, uint8_t zone, double d2, bool coloured, double colour2)
{
	sum->zone_d2[zone] += d2;
	sum->zone_samples[zone]++;
	if (coloured) {
		sum->zone_colour2[zone] += colour2;
		sum->zone_colours[zone]++;
	}
}

static void measure_samples(const side *s, uint64_t first, uint64_t end, sums *sum, uint64_t *bins)
{
	const double total = s->from->area[s->from->tree.mesh.nf];
	uint32_t face = face_at(s->from, (double)first / (double)s->samples * total);
	uint32_t hint = WH_NONE;
	for (uint64_t i = first; i < end; i++) {
		const wh_vec3 p = sample(s->from, s->seed, i, s->samples, &face);
		const double d2 = wh_bvh_dist2(&s->to->tree, p, &hint);
		const double d = sqrt(d2);
		sum->d += d;
		sum->d2 += d2;
		sum->max2 = fmax(sum->max2, d2);
		bins[bin_of(d)]++;
		measure_normals(&s->from->tree.mesh, face, &s->to->tree.mesh, hint, sum);
		double colour2 = 0;
		const bool coloured = compare_colours(&s->from->tree.mesh, face, &s->to->tree.mesh,
		                                      hint, p, &colour2);
		if (coloured) {
			sum->colour += sqrt(colour2);
			sum->colour2 += colour2;
			sum->colours++;
		}
		if (s->from->band)
			add_to_zone(sum, s->from->band[face], d2, coloured, colour2);
		if (s->to->band)
			add_to_zone(sum, s->to->band[hint], d2, coloured, colour2);
	}
}

static void measure_vertices(const side *s, uint64_t first, uint64_t end, sums *sum)
{
	uint32_t hint = WH_NONE;
	for (uint64_t i = first; i < end; i++) {
		const double d2 = wh_bvh_dist2(&s->to->tree, s->from->tree.mesh.pos[i], &hint);
		sum->max2 = fmax(sum->max2, d2);
	}
}

static uint64_t min_u64(uint64_t a, uint64_t b)
{
	return a < b ? a : b;
}

static wh_code measure_chunk(wh_ctx *c, void *arg, int64_t index, int worker)
{
	const side *s = arg;
	const uint64_t chunk = (uint64_t)index;
	sums *sum = s->sums + chunk;
	*sum = (sums){0};
	(void)c;
	if (chunk < s->sample_chunks) {
		const uint64_t first = chunk * CHUNK;
		measure_samples(s, first, min_u64(first + CHUNK, s->samples), sum,
		                s->bins + (size_t)worker * NBINS);
	} else {
		const uint64_t first = (chunk - s->sample_chunks) * CHUNK;
		measure_vertices(s, first, min_u64(first + CHUNK, s->from->tree.mesh.nv), sum);
	}
	return WH_OK;
}

static uint64_t chunks_of(uint64_t n)
{
	return (n + CHUNK - 1) / CHUNK;
}

static void add_sums(sums *total, const sums *part)
{
	total->d += part->d;
	total->d2 += part->d2;
	total->max2 = fmax(total->max2, part->max2);
	total->angle += part->angle;
	total->angle2 += part->angle2;
	total->angles += part->angles;
	total->colour += part->colour;
	total->colour2 += part->colour2;
	total->colours += part->colours;
	for (int zone = 0; zone < 2; zone++) {
		total->zone_d2[zone] += part->zone_d2[zone];
		total->zone_samples[zone] += part->zone_samples[zone];
		total->zone_colour2[zone] += part->zone_colour2[zone];
		total->zone_colours[zone] += part->zone_colours[zone];
	}
}

/* The sums of all chunks, and all workers' bins in those of worker 0. */
static sums total_of(const side *s, int workers)
{
	sums total = {0};
	for (uint64_t i = 0; i < s->chunks; i++)
		add_sums(&total, s->sums + i);
	for (size_t w = 1; w < (size_t)workers; w++)
		for (size_t b = 0; b < NBINS; b++)
			s->bins[b] += s->bins[w * NBINS + b];
	return total;
}

/* Measures one side. `bins` receives its NBINS counts. */
static wh_code measure(wh_ctx *c, const wh_exec *ex, side *s, sums *total, uint64_t *bins)
{
	s->sample_chunks = chunks_of(s->samples);
	s->chunks = s->sample_chunks + chunks_of(s->from->tree.mesh.nv);
	s->sums = wh_alloc(c, s->chunks, sizeof *s->sums);
	s->bins = wh_calloc(c, (size_t)ex->workers, NBINS * sizeof *s->bins);
	wh_code code = s->sums && s->bins ? WH_OK : c->err.code;
	if (code == WH_OK)
		code = wh_exec_for(c, ex, (int64_t)s->chunks, measure_chunk, s);
	if (code == WH_OK) {
		*total = total_of(s, ex->workers);
		memcpy(bins, s->bins, NBINS * sizeof *bins);
	}
	wh_free(c, s->bins);
	wh_free(c, s->sums);
	return code;
}

/* ---- reporting
 * ------------------------------------------------------------------------------------ */

/* The distance that this share of the samples does not exceed. */
static double percentile(const uint64_t *bins, uint64_t samples, double share)
{
	const double want = share * (double)samples;
	uint64_t seen = 0;
	for (uint32_t b = 0; b < NBINS; b++) {
		seen += bins[b];
		if (seen > 0 && (double)seen >= want)
			return b == 0 ? 0 : bin_end(b);
	}
	return 0;
}

static wh_distance describe(const sums *s, const uint64_t *bins, uint64_t samples,
                            uint64_t vertices, double unit)
{
	wh_distance d = {.samples = samples, .vertices = vertices, .max = sqrt(s->max2) * unit};
	if (samples == 0)
		return d;
	const double n = (double)samples;
	d.mean = s->d / n * unit;
	d.rms = sqrt(s->d2 / n) * unit;
	d.p50 = fmin(percentile(bins, samples, 0.50) * unit, d.max);
	d.p90 = fmin(percentile(bins, samples, 0.90) * unit, d.max);
	d.p99 = fmin(percentile(bins, samples, 0.99) * unit, d.max);
	d.normals = s->angles;
	if (s->angles > 0) {
		d.normal_mean = s->angle / (double)s->angles * DEGREES;
		d.normal_rms = sqrt(s->angle2 / (double)s->angles) * DEGREES;
	}
	d.colours = s->colours;
	if (s->colours > 0) {
		d.colour_mean = s->colour / (double)s->colours;
		d.colour_rms = sqrt(s->colour2 / (double)s->colours);
	}
	return d;
}

static wh_distance describe_both(const sums total[2], const uint64_t *bins, const wh_distance *a,
                                 const wh_distance *b, double unit)
{
	sums all = total[0];
	add_sums(&all, total + 1);
	return describe(&all, bins, a->samples + b->samples, a->vertices + b->vertices, unit);
}

static void describe_zones(const surface *b, const sums total[2], double unit, wh_compare *r)
{
	wh_compare_zone *const zone[2] = {&r->interior, &r->band};
	if (!b->band)
		return;
	for (uint32_t f = 0; f < b->tree.mesh.nf; f++) {
		zone[b->band[f]]->faces++;
		zone[b->band[f]]->area += face_area(&b->tree.mesh, f) * unit * unit;
	}
	for (int z = 0; z < 2; z++) {
		const double d2 = total[0].zone_d2[z] + total[1].zone_d2[z];
		zone[z]->samples = total[0].zone_samples[z] + total[1].zone_samples[z];
		if (zone[z]->samples > 0)
			zone[z]->rms = sqrt(d2 / (double)zone[z]->samples) * unit;
		const double c2 = total[0].zone_colour2[z] + total[1].zone_colour2[z];
		zone[z]->colours = total[0].zone_colours[z] + total[1].zone_colours[z];
		if (zone[z]->colours > 0)
			zone[z]->colour_rms = sqrt(c2 / (double)zone[z]->colours);
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

/* Samples of one side: none where there is no area to put them. */
static uint64_t samples_of(const surface *s, uint64_t wanted)
{
	return s->area[s->tree.mesh.nf] > 0 ? wanted : 0;
}

static wh_code measure_both(wh_ctx *c, const wh_exec *ex, const surface s[2], uint64_t samples,
                            uint64_t seed, double unit, wh_compare *r)
{
	sums total[2];
	wh_distance *const out[2] = {&r->a_to_b, &r->b_to_a};
	uint64_t *bins = wh_alloc(c, (size_t)2 * NBINS, sizeof *bins);
	if (!bins)
		return c->err.code;
	for (size_t k = 0; k < 2; k++) {
		side one = {.from = s + k,
		            .to = s + 1 - k,
		            .seed = wh_mix64(seed) + k,
		            .samples = samples_of(s + k, samples)};
		if (measure(c, ex, &one, total + k, bins + k * NBINS) != WH_OK)
			goto out;
		*out[k] =
		    describe(total + k, bins + k * NBINS, one.samples, s[k].tree.mesh.nv, unit);
	}
	for (size_t b = 0; b < NBINS; b++)
		bins[b] += bins[NBINS + b];
	r->both = describe_both(total, bins, out[0], out[1], unit);
	r->rms = fmax(r->a_to_b.rms, r->b_to_a.rms);
	r->normal_rms = fmax(r->a_to_b.normal_rms, r->b_to_a.normal_rms);
	r->colour_rms = fmax(r->a_to_b.colour_rms, r->b_to_a.colour_rms);
	describe_zones(s + 1, total, unit, r);
out:
	wh_free(c, bins);
	return c->err.code;
}

static uint64_t default_samples(const wh_mesh *a, const wh_mesh *b)
{
	const uint64_t faces = a->nf > b->nf ? a->nf : b->nf;
	return faces > 1000000 ? faces : 1000000;
}

/* The box around both meshes and the cuts. */
static box all_of(const box *a, const box *b, const wh_compare_params *p)
{
	box all = {wh_lower(a->lo, b->lo), wh_upper(a->hi, b->hi)};
	for (uint64_t i = 0; p->cuts && i < p->ncuts; i++)
		all = (box){wh_lower(all.lo, p->cuts[i]), wh_upper(all.hi, p->cuts[i])};
	return all;
}

static wh_code mark_band(wh_ctx *c, const wh_exec *ex, const wh_compare_params *p,
                         const wh_frame *f, surface *b)
{
	if (!p->cuts)
		return WH_OK;
	b->band = wh_alloc(c, b->tree.mesh.nf, sizeof *b->band);
	if (!b->band)
		return c->err.code;
	return wh_compare_band(c, ex, &b->tree, f, p->cuts, p->ncuts, b->band);
}

wh_code wh_compare_meshes(wh_ctx *c, const wh_exec *ex, const wh_mesh *a, const wh_mesh *b,
                          const wh_compare_params *params, wh_compare *r)
{
	*r = (wh_compare){0};
	box ba, bb;
	if (bound(c, a, "first", &ba) != WH_OK || bound(c, b, "second", &bb) != WH_OK)
		return c->err.code;
	const box all = all_of(&ba, &bb, params);
	const wh_frame f = wh_frame_of_box(all.lo, all.hi);
	r->diagonal = wh_norm(wh_sub(wh_scale(ba.hi, f.scale), wh_scale(ba.lo, f.scale))) / f.scale;
	const uint64_t samples = params->samples ? params->samples : default_samples(a, b);
	surface s[2] = {0};
	wh_code code = prepare(c, ex, a, &f, s);
	if (code == WH_OK)
		code = prepare(c, ex, b, &f, s + 1);
	if (code == WH_OK)
		code = mark_band(c, ex, params, &f, s + 1);
	if (code == WH_OK)
		code = measure_both(c, ex, s, samples, params->seed, 1 / f.scale, r);
	release(c, s + 1);
	release(c, s);
	return code;
}
