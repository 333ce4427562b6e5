/* rply appears in this file alone. Its few KiB of memory are its own, from the C library. */
#define _GNU_SOURCE
#include "io/rply_read.h"

#ifdef WH_HAVE_RPLY

#include <fcntl.h>
#include <inttypes.h>
#include <rply.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

enum {
	BATCH = 4096,     /* vertices handed over at a time, of up to ... */
	RECORDS = 2 << 20 /* ... so many bytes of attributes */
};

/* Where a scalar of a vertex goes: 0, 1 and 2 are x, y and z; attributes come behind them. */
enum { AXES = 3 };

typedef struct reader {
	wh_ctx *c;
	const wh_ply *ply;
	const wh_attributes *attributes;
	const wh_rply_sink *sink;
	p_ply rply;
	size_t batch;
	double *xyz;
	uint8_t *records;
	uint64_t first; /* number of the first vertex in the batch */
	size_t n;       /* vertices in it */
	uint64_t *ids;  /* corners of the face at hand */
	size_t cap;
	bool faces_begun;
	char words[256]; /* of rply's failure */
} reader;

wh_code wh_rply_available(wh_ctx *c)
{
	(void)c;
	return WH_OK;
}

static void on_error(p_ply rply, const char *text)
{
	void *arg;
	if (!ply_get_ply_user_data(rply, &arg, NULL))
		return;
	reader *r = arg;
	(void)snprintf(r->words, sizeof r->words, "%s", text);
	r->words[strcspn(r->words, "\r\n")] = '\0';
}

static wh_code failed(reader *r)
{
	if (r->c->err.code != WH_OK)
		return r->c->err.code;
	return wh_fail(r->c, WH_E_INPUT, "'%s': rply cannot read it: %s", r->ply->path,
	               r->words[0] ? r->words : "it says no more");
}

/* ---- vertices ----------------------------------------------------------------------------- */

static wh_code hand_over(reader *r)
{
	const size_t n = r->n;
	if (n == 0)
		return WH_OK;
	r->first += n;
	r->n = 0;
	if (wh_poll(r->c) != WH_OK)
		return r->c->err.code;
	return r->sink->vertices(r->c, r->sink->arg, r->first - n, r->xyz, r->records, n);
}

/* One scalar of a vertex. rply calls back property by property, vertex by vertex: a vertex begins
 * with whichever of its scalars comes first. */
static int take_scalar(p_ply_argument a)
{
	void *arg;
	long place, item;
	(void)ply_get_argument_user_data(a, &arg, &place);
	(void)ply_get_argument_element(a, NULL, &item);
	reader *r = arg;
	const double v = ply_get_argument_value(a);
	if ((uint64_t)item >= r->first + r->batch && hand_over(r) != WH_OK)
		return 0;
	const size_t at = (size_t)((uint64_t)item - r->first);
	r->n = at + 1;
	if (place < AXES) {
		r->xyz[3 * at + (size_t)place] = v;
		return 1;
	}
	const wh_attribute *item_of = &r->attributes->item[place - AXES];
	wh_attribute_set(item_of, r->records + at * r->attributes->bytes, v);
	return 1;
}

static wh_code expect(reader *r, const wh_ply_elem *e, int prop, p_ply_read_cb call, long place)
{
	const long n = ply_set_read_cb(r->rply, e->name, e->props[prop].name, call, r, place);
	if ((uint64_t)n == e->count)
		return WH_OK;
	return wh_fail(r->c, WH_E_INPUT,
	               "'%s': rply finds %ld of element '%s' with '%s', where %" PRIu64 " are",
	               r->ply->path, n, e->name, e->props[prop].name, e->count);
}

static wh_code expect_vertices(reader *r)
{
	const wh_ply *p = r->ply;
	const wh_ply_elem *e = &p->elems[p->vertex];
	const int axis[AXES] = {p->x, p->y, p->z};
	if (e->count == 0)
		return WH_OK;
	for (int i = 0; i < AXES; i++)
		if (expect(r, e, axis[i], take_scalar, i) != WH_OK)
			return r->c->err.code;
	for (uint32_t i = 0; r->attributes && i < r->attributes->n; i++)
		if (expect(r, e, r->attributes->item[i].prop, take_scalar, AXES + (long)i) != WH_OK)
			return r->c->err.code;
	return WH_OK;
}

/* ---- faces -------------------------------------------------------------------------------- */

/* All vertices have come. */
static wh_code begin_faces(reader *r)
{
	r->faces_begun = true;
	if (hand_over(r) != WH_OK)
		return r->c->err.code;
	return r->sink->faces_next(r->c, r->sink->arg);
}

