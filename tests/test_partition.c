/*
 * Meshes of every kind cut into clusters, and cut anew: each face is in one cluster, each vertex
 * that several clusters use is marked, no cluster is much larger than the others, the memory is
 * what was promised, and how much of it there is does not show in the files.
 */
#define _XOPEN_SOURCE 700
#include "ply_files.h"

#include "base/rng.h"
#include "pipeline/homes.h"
#include "pipeline/ingest.h"
#include "pipeline/recut.h"
#include "pipeline/round.h"
#include "pipeline/visits.h"

#include <math.h>

enum { CLUSTERS = 12 };

/* ---- meshes ---- */

typedef struct shape {
	uint64_t nv, nf;
	float *xyz;
	uint32_t *tri;
} shape;

static shape room(uint64_t nv, uint64_t nf)
{
	shape s = {nv, nf, calloc(3 * nv, sizeof *s.xyz), calloc(3 * nf, sizeof *s.tri)};
	assert_non_null(s.xyz);
	assert_non_null(s.tri);
	return s;
}

static void drop_shape(shape *s)
{
	free(s->xyz);
	free(s->tri);
}

/* A square of side * side * 2 faces, row by row, or with its vertices and faces in any order. */
static shape square(uint32_t side, bool shuffled)
{
	const uint32_t w = side + 1;
	shape s = room((uint64_t)w * w, 2 * (uint64_t)side * side);
	uint32_t *name = malloc(s.nv * sizeof *name);
	assert_non_null(name);
	wh_rng g = wh_rng_seed(4);
	for (uint32_t v = 0; v < s.nv; v++) {
		const uint32_t j = shuffled ? (uint32_t)(wh_rng_next(&g) % (v + 1)) : v;
		name[v] = j == v ? v : name[j];
		name[j] = v;
	}
	for (uint32_t v = 0; v < s.nv; v++) {
		s.xyz[3 * name[v]] = (float)(v % w);
		s.xyz[3 * name[v] + 1] = (float)(v / w);
	}
	for (uint64_t f = 0; f < s.nf; f++) {
		/* 7919, a prime, steps through all faces */
		const uint64_t at = (shuffled ? f * 7919 % s.nf : f) / 2;
		const bool upper = (shuffled ? f * 7919 % s.nf : f) % 2;
		const uint32_t a = (uint32_t)(at / side * w + at % side), d = a + w + 1;
		s.tri[3 * f] = name[a];
		s.tri[3 * f + 1] = name[upper ? d : a + 1];
		s.tri[3 * f + 2] = name[upper ? a + w : d];
	}
	free(name);
	return s;
}

/* Faces between any three vertices, anywhere. */
static shape soup(uint32_t nv, uint32_t nf)
{
	shape s = room(nv, nf);
	wh_rng g = wh_rng_seed(8);
	for (uint32_t i = 0; i < 3 * nv; i++)
		s.xyz[i] = (float)wh_rng_unit(&g);
	for (uint32_t i = 0; i < 3 * nf; i++)
		s.tri[i] = (uint32_t)(wh_rng_next(&g) % nv);
	return s;
}

/* All faces around vertex 0. */
static shape fan(uint32_t nf)
{
	shape s = room((uint64_t)nf + 1, nf);
	for (uint32_t i = 0; i < nf; i++) {
		const double turn = 6.283185307 * i / nf;
		s.xyz[3 * i + 3] = (float)cos(turn);
		s.xyz[3 * i + 4] = (float)sin(turn);
		s.tri[3 * i + 1] = i + 1;
		s.tri[3 * i + 2] = i + 1 < nf ? i + 2 : 1;
	}
	return s;
}

static shape collapsed_square(uint32_t side)
{
	shape s = square(side, false);
	for (uint64_t i = 0; i < 3 * s.nv; i++)
		s.xyz[i] = 5;
	return s;
}

static shape square_with_an_outlier(uint32_t side)
{
	shape s = square(side, false);
	for (int k = 0; k < 3; k++)
		s.xyz[3 * (s.nv / 2) + (uint64_t)k] = 1e30F;
	return s;
}

/* ---- a shape as the source of a run ---- */

typedef struct fixture {
	testing_env t;
	ply_file file;
	wh_spill spill;
	wh_input input;
	wh_store store;
	wh_ingest_result result;
	wh_cut_list cuts;
} fixture;

