/* The partition tree: balance on friendly and hostile points, and the same tree every time. */
#include "testing.h"

#include "base/rng.h"
#include "geom/kdtree.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

typedef struct fixture {
	testing_env t;
	wh_kdtree tree;
	wh_vec3 *point; /* as given: the tree reorders a copy */
	size_t n;
	uint32_t *held; /* points in each cell */
} fixture;

static void build(fixture *f, uint32_t cells, double skew)
{
	testing_init(&f->t);
	wh_kdpoint *copy = malloc((f->n + 1) * sizeof *copy);
	f->held = calloc(cells, sizeof *f->held);
	assert_non_null(copy);
	assert_non_null(f->held);
	for (size_t i = 0; i < f->n; i++)
		copy[i] = (wh_kdpoint){f->point[i], (double)i};
	assert_int_equal(wh_kdtree_build(&f->t.ctx, &f->tree, copy, f->n, cells, skew), WH_OK);
	assert_int_equal(f->tree.cells, cells);
	free(copy);
	for (size_t i = 0; i < f->n; i++) {
		const uint32_t k = wh_kdtree_cell(&f->tree, &f->point[i], i);
		assert_true(k < cells);
		f->held[k]++;
	}
}

static void drop(fixture *f)
{
	wh_kdtree_free(&f->t.ctx, &f->tree);
	free(f->point);
	free(f->held);
	testing_done(&f->t);
}

static void room(fixture *f, size_t n)
{
	*f = (fixture){.n = n};
	f->point = malloc(n * sizeof *f->point);
	assert_non_null(f->point);
}

static wh_vec3 random_point(wh_rng *g)
{
	const double x = wh_rng_unit(g), y = wh_rng_unit(g);
	return wh_v3(x, y, wh_rng_unit(g));
}

static void random_points(fixture *f, size_t n, uint64_t seed)
{
	wh_rng g = wh_rng_seed(seed);
	room(f, n);
	for (size_t i = 0; i < n; i++)
		f->point[i] = random_point(&g);
}

/* Every cell holds between `least` and `most` times its fair share. */
static void balanced(const fixture *f, double least, double most)
{
	const double share = (double)f->n / f->tree.cells;
	for (uint32_t k = 0; k < f->tree.cells; k++) {
		assert_true(f->held[k] >= least * share);
		assert_true(f->held[k] <= most * share);
	}
}

static void random_points_are_shared_out_evenly(void **state)
{
	(void)state;
	fixture f;
	random_points(&f, 20000, 6);
	build(&f, 64, 0.5);
	balanced(&f, 0.98, 1.02);
	drop(&f);
	const uint32_t cells[] = {1, 2, 3, 5, 100, 257};
	for (size_t i = 0; i < sizeof cells / sizeof *cells; i++) {
		random_points(&f, 20000, i);
		build(&f, cells[i], 0.5);
		balanced(&f, 0.75, 1.26);
		drop(&f);
	}
}

/* A skewed cut moves the cuts, not the balance. */
static void skewed_trees_are_balanced_too(void **state)
{
	(void)state;
	for (double skew = 0.3; skew < 0.75; skew += 0.05) {
		fixture f;
		random_points(&f, 20000, 7);
		build(&f, 64, skew);
		balanced(&f, 0.75, 1.26);
		drop(&f);
	}
}

/* With two or three cells alone the shares give way, so that no two skews cut at one place. */
static void few_cells_are_cut_elsewhere_by_another_skew(void **state)
{
	(void)state;
	for (uint32_t cells = 2; cells <= 3; cells++) {
		fixture a, b;
		random_points(&a, 10000, 8);
		random_points(&b, 10000, 8);
		build(&a, cells, 0.5);
		build(&b, cells, 0.4);
		assert_true(fabs(a.tree.node[0].cut - b.tree.node[0].cut) > 0.01);
		balanced(&b, 0.75, 1.25);
		drop(&a);
		drop(&b);
	}
}

/* Many points with the same coordinate cannot be parted by it. */
static void a_grid_is_cut_between_its_rows(void **state)
{
	(void)state;
	enum { SIDE = 120 };
	fixture f;
	room(&f, SIDE * SIDE);
	for (size_t i = 0; i < f.n; i++)
		f.point[i] = wh_v3((double)(i % SIDE), (double)(i / SIDE), 5);
	build(&f, 16, 0.5);
	balanced(&f, 0.75, 1.26);
	drop(&f);
}

static void one_far_point_does_not_decide_the_cuts(void **state)
{
	(void)state;
	fixture f;
	random_points(&f, 20000, 9);
	f.point[777] = wh_v3(1e30, -1e30, 1e30);
	build(&f, 64, 0.5);
	balanced(&f, 0.9, 1.1);
	drop(&f);
}

/* A plane's points are never cut across its normal, noise apart. */
static void the_widest_axis_is_cut(void **state)
{
	(void)state;
	fixture f;
	random_points(&f, 20000, 10);
	for (size_t i = 0; i < f.n; i++)
		f.point[i].y *= 1e-3;
	build(&f, 32, 0.5);
	for (uint32_t i = 0; i < 2 * 32 - 1; i++)
		assert_true(f.tree.node[i].axis != 1);
	drop(&f);
}

static void coincident_points_are_told_apart_by_their_ids(void **state)
{
	(void)state;
	for (double skew = 0.4; skew < 0.55; skew += 0.1) {
		fixture f;
		room(&f, 5000);
		for (size_t i = 0; i < f.n; i++)
			f.point[i] = wh_v3(1, 2, 3);
		build(&f, 32, skew);
		balanced(&f, 0.75, 1.3);
		drop(&f);
	}
}

