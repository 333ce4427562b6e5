/*
 * splits: the collapses of a run, as vertex splits from coarse to fine, into a file (io/pmesh.h).
 *
 * Out of core: beside the base nothing that grows with the mesh is held. splits.c puts the splits
 * in order and tells them, splits_fan.c finds which corners each one turns.
 */
#ifndef WH_PIPELINE_SPLITS_H
#define WH_PIPELINE_SPLITS_H

#include "io/outfile.h"
#include "io/runs.h"
#include "pipeline/progress.h"
#include "pipeline/sequence.h"

typedef struct wh_splits {
	const wh_sequence *sequence; /* of all of the run */
	const wh_patch *base;        /* the result; faces carry what the last trace left them */
	uint64_t faces;              /* of the finest mesh */
	uint64_t collapses;
	uint64_t input_bytes;
	double diagonal;
	size_t memory; /* to sort in, or less: no byte depends on it */
} wh_splits;

/* The least memory that is worth it. */
enum { WH_SPLITS_LEAST = 4 << 20 };

/* Writes the file to an output, which the caller opens and commits. */
wh_code wh_splits_write(wh_ctx *c, wh_progress *progress, wh_outfile *o, const wh_splits *s);

/* ---- between the two files ---------------------------------------------------------------- */

/*
 * What is sorted; numbers are two of 32 bits each, the first one here the upper half. A vertex or
 * face is known by its id until it has its number for good, which is its place in the file.
 */
typedef struct wh_splits_work {
	const wh_splits *in;
	wh_runs number; /* vertex, its number */
	wh_runs face;   /* face, its number */
	wh_runs place;  /* place in the sequence, the split */
	wh_runs moved;  /* face, split that turns a corner of it away; 4 bytes: from which vertex */
	wh_runs corner; /* vertex, number of a face; 4 bytes: the split that turns the corner away;
	                   WH_NONE: none does */
	wh_runs asked;  /* vertex, split; wh_splits_asked: what the split wants to know of it */
	wh_runs told;   /* split, which question; wh_splits_told */
	wh_bits_out bits;
	int fan_fd; /* long fans; -1: none yet */
	uint64_t fan_bytes;
	size_t share;   /* of the memory, for each */
	uint64_t turns; /* corners that all splits turn */
} wh_splits_work;

/* Questions of a split. */
enum { WH_SPLITS_FAN, WH_SPLITS_APEX }; /* and another apex */

typedef struct wh_splits_asked {
	uint32_t faces; /* before the split */
	uint32_t question;
} wh_splits_asked;

typedef struct wh_splits_told {
	uint32_t number; /* of the vertex */
	uint32_t bits;   /* of its fan */
	uint64_t fan;    /* up to 32 bits; of more, where they are in the file */
} wh_splits_told;

static inline uint64_t wh_splits_key(uint32_t upper, uint32_t lower)
{
	return (uint64_t)upper << 32 | lower;
}

/* From `place` to `corner`, and from that to `told`; closes what it has read. */
wh_code wh_splits_find_corners(wh_ctx *c, wh_progress *progress, wh_splits_work *w);
wh_code wh_splits_find_fans(wh_ctx *c, wh_splits_work *w);

wh_code wh_splits_differ(wh_ctx *c);

#endif
