/*
 * OpenMP appears in this file alone. Without it the pragmas vanish and the loops are serial.
 *
 * OpenMP's libraries end the process when a thread cannot be started (ulimit -u, a control group's
 * pids.max, ulimit -v), and nobody cleans up. So before each loop the threads are started once
 * for trial; when the system refuses, the loop runs on fewer. A start takes some 10 microseconds.
 */
#define _GNU_SOURCE
#include "exec/exec.h"

#include "base/timer.h"

#include <sched.h>
#include <stdatomic.h>

#ifdef _OPENMP
#include <omp.h>
#include <pthread.h>
#endif

void wh_exec_note(wh_exec_stats *stats, const wh_exec_loop *loop)
{
	stats->loops += loop->seconds;
	stats->busy += loop->busy;
	for (int k = 0; k < WH_EXEC_POWERS; k++) {
		double least = loop->busy / (1 << k);
		least = least > loop->longest ? least : loop->longest;
		stats->model[k] += least > loop->commits ? least : loop->commits;
	}
}

int wh_exec_threads(int asked)
{
	if (asked > 0)
		return asked;
	cpu_set_t set;
	if (sched_getaffinity(0, sizeof set, &set) != 0)
		return 1;
	const int n = CPU_COUNT(&set);
	return n > 0 ? n : 1;
}

/* ---- threads for trial ---------------------------------------------------------------------- */

#ifdef _OPENMP

/* A thread for trial lives until all of them have been started. */
static void *linger(void *gate)
{
	(void)pthread_mutex_lock(gate);
	(void)pthread_mutex_unlock(gate);
	return NULL;
}

enum { TRIAL_MOST = 1024 };

/* How many of n threads the system starts beside those that exist. */
static int start_for_trial(int n)
{
	pthread_t thread[TRIAL_MOST];
	pthread_mutex_t gate = PTHREAD_MUTEX_INITIALIZER;
	int started = 0;
	(void)pthread_mutex_lock(&gate);
	while (started < n && pthread_create(&thread[started], NULL, linger, &gate) == 0)
		started++;
	(void)pthread_mutex_unlock(&gate);
	for (int i = 0; i < started; i++)
		(void)pthread_join(thread[i], NULL);
	return started;
}

/*
 * As many workers, the caller included, as can be started without risk. Half as many threads again
 * are tried: one that has just ended may keep its place in the system's count for a moment, and
 * others start threads too.
 */
static int startable(int workers)
{
	if (workers <= 1)
		return 1;
	if (workers > TRIAL_MOST * 2 / 3) /* more could not be tried */
		workers = TRIAL_MOST * 2 / 3;
	const int n = workers + workers / 2;
	const int started = start_for_trial(n);
	const int safe = 1 + started * 2 / 3;
	return started == n || safe > workers ? workers : safe;
}

#endif

/* ---- jobs ----------------------------------------------------------------------------------- */

/* The failure of the lowest index; jobs above it need not run. */
typedef struct outcome {
	_Atomic int64_t first_failed; /* index, INT64_MAX while there is none */
	wh_error err;                 /* guarded by the critical section below */
	int64_t err_index;
} outcome;

static void note_failure(outcome *o, int64_t index, wh_code code, const wh_error *err)
{
#ifdef _OPENMP
#pragma omp critical(wh_exec_outcome)
#endif
	{
		if (index < o->err_index) {
			o->err_index = index;
			o->err = *err;
			o->err.code = code;
			atomic_store(&o->first_failed, index);
		}
	}
}

/* Returns the seconds that it took. */
static double run_one(const wh_ctx *parent, outcome *o, wh_job job, void *arg, int64_t index,
                      int worker)
{
	const double start = wh_seconds();
	if (index >= atomic_load(&o->first_failed)) /* equal: the commit of a job that failed */
		return 0;
	wh_ctx own = wh_ctx_fork(parent);
	wh_code code = wh_poll(&own);
	if (code == WH_OK)
		code = job(&own, arg, index, worker);
	if (code != WH_OK)
		note_failure(o, index, code, &own.err);
	return wh_seconds() - start;
}

