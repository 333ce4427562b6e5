/*
 * permute: a seeded bijection of [0, n) and its inverse, computed on the fly in O(1) memory.
 *
 * An unbalanced Feistel network permutes the smallest power of two that holds n; values that
 * fall outside [0, n) are sent through it again until they come back inside (cycle walking),
 * fewer than two trips on average. Scatters well; it is no cipher.
 */
#ifndef WH_BASE_PERMUTE_H
#define WH_BASE_PERMUTE_H

#include "base/rng.h"

enum { WH_PERMUTE_ROUNDS = 4 }; /* even: the two halves take turns */

typedef struct wh_permute {
	uint64_t n;
	int low_bits;
	uint64_t low_mask, high_mask;
	uint64_t key[WH_PERMUTE_ROUNDS];
} wh_permute;

/* n may be 0 (then nothing can be asked) up to 2^62. */
static inline wh_permute wh_permute_make(uint64_t seed, uint64_t n)
{
	int bits = 2;
	while ((UINT64_C(1) << bits) < n)
		bits++;
	wh_permute p = {.n = n, .low_bits = bits / 2};
	p.low_mask = (UINT64_C(1) << p.low_bits) - 1;
	p.high_mask = (UINT64_C(1) << (bits - p.low_bits)) - 1;
	wh_rng rng = wh_rng_seed(seed);
	for (int i = 0; i < WH_PERMUTE_ROUNDS; i++)
		p.key[i] = wh_rng_next(&rng);
	return p;
}

/* The round function: any mix will do, as it is never inverted. */
static inline uint64_t wh_permute_round(uint64_t half, uint64_t key)
{
	uint64_t x = (half ^ key) * 0x9fb21c651e98df25u;
	x ^= x >> 32;
	return (x * 0xd6e8feb86659fd93u) >> 32;
}

/* Where x goes; x < n. */
static inline uint64_t wh_permute_at(const wh_permute *p, uint64_t x)
{
	do {
		uint64_t low = x & p->low_mask;
		uint64_t high = x >> p->low_bits;
		for (int i = 0; i < WH_PERMUTE_ROUNDS; i += 2) {
			high ^= wh_permute_round(low, p->key[i]) & p->high_mask;
			low ^= wh_permute_round(high, p->key[i + 1]) & p->low_mask;
		}
		x = high << p->low_bits | low;
	} while (x >= p->n);
	return x;
}

/* Where y came from: wh_permute_at(p, wh_permute_source(p, y)) == y. */
static inline uint64_t wh_permute_source(const wh_permute *p, uint64_t y)
{
	do {
		uint64_t low = y & p->low_mask;
		uint64_t high = y >> p->low_bits;
		for (int i = WH_PERMUTE_ROUNDS - 2; i >= 0; i -= 2) {
			low ^= wh_permute_round(high, p->key[i + 1]) & p->low_mask;
			high ^= wh_permute_round(low, p->key[i]) & p->high_mask;
		}
		y = high << p->low_bits | low;
	} while (y >= p->n);
	return y;
}

#endif
