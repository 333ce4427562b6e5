/*
 * Binary STL is facets of fixed size: they are welded where they lie. Of a text, the words
 * "vertex" and "endloop" are all that is read; its corners are first written to a temporary file,
 * in parallel by chunks of lines after a pass that counts them.
 *
 * Cost: text is read twice and parsed once; temporary disk 36 bytes a facet (72 of doubles).
 */
#include "pipeline/read_stl.h"

#include "pipeline/weld.h"

#include "base/bytes.h"

#include <inttypes.h>
#include <string.h>
#include <strings.h>

enum { HEAD = 4096 }; /* bytes that tell text from binary */

typedef struct reader {
	wh_lines_part part;
	double *xyz;
	size_t cap;
} reader;

typedef struct job {
	const wh_stl *stl;
	const wh_lines *lines;
	uint64_t *first;
	wh_rewrite *rw;
	int fd; /* the corners */
	reader *readers;
} job;

/* --- what it is --- */

static bool begins_with(const char *s, const char *end, const char *word)
{
	while (s < end && wh_is_blank(*s))
		s++;
	const size_t n = strlen(word);
	return (size_t)(end - s) >= n && strncasecmp(s, word, n) == 0;
}

/* A file whose size follows from its count is binary whatever its header says; else "solid" and
 * no byte 0 is a text. */
static wh_code look_at_head(wh_ctx *c, const wh_ply *p, wh_stl *s)
{
	char head[HEAD];
	const size_t n = p->size < HEAD ? (size_t)p->size : HEAD;
	if (wh_ply_pread(c, p->path, p->fd, head, n, 0) != WH_OK)
		return c->err.code;
	if (!wh_format_is_binary_stl(head, n, p->size) && begins_with(head, head + n, "solid") &&
	    !memchr(head, '\0', n))
		return WH_OK;
	s->binary = true;
	if (n < WH_STL_BODY)
		return wh_fail(c, WH_E_INPUT,
		               "'%s' is no STL file: it does not begin with 'solid', and is too "
		               "short for a binary one",
		               p->path);
	s->facets = wh_load32(head + WH_STL_HEADER, WH_HOST_BIG);
	const uint64_t room = (p->size - WH_STL_BODY) / WH_STL_FACET;
	if (s->facets > room)
		return wh_fail(c, WH_E_INPUT,
		               "'%s': its header says %" PRIu64 " facets of 50 bytes, but the file "
		               "has bytes left for %" PRIu64
		               " only: it is cut short, or no STL file",
		               p->path, s->facets, room);
	return WH_OK;
}

static wh_code describe(wh_ctx *c, const wh_stl *s, wh_ply *p)
{
	p->format = s->binary ? WH_PLY_LE : WH_PLY_ASCII;
	p->body = s->binary ? WH_STL_BODY : 0;
	p->undeclared = !s->binary;
	if (wh_ply_add_element(c, p, "vertex", 3 * s->facets) != WH_OK)
		return c->err.code;
	for (int k = 0; k < 3; k++)
		(void)wh_ply_add_property(c, p, (const char *[]){"x", "y", "z"}[k], WH_F32, false);
	if (wh_ply_add_element(c, p, "face", s->facets) == WH_OK)
		(void)wh_ply_add_property(c, p, "vertex_indices", WH_U32, true);
	wh_ply_find_meaning(p);
	return c->err.code;
}

/* --- text --- */

typedef enum word { NOTHING, CORNER, LOOP_END, NAME } word;

static word word_at(const char *s)
{
	const size_t n = (size_t)(wh_word_end(s) - s);
	if (n == 6 && strncasecmp(s, "vertex", 6) == 0)
		return CORNER;
	if (n == 7 && strncasecmp(s, "endloop", 7) == 0)
		return LOOP_END;
	if ((n == 5 && strncasecmp(s, "solid", 5) == 0) ||
	    (n == 8 && strncasecmp(s, "endsolid", 8) == 0))
		return NAME;
	return NOTHING;
}

