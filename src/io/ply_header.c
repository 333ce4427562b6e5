/*
 * The header of a PLY file: lines of words up to "end_header".
 *
 * Lines end with LF, CR LF, or CR alone; the first line decides. That matters for binary files,
 * whose body begins right after the end of the last line: behind a lone CR, a byte 0x0A is data.
 * Lines that begin with an unknown word are passed over like comments.
 */
#define _GNU_SOURCE
#include "io/ply.h"

#include "io/ply_value.h"

#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

enum {
	FIRST_READ = 16 * 1024,
	LONGEST = 16 << 20, /* bytes of header that we look through for its end */
	MOST_WORDS = 6      /* of a line that mean something */
};

typedef struct word {
	const char *at;
	size_t n;
} word;

typedef struct parser {
	wh_ply *p;
	char *text; /* the beginning of the file */
	size_t cap;
	size_t n;    /* bytes of text read so far */
	size_t at;   /* start of the next line */
	size_t line; /* number of the current line, from 1 */
	bool whole;  /* text reaches to the end of the file */
	bool has_format;
	size_t elem_cap;
	size_t prop_cap; /* of the last element */
	word w[MOST_WORDS];
	size_t nw;
} parser;

__attribute__((format(printf, 3, 4))) static wh_code bad(wh_ctx *c, const parser *s,
                                                         const char *fmt, ...)
{
	char what[512];
	va_list ap;
	va_start(ap, fmt);
	(void)vsnprintf(what, sizeof what, fmt, ap);
	va_end(ap);
	return wh_fail(c, WH_E_INPUT, "'%s', header line %zu: %s", s->p->path, s->line, what);
}

/* --- words --- */

static bool is(const word *w, const char *s)
{
	return w->n == strlen(s) && memcmp(w->at, s, w->n) == 0;
}

static bool is_blank(char ch)
{
	return ch == ' ' || ch == '\t' || ch == '\r' || ch == '\n' || ch == '\v' || ch == '\f';
}

/* For messages: a word's printable length. */
static int shown(const word *w)
{
	return w->n > 60 ? 60 : (int)w->n;
}

static void split(parser *s, const char *from, const char *end)
{
	s->nw = 0;
	while (s->nw < MOST_WORDS) {
		while (from < end && is_blank(*from))
			from++;
		if (from == end)
			return;
		const char *start = from;
		while (from < end && !is_blank(*from))
			from++;
		s->w[s->nw++] = (word){start, (size_t)(from - start)};
	}
}

static bool type_of(const word *w, wh_type *t)
{
	static const struct {
		const char *name;
		wh_type type;
	} names[] = {
	    {"char", WH_I8},      {"int8", WH_I8},       {"uchar", WH_U8},   {"uint8", WH_U8},
	    {"short", WH_I16},    {"int16", WH_I16},     {"ushort", WH_U16}, {"uint16", WH_U16},
	    {"int", WH_I32},      {"int32", WH_I32},     {"uint", WH_U32},   {"uint32", WH_U32},
	    {"long", WH_I64},     {"int64", WH_I64},     {"ulong", WH_U64},  {"uint64", WH_U64},
	    {"float", WH_F32},    {"float32", WH_F32},   {"double", WH_F64}, {"float64", WH_F64},
	    {"longlong", WH_I64}, {"ulonglong", WH_U64},
	};
	for (size_t i = 0; i < sizeof names / sizeof names[0]; i++) {
		if (is(w, names[i].name)) {
			*t = names[i].type;
			return true;
		}
	}
	return false;
}

static char *copy_word(wh_ctx *c, const word *w)
{
	char *s = wh_alloc(c, w->n + 1, 1);
	if (s) {
		memcpy(s, w->at, w->n);
		s[w->n] = '\0';
	}
	return s;
}

/* --- lines of each kind --- */

static wh_code parse_format(wh_ctx *c, parser *s)
{
	static const char *const names[] = {"ascii", "binary_little_endian", "binary_big_endian"};
	if (s->nw < 2)
		return bad(c, s, "'format' without a name");
	for (int i = 0; i < 3; i++) {
		if (is(&s->w[1], names[i])) {
			s->p->format = (wh_ply_format)i;
			s->has_format = true;
			return WH_OK;
		}
	}
	return bad(c, s, "unknown format '%.*s'", shown(&s->w[1]), s->w[1].at);
}

