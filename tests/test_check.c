/* Every invariant of check, on meshes small enough to draw. */
#include "testing.h"

#include "base/rng.h"
#include "mesh/check.h"
#include "pipeline/normalise.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Checks nf triangles over nv positions. */
static wh_check check(uint32_t nv, const double (*xyz)[3], uint32_t nf, const uint32_t (*tri)[3])
{
	testing_env t;
	testing_init(&t);
	wh_mesh m;
	assert_int_equal(wh_mesh_alloc(&t.ctx, &m, nv, nf), WH_OK);
	for (uint32_t v = 0; v < nv; v++)
		m.pos[v] = wh_v3(xyz[v][0], xyz[v][1], xyz[v][2]);
	if (nf > 0)
		memcpy(m.tri, tri, nf * sizeof *tri);
	wh_check r;
	assert_int_equal(wh_check_mesh(&t.ctx, &m, &r), WH_OK);
	wh_mesh_free(&t.ctx, &m);
	testing_done(&t);
	return r;
}

/* For tests of connectivity alone: positions on a parabola, no two the same. */
static wh_check check_faces(uint32_t nv, uint32_t nf, const uint32_t (*tri)[3])
{
	double xyz[64][3];
	assert_true(nv <= 64);
	for (uint32_t v = 0; v < nv; v++) {
		xyz[v][0] = v;
		xyz[v][1] = (double)v * v;
		xyz[v][2] = (double)v * v * v;
	}
	return check(nv, (const double(*)[3])xyz, nf, tri);
}

static void tetrahedron_is_a_clean_sphere(void **state)
{
	(void)state;
	static const double xyz[][3] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
	static const uint32_t tri[][3] = {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}};
	const wh_check r = check(4, xyz, 4, tri);
	assert_true(wh_check_clean(&r));
	assert_int_equal(r.referenced_vertices, 4);
	assert_int_equal(r.edges, 6);
	assert_int_equal(r.boundary_edges, 0);
	assert_int_equal(r.boundary_loops, 0);
	assert_int_equal(r.components, 1);
	assert_int_equal(r.edge_components, 1);
	assert_int_equal(r.euler, 2);
	assert_int_equal(r.genus, 0);
	assert_true(fabs(r.area - (1.5 + sqrt(3) / 2)) < 1e-15);
	assert_true(r.lo.x == 0 && r.lo.y == 0 && r.lo.z == 0);
	assert_true(r.hi.x == 1 && r.hi.y == 1 && r.hi.z == 1);
}

/*   1---2
 *    \ /      two fans at 0, two boundary loops that touch there
 *     0
 *    / \
 *   3---4  */
static void bowtie_is_two_fans_and_two_loops(void **state)
{
	(void)state;
	static const uint32_t tri[][3] = {{0, 2, 1}, {0, 3, 4}};
	const wh_check r = check_faces(5, 2, tri);
	assert_int_equal(r.nonmanifold_vertices, 1);
	assert_int_equal(r.nonmanifold_edges, 0);
	assert_int_equal(r.boundary_edges, 6);
	assert_int_equal(r.boundary_loops, 2);
	assert_int_equal(r.components, 1);
	assert_int_equal(r.edge_components, 2);
	assert_int_equal(r.genus, -1);
	assert_false(wh_check_clean(&r));
}

/* Two tetrahedra that share vertex 0 alone: closed, still not manifold there. */
static void closed_components_touching_in_a_vertex(void **state)
{
	(void)state;
	static const uint32_t tri[][3] = {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3},
	                                  {0, 5, 4}, {0, 4, 6}, {0, 6, 5}, {4, 5, 6}};
	const wh_check r = check_faces(7, 8, tri);
	assert_int_equal(r.nonmanifold_vertices, 1);
	assert_int_equal(r.components, 1);
	assert_int_equal(r.edge_components, 2);
	assert_int_equal(r.boundary_edges, 0);
	assert_int_equal(r.boundary_loops, 0);
	assert_int_equal(r.euler, 3);
}

