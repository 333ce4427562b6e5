/* Cluster files: what is saved is loaded, in any order of ids, and damage is found. */
#define _POSIX_C_SOURCE 200809L
#include "testing.h"

#include "base/rng.h"
#include "pipeline/store.h"

#include <dirent.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

enum { HEADER = 64, CLUSTER = 3 };

typedef struct fixture {
	testing_env t;
	wh_spill spill;
	wh_store store;
} fixture;

static void make(fixture *f, uint32_t id_bytes, uint32_t coord_bytes, bool local)
{
	*f = (fixture){0};
	testing_init(&f->t);
	assert_int_equal(wh_spill_open(&f->t.ctx, &f->spill, "/tmp", NULL), WH_OK);
	f->store = (wh_store){.spill = &f->spill,
	                      .generation = 2,
	                      .clusters = 5,
	                      .id_bytes = id_bytes,
	                      .coord_bytes = coord_bytes,
	                      .vertex_payload = 4,
	                      .local_corners = local};
}

static void drop(fixture *f)
{
	wh_spill_close(&f->t.ctx, &f->spill);
	testing_done(&f->t);
}

/* A fan of n faces around vertex 0; ids ascend with gaps, every third vertex is a cut one. */
static void fan(wh_ctx *c, wh_patch *p, uint32_t n, uint64_t first_gid)
{
	wh_rng g = wh_rng_seed(n);
	assert_int_equal(wh_patch_reset(c, p, n + 2, n), WH_OK);
	for (uint32_t v = 0; v < p->nv; v++) {
		const uint64_t r = wh_rng_next(&g); /* eighths, which a float holds exactly */
		p->pos[v] = wh_v3((double)(r >> 44) / 8, (double)(r & 0xfffff) / -8, -0.0);
		p->gid[v] = first_gid + 5 * (uint64_t)v;
		p->flag[v] = v % 3 ? 0 : v % 2 ? WH_CUT : WH_CUT | WH_NEVER;
		p->err[v] = (float)v / 7;
	}
	for (uint32_t f = 0; f < n; f++) {
		const uint32_t t[3] = {0, f + 1, f + 2};
		memcpy(&p->tri[3 * (size_t)f], t, sizeof t);
	}
}

static void same_patch(const wh_patch *a, const wh_patch *b)
{
	assert_int_equal(a->nv, b->nv);
	assert_int_equal(a->nf, b->nf);
	assert_memory_equal(a->pos, b->pos, a->nv * sizeof *a->pos);
	assert_memory_equal(a->gid, b->gid, a->nv * sizeof *a->gid);
	assert_memory_equal(a->flag, b->flag, a->nv * sizeof *a->flag);
	assert_memory_equal(a->err, b->err, a->nv * sizeof *a->err);
	assert_memory_equal(a->tri, b->tri, 3 * a->nf * sizeof *a->tri);
}

static wh_code load(fixture *f, wh_patch *p, uint64_t *unreferenced)
{
	wh_store_workspace scratch = {0};
	const wh_code code = wh_store_load(&f->t.ctx, &f->store, CLUSTER, &scratch, p);
	if (unreferenced)
		*unreferenced = scratch.unreferenced;
	wh_store_workspace_free(&f->t.ctx, &scratch);
	return code;
}

static void a_saved_patch_is_loaded_again(void **state)
{
	(void)state;
	for (uint32_t id_bytes = 4; id_bytes <= 8; id_bytes += 4)
		for (uint32_t coord_bytes = 4; coord_bytes <= 8; coord_bytes += 4) {
			fixture f;
			wh_patch a = {0}, b = {0};
			make(&f, id_bytes, coord_bytes, true);
			fan(&f.t.ctx, &a, 1000, id_bytes == 8 ? (uint64_t)1 << 40 : 0x3fff0000);
			assert_int_equal(wh_store_save(&f.t.ctx, &f.store, CLUSTER, &a), WH_OK);
			uint64_t nf, nv, unreferenced;
			assert_int_equal(wh_store_counts(&f.t.ctx, &f.store, CLUSTER, &nf, &nv),
			                 WH_OK);
			assert_true(nf == a.nf && nv == a.nv);
			assert_int_equal(load(&f, &b, &unreferenced), WH_OK);
			same_patch(&a, &b);
			assert_int_equal(unreferenced, 0);
			wh_patch_free(&f.t.ctx, &a);
			wh_patch_free(&f.t.ctx, &b);
			drop(&f);
		}
}

