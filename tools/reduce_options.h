/*
 * reduce_options: the options that reduce and plan share.
 */
#ifndef WH_TOOLS_REDUCE_OPTIONS_H
#define WH_TOOLS_REDUCE_OPTIONS_H

#include "whittle.h"

typedef struct reduce_options {
	wh_reduce_params params;
	char weights[1024]; /* what params.weights points to */
	const char *report;
	bool quiet, verbose, no_progress, help;
	bool json; /* plan only */
} reduce_options;

/* Fills *o, whose params hold the defaults. `plan`: no output is needed. WH_OK, or the status to
 * leave with. */
int reduce_options_parse(int argc, char **argv, bool plan, reduce_options *o);

#endif
