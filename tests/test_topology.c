/*
 * Topology that may change: handles, holes, bridges and small parts go to reach a count, and what
 * is left is a manifold. Vertices that are not manifold are doubled.
 */
#include "testing.h"

#include "algo/simplify.h"
#include "algo/synth.h"
#include "base/rng.h"
#include "mesh/check.h"
#include "mesh/separate.h"

#include <math.h>
#include <string.h>

typedef struct fixture {
	testing_env t;
	wh_patch p;
	wh_simplify_workspace *w;
	wh_simplify_result done;
} fixture;

static void open_fixture(fixture *f, uint32_t nv, uint32_t nf)
{
	*f = (fixture){0};
	testing_init(&f->t);
	f->w = wh_simplify_workspace_new(&f->t.ctx);
	assert_non_null(f->w);
	assert_int_equal(wh_patch_reset(&f->t.ctx, &f->p, nv, nf), WH_OK);
	for (uint32_t v = 0; v < nv; v++) {
		f->p.gid[v] = v;
		f->p.flag[v] = 0;
		f->p.err[v] = 0;
	}
}

static void drop(fixture *f)
{
	wh_simplify_workspace_free(&f->t.ctx, f->w);
	wh_patch_free(&f->t.ctx, &f->p);
	testing_done(&f->t);
}

static wh_check look(fixture *f)
{
	const wh_mesh m = {.nv = f->p.nv, .nf = f->p.nf, .pos = f->p.pos, .tri = f->p.tri};
	wh_check r;
	assert_int_equal(wh_check_mesh(&f->t.ctx, &m, &r), WH_OK);
	return r;
}

static wh_simplify_params free_params(uint32_t faces)
{
	return (wh_simplify_params){.max_cost = (double)INFINITY,
	                            .max_err = (double)INFINITY,
	                            .target_faces = faces,
	                            .free_topology = true,
	                            .insist = true};
}

/* Reduces, and holds the counts of the result against those of the run. */
static wh_check reduce_with(fixture *f, const wh_simplify_params *p)
{
	const uint32_t before = f->p.nv;
	assert_int_equal(wh_simplify(&f->t.ctx, f->w, &f->p, p, &f->done), WH_OK);
	assert_int_equal(f->done.vertices, (int64_t)before - (int64_t)f->p.nv);
	const wh_check c = look(f);
	assert_int_equal(c.nonmanifold_edges, 0);
	assert_int_equal(c.nonmanifold_vertices, 0);
	assert_int_equal(c.misoriented_edges, 0);
	assert_int_equal(c.degenerate_faces, 0);
	assert_int_equal(c.duplicate_faces, 0);
	return c;
}

static wh_check reduce_to(fixture *f, uint32_t faces)
{
	const wh_simplify_params p = free_params(faces);
	return reduce_with(f, &p);
}

/* ---- meshes ---- */

/* `copies` generated surfaces side by side. */
static void synth(fixture *f, wh_synth_kind kind, uint64_t faces, uint32_t copies)
{
	testing_env t;
	wh_synth_params sp = wh_synth_defaults();
	wh_synth *s;
	wh_mesh m;
	testing_init(&t);
	sp.kind = kind;
	sp.faces = faces;
	assert_int_equal(wh_synth_open(&t.ctx, &s, &sp), WH_OK);
	assert_int_equal(wh_synth_mesh(&t.ctx, s, &m), WH_OK);
	open_fixture(f, copies * m.nv, copies * m.nf);
	for (uint32_t k = 0; k < copies; k++) {
		for (uint32_t v = 0; v < m.nv; v++)
			f->p.pos[k * m.nv + v] = wh_add(m.pos[v], wh_v3(1e5 * k, 0, 0));
		for (size_t i = 0; i < 3 * (size_t)m.nf; i++)
			f->p.tri[3 * (size_t)k * m.nf + i] = m.tri[i] + k * m.nv;
	}
	wh_mesh_free(&t.ctx, &m);
	wh_synth_close(&t.ctx, &s);
	testing_done(&t);
}

/* An uneven strip of n x m cells between two circles; of one cell in bite x bite a face is missing,
 * but not at the rims. */
