/*
 * Changes of topology, for noisy scans that are to become much smaller than their noise.
 *
 * The link condition forbids a collapse that would make an edge with four faces or a vertex with
 * two fans. Here such a collapse is done all the same, and what it would pinch together is taken
 * apart (cutting and capping along the pinched cycle, as in Guskov & Wood, "Topological noise
 * removal", 2001, and Garland & Heckbert's vertex contractions made manifold). The neighbours of
 * the new vertex, in order, are written down as one list, going from the ring of one end over to
 * that of the other:
 *
 *   neck    the list goes through a vertex w twice. Cut in two there, it is two rings, and the
 *           surface comes apart along the triangle of the edge and w: a handle is gone, or one part
 *           is two. w and the new vertex both become two vertices.
 *   hole    the same, where the triangle is a boundary loop: one of the two rings is nothing, and
 *           the hole is closed.
 *   bridge  both ends are on the boundary: two lists, hence two rings. The surface comes apart
 *           along the edge: two boundary loops become one, or one part two.
 *   shell   a part of a few faces with no collapse left in it goes as a whole.
 *
 * Sizes. Each is held back until its size, the longest edge of the triangle, the edge, or the
 * diagonal of the shell, is about that of the error of the moment: it waits in the queue at size^2
 * times the weight of the faces around, as a collapse that moved them all by that much would, times
 * a constant.
 *
 * Invariants: as for a collapse; none of the vertices is locked but perhaps neighbours, and no edge
 * between locked vertices is made.
 *
 * Cost: that of some ten collapses each; there are few.
 */
#include "algo/simplify_engine.h"

#include <math.h>
#include <string.h>

/* ---- the list of neighbours --------------------------------------------------------------- */

/* One of the two ends. */
typedef struct end {
	const uint32_t *ring;
	uint32_t n, at; /* at: place of the other end */
	bool closed;
	uint8_t mark; /* WH_OF_U or WH_OF_V */
} end;

static end end_of(const wh_engine *e, uint32_t v, uint32_t other, uint8_t mark)
{
	const wh_star *s = &e->w->star[v];
	const uint32_t *ring = wh_ring(e, v);
	return (end){ring, s->n, wh_ring_place(ring, other), s->closed, mark};
}

/* Appends `count` neighbours of one end from place `from` on, going round. The face behind each is
 * that end's. */
static void append(wh_sheet *t, const end *a, uint32_t from, uint32_t count)
{
	for (uint32_t i = 0; i < count; i++) {
		t->id[t->n] = a->ring[(from + i) % a->n];
		t->of[t->n] = t->face[t->n] = a->mark;
		t->n++;
	}
}

/* The last neighbour appended is an apex: both ends have it, and the face behind is the other's. */
static void join(wh_sheet *t, const end *next)
{
	t->of[t->n - 1] = WH_OF_U | WH_OF_V;
	t->face[t->n - 1] = next->mark;
}

/* Both ends inside. The list begins and ends with an apex. */
static void list_inside(wh_sheet *t, const end *a, const end *b)
{
	append(t, a, a->at + 1, a->n - 1);
	join(t, b);
	t->of[0] = WH_OF_U | WH_OF_V;
	append(t, b, b->at + 2, b->n - 3);
	t->closed = true;
}

/* One end, `a`, on the boundary. */
static void list_beside(wh_sheet *t, const end *a, const end *b)
{
	append(t, a, 0, a->at);
	join(t, b);
	append(t, b, b->at + 2, b->n - 3);
	append(t, a, a->at + 1, a->n - 1 - a->at);
	t->of[a->at + b->n - 3] = WH_OF_U | WH_OF_V;
}

/* Both on the boundary, the edge inside: one of the two lists. */
static void list_across(wh_sheet *t, const end *a, const end *b)
{
	append(t, a, 0, a->at);
	join(t, b);
	append(t, b, b->at + 2, b->n - b->at - 2);
}

