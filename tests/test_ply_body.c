/* Bodies: polygons, strips and lists of any length; damage is told with its place. */
#define _GNU_SOURCE
#include "ply_files.h"

#include "base/rng.h"
#include "geom/vec3.h"

#define XYZ "property float x\nproperty float y\nproperty float z\n"
#define CORNERS "property list uchar int vertex_indices\n"

/* --- damage --- */

#define TEXT3 \
	"ply\nformat ascii 1.0\nelement vertex 3\n" XYZ "element face 1\n" CORNERS "end_header\n"

static void damaged_text_is_told_with_its_line(void **state)
{
	(void)state;
	static const struct {
		const char *body, *word, *place;
	} bad[] = {
	    {"0 0 0\n1 nan 0\n0 1 0\n3 0 1 2\n", "not a finite number", "vertex 1"},
	    {"0 0 0\n1 1e39 0\n0 1 0\n3 0 1 2\n", "of type float", "vertex 1"},
	    {"0 0 0\n1 zwei 0\n0 1 0\n3 0 1 2\n", "'zwei'", "line 11, item 1"},
	    {"0 0 0\n1 0 0\n\n0 1 0\n3 0 1 3\n", "index 3 is out of range", "face 0 (line 14)"},
	    {"0 0 0\n1 0 0\n0 1 0\n3 0 -1 2\n", "index -1", "face 0 (line 13)"},
	    {"0 0 0\n1 0 0\n0 1 0\n3 0 1.5 2\n", "'1.5'", "line 13"},
	    {"0 0 0\n1 0 0\n0 1 0\n3 0 1\n", "cut short", "item 0 of element 'face'"},
	    {"0 0 0\n1 0 0\n0 1 00000000\n", "cut short", "item 0 of element 'face'"},
	    {"0 0 0\n1 0 0\n0        ", "cut short", "item 2 of element 'vertex'"},
	    {"0 0 0\n1 0 0\n0 1 0\n-3 0 1 2\n", "list of -3", "line 13"},
	    {"0 0 0\n1 0 0\n0 1 0\n18446744073709551615 0 1 2\n", "list of", "line 13"},
	    {"0 0 0\n1 0 0\n0 1 0\n36893488147419103232 0 1 2\n", "whole number", "line 13"},
	};
	for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++) {
		char text[1024];
		(void)snprintf(text, sizeof text, TEXT3 "%s", bad[i].body);
		ply_file p = ply_write(text);
		ply_assert_refused(&p, bad[i].word, bad[i].place, NULL);
	}
}

/* Three vertices and two triangles, the second with these corners and this count. */
static ply_file binary(const char *count_type, wh_type t, double count, const double ids[3],
                       double x)
{
	ply_file p = ply_begin(WH_PLY_LE);
	char text[512];
	(void)snprintf(text, sizeof text,
	               "element vertex 3\n" XYZ
	               "element face 2\nproperty list %s int vertex_indices\n",
	               count_type);
	ply_header(&p, text);
	for (int i = 0; i < 9; i++)
		ply_value(&p, WH_F32, i == 4 ? x : i == 3 || i == 7);
	for (int f = 0; f < 2; f++) {
		ply_value(&p, t, f ? count : 3);
		for (int k = 0; k < 3; k++)
			ply_value(&p, WH_I32, f ? ids[k] : k);
	}
	ply_end(&p);
	return p;
}