static wh_code parse_count(wh_ctx *c, const parser *s, const word *w, uint64_t *count)
{
	*count = 0;
	for (size_t i = 0; i < w->n; i++) {
		const char ch = w->at[i];
		if (ch < '0' || ch > '9' || __builtin_mul_overflow(*count, (uint64_t)10, count) ||
		    __builtin_add_overflow(*count, (uint64_t)(ch - '0'), count))
			return bad(c, s, "'%.*s' is no possible number of items", shown(w), w->at);
	}
	return WH_OK;
}

static wh_code parse_element(wh_ctx *c, parser *s)
{
	wh_ply *p = s->p;
	uint64_t count;
	if (s->nw < 3)
		return bad(c, s, "'element' needs a name and a count");
	if (parse_count(c, s, &s->w[2], &count) != WH_OK ||
	    wh_reserve(c, &p->elems, &s->elem_cap, p->nelems + 1, sizeof *p->elems) != WH_OK)
		return c->err.code;
	char *name = copy_word(c, &s->w[1]);
	if (!name)
		return c->err.code;
	p->elems[p->nelems++] = (wh_ply_elem){.name = name, .count = count, .line = s->line};
	s->prop_cap = 0;
	return WH_OK;
}

static wh_code parse_property(wh_ctx *c, parser *s)
{
	wh_ply *p = s->p;
	if (p->nelems == 0)
		return bad(c, s, "a property before the first element");
	wh_ply_elem *e = &p->elems[p->nelems - 1];
	wh_ply_prop prop = {.is_list = s->nw > 1 && is(&s->w[1], "list")};
	const size_t last = prop.is_list ? 4 : 2; /* the word that is the name */
	if (s->nw <= last)
		return bad(c, s, "'property' needs a type and a name");
	if (prop.is_list && !type_of(&s->w[2], &prop.count_type))
		return bad(c, s, "unknown type '%.*s'", shown(&s->w[2]), s->w[2].at);
	if (prop.is_list && !wh_type_is_integer(prop.count_type))
		return bad(c, s, "the length of a list cannot be a '%.*s'", shown(&s->w[2]),
		           s->w[2].at);
	if (!type_of(&s->w[last - 1], &prop.type))
		return bad(c, s, "unknown type '%.*s'", shown(&s->w[last - 1]), s->w[last - 1].at);
	if (wh_reserve(c, &e->props, &s->prop_cap, e->nprops + 1, sizeof *e->props) != WH_OK)
		return c->err.code;
	prop.name = copy_word(c, &s->w[last]);
	if (!prop.name)
		return c->err.code;
	e->props[e->nprops++] = prop;
	return WH_OK;
}

/* "comment TextureFile atlas.png", and our own of what OBJ files name: the name goes to the end of
 * the line. */
static wh_code parse_comment(wh_ctx *c, parser *s, const char *eol)
{
	wh_ply *p = s->p;
	const struct {
		const char *word;
		wh_names *list;
	} kinds[] = {{"TextureFile", &p->textures},
	             {"MaterialFile", &p->libraries},
	             {"Material", &p->materials},
	             {"Group", &p->groups}};
	uint32_t at;
	while (is_blank(eol[-1]))
		eol--;
	for (size_t i = 0; s->nw >= 3 && i < sizeof kinds / sizeof *kinds; i++)
		if (s->w[1].n == strlen(kinds[i].word) &&
		    strncasecmp(s->w[1].at, kinds[i].word, s->w[1].n) == 0)
			return wh_names_add(c, kinds[i].list, s->w[2].at,
			                    (size_t)(eol - s->w[2].at), &at);
	return WH_OK;
}

static wh_code parse_line(wh_ctx *c, parser *s, const char *eol, bool *end)
{
	*end = false;
	if (s->nw == 0)
		return WH_OK;
	if (is(&s->w[0], "comment"))
		return parse_comment(c, s, eol);
	if (is(&s->w[0], "format"))
		return parse_format(c, s);
	if (is(&s->w[0], "element"))
		return parse_element(c, s);
	if (is(&s->w[0], "property"))
		return parse_property(c, s);
	*end = is(&s->w[0], "end_header");
	return WH_OK;
}

