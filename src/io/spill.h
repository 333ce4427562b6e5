/*
 * spill: the folder of temporary files of one run, removed with all it holds.
 *
 * The folder is made inside the user's choice of place, with a name nobody else has. Files in it
 * are written under a ".part" name and committed by rename. wh_spill_close removes everything,
 * also after a failure. Byte counters are thread-safe; a wh_spill must not be copied or moved.
 */
#ifndef WH_IO_SPILL_H
#define WH_IO_SPILL_H

#include "base/mem.h"

#include <pthread.h>
#include <stdatomic.h>

typedef struct wh_spill {
	char *dir;             /* path of the folder; NULL: none was made */
	int dirfd;             /* open on it */
	_Atomic uint64_t held; /* bytes of its files now */
	_Atomic uint64_t peak; /* most bytes at any time */
	_Atomic uint64_t bytes_read;
	_Atomic uint64_t bytes_written;
	_Atomic unsigned scratches; /* scratch files made so far: numbers their short-lived names */
	pthread_mutex_t growing;    /* held while a file is made longer */
} wh_spill;

/*
 * Makes the folder inside `base`, or, when base is NULL, inside the first of $SLURM_TMPDIR,
 * $TMPDIR and `fallback` (a folder) that is set. WH_E_RUN names the place and the remedy.
 */
wh_code wh_spill_open(wh_ctx *c, wh_spill *s, const char *base, const char *fallback);
void wh_spill_close(wh_ctx *c, wh_spill *s);

/* Opens a file of the folder for reading and writing, empty. Returns the descriptor or -1. */
int wh_spill_create(wh_ctx *c, wh_spill *s, const char *name);
/* Opens an existing file of the folder for reading and writing, as it is. Descriptor or -1. */
int wh_spill_reopen(wh_ctx *c, wh_spill *s, const char *name);
/* Opens an existing file of the folder for reading. Descriptor or -1. */
int wh_spill_read(wh_ctx *c, wh_spill *s, const char *name);
/* A file without a name, empty, for reading and writing: gone when it is closed, which must be
 * done by wh_spill_close_scratch to take its size off the account. Descriptor or -1. */
int wh_spill_scratch(wh_ctx *c, wh_spill *s);
void wh_spill_close_scratch(wh_spill *s, int fd);
wh_code wh_spill_rename(wh_ctx *c, wh_spill *s, const char *from, const char *to);
/* Removes a file and takes its size off the account; one that does not exist is ignored. */
void wh_spill_remove(wh_spill *s, const char *name);

/* pwrite and pread of exactly n bytes, counted; a short read is WH_E_RUN (a damaged temporary
 * file), a full disk names the folder and suggests --temp-dir. */
wh_code wh_spill_pwrite(wh_ctx *c, wh_spill *s, int fd, const void *buf, size_t n, uint64_t off);
wh_code wh_spill_pread(wh_ctx *c, wh_spill *s, int fd, void *buf, size_t n, uint64_t off);

#endif
