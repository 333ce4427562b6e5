/*
 * Torus: m rings of n samples, both ways around. V = mn, F = 2mn.
 *
 * Relief moves points away from the middle of the tube, by less than a third of its radius, and the
 * ring is wider than the tube: the surface cannot cut itself.
 *
 * Flat parts: where the tube's normal points up or down by more than t, the tube is cut at the
 * height t r; that is the share s of every ring for t = cos(pi s / 2).
 */
#include "algo/synth_internal.h"

static const double RING = 9000.0, TUBE = 3600.0;

static uint64_t distance(uint64_t x, uint64_t y)
{
	return x > y ? x - y : y - x;
}

/* Samples in the ratio of the radii, then the nearest product around that. */
static wh_code plan(wh_ctx *c, wh_synth *s)
{
	(void)c;
	const uint64_t cells = s->p.faces / 2;
	const uint64_t n = (uint64_t)sqrt((double)cells * (TUBE / RING));
	const uint64_t least = n > 6 ? n - 3 : 3;
	uint64_t best = UINT64_MAX;
	for (uint64_t y = least; y <= least + 6; y++) {
		const uint64_t near = (cells + y / 2) / y;
		const uint64_t x = near < 3 ? 3 : near;
		if (distance(x * y, cells) >= best)
			continue;
		best = distance(x * y, cells);
		s->dim[0] = x;
		s->dim[1] = y;
	}
	s->ncells = s->nv = s->dim[0] * s->dim[1];
	s->spacing = 6.283185307179586 * sqrt(RING * TUBE / (double)s->nv);
	double sine;
	synth_sincos(0.25 * s->p.flat, &sine, &s->flat_at);
	return WH_OK;
}

/* x: turns around the ring, y: turns around the tube, from its outside upwards. */
static wh_vec3 param(const wh_synth *s, uint64_t v, synth_cursor *cursor)
{
	(void)cursor;
	const uint64_t i = v / s->dim[1], j = v % s->dim[1];
	return wh_v3((double)i / (double)s->dim[0], (double)j / (double)s->dim[1], 0.0);
}

static synth_base base(const wh_synth *s, wh_vec3 at)
{
	double ring_sin, ring_cos, sine, cosine;
	synth_sincos(at.x, &ring_sin, &ring_cos);
	synth_sincos(at.y, &sine, &cosine);
	const double up = fabs(sine);
	double tube = TUBE;
	double mask = 1.0;
	if (s->p.flat > 0.0) {
		if (up >= s->flat_at)
			tube = TUBE * s->flat_at / up;
		mask = synth_smoothstep((s->flat_at - up) * 8.0);
	}
	const double out = RING + tube * cosine;
	return (synth_base){wh_v3(out * ring_cos, out * ring_sin, tube * sine),
	                    wh_v3(cosine * ring_cos, cosine * ring_sin, sine), mask};
}

static void steps(const wh_synth *s, wh_vec3 at, wh_vec3 step[2])
{
	(void)at;
	step[0] = wh_v3(0.5 / (double)s->dim[0], 0.0, 0.0);
	step[1] = wh_v3(0.0, 0.5 / (double)s->dim[1], 0.0);
}

static void quad(const wh_synth *s, uint64_t cell, synth_cursor *cursor, synth_quad *q)
{
	(void)cursor;
	const uint64_t m = s->dim[0], n = s->dim[1];
	const uint64_t i = cell / n, j = cell % n;
	const uint64_t i1 = i + 1 == m ? 0 : i + 1, j1 = j + 1 == n ? 0 : j + 1;
	*q = (synth_quad){{i * n + j, i1 * n + j, i1 * n + j1, i * n + j1}, 0.0};
}

const synth_shape synth_torus = {"torus", 3600.0, 3000.0, plan, param, base, steps, quad};
