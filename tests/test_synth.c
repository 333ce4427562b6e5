/* Synthetic surfaces: topology, orientation, order, exactness of offsets. */
#define _POSIX_C_SOURCE 200809L
#include "testing.h"

#include <stdlib.h>
#include <string.h>

#include "algo/synth.h"
#include "base/permute.h"
#include "io/outfile.h"

#include <stdio.h>
#include <unistd.h>

/* ---- a mesh of given parameters, and what is counted in it ---- */

typedef struct counts {
	uint64_t edges, boundary, components, loops;
} counts;

typedef struct fixture {
	testing_env t;
	wh_synth *s;
	wh_mesh m;
} fixture;

static void make(fixture *f, const wh_synth_params *p)
{
	*f = (fixture){0};
	testing_init(&f->t);
	assert_int_equal(wh_synth_open(&f->t.ctx, &f->s, p), WH_OK);
	assert_int_equal(wh_synth_mesh(&f->t.ctx, f->s, &f->m), WH_OK);
	assert_int_equal(f->m.nv, wh_synth_vertices(f->s));
	assert_int_equal(f->m.nf, wh_synth_faces(f->s));
}

static void drop(fixture *f)
{
	wh_mesh_free(&f->t.ctx, &f->m);
	wh_synth_close(&f->t.ctx, &f->s);
	testing_done(&f->t);
}

static wh_synth_params params(wh_synth_kind kind, uint64_t faces, uint64_t seed)
{
	wh_synth_params p = wh_synth_defaults();
	p.kind = kind;
	p.faces = faces;
	p.seed = seed;
	return p;
}

static int by_value(const void *a, const void *b)
{
	const uint64_t x = *(const uint64_t *)a, y = *(const uint64_t *)b;
	return (x > y) - (x < y);
}

/* All directed edges (from << 32 | to), sorted. */
static uint64_t *directed_edges(const wh_mesh *m)
{
	const size_t n = 3 * (size_t)m->nf;
	uint64_t *e = malloc(n * sizeof *e);
	assert_non_null(e);
	for (size_t i = 0; i < n; i++) {
		const size_t next = i % 3 == 2 ? i - 2 : i + 1;
		assert_true(m->tri[i] < m->nv);
		assert_true(m->tri[i] != m->tri[next]);
		e[i] = (uint64_t)m->tri[i] << 32 | m->tri[next];
	}
	qsort(e, n, sizeof *e, by_value);
	return e;
}

static bool has_edge(const uint64_t *e, size_t n, uint64_t key)
{
	return bsearch(&key, e, n, sizeof *e, by_value) != NULL;
}

static uint32_t root(uint32_t *parent, uint32_t v)
{
	while (parent[v] != v)
		v = parent[v] = parent[parent[v]];
	return v;
}

static uint32_t *own_roots(uint32_t n)
{
	uint32_t *parent = malloc(n * sizeof *parent);
	assert_non_null(parent);
	for (uint32_t i = 0; i < n; i++)
		parent[i] = i;
	return parent;
}

static uint64_t count_roots(const uint32_t *parent, const uint8_t *in, uint32_t n)
{
	uint64_t roots = 0;
	for (uint32_t i = 0; i < n; i++)
		roots += in[i] && parent[i] == i;
	return roots;
}

/*
 * Fails unless every directed edge occurs once (manifold and consistently oriented), every
 * boundary vertex has one boundary edge in and one out, every vertex is used, and every vertex's
 * faces form one fan.
 */
