/*
 * round_workspace: what one worker needs to work on one cluster after the other.
 */
#ifndef WH_PIPELINE_ROUND_WORKSPACE_H
#define WH_PIPELINE_ROUND_WORKSPACE_H

#include "pipeline/cluster.h"
#include "pipeline/store.h"

typedef struct wh_round_workspace {
	wh_store_workspace load;
	wh_patch patch;
	wh_cluster_workspace *cluster; /* NULL: not ready */
	const wh_store *store;         /* not owned */
	uint64_t max_vertices, max_faces;
} wh_round_workspace;

/* One for each worker, for clusters of the store up to these counts; none is ready yet. NULL, with
 * the failure recorded in c. */
wh_round_workspace *wh_round_workspaces_make(wh_ctx *c, int workers, const wh_store *s,
                                             uint64_t max_vertices, uint64_t max_faces);

/* Gets its memory, the first time: called by the worker that it is for, so that all do so
 * at once, each next to its own processor. */
wh_code wh_round_workspace_ready(wh_ctx *c, wh_round_workspace *ws);

void wh_round_workspaces_free(wh_ctx *c, wh_round_workspace *ws, int workers);

#endif
