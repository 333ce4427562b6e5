/*
 * PLY output: the header, then records put together in the output's own buffer. The bytes hold
 * nothing that differs between two runs (no date, version or name), so that equal meshes give
 * equal files.
 */
#include "base/bytes.h"
#include "io/attributes.h"
#include "io/number.h"
#include "io/outfile.h"
#include "io/wedges.h"

#include <inttypes.h>
#include <stdio.h>

enum {
	ROOM = 65536,     /* bytes of output put together at a time */
	BATCH = 1024,     /* records put together at a time */
	TEXT_BATCH = 256, /* the same in text, ... */
	TEXT_RECORD =
	    96, /* ... where a record takes less than this: 3 x 24 digits, or "3" and 3 x 11 */
	TRIANGLE = 13 /* bytes of a binary triangle: count and three indices */
};

_Static_assert(3 * sizeof(double) * BATCH <= 65536, "a batch fits the room of an outfile");
_Static_assert(TEXT_BATCH *TEXT_RECORD <= 65536, "a batch fits the room of an outfile");
_Static_assert(TEXT_RECORD + (7 + WH_MOST_ATTRIBUTES) * (WH_ATTRIBUTE_TEXT + 1) <= ROOM,
               "so does a triangle with what it carries");
_Static_assert((3 + WH_MOST_ATTRIBUTES) * (WH_ATTRIBUTE_TEXT + 1) <= ROOM, "so does a vertex");

/* Attributes that come before an axis; behind all of them, for axis 3. */
static uint32_t attributes_before(const wh_attributes *a, int axis)
{
	return !a ? 0 : axis < 3 ? a->before[axis] : a->n;
}

/* The axes in the order of the file; an axis and all before it come before the next one. */
static void axes_in_order(const wh_attributes *a, int axis[4])
{
	for (int k = 0; k < 4; k++)
		axis[k] = k;
	for (int i = 1; a && i < 3; i++)
		for (int k = i; k > 0 && a->rank[axis[k]] < a->rank[axis[k - 1]]; k--) {
			const int other = axis[k];
			axis[k] = axis[k - 1];
			axis[k - 1] = other;
		}
}

static const char *type_name(wh_type t)
{
	static const char *const name[] = {"char", "uchar", "short",  "ushort", "int",
	                                   "uint", "int64", "uint64", "float",  "double"};
	return name[t];
}

static wh_code write_property(wh_ctx *c, wh_outfile *o, const char *type, const char *name)
{
	const char *const part[] = {"property ", type, " ", name, "\n"};
	for (size_t i = 0; i < sizeof part / sizeof *part; i++)
		if (wh_outfile_write(c, o, part[i], strlen(part[i])) != WH_OK)
			return c->err.code;
	return WH_OK;
}

static wh_code write_properties(wh_ctx *c, wh_outfile *o, wh_ply_style style)
{
	static const char *const axis_name[] = {"x", "y", "z"};
	const wh_attributes *a = style.attributes;
	int axis[4];
	uint32_t next = 0;
	axes_in_order(a, axis);
	for (int k = 0; k < 4; k++) {
		for (; next < attributes_before(a, axis[k]); next++)
			if (write_property(c, o, type_name(a->item[next].out),
			                   a->item[next].name) != WH_OK)
				return c->err.code;
		if (axis[k] < 3 && write_property(c, o, style.is_double ? "double" : "float",
		                                  axis_name[axis[k]]) != WH_OK)
			return c->err.code;
	}
	return WH_OK;
}

/* A comment for each name of a list. */
static wh_code write_names(wh_ctx *c, wh_outfile *o, const char *word, const wh_names *l)
{
	for (uint32_t i = 0; l && i < l->n; i++) {
		const char *const part[] = {"comment ", word, " ", l->item[i], "\n"};
		for (size_t k = 0; k < sizeof part / sizeof *part; k++)
			if (wh_outfile_write(c, o, part[k], strlen(part[k])) != WH_OK)
				return c->err.code;
	}
	return WH_OK;
}

/* What the numbers of textures, materials and groups stand for. */
static wh_code write_comments(wh_ctx *c, wh_outfile *o, const wh_wedges *w)
{
	if (!w || write_names(c, o, "TextureFile", w->textures) != WH_OK ||
	    write_names(c, o, "MaterialFile", w->libraries) != WH_OK ||
	    write_names(c, o, "Material", w->materials) != WH_OK)
		return c->err.code;
	return write_names(c, o, "Group", w->groups);
}

/* Corners have something in the file. */
static bool has_corners(wh_ply_style style)
{
	return style.wedges && style.wedges->corner.has_texture &&
	       !(style.doubled && style.doubled->has_texture);
}

static wh_code write_face_properties(wh_ctx *c, wh_outfile *o, wh_ply_style style)
{
	const wh_wedges *w = style.wedges;
	if (has_corners(style) &&
	    write_property(
	        c, o, w->corner.item[0].type == WH_F32 ? "list uchar float" : "list uchar double",
	        "texcoord") != WH_OK)
		return c->err.code;
	for (uint32_t i = 0; w && i < w->face.n; i++)
		if (write_property(c, o, type_name(w->face.item[i].out), w->face.item[i].name) !=
		    WH_OK)
			return c->err.code;
	return WH_OK;
}

