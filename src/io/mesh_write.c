/*
 * PLY is written by ply_write, GLB by glb_write. The bytes of OBJ and OFF are put together in the
 * output's own buffer.
 */
#include "io/mesh_write.h"

#include "io/attributes.h"
#include "io/number.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

enum {
	ROOM = 65536, /* of an outfile */
	BATCH =
	    ROOM / 320, /* vertices or triangles put together at a time: none takes as many bytes */
	STL_TEXT = 512, /* bytes of a facet of text, at most */
	STL_HEADER = 80
};

/* 3 doubles of a position, 3 floats of a normal, 4 bytes of a colour, 2 floats of a texture */
_Static_assert(3 * 26 + 3 * 17 + 4 * 4 + 2 * 17 < 320, "a vertex fits");

/* ---- bounds ------------------------------------------------------------------------------- */

void wh_mesh_box_add(wh_mesh_box *b, const double p[3])
{
	for (int k = 0; k < 3; k++) {
		b->lo[k] = !b->any || p[k] < b->lo[k] ? p[k] : b->lo[k];
		b->hi[k] = !b->any || p[k] > b->hi[k] ? p[k] : b->hi[k];
	}
	b->any = true;
}

void wh_mesh_box_join(wh_mesh_box *b, const wh_mesh_box *other)
{
	if (!other->any)
		return;
	wh_mesh_box_add(b, other->lo);
	wh_mesh_box_add(b, other->hi);
}

uint32_t wh_mesh_holds(wh_format format)
{
	switch (format) {
	case WH_FORMAT_OBJ:
		return WH_HOLDS_COLOUR | WH_HOLDS_NORMAL | WH_HOLDS_FACES | WH_HOLDS_CORNERS;
	case WH_FORMAT_OFF:
	case WH_FORMAT_GLB:
		return WH_HOLDS_COLOUR | WH_HOLDS_ALPHA | WH_HOLDS_NORMAL | WH_HOLDS_TEXTURE |
		       WH_HOLDS_CORNERS;
	case WH_FORMAT_STL:
		return 0;
	default:
		return WH_HOLDS_ALL | WH_HOLDS_FACES | WH_HOLDS_CORNERS;
	}
}

uint64_t wh_mesh_least_bytes(wh_ply_style style, uint64_t nv, uint64_t nf)
{
	enum { LINE = 8 }; /* "v 0 0 0" and "f 1 2 3" with their ends */
	const bool text =
	    style.ascii || style.format == WH_FORMAT_OBJ || style.format == WH_FORMAT_OFF;
	if (style.format == WH_FORMAT_STL)
		return nf * (text ? 3 * LINE : 50);
	if (text)
		return (nv + nf) * LINE;
	if (style.format == WH_FORMAT_GLB)
		return nv * (style.quantize ? 8 : 12) + nf * (nv > UINT16_MAX ? 12 : 6);
	const uint64_t carried = style.attributes ? style.attributes->bytes : 0;
	return nv * ((style.is_double ? 24 : 12) + carried) + nf * 13;
}

bool wh_mesh_wants_box(wh_ply_style style)
{
	return style.format == WH_FORMAT_GLB;
}

bool wh_mesh_wants_facets(wh_ply_style style)
{
	return style.format == WH_FORMAT_STL;
}

/* ---- bytes -------------------------------------------------------------------------------- */

static unsigned char *put_float(unsigned char *to, double x)
{
	const float f = (float)x;
	uint32_t v;
	memcpy(&v, &f, sizeof v);
	return wh_put32(to, v);
}

/* ---- words -------------------------------------------------------------------------------- */

static char *put_triple(char *to, bool is_double, const double v[3])
{
	for (int k = 0; k < 3; k++) {
		to = wh_print_real(to, is_double, v[k]);
		*to++ = ' ';
	}
	return to;
}

static char *put_values(char *to, const wh_attributes *a, const uint32_t *at, int n,
                        const uint8_t *record)
{
	for (int k = 0; k < n; k++) {
		to = wh_print_real(to, false, wh_attribute_get(&a->item[at[k]], record));
		*to++ = ' ';
	}
	return to;
}

/* ---- OBJ ---------------------------------------------------------------------------------- */

static bool has_normal(const wh_mesh_out *m)
{
	return m->style.attributes && m->style.attributes->has_normal;
}

