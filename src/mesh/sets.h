/* sets: union-find in an array of parents. parent[i] == i is a root; the smaller root wins. */
#ifndef WH_MESH_SETS_H
#define WH_MESH_SETS_H

#include <stdbool.h>
#include <stdint.h>

/* n sets of one. */
static inline void wh_sets_init(uint32_t *parent, uint64_t n)
{
	for (uint64_t i = 0; i < n; i++)
		parent[i] = (uint32_t)i;
}

static inline uint32_t wh_sets_find(uint32_t *parent, uint32_t i)
{
	while (parent[i] != i) {
		parent[i] = parent[parent[i]];
		i = parent[i];
	}
	return i;
}

/* True when the two were in different sets. */
static inline bool wh_sets_join(uint32_t *parent, uint32_t a, uint32_t b)
{
	a = wh_sets_find(parent, a);
	b = wh_sets_find(parent, b);
	if (a == b)
		return false;
	if (a < b)
		parent[b] = a;
	else
		parent[a] = b;
	return true;
}

/* How many sets there are. */
static inline uint64_t wh_sets_count(const uint32_t *parent, uint64_t n)
{
	uint64_t roots = 0;
	for (uint64_t i = 0; i < n; i++)
		roots += parent[i] == i;
	return roots;
}

#endif
