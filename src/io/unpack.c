/*
 * One loop for both libraries and for bytes that are not packed: a step takes what it can from the
 * input and puts what it can into the output. Their memory is counted as all memory is.
 */
#define _GNU_SOURCE
#include "io/unpack.h"

#include <errno.h>
#include <inttypes.h>
#include <poll.h>
#include <string.h>
#include <unistd.h>

#ifdef WH_HAVE_ZLIB
#include <zlib.h>
#endif
#ifdef WH_HAVE_ZSTD
#define ZSTD_STATIC_LINKING_ONLY /* memory of our own, a ceiling for windows of our own */
#include <zstd.h>
#endif

enum {
	BUFFER = 1 << 20,
	WAIT_MS = 100 /* for a pipe, until the next look whether to go on waiting */
};

typedef struct unpacker unpacker;

/* What a library does. */
typedef struct methods {
	wh_code (*open)(unpacker *u);
	wh_code (*step)(unpacker *u);
	void (*close)(unpacker *u);
} methods;

struct unpacker {
	wh_ctx *c;
	const wh_ply *from;
	wh_packing packing;
	void *stream; /* the library's */
	unsigned char *in, *out;
	size_t in_n, in_at; /* bytes of input in the buffer, and used */
	size_t out_n;
	uint64_t read;  /* bytes of the file so far */
	bool at_end;    /* all input is in the buffer or used */
	bool in_stream; /* a stream has begun that has not ended */
};

bool wh_packing_known(wh_packing p)
{
#ifdef WH_HAVE_ZLIB
	if (p == WH_PACKING_GZIP)
		return true;
#endif
#ifdef WH_HAVE_ZSTD
	if (p == WH_PACKING_ZSTD)
		return true;
#endif
	return p == WH_PACKING_NONE;
}

const char *wh_packing_name(wh_packing p)
{
	return p == WH_PACKING_GZIP ? "gzip" : p == WH_PACKING_ZSTD ? "zstd" : "nothing";
}

#if defined(WH_HAVE_ZLIB) || defined(WH_HAVE_ZSTD)
static wh_code damaged(unpacker *u, const char *why)
{
	return wh_fail(u->c, WH_E_INPUT,
	               "'%s' is a damaged %s file near its byte %" PRIu64
	               " (%s); get it again, or unpack what can be saved by hand",
	               u->from->path, wh_packing_name(u->packing), u->read - (u->in_n - u->in_at),
	               why);
}
#endif

/* --- zlib --- */

#ifdef WH_HAVE_ZLIB
enum { GZIP_WINDOW = 15 + 16 }; /* largest window, gzip's header expected */

static void *zlib_alloc(void *user, unsigned n, unsigned size)
{
	return wh_alloc(user, n, size);
}

static void zlib_free(void *user, void *block)
{
	wh_free(user, block);
}

static wh_code gzip_open(unpacker *u)
{
	z_stream *z = wh_calloc(u->c, 1, sizeof *z);
	if (!z)
		return wh_failed(u->c);
	z->zalloc = zlib_alloc;
	z->zfree = zlib_free;
	z->opaque = u->c;
	u->stream = z;
	if (inflateInit2(z, GZIP_WINDOW) == Z_OK)
		return WH_OK;
	return wh_fail(u->c, WH_E_RUN, "zlib cannot be used");
}

/* Behind a stream there may be another one, or zeros that fill a block. */
static wh_code gzip_between(unpacker *u, z_stream *z)
{
	while (u->in_at < u->in_n && u->in[u->in_at] == 0)
		u->in_at++;
	if (u->in_at == u->in_n)
		return WH_OK;
	u->in_stream = true;
	return inflateReset(z) == Z_OK ? WH_OK : damaged(u, "it cannot be gone on with");
}

