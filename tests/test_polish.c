/* Smoothing takes what is rough and leaves what is wide and the boundary; normals are the faces'.
 */
#include "testing.h"

#include "base/rng.h"
#include "mesh/smooth.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { SIDE = 40 };

/* A square of SIDE x SIDE vertices: a wave as wide as it, and noise. */
static void make_field(testing_env *t, wh_mesh *m, double noise)
{
	wh_rng random = wh_rng_seed(3);
	assert_int_equal(wh_mesh_alloc(&t->ctx, m, SIDE * SIDE, 2 * (SIDE - 1) * (SIDE - 1)),
	                 WH_OK);
	for (uint32_t v = 0; v < m->nv; v++) {
		const uint32_t row = v / SIDE;
		const double x = v % SIDE, y = row;
		m->pos[v] =
		    wh_v3(x, y, 3 * sin(x * 6.283 / SIDE) + noise * (wh_rng_unit(&random) - 0.5));
	}
	uint32_t *to = m->tri;
	for (uint32_t v = 0; v + SIDE < m->nv; v++) {
		if (v % SIDE == SIDE - 1)
			continue;
		const uint32_t face[] = {v, v + 1, v + SIDE, v + 1, v + SIDE + 1, v + SIDE};
		memcpy(to, face, sizeof face);
		to += 6;
	}
}

static bool is_inside(uint32_t v)
{
	return v % SIDE > 0 && v % SIDE < SIDE - 1 && v >= SIDE && v < SIDE * (SIDE - 1);
}

/* Root of the mean squared distance of the heights inside. */
static double off(const wh_mesh *a, const wh_mesh *b)
{
	double sum = 0;
	for (uint32_t v = 0; v < a->nv; v++)
		if (is_inside(v))
			sum += pow(a->pos[v].z - b->pos[v].z, 2);
	return sqrt(sum / ((SIDE - 2) * (SIDE - 2)));
}

static void noise_goes_and_the_wave_stays(void **state)
{
	(void)state;
	testing_env t;
	wh_mesh smooth, wave, plain;
	testing_init(&t);
	make_field(&t, &smooth, 0.5);
	make_field(&t, &plain, 0);
	make_field(&t, &wave, 0);
	const double before = off(&smooth, &plain);
	assert_int_equal(wh_smooth(&t.ctx, &smooth, 10), WH_OK);
	assert_true(off(&smooth, &plain) < 0.5 * before);
	assert_int_equal(wh_smooth(&t.ctx, &wave, 10), WH_OK);
	assert_true(off(&wave, &plain) < 0.02 * 3);
	wh_mesh_free(&t.ctx, &smooth);
	wh_mesh_free(&t.ctx, &wave);
	wh_mesh_free(&t.ctx, &plain);
	testing_done(&t);
}

static void the_boundary_stays(void **state)
{
	(void)state;
	testing_env t;
	wh_mesh smooth, rough;
	testing_init(&t);
	make_field(&t, &smooth, 0.5);
	make_field(&t, &rough, 0.5);
	assert_int_equal(wh_smooth(&t.ctx, &smooth, 3), WH_OK);
	for (uint32_t v = 0; v < rough.nv; v++)
		assert_true((wh_norm(wh_sub(smooth.pos[v], rough.pos[v])) == 0) == !is_inside(v));
	wh_mesh_free(&t.ctx, &smooth);
	wh_mesh_free(&t.ctx, &rough);
	testing_done(&t);
}

/* Three faces at one edge: nothing says where its ends belong. */
static void an_edge_of_three_faces_stays(void **state)
{
	(void)state;
	wh_vec3 pos[] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}}, was[5];
	uint32_t tri[] = {0, 1, 2, 1, 0, 3, 0, 1, 4};
	const wh_mesh m = {.nv = 5, .nf = 3, .pos = pos, .tri = tri};
	testing_env t;
	testing_init(&t);
	memcpy(was, pos, sizeof pos);
	assert_int_equal(wh_smooth(&t.ctx, &m, 5), WH_OK);
	assert_memory_equal(pos, was, sizeof pos);
	testing_done(&t);
}

/*      2
 *     /|\     0, 1 and 2 in the plane z = 0, 3 below 0: the first face is three times the second
 *    0-+-1
 */
static void normals_are_means_by_area(void **state)
{
	(void)state;
	wh_vec3 pos[] = {{0, 0, 0}, {3, 0, 0}, {0, 1, 0}, {0, 0, -1}, {9, 9, 9}};
	uint32_t tri[] = {0, 1, 2, 0, 2, 3};
	const wh_mesh m = {.nv = 5, .nf = 2, .pos = pos, .tri = tri};
	wh_vec3 n[5];
	wh_mesh_normals(&m, n);
	const double long_way = 3 / sqrt(10), short_way = 1 / sqrt(10);
	assert_true(fabs(n[0].z - long_way) < 1e-15 && fabs(n[0].x + short_way) < 1e-15);
	assert_true(fabs(n[1].z - 1) < 1e-15);
	assert_true(fabs(n[3].x + 1) < 1e-15);
	assert_true(wh_norm(n[4]) == 0);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	    cmocka_unit_test(noise_goes_and_the_wave_stays),
	    cmocka_unit_test(the_boundary_stays),
	    cmocka_unit_test(an_edge_of_three_faces_stays),
	    cmocka_unit_test(normals_are_means_by_area),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
