/*
 * Stars. A free vertex knows its neighbours in order, and with them its faces: no list of faces is
 * kept while collapses are done. Locked vertices need no star: what is around them is known to
 * their free neighbours, and faces between locked vertices stay as they are.
 *
 * A star is made from the faces around a vertex, each a step from one neighbour to the next. When
 * the steps form one path or one cycle through all neighbours, the vertex is manifold, and the path
 * is its ring; else it is fixed.
 */
#include "algo/simplify_engine.h"

#include <string.h>

/* ---- rings -------------------------------------------------------------------------------- */

/* 0: in the star; else one more than the class of the overflow. */
static uint32_t ring_class(uint32_t n)
{
	return n <= WH_RING_INLINE       ? 0
	       : n <= 2 * WH_RING_INLINE ? 1
	       : n <= 4 * WH_RING_INLINE ? 2
	                                 : 3;
}

static uint32_t class_room(uint32_t class)
{
	return (uint32_t)WH_RING_INLINE << class;
}

static wh_code overflow_take(wh_engine *e, uint32_t class, uint32_t *at)
{
	struct wh_simplify_workspace *w = e->w;
	uint32_t *free_head = &w->overflow_free[class - 1];
	if (*free_head != WH_NONE) {
		*at = *free_head;
		*free_head = w->overflow[*at];
		return WH_OK;
	}
	const size_t end = w->overflow_used + class_room(class);
	if (wh_reserve(e->c, &w->overflow, &w->overflow_cap, end, sizeof *w->overflow) != WH_OK)
		return e->c->err.code;
	*at = (uint32_t)w->overflow_used;
	w->overflow_used = end;
	return WH_OK;
}

/* The faces of a ring that steps made. */
static wh_code set_slots(wh_engine *e, uint32_t v, const uint32_t *a, const uint32_t *face,
                         uint32_t n)
{
	uint32_t slot[WH_MOST_AROUND];
	const wh_star *s = &e->w->star[v];
	const uint32_t *r = wh_ring(e, v);
	for (uint32_t k = 0; k < s->n - !s->closed; k++) {
		slot[k] = WH_NONE;
		for (uint32_t i = 0; i < n; i++)
			slot[k] = a[i] == r[k] ? face[i] : slot[k];
	}
	return wh_slots_set(e, v, slot);
}

static void overflow_give(struct wh_simplify_workspace *w, uint32_t class, uint32_t at)
{
	w->overflow[at] = w->overflow_free[class - 1];
	w->overflow_free[class - 1] = at;
}

wh_code wh_ring_set(wh_engine *e, uint32_t v, const uint32_t *id, uint32_t n)
{
	wh_star *s = &e->w->star[v];
	const uint32_t was = ring_class(s->n), class = ring_class(n);
	uint32_t at = s->ring[0];
	if (class != was) {
		if (was)
			overflow_give(e->w, was, at);
		if (class && overflow_take(e, class, &at) != WH_OK)
			return e->c->err.code;
	}
	s->n = n;
	if (class) {
		s->ring[0] = at;
		memcpy(&e->w->overflow[at], id, n * sizeof *id);
		return WH_OK;
	}
	for (uint32_t i = 0; i < WH_RING_INLINE; i++)
		s->ring[i] = i < n ? id[i] : WH_NONE;
	return WH_OK;
}

wh_code wh_ring_remove(wh_engine *e, uint32_t v, uint32_t id)
{
	wh_star *s = &e->w->star[v];
	uint32_t *r = wh_ring(e, v);
	const uint32_t i = wh_ring_place(r, id);
	memmove(&r[i], &r[i + 1], (s->n - i - 1) * sizeof *r);
	if (ring_class(s->n - 1) != ring_class(s->n)) {
		uint32_t copy[WH_MOST_AROUND];
		memcpy(copy, r, (s->n - 1) * sizeof *r);
		return wh_ring_set(e, v, copy, s->n - 1);
	}
	s->n--;
	if (s->n < WH_RING_INLINE)
		r[s->n] = WH_NONE;
	return WH_OK;
}

