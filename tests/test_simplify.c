/*
 * The engine on meshes that fit a drawing, on grids, and on soup: what must stay stays, counts
 * are hit exactly, limits hold, and pieces reduced apart fit together again.
 */
#include "patches.h"

#include "algo/compare.h"
#include "algo/simplify.h"
#include "algo/synth.h"
#include "base/rng.h"
#include "mesh/check.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* ---- a patch and what is asked of it ---- */

typedef struct fixture {
	testing_env t;
	wh_patch p;
	wh_simplify_workspace *w;
	wh_simplify_result done;
} fixture;

static void open_fixture(fixture *f)
{
	*f = (fixture){0};
	testing_init(&f->t);
	f->w = wh_simplify_workspace_new(&f->t.ctx);
	assert_non_null(f->w);
}

static void drop(fixture *f)
{
	wh_simplify_workspace_free(&f->t.ctx, f->w);
	wh_patch_free(&f->t.ctx, &f->p);
	testing_done(&f->t);
}

static void draw(fixture *f, const wh_vec3 *pos, uint32_t nv, const uint32_t (*tri)[3], uint32_t nf)
{
	open_fixture(f);
	patch_room(&f->t, &f->p, nv, nf);
	memcpy(f->p.pos, pos, nv * sizeof *pos);
	memcpy(f->p.tri, tri, nf * sizeof *tri);
}

static wh_simplify_params no_limits(void)
{
	return (wh_simplify_params){.max_cost = (double)INFINITY, .max_err = (double)INFINITY};
}

static void reduce_with(fixture *f, const wh_simplify_params *p)
{
	assert_int_equal(wh_simplify(&f->t.ctx, f->w, &f->p, p, &f->done), WH_OK);
	for (size_t i = 0; i < 3 * (size_t)f->p.nf; i++)
		assert_true(f->p.tri[i] < f->p.nv);
}

static void reduce_to(fixture *f, uint32_t faces)
{
	wh_simplify_params p = no_limits();
	p.target_faces = faces;
	reduce_with(f, &p);
}

static wh_check look(fixture *f)
{
	const wh_mesh m = {.nv = f->p.nv, .nf = f->p.nf, .pos = f->p.pos, .tri = f->p.tri};
	wh_check r;
	assert_int_equal(wh_check_mesh(&f->t.ctx, &m, &r), WH_OK);
	return r;
}

/* Nothing that a collapse may not change has changed. */
static void same_topology(const wh_check *a, const wh_check *b)
{
	assert_int_equal(a->nonmanifold_edges, b->nonmanifold_edges);
	assert_int_equal(a->nonmanifold_vertices, b->nonmanifold_vertices);
	assert_int_equal(a->misoriented_edges, b->misoriented_edges);
	assert_int_equal(a->duplicate_faces, b->duplicate_faces);
	assert_int_equal(a->degenerate_faces, b->degenerate_faces);
	assert_int_equal(a->components, b->components);
	assert_int_equal(a->boundary_loops, b->boundary_loops);
	assert_int_equal(a->euler, b->euler);
}

/* ---- larger meshes ---- */

/* Grid of nx x ny cells over the unit square, two faces a cell, all seen from above. Vertex
 * (x, y) is number y * (nx + 1) + x. */
static void grid(fixture *f, uint32_t nx, uint32_t ny, double noise, uint64_t seed)
{
	open_fixture(f);
	patch_room(&f->t, &f->p, (nx + 1) * (ny + 1), 2 * nx * ny);
	wh_rng g = wh_rng_seed(seed);
	for (uint32_t v = 0; v < f->p.nv; v++) {
		const double x = (double)(v % (nx + 1)) / nx, y = (double)(v / (nx + 1)) / ny;
		f->p.pos[v] = wh_v3(x, y, noise * (wh_rng_unit(&g) - 0.5));
	}
	uint32_t *t = f->p.tri;
	for (uint32_t y = 0; y < ny; y++)
		for (uint32_t x = 0; x < nx; x++) {
			const uint32_t a = y * (nx + 1) + x, b = a + 1, c = a + nx + 1, d = c + 1;
			const uint32_t two[6] = {a, b, d, a, d, c};
			memcpy(t, two, sizeof two);
			t += 6;
		}
}

/* A ring of n x m cells: the strip between two circles in a plane, a little bent. */
static void annulus(fixture *f, uint32_t n, uint32_t m)
{
	open_fixture(f);
	patch_room(&f->t, &f->p, n * (m + 1), 2 * n * m);
	for (uint32_t v = 0; v < f->p.nv; v++) {
		const double angle = 2 * 3.14159265358979 * (v % n) / n,
		             r = 1 + (double)(v / n) / m;
		f->p.pos[v] = wh_v3(r * cos(angle), r * sin(angle), 0.1 * sin(3 * angle) * r);
	}
	uint32_t *t = f->p.tri;
	for (uint32_t j = 0; j < m; j++)
		for (uint32_t i = 0; i < n; i++) {
			const uint32_t a = j * n + i, b = j * n + (i + 1) % n;
			const uint32_t two[6] = {a, a + n, b + n, a, b + n, b};
			memcpy(t, two, sizeof two);
			t += 6;
		}
}

/* `copies` generated surfaces side by side. */
static void synth(fixture *f, wh_synth_kind kind, uint64_t faces, uint32_t copies)
{
	open_fixture(f);
	wh_synth_params sp = wh_synth_defaults();
	sp.kind = kind;
	sp.faces = faces;
	wh_synth *s;
	wh_mesh m;
	assert_int_equal(wh_synth_open(&f->t.ctx, &s, &sp), WH_OK);
	assert_int_equal(wh_synth_mesh(&f->t.ctx, s, &m), WH_OK);
	patch_room(&f->t, &f->p, copies * m.nv, copies * m.nf);
	for (uint32_t k = 0; k < copies; k++) {
		const wh_vec3 to = wh_v3(30000.0 * k, 0, 0);
		for (uint32_t v = 0; v < m.nv; v++)
			f->p.pos[k * m.nv + v] = wh_add(m.pos[v], to);
		for (size_t i = 0; i < 3 * (size_t)m.nf; i++)
			f->p.tri[3 * (size_t)k * m.nf + i] = m.tri[i] + k * m.nv;
	}
	wh_mesh_free(&f->t.ctx, &m);
	wh_synth_close(&f->t.ctx, &s);
}

