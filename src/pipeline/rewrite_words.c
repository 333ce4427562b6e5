/*
 * Text bodies as one stream of words, whatever their lines look like: serial, with the precise
 * place of what is wrong. Items are passed twice, first for the vertices, then for the faces,
 * since polygons need their corners' positions.
 *
 * Cost: the text is read twice; memory is a window, a batch of vertices and the longest list.
 */
#include "pipeline/rewrite.h"

#include "io/number.h"

#include <inttypes.h>
#include <stdio.h>
#include <string.h>

enum {
	WINDOW = 1 << 20,   /* bytes of text; no word may be longer */
	TAKE_FROM = 1 << 16 /* triangles written at a time */
};

typedef struct reader {
	wh_rewrite *rw;
	char *text;              /* WINDOW bytes, and a blank behind those in use */
	uint64_t base;           /* offset in the file of text[0] */
	size_t n;                /* bytes in use */
	size_t at;               /* first not yet read */
	uint64_t line;           /* number of the line at `at`, from 1 */
	const wh_ply_elem *elem; /* what is being read, for messages */
	uint64_t item;
	uint64_t *ids; /* corners of the face at hand */
	size_t ids_cap, n_ids;
	double *uv; /* texture coordinates of these */
	size_t uv_cap, n_uv;
	uint8_t *face, *carried; /* what the face carries; with its corners' */
	size_t carried_cap;
	wh_told told;
	size_t batch;     /* vertices written at a time */
	double *xyz;      /* of these */
	uint8_t *records; /* attributes of these */
} reader;

/* --- words --- */

static void rewind_body(reader *r)
{
	r->base = r->rw->ply->body;
	r->n = r->at = 0;
	r->line = r->rw->ply->header_lines + 1;
	r->text[0] = ' ';
}

/* Moves what is not yet read to the front and reads on. No more at the end of the file. */
static wh_code refill(wh_ctx *c, reader *r)
{
	const wh_ply *p = r->rw->ply;
	if (wh_poll(c) != WH_OK)
		return c->err.code;
	memmove(r->text, r->text + r->at, r->n - r->at);
	r->base += r->at;
	r->n -= r->at;
	r->at = 0;
	const uint64_t left = p->size - (r->base + r->n);
	const size_t more = left < WINDOW - r->n ? (size_t)left : WINDOW - r->n;
	if (wh_ply_pread(c, p->path, p->fd, r->text + r->n, more, r->base + r->n) != WH_OK)
		return c->err.code;
	r->n += more;
	r->text[r->n] = ' ';
	return WH_OK;
}

static bool at_file_end(const reader *r)
{
	return r->base + r->n == r->rw->ply->size;
}

static wh_code ends_early(wh_ctx *c, const reader *r)
{
	return wh_fail(c, WH_E_INPUT,
	               "'%s' ends (line %" PRIu64 ") inside item %" PRIu64
	               " of element '%s', of which the header says %" PRIu64
	               ": it is cut short, or the header is wrong",
	               r->rw->ply->path, r->line, r->item, r->elem->name, r->elem->count);
}

static wh_code bad_word(wh_ctx *c, const reader *r, const char *word, const char *wanted)
{
	const size_t n = (size_t)(wh_word_end(word) - word);
	return wh_fail(c, WH_E_INPUT,
	               "'%s', line %" PRIu64 ", item %" PRIu64 " of element '%s': '%.*s' is not %s",
	               r->rw->ply->path, r->line, r->item, r->elem->name, n > 40 ? 40 : (int)n,
	               word, wanted);
}

/* Passes over what is left of the line; the file may end with it. */
static wh_code skip_line(wh_ctx *c, reader *r)
{
	const char eol = r->rw->ply->eol;
	for (;;) {
		const char *end = memchr(r->text + r->at, eol, r->n - r->at);
		r->at = end ? (size_t)(end - r->text) : r->n;
		if (end || at_file_end(r))
			return WH_OK;
		if (refill(c, r) != WH_OK)
			return c->err.code;
	}
}

/* Is there no word left on the line? */
static wh_code line_is_over(wh_ctx *c, reader *r, bool *over)
{
	const char eol = r->rw->ply->eol, comment = r->rw->ply->comment;
	for (;;) {
		while (r->at < r->n && wh_is_blank(r->text[r->at]) && r->text[r->at] != eol)
			r->at++;
		if (r->at < r->n || at_file_end(r))
			break;
		if (refill(c, r) != WH_OK)
			return c->err.code;
	}
	*over = r->at == r->n || r->text[r->at] == eol || (comment && r->text[r->at] == comment);
	return WH_OK;
}