/* --- the text --- */

static wh_code read_more(wh_ctx *c, parser *s)
{
	if (s->n >= LONGEST)
		return bad(c, s, "no 'end_header' in the first %d bytes", LONGEST);
	const size_t want = s->n < FIRST_READ ? FIRST_READ : 2 * s->n;
	if (wh_reserve(c, &s->text, &s->cap, want, 1) != WH_OK)
		return c->err.code;
	const uint64_t left = s->p->size - s->n;
	const size_t more = left < want - s->n ? (size_t)left : want - s->n;
	if (wh_ply_pread(c, s->p->path, s->p->fd, s->text + s->n, more, s->n) != WH_OK)
		return c->err.code;
	s->n += more;
	s->whole = s->n == s->p->size;
	return WH_OK;
}

/* Reads on until the next line is there as a whole or the file ends; *end is behind the line's
 * last byte, at its terminator. */
static wh_code next_line(wh_ctx *c, parser *s, size_t *end)
{
	for (;;) {
		/* NOLINTNEXTLINE(clang-analyzer-core.NonNullParamChecker): check_magic read text */
		const char *eol = memchr(s->text + s->at, s->p->eol, s->n - s->at);
		*end = eol ? (size_t)(eol - s->text) : s->n;
		if (eol || s->whole)
			return WH_OK;
		if (read_more(c, s) != WH_OK)
			return c->err.code;
	}
}

/* A CR that is not followed by LF, before any LF: lines end with CR. */
static char find_eol(const parser *s)
{
	const char *lf = memchr(s->text, '\n', s->n);
	const char *cr = memchr(s->text, '\r', s->n);
	return cr && (!lf || cr + 1 < lf) ? '\r' : '\n';
}

static wh_code check_magic(wh_ctx *c, parser *s)
{
	if (s->p->size == 0)
		return wh_fail(c, WH_E_INPUT, "'%s' is empty", s->p->path);
	if (read_more(c, s) != WH_OK)
		return c->err.code;
	s->p->eol = find_eol(s);
	if (s->n < 4 || memcmp(s->text, "ply", 3) != 0 || !is_blank(s->text[3]))
		return wh_fail(c, WH_E_INPUT,
		               "'%s' is not a PLY file: it does not begin with 'ply'", s->p->path);
	return WH_OK;
}

static wh_code parse_text(wh_ctx *c, parser *s)
{
	bool done = false;
	if (check_magic(c, s) != WH_OK)
		return c->err.code;
	while (!done) {
		size_t end;
		s->line++;
		if (s->whole && s->at >= s->n)
			return bad(c, s, "the file ends before 'end_header'");
		if (next_line(c, s, &end) != WH_OK)
			return c->err.code;
		split(s, s->text + s->at, s->text + end);
		if (parse_line(c, s, s->text + end, &done) != WH_OK)
			return c->err.code;
		s->at = end < s->n ? end + 1 : end;
	}
	if (!s->has_format)
		return bad(c, s, "there is no 'format' line");
	s->p->body = s->at;
	s->p->header_lines = s->line;
	return WH_OK;
}

/* --- meaning --- */

static void measure(wh_ply_elem *e)
{
	bool fixed = true;
	for (size_t i = 0; i < e->nprops; i++) {
		const wh_ply_prop *q = &e->props[i];
		e->least += wh_type_size(q->is_list ? q->count_type : q->type);
		fixed = fixed && !q->is_list;
	}
	e->stride = fixed ? e->least : 0;
}

static int find_scalar(const wh_ply_elem *e, const char *name)
{
	for (size_t i = 0; i < e->nprops; i++)
		if (!e->props[i].is_list && strcmp(e->props[i].name, name) == 0)
			return (int)i;
	return -1;
}

static bool is_index_list(const wh_ply_prop *q)
{
	return q->is_list && wh_type_is_integer(q->type);
}

