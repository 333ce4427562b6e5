/*
 * idmap: from 64-bit ids to 64-bit values; for the few vertices that several clusters use.
 *
 * Open addressing with linear probing, doubled at three quarters full: 16 bytes an entry, 32 at
 * worst, and the old table beside the new one while it grows. Not thread-safe for writing.
 */
#ifndef WH_BASE_IDMAP_H
#define WH_BASE_IDMAP_H

#include "base/mem.h"

typedef struct wh_idmap {
	uint64_t *slot; /* pairs: id + 1 (0: free), value */
	size_t slots;   /* 0 or a power of two */
	size_t n;
} wh_idmap;

/* Puts an id that may be there already: *fresh tells. Returns where its value is (0 when fresh),
 * valid until the next put; NULL when memory is refused. Ids below 2^64 - 1. */
uint64_t *wh_idmap_put(wh_ctx *c, wh_idmap *m, uint64_t id, bool *fresh);

/* Where the value of an id is; NULL when it is not there. */
const uint64_t *wh_idmap_get(const wh_idmap *m, uint64_t id);

void wh_idmap_free(wh_ctx *c, wh_idmap *m);

#endif