static void strip(fixture *f, uint32_t n, uint32_t m, uint32_t bite, uint64_t seed)
{
	wh_rng g = wh_rng_seed(seed);
	open_fixture(f, n * (m + 1), 2 * n * m);
	for (uint32_t v = 0; v < f->p.nv; v++) {
		const double angle = 2 * 3.14159265358979 * (v % n) / n;
		const double r = 1 + (double)(v / n) / m;
		f->p.pos[v] = wh_v3(r * cos(angle), r * sin(angle), 0.02 * wh_rng_unit(&g));
	}
	uint32_t *t = f->p.tri;
	for (uint32_t j = 0; j < m; j++)
		for (uint32_t i = 0; i < n; i++) {
			const uint32_t a = j * n + i, b = j * n + (i + 1) % n;
			const bool bitten =
			    bite && i % bite == 0 && i + bite <= n && j % bite == 1 && j + 1 < m;
			const uint32_t two[6] = {a, a + n, b + n, a, b + n, b};
			memcpy(t, two, sizeof two);
			t += bitten ? 3 : 6;
		}
	f->p.nf = (uint32_t)((size_t)(t - f->p.tri) / 3);
}

/* ---- what goes ---- */

static void a_torus_becomes_a_tetrahedron(void **state)
{
	(void)state;
	fixture f;
	synth(&f, WH_SYNTH_TORUS, 3000, 1);
	const wh_check c = reduce_to(&f, 4);
	assert_int_equal(f.p.nf, 4);
	assert_int_equal(c.euler, 2);
	assert_int_equal(f.done.changes[WH_NECK], 1);
	drop(&f);
}

static void small_parts_go_and_the_last_one_stays(void **state)
{
	(void)state;
	fixture f;
	synth(&f, WH_SYNTH_SPHERE, 600, 5);
	const wh_check c = reduce_to(&f, 4);
	assert_int_equal(f.p.nf, 4);
	assert_int_equal(c.components, 1);
	assert_int_equal(f.done.changes[WH_SHELL], 4);
	drop(&f);
}

static void pinholes_are_closed_before_the_ring_opens(void **state)
{
	(void)state;
	fixture f;
	strip(&f, 48, 24, 6, 1);
	assert_int_equal(look(&f).boundary_loops, 2 + 8 * 4);
	const wh_check c = reduce_to(&f, 40);
	assert_int_equal(f.p.nf, 40);
	assert_in_range(c.boundary_loops, 2, 10); /* the ring is open at both ends still */
	assert_int_equal(c.components, 1);
	assert_true(f.done.changes[WH_HOLE] > 20);
	drop(&f);
}

static void a_ring_opens_at_last(void **state)
{
	(void)state;
	fixture f;
	strip(&f, 30, 6, 0, 2);
	const wh_check c = reduce_to(&f, 1);
	assert_int_equal(f.p.nf, 1);
	assert_int_equal(c.boundary_loops, 1);
	assert_true(f.done.changes[WH_BRIDGE] + f.done.changes[WH_HOLE] >= 1);
	drop(&f);
}

/* Random targets on surfaces with many holes. */
static void every_count_is_reached(void **state)
{
	(void)state;
	wh_rng g = wh_rng_seed(7);
	uint64_t changes = 0;
	for (uint64_t seed = 0; seed < 40; seed++) {
		fixture f;
		strip(&f, 12 + (uint32_t)(seed % 5), 5 + (uint32_t)(seed % 7),
		      2 + (uint32_t)(seed % 3), seed);
		const uint32_t target = 1 + (uint32_t)(wh_rng_unit(&g) * 40);
		(void)reduce_to(&f, target);
		assert_int_equal(f.p.nf, target);
		for (int k = 0; k < WH_TOPOLOGIES; k++)
			changes += f.done.changes[k];
		drop(&f);
	}
	assert_true(changes > 100);
}

/* ---- what stays ---- */

static void nothing_larger_than_the_error_goes(void **state)
{
	(void)state;
	fixture f;
	synth(&f, WH_SYNTH_TORUS, 3000, 3);
	const wh_check c = reduce_to(&f, 900);
	assert_int_equal(f.p.nf, 900);
	assert_int_equal(c.components, 3);
	assert_int_equal(c.euler, 0);
	drop(&f);
}

