/*
 * What attributes with weights add to the cost of an edge: how far they would be off in the place
 * that geometry chose.
 *
 * Idea. Each face around the edge says what a value would be there (blend.c); what counts is the
 * squares of the differences from their mean, which is what the value will be, with the weights of
 * the faces in fan.c, so that both parts of the cost have one unit (Garland & Heckbert 1998 put
 * both into one quadric, Hoppe 1999 made it small; here nothing is kept). RMS of the difference of
 * colour and that of distance in millionths of the diagonal, two scans at 30, 10 and 2 %, with
 * weights of
 *
 *     0      2.69  78.3   5.10 197.6   9.21  756      5.19  42.8   7.63 141.5   11.35  657
 *     0.1    2.65  78.3   5.10 197.9   9.21  749      4.89  42.7   7.61 141.8   11.23  664
 *     0.3    2.29  78.8   4.81 196.8   9.19  754      4.03  47.7   7.28 141.3   11.26  668
 *     1      1.64  81.9   3.66 204.9   9.25  766      3.31  66.8   6.38 166.4   10.93  668
 *     3      1.25  97.3   2.75 229.7   7.12  817      3.16  89.2   6.02 227.6   10.35  749
 *     10     1.11 125.2   2.38 298.2   5.81 1008      3.09 110.4   5.93 290.8    9.77 1065
 *
 * Faces are worked out side by side, eight at a time. Time: one to three edges for each vertex that
 * is evaluated; for each of these a pass over the faces of both ends, and one for each attribute.
 */
#include "algo/simplify_engine.h"
#include "io/attributes.h"

#include <math.h>
#include <string.h>

enum { MOST_FACES = 2 * WH_ROW + WH_LANES };

typedef struct row {
	double at[MOST_FACES];
} row;

/* The faces around one end of the edge are between neighbours i and i + 1, from `first` on. */
typedef struct round_end {
	uint32_t first, faces;
	wh_vec3 tip;          /* the end; like all places, from the hub */
	const uint8_t *owner; /* its record */
} round_end;

/* What all faces around an edge of the fan say of the new place: the hub's, then, from a full lane
 * on, those of the other end alone. */
typedef struct wh_opinions {
	bool asked[WH_ROW]; /* about this edge of the fan */
	bool has_hub;       /* its neighbours are there */
	round_end hub, other;
	row x, y, z; /* neighbours; after the last of a closed ring the first again */
	const uint8_t *record[MOST_FACES]; /* of the neighbours */
	row counts;              /* 1, or 0 where the face is none, or the other end's, too */
	row share_i, share_next; /* of the two neighbours in what the face says */
	row weight;
	double total; /* of the weights */
	row value;    /* of the attribute at hand, less the base */
} wh_opinions;

/* A place behind the last face of an end, in a lane of its own. */
static uint32_t behind(const round_end *r)
{
	return (r->first + r->faces + WH_LANES) / WH_LANES * WH_LANES;
}

/* ---- faces -------------------------------------------------------------------------------- */

/* The faces around v from place `first` on; those with `skip` do not count. */
static void gather(const wh_engine *e, wh_vec3 origin, uint32_t v, uint32_t skip, uint32_t first,
                   round_end *r)
{
	wh_opinions *o = e->w->opinions;
	const wh_star *s = &e->w->star[v];
	const uint32_t *ring = wh_ring(e, v);
	*r = (round_end){first, s->n ? s->n - !s->closed : 0, wh_sub(s->pos, origin),
	                 wh_patch_attr(e->p, v)};
	const uint32_t end = behind(r);
	for (uint32_t i = 0; i <= r->faces && r->faces; i++) {
		const uint32_t id = ring[i < s->n ? i : 0], k = first + i;
		const wh_vec3 at = wh_sub(e->w->star[id].pos, origin);
		o->x.at[k] = at.x;
		o->y.at[k] = at.y;
		o->z.at[k] = at.z;
		o->record[k] = wh_patch_attr(e->p, id);
		o->counts.at[k] = id != skip && ring[i + 1 < s->n ? i + 1 : 0] != skip;
	}
	o->counts.at[first + r->faces] = 0;
	for (uint32_t k = first + r->faces + 1; k < end; k++)
		o->x.at[k] = o->y.at[k] = o->z.at[k] = o->counts.at[k] = 0;
}

