/*
 * Sources cleaned of vertices that are not finite and of near ones: what stays is what the rule of
 * pipeline/clean.h says, worked out here the long way, however the work is cut.
 */
#define _XOPEN_SOURCE 700
#include "ply_files.h"

#include "base/real.h"
#include "base/rng.h"
#include "pipeline/clean.h"

#include <math.h>

enum { VERTICES = 5000, FACES = 4000 };

typedef struct cloud {
	double p[VERTICES][3];
	uint32_t t[FACES][3];
	bool is_double;
	double offset;
} cloud;

static bool is_finite(const double *p)
{
	return isfinite(p[0]) && isfinite(p[1]) && isfinite(p[2]);
}

static double random_in(wh_rng *g, double size)
{
	return size * (double)(wh_rng_next(g) >> 11) / 9007199254740992.0;
}

/* Clumps of very near vertices, a plane of them on a lattice, and equal ones: all at once, so that
 * there are chains. One in 300 is not finite. */
static void make_cloud(cloud *k, bool is_double, double offset)
{
	wh_rng g = wh_rng_seed(11);
	k->is_double = is_double;
	k->offset = offset;
	for (int v = 0; v < VERTICES; v++) {
		double *p = k->p[v];
		for (int i = 0; i < 3; i++)
			p[i] = v % 3 == 0   ? random_in(&g, 1)
			       : v % 3 == 1 ? 0.3 + random_in(&g, 0.02)
			                    : (i < 2 ? floor(random_in(&g, 40)) / 40 : 0.5);
		if (v % 7 == 6)
			memcpy(p, k->p[v - 5], sizeof k->p[v]);
		for (int i = 0; i < 3; i++) {
			p[i] += v % 7 == 6 ? 0 : offset;
			p[i] = is_double ? p[i] : wh_round_float(p[i]);
		}
		if (v % 300 == 299)
			p[v % 3] = v % 2 ? NAN : -INFINITY;
	}
	for (int f = 0; f < FACES; f++)
		for (int i = 0; i < 3; i++)
			k->t[f][i] = (uint32_t)(wh_rng_next(&g) % VERTICES);
}

/* A long thin thread of vertices, two to a unit of length and in no order: chains all along it,
 * over the borders of many blocks of cells. */
static void make_thread(cloud *k)
{
	wh_rng g = wh_rng_seed(5);
	make_cloud(k, true, 0);
	for (int v = 0; v < VERTICES; v++)
		if (is_finite(k->p[v]))
			for (int i = 0; i < 3; i++)
				k->p[v][i] = random_in(&g, i ? 0.3 : VERTICES / 2.0) - 100;
}

static ply_file write_cloud(const cloud *k)
{
	const char *real = k->is_double ? "double" : "float";
	char text[512];
	ply_file f = ply_begin(WH_PLY_LE);
	(void)snprintf(text, sizeof text,
	               "element vertex %d\nproperty %s x\nproperty int id\nproperty %s y\n"
	               "property %s z\nelement face %d\n"
	               "property list uchar int vertex_indices\n",
	               VERTICES, real, real, real, FACES);
	ply_header(&f, text);
	for (int v = 0; v < VERTICES; v++) {
		const wh_type type = k->is_double ? WH_F64 : WH_F32;
		ply_value(&f, type, k->p[v][0]);
		ply_value(&f, WH_I32, v);
		ply_value(&f, type, k->p[v][1]);
		ply_value(&f, type, k->p[v][2]);
	}
	for (int t = 0; t < FACES; t++) {
		ply_value(&f, WH_U8, 3);
		for (int i = 0; i < 3; i++)
			ply_value(&f, WH_I32, k->t[t][i]);
	}
	ply_end(&f);
	return f;
}

/* ---- the rule ----------------------------------------------------------------------------- */

enum { NOWHERE = -1 };

