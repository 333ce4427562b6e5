/*
 * compare_band: the faces of a surface along a line of points.
 *
 * Internal to compare.
 */
#ifndef WH_ALGO_COMPARE_BAND_H
#define WH_ALGO_COMPARE_BAND_H

#include "mesh/bvh.h"

/*
 * Marks (1, else 0) the faces of the tree that are nearest to one of the n points, in world
 * coordinates and within the frame, or no more than WH_BAND_RINGS steps from one that is, from
 * face to face over a shared vertex. `band` has a byte a face. Takes another byte a vertex, and 4
 * a point. The result does not depend on ex.
 */
wh_code wh_compare_band(wh_ctx *c, const wh_exec *ex, const wh_bvh *t, const wh_frame *f,
                        const wh_vec3 *points, uint64_t n, uint8_t *band);

#endif
