/*
 * twins: which vertices of a source are copies of one along the borders of a texture's charts.
 *
 * Two faces that use an edge between the same two positions, in opposite directions and through
 * different vertices, are neighbours that were cut apart, as long as no third face has such an
 * edge: their vertices there are copies of each other. Of copies the one with the least id stays.
 */
#ifndef WH_PIPELINE_TWINS_H
#define WH_PIPELINE_TWINS_H

#include "pipeline/near.h"

/*
 * Fills `twins` with a pair for each copy that goes, and `kept` (nothing set, room for all
 * vertices) with those that stay. `window`: vertices of a window of pairs. WH_E_IRREGULAR as
 * wh_source_triangles. On failure *twins can only be closed.
 */
wh_code wh_twins_find(wh_ctx *c, const wh_exec *ex, wh_progress *progress, wh_spill *spill,
                      const wh_source *source, uint64_t window, wh_rank *kept, wh_near *twins);

/* Memory that finding takes with so many workers and such a window, about. */
size_t wh_twins_bytes(const wh_source *source, int workers, uint64_t window);

#endif
