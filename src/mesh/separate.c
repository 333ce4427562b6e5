#include "mesh/separate.h"

#include "mesh/sets.h"

#include <stdlib.h>
#include <string.h>

/* An edge at a vertex: the neighbour, the corner (place in p->tri) whose face it belongs to, and
 * whether the face goes from the vertex to the neighbour. */
typedef struct spoke {
	uint32_t to;
	uint32_t corner; /* place in the list of the vertex */
	uint32_t leaves;
} spoke;

/* The faces around a vertex that hold together; kept at the place of the first. */
typedef struct fan {
	uint32_t faces, last; /* last: the place of the last one */
	uint32_t name;        /* the vertex that it gets */
} fan;

typedef struct separate {
	wh_patch *p;
	uint32_t *first;  /* per vertex: its corners in `corner` */
	uint32_t *corner; /* places in p->tri, grouped by vertex */
	uint32_t *set;    /* per corner of the vertex at hand: its faces in sets */
	spoke *spoke;     /* of the vertex at hand */
	fan *fan;         /* per set */
	size_t cap_spoke, cap_set, cap_fan;
	uint64_t next_gid;
} separate;

static wh_code list_corners(wh_ctx *c, separate *s)
{
	const wh_patch *p = s->p;
	const size_t corners = 3 * (size_t)p->nf;
	s->first = wh_calloc(c, (size_t)p->nv + 2, sizeof *s->first);
	s->corner = wh_alloc(c, corners, sizeof *s->corner);
	if (!s->first || !s->corner)
		return wh_failed(c);
	for (size_t i = 0; i < corners; i++)
		s->first[p->tri[i] + 2]++;
	for (uint32_t v = 0; v < p->nv; v++)
		s->first[v + 2] += s->first[v + 1];
	for (size_t i = 0; i < corners; i++) /* first[v + 1] runs from v's begin to its end */
		s->corner[s->first[p->tri[i] + 1]++] = (uint32_t)i;
	return WH_OK;
}

static int compare_spokes(const void *a, const void *b)
{
	const spoke *x = a, *y = b;
	if (x->to != y->to)
		return x->to < y->to ? -1 : 1;
	return (x->corner > y->corner) - (x->corner < y->corner);
}

/* Holds the faces around v together that share a sound edge. */
static void join_faces(separate *s, uint32_t n)
{
	const spoke *e = s->spoke;
	wh_sets_init(s->set, n);
	for (uint32_t i = 0, j; i < 2 * n; i = j) {
		for (j = i + 1; j < 2 * n && e[j].to == e[i].to; j++) {
		}
		if (j - i != 2 || e[i].leaves == e[i + 1].leaves)
			continue;
		(void)wh_sets_join(s->set, e[i].corner, e[i + 1].corner);
	}
}

static void count_fans(separate *s, uint32_t n)
{
	memset(s->fan, 0, n * sizeof *s->fan);
	for (uint32_t i = 0; i < n; i++) {
		fan *f = &s->fan[wh_sets_find(s->set, i)];
		f->faces++;
		f->last = i;
	}
}

static wh_code fit(wh_ctx *c, separate *s, uint32_t n)
{
	if (wh_reserve(c, &s->spoke, &s->cap_spoke, 2 * (size_t)n, sizeof *s->spoke) != WH_OK ||
	    wh_reserve(c, &s->set, &s->cap_set, n, sizeof *s->set) != WH_OK)
		return c->err.code;
	return wh_reserve(c, &s->fan, &s->cap_fan, n, sizeof *s->fan);
}

/* The two edges of each face of v that meet in it, sorted by neighbour. */
static void list_spokes(separate *s, const uint32_t *corner, uint32_t n)
{
	const uint32_t *tri = s->p->tri;
	for (uint32_t i = 0; i < n; i++) {
		const uint32_t at = corner[i], face = at - at % 3;
		s->spoke[(size_t)2 * i] = (spoke){tri[face + (at + 1) % 3], i, 1};
		s->spoke[(size_t)2 * i + 1] = (spoke){tri[face + (at + 2) % 3], i, 0};
	}
	qsort(s->spoke, 2 * (size_t)n, sizeof *s->spoke, compare_spokes);
}

static wh_code grow(wh_ctx *c, wh_patch *p)
{
	size_t pos = p->cap_v, gid = p->cap_v, flag = p->cap_v, err = p->cap_v;
	const size_t n = (size_t)p->nv + 1;
	if (n <= p->cap_v)
		return WH_OK;
	if (n >= WH_NONE - 3)
		return wh_fail(c, WH_E_PLAN, "more than 4 G vertices in one piece");
	if (wh_reserve(c, &p->pos, &pos, n, sizeof *p->pos) != WH_OK ||
	    wh_reserve(c, &p->gid, &gid, n, sizeof *p->gid) != WH_OK ||
	    wh_reserve(c, &p->flag, &flag, n, sizeof *p->flag) != WH_OK ||
	    wh_reserve(c, &p->err, &err, n, sizeof *p->err) != WH_OK)
		return c->err.code;
	if (p->attr_bytes && wh_reserve(c, &p->attr, &p->cap_attr, n * p->attr_bytes, 1) != WH_OK)
		return c->err.code;
	p->cap_v = pos < UINT32_MAX ? (uint32_t)pos : UINT32_MAX;
	return WH_OK;
}

