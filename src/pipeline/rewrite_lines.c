/*
 * Text bodies that keep one item to a line, as nearly all do, in parallel.
 *
 * The body is cut into chunks of bytes; a line belongs to the chunk where its first word begins.
 * A first pass counts every chunk's lines, so that each knows the number of its first; lines
 * without a word do not count. Then one pass over the chunks with vertices, whose places in the
 * output are known, and one over those with faces, whose triangles are appended in order.
 *
 * When the body has exactly as many lines as the header promises items, words behind the last
 * property of a line are passed over. Anything else that is not as expected makes the whole way
 * WH_E_IRREGULAR: reading word by word either works or says what is wrong and where.
 *
 * Cost: the text is read two to three times, parsed once; memory per worker is a chunk and what
 * comes out of it (or the longest line).
 */
#include "pipeline/rewrite.h"

#include "base/real.h"
#include "io/number.h"

#include <string.h>

enum {
	CHUNK = 1 << 20, /* bytes */
	MORE = 1 << 16   /* bytes read first when a chunk's last line goes on behind it */
};

/* What a line or a part of one begins with. */
typedef enum kind { BLANKS, WORD, COMMENT } kind;

/* What a chunk's bytes say by themselves, and what follows from the chunks before it. */
typedef struct chunk {
	uint64_t first; /* number of the chunk's first line */
	uint32_t lines; /* that begin behind a line end within the chunk */
	kind at_start;  /* what there is before its first line end, ... */
	bool has_end;   /* ... if it has one, ... */
	kind at_end;    /* ... and behind its last */
	bool in_line;   /* its first bytes go on a line whose first word is before it */
} chunk;

/* What is done with a property of an item. */
typedef enum action {
	SKIP,
	TAKE_X,
	TAKE_Y,
	TAKE_Z,
	TAKE_ATTRIBUTE,
	SKIP_LIST,
	TAKE_CORNERS,
	TAKE_TEXCOORDS
} action;

typedef struct element {
	uint64_t first, end; /* lines */
	action *actions;     /* nprops of them */
	size_t nprops;
	bool round; /* coordinates are floats */
	bool strip;
} element;

/* A worker's buffers. */
typedef struct workspace {
	char *text;
	size_t text_cap;
	size_t n; /* bytes of text */
	wh_told told;
	double *xyz;
	size_t xyz_cap;
	uint8_t *records; /* attributes */
	size_t records_cap;
	uint64_t *ids;
	size_t ids_cap;
	double *uv; /* texture coordinates of a face's corners */
	size_t uv_cap;
	uint8_t *face, *carried; /* what the face carries; with its corners' */
	size_t face_cap, carried_cap;
} workspace;

/* What a line came to, beside what is in the workspace. */
typedef struct found {
	uint64_t corners, texcoords;
} found;

typedef struct job {
	wh_rewrite *rw;
	char eol;
	chunk *chunks;
	int64_t nchunks;
	element *elements;
	bool lenient;         /* words behind the last property are passed over */
	bool undeclared;      /* coordinates may need doubles */
	bool faces_now;       /* which of the two passes this is */
	workspace *workspace; /* one per worker */
} job;

/* --- counting lines --- */

static uint64_t chunk_start(const job *j, int64_t index)
{
	return j->rw->ply->body + (uint64_t)index * CHUNK;
}

static size_t chunk_bytes(const job *j, int64_t index)
{
	const uint64_t left = j->rw->ply->size - chunk_start(j, index);
	return left < CHUNK ? (size_t)left : CHUNK;
}

/* What begins before the line end at `end`? */
static kind kind_of(const char *s, const char *end, char comment)
{
	while (s < end && wh_is_blank(*s))
		s++;
	return s == end ? BLANKS : comment && *s == comment ? COMMENT : WORD;
}

static void count_lines(chunk *k, const char *s, const char *end, char eol, char comment)
{
	const char *stop = memchr(s, eol, (size_t)(end - s));
	k->has_end = stop != NULL;
	k->at_start = kind_of(s, stop ? stop : end, comment);
	while (stop) {
		s = stop + 1;
		stop = memchr(s, eol, (size_t)(end - s));
		k->at_end = kind_of(s, stop ? stop : end, comment);
		k->lines += k->at_end == WORD;
	}
}

