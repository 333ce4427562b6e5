/*
 * separate: makes a patch manifold by doubling vertices (Gueziec, Taubin, Lazarus, Horn, "Cutting
 * and stitching: converting sets of polygons to manifold surfaces", 2001, their local cut).
 *
 * Edges that two faces use in opposite directions hold their faces together; all others, with more
 * faces or with two that go the same way, are cut. What is left around a vertex is one or more
 * fans; each gets a vertex of its own at the same place. So every edge has two faces at most, and
 * every vertex one fan. Faces stay as they are, but two that are now a part of their own, lying on
 * each other, go.
 */
#ifndef WH_MESH_SEPARATE_H
#define WH_MESH_SEPARATE_H

#include "mesh/patch.h"

typedef struct wh_separated {
	uint64_t doubled; /* vertices added */
	uint64_t pillows; /* pairs of faces that went */
} wh_separated;

/*
 * Doubles the vertices of p that are not manifold. New ones come behind the others, with gids from
 * `next_gid` on; vertices left without faces are dropped. O(nv + nf log d), d the faces of a
 * vertex. On failure the patch can be freed only.
 */
wh_code wh_separate(wh_ctx *c, wh_patch *p, uint64_t next_gid, wh_separated *result);

#endif