static void doubles_keep_their_last_bit(void **state)
{
	(void)state;
	fixture f;
	wh_patch a = {0}, b = {0};
	make(&f, 4, 8, true);
	fan(&f.t.ctx, &a, 10, 0);
	for (uint32_t v = 0; v < a.nv; v++)
		a.pos[v] = wh_v3(1.0 / (v + 3), 4512345.1 + v, -1e-300);
	assert_int_equal(wh_store_save(&f.t.ctx, &f.store, CLUSTER, &a), WH_OK);
	assert_int_equal(load(&f, &b, NULL), WH_OK);
	same_patch(&a, &b);
	wh_patch_free(&f.t.ctx, &a);
	wh_patch_free(&f.t.ctx, &b);
	drop(&f);
}

static void an_empty_cluster_is_empty_again(void **state)
{
	(void)state;
	for (int local = 0; local <= 1; local++) {
		fixture f;
		wh_patch a = {0}, b = {0};
		make(&f, 4, 4, local);
		assert_int_equal(wh_store_save(&f.t.ctx, &f.store, CLUSTER, &a), WH_OK);
		assert_int_equal(load(&f, &b, NULL), WH_OK);
		assert_true(b.nv == 0 && b.nf == 0);
		wh_patch_free(&f.t.ctx, &b);
		drop(&f);
	}
}

/* ---- files as ingest writes them: global ids, any order ---- */

static wh_code append_face(fixture *f, wh_store_writer *w, const uint64_t t[3])
{
	uint8_t record[64];
	const uint8_t *end = wh_store_put_face(&f->store, record, t);
	assert_int_equal(end - record, wh_store_face_bytes(&f->store));
	w->faces++;
	return wh_store_append(&f->t.ctx, &f->store, CLUSTER, w, record, (size_t)(end - record));
}

static wh_code append_vertex(fixture *f, wh_store_writer *w, const wh_patch *p, uint32_t v)
{
	uint8_t record[64];
	const uint8_t *end =
	    wh_store_put_vertex(&f->store, record, p->gid[v], p->flag[v], p->pos[v], p->err[v]);
	assert_int_equal(end - record, wh_store_vertex_bytes(&f->store));
	w->vertices++;
	return wh_store_append(&f->t.ctx, &f->store, CLUSTER, w, record, (size_t)(end - record));
}

/* Writes p with global corners and its vertices in the given order, through a small buffer. */
static void write_global(fixture *f, const wh_patch *p, const uint32_t *order, uint32_t n)
{
	wh_store_writer w;
	assert_int_equal(wh_store_begin(&f->t.ctx, &f->store, CLUSTER, &w, 37), WH_OK);
	for (uint32_t i = 0; i < p->nf; i++) {
		const uint32_t *t = &p->tri[3 * (size_t)i];
		const uint64_t g[3] = {p->gid[t[0]], p->gid[t[1]], p->gid[t[2]]};
		assert_int_equal(append_face(f, &w, g), WH_OK);
	}
	for (uint32_t i = 0; i < n; i++)
		assert_int_equal(append_vertex(f, &w, p, order[i]), WH_OK);
	assert_int_equal(wh_store_commit(&f->t.ctx, &f->store, CLUSTER, &w), WH_OK);
}

static void unsorted_and_repeated_vertices_are_put_in_order(void **state)
{
	(void)state;
	enum { N = 200, NV = N + 2 };
	for (uint32_t id_bytes = 4; id_bytes <= 8; id_bytes += 4) {
		fixture f;
		wh_patch a = {0}, b = {0};
		uint32_t order[2 * NV];
		make(&f, id_bytes, 4, false);
		fan(&f.t.ctx, &a, N, id_bytes == 8 ? ((uint64_t)1 << 61) + 1 : 77);
		wh_rng g = wh_rng_seed(5);
		for (uint32_t i = 0; i < 2 * NV; i++)
			order[i] = i % NV;
		for (uint32_t i = 2 * NV - 1; i > 0; i--) {
			const uint32_t j = (uint32_t)(wh_rng_next(&g) % (i + 1)), t = order[i];
			order[i] = order[j];
			order[j] = t;
		}
		write_global(&f, &a, order, 2 * NV);
		assert_int_equal(load(&f, &b, NULL), WH_OK);
		same_patch(&a, &b);
		wh_patch_free(&f.t.ctx, &a);
		wh_patch_free(&f.t.ctx, &b);
		drop(&f);
	}
}

