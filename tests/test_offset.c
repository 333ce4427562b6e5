/*
 * Where a mesh lies and in which units its coordinates are leaves no trace in the result: wh_reduce
 * from file to file, on the same surface moved and scaled.
 */
#define _XOPEN_SOURCE 700
#include "testing.h"

#include "algo/compare.h"
#include "algo/synth.h"
#include "io/outfile.h"
#include "pipeline/normalise.h"
#include "whittle.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

typedef struct fixture {
	testing_env t;
	char root[40], in[64], out[64];
	bool is_double;
	wh_mesh mesh, input, result; /* as made; as written, moved and scaled; reduced */
	wh_reduce_params params;
	wh_reduce_report report;
} fixture;

/* A surface whose positions are multiples of 2^-10; several rounds to reduce it. */
static void make(fixture *f, wh_synth_kind kind, bool is_double)
{
	*f = (fixture){.root = "/tmp/whittle-offset-XXXXXX", .is_double = is_double};
	testing_init(&f->t);
	assert_non_null(mkdtemp(f->root));
	(void)snprintf(f->in, sizeof f->in, "%s/in.ply", f->root);
	(void)snprintf(f->out, sizeof f->out, "%s/out.ply", f->root);
	wh_synth_params p = wh_synth_defaults();
	p.kind = kind;
	p.faces = 16000;
	p.seed = 5;
	wh_synth *s;
	assert_int_equal(wh_synth_open(&f->t.ctx, &s, &p), WH_OK);
	assert_int_equal(wh_synth_mesh(&f->t.ctx, s, &f->mesh), WH_OK);
	wh_synth_close(&f->t.ctx, &s);
	f->params = wh_reduce_defaults();
	f->params.input = f->in;
	f->params.output = f->out;
	f->params.temp_dir = f->root;
	f->params.force = true;
	f->params.threads = 2;
	f->params.memory = (size_t)256 << 20;
	f->params.cluster_faces = 4000;
	f->params.micro_faces = 1000;
	f->params.final_faces = 4000;
}

static void drop(fixture *f)
{
	wh_mesh_free(&f->t.ctx, &f->mesh);
	wh_mesh_free(&f->t.ctx, &f->input);
	wh_mesh_free(&f->t.ctx, &f->result);
	assert_int_equal(unlink(f->in), 0);
	assert_int_equal(unlink(f->out), 0);
	assert_int_equal(rmdir(f->root), 0);
	testing_done(&f->t);
}

static wh_mesh load(fixture *f, const char *path)
{
	const wh_exec ex = {.workers = 1};
	wh_spill spill;
	wh_mesh m;
	assert_int_equal(wh_spill_open(&f->t.ctx, &spill, f->root, NULL), WH_OK);
	assert_int_equal(wh_load_mesh(&f->t.ctx, &ex, &spill, path, WH_FORMAT_ANY, &m, NULL, NULL),
	                 WH_OK);
	wh_spill_close(&f->t.ctx, &spill);
	return m;
}

static void write_scaled(fixture *f, double scale, wh_vec3 offset)
{
	wh_ctx *c = &f->t.ctx;
	const wh_mesh *m = &f->mesh;
	const wh_ply_style style = {.is_double = f->is_double};
	wh_outfile *o;
	assert_int_equal(wh_outfile_open(c, &o, f->in, true), WH_OK);
	assert_int_equal(wh_ply_write_header(c, o, style, m->nv, m->nf), WH_OK);
	for (uint32_t v = 0; v < m->nv; v++) {
		const wh_vec3 p = wh_add(wh_scale(m->pos[v], scale), offset);
		assert_int_equal(wh_ply_write_vertices(c, o, style, &p.x, 1), WH_OK);
	}
	assert_int_equal(wh_ply_write_triangles(c, o, style, m->tri, NULL, m->nf), WH_OK);
	assert_int_equal(wh_outfile_commit(c, &o), WH_OK);
}

/* Reduces the mesh as it is when scaled and then moved. */
static void reduce(fixture *f, double scale, wh_vec3 offset)
{
	write_scaled(f, scale, offset);
	if (wh_reduce(&f->t.ctx, &f->params, &f->report) != WH_OK)
		fail_msg("%s", f->t.ctx.err.text);
	wh_mesh_free(&f->t.ctx, &f->input);
	wh_mesh_free(&f->t.ctx, &f->result);
	f->input = load(f, f->in);
	f->result = load(f, f->out);
	assert_true(f->result.nf < f->input.nf / 4);
}