static wh_code gzip_step(unpacker *u)
{
	z_stream *z = u->stream;
	if (!u->in_stream && (u->read > u->in_n || u->in_at > 0) && gzip_between(u, z) != WH_OK)
		return u->c->err.code;
	if (u->in_at == u->in_n && !u->in_stream)
		return WH_OK;
	u->in_stream = true;
	z->next_in = u->in + u->in_at;
	z->avail_in = (uInt)(u->in_n - u->in_at);
	z->next_out = u->out + u->out_n;
	z->avail_out = (uInt)(BUFFER - u->out_n);
	const int r = inflate(z, Z_NO_FLUSH);
	u->in_at = u->in_n - z->avail_in;
	u->out_n = BUFFER - z->avail_out;
	if (r == Z_STREAM_END)
		u->in_stream = false;
	else if (r != Z_OK && r != Z_BUF_ERROR)
		return damaged(u, z->msg ? z->msg : "no such stream");
	return WH_OK;
}

static void gzip_close(unpacker *u)
{
	if (u->stream)
		(void)inflateEnd(u->stream);
	wh_free(u->c, u->stream);
}
#endif

/* --- zstd --- */

#ifdef WH_HAVE_ZSTD
static void *zstd_alloc(void *user, size_t n)
{
	return wh_alloc(user, n, 1);
}

static void zstd_free(void *user, void *block)
{
	wh_free(user, block);
}

static wh_code zstd_open(unpacker *u)
{
	const ZSTD_customMem mem = {zstd_alloc, zstd_free, u->c};
	u->stream = ZSTD_createDCtx_advanced(mem);
	if (!u->stream)
		return wh_failed(u->c);
	/* whatever the window: the account refuses one that is too large */
	const int most = (int)ZSTD_dParam_getBounds(ZSTD_d_windowLogMax).upperBound;
	(void)ZSTD_DCtx_setParameter(u->stream, ZSTD_d_windowLogMax, most);
	return WH_OK;
}

static wh_code zstd_step(unpacker *u)
{
	ZSTD_inBuffer in = {u->in, u->in_n, u->in_at};
	ZSTD_outBuffer out = {u->out, BUFFER, u->out_n};
	if (in.pos == in.size && !u->in_stream)
		return WH_OK;
	const size_t r = ZSTD_decompressStream(u->stream, &out, &in);
	u->in_at = in.pos;
	u->out_n = out.pos;
	if (u->c->err.code != WH_OK)
		return u->c->err.code;
	if (ZSTD_isError(r))
		return damaged(u, ZSTD_getErrorName(r));
	u->in_stream = r != 0;
	return WH_OK;
}

static void zstd_close(unpacker *u)
{
	(void)ZSTD_freeDCtx(u->stream);
}
#endif

/* --- bytes that are not packed --- */

static wh_code plain_open(unpacker *u)
{
	(void)u;
	return WH_OK;
}

static wh_code plain_step(unpacker *u)
{
	const size_t left = u->in_n - u->in_at, room = BUFFER - u->out_n;
	const size_t n = left < room ? left : room;
	memcpy(u->out + u->out_n, u->in + u->in_at, n);
	u->in_at += n;
	u->out_n += n;
	return WH_OK;
}

static void plain_close(unpacker *u)
{
	(void)u;
}

/* NULL: this build has not got the library. */
static const methods *methods_of(wh_packing p)
{
	static const methods plain = {plain_open, plain_step, plain_close};
#ifdef WH_HAVE_ZLIB
	static const methods gzip = {gzip_open, gzip_step, gzip_close};
	if (p == WH_PACKING_GZIP)
		return &gzip;
#endif
#ifdef WH_HAVE_ZSTD
	static const methods zstd = {zstd_open, zstd_step, zstd_close};
	if (p == WH_PACKING_ZSTD)
		return &zstd;
#endif
	return p == WH_PACKING_NONE ? &plain : NULL;
}

/* --- the loop --- */

/* Some bytes of a stream, as they come. Before anybody writes to a pipe there is no end, either. */
static ssize_t read_stream(wh_ctx *c, int fd, void *to, size_t most)
{
	struct pollfd p = {.fd = fd, .events = POLLIN};
	for (;;) {
		if (wh_poll(c) != WH_OK)
			return -1;
		if (poll(&p, 1, WAIT_MS) <= 0)
			continue;
		const ssize_t n = read(fd, to, most);
		if (n >= 0 || (errno != EINTR && errno != EAGAIN))
			return n;
	}
}

