/*
 * Several results of one run: counts, quality beside that of runs of their own, the same bytes for
 * any number of threads, any ceiling and any break, streamed or not; errors instead of counts;
 * what is refused.
 */
#define _XOPEN_SOURCE 700
#include "reduce_files.h"

#include "algo/compare.h"
#include "mesh/check.h"
#include "pipeline/normalise.h"

#include <math.h>

enum { MOST = 5 };

typedef struct levels {
	fixture f;
	wh_level level[MOST];
	char path[MOST][96];
	size_t n;
} levels;

/* All results, the last one included, go to a folder of their own. */
static void aim(levels *l, const char *folder, const uint64_t *faces, size_t n)
{
	char dir[80];
	(void)snprintf(dir, sizeof dir, "%s/%s", l->f.root, folder);
	assert_int_equal(mkdir(dir, 0700), 0);
	for (size_t i = 0; i < n; i++) {
		(void)snprintf(l->path[i], sizeof l->path[i], "%.70s/%zu.ply", dir, i);
		l->level[i] = (wh_level){.faces = faces[i], .output = l->path[i]};
	}
	l->n = n;
	l->f.params.level = l->level;
	l->f.params.levels = n - 1;
	l->f.params.faces = faces[n - 1];
	l->f.params.output = l->path[n - 1];
}

/* The first two of these counts are streamed, the others come from the last pass. */
static const uint64_t usual[] = {6000, 4501, 1500, 301};
enum { USUAL = 4 };

static void open_levels(levels *l, wh_synth_kind kind, uint64_t faces)
{
	const wh_synth_params s = surface(kind, faces);
	*l = (levels){0};
	make(&l->f, &s);
	l->f.params.cluster_faces = 2000;
	l->f.params.micro_faces = 1000;
	l->f.params.final_faces = 4000;
}

/* A boundary lets counts be odd; a sphere has one face less then. */
static void every_level_has_its_count_and_is_clean(void **state)
{
	(void)state;
	for (int open = 0; open < 2; open++) {
		levels l;
		open_levels(&l, open ? WH_SYNTH_TERRAIN : WH_SYNTH_SPHERE, 10000);
		aim(&l, "a", usual, USUAL);
		assert_int_equal(reduce(&l.f), WH_OK);
		for (size_t i = 0; i < l.n; i++) {
			const wh_reduce_report *t = &l.f.report;
			const uint64_t want = open ? usual[i] : usual[i] & ~(uint64_t)1;
			wh_check c;
			wh_mesh m = load_mesh(&l.f, l.path[i]);
			assert_int_equal(wh_check_mesh(&l.f.t.ctx, &m, &c), WH_OK);
			assert_int_equal(m.nf, want);
			assert_true(wh_check_clean(&c));
			assert_int_equal(c.components, 1);
			if (i + 1 < l.n) {
				assert_int_equal(t->level[i].faces, want);
				assert_int_equal(t->level[i].vertices, m.nv);
				assert_true(t->level[i].one_less == (want != usual[i]));
				assert_true(t->level[i].streamed == (i < 2));
			} else {
				assert_int_equal(t->output_faces, want);
				assert_false(t->streamed);
			}
			wh_mesh_free(&l.f.t.ctx, &m);
		}
		assert_int_equal(entries(l.f.temp), 0);
		drop(&l.f);
	}
}

static double rms(levels *l, const char *path)
{
	const wh_exec ex = {.workers = 2};
	const wh_compare_params p = {.samples = 30000};
	wh_compare r;
	wh_mesh a = load_mesh(&l->f, l->f.in), b = load_mesh(&l->f, path);
	assert_int_equal(wh_compare_meshes(&l->f.t.ctx, &ex, &a, &b, &p, &r), WH_OK);
	wh_mesh_free(&l->f.t.ctx, &a);
	wh_mesh_free(&l->f.t.ctx, &b);
	return r.rms;
}