static void damaged_binary_bodies_are_told_with_their_place(void **state)
{
	(void)state;
	const double good[3] = {0, 1, 2}, high[3] = {0, 1, 3}, low[3] = {0, -1, 2};
	ply_file p = binary("uchar", WH_U8, 3, high, 0);
	ply_assert_refused(&p, "face 1", "index 3 is out of range", NULL);
	p = binary("uchar", WH_U8, 3, low, 0);
	ply_assert_refused(&p, "face 1", "index -1 ", NULL);
	p = binary("uchar", WH_U8, 3, good, NAN);
	ply_assert_refused(&p, "vertex 1", "y is nan", NULL);
	p = binary("uchar", WH_U8, 3, good, -HUGE_VAL);
	ply_assert_refused(&p, "vertex 1", "y is -inf", NULL);
	p = binary("int", WH_I32, -1, good, 0);
	ply_assert_refused(&p, "item 1 of element 'face'", "list of -1", "byte", NULL);
	p = binary("uint", WH_U32, 4294967295.0, good, 0);
	ply_assert_refused(&p, "item 1 of element 'face'", "list of 4294967295", NULL);
	p = binary("int64", WH_I64, 9e18, good, 0);
	ply_assert_refused(&p, "item 1 of element 'face'", "list of 9000000000000000000", NULL);
	p = binary("uchar", WH_U8, 4, good, 0);
	ply_assert_refused(&p, "item 1 of element 'face'", "cut short", NULL);
}

static void a_body_cut_anywhere_is_refused(void **state)
{
	(void)state;
	for (int format = WH_PLY_ASCII; format <= WH_PLY_BE; format++) {
		for (long cut = 1; cut < 60; cut++) {
			ply_file p = ply_begin((wh_ply_format)format);
			ply_header(&p, "element vertex 4\n" XYZ "element face 2\n" CORNERS);
			const long body = ftell(p.f);
			for (int i = 0; i < 12; i++)
				ply_value(&p, WH_F32, i % 5);
			ply_value(&p, WH_U8, 4);
			for (int k = 0; k < 4; k++)
				ply_value(&p, WH_I32, k);
			ply_value(&p, WH_U8, 3);
			for (int k = 0; k < 3; k++)
				ply_value(&p, WH_I32, k);
			const long end = ftell(p.f) - (format == WH_PLY_ASCII ? 1 : 0);
			ply_end(&p);
			if (end - cut <= body)
				break;
			assert_int_equal(truncate(p.path, end - cut), 0);
			ply_assert_refused(&p, "cut short", NULL);
		}
	}
}

static void files_without_faces_have_nothing_to_reduce(void **state)
{
	(void)state;
	static const char *const elements[] = {
	    "element vertex 1\n" XYZ "end_header\n0 0 0\n",
	    "element vertex 1\n" XYZ "element face 0\n" CORNERS "end_header\n0 0 0\n",
	    "element vertex 1\n" XYZ "element face 1\nproperty int a\nend_header\n0 0 0\n1\n",
	    "element vertex 1\nproperty float x\nelement face 1\n" CORNERS "end_header\n0\n0\n",
	    "element face 1\n" CORNERS "end_header\n3 0 1 2\n",
	    "element vertex 2\n" XYZ "element face 2\n" CORNERS
	    "end_header\n0 0 0\n1 1 1\n3 0 1 0\n2 0 1\n",
	    "element vertex 2\n" XYZ "element face 1\n" CORNERS "end_header\n0 0 0\n1 1 1\n0\n"};
	for (size_t i = 0; i < sizeof elements / sizeof elements[0]; i++) {
		char text[512];
		(void)snprintf(text, sizeof text, "ply\nformat ascii 1.0\n%s", elements[i]);
		ply_file p = ply_write(text);
		ply_assert_refused(&p, "no mesh", NULL);
	}
}

/* --- polygons and strips --- */

typedef struct loaded {
	testing_env t;
	wh_mesh m;
	uint64_t degenerate;
} loaded;

static void load(loaded *l, const ply_file *p, int workers)
{
	testing_init(&l->t);
	if (ply_load(&l->t, p, workers, &l->m, NULL, &l->degenerate) != WH_OK)
		fail_msg("%s", l->t.ctx.err.text);
}

static void unload(loaded *l)
{
	wh_mesh_free(&l->t.ctx, &l->m);
	testing_done(&l->t);
}

