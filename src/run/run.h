/*
 * run: one reduction in progress, and its stages. whittle.c calls them, in their order; above it,
 * whittle_mpi.c does so for each part of a shared run.
 *
 *     open.c     input and ingest; the copy where there is nothing to do
 *     plan.c     what the stages will take, and what it is refused for
 *     carried.c  which properties go over into the result
 *     hygiene.c  what the user wants gone before anything is reduced
 *     seams.c    the cut vertices of the first partition, for those who want to see them
 *     rounds.c   survey, decimate, recut
 *     stream.c   a result larger than memory: settle, check, emit, cluster by cluster
 *     last.c     a result that fits: stitch, final pass, check, write
 *     output.c   the outputs: when they are opened, what they may replace
 *     record.c   a run whose collapses are kept: progressive meshes
 *     share.c    runs that several processes share: what a part does, and how parts are joined
 *     levels.c   several results: which one is next, what became of it
 *     resume.c   the folder of a run that can be resumed, and what is done of it; manifest.h is how
 *                that is written down
 *     run.c      what they all ask: targets, budget, style of the result, times
 *
 * Each stage keeps its time in the report and takes the memory that the budget leaves. What the
 * stages do is in pipeline/.
 */
#ifndef WH_RUN_RUN_H
#define WH_RUN_RUN_H

#include "whittle.h"

#include "io/outfile.h"
#include "mesh/check.h"
#include "pipeline/clean.h"
#include "pipeline/ingest.h"
#include "pipeline/ledger.h"
#include "pipeline/normalise.h"
#include "pipeline/plan.h"
#include "pipeline/polish.h"
#include "pipeline/recut.h"
#include "pipeline/round.h"
#include "pipeline/sequence.h"
#include "pipeline/sift.h"
#include "run/manifest.h"

typedef struct wh_run {
	wh_ctx *c;
	const wh_reduce_params *params;
	wh_reduce_report *report;
	wh_exec exec;
	wh_progress progress;
	wh_spill spill;
	bool rply;      /* reads the input */
	wh_format from; /* of the input, where the user says so */
	wh_format to;   /* of the output */
	wh_packing packing;
	wh_policy_choice policy; /* but for its unscale */
	wh_input input;
	bool input_open;
	bool stitched; /* the patch holds the mesh */
	wh_clean_result clean;
	wh_sift_result sift;
	wh_ingest_result ingest;
	wh_cut_list cuts;  /* when seams are asked for; its fd is -1 when there is none */
	wh_outfile *seams; /* NULL: they are not */
	wh_store store;    /* what the mesh lies in now */
	uint64_t faces;    /* of it */
	uint32_t generations, recuts;
	uint32_t recuts_begun; /* of the result at hand: cuts anew before it */
	wh_patch patch;
	wh_sequence sequence; /* of a progressive mesh: what was done to it, */
	uint64_t recorded;    /* and its faces at the beginning */
	size_t at;            /* the result to reach: a level, or, after all of them, the last */
	wh_level aim;         /* its limits */
	double max_err;
	double phase_start;
	wh_exec_stats stats; /* of the phase so far, as are the next two */
	uint64_t phase_read, phase_written;
	size_t memory; /* ceiling */
	wh_plan_sizes sizes;
	wh_plan plan;
	wh_simplify_result work; /* of all stages */
	double start;            /* of the run; earlier by what processes before this one took */

	bool journaled; /* there is a run directory, it is ours, and the next lines count */
	wh_manifest book;
	size_t recalled; /* steps of it that this process has gone through */
	wh_ledger ledger;
	uint32_t shared;         /* steps gone through whose clusters were cut into parts */
	bool joined;             /* this process has done a step */
	_Atomic uint64_t digest; /* of the input */
	/* outputs that are our own, of the time before */
	bool replace_level[WH_LEVELS_MOST + 1], replace_seams;
} wh_run;

/* ---- run.c: what the stages share --------------------------------------------------------- */

void wh_run_phase_begin(wh_run *r);
/* Adds the time since then to the phase's; returns `code`. */
wh_code wh_run_phase_end(wh_run *r, wh_phase phase, wh_code code);

/* Bytes that stages may hold. */
size_t wh_run_budget(const wh_run *r);
/* A refusal that names a ceiling that does for all stages. */
wh_code wh_run_too_small(wh_run *r, const char *what, size_t need);
/* As many workers as fit when each takes `each` bytes, and one at least: what a stage may come to
 * hold is an upper bound, and the account refuses what the ceiling really cannot bear. */
wh_exec wh_run_workers(const wh_run *r, size_t each);

