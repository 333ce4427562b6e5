/*
 * skins: the textures of a file, and which of them a face has.
 */
#ifndef WH_PIPELINE_SKINS_H
#define WH_PIPELINE_SKINS_H

#include "algo/render.h"
#include "io/image.h"
#include "pipeline/normalise.h"

typedef struct wh_skins {
	wh_image *image;
	uint32_t n;
	int label;     /* the attribute of faces that tells which; -1: the first, for all */
	uint32_t *of;  /* by that attribute's value; WH_NONE: none */
	uint32_t n_of; /* values */
} wh_skins;

/* Loads `file` for all faces, or, where it is NULL, the textures that the input names, which lie
 * beside it. WH_E_INPUT when there are none, or the input has no texture coordinates. */
wh_code wh_skins_load(wh_ctx *c, const wh_input *in, const char *file, wh_skins *s);
void wh_skins_free(wh_ctx *c, wh_skins *s);

/* Lists, as wh_list_name, the files that the input names and a mesh beside it would need: of
 * materials, and pictures. */
wh_code wh_skins_list_files(wh_ctx *c, const wh_input *in, char *list, size_t size);

/* The texture of a face with such a record (io/wedges.h), and where its corners are there. False:
 * it has none. */
bool wh_skins_find(const wh_skins *s, const wh_wedges *w, uint8_t *record, wh_skin *skin);

#endif
