/* The distance of points and surfaces: exact where it can be known, brute force elsewhere. */
#include "testing.h"

#include "algo/compare.h"
#include "base/rng.h"
#include "geom/tri.h"
#include "mesh/bvh.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

static double signed_unit(wh_rng *g)
{
	return 2 * wh_rng_unit(g) - 1;
}

static wh_vec3 random_point(wh_rng *g)
{
	const double x = signed_unit(g), y = signed_unit(g);
	return wh_v3(x, y, signed_unit(g));
}

/* ---- point and triangle
 * --------------------------------------------------------------------------- */

static void dist2_is(wh_vec3 p, double want)
{
	const wh_vec3 a = {0, 0, 0}, b = {4, 0, 0}, c = {0, 4, 0};
	assert_true(fabs(wh_tri_dist2(p, a, b, c) - want) < 1e-14);
	assert_true(fabs(wh_tri_dist2(p, c, b, a) - want) < 1e-14);
	assert_true(fabs(wh_tri_dist2(p, b, c, a) - want) < 1e-14);
}

/*  c
 *  | \      one point for each of the seven regions
 *  a---b  */
static void nearest_point_is_found_in_every_region(void **state)
{
	(void)state;
	dist2_is(wh_v3(1, 1, 3), 9);
	dist2_is(wh_v3(2, -1, 2), 5);
	dist2_is(wh_v3(-1, 2, 2), 5);
	dist2_is(wh_v3(4, 4, 0), 8);
	dist2_is(wh_v3(-1, -2, 2), 9);
	dist2_is(wh_v3(6, -1, 0), 5);
	dist2_is(wh_v3(-1, 6, 1), 6);
	dist2_is(wh_v3(1, 1, 0), 0);
}

static void degenerate_triangles_are_segments_and_points(void **state)
{
	(void)state;
	const wh_vec3 o = {0, 0, 0}, x = {2, 0, 0}, m = {1, 0, 0}, p = {1, 3, 0}, q = {5, 0, 4};
	assert_true(wh_tri_dist2(p, o, o, o) == 10);
	assert_true(wh_tri_dist2(p, o, x, m) == 9);
	assert_true(wh_tri_dist2(p, o, m, x) == 9);
	assert_true(wh_tri_dist2(p, x, x, o) == 9);
	assert_true(wh_tri_dist2(q, o, m, x) == 25);
}

/* Against the least distance of a fine grid of the triangle's points: never more than that, and
 * less by no more than half a grid cell. */
static void distance_matches_a_dense_search(void **state)
{
	(void)state;
	enum { GRID = 60 };
	wh_rng g = wh_rng_seed(5);
	for (int round = 0; round < 300; round++) {
		const wh_vec3 a = random_point(&g), b = random_point(&g), c = random_point(&g);
		const wh_vec3 p = wh_scale(random_point(&g), 2);
		double least = INFINITY;
		for (int i = 0; i <= GRID; i++) {
			for (int j = 0; i + j <= GRID; j++) {
				const wh_vec3 ab = wh_scale(wh_sub(b, a), i / (double)GRID);
				const wh_vec3 ac = wh_scale(wh_sub(c, a), j / (double)GRID);
				const wh_vec3 at = wh_add(a, wh_add(ab, ac));
				least = fmin(least, wh_norm(wh_sub(at, p)));
			}
		}
		const double d = sqrt(wh_tri_dist2(p, a, b, c));
		assert_true(d <= least + 1e-12);
		assert_true(d > least - 4.0 / GRID);
	}
}

/* ---- the tree
 * --------------------------------------------------------------------------------------- */

/* Random triangles about a scale apart; every fifth is degenerate in some way. */
static wh_mesh random_mesh(testing_env *t, uint32_t nf, double size, uint64_t seed)
{
	wh_rng g = wh_rng_seed(seed);
	wh_mesh m;
	assert_int_equal(wh_mesh_alloc(&t->ctx, &m, 3 * nf + 2, nf), WH_OK);
	for (uint32_t f = 0; f < nf; f++) {
		const wh_vec3 at = random_point(&g);
		for (uint32_t k = 0; k < 3; k++) {
			m.pos[3 * f + k] = wh_add(at, wh_scale(random_point(&g), size));
			m.tri[3 * f + k] = 3 * f + k;
		}
		if (f % 10 == 3)
			m.pos[3 * f + 1] = m.pos[3 * f];
		if (f % 10 == 8)
			m.tri[3 * f + 2] = m.tri[3 * f + 1] = m.tri[3 * f];
	}
	m.pos[3 * nf] = m.pos[3 * nf + 1] = wh_v3(0, 0, 0); /* unreferenced */
	return m;
}

