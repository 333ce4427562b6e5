/* What rply reads becomes a body of fixed strides like any other: serial, and all of it rewritten.
 */
#include "pipeline/rewrite.h"

#include "io/rply_read.h"

#include <inttypes.h>
#include <stdio.h>

enum { TAKE_FROM = 1 << 16 /* triangles written at a time */ };

static wh_code put_vertices(wh_ctx *c, void *arg, uint64_t first, double *xyz,
                            const uint8_t *records, size_t n)
{
	wh_rewrite *w = arg;
	if (wh_rewrite_put_vertices(c, w, first, xyz, n) != WH_OK)
		return c->err.code;
	return wh_rewrite_put_attributes(c, w, first, records, n);
}

static wh_code faces_next(wh_ctx *c, void *arg)
{
	return wh_rewrite_start_faces(c, arg);
}

static wh_code bad_index(wh_ctx *c, const wh_rewrite *w, int elem, uint64_t item, uint64_t id)
{
	return wh_rewrite_bad_index(c, w, &w->ply->elems[elem], item, id, "as rply reads it");
}

static wh_code put_strip(wh_ctx *c, wh_rewrite *w, wh_facer *f, int elem, uint64_t item,
                         const uint64_t *ids, size_t n)
{
	const wh_ply_elem *e = &w->ply->elems[elem];
	const wh_type type = e->props[w->ply->strip_list].type;
	wh_facer_strip_start(f);
	for (size_t i = 0; i < n; i++) {
		if (wh_is_restart(ids[i], type))
			wh_facer_strip_start(f);
		else if (ids[i] >= w->source.nv)
			return bad_index(c, w, elem, item, ids[i]);
		else if (wh_facer_strip_corner(c, f, ids[i]) != WH_OK)
			return c->err.code;
	}
	return WH_OK;
}

static wh_code put_polygon(wh_ctx *c, wh_rewrite *w, wh_facer *f, int elem, uint64_t item,
                           const uint64_t *ids, size_t n)
{
	for (size_t i = 0; i < n; i++)
		if (ids[i] >= w->source.nv)
			return bad_index(c, w, elem, item, ids[i]);
	return wh_facer_add(c, f, ids, n);
}

static wh_code put_face(wh_ctx *c, void *arg, int elem, uint64_t item, const uint64_t *ids,
                        size_t n)
{
	wh_rewrite *w = arg;
	wh_facer *f = &w->facers[0];
	const wh_code code = elem == w->ply->strips ? put_strip(c, w, f, elem, item, ids, n)
	                                            : put_polygon(c, w, f, elem, item, ids, n);
	return code == WH_OK && f->out_n >= TAKE_FROM ? wh_rewrite_take(c, w, f) : code;
}

wh_code wh_rewrite_rply(wh_ctx *c, wh_rewrite *w)
{
	const wh_rply_sink sink = {w, put_vertices, faces_next, put_face};
	const wh_code code = wh_rply_read(c, w->ply, w->attributes, &sink);
	return code == WH_OK ? wh_rewrite_take(c, w, &w->facers[0]) : code;
}
