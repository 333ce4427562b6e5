/*
 * order: a patch's vertices along a space-filling curve (Morton), its faces by their first vertex.
 *
 * For locality and for outputs that do not depend on how a patch came about: the same vertices
 * and faces, in whatever order, give the same bytes when no two vertices share a curve cell.
 */
#ifndef WH_MESH_ORDER_H
#define WH_MESH_ORDER_H

#include "mesh/patch.h"

/* Reorders p in place; faces are turned so that their least vertex comes first. */
wh_code wh_patch_order(wh_ctx *c, wh_patch *p);

/* Bytes that takes besides the patch. */
size_t wh_patch_order_bytes(uint64_t nv, uint64_t nf);

#endif
