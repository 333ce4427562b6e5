/*
 * rerun: the collapses of a trial on a cluster, kept in a file until it is known how many of them
 * count. With each go the attributes of the vertex made, which cannot be worked out again from two
 * vertices alone.
 */
#ifndef WH_PIPELINE_RERUN_H
#define WH_PIPELINE_RERUN_H

#include "algo/simplify.h"
#include "io/spill.h"

enum { WH_RERUN_BUFFER = 2048 }; /* collapses */

/* One for each worker. Zero-initialise but for attr_bytes; free with wh_rerun_free. */
typedef struct wh_rerun {
	uint32_t attr_bytes; /* of a vertex */
	wh_spill *spill;
	uint8_t *buf; /* WH_RERUN_BUFFER collapses, each with its attributes behind it */
	uint32_t *into;
	size_t cap, cap_into;
	uint32_t used; /* collapses */
	uint64_t off;
	uint32_t cluster;
	int fd; /* valid between begin and end */
} wh_rerun;

/* Name of the file of cluster k in the spill folder, where it appears when it is whole. */
typedef char wh_rerun_file[32];
const char *wh_rerun_name(uint32_t k, wh_rerun_file name);

/* What to take of a trial, from its beginning: collapses while both last. */
typedef struct wh_rerun_limit {
	uint64_t faces, collapses;
} wh_rerun_limit;

/* Starts the file of cluster k; a former one is lost. */
wh_code wh_rerun_begin(wh_ctx *c, wh_rerun *r, wh_spill *spill, uint32_t k);

/* A wh_collapse_sink's put; `to` is the wh_rerun. */
wh_code wh_rerun_put(wh_ctx *c, void *to, const wh_collapse *one, const uint8_t *attr);

/* Ends it, after a failure too; `code`: how the trial went. */
wh_code wh_rerun_end(wh_ctx *c, wh_rerun *r, wh_code code);

/* Does the first collapses of cluster k again, on the patch they were found on, and removes the
 * file. A collapse that takes two faces where one is left to take is not done. */
wh_code wh_rerun_perform(wh_ctx *c, wh_rerun *r, wh_spill *spill, uint32_t k, wh_rerun_limit limit,
                         wh_patch *p, wh_simplify_result *result);

void wh_rerun_free(wh_ctx *c, wh_rerun *r);

/* Bytes that a worker takes for a cluster of so many vertices. */
static inline size_t wh_rerun_bytes(uint64_t nv, uint32_t attr_bytes)
{
	return WH_RERUN_BUFFER * (sizeof(wh_collapse) + attr_bytes) +
	       (size_t)nv * sizeof(uint32_t) + 256;
}

#endif