/* A finished tree; `open`: with all pages. */
static wh_bvh make_tree(testing_env *t, const wh_mesh *m, bool open)
{
	const wh_exec ex = {.workers = 2};
	wh_bvh tree;
	wh_vec3 lo, hi;
	size_t n = 0;
	wh_vec3 *points = wh_alloc(&t->ctx, WH_BVH_SAMPLE, sizeof *points);
	assert_int_equal(wh_bvh_build(&t->ctx, &ex, m, &tree), WH_OK);
	assert_int_equal(wh_bvh_sample(&t->ctx, &tree, points, &n), WH_OK);
	wh_bvh_bounds(&tree, &lo, &hi);
	const wh_frame f = wh_frame_of_points(points, n, lo, hi);
	wh_free(&t->ctx, points);
	assert_int_equal(wh_bvh_finish(&t->ctx, &tree, &f), WH_OK);
	if (open)
		assert_int_equal(wh_bvh_open_all(&t->ctx, &ex, &tree), WH_OK);
	return tree;
}

static double brute_force(const wh_mesh *m, const wh_frame *f, wh_vec3 p)
{
	double least = INFINITY;
	for (uint32_t k = 0; k < m->nf; k++) {
		const uint32_t *v = m->tri + 3 * (size_t)k;
		least = fmin(least, wh_tri_dist2(p, wh_frame_local(f, m->pos[v[0]]),
		                                 wh_frame_local(f, m->pos[v[1]]),
		                                 wh_frame_local(f, m->pos[v[2]])));
	}
	return least;
}

/* Rows of points, some close together and some at random, of which a few are far out. */
static void tree_matches_brute_force(testing_env *t, const wh_mesh *m, int queries)
{
	wh_bvh tree = make_tree(t, m, queries % 2);
	wh_bvh_reader reader;
	wh_rng g = wh_rng_seed(9);
	assert_int_equal(wh_bvh_reader_open(&t->ctx, &reader, &tree, 0, true), WH_OK);
	wh_bvh_face near = {WH_NONE, 0};
	wh_vec3 at = {0, 0, 0};
	for (int i = 0; i < queries; i++) {
		const double spread = i % 37 == 0 ? 1000 : i % 3 == 0 ? 4 : 1;
		at = i / 50 % 2 ? wh_add(at, wh_scale(random_point(&g), 0.01))
		                : wh_scale(random_point(&g), spread);
		const wh_vec3 p = wh_frame_local(&tree.frame, at);
		const double least = brute_force(m, &tree.frame, p);
		double d2;
		if (i % 70 == 0)
			near.page = WH_NONE;
		assert_int_equal(wh_bvh_nearest(&t->ctx, &reader, p, &near, &d2), WH_OK);
		assert_true(fabs(d2 - least) <= 1e-12 * least);
		assert_true(near.page < tree.pages && near.face < tree.entry[near.page].nf);
	}
	wh_bvh_reader_close(&t->ctx, &reader);
	wh_bvh_free(&t->ctx, &tree);
}

static void tree_finds_the_nearest_of_random_triangles(void **state)
{
	(void)state;
	static const uint32_t sizes[] = {1, 2, 7, 8, 9, 63, 64, 65, 512, 513, 5000};
	testing_env t;
	testing_init(&t);
	for (size_t i = 0; i < sizeof sizes / sizeof sizes[0]; i++) {
		for (int k = 0; k < 2; k++) {
			wh_mesh m = random_mesh(&t, sizes[i], k ? 0.02 : 0.7, i);
			tree_matches_brute_force(&t, &m, 200 + k);
			wh_mesh_free(&t.ctx, &m);
		}
	}
	testing_done(&t);
}

static void tree_bears_coincident_triangles(void **state)
{
	(void)state;
	testing_env t;
	testing_init(&t);
	wh_mesh m = random_mesh(&t, 1000, 0.3, 1);
	for (uint32_t i = 3; i < 3 * m.nf; i++)
		m.tri[i] = m.tri[i % 3];
	tree_matches_brute_force(&t, &m, 100);
	wh_mesh_free(&t.ctx, &m);
	testing_done(&t);
}

/* n triangles, one like the other but for a jitter, and n small ones all over the plane above. */
static wh_mesh heap_mesh(testing_env *t, uint32_t n, double size, double jitter)
{
	const wh_vec3 shape[3] = {{0.1, 0.2, 0.5}, {0.9, 0.3, 0.6}, {0.4, 0.8, 0.1}};
	wh_rng g = wh_rng_seed(3);
	wh_mesh m;
	assert_int_equal(wh_mesh_alloc(&t->ctx, &m, 6 * n, 2 * n), WH_OK);
	for (uint32_t i = 0; i < 6 * n; i++) {
		const bool heap = i < 3 * n;
		const wh_vec3 at = random_point(&g), from = i % 3 ? m.pos[i - i % 3] : at;
		m.pos[i] = heap ? wh_add(wh_scale(shape[i % 3], size), wh_scale(at, jitter))
		                : wh_v3(from.x + 0.01 * at.x, from.y + 0.01 * at.y, 0.8);
		m.tri[i] = i;
	}
	return m;
}

