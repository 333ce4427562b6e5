#include "base/places.h"

#include <string.h>

static void find_range(wh_places *p, const uint64_t *ids, uint32_t n)
{
	uint64_t least = ids[0], most = ids[0];
	for (uint32_t i = 1; i < n; i++) {
		least = ids[i] < least ? ids[i] : least;
		most = ids[i] > most ? ids[i] : most;
	}
	p->first = least;
	p->span = most - least;
}

/* Nodes of the highest level, which has all that its range takes. */
static uint64_t top_nodes(const wh_places *p)
{
	return (p->span >> WH_PLACES_BITS * (p->levels - 1) >> WH_PLACES_BITS) + 1;
}

/* One level as long as it has no more than two nodes an id; else so many that the highest has no
 * more than one, as those below it do. */
static wh_code make_room(wh_ctx *c, wh_places *p, uint32_t n)
{
	p->levels = 1;
	if (top_nodes(p) > 2 * (uint64_t)n + 1)
		while (top_nodes(p) > (uint64_t)n + 1)
			p->levels++;
	return wh_renew(c, &p->room, &p->cap, (size_t)top_nodes(p) + (p->levels - 1) * (size_t)n,
	                sizeof *p->room);
}

/* Enters the ids on a level; those above are done. Returns how many bits it has. */
static uint32_t fill_level(wh_places *p, uint32_t level, size_t nodes, const uint64_t *ids,
                           uint32_t n)
{
	wh_places_node *node = p->level[level];
	memset(node, 0, nodes * sizeof *node);
	for (uint32_t i = 0; i < n; i++) {
		const uint64_t off = ids[i] - p->first;
		node[wh_places_node_of(p, off, level)].bits |=
		    (uint32_t)1 << (off >> WH_PLACES_BITS * level & 31);
	}
	uint32_t sum = 0;
	for (size_t k = 0; k < nodes; k++) {
		node[k].before = sum;
		sum += wh_places_count(node[k].bits);
	}
	return sum;
}

wh_code wh_places_fill(wh_ctx *c, wh_places *p, const uint64_t *ids, uint32_t n)
{
	find_range(p, ids, n);
	if (make_room(c, p, n) != WH_OK)
		return c->err.code;
	wh_places_node *next = p->room;
	size_t nodes = (size_t)top_nodes(p);
	for (uint32_t level = p->levels; level-- > 0;) {
		p->level[level] = next;
		next += nodes;
		p->n = fill_level(p, level, nodes, ids, n);
		nodes = p->n; /* of the level below: one for each bit */
	}
	return WH_OK;
}

uint32_t *wh_places_room(wh_ctx *c, wh_places *p, uint32_t n)
{
	if (wh_renew(c, &p->room, &p->cap, (size_t)n / 2 + 1, sizeof *p->room) != WH_OK)
		return NULL;
	return (uint32_t *)(void *)p->room;
}

void wh_places_free(wh_ctx *c, wh_places *p)
{
	wh_free(c, p->room);
	*p = (wh_places){0};
}