static void write_shape(fixture *f, const shape *s)
{
	char elements[300];
	(void)snprintf(elements, sizeof elements,
	               "element vertex %" PRIu64 "\nproperty float x\nproperty float y\n"
	               "property float z\nelement face %" PRIu64
	               "\nproperty list uchar int vertex_indices\n",
	               s->nv, s->nf);
	f->file = ply_begin(WH_PLY_LE);
	ply_header(&f->file, elements);
	assert_int_equal(fwrite(s->xyz, 12, s->nv, f->file.f), s->nv);
	for (uint64_t i = 0; i < s->nf; i++) {
		(void)fputc(3, f->file.f);
		assert_int_equal(fwrite(s->tri + 3 * i, 12, 1, f->file.f), 1);
	}
	ply_end(&f->file);
}

static void open_fixture(fixture *f, const shape *s)
{
	const wh_exec ex = {.workers = 1};
	*f = (fixture){0};
	testing_init(&f->t);
	write_shape(f, s);
	assert_int_equal(wh_spill_open(&f->t.ctx, &f->spill, "/tmp", NULL), WH_OK);
	assert_int_equal(
	    wh_input_open(&f->t.ctx, &ex, &f->spill, f->file.path, WH_FORMAT_ANY, &f->input),
	    WH_OK);
	f->cuts.fd = wh_spill_scratch(&f->t.ctx, &f->spill);
}

static void drop(fixture *f)
{
	wh_spill_close_scratch(&f->spill, f->cuts.fd);
	wh_input_close(&f->t.ctx, &f->spill, &f->input);
	wh_spill_close(&f->t.ctx, &f->spill);
	(void)unlink(f->file.path);
	testing_done(&f->t);
}

static void no_failure(const fixture *f)
{
	if (f->t.ctx.err.code != WH_OK)
		fail_msg("%s", f->t.ctx.err.text);
}

/* In exactly the memory that is promised; nothing but the clusters is left of it. */
static void ingest(fixture *f, int workers, uint64_t window, size_t visits, uint32_t generation)
{
	const wh_exec ex = {.workers = workers};
	wh_progress progress = {.telling = ATOMIC_FLAG_INIT};
	const wh_ingest_params p = {.clusters = CLUSTERS,
	                            .buffer = 3000,
	                            .window = window,
	                            .visits = visits,
	                            .cuts = &f->cuts};
	f->store = (wh_store){.spill = &f->spill, .generation = generation};
	wh_spill_close_scratch(&f->spill, f->cuts.fd);
	f->cuts.fd = wh_spill_scratch(&f->t.ctx, &f->spill);
	const uint64_t held = f->spill.held;
	const size_t used = f->t.mem.used;
	f->t.mem.limit = used + wh_ingest_bytes(&f->input.source, &ex, &p);
	(void)wh_ingest(&f->t.ctx, &ex, &progress, &f->input.source, &p, &f->store, &f->result);
	no_failure(f);
	f->t.mem.limit = 0;
	assert_int_equal(f->t.mem.used, used);
	assert_int_equal(f->cuts.n, f->result.cut_vertices);
	uint64_t files = 24 * f->cuts.n, nf, nv;
	for (uint32_t k = 0; k < CLUSTERS; k++) {
		assert_int_equal(wh_store_counts(&f->t.ctx, &f->store, k, &nf, &nv), WH_OK);
		files += 64 + nf * wh_store_face_bytes(&f->store) +
		         nv * wh_store_vertex_bytes(&f->store);
	}
	assert_int_equal(f->spill.held - held, files);
}

static void recut(fixture *f, int workers, uint32_t clusters)
{
	wh_exec ex = {.workers = workers};
	wh_progress progress = {.telling = ATOMIC_FLAG_INIT};
	wh_store next = {
	    .spill = &f->spill, .generation = f->store.generation + 1, .clusters = clusters};
	size_t buffer, need;
	const size_t used = f->t.mem.used;
	assert_int_equal(wh_recut_fit(&f->t.ctx, &f->store, clusters, 0, &ex, &buffer, &need),
	                 WH_OK);
	assert_int_equal(ex.workers, 1);
	ex.workers = workers;
	assert_int_equal(
	    wh_recut_fit(&f->t.ctx, &f->store, clusters, need * 2, &ex, &buffer, &need), WH_OK);
	f->t.mem.limit = used + need;
	const wh_recut_params p = {.skew = 0.4, .buffer = buffer, .free_all = true};
	uint64_t never;
	(void)wh_recut(&f->t.ctx, &ex, &progress, &f->store, &next, &p, &never);
	no_failure(f);
	f->t.mem.limit = 0;
	wh_round_remove(&f->store);
	f->store = next;
}