/* Queries at random and at the vertices look at no more than `most` faces each, and are off by no
 * more than `slack`. */
static void few_faces_are_tried(testing_env *t, const wh_mesh *m, uint64_t most, double slack)
{
	enum { QUERIES = 200 };
	wh_bvh tree = make_tree(t, m, true);
	wh_bvh_reader reader;
	wh_rng g = wh_rng_seed(4);
	wh_bvh_face near = {WH_NONE, 0};
	assert_int_equal(wh_bvh_reader_open(&t->ctx, &reader, &tree, 0, true), WH_OK);
	for (uint32_t i = 0; i < QUERIES; i++) {
		const wh_vec3 at = i % 2 ? m->pos[i] : random_point(&g);
		const wh_vec3 p = wh_frame_local(&tree.frame, at);
		const double least = sqrt(brute_force(m, &tree.frame, p));
		double d2;
		assert_int_equal(wh_bvh_nearest(&t->ctx, &reader, p, &near, &d2), WH_OK);
		assert_true(fabs(sqrt(d2) - least) <= slack);
	}
	assert_true(reader.tried <= most * QUERIES);
	wh_bvh_reader_close(&t->ctx, &reader);
	wh_bvh_free(&t->ctx, &tree);
}

/* ... in any number of pages, and however they share their corners. */
static void copies_of_a_triangle_are_tried_once(void **state)
{
	(void)state;
	testing_env t;
	testing_init(&t);
	for (double size = 1; size >= 0; size--) { /* of no area, too */
		wh_mesh m = heap_mesh(&t, 5000, size, 0);
		few_faces_are_tried(&t, &m, 10, 1e-12);
		for (uint32_t i = 0; i < 9000; i++)
			m.tri[i] = (i + i / 3) % 3;
		few_faces_are_tried(&t, &m, 10, 1e-12);
		wh_mesh_free(&t.ctx, &m);
	}
	testing_done(&t);
}

static void a_heap_that_floats_take_for_a_point_is_left_early(void **state)
{
	(void)state;
	testing_env t;
	testing_init(&t);
	wh_mesh m = heap_mesh(&t, 5000, 1e-10, 1e-10);
	few_faces_are_tried(&t, &m, 300, 0x1p-18);
	wh_mesh_free(&t.ctx, &m);
	testing_done(&t);
}

/* Every face once, in pages whose boxes hold it; every referenced vertex is some page's own, once.
 */
static void tree_keeps_all_faces(void **state)
{
	(void)state;
	testing_env t;
	testing_init(&t);
	wh_mesh m = random_mesh(&t, 5000, 0.1, 4);
	wh_bvh tree = make_tree(&t, &m, false);
	wh_bvh_reader reader;
	uint32_t faces = 0, own = 0;
	double sum[2] = {0, 0};
	assert_int_equal(wh_bvh_reader_open(&t.ctx, &reader, &tree, 0, true), WH_OK);
	for (uint32_t i = 0; i < 3 * m.nf; i++)
		sum[0] += wh_frame_local(&tree.frame, m.pos[m.tri[i]]).x;
	for (uint32_t i = 0; i < tree.pages; i++) {
		const wh_page *g = wh_bvh_page(&t.ctx, &reader, i);
		assert_non_null(g);
		for (uint32_t k = 0; k < 3 * g->nf; k++) {
			const wh_vec3 p = g->pos[g->tri[k]];
			sum[1] += p.x;
			assert_true((double)tree.nodes[i / WH_BOXES].lo[1][i % WH_BOXES] <= p.y);
			assert_true((double)tree.nodes[i / WH_BOXES].hi[1][i % WH_BOXES] >= p.y);
		}
		faces += g->nf;
		own += tree.entry[i].own;
	}
	assert_int_equal(faces, m.nf);
	assert_int_equal(own, 3 * m.nf - 2 * (m.nf / 10));
	assert_int_equal(own, tree.vertices);
	assert_true(fabs(sum[0] - sum[1]) < 1e-9);
	wh_bvh_reader_close(&t.ctx, &reader);
	wh_bvh_free(&t.ctx, &tree);
	wh_mesh_free(&t.ctx, &m);
	testing_done(&t);
}

/* ---- surfaces
 * ------------------------------------------------------------------------------------- */

