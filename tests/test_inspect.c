/* A file checked in clusters has the figures it has in memory. */
#define _POSIX_C_SOURCE 200809L
#include "ply_files.h"

#include "base/rng.h"
#include "mesh/coincident.h"
#include "pipeline/duplicates.h"
#include "pipeline/inspect.h"

static wh_check inspect(const char *path, size_t memory, uint64_t cluster_faces, int workers)
{
	testing_env t;
	testing_init(&t);
	const wh_exec ex = {.workers = workers};
	const wh_inspect_params p = {
	    .path = path, .temp_dir = "/tmp", .memory = memory, .cluster_faces = cluster_faces};
	wh_check r;
	const wh_code code = wh_inspect_file(&t.ctx, &ex, &p, &r, NULL);
	if (code != WH_OK)
		print_message("%s\n", t.ctx.err.text);
	assert_int_equal(code, WH_OK);
	testing_done(&t);
	return r;
}

/* In memory, and in clusters of about so many faces, by one thread and by three. */
static wh_check inspect_all_ways(const char *path, uint64_t cluster_faces)
{
	const wh_check whole = inspect(path, 0, 0, 2);
	const wh_check one = inspect(path, 0, cluster_faces, 1);
	const wh_check three = inspect(path, (size_t)64 << 20, cluster_faces, 3);
	assert_memory_equal(&whole, &one, sizeof whole);
	assert_memory_equal(&whole, &three, sizeof whole);
	return whole;
}

static void scans_in_clusters_have_the_same_figures(void **state)
{
	(void)state;
	static const char *const names[] = {"dragon_vrip_res3.ply", "bun_zipper.ply",
	                                    "meshlab_lato000.ply", "mouse_MRL_MPJ.ply",
	                                    "ankylosaurus_mesh.ply"};
	FILE *f = fopen(WHITTLE_DATA "/MANIFEST.tsv", "r");
	if (!f) {
		print_message("no scans in %s: skipped\n", WHITTLE_DATA);
		skip();
	}
	(void)fclose(f);
	for (size_t i = 0; i < sizeof names / sizeof *names; i++) {
		char path[sizeof WHITTLE_DATA + 64];
		(void)snprintf(path, sizeof path, "%s/scans/%s", WHITTLE_DATA, names[i]);
		print_message("%s\n", names[i]);
		(void)inspect_all_ways(path, 5000);
	}
}

enum { SIDE = 60 };

/* A rough square with a hole, as doubles far from zero; two vertices more that no face has, one
 * of them where another is; a degenerate face. */
static void write_far_square(ply_file *p)
{
	char elements[256];
	(void)snprintf(elements, sizeof elements,
	               "element vertex %d\nproperty double x\nproperty double y\n"
	               "property double z\nelement face %d\n"
	               "property list uchar int vertex_indices\n",
	               SIDE * SIDE + 2, 2 * (SIDE - 1) * (SIDE - 1) - 1);
	ply_header(p, elements);
	for (int i = 0; i < SIDE * SIDE + 2; i++) {
		const int k = i < SIDE * SIDE ? i : 17; /* the last two: one high up, one at 17 */
		const double z = i == SIDE * SIDE ? 1e7 : (double)(k * k % 41) / 7;
		ply_value(p, WH_F64, 4e6 + (k % SIDE) / 3.0);
		ply_value(p, WH_F64, -3e5 + (double)(k / SIDE) / 9);
		ply_value(p, WH_F64, z);
		ply_item(p);
	}
	for (int f = 1; f < 2 * (SIDE - 1) * (SIDE - 1); f++) {
		const int q = f / 2, a = q / (SIDE - 1) * SIDE + q % (SIDE - 1);
		const int b = f == 2000 ? a : a + 1;
		ply_value(p, WH_U8, 3);
		ply_value(p, WH_I32, a);
		ply_value(p, WH_I32, f % 2 ? a + SIDE + 1 : b);
		ply_value(p, WH_I32, f % 2 ? a + SIDE : a + SIDE + 1);
		ply_item(p);
	}
}

static void doubles_far_from_zero_have_the_same_figures(void **state)
{
	(void)state;
	for (int format = WH_PLY_ASCII; format <= WH_PLY_BE; format++) {
		ply_file p = ply_begin((wh_ply_format)format);
		write_far_square(&p);
		ply_end(&p);
		const wh_check r = inspect_all_ways(p.path, 300);
		assert_int_equal(r.vertices, SIDE * SIDE + 2);
		assert_int_equal(r.unreferenced_vertices, 2);
		assert_int_equal(r.duplicate_vertices, 1);
		assert_int_equal(r.degenerate_faces, 1);
		assert_int_equal(r.faces, 2 * (SIDE - 1) * (SIDE - 1) - 1);
		assert_int_equal(r.boundary_loops, 2);
		assert_int_equal(r.components, 1);
		assert_true(r.lo.x == 4e6 && r.lo.y == -3e5 && r.lo.z == 0);
		(void)unlink(p.path);
	}
}

