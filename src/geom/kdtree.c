#include "geom/kdtree.h"

#include <stdlib.h>

enum { PROBES = 257 }; /* points looked at to choose an axis */

typedef struct builder {
	wh_kdnode *node;
	uint32_t used, cells;
	double skew;
} builder;

static int compare_double(const void *a, const void *b)
{
	const double x = *(const double *)a, y = *(const double *)b;
	return (x > y) - (x < y);
}

double wh_spread(const wh_vec3 *point, size_t n, uint32_t axis)
{
	if (n == 0)
		return 0;
	double value[PROBES];
	const size_t m = n < PROBES ? n : PROBES;
	for (size_t i = 0; i < m; i++)
		value[i] = wh_axis(&point[i * (n / m)], axis);
	qsort(value, m, sizeof *value, compare_double);
	return value[m - 1 - m / 20] - value[m / 20];
}

static uint32_t widest_axis(const wh_vec3 *point, size_t n)
{
	uint32_t best = 0;
	double most = -1;
	for (uint32_t axis = 0; axis < 3; axis++) {
		const double s = wh_spread(point, n, axis);
		if (s > most) {
			most = s;
			best = axis;
		}
	}
	return best;
}

static void swap_points(wh_vec3 *a, wh_vec3 *b)
{
	const wh_vec3 t = *a;
	*a = *b;
	*b = t;
}

/* Reorders so that point[rank] has the rank-th smallest coordinate, smaller ones before it and
 * larger ones after (Hoare's selection). The median of three as pivot is never the only largest,
 * so both parts of a partition are shorter than the whole. */
static void select_rank(wh_vec3 *point, size_t n, size_t rank, uint32_t axis)
{
	size_t lo = 0, hi = n - 1;
	while (lo < hi) {
		const double a = wh_axis(&point[lo], axis), d = wh_axis(&point[hi], axis);
		const double b = wh_axis(&point[lo + (hi - lo) / 2], axis);
		const double pivot = fmax(fmin(a, b), fmin(fmax(a, b), d));
		size_t i = lo, j = hi;
		for (;;) {
			while (wh_axis(&point[i], axis) < pivot)
				i++;
			while (wh_axis(&point[j], axis) > pivot)
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

static void build(builder *b, wh_vec3 *point, size_t n, uint32_t cells)
{
	wh_kdnode *node = &b->node[b->used++];
	if (cells == 1) {
		*node = (wh_kdnode){.axis = 3, .right = b->cells++};
		return;
	}
	uint32_t left = (uint32_t)(b->skew * (double)cells + 0.5);
	left = left < 1 ? 1 : left >= cells ? cells - 1 : left;
	const uint32_t axis = n ? widest_axis(point, n) : 0;
	/* With two or three cells the share of cells alone would repeat the same cut. */
	const double share = cells <= 3 ? ((double)left / (double)cells + b->skew) / 2
	                                : (double)left / (double)cells;
	size_t rank = (size_t)(share * (double)n);
	if (n) {
		rank = rank < n ? rank : n - 1;
		select_rank(point, n, rank, axis);
		node->cut = wh_axis(&point[rank], axis);
	} else {
		node->cut = 0;
	}
	node->axis = axis;
	build(b, point, rank, left);
	node->right = b->used;
	build(b, point + rank, n - rank, cells - left);
}

wh_code wh_kdtree_build(wh_ctx *c, wh_kdtree *t, wh_vec3 *point, size_t n, uint32_t cells,
                        double skew)
{
	*t = (wh_kdtree){.cells = cells};
	t->node = wh_alloc(c, 2 * (size_t)cells - 1, sizeof *t->node);
	if (!t->node)
		return c->err.code;
	builder b = {.node = t->node, .skew = skew};
	build(&b, point, n, cells);
	return WH_OK;
}

void wh_kdtree_free(wh_ctx *c, wh_kdtree *t)
{
	wh_free(c, t->node);
	*t = (wh_kdtree){0};
}
