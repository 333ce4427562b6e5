/*
 * spill: the folder of temporary files of one run, removed with all it holds.
 *
 * The folder is made inside the user's choice of place, with a name nobody else has. Files in it
 * are written under a ".part" name and committed by rename. wh_spill_close removes everything,
 * also after a failure. Byte counters are thread-safe; a wh_spill must not be copied or moved.
 *
 * A kept folder is the other kind: it has a fixed name, outlives the process, and is found again by
 * the next one. What has its name in it is whole for every process, and survives a machine that
 * stops from the next wh_spill_flush on: a flush takes the disk's time, and one of many files
 * hardly more than one of one. Two processes may be at work in it by mistake: files that are not
 * whole have names of their own, so that neither writes into those of the other.
 */
#ifndef WH_IO_SPILL_H
#define WH_IO_SPILL_H

#include "base/mem.h"

#include <pthread.h>
#include <stdatomic.h>

enum {
	WH_SPILL_TAG = 16,    /* bytes of a tag with its NUL */
	WH_SPILL_NAME = 80,   /* bytes of a file's name with its NUL */
	WH_SPILL_PENDING = 64 /* files that wait for a flush, at most */
};

typedef struct wh_spill {
	char *dir;             /* path of the folder; NULL: none was made */
	int dirfd;             /* open on it */
	_Atomic uint64_t held; /* bytes of its files now */
	_Atomic uint64_t peak; /* most bytes at any time */
	_Atomic uint64_t bytes_read;
	_Atomic uint64_t bytes_written;
	_Atomic unsigned scratches; /* scratch files made so far: numbers their short-lived names */
	pthread_mutex_t growing;    /* held while a file is made longer */
	bool kept;                  /* the folder outlives the process */
	bool made;                  /* the folder around a kept one was made for it */
	char tag[WH_SPILL_TAG];     /* in the names of files that are not whole */
	uint64_t planned;           /* bytes that it will come to hold; 0: nobody knows */
	char pending[WH_SPILL_PENDING][WH_SPILL_NAME]; /* renamed in a kept folder, not flushed */
	size_t pendings;                               /* under the lock of `growing` */
} wh_spill;

/*
 * Makes the folder inside `base`, or, when base is NULL, inside the first of $SLURM_TMPDIR,
 * $TMPDIR and `fallback` (a folder) that is set. WH_E_RUN names the place and the remedy.
 */
wh_code wh_spill_open(wh_ctx *c, wh_spill *s, const char *base, const char *fallback);
/* Removes the folder; of a kept one only the files that are not whole, and itself when nothing is
 * left. */
void wh_spill_close(wh_ctx *c, wh_spill *s);

/*
 * Opens the kept folder inside `base`, and makes both where they do not exist. `tag`: a word that
 * no other process uses, of letters and digits. Nothing in the folder is touched.
 */
wh_code wh_spill_keep(wh_ctx *c, wh_spill *s, const char *base, const char *tag);
/* Is there a kept folder inside `base`? */
bool wh_spill_is_kept(const char *base);
/* Removes what a process that is gone left half done in a kept folder, and counts the rest as
 * held. */
wh_code wh_spill_tidy(wh_ctx *c, wh_spill *s);
/* True when something besides half-done files is in the folder. */
bool wh_spill_is_used(const wh_spill *s);
/* Removes all of a kept folder, the file `last` at last (NULL: none), and closes it. `outside`: the
 * folder around it, too, when nothing else is in it. */
void wh_spill_discard(wh_ctx *c, wh_spill *s, const char *last, bool outside);
/* Shows the name of every file in the folder to `see`, until it returns false. */
void wh_spill_each(const wh_spill *s, bool (*see)(void *to, const char *name), void *to);
/* Removes all files whose names begin so. */
void wh_spill_remove_all(wh_spill *s, const char *prefix);
/* Makes sure that what was renamed in the folder stays there, with its bytes. */
wh_code wh_spill_flush(wh_ctx *c, wh_spill *s);
/* The same for the bytes of one file, which need not be there any more. */
wh_code wh_spill_flush_file(wh_ctx *c, const wh_spill *s, const char *name);

/* The name of a file that is not whole yet: "NAME.part", or with the tag "NAME.TAG.part". */
const char *wh_spill_part(const wh_spill *s, const char *name, char part[WH_SPILL_NAME]);

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
/* The file is whole, and gets its name. Thread-safe. */
wh_code wh_spill_rename(wh_ctx *c, wh_spill *s, const char *from, const char *to);
/* Removes a file and takes its size off the account; one that does not exist is ignored. */
void wh_spill_remove(wh_spill *s, const char *name);
bool wh_spill_has(const wh_spill *s, const char *name);

/*
 * WH_E_PLAN where the folder's file system has less room than nine tenths of what is still to come
 * of `planned`: names both, and the remedy.
 */
wh_code wh_spill_foresee(wh_ctx *c, const wh_spill *s);

/* pwrite and pread of exactly n bytes, counted; a short read is WH_E_RUN (a damaged temporary
 * file), a full disk names the folder and suggests --temp-dir. */
wh_code wh_spill_pwrite(wh_ctx *c, wh_spill *s, int fd, const void *buf, size_t n, uint64_t off);
wh_code wh_spill_pread(wh_ctx *c, wh_spill *s, int fd, void *buf, size_t n, uint64_t off);

/* Size and XXH3 of a whole file of the folder. */
wh_code wh_spill_checksum(wh_ctx *c, wh_spill *s, const char *name, uint64_t *size,
                          uint64_t *checksum);

#endif
