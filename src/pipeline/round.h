/*
 * round: one pass over all clusters of a store, in parallel: survey, decimate, cut anew.
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
 * Fits a survey to a share of all pieces of the store (fixed places, at most one in 64 and no
 * fewer than four): the log of what collapses cost and the number of vertices it is out of.
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
wh_code wh_round_recut(wh_ctx *c, const wh_exec *ex, wh_progress *progress, const wh_store *from,
                       wh_store *to, const wh_recut_params *params, uint64_t *never_free);

/* Bytes that cutting anew takes with one worker and the smallest buffers; `from` needs its layout
 * and its number of clusters only. */
size_t wh_round_recut_bytes(const wh_store *from, uint32_t clusters, uint64_t max_vertices,
                            uint64_t max_faces, uint64_t vertices);

/*
 * Makes the most of `budget` bytes for cutting anew into so many clusters: lowers the workers in
 * *ex until they fit, sets the write buffer, and tells in *need what this takes: more than the
 * budget when the least is too much.
 */
wh_code wh_round_recut_fit(wh_ctx *c, const wh_store *from, uint32_t clusters, size_t budget,
                           wh_exec *ex, size_t *buffer, size_t *need);

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
