/*
 * kdtree: cuts space into a given number of cells that hold about the same number of points.
 *
 * Built from a sample of points; the cells are numbered in tree order, so that cells with near
 * numbers are near in space. Cuts go across the axis along which the middle nine tenths of the
 * points spread widest: a few outliers do not decide it. The same sample and parameters give the
 * same tree.
 */
#ifndef WH_GEOM_KDTREE_H
#define WH_GEOM_KDTREE_H

#include "base/mem.h"
#include "geom/vec3.h"

typedef struct wh_kdnode {
	double cut;     /* coordinate < cut: left */
	uint32_t axis;  /* 0, 1, 2; 3: a cell */
	uint32_t right; /* inner: index of the right child (left is the next node); cell: number */
} wh_kdnode;

typedef struct wh_kdtree {
	wh_kdnode *node;
	uint32_t cells;
} wh_kdtree;

/*
 * Builds a tree of `cells` >= 1 cells over n >= 0 points, which it reorders. `skew` in (0, 1) is
 * the share of the cells that goes left at each cut: trees with different skews cut in different
 * places.
 */
wh_code wh_kdtree_build(wh_ctx *c, wh_kdtree *t, wh_vec3 *point, size_t n, uint32_t cells,
                        double skew);
void wh_kdtree_free(wh_ctx *c, wh_kdtree *t);

static inline double wh_axis(const wh_vec3 *p, uint32_t axis)
{
	return axis == 0 ? p->x : axis == 1 ? p->y : p->z;
}

/* Width of the middle nine tenths of the points along an axis, from some of them, evenly spaced.
 * 0 for no points. */
double wh_spread(const wh_vec3 *point, size_t n, uint32_t axis);

/* The cell that p lies in. */
static inline uint32_t wh_kdtree_cell(const wh_kdtree *t, const wh_vec3 *p)
{
	uint32_t i = 0;
	while (t->node[i].axis < 3)
		i = wh_axis(p, t->node[i].axis) < t->node[i].cut ? i + 1 : t->node[i].right;
	return t->node[i].right;
}

/* The cell of a triangle whose corners lie in cells a, b and d: that of most corners; the least of
 * three different ones. */
static inline uint32_t wh_kdtree_majority(uint32_t a, uint32_t b, uint32_t d)
{
	if (a == b || a == d)
		return a;
	if (b == d)
		return b;
	return a < b ? (a < d ? a : d) : (b < d ? b : d);
}

#endif
