/* A mesh checked in pieces has the counts of the whole, however it is cut. */
#include "testing.h"

#include "base/exact_sum.h"
#include "base/rng.h"
#include "mesh/check_pieces.h"
#include "pipeline/normalise.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

static uint32_t below(wh_rng *g, uint32_t n)
{
	return (uint32_t)(wh_rng_next(g) % n);
}

/* ---- in pieces ---------------------------------------------------------------------------- */

/* How a mesh is cut: the piece of each face. */
typedef struct cutting {
	uint32_t pieces;
	uint32_t *piece; /* of each face */
	bool *cut;       /* of each vertex: in several pieces, or said to be */
} cutting;

/* Piece i of the mesh: its faces in order, vertices ascending. Corners out of range stay so. */
static void take_piece(wh_ctx *c, const wh_mesh *m, const cutting *x, uint32_t i, uint32_t *map,
                       wh_patch *p)
{
	uint32_t nf = 0;
	assert_int_equal(wh_patch_reset(c, p, m->nv, m->nf), WH_OK);
	memset(map, 0xff, m->nv * sizeof *map);
	for (uint32_t f = 0; f < m->nf; f++)
		for (int k = 0; k < 3 && x->piece[f] == i; k++)
			if (m->tri[3 * (size_t)f + (size_t)k] < m->nv)
				map[m->tri[3 * (size_t)f + (size_t)k]] = 0;
	p->nv = 0;
	for (uint32_t v = 0; v < m->nv; v++) {
		if (map[v] == WH_NONE)
			continue;
		p->pos[p->nv] = m->pos[v];
		p->gid[p->nv] = 7 + 3 * (uint64_t)v;
		p->flag[p->nv] = x->cut[v] ? WH_CUT | WH_BORDER : WH_FIXED;
		map[v] = p->nv++;
	}
	for (uint32_t f = 0; f < m->nf; f++) {
		if (x->piece[f] != i)
			continue;
		for (int k = 0; k < 3; k++) {
			const uint32_t v = m->tri[3 * (size_t)f + (size_t)k];
			p->tri[3 * (size_t)nf + (size_t)k] = v < m->nv ? map[v] : p->nv + 5;
		}
		nf++;
	}
	p->nf = nf;
}

/* Flags the vertices that two pieces use. */
static void find_cuts(const wh_mesh *m, cutting *x, uint32_t *user)
{
	memset(user, 0xff, m->nv * sizeof *user);
	memset(x->cut, 0, m->nv * sizeof *x->cut);
	for (size_t i = 0; i < 3 * (size_t)m->nf; i++) {
		const uint32_t v = m->tri[i], k = x->piece[i / 3];
		if (v >= m->nv)
			continue;
		x->cut[v] = x->cut[v] || (user[v] != WH_NONE && user[v] != k);
		user[v] = k;
	}
}

/* Looks at the pieces in an order that begins anywhere and goes by steps. */
static wh_code check_cut(wh_ctx *c, const wh_mesh *m, const cutting *x, uint32_t from, wh_check *r)
{
	wh_check_workspace *w = wh_check_workspace_new(c);
	wh_check_pieces *s = wh_check_pieces_new(c);
	uint32_t *map = wh_alloc(c, m->nv, sizeof *map);
	wh_patch p = {0};
	wh_code code = c->err.code;
	for (uint32_t i = 0; i < x->pieces && code == WH_OK; i++) {
		take_piece(c, m, x, (i + from) % x->pieces, map, &p);
		code = wh_check_look(c, w, &p);
		if (code == WH_OK)
			code = wh_check_pieces_add(c, s, w);
	}
	if (code == WH_OK)
		code = wh_check_pieces_end(c, s, r);
	wh_patch_free(c, &p);
	wh_free(c, map);
	wh_check_pieces_free(c, s);
	wh_check_workspace_free(c, w);
	return code;
}

#define SAME(member) assert_int_equal(a->member, b->member)