/* The list of corners, by its name; else the only list of integers there is. */
static int find_indices(const wh_ply_elem *e)
{
	static const char *const names[] = {"vertex_indices", "vertex_index", "vertex_indexes"};
	int only = -1;
	int lists = 0;
	for (size_t k = 0; k < sizeof names / sizeof names[0]; k++)
		for (size_t i = 0; i < e->nprops; i++)
			if (is_index_list(&e->props[i]) && strcmp(e->props[i].name, names[k]) == 0)
				return (int)i;
	for (size_t i = 0; i < e->nprops; i++) {
		if (is_index_list(&e->props[i])) {
			only = (int)i;
			lists++;
		}
	}
	return lists == 1 ? only : -1;
}

void wh_ply_find_meaning(wh_ply *p)
{
	for (size_t i = 0; i < p->nelems; i++) {
		wh_ply_elem *e = &p->elems[i];
		measure(e);
		if (p->vertex < 0 && strcmp(e->name, "vertex") == 0) {
			p->x = find_scalar(e, "x");
			p->y = find_scalar(e, "y");
			p->z = find_scalar(e, "z");
			if (p->x >= 0 && p->y >= 0 && p->z >= 0)
				p->vertex = (int)i;
		} else if (p->face < 0 && strcmp(e->name, "face") == 0) {
			p->corners = find_indices(e);
			p->face = p->corners >= 0 ? (int)i : -1;
		} else if (p->strips < 0 && strcmp(e->name, "tristrips") == 0) {
			p->strip_list = find_indices(e);
			p->strips = p->strip_list >= 0 ? (int)i : -1;
		}
	}
}

/* Text: a byte and a blank for each value. The last value needs no blank, so one byte is given. */
static wh_code check_counts(wh_ctx *c, const wh_ply *p)
{
	uint64_t left = p->size - p->body + (p->format == WH_PLY_ASCII);
	for (size_t i = 0; i < p->nelems; i++) {
		const wh_ply_elem *e = &p->elems[i];
		const uint64_t least =
		    p->format == WH_PLY_ASCII ? 2 * (uint64_t)e->nprops : e->least;
		const uint64_t room = least ? left / least : UINT64_MAX;
		if (e->count > room)
			return wh_fail(c, WH_E_INPUT,
			               "'%s', header line %zu: the header says %" PRIu64
			               " items of element '%s', of at least %" PRIu64
			               " bytes each, but the file has bytes left for %" PRIu64
			               " only: it is cut short there, or the header is wrong",
			               p->path, e->line, e->count, e->name, least, room);
		left -= e->count * least;
	}
	return WH_OK;
}

/* --- open and close --- */

static bool is_standard_input(const char *path)
{
	return strcmp(path, "-") == 0;
}

/* What has a beginning that can be gone back to is no stream; standard input may have been read
 * from by somebody before. */
static bool comes_once(int fd, mode_t mode)
{
	return S_ISFIFO(mode) || S_ISSOCK(mode) || (S_ISREG(mode) && lseek(fd, 0, SEEK_CUR) > 0);
}

bool wh_ply_is_read_once(const char *path)
{
	struct stat st;
	return is_standard_input(path) ||
	       (stat(path, &st) == 0 && (S_ISFIFO(st.st_mode) || S_ISSOCK(st.st_mode)));
}

static wh_code open_file(wh_ctx *c, wh_ply *p, const char *path)
{
	struct stat st;
	p->fd = is_standard_input(path)
	            ? fcntl(STDIN_FILENO, F_DUPFD_CLOEXEC, 0)
	            : open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK); /* a pipe must not block */
	if (p->fd < 0)
		return wh_fail(c, WH_E_INPUT, "cannot open '%s': %s", p->path, strerror(errno));
	if (fstat(p->fd, &st) != 0)
		return wh_fail_errno(c, "cannot examine '%s'", p->path);
	if (S_ISDIR(st.st_mode))
		return wh_fail(c, WH_E_INPUT, "'%s' is a directory", p->path);
	p->is_stream = comes_once(p->fd, st.st_mode);
	if (!S_ISREG(st.st_mode) && !p->is_stream)
		return wh_fail(c, WH_E_INPUT,
		               "'%s' is a device; give a file, or a pipe (- is standard input)",
		               p->path);
	p->size = p->is_stream ? 0 : (uint64_t)st.st_size;
	p->changed = st.st_mtim;
	return WH_OK;
}

