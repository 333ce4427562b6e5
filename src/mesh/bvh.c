/*
 * Idea. A packed tree: every node has eight children, all nodes but the last of each level are
 * full, and children are found by arithmetic, so that nothing but boxes is stored (compare the
 * packed R-trees of Kamel & Faloutsos 1993, and Leutenegger's STR 1997). The order of the faces
 * comes from splitting them by the widest axis of their centres, at the multiple of a power of
 * eight nearest to the middle, over and over: adaptive to any distribution, unlike a
 * space-filling curve of fixed resolution.
 *
 * Boxes are floats rounded outwards, and a query's point is a small box itself, wide enough to
 * hold what conversion to float and the arithmetic on it can lose: a bound is never too large, and
 * no nearest face is missed. Distances to faces are doubles.
 *
 * Cost. Memory: 27 bytes a face for boxes, 24 for the copy of the mesh, 16 more while building.
 * Time: n log n, 1 M faces in about 0.3 s on one thread. A query looks at 8 boxes at a time, in
 * vector registers, and takes well under a microsecond near the surface of 1 M faces.
 */
#include "mesh/bvh.h"

#include "base/rng.h"
#include "geom/tri.h"

#include <float.h>
#include <string.h>

enum { W = WH_BVH_WIDTH };

/* Queries are boxes of this half width: coordinates up to 1 lose up to 2^-24 as floats. */
#define QUERY_SLACK 0x1p-23f

/* Products and sums of floats lose less than this share. */
#define BOUND_SLACK 1e-6

wh_frame wh_frame_of_box(wh_vec3 lo, wh_vec3 hi)
{
	const wh_vec3 half = wh_sub(wh_scale(hi, 0.5), wh_scale(lo, 0.5));
	const double extent = fmax(half.x, fmax(half.y, half.z));
	int exponent = 0;
	if (extent > 0)
		(void)frexp(extent, &exponent); /* extent < 2^exponent */
	const int limit = 1000;                 /* the scale itself must not overflow */
	exponent = exponent < -limit ? -limit : exponent;
	return (wh_frame){wh_add(wh_scale(lo, 0.5), wh_scale(hi, 0.5)), ldexp(1, -exponent)};
}

/* ---- the order of the faces ---------------------------------------------------------------------
 */

typedef struct item {
	float at[3]; /* centre of the face */
	uint32_t face;
} item;

static void make_items(const wh_mesh *m, const wh_frame *f, item *items)
{
	for (uint32_t i = 0; i < m->nf; i++) {
		const uint32_t *t = m->tri + 3 * (size_t)i;
		const wh_vec3 a = wh_frame_local(f, m->pos[t[0]]);
		const wh_vec3 b = wh_frame_local(f, m->pos[t[1]]);
		const wh_vec3 d = wh_frame_local(f, m->pos[t[2]]);
		items[i] = (item){
		    {(float)(a.x + b.x + d.x), (float)(a.y + b.y + d.y), (float)(a.z + b.z + d.z)},
		    i};
	}
}

static int widest_axis(const item *items, size_t n)
{
	float lo[3] = {FLT_MAX, FLT_MAX, FLT_MAX};
	float hi[3] = {-FLT_MAX, -FLT_MAX, -FLT_MAX};
	for (size_t i = 0; i < n; i++) {
		for (int k = 0; k < 3; k++) {
			const float x = items[i].at[k];
			lo[k] = x < lo[k] ? x : lo[k];
			hi[k] = x > hi[k] ? x : hi[k];
		}
	}
	int axis = 0;
	for (int k = 1; k < 3; k++)
		if (hi[k] - lo[k] > hi[axis] - lo[axis])
			axis = k;
	return axis;
}

static void swap_items(item *a, item *b)
{
	const item x = *a;
	*a = *b;
	*b = x;
}

/* The middle one of three items, two of them picked by a hash so that no regular order of the
 * input is a bad one. */
static float pick_pivot(const item *items, size_t n, int axis)
{
	const uint64_t r = wh_mix64(n);
	const float a = items[(uint32_t)r % n].at[axis];
	const float b = items[(r >> 32) % n].at[axis];
	const float c = items[n / 2].at[axis];
	if (a < b)
		return b < c ? b : a < c ? c : a;
	return a < c ? a : b < c ? c : b;
}