static double area_z(const wh_patch *p, uint32_t f)
{
	const uint32_t *t = &p->tri[3 * (size_t)f];
	const wh_vec3 a = p->pos[t[0]], b = p->pos[t[1]], d = p->pos[t[2]];
	return wh_cross(wh_sub(b, a), wh_sub(d, a)).z / 2;
}

/* ---- what cannot be reduced stays ---- */

static void a_tetrahedron_stays(void **state)
{
	(void)state;
	const wh_vec3 pos[] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
	const uint32_t tri[][3] = {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}};
	fixture f;
	draw(&f, pos, 4, tri, 4);
	reduce_to(&f, 1);
	assert_int_equal(f.p.nf, 4);
	assert_int_equal(f.done.collapses, 0);
	assert_true(f.done.exhausted);
	assert_memory_equal(f.p.pos, pos, sizeof pos);
	drop(&f);
}

static void a_triangle_stays(void **state)
{
	(void)state;
	const wh_vec3 pos[] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
	const uint32_t tri[][3] = {{0, 1, 2}};
	fixture f;
	draw(&f, pos, 3, tri, 1);
	wh_simplify_params p = no_limits();
	p.target_vertices = 1;
	reduce_with(&f, &p);
	assert_int_equal(f.p.nf, 1);
	assert_true(f.done.exhausted);
	drop(&f);
}

static void an_empty_patch_stays_empty(void **state)
{
	(void)state;
	fixture f;
	open_fixture(&f);
	const wh_simplify_params p = no_limits();
	reduce_with(&f, &p);
	assert_true(f.p.nf == 0 && f.p.nv == 0);
	drop(&f);
}

/* Two triangles with one side in common lose one, by a boundary edge, and no more. */
static void a_square_becomes_a_triangle(void **state)
{
	(void)state;
	fixture f;
	grid(&f, 1, 1, 0, 0);
	reduce_to(&f, 1);
	assert_int_equal(f.p.nf, 1);
	assert_int_equal(f.p.nv, 3);
	drop(&f);
}

/* A hole of one face: its three edges may neither shrink nor close. */
static void a_pinhole_stays(void **state)
{
	(void)state;
	fixture f;
	synth(&f, WH_SYNTH_SPHERE, 2000, 1);
	f.p.nf--; /* the last face goes */
	reduce_to(&f, 1);
	const wh_check c = look(&f);
	assert_int_equal(c.boundary_edges, 3);
	assert_int_equal(c.boundary_loops, 1);
	assert_int_equal(c.euler, 1);
	assert_true(wh_check_clean(&c));
	assert_true(f.p.nf < 200);
	drop(&f);
}

static void an_annulus_keeps_two_loops(void **state)
{
	(void)state;
	fixture f;
	annulus(&f, 40, 10);
	const wh_check before = look(&f);
	assert_int_equal(before.boundary_loops, 2);
	reduce_to(&f, 1);
	const wh_check c = look(&f);
	same_topology(&before, &c);
	assert_true(wh_check_clean(&c));
	assert_true(f.p.nf <= 40);
	drop(&f);
}

static void a_torus_keeps_its_handle(void **state)
{
	(void)state;
	fixture f;
	synth(&f, WH_SYNTH_TORUS, 4000, 1);
	reduce_to(&f, 1);
	const wh_check c = look(&f);
	assert_int_equal(c.genus, 1);
	assert_int_equal(c.components, 1);
	assert_true(wh_check_clean(&c));
	assert_true(f.p.nf >= 14 && f.p.nf < 200); /* 14 is the least there is */
	drop(&f);
}

static void two_spheres_stay_two(void **state)
{
	(void)state;
	fixture f;
	synth(&f, WH_SYNTH_SPHERE, 1500, 2);
	reduce_to(&f, 1);
	const wh_check c = look(&f);
	assert_int_equal(c.components, 2);
	assert_int_equal(c.euler, 4);
	assert_true(wh_check_clean(&c));
	assert_true(f.p.nf < 300);
	drop(&f);
}

/* ---- counts ---- */

static void closed_meshes_reach_even_counts_and_one_less_than_odd_ones(void **state)
{
	(void)state;
	for (uint32_t target = 900; target < 910; target++) {
		fixture f;
		synth(&f, WH_SYNTH_SPHERE, 2000, 1);
		reduce_to(&f, target);
		assert_int_equal(f.p.nf, target & ~1u);
		assert_false(f.done.exhausted);
		drop(&f);
	}
}

static void open_meshes_reach_any_count(void **state)
{
	(void)state;
	for (uint32_t target = 300; target < 310; target++) {
		fixture f;
		grid(&f, 24, 24, 0.02, target);
		reduce_to(&f, target);
		assert_int_equal(f.p.nf, target);
		assert_false(f.done.exhausted);
		drop(&f);
	}
}

static void vertex_counts_are_exact(void **state)
{
	(void)state;
	for (uint32_t target = 100; target < 110; target++) {
		fixture f;
		grid(&f, 20, 20, 0.02, target);
		wh_simplify_params p = no_limits();
		p.target_vertices = target;
		reduce_with(&f, &p);
		assert_int_equal(f.p.nv, target);
		assert_int_equal(look(&f).unreferenced_vertices, 0);
		drop(&f);
	}
}

