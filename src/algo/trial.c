/*
 * One collapse, worked out on a copy of both stars before anything is changed.
 *
 * The ring of the new vertex is one ring with the other one's faces put in the place of the edge.
 * The link condition (Dey, Edelsbrunner, Guha, Nekhayev 1999) says that the links of u and v meet
 * in the link of uv and nowhere else: that is, no vertex is in that ring twice. With boundary loops
 * closed by an imaginary vertex, an inner edge must not join two boundary vertices, either. Each
 * face that stays has one old corner and one new; comparing the two tells whether it turns too much
 * and what the sums around it gain.
 */
#include "algo/simplify_engine.h"

#include "base/real.h"

#include <math.h>
#include <string.h>

/* Longest step of new positions / length of the collapsed edge, both as powers of two. */
static const double STEP_MOST = 0x1p-8;
/* A sum that falls below this share of itself is summed afresh: rounding errors stay behind when
 * large terms go. */
static const double SUM_LOSS = 0x1p-20;

/* ---- the ring of the new vertex ----------------------------------------------------------- */

/* One of the two ends: its ring, and the place of the other end in it. */
typedef struct side {
	const uint32_t *ring;
	uint32_t n, at;
	bool closed, hub;
} side;

/* Appends `count` neighbours of a side, from place `from` on, going round. */
static void append(const wh_engine *e, const wh_fan *f, wh_vec3 hub, const side *s, uint32_t from,
                   uint32_t count, wh_trial *t)
{
	uint32_t k = from;
	for (uint32_t i = 0; i < count; i++, k++) {
		k = k >= s->n ? k - s->n : k;
		const uint32_t j = t->n++;
		t->id[j] = s->ring[k];
		if (s->hub) {
			t->at.x.at[j] = f->to.x.at[k];
			t->at.y.at[j] = f->to.y.at[k];
			t->at.z.at[j] = f->to.z.at[k];
			continue;
		}
		const wh_vec3 d = wh_sub(e->w->star[s->ring[k]].pos, hub);
		t->at.x.at[j] = d.x;
		t->at.y.at[j] = d.y;
		t->at.z.at[j] = d.z;
	}
}

/* True when none of these neighbours of one side is a neighbour of the other. */
static bool apart(const side *a, uint32_t from, uint32_t count, const side *b)
{
	uint32_t k = from;
	bool twice = false;
	const uint32_t room = b->n <= WH_RING_INLINE ? WH_RING_INLINE : b->n;
	for (uint32_t i = 0; i < count; i++, k++) {
		k = k >= a->n ? k - a->n : k;
		const uint32_t id = a->ring[k];
		for (uint32_t j = 0; j < room; j++)
			twice |= b->ring[j] == id;
	}
	return !twice;
}

/* Whose the faces of the new ring were: `count` from `from` on were b's, the others a's. */
static void note_origins(wh_trial *t, const side *a, const side *b, uint32_t from, uint32_t count)
{
	for (uint32_t i = 0; i < t->faces; i++)
		t->theirs.at[i] = (i >= from && i < from + count ? b->hub : a->hub) ? 0.0 : 1.0;
}

/* An inner edge: the ring of `a`, which is on the boundary when one of them is, with b's faces in
 * the place of the edge. */
static bool join_inner(const wh_engine *e, const wh_fan *f, wh_vec3 hub, const side *a,
                       const side *b, wh_trial *t)
{
	const uint32_t middle = b->n - 3; /* b's ring without the edge and both apexes */
	const uint32_t after = b->at + 2 < b->n ? b->at + 2 : b->at + 2 - b->n;
	if (a->closed && a->n + b->n < 7)
		return false; /* a tetrahedron would become two faces on each other */
	if (!apart(b, after, middle, a))
		return false;
	const uint32_t head = a->closed ? a->n - 1 : a->at;
	append(e, f, hub, a, a->closed ? a->at + 1 : 0, head, t);
	append(e, f, hub, b, after, middle, t);
	if (!a->closed)
		append(e, f, hub, a, a->at + 1, a->n - 1 - a->at, t);
	t->closed = a->closed;
	t->faces = t->n - !t->closed;
	note_origins(t, a, b, head - 1, b->n - 2);
	return true;
}

