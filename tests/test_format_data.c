/*
 * Every odd file of the test data, of whatever format, and the scans that are no PLY: loads with
 * the counts of MANIFEST.tsv, or is refused where the manifest's own reader failed or the file is
 * wrong. Where whittle rightly differs, the table below says how and why. Prints a line a file.
 * Skipped when the data is not there.
 */
#define _GNU_SOURCE
#include "ply_files.h"

/* The line's fields, split in place at tabs. */
enum { PATH, SOURCE, LICENCE, VERTICES, FACES, NOTES, FIELDS };

/* What is expected of a file. */
typedef struct want {
	bool refused;
	uint64_t vertices, faces; /* faces: triangles, degenerate ones among them */
} want;

static const struct {
	const char *path;
	want want;
	const char *why;
} differing[] = {
    {"odd/assimp/box_longline.obj",
     {false, 8, 478},
     "a polygon of 936 corners has many that repeat the one before them: these are taken out "
     "before it is cut, so that it has fewer triangles"},
    {"odd/meshlab/office_chair.obj",
     {false, 3476, 6877},
     "16 of its polygons have fewer than three different corners: one degenerate face each, and "
     "not two degenerate triangles"},
    {"odd/numpy-stl/stl_binary_HalfDonut.stl",
     {false, 144, 288},
     "binary, though its header begins with 'solid', which the manifest's reader believed"},
    {"odd/openscad/toomanyvertices.stl",
     {true, 0, 0},
     "a facet has four vertices; the manifest's reader went on three by three, out of step"},
    {"odd/stl-models/fourVertices.ascii.stl",
     {true, 0, 0},
     "a facet has four vertices; the manifest's reader went on three by three, out of step"},
    {"odd/trimesh/fuze_ascii.ply",
     {false, 502, 1000},
     "lines hold words behind the listed properties, which the manifest's reader took for the "
     "next faces: read by lines, it is the same mesh as fuze.ply"},
    {"odd/trimesh/wallhole.obj",
     {false, 92, 66},
     "backslashes join lines, which the manifest's reader did not know"},
};

static bool split(char *line, char *field[FIELDS])
{
	line[strcspn(line, "\n")] = '\0';
	for (int i = 0; i < FIELDS; i++) {
		field[i] = strsep(&line, "\t");
		if (!field[i])
			return false;
	}
	return true;
}

static bool concerns(const char *path)
{
	const wh_format f = wh_format_of_name(path);
	return strncmp(path, "odd/", 4) == 0 || f == WH_FORMAT_OBJ || f == WH_FORMAT_OFF;
}

/* Triangles that the faces are cut into, from "facesizes=3:5,4:6" in the notes. */
static uint64_t triangles(char *field[FIELDS])
{
	const char *at = strstr(field[NOTES], "facesizes=");
	uint64_t sum = 0;
	if (!at)
		return strtoull(field[FACES], NULL, 10);
	for (at += strlen("facesizes=");; at++) {
		char *end;
		const uint64_t size = strtoull(at, &end, 10);
		const uint64_t count = strtoull(end + 1, &end, 10);
		sum += (size > 2 ? size - 2 : 0) * count;
		if (*end != ',')
			return sum;
		at = end;
	}
}

static want wanted(char *field[FIELDS])
{
	for (size_t i = 0; i < sizeof differing / sizeof differing[0]; i++)
		if (strcmp(field[PATH], differing[i].path) == 0)
			return differing[i].want;
	return (want){.refused = strcmp(field[VERTICES], "-") == 0 ||
	                         strcmp(field[FACES], "0") == 0 ||
	                         strstr(field[NOTES], "index_out_of_range") ||
	                         strstr(field[NOTES], "nonfinite"),
	              .vertices = strtoull(field[VERTICES], NULL, 10),
	              .faces = triangles(field)};
}

/* The message must name the file and say more than that. */
static void check_refusal(const testing_env *t, wh_code code, const char *path)
{
	if (code != WH_E_INPUT || !strstr(t->ctx.err.text, path))
		fail_msg("%s: not refused as bad input: %d %s", path, code, t->ctx.err.text);
}

static void check_file(char *field[FIELDS])
{
	testing_env t;
	wh_spill spill;
	wh_mesh m;
	uint64_t degenerate;
	const wh_exec ex = {.workers = 2};
	const want w = wanted(field);
	char path[1024];
	(void)snprintf(path, sizeof path, "%s/%s", WHITTLE_DATA, field[PATH]);
	testing_init(&t);
	assert_int_equal(wh_spill_open(&t.ctx, &spill, "/tmp", NULL), WH_OK);
	const wh_code code =
	    wh_load_mesh(&t.ctx, &ex, &spill, path, WH_FORMAT_ANY, &m, NULL, &degenerate);
	if (w.refused) {
		print_message("%s: %s\n", field[PATH], t.ctx.err.text);
		check_refusal(&t, code, path);
	} else {
		if (code != WH_OK)
			fail_msg("%s: status %d: %s", field[PATH], code, t.ctx.err.text);
		print_message("%s: %u vertices, %" PRIu64 " faces\n", field[PATH], m.nv,
		              m.nf + degenerate);
		if (m.nv != w.vertices || m.nf + degenerate != w.faces)
			fail_msg("%s: %u vertices and %" PRIu64 " faces instead of %" PRIu64
			         " and %" PRIu64,
			         field[PATH], m.nv, m.nf + degenerate, w.vertices, w.faces);
		wh_mesh_free(&t.ctx, &m);
	}
	assert_int_equal(spill.held, 0);
	wh_spill_close(&t.ctx, &spill);
	testing_done(&t);
}

static void every_odd_file_does_what_it_should(void **state)
{
	(void)state;
	char line[16384];
	int files = 0;
	FILE *f = fopen(WHITTLE_DATA "/MANIFEST.tsv", "r");
	assert_non_null(f);
	while (fgets(line, sizeof line, f)) {
		char *field[FIELDS];
		if (!split(line, field) || !concerns(field[PATH]))
			continue;
		check_file(field);
		files++;
	}
	(void)fclose(f);
	assert_true(files > 300);
}

int main(void)
{
	if (access(WHITTLE_DATA "/MANIFEST.tsv", R_OK) != 0) {
		print_message("no test data in %s: skipped\n", WHITTLE_DATA);
		return 77;
	}
	const struct CMUnitTest tests[] = {
	    cmocka_unit_test(every_odd_file_does_what_it_should),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
