/*
 * Which corners of a vertex each split turns.
 *
 * The corners of a vertex are listed in the file with the latest first: by falling numbers of their
 * faces, whatever happened to them. So its list before split j holds the corners that were ever
 * its own, of the faces with a number below the number of faces then, but those that were turned
 * away by a split before j. That is found vertex by vertex, without the mesh: all corners that a
 * vertex ever had are brought together by sorting, and its splits gone through in their order.
 *
 * Cost: three corners a face and some four a split are sorted twice; the corners of one vertex are
 * held.
 */
#include "pipeline/splits.h"

enum { PROGRESS = 1 << 16, CORNERS = 64 /* of a vertex, to begin with */ };

wh_code wh_splits_differ(wh_ctx *c)
{
	return wh_fail(c, WH_E_RUN,
	               "the collapses of the run do not lead to its result: the record of them in "
	               "the temporary folder is damaged");
}

/* ---- corners ------------------------------------------------------------------------------ */

static wh_code add_moved(wh_ctx *c, wh_splits_work *w, const wh_sequence_step *step,
                         const uint8_t *ids, uint32_t split)
{
	for (uint32_t i = 0; i < step->moved; i++) {
		uint32_t id;
		memcpy(&id, ids + 4 * (size_t)i, sizeof id);
		uint8_t *to = wh_runs_room(c, &w->moved);
		if (!to)
			return c->err.code;
		const uint64_t key = wh_splits_key(id, split);
		memcpy(to, &key, sizeof key);
		memcpy(to + sizeof key, &step->v, sizeof step->v);
	}
	return WH_OK;
}

/* Goes through the sequence once more: which split turns which face. */
static wh_code find_moved(wh_ctx *c, wh_splits_work *w, wh_sequence_reader *r)
{
	wh_sequence_step step;
	const uint8_t *numbers, *ids;
	bool more;
	for (;;) {
		if (wh_sequence_next(c, r, &step, &numbers, &ids, &more) != WH_OK || !more)
			return c->err.code;
		const uint8_t *place = wh_runs_next(c, &w->place);
		if (!place)
			return c->err.code ? c->err.code : wh_splits_differ(c);
		if (add_moved(c, w, &step, ids, (uint32_t)wh_runs_number(place)) != WH_OK)
			return c->err.code;
	}
}

static wh_code add_corner(wh_ctx *c, wh_splits_work *w, uint32_t vertex, uint32_t face,
                          uint32_t split)
{
	uint8_t *to = wh_runs_room(c, &w->corner);
	if (!to)
		return c->err.code;
	const uint64_t key = wh_splits_key(vertex, face);
	memcpy(to, &key, sizeof key);
	memcpy(to + sizeof key, &split, sizeof split);
	return WH_OK;
}

/* All corners of a face: its own, which are never turned away, and those that splits turn. *next:
 * the record of `moved` that is next. */
static wh_code add_face(wh_ctx *c, wh_splits_work *w, uint64_t face, const uint32_t corner[3],
                        const uint8_t **next)
{
	const uint32_t id = (uint32_t)(face >> 32), number = (uint32_t)face;
	for (int k = 0; k < 3; k++)
		if (add_corner(c, w, corner[k], number, WH_NONE) != WH_OK)
			return c->err.code;
	while (*next && wh_runs_number(*next) >> 32 == id) {
		uint32_t v;
		memcpy(&v, *next + sizeof(uint64_t), sizeof v);
		if (add_corner(c, w, v, number, (uint32_t)wh_runs_number(*next)) != WH_OK)
			return c->err.code;
		*next = wh_runs_next(c, &w->moved);
	}
	return c->err.code;
}

static wh_code add_faces(wh_ctx *c, wh_progress *progress, wh_splits_work *w, wh_sequence_reader *r)
{
	const uint8_t *next = wh_runs_next(c, &w->moved);
	for (uint64_t f = 0; f < w->in->faces && c->err.code == WH_OK; f++) {
		uint32_t corner[3];
		const uint8_t *face = wh_runs_next(c, &w->face);
		if (!face || wh_runs_number(face) >> 32 != f)
			return c->err.code ? c->err.code : wh_splits_differ(c);
		if (wh_sequence_corners(c, r, corner) != WH_OK ||
		    add_face(c, w, wh_runs_number(face), corner, &next) != WH_OK)
			return c->err.code;
		if (f % PROGRESS == 0)
			wh_progress_add(progress, PROGRESS);
	}
	if (c->err.code == WH_OK && next)
		return wh_splits_differ(c);
	return c->err.code;
}

