/* An output appears whole or not at all, and replaces nothing unasked. */
#define _GNU_SOURCE
#include "testing.h"

#include "io/outfile.h"

#include <dirent.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

typedef struct fixture {
	testing_env t;
	char dir[64];
	char path[128];
} fixture;

static int setup(void **state)
{
	fixture *f = calloc(1, sizeof *f);
	testing_init(&f->t);
	(void)snprintf(f->dir, sizeof f->dir, "/tmp/whittle-test-XXXXXX");
	assert_non_null(mkdtemp(f->dir));
	(void)snprintf(f->path, sizeof f->path, "%s/out.ply", f->dir);
	*state = f;
	return 0;
}

static int files_in(const char *dir)
{
	DIR *d = opendir(dir);
	assert_non_null(d);
	int n = 0;
	while (readdir(d))
		n++;
	closedir(d);
	return n - 2;
}

static int teardown(void **state)
{
	fixture *f = *state;
	testing_done(&f->t);
	char command[128];
	(void)snprintf(command, sizeof command, "rm -r %s", f->dir);
	assert_int_equal(system(command), 0);
	free(f);
	return 0;
}

static void put(const char *path, const char *text)
{
	FILE *out = fopen(path, "w");
	assert_non_null(out);
	assert_true(fputs(text, out) >= 0);
	assert_int_equal(fclose(out), 0);
}

static void assert_holds(const char *path, const char *text)
{
	char got[256] = "";
	FILE *in = fopen(path, "r");
	assert_non_null(in);
	(void)!fread(got, 1, sizeof got - 1, in);
	(void)fclose(in);
	assert_string_equal(got, text);
}

static void an_output_appears_at_commit_only(void **state)
{
	fixture *f = *state;
	wh_outfile *o;
	assert_int_equal(wh_outfile_open(&f->t.ctx, &o, f->path, false), WH_OK);
	assert_int_equal(wh_outfile_write(&f->t.ctx, o, "hello", 5), WH_OK);
	assert_int_not_equal(access(f->path, F_OK), 0);
	assert_int_equal(wh_outfile_bytes(o), 5);
	assert_int_equal(wh_outfile_commit(&f->t.ctx, &o), WH_OK);
	assert_null(o);
	assert_holds(f->path, "hello");
	assert_int_equal(files_in(f->dir), 1);
}

static void an_abandoned_output_leaves_nothing(void **state)
{
	fixture *f = *state;
	wh_outfile *o;
	assert_int_equal(wh_outfile_open(&f->t.ctx, &o, f->path, false), WH_OK);
	assert_int_equal(wh_outfile_write(&f->t.ctx, o, "hello", 5), WH_OK);
	wh_outfile_abort(&f->t.ctx, &o);
	assert_int_equal(files_in(f->dir), 0);
}

static void an_existing_file_is_replaced_by_force_only_and_keeps_its_mode(void **state)
{
	fixture *f = *state;
	wh_outfile *o;
	put(f->path, "old");
	assert_int_equal(chmod(f->path, 0640), 0);
	assert_int_equal(wh_outfile_open(&f->t.ctx, &o, f->path, false), WH_E_USAGE);
	assert_null(o);
	assert_non_null(strstr(f->t.ctx.err.text, "-f"));
	f->t.ctx.err = (wh_error){0};
	assert_int_equal(wh_outfile_open(&f->t.ctx, &o, f->path, true), WH_OK);
	assert_int_equal(wh_outfile_write(&f->t.ctx, o, "new", 3), WH_OK);
	assert_holds(f->path, "old");
	assert_int_equal(wh_outfile_commit(&f->t.ctx, &o), WH_OK);
	assert_holds(f->path, "new");
	struct stat st;
	assert_int_equal(stat(f->path, &st), 0);
	assert_int_equal(st.st_mode & 0777, 0640);
}

static void a_file_that_appears_meanwhile_is_kept(void **state)
{
	fixture *f = *state;
	wh_outfile *o;
	assert_int_equal(wh_outfile_open(&f->t.ctx, &o, f->path, false), WH_OK);
	put(f->path, "theirs");
	assert_int_equal(wh_outfile_commit(&f->t.ctx, &o), WH_E_USAGE);
	assert_holds(f->path, "theirs");
	assert_int_equal(files_in(f->dir), 1);
}