static ssize_t read_file(int fd, void *to, size_t most, uint64_t at)
{
	ssize_t n;
	do
		n = pread(fd, to, most, (off_t)at);
	while (n < 0 && errno == EINTR);
	return n;
}

/* Fills the buffer, or as much of it as there is left. */
static wh_code fill(unpacker *u)
{
	if (u->in_at < u->in_n || u->at_end)
		return WH_OK;
	u->in_at = u->in_n = 0;
	while (u->in_n < BUFFER && !u->at_end) {
		unsigned char *to = u->in + u->in_n;
		const size_t room = BUFFER - u->in_n;
		const ssize_t n = u->from->is_stream ? read_stream(u->c, u->from->fd, to, room)
		                                     : read_file(u->from->fd, to, room, u->read);
		if (n < 0)
			return u->c->err.code != WH_OK
			           ? u->c->err.code
			           : wh_fail_errno(u->c, "cannot read '%s' at byte %" PRIu64,
			                           u->from->path, u->read);
		u->in_n += (size_t)n;
		u->read += (uint64_t)n;
		u->at_end = n == 0;
	}
	return wh_poll(u->c);
}

static wh_code drain(unpacker *u, wh_spill *spill, int to, uint64_t *size)
{
	if (wh_spill_pwrite(u->c, spill, to, u->out, u->out_n, *size) != WH_OK)
		return u->c->err.code;
	*size += u->out_n;
	u->out_n = 0;
	return wh_poll(u->c);
}

static wh_code run(unpacker *u, const methods *m, wh_spill *spill, int to, uint64_t *size)
{
	for (;;) {
		if (fill(u) != WH_OK)
			return u->c->err.code;
		const size_t in_at = u->in_at, out_n = u->out_n;
		if (m->step(u) != WH_OK)
			return u->c->err.code;
		if (u->out_n == BUFFER && drain(u, spill, to, size) != WH_OK)
			return u->c->err.code;
		if (u->at_end && u->in_at == in_at && u->out_n == out_n)
			break;
	}
	if (u->in_stream)
		return wh_fail(u->c, WH_E_INPUT,
		               "'%s' is cut short: its %s stream goes on behind its %" PRIu64
		               " bytes",
		               u->from->path, wh_packing_name(u->packing), u->read);
	return drain(u, spill, to, size);
}

static wh_code unpack_to(unpacker *u, wh_spill *spill, int to, uint64_t *size)
{
	const methods *m = methods_of(u->packing);
	if (!m)
		return wh_fail(
		    u->c, WH_E_INPUT,
		    "'%s' is a %s file, which this build of whittle cannot read; unpack it "
		    "first",
		    u->from->path, wh_packing_name(u->packing));
	wh_code code = m->open(u);
	if (code == WH_OK)
		code = run(u, m, spill, to, size);
	m->close(u);
	return code;
}

int wh_unpack(wh_ctx *c, wh_spill *spill, const wh_ply *from, uint64_t *taken, uint64_t *size)
{
	unpacker u = {.c = c, .from = from};
	*size = 0;
	u.in = wh_alloc(c, BUFFER, 1);
	u.out = wh_alloc(c, BUFFER, 1);
	const int to = u.in && u.out ? wh_spill_scratch(c, spill) : -1;
	wh_code code = to >= 0 ? fill(&u) : wh_failed(c);
	if (code == WH_OK) {
		u.packing = wh_packing_of_bytes((const char *)u.in, u.in_n);
		code = unpack_to(&u, spill, to, size);
	}
	*taken = u.read;
	wh_free(c, u.in);
	wh_free(c, u.out);
	if (code == WH_OK)
		return to;
	if (to >= 0)
		wh_spill_close_scratch(spill, to);
	return -1;
}
