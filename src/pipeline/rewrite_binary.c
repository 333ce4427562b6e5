/*
 * Binary bodies with lists. Where an item with a list ends is known only when its length was
 * read, so one pass hops from item to item through a large window and notes where every chunk of
 * about a MiB begins; then the chunks are decoded in parallel and their triangles appended in
 * order. Vertices of fixed size stay where they are; those with lists, a rarity, are written
 * during the hop. A list longer than a chunk (a strip of the whole mesh, a giant polygon) is
 * streamed by one worker, so that memory does not depend on it (what such a face carries is not
 * read).
 *
 * Cost: the file is read twice, memory is a chunk, its triangles and 16 bytes per MiB of faces.
 */
#include "pipeline/rewrite.h"

#include "io/ply_value.h"
#include "io/window.h"

#include <inttypes.h>
#include <stdio.h>

enum {
	CHUNK = 1 << 20,    /* bytes of faces decoded by one job */
	TAKE_FROM = 1 << 16 /* triangles of a streamed list written at a time */
};

/* --- how an element's items are laid out --- */

/* One list of an item and the scalars in front of it. */
typedef struct step {
	uint64_t skip; /* bytes of scalars */
	wh_type count_type;
	uint32_t item_size;
} step;

typedef struct layout {
	const wh_ply *ply;
	const wh_ply_elem *elem;
	step *steps; /* one for each list */
	size_t nsteps;
	uint64_t tail;   /* bytes of scalars behind the last list */
	int corner_step; /* the list of corners, or -1 */
	wh_type corner_type;
	bool swap;
} layout;

static wh_code layout_open(wh_ctx *c, layout *l, const wh_ply *p, int elem)
{
	const wh_ply_elem *e = &p->elems[elem];
	*l = (layout){.ply = p, .elem = e, .corner_step = -1};
	l->swap = (p->format == WH_PLY_BE) != (WH_HOST_BIG != 0);
	l->steps = wh_alloc(c, e->nprops, sizeof *l->steps);
	if (!l->steps)
		return c->err.code;
	for (size_t i = 0; i < e->nprops; i++) {
		const wh_ply_prop *q = &e->props[i];
		if (!q->is_list) {
			l->tail += wh_type_size(q->type);
			continue;
		}
		if ((int)i == wh_corner_list(p, elem)) {
			l->corner_step = (int)l->nsteps;
			l->corner_type = q->type;
		}
		l->steps[l->nsteps++] = (step){l->tail, q->count_type, wh_type_size(q->type)};
		l->tail = 0;
	}
	return WH_OK;
}

static void layout_close(wh_ctx *c, layout *l)
{
	wh_free(c, l->steps);
	l->steps = NULL;
}

/* --- hopping --- */

typedef struct list {
	uint64_t at; /* offset of its first value */
	uint64_t n;
} list;

static wh_code cut_short(wh_ctx *c, const layout *l, uint64_t item)
{
	return wh_fail(c, WH_E_INPUT,
	               "'%s' ends inside item %" PRIu64 " of element '%s' (the header says %" PRIu64
	               "): it is cut short at byte %" PRIu64,
	               l->ply->path, item, l->elem->name, l->elem->count, l->ply->size);
}

static wh_code bad_length(wh_ctx *c, const layout *l, uint64_t item, uint64_t at, uint64_t n)
{
	return wh_fail(c, WH_E_INPUT,
	               "'%s', item %" PRIu64 " of element '%s' (byte %" PRIu64
	               "): a list of %" PRId64
	               " values does not fit into the rest of the file; it is cut short or damaged",
	               l->ply->path, item, l->elem->name, at, (int64_t)n);
}

/* Moves *at over one item; tells where its list of corners is. */
static inline wh_code hop(wh_ctx *c, const layout *l, wh_window *w, uint64_t item, uint64_t *at,
                          list *corners)
{
	uint64_t pos = *at;
	for (size_t i = 0; i < l->nsteps; i++) {
		const step *s = &l->steps[i];
		const uint32_t size = wh_type_size(s->count_type);
		if (w->size - pos < s->skip + size)
			return cut_short(c, l, item);
		pos += s->skip;
		const unsigned char *p = wh_window_at(c, w, pos, size);
		if (!p)
			return c->err.code;
		const uint64_t n = wh_load_integer(p, s->count_type, l->swap);
		pos += size;
		if (n > (w->size - pos) / s->item_size)
			return bad_length(c, l, item, pos - size, n);
		if ((int)i == l->corner_step)
			*corners = (list){pos, n};
		pos += n * s->item_size;
	}
	if (w->size - pos < l->tail)
		return cut_short(c, l, item);
	*at = pos + l->tail;
	return WH_OK;
}

