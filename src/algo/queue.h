/*
 * queue: candidate collapses in near-increasing order of cost.
 *
 * A bucket queue over the leading bits of the cost: the exponent and five bits of mantissa, so
 * that costs within 3 % share a bucket. Push and pop are O(1); a bucket gives back its latest
 * entry first. Costs below the window share the lowest bucket, costs above it the highest.
 * Entries whose stamp is out of date are the caller's to recognise and drop.
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

typedef struct wh_candidate {
	uint32_t u, v;  /* collapse of edge uv; v survives */
	uint32_t stamp; /* sum of both vertices' generations when it was pushed */
	uint32_t next;  /* internal: next entry of the bucket */
} wh_candidate;

typedef struct wh_queue {
	wh_candidate *entry;
	size_t cap;
	uint32_t used;      /* entries ever handed out */
	uint32_t free_head; /* list of entries given back */
	uint32_t size;      /* entries in buckets */
	uint32_t lowest;    /* no bucket below it holds anything */
	int64_t key_base;   /* key of bucket 0 */
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

/* Empties the queue and sets the top of its window: costs up to `top` are told apart. */
void wh_queue_reset(wh_queue *q, double top);

/* Adds a candidate. The queue grows by doubling. */
wh_code wh_queue_push(wh_ctx *c, wh_queue *q, uint32_t bucket, uint32_t u, uint32_t v,
                      uint32_t stamp);

/* Takes a candidate of the lowest bucket. False when the queue is empty. */
bool wh_queue_pop(wh_queue *q, wh_candidate *out, uint32_t *bucket);

/* Drops every candidate whose stamp is not generation[u] + generation[v]. */
void wh_queue_purge(wh_queue *q, const uint32_t *generation);

void wh_queue_free(wh_ctx *c, wh_queue *q);

#endif
