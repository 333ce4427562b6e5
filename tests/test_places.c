/* Ids in any order, dense or sparse, with repeats: their places are those of a sort. */
#include "testing.h"

#include "base/places.h"
#include "base/rng.h"
#include "base/sort.h"

#include <string.h>

enum { N = 3000 };

static void agrees_with_a_sort(wh_ctx *c, wh_places *p, const uint64_t *ids, uint32_t n)
{
	uint64_t sorted[N];
	memcpy(sorted, ids, n * sizeof *ids);
	const size_t kept = wh_sort_unique(sorted, n);
	assert_int_equal(wh_places_fill(c, p, ids, n), WH_OK);
	assert_int_equal(p->n, kept);
	uint32_t at;
	for (uint32_t i = 0; i < kept; i++) {
		assert_true(wh_places_find(p, sorted[i], &at));
		assert_int_equal(at, i);
		if (i + 1 < kept && sorted[i] + 1 < sorted[i + 1])
			assert_false(wh_places_find(p, sorted[i] + 1, &at));
	}
	assert_false(wh_places_find(p, sorted[0] - 1, &at));
	assert_false(wh_places_find(p, sorted[kept - 1] + 1, &at));
}

/* From a range with repeats to one that takes all levels. */
static void ids_of_any_range_find_their_places(void **state)
{
	(void)state;
	testing_env t;
	wh_places p = {0};
	uint64_t ids[N];
	testing_init(&t);
	for (uint32_t bits = 1; bits <= 62; bits++)
		for (uint32_t n = 1; n <= N; n = 7 * n + 1) {
			wh_rng g = wh_rng_seed(bits + 64 * n);
			for (uint32_t i = 0; i < n; i++)
				ids[i] = 1 + (wh_rng_next(&g) >> (64 - bits));
			agrees_with_a_sort(&t.ctx, &p, ids, n);
			if (bits <= 32)
				assert_true(p.cap * sizeof *p.room <= wh_places_bytes(N, 32));
		}
	wh_places_free(&t.ctx, &p);
	testing_done(&t);
}

static void rows_far_apart_find_their_places(void **state)
{
	(void)state;
	testing_env t;
	wh_places p = {0};
	uint64_t ids[N];
	testing_init(&t);
	for (uint32_t i = 0; i < N; i++) /* the last row first */
		ids[i] = ((uint64_t)(N - i) / 50 << 20) + i % 50;
	agrees_with_a_sort(&t.ctx, &p, ids, N);
	wh_places_free(&t.ctx, &p);
	testing_done(&t);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	    cmocka_unit_test(ids_of_any_range_find_their_places),
	    cmocka_unit_test(rows_far_apart_find_their_places),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