/* Of two counts the one reached first holds. */
static void the_first_limit_stops(void **state)
{
	(void)state;
	fixture f;
	grid(&f, 20, 20, 0.02, 1);
	wh_simplify_params p = no_limits();
	p.target_vertices = 300;
	p.target_faces = 10;
	reduce_with(&f, &p);
	assert_int_equal(f.p.nv, 300);
	drop(&f);
}

static void a_target_above_the_count_changes_nothing(void **state)
{
	(void)state;
	fixture f;
	grid(&f, 5, 5, 0.02, 1);
	reduce_to(&f, 50);
	assert_int_equal(f.p.nf, 50);
	assert_int_equal(f.done.collapses, 0);
	assert_false(f.done.exhausted);
	drop(&f);
}

static void the_cost_limit_holds(void **state)
{
	(void)state;
	uint32_t last = UINT32_MAX;
	for (double limit = 1e-14; limit < 1e-5; limit *= 100) {
		fixture f;
		grid(&f, 30, 30, 0.02, 2);
		wh_simplify_params p = no_limits();
		p.max_cost = limit;
		reduce_with(&f, &p);
		assert_true(f.done.highest_cost <= limit);
		assert_true(f.p.nf <= last);
		last = f.p.nf;
		drop(&f);
	}
	assert_true(last < 400);
}

/* What was collapsed at what cost, and how many faces went, is what the log says. */
static void the_log_counts_every_collapse(void **state)
{
	(void)state;
	wh_cost_log *log = calloc(1, sizeof *log);
	assert_non_null(log);
	fixture f;
	grid(&f, 30, 30, 0.02, 2);
	wh_simplify_params p = no_limits();
	p.log = log;
	p.log_in_order = true;
	p.target_faces = 100;
	const uint32_t before = f.p.nf;
	reduce_with(&f, &p);
	uint64_t collapses = 0, faces = 0;
	uint32_t last = 0;
	for (uint32_t b = 0; b < WH_LOG_BINS; b++)
		if (log->collapses[b]) {
			collapses += log->collapses[b];
			faces += log->faces[b];
			last = b;
		}
	assert_int_equal(collapses, f.done.collapses);
	assert_int_equal(faces, before - f.p.nf);
	assert_true(f.done.highest_cost < wh_log_cost(last));
	assert_true(f.done.highest_cost >= wh_log_cost(last - 1));
	free(log);
	drop(&f);
}

/* ---- shape ---- */

/*  +--+--+        +-----+
 *  |/ |/ |        |   / |
 *  +--+--+   ->   |  /  |     the four corners and the area stay
 *  |/ |/ |        | /   |
 *  +--+--+        +-----+    */
static void a_flat_square_keeps_its_corners_alone(void **state)
{
	(void)state;
	fixture f;
	grid(&f, 20, 20, 0, 0);
	reduce_to(&f, 2);
	assert_int_equal(f.p.nf, 2);
	double area = 0;
	for (uint32_t i = 0; i < f.p.nf; i++) {
		assert_true(area_z(&f.p, i) > 0);
		area += area_z(&f.p, i);
	}
	assert_true(fabs(area - 1) < 1e-5);
	const wh_check c = look(&f);
	assert_true(wh_norm(c.lo) < 1e-5);
	assert_true(wh_norm(wh_sub(c.hi, wh_v3(1, 1, 0))) < 1e-5);
	drop(&f);
}

static uint32_t faces_downward(const wh_patch *p)
{
	uint32_t n = 0;
	for (uint32_t f = 0; f < p->nf; f++)
		n += area_z(p, f) > 0 ? 0 : 1;
	return n;
}

/*  d-----c      The least costly place of an edge's vertex may lie beyond a neighbour's far
 *  |\ u /|      side. Seen from above, no face of a gentle relief is ever turned. */
static void gentle_relief_never_folds(void **state)
{
	(void)state;
	for (uint64_t seed = 0; seed < 10; seed++) {
		fixture f;
		grid(&f, 50, 50, 0.004, seed); /* slopes up to a fifth */
		reduce_to(&f, 2000);
		assert_int_equal(f.p.nf, 2000);
		assert_int_equal(faces_downward(&f.p), 0);
		drop(&f);
	}
}

/* A face may turn by 78 degrees in one collapse, so a few do turn over in several steps where the
 * noise is as steep as this. */
static void few_faces_of_steep_noise_turn_over(void **state)
{
	(void)state;
	uint32_t down = 0, all = 0;
	for (uint64_t seed = 0; seed < 10; seed++) {
		fixture f;
		grid(&f, 50, 50, 0.04, seed); /* slopes up to two */
		reduce_to(&f, 1000);
		down += faces_downward(&f.p);
		all += f.p.nf;
		drop(&f);
	}
	assert_int_equal(all, 10000);
	assert_true(down < all / 200);
}

static double volume_of(const wh_patch *p)
{
	double volume = 0;
	for (uint32_t i = 0; i < p->nf; i++) {
		const uint32_t *t = &p->tri[3 * (size_t)i];
		const wh_vec3 *q = p->pos;
		volume += wh_dot(q[t[0]], wh_cross(q[t[1]], q[t[2]])) / 6;
	}
	return volume;
}

static void positions_are_floats_when_asked(void **state)
{
	(void)state;
	fixture f;
	grid(&f, 32, 32, 0, 0);
	for (uint32_t v = 0; v < f.p.nv; v++) /* eighths of a grid cell: exact in a float */
		f.p.pos[v].z = (double)(wh_mix64(v) % 8) / 256;
	wh_simplify_params p = no_limits();
	p.target_faces = 300;
	p.float_positions = true;
	reduce_with(&f, &p);
	for (uint32_t v = 0; v < f.p.nv; v++) {
		const double xyz[3] = {f.p.pos[v].x, f.p.pos[v].y, f.p.pos[v].z};
		for (int i = 0; i < 3; i++) {
			uint64_t bits; /* a float's mantissa ends 29 bits earlier */
			memcpy(&bits, &xyz[i], sizeof bits);
			assert_int_equal(bits & 0x1fffffff, 0);
		}
	}
	drop(&f);
}

