/*
 * digest: of what the file of an input holds, to tell later whether it still holds the same.
 *
 * The sum of the XXH3 of its pieces, each seeded by the offset at which it lies: pieces may come in
 * any order and from any thread. Ingest, which reads pieces of these sizes anyway, adds them up as
 * they pass.
 */
#ifndef WH_PIPELINE_DIGEST_H
#define WH_PIPELINE_DIGEST_H

#include "exec/exec.h"
#include "io/ply.h"

#include <stdatomic.h>

enum { WH_DIGEST_CHUNK = 32 * 1024 }; /* vertices, or faces, in a piece */

/* Adds one piece; NULL: to nothing. Thread-safe. */
void wh_digest_add(_Atomic uint64_t *digest, uint64_t offset, const void *bytes, size_t n);

/* Where an item of a source is in its file. */
static inline uint64_t wh_source_vertex_at(const wh_source *s, uint64_t first)
{
	return s->vbase + first * s->vstride;
}
static inline uint64_t wh_source_face_at(const wh_source *s, uint64_t first)
{
	return s->fbase + first * s->fstride;
}

/* Adds the header. */
wh_code wh_digest_header(wh_ctx *c, const wh_exec *ex, const wh_ply *p, _Atomic uint64_t *digest);
/* Adds what ingest adds over such a source: reads it again. */
wh_code wh_digest_source(wh_ctx *c, const wh_exec *ex, const wh_source *s,
                         _Atomic uint64_t *digest);
/* Adds a whole file, whose body is read in other ways. */
wh_code wh_digest_file(wh_ctx *c, const wh_exec *ex, const wh_ply *p, _Atomic uint64_t *digest);

#endif
