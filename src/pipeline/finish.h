/*
 * finish: all clusters in memory, stitched; and, when the last pass is done, the output.
 */
#ifndef WH_PIPELINE_FINISH_H
#define WH_PIPELINE_FINISH_H

#include "algo/simplify.h"
#include "io/outfile.h"
#include "io/mesh_write.h"
#include "pipeline/progress.h"
#include "pipeline/store.h"

/* Bytes that the final pass takes on a mesh of these measures, with `state` bytes for each vertex
 * that the engine's policy keeps. */
size_t wh_finish_bytes(uint64_t nv, uint64_t nf, uint32_t attr_bytes, uint32_t face_bytes,
                       size_t state);

/* Loads every cluster into one patch and makes each cut vertex one again: no vertex is cut. */
wh_code wh_finish_stitch(wh_ctx *c, const wh_store *store, wh_progress *progress, wh_patch *p,
                         uint64_t *unreferenced);

/* Writes p, whose positions were multiplied by `scale`, a power of two, to an open output: with so
 * many vertices, more than p has where the style doubles some. */
wh_code wh_finish_write(wh_ctx *c, wh_progress *progress, wh_outfile *out, wh_ply_style style,
                        const wh_patch *p, double scale, uint64_t *vertices);

#endif
