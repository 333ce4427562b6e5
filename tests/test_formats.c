/* OBJ, OFF and STL: what is read of them, what is refused, and that no way of running them changes
 * the mesh. */
#define _GNU_SOURCE
#include "ply_files.h"

#include "base/rng.h"

#include <math.h>

/* A file of these bytes. */
static ply_file write_bytes(const void *bytes, size_t n)
{
	ply_file p = ply_begin(WH_PLY_LE);
	assert_int_equal(fwrite(bytes, 1, n, p.f), n);
	ply_end(&p);
	return p;
}

/* Loads the file and holds its counts. */
static void assert_loads(ply_file p, uint32_t nv, uint32_t nf, bool is_double)
{
	testing_env t;
	wh_mesh m;
	bool wide;
	testing_init(&t);
	if (ply_load(&t, &p, 2, &m, &wide, NULL) != WH_OK)
		fail_msg("%s", t.ctx.err.text);
	assert_int_equal(m.nv, nv);
	assert_int_equal(m.nf, nf);
	assert_int_equal(wide, is_double);
	wh_mesh_free(&t.ctx, &m);
	testing_done(&t);
}

#define SQUARE "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"

/* ---- OBJ ---------------------------------------------------------------------------------- */

static void corners_are_written_in_many_ways(void **state)
{
	(void)state;
	static const char *const faces[] = {
	    "f 1 2 3 4\n",
	    "f 1/1 2/2 3/3 4/4\n",
	    "f 1//7 2//7 3//7 4//7\n",
	    "f 1/1/1 2/2/1 3/3/1 4/4/1\n",
	    "f -4 -3 -2 -1\n",
	    "f -4/-1 -3/-1 -2/-1 -1/-1\n",
	    "f 1 2 3 4 # a square\n",
	    "f 1 2 \\\n 3 4\n",
	    "f 1 2 \\\r\n3\\\r\n 4\r\n",
	    "f 1\t2   3  4 \n",
	    "g f an f\nf 1 2 3 4",
	};
	for (size_t i = 0; i < sizeof faces / sizeof faces[0]; i++) {
		char text[256];
		(void)snprintf(text, sizeof text, SQUARE "%s", faces[i]);
		assert_loads(ply_write(text), 4, 2, false);
	}
}

/* Relative corners count from where the face stands, not from the end. */
static void relative_corners_count_from_their_line(void **state)
{
	(void)state;
	testing_env t;
	wh_mesh m;
	testing_init(&t);
	const ply_file p =
	    ply_write("v 0 0 0\nv 1 0 0\nv 0 1 0\nf -3 -2 -1\nv 0 0 1\nf -4 -3 -1\n");
	assert_int_equal(ply_load(&t, &p, 2, &m, NULL, NULL), WH_OK);
	static const uint32_t tri[] = {0, 1, 2, 0, 1, 3};
	assert_int_equal(m.nf, 2);
	assert_memory_equal(m.tri, tri, sizeof tri);
	wh_mesh_free(&t.ctx, &m);
	testing_done(&t);
}

static void vertices_may_have_colours_and_weights(void **state)
{
	(void)state;
	assert_loads(ply_write("v 0 0 0 1\nv 1 0 0 1 0.5 0\nv 0 1 0 # up\nvn 0 0 1\nf 1 2 3\n"), 3,
	             1, false);
	assert_loads(ply_write("v 0 0 0\rv 1 0 0\rv 0 1 0\rf 1 2 3\r"), 3, 1, false);
}

static void wrong_lines_of_obj_are_named(void **state)
{
	(void)state;
	static const struct {
		const char *line, *word;
	} bad[] = {{"f 1 2 5\n", "'5'"},
	           {"f 0 1 2\n", "'0'"},
	           {"f -5 1 2\n", "'-5'"},
	           {"f 1 2 x\n", "'x'"},
	           {"f 1 2 -\n", "'-'"},
	           {"v 1 2\nf 1 2 3\n", "fewer"},
	           {"v 1 y 2\nf 1 2 3\n", "'y'"},
	           {"f 1 2 -0\n", "'-0'"},
	           {"f 1 2 99999999999999999999999\n", "99999"}};
	for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++) {
		char text[256];
		(void)snprintf(text, sizeof text, SQUARE "%s", bad[i].line);
		const ply_file p = ply_write(text);
		ply_assert_refused(&p, "line 5", bad[i].word, NULL);
	}
	const ply_file nan = ply_write("v 0 0 0\nv nan 0 0\nv 0 1 0\nf 1 2 3\n");
	ply_assert_refused(&nan, "not a finite", NULL);
	const ply_file points = ply_write("v 0 0 0\nv 1 0 0\nv 0 1 0\np 1 2 3\n");
	ply_assert_refused(&points, "no mesh", NULL);
}

