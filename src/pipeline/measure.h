/*
 * measure: the distances of a file from others, whatever their size, within a ceiling.
 *
 * All become surfaces in the spill folder (pipeline/surface), which algo/compare measures with as
 * much of them in memory as the ceiling allows. The figures depend on neither memory nor threads.
 */
#ifndef WH_PIPELINE_MEASURE_H
#define WH_PIPELINE_MEASURE_H

#include "algo/compare.h"
#include "io/format.h"
#include "io/spill.h"
#include "pipeline/ingest.h"
#include "pipeline/progress.h"

/* A file to measure from a: a itself, reduced, say. */
typedef struct wh_measure_other {
	const char *path;
	wh_format from;     /* WH_FORMAT_ANY: what it looks like */
	wh_compare *result; /* receives the figures, whose b it is */
} wh_measure_other;

/* What is measured, and how. */
typedef struct wh_measure_job {
	const char *a;
	wh_format from; /* of a; WH_FORMAT_ANY: what it looks like */
	const wh_measure_other *other;
	size_t others;
	wh_points_fetch cuts; /* points along cuts (see wh_compare_params); NULL: no band */
	void *cuts_user;
	uint64_t ncuts;
	uint64_t samples, seed; /* as in wh_compare_params */
	size_t ceiling;         /* bytes of the process: for words */
	size_t budget;          /* bytes to hold, at any time */
} wh_measure_job;

/* Measures within an open spill folder. The first of the others that fails ends it. Numbers of
 * stores in the folder are from `number` on, others + 1 of them. */
wh_code wh_measure(wh_ctx *c, const wh_exec *ex, wh_spill *spill, wh_progress *progress,
                   const wh_measure_job *job, uint32_t number);

typedef struct wh_measure_params {
	const char *a;
	wh_format from;
	const wh_measure_other *other;
	size_t others;
	const char *seams; /* binary PLY of points along the cuts of the others; NULL: no band */
	uint64_t samples, seed;
	const char *temp_dir; /* NULL: $SLURM_TMPDIR, $TMPDIR, or the next */
	const char *fallback; /* NULL: /tmp */
	size_t memory;        /* ceiling of the process, bytes; 0: half of what there is */
	wh_progress_fn progress;
	void *progress_user;
} wh_measure_params;

/* The same as a process of its own: c->mem->limit is set for the time of the call. Failures as
 * those of wh_surface_open and wh_compare_surfaces; WH_E_INPUT also for seams that are no points.
 */
wh_code wh_measure_files(wh_ctx *c, const wh_exec *ex, const wh_measure_params *p);

#endif
