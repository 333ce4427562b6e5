/* mpi.h appears in this file alone. */
#define _GNU_SOURCE
#include "exec/ranks.h"

#include <stdlib.h>
#include <time.h>

#ifdef WH_HAVE_MPI
#define OMPI_SKIP_MPICXX
#include <mpi.h>
#endif

int wh_ranks_launched(void)
{
	/* Open MPI's mpirun; MPICH's; a step of srun, not a batch script */
	static const char *const names[] = {"OMPI_COMM_WORLD_SIZE", "PMI_SIZE",
	                                    "SLURM_STEP_NUM_TASKS"};
	for (size_t i = 0; i < sizeof names / sizeof *names; i++) {
		const char *text = getenv(names[i]); /* NOLINT(concurrency-mt-unsafe): only read */
		const long n = text ? strtol(text, NULL, 10) : 0;
		if (n > 0 && n <= 1 << 20)
			return (int)n;
	}
	return 1;
}

#ifdef WH_HAVE_MPI

static wh_code alone(wh_ctx *c)
{
	return wh_fail(c, WH_E_USAGE,
	               "several processes were started that do not know each other: this whittle "
	               "wants mpirun of Open MPI, or srun --mpi=pmix");
}

wh_code wh_ranks_open(wh_ctx *c, wh_ranks *r)
{
	int given;
	MPI_Comm node;
	*r = (wh_ranks){.size = 1, .local = 1};
	if (MPI_Init_thread(NULL, NULL, MPI_THREAD_FUNNELED, &given) != MPI_SUCCESS)
		return wh_fail(c, WH_E_RUN, "MPI does not start");
	r->began = true;
	if (MPI_Comm_rank(MPI_COMM_WORLD, &r->rank) != MPI_SUCCESS ||
	    MPI_Comm_size(MPI_COMM_WORLD, &r->size) != MPI_SUCCESS ||
	    MPI_Comm_split_type(MPI_COMM_WORLD, MPI_COMM_TYPE_SHARED, 0, MPI_INFO_NULL, &node) !=
	        MPI_SUCCESS)
		return wh_fail(c, WH_E_RUN, "MPI does not say which process this is");
	(void)MPI_Comm_size(node, &r->local);
	(void)MPI_Comm_free(&node);
	return r->size < wh_ranks_launched() ? alone(c) : WH_OK;
}

void wh_ranks_close(wh_ranks *r)
{
	if (r->began)
		(void)MPI_Finalize();
	r->began = false;
}

/* NOLINTBEGIN(clang-analyzer-optin.mpi.MPI-Checker): waited for by testing, and who is asked to
 * stop before it is done aborts the job, as a collective request cannot be taken back */
wh_code wh_ranks_meet(wh_ctx *c, const wh_ranks *r, uint64_t *value)
{
	const uint64_t mine = r->rank == 0 ? *value : 0;
	struct timespec turn = {.tv_nsec = 50L * 1000};
	MPI_Request request;
	int done = 0;
	if (MPI_Iallreduce(&mine, value, 1, MPI_UINT64_T, MPI_SUM, MPI_COMM_WORLD, &request) !=
	    MPI_SUCCESS)
		return wh_fail(c, WH_E_RUN, "MPI does not reach the other processes");
	while (MPI_Test(&request, &done, MPI_STATUS_IGNORE) == MPI_SUCCESS && !done) {
		if (wh_poll(c) != WH_OK)
			return c->err.code;
		(void)nanosleep(&turn, NULL);
		if (turn.tv_nsec < 5L * 1000 * 1000)
			turn.tv_nsec *= 2;
	}
	return done ? WH_OK : wh_fail(c, WH_E_RUN, "MPI lost the other processes");
}
/* NOLINTEND(clang-analyzer-optin.mpi.MPI-Checker) */

void wh_ranks_abort(const wh_ranks *r, int status)
{
	if (r->began)
		(void)MPI_Abort(MPI_COMM_WORLD, status);
}

#else

wh_code wh_ranks_open(wh_ctx *c, wh_ranks *r)
{
	*r = (wh_ranks){.size = 1, .local = 1};
	if (wh_ranks_launched() == 1)
		return WH_OK;
	return wh_fail(c, WH_E_USAGE,
	               "several processes were started, but this whittle was built without MPI: "
	               "start one, or share the run by whittle stage");
}

void wh_ranks_close(wh_ranks *r)
{
	(void)r;
}

wh_code wh_ranks_meet(wh_ctx *c, const wh_ranks *r, uint64_t *value)
{
	(void)r;
	(void)value;
	return wh_poll(c);
}

void wh_ranks_abort(const wh_ranks *r, int status)
{
	(void)r;
	(void)status;
}

#endif