static int colour_of(const double *p, double distance)
{
	int colour = 0;
	for (int i = 0; i < 3 && distance > 0; i++)
		colour |= (int)((int64_t)floor(p[i] * (1 / distance / 8)) & 1) << i;
	return colour;
}

/* The square of how far they are apart, 1 being the distance; above 1 for equal ones alone. */
static double far_sq(const double *p, const double *q, double distance)
{
	double sum = 0;
	for (int i = 0; i < 3; i++) {
		const double d = (p[i] - q[i]) * (1 / distance);
		sum += d * d;
	}
	if (distance > 0)
		return sum;
	return p[0] == q[0] && p[1] == q[1] && p[2] == q[2] ? 0 : 2;
}

/* What each vertex becomes: itself, another one, or NOWHERE. */
static void settle(const cloud *k, double distance, int as[VERTICES])
{
	for (int v = 0; v < VERTICES; v++)
		as[v] = NOWHERE;
	for (int n = 0; n < 8 * VERTICES; n++) {
		const int colour = n / VERTICES, v = n % VERTICES;
		double best = 2;
		if (!is_finite(k->p[v]) || colour_of(k->p[v], distance) != colour)
			continue;
		as[v] = v;
		for (int u = 0; u < VERTICES; u++) {
			if (u == v || as[u] != u)
				continue;
			const double sq = far_sq(k->p[v], k->p[u], distance);
			if (sq <= 1 && sq < best) {
				best = sq;
				as[v] = u;
			}
		}
	}
}

/* No vertex goes farther than the distance; no two that stay are within it. */
static void rule_is_kept(const cloud *k, double distance, const int as[VERTICES])
{
	for (int v = 0; v < VERTICES; v++) {
		if (as[v] == NOWHERE)
			continue;
		assert_true(as[as[v]] == as[v] && far_sq(k->p[v], k->p[as[v]], distance) <= 1);
		for (int u = 0; u < v && as[v] == v; u++)
			assert_false(as[u] == u && far_sq(k->p[v], k->p[u], distance) <= 1);
	}
}

/* ---- what came out ------------------------------------------------------------------------ */

static void same_vertices(wh_ctx *c, const cloud *k, const wh_source *s, const int as[VERTICES],
                          int id[VERTICES])
{
	double *xyz = wh_alloc(c, s->nv, 3 * sizeof *xyz);
	uint8_t *records = wh_alloc(c, s->nv, s->attributes->bytes);
	void *scratch = wh_alloc(c, wh_source_vertex_bytes(s, s->nv), 1);
	int n = 0;
	assert_int_equal(wh_source_vertices(c, s, 0, s->nv, xyz, scratch), WH_OK);
	assert_int_equal(wh_source_attributes(c, s, 0, s->nv, records, scratch), WH_OK);
	for (int v = 0; v < VERTICES; v++) {
		if (as[v] != v)
			continue;
		assert_true((uint64_t)n < s->nv);
		assert_memory_equal(xyz + 3 * (size_t)n, k->p[v], sizeof k->p[v]);
		assert_true(wh_attribute_get(s->attributes->item,
		                             records + (size_t)n * s->attributes->bytes) == v);
		id[v] = n++;
	}
	assert_int_equal(s->nv, n);
	wh_free(c, scratch);
	wh_free(c, records);
	wh_free(c, xyz);
}

/* Whether a face is still one; its counts are added to *r. */
static bool stays(const uint32_t *t, const int as[VERTICES], wh_clean_result *r)
{
	if (t[0] == t[1] || t[1] == t[2] || t[2] == t[0]) {
		r->degenerate_faces++;
		return false;
	}
	const int a = as[t[0]], b = as[t[1]], d = as[t[2]];
	const bool invalid = a == NOWHERE || b == NOWHERE || d == NOWHERE;
	const bool collapsed = a == b || b == d || d == a;
	r->invalid_faces += invalid;
	r->collapsed_faces += !invalid && collapsed;
	return !invalid && !collapsed;
}