/* Hoare's selection: 0 < mid < n; then none of the first mid items is above any of the rest. */
static void select_items(item *items, size_t n, size_t mid, int axis)
{
	size_t from = 0, to = n; /* what is outside from .. to-1 is on its side already */
	for (;;) {
		const float pivot = pick_pivot(items + from, to - from, axis);
		size_t i = from, j = to - 1;
		for (;;) {
			while (items[i].at[axis] < pivot)
				i++;
			while (items[j].at[axis] > pivot)
				j--;
			if (i >= j)
				break;
			swap_items(items + i++, items + j--);
		}
		/* below i all are at most the pivot, above j at least; i is j or j + 1 */
		if (mid < i)
			to = i;
		else if (mid > j + 1)
			from = j + 1;
		else
			return;
	}
}

/* Orders items into aligned runs of at most `stop`, a power of eight. */
static void split(item *items, size_t n, size_t stop)
{
	while (n > stop) {
		size_t child = stop;
		while (child * W < n)
			child *= W;
		const size_t children = (n + child - 1) / child;
		const size_t mid = (children + 1) / 2 * child;
		select_items(items, n, mid, widest_axis(items, n));
		split(items, mid, stop);
		items += mid;
		n -= mid;
	}
}

typedef struct split_job {
	item *items;
	size_t n;
	size_t run; /* items of one job */
} split_job;

static wh_code split_run(wh_ctx *c, void *arg, int64_t index, int worker)
{
	const split_job *s = arg;
	const size_t first = (size_t)index * s->run;
	split(s->items + first, s->n - first < s->run ? s->n - first : s->run, W);
	(void)c;
	(void)worker;
	return WH_OK;
}

/* The topmost splits serially, the rest in up to 64 jobs. */
static wh_code order_items(wh_ctx *c, const wh_exec *ex, item *items, size_t n)
{
	size_t run = W;
	while (run * W * W < n)
		run *= W;
	split(items, n, run);
	split_job s = {items, n, run};
	return wh_exec_for(c, ex, (int64_t)((n + run - 1) / run), split_run, &s);
}

/* ---- the copy of the mesh -----------------------------------------------------------------------
 */

/* Numbers vertices by first use in the new order of faces; returns how many are used. */
static uint32_t renumber(const wh_mesh *m, const item *items, uint32_t *number, uint32_t *tri)
{
	uint32_t used = 0;
	for (uint32_t v = 0; v < m->nv; v++)
		number[v] = WH_NONE;
	for (uint32_t i = 0; i < m->nf; i++) {
		for (size_t k = 0; k < 3; k++) {
			const uint32_t v = m->tri[3 * (size_t)items[i].face + k];
			if (number[v] == WH_NONE)
				number[v] = used++;
			tri[3 * (size_t)i + k] = number[v];
		}
	}
	return used;
}

static void copy_colours(const wh_mesh *m, const uint32_t *number, wh_mesh *out)
{
	for (uint32_t v = 0; v < m->nv; v++)
		if (number[v] != WH_NONE)
			memcpy(&out->colour[3 * (size_t)number[v]], &m->colour[3 * (size_t)v],
			       3 * sizeof *m->colour);
}

static wh_code copy_mesh(wh_ctx *c, const wh_mesh *m, const wh_frame *f, const item *items,
                         wh_mesh *out)
{
	uint32_t *number = wh_alloc(c, m->nv, sizeof *number);
	*out = (wh_mesh){.nf = m->nf, .tri = wh_alloc(c, m->nf, 3 * sizeof *out->tri)};
	if (!number || !out->tri)
		goto out;
	out->nv = renumber(m, items, number, out->tri);
	out->pos = wh_alloc(c, out->nv, sizeof *out->pos);
	if (!out->pos)
		goto out;
	for (uint32_t v = 0; v < m->nv; v++)
		if (number[v] != WH_NONE)
			out->pos[number[v]] = wh_frame_local(f, m->pos[v]);
	if (m->colour && (out->colour = wh_alloc(c, out->nv, 3 * sizeof *out->colour)))
		copy_colours(m, number, out);
out:
	wh_free(c, number);
	return c->err.code;
}

/* ---- the boxes
 * ------------------------------------------------------------------------------------ */

static float float_below(double x)
{
	const float f = (float)x;
	return (double)f > x ? nextafterf(f, -FLT_MAX) : f;
}

static float float_above(double x)
{
	const float f = (float)x;
	return (double)f < x ? nextafterf(f, FLT_MAX) : f;
}

static double min3(double a, double b, double c)
{
	return fmin(a, fmin(b, c));
}

static double max3(double a, double b, double c)
{
	return fmax(a, fmax(b, c));
}