/* Takes the result out of the fixture. */
static wh_mesh take_result(fixture *f)
{
	const wh_mesh m = f->result;
	f->result = (wh_mesh){0};
	return m;
}

static bool same_bits(double a, double b)
{
	return memcmp(&a, &b, sizeof a) == 0;
}

/* The result is `plain`, scaled and moved, to the last bit. */
static void assert_moved(const fixture *f, const wh_mesh *plain, double scale, wh_vec3 offset)
{
	const wh_mesh *m = &f->result;
	assert_int_equal(m->nv, plain->nv);
	assert_int_equal(m->nf, plain->nf);
	assert_memory_equal(m->tri, plain->tri, 3 * sizeof *m->tri * m->nf);
	for (uint32_t v = 0; v < m->nv; v++) {
		const wh_vec3 a = wh_sub(m->pos[v], offset), b = wh_scale(plain->pos[v], scale);
		assert_true(same_bits(a.x, b.x) && same_bits(a.y, b.y) && same_bits(a.z, b.z));
	}
}

/* ---- offsets ---- */

static const wh_vec3 nowhere = {0, 0, 0};

/* Multiples of 2^-10: nothing is lost when they are added. */
static const wh_vec3 offsets[] = {
    {500000, 5200000, 300},         /* a place in Europe, in metres */
    {0x1p40, -0x1p40, 0x1p40},      /* whose doubles are 2^-12 apart */
    {-3e9, -7000000.0009765625, 0}, /* on the other side of zero */
    {4000, -2500.25, 0.5}           /* zero inside the box, elsewhere */
};

enum { OFFSETS = sizeof offsets / sizeof *offsets };

static void offsets_leave_no_trace(fixture *f)
{
	reduce(f, 1, nowhere);
	wh_mesh plain = take_result(f);
	const double err = f->report.accumulated_error;
	for (int i = 0; i < OFFSETS; i++) {
		reduce(f, 1, offsets[i]);
		assert_moved(f, &plain, 1, offsets[i]);
		assert_true(same_bits(f->report.accumulated_error, err));
	}
	wh_mesh_free(&f->t.ctx, &plain);
	drop(f);
}

static void offsets_leave_no_trace_on_a_sphere(void **state)
{
	(void)state;
	fixture f;
	make(&f, WH_SYNTH_SPHERE, true);
	f.params.face_ratio = 0.1;
	offsets_leave_no_trace(&f);
}

static void offsets_leave_no_trace_in_text(void **state)
{
	(void)state;
	fixture f;
	make(&f, WH_SYNTH_TORUS, true);
	f.params.face_ratio = 0.01;
	f.params.ascii = true;
	offsets_leave_no_trace(&f);
}

static void offsets_leave_no_trace_beside_a_locked_boundary(void **state)
{
	(void)state;
	fixture f;
	make(&f, WH_SYNTH_TERRAIN, true);
	f.params.face_ratio = 0.2;
	f.params.lock_boundary = true;
	offsets_leave_no_trace(&f);
}

static void offsets_leave_no_trace_below_an_error_limit(void **state)
{
	(void)state;
	fixture f;
	make(&f, WH_SYNTH_TERRAIN, true);
	f.params.error_share = 0.003;
	offsets_leave_no_trace(&f);
}

/* ---- positions with all their bits ---- */

static const double IRRATIONAL = 0.73205080756887729; /* sqrt(3) - 1 */

static double rms(fixture *f)
{
	const wh_exec ex = {.workers = 2};
	const wh_compare_params p = {.samples = 50000};
	wh_compare r;
	assert_int_equal(wh_compare_meshes(&f->t.ctx, &ex, &f->input, &f->result, &p, &r), WH_OK);
	return r.rms / r.diagonal;
}

/* At 1e12 a position keeps 13 bits behind the point, of a mesh 14000 wide. */
static void bits_lost_by_moving_cost_nothing(void **state)
{
	(void)state;
	const wh_vec3 far[] = {{1234567.1, 98765432.1, -1.0 / 3}, {-1e12, 1e12 / 3, 7e11}};
	fixture f;
	make(&f, WH_SYNTH_SPHERE, true);
	f.params.face_ratio = 0.1;
	reduce(&f, IRRATIONAL, nowhere);
	const double plain = rms(&f);
	for (size_t i = 0; i < sizeof far / sizeof *far; i++) {
		reduce(&f, IRRATIONAL, far[i]);
		assert_true(fabs(rms(&f) / plain - 1) < 0.01);
	}
	drop(&f);
}

static int compare_positions(const void *a, const void *b)
{
	return memcmp(a, b, sizeof(wh_vec3));
}

