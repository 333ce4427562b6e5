/* The bucket queue: order, windows, reuse of entries, purging. */
#include "testing.h"

#include "algo/queue.h"
#include "base/rng.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>

typedef struct fixture {
	testing_env t;
	wh_queue *q; /* large: not on the stack */
} fixture;

static void make(fixture *f, double top)
{
	testing_init(&f->t);
	f->q = calloc(1, sizeof *f->q);
	assert_non_null(f->q);
	wh_queue_reset(f->q, top);
}

static void drop(fixture *f)
{
	wh_queue_free(&f->t.ctx, f->q);
	free(f->q);
	testing_done(&f->t);
}

static void push(fixture *f, double cost, uint32_t u, uint32_t stamp)
{
	const uint32_t bucket = wh_queue_bucket(f->q, cost);
	assert_int_equal(wh_queue_push(&f->t.ctx, f->q, bucket, u, u + 1, stamp), WH_OK);
}

/* A cost from 1e-30 to 1, all magnitudes alike. */
static double random_cost(wh_rng *g)
{
	return pow(10.0, -30.0 * wh_rng_unit(g));
}

static void cheapest_bucket_comes_first(void **state)
{
	(void)state;
	enum { N = 5000 };
	fixture f;
	make(&f, 1.0);
	wh_rng g = wh_rng_seed(1);
	double *cost = malloc(N * sizeof *cost);
	assert_non_null(cost);
	for (uint32_t i = 0; i < N; i++) {
		cost[i] = random_cost(&g);
		push(&f, cost[i], i, 0);
	}
	double highest = 0;
	wh_candidate c;
	uint32_t bucket, n = 0;
	while (wh_queue_pop(f.q, &c, &bucket)) {
		assert_int_equal(bucket, wh_queue_bucket(f.q, cost[c.u]));
		assert_int_equal(c.v, c.u + 1);
		assert_true(cost[c.u] * 1.04 > highest); /* costs within 3 % share a bucket */
		highest = fmax(highest, cost[c.u]);
		n++;
	}
	assert_int_equal(n, N);
	free(cost);
	drop(&f);
}

static void a_bucket_gives_back_its_latest_entry(void **state)
{
	(void)state;
	fixture f;
	make(&f, 1.0);
	for (uint32_t i = 0; i < 3; i++)
		push(&f, 0.5, i, 0);
	wh_candidate c;
	uint32_t bucket;
	for (uint32_t i = 3; i-- > 0;) {
		assert_true(wh_queue_pop(f.q, &c, &bucket));
		assert_int_equal(c.u, i);
	}
	assert_false(wh_queue_pop(f.q, &c, &bucket));
	drop(&f);
}

static void buckets_rise_with_the_cost(void **state)
{
	(void)state;
	fixture f;
	make(&f, 3.7);
	wh_rng g = wh_rng_seed(2);
	for (int i = 0; i < 10000; i++) {
		const double a = random_cost(&g), b = random_cost(&g);
		const uint32_t ka = wh_queue_bucket(f.q, a), kb = wh_queue_bucket(f.q, b);
		assert_true(a <= b ? ka <= kb : ka >= kb);
		assert_true(a * 1.04 >= b || ka < kb); /* 4 % dearer: another bucket */
	}
	drop(&f);
}

static void costs_outside_the_window_share_its_ends(void **state)
{
	(void)state;
	fixture f;
	make(&f, 8.0);
	const uint32_t top = WH_QUEUE_BUCKETS - 1;
	assert_int_equal(wh_queue_bucket(f.q, 8.0), top);
	assert_int_equal(wh_queue_bucket(f.q, 7.9), top - 1);
	assert_int_equal(wh_queue_bucket(f.q, 1e300), top);
	assert_int_equal(wh_queue_bucket(f.q, (double)INFINITY), top);
	assert_int_equal(wh_queue_bucket(f.q, 0.0), 0);
	assert_int_equal(wh_queue_bucket(f.q, DBL_TRUE_MIN), 0);
	assert_int_equal(wh_queue_bucket(f.q, 1e-70), 0);
	assert_true(wh_queue_bucket(f.q, 1e-50) > 0);
	drop(&f);
}

/* Pushes below the bucket last popped are found, and nothing is lost or given twice. */
static void pushes_and_pops_may_alternate(void **state)
{
	(void)state;
	enum { N = 20000 };
	fixture f;
	make(&f, 1.0);
	wh_rng g = wh_rng_seed(3);
	uint8_t *seen = calloc(N, 1);
	assert_non_null(seen);
	wh_candidate c;
	uint32_t bucket, in = 0, out = 0;
	while (out < N) {
		if (in < N && (wh_rng_next(&g) & 3) != 0) {
			push(&f, random_cost(&g), in++, 0);
			continue;
		}
		if (!wh_queue_pop(f.q, &c, &bucket)) {
			assert_int_equal(in, out);
			continue;
		}
		assert_int_equal(seen[c.u], 0);
		seen[c.u] = 1;
		out++;
		assert_int_equal(f.q->size, in - out);
	}
	free(seen);
	drop(&f);
}

static void entries_given_back_are_used_again(void **state)
{
	(void)state;
	fixture f;
	make(&f, 1.0);
	wh_candidate c;
	uint32_t bucket;
	for (uint32_t round = 0; round < 1000; round++) {
		for (uint32_t i = 0; i < 10; i++)
			push(&f, 0.1 * (i + 1), i, 0);
		for (uint32_t i = 0; i < 10; i++)
			assert_true(wh_queue_pop(f.q, &c, &bucket));
	}
	assert_true(f.q->used <= 10);
	drop(&f);
}

static void purging_drops_dead_entries_alone(void **state)
{
	(void)state;
	enum { N = 1000 };
	fixture f;
	make(&f, 1.0);
	wh_rng g = wh_rng_seed(4);
	uint32_t generation[N + 1] = {0};
	for (uint32_t i = 0; i < N; i++)
		push(&f, random_cost(&g), i, 0);
	for (uint32_t i = 0; i <= N; i += 10)
		generation[i] = 1; /* kills the entries of i-1 and i */
	wh_queue_purge(f.q, generation);
	assert_int_equal(f.q->size, N - 200);
	wh_candidate c;
	uint32_t bucket, n = 0;
	for (; wh_queue_pop(f.q, &c, &bucket); n++)
		assert_true(c.u % 10 != 0 && c.v % 10 != 0);
	assert_int_equal(n, N - 200);
	drop(&f);
}

static void a_refused_push_leaves_the_queue_whole(void **state)
{
	(void)state;
	fixture f;
	make(&f, 1.0);
	uint32_t in = 0;
	f.t.mem.fail_after = 3;
	while (wh_queue_push(&f.t.ctx, f.q, in % 7, in, in, 0) == WH_OK)
		in++;
	assert_true(in >= 16);
	wh_candidate c;
	uint32_t bucket, out = 0;
	while (wh_queue_pop(f.q, &c, &bucket))
		out++;
	assert_int_equal(out, in);
	drop(&f);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	    cmocka_unit_test(cheapest_bucket_comes_first),
	    cmocka_unit_test(a_bucket_gives_back_its_latest_entry),
	    cmocka_unit_test(buckets_rise_with_the_cost),
	    cmocka_unit_test(costs_outside_the_window_share_its_ends),
	    cmocka_unit_test(pushes_and_pops_may_alternate),
	    cmocka_unit_test(entries_given_back_are_used_again),
	    cmocka_unit_test(purging_drops_dead_entries_alone),
	    cmocka_unit_test(a_refused_push_leaves_the_queue_whole),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
