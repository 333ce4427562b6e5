/*
 * sift: a store without the copies of faces, and without components of few faces.
 *
 * All clusters are looked at once, several at a time, and written anew only where something goes.
 * A component is of faces joined through shared vertices. Copies of a face are faces with
 * the same three vertices in any order; the first in the order of the input stays.
 */
#ifndef WH_PIPELINE_SIFT_H
#define WH_PIPELINE_SIFT_H

#include "exec/exec.h"
#include "pipeline/progress.h"
#include "pipeline/store.h"

typedef struct wh_sift_params {
	bool drop_duplicates;   /* the copies go; else they are counted only */
	uint64_t min_component; /* components of fewer faces than that go, copies not counted;
	                           0: none do */
} wh_sift_params;

typedef struct wh_sift_result {
	uint64_t faces;           /* that are left */
	uint64_t duplicate_faces; /* copies of an earlier face */
	uint64_t
	    zero_area_faces; /* three different vertices on a line, to the last bit: they stay */
	uint64_t small_components, component_faces, component_vertices; /* that went */
	uint64_t unreferenced; /* vertices of no face that went as the store was written anew */
} wh_sift_result;

/*
 * Looks at the store *from, and leaves it; fills *to (spill and generation set by the caller) when
 * something goes, which *changed tells. Workers: each takes wh_sift_bytes of the largest cluster.
 * Beside them, 60 bytes for each cut vertex.
 */
wh_code wh_sift(wh_ctx *c, const wh_exec *ex, wh_progress *progress, const wh_store *from,
                const wh_sift_params *params, wh_store *to, bool *changed, wh_sift_result *result);

size_t wh_sift_bytes(const wh_store *store, uint64_t max_vertices, uint64_t max_faces);

#endif
