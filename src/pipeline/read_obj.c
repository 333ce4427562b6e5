/*
 * Three passes over chunks of lines, all in parallel: one counts the lines of each kind, so that
 * every chunk knows the number of its first vertex (relative indices count back from the vertex
 * before them), and whose the normals are; one parses vertices, whose places in the output are then
 * known; one parses faces, whose triangles are appended in order. Texture coordinates and normals
 * wait in files of their own for those who refer to them.
 *
 * Cost: the text is read three times, parsed once. Memory: a chunk per worker and what comes out
 * of it, 8 bytes for each MiB of the file.
 */
#include "pipeline/read_obj.h"

#include "base/chunks.h"
#include "base/real.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

/* What lines are, by their first word. */
typedef enum tag {
	VERTEX,
	FACE,
	TEXTURE,
	NORMAL,
	GROUP,
	MATERIAL,
	LIBRARY,
	SMOOTH,
	LINE,
	POINT,
	OTHER,
	TAGS
} tag;

static const struct {
	const char *word;
	tag tag;
} words[] = {
    {"v", VERTEX}, {"f", FACE},  {"vt", TEXTURE},      {"vn", NORMAL},
    {"g", GROUP},  {"o", GROUP}, {"usemtl", MATERIAL}, {"mtllib", LIBRARY},
    {"l", LINE},   {"p", POINT}, {"fo", FACE}, /* an old word for it */
    {"s", SMOOTH},
};

/* Names for what is not carried over. */
static const char *const tag_names[TAGS] = {[TEXTURE] = "texture coordinates",
                                            [NORMAL] = "normals",
                                            [GROUP] = "groups",
                                            [MATERIAL] = "materials",
                                            [LIBRARY] = "material libraries",
                                            [SMOOTH] = "smoothing groups",
                                            [LINE] = "lines",
                                            [POINT] = "points",
                                            [OTHER] = "other statements"};

enum { COLOURED = 6 }; /* numbers of a vertex with a colour */

/* A line with a name: where it is in the text of the chunk. */
typedef struct named {
	tag tag;
	size_t at, n;
} named;

/* What corners refer to: floats. */
static const struct {
	const char *word;
	uint32_t width;
} lists[WH_OBJ_LISTS] = {[WH_OBJ_TEXCOORDS] = {"vt", 2}, [WH_OBJ_NORMALS] = {"vn", 3}};

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
	/* counting: */
	wh_obj_start counted;
	wh_obj_habit habit;
	named *names;
	size_t names_cap, n_names;
	/* what corners refer to, as it is read, and as it is looked up: */
	double *value[WH_OBJ_LISTS];
	size_t value_cap[WH_OBJ_LISTS];
	wh_positions listed[WH_OBJ_LISTS];
	uint8_t *carried;
	size_t carried_cap;
} reader;