/* Within what single meshes scatter. */
static void a_level_is_as_good_as_a_run_of_its_own(void **state)
{
	(void)state;
	levels l;
	open_levels(&l, WH_SYNTH_SPHERE, 10000);
	aim(&l, "a", usual, USUAL);
	assert_int_equal(reduce(&l.f), WH_OK);
	double product = 1;
	for (size_t i = 0; i < l.n; i++) {
		const double ours = rms(&l, l.path[i]);
		l.f.params.levels = 0;
		l.f.params.faces = usual[i];
		l.f.params.output = l.f.out;
		assert_int_equal(reduce(&l.f), WH_OK);
		const double own = rms(&l, l.f.out);
		assert_true(ours < 1.05 * own);
		product *= ours / own;
	}
	assert_true(pow(product, 1.0 / USUAL) < 1.02);
	drop(&l.f);
}

static void threads_and_ceiling_change_no_byte(void **state)
{
	(void)state;
	levels l;
	char before[MOST][96];
	open_levels(&l, WH_SYNTH_TERRAIN, 10000);
	aim(&l, "a", usual, USUAL);
	assert_int_equal(reduce(&l.f), WH_OK);
	memcpy(before, l.path, sizeof before);
	aim(&l, "b", usual, USUAL);
	l.f.params.threads = 1;
	l.f.params.memory = (size_t)24 << 20;
	assert_int_equal(reduce(&l.f), WH_OK);
	for (size_t i = 0; i < l.n; i++)
		same_bytes(before[i], l.path[i]);
	drop(&l.f);
}

/* ---- breaks ---- */

/* Stops the run when a phase begins for the n-th time. */
typedef struct stopper {
	const char *phase;
	int n;
	char last[32];
	volatile int stop;
} stopper;

static void stop_at(void *user, const char *phase, uint64_t done, uint64_t total)
{
	stopper *s = user;
	(void)done, (void)total;
	if (strcmp(s->last, phase) != 0 && strcmp(phase, s->phase) == 0 && --s->n == 0)
		__atomic_store_n(&s->stop, 1, __ATOMIC_RELAXED);
	(void)snprintf(s->last, sizeof s->last, "%s", phase);
}

/* Wherever it was stopped, a run that is resumed gives the same bytes, and what was delivered
 * before is not asked for again. */
static void a_run_that_was_stopped_goes_on(void **state)
{
	(void)state;
	const struct {
		const char *phase;
		int n;
	} at[] = {{"settle", 1},     {"write", 1}, {"settle", 2},     {"write", 2},
	          {"final pass", 1}, {"write", 3}, {"final pass", 2}, {"write", 4}};
	levels l;
	char whole[MOST][96];
	open_levels(&l, WH_SYNTH_SPHERE, 10000);
	aim(&l, "whole", usual, USUAL);
	assert_int_equal(reduce(&l.f), WH_OK);
	const wh_reduce_report report = l.f.report;
	memcpy(whole, l.path, sizeof whole);
	for (size_t k = 0; k < sizeof at / sizeof *at; k++) {
		char name[16], run[80];
		stopper s = {.phase = at[k].phase, .n = at[k].n};
		(void)snprintf(name, sizeof name, "%zu", k);
		aim(&l, name, usual, USUAL);
		(void)snprintf(run, sizeof run, "%s/run", l.f.root);
		l.f.params.run_dir = run;
		l.f.params.force = l.f.params.resume = false;
		l.f.params.progress = stop_at;
		l.f.params.progress_user = &s;
		l.f.t.ctx.cancel = &s.stop;
		assert_int_equal(reduce(&l.f), WH_E_INTERRUPT);
		s.stop = 0;
		s.phase = "";
		l.f.params.resume = true;
		assert_int_equal(reduce(&l.f), WH_OK);
		for (size_t i = 0; i < l.n; i++)
			same_bytes(whole[i], l.path[i]);
		for (size_t i = 0; i + 1 < l.n; i++) {
			assert_int_equal(l.f.report.level[i].faces, usual[i] & ~(uint64_t)1);
			assert_string_equal(l.f.report.level[i].checksum, report.level[i].checksum);
		}
		assert_int_equal(access(run, F_OK), -1);
	}
	drop(&l.f);
}

/* ---- errors, many sizes ---- */