/* To the temporary folder and to outputs, so far. */
uint64_t wh_run_bytes_written(wh_run *r);
/* Refuses parameters without an input or an output. */
wh_code wh_run_needs_files(wh_ctx *c, const wh_reduce_params *p);
/* Counts of faces and vertices that the aim is to reach, into the report. */
void wh_run_targets(wh_run *r);
/* The distance that the aim allows. */
void wh_run_limit_error(wh_run *r);
/* Share of the faces there are now that the targets ask to keep; 0 when no count limits it. */
double wh_run_target_ratio(const wh_run *r);
/* True when the target is no smaller than the input. */
bool wh_run_is_no_smaller(const wh_run *r);
/* True when the input is the result: the target is no smaller, and text is not asked of binary. */
bool wh_run_copies(const wh_run *r);
/* Vertices that are left. */
uint64_t wh_run_vertices(const wh_run *r);
/* Only the files that ingest wrote hold vertices of no face. */
void wh_run_note_unreferenced(wh_run *r, uint64_t n);

/* The properties to carry, as far as the output has room for them. */
wh_wanted wh_run_wanted(const wh_run *r);
wh_ply_style wh_run_style(const wh_run *r);
wh_polish wh_run_polish(const wh_run *r);
/* A result that is streamed, when it was to be polished. */
wh_code wh_run_refuse_polish(wh_run *r);
wh_simplify_params wh_run_engine(const wh_run *r);
/* Bytes that the engine keeps for a vertex besides its workspace. */
size_t wh_run_state_bytes(const wh_run *r);
/* The policy that the parameters name. */
wh_code wh_run_take_policy(wh_run *r);
wh_plan_sizes wh_run_sizes(const wh_reduce_params *p);
void wh_run_note_check(wh_run *r, const wh_check *found);

/* ---- open.c ------------------------------------------------------------------------------- */

wh_code wh_run_open_spill(wh_run *r);
wh_code wh_run_open_input(wh_run *r);
wh_code wh_run_ingest(wh_run *r);
/* The target is no smaller than the input: its bytes are the result. */
wh_code wh_run_copy_input(wh_run *r, wh_outfile **out);

/* ---- plan.c ------------------------------------------------------------------------------- */

/* Makes r->plan. What cannot be done within the ceiling, or by the formats of the outputs, is
 * refused. */
wh_code wh_run_plan(wh_run *r);
/* So is a disk that is too small for the temporary files, or for a result whose size is known. */
wh_code wh_run_foresee_disks(wh_run *r);

/* ---- carried.c ---------------------------------------------------------------------------- */

/* Names in the report what the result takes over from the input, and what it does not. */
void wh_run_list_carried(wh_run *r);

/* ---- hygiene.c ---------------------------------------------------------------------------- */

/* True when something is asked for that changes the mesh before it is reduced. */
bool wh_run_has_hygiene(const wh_run *r);
/* Takes invalid and welded vertices out of the input, which then is another file. */
wh_code wh_run_clean_input(wh_run *r);
/* Takes copies of faces and small components out of the store. */
wh_code wh_run_sift(wh_run *r);
/* What both found, now or in an earlier process, into the report. */
void wh_run_note_hygiene(wh_run *r);
/* Memory and temporary disk that cleaning takes at least, for the plan. */
size_t wh_run_clean_bytes(const wh_run *r);
uint64_t wh_run_clean_disk(const wh_run *r);

/* ---- output.c ----------------------------------------------------------------------------- */

/* Opens the output where it is not open yet. With a run directory it is only looked at first, and
 * opened when there is something to write: nothing of it lies about after a kill. */
wh_code wh_run_try_output(wh_run *r);
wh_code wh_run_open_output(wh_run *r, wh_outfile **out);
/* The output is whole: its name, its size, its checksum. */
wh_code wh_run_commit(wh_run *r, wh_outfile **out);

/* ---- levels.c ----------------------------------------------------------------------------- */

/* How many results there are, the last included. */
size_t wh_run_results(const wh_run *r);
/* The limits and the output of result i. */
wh_level wh_run_result(const wh_run *r, size_t i);
static inline bool wh_run_is_last(const wh_run *r)
{
	return r->at == r->params->levels;
}
/* Result i is next. */
void wh_run_aim(wh_run *r, size_t i);
/* True for a level that is no smaller than the input, and will not be. */
bool wh_run_leaves_out(wh_run *r);
/* True when an earlier process has delivered the level that was reached. */
bool wh_run_is_delivered(wh_run *r);
/* The level at hand, which is not the last, is in its output. */
void wh_run_note_level(wh_run *r, const wh_written *w);

/* ---- resume.c ----------------------------------------------------------------------------- */

/*
 * Opens the run directory: a new run, or the one in it. Then every stage, before it does a step,
 * asks whether it is done, and notes it when it is. All of these do nothing, and nothing is done,
 * where there is no run directory.
 */
wh_code wh_run_open_folder(wh_run *r);
/* True when the input was ingested by an earlier process. */
bool wh_run_is_begun(const wh_run *r);
/* Opens the input of a begun run and refuses another one. */
wh_code wh_run_reopen_input(wh_run *r);
/* Looks at the input; with a planned run, refuses another one. */
wh_code wh_run_look(wh_run *r);
/* Refuses an input, which is open, that is not the one that the run was planned for. */
wh_code wh_run_compare_input(wh_run *r);
/* The plan is made: for good, once this returns. */
wh_code wh_run_sign_plan(wh_run *r);
/* True, with *step filled, when the next step, which is of this kind, is done. */
bool wh_run_recall_step(wh_run *r, wh_step_kind kind, wh_step *step);
/* The ledger of the next step, a round over so many clusters, whose parts leave entries of a kind.
 * NULL: there is none, or it failed, which is recorded. */