wh_code wh_ply_write_header(wh_ctx *c, wh_outfile *o, wh_ply_style style, uint64_t nv, uint64_t nf)
{
	if (nv > UINT32_MAX)
		return wh_fail(c, WH_E_USAGE,
		               "PLY has no index type for %" PRIu64
		               " vertices; reduce to fewer than 4294967296",
		               nv);
	char text[256];
	int n = snprintf(text, sizeof text,
	                 "ply\n"
	                 "format %s 1.0\n"
	                 "comment made by whittle\n",
	                 style.ascii ? "ascii" : "binary_little_endian");
	if (wh_outfile_write(c, o, text, (size_t)n) != WH_OK ||
	    write_comments(c, o, style.wedges) != WH_OK)
		return c->err.code;
	n = snprintf(text, sizeof text, "element vertex %" PRIu64 "\n", nv);
	if (wh_outfile_write(c, o, text, (size_t)n) != WH_OK ||
	    write_properties(c, o, style) != WH_OK)
		return c->err.code;
	n = snprintf(text, sizeof text,
	             "element face %" PRIu64 "\n"
	             "property list uchar %s vertex_indices\n",
	             nf, nv < 0x80000000u ? "int" : "uint");
	if (wh_outfile_write(c, o, text, (size_t)n) != WH_OK ||
	    write_face_properties(c, o, style) != WH_OK)
		return c->err.code;
	return wh_outfile_write(c, o, "end_header\n", 11);
}

static void store32(unsigned char *to, uint32_t v)
{
	v = wh_load32(&v, WH_HOST_BIG);
	memcpy(to, &v, sizeof v);
}

static void store_float(unsigned char *to, float v)
{
	uint32_t u;
	memcpy(&u, &v, sizeof u);
	store32(to, u);
}

static void store_double(unsigned char *to, double v)
{
	const uint64_t u = wh_load64(&v, WH_HOST_BIG);
	memcpy(to, &u, sizeof u);
}

static size_t put_vertices(unsigned char *to, wh_ply_style style, const double *xyz, size_t n)
{
	if (style.is_double) {
		for (size_t i = 0; i < 3 * n; i++)
			store_double(to + 8 * i, xyz[i]);
		return 24 * n;
	}
	for (size_t i = 0; i < 3 * n; i++)
		store_float(to + 4 * i, (float)xyz[i]);
	return 12 * n;
}

static size_t put_vertices_text(char *to, wh_ply_style style, const double *xyz, size_t n)
{
	char *const start = to;
	for (size_t i = 0; i < 3 * n; i++) {
		to = wh_print_real(to, style.is_double, xyz[i]);
		*to++ = i % 3 == 2 ? '\n' : ' ';
	}
	return (size_t)(to - start);
}

wh_code wh_ply_write_vertices(wh_ctx *c, wh_outfile *o, wh_ply_style style, const double *xyz,
                              size_t n)
{
	const size_t batch = style.ascii ? TEXT_BATCH : BATCH;
	for (size_t done = 0; done < n;) {
		const size_t k = n - done < batch ? n - done : batch;
		void *room = wh_outfile_room(c, o, 65536);
		if (!room)
			return c->err.code;
		wh_outfile_advance(o, style.ascii
		                          ? put_vertices_text(room, style, xyz + 3 * done, k)
		                          : put_vertices(room, style, xyz + 3 * done, k));
		done += k;
	}
	return WH_OK;
}

/* ---- vertices with attributes ------------------------------------------------------------- */

static unsigned char *put_coordinate(unsigned char *to, wh_ply_style style, double v)
{
	if (style.ascii) {
		char *end = wh_print_real((char *)to, style.is_double, v);
		*end++ = ' ';
		return (unsigned char *)end;
	}
	if (style.is_double)
		store_double(to, v);
	else
		store_float(to, (float)v);
	return to + (style.is_double ? 8 : 4);
}

static unsigned char *put_attribute(unsigned char *to, wh_ply_style style, const wh_attribute *a,
                                    const uint8_t *record)
{
	if (!style.ascii)
		return wh_attribute_store(a, record, to);
	char *end = wh_attribute_print(a, record, (char *)to);
	*end++ = ' ';
	return (unsigned char *)end;
}

static unsigned char *put_record(unsigned char *to, wh_ply_style style, const int axis[4],
                                 const double xyz[3], const uint8_t *record)
{
	const wh_attributes *a = style.attributes;
	uint32_t next = 0;
	for (int k = 0; k < 4; k++) {
		for (; next < attributes_before(a, axis[k]); next++)
			to = put_attribute(to, style, &a->item[next], record);
		if (axis[k] < 3)
			to = put_coordinate(to, style, xyz[axis[k]]);
	}
	if (style.ascii)
		to[-1] = '\n';
	return to;
}

