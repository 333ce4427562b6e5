/* chunks: a stretch of items cut into chunks of equal size, the last of which may be shorter. */
#ifndef WH_BASE_CHUNKS_H
#define WH_BASE_CHUNKS_H

#include <stddef.h>
#include <stdint.h>

static inline int64_t wh_chunks(uint64_t total, uint64_t chunk)
{
	return (int64_t)((total + chunk - 1) / chunk);
}

/* Items of chunk `index`, which is one of them. */
static inline size_t wh_chunk_items(uint64_t total, int64_t index, uint64_t chunk)
{
	const uint64_t left = total - (uint64_t)index * chunk;
	return (size_t)(left < chunk ? left : chunk);
}

#endif
