/*
 * fit: what part of space a picture is to show.
 *
 * Most files are shown whole. Vertices that are absurdly far from nearly all others (a scanner's
 * stray point at 1e30) would leave nothing to see of the rest: beyond a fence around the bulk of
 * a sample they do not count. The fence is 25 times as wide as the box around all but a fiftieth
 * of the sample, so that nothing that belongs to a mesh is left out.
 */
#ifndef WH_PIPELINE_FIT_H
#define WH_PIPELINE_FIT_H

#include "exec/exec.h"
#include "geom/camera.h"
#include "io/ply.h"
#include "pipeline/progress.h"

typedef struct wh_box {
	wh_vec3 lo, hi;
} wh_box;

typedef struct wh_fit {
	wh_box fence; /* vertices in it count, ... */
	wh_box box;   /* ... and this is around them: exact, or from the sample where some do not */
	double lo[2], hi[2]; /* of their places on the picture, see wh_fit_camera */
} wh_fit;

/* Boxes around nothing: to begin with. */
wh_fit wh_fit_none(void);

/* Bytes that either pass over the vertices takes. */
size_t wh_fit_bytes(const wh_source *s, const wh_exec *ex);

/* Makes fence and box larger by those of a source's vertices. */
wh_code wh_fit_box(wh_ctx *c, const wh_exec *ex, wh_progress *progress, const wh_source *s,
                   wh_fit *f);

/* Makes lo and hi larger by the places of the vertices inside the fence, as the camera, which is
 * not fitted yet, gives them. */
wh_code wh_fit_camera(wh_ctx *c, const wh_exec *ex, wh_progress *progress, const wh_source *s,
                      const wh_camera *k, wh_fit *f);

#endif
