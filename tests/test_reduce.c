/*
 * wh_reduce from file to file: counts, topology, bytes, limits, quality. How it ends when
 * something goes wrong is in test_stop.c.
 */
#define _XOPEN_SOURCE 700
#include "reduce_files.h"

#include "algo/compare.h"
#include "mesh/check.h"
#include "pipeline/normalise.h"

#include <math.h>

static void reduces(fixture *f)
{
	const wh_code code = reduce(f);
	if (code != WH_OK)
		fail_msg("%s", f->t.ctx.err.text);
	assert_int_equal(entries(f->temp), 0);
	assert_int_equal(entries(f->out_dir), 1);
	assert_true(f->report.memory_peak <= f->params.memory);
	uint64_t most = 0; /* of any phase: what is held between them is little */
	for (int i = 0; i < WH_PHASES; i++)
		most =
		    f->report.phase[i].memory_peak > most ? f->report.phase[i].memory_peak : most;
	assert_in_range(most, f->report.memory_peak / 10 * 9, f->report.memory_peak);
}

static wh_mesh load(fixture *f, const char *path)
{
	const wh_exec ex = {.workers = 1};
	wh_ctx *c = &f->t.ctx;
	wh_spill spill;
	wh_mesh m;
	assert_int_equal(wh_spill_open(c, &spill, f->root, NULL), WH_OK);
	assert_int_equal(wh_load_mesh(c, &ex, &spill, path, WH_FORMAT_ANY, &m, NULL, NULL), WH_OK);
	wh_spill_close(c, &spill);
	return m;
}

static wh_check check(fixture *f, const char *path)
{
	wh_check r;
	wh_mesh m = load(f, path);
	assert_int_equal(wh_check_mesh(&f->t.ctx, &m, &r), WH_OK);
	wh_mesh_free(&f->t.ctx, &m);
	return r;
}

/* The output is clean, its counts are the report's, and its topology is the input's. */
static void same_topology(fixture *f)
{
	const wh_check a = check(f, f->in), b = check(f, f->out);
	assert_true(wh_check_clean(&b));
	assert_int_equal(b.unreferenced_vertices, 0);
	assert_int_equal(a.components, b.components);
	assert_int_equal(a.boundary_loops, b.boundary_loops);
	assert_int_equal(a.euler, b.euler);
	assert_int_equal(a.genus, b.genus);
	assert_int_equal(b.faces, f->report.output_faces);
	assert_int_equal(b.vertices, f->report.output_vertices);
	assert_int_equal(b.boundary_edges, f->report.boundary_edges);
	assert_int_equal(b.boundary_loops, f->report.boundary_loops);
	assert_int_equal(b.components, f->report.components);
	assert_int_equal(b.euler, f->report.euler);
	assert_int_equal(f->report.nonmanifold_edges, 0);
}

static wh_compare compare(fixture *f, uint64_t samples)
{
	const wh_exec ex = {.workers = 2};
	const wh_compare_params p = {.samples = samples};
	wh_compare r;
	wh_mesh a = load(f, f->in), b = load(f, f->out);
	assert_int_equal(wh_compare_meshes(&f->t.ctx, &ex, &a, &b, &p, &r), WH_OK);
	wh_mesh_free(&f->t.ctx, &a);
	wh_mesh_free(&f->t.ctx, &b);
	return r;
}

/* ---- counts and topology ---- */

static void every_shape_keeps_its_topology_at_the_exact_count(void **state)
{
	(void)state;
	for (wh_synth_kind kind = WH_SYNTH_SPHERE; kind <= WH_SYNTH_TERRAIN; kind++)
		for (int shuffled = 0; shuffled <= 1; shuffled++) {
			fixture f;
			wh_synth_params p = surface(kind, 60000);
			p.shuffled = shuffled;
			make(&f, &p);
			f.params.faces = 2000;
			reduces(&f);
			assert_int_equal(f.report.output_faces, 2000);
			assert_true(f.report.rounds >= 2);
			assert_true(f.report.clusters >= 2);
			same_topology(&f);
			drop(&f);
		}
}

