#include "geom/kdtree.h"

#include "base/rng.h"

#include <math.h>

enum {
	PROBES = 257, /* points looked at to choose an axis */
	PLACES = 64,  /* places tried for a cut that keeps away from others' points */
	STEPS = 64    /* of a selection: more than any but a bad row of points takes */
};

/* Within so large a share of a node's points a cut is moved to keep away from others. */
static const double SHIFT = 0.02;

typedef struct builder {
	wh_kdnode *node;
	uint32_t used, cells;
	double skew;
	double *clear; /* room for coordinates to keep away from; NULL: there are none */
} builder;

/* Points to keep away from. */
typedef struct clearing {
	wh_vec3 *point;
	size_t n;
} clearing;

static double axis_of(const wh_kdpoint *p, uint32_t axis)
{
	return wh_kd_axis(&p->pos, p->id, axis);
}

/* Value of a rank among n values, which are reordered (as select_rank, below). */
static double value_of_rank(double *value, size_t n, size_t rank)
{
	size_t lo = 0, hi = n - 1;
	while (lo < hi) {
		const double a = value[lo], b = value[lo + (hi - lo) / 2], d = value[hi];
		const double pivot = fmax(fmin(a, b), fmin(fmax(a, b), d));
		size_t i = lo, j = hi;
		for (;;) {
			while (value[i] < pivot)
				i++;
			while (value[j] > pivot)
				j--;
			if (i >= j)
				break;
			const double t = value[i];
			value[i++] = value[j];
			value[j--] = t;
		}
		if (rank <= j)
			hi = j;
		else
			lo = j + 1;
	}
	return value[rank];
}

double wh_kd_spread(const wh_kdpoint *point, size_t n, uint32_t axis)
{
	if (n == 0)
		return 0;
	double value[PROBES];
	const size_t m = n < PROBES ? n : PROBES;
	for (size_t i = 0; i < m; i++)
		value[i] = axis_of(&point[i * (n / m)], axis);
	const double low = value_of_rank(value, m, m / 20);
	return value_of_rank(value, m, m - 1 - m / 20) - low;
}

static uint32_t widest_axis(const wh_kdpoint *point, size_t n)
{
	uint32_t best = 0;
	double most = -1;
	for (uint32_t axis = 0; axis < 3; axis++) {
		const double s = wh_kd_spread(point, n, axis);
		if (s > most) {
			most = s;
			best = axis;
		}
	}
	return best;
}

static void swap_points(wh_kdpoint *a, wh_kdpoint *b)
{
	const wh_kdpoint t = *a;
	*a = *b;
	*b = t;
}

/* The median of both ends and the middle; after many steps, which a sorted row with a stray point
 * at its end takes, of three places anywhere. It is never the only largest. */
static double pick_pivot(const wh_kdpoint *point, size_t n, uint32_t axis, uint32_t step)
{
	size_t at[3] = {0, (n - 1) / 2, n - 1};
	for (size_t k = 0; k < 3 && step > STEPS && n >= 3; k++)
		at[k] = k * (n / 3) + wh_mix64(3 * (uint64_t)step + k) % (n / 3);
	const double a = axis_of(&point[at[0]], axis), b = axis_of(&point[at[1]], axis);
	return fmax(fmin(a, b), fmin(fmax(a, b), axis_of(&point[at[2]], axis)));
}

/* Reorders so that point[rank] has the rank-th smallest coordinate, smaller ones before it and
 * larger ones after (Hoare's selection). As the pivot is never the only largest, both parts of a
 * partition are shorter than the whole. */
static void select_rank(wh_kdpoint *point, size_t n, size_t rank, uint32_t axis)
{
	size_t lo = 0, hi = n - 1;
	for (uint32_t step = 0; lo < hi; step++) {
		const double pivot = pick_pivot(point + lo, hi - lo + 1, axis, step);
		size_t i = lo, j = hi;
		for (;;) {
			while (axis_of(&point[i], axis) < pivot)
				i++;
			while (axis_of(&point[j], axis) > pivot)
				j--;
			if (i >= j)
				break;
			swap_points(&point[i++], &point[j--]);
		}
		/* [lo, j] <= pivot <= [j+1, hi] */
		if (rank <= j)
			hi = j;
		else
			lo = j + 1;
	}
}