static void a_symbolic_link_stays_a_link(void **state)
{
	fixture *f = *state;
	wh_outfile *o;
	char link[160];
	(void)snprintf(link, sizeof link, "%s/link.ply", f->dir);
	assert_int_equal(symlink("out.ply", link), 0); /* leads to nothing yet */
	assert_int_equal(wh_outfile_open(&f->t.ctx, &o, link, false), WH_OK);
	assert_int_equal(wh_outfile_write(&f->t.ctx, o, "x", 1), WH_OK);
	assert_int_equal(wh_outfile_commit(&f->t.ctx, &o), WH_OK);
	struct stat st;
	assert_int_equal(lstat(link, &st), 0);
	assert_true(S_ISLNK(st.st_mode));
	assert_holds(f->path, "x");
}

static void devices_are_written_directly(void **state)
{
	fixture *f = *state;
	wh_outfile *o;
	assert_int_equal(wh_outfile_open(&f->t.ctx, &o, "/dev/null", false), WH_OK);
	assert_int_equal(wh_outfile_write(&f->t.ctx, o, "x", 1), WH_OK);
	assert_int_equal(wh_outfile_commit(&f->t.ctx, &o), WH_OK);
	struct stat st;
	assert_int_equal(stat("/dev/null", &st), 0);
	assert_true(S_ISCHR(st.st_mode));

	assert_int_equal(wh_outfile_open(&f->t.ctx, &o, "/dev/full", false), WH_OK);
	assert_int_equal(wh_outfile_write(&f->t.ctx, o, "x", 1), WH_OK);
	assert_int_equal(wh_outfile_commit(&f->t.ctx, &o), WH_E_RUN);
	assert_non_null(strstr(f->t.ctx.err.text, "no space left"));
}

static void a_folder_is_refused(void **state)
{
	fixture *f = *state;
	wh_outfile *o;
	assert_int_equal(wh_outfile_open(&f->t.ctx, &o, f->dir, true), WH_E_USAGE);
	assert_null(o);
}

static void a_missing_folder_is_named(void **state)
{
	fixture *f = *state;
	wh_outfile *o;
	assert_int_equal(wh_outfile_open(&f->t.ctx, &o, "/nowhere/at/all.ply", false), WH_E_RUN);
	assert_non_null(strstr(f->t.ctx.err.text, "/nowhere/at"));
}

static void the_longest_file_name_works(void **state)
{
	fixture *f = *state;
	wh_outfile *o;
	char path[400];
	(void)snprintf(path, sizeof path, "%s/%0255d", f->dir, 7);
	assert_int_equal(wh_outfile_open(&f->t.ctx, &o, path, false), WH_OK);
	assert_int_equal(wh_outfile_commit(&f->t.ctx, &o), WH_OK);
	assert_int_equal(access(path, F_OK), 0);
}

/* XXH3_128bits of 3,000,000 bytes i % 251, written in pieces of many sizes. */
static void the_checksum_does_not_depend_on_the_pieces(void **state)
{
	fixture *f = *state;
	enum { N = 3000000 };
	unsigned char *bytes = malloc(N);
	for (size_t i = 0; i < N; i++)
		bytes[i] = (unsigned char)(i % 251);
	char hex[2][33];
	const size_t piece[2] = {977, N};
	for (int k = 0; k < 2; k++) {
		wh_outfile *o;
		assert_int_equal(wh_outfile_open(&f->t.ctx, &o, f->path, true), WH_OK);
		for (size_t at = 0; at < N; at += piece[k]) {
			const size_t n = N - at < piece[k] ? N - at : piece[k];
			assert_int_equal(wh_outfile_write(&f->t.ctx, o, bytes + at, n), WH_OK);
		}
		wh_outfile_checksum(o, hex[k]);
		assert_int_equal(wh_outfile_bytes(o), N);
		assert_int_equal(wh_outfile_commit(&f->t.ctx, &o), WH_OK);
	}
	assert_string_equal(hex[0], hex[1]);
	assert_int_equal(strlen(hex[0]), 32);
	free(bytes);
}

#define WITH_FOLDER(test) cmocka_unit_test_setup_teardown(test, setup, teardown)

int main(void)
{
	const struct CMUnitTest tests[] = {
	    WITH_FOLDER(an_output_appears_at_commit_only),
	    WITH_FOLDER(an_abandoned_output_leaves_nothing),
	    WITH_FOLDER(an_existing_file_is_replaced_by_force_only_and_keeps_its_mode),
	    WITH_FOLDER(a_file_that_appears_meanwhile_is_kept),
	    WITH_FOLDER(a_symbolic_link_stays_a_link),
	    WITH_FOLDER(devices_are_written_directly),
	    WITH_FOLDER(a_folder_is_refused),
	    WITH_FOLDER(a_missing_folder_is_named),
	    WITH_FOLDER(the_longest_file_name_works),
	    WITH_FOLDER(the_checksum_does_not_depend_on_the_pieces),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
