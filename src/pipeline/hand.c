#include "pipeline/hand.h"

wh_hand *wh_hands_make(wh_ctx *c, int workers)
{
	wh_hand *h = wh_calloc(c, (size_t)workers, sizeof *h);
	for (int i = 0; h && i < workers; i++)
		h[i].work = wh_cluster_work_new(c);
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
