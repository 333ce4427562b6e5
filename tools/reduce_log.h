/* reduce_log: with -v, how each process of a shared run went, in the run directory. */
#ifndef WH_TOOLS_REDUCE_LOG_H
#define WH_TOOLS_REDUCE_LOG_H

#include "cmd.h"
#include "reduce_options.h"

/* Appends to the log of the stage that this process was started for. */
void reduce_log_stage(const reduce_options *o, const cmd_env *env, const wh_reduce_report *r);

/* Appends to the log of this process of an MPI job. */
void reduce_log_rank(const reduce_options *o, const cmd_env *env, const wh_reduce_report *r);

#endif