/* A closed surface has an even number of faces. */
static void odd_targets_are_reached_where_there_is_a_boundary(void **state)
{
	(void)state;
	for (wh_synth_kind kind = WH_SYNTH_SPHERE; kind <= WH_SYNTH_TERRAIN; kind++) {
		fixture f;
		const wh_synth_params p = surface(kind, 20000);
		const bool open = kind == WH_SYNTH_TERRAIN;
		make(&f, &p);
		f.params.faces = 1501;
		reduces(&f);
		assert_int_equal(f.report.output_faces, open ? 1501 : 1500);
		assert_int_equal(f.report.one_less, !open);
		drop(&f);
	}
}

static void counts_are_exact_at_any_share(void **state)
{
	(void)state;
	fixture f;
	const wh_synth_params p = surface(WH_SYNTH_TERRAIN, 30000);
	make(&f, &p);
	const uint64_t all = check(&f, f.in).faces;
	for (uint64_t faces = 300; faces < all; faces = faces * 5 / 2) {
		f.params.faces = faces;
		reduces(&f);
		assert_int_equal(f.report.output_faces, faces);
	}
	f.params.faces = all - 1;
	reduces(&f);
	assert_int_equal(f.report.output_faces, all - 1);
	same_topology(&f);
	drop(&f);
}

static void vertex_targets_are_exact(void **state)
{
	(void)state;
	fixture f;
	const wh_synth_params p = surface(WH_SYNTH_TORUS, 30000);
	make(&f, &p);
	f.params.vertices = 1234;
	reduces(&f);
	assert_int_equal(f.report.output_vertices, 1234);
	assert_int_equal(f.report.output_faces, 2468);
	same_topology(&f);
	drop(&f);
}

static void shares_are_of_the_input(void **state)
{
	(void)state;
	fixture f;
	const wh_synth_params p = surface(WH_SYNTH_TERRAIN, 30000);
	make(&f, &p);
	f.params.face_ratio = 0.1;
	reduces(&f);
	assert_int_equal(f.report.output_faces, (f.report.input_faces + 5) / 10);
	f.params.face_ratio = 0;
	f.params.vertex_ratio = 0.1;
	reduces(&f);
	assert_int_equal(f.report.output_vertices, (f.report.input_vertices + 5) / 10);
	drop(&f);
}

/* Of several limits the one reached first stops: the most faces of what each alone would give. */
static void the_first_limit_reached_stops(void **state)
{
	(void)state;
	fixture f;
	const wh_synth_params p = surface(WH_SYNTH_TERRAIN, 20000);
	make(&f, &p);
	f.params.faces = 500;
	f.params.vertices = 2000;
	reduces(&f);
	assert_int_equal(f.report.output_vertices, 2000);
	f.params.faces = 6000;
	reduces(&f);
	assert_int_equal(f.report.output_faces, 6000);
	f.params.error = 1e-6; /* nothing may move */
	reduces(&f);
	assert_true(f.report.output_faces > 15000);
	drop(&f);
}

static void a_target_above_the_count_copies_the_bytes(void **state)
{
	(void)state;
	fixture f;
	wh_synth_params p = surface(WH_SYNTH_SPHERE, 20000);
	p.colors = true; /* that a rewritten file would not have */
	make(&f, &p);
	f.params.faces = 1000000;
	reduces(&f);
	assert_true(f.report.unchanged);
	char cmd[256];
	(void)snprintf(cmd, sizeof cmd, "cmp -s %s %s", f.in, f.out);
	assert_int_equal(system(cmd), 0);
	drop(&f);
}