static void two_faces_running_the_same_way_disagree(void **state)
{
	(void)state;
	static const uint32_t tri[][3] = {{0, 1, 2}, {0, 1, 3}};
	const wh_check r = check_faces(4, 2, tri);
	assert_int_equal(r.misoriented_edges, 1);
	assert_int_equal(r.nonmanifold_edges, 0);
	assert_int_equal(r.boundary_loops, 1);
	assert_false(wh_check_clean(&r));
}

/* Two triangles on the edge 0-1, the second one's tip at an angle from flat: they lie on each other
 * from 170 degrees on, whichever way it is turned, and however large they are. */
static void folded_edges_lie_on_each_other(void **state)
{
	(void)state;
	static const uint32_t agree[][3] = {{0, 1, 2}, {1, 0, 3}},
	                      disagree[][3] = {{0, 1, 2}, {0, 1, 3}};
	static const double sizes[] = {1, 1e-140, 1e140};
	const double degree = acos(-1) / 180;
	for (int i = 0; i < 4 * 3; i++) {
		const double size = sizes[i % 3],
		             angle = (double[]){0, 90, 169, 171}[i / 3] * degree;
		const double xyz[][3] = {{0, 0, 0},
		                         {size, 0, 0},
		                         {size / 2, size, 0},
		                         {size / 3, -size * cos(angle), size * sin(angle)}};
		const wh_check r = check(4, xyz, 2, agree), s = check(4, xyz, 2, disagree);
		assert_int_equal(r.folded_edges, i / 3 == 3);
		assert_int_equal(s.folded_edges, i / 3 == 3);
		assert_int_equal(s.misoriented_edges, 1);
	}
}

/* A strip of five faces, and two of one. */
static void components_are_counted_by_size(void **state)
{
	(void)state;
	static const uint32_t tri[][3] = {{0, 1, 2}, {2, 1, 3}, {7, 8, 9},   {2, 3, 4},
	                                  {4, 3, 5}, {4, 5, 6}, {10, 11, 12}};
	const wh_check r = check_faces(13, 7, tri);
	assert_int_equal(r.components, 3);
	assert_int_equal(r.component_sizes[0], 2);
	assert_int_equal(r.component_sizes[1], 0);
	assert_int_equal(r.component_sizes[2], 1);
	assert_int_equal(r.largest_component, 5);
	uint64_t faces = 0;
	for (int i = 0; i < WH_RADIUS_RATIOS; i++)
		faces += r.radius_ratios[i];
	assert_int_equal(faces, 7);
}

/* Five triangles in a ring, over and under: i, i+1, i+2 modulo 5. However they are turned, one
 * edge at least disagrees; the boundary is a single loop. */
static void moebius_band_has_one_loop_and_cannot_agree(void **state)
{
	(void)state;
	uint32_t tri[5][3];
	for (uint32_t i = 0; i < 5; i++) {
		tri[i][0] = i;
		tri[i][1] = (i + 1 + i % 2) % 5;
		tri[i][2] = (i + 2 - i % 2) % 5;
	}
	const wh_check r = check_faces(5, 5, (const uint32_t(*)[3])tri);
	assert_int_equal(r.edges, 10);
	assert_int_equal(r.boundary_edges, 5);
	assert_int_equal(r.boundary_loops, 1);
	assert_int_equal(r.misoriented_edges, 1);
	assert_int_equal(r.nonmanifold_vertices, 0);
	assert_int_equal(r.euler, 0);
	assert_int_equal(r.genus, -1);
}

static void three_faces_on_an_edge(void **state)
{
	(void)state;
	static const uint32_t tri[][3] = {{0, 1, 2}, {1, 0, 3}, {0, 1, 4}};
	const wh_check r = check_faces(5, 3, tri);
	assert_int_equal(r.nonmanifold_edges, 1);
	assert_int_equal(r.misoriented_edges, 0);
	assert_int_equal(r.nonmanifold_vertices, 0);
	assert_int_equal(r.boundary_edges, 6);
	assert_int_equal(r.edges, 7);
	assert_false(wh_check_clean(&r));
}