/* Passes over blanks and comments, counting lines; the file must go on behind them. */
static wh_code skip_blanks(wh_ctx *c, reader *r)
{
	const char eol = r->rw->ply->eol, comment = r->rw->ply->comment;
	for (;;) {
		while (r->at < r->n && wh_is_blank(r->text[r->at]))
			r->line += r->text[r->at++] == eol;
		if (r->at < r->n && comment && r->text[r->at] == comment) {
			if (skip_line(c, r) != WH_OK)
				return c->err.code;
			continue;
		}
		if (r->at < r->n)
			return WH_OK;
		if (at_file_end(r))
			return ends_early(c, r);
		if (refill(c, r) != WH_OK)
			return c->err.code;
	}
}

/* The next word, as a whole in the window and with a blank behind it; NULL on failure. The
 * reader is behind it already. */
static const char *next_word(wh_ctx *c, reader *r)
{
	if (skip_blanks(c, r) != WH_OK)
		return NULL;
	const char *end = wh_word_end(r->text + r->at);
	if (end == r->text + r->n && !at_file_end(r)) {
		if (refill(c, r) != WH_OK)
			return NULL;
		end = wh_word_end(r->text);
		if (end == r->text + WINDOW) {
			(void)bad_word(c, r, r->text, "a number: it is longer than any");
			return NULL;
		}
	}
	const char *word = r->text + r->at;
	r->at = (size_t)(end - r->text);
	return word;
}

static wh_code skip_words(wh_ctx *c, reader *r, uint64_t n)
{
	for (; n > 0; n--)
		if (!next_word(c, r))
			return c->err.code;
	return WH_OK;
}

static wh_code read_whole(wh_ctx *c, reader *r, uint64_t *v)
{
	const char *word = next_word(c, r);
	if (!word)
		return c->err.code;
	return wh_scan_whole(word, v) ? WH_OK : bad_word(c, r, word, "a whole number");
}

static wh_code read_real(wh_ctx *c, reader *r, double *v)
{
	const char *word = next_word(c, r);
	if (!word)
		return c->err.code;
	const bool undeclared = r->rw->ply->undeclared && !r->rw->source.is_double;
	return (undeclared ? wh_scan_decimal(word, v, &r->told.wide) : wh_scan_real(word, v))
	           ? WH_OK
	           : bad_word(c, r, word, "a number");
}

/* The length of a list; its values take two bytes each at least. */
static wh_code read_length(wh_ctx *c, reader *r, uint64_t *n)
{
	if (read_whole(c, r, n) != WH_OK)
		return c->err.code;
	const uint64_t left = r->rw->ply->size - (r->base + r->at);
	if (*n > left / 2)
		return wh_fail(c, WH_E_INPUT,
		               "'%s', line %" PRIu64 ", item %" PRIu64
		               " of element '%s': a list of %" PRId64
		               " values does not fit into the rest of the file; it is cut short or "
		               "damaged",
		               r->rw->ply->path, r->line, r->item, r->elem->name, (int64_t)*n);
	return WH_OK;
}

/* --- items --- */

static wh_code skip_property(wh_ctx *c, reader *r, const wh_ply_prop *q)
{
	uint64_t n = 1;
	if (q->is_list && read_length(c, r, &n) != WH_OK)
		return c->err.code;
	return skip_words(c, r, n);
}

static wh_code read_attribute(wh_ctx *c, reader *r, const wh_attribute *a, uint8_t *record)
{
	const char *word = next_word(c, r);
	if (!word)
		return c->err.code;
	return wh_rewrite_scan(r->rw, a, word, record, &r->told)
	           ? WH_OK
	           : bad_word(c, r, word, "a number (--attributes leaves properties out)");
}

/* Behind the position a line may end where the header does not declare what is on it. `record` is
 * NULL where nothing is kept. */
static wh_code read_other(wh_ctx *c, reader *r, int i, uint8_t *record)
{
	const wh_attribute *a = record ? wh_attributes_find(r->rw->attributes, i) : NULL;
	bool over = false;
	if (r->rw->ply->undeclared && line_is_over(c, r, &over) != WH_OK)
		return c->err.code;
	if (over && a)
		wh_rewrite_untold(a, record);
	if (over)
		return WH_OK;
	return a ? read_attribute(c, r, a, record) : skip_property(c, r, &r->elem->props[i]);
}

