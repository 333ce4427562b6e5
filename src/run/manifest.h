/*
 * manifest: what a run that can be resumed knows of itself, in a file of its kept folder.
 *
 * Who works on it, the parameters that decide the result's bytes, which input it is, the sums of
 * the report so far, and the steps that are done, each with all that came out of it besides
 * cluster files: a run that is resumed goes through its stages again and takes the results of
 * these steps from here. The file is text:
 *
 *     whittle-run 2 TOKEN
 *     [run]
 *     version 0.1.0
 *     pid 4711
 *     ...
 *     [parameters]
 *     faces 200000
 *     ...
 *     [phase ingest]
 *     seconds 0x3ff0000000000000
 *     ...
 *     [step ingest]
 *     ...
 *     checksum 0123456789abcdef
 *
 * Reals are their bits, so that none is lost. What is zero is left out. The checksum is the XXH3 of
 * all lines before it. The file is replaced as a whole, by renaming, and flushed.
 */
#ifndef WH_RUN_MANIFEST_H
#define WH_RUN_MANIFEST_H

#include "whittle.h"

#include "algo/simplify.h"
#include "pipeline/clean.h"
#include "pipeline/ingest.h"
#include "pipeline/sift.h"
#include "pipeline/store.h"

#define WH_MANIFEST_NAME "manifest"

/* The parameters that decide the bytes of the result. */
typedef struct wh_choices {
	uint64_t faces, vertices, cluster_faces, micro_faces, final_faces;
	double face_ratio, vertex_ratio, error, error_share, round_keep;
	uint64_t smooth;
	bool normals, ascii, quantize, seams, simplify_topology, fast, lock_boundary;
	bool drop_invalid, weld, drop_duplicates;
	double weld_distance, weld_share;
	uint64_t min_component;
	uint64_t from, to, packing;             /* formats, as numbers */
	uint64_t attributes_hash, weights_hash; /* of what was asked for; 0: nothing */
	uint64_t cost, face_weight, placement, own_hash, levels_hash;
} wh_choices;

typedef enum wh_step_kind {
	WH_STEP_INGEST,
	WH_STEP_SURVEY,
	WH_STEP_REDUCE, /* the clusters of a round, to one cost limit */
	WH_STEP_RECUT,
	WH_STEP_SETTLE, /* the clusters of a last round, with one bound of the trial */
	WH_STEP_WRITE,  /* the outputs are whole and about to get their names */
	WH_STEP_KINDS
} wh_step_kind;

/* What a step left. Each kind sets what it has; the rest is zero. */
typedef struct wh_step {
	wh_step_kind kind;
	bool kept;      /* the store below is what the mesh lies in from then on */
	wh_store store; /* its spill and ledger are not in the file */
	uint64_t faces, unreferenced;
	wh_simplify_result work;
	double max_cost, micro_cost; /* survey */
	uint64_t never_free;         /* recut */
	bool reached, one_less;      /* settle */
	/* ingest: */
	uint64_t input_vertices, input_faces, polygons, degenerate;
	bool is_double;
	wh_clean_result clean;
	wh_sift_result sift;
	wh_ingest_result ingest;
	uint64_t cuts, cuts_checksum;
	/* write: */
	uint64_t result;       /* which of the run's results */
	wh_level_report level; /* what became of it, but for the last */
} wh_step;

/* Outputs that were about to get their names, and have perhaps got them. Unlike steps they are
 * never forgotten: whatever is done again, they are the run's own, and may be replaced. */
typedef struct wh_written {
	uint64_t result; /* which of the run's results */
	uint64_t output_bytes, seams_bytes;
	char output[33], seams[33]; /* checksums */
} wh_written;

typedef struct wh_manifest {
	char token[WH_SPILL_TAG]; /* of the process at work */
	char version[32];         /* of whittle */
	char host[64];
	uint64_t pid, started; /* started: as the system counts, to tell a process from a later one
	                          of the same number */
	uint64_t resumed;      /* times */
	/* the input, once it was ingested */
	char input[256]; /* its path, for people; perhaps cut */
	uint64_t input_bytes, input_seconds, input_nanoseconds, input_digest;
	bool digest_of_file; /* of all bytes, and not of vertices and faces */
	uint64_t parts;      /* that the run was planned for; 0: none */
	bool shared_ingest;  /* there is a scan, and parts can ingest */
	/* the plan */
	uint64_t clusters, rounds, peak_disk;
	bool streams;
	/* sums so far */
	uint64_t bytes_read, temp_read, temp_written, temp_peak;
	double seconds;
	wh_choices choices;
	wh_phase_report phase[WH_PHASES];
	wh_step *step;
	size_t steps, cap;
	wh_written *written; /* one for a result at most */
	size_t n_written, written_cap;
} wh_manifest;

void wh_manifest_free(wh_ctx *c, wh_manifest *m);
wh_code wh_manifest_add(wh_ctx *c, wh_manifest *m, const wh_step *step);
/* Instead of what there was of the same result. */
wh_code wh_manifest_note_written(wh_ctx *c, wh_manifest *m, const wh_written *w);

/* Replaces the file. */
wh_code wh_manifest_write(wh_ctx *c, wh_spill *spill, const wh_manifest *m);
/* Reads it; *found: there was one. One that is damaged, or of another version of whittle, is
 * refused with the remedy. */
wh_code wh_manifest_read(wh_ctx *c, wh_spill *spill, wh_manifest *m, bool *found);
/* True when the file is that of this process. */
bool wh_manifest_is_ours(wh_ctx *c, wh_spill *spill, const char *token);

/* Says which parameters differ, such as "faces was 100 and is 200". False: none. */
bool wh_choices_differ(const wh_choices *was, const wh_choices *is, char *text, size_t n);

const char *wh_step_name(wh_step_kind kind);

#endif
