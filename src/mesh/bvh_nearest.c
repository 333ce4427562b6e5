/*
 * The face of a tree (bvh.c) that is nearest to a point: branch and bound, the nearest boxes first.
 *
 * A query near the bulk of the surface bounds distances in floats, four boxes at a time: its point
 * is a small box itself, wide enough to hold what conversion to float and the arithmetic on it can
 * lose, so that a bound is never too large, and no nearest face is missed. Far out, as with a stray
 * vertex at 1e30, all boxes of the bulk have the same distance as floats, and every face would have
 * to be looked at: there bounds are doubles, and a box is left out that is nearer by less than
 * 2^-40 of the distance. So no query takes more than some pages. Distances to faces are doubles.
 *
 * Thousands of faces at one place, in a ball that floats take for a point, have one distance in the
 * same way. A query that has tried 256 faces leaves out what is nearer by less than floats can
 * tell. Copies of one triangle, which no box tells apart, are looked at once.
 *
 * Points come in spatial order mostly. So a reader also remembers the leaves around one of them:
 * while the next ones, and the spheres in which their nearest faces must be, are inside that
 * neighbourhood, its few boxes stand for the tree.
 *
 * Cost. A query takes a quarter of a microsecond near the surface of 1 M faces.
 */
#include "mesh/bvh.h"

#include "geom/tri.h"

#include <float.h>
#include <string.h>

#ifdef __SSE2__
#include <emmintrin.h>
#endif

/* Coordinates lose up to this share as floats, and a little more in a difference. */
#define QUERY_SLACK 0x1p-23f

/* Products and sums of floats lose less than this share. */
#define BOUND_SLACK 1e-6

/* Of a distance: what is too little to look for, far out. */
#define FAR_SLACK 0x1p-40

/* Of coordinates and distances: what is too little to look for near the bulk, once ... */
#define FLOAT_SLACK 0x1p-20

/* ... so many faces have been tried, as floats tell too few of them apart. */
enum { MANY = 256 };

/* Up to here a query is near the bulk, whose coordinates are about 1, ... */
static const double NEAR = 8;
/* ... and up to here squared distances are good floats. */
static const double FLOATS_MOST = 0x1p120;

/* ---- the query ------------------------------------------------------------------------------ */

/* Four floats in one register, and four truths: all bits set or none. */
typedef float lanes __attribute__((vector_size(16)));
typedef int32_t truths __attribute__((vector_size(16)));

/* Something still to be looked at. */
typedef struct todo {
	double bound; /* its squared distance is at least this */
	int level;    /* of the node; -1: a page or a face */
	uint32_t id;
} todo;

enum { TODO_MAX = (WH_BVH_LEVELS + WH_PAGE_LEVELS) * WH_BOXES };

typedef struct query {
	wh_vec3 p;
	bool far;
	lanes lo[3], hi[3]; /* the box around p, in all lanes; near ones only */
	double best;        /* squared distance of the nearest face so far */
	double limit;       /* bounds from here on cannot be nearer than best; ... */
	float short_limit;  /* ... as a float, which is 0 only if it is */
	uint32_t tried;     /* faces so far */
	wh_bvh_face face;
	todo stack[TODO_MAX]; /* nearest on top within the children of one node */
	int depth;
} query;

/* What is too little to look for after many faces: more than boxes of floats can tell. */
static double patient_limit(const query *q)
{
	const double d = sqrt(q->best), slack = wh_largest_coordinate(q->p) + d;
	const double less = fmax(d - slack * FLOAT_SLACK, 0);
	return less * less;
}

static void set_limit(query *q, double limit)
{
	q->limit = limit;
	if (limit < (double)FLT_MIN)
		q->short_limit = limit > 0 ? FLT_MIN : 0;
	else
		q->short_limit = limit < (double)FLT_MAX ? (float)limit : FLT_MAX;
}

static void limit_to_best(query *q)
{
	if (q->far)
		set_limit(q, q->best * (1 - FAR_SLACK));
	else
		set_limit(q, q->tried < MANY ? q->best * (1 + BOUND_SLACK) : patient_limit(q));
}

static void try_face(query *q, uint32_t page, const wh_page *g, uint32_t face)
{
	const uint16_t *t = g->tri + 3 * (size_t)face;
	const double d = wh_tri_dist2(q->p, g->pos[t[0]], g->pos[t[1]], g->pos[t[2]]);
	const bool many = ++q->tried == MANY;
	if (d < q->best) {
		q->best = d;
		q->face = (wh_bvh_face){page, face};
		limit_to_best(q);
	} else if (many) {
		limit_to_best(q);
	}
}