/* n x n squares over 0 .. 1, at height z plus some bumps. */
static wh_mesh make_sheet(testing_env *t, uint32_t n, double z, double bumps)
{
	wh_mesh m;
	assert_int_equal(wh_mesh_alloc(&t->ctx, &m, (n + 1) * (n + 1), 2 * n * n), WH_OK);
	for (uint32_t v = 0; v < m.nv; v++) {
		const double x = v % (n + 1) / (double)n, y = v / (n + 1) / (double)n;
		m.pos[v] = wh_v3(x, y, z + bumps * sin(9 * x) * sin(7 * y));
	}
	uint32_t *tri = m.tri;
	for (uint32_t q = 0; q < n * n; q++) {
		const uint32_t a = q / n * (n + 1) + q % n;
		memcpy(tri, (uint32_t[]){a, a + 1, a + n + 1, a + 1, a + n + 2, a + n + 1}, 24);
		tri += 6;
	}
	return m;
}

static wh_compare compare(testing_env *t, int workers, const wh_mesh *a, const wh_mesh *b,
                          uint64_t samples, uint64_t seed)
{
	const wh_exec ex = {.workers = workers};
	const wh_compare_params params = {.samples = samples, .seed = seed};
	wh_compare r;
	assert_int_equal(wh_compare_meshes(&t->ctx, &ex, a, b, &params, &r), WH_OK);
	return r;
}

static void near(double x, double want, double tolerance)
{
	if (!(fabs(x - want) <= tolerance))
		print_message("%.17g is not %.17g\n", x, want);
	assert_true(fabs(x - want) <= tolerance);
}

static void shifted_plane_is_as_far_as_the_shift(void **state)
{
	(void)state;
	testing_env t;
	testing_init(&t);
	wh_mesh a = make_sheet(&t, 20, 5, 0), b = make_sheet(&t, 3, 5.25, 0);
	const wh_compare r = compare(&t, 1, &a, &b, 20000, 0);
	const wh_distance *const all[] = {&r.a_to_b, &r.b_to_a, &r.both};
	for (int i = 0; i < 3; i++) {
		near(all[i]->mean, 0.25, 1e-15);
		near(all[i]->rms, 0.25, 1e-15);
		near(all[i]->max, 0.25, 1e-15);
		near(all[i]->p50, 0.25, 0.0025);
		near(all[i]->p99, 0.25, 0.0025);
	}
	near(r.diagonal, sqrt(2), 1e-15);
	assert_int_equal(r.a_to_b.samples, 20000);
	assert_int_equal(r.both.samples, 40000);
	assert_int_equal(r.a_to_b.vertices, 441);
	wh_mesh_free(&t.ctx, &b);
	wh_mesh_free(&t.ctx, &a);
	testing_done(&t);
}

static void identical_meshes_are_at_distance_zero(void **state)
{
	(void)state;
	testing_env t;
	testing_init(&t);
	wh_mesh a = make_sheet(&t, 50, 0, 0.1);
	const wh_compare r = compare(&t, 2, &a, &a, 50000, 3);
	near(r.both.rms, 0, 1e-16);
	near(r.both.max, 0, 1e-15);
	wh_mesh_free(&t.ctx, &a);
	testing_done(&t);
}

/* A small square against the middle of a large one: near from one side, far from the other. */
static void sides_differ_when_one_covers_more(void **state)
{
	(void)state;
	testing_env t;
	testing_init(&t);
	wh_mesh a = make_sheet(&t, 10, 0, 0), b = make_sheet(&t, 10, 0, 0);
	for (uint32_t v = 0; v < b.nv; v++)
		b.pos[v] = wh_v3(0.25 + b.pos[v].x / 2, 0.25 + b.pos[v].y / 2, 0);
	const wh_compare r = compare(&t, 2, &a, &b, 100000, 0);
	near(r.b_to_a.max, 0, 1e-15);
	near(r.a_to_b.max, sqrt(2) / 4, 1e-15);
	/* by integration: strips of 1/4 x 1/2 (mean square 1/48), corners of 1/4 x 1/4 (1/24) */
	near(r.a_to_b.rms, sqrt(0.5 / 48 + 0.25 / 24), 1e-4);
	near(r.both.rms, r.a_to_b.rms / sqrt(2), 1e-15);
	assert_true(r.rms == r.a_to_b.rms);
	wh_mesh_free(&t.ctx, &b);
	wh_mesh_free(&t.ctx, &a);
	testing_done(&t);
}

