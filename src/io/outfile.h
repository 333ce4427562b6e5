/*
 * outfile: an output that appears under its name only when it is whole.
 *
 * Bytes go to a temporary file in the target's own folder; commit flushes it and the folder and
 * renames it. Symbolic links are resolved first, so that the link stays and its target is
 * replaced. A target that exists and is not a regular file (/dev/null, /dev/full, a pipe) is
 * written directly, and "-" is standard output; waiting for the reader of a pipe ends when the
 * context is asked to stop. Buffered; counts and checksums (XXH3, 128 bits)
 * what passes through. Not thread-safe.
 */
#ifndef WH_IO_OUTFILE_H
#define WH_IO_OUTFILE_H

#include "base/mem.h"
#include "io/format.h"

typedef struct wh_outfile wh_outfile;

/* WH_E_USAGE when the target exists and force is false; WH_E_RUN for anything the system
 * refuses, naming the path and what would help. */
wh_code wh_outfile_open(wh_ctx *c, wh_outfile **o, const char *path, bool force);

/* WH_E_PLAN where the folder of the output has less room than nine tenths of so many bytes: names
 * it, and what would help. */
wh_code wh_outfile_foresee(wh_ctx *c, const char *path, uint64_t bytes);

/* From here on bytes are compressed on their way; sizes and checksums are of what comes out. Call
 * it before the first byte. WH_E_USAGE in a build without the library. */
wh_code wh_outfile_pack(wh_ctx *c, wh_outfile *o, wh_packing packing);
/*
 * The same for an output whose temporary file must not stay when the process is killed: it has no
 * name where the system can do that, and else, or for the moment in which it replaces another
 * file, one that ends in `tag`, which wh_outfile_clear finds again.
 */
wh_code wh_outfile_open_tagged(wh_ctx *c, wh_outfile **o, const char *path, bool force,
                               const char *tag);
/* Removes the temporary file that a process which is gone may have left of such an output. */
void wh_outfile_clear(wh_ctx *c, const char *path, const char *tag);
/* True when a regular file of that name has so many bytes and this checksum. */
bool wh_outfile_is(wh_ctx *c, const char *path, uint64_t bytes, const char hex[33]);

/* True when two paths lead to one file, or would when it is written: however they spell its folder,
 * and through symbolic links. */
bool wh_outfile_same(const char *a, const char *b);

/* Appends n bytes. A full disk or any other failure is recorded once, with the file's name. */
wh_code wh_outfile_write(wh_ctx *c, wh_outfile *o, const void *bytes, size_t n);

/* Space for n <= 64 KiB bytes inside the buffer: fill them, then wh_outfile_advance(o, used).
 * NULL on failure. */
void *wh_outfile_room(wh_ctx *c, wh_outfile *o, size_t n);
void wh_outfile_advance(wh_outfile *o, size_t used);

/* Flushes, checks, renames, frees. On failure nothing appears under the name, with one exception:
 * a folder that cannot be flushed, after the renaming, is a failure too. *o becomes NULL. */
wh_code wh_outfile_commit(wh_ctx *c, wh_outfile **o);

/* Gives up: removes the temporary file, frees. NULL allowed; errors are ignored. */
void wh_outfile_abort(wh_ctx *c, wh_outfile **o);

/* There is nothing more to come: what follows about size and checksum is of the whole. */
wh_code wh_outfile_end(wh_ctx *c, wh_outfile *o);

uint64_t wh_outfile_bytes(const wh_outfile *o);

/* 32 hexadecimal digits and a NUL of the bytes so far; valid before commit. */
void wh_outfile_checksum(const wh_outfile *o, char hex[33]);

#endif