/* A boundary edge: one ring behind the other, with the apex as the seam. */
static bool join_rim(const wh_engine *e, const wh_fan *f, wh_vec3 hub, const side *a, const side *b,
                     wh_trial *t)
{
	/* a's ring ends at the edge, b's begins there */
	if (a->n + b->n < 5 || !apart(b, 2, b->n - 2, a))
		return false;
	append(e, f, hub, a, 0, a->n - 1, t);
	append(e, f, hub, b, 2, b->n - 2, t);
	t->closed = false;
	t->faces = t->n - 1;
	note_origins(t, a, b, a->n - 2, b->n - 2);
	return true;
}

static bool make_free(const wh_engine *e, const wh_fan *f, const side *hub, const side *other,
                      wh_vec3 at, wh_trial *t)
{
	if (t->nshared == 2 && !other->closed && !hub->closed)
		return false; /* would pinch the surface */
	if (t->nshared == 2)
		return other->closed ? join_inner(e, f, at, hub, other, t)
		                     : join_inner(e, f, at, other, hub, t);
	return hub->at ? join_rim(e, f, at, hub, other, t) : join_rim(e, f, at, other, hub, t);
}

/* ---- into a locked vertex ----------------------------------------------------------------- */

/* The face on the far side of an apex would be made a second time; with all three corners locked
 * another piece could make it, too. */
static bool cap(const wh_engine *e, const wh_trial *t)
{
	bool free_apex = false;
	for (int i = 0; i < 2; i++) {
		const wh_star *a = &e->w->star[t->apex[i]];
		if (a->flag & WH_LOCKED)
			continue;
		free_apex = true;
		if (a->closed && a->n == 3)
			return true;
	}
	return !free_apex;
}

/* The hub goes, its faces become the locked vertex's. Nothing is known of that one's ring; but its
 * free neighbours know it, and no edge or face between locked vertices may be made, as another
 * piece could make it, too. */
static bool make_locked(const wh_engine *e, const wh_fan *f, const side *hub, wh_vec3 at,
                        wh_trial *t)
{
	for (uint32_t i = 0; i < f->n; i++) {
		const uint32_t id = f->id[i];
		if (id == t->v || id == t->apex[0] || id == t->apex[1])
			continue;
		if (wh_is_locked(e, id))
			return false;
		const uint32_t *r = wh_ring(e, id);
		for (uint32_t k = 0; k < e->w->star[id].n; k++)
			if (r[k] == t->v)
				return false;
	}
	if (hub->closed && hub->n == 3 && cap(e, t))
		return false;
	if (!hub->closed && hub->n == 2) { /* the face's other edge loses it */
		const wh_star *a = &e->w->star[t->apex[0]];
		if ((a->flag & WH_LOCKED) || a->n < 3)
			return false;
	}
	const uint32_t from = hub->closed || hub->at == 0 ? hub->at + 1 : 0;
	append(e, f, at, hub, from, hub->n - 1, t);
	t->closed = false;
	t->faces = t->n - 1;
	note_origins(t, hub, hub, 0, 0);
	return true;
}

/* ---- the collapse ------------------------------------------------------------------------- */

/* No longer than this share of the edge, whatever the mesh as a whole is like. */
static double step_beside(const wh_engine *e, wh_vec3 edge)
{
	const double len2 = wh_norm2(edge);
	const double step = e->params->step, enough = step / STEP_MOST;
	if (len2 >= enough * enough)
		return step;
	return len2 > 0 ? ldexp(STEP_MOST, ilogb(sqrt(len2))) : 0;
}

/* The place y away from `hub`, an end of the edge. Steps are counted from the hub: where positions
 * have no bits below a step this place has none either, and its sum is exact; and a plane across
 * an axis stays one. */
static wh_vec3 new_position(const wh_engine *e, wh_vec3 hub, wh_vec3 y, wh_vec3 edge)
{
	if (e->params->float_positions) {
		const wh_vec3 x = wh_add(hub, y);
		return wh_v3(wh_round_float(x.x), wh_round_float(x.y), wh_round_float(x.z));
	}
	const double step = e->params->step > 0 ? step_beside(e, edge) : 0;
	return wh_add(
	    hub, wh_v3(wh_round_to(y.x, step), wh_round_to(y.y, step), wh_round_to(y.z, step)));
}

