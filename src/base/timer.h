/* timer: seconds on a clock that never jumps. */
#ifndef WH_BASE_TIMER_H
#define WH_BASE_TIMER_H

#include <time.h>

static inline double wh_seconds(void)
{
	struct timespec t;
	(void)clock_gettime(CLOCK_MONOTONIC, &t);
	return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

#endif