/* A boundary edge; a's ring ends with it, b's begins. */
static void list_rim(wh_sheet *t, const end *a, const end *b)
{
	append(t, a, 0, a->n - 1);
	join(t, b);
	append(t, b, 2, b->n - 2);
}

/* Writes the lists down; returns how many there are. */
static uint32_t list_all(wh_surgery *s, const end *u, const end *v)
{
	s->sheet[0] = s->sheet[1] = (wh_sheet){0};
	if (s->nshared == 1) {
		if (u->at)
			list_rim(&s->sheet[0], u, v);
		else
			list_rim(&s->sheet[0], v, u);
		return 1;
	}
	if (u->closed && v->closed)
		list_inside(&s->sheet[0], u, v);
	else if (u->closed || v->closed)
		list_beside(&s->sheet[0], u->closed ? v : u, u->closed ? u : v);
	else {
		list_across(&s->sheet[0], u, v);
		list_across(&s->sheet[1], v, u);
		return 2;
	}
	return 1;
}

/* ---- taking apart ------------------------------------------------------------------------- */

/* The pairs of places in the list that hold the same vertex; i < j are those of the last. */
static uint32_t find_twice(const wh_sheet *t, uint32_t *i, uint32_t *j)
{
	uint32_t pairs = 0;
	for (uint32_t a = 0; a < t->n; a++)
		for (uint32_t b = a + 1; b < t->n; b++)
			if (t->id[a] == t->id[b]) {
				pairs++;
				*i = a;
				*j = b;
			}
	return pairs;
}

/* Takes neighbours i to j - 1 out of `t`. */
static void take_out(wh_sheet *t, uint32_t i, uint32_t j, wh_sheet *out)
{
	const uint32_t n = j - i, rest = t->n - j;
	memcpy(out->id, &t->id[i], n * sizeof *t->id);
	memcpy(out->of, &t->of[i], n * sizeof *t->of);
	memcpy(out->face, &t->face[i], n * sizeof *t->face);
	out->n = n;
	out->closed = true;
	memmove(&t->id[i], &t->id[j], rest * sizeof *t->id);
	memmove(&t->of[i], &t->of[j], rest * sizeof *t->of);
	memmove(&t->face[i], &t->face[j], rest * sizeof *t->face);
	t->n -= n;
}

/* w's ring in two: what lies between `from` and `to`, going round, and the others. False where
 * that is no part of an open ring. */
static bool part_ring(const wh_engine *e, wh_surgery *s, uint32_t from, uint32_t to)
{
	const wh_star *w = &e->w->star[s->w];
	const uint32_t *ring = wh_ring(e, s->w);
	const uint32_t a = wh_ring_place(ring, from), b = wh_ring_place(ring, to);
	if (!w->closed && a > b)
		return false;
	s->inner = s->outer = 0;
	for (uint32_t k = (a + 1) % w->n; k != b; k = (k + 1) % w->n)
		s->inside[s->inner++] = ring[k];
	for (uint32_t k = 0; !w->closed && k < a; k++)
		s->outside[s->outer++] = ring[k];
	s->outside[s->outer++] = wh_holder(0);
	for (uint32_t k = b + 1; !w->closed && k < w->n; k++)
		s->outside[s->outer++] = ring[k];
	for (uint32_t k = (b + 1) % w->n; w->closed && k != a; k = (k + 1) % w->n)
		s->outside[s->outer++] = ring[k];
	return true;
}

