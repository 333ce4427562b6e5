/*
 * What faces and their corners carry, through collapses.
 *
 * Idea. The mesh is joined by its positions; texture coordinates belong to the corners of faces,
 * and corners of a vertex with equal ones are one wedge of it (Hoppe, "New quadric metric for
 * simplifying meshes with appearance attributes", 1999). An edge is a border where its two faces
 * differ in what one of its ends carries, or in a label of the face (a material), and so is a
 * boundary edge: borders cut the surface into charts. A vertex on a border is edged.
 *
 *     the vertex that goes     it may go into          with
 *     not edged                one that is not edged   a new place, corners averaged as attributes
 *                                                      are (blend.c)
 *                              an edged one            that one's place and its wedge
 *     edged, on one border     its two neighbours on   the neighbour's place and, on either side,
 *     that passes through      that border             the neighbour's wedge of that side
 *     edged, else              none: three charts meet, or a border ends
 *
 * So no collapse joins two charts, and every texture coordinate on a border is one of the file. A
 * collapse is refused that turns a triangle of the texture over, or takes the last face of a chart
 * at its place: then a new corner lies in the kernel of the faces around it, and in its chart.
 *
 * Going along a border costs what the border, as a boundary on either side, sweeps (fan.c), and
 * what the texture is off there: the distance of the vertex' texture coordinates from those that
 * the new border has next to it, in units of length.
 *
 * Departures from Hoppe: borders keep old vertices instead of new ones in between. It takes nothing
 * but looking at records to find a wedge, nothing has to agree on two sides, and cutting and
 * joining pieces needs no care.
 *
 * Invariants. The ring of a free vertex has its faces beside it, in slots: slot i is the face
 * between neighbours i and i + 1. The patch's faces are current, and those that are gone begin with
 * WH_NONE.
 *
 * Changes of topology (surgery.c) make no face: what is closed or cut is so by faces that get
 * another corner. They are done where both ends of the edge have one wedge, which the new vertex
 * gets, or either of the two, between the two old ones.
 *
 * Cost: a comparison of records for each face around an edged vertex that is evaluated, two areas
 * for each face of a collapse; 64 bytes a vertex.
 */
#include "algo/simplify_engine.h"
#include "io/wedges.h"

#include <math.h>
#include <string.h>

enum { CORNER_MOST = 64, FACES_MOST = 2 * WH_ROW };

/* As of boundary edges in fan.c, on both sides. */
static const double BORDER_WEIGHT = 8.0;

/* A corner that gets another record. */
typedef struct change {
	uint32_t face, corner;
	uint8_t side; /* which of the two new records */
} change;

/* The collapse at hand. */
struct wh_wedge_plan {
	bool anchored; /* it goes to where the other end is, whose wedges stay */
	uint32_t n;
	change item[FACES_MOST];
	uint8_t fresh[2][CORNER_MOST];
	uint32_t dead[2]; /* faces on the edge, WH_NONE where there is none */
	uint32_t slot[WH_ROW];
	struct {
		uint32_t n, slot[WH_MOST_AROUND];
	} apex[2];
	/* of a change of topology: */
	uint32_t end[2]; /* the third vertices of the faces on the edge, WH_NONE without */
	uint32_t sheet[2][WH_ROW];
	uint32_t inside[WH_ROW], outside[WH_ROW]; /* of w */
};

/* ---- slots -------------------------------------------------------------------------------- */

wh_code wh_wedges_begin(wh_engine *e)
{
	struct wh_simplify_workspace *w = e->w;
	if (!w->wedge && !(w->wedge = wh_alloc(e->c, 1, sizeof *w->wedge)))
		return e->c->err.code;
	return wh_renew(e->c, &w->slot, &w->cap_slot, (size_t)e->p->nv * WH_RING_INLINE,
	                sizeof *w->slot);
}

static uint32_t faces_of(const wh_star *s)
{
	return s->n - !s->closed;
}

wh_code wh_slots_set(wh_engine *e, uint32_t v, const uint32_t *face)
{
	struct wh_simplify_workspace *w = e->w;
	if (wh_reserve(e->c, &w->overflow_slot, &w->cap_overflow_slot, w->overflow_cap,
	               sizeof *w->overflow_slot) != WH_OK)
		return e->c->err.code;
	memcpy(wh_slots(e, v), face, faces_of(&w->star[v]) * sizeof *face);
	return WH_OK;
}

