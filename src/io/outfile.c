/*
 * Buffer -> checksum -> write(2). The checksum is taken when the buffer is flushed, while its
 * bytes are still in cache. A failure is kept in `failed`, so that the many small writes in
 * between need not look for it: the commit does, and then nothing appears under the name.
 *
 * A pipe without a reader, or with one that sleeps, must not keep a request to stop waiting: such
 * targets are opened without blocking and written when poll(2) has room, by no more than surely
 * fits.
 */
#define _GNU_SOURCE
#include "io/outfile.h"

#include "io/pack.h"

#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <limits.h>
#include <poll.h>
#include <stdio.h>
#include <string.h>
#include <sys/random.h>
#include <sys/stat.h>
#include <sys/statvfs.h>
#include <unistd.h>

#define XXH_STATIC_LINKING_ONLY /* the state lies inside our own struct */
#include <xxhash.h>

enum {
	BUFFER = 1 << 20,
	MOST_LINKS = 40, /* symbolic links followed before we call it a loop, as the kernel does */
	TEMP_TRIES = 100,
	WAIT_MS = 100 /* between two looks whether to stop */
};

struct wh_outfile {
	XXH3_state_t hash;
	char *shown; /* the name the user gave, for messages */
	char *name;  /* file name of the target in its folder; NULL when written directly */
	char *temp;  /* name of the temporary file in the same folder; NULL when there is none */
	const char *tag; /* end of that name; NULL: a random one */
	int dirfd;       /* the folder; -1 when written directly */
	int fd;
	bool own_fd; /* false for standard output */
	bool waits;  /* writing may wait for somebody to read */
	bool force;  /* an existing target may be replaced */
	bool failed;
	bool nameless;    /* the temporary file does not have its name yet */
	uint64_t flushed; /* bytes that left the buffer */
	size_t used;      /* bytes in the buffer */
	unsigned char *buffer;
	wh_packer *packer;     /* NULL: bytes go out as they are */
	unsigned char *packed; /* BUFFER bytes that come out of it */
};

/* --- where the bytes go --- */

/* Appends `name` to the folder part of `path` (all up to its last slash). False: too long. */
static bool sibling(char out[PATH_MAX], const char *path, const char *name)
{
	const char *slash = strrchr(path, '/');
	const int folder = slash && name[0] != '/' ? (int)(slash - path) + 1 : 0;
	const int n = snprintf(out, PATH_MAX, "%.*s%s", folder, path, name);
	return n > 0 && n < PATH_MAX;
}

/* Follows symbolic links at the end of the path, also when the last one leads to nothing yet. False
 * with errno where there is no end of them, or no room. */
static bool follow(const char *path, char out[PATH_MAX])
{
	char link[PATH_MAX];
	char next[PATH_MAX];
	errno = ENAMETOOLONG;
	if (!sibling(out, "", path))
		return false;
	for (int i = 0; i < MOST_LINKS; i++) {
		const ssize_t n = readlink(out, link, sizeof link - 1);
		if (n < 0)
			return true;
		link[n] = '\0';
		errno = ENAMETOOLONG;
		if (!sibling(next, out, link))
			return false;
		memcpy(out, next, PATH_MAX);
	}
	errno = ELOOP;
	return false;
}

static wh_code follow_links(wh_ctx *c, const char *path, char out[PATH_MAX])
{
	if (*path == '\0')
		return wh_fail(c, WH_E_USAGE, "the name of the output is empty");
	if (follow(path, out))
		return WH_OK;
	if (errno == ENAMETOOLONG)
		return wh_fail(c, WH_E_USAGE, "the output path is too long: %.200s...", path);
	return wh_fail(c, WH_E_RUN, "'%s': too many symbolic links", path);
}

/* The folder that a path leads to, and the name in it, which lies in target. NULL: there is none.
 */
static const char *place_of(const char *path, struct stat *folder, char target[PATH_MAX])
{
	char above[PATH_MAX];
	if (!follow(path, target) || !sibling(above, target, ".") || stat(above, folder) != 0)
		return NULL;
	const char *slash = strrchr(target, '/');
	return slash ? slash + 1 : target;
}

bool wh_outfile_same(const char *a, const char *b)
{
	struct stat x, y;
	char target_a[PATH_MAX], target_b[PATH_MAX];
	if (strcmp(a, b) == 0)
		return true;
	if (stat(a, &x) == 0 && stat(b, &y) == 0)
		return x.st_dev == y.st_dev && x.st_ino == y.st_ino;
	const char *name_a = place_of(a, &x, target_a);
	const char *name_b = place_of(b, &y, target_b);
	return name_a && name_b && x.st_dev == y.st_dev && x.st_ino == y.st_ino &&
	       strcmp(name_a, name_b) == 0;
}

