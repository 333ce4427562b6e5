#include "mesh/patch.h"

#include <string.h>

static wh_code grow(wh_ctx *c, void *array_ptr, size_t count, size_t size)
{
	void *fresh = wh_alloc(c, count, size);
	if (!fresh)
		return c->err.code;
	void *old;
	memcpy(&old, array_ptr, sizeof old);
	wh_free(c, old);
	memcpy(array_ptr, &fresh, sizeof fresh);
	return WH_OK;
}

wh_code wh_patch_reset(wh_ctx *c, wh_patch *p, uint32_t nv, uint32_t nf)
{
	if (nv > p->cap_v) {
		p->cap_v = 0;
		if (grow(c, &p->pos, nv, sizeof *p->pos) || grow(c, &p->gid, nv, sizeof *p->gid) ||
		    grow(c, &p->flag, nv, sizeof *p->flag) || grow(c, &p->err, nv, sizeof *p->err))
			return c->err.code;
		p->cap_v = nv;
	}
	if (nf > p->cap_f) {
		p->cap_f = 0;
		if (grow(c, &p->tri, nf, 3 * sizeof *p->tri))
			return c->err.code;
		p->cap_f = nf;
	}
	p->nv = nv;
	p->nf = nf;
	return WH_OK;
}

void wh_patch_free(wh_ctx *c, wh_patch *p)
{
	wh_free(c, p->pos);
	wh_free(c, p->tri);
	wh_free(c, p->gid);
	wh_free(c, p->flag);
	wh_free(c, p->err);
	*p = (wh_patch){0};
}

uint32_t wh_patch_compact(wh_patch *p, uint32_t *map)
{
	memset(map, 0, (size_t)p->nv * sizeof *map);
	for (size_t i = 0; i < 3 * (size_t)p->nf; i++)
		map[p->tri[i]] = 1;
	uint32_t live = 0;
	for (uint32_t v = 0; v < p->nv; v++) {
		if (!map[v])
			continue;
		p->pos[live] = p->pos[v];
		p->gid[live] = p->gid[v];
		p->flag[live] = p->flag[v];
		p->err[live] = p->err[v];
		map[v] = live++;
	}
	for (size_t i = 0; i < 3 * (size_t)p->nf; i++)
		p->tri[i] = map[p->tri[i]];
	const uint32_t dropped = p->nv - live;
	p->nv = live;
	return dropped;
}