/* "v x y z", with red, green and blue from 0 to 1 behind; "vn nx ny nz". */
static char *obj_vertex(const wh_mesh_out *m, char *to, const double xyz[3], const uint8_t *record)
{
	const wh_attributes *a = m->style.attributes;
	*to++ = 'v';
	*to++ = ' ';
	to = put_triple(to, m->style.is_double, xyz);
	for (int k = 0; a && a->has_rgb && k < 3; k++) {
		to = wh_print_real(to, false, wh_attribute_share(&a->item[a->rgb[k]], record));
		*to++ = ' ';
	}
	to[-1] = '\n';
	if (!has_normal(m))
		return to;
	*to++ = 'v';
	*to++ = 'n';
	*to++ = ' ';
	to = put_values(to, a, a->normal, 3, record);
	to[-1] = '\n';
	return to;
}

/* Numbers from 1 of a corner's vertex, texture coordinates and normal; 0: it has none. */
static char *obj_corner(char *to, uint64_t vertex, uint64_t texcoord, uint64_t normal)
{
	*to++ = ' ';
	to = wh_print_whole(to, vertex);
	if (texcoord || normal)
		*to++ = '/';
	if (texcoord)
		to = wh_print_whole(to, texcoord);
	if (!normal)
		return to;
	*to++ = '/';
	return wh_print_whole(to, normal);
}

/* Vertices' own normals have their numbers. */
static char *obj_triangle(const wh_mesh_out *m, char *to, const uint32_t ids[3])
{
	*to++ = 'f';
	for (int k = 0; k < 3; k++) {
		const uint64_t number = (uint64_t)ids[k] + 1;
		to = obj_corner(to, number, 0, has_normal(m) ? number : 0);
	}
	*to++ = '\n';
	return to;
}

/* ---- OFF ---------------------------------------------------------------------------------- */

/* Behind the position, and in this order: normal, red, green, blue and alpha as bytes, texture
 * coordinates. */
static char *off_vertex(const wh_mesh_out *m, char *to, const double xyz[3], const uint8_t *record)
{
	const wh_attributes *a = m->style.attributes;
	to = put_triple(to, m->style.is_double, xyz);
	if (a && a->has_normal)
		to = put_values(to, a, a->normal, 3, record);
	for (int k = 0; a && a->has_rgb && k < 4; k++) {
		const wh_attribute *item = &a->item[k < 3 ? a->rgb[k] : a->alpha];
		const double share = k < 3 || a->has_alpha ? wh_attribute_share(item, record) : 1;
		to = wh_print_whole(to, (uint64_t)rint(255 * share));
		*to++ = ' ';
	}
	if (a && a->has_texture)
		to = put_values(to, a, a->texture, 2, record);
	to[-1] = '\n';
	return to;
}

static char *off_triangle(char *to, const uint32_t ids[3])
{
	*to++ = '3';
	for (int k = 0; k < 3; k++) {
		*to++ = ' ';
		to = wh_print_whole(to, ids[k]);
	}
	*to++ = '\n';
	return to;
}

/* ---- OBJ with what faces carry ------------------------------------------------------------ */

static wh_code put_line(wh_ctx *c, const wh_mesh_out *m, const char *word, const char *name)
{
	if (wh_outfile_write(c, m->out, word, strlen(word)) != WH_OK ||
	    wh_outfile_write(c, m->out, name, strlen(name)) != WH_OK)
		return c->err.code;
	return wh_outfile_write(c, m->out, "\n", 1);
}

/* Begins a list of lines with `width` numbers, whose type is that of `like`. */
static wh_code open_listed(wh_ctx *c, wh_mesh_listed *list, const char *word, uint32_t width,
                           const wh_attribute *like)
{
	*list = (wh_mesh_listed){.word = word, .width = width, .wide = like->type != WH_F32};
	list->recent = wh_calloc(c, WH_MESH_RECENT, sizeof *list->recent);
	return list->recent ? WH_OK : c->err.code;
}

static wh_code open_lists(wh_ctx *c, wh_mesh_out *m)
{
	const wh_attributes *a = m->style.wedges ? &m->style.wedges->corner : NULL;
	if (a && a->has_texture && open_listed(c, &m->texcoords, "vt", 2, &a->item[0]) != WH_OK)
		return c->err.code;
	return a && a->has_normal ? open_listed(c, &m->normals, "vn", 3, &a->item[a->normal[0]])
	                          : WH_OK;
}

static wh_code obj_begin(wh_ctx *c, wh_mesh_out *m)
{
	static const char first[] = "# made by whittle\n";
	const wh_wedges *w = m->style.wedges;
	const wh_names *l = w ? w->libraries : NULL;
	if (open_lists(c, m) != WH_OK ||
	    wh_outfile_write(c, m->out, first, sizeof first - 1) != WH_OK)
		return c->err.code;
	for (uint32_t i = 0; l && i < l->n; i++)
		if (put_line(c, m, "mtllib ", l->item[i]) != WH_OK)
			return c->err.code;
	return WH_OK;
}

