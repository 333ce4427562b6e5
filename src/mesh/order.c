#include "mesh/order.h"

#include "geom/morton.h"

#include <string.h>

typedef wh_order_place place;

/* Least significant digit first, 11 bits at a time. Leaves the result in `a`. */
static wh_code sort_places(wh_ctx *c, place *a, place *b, uint32_t n)
{
	for (unsigned shift = 0; shift < 66; shift += 11) {
		if (wh_poll(c) != WH_OK)
			return c->err.code;
		uint32_t start[2049] = {0};
		for (uint32_t i = 0; i < n; i++)
			start[(a[i].key >> shift & 2047) + 1]++;
		for (int d = 0; d < 2048; d++)
			start[d + 1] += start[d];
		for (uint32_t i = 0; i < n; i++)
			b[start[a[i].key >> shift & 2047]++] = a[i];
		place *t = a;
		a = b;
		b = t;
	}
	return WH_OK;
}

static void curve_places(const wh_patch *p, place *at)
{
	wh_vec3 lo = p->nv ? p->pos[0] : wh_v3(0, 0, 0), hi = lo;
	for (uint32_t v = 1; v < p->nv; v++) {
		lo = wh_lower(lo, p->pos[v]);
		hi = wh_upper(hi, p->pos[v]);
	}
	const double side = fmax(hi.x - lo.x, fmax(hi.y - lo.y, hi.z - lo.z));
	const double scale = side > 0 ? 2097151.0 / side : 0;
	for (uint32_t v = 0; v < p->nv; v++)
		at[v] = (place){wh_morton_key(p->pos[v], lo, scale), v};
}

/* Turns each face so that its least vertex comes first, keeping its direction. */
static void least_first(uint32_t *t)
{
	while (t[0] > t[1] || t[0] > t[2]) {
		const uint32_t a = t[0];
		t[0] = t[1];
		t[1] = t[2];
		t[2] = a;
	}
}

/* Faces by their first vertex (counting sort; start: room for nv + 1 entries), with what they
 * carry. */
static void order_faces(const wh_patch *p, uint32_t *start, uint32_t *tri, uint8_t *face)
{
	memset(start, 0, ((size_t)p->nv + 1) * sizeof *start);
	for (uint32_t f = 0; f < p->nf; f++)
		start[p->tri[3 * (size_t)f] + 1]++;
	for (uint32_t v = 0; v < p->nv; v++)
		start[v + 1] += start[v];
	for (uint32_t f = 0; f < p->nf; f++) {
		const uint32_t *t = &p->tri[3 * (size_t)f];
		const size_t to = start[t[0]]++;
		memcpy(&tri[3 * to], t, 3 * sizeof *t);
		if (p->face_bytes)
			memcpy(face + to * p->face_bytes, wh_patch_face(p, f), p->face_bytes);
	}
}

/* Attributes in another order: as much of every record at a time as there is room for. */
static void permute_attributes(const wh_patch *p, const place *at, uint8_t *room)
{
	const uint32_t size = p->attr_bytes;
	for (uint32_t done = 0; done < size; done += sizeof(wh_vec3)) {
		const size_t n = size - done < sizeof(wh_vec3) ? size - done : sizeof(wh_vec3);
		for (uint32_t i = 0; i < p->nv; i++)
			memcpy(room + i * n, wh_patch_attr(p, at[i].v) + done, n);
		for (uint32_t i = 0; i < p->nv; i++)
			memcpy(wh_patch_attr(p, i) + done, room + i * n, n);
	}
}

/* The patch's arrays in another order: vertex i comes from place at[i].v. */
static void permute(wh_patch *p, const place *at, uint32_t *map, void *room)
{
	wh_vec3 *pos = room;
	uint64_t *gid = room;
	float *err = room;
	uint8_t *flag = room;
	for (uint32_t i = 0; i < p->nv; i++)
		pos[i] = p->pos[at[i].v];
	memcpy(p->pos, pos, p->nv * sizeof *pos);
	for (uint32_t i = 0; i < p->nv; i++)
		gid[i] = p->gid[at[i].v];
	memcpy(p->gid, gid, p->nv * sizeof *gid);
	for (uint32_t i = 0; i < p->nv; i++)
		err[i] = p->err[at[i].v];
	memcpy(p->err, err, p->nv * sizeof *err);
	for (uint32_t i = 0; i < p->nv; i++)
		flag[i] = p->flag[at[i].v];
	memcpy(p->flag, flag, p->nv * sizeof *flag);
	permute_attributes(p, at, room);
	for (uint32_t i = 0; i < p->nv; i++)
		map[at[i].v] = i;
}

/* Faces with their vertices' new numbers, in the order of those. map (nv + 1), tri and face are
 * scratch afterwards. */
static wh_code renumber(wh_ctx *c, wh_patch *p, uint32_t *map, uint32_t *tri, uint8_t *face)
{
	for (uint32_t f = 0; f < p->nf; f++) {
		uint32_t *t = &p->tri[3 * (size_t)f];
		if (wh_poll_at(c, f) != WH_OK)
			return c->err.code;
		for (int k = 0; k < 3; k++)
			t[k] = map[t[k]];
		if (!p->face_bytes || p->turnable) /* else records would have to turn, too */
			least_first(t);
	}
	order_faces(p, map, tri, face);
	memcpy(p->tri, tri, 3 * sizeof *tri * p->nf);
	if (p->face_bytes && p->nf)
		memcpy(p->face, face, (size_t)p->nf * p->face_bytes);
	return WH_OK;
}

size_t wh_patch_order_bytes(uint64_t nv, uint64_t nf, uint32_t face_bytes)
{
	return (size_t)nv * (2 * sizeof(place) + sizeof(uint32_t) + sizeof(wh_vec3)) +
	       (size_t)nf * (3 * sizeof(uint32_t) + face_bytes);
}

static wh_code make_room(wh_ctx *c, const wh_patch *p, wh_order_workspace *w)
{
	if (wh_renew(c, &w->at, &w->at_cap, 2 * (size_t)p->nv, sizeof(place)) != WH_OK ||
	    wh_renew(c, &w->map, &w->map_cap, (size_t)p->nv + 1, sizeof *w->map) != WH_OK ||
	    wh_renew(c, &w->room, &w->room_cap, p->nv, sizeof *w->room) != WH_OK ||
	    wh_renew(c, &w->tri, &w->tri_cap, 3 * (size_t)p->nf, sizeof *w->tri) != WH_OK ||
	    wh_renew(c, &w->face, &w->face_cap, (size_t)p->nf * p->face_bytes, 1) != WH_OK)
		return c->err.code;
	return WH_OK;
}

void wh_order_workspace_free(wh_ctx *c, wh_order_workspace *w)
{
	wh_free(c, w->at);
	wh_free(c, w->map);
	wh_free(c, w->room);
	wh_free(c, w->tri);
	wh_free(c, w->face);
	*w = (wh_order_workspace){0};
}

wh_code wh_patch_order(wh_ctx *c, wh_patch *p, wh_order_workspace *w)
{
	if (p->nv == 0)
		return WH_OK; /* an empty cell may have no arrays */
	if (make_room(c, p, w) != WH_OK)
		return c->err.code;
	place *at = w->at;
	curve_places(p, at);
	if (sort_places(c, at, at + p->nv, p->nv) != WH_OK)
		return c->err.code;
	permute(p, at, w->map, w->room);
	return renumber(c, p, w->map, w->tri, w->face);
}