/* ---- floats or doubles -------------------------------------------------------------------- */

static void digits_tell_floats_from_doubles(void **state)
{
	(void)state;
	assert_loads(ply_write("v 0.1 0 0\nv 1e-5 0 0\nv 619.945312 -0.520507812 1\nf 1 2 3\n"), 3,
	             1, false);
	assert_loads(ply_write("v 0.100000001490116119 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"), 3, 1,
	             false); /* a float with more digits than it needs */
	assert_loads(ply_write("v 0.1 0 0\nv 1 0 0\nv 654321.123 1 0\nf 1 2 3\n"), 3, 1, true);
	assert_loads(ply_write("OFF\n3 1 0\n0.1 0 0\n1 0 0\n654321.123 1 0\n3 0 1 2\n"), 3, 1,
	             true);
	assert_loads(ply_write("OFF\n3 1 0\n0.1 0\n0\n1 0 0\n654321.123 1 0\n3 0 1 2\n"), 3, 1,
	             true); /* not a line a vertex: word by word */
	assert_loads(ply_write("solid\nvertex 0.1 0 0\nvertex 1 0 0\nvertex 1e39 1 0\nendloop\n"),
	             3, 1, true);
}

/* ---- OFF ---------------------------------------------------------------------------------- */

static void kinds_of_off_are_known(void **state)
{
	(void)state;
	static const char *const texts[] = {
	    "OFF\n4 1 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3\n",
	    "OFF 4 1 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3",
	    "# comment\n\nCOFF\n\n4 1 0 # counts\n\n0 0 0 255 0 0 255\n1 0 0 1 1 1\n# more\n"
	    "1 1 0 # that was blue\n0 1 0 1\n4 0 1 2 3 0.5 0.5 0.5\n",
	    "NOFF\r\n4 1 0\r\n0 0 0 0 0 1\r\n1 0 0 0 0 1\r\n1 1 0 0 0 1\r\n0 1 0 0 0 1\r\n"
	    "4 0 1 2 3\r\n",
	    "STCNOFF\n4 1 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3\nand so on\n",
	    "OFF\n4 1 0\n0 0\n0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3\n",
	};
	for (size_t i = 0; i < sizeof texts / sizeof texts[0]; i++)
		assert_loads(ply_write(texts[i]), 4, 2, false);
}

static void binary_off_is_big_endian(void **state)
{
	(void)state;
	static const unsigned char bytes[] =
	    "OFF BINARY\n\0\0\0\3\0\0\0\1\0\0\0\0"
	    "\0\0\0\0\0\0\0\0\0\0\0\0\x3f\x80\0\0\0\0\0\0\0\0\0\0\0\0\0\0\x3f\x80\0\0\0\0\0\0"
	    "\0\0\0\3\0\0\0\0\0\0\0\1\0\0\0\2\0\0\0\0";
	assert_loads(write_bytes(bytes, sizeof bytes - 1), 3, 1, false);
	const ply_file cut = write_bytes(bytes, sizeof bytes - 9);
	ply_assert_refused(&cut, NULL);
}

static void wrong_off_is_refused(void **state)
{
	(void)state;
	static const struct {
		const char *text, *word;
	} bad[] = {
	    {"OFF\n353535235358 6 0\n0 0 0\n", "353535235358"},
	    {"OFF\n3 99999999999 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n", "99999999999"},
	    {"OFF\nthree one\n", "OFF header"},
	    {"OFF\n-3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n", "OFF header"},
	    {"4OFF\n1 1 0\n0 0 0 0\n1 0\n", "dimension"},
	    {"OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 7\n", "line 6"},
	    {"OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 x\n3 0 1 2\n", "line 5"},
	    {"OFF\n3 2 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n", "cut short"},
	    {"OFF", "OFF header"},
	};
	for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++) {
		const ply_file p = ply_write(bad[i].text);
		ply_assert_refused(&p, bad[i].word, NULL);
	}
}

/* ---- STL ---------------------------------------------------------------------------------- */

typedef struct stl {
	unsigned char *bytes;
	size_t n;
} stl;

