/* progress: how far the run is, told to a callback at most a few times a second. */
#ifndef WH_PIPELINE_PROGRESS_H
#define WH_PIPELINE_PROGRESS_H

#include "base/status.h"

#include <stdatomic.h>

/* Called from one worker at a time; `done` and `total` are faces or vertices, as `phase` says. */
typedef void (*wh_progress_fn)(void *user, const char *phase, uint64_t done, uint64_t total);

typedef struct wh_progress {
	wh_progress_fn fn; /* NULL: nobody listens */
	void *user;
	const char *phase;
	uint64_t total;
	_Atomic uint64_t done;
	atomic_flag telling;
} wh_progress;

/* Starts a phase. Serial. */
static inline void wh_progress_phase(wh_progress *p, const char *phase, uint64_t total)
{
	p->phase = phase;
	p->total = total;
	atomic_store(&p->done, 0);
	if (p->fn)
		p->fn(p->user, phase, 0, total);
}

/* Adds to what is done; any worker may. A worker that finds another telling does not wait. */
static inline void wh_progress_add(wh_progress *p, uint64_t n)
{
	const uint64_t done = atomic_fetch_add(&p->done, n) + n;
	if (!p->fn || atomic_flag_test_and_set(&p->telling))
		return;
	p->fn(p->user, p->phase, done, p->total);
	atomic_flag_clear(&p->telling);
}

#endif
