/*
 * rank: a bit for each of many items, and how many are set before any of them.
 *
 * What is left of a list when some of its items go gets its new numbers so. A bit an item, and an
 * eighth more for the directory. Bits are set or cleared freely until they are counted.
 */
#ifndef WH_BASE_RANK_H
#define WH_BASE_RANK_H

#include "base/mem.h"

enum {
	WH_RANK_WORD = 64, /* bits */
	WH_RANK_LOT = 8    /* words between two counts */
};

typedef struct wh_rank {
	uint64_t *bits;
	uint64_t *before; /* bits before each lot of words */
	uint64_t words;
} wh_rank;

/* All bits zero. */
static inline wh_code wh_rank_open(wh_ctx *c, wh_rank *r, uint64_t items)
{
	r->words = items / WH_RANK_WORD + 1;
	r->bits = wh_calloc(c, (size_t)r->words, sizeof *r->bits);
	r->before = wh_alloc(c, (size_t)(r->words / WH_RANK_LOT + 1), sizeof *r->before);
	return r->bits && r->before ? WH_OK : wh_failed(c);
}

static inline void wh_rank_close(wh_ctx *c, wh_rank *r)
{
	wh_free(c, r->bits);
	wh_free(c, r->before);
	*r = (wh_rank){0};
}

static inline size_t wh_rank_bytes(uint64_t items)
{
	return (size_t)(items / 8 + items / WH_RANK_WORD) + 64;
}

static inline bool wh_rank_get(const wh_rank *r, uint64_t i)
{
	return r->bits[i / WH_RANK_WORD] >> i % WH_RANK_WORD & 1;
}

/* Several threads may set, or may clear. */
static inline void wh_rank_set(wh_rank *r, uint64_t i)
{
	(void)__atomic_fetch_or(&r->bits[i / WH_RANK_WORD], UINT64_C(1) << i % WH_RANK_WORD,
	                        __ATOMIC_RELAXED);
}

static inline void wh_rank_clear(wh_rank *r, uint64_t i)
{
	(void)__atomic_fetch_and(&r->bits[i / WH_RANK_WORD], ~(UINT64_C(1) << i % WH_RANK_WORD),
	                         __ATOMIC_RELAXED);
}

/* The bits are as they will be: counts them, and returns how many are set. */
static inline uint64_t wh_rank_count(wh_rank *r)
{
	uint64_t n = 0;
	for (uint64_t i = 0; i < r->words; i++) {
		if (i % WH_RANK_LOT == 0)
			r->before[i / WH_RANK_LOT] = n;
		n += (uint64_t)__builtin_popcountll(r->bits[i]);
	}
	return n;
}

/* Bits set before item i. */
static inline uint64_t wh_rank_of(const wh_rank *r, uint64_t item)
{
	const uint64_t word = item / WH_RANK_WORD;
	uint64_t n = r->before[word / WH_RANK_LOT];
	for (uint64_t i = word / WH_RANK_LOT * WH_RANK_LOT; i < word; i++)
		n += (uint64_t)__builtin_popcountll(r->bits[i]);
	const uint64_t below = (UINT64_C(1) << item % WH_RANK_WORD) - 1;
	return n + (uint64_t)__builtin_popcountll(r->bits[word] & below);
}

#endif