static void set_missing(wh_bvh_node *n, int slot)
{
	for (int k = 0; k < 3; k++) {
		n->lo[k][slot] = FLT_MAX;
		n->hi[k][slot] = -FLT_MAX;
	}
}

static void set_face(wh_bvh_node *n, int slot, const wh_mesh *m, uint32_t face)
{
	const uint32_t *t = m->tri + 3 * (size_t)face;
	const wh_vec3 a = m->pos[t[0]], b = m->pos[t[1]], d = m->pos[t[2]];
	n->lo[0][slot] = float_below(min3(a.x, b.x, d.x));
	n->lo[1][slot] = float_below(min3(a.y, b.y, d.y));
	n->lo[2][slot] = float_below(min3(a.z, b.z, d.z));
	n->hi[0][slot] = float_above(max3(a.x, b.x, d.x));
	n->hi[1][slot] = float_above(max3(a.y, b.y, d.y));
	n->hi[2][slot] = float_above(max3(a.z, b.z, d.z));
}

/* The box around all of the child's boxes. */
static void set_child(wh_bvh_node *n, int slot, const wh_bvh_node *child)
{
	set_missing(n, slot);
	for (int k = 0; k < 3; k++) {
		for (int s = 0; s < W; s++) {
			n->lo[k][slot] = fminf(n->lo[k][slot], child->lo[k][s]);
			n->hi[k][slot] = fmaxf(n->hi[k][slot], child->hi[k][s]);
		}
	}
}

/* Lays out the levels; returns how many nodes there are in all. */
static uint32_t layout(wh_bvh *t, uint32_t nf)
{
	uint32_t total = 0;
	uint32_t count = nf;
	t->levels = 0;
	do {
		count = count / W + (count % W != 0);
		t->level_first[t->levels++] = total;
		total += count;
	} while (count > 1);
	return total;
}

typedef struct box_job {
	wh_bvh *t;
	int level;
	uint32_t children; /* faces, or nodes of the level below */
} box_job;

enum { NODES_PER_JOB = 4096 };

static void fill_node(const box_job *b, uint32_t node)
{
	const wh_bvh *t = b->t;
	wh_bvh_node *n = t->nodes + t->level_first[b->level] + node;
	for (uint32_t s = 0; s < W; s++) {
		const uint64_t child = (uint64_t)node * W + s;
		if (child >= b->children)
			set_missing(n, (int)s);
		else if (b->level == 0)
			set_face(n, (int)s, &t->mesh, (uint32_t)child);
		else
			set_child(n, (int)s, t->nodes + t->level_first[b->level - 1] + child);
	}
}

static uint32_t nodes_over(uint32_t children)
{
	return children / W + (children % W != 0);
}

static wh_code fill_nodes(wh_ctx *c, void *arg, int64_t index, int worker)
{
	const box_job *b = arg;
	const uint32_t nodes = nodes_over(b->children);
	const uint32_t first = (uint32_t)index * NODES_PER_JOB;
	for (uint32_t i = first; i < nodes && i - first < NODES_PER_JOB; i++)
		fill_node(b, i);
	(void)c;
	(void)worker;
	return WH_OK;
}

static wh_code build_boxes(wh_ctx *c, const wh_exec *ex, wh_bvh *t)
{
	t->nodes = wh_alloc(c, layout(t, t->mesh.nf), sizeof *t->nodes);
	if (!t->nodes)
		return c->err.code;
	box_job b = {t, 0, t->mesh.nf};
	for (; b.level < t->levels; b.level++) {
		const uint32_t nodes = nodes_over(b.children);
		const int64_t jobs = nodes / NODES_PER_JOB + 1;
		if (wh_exec_for(c, ex, jobs, fill_nodes, &b) != WH_OK)
			return c->err.code;
		b.children = nodes;
	}
	return WH_OK;
}

wh_code wh_bvh_build(wh_ctx *c, const wh_exec *ex, const wh_mesh *m, const wh_frame *f, wh_bvh *t)
{
	*t = (wh_bvh){0};
	item *items = wh_alloc(c, m->nf, sizeof *items);
	if (!items)
		return c->err.code;
	make_items(m, f, items);
	wh_code code = order_items(c, ex, items, m->nf);
	if (code == WH_OK)
		code = copy_mesh(c, m, f, items, &t->mesh);
	wh_free(c, items);
	if (code == WH_OK)
		code = build_boxes(c, ex, t);
	if (code != WH_OK)
		wh_bvh_free(c, t);
	return code;
}

