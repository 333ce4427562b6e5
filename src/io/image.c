#define _GNU_SOURCE
#include "io/image.h"

#include "io/ply.h"

#include <errno.h>
#include <fcntl.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

enum { BYTES_MOST = 1 << 30 }; /* of a file */

wh_code wh_image_make(wh_ctx *c, const char *path, uint64_t w, uint64_t h, wh_image *m)
{
	if (w == 0 || h == 0 || w > WH_IMAGE_SIDE_MOST || h > WH_IMAGE_SIDE_MOST)
		return wh_fail(
		    c, WH_E_INPUT, "'%s': a picture of %llu x %llu pixels; %d a side are the most",
		    path, (unsigned long long)w, (unsigned long long)h, WH_IMAGE_SIDE_MOST);
	*m = (wh_image){(uint32_t)w, (uint32_t)h, NULL};
	m->rgba = wh_alloc(c, (size_t)w * (size_t)h, 4);
	return m->rgba ? WH_OK : c->err.code;
}

static wh_code decode(wh_ctx *c, const char *path, const uint8_t *bytes, size_t n, wh_image *m)
{
	static const uint8_t png[] = {0x89, 'P', 'N', 'G'}, jpeg[] = {0xff, 0xd8, 0xff};
	if (n >= sizeof png && memcmp(bytes, png, sizeof png) == 0)
		return wh_png_read(c, path, bytes, n, m);
	if (n >= sizeof jpeg && memcmp(bytes, jpeg, sizeof jpeg) == 0)
		return wh_jpeg_read(c, path, bytes, n, m);
	return wh_fail(c, WH_E_INPUT, "'%s' is no PNG or JPEG picture: convert it to one", path);
}

static wh_code read_all(wh_ctx *c, const char *path, int fd, wh_image *m)
{
	struct stat st;
	if (fstat(fd, &st) != 0)
		return wh_fail_errno(c, "cannot examine '%s'", path);
	if (!S_ISREG(st.st_mode) || st.st_size > BYTES_MOST)
		return wh_fail(c, WH_E_INPUT, "'%s' is no picture: %s", path,
		               S_ISREG(st.st_mode) ? "it is too large" : "it is no regular file");
	const size_t n = (size_t)st.st_size;
	uint8_t *bytes = wh_alloc(c, n, 1);
	wh_code code = bytes ? wh_ply_pread(c, path, fd, bytes, n, 0) : wh_failed(c);
	if (code == WH_OK)
		code = decode(c, path, bytes, n, m);
	wh_free(c, bytes);
	return code;
}

wh_code wh_image_read(wh_ctx *c, const char *path, wh_image *m)
{
	*m = (wh_image){0};
	const int fd = open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK); /* a pipe must not block */
	if (fd < 0)
		return wh_fail(c, WH_E_INPUT, "cannot open the picture '%s': %s", path,
		               strerror(errno));
	const wh_code code = read_all(c, path, fd, m);
	(void)close(fd);
	if (code != WH_OK) {
		wh_free(c, m->rgba);
		*m = (wh_image){0};
	}
	return code;
}
