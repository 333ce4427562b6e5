/*
 * Three passes over chunks of lines, all in parallel: one counts the lines of each kind, so that
 * every chunk knows the number of its first vertex (relative indices count back from the vertex
 * before them); one parses vertices, whose places in the output are then known; one parses faces,
 * whose triangles are appended in order.
 *
 * Cost: the text is read three times, parsed once. Memory: a chunk per worker and what comes out
 * of it, 8 bytes for each MiB of the file.
 */
#include "pipeline/read_obj.h"

#include <inttypes.h>
#include <stdio.h>
#include <string.h>

/* What lines are, by their first word. */
typedef enum tag { VERTEX, FACE, TEXTURE, NORMAL, GROUP, MATERIAL, LINE, POINT, OTHER, TAGS } tag;

static const struct {
	const char *word;
	tag tag;
} words[] = {
    {"v", VERTEX}, {"f", FACE},  {"vt", TEXTURE},      {"vn", NORMAL},
    {"g", GROUP},  {"o", GROUP}, {"usemtl", MATERIAL}, {"mtllib", MATERIAL},
    {"l", LINE},   {"p", POINT}, {"fo", FACE}, /* an old word for it */
    {"s", GROUP},
};

/* Names for what is not carried over. */
static const char *const tag_names[TAGS] = {
    [TEXTURE] = "texture coordinates", [NORMAL] = "normals", [GROUP] = "groups",
    [MATERIAL] = "materials",          [LINE] = "lines",     [POINT] = "points",
    [OTHER] = "other statements"};

enum { COLOURED = 6 }; /* numbers of a vertex with a colour */

/* A worker's buffers. */
typedef struct reader {
	wh_lines_part part;
	uint64_t count[TAGS];
	wh_told told;
	double *xyz;
	size_t xyz_cap;
	uint8_t *records; /* attributes */
	size_t records_cap;
	uint64_t *ids;
	size_t ids_cap;
} reader;

typedef struct job {
	const wh_obj *obj;
	const wh_lines *lines;
	uint64_t *first;
	uint8_t *coloured; /* per chunk: its first vertex has a colour */
	wh_rewrite *rw;
	const wh_attribute *colour[3]; /* those that are carried */
	reader *readers;
} job;

static tag tag_of(const char *s)
{
	for (size_t i = 0; i < sizeof words / sizeof words[0]; i++)
		if (*s == *words[i].word && wh_lines_is(s, words[i].word))
			return words[i].tag;
	return OTHER;
}

static wh_code make_readers(wh_ctx *c, job *j, int workers)
{
	j->readers = wh_calloc(c, (size_t)workers, sizeof *j->readers);
	return j->readers ? WH_OK : wh_failed(c);
}

static void free_readers(wh_ctx *c, job *j, int workers)
{
	for (int i = 0; j->readers && i < workers; i++) {
		wh_lines_free(c, &j->readers[i].part);
		wh_free(c, j->readers[i].xyz);
		wh_free(c, j->readers[i].records);
		wh_free(c, j->readers[i].ids);
	}
	wh_free(c, j->readers);
}

/* --- counting --- */

/* Words behind the first, no more than `most` of them. */
static int count_words(const wh_lines *l, const char *s, int most)
{
	int n = 0;
	for (s = wh_lines_word(l, wh_word_end(s)); *s != l->eol && *s != '#' && n < most; n++)
		s = wh_lines_word(l, wh_word_end(s));
	return n;
}

static wh_code count_job(wh_ctx *c, void *arg, int64_t index, int worker)
{
	const job *j = arg;
	reader *r = &j->readers[worker];
	uint64_t vertices = 0;
	if (wh_lines_load(c, j->lines, index, &r->part) != WH_OK)
		return c->err.code;
	for (const char *s; (s = wh_lines_next(j->lines, &r->part)) != NULL;) {
		if (*s == '#')
			continue;
		const tag t = tag_of(s);
		if (t == VERTEX && vertices++ == 0)
			j->coloured[index] = count_words(j->lines, s, COLOURED) >= COLOURED;
		r->count[t] += t != VERTEX;
	}
	j->first[index] = vertices;
	return WH_OK;
}

/* Counts of the chunks become numbers of their first vertices. */
static uint64_t number_vertices(job *j)
{
	uint64_t total = 0;
	for (int64_t i = 0; i < j->lines->chunks; i++) {
		const uint64_t n = j->first[i];
		j->first[i] = total;
		total += n;
	}
	j->first[j->lines->chunks] = total;
	return total;
}

