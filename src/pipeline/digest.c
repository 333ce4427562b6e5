#include "pipeline/digest.h"

#include <xxhash.h>

enum { FILE_PIECE = 1 << 20 };

void wh_digest_add(_Atomic uint64_t *digest, uint64_t offset, const void *bytes, size_t n)
{
	if (digest)
		atomic_fetch_add(digest, XXH3_64bits_withSeed(bytes, n, offset));
}

/* A part of a file, in pieces. */
typedef struct part {
	const char *path;
	int fd;
	uint64_t begin, end;
	size_t piece;
	uint8_t **buf; /* one for each worker */
	_Atomic uint64_t *digest;
} part;

static wh_code piece_job(wh_ctx *c, void *arg, int64_t index, int worker)
{
	const part *p = arg;
	const uint64_t at = p->begin + (uint64_t)index * p->piece;
	const size_t n = p->end - at < p->piece ? (size_t)(p->end - at) : p->piece;
	if (wh_ply_pread(c, p->path, p->fd, p->buf[worker], n, at) != WH_OK)
		return c->err.code;
	wh_digest_add(p->digest, at, p->buf[worker], n);
	return WH_OK;
}

static wh_code add_part(wh_ctx *c, const wh_exec *ex, part *p)
{
	const uint64_t pieces = (p->end - p->begin + p->piece - 1) / p->piece;
	p->buf = wh_calloc(c, (size_t)ex->workers, sizeof *p->buf);
	for (int i = 0; p->buf && i < ex->workers; i++)
		p->buf[i] = wh_alloc(c, p->piece, 1);
	wh_code code = c->err.code;
	if (code == WH_OK)
		code = wh_exec_for(c, ex, (int64_t)pieces, piece_job, p);
	for (int i = 0; p->buf && i < ex->workers; i++)
		wh_free(c, p->buf[i]);
	wh_free(c, p->buf);
	return code;
}

wh_code wh_digest_header(wh_ctx *c, const wh_exec *ex, const wh_ply *p, _Atomic uint64_t *digest)
{
	part header = {
	    .path = p->path, .fd = p->fd, .end = p->body, .piece = FILE_PIECE, .digest = digest};
	return add_part(c, ex, &header);
}

wh_code wh_digest_source(wh_ctx *c, const wh_exec *ex, const wh_source *s, _Atomic uint64_t *digest)
{
	part vertices = {.path = s->path,
	                 .fd = s->vfd,
	                 .begin = s->vbase,
	                 .end = wh_source_vertex_at(s, s->nv),
	                 .piece = (size_t)WH_DIGEST_CHUNK * s->vstride,
	                 .digest = digest};
	part faces = {.path = s->path,
	              .fd = s->ffd,
	              .begin = s->fbase,
	              .end = wh_source_face_at(s, s->nf),
	              .piece = (size_t)WH_DIGEST_CHUNK * s->fstride,
	              .digest = digest};
	return add_part(c, ex, &vertices) == WH_OK ? add_part(c, ex, &faces) : c->err.code;
}

wh_code wh_digest_file(wh_ctx *c, const wh_exec *ex, const wh_ply *p, _Atomic uint64_t *digest)
{
	part all = {
	    .path = p->path, .fd = p->fd, .end = p->size, .piece = FILE_PIECE, .digest = digest};
	return add_part(c, ex, &all);
}