/* Heaps of a third of the points each, in a cloud: no cell takes more than its share. */
static void heaps_are_shared_out_like_everything_else(void **state)
{
	(void)state;
	for (size_t heaps = 1; heaps <= 2; heaps++) {
		fixture f;
		random_points(&f, 21000, 11 + heaps);
		for (size_t i = 0; i < f.n; i++)
			if (i % 3 < heaps)
				f.point[i] = wh_v3(0.4, 0.6, 0.3 + (double)(i % 3));
		build(&f, 32, 0.5);
		balanced(&f, 0.3, 2);
		drop(&f);
	}
}

/* All in one place but for a few, on every side and far away. */
static void a_heap_with_outliers_is_balanced(void **state)
{
	(void)state;
	fixture f;
	room(&f, 10000);
	for (size_t i = 0; i < f.n; i++)
		f.point[i] = wh_v3(0, 0, 0);
	f.point[17] = wh_v3(1e30, 1, 0);
	f.point[4711] = wh_v3(-1e30, 0, 0);
	f.point[9999] = wh_v3(0, -5, 1e-300);
	build(&f, 40, 0.5);
	balanced(&f, 0, 1.5);
	drop(&f);
}

/* Points on a line, many at each of a few places. */
static void a_few_places_are_balanced(void **state)
{
	(void)state;
	for (size_t places = 2; places < 12; places++) {
		fixture f;
		room(&f, 8000);
		for (size_t i = 0; i < f.n; i++)
			f.point[i] = wh_v3((double)(i % places), 7, -1);
		build(&f, 25, 0.5);
		balanced(&f, 0, 2);
		drop(&f);
	}
}

/* A row whose ends are no ends of it: the medians of three that a selection begins with are bad,
 * one after the other. */
static void a_sorted_row_with_strays_takes_no_longer(void **state)
{
	(void)state;
	fixture f;
	room(&f, 600000);
	for (size_t i = 0; i < f.n; i++)
		f.point[i] = wh_v3((double)i, 0, 0);
	f.point[0] = f.point[f.n - 1] = wh_v3(1e7, 0, 0);
	const clock_t start = clock();
	build(&f, 32, 0.4);
	assert_true(clock() - start < 10 * CLOCKS_PER_SEC);
	balanced(&f, 0.7, 1.4);
	drop(&f);
}

static void fewer_points_than_cells_are_no_trouble(void **state)
{
	(void)state;
	for (size_t n = 0; n < 9; n++) {
		fixture f = {0};
		if (n)
			random_points(&f, n, n);
		build(&f, 40, 0.5);
		for (uint32_t k = 0; k < 40; k++)
			assert_true(f.held[k] <= 2);
		const wh_vec3 far[2] = {{-1e300, 0, 1e300}, {1e300, 1e300, -1e300}};
		for (int i = 0; i < 2; i++)
			assert_true(wh_kdtree_cell(&f.tree, &far[i], (uint64_t)i << 50) < 40);
		drop(&f);
	}
}

static void the_same_points_give_the_same_tree(void **state)
{
	(void)state;
	fixture a, b;
	random_points(&a, 12345, 12);
	random_points(&b, 12345, 12);
	build(&a, 77, 0.4);
	build(&b, 77, 0.4);
	for (uint32_t i = 0; i < 2 * 77 - 1; i++) {
		const wh_kdnode *x = &a.tree.node[i], *y = &b.tree.node[i];
		assert_true(x->axis == y->axis && x->right == y->right);
		assert_true(x->axis == 3 || x->cut == y->cut);
	}
	drop(&a);
	drop(&b);
}

/* Cells in tree order: every number is given to one leaf. */
static void cells_are_numbered_each_once(void **state)
{
	(void)state;
	enum { CELLS = 300 };
	fixture f;
	random_points(&f, 1000, 13);
	build(&f, CELLS, 0.5);
	uint32_t next = 0;
	for (uint32_t i = 0; i < 2 * CELLS - 1; i++)
		if (f.tree.node[i].axis == WH_KD_CELL)
			assert_int_equal(f.tree.node[i].right, next++);
	assert_int_equal(next, CELLS);
	drop(&f);
}

static void a_refused_tree_leaves_nothing(void **state)
{
	(void)state;
	testing_env t;
	wh_kdtree tree;
	wh_kdpoint p = {{0, 0, 0}, 0};
	testing_init(&t);
	t.mem.fail_after = 1;
	assert_int_equal(wh_kdtree_build(&t.ctx, &tree, &p, 1, 4, 0.5), WH_E_RUN);
	wh_kdtree_free(&t.ctx, &tree);
	testing_done(&t);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	    cmocka_unit_test(random_points_are_shared_out_evenly),
	    cmocka_unit_test(skewed_trees_are_balanced_too),
	    cmocka_unit_test(few_cells_are_cut_elsewhere_by_another_skew),
	    cmocka_unit_test(a_grid_is_cut_between_its_rows),
	    cmocka_unit_test(one_far_point_does_not_decide_the_cuts),
	    cmocka_unit_test(the_widest_axis_is_cut),
	    cmocka_unit_test(coincident_points_are_told_apart_by_their_ids),
	    cmocka_unit_test(heaps_are_shared_out_like_everything_else),
	    cmocka_unit_test(a_heap_with_outliers_is_balanced),
	    cmocka_unit_test(a_few_places_are_balanced),
	    cmocka_unit_test(a_sorted_row_with_strays_takes_no_longer),
	    cmocka_unit_test(fewer_points_than_cells_are_no_trouble),
	    cmocka_unit_test(the_same_points_give_the_same_tree),
	    cmocka_unit_test(cells_are_numbered_each_once),
	    cmocka_unit_test(a_refused_tree_leaves_nothing),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
