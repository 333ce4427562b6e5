/* Sharing out a count among clusters by their logs. */
#include "testing.h"

#include "pipeline/quota.h"

#include <stdlib.h>

/* Logs of three clusters: bin, collapses, faces. */
static wh_quota_bin first[] = {{10, 4, 8}, {12, 3, 6}, {20, 2, 4}};
static wh_quota_bin second[] = {{11, 1, 1}, {12, 5, 9}};
static wh_quota_bin third[] = {{12, 2, 4}, {13, 6, 12}};
static const wh_quota_log logs[] = {{first, 3}, {second, 2}, {third, 2}};

enum { CLUSTERS = 3 };

static void share(uint64_t faces, uint64_t vertices, wh_quota *q, wh_quota *sum)
{
	testing_env t;
	testing_init(&t);
	assert_int_equal(wh_quota_share(&t.ctx, logs, CLUSTERS, faces, vertices, q, sum), WH_OK);
	testing_done(&t);
}

/* Cheap bins go first, from all clusters; the bin that is cut goes by cluster. */
static void the_cheapest_go_first(void **state)
{
	(void)state;
	wh_quota q[CLUSTERS], sum;
	share(9, 0, q, &sum); /* 8 of bin 10, 1 of bin 11 */
	assert_int_equal(q[0].faces, 8);
	assert_int_equal(q[1].faces, 1);
	assert_int_equal(q[2].faces, 0);
	share(9 + 6 + 5, 0, q, &sum); /* then bin 12: all 6 of the first, 5 of the second */
	assert_int_equal(q[0].faces, 14);
	assert_int_equal(q[1].faces, 6);
	assert_int_equal(q[2].faces, 0);
	assert_int_equal(sum.faces, 20);
}

static void every_count_within_the_logs_is_met(void **state)
{
	(void)state;
	wh_quota q[CLUSTERS], sum;
	for (uint64_t n = 1; n <= 44; n++) {
		share(n, 0, q, &sum);
		assert_int_equal(sum.faces, n);
		assert_int_equal(q[0].faces + q[1].faces + q[2].faces, n);
	}
	for (uint64_t n = 1; n <= 23; n++) {
		share(0, n, q, &sum);
		assert_int_equal(sum.vertices, n);
	}
}

static void more_than_there_is_gives_all_there_is(void **state)
{
	(void)state;
	wh_quota q[CLUSTERS], sum;
	share(1000, 0, q, &sum);
	assert_int_equal(sum.faces, 44);
	assert_int_equal(sum.vertices, 23);
	share(0, 1000, q, &sum);
	assert_int_equal(sum.faces, 44);
}

static void of_two_limits_the_one_reached_first_counts(void **state)
{
	(void)state;
	wh_quota q[CLUSTERS], sum;
	share(20, 4, q, &sum); /* four vertices are bin 10 of the first cluster */
	assert_int_equal(q[0].vertices, 4);
	assert_int_equal(sum.vertices, 4);
	assert_int_equal(sum.faces, 8);
	share(8, 20, q, &sum);
	assert_int_equal(sum.faces, 8);
	assert_int_equal(sum.vertices, 4);
	/* both within the second cluster's part of bin 12 */
	share(9 + 6 + 5, 5 + 3 + 2, q, &sum);
	assert_int_equal(q[1].faces, 1 + 5);
	assert_int_equal(q[1].vertices, 1 + 2);
}

static void a_log_keeps_its_bins(void **state)
{
	(void)state;
	testing_env t;
	testing_init(&t);
	wh_cost_log *full = calloc(1, sizeof *full);
	assert_non_null(full);
	full->collapses[0] = 3;
	full->faces[0] = 6;
	full->collapses[WH_LOG_BINS - 1] = 1;
	full->faces[WH_LOG_BINS - 1] = 1;
	wh_quota_log log;
	assert_int_equal(wh_quota_note(&t.ctx, &log, full), WH_OK);
	assert_int_equal(log.n, 2);
	assert_int_equal(log.item[0].bin, 0);
	assert_int_equal(log.item[0].faces, 6);
	assert_int_equal(log.item[1].bin, WH_LOG_BINS - 1);
	assert_int_equal(log.item[1].collapses, 1);
	wh_free(&t.ctx, log.item);
	free(full);
	testing_done(&t);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	    cmocka_unit_test(the_cheapest_go_first),
	    cmocka_unit_test(every_count_within_the_logs_is_met),
	    cmocka_unit_test(more_than_there_is_gives_all_there_is),
	    cmocka_unit_test(of_two_limits_the_one_reached_first_counts),
	    cmocka_unit_test(a_log_keeps_its_bins),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
