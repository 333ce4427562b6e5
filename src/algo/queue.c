#include "algo/queue.h"

#define NIL UINT32_MAX

void wh_queue_reset(wh_queue *q, double top)
{
	memset(q->head, 0xff, sizeof q->head);
	q->used = 0;
	q->free_head = NIL;
	q->size = 0;
	q->lowest = WH_QUEUE_BUCKETS;
	q->key_base = wh_cost_key(top) - (WH_QUEUE_BUCKETS - 1);
}

wh_code wh_queue_push(wh_ctx *c, wh_queue *q, uint32_t bucket, uint32_t u, uint32_t v,
                      uint32_t stamp)
{
	uint32_t i = q->free_head;
	if (i != NIL) {
		q->free_head = q->entry[i].next;
	} else {
		if (wh_reserve(c, &q->entry, &q->cap, (size_t)q->used + 1, sizeof *q->entry) !=
		    WH_OK)
			return c->err.code;
		i = q->used++;
	}
	q->entry[i] = (wh_candidate){u, v, stamp, q->head[bucket]};
	q->head[bucket] = i;
	q->size++;
	if (bucket < q->lowest)
		q->lowest = bucket;
	return WH_OK;
}

bool wh_queue_pop(wh_queue *q, wh_candidate *out, uint32_t *bucket)
{
	while (q->lowest < WH_QUEUE_BUCKETS && q->head[q->lowest] == NIL)
		q->lowest++;
	if (q->lowest == WH_QUEUE_BUCKETS)
		return false;
	const uint32_t i = q->head[q->lowest];
	*out = q->entry[i];
	*bucket = q->lowest;
	q->head[q->lowest] = out->next;
	q->entry[i].next = q->free_head;
	q->free_head = i;
	q->size--;
	return true;
}

void wh_queue_purge(wh_queue *q, const uint32_t *generation)
{
	for (uint32_t b = q->lowest; b < WH_QUEUE_BUCKETS; b++) {
		uint32_t *link = &q->head[b];
		while (*link != NIL) {
			const uint32_t i = *link;
			wh_candidate *e = &q->entry[i];
			if (e->stamp == generation[e->u] + generation[e->v]) {
				link = &e->next;
				continue;
			}
			*link = e->next;
			e->next = q->free_head;
			q->free_head = i;
			q->size--;
		}
	}
}

void wh_queue_free(wh_ctx *c, wh_queue *q)
{
	wh_free(c, q->entry);
	q->entry = NULL;
	q->cap = 0;
}
