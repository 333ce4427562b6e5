/*
 * read_obj: Wavefront OBJ, its vertices and faces.
 *
 * Vertices (v), with a colour behind the position where there is one, and faces (f) of any number
 * of corners with absolute or relative indices, are used; what else there is is counted by its
 * kind, so that it can be named. Where they are wanted (io/wedges.h), faces carry the texture
 * coordinates of their corners (a list, as PLY has it), and as labels their material and their
 * group: one more than the place of its name, 0 without.
 */
#ifndef WH_PIPELINE_READ_OBJ_H
#define WH_PIPELINE_READ_OBJ_H

#include "pipeline/lines.h"
#include "pipeline/rewrite.h"

/* What a chunk of lines begins with, and the end of all. */
typedef struct wh_obj_start {
	uint64_t vertices, texcoords; /* before it */
	uint32_t material, group;     /* of its first face */
} wh_obj_start;

typedef struct wh_obj {
	wh_lines lines;
	wh_obj_start *start;
	/* files of materials, materials; groups and objects: their whole lines */
	wh_names libraries, materials, groups;
} wh_obj;

/* Goes through the open file once and describes it in *p: counts, and what else there is. */
wh_code wh_obj_look(wh_ctx *c, const wh_exec *ex, wh_ply *p, wh_obj *o);
void wh_obj_free(wh_ctx *c, wh_obj *o);

/* The body's vertices and triangles. WH_E_IRREGULAR where wh_rewrite_is_due: restart. */
wh_code wh_obj_rewrite(wh_ctx *c, wh_rewrite *w, const wh_obj *o);

#endif