static void put_facet(stl *s, const float p[9])
{
	unsigned char *to = s->bytes + s->n;
	memset(to, 0, 50);
	memcpy(to + 12, p, 36);
	s->n += 50;
}

static stl begin_stl(const char *header, uint32_t facets, uint32_t room)
{
	stl s = {calloc(84 + 50 * (size_t)room, 1), 84};
	assert_non_null(s.bytes);
	memcpy(s.bytes, header, strlen(header));
	memcpy(s.bytes + 80, &facets, 4);
	return s;
}

static void equal_corners_are_one_vertex(void **state)
{
	(void)state;
	stl s = begin_stl("solid, it says", 3, 3);
	put_facet(&s, (const float[]){0, 0, 0, 1, 0, 0, 1, 1, 0});
	put_facet(&s, (const float[]){-0.0F, 0, -0.0F, 1, 1, 0, 0, 1, -0.0F});
	put_facet(&s, (const float[]){0, 0, 0, 1, 0, 0, 0, -0.0F, 0}); /* degenerate */
	testing_env t;
	wh_mesh m;
	uint64_t degenerate;
	testing_init(&t);
	const ply_file p = write_bytes(s.bytes, s.n);
	assert_int_equal(ply_load(&t, &p, 2, &m, NULL, &degenerate), WH_OK);
	static const uint32_t tri[] = {0, 1, 2, 0, 2, 3};
	assert_int_equal(m.nv, 4);
	assert_int_equal(m.nf, 2);
	assert_int_equal(degenerate, 1);
	assert_memory_equal(m.tri, tri, sizeof tri);
	wh_mesh_free(&t.ctx, &m);
	testing_done(&t);
	free(s.bytes);
}

static void wrong_stl_is_refused(void **state)
{
	(void)state;
	stl s = begin_stl("binary", 3, 2);
	put_facet(&s, (const float[]){0, 0, 0, 1, 0, 0, 1, 1, 0});
	put_facet(&s, (const float[]){0, 0, 0, 1, INFINITY, 0, 1, 1, 0});
	char path[64];
	ply_file p = write_bytes(s.bytes, s.n); /* a count of three, room for two */
	(void)snprintf(path, sizeof path, "%.50s.stl", p.path);
	assert_int_equal(rename(p.path, path), 0);
	memcpy(p.path, path, sizeof path);
	ply_assert_refused(&p, "3 facets", "cut short", NULL);
	s.bytes[80] = 2;
	p = write_bytes(s.bytes, s.n);
	ply_assert_refused(&p, "facet 1, corner 1", "finite", NULL);
	free(s.bytes);
	p = ply_write("solid x\nfacet\nvertex 0 0 0\nvertex 1 0 0\nendloop\n");
	ply_assert_refused(&p, "no mesh", NULL);
	p = ply_write("solid x\nvertex 0 0 0\nvertex 1 0 0\nvertex 1 1 0\nvertex 1 1 1\nendloop\n");
	ply_assert_refused(&p, "line 6", "three", NULL);
	p = ply_write("solid x\nvertex 0 0 0\nvertex 1 0 0\nvertex 1 1 0\nendloop\nvertex 1 1 1\n");
	ply_assert_refused(&p, "cut short", NULL);
	p = ply_write("solid x\nvertex 0 0 0\nvertex 1 0 0\nvertex 1 1\nendloop\n");
	ply_assert_refused(&p, "line 4", NULL);
}

/* ---- many chunks, buckets and ranges ------------------------------------------------------ */

enum { SIDE = 300 }; /* squares of a grid: 180 000 facets, 540 000 corners, 7 MB of text */

static void grid_point(uint32_t i, float p[3])
{
	p[0] = (float)(i % (SIDE + 1)) / 7;
	p[1] = (float)(i / (SIDE + 1)) / 7;
	p[2] = (float)(i * 2654435761u >> 16) / 1e5F;
}

static void grid_corners(uint32_t square, uint32_t t[6])
{
	const uint32_t a = square / SIDE * (SIDE + 1) + square % SIDE;
	const uint32_t b = a + 1, d = a + SIDE + 1;
	memcpy(t, (const uint32_t[]){a, b, d, b, d + 1, d}, 6 * sizeof *t);
}

