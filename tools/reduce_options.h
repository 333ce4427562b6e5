/*
 * reduce_options: the options that reduce and plan share.
 */
#ifndef WH_TOOLS_REDUCE_OPTIONS_H
#define WH_TOOLS_REDUCE_OPTIONS_H

#include "whittle.h"

typedef struct reduce_options {
	wh_reduce_params params;
	char weights[1024]; /* what params.weights points to */
	double share; /* of the faces that is the target where none is given; 0: that is wrong */
	const char *levels, *levels_error; /* lists; NULL: none */
	wh_level level[WH_LEVELS_MOST];    /* what params.level points to, */
	char names[16384];                 /* and their outputs and the last one's */
	const char *report;
	bool quiet, verbose, no_progress, help;
	bool measure;    /* the distance of the result from the input */
	int64_t samples; /* to measure it with; 0: what compare takes */
	bool json;       /* plan only */
} reduce_options;

/* Fills *o, whose params hold the defaults. `plan`: no output is needed. WH_OK, or the status to
 * leave with. */
int reduce_options_parse(int argc, char **argv, bool plan, reduce_options *o);

/* A positive count or a percentage up to 100. */
bool reduce_parse_target(const char *text, uint64_t *count, double *share);
/* A distance above 0 or a percentage. */
bool reduce_parse_error(const char *text, double *error, double *share);

/* ---- levels_options.c --------------------------------------------------------------------- */

/* Turns a list of levels into levels and, of the least, the last result, and makes the names of
 * their outputs of the one that is given. WH_OK, or the status to leave with. */
int levels_options_take(const char *command, reduce_options *o);

#endif
