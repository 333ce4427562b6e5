/*
 * stage_file: the options of a run in stages, in a file of its run directory, where whittle plan
 * leaves them for whittle stage.
 */
#ifndef WH_TOOLS_STAGE_FILE_H
#define WH_TOOLS_STAGE_FILE_H

#include "cmd.h"

/* The working directory and the arguments of a command, each ended by a NUL. */
typedef struct stage_file {
	char *text;
	char *folder;
	char **argv; /* ends with NULL */
	int argc;
} stage_file;

/* Writes what this process was called with. WH_OK, or the failure is recorded. */
wh_code stage_file_write(wh_ctx *c, const char *run_dir, int argc, char **argv);

/* Reads it. stage_file_free also after a failure. */
wh_code stage_file_read(wh_ctx *c, const char *run_dir, stage_file *s);
void stage_file_free(wh_ctx *c, stage_file *s);

#endif
