/*
 * weld: triangles that carry their corners' positions become triangles of shared vertices.
 *
 * Corners at one position, to the last bit (-0 is 0), are one vertex; vertices are numbered in the
 * order in which they first appear. Nothing else is welded: "near" is not equal.
 */
#ifndef WH_PIPELINE_WELD_H
#define WH_PIPELINE_WELD_H

#include "pipeline/rewrite.h"

/* Facets at fixed strides in a file: the three corners side by side, three coordinates each. */
typedef struct wh_soup {
	const char *path; /* of the user's file, for messages */
	int fd;
	uint64_t base;   /* byte offset of the first corner */
	uint32_t stride; /* bytes from one facet to the next */
	wh_type type;    /* WH_F32 or WH_F64 */
	bool swap;
	uint64_t facets;
} wh_soup;

/*
 * Fills the rewritten body, vertices and triangles. Degenerate facets are counted and left out.
 * WH_E_INPUT for a coordinate that is not finite. Temporary disk: up to 72 bytes a facet (108 of
 * doubles) besides what is written; memory: up to 0.5 byte a facet for all, and less than
 * WH_PLAN_REWRITE a worker.
 */
wh_code wh_weld(wh_ctx *c, wh_rewrite *w, const wh_soup *s);

#endif