static void note_shared(const wh_rows3 *face, uint32_t i, uint32_t apex, wh_trial *t)
{
	t->apex[t->nshared] = apex;
	t->lost[t->nshared] = wh_rows3_at(face, i);
	t->nshared++;
}

static void find_shared(const wh_fan *f, uint32_t i, wh_trial *t)
{
	t->nshared = 0;
	t->apex[1] = WH_NONE;
	if (f->closed || i > 0)
		note_shared(&f->before, i, f->id[i > 0 ? i - 1 : f->n - 1], t);
	if (f->closed || i + 1 < f->n)
		note_shared(&f->after, i, f->id[i + 1 < f->n ? i + 1 : 0], t);
}

/* A policy may put the vertex at the other end, to the bit. */
static bool is_at_other(const wh_engine *e, const wh_fan *f, uint32_t i)
{
	return e->policy && f->place.x.at[i] == f->to.x.at[i] &&
	       f->place.y.at[i] == f->to.y.at[i] && f->place.z.at[i] == f->to.z.at[i];
}

bool wh_trial_make(const wh_engine *e, const wh_fan *f, uint32_t hub, uint32_t i, wh_trial *t)
{
	const wh_star *h = &e->w->star[hub], *o = &e->w->star[f->id[i]];
	t->into_locked = o->flag & WH_LOCKED;
	t->u = t->into_locked ? hub : f->id[i];
	t->v = t->into_locked ? f->id[i] : hub;
	t->edge = wh_rows3_at(&f->to, i);
	t->cost = f->cost.at[i];
	t->weight = f->weight.at[i];
	/* also where it may go nowhere but to the other end (wedge.c) */
	t->x = t->into_locked || f->locked.at[i] > 0 || is_at_other(e, f, i)
	           ? o->pos
	           : new_position(e, h->pos, wh_rows3_at(&f->place, i), t->edge);
	t->to = wh_sub(t->x, h->pos);
	find_shared(f, i, t);
	t->n = 0;
	const side us = {wh_ring(e, hub), f->n, i, f->closed, true};
	bool ok;
	if (t->into_locked) {
		ok = make_locked(e, f, &us, h->pos, t);
	} else {
		side them = {wh_ring(e, t->u), o->n, 0, o->closed, false};
		them.at = wh_ring_place(them.ring, hub);
		ok = make_free(e, f, &us, &them, h->pos, t);
	}
	if (!ok)
		return false;
	t->at.x.at[t->n] = t->at.x.at[0];
	t->at.y.at[t->n] = t->at.y.at[0];
	t->at.z.at[t->n] = t->at.z.at[0];
	return true;
}

/* ---- turning faces ------------------------------------------------------------------------ */

/* Area vectors of all faces before and after. Returns how many turn too much. */
WH_VECTOR_CLONES static double turn(wh_trial *restrict t, wh_vec3 mean)
{
	const wh_vec3 edge = t->edge, to = t->to;
	const size_t n = t->n, faces = t->faces;
	double bad[WH_LANES] = {0};
	for (size_t b = 0; b < n; b += WH_LANES)
		for (size_t lane = 0; lane < WH_LANES; lane++) {
			const size_t i = b + lane;
			const double tx = t->at.x.at[i], ux = t->at.x.at[i + 1];
			const double ty = t->at.y.at[i], uy = t->at.y.at[i + 1];
			const double tz = t->at.z.at[i], uz = t->at.z.at[i + 1];
			const double s = t->theirs.at[i];
			const double ax = tx - s * edge.x, bx = ux - s * edge.x;
			const double ay = ty - s * edge.y, by = uy - s * edge.y;
			const double az = tz - s * edge.z, bz = uz - s * edge.z;
			const double ox = ay * bz - az * by;
			const double oy = az * bx - ax * bz;
			const double oz = ax * by - ay * bx;
			const double px = tx - to.x, qx = ux - to.x;
			const double py = ty - to.y, qy = uy - to.y;
			const double pz = tz - to.z, qz = uz - to.z;
			const double nx = py * qz - pz * qy;
			const double ny = pz * qx - px * qz;
			const double nz = px * qy - py * qx;
			const double d = ox * nx + oy * ny + oz * nz;
			const double o2 = ox * ox + oy * oy + oz * oz;
			const double n2 = nx * nx + ny * ny + nz * nz;
			const double side0 = ox * mean.x + oy * mean.y + oz * mean.z;
			const double side1 = nx * mean.x + ny * mean.y + nz * mean.z;
			const double least = WH_MIN_COSINE * WH_MIN_COSINE * o2 * n2;
			const bool turns = (o2 > 0) & !((d > 0) & (d * d >= least));
			const bool passes = (side1 < 0) & (side0 >= 0);
			const bool in = i < faces;
			bad[lane] += in & (turns | passes) ? 1.0 : 0.0;
			t->spoke.x.at[i] = px;
			t->spoke.y.at[i] = py;
			t->spoke.z.at[i] = pz;
			t->old.x.at[i + 1] = in ? ox : 0.0;
			t->old.y.at[i + 1] = in ? oy : 0.0;
			t->old.z.at[i + 1] = in ? oz : 0.0;
			t->old_weight.at[i + 1] = wh_face_weight(o2);
			t->fresh_weight.at[i + 1] = wh_face_weight(n2);
			t->fresh.x.at[i + 1] = in ? nx : 0.0;
			t->fresh.y.at[i + 1] = in ? ny : 0.0;
			t->fresh.z.at[i + 1] = in ? nz : 0.0;
		}
	return wh_sum_lanes(bad);
}