static lanes load_lanes(const float *x)
{
	lanes v;
	memcpy(&v, x, sizeof v);
	return v;
}

/* Lane by lane; both are numbers. */
static lanes greater(lanes x, lanes y)
{
#ifdef __SSE2__
	return _mm_max_ps(x, y);
#else
	const truths more = x > y;
	return (lanes)(((truths)x & more) | ((truths)y & ~more));
#endif
}

/* Lower bounds of the squared distances to four boxes, from slot s on. */
static lanes bound_boxes(const query *q, const wh_boxes *n, int s)
{
	lanes sum = {0};
	for (int k = 0; k < 3; k++) {
		const lanes under = load_lanes(n->lo[k] + s) - q->hi[k];
		const lanes over = q->lo[k] - load_lanes(n->hi[k] + s);
		const lanes d = greater(greater(under, over), (lanes){0});
		sum += d * d;
	}
	return sum;
}

/* Bit i: lane i is true. */
static unsigned bits_of(truths t)
{
#ifdef __SSE2__
	return (unsigned)_mm_movemask_ps((lanes)t);
#else
	const truths bit = t & (truths){1, 2, 4, 8};
	return (unsigned)(bit[0] | bit[1] | bit[2] | bit[3]);
#endif
}

/* Puts a child into the stack, above those of its siblings (from base on) that are farther. */
static void push(query *q, int base, todo x)
{
	int i = q->depth++;
	for (; i > base && q->stack[i - 1].bound < x.bound; i--)
		q->stack[i] = q->stack[i - 1];
	q->stack[i] = x;
}

static void open_near(query *q, const wh_boxes *n, const todo *x)
{
	const int base = q->depth;
	for (int s = 0; s < WH_BOXES; s += 4) {
		const lanes bound = bound_boxes(q, n, s);
		for (unsigned near = bits_of(bound < q->short_limit); near; near &= near - 1) {
			const int lane = __builtin_ctz(near);
			push(q, base,
			     (todo){(double)bound[lane], x->level - 1,
			            x->id * WH_BOXES + (uint32_t)(s + lane)});
		}
	}
}

/* How far x is outside of lo .. hi. */
static double outside(double x, double lo, double hi)
{
	return x < lo ? lo - x : x > hi ? x - hi : 0;
}

static void open_far(query *q, const wh_boxes *n, const todo *x)
{
	const int base = q->depth;
	for (int s = 0; s < WH_BOXES; s++) {
		const double dx = outside(q->p.x, (double)n->lo[0][s], (double)n->hi[0][s]);
		const double dy = outside(q->p.y, (double)n->lo[1][s], (double)n->hi[1][s]);
		const double dz = outside(q->p.z, (double)n->lo[2][s], (double)n->hi[2][s]);
		const double bound = dx * dx + dy * dy + dz * dz;
		if (bound < q->limit)
			push(q, base, (todo){bound, x->level - 1, x->id * WH_BOXES + (uint32_t)s});
	}
}

/* Looks at the faces of a leaf. */
static void try_leaf(query *q, uint32_t page, const wh_page *g, uint32_t leaf)
{
	const wh_boxes *n = &g->boxes[leaf]; /* level 0 comes first */
	for (int s = 0; s < WH_BOXES; s += 4) {
		const lanes bound = bound_boxes(q, n, s);
		for (unsigned near = bits_of(bound < q->short_limit); near; near &= near - 1) {
			const int lane = __builtin_ctz(near);
			if ((double)bound[lane] < q->limit)
				try_face(q, page, g, leaf * WH_BOXES + (uint32_t)(s + lane));
		}
	}
}

static void open_node(query *q, const wh_boxes *n, const todo *x)
{
	if (q->far)
		open_far(q, n, x);
	else
		open_near(q, n, x);
}

static void search_page(query *q, uint32_t page, const wh_page *g)
{
	const int base = q->depth;
	q->stack[q->depth++] = (todo){0, g->levels - 1, 0};
	while (q->depth > base) {
		const todo x = q->stack[--q->depth];
		if (x.bound >= q->limit)
			continue;
		if (x.level < 0)
			try_face(q, page, g, x.id);
		else if (x.level == 0 && !q->far)
			try_leaf(q, page, g, x.id);
		else
			open_node(q, g->boxes + g->first[x.level] + x.id, &x);
	}
}

