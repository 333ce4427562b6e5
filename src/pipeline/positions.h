/*
 * positions: single vertices of a source by id, through a cache of pages.
 *
 * For the corners of polygons, whose ids are mostly near each other. Direct-mapped, of some MiB at
 * most whatever the file's size. One per worker: not thread-safe.
 */
#ifndef WH_PIPELINE_POSITIONS_H
#define WH_PIPELINE_POSITIONS_H

#include "geom/vec3.h"
#include "io/ply.h"

typedef struct wh_positions {
	const wh_source *source;
	size_t slots;   /* a power of two */
	uint64_t *tags; /* slots: number of the page held + 1, 0 for none */
	wh_vec3 *pages;
	void *raw;
} wh_positions;

enum { WH_POSITIONS_MOST = 256, WH_POSITIONS_FEW = 64 }; /* pages: 12 and 3 MiB */

/* `source` must live as long; its vertices must be readable by now. At most so many pages, a power
 * of two. */
wh_code wh_positions_open(wh_ctx *c, wh_positions *p, const wh_source *source, size_t most);
void wh_positions_close(wh_ctx *c, wh_positions *p);

/* Position of vertex id < nv. */
wh_code wh_positions_get(wh_ctx *c, wh_positions *p, uint64_t id, wh_vec3 *pos);

#endif
