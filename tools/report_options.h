/* report_options: the arguments of report. */
#ifndef WH_TOOLS_REPORT_OPTIONS_H
#define WH_TOOLS_REPORT_OPTIONS_H

#include <stdbool.h>
#include <stdint.h>

enum { REPORT_FILES = 13 }; /* the input and as many levels as a page takes */

typedef struct report_options {
	const char *const *paths; /* the input first */
	int npaths;
	const char *output, *title, *temp_dir;
	const char *seams;              /* NULL: none */
	const char *runs[REPORT_FILES]; /* what reduce --report wrote */
	int nruns;
	uint32_t width, height; /* of the pictures, pixels */
	int up;                 /* wh_up, or WH_UP_GUESS */
	bool turned[2];
	double turn[2];  /* azimuth, elevation */
	int64_t shown;   /* faces of a level that the page holds, at most */
	int64_t samples; /* of the comparison, a side; 0: as compare */
	int64_t memory, threads;
	bool force, quiet, no_progress, help;
} report_options;

/* WH_OK, or the exit status after a message. */
int report_options_parse(int argc, char **argv, report_options *o);

#endif
