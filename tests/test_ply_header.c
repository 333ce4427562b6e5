/* Headers: what they may look like, and how damage is told. */
#define _GNU_SOURCE
#include "ply_files.h"

#define VERTEX "element vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
#define FACE "element face 1\nproperty list uchar int vertex_indices\n"
#define BODY "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"

static void assert_loads(ply_file p, uint32_t nv, uint32_t nf)
{
	testing_env t;
	wh_mesh m;
	testing_init(&t);
	if (ply_load(&t, &p, 2, &m, NULL, NULL) != WH_OK)
		fail_msg("%s", t.ctx.err.text);
	assert_int_equal(m.nv, nv);
	assert_int_equal(m.nf, nf);
	wh_mesh_free(&t.ctx, &m);
	testing_done(&t);
}

static void comments_unknown_lines_and_blanks_are_passed_over(void **state)
{
	(void)state;
	assert_loads(ply_write("ply\nformat ascii 1.0\ncomment element vertex 9\nobj_info x\n"
	                       "remark y\n\n\t" VERTEX "comment z\n" FACE "  end_header \n" BODY),
	             3, 1);
}

static void lines_may_end_in_three_ways(void **state)
{
	(void)state;
	static const int eols[] = {'\n', '\r', 0};
	for (int k = 0; k < 3; k++) {
		for (int format = WH_PLY_ASCII; format <= WH_PLY_BE; format++) {
			ply_file p = ply_begin((wh_ply_format)format);
			p.eol = eols[k];
			/* the first body byte is 10: behind a lone CR it must not be taken for LF
			 */
			ply_header(&p, "element first 1\nproperty uchar ten\n" VERTEX FACE);
			ply_value(&p, WH_U8, 10);
			ply_item(&p);
			for (int i = 0; i < 9; i++) {
				ply_value(&p, WH_F32, i == 3 || i == 7);
				if (i % 3 == 2)
					ply_item(&p);
			}
			ply_value(&p, WH_U8, 3);
			for (int i = 0; i < 3; i++)
				ply_value(&p, WH_I32, i);
			ply_item(&p);
			ply_end(&p);
			assert_loads(p, 3, 1);
		}
	}
}

static void a_file_that_is_no_ply_is_told(void **state)
{
	(void)state;
	ply_file p = ply_write("square cube\n");
	ply_assert_refused(&p, "no PLY, OBJ, OFF or STL", "--from", NULL);
	p = ply_write("");
	ply_assert_refused(&p, "empty", NULL);
	p = ply_write("plywood\n");
	ply_assert_refused(&p, "no PLY, OBJ, OFF or STL", NULL);
}

static void damaged_header_lines_are_named(void **state)
{
	(void)state;
	static const struct {
		const char *text, *line, *word;
	} bad[] = {
	    {"ply\nformat ascii 1.0\n" VERTEX, "line 7", "end_header"},
	    {"ply\n" VERTEX FACE "end_header\n" BODY, "line 8", "format"},
	    {"ply\nformat binary_middle_endian 1.0\nend_header\n", "line 2", "middle"},
	    {"ply\nformat ascii 1.0\nproperty float x\nend_header\n", "line 3", "property"},
	    {"ply\nformat ascii 1.0\nelement vertex -3\nend_header\n", "line 3", "-3"},
	    {"ply\nformat ascii 1.0\nelement vertex 18446744073709551616\nend_header\n", "line 3",
	     "18446744073709551616"},
	    {"ply\nformat ascii 1.0\nelement vertex\nend_header\n", "line 3", "count"},
	    {"ply\nformat ascii 1.0\nelement vertex 1\nproperty quad x\nend_header\n", "line 4",
	     "quad"},
	    {"ply\nformat ascii 1.0\nelement face 1\nproperty list float int v\nend_header\n",
	     "line 4", "float"},
	    {"ply\nformat ascii 1.0\nelement face 1\nproperty list uchar int\nend_header\n",
	     "line 4", "property"},
	};
	for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++) {
		ply_file p = ply_write(bad[i].text);
		ply_assert_refused(&p, bad[i].line, bad[i].word, NULL);
	}
}

static void counts_are_held_against_the_size_of_the_file(void **state)
{
	(void)state;
	static const char *const formats[] = {"ascii", "binary_little_endian"};
	static const char *const counts[] = {"4000000000", "18446744073709551615",
	                                     "6148914691236517206"};
	for (int f = 0; f < 2; f++) {
		for (int i = 0; i < 3; i++) {
			char text[512];
			(void)snprintf(text, sizeof text,
			               "ply\nformat %s 1.0\nelement vertex %s\nproperty float x\n"
			               "property float y\nproperty float z\n" FACE
			               "end_header\n" BODY,
			               formats[f], counts[i]);
			ply_file p = ply_write(text);
			ply_assert_refused(&p, "line 3", "vertex", counts[i], "cut short", NULL);
		}
	}
}

/* An element without properties takes no room, however many items it has. */
static void empty_items_cost_nothing(void **state)
{
	(void)state;
	assert_loads(
	    ply_write("ply\nformat ascii 1.0\nelement nothing 18446744073709551615\n" VERTEX
	              "element more 99999999999\n" FACE "end_header\n" BODY),
	    3, 1);
}

static void what_is_not_a_file_is_refused(void **state)
{
	(void)state;
	static const struct {
		const char *path, *word;
	} bad[] = {{"/tmp", "directory"}, {"/nowhere.ply", "No such"}, {"/dev/null", "device"}};
	for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++) {
		testing_env t;
		wh_ply p;
		testing_init(&t);
		assert_int_equal(wh_ply_open(&t.ctx, &p, bad[i].path), WH_E_INPUT);
		assert_non_null(strstr(t.ctx.err.text, bad[i].word));
		assert_non_null(strstr(t.ctx.err.text, bad[i].path));
		testing_done(&t);
	}
}

static void a_header_longer_than_a_read_is_followed(void **state)
{
	(void)state;
	ply_file p = ply_begin(WH_PLY_ASCII);
	ply_text(&p, "ply\nformat ascii 1.0\n");
	for (int i = 0; i < 5000; i++)
		ply_text(&p, "comment one of very many lines of comment\n");
	ply_text(&p, VERTEX FACE "end_header\n" BODY);
	ply_end(&p);
	assert_loads(p, 3, 1);
}

static void a_failed_allocation_leaves_nothing_behind(void **state)
{
	(void)state;
	ply_file p = ply_write("ply\nformat ascii 1.0\n" VERTEX FACE "end_header\n" BODY);
	for (long after = 1;; after++) {
		testing_env t;
		wh_ply ply;
		testing_init(&t);
		t.mem.fail_after = after;
		const wh_code code = wh_ply_open(&t.ctx, &ply, p.path);
		if (code == WH_OK)
			wh_ply_close(&t.ctx, &ply);
		testing_done(&t);
		if (code == WH_OK)
			break;
		assert_int_equal(code, WH_E_RUN);
	}
	(void)unlink(p.path);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	    cmocka_unit_test(comments_unknown_lines_and_blanks_are_passed_over),
	    cmocka_unit_test(lines_may_end_in_three_ways),
	    cmocka_unit_test(a_file_that_is_no_ply_is_told),
	    cmocka_unit_test(damaged_header_lines_are_named),
	    cmocka_unit_test(counts_are_held_against_the_size_of_the_file),
	    cmocka_unit_test(empty_items_cost_nothing),
	    cmocka_unit_test(what_is_not_a_file_is_refused),
	    cmocka_unit_test(a_header_longer_than_a_read_is_followed),
	    cmocka_unit_test(a_failed_allocation_leaves_nothing_behind),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