static counts count(const wh_mesh *m)
{
	const size_t n = 3 * (size_t)m->nf;
	uint64_t *e = directed_edges(m);
	uint32_t *whole = own_roots(m->nv), *border = own_roots(m->nv);
	uint8_t *used = calloc(m->nv, 1), *out = calloc(m->nv, 1), *in = calloc(m->nv, 1);
	assert_true(used && out && in);
	counts k = {0};
	for (size_t i = 0; i < n; i++) {
		const uint32_t a = (uint32_t)(e[i] >> 32), b = (uint32_t)e[i];
		assert_true(i == 0 || e[i] != e[i - 1]);
		used[a] = 1;
		whole[root(whole, a)] = root(whole, b);
		const bool twin = has_edge(e, n, (uint64_t)b << 32 | a);
		k.edges += !twin || a < b;
		if (twin)
			continue;
		k.boundary++;
		out[a]++;
		in[b]++;
		border[root(border, a)] = root(border, b);
	}
	for (uint32_t v = 0; v < m->nv; v++) {
		assert_true(used[v]);
		assert_true(out[v] <= 1 && in[v] == out[v]);
	}
	k.components = count_roots(whole, used, m->nv);
	k.loops = count_roots(border, out, m->nv);
	free(e);
	free(whole);
	free(border);
	free(used);
	free(out);
	free(in);
	return k;
}

static int64_t euler(const wh_mesh *m, const counts *k)
{
	return (int64_t)m->nv - (int64_t)k->edges + (int64_t)m->nf;
}

static double volume6(const wh_mesh *m, size_t f)
{
	const uint32_t *t = m->tri + 3 * f;
	return wh_dot(m->pos[t[0]], wh_cross(m->pos[t[1]], m->pos[t[2]]));
}

static wh_vec3 face_normal(const wh_mesh *m, size_t f)
{
	const uint32_t *t = m->tri + 3 * f;
	return wh_cross(wh_sub(m->pos[t[1]], m->pos[t[0]]), wh_sub(m->pos[t[2]], m->pos[t[0]]));
}

static void assert_near_count(const wh_mesh *m, uint64_t wanted)
{
	const double off = fabs((double)m->nf - (double)wanted) / (double)wanted;
	assert_true(wanted < 10000 || off < 0.01);
	assert_true(wanted < 100000 || off < 0.004);
}

static const uint64_t sizes[] = {12, 13, 40, 100, 1000, 9999, 200000};

enum { NSIZES = sizeof sizes / sizeof sizes[0] };

/* Every triangle seen from the origin at the same side: the surface is star-shaped. */
static void sphere_is_a_closed_star(void **state)
{
	(void)state;
	for (int i = 0; i < NSIZES; i++) {
		fixture f;
		wh_synth_params p = params(WH_SYNTH_SPHERE, sizes[i], (uint64_t)i);
		p.flat = i % 2 ? 0.4 : 0.0;
		make(&f, &p);
		const counts k = count(&f.m);
		assert_int_equal(k.boundary, 0);
		assert_int_equal(k.components, 1);
		assert_int_equal(euler(&f.m, &k), 2);
		for (size_t j = 0; j < f.m.nf; j++)
			assert_true(volume6(&f.m, j) > 0.0);
		assert_near_count(&f.m, sizes[i]);
		drop(&f);
	}
}

static void torus_is_closed_with_one_handle(void **state)
{
	(void)state;
	for (int i = 0; i < NSIZES; i++) {
		fixture f;
		wh_synth_params p = params(WH_SYNTH_TORUS, sizes[i], (uint64_t)i);
		p.flat = i % 2 ? 0.4 : 0.0;
		make(&f, &p);
		const counts k = count(&f.m);
		double volume = 0.0;
		assert_int_equal(k.boundary, 0);
		assert_int_equal(k.components, 1);
		assert_int_equal(euler(&f.m, &k), 0);
		for (size_t j = 0; j < f.m.nf; j++) {
			assert_true(wh_norm(face_normal(&f.m, j)) > 0.0);
			volume += volume6(&f.m, j);
		}
		assert_true(volume > 0.0);
		assert_near_count(&f.m, sizes[i]);
		drop(&f);
	}
}

