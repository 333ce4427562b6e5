/* Records come out by their numbers, equal ones as they went in, however much memory there is. */
#define _XOPEN_SOURCE 700
#include "testing.h"

#include "base/rng.h"
#include "io/runs.h"

#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

enum { RECORD = 13 }; /* a number, and which one it was: nothing is aligned */

typedef struct fixture {
	testing_env t;
	wh_spill spill;
	wh_runs runs;
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
	wh_runs_close(&f->t.ctx, &f->runs);
	assert_int_equal(f->spill.held, 0);
	wh_spill_close(&f->t.ctx, &f->spill);
	testing_done(&f->t);
	free(f);
	return 0;
}

/* n records, of numbers below `values`. */
static void put_all(fixture *f, size_t bytes, uint32_t n, uint64_t values)
{
	wh_rng random = wh_rng_seed(7);
	assert_int_equal(wh_runs_open(&f->t.ctx, &f->runs, &f->spill, RECORD, bytes, n), WH_OK);
	for (uint32_t i = 0; i < n; i++) {
		const uint64_t number = wh_rng_next(&random) % values;
		uint8_t *to = wh_runs_room(&f->t.ctx, &f->runs);
		assert_non_null(to);
		memcpy(to, &number, sizeof number);
		memcpy(to + sizeof number, &i, sizeof i);
	}
	assert_int_equal(wh_runs_end(&f->t.ctx, &f->runs), WH_OK);
}

static void are_in_order(fixture *f, uint32_t n)
{
	uint64_t last = 0;
	uint32_t last_i = 0, i;
	for (uint32_t k = 0; k < n; k++) {
		const uint8_t *record = wh_runs_next(&f->t.ctx, &f->runs);
		assert_non_null(record);
		const uint64_t number = wh_runs_number(record);
		memcpy(&i, record + sizeof number, sizeof i);
		assert_true(k == 0 || number > last || (number == last && i > last_i));
		last = number;
		last_i = i;
	}
	assert_null(wh_runs_next(&f->t.ctx, &f->runs));
	assert_int_equal(f->t.ctx.err.code, WH_OK);
}

static void all_come_out_in_order_and_twice(void **state)
{
	fixture *f = *state;
	static const uint32_t counts[] = {0, 1, 4096, 4097, 300000};
	static const uint64_t values[] = {3, 100000, UINT64_MAX};
	for (size_t k = 0; k < sizeof counts / sizeof *counts; k++)
		for (size_t v = 0; v < sizeof values / sizeof *values; v++)
			for (size_t bytes = 1; bytes < (size_t)1 << 26; bytes <<= 25) {
				put_all(f, bytes, counts[k], values[v]);
				are_in_order(f, counts[k]);
				assert_int_equal(wh_runs_rewind(&f->t.ctx, &f->runs), WH_OK);
				are_in_order(f, counts[k]);
				assert_true((f->runs.runs > 1) == (bytes == 1 && counts[k] > 4096));
				wh_runs_close(&f->t.ctx, &f->runs);
			}
}

static void a_file_that_lost_its_end_is_found(void **state)
{
	fixture *f = *state;
	put_all(f, 1, 20000, 1000);
	assert_int_equal(ftruncate(f->runs.fd, 20000), 0);
	while (wh_runs_next(&f->t.ctx, &f->runs))
		continue;
	assert_int_equal(f->t.ctx.err.code, WH_E_RUN);
	atomic_store(&f->spill.held, 20000); /* what is left of the file */
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	    cmocka_unit_test_setup_teardown(all_come_out_in_order_and_twice, setup, teardown),
	    cmocka_unit_test_setup_teardown(a_file_that_lost_its_end_is_found, setup, teardown),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