static wh_code count_chunk(wh_ctx *c, void *arg, int64_t index, int worker)
{
	job *j = arg;
	workspace *s = &j->workspace[worker];
	const wh_ply *p = j->rw->ply;
	const size_t n = chunk_bytes(j, index);
	if (wh_reserve(c, &s->text, &s->text_cap, CHUNK + 1, 1) != WH_OK ||
	    wh_ply_pread(c, p->path, p->fd, s->text, n, chunk_start(j, index)) != WH_OK)
		return c->err.code;
	count_lines(&j->chunks[index], s->text, s->text + n, j->eol, p->comment);
	return WH_OK;
}

/* Numbers the lines from chunk to chunk; returns how many there are. */
static uint64_t number_lines(job *j)
{
	uint64_t line = 0;
	kind before = BLANKS; /* in front of the chunk, on the line that it begins in */
	for (int64_t i = 0; i < j->nchunks; i++) {
		chunk *k = &j->chunks[i];
		k->first = line;
		k->in_line = before != BLANKS;
		k->lines += k->at_start == WORD && before == BLANKS;
		line += k->lines;
		before = k->has_end ? k->at_end : before != BLANKS ? before : k->at_start;
	}
	return line;
}

/* --- elements --- */

static action action_of(const wh_rewrite *rw, int elem, int prop)
{
	const wh_ply *p = rw->ply;
	const wh_wedges *w = elem == p->face ? rw->wedges : NULL;
	if (p->elems[elem].props[prop].is_list)
		return prop == wh_corner_list(p, elem) ? TAKE_CORNERS
		       : w && prop == w->list          ? TAKE_TEXCOORDS
		                                       : SKIP_LIST;
	if (w && wh_attributes_find(&w->face, prop))
		return TAKE_ATTRIBUTE;
	if (elem != p->vertex)
		return SKIP;
	if (wh_attributes_find(rw->attributes, prop))
		return TAKE_ATTRIBUTE;
	return prop == p->x ? TAKE_X : prop == p->y ? TAKE_Y : prop == p->z ? TAKE_Z : SKIP;
}

/* Fills the table of elements. *total: lines that the header promises. */
static wh_code plan_elements(wh_ctx *c, job *j, uint64_t *total)
{
	const wh_ply *p = j->rw->ply;
	*total = 0;
	for (size_t i = 0; i < p->nelems; i++) {
		element *e = &j->elements[i];
		e->nprops = p->elems[i].nprops;
		e->first = *total;
		*total += e->nprops > 0 ? p->elems[i].count : 0; /* an empty item has no line */
		e->end = *total;
		e->round = !j->rw->source.is_double;
		e->strip = (int)i == p->strips;
		e->actions = wh_alloc(c, e->nprops, sizeof *e->actions);
		if (!e->actions)
			return c->err.code;
		for (size_t k = 0; k < e->nprops; k++)
			e->actions[k] = action_of(j->rw, (int)i, (int)k);
	}
	return WH_OK;
}

/* --- one line --- */

/* The next word of the line, or its end. */
static inline const char *skip_blanks(const char *s, char eol)
{
	while (wh_is_blank(*s) && *s != eol)
		s++;
	return s;
}

/* Passes over n words; NULL when the line has fewer. */
static const char *skip_words(const char *s, uint64_t n, char eol)
{
	for (; n > 0; n--) {
		s = skip_blanks(s, eol);
		if (*s == eol)
			return NULL;
		s = wh_word_end(s);
	}
	return s;
}

/* The length of a list at s. */
static inline const char *scan_count(const char *s, char eol, uint64_t *n)
{
	return wh_scan_whole(skip_blanks(s, eol), n);
}

/* n whole numbers at s, into ids. NULL: not as expected, or out of memory (recorded). */
static const char *scan_list(wh_ctx *c, const char *s, char eol, workspace *w, uint64_t n)
{
	for (size_t i = 0; i < n; i++) {
		if (i == w->ids_cap &&
		    wh_reserve(c, &w->ids, &w->ids_cap, i + 1, sizeof *w->ids) != WH_OK)
			return NULL;
		s = wh_scan_whole(skip_blanks(s, eol), &w->ids[i]);
		if (!s)
			return NULL;
	}
	return s;
}

/* The same of n reals, into uv. */
static const char *scan_texcoords(wh_ctx *c, const char *s, char eol, workspace *w, uint64_t n)
{
	for (size_t i = 0; i < n && s; i++) {
		if (i == w->uv_cap &&
		    wh_reserve(c, &w->uv, &w->uv_cap, i + 1, sizeof *w->uv) != WH_OK)
			return NULL;
		s = skip_blanks(s, eol);
		s = *s == eol ? NULL : wh_scan_real(s, &w->uv[i]);
	}
	return s;
}

