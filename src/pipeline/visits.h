/*
 * visits: which clusters use which vertices besides those at home in them, in bounded memory.
 *
 * Visits are added in any order, with repeats; then they are taken back in ascending order of
 * vertices, each once, as many at a time as fit in memory. What does not fit while they are added
 * lies in the spill folder. An ordinary mesh has visits along the cuts only, and all fit; in a
 * soup of triangles there may be several for every vertex.
 */
#ifndef WH_PIPELINE_VISITS_H
#define WH_PIPELINE_VISITS_H

#include "io/spill.h"

/* A visit is one number, in whose order vertices come first. */
enum { WH_VISIT_CLUSTER_BITS = 16 };

static inline uint64_t wh_visit(uint64_t vertex, uint32_t cluster)
{
	return vertex << WH_VISIT_CLUSTER_BITS | cluster;
}

static inline uint64_t wh_visit_vertex(uint64_t visit)
{
	return visit >> WH_VISIT_CLUSTER_BITS;
}

static inline uint32_t wh_visit_cluster(uint64_t visit)
{
	return (uint32_t)visit & 0xffff;
}

/* Vertices that visits can tell apart. */
#define WH_VISIT_VERTICES ((uint64_t)1 << (64 - WH_VISIT_CLUSTER_BITS))

enum { WH_VISIT_DRAWERS = 256 };

typedef struct wh_visits {
	uint64_t *item; /* taken: those of vertices first .. end-1, ascending, each once */
	size_t n;
	uint64_t first, end;
	/* the rest is the module's own */
	size_t cap, most; /* room in item now; the most it may become */
	wh_spill *spill;
	uint64_t vertices, span;         /* of all visits; of a drawer */
	uint64_t held[WH_VISIT_DRAWERS]; /* visits in each drawer's file */
	bool spilled;
} wh_visits;

/* The least memory, in visits, that works when a vertex is visited by so many clusters. */
size_t wh_visits_least(uint32_t clusters);

/* Vertices are 0 .. vertices-1, clusters 0 .. 65535; `room` >= wh_visits_least visits are held in
 * memory at most, 8 bytes each. `spill` may have one wh_visits at a time. */
wh_code wh_visits_open(wh_ctx *c, wh_visits *v, wh_spill *spill, uint64_t vertices, size_t room);
void wh_visits_close(wh_ctx *c, wh_visits *v);

static inline size_t wh_visits_bytes(size_t room)
{
	return room * sizeof(uint64_t) + 64;
}

/* Adds n visits. Not thread-safe. */
wh_code wh_visits_add(wh_ctx *c, wh_visits *v, const uint64_t *item, size_t n);

/* To be called when all are added. */
wh_code wh_visits_seal(wh_ctx *c, wh_visits *v);

/* Takes the visits of vertices first .. v->end-1, with v->end above `first` and chosen so that
 * they fit. `first` is 0 in the first call and v->end in the next, up to `vertices`; more rounds
 * may follow. */
wh_code wh_visits_take(wh_ctx *c, wh_visits *v, uint64_t first);

/* Of the visits taken, the place of the first one of a vertex >= `vertex`. */
size_t wh_visits_find(const wh_visits *v, uint64_t vertex);

#endif
