#include "mesh/check.h"

#include "mesh/check_parts.h"
#include "mesh/coincident.h"

#include <math.h>

static void count_vertex_list(const wh_mesh *m, wh_check *r)
{
	for (uint32_t v = 0; v < m->nv; v++) {
		const wh_vec3 p = m->pos[v];
		r->nonfinite_vertices += !isfinite(p.x) || !isfinite(p.y) || !isfinite(p.z);
	}
	r->unreferenced_vertices = r->vertices - r->referenced_vertices;
}

wh_code wh_check_mesh(wh_ctx *c, const wh_mesh *m, wh_check *r)
{
	wh_checker k = {.c = c, .nv = m->nv, .nf = m->nf, .pos = m->pos, .tri = m->tri, .r = r};
	wh_face_sums sums = {0};
	*r = (wh_check){.vertices = m->nv};
	wh_code code = wh_coincident_count(c, m->pos, m->nv, NULL, &r->duplicate_vertices);
	if (code != WH_OK)
		return code;
	wh_check_box_begin(r);
	code = wh_checker_run(&k, &sums);
	for (uint32_t v = 0; code == WH_OK && v < m->nv; v++)
		wh_check_add_component(r, k.vertex_sets[v] == v ? k.set_faces[v] : 0);
	wh_checker_free(&k);
	if (code != WH_OK)
		return code;
	wh_check_box_end(r);
	wh_face_sums_end(&sums, r);
	count_vertex_list(m, r);
	wh_check_derive(r);
	return WH_OK;
}