wh_code wh_splits_find_corners(wh_ctx *c, wh_progress *progress, wh_splits_work *w)
{
	wh_sequence_reader steps = {.s = w->in->sequence},
	                   corners = {.s = w->in->sequence, .corners = true};
	wh_spill *spill = w->in->sequence->spill;
	wh_code code = wh_runs_open(c, &w->moved, spill, 12, w->share, w->turns);
	if (code == WH_OK)
		code = find_moved(c, w, &steps);
	wh_sequence_close(c, &steps);
	wh_runs_close(c, &w->place);
	if (code == WH_OK)
		code = wh_runs_end(c, &w->moved);
	if (code == WH_OK)
		code =
		    wh_runs_open(c, &w->corner, spill, 12, w->share, 3 * w->in->faces + w->turns);
	if (code == WH_OK)
		code = add_faces(c, progress, w, &corners);
	wh_sequence_close(c, &corners);
	wh_runs_close(c, &w->moved);
	wh_runs_close(c, &w->face);
	return code == WH_OK ? wh_runs_end(c, &w->corner) : code;
}

/* ---- a vertex ----------------------------------------------------------------------------- */

/* A corner that the vertex ever had. */
typedef struct corner {
	uint32_t face, split; /* numbers; the split that turns it away */
	uint32_t next;        /* in the list */
} corner;

/* A vertex while its splits are gone through. */
typedef struct vertex {
	uint32_t id, number;
	corner *corner; /* by rising numbers of faces */
	uint32_t n;
	size_t cap;
	uint32_t entered; /* of the corners: they are in the list, or were */
	uint32_t list;
} vertex;

/* Reads the corners of the vertex; *next: the record that is next. */
static wh_code gather(wh_ctx *c, wh_splits_work *w, vertex *v, const uint8_t **next)
{
	v->n = v->entered = 0;
	v->list = WH_NONE;
	while (*next && wh_runs_number(*next) >> 32 < v->id)
		*next = wh_runs_next(c, &w->corner);
	while (*next && wh_runs_number(*next) >> 32 == v->id) {
		uint32_t split;
		memcpy(&split, *next + sizeof(uint64_t), sizeof split);
		if (wh_reserve(c, &v->corner, &v->cap, (size_t)v->n + 1, sizeof *v->corner) !=
		    WH_OK)
			return c->err.code;
		v->corner[v->n++] = (corner){(uint32_t)wh_runs_number(*next), split, WH_NONE};
		*next = wh_runs_next(c, &w->corner);
	}
	return c->err.code;
}

/* Corners of the faces that there are now enter the list, the latest first. */
static void enter(vertex *v, uint32_t faces)
{
	for (; v->entered < v->n && v->corner[v->entered].face < faces; v->entered++) {
		v->corner[v->entered].next = v->list;
		v->list = v->entered;
	}
}

/* How many corners there are, and of them how many the split turns away. */
static uint32_t length(const vertex *v, uint32_t split, uint32_t *turned)
{
	uint32_t n = 0;
	*turned = 0;
	for (uint32_t i = v->list; i != WH_NONE; i = v->corner[i].next) {
		*turned += v->corner[i].split == split;
		n++;
	}
	return n;
}

/* Takes those that are turned away out of the list, and tells which they are. */
static void tell(wh_bits_out *b, vertex *v, uint32_t split, bool is_short)
{
	uint32_t stay = 0;
	for (uint32_t *link = &v->list; *link != WH_NONE;) {
		corner *k = &v->corner[*link];
		const bool turns = k->split == split;
		if (is_short)
			wh_bits_put(b, turns, 1);
		else if (turns)
			wh_bits_put_code(b, stay, 0);
		stay = turns ? 0 : stay + 1;
		if (turns)
			*link = k->next;
		else
			link = &k->next;
	}
}