static wh_code hop_all(wh_ctx *c, const layout *l, wh_window *w, uint64_t *at)
{
	list corners;
	for (uint64_t i = 0; i < l->elem->count; i++)
		if (hop(c, l, w, i, at, &corners) != WH_OK)
			return c->err.code;
	return WH_OK;
}

/* --- vertices that hold lists --- */

/* Vertices on their way to the temporary file. */
typedef struct batch {
	double *xyz;
	uint8_t *records; /* of their attributes */
} batch;

/* Takes scalar number `prop` of a vertex, if it is anything that is wanted. */
static void take_scalar(const wh_rewrite *rw, const layout *l, int prop, const unsigned char *p,
                        const batch *b, size_t i)
{
	const wh_ply *ply = rw->ply;
	const int axis = prop == ply->x ? 0 : prop == ply->y ? 1 : prop == ply->z ? 2 : -1;
	const wh_attribute *a = axis < 0 ? wh_attributes_find(rw->attributes, prop) : NULL;
	if (axis >= 0)
		b->xyz[3 * i + (size_t)axis] = wh_load_real(p, l->elem->props[prop].type, l->swap);
	if (a)
		wh_attribute_load(a, p, l->swap, b->records + i * rw->attributes->bytes);
}

/* Reads the scalars of the item at `at`, which was hopped over: they lie between lists. */
static wh_code read_vertex(wh_ctx *c, const wh_rewrite *rw, const layout *l, wh_window *w,
                           uint64_t at, const batch *b, size_t i)
{
	for (int k = 0; k < (int)l->elem->nprops; k++) {
		const wh_ply_prop *q = &l->elem->props[k];
		const uint32_t size = wh_type_size(q->is_list ? q->count_type : q->type);
		const unsigned char *p = wh_window_at(c, w, at, size);
		if (!p)
			return c->err.code;
		at += size;
		if (q->is_list)
			at += wh_load_integer(p, q->count_type, l->swap) * wh_type_size(q->type);
		else
			take_scalar(rw, l, k, p, b, i);
	}
	return WH_OK;
}

static wh_code read_batch(wh_ctx *c, wh_rewrite *rw, const layout *l, wh_window *w, uint64_t *at,
                          uint64_t first, size_t n, const batch *b)
{
	list none;
	for (size_t i = 0; i < n; i++) {
		const uint64_t start = *at;
		if (hop(c, l, w, first + i, at, &none) != WH_OK ||
		    read_vertex(c, rw, l, w, start, b, i) != WH_OK)
			return c->err.code;
	}
	if (wh_rewrite_put_vertices(c, rw, first, b->xyz, n) != WH_OK)
		return c->err.code;
	return wh_rewrite_put_attributes(c, rw, first, b->records, n);
}

static wh_code write_vertices(wh_ctx *c, wh_rewrite *rw, const layout *l, wh_window *w,
                              uint64_t *at)
{
	wh_code code = WH_OK;
	const size_t most = wh_rewrite_batch(rw);
	batch b = {.xyz = wh_alloc(c, most, 3 * sizeof *b.xyz),
	           .records = wh_alloc(c, most, wh_rewrite_record(rw))};
	if (!b.xyz || !b.records)
		code = c->err.code;
	for (uint64_t i = 0; i < l->elem->count && code == WH_OK; i += most) {
		const uint64_t left = l->elem->count - i;
		const size_t n = left < most ? (size_t)left : most;
		code = read_batch(c, rw, l, w, at, i, n, &b);
	}
	wh_free(c, b.records);
	wh_free(c, b.xyz);
	return code;
}

/* --- the index of face chunks --- */

typedef struct mark {
	uint64_t at;   /* offset of the chunk's first item */
	uint64_t item; /* its number */
} mark;

typedef struct faces {
	wh_rewrite *rw;
	layout l;
	mark *marks; /* of all chunks, and one more for the end */
	size_t nmarks;
	size_t cap;
	struct worker {
		unsigned char *bytes; /* of the chunk */
		uint64_t *ids;        /* corners of the face at hand */
		size_t ids_cap;
		uint8_t *carried; /* what it and they carry */
		size_t carried_cap;
	} * workers;
} faces;