static void check_terrain(const wh_synth_params *p)
{
	fixture f;
	make(&f, p);
	const counts k = count(&f.m);
	const uint64_t holes = wh_synth_holes(f.s);
	if (p->holes >= 0)
		assert_int_equal(holes, p->holes);
	assert_int_equal(k.components, 1);
	assert_int_equal(k.loops, holes + 1);
	assert_int_equal(euler(&f.m, &k), 1 - (int64_t)holes);
	for (size_t j = 0; j < f.m.nf; j++)
		assert_true(face_normal(&f.m, j).z > 0.0);
	assert_near_count(&f.m, p->faces);
	drop(&f);
}

static void terrain_is_a_height_field_with_its_holes(void **state)
{
	(void)state;
	for (int i = 0; i < NSIZES; i++) {
		wh_synth_params p = params(WH_SYNTH_TERRAIN, sizes[i], (uint64_t)i);
		check_terrain(&p);
	}
	for (uint64_t seed = 0; seed < 60; seed++) {
		wh_synth_params p = params(WH_SYNTH_TERRAIN, 150 + 97 * seed, seed);
		check_terrain(&p);
	}
	wh_synth_params p = params(WH_SYNTH_TERRAIN, 60000, 5);
	p.holes = 0;
	check_terrain(&p);
	p.holes = 37;
	check_terrain(&p);
	p.holes = 300;
	check_terrain(&p);
}

/* As many holes as there is room for, at the sizes where that number changes. */
static void terrain_holds_as_many_holes_as_it_says(void **state)
{
	(void)state;
	for (uint64_t faces = 50; faces < 4000; faces += 50) {
		wh_synth_params p = params(WH_SYNTH_TERRAIN, faces, faces);
		testing_env t;
		testing_init(&t);
		unsigned long long room;
		wh_synth *s;
		p.holes = WH_SYNTH_MAX_HOLES;
		assert_int_equal(wh_synth_open(&t.ctx, &s, &p), WH_E_USAGE);
		assert_int_equal(
		    sscanf(t.ctx.err.text, "%*u faces have room for %llu holes", &room), 1);
		testing_done(&t);
		p.holes = (int64_t)room;
		check_terrain(&p);
	}
}

static void spacing_is_about_even(void **state)
{
	(void)state;
	fixture f;
	wh_synth_params p = params(WH_SYNTH_SPHERE, 50000, 1);
	p.relief = 0.0;
	p.noise = 0.0;
	make(&f, &p);
	double least = 1e30, most = 0.0;
	for (size_t j = 0; j < f.m.nf; j++) {
		const double area = wh_norm(face_normal(&f.m, j));
		least = fmin(least, area);
		most = fmax(most, area);
	}
	assert_true(most < 2.0 * least);
	drop(&f);
}

/* ---- order ---- */

/* A triangle as nine coordinates, smallest corner first, orientation kept. */
typedef struct soup {
	wh_vec3 corner[3];
} soup;

static int by_bytes(const void *a, const void *b)
{
	return memcmp(a, b, sizeof(soup));
}

static soup *sorted_soup(const wh_mesh *m)
{
	soup *all = malloc(m->nf * sizeof *all);
	assert_non_null(all);
	for (size_t f = 0; f < m->nf; f++) {
		const uint32_t *t = m->tri + 3 * f;
		size_t first = 0;
		for (size_t i = 1; i < 3; i++)
			if (memcmp(&m->pos[t[i]], &m->pos[t[first]], sizeof(wh_vec3)) < 0)
				first = i;
		for (size_t i = 0; i < 3; i++)
			all[f].corner[i] = m->pos[t[(first + i) % 3]];
	}
	qsort(all, m->nf, sizeof *all, by_bytes);
	return all;
}