/* ---- coincident vertices ------------------------------------------------------------------ */

/* A file of n vertices at the points of a lattice, and one face. */
static void write_points(ply_file *p, uint32_t n, uint32_t side)
{
	char elements[256];
	wh_rng g = wh_rng_seed(side);
	(void)snprintf(elements, sizeof elements,
	               "element vertex %u\nproperty float x\nproperty float y\nproperty float z\n"
	               "element face 1\nproperty list uchar int vertex_indices\n",
	               n);
	ply_header(p, elements);
	for (uint32_t i = 0; i < n; i++)
		for (int k = 0; k < 3; k++)
			ply_value(p, WH_F32, k ? (double)(wh_rng_next(&g) % side) : -0.0);
	ply_value(p, WH_U8, 3);
	for (int k = 0; k < 3; k++)
		ply_value(p, WH_I32, k);
}

/* Counts by a budget for several passes, and all at once. */
static void count_both_ways(uint32_t n, uint32_t side, size_t budget)
{
	testing_env t;
	testing_init(&t);
	const wh_exec ex = {.workers = 2};
	ply_file p = ply_begin(WH_PLY_LE);
	write_points(&p, n, side);
	ply_end(&p);
	wh_spill spill;
	wh_input in;
	wh_mesh m;
	uint64_t few, all;
	wh_progress progress = {.telling = ATOMIC_FLAG_INIT};
	assert_int_equal(wh_spill_open(&t.ctx, &spill, "/tmp", NULL), WH_OK);
	assert_int_equal(wh_input_open(&t.ctx, &ex, &spill, p.path, WH_FORMAT_ANY, &in), WH_OK);
	assert_int_equal(wh_source_mesh(&t.ctx, &ex, &in.source, &m), WH_OK);
	assert_int_equal(wh_coincident_count(&t.ctx, m.pos, m.nv, NULL, &all), WH_OK);
	wh_mesh_free(&t.ctx, &m);
	t.mem.limit = (size_t)t.mem.used + budget + 100000;
	assert_int_equal(wh_duplicate_vertices(&t.ctx, &ex, &progress, &in.source, budget, &few),
	                 WH_OK);
	t.mem.limit = 0;
	assert_int_equal(few, all);
	assert_true(all + (uint64_t)side * side >= n);
	wh_input_close(&t.ctx, &spill, &in);
	wh_spill_close(&t.ctx, &spill);
	(void)unlink(p.path);
	testing_done(&t);
}

static void coincident_vertices_are_counted_in_passes(void **state)
{
	(void)state;
	count_both_ways(200000, 1000, (size_t)6 << 20); /* one in ten or so coincides */
	count_both_ways(200000, 300, (size_t)6 << 20);  /* more than half of them do */
}

static void lots_that_fill_up_with_one_position_are_thinned(void **state)
{
	(void)state;
	count_both_ways(200000, 1, (size_t)6 << 20);
	count_both_ways(200000, 2, (size_t)6 << 20);
}

static void a_ceiling_too_low_for_anything_is_refused_in_words(void **state)
{
	(void)state;
	testing_env t;
	testing_init(&t);
	const wh_exec ex = {.workers = 2};
	ply_file p = ply_begin(WH_PLY_LE);
	write_points(&p, 1000, 10);
	ply_end(&p);
	const wh_inspect_params params = {.path = p.path, .temp_dir = "/tmp", .memory = 1 << 20};
	wh_check r;
	assert_int_equal(wh_inspect_file(&t.ctx, &ex, &params, &r, NULL), WH_E_PLAN);
	assert_non_null(strstr(t.ctx.err.text, "use --memory"));
	(void)unlink(p.path);
	testing_done(&t);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	    cmocka_unit_test(scans_in_clusters_have_the_same_figures),
	    cmocka_unit_test(doubles_far_from_zero_have_the_same_figures),
	    cmocka_unit_test(coincident_vertices_are_counted_in_passes),
	    cmocka_unit_test(lots_that_fill_up_with_one_position_are_thinned),
	    cmocka_unit_test(a_ceiling_too_low_for_anything_is_refused_in_words),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
