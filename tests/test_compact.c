/* Meshes in few bytes: what comes back. */
#include "testing.h"

#include "base/rng.h"
#include "mesh/compact.h"

#include <math.h>

/* The bytes of mesh/compact.h, read back. */
typedef struct decoder {
	const uint8_t *at;
	uint32_t met;
	int32_t last[3];
} decoder;

static uint32_t take_number(decoder *d)
{
	uint32_t n = 0;
	int shift = 0;
	do
		n |= (uint32_t)(*d->at & 127) << shift, shift += 7;
	while (*d->at++ & 128);
	return n;
}

static void decode(const wh_compact *m, uint32_t *corner, int32_t (*grid)[3])
{
	decoder d = {.at = m->at};
	for (size_t i = 0; i < 3 * (size_t)m->nf; i++) {
		const uint32_t ago = take_number(&d);
		assert_true(ago <= d.met);
		const uint32_t v = ago == 0 ? d.met++ : d.met - ago;
		for (int k = 0; k < 3; k++) {
			if (ago == 0) {
				const uint32_t n = take_number(&d);
				grid[v][k] =
				    d.last[k] + (n & 1 ? -(int32_t)(n / 2) - 1 : (int32_t)(n / 2));
			}
			d.last[k] = grid[v][k];
		}
		corner[i] = v;
	}
	assert_int_equal(d.met, m->nv);
	assert_ptr_equal(d.at, m->at + m->bytes);
}

/* A strip of n squares, its height by a seed, in the box 0 .. n, 0 .. 1, 0 .. 1, and a vertex of no
 * face in front. */
static void make_strip(testing_env *t, wh_mesh *m, uint32_t n)
{
	assert_int_equal(wh_mesh_alloc(&t->ctx, m, 2 * n + 3, 2 * n), WH_OK);
	m->pos[0] = wh_v3(1e9, 1e9, 1e9);
	for (uint32_t i = 0; i < 2 * n + 2; i++)
		m->pos[i + 1] =
		    wh_v3(i / 2, i % 2, (double)(wh_mix64(i) >> 11) / 9007199254740992.0);
	for (uint32_t f = 0; f < 2 * n; f++)
		for (uint32_t k = 0; k < 3; k++)
			m->tri[3 * f + k] = f + 1 + (f % 2 ? 2 - k : k);
}

static void faces_and_places_come_back(void **state)
{
	(void)state;
	enum { N = 300 };
	testing_env t;
	testing_init(&t);
	wh_mesh m = {0};
	wh_compact out = {0};
	uint32_t corner[6 * N];
	int32_t grid[2 * N + 2][3];
	make_strip(&t, &m, N);
	const wh_compact_grid g = wh_compact_grid_of(wh_v3(0, 0, 0), wh_v3(N, 1, 1));
	assert_int_equal(wh_compact_encode(&t.ctx, &m, &g, &out), WH_OK);
	assert_int_equal(out.nf, 2 * N);
	assert_int_equal(out.nv, 2 * N + 2); /* without the one that no face uses */
	decode(&out, corner, grid);
	for (size_t i = 0; i < 6 * N; i++) {
		const wh_vec3 p = m.pos[m.tri[i]];
		const int32_t *at = grid[corner[i]];
		const double d[] = {p.x - g.step * at[0], p.y - g.step * at[1],
		                    p.z - g.step * at[2]};
		for (int k = 0; k < 3; k++)
			assert_true(fabs(d[k]) <= 0.5001 * g.step);
	}
	assert_true(out.bytes < 9 * out.nf);
	wh_compact_free(&t.ctx, &out);
	wh_mesh_free(&t.ctx, &m);
	testing_done(&t);
}

static void places_off_the_grid_are_drawn_in(void **state)
{
	(void)state;
	testing_env t;
	testing_init(&t);
	wh_mesh m = {0};
	wh_compact out = {0};
	uint32_t corner[3];
	int32_t grid[3][3];
	assert_int_equal(wh_mesh_alloc(&t.ctx, &m, 3, 1), WH_OK);
	m.pos[0] = wh_v3(-1e300, 0, 2);
	m.pos[1] = wh_v3(INFINITY, NAN, 1);
	m.pos[2] = wh_v3(1, 0.5, -INFINITY);
	for (uint32_t k = 0; k < 3; k++)
		m.tri[k] = k;
	const wh_compact_grid g = wh_compact_grid_of(wh_v3(0, 0, 0), wh_v3(1, 1, 1));
	assert_int_equal(wh_compact_encode(&t.ctx, &m, &g, &out), WH_OK);
	decode(&out, corner, grid);
	const int32_t want[3][3] = {{0, 0, 65535}, {65535, 0, 65535}, {65535, 32768, 0}};
	assert_memory_equal(grid, want, sizeof want);
	wh_compact_free(&t.ctx, &out);
	wh_mesh_free(&t.ctx, &m);
	testing_done(&t);
}

static void a_box_without_size_has_a_grid(void **state)
{
	(void)state;
	const wh_vec3 p = wh_v3(3, 4, 5);
	assert_true(wh_compact_grid_of(p, p).step > 0);
	assert_true(wh_compact_grid_of(wh_v3(INFINITY, 0, 0), wh_v3(-INFINITY, 0, 0)).step > 0);
}

static void memory_refused_leaves_nothing(void **state)
{
	(void)state;
	for (long n = 1; n <= 2; n++) {
		testing_env t;
		testing_init(&t);
		wh_mesh m = {0};
		wh_compact out = {0};
		make_strip(&t, &m, 10);
		const wh_compact_grid g = wh_compact_grid_of(wh_v3(0, 0, 0), wh_v3(10, 1, 1));
		t.mem.fail_after = n;
		assert_int_equal(wh_compact_encode(&t.ctx, &m, &g, &out), WH_E_RUN);
		wh_compact_free(&t.ctx, &out);
		wh_mesh_free(&t.ctx, &m);
		testing_done(&t);
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	    cmocka_unit_test(faces_and_places_come_back),
	    cmocka_unit_test(places_off_the_grid_are_drawn_in),
	    cmocka_unit_test(a_box_without_size_has_a_grid),
	    cmocka_unit_test(memory_refused_leaves_nothing),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
