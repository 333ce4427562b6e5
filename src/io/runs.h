/*
 * runs: records in the order of a number each has, more of them than memory holds.
 *
 * Sorting by merging (D. E. Knuth, The Art of Computer Programming, volume 3, 5.4): what fits in
 * memory is sorted and goes to a temporary file as a run; reading merges all runs. Where all
 * records fit nothing is written. Equal numbers keep the order in which they came, so what comes
 * out does not depend on how much memory there is.
 *
 * Cost: radix sorting, then log2 of the number of runs for each record; every record is written
 * and read once. Memory: what the caller gives; a little more when there are very many runs.
 */
#ifndef WH_IO_RUNS_H
#define WH_IO_RUNS_H

#include "io/spill.h"

#include <string.h>

typedef struct wh_runs_item {
	uint64_t number;
	uint32_t at, run; /* which record, of which run */
} wh_runs_item;

/* Where a run is read. */
typedef struct wh_runs_front {
	uint64_t next, end; /* records of the file: to be read, and behind the last */
	uint32_t at, n;     /* in its part of the buffer: the one to be shown, and how many */
} wh_runs_front;

typedef struct wh_runs {
	wh_spill *spill;
	size_t record; /* bytes */
	size_t room;   /* records in the buffer */
	uint8_t *buf;
	size_t n;                   /* records in it, not in a run yet */
	wh_runs_item *item, *spare; /* the order of those; of reading: runs, a heap */
	int fd;                     /* -1: nothing was written */
	uint64_t written;           /* records */
	uint64_t *end;              /* of each run, in records */
	size_t runs, cap;
	wh_runs_front *front; /* of each run */
	size_t block;         /* records that each has in the buffer */
	size_t left;          /* in the heap; of records in memory: not shown yet */
	bool shown;           /* the top of the heap was */
} wh_runs;

/* Records of so many bytes, the first eight a number (a uint64_t, anywhere in memory), sorted in
 * about `bytes` of memory, or less where no more than `most` are expected. Close it, after a
 * failure too; one of zeros may be closed. */
wh_code wh_runs_open(wh_ctx *c, wh_runs *r, wh_spill *spill, size_t record, size_t bytes,
                     uint64_t most);
void wh_runs_close(wh_ctx *c, wh_runs *r);

/* Room for one more record, to be filled before the next call. NULL on failure. */
uint8_t *wh_runs_room(wh_ctx *c, wh_runs *r);
/* All records are there: the first one is next. */
wh_code wh_runs_end(wh_ctx *c, wh_runs *r);
/* So it is again. */
wh_code wh_runs_rewind(wh_ctx *c, wh_runs *r);
/* The next record, there until the next call; NULL when there is none, or on failure, which is
 * recorded. */
const uint8_t *wh_runs_next(wh_ctx *c, wh_runs *r);

static inline uint64_t wh_runs_number(const uint8_t *record)
{
	uint64_t number;
	memcpy(&number, record, sizeof number);
	return number;
}

/* Adds a record that is its number. */
static inline wh_code wh_runs_put(wh_ctx *c, wh_runs *r, uint64_t number)
{
	uint8_t *at = wh_runs_room(c, r);
	if (!at)
		return c->err.code;
	memcpy(at, &number, sizeof number);
	return WH_OK;
}

#endif
