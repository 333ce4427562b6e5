/*
 * reduce_files: a folder with an input, a place for the output and one for temporary files, and
 * wh_reduce on them; small clusters, so that several rounds and recuts run on meshes of some ten
 * thousand faces.
 */
#ifndef WH_TESTS_REDUCE_FILES_H
#define WH_TESTS_REDUCE_FILES_H

#include "testing.h"

#include "algo/synth.h"
#include "io/outfile.h"
#include "pipeline/normalise.h"
#include "whittle.h"

#include <dirent.h>
#include <ftw.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

typedef struct fixture {
	testing_env t;
	char root[40], in[64], temp[64], out_dir[64], out[80];
	wh_reduce_params params;
	wh_reduce_report report;
} fixture;

static inline void open_fixture(fixture *f)
{
	*f = (fixture){.root = "/tmp/whittle-reduce-XXXXXX"};
	testing_init(&f->t);
	assert_non_null(mkdtemp(f->root));
	(void)snprintf(f->in, sizeof f->in, "%s/in.ply", f->root);
	(void)snprintf(f->temp, sizeof f->temp, "%s/temp", f->root);
	(void)snprintf(f->out_dir, sizeof f->out_dir, "%s/out", f->root);
	(void)snprintf(f->out, sizeof f->out, "%s/out.ply", f->out_dir);
	assert_int_equal(mkdir(f->temp, 0700), 0);
	assert_int_equal(mkdir(f->out_dir, 0700), 0);
	f->params = wh_reduce_defaults();
	f->params.input = f->in;
	f->params.output = f->out;
	f->params.temp_dir = f->temp;
	f->params.force = true;
	f->params.threads = 2;
	f->params.memory = (size_t)256 << 20;
	f->params.cluster_faces = 4000;
	f->params.micro_faces = 1000;
	f->params.final_faces = 4000;
}

/* The files hold the same bytes. */
static inline void same_bytes(const char *a, const char *b)
{
	FILE *f = fopen(a, "rb"), *g = fopen(b, "rb");
	assert_non_null(f);
	assert_non_null(g);
	int x, y;
	do {
		x = fgetc(f);
		y = fgetc(g);
		assert_int_equal(x, y);
	} while (x != EOF);
	(void)fclose(f);
	(void)fclose(g);
}

/* The mesh of a file; the caller frees it. */
static inline wh_mesh load_mesh(fixture *f, const char *path)
{
	wh_mesh m;
	wh_spill spill = {0};
	const wh_exec ex = {.workers = 1};
	assert_int_equal(wh_spill_open(&f->t.ctx, &spill, f->temp, NULL), WH_OK);
	assert_int_equal(wh_load_mesh(&f->t.ctx, &ex, &spill, path, WH_FORMAT_ANY, &m, NULL, NULL),
	                 WH_OK);
	wh_spill_close(&f->t.ctx, &spill);
	return m;
}

static inline int remove_one(const char *path, const struct stat *st, int kind, struct FTW *at)
{
	(void)st, (void)kind, (void)at;
	return remove(path);
}

static inline void drop(fixture *f)
{
	assert_int_equal(nftw(f->root, remove_one, 8, FTW_DEPTH | FTW_PHYS), 0);
	testing_done(&f->t);
}

static inline int entries(const char *folder)
{
	int n = 0;
	DIR *d = opendir(folder);
	assert_non_null(d);
	for (const struct dirent *e = readdir(d); e; e = readdir(d))
		n += strcmp(e->d_name, ".") != 0 && strcmp(e->d_name, "..") != 0;
	(void)closedir(d);
	return n;
}

static inline wh_synth_params surface(wh_synth_kind kind, uint64_t faces)
{
	wh_synth_params p = wh_synth_defaults();
	p.kind = kind;
	p.faces = faces;
	p.seed = 3;
	return p;
}

static inline void write_input(fixture *f, const wh_synth_params *p)
{
	const wh_exec ex = {.workers = 1};
	wh_ctx *c = &f->t.ctx;
	wh_synth *s;
	wh_outfile *o;
	assert_int_equal(wh_synth_open(c, &s, p), WH_OK);
	assert_int_equal(wh_outfile_open(c, &o, f->in, true), WH_OK);
	assert_int_equal(wh_synth_write(c, &ex, s, o), WH_OK);
	assert_int_equal(wh_outfile_commit(c, &o), WH_OK);
	wh_synth_close(c, &s);
}

static inline void make(fixture *f, const wh_synth_params *p)
{
	open_fixture(f);
	write_input(f, p);
}

static inline wh_code reduce(fixture *f)
{
	return wh_reduce(&f->t.ctx, &f->params, &f->report);
}

static inline void nothing_is_left(const fixture *f)
{
	assert_int_equal(entries(f->temp), 0);
	assert_int_equal(entries(f->out_dir), 0);
}

#endif