void wh_bvh_free(wh_ctx *c, wh_bvh *t)
{
	wh_free(c, t->nodes);
	wh_mesh_free(c, &t->mesh);
	*t = (wh_bvh){0};
}

/* ---- the query
 * -------------------------------------------------------------------------------------- */

/* Something still to be looked at. */
typedef struct todo {
	float bound; /* its squared distance is at least this */
	int level;   /* of the node; -1: a face */
	uint32_t id;
} todo;

enum { TODO_MAX = WH_BVH_LEVELS * WH_BVH_WIDTH };

typedef struct query {
	const wh_bvh *t;
	wh_vec3 p;
	float lo[3], hi[3]; /* the box around p */
	double best;        /* squared distance of the nearest face so far */
	float limit;        /* bounds from here on cannot be nearer than best */
	uint32_t face;
	todo stack[TODO_MAX]; /* nearest on top within the children of one node */
	int depth;
} query;

static void try_face(query *q, uint32_t face)
{
	const wh_mesh *m = &q->t->mesh;
	const uint32_t *t = m->tri + 3 * (size_t)face;
	const double d = wh_tri_dist2(q->p, m->pos[t[0]], m->pos[t[1]], m->pos[t[2]]);
	if (d >= q->best)
		return;
	q->best = d;
	q->face = face;
	q->limit = (float)(d * (1 + BOUND_SLACK));
}

/* Four floats in one register, and four truths: all bits set or none. */
typedef float lanes __attribute__((vector_size(16)));
typedef int32_t truths __attribute__((vector_size(16)));

static lanes load_lanes(const float *x)
{
	lanes v;
	memcpy(&v, x, sizeof v);
	return v;
}

/* x where positive, else 0. */
static lanes positive(lanes x)
{
	return (lanes)((truths)x & (x > 0));
}

/* Lower bounds of the squared distances to four boxes, from slot s on. A point is below a box or
 * above it or neither, so the sum of the two excesses is the greater one. */
static lanes bound_boxes(const query *q, const wh_bvh_node *n, int s)
{
	lanes sum = {0};
	for (int k = 0; k < 3; k++) {
		const lanes under = load_lanes(n->lo[k] + s) - q->hi[k];
		const lanes over = q->lo[k] - load_lanes(n->hi[k] + s);
		const lanes d = positive(under) + positive(over);
		sum += d * d;
	}
	return sum;
}

/* Bit i: lane i is true. */
static unsigned bits_of(truths t)
{
	const truths bit = t & (truths){1, 2, 4, 8};
	return (unsigned)(bit[0] | bit[1] | bit[2] | bit[3]);
}

/* Puts a child into the stack, above those of its siblings (from base on) that are farther. */
static void push(query *q, int base, todo x)
{
	int i = q->depth++;
	for (; i > base && q->stack[i - 1].bound < x.bound; i--)
		q->stack[i] = q->stack[i - 1];
	q->stack[i] = x;
}

static void open_node(query *q, const todo *x)
{
	const wh_bvh_node *n = q->t->nodes + q->t->level_first[x->level] + x->id;
	const int base = q->depth;
	for (int s = 0; s < W; s += 4) {
		const lanes bound = bound_boxes(q, n, s);
		for (unsigned near = bits_of(bound < q->limit); near; near &= near - 1) {
			const int lane = __builtin_ctz(near);
			push(q, base,
			     (todo){bound[lane], x->level - 1, x->id * W + (uint32_t)(s + lane)});
		}
	}
}

static void start(query *q, wh_vec3 p)
{
	const double xyz[3] = {p.x, p.y, p.z};
	q->p = p;
	for (int k = 0; k < 3; k++) {
		q->lo[k] = (float)xyz[k] - QUERY_SLACK;
		q->hi[k] = (float)xyz[k] + QUERY_SLACK;
	}
	q->best = INFINITY;
	q->limit = FLT_MAX;
	q->face = 0;
	q->depth = 0;
}

double wh_bvh_dist2(const wh_bvh *t, wh_vec3 p, uint32_t *hint)
{
	query q;
	q.t = t;
	start(&q, p);
	if (*hint != WH_NONE)
		try_face(&q, *hint);
	q.stack[q.depth++] = (todo){0, t->levels - 1, 0};
	while (q.depth > 0) {
		const todo x = q.stack[--q.depth];
		if (x.bound >= q.limit)
			continue;
		if (x.level < 0)
			try_face(&q, x.id);
		else
			open_node(&q, &x);
	}
	*hint = q.face;
	return q.best;
}
