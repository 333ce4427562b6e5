/* render_options: the arguments of render. */
#ifndef WH_TOOLS_RENDER_OPTIONS_H
#define WH_TOOLS_RENDER_OPTIONS_H

#include "pipeline/picture.h"

enum { RENDER_VIEWS_MOST = 12 };

typedef struct render_options {
	wh_picture_params p;
	wh_picture_cell cells[WH_PICTURE_CELLS];
	int64_t threads;
	bool quiet, no_progress, help;
	/* before they are put together: */
	bool sheet, sized;
	const char *views; /* list of names */
	bool turned[2];
	double turn[2]; /* azimuth, elevation */
} render_options;

/* "1200x900", or "800" for a square. */
bool render_parse_size(const char *text, uint32_t *w, uint32_t *h);

/* "x", "y" or "z" as 0 to 2; "auto" as WH_UP_GUESS. */
bool render_parse_up(const char *text, int *up);

/* An angle in degrees, no more than a whole turn either way. */
bool render_parse_angle(const char *text, double *degrees);

/* WH_OK, or the exit status after a message. */
int render_options_parse(int argc, char **argv, render_options *o);

#endif