typedef struct edge {
	uint32_t a, b; /* a < b */
} edge;

static int compare_edges(const void *x, const void *y)
{
	const edge *p = x, *q = y;
	if (p->a != q->a)
		return p->a < q->a ? -1 : 1;
	return (p->b > q->b) - (p->b < q->b);
}

/* Every vertex of an edge with one face is in the result with the bits it had in the file. */
static void boundary_is_kept(const wh_mesh *in, wh_mesh *out)
{
	edge *all = malloc(3 * sizeof *all * in->nf);
	const size_t n = 3 * (size_t)in->nf;
	uint32_t found = 0;
	assert_non_null(all);
	for (size_t i = 0; i < n; i++) {
		const uint32_t a = in->tri[i], b = in->tri[i % 3 == 2 ? i - 2 : i + 1];
		all[i] = a < b ? (edge){a, b} : (edge){b, a};
	}
	qsort(all, n, sizeof *all, compare_edges);
	qsort(out->pos, out->nv, sizeof *out->pos, compare_positions);
	for (size_t i = 0; i < n; i++) {
		if ((i > 0 && compare_edges(&all[i - 1], &all[i]) == 0) ||
		    (i + 1 < n && compare_edges(&all[i + 1], &all[i]) == 0))
			continue;
		assert_non_null(bsearch(&in->pos[all[i].a], out->pos, out->nv, sizeof *out->pos,
		                        compare_positions));
		assert_non_null(bsearch(&in->pos[all[i].b], out->pos, out->nv, sizeof *out->pos,
		                        compare_positions));
		found++;
	}
	free(all);
	assert_true(found > 100);
}

static void a_locked_boundary_keeps_every_bit(void **state)
{
	(void)state;
	const wh_vec3 where[] = {
	    {0, 0, 0}, {1e7 / 3, -1e-7, 1e3 / 7}, {10980.1, -1e15 / 3, 0.1}, {-1e4, -1e4, 1e-20}};
	fixture f;
	make(&f, WH_SYNTH_TERRAIN, true);
	f.params.face_ratio = 0.2;
	f.params.lock_boundary = true;
	for (size_t i = 0; i < sizeof where / sizeof *where; i++) {
		reduce(&f, IRRATIONAL, where[i]);
		boundary_is_kept(&f.input, &f.result);
	}
	drop(&f);
}

/* ---- units ---- */

static void units_leave_no_trace(fixture *f, const int *exponents, int n)
{
	reduce(f, 1, nowhere);
	wh_mesh plain = take_result(f);
	const wh_reduce_report was = f->report;
	f->result = load(f, f->out);
	const double distance = rms(f);
	for (int i = 0; i < n; i++) {
		const double scale = ldexp(1, exponents[i]);
		reduce(f, scale, nowhere);
		assert_moved(f, &plain, scale, nowhere);
		assert_true(same_bits(f->report.cost_distance, was.cost_distance * scale));
		assert_true(same_bits(f->report.accumulated_error, was.accumulated_error * scale));
		assert_true(same_bits(f->report.diagonal, was.diagonal * scale));
		assert_true(fabs(rms(f) / distance - 1) < 1e-9);
	}
	wh_mesh_free(&f->t.ctx, &plain);
	drop(f);
}

/* Costs of the plain mesh are up to 2^84; a double ends at 2^1024. */
static void units_of_doubles_leave_no_trace(void **state)
{
	(void)state;
	const int exponents[] = {-980, -200, -60, 60, 200, 1005};
	fixture f;
	make(&f, WH_SYNTH_SPHERE, true);
	f.params.error_share = 0.003;
	units_leave_no_trace(&f, exponents, 6);
}

static void units_of_floats_leave_no_trace(void **state)
{
	(void)state;
	const int exponents[] = {-100, -50, 50, 110};
	fixture f;
	make(&f, WH_SYNTH_TORUS, false);
	f.params.face_ratio = 0.1;
	units_leave_no_trace(&f, exponents, 4);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	    cmocka_unit_test(offsets_leave_no_trace_on_a_sphere),
	    cmocka_unit_test(offsets_leave_no_trace_in_text),
	    cmocka_unit_test(offsets_leave_no_trace_beside_a_locked_boundary),
	    cmocka_unit_test(offsets_leave_no_trace_below_an_error_limit),
	    cmocka_unit_test(bits_lost_by_moving_cost_nothing),
	    cmocka_unit_test(a_locked_boundary_keeps_every_bit),
	    cmocka_unit_test(units_of_doubles_leave_no_trace),
	    cmocka_unit_test(units_of_floats_leave_no_trace),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