static void cut_vertices_stay(void **state)
{
	(void)state;
	fixture f;
	strip(&f, 24, 12, 3, 3);
	uint32_t cut = 0;
	for (uint32_t v = 0; v < f.p.nv; v++)
		if (v % 5 == 0) {
			f.p.flag[v] = WH_CUT;
			cut++;
		}
	(void)reduce_to(&f, 1);
	for (uint32_t v = 0; v < f.p.nv; v++)
		cut -= (f.p.flag[v] & WH_CUT) && f.p.gid[v] % 5 == 0;
	assert_int_equal(cut, 0);
	drop(&f);
}

static void names_stay_unique(void **state)
{
	(void)state;
	fixture f;
	bool seen[4000] = {false};
	synth(&f, WH_SYNTH_TORUS, 3000, 2);
	(void)reduce_to(&f, 12);
	assert_true(f.done.changes[WH_NECK] >= 2);
	for (uint32_t v = 0; v < f.p.nv; v++) {
		assert_true(f.p.gid[v] < sizeof seen / sizeof *seen && !seen[f.p.gid[v]]);
		seen[f.p.gid[v]] = true;
	}
	drop(&f);
}

static void the_distance_limit_holds(void **state)
{
	(void)state;
	fixture f;
	strip(&f, 48, 24, 6, 1);
	wh_simplify_params p = free_params(1);
	p.max_err = 0.01; /* the holes are 0.04 wide and more */
	assert_int_equal(reduce_with(&f, &p).boundary_loops, 2 + 8 * 4);
	drop(&f);
}

static void every_failed_allocation_is_survived(void **state)
{
	(void)state;
	unsigned failures = 0;
	for (long nth = 1;; nth++) {
		fixture f;
		strip(&f, 24, 12, 3, 4);
		f.t.mem.fail_after = nth;
		const wh_simplify_params p = free_params(2);
		const wh_code code = wh_simplify(&f.t.ctx, f.w, &f.p, &p, &f.done);
		drop(&f);
		if (code == WH_OK)
			break;
		failures++;
	}
	assert_true(failures >= 5);
}

/* ---- separating ---- */

static wh_separated separate(fixture *f)
{
	wh_separated done;
	assert_int_equal(wh_separate(&f->t.ctx, &f->p, f->p.nv, &done), WH_OK);
	for (size_t i = 0; i < 3 * (size_t)f->p.nf; i++)
		assert_true(f->p.tri[i] < f->p.nv);
	const wh_check c = look(f);
	assert_int_equal(c.nonmanifold_edges, 0);
	assert_int_equal(c.nonmanifold_vertices, 0);
	assert_int_equal(c.misoriented_edges, 0);
	return done;
}

static void draw(fixture *f, uint32_t nv, const uint32_t (*tri)[3], uint32_t nf)
{
	open_fixture(f, nv, nf);
	for (uint32_t v = 0; v < nv; v++)
		f->p.pos[v] = wh_v3(v, v * v, v * v * v);
	memcpy(f->p.tri, tri, nf * sizeof *tri);
}

static void a_bowtie_is_two_triangles(void **state)
{
	(void)state;
	static const uint32_t tri[][3] = {{0, 1, 2}, {0, 3, 4}};
	fixture f;
	draw(&f, 5, tri, 2);
	assert_int_equal(separate(&f).doubled, 1);
	assert_int_equal(f.p.gid[5], 5);
	assert_int_equal(look(&f).components, 2);
	drop(&f);
}

static void pages_of_a_book_come_apart(void **state)
{
	(void)state;
	static const uint32_t tri[][3] = {{0, 1, 2}, {0, 1, 3}, {1, 0, 4}};
	fixture f;
	draw(&f, 5, tri, 3);
	assert_int_equal(separate(&f).doubled, 4);
	assert_int_equal(look(&f).components, 3);
	drop(&f);
}

static void tetrahedra_at_an_edge_come_apart(void **state)
{
	(void)state;
	static const uint32_t tri[][3] = {{0, 1, 2}, {0, 2, 3}, {0, 3, 1}, {1, 3, 2},
	                                  {0, 1, 4}, {0, 4, 5}, {0, 5, 1}, {1, 5, 4}};
	fixture f;
	draw(&f, 6, tri, 8);
	const wh_separated done = separate(&f);
	assert_int_equal(done.pillows, 0);
	const wh_check c = look(&f);
	assert_int_equal(f.p.nf, 8);
	assert_true(c.components >= 2);
	drop(&f);
}