/* Which corner of face f vertex v is. */
static uint32_t corner_place(const wh_engine *e, uint32_t f, uint32_t v)
{
	const uint32_t *t = &e->p->tri[3 * (size_t)f];
	return t[0] == v ? 0 : t[1] == v ? 1 : 2;
}

static uint8_t *record_at(const wh_engine *e, uint32_t f, uint32_t corner)
{
	return wh_wedges_corner(e->wedges, wh_patch_face(e->p, f), corner);
}

static uint8_t *record_of(const wh_engine *e, uint32_t f, uint32_t v)
{
	return record_at(e, f, corner_place(e, f, v));
}

/* ---- borders ------------------------------------------------------------------------------ */

/* The faces before and after neighbour k in the ring of v; WH_NONE where the surface ends. */
static void faces_beside(const wh_engine *e, uint32_t v, uint32_t k, uint32_t face[2])
{
	const wh_star *s = &e->w->star[v];
	const uint32_t *slot = wh_slots(e, v);
	face[0] = k > 0 ? slot[k - 1] : s->closed ? slot[s->n - 1] : WH_NONE;
	face[1] = k < faces_of(s) ? slot[k] : WH_NONE;
}

static bool same_corner(const wh_engine *e, const uint32_t face[2], uint32_t v)
{
	return memcmp(record_of(e, face[0], v), record_of(e, face[1], v),
	              e->wedges->corner.bytes) == 0;
}

/* Is the edge from v to neighbour k a border? */
static bool is_border(const wh_engine *e, uint32_t v, uint32_t k)
{
	uint32_t face[2];
	faces_beside(e, v, k, face);
	if (face[0] == WH_NONE || face[1] == WH_NONE)
		return true;
	return !same_corner(e, face, v) || !same_corner(e, face, wh_ring(e, v)[k]) ||
	       !wh_wedges_same_face(e->wedges, wh_patch_face(e->p, face[0]),
	                            wh_patch_face(e->p, face[1]));
}

static void mark(wh_engine *e, uint32_t v)
{
	wh_star *s = &e->w->star[v];
	bool edged = false;
	for (uint32_t k = 0; k < s->n && !edged; k++)
		edged = is_border(e, v, k);
	s->flag = (uint8_t)(edged ? s->flag | WH_EDGED : s->flag & ~WH_EDGED);
}

void wh_wedges_mark(wh_engine *e)
{
	for (uint32_t v = 0; v < e->p->nv; v++)
		mark(e, v);
}

/* The two neighbours along the one border that passes through v. False where it is not one, or the
 * boundary with another border at it. */
static bool border_through(const wh_engine *e, uint32_t v, uint32_t place[2])
{
	const uint32_t n = e->w->star[v].n;
	uint32_t found = 0;
	for (uint32_t k = 0; k < n; k++) {
		if (!is_border(e, v, k))
			continue;
		if (found == 2)
			return false;
		place[found++] = k;
	}
	return found == 2;
}

/* ---- what edges may do -------------------------------------------------------------------- */

static wh_vec3 spoke(const wh_fan *f, uint32_t i)
{
	return wh_rows3_at(&f->to, i);
}

/* How far the texture is off, squared and in units of length, where the hub, `was`, is left out
 * between two vertices of a border that are `length` apart; it projects to `along` of the way. */
static double texture_off2(const wh_engine *e, const uint8_t *was, const uint8_t *from,
                           const uint8_t *to, double along, double length)
{
	double h[2], a[2], b[2];
	if (!wh_wedges_uv(e->wedges, was, h) || !wh_wedges_uv(e->wedges, from, a) ||
	    !wh_wedges_uv(e->wedges, to, b))
		return 0;
	const double du = b[0] - a[0], dv = b[1] - a[1], uv2 = du * du + dv * dv;
	const double offu = h[0] - (a[0] + along * du), offv = h[1] - (a[1] + along * dv);
	const double off2 = offu * offu + offv * offv;
	return off2 > 0 ? off2 * length * length / uv2 : 0; /* by 0: as dear as can be */
}

/* What going from the hub to neighbour i along a border costs, p being its neighbour on the other
 * side. */
