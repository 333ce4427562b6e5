/*
 * frame: coordinates in which most of some points lie within -1 .. 1.
 *
 * Points absurdly far from nearly all others (a scanner's stray vertex at 1e30) decide neither
 * origin nor scale: the rest keeps its precision, and they lie far out.
 */
#ifndef WH_MESH_FRAME_H
#define WH_MESH_FRAME_H

#include "base/mem.h"
#include "geom/vec3.h"

/* local = (world - origin) * scale; the scale is a power of two. */
typedef struct wh_frame {
	wh_vec3 origin;
	double scale;
} wh_frame;

/*
 * A frame for points of which n >= 1 are a sample, reordered here, and which all lie in the box
 * lo .. hi; all finite. Local coordinates are below 2^162.
 */
wh_frame wh_frame_of_points(wh_vec3 *points, size_t n, wh_vec3 lo, wh_vec3 hi);

static inline wh_vec3 wh_frame_local(const wh_frame *f, wh_vec3 world)
{
	return wh_sub(wh_scale(world, f->scale), wh_scale(f->origin, f->scale));
}

#endif
