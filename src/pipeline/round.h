/*
 * round: one pass over all clusters of a store, in parallel: survey, decimate. Cutting anew between
 * two of them is in recut.h.
 */
#ifndef WH_PIPELINE_ROUND_H
#define WH_PIPELINE_ROUND_H

#include "exec/exec.h"
#include "pipeline/cluster.h"
#include "pipeline/progress.h"
#include "pipeline/store.h"

/* What a round left behind; sums and extremes over the clusters. */
typedef struct wh_round_result {
	uint64_t faces, vertices; /* vertices: a cut vertex counts once in every cluster it is in */
	uint64_t unreferenced;    /* dropped by the loads */
	wh_simplify_result work;
} wh_round_result;

/* Adds what another cluster or round did. */
void wh_round_result_add(wh_round_result *sum, const wh_round_result *one);

/*
 * Fits a survey to a share of all pieces of the store (fixed places, one in 64, but four at
 * least): the log of what collapses cost and the number of vertices it is out of.
 */
wh_code wh_round_survey(wh_ctx *c, const wh_exec *ex, wh_progress *progress, const wh_store *store,
                        uint32_t piece_faces, const wh_simplify_params *params, wh_survey *survey);

/* The cost at which a share `keep` of the surveyed vertices is left. */
double wh_survey_cost(const wh_survey *survey, double keep);

/* Bytes that a worker takes for a cluster of these counts in such a store, with `state` bytes for
 * each vertex that the engine's policy keeps. */
size_t wh_round_bytes(const wh_store *store, uint64_t nv, uint64_t nf, size_t state);

/* Decimates every cluster of `from` into `to` (spill, generation and ledger set by the caller; the
 * rest is filled in). `from` stays. Clusters that the ledger has are left as they are. */
wh_code wh_round_reduce(wh_ctx *c, const wh_exec *ex, wh_progress *progress, const wh_store *from,
                        wh_store *to, const wh_cluster_params *params, wh_round_result *result);

/* Removes all cluster files of a store. */
void wh_round_remove(const wh_store *store);

/* Largest counts of one cluster of the store, and the sums over all. */
wh_code wh_round_extent(wh_ctx *c, const wh_store *store, uint64_t *max_vertices,
                        uint64_t *max_faces, uint64_t *faces, uint64_t *vertices);

/* The clusters of the store by falling number of faces, for jobs that may go in any order: when the
 * longest go first, all workers end at about the same time (Graham's LPT rule). The caller frees
 * it; NULL, failure recorded, when memory is refused or a file cannot be read. */
uint64_t *wh_round_longest_first(wh_ctx *c, const wh_store *store);

/* The cluster of a turn of a round from one store to another (wh_ledger_turn): in that order where
 * all are this process' own. False: none. */
bool wh_round_turn(const wh_store *from, const wh_store *to, const uint64_t *order, int64_t turn,
                   uint32_t *cluster);

#endif
