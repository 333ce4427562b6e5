/*
 * queue: vertices in near-increasing order of what their cheapest collapse costs.
 *
 * A bucket queue over the leading bits of the cost: the exponent and five bits of mantissa, so
 * that costs within 3 % share a bucket. A vertex is in it once at most. All is O(1); a bucket gives
 * back its latest entry first. Costs below the window share the lowest bucket, costs above it the
 * highest.
 */
#ifndef WH_ALGO_QUEUE_H
#define WH_ALGO_QUEUE_H

#include "base/mem.h"

#include <string.h>

enum {
	WH_QUEUE_MANTISSA = 5,    /* bits of mantissa in a key */
	WH_QUEUE_EXPONENTS = 192, /* powers of two below the top that are told apart */
	WH_QUEUE_BUCKETS = WH_QUEUE_EXPONENTS << WH_QUEUE_MANTISSA
};

/* Neighbours in the list of a bucket. `last` of its first entry tells the bucket. */
typedef struct wh_queue_link {
	uint32_t last, next;
} wh_queue_link;

typedef struct wh_queue {
	wh_queue_link *link; /* one for each vertex */
	size_t cap;
	uint32_t size;    /* vertices in buckets */
	uint32_t lowest;  /* no bucket below it holds anything */
	int64_t key_base; /* key of bucket 0 */
	uint32_t head[WH_QUEUE_BUCKETS];
} wh_queue;

/* Bits of a cost that decide its order: monotone for costs >= 0. */
static inline int64_t wh_cost_key(double cost)
{
	int64_t bits;
	memcpy(&bits, &cost, sizeof bits);
	return bits >> (52 - WH_QUEUE_MANTISSA);
}

/* The bucket of a cost in this queue. */
static inline uint32_t wh_queue_bucket(const wh_queue *q, double cost)
{
	const int64_t k = wh_cost_key(cost) - q->key_base;
	if (k < 0)
		return 0;
	return k < WH_QUEUE_BUCKETS ? (uint32_t)k : WH_QUEUE_BUCKETS - 1;
}

/* Empties the queue, makes room for vertices 0 to n - 1, n < 2^31, and sets the top of its window:
 * costs up to `top` are told apart. */
wh_code wh_queue_reset(wh_ctx *c, wh_queue *q, uint32_t n, double top);

/* Puts v into a bucket; it must not be in the queue. */
void wh_queue_push(wh_queue *q, uint32_t v, uint32_t bucket);

/* Takes v out, if it is in. */
void wh_queue_remove(wh_queue *q, uint32_t v);

/* Takes a vertex of the lowest bucket. False when the queue is empty. */
bool wh_queue_pop(wh_queue *q, uint32_t *v, uint32_t *bucket);

void wh_queue_free(wh_ctx *c, wh_queue *q);

#endif
