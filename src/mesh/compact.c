#include "mesh/compact.h"

#include <math.h>

enum { NUMBER_MOST = 5, FACE_MOST = 3 * 4 * NUMBER_MOST }; /* bytes of a number, of a face */

/* A place of the grid. */
typedef struct place {
	int32_t at[3];
} place;

typedef struct encoder {
	const wh_mesh *m;
	const wh_compact_grid *g;
	uint32_t *number; /* a vertex's, in the order of meeting them; WH_NONE: not met yet */
	uint32_t met;
	place last; /* corner before the next one */
	uint8_t *end;
} encoder;

wh_compact_grid wh_compact_grid_of(wh_vec3 lo, wh_vec3 hi)
{
	const double side = fmax(hi.x - lo.x, fmax(hi.y - lo.y, hi.z - lo.z));
	return (wh_compact_grid){lo, side > 0 && isfinite(side) ? side / WH_COMPACT_STEPS : 1};
}

static int32_t round_to_grid(double x)
{
	if (!(x > 0)) /* nor is what is no number */
		return 0;
	return x < WH_COMPACT_STEPS ? (int32_t)(x + 0.5) : WH_COMPACT_STEPS;
}

static place place_of(const encoder *e, uint32_t v)
{
	const wh_vec3 p = wh_sub(e->m->pos[v], e->g->origin);
	const double step = e->g->step;
	return (place){
	    {round_to_grid(p.x / step), round_to_grid(p.y / step), round_to_grid(p.z / step)}};
}

static void put_number(encoder *e, uint32_t n)
{
	for (; n >= 128; n >>= 7)
		*e->end++ = (uint8_t)(n | 128);
	*e->end++ = (uint8_t)n;
}

static void put_difference(encoder *e, int32_t d)
{
	put_number(e, d < 0 ? 2 * (uint32_t)-d - 1 : 2 * (uint32_t)d);
}

static void put_corner(encoder *e, uint32_t v)
{
	const place here = place_of(e, v);
	if (e->number[v] == WH_NONE) {
		put_number(e, 0);
		for (int i = 0; i < 3; i++)
			put_difference(e, here.at[i] - e->last.at[i]);
		e->number[v] = e->met++;
	} else {
		put_number(e, e->met - e->number[v]);
	}
	e->last = here;
}

static wh_code put_faces(wh_ctx *c, encoder *e, wh_compact *out)
{
	for (uint32_t f = 0; f < e->m->nf; f++) {
		if (wh_poll_at(c, f) != WH_OK ||
		    wh_reserve(c, &out->at, &out->cap, out->bytes + FACE_MOST, 1) != WH_OK)
			return c->err.code;
		e->end = out->at + out->bytes;
		for (int k = 0; k < 3; k++)
			put_corner(e, e->m->tri[3 * (size_t)f + (size_t)k]);
		out->bytes = (size_t)(e->end - out->at);
	}
	return WH_OK;
}

wh_code wh_compact_encode(wh_ctx *c, const wh_mesh *m, const wh_compact_grid *g, wh_compact *out)
{
	encoder e = {.m = m, .g = g};
	out->bytes = 0;
	e.number = wh_alloc(c, m->nv, sizeof *e.number);
	if (!e.number)
		return c->err.code;
	for (uint32_t v = 0; v < m->nv; v++)
		e.number[v] = WH_NONE;
	const wh_code code = put_faces(c, &e, out);
	out->nv = e.met;
	out->nf = m->nf;
	wh_free(c, e.number);
	return code;
}

void wh_compact_free(wh_ctx *c, wh_compact *m)
{
	wh_free(c, m->at);
	*m = (wh_compact){0};
}

/* Typical meshes take 6 to 8 bytes a face; the array doubles, and both are there for a moment. */
size_t wh_compact_bytes(uint64_t nv, uint64_t nf)
{
	enum { TYPICAL = 12, COPIES = 3 };
	return (size_t)nv * sizeof(uint32_t) + (size_t)COPIES * TYPICAL * (size_t)nf + FACE_MOST;
}
