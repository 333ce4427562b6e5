#include "page_out.h"

#include "page_files.h"
#include "whittle.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

void page_put_n(const page_out *o, const char *bytes, size_t n)
{
	if (o->c->err.code == WH_OK)
		(void)wh_outfile_write(o->c, o->file, bytes, n);
}

void page_put(const page_out *o, const char *html)
{
	page_put_n(o, html, strlen(html));
}

void page_putf(const page_out *o, const char *fmt, ...)
{
	char text[PAGE_WORDS];
	va_list ap;
	va_start(ap, fmt);
	(void)vsnprintf(text, sizeof text, fmt, ap);
	va_end(ap);
	page_put(o, text);
}

void page_fill(const page_out *o, const char *html,
               void (*put)(const void *from, const page_out *o, const char *name, size_t n),
               const void *from)
{
	for (const char *open; (open = strstr(html, "{{")) != NULL;) {
		const char *close = strstr(open, "}}");
		if (!close)
			break;
		page_put_n(o, html, (size_t)(open - html));
		put(from, o, open + 2, (size_t)(close - open) - 2);
		html = close + 2;
	}
	page_put(o, html);
}

/* What goes into the frame. */
typedef struct framed {
	const unsigned char *page;
	void (*put)(const void *from, const page_out *o, const char *name, size_t n);
	const void *from;
} framed;

static void put_into_frame(const void *from, const page_out *o, const char *name, size_t n)
{
	const framed *w = from;
	if (n == 4 && strncmp(name, "page", n) == 0)
		page_fill(o, (const char *)w->page, w->put, w->from);
	else if (n == 3 && strncmp(name, "css", n) == 0)
		page_put(o, (const char *)page_css);
	else if (n == 7 && strncmp(name, "version", n) == 0)
		page_put(o, WHITTLE_VERSION);
	else
		w->put(w->from, o, name, n);
}

void page_put_whole(const page_out *o, const unsigned char *page,
                    void (*put)(const void *from, const page_out *o, const char *name, size_t n),
                    const void *from)
{
	const framed w = {page, put, from};
	page_fill(o, (const char *)page_frame, put_into_frame, &w);
}

void page_scripts(const page_out *o, const unsigned char *view, const unsigned char *what)
{
	page_put(o, "<script>\n/*\n");
	page_put(o, (const char *)page_licence);
	page_put(o, "*/\n");
	page_put(o, (const char *)page_three);
	page_put(o, "\n</script>\n<script>\n(function () {\n'use strict';\n\n");
	page_put(o, (const char *)view);
	page_put(o, "\n");
	page_put(o, (const char *)what);
	page_put(o, "}());\n</script>\n");
}

/* ---- text ----------------------------------------------------------------------------------- */

/* Bytes of the character that a text begins with, as UTF-8; 0 when it is none. */
static size_t character(const unsigned char *s)
{
	static const struct {
		size_t bytes;
		uint32_t least; /* shorter ones have to be written shorter */
		unsigned char mask, head;
	} kinds[] = {{1, 0, 0x80, 0x00},
	             {2, 0x80, 0xe0, 0xc0},
	             {3, 0x800, 0xf0, 0xe0},
	             {4, 0x10000, 0xf8, 0xf0}};
	for (size_t k = 0; k < sizeof kinds / sizeof *kinds; k++) {
		if ((s[0] & kinds[k].mask) != kinds[k].head)
			continue;
		uint32_t code = s[0] & (unsigned char)~kinds[k].mask;
		for (size_t i = 1; i < kinds[k].bytes; i++) {
			if ((s[i] & 0xc0) != 0x80)
				return 0;
			code = code << 6 | (s[i] & 0x3f);
		}
		const bool surrogate = code >= 0xd800 && code < 0xe000;
		return code >= kinds[k].least && code < 0x110000 && !surrogate ? kinds[k].bytes : 0;
	}
	return 0;
}

/* What stands for an ASCII character; NULL: itself. */
static const char *entity(unsigned char c)
{
	switch (c) {
	case '<':
		return "&lt;";
	case '>':
		return "&gt;";
	case '&':
		return "&amp;";
	case '"':
		return "&quot;";
	case '\'':
		return "&#39;";
	default:
		return c < ' ' || c == 127 ? "&#xfffd;" : NULL;
	}
}

