/* Binary bodies in place: which are used so, and ranges read from them. */
#define _GNU_SOURCE
#include "ply_files.h"

enum { NV = 1000, NF = 900 };

#define XYZ "property float x\nproperty float y\nproperty float z\n"

static ply_file write_file(const char *vertex, const char *face, int extra)
{
	ply_file p = ply_begin(WH_PLY_LE);
	char text[512];
	(void)snprintf(text, sizeof text, "element vertex %d\n%selement face %d\n%s", NV, vertex,
	               NF, face);
	ply_header(&p, text);
	for (int i = 0; i < NV; i++)
		for (int k = 0; k < 3; k++)
			ply_value(&p, WH_F32, i + 0.25 * k);
	for (int i = 0; i < NF; i++) {
		ply_value(&p, WH_U8, 3);
		for (int k = 0; k < 3; k++)
			ply_value(&p, WH_I32, i + k);
		for (int k = 0; k < extra; k++)
			ply_value(&p, WH_U8, 0);
	}
	ply_end(&p);
	return p;
}

static bool is_direct(const char *vertex, const char *face, int extra)
{
	testing_env t;
	wh_ply p;
	wh_source s;
	ply_file f = write_file(vertex, face, extra);
	testing_init(&t);
	if (wh_ply_open(&t.ctx, &p, f.path) != WH_OK)
		fail_msg("%s", t.ctx.err.text);
	const bool direct = wh_ply_direct(&p, &s);
	wh_ply_close(&t.ctx, &p);
	(void)unlink(f.path);
	testing_done(&t);
	return direct;
}

static void triangles_behind_fixed_vertices_are_used_in_place(void **state)
{
	(void)state;
	static const char list[] = "property list uchar int vertex_indices\n";
	assert_true(is_direct(XYZ, list, 0));
	assert_true(
	    is_direct(XYZ, "property list uchar int vertex_indices\nproperty uchar a\n", 1));
	assert_false(is_direct(XYZ,
	                       "property list uchar int vertex_indices\n"
	                       "property list uchar int more\n",
	                       1));
	assert_false(is_direct(XYZ "property list uchar int more\n", list, 0));
}

static void any_range_can_be_read(void **state)
{
	(void)state;
	testing_env t;
	wh_ply p;
	wh_source s;
	static double xyz[3 * NV];
	static uint64_t ids[3 * NF];
	static unsigned char scratch[16 * NV];
	ply_file f = write_file(XYZ, "property list uchar int vertex_indices\n", 0);
	testing_init(&t);
	assert_int_equal(wh_ply_open(&t.ctx, &p, f.path), WH_OK);
	assert_true(wh_ply_direct(&p, &s));
	assert_int_equal(s.nv, NV);
	assert_int_equal(s.nf, NF);
	assert_true(wh_source_vertex_bytes(&s, NV) <= sizeof scratch);
	for (size_t first = 0; first < NV; first += 77) {
		const size_t n = NV - first < 200 ? NV - first : 200;
		assert_int_equal(wh_source_vertices(&t.ctx, &s, first, n, xyz, scratch), WH_OK);
		for (size_t i = 0; i < 3 * n; i++)
			assert_true(xyz[i] == (double)(first + i / 3) + 0.25 * (double)(i % 3));
	}
	for (size_t first = 0; first < NF; first += 77) {
		const size_t n = NF - first < 200 ? NF - first : 200;
		assert_int_equal(wh_source_triangles(&t.ctx, &s, first, n, ids, scratch), WH_OK);
		for (size_t i = 0; i < 3 * n; i++)
			assert_int_equal(ids[i], first + i / 3 + i % 3);
	}
	/* the file is cut while it is open */
	assert_int_equal(truncate(f.path, 4000), 0);
	assert_int_equal(wh_source_vertices(&t.ctx, &s, 0, 500, xyz, scratch), WH_E_INPUT);
	assert_non_null(strstr(t.ctx.err.text, "byte 4000"));
	wh_ply_close(&t.ctx, &p);
	(void)unlink(f.path);
	testing_done(&t);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	    cmocka_unit_test(triangles_behind_fixed_vertices_are_used_in_place),
	    cmocka_unit_test(any_range_can_be_read),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
