/*
 * exec: run n independent jobs, perhaps on several threads; commit their results, in index order
 * or in any.
 *
 * The only place that knows about threads. What a job computes must not depend on which worker
 * runs it or on what else has run: then nothing the caller sees depends on the schedule.
 *
 * A failing job stops the run: jobs not yet started are skipped, and the failure of the lowest
 * failing index is recorded in the caller's context. exec polls the context's cancel flag
 * before every job. When the system refuses to start that many threads, fewer do the work.
 */
#ifndef WH_EXEC_EXEC_H
#define WH_EXEC_EXEC_H

#include "base/status.h"

enum { WH_EXEC_POWERS = 9 }; /* 1, 2, 4 ... 256 workers */

/* What loops took, and what they would take: see wh_exec_note. */
typedef struct wh_exec_stats {
	double loops;                 /* seconds from begin to end */
	double busy;                  /* seconds that workers were at jobs and commits */
	double model[WH_EXEC_POWERS]; /* seconds of the loops with 2^k workers */
} wh_exec_stats;

typedef struct wh_exec {
	int workers;          /* at least 1; worker numbers passed to jobs are 0 .. workers-1 */
	wh_exec_stats *stats; /* each loop is added to it; NULL: nobody wants to know */
} wh_exec;

/* How a loop went. */
typedef struct wh_exec_loop {
	double seconds, busy;
	double longest; /* job with its commit */
	double commits; /* all of them: one at a time */
} wh_exec_loop;

/* Adds a loop to the stats. With p workers it would take at least a p-th of the time it kept them
 * busy, its longest job, and its commits: the model takes the largest of the three (Graham's bound
 * for list scheduling is no more than the sum of the first two). */
void wh_exec_note(wh_exec_stats *stats, const wh_exec_loop *loop);

/*
 * One job. `c` is the worker's own context; `worker` tells which workspace is its own.
 *
 * A workspace is what one worker keeps from job to job: buffers, and what its jobs have found. The
 * callers of loops have an array of them, one for each worker, where nobody else may look before
 * the loop has ended or it is that worker's commit.
 */
typedef wh_code (*wh_job)(wh_ctx *c, void *arg, int64_t index, int worker);

/* Threads this process may use: `asked`, or all of its affinity mask when asked is 0. */
int wh_exec_threads(int asked);

/* Runs job(0 .. n-1), in any order. Serial when ex has one worker or OpenMP is missing. */
wh_code wh_exec_for(wh_ctx *c, const wh_exec *ex, int64_t n, wh_job job, void *arg);

/* The same, and after each job its commit, one at a time, in index order, on the same worker as
 * its job and before that worker starts another. */
wh_code wh_exec_ordered(wh_ctx *c, const wh_exec *ex, int64_t n, wh_job job, wh_job commit,
                        void *arg);

/* The same with commits in any order, which nothing may depend on: nobody waits for a job before
 * his that takes longer. */
wh_code wh_exec_gather(wh_ctx *c, const wh_exec *ex, int64_t n, wh_job job, wh_job commit,
                       void *arg);

#endif
