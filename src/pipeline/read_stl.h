/*
 * read_stl: STL, text and binary. Its facets carry their corners' positions, so that shared
 * vertices have to be found again (weld.h).
 */
#ifndef WH_PIPELINE_READ_STL_H
#define WH_PIPELINE_READ_STL_H

#include "pipeline/lines.h"
#include "pipeline/rewrite.h"

typedef struct wh_stl {
	bool binary;
	uint64_t facets;
	wh_lines lines;  /* of text */
	uint64_t *first; /* number of the first corner of each chunk, and of all */
} wh_stl;

/* Tells text from binary; goes through a text once. Describes the file in *p: its vertices are
 * corners, three a facet, not yet welded. */
wh_code wh_stl_look(wh_ctx *c, const wh_exec *ex, wh_ply *p, wh_stl *s);
void wh_stl_free(wh_ctx *c, wh_stl *s);

/* The body's vertices and triangles. WH_E_IRREGULAR where wh_rewrite_is_due: restart. */
wh_code wh_stl_rewrite(wh_ctx *c, wh_rewrite *w, const wh_stl *s);

#endif