/* The rest of a line must hold no word, unless words are passed over. */
static bool line_ends(const job *j, const char *s)
{
	return j->lenient || *skip_blanks(s, j->eol) == j->eol;
}

/* The line may end before the value where the header does not declare it. */
static const char *take_attribute(const job *j, const wh_attribute *a, const char *s,
                                  uint8_t *record, wh_told *told)
{
	if (*s != j->eol)
		return wh_rewrite_scan(j->rw, a, s, record, told);
	if (!j->rw->ply->undeclared)
		return NULL;
	wh_rewrite_untold(a, record);
	return s;
}

/* Parses a line of any element; takes coordinates into xyz[3], attributes from `next` on into
 * `record`, corners into w->ids, their texture coordinates into w->uv. False: not as expected. */
static bool scan_line(wh_ctx *c, const job *j, const element *e, const char *s, workspace *w,
                      double *xyz, const wh_attribute *next, uint8_t *record, found *lists)
{
	*lists = (found){0};
	for (size_t i = 0; i < e->nprops && s; i++) {
		const action a = e->actions[i];
		uint64_t n;
		if (a == SKIP) {
			const char *end = skip_words(s, 1, j->eol);
			s = !end && j->rw->ply->undeclared ? s : end;
		} else if (a <= TAKE_Z) {
			s = skip_blanks(s, j->eol);
			s = *s == j->eol    ? NULL
			    : j->undeclared ? wh_scan_decimal(s, &xyz[a - TAKE_X], &w->told.wide)
			                    : wh_scan_real(s, &xyz[a - TAKE_X]);
		} else if (a == TAKE_ATTRIBUTE) {
			s = take_attribute(j, next++, skip_blanks(s, j->eol), record, &w->told);
		} else {
			s = scan_count(s, j->eol, &n);
			if (s && a == SKIP_LIST) {
				s = skip_words(s, n, j->eol);
			} else if (s && a == TAKE_TEXCOORDS) {
				s = scan_texcoords(c, s, j->eol, w, n);
				lists->texcoords = n;
			} else if (s) {
				s = scan_list(c, s, j->eol, w, n);
				lists->corners = n;
			}
		}
	}
	return s && line_ends(j, s);
}

static wh_code add_strip(wh_ctx *c, const job *j, wh_facer *f, const uint64_t *ids, uint64_t n)
{
	wh_facer_strip_start(f);
	for (uint64_t i = 0; i < n; i++) {
		if (ids[i] == UINT64_MAX)
			wh_facer_strip_start(f);
		else if (ids[i] >= j->rw->source.nv)
			return WH_E_IRREGULAR;
		else if (wh_facer_strip_corner(c, f, ids[i]) != WH_OK)
			return c->err.code;
	}
	return WH_OK;
}

/* Tells the facer what the face of the line at hand carries. WH_E_IRREGULAR: that is damaged, as
 * whoever goes through the words will say. */
static wh_code carry(wh_ctx *c, const job *j, workspace *w, found lists, wh_facer *f)
{
	const wh_wedges *we = j->rw->wedges;
	const size_t n = (size_t)lists.corners;
	if (!wh_is_texcoords(lists.texcoords, n))
		return WH_E_IRREGULAR;
	uint8_t *to = wh_rewrite_carried(c, j->rw, &w->carried, &w->carried_cap, n);
	if (!to)
		return c->err.code;
	for (size_t i = 0; i < lists.texcoords; i++)
		wh_attribute_set(&we->corner.item[i % 2], to + i / 2 * we->corner.bytes, w->uv[i]);
	memcpy(to + n * we->corner.bytes, w->face, we->face.bytes);
	f->carried = to;
	return WH_OK;
}

static wh_code face_line(wh_ctx *c, const job *j, const element *e, const char *s, workspace *w,
                         wh_facer *f)
{
	const wh_wedges *we = j->rw->wedges;
	double unused[3];
	found lists;
	if (we && wh_reserve(c, &w->face, &w->face_cap, we->face.bytes + 1, 1) != WH_OK)
		return c->err.code;
	if (!scan_line(c, j, e, s, w, unused, we ? we->face.item : NULL, w->face, &lists))
		return c->err.code != WH_OK ? c->err.code : WH_E_IRREGULAR;
	const uint64_t n = lists.corners;
	if (e->strip)
		return add_strip(c, j, f, w->ids, n);
	for (size_t i = 0; i < n; i++)
		if (w->ids[i] >= j->rw->source.nv)
			return WH_E_IRREGULAR;
	const wh_code code = we ? carry(c, j, w, lists, f) : WH_OK;
	return code == WH_OK ? wh_facer_add(c, f, w->ids, (size_t)n) : code;
}

