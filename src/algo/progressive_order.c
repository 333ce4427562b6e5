/*
 * The order of a progressive mesh.
 *
 * A run makes its collapses cluster by cluster and round by round. Two of them can be swapped when
 * no face is changed by one and looked at by the other, which is never so when no vertex of what
 * the first has changed is an end of the second's edge. So each vertex keeps the highest cost of
 * the collapses that changed a face of it or moved a corner of one, and a collapse takes its own
 * cost or what its two ends keep, whichever is highest. Sorted by that, equal ones in the order of
 * the run, every collapse comes behind all that it depends on; and when all up to some cost are
 * done, no more is done anywhere than that cost allows.
 *
 * What a collapse does to the faces is found by doing it: the corners of the vertex that goes
 * become the other's, a face that has both is gone. In the new order each does the same.
 *
 * Invariants: a face that is gone keeps its corners; lists may hold corners of faces that are gone.
 *
 * Cost: time in proportion to the faces around the vertices of all collapses, some 190 bytes a
 * vertex.
 */
#include "algo/progressive.h"

#include "base/sort.h"

#include <math.h>

typedef struct order {
	const wh_progressive_run *run;
	wh_progressive_order *out;
	float *mark; /* highest cost around each vertex */
	uint32_t moved;
	uint8_t *swap; /* a record */
} order;

static bool is_there(const order *o, uint32_t c)
{
	return !wh_progressive_is_dead(o->out, c / 3);
}

static void raise_mark(const order *o, uint32_t v, float cost)
{
	o->mark[v] = fmaxf(o->mark[v], cost);
}

/* Raises the marks of a face's corners. */
static void raise_face(const order *o, uint32_t c, float cost)
{
	const uint32_t *tri = &o->out->at.tri[(size_t)(c / 3) * 3];
	for (uint32_t k = 0; k < 3; k++)
		raise_mark(o, tri[k], cost);
}

/* The same around v, which has moved; corners of faces that are gone leave its list. */
static void raise_ring(const order *o, uint32_t v, float cost)
{
	const wh_corners *t = &o->out->at;
	uint32_t *link = &t->head[v];
	for (uint32_t c = *link; c != WH_NONE; c = t->next[c]) {
		if (!is_there(o, c))
			continue;
		raise_face(o, c, cost);
		*link = c;
		link = &t->next[c];
	}
	*link = WH_NONE;
}

static wh_code impossible(wh_ctx *c)
{
	return wh_fail(c, WH_E_RUN,
	               "the collapses of the run do not fit its mesh: the record of "
	               "them in the temporary folder is damaged");
}

/* The corners of u become v's; faces with both are gone. */
static wh_code turn_corners(wh_ctx *c, order *o, wh_progressive_step *s)
{
	wh_progressive_order *out = o->out;
	const wh_corners *t = &out->at;
	s->first = o->moved;
	for (uint32_t k = t->head[s->u], next; k != WH_NONE; k = next) {
		next = t->next[k];
		if (!is_there(o, k))
			continue;
		raise_face(o, k, s->cost);
		if (t->tri[wh_corner_after(k)] == s->v || t->tri[wh_corner_before(k)] == s->v) {
			if (s->ngone == 2)
				return impossible(c);
			s->gone[s->ngone++] = k / 3;
			out->dead[k / 3 >> 3] |= (uint8_t)(1U << (k / 3 & 7));
			continue;
		}
		if (wh_reserve(c, &out->moved, &out->cap_moved, (size_t)o->moved + 1,
		               sizeof *out->moved) != WH_OK)
			return c->err.code;
		out->moved[o->moved++] = k;
		t->tri[k] = s->v;
		wh_corners_enter(t, k);
	}
	t->head[s->u] = WH_NONE;
	return o->moved - s->first <= WH_PMESH_MOVED ? WH_OK : impossible(c);
}