void wh_ring_replace(wh_engine *e, uint32_t v, uint32_t id, uint32_t by)
{
	const wh_star *s = &e->w->star[v];
	uint32_t *r = wh_ring(e, v);
	const uint32_t n = s->n <= WH_RING_INLINE ? WH_RING_INLINE : s->n;
	for (uint32_t i = 0; i < n; i++)
		r[i] = r[i] == id ? by : r[i];
}

/* ---- building ----------------------------------------------------------------------------- */

/* The two corners of f after v, in the face's direction. Which corner v is follows no pattern, so
 * nothing here is left to be predicted: two bits in each of two small tables tell the others. */
static inline void face_others(const uint32_t *t, uint32_t v, uint32_t *a, uint32_t *b)
{
	enum { NEXT = 1 | 2 << 2 | 0 << 4, LAST = 2 | 0 << 2 | 1 << 4 };
	const unsigned shift = (unsigned)(t[1] == v) * 2 + (unsigned)(t[2] == v) * 4;
	*a = t[(unsigned)NEXT >> shift & 3];
	*b = t[(unsigned)LAST >> shift & 3];
}

/* Lists the faces of each vertex: corner[first[v]] to corner[first[v + 1]]. */
static void list_faces(wh_engine *e)
{
	struct wh_simplify_workspace *w = e->w;
	const wh_patch *p = e->p;
	memset(w->first, 0, ((size_t)p->nv + 2) * sizeof *w->first);
	for (size_t i = 0; i < 3 * (size_t)p->nf; i++)
		w->first[p->tri[i] + 2]++;
	for (uint32_t v = 0; v < p->nv; v++)
		w->first[v + 2] += w->first[v + 1];
	for (uint32_t f = 0; f < p->nf; f++) /* first[v + 1] runs from v's begin to its end */
		for (int k = 0; k < 3; k++)
			w->corner[w->first[p->tri[3 * (size_t)f + (size_t)k] + 1]++] = f;
}

/* The steps around a vertex: from neighbour a[i] to b[i]. */
typedef struct steps {
	uint32_t n, a[WH_MOST_AROUND], b[WH_MOST_AROUND];
	uint32_t ring[WH_MOST_AROUND + 1];
} steps;

enum { NO_STEP = UINT16_MAX };

static wh_mark *mark_of(struct wh_simplify_workspace *w, uint32_t id)
{
	wh_mark *m = &w->mark[id];
	if (m->tick != w->tick)
		*m = (wh_mark){w->tick, NO_STEP, NO_STEP};
	return m;
}

/* Marks which step starts and which ends at each neighbour. False when two do. */
static bool mark_steps(struct wh_simplify_workspace *w, const steps *s)
{
	bool single = true;
	w->tick++;
	for (uint32_t i = 0; i < s->n; i++) {
		wh_mark *a = mark_of(w, s->a[i]);
		single = single && a->first == NO_STEP;
		a->first = (uint16_t)i;
		wh_mark *b = mark_of(w, s->b[i]);
		single = single && b->second == NO_STEP;
		b->second = (uint16_t)i;
	}
	return single;
}

/* Follows the steps from step i; with each neighbour in at most two of them, a walk through all
 * is one path or one cycle. Returns the number of neighbours, 0 when steps are left over. */
static uint32_t walk(struct wh_simplify_workspace *w, steps *s, uint32_t i, bool closed)
{
	for (uint32_t k = 0;; k++) {
		s->ring[k] = s->a[i];
		const uint32_t next = w->mark[s->b[i]].first;
		if (k + 1 == s->n) {
			if (!closed)
				s->ring[k + 1] = s->b[i];
			return closed ? s->n : s->n + 1;
		}
		if (next == NO_STEP || s->a[next] == s->ring[0])
			return 0;
		i = next;
	}
}

enum { FEW = 8 };
typedef uint32_t four __attribute__((vector_size(4 * sizeof(uint32_t))));

/* Of each of up to eight steps, one more than the place of the step that starts where it ends; 0:
 * no step does. Where two do it may be the place of neither. */
