/*
 * sequence: all collapses of a run in the order in which they were made, kept in files of the spill
 * folder: one for each cluster of each round. Each is told as the vertex split that undoes it
 * (io/pmesh.h), but with global ids of vertices, and ids of faces.
 *
 * A record: wh_sequence_step; then its numbers, as the columns of a block have them, each in the
 * bytes of what it is a difference of; then the ids of the faces that change a corner, 4 bytes
 * each. What the first trace takes down is kept, too: the corners of all faces in the order of
 * their ids, three global ids of 4 bytes each.
 */
#ifndef WH_PIPELINE_SEQUENCE_H
#define WH_PIPELINE_SEQUENCE_H

#include "algo/progressive.h"
#include "io/spill.h"
#include "mesh/collapse.h"

typedef struct wh_sequence_step {
	uint32_t u, v;             /* u goes, v stays */
	uint32_t face[2], apex[2]; /* that vanish, and their third vertices */
	float key, err;
	uint32_t moved;            /* faces that change a corner */
	uint8_t way, faces, uv[2]; /* as wh_trace_step has them */
} wh_sequence_step;

/* A round. */
typedef struct wh_sequence_part {
	uint32_t generation, clusters;
} wh_sequence_part;

/* Zero-initialise but for what is said first. */
typedef struct wh_sequence {
	wh_spill *spill;
	const wh_attributes *attributes; /* NULL: none */
	uint32_t coord_bytes;
	double unscale; /* from units of the run to those of the file */
	wh_sequence_part *part;
	size_t n, cap;
} wh_sequence;

enum { WH_SEQUENCE_PLACES = 6 }; /* numbers of coordinates: v's, then u's */

/* Bytes of a number, and of all of a record's. */
uint32_t wh_sequence_number_bytes(const wh_sequence *s, uint32_t i);
uint32_t wh_sequence_numbers_bytes(const wh_sequence *s);
/* How many there are. */
static inline uint32_t wh_sequence_numbers(const wh_sequence *s)
{
	return WH_SEQUENCE_PLACES + (s->attributes ? 2 * s->attributes->n : 0);
}
/* A number of `bytes` bytes. */
uint64_t wh_sequence_get(const uint8_t *at, uint32_t bytes);

/* Takes down what a worker does to one patch after the other. Zero-initialise; free with
 * wh_sequence_writer_free. */
typedef struct wh_sequence_writer {
	const wh_sequence *s;
	const wh_patch *patch; /* at hand */
	wh_trace trace;
	uint8_t *buf;
	size_t cap, used;
	uint64_t off;
	int fd;
} wh_sequence_writer;

/* Bytes of a writer for patches of these counts. */
size_t wh_sequence_bytes(uint64_t nv, uint64_t nf, uint32_t attr_bytes);

/* Begins the file of a cluster, whose faces get ids from `first` on where they have none; sink.to
 * is the writer then, until the end. */
wh_code wh_sequence_begin(wh_ctx *c, wh_sequence_writer *w, const wh_sequence *s,
                          uint32_t generation, uint32_t cluster, wh_patch *patch, uint32_t first);
/* A wh_collapse_sink's put; `to` is the wh_sequence_writer. */
wh_code wh_sequence_put(wh_ctx *c, void *to, const wh_collapse *one, const uint8_t *attr);
/* Ends it, after a failure too; `code`: how it went. */
wh_code wh_sequence_end(wh_ctx *c, wh_sequence_writer *w, wh_patch *patch, wh_code code);
void wh_sequence_writer_free(wh_ctx *c, wh_sequence_writer *w);

/* The files of a generation are what comes next. */
wh_code wh_sequence_keep(wh_ctx *c, wh_sequence *s, uint32_t generation, uint32_t clusters);
/* They are not. */
void wh_sequence_drop(wh_spill *spill, uint32_t generation, uint32_t clusters);
void wh_sequence_free(wh_ctx *c, wh_sequence *s);

/* Reads all of a sequence, or the corners of its faces. Zero-initialise but for s; close it with
 * wh_sequence_close. */
typedef struct wh_sequence_reader {
	const wh_sequence *s;
	bool corners;
	size_t part; /* the file that is open, if `open` */
	uint32_t cluster;
	bool open;
	int fd;
	uint64_t off, end; /* of the file: read so far, and all */
	uint8_t *buf;
	size_t at, n; /* of it: shown, and there */
} wh_sequence_reader;

void wh_sequence_close(wh_ctx *c, wh_sequence_reader *r);
/* The next record: its step, its numbers and the ids behind them, there until the next call.
 * *more: false at the end. */
wh_code wh_sequence_next(wh_ctx *c, wh_sequence_reader *r, wh_sequence_step *step,
                         const uint8_t **numbers, const uint8_t **moved, bool *more);
/* The corners of the next face. */
wh_code wh_sequence_corners(wh_ctx *c, wh_sequence_reader *r, uint32_t corner[3]);

#endif