/* The list goes through w at places i and j: two rings. */
static bool cut_at(const wh_engine *e, wh_surgery *s, uint32_t i, uint32_t j)
{
	wh_sheet *t = &s->sheet[0];
	const uint32_t end_i = t->of[i] == WH_OF_U ? s->u : s->v;
	const uint32_t end_j = t->of[j] == WH_OF_U ? s->u : s->v;
	s->w = t->id[i];
	if (wh_is_locked(e, s->w) || (t->of[i] | t->of[j]) != (WH_OF_U | WH_OF_V) ||
	    t->of[i] == t->of[j])
		return false;
	if (part_ring(e, s, end_j, end_i)) {
		take_out(t, i, j, &s->sheet[1]);
	} else {
		/* the same the other way round: what was inside is outside */
		if (!t->closed || !part_ring(e, s, end_i, end_j))
			return false;
		take_out(t, i, j, &s->sheet[1]);
		const wh_sheet swap = s->sheet[0];
		s->sheet[0] = s->sheet[1];
		s->sheet[1] = swap;
	}
	if (t->n > 1 || t->closed)
		s->kind = WH_NECK;
	else {
		s->kind = WH_HOLE;
		s->sheet[0] = s->sheet[1];
	}
	return true;
}

/* Rings have this many neighbours or more. */
static bool is_ring(uint32_t n, bool closed)
{
	return n >= (closed ? 3U : 2U) && n <= WH_MOST_AROUND;
}

static bool rings_hold(const wh_engine *e, const wh_surgery *s)
{
	for (uint32_t k = 0; k < wh_surgery_sheets(s); k++)
		if (!is_ring(s->sheet[k].n, s->sheet[k].closed))
			return false;
	if (s->kind == WH_BRIDGE)
		return true;
	return is_ring(s->inner + 1, true) &&
	       (s->kind == WH_HOLE || is_ring(s->outer, e->w->star[s->w].closed));
}

/* ---- geometry ----------------------------------------------------------------------------- */

static double edge2(const wh_engine *e, uint32_t a, uint32_t b)
{
	return wh_norm2(wh_sub(e->w->star[a].pos, e->w->star[b].pos));
}

static double size2(const wh_engine *e, const wh_surgery *s)
{
	const double uv = edge2(e, s->u, s->v);
	if (s->kind == WH_BRIDGE)
		return uv;
	return fmax(uv, fmax(edge2(e, s->u, s->w), edge2(e, s->v, s->w)));
}

/* False when the face between p and q turns too much as its tip goes from `from` to `to`. */
static bool face_holds(wh_vec3 from, wh_vec3 to, wh_vec3 p, wh_vec3 q)
{
	const wh_vec3 edge = wh_sub(q, p);
	const wh_vec3 o = wh_cross(wh_sub(p, from), edge), n = wh_cross(wh_sub(p, to), edge);
	const double d = wh_dot(o, n), o2 = wh_norm2(o), n2 = wh_norm2(n);
	return !(o2 > 0) || (d > 0 && d * d >= WH_MIN_COSINE * WH_MIN_COSINE * o2 * n2);
}

static bool sheet_holds(const wh_engine *e, const wh_surgery *s, const wh_sheet *t)
{
	const wh_star *star = e->w->star;
	const uint32_t faces = t->n - !t->closed;
	for (uint32_t i = 0; i < faces; i++) {
		const uint32_t next = i + 1 < t->n ? i + 1 : 0;
		const uint32_t tip = t->face[i] == WH_OF_U ? s->u : s->v;
		if (!face_holds(star[tip].pos, s->at, star[t->id[i]].pos, star[t->id[next]].pos))
			return false;
	}
	return true;
}

/* ---- finding ------------------------------------------------------------------------------ */

static bool take_apart(const wh_engine *e, wh_surgery *s, const end *u, const end *v)
{
	uint32_t i = 0, j = 0;
	if (list_all(s, u, v) == 2) {
		s->kind = WH_BRIDGE;
		return find_twice(&s->sheet[0], &i, &j) == 0 &&
		       find_twice(&s->sheet[1], &i, &j) == 0;
	}
	return find_twice(&s->sheet[0], &i, &j) == 1 && cut_at(e, s, i, j);
}