static wh_code describe(wh_ctx *c, const job *j, wh_ply *p, const uint64_t count[TAGS])
{
	bool coloured = false;
	for (int64_t i = 0; i < j->lines->chunks; i++)
		coloured = coloured || j->coloured[i];
	p->format = WH_PLY_ASCII;
	p->undeclared = true;
	if (wh_ply_add_element(c, p, "vertex", count[VERTEX]) != WH_OK)
		return c->err.code;
	for (int k = 0; k < 3; k++)
		(void)wh_ply_add_property(c, p, (const char *[]){"x", "y", "z"}[k], WH_F32, false);
	for (int k = 0; coloured && k < 3; k++)
		(void)wh_ply_add_property(c, p, (const char *[]){"red", "green", "blue"}[k], WH_F32,
		                          false);
	if (wh_ply_add_element(c, p, "face", count[FACE]) == WH_OK)
		(void)wh_ply_add_property(c, p, "vertex_indices", WH_I32, true);
	for (int t = 0; t < TAGS; t++)
		if (tag_names[t] && count[t])
			(void)wh_ply_add_element(c, p, tag_names[t], count[t]);
	wh_ply_find_meaning(p);
	return c->err.code;
}

static wh_code count_all(wh_ctx *c, const wh_exec *ex, wh_ply *p, job *j)
{
	uint64_t count[TAGS] = {0};
	j->coloured = wh_calloc(c, (size_t)j->lines->chunks, 1);
	if (!j->coloured || make_readers(c, j, ex->workers) != WH_OK ||
	    wh_exec_for(c, ex, j->lines->chunks, count_job, j) != WH_OK)
		return wh_failed(c);
	for (int i = 0; i < ex->workers; i++)
		for (int t = 0; t < TAGS; t++)
			count[t] += j->readers[i].count[t];
	count[VERTEX] = number_vertices(j);
	return describe(c, j, p, count);
}

wh_code wh_obj_look(wh_ctx *c, const wh_exec *ex, wh_ply *p, wh_obj *o)
{
	*o = (wh_obj){.lines = wh_lines_of(p, p->eol, true)};
	o->first = wh_calloc(c, (size_t)o->lines.chunks + 1, sizeof *o->first);
	job j = {.obj = o, .lines = &o->lines, .first = o->first};
	const wh_code code = o->first ? count_all(c, ex, p, &j) : wh_failed(c);
	free_readers(c, &j, ex->workers);
	wh_free(c, j.coloured);
	if (code != WH_OK)
		wh_obj_free(c, o);
	return code;
}

void wh_obj_free(wh_ctx *c, wh_obj *o)
{
	wh_free(c, o->first);
	*o = (wh_obj){0};
}

/* --- vertices --- */

__attribute__((format(printf, 5, 6))) static wh_code bad(wh_ctx *c, const job *j, const reader *r,
                                                         const char *s, const char *fmt, ...)
{
	char what[256];
	va_list ap;
	va_start(ap, fmt);
	(void)vsnprintf(what, sizeof what, fmt, ap);
	va_end(ap);
	const uint64_t line = wh_lines_number(c, j->lines, &r->part, s);
	return wh_fail(c, WH_E_INPUT, "'%s', line %" PRIu64 ": %s", j->lines->file->path, line,
	               what);
}

static wh_code bad_number(wh_ctx *c, const job *j, const reader *r, const char *s)
{
	const size_t n = (size_t)(wh_word_end(s) - s);
	return *s == j->lines->eol
	           ? bad(c, j, r, s - 1, "a vertex of fewer than three coordinates")
	           : bad(c, j, r, s, "'%.*s' is not a number", n > 40 ? 40 : (int)n, s);
}

/* The colour behind a position; a vertex without one, or with a weight in its place, is white. */
static wh_code take_colour(wh_ctx *c, const job *j, reader *r, const char *s, uint8_t *record)
{
	if (count_words(j->lines, s - 1, COLOURED - 3) < COLOURED - 3) {
		for (int k = 0; k < 3; k++)
			if (j->colour[k])
				wh_rewrite_untold(j->colour[k], record);
		return WH_OK;
	}
	for (int k = 0; k < 3; k++) {
		const char *word = wh_lines_word(j->lines, s);
		s = j->colour[k] ? wh_rewrite_scan(j->rw, j->colour[k], word, record, &r->told)
		                 : wh_word_end(word);
		if (!s)
			return bad_number(c, j, r, word);
	}
	return WH_OK;
}

static wh_code vertex_line(wh_ctx *c, const job *j, reader *r, const char *s, size_t at)
{
	const size_t size = wh_rewrite_record(j->rw);
	if (wh_reserve(c, &r->xyz, &r->xyz_cap, 3 * at + 3, sizeof *r->xyz) != WH_OK ||
	    wh_reserve(c, &r->records, &r->records_cap, (at + 1) * size, 1) != WH_OK)
		return c->err.code;
	s++;
	for (size_t k = 0; k < 3; k++) {
		const char *word = wh_lines_word(j->lines, s);
		s = *word == j->lines->eol
		        ? NULL
		        : wh_scan_decimal(word, &r->xyz[3 * at + k], &r->told.wide);
		if (!s)
			return bad_number(c, j, r, word);
	}
	return size ? take_colour(c, j, r, s, r->records + at * size) : WH_OK;
}

