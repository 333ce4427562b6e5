/*
 * quota: how many faces each cluster gives up, so that all of them together hit a count exactly.
 *
 * Every cluster is reduced once on trial and its collapses are logged. All collapses are then put
 * into one order, by (cost, cluster, place in the cluster's own order), and cut where the count is
 * reached: what lies before the cut is, for every cluster, the beginning of its own run, which can
 * be done again. Costs count by the bins of the log, within 4.4 % of each other.
 *
 * Memory: twelve bytes for each bin that a cluster has collapses in, some hundreds.
 */
#ifndef WH_PIPELINE_QUOTA_H
#define WH_PIPELINE_QUOTA_H

#include "algo/simplify.h"

/* One bin of a cluster's log that is not empty. */
typedef struct wh_quota_bin {
	uint32_t bin, collapses, faces;
} wh_quota_bin;

/* A cluster's log, bins ascending. */
typedef struct wh_quota_log {
	wh_quota_bin *item;
	uint32_t n;
} wh_quota_log;

/* What a cluster gives up. */
typedef struct wh_quota {
	uint64_t faces, vertices;
} wh_quota;

/* Keeps the bins of a log that are not empty. Free with wh_free(log->item). */
wh_code wh_quota_note(wh_ctx *c, wh_quota_log *log, const wh_cost_log *full);

/*
 * Shares out `faces` and `vertices` among the clusters; 0 of either asks for none of it, and with
 * both the one that is reached first in the common order counts. Returns what all shares sum up
 * to: it falls short where the logs do. In the one cluster where the order is cut, the last
 * collapse may take one face more than asked for.
 */
wh_code wh_quota_share(wh_ctx *c, const wh_quota_log *log, uint32_t clusters, uint64_t faces,
                       uint64_t vertices, wh_quota *share, wh_quota *sum);

#endif