static void same_faces(wh_ctx *c, const cloud *k, const wh_source *s, const int as[VERTICES],
                       const int id[VERTICES], const wh_clean_result *found)
{
	uint64_t *ids = wh_alloc(c, s->nf, 3 * sizeof *ids);
	void *scratch = wh_alloc(c, wh_source_triangle_bytes(s, s->nf), 1);
	wh_clean_result expected = {0};
	size_t n = 0;
	assert_int_equal(wh_source_triangles(c, s, 0, s->nf, ids, scratch), WH_OK);
	for (int f = 0; f < FACES; f++) {
		if (!stays(k->t[f], as, &expected))
			continue;
		assert_true(n < s->nf);
		for (int i = 0; i < 3; i++)
			assert_int_equal(ids[3 * n + (size_t)i], id[as[k->t[f][i]]]);
		n++;
	}
	assert_int_equal(s->nf, n);
	assert_int_equal(found->invalid_faces, expected.invalid_faces);
	assert_int_equal(found->collapsed_faces, expected.collapsed_faces);
	assert_int_equal(found->degenerate_faces, expected.degenerate_faces);
	wh_free(c, scratch);
	wh_free(c, ids);
}

/* Cleans the file, the work cut in one way, and compares. */
static void clean_one_way(const cloud *k, const wh_clean_params *p, int workers,
                          const int as[VERTICES])
{
	testing_env t;
	wh_spill spill;
	wh_input in;
	wh_source out;
	wh_clean_result found;
	wh_progress progress = {.telling = ATOMIC_FLAG_INIT};
	int fd, id[VERTICES];
	ply_file f = write_cloud(k);
	testing_init(&t);
	const wh_exec ex = {.workers = workers};
	const wh_input_how how = {.attributes = {NULL, WH_HOLDS_ALL}, .keep_invalid = true};
	assert_int_equal(wh_spill_open(&t.ctx, &spill, "/tmp", NULL), WH_OK);
	assert_int_equal(wh_input_open_how(&t.ctx, &ex, &spill, f.path, &how, &in), WH_OK);
	const wh_code code = wh_clean(&t.ctx, &ex, &progress, &spill, &in.source, p,
	                              (size_t)64 << 20, &out, &fd, &found);
	if (code != WH_OK)
		fail_msg("%s", t.ctx.err.text);
	assert_true(fd >= 0);
	same_vertices(&t.ctx, k, &out, as, id);
	same_faces(&t.ctx, k, &out, as, id, &found);
	wh_spill_close_scratch(&spill, fd);
	wh_input_close(&t.ctx, &spill, &in);
	assert_int_equal(spill.held, 0);
	wh_spill_close(&t.ctx, &spill);
	(void)unlink(f.path);
	testing_done(&t);
}

static void clean_all_ways(const cloud *k, bool weld, double distance)
{
	int as[VERTICES];
	wh_clean_params p = {.drop_invalid = true, .weld = weld, .distance = distance};
	if (weld)
		settle(k, distance, as);
	else
		for (int v = 0; v < VERTICES; v++)
			as[v] = is_finite(k->p[v]) ? v : NOWHERE;
	if (weld)
		rule_is_kept(k, distance, as);
	clean_one_way(k, &p, 1, as);
	p.bucket = 40;
	p.window = 700;
	clean_one_way(k, &p, 3, as);
	p.bucket = 7;
	p.window = 100;
	clean_one_way(k, &p, 2, as);
}

static void the_rule_holds_however_the_work_is_cut(void **state)
{
	(void)state;
	static const double distances[] = {0, 1e-7, 0.0004, 0.003, 0.02, 0.3, 5};
	cloud *k = malloc(sizeof *k);
	assert_non_null(k);
	for (size_t i = 0; i < sizeof distances / sizeof *distances; i++) {
		make_cloud(k, i % 2, i % 3 == 2 ? -4000 : 0);
		clean_all_ways(k, true, distances[i]);
	}
	make_thread(k);
	clean_all_ways(k, true, 0.4);
	clean_all_ways(k, true, 1);
	free(k);
}