/* What each face of an end says of place x: shares of its corners, and how much it counts. */
WH_VECTOR_CLONES static void look_from(wh_opinions *restrict o, const round_end *r, size_t end,
                                       wh_vec3 x)
{
	const double tx = r->tip.x, ty = r->tip.y, tz = r->tip.z;
	const double vx = x.x - tx, vy = x.y - ty, vz = x.z - tz;
	for (size_t first = r->first; first < end; first += WH_LANES)
		for (size_t lane = 0; lane < WH_LANES; lane++) {
			const size_t i = first + lane;
			const double bx = o->x.at[i] - tx, dx = o->x.at[i + 1] - tx;
			const double by = o->y.at[i] - ty, dy = o->y.at[i + 1] - ty;
			const double bz = o->z.at[i] - tz, dz = o->z.at[i + 1] - tz;
			const double nx = by * dz - bz * dy;
			const double ny = bz * dx - bx * dz;
			const double nz = bx * dy - by * dx;
			const double n2 = nx * nx + ny * ny + nz * nz;
			const double per = 1 / n2;
			const bool counts =
			    (o->counts.at[i] > 0) & (n2 > 0) & (per < (double)INFINITY);
			const double of_b = (vy * dz - vz * dy) * nx + (vz * dx - vx * dz) * ny +
			                    (vx * dy - vy * dx) * nz;
			const double of_d = (by * vz - bz * vy) * nx + (bz * vx - bx * vz) * ny +
			                    (bx * vy - by * vx) * nz;
			o->share_i.at[i] = counts ? of_b * per : 0.0;
			o->share_next.at[i] = counts ? of_d * per : 0.0;
			o->weight.at[i] = counts ? n2 * wh_face_weight(n2) : 0.0;
		}
}

/* ---- values ------------------------------------------------------------------------------- */

static void load_values(const wh_attribute *a, double base, const round_end *r, wh_opinions *o)
{
	for (uint32_t i = r->first; i <= r->first + r->faces && r->faces; i++)
		o->value.at[i] = wh_attribute_get(a, o->record[i]) - base;
}

/* Sums over all faces, with their weights, of the values that they say and of their squares. */
typedef struct sums {
	double value, value2;
} sums;

/* own: the values of the hub, and of the other end, whose faces begin at `middle`. */
WH_VECTOR_CLONES static sums add_up(const wh_opinions *restrict o, size_t middle, size_t end,
                                    const double own[2])
{
	double value[WH_LANES] = {0}, value2[WH_LANES] = {0};
	for (size_t first = 0; first < end; first += WH_LANES) {
		const double tip = own[first >= middle];
		for (size_t lane = 0; lane < WH_LANES; lane++) {
			const size_t i = first + lane;
			const double b = o->share_i.at[i], d = o->share_next.at[i];
			const double w = o->weight.at[i];
			const double said =
			    (1 - b - d) * tip + b * o->value.at[i] + d * o->value.at[i + 1];
			const double v = w > 0 ? said : 0.0; /* where no face is may be no number */
			const double wv = w * v;
			value[lane] += wv;
			value2[lane] += wv * v;
		}
	}
	return (sums){wh_sum_lanes(value), wh_sum_lanes(value2)};
}

/* Mean square, times the weights, of what the faces say less what the value will be: their mean, or
 * that of the locked vertex. */