static void assert_same(const wh_check *a, const wh_check *b)
{
	SAME(faces);
	SAME(referenced_vertices);
	SAME(invalid_faces);
	SAME(degenerate_faces);
	SAME(zero_area_faces);
	SAME(duplicate_faces);
	SAME(edges);
	SAME(boundary_edges);
	SAME(nonmanifold_edges);
	SAME(misoriented_edges);
	SAME(folded_edges);
	SAME(largest_component);
	assert_memory_equal(a->component_sizes, b->component_sizes, sizeof a->component_sizes);
	assert_memory_equal(a->radius_ratios, b->radius_ratios, sizeof a->radius_ratios);
	SAME(nonmanifold_vertices);
	SAME(components);
	SAME(edge_components);
	SAME(boundary_loops);
	SAME(euler);
	SAME(genus);
	assert_true(a->area == b->area);
	assert_true(a->radius_ratio_mean == b->radius_ratio_mean);
	assert_true(a->radius_ratio_p5 == b->radius_ratio_p5);
	assert_true(a->lo.x == b->lo.x && a->lo.y == b->lo.y && a->lo.z == b->lo.z);
	assert_true(a->hi.x == b->hi.x && a->hi.y == b->hi.y && a->hi.z == b->hi.z);
}

/* Cuts in ways of all kinds and compares with the whole. */
static void check_cuttings(const wh_mesh *m, uint32_t ways, wh_rng *g)
{
	testing_env t;
	testing_init(&t);
	wh_ctx *c = &t.ctx;
	wh_check whole, r;
	cutting x = {.piece = wh_calloc(c, m->nf, sizeof *x.piece),
	             .cut = wh_calloc(c, m->nv, sizeof *x.cut)};
	uint32_t *user = wh_alloc(c, m->nv, sizeof *user);
	assert_int_equal(wh_check_mesh(c, m, &whole), WH_OK);
	for (uint32_t way = 0; way < ways; way++) {
		x.pieces = 1 + below(g, 6);
		const uint32_t run = 1 + below(g, way % 2 ? 2 : m->nf);
		for (uint32_t f = 0; f < m->nf; f++) /* some pieces may stay empty */
			x.piece[f] = f % run && f ? x.piece[f - 1] : below(g, x.pieces);
		find_cuts(m, &x, user);
		for (uint32_t v = 0; v < m->nv; v++) /* a cut that only one piece knows */
			x.cut[v] = x.cut[v] || (way % 3 == 0 && below(g, 4) == 0);
		assert_int_equal(check_cut(c, m, &x, below(g, x.pieces), &r), WH_OK);
		assert_same(&r, &whole);
		assert_int_equal(r.vertices, whole.referenced_vertices);
		assert_int_equal(r.unreferenced_vertices + r.duplicate_vertices, 0);
	}
	wh_free(c, user);
	wh_free(c, x.cut);
	wh_free(c, x.piece);
	testing_done(&t);
}

/* ---- meshes ------------------------------------------------------------------------------- */

enum { SIDE = 7, MOST_V = SIDE * SIDE, MOST_F = 2 * SIDE * SIDE + 8 };

typedef struct small_mesh {
	wh_mesh m;
	wh_vec3 pos[MOST_V];
	uint32_t tri[3 * MOST_F];
} small_mesh;

static void begin(small_mesh *s, uint32_t nv, wh_rng *g)
{
	s->m = (wh_mesh){.nv = nv, .pos = s->pos, .tri = s->tri};
	for (uint32_t v = 0; v < nv; v++)
		s->pos[v] = wh_v3(below(g, 4), below(g, 4), wh_rng_unit(g));
}

static void put(small_mesh *s, uint32_t a, uint32_t b, uint32_t d)
{
	memcpy(s->tri + 3 * (size_t)s->m.nf++, (uint32_t[]){a, b, d}, 3 * sizeof(uint32_t));
}

/* Any three of a few vertices, also out of range. */
static void make_soup(small_mesh *s, wh_rng *g)
{
	const uint32_t nv = 4 + below(g, 20), nf = 1 + below(g, 40);
	begin(s, nv, g);
	for (uint32_t f = 0; f < nf; f++) {
		const uint32_t last = below(g, 30) == 0 ? nv + 1 : below(g, nv);
		put(s, below(g, nv), below(g, nv), last);
	}
}

