/*
 * read_obj: Wavefront OBJ, its vertices and faces.
 *
 * Vertices (v), with a colour behind the position where there is one, and faces (f) of any number
 * of corners with absolute or relative indices, are used; what else there is is counted by its
 * kind, so that it can be named.
 */
#ifndef WH_PIPELINE_READ_OBJ_H
#define WH_PIPELINE_READ_OBJ_H

#include "pipeline/lines.h"
#include "pipeline/rewrite.h"

/* Number of the first vertex of each chunk, and of all. */
typedef struct wh_obj {
	wh_lines lines;
	uint64_t *first;
} wh_obj;

/* Goes through the open file once and describes it in *p: counts, and what else there is. */
wh_code wh_obj_look(wh_ctx *c, const wh_exec *ex, wh_ply *p, wh_obj *o);
void wh_obj_free(wh_ctx *c, wh_obj *o);

/* The body's vertices and triangles. WH_E_IRREGULAR where wh_rewrite_is_due: restart. */
wh_code wh_obj_rewrite(wh_ctx *c, wh_rewrite *w, const wh_obj *o);

#endif
