/*
 * read_obj: Wavefront OBJ, its vertices and faces.
 *
 * Vertices (v), with a colour behind the position where there is one, and faces (f) of any number
 * of corners with absolute or relative indices, are used; what else there is is counted by its
 * kind, so that it can be named. Where they are wanted (io/wedges.h), faces carry the texture
 * coordinates of their corners (a list, as PLY has it), and as labels their material and their
 * group: one more than the place of its name, 0 without.
 *
 * Normals (vn) are the vertices' own where every corner has that of the number of its vertex, and
 * properties nx, ny and nz of the vertices then. Where corners do otherwise they are a list of the
 * faces, three for each corner; where each face has but one they tell nothing, and are left.
 */
#ifndef WH_PIPELINE_READ_OBJ_H
#define WH_PIPELINE_READ_OBJ_H

#include "pipeline/lines.h"
#include "pipeline/obj_corner.h"
#include "pipeline/rewrite.h"

/* What corners refer to besides vertices. */
enum { WH_OBJ_TEXCOORDS, WH_OBJ_NORMALS, WH_OBJ_LISTS };

/* What a chunk of lines begins with, and the end of all. */
typedef struct wh_obj_start {
	uint64_t vertices, listed[WH_OBJ_LISTS]; /* before it */
	uint32_t material, group;                /* of its first face */
} wh_obj_start;

typedef struct wh_obj {
	wh_lines lines;
	wh_obj_start *start;
	bool coloured;          /* vertices have colours */
	wh_obj_normals normals; /* whose they are */
	/* files of materials, materials; groups and objects: their whole lines */
	wh_names libraries, materials, groups;
} wh_obj;

/* Goes through the open file once and describes it in *p: counts, and what else there is. */
wh_code wh_obj_look(wh_ctx *c, const wh_exec *ex, wh_ply *p, wh_obj *o);
void wh_obj_free(wh_ctx *c, wh_obj *o);

/* Bytes of a temporary file that the rewrite has for a list of corners. */
uint64_t wh_obj_list_bytes(const wh_obj *o, int list);

/* The body's vertices and triangles. WH_E_IRREGULAR where wh_rewrite_is_due: restart. */
wh_code wh_obj_rewrite(wh_ctx *c, wh_rewrite *w, const wh_obj *o);

#endif
