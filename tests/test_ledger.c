/* Ledgers: entries come back in the next process, whole ones only, and the later of two holds. */
#define _POSIX_C_SOURCE 200809L
#include "testing.h"

#include "pipeline/ledger.h"

#include <fcntl.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

enum { CLUSTERS = 5, RECORD = 24 + 4 };

typedef struct fixture {
	testing_env t;
	wh_spill spill;
	wh_ledger ledger;
} fixture;

static void reopen(fixture *f)
{
	wh_ledger_close(&f->t.ctx, &f->ledger);
	assert_int_equal(wh_ledger_open(&f->t.ctx, &f->ledger, &f->spill, "step-0", CLUSTERS),
	                 WH_OK);
}

static void make(fixture *f)
{
	*f = (fixture){0};
	testing_init(&f->t);
	assert_int_equal(wh_spill_open(&f->t.ctx, &f->spill, "/tmp", NULL), WH_OK);
	reopen(f);
}

static void drop(fixture *f)
{
	wh_ledger_close(&f->t.ctx, &f->ledger);
	wh_spill_close(&f->t.ctx, &f->spill);
	testing_done(&f->t);
}

static void put(fixture *f, uint32_t cluster, uint32_t value)
{
	assert_int_equal(
	    wh_ledger_put(&f->t.ctx, &f->ledger, WH_LEDGER_TRIAL, cluster, &value, sizeof value),
	    WH_OK);
}

/* The value of an entry; 0: there is none. */
static uint32_t get(fixture *f, uint32_t cluster)
{
	uint32_t value = 0;
	const uint32_t n = wh_ledger_bytes(&f->t.ctx, &f->ledger, WH_LEDGER_TRIAL, cluster);
	if (n == 0)
		return 0;
	assert_int_equal(n, sizeof value);
	assert_int_equal(wh_ledger_get(&f->t.ctx, &f->ledger, WH_LEDGER_TRIAL, cluster, &value, n),
	                 WH_OK);
	return value;
}

static void entries_come_back(void **state)
{
	(void)state;
	fixture f;
	make(&f);
	put(&f, 3, 30);
	put(&f, 0, 10);
	put(&f, 3, 33);
	reopen(&f);
	assert_int_equal(get(&f, 0), 10);
	assert_int_equal(get(&f, 3), 33);
	assert_int_equal(get(&f, 1), 0);
	assert_int_equal(wh_ledger_bytes(&f.t.ctx, &f.ledger, WH_LEDGER_SAVED, 3), 0);
	assert_int_equal(wh_ledger_bytes(&f.t.ctx, NULL, WH_LEDGER_TRIAL, 3), 0);
	drop(&f);
}

/* A record cut off, or with any bit turned, ends the row; what is added next is found. */
static void a_torn_record_ends_the_row(void **state)
{
	(void)state;
	for (int at = 0; at <= RECORD; at++) {
		fixture f;
		make(&f);
		put(&f, 0, 10);
		put(&f, 1, 11);
		const int fd = wh_spill_reopen(&f.t.ctx, &f.spill, "step-0");
		assert_true(fd >= 0);
		if (at < RECORD) {
			char byte;
			assert_int_equal(pread(fd, &byte, 1, RECORD + at), 1);
			byte ^= 4;
			assert_int_equal(pwrite(fd, &byte, 1, RECORD + at), 1);
		} else {
			assert_int_equal(ftruncate(fd, 2 * RECORD - 3), 0);
		}
		(void)close(fd);
		reopen(&f);
		assert_int_equal(get(&f, 0), 10);
		assert_int_equal(get(&f, 1), 0);
		put(&f, 4, 14);
		reopen(&f);
		assert_int_equal(get(&f, 0), 10);
		assert_int_equal(get(&f, 4), 14);
		drop(&f);
	}
}

/* Of a round over more clusters than this one: no entry is taken for another's. */
static void clusters_that_are_not_there_have_no_entry(void **state)
{
	(void)state;
	fixture f;
	make(&f);
	put(&f, 4, 14);
	wh_ledger_close(&f.t.ctx, &f.ledger);
	assert_int_equal(wh_ledger_open(&f.t.ctx, &f.ledger, &f.spill, "step-0", 4), WH_OK);
	for (uint32_t k = 0; k < 4; k++)
		assert_int_equal(get(&f, k), 0);
	drop(&f);
}