/* Before the first neighbour of a closed ring there is the face behind the last. */
static void close_rows(wh_rows3 *r, uint32_t n)
{
	r->x.at[0] = r->x.at[n];
	r->y.at[0] = r->y.at[n];
	r->z.at[0] = r->z.at[n];
}

bool wh_trial_sound(const wh_engine *e, wh_trial *t)
{
	const wh_star *u = &e->w->star[t->u], *v = &e->w->star[t->v];
	const wh_vec3 mean = t->into_locked ? u->sum.n : wh_add(u->sum.n, v->sum.n);
	if (turn(t, mean) > 0 && !e->lenient)
		return false;
	close_rows(&t->old, t->n);
	close_rows(&t->fresh, t->n);
	t->old_weight.at[0] = t->old_weight.at[t->n];
	t->fresh_weight.at[0] = t->fresh_weight.at[t->n];
	return true;
}

/* ---- making it so ------------------------------------------------------------------------- */

/* What the sum of each neighbour gains: its new faces less those they were. */
WH_VECTOR_CLONES static void find_gains(wh_trial *restrict t)
{
	const size_t n = t->n;
	for (size_t b = 0; b < n; b += WH_LANES)
		for (size_t lane = 0; lane < WH_LANES; lane++) {
			const size_t i = b + lane, k = i + 1;
			const double nx = t->fresh.x.at[i], px = t->fresh.x.at[k];
			const double ny = t->fresh.y.at[i], py = t->fresh.y.at[k];
			const double nz = t->fresh.z.at[i], pz = t->fresh.z.at[k];
			const double ox = t->old.x.at[i], qx = t->old.x.at[k];
			const double oy = t->old.y.at[i], qy = t->old.y.at[k];
			const double oz = t->old.z.at[i], qz = t->old.z.at[k];
			const double wn = t->fresh_weight.at[i], wp = t->fresh_weight.at[k];
			const double wo = t->old_weight.at[i], wq = t->old_weight.at[k];
			const double nxw = wn * nx, nyw = wn * ny, nzw = wn * nz;
			const double pxw = wp * px, pyw = wp * py, pzw = wp * pz;
			const double oxw = wo * ox, oyw = wo * oy, ozw = wo * oz;
			const double qxw = wq * qx, qyw = wq * qy, qzw = wq * qz;
			t->gain[0].at[i] = nxw * nx + pxw * px - (oxw * ox + qxw * qx);
			t->gain[1].at[i] = nxw * ny + pxw * py - (oxw * oy + qxw * qy);
			t->gain[2].at[i] = nxw * nz + pxw * pz - (oxw * oz + qxw * qz);
			t->gain[3].at[i] = nyw * ny + pyw * py - (oyw * oy + qyw * qy);
			t->gain[4].at[i] = nyw * nz + pyw * pz - (oyw * oz + qyw * qz);
			t->gain[5].at[i] = nzw * nz + pzw * pz - (ozw * oz + qzw * qz);
			t->gain[6].at[i] = nx + px - (ox + qx);
			t->gain[7].at[i] = ny + py - (oy + qy);
			t->gain[8].at[i] = nz + pz - (oz + qz);
		}
}