static wh_code double_vertex(wh_ctx *c, separate *s, uint32_t v, uint32_t *twin)
{
	wh_patch *p = s->p;
	if (grow(c, p) != WH_OK)
		return c->err.code;
	*twin = p->nv++;
	p->pos[*twin] = p->pos[v];
	p->gid[*twin] = s->next_gid++;
	p->flag[*twin] = p->flag[v];
	p->err[*twin] = p->err[v];
	if (p->attr_bytes)
		memcpy(wh_patch_attr(p, *twin), wh_patch_attr(p, v), p->attr_bytes);
	return WH_OK;
}

/* True when the fan of face i is that face and another one with the same three corners. */
static bool is_pillow(const separate *s, const uint32_t *corner, uint32_t i)
{
	const uint32_t *tri = s->p->tri;
	const uint32_t a = corner[i], b = corner[s->fan[i].last], f = a - a % 3, g = b - b % 3;
	return s->fan[i].faces == 2 && tri[f + (a + 1) % 3] == tri[g + (b + 2) % 3] &&
	       tri[f + (a + 2) % 3] == tri[g + (b + 1) % 3];
}

/* The first fan keeps v; every other gets a vertex of its own, a pillow none. */
static wh_code name_fans(wh_ctx *c, separate *s, uint32_t v, const uint32_t *corner, uint32_t n)
{
	bool kept = false;
	for (uint32_t i = 0; i < n; i++) {
		fan *f = &s->fan[i];
		if (wh_sets_find(s->set, i) != i)
			continue;
		if (is_pillow(s, corner, i))
			f->name = WH_NONE;
		else if (kept && double_vertex(c, s, v, &f->name) != WH_OK)
			return c->err.code;
		else if (!kept) {
			f->name = v;
			kept = true;
		}
	}
	for (uint32_t i = 0; i < n; i++)
		s->corner[corner - s->corner + i] = s->fan[wh_sets_find(s->set, i)].name;
	return WH_OK;
}

/* Finds the fans of v. What its corners become is kept in their places in the list, as v's
 * neighbours still go by the old names. */
static wh_code look_at(wh_ctx *c, separate *s, uint32_t v)
{
	const uint32_t n = s->first[v + 1] - s->first[v];
	const uint32_t *corner = &s->corner[s->first[v]];
	if (n == 0)
		return WH_OK;
	if (fit(c, s, n) != WH_OK)
		return c->err.code;
	list_spokes(s, corner, n);
	join_faces(s, n);
	count_fans(s, n);
	return name_fans(c, s, v, corner, n);
}

/* The corners of a vertex are in the order of the faces: going through all faces once more finds
 * each corner's new name next in its vertex's list. Returns the number of faces that went. */
static uint32_t rename_corners(separate *s)
{
	wh_patch *p = s->p;
	uint32_t *to = p->tri;
	for (uint32_t f = 0; f < p->nf; f++) {
		uint32_t name[3];
		for (size_t k = 0; k < 3; k++)
			name[k] = s->corner[s->first[p->tri[3 * (size_t)f + k]]++];
		if (name[0] == WH_NONE || name[1] == WH_NONE || name[2] == WH_NONE)
			continue;
		if (p->face_bytes)
			memmove(wh_patch_face(p, (uint32_t)((size_t)(to - p->tri) / 3)),
			        wh_patch_face(p, f), p->face_bytes);
		memcpy(to, name, sizeof name);
		to += 3;
	}
	const uint32_t before = p->nf;
	p->nf = (uint32_t)((size_t)(to - p->tri) / 3);
	return before - p->nf;
}

/* Vertices that only pillows had go. */
static wh_code drop_unused(wh_ctx *c, wh_patch *p)
{
	uint32_t *map = wh_alloc(c, p->nv, sizeof *map);
	if (!map)
		return wh_failed(c);
	(void)wh_patch_compact(p, map);
	wh_free(c, map);
	return WH_OK;
}

wh_code wh_separate(wh_ctx *c, wh_patch *p, uint64_t next_gid, wh_separated *result)
{
	separate s = {.p = p, .next_gid = next_gid};
	const uint32_t nv = p->nv;
	wh_code code = list_corners(c, &s);
	for (uint32_t v = 0; code == WH_OK && v < nv; v++) {
		code = wh_poll_at(c, v);
		if (code == WH_OK)
			code = look_at(c, &s, v);
	}
	*result = (wh_separated){.doubled = p->nv - nv};
	if (code == WH_OK)
		result->pillows = rename_corners(&s) / 2;
	if (code == WH_OK && result->pillows)
		code = drop_unused(c, p);
	wh_free(c, s.first);
	wh_free(c, s.corner);
	wh_free(c, s.set);
	wh_free(c, s.spoke);
	wh_free(c, s.fan);
	return code;
}