static void shuffling_changes_the_order_alone(void **state)
{
	(void)state;
	for (wh_synth_kind kind = WH_SYNTH_SPHERE; kind <= WH_SYNTH_TERRAIN; kind++) {
		fixture rows, mixed;
		wh_synth_params p = params(kind, 5000, 3);
		make(&rows, &p);
		p.shuffled = true;
		make(&mixed, &p);
		assert_int_equal(rows.m.nf, mixed.m.nf);
		assert_memory_not_equal(rows.m.pos, mixed.m.pos, 100 * sizeof(wh_vec3));
		soup *a = sorted_soup(&rows.m), *b = sorted_soup(&mixed.m);
		assert_memory_equal(a, b, rows.m.nf * sizeof *a);
		free(a);
		free(b);
		drop(&rows);
		drop(&mixed);
	}
}

static void permutation_is_a_bijection(void **state)
{
	(void)state;
	static const uint64_t lengths[] = {1, 2, 3, 4, 5, 31, 32, 33, 1000, 65536, 65537};
	for (size_t i = 0; i < sizeof lengths / sizeof lengths[0]; i++) {
		const uint64_t n = lengths[i];
		const wh_permute p = wh_permute_make(i, n);
		uint8_t *seen = calloc(n, 1);
		assert_non_null(seen);
		for (uint64_t x = 0; x < n; x++) {
			const uint64_t y = wh_permute_at(&p, x);
			assert_true(y < n && !seen[y]);
			seen[y] = 1;
			assert_int_equal(wh_permute_source(&p, y), x);
		}
		free(seen);
	}
}

static void permutation_scatters_neighbours(void **state)
{
	(void)state;
	const uint64_t n = 1000003;
	const wh_permute p = wh_permute_make(9, n);
	double sum = 0.0;
	for (uint64_t x = 1; x < 10000; x++)
		sum += fabs((double)wh_permute_at(&p, x) - (double)wh_permute_at(&p, x - 1));
	const double mean = sum / 9999.0 / (double)n; /* of two uniform numbers: 1/3 */
	assert_true(mean > 0.32 && mean < 0.345);
}

/* ---- positions ---- */

static void offset_is_exact(void **state)
{
	(void)state;
	fixture plain, moved;
	wh_synth_params p = params(WH_SYNTH_TERRAIN, 3000, 3);
	p.is_double = true;
	make(&plain, &p);
	p.offset[0] = 4512345.6;
	p.offset[1] = -5.4e6;
	p.offset[2] = 1e12;
	make(&moved, &p);
	double o[3];
	wh_synth_offset(moved.s, o);
	assert_true(o[0] == 4512345.599609375 && o[1] == -5.4e6 && o[2] == 1e12);
	for (uint32_t i = 0; i < plain.m.nv; i++) {
		const wh_vec3 a = plain.m.pos[i], b = moved.m.pos[i];
		assert_true(b.x - o[0] == a.x && b.y - o[1] == a.y && b.z - o[2] == a.z);
		assert_true(a.x + o[0] == b.x && a.y + o[1] == b.y && a.z + o[2] == b.z);
	}
	drop(&plain);
	drop(&moved);
}

static void a_float_holds_every_coordinate(void **state)
{
	(void)state;
	for (wh_synth_kind kind = WH_SYNTH_SPHERE; kind <= WH_SYNTH_TERRAIN; kind++) {
		fixture f;
		wh_synth_params p = params(kind, 2000, 8);
		p.relief = 0.2;
		p.noise = 1.0;
		make(&f, &p);
		for (uint32_t i = 0; i < f.m.nv; i++) {
			const wh_vec3 a = f.m.pos[i];
			assert_true((double)(float)a.x == a.x && (double)(float)a.y == a.y &&
			            (double)(float)a.z == a.z);
		}
		drop(&f);
	}
}

