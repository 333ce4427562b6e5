/*
 * A caller's own policy through wh_reduce: what it forbids stays, what it moves is moved, what it
 * is told is right, and it decides the same on any number of threads. As an example of one, see
 * `keep_left`.
 */
#define _XOPEN_SOURCE 700
#include "reduce_files.h"

#include <math.h>
#include <stdatomic.h>

/* What a caller wants: left of a line nothing is to change; right of it the default of other
 * programs will do, squared length. */
typedef struct wish {
	double line;
	_Atomic uint64_t asked, wrong;
	volatile int stop;
} wish;

static double length2(const double d[3])
{
	return d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
}

static double keep_left(void *user, const wh_edge_view *edge, double place[3])
{
	wish *w = user;
	(void)place;
	atomic_fetch_add(&w->asked, 1);
	const double first = edge->origin[0], second = first + edge->second[0];
	if (first < w->line || second < w->line)
		return INFINITY;
	return length2(edge->second);
}

/* Vertices of a binary PLY of floats that lie left of the line. */
static uint64_t left_of(const char *path, double line)
{
	char text[128];
	unsigned long long nv = 0, n = 0;
	FILE *f = fopen(path, "rb");
	assert_non_null(f);
	while (fgets(text, sizeof text, f) && strcmp(text, "end_header\n") != 0)
		if (strncmp(text, "element vertex ", 15) == 0)
			nv = strtoull(text + 15, NULL, 10);
	for (unsigned long long v = 0; v < nv; v++) {
		float p[3];
		assert_int_equal(fread(p, sizeof p, 1, f), 1);
		n += (double)p[0] < line;
	}
	(void)fclose(f);
	return n;
}

static void what_it_forbids_stays(void **state)
{
	(void)state;
	fixture f;
	const wh_synth_params s = surface(WH_SYNTH_SPHERE, 20000);
	make(&f, &s);
	wish w = {.line = 0};
	const wh_own_policy own = {.cost = keep_left, .user = &w, .name = "keep left"};
	f.params.own = &own;
	f.params.placement =
	    "midpoint"; /* of two that are right of the line, so is what is between */
	f.params.faces = 12000;
	assert_int_equal(reduce(&f), WH_OK);
	assert_int_equal(f.report.output_faces, 12000);
	assert_true(atomic_load(&w.asked) > 8000);
	const uint64_t before = left_of(f.in, w.line);
	assert_true(before > 4000);
	assert_int_equal(left_of(f.out, w.line), before);
	drop(&f);
}

static void it_decides_the_same_on_any_number_of_threads(void **state)
{
	(void)state;
	fixture f;
	char other[80];
	const wh_synth_params s = surface(WH_SYNTH_SPHERE, 20000);
	make(&f, &s);
	wish w = {.line = -1e9};
	const wh_own_policy own = {.cost = keep_left, .user = &w, .name = "length"};
	f.params.own = &own;
	f.params.faces = 1000;
	assert_int_equal(reduce(&f), WH_OK);
	(void)snprintf(other, sizeof other, "%s/other.ply", f.out_dir);
	f.params.output = other;
	f.params.threads = 1;
	assert_int_equal(reduce(&f), WH_OK);
	same_bytes(f.out, other);
	drop(&f);
}

static bool near(const double a[3], double x, double y, double z)
{
	return fabs(a[0] - x) + fabs(a[1] - y) + fabs(a[2] - z) < 1e-4;
}

/* Is everything that is told of the edge as it has to be? */
static double look_around(void *user, const wh_edge_view *e, double place[3])
{
	wish *w = user;
	bool ok = e->shared == (e->boundary ? 1U : 2U) && e->faces >= e->shared + e->of_first;
	for (uint32_t i = 0; i < e->faces; i++) {
		bool first = false, second = false;
		for (int k = 0; k < 3; k++) {
			const double *c = e->face[i][k];
			first = first || near(c, 0, 0, 0);
			second = second || near(c, e->second[0], e->second[1], e->second[2]);
		}
		ok = ok && first == (i < e->shared + e->of_first) &&
		     second == (i < e->shared || i >= e->shared + e->of_first);
	}
	ok = ok && (!e->locked || near(place, e->second[0], e->second[1], e->second[2]));
	ok = ok && (!e->boundary || e->first_open);
	if (!ok)
		atomic_fetch_add(&w->wrong, 1);
	atomic_fetch_add(&w->asked, 1);
	return length2(e->second);
}