/* A lattice that may be closed in one direction or both, perhaps with a twist, with holes. */
static void make_lattice(small_mesh *s, wh_rng *g)
{
	const bool wrap_x = below(g, 2), wrap_y = below(g, 2), twist = below(g, 4) == 0;
	const uint32_t hole = below(g, 3) ? 0 : 2 + below(g, 20);
	begin(s, SIDE * SIDE, g);
	for (uint32_t y = 0; y < (wrap_y ? SIDE : SIDE - 1); y++)
		for (uint32_t x = 0; x < (wrap_x ? SIDE : SIDE - 1); x++) {
			const uint32_t e = (x + 1) % SIDE, n = (y + 1) % SIDE;
			const bool over = twist && e == 0;
			const uint32_t ye = over ? SIDE - 1 - y : y;
			const uint32_t ne = over ? SIDE - 1 - n : n;
			const uint32_t a = y * SIDE + x, b = ye * SIDE + e;
			const uint32_t d = ne * SIDE + e, f = n * SIDE + x;
			if (!hole || below(g, hole))
				put(s, a, b, d);
			if (!hole || below(g, hole))
				put(s, a, d, f);
		}
	if (s->m.nf == 0)
		put(s, 0, 1, 2);
}

/* Turned faces, copies, vertices made one, faces in any order. */
static void spoil(small_mesh *s, wh_rng *g)
{
	wh_mesh *m = &s->m;
	for (uint32_t n = below(g, 4); n > 0; n--) {
		uint32_t *t = s->tri + 3 * (size_t)below(g, m->nf);
		const uint32_t a = t[0];
		t[0] = t[1];
		t[1] = a;
	}
	for (uint32_t n = below(g, 3); n > 0; n--) {
		const uint32_t *t = s->tri + 3 * (size_t)below(g, m->nf);
		put(s, t[1], t[2], t[0]);
	}
	for (uint32_t n = below(g, 3); n > 0; n--) {
		const uint32_t from = below(g, m->nv), to = below(g, m->nv);
		for (size_t i = 0; i < 3 * (size_t)m->nf; i++)
			s->tri[i] = s->tri[i] == from ? to : s->tri[i];
	}
	for (uint32_t f = m->nf; below(g, 2) && f-- > 1;) {
		uint32_t hold[3], *a = s->tri + 3 * (size_t)f;
		uint32_t *b = s->tri + 3 * (size_t)below(g, f);
		memcpy(hold, a, sizeof hold);
		memcpy(a, b, sizeof hold);
		memcpy(b, hold, sizeof hold);
	}
}

/* ---- tests -------------------------------------------------------------------------------- */

static void soups_in_pieces_count_as_the_whole(void **state)
{
	(void)state;
	wh_rng g = wh_rng_seed(11);
	for (int i = 0; i < 300; i++) {
		small_mesh s;
		make_soup(&s, &g);
		check_cuttings(&s.m, 6, &g);
	}
}

static void lattices_in_pieces_count_as_the_whole(void **state)
{
	(void)state;
	wh_rng g = wh_rng_seed(12);
	for (int i = 0; i < 300; i++) {
		small_mesh s;
		make_lattice(&s, &g);
		if (i % 3)
			spoil(&s, &g);
		check_cuttings(&s.m, 6, &g);
	}
}

/*   0---1---2      cut at 1: an edge of the boundary on either side of it is in another piece
 *    \ / \ /
 *     3---4        piece 0: 0 1 3, piece 1: 1 3 4 and 1 2 4 */
