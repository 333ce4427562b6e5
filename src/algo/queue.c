#include "algo/queue.h"

#define NIL UINT32_MAX
#define FIRST 0x80000000u /* in `last`: the rest is the bucket */

wh_code wh_queue_reset(wh_ctx *c, wh_queue *q, uint32_t n, double top)
{
	if (wh_renew(c, &q->link, &q->cap, n, sizeof *q->link) != WH_OK)
		return c->err.code;
	memset(q->link, 0xff, n * sizeof *q->link);
	memset(q->head, 0xff, sizeof q->head);
	q->size = 0;
	q->lowest = WH_QUEUE_BUCKETS;
	q->key_base = wh_cost_key(top) - (WH_QUEUE_BUCKETS - 1);
	return WH_OK;
}

void wh_queue_push(wh_queue *q, uint32_t v, uint32_t bucket)
{
	const uint32_t next = q->head[bucket];
	q->link[v] = (wh_queue_link){FIRST | bucket, next};
	if (next != NIL)
		q->link[next].last = v;
	q->head[bucket] = v;
	q->size++;
	if (bucket < q->lowest)
		q->lowest = bucket;
}

void wh_queue_remove(wh_queue *q, uint32_t v)
{
	const wh_queue_link l = q->link[v];
	if (l.last == NIL)
		return;
	if (l.last & FIRST)
		q->head[l.last & ~FIRST] = l.next;
	else
		q->link[l.last].next = l.next;
	if (l.next != NIL)
		q->link[l.next].last = l.last;
	q->link[v].last = NIL;
	q->size--;
}

bool wh_queue_pop(wh_queue *q, uint32_t *v, uint32_t *bucket)
{
	while (q->lowest < WH_QUEUE_BUCKETS && q->head[q->lowest] == NIL)
		q->lowest++;
	if (q->lowest == WH_QUEUE_BUCKETS)
		return false;
	*v = q->head[q->lowest];
	*bucket = q->lowest;
	wh_queue_remove(q, *v);
	return true;
}

void wh_queue_free(wh_ctx *c, wh_queue *q)
{
	wh_free(c, q->link);
	q->link = NULL;
	q->cap = 0;
}