static wh_code add_mark(wh_ctx *c, faces *f, uint64_t at, uint64_t item)
{
	if (wh_reserve(c, &f->marks, &f->cap, f->nmarks + 1, sizeof *f->marks) != WH_OK)
		return c->err.code;
	f->marks[f->nmarks++] = (mark){at, item};
	return WH_OK;
}

/* An item larger than a chunk becomes a chunk of its own. */
static wh_code index_faces(wh_ctx *c, faces *f, wh_window *w, uint64_t *at)
{
	list corners;
	uint64_t chunk = *at;
	if (add_mark(c, f, *at, 0) != WH_OK)
		return c->err.code;
	for (uint64_t i = 0; i < f->l.elem->count; i++) {
		const uint64_t start = *at;
		if (hop(c, &f->l, w, i, at, &corners) != WH_OK)
			return c->err.code;
		if (*at - chunk > CHUNK && start > chunk) {
			chunk = start;
			if (add_mark(c, f, start, i) != WH_OK)
				return c->err.code;
		}
	}
	return add_mark(c, f, *at, f->l.elem->count);
}

/* --- chunks in memory --- */

static wh_code changed_meanwhile(wh_ctx *c, const layout *l)
{
	return wh_fail(c, WH_E_RUN, "'%s' was changed while it was read", l->ply->path);
}

static void place_byte(char place[40], uint64_t at)
{
	(void)snprintf(place, 40, "byte %" PRIu64, at);
}

/* Reads n corners at p. */
static wh_code load_corners(wh_ctx *c, faces *f, struct worker *k, const unsigned char *p,
                            uint64_t n, uint64_t item, uint64_t at)
{
	const layout *l = &f->l;
	const uint64_t nv = f->rw->source.nv;
	const uint32_t size = wh_type_size(l->corner_type);
	if (wh_reserve(c, &k->ids, &k->ids_cap, (size_t)n, sizeof *k->ids) != WH_OK)
		return c->err.code;
	for (size_t i = 0; i < n; i++) {
		k->ids[i] = wh_load_integer(p + i * size, l->corner_type, l->swap);
		if (k->ids[i] >= nv) {
			char place[40];
			place_byte(place, at + i * size);
			return wh_rewrite_bad_index(c, f->rw, l->elem, item, k->ids[i], place);
		}
	}
	return WH_OK;
}

/* Texture coordinates of corners, from a list of so many values that is known to be whole. */
static void load_texcoords(const faces *f, const unsigned char *p, uint64_t values,
                           uint8_t *carried)
{
	const wh_wedges *w = f->rw->wedges;
	const uint32_t size = wh_type_size(w->corner.item[0].type);
	for (uint64_t i = 0; i < values; i++, p += size)
		wh_attribute_load(&w->corner.item[i % 2], p, f->l.swap,
		                  carried + i / 2 * w->corner.bytes);
}

static wh_code bad_texcoords(wh_ctx *c, const faces *f, uint64_t item, uint64_t values, uint64_t n,
                             uint64_t at)
{
	char place[40];
	place_byte(place, at);
	return wh_rewrite_bad_texcoords(c, f->rw, f->l.elem, item, values, n, place);
}

/* What the face of n corners at p carries, which is known to be whole. `at` is p's offset. */
static wh_code load_carried(wh_ctx *c, const faces *f, struct worker *k, wh_facer *facer,
                            const unsigned char *p, uint64_t n, uint64_t item, uint64_t at)
{
	const unsigned char *const start = p;
	const wh_wedges *w = f->rw->wedges;
	uint8_t *to = wh_rewrite_carried(c, f->rw, &k->carried, &k->carried_cap, (size_t)n);
	if (!to)
		return c->err.code;
	uint8_t *record = to + (size_t)n * w->corner.bytes;
	facer->carried = to;
	for (int i = 0; i < (int)f->l.elem->nprops; i++) {
		const wh_ply_prop *q = &f->l.elem->props[i];
		const wh_attribute *a = q->is_list ? NULL : wh_attributes_find(&w->face, i);
		uint64_t values = 1;
		if (q->is_list) {
			values = wh_load_integer(p, q->count_type, f->l.swap);
			p += wh_type_size(q->count_type);
		}
		if (i == w->list && !wh_is_texcoords(values, n))
			return bad_texcoords(c, f, item, values, n, at + (uint64_t)(p - start));
		if (i == w->list)
			load_texcoords(f, p, values, to);
		if (a)
			wh_attribute_load(a, p, f->l.swap, record);
		p += values * wh_type_size(q->type);
	}
	return WH_OK;
}