wh_code wh_ply_write_records(wh_ctx *c, wh_outfile *o, wh_ply_style style, const double *xyz,
                             const uint8_t *records, size_t n)
{
	const wh_attributes *a = style.attributes;
	if (!a)
		return wh_ply_write_vertices(c, o, style, xyz, n);
	const size_t most =
	    style.ascii ? (3 + (size_t)a->n) * (WH_ATTRIBUTE_TEXT + 1) : 24 + (size_t)a->file_bytes;
	const size_t batch = ROOM / most;
	int axis[4];
	axes_in_order(a, axis);
	for (size_t i = 0; i < n;) {
		const size_t end = n - i < batch ? n : i + batch;
		unsigned char *room = wh_outfile_room(c, o, ROOM), *to = room;
		if (!room)
			return c->err.code;
		for (; i < end; i++)
			to = put_record(to, style, axis, xyz + 3 * i, records + i * a->bytes);
		wh_outfile_advance(o, (size_t)(to - room));
	}
	return WH_OK;
}

/* ---- triangles ---------------------------------------------------------------------------- */

static size_t put_triangles(unsigned char *to, const uint32_t *ids, size_t n)
{
	for (size_t i = 0; i < n; i++, to += TRIANGLE) {
		to[0] = 3;
		store32(to + 1, ids[3 * i]);
		store32(to + 5, ids[3 * i + 1]);
		store32(to + 9, ids[3 * i + 2]);
	}
	return TRIANGLE * n;
}

static size_t put_triangles_text(char *to, const uint32_t *ids, size_t n)
{
	char *const start = to;
	for (size_t i = 0; i < n; i++) {
		*to++ = '3';
		for (int k = 0; k < 3; k++) {
			*to++ = ' ';
			to = wh_print_whole(to, ids[3 * i + (size_t)k]);
		}
		*to++ = '\n';
	}
	return (size_t)(to - start);
}

/* ---- triangles that carry something ------------------------------------------------------- */

static unsigned char *put_count(unsigned char *to, wh_ply_style style, unsigned n)
{
	if (style.ascii)
		return to + sprintf((char *)to, "%u ", n);
	*to = (unsigned char)n;
	return to + 1;
}

/* Texture coordinates of all corners, or none. */
static unsigned char *put_texcoords(unsigned char *to, wh_ply_style style, const uint8_t *record)
{
	const wh_attributes *a = &style.wedges->corner;
	double uv[2];
	for (uint32_t k = 0; k < 3; k++)
		if (!wh_wedges_uv(style.wedges, record + (size_t)k * a->bytes, uv))
			return put_count(to, style, 0);
	to = put_count(to, style, 6);
	for (uint32_t k = 0; k < 6; k++)
		to = put_attribute(to, style, &a->item[k % 2], record + (size_t)(k / 2) * a->bytes);
	return to;
}

static unsigned char *put_carrying(unsigned char *to, wh_ply_style style, const uint32_t *ids,
                                   const uint8_t *record)
{
	const wh_wedges *w = style.wedges;
	if (style.ascii) {
		to += put_triangles_text((char *)to, ids, 1);
		to[-1] = ' ';
	} else {
		to += put_triangles(to, ids, 1);
	}
	if (has_corners(style))
		to = put_texcoords(to, style, record);
	for (uint32_t i = 0; i < w->face.n; i++)
		to = put_attribute(to, style, &w->face.item[i], wh_wedges_face(w, record));
	if (style.ascii)
		to[-1] = '\n';
	return to;
}

static wh_code write_carrying(wh_ctx *c, wh_outfile *o, wh_ply_style style, const uint32_t *ids,
                              const uint8_t *records, size_t n)
{
	const wh_wedges *w = style.wedges;
	const size_t most =
	    TEXT_RECORD + (7 + (size_t)w->face.n) * (style.ascii ? WH_ATTRIBUTE_TEXT + 1 : 8);
	const size_t batch = ROOM / most;
	for (size_t i = 0; i < n;) {
		const size_t end = n - i < batch ? n : i + batch;
		unsigned char *room = wh_outfile_room(c, o, ROOM), *to = room;
		if (!room)
			return c->err.code;
		for (; i < end; i++)
			to = put_carrying(to, style, ids + 3 * i, records + i * w->bytes);
		wh_outfile_advance(o, (size_t)(to - room));
	}
	return WH_OK;
}

wh_code wh_ply_write_triangles(wh_ctx *c, wh_outfile *o, wh_ply_style style, const uint32_t *ids,
                               const uint8_t *records, size_t n)
{
	if (style.wedges)
		return write_carrying(c, o, style, ids, records, n);
	const size_t batch = style.ascii ? TEXT_BATCH : BATCH;
	for (size_t done = 0; done < n;) {
		const size_t k = n - done < batch ? n - done : batch;
		void *room = wh_outfile_room(c, o, 65536);
		if (!room)
			return c->err.code;
		wh_outfile_advance(o, style.ascii ? put_triangles_text(room, ids + 3 * done, k)
		                                  : put_triangles(room, ids + 3 * done, k));
		done += k;
	}
	return WH_OK;
}
