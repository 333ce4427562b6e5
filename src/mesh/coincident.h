/* coincident: vertices at the position of another one, to the last bit (-0 is 0). */
#ifndef WH_MESH_COINCIDENT_H
#define WH_MESH_COINCIDENT_H

#include "base/mem.h"
#include "geom/vec3.h"

/* The same for coincident positions. */
uint64_t wh_coincident_hash(wh_vec3 p);

/*
 * Counts the finite positions among pos[0 .. n-1] that an earlier one has too. When `marks` is
 * not NULL (a bit for each, zero), their bits are set. Takes 16 bytes a position while it runs.
 */
wh_code wh_coincident_count(wh_ctx *c, const wh_vec3 *pos, uint32_t n, uint64_t *marks,
                            uint64_t *count);

#endif