static void find_next(const steps *s, uint32_t next[FEW])
{
	four b[2], at[2] = {{0}, {0}};
	memcpy(b, s->b, sizeof b);
	for (uint32_t i = 0; i < FEW; i++) {
		at[0] |= (four)(b[0] == s->a[i]) & (i + 1);
		at[1] |= (four)(b[1] == s->a[i]) & (i + 1);
	}
	memcpy(next, at, sizeof at);
}

/* Most vertices are like this: inside, with few faces. True when the steps are one cycle through
 * all neighbours, which is the ring then. */
static bool walk_few(steps *s)
{
	uint32_t next[FEW], i = 0;
	if (s->n < 3 || s->n > FEW)
		return false;
	for (uint32_t k = s->n; k < FEW; k++) {
		s->a[k] = WH_NONE;
		s->b[k] = WH_NONE - 1;
	}
	find_next(s, next);
	for (uint32_t k = 0; k < s->n; k++) {
		s->ring[k] = s->a[i];
		const uint32_t b = s->b[i];
		i = next[i] - 1;
		if (i >= s->n || s->a[i] != b || (i == 0 && k + 1 < s->n))
			return false;
	}
	return i == 0;
}

/* The ring of v is that of the steps, of n neighbours. */
static wh_code set_ring(wh_engine *e, uint32_t v, const steps *s, uint32_t n, const uint32_t *face)
{
	if (wh_ring_set(e, v, s->ring, n) != WH_OK)
		return e->c->err.code;
	return e->wedges && n ? set_slots(e, v, s->a, face, s->n) : WH_OK;
}

/* Finds what kind of vertex v is, and its ring when it is free. The marks of two faces on the same
 * three vertices make a cycle of two: not manifold either. */
static wh_code classify(wh_engine *e, uint32_t v)
{
	struct wh_simplify_workspace *w = e->w;
	wh_star *star = &w->star[v];
	const uint32_t *face = &w->corner[w->first[v]];
	steps s;
	s.n = w->first[v + 1] - w->first[v];
	if (s.n >= WH_MOST_AROUND) {
		star->flag |= WH_HUB;
		return WH_OK;
	}
	for (uint32_t i = 0; i < s.n; i++)
		face_others(&e->p->tri[3 * (size_t)face[i]], v, &s.a[i], &s.b[i]);
	if (walk_few(&s)) {
		star->closed = true;
		return star->flag & WH_LOCKED ? WH_OK : set_ring(e, v, &s, s.n, face);
	}
	const bool single = mark_steps(w, &s);
	uint32_t starts = 0, ends = 0, start = 0;
	for (uint32_t i = 0; i < s.n; i++) {
		ends += w->mark[s.b[i]].first == NO_STEP;
		if (w->mark[s.a[i]].second != NO_STEP)
			continue;
		starts++;
		start = i;
	}
	if (starts + ends) {
		star->flag |= WH_BORDER;
		e->result->border++;
	}
	const uint32_t n = single && starts < 2 && s.n ? walk(w, &s, start, starts == 0) : 0;
	if (s.n && (n == 0 || (starts == 0 && n < 3))) {
		e->result->fixed += !(star->flag & WH_FIXED);
		star->flag |= WH_FIXED;
	}
	if ((star->flag & WH_BORDER) && e->params->lock_boundary)
		star->flag |= WH_FIXED;
	if (star->flag & WH_LOCKED)
		return WH_OK;
	star->closed = starts == 0;
	return set_ring(e, v, &s, n, face);
}

static bool all_locked(const wh_engine *e, const uint32_t *t)
{
	return wh_is_locked(e, t[0]) && wh_is_locked(e, t[1]) && wh_is_locked(e, t[2]);
}

/* Faces between locked vertices come first, in their order; the others are in the stars now, and
 * nowhere else. */
static void keep_still(wh_engine *e)
{
	wh_patch *p = e->p;
	e->still = 0;
	if (e->wedges)
		return; /* all faces stay in the patch, with what they carry */
	for (uint32_t f = 0; f < p->nf; f++) {
		const uint32_t *t = &p->tri[3 * (size_t)f];
		if (all_locked(e, t))
			memmove(&p->tri[3 * (size_t)e->still++], t, 3 * sizeof *t);
	}
}

