#include "pipeline/hand.h"

static wh_code hand_make(wh_ctx *c, wh_hand *h, const wh_store *s, uint64_t nv, uint64_t nf)
{
	h->work = wh_cluster_work_new(c);
	if (!h->work || wh_store_scratch_fit(c, s, &h->scratch, nv, nf) != WH_OK)
		return c->err.code;
	h->patch.attr_bytes = s->attr_bytes;
	h->patch.face_bytes = s->face_bytes;
	return wh_patch_reset(c, &h->patch, (uint32_t)nv, (uint32_t)nf);
}

wh_hand *wh_hands_make(wh_ctx *c, int workers, const wh_store *s, uint64_t max_vertices,
                       uint64_t max_faces)
{
	wh_hand *h = wh_calloc(c, (size_t)workers, sizeof *h);
	for (int i = 0; h && i < workers; i++)
		if (hand_make(c, &h[i], s, max_vertices, max_faces) != WH_OK)
			break;
	return h;
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