static void degenerate_faces_are_dropped_and_counted(void **state)
{
	(void)state;
	loaded l;
	ply_file p = ply_write("ply\nformat ascii 1.0\nelement vertex 4\n" XYZ
	                       "element face 8\n" CORNERS "end_header\n"
	                       "0 0 0\n1 0 0\n1 1 0\n0 1 0\n"
	                       "0\n1 0\n2 0 1\n3 0 1 1\n4 0 1 0 1\n" /* five without an area */
	                       "4 0 1 1 2\n3 3 0 2\n5 0 0 1 2 3\n");
	load(&l, &p, 1);
	assert_int_equal(l.degenerate, 5);
	assert_int_equal(l.m.nf, 4);
	unload(&l);
}

static void strips_alternate_and_restart(void **state)
{
	(void)state;
	static const int ids[] = {0, 1, 2, 3, 3, -1, 4, 5, 6, 7, -1, 0, 1, -1, -1, 5, 6, 7};
	static const uint32_t want[] = {0, 1, 2, 2, 1, 3, 4, 5, 6, 6, 5, 7, 5, 6, 7};
	static const wh_type types[] = {WH_I32, WH_I8, WH_U32, WH_U8, WH_I64, WH_U64};
	static const char *const names[] = {"int", "char", "uint", "uchar", "int64", "uint64"};
	for (int format = WH_PLY_ASCII; format <= WH_PLY_BE; format++) {
		for (int k = 0; k < 6; k++) {
			loaded l;
			char text[512];
			ply_file p = ply_begin((wh_ply_format)format);
			(void)snprintf(text, sizeof text,
			               "element tristrips 2\nproperty list int %s vertex_indices\n"
			               "element vertex 8\n" XYZ,
			               names[k]);
			ply_header(&p, text);
			ply_value(&p, WH_I32, 0); /* an empty strip */
			ply_item(&p);
			ply_value(&p, WH_I32, sizeof ids / sizeof ids[0]);
			for (size_t i = 0; i < sizeof ids / sizeof ids[0]; i++)
				ply_value(&p, types[k], ids[i]);
			ply_item(&p);
			for (int v = 0; v < 24; v++) {
				ply_value(&p, WH_F32, v);
				if (v % 3 == 2)
					ply_item(&p);
			}
			ply_end(&p);
			load(&l, &p, 2);
			assert_int_equal(l.m.nf, sizeof want / sizeof want[0] / 3);
			assert_memory_equal(l.m.tri, want, sizeof want);
			unload(&l);
		}
	}
}

/* --- large files: many chunks, long lists --- */

typedef struct grid {
	int side;   /* vertices along an edge */
	bool quads; /* else triangles */
	wh_ply_format format;
	bool list; /* vertices hold a list of changing length */
	bool faces_first;
} grid;

static void grid_vertices(ply_file *p, const grid *g)
{
	for (int i = 0; i < g->side * g->side; i++) {
		if (g->list) {
			ply_value(p, WH_U8, i % 4);
			for (int k = 0; k < i % 4; k++)
				ply_value(p, WH_I16, k);
		}
		ply_value(p, WH_F32, i % g->side);
		ply_value(p, WH_F32, i / g->side);
		ply_value(p, WH_F32, (i * 7) % 5);
		ply_item(p);
	}
}

static void grid_face(ply_file *p, const int *ids, int n)
{
	ply_value(p, WH_U8, n);
	for (int k = 0; k < n; k++)
		ply_value(p, WH_I32, ids[k]);
	ply_item(p);
}

static void grid_faces(ply_file *p, const grid *g)
{
	for (int y = 0; y + 1 < g->side; y++) {
		for (int x = 0; x + 1 < g->side; x++) {
			const int a = y * g->side + x;
			const int quad[4] = {a, a + 1, a + g->side + 1, a + g->side};
			const int other[3] = {a, a + g->side + 1, a + g->side};
			if (g->quads && (x + y) % 3) {
				grid_face(p, quad, 4);
			} else {
				grid_face(p, quad, 3);
				grid_face(p, other, 3);
			}
		}
	}
}

