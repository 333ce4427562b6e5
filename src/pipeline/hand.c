#include "pipeline/hand.h"

wh_hand *wh_hands_make(wh_ctx *c, int workers, const wh_store *s, uint64_t max_vertices,
                       uint64_t max_faces)
{
	wh_hand *h = wh_calloc(c, (size_t)workers, sizeof *h);
	for (int i = 0; h && i < workers; i++)
		h[i] = (wh_hand){.store = s, .max_vertices = max_vertices, .max_faces = max_faces};
	return h;
}

wh_code wh_hand_ready(wh_ctx *c, wh_hand *h)
{
	if (h->work)
		return WH_OK;
	h->patch.attr_bytes = h->store->attr_bytes;
	h->patch.face_bytes = h->store->face_bytes;
	if (wh_store_scratch_fit(c, h->store, &h->scratch, h->max_vertices, h->max_faces) !=
	        WH_OK ||
	    wh_patch_reset(c, &h->patch, (uint32_t)h->max_vertices, (uint32_t)h->max_faces) !=
	        WH_OK)
		return c->err.code;
	h->work = wh_cluster_work_new(c);
	return c->err.code;
}

void wh_hands_free(wh_ctx *c, wh_hand *h, int workers)
{
	for (int i = 0; h && i < workers; i++) {
		wh_store_scratch_free(c, &h[i].scratch);
		wh_patch_free(c, &h[i].patch);
		wh_cluster_work_free(c, h[i].work);
	}
	wh_free(c, h);
}
