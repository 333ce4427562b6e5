/*
 * Who is around a vertex. The faces of a vertex stand one behind the other in a pool; a list that
 * grows moves to the pool's end, and a full pool is compacted. Rings are gathered when needed, in
 * time proportional to the number of faces, with marks that need no clearing.
 */
#include "algo/simplify_engine.h"

#include <string.h>

/* ---- rings -------------------------------------------------------------------------------- */

static wh_neighbour *ring_entry(wh_engine *e, wh_ring *r, uint32_t id)
{
	wh_simplify_work *w = e->w;
	if (w->mark[id] >> 32 == w->tick)
		return &r->item[(uint32_t)w->mark[id]];
	if (r->n == r->cap &&
	    wh_reserve(e->c, &r->item, &r->cap, (size_t)r->n + 1, sizeof *r->item) != WH_OK)
		return NULL;
	w->mark[id] = (uint64_t)w->tick << 32 | r->n;
	wh_neighbour *b = &r->item[r->n++];
	*b = (wh_neighbour){.id = id, .face = {WH_NONE, WH_NONE}};
	return b;
}

static void neighbour_add_face(wh_neighbour *b, uint32_t f)
{
	if (b->face[0] == WH_NONE)
		b->face[0] = f;
	else if (b->face[1] == WH_NONE)
		b->face[1] = f;
}

/* A new tick makes all marks old. */
static void next_tick(wh_engine *e)
{
	wh_simplify_work *w = e->w;
	if (++w->tick == 0) {
		memset(w->mark, 0, w->cap_v * sizeof *w->mark);
		w->tick = 1;
	}
}

/* The neighbours of v, with the faces that join them. */
wh_code wh_gather(wh_engine *e, uint32_t v, wh_ring *r)
{
	const wh_simplify_work *w = e->w;
	next_tick(e);
	r->n = 0;
	for (uint32_t i = 0; i < w->count[v]; i++) {
		const uint32_t f = w->pool[w->first[v] + i];
		uint32_t a, b;
		face_others(e->p, f, v, &a, &b);
		wh_neighbour *to = ring_entry(e, r, a);
		if (!to)
			return e->c->err.code;
		to->outgoing++;
		neighbour_add_face(to, f);
		wh_neighbour *from = ring_entry(e, r, b);
		if (!from)
			return e->c->err.code;
		from->incoming++;
		neighbour_add_face(from, f);
	}
	return WH_OK;
}

/* ---- lists -------------------------------------------------------------------------------- */

void wh_lists_build(wh_engine *e)
{
	wh_simplify_work *w = e->w;
	const wh_patch *p = e->p;
	memset(w->count, 0, p->nv * sizeof *w->count);
	for (size_t i = 0; i < 3 * (size_t)p->nf; i++)
		w->count[p->tri[i]]++;
	uint32_t at = 0;
	for (uint32_t v = 0; v < p->nv; v++) {
		w->first[v] = at;
		at += w->count[v];
		w->count[v] = 0;
	}
	for (uint32_t f = 0; f < p->nf; f++)
		for (int k = 0; k < 3; k++) {
			const uint32_t v = p->tri[3 * (size_t)f + (size_t)k];
			w->pool[w->first[v] + w->count[v]++] = f;
		}
	w->pool_used = 3 * (size_t)p->nf;
}

static void list_remove(wh_simplify_work *w, uint32_t v, uint32_t f)
{
	uint32_t *list = &w->pool[w->first[v]];
	const uint32_t n = w->count[v];
	uint32_t i = 0;
	while (i < n && list[i] != f)
		i++;
	for (; i + 1 < n; i++)
		list[i] = list[i + 1];
	if (n > 0)
		w->count[v] = n - 1;
}

/* Moves all lists to the front of the pool, in the order in which they lie. */
static wh_code pool_compact(wh_engine *e)
{
	wh_simplify_work *w = e->w;
	uint32_t *fresh = wh_alloc(e->c, w->pool_cap, sizeof *fresh);
	if (!fresh)
		return e->c->err.code;
	size_t at = 0;
	for (uint32_t v = 0; v < e->p->nv; v++) {
		memcpy(&fresh[at], &w->pool[w->first[v]], w->count[v] * sizeof *fresh);
		w->first[v] = (uint32_t)at;
		at += w->count[v];
	}
	wh_free(e->c, w->pool);
	w->pool = fresh;
	w->pool_used = at;
	return WH_OK;
}

/* v's list becomes its own faces and u's, without the shared ones. */
wh_code wh_lists_join(wh_engine *e, const wh_collapse *k)
{
	wh_simplify_work *w = e->w;
	const size_t need = (size_t)w->count[k->u] + w->count[k->v];
	if (w->pool_used + need > w->pool_cap && pool_compact(e) != WH_OK)
		return e->c->err.code;
	if (w->pool_used + need > w->pool_cap)
		return wh_fail(e->c, WH_E_RUN, "internal error: face lists do not fit");
	uint32_t *list = &w->pool[w->pool_used];
	uint32_t n = 0;
	const uint32_t ends[2] = {k->v, k->u};
	for (int j = 0; j < 2; j++)
		for (uint32_t i = 0; i < w->count[ends[j]]; i++) {
			const uint32_t f = w->pool[w->first[ends[j]] + i];
			if (!is_shared(k, f))
				list[n++] = f;
		}
	w->first[k->v] = (uint32_t)w->pool_used;
	w->count[k->v] = n;
	w->count[k->u] = 0;
	w->pool_used += n;
	return WH_OK;
}

void wh_faces_drop(wh_engine *e, const wh_collapse *k)
{
	for (uint32_t i = 0; i < k->nshared; i++) {
		const uint32_t f = k->shared[i];
		list_remove(e->w, apex_of(e, k, f), f);
		e->p->tri[3 * (size_t)f] = WH_NONE;
	}
	e->faces -= k->nshared;
	e->vertices--;
}

void wh_faces_move(wh_engine *e, const wh_collapse *k)
{
	const wh_simplify_work *w = e->w;
	for (uint32_t i = 0; i < w->count[k->v]; i++) {
		const uint32_t f = w->pool[w->first[k->v] + i];
		uint32_t *t = &e->p->tri[3 * (size_t)f];
		for (int j = 0; j < 3; j++)
			if (t[j] == k->u)
				t[j] = k->v;
		w->normal[f] = face_normal(e->p, f);
	}
}
