/*
 * hand: what one worker needs to work on one cluster after the other.
 */
#ifndef WH_PIPELINE_HAND_H
#define WH_PIPELINE_HAND_H

#include "pipeline/cluster.h"
#include "pipeline/store.h"

typedef struct wh_hand {
	wh_store_scratch scratch;
	wh_patch patch;
	wh_cluster_work *work; /* NULL: not ready */
	const wh_store *store; /* not owned */
	uint64_t max_vertices, max_faces;
} wh_hand;

/* One for each worker, for clusters of the store up to these counts; none is ready yet. NULL, with
 * the failure recorded in c. */
wh_hand *wh_hands_make(wh_ctx *c, int workers, const wh_store *s, uint64_t max_vertices,
                       uint64_t max_faces);

/* Gets the memory of a hand, the first time: called by the worker that it is for, so that all do so
 * at once, each next to its own processor. */
wh_code wh_hand_ready(wh_ctx *c, wh_hand *h);

void wh_hands_free(wh_ctx *c, wh_hand *h, int workers);

#endif