/* The faces on the edge go: their apexes lose them. */
static void lose_shared(wh_trial *t)
{
	for (uint32_t k = 0; k < t->nshared; k++) {
		const uint32_t i = wh_ring_place(t->id, t->apex[k]);
		const wh_vec3 n = t->lost[k], wn = wh_scale(n, wh_face_weight(wh_norm2(n)));
		t->gain[0].at[i] -= wn.x * n.x;
		t->gain[1].at[i] -= wn.x * n.y;
		t->gain[2].at[i] -= wn.x * n.z;
		t->gain[3].at[i] -= wn.y * n.y;
		t->gain[4].at[i] -= wn.y * n.z;
		t->gain[5].at[i] -= wn.z * n.z;
		t->gain[6].at[i] -= n.x;
		t->gain[7].at[i] -= n.y;
		t->gain[8].at[i] -= n.z;
	}
}

static double trace(const wh_vertex_sum *s)
{
	return s->xx + s->yy + s->zz;
}

/* The sum of a free neighbour of the new vertex. */
static void renew_neighbour(wh_engine *e, const wh_trial *t, uint32_t i)
{
	wh_star *s = &e->w->star[t->id[i]];
	wh_vertex_sum *sum = &s->sum;
	const double was = trace(sum);
	sum->xx += t->gain[0].at[i];
	sum->xy += t->gain[1].at[i];
	sum->xz += t->gain[2].at[i];
	sum->yy += t->gain[3].at[i];
	sum->yz += t->gain[4].at[i];
	sum->zz += t->gain[5].at[i];
	sum->n.x += t->gain[6].at[i];
	sum->n.y += t->gain[7].at[i];
	sum->n.z += t->gain[8].at[i];
	s->guess *= trace(sum) / was;
	if (!s->closed || !(trace(sum) >= SUM_LOSS * was))
		wh_star_renew(e, t->id[i]);
}

/* The neighbours of the vertex that goes now have the one that stays; the apexes had it before. */
static wh_code renew_rings(wh_engine *e, const wh_trial *t)
{
	uint32_t r[WH_MOST_AROUND]; /* a copy: rings may move in the overflow */
	const uint32_t n = e->w->star[t->u].n;
	memcpy(r, wh_ring(e, t->u), n * sizeof *r);
	for (uint32_t i = 0; i < n; i++) {
		if (r[i] == t->v || wh_is_locked(e, r[i]))
			continue;
		if (r[i] != t->apex[0] && r[i] != t->apex[1])
			wh_ring_replace(e, r[i], t->u, t->v);
		else if (wh_ring_remove(e, r[i], t->u) != WH_OK)
			return e->c->err.code;
	}
	return WH_OK;
}

static void renew_kept(const wh_engine *e, const wh_trial *t, wh_star *kept)
{
	kept->closed = t->closed;
	/* the rows begin with the face before the first neighbour, which for a closed ring is that
	 * behind the last: n entries are all faces of either */
	wh_sum_make(&t->spoke, &t->fresh, t->n, t->closed, &kept->sum);
	kept->guess = wh_guess(&t->spoke, t->n, &kept->sum, e->manner);
}

wh_code wh_trial_commit(wh_engine *e, wh_trial *t)
{
	const wh_star *gone = &e->w->star[t->u];
	wh_star *kept = &e->w->star[t->v];
	if (renew_rings(e, t) != WH_OK || wh_ring_set(e, t->u, NULL, 0) != WH_OK)
		return e->c->err.code;
	kept->pos = t->x;
	if (!t->into_locked) {
		kept->flag |= gone->flag & WH_BORDER;
		if (wh_ring_set(e, t->v, t->id, t->n) != WH_OK)
			return e->c->err.code;
		renew_kept(e, t, kept);
	}
	find_gains(t);
	lose_shared(t);
	for (uint32_t i = 0; i < t->n; i++)
		if (!wh_is_locked(e, t->id[i]))
			renew_neighbour(e, t, i);
	return WH_OK;
}
