/*
 * rng: seeded pseudo-random numbers that are the same on every machine.
 *
 * splitmix64 (Steele, Lea, Flood 2014): one multiply-xorshift mix of a counter. Counter-based,
 * so that number i of a stream can be had without its predecessors and in any order.
 */
#ifndef WH_BASE_RNG_H
#define WH_BASE_RNG_H

#include <stdint.h>

/* Mixes 64 bits: distinct inputs give distinct, well-spread outputs. */
static inline uint64_t wh_mix64(uint64_t x)
{
	x += 0x9e3779b97f4a7c15u;
	x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9u;
	x = (x ^ (x >> 27)) * 0x94d049bb133111ebu;
	return x ^ (x >> 31);
}

typedef struct wh_rng {
	uint64_t state;
} wh_rng;

static inline wh_rng wh_rng_seed(uint64_t seed)
{
	return (wh_rng){wh_mix64(seed)};
}

static inline uint64_t wh_rng_next(wh_rng *r)
{
	r->state += 0x9e3779b97f4a7c15u;
	return wh_mix64(r->state);
}

/* Uniform in [0, 1). */
static inline double wh_rng_unit(wh_rng *r)
{
	return (double)(wh_rng_next(r) >> 11) * 0x1p-53;
}

#endif
