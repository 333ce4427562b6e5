/*
 * ingest: from a source of positions and triangles to the first round's cluster files.
 *
 * Streams the input four times, in parallel chunks committed in file order, so that the files'
 * bytes depend on the input alone: vertices (bounds, sample), vertices (cell of each), faces (to
 * their clusters), vertices (to every cluster whose faces use them). Memory: two bytes a vertex
 * for the table of cells, a buffer a cluster, a few MiB a worker.
 */
#ifndef WH_PIPELINE_INGEST_H
#define WH_PIPELINE_INGEST_H

#include "exec/exec.h"
#include "io/ply.h"
#include "pipeline/progress.h"
#include "pipeline/store.h"

typedef struct wh_ingest_params {
	uint32_t clusters; /* 1 .. WH_MAX_CLUSTERS */
	size_t buffer;     /* bytes of write buffer a cluster */
} wh_ingest_params;

enum { WH_MAX_CLUSTERS = 65535 };

typedef struct wh_ingest_result {
	wh_vec3 lo, hi;      /* bounds of all vertices, file coordinates */
	double scale;        /* a power of two that all positions were multiplied by */
	double step;         /* of new positions (algo/simplify.h), in scaled units; 0: floats */
	uint64_t faces;      /* stored */
	uint64_t degenerate; /* dropped: a vertex repeated */
	uint64_t cut_vertices;
} wh_ingest_result;

/* Bytes of memory that ingest will hold at most. */
size_t wh_ingest_bytes(const wh_source *src, const wh_exec *ex, const wh_ingest_params *params);

/*
 * Fills `store` (spill and generation set by the caller). WH_E_IRREGULAR when the source turns
 * out to hold faces that are not triangles: rewrite the body and call again.
 */
wh_code wh_ingest(wh_ctx *c, const wh_exec *ex, wh_progress *progress, const wh_source *src,
                  const wh_ingest_params *params, wh_store *store, wh_ingest_result *result);

#endif