/* The length of a list, then its values. */
static int take_corner(p_ply_argument a)
{
	void *arg;
	long elem, item, length, at;
	(void)ply_get_argument_user_data(a, &arg, &elem);
	(void)ply_get_argument_element(a, NULL, &item);
	(void)ply_get_argument_property(a, NULL, &length, &at);
	reader *r = arg;
	if (!r->faces_begun && begin_faces(r) != WH_OK)
		return 0;
	if (at < 0) {
		if (length < 0 || (uint64_t)length > r->ply->size ||
		    wh_reserve(r->c, &r->ids, &r->cap, (size_t)length + 1, sizeof *r->ids) != WH_OK)
			return 0;
	} else {
		const double v = ply_get_argument_value(a);
		r->ids[at] = v < 0 ? (uint64_t)(int64_t)v : (uint64_t)v;
	}
	if (at + 1 < length)
		return 1;
	if (item % BATCH == 0 && wh_poll(r->c) != WH_OK)
		return 0;
	return r->sink->face(r->c, r->sink->arg, (int)elem, (uint64_t)item, r->ids,
	                     (size_t)(length > 0 ? length : 0)) == WH_OK;
}

static wh_code expect_faces(reader *r)
{
	const wh_ply *p = r->ply;
	const int elem[2] = {p->face, p->strips}, list[2] = {p->corners, p->strip_list};
	for (int i = 0; i < 2; i++)
		if (elem[i] >= 0 && p->elems[elem[i]].count > 0 &&
		    expect(r, &p->elems[elem[i]], list[i], take_corner, elem[i]) != WH_OK)
			return r->c->err.code;
	return WH_OK;
}

/* ---- all of it ---------------------------------------------------------------------------- */

/* A decompressed file has no name but this. */
static void name_file(const reader *r, char *name, size_t n)
{
	(void)snprintf(name, n, "/proc/self/fd/%d", r->ply->fd);
	if (access(name, R_OK) != 0)
		(void)snprintf(name, n, "%s", r->ply->path);
}

/* Goes through the file once, for vertices or for faces or for both. */
static wh_code go_through(reader *r, bool vertices, bool faces)
{
	char name[4096];
	name_file(r, name, sizeof name);
	r->rply = ply_open(name, on_error, 0, r);
	wh_code code = r->rply && ply_read_header(r->rply) ? WH_OK : failed(r);
	if (code == WH_OK && vertices)
		code = expect_vertices(r);
	if (code == WH_OK && faces)
		code = expect_faces(r);
	if (code == WH_OK && !ply_read(r->rply))
		code = failed(r);
	if (r->rply)
		(void)ply_close(r->rply);
	r->rply = NULL;
	return code;
}

static bool vertices_first(const wh_ply *p)
{
	return (p->face < 0 || p->face > p->vertex) && (p->strips < 0 || p->strips > p->vertex);
}

wh_code wh_rply_read(wh_ctx *c, const wh_ply *p, const wh_attributes *attributes,
                     const wh_rply_sink *sink)
{
	reader r = {.c = c, .ply = p, .attributes = attributes, .sink = sink, .batch = BATCH};
	const size_t record = attributes ? attributes->bytes : 0;
	if (record > RECORDS / BATCH)
		r.batch = RECORDS / record;
	r.xyz = wh_alloc(c, r.batch, 3 * sizeof *r.xyz);
	r.records = wh_alloc(c, r.batch, record);
	wh_code code = r.xyz && r.records ? WH_OK : wh_failed(c);
	if (code == WH_OK)
		code = go_through(&r, true, vertices_first(p));
	if (code == WH_OK && !r.faces_begun)
		code = begin_faces(&r);
	if (code == WH_OK && !vertices_first(p))
		code = go_through(&r, false, true);
	wh_free(c, r.ids);
	wh_free(c, r.records);
	wh_free(c, r.xyz);
	return code;
}

#else

wh_code wh_rply_available(wh_ctx *c)
{
	return wh_fail(c, WH_E_USAGE,
	               "the reader rply is not in this build, as there was no rply: install "
	               "rply.h and librply, configure again (-DCMAKE_PREFIX_PATH=... where they "
	               "are not in a usual place), or leave out --reader");
}

wh_code wh_rply_read(wh_ctx *c, const wh_ply *p, const wh_attributes *attributes,
                     const wh_rply_sink *sink)
{
	(void)p;
	(void)attributes;
	(void)sink;
	return wh_rply_available(c);
}

#endif