static wh_code tell_fan(wh_ctx *c, wh_splits_work *w, vertex *v, uint32_t split, uint32_t faces)
{
	uint32_t turned;
	wh_bits_out *b = &w->bits;
	enter(v, faces);
	const uint32_t n = length(v, split, &turned);
	if (turned > WH_PMESH_MOVED)
		return wh_splits_differ(c);
	wh_bits_clear(b);
	if (wh_bits_reserve(c, b, (turned + 2) * (uint64_t)WH_BITS_MOST + WH_PMESH_SHORT) != WH_OK)
		return c->err.code;
	if (n > WH_PMESH_SHORT)
		wh_bits_put_code(b, turned, 0);
	tell(b, v, split, n <= WH_PMESH_SHORT);
	return WH_OK;
}

/* Where a long fan is in the file. */
static wh_code put_away(wh_ctx *c, wh_splits_work *w, uint64_t *at)
{
	wh_spill *spill = w->in->sequence->spill;
	const size_t n = (size_t)((w->bits.n + 7) / 8);
	if (w->fan_fd < 0 && (w->fan_fd = wh_spill_scratch(c, spill)) < 0)
		return wh_failed(c);
	*at = w->fan_bytes;
	w->fan_bytes += n;
	return wh_spill_pwrite(c, spill, w->fan_fd, w->bits.at, n, *at);
}

static wh_code answer(wh_ctx *c, wh_splits_work *w, vertex *v, uint32_t split,
                      wh_splits_asked asked)
{
	wh_splits_told told = {.number = v->number};
	if (asked.question == WH_SPLITS_FAN) {
		if (tell_fan(c, w, v, split, asked.faces) != WH_OK)
			return c->err.code;
		told.bits = (uint32_t)w->bits.n;
		if (told.bits <= 32)
			told.fan = wh_load32(w->bits.at, WH_HOST_BIG);
		else if (put_away(c, w, &told.fan) != WH_OK)
			return c->err.code;
	}
	uint8_t *to = wh_runs_room(c, &w->told);
	if (!to)
		return c->err.code;
	const uint64_t key = wh_splits_key(split, asked.question);
	memcpy(to, &key, sizeof key);
	memcpy(to + sizeof key, &told, sizeof told);
	return WH_OK;
}

/* The vertex of that id, with its number. */
static wh_code begin_vertex(wh_ctx *c, wh_splits_work *w, vertex *v, uint32_t id,
                            const uint8_t **next)
{
	const uint8_t *number;
	do
		number = wh_runs_next(c, &w->number);
	while (number && wh_runs_number(number) >> 32 < id);
	if (!number || wh_runs_number(number) >> 32 != id)
		return c->err.code ? c->err.code : wh_splits_differ(c);
	v->id = id;
	v->number = (uint32_t)wh_runs_number(number);
	return gather(c, w, v, next);
}

static wh_code answer_all(wh_ctx *c, wh_splits_work *w, vertex *v)
{
	const uint8_t *next = wh_runs_next(c, &w->corner), *ask;
	bool begun = false;
	while (c->err.code == WH_OK && (ask = wh_runs_next(c, &w->asked)) != NULL) {
		const uint64_t key = wh_runs_number(ask);
		wh_splits_asked asked;
		memcpy(&asked, ask + sizeof key, sizeof asked);
		if ((!begun || v->id != key >> 32) &&
		    begin_vertex(c, w, v, (uint32_t)(key >> 32), &next) != WH_OK)
			return c->err.code;
		begun = true;
		if (answer(c, w, v, (uint32_t)key, asked) != WH_OK)
			return c->err.code;
	}
	return c->err.code;
}

wh_code wh_splits_find_fans(wh_ctx *c, wh_splits_work *w)
{
	vertex v = {.corner = wh_alloc(c, CORNERS, sizeof *v.corner), .cap = CORNERS};
	if (!v.corner)
		return wh_failed(c);
	wh_code code =
	    wh_runs_open(c, &w->told, w->in->sequence->spill,
	                 sizeof(uint64_t) + sizeof(wh_splits_told), w->share, w->in->collapses);
	if (code == WH_OK)
		code = answer_all(c, w, &v);
	wh_free(c, v.corner);
	wh_runs_close(c, &w->number);
	wh_runs_close(c, &w->corner);
	wh_runs_close(c, &w->asked);
	return code == WH_OK ? wh_runs_end(c, &w->told) : code;
}