static bool is_at(const wh_mesh_wedge *w, uint32_t vertex, const double v[3])
{
	return w->number && w->vertex == vertex && w->value[0] == v[0] && w->value[1] == v[1] &&
	       w->value[2] == v[2];
}

/* The number of what a corner has of a list, which is written unless it was for one of the last
 * faces that use the vertex: so it stands twice at worst. Values that the list does not have are 0.
 */
static wh_code obj_listed(wh_ctx *c, wh_outfile *out, wh_mesh_listed *list, uint32_t vertex,
                          const double v[3], uint64_t *number)
{
	char text[128], *end = text;
	/* the wedges of a vertex lie side by side, as far as there are places */
	wh_mesh_wedge *free = NULL;
	for (uint32_t i = 0; i < WH_MESH_WEDGES; i++) {
		wh_mesh_wedge *w = &list->recent[(vertex * WH_MESH_WEDGES + i) % WH_MESH_RECENT];
		if (is_at(w, vertex, v)) {
			*number = w->number;
			return WH_OK;
		}
		if (!free && (!w->number || w->vertex != vertex))
			free = w;
	}
	*number = ++list->n;
	if (free)
		*free = (wh_mesh_wedge){vertex, {v[0], v[1], v[2]}, *number};
	end += sprintf(end, "%s", list->word);
	for (uint32_t k = 0; k < list->width; k++) {
		*end++ = ' ';
		end = wh_print_real(end, list->wide, v[k]);
	}
	*end++ = '\n';
	return wh_outfile_write(c, out, text, (size_t)(end - text));
}

/* Numbers of a corner's texture coordinates and normal; 0: it has none. */
static wh_code obj_list_corner(wh_ctx *c, wh_mesh_out *m, uint32_t vertex, const uint8_t *corner,
                               uint64_t *texcoord, uint64_t *normal)
{
	const wh_wedges *w = m->style.wedges;
	double uv[3] = {0}, n[3];
	*texcoord = 0;
	*normal = has_normal(m) ? (uint64_t)vertex + 1 : 0;
	if (wh_wedges_uv(w, corner, uv) &&
	    obj_listed(c, m->out, &m->texcoords, vertex, uv, texcoord) != WH_OK)
		return c->err.code;
	return wh_wedges_normal(w, corner, n)
	           ? obj_listed(c, m->out, &m->normals, vertex, n, normal)
	           : WH_OK;
}

/* Says which material or group the next faces have, where it is another one. */
static wh_code obj_label(wh_ctx *c, wh_mesh_out *m, const uint8_t *record, const char *property,
                         const char *word, const char *none, const wh_names *names, uint64_t *last)
{
	const wh_attributes *a = &m->style.wedges->face;
	const uint8_t *face = wh_wedges_face(m->style.wedges, record);
	for (uint32_t i = 0; names && i < a->n; i++) {
		if (strcmp(a->item[i].name, property) != 0)
			continue;
		const uint64_t now = (uint64_t)wh_attribute_get(&a->item[i], face);
		if (now == *last)
			continue;
		*last = now;
		return put_line(c, m, word, now && now <= names->n ? names->item[now - 1] : none);
	}
	return WH_OK;
}

static wh_code obj_carrying(wh_ctx *c, wh_mesh_out *m, const uint32_t *ids, const uint8_t *record)
{
	const wh_wedges *w = m->style.wedges;
	char text[160], *to = text;
	uint64_t t[3], n[3];
	if (obj_label(c, m, record, "group", "", "g", w->groups, &m->label[1]) != WH_OK ||
	    obj_label(c, m, record, "material", "usemtl ", "none", w->materials, &m->label[0]) !=
	        WH_OK)
		return c->err.code;
	for (uint32_t k = 0; k < 3; k++)
		if (obj_list_corner(c, m, ids[k], record + (size_t)k * w->corner.bytes, &t[k],
		                    &n[k]) != WH_OK)
			return c->err.code;
	const bool mapped = t[0] && t[1] && t[2], curved = n[0] && n[1] && n[2];
	*to++ = 'f';
	for (uint32_t k = 0; k < 3; k++)
		to = obj_corner(to, (uint64_t)ids[k] + 1, mapped ? t[k] : 0, curved ? n[k] : 0);
	*to++ = '\n';
	return wh_outfile_write(c, m->out, text, (size_t)(to - text));
}

