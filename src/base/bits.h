/*
 * bits: whole numbers of any size in as many bits as they need, one behind the other.
 *
 * Bytes are filled from their lowest bit up. A number x is written in the class code of order k
 * (Elias's gamma code of x >> k, with the low bits behind; what Golomb's codes are to geometric
 * distributions this is to those with long tails): with q the bit length of x >> k, q zero bits, a
 * one, and the low bits of x: k of them when q is 0, else k + q - 1, as the top bit is known. So
 * numbers below 2^k take k + 1 bits, and no number takes many more than the best order would give
 * it.
 */
#ifndef WH_BASE_BITS_H
#define WH_BASE_BITS_H

#include "base/bytes.h"
#include "base/mem.h"

enum {
	WH_BITS_ORDERS = 64, /* orders are below it */
	WH_BITS_MOST = 128,  /* bits of a number, at most */
	WH_BITS_PAD = 32     /* bytes behind the last one that reading may look at */
};

/* Bits on their way out. Zero-initialise; free `at`. */
typedef struct wh_bits_out {
	uint8_t *at;
	size_t cap;
	uint64_t n; /* bits */
} wh_bits_out;

/* Bits on their way in. */
typedef struct wh_bits_in {
	const uint8_t *at; /* with WH_BITS_PAD bytes behind */
	uint64_t n, end;   /* the next bit; the last one's successor */
} wh_bits_in;

static inline uint32_t wh_bit_length(uint64_t x)
{
	return x ? 64 - (uint32_t)__builtin_clzll(x) : 0;
}

/* Bits that the code of order k takes. */
static inline uint32_t wh_bits_of(uint64_t x, uint32_t k)
{
	const uint32_t q = wh_bit_length(x >> k);
	return q + 1 + (q ? k + q - 1 : k);
}

/* Makes room for so many more bits, all zero. */
static inline wh_code wh_bits_reserve(wh_ctx *c, wh_bits_out *b, uint64_t bits)
{
	const size_t have = b->cap, need = (size_t)((b->n + bits + 7) / 8) + 16;
	if (wh_reserve(c, &b->at, &b->cap, need, 1) != WH_OK)
		return c->err.code;
	if (b->cap > have)
		memset(b->at + have, 0, b->cap - have);
	return WH_OK;
}

/* Starts over. */
static inline void wh_bits_clear(wh_bits_out *b)
{
	if (b->at)
		memset(b->at, 0, (size_t)(b->n / 8) + 1);
	b->n = 0;
}

/* x, which has no more than `count` <= 32 bits; there is room. */
static inline void wh_bits_put(wh_bits_out *b, uint64_t x, uint32_t count)
{
	uint8_t *at = b->at + (b->n >> 3);
	uint64_t word = wh_load64(at, WH_HOST_BIG) | x << (b->n & 7);
	word = wh_load64(&word, WH_HOST_BIG);
	memcpy(at, &word, sizeof word);
	b->n += count;
}

/* The low `count` <= 63 bits of x. */
static inline void wh_bits_put_low(wh_bits_out *b, uint64_t x, uint32_t count)
{
	x &= (1ULL << count) - 1;
	if (count > 32)
		wh_bits_put(b, x & UINT32_MAX, 32);
	wh_bits_put(b, count > 32 ? x >> 32 : x, count > 32 ? count - 32 : count);
}

/* x in the code of order k; room for WH_BITS_MOST bits is there. */
static inline void wh_bits_put_code(wh_bits_out *b, uint64_t x, uint32_t k)
{
	const uint32_t q = wh_bit_length(x >> k);
	b->n += q; /* zeros are there already */
	wh_bits_put(b, 1, 1);
	wh_bits_put_low(b, x, q ? k + q - 1 : k);
}

/* The next 57 bits or more, and whatever else is there. */
static inline uint64_t wh_bits_peek(const wh_bits_in *b)
{
	return wh_load64(b->at + (b->n >> 3), WH_HOST_BIG) >> (b->n & 7);
}

/* The next `count` <= 32 bits. */
static inline uint64_t wh_bits_get(wh_bits_in *b, uint32_t count)
{
	const uint64_t x = wh_bits_peek(b) & ((1ULL << count) - 1);
	b->n += count;
	return x;
}

/* The same for any count up to 63. */
static inline uint64_t wh_bits_get_long(wh_bits_in *b, uint32_t count)
{
	const uint64_t low = wh_bits_get(b, count < 32 ? count : 32);
	return count > 32 ? low | wh_bits_get(b, count - 32) << 32 : low;
}

/* A number in the code of order k < WH_BITS_ORDERS. Damaged bits give any number; as long as n is
 * not above `end` before the call, nothing outside the padding is looked at. */
static inline uint64_t wh_bits_get_code(wh_bits_in *b, uint32_t k)
{
	uint32_t q = 0;
	uint64_t word = wh_bits_peek(b);
	for (; (uint32_t)word == 0 && q < 64; q += 32, word = wh_bits_peek(b))
		b->n += 32;
	const uint32_t zeros = (uint32_t)word ? (uint32_t)__builtin_ctz((uint32_t)word) : 0;
	b->n += zeros + 1;
	q += zeros;
	const uint32_t low = q == 0 ? k : k + q - 1 < 63 ? k + q - 1 : 63;
	const uint64_t rest = wh_bits_get_long(b, low);
	return q ? rest | 1ULL << low : rest;
}

#endif
