/*
 * Other costs and places than the engine's own, on the meshes that their inventors, and those who
 * learned from them, tried them on: a box whose arithmetic was done by hand, a plane that loses two
 * triangles, a patch of sixteen; and what must stay with all of them.
 */
#include "patches.h"

#include "algo/simplify.h"
#include "algo/synth.h"
#include "base/rng.h"
#include "geom/quadric.h"
#include "geom/tri.h"
#include "io/attributes.h"
#include "mesh/check.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define assert_near(a, b, most) assert_true(fabs((a) - (b)) <= (most))

/* ---- a patch and what is done to it ---- */

enum { MOST_NOTED = 64 };

typedef struct fixture {
	testing_env t;
	wh_patch p;
	wh_simplify_workspace *w;
	wh_simplify_result done;
	wh_collapse noted[MOST_NOTED]; /* the first collapses */
	size_t n;
} fixture;

static void open_fixture(fixture *f)
{
	memset(f, 0, sizeof *f);
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

static wh_code note(wh_ctx *c, void *to, const wh_collapse *r, const uint8_t *attr)
{
	(void)c, (void)attr;
	fixture *f = to;
	if (f->n < MOST_NOTED)
		f->noted[f->n++] = *r;
	return WH_OK;
}

static void reduce_with(fixture *f, wh_simplify_params *p)
{
	const wh_collapse_sink sink = {note, f};
	p->max_cost = p->max_err = (double)INFINITY;
	p->sink = p->insist ? NULL : &sink;
	p->policy.unscale = 1;
	f->n = 0;
	assert_int_equal(wh_simplify(&f->t.ctx, f->w, &f->p, p, &f->done), WH_OK);
}

static wh_check look(fixture *f)
{
	const wh_mesh m = {.nv = f->p.nv, .nf = f->p.nf, .pos = f->p.pos, .tri = f->p.tri};
	wh_check r;
	assert_int_equal(wh_check_mesh(&f->t.ctx, &m, &r), WH_OK);
	return r;
}

/* Grid of nx x ny cells over the unit square, two faces a cell. */
static void grid(fixture *f, uint32_t nx, uint32_t ny, double noise)
{
	open_fixture(f);
	patch_room(&f->t, &f->p, (nx + 1) * (ny + 1), 2 * nx * ny);
	wh_rng g = wh_rng_seed(5);
	for (uint32_t v = 0; v < f->p.nv; v++)
		f->p.pos[v] = wh_v3((double)(v % (nx + 1)) / nx, (double)(v / (nx + 1)) / ny,
		                    noise * (wh_rng_unit(&g) - 0.5));
	uint32_t *t = f->p.tri;
	for (uint32_t y = 0; y < ny; y++)
		for (uint32_t x = 0; x < nx; x++) {
			const uint32_t a = y * (nx + 1) + x, b = a + 1, c = a + nx + 1, d = c + 1;
			const uint32_t two[6] = {a, b, d, a, d, c};
			memcpy(t, two, sizeof two);
			t += 6;
		}
}

static void torus(fixture *f, uint64_t faces)
{
	open_fixture(f);
	wh_synth_params sp = wh_synth_defaults();
	sp.kind = WH_SYNTH_TORUS;
	sp.faces = faces;
	wh_synth *s;
	wh_mesh m;
	assert_int_equal(wh_synth_open(&f->t.ctx, &s, &sp), WH_OK);
	assert_int_equal(wh_synth_mesh(&f->t.ctx, s, &m), WH_OK);
	patch_room(&f->t, &f->p, m.nv, m.nf);
	memcpy(f->p.pos, m.pos, m.nv * sizeof *m.pos);
	memcpy(f->p.tri, m.tri, 3 * (size_t)m.nf * sizeof *m.tri);
	wh_mesh_free(&f->t.ctx, &m);
	wh_synth_close(&f->t.ctx, &s);
}

static double toll(void *user, const wh_edge_view *edge, double place[3])
{
	(void)user, (void)place;
	const double *d = edge->second;
	return d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
}

static const wh_own_policy own = {.cost = toll, .name = "toll"};

/* Every cost with every placement and, where it has weights, every weight. */
static const wh_policy_choice choices[] = {
    {.placement = WH_PLACE_MIDPOINT},
    {.placement = WH_PLACE_ENDPOINT},
    {.cost = WH_COST_QEM},
    {.cost = WH_COST_QEM, .weight = WH_WEIGHT_UNIFORM},
    {.cost = WH_COST_QEM, .weight = WH_WEIGHT_ANGLE},
    {.cost = WH_COST_QEM, .placement = WH_PLACE_MIDPOINT},
    {.cost = WH_COST_QEM, .placement = WH_PLACE_ENDPOINT},
    {.cost = WH_COST_NORMALS},
    {.cost = WH_COST_NORMALS, .weight = WH_WEIGHT_UNIFORM, .placement = WH_PLACE_MIDPOINT},
    {.cost = WH_COST_MELAX},
    {.cost = WH_COST_MELAX, .placement = WH_PLACE_OPTIMAL},
    {.cost = WH_COST_MELAX, .placement = WH_PLACE_MIDPOINT},
    {.cost = WH_COST_LENGTH},
    {.cost = WH_COST_LENGTH, .placement = WH_PLACE_OPTIMAL},
    {.cost = WH_COST_LENGTH, .placement = WH_PLACE_ENDPOINT},
    {.cost = WH_COST_OWN, .own = &own},
};
enum { CHOICES = sizeof choices / sizeof *choices };

/* ---- arithmetic ---- */

static void a_quadric_sums_squared_distances(void **state)
{
	(void)state;
	wh_rng g = wh_rng_seed(1);
	for (int round = 0; round < 100; round++) {
		wh_quadric a = {0}, b = {0};
		const wh_vec3 to =
		    wh_v3(wh_rng_unit(&g), wh_rng_unit(&g), wh_rng_unit(&g)); /* b's origin */
		const wh_vec3 p = wh_v3(wh_rng_unit(&g), wh_rng_unit(&g), wh_rng_unit(&g));
		double sum = 0;
		for (int k = 0; k < 4; k++) {
			wh_vec3 n = wh_v3(wh_rng_unit(&g) - 0.5, wh_rng_unit(&g) - 0.5, 0.3);
			const double d = wh_rng_unit(&g), weight = wh_rng_unit(&g);
			n = wh_scale(n, 1 / wh_norm(n));
			const double far = wh_dot(n, p) + d;
			sum += weight * far * far;
			if (k & 1)
				wh_quadric_add_plane(&a, n, d, weight);
			else
				wh_quadric_add_plane(&b, n, d + wh_dot(n, to), weight);
		}
		b = wh_quadric_moved(&b, wh_scale(to, -1));
		const wh_quadric q = wh_quadric_sum(&a, &b);
		assert_near(wh_quadric_at(&q, p), sum, 1e-12);
		wh_vec3 least;
		if (!wh_quadric_minimum(&q, &least))
			continue;
		for (int k = 0; k < 6; k++) {
			const double s = k & 1 ? 1e-3 : -1e-3;
			const wh_vec3 beside =
			    wh_add(least, wh_v3(k / 2 == 0 ? s : 0, k / 2 == 1 ? s : 0,
			                        k / 2 == 2 ? s : 0));
			assert_true(wh_quadric_at(&q, beside) >= wh_quadric_at(&q, least));
		}
	}
}

/* Where the planes leave a line free there is no least place, but one along an edge. */
static void two_planes_have_no_minimum_but_along_an_edge(void **state)
{
	(void)state;
	wh_quadric q = {0};
	wh_vec3 p;
	wh_quadric_add_plane(&q, wh_v3(1, 0, 0), -0.25, 1);
	wh_quadric_add_plane(&q, wh_v3(0, 1, 0), 0, 1);
	assert_false(wh_quadric_minimum(&q, &p));
	p = wh_quadric_minimum_along(&q, wh_v3(1, 0, 0));
	assert_near(p.x, 0.25, 1e-15);
	p = wh_quadric_minimum_along(&q, wh_v3(0.125, 0, 0));
	assert_near(p.x, 0.125, 1e-15); /* no farther than the end */
	p = wh_quadric_minimum_along(&q, wh_v3(0, 0, 1));
	assert_near(p.z, 0.5, 1e-15); /* all alike: the middle */
}

static void angles_are_those_of_the_library(void **state)
{
	(void)state;
	for (int k = 0; k <= 1000; k++) {
		const double angle = WH_PI * k / 1000, r = 1 + k;
		assert_near(wh_angle(r * fabs(sin(angle)), r * cos(angle)), angle, 1e-14);
	}
	assert_true(wh_angle(0, 0) == 0);
}

/* ---- the box ---- */

/*
 * Nine vertices: a box from -1 to 1 and, inside near its corner 1, vertex 8, with which the top
 * face is not quite flat. Each vertex has one plane, across its normal along the diagonal.
 */
enum { BOX_V = 9, BOX_QUADS = 6, BOX_TRIS = 2, BOX_EDGES = 15 };
static const wh_vec3 box_pos[BOX_V] = {{1, -1, 1},  {1, 1, 1},    {-1, 1, 1},
                                       {-1, -1, 1}, {-1, -1, -1}, {-1, 1, -1},
                                       {1, 1, -1},  {1, -1, -1},  {0.9, 0.8, 0.9}};
static const uint32_t box_quad[BOX_QUADS][4] = {{0, 1, 2, 3}, {4, 5, 6, 7}, {7, 6, 1, 0},
                                                {3, 2, 5, 4}, {8, 6, 5, 2}, {3, 4, 7, 0}};
static const uint32_t box_tri[BOX_TRIS][3] = {{1, 6, 8}, {1, 8, 2}};

/* The corners' own directions, that of vertex 8 being corner 1's. */
static wh_vec3 box_normal(uint32_t v)
{
	const wh_vec3 p = box_pos[v == 8 ? 1 : v];
	return wh_scale(p, 1 / sqrt(3));
}

static wh_quadric box_quadric(uint32_t v)
{
	wh_quadric q = {0};
	wh_quadric_add_plane(&q, box_normal(v), -wh_dot(box_normal(v), box_pos[v]), 1);
	return q;
}

static double box_cost(uint32_t a, uint32_t b)
{
	const wh_quadric qa = box_quadric(a), qb = box_quadric(b), q = wh_quadric_sum(&qa, &qb);
	return wh_quadric_at(&q, wh_scale(wh_add(box_pos[a], box_pos[b]), 0.5));
}

static void note_edge(bool edge[BOX_V][BOX_V], uint32_t a, uint32_t b)
{
	edge[a < b ? a : b][a < b ? b : a] = true;
}

static void the_matrices_of_the_box(void **state)
{
	(void)state;
	for (uint32_t v = 0; v < BOX_V; v++) {
		const wh_quadric q = box_quadric(v);
		const wh_vec3 s = box_pos[v == 8 ? 1 : v]; /* signs */
		const double linear = v == 8 ? 2.6 / 3 : 1, last = v == 8 ? 2.6 * 2.6 / 3 : 3;
		assert_near(q.xx, 1.0 / 3, 1e-12);
		assert_near(q.yy, 1.0 / 3, 1e-12);
		assert_near(q.zz, 1.0 / 3, 1e-12);
		assert_near(q.xy, s.x * s.y / 3, 1e-12);
		assert_near(q.xz, s.x * s.z / 3, 1e-12);
		assert_near(q.yz, s.y * s.z / 3, 1e-12);
		assert_near(q.b.x, -s.x * linear, 1e-12);
		assert_near(q.b.y, -s.y * linear, 1e-12);
		assert_near(q.b.z, -s.z * linear, 1e-12);
		assert_near(q.c, last, 1e-12);
		assert_near(wh_quadric_at(&q, box_pos[v]), 0, 1e-12);
	}
}

/* Quads are not cut here: their diagonals are no edges. */
static void the_fifteen_edges_of_the_box(void **state)
{
	(void)state;
	static const uint32_t listed[BOX_EDGES][2] = {{0, 1}, {0, 3}, {0, 7}, {1, 2}, {1, 6},
	                                              {1, 8}, {2, 3}, {2, 5}, {2, 8}, {3, 4},
	                                              {4, 5}, {4, 7}, {5, 6}, {6, 7}, {6, 8}};
	bool edge[BOX_V][BOX_V] = {{false}};
	for (uint32_t f = 0; f < BOX_QUADS; f++)
		for (uint32_t k = 0; k < 4; k++)
			note_edge(edge, box_quad[f][k], box_quad[f][(k + 1) % 4]);
	for (uint32_t f = 0; f < BOX_TRIS; f++)
		for (uint32_t k = 0; k < 3; k++)
			note_edge(edge, box_tri[f][k], box_tri[f][(k + 1) % 3]);
	uint32_t n = 0, best = 0;
	for (uint32_t a = 0; a < BOX_V; a++)
		for (uint32_t b = a + 1; b < BOX_V; b++) {
			if (!edge[a][b])
				continue;
			assert_int_equal(listed[n][0], a);
			assert_int_equal(listed[n][1], b);
			if (box_cost(a, b) < box_cost(listed[best][0], listed[best][1]))
				best = n;
			n++;
		}
	assert_int_equal(n, BOX_EDGES);
	assert_near(box_cost(0, 1), 2.0 / 3, 1e-12);
	assert_near(box_cost(1, 8), 0.08 / 3, 1e-12);
	assert_int_equal(listed[best][0], 1);
	assert_int_equal(listed[best][1], 8);
}

/* The file's normals, as a PLY's nx, ny and nz. */
static wh_attribute normal_item[3] = {
    {.name = "nx", .type = WH_F64, .kind = WH_KIND_NORMAL, .form = WH_FORM_DOUBLE, .at = 0},
    {.name = "ny", .type = WH_F64, .kind = WH_KIND_NORMAL, .form = WH_FORM_DOUBLE, .at = 8},
    {.name = "nz", .type = WH_F64, .kind = WH_KIND_NORMAL, .form = WH_FORM_DOUBLE, .at = 16}};
static const wh_attributes normals = {
    .item = normal_item, .n = 3, .bytes = 24, .has_normal = true, .normal = {0, 1, 2}};

static void box(fixture *f, bool with_normals)
{
	open_fixture(f);
	f->p.attr_bytes = with_normals ? normals.bytes : 0;
	patch_room(&f->t, &f->p, BOX_V, 2 * BOX_QUADS + BOX_TRIS);
	memcpy(f->p.pos, box_pos, sizeof box_pos);
	for (uint32_t v = 0; v < BOX_V && with_normals; v++) {
		const wh_vec3 n = box_normal(v);
		memcpy(wh_patch_attr(&f->p, v), &n, sizeof n);
	}
	uint32_t *t = f->p.tri;
	for (uint32_t i = 0; i < BOX_QUADS; i++) {
		const uint32_t *q = box_quad[i], two[6] = {q[0], q[1], q[2], q[0], q[2], q[3]};
		memcpy(t, two, sizeof two);
		t += 6;
	}
	memcpy(t, box_tri, sizeof box_tri);
}

static bool is_edge(const wh_collapse *r, uint32_t a, uint32_t b)
{
	return (r->u == a && r->v == b) || (r->u == b && r->v == a);
}

static void the_box_loses_its_inner_vertex(void **state)
{
	(void)state;
	fixture f;
	box(&f, true);
	assert_int_equal(look(&f).euler, 2);
	wh_simplify_params p = {.target_vertices = 8,
	                        .attributes = &normals,
	                        .policy = {.cost = WH_COST_NORMALS,
	                                   .weight = WH_WEIGHT_UNIFORM,
	                                   .placement = WH_PLACE_MIDPOINT}};
	reduce_with(&f, &p);
	assert_int_equal(f.n, 1);
	assert_true(is_edge(&f.noted[0], 1, 8));
	assert_near(f.noted[0].cost, 0.08 / 3, 1e-8);
	assert_near(f.noted[0].at.x, 0.95, 1e-12);
	assert_near(f.noted[0].at.y, 0.9, 1e-12);
	assert_near(f.noted[0].at.z, 0.95, 1e-12);
	drop(&f);
}

/* The same choice where the file has no normals, and they are the mean of the faces'. */
static void a_box_without_normals_gets_those_of_its_faces(void **state)
{
	(void)state;
	fixture f;
	box(&f, false);
	wh_simplify_params p = {.target_vertices = 8,
	                        .policy = {.cost = WH_COST_NORMALS,
	                                   .weight = WH_WEIGHT_ANGLE,
	                                   .placement = WH_PLACE_MIDPOINT}};
	reduce_with(&f, &p);
	assert_int_equal(f.n, 1);
	assert_true(is_edge(&f.noted[0], 1, 8));
	drop(&f);
}

/* ---- planes and patches ---- */

static void two_hundred_triangles_lose_two_by_an_inner_collapse(void **state)
{
	(void)state;
	for (int k = 0; k < CHOICES; k++) {
		fixture f;
		grid(&f, 10, 10, 0);
		assert_int_equal(f.p.nf, 200);
		wh_simplify_params p = {
		    .target_faces = 198, .lock_boundary = true, .policy = choices[k]};
		reduce_with(&f, &p);
		assert_int_equal(f.n, 1);
		assert_int_equal(f.p.nf, 198);
		assert_int_equal(f.p.nv, 120);
		drop(&f);
	}
}

/*   +--+--+--+--+      +--+--+--+--+
 *   |/ |/ |/ |/ |      |/ | \|/ |/ |     two of the inner vertices meet in the middle; all 14
 *   +--a--b--+--+  ->  +---ab---+--+     faces that are left are faces, and none is a fin
 *   |/ |/ |/ |/ |      |/ | /|/ |/ |
 *   +--+--+--+--+      +--+--+--+--+    */
static void sixteen_triangles_become_fourteen_at_a_midpoint(void **state)
{
	(void)state;
	fixture f;
	grid(&f, 4, 2, 0);
	assert_int_equal(f.p.nf, 16);
	const wh_vec3 a = f.p.pos[6] = wh_v3(0.3, 0.5, 0), b = f.p.pos[7];
	wh_simplify_params p = {.target_faces = 14,
	                        .lock_boundary = true,
	                        .policy = {.cost = WH_COST_LENGTH, .placement = WH_PLACE_MIDPOINT}};
	reduce_with(&f, &p);
	assert_int_equal(f.n, 1);
	assert_true(is_edge(&f.noted[0], 6, 7));
	assert_true(f.noted[0].at.x == (a.x + b.x) / 2 && f.noted[0].at.y == 0.5);
	assert_int_equal(f.p.nf, 14);
	const wh_check c = look(&f);
	assert_true(wh_check_clean(&c));
	assert_int_equal(c.duplicate_faces, 0);
	drop(&f);
}

/*
 *      d---------e       u has three faces, abu, bcu and cau. Its edges are long, as it stands out,
 *      |\   c   /|       and ab is by far the shortest edge. Collapsing it would put bcu and cau on
 *      | \ /|\ / |       each other: a fin. All other faces are around these.
 *      |  / u \  |
 *      | a-----b |
 *      |/   f   \|                                                                              */
static void a_collapse_to_a_fin_is_refused(void **state)
{
	(void)state;
	enum { A, B, C, U, D, E, F };
	const wh_vec3 pos[] = {{-0.01, 0, 0}, {0.01, 0, 0}, {0, 1, 0}, {0, 0.3, 1},
	                       {-1, 1, 0},    {1, 1, 0},    {0, -1, 0}};
	const uint32_t tri[][3] = {{A, B, U}, {B, C, U}, {C, A, U}, {A, F, B},
	                           {B, E, C}, {C, D, A}, {D, F, A}, {F, E, B}};
	for (int k = 0; k < CHOICES; k++) {
		fixture f;
		open_fixture(&f);
		patch_room(&f.t, &f.p, 7, 8);
		memcpy(f.p.pos, pos, sizeof pos);
		memcpy(f.p.tri, tri, sizeof tri);
		wh_simplify_params p = {.target_faces = 6, .policy = choices[k]};
		reduce_with(&f, &p);
		assert_true(f.n == 0 || !is_edge(&f.noted[0], A, B));
		const wh_check c = look(&f);
		assert_true(wh_check_clean(&c));
		assert_int_equal(c.duplicate_faces, 0);
		drop(&f);
	}
}

/* ---- what all of them keep ---- */

static void every_policy_keeps_a_handle_and_reaches_its_count(void **state)
{
	(void)state;
	for (int k = 0; k < CHOICES; k++) {
		fixture f;
		torus(&f, 4000);
		wh_simplify_params p = {.target_faces = 400, .insist = true, .policy = choices[k]};
		reduce_with(&f, &p);
		const wh_check c = look(&f);
		assert_int_equal(f.p.nf, 400);
		assert_int_equal(c.genus, 1);
		assert_int_equal(c.components, 1);
		assert_true(wh_check_clean(&c));
		drop(&f);
	}
}

/* An open sheet stays one with one boundary, which loses vertices as the inside does. */
static void every_policy_simplifies_a_border_and_does_not_tear_it(void **state)
{
	(void)state;
	for (int k = 0; k < CHOICES; k++) {
		fixture f;
		grid(&f, 40, 40, 0.02);
		const wh_check before = look(&f);
		wh_simplify_params p = {.target_faces = 200, .insist = true, .policy = choices[k]};
		reduce_with(&f, &p);
		const wh_check c = look(&f);
		assert_int_equal(f.p.nf, 200);
		assert_int_equal(c.boundary_loops, 1);
		assert_int_equal(c.components, 1);
		assert_int_equal(c.euler, before.euler);
		assert_true(wh_check_clean(&c));
		assert_true(c.boundary_edges < before.boundary_edges);
		drop(&f);
	}
}

static void cut_vertices_stay_with_every_policy(void **state)
{
	(void)state;
	for (int k = 0; k < CHOICES; k++) {
		fixture f;
		grid(&f, 30, 30, 0.02);
		wh_vec3 was[31];
		for (uint32_t v = 0; v < f.p.nv; v++)
			if (v % 31 == 15) {
				f.p.flag[v] = WH_CUT;
				was[v / 31] = f.p.pos[v];
			}
		wh_simplify_params p = {.target_faces = 1, .policy = choices[k]};
		reduce_with(&f, &p);
		uint32_t n = 0;
		for (uint32_t v = 0; v < f.p.nv; v++)
			if (f.p.flag[v] & WH_CUT) {
				assert_int_equal(f.p.gid[v], 31 * n + 15);
				assert_memory_equal(&f.p.pos[v], &was[n], sizeof *was);
				n++;
			}
		assert_int_equal(n, 31);
		assert_true(f.p.nf < 400);
		drop(&f);
	}
}

static int compare_points(const void *a, const void *b)
{
	return memcmp(a, b, sizeof(wh_vec3));
}

/* At end points no vertex is new. */
static void end_points_are_vertices_that_were_there(void **state)
{
	(void)state;
	static const wh_cost costs[] = {WH_COST_MEMORYLESS, WH_COST_QEM, WH_COST_NORMALS,
	                                WH_COST_MELAX, WH_COST_LENGTH};
	for (size_t k = 0; k < sizeof costs / sizeof *costs; k++) {
		fixture f;
		grid(&f, 30, 30, 0.02);
		const uint32_t nv = f.p.nv;
		wh_vec3 *was = malloc(nv * sizeof *was);
		assert_non_null(was);
		memcpy(was, f.p.pos, nv * sizeof *was);
		qsort(was, nv, sizeof *was, compare_points);
		wh_simplify_params p = {
		    .target_faces = 200,
		    .step = 0x1p-10,
		    .policy = {.cost = costs[k], .placement = WH_PLACE_ENDPOINT}};
		reduce_with(&f, &p);
		assert_int_equal(f.p.nf, 200);
		for (uint32_t v = 0; v < f.p.nv; v++)
			assert_non_null(bsearch(&f.p.pos[v], was, nv, sizeof *was, compare_points));
		free(was);
		drop(&f);
	}
}

/* A ridge across a plane: vertices on the plane go first, at no cost, then those along the ridge;
 * while any of those is left, the ridge's form stays. */
static void melax_takes_what_is_flat_first(void **state)
{
	(void)state;
	fixture f;
	grid(&f, 16, 16, 0);
	for (uint32_t v = 0; v < f.p.nv; v++)
		f.p.pos[v].z = 0.5 - fabs(f.p.pos[v].x - 0.5);
	wh_simplify_params p = {.target_faces = 4, .policy = {.cost = WH_COST_MELAX}};
	reduce_with(&f, &p);
	assert_int_equal(f.p.nf, 4);
	assert_true(f.done.highest_cost < 1e-12);
	for (uint32_t v = 0; v < f.p.nv; v++)
		assert_true(f.p.pos[v].x == 0 || f.p.pos[v].x == 0.5 || f.p.pos[v].x == 1);
	drop(&f);
}

/* With area weights the costs are areas times squared distances: four times the size, four times
 * four. */
static void the_order_does_not_depend_on_the_unit(void **state)
{
	(void)state;
	for (int k = 0; k < CHOICES; k++) {
		fixture f, g;
		grid(&f, 20, 20, 0.02);
		grid(&g, 20, 20, 0.02);
		for (uint32_t v = 0; v < g.p.nv; v++)
			g.p.pos[v] = wh_scale(g.p.pos[v], 0x1p40);
		wh_simplify_params p = {.target_faces = 100, .policy = choices[k]};
		reduce_with(&f, &p);
		reduce_with(&g, &p);
		assert_int_equal(f.p.nf, g.p.nf);
		assert_memory_equal(f.p.tri, g.p.tri, 3 * (size_t)f.p.nf * sizeof *f.p.tri);
		drop(&f);
		drop(&g);
	}
}

static void every_failed_allocation_is_survived(void **state)
{
	(void)state;
	wh_simplify_params p = {.target_faces = 20, .policy = {.cost = WH_COST_QEM}};
	long at = 0;
	for (wh_code code = WH_E_RUN; code != WH_OK;) {
		fixture f;
		grid(&f, 10, 10, 0.02);
		p.max_cost = p.max_err = (double)INFINITY;
		f.t.mem.fail_after = ++at;
		code = wh_simplify(&f.t.ctx, f.w, &f.p, &p, &f.done);
		f.t.mem.fail_after = 0;
		drop(&f);
	}
	assert_true(at > 5);
}

static void the_workspace_is_as_large_as_announced(void **state)
{
	(void)state;
	for (int k = 0; k < CHOICES; k++) {
		fixture f;
		torus(&f, 20000);
		wh_simplify_params p = {.target_faces = 100, .policy = choices[k]};
		const size_t before = f.t.mem.used,
		             announced = wh_simplify_bytes(f.p.nv, f.p.nf, 0) +
		                         f.p.nv * wh_policy_bytes(&choices[k]);
		f.t.mem.peak = before;
		reduce_with(&f, &p);
		assert_true(f.t.mem.peak - before <= announced + 65536);
		drop(&f);
	}
}

static void names_are_understood_and_others_are_not(void **state)
{
	(void)state;
	wh_cost cost;
	wh_weight weight;
	wh_placement placement;
	static const char *const costs[WH_COST_OWN] = {[WH_COST_MEMORYLESS] = "memoryless",
	                                               [WH_COST_QEM] = "qem",
	                                               [WH_COST_NORMALS] = "qem-normals",
	                                               [WH_COST_MELAX] = "melax",
	                                               [WH_COST_LENGTH] = "edge-length"};
	static const char *const weights[WH_WEIGHTS] = {[WH_WEIGHT_AREA] = "area",
	                                                [WH_WEIGHT_UNIFORM] = "uniform",
	                                                [WH_WEIGHT_ANGLE] = "angle"};
	static const char *const places[WH_PLACEMENTS] = {[WH_PLACE_OPTIMAL] = "optimal",
	                                                  [WH_PLACE_MIDPOINT] = "midpoint",
	                                                  [WH_PLACE_ENDPOINT] = "endpoint"};
	for (int i = 0; i < WH_COST_OWN; i++) {
		assert_true(wh_cost_parse(costs[i], &cost));
		assert_int_equal(cost, i);
	}
	for (int i = 0; i < WH_WEIGHTS; i++) {
		assert_true(wh_weight_parse(weights[i], &weight));
		assert_int_equal(weight, i);
	}
	for (int i = 1; i < WH_PLACEMENTS; i++) {
		assert_true(wh_placement_parse(places[i], &placement));
		assert_int_equal(placement, i);
	}
	assert_false(wh_cost_parse("own", &cost)); /* without its function */
	assert_false(wh_weight_parse("", &weight));
	assert_false(wh_placement_parse("usual", &placement));
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	    cmocka_unit_test(a_quadric_sums_squared_distances),
	    cmocka_unit_test(two_planes_have_no_minimum_but_along_an_edge),
	    cmocka_unit_test(angles_are_those_of_the_library),
	    cmocka_unit_test(the_matrices_of_the_box),
	    cmocka_unit_test(the_fifteen_edges_of_the_box),
	    cmocka_unit_test(the_box_loses_its_inner_vertex),
	    cmocka_unit_test(a_box_without_normals_gets_those_of_its_faces),
	    cmocka_unit_test(two_hundred_triangles_lose_two_by_an_inner_collapse),
	    cmocka_unit_test(sixteen_triangles_become_fourteen_at_a_midpoint),
	    cmocka_unit_test(a_collapse_to_a_fin_is_refused),
	    cmocka_unit_test(every_policy_keeps_a_handle_and_reaches_its_count),
	    cmocka_unit_test(every_policy_simplifies_a_border_and_does_not_tear_it),
	    cmocka_unit_test(cut_vertices_stay_with_every_policy),
	    cmocka_unit_test(end_points_are_vertices_that_were_there),
	    cmocka_unit_test(melax_takes_what_is_flat_first),
	    cmocka_unit_test(the_order_does_not_depend_on_the_unit),
	    cmocka_unit_test(every_failed_allocation_is_survived),
	    cmocka_unit_test(the_workspace_is_as_large_as_announced),
	    cmocka_unit_test(names_are_understood_and_others_are_not),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
