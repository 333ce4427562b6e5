/*
 * PLY is written by ply_write, and so are the lines of OFF, which are the same as those of a PLY
 * text. GLB is a header of JSON with the counts and the bounds, then positions and indices; as it
 * has floats only, doubles are written as distances from the middle of the box, and a node moves
 * them there.
 */
#include "io/mesh_write.h"

#include "base/bytes.h"
#include "base/real.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>

enum {
	ROOM = 65536,    /* of an outfile */
	OBJ_RECORD = 96, /* bytes of a line, at most */
	STL_TEXT = 512,  /* bytes of a facet of text, at most */
	FACET = 50,      /* bytes of a binary one */
	STL_HEADER = 80,
	GLB_JSON = 2048, /* bytes of it, at most */
	GLB_HEADERS = 28 /* bytes: of the file, and of its two chunks */
};

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

bool wh_mesh_wants_box(wh_ply_style style)
{
	return style.format == WH_FORMAT_GLB;
}

bool wh_mesh_wants_facets(wh_ply_style style)
{
	return style.format == WH_FORMAT_STL;
}

/* ---- bytes -------------------------------------------------------------------------------- */

static unsigned char *put32(unsigned char *to, uint32_t v)
{
	v = wh_load32(&v, WH_HOST_BIG);
	memcpy(to, &v, sizeof v);
	return to + sizeof v;
}

static unsigned char *put_float(unsigned char *to, double x)
{
	const float f = (float)x;
	uint32_t v;
	memcpy(&v, &f, sizeof v);
	return put32(to, v);
}

/* The digits that bring the number back. */
static char *put_real(char *to, bool is_double, double x)
{
	return to + snprintf(to, 32, "%.*g", is_double ? 17 : 9, is_double ? x : wh_round_float(x));
}

/* ---- GLB ---------------------------------------------------------------------------------- */

/* Where positions are counted from: the middle, for what floats cannot hold. */
static void choose_origin(wh_mesh_out *m, const wh_mesh_box *box)
{
	for (int k = 0; m->style.is_double && k < 3; k++)
		m->origin[k] = wh_round_float(0.5 * box->lo[k] + 0.5 * box->hi[k]);
}

static char *put_triple(char *to, const char *name, const double v[3], bool is_double)
{
	to += sprintf(to, "\"%s\":[", name);
	for (int k = 0; k < 3; k++) {
		to = put_real(to, is_double, v[k]);
		*to++ = k < 2 ? ',' : ']';
	}
	return to;
}

static size_t glb_json(const wh_mesh_out *m, uint64_t nv, uint64_t nf, const wh_mesh_box *box,
                       char text[GLB_JSON])
{
	double lo[3], hi[3];
	for (int k = 0; k < 3; k++) {
		lo[k] = box->lo[k] - m->origin[k];
		hi[k] = box->hi[k] - m->origin[k];
	}
	char *to = text;
	to += sprintf(to, "{\"asset\":{\"version\":\"2.0\",\"generator\":\"whittle\"},"
	                  "\"scene\":0,\"scenes\":[{\"nodes\":[0]}],\"nodes\":[{\"mesh\":0");
	if (m->style.is_double) {
		*to++ = ',';
		to = put_triple(to, "translation", m->origin, true);
	}
	to += sprintf(to,
	              "}],\"meshes\":[{\"primitives\":[{\"attributes\":{\"POSITION\":0},"
	              "\"indices\":1,\"mode\":4}]}],\"accessors\":[{\"bufferView\":0,"
	              "\"componentType\":5126,\"count\":%" PRIu64 ",\"type\":\"VEC3\",",
	              nv);
	to = put_triple(to, "min", lo, false);
	*to++ = ',';
	to = put_triple(to, "max", hi, false);
	to += sprintf(
	    to,
	    "},{\"bufferView\":1,\"componentType\":5125,\"count\":%" PRIu64
	    ",\"type\":\"SCALAR\"}],\"bufferViews\":[{\"buffer\":0,\"byteLength\":%" PRIu64
	    ",\"target\":34962},{\"buffer\":0,\"byteOffset\":%" PRIu64 ",\"byteLength\":%" PRIu64
	    ",\"target\":34963}],\"buffers\":[{\"byteLength\":%" PRIu64 "}]}",
	    3 * nf, 12 * nv, 12 * nv, 12 * nf, 12 * (nv + nf));
	while ((to - text) % 4 != 0)
		*to++ = ' ';
	return (size_t)(to - text);
}

static wh_code glb_begin(wh_ctx *c, wh_mesh_out *m, uint64_t nv, uint64_t nf,
                         const wh_mesh_box *box)
{
	char json[GLB_JSON];
	unsigned char head[20], bin[8];
	if (nv >= UINT32_MAX || 12 * (nv + nf) > UINT32_MAX - GLB_JSON - GLB_HEADERS)
		return wh_fail(
		    c, WH_E_USAGE,
		    "%" PRIu64 " vertices and %" PRIu64
		    " faces do not fit a GLB file, which ends at 4 GiB; reduce to fewer, "
		    "or write PLY",
		    nv, nf);
	choose_origin(m, box);
	const size_t n = glb_json(m, nv, nf, box, json);
	const uint32_t body = (uint32_t)(12 * (nv + nf));
	unsigned char *to = put32(head, 0x46546c67); /* "glTF" */
	to = put32(to, 2);
	to = put32(to, (uint32_t)(GLB_HEADERS + n) + body);
	to = put32(to, (uint32_t)n);
	(void)put32(to, 0x4e4f534a);               /* "JSON" */
	(void)put32(put32(bin, body), 0x004e4942); /* "BIN" */
	if (wh_outfile_write(c, m->out, head, sizeof head) != WH_OK ||
	    wh_outfile_write(c, m->out, json, n) != WH_OK)
		return c->err.code;
	return wh_outfile_write(c, m->out, bin, sizeof bin);
}