wh_ledger *wh_run_ledger(wh_run *r, uint32_t clusters, wh_ledger_kind kind);
/* The step is done: for good, once this returns. */
wh_code wh_run_note_step(wh_run *r, const wh_step *step);
/* The files of a store are not needed any more. */
void wh_run_forget(wh_run *r, const wh_store *store);
/* The end of the run, whole or not. */
void wh_run_close_folder(wh_run *r, wh_code code);

/* ---- share.c ------------------------------------------------------------------------------ */

enum { WH_PARTS_MOST = 65536 };

/* Parameters that go together. */
wh_code wh_run_sensible_stage(wh_ctx *c, const wh_reduce_params *p);
/* True for a process that does a part, and changes nothing of the run's state. */
bool wh_run_is_part(const wh_run *r);
/* True when all processes that do parts are at hand, as those of an MPI job are. */
bool wh_run_is_job(const wh_run *r);
/* True when several processes may be at a stage, each at a part of it. */
bool wh_run_stage_has_parts(wh_stage stage);
/* True when parts can ingest the input, which is open or was looked at. */
bool wh_run_shares_input(const wh_run *r);
/* The stages that come before, or instead of, those of whittle.c. These and the next ones fail with
 * WH_E_PAUSE when this process has done what it was started for. */
wh_code wh_run_stage(wh_run *r);
/* Adds what was read of the input. */
void wh_run_count_reads(wh_run *r, const wh_ingest_result *done);
/* *taken: the parts ingested all of the input, and r->store is theirs. */
wh_code wh_run_take_ingest(wh_run *r, bool *taken);
/* The next step has parts: is it this process' turn, or are they all there? */
wh_code wh_run_parts(wh_run *r, const wh_ledger *l, wh_ledger_kind kind);
/* The part is done; returns `code` otherwise. */
wh_code wh_run_end_part(wh_run *r, wh_code code);
/* The next step is nothing for parts. */
wh_code wh_run_alone(wh_run *r);
/* There are no more rounds. */
wh_code wh_run_end_rounds(wh_run *r);

/* ---- record.c ----------------------------------------------------------------------------- */

/* These do nothing where no progressive mesh is wanted. Parameters that go together: */
wh_code wh_run_sensible_record(wh_ctx *c, const wh_reduce_params *p);
/* Adds what recording takes to the plan. */
void wh_run_plan_record(wh_run *r);
/* What cannot be recorded, or has no room, is refused; the plan is made. */
wh_code wh_run_refuse_record(wh_run *r);
/* The mesh is ingested: what is done to it from here on is recorded. */
void wh_run_begin_record(wh_run *r);
/* A result that is streamed has no record. */
wh_code wh_run_refuse_streamed(wh_run *r);
/* The progressive mesh, whose base is the patch. */
wh_code wh_run_write_record(wh_run *r, wh_outfile **out);

/* ---- seams.c ------------------------------------------------------------------------------ */

/* All of these do nothing when no seams are asked for. */
wh_code wh_run_open_seams(wh_run *r);
/* What ingest listed is all there; with a run directory, for the processes to come. */
wh_code wh_run_keep_seams(wh_run *r, wh_step *step);
wh_code wh_run_recall_seams(wh_run *r, const wh_step *step);
/* Puts it into the output, which appears with the result; with a run directory not before that. */
wh_code wh_run_write_seams(wh_run *r, bool last);
/* Gives up what has not appeared. */
void wh_run_close_seams(wh_run *r);

/* ---- rounds.c ----------------------------------------------------------------------------- */

/* Workers for stages that hold one cluster each. */
wh_code wh_run_cluster_workers(wh_run *r, wh_exec *ex);
/* The cost limits of a round that is to keep this share of the faces. */
wh_code wh_run_survey(wh_run *r, double keep, wh_cluster_params *p);
/* Cuts anew; `free_all`: away from vertices that were on every cut. */
wh_code wh_run_recut(wh_run *r, bool free_all);
/* Decimates all clusters so that a share of the faces is left, or to the error limit. */
wh_code wh_run_round(wh_run *r, double keep);
/* Rounds, until the mesh fits the final pass or a round no longer helps. */
wh_code wh_run_rounds(wh_run *r);

/* ---- stream.c ----------------------------------------------------------------------------- */

wh_code wh_run_settle(wh_run *r);
wh_code wh_run_check_clusters(wh_run *r);
wh_code wh_run_emit(wh_run *r, wh_outfile **out);

/* ---- last.c ------------------------------------------------------------------------------- */

wh_code wh_run_stitch(wh_run *r);
wh_code wh_run_final_pass(wh_run *r);
wh_code wh_run_order(wh_run *r);
wh_code wh_run_check(wh_run *r);
wh_code wh_run_write(wh_run *r, wh_outfile **out);

#endif