static void invalid_vertices_go_with_their_faces(void **state)
{
	(void)state;
	cloud *k = malloc(sizeof *k);
	assert_non_null(k);
	make_cloud(k, true, 0);
	clean_all_ways(k, false, 0);
	free(k);
}

/* ---- files --------------------------------------------------------------------------------- */

/* A file cleaned of what is not finite, and checked for its counts. */
static void counts_of(const char *text, uint64_t nv, uint64_t nf, uint64_t bad_v, uint64_t bad_f)
{
	testing_env t;
	wh_spill spill;
	wh_input in;
	wh_source out;
	wh_clean_result found;
	wh_progress progress = {.telling = ATOMIC_FLAG_INIT};
	int fd = -1;
	ply_file f = ply_write(text);
	testing_init(&t);
	const wh_exec ex = {.workers = 2};
	const wh_input_how how = {.attributes = {"none", 0}, .keep_invalid = true};
	const wh_clean_params p = {.drop_invalid = true};
	assert_int_equal(wh_spill_open(&t.ctx, &spill, "/tmp", NULL), WH_OK);
	if (wh_input_open_how(&t.ctx, &ex, &spill, f.path, &how, &in) != WH_OK ||
	    wh_clean(&t.ctx, &ex, &progress, &spill, &in.source, &p, (size_t)64 << 20, &out, &fd,
	             &found) != WH_OK)
		fail_msg("%s", t.ctx.err.text);
	assert_int_equal(out.nv, nv);
	assert_int_equal(out.nf, nf);
	assert_int_equal(found.invalid_vertices, bad_v);
	assert_int_equal(found.invalid_faces + in.invalid_polygons, bad_f);
	if (fd >= 0)
		wh_spill_close_scratch(&spill, fd);
	wh_input_close(&t.ctx, &spill, &in);
	wh_spill_close(&t.ctx, &spill);
	(void)unlink(f.path);
	testing_done(&t);
}

static void polygons_with_such_a_corner_go_whole(void **state)
{
	(void)state;
	counts_of("ply\nformat ascii 1.0\nelement vertex 6\nproperty float x\nproperty float y\n"
	          "property float z\nelement face 3\nproperty list uchar int vertex_indices\n"
	          "end_header\n0 0 0\n1 0 0\n1 1 0\n0 1 0\nnan 2 0\n1e39 2 0\n"
	          "4 0 1 2 3\n4 0 1 2 4\n3 1 2 5\n",
	          4, 2, 2, 2);
}

static void other_formats_have_them_too(void **state)
{
	(void)state;
	counts_of("OFF\n5 3 0\n0 0 0\n1 0 0\n0 1 0\n0 0 inf\n1 1 1\n3 0 1 2\n3 1 2 3\n3 1 4 2\n", 4,
	          2, 1, 1);
	counts_of("solid s\nfacet normal 0 0 0\nouter loop\nvertex 0 0 0\nvertex 1 0 0\n"
	          "vertex 0 1 0\nendloop\nendfacet\nfacet normal 0 0 0\nouter loop\n"
	          "vertex 0 0 0\nvertex nan 0 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid s\n",
	          3, 1, 1, 1);
	counts_of("v 0 0 0\nv 1 0 0\nv 0 1 0\nv nan 0 0\nf 1 2 3\nf 2 3 4\n", 3, 1, 1, 1);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	    cmocka_unit_test(the_rule_holds_however_the_work_is_cut),
	    cmocka_unit_test(invalid_vertices_go_with_their_faces),
	    cmocka_unit_test(polygons_with_such_a_corner_go_whole),
	    cmocka_unit_test(other_formats_have_them_too),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
