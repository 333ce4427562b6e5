/*
 * The processes of an MPI job do the stages of a shared run (run/share.c) between meeting points:
 * the first one what is done alone, each of them its part.
 *
 *     rank 0      all          rank 0     all           rank 0
 *     plan   -|-  ingest  -|-  join  -|-  decimate  -|- join ... finish
 *
 * A rank that fails leaves its state as any stage does, and ends the job: whoever resumes it, with
 * any number of processes, finds what the others had done.
 */
#define _GNU_SOURCE
#include "base/mem.h"
#include "base/timer.h"
#include "exec/exec.h"
#include "exec/ranks.h"
#include "exec/topo.h"
#include "run/run.h"

#include <stdio.h>
#include <string.h>
#include <unistd.h>

/* What MPI itself takes of each process' memory. */
static const size_t MPI_BYTES = (size_t)16 << 20;

enum { MOST_TRIES = 20 }; /* at one round, by parts that are all done */

typedef struct job {
	wh_ctx *c;
	wh_ranks ranks;
	wh_reduce_params params; /* of this rank */
	wh_reduce_report *report;
	wh_phase_report phase[WH_PHASES]; /* of the parts that this rank has done */
	uint64_t bytes_read, bytes_written;
	size_t memory_peak; /* of its stages */
} job;

int wh_mpi_processes(void)
{
	return wh_ranks_launched();
}

bool wh_mpi_is_built_in(void)
{
#ifdef WH_HAVE_MPI
	return true;
#else
	return false;
#endif
}

static void add_phases(wh_phase_report *sum, const wh_phase_report *one)
{
	for (int i = 0; i < WH_PHASES; i++) {
		sum[i].seconds += one[i].seconds;
		sum[i].serial += one[i].serial;
		sum[i].busy += one[i].busy;
		sum[i].bytes_read += one[i].bytes_read;
		sum[i].bytes_written += one[i].bytes_written;
		if (one[i].memory_peak > sum[i].memory_peak)
			sum[i].memory_peak = one[i].memory_peak;
		for (int k = 0; k < WH_SCALING; k++)
			sum[i].model[k] += one[i].model[k];
	}
}

/* While a rank works alone, those of its machine sleep: their cores are its own, as far as the
 * launcher has not bound it to fewer. */
static int threads_alone(const job *j)
{
	const int own = j->params.threads, allowed = wh_exec_threads(0);
	const int all = own * j->ranks.local;
	return all < allowed ? all : own < allowed ? allowed : own;
}

/* A stage that is for this rank. */
static wh_code do_stage(job *j, wh_stage stage, uint32_t round)
{
	wh_reduce_params p = j->params;
	if (!wh_run_stage_has_parts(stage))
		p.threads = threads_alone(j);
	p.stage = stage;
	p.round = round;
	p.resume = p.resume || stage != WH_STAGE_PLAN;
	const wh_code code = wh_reduce(j->c, &p, j->report);
	if (j->report->memory_peak > j->memory_peak)
		j->memory_peak = j->report->memory_peak;
	if (wh_run_stage_has_parts(stage)) {
		add_phases(j->phase, j->report->phase);
		j->bytes_read += j->report->bytes_read;
		j->bytes_written += j->report->bytes_written;
	}
	return code;
}

/* One that the first rank does alone; *next: the round to be shared after it, for all to know. */
static wh_code do_alone(job *j, wh_stage stage, uint64_t *next)
{
	*next = 0;
	if (j->ranks.rank == 0 && do_stage(j, stage, 0) != WH_OK)
		return j->c->err.code;
	if (j->ranks.rank == 0)
		*next = j->report->next_round;
	return wh_ranks_meet(j->c, &j->ranks, next);
}

/* One that all share. */
static wh_code do_parts(job *j, wh_stage stage, uint32_t round)
{
	uint64_t nothing = 0;
	if (do_stage(j, stage, round) != WH_OK)
		return j->c->err.code;
	return wh_ranks_meet(j->c, &j->ranks, &nothing);
}