static void errors_are_held_one_after_the_other(void **state)
{
	(void)state;
	levels l;
	open_levels(&l, WH_SYNTH_TERRAIN, 10000);
	aim(&l, "a", usual, 3);
	const double share[] = {0.001, 0.004, 0.02};
	for (size_t i = 0; i < 2; i++) {
		l.level[i].faces = 0;
		l.level[i].error_share = share[i];
	}
	l.f.params.faces = 0;
	l.f.params.error_share = share[2];
	assert_int_equal(reduce(&l.f), WH_OK);
	const wh_reduce_report *t = &l.f.report;
	for (size_t i = 0; i < 2; i++) {
		assert_true(t->level[i].accumulated_error > 0);
		assert_true(t->level[i].accumulated_error <= share[i] * t->diagonal * 1.000001);
	}
	assert_true(t->level[0].faces < 10000);
	assert_true(t->level[1].faces < t->level[0].faces);
	assert_true(t->output_faces < t->level[1].faces);
	drop(&l.f);
}

/* As many faces as a scan of an armadillo, and its sizes; the account is empty afterwards. */
static void a_scan_at_five_sizes(void **state)
{
	(void)state;
	static const uint64_t sizes[] = {75000, 10000, 5000, 2000, 500};
	levels l;
	open_levels(&l, WH_SYNTH_SPHERE, 172974);
	l.f.params.cluster_faces = 0;
	l.f.params.micro_faces = 16384;
	l.f.params.final_faces = 0;
	aim(&l, "a", sizes, MOST);
	assert_int_equal(reduce(&l.f), WH_OK);
	for (size_t i = 0; i + 1 < MOST; i++)
		assert_int_equal(l.f.report.level[i].faces, sizes[i]);
	assert_int_equal(l.f.report.output_faces, 500);
	drop(&l.f);
}

/* ---- what is not written ---- */

static void a_level_above_the_input_is_left_out(void **state)
{
	(void)state;
	static const uint64_t faces[] = {100000, 1000, 100};
	levels l;
	open_levels(&l, WH_SYNTH_SPHERE, 3000);
	aim(&l, "a", faces, 3);
	assert_int_equal(reduce(&l.f), WH_OK);
	assert_true(l.f.report.level[0].left_out);
	assert_false(l.f.report.level[1].left_out);
	assert_int_equal(access(l.path[0], F_OK), -1);
	assert_int_equal(access(l.path[1], F_OK), 0);
	drop(&l.f);
}

static void refused(levels *l, const char *words)
{
	assert_true(reduce(&l->f) != WH_OK);
	assert_non_null(strstr(l->f.t.ctx.err.text, words));
	assert_int_equal(entries(l->f.temp), 0);
}

static void levels_that_make_no_sense_are_refused(void **state)
{
	(void)state;
	levels l;
	open_levels(&l, WH_SYNTH_SPHERE, 3000);
	aim(&l, "a", usual, USUAL);
	l.level[1].output = l.path[3];
	refused(&l, "is the output of two levels");
	l.level[1].output = l.f.in;
	refused(&l, "the input, or the list");
	char again[4096]; /* by another name */
	(void)snprintf(again, sizeof again, "/.%s", l.f.in);
	l.level[1].output = again;
	refused(&l, "the input, or the list");
	l.level[1] = (wh_level){.output = l.path[1]};
	refused(&l, "level 2 has no limit");
	l.level[1] = (wh_level){.faces = 10};
	refused(&l, "no file to go to");
	l.level[1] = (wh_level){.faces = 1000, .output = l.path[1]};
	FILE *f = fopen(l.path[1], "w");
	assert_non_null(f);
	(void)fclose(f);
	l.f.params.force = false;
	refused(&l, "1.ply");
	assert_int_equal(access(l.path[0], F_OK), -1);
	drop(&l.f);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	    cmocka_unit_test(every_level_has_its_count_and_is_clean),
	    cmocka_unit_test(a_level_is_as_good_as_a_run_of_its_own),
	    cmocka_unit_test(threads_and_ceiling_change_no_byte),
	    cmocka_unit_test(a_run_that_was_stopped_goes_on),
	    cmocka_unit_test(errors_are_held_one_after_the_other),
	    cmocka_unit_test(a_scan_at_five_sizes),
	    cmocka_unit_test(a_level_above_the_input_is_left_out),
	    cmocka_unit_test(levels_that_make_no_sense_are_refused),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