static void turned_faces_come_apart(void **state)
{
	(void)state;
	static const uint32_t tri[][3] = {{0, 1, 2}, {0, 1, 3}};
	fixture f;
	draw(&f, 4, tri, 2);
	assert_int_equal(separate(&f).doubled, 2);
	drop(&f);
}

static void faces_on_each_other_go(void **state)
{
	(void)state;
	static const uint32_t tri[][3] = {{0, 1, 2}, {2, 1, 0}, {0, 3, 4}};
	fixture f;
	draw(&f, 5, tri, 3);
	const wh_separated done = separate(&f);
	assert_int_equal(done.pillows, 1);
	assert_int_equal(f.p.nf, 1);
	assert_int_equal(f.p.nv, 3);
	drop(&f);
}

static void clean_surfaces_stay_as_they_are(void **state)
{
	(void)state;
	fixture f;
	strip(&f, 24, 12, 3, 5);
	const uint32_t nf = f.p.nf, nv = f.p.nv;
	const wh_separated done = separate(&f);
	assert_int_equal(done.doubled + done.pillows, 0);
	assert_true(f.p.nf == nf && f.p.nv == nv);
	drop(&f);
}

/* Faces between few vertices, at random. */
static void soup_becomes_a_manifold(void **state)
{
	(void)state;
	for (uint64_t seed = 0; seed < 200; seed++) {
		wh_rng g = wh_rng_seed(seed);
		fixture f;
		const uint32_t nv = 5 + (uint32_t)(seed % 30), nf = 3 * nv;
		open_fixture(&f, nv, nf);
		for (uint32_t v = 0; v < nv; v++)
			f.p.pos[v] = wh_v3(wh_rng_unit(&g), wh_rng_unit(&g), wh_rng_unit(&g));
		for (uint32_t i = 0; i < nf; i++) {
			uint32_t *t = &f.p.tri[3 * (size_t)i];
			do
				for (int k = 0; k < 3; k++)
					t[k] = (uint32_t)(wh_rng_unit(&g) * nv);
			while (t[0] == t[1] || t[1] == t[2] || t[2] == t[0]);
		}
		(void)separate(&f);
		(void)reduce_to(&f, f.p.nf / 4 + 1);
		drop(&f);
	}
}

static void a_hub_of_many_fans_takes_no_time(void **state)
{
	(void)state;
	enum { FANS = 200000 };
	fixture f;
	open_fixture(&f, 2 * FANS + 1, FANS);
	for (uint32_t i = 0; i < FANS; i++) {
		const uint32_t t[3] = {0, 2 * i + 1, 2 * i + 2};
		memcpy(&f.p.tri[3 * (size_t)i], t, sizeof t);
	}
	for (uint32_t v = 0; v < f.p.nv; v++)
		f.p.pos[v] = wh_v3(v, v & 1, 0);
	wh_separated done;
	assert_int_equal(wh_separate(&f.t.ctx, &f.p, f.p.nv, &done), WH_OK);
	assert_int_equal(done.doubled, FANS - 1);
	drop(&f);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	    cmocka_unit_test(a_torus_becomes_a_tetrahedron),
	    cmocka_unit_test(small_parts_go_and_the_last_one_stays),
	    cmocka_unit_test(pinholes_are_closed_before_the_ring_opens),
	    cmocka_unit_test(a_ring_opens_at_last),
	    cmocka_unit_test(every_count_is_reached),
	    cmocka_unit_test(nothing_larger_than_the_error_goes),
	    cmocka_unit_test(cut_vertices_stay),
	    cmocka_unit_test(names_stay_unique),
	    cmocka_unit_test(the_distance_limit_holds),
	    cmocka_unit_test(every_failed_allocation_is_survived),
	    cmocka_unit_test(a_bowtie_is_two_triangles),
	    cmocka_unit_test(pages_of_a_book_come_apart),
	    cmocka_unit_test(tetrahedra_at_an_edge_come_apart),
	    cmocka_unit_test(turned_faces_come_apart),
	    cmocka_unit_test(faces_on_each_other_go),
	    cmocka_unit_test(clean_surfaces_stay_as_they_are),
	    cmocka_unit_test(soup_becomes_a_manifold),
	    cmocka_unit_test(a_hub_of_many_fans_takes_no_time),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