static wh_code obj_write_carrying(wh_ctx *c, wh_mesh_out *m, const uint32_t *ids,
                                  const uint8_t *records, size_t n)
{
	for (size_t i = 0; i < n; i++)
		if (obj_carrying(c, m, ids + 3 * i, records + i * m->style.wedges->bytes) != WH_OK)
			return c->err.code;
	return WH_OK;
}

/* ---- STL ---------------------------------------------------------------------------------- */

static wh_code stl_begin(wh_ctx *c, const wh_mesh_out *m, uint64_t nf)
{
	unsigned char head[STL_HEADER + 4] = "binary STL, made by whittle";
	if (m->style.ascii)
		return wh_outfile_write(c, m->out, "solid whittle\n", 14);
	if (nf > UINT32_MAX)
		return wh_fail(c, WH_E_USAGE,
		               "%" PRIu64 " faces do not fit an STL file; reduce to fewer, or "
		               "write PLY",
		               nf);
	(void)wh_put32(head + STL_HEADER, (uint32_t)nf);
	return wh_outfile_write(c, m->out, head, sizeof head);
}

/* The unit normal of a facet, 0 where there is none. */
static void normal_of(const double p[3][3], double normal[3])
{
	double u[3], v[3];
	for (int k = 0; k < 3; k++) {
		u[k] = p[1][k] - p[0][k];
		v[k] = p[2][k] - p[0][k];
	}
	for (int k = 0; k < 3; k++) {
		const int a = (k + 1) % 3, b = (k + 2) % 3;
		normal[k] = u[a] * v[b] - u[b] * v[a];
	}
	const double length =
	    sqrt(normal[0] * normal[0] + normal[1] * normal[1] + normal[2] * normal[2]);
	for (int k = 0; k < 3; k++)
		normal[k] = length > 0 && isfinite(length) ? normal[k] / length : 0;
}

static size_t stl_facet(unsigned char *to, const double normal[3], const double p[3][3])
{
	unsigned char *const start = to;
	for (int k = 0; k < 3; k++)
		to = put_float(to, normal[k]);
	for (int i = 0; i < 9; i++)
		to = put_float(to, p[i / 3][i % 3]);
	*to++ = 0;
	*to++ = 0;
	return (size_t)(to - start);
}

static char *stl_line(char *to, bool is_double, const char *words, const double v[3])
{
	to += sprintf(to, "%s", words);
	for (int k = 0; k < 3; k++) {
		*to++ = ' ';
		to = wh_print_real(to, is_double, v[k]);
	}
	*to++ = '\n';
	return to;
}

static size_t stl_facet_text(char *to, bool is_double, const double normal[3], const double p[3][3])
{
	char *const start = to;
	to = stl_line(to, false, "facet normal", normal);
	to += sprintf(to, "outer loop\n");
	for (int i = 0; i < 3; i++)
		to = stl_line(to, is_double, "vertex", p[i]);
	to += sprintf(to, "endloop\nendfacet\n");
	return (size_t)(to - start);
}

wh_code wh_mesh_facets(wh_ctx *c, const wh_mesh_out *m, const double *xyz, double scale,
                       const uint32_t *ids, size_t n)
{
	for (size_t i = 0; i < n; i++) {
		double p[3][3], normal[3];
		void *room = wh_outfile_room(c, m->out, STL_TEXT);
		if (!room)
			return wh_failed(c);
		for (size_t k = 0; k < 9; k++)
			p[k / 3][k % 3] = xyz[3 * (size_t)ids[3 * i + k / 3] + k % 3] * scale;
		normal_of((const double(*)[3])p, normal);
		wh_outfile_advance(m->out, m->style.ascii
		                               ? stl_facet_text(room, m->style.is_double, normal,
		                                                (const double(*)[3])p)
		                               : stl_facet(room, normal, (const double(*)[3])p));
	}
	return WH_OK;
}

/* ---- any ---------------------------------------------------------------------------------- */

static wh_code off_begin(wh_ctx *c, const wh_mesh_out *m, uint64_t nv, uint64_t nf)
{
	const wh_attributes *a = m->style.attributes;
	char text[96];
	const int n = snprintf(text, sizeof text, "%s%s%sOFF\n%" PRIu64 " %" PRIu64 " 0\n",
	                       a && a->has_texture ? "ST" : "", a && a->has_rgb ? "C" : "",
	                       a && a->has_normal ? "N" : "", nv, nf);
	return wh_outfile_write(c, m->out, text, (size_t)n);
}

