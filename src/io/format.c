#include "io/format.h"

#include "base/bytes.h"
#include "io/number.h"

#include <ctype.h>
#include <string.h>
#include <strings.h>

static const char *const names[] = {"any", "ply", "obj", "off", "stl", "glb"};

const char *wh_format_name(wh_format f)
{
	return names[f];
}

bool wh_format_parse(const char *name, wh_format *f)
{
	for (int i = WH_FORMAT_PLY; i <= WH_FORMAT_GLB; i++) {
		if (strcasecmp(name, names[i]) == 0) {
			*f = (wh_format)i;
			return true;
		}
	}
	return false;
}

/* --- file names --- */

/* Does the part of the path before `end` end in "." and this extension? */
static bool ends_in(const char *path, const char *end, const char *extension)
{
	const size_t n = strlen(extension);
	return (size_t)(end - path) > n && end[-(ptrdiff_t)n - 1] == '.' &&
	       strncasecmp(end - n, extension, n) == 0;
}

wh_packing wh_packing_of_name(const char *path)
{
	const char *end = path + strlen(path);
	return ends_in(path, end, "gz")    ? WH_PACKING_GZIP
	       : ends_in(path, end, "zst") ? WH_PACKING_ZSTD
	                                   : WH_PACKING_NONE;
}

/* Where a name ends, ".gz" and ".zst" not counted. */
static const char *before_packing(const char *path)
{
	const wh_packing packing = wh_packing_of_name(path);
	return path + strlen(path) -
	       (packing == WH_PACKING_GZIP   ? 3
	        : packing == WH_PACKING_ZSTD ? 4
	                                     : 0);
}

/* Is there a point in the last part of the path before `end`, and a letter behind it? Points in
 * front of names hide them, and numbers belong to names: lod-0.5. */
static bool has_ending(const char *path, const char *end)
{
	bool letter = false;
	for (const char *at = end; at > path && at[-1] != '/'; at--) {
		if (at[-1] == '.')
			return letter && at - 1 > path && at[-2] != '/';
		letter |= isalpha((unsigned char)at[-1]) != 0;
	}
	return false;
}

wh_format wh_format_of_name(const char *path)
{
	const char *end = before_packing(path);
	for (int i = WH_FORMAT_PLY; i <= WH_FORMAT_GLB; i++)
		if (ends_in(path, end, names[i]))
			return (wh_format)i;
	return WH_FORMAT_ANY;
}

/* --- content --- */

/* "obj", "ply.gz". */
static bool parse_output(const char *text, wh_format *f, wh_packing *packing)
{
	char name[8];
	const size_t n = strcspn(text, ".");
	*packing = wh_packing_of_name(text);
	if (n >= sizeof name || (text[n] && *packing == WH_PACKING_NONE) ||
	    strchr(text, '.') != strrchr(text, '.'))
		return false;
	memcpy(name, text, n);
	name[n] = '\0';
	return wh_format_parse(name, f);
}

wh_code wh_format_of_output(wh_ctx *c, const char *to, const char *path, wh_format *f,
                            wh_packing *packing)
{
	if (to)
		return parse_output(to, f, packing)
		           ? WH_OK
		           : wh_fail(c, WH_E_USAGE,
		                     "'%s' is no format that can be written: give ply, obj, off, "
		                     "stl or glb, perhaps with .gz or .zst behind it",
		                     to);
	*f = path ? wh_format_of_name(path) : WH_FORMAT_ANY;
	*packing = path ? wh_packing_of_name(path) : WH_PACKING_NONE;
	if (*f != WH_FORMAT_ANY)
		return WH_OK;
	*f = WH_FORMAT_PLY;
	return !path || !has_ending(path, before_packing(path))
	           ? WH_OK
	           : wh_fail(c, WH_E_USAGE,
	                     "'%s': nothing is written under that ending, but .ply, .obj, .off, "
	                     ".stl and .glb, perhaps with .gz or .zst behind it: name it so, or "
	                     "say --to FORMAT",
	                     path);
}

wh_code wh_format_only(wh_ctx *c, const char *path, const char *ending)
{
	const char *end = path + strlen(path);
	return ends_in(path, end, ending) || !has_ending(path, end)
	           ? WH_OK
	           : wh_fail(c, WH_E_USAGE, "'%s': only .%s is written there: name it so", path,
	                     ending);
}

wh_packing wh_packing_of_bytes(const char *head, size_t n)
{
	if (n >= 2 && memcmp(head, "\x1f\x8b", 2) == 0)
		return WH_PACKING_GZIP;
	if (n >= 4 && memcmp(head, "\x28\xb5\x2f\xfd", 4) == 0)
		return WH_PACKING_ZSTD;
	/* a frame of other data may come first: pzstd's do */
	if (n >= 4 && (wh_load32(head, WH_HOST_BIG) & 0xfffffff0u) == 0x184d2a50u)
		return WH_PACKING_ZSTD;
	return WH_PACKING_NONE;
}

bool wh_format_is_binary_stl(const char *head, size_t n, uint64_t size)
{
	if (n < WH_STL_BODY || size < WH_STL_BODY)
		return false;
	const uint64_t facets = wh_load32(head + WH_STL_HEADER, WH_HOST_BIG);
	return (size - WH_STL_BODY) / WH_STL_FACET == facets &&
	       (size - WH_STL_BODY) % WH_STL_FACET == 0;
}

char wh_format_eol(const char *head, size_t n)
{
	return !memchr(head, '\n', n) && memchr(head, '\r', n) ? '\r' : '\n';
}

/* Is the word of n letters "OFF" with the letters of its kinds in front? */
static bool is_off_word(const char *word, size_t n)
{
	if (n < 3 || n > 8 || memcmp(word + n - 3, "OFF", 3) != 0)
		return false;
	for (size_t i = 0; i + 3 < n; i++)
		if (!strchr("STCN4n", word[i]))
			return false;
	return true;
}

static bool is_obj_word(const char *word, size_t n)
{
	static const char *const tags[] = {"v", "vt", "vn", "f", "o", "g", "s", "mtllib", "usemtl"};
	for (size_t i = 0; i < sizeof tags / sizeof tags[0]; i++)
		if (strlen(tags[i]) == n && memcmp(word, tags[i], n) == 0)
			return true;
	return false;
}

/* The first word behind blanks and comments; false when there is none. */
static bool first_word(const char *s, const char *end, const char **word, size_t *n)
{
	const char eol = wh_format_eol(s, (size_t)(end - s));
	for (;;) {
		while (s < end && wh_is_blank(*s))
			s++;
		if (s < end && *s != '#')
			break;
		s = s < end ? memchr(s, eol, (size_t)(end - s)) : NULL;
		if (!s)
			return false;
	}
	*word = s;
	while (s < end && !wh_is_blank(*s))
		s++;
	*n = (size_t)(s - *word);
	return true;
}

wh_format wh_format_of_bytes(const char *head, size_t n, uint64_t size)
{
	const char *word;
	size_t length;
	if (wh_format_is_binary_stl(head, n, size))
		return WH_FORMAT_STL;
	if (n >= 4 && memcmp(head, "ply", 3) == 0 && wh_is_blank(head[3]))
		return WH_FORMAT_PLY;
	if (!first_word(head, head + n, &word, &length))
		return WH_FORMAT_ANY;
	if (is_off_word(word, length))
		return WH_FORMAT_OFF;
	if (length == 5 && strncasecmp(word, "solid", 5) == 0)
		return WH_FORMAT_STL;
	return is_obj_word(word, length) ? WH_FORMAT_OBJ : WH_FORMAT_ANY;
}