/* Vertex k of the batch. */
static wh_code read_vertex(wh_ctx *c, reader *r, size_t k)
{
	const wh_ply *p = r->rw->ply;
	double *xyz = r->xyz + 3 * k;
	uint8_t *record = r->records + k * wh_rewrite_record(r->rw);
	for (int i = 0; i < (int)r->elem->nprops; i++) {
		const int axis = i == p->x ? 0 : i == p->y ? 1 : i == p->z ? 2 : -1;
		const wh_code code =
		    axis >= 0 ? read_real(c, r, &xyz[axis]) : read_other(c, r, i, record);
		if (code != WH_OK)
			return code;
	}
	return WH_OK;
}

static wh_code read_vertices(wh_ctx *c, reader *r)
{
	uint64_t first = 0;
	for (r->item = 0; r->item < r->elem->count; r->item++) {
		const size_t k = (size_t)(r->item - first);
		if (read_vertex(c, r, k) != WH_OK)
			return c->err.code;
		if (wh_rewrite_heed(r->rw, r->told))
			return WH_E_IRREGULAR;
		if (r->rw->ply->open_ended && skip_line(c, r) != WH_OK)
			return c->err.code;
		if (k + 1 < r->batch && r->item + 1 < r->elem->count)
			continue;
		if (wh_rewrite_put_vertices(c, r->rw, first, r->xyz, k + 1) != WH_OK ||
		    wh_rewrite_put_attributes(c, r->rw, first, r->records, k + 1) != WH_OK)
			return c->err.code;
		first = r->item + 1;
	}
	return WH_OK;
}

static wh_code bad_index(wh_ctx *c, const reader *r, uint64_t id)
{
	char place[40];
	(void)snprintf(place, sizeof place, "line %" PRIu64, r->line);
	return wh_rewrite_bad_index(c, r->rw, r->elem, r->item, id, place);
}

static wh_code read_corners(wh_ctx *c, reader *r)
{
	uint64_t n;
	if (read_length(c, r, &n) != WH_OK ||
	    wh_reserve(c, &r->ids, &r->ids_cap, (size_t)n, sizeof *r->ids) != WH_OK)
		return c->err.code;
	for (size_t i = 0; i < n; i++) {
		if (read_whole(c, r, &r->ids[i]) != WH_OK)
			return c->err.code;
		if (r->ids[i] >= r->rw->source.nv)
			return bad_index(c, r, r->ids[i]);
	}
	r->n_ids = (size_t)n;
	return WH_OK;
}

static wh_code read_texcoords(wh_ctx *c, reader *r)
{
	uint64_t n;
	if (read_length(c, r, &n) != WH_OK ||
	    wh_reserve(c, &r->uv, &r->uv_cap, (size_t)n, sizeof *r->uv) != WH_OK)
		return c->err.code;
	for (size_t i = 0; i < n; i++) {
		const char *word = next_word(c, r);
		if (!word)
			return c->err.code;
		if (!wh_scan_real(word, &r->uv[i]))
			return bad_word(c, r, word, "a number");
	}
	r->n_uv = (size_t)n;
	return WH_OK;
}

static wh_code bad_texcoords(wh_ctx *c, const reader *r)
{
	char place[40];
	(void)snprintf(place, sizeof place, "line %" PRIu64, r->line);
	return wh_rewrite_bad_texcoords(c, r->rw, r->elem, r->item, r->n_uv, r->n_ids, place);
}

/* Adds the face that was read, with what it carries. */
static wh_code add_face(wh_ctx *c, reader *r, wh_facer *f)
{
	const wh_wedges *w = r->rw->wedges;
	f->carried = NULL;
	if (w && !wh_is_texcoords(r->n_uv, r->n_ids))
		return bad_texcoords(c, r);
	if (w) {
		uint8_t *to = wh_rewrite_carried(c, r->rw, &r->carried, &r->carried_cap, r->n_ids);
		if (!to)
			return c->err.code;
		for (size_t i = 0; i < r->n_uv; i++)
			wh_attribute_set(&w->corner.item[i % 2], to + i / 2 * w->corner.bytes,
			                 r->uv[i]);
		memcpy(to + r->n_ids * w->corner.bytes, r->face, w->face.bytes);
		f->carried = to;
	}
	return wh_facer_add(c, f, r->ids, r->n_ids);
}

static wh_code take_when_full(wh_ctx *c, const reader *r, wh_facer *f)
{
	return f->out_n < TAKE_FROM ? WH_OK : wh_rewrite_take(c, r->rw, f);
}