/* Cells that go left of the middle. */
static uint32_t left_cells(double skew, uint32_t cells)
{
	const uint32_t left = (uint32_t)(skew * (double)cells + 0.5);
	return left < 1 ? 1 : left >= cells ? cells - 1 : left;
}

/* Share of the points that should lie left of the middle. With two or three cells and another skew
 * the share of cells alone would repeat the cut of an even tree. */
static double left_share(double skew, uint32_t cells, uint32_t left)
{
	const double part = (double)left / (double)cells;
	return cells <= 3 && skew != 0.5 ? (part + skew) / 2 : part;
}

static size_t left_points(const builder *b, size_t n, uint32_t cells, uint32_t left)
{
	const size_t rank = (size_t)(left_share(b->skew, cells, left) * (double)n);
	return rank < n ? rank : n - 1;
}

double wh_kdtree_largest(uint32_t cells, double skew)
{
	if (cells <= 1)
		return 1;
	const uint32_t left = left_cells(skew, cells);
	const double share = left_share(skew, cells, left);
	return fmax(share * wh_kdtree_largest(left, skew),
	            (1 - share) * wh_kdtree_largest(cells - left, skew));
}

/* Moves the points whose coordinate is less than `cut` to the front; returns their number. */
static size_t part_points(wh_kdpoint *point, size_t n, uint32_t axis, double cut)
{
	size_t below = 0;
	for (size_t i = 0; i < n; i++)
		if (axis_of(&point[i], axis) < cut)
			swap_points(&point[below++], &point[i]);
	return below;
}

static size_t distance(size_t a, size_t b)
{
	return a > b ? a - b : b - a;
}

/* Cuts beside a heap, those of the points that have the coordinate of point[rank] in common: on
 * the side that is nearer to rank, and where there are points on both sides. Returns the number of
 * points on the left; 0 when all points are in the heap. */
static size_t cut_beside(wh_kdpoint *point, size_t n, size_t rank, uint32_t axis, double *cut)
{
	const double heap = axis_of(&point[rank], axis);
	double above = INFINITY;
	size_t below = 0, upto = 0;
	for (size_t i = 0; i < n; i++) {
		const double x = axis_of(&point[i], axis);
		below += x < heap;
		upto += x <= heap;
		if (x > heap)
			above = fmin(above, x);
	}
	const bool over = upto < n && (below == 0 || distance(upto, rank) < distance(below, rank));
	*cut = over ? above : heap;
	return over || below > 0 ? part_points(point, n, axis, *cut) : 0;
}

static size_t count_below(const wh_kdpoint *point, size_t n, uint32_t axis, double cut)
{
	size_t below = 0;
	for (size_t i = 0; i < n; i++)
		below += axis_of(&point[i], axis) < cut;
	return below;
}

/*
 * Chooses the cut of a node and the cells and points on its left. A cut through a heap leaves the
 * heap on its right. That is well for the rows of a grid; but when it would take the points of more
 * than half a cell from the left, the cut goes beside the heap, along any axis that has something
 * beside it, else across the ids, and the cells are shared out by the points.
 */
static size_t choose_cut(const builder *b, wh_kdpoint *point, size_t n, uint32_t cells,
                         wh_kdnode *node, uint32_t *left)
{
	*left = left_cells(b->skew, cells);
	node->axis = n ? widest_axis(point, n) : 0;
	if (n == 0)
		return 0;
	const size_t rank = left_points(b, n, cells, *left);
	select_rank(point, n, rank, node->axis);
	node->cut = axis_of(&point[rank], node->axis);
	const size_t missing = rank - count_below(point, rank, node->axis, node->cut);
	if ((double)missing * 2 * (double)cells <= (double)n)
		return rank;
	const uint32_t widest = node->axis;
	for (uint32_t i = 0; i < 3; i++) {
		node->axis = (widest + i) % 3;
		select_rank(point, n, rank, node->axis);
		const size_t below = cut_beside(point, n, rank, node->axis, &node->cut);
		if (below == 0)
			continue;
		const double share = (double)below / (double)n;
		*left = (uint32_t)(share * (double)cells + 0.5);
		*left = *left < 1 ? 1 : *left >= cells ? cells - 1 : *left;
		return below;
	}
	node->axis = WH_KD_ID;
	select_rank(point, n, rank, WH_KD_ID);
	node->cut = point[rank].id;
	return rank;
}

