/*
 * unpack: compressed files (gzip, zstd) become temporary ones.
 *
 * Which of the two libraries there are is decided when whittle is built.
 */
#ifndef WH_IO_UNPACK_H
#define WH_IO_UNPACK_H

#include "io/format.h"
#include "io/spill.h"

/* Can such files be read and written by this build? */
bool wh_packing_known(wh_packing p);

/* "gzip", "zstd". */
const char *wh_packing_name(wh_packing p);

/*
 * Decompresses the open file into a scratch file of `spill`, to be closed by
 * wh_spill_close_scratch; *size: its bytes. WH_E_INPUT for a stream that is damaged or cut short,
 * with the place, and in a build without the library; WH_E_RUN for a full disk. Streams one after
 * the other are one. Memory: 2 MiB, and the window of the stream. Returns the descriptor or -1.
 */
int wh_unpack(wh_ctx *c, wh_spill *spill, const char *path, int fd, wh_packing p, uint64_t *size);

#endif