static size_t glb_vertices(const wh_mesh_out *m, unsigned char *to, const double *xyz, size_t n)
{
	for (size_t i = 0; i < 3 * n; i++)
		to = put_float(to, xyz[i] - m->origin[i % 3]);
	return 12 * n;
}

static size_t glb_triangles(unsigned char *to, const uint32_t *ids, size_t n)
{
	for (size_t i = 0; i < 3 * n; i++)
		to = put32(to, ids[i]);
	return 12 * n;
}

/* ---- OBJ ---------------------------------------------------------------------------------- */

static size_t obj_vertices(const wh_mesh_out *m, char *to, const double *xyz, size_t n)
{
	char *const start = to;
	for (size_t i = 0; i < n; i++) {
		*to++ = 'v';
		for (size_t k = 0; k < 3; k++) {
			*to++ = ' ';
			to = put_real(to, m->style.is_double, xyz[3 * i + k]);
		}
		*to++ = '\n';
	}
	return (size_t)(to - start);
}

static size_t obj_triangles(char *to, const uint32_t *ids, size_t n)
{
	char *const start = to;
	for (size_t i = 0; i < n; i++)
		to +=
		    sprintf(to, "f %" PRIu64 " %" PRIu64 " %" PRIu64 "\n", (uint64_t)ids[3 * i] + 1,
		            (uint64_t)ids[3 * i + 1] + 1, (uint64_t)ids[3 * i + 2] + 1);
	return (size_t)(to - start);
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
	(void)put32(head + STL_HEADER, (uint32_t)nf);
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
		to = put_real(to, is_double, v[k]);
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

/* OFF's lines are those of a PLY text. */
static wh_ply_style text_style(const wh_mesh_out *m)
{
	return (wh_ply_style){.ascii = true, .is_double = m->style.is_double};
}

static wh_code off_begin(wh_ctx *c, const wh_mesh_out *m, uint64_t nv, uint64_t nf)
{
	char text[96];
	const int n = snprintf(text, sizeof text, "OFF\n%" PRIu64 " %" PRIu64 " 0\n", nv, nf);
	return wh_outfile_write(c, m->out, text, (size_t)n);
}

wh_code wh_mesh_begin(wh_ctx *c, wh_mesh_out *m, wh_outfile *out, wh_ply_style style, uint64_t nv,
                      uint64_t nf, const wh_mesh_box *box)
{
	static const char obj[] = "# made by whittle\n";
	*m = (wh_mesh_out){.out = out, .style = style};
	switch (style.format) {
	case WH_FORMAT_OBJ:
		return wh_outfile_write(c, out, obj, sizeof obj - 1);
	case WH_FORMAT_OFF:
		return off_begin(c, m, nv, nf);
	case WH_FORMAT_STL:
		return stl_begin(c, m, nf);
	case WH_FORMAT_GLB:
		return glb_begin(c, m, nv, nf, box);
	default:
		return wh_ply_write_header(c, out, style, nv, nf);
	}
}

wh_code wh_mesh_vertices(wh_ctx *c, const wh_mesh_out *m, const double *xyz, const uint8_t *records,
                         size_t n)
{
	enum { BATCH = ROOM / OBJ_RECORD };
	if (m->style.format == WH_FORMAT_OFF)
		return wh_ply_write_vertices(c, m->out, text_style(m), xyz, n);
	if (m->style.format != WH_FORMAT_OBJ && m->style.format != WH_FORMAT_GLB)
		return wh_ply_write_records(c, m->out, m->style, xyz, records, n);
	for (size_t done = 0; done < n; done += BATCH) {
		const size_t k = n - done < BATCH ? n - done : BATCH;
		void *room = wh_outfile_room(c, m->out, ROOM);
		if (!room)
			return wh_failed(c);
		wh_outfile_advance(m->out, m->style.format == WH_FORMAT_OBJ
		                               ? obj_vertices(m, room, xyz + 3 * done, k)
		                               : glb_vertices(m, room, xyz + 3 * done, k));
	}
	return WH_OK;
}

wh_code wh_mesh_triangles(wh_ctx *c, const wh_mesh_out *m, const uint32_t *ids, size_t n)
{
	enum { BATCH = ROOM / OBJ_RECORD };
	if (m->style.format == WH_FORMAT_OFF)
		return wh_ply_write_triangles(c, m->out, text_style(m), ids, n);
	if (m->style.format != WH_FORMAT_OBJ && m->style.format != WH_FORMAT_GLB)
		return wh_ply_write_triangles(c, m->out, m->style, ids, n);
	for (size_t done = 0; done < n; done += BATCH) {
		const size_t k = n - done < BATCH ? n - done : BATCH;
		void *room = wh_outfile_room(c, m->out, ROOM);
		if (!room)
			return wh_failed(c);
		wh_outfile_advance(m->out, m->style.format == WH_FORMAT_OBJ
		                               ? obj_triangles(room, ids + 3 * done, k)
		                               : glb_triangles(room, ids + 3 * done, k));
	}
	return WH_OK;
}

wh_code wh_mesh_end(wh_ctx *c, const wh_mesh_out *m)
{
	return m->style.format == WH_FORMAT_STL && m->style.ascii
	           ? wh_outfile_write(c, m->out, "endsolid whittle\n", 17)
	           : WH_OK;
}
