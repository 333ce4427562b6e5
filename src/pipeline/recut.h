/*
 * recut: the mesh of a store, cut anew between two rounds, in parallel.
 */
#ifndef WH_PIPELINE_RECUT_H
#define WH_PIPELINE_RECUT_H

#include "exec/exec.h"
#include "pipeline/progress.h"
#include "pipeline/store.h"

typedef struct wh_recut_params {
	double skew;   /* in (0, 1): share of the cells left of each cut; another one, other cuts */
	size_t buffer; /* bytes of write buffer a cluster */
	bool free_all; /* keep the cuts away from vertices that were cut in every round */
} wh_recut_params;

/*
 * Cuts the mesh of `from` into `to->clusters` other clusters. Local corners become global ids;
 * vertices that only one new cluster uses are free again. *never_free: those that were cut in
 * every round so far, and are in the next one; 65536 of them may be more.
 */
wh_code wh_recut(wh_ctx *c, const wh_exec *ex, wh_progress *progress, const wh_store *from,
                 wh_store *to, const wh_recut_params *params, uint64_t *never_free);

/* Bytes that cutting anew takes with one worker and the smallest buffers; `from` needs its layout
 * and its number of clusters only. */
size_t wh_recut_bytes(const wh_store *from, uint32_t clusters, uint64_t max_vertices,
                      uint64_t max_faces, uint64_t vertices);

/*
 * Makes the most of `budget` bytes for cutting anew into so many clusters: lowers the workers in
 * *ex until they fit, sets the write buffer, and tells in *need what this takes: more than the
 * budget when the least is too much.
 */
wh_code wh_recut_fit(wh_ctx *c, const wh_store *from, uint32_t clusters, size_t budget, wh_exec *ex,
                     size_t *buffer, size_t *need);

#endif
