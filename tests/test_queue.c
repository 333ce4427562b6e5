/* The bucket queue: order, windows, removal. */
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

static void make(fixture *f, uint32_t n, double top)
{
	testing_init(&f->t);
	f->q = calloc(1, sizeof *f->q);
	assert_non_null(f->q);
	assert_int_equal(wh_queue_reset(&f->t.ctx, f->q, n, top), WH_OK);
}

static void drop(fixture *f)
{
	wh_queue_free(&f->t.ctx, f->q);
	free(f->q);
	testing_done(&f->t);
}

static void push(fixture *f, double cost, uint32_t v)
{
	wh_queue_push(f->q, v, wh_queue_bucket(f->q, cost));
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
	make(&f, N, 1.0);
	wh_rng g = wh_rng_seed(1);
	double *cost = malloc(N * sizeof *cost);
	assert_non_null(cost);
	for (uint32_t i = 0; i < N; i++) {
		cost[i] = random_cost(&g);
		push(&f, cost[i], i);
	}
	double highest = 0;
	uint32_t v, bucket, n = 0;
	while (wh_queue_pop(f.q, &v, &bucket)) {
		assert_int_equal(bucket, wh_queue_bucket(f.q, cost[v]));
		assert_true(cost[v] * 1.04 > highest); /* costs within 3 % share a bucket */
		highest = fmax(highest, cost[v]);
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
	make(&f, 3, 1.0);
	for (uint32_t i = 0; i < 3; i++)
		push(&f, 0.5, i);
	uint32_t v, bucket;
	for (uint32_t i = 3; i-- > 0;) {
		assert_true(wh_queue_pop(f.q, &v, &bucket));
		assert_int_equal(v, i);
	}
	assert_false(wh_queue_pop(f.q, &v, &bucket));
	drop(&f);
}

static void buckets_rise_with_the_cost(void **state)
{
	(void)state;
	fixture f;
	make(&f, 1, 3.7);
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
	make(&f, 1, 8.0);
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
	make(&f, N, 1.0);
	wh_rng g = wh_rng_seed(3);
	uint8_t *seen = calloc(N, 1);
	assert_non_null(seen);
	uint32_t v, bucket, in = 0, out = 0;
	while (out < N) {
		if (in < N && (wh_rng_next(&g) & 3) != 0) {
			push(&f, random_cost(&g), in++);
			continue;
		}
		if (!wh_queue_pop(f.q, &v, &bucket)) {
			assert_int_equal(in, out);
			continue;
		}
		assert_int_equal(seen[v], 0);
		seen[v] = 1;
		out++;
		assert_int_equal(f.q->size, in - out);
	}
	free(seen);
	drop(&f);
}

/* Vertices go from any place of a bucket's list, and may come back elsewhere. */
static void removed_vertices_are_gone(void **state)
{
	(void)state;
	enum { N = 1000 };
	fixture f;
	make(&f, N, 1.0);
	wh_rng g = wh_rng_seed(4);
	for (uint32_t i = 0; i < N; i++)
		wh_queue_push(f.q, i, (uint32_t)(wh_rng_next(&g) % 7));
	for (uint32_t i = 0; i < N; i += 3)
		wh_queue_remove(f.q, i);
	wh_queue_remove(f.q, 0); /* not in: nothing happens */
	for (uint32_t i = 0; i < N; i += 6)
		wh_queue_push(f.q, i, (uint32_t)(wh_rng_next(&g) % 7));
	uint32_t v, bucket, last = 0, n = 0;
	for (; wh_queue_pop(f.q, &v, &bucket); n++) {
		assert_true(v % 3 != 0 || v % 6 == 0);
		assert_true(bucket >= last);
		last = bucket;
	}
	assert_int_equal(n, N - (N + 2) / 3 + (N + 5) / 6);
	drop(&f);
}

static void a_refused_reset_is_said(void **state)
{
	(void)state;
	fixture f;
	make(&f, 1, 1.0);
	f.t.mem.fail_after = 1;
	assert_int_not_equal(wh_queue_reset(&f.t.ctx, f.q, 1000, 1.0), WH_OK);
	f.t.ctx.err.code = WH_OK;
	assert_int_equal(wh_queue_reset(&f.t.ctx, f.q, 1000, 1.0), WH_OK);
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
	    cmocka_unit_test(removed_vertices_are_gone),
	    cmocka_unit_test(a_refused_reset_is_said),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