static double border_cost(const wh_engine *e, uint32_t hub, const wh_fan *f, uint32_t i, uint32_t p)
{
	const wh_star *s = &e->w->star[hub];
	const wh_vec3 to = spoke(f, i), from = spoke(f, p), chord = wh_sub(to, from);
	const double length2 = wh_norm2(chord), back = -wh_dot(from, chord);
	const double along = length2 > 0 ? fmin(fmax(back / length2, 0), 1) : 0;
	const double sweep =
	    s->closed ? BORDER_WEIGHT * wh_norm(from) * wh_norm2(wh_cross(from, to)) : 0;
	uint32_t at_i[2], at_p[2];
	double off2 = 0;
	faces_beside(e, hub, i, at_i);
	faces_beside(e, hub, p, at_p);
	for (int side = 0; side < 2; side++) { /* after i and before p; before i and after p */
		const uint32_t g = at_i[1 - side], h = at_p[side];
		if (g != WH_NONE && h != WH_NONE)
			off2 = fmax(off2,
			            texture_off2(e, record_of(e, g, hub), record_of(e, h, f->id[p]),
			                         record_of(e, g, f->id[i]), along, sqrt(length2)));
	}
	return sweep + (s->sum.xx + s->sum.yy + s->sum.zz) * off2;
}

/* Surgery may cut an edge from the boundary to the boundary, where nothing but that passes through
 * v. */
static bool may_be_bridge(const wh_engine *e, uint32_t v, uint32_t other)
{
	return e->surgery && (e->w->star[v].flag & e->w->star[other].flag & WH_BORDER) &&
	       !wh_is_locked(e, other);
}

void wh_wedges_bar(const wh_engine *e, uint32_t hub, wh_fan *f)
{
	uint32_t place[2];
	if (!(e->w->star[hub].flag & WH_EDGED)) {
		for (uint32_t i = 0; i < f->n; i++)
			if (e->w->star[f->id[i]].flag & WH_EDGED)
				f->locked.at[i] = 1.0;
		return;
	}
	const bool through = border_through(e, hub, place);
	for (uint32_t i = 0; i < f->n; i++) {
		f->locked.at[i] = 1.0;
		const bool along = through && (i == place[0] || i == place[1]);
		if (!along && !(through && may_be_bridge(e, hub, f->id[i])))
			f->bar.at[i] = (double)INFINITY;
	}
	for (int k = 0; through && k < 2; k++)
		f->bar.at[place[k]] += border_cost(e, hub, f, place[k], place[1 - k]);
}

/* ---- the collapse ------------------------------------------------------------------------- */

static void add_change(wh_engine *e, uint32_t face, uint32_t v, uint8_t side)
{
	struct wh_wedge_plan *p = e->w->wedge;
	p->item[p->n++] = (change){face, corner_place(e, face, v), side};
}

/* True when the edges from apex a to both ends are borders: the face between them is all that its
 * chart has there. */
static bool is_last(const wh_engine *e, uint32_t hub, uint32_t other, uint32_t a)
{
	if (!is_border(e, hub, wh_ring_place(wh_ring(e, hub), a)))
		return false;
	if (!wh_is_locked(e, other))
		return is_border(e, other, wh_ring_place(wh_ring(e, other), a));
	return wh_is_locked(e, a) || is_border(e, a, wh_ring_place(wh_ring(e, a), other));
}

/* The faces of the hub get the wedges that the other end has on the edge; behind the border through
 * the hub, that of the other side. */
static void plan_anchored(wh_engine *e, uint32_t hub, uint32_t i, uint32_t other)
{
	struct wh_wedge_plan *p = e->w->wedge;
	const wh_star *s = &e->w->star[hub];
	const uint32_t *slot = wh_slots(e, hub);
	const size_t size = e->wedges->corner.bytes;
	uint8_t side = p->dead[1] == WH_NONE;
	for (int k = 0; k < 2; k++) {
		const uint32_t face = p->dead[1 - k] != WH_NONE ? p->dead[1 - k] : p->dead[k];
		memcpy(p->fresh[k], record_of(e, face, other), size);
	}
	for (uint32_t step = 1; step < s->n; step++) {
		const uint32_t k = i + step < s->n ? i + step : i + step - s->n;
		if ((s->flag & WH_EDGED) && is_border(e, hub, k))
			side = 1;
		if (k < faces_of(s) && slot[k] != p->dead[0] && slot[k] != p->dead[1])
			add_change(e, slot[k], hub, side);
	}
}

/* The faces around the new vertex, in the order of its neighbours. */
static void find_slots(wh_engine *e, uint32_t hub, uint32_t other, const wh_trial *t)
{
	struct wh_wedge_plan *p = e->w->wedge;
	for (uint32_t i = 0; i < t->faces; i++) {
		const uint32_t from = t->theirs.at[i] > 0 ? other : hub;
		p->slot[i] = wh_slots(e, from)[wh_ring_place(wh_ring(e, from), t->id[i])];
	}
}