/* A square ring: outer corners 0-3, inner ones 4-7. */
static void annulus_has_two_loops(void **state)
{
	(void)state;
	uint32_t tri[8][3];
	for (uint32_t i = 0; i < 4; i++) {
		const uint32_t j = (i + 1) % 4;
		memcpy(tri[2 * i], (uint32_t[]){i, j, 4 + i}, sizeof tri[0]);
		memcpy(tri[2 * i + 1], (uint32_t[]){j, 4 + j, 4 + i}, sizeof tri[0]);
	}
	const wh_check r = check_faces(8, 8, (const uint32_t(*)[3])tri);
	assert_true(wh_check_clean(&r));
	assert_int_equal(r.boundary_edges, 8);
	assert_int_equal(r.boundary_loops, 2);
	assert_int_equal(r.euler, 0);
	assert_int_equal(r.genus, 0);
}

enum { TORUS = 8 };

/* TORUS x TORUS quads, both directions closed. */
static void make_torus(uint32_t tri[2 * TORUS * TORUS][3])
{
	for (uint32_t q = 0; q < TORUS * TORUS; q++) {
		const uint32_t i = q % TORUS, j = q / TORUS;
		const uint32_t e = (i + 1) % TORUS, n = (j + 1) % TORUS;
		const uint32_t a = j * TORUS + i, b = j * TORUS + e;
		const uint32_t c = n * TORUS + e, d = n * TORUS + i;
		memcpy(tri[2 * q], (uint32_t[]){a, b, c}, sizeof tri[0]);
		memcpy(tri[2 * q + 1], (uint32_t[]){a, c, d}, sizeof tri[0]);
	}
}

static void torus_has_a_handle(void **state)
{
	(void)state;
	uint32_t tri[2 * TORUS * TORUS][3];
	make_torus(tri);
	const wh_check r = check_faces(64, 2 * TORUS * TORUS, (const uint32_t(*)[3])tri);
	assert_true(wh_check_clean(&r));
	assert_int_equal(r.euler, 0);
	assert_int_equal(r.genus, 1);
	assert_int_equal(r.components, 1);
}

/* Two faces taken out of a torus that touch in vertex 9 alone: around either fan there, the walk
 * goes on from one hole to the other. */
static void a_loop_is_walked_fan_by_fan(void **state)
{
	(void)state;
	uint32_t tri[2 * TORUS * TORUS][3];
	make_torus(tri);
	/* faces {0,1,9} and {9,18,17} (the second of quad 9) meet in vertex 9 */
	const uint32_t last = 2 * TORUS * TORUS - 1;
	assert_int_equal(tri[19][0], 9);
	memmove(tri[19], tri[last], sizeof tri[0]);
	memmove(tri[0], tri[last - 1], sizeof tri[0]);
	const wh_check r = check_faces(64, last - 1, (const uint32_t(*)[3])tri);
	assert_int_equal(r.boundary_edges, 6);
	assert_int_equal(r.boundary_loops, 1);
	assert_int_equal(r.nonmanifold_vertices, 1);
	assert_int_equal(r.components, 1);
	assert_int_equal(r.edge_components, 1);
}

static void duplicate_faces_count_beyond_the_first(void **state)
{
	(void)state;
	static const uint32_t tri[][3] = {{0, 1, 2}, {1, 2, 0}, {2, 1, 0}, {0, 1, 3}};
	const wh_check r = check_faces(4, 4, tri);
	assert_int_equal(r.duplicate_faces, 2);
	assert_int_equal(r.edges, 5);
	assert_int_equal(r.nonmanifold_edges, 3);
	assert_false(wh_check_clean(&r));
}

static void degenerate_and_invalid_faces_have_no_edges(void **state)
{
	(void)state;
	static const uint32_t tri[][3] = {{0, 1, 2}, {0, 0, 3}, {1, 2, 9}, {4, 4, 4}};
	const wh_check r = check_faces(5, 4, tri);
	assert_int_equal(r.degenerate_faces, 2);
	assert_int_equal(r.invalid_faces, 1);
	assert_int_equal(r.edges, 3);
	assert_int_equal(r.boundary_loops, 1);
	assert_int_equal(r.referenced_vertices, 3);
	assert_int_equal(r.unreferenced_vertices, 2);
	assert_int_equal(r.components, 1);
	assert_int_equal(r.edge_components, 1);
	assert_int_equal(r.euler, 1);
	assert_false(wh_check_clean(&r));
}

