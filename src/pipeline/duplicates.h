/* duplicates: coincident vertices of a source that need not fit memory. */
#ifndef WH_PIPELINE_DUPLICATES_H
#define WH_PIPELINE_DUPLICATES_H

#include "exec/exec.h"
#include "io/ply.h"
#include "pipeline/progress.h"

/*
 * Counts the vertices at the position of one with a smaller id. Reads all vertices as many times
 * as it takes to hold a share of them in `budget` bytes (26 each, and 2 MiB a worker); WH_E_PLAN
 * when that is a thousand times.
 */
wh_code wh_duplicate_vertices(wh_ctx *c, const wh_exec *ex, wh_progress *progress,
                              const wh_source *src, size_t budget, uint64_t *count);

#endif
