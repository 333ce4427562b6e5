/*
 * pack: bytes in, a compressed stream (gzip, zstd) out, piece by piece.
 *
 * The stream depends on the bytes and the library alone: it holds no time and no name. Which
 * libraries there are: wh_packing_known (unpack.h). One per output: not thread-safe.
 */
#ifndef WH_IO_PACK_H
#define WH_IO_PACK_H

#include "base/mem.h"
#include "io/format.h"

typedef struct wh_packer wh_packer;

/* Bytes on their way. */
typedef struct wh_pack_step {
	const unsigned char *in;
	size_t n; /* bytes of input left: in and n move on */
	unsigned char *out;
	size_t room; /* of out */
	size_t used; /* set: bytes put there */
	bool end;    /* there is no more input behind this */
	bool done;   /* set: all input is used, and with `end` the stream is whole */
} wh_pack_step;

/* WH_E_USAGE in a build without the library. */
wh_code wh_packer_open(wh_ctx *c, wh_packer **p, wh_packing packing);
/* NULL is allowed. */
void wh_packer_close(wh_ctx *c, wh_packer *p);

/* Takes what it can from s->in and puts what it can to s->out: again, with new room, until done. */
wh_code wh_packer_step(wh_ctx *c, wh_packer *p, wh_pack_step *s);

#endif
