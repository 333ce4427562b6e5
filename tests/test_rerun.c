/* Collapses done again from their records give the mesh that they gave when they were found. */
#include "testing.h"

#include "base/rng.h"
#include "pipeline/rerun.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum { SIDE = 90, MOST = 7500 }; /* enough collapses for several buffers */

typedef struct fixture {
	testing_env t;
	wh_spill spill;
	wh_simplify_workspace *work;
	wh_rerun rerun;
	wh_patch p;
} fixture;

static int setup(void **state)
{
	fixture *f = calloc(1, sizeof *f);
	testing_init(&f->t);
	assert_int_equal(wh_spill_open(&f->t.ctx, &f->spill, "/tmp", NULL), WH_OK);
	f->work = wh_simplify_workspace_new(&f->t.ctx);
	*state = f;
	return 0;
}

static int teardown(void **state)
{
	fixture *f = *state;
	wh_simplify_workspace_free(&f->t.ctx, f->work);
	wh_rerun_free(&f->t.ctx, &f->rerun);
	wh_patch_free(&f->t.ctx, &f->p);
	wh_spill_close(&f->t.ctx, &f->spill);
	testing_done(&f->t);
	free(f);
	return 0;
}

/* A rough square. */
static void make(fixture *f)
{
	const uint32_t n = SIDE + 1;
	wh_patch *p = &f->p;
	wh_rng g = wh_rng_seed(3);
	assert_int_equal(wh_patch_reset(&f->t.ctx, p, n * n, 2 * SIDE * SIDE), WH_OK);
	for (uint32_t v = 0; v < p->nv; v++) {
		p->pos[v] = wh_v3(v % n, v / n, wh_rng_unit(&g));
		p->gid[v] = v;
		p->flag[v] = v < n ? WH_CUT : 0;
		p->err[v] = 0;
	}
	uint32_t *t = p->tri;
	for (uint32_t y = 0; y < SIDE; y++)
		for (uint32_t x = 0; x < SIDE; x++, t += 6) {
			const uint32_t a = y * n + x;
			memcpy(t, (uint32_t[]){a, a + 1, a + n, a + 1, a + n + 1, a + n},
			       6 * sizeof *t);
		}
}

/* Takes so many vertices away. */
static void search(fixture *f, uint32_t vertices, bool record, wh_simplify_result *done)
{
	const wh_collapse_sink sink = {wh_rerun_put, &f->rerun};
	make(f);
	const wh_simplify_params p = {.target_vertices = f->p.nv - vertices,
	                              .max_cost = (double)INFINITY,
	                              .max_err = (double)INFINITY,
	                              .sink = record ? &sink : NULL};
	assert_int_equal(wh_simplify(&f->t.ctx, f->work, &f->p, &p, done), WH_OK);
}

/* A face as its global ids, the least first. */
typedef struct face {
	uint64_t id[3];
} face;

static int compare_faces(const void *a, const void *b)
{
	return memcmp(a, b, sizeof(face)); /* any order will do */
}

static face *sorted_faces(const wh_patch *p)
{
	face *all = calloc(p->nf, sizeof *all);
	for (uint32_t f = 0; f < p->nf; f++) {
		const uint32_t *t = &p->tri[3 * (size_t)f];
		uint32_t first = t[1] < t[0] ? 1 : 0;
		first = t[2] < t[first] ? 2 : first;
		for (uint32_t k = 0; k < 3; k++)
			all[f].id[k] = p->gid[t[(first + k) % 3]];
	}
	qsort(all, p->nf, sizeof *all, compare_faces);
	return all;
}

static void same_mesh(const wh_patch *a, const wh_patch *b)
{
	assert_int_equal(a->nv, b->nv);
	assert_int_equal(a->nf, b->nf);
	assert_memory_equal(a->gid, b->gid, a->nv * sizeof *a->gid);
	assert_memory_equal(a->pos, b->pos, a->nv * sizeof *a->pos);
	assert_memory_equal(a->err, b->err, a->nv * sizeof *a->err);
	face *fa = sorted_faces(a), *fb = sorted_faces(b);
	assert_memory_equal(fa, fb, a->nf * sizeof *fa);
	free(fa);
	free(fb);
}

