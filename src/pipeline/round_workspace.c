#include "pipeline/round_workspace.h"

wh_round_workspace *wh_round_workspaces_make(wh_ctx *c, int workers, const wh_store *s,
                                             uint64_t max_vertices, uint64_t max_faces)
{
	wh_round_workspace *ws = wh_calloc(c, (size_t)workers, sizeof *ws);
	for (int i = 0; ws && i < workers; i++)
		ws[i] = (wh_round_workspace){
		    .store = s, .max_vertices = max_vertices, .max_faces = max_faces};
	return ws;
}

wh_code wh_round_workspace_ready(wh_ctx *c, wh_round_workspace *ws)
{
	if (ws->cluster)
		return WH_OK;
	ws->patch.attr_bytes = ws->store->attr_bytes;
	ws->patch.face_bytes = ws->store->face_bytes;
	if (wh_store_workspace_fit(c, ws->store, &ws->load, ws->max_vertices, ws->max_faces) !=
	        WH_OK ||
	    wh_patch_reset(c, &ws->patch, (uint32_t)ws->max_vertices, (uint32_t)ws->max_faces) !=
	        WH_OK)
		return c->err.code;
	ws->cluster = wh_cluster_workspace_new(c);
	return c->err.code;
}

void wh_round_workspaces_free(wh_ctx *c, wh_round_workspace *ws, int workers)
{
	for (int i = 0; ws && i < workers; i++) {
		wh_store_workspace_free(c, &ws[i].load);
		wh_patch_free(c, &ws[i].patch);
		wh_cluster_workspace_free(c, ws[i].cluster);
	}
	wh_free(c, ws);
}