static void a_loop_goes_on_in_the_next_piece(void **state)
{
	(void)state;
	testing_env t;
	testing_init(&t);
	uint32_t tri[] = {0, 3, 1, 3, 4, 1, 1, 4, 2};
	wh_vec3 pos[] = {{0, 1, 0}, {2, 1, 0}, {4, 1, 0}, {1, 0, 0}, {3, 0, 0}};
	const wh_mesh m = {.nv = 5, .nf = 3, .pos = pos, .tri = tri};
	uint32_t piece[] = {0, 1, 1};
	bool cut[] = {false, true, false, true, false};
	const cutting x = {.pieces = 2, .piece = piece, .cut = cut};
	wh_check r;
	assert_int_equal(check_cut(&t.ctx, &m, &x, 0, &r), WH_OK);
	assert_int_equal(r.edges, 7);
	assert_int_equal(r.boundary_edges, 5);
	assert_int_equal(r.boundary_loops, 1);
	assert_int_equal(r.components, 1);
	assert_int_equal(r.edge_components, 1);
	assert_int_equal(r.referenced_vertices, 5);
	assert_int_equal(r.genus, 0);
	assert_true(wh_check_clean(&r));
	assert_true(r.area == 3 && r.lo.x == 0 && r.hi.x == 4);
	testing_done(&t);
}

static void no_pieces_are_an_empty_mesh(void **state)
{
	(void)state;
	testing_env t;
	testing_init(&t);
	const wh_mesh none = {0};
	wh_check whole, r;
	const cutting x = {0};
	assert_int_equal(wh_check_mesh(&t.ctx, &none, &whole), WH_OK);
	assert_int_equal(check_cut(&t.ctx, &none, &x, 0, &r), WH_OK);
	assert_same(&r, &whole);
	testing_done(&t);
}

static void refused_memory_leaks_nothing(void **state)
{
	(void)state;
	wh_rng g = wh_rng_seed(13);
	small_mesh s;
	make_lattice(&s, &g);
	uint32_t piece[MOST_F], user[MOST_V];
	bool cut[MOST_V];
	cutting x = {.pieces = 3, .piece = piece, .cut = cut};
	for (uint32_t f = 0; f < s.m.nf; f++)
		piece[f] = f * 3 / s.m.nf;
	find_cuts(&s.m, &x, user);
	for (long fail = 1;; fail++) {
		testing_env t;
		testing_init(&t);
		/* what the test itself needs may not fail */
		wh_check_workspace *w = wh_check_workspace_new(&t.ctx);
		wh_check_pieces *sum = wh_check_pieces_new(&t.ctx);
		uint32_t *map = wh_alloc(&t.ctx, s.m.nv, sizeof *map);
		wh_patch p = {0};
		wh_code code = WH_OK;
		wh_check r;
		assert_int_equal(wh_patch_reset(&t.ctx, &p, s.m.nv, s.m.nf), WH_OK);
		t.mem.fail_after = fail;
		for (uint32_t i = 0; i < x.pieces && code == WH_OK; i++) {
			take_piece(&t.ctx, &s.m, &x, i, map, &p);
			code = wh_check_look(&t.ctx, w, &p);
			if (code == WH_OK)
				code = wh_check_pieces_add(&t.ctx, sum, w);
		}
		if (code == WH_OK)
			code = wh_check_pieces_end(&t.ctx, sum, &r);
		wh_patch_free(&t.ctx, &p);
		wh_free(&t.ctx, map);
		wh_check_pieces_free(&t.ctx, sum);
		wh_check_workspace_free(&t.ctx, w);
		testing_done(&t);
		if (code == WH_OK) {
			assert_true(fail > 30);
			return;
		}
		assert_int_equal(code, WH_E_RUN);
	}
}

/* Faces to the cells of a grid over the first corner. */
static void cut_by_place(const wh_mesh *m, const wh_check *whole, cutting *x)
{
	const uint32_t side = 4;
	x->pieces = side * side * side;
	const double size[3] = {whole->hi.x - whole->lo.x, whole->hi.y - whole->lo.y,
	                        whole->hi.z - whole->lo.z};
	for (uint32_t f = 0; f < m->nf; f++) {
		const wh_vec3 d = wh_sub(m->pos[m->tri[3 * (size_t)f]], whole->lo);
		const double at[3] = {d.x, d.y, d.z};
		x->piece[f] = 0;
		for (int k = 0; k < 3; k++) {
			const uint32_t cell = size[k] > 0 ? (uint32_t)(at[k] / size[k] * side) : 0;
			x->piece[f] = x->piece[f] * side + (cell < side ? cell : side - 1);
		}
	}
}