static void defects_of_positions_are_counted(void **state)
{
	(void)state;
	const double xyz[][3] = {{0, 0, 0},   {1, 0, 0},        {2, 0, 0}, {-0.0, 0, 0},
	                         {0, 1, 0},   {1, 0, 0},        {0, 0, 0}, {NAN, 0, 0},
	                         {NAN, 0, 0}, {0, 0, INFINITY}, {9, 9, 9}};
	static const uint32_t tri[][3] = {{0, 1, 2}, {0, 1, 4}, {1, 4, 7}, {4, 2, 9}};
	const wh_check r = check(11, xyz, 4, tri);
	assert_int_equal(r.zero_area_faces, 1);
	assert_int_equal(r.duplicate_vertices, 3);
	assert_int_equal(r.nonfinite_vertices, 3);
	assert_true(r.area == 0.5);
	assert_true(r.hi.x == 2 && r.hi.y == 1 && r.hi.z == 0); /* of referenced ones only */
}

/* One equilateral face, one with a right angle, one on a line; all in units of 2^-600, where
 * areas underflow. */
static void radius_ratios_are_of_the_shape_alone(void **state)
{
	(void)state;
	const double unit = ldexp(1, -600);
	const double xyz[][3] = {{0, 0, 0},
	                         {unit, 0, 0},
	                         {unit / 2, unit * sqrt(0.75), 0},
	                         {0, unit, 0},
	                         {2 * unit, 0, 0}};
	static const uint32_t tri[][3] = {{0, 1, 2}, {0, 1, 3}, {0, 1, 4}};
	const double right = 2 * sqrt(2) - 2; /* legs 1: 2 r / R = (2 - sqrt(2)) / (sqrt(2) / 2) */
	wh_check r = check(5, xyz, 1, tri);
	assert_true(fabs(r.radius_ratio_mean - 1) < 1e-15);
	assert_true(r.radius_ratio_p5 >= 0.999 && r.radius_ratio_p5 <= 1);
	r = check(5, xyz, 2, tri);
	assert_true(fabs(r.radius_ratio_mean - (1 + right) / 2) < 1e-15);
	assert_true(r.radius_ratio_p5 <= right && r.radius_ratio_p5 > right - 0.001);
	r = check(5, xyz, 3, tri);
	assert_true(fabs(r.radius_ratio_mean - (1 + right) / 3) < 1e-15);
	assert_true(r.radius_ratio_p5 == 0);
}

/* Of 40 faces two are slivers: one in 20. With one sliver, one in 20 is no sliver. */
static void the_fifth_percentile_is_reached_by_one_face_in_twenty(void **state)
{
	(void)state;
	static const double xyz[][3] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0.01, 0}};
	uint32_t tri[40][3];
	for (int slivers = 1; slivers <= 2; slivers++) {
		for (uint32_t f = 0; f < 40; f++)
			memcpy(tri[f],
			       (int)f < slivers ? (uint32_t[]){0, 1, 3} : (uint32_t[]){0, 1, 2},
			       sizeof tri[f]);
		const wh_check r = check(4, xyz, 40, (const uint32_t(*)[3])tri);
		assert_true(slivers == 1 ? r.radius_ratio_p5 > 0.8 : r.radius_ratio_p5 < 0.03);
	}
}

static void empty_mesh_is_clean(void **state)
{
	(void)state;
	const wh_check r = check(0, NULL, 0, NULL);
	assert_true(wh_check_clean(&r));
	assert_int_equal(r.components, 0);
	assert_int_equal(r.euler, 0);
}