static void unused_vertices_do_not_count(void **state)
{
	(void)state;
	testing_env t;
	testing_init(&t);
	wh_mesh a = make_sheet(&t, 4, 0, 0), b = make_sheet(&t, 4, 1, 0);
	a.pos = wh_resize(&t.ctx, a.pos, ++a.nv, sizeof *a.pos);
	a.pos[a.nv - 1] = wh_v3(NAN, 1e30, 7);
	const wh_compare r = compare(&t, 1, &a, &b, 1000, 0);
	near(r.both.max, 1, 1e-15);
	near(r.diagonal, sqrt(2), 1e-15);
	assert_int_equal(r.a_to_b.vertices, 25);
	wh_mesh_free(&t.ctx, &b);
	wh_mesh_free(&t.ctx, &a);
	testing_done(&t);
}

/* Far from the origin, in other units: the same figures, scaled, up to the rounding of the
 * positions themselves (4e-6 of the sheet). */
static void distance_bears_offsets_and_units(void **state)
{
	(void)state;
	testing_env t;
	testing_init(&t);
	wh_mesh a = make_sheet(&t, 32, 0, 0.1), b = make_sheet(&t, 8, 0, 0.1);
	const wh_compare near_by = compare(&t, 1, &a, &b, 30000, 0);
	wh_mesh *const both[] = {&a, &b};
	for (int i = 0; i < 2; i++)
		for (uint32_t v = 0; v < both[i]->nv; v++)
			both[i]->pos[v] =
			    wh_add(wh_scale(both[i]->pos[v], 0x1p-30), wh_v3(0.5, 16, -3));
	const wh_compare far_off = compare(&t, 1, &a, &b, 30000, 0);
	near(far_off.both.rms * 0x1p30, near_by.both.rms, 1e-5);
	near(far_off.both.max * 0x1p30, near_by.both.max, 1e-5);
	wh_mesh_free(&t.ctx, &b);
	wh_mesh_free(&t.ctx, &a);
	testing_done(&t);
}

static void threads_leave_no_trace(void **state)
{
	(void)state;
	testing_env t;
	testing_init(&t);
	wh_mesh a = make_sheet(&t, 90, 0, 0.1), b = make_sheet(&t, 41, 0, 0.1);
	const wh_compare one = compare(&t, 1, &a, &b, 70000, 11);
	for (int workers = 2; workers < 5; workers++) {
		const wh_compare more = compare(&t, workers, &a, &b, 70000, 11);
		assert_memory_equal(&one, &more, sizeof one);
	}
	const wh_compare other = compare(&t, 1, &a, &b, 70000, 12);
	assert_true(other.both.rms != one.both.rms);
	near(other.both.rms, one.both.rms, 0.01 * one.both.rms);
	wh_mesh_free(&t.ctx, &b);
	wh_mesh_free(&t.ctx, &a);
	testing_done(&t);
}

/* Pages that come and go leave none either: here each worker has room for two of 50. */
static void memory_leaves_no_trace(void **state)
{
	(void)state;
	testing_env t;
	testing_init(&t);
	const wh_exec ex = {.workers = 2};
	wh_mesh a = make_sheet(&t, 120, 0, 0.1), b = make_sheet(&t, 115, 0, 0.1);
	wh_compare_params p = {.samples = 20000};
	wh_compare all, little;
	assert_int_equal(wh_compare_meshes(&t.ctx, &ex, &a, &b, &p, &all), WH_OK);
	p.memory = 2 << 20;
	assert_int_equal(wh_compare_meshes(&t.ctx, &ex, &a, &b, &p, &little), WH_OK);
	assert_memory_equal(&all, &little, sizeof all);
	p.memory = 256 << 10;
	assert_int_equal(wh_compare_meshes(&t.ctx, &ex, &a, &b, &p, &little), WH_E_PLAN);
	assert_non_null(strstr(t.ctx.err.text, "--memory"));
	t.ctx.err.code = WH_OK;
	wh_mesh_free(&t.ctx, &b);
	wh_mesh_free(&t.ctx, &a);
	testing_done(&t);
}

/* A vertex at 1e30: its faces are found to be there, all others where they are, and soon. */
static void a_stray_vertex_spoils_nothing(void **state)
{
	(void)state;
	testing_env t;
	testing_init(&t);
	wh_mesh a = make_sheet(&t, 100, 0, 0), b = make_sheet(&t, 50, 0.25, 0);
	b.pos[1000] = wh_v3(1e30, 0, 0.25);
	const wh_compare r = compare(&t, 2, &a, &b, 50000, 0);
	near(r.a_to_b.mean, 0.25, 1e-9);
	near(r.a_to_b.max, 0.25, 1e-9);
	near(r.b_to_a.max / 1e30, 1, 1e-9);
	wh_mesh_free(&t.ctx, &b);
	wh_mesh_free(&t.ctx, &a);
	testing_done(&t);
}

/* All samples are in it, those of the largest distance in the last bin; bins are a quarter of an
 * octave. */
