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
	wh_cluster_work *work;
} wh_hand;

/* One for each worker, with room for the largest clusters of the store. Returns NULL, or an
 * incomplete array that can be freed, with the failure recorded in c. */
wh_hand *wh_hands_make(wh_ctx *c, int workers, const wh_store *s, uint64_t max_vertices,
                       uint64_t max_faces);
void wh_hands_free(wh_ctx *c, wh_hand *h, int workers);

#endif