/* A hub: a closed double cone of n triangles on either side, which the star sort has to bear. */
static void hub_vertex_is_sorted_in_time(void **state)
{
	(void)state;
	enum { N = 200000 };
	testing_env t;
	testing_init(&t);
	wh_mesh m;
	assert_int_equal(wh_mesh_alloc(&t.ctx, &m, N + 2, 2 * N), WH_OK);
	for (uint32_t v = 0; v < N + 2; v++)
		m.pos[v] = wh_v3(v, (double)v * v, 1);
	for (uint32_t i = 0; i < N; i++) {
		const uint32_t a = (uint32_t)((uint64_t)i * 77773 % N);
		const uint32_t b = (a + 1) % N;
		memcpy(m.tri + 6 * (size_t)i, (uint32_t[]){a, b, N, b, a, N + 1}, 24);
	}
	wh_check r;
	assert_int_equal(wh_check_mesh(&t.ctx, &m, &r), WH_OK);
	assert_true(wh_check_clean(&r));
	assert_int_equal(r.genus, 0);
	wh_mesh_free(&t.ctx, &m);
	testing_done(&t);
}

static int compare_edges(const void *a, const void *b)
{
	const uint64_t x = *(const uint64_t *)a, y = *(const uint64_t *)b;
	return x < y ? -1 : x > y;
}

/* Edge counts of random soups against a plain sort of all edges. */
static void random_soups_match_a_sorted_edge_list(void **state)
{
	(void)state;
	enum { NF = 40, NV = 12 };
	wh_rng g = wh_rng_seed(1);
	for (int round = 0; round < 200; round++) {
		uint32_t tri[NF][3];
		uint64_t edge[3 * NF];
		size_t n = 0;
		for (int f = 0; f < NF; f++) {
			for (int k = 0; k < 3; k++)
				tri[f][k] = (uint32_t)(wh_rng_next(&g) % NV);
			if (tri[f][0] == tri[f][1] || tri[f][1] == tri[f][2] ||
			    tri[f][2] == tri[f][0])
				continue;
			for (int k = 0; k < 3; k++) {
				const uint32_t a = tri[f][k], b = tri[f][(k + 1) % 3];
				edge[n++] = (uint64_t)(a < b ? a : b) << 32 | (a < b ? b : a);
			}
		}
		qsort(edge, n, sizeof *edge, compare_edges);
		uint64_t edges = 0, open = 0, many = 0;
		for (size_t i = 0, j; i < n; i = j) {
			for (j = i; j < n && edge[j] == edge[i];)
				j++;
			edges++;
			open += j - i == 1;
			many += j - i > 2;
		}
		const wh_check r = check_faces(NV, NF, (const uint32_t(*)[3])tri);
		assert_int_equal(r.edges, edges);
		assert_int_equal(r.boundary_edges, open);
		assert_int_equal(r.nonmanifold_edges, many);
	}
}

static void refused_memory_leaks_nothing(void **state)
{
	(void)state;
	static uint32_t tri[][3] = {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}};
	wh_vec3 pos[4] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
	const wh_mesh m = {4, 3, pos, tri[0], NULL};
	for (long fail = 1;; fail++) {
		testing_env t;
		testing_init(&t);
		t.mem.fail_after = fail;
		wh_check r;
		const wh_code code = wh_check_mesh(&t.ctx, &m, &r);
		testing_done(&t);
		if (code == WH_OK) {
			assert_true(fail > 8);
			return;
		}
		assert_int_equal(code, WH_E_RUN);
	}
}

/* ---- real scans
 * ------------------------------------------------------------------------------------ */

/* The number after "key=" in a manifest's notes, or what its absence means. */
static uint64_t noted(const char *notes, const char *key, uint64_t otherwise)
{
	char pattern[32];
	(void)snprintf(pattern, sizeof pattern, " %s=", key);
	const char *at = strstr(notes, pattern);
	return at ? strtoull(at + strlen(pattern), NULL, 10) : otherwise;
}