/* Decodes the item at p; *used tells its bytes. The chunk ends at `end`. `at` is p's offset. */
static wh_code decode_face(wh_ctx *c, faces *f, struct worker *k, wh_facer *facer,
                           const unsigned char *p, const unsigned char *end, uint64_t item,
                           uint64_t at, size_t *used)
{
	const unsigned char *const start = p;
	uint64_t corners = 0;
	for (size_t i = 0; i < f->l.nsteps; i++) {
		const step *s = &f->l.steps[i];
		const uint32_t size = wh_type_size(s->count_type);
		if ((uint64_t)(end - p) < s->skip + size)
			return changed_meanwhile(c, &f->l);
		p += s->skip;
		const uint64_t n = wh_load_integer(p, s->count_type, f->l.swap);
		p += size;
		if (n > (uint64_t)(end - p) / s->item_size)
			return changed_meanwhile(c, &f->l);
		if ((int)i == f->l.corner_step) {
			corners = n;
			if (load_corners(c, f, k, p, n, item, at + (uint64_t)(p - start)) != WH_OK)
				return c->err.code;
		}
		p += n * s->item_size;
	}
	if ((uint64_t)(end - p) < f->l.tail)
		return changed_meanwhile(c, &f->l);
	*used = (size_t)(p - start) + (size_t)f->l.tail;
	if (f->rw->wedges && load_carried(c, f, k, facer, start, corners, item, at) != WH_OK)
		return c->err.code;
	return wh_facer_add(c, facer, k->ids, (size_t)corners);
}

static bool is_oversize(const faces *f, int64_t index)
{
	return f->marks[index + 1].at - f->marks[index].at > CHUNK;
}

static wh_code decode_chunk(wh_ctx *c, void *arg, int64_t index, int worker)
{
	faces *f = arg;
	struct worker *k = &f->workers[worker];
	const mark m = f->marks[index];
	const size_t n = (size_t)(f->marks[index + 1].at - m.at);
	if (is_oversize(f, index))
		return WH_OK; /* streamed when its turn comes */
	if (!k->bytes && !(k->bytes = wh_alloc(c, CHUNK, 1)))
		return c->err.code;
	if (wh_ply_pread(c, f->rw->ply->path, f->rw->ply->fd, k->bytes, n, m.at) != WH_OK)
		return c->err.code;
	size_t at = 0;
	for (uint64_t i = m.item; i < f->marks[index + 1].item; i++) {
		size_t used = 0;
		if (decode_face(c, f, k, &f->rw->facers[worker], k->bytes + at, k->bytes + n, i,
		                m.at + at, &used) != WH_OK)
			return c->err.code;
		at += used;
	}
	return WH_OK;
}

/* --- lists that are streamed --- */

typedef struct stream {
	wh_rewrite *rw;
	wh_window *w;
	const layout *l;
	list values;
	uint64_t item; /* of the element, for messages */
	wh_facer *facer;
} stream;

static wh_code stream_value(wh_ctx *c, const stream *s, uint64_t i, uint64_t *id)
{
	const uint32_t size = wh_type_size(s->l->corner_type);
	const unsigned char *p = wh_window_at(c, s->w, s->values.at + i * size, size);
	if (!p)
		return c->err.code;
	*id = wh_load_integer(p, s->l->corner_type, s->l->swap);
	return WH_OK;
}

static wh_code stream_bad_index(wh_ctx *c, const stream *s, uint64_t i, uint64_t id)
{
	char place[40];
	place_byte(place, s->values.at + i * wh_type_size(s->l->corner_type));
	return wh_rewrite_bad_index(c, s->rw, s->l->elem, s->item, id, place);
}

static wh_code take_when_full(wh_ctx *c, const stream *s)
{
	return s->facer->out_n < TAKE_FROM ? WH_OK : wh_rewrite_take(c, s->rw, s->facer);
}

