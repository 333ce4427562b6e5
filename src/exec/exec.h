/*
 * exec: run n independent jobs, perhaps on several threads; commit their results in index order.
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

typedef struct wh_exec {
	int workers; /* at least 1; worker numbers passed to jobs are 0 .. workers-1 */
} wh_exec;

/* One job. `c` is the worker's own context; `worker` tells which of its caller's scratch
 * buffers this job may use. */
typedef wh_code (*wh_job)(wh_ctx *c, void *arg, int64_t index, int worker);

/* Threads this process may use: `asked`, or all of its affinity mask when asked is 0. */
int wh_exec_threads(int asked);

/* Runs job(0 .. n-1), in any order. Serial when ex has one worker or OpenMP is missing. */
wh_code wh_exec_for(wh_ctx *c, const wh_exec *ex, int64_t n, wh_job job, void *arg);

/* The same, and after each job its commit, one at a time, in index order, on the same worker as
 * its job and before that worker starts another. */
wh_code wh_exec_ordered(wh_ctx *c, const wh_exec *ex, int64_t n, wh_job job, wh_job commit,
                        void *arg);

#endif