/* ---- what must hold ---- */

static uint64_t face_hash(uint64_t a, uint64_t b, uint64_t d)
{
	wh_rng g = wh_rng_seed(a * 1000003 + b);
	return wh_rng_next(&g) * (d + 1);
}

static uint64_t shape_hash(const shape *s, uint64_t *faces)
{
	uint64_t sum = 0;
	*faces = 0;
	for (uint64_t f = 0; f < s->nf; f++) {
		const uint32_t *t = &s->tri[3 * f];
		if (t[0] == t[1] || t[1] == t[2] || t[2] == t[0])
			continue;
		sum += face_hash(t[0], t[1], t[2]);
		++*faces;
	}
	return sum;
}

/* The list has the places of the cut vertices, in file order. */
static void cuts_are_listed(fixture *f, const shape *s, const uint8_t *cut)
{
	uint64_t n = 0;
	for (uint64_t v = 0; v < s->nv; v++) {
		double p[3];
		if (!cut[v])
			continue;
		assert_int_equal(
		    wh_spill_pread(&f->t.ctx, &f->spill, f->cuts.fd, p, sizeof p, n++ * sizeof p),
		    WH_OK);
		for (size_t k = 0; k < 3; k++)
			assert_true((float)p[k] == s->xyz[3 * v + k]);
	}
	assert_int_equal(n, f->cuts.n);
}

/* Every face of the shape is in one cluster; the cut vertices are those in several, and have their
 * places. When not `exact`, vertices that only one cluster uses, but not their home, may be cut
 * too. No cluster has more faces than `most` times its share. */
static void is_the_shape(fixture *f, const shape *s, double most, bool exact)
{
	wh_ctx *c = &f->t.ctx;
	wh_store_workspace scratch = {0};
	wh_patch p = {0};
	uint8_t *users = calloc(s->nv, 1), *cut = calloc(s->nv, 1);
	uint64_t faces, sum = 0, found = 0;
	const uint64_t hash = shape_hash(s, &faces);
	for (uint32_t k = 0; k < f->store.clusters; k++) {
		assert_int_equal(wh_store_load(c, &f->store, k, &scratch, &p), WH_OK);
		found += p.nf;
		assert_true((double)p.nf <= most * (double)faces / f->store.clusters);
		for (uint32_t i = 0; i < p.nf; i++) {
			const uint32_t *t = &p.tri[3 * (size_t)i];
			sum += face_hash(p.gid[t[0]], p.gid[t[1]], p.gid[t[2]]);
		}
		for (uint32_t v = 0; v < p.nv; v++) {
			users[p.gid[v]]++;
			if (p.flag[v] & WH_CUT)
				cut[p.gid[v]]++;
			assert_true((float)p.pos[v].x == s->xyz[3 * p.gid[v]]);
		}
	}
	assert_int_equal(found, faces);
	assert_int_equal(sum, hash);
	for (uint64_t v = 0; v < s->nv; v++)
		if (users[v] > 1 || exact)
			assert_int_equal(cut[v], users[v] > 1 ? users[v] : 0);
	if (!exact)
		cuts_are_listed(f, s, cut);
	free(users);
	free(cut);
	wh_store_workspace_free(c, &scratch);
	wh_patch_free(c, &p);
}

/* A hash of all cluster files. */
static uint64_t files_hash(const fixture *f)
{
	uint64_t sum = 0;
	for (uint32_t k = 0; k < f->store.clusters; k++) {
		char path[512];
		uint8_t header[64];
		(void)snprintf(path, sizeof path, "%s/round%u-%06u", f->spill.dir,
		               f->store.generation, k);
		FILE *in = fopen(path, "rb");
		assert_non_null(in);
		assert_int_equal(fread(header, sizeof header, 1, in), 1);
		for (size_t i = 0; i < sizeof header; i++) /* it has a checksum of the rest */
			sum = sum * 0x9e3779b97f4a7c15 + header[i];
		(void)fclose(in);
	}
	return sum;
}

