/*
 * places: where ids stand when they are put in ascending order, each once.
 *
 * A set of ids is a bit for each number of their range, and the place of one is the count of bits
 * below it: 32 bits to a node, which also knows how many bits come before it. Where ids are few for
 * their range, only nodes that hold bits exist; which ones those are is a set of the same kind, one
 * level up. So nothing is sorted and nothing searched: ids take a pass or two over them to enter,
 * and a place a look into a small table for each level. An ordinary mesh has one level, a shuffled
 * one of 100 M faces two.
 */
#ifndef WH_BASE_PLACES_H
#define WH_BASE_PLACES_H

#include "base/mem.h"

enum { WH_PLACES_BITS = 5, WH_PLACES_LEVELS = 13 }; /* 32 bits to a node; 13 levels for any id */

typedef struct wh_places_node {
	uint32_t bits, before; /* before: bits of the level in earlier nodes */
} wh_places_node;

/* Zero-initialise; may be filled again and again. */
typedef struct wh_places {
	wh_places_node *level[WH_PLACES_LEVELS]; /* 0 has the ids' own bits */
	uint32_t levels;
	uint32_t n;           /* different ids */
	uint64_t first, span; /* ids are first .. first + span */
	wh_places_node *room; /* of all levels */
	size_t cap;
} wh_places;

/* Finds the places of ids[0 .. n-1], n >= 1, in any order and with repeats. */
wh_code wh_places_fill(wh_ctx *c, wh_places *p, const uint64_t *ids, uint32_t n);
void wh_places_free(wh_ctx *c, wh_places *p);

/* Bytes that n ids below 2^bits take at most, bits <= 32. */
static inline size_t wh_places_bytes(uint64_t n, uint32_t bits)
{
	return (size_t)(2 * n + 2 + ((uint64_t)1 << bits >> 3 * WH_PLACES_BITS)) *
	       sizeof(wh_places_node);
}

/* Memory for n numbers, once the places are no longer needed. NULL: refused. */
uint32_t *wh_places_room(wh_ctx *c, wh_places *p, uint32_t n);

static inline uint32_t wh_places_count(uint32_t bits)
{
	bits -= bits >> 1 & 0x55555555;
	bits = (bits & 0x33333333) + (bits >> 2 & 0x33333333);
	return ((bits + (bits >> 4)) & 0x0f0f0f0f) * 0x01010101 >> 24;
}

/* Bits before bit `at` of a node. */
static inline uint32_t wh_places_rank(const wh_places_node *node, uint32_t at)
{
	return node->before + wh_places_count(node->bits & (((uint32_t)1 << at) - 1));
}

/* The node of an offset on a level, given its place on the levels above. */
static inline uint64_t wh_places_node_of(const wh_places *p, uint64_t off, uint32_t level)
{
	uint32_t l = p->levels - 1;
	uint64_t i = off >> WH_PLACES_BITS * l >> WH_PLACES_BITS;
	for (; l > level; l--)
		i = wh_places_rank(&p->level[l][i], off >> WH_PLACES_BITS * l & 31);
	return i;
}

/* The place of an id. False when it is none of those entered; the place is 0 then. */
static inline bool wh_places_find(const wh_places *p, uint64_t id, uint32_t *place)
{
	const uint64_t off = id - p->first;
	*place = 0;
	if (off > p->span)
		return false;
	uint32_t l = p->levels - 1;
	uint64_t i = off >> WH_PLACES_BITS * l >> WH_PLACES_BITS;
	for (;; l--) {
		const wh_places_node *node = &p->level[l][i];
		const uint32_t at = off >> WH_PLACES_BITS * l & 31;
		if (!(node->bits >> at & 1))
			return false;
		i = wh_places_rank(node, at);
		if (l == 0)
			break;
	}
	*place = (uint32_t)i;
	return true;
}

#endif
