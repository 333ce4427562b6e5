#include "io/window.h"

#include "io/ply.h"

enum { BUFFER = 1 << 20 };

wh_code wh_window_open(wh_ctx *c, wh_window *w, const char *path, int fd, uint64_t size)
{
	*w = (wh_window){.path = path, .fd = fd, .size = size};
	w->buf = wh_alloc(c, BUFFER, 1);
	return w->buf ? WH_OK : c->err.code;
}

void wh_window_close(wh_ctx *c, wh_window *w)
{
	wh_free(c, w->buf);
	*w = (wh_window){0};
}

const unsigned char *wh_window_move(wh_ctx *c, wh_window *w, uint64_t at)
{
	const uint64_t left = w->size - at;
	const size_t n = left < BUFFER ? (size_t)left : BUFFER;
	w->base = at;
	w->n = 0;
	if (wh_poll(c) != WH_OK || wh_ply_pread(c, w->path, w->fd, w->buf, n, at) != WH_OK)
		return NULL;
	w->n = n;
	return w->buf;
}
