/* What becomes of the properties of the input: each is carried over, and named with its kind, or it
 * is named as one that is dropped. */
#include "run/run.h"

#include <stdio.h>
#include <string.h>

static void note_dropped(wh_reduce_report *t, const char *name)
{
	wh_list_name(t->dropped, sizeof t->dropped, name);
}

/* The same for a property; those of faces often have the names of some of vertices. */
static void note_property(wh_reduce_report *t, const char *name, bool of_faces)
{
	char text[300];
	(void)snprintf(text, sizeof text, of_faces ? "%.250s of faces" : "%.250s", name);
	note_dropped(t, text);
}

/* Appends the names of the attributes of a kind, and the kind. */
static void note_carried(wh_reduce_report *t, const wh_attributes *a, wh_kind kind)
{
	uint32_t left = 0;
	for (uint32_t i = 0; i < a->n; i++)
		left += a->item[i].kind == kind;
	for (uint32_t i = 0; left > 0 && i < a->n; i++) {
		if (a->item[i].kind != kind)
			continue;
		char name[300];
		(void)snprintf(name, sizeof name, --left ? "%.250s" : "%.250s (%s)",
		               a->item[i].name, wh_kind_name(kind));
		wh_list_name(t->carried, sizeof t->carried, name);
	}
}

/* Those of vertices, with what belongs to corners on the way. */
static const wh_attributes *attributes_of_file(const wh_run *r)
{
	return r->input.wedges.of_vertices ? &r->input.whole : &r->input.attributes;
}

/* Is this property of the vertices in the result? */
static bool is_kept(const wh_run *r, int prop)
{
	const wh_ply *p = &r->input.ply;
	return prop == p->x || prop == p->y || prop == p->z ||
	       wh_attributes_find(attributes_of_file(r), prop);
}

/* Does the output have room for a scalar of faces? OBJ has names of materials and groups, and
 * nothing else. */
static bool is_written(const wh_run *r, const char *name)
{
	return r->to == WH_FORMAT_PLY || wh_wedges_names(&r->input.wedges, name);
}

/* The same of the faces. */
static bool is_kept_of_faces(const wh_run *r, int prop)
{
	const wh_ply *p = &r->input.ply;
	return prop == p->corners || (wh_wedges_has(&r->input.wedges, prop) &&
	                              (prop == r->input.wedges.list ||
	                               is_written(r, p->elems[p->face].props[prop].name)));
}

/* OBJ files are described twice over: what their faces carry, and what lines they have. */
static void note_element(wh_run *r, const char *name)
{
	const wh_wedges *w = &r->input.wedges;
	const bool obj = r->input.ply.kind == WH_FORMAT_OBJ;
	const bool normals = w->corner.has_normal || r->input.attributes.has_normal;
	const bool kept = (strcmp(name, "texture coordinates") == 0 && w->corner.has_texture) ||
	                  (strcmp(name, "normals") == 0 && normals) ||
	                  (strcmp(name, "materials") == 0 && w->materials && w->face.n) ||
	                  (strcmp(name, "groups") == 0 && w->groups && w->face.n) ||
	                  (strcmp(name, "material libraries") == 0 && w->bytes &&
	                   (r->to == WH_FORMAT_OBJ || r->to == WH_FORMAT_PLY));
	if (!obj || !kept)
		note_dropped(r->report, name);
}

/* What faces and corners carry, each name by itself. */
static void note_wedges(wh_run *r)
{
	wh_reduce_report *t = r->report;
	const wh_wedges *w = &r->input.wedges;
	if (w->list >= 0)
		wh_list_name(t->carried, sizeof t->carried, "texture coordinates of corners");
	if (w->normals >= 0)
		wh_list_name(t->carried, sizeof t->carried, "normals of corners");
	for (uint32_t i = 0; i < w->face.n; i++) {
		char name[300];
		if (!is_written(r, w->face.item[i].name))
			continue;
		(void)snprintf(name, sizeof name, "%.250s of faces", w->face.item[i].name);
		wh_list_name(t->carried, sizeof t->carried, name);
	}
}

void wh_run_list_carried(wh_run *r)
{
	const wh_ply *p = &r->input.ply;
	for (size_t i = 0; i < p->nelems; i++) {
		const wh_ply_elem *e = &p->elems[i];
		const bool vertex = (int)i == p->vertex, face = (int)i == p->face;
		const bool obj_face = face && p->kind == WH_FORMAT_OBJ; /* its lines are named */
		if (!vertex && !face && (int)i != p->strips)
			note_element(r, e->name);
		for (int k = 0; (vertex || face) && !obj_face && k < (int)e->nprops; k++)
			if (vertex ? !is_kept(r, k) : !is_kept_of_faces(r, k))
				note_property(r->report, e->props[k].name, face);
	}
	if (r->params->quantize)
		note_dropped(r->report, "bits of positions beyond 16");
	else if (r->input.source.is_double && !r->params->ascii &&
	         (r->to == WH_FORMAT_STL || r->to == WH_FORMAT_GLB))
		note_dropped(r->report, "double precision");
	for (int kind = 0; kind < WH_KINDS; kind++)
		note_carried(r->report, attributes_of_file(r), (wh_kind)kind);
	note_wedges(r);
	if (p->textures.n && r->to != WH_FORMAT_PLY && !wh_run_style(r).texture)
		note_dropped(r->report, "names of texture files");
}
