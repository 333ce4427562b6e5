/* Blocks: counted, aligned, given back; freed ones serve again, but never beyond the peak. */
#include "testing.h"

#include <stdint.h>
#include <string.h>

enum { KIB = 1024, MIB = 1024 * 1024 };

static bool all_are(const char *p, size_t n, char value)
{
	for (size_t i = 0; i < n; i++)
		if (p[i] != value)
			return false;
	return true;
}

static void blocks_are_aligned_and_counted(void **state)
{
	(void)state;
	testing_env t;
	testing_init(&t);
	static const size_t sizes[] = {0, 1, 63, 64, 4096, 127 * KIB, 128 * KIB, 3 * MIB + 5};
	for (size_t i = 0; i < sizeof sizes / sizeof *sizes; i++) {
		char *p = wh_alloc(&t.ctx, sizes[i], 1);
		assert_non_null(p);
		assert_int_equal((uintptr_t)p % 64, 0);
		memset(p, 1, sizes[i]);
		assert_true(t.mem.used >= sizes[i]);
		wh_free(&t.ctx, p);
		assert_int_equal((size_t)t.mem.used, 0);
	}
	testing_done(&t);
}

static void a_freed_block_serves_again_and_is_cleared_where_asked(void **state)
{
	(void)state;
	testing_env t;
	testing_init(&t);
	char *hold = wh_alloc(&t.ctx, 1, 1);
	char *p = wh_alloc(&t.ctx, MIB, 1);
	memset(p, 7, MIB);
	wh_free(&t.ctx, p);
	for (size_t n = MIB; n >= 128 * KIB; n /= 2) { /* whole, and cut */
		char *q = wh_calloc(&t.ctx, n, 1);
		assert_true(all_are(q, n, 0));
		memset(q, 7, n);
		wh_free(&t.ctx, q);
	}
	char *grown = wh_calloc(&t.ctx, 3, MIB); /* longer than any that is kept */
	assert_true(all_are(grown, 3 * (size_t)MIB, 0));
	wh_free(&t.ctx, grown);
	wh_free(&t.ctx, hold);
	testing_done(&t);
}

static void held_and_kept_stay_within_the_peak(void **state)
{
	(void)state;
	testing_env t;
	testing_init(&t);
	char *hold = wh_alloc(&t.ctx, 1, 1), *block[8];
	for (int round = 0; round < 6; round++) {
		for (size_t i = 0; i < 8; i++)
			block[i] =
			    wh_alloc(&t.ctx, (1 + (i * 5 + (size_t)round) % 8) * 200 * KIB, 1);
		for (size_t i = 0; i < 8; i += 2) {
			wh_free(&t.ctx, block[i]);
			assert_true(t.mem.used + t.mem.kept_bytes <= t.mem.peak);
			block[i] = wh_alloc(&t.ctx, 150 * KIB, 1);
			assert_true(t.mem.used + t.mem.kept_bytes <= t.mem.peak);
		}
		for (size_t i = 0; i < 8; i++)
			wh_free(&t.ctx, block[i]);
		assert_true(t.mem.used + t.mem.kept_bytes <= t.mem.peak);
	}
	wh_free(&t.ctx, hold); /* nothing is held */
	assert_int_equal(t.mem.kept_bytes, 0);
	testing_done(&t);
}

static void blocks_that_touch_are_kept_as_one(void **state)
{
	(void)state;
	testing_env t;
	testing_init(&t);
	char *hold = wh_alloc(&t.ctx, 1, 1);
	wh_free(&t.ctx, wh_alloc(&t.ctx, 4, MIB));
	char *part[8]; /* cut from the one that is kept */
	for (size_t i = 0; i < 8; i++)
		part[i] = wh_alloc(&t.ctx, 500, KIB);
	for (size_t i = 0; i < 8; i++)
		wh_free(&t.ctx, part[(3 * i) % 8]);
#ifndef WH_SANITIZED
	assert_int_equal(t.mem.n_kept, 1);
#endif
	char *whole = wh_alloc(&t.ctx, 3900, KIB);
	memset(whole, 9, 3900 * KIB);
	whole = wh_resize(&t.ctx, whole, 6, MIB);
	assert_true(all_are(whole, 3900 * KIB, 9));
	assert_true(t.mem.used + t.mem.kept_bytes <= t.mem.peak);
	wh_free(&t.ctx, whole);
	wh_free(&t.ctx, hold);
	testing_done(&t);
}

static void resizing_keeps_what_is_in_a_block(void **state)
{
	(void)state;
	testing_env t;
	testing_init(&t);
	char *p = NULL;
	size_t old = 0;
	static const size_t sizes[] = {100, 200 * KIB, 5 * MIB, 130 * KIB, 64, 2 * MIB};
	for (size_t i = 0; i < sizeof sizes / sizeof *sizes; i++) {
		p = wh_resize(&t.ctx, p, sizes[i], 1);
		assert_non_null(p);
		const size_t kept = old < sizes[i] ? old : sizes[i];
		assert_true(all_are(p, kept, 9));
		memset(p, 9, sizes[i]);
		old = sizes[i];
	}
	wh_free(&t.ctx, p);
	testing_done(&t);
}

static void what_does_not_fit_the_limit_is_refused(void **state)
{
	(void)state;
	testing_env t;
	testing_init(&t);
	t.mem.limit = MIB;
	assert_null(wh_alloc(&t.ctx, 2, MIB));
	assert_int_equal(t.ctx.err.code, WH_E_PLAN);
	t.ctx.err = (wh_error){0};
	assert_null(wh_alloc(&t.ctx, SIZE_MAX / 2, 4));
	t.ctx.err = (wh_error){0};
	void *p = wh_alloc(&t.ctx, 900, KIB);
	assert_non_null(p);
	wh_free(&t.ctx, p);
	testing_done(&t);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	    cmocka_unit_test(blocks_are_aligned_and_counted),
	    cmocka_unit_test(a_freed_block_serves_again_and_is_cleared_where_asked),
	    cmocka_unit_test(held_and_kept_stay_within_the_peak),
	    cmocka_unit_test(blocks_that_touch_are_kept_as_one),
	    cmocka_unit_test(resizing_keeps_what_is_in_a_block),
	    cmocka_unit_test(what_does_not_fit_the_limit_is_refused),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
