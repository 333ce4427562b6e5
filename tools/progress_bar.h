/* progress_bar: phase, per cent, rate and time left, on standard error: a bar on a terminal, else
 * a line every few seconds. */
#ifndef WH_TOOLS_PROGRESS_BAR_H
#define WH_TOOLS_PROGRESS_BAR_H

#include <stdbool.h>
#include <stdint.h>

typedef struct progress_bar {
	bool on, terminal, drawn;
	const char *phase;
	double phase_start, last; /* seconds */
} progress_bar;

void progress_bar_init(progress_bar *b, bool on);

/* A wh_reduce_params.progress; `user` is the bar. */
void progress_bar_tell(void *user, const char *phase, uint64_t done, uint64_t total);

/* Clears what is drawn. */
void progress_bar_end(progress_bar *b);

#endif
