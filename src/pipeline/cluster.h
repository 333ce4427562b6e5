/*
 * cluster: reduces one cluster in memory, itself cut into micro-clusters that fit a cache.
 *
 * The same idea as between clusters, one scale down: micro-clusters are decimated one after the
 * other with the cuts between them locked, then the cluster as a whole, where those cuts are
 * interior. Serial; one workspace a thread.
 */
#ifndef WH_PIPELINE_CLUSTER_H
#define WH_PIPELINE_CLUSTER_H

#include "algo/simplify.h"

typedef struct wh_cluster_params {
	uint32_t micro_faces;   /* faces of a micro-cluster, about; 0: none */
	double micro_cost;      /* cost limit inside micro-clusters */
	wh_simplify_params all; /* of the pass over the whole cluster; with a target all is left
	                           to that pass */
} wh_cluster_params;

typedef struct wh_cluster_workspace wh_cluster_workspace;

wh_cluster_workspace *wh_cluster_workspace_new(wh_ctx *c);
void wh_cluster_workspace_free(wh_ctx *c, wh_cluster_workspace *w);

/* Bytes that reducing (or surveying) a cluster of these measures takes, the patch included. */
size_t wh_cluster_bytes(uint64_t nv, uint64_t nf, uint32_t attr_bytes, uint32_t face_bytes);

/* Reduces p in place. The result has the sums and extremes of all passes; what was found of
 * vertices, and whether more could be done, is the last one's. */
wh_code wh_cluster_reduce(wh_ctx *c, wh_cluster_workspace *w, wh_patch *p,
                          const wh_cluster_params *params, wh_simplify_result *result);

/* What a survey adds up. */
typedef struct wh_survey {
	wh_cost_log *log;
	uint64_t free_vertices; /* that could have been collapsed */
} wh_survey;

/*
 * Cuts p into pieces of about piece_faces faces and decimates `pieces` of them, evenly spread, as
 * far as they go, adding to the survey. p is used up.
 */
wh_code wh_cluster_survey(wh_ctx *c, wh_cluster_workspace *w, wh_patch *p, uint32_t piece_faces,
                          uint32_t pieces, const wh_simplify_params *params, wh_survey *survey);

#endif
