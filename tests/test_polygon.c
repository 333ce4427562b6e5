/* Polygons: cut without flipped triangles, whatever corner the list begins with. */
#include "testing.h"

#include "base/rng.h"
#include "geom/polygon.h"

#include <stdlib.h>
#include <string.h>

enum { MOST = 64 };

static double area(wh_vec3 a, wh_vec3 b, wh_vec3 c)
{
	return wh_cross(wh_sub(b, a), wh_sub(c, a)).z / 2;
}

/* Triangles as sorted lists of ids from the smallest on, to compare sets. */
static int compare(const void *a, const void *b)
{
	return memcmp(a, b, 3 * sizeof(uint64_t));
}

static size_t cut(const wh_vec3 *pos, const uint64_t *ids, size_t n, size_t shift,
                  uint64_t out[][3], double *sum, double *least)
{
	static wh_polygon_workspace scratch;
	wh_vec3 p[MOST];
	uint64_t id[MOST];
	uint32_t corners[3 * MOST];
	for (size_t i = 0; i < n; i++) {
		p[i] = pos[(i + shift) % n];
		id[i] = ids[(i + shift) % n];
	}
	const size_t k = wh_polygon_cut(p, id, n, corners, &scratch);
	*sum = 0;
	*least = 1e300;
	for (size_t i = 0; i < k; i++) {
		const uint32_t *t = corners + 3 * i;
		const double a = area(p[t[0]], p[t[1]], p[t[2]]);
		*sum += a;
		*least = a < *least ? a : *least;
		size_t first = 0;
		for (size_t j = 1; j < 3; j++)
			first = id[t[j]] < id[t[first]] ? j : first;
		for (size_t j = 0; j < 3; j++)
			out[i][j] = id[t[(first + j) % 3]];
	}
	qsort(out, k, sizeof out[0], compare);
	return k;
}

/* The pieces cover the polygon once, none is flipped, and the start does not matter. */
static void assert_cut_well(const wh_vec3 *pos, const uint64_t *ids, size_t n, double whole)
{
	uint64_t first[MOST][3], other[MOST][3];
	double sum, least;
	for (size_t shift = 0; shift < n; shift++) {
		assert_int_equal(cut(pos, ids, n, shift, shift ? other : first, &sum, &least),
		                 n - 2);
		assert_true(least > 0);
		assert_true(fabs(sum - whole) < 1e-9 * fabs(whole));
		if (shift)
			assert_memory_equal(first, other, (n - 2) * sizeof first[0]);
	}
}

static double polygon_area(const wh_vec3 *p, size_t n)
{
	double sum = 0;
	for (size_t i = 1; i + 1 < n; i++)
		sum += area(p[0], p[i], p[i + 1]);
	return sum;
}

/*   3---2
 *    \ 1 \    corner 1 is pushed inside: only the diagonal 1-3 works */
static void a_concave_quad_is_cut_at_its_reflex_corner(void **state)
{
	(void)state;
	const wh_vec3 p[4] = {{0, 0, 0}, {1.4, 1.5, 0}, {4, 2, 0}, {1, 2, 0}};
	const uint64_t ids[4] = {5, 9, 7, 8};
	assert_cut_well(p, ids, 4, polygon_area(p, 4));
}

static void the_shorter_diagonal_wins_and_a_tie_goes_to_the_smallest_id(void **state)
{
	(void)state;
	double sum, least;
	uint64_t t[MOST][3];
	const wh_vec3 kite[4] = {{0, 0, 0}, {2, -1, 0}, {9, 0, 0}, {2, 1, 0}};
	const uint64_t ids[4] = {1, 2, 3, 4};
	(void)cut(kite, ids, 4, 0, t, &sum, &least);
	const uint64_t by_24[2][3] = {{1, 2, 4}, {2, 3, 4}};
	assert_memory_equal(t, by_24, sizeof by_24);
	const wh_vec3 square[4] = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}};
	const uint64_t other[4] = {4, 1, 2, 3};
	(void)cut(square, other, 4, 0, t, &sum, &least);
	const uint64_t by_13[2][3] = {{1, 2, 3}, {1, 3, 4}};
	assert_memory_equal(t, by_13, sizeof by_13);
}