/* A cluster counts as saved while its file is the one that the entry was written for. */
static void an_entry_belongs_to_one_file(void **state)
{
	(void)state;
	fixture f;
	make(&f);
	wh_patch p = {0};
	wh_store_workspace scratch = {0};
	int result = 7, found = 0;
	const wh_store s = {.spill = &f.spill,
	                    .clusters = CLUSTERS,
	                    .id_bytes = 4,
	                    .coord_bytes = 4,
	                    .vertex_payload = 4,
	                    .local_corners = true,
	                    .ledger = &f.ledger};
	assert_int_equal(wh_patch_reset(&f.t.ctx, &p, 3, 1), WH_OK);
	for (uint32_t v = 0; v < 3; v++) {
		p.pos[v] = wh_v3(v, v % 2, 0);
		p.gid[v] = v;
		p.flag[v] = 0;
		p.err[v] = 0;
		p.tri[v] = v;
	}
	assert_int_equal(wh_store_save(&f.t.ctx, &s, 2, &p), WH_OK);
	assert_int_equal(wh_ledger_saved(&f.t.ctx, &s, 2, &result, sizeof result), WH_OK);
	reopen(&f);
	assert_true(wh_ledger_is_saved(&f.t.ctx, &s, 2, &scratch, &found, sizeof found));
	assert_int_equal(found, 7);
	assert_false(wh_ledger_is_saved(&f.t.ctx, &s, 1, &scratch, &found, sizeof found));
	p.pos[1].z = 1;
	assert_int_equal(wh_store_save(&f.t.ctx, &s, 2, &p), WH_OK);
	assert_false(wh_ledger_is_saved(&f.t.ctx, &s, 2, &scratch, &found, sizeof found));
	wh_store_remove(&s, 2);
	assert_false(wh_ledger_is_saved(&f.t.ctx, &s, 2, &scratch, &found, sizeof found));
	assert_int_equal(f.t.ctx.err.code, WH_OK);
	wh_store_workspace_free(&f.t.ctx, &scratch);
	wh_patch_free(&f.t.ctx, &p);
	drop(&f);
}

/* However many parts there are, and whether they help: every cluster is one's own exactly once, and
 * who helps comes to each cluster once, to its own ones first. */
static void turns_come_to_every_cluster_once(void **state)
{
	(void)state;
	for (uint32_t parts = 1; parts <= 5; parts++)
		for (uint32_t clusters = 1; clusters <= 13; clusters++) {
			uint32_t owned = 0;
			for (uint32_t part = 0; part < parts; part++) {
				const wh_ledger l = {.part = part, .parts = parts, .helps = true};
				const wh_ledger own = {.part = part, .parts = parts};
				bool seen[13] = {false}, others = false;
				uint32_t n = 0;
				for (uint32_t t = 0; t < wh_ledger_turns(&l, clusters); t++) {
					uint32_t k;
					if (!wh_ledger_turn(&l, clusters, t, &k))
						continue;
					assert_true(k < clusters && !seen[k]);
					seen[k] = true;
					n++;
					assert_false(others && wh_ledger_owns(&l, k));
					others = !wh_ledger_owns(&l, k);
					owned += !others;
				}
				assert_int_equal(n, clusters);
				for (uint32_t t = 0; t < wh_ledger_turns(&own, clusters); t++) {
					uint32_t k;
					if (wh_ledger_turn(&own, clusters, t, &k))
						assert_true(wh_ledger_owns(&own, k));
				}
			}
			assert_int_equal(owned, clusters);
		}
	uint32_t k;
	assert_int_equal(wh_ledger_turns(NULL, 7), 7);
	assert_true(wh_ledger_turn(NULL, 7, 6, &k) && k == 6);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	    cmocka_unit_test(entries_come_back),
	    cmocka_unit_test(a_torn_record_ends_the_row),
	    cmocka_unit_test(clusters_that_are_not_there_have_no_entry),
	    cmocka_unit_test(an_entry_belongs_to_one_file),
	    cmocka_unit_test(turns_come_to_every_cluster_once),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
