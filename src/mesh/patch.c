#include "mesh/patch.h"

#include <string.h>

wh_code wh_patch_reset(wh_ctx *c, wh_patch *p, uint32_t nv, uint32_t nf)
{
	size_t pos = p->cap_v, gid = p->cap_v, flag = p->cap_v, err = p->cap_v, tri = p->cap_f;
	p->cap_v = p->cap_f = 0;
	if (wh_renew(c, &p->pos, &pos, nv, sizeof *p->pos) != WH_OK ||
	    wh_renew(c, &p->gid, &gid, nv, sizeof *p->gid) != WH_OK ||
	    wh_renew(c, &p->flag, &flag, nv, sizeof *p->flag) != WH_OK ||
	    wh_renew(c, &p->err, &err, nv, sizeof *p->err) != WH_OK ||
	    wh_renew(c, &p->tri, &tri, nf, 3 * sizeof *p->tri) != WH_OK)
		return c->err.code;
	if (p->attr_bytes &&
	    wh_renew(c, &p->attr, &p->cap_attr, (size_t)nv * p->attr_bytes, 1) != WH_OK)
		return c->err.code;
	if (p->face_bytes &&
	    wh_renew(c, &p->face, &p->cap_face, (size_t)nf * p->face_bytes, 1) != WH_OK)
		return c->err.code;
	p->cap_v = (uint32_t)pos;
	p->cap_f = (uint32_t)tri;
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
	wh_free(c, p->attr);
	wh_free(c, p->face);
	*p = (wh_patch){0};
}

/* The same for attributes, as long as `map` still says who is used. */
static void close_attributes(const wh_patch *p, const uint32_t *map)
{
	uint32_t live = 0;
	for (uint32_t v = 0; v < p->nv; v++) {
		if (map[v] && live != v)
			memcpy(wh_patch_attr(p, live), wh_patch_attr(p, v), p->attr_bytes);
		live += map[v];
	}
}

/* Without a branch: where a vertex goes, the next one goes as well if nobody uses it. */
static uint32_t close_ranks(const wh_patch *p, uint32_t *map)
{
	wh_vec3 *pos = p->pos;
	uint64_t *gid = p->gid;
	uint8_t *flag = p->flag;
	float *err = p->err;
	const uint32_t nv = p->nv;
	uint32_t live = 0;
	for (uint32_t v = 0; v < nv; v++) {
		pos[live] = pos[v];
		gid[live] = gid[v];
		flag[live] = flag[v];
		err[live] = err[v];
		const uint32_t used = map[v];
		map[v] = live;
		live += used;
	}
	return live;
}

uint32_t wh_patch_compact(wh_patch *p, uint32_t *map)
{
	const size_t corners = 3 * (size_t)p->nf;
	uint32_t *tri = p->tri;
	memset(map, 0, (size_t)p->nv * sizeof *map);
	for (size_t i = 0; i < corners; i++)
		map[tri[i]] = 1;
	if (p->attr_bytes)
		close_attributes(p, map);
	const uint32_t live = close_ranks(p, map);
	for (size_t i = 0; i < corners; i++)
		tri[i] = map[tri[i]];
	const uint32_t dropped = p->nv - live;
	p->nv = live;
	return dropped;
}
