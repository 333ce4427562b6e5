/*
 * Sphere: the surface of a grid of a x b x c box cells, blown up.
 *
 * Vertices row by row from below: the bottom face of the box, (a+1)(b+1) of them; then c-1
 * rings of 2(a+b) around its sides; then the top face. The rim of bottom and top belongs to
 * them alone, so that no vertex occurs twice. Cells in the same order: ab, c rings of 2(a+b),
 * ab. V = 2(ab+bc+ca) + 2 and F = 4(ab+bc+ca).
 *
 * Box coordinates in [-1, 1] are warped (about tan(pi u / 4)) before they are normalised, which
 * makes cells of nearly the same area. Relief moves points along their radius, so that the
 * surface is star-shaped about the origin: it cannot cut itself.
 *
 * Flat parts: where one coordinate of the unit direction exceeds t, the point is drawn back
 * along its radius to the plane of the cap's rim. Six caps that share the samples in question
 * have t = 1 - share / 3.
 */
#include "algo/synth_internal.h"

static const double RADIUS = 10000.0;

typedef struct box {
	uint64_t a, b, c;
	uint64_t cap;  /* vertices of bottom or top */
	uint64_t ring; /* around the sides */
} box;

static box box_of(const wh_synth *s)
{
	const uint64_t a = s->dim[0], b = s->dim[1], c = s->dim[2];
	return (box){a, b, c, (a + 1) * (b + 1), 2 * (a + b)};
}

static uint64_t faces_of(uint64_t a, uint64_t b, uint64_t c)
{
	return 4 * (a * b + b * c + c * a);
}

static uint64_t distance(uint64_t x, uint64_t y)
{
	return x > y ? x - y : y - x;
}

/* The box nearest to the wanted count among all within two cells of the cube. */
static wh_code plan(wh_ctx *c, wh_synth *s)
{
	(void)c;
	const uint64_t n = (uint64_t)sqrt((double)s->p.faces / 12.0);
	const uint64_t least = n > 2 ? n - 2 : 1;
	uint64_t best = UINT64_MAX;
	for (uint64_t x = least; x <= n + 2; x++)
		for (uint64_t y = x; y <= n + 2; y++)
			for (uint64_t z = y; z <= n + 2; z++) {
				const uint64_t off = distance(faces_of(x, y, z), s->p.faces);
				if (off >= best)
					continue;
				best = off;
				s->dim[0] = x;
				s->dim[1] = y;
				s->dim[2] = z;
			}
	s->ncells = faces_of(s->dim[0], s->dim[1], s->dim[2]) / 2;
	s->nv = s->ncells + 2;
	s->spacing = RADIUS * sqrt(12.566370614359172 / (double)s->nv);
	s->flat_at = 1.0 - s->p.flat / 3.0;
	return WH_OK;
}

/* Where step p of the way around the rim is, counter-clockwise from above. */
static void rim(const box *x, uint64_t p, uint64_t *i, uint64_t *j)
{
	if (p == x->ring)
		p = 0;
	if (p < x->a) {
		*i = p;
		*j = 0;
	} else if (p < x->a + x->b) {
		*i = x->a;
		*j = p - x->a;
	} else if (p < 2 * x->a + x->b) {
		*i = 2 * x->a + x->b - p;
		*j = x->b;
	} else {
		*i = 0;
		*j = x->ring - p;
	}
}

/* Vertex at step p of level k. */
static uint64_t side_vertex(const box *x, uint64_t p, uint64_t k)
{
	if (k > 0 && k < x->c)
		return x->cap + (k - 1) * x->ring + (p == x->ring ? 0 : p);
	uint64_t i, j;
	rim(x, p, &i, &j);
	const uint64_t first = k == 0 ? 0 : x->cap + (x->c - 1) * x->ring;
	return first + j * (x->a + 1) + i;
}

/* An odd polynomial near tan(pi u / 4), u in cells of n. */
static double warp(uint64_t at, uint64_t n)
{
	const double u = 2.0 * (double)at / (double)n - 1.0;
	const double y = u * u;
	return u * (0.7854 + y * (0.1675 + y * 0.0471));
}