typedef struct job {
	const wh_obj *obj;
	const wh_lines *lines;
	wh_obj *filled; /* while it is looked at */
	wh_obj_start *start;
	wh_source list[WH_OBJ_LISTS]; /* as if they were positions; their files -1 without */
	uint8_t *coloured;            /* per chunk: its first vertex has a colour */
	wh_obj_habit habit;
	wh_rewrite *rw;
	const wh_attribute *colour[3], *normal[3]; /* those of vertices that are carried */
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
		wh_free(c, j->readers[i].names);
		wh_free(c, j->readers[i].carried);
		for (int k = 0; k < WH_OBJ_LISTS; k++) {
			wh_free(c, j->readers[i].value[k]);
			wh_positions_close(c, &j->readers[i].listed[k]);
		}
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

/* What is behind the first word of a line, without blanks at its ends; of a group, the whole line.
 */
static named name_of(const job *j, const reader *r, const char *s, tag t)
{
	const char *name = t == GROUP ? s : wh_lines_word(j->lines, wh_word_end(s));
	const char *end =
	    memchr(name, j->lines->eol, r->part.n + 1 - (size_t)(name - r->part.text));
	while (end > name && wh_is_blank(end[-1]))
		end--;
	return (named){t, (size_t)(name - r->part.text), (size_t)(end - name)};
}

static wh_code keep_name(wh_ctx *c, const job *j, reader *r, const char *s, tag t)
{
	if (wh_reserve(c, &r->names, &r->names_cap, r->n_names + 1, sizeof *r->names) != WH_OK)
		return c->err.code;
	r->names[r->n_names++] = name_of(j, r, s, t);
	return WH_OK;
}

/* What the corners of a face do with normals; those of a line are of one kind. */
static void note_habit(const wh_lines *l, reader *r, const char *s)
{
	const wh_obj_start *k = &r->counted;
	wh_obj_corner corner, first = {0};
	bool begun = false;
	for (s = wh_lines_word(l, wh_word_end(s)); *s != l->eol && *s != '#';
	     s = wh_lines_word(l, wh_word_end(s))) {
		if (!wh_obj_corner_scan(s, &corner))
			return; /* whoever reads faces says so */
		if (!begun)
			first = corner;
		begun = true;
		wh_obj_habit_add(&r->habit, &corner, &first, k->vertices,
		                 k->listed[WH_OBJ_NORMALS]);
		if (first.normal.n == 0)
			return;
	}
}

static wh_code count_job(wh_ctx *c, void *arg, int64_t index, int worker)
{
	const job *j = arg;
	reader *r = &j->readers[worker];
	r->counted = (wh_obj_start){0};
	r->habit = (wh_obj_habit){0};
	r->n_names = 0;
	if (wh_lines_load(c, j->lines, index, &r->part) != WH_OK)
		return c->err.code;
	for (const char *s; (s = wh_lines_next(j->lines, &r->part)) != NULL;) {
		if (*s == '#')
			continue;
		const tag t = tag_of(s);
		if (t == VERTEX && r->counted.vertices++ == 0)
			j->coloured[index] = count_words(j->lines, s, COLOURED) >= COLOURED;
		r->counted.listed[WH_OBJ_TEXCOORDS] += t == TEXTURE;
		r->counted.listed[WH_OBJ_NORMALS] += t == NORMAL;
		if (t == FACE)
			note_habit(j->lines, r, s);
		r->count[t]++;
		if ((t == GROUP || t == MATERIAL || t == LIBRARY) &&
		    keep_name(c, j, r, s, t) != WH_OK)
			return c->err.code;
	}
	return WH_OK;
}

/* Chunk by chunk: what the next one begins with. */
static wh_code count_commit(wh_ctx *c, void *arg, int64_t index, int worker)
{
	job *j = arg;
	const reader *r = &j->readers[worker];
	wh_obj *o = j->filled;
	wh_obj_start *next = &o->start[index + 1];
	*next = o->start[index];
	wh_obj_habit_join(&j->habit, &r->habit, next->vertices, next->listed[WH_OBJ_NORMALS]);
	next->vertices += r->counted.vertices;
	for (int k = 0; k < WH_OBJ_LISTS; k++)
		next->listed[k] += r->counted.listed[k];
	for (size_t i = 0; i < r->n_names; i++) {
		const named *one = &r->names[i];
		const char *s = r->part.text + one->at;
		wh_names *list = one->tag == GROUP      ? &o->groups
		                 : one->tag == MATERIAL ? &o->materials
		                                        : &o->libraries;
		uint32_t at;
		if (one->n && wh_names_add(c, list, s, one->n, &at) != WH_OK)
			return c->err.code;
		if (one->tag == GROUP)
			next->group = one->n ? at + 1 : 0;
		else if (one->tag == MATERIAL)
			next->material = one->n ? at + 1 : 0;
	}
	return WH_OK;
}

static void add_three(wh_ctx *c, wh_ply *p, const char *const name[3])
{
	for (int k = 0; k < 3; k++)
		(void)wh_ply_add_property(c, p, name[k], WH_F32, false);
}

static void describe_faces(wh_ctx *c, const wh_obj *o, wh_ply *p, const uint64_t count[TAGS])
{
	if (wh_ply_add_element(c, p, "face", count[FACE]) == WH_OK)
		(void)wh_ply_add_property(c, p, "vertex_indices", WH_I32, true);
	if (count[TEXTURE])
		(void)wh_ply_add_property(c, p, "texcoord", WH_F32, true);
	if (o->normals == WH_OBJ_NORMALS_OF_CORNERS)
		(void)wh_ply_add_property(c, p, WH_WEDGES_NORMALS, WH_F32, true);
	if (o->materials.n)
		(void)wh_ply_add_property(c, p, "material", WH_U32, false);
	if (o->groups.n)
		(void)wh_ply_add_property(c, p, "group", WH_U32, false);
}

static wh_code describe(wh_ctx *c, const job *j, wh_ply *p, const uint64_t count[TAGS])
{
	wh_obj *o = j->filled;
	for (int64_t i = 0; i < j->lines->chunks; i++)
		o->coloured = o->coloured || j->coloured[i];
	o->normals = wh_obj_habit_tells(&j->habit);
	p->format = WH_PLY_ASCII;
	p->undeclared = true;
	if (wh_ply_add_element(c, p, "vertex", count[VERTEX]) != WH_OK)
		return c->err.code;
	add_three(c, p, (const char *[]){"x", "y", "z"});
	if (o->coloured)
		add_three(c, p, (const char *[]){"red", "green", "blue"});
	if (o->normals == WH_OBJ_NORMALS_OF_VERTICES)
		add_three(c, p, (const char *[]){"nx", "ny", "nz"});
	describe_faces(c, o, p, count);
	for (int t = 0; t < TAGS; t++) {
		const bool flat = t == NORMAL && o->normals == WH_OBJ_NORMALS_FLAT;
		if (tag_names[t] && count[t])
			(void)wh_ply_add_element(
			    c, p, flat ? "normals of flat faces" : tag_names[t], count[t]);
	}
	wh_ply_find_meaning(p);
	return c->err.code;
}

static wh_code count_all(wh_ctx *c, const wh_exec *ex, wh_ply *p, job *j)
{
	uint64_t count[TAGS] = {0};
	j->coloured = wh_calloc(c, (size_t)j->lines->chunks, 1);
	if (!j->coloured || make_readers(c, j, ex->workers) != WH_OK ||
	    wh_exec_ordered(c, ex, j->lines->chunks, count_job, count_commit, j) != WH_OK)
		return wh_failed(c);
	for (int i = 0; i < ex->workers; i++)
		for (int t = 0; t < TAGS; t++)
			count[t] += j->readers[i].count[t];
	return describe(c, j, p, count);
}

wh_code wh_obj_look(wh_ctx *c, const wh_exec *ex, wh_ply *p, wh_obj *o)
{
	*o = (wh_obj){.lines = wh_lines_of(p, p->eol, true)};
	o->start = wh_calloc(c, (size_t)o->lines.chunks + 1, sizeof *o->start);
	job j = {.obj = o, .lines = &o->lines, .filled = o};
	const wh_code code = o->start ? count_all(c, ex, p, &j) : wh_failed(c);
	free_readers(c, &j, ex->workers);
	wh_free(c, j.coloured);
	if (code != WH_OK)
		wh_obj_free(c, o);
	return code;
}

void wh_obj_free(wh_ctx *c, wh_obj *o)
{
	wh_free(c, o->start);
	wh_names_free(c, &o->libraries);
	wh_names_free(c, &o->materials);
	wh_names_free(c, &o->groups);
	*o = (wh_obj){0};
}

uint64_t wh_obj_list_bytes(const wh_obj *o, int list)
{
	return o->start[o->lines.chunks].listed[list] * lists[list].width * sizeof(float);
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

static bool has_colours(const job *j)
{
	return j->colour[0] || j->colour[1] || j->colour[2];
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
	return has_colours(j) ? take_colour(c, j, r, s, r->records + at * size) : WH_OK;
}

/* "vt 0.5 0.25" or "vn 0 0 1": what is no number is 0, as is what no float holds. */
static wh_code list_line(wh_ctx *c, const job *j, reader *r, const char *s, int list, size_t at)
{
	const uint32_t width = lists[list].width;
	double **to = &r->value[list];
	if (wh_reserve(c, to, &r->value_cap[list], at + 1, width * sizeof **to) != WH_OK)
		return c->err.code;
	s = wh_word_end(s);
	for (size_t k = 0; k < width; k++) {
		double v = 0;
		s = wh_lines_word(j->lines, s);
		if (*s != j->lines->eol && *s != '#') {
			(void)wh_scan_real(s, &v);
			s = wh_word_end(s);
		}
		(*to)[width * at + k] = isfinite(wh_round_float(v)) ? v : 0;
	}
	return WH_OK;
}

/* As floats, to their own file. */
static wh_code put_list(wh_ctx *c, const job *j, reader *r, int list, uint64_t first, size_t n)
{
	const uint32_t width = lists[list].width;
	const double *from = r->value[list];
	unsigned char *to = (unsigned char *)r->value[list]; /* floats never overtake doubles */
	for (size_t i = 0; i < width * n; i++) {
		const float v = (float)from[i] + 0.0F; /* -0 is 0 */
		memcpy(to + sizeof v * i, &v, sizeof v);
	}
	return n == 0 ? WH_OK
	              : wh_spill_pwrite(c, j->rw->spill, j->list[list].vfd, to,
	                                width * sizeof(float) * n, width * sizeof(float) * first);
}

/* Which list the line at s belongs to, among those that are read; WH_OBJ_LISTS: none. */
static int list_of(const job *j, const char *s)
{
	int k = 0;
	while (k < WH_OBJ_LISTS && (j->list[k].vfd < 0 || !wh_lines_is(s, lists[k].word)))
		k++;
	return k;
}

static bool has_lines(const job *j, const wh_obj_start *start)
{
	bool any = start[1].vertices > start->vertices;
	for (int k = 0; k < WH_OBJ_LISTS; k++)
		any = any || (j->list[k].vfd >= 0 && start[1].listed[k] > start->listed[k]);
	return any;
}

static wh_code parse_vertices(wh_ctx *c, const job *j, reader *r, size_t *n,
                              size_t n_listed[WH_OBJ_LISTS])
{
	for (const char *s; (s = wh_lines_next(j->lines, &r->part)) != NULL;) {
		if (*s != 'v')
			continue;
		if (wh_is_blank(s[1])) {
			if (vertex_line(c, j, r, s, (*n)++) != WH_OK)
				return c->err.code;
			continue;
		}
		const int k = list_of(j, s);
		if (k < WH_OBJ_LISTS && list_line(c, j, r, s, k, n_listed[k]++) != WH_OK)
			return c->err.code;
	}
	return WH_OK;
}

static wh_code vertices_job(wh_ctx *c, void *arg, int64_t index, int worker)
{
	const job *j = arg;
	reader *r = &j->readers[worker];
	size_t n = 0, n_listed[WH_OBJ_LISTS] = {0};
	const wh_obj_start *start = &j->start[index];
	if (!has_lines(j, start))
		return WH_OK;
	if (wh_lines_load(c, j->lines, index, &r->part) != WH_OK ||
	    parse_vertices(c, j, r, &n, n_listed) != WH_OK)
		return c->err.code;
	if (wh_rewrite_heed(j->rw, r->told))
		return WH_E_IRREGULAR;
	for (int k = 0; k < WH_OBJ_LISTS; k++)
		if (put_list(c, j, r, k, start->listed[k], n_listed[k]) != WH_OK)
			return c->err.code;
	if (n == 0)
		return WH_OK;
	if (wh_rewrite_put_vertices(c, j->rw, start->vertices, r->xyz, n) != WH_OK)
		return c->err.code;
	return has_colours(j) ? wh_rewrite_put_attributes(c, j->rw, start->vertices, r->records, n)
	                      : WH_OK;
}

/* --- normals of vertices --- */

/* Normals that are the vertices' own come to their records; 0 where there are too few of them. */
static wh_code normals_job(wh_ctx *c, void *arg, int64_t index, int worker)
{
	const job *j = arg;
	reader *r = &j->readers[worker];
	const wh_source *from = &j->list[WH_OBJ_NORMALS];
	const size_t size = wh_rewrite_record(j->rw);
	const uint64_t nv = j->rw->source.nv, first = (uint64_t)index * WH_REWRITE_BATCH;
	const size_t n = wh_chunk_items(nv, index, WH_REWRITE_BATCH);
	const size_t told = from->nv <= first      ? 0
	                    : from->nv - first < n ? (size_t)(from->nv - first)
	                                           : n;
	if (wh_reserve(c, &r->xyz, &r->xyz_cap, 3 * n, sizeof *r->xyz) != WH_OK ||
	    wh_reserve(c, &r->records, &r->records_cap, n * size, 1) != WH_OK ||
	    wh_reserve(c, &r->carried, &r->carried_cap, wh_source_vertex_bytes(from, n), 1) !=
	        WH_OK ||
	    wh_source_vertices(c, from, first, told, r->xyz, r->carried) != WH_OK)
		return c->err.code;
	if (has_colours(j) && wh_spill_pread(c, j->rw->spill, j->rw->fd, r->records, n * size,
	                                     j->rw->source.abase + first * size) != WH_OK)
		return c->err.code;
	memset(r->xyz + 3 * told, 0, 3 * (n - told) * sizeof *r->xyz);
	for (size_t i = 0; i < n; i++)
		for (int k = 0; k < 3; k++)
			if (j->normal[k])
				wh_attribute_set(j->normal[k], r->records + i * size,
				                 r->xyz[3 * i + (size_t)k]);
	return wh_rewrite_put_attributes(c, j->rw, first, r->records, n);
}

static bool vertices_have_normals(const job *j)
{
	return j->normal[0] || j->normal[1] || j->normal[2];
}

static wh_code give_normals(wh_ctx *c, job *j)
{
	return vertices_have_normals(j)
	           ? wh_exec_for(c, j->rw->ex, wh_chunks(j->rw->source.nv, WH_REWRITE_BATCH),
	                         normals_job, j)
	           : WH_OK;
}

/* --- faces --- */

/* What the chunk has come to. */
typedef struct walk {
	wh_obj_start at;
	wh_facer *facer;
} walk;

/* What corners refer to, looked up; false: nothing that the file has. */
static wh_code look_up(wh_ctx *c, const job *j, reader *r, int list, uint64_t id, wh_vec3 *v,
                       bool *found)
{
	wh_positions *p = &r->listed[list];
	*found = id < j->list[list].nv;
	if (!*found)
		return WH_OK;
	if (!p->pages && wh_positions_open(c, p, &j->list[list], WH_POSITIONS_FEW) != WH_OK)
		return c->err.code;
	return wh_positions_get(c, p, id, v);
}

/* Puts corner i of a face into what it carries. */
static wh_code carry_corner(wh_ctx *c, const job *j, reader *r, const walk *k,
                            const wh_obj_corner *corner, size_t i)
{
	const wh_wedges *w = j->rw->wedges;
	const wh_attributes *a = &w->corner;
	const wh_obj_index index[WH_OBJ_LISTS] = {corner->texcoord, corner->normal};
	const uint32_t *const at[WH_OBJ_LISTS] = {a->texture, a->normal};
	if (wh_reserve(c, &r->carried, &r->carried_cap, (i + 1) * a->bytes, 1) != WH_OK)
		return c->err.code;
	uint8_t *to = r->carried + i * a->bytes;
	wh_wedges_no_corner(w, to);
	for (int list = 0; list < WH_OBJ_LISTS; list++) {
		const uint64_t id = wh_obj_index_id(index[list], k->at.listed[list]);
		wh_vec3 v = {0};
		bool found;
		if (list == WH_OBJ_TEXCOORDS ? !a->has_texture : !a->has_normal)
			continue;
		if (look_up(c, j, r, list, id, &v, &found) != WH_OK)
			return c->err.code;
		const double value[] = {v.x, v.y, v.z};
		for (uint32_t n = 0; found && n < lists[list].width && n < 3; n++)
			wh_attribute_set(&a->item[at[list][n]], to, value[n]);
	}
	return WH_OK;
}

/* Puts material and group behind the n corners. */
static wh_code carry_face(wh_ctx *c, const job *j, reader *r, const walk *k, size_t n)
{
	const wh_wedges *w = j->rw->wedges;
	if (wh_reserve(c, &r->carried, &r->carried_cap, n * w->corner.bytes + w->face.bytes, 1) !=
	    WH_OK)
		return c->err.code;
	for (uint32_t i = 0; i < w->face.n; i++) {
		const bool material = strcmp(w->face.item[i].name, "material") == 0;
		wh_attribute_set(&w->face.item[i], r->carried + n * w->corner.bytes,
		                 material ? k->at.material : k->at.group);
	}
	k->facer->carried = r->carried;
	return WH_OK;
}

static wh_code bad_corner(wh_ctx *c, const job *j, const reader *r, const char *s)
{
	const size_t n = (size_t)(wh_word_end(s) - s);
	return bad(c, j, r, s,
	           "the corner '%.*s' of a face is not one of the file's %" PRIu64
	           " vertices; remove such faces first",
	           n > 40 ? 40 : (int)n, s, j->rw->source.nv);
}

static wh_code face_line(wh_ctx *c, const job *j, reader *r, const char *s, const walk *k)
{
	const wh_lines *l = j->lines;
	wh_obj_corner corner;
	size_t n = 0;
	for (s = wh_lines_word(l, wh_word_end(s)); *s != l->eol && *s != '#';
	     s = wh_lines_word(l, wh_word_end(s))) {
		if (n == r->ids_cap &&
		    wh_reserve(c, &r->ids, &r->ids_cap, n + 1, sizeof *r->ids) != WH_OK)
			return c->err.code;
		if (!wh_obj_corner_scan(s, &corner))
			return bad_corner(c, j, r, s);
		r->ids[n] = wh_obj_index_id(corner.vertex, k->at.vertices);
		if (r->ids[n] >= j->rw->source.nv)
			return bad_corner(c, j, r, s);
		if (j->rw->wedges && carry_corner(c, j, r, k, &corner, n) != WH_OK)
			return c->err.code;
		n++;
	}
	if (j->rw->wedges && carry_face(c, j, r, k, n) != WH_OK)
		return c->err.code;
	return wh_facer_add(c, k->facer, r->ids, n);
}

static void change_label(const job *j, const reader *r, const char *s, tag t, walk *k)
{
	const named name = name_of(j, r, s, t);
	const wh_names *list = t == GROUP ? &j->obj->groups : &j->obj->materials;
	const uint32_t label = name.n ? wh_names_find(list, r->part.text + name.at, name.n) + 1 : 0;
	if (t == GROUP)
		k->at.group = label;
	else
		k->at.material = label;
}

static wh_code faces_job(wh_ctx *c, void *arg, int64_t index, int worker)
{
	const job *j = arg;
	reader *r = &j->readers[worker];
	walk k = {j->start[index], &j->rw->facers[worker]};
	if (wh_lines_load(c, j->lines, index, &r->part) != WH_OK)
		return c->err.code;
	for (const char *s; (s = wh_lines_next(j->lines, &r->part)) != NULL;) {
		if (*s == 'v') {
			k.at.vertices += wh_is_blank(s[1]);
			for (int i = 0; i < WH_OBJ_LISTS; i++)
				k.at.listed[i] += wh_lines_is(s, lists[i].word);
			continue;
		}
		const tag t = *s == 'f' || *s == 'g' || *s == 'o' || *s == 'u' ? tag_of(s) : OTHER;
		if (t == GROUP || t == MATERIAL)
			change_label(j, r, s, t, &k);
		else if (t == FACE && face_line(c, j, r, s, &k) != WH_OK)
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

/* A temporary file for each list that is carried. */
static wh_code open_lists(wh_ctx *c, job *j)
{
	const wh_wedges *w = j->rw->wedges;
	const bool read[WH_OBJ_LISTS] = {w && w->corner.has_texture,
	                                 (w && w->corner.has_normal) || vertices_have_normals(j)};
	for (int k = 0; k < WH_OBJ_LISTS; k++) {
		const uint32_t last = (lists[k].width - 1) * (uint32_t)sizeof(float);
		j->list[k] = (wh_source){.path = j->lines->file->path,
		                         .nv = j->start[j->lines->chunks].listed[k],
		                         .vfd = -1,
		                         .vstride = lists[k].width * sizeof(float),
		                         .voff = {0, sizeof(float), last},
		                         .vtype = {WH_F32, WH_F32, WH_F32}};
		if (read[k])
			j->list[k].vfd = wh_spill_scratch(c, j->rw->spill);
		if (read[k] && j->list[k].vfd < 0)
			return wh_failed(c);
	}
	return WH_OK;
}

static void close_lists(job *j)
{
	for (int k = 0; k < WH_OBJ_LISTS; k++)
		if (j->list[k].vfd >= 0)
			wh_spill_close_scratch(j->rw->spill, j->list[k].vfd);
}

wh_code wh_obj_rewrite(wh_ctx *c, wh_rewrite *rw, const wh_obj *o)
{
	const int64_t n = o->lines.chunks;
	job j = {.obj = o,
	         .lines = &o->lines,
	         .start = o->start,
	         .rw = rw,
	         .list = {{.vfd = -1}, {.vfd = -1}}};
	for (int k = 0; k < 3; k++) {
		const int normal = o->coloured ? 6 + k : 3 + k;
		j.colour[k] = o->coloured ? wh_attributes_find(rw->attributes, 3 + k) : NULL;
		j.normal[k] = o->normals == WH_OBJ_NORMALS_OF_VERTICES
		                  ? wh_attributes_find(rw->attributes, normal)
		                  : NULL;
	}
	wh_code code = make_readers(c, &j, rw->ex->workers);
	if (code == WH_OK)
		code = open_lists(c, &j);
	if (code == WH_OK)
		code = wh_exec_for(c, rw->ex, n, vertices_job, &j);
	if (code == WH_OK)
		code = give_normals(c, &j);
	if (code == WH_OK)
		code = wh_rewrite_start_faces(c, rw);
	if (code == WH_OK)
		code = wh_exec_ordered(c, rw->ex, n, faces_job, take_job, &j);
	free_readers(c, &j, rw->ex->workers);
	close_lists(&j);
	return code;
}
