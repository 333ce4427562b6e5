/*
 * clean: a source without vertices that are not finite, and with near vertices made one.
 *
 * Works on positions and triangles at fixed strides, out of core; what comes out is another such
 * source. Vertices keep their order, their bits and their attributes; faces keep their order and
 * what they and their corners carry. A
 * face that used a vertex that went is left out, and so is one two of whose corners became one.
 *
 * Welding: vertices are gone through in an order that their positions and numbers give (below).
 * Each one becomes the nearest vertex within the distance, of those before it that stayed, or stays
 * itself where there is none. So no vertex goes farther than the distance, no two that stay are
 * within it of each other, and nothing is handed on: of a chain of vertices, each within the
 * distance of the next, not all become one. With a distance of 0, equal positions (-0 is 0) become
 * the first one of them.
 */
#ifndef WH_PIPELINE_CLEAN_H
#define WH_PIPELINE_CLEAN_H

#include "exec/exec.h"
#include "geom/vec3.h"
#include "io/ply.h"
#include "io/spill.h"
#include "pipeline/progress.h"

typedef struct wh_clean_params {
	bool drop_invalid; /* the source's keep_invalid is set: leave such vertices out */
	bool weld;
	double distance;       /* in units of the file */
	double distance_share; /* the same as a share of the diagonal of the box around all vertices
	                          that are finite; the larger one holds */
	uint64_t bucket, window; /* vertices of the parts that the work is cut into, about; 0: as
	                            there is memory for */
} wh_clean_params;

typedef struct wh_clean_result {
	uint64_t invalid_vertices; /* not finite */
	uint64_t invalid_faces;    /* triangles that used one of them */
	uint64_t welded_vertices;  /* that became another one */
	uint64_t degenerate_faces; /* triangles with a repeated corner to begin with */
	uint64_t collapsed_faces;  /* triangles that lost a corner by welding */
	uint64_t bytes_read;       /* of the source's files */
	double distance;           /* that was welded within */
	uint64_t joined_vertices;  /* copies of others, by pipeline/atlas.h */
} wh_clean_result;

/*
 * Makes *out, in the scratch file *fd of the spill folder; -1, and *out is the source, when there
 * is nothing to do. `budget`: bytes of memory; workers are left out where they do not fit. Nothing
 * in the result depends on either. WH_E_PLAN when the least that works is more than the budget
 * (wh_clean_bytes with one worker). WH_E_IRREGULAR as wh_source_triangles. WH_E_USAGE when the
 * distance is too small for the coordinates to tell.
 *
 * Temporary disk, besides the result: for each vertex 16 to 40 bytes while it is welded, some of
 * them two or more times; 24 for each triangle where memory takes more than one window.
 */
wh_code wh_clean(wh_ctx *c, const wh_exec *ex, wh_progress *progress, wh_spill *spill,
                 const wh_source *source, const wh_clean_params *params, size_t budget,
                 wh_source *out, int *fd, wh_clean_result *result);

/* The least memory it takes with so many workers. */
size_t wh_clean_bytes(const wh_source *source, const wh_clean_params *params, int workers);

/* Bytes of temporary disk, the result included, as far as counts tell. */
uint64_t wh_clean_disk(const wh_source *source, const wh_clean_params *params);

#endif
