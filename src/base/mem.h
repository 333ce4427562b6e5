/*
 * mem: all of whittle's memory, counted against one account.
 *
 * Blocks of 128 KiB and more come straight from the system; smaller ones from the C library. A
 * large block that is freed is kept for the next ones, cut or put together with others as they want
 * it, as fresh pages cost more than most work that is done in them; but never so that held and kept
 * blocks together exceed the account's peak: peak RSS can be predicted as if all went back.
 * Everything has gone back when nothing is held. Every block is aligned to 64 bytes. Sizes are
 * checked for overflow. Thread-safe.
 */
#ifndef WH_BASE_MEM_H
#define WH_BASE_MEM_H

#include "base/status.h"

#include <stdatomic.h>

enum { WH_MEM_KEPT = 256 }; /* freed blocks that are kept, at most */

/* A freed block of the system's. */
typedef struct wh_kept {
	char *at;
	size_t bytes;
} wh_kept;

typedef struct wh_mem {
	_Atomic size_t used; /* bytes held now */
	_Atomic size_t peak; /* most bytes held at any time */
	_Atomic size_t high; /* the same since the caller set it to what was held */
	size_t limit;        /* refuse to hold more than this; 0 = no limit */
	_Atomic long
	    fail_after;    /* tests: when > 0, counts down; the request that reaches 0 fails */
	_Atomic bool busy; /* guards what follows */
	size_t kept_bytes;
	uint32_t n_kept;
	wh_kept kept[WH_MEM_KEPT]; /* by address; no two touch */
} wh_mem;

/* count * size bytes, uninitialised. NULL, with the failure recorded, when refused or
 * overflowing. A request of 0 bytes gives a valid block. */
void *wh_alloc(wh_ctx *c, size_t count, size_t size);

/* The same, filled with zeros. */
void *wh_calloc(wh_ctx *c, size_t count, size_t size);

/* A block of which every byte will be used, and in no order: asks for large pages, where the system
 * has them. */
void wh_mem_scattered(void *block);

/* Grows or shrinks a block (NULL: a new one). On failure NULL, and the old block stays valid. */
void *wh_resize(wh_ctx *c, void *block, size_t count, size_t size);

/* Frees a block of wh_alloc and friends; NULL is allowed. */
void wh_free(wh_ctx *c, void *block);

/* Gives the kept blocks back: before a stage that touches less of its memory than the one before.
 */
void wh_mem_trim(wh_ctx *c);

/* Makes room for at least `need` elements in a growing array: doubles *cap when it is too small.
 * Returns WH_OK or the recorded failure; the array stays valid either way. */
wh_code wh_reserve(wh_ctx *c, void *array_ptr, size_t *cap, size_t need, size_t size);

/* Makes room for `need` elements, and no more, in an array whose contents may be lost. On failure
 * the array is gone: NULL, *cap = 0. */
wh_code wh_renew(wh_ctx *c, void *array_ptr, size_t *cap, size_t need, size_t size);

/* A copy of a string. NULL, failure recorded, when refused. */
char *wh_strdup(wh_ctx *c, const char *s);

#endif