static void the_beginning_of_a_run_can_be_done_again(void **state)
{
	fixture *f = *state;
	wh_ctx *c = &f->t.ctx;
	static const uint32_t counts[] = {0, 1, 3000, MOST};
	for (size_t i = 0; i < sizeof counts / sizeof *counts; i++) {
		wh_simplify_result trial, direct, again;
		assert_int_equal(wh_rerun_begin(c, &f->rerun, &f->spill, 7), WH_OK);
		search(f, MOST, true, &trial);
		assert_int_equal(wh_rerun_end(c, &f->rerun, WH_OK), WH_OK);
		assert_int_equal(f->spill.held, trial.collapses * sizeof(wh_collapse));

		wh_patch found = {0};
		search(f, counts[i], false, &direct);
		found = f->p;
		f->p = (wh_patch){0};
		make(f);
		const wh_rerun_limit limit = {UINT64_MAX, counts[i]};
		assert_int_equal(wh_rerun_perform(c, &f->rerun, &f->spill, 7, limit, &f->p, &again),
		                 WH_OK);
		same_mesh(&f->p, &found);
		assert_int_equal(again.collapses, direct.collapses);
		assert_true(again.highest_cost == direct.highest_cost);
		assert_true(again.cost_distance == direct.cost_distance);
		assert_int_equal(f->spill.held, 0);
		wh_patch_free(c, &found);
	}
}

static void each_limit_ends_it(void **state)
{
	fixture *f = *state;
	wh_ctx *c = &f->t.ctx;
	static const wh_rerun_limit limits[] = {{1, 100}, {41, 1000}, {1000, 7}, {0, 5}, {5, 0}};
	for (size_t i = 0; i < sizeof limits / sizeof *limits; i++) {
		wh_simplify_result trial, again;
		assert_int_equal(wh_rerun_begin(c, &f->rerun, &f->spill, 0), WH_OK);
		search(f, MOST, true, &trial);
		assert_int_equal(wh_rerun_end(c, &f->rerun, WH_OK), WH_OK);
		make(f);
		const uint32_t before = f->p.nf;
		assert_int_equal(
		    wh_rerun_perform(c, &f->rerun, &f->spill, 0, limits[i], &f->p, &again), WH_OK);
		const uint64_t gone = before - f->p.nf;
		assert_true(gone <= limits[i].faces && again.collapses <= limits[i].collapses);
		assert_true(gone + 1 >= limits[i].faces || again.collapses == limits[i].collapses);
	}
}

/* Writes something into the file of cluster 0 and does it again. */
static void perform_damaged(fixture *f, const void *bytes, size_t n)
{
	wh_ctx *c = &f->t.ctx;
	wh_simplify_result again;
	const int fd = wh_spill_create(c, &f->spill, "collapses-0");
	assert_true(fd >= 0);
	assert_int_equal(wh_spill_pwrite(c, &f->spill, fd, bytes, n, 0), WH_OK);
	close(fd);
	make(f);
	assert_int_equal(
	    wh_rerun_perform(c, &f->rerun, &f->spill, 0, (wh_rerun_limit){10, 10}, &f->p, &again),
	    WH_E_RUN);
	assert_non_null(strstr(c->err.text, "damaged"));
	c->err = (wh_error){0};
}

static void a_damaged_file_is_noticed(void **state)
{
	fixture *f = *state;
	const uint32_t far = 4000000;
	static const uint32_t ends[][4] = {{1, 1, 2, 3}, {1, 2, 2, 1}, {1, 2, 1, 3}, {1, 2, 3, 1}};
	for (size_t i = 0; i < sizeof ends / sizeof *ends; i++) {
		const wh_collapse run[2] = {{.u = ends[i][0], .v = ends[i][1], .faces = 1},
		                            {.u = ends[i][2], .v = ends[i][3], .faces = 1}};
		perform_damaged(f, run, sizeof run);
	}
	perform_damaged(f, &(wh_collapse){.u = far, .v = 1, .faces = 1}, sizeof(wh_collapse));
	perform_damaged(f, &(wh_collapse){.u = 1, .v = far, .faces = 1}, sizeof(wh_collapse));
	perform_damaged(f, &(wh_collapse){.u = 1, .v = 2, .faces = 1}, sizeof(wh_collapse) - 1);
}

static void a_file_that_is_gone_is_noticed(void **state)
{
	fixture *f = *state;
	wh_simplify_result again;
	make(f);
	assert_int_equal(wh_rerun_perform(&f->t.ctx, &f->rerun, &f->spill, 3,
	                                  (wh_rerun_limit){10, 10}, &f->p, &again),
	                 WH_E_RUN); /* there is none */
	f->t.ctx.err = (wh_error){0};
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	    cmocka_unit_test_setup_teardown(the_beginning_of_a_run_can_be_done_again, setup,
	                                    teardown),
	    cmocka_unit_test_setup_teardown(each_limit_ends_it, setup, teardown),
	    cmocka_unit_test_setup_teardown(a_damaged_file_is_noticed, setup, teardown),
	    cmocka_unit_test_setup_teardown(a_file_that_is_gone_is_noticed, setup, teardown),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