/* How many positions are not whole multiples of the step. */
static uint32_t off_step(const wh_patch *p, double step)
{
	uint32_t n = 0;
	for (uint32_t v = 0; v < p->nv; v++)
		n += fmod(p->pos[v].x, step) != 0 || fmod(p->pos[v].y, step) != 0 ||
		     fmod(p->pos[v].z, step) != 0;
	return n;
}

static void new_positions_are_whole_steps_from_old_ones(void **state)
{
	(void)state;
	const double step = 0x1p-20;
	for (int k = 0; k < 2; k++) {
		fixture f;
		grid(&f, 32, 32, 0, 0);
		for (uint32_t v = 0; v < f.p.nv; v++) {
			wh_vec3 *q = &f.p.pos[v];
			*q = wh_v3(floor(q->x / step) * step, floor(q->y / step) * step,
			           (double)(wh_mix64(v) % 8) / 256);
		}
		wh_simplify_params p = no_limits();
		p.target_faces = 300;
		p.step = k * step;
		reduce_with(&f, &p);
		assert_true(k == 1 ? off_step(&f.p, step) == 0 : off_step(&f.p, step) > 100);
		drop(&f);
	}
}

/* A step larger than the edges, as with an outlier in the box, does not nail vertices down. */
static void no_step_is_long_beside_its_edge(void **state)
{
	(void)state;
	fixture f;
	synth(&f, WH_SYNTH_SPHERE, 20000, 1);
	const double before = volume_of(&f.p);
	wh_simplify_params p = no_limits();
	p.target_faces = 1000;
	p.step = 0x1p40;
	reduce_with(&f, &p);
	assert_true(fabs(volume_of(&f.p) / before - 1) < 1e-3);
	drop(&f);
}

/* Half as far below as above: the volume under the surface stays. */
static void the_volume_under_the_surface_stays(void **state)
{
	(void)state;
	fixture f;
	synth(&f, WH_SYNTH_SPHERE, 20000, 1);
	const double before = volume_of(&f.p);
	reduce_to(&f, 1000);
	assert_true(fabs(volume_of(&f.p) / before - 1) < 1e-3);
	drop(&f);
}

/* ---- limits of distance ---- */

static wh_mesh copy_mesh(fixture *f)
{
	wh_mesh m;
	assert_int_equal(wh_mesh_alloc(&f->t.ctx, &m, f->p.nv, f->p.nf), WH_OK);
	memcpy(m.pos, f->p.pos, m.nv * sizeof *m.pos);
	memcpy(m.tri, f->p.tri, 3 * (size_t)m.nf * sizeof *m.tri);
	return m;
}

/* The accumulated estimate stays within the limit. It is one of the vertices of each step, not
 * of all points: on white noise, the worst there is, the measured distance exceeds it by up to
 * half as much. */
static void the_distance_limit_holds(void **state)
{
	(void)state;
	uint32_t last = UINT32_MAX;
	for (double limit = 0.001; limit < 0.05; limit *= 3) {
		fixture f;
		grid(&f, 40, 40, 0.02, 3);
		wh_mesh before = copy_mesh(&f);
		wh_simplify_params p = no_limits();
		p.max_err = limit;
		reduce_with(&f, &p);
		assert_true(f.done.highest_err <= limit);
		assert_true(f.p.nf < last);
		last = f.p.nf;
		for (uint32_t v = 0; v < f.p.nv; v++)
			assert_true((double)f.p.err[v] <= limit * (1 + 1e-6));
		wh_mesh after = copy_mesh(&f);
		const wh_exec ex = {.workers = 1};
		const wh_compare_params cp = {.samples = 20000};
		wh_compare d;
		assert_int_equal(wh_compare_meshes(&f.t.ctx, &ex, &before, &after, &cp, &d), WH_OK);
		assert_true(fmax(d.a_to_b.max, d.b_to_a.max) <= 1.6 * limit);
		wh_mesh_free(&f.t.ctx, &before);
		wh_mesh_free(&f.t.ctx, &after);
		drop(&f);
	}
}

/* Estimates that vertices bring along count. */
static void earlier_distance_is_not_forgotten(void **state)
{
	(void)state;
	fixture f;
	grid(&f, 20, 20, 0.02, 3);
	for (uint32_t v = 0; v < f.p.nv; v++)
		f.p.err[v] = 0.5f;
	wh_simplify_params p = no_limits();
	p.max_err = 0.5;
	reduce_with(&f, &p);
	assert_int_equal(f.p.nf, 800);
	drop(&f);
}

/* ---- what is locked ---- */

/* Bits of the positions of vertices for which `pick` holds, by gid. */
typedef bool (*picker)(uint32_t gid);

static uint32_t bit_equal(const fixture *before, const fixture *after, picker pick)
{
	uint32_t found = 0;
	for (uint32_t v = 0; v < after->p.nv; v++) {
		const uint32_t id = (uint32_t)after->p.gid[v];
		if (!pick(id))
			continue;
		found++;
		assert_memory_equal(&before->p.pos[id], &after->p.pos[v], sizeof(wh_vec3));
	}
	return found;
}

enum { SIDE = 24 };

static bool on_rim(uint32_t gid)
{
	const uint32_t x = gid % (SIDE + 1), y = gid / (SIDE + 1);
	return x == 0 || y == 0 || x == SIDE || y == SIDE;
}

