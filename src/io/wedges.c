#include "io/wedges.h"

#include <math.h>
#include <string.h>
#include <strings.h>

/* The list with two reals for each corner. */
static int find_list(const wh_ply *p, const char *wanted)
{
	static const char *const names[] = {"texcoord", "texture_coordinates", "texcoords"};
	const wh_ply_elem *e = &p->elems[p->face];
	for (size_t k = 0; k < sizeof names / sizeof *names; k++)
		for (int i = 0; i < (int)e->nprops; i++) {
			const wh_ply_prop *q = &e->props[i];
			if (q->is_list && !wh_type_is_integer(q->type) &&
			    strcasecmp(q->name, names[k]) == 0 &&
			    wh_attributes_names(wanted, q->name, WH_KIND_TEXTURE))
				return i;
		}
	return -1;
}

/* Normals of OBJ; what lists of such a name are elsewhere nobody knows. */
static int find_normals(const wh_ply *p, const char *wanted)
{
	const wh_ply_elem *e = &p->elems[p->face];
	for (int i = 0; p->kind == WH_FORMAT_OBJ && i < (int)e->nprops; i++)
		if (strcmp(e->props[i].name, WH_WEDGES_NORMALS) == 0 &&
		    wh_attributes_names(wanted, WH_WEDGES_NORMALS, WH_KIND_NORMAL))
			return i;
	return -1;
}

/* Appends n values of each corner that are in a list of the faces. */
static void describe_list(const wh_ply *p, int list, wh_kind kind, const char *const *name,
                          uint32_t n, wh_attributes *a)
{
	const wh_type type = p->elems[p->face].props[list].type;
	for (uint32_t k = 0; k < n; k++) {
		wh_attribute *item = &a->item[a->n++];
		*item = (wh_attribute){.name = name[k],
		                       .type = type,
		                       .out = type,
		                       .kind = kind,
		                       .form = type == WH_F32 ? WH_FORM_FLOAT : WH_FORM_DOUBLE,
		                       .prop = list,
		                       .at = a->bytes};
		a->bytes += wh_attribute_bytes(item);
	}
	a->file_bytes = a->bytes;
}

static wh_code describe_corner(wh_ctx *c, const wh_ply *p, wh_wedges *w)
{
	static const char *const uv[] = {"u", "v"}, *const normal[] = {"nx", "ny", "nz"};
	wh_attributes *a = &w->corner;
	a->item = wh_calloc(c, 5, sizeof *a->item);
	if (!a->item)
		return c->err.code;
	if (w->list >= 0)
		describe_list(p, w->list, WH_KIND_TEXTURE, uv, 2, a);
	if (w->normals >= 0)
		describe_list(p, w->normals, WH_KIND_NORMAL, normal, 3, a);
	wh_attributes_group(a);
	return WH_OK;
}

/* Of the elements of faces themselves; strips have none of it. */
static wh_code choose_of_faces(wh_ctx *c, const wh_ply *p, wh_wanted wanted, wh_wedges *w)
{
	if (p->face < 0 || (p->strips >= 0 && p->elems[p->strips].count > 0))
		return WH_OK;
	if (wanted.holds & WH_HOLDS_CORNERS)
		w->list = find_list(p, wanted.names);
	if ((wanted.holds & WH_HOLDS_CORNERS) && (wanted.holds & WH_HOLDS_NORMAL))
		w->normals = find_normals(p, wanted.names);
	if ((w->list >= 0 || w->normals >= 0) && describe_corner(c, p, w) != WH_OK)
		return c->err.code;
	if (!(wanted.holds & WH_HOLDS_FACES))
		return WH_OK;
	return wh_attributes_choose_of(c, p, p->face, (wh_wanted){wanted.names, WH_HOLDS_ALL},
	                               &w->face);
}

/* Flags (of VCG, MeshLab's library: what is selected, lies on the boundary ...) are no parts. */
static bool is_border_label(const wh_attribute *a)
{
	return a->kind == WH_KIND_LABEL && strcasecmp(a->name, "flags") != 0;
}

wh_code wh_wedges_choose(wh_ctx *c, const wh_ply *p, wh_wanted wanted,
                         const wh_attributes *vertices, wh_wedges *w)
{
	*w = (wh_wedges){.list = -1, .normals = -1};
	if (choose_of_faces(c, p, wanted, w) != WH_OK)
		return c->err.code;
	w->of_vertices = (wanted.holds & WH_HOLDS_CORNERS) && !(wanted.holds & WH_HOLDS_APART) &&
	                 w->list < 0 && vertices->has_texture;
	if (w->of_vertices && wh_attributes_part(c, vertices, true, &w->corner) != WH_OK)
		return c->err.code;
	w->bytes = 3 * w->corner.bytes + w->face.bytes;
	for (uint32_t i = 0; i < w->face.n; i++)
		w->labels += is_border_label(&w->face.item[i]);
	return WH_OK;
}

void wh_wedges_free(wh_ctx *c, wh_wedges *w)
{
	wh_attributes_free(c, &w->corner);
	wh_attributes_free(c, &w->face);
	*w = (wh_wedges){.list = -1, .normals = -1};
}

bool wh_wedges_has(const wh_wedges *w, int prop)
{
	return w && ((w->list >= 0 && prop == w->list) || wh_attributes_find(&w->face, prop));
}

void wh_wedges_no_corner(const wh_wedges *w, uint8_t *corner)
{
	for (uint32_t k = 0; k < w->corner.n; k++)
		wh_attribute_set(&w->corner.item[k], corner, (double)NAN);
}

bool wh_wedges_uv(const wh_wedges *w, const uint8_t *corner, double uv[2])
{
	if (!w->corner.has_texture)
		return false;
	uv[0] = wh_attribute_get(&w->corner.item[0], corner);
	uv[1] = wh_attribute_get(&w->corner.item[1], corner);
	return isfinite(uv[0]) && isfinite(uv[1]);
}

bool wh_wedges_normal(const wh_wedges *w, const uint8_t *corner, double n[3])
{
	const wh_attributes *a = &w->corner;
	for (int k = 0; a->has_normal && k < 3; k++)
		n[k] = wh_attribute_get(&a->item[a->normal[k]], corner);
	return a->has_normal && isfinite(n[0]) && isfinite(n[1]) && isfinite(n[2]);
}

const wh_names *wh_wedges_names(const wh_wedges *w, const char *property)
{
	return strcmp(property, "material") == 0 ? w->materials
	       : strcmp(property, "group") == 0  ? w->groups
	                                         : NULL;
}

bool wh_wedges_same_face(const wh_wedges *w, const uint8_t *a, const uint8_t *b)
{
	const uint8_t *fa = wh_wedges_face(w, a), *fb = wh_wedges_face(w, b);
	for (uint32_t i = 0; w->labels && i < w->face.n; i++) {
		const wh_attribute *item = &w->face.item[i];
		if (is_border_label(item) &&
		    memcmp(fa + item->at, fb + item->at, wh_attribute_bytes(item)) != 0)
			return false;
	}
	return true;
}
