/*
 * polish: what is done to a result besides collapses, on its way out: it is smoothed, and gets
 * normals that are its own.
 */
#ifndef WH_PIPELINE_POLISH_H
#define WH_PIPELINE_POLISH_H

#include "io/mesh_write.h"
#include "mesh/patch.h"

typedef struct wh_polish {
	uint32_t smooth; /* how often; 0: not at all */
	bool normals;    /* of vertices, from the faces: in the place of those there are, or new */
} wh_polish;

/* A result as it is to be seen. Zero-initialise; free with wh_polished_free. */
typedef struct wh_polished {
	wh_patch patch; /* but for positions and attributes it is the one that was given */
	wh_attributes attributes; /* where there were no normals */
} wh_polished;

static inline bool wh_polish_is_any(const wh_polish *p)
{
	return p->smooth > 0 || p->normals;
}

/* Bytes that it takes beside a patch of these counts. */
size_t wh_polish_bytes(uint64_t nv, uint64_t nf, uint32_t attr_bytes);

/* WH_E_USAGE where normals are asked for and go with corners of faces, or there is something else
 * that is called like them. */
wh_code wh_polish_check(wh_ctx *c, const wh_polish *polish, const wh_ply_style *style);

/* Polishes a copy of p, which stays; *style, which was checked, becomes that of the copy. */
wh_code wh_polish_patch(wh_ctx *c, const wh_patch *p, const wh_polish *polish, wh_ply_style *style,
                        wh_polished *out);
void wh_polished_free(wh_ctx *c, wh_polished *out);

#endif
