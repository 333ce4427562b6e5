/*
 * bins: many streams of small records in one temporary file.
 *
 * Records are dealt into numbered bins, kept in a buffer for each, and written by the block; later
 * each bin is read again, block by block, in the order in which its records came. A set of bins is
 * filled by one thread at a time; several sets may share a file. Reading is thread-safe once
 * filling has ended.
 */
#ifndef WH_PIPELINE_BINS_H
#define WH_PIPELINE_BINS_H

#include "io/spill.h"

/* The file behind the bins, perhaps of several workers. */
typedef struct wh_bin_file {
	wh_spill *spill;
	int fd;               /* -1: none */
	_Atomic uint64_t end; /* bytes */
} wh_bin_file;

typedef struct wh_bin {
	uint64_t *block; /* where its blocks are */
	size_t blocks, cap;
	size_t used; /* records in the buffer, or of the last block */
} wh_bin;

typedef struct wh_bins {
	wh_bin_file *file;
	wh_bin *bin;
	uint32_t n;
	size_t record, per_block; /* bytes; records */
	unsigned char *buffer;    /* a block for each bin */
} wh_bins;

/* Makes the file; closing one that was not made does nothing. */
wh_code wh_bin_file_open(wh_ctx *c, wh_bin_file *f, wh_spill *spill);
void wh_bin_file_close(wh_bin_file *f);

/* n bins of records of so many bytes, so many to a block. On failure they can only be closed. */
wh_code wh_bins_open(wh_ctx *c, wh_bins *b, wh_bin_file *file, uint32_t n, size_t record,
                     size_t per_block);
/* Frees all but the file; bins that are all zero, too. */
void wh_bins_close(wh_ctx *c, wh_bins *b);

/* Room for one more record of a bin, to be filled before the next call. NULL on failure. */
unsigned char *wh_bins_room(wh_ctx *c, wh_bins *b, uint32_t i);
/* All records are there: writes what is left in the buffers, and frees them. */
wh_code wh_bins_end(wh_ctx *c, wh_bins *b);
/* Reads block k < b->bin[i].blocks of a bin, *n records of at most b->per_block. */
wh_code wh_bins_read(wh_ctx *c, const wh_bins *b, uint32_t i, size_t k, void *to, size_t *n);

#endif
