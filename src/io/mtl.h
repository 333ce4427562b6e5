/*
 * mtl: files of materials (Wavefront MTL): the texture of each.
 */
#ifndef WH_IO_MTL_H
#define WH_IO_MTL_H

#include "io/names.h"

/* For each of the materials of a mesh, which of the textures it has (map_Kd); UINT32_MAX: none. */
typedef struct wh_mtl {
	wh_names textures;
	uint32_t *of; /* materials->n, owned */
} wh_mtl;

/* Goes through the libraries, files beside `mesh` (or wherever their names say); those that cannot
 * be read are passed over. */
wh_code wh_mtl_read(wh_ctx *c, const char *mesh, const wh_names *libraries,
                    const wh_names *materials, wh_mtl *m);
void wh_mtl_free(wh_ctx *c, wh_mtl *m);

/* Where a file is that `mesh` names: beside it, unless the name begins with /. To be freed. */
char *wh_beside(wh_ctx *c, const char *mesh, const char *name);

#endif