static wh_code read_strip(wh_ctx *c, reader *r, wh_facer *f)
{
	uint64_t n;
	uint64_t id = 0;
	if (read_length(c, r, &n) != WH_OK)
		return c->err.code;
	wh_facer_strip_start(f);
	for (; n > 0; n--) {
		if (read_whole(c, r, &id) != WH_OK)
			return c->err.code;
		if (id == UINT64_MAX)
			wh_facer_strip_start(f);
		else if (id >= r->rw->source.nv)
			return bad_index(c, r, id);
		else if (wh_facer_strip_corner(c, f, id) != WH_OK ||
		         take_when_full(c, r, f) != WH_OK)
			return c->err.code;
	}
	return WH_OK;
}

static wh_code read_face(wh_ctx *c, reader *r, wh_facer *f, bool strip, int list)
{
	const wh_wedges *w = strip ? NULL : r->rw->wedges;
	r->n_uv = 0;
	for (int i = 0; i < (int)r->elem->nprops; i++) {
		const wh_attribute *a = w ? wh_attributes_find(&w->face, i) : NULL;
		const wh_code code = i == list && strip  ? read_strip(c, r, f)
		                     : i == list         ? read_corners(c, r)
		                     : a                 ? read_attribute(c, r, a, r->face)
		                     : w && i == w->list ? read_texcoords(c, r)
		                                         : skip_property(c, r, &r->elem->props[i]);
		if (code != WH_OK)
			return code;
	}
	if (!strip && add_face(c, r, f) != WH_OK)
		return c->err.code;
	if (r->rw->ply->open_ended && skip_line(c, r) != WH_OK)
		return c->err.code;
	return take_when_full(c, r, f);
}

static wh_code read_faces(wh_ctx *c, reader *r, int elem)
{
	const wh_ply *p = r->rw->ply;
	wh_facer *f = &r->rw->facers[0];
	for (r->item = 0; r->item < r->elem->count; r->item++)
		if (read_face(c, r, f, elem == p->strips, wh_corner_list(p, elem)) != WH_OK)
			return c->err.code;
	return wh_rewrite_take(c, r->rw, f);
}

/* --- the passes --- */

static wh_code skip_element(wh_ctx *c, reader *r)
{
	enum { POSITION = 3 }; /* first on the line where nothing is declared */
	if (r->elem->nprops == 0)
		return WH_OK;
	for (r->item = 0; r->item < r->elem->count; r->item++) {
		for (int i = 0; i < (int)r->elem->nprops; i++)
			if ((i < POSITION ? skip_property(c, r, &r->elem->props[i])
			                  : read_other(c, r, i, NULL)) != WH_OK)
				return c->err.code;
		if (r->rw->ply->open_ended && skip_line(c, r) != WH_OK)
			return c->err.code;
	}
	return WH_OK;
}

/* Reads all elements up to the last of this pass, and only passes over those of the other. */
static wh_code run_pass(wh_ctx *c, reader *r, bool faces, int last)
{
	const wh_ply *p = r->rw->ply;
	rewind_body(r);
	for (int i = 0; i <= last; i++) {
		r->elem = &p->elems[i];
		const bool wanted = faces ? wh_is_face_element(p, i) : i == p->vertex;
		const wh_code code = !wanted ? skip_element(c, r)
		                     : faces ? read_faces(c, r, i)
		                             : read_vertices(c, r);
		if (code != WH_OK)
			return code;
	}
	return WH_OK;
}

wh_code wh_rewrite_words(wh_ctx *c, wh_rewrite *rw)
{
	const wh_ply *p = rw->ply;
	reader r = {.rw = rw};
	wh_rewrite_restart(rw);
	r.text = wh_alloc(c, WINDOW + 1, 1);
	r.batch = wh_rewrite_batch(rw);
	r.xyz = wh_alloc(c, r.batch, 3 * sizeof *r.xyz);
	r.records = wh_alloc(c, r.batch, wh_rewrite_record(rw));
	if (rw->wedges)
		r.face = wh_calloc(c, rw->wedges->face.bytes + 1, 1);
	wh_code code = r.text && r.xyz && r.records && (r.face || !rw->wedges)
	                   ? run_pass(c, &r, false, p->vertex)
	                   : wh_failed(c);
	if (code == WH_OK)
		code = wh_rewrite_start_faces(c, rw);
	if (code == WH_OK)
		code = run_pass(c, &r, true, p->face > p->strips ? p->face : p->strips);
	wh_free(c, r.carried);
	wh_free(c, r.face);
	wh_free(c, r.uv);
	wh_free(c, r.ids);
	wh_free(c, r.records);
	wh_free(c, r.xyz);
	wh_free(c, r.text);
	return code;
}