static void the_histogram_ends_at_the_maximum(void **state)
{
	(void)state;
	testing_env t;
	testing_init(&t);
	wh_mesh a = make_sheet(&t, 30, 0.7, 0.3), b = make_sheet(&t, 31, 0, 0);
	const wh_compare r = compare(&t, 2, &a, &b, 30000, 0);
	const wh_histogram *h = &r.a_to_b.histogram;
	uint64_t sum = 0;
	for (int i = 0; i < WH_HISTOGRAM; i++)
		sum += h->count[i];
	assert_int_equal(sum, 30000);
	assert_true(h->count[WH_HISTOGRAM - 1] > 0);
	assert_true(h->end[WH_HISTOGRAM - 1] == 1.25 || h->end[WH_HISTOGRAM - 1] == 1);
	assert_true(h->end[WH_HISTOGRAM - 5] * 2 == h->end[WH_HISTOGRAM - 1]);
	for (int i = 0; i < WH_HISTOGRAM; i++) /* no distance is below 0.4 */
		assert_true(h->count[i] == 0 || h->end[i] > 0.4);
	wh_mesh_free(&t.ctx, &b);
	wh_mesh_free(&t.ctx, &a);
	testing_done(&t);
}

/* The regions have all faces and samples, and know where the second mesh is farther. */
static void regions_tell_where(void **state)
{
	(void)state;
	testing_env t;
	testing_init(&t);
	wh_mesh a = make_sheet(&t, 64, 0, 0), b = make_sheet(&t, 64, 0, 0);
	for (uint32_t v = 0; v < b.nv; v++)
		b.pos[v].z = b.pos[v].x > 0.5 ? 0.125 * (b.pos[v].x - 0.5) : 0;
	const wh_compare r = compare(&t, 2, &a, &b, 50000, 0);
	uint64_t faces = 0, samples = 0;
	double area = 0, worst = 0, best = 1;
	assert_int_equal(r.regions, 2 * 64 * 64 / 512);
	for (uint32_t i = 0; i < r.regions; i++) {
		const wh_compare_region *g = &r.region[i];
		faces += g->faces;
		samples += g->a_to_b.samples + g->b_to_a.samples;
		area += g->area;
		worst = fmax(worst, g->a_to_b.max);
		best = fmin(best, g->a_to_b.max);
		assert_true(g->hi.x <= 0.5 ? g->a_to_b.max == 0 : g->b_to_a.rms > 0);
	}
	assert_int_equal(faces, a.nf);
	assert_int_equal(samples, 100000);
	near(area, 1, 1e-12);
	near(worst, r.a_to_b.max, 0);
	near(best, 0, 0);
	wh_mesh_free(&t.ctx, &b);
	wh_mesh_free(&t.ctx, &a);
	testing_done(&t);
}

static void surface_without_area_has_vertices_only(void **state)
{
	(void)state;
	testing_env t;
	testing_init(&t);
	wh_mesh a = make_sheet(&t, 1, 0, 0), b = make_sheet(&t, 1, 0, 0);
	for (uint32_t v = 0; v < a.nv; v++)
		a.pos[v] = wh_v3(0.5, 0.5, 2);
	const wh_compare r = compare(&t, 1, &a, &b, 1000, 0);
	assert_int_equal(r.a_to_b.samples, 0);
	near(r.a_to_b.max, 2, 1e-15);
	assert_true(r.a_to_b.rms == 0 && r.diagonal == 0);
	wh_mesh_free(&t.ctx, &b);
	wh_mesh_free(&t.ctx, &a);
	testing_done(&t);
}

/* A roof of slope 3/4 over a plane: a right triangle of sides 3, 4, 5 everywhere. */
static void normals_deviate_by_the_slope(void **state)
{
	(void)state;
	testing_env t;
	testing_init(&t);
	wh_mesh a = make_sheet(&t, 10, 0, 0), b = make_sheet(&t, 20, 0, 0);
	for (uint32_t v = 0; v < b.nv; v++)
		b.pos[v].z = 0.75 * (0.5 - fabs(b.pos[v].x - 0.5));
	const double slope = atan2(3, 4) * 180 / acos(-1);
	wh_compare r = compare(&t, 2, &a, &b, 20000, 0);
	near(r.b_to_a.normal_mean, slope, 1e-10);
	near(r.a_to_b.normal_mean, slope, 1e-10);
	near(r.a_to_b.normal_rms, slope, 1e-10);
	near(r.both.normal_rms, slope, 1e-10);
	near(r.normal_rms, slope, 1e-10);
	assert_int_equal(r.both.normals, 40000);
	for (size_t f = 0; f < a.nf; f++) { /* turned over */
		const uint32_t first = a.tri[3 * f];
		a.tri[3 * f] = a.tri[3 * f + 1];
		a.tri[3 * f + 1] = first;
	}
	r = compare(&t, 2, &a, &b, 20000, 0);
	near(r.a_to_b.normal_mean, 180 - slope, 1e-10);
	r = compare(&t, 2, &a, &a, 20000, 0);
	near(r.both.normal_rms, 0, 1e-10);
	wh_mesh_free(&t.ctx, &b);
	wh_mesh_free(&t.ctx, &a);
	testing_done(&t);
}