static wh_code bad_facet(wh_ctx *c, const job *j, const reader *r, const char *s)
{
	return wh_fail(c, WH_E_INPUT,
	               "'%s', line %" PRIu64 ": a facet ends that has not three vertices; STL "
	               "has nothing but triangles",
	               j->lines->file->path, wh_lines_number(c, j->lines, &r->part, s));
}

static wh_code count_job(wh_ctx *c, void *arg, int64_t index, int worker)
{
	const job *j = arg;
	reader *r = &j->readers[worker];
	uint64_t n = 0;
	if (wh_lines_load(c, j->lines, index, &r->part) != WH_OK)
		return c->err.code;
	for (const char *s; (s = wh_lines_next(j->lines, &r->part)) != NULL;)
		for (word w; *s != j->lines->eol && (w = word_at(s)) != NAME;
		     s = wh_lines_word(j->lines, wh_word_end(s)))
			n += w == CORNER;
	j->first[index] = n;
	return WH_OK;
}

/* The coordinates behind the word at s; returns the place behind them, NULL on failure. */
static const char *scan_corner(wh_ctx *c, const job *j, const reader *r, const char *s, double *xyz,
                               bool *wide)
{
	s = wh_word_end(s);
	for (int k = 0; k < 3; k++) {
		const char *at = wh_lines_word(j->lines, s);
		s = *at == j->lines->eol ? NULL : wh_scan_decimal(at, &xyz[k], wide);
		if (!s) {
			(void)wh_fail(
			    c, WH_E_INPUT, "'%s', line %" PRIu64 ": a vertex without three numbers",
			    j->lines->file->path,
			    wh_lines_number(c, j->lines, &r->part, at - (*at == j->lines->eol)));
			return NULL;
		}
	}
	return s;
}

/* Parses the line at s; n counts the chunk's corners. */
static wh_code corner_line(wh_ctx *c, const job *j, reader *r, const char *s, uint64_t first,
                           size_t *n, bool *wide)
{
	for (word w; *s != j->lines->eol && (w = word_at(s)) != NAME;
	     s = wh_lines_word(j->lines, s)) {
		if (w == LOOP_END && (first + *n) % 3 != 0)
			return bad_facet(c, j, r, s);
		if (w != CORNER) {
			s = wh_word_end(s);
			continue;
		}
		if (wh_reserve(c, &r->xyz, &r->cap, 3 * *n + 3, sizeof *r->xyz) != WH_OK)
			return c->err.code;
		s = scan_corner(c, j, r, s, r->xyz + 3 * *n, wide);
		if (!s)
			return c->err.code;
		++*n;
	}
	return WH_OK;
}

static wh_code put_corners(wh_ctx *c, const job *j, uint64_t first, double *xyz, size_t n)
{
	const wh_rewrite *w = j->rw;
	const size_t each = w->source.vstride;
	unsigned char *to = (unsigned char *)xyz; /* narrowed in place: never overtakes */
	for (size_t i = 0; !w->source.is_double && i < 3 * n; i++) {
		const float v = (float)xyz[i];
		memcpy(to + 4 * i, &v, sizeof v);
	}
	return wh_spill_pwrite(c, w->spill, j->fd, to, n * each, first * each);
}

static wh_code corners_job(wh_ctx *c, void *arg, int64_t index, int worker)
{
	const job *j = arg;
	reader *r = &j->readers[worker];
	const uint64_t first = j->first[index];
	size_t n = 0;
	bool wide = false;
	if (wh_lines_load(c, j->lines, index, &r->part) != WH_OK)
		return c->err.code;
	for (const char *s; (s = wh_lines_next(j->lines, &r->part)) != NULL;)
		if (corner_line(c, j, r, s, first, &n, &wide) != WH_OK)
			return c->err.code;
	if (wh_rewrite_heed(j->rw, (wh_told){.wide = wide}))
		return WH_E_IRREGULAR;
	return put_corners(c, j, first, r->xyz, n);
}