static wh_vec3 param(const wh_synth *s, uint64_t v, synth_cursor *cursor)
{
	(void)cursor;
	const box x = box_of(s);
	const uint64_t sides = (x.c - 1) * x.ring;
	uint64_t i, j, k;
	if (v >= x.cap && v < x.cap + sides) {
		k = 1 + (v - x.cap) / x.ring;
		rim(&x, (v - x.cap) % x.ring, &i, &j);
	} else {
		k = v < x.cap ? 0 : x.c;
		const uint64_t at = v < x.cap ? v : v - x.cap - sides;
		i = at % (x.a + 1);
		j = at / (x.a + 1);
	}
	return wh_v3(warp(i, x.a), warp(j, x.b), warp(k, x.c));
}

static synth_base base(const wh_synth *s, wh_vec3 at)
{
	const wh_vec3 dir = wh_scale(at, 1.0 / wh_norm(at));
	const double top = fmax(fabs(dir.x), fmax(fabs(dir.y), fabs(dir.z)));
	if (s->p.flat > 0.0 && top >= s->flat_at)
		return (synth_base){wh_scale(dir, RADIUS * s->flat_at / top), dir, 0.0};
	const double mask = s->p.flat > 0.0 ? synth_smoothstep((s->flat_at - top) * 12.0) : 1.0;
	return (synth_base){wh_scale(dir, RADIUS), dir, mask};
}

/* Along the two axes across the longest one. */
static void steps(const wh_synth *s, wh_vec3 at, wh_vec3 step[2])
{
	const double e = 0.5 * s->spacing / RADIUS;
	const wh_vec3 axis[3] = {{e, 0.0, 0.0}, {0.0, e, 0.0}, {0.0, 0.0, e}};
	const double x = fabs(at.x), y = fabs(at.y), z = fabs(at.z);
	const int longest = x >= y && x >= z ? 0 : y >= z ? 1 : 2;
	const double coord[3] = {at.x, at.y, at.z};
	const int flip = coord[longest] < 0.0;
	step[flip] = axis[(longest + 1) % 3];
	step[1 - flip] = axis[(longest + 2) % 3];
}

/* Product of the cell's coordinates on its face of the box: large near corners, where cells are
 * rhombs and one diagonal is much shorter. */
static double skew_at(uint64_t i, uint64_t ni, uint64_t j, uint64_t nj)
{
	return ((double)(2 * i + 1) / (double)ni - 1.0) * ((double)(2 * j + 1) / (double)nj - 1.0);
}

static void cap_quad(const box *x, uint64_t at, bool top, synth_quad *q)
{
	const uint64_t i = at % x->a, j = at / x->a, row = x->a + 1;
	const uint64_t v = j * row + i + (top ? x->cap + (x->c - 1) * x->ring : 0);
	q->v[0] = v;
	q->v[1] = top ? v + 1 : v + row;
	q->v[2] = v + row + 1;
	q->v[3] = top ? v + row : v + 1;
	q->skew = skew_at(i, x->a, j, x->b);
}

static void side_quad(const box *x, uint64_t at, synth_quad *q)
{
	const uint64_t p = at % x->ring, k = at / x->ring;
	q->v[0] = side_vertex(x, p, k);
	q->v[1] = side_vertex(x, p + 1, k);
	q->v[2] = side_vertex(x, p + 1, k + 1);
	q->v[3] = side_vertex(x, p, k + 1);
	const uint64_t half = p % (x->a + x->b);
	q->skew = half < x->a ? skew_at(half, x->a, k, x->c) : skew_at(half - x->a, x->b, k, x->c);
}

static void quad(const wh_synth *s, uint64_t cell, synth_cursor *cursor, synth_quad *q)
{
	(void)cursor;
	const box x = box_of(s);
	const uint64_t cap = x.a * x.b, sides = x.c * x.ring;
	if (cell < cap)
		cap_quad(&x, cell, false, q);
	else if (cell < cap + sides)
		side_quad(&x, cell - cap, q);
	else
		cap_quad(&x, cell - cap - sides, true, q);
}

const synth_shape synth_sphere = {"sphere", 10000.0, 5000.0, plan, param, base, steps, quad};
