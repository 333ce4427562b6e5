/*
 * Whether a line end is one is told by the two bytes before it, so a chunk is read from a few
 * bytes before its beginning: the first line that begins behind that is its first. Line ends that
 * a backslash takes away are overwritten with blanks before anybody looks at the lines.
 */
#include "pipeline/lines.h"

#include <inttypes.h>
#include <string.h>

enum {
	BEFORE = 3,     /* bytes read in front of a chunk: backslash, CR, LF */
	MORE = 1 << 16, /* bytes read first when the last line goes on behind the chunk */
	LONGEST = 64 * 1024 * 1024 /* bytes of a line */
};

wh_lines wh_lines_of(const wh_ply *file, char eol, bool joins)
{
	return (wh_lines){.file = file,
	                  .eol = eol,
	                  .joins = joins,
	                  .chunks = (int64_t)((file->size + WH_LINES_CHUNK - 1) / WH_LINES_CHUNK)};
}

/* Is the line end at text[i] taken away by a backslash? */
static bool is_joined(const wh_lines *l, const char *text, size_t i)
{
	if (!l->joins)
		return false;
	i -= i > 0 && text[i - 1] == '\r';
	return i > 0 && text[i - 1] == '\\';
}

/* The first line end from text[i] on that ends a line; n when there is none. */
static size_t find_end(const wh_lines *l, const char *text, size_t i, size_t n)
{
	while (i < n) {
		const char *end = memchr(text + i, l->eol, n - i);
		if (!end)
			return n;
		i = (size_t)(end - text);
		if (!is_joined(l, text, i))
			return i;
		i++;
	}
	return n;
}

/* Takes away joined line ends, and the backslashes in front of them. */
static void join_lines(const wh_lines *l, char *text, size_t n)
{
	for (char *s = text; (s = memchr(s, '\\', n - (size_t)(s - text))) != NULL; s++) {
		size_t i = (size_t)(s - text) + 1;
		i += i < n && text[i] == '\r' && l->eol != '\r';
		if (i < n && text[i] == l->eol)
			memset(s, ' ', i + 1 - (size_t)(s - text));
	}
}

static wh_code too_long(wh_ctx *c, const wh_lines *l, uint64_t at)
{
	return wh_fail(c, WH_E_INPUT,
	               "'%s', byte %" PRIu64
	               ": a line of more than %d MiB: this is no such text, or "
	               "its lines have to be broken first",
	               l->file->path, at, LONGEST >> 20);
}

wh_code wh_lines_load(wh_ctx *c, const wh_lines *l, int64_t chunk, wh_lines_part *p)
{
	const uint64_t start = (uint64_t)chunk * WH_LINES_CHUNK;
	const size_t before = chunk > 0 ? BEFORE : 0;
	p->base = start - before;
	const uint64_t left = l->file->size - p->base;
	size_t want = left < before + WH_LINES_CHUNK ? (size_t)left : before + WH_LINES_CHUNK;
	p->stop = want;
	p->n = 0;
	for (;;) {
		if (wh_reserve(c, &p->text, &p->cap, want + 1, 1) != WH_OK ||
		    wh_ply_pread(c, l->file->path, l->file->fd, p->text + p->n, want - p->n,
		                 p->base + p->n) != WH_OK)
			return c->err.code;
		const size_t from = p->n > p->stop ? p->n : p->stop - 1;
		p->n = want;
		if (want == left || find_end(l, p->text, from, want) < want)
			break;
		if (want - p->stop >= LONGEST)
			return too_long(c, l, p->base + p->stop);
		const size_t next = want == p->stop ? want + MORE : want + (want - p->stop);
		want = left < next ? (size_t)left : next;
	}
	p->at = before > 0 ? find_end(l, p->text, before - 1, p->n) + 1 : 0;
	p->text[p->n] = l->eol;
	if (l->joins)
		join_lines(l, p->text, p->n);
	return WH_OK;
}

void wh_lines_free(wh_ctx *c, wh_lines_part *p)
{
	wh_free(c, p->text);
	*p = (wh_lines_part){0};
}

const char *wh_lines_next(const wh_lines *l, wh_lines_part *p)
{
	while (p->at < p->stop) {
		const char *s = wh_lines_word(l, p->text + p->at);
		const size_t from = (size_t)(s - p->text);
		const char *end = memchr(s, l->eol, p->n + 1 - from);
		p->at = (size_t)(end - p->text) + 1;
		if (*s != l->eol)
			return s;
	}
	return NULL;
}

bool wh_lines_is(const char *s, const char *word)
{
	while (*word && *s == *word) {
		s++;
		word++;
	}
	return !*word && wh_is_blank(*s);
}

uint64_t wh_lines_number(wh_ctx *c, const wh_lines *l, const wh_lines_part *p, const char *s)
{
	const uint64_t place = p->base + (uint64_t)(s - p->text);
	char *text = wh_alloc(c, MORE, 1);
	uint64_t line = 1;
	for (uint64_t at = 0; text && at < place; at += MORE) {
		const size_t n = place - at < MORE ? (size_t)(place - at) : MORE;
		if (wh_ply_pread(c, l->file->path, l->file->fd, text, n, at) != WH_OK) {
			line = 0;
			break;
		}
		for (size_t i = 0; i < n; i++)
			line += text[i] == l->eol;
	}
	wh_free(c, text);
	return text ? line : 0;
}
