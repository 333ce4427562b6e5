/*
 * status: the one way whittle's functions tell success from failure.
 *
 * Every function that can fail takes a context and returns a wh_code. The first failure
 * writes a message for the user into the context; later failures of the same context keep
 * that first message. A context belongs to one thread at a time; the memory account inside
 * it is shared by all of them.
 */
#ifndef WH_BASE_STATUS_H
#define WH_BASE_STATUS_H

#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* The values are the exit statuses of the command, so that nothing has to translate them. */
typedef enum wh_code {
	WH_OK = 0,
	WH_E_RUN = 1,       /* I/O failure, full disk, memory the system refused */
	WH_E_USAGE = 2,     /* the caller asked for something that makes no sense */
	WH_E_INPUT = 3,     /* the input file is damaged or holds nothing to work on */
	WH_E_TARGET = 4,    /* the target cannot be reached; the best mesh was written */
	WH_E_PLAN = 5,      /* the memory or disk ceiling cannot be met */
	WH_E_INTERRUPT = 6, /* the caller asked to stop (the command maps it to 128 + signal) */
	WH_E_IRREGULAR = 7, /* internal: a fast path met data it cannot handle; nothing reported */
	WH_E_PAUSE = 8      /* internal: this process' part of a run is done */
} wh_code;

typedef struct wh_error {
	wh_code code;
	char text[1024]; /* one sentence or two: file, place, remedy; no newline at the end */
} wh_error;

struct wh_mem;

/* What every call needs to know of its surroundings. Copy it (wh_ctx_fork) for another thread. */
typedef struct wh_ctx {
	struct wh_mem *mem;         /* shared memory account */
	const volatile int *cancel; /* nonzero: stop soon; read atomically; may be NULL */
	wh_error err;               /* first failure of this context */
} wh_ctx;

/* Records a failure, unless one is recorded already, and returns its code. */
wh_code wh_fail(wh_ctx *c, wh_code code, const char *fmt, ...)
    __attribute__((format(printf, 3, 4)));

/* Like wh_fail for a failed system call: appends the text of errno. WH_E_RUN always. */
wh_code wh_fail_errno(wh_ctx *c, const char *fmt, ...) __attribute__((format(printf, 2, 3)));

/* The code of the failure that has been recorded, for whoever was told of it by NULL or -1. Never
 * WH_OK: a failure that nobody recorded must not pass for success. */
static inline wh_code wh_failed(const wh_ctx *c)
{
	return c->err.code != WH_OK ? c->err.code : WH_E_RUN;
}

/* A context for another thread: same account and cancel flag, no failure recorded. */
wh_ctx wh_ctx_fork(const wh_ctx *c);

/* WH_E_INTERRUPT, recorded, when the caller has asked to stop; else WH_OK. Call it in long loops.
 */
wh_code wh_poll(wh_ctx *c);

/* The same for loops of short turns: looks at every 65536th, i being the turn's number. */
static inline wh_code wh_poll_at(wh_ctx *c, uint64_t i)
{
	return (i & 0xffff) == 0 ? wh_poll(c) : WH_OK;
}

#endif