static void free_readers(wh_ctx *c, job *j, int workers)
{
	for (int i = 0; j->readers && i < workers; i++) {
		wh_lines_free(c, &j->readers[i].part);
		wh_free(c, j->readers[i].xyz);
	}
	wh_free(c, j->readers);
	j->readers = NULL;
}

static wh_code count_corners(wh_ctx *c, const wh_exec *ex, const wh_ply *p, wh_stl *s)
{
	s->lines = wh_lines_of(p, p->eol, false);
	s->first = wh_calloc(c, (size_t)s->lines.chunks + 1, sizeof *s->first);
	job j = {.stl = s,
	         .lines = &s->lines,
	         .first = s->first,
	         .readers = wh_calloc(c, (size_t)ex->workers, sizeof *j.readers)};
	wh_code code = s->first && j.readers ? WH_OK : wh_failed(c);
	if (code == WH_OK)
		code = wh_exec_for(c, ex, s->lines.chunks, count_job, &j);
	free_readers(c, &j, ex->workers);
	uint64_t total = 0;
	for (int64_t i = 0; code == WH_OK && i < s->lines.chunks; i++) {
		const uint64_t n = s->first[i];
		s->first[i] = total;
		total += n;
	}
	if (code == WH_OK)
		s->first[s->lines.chunks] = total;
	s->facets = total / 3;
	return code;
}

/* --- both --- */

wh_code wh_stl_look(wh_ctx *c, const wh_exec *ex, wh_ply *p, wh_stl *s)
{
	*s = (wh_stl){0};
	wh_code code = look_at_head(c, p, s);
	if (code == WH_OK && !s->binary)
		code = count_corners(c, ex, p, s);
	if (code == WH_OK)
		code = describe(c, s, p);
	if (code != WH_OK)
		wh_stl_free(c, s);
	return code;
}

void wh_stl_free(wh_ctx *c, wh_stl *s)
{
	wh_free(c, s->first);
	*s = (wh_stl){0};
}

static wh_code ends_in_facet(wh_ctx *c, const wh_stl *s, const char *path)
{
	return wh_fail(c, WH_E_INPUT,
	               "'%s' has %" PRIu64 " vertices, which are not three a facet: it is cut "
	               "short or damaged",
	               path, s->first[s->lines.chunks]);
}

static wh_code rewrite_text(wh_ctx *c, wh_rewrite *w, const wh_stl *s)
{
	job j = {.stl = s,
	         .lines = &s->lines,
	         .first = s->first,
	         .rw = w,
	         .fd = wh_spill_scratch(c, w->spill),
	         .readers = wh_calloc(c, (size_t)w->ex->workers, sizeof *j.readers)};
	wh_code code = j.fd >= 0 && j.readers ? WH_OK : wh_failed(c);
	if (code == WH_OK)
		code = wh_exec_for(c, w->ex, s->lines.chunks, corners_job, &j);
	if (code == WH_OK && s->first[s->lines.chunks] % 3 != 0)
		code = ends_in_facet(c, s, w->ply->path);
	free_readers(c, &j, w->ex->workers);
	const wh_soup soup = {.path = w->ply->path,
	                      .fd = j.fd,
	                      .stride = 3 * w->source.vstride,
	                      .type = w->source.is_double ? WH_F64 : WH_F32,
	                      .facets = s->facets};
	if (code == WH_OK)
		code = wh_weld(c, w, &soup);
	if (j.fd >= 0)
		wh_spill_close_scratch(w->spill, j.fd);
	return code;
}

wh_code wh_stl_rewrite(wh_ctx *c, wh_rewrite *w, const wh_stl *s)
{
	if (!s->binary)
		return rewrite_text(c, w, s);
	const wh_soup soup = {.path = w->ply->path,
	                      .fd = w->ply->fd,
	                      .base = WH_STL_BODY + 12,
	                      .stride = WH_STL_FACET,
	                      .type = WH_F32,
	                      .swap = WH_HOST_BIG,
	                      .facets = s->facets};
	return wh_weld(c, w, &soup);
}