void page_text(const page_out *o, const char *text)
{
	const unsigned char *s = (const unsigned char *)text;
	while (*s) {
		const size_t n = character(s);
		const char *instead = n == 0 ? "&#xfffd;" : n == 1 ? entity(*s) : NULL;
		if (instead)
			page_put(o, instead);
		else
			page_put_n(o, (const char *)s, n);
		s += n ? n : 1;
	}
}

const char *page_name(const char *path)
{
	const char *slash = strrchr(path, '/');
	return slash ? slash + 1 : path;
}

/* ---- bytes ---------------------------------------------------------------------------------- */

void page_base64(const page_out *o, const uint8_t *bytes, size_t n)
{
	static const char digits[] =
	    "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
	enum { GROUPS = 1024 };
	char text[4 * GROUPS];
	for (size_t at = 0; at < n;) {
		size_t used = 0;
		for (; used < sizeof text && at < n; at += 3, used += 4) {
			const size_t left = n - at;
			const uint32_t v = (uint32_t)bytes[at] << 16 |
			                   (left > 1 ? (uint32_t)bytes[at + 1] << 8 : 0) |
			                   (left > 2 ? bytes[at + 2] : 0);
			text[used] = digits[v >> 18];
			text[used + 1] = digits[v >> 12 & 63];
			text[used + 2] = left > 1 ? digits[v >> 6 & 63] : '=';
			text[used + 3] = left > 2 ? digits[v & 63] : '=';
		}
		page_put_n(o, text, used);
	}
}

/* In JSON, < is found in strings only. */
void page_json(const page_out *o, const json_t *j)
{
	char *text = json_dumps(j, JSON_ENSURE_ASCII | JSON_COMPACT | JSON_REAL_PRECISION(9));
	if (!text) {
		(void)wh_fail(o->c, WH_E_RUN, "out of memory");
		return;
	}
	for (const char *s = text; *s;) {
		const size_t n = strcspn(s, "<");
		page_put_n(o, s, n);
		s += n;
		if (*s == '<') {
			page_put(o, "\\u003c");
			s++;
		}
	}
	free(text);
}

/* ---- numbers -------------------------------------------------------------------------------- */

void page_count(const page_out *o, uint64_t n)
{
	char digits[24];
	const int len = snprintf(digits, sizeof digits, "%" PRIu64, n);
	for (int i = 0; i < len; i++) {
		if (i > 0 && (len - i) % 3 == 0)
			page_put(o, "&#8239;"); /* a narrow space that does not break */
		page_putf(o, "%c", digits[i]);
	}
}

/* Without an exponent where few digits do. */
void page_real(const page_out *o, double x)
{
	const double size = fabs(x);
	if (!isfinite(x)) {
		page_put(o, "&ndash;");
	} else if (x == 0) {
		page_put(o, "0");
	} else if (size >= 9999.5 && size < 1e9) {
		page_put(o, x < 0 ? "&minus;" : "");
		page_count(o, (uint64_t)(size + 0.5));
	} else if (size >= 1e-4 && size < 9999.5) {
		const int digits = 3 - (int)floor(log10(size));
		page_put(o, x < 0 ? "&minus;" : "");
		page_putf(o, "%.*f", digits > 0 ? digits : 0, size);
	} else {
		const int power = (int)floor(log10(size));
		page_putf(o, "%.3f&#8239;&times;&#8239;10<sup>%d</sup>", x / pow(10, power), power);
	}
}

void page_bytes(const page_out *o, double bytes)
{
	static const char *const units[] = {"B", "KiB", "MiB", "GiB", "TiB"};
	size_t i = 0;
	for (; bytes >= 1000 && i + 1 < sizeof units / sizeof *units; i++)
		bytes /= 1024;
	page_putf(o, i == 0 || bytes >= 100 ? "%.0f&#8239;%s" : "%.1f&#8239;%s", bytes, units[i]);
}

void page_seconds(const page_out *o, double s)
{
	const double whole = floor(s + 0.5);
	if (s < 120)
		page_putf(o, s < 10 ? "%.2f&#8239;s" : "%.1f&#8239;s", s);
	else if (s < 7200)
		page_putf(o, "%.0f&#8239;min %.0f&#8239;s", floor(whole / 60), fmod(whole, 60));
	else
		page_putf(o, "%.0f&#8239;h %.0f&#8239;min", floor(whole / 3600),
		          floor(fmod(whole, 3600) / 60));
}
