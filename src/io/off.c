#include "io/off.h"

#include "io/number.h"

#include <inttypes.h>
#include <string.h>

enum {
	HEAD = 64 * 1024, /* bytes within which the header ends */
	LEAST_VERTEX = 6, /* bytes of the shortest line of a vertex, ... */
	LEAST_FACE = 2,   /* ... and of a face */
	BINARY_VERTEX = 12,
	BINARY_FACE = 8 /* no corners, no colours */
};

typedef struct header {
	const wh_ply *p;
	char text[HEAD + 2]; /* a blank and a NUL behind it */
	size_t n;
	size_t at;
	bool normals, colours, texture, binary;
} header;

/* The next word, comments passed over; NULL when there is none. */
static const char *next_word(header *h)
{
	for (;;) {
		while (h->at < h->n && wh_is_blank(h->text[h->at]))
			h->at++;
		if (h->at == h->n)
			return NULL;
		if (h->text[h->at] != '#')
			break;
		while (h->at < h->n && h->text[h->at] != h->p->eol)
			h->at++;
	}
	const char *word = h->text + h->at;
	h->at = (size_t)(wh_word_end(word) - h->text);
	return word;
}

/* Behind the end of the line. */
static void skip_line(header *h)
{
	while (h->at < h->n && h->text[h->at] != h->p->eol)
		h->at++;
	h->at += h->at < h->n;
}

/* "STCNOFF" and its like, which may be missing where the counts come first. */
static wh_code parse_keyword(wh_ctx *c, header *h, const char *word)
{
	const char *end = word ? strstr(word, "OFF") : NULL;
	if (!end || end >= wh_word_end(word)) {
		h->at = 0;
		return WH_OK;
	}
	for (; word < end; word++) {
		if (*word == '4' || *word == 'n')
			return wh_fail(c, WH_E_INPUT,
			               "'%s' is an OFF file of another dimension than three",
			               h->p->path);
		h->normals |= *word == 'N';
		h->colours |= *word == 'C';
		h->texture |= *word == 'T';
	}
	const size_t at = h->at;
	word = next_word(h);
	h->binary = word && wh_word_end(word) - word == 6 && memcmp(word, "BINARY", 6) == 0;
	if (!h->binary)
		h->at = at;
	return WH_OK;
}

static wh_code bad_counts(wh_ctx *c, const wh_ply *p)
{
	return wh_fail(c, WH_E_INPUT,
	               "'%s' has no OFF header: the numbers of vertices and faces are expected at "
	               "its beginning",
	               p->path);
}

static wh_code check_count(wh_ctx *c, const header *h, const char *what, uint64_t n, uint64_t least)
{
	const uint64_t room = (h->p->size + 1 - h->p->body) / least;
	if (n <= room)
		return WH_OK;
	return wh_fail(c, WH_E_INPUT,
	               "'%s': the header says %" PRIu64
	               " %s, but the file has bytes left for %" PRIu64
	               " at most: it is cut short, or the header is wrong",
	               h->p->path, n, what, room);
}

/* Words on the line of the first vertex. */
static int first_line(header *h)
{
	const size_t body = h->at;
	int n = 0;
	for (const char *s = next_word(h); s; n++) {
		const char *end = h->text + h->at;
		s = next_word(h);
		if (s && memchr(end, h->p->eol, (size_t)(s - end)))
			s = NULL;
	}
	h->at = body;
	return n;
}

/* Numbers of each kind behind a position; `words` are on its line. */
static void count_parts(const header *h, int words, int *normals, int *colours, int *texture)
{
	int left = words - 3;
	*normals = h->normals && left >= 3 ? 3 : 0;
	left -= *normals;
	*texture = h->texture && left >= 2 ? 2 : 0;
	left -= *texture;
	*colours = h->colours && left >= 3 ? (left > 3 ? 4 : 3) : 0;
}

static wh_code add_properties(wh_ctx *c, wh_ply *p, const char *const *names, int n)
{
	for (int i = 0; i < n; i++)
		if (wh_ply_add_property(c, p, names[i], WH_F32, false) != WH_OK)
			return c->err.code;
	return WH_OK;
}