wh_code wh_mesh_begin(wh_ctx *c, wh_mesh_out *m, wh_outfile *out, wh_ply_style style, uint64_t nv,
                      uint64_t nf, const wh_mesh_box *box)
{
	*m = (wh_mesh_out){.out = out, .style = style};
	if (nv > UINT32_MAX && (style.format == WH_FORMAT_OBJ || style.format == WH_FORMAT_OFF))
		return wh_fail(c, WH_E_USAGE,
		               "%" PRIu64
		               " vertices are too many to be numbered in 32 bits; reduce "
		               "to fewer than 4294967296",
		               nv);
	switch (style.format) {
	case WH_FORMAT_OBJ:
		return obj_begin(c, m);
	case WH_FORMAT_OFF:
		return off_begin(c, m, nv, nf);
	case WH_FORMAT_STL:
		return stl_begin(c, m, nf);
	case WH_FORMAT_GLB:
		return wh_glb_begin(c, &m->glb, out, style, nv, nf, box->lo, box->hi);
	default:
		return wh_ply_write_header(c, out, style, nv, nf);
	}
}

static void *put_vertices(const wh_mesh_out *m, void *room, const double *xyz,
                          const uint8_t *records, size_t n)
{
	const size_t size = m->style.attributes ? m->style.attributes->bytes : 0;
	char *to = room;
	if (m->style.format == WH_FORMAT_GLB)
		return wh_glb_vertices(&m->glb, room, xyz, records, n);
	for (size_t i = 0; i < n; i++) {
		const uint8_t *record = size ? records + i * size : NULL;
		to = m->style.format == WH_FORMAT_OBJ ? obj_vertex(m, to, xyz + 3 * i, record)
		                                      : off_vertex(m, to, xyz + 3 * i, record);
	}
	return to;
}

static void *put_triangles(const wh_mesh_out *m, void *room, const uint32_t *ids, size_t n)
{
	char *to = room;
	if (m->style.format == WH_FORMAT_GLB)
		return wh_glb_triangles(&m->glb, room, ids, n);
	for (size_t i = 0; i < n; i++)
		to = m->style.format == WH_FORMAT_OBJ ? obj_triangle(m, to, ids + 3 * i)
		                                      : off_triangle(to, ids + 3 * i);
	return to;
}

static bool is_ours(const wh_mesh_out *m)
{
	return m->style.format == WH_FORMAT_OBJ || m->style.format == WH_FORMAT_OFF ||
	       m->style.format == WH_FORMAT_GLB;
}

wh_code wh_mesh_vertices(wh_ctx *c, const wh_mesh_out *m, const double *xyz, const uint8_t *records,
                         size_t n)
{
	const size_t size = m->style.attributes ? m->style.attributes->bytes : 0;
	if (!is_ours(m))
		return wh_ply_write_records(c, m->out, m->style, xyz, records, n);
	for (size_t done = 0; done < n; done += BATCH) {
		const size_t k = n - done < BATCH ? n - done : BATCH;
		char *room = wh_outfile_room(c, m->out, ROOM);
		if (!room)
			return wh_failed(c);
		const char *end =
		    put_vertices(m, room, xyz + 3 * done, size ? records + done * size : NULL, k);
		wh_outfile_advance(m->out, (size_t)(end - room));
	}
	return WH_OK;
}

wh_code wh_mesh_triangles(wh_ctx *c, wh_mesh_out *m, const uint32_t *ids, const uint8_t *records,
                          size_t n)
{
	if (!is_ours(m))
		return wh_ply_write_triangles(c, m->out, m->style, ids, records, n);
	if (m->style.format == WH_FORMAT_OBJ && m->style.wedges)
		return obj_write_carrying(c, m, ids, records, n);
	for (size_t done = 0; done < n; done += BATCH) {
		const size_t k = n - done < BATCH ? n - done : BATCH;
		char *room = wh_outfile_room(c, m->out, ROOM);
		if (!room)
			return wh_failed(c);
		const char *end = put_triangles(m, room, ids + 3 * done, k);
		wh_outfile_advance(m->out, (size_t)(end - room));
	}
	return WH_OK;
}

wh_code wh_mesh_end(wh_ctx *c, const wh_mesh_out *m)
{
	if (m->style.format == WH_FORMAT_GLB)
		return wh_glb_end(c, &m->glb, m->out);
	return m->style.format == WH_FORMAT_STL && m->style.ascii
	           ? wh_outfile_write(c, m->out, "endsolid whittle\n", 17)
	           : WH_OK;
}

void wh_mesh_free_out(wh_ctx *c, wh_mesh_out *m)
{
	wh_free(c, m->texcoords.recent);
	wh_free(c, m->normals.recent);
	m->texcoords.recent = m->normals.recent = NULL;
}
