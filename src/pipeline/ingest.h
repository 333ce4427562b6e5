/*
 * ingest: from a source of positions and triangles to the first round's cluster files.
 *
 * Streams the input in parallel chunks committed in file order, so that the files' bytes depend on
 * the input and the number of clusters alone: vertices (bounds, sample), vertices (cell of each),
 * faces (to their clusters), vertices (to every cluster whose faces use them). When the cells of
 * all vertices do not fit in memory, the faces are gone through some more times (homes.h).
 */
#ifndef WH_PIPELINE_INGEST_H
#define WH_PIPELINE_INGEST_H

#include "exec/exec.h"
#include "io/ply.h"
#include "pipeline/digest.h"
#include "pipeline/dispatch.h"
#include "pipeline/progress.h"

/* Positions of the cut vertices, in file order and file coordinates: three doubles each. */
typedef struct wh_cut_list {
	int fd; /* a file of the store's spill folder, for reading and writing */
	uint64_t n;
} wh_cut_list;

/* What every process has to know before several of them share an ingest: the bounds of all vertices
 * and the sample that the partition follows from. In the file WH_SCAN_NAME of a spill folder. */
typedef struct wh_scan {
	wh_vec3 lo, hi;
	uint64_t vertices, faces; /* of the source */
	uint64_t digest;          /* of the vertices */
	uint64_t samples;
	uint64_t checksum; /* XXH3 of the sample, which follows */
	uint32_t clusters, zero;
} wh_scan;

#define WH_SCAN_NAME "scan"

/* What one of them ingests: the faces, and vertices, of one stretch of the file. */
typedef struct wh_ingest_share {
	wh_spill *scratch; /* a folder that nobody else has to see */
	uint32_t part, parts;
} wh_ingest_share;

/* `clusters` and `share` decide what is in the files; the others, how much memory it takes. */
typedef struct wh_ingest_params {
	uint32_t clusters; /* 1 .. WH_MAX_CLUSTERS */
	size_t buffer;     /* bytes of write buffer a cluster */
	uint64_t window;   /* vertices whose cells are in memory at a time; 0: all */
	size_t visits; /* vertices outside their cells held in memory; 0: the least that works */
	wh_cut_list *cuts;            /* is filled; NULL: nobody wants to know */
	_Atomic uint64_t *digest;     /* of the bytes read (pipeline/digest.h); NULL: nobody asks */
	const wh_ingest_share *share; /* NULL: all of it is ingested here */
} wh_ingest_params;

typedef struct wh_ingest_result {
	wh_vec3 lo, hi;      /* bounds of all vertices, file coordinates */
	double scale;        /* a power of two that all positions were multiplied by */
	double step;         /* of new positions (algo/simplify.h), in scaled units; 0: floats */
	uint64_t faces;      /* stored */
	uint64_t degenerate; /* dropped: a vertex repeated */
	uint64_t cut_vertices;
	uint64_t windows;    /* 1: the cells of all vertices were in memory */
	uint64_t face_reads; /* faces read, all passes together */
	uint64_t vertex_reads,
	    record_reads; /* the same of positions, and of what comes with them */
} wh_ingest_result;

/* Bytes of memory that ingest holds at most. */
size_t wh_ingest_bytes(const wh_source *src, const wh_exec *ex, const wh_ingest_params *params);

/*
 * Makes the most of `budget` bytes: given the clusters, sets everything else in *params, and the
 * workers, of which there will be no more than in *ex. Returns the bytes that this takes: more than
 * the budget when the least is too much.
 */
size_t wh_ingest_fit(const wh_source *src, size_t budget, wh_exec *ex, wh_ingest_params *params);

/*
 * Fills `store` (spill and generation set by the caller). WH_E_IRREGULAR when the source turns
 * out to hold faces that are not triangles: rewrite the body and call again.
 */
wh_code wh_ingest(wh_ctx *c, const wh_exec *ex, wh_progress *progress, const wh_source *src,
                  const wh_ingest_params *params, wh_store *store, wh_ingest_result *result);

/*
 * The same by several processes: one scans the vertices, then each ingests its share, with
 * params->share and store->pieces set, into a file of its own, where a vertex may come several
 * times; the clusters of all of them together, one share's faces after the other's, hold the mesh
 * as wh_ingest would have cut it (pipeline/pieces.h). The scan is in the store's folder. A share
 * holds the homes of the vertices that its faces use and of those between them, and lists no cuts
 * but the ids of their vertices. Of the scan's result only bounds and what was read are set.
 */
wh_code wh_ingest_scan(wh_ctx *c, const wh_exec *ex, wh_progress *progress, const wh_source *src,
                       uint32_t clusters, wh_spill *spill, wh_ingest_result *result);
/* The digest of the vertices, as the scan met them. */
wh_code wh_ingest_scanned(wh_ctx *c, wh_spill *spill, uint64_t *digest);

/* The layout of the store that such a source is ingested into. */
void wh_ingest_describe(const wh_source *src, uint32_t clusters, wh_store *store);

#endif
