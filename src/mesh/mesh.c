#include "mesh/mesh.h"

wh_code wh_mesh_alloc(wh_ctx *c, wh_mesh *m, uint32_t nv, uint32_t nf)
{
	*m = (wh_mesh){.nv = nv, .nf = nf};
	m->pos = wh_alloc(c, nv, sizeof *m->pos);
	m->tri = wh_alloc(c, nf, 3 * sizeof *m->tri);
	if (!m->pos || !m->tri) {
		wh_mesh_free(c, m);
		return c->err.code;
	}
	return WH_OK;
}

void wh_mesh_free(wh_ctx *c, wh_mesh *m)
{
	wh_free(c, m->pos);
	wh_free(c, m->tri);
	wh_free(c, m->colour);
	*m = (wh_mesh){0};
}