static void a_comb_with_deep_teeth_is_cut_without_flips(void **state)
{
	(void)state;
	enum { TEETH = 10, N = 2 * TEETH + 1 };
	wh_vec3 p[N];
	uint64_t ids[N];
	p[0] = wh_v3(TEETH, 10, 0);
	p[1] = wh_v3(0, 10, 0);
	for (int i = 0; i < 2 * TEETH - 1; i++)
		p[2 + i] = wh_v3(0.5 * i + 0.1, i % 2 ? 9 : 0, 0);
	for (size_t i = 0; i < N; i++)
		ids[i] = (i * 5 + 3) % N;
	assert_cut_well(p, ids, N, polygon_area(p, N));
}

static void random_stars_are_cut_without_flips_far_from_the_origin(void **state)
{
	(void)state;
	wh_rng r = wh_rng_seed(3);
	for (int round = 0; round < 200; round++) {
		const size_t n = 5 + (size_t)(wh_rng_next(&r) % 40);
		wh_vec3 p[MOST];
		uint64_t ids[MOST];
		for (size_t i = 0; i < n; i++) {
			const double angle = 6.283185307179586 * (double)i / (double)n;
			const double radius = 0.2 + wh_rng_unit(&r);
			p[i] = wh_v3(radius * cos(angle) + 4096, radius * sin(angle) - 4096, 0);
			ids[i] = wh_rng_next(&r);
		}
		assert_cut_well(p, ids, n, polygon_area(p, n));
	}
}

static void the_plane_does_not_matter(void **state)
{
	(void)state;
	/* an L seen along each axis from both sides: its six corners, one of them reflex */
	static const double xy[6][2] = {{0, 0}, {2, 0}, {2, 1}, {1, 1}, {1, 3}, {0, 3}};
	static wh_polygon_workspace scratch;
	const uint64_t ids[6] = {3, 1, 4, 15, 9, 2};
	for (int axis = 0; axis < 3; axis++) {
		for (int side = -1; side <= 1; side += 2) {
			wh_vec3 p[6];
			uint32_t t[12];
			for (int i = 0; i < 6; i++) {
				const double u = side * xy[i][0], v = xy[i][1];
				p[i] = axis == 0   ? wh_v3(0, u, v)
				       : axis == 1 ? wh_v3(v, 0, u)
				                   : wh_v3(u, v, 0);
			}
			assert_int_equal(wh_polygon_cut(p, ids, 6, t, &scratch), 4);
			double sum = 0;
			for (int i = 0; i < 4; i++) {
				const wh_vec3 n = wh_cross(wh_sub(p[t[3 * i + 1]], p[t[3 * i]]),
				                           wh_sub(p[t[3 * i + 2]], p[t[3 * i]]));
				const double a = (n.x + n.y + n.z) / 2;
				assert_true(a * side > 0);
				sum += a;
			}
			assert_true(fabs(sum * side - 4) < 1e-12);
		}
	}
}

static void flat_and_crossed_polygons_still_give_triangles(void **state)
{
	(void)state;
	double sum, least;
	uint64_t t[MOST][3];
	const wh_vec3 line[5] = {{0, 0, 0}, {1, 0, 0}, {2, 0, 0}, {3, 0, 0}, {4, 0, 0}};
	const wh_vec3 point[5] = {{0, 0, 0}};
	const wh_vec3 star[5] = {{0, 3, 0}, {2, -3, 0}, {-3, 1, 0}, {3, 1, 0}, {-2, -3, 0}};
	const uint64_t ids[5] = {1, 2, 3, 4, 5};
	assert_int_equal(cut(line, ids, 5, 0, t, &sum, &least), 3);
	assert_int_equal(cut(point, ids, 5, 0, t, &sum, &least), 3);
	assert_int_equal(cut(star, ids, 5, 0, t, &sum, &least), 3);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	    cmocka_unit_test(a_concave_quad_is_cut_at_its_reflex_corner),
	    cmocka_unit_test(the_shorter_diagonal_wins_and_a_tie_goes_to_the_smallest_id),
	    cmocka_unit_test(a_comb_with_deep_teeth_is_cut_without_flips),
	    cmocka_unit_test(random_stars_are_cut_without_flips_far_from_the_origin),
	    cmocka_unit_test(the_plane_does_not_matter),
	    cmocka_unit_test(flat_and_crossed_polygons_still_give_triangles),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
