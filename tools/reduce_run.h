/*
 * reduce_run: one call of the library with options that are understood: may it be made, progress,
 * words, report, logs.
 */
#ifndef WH_TOOLS_REDUCE_RUN_H
#define WH_TOOLS_REDUCE_RUN_H

#include "reduce_options.h"

/* Runs the stage that o->params names. `name`: the subcommand's, for messages; argv: what the user
 * wrote, to tell how to go on. Returns the exit status. */
int reduce_run(const char *name, reduce_options *o, int argc, char **argv);

/* Runs all of it as one of the processes of an MPI job. The first one tells, all the same way as if
 * it were alone. */
int reduce_run_rank(reduce_options *o, int argc, char **argv);

#endif
