/* The map from ids to values. */
#include "testing.h"

#include "base/idmap.h"
#include "base/rng.h"

static void values_come_back_and_others_do_not(void **state)
{
	(void)state;
	enum { N = 5000 };
	testing_env t;
	testing_init(&t);
	wh_idmap m = {0};
	assert_null(wh_idmap_get(&m, 7));
	for (uint64_t i = 0; i < N; i++) {
		bool fresh;
		uint64_t *v = wh_idmap_put(&t.ctx, &m, wh_mix64(i) >> 2, &fresh);
		assert_non_null(v);
		assert_true(fresh);
		assert_int_equal(*v, 0);
		*v = i;
	}
	for (uint64_t i = 0; i < N; i++) {
		bool fresh;
		assert_int_equal(*wh_idmap_get(&m, wh_mix64(i) >> 2), i);
		assert_int_equal(*wh_idmap_put(&t.ctx, &m, wh_mix64(i) >> 2, &fresh), i);
		assert_false(fresh);
		assert_null(wh_idmap_get(&m, wh_mix64(i + N) >> 2));
	}
	assert_int_equal(m.n, N);
	wh_idmap_free(&t.ctx, &m);
	testing_done(&t);
}

static void id_zero_is_an_id(void **state)
{
	(void)state;
	testing_env t;
	testing_init(&t);
	wh_idmap m = {0};
	bool fresh;
	assert_non_null(wh_idmap_put(&t.ctx, &m, 0, &fresh));
	assert_true(fresh);
	assert_non_null(wh_idmap_get(&m, 0));
	assert_null(wh_idmap_get(&m, 1));
	wh_idmap_free(&t.ctx, &m);
}

static void a_refused_growth_keeps_what_is_there(void **state)
{
	(void)state;
	testing_env t;
	testing_init(&t);
	wh_idmap m = {0};
	bool fresh;
	uint64_t n = 0;
	for (; n < 40; n++)
		*wh_idmap_put(&t.ctx, &m, n, &fresh) = n;
	t.mem.limit = atomic_load(&t.mem.used);
	while (wh_idmap_put(&t.ctx, &m, n, &fresh))
		n++;
	assert_true(n >= 40 && n < 64);
	for (uint64_t i = 0; i < 40; i++)
		assert_int_equal(*wh_idmap_get(&m, i), i);
	wh_idmap_free(&t.ctx, &m);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	    cmocka_unit_test(values_come_back_and_others_do_not),
	    cmocka_unit_test(id_zero_is_an_id),
	    cmocka_unit_test(a_refused_growth_keeps_what_is_there),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
