/*
 * settle: a round over the clusters of a store that ends at an exact count of faces or vertices,
 * for meshes too large for one last pass in memory.
 *
 * Every cluster is reduced on trial, its collapses are logged, and a common cut through all logs
 * says where each cluster has to stop (pipeline/quota.h). Then the collapses up to there are done
 * again (pipeline/rerun.h).
 */
#ifndef WH_PIPELINE_SETTLE_H
#define WH_PIPELINE_SETTLE_H

#include "exec/exec.h"
#include "pipeline/progress.h"
#include "pipeline/round.h"

typedef struct wh_settle_params {
	uint64_t faces, vertices; /* to give up, of all clusters together; 0: no limit. With both,
	                             the one reached first counts */
	wh_simplify_params all;   /* its max_cost bounds the trial: as little above the final one
	                             as is certain to be enough */
} wh_settle_params;

typedef struct wh_settle_result {
	wh_round_result round;
	bool reached;  /* what was to be given up was given up, but perhaps for one face */
	bool one_less; /* one face more than asked for went: parity forbids the count */
} wh_settle_result;

/*
 * Reduces `from` into `to` (spill, generation and ledger set by the caller; the rest is filled in;
 * what the ledger has is not done again). When
 * the clusters cannot give up as much within max_cost, and `partly` is false, nothing is done and
 * `to` does not exist; with it they give up all they can. With a ledger that wants a part of the
 * clusters, these are tried, and no more is done.
 */
wh_code wh_settle(wh_ctx *c, const wh_exec *ex, wh_progress *progress, const wh_store *from,
                  wh_store *to, const wh_settle_params *params, bool partly,
                  wh_settle_result *result);

#endif
