/*
 * Geomorphs: from one level to another without a jump (Hoppe 1996, section 3.1).
 *
 * A vertex of the finer level that the coarser one does not have was split from one that was there
 * before it, and that one, perhaps, from another: the first of the row that the coarser level has
 * is its ancestor. With every vertex at its ancestor's place the finer mesh looks like the coarser
 * one: the faces that it has more have two corners at one place. So the faces stay as they are, and
 * vertices move along straight lines; normals turn along great circles, their lengths and all other
 * values change evenly. Labels, which have nothing in between, change half way.
 *
 * A vertex has a larger number than the one that it was split from, so one pass in their order
 * finds all ancestors. Time and memory: linear in the finer level.
 */
#include "algo/progressive.h"

#include <math.h>
#include <string.h>

static uint64_t vertices_at(const wh_pmesh *file, uint64_t level)
{
	return file->head.base_vertices + level;
}

size_t wh_progressive_morph_bytes(const wh_pmesh *file, uint64_t from, uint64_t to)
{
	const size_t vertex = sizeof(wh_vec3) + file->attributes.bytes;
	const uint64_t coarse = from < to ? from : to, fine = from < to ? to : from;
	return vertices_at(file, coarse) * vertex +
	       vertices_at(file, fine) * (vertex + sizeof(uint32_t));
}

/* ---- both levels -------------------------------------------------------------------------- */

static wh_code keep_coarse(wh_ctx *c, wh_progressive_morph *m)
{
	const wh_progressive *p = m->p;
	const size_t attr = p->file.attributes.bytes;
	m->coarse = wh_alloc(c, p->nv, sizeof *m->coarse);
	m->coarse_attr = wh_alloc(c, p->nv, attr);
	if (!m->coarse || !m->coarse_attr)
		return wh_failed(c);
	memcpy(m->coarse, p->pos, p->nv * sizeof *m->coarse);
	if (attr)
		memcpy(m->coarse_attr, p->attr, p->nv * attr);
	return WH_OK;
}

/* p has gone on from `coarse` vertices to the finer level. */
static wh_code find_ancestors(wh_ctx *c, wh_progressive_morph *m, uint32_t coarse)
{
	const wh_progressive *p = m->p;
	const uint32_t base = (uint32_t)p->file.head.base_vertices;
	m->ancestor = wh_alloc(c, p->nv, sizeof *m->ancestor);
	if (!m->ancestor)
		return wh_failed(c);
	for (uint32_t v = 0; v < coarse; v++)
		m->ancestor[v] = v;
	for (uint32_t v = coarse; v < p->nv; v++)
		m->ancestor[v] = m->ancestor[p->v[v - base]];
	return WH_OK;
}

wh_code wh_progressive_morph_make(wh_ctx *c, wh_progressive *p, uint64_t from, uint64_t to,
                                  wh_progressive_morph *m)
{
	*m = (wh_progressive_morph){.p = p, .coarsens = from > to};
	if (wh_progressive_seek(c, p, m->coarsens ? to : from) != WH_OK ||
	    keep_coarse(c, m) != WH_OK)
		return c->err.code;
	const uint32_t coarse = p->nv;
	if (wh_progressive_seek(c, p, m->coarsens ? from : to) != WH_OK ||
	    find_ancestors(c, m, coarse) != WH_OK)
		return c->err.code;
	m->pos = wh_alloc(c, p->nv, sizeof *m->pos);
	m->attr = wh_alloc(c, p->nv, p->file.attributes.bytes);
	return m->pos && m->attr ? WH_OK : wh_failed(c);
}

void wh_progressive_morph_free(wh_ctx *c, wh_progressive_morph *m)
{
	wh_free(c, m->coarse);
	wh_free(c, m->coarse_attr);
	wh_free(c, m->ancestor);
	wh_free(c, m->pos);
	wh_free(c, m->attr);
	*m = (wh_progressive_morph){0};
}

/* ---- in between --------------------------------------------------------------------------- */

/* Exactly an end at each end; between equal ones, these. */
static double between(double a, double b, double s)
{
	return s <= 0 || a == b ? a : s >= 1 ? b : a + s * (b - a);
}

static wh_vec3 between_places(wh_vec3 a, wh_vec3 b, double s)
{
	return wh_v3(between(a.x, b.x, s), between(a.y, b.y, s), between(a.z, b.z, s));
}

/* Between directions of length 1 (Shoemake 1985). Opposite ones have nothing in between: the nearer
 * one. */
static wh_vec3 slerp(wh_vec3 a, wh_vec3 b, double s)
{
	const wh_vec3 across = wh_sub(b, wh_scale(a, wh_dot(a, b)));
	const double sine = wh_norm(across), angle = atan2(sine, wh_dot(a, b));
	if (sine < 1e-12)
		return s < 0.5 ? a : b;
	return wh_add(wh_scale(a, cos(s * angle)), wh_scale(across, sin(s * angle) / sine));
}

static wh_vec3 normal_of(const wh_attributes *as, const uint8_t *record)
{
	return wh_v3(wh_attribute_get(&as->item[as->normal[0]], record),
	             wh_attribute_get(&as->item[as->normal[1]], record),
	             wh_attribute_get(&as->item[as->normal[2]], record));
}

/* Where one of them is no direction, what is there stays. */
static void blend_normal(const wh_attributes *as, const uint8_t *a, const uint8_t *b, double s,
                         uint8_t *to)
{
	const wh_vec3 from = normal_of(as, a), into = normal_of(as, b);
	const double from_length = wh_norm(from), into_length = wh_norm(into);
	if (!(from_length > 0 && into_length > 0 && isfinite(from_length + into_length)))
		return;
	const wh_vec3 way =
	    slerp(wh_scale(from, 1 / from_length), wh_scale(into, 1 / into_length), s);
	const wh_vec3 n = wh_scale(way, between(from_length, into_length, s));
	wh_attribute_set(&as->item[as->normal[0]], to, n.x);
	wh_attribute_set(&as->item[as->normal[1]], to, n.y);
	wh_attribute_set(&as->item[as->normal[2]], to, n.z);
}

static void blend_value(const wh_attribute *item, const uint8_t *a, const uint8_t *b, double s,
                        uint8_t *to)
{
	const double v = between(wh_attribute_get(item, a), wh_attribute_get(item, b), s);
	if (item->kind != WH_KIND_LABEL && isfinite(v))
		wh_attribute_set(item, to, v);
}

static void blend_record(const wh_attributes *as, const uint8_t *a, const uint8_t *b, double s,
                         uint8_t *to)
{
	memcpy(to, s < 0.5 ? a : b, as->bytes);
	if (s <= 0 || s >= 1 || memcmp(a, b, as->bytes) == 0)
		return;
	for (uint32_t k = 0; k < as->n; k++)
		blend_value(&as->item[k], a, b, s, to);
	if (as->has_normal)
		blend_normal(as, a, b, s, to);
}

void wh_progressive_morph_at(const wh_progressive_morph *m, double t)
{
	const wh_progressive *p = m->p;
	const wh_attributes *as = &p->file.attributes;
	const double s = m->coarsens ? 1 - t : t;
	for (size_t v = 0; v < p->nv; v++) {
		const size_t from = m->ancestor[v];
		m->pos[v] = between_places(m->coarse[from], p->pos[v], s);
		if (as->n)
			blend_record(as, m->coarse_attr + from * as->bytes, p->attr + v * as->bytes,
			             s, m->attr + v * as->bytes);
	}
}