static void an_unreachable_target_gives_the_best_mesh(void **state)
{
	(void)state;
	fixture f;
	const wh_synth_params p = surface(WH_SYNTH_TORUS, 20000);
	make(&f, &p);
	f.params.faces = 8; /* a torus needs 14 */
	assert_int_equal(reduce(&f), WH_E_TARGET);
	assert_true(f.report.exhausted);
	assert_true(f.report.output_faces >= 14 && f.report.output_faces < 300);
	f.t.ctx.err = (wh_error){0};
	same_topology(&f);
	assert_int_equal(entries(f.temp), 0);
	drop(&f);
}

/* All vertices in one place: empty clusters, nothing to tell faces apart by. */
static void coincident_vertices_are_survived(void **state)
{
	(void)state;
	enum { SIDE = 16 };
	fixture f;
	open_fixture(&f);
	FILE *o = fopen(f.in, "w");
	assert_non_null(o);
	(void)fprintf(o,
	              "ply\nformat ascii 1.0\nelement vertex %d\nproperty float x\nproperty float "
	              "y\nproperty float z\nelement face %d\nproperty list uchar int "
	              "vertex_indices\nend_header\n",
	              (SIDE + 1) * (SIDE + 1), 2 * SIDE * SIDE);
	for (int i = 0; i < (SIDE + 1) * (SIDE + 1); i++)
		(void)fprintf(o, "1 2 3\n");
	for (int y = 0; y < SIDE; y++)
		for (int x = 0; x < SIDE; x++) {
			const int a = y * (SIDE + 1) + x, d = a + SIDE + 2;
			(void)fprintf(o, "3 %d %d %d\n3 %d %d %d\n", a, a + 1, d, a, d, d - 1);
		}
	assert_int_equal(fclose(o), 0);
	f.params.cluster_faces = 50;
	f.params.micro_faces = 20;
	f.params.final_faces = 50;
	f.params.faces = 100;
	reduces(&f);
	assert_true(f.report.output_faces == 100 || f.report.output_faces == 99);
	same_topology(&f);
	drop(&f);
}

/* ---- the bytes ---- */

static void threads_and_memory_never_change_the_bytes(void **state)
{
	(void)state;
	static const struct {
		int threads;
		size_t mib;
	} run[] = {{1, 256}, {2, 256}, {3, 256}, {2, 64}, {1, 40}, {5, 400}};
	fixture f;
	const wh_synth_params p = surface(WH_SYNTH_TERRAIN, 100000);
	char first[33] = "";
	make(&f, &p);
	f.params.faces = 3000;
	for (size_t i = 0; i < sizeof run / sizeof *run; i++) {
		f.params.threads = run[i].threads;
		f.params.memory = run[i].mib << 20;
		reduces(&f);
		if (i == 0)
			memcpy(first, f.report.checksum, sizeof first);
		assert_string_equal(f.report.checksum, first);
	}
	drop(&f);
}

static void cluster_sizes_do_change_them(void **state)
{
	(void)state;
	fixture f;
	const wh_synth_params p = surface(WH_SYNTH_SPHERE, 30000);
	make(&f, &p);
	f.params.faces = 3000;
	reduces(&f);
	char first[33];
	memcpy(first, f.report.checksum, sizeof first);
	f.params.cluster_faces = 6000;
	reduces(&f);
	assert_string_not_equal(f.report.checksum, first);
	drop(&f);
}

/* What an offset adds to doubles is taken off before anything is computed. */
static void an_offset_moves_the_result_and_nothing_else(void **state)
{
	(void)state;
	wh_mesh m[2];
	fixture f[2];
	const double at[3] = {4512345.5, -5400000.25, 1048576};
	for (int i = 0; i < 2; i++) {
		wh_synth_params p = surface(WH_SYNTH_TERRAIN, 20000);
		p.is_double = true;
		for (int k = 0; i == 1 && k < 3; k++)
			p.offset[k] = at[k];
		make(&f[i], &p);
		f[i].params.faces = 1500;
		reduces(&f[i]);
		same_topology(&f[i]);
		m[i] = load(&f[i], f[i].out);
	}
	assert_int_equal(m[0].nv, m[1].nv);
	assert_memory_equal(m[0].tri, m[1].tri, 3 * (size_t)m[0].nf * sizeof *m[0].tri);
	double most = 0;
	for (uint32_t v = 0; v < m[0].nv; v++) {
		const wh_vec3 moved = wh_add(m[0].pos[v], wh_v3(at[0], at[1], at[2]));
		most = fmax(most, wh_norm(wh_sub(moved, m[1].pos[v])));
	}
	assert_true(most < 1e-8); /* the last bits of five million */
	for (int i = 0; i < 2; i++) {
		wh_mesh_free(&f[i].t.ctx, &m[i]);
		drop(&f[i]);
	}
}