bool wh_surgery_find(const wh_engine *e, const wh_trial *t, wh_surgery *s)
{
	if (t->into_locked)
		return false;
	s->u = t->u;
	s->v = t->v;
	s->w = WH_NONE;
	s->at = t->x;
	s->nshared = t->nshared;
	const end u = end_of(e, t->u, t->v, WH_OF_U), v = end_of(e, t->v, t->u, WH_OF_V);
	if (!take_apart(e, s, &u, &v) || !rings_hold(e, s) ||
	    (s->kind == WH_NECK && e->dead == WH_NONE))
		return false;
	s->size2 = size2(e, s);
	for (uint32_t k = 0; k < wh_surgery_sheets(s) && !e->lenient; k++)
		if (!sheet_holds(e, s, &s->sheet[k]))
			return false;
	return true;
}

double wh_surgery_distance(const wh_engine *e, const wh_surgery *s)
{
	float base = fmaxf(e->p->err[s->u], e->p->err[s->v]);
	if (s->w != WH_NONE)
		base = fmaxf(base, e->p->err[s->w]);
	return (double)base + sqrt(s->size2);
}

/* ---- making it so ------------------------------------------------------------------------- */

/* The neighbours of a new vertex have it in the place of the ends. */
static wh_code meet_neighbours(wh_engine *e, const wh_surgery *s, uint32_t k)
{
	const wh_sheet *t = &s->sheet[k];
	for (uint32_t i = 0; i < t->n; i++) {
		const uint32_t id = t->id[i];
		if (id == s->w || wh_is_locked(e, id))
			continue;
		if (t->of[i] & WH_OF_V)
			wh_ring_replace(e, id, s->v, wh_holder(k));
		if (t->of[i] == WH_OF_U)
			wh_ring_replace(e, id, s->u, wh_holder(k));
		else if ((t->of[i] & WH_OF_U) && wh_ring_remove(e, id, s->u) != WH_OK)
			return e->c->err.code;
	}
	return WH_OK;
}

static void name_in_rings(wh_engine *e, const wh_surgery *s, uint32_t k, uint32_t name)
{
	const wh_sheet *t = &s->sheet[k];
	for (uint32_t i = 0; i < t->n; i++)
		if (!wh_is_locked(e, t->id[i]))
			wh_ring_replace(e, t->id[i], wh_holder(k), name);
}

static void copy_attributes(const wh_engine *e, uint32_t from, uint32_t to)
{
	if (e->p->attr_bytes)
		memcpy(wh_patch_attr(e->p, to), wh_patch_attr(e->p, from), e->p->attr_bytes);
}

/* A vertex that is gone comes back as a second one of w. */
static uint32_t double_of(wh_engine *e, uint32_t w)
{
	const uint32_t d = e->dead;
	wh_star *star = e->w->star;
	e->dead = star[d].ring[0];
	star[d].ring[0] = WH_NONE;
	star[d].pos = star[w].pos;
	star[d].flag = star[w].flag;
	e->p->err[d] = e->p->err[w];
	copy_attributes(e, w, d);
	return d;
}

static void set_closed(wh_engine *e, uint32_t v, bool closed)
{
	wh_star *s = &e->w->star[v];
	s->closed = closed;
	s->flag = (uint8_t)(closed ? s->flag & ~WH_BORDER : s->flag | WH_BORDER);
}

/* w keeps what is outside, its second one gets what is inside; a hole's has no outside. */
static wh_code part_w(wh_engine *e, wh_surgery *s)
{
	uint32_t d = s->w;
	const uint32_t inner = s->kind == WH_HOLE ? 0 : 1;
	if (s->kind == WH_NECK) {
		d = double_of(e, s->w);
		if (wh_ring_set(e, s->w, s->outside, s->outer) != WH_OK)
			return e->c->err.code;
		for (uint32_t i = 0; i < s->inner; i++)
			if (!wh_is_locked(e, s->inside[i]))
				wh_ring_replace(e, s->inside[i], s->w, d);
	}
	s->inside[s->inner++] = wh_holder(inner);
	if (wh_ring_set(e, d, s->inside, s->inner) != WH_OK)
		return e->c->err.code;
	set_closed(e, d, true);
	wh_sheet *t = &s->sheet[inner];
	for (uint32_t i = 0; i < t->n; i++)
		t->id[i] = t->id[i] == s->w ? d : t->id[i];
	s->second = d;
	return WH_OK;
}