/* Cuts the shape in plenty of memory and in little, and then anew. */
static void cut_every_way(const shape *s, double most)
{
	static const struct {
		int workers;
		uint64_t window;
		size_t visits;
	} way[] = {{1, 0, 1000000}, {2, 0, 0}, {3, 7001, 0}, {1, 50000, 1000000}};
	fixture f;
	uint64_t first = 0;
	open_fixture(&f, s);
	for (size_t i = 0; i < sizeof way / sizeof *way; i++) {
		ingest(&f, way[i].workers, way[i].window, way[i].visits, (uint32_t)i);
		if (i == 0) {
			first = files_hash(&f);
			is_the_shape(&f, s, most, false);
		}
		assert_int_equal(files_hash(&f), first);
		const bool windows = way[i].window && way[i].window < s->nv;
		assert_int_equal(f.result.windows,
		                 windows ? (s->nv + way[i].window - 1) / way[i].window : 1);
		if (i + 1 < sizeof way / sizeof *way)
			wh_round_remove(&f.store);
	}
	recut(&f, 2, CLUSTERS - 3);
	is_the_shape(&f, s, most, true);
	recut(&f, 1, CLUSTERS);
	is_the_shape(&f, s, most, true);
	drop(&f);
}

static void rows_and_shuffled_faces_are_cut_alike_in_any_memory(void **state)
{
	(void)state;
	for (int shuffled = 0; shuffled <= 1; shuffled++) {
		shape s = square(230, shuffled);
		cut_every_way(&s, 1.35);
		drop_shape(&s);
	}
}

static void a_soup_stays_in_its_memory(void **state)
{
	(void)state;
	shape s = soup(80000, 160000);
	cut_every_way(&s, 4); /* of three different cells a face takes the least */
	drop_shape(&s);
}

static void many_faces_of_few_vertices_stay_in_their_memory(void **state)
{
	(void)state;
	shape s = soup(500, 100000);
	cut_every_way(&s, 4);
	drop_shape(&s);
}

static void all_faces_around_one_vertex_are_shared_out(void **state)
{
	(void)state;
	shape s = fan(100000);
	cut_every_way(&s, 1.35);
	drop_shape(&s);
}

static void coincident_vertices_are_shared_out(void **state)
{
	(void)state;
	shape s = collapsed_square(230);
	cut_every_way(&s, 1.35);
	drop_shape(&s);
}

static void an_outlier_changes_nothing_much(void **state)
{
	(void)state;
	shape s = square_with_an_outlier(230);
	cut_every_way(&s, 1.35);
	drop_shape(&s);
}

/* Faces in the order of their vertices are read little more than twice besides the last time; those
 * in no order once for each window. */
static void windows_skip_faces_that_are_elsewhere(void **state)
{
	(void)state;
	for (int shuffled = 0; shuffled <= 1; shuffled++) {
		fixture f;
		shape s = square(400, shuffled);
		open_fixture(&f, &s);
		ingest(&f, 2, s.nv / 8 + 1, 0, 0);
		assert_int_equal(f.result.windows, 8);
		if (shuffled)
			assert_int_equal(f.result.face_reads, 9 * s.nf);
		else
			assert_true(f.result.face_reads < 5 * s.nf);
		drop(&f);
		drop_shape(&s);
	}
}

/* What is chosen for a budget fits into it, down to the least, and below it is refused. */
static void any_budget_is_kept_to(void **state)
{
	(void)state;
	fixture f;
	shape s = square(230, true);
	open_fixture(&f, &s);
	wh_source big = f.input.source;
	big.nv = 3000000000;
	big.nf = 6000000000;
	wh_ingest_params p = {.clusters = 20000};
	wh_exec ex = {.workers = 4};
	const size_t least = wh_ingest_fit(&big, 0, &ex, &p);
	assert_int_equal(ex.workers, 1);
	for (size_t budget = least; budget < (size_t)10 << 30; budget = budget * 5 / 4) {
		ex.workers = 4;
		assert_true(wh_ingest_fit(&big, budget, &ex, &p) <= budget);
		assert_int_equal(p.window == 0, budget > 2 * big.nv + (200 << 20));
		assert_true(ex.workers == 4 || budget < 2 * least);
	}
	ex.workers = 4;
	assert_true(wh_ingest_fit(&big, least - 1, &ex, &p) > least - 1);
	drop(&f);
	drop_shape(&s);
}

/* ---- the parts ---- */

static int by_number(const void *a, const void *b)
{
	const uint64_t x = *(const uint64_t *)a, y = *(const uint64_t *)b;
	return (x > y) - (x < y);
}

