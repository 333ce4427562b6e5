/*
 * polygon: cuts a polygon into triangles by a rule from positions and ids alone.
 *
 * The result does not depend on which corner the list starts with, as long as the smallest id
 * occurs once. Thread-safe with one workspace per thread.
 */
#ifndef WH_GEOM_POLYGON_H
#define WH_GEOM_POLYGON_H

#include "geom/vec3.h"

#include <stddef.h>
#include <stdint.h>

/* Larger polygons are not cut by ears, whose cost is quadratic: their caller makes a fan of them
 * from the corner of smallest id. */
enum { WH_POLYGON_MOST = 4096 };

typedef struct wh_polygon_workspace {
	double x[WH_POLYGON_MOST], y[WH_POLYGON_MOST]; /* corners in the polygon's plane */
	uint32_t next[WH_POLYGON_MOST], prev[WH_POLYGON_MOST];
	uint8_t reflex[WH_POLYGON_MOST];
} wh_polygon_workspace;

/*
 * Cuts the polygon of n corners (3 <= n <= WH_POLYGON_MOST) at positions `pos` with ids `ids`.
 * Writes n - 2 triangles as numbers of corners, 3 each, in the winding of the polygon, and
 * returns their count. Works, if not prettily, on crossed, flat and zero-size polygons too.
 */
size_t wh_polygon_cut(const wh_vec3 *pos, const uint64_t *ids, size_t n, uint32_t *corners,
                      wh_polygon_workspace *s);

#endif