static wh_code make_vertex(wh_engine *e, const wh_surgery *s, uint32_t k, float err)
{
	const wh_sheet *t = &s->sheet[k];
	const uint32_t v = k ? s->u : s->v;
	if (wh_ring_set(e, v, t->id, t->n) != WH_OK)
		return e->c->err.code;
	e->w->star[v].pos = s->at;
	e->p->err[v] = err;
	if (k)
		copy_attributes(e, s->v, v);
	set_closed(e, v, t->closed);
	return WH_OK;
}

void wh_surgery_each(const wh_engine *e, const wh_surgery *s, void (*visit)(wh_engine *, uint32_t),
                     wh_engine *to)
{
	for (uint32_t k = 0; k < wh_surgery_sheets(s); k++) {
		visit(to, k ? s->u : s->v);
		for (uint32_t i = 0; i < s->sheet[k].n; i++)
			if (!wh_is_locked(e, s->sheet[k].id[i]))
				visit(to, s->sheet[k].id[i]);
	}
}

wh_code wh_surgery_perform(wh_engine *e, wh_surgery *s, double err)
{
	const uint32_t sheets = wh_surgery_sheets(s);
	for (uint32_t k = 0; k < sheets; k++)
		if (meet_neighbours(e, s, k) != WH_OK)
			return e->c->err.code;
	if (s->w != WH_NONE && part_w(e, s) != WH_OK)
		return e->c->err.code;
	for (uint32_t k = 0; k < sheets; k++)
		if (make_vertex(e, s, k, (float)err) != WH_OK)
			return e->c->err.code;
	if (sheets == 1 && wh_ring_set(e, s->u, NULL, 0) != WH_OK)
		return e->c->err.code;
	for (uint32_t k = 0; k < sheets; k++)
		name_in_rings(e, s, k, k ? s->u : s->v);
	wh_surgery_each(e, s, wh_star_renew, e);
	return WH_OK;
}

/* ---- shells ------------------------------------------------------------------------------- */

static bool add_member(wh_shell *s, uint32_t v)
{
	for (uint32_t i = 0; i < s->n; i++)
		if (s->id[i] == v)
			return true;
	if (s->n == WH_SHELL_MOST)
		return false;
	s->id[s->n++] = v;
	return true;
}

bool wh_shell_find(const wh_engine *e, uint32_t v, wh_shell *s)
{
	const wh_star *star = e->w->star;
	uint32_t faces = 0;
	wh_vec3 lo = star[v].pos, hi = lo;
	*s = (wh_shell){.n = 1, .id = {v}};
	for (uint32_t i = 0; i < s->n; i++) {
		const wh_star *m = &star[s->id[i]];
		const uint32_t *ring = wh_ring(e, s->id[i]);
		if (m->flag & WH_LOCKED)
			return false;
		for (uint32_t k = 0; k < m->n; k++)
			if (!add_member(s, ring[k]))
				return false;
		lo = wh_lower(lo, m->pos);
		hi = wh_upper(hi, m->pos);
		faces += m->n - !m->closed;
		s->weight += m->sum.xx + m->sum.yy + m->sum.zz; /* a face counts at each corner */
		s->err = fmaxf(s->err, e->p->err[s->id[i]]);
	}
	s->faces = faces / 3;
	s->weight /= 3;
	s->size2 = wh_norm2(wh_sub(hi, lo));
	return true;
}