static void text_holds_the_same_mesh(void **state)
{
	(void)state;
	fixture f;
	const wh_synth_params p = surface(WH_SYNTH_SPHERE, 20000);
	make(&f, &p);
	f.params.faces = 1000;
	reduces(&f);
	wh_mesh a = load(&f, f.out);
	f.params.ascii = true;
	reduces(&f);
	wh_mesh b = load(&f, f.out);
	assert_int_equal(a.nv, b.nv);
	assert_int_equal(a.nf, b.nf);
	assert_memory_equal(a.pos, b.pos, a.nv * sizeof *a.pos);
	assert_memory_equal(a.tri, b.tri, 3 * (size_t)a.nf * sizeof *a.tri);
	wh_mesh_free(&f.t.ctx, &a);
	wh_mesh_free(&f.t.ctx, &b);
	drop(&f);
}

/* ---- the error limit ---- */

/* The limit is of an estimate, taken at the vertices of each step. Measured over whole surfaces
 * the distance goes beyond it, by half at limits of a few sample spacings, where noise rules. */
static void the_surface_stays_near_the_error_limit(void **state)
{
	(void)state;
	for (wh_synth_kind kind = WH_SYNTH_SPHERE; kind <= WH_SYNTH_TERRAIN; kind += 2) {
		fixture f;
		const wh_synth_params p = surface(kind, 30000);
		uint64_t last = UINT64_MAX;
		make(&f, &p);
		for (double limit = 20; limit < 400; limit *= 4) {
			f.params.error = limit;
			reduces(&f);
			assert_true(f.report.output_faces < last);
			last = f.report.output_faces;
			assert_true(f.report.accumulated_error <= limit);
			const wh_compare d = compare(&f, 50000);
			assert_true(fmax(d.a_to_b.max, d.b_to_a.max) <= 1.6 * limit);
			same_topology(&f);
		}
		/* the same limit as a share of the diagonal */
		f.params.error_share = f.params.error / f.report.diagonal;
		f.params.error = 0;
		reduces(&f);
		assert_true(llabs((long long)f.report.output_faces - (long long)last) <= 2);
		drop(&f);
	}
}

/* ---- boundaries ---- */

static int by_place(const void *a, const void *b)
{
	return memcmp(a, b, sizeof(wh_vec3));
}

/* Positions of all vertices on boundary edges, sorted: a vertex on the boundary has one edge out
 * more than in, counted by the sum of signed neighbours. */
static size_t boundary_places(const wh_mesh *m, wh_vec3 **places)
{
	int64_t *sum = calloc(m->nv, sizeof *sum);
	*places = malloc(m->nv * sizeof **places);
	assert_non_null(sum);
	assert_non_null(*places);
	for (size_t i = 0; i < 3 * (size_t)m->nf; i++) {
		const uint32_t a = m->tri[i], b = m->tri[i % 3 == 2 ? i - 2 : i + 1];
		sum[a] += (int64_t)b + 1;
		sum[b] -= (int64_t)a + 1;
	}
	size_t n = 0;
	for (uint32_t v = 0; v < m->nv; v++)
		if (sum[v])
			(*places)[n++] = m->pos[v];
	qsort(*places, n, sizeof **places, by_place);
	free(sum);
	return n;
}

