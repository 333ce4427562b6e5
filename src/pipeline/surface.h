/*
 * surface: a file of any size as a surface to measure distances from, in bounded memory.
 *
 * The mesh is cut into clusters of 64 Ki faces on disk (pipeline/ingest), the faces of each are
 * put in spatial order, and written as pages (mesh/page) into one nameless file of the spill
 * folder: 13 bytes a face and more, where positions are doubles or there are colours. Pages
 * depend on the file alone, neither on memory nor on threads.
 */
#ifndef WH_PIPELINE_SURFACE_H
#define WH_PIPELINE_SURFACE_H

#include "io/format.h"
#include "io/spill.h"
#include "mesh/bvh.h"
#include "pipeline/progress.h"

typedef struct wh_surface_params {
	const char *path;
	wh_format from;  /* WH_FORMAT_ANY: what it looks like */
	bool colours;    /* carry them, where the file has any */
	bool numbered;   /* vertices keep their numbers */
	uint32_t number; /* of the surface, different from that of all others in the folder */
	size_t budget;   /* bytes that making it may hold at any time */
} wh_surface_params;

/* Must stay where it is. */
typedef struct wh_surface {
	wh_bvh tree; /* all pages are added; to be finished by the caller */
	wh_spill *spill;
	int fd; /* the pages */
} wh_surface;

/*
 * Reads a file. Degenerate faces (a corner repeated) are left out. WH_E_INPUT for a damaged file,
 * one with a coordinate that is not finite, or one without faces; WH_E_PLAN when the budget is too
 * small, in words that name `ceiling` (bytes, of the process) and one that would do. Close it also
 * after a failure.
 */
wh_code wh_surface_open(wh_ctx *c, const wh_exec *ex, wh_spill *spill, wh_progress *progress,
                        const wh_surface_params *p, size_t ceiling, wh_surface *s);
void wh_surface_close(wh_ctx *c, wh_surface *s);

#endif