/* All faces around the new vertex get one new record. */
static void plan_blended(wh_engine *e, uint32_t hub, uint32_t other, const wh_trial *t)
{
	struct wh_wedge_plan *p = e->w->wedge;
	const uint8_t *record[WH_ROW + 2];
	record[0] = record_of(e, p->dead[0], hub);
	record[1] = record_of(e, p->dead[0], other);
	for (uint32_t i = 0; i < t->n; i++)
		record[2 + i] = record_of(e, p->slot[i], t->id[i]);
	wh_blend_corner(t, &e->wedges->corner, record, p->fresh[0]);
	for (uint32_t i = 0; i < t->faces; i++)
		add_change(e, p->slot[i], t->theirs.at[i] > 0 ? other : hub, 0);
}

/* Twice the area of a triangle of the texture, with corner `at` as in `record`; false without. */
static bool texture_area(const wh_engine *e, uint32_t f, uint32_t at, const uint8_t *record,
                         double *area)
{
	double uv[3][2];
	for (uint32_t k = 0; k < 3; k++)
		if (!wh_wedges_uv(e->wedges, k == at ? record : record_at(e, f, k), uv[k]))
			return false;
	*area = (uv[1][0] - uv[0][0]) * (uv[2][1] - uv[0][1]) -
	        (uv[2][0] - uv[0][0]) * (uv[1][1] - uv[0][1]);
	return true;
}

/* No triangle of the texture turns over or becomes nothing; one that was nothing may become what
 * those around it are. */
static bool keeps_sides(const wh_engine *e)
{
	const struct wh_wedge_plan *p = e->w->wedge;
	double was[FACES_MOST], sum = 0, area;
	for (uint32_t i = 0; e->wedges->corner.n && i < p->n; i++) {
		const change *x = &p->item[i];
		if (!texture_area(e, x->face, x->corner, record_at(e, x->face, x->corner), &was[i]))
			was[i] = 0;
		sum += was[i];
	}
	for (uint32_t i = 0; e->wedges->corner.n && i < p->n; i++) {
		const change *x = &p->item[i];
		if (!texture_area(e, x->face, x->corner, p->fresh[x->side], &area))
			continue;
		if (was[i] != 0 ? !(area * was[i] > 0) : area * sum < 0)
			return false;
	}
	return true;
}

bool wh_wedges_plan(wh_engine *e, uint32_t hub, const wh_fan *f, uint32_t i, const wh_trial *t)
{
	struct wh_wedge_plan *p = e->w->wedge;
	const uint32_t other = f->id[i];
	const bool edged = e->w->star[hub].flag & WH_EDGED;
	p->n = 0;
	p->anchored = t->into_locked || f->locked.at[i] > 0;
	faces_beside(e, hub, i, p->dead);
	for (uint32_t k = 0; edged && k < t->nshared; k++)
		if (is_last(e, hub, other, t->apex[k]))
			return false;
	if (!t->into_locked)
		find_slots(e, hub, other, t);
	if (p->anchored)
		plan_anchored(e, hub, i, other);
	else
		plan_blended(e, hub, other, t);
	return keeps_sides(e);
}

/* The faces of apex a when it has lost u: those on either side of u are one, the one that is not on
 * the edge uv. */
static void plan_apex(wh_engine *e, uint32_t a, uint32_t u, int k)
{
	struct wh_wedge_plan *p = e->w->wedge;
	const uint32_t *r = wh_ring(e, a), *slot = wh_slots(e, a);
	const wh_star *s = &e->w->star[a];
	const uint32_t gone = wh_ring_place(r, u);
	uint32_t n = 0;
	for (uint32_t i = 0; i < s->n; i++)
		if (i != gone && i < faces_of(s)) {
			const uint32_t next = i + 1 < s->n ? i + 1 : 0;
			const bool passes = next == gone && (s->closed || gone + 1 < s->n);
			const bool dead = slot[i] == p->dead[0] || slot[i] == p->dead[1];
			if (passes)
				p->apex[k].slot[n++] = dead ? slot[next] : slot[i];
			else if (!dead)
				p->apex[k].slot[n++] = slot[i];
		}
	p->apex[k].n = n;
}

static void change_corners(wh_engine *e)
{
	const struct wh_wedge_plan *p = e->w->wedge;
	for (uint32_t i = 0; i < p->n; i++)
		memcpy(record_at(e, p->item[i].face, p->item[i].corner), p->fresh[p->item[i].side],
		       e->wedges->corner.bytes);
}

