/* replay_options: the options of replay. */
#ifndef WH_TOOLS_REPLAY_OPTIONS_H
#define WH_TOOLS_REPLAY_OPTIONS_H

#include "whittle.h"

typedef struct replay_options {
	const char *input;
	wh_replay_output out; /* path NULL: no mesh */
	wh_level limits;
	const char *text; /* NULL: none */
	size_t memory;    /* 0: the default */
	bool quiet, help;
} replay_options;

/* Fills *o. WH_OK, or the status to leave with. */
int replay_options_parse(int argc, char **argv, replay_options *o);

#endif
