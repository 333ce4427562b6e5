/* What is written is small, stable, and reads back to the same bits. */
#define _GNU_SOURCE
#include "ply_files.h"

#include "io/outfile.h"

static const double xyz[] = {0.1, -2e-30, 3e30, 1e-45, 123456789, -0.0, 1.0 / 3, 5, 7};
static const uint32_t tri[] = {0, 1, 2, 2, 1, 0};

static void write_mesh(const char *path, wh_ply_style style)
{
	testing_env t;
	wh_outfile *o;
	testing_init(&t);
	assert_int_equal(wh_outfile_open(&t.ctx, &o, path, true), WH_OK);
	assert_int_equal(wh_ply_write_header(&t.ctx, o, style, 3, 2), WH_OK);
	assert_int_equal(wh_ply_write_vertices(&t.ctx, o, style, xyz, 3), WH_OK);
	assert_int_equal(wh_ply_write_triangles(&t.ctx, o, style, tri, NULL, 2), WH_OK);
	assert_int_equal(wh_outfile_commit(&t.ctx, &o), WH_OK);
	testing_done(&t);
}

static void what_is_written_reads_back(void **state)
{
	(void)state;
	for (int k = 0; k < 4; k++) {
		const wh_ply_style style = {.ascii = k % 2, .is_double = k / 2};
		testing_env t;
		wh_mesh m;
		bool is_double;
		ply_file p = ply_write("");
		write_mesh(p.path, style);
		testing_init(&t);
		if (ply_load(&t, &p, 1, &m, &is_double, NULL) != WH_OK)
			fail_msg("%s", t.ctx.err.text);
		assert_int_equal(is_double, style.is_double);
		assert_int_equal(m.nv, 3);
		for (size_t i = 0; i < 9; i++) {
			const double got = (&m.pos[i / 3].x)[i % 3];
			const double want = style.is_double ? xyz[i] : (double)(float)xyz[i];
			assert_memory_equal(&got, &want, sizeof got);
		}
		assert_int_equal(m.nf, 2);
		assert_memory_equal(m.tri, tri, sizeof tri);
		wh_mesh_free(&t.ctx, &m);
		testing_done(&t);
	}
}

static void the_bytes_are_exactly_these(void **state)
{
	(void)state;
	static const char want[] = "ply\nformat binary_little_endian 1.0\ncomment made by whittle\n"
	                           "element vertex 3\nproperty float x\nproperty float y\n"
	                           "property float z\nelement face 2\n"
	                           "property list uchar int vertex_indices\nend_header\n";
	static const unsigned char last[] = {3, 2, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0};
	char got[1024];
	ply_file p = ply_write("");
	write_mesh(p.path, (wh_ply_style){0});
	FILE *f = fopen(p.path, "rb");
	assert_non_null(f);
	const size_t n = fread(got, 1, sizeof got, f);
	(void)fclose(f);
	(void)unlink(p.path);
	assert_int_equal(n, sizeof want - 1 + 36 + 26);
	assert_memory_equal(got, want, sizeof want - 1);
	assert_memory_equal(got + n - sizeof last, last, sizeof last);
}

static wh_code header_for(uint64_t nv, const char *type)
{
	testing_env t;
	wh_outfile *o;
	char text[1024] = "";
	ply_file p = ply_write("");
	testing_init(&t);
	assert_int_equal(wh_outfile_open(&t.ctx, &o, p.path, true), WH_OK);
	const wh_code code = wh_ply_write_header(&t.ctx, o, (wh_ply_style){0}, nv, 1);
	assert_int_equal(wh_outfile_commit(&t.ctx, &o), WH_OK);
	FILE *f = fopen(p.path, "rb");
	assert_non_null(f);
	(void)!fread(text, 1, sizeof text - 1, f);
	(void)fclose(f);
	(void)unlink(p.path);
	if (code == WH_OK && !strstr(text, type))
		fail_msg("no '%s' in %s", type, text);
	testing_done(&t);
	return code;
}

static void indices_are_int_then_uint_then_refused(void **state)
{
	(void)state;
	assert_int_equal(header_for(0x7fffffff, "uchar int v"), WH_OK);
	assert_int_equal(header_for(0x80000000u, "uchar uint v"), WH_OK);
	assert_int_equal(header_for(0xffffffffu, "uchar uint v"), WH_OK);
	assert_int_equal(header_for(0x100000000u, ""), WH_E_USAGE);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	    cmocka_unit_test(what_is_written_reads_back),
	    cmocka_unit_test(the_bytes_are_exactly_these),
	    cmocka_unit_test(indices_are_int_then_uint_then_refused),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
