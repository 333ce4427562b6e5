/*
 * Streaming a synthetic surface to a PLY file: chunks of vertices, then chunks of faces, filled
 * by the workers and written in order. Colours and normals make this a writer of its own.
 *
 * Coordinates are integers times 2^-10, so that text holds them exactly in at most ten digits
 * after the point, without the C library's printing.
 */
#include "algo/synth_internal.h"
#include "io/outfile.h"

#include <stdio.h>
#include <string.h>

enum {
	CHUNK = 16384, /* elements: some hundred KiB, a few milliseconds */
	HEADER_MAX = 1024,
	REAL_TEXT_MAX = 32,                  /* sign, 13 digits, point, 10 digits, blank */
	ITEM_MAX = 6 * REAL_TEXT_MAX + 3 * 4 /* bytes of one element at most, as text */
};

typedef struct writer {
	const wh_synth *s;
	struct wh_outfile *out;
	bool faces;            /* or vertices */
	uint64_t n;            /* elements in all */
	synth_cursor *cursor;  /* per worker */
	unsigned char *buffer; /* CHUNK * ITEM_MAX per worker */
	size_t *used;          /* bytes, per worker */
	int64_t offset[3];     /* in units of 2^-10 */
} writer;

/* ---- scalars: each returns the end of what it wrote ---- */

static unsigned char *put32(unsigned char *p, uint32_t v)
{
	for (int i = 0; i < 4; i++)
		p[i] = (unsigned char)(v >> 8 * i);
	return p + 4;
}

static unsigned char *put_float(unsigned char *p, float x)
{
	uint32_t v;
	memcpy(&v, &x, sizeof v);
	return put32(p, v);
}

static unsigned char *put_double(unsigned char *p, double x)
{
	uint64_t v;
	memcpy(&v, &x, sizeof v);
	return put32(put32(p, (uint32_t)v), (uint32_t)(v >> 32));
}

static unsigned char *put_digits(unsigned char *p, uint64_t v, int least)
{
	unsigned char digits[20];
	int n = 0;
	for (; v || n < least; v /= 10)
		digits[n++] = (unsigned char)('0' + v % 10);
	while (n)
		*p++ = digits[--n];
	return p;
}

static unsigned char *put_sign(unsigned char *p, int64_t v)
{
	if (v < 0)
		*p++ = '-';
	return p;
}

static uint64_t magnitude(int64_t v)
{
	return v < 0 ? (uint64_t)-v : (uint64_t)v;
}

/* v / scale, where `digits` digits after the point hold every fraction times `unit`. */
static unsigned char *put_fraction(unsigned char *p, int64_t v, uint64_t scale, uint64_t unit,
                                   int digits)
{
	const uint64_t m = magnitude(v);
	p = put_digits(put_sign(p, v), m / scale, 1);
	if (m % scale == 0)
		return p;
	*p++ = '.';
	p = put_digits(p, m % scale * unit, digits);
	while (p[-1] == '0')
		p--;
	return p;
}

static unsigned char *put_fixed_text(unsigned char *p, int64_t v)
{
	return put_fraction(p, v, 1024, 9765625, 10);
}

/* A number in [-1, 1] with six digits. */
static unsigned char *put_unit_text(unsigned char *p, double x)
{
	const int64_t v = (int64_t)(x * 1e6 + (x < 0.0 ? -0.5 : 0.5));
	return put_fraction(p, v, 1000000, 1, 6);
}

/* ---- elements ---- */

static unsigned char *put_vertex(const writer *w, unsigned char *p, const synth_vertex *v)
{
	const wh_synth_params *o = &w->s->p;
	for (int i = 0; i < 3; i++) {
		const double x = (double)(v->fixed[i] + w->offset[i]) * 0x1p-10;
		p = o->is_double ? put_double(p, x) : put_float(p, (float)x);
	}
	for (int i = 0; o->normals && i < 3; i++)
		p = put_float(p, (float)v->normal[i]);
	for (int i = 0; o->colors && i < 3; i++)
		*p++ = v->color[i];
	return p;
}

static unsigned char *put_vertex_text(const writer *w, unsigned char *p, const synth_vertex *v)
{
	const wh_synth_params *o = &w->s->p;
	for (int i = 0; i < 3; i++) {
		p = put_fixed_text(p, v->fixed[i] + w->offset[i]);
		*p++ = ' ';
	}
	for (int i = 0; o->normals && i < 3; i++) {
		p = put_unit_text(p, v->normal[i]);
		*p++ = ' ';
	}
	for (int i = 0; o->colors && i < 3; i++) {
		p = put_digits(p, v->color[i], 1);
		*p++ = ' ';
	}
	p[-1] = '\n';
	return p;
}

