/*
 * emit: the clusters of a store to one output, in their order, never more of them in memory than
 * there are workers.
 *
 * Two passes: vertices, then faces. Each cluster's vertices are in the order of a space-filling
 * curve. A cut vertex is written by the first cluster that has it; a table of the cut vertices
 * tells the others its number. Where the style doubles vertices whose corners differ, a pass before
 * these counts them.
 */
#ifndef WH_PIPELINE_EMIT_H
#define WH_PIPELINE_EMIT_H

#include "exec/exec.h"
#include "io/outfile.h"
#include "io/mesh_write.h"
#include "pipeline/progress.h"
#include "pipeline/store.h"

/* Bytes that a worker takes for a cluster of these counts in such a store; `doubled` as the style
 * has it. */
size_t wh_emit_bytes(const wh_store *store, const struct wh_attributes *doubled, uint64_t nv,
                     uint64_t nf);

/*
 * Writes header, vertices (whose positions were multiplied by `scale`, a power of two) and faces to
 * an open output. The counts are those of the whole mesh, with each cut vertex counted once;
 * *vertices becomes what was written.
 */
wh_code wh_emit(wh_ctx *c, const wh_exec *ex, wh_progress *progress, const wh_store *store,
                wh_outfile *out, wh_ply_style style, double scale, uint64_t *vertices,
                uint64_t faces);

#endif
