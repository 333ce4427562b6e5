/*
 * Every PLY file of the test data: loads with the counts of MANIFEST.tsv, or is refused where the
 * rules of the data's README say so. Skipped when the data is not there.
 */
#define _GNU_SOURCE
#include "ply_files.h"

/* The line's fields, split in place at tabs. */
enum { PATH, SOURCE, LICENCE, VERTICES, FACES, NOTES, FIELDS };

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

static bool is_ply(const char *path)
{
	const size_t n = strlen(path);
	return n > 4 && strcmp(path + n - 4, ".ply") == 0;
}

static bool to_be_refused(char *field[FIELDS])
{
	return strcmp(field[VERTICES], "-") == 0 || strcmp(field[FACES], "0") == 0 ||
	       strstr(field[NOTES], "index_out_of_range") || strstr(field[NOTES], "nonfinite");
}

/* The number behind "word=" in the notes, or behind "N:" in "facesizes=3:5,4:6"; 0 if none. */
static uint64_t note(const char *notes, const char *word)
{
	const char *at = strstr(notes, word);
	return at ? strtoull(at + strlen(word), NULL, 10) : 0;
}

/* Triangles that the faces are cut into, from facesizes. */
static uint64_t triangles(char *field[FIELDS])
{
	const char *at = strstr(field[NOTES], "facesizes=");
	uint64_t sum = 0;
	if (!at)
		return strtoull(field[FACES], NULL, 10);
	at += strlen("facesizes=");
	for (;;) {
		char *end;
		const uint64_t size = strtoull(at, &end, 10);
		const uint64_t count = strtoull(end + 1, &end, 10);
		sum += (size > 2 ? size - 2 : 0) * count;
		if (*end != ',')
			return sum;
		at = end + 1;
	}
}

static void check_counts(const wh_input *in, const wh_mesh *m, uint64_t degenerate,
                         char *field[FIELDS])
{
	const wh_ply *p = &in->ply;
	const uint64_t faces = strtoull(field[FACES], NULL, 10);
	const uint64_t vertices = strtoull(field[VERTICES], NULL, 10);
	/* its lines hold words behind the listed properties, which the manifest's reader took for
	 * the next faces: read by lines, it is the same mesh as fuze.ply */
	const bool longer_lines = strstr(field[PATH], "fuze_ascii.ply") != NULL;
	if (m->nv != vertices)
		fail_msg("%s: %u vertices, not %" PRIu64, field[PATH], m->nv, vertices);
	if (p->face >= 0 && p->elems[p->face].count != faces)
		fail_msg("%s: %" PRIu64 " faces, not %" PRIu64, field[PATH],
		         p->elems[p->face].count, faces);
	const uint64_t want = longer_lines ? faces : triangles(field);
	if (m->nf + degenerate != want)
		fail_msg("%s: %u triangles and %" PRIu64 " degenerate faces, not %" PRIu64,
		         field[PATH], m->nf, degenerate, want);
	if (!longer_lines && degenerate != note(field[NOTES], "degenF="))
		fail_msg("%s: %" PRIu64 " degenerate faces", field[PATH], degenerate);
}

static void check_file(char *field[FIELDS])
{
	testing_env t;
	wh_spill spill;
	wh_input in;
	wh_mesh m;
	uint64_t degenerate;
	const wh_exec ex = {.workers = 2};
	char path[1024];
	(void)snprintf(path, sizeof path, "%s/%s", WHITTLE_DATA, field[PATH]);
	testing_init(&t);
	assert_int_equal(wh_spill_open(&t.ctx, &spill, "/tmp", NULL), WH_OK);
	const wh_code code =
	    wh_load_mesh(&t.ctx, &ex, &spill, path, WH_FORMAT_ANY, &m, NULL, &degenerate);
	const wh_code want = to_be_refused(field) ? WH_E_INPUT : WH_OK;
	if (code != want)
		fail_msg("%s: status %d, not %d: %s", field[PATH], code, want, t.ctx.err.text);
	if (strcmp(field[FACES], "0") == 0 && !strstr(t.ctx.err.text, "no mesh"))
		fail_msg("%s: not 'no mesh': %s", field[PATH], t.ctx.err.text);
	if (code == WH_OK) {
		assert_int_equal(wh_input_open(&t.ctx, &ex, &spill, path, WH_FORMAT_ANY, &in),
		                 WH_OK);
		check_counts(&in, &m, degenerate, field);
		wh_input_close(&t.ctx, &spill, &in);
		wh_mesh_free(&t.ctx, &m);
	}
	wh_spill_close(&t.ctx, &spill);
	testing_done(&t);
}

static void every_file_of_the_manifest_does_what_it_should(void **state)
{
	(void)state;
	char line[16384];
	int files = 0;
	FILE *f = fopen(WHITTLE_DATA "/MANIFEST.tsv", "r");
	assert_non_null(f);
	while (fgets(line, sizeof line, f)) {
		char *field[FIELDS];
		if (!split(line, field) || !is_ply(field[PATH]))
			continue;
		check_file(field);
		files++;
	}
	(void)fclose(f);
	assert_true(files > 0);
}

int main(void)
{
	if (access(WHITTLE_DATA "/MANIFEST.tsv", R_OK) != 0) {
		print_message("no test data in %s: skipped\n", WHITTLE_DATA);
		return 77;
	}
	const struct CMUnitTest tests[] = {
	    cmocka_unit_test(every_file_of_the_manifest_does_what_it_should),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