static wh_code make_room(wh_engine *e)
{
	struct wh_simplify_workspace *w = e->w;
	const wh_patch *p = e->p;
	if (wh_renew(e->c, &w->star, &w->cap_star, p->nv, sizeof *w->star) != WH_OK ||
	    wh_renew(e->c, &w->mark, &w->cap_mark, p->nv, sizeof *w->mark) != WH_OK ||
	    wh_renew(e->c, &w->first, &w->cap_first, (size_t)p->nv + 2, sizeof *w->first) !=
	        WH_OK ||
	    wh_renew(e->c, &w->corner, &w->cap_corner, 3 * (size_t)p->nf, sizeof *w->corner) !=
	        WH_OK)
		return e->c->err.code;
	wh_mem_scattered(w->star);
	return WH_OK;
}

/* Sums and guesses. What faces add to locked vertices is taken away again. */
static void sum_all(wh_engine *e)
{
	const wh_patch *p = e->p;
	wh_star *star = e->w->star;
	wh_stars_sum(star, p->tri, p->nf);
	for (uint32_t v = 0; v < p->nv; v++)
		if (star[v].n)
			wh_star_guess(e, v);
		else
			star[v].sum = (wh_vertex_sum){0};
}

wh_code wh_stars_build(wh_engine *e)
{
	struct wh_simplify_workspace *w = e->w;
	const wh_patch *p = e->p;
	if (make_room(e) != WH_OK || (e->wedges && wh_wedges_begin(e) != WH_OK))
		return e->c->err.code;
	memset(w->mark, 0, p->nv * sizeof *w->mark);
	w->tick = 0;
	w->overflow_used = 0;
	for (int i = 0; i < WH_OVERFLOW_CLASSES; i++)
		w->overflow_free[i] = WH_NONE;
	list_faces(e);
	for (uint32_t v = 0; v < p->nv; v++) {
		wh_star *s = &w->star[v];
		s->pos = p->pos[v];
		s->flag = p->flag[v] & (uint8_t) ~(WH_BORDER | WH_HUB | WH_EDGED);
		s->n = 0;
		s->sum = (wh_vertex_sum){0};
		if (wh_poll_at(e->c, v) != WH_OK ||
		    (!(s->flag & WH_CUT) && classify(e, v) != WH_OK))
			return e->c->err.code;
	}
	sum_all(e);
	if (e->policy && wh_policy_begin(e) != WH_OK)
		return e->c->err.code;
	keep_still(e);
	if (e->wedges)
		wh_wedges_mark(e);
	return WH_OK;
}

/* ---- and back ----------------------------------------------------------------------------- */

/* A face is written by the first of its free vertices. */
static uint32_t *write_faces(const wh_engine *e, uint32_t v, uint32_t *to)
{
	const wh_star *s = &e->w->star[v];
	const uint32_t *r = wh_ring(e, v), faces = s->n - !s->closed;
	for (uint32_t i = 0; i < faces; i++) {
		const uint32_t a = r[i], b = r[i + 1 < s->n ? i + 1 : 0];
		if ((a < v && !wh_is_locked(e, a)) || (b < v && !wh_is_locked(e, b)))
			continue;
		*to++ = v;
		*to++ = a;
		*to++ = b;
	}
	return to;
}

void wh_stars_unbuild(wh_engine *e)
{
	wh_patch *p = e->p;
	uint32_t *to = &p->tri[3 * (size_t)e->still];
	for (uint32_t v = 0; v < p->nv; v++) {
		const wh_star *s = &e->w->star[v];
		p->pos[v] = s->pos;
		p->flag[v] = s->flag;
		if (s->n && !e->wedges)
			to = write_faces(e, v, to);
	}
	if (e->wedges)
		wh_wedges_compact(e);
	else
		p->nf = (uint32_t)((size_t)(to - p->tri) / 3);
	(void)wh_patch_compact(p, e->w->first);
}