static int grid_count(const grid *g)
{
	int n = 0;
	for (int y = 0; y + 1 < g->side; y++)
		for (int x = 0; x + 1 < g->side; x++)
			n += g->quads && (x + y) % 3 ? 1 : 2;
	return n;
}

static ply_file write_grid(const grid *g)
{
	ply_file p = ply_begin(g->format);
	char vertex[256], face[128], text[512];
	(void)snprintf(vertex, sizeof vertex, "element vertex %d\n%s" XYZ, g->side * g->side,
	               g->list ? "property list uchar short extra\n" : "");
	(void)snprintf(face, sizeof face, "element face %d\n" CORNERS, grid_count(g));
	(void)snprintf(text, sizeof text, "%s%s", g->faces_first ? face : vertex,
	               g->faces_first ? vertex : face);
	ply_header(&p, text);
	if (!g->faces_first)
		grid_vertices(&p, g);
	grid_faces(&p, g);
	if (g->faces_first)
		grid_vertices(&p, g);
	ply_end(&p);
	return p;
}

/* Every way through the code gives the same triangles in the same order, on 1 to 3 workers. */
static void all_ways_agree_on_a_file_of_many_chunks(void **state)
{
	(void)state;
	loaded first;
	for (int k = 0; k < 12; k++) {
		const grid g = {420, true, (wh_ply_format)(k % 3), k / 3 % 2 == 1, k >= 6};
		loaded l;
		ply_file p = write_grid(&g);
		load(k ? &l : &first, &p, 1 + k % 3);
		if (k == 0)
			continue;
		assert_int_equal(l.m.nf, 2 * 419 * 419);
		assert_int_equal(l.m.nv, first.m.nv);
		assert_int_equal(l.m.nf, first.m.nf);
		assert_memory_equal(l.m.pos, first.m.pos, l.m.nv * sizeof *l.m.pos);
		assert_memory_equal(l.m.tri, first.m.tri, 3 * l.m.nf * sizeof *l.m.tri);
		unload(&l);
	}
	unload(&first);
}

/* Triangles at first, so that the body looks like one to be used in place, then a quad. */
static void a_late_quad_makes_the_reader_start_again(void **state)
{
	(void)state;
	const grid g = {120, false, WH_PLY_LE, false, false};
	loaded l;
	ply_file p = ply_begin(WH_PLY_LE);
	char text[256];
	(void)snprintf(text, sizeof text, "element vertex %d\n" XYZ "element face %d\n" CORNERS,
	               g.side * g.side, grid_count(&g) + 1);
	ply_header(&p, text);
	grid_vertices(&p, &g);
	grid_faces(&p, &g);
	const int quad[4] = {0, 1, 121, 120};
	grid_face(&p, quad, 4);
	ply_end(&p);
	load(&l, &p, 2);
	assert_int_equal(l.m.nf, grid_count(&g) + 2);
	unload(&l);
}

/* A list of the whole file: a zigzag strip, and a polygon far larger than a chunk. */
static void a_list_larger_than_memory_allows_is_streamed(void **state)
{
	(void)state;
	enum { N = 600000 };
	for (int strip = 0; strip < 2; strip++) {
		for (int format = WH_PLY_ASCII; format <= WH_PLY_LE; format++) {
			loaded l;
			ply_file p = ply_begin((wh_ply_format)format);
			char text[256];
			(void)snprintf(text, sizeof text,
			               "element vertex %d\n" XYZ
			               "element %s 2\nproperty list int int vertex_indices\n",
			               N, strip ? "tristrips" : "face");
			ply_header(&p, text);
			for (int i = 0; i < N; i++) {
				ply_value(&p, WH_F32, strip ? i / 2 : i);
				ply_value(&p, WH_F32, strip ? i % 2 : (double)(i % 1000) * i);
				ply_value(&p, WH_F32, 0);
				ply_item(&p);
			}
			ply_value(&p, WH_I32, 3);
			for (int i = 0; i < 3; i++)
				ply_value(&p, WH_I32, i);
			ply_item(&p);
			ply_value(&p, WH_I32, N);
			for (int i = 0; i < N; i++)
				ply_value(&p, WH_I32, (i + 5) % N);
			ply_item(&p);
			ply_end(&p);
			load(&l, &p, 2);
			assert_int_equal(l.m.nf, 1 + N - 2);
			if (!strip) { /* a fan around vertex 0 */
				for (size_t f = 1; f < l.m.nf; f++)
					assert_int_equal(l.m.tri[3 * f], 0);
			}
			unload(&l);
		}
	}
}