static wh_code vertices_job(wh_ctx *c, void *arg, int64_t index, int worker)
{
	const job *j = arg;
	reader *r = &j->readers[worker];
	size_t n = 0;
	if (j->first[index + 1] == j->first[index])
		return WH_OK;
	if (wh_lines_load(c, j->lines, index, &r->part) != WH_OK)
		return c->err.code;
	for (const char *s; (s = wh_lines_next(j->lines, &r->part)) != NULL;) {
		if (*s != 'v' || !wh_is_blank(s[1]))
			continue;
		if (vertex_line(c, j, r, s, n) != WH_OK)
			return c->err.code;
		n++;
	}
	if (wh_rewrite_heed(j->rw, r->told))
		return WH_E_IRREGULAR;
	if (wh_rewrite_put_vertices(c, j->rw, j->first[index], r->xyz, n) != WH_OK)
		return c->err.code;
	return wh_rewrite_put_attributes(c, j->rw, j->first[index], r->records, n);
}

/* --- faces --- */

/* A corner "7", "-1/2", "7//3" at s: its vertex, where `before` vertices are in front of it. False:
 * no such thing. Numbers too large for any file stay too large. */
static bool scan_corner(const char *s, uint64_t before, uint64_t *id)
{
	const bool minus = *s == '-';
	s += minus || *s == '+';
	uint64_t n = 0;
	const char *first = s;
	for (; *s >= '0' && *s <= '9'; s++)
		n = n < UINT64_MAX / 16 ? 10 * n + (uint64_t)(*s - '0') : n;
	if (s == first || (*s != '/' && !wh_is_blank(*s)))
		return false;
	*id = minus ? (n <= before ? before - n : UINT64_MAX) : n - 1; /* 0 wraps: out of range */
	return n > 0 || !minus;
}

static wh_code bad_corner(wh_ctx *c, const job *j, const reader *r, const char *s)
{
	const size_t n = (size_t)(wh_word_end(s) - s);
	return bad(c, j, r, s,
	           "the corner '%.*s' of a face is not one of the file's %" PRIu64
	           " vertices; remove such faces first",
	           n > 40 ? 40 : (int)n, s, j->rw->source.nv);
}

static wh_code face_line(wh_ctx *c, const job *j, reader *r, const char *s, uint64_t before,
                         wh_facer *f)
{
	const wh_lines *l = j->lines;
	size_t n = 0;
	for (s = wh_lines_word(l, wh_word_end(s)); *s != l->eol && *s != '#';
	     s = wh_lines_word(l, wh_word_end(s))) {
		if (n == r->ids_cap &&
		    wh_reserve(c, &r->ids, &r->ids_cap, n + 1, sizeof *r->ids) != WH_OK)
			return c->err.code;
		if (!scan_corner(s, before, &r->ids[n]) || r->ids[n] >= j->rw->source.nv)
			return bad_corner(c, j, r, s);
		n++;
	}
	return wh_facer_add(c, f, r->ids, n);
}

static wh_code faces_job(wh_ctx *c, void *arg, int64_t index, int worker)
{
	const job *j = arg;
	reader *r = &j->readers[worker];
	uint64_t before = j->first[index];
	if (wh_lines_load(c, j->lines, index, &r->part) != WH_OK)
		return c->err.code;
	for (const char *s; (s = wh_lines_next(j->lines, &r->part)) != NULL;) {
		if (*s == 'v')
			before += wh_is_blank(s[1]);
		else if (*s == 'f' && tag_of(s) == FACE &&
		         face_line(c, j, r, s, before, &j->rw->facers[worker]) != WH_OK)
			return c->err.code;
	}
	return WH_OK;
}

static wh_code take_job(wh_ctx *c, void *arg, int64_t index, int worker)
{
	const job *j = arg;
	(void)index;
	return wh_rewrite_take(c, j->rw, &j->rw->facers[worker]);
}

wh_code wh_obj_rewrite(wh_ctx *c, wh_rewrite *rw, const wh_obj *o)
{
	const int64_t n = o->lines.chunks;
	job j = {.obj = o, .lines = &o->lines, .first = o->first, .rw = rw};
	for (int k = 0; k < 3; k++)
		j.colour[k] = wh_attributes_find(rw->attributes, 3 + k);
	wh_code code = make_readers(c, &j, rw->ex->workers);
	if (code == WH_OK)
		code = wh_exec_for(c, rw->ex, n, vertices_job, &j);
	if (code == WH_OK)
		code = wh_rewrite_start_faces(c, rw);
	if (code == WH_OK)
		code = wh_exec_ordered(c, rw->ex, n, faces_job, take_job, &j);
	free_readers(c, &j, rw->ex->workers);
	return code;
}
