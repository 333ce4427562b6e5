#include "pipeline/points.h"

enum { CHUNK = 1 << 16 }; /* vertices read at a time */

static wh_code read_all(wh_ctx *c, const wh_source *s, wh_vec3 *points)
{
	void *raw = wh_alloc(c, wh_source_vertex_bytes(s, CHUNK), 1);
	wh_code code = c->err.code;
	for (uint64_t at = 0; code == WH_OK && at < s->nv; at += CHUNK) {
		const size_t n = s->nv - at < CHUNK ? (size_t)(s->nv - at) : CHUNK;
		code = wh_source_vertices(c, s, at, n, &points[at].x, raw);
	}
	wh_free(c, raw);
	return code;
}

static wh_code load(wh_ctx *c, const wh_ply *p, wh_vec3 **points, uint64_t *n)
{
	wh_source s = {0};
	if (p->format == WH_PLY_ASCII || p->vertex != 0 || p->elems[0].stride == 0)
		return wh_fail(c, WH_E_INPUT,
		               "'%s' is no binary PLY of points, such as reduce --seams writes",
		               p->path);
	wh_ply_vertex_source(p, p->body, &s);
	*points = wh_alloc(c, (size_t)s.nv, sizeof **points);
	if (!*points)
		return c->err.code;
	*n = s.nv;
	return read_all(c, &s, *points);
}

wh_code wh_load_points(wh_ctx *c, const char *path, wh_vec3 **points, uint64_t *n)
{
	wh_ply p;
	*points = NULL;
	*n = 0;
	if (wh_ply_open(c, &p, path) != WH_OK)
		return c->err.code;
	const wh_code code = load(c, &p, points, n);
	wh_ply_close(c, &p);
	if (code != WH_OK) {
		wh_free(c, *points);
		*points = NULL;
	}
	return code;
}
