/*
 * kdtree: cuts space into a given number of cells that hold about the same number of points.
 *
 * Built from a sample of points; the cells are numbered in tree order, so that cells with near
 * numbers are near in space. Cuts go across the axis along which the middle nine tenths of the
 * points spread widest: a few outliers do not decide it. Points in one place are told apart by
 * their ids, the fourth axis, so that no heap of coincident points is too large for its cells. The
 * same sample and parameters give the same tree.
 */
#ifndef WH_GEOM_KDTREE_H
#define WH_GEOM_KDTREE_H

#include "base/mem.h"
#include "geom/vec3.h"

typedef struct wh_kdpoint {
	wh_vec3 pos;
	double id; /* below 2^53, so that it is exact; different for every point */
} wh_kdpoint;

enum { WH_KD_ID = 3, WH_KD_CELL = 4 };

typedef struct wh_kdnode {
	double cut;     /* coordinate < cut: left */
	uint32_t axis;  /* 0, 1, 2; WH_KD_ID; WH_KD_CELL */
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
wh_code wh_kdtree_build(wh_ctx *c, wh_kdtree *t, wh_kdpoint *point, size_t n, uint32_t cells,
                        double skew);
/* The same, with cuts that keep away from other points, n_clear of them, as well as moving each
 * cut by a fiftieth of the node's points allows. Reorders both. */
wh_code wh_kdtree_build_clear(wh_ctx *c, wh_kdtree *t, wh_kdpoint *point, size_t n, uint32_t cells,
                              double skew, wh_vec3 *clear, size_t n_clear);
void wh_kdtree_free(wh_ctx *c, wh_kdtree *t);

/* Share of the points that the largest of so many cells gets, where nothing stands in the way. */
double wh_kdtree_largest(uint32_t cells, double skew);

/* Bytes of a tree of so many cells. */
static inline size_t wh_kdtree_bytes(uint32_t cells)
{
	return 2 * (size_t)cells * sizeof(wh_kdnode);
}

/* Width of the middle nine tenths of the points along an axis, from some of them, evenly spaced.
 * 0 for no points. */
double wh_kd_spread(const wh_kdpoint *point, size_t n, uint32_t axis);

static inline double wh_kd_axis(const wh_vec3 *p, double id, uint32_t axis)
{
	return axis == 0 ? p->x : axis == 1 ? p->y : axis == 2 ? p->z : id;
}

/* The cell that the point `id` at p lies in. */
static inline uint32_t wh_kdtree_cell(const wh_kdtree *t, const wh_vec3 *p, uint64_t id)
{
	const double at[4] = {p->x, p->y, p->z, (double)id};
	const wh_kdnode *node = t->node;
	while (node->axis != WH_KD_CELL) { /* written so that the step is computed, not jumped to */
		const size_t right = node->right - (size_t)(node - t->node);
		node += at[node->axis] < node->cut ? 1 : right;
	}
	return node->right;
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
