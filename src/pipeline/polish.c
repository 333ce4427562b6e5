#include "pipeline/polish.h"

#include "io/wedges.h"
#include "mesh/smooth.h"

#include <string.h>

size_t wh_polish_bytes(uint64_t nv, uint64_t nf, uint32_t attr_bytes)
{
	return (size_t)nv * (2 * sizeof(wh_vec3) + attr_bytes + 12) + wh_smooth_bytes(nv, nf);
}

/* ---- normals ------------------------------------------------------------------------------ */

static const char *const names[] = {"nx", "ny", "nz"};
enum { NORMAL = 3 * 4 /* bytes in a record: floats */ };

static bool is_taken(const wh_attributes *a)
{
	for (uint32_t k = 0; k < a->n; k++)
		for (int i = 0; i < 3; i++)
			if (strcmp(a->item[k].name, names[i]) == 0)
				return true;
	return false;
}

/* What the vertices carry, and behind it normals. */
static wh_code add_normals(wh_ctx *c, const wh_attributes *a, wh_attributes *more)
{
	wh_attribute item[3];
	for (int i = 0; i < 3; i++)
		item[i] = (wh_attribute){.name = names[i],
		                         .type = WH_F32,
		                         .out = WH_F32,
		                         .kind = WH_KIND_NORMAL,
		                         .form = WH_FORM_FLOAT,
		                         .prop = -1};
	const wh_attributes none = {.rank = {0, 1, 2}}, normals = {.item = item, .n = 3};
	a = a ? a : &none;
	if (wh_attributes_both(c, a, &normals, true, more) != WH_OK)
		return c->err.code;
	memcpy(more->before, a->before, sizeof more->before);
	memcpy(more->rank, a->rank, sizeof more->rank);
	return WH_OK;
}

/* Room for the attributes, and what there is of them. */
static wh_code copy_attributes(wh_ctx *c, const wh_patch *p, wh_patch *to)
{
	to->attr = NULL;
	if (to->attr_bytes == 0)
		return WH_OK;
	to->attr = wh_calloc(c, p->nv, to->attr_bytes);
	if (!to->attr)
		return wh_failed(c);
	for (uint32_t v = 0; p->attr_bytes && v < p->nv; v++)
		memcpy(wh_patch_attr(to, v), wh_patch_attr(p, v), p->attr_bytes);
	return WH_OK;
}

static wh_code put_normals(wh_ctx *c, const wh_mesh *m, const wh_attributes *a, const wh_patch *to)
{
	wh_vec3 *normal = wh_alloc(c, m->nv, sizeof *normal);
	if (!normal)
		return wh_failed(c);
	wh_mesh_normals(m, normal);
	for (uint32_t v = 0; v < m->nv; v++) {
		const double n[3] = {normal[v].x, normal[v].y, normal[v].z};
		for (int i = 0; i < 3; i++)
			wh_attribute_set(&a->item[a->normal[i]], wh_patch_attr(to, v), n[i]);
	}
	wh_free(c, normal);
	return WH_OK;
}

wh_code wh_polish_check(wh_ctx *c, const wh_polish *polish, const wh_ply_style *style)
{
	const wh_attributes *a = style->attributes;
	if (!polish->normals)
		return WH_OK;
	if (style->doubled || (style->wedges && style->wedges->corner.has_normal))
		return wh_fail(c, WH_E_USAGE,
		               "normals of the corners of faces, or of vertices that texture "
		               "coordinates double, cannot be worked out anew: leave these out "
		               "with --attributes, or --normals");
	if (a && !a->has_normal && is_taken(a))
		return wh_fail(c, WH_E_USAGE,
		               "normals need the names nx, ny and nz, which are not all there or "
		               "no reals: leave what is called so out with --attributes");
	return WH_OK;
}

/* Finds out what vertices carry then. */
static wh_code choose_attributes(wh_ctx *c, wh_ply_style *style, wh_polished *out)
{
	if (style->attributes && style->attributes->has_normal)
		return WH_OK;
	if (add_normals(c, style->attributes, &out->attributes) != WH_OK)
		return c->err.code;
	style->attributes = &out->attributes;
	out->patch.attr_bytes = out->attributes.bytes;
	return WH_OK;
}

/* ---- the whole ---------------------------------------------------------------------------- */

wh_code wh_polish_patch(wh_ctx *c, const wh_patch *p, const wh_polish *polish, wh_ply_style *style,
                        wh_polished *out)
{
	out->patch = *p;
	out->patch.attr = NULL;
	out->patch.pos = wh_alloc(c, p->nv, sizeof *p->pos);
	if (!out->patch.pos)
		return wh_failed(c);
	const wh_mesh m = {.nv = p->nv, .nf = p->nf, .pos = out->patch.pos, .tri = p->tri};
	if (p->nv)
		memcpy(m.pos, p->pos, p->nv * sizeof *m.pos);
	if ((polish->normals && choose_attributes(c, style, out) != WH_OK) ||
	    copy_attributes(c, p, &out->patch) != WH_OK ||
	    (polish->smooth && wh_smooth(c, &m, polish->smooth) != WH_OK))
		return c->err.code;
	return polish->normals ? put_normals(c, &m, style->attributes, &out->patch) : WH_OK;
}

void wh_polished_free(wh_ctx *c, wh_polished *out)
{
	wh_free(c, out->patch.pos);
	wh_free(c, out->patch.attr);
	wh_attributes_free(c, &out->attributes);
	*out = (wh_polished){0};
}
