/* Temporary files: counted while they are there, and gone afterwards. */
#define _GNU_SOURCE
#include "testing.h"

#include "exec/exec.h"
#include "io/spill.h"

#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

typedef struct fixture {
	testing_env t;
	wh_spill spill;
} fixture;

static int setup(void **state)
{
	fixture *f = calloc(1, sizeof *f);
	testing_init(&f->t);
	assert_int_equal(wh_spill_open(&f->t.ctx, &f->spill, "/tmp", NULL), WH_OK);
	*state = f;
	return 0;
}

static int teardown(void **state)
{
	fixture *f = *state;
	char dir[256];
	(void)snprintf(dir, sizeof dir, "%s", f->spill.dir);
	wh_spill_close(&f->t.ctx, &f->spill);
	assert_int_not_equal(access(dir, F_OK), 0);
	testing_done(&f->t);
	free(f);
	return 0;
}

static void bytes_are_counted_until_the_file_is_removed(void **state)
{
	fixture *f = *state;
	wh_ctx *c = &f->t.ctx;
	const int fd = wh_spill_create(c, &f->spill, "a.part");
	assert_true(fd >= 0);
	assert_int_equal(wh_spill_pwrite(c, &f->spill, fd, "12345678", 8, 0), WH_OK);
	assert_int_equal(wh_spill_pwrite(c, &f->spill, fd, "xy", 2, 3), WH_OK); /* no growth */
	assert_int_equal(f->spill.held, 8);
	assert_int_equal(f->spill.bytes_written, 10);
	assert_int_equal(wh_spill_rename(c, &f->spill, "a.part", "a"), WH_OK);
	char got[9] = "";
	assert_int_equal(wh_spill_pread(c, &f->spill, fd, got, 8, 0), WH_OK);
	assert_string_equal(got, "123xy678");
	close(fd);
	wh_spill_remove(&f->spill, "a");
	wh_spill_remove(&f->spill, "a");
	assert_int_equal(f->spill.held, 0);
	assert_int_equal(f->spill.peak, 8);
}

static void making_or_renaming_over_a_file_forgets_its_bytes(void **state)
{
	fixture *f = *state;
	wh_ctx *c = &f->t.ctx;
	for (int i = 0; i < 2; i++) {
		const int fd = wh_spill_create(c, &f->spill, "a.part");
		assert_int_equal(wh_spill_pwrite(c, &f->spill, fd, "1234", 4, 0), WH_OK);
		assert_int_equal(wh_spill_rename(c, &f->spill, "a.part", "a"), WH_OK);
		assert_int_equal(f->spill.held, 4);
		close(fd);
	}
	close(wh_spill_create(c, &f->spill, "a"));
	assert_int_equal(f->spill.held, 0);
}

static void a_short_file_is_reported_as_damaged(void **state)
{
	fixture *f = *state;
	wh_ctx *c = &f->t.ctx;
	char got[8];
	const int fd = wh_spill_create(c, &f->spill, "a");
	assert_int_equal(wh_spill_pwrite(c, &f->spill, fd, "1234", 4, 0), WH_OK);
	assert_int_equal(wh_spill_pread(c, &f->spill, fd, got, 5, 0), WH_E_RUN);
	assert_non_null(strstr(c->err.text, "damaged"));
	close(fd);
}

/* Disks that fill up in the middle of a run are in test_stop.c. */
static void a_failed_write_names_the_file_and_suggests_another_place(void **state)
{
	fixture *f = *state;
	const int fd = open("/dev/full", O_RDWR | O_CLOEXEC);
	assert_int_equal(wh_spill_pwrite(&f->t.ctx, &f->spill, fd, "1234", 4, 0), WH_E_RUN);
	/* it cannot be made longer, which fails first */
	assert_non_null(strstr(f->t.ctx.err.text, "/dev/full"));
	assert_non_null(strstr(f->t.ctx.err.text, "--temp-dir"));
	close(fd);
}

static void a_missing_file_is_named(void **state)
{
	fixture *f = *state;
	assert_int_equal(wh_spill_read(&f->t.ctx, &f->spill, "absent"), -1);
	assert_non_null(strstr(f->t.ctx.err.text, "absent"));
}

static void a_missing_place_is_named_with_the_remedy(void **state)
{
	fixture *f = *state;
	wh_spill s;
	assert_int_equal(wh_spill_open(&f->t.ctx, &s, "/nowhere", NULL), WH_E_RUN);
	assert_non_null(strstr(f->t.ctx.err.text, "/nowhere"));
	assert_non_null(strstr(f->t.ctx.err.text, "--temp-dir"));
	wh_spill_close(&f->t.ctx, &s);
}

static void a_scratch_file_has_no_name_and_is_counted_until_closed(void **state)
{
	fixture *f = *state;
	const int a = wh_spill_scratch(&f->t.ctx, &f->spill);
	const int b = wh_spill_scratch(&f->t.ctx, &f->spill);
	assert_int_equal(wh_spill_pwrite(&f->t.ctx, &f->spill, a, "1234", 4, 0), WH_OK);
	assert_int_equal(wh_spill_pwrite(&f->t.ctx, &f->spill, b, "56", 2, 0), WH_OK);
	assert_int_equal(f->spill.held, 6);
	wh_spill_close_scratch(&f->spill, a);
	assert_int_equal(f->spill.held, 2);
	wh_spill_close_scratch(&f->spill, b);
	assert_int_equal(f->spill.held, 0);
}

typedef struct sharing {
	wh_spill *spill;
	int fd;
} sharing;

static wh_code write_block(wh_ctx *c, void *arg, int64_t index, int worker)
{
	sharing *s = arg;
	(void)worker;
	/* from the end to the beginning and back: extends the file in every order */
	const uint64_t at = (uint64_t)(index % 2 ? index : 400 - index) * 100;
	char block[100];
	memset(block, (int)index % 127, sizeof block);
	return wh_spill_pwrite(c, s->spill, s->fd, block, sizeof block, at);
}

static void threads_that_extend_one_file_count_it_once(void **state)
{
	fixture *f = *state;
	sharing s = {&f->spill, wh_spill_create(&f->t.ctx, &f->spill, "a")};
	const wh_exec ex = {.workers = 4};
	assert_int_equal(wh_exec_for(&f->t.ctx, &ex, 401, write_block, &s), WH_OK);
	assert_int_equal(f->spill.held, 40100);
	close(s.fd);
	wh_spill_remove(&f->spill, "a");
	assert_int_equal(f->spill.held, 0);
}

#define WITH_SPILL(test) cmocka_unit_test_setup_teardown(test, setup, teardown)

int main(void)
{
	const struct CMUnitTest tests[] = {
	    WITH_SPILL(bytes_are_counted_until_the_file_is_removed),
	    WITH_SPILL(making_or_renaming_over_a_file_forgets_its_bytes),
	    WITH_SPILL(a_short_file_is_reported_as_damaged),
	    WITH_SPILL(a_failed_write_names_the_file_and_suggests_another_place),
	    WITH_SPILL(a_missing_file_is_named),
	    WITH_SPILL(a_missing_place_is_named_with_the_remedy),
	    WITH_SPILL(a_scratch_file_has_no_name_and_is_counted_until_closed),
	    WITH_SPILL(threads_that_extend_one_file_count_it_once),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