static unsigned char *put_face(const writer *w, unsigned char *p, const uint64_t ids[3])
{
	if (!w->s->p.ascii) {
		*p++ = 3;
		for (int i = 0; i < 3; i++)
			p = put32(p, (uint32_t)ids[i]);
		return p;
	}
	*p++ = '3';
	for (int i = 0; i < 3; i++) {
		*p++ = ' ';
		p = put_digits(p, ids[i], 1);
	}
	*p++ = '\n';
	return p;
}

/* ---- chunks ---- */

static wh_code fill_chunk(wh_ctx *c, void *arg, int64_t index, int worker)
{
	writer *w = arg;
	(void)c;
	const uint64_t first = (uint64_t)index * CHUNK;
	const uint64_t end = first + CHUNK < w->n ? first + CHUNK : w->n;
	unsigned char *const start = w->buffer + (size_t)worker * CHUNK * ITEM_MAX;
	unsigned char *p = start;
	synth_cursor *k = &w->cursor[worker];
	for (uint64_t i = first; i < end; i++) {
		if (w->faces) {
			uint64_t ids[3];
			synth_face_at(w->s, i, k, ids);
			p = put_face(w, p, ids);
			continue;
		}
		synth_vertex v;
		synth_vertex_at(w->s, i, k, &v);
		p = w->s->p.ascii ? put_vertex_text(w, p, &v) : put_vertex(w, p, &v);
	}
	w->used[worker] = (size_t)(p - start);
	return WH_OK;
}

static wh_code write_chunk(wh_ctx *c, void *arg, int64_t index, int worker)
{
	writer *w = arg;
	(void)index;
	return wh_outfile_write(c, w->out, w->buffer + (size_t)worker * CHUNK * ITEM_MAX,
	                        w->used[worker]);
}

static wh_code write_elements(wh_ctx *c, const wh_exec *ex, writer *w, bool faces)
{
	w->faces = faces;
	w->n = faces ? 2 * w->s->ncells : w->s->nv;
	const int64_t chunks = (int64_t)((w->n + CHUNK - 1) / CHUNK);
	return wh_exec_ordered(c, ex, chunks, fill_chunk, write_chunk, w);
}

static wh_code write_header(wh_ctx *c, const writer *w)
{
	const wh_synth_params *p = &w->s->p;
	const char *real = p->is_double ? "double" : "float";
	char text[HEADER_MAX];
	const int n = snprintf(
	    text, sizeof text,
	    "ply\nformat %s 1.0\ncomment whittle generate: %s, seed %llu, %s\n"
	    "element vertex %llu\nproperty %s x\nproperty %s y\nproperty %s z\n%s%s"
	    "element face %llu\nproperty list uchar %s vertex_indices\nend_header\n",
	    p->ascii ? "ascii" : "binary_little_endian", w->s->shape->name,
	    (unsigned long long)p->seed, p->shuffled ? "shuffled" : "in rows",
	    (unsigned long long)w->s->nv, real, real, real,
	    p->normals ? "property float nx\nproperty float ny\nproperty float nz\n" : "",
	    p->colors ? "property uchar red\nproperty uchar green\nproperty uchar blue\n" : "",
	    2ULL * w->s->ncells, w->s->nv >> 31 ? "uint" : "int");
	return wh_outfile_write(c, w->out, text, (size_t)n);
}

static wh_code write_file(wh_ctx *c, const wh_exec *ex, writer *w)
{
	wh_code code = write_header(c, w);
	if (code == WH_OK)
		code = write_elements(c, ex, w, false);
	if (code == WH_OK)
		code = write_elements(c, ex, w, true);
	return code;
}

wh_code wh_synth_write(wh_ctx *c, const wh_exec *ex, const wh_synth *s, struct wh_outfile *o)
{
	writer w = {.s = s, .out = o};
	const size_t workers = (size_t)ex->workers;
	for (int i = 0; i < 3; i++)
		w.offset[i] = (int64_t)(s->p.offset[i] * 1024.0);
	w.cursor = wh_alloc(c, workers, sizeof *w.cursor);
	w.buffer = wh_alloc(c, workers, (size_t)CHUNK * ITEM_MAX);
	w.used = wh_calloc(c, workers, sizeof *w.used);
	if (w.cursor && w.buffer && w.used) {
		for (size_t i = 0; i < workers; i++)
			synth_cursor_init(&w.cursor[i]);
		(void)write_file(c, ex, &w);
	}
	wh_free(c, w.used);
	wh_free(c, w.buffer);
	wh_free(c, w.cursor);
	return c->err.code;
}