wh_code wh_outfile_foresee(wh_ctx *c, const char *path, uint64_t bytes)
{
	struct stat st;
	struct statvfs disk;
	char target[PATH_MAX], folder[PATH_MAX];
	if (strcmp(path, "-") == 0 || (stat(path, &st) == 0 && !S_ISREG(st.st_mode)) ||
	    !follow(path, target) || !sibling(folder, target, ".") || statvfs(folder, &disk) != 0 ||
	    disk.f_blocks == 0)
		return WH_OK;
	const uint64_t room = (uint64_t)disk.f_bavail * disk.f_frsize;
	if (room >= bytes - bytes / 10)
		return WH_OK;
	return wh_fail(c, WH_E_PLAN,
	               "the folder of '%s' has %" PRIu64
	               " bytes free, and the result will have %" PRIu64
	               " or more: make room, or give an output on another disk",
	               path, room, bytes);
}

static wh_code open_folder(wh_ctx *c, wh_outfile *o, const char *target)
{
	const char *slash = strrchr(target, '/');
	const char *name = slash ? slash + 1 : target;
	char folder[PATH_MAX] = ".";
	if (slash)
		(void)snprintf(folder, sizeof folder, "%.*s", (int)(slash - target) + 1, target);
	if (*name == '\0' || strcmp(name, ".") == 0 || strcmp(name, "..") == 0)
		return wh_fail(c, WH_E_USAGE, "'%s' is a folder; give the name of a file",
		               o->shown);
	o->dirfd = open(folder, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
	if (o->dirfd < 0)
		return wh_fail_errno(c, "cannot write '%s', its folder '%s' cannot be opened",
		                     o->shown, folder);
	o->name = wh_strdup(c, name);
	return o->name ? WH_OK : c->err.code;
}

static void random_suffix(char suffix[7])
{
	static const char letters[] = "abcdefghijklmnopqrstuvwxyz0123456789";
	unsigned char r[6];
	if (getrandom(r, sizeof r, 0) != (ssize_t)sizeof r)
		memset(r, (int)getpid(), sizeof r);
	for (size_t i = 0; i < sizeof r; i++)
		suffix[i] = letters[r[i] % (sizeof letters - 1)];
	suffix[6] = '\0';
}

enum { ROOM = NAME_MAX - 24 }; /* of the target's name in ".NAME.whittle-TAG" */

static void temp_name(char temp[NAME_MAX + 1], const char *name, const char *tag)
{
	(void)snprintf(temp, NAME_MAX + 1, ".%.*s.whittle-%.12s", ROOM, name, tag);
}

/* A path that leads to an open file without a name. */
static const char *path_of(int fd, char path[32])
{
	(void)snprintf(path, 32, "/proc/self/fd/%d", fd);
	return path;
}

/* A file without a name, which is gone when its last descriptor is. Not every system has them. */
static void open_nameless(wh_outfile *o)
{
	char path[32];
	o->fd = openat(o->dirfd, ".", O_WRONLY | O_TMPFILE | O_CLOEXEC, 0666);
	if (o->fd >= 0 && access(path_of(o->fd, path), F_OK) != 0) {
		(void)close(o->fd); /* there would be no way to name it */
		o->fd = -1;
	}
	o->nameless = o->fd >= 0;
}

static wh_code open_temp(wh_ctx *c, wh_outfile *o)
{
	char temp[NAME_MAX + 1];
	char suffix[7];
	if (o->tag) {
		temp_name(temp, o->name, o->tag);
		open_nameless(o);
	}
	for (int i = 0; i < TEMP_TRIES && o->fd < 0; i++) {
		random_suffix(suffix);
		temp_name(temp, o->name, o->tag ? o->tag : suffix);
		o->fd = openat(o->dirfd, temp, O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
		if (o->fd < 0 && errno != EEXIST)
			break;
	}
	if (o->fd < 0)
		return wh_fail_errno(c, "cannot write '%s', no file can be made in its folder",
		                     o->shown);
	o->own_fd = true;
	o->temp = wh_strdup(c, temp);
	if (!o->temp) {
		if (!o->nameless)
			(void)unlinkat(o->dirfd, temp, 0);
		return c->err.code;
	}
	return WH_OK;
}

/* A pipe that nobody reads yet cannot be opened (ENXIO): until somebody does. */
static wh_code open_direct(wh_ctx *c, wh_outfile *o, mode_t kind)
{
	do {
		if (wh_poll(c) != WH_OK)
			return c->err.code;
		o->fd = open(o->shown, O_WRONLY | O_CLOEXEC | O_NONBLOCK);
	} while (o->fd < 0 && errno == ENXIO && S_ISFIFO(kind) && poll(NULL, 0, WAIT_MS) <= 0);
	if (o->fd < 0)
		return wh_fail_errno(c, "cannot write '%s'", o->shown);
	o->own_fd = true;
	const int flags = fcntl(o->fd, F_GETFL);
	if (flags < 0 || fcntl(o->fd, F_SETFL, flags & ~O_NONBLOCK) != 0)
		return wh_fail_errno(c, "cannot write '%s'", o->shown);
	return WH_OK;
}

static wh_code exists_already(wh_ctx *c, const wh_outfile *o)
{
	return wh_fail(c, WH_E_USAGE, "'%s' exists already; use -f to replace it", o->shown);
}

static wh_code open_target(wh_ctx *c, wh_outfile *o)
{
	char target[PATH_MAX] = "";
	struct stat st;
	const bool exists = stat(o->shown, &st) == 0; /* follows links, as the kernel sees them */
	if (exists && S_ISDIR(st.st_mode))
		return wh_fail(c, WH_E_USAGE, "'%s' is a folder; give the name of a file",
		               o->shown);
	if (exists && !S_ISREG(st.st_mode))
		return open_direct(c, o, st.st_mode);
	if (exists && !o->force)
		return exists_already(c, o);
	if (follow_links(c, o->shown, target) != WH_OK || open_folder(c, o, target) != WH_OK ||
	    open_temp(c, o) != WH_OK)
		return c->err.code;
	if (exists) /* a mode that cannot be kept is no reason to fail */
		(void)!fchmod(o->fd, st.st_mode & 07777);
	return WH_OK;
}

wh_code wh_outfile_open(wh_ctx *c, wh_outfile **out, const char *path, bool force)
{
	return wh_outfile_open_tagged(c, out, path, force, NULL);
}

wh_code wh_outfile_open_tagged(wh_ctx *c, wh_outfile **out, const char *path, bool force,
                               const char *tag)
{
	*out = NULL;
	wh_outfile *o = wh_calloc(c, 1, sizeof *o);
	if (!o)
		return c->err.code;
	o->fd = o->dirfd = -1;
	o->force = force;
	o->tag = tag;
	o->shown = wh_strdup(c, strcmp(path, "-") == 0 ? "standard output" : path);
	o->buffer = wh_alloc(c, BUFFER, 1);
	if (!o->shown || !o->buffer)
		goto fail;
	XXH3_INITSTATE(&o->hash);
	(void)XXH3_128bits_reset(&o->hash);
	if (strcmp(path, "-") == 0)
		o->fd = STDOUT_FILENO;
	else if (open_target(c, o) != WH_OK)
		goto fail;
	struct stat st;
	o->waits = fstat(o->fd, &st) == 0 && !S_ISREG(st.st_mode);
	*out = o;
	return WH_OK;
fail:
	wh_outfile_abort(c, &o);
	return c->err.code;
}

/* --- writing --- */

static wh_code write_failed(wh_ctx *c, wh_outfile *o)
{
	o->failed = true;
	if (errno == ENOSPC || errno == EDQUOT || errno == EFBIG)
		return wh_fail(c, WH_E_RUN,
		               "no space left for '%s' within its first %" PRIu64
		               " bytes (%s); make room or write it to another place",
		               o->shown, o->flushed, strerror(errno));
	return wh_fail_errno(c, "cannot write '%s'", o->shown);
}

static wh_code failed_before(wh_ctx *c, const wh_outfile *o)
{
	return wh_fail(c, WH_E_RUN, "'%s' could not be written", o->shown);
}

/* Waits until PIPE_BUF bytes can be written, but not for ever when asked to stop. */
static wh_code wait_for_reader(wh_ctx *c, wh_outfile *o)
{
	struct pollfd p = {.fd = o->fd, .events = POLLOUT};
	int ready;
	do {
		if (wh_poll(c) != WH_OK) {
			o->failed = true;
			return c->err.code;
		}
		ready = poll(&p, 1, WAIT_MS);
	} while (ready == 0 || (ready < 0 && errno == EINTR));
	return WH_OK; /* an error shows again on writing */
}

static wh_code write_all(wh_ctx *c, wh_outfile *o, const unsigned char *bytes, size_t n)
{
	(void)XXH3_128bits_update(&o->hash, bytes, n);
	o->flushed += n;
	while (n > 0) {
		if (o->waits && wait_for_reader(c, o) != WH_OK)
			return c->err.code;
		const ssize_t done = write(o->fd, bytes, o->waits && n > PIPE_BUF ? PIPE_BUF : n);
		if (done < 0 && errno == EINTR)
			continue;
		if (done < 0)
			return write_failed(c, o);
		bytes += done;
		n -= (size_t)done;
	}
	return WH_OK;
}

/* Compresses n bytes, and the end of the stream where it is reached, on their way. */
static wh_code pack_all(wh_ctx *c, wh_outfile *o, const unsigned char *bytes, size_t n, bool end)
{
	wh_pack_step s = {.in = bytes, .n = n, .end = end};
	do {
		s.out = o->packed;
		s.room = BUFFER;
		if (wh_packer_step(c, o->packer, &s) != WH_OK) {
			o->failed = true;
			return c->err.code;
		}
		if (write_all(c, o, o->packed, s.used) != WH_OK)
			return c->err.code;
	} while (!s.done);
	return WH_OK;
}

static wh_code send(wh_ctx *c, wh_outfile *o, const unsigned char *bytes, size_t n)
{
	return o->packer ? pack_all(c, o, bytes, n, false) : write_all(c, o, bytes, n);
}

wh_code wh_outfile_pack(wh_ctx *c, wh_outfile *o, wh_packing packing)
{
	if (packing == WH_PACKING_NONE)
		return WH_OK;
	o->packed = wh_alloc(c, BUFFER, 1);
	return o->packed ? wh_packer_open(c, &o->packer, packing) : wh_failed(c);
}

static wh_code flush(wh_ctx *c, wh_outfile *o)
{
	if (o->failed)
		return failed_before(c, o);
	const size_t n = o->used;
	o->used = 0;
	return send(c, o, o->buffer, n);
}

wh_code wh_outfile_write(wh_ctx *c, wh_outfile *o, const void *bytes, size_t n)
{
	if (n > BUFFER - o->used && flush(c, o) != WH_OK)
		return c->err.code;
	if (o->failed)
		return failed_before(c, o);
	if (n > BUFFER)
		return send(c, o, bytes, n);
	if (n > 0)
		memcpy(o->buffer + o->used, bytes, n);
	o->used += n;
	return WH_OK;
}

void *wh_outfile_room(wh_ctx *c, wh_outfile *o, size_t n)
{
	if (o->failed || (n > BUFFER - o->used && flush(c, o) != WH_OK)) {
		(void)failed_before(c, o);
		return NULL;
	}
	return o->buffer + o->used;
}

void wh_outfile_advance(wh_outfile *o, size_t used)
{
	o->used += used;
}

/* --- the end --- */

/* Gives the temporary file its name where no file may be replaced. errno tells the failure. */
static int rename_new(const wh_outfile *o)
{
	if (renameat2(o->dirfd, o->temp, o->dirfd, o->name, RENAME_NOREPLACE) == 0)
		return 0;
	if (errno != EINVAL && errno != ENOSYS)
		return -1;
	if (linkat(o->dirfd, o->temp, o->dirfd, o->name, 0) == 0)
		return unlinkat(o->dirfd, o->temp, 0);
	if (errno == EEXIST)
		return -1;
	/* A file system with neither (FAT): the last look leaves a gap that cannot be closed. */
	if (faccessat(o->dirfd, o->name, F_OK, AT_SYMLINK_NOFOLLOW) == 0) {
		errno = EEXIST;
		return -1;
	}
	return renameat(o->dirfd, o->temp, o->dirfd, o->name);
}

/* Gives a file without a name its own, or, where that may replace another, that of a temporary
 * file first. errno tells the failure. */
static int name_it(wh_outfile *o)
{
	char path[32];
	const char *name = o->force ? o->temp : o->name;
	if (linkat(AT_FDCWD, path_of(o->fd, path), o->dirfd, name, AT_SYMLINK_FOLLOW) != 0)
		return -1;
	o->nameless = false;
	return o->force ? renameat(o->dirfd, o->temp, o->dirfd, o->name) : 0;
}

static int give_name(wh_outfile *o)
{
	if (o->nameless)
		return name_it(o);
	return o->force ? renameat(o->dirfd, o->temp, o->dirfd, o->name) : rename_new(o);
}

static wh_code publish(wh_ctx *c, wh_outfile *o)
{
	const int r = give_name(o);
	if (r != 0 && errno == EEXIST)
		return exists_already(c, o);
	if (r != 0)
		return wh_fail_errno(c, "cannot give the output its name '%s'", o->shown);
	wh_free(c, o->temp);
	o->temp = NULL;
	if (fsync(o->dirfd) != 0 && errno != EINVAL && errno != ENOTSUP && errno != EROFS)
		return wh_fail_errno(c,
		                     "'%s' was written whole, but its folder cannot be flushed "
		                     "and may forget it when the power fails",
		                     o->shown);
	return WH_OK;
}

/* Closes the descriptor and checks it: some file systems report a full disk only here. A file
 * without a name would be gone. */
static wh_code close_checked(wh_ctx *c, wh_outfile *o)
{
	if (o->temp && fsync(o->fd) != 0)
		return write_failed(c, o);
	if (!o->own_fd || o->nameless)
		return WH_OK;
	const int r = close(o->fd);
	o->fd = -1;
	if (r != 0 && errno != EINTR)
		return write_failed(c, o);
	return WH_OK;
}

wh_code wh_outfile_end(wh_ctx *c, wh_outfile *o)
{
	wh_code code = flush(c, o);
	if (code == WH_OK && o->packer)
		code = pack_all(c, o, NULL, 0, true);
	wh_packer_close(c, o->packer);
	o->packer = NULL;
	return code;
}

wh_code wh_outfile_commit(wh_ctx *c, wh_outfile **out)
{
	wh_outfile *o = *out;
	wh_code code = wh_outfile_end(c, o);
	if (code == WH_OK)
		code = close_checked(c, o);
	if (code == WH_OK && o->temp)
		code = publish(c, o);
	wh_outfile_abort(c, out);
	return code;
}

void wh_outfile_abort(wh_ctx *c, wh_outfile **out)
{
	wh_outfile *o = *out;
	*out = NULL;
	if (!o)
		return;
	if (o->temp && !o->nameless)
		(void)unlinkat(o->dirfd, o->temp, 0);
	if (o->own_fd && o->fd >= 0)
		(void)close(o->fd);
	if (o->dirfd >= 0)
		(void)close(o->dirfd);
	wh_packer_close(c, o->packer);
	wh_free(c, o->packed);
	wh_free(c, o->buffer);
	wh_free(c, o->temp);
	wh_free(c, o->name);
	wh_free(c, o->shown);
	wh_free(c, o);
}

uint64_t wh_outfile_bytes(const wh_outfile *o)
{
	return o->flushed + o->used;
}

static void digits_of(XXH128_hash_t h, char hex[33])
{
	(void)snprintf(hex, 33, "%016llx%016llx", (unsigned long long)h.high64,
	               (unsigned long long)h.low64);
}

void wh_outfile_checksum(const wh_outfile *o, char hex[33])
{
	XXH3_state_t copy;
	XXH3_copyState(&copy, &o->hash);
	(void)XXH3_128bits_update(&copy, o->buffer, o->used);
	digits_of(XXH3_128bits_digest(&copy), hex);
}

/* --- what another process left --- */

void wh_outfile_clear(wh_ctx *c, const char *path, const char *tag)
{
	char target[PATH_MAX], temp[NAME_MAX + 1], left[PATH_MAX];
	wh_ctx own = wh_ctx_fork(c);
	if (follow_links(&own, path, target) != WH_OK)
		return;
	const char *slash = strrchr(target, '/');
	temp_name(temp, slash ? slash + 1 : target, tag);
	if (sibling(left, target, temp))
		(void)unlink(left);
}

static bool has_checksum(int fd, unsigned char *buf, uint64_t bytes, XXH3_state_t *state,
                         const char hex[33])
{
	char found[33];
	uint64_t at = 0;
	(void)XXH3_128bits_reset(state);
	for (ssize_t n = 1; n > 0; at += (uint64_t)n) {
		n = pread(fd, buf, BUFFER, (off_t)at);
		if (n < 0)
			return false;
		(void)XXH3_128bits_update(state, buf, (size_t)n);
	}
	const XXH128_hash_t h = XXH3_128bits_digest(state);
	digits_of(h, found);
	return at == bytes && strcmp(found, hex) == 0;
}

bool wh_outfile_is(wh_ctx *c, const char *path, uint64_t bytes, const char hex[33])
{
	struct stat st;
	wh_ctx own = wh_ctx_fork(c);
	if (stat(path, &st) != 0 || !S_ISREG(st.st_mode) || (uint64_t)st.st_size != bytes)
		return false;
	const int fd = open(path, O_RDONLY | O_CLOEXEC);
	unsigned char *buf = wh_alloc(&own, BUFFER, 1);
	XXH3_state_t *state = wh_calloc(&own, 1, sizeof *state);
	const bool same = fd >= 0 && buf && state && has_checksum(fd, buf, bytes, state, hex);
	wh_free(&own, state);
	wh_free(&own, buf);
	if (fd >= 0)
		(void)close(fd);
	return same;
}
