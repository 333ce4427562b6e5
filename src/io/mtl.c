#define _GNU_SOURCE
#include "io/mtl.h"

#include "io/number.h"

#include <fcntl.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

enum { BYTES_MOST = 64 << 20 }; /* of a file */

char *wh_beside(wh_ctx *c, const char *mesh, const char *name)
{
	const char *slash = strrchr(mesh, '/');
	const size_t folder = slash && *name != '/' ? (size_t)(slash - mesh) + 1 : 0;
	const size_t n = strlen(name);
	char *path = wh_alloc(c, folder + n + 1, 1);
	if (!path)
		return NULL;
	memcpy(path, mesh, folder);
	memcpy(path + folder, name, n + 1);
	for (char *s = path + folder; *s; s++) /* as some programs write them */
		*s = *s == '\\' ? '/' : *s;
	return path;
}

/* What is behind the first word of a line, without blanks at its ends; *n bytes of it. */
static const char *rest_of(const char *s, const char *end, size_t *n)
{
	while (s < end && !wh_is_blank(*s))
		s++;
	while (s < end && wh_is_blank(*s))
		s++;
	while (end > s && wh_is_blank(end[-1]))
		end--;
	*n = (size_t)(end - s);
	return s;
}

/* The name of a file, which options with their values may stand in front of: then its last word. */
static const char *file_of(const char *s, size_t *n)
{
	const char *end = s + *n, *last = end;
	if (*n == 0 || *s != '-')
		return s;
	while (last > s && !wh_is_blank(last[-1]))
		last--;
	*n = (size_t)(end - last);
	return last;
}

static bool begins(const char *s, const char *end, const char *word)
{
	const size_t n = strlen(word);
	return (size_t)(end - s) > n && strncasecmp(s, word, n) == 0 && wh_is_blank(s[n]);
}

static wh_code take_line(wh_ctx *c, const char *s, const char *end, const wh_names *materials,
                         uint32_t *material, wh_mtl *m)
{
	size_t n;
	while (s < end && wh_is_blank(*s))
		s++;
	if (begins(s, end, "newmtl")) {
		s = rest_of(s, end, &n);
		*material = wh_names_find(materials, s, n);
	} else if (begins(s, end, "map_Kd") && *material != UINT32_MAX) {
		s = rest_of(s, end, &n);
		s = file_of(s, &n);
		if (n)
			return wh_names_add(c, &m->textures, s, n, &m->of[*material]);
	}
	return WH_OK;
}

static wh_code take_text(wh_ctx *c, const char *s, size_t n, const wh_names *materials, wh_mtl *m)
{
	uint32_t material = UINT32_MAX;
	const char *const end = s + n;
	while (s < end) {
		const char *eol = s;
		while (eol < end && *eol != '\n' && *eol != '\r')
			eol++;
		if (take_line(c, s, eol, materials, &material, m) != WH_OK)
			return c->err.code;
		s = eol + (eol < end);
	}
	return WH_OK;
}

static wh_code take_file(wh_ctx *c, const char *path, const wh_names *materials, wh_mtl *m)
{
	struct stat st;
	const int fd = open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK); /* a pipe must not block */
	if (fd < 0)
		return WH_OK;
	char *text = NULL;
	wh_code code = WH_OK;
	if (fstat(fd, &st) == 0 && S_ISREG(st.st_mode) && st.st_size <= BYTES_MOST) {
		text = wh_alloc(c, (size_t)st.st_size, 1);
		const ssize_t got = text ? pread(fd, text, (size_t)st.st_size, 0) : -1;
		code = !text     ? wh_failed(c)
		       : got > 0 ? take_text(c, text, (size_t)got, materials, m)
		                 : WH_OK;
	}
	wh_free(c, text);
	(void)close(fd);
	return code;
}

wh_code wh_mtl_read(wh_ctx *c, const char *mesh, const wh_names *libraries,
                    const wh_names *materials, wh_mtl *m)
{
	*m = (wh_mtl){.of = wh_alloc(c, (size_t)materials->n + 1, sizeof *m->of)};
	wh_code code = m->of ? WH_OK : c->err.code;
	for (uint32_t i = 0; m->of && i < materials->n; i++)
		m->of[i] = UINT32_MAX;
	for (uint32_t i = 0; code == WH_OK && i < libraries->n; i++) {
		char *path = wh_beside(c, mesh, libraries->item[i]);
		code = path ? take_file(c, path, materials, m) : wh_failed(c);
		wh_free(c, path);
	}
	if (code != WH_OK)
		wh_mtl_free(c, m);
	return code;
}

void wh_mtl_free(wh_ctx *c, wh_mtl *m)
{
	wh_names_free(c, &m->textures);
	wh_free(c, m->of);
	*m = (wh_mtl){0};
}
