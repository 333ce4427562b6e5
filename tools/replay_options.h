/* replay_options: the options of replay. */
#ifndef WH_TOOLS_REPLAY_OPTIONS_H
#define WH_TOOLS_REPLAY_OPTIONS_H

#include "whittle.h"

enum { REPLAY_FRAMES_MOST = 1000000, REPLAY_FRAMES_LEAST = 2 };

typedef struct replay_look {
	uint32_t width, height;
	int up; /* wh_up, or WH_UP_GUESS */
	bool turned[2];
	double turn[2]; /* azimuth, elevation */
	bool wireframe, flat, colours;
	const char *temp_dir;
} replay_look;

typedef struct replay_options {
	const char *input;
	wh_replay_output out; /* path NULL: no mesh */
	wh_level limits;
	const char *text; /* NULL: none */
	const char *page; /* NULL: none */
	size_t memory;    /* 0: the default */
	/* of a morph from the level of the limits to another one: */
	wh_level towards; /* that one; without limits the finest */
	bool geomorph;    /* one mesh of it, ... */
	double t;         /* ... this one */
	uint32_t frames;  /* so many, from one end to the other; 0: none */
	replay_look look; /* of frames that are pictures */
	bool quiet, help;
} replay_options;

/* Fills *o. WH_OK, or the status to leave with. */
int replay_options_parse(int argc, char **argv, replay_options *o);

#endif