static void what_it_is_told_is_right(void **state)
{
	(void)state;
	fixture f;
	const wh_synth_params s = surface(WH_SYNTH_TERRAIN, 12000);
	make(&f, &s);
	wish w = {0};
	const wh_own_policy own = {.cost = look_around, .user = &w, .name = "look"};
	f.params.own = &own;
	f.params.faces = 3000;
	assert_int_equal(reduce(&f), WH_OK);
	assert_true(atomic_load(&w.asked) > 10000);
	assert_int_equal(atomic_load(&w.wrong), 0);
	drop(&f);
}

/* New vertices go to the second end; a NaN and what is below 0 do no harm. */
static double lift(void *user, const wh_edge_view *e, double place[3])
{
	wish *w = user;
	const uint64_t n = atomic_fetch_add(&w->asked, 1);
	if (n == 0)
		return NAN;
	place[0] = e->second[0];
	place[1] = e->second[1];
	place[2] = e->second[2];
	return n == 1 ? -1 : length2(e->second);
}

static void it_may_put_the_vertex_at_the_other_end(void **state)
{
	(void)state;
	fixture f;
	const wh_synth_params s = surface(WH_SYNTH_SPHERE, 3000);
	make(&f, &s);
	wish w = {0};
	const wh_own_policy own = {.cost = lift, .user = &w, .name = "other end"};
	f.params.own = &own;
	f.params.threads = 1;
	f.params.faces = 2998;
	assert_int_equal(reduce(&f), WH_OK);
	/* all vertices left are old ones: as many to the left of any line, or one less */
	for (double line = -8000; line <= 8000; line += 1000) {
		const uint64_t before = left_of(f.in, line), after = left_of(f.out, line);
		assert_true(after == before || after + 1 == before);
	}
	drop(&f);
}

/* ---- what is refused ---- */

static void refused(fixture *f, const char *words)
{
	assert_int_equal(reduce(f), WH_E_USAGE);
	assert_non_null(strstr(f->t.ctx.err.text, words));
	nothing_is_left(f);
}

static void names_that_are_none_are_refused(void **state)
{
	(void)state;
	fixture f;
	const wh_synth_params s = surface(WH_SYNTH_SPHERE, 1000);
	make(&f, &s);
	f.params.faces = 100;
	f.params.cost = "price";
	refused(&f, "'price' is no cost");
	f.params.cost = "qem";
	f.params.face_weight = "heavy";
	refused(&f, "'heavy' is no weight");
	f.params.face_weight = "angle";
	f.params.placement = "anywhere";
	refused(&f, "'anywhere' is no placement");
	f.params.placement = NULL;
	f.params.simplify_topology = true;
	refused(&f, "--topology simplify goes with the memoryless cost only");
	f.params.simplify_topology = false;
	assert_int_equal(reduce(&f), WH_OK);
	drop(&f);
}

static double stop_later(void *user, const wh_edge_view *e, double place[3])
{
	wish *w = user;
	(void)place;
	if (atomic_fetch_add(&w->asked, 1) == 100000) /* the user has had enough */
		__atomic_store_n(&w->stop, 1, __ATOMIC_RELAXED);
	return length2(e->second);
}

/* A run that is resumed goes on with the policy of the same name and with no other. */
static void a_resumed_run_keeps_its_policy(void **state)
{
	(void)state;
	fixture f;
	char folder[80];
	const wh_synth_params s = surface(WH_SYNTH_SPHERE, 20000);
	make(&f, &s);
	(void)snprintf(folder, sizeof folder, "%s/run", f.root);
	wish w = {.line = -1e9};
	wh_own_policy own = {.cost = stop_later, .user = &w, .name = "a"};
	f.params.own = &own;
	f.params.run_dir = folder;
	f.params.faces = 1000;
	f.t.ctx.cancel = &w.stop;
	assert_int_equal(reduce(&f), WH_E_INTERRUPT);
	w.stop = 0;
	f.params.resume = true;
	own = (wh_own_policy){.cost = keep_left, .user = &w, .name = "b"};
	assert_int_equal(reduce(&f), WH_E_USAGE);
	assert_non_null(strstr(f.t.ctx.err.text, "own_hash was"));
	own.name = "a";
	assert_int_equal(reduce(&f), WH_OK);
	assert_int_equal(f.report.output_faces, 1000);
	drop(&f);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	    cmocka_unit_test(what_it_forbids_stays),
	    cmocka_unit_test(it_decides_the_same_on_any_number_of_threads),
	    cmocka_unit_test(what_it_is_told_is_right),
	    cmocka_unit_test(it_may_put_the_vertex_at_the_other_end),
	    cmocka_unit_test(names_that_are_none_are_refused),
	    cmocka_unit_test(a_resumed_run_keeps_its_policy),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
