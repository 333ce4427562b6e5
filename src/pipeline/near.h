/*
 * near: which vertices of a source become which others when near ones are made one.
 *
 * The rule is told in pipeline/clean.h. What is found is a pair for each vertex that goes: its id,
 * and that of the one it becomes, which stays. Pairs lie on disk by windows of ids.
 */
#ifndef WH_PIPELINE_NEAR_H
#define WH_PIPELINE_NEAR_H

#include "base/rank.h"
#include "exec/exec.h"
#include "geom/vec3.h"
#include "io/ply.h"
#include "pipeline/bins.h"
#include "pipeline/progress.h"

typedef struct wh_near_pair {
	uint64_t id, as;
} wh_near_pair;

typedef struct wh_near {
	wh_bin_file file;
	wh_bins *pairs; /* of each worker; a bin is a window */
	int workers;
	uint64_t window; /* vertices */
	void *block;     /* of a bin being read */
} wh_near;

typedef struct wh_near_params {
	double distance; /* 0: equal positions */
	wh_vec3 lo, hi;  /* box around the vertices that are set in `kept` */
	uint64_t window; /* vertices of a window of pairs */
	uint64_t bucket; /* vertices of a bucket, about; 0: as many as there is room for. Decides
	                    nothing but time and memory */
} wh_near_params;

/*
 * Finds the pairs among the vertices that are set in *kept, and clears those that go. WH_E_USAGE
 * when the distance is too small for such coordinates. On failure *n can only be closed.
 */
wh_code wh_near_find(wh_ctx *c, const wh_exec *ex, wh_progress *progress, wh_spill *spill,
                     const wh_source *source, const wh_near_params *params, wh_rank *kept,
                     wh_near *n);
void wh_near_close(wh_ctx *c, wh_near *n);

/* Calls `take` with blocks of the pairs of a window, in no order. Not thread-safe. */
wh_code wh_near_pairs(wh_ctx *c, wh_near *n, uint64_t window,
                      void (*take)(void *arg, const wh_near_pair *pairs, size_t n), void *arg);

/* Memory that finding takes with so many workers and windows: what it is certain of, and what the
 * tables of vertices are expected to take. */
size_t wh_near_bytes(const wh_source *source, int workers, uint64_t windows);
/* Bytes of temporary disk, about. */
uint64_t wh_near_disk(const wh_source *source);

#endif