/* --- robustness --- */

static wh_code try_load(const char *path, long fail_after)
{
	testing_env t;
	wh_mesh m;
	wh_spill spill;
	const wh_exec ex = {.workers = 1};
	testing_init(&t);
	assert_int_equal(wh_spill_open(&t.ctx, &spill, "/tmp", NULL), WH_OK);
	t.mem.fail_after = fail_after;
	const wh_code code = wh_load_mesh(&t.ctx, &ex, &spill, path, WH_FORMAT_ANY, &m, NULL, NULL);
	if (code == WH_OK)
		wh_mesh_free(&t.ctx, &m);
	else if (code == WH_E_IRREGULAR || t.ctx.err.code != code)
		fail_msg("failure %d was not recorded", code);
	assert_int_equal(spill.held, 0);
	wh_spill_close(&t.ctx, &spill);
	testing_done(&t);
	return code;
}

static void a_failed_allocation_leaves_nothing_behind(void **state)
{
	(void)state;
	for (int k = 0; k < 4; k++) {
		const grid g = {12, k % 2 == 1, (wh_ply_format)(k / 2), k == 3, k == 1};
		ply_file p = write_grid(&g);
		for (long after = 1; try_load(p.path, after) != WH_OK; after++)
			assert_true(after < 1000);
		(void)unlink(p.path);
	}
}

/* Random damage: any answer is fine as long as it is one, and no memory is misused. */
static void damaged_bytes_never_crash_the_reader(void **state)
{
	(void)state;
	for (uint64_t seed = 0; seed < 3000; seed++) {
		wh_rng r = wh_rng_seed(seed);
		const grid g = {4, seed % 2 == 1, (wh_ply_format)(seed % 3), seed % 5 == 0,
		                seed % 7 == 0};
		ply_file p = write_grid(&g);
		FILE *f = fopen(p.path, "r+b");
		assert_non_null(f);
		(void)fseek(f, 0, SEEK_END);
		const uint64_t size = (uint64_t)ftell(f);
		for (int i = 0; i < 1 + (int)(seed % 4); i++) {
			const uint64_t at = wh_rng_next(&r) % size;
			(void)fseek(f, (long)at, SEEK_SET);
			(void)fputc((int)(wh_rng_next(&r) & 0xff), f);
		}
		(void)fclose(f);
		if (seed % 3 == 1)
			assert_int_equal(truncate(p.path, (long)(wh_rng_next(&r) % size)), 0);
		const wh_code code = try_load(p.path, 0);
		if (code != WH_OK && code != WH_E_INPUT)
			fail_msg("seed %d: status %d", (int)seed, code);
		(void)unlink(p.path);
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	    cmocka_unit_test(damaged_text_is_told_with_its_line),
	    cmocka_unit_test(damaged_binary_bodies_are_told_with_their_place),
	    cmocka_unit_test(a_body_cut_anywhere_is_refused),
	    cmocka_unit_test(files_without_faces_have_nothing_to_reduce),
	    cmocka_unit_test(degenerate_faces_are_dropped_and_counted),
	    cmocka_unit_test(strips_alternate_and_restart),
	    cmocka_unit_test(all_ways_agree_on_a_file_of_many_chunks),
	    cmocka_unit_test(a_late_quad_makes_the_reader_start_again),
	    cmocka_unit_test(a_list_larger_than_memory_allows_is_streamed),
	    cmocka_unit_test(a_failed_allocation_leaves_nothing_behind),
	    cmocka_unit_test(damaged_bytes_never_crash_the_reader),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