static void start(query *q, wh_vec3 p, bool far)
{
	const double xyz[3] = {p.x, p.y, p.z};
	q->p = p;
	q->far = far;
	for (int k = 0; k < 3 && !far; k++) {
		const float x = (float)xyz[k], slack = fabsf(x) * QUERY_SLACK + FLT_MIN;
		q->lo[k] = (lanes){0} + (x - slack);
		q->hi[k] = (lanes){0} + (x + slack);
	}
	q->best = INFINITY;
	set_limit(q, INFINITY);
	q->tried = 0;
	q->face = (wh_bvh_face){0, 0};
	q->depth = 0;
}

static wh_code search(wh_ctx *c, wh_bvh_reader *r, query *q)
{
	const wh_bvh *t = r->t;
	q->stack[q->depth++] = (todo){0, t->levels - 1, 0};
	while (q->depth > 0) {
		const todo x = q->stack[--q->depth];
		if (x.bound >= q->limit)
			continue;
		if (x.level >= 0) {
			open_node(q, t->nodes + t->first[x.level] + x.id, &x);
			continue;
		}
		const wh_page *g = wh_bvh_page(c, r, x.id);
		if (!g)
			return wh_failed(c);
		search_page(q, x.id, g);
	}
	return WH_OK;
}

/* ---- neighbourhoods ------------------------------------------------------------------------- */

enum {
	USES_LEAST = 3, /* fewer are not worth it: then ... */
	PAUSE = 32      /* ... so many queries pass before the next one */
};

/* Its radius beyond the distance at its centre, in sizes of a leaf, and in steps from point to
 * point. */
static const double LEAVES = 1, STEPS = 3;

/* Forgets what an earlier row of points left. */
static void start_row(wh_bvh_around *a, wh_vec3 p)
{
	a->last = p;
	a->step = 0;
	a->radius = 0;
	a->n = a->pause = 0;
	a->uses = USES_LEAST;
}

/* Everything that may be nearer than the best is inside. */
static bool is_inside(const wh_bvh_around *a, const query *q)
{
	const double slack = 1 + 1e-9;
	if (!(a->radius > 0))
		return false;
	return (wh_norm(wh_sub(q->p, a->centre)) + sqrt(q->best)) * slack <= a->radius;
}

static wh_code search_around(wh_ctx *c, wh_bvh_reader *r, query *q)
{
	wh_bvh_around *a = &r->around;
	a->uses++;
	for (uint32_t s = 0; s < a->n; s += 4) {
		const lanes bound = bound_boxes(q, &a->boxes[s / WH_BOXES], s % WH_BOXES);
		for (unsigned near = bits_of(bound < q->short_limit); near; near &= near - 1) {
			const int lane = __builtin_ctz(near);
			const uint32_t i = s + (uint32_t)lane;
			if ((double)bound[lane] >= q->limit)
				continue;
			const wh_page *g = wh_bvh_page(c, r, a->leaf[i].page);
			if (!g)
				return wh_failed(c);
			try_leaf(q, a->leaf[i].page, g, a->leaf[i].node);
		}
	}
	return WH_OK;
}

/* Adds a leaf, whose box is in `slot` of a node. */
static void add_leaf(wh_bvh_around *a, uint32_t page, uint32_t leaf, const wh_boxes *n,
                     uint32_t slot)
{
	wh_boxes *to = &a->boxes[a->n / WH_BOXES];
	const uint32_t at = a->n % WH_BOXES;
	if (at == 0)
		for (uint32_t s = 0; s < WH_BOXES; s++)
			wh_boxes_set_missing(to, s);
	for (int k = 0; k < 3; k++) {
		to->lo[k][at] = n->lo[k][slot];
		to->hi[k][at] = n->hi[k][slot];
	}
	a->leaf[a->n].page = page;
	a->leaf[a->n++].node = leaf;
}

/* Adds the leaves of a page inside the limit; false when there are too many. */
static bool gather_page(query *q, wh_bvh_around *a, uint32_t page, const wh_page *g)
{
	const int base = q->depth;
	wh_boxes only;
	if (g->levels == 1) {
		wh_boxes_set_child(&only, 0, g->boxes);
		if (a->n < WH_BVH_AROUND)
			add_leaf(a, page, 0, &only, 0);
		return a->n < WH_BVH_AROUND;
	}
	q->stack[q->depth++] = (todo){0, g->levels - 1, 0};
	while (q->depth > base) {
		const todo x = q->stack[--q->depth];
		if (x.level > 0) {
			open_near(q, g->boxes + g->first[x.level] + x.id, &x);
			continue;
		}
		if (a->n == WH_BVH_AROUND)
			return false;
		add_leaf(a, page, x.id, g->boxes + g->first[1] + x.id / WH_BOXES, x.id % WH_BOXES);
	}
	return true;
}

