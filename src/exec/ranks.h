/*
 * ranks: the processes of an MPI job, as far as whittle needs them: who am I, and meeting points.
 *
 * The only place that knows about MPI. Ranks share a run directory and do parts of one run
 * (run/share.c); nothing travels between them but the number that the first one brings to a
 * meeting. Without MPI, or when no launcher started several processes, there is one rank.
 */
#ifndef WH_EXEC_RANKS_H
#define WH_EXEC_RANKS_H

#include "base/status.h"

typedef struct wh_ranks {
	int rank, size;
	int local; /* ranks on this machine */
	bool began;
} wh_ranks;

/* How many processes the launcher says it has started (of Open MPI, MPICH or Slurm), 1 when there
 * is none. Costs nothing: looks at the environment. */
int wh_ranks_launched(void);

/* Starts MPI. All ranks call this and those below, in the same order. WH_E_USAGE when the launcher
 * has started several processes that cannot know each other; the message says why. */
wh_code wh_ranks_open(wh_ctx *c, wh_ranks *r);
void wh_ranks_close(wh_ranks *r);

/*
 * Waits for all others, and gives them the value that rank 0 has in *value. The wait takes no
 * processor time, and ends when the caller's context asks to stop.
 */
wh_code wh_ranks_meet(wh_ctx *c, const wh_ranks *r, uint64_t *value);

/* Ends all ranks, this one too, with that exit status. Returns only where there is no MPI. */
void wh_ranks_abort(const wh_ranks *r, int status);

#endif
