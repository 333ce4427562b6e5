/*
 * measure: the distance of two files from each other, whatever their size, within a ceiling.
 *
 * Both become surfaces in the spill folder (pipeline/surface), which algo/compare measures with as
 * much of them in memory as the ceiling allows. The figures depend on neither memory nor threads.
 */
#ifndef WH_PIPELINE_MEASURE_H
#define WH_PIPELINE_MEASURE_H

#include "algo/compare.h"
#include "io/format.h"
#include "io/spill.h"
#include "pipeline/ingest.h"
#include "pipeline/progress.h"

/* What is measured, and how. */
typedef struct wh_measure_job {
	const char *a, *b;     /* files; b is the reduced one where one is */
	const char *reference; /* NULL, or a third file to measure a against as well */
	wh_format from;        /* of all; WH_FORMAT_ANY: what they look like */
	wh_points_fetch cuts;  /* points along cuts (see wh_compare_params); NULL: no band */
	void *cuts_user;
	uint64_t ncuts;
	uint64_t samples, seed; /* as in wh_compare_params */
	size_t ceiling;         /* bytes of the process: for words */
	size_t budget;          /* bytes to hold, at any time */
} wh_measure_job;

/*
 * Measures within an open spill folder. `reference` receives the figures of that file; NULL where
 * there is none. Numbers of stores in the folder are from `number` on, three of them.
 */
wh_code wh_measure(wh_ctx *c, const wh_exec *ex, wh_spill *spill, wh_progress *progress,
                   const wh_measure_job *job, uint32_t number, wh_compare *r,
                   wh_compare *reference);

typedef struct wh_measure_params {
	const char *a, *b;
	const char *reference; /* NULL: none */
	const char *seams;     /* binary PLY of points along the cuts of b; NULL: no band */
	wh_format from;
	uint64_t samples, seed;
	const char *temp_dir; /* NULL: $SLURM_TMPDIR, $TMPDIR, /tmp */
	size_t memory;        /* ceiling of the process, bytes; 0: half of what there is */
	wh_progress_fn progress;
	void *progress_user;
} wh_measure_params;

/* The same as a process of its own: c->mem->limit is set for the time of the call. Failures as
 * those of wh_surface_open and wh_compare_surfaces; WH_E_INPUT also for seams that are no points.
 */
wh_code wh_measure_files(wh_ctx *c, const wh_exec *ex, const wh_measure_params *p, wh_compare *r,
                         wh_compare *reference);

#endif