static void drop_dead(wh_engine *e)
{
	const struct wh_wedge_plan *p = e->w->wedge;
	for (int k = 0; k < 2; k++)
		if (p->dead[k] != WH_NONE)
			e->p->tri[3 * (size_t)p->dead[k]] = WH_NONE;
}

void wh_wedges_before(wh_engine *e, const wh_trial *t)
{
	struct wh_wedge_plan *p = e->w->wedge;
	const wh_star *gone = &e->w->star[t->u];
	const uint32_t *slot = wh_slots(e, t->u);
	for (int k = 0; k < 2; k++) {
		p->apex[k].n = 0;
		if (t->apex[k] != WH_NONE && (uint32_t)k < t->nshared &&
		    !wh_is_locked(e, t->apex[k]))
			plan_apex(e, t->apex[k], t->u, k);
	}
	change_corners(e);
	for (uint32_t i = 0; i < faces_of(gone); i++)
		e->p->tri[3 * (size_t)slot[i] + corner_place(e, slot[i], t->u)] = t->v;
	drop_dead(e);
	if (e->p->attr_bytes && p->anchored && !t->into_locked)
		memcpy(wh_patch_attr(e->p, t->v), wh_patch_attr(e->p, t->u), e->p->attr_bytes);
}

wh_code wh_wedges_after(wh_engine *e, const wh_trial *t)
{
	const struct wh_wedge_plan *p = e->w->wedge;
	if (!t->into_locked) {
		e->w->star[t->v].flag |= e->w->star[t->u].flag & WH_EDGED;
		if (wh_slots_set(e, t->v, p->slot) != WH_OK)
			return e->c->err.code;
	}
	for (int k = 0; k < 2; k++)
		if (p->apex[k].n && wh_slots_set(e, t->apex[k], p->apex[k].slot) != WH_OK)
			return e->c->err.code;
	return WH_OK;
}

/* ---- changes of topology ------------------------------------------------------------------ */

/* All corners at v have the same record, which goes to *record. */
static bool has_one_wedge(const wh_engine *e, uint32_t v, const uint8_t **record)
{
	const wh_star *s = &e->w->star[v];
	const uint32_t *slot = wh_slots(e, v);
	*record = record_of(e, slot[0], v);
	for (uint32_t i = 1; i < faces_of(s); i++)
		if (memcmp(record_of(e, slot[i], v), *record, e->wedges->corner.bytes) != 0)
			return false;
	return true;
}

static uint32_t slot_of(const wh_engine *e, uint32_t v, uint32_t neighbour)
{
	return wh_slots(e, v)[wh_ring_place(wh_ring(e, v), neighbour)];
}

/* The faces of a new vertex, in the order of its ring. */
static void plan_sheet(wh_engine *e, const wh_surgery *s, uint32_t k)
{
	struct wh_wedge_plan *p = e->w->wedge;
	const wh_sheet *t = &s->sheet[k];
	for (uint32_t i = 0; i < t->n - !t->closed; i++) {
		const uint32_t from = t->face[i] == WH_OF_U ? s->u : s->v;
		p->sheet[k][i] = slot_of(e, from, t->id[i]);
		add_change(e, p->sheet[k][i], from, (uint8_t)k);
	}
}

/* Those of w, inside the cut and outside. One of the new vertices comes behind what is inside; the
 * other stands outside for both ends and what was between them. */
static void plan_w(wh_engine *e, const wh_surgery *s)
{
	struct wh_wedge_plan *p = e->w->wedge;
	const uint32_t *ring = wh_ring(e, s->w), *slot = wh_slots(e, s->w), n = e->w->star[s->w].n;
	const uint32_t from = (wh_ring_place(ring, s->inside[0]) + n - 1) % n;
	const uint32_t to = (wh_ring_place(ring, s->inside[s->inner - 1]) + 1) % n;
	for (uint32_t i = 0; i < s->inner; i++)
		p->inside[i] = slot_of(e, s->w, s->inside[i]);
	p->inside[s->inner] = slot[from];
	for (uint32_t i = 0; s->kind == WH_NECK && i < s->outer - !e->w->star[s->w].closed; i++)
		p->outside[i] =
		    wh_is_holder(s->outside[i]) ? slot[to] : slot_of(e, s->w, s->outside[i]);
}

