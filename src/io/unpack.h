/*
 * unpack: compressed files (gzip, zstd), and what comes through a pipe, become temporary files.
 *
 * Which of the two libraries there are is decided when whittle is built.
 */
#ifndef WH_IO_UNPACK_H
#define WH_IO_UNPACK_H

#include "io/format.h"
#include "io/ply.h"
#include "io/spill.h"

/* Can such files be read and written by this build? */
bool wh_packing_known(wh_packing p);

/* "gzip", "zstd". */
const char *wh_packing_name(wh_packing p);

/*
 * Takes all of the open file `from` into a scratch file of `spill`, to be closed by
 * wh_spill_close_scratch, and decompresses it when its beginning says that it is compressed.
 * *taken: its bytes; *size: those that came out. WH_E_INPUT for a stream that is damaged or cut
 * short, with the place, and in a build without the library; WH_E_RUN for a full disk. Compressed
 * streams one after the other are one. Waiting for a pipe ends when the process is interrupted.
 * Memory: 2 MiB, and the window of the compressed stream. Returns the descriptor or -1.
 */
int wh_unpack(wh_ctx *c, wh_spill *spill, const wh_ply *from, uint64_t *taken, uint64_t *size);

#endif
