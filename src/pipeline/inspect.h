/*
 * inspect: the check of a file that may be larger than memory.
 *
 * A mesh that fits the ceiling is loaded and checked as it is. A larger one is cut into clusters
 * on disk, which are looked at several at a time (mesh/check_pieces); its vertices are streamed
 * to find coincident ones. Either way the counts are the same.
 */
#ifndef WH_PIPELINE_INSPECT_H
#define WH_PIPELINE_INSPECT_H

#include "exec/exec.h"
#include "io/format.h"
#include "mesh/check.h"
#include "pipeline/progress.h"
#include "pipeline/store.h"

typedef struct wh_inspect_params {
	const char *path;
	wh_format from;       /* of the file; WH_FORMAT_ANY: what it looks like */
	const char *temp_dir; /* NULL: $SLURM_TMPDIR, $TMPDIR, /tmp */
	size_t memory;        /* ceiling of the process, bytes; 0: half of what there is */
	bool rply;            /* rply reads the file (pipeline/normalise.h) */
	bool weld;            /* first weld near vertices, as pipeline/clean.h says */
	double weld_distance, weld_share;
	uint64_t cluster_faces;  /* cut into clusters of about so many faces whether it is needed or
	                            not; 0: as the memory says */
	wh_progress_fn progress; /* may be NULL */
	void *progress_user;
} wh_inspect_params;

/*
 * Checks a file. Degenerate faces and those with a corner that is not finite count among the faces,
 * but have no part in anything else; so do those that welding takes, and its vertices.
 * WH_E_INPUT for a damaged file, also an index out of range, and for one without any faces;
 * WH_E_PLAN when the ceiling is too low, with a size that would do. c->mem->limit is set for the
 * time of the call. *is_double (may be NULL): positions are doubles.
 */
wh_code wh_inspect_file(wh_ctx *c, const wh_exec *ex, const wh_inspect_params *p, wh_check *r,
                        bool *is_double);

/*
 * Checks the mesh of a store of clusters, which stays. *r is as from wh_check_pieces_end:
 * positions are those of the store, and vertices without faces are not known. Memory:
 * wh_inspect_bytes of the largest cluster for each worker, and 330 bytes for each cut vertex.
 */
wh_code wh_inspect_store(wh_ctx *c, const wh_exec *ex, wh_progress *progress, const wh_store *store,
                         wh_check *r);
size_t wh_inspect_bytes(const wh_store *store, uint64_t max_vertices, uint64_t max_faces);

#endif