/* What v had before goes to the step, and what it has after that to v. */
static void exchange(const order *o, uint32_t i)
{
	const wh_progressive_run *run = o->run;
	wh_progressive_step *s = &run->step[i];
	const wh_vec3 before = run->pos[s->v];
	const size_t n = run->attr_bytes;
	run->pos[s->v] = s->at;
	s->at = before;
	if (n == 0)
		return;
	memcpy(o->swap, run->attr + s->v * n, n);
	memcpy(run->attr + s->v * n, run->step_attr + i * n, n);
	memcpy(run->step_attr + i * n, o->swap, n);
}

static wh_code collapse(wh_ctx *c, order *o, uint32_t i)
{
	const wh_progressive_run *run = o->run;
	wh_progressive_step *s = &run->step[i];
	if (s->u >= run->nv || s->v >= run->nv || s->u == s->v)
		return impossible(c);
	const wh_vec3 to = s->at, from = run->pos[s->v];
	s->cost = fmaxf(s->cost, fmaxf(o->mark[s->u], o->mark[s->v]));
	if (turn_corners(c, o, s) != WH_OK)
		return c->err.code;
	exchange(o, i);
	raise_mark(o, s->v, s->cost);
	/* where v stays, no other face of it has changed */
	if (to.x != from.x || to.y != from.y || to.z != from.z)
		raise_ring(o, s->v, s->cost);
	return WH_OK;
}

/* Costs are not negative: their bits have the order of their values. */
static void rank_steps(const wh_progressive_run *run, uint64_t *rank)
{
	for (uint32_t i = 0; i < run->steps; i++) {
		const float cost = run->step[i].cost;
		uint32_t bits;
		memcpy(&bits, &cost, sizeof bits);
		rank[i] = (uint64_t)bits << 32 | i;
	}
	(void)wh_sort_unique(rank, run->steps);
}

static wh_code make_room(wh_ctx *c, order *o)
{
	const wh_progressive_run *run = o->run;
	wh_progressive_order *out = o->out;
	out->at.tri = run->tri;
	out->at.next = wh_alloc(c, 3 * (size_t)run->nf, sizeof *out->at.next);
	out->at.head = wh_alloc(c, run->nv, sizeof *out->at.head);
	out->dead = wh_calloc(c, (size_t)run->nf / 8 + 1, 1);
	o->mark = wh_calloc(c, run->nv, sizeof *o->mark);
	o->swap = wh_alloc(c, run->attr_bytes, 1);
	if (!out->at.next || !out->at.head || !out->dead || !o->mark || !o->swap)
		return wh_failed(c);
	return wh_reserve(c, &out->moved, &out->cap_moved, 4 * (size_t)run->steps,
	                  sizeof *out->moved);
}

static wh_code collapse_all(wh_ctx *c, order *o)
{
	const wh_progressive_run *run = o->run;
	wh_corners_fill(&o->out->at, run->nv, run->nf);
	for (uint32_t i = 0; i < run->steps; i++)
		if (wh_poll_at(c, i) != WH_OK || collapse(c, o, i) != WH_OK)
			return c->err.code;
	run->step[run->steps].first = o->moved;
	return WH_OK;
}

wh_code wh_progressive_sort(wh_ctx *c, const wh_progressive_run *run, wh_progressive_order *out)
{
	order o = {.run = run, .out = out};
	*out = (wh_progressive_order){0};
	wh_code code = make_room(c, &o);
	if (code == WH_OK)
		code = collapse_all(c, &o);
	wh_free(c, o.mark);
	wh_free(c, o.swap);
	if (code != WH_OK)
		return code;
	out->rank = wh_alloc(c, run->steps, sizeof *out->rank);
	if (!out->rank)
		return wh_failed(c);
	rank_steps(run, out->rank);
	return WH_OK;
}

void wh_progressive_order_free(wh_ctx *c, wh_progressive_order *o)
{
	wh_free(c, o->at.next);
	wh_free(c, o->at.head);
	wh_free(c, o->moved);
	wh_free(c, o->rank);
	wh_free(c, o->dead);
	*o = (wh_progressive_order){0};
}