static int worker_number(void)
{
#ifdef _OPENMP
	return omp_get_thread_num();
#else
	return 0;
#endif
}

static wh_code settle(wh_ctx *c, const outcome *o)
{
	if (o->err_index == INT64_MAX)
		return WH_OK;
	if (o->err.code == WH_E_IRREGULAR)
		return WH_E_IRREGULAR; /* an internal signal, not a failure to report */
	return wh_fail(c, o->err.code, "%s", o->err.text);
}

static wh_code finish(wh_ctx *c, const wh_exec *ex, const outcome *o, wh_exec_loop *loop,
                      double start)
{
	loop->seconds = wh_seconds() - start;
	if (ex->stats)
		wh_exec_note(ex->stats, loop);
	return settle(c, o);
}

wh_code wh_exec_for(wh_ctx *c, const wh_exec *ex, int64_t n, wh_job job, void *arg)
{
	outcome o = {.first_failed = INT64_MAX, .err_index = INT64_MAX};
	const double start = wh_seconds();
	double busy = 0, longest = 0;
#ifdef _OPENMP
	const int workers = n > 1 ? startable(ex->workers) : 1;
#pragma omp parallel for schedule(dynamic, 1) num_threads(workers) if (workers > 1) \
    reduction(+ : busy) reduction(max : longest)
#endif
	for (int64_t i = 0; i < n; i++) {
		const double took = run_one(c, &o, job, arg, i, worker_number());
		busy += took;
		longest = longest > took ? longest : took;
	}
	return finish(c, ex, &o, &(wh_exec_loop){.busy = busy, .longest = longest}, start);
}

wh_code wh_exec_ordered(wh_ctx *c, const wh_exec *ex, int64_t n, wh_job job, wh_job commit,
                        void *arg)
{
	outcome o = {.first_failed = INT64_MAX, .err_index = INT64_MAX};
	const double start = wh_seconds();
	double busy = 0, longest = 0, commits = 0;
#ifdef _OPENMP
	const int workers = n > 1 ? startable(ex->workers) : 1;
#pragma omp parallel for ordered schedule(dynamic, 1) num_threads(workers) if (workers > 1) \
    reduction(+ : busy, commits) reduction(max : longest)
#endif
	for (int64_t i = 0; i < n; i++) {
		double took = run_one(c, &o, job, arg, i, worker_number()), last = 0;
#ifdef _OPENMP
#pragma omp ordered
#endif
		last = run_one(c, &o, commit, arg, i, worker_number());
		took += last;
		busy += took;
		commits += last;
		longest = longest > took ? longest : took;
	}
	return finish(c, ex, &o,
	              &(wh_exec_loop){.busy = busy, .longest = longest, .commits = commits}, start);
}

wh_code wh_exec_gather(wh_ctx *c, const wh_exec *ex, int64_t n, wh_job job, wh_job commit,
                       void *arg)
{
	outcome o = {.first_failed = INT64_MAX, .err_index = INT64_MAX};
	const double start = wh_seconds();
	double busy = 0, longest = 0, commits = 0;
#ifdef _OPENMP
	const int workers = n > 1 ? startable(ex->workers) : 1;
#pragma omp parallel for schedule(dynamic, 1) num_threads(workers) if (workers > 1) \
    reduction(+ : busy, commits) reduction(max : longest)
#endif
	for (int64_t i = 0; i < n; i++) {
		double took = run_one(c, &o, job, arg, i, worker_number()), last = 0;
#ifdef _OPENMP
#pragma omp critical(wh_exec_commit)
#endif
		last = run_one(c, &o, commit, arg, i, worker_number());
		took += last;
		busy += took;
		commits += last;
		longest = longest > took ? longest : took;
	}
	return finish(c, ex, &o,
	              &(wh_exec_loop){.busy = busy, .longest = longest, .commits = commits}, start);
}