static wh_code all_stages(job *j)
{
	uint64_t round;
	if (do_alone(j, WH_STAGE_PLAN, &round) != WH_OK ||
	    do_parts(j, WH_STAGE_INGEST, 0) != WH_OK || do_alone(j, WH_STAGE_JOIN, &round) != WH_OK)
		return j->c->err.code;
	for (uint64_t last = 0, tries = 0; round > 0; last = round) {
		/* where a new name is seen late, the first rank misses parts that are there */
		tries = round == last ? tries + 1 : 0;
		if (tries == MOST_TRIES)
			return wh_fail(j->c, WH_E_RUN,
			               "'%s' does not show all processes the same files: take a "
			               "folder that the machines share",
			               j->params.run_dir);
		if (do_parts(j, WH_STAGE_DECIMATE, (uint32_t)round) != WH_OK ||
		    do_alone(j, WH_STAGE_JOIN, &round) != WH_OK)
			return j->c->err.code;
	}
	return j->ranks.rank == 0 ? do_stage(j, WH_STAGE_FINISH, 0) : WH_OK;
}

/* What this rank may use, where nobody has said so: its share of the machine. */
static void share_machine(job *j)
{
	wh_reduce_params *p = &j->params;
	const size_t local = (size_t)j->ranks.local;
	if (p->memory == 0)
		p->memory = wh_topo_memory() / 2 / local;
	p->memory = p->memory > 2 * MPI_BYTES ? p->memory - MPI_BYTES : p->memory / 2;
	const int threads = wh_exec_threads(0);
	if (p->threads == 0) /* unless the launcher has bound them apart */
		p->threads =
		    threads == (int)sysconf(_SC_NPROCESSORS_ONLN) ? threads / (int)local : threads;
	if (p->threads == 0)
		p->threads = 1;
	p->parts = (uint32_t)j->ranks.size;
	p->part = (uint32_t)j->ranks.rank;
	p->crew = WH_CREW_JOB;
	if (j->ranks.rank != 0) {
		p->progress = NULL;
		p->notice = NULL;
	}
}

/* Beside the output, where no run directory is given. */
static char *run_dir_of(wh_ctx *c, const wh_reduce_params *p)
{
	const char *output = strcmp(p->output, "-") == 0 ? "whittle" : p->output;
	const size_t room = strlen(output) + sizeof ".run";
	char *dir = wh_alloc(c, room, 1);
	if (dir)
		(void)snprintf(dir, room, "%s.run", output);
	return dir;
}

wh_code wh_reduce_mpi(wh_ctx *c, const wh_reduce_params *params, wh_reduce_report *report)
{
	const double start = wh_seconds();
	job j = {.c = c, .params = *params, .report = report};
	*report = (wh_reduce_report){0};
	c->err = (wh_error){0};
	if (wh_run_needs_files(c, params) != WH_OK)
		return c->err.code;
	char *dir = params->run_dir ? NULL : run_dir_of(c, params);
	if (dir)
		j.params.run_dir = dir;
	wh_code code = c->err.code == WH_OK ? wh_ranks_open(c, &j.ranks) : c->err.code;
	if (code == WH_OK) {
		share_machine(&j);
		code = all_stages(&j);
	}
	add_phases(report->phase, j.phase);
	report->bytes_read += j.bytes_read;
	report->bytes_written += j.bytes_written;
	if (j.memory_peak > report->memory_peak)
		report->memory_peak = j.memory_peak;
	report->seconds_total = wh_seconds() - start;
	report->ranks = j.ranks.size;
	report->threads = j.params.threads;
	report->rank = j.ranks.rank;
	wh_free(c, dir);
	if (code == WH_OK || code == WH_E_TARGET)
		wh_ranks_close(&j.ranks);
	return code;
}

void wh_reduce_mpi_abort(int status)
{
	const wh_ranks all = {.began = wh_mpi_is_built_in()};
	wh_ranks_abort(&all, status);
}