/* Without noise, vertices of the flat part lie in its planes to the last bit. */
static void flat_share_is_kept(void **state)
{
	(void)state;
	for (wh_synth_kind kind = WH_SYNTH_SPHERE; kind <= WH_SYNTH_TERRAIN; kind++) {
		fixture f;
		wh_synth_params p = params(kind, 100000, 2);
		p.noise = 0.0;
		p.flat = 0.3;
		make(&f, &p);
		/* height of the planes: 10000 (1 - flat / 3), 3600 cos(pi flat / 2), 0 */
		const double at = kind == WH_SYNTH_SPHERE  ? 9000.0
		                  : kind == WH_SYNTH_TORUS ? 3207.623486869
		                                           : 0.0;
		uint32_t flat = 0;
		for (uint32_t i = 0; i < f.m.nv; i++) {
			const wh_vec3 a = f.m.pos[i];
			const double z = fabs(a.z);
			const double most = fmax(z, fmax(fabs(a.x), fabs(a.y)));
			flat += fabs((kind == WH_SYNTH_SPHERE ? most : z) - at) < 0x1p-10;
		}
		const double share = (double)flat / (double)f.m.nv;
		assert_true(share > 0.25 && share < 0.35);
		drop(&f);
	}
}

static void nonsense_is_refused(void **state)
{
	(void)state;
	const wh_synth_params good = params(WH_SYNTH_SPHERE, 1000, 0);
	wh_synth_params bad[8];
	for (int i = 0; i < 8; i++)
		bad[i] = good;
	bad[0].faces = 11;
	bad[1].faces = UINT64_C(1) << 40;
	bad[2].holes = 3;
	bad[3].noise = -0.1;
	bad[4].relief = (double)NAN;
	bad[5].flat = 0.9;
	bad[6].offset[1] = 1e13;
	bad[7].kind = WH_SYNTH_TERRAIN;
	bad[7].holes = 500;
	for (int i = 0; i < 8; i++) {
		testing_env t;
		wh_synth *s;
		testing_init(&t);
		assert_int_equal(wh_synth_open(&t.ctx, &s, &bad[i]), WH_E_USAGE);
		assert_null(s);
		testing_done(&t);
	}
}

/* ---- files ---- */

static wh_code write_with_failure(long fail_after, const char *path, const wh_synth_params *p)
{
	testing_env t;
	wh_synth *s = NULL;
	wh_outfile *o = NULL;
	const wh_exec ex = {.workers = 2};
	testing_init(&t);
	t.mem.fail_after = fail_after;
	wh_code code = wh_synth_open(&t.ctx, &s, p);
	if (code == WH_OK)
		code = wh_outfile_open(&t.ctx, &o, path, true);
	if (code == WH_OK)
		code = wh_synth_write(&t.ctx, &ex, s, o);
	if (code == WH_OK)
		code = wh_outfile_commit(&t.ctx, &o);
	wh_outfile_abort(&t.ctx, &o);
	wh_synth_close(&t.ctx, &s);
	testing_done(&t);
	return code;
}

static void every_failed_allocation_is_survived(void **state)
{
	(void)state;
	char path[] = "/tmp/whittle-synth-XXXXXX";
	const int fd = mkstemp(path);
	assert_true(fd >= 0);
	(void)close(fd);
	const wh_synth_params p = params(WH_SYNTH_TERRAIN, 3000, 3);
	long fails = 0;
	while (write_with_failure(fails + 1, path, &p) != WH_OK)
		assert_true(++fails < 100);
	assert_true(fails > 5);
	(void)unlink(path);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	    cmocka_unit_test(sphere_is_a_closed_star),
	    cmocka_unit_test(torus_is_closed_with_one_handle),
	    cmocka_unit_test(terrain_is_a_height_field_with_its_holes),
	    cmocka_unit_test(terrain_holds_as_many_holes_as_it_says),
	    cmocka_unit_test(spacing_is_about_even),
	    cmocka_unit_test(shuffling_changes_the_order_alone),
	    cmocka_unit_test(permutation_is_a_bijection),
	    cmocka_unit_test(permutation_scatters_neighbours),
	    cmocka_unit_test(offset_is_exact),
	    cmocka_unit_test(a_float_holds_every_coordinate),
	    cmocka_unit_test(flat_share_is_kept),
	    cmocka_unit_test(nonsense_is_refused),
	    cmocka_unit_test(every_failed_allocation_is_survived),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