static ply_file grid_obj(void)
{
	ply_file p = ply_begin(WH_PLY_ASCII);
	for (uint32_t i = 0; i < (SIDE + 1) * (SIDE + 1); i++) {
		float v[3];
		grid_point(i, v);
		(void)fprintf(p.f, "v %.9g %.9g %.9g\n", (double)v[0], (double)v[1], (double)v[2]);
	}
	for (uint32_t i = 0; i < SIDE * SIDE; i++) {
		uint32_t t[6];
		grid_corners(i, t);
		(void)fprintf(p.f, "# %u\nf %u %u %u\nf %u//1 %u//1 \\\n%u//1\n", i, t[0] + 1,
		              t[1] + 1, t[2] + 1, t[3] + 1, t[4] + 1, t[5] + 1);
	}
	ply_end(&p);
	return p;
}

static ply_file grid_stl(bool text)
{
	stl s = begin_stl("", 2 * SIDE * SIDE, 2 * SIDE * SIDE);
	ply_file p = ply_begin(WH_PLY_ASCII);
	(void)fputs("solid\n", p.f);
	for (uint32_t i = 0; i < 2 * SIDE * SIDE; i++) {
		uint32_t t[6];
		float v[9];
		grid_corners(i / 2, t);
		for (uint32_t k = 0; k < 3; k++) {
			grid_point(t[i % 2 * 3 + k], v + 3 * (size_t)k);
			(void)fprintf(p.f, "vertex %.9g %.9g %.9g\n", (double)v[3 * k],
			              (double)v[3 * k + 1], (double)v[3 * k + 2]);
		}
		(void)fputs("endloop\n", p.f);
		put_facet(&s, v);
	}
	if (!text) {
		rewind(p.f);
		assert_int_equal(ftruncate(fileno(p.f), 0), 0);
		assert_int_equal(fwrite(s.bytes, 1, s.n, p.f), s.n);
	}
	ply_end(&p);
	free(s.bytes);
	return p;
}

/* The grid, whose vertices may come in another order. */
static void assert_grid(const wh_mesh *m)
{
	assert_int_equal(m->nv, (SIDE + 1) * (SIDE + 1));
	assert_int_equal(m->nf, 2 * SIDE * SIDE);
	for (uint32_t i = 0; i < 6 * SIDE * SIDE; i++) {
		uint32_t t[6];
		float v[3];
		grid_corners(i / 6, t);
		grid_point(t[i % 6], v);
		const wh_vec3 p = m->pos[m->tri[i]];
		if ((float)p.x != v[0] || (float)p.y != v[1] || (float)p.z != v[2])
			fail_msg("corner %u is elsewhere", i);
	}
}

static void workers_do_not_change_a_large_file(void **state)
{
	(void)state;
	static const int workers[] = {1, 3};
	for (int kind = 0; kind < 3; kind++) {
		testing_env t;
		wh_mesh first = {0};
		testing_init(&t);
		for (int i = 0; i < 2; i++) {
			wh_mesh m;
			const ply_file p = kind == 0 ? grid_obj() : grid_stl(kind == 1);
			if (ply_load(&t, &p, workers[i], &m, NULL, NULL) != WH_OK)
				fail_msg("%s", t.ctx.err.text);
			assert_grid(&m);
			if (i == 0) {
				first = m;
				continue;
			}
			assert_memory_equal(m.pos, first.pos, m.nv * sizeof *m.pos);
			assert_memory_equal(m.tri, first.tri, 3 * (size_t)m.nf * sizeof *m.tri);
			wh_mesh_free(&t.ctx, &m);
		}
		wh_mesh_free(&t.ctx, &first);
		testing_done(&t);
	}
}

/* A comment or a joined line over the end of a chunk is one line all the same. */
static void lines_may_cross_chunks(void **state)
{
	(void)state;
	enum { CHUNK = WH_LINES_CHUNK };
	static const char tail[] = "\nf 1 2 \\\n3\n";
	for (size_t back = 0; back < sizeof tail + 2; back++) {
		ply_file p = ply_begin(WH_PLY_ASCII);
		const long head = (long)fprintf(p.f, SQUARE "#");
		for (long i = head; i < CHUNK - (long)back; i++)
			(void)fputc('f', p.f);
		(void)fputs(tail, p.f);
		ply_end(&p);
		assert_loads(p, 4, 1, false);
	}
	for (int back = -2; back < 8; back++) { /* OFF's comments, which begin behind a header */
		ply_file p = ply_begin(WH_PLY_ASCII);
		const long head = (long)fprintf(p.f, "OFF\n3 1 0\n");
		(void)fputs("0 0 0\n1 0 0\n0 1 0\n#", p.f);
		for (long i = 19; i < CHUNK - back; i++)
			(void)fputc('3', p.f);
		(void)fputs("\n3 0 1 2\n", p.f);
		assert_true(head > 0);
		ply_end(&p);
		assert_loads(p, 3, 1, false);
	}
}