/* The third vertices of the faces on the edge lose u. */
static void plan_ends(wh_engine *e, const wh_surgery *s)
{
	struct wh_wedge_plan *p = e->w->wedge;
	const uint32_t *ring = wh_ring(e, s->u), n = e->w->star[s->u].n;
	const uint32_t at = wh_ring_place(ring, s->v);
	faces_beside(e, s->u, at, p->dead);
	for (int k = 0; k < 2; k++) {
		p->end[k] = p->dead[k] == WH_NONE ? WH_NONE : ring[(at + (k ? 1 : n - 1)) % n];
		p->apex[k].n = 0;
		if (p->end[k] != WH_NONE && wh_is_locked(e, p->end[k]))
			p->end[k] = WH_NONE;
		if (p->end[k] != WH_NONE)
			plan_apex(e, p->end[k], s->u, k);
	}
}

bool wh_wedges_plan_surgery(wh_engine *e, const wh_surgery *s, const wh_trial *t)
{
	struct wh_wedge_plan *p = e->w->wedge;
	const uint8_t *record[2];
	wh_trial ends = *t;
	if (!has_one_wedge(e, t->v, &record[0]) || !has_one_wedge(e, t->u, &record[1]))
		return false;
	p->n = 0;
	for (uint32_t k = 0; k < wh_surgery_sheets(s); k++)
		plan_sheet(e, s, k);
	if (s->w != WH_NONE)
		plan_w(e, s);
	plan_ends(e, s);
	ends.n = ends.faces = ends.nshared = 0;
	if (e->wedges->corner.n)
		wh_blend_corner(&ends, &e->wedges->corner, record, p->fresh[0]);
	memcpy(p->fresh[1], p->fresh[0], e->wedges->corner.bytes);
	return keeps_sides(e);
}

void wh_wedges_before_surgery(wh_engine *e)
{
	change_corners(e);
	drop_dead(e);
}

/* The n corners at `from` of a list of faces become `to`. */
static void rename_corners(wh_engine *e, const uint32_t *face, uint32_t n, uint32_t from,
                           uint32_t to)
{
	for (uint32_t i = 0; i < n; i++)
		for (size_t k = 0; k < 3; k++)
			if (e->p->tri[3 * (size_t)face[i] + k] == from)
				e->p->tri[3 * (size_t)face[i] + k] = to;
}

wh_code wh_wedges_after_surgery(wh_engine *e, const wh_surgery *s)
{
	const struct wh_wedge_plan *p = e->w->wedge;
	const uint32_t sheets = wh_surgery_sheets(s);
	for (uint32_t k = 0; k < sheets; k++) {
		const uint32_t v = k ? s->u : s->v;
		rename_corners(e, p->sheet[k], faces_of(&e->w->star[v]), k ? s->v : s->u, v);
		if (wh_slots_set(e, v, p->sheet[k]) != WH_OK)
			return e->c->err.code;
	}
	for (int k = 0; k < 2; k++)
		if (p->apex[k].n && wh_slots_set(e, p->end[k], p->apex[k].slot) != WH_OK)
			return e->c->err.code;
	if (s->w != WH_NONE) {
		rename_corners(e, p->inside, faces_of(&e->w->star[s->second]), s->w, s->second);
		if (wh_slots_set(e, s->second, p->inside) != WH_OK ||
		    (s->kind == WH_NECK && wh_slots_set(e, s->w, p->outside) != WH_OK))
			return e->c->err.code;
	}
	for (uint32_t k = 0; k < sheets; k++)
		mark(e, k ? s->u : s->v);
	if (s->w != WH_NONE) {
		mark(e, s->w);
		mark(e, s->second);
	}
	return WH_OK;
}

void wh_wedges_drop(wh_engine *e, uint32_t v)
{
	const uint32_t *slot = wh_slots(e, v);
	for (uint32_t i = 0; i < faces_of(&e->w->star[v]); i++)
		e->p->tri[3 * (size_t)slot[i]] = WH_NONE;
}

void wh_wedges_compact(wh_engine *e)
{
	wh_patch *p = e->p;
	uint32_t live = 0;
	for (uint32_t f = 0; f < p->nf; f++) {
		if (p->tri[3 * (size_t)f] == WH_NONE)
			continue;
		memmove(&p->tri[3 * (size_t)live], &p->tri[3 * (size_t)f], 3 * sizeof *p->tri);
		memmove(wh_patch_face(p, live), wh_patch_face(p, f), p->face_bytes);
		live++;
	}
	p->nf = live;
}