static wh_code stream_strip(wh_ctx *c, const stream *s)
{
	wh_facer_strip_start(s->facer);
	for (uint64_t i = 0; i < s->values.n; i++) {
		uint64_t id = 0;
		if (stream_value(c, s, i, &id) != WH_OK)
			return c->err.code;
		if (id >= s->rw->source.nv) {
			if (!wh_is_restart(id, s->l->corner_type))
				return stream_bad_index(c, s, i, id);
			wh_facer_strip_start(s->facer);
		} else if (wh_facer_strip_corner(c, s->facer, id) != WH_OK ||
		           take_when_full(c, s) != WH_OK) {
			return c->err.code;
		}
	}
	return WH_OK;
}

/* The smallest corner of a list, all of them in range; UINT64_MAX for an empty list. */
static wh_code stream_smallest(wh_ctx *c, const stream *s, uint64_t *tip)
{
	*tip = UINT64_MAX;
	for (uint64_t i = 0; i < s->values.n; i++) {
		uint64_t id = 0;
		if (stream_value(c, s, i, &id) != WH_OK)
			return c->err.code;
		if (id >= s->rw->source.nv)
			return stream_bad_index(c, s, i, id);
		*tip = id < *tip ? id : *tip;
	}
	return WH_OK;
}

/* A list short enough to be cut like any polygon, in an item that is long for other reasons. */
static wh_code stream_polygon(wh_ctx *c, const stream *s)
{
	uint64_t *ids = wh_alloc(c, WH_POLYGON_MOST, sizeof *ids);
	wh_code code = ids ? WH_OK : wh_failed(c);
	for (uint64_t i = 0; code == WH_OK && i < s->values.n; i++) {
		code = stream_value(c, s, i, &ids[i]);
		if (code == WH_OK && ids[i] >= s->rw->source.nv)
			code = stream_bad_index(c, s, i, ids[i]);
	}
	if (code == WH_OK)
		code = wh_facer_add(c, s->facer, ids, (size_t)s->values.n);
	wh_free(c, ids);
	return code;
}

/* The same fan that a facer makes of a large polygon in memory. */
static wh_code stream_fan(wh_ctx *c, const stream *s)
{
	uint64_t tip, last = 0, id = 0;
	const uint64_t before = s->rw->source.nf + s->facer->out_n;
	if (stream_smallest(c, s, &tip) != WH_OK)
		return wh_failed(c);
	if (stream_value(c, s, s->values.n - 1, &last) != WH_OK)
		return c->err.code;
	for (uint64_t i = 0; i < s->values.n; i++, last = id) {
		if (stream_value(c, s, i, &id) != WH_OK ||
		    wh_facer_put(c, s->facer, tip, last, id) != WH_OK ||
		    take_when_full(c, s) != WH_OK)
			return c->err.code;
	}
	s->facer->polygons += s->values.n > 3;
	s->facer->degenerate += s->rw->source.nf + s->facer->out_n == before;
	return WH_OK;
}

static wh_code stream_face(wh_ctx *c, faces *f, const mark *m, wh_facer *facer)
{
	wh_window w;
	list corners = {0};
	uint64_t at = m->at;
	wh_code code = wh_window_open(c, &w, f->rw->ply->path, f->rw->ply->fd, f->rw->ply->size);
	if (code == WH_OK)
		code = hop(c, &f->l, &w, m->item, &at, &corners);
	if (code == WH_OK) {
		const stream s = {f->rw, &w, &f->l, corners, m->item, facer};
		code = corners.n <= WH_POLYGON_MOST ? stream_polygon(c, &s) : stream_fan(c, &s);
	}
	wh_window_close(c, &w);
	return code;
}

static wh_code commit_chunk(wh_ctx *c, void *arg, int64_t index, int worker)
{
	faces *f = arg;
	wh_facer *facer = &f->rw->facers[worker];
	facer->carried = NULL;
	if (is_oversize(f, index) && stream_face(c, f, &f->marks[index], facer) != WH_OK)
		return c->err.code;
	return wh_rewrite_take(c, f->rw, facer);
}

/* --- elements --- */