/* Vertices that no face uses go; those not cut are counted, as the one file that has them. */
static void unused_vertices_are_dropped_and_counted(void **state)
{
	(void)state;
	enum { N = 9, NV = N + 2 };
	fixture f;
	wh_patch a = {0}, b = {0};
	uint32_t order[NV];
	make(&f, 4, 4, false);
	fan(&f.t.ctx, &a, N, 1000);
	for (uint32_t i = 0; i < NV; i++)
		order[i] = i;
	a.nf = N - 4; /* the last four vertices, 7 to 10, are left without faces; 9 is cut */
	write_global(&f, &a, order, NV);
	uint64_t unreferenced;
	assert_int_equal(load(&f, &b, &unreferenced), WH_OK);
	assert_int_equal(unreferenced, 3);
	a.nv = NV - 4;
	same_patch(&a, &b);
	wh_patch_free(&f.t.ctx, &a);
	wh_patch_free(&f.t.ctx, &b);
	drop(&f);
}

static void a_corner_without_vertex_is_damage(void **state)
{
	(void)state;
	enum { N = 5, NV = N + 2 };
	for (uint32_t missing = 0; missing < NV; missing++) {
		fixture f;
		wh_patch a = {0}, b = {0};
		uint32_t order[NV], n = 0;
		make(&f, 4, 4, false);
		fan(&f.t.ctx, &a, N, 0);
		for (uint32_t i = 0; i < NV; i++)
			if (i != missing)
				order[n++] = i;
		write_global(&f, &a, order, n);
		assert_int_equal(load(&f, &b, NULL), WH_E_RUN);
		assert_non_null(strstr(f.t.ctx.err.text, "damaged"));
		wh_patch_free(&f.t.ctx, &a);
		wh_patch_free(&f.t.ctx, &b);
		drop(&f);
	}
}

/* ---- damage ---- */

/* The one file of the spill folder, open for reading and writing. */
static int open_only_file(const fixture *f)
{
	char path[512] = "";
	DIR *d = opendir(f->spill.dir);
	assert_non_null(d);
	for (const struct dirent *e = readdir(d); e; e = readdir(d))
		if (e->d_name[0] != '.') {
			assert_string_equal(path, "");
			(void)snprintf(path, sizeof path, "%s/%s", f->spill.dir, e->d_name);
		}
	(void)closedir(d);
	const int fd = open(path, O_RDWR);
	assert_true(fd >= 0);
	return fd;
}

/* Loads in a context of its own, which forgets its failure. Memory is bounded, so that a count
 * that has grown cannot take the machine's. */
static wh_code load_damaged(fixture *f)
{
	wh_patch p = {0};
	f->t.mem.limit = (size_t)1 << 28;
	const wh_code code = load(f, &p, NULL);
	wh_patch_free(&f->t.ctx, &p);
	f->t.ctx.err.code = WH_OK;
	return code;
}

static void any_flipped_bit_is_found(void **state)
{
	(void)state;
	for (int local = 0; local <= 1; local++) {
		fixture f;
		wh_patch a = {0};
		make(&f, 8, 4, local);
		fan(&f.t.ctx, &a, 3, 12);
		assert_int_equal(wh_store_save(&f.t.ctx, &f.store, CLUSTER, &a), WH_OK);
		const int fd = open_only_file(&f);
		struct stat st;
		assert_int_equal(fstat(fd, &st), 0);
		for (off_t at = 0; at < 8 * st.st_size; at++) {
			uint8_t byte;
			assert_int_equal(pread(fd, &byte, 1, at / 8), 1);
			byte ^= (uint8_t)(1 << at % 8);
			assert_int_equal(pwrite(fd, &byte, 1, at / 8), 1);
			if (load_damaged(&f) == WH_OK)
				fail_msg("bit %d of byte %d", (int)(at % 8), (int)(at / 8));
			byte ^= (uint8_t)(1 << at % 8);
			assert_int_equal(pwrite(fd, &byte, 1, at / 8), 1);
		}
		(void)close(fd);
		wh_patch_free(&f.t.ctx, &a);
		drop(&f);
	}
}