wh_code wh_ply_unchanged(wh_ctx *c, const wh_ply *p)
{
	struct stat st;
	if (fstat(p->fd, &st) != 0)
		return wh_fail_errno(c, "cannot examine '%s'", p->path);
	if ((uint64_t)st.st_size == p->size && st.st_mtim.tv_sec == p->changed.tv_sec &&
	    st.st_mtim.tv_nsec == p->changed.tv_nsec)
		return WH_OK;
	return wh_fail(c, WH_E_RUN,
	               "'%s' was changed while it was read; run again when nobody writes to it",
	               p->path);
}

wh_code wh_ply_attach(wh_ctx *c, wh_ply *p, const char *path)
{
	*p = (wh_ply){.fd = -1, .vertex = -1, .face = -1, .strips = -1};
	p->x = p->y = p->z = p->corners = p->strip_list = -1;
	p->kind = WH_FORMAT_PLY;
	p->path = wh_strdup(c, is_standard_input(path) ? "standard input" : path);
	const wh_code code = p->path ? open_file(c, p, path) : wh_failed(c);
	if (code != WH_OK)
		wh_ply_close(c, p);
	return code;
}

wh_code wh_ply_read_header(wh_ctx *c, wh_ply *p)
{
	parser s = {.p = p};
	wh_code code = parse_text(c, &s);
	if (code == WH_OK) {
		wh_ply_find_meaning(p);
		code = check_counts(c, p);
	}
	wh_free(c, s.text);
	if (code != WH_OK)
		wh_ply_close(c, p);
	return code;
}

wh_code wh_ply_open(wh_ctx *c, wh_ply *p, const char *path)
{
	if (wh_ply_attach(c, p, path) != WH_OK)
		return wh_failed(c);
	if (!p->is_stream)
		return wh_ply_read_header(c, p);
	(void)wh_fail(c, WH_E_INPUT,
	              "'%s' is not a regular file, and has to be read more than once; save it to "
	              "a file first",
	              p->path);
	wh_ply_close(c, p);
	return c->err.code;
}

/* --- other formats --- */

wh_code wh_ply_add_element(wh_ctx *c, wh_ply *p, const char *name, uint64_t count)
{
	size_t cap = p->nelems;
	char *copy = wh_strdup(c, name);
	if (!copy || wh_reserve(c, &p->elems, &cap, p->nelems + 1, sizeof *p->elems) != WH_OK) {
		wh_free(c, copy);
		return wh_failed(c);
	}
	p->elems[p->nelems++] = (wh_ply_elem){.name = copy, .count = count};
	return WH_OK;
}

wh_code wh_ply_add_property(wh_ctx *c, wh_ply *p, const char *name, wh_type type, bool is_list)
{
	wh_ply_elem *e = &p->elems[p->nelems - 1];
	size_t cap = e->nprops;
	char *copy = wh_strdup(c, name);
	if (!copy || wh_reserve(c, &e->props, &cap, e->nprops + 1, sizeof *e->props) != WH_OK) {
		wh_free(c, copy);
		return wh_failed(c);
	}
	e->props[e->nprops++] =
	    (wh_ply_prop){.name = copy, .type = type, .is_list = is_list, .count_type = type};
	return WH_OK;
}

void wh_ply_close(wh_ctx *c, wh_ply *p)
{
	for (size_t i = 0; i < p->nelems; i++) {
		for (size_t k = 0; k < p->elems[i].nprops; k++)
			wh_free(c, p->elems[i].props[k].name);
		wh_free(c, p->elems[i].props);
		wh_free(c, p->elems[i].name);
	}
	wh_free(c, p->elems);
	wh_names_free(c, &p->textures);
	wh_names_free(c, &p->libraries);
	wh_names_free(c, &p->materials);
	wh_names_free(c, &p->groups);
	if (p->path && p->fd >= 0)
		(void)close(p->fd);
	wh_free(c, p->path);
	*p = (wh_ply){.fd = -1, .vertex = -1, .face = -1, .strips = -1};
}