static wh_code rewrite_faces(wh_ctx *c, wh_rewrite *rw, wh_window *w, int elem, uint64_t at)
{
	faces f = {.rw = rw};
	f.workers = wh_calloc(c, (size_t)rw->ex->workers, sizeof *f.workers);
	wh_code code = f.workers ? layout_open(c, &f.l, rw->ply, elem) : c->err.code;
	if (code == WH_OK)
		code = index_faces(c, &f, w, &at);
	if (code == WH_OK)
		code = wh_exec_ordered(c, rw->ex, (int64_t)f.nmarks - 1, decode_chunk, commit_chunk,
		                       &f);
	for (int i = 0; f.workers && i < rw->ex->workers; i++) {
		wh_free(c, f.workers[i].bytes);
		wh_free(c, f.workers[i].ids);
		wh_free(c, f.workers[i].carried);
	}
	wh_free(c, f.marks);
	layout_close(c, &f.l);
	wh_free(c, f.workers);
	return code;
}

static wh_code rewrite_strips(wh_ctx *c, wh_rewrite *rw, wh_window *w, int elem, uint64_t at)
{
	layout l;
	wh_facer *facer = &rw->facers[0];
	wh_code code = layout_open(c, &l, rw->ply, elem);
	for (uint64_t i = 0; code == WH_OK && i < l.elem->count; i++) {
		list corners = {0};
		code = hop(c, &l, w, i, &at, &corners);
		const stream s = {rw, w, &l, corners, i, facer};
		if (code == WH_OK)
			code = stream_strip(c, &s);
	}
	layout_close(c, &l);
	return code == WH_OK ? wh_rewrite_take(c, rw, facer) : code;
}

/* Moves *at over element `elem`, writing its vertices on the way when they hold lists. */
static wh_code pass_element(wh_ctx *c, wh_rewrite *rw, wh_window *w, int elem, uint64_t *at)
{
	const wh_ply_elem *e = &rw->ply->elems[elem];
	if (e->stride > 0 || e->nprops == 0) {
		if (elem == rw->ply->vertex)
			wh_rewrite_vertices_in_place(rw, *at);
		if (e->count > 0 && e->stride > (w->size - *at) / e->count)
			return wh_fail(c, WH_E_INPUT,
			               "'%s' ends at item %" PRIu64 " of element '%s' (the header "
			               "says %" PRIu64 "): it is cut short",
			               w->path, (w->size - *at) / e->stride, e->name, e->count);
		*at += e->count * e->stride;
		return WH_OK;
	}
	layout l;
	wh_code code = layout_open(c, &l, rw->ply, elem);
	if (code == WH_OK)
		code = elem == rw->ply->vertex ? write_vertices(c, rw, &l, w, at)
		                               : hop_all(c, &l, w, at);
	layout_close(c, &l);
	return code;
}

/* Finds where the elements begin, up to the last that we need; vertices are ready behind it. */
static wh_code locate(wh_ctx *c, wh_rewrite *rw, wh_window *w, uint64_t *start, int last)
{
	uint64_t at = rw->ply->body;
	for (int i = 0; i <= last; i++) {
		start[i] = at;
		/* what is behind the last element does not matter */
		const bool skip = i == last && i != rw->ply->vertex;
		if (!skip && pass_element(c, rw, w, i, &at) != WH_OK)
			return c->err.code;
	}
	return WH_OK;
}

static wh_code rewrite_all(wh_ctx *c, wh_rewrite *rw, wh_window *w, uint64_t *start, int last)
{
	if (locate(c, rw, w, start, last) != WH_OK || wh_rewrite_start_faces(c, rw) != WH_OK)
		return c->err.code;
	for (int i = 0; i <= last; i++) {
		if (i == rw->ply->face && rewrite_faces(c, rw, w, i, start[i]) != WH_OK)
			return c->err.code;
		if (i == rw->ply->strips && rewrite_strips(c, rw, w, i, start[i]) != WH_OK)
			return c->err.code;
	}
	return WH_OK;
}

wh_code wh_rewrite_binary(wh_ctx *c, wh_rewrite *rw)
{
	const wh_ply *p = rw->ply;
	const int faces_last = p->face > p->strips ? p->face : p->strips;
	const int last = faces_last > p->vertex ? faces_last : p->vertex;
	wh_window w;
	uint64_t *start = wh_alloc(c, p->nelems, sizeof *start);
	if (!start)
		return c->err.code;
	wh_code code = wh_window_open(c, &w, p->path, p->fd, p->size);
	if (code == WH_OK)
		code = rewrite_all(c, rw, &w, start, last);
	wh_window_close(c, &w);
	wh_free(c, start);
	return code;
}