static void a_locked_boundary_stays_to_the_bit(void **state)
{
	(void)state;
	fixture before, f;
	grid(&before, SIDE, SIDE, 0.02, 5);
	grid(&f, SIDE, SIDE, 0.02, 5);
	wh_simplify_params p = no_limits();
	p.target_faces = 1;
	p.lock_boundary = true;
	reduce_with(&f, &p);
	assert_int_equal(bit_equal(&before, &f, on_rim), 4 * SIDE);
	assert_int_equal(look(&f).boundary_edges, 4 * SIDE);
	assert_true(f.p.nf < 2 * 4 * SIDE);
	drop(&before);
	drop(&f);
}

static bool is_third(uint32_t gid)
{
	return gid % 3 == 0;
}

/* Cut vertices all over the place: none moves, vanishes or loses its flag. */
static void cut_vertices_neither_move_nor_vanish(void **state)
{
	(void)state;
	fixture before, f;
	grid(&before, SIDE, SIDE, 0.02, 6);
	grid(&f, SIDE, SIDE, 0.02, 6);
	uint32_t cut = 0;
	for (uint32_t v = 0; v < f.p.nv; v++)
		if (is_third(v)) {
			f.p.flag[v] = WH_CUT;
			cut++;
		}
	reduce_to(&f, 1);
	assert_int_equal(bit_equal(&before, &f, is_third), cut);
	for (uint32_t v = 0; v < f.p.nv; v++)
		assert_int_equal(f.p.flag[v] & WH_CUT, is_third((uint32_t)f.p.gid[v]) ? WH_CUT : 0);
	assert_true(f.done.collapses > 100);
	drop(&before);
	drop(&f);
}

static void survivors_keep_their_order(void **state)
{
	(void)state;
	fixture f;
	grid(&f, 20, 20, 0.02, 7);
	reduce_to(&f, 200);
	for (uint32_t v = 1; v < f.p.nv; v++)
		assert_true(f.p.gid[v] > f.p.gid[v - 1]);
	drop(&f);
}

/* ---- meshes that are not manifolds ---- */

/* Three grids of n x n cells that share one side, like the pages of a book. */
static void book(fixture *f, uint32_t n)
{
	const uint32_t page = n * (n + 1);
	open_fixture(f);
	patch_room(&f->t, &f->p, (n + 1) + 3 * page, 3 * 2 * n * n);
	for (uint32_t y = 0; y <= n; y++)
		f->p.pos[y] = wh_v3(0, 0, y);
	uint32_t *t = f->p.tri;
	for (uint32_t k = 0; k < 3; k++)
		for (uint32_t x = 0; x <= n; x++)
			for (uint32_t y = 0; y <= n; y++) {
				const uint32_t a = x ? n + 1 + k * page + (x - 1) * (n + 1) + y : y;
				f->p.pos[a] = wh_v3(x * cos(2.0 * k), x * sin(2.0 * k), y);
				if (x == n || y == n)
					continue;
				const uint32_t b = n + 1 + k * page + x * (n + 1) + y;
				const uint32_t two[6] = {a, b, b + 1, a, b + 1, a + 1};
				memcpy(t, two, sizeof two);
				t += 6;
			}
}

static void the_spine_of_a_book_stays(void **state)
{
	(void)state;
	enum { N = 10 };
	fixture f;
	book(&f, N);
	const wh_check before = look(&f);
	assert_int_equal(before.nonmanifold_edges, N);
	reduce_to(&f, 1);
	const wh_check c = look(&f);
	same_topology(&before, &c);
	assert_int_equal(f.done.fixed, N + 1);
	for (uint32_t y = 0; y <= N; y++) { /* vertices of the spine come first */
		assert_int_equal(f.p.gid[y], y);
		assert_true(f.p.pos[y].z == y && f.p.pos[y].x == 0);
	}
	assert_true(f.p.nf < 120);
	drop(&f);
}

/* Two grids that share one corner vertex. */
static void a_bowtie_stays(void **state)
{
	(void)state;
	enum { N = 8, NV = (N + 1) * (N + 1) };
	fixture one, f;
	grid(&one, N, N, 0.02, 8);
	open_fixture(&f);
	patch_room(&f.t, &f.p, 2 * NV - 1, 4 * N * N);
	for (uint32_t v = 0; v < NV; v++) { /* the second one turned by half a circle */
		const wh_vec3 a = one.p.pos[v], o = one.p.pos[0];
		f.p.pos[v] = a;
		if (v > 0)
			f.p.pos[NV - 1 + v] = wh_v3(2 * o.x - a.x, 2 * o.y - a.y, a.z);
	}
	for (size_t i = 0; i < 6 * N * N; i++) {
		const uint32_t v = one.p.tri[i];
		f.p.tri[i] = v;
		f.p.tri[6 * N * N + i] = v ? NV - 1 + v : 0;
	}
	const wh_check before = look(&f);
	assert_int_equal(before.nonmanifold_vertices, 1);
	const wh_vec3 centre = f.p.pos[0];
	reduce_to(&f, 1);
	const wh_check c = look(&f);
	same_topology(&before, &c);
	assert_int_equal(f.done.fixed, 1);
	assert_memory_equal(&f.p.pos[0], &centre, sizeof centre);
	assert_true(f.p.nf < 30);
	drop(&one);
	drop(&f);
}

/* A block of faces turned over: the edges around it are kept, all else may go. */
static void turned_faces_are_fenced_off(void **state)
{
	(void)state;
	enum { N = 16 };
	fixture f;
	grid(&f, N, N, 0.02, 9);
	for (uint32_t y = 5; y < 9; y++)
		for (uint32_t x = 5; x < 9; x++)
			for (uint32_t k = 0; k < 2; k++) {
				uint32_t *t = &f.p.tri[3 * (size_t)(2 * (y * N + x) + k)];
				const uint32_t a = t[1];
				t[1] = t[2];
				t[2] = a;
			}
	const wh_check before = look(&f);
	assert_int_equal(before.misoriented_edges, 16);
	reduce_to(&f, 1);
	const wh_check c = look(&f);
	same_topology(&before, &c);
	assert_int_equal(f.done.fixed, 16);
	assert_true(f.p.nf < 150);
	drop(&f);
}