/*
 * The place between lo and hi that is clearest of n coordinates: where the sum of 1 / (d + w)^2 is
 * least, d being the distance of one of them and w half the step between the places that are tried.
 * Of a few it is far from each; of many it is where they are sparse.
 */
static double clearest(const double *x, size_t n, double lo, double hi)
{
	const double step = (hi - lo) / PLACES;
	double best = lo, least = INFINITY;
	for (int i = 0; i <= PLACES && step > 0; i++) {
		const double at = lo + i * step;
		double sum = 0;
		for (size_t k = 0; k < n; k++) {
			const double d = fabs(x[k] - at) / step + 0.5;
			sum += 1 / (d * d);
		}
		if (sum < least) {
			least = sum;
			best = at;
		}
	}
	return best;
}

/* Moves a cut a little to where it is far from the points of `c`. Returns the number of points on
 * its left. */
static size_t keep_away(const builder *b, wh_kdpoint *point, size_t n, size_t below,
                        wh_kdnode *node, const clearing *c)
{
	const size_t shift = (size_t)(SHIFT * (double)n);
	if (c->n == 0 || node->axis == WH_KD_ID || below <= shift || below + shift >= n)
		return below;
	select_rank(point, n, below - shift, node->axis);
	const double lo = axis_of(&point[below - shift], node->axis);
	select_rank(point, n, below + shift, node->axis);
	const double hi = axis_of(&point[below + shift], node->axis);
	const double beside = (hi - lo) / 8;
	size_t near = 0;
	for (size_t i = 0; i < c->n; i++) {
		const double x = wh_kd_axis(&c->point[i], 0, node->axis);
		if (x >= lo - beside && x <= hi + beside)
			b->clear[near++] = x;
	}
	if (near)
		node->cut = clearest(b->clear, near, lo, hi);
	return part_points(point, n, node->axis, node->cut);
}

static size_t part_clearing(const clearing *c, const wh_kdnode *node)
{
	size_t below = 0;
	for (size_t i = 0; i < c->n; i++) {
		const wh_vec3 p = c->point[i];
		if (node->axis != WH_KD_ID && !(wh_kd_axis(&p, 0, node->axis) < node->cut))
			continue;
		c->point[i] = c->point[below];
		c->point[below++] = p;
	}
	return below;
}

static void build(builder *b, wh_kdpoint *point, size_t n, uint32_t cells, clearing clear)
{
	wh_kdnode *node = &b->node[b->used++];
	*node = (wh_kdnode){.axis = WH_KD_CELL};
	if (cells == 1) {
		node->right = b->cells++;
		return;
	}
	uint32_t left;
	size_t n_left = choose_cut(b, point, n, cells, node, &left);
	n_left = keep_away(b, point, n, n_left, node, &clear);
	const size_t c_left = part_clearing(&clear, node);
	build(b, point, n_left, left, (clearing){clear.point, c_left});
	node->right = b->used;
	build(b, point + n_left, n - n_left, cells - left,
	      (clearing){clear.point + c_left, clear.n - c_left});
}

wh_code wh_kdtree_build(wh_ctx *c, wh_kdtree *t, wh_kdpoint *point, size_t n, uint32_t cells,
                        double skew)
{
	return wh_kdtree_build_clear(c, t, point, n, cells, skew, NULL, 0);
}

wh_code wh_kdtree_build_clear(wh_ctx *c, wh_kdtree *t, wh_kdpoint *point, size_t n, uint32_t cells,
                              double skew, wh_vec3 *clear, size_t n_clear)
{
	*t = (wh_kdtree){.cells = cells};
	t->node = wh_alloc(c, 2 * (size_t)cells - 1, sizeof *t->node);
	builder b = {.node = t->node, .skew = skew, .clear = NULL};
	if (n_clear)
		b.clear = wh_alloc(c, n_clear, sizeof *b.clear);
	if (t->node && (b.clear || !n_clear))
		build(&b, point, n, cells, (clearing){clear, n_clear});
	wh_free(c, b.clear);
	return c->err.code;
}

void wh_kdtree_free(wh_ctx *c, wh_kdtree *t)
{
	wh_free(c, t->node);
	*t = (wh_kdtree){0};
}
