/*
 * homes: the home cluster of every vertex, and of every corner of every face, in bounded memory.
 *
 * Two bytes a vertex. While all of them fit in memory, a corner is looked up in the table. Where
 * they do not, they lie in the spill folder, and a window of vertices after the other is brought
 * into memory: for each, the faces are gone through in chunks, and the homes of corners inside the
 * window are filled in, in a file of two bytes a corner. Chunks that have no corner inside are
 * left out, so that faces in the order of their vertices are gone through about twice, whatever
 * the number of windows. The vertices of a corner are never read one by one.
 *
 *     open -> put ... -> (window -> fill ...)* for every window -> get, corners ...
 *
 * Calls for different vertices or chunks may run at the same time.
 */
#ifndef WH_PIPELINE_HOMES_H
#define WH_PIPELINE_HOMES_H

#include "io/spill.h"

/* The vertices that a chunk of faces uses are among lo .. hi. */
typedef struct wh_homes_range {
	uint64_t lo, hi;
} wh_homes_range;

typedef struct wh_homes {
	wh_spill *spill;
	uint64_t base;             /* the first vertex */
	uint64_t vertices, window; /* window: vertices in memory at a time */
	uint64_t first, end;       /* those that are */
	uint16_t *table;           /* their homes */
	int vertex_fd, corner_fd;  /* -1: all in memory, no file needed */
	wh_homes_range *range;     /* of each chunk, once gone through */
	size_t chunk_corners;
} wh_homes;

/* How the homes are to be held. */
typedef struct wh_homes_params {
	uint64_t base;        /* the first vertex: those before it are nobody's corners */
	uint64_t vertices;    /* from there on */
	uint64_t window;      /* vertices in memory at a time; 0: all */
	uint64_t chunks;      /* of faces */
	size_t chunk_corners; /* corners in each but the last */
} wh_homes_params;

/* Bytes held until the windows are done, and after that. */
size_t wh_homes_bytes(const wh_homes_params *p);
size_t wh_homes_bytes_after(const wh_homes_params *p);

wh_code wh_homes_open(wh_ctx *c, wh_homes *h, wh_spill *spill, const wh_homes_params *p);
void wh_homes_close(wh_ctx *c, wh_homes *h);

/* Sets, and tells, the homes of vertices first .. first+n-1. */
wh_code wh_homes_put(wh_ctx *c, const wh_homes *h, uint64_t first, size_t n, const uint16_t *home);
wh_code wh_homes_get(wh_ctx *c, const wh_homes *h, uint64_t first, size_t n, uint16_t *home);

/* Number of windows to go through; 0 when all homes are in memory. */
uint64_t wh_homes_windows(const wh_homes *h);

/* Brings window w into memory; windows come in order. */
wh_code wh_homes_window(wh_ctx *c, wh_homes *h, uint64_t w);

/* True when the chunk may have corners in the window at hand. */
bool wh_homes_wants(const wh_homes *h, int64_t chunk);

/* Fills in the homes of those of the chunk's n corners that lie in the window. `room`: for
 * as many. */
wh_code wh_homes_fill(wh_ctx *c, wh_homes *h, int64_t chunk, const uint64_t *corner, size_t n,
                      uint16_t *room);

/* To be called after the last window: the memory that windows took is free again. */
void wh_homes_filled(wh_ctx *c, wh_homes *h);

/* The homes of the chunk's n corners. */
wh_code wh_homes_corners(wh_ctx *c, const wh_homes *h, int64_t chunk, const uint64_t *corner,
                         size_t n, uint16_t *home);

#endif
