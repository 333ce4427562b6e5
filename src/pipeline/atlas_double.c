/*
 * A vertex's corners are compared with those that were met before, in the order of the faces: there
 * are few of them, but where very many charts meet. Cost: linear; 4 bytes a vertex, 8 a vertex of
 * the result and the result.
 */
#include "pipeline/atlas.h"

#include "io/attributes.h"

#include <math.h>
#include <string.h>

typedef struct doubling {
	const wh_patch *p;
	const wh_wedges *wedges;
	wh_atlas_room *room;
	uint32_t from, bytes; /* the part of a corner's record that vertices get */
	uint32_t n;           /* different corners so far */
} doubling;

/* The same attribute among some others; NULL: none. */
static const wh_attribute *part_of(const wh_attributes *some, const wh_attribute *item)
{
	for (uint32_t i = 0; some && i < some->n; i++)
		if (some->item[i].name == item->name)
			return &some->item[i];
	return NULL;
}

/* Corners' attributes that go to vertices are all, or the last ones. */
static void find_part(doubling *d, const wh_attributes *whole)
{
	const wh_attributes *a = &d->wedges->corner;
	uint32_t k = 0;
	while (k < a->n && !part_of(whole, &a->item[k]))
		k++;
	d->from = k < a->n ? a->item[k].at : a->bytes;
	d->bytes = a->bytes - d->from;
}

static const uint8_t *corner_of(const doubling *d, uint32_t at)
{
	return wh_patch_face(d->p, at / 3) + (size_t)(at % 3) * d->wedges->corner.bytes;
}

static bool same_corner(const doubling *d, uint32_t at, uint32_t other)
{
	return memcmp(corner_of(d, at) + d->from, corner_of(d, other) + d->from, d->bytes) == 0;
}

/* The number of the vertex that corner `at` will have; new ones come to the end of their list. */
static wh_code number_corner(wh_ctx *c, doubling *d, uint32_t at, uint32_t *number)
{
	wh_atlas_room *r = d->room;
	uint32_t *link = &r->first[d->p->tri[at]];
	for (; *link != WH_NONE; link = &r->next[*link])
		if (same_corner(d, at, r->corner[*link])) {
			*number = *link;
			return WH_OK;
		}
	*link = *number = d->n;
	if (wh_reserve(c, &r->next, &r->cap_next, (size_t)d->n + 1, sizeof *r->next) != WH_OK ||
	    wh_reserve(c, &r->corner, &r->cap_corner, (size_t)d->n + 1, sizeof *r->corner) != WH_OK)
		return c->err.code;
	r->next[d->n] = WH_NONE;
	r->corner[d->n++] = at;
	return WH_OK;
}

/* Faces get the numbers of corners, as they were met. */
static wh_code number_all(wh_ctx *c, doubling *d)
{
	wh_atlas_room *r = d->room;
	if (wh_renew(c, &r->first, &r->cap_first, (size_t)d->p->nv + 1, sizeof *r->first) != WH_OK)
		return c->err.code;
	for (uint32_t v = 0; v < d->p->nv; v++)
		r->first[v] = WH_NONE;
	for (uint32_t i = 0; i < 3 * d->p->nf; i++)
		if (wh_poll_at(c, i) != WH_OK || number_corner(c, d, i, &r->tri[i]) != WH_OK)
			return c->err.code;
	return WH_OK;
}

static void copy_value(const wh_attribute *from, const uint8_t *record, const wh_attribute *to,
                       uint8_t *out)
{
	memcpy(out + to->at, record + from->at, wh_attribute_bytes(to));
}

static void put_attributes(const doubling *d, const wh_attributes *rest, const wh_attributes *whole,
                           uint32_t v, const uint8_t *corner, uint8_t *to)
{
	double value[3];
	const bool mapped = wh_wedges_uv(d->wedges, corner, value);
	const bool curved = d->wedges->normals < 0 || wh_wedges_normal(d->wedges, corner, value);
	for (uint32_t k = 0; k < whole->n; k++) {
		const wh_attribute *item = &whole->item[k];
		const wh_attribute *from = part_of(rest, item);
		if (from)
			copy_value(from, wh_patch_attr(d->p, v), item, to);
		else if (item->kind == WH_KIND_TEXTURE ? mapped : curved)
			copy_value(part_of(&d->wedges->corner, item), corner, item, to);
		else
			wh_attribute_set(item, to, 0);
	}
}

/* The vertices, copies behind each other; the list of corners then tells where each has come to. */
static void put_vertices(const doubling *d, const wh_attributes *rest, const wh_attributes *whole)
{
	const wh_patch *p = d->p;
	wh_patch *to = &d->room->patch;
	uint32_t n = 0;
	for (uint32_t v = 0; v < p->nv; v++)
		for (uint32_t k = d->room->first[v]; k != WH_NONE; k = d->room->next[k], n++) {
			uint32_t *corner = &d->room->corner[k];
			to->pos[n] = p->pos[v];
			to->gid[n] = p->gid[v];
			to->flag[n] = p->flag[v];
			to->err[n] = p->err[v];
			put_attributes(d, rest, whole, v, corner_of(d, *corner),
			               wh_patch_attr(to, n));
			*corner = n;
		}
}

wh_code wh_atlas_double(wh_ctx *c, const wh_patch *p, const wh_attributes *rest,
                        const wh_wedges *wedges, const wh_attributes *whole, wh_atlas_room *room,
                        wh_patch **doubled)
{
	doubling d = {.p = p, .wedges = wedges, .room = room};
	wh_patch *to = &room->patch;
	find_part(&d, whole);
	to->attr_bytes = whole->bytes;
	to->face_bytes = p->face_bytes;
	*doubled = to;
	if (wh_renew(c, &room->tri, &room->cap_tri, 3 * (size_t)p->nf, sizeof *room->tri) !=
	        WH_OK ||
	    number_all(c, &d) != WH_OK || wh_patch_reset(c, to, d.n, p->nf) != WH_OK)
		return c->err.code;
	put_vertices(&d, rest, whole);
	for (uint32_t i = 0; i < 3 * p->nf; i++)
		to->tri[i] = room->corner[room->tri[i]];
	if (p->nf)
		memcpy(to->face, p->face, (size_t)p->nf * p->face_bytes);
	return WH_OK;
}

void wh_atlas_room_free(wh_ctx *c, wh_atlas_room *room)
{
	wh_patch_free(c, &room->patch);
	wh_free(c, room->first);
	wh_free(c, room->next);
	wh_free(c, room->corner);
	wh_free(c, room->tri);
	*room = (wh_atlas_room){0};
}

size_t wh_atlas_room_bytes(uint64_t nv, uint64_t nf, const wh_attributes *whole)
{
	/* copies of a quarter of the vertices; more make the ceiling refuse */
	const uint64_t copies = nv + nv / 4;
	return wh_patch_bytes(copies, nf, whole->bytes, 0) + (size_t)nv * 4 + (size_t)copies * 8 +
	       (size_t)nf * 12;
}
