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
#include <sys/statvfs.h>
#include <unistd.h>

#define XXH_STATIC_LINKING_ONLY /* the size of its state */
#include <xxhash.h>

static const char KEPT[] = "whittle-run"; /* the kept folder inside the user's */

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

/* ---- what is in the folder ---------------------------------------------------------------- */

/* Shows all names but "." and ".." to `see`, until it returns false. */
static void look_through(int dirfd, bool (*see)(void *to, int dirfd, const char *name), void *to)
{
	const int fd = dup(dirfd);
	DIR *d = fd < 0 ? NULL : fdopendir(fd);
	if (!d) {
		if (fd >= 0)
			(void)close(fd);
		return;
	}
	rewinddir(d);
	bool on = true;
	for (const struct dirent *e = readdir(d); e && on; e = readdir(d))
		if (strcmp(e->d_name, ".") != 0 && strcmp(e->d_name, "..") != 0)
			on = see(to, dirfd, e->d_name);
	(void)closedir(d);
}

static bool ends_in(const char *name, const char *end)
{
	const size_t n = strlen(name), m = strlen(end);
	return n >= m && strcmp(name + n - m, end) == 0;
}

/* Removes all but the file `to`. */
static bool see_and_remove(void *to, int dirfd, const char *name)
{
	const char *spared = to;
	if (!spared || strcmp(name, spared) != 0)
		(void)unlinkat(dirfd, name, 0);
	return true;
}

/* Removes files whose names end in `to`. */
static bool see_half_done(void *to, int dirfd, const char *name)
{
	if (ends_in(name, to))
		(void)unlinkat(dirfd, name, 0);
	return true;
}

static bool see_and_count(void *to, int dirfd, const char *name)
{
	wh_spill *s = to;
	struct stat st;
	if (ends_in(name, ".part"))
		(void)unlinkat(dirfd, name, 0);
	else if (fstatat(dirfd, name, &st, AT_SYMLINK_NOFOLLOW) == 0)
		atomic_fetch_add(&s->held, (uint64_t)st.st_size);
	return true;
}

static bool see_whole(void *to, int dirfd, const char *name)
{
	(void)dirfd;
	bool *whole = to;
	*whole = !ends_in(name, ".part");
	return !*whole;
}

static void close_folder(wh_ctx *c, wh_spill *s)
{
	(void)close(s->dirfd);
	(void)pthread_mutex_destroy(&s->growing);
	wh_free(c, s->dir);
	s->dir = NULL;
	s->dirfd = -1;
	atomic_store(&s->held, 0);
}

/* Removes a kept folder in which nothing is left, and the one around it. */
static void remove_empty(wh_spill *s, bool outside)
{
	if (rmdir(s->dir) == 0 && outside) {
		*strrchr(s->dir, '/') = '\0';
		(void)rmdir(s->dir);
	}
}

void wh_spill_close(wh_ctx *c, wh_spill *s)
{
	if (!s->dir)
		return;
	if (s->kept) {
		char part[WH_SPILL_NAME];
		look_through(s->dirfd, see_half_done, (void *)wh_spill_part(s, "", part));
		remove_empty(s, s->made);
	} else {
		look_through(s->dirfd, see_and_remove, NULL);
		(void)rmdir(s->dir);
	}
	close_folder(c, s);
}

/* ---- a kept folder ------------------------------------------------------------------------ */

/* True when there is room, but for no further file. */
static bool lacks_inodes(const char *place)
{
	struct statvfs st;
	return statvfs(place, &st) == 0 && st.f_files > 0 && st.f_favail == 0 && st.f_bavail > 0;
}

static wh_code make_folder(wh_ctx *c, const char *dir, bool *made)
{
	char above[PATH_MAX];
	*made = mkdir(dir, 0777) == 0;
	if (*made || errno == EEXIST)
		return WH_OK;
	const int why = errno;
	(void)snprintf(above, sizeof above, "%s", dir);
	char *slash = strrchr(above, '/');
	if (slash)
		slash[slash == above ? 1 : 0] = '\0';
	const bool files = why == ENOSPC && lacks_inodes(slash ? above : ".");
	errno = why;
	return wh_fail_errno(c, "cannot make the folder '%s'%s", dir,
	                     files           ? " (no inodes left: remove files of that disk)"
	                     : why == ENOSPC ? " (make room there)"
	                                     : "");
}

