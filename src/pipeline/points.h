/* points: the vertices of a binary PLY file, whatever else it holds. */
#ifndef WH_PIPELINE_POINTS_H
#define WH_PIPELINE_POINTS_H

#include "geom/vec3.h"
#include "io/ply.h"

/*
 * Reads all positions into *points (wh_free); there may be none. WH_E_INPUT for a file that is no
 * binary PLY, whose vertices do not come first or are not of a fixed size, or with a position that
 * is not finite. On failure *points is NULL.
 */
wh_code wh_load_points(wh_ctx *c, const char *path, wh_vec3 **points, uint64_t *n);

#endif