/* A face that is but a point, close to the sheet, is nearest to all of it, and has no normal. */
static void degenerate_faces_have_no_normal(void **state)
{
	(void)state;
	testing_env t;
	testing_init(&t);
	wh_mesh a = make_sheet(&t, 4, 0, 0), b = make_sheet(&t, 2, 9, 0);
	b.pos[8] = wh_v3(0.5, 0.5, 0.125); /* the last corner, of the last face alone */
	memcpy(b.tri + 3 * (size_t)(b.nf - 1), (uint32_t[]){8, 8, 8}, 12);
	const wh_compare r = compare(&t, 1, &a, &b, 1000, 0);
	assert_int_equal(r.a_to_b.normals, 0);
	assert_true(r.a_to_b.normal_rms == 0);
	assert_int_equal(r.b_to_a.normals, 1000);
	wh_mesh_free(&t.ctx, &b);
	wh_mesh_free(&t.ctx, &a);
	testing_done(&t);
}

/* ---- the band along cuts ------------------------------------------------------------------ */

enum { CUTS = 200 };

/* A row of points over the middle of column 10 of a sheet with 20. */
static void cut_down_the_middle(wh_vec3 cuts[CUTS])
{
	for (int i = 0; i < CUTS; i++)
		cuts[i] = wh_v3(0.525, (i + 0.5) / CUTS, 0.001);
}

static wh_compare compare_cut(testing_env *t, int workers, const wh_mesh *a, const wh_mesh *b,
                              uint64_t ncuts)
{
	const wh_exec ex = {.workers = workers};
	wh_vec3 cuts[CUTS];
	const wh_compare_params params = {.samples = 50000, .cuts = cuts, .ncuts = ncuts};
	wh_compare r;
	cut_down_the_middle(cuts);
	assert_int_equal(wh_compare_meshes(&t->ctx, &ex, a, b, &params, &r), WH_OK);
	return r;
}

/* The points lie in column 10, so the band is columns 7 to 13. There a is twice as far away. */
static void the_band_is_three_faces_wide_on_either_side(void **state)
{
	(void)state;
	testing_env t;
	testing_init(&t);
	wh_mesh a = make_sheet(&t, 400, 0, 0), b = make_sheet(&t, 20, 0, 0);
	for (uint32_t v = 0; v < a.nv; v++)
		a.pos[v].z = fabs(a.pos[v].x - 0.525) < 0.1751 ? 0.002 : 0.001;
	const wh_compare r = compare_cut(&t, 2, &a, &b, CUTS);
	assert_int_equal(r.band.faces, 7 * 40);
	assert_int_equal(r.interior.faces, 13 * 40);
	near(r.band.area, 7.0 / 20, 1e-12);
	near(r.interior.area, 13.0 / 20, 1e-12);
	assert_int_equal(r.band.samples + r.interior.samples, 100000);
	near(r.band.rms, 0.002, 1e-5);
	near(r.interior.rms, 0.001, 1e-5);
	near(wh_compare_rms_ratio(&r), 2, 0.02);
	near(wh_compare_density_ratio(&r), 1, 1e-12);
	const wh_compare one = compare_cut(&t, 1, &a, &b, CUTS);
	const wh_compare three = compare_cut(&t, 3, &a, &b, CUTS);
	assert_memory_equal(&one, &three, sizeof one);
	wh_mesh_free(&t.ctx, &b);
	wh_mesh_free(&t.ctx, &a);
	testing_done(&t);
}

static void a_sheet_finer_along_the_cuts_is_denser_there(void **state)
{
	(void)state;
	testing_env t;
	testing_init(&t);
	wh_mesh a = make_sheet(&t, 20, 0, 0), b = make_sheet(&t, 20, 0, 0);
	for (uint32_t v = 0; v < b.nv; v++) /* columns 7 to 13, of 7/20, become 1/10 wide */
		if (b.pos[v].x > 0.34 && b.pos[v].x < 0.71)
			b.pos[v].x = 0.525 + (b.pos[v].x - 0.525) / 3.5;
	const wh_compare r = compare_cut(&t, 1, &a, &b, CUTS);
	assert_int_equal(r.band.faces, 7 * 40);
	near(wh_compare_density_ratio(&r), (7 / 0.1) / (13 / 0.9), 1e-9);
	wh_mesh_free(&t.ctx, &b);
	wh_mesh_free(&t.ctx, &a);
	testing_done(&t);
}