static void a_locked_boundary_stays_to_the_bit(void **state)
{
	(void)state;
	fixture f;
	const wh_synth_params p = surface(WH_SYNTH_TERRAIN, 30000);
	make(&f, &p);
	f.params.lock_boundary = true;
	f.params.faces = 3000;
	reduces(&f);
	assert_int_equal(f.report.output_faces, 3000);
	wh_mesh a = load(&f, f.in), b = load(&f, f.out);
	wh_vec3 *pa, *pb;
	const size_t na = boundary_places(&a, &pa), nb = boundary_places(&b, &pb);
	assert_true(na > 100);
	assert_int_equal(na, nb);
	assert_memory_equal(pa, pb, na * sizeof *pa);
	free(pa);
	free(pb);
	wh_mesh_free(&f.t.ctx, &a);
	wh_mesh_free(&f.t.ctx, &b);
	same_topology(&f);
	drop(&f);
}

/* ---- failures ---- */

static void a_small_ceiling_is_refused_with_one_that_does(void **state)
{
	(void)state;
	fixture f;
	const wh_synth_params p = surface(WH_SYNTH_SPHERE, 100000);
	make(&f, &p);
	f.params.faces = 2000;
	f.params.memory = (size_t)13 << 20;
	int refusals = 0;
	while (reduce(&f) != WH_OK) {
		assert_int_equal(f.t.ctx.err.code, WH_E_PLAN);
		nothing_is_left(&f);
		const char *at = strstr(f.t.ctx.err.text, "--memory ");
		assert_non_null(at);
		const size_t named = (size_t)strtoul(at + strlen("--memory "), NULL, 10) << 20;
		assert_true(named > f.params.memory);
		f.params.memory = named;
		f.t.ctx.err = (wh_error){0};
		assert_true(++refusals < 4);
	}
	assert_int_equal(refusals, 1);
	assert_true(f.report.memory_peak <= f.params.memory);
	drop(&f);
}

static void without_a_target_nothing_is_done(void **state)
{
	(void)state;
	fixture f;
	const wh_synth_params p = surface(WH_SYNTH_SPHERE, 1000);
	make(&f, &p);
	assert_int_equal(reduce(&f), WH_E_USAGE);
	nothing_is_left(&f);
	drop(&f);
}

static void files_have_to_be_named(void **state)
{
	(void)state;
	fixture f;
	const wh_synth_params p = surface(WH_SYNTH_SPHERE, 1000);
	make(&f, &p);
	for (int missing = 0; missing < 2; missing++) {
		wh_reduce_params params = f.params;
		wh_plan_report plan;
		params.faces = 100;
		*(missing ? &params.output : &params.input) = NULL;
		assert_int_equal(wh_reduce(&f.t.ctx, &params, &f.report), WH_E_USAGE);
		assert_int_equal(wh_reduce_mpi(&f.t.ctx, &params, &f.report), WH_E_USAGE);
		assert_int_equal(wh_plan_reduce(&f.t.ctx, &params, &plan),
		                 missing ? WH_OK : WH_E_USAGE);
	}
	nothing_is_left(&f);
	drop(&f);
}

/* ---- what clusters cost ---- */

static double rms_of(fixture *f, uint64_t cluster_faces)
{
	f->params.cluster_faces = cluster_faces;
	f->params.micro_faces = 0;
	f->params.final_faces = 0;
	reduces(f);
	return compare(f, 200000).rms;
}