static double value_cost(const wh_attribute *a, wh_opinions *o, const uint8_t *locked)
{
	const double base = wh_attribute_get(a, locked ? locked : o->hub.owner);
	const double own[2] = {wh_attribute_get(a, o->hub.owner) - base,
	                       locked ? 0 : wh_attribute_get(a, o->other.owner) - base};
	load_values(a, base, &o->hub, o);
	if (!locked)
		load_values(a, base, &o->other, o);
	const uint32_t middle = behind(&o->hub);
	const sums s = add_up(o, middle, locked ? middle : behind(&o->other), own);
	return locked ? s.value2 : s.value2 - s.value * s.value / o->total;
}

/* A label that changes is wrong in all faces around the end that had it. */
static double label_cost(const wh_attribute *a, const wh_opinions *o, const uint8_t *kept,
                         const uint8_t *lost, const round_end *of_lost)
{
	double sum = 0;
	if (memcmp(kept + a->at, lost + a->at, wh_attribute_bytes(a)) == 0)
		return 0;
	for (uint32_t i = 0; i < of_lost->faces; i++)
		sum += o->weight.at[of_lost->first + i];
	return sum;
}

/* ---- edges -------------------------------------------------------------------------------- */

/* Both ends of the fan's edge i, seen from its new place. */
static void gather_edge(const wh_engine *e, uint32_t hub, const wh_fan *f, uint32_t i)
{
	wh_opinions *o = e->w->opinions;
	const wh_vec3 x = wh_rows3_at(&f->place, i);
	const wh_vec3 origin = e->w->star[hub].pos;
	if (!o->has_hub)
		gather(e, origin, hub, WH_NONE, 0, &o->hub);
	o->has_hub = true;
	uint32_t end = behind(&o->hub);
	look_from(o, &o->hub, end, x);
	o->other.faces = 0;
	if (!wh_is_locked(e, f->id[i])) {
		gather(e, origin, f->id[i], hub, end, &o->other);
		end = behind(&o->other);
		look_from(o, &o->other, end, x);
	}
	o->total = 0;
	for (uint32_t k = 0; k < end; k++)
		o->total += o->weight.at[k];
}

static double cost_of(const wh_engine *e, uint32_t hub, const wh_fan *f, uint32_t i)
{
	const wh_attributes *as = e->params->attributes;
	const wh_vec3 x = wh_rows3_at(&f->place, i);
	const wh_vec3 edge = wh_rows3_at(&f->to, i);
	const uint8_t *ours = wh_patch_attr(e->p, hub), *theirs = wh_patch_attr(e->p, f->id[i]);
	const bool locked = wh_is_locked(e, f->id[i]);
	const bool nearer = !locked && 2 * wh_dot(x, edge) <= wh_norm2(edge);
	wh_opinions *o = e->w->opinions;
	double cost = 0;
	gather_edge(e, hub, f, i);
	for (uint32_t k = 0; k < as->n; k++) {
		const wh_attribute *a = &as->item[k];
		const double unit = a->weight * e->params->attribute_unit;
		if (!(unit > 0))
			continue;
		const double c = a->kind != WH_KIND_LABEL ? value_cost(a, o, locked ? theirs : NULL)
		                 : nearer ? label_cost(a, o, ours, theirs, &o->other)
		                          : label_cost(a, o, theirs, ours, &o->hub);
		cost += c > 0 && isfinite(c) ? unit * unit * c : 0;
	}
	return cost;
}

wh_code wh_blend_begin(wh_engine *e)
{
	if (!e->w->opinions)
		e->w->opinions = wh_calloc(e->c, 1, sizeof *e->w->opinions);
	return e->w->opinions ? WH_OK : e->c->err.code;
}

void wh_blend_fan(const wh_engine *e)
{
	memset(e->w->opinions->asked, 0, sizeof e->w->opinions->asked);
	e->w->opinions->has_hub = false;
}

bool wh_blend_weigh(const wh_engine *e, uint32_t hub, wh_fan *f, uint32_t i)
{
	bool *asked = &e->w->opinions->asked[i];
	if (*asked)
		return false;
	*asked = true;
	f->cost.at[i] += cost_of(e, hub, f, i);
	return true;
}