/* Adds n visits, most of them to few vertices when `heavy`, and takes them back. */
static void visits_come_back(size_t n, uint64_t vertices, size_t most, bool heavy)
{
	testing_env t;
	wh_spill spill;
	wh_visits v;
	testing_init(&t);
	uint64_t *in = malloc((n + 1) * sizeof *in);
	wh_rng g = wh_rng_seed(n);
	for (size_t i = 0; i < n; i++) {
		const uint64_t vertex = wh_rng_next(&g) % (heavy && i % 8 ? 3 : vertices);
		in[i] = wh_visit(vertex, (uint32_t)(wh_rng_next(&g) % 1000));
	}
	assert_int_equal(wh_spill_open(&t.ctx, &spill, "/tmp", NULL), WH_OK);
	t.mem.limit = t.mem.used + wh_visits_bytes(most) + 4096; /* blocks are whole pages */
	assert_int_equal(wh_visits_open(&t.ctx, &v, &spill, vertices, most), WH_OK);
	for (size_t i = 0; i < n; i += 100)
		assert_int_equal(wh_visits_add(&t.ctx, &v, in + i, n - i < 100 ? n - i : 100),
		                 WH_OK);
	assert_int_equal(wh_visits_seal(&t.ctx, &v), WH_OK);
	qsort(in, n, sizeof *in, by_number);
	size_t at = 0;
	for (uint64_t first = 0; first < vertices; first = v.end) {
		assert_int_equal(wh_visits_take(&t.ctx, &v, first), WH_OK);
		assert_true(v.end > first && v.end <= vertices);
		for (size_t i = 0; i < v.n; i++) {
			assert_int_equal(v.item[i], in[at]);
			assert_true(wh_visit_vertex(v.item[i]) < v.end);
			while (at < n && in[at] == v.item[i])
				at++;
		}
	}
	assert_int_equal(at, n);
	wh_visits_close(&t.ctx, &v);
	assert_int_equal(spill.held, 0);
	wh_spill_close(&t.ctx, &spill);
	free(in);
	testing_done(&t);
}

static void visits_come_back_in_order_and_once(void **state)
{
	(void)state;
	const size_t least = wh_visits_least(1000);
	for (int heavy = 0; heavy <= 1; heavy++) {
		visits_come_back(0, 10, least, heavy);
		visits_come_back(1, 1, least, heavy);
		visits_come_back(least, 5, least, heavy);
		visits_come_back(30000, 20, least, heavy);
		visits_come_back(30000, 1000000, least, heavy);
		visits_come_back(200000, (uint64_t)1 << 48, least, heavy);
		visits_come_back(200000, 300, 70000, heavy);
	}
}

static wh_code ingest_with_failure(fixture *f, long fail_after, uint64_t window)
{
	const wh_exec ex = {.workers = 1};
	wh_progress progress = {.telling = ATOMIC_FLAG_INIT};
	const wh_ingest_params p = {.clusters = 3, .buffer = 3000, .window = window};
	f->store = (wh_store){.spill = &f->spill};
	f->t.mem.fail_after = fail_after;
	wh_code code =
	    wh_ingest(&f->t.ctx, &ex, &progress, &f->input.source, &p, &f->store, &f->result);
	if (code == WH_OK) {
		wh_store next = {.spill = &f->spill, .generation = 1, .clusters = 2};
		const wh_recut_params again = {.skew = 0.4, .buffer = 3000, .free_all = true};
		uint64_t never;
		code = wh_recut(&f->t.ctx, &ex, &progress, &f->store, &next, &again, &never);
	}
	f->t.mem.fail_after = 0;
	f->t.ctx.err = (wh_error){0};
	return code;
}

static void every_failed_allocation_is_survived(void **state)
{
	(void)state;
	for (uint64_t window = 0; window <= 20; window += 20) {
		fixture f;
		shape s = square(8, true);
		open_fixture(&f, &s);
		const size_t used = f.t.mem.used;
		long fails = 0;
		while (ingest_with_failure(&f, fails + 1, window) != WH_OK) {
			assert_int_equal(f.t.mem.used, used);
			assert_true(++fails < 200);
		}
		assert_true(fails > 30);
		drop(&f);
		drop_shape(&s);
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	    cmocka_unit_test(rows_and_shuffled_faces_are_cut_alike_in_any_memory),
	    cmocka_unit_test(a_soup_stays_in_its_memory),
	    cmocka_unit_test(many_faces_of_few_vertices_stay_in_their_memory),
	    cmocka_unit_test(all_faces_around_one_vertex_are_shared_out),
	    cmocka_unit_test(coincident_vertices_are_shared_out),
	    cmocka_unit_test(an_outlier_changes_nothing_much),
	    cmocka_unit_test(windows_skip_faces_that_are_elsewhere),
	    cmocka_unit_test(any_budget_is_kept_to),
	    cmocka_unit_test(visits_come_back_in_order_and_once),
	    cmocka_unit_test(every_failed_allocation_is_survived),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
