/*
 * crop: the faces of a mesh whose three corners lie in a box, as a mesh of their own.
 *
 * usage: crop IN.ply OUT.ply X0 Y0 Z0 X1 Y1 Z1
 *
 * For comparing regions of meshes too large to compare whole. Streams; four bytes a vertex and,
 * inside the box, what is written.
 */
#include "io/outfile.h"
#include "mesh/mesh.h"
#include "pipeline/normalise.h"

#include <stdio.h>
#include <stdlib.h>

enum { CHUNK = 65536 };

typedef struct crop {
	wh_ctx *c;
	const wh_source *src;
	double lo[3], hi[3];
	uint32_t *number; /* per vertex of the input: its number in the output + 1, 0 outside */
	double *xyz;
	uint32_t *tri;
	size_t nv, nf, cap_xyz, cap_tri;
} crop;

static bool is_inside(const crop *k, const double *p)
{
	for (int i = 0; i < 3; i++)
		if (p[i] < k->lo[i] || p[i] > k->hi[i])
			return false;
	return true;
}

static wh_code take_vertices(crop *k)
{
	double *xyz = wh_alloc(k->c, CHUNK, 3 * sizeof *xyz);
	void *raw = wh_alloc(k->c, wh_source_vertex_bytes(k->src, CHUNK), 1);
	for (uint64_t at = 0; xyz && raw && at < k->src->nv; at += CHUNK) {
		const uint64_t left = k->src->nv - at;
		const size_t n = left < CHUNK ? (size_t)left : CHUNK;
		if (wh_source_vertices(k->c, k->src, at, n, xyz, raw) != WH_OK)
			break;
		for (size_t i = 0; i < n; i++) {
			if (!is_inside(k, &xyz[3 * i]))
				continue;
			if (wh_reserve(k->c, &k->xyz, &k->cap_xyz, 3 * (k->nv + 1),
			               sizeof *k->xyz) != WH_OK)
				break;
			for (size_t j = 0; j < 3; j++)
				k->xyz[3 * k->nv + j] = xyz[3 * i + j];
			k->number[at + i] = (uint32_t)++k->nv;
		}
	}
	wh_free(k->c, xyz);
	wh_free(k->c, raw);
	return k->c->err.code;
}

static wh_code take_face(crop *k, const uint64_t *t)
{
	uint32_t v[3];
	for (int j = 0; j < 3; j++) {
		v[j] = k->number[t[j]];
		if (v[j] == 0)
			return WH_OK;
	}
	if (wh_reserve(k->c, &k->tri, &k->cap_tri, 3 * (k->nf + 1), sizeof *k->tri) != WH_OK)
		return k->c->err.code;
	for (size_t j = 0; j < 3; j++)
		k->tri[3 * k->nf + j] = v[j] - 1;
	k->nf++;
	return WH_OK;
}

static wh_code take_faces(crop *k)
{
	uint64_t *ids = wh_alloc(k->c, CHUNK, 3 * sizeof *ids);
	void *raw = wh_alloc(k->c, wh_source_triangle_bytes(k->src, CHUNK), 1);
	for (uint64_t at = 0; ids && raw && at < k->src->nf; at += CHUNK) {
		const uint64_t left = k->src->nf - at;
		const size_t n = left < CHUNK ? (size_t)left : CHUNK;
		if (wh_source_triangles(k->c, k->src, at, n, ids, raw) != WH_OK)
			break;
		for (size_t i = 0; i < n && k->c->err.code == WH_OK; i++)
			(void)take_face(k, &ids[3 * i]);
	}
	wh_free(k->c, ids);
	wh_free(k->c, raw);
	return k->c->err.code;
}

static wh_code write_mesh(const crop *k, const char *path)
{
	wh_outfile *o = NULL;
	const wh_ply_style style = {.is_double = k->src->is_double};
	wh_code code = wh_outfile_open(k->c, &o, path, true);
	if (code == WH_OK)
		code = wh_ply_write_header(k->c, o, style, k->nv, k->nf);
	if (code == WH_OK)
		code = wh_ply_write_vertices(k->c, o, style, k->xyz, k->nv);
	if (code == WH_OK)
		code = wh_ply_write_triangles(k->c, o, style, k->tri, k->nf);
	if (code == WH_OK)
		code = wh_outfile_commit(k->c, &o);
	wh_outfile_abort(k->c, &o);
	return code;
}

int main(int argc, char **argv)
{
	if (argc != 9) {
		(void)fprintf(stderr, "usage: crop IN.ply OUT.ply X0 Y0 Z0 X1 Y1 Z1\n");
		return 2;
	}
	wh_mem mem = {0};
	wh_ctx c = {.mem = &mem};
	wh_spill spill;
	wh_input in;
	const wh_exec ex = {.workers = 1};
	if (wh_spill_open(&c, &spill, NULL, "/tmp") != WH_OK ||
	    wh_input_open(&c, &ex, &spill, argv[1], WH_FORMAT_ANY, false, &in) != WH_OK) {
		(void)fprintf(stderr, "crop: %s\n", c.err.text);
		return 1;
	}
	crop k = {.c = &c, .src = &in.source};
	for (int i = 0; i < 3; i++) {
		k.lo[i] = strtod(argv[3 + i], NULL);
		k.hi[i] = strtod(argv[6 + i], NULL);
	}
	k.number = wh_calloc(&c, (size_t)in.source.nv, sizeof *k.number);
	if (k.number && take_vertices(&k) == WH_OK && take_faces(&k) == WH_OK &&
	    write_mesh(&k, argv[2]) == WH_OK)
		(void)printf("%zu\n", k.nf);
	else
		(void)fprintf(stderr, "crop: %s\n", c.err.text);
	wh_input_close(&c, &spill, &in);
	wh_spill_close(&c, &spill);
	return (int)c.err.code;
}