/* ---- failures ----------------------------------------------------------------------------- */

static ply_file small_file(int kind)
{
	static const char stl_text[] = "solid\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 654321.123\n"
	                               "endloop\n";
	if (kind == 0)
		return ply_write(SQUARE "v 0 0 654321.123\nvn 0 0 1\nf 1 2 3 4\n");
	if (kind == 1)
		return ply_write("OFF\n4 1 0\n0 0 0\n1 0 0\n1 1 0\n0 1 654321.123\n4 0 1 2 3\n");
	return ply_write(stl_text);
}

static void a_failed_allocation_leaves_nothing_behind(void **state)
{
	(void)state;
	for (int kind = 0; kind < 3; kind++) {
		bool done = false;
		for (long n = 1; !done; n++) {
			testing_env t;
			wh_spill spill;
			wh_mesh m;
			const wh_exec ex = {.workers = 1};
			const ply_file p = small_file(kind);
			testing_init(&t);
			assert_int_equal(wh_spill_open(&t.ctx, &spill, "/tmp", NULL), WH_OK);
			t.mem.fail_after = n;
			const wh_code code = wh_load_mesh(&t.ctx, &ex, &spill, p.path,
			                                  WH_FORMAT_ANY, &m, NULL, NULL);
			done = t.mem.fail_after > 0;
			assert_int_equal(code == WH_OK, done);
			t.mem.fail_after = 0;
			if (code == WH_OK)
				wh_mesh_free(&t.ctx, &m);
			assert_int_equal(spill.held, 0);
			wh_spill_close(&t.ctx, &spill);
			(void)unlink(p.path);
			testing_done(&t);
		}
	}
}

/* Random damage: any answer is fine as long as it is one, and no memory is misused. */
static void damaged_bytes_never_crash_the_readers(void **state)
{
	(void)state;
	for (uint64_t seed = 0; seed < 600; seed++) {
		wh_rng r = wh_rng_seed(seed);
		testing_env t;
		wh_mesh m;
		stl s = begin_stl("binary", 1, 1);
		put_facet(&s, (const float[]){0, 0, 0, 1, 0, 0, 1, 1, 0});
		const ply_file p =
		    seed % 4 == 3 ? write_bytes(s.bytes, s.n) : small_file((int)(seed % 4));
		free(s.bytes);
		FILE *f = fopen(p.path, "r+b");
		assert_non_null(f);
		(void)fseek(f, 0, SEEK_END);
		const uint64_t size = (uint64_t)ftell(f);
		for (int i = 0; i < 1 + (int)(seed % 3); i++) {
			(void)fseek(f, (long)(wh_rng_next(&r) % size), SEEK_SET);
			(void)fputc((int)(wh_rng_next(&r) & 0xff), f);
		}
		(void)fclose(f);
		if (seed % 5 == 1)
			assert_int_equal(truncate(p.path, (long)(wh_rng_next(&r) % size)), 0);
		testing_init(&t);
		const wh_code code = ply_load(&t, &p, 1, &m, NULL, NULL);
		if (code == WH_OK)
			wh_mesh_free(&t.ctx, &m);
		else if (code != WH_E_INPUT)
			fail_msg("seed %d: status %d: %s", (int)seed, code, t.ctx.err.text);
		testing_done(&t);
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	    cmocka_unit_test(corners_are_written_in_many_ways),
	    cmocka_unit_test(relative_corners_count_from_their_line),
	    cmocka_unit_test(vertices_may_have_colours_and_weights),
	    cmocka_unit_test(wrong_lines_of_obj_are_named),
	    cmocka_unit_test(digits_tell_floats_from_doubles),
	    cmocka_unit_test(kinds_of_off_are_known),
	    cmocka_unit_test(binary_off_is_big_endian),
	    cmocka_unit_test(wrong_off_is_refused),
	    cmocka_unit_test(equal_corners_are_one_vertex),
	    cmocka_unit_test(wrong_stl_is_refused),
	    cmocka_unit_test(workers_do_not_change_a_large_file),
	    cmocka_unit_test(lines_may_cross_chunks),
	    cmocka_unit_test(a_failed_allocation_leaves_nothing_behind),
	    cmocka_unit_test(damaged_bytes_never_crash_the_readers),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