static wh_code add_vertex_properties(wh_ctx *c, wh_ply *p, header *h)
{
	static const char *const position[] = {"x", "y", "z"}, *const normal[] = {"nx", "ny", "nz"},
	                         *const colour[] = {"red", "green", "blue", "alpha"},
	                         *const texture[] = {"s", "t"};
	enum { ALL = 12 };
	int n, k, t;
	count_parts(h, h->binary ? ALL : first_line(h), &n, &k, &t);
	if (add_properties(c, p, position, 3) != WH_OK ||
	    add_properties(c, p, normal, n) != WH_OK || add_properties(c, p, colour, k) != WH_OK ||
	    add_properties(c, p, texture, t) != WH_OK)
		return c->err.code;
	return WH_OK;
}

static wh_code describe(wh_ctx *c, wh_ply *p, header *h, uint64_t nv, uint64_t nf)
{
	if (wh_ply_add_element(c, p, "vertex", nv) != WH_OK ||
	    add_vertex_properties(c, p, h) != WH_OK ||
	    wh_ply_add_element(c, p, "face", nf) != WH_OK ||
	    wh_ply_add_property(c, p, "vertex_indices", WH_I32, true) != WH_OK)
		return c->err.code;
	if (h->binary)
		(void)wh_ply_add_property(c, p, "colour", WH_F32, true);
	if (h->binary) /* a count of colours is an integer, as it is of corners */
		p->elems[1].props[p->elems[1].nprops - 1].count_type = WH_I32;
	wh_ply_find_meaning(p);
	return c->err.code;
}

static wh_code binary_counts(wh_ctx *c, header *h, uint64_t *nv, uint64_t *nf)
{
	skip_line(h);
	if (h->n - h->at < 12)
		return bad_counts(c, h->p);
	const unsigned char *b = (const unsigned char *)h->text + h->at;
	*nv = (uint64_t)b[0] << 24 | (uint64_t)b[1] << 16 | (uint64_t)b[2] << 8 | b[3];
	*nf = (uint64_t)b[4] << 24 | (uint64_t)b[5] << 16 | (uint64_t)b[6] << 8 | b[7];
	h->at += 12; /* the number of edges means nothing */
	return WH_OK;
}

static wh_code text_counts(wh_ctx *c, header *h, uint64_t *nv, uint64_t *nf)
{
	const char *word = next_word(h);
	if (!word || *word == '-' || !wh_scan_whole(word, nv))
		return bad_counts(c, h->p);
	word = next_word(h);
	if (!word || *word == '-' || !wh_scan_whole(word, nf))
		return bad_counts(c, h->p);
	skip_line(h);
	return WH_OK;
}

static wh_code parse(wh_ctx *c, wh_ply *p, header *h)
{
	uint64_t nv = 0, nf = 0;
	if (parse_keyword(c, h, next_word(h)) != WH_OK ||
	    (h->binary ? binary_counts(c, h, &nv, &nf) : text_counts(c, h, &nv, &nf)) != WH_OK)
		return c->err.code;
	p->body = h->at;
	p->format = h->binary ? WH_PLY_BE : WH_PLY_ASCII;
	p->comment = h->binary ? '\0' : '#';
	p->open_ended = p->undeclared = !h->binary;
	p->header_lines = 0;
	for (size_t i = 0; !h->binary && i < h->at; i++)
		p->header_lines += h->text[i] == p->eol;
	if (check_count(c, h, "vertices", nv, h->binary ? BINARY_VERTEX : LEAST_VERTEX) != WH_OK ||
	    check_count(c, h, "faces", nf, h->binary ? BINARY_FACE : LEAST_FACE) != WH_OK)
		return c->err.code;
	return describe(c, p, h, nv, nf);
}

wh_code wh_off_read_header(wh_ctx *c, wh_ply *p)
{
	header *h = wh_calloc(c, 1, sizeof *h);
	if (!h)
		return c->err.code;
	h->p = p;
	h->n = p->size < HEAD ? (size_t)p->size : HEAD;
	wh_code code = wh_ply_pread(c, p->path, p->fd, h->text, h->n, 0);
	h->text[h->n] = ' ';
	if (code == WH_OK)
		code = parse(c, p, h);
	wh_free(c, h);
	return code;
}