static void scan_in_pieces(const char *name)
{
	testing_env t;
	testing_init(&t);
	wh_ctx *c = &t.ctx;
	const wh_exec ex = {.workers = 1};
	char path[sizeof WHITTLE_DATA + 128];
	wh_spill spill;
	wh_mesh m;
	wh_check whole, r;
	(void)snprintf(path, sizeof path, "%s/scans/%s", WHITTLE_DATA, name);
	print_message("%s\n", name);
	assert_int_equal(wh_spill_open(c, &spill, NULL, "."), WH_OK);
	assert_int_equal(wh_load_mesh(c, &ex, &spill, path, WH_FORMAT_ANY, &m, NULL, NULL), WH_OK);
	assert_int_equal(wh_check_mesh(c, &m, &whole), WH_OK);
	cutting x = {.piece = wh_alloc(c, m.nf, sizeof *x.piece),
	             .cut = wh_alloc(c, m.nv, sizeof *x.cut)};
	uint32_t *user = wh_alloc(c, m.nv, sizeof *user);
	cut_by_place(&m, &whole, &x);
	find_cuts(&m, &x, user);
	assert_int_equal(check_cut(c, &m, &x, 21, &r), WH_OK);
	assert_same(&r, &whole);
	wh_free(c, user);
	wh_free(c, x.cut);
	wh_free(c, x.piece);
	wh_mesh_free(c, &m);
	wh_spill_close(c, &spill);
	testing_done(&t);
}

static void scans_in_pieces_count_as_the_whole(void **state)
{
	(void)state;
	static const char *const names[] = {
	    "dragon_vrip_res3.ply", "bun_zipper.ply",        "meshlab_lato315.ply",
	    "mouse_C57BL_10J.ply",  "ankylosaurus_mesh.ply", "openmvs_scene_mesh_refine.ply"};
	FILE *f = fopen(WHITTLE_DATA "/MANIFEST.tsv", "r");
	if (!f) {
		print_message("no scans in %s: skipped\n", WHITTLE_DATA);
		skip();
	}
	(void)fclose(f);
	for (size_t i = 0; i < sizeof names / sizeof *names; i++)
		scan_in_pieces(names[i]);
}

/* The same sum in three orders and two parts, over the whole range of doubles. */
static void an_exact_sum_has_no_order(void **state)
{
	(void)state;
	enum { N = 5000 };
	wh_rng g = wh_rng_seed(14);
	static double x[N];
	for (int i = 0; i < N; i++)
		x[i] = ldexp(wh_rng_unit(&g), (int)below(&g, i % 2 ? 2090 : 60) - 1074);
	wh_exact_sum up = {0}, down = {0}, part = {0};
	for (int i = 0; i < N; i++) {
		wh_exact_add(&up, x[i]);
		wh_exact_add(i % 3 ? &down : &part, x[N - 1 - i]);
	}
	wh_exact_join(&down, &part);
	assert_true(wh_exact_value(&up) == wh_exact_value(&down));
	wh_exact_sum few = {0};
	wh_exact_add(&few, 0x1p-1074);
	assert_true(wh_exact_value(&few) == 0x1p-1074);
	wh_exact_add(&few, 1);
	wh_exact_add(&few, 0x1p60);
	assert_true(wh_exact_value(&few) == 0x1p60);
	for (int i = 0; i < 256; i++)
		wh_exact_add(&few, 1);
	assert_true(wh_exact_value(&few) == 0x1p60 + 256);
	wh_exact_add(&few, INFINITY);
	assert_true(wh_exact_value(&few) == INFINITY);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	    cmocka_unit_test(soups_in_pieces_count_as_the_whole),
	    cmocka_unit_test(lattices_in_pieces_count_as_the_whole),
	    cmocka_unit_test(a_loop_goes_on_in_the_next_piece),
	    cmocka_unit_test(no_pieces_are_an_empty_mesh),
	    cmocka_unit_test(refused_memory_leaks_nothing),
	    cmocka_unit_test(scans_in_pieces_count_as_the_whole),
	    cmocka_unit_test(an_exact_sum_has_no_order),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