/* ---- repeatability and memory ---- */

static void a_used_workspace_changes_nothing(void **state)
{
	(void)state;
	fixture f, other;
	synth(&f, WH_SYNTH_TORUS, 6000, 1);
	synth(&other, WH_SYNTH_TORUS, 6000, 1);
	reduce_to(&f, 1000);
	/* the other workspace has seen a smaller, a larger and a failed patch */
	fixture small, large;
	grid(&small, 5, 5, 0.02, 1);
	grid(&large, 80, 80, 0.02, 2);
	wh_simplify_params p = no_limits();
	p.target_faces = 7;
	wh_simplify_result done;
	wh_ctx *c = &other.t.ctx;
	assert_int_equal(wh_simplify(c, other.w, &small.p, &p, &done), WH_OK);
	const int stop = 1;
	c->cancel = &stop;
	assert_int_equal(wh_simplify(c, other.w, &large.p, &p, &done), WH_E_INTERRUPT);
	c->cancel = NULL;
	c->err.code = WH_OK;
	reduce_to(&other, 1000);
	assert_int_equal(f.p.nf, other.p.nf);
	assert_int_equal(f.p.nv, other.p.nv);
	assert_memory_equal(f.p.tri, other.p.tri, 3 * (size_t)f.p.nf * sizeof *f.p.tri);
	assert_memory_equal(f.p.pos, other.p.pos, f.p.nv * sizeof *f.p.pos);
	assert_memory_equal(&f.done, &other.done, sizeof f.done);
	/* patches know no account of their own: each is freed by its maker */
	drop(&small);
	drop(&large);
	drop(&other);
	drop(&f);
}

static wh_code reduce_with_failure(long fail_after)
{
	fixture f;
	wh_simplify_result done;
	grid(&f, 30, 30, 0.02, 4);
	wh_simplify_params p = no_limits();
	p.target_faces = 20;
	f.t.mem.fail_after = fail_after;
	const wh_code code = wh_simplify(&f.t.ctx, f.w, &f.p, &p, &done);
	assert_true(code == WH_OK || f.t.ctx.err.text[0] != '\0');
	drop(&f);
	return code;
}

static void every_failed_allocation_is_survived(void **state)
{
	(void)state;
	long fails = 0;
	while (reduce_with_failure(fails + 1) != WH_OK)
		assert_true(++fails < 200);
	assert_true(fails >= 5);
}

/* What is held never exceeds what was announced. */
static void the_workspace_is_as_large_as_announced(void **state)
{
	(void)state;
	fixture f;
	grid(&f, 150, 150, 0.02, 4);
	const size_t before = f.t.mem.used, announced = wh_simplify_bytes(f.p.nv, f.p.nf, 0);
	f.t.mem.peak = before;
	reduce_to(&f, 100);
	assert_true(f.t.mem.peak - before <= announced + 65536);
	drop(&f);
}

/* ---- pieces ---- */

#define SEVERAL (WH_NONE - 1)

/* A grid cut into across x across pieces: the piece of each face, by its centroid, and the one
 * piece that uses each vertex, or SEVERAL. */
typedef struct cut {
	uint32_t pieces;
	uint32_t *piece, *user;
} cut;

static uint32_t piece_at(const wh_patch *p, const uint32_t *t, uint32_t across)
{
	const double x = (p->pos[t[0]].x + p->pos[t[1]].x + p->pos[t[2]].x) / 3;
	const double y = (p->pos[t[0]].y + p->pos[t[1]].y + p->pos[t[2]].y) / 3;
	return (uint32_t)(x * across) * across + (uint32_t)(y * across);
}

static cut cut_make(const wh_patch *p, uint32_t across)
{
	cut k = {.pieces = across * across};
	k.piece = malloc(p->nf * sizeof *k.piece);
	k.user = malloc(p->nv * sizeof *k.user);
	assert_non_null(k.piece);
	assert_non_null(k.user);
	memset(k.user, 0xff, p->nv * sizeof *k.user);
	for (uint32_t f = 0; f < p->nf; f++) {
		const uint32_t *t = &p->tri[3 * (size_t)f];
		k.piece[f] = piece_at(p, t, across);
		for (int j = 0; j < 3; j++) {
			uint32_t *u = &k.user[t[j]];
			*u = *u == WH_NONE || *u == k.piece[f] ? k.piece[f] : SEVERAL;
		}
	}
	return k;
}

static void cut_free(cut *k)
{
	free(k->piece);
	free(k->user);
}

/* Piece k as a fixture of its own: vertices of several pieces are cut, gid is the number in the
 * whole. */
static void take_piece(fixture *f, const wh_patch *whole, const cut *c, uint32_t k)
{
	uint32_t *local = malloc(whole->nv * sizeof *local);
	assert_non_null(local);
	memset(local, 0xff, whole->nv * sizeof *local);
	open_fixture(f);
	patch_room(&f->t, &f->p, whole->nv, whole->nf);
	f->p.nv = f->p.nf = 0;
	for (uint32_t i = 0; i < whole->nf; i++) {
		if (c->piece[i] != k)
			continue;
		for (size_t j = 0; j < 3; j++) {
			const uint32_t v = whole->tri[3 * (size_t)i + j];
			if (local[v] == WH_NONE) {
				const uint32_t at = local[v] = f->p.nv++;
				f->p.pos[at] = whole->pos[v];
				f->p.gid[at] = v;
				f->p.flag[at] = c->user[v] == SEVERAL ? WH_CUT : 0;
			}
			f->p.tri[3 * (size_t)f->p.nf + j] = local[v];
		}
		f->p.nf++;
	}
	free(local);
}

