#include "pipeline/skins.h"

#include "io/mtl.h"

#include <stdio.h>
#include <string.h>

void wh_skins_free(wh_ctx *c, wh_skins *s)
{
	for (uint32_t i = 0; s->image && i < s->n; i++)
		wh_free(c, s->image[i].rgba);
	wh_free(c, s->image);
	wh_free(c, s->of);
	*s = (wh_skins){.label = -1};
}

/* The attribute of faces called so. */
static int find_label(const wh_wedges *w, const char *name)
{
	for (uint32_t i = 0; i < w->face.n; i++)
		if (strcmp(w->face.item[i].name, name) == 0)
			return (int)i;
	return -1;
}

static wh_code load_images(wh_ctx *c, const wh_input *in, const wh_names *names, wh_skins *s)
{
	s->image = wh_calloc(c, names->n, sizeof *s->image);
	wh_code code = s->image ? WH_OK : c->err.code;
	for (; code == WH_OK && s->n < names->n; s->n++) {
		char *path = wh_beside(c, in->ply.path, names->item[s->n]);
		code = path ? wh_image_read(c, path, &s->image[s->n]) : wh_failed(c);
		wh_free(c, path);
	}
	return code;
}

/* Texture numbers count the files of the comments. */
static wh_code load_of_ply(wh_ctx *c, const wh_input *in, wh_skins *s)
{
	const wh_names *names = &in->ply.textures;
	if (load_images(c, in, names, s) != WH_OK)
		return c->err.code;
	s->label = find_label(&in->wedges, "texnumber");
	s->n_of = names->n;
	s->of = wh_alloc(c, names->n, sizeof *s->of);
	for (uint32_t i = 0; s->of && i < s->n_of; i++)
		s->of[i] = i;
	return s->of ? WH_OK : c->err.code;
}

/* Adds to the failure of a picture which file has named it. */
static void tell_source(wh_ctx *c, const wh_names *libraries)
{
	const size_t used = strlen(c->err.text);
	(void)snprintf(c->err.text + used, sizeof c->err.text - used, "; named by '%s'%s",
	               libraries->item[0], libraries->n > 1 ? " or another material file" : "");
}

/* Materials are counted from 1. */
static wh_code load_of_obj(wh_ctx *c, const wh_input *in, wh_skins *s)
{
	const wh_names *materials = in->wedges.materials;
	wh_mtl m;
	if (wh_mtl_read(c, in->ply.path, in->wedges.libraries, materials, &m) != WH_OK)
		return c->err.code;
	wh_code code = load_images(c, in, &m.textures, s);
	if (code == WH_E_INPUT)
		tell_source(c, in->wedges.libraries);
	s->label = find_label(&in->wedges, "material");
	s->n_of = materials->n + 1;
	s->of = code == WH_OK ? wh_alloc(c, s->n_of, sizeof *s->of) : NULL;
	if (s->of) {
		s->of[0] = WH_NONE;
		memcpy(s->of + 1, m.of, materials->n * sizeof *s->of);
	}
	wh_mtl_free(c, &m);
	return s->of ? WH_OK : c->err.code;
}

static void list_names(char *list, size_t size, const wh_names *names)
{
	for (uint32_t i = 0; i < names->n; i++)
		wh_list_name(list, size, names->item[i]);
}

wh_code wh_skins_list_files(wh_ctx *c, const wh_input *in, char *list, size_t size)
{
	const wh_names *libraries = in->wedges.libraries, *materials = in->wedges.materials;
	wh_mtl m;
	list_names(list, size, &in->ply.textures);
	if (!libraries || !materials)
		return WH_OK;
	list_names(list, size, libraries);
	if (wh_mtl_read(c, in->ply.path, libraries, materials, &m) != WH_OK)
		return c->err.code;
	list_names(list, size, &m.textures);
	wh_mtl_free(c, &m);
	return WH_OK;
}

wh_code wh_skins_load(wh_ctx *c, const wh_input *in, const char *file, wh_skins *s)
{
	*s = (wh_skins){.label = -1};
	wh_code code = WH_OK;
	if (!in->wedges.corner.has_texture)
		return wh_fail(
		    c, WH_E_INPUT,
		    "'%s' has no texture coordinates (OBJ: vt; PLY: a list of faces called "
		    "texcoord, or s and t of vertices)",
		    in->ply.path);
	if (file) {
		s->image = wh_calloc(c, 1, sizeof *s->image);
		code = s->image ? wh_image_read(c, file, s->image) : c->err.code;
		s->n = 1;
	} else if (in->wedges.materials && in->wedges.libraries->n) {
		code = load_of_obj(c, in, s);
	} else {
		code = load_of_ply(c, in, s);
	}
	if (code == WH_OK && s->n == 0)
		code =
		    wh_fail(c, WH_E_INPUT,
		            "'%s' names no texture that could be found (OBJ: mtllib, map_Kd; PLY: "
		            "comment TextureFile): give it with --texture=FILE",
		            in->ply.path);
	if (code != WH_OK)
		wh_skins_free(c, s);
	return code;
}

bool wh_skins_find(const wh_skins *s, const wh_wedges *w, uint8_t *record, wh_skin *skin)
{
	uint32_t i = 0;
	if (s->of && s->label >= 0) {
		const double v =
		    wh_attribute_get(&w->face.item[s->label], wh_wedges_face(w, record));
		i = v >= 0 && v < s->n_of ? s->of[(uint32_t)v] : WH_NONE;
	}
	if (i >= s->n)
		return false;
	for (uint32_t k = 0; k < 3; k++) {
		double uv[2];
		if (!wh_wedges_uv(w, wh_wedges_corner(w, record, k), uv))
			return false;
		skin->uv[k][0] = (float)uv[0];
		skin->uv[k][1] = (float)uv[1];
	}
	skin->w = s->image[i].w;
	skin->h = s->image[i].h;
	skin->rgba = s->image[i].rgba;
	return true;
}