/* All leaves no farther than the limit; WH_OK also where there are too many, and none kept. */
static wh_code gather(wh_ctx *c, wh_bvh_reader *r, query *q)
{
	const wh_bvh *t = r->t;
	wh_bvh_around *a = &r->around;
	a->n = 0;
	q->depth = 0;
	q->stack[q->depth++] = (todo){0, t->levels - 1, 0};
	while (q->depth > 0) {
		const todo x = q->stack[--q->depth];
		if (x.level >= 0) {
			open_near(q, t->nodes + t->first[x.level] + x.id, &x);
			continue;
		}
		const wh_page *g = wh_bvh_page(c, r, x.id);
		if (!g)
			return wh_failed(c);
		if (!gather_page(q, a, x.id, g)) {
			a->radius = 0;
			a->pause = PAUSE;
			return WH_OK;
		}
	}
	return WH_OK;
}

/* The size of the leaf that a face is in. */
static double leaf_size(const wh_page *g, uint32_t face)
{
	const wh_boxes *n = &g->boxes[face / WH_BOXES];
	double size = 0;
	for (int k = 0; k < 3; k++) {
		float lo = INFINITY, hi = -INFINITY;
		for (int s = 0; s < WH_BOXES; s++) {
			lo = n->lo[k][s] < lo ? n->lo[k][s] : lo;
			hi = n->hi[k][s] > hi ? n->hi[k][s] : hi;
		}
		size = (double)(hi - lo) > size ? (double)(hi - lo) : size;
	}
	return size;
}

/* The neighbourhood of the point that has just been found, unless the last ones were of little
 * use. */
static wh_code look_around(wh_ctx *c, wh_bvh_reader *r, query *q)
{
	wh_bvh_around *a = &r->around;
	a->radius = 0;
	if (a->uses < USES_LEAST)
		a->pause = PAUSE;
	a->uses = USES_LEAST;
	if (a->pause > 0) {
		a->pause--;
		return WH_OK;
	}
	const wh_page *g = wh_bvh_page(c, r, q->face.page);
	if (!g)
		return wh_failed(c);
	a->uses = 0;
	a->centre = q->p;
	a->radius = sqrt(q->best) + LEAVES * leaf_size(g, q->face.face) + STEPS * a->step;
	set_limit(q, a->radius * a->radius * (1 + BOUND_SLACK));
	return gather(c, r, q);
}

/* ---- all of it ------------------------------------------------------------------------------ */

static wh_code try_guess(wh_ctx *c, wh_bvh_reader *r, const wh_bvh_face *guess, query *q)
{
	if (guess->page == WH_NONE) {
		start_row(&r->around, q->p);
		return WH_OK;
	}
	const wh_page *g = wh_bvh_page(c, r, guess->page);
	if (!g)
		return wh_failed(c);
	try_face(q, guess->page, g, guess->face);
	return WH_OK;
}

/* A running mean that a single jump does not change much. */
static void note_step(wh_bvh_around *a, wh_vec3 p)
{
	const double step = wh_norm(wh_sub(p, a->last)), most = 3 * a->step;
	a->last = p;
	if (!(a->step > 0))
		a->step = step;
	else
		a->step += ((step < most ? step : most) - a->step) / 16;
}

static wh_code nearest_near(wh_ctx *c, wh_bvh_reader *r, query *q)
{
	note_step(&r->around, q->p);
	if (is_inside(&r->around, q))
		return search_around(c, r, q);
	const wh_code code = search(c, r, q);
	if (code != WH_OK || !(q->best < FLOATS_MOST))
		return code;
	return look_around(c, r, q);
}

static bool is_near(wh_vec3 p)
{
	return fabs(p.x) <= NEAR && fabs(p.y) <= NEAR && fabs(p.z) <= NEAR;
}

wh_code wh_bvh_nearest(wh_ctx *c, wh_bvh_reader *r, wh_vec3 p, wh_bvh_face *near, double *d2)
{
	query q;
	start(&q, p, !is_near(p));
	wh_code code = try_guess(c, r, near, &q);
	if (code == WH_OK)
		code = q.far ? search(c, r, &q) : nearest_near(c, r, &q);
	r->tried += q.tried;
	if (code == WH_OK && !q.far && !(q.best < FLOATS_MOST)) { /* all is far away */
		start(&q, p, true);
		code = search(c, r, &q);
		r->tried += q.tried;
	}
	*near = q.face;
	*d2 = q.best;
	return code;
}
