/* points: the vertices of a binary PLY file, whatever else it holds. */
#ifndef WH_PIPELINE_POINTS_H
#define WH_PIPELINE_POINTS_H

#include "geom/vec3.h"
#include "io/ply.h"

typedef struct wh_points {
	wh_ply file;
	wh_source source;
	uint64_t n; /* there may be none */
} wh_points;

/* Opens the file. WH_E_INPUT for one that is no binary PLY, or whose vertices do not come first or
 * are not of a fixed size. Close it unless that fails; zero-initialised, it may be closed, too. */
wh_code wh_points_open(wh_ctx *c, const char *path, wh_points *p);
void wh_points_close(wh_ctx *c, wh_points *p);

/* Reads points first .. first+n-1 of the wh_points `user`. WH_E_INPUT for a position that is not
 * finite. Thread-safe. */
wh_code wh_points_get(wh_ctx *c, void *user, uint64_t first, size_t n, wh_vec3 *points);

#endif
