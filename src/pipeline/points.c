#include "pipeline/points.h"

wh_code wh_points_open(wh_ctx *c, const char *path, wh_points *p)
{
	*p = (wh_points){0};
	if (wh_ply_open(c, &p->file, path) != WH_OK)
		return c->err.code;
	const wh_ply *f = &p->file;
	if (f->format == WH_PLY_ASCII || f->vertex != 0 || f->elems[0].stride == 0) {
		(void)wh_fail(c, WH_E_INPUT,
		              "'%s' is no binary PLY of points, such as reduce --seams writes",
		              f->path);
		wh_points_close(c, p);
		return c->err.code;
	}
	wh_ply_vertex_source(f, f->body, &p->source);
	p->n = p->source.nv;
	return WH_OK;
}

void wh_points_close(wh_ctx *c, wh_points *p)
{
	if (p->file.path)
		wh_ply_close(c, &p->file);
	*p = (wh_points){0};
}

wh_code wh_points_get(wh_ctx *c, void *user, uint64_t first, size_t n, wh_vec3 *points)
{
	const wh_points *p = user;
	void *raw = wh_alloc(c, wh_source_vertex_bytes(&p->source, n), 1);
	const wh_code code =
	    raw ? wh_source_vertices(c, &p->source, first, n, &points->x, raw) : c->err.code;
	wh_free(c, raw);
	return code;
}