/* Replaces the whole by its pieces, each reduced on its own as far as it goes. */
static void reduce_in_pieces(fixture *whole, uint32_t across)
{
	cut c = cut_make(&whole->p, across);
	uint32_t nf = 0;
	uint32_t *tri = malloc(3 * (size_t)whole->p.nf * sizeof *tri);
	assert_non_null(tri);
	for (uint32_t k = 0; k < c.pieces; k++) {
		fixture piece;
		take_piece(&piece, &whole->p, &c, k);
		reduce_to(&piece, 1);
		for (size_t i = 0; i < 3 * (size_t)piece.p.nf; i++)
			tri[3 * (size_t)nf + i] = (uint32_t)piece.p.gid[piece.p.tri[i]];
		for (uint32_t v = 0; v < piece.p.nv; v++)
			whole->p.pos[piece.p.gid[v]] = piece.p.pos[v];
		nf += piece.p.nf;
		drop(&piece);
	}
	memcpy(whole->p.tri, tri, 3 * (size_t)nf * sizeof *tri);
	whole->p.nf = nf;
	free(tri);
	cut_free(&c);
}

/*
 *       a           a and b are on the cut, and so is c, which stands out of the plane of the
 *     / | \         others. Either piece may collapse its free vertex, u or v, into a or b, for
 *    u--c--v        all that its own faces say. Then both make the face abc: two faces on each
 *     \ | /         other. No face may become one of locked vertices alone.
 *       b        */