static void scan_matches(const char *file, uint64_t vertices, uint64_t faces, const char *notes)
{
	testing_env t;
	testing_init(&t);
	char path[sizeof WHITTLE_DATA + 4096];
	const wh_exec ex = {.workers = 1};
	wh_spill spill;
	wh_mesh m;
	wh_check r;
	uint64_t degenerate;
	(void)snprintf(path, sizeof path, "%s/%s", WHITTLE_DATA, file);
	print_message("%s\n", file);
	assert_int_equal(wh_spill_open(&t.ctx, &spill, NULL, "."), WH_OK);
	assert_int_equal(
	    wh_load_mesh(&t.ctx, &ex, &spill, path, WH_FORMAT_ANY, &m, NULL, &degenerate), WH_OK);
	assert_int_equal(wh_check_mesh(&t.ctx, &m, &r), WH_OK);
	assert_int_equal(r.vertices, vertices);
	if (!strstr(notes, "tristrips")) /* of which each turn of a strip is one dropped */
		assert_int_equal(r.faces + degenerate, faces);
	assert_int_equal(r.boundary_edges, noted(notes, "boundaryE", 0));
	assert_int_equal(r.nonmanifold_edges, noted(notes, "nonmanE", 0));
	assert_int_equal(r.misoriented_edges, noted(notes, "badOrientE", 0));
	assert_int_equal(r.components, noted(notes, "comps", 1));
	assert_int_equal(r.duplicate_vertices, noted(notes, "dupV", 0));
	assert_int_equal(r.unreferenced_vertices, noted(notes, "unrefV", 0));
	assert_int_equal(r.zero_area_faces, noted(notes, "zeroAreaF", 0));
	wh_mesh_free(&t.ctx, &m);
	wh_spill_close(&t.ctx, &spill);
	testing_done(&t);
}

/* One line of the manifest: file, source, licence, vertices, faces, notes, between tabs. */
static bool scan_of_line(char *line)
{
	char *field[6];
	int n = 0;
	for (char *p = line; p && n < 6; n++) {
		field[n] = p;
		p = strchr(p, '\t');
		if (p)
			*p++ = '\0';
	}
	if (n < 6 || strncmp(field[0], "scans/", 6) != 0 || !strstr(field[5], "format PLY") ||
	    strstr(field[5], "nonfinite"))
		return false;
	scan_matches(field[0], strtoull(field[3], NULL, 10), strtoull(field[4], NULL, 10),
	             field[5]);
	return true;
}

static void scans_have_the_counts_of_their_manifest(void **state)
{
	(void)state;
	FILE *f = fopen(WHITTLE_DATA "/MANIFEST.tsv", "r");
	if (!f) {
		print_message("no scans in %s: skipped\n", WHITTLE_DATA);
		skip();
	}
	char line[4096];
	int seen = 0;
	while (fgets(line, sizeof line, f))
		seen += scan_of_line(line);
	(void)fclose(f);
	assert_true(seen > 10);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	    cmocka_unit_test(tetrahedron_is_a_clean_sphere),
	    cmocka_unit_test(bowtie_is_two_fans_and_two_loops),
	    cmocka_unit_test(closed_components_touching_in_a_vertex),
	    cmocka_unit_test(two_faces_running_the_same_way_disagree),
	    cmocka_unit_test(folded_edges_lie_on_each_other),
	    cmocka_unit_test(components_are_counted_by_size),
	    cmocka_unit_test(moebius_band_has_one_loop_and_cannot_agree),
	    cmocka_unit_test(three_faces_on_an_edge),
	    cmocka_unit_test(annulus_has_two_loops),
	    cmocka_unit_test(torus_has_a_handle),
	    cmocka_unit_test(a_loop_is_walked_fan_by_fan),
	    cmocka_unit_test(duplicate_faces_count_beyond_the_first),
	    cmocka_unit_test(degenerate_and_invalid_faces_have_no_edges),
	    cmocka_unit_test(defects_of_positions_are_counted),
	    cmocka_unit_test(radius_ratios_are_of_the_shape_alone),
	    cmocka_unit_test(the_fifth_percentile_is_reached_by_one_face_in_twenty),
	    cmocka_unit_test(empty_mesh_is_clean),
	    cmocka_unit_test(hub_vertex_is_sorted_in_time),
	    cmocka_unit_test(random_soups_match_a_sorted_edge_list),
	    cmocka_unit_test(refused_memory_leaks_nothing),
	    cmocka_unit_test(scans_have_the_counts_of_their_manifest),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
