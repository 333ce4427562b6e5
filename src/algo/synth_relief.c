/*
 * Relief: gradient noise (Perlin 1985, 2002), summed over octaves.
 *
 * A lattice of random slopes from a hash of seed and lattice coordinates; between lattice points
 * the eight slopes around are mixed with a quintic ease (second derivative continuous). Octave
 * k has wavelength longest / 2.17^k and weight 0.45^k: slopes stay about the same in all of
 * them. Octaves shorter than three sample spacings are left out, up to six they fade in:
 * shorter ones would only be noise. Octave 1 also says how rough the place is, which scales all
 * octaves above it.
 *
 * Slopes are random vectors of a cube rather than Perlin's twelve: they are kept with the
 * lattice cell, so that drawing them costs nothing extra. Cost: 8 hashes per octave, saved when
 * the cursor has the lattice cell already. Only + - * / and conversions: same bits everywhere.
 */
#include "algo/synth_internal.h"

#include <string.h>

static const double LACUNARITY = 2.17; /* no ratio of small integers, so that no lattices align */
static const double GAIN = 0.45;
static const double HIGHEST = 1.5; /* bound of the sum of all octaves */

/* A hash of the lattice point. */
static uint64_t lattice_hash(uint64_t seed, uint32_t x, uint32_t y, uint32_t z)
{
	uint64_t h =
	    seed + x * 0x9e3779b97f4a7c15u + y * 0xc2b2ae3d27d4eb4fu + z * 0x165667b19e3779f9u;
	h = (h ^ (h >> 32)) * 0xd6e8feb86659fd93u;
	h = (h ^ (h >> 32)) * 0xd6e8feb86659fd93u;
	return h ^ (h >> 32);
}

/* 21 bits as a number in [-1, 1). */
static double centred(uint64_t bits)
{
	return (double)(int64_t)(bits & 0x1fffff) * 0x1p-20 - 1.0;
}

static double ease(double t)
{
	return t * t * t * (t * (t * 6.0 - 15.0) + 10.0);
}

static double mix(double a, double b, double t)
{
	return a + (b - a) * t;
}

double synth_smoothstep(double t)
{
	if (t <= 0.0)
		return 0.0;
	if (t >= 1.0)
		return 1.0;
	return t * t * (3.0 - 2.0 * t);
}

double synth_noise1(uint64_t seed, double x)
{
	const uint32_t i = (uint32_t)x;
	return mix(centred(lattice_hash(seed, i, 0, 0)), centred(lattice_hash(seed, i + 1, 0, 0)),
	           ease(x - (double)i));
}

void synth_cursor_init(synth_cursor *k)
{
	memset(k, 0, sizeof *k);
	for (int i = 0; i < SYNTH_OCTAVES; i++)
		k->cell[i].x = UINT32_MAX; /* no lattice coordinate is that large */
}

static void fill_cell(synth_cell *cell, uint64_t seed, uint32_t x, uint32_t y, uint32_t z)
{
	cell->x = x;
	cell->y = y;
	cell->z = z;
	for (uint32_t i = 0; i < 8; i++) {
		const uint64_t h = lattice_hash(seed, x + (i & 1), y + (i >> 1 & 1), z + (i >> 2));
		cell->slope[i] = wh_v3(centred(h), centred(h >> 21), centred(h >> 42));
	}
}

/* Height at offset p from the cell's low corner that the slope at its corner i makes. */
static double corner(const synth_cell *cell, unsigned i, wh_vec3 p)
{
	const wh_vec3 from = wh_v3((double)(i & 1), (double)(i >> 1 & 1), (double)(i >> 2));
	return wh_dot(cell->slope[i], wh_sub(p, from));
}

static double octave_at(const synth_octave *o, wh_vec3 p, synth_cell *cell)
{
	const double px = p.x * o->frequency + o->shift[0];
	const double py = p.y * o->frequency + o->shift[1];
	const double pz = p.z * o->frequency + o->shift[2];
	const uint32_t x = (uint32_t)(int32_t)px;
	const uint32_t y = (uint32_t)(int32_t)py;
	const uint32_t z = (uint32_t)(int32_t)pz;
	if (cell->x != x || cell->y != y || cell->z != z)
		fill_cell(cell, o->seed, x, y, z);
	const wh_vec3 in =
	    wh_v3(px - (double)(int32_t)x, py - (double)(int32_t)y, pz - (double)(int32_t)z);
	const double tx = ease(in.x), ty = ease(in.y), tz = ease(in.z);
	double v[8];
	for (unsigned i = 0; i < 8; i++)
		v[i] = corner(cell, i, in);
	const double low = mix(mix(v[0], v[1], tx), mix(v[2], v[3], tx), ty);
	const double high = mix(mix(v[4], v[5], tx), mix(v[6], v[7], tx), ty);
	return 2.0 * mix(low, high, tz); /* deviation about 0.36 */
}

void synth_relief_init(synth_relief *r, uint64_t seed, double height, double longest,
                       double spacing)
{
	wh_rng rng = wh_rng_seed(seed);
	double wavelength = longest;
	double weight = 0.55;
	*r = (synth_relief){.height = height};
	while (r->n < SYNTH_OCTAVES && wavelength > 3.0 * spacing) {
		synth_octave *o = &r->octave[r->n++];
		const double fade = (wavelength / spacing - 3.0) / 3.0;
		o->frequency = 1.0 / wavelength;
		o->weight = weight * synth_smoothstep(fade);
		o->seed = wh_rng_next(&rng);
		for (int a = 0; a < 3; a++) /* 2^14 units at the highest frequency stay positive */
			o->shift[a] = 65536.0 + 1024.0 * wh_rng_unit(&rng);
		wavelength /= LACUNARITY;
		weight *= GAIN;
	}
}

double synth_relief_at(const synth_relief *r, wh_vec3 p, synth_cursor *k, double *rough)
{
	double sum = 0.0;
	double share = 1.0;
	for (int i = 0; i < r->n; i++) {
		const synth_octave *o = &r->octave[i];
		const double v = octave_at(o, p, &k->cell[i]);
		sum += v * o->weight * share;
		if (i == 1)
			share = 0.03 + 0.97 * synth_smoothstep(0.5 + 1.2 * v);
	}
	*rough = share;
	/* never seen; coordinates stay in range all the same */
	sum = sum > HIGHEST ? HIGHEST : sum < -HIGHEST ? -HIGHEST : sum;
	return r->height * sum;
}

void synth_sincos(double turns, double *sine, double *cosine)
{
	/* nearest quarter turn q, and the rest x, at most an eighth of a turn, in radians */
	const int q = (int)(turns * 4.0 + 16.5) - 16;
	const double x = (turns - 0.25 * q) * 6.283185307179586;
	const double y = x * x;
	double s = -1.0 / 39916800.0; /* Taylor: the first term left out is below 1e-11 */
	s = 1.0 / 362880.0 + y * s;
	s = -1.0 / 5040.0 + y * s;
	s = 1.0 / 120.0 + y * s;
	s = x + x * y * (-1.0 / 6.0 + y * s);
	double c = 1.0 / 479001600.0;
	c = -1.0 / 3628800.0 + y * c;
	c = 1.0 / 40320.0 + y * c;
	c = -1.0 / 720.0 + y * c;
	c = 1.0 / 24.0 + y * c;
	c = 1.0 + y * (-0.5 + y * c);
	const double sines[4] = {s, c, -s, -c};
	*sine = sines[q & 3];
	*cosine = sines[(q + 1) & 3];
}
