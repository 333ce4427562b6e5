/*
 * bvh: the nearest point of a surface, fast.
 *
 * A tree of boxes over the triangles of a mesh. The tree keeps its own copy of the mesh, in a
 * frame in which coordinates lie within -1 .. 1, with its colours, faces in the order of the tree
 * (neighbours in space are neighbours in it), unreferenced vertices left out. Read-only once built:
 * any number of threads may query it.
 */
#ifndef WH_MESH_BVH_H
#define WH_MESH_BVH_H

#include "exec/exec.h"
#include "mesh/mesh.h"

/* local = (world - origin) * scale; the scale is a power of two. */
typedef struct wh_frame {
	wh_vec3 origin;
	double scale;
} wh_frame;

/* A frame for all points of the box lo .. hi, which is finite. */
wh_frame wh_frame_of_box(wh_vec3 lo, wh_vec3 hi);

static inline wh_vec3 wh_frame_local(const wh_frame *f, wh_vec3 world)
{
	return wh_scale(wh_sub(world, f->origin), f->scale);
}

enum { WH_BVH_WIDTH = 8, WH_BVH_LEVELS = 11 }; /* 8^11 > 2^32 */

/* Eight boxes, one axis after the other; missing ones are inside out. */
typedef struct wh_bvh_node {
	float lo[3][WH_BVH_WIDTH];
	float hi[3][WH_BVH_WIDTH];
} wh_bvh_node;

typedef struct wh_bvh {
	wh_mesh mesh;       /* local coordinates, tree order */
	wh_bvh_node *nodes; /* level by level, from the one whose boxes are triangles */
	int levels;
	uint32_t level_first[WH_BVH_LEVELS]; /* first node of each level */
} wh_bvh;

/*
 * Builds the tree over m, whose faces are valid, at least one, and whose referenced vertices lie
 * in the frame's box; degenerate faces count as the segments or points they are. The result does
 * not depend on ex. On failure *t is empty.
 */
wh_code wh_bvh_build(wh_ctx *c, const wh_exec *ex, const wh_mesh *m, const wh_frame *f, wh_bvh *t);
void wh_bvh_free(wh_ctx *c, wh_bvh *t);

/*
 * Squared distance of p (local, within the frame) from the surface. *hint is a face of the
 * tree that may be near, or WH_NONE; it becomes the nearest face. A good hint, such as that of
 * a point near by, makes the query faster.
 */
double wh_bvh_dist2(const wh_bvh *t, wh_vec3 p, uint32_t *hint);

#endif
