/*
 * The account of bytes held needs no table of files: a write past the end first extends the
 * file, under the lock, and the growth is counted there; removing a file takes off the size that
 * the file system reports. Both cost a system call or two, nothing beside a write of the sizes
 * whittle uses.
 */
#define _GNU_SOURCE
#include "io/spill.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

static const char *choose_place(const char *base, const char *fallback)
{
	const char *const choice[] = {base, base ? NULL : getenv("SLURM_TMPDIR"),
	                              base ? NULL : getenv("TMPDIR"), fallback};
	for (size_t i = 0; i < sizeof choice / sizeof choice[0]; i++)
		if (choice[i] && choice[i][0] != '\0')
			return choice[i];
	return ".";
}

wh_code wh_spill_open(wh_ctx *c, wh_spill *s, const char *base, const char *fallback)
{
	*s = (wh_spill){.dirfd = -1};
	const char *place = choose_place(base, fallback);
	const size_t room = strlen(place) + sizeof "/whittle-XXXXXX";
	char *dir = wh_alloc(c, room, 1);
	if (!dir)
		return c->err.code;
	(void)snprintf(dir, room, "%s/whittle-XXXXXX", place);
	if (!mkdtemp(dir)) {
		(void)wh_fail_errno(c,
		                    "cannot make a folder for temporary files in '%s' (use "
		                    "--temp-dir to choose another place)",
		                    place);
		goto fail;
	}
	s->dirfd = open(dir, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
	if (s->dirfd < 0) {
		(void)wh_fail_errno(c, "cannot open the new temporary folder '%s'", dir);
		(void)rmdir(dir);
		goto fail;
	}
	(void)pthread_mutex_init(&s->growing, NULL);
	s->dir = dir;
	return WH_OK;
fail:
	wh_free(c, dir);
	return c->err.code;
}

static void remove_all(int dirfd)
{
	const int fd = dup(dirfd);
	DIR *d = fd < 0 ? NULL : fdopendir(fd);
	if (!d) {
		if (fd >= 0)
			(void)close(fd);
		return;
	}
	rewinddir(d);
	for (const struct dirent *e = readdir(d); e; e = readdir(d))
		if (strcmp(e->d_name, ".") != 0 && strcmp(e->d_name, "..") != 0)
			(void)unlinkat(dirfd, e->d_name, 0);
	(void)closedir(d);
}

void wh_spill_close(wh_ctx *c, wh_spill *s)
{
	if (!s->dir)
		return;
	remove_all(s->dirfd);
	(void)close(s->dirfd);
	(void)rmdir(s->dir);
	(void)pthread_mutex_destroy(&s->growing);
	wh_free(c, s->dir);
	s->dir = NULL;
	s->dirfd = -1;
	atomic_store(&s->held, 0);
}

/* `more`: bytes that were to come next. */
static wh_code no_space(wh_ctx *c, const wh_spill *s, uint64_t more)
{
	return wh_fail(c, WH_E_RUN,
	               "no space left in '%s' (%" PRIu64 " bytes of temporary files there, %" PRIu64
	               " more to come next; %s); use --temp-dir to choose another place",
	               s->dir, (uint64_t)atomic_load(&s->held), more, strerror(errno));
}

/* What a descriptor was opened as, for messages. */
static const char *name_of(const wh_spill *s, int fd, char name[PATH_MAX])
{
	char link[64];
	(void)snprintf(link, sizeof link, "/proc/self/fd/%d", fd);
	const ssize_t n = readlink(link, name, PATH_MAX - 1);
	if (n <= 0)
		return s->dir;
	name[n] = '\0';
	return name;
}

/* Descriptor, or -1 with the failure recorded. */
static int open_in(wh_ctx *c, const wh_spill *s, const char *name, int flags)
{
	const int fd = openat(s->dirfd, name, flags | O_CLOEXEC, 0600);
	if (fd >= 0)
		return fd;
	if (errno == ENOSPC || errno == EDQUOT)
		(void)no_space(c, s, 0);
	else if (errno == ENOENT)
		(void)wh_fail_errno(c, "the temporary file '%s/%s' is gone: who removed it?",
		                    s->dir, name);
	else if (errno == EMFILE || errno == ENFILE)
		(void)wh_fail_errno(c, "cannot open '%s/%s' (raise the limit with ulimit -n)",
		                    s->dir, name);
	else
		(void)wh_fail_errno(c, "cannot open the temporary file '%s/%s'", s->dir, name);
	return -1;
}

int wh_spill_create(wh_ctx *c, wh_spill *s, const char *name)
{
	wh_spill_remove(s, name);
	return open_in(c, s, name, O_RDWR | O_CREAT | O_EXCL);
}

int wh_spill_reopen(wh_ctx *c, wh_spill *s, const char *name)
{
	return open_in(c, s, name, O_RDWR);
}

int wh_spill_read(wh_ctx *c, wh_spill *s, const char *name)
{
	return open_in(c, s, name, O_RDONLY);
}

int wh_spill_scratch(wh_ctx *c, wh_spill *s)
{
	char name[32];
	(void)snprintf(name, sizeof name, "scratch-%u", atomic_fetch_add(&s->scratches, 1));
	const int fd = wh_spill_create(c, s, name);
	if (fd >= 0)
		(void)unlinkat(s->dirfd, name, 0);
	return fd;
}

void wh_spill_close_scratch(wh_spill *s, int fd)
{
	struct stat st;
	if (fstat(fd, &st) == 0)
		atomic_fetch_sub(&s->held, (uint64_t)st.st_size);
	(void)close(fd);
}

wh_code wh_spill_rename(wh_ctx *c, wh_spill *s, const char *from, const char *to)
{
	if (strcmp(from, to) == 0)
		return WH_OK;
	struct stat old;
	const bool replaces = fstatat(s->dirfd, to, &old, AT_SYMLINK_NOFOLLOW) == 0;
	if (renameat(s->dirfd, from, s->dirfd, to) != 0)
		return wh_fail_errno(c, "cannot rename the temporary file '%s/%s' to '%s'", s->dir,
		                     from, to);
	if (replaces)
		atomic_fetch_sub(&s->held, (uint64_t)old.st_size);
	return WH_OK;
}

void wh_spill_remove(wh_spill *s, const char *name)
{
	struct stat st;
	if (fstatat(s->dirfd, name, &st, AT_SYMLINK_NOFOLLOW) == 0 &&
	    unlinkat(s->dirfd, name, 0) == 0)
		atomic_fetch_sub(&s->held, (uint64_t)st.st_size);
}

static void account_growth(wh_spill *s, uint64_t bytes)
{
	const uint64_t now = atomic_fetch_add(&s->held, bytes) + bytes;
	uint64_t peak = atomic_load(&s->peak);
	while (now > peak && !atomic_compare_exchange_weak(&s->peak, &peak, now)) {
	}
}

/* Makes the file at least `end` bytes long. Under the lock: of two threads that write behind the
 * end, neither may cut off the other's bytes or count them twice. */
static int grow(wh_spill *s, int fd, uint64_t end)
{
	struct stat st;
	(void)pthread_mutex_lock(&s->growing);
	int r = fstat(fd, &st);
	if (r == 0 && end > (uint64_t)st.st_size) {
		r = ftruncate(fd, (off_t)end);
		if (r == 0)
			account_growth(s, end - (uint64_t)st.st_size);
	}
	(void)pthread_mutex_unlock(&s->growing);
	return r;
}

wh_code wh_spill_pwrite(wh_ctx *c, wh_spill *s, int fd, const void *buf, size_t n, uint64_t off)
{
	const char *bytes = buf;
	char name[PATH_MAX];
	if (n > 0 && grow(s, fd, off + n) != 0)
		goto fail;
	atomic_fetch_add(&s->bytes_written, n);
	while (n > 0) {
		const ssize_t done = pwrite(fd, bytes, n, (off_t)off);
		if (done < 0 && errno == EINTR)
			continue;
		if (done < 0)
			goto fail;
		bytes += done;
		off += (uint64_t)done;
		n -= (size_t)done;
	}
	return WH_OK;
fail:
	if (errno == ENOSPC || errno == EDQUOT || errno == EFBIG)
		return no_space(c, s, n);
	return wh_fail_errno(c,
	                     "cannot write the temporary file '%s' at byte %" PRIu64
	                     " (use --temp-dir to choose another place)",
	                     name_of(s, fd, name), off);
}

wh_code wh_spill_pread(wh_ctx *c, wh_spill *s, int fd, void *buf, size_t n, uint64_t off)
{
	char *bytes = buf;
	char name[PATH_MAX];
	atomic_fetch_add(&s->bytes_read, n);
	while (n > 0) {
		const ssize_t done = pread(fd, bytes, n, (off_t)off);
		if (done < 0 && errno == EINTR)
			continue;
		if (done < 0)
			return wh_fail_errno(c,
			                     "cannot read the temporary file '%s' at byte %" PRIu64
			                     " (use --temp-dir to choose another place)",
			                     name_of(s, fd, name), off);
		if (done == 0)
			return wh_fail(c, WH_E_RUN,
			               "the temporary file '%s' is damaged: it ends at byte "
			               "%" PRIu64 ", %zu bytes early",
			               name_of(s, fd, name), off, n);
		bytes += done;
		off += (uint64_t)done;
		n -= (size_t)done;
	}
	return WH_OK;
}
