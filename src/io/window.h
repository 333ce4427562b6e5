/*
 * window: a large buffer that slides over a file, for walks through it from front to back.
 *
 * Not thread-safe: one per walk.
 */
#ifndef WH_IO_WINDOW_H
#define WH_IO_WINDOW_H

#include "base/mem.h"

typedef struct wh_window {
	const char *path; /* for messages; not owned */
	int fd;           /* not owned */
	uint64_t size;    /* bytes of the file */
	uint64_t base;    /* offset of the first byte in the buffer */
	size_t n;         /* bytes in the buffer */
	unsigned char *buf;
} wh_window;

wh_code wh_window_open(wh_ctx *c, wh_window *w, const char *path, int fd, uint64_t size);
void wh_window_close(wh_ctx *c, wh_window *w);

/* Reads the buffer full from `at` on. NULL on failure. */
const unsigned char *wh_window_move(wh_ctx *c, wh_window *w, uint64_t at);

/* `need` (at most 64) bytes of the file from offset `at` on, all of them within its size. Valid
 * until the next call. NULL on failure. */
static inline const unsigned char *wh_window_at(wh_ctx *c, wh_window *w, uint64_t at, size_t need)
{
	if (at >= w->base && at - w->base + need <= w->n)
		return w->buf + (at - w->base);
	return wh_window_move(c, w, at);
}

#endif