static void a_truncated_file_is_found(void **state)
{
	(void)state;
	fixture f;
	wh_patch a = {0};
	make(&f, 4, 4, true);
	fan(&f.t.ctx, &a, 3, 0);
	assert_int_equal(wh_store_save(&f.t.ctx, &f.store, CLUSTER, &a), WH_OK);
	const int fd = open_only_file(&f);
	struct stat st;
	assert_int_equal(fstat(fd, &st), 0);
	assert_int_equal(st.st_size, HEADER + 3 * 12 + 5 * 20);
	for (off_t size = st.st_size; size-- > 0;) {
		assert_int_equal(ftruncate(fd, size), 0);
		assert_int_equal(load_damaged(&f), WH_E_RUN);
	}
	(void)close(fd);
	wh_patch_free(&f.t.ctx, &a);
	drop(&f);
}

static void a_missing_file_is_named(void **state)
{
	(void)state;
	fixture f;
	wh_patch p = {0};
	make(&f, 4, 4, true);
	assert_int_equal(load(&f, &p, NULL), WH_E_RUN);
	assert_non_null(strstr(f.t.ctx.err.text, f.spill.dir));
	wh_patch_free(&f.t.ctx, &p);
	drop(&f);
}

/* A file begun and dropped does not appear under its name. */
static void only_committed_files_appear(void **state)
{
	(void)state;
	fixture f;
	wh_store_writer w;
	make(&f, 4, 4, true);
	assert_int_equal(wh_store_begin(&f.t.ctx, &f.store, CLUSTER, &w, 100), WH_OK);
	assert_int_equal(wh_store_append(&f.t.ctx, &f.store, CLUSTER, &w, "abcd", 4), WH_OK);
	wh_store_drop(&f.t.ctx, &w);
	uint64_t nf, nv;
	assert_int_equal(wh_store_counts(&f.t.ctx, &f.store, CLUSTER, &nf, &nv), WH_E_RUN);
	drop(&f);
}

static void removing_takes_the_bytes_off_the_account(void **state)
{
	(void)state;
	fixture f;
	wh_patch a = {0};
	make(&f, 4, 4, true);
	fan(&f.t.ctx, &a, 100, 0);
	assert_int_equal(wh_store_save(&f.t.ctx, &f.store, CLUSTER, &a), WH_OK);
	assert_int_equal(f.spill.held, HEADER + 100 * 12 + 102 * 20);
	wh_store_remove(&f.store, CLUSTER);
	assert_int_equal(f.spill.held, 0);
	wh_patch_free(&f.t.ctx, &a);
	drop(&f);
}

/* ---- memory ---- */

static wh_code save_and_load(long fail_after)
{
	enum { N = 300 };
	fixture f;
	wh_patch a = {0}, b = {0};
	make(&f, 4, 4, false);
	fan(&f.t.ctx, &a, N, 0);
	for (uint32_t v = 0; v < a.nv / 2; v++) { /* unsorted: the load has to sort */
		const uint64_t g = a.gid[v];
		a.gid[v] = a.gid[a.nv - 1 - v];
		a.gid[a.nv - 1 - v] = g;
	}
	for (size_t i = 0; i < 3 * N; i++)
		a.tri[i] = (uint32_t)a.gid[a.tri[i]];
	f.t.mem.fail_after = fail_after;
	wh_code code = wh_store_save(&f.t.ctx, &f.store, CLUSTER, &a);
	if (code == WH_OK)
		code = load(&f, &b, NULL);
	wh_patch_free(&f.t.ctx, &a);
	wh_patch_free(&f.t.ctx, &b);
	drop(&f);
	return code;
}

static void every_failed_allocation_is_survived(void **state)
{
	(void)state;
	long fails = 0;
	while (save_and_load(fails + 1) != WH_OK)
		assert_true(++fails < 100);
	assert_true(fails > 8);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	    cmocka_unit_test(a_saved_patch_is_loaded_again),
	    cmocka_unit_test(doubles_keep_their_last_bit),
	    cmocka_unit_test(an_empty_cluster_is_empty_again),
	    cmocka_unit_test(unsorted_and_repeated_vertices_are_put_in_order),
	    cmocka_unit_test(unused_vertices_are_dropped_and_counted),
	    cmocka_unit_test(a_corner_without_vertex_is_damage),
	    cmocka_unit_test(any_flipped_bit_is_found),
	    cmocka_unit_test(a_truncated_file_is_found),
	    cmocka_unit_test(a_missing_file_is_named),
	    cmocka_unit_test(only_committed_files_appear),
	    cmocka_unit_test(removing_takes_the_bytes_off_the_account),
	    cmocka_unit_test(every_failed_allocation_is_survived),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