static wh_code open_kept(wh_ctx *c, wh_spill *s, const char *base)
{
	bool made;
	if (make_folder(c, base, &s->made) != WH_OK || make_folder(c, s->dir, &made) != WH_OK)
		return c->err.code;
	s->dirfd = open(s->dir, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
	return s->dirfd >= 0 ? WH_OK : wh_fail_errno(c, "cannot open the folder '%s'", s->dir);
}

wh_code wh_spill_keep(wh_ctx *c, wh_spill *s, const char *base, const char *tag)
{
	*s = (wh_spill){.dirfd = -1, .kept = true};
	const size_t room = strlen(base) + sizeof KEPT + 1;
	s->dir = wh_alloc(c, room, 1);
	if (!s->dir)
		return c->err.code;
	(void)snprintf(s->dir, room, "%s/%s", base, KEPT);
	(void)snprintf(s->tag, sizeof s->tag, "%s", tag);
	if (open_kept(c, s, base) != WH_OK) {
		if (s->made)
			(void)rmdir(base);
		wh_free(c, s->dir);
		s->dir = NULL;
		return c->err.code;
	}
	(void)pthread_mutex_init(&s->growing, NULL);
	return WH_OK;
}

bool wh_spill_is_kept(const char *base)
{
	char path[PATH_MAX];
	const int n = snprintf(path, sizeof path, "%s/%s", base, KEPT);
	return n > 0 && (size_t)n < sizeof path && access(path, F_OK) == 0;
}

wh_code wh_spill_tidy(wh_ctx *c, wh_spill *s)
{
	atomic_store(&s->held, 0);
	look_through(s->dirfd, see_and_count, s);
	const uint64_t held = atomic_load(&s->held);
	if (held > atomic_load(&s->peak))
		atomic_store(&s->peak, held);
	return wh_poll(c);
}

bool wh_spill_is_used(const wh_spill *s)
{
	bool whole = false;
	look_through(s->dirfd, see_whole, &whole);
	return whole;
}

typedef struct viewer {
	bool (*see)(void *to, const char *name);
	void *to;
} viewer;

static bool see_name(void *to, int dirfd, const char *name)
{
	(void)dirfd;
	const viewer *v = to;
	return v->see(v->to, name);
}

void wh_spill_each(const wh_spill *s, bool (*see)(void *to, const char *name), void *to)
{
	viewer v = {see, to};
	look_through(s->dirfd, see_name, &v);
}

typedef struct removal {
	wh_spill *s;
	const char *prefix;
} removal;

static bool see_prefix(void *to, const char *name)
{
	const removal *r = to;
	if (strncmp(name, r->prefix, strlen(r->prefix)) == 0)
		wh_spill_remove(r->s, name);
	return true;
}

void wh_spill_remove_all(wh_spill *s, const char *prefix)
{
	removal r = {s, prefix};
	wh_spill_each(s, see_prefix, &r);
}

void wh_spill_discard(wh_ctx *c, wh_spill *s, const char *last, bool outside)
{
	if (!s->dir)
		return;
	look_through(s->dirfd, see_and_remove, (void *)last);
	if (last)
		(void)unlinkat(s->dirfd, last, 0);
	remove_empty(s, outside);
	close_folder(c, s);
}

const char *wh_spill_part(const wh_spill *s, const char *name, char part[WH_SPILL_NAME])
{
	(void)snprintf(part, WH_SPILL_NAME, "%.48s%s%s.part", name, s->tag[0] ? "." : "", s->tag);
	return part;
}

/* ---- files -------------------------------------------------------------------------------- */

/* What would help, for messages. */
static const char *remedy(const wh_spill *s)
{
	return s->kept ? "make room there and go on with --resume"
	               : "use --temp-dir to choose another place";
}

/* `more`: bytes that were to come next. */
static wh_code no_space(wh_ctx *c, const wh_spill *s, uint64_t more)
{
	char all[64] = "";
	const char *why = strerror(errno);
	if (more == 0 && errno == ENOSPC && lacks_inodes(s->dir))
		return wh_fail(
		    c, WH_E_RUN,
		    "no inodes left for another file in '%s' (%s); remove files of that disk, "
		    "or %s",
		    s->dir, why, remedy(s));
	if (s->planned)
		(void)snprintf(all, sizeof all, ", about %" PRIu64 " in all", s->planned);
	return wh_fail(c, WH_E_RUN,
	               "no space left in '%s' (%" PRIu64 " bytes of temporary files there, %" PRIu64
	               " more to come next%s; %s); %s",
	               s->dir, (uint64_t)atomic_load(&s->held), more, all, why, remedy(s));
}

wh_code wh_spill_foresee(wh_ctx *c, const wh_spill *s)
{
	const uint64_t held = atomic_load(&s->held);
	struct statvfs st;
	if (s->planned <= held || fstatvfs(s->dirfd, &st) != 0 || st.f_blocks == 0)
		return WH_OK;
	const uint64_t need = s->planned - held, room = (uint64_t)st.f_bavail * st.f_frsize;
	if (room >= need - need / 10)
		return WH_OK;
	return wh_fail(c, WH_E_PLAN,
	               "'%s' has %" PRIu64 " bytes free, and this run will need about %" PRIu64
	               " there: make room, or use %s to choose another place",
	               s->dir, room, need, s->kept ? "--run-dir" : "--temp-dir");
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
	char part[WH_SPILL_NAME];
	(void)snprintf(name, sizeof name, "scratch-%u", atomic_fetch_add(&s->scratches, 1));
	const int fd = wh_spill_create(c, s, wh_spill_part(s, name, part));
	if (fd >= 0)
		(void)unlinkat(s->dirfd, part, 0);
	return fd;
}

void wh_spill_close_scratch(wh_spill *s, int fd)
{
	struct stat st;
	if (fstat(fd, &st) == 0)
		atomic_fetch_sub(&s->held, (uint64_t)st.st_size);
	(void)close(fd);
}

/* ---- what lasts --------------------------------------------------------------------------- */

wh_code wh_spill_flush_file(wh_ctx *c, const wh_spill *s, const char *name)
{
	const int fd = openat(s->dirfd, name, O_RDONLY | O_CLOEXEC);
	if (fd < 0 && errno == ENOENT)
		return WH_OK;
	const int r = fd < 0 ? -1 : fsync(fd), why = errno;
	if (fd >= 0)
		(void)close(fd);
	errno = why;
	if (r == 0 || why == EINVAL || why == ENOTSUP)
		return WH_OK;
	if (why == ENOSPC || why == EDQUOT)
		return no_space(c, s, 0);
	return wh_fail_errno(c, "cannot flush the temporary file '%s/%s'", s->dir, name);
}

/* Takes all that wait, so that others may wait while these are flushed. */
static wh_code flush_pending(wh_ctx *c, wh_spill *s)
{
	char name[WH_SPILL_PENDING][WH_SPILL_NAME];
	(void)pthread_mutex_lock(&s->growing);
	const size_t n = s->pendings;
	memcpy(name, s->pending, n * sizeof *name);
	s->pendings = 0;
	(void)pthread_mutex_unlock(&s->growing);
	for (size_t i = 0; i < n; i++)
		if (wh_spill_flush_file(c, s, name[i]) != WH_OK)
			return c->err.code;
	return WH_OK;
}

/* False when too many wait. */
static bool add_pending(wh_spill *s, const char *name)
{
	(void)pthread_mutex_lock(&s->growing);
	const bool fits = s->pendings < WH_SPILL_PENDING;
	if (fits)
		(void)snprintf(s->pending[s->pendings++], WH_SPILL_NAME, "%s", name);
	(void)pthread_mutex_unlock(&s->growing);
	return fits;
}

wh_code wh_spill_flush(wh_ctx *c, wh_spill *s)
{
	if (flush_pending(c, s) != WH_OK)
		return c->err.code;
	if (fsync(s->dirfd) != 0 && errno != EINVAL && errno != ENOTSUP && errno != EROFS)
		return wh_fail_errno(c, "cannot flush the folder '%s'", s->dir);
	return WH_OK;
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
	while (s->kept && !add_pending(s, to))
		if (flush_pending(c, s) != WH_OK)
			return c->err.code;
	return WH_OK;
}

void wh_spill_remove(wh_spill *s, const char *name)
{
	struct stat st;
	if (fstatat(s->dirfd, name, &st, AT_SYMLINK_NOFOLLOW) == 0 &&
	    unlinkat(s->dirfd, name, 0) == 0)
		atomic_fetch_sub(&s->held, (uint64_t)st.st_size);
}

bool wh_spill_has(const wh_spill *s, const char *name)
{
	struct stat st;
	return fstatat(s->dirfd, name, &st, AT_SYMLINK_NOFOLLOW) == 0;
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
	return wh_fail_errno(c, "cannot write the temporary file '%s' at byte %" PRIu64 " (%s)",
	                     name_of(s, fd, name), off, remedy(s));
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
			return wh_fail_errno(
			    c, "cannot read the temporary file '%s' at byte %" PRIu64 " (%s)",
			    name_of(s, fd, name), off, remedy(s));
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

enum { SUM_BUFFER = 64 * 1024 };

static wh_code sum_up(wh_ctx *c, wh_spill *s, int fd, uint64_t size, uint8_t *buf,
                      XXH3_state_t *state)
{
	(void)XXH3_64bits_reset(state);
	for (uint64_t at = 0; at < size; at += SUM_BUFFER) {
		const size_t n = size - at < SUM_BUFFER ? (size_t)(size - at) : SUM_BUFFER;
		if (wh_spill_pread(c, s, fd, buf, n, at) != WH_OK)
			return c->err.code;
		(void)XXH3_64bits_update(state, buf, n);
	}
	return WH_OK;
}

wh_code wh_spill_checksum(wh_ctx *c, wh_spill *s, const char *name, uint64_t *size,
                          uint64_t *checksum)
{
	struct stat st = {0};
	const int fd = wh_spill_read(c, s, name);
	if (fd < 0)
		return wh_failed(c);
	uint8_t *buf = wh_alloc(c, SUM_BUFFER, 1);
	XXH3_state_t *state = wh_alloc(c, 1, sizeof *state);
	wh_code code = buf && state ? WH_OK : wh_failed(c);
	if (code == WH_OK && fstat(fd, &st) != 0)
		code = wh_fail_errno(c, "cannot look at '%s/%s'", s->dir, name);
	if (code == WH_OK)
		code = sum_up(c, s, fd, (uint64_t)st.st_size, buf, state);
	*size = (uint64_t)st.st_size;
	*checksum = code == WH_OK ? XXH3_64bits_digest(state) : 0;
	wh_free(c, state);
	wh_free(c, buf);
	(void)close(fd);
	return code;
}
