#include "io/pack.h"

#include "io/unpack.h"

#include <string.h>

#ifdef WH_HAVE_ZLIB
#define ZLIB_CONST
#include <zlib.h>
#endif
#ifdef WH_HAVE_ZSTD
#define ZSTD_STATIC_LINKING_ONLY /* memory of our own */
#include <zstd.h>
#endif

struct wh_packer {
	wh_packing packing;
	void *stream; /* the library's */
};

#ifdef WH_HAVE_ZLIB
enum { GZIP_WINDOW = 15 + 16, GZIP_LEVEL = 6, GZIP_MEMORY = 8 }; /* gzip's own defaults */

static void *zlib_alloc(void *user, unsigned n, unsigned size)
{
	return wh_alloc(user, n, size);
}

static void zlib_free(void *user, void *block)
{
	wh_free(user, block);
}

static wh_code gzip_open(wh_ctx *c, wh_packer *p)
{
	z_stream *z = wh_calloc(c, 1, sizeof *z);
	if (!z)
		return wh_failed(c);
	z->zalloc = zlib_alloc;
	z->zfree = zlib_free;
	z->opaque = c;
	p->stream = z;
	if (deflateInit2(z, GZIP_LEVEL, Z_DEFLATED, GZIP_WINDOW, GZIP_MEMORY, Z_DEFAULT_STRATEGY) ==
	    Z_OK)
		return WH_OK;
	return wh_fail(c, WH_E_RUN, "zlib cannot be used");
}

static wh_code gzip_step(wh_ctx *c, wh_packer *p, wh_pack_step *s)
{
	enum { MOST = 1 << 30 }; /* zlib counts in 32 bits */
	z_stream *z = p->stream;
	const size_t n = s->n < MOST ? s->n : MOST, room = s->room < MOST ? s->room : MOST;
	const bool end = s->end && n == s->n;
	z->next_in = s->in;
	z->avail_in = (uInt)n;
	z->next_out = s->out;
	z->avail_out = (uInt)room;
	const int r = deflate(z, end ? Z_FINISH : Z_NO_FLUSH);
	if (r != Z_OK && r != Z_STREAM_END && r != Z_BUF_ERROR)
		return wh_fail(c, WH_E_RUN, "zlib cannot go on: %s", z->msg ? z->msg : "?");
	s->in += n - z->avail_in;
	s->n -= n - z->avail_in;
	s->used = room - z->avail_out;
	s->done = s->n == 0 && (end ? r == Z_STREAM_END : z->avail_out > 0);
	return WH_OK;
}

static void gzip_close(wh_ctx *c, wh_packer *p)
{
	if (p->stream)
		(void)deflateEnd(p->stream);
	wh_free(c, p->stream);
}
#endif

#ifdef WH_HAVE_ZSTD
enum { ZSTD_LEVEL = 3 }; /* zstd's own default */

static void *zstd_alloc(void *user, size_t n)
{
	return wh_alloc(user, n, 1);
}

static void zstd_free(void *user, void *block)
{
	wh_free(user, block);
}

static wh_code zstd_open(wh_ctx *c, wh_packer *p)
{
	const ZSTD_customMem mem = {zstd_alloc, zstd_free, c};
	p->stream = ZSTD_createCCtx_advanced(mem);
	if (!p->stream)
		return wh_failed(c);
	(void)ZSTD_CCtx_setParameter(p->stream, ZSTD_c_compressionLevel, ZSTD_LEVEL);
	(void)ZSTD_CCtx_setParameter(p->stream, ZSTD_c_checksumFlag, 1);
	return WH_OK;
}

static wh_code zstd_step(wh_ctx *c, wh_packer *p, wh_pack_step *s)
{
	ZSTD_inBuffer in = {s->in, s->n, 0};
	ZSTD_outBuffer out = {s->out, s->room, 0};
	const size_t r =
	    ZSTD_compressStream2(p->stream, &out, &in, s->end ? ZSTD_e_end : ZSTD_e_continue);
	if (c->err.code != WH_OK)
		return c->err.code;
	if (ZSTD_isError(r))
		return wh_fail(c, WH_E_RUN, "zstd cannot go on: %s", ZSTD_getErrorName(r));
	s->in += in.pos;
	s->n -= in.pos;
	s->used = out.pos;
	s->done = s->n == 0 && (!s->end || r == 0);
	return WH_OK;
}

static void zstd_close(wh_packer *p)
{
	(void)ZSTD_freeCCtx(p->stream);
}
#endif

wh_code wh_packer_open(wh_ctx *c, wh_packer **out, wh_packing packing)
{
	*out = NULL;
	if (!wh_packing_known(packing))
		return wh_fail(c, WH_E_USAGE, "this build of whittle cannot write %s files",
		               wh_packing_name(packing));
	wh_packer *p = wh_calloc(c, 1, sizeof *p);
	wh_code code = p ? WH_OK : wh_failed(c);
	if (p)
		p->packing = packing;
#ifdef WH_HAVE_ZLIB
	if (code == WH_OK && packing == WH_PACKING_GZIP)
		code = gzip_open(c, p);
#endif
#ifdef WH_HAVE_ZSTD
	if (code == WH_OK && packing == WH_PACKING_ZSTD)
		code = zstd_open(c, p);
#endif
	if (code != WH_OK) {
		wh_packer_close(c, p);
		p = NULL;
	}
	*out = p;
	return code;
}

void wh_packer_close(wh_ctx *c, wh_packer *p)
{
	if (!p)
		return;
#ifdef WH_HAVE_ZLIB
	if (p->packing == WH_PACKING_GZIP)
		gzip_close(c, p);
#endif
#ifdef WH_HAVE_ZSTD
	if (p->packing == WH_PACKING_ZSTD)
		zstd_close(p);
#endif
	wh_free(c, p);
}

/* Without a library: bytes go through as they are. */
static wh_code copy_step(wh_pack_step *s)
{
	s->used = s->n < s->room ? s->n : s->room;
	memcpy(s->out, s->in, s->used);
	s->in += s->used;
	s->n -= s->used;
	s->done = s->n == 0;
	return WH_OK;
}

wh_code wh_packer_step(wh_ctx *c, wh_packer *p, wh_pack_step *s)
{
	(void)c;
	switch (p->packing) {
#ifdef WH_HAVE_ZLIB
	case WH_PACKING_GZIP:
		return gzip_step(c, p, s);
#endif
#ifdef WH_HAVE_ZSTD
	case WH_PACKING_ZSTD:
		return zstd_step(c, p, s);
#endif
	default:
		return copy_step(s);
	}
}