static void two_pieces_do_not_make_the_same_face(void **state)
{
	(void)state;
	enum { A, B, C, U };
	const wh_vec3 left_pos[] = {{0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {-1, 0, 0}};
	const wh_vec3 right_pos[] = {{0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {1, 0, 0}};
	const uint32_t left[][3] = {{A, U, C}, {U, B, C}}, right[][3] = {{A, C, U}, {U, C, B}};
	fixture f, g;
	draw(&f, left_pos, 4, left, 2);
	draw(&g, right_pos, 4, right, 2);
	for (uint32_t v = A; v <= C; v++)
		f.p.flag[v] = g.p.flag[v] = WH_CUT;
	reduce_to(&f, 1);
	reduce_to(&g, 1);
	assert_int_equal(f.p.nf, 2);
	assert_int_equal(g.p.nf, 2);
	drop(&f);
	drop(&g);
}

/*
 *        u          A closed surface of six faces, cut along the triangle abc in its middle: the
 *      / | \        upper half would become the face abc, and so would the lower one.
 *     a--b--c
 *      \ | /
 *        v        */
static void a_cap_on_three_cut_vertices_stays(void **state)
{
	(void)state;
	enum { A, B, C, U };
	const wh_vec3 pos[] = {{1, 0, 0}, {-0.5, 0.9, 0}, {-0.5, -0.9, 0}, {0, 0, 0.1}};
	const uint32_t cap[][3] = {{A, B, U}, {B, C, U}, {C, A, U}};
	fixture f;
	draw(&f, pos, 4, cap, 3);
	for (uint32_t v = A; v <= C; v++)
		f.p.flag[v] = WH_CUT;
	reduce_to(&f, 1);
	assert_int_equal(f.p.nf, 3);
	drop(&f);
}

/* The same with all four faces in one piece: nothing forbids it then. */
static void one_piece_may_collapse_what_two_may_not(void **state)
{
	(void)state;
	enum { U, V, A, B, C };
	const wh_vec3 pos[] = {{-1, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}};
	const uint32_t tri[][3] = {{A, U, C}, {U, B, C}, {A, C, V}, {V, C, B}};
	fixture f;
	draw(&f, pos, 5, tri, 4);
	reduce_to(&f, 3);
	assert_int_equal(f.p.nf, 3);
	drop(&f);
}

/* Pieces of a noisy grid, each reduced apart as far as it goes, make the same surface again. */
static void pieces_fit_together(uint32_t across, uint32_t most_faces)
{
	for (uint64_t seed = 0; seed < 24; seed++) {
		fixture whole;
		grid(&whole, 64, 64, 0.01, 100 + seed);
		const wh_check before = look(&whole);
		reduce_in_pieces(&whole, across);
		const wh_check c = look(&whole);
		same_topology(&before, &c);
		assert_true(wh_check_clean(&c));
		assert_true(whole.p.nf < most_faces);
		drop(&whole);
	}
}

static void four_pieces_fit_together(void **state)
{
	(void)state;
	pieces_fit_together(2, 2000);
}

static void sixteen_pieces_fit_together(void **state)
{
	(void)state;
	pieces_fit_together(4, 3000);
}

/* ---- soup ---- */

enum { SOUP = 100, LATTICE = 4 };

/* Up to 100 vertices on a lattice of 64 places (so many coincide) and random faces. */
static void soup(fixture *f, uint64_t seed, uint32_t faces)
{
	wh_rng g = wh_rng_seed(seed);
	open_fixture(f);
	patch_room(&f->t, &f->p, SOUP, faces);
	for (uint32_t v = 0; v < SOUP; v++) {
		const uint64_t r = wh_rng_next(&g);
		f->p.pos[v] =
		    wh_v3((double)(r % LATTICE), (double)(r >> 8 & 3), (double)(r >> 16 & 3));
		f->p.flag[v] = r >> 32 & 15 ? 0 : WH_CUT;
	}
	const uint32_t span = 3 + (uint32_t)(wh_rng_next(&g) % (SOUP - 3));
	for (uint32_t i = 0; i < faces; i++) {
		uint32_t *t = &f->p.tri[3 * (size_t)i];
		do {
			for (int j = 0; j < 3; j++)
				t[j] = (uint32_t)(wh_rng_next(&g) % span);
		} while (t[0] == t[1] || t[1] == t[2] || t[2] == t[0]);
		if (i > 0 && (wh_rng_next(&g) & 15) == 0)
			memcpy(t, &f->p.tri[3 * (size_t)(wh_rng_next(&g) % i)], 3 * sizeof *t);
	}
}

static void random_faces_are_survived(void **state)
{
	(void)state;
	uint64_t collapses = 0;
	for (uint64_t seed = 0; seed < 3000; seed++) {
		fixture f;
		soup(&f, seed, 1 + (uint32_t)(wh_mix64(seed) % 120));
		const wh_check before = look(&f);
		const uint32_t nf = f.p.nf;
		reduce_to(&f, 1);
		const wh_check c = look(&f);
		assert_true(f.p.nf <= nf);
		assert_int_equal(c.degenerate_faces, 0);
		assert_int_equal(c.nonmanifold_edges, before.nonmanifold_edges);
		assert_int_equal(c.duplicate_faces, before.duplicate_faces);
		assert_int_equal(c.components, before.components);
		assert_int_equal(c.euler, before.euler);
		collapses += f.done.collapses;
		drop(&f);
	}
	assert_true(collapses > 100);
}

/* A clean surface of random shape with holes bitten out of it, its positions on a lattice: flat,
 * folded and degenerate faces everywhere. */
static void bitten(fixture *f, uint64_t seed)
{
	wh_rng g = wh_rng_seed(seed);
	const uint32_t n = 4 + (uint32_t)(wh_rng_next(&g) % 7);
	if (seed % 3 == 0)
		annulus(f, n + 3, n);
	else if (seed % 3 == 1)
		grid(f, n, n, 0, 0);
	else
		synth(f, WH_SYNTH_TORUS, 100 + 20 * n, 1);
	for (uint32_t v = 0; v < f->p.nv; v++) {
		const uint64_t r = wh_rng_next(&g);
		f->p.pos[v] =
		    wh_v3((double)(r % LATTICE), (double)(r >> 8 & 3), (double)(r >> 16 & 3));
	}
	for (int bites = (int)(wh_rng_next(&g) % 6); bites > 0; bites--) {
		uint32_t last[3], *t = &f->p.tri[3 * (wh_rng_next(&g) % f->p.nf)];
		const uint32_t *end = &f->p.tri[3 * (size_t)(f->p.nf - 1)];
		memcpy(last, t, sizeof last);
		memcpy(t, end, sizeof last);
		f->p.nf--;
		const wh_check c = look(f);
		if (!wh_check_clean(&c)) { /* one bite too near another */
			f->p.nf++;
			memcpy(t, last, sizeof last);
		}
	}
}

static void clean_surfaces_stay_clean(void **state)
{
	(void)state;
	uint64_t collapses = 0;
	for (uint64_t seed = 0; seed < 1500; seed++) {
		fixture f;
		bitten(&f, seed);
		const wh_check before = look(&f);
		reduce_to(&f, 1);
		const wh_check c = look(&f);
		same_topology(&before, &c);
		assert_int_equal(c.genus, before.genus);
		assert_int_equal(f.done.fixed, 0);
		collapses += f.done.collapses;
		drop(&f);
	}
	assert_true(collapses > 10000);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	    cmocka_unit_test(a_tetrahedron_stays),
	    cmocka_unit_test(a_triangle_stays),
	    cmocka_unit_test(an_empty_patch_stays_empty),
	    cmocka_unit_test(a_square_becomes_a_triangle),
	    cmocka_unit_test(a_pinhole_stays),
	    cmocka_unit_test(an_annulus_keeps_two_loops),
	    cmocka_unit_test(a_torus_keeps_its_handle),
	    cmocka_unit_test(two_spheres_stay_two),
	    cmocka_unit_test(closed_meshes_reach_even_counts_and_one_less_than_odd_ones),
	    cmocka_unit_test(open_meshes_reach_any_count),
	    cmocka_unit_test(vertex_counts_are_exact),
	    cmocka_unit_test(the_first_limit_stops),
	    cmocka_unit_test(a_target_above_the_count_changes_nothing),
	    cmocka_unit_test(the_cost_limit_holds),
	    cmocka_unit_test(the_log_counts_every_collapse),
	    cmocka_unit_test(a_flat_square_keeps_its_corners_alone),
	    cmocka_unit_test(gentle_relief_never_folds),
	    cmocka_unit_test(few_faces_of_steep_noise_turn_over),
	    cmocka_unit_test(positions_are_floats_when_asked),
	    cmocka_unit_test(new_positions_are_whole_steps_from_old_ones),
	    cmocka_unit_test(no_step_is_long_beside_its_edge),
	    cmocka_unit_test(the_volume_under_the_surface_stays),
	    cmocka_unit_test(the_distance_limit_holds),
	    cmocka_unit_test(earlier_distance_is_not_forgotten),
	    cmocka_unit_test(a_locked_boundary_stays_to_the_bit),
	    cmocka_unit_test(cut_vertices_neither_move_nor_vanish),
	    cmocka_unit_test(survivors_keep_their_order),
	    cmocka_unit_test(the_spine_of_a_book_stays),
	    cmocka_unit_test(a_bowtie_stays),
	    cmocka_unit_test(turned_faces_are_fenced_off),
	    cmocka_unit_test(a_used_workspace_changes_nothing),
	    cmocka_unit_test(every_failed_allocation_is_survived),
	    cmocka_unit_test(the_workspace_is_as_large_as_announced),
	    cmocka_unit_test(two_pieces_do_not_make_the_same_face),
	    cmocka_unit_test(a_cap_on_three_cut_vertices_stays),
	    cmocka_unit_test(one_piece_may_collapse_what_two_may_not),
	    cmocka_unit_test(four_pieces_fit_together),
	    cmocka_unit_test(sixteen_pieces_fit_together),
	    cmocka_unit_test(random_faces_are_survived),
	    cmocka_unit_test(clean_surfaces_stay_clean),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
