/*
 * read_mesh: how long reading takes.
 *
 * usage: read_mesh FILE THREADS ROUNDS [rply]
 *
 * Reads a mesh of any format as whittle does, all positions and triangles once, in chunks and
 * buffers that are used again; what has to be rewritten or unpacked first is. Several times, each
 * time's seconds and the counts are printed as JSON. With rply: by calls of that library that keep
 * nothing but a sum, where the build has found it; else the status is 77.
 */
#define _POSIX_C_SOURCE 200809L
#include "base/chunks.h"
#include "base/timer.h"
#include "pipeline/normalise.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum {
	SKIPPED = 77,
	CHUNK = 32 * 1024 /* vertices or triangles of one job */
};

typedef struct reading {
	const char *path;
	wh_exec exec;
	uint64_t nv, nf;
} reading;

/* ---- by whittle --------------------------------------------------------------------------- */

typedef struct body {
	const wh_source *source;
	struct hand {
		void *raw;
		double *xyz;
		uint64_t *ids;
	} * hand; /* of each worker */
} body;

static wh_code vertex_job(wh_ctx *c, void *arg, int64_t index, int worker)
{
	const body *b = arg;
	const struct hand *h = &b->hand[worker];
	return wh_source_vertices(c, b->source, (uint64_t)index * CHUNK,
	                          wh_chunk_items(b->source->nv, index, CHUNK), h->xyz, h->raw);
}

static wh_code face_job(wh_ctx *c, void *arg, int64_t index, int worker)
{
	const body *b = arg;
	const struct hand *h = &b->hand[worker];
	return wh_source_triangles(c, b->source, (uint64_t)index * CHUNK,
	                           wh_chunk_items(b->source->nf, index, CHUNK), h->ids, h->raw);
}

static void hands_make(wh_ctx *c, body *b, int workers)
{
	const size_t v = wh_source_vertex_bytes(b->source, CHUNK);
	const size_t f = wh_source_triangle_bytes(b->source, CHUNK);
	b->hand = wh_calloc(c, (size_t)workers, sizeof *b->hand);
	for (int i = 0; b->hand && i < workers; i++) {
		b->hand[i].raw = wh_alloc(c, v > f ? v : f, 1);
		b->hand[i].xyz = wh_alloc(c, CHUNK, 3 * sizeof(double));
		b->hand[i].ids = wh_alloc(c, CHUNK, 3 * sizeof(uint64_t));
	}
}

static void hands_free(wh_ctx *c, body *b, int workers)
{
	for (int i = 0; b->hand && i < workers; i++) {
		wh_free(c, b->hand[i].raw);
		wh_free(c, b->hand[i].xyz);
		wh_free(c, b->hand[i].ids);
	}
	wh_free(c, b->hand);
}

static wh_code go_through(wh_ctx *c, const wh_exec *ex, const wh_source *s)
{
	body b = {.source = s};
	hands_make(c, &b, ex->workers);
	wh_code code = c->err.code;
	if (code == WH_OK)
		code = wh_exec_for(c, ex, wh_chunks(s->nv, CHUNK), vertex_job, &b);
	if (code == WH_OK)
		code = wh_exec_for(c, ex, wh_chunks(s->nf, CHUNK), face_job, &b);
	hands_free(c, &b, ex->workers);
	return code;
}

static int read_once(reading *r)
{
	wh_mem account = {0};
	wh_ctx c = {.mem = &account};
	wh_spill spill = {0};
	wh_input in;
	wh_code code = wh_spill_open(&c, &spill, NULL, "/tmp");
	if (code == WH_OK)
		code = wh_input_open(&c, &r->exec, &spill, r->path, WH_FORMAT_ANY, &in);
	if (code == WH_OK) {
		code = go_through(&c, &r->exec, &in.source);
		r->nv = in.source.nv;
		r->nf = in.source.nf;
		wh_input_close(&c, &spill, &in);
	}
	if (code != WH_OK)
		(void)fprintf(stderr, "read_mesh: %s\n", c.err.text);
	wh_spill_close(&c, &spill);
	return (int)code;
}

/* ---- by rply ------------------------------------------------------------------------------ */

#ifdef WH_HAVE_RPLY
#include <rply.h>

/* Values are added up: reading with no use for them would be too easy. */
static int take_value(p_ply_argument a)
{
	void *sum;
	(void)ply_get_argument_user_data(a, &sum, NULL);
	*(double *)sum += ply_get_argument_value(a);
	return 1;
}

static int read_body(p_ply ply, reading *r)
{
	double sum = 0;
	r->nv = (uint64_t)ply_set_read_cb(ply, "vertex", "x", take_value, &sum, 0);
	(void)ply_set_read_cb(ply, "vertex", "y", take_value, &sum, 0);
	(void)ply_set_read_cb(ply, "vertex", "z", take_value, &sum, 0);
	r->nf = (uint64_t)ply_set_read_cb(ply, "face", "vertex_indices", take_value, &sum, 0);
	return ply_read(ply) && sum > 0 ? 0 : 1;
}

static int read_by_rply(reading *r)
{
	p_ply ply = ply_open(r->path, NULL, 0, NULL);
	if (!ply)
		return 1;
	const int status = ply_read_header(ply) ? read_body(ply, r) : 1;
	(void)ply_close(ply);
	return status;
}
#else
static int read_by_rply(reading *r)
{
	(void)r;
	(void)fprintf(stderr, "read_mesh: this build has found no rply\n");
	return SKIPPED;
}
#endif

int main(int argc, char **argv)
{
	if (argc < 4 || argc > 5 || (argc == 5 && strcmp(argv[4], "rply") != 0)) {
		(void)fprintf(stderr, "usage: read_mesh FILE THREADS ROUNDS [rply]\n");
		return WH_E_USAGE;
	}
	reading r = {.path = argv[1], .exec = {.workers = wh_exec_threads(atoi(argv[2]))}};
	const int rounds = atoi(argv[3]);
	(void)printf("{\"seconds\": [");
	for (int i = 0; i < rounds; i++) {
		const double start = wh_seconds();
		const int status = argc == 5 ? read_by_rply(&r) : read_once(&r);
		if (status != 0)
			return status;
		(void)printf("%s%.6f", i ? ", " : "", wh_seconds() - start);
	}
	(void)printf("], \"vertices\": %" PRIu64 ", \"faces\": %" PRIu64 "}\n", r.nv, r.nf);
	return 0;
}