static void without_cuts_all_is_interior(void **state)
{
	(void)state;
	testing_env t;
	testing_init(&t);
	wh_mesh a = make_sheet(&t, 20, 0, 0), b = make_sheet(&t, 20, 0.5, 0);
	wh_compare r = compare_cut(&t, 1, &a, &b, 0);
	assert_int_equal(r.band.faces, 0);
	assert_int_equal(r.interior.faces, 800);
	near(r.interior.rms, 0.5, 1e-12);
	assert_true(isnan(wh_compare_rms_ratio(&r)) && isnan(wh_compare_density_ratio(&r)));
	r = compare(&t, 1, &a, &b, 1000, 0);
	assert_int_equal(r.interior.faces, 0);
	wh_mesh_free(&t.ctx, &b);
	wh_mesh_free(&t.ctx, &a);
	testing_done(&t);
}

static void nothing_to_compare_is_refused(void **state)
{
	(void)state;
	testing_env t;
	testing_init(&t);
	const wh_exec ex = {.workers = 1};
	const wh_compare_params params = {0};
	wh_compare r;
	wh_mesh a = make_sheet(&t, 2, 0, 0);
	const wh_mesh none = {0};
	assert_int_equal(wh_compare_meshes(&t.ctx, &ex, &a, &none, &params, &r), WH_E_INPUT);
	t.ctx.err = (wh_error){0};
	a.pos[4].y = INFINITY;
	assert_int_equal(wh_compare_meshes(&t.ctx, &ex, &a, &a, &params, &r), WH_E_INPUT);
	assert_non_null(strstr(t.ctx.err.text, "vertex 4"));
	wh_mesh_free(&t.ctx, &a);
	testing_done(&t);
}

static void refused_memory_leaks_nothing(void **state)
{
	(void)state;
	testing_env t;
	testing_init(&t);
	wh_mesh a = make_sheet(&t, 3, 0, 0);
	const size_t before = t.mem.used;
	const wh_exec ex = {.workers = 1};
	const wh_vec3 cut = {0.5, 0.5, 0};
	const wh_compare_params params = {.samples = 10, .cuts = &cut, .ncuts = 1};
	wh_code code = WH_E_RUN;
	long fail = 1;
	for (; code != WH_OK; fail++) {
		wh_compare r;
		t.ctx.err = (wh_error){0};
		t.mem.fail_after = fail;
		code = wh_compare_meshes(&t.ctx, &ex, &a, &a, &params, &r);
		assert_true(code == WH_OK || code == WH_E_RUN);
		assert_int_equal((size_t)t.mem.used, before);
	}
	assert_true(fail > 12);
	wh_mesh_free(&t.ctx, &a);
	testing_done(&t);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	    cmocka_unit_test(nearest_point_is_found_in_every_region),
	    cmocka_unit_test(degenerate_triangles_are_segments_and_points),
	    cmocka_unit_test(distance_matches_a_dense_search),
	    cmocka_unit_test(tree_finds_the_nearest_of_random_triangles),
	    cmocka_unit_test(tree_bears_coincident_triangles),
	    cmocka_unit_test(copies_of_a_triangle_are_tried_once),
	    cmocka_unit_test(a_heap_that_floats_take_for_a_point_is_left_early),
	    cmocka_unit_test(tree_keeps_all_faces),
	    cmocka_unit_test(shifted_plane_is_as_far_as_the_shift),
	    cmocka_unit_test(identical_meshes_are_at_distance_zero),
	    cmocka_unit_test(sides_differ_when_one_covers_more),
	    cmocka_unit_test(unused_vertices_do_not_count),
	    cmocka_unit_test(distance_bears_offsets_and_units),
	    cmocka_unit_test(threads_leave_no_trace),
	    cmocka_unit_test(memory_leaves_no_trace),
	    cmocka_unit_test(a_stray_vertex_spoils_nothing),
	    cmocka_unit_test(the_histogram_ends_at_the_maximum),
	    cmocka_unit_test(regions_tell_where),
	    cmocka_unit_test(surface_without_area_has_vertices_only),
	    cmocka_unit_test(normals_deviate_by_the_slope),
	    cmocka_unit_test(degenerate_faces_have_no_normal),
	    cmocka_unit_test(the_band_is_three_faces_wide_on_either_side),
	    cmocka_unit_test(a_sheet_finer_along_the_cuts_is_denser_there),
	    cmocka_unit_test(without_cuts_all_is_interior),
	    cmocka_unit_test(nothing_to_compare_is_refused),
	    cmocka_unit_test(refused_memory_leaks_nothing),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