/* Vertex number `at` of those of this chunk. */
static wh_code vertex_line(wh_ctx *c, const job *j, const element *e, const char *s, workspace *w,
                           size_t at)
{
	found unused;
	const wh_attributes *a = j->rw->attributes;
	const size_t size = wh_rewrite_record(j->rw);
	if (wh_reserve(c, &w->xyz, &w->xyz_cap, 3 * at + 3, sizeof *w->xyz) != WH_OK ||
	    wh_reserve(c, &w->records, &w->records_cap, (at + 1) * size, 1) != WH_OK)
		return c->err.code;
	if (!scan_line(c, j, e, s, w, w->xyz + 3 * at, a ? a->item : NULL,
	               size ? w->records + at * size : NULL, &unused))
		return c->err.code != WH_OK ? c->err.code : WH_E_IRREGULAR;
	for (size_t k = 0; k < 3; k++) {
		const double v = w->xyz[3 * at + k];
		if (!isfinite(e->round ? wh_round_float(v) : v) && !j->rw->ply->keep_invalid)
			return WH_E_IRREGULAR;
	}
	return WH_OK;
}

static wh_code other_line(wh_ctx *c, const job *j, const element *e, const char *s, workspace *w)
{
	double unused[3];
	found none;
	if (!scan_line(c, j, e, s, w, unused, NULL, NULL, &none))
		return c->err.code != WH_OK ? c->err.code : WH_E_IRREGULAR;
	return WH_OK;
}

/* --- one chunk --- */

/* Reads the chunk and on to the end of its last line; a line end is put behind the file's last
 * byte. *stop: lines that begin at it or behind it are not the chunk's. */
static wh_code load(wh_ctx *c, const job *j, int64_t index, workspace *w, size_t *stop)
{
	const wh_ply *p = j->rw->ply;
	const uint64_t start = chunk_start(j, index);
	const uint64_t left = p->size - start;
	size_t want = chunk_bytes(j, index);
	*stop = want;
	w->n = 0;
	for (;;) {
		if (wh_reserve(c, &w->text, &w->text_cap, want + 1, 1) != WH_OK ||
		    wh_ply_pread(c, p->path, p->fd, w->text + w->n, want - w->n, start + w->n) !=
		        WH_OK)
			return c->err.code;
		const size_t from = w->n > *stop ? w->n : *stop - 1;
		w->n = want;
		if (want == left || memchr(w->text + from, j->eol, want - from))
			break;
		const size_t next = want == *stop ? want + MORE : want + (want - *stop);
		want = left < next ? (size_t)left : next;
	}
	w->text[w->n] = j->eol;
	return WH_OK;
}

/* What the lines of a chunk have come to. */
typedef struct walk {
	uint64_t line;         /* number of the line at hand */
	size_t elem;           /* its element */
	uint64_t first_vertex; /* of this chunk's */
	size_t vertices;       /* so far */
} walk;

static wh_code do_line(wh_ctx *c, const job *j, walk *k, const char *s, workspace *w, wh_facer *f)
{
	const wh_ply *p = j->rw->ply;
	while (k->elem < p->nelems && k->line >= j->elements[k->elem].end)
		k->elem++;
	if (k->elem == p->nelems)
		return WH_OK; /* behind the last item: whatever it is */
	const element *e = &j->elements[k->elem];
	const bool face = wh_is_face_element(p, (int)k->elem);
	if (face != j->faces_now)
		return WH_OK;
	if (face)
		return face_line(c, j, e, s, w, f);
	if ((int)k->elem != p->vertex)
		return other_line(c, j, e, s, w);
	if (k->vertices == 0)
		k->first_vertex = k->line - e->first;
	return vertex_line(c, j, e, s, w, k->vertices++);
}

/* Is there anything to do for this pass among the chunk's lines? */
static bool concerns(const job *j, int64_t index)
{
	const wh_ply *p = j->rw->ply;
	const chunk *k = &j->chunks[index];
	const uint64_t end = k->first + k->lines;
	for (size_t i = 0; i < p->nelems; i++)
		if (wh_is_face_element(p, (int)i) == j->faces_now &&
		    k->first < j->elements[i].end && end > j->elements[i].first)
			return true;
	return false;
}