static void clusters_cost_no_quality_on_a_scan(void **state)
{
	(void)state;
	fixture f;
	static const char scan[] = WHITTLE_DATA "/scans/bun_zipper.ply";
	if (access(scan, R_OK) != 0) {
		print_message("no %s: skipped\n", scan);
		skip();
	}
	open_fixture(&f);
	f.params.input = scan;
	(void)snprintf(f.in, sizeof f.in, "%s/in.ply", f.root);
	assert_int_equal(symlink(scan, f.in), 0);
	static const double share[] = {0.1, 0.01};
	for (int i = 0; i < 2; i++) {
		f.params.face_ratio = share[i];
		const double many = rms_of(&f, 2000);
		assert_true(f.report.clusters >= 32);
		assert_true(f.report.rounds >= 1);
		const double one = rms_of(&f, 0);
		assert_int_equal(f.report.rounds, 0);
		print_message("RMS at %g: %.4g in clusters, %.4g in one queue, ratio %.4f\n",
		              share[i], many, one, many / one);
		assert_true(many <= 1.02 * one);
	}
	drop(&f);
}

/* Faces whose corners all lie within the plateau: |x|^4 + |y|^4 below its radius to the fourth,
 * where the plateau's area, 3.7081 r^2, is the given share of the square. */
static uint64_t faces_on_plateau(fixture *f, double share)
{
	const double side = 30000, r2 = share / 3.7081;
	wh_mesh m = load(f, f->out);
	uint64_t n = 0;
	for (uint32_t i = 0; i < m.nf; i++) {
		bool flat = true;
		for (size_t k = 0; k < 3; k++) {
			const wh_vec3 p = m.pos[m.tri[3 * (size_t)i + k]];
			flat = flat && pow(p.x / side, 4) + pow(p.y / side, 4) < r2 * r2;
		}
		n += flat;
	}
	wh_mesh_free(&f->t.ctx, &m);
	return n;
}

static void clusters_share_faces_by_error_and_not_by_area(void **state)
{
	(void)state;
	static const double flat = 0.4;
	fixture f;
	wh_synth_params p = surface(WH_SYNTH_TERRAIN, 100000);
	p.flat = flat;
	p.noise = 0.1;
	make(&f, &p);
	f.params.faces = 20000;
	uint64_t on_plateau[2];
	for (int i = 0; i < 2; i++) {
		f.params.cluster_faces = i ? 0 : 3000;
		f.params.micro_faces = i ? 0 : 1000;
		reduces(&f);
		on_plateau[i] = faces_on_plateau(&f, flat);
	}
	print_message("on the plateau: %d faces in clusters, %d in one queue\n", (int)on_plateau[0],
	              (int)on_plateau[1]);
	assert_true(on_plateau[1] >= 1000);
	assert_true(fabs((double)on_plateau[0] / (double)on_plateau[1] - 1) < 0.1);
	drop(&f);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	    cmocka_unit_test(every_shape_keeps_its_topology_at_the_exact_count),
	    cmocka_unit_test(odd_targets_are_reached_where_there_is_a_boundary),
	    cmocka_unit_test(counts_are_exact_at_any_share),
	    cmocka_unit_test(vertex_targets_are_exact),
	    cmocka_unit_test(shares_are_of_the_input),
	    cmocka_unit_test(the_first_limit_reached_stops),
	    cmocka_unit_test(a_target_above_the_count_copies_the_bytes),
	    cmocka_unit_test(an_unreachable_target_gives_the_best_mesh),
	    cmocka_unit_test(coincident_vertices_are_survived),
	    cmocka_unit_test(threads_and_memory_never_change_the_bytes),
	    cmocka_unit_test(cluster_sizes_do_change_them),
	    cmocka_unit_test(an_offset_moves_the_result_and_nothing_else),
	    cmocka_unit_test(text_holds_the_same_mesh),
	    cmocka_unit_test(the_surface_stays_near_the_error_limit),
	    cmocka_unit_test(a_locked_boundary_stays_to_the_bit),
	    cmocka_unit_test(a_small_ceiling_is_refused_with_one_that_does),
	    cmocka_unit_test(without_a_target_nothing_is_done),
	    cmocka_unit_test(files_have_to_be_named),
	    cmocka_unit_test(clusters_cost_no_quality_on_a_scan),
	    cmocka_unit_test(clusters_share_faces_by_error_and_not_by_area),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