static wh_code do_chunk(wh_ctx *c, void *arg, int64_t index, int worker)
{
	const job *j = arg;
	workspace *w = &j->workspace[worker];
	walk k = {.line = j->chunks[index].first};
	size_t stop;
	if (!concerns(j, index))
		return WH_OK;
	if (load(c, j, index, w, &stop) != WH_OK)
		return c->err.code;
	const char *s = w->text;
	const char comment = j->rw->ply->comment;
	if (j->chunks[index].in_line)
		s = (const char *)memchr(s, j->eol, w->n + 1) + 1;
	while (s < w->text + stop) {
		s = skip_blanks(s, j->eol);
		/* a line whose first word is behind the chunk is the next chunk's */
		if (*s != j->eol && s < w->text + stop && (!comment || *s != comment)) {
			const wh_code code = do_line(c, j, &k, s, w, &j->rw->facers[worker]);
			if (code != WH_OK)
				return code;
			k.line++;
		}
		s = (const char *)memchr(s, j->eol, w->n + 1 - (size_t)(s - w->text)) + 1;
	}
	if (k.vertices == 0)
		return WH_OK;
	if (wh_rewrite_heed(j->rw, w->told))
		return WH_E_IRREGULAR;
	if (wh_rewrite_put_vertices(c, j->rw, k.first_vertex, w->xyz, k.vertices) != WH_OK)
		return c->err.code;
	return wh_rewrite_put_attributes(c, j->rw, k.first_vertex, w->records, k.vertices);
}

static wh_code take_chunk(wh_ctx *c, void *arg, int64_t index, int worker)
{
	const job *j = arg;
	(void)index;
	return wh_rewrite_take(c, j->rw, &j->rw->facers[worker]);
}

/* --- the passes --- */

static wh_code run_passes(wh_ctx *c, job *j)
{
	uint64_t promised;
	const wh_exec *ex = j->rw->ex;
	if (plan_elements(c, j, &promised) != WH_OK)
		return c->err.code;
	wh_code code = wh_exec_for(c, ex, j->nchunks, count_chunk, j);
	if (code != WH_OK)
		return code;
	const uint64_t lines = number_lines(j);
	if (lines < promised)
		return WH_E_IRREGULAR;
	j->lenient = j->rw->ply->open_ended || lines == promised;
	code = wh_exec_for(c, ex, j->nchunks, do_chunk, j);
	if (code == WH_OK)
		code = wh_rewrite_start_faces(c, j->rw);
	j->faces_now = true;
	if (code == WH_OK)
		code = wh_exec_ordered(c, ex, j->nchunks, do_chunk, take_chunk, j);
	return code;
}

static void close_job(wh_ctx *c, job *j)
{
	for (size_t i = 0; j->elements && i < j->rw->ply->nelems; i++)
		wh_free(c, j->elements[i].actions);
	for (int i = 0; j->workspace && i < j->rw->ex->workers; i++) {
		wh_free(c, j->workspace[i].text);
		wh_free(c, j->workspace[i].xyz);
		wh_free(c, j->workspace[i].records);
		wh_free(c, j->workspace[i].ids);
		wh_free(c, j->workspace[i].uv);
		wh_free(c, j->workspace[i].face);
		wh_free(c, j->workspace[i].carried);
	}
	wh_free(c, j->elements);
	wh_free(c, j->workspace);
	wh_free(c, j->chunks);
}

wh_code wh_rewrite_lines(wh_ctx *c, wh_rewrite *rw)
{
	const wh_ply *p = rw->ply;
	job j = {.rw = rw, .eol = p->eol, .undeclared = p->undeclared && !rw->source.is_double};
	j.nchunks = (int64_t)((p->size - p->body + CHUNK - 1) / CHUNK);
	j.chunks = wh_calloc(c, (size_t)j.nchunks, sizeof *j.chunks);
	j.elements = wh_calloc(c, p->nelems, sizeof *j.elements);
	j.workspace = wh_calloc(c, (size_t)rw->ex->workers, sizeof *j.workspace);
	wh_code code = c->err.code;
	if (j.chunks && j.elements && j.workspace)
		code = run_passes(c, &j);
	close_job(c, &j);
	return code;
}
