/*
 * PLY output: the header, then records put together in the output's own buffer. The bytes hold
 * nothing that differs between two runs (no date, version or name), so that equal meshes give
 * equal files.
 */
#include "base/bytes.h"
#include "base/real.h"
#include "io/outfile.h"
#include "io/ply.h"

#include <inttypes.h>
#include <stdio.h>

enum {
	BATCH = 1024,     /* records put together at a time */
	TEXT_BATCH = 256, /* the same in text, ... */
	TEXT_RECORD =
	    96, /* ... where a record takes less than this: 3 x 24 digits, or "3" and 3 x 11 */
	TRIANGLE = 13 /* bytes of a binary triangle: count and three indices */
};

_Static_assert(3 * sizeof(double) * BATCH <= 65536, "a batch fits the room of an outfile");
_Static_assert(TEXT_BATCH *TEXT_RECORD <= 65536, "a batch fits the room of an outfile");

wh_code wh_ply_write_header(wh_ctx *c, wh_outfile *o, wh_ply_style style, uint64_t nv, uint64_t nf)
{
	if (nv > UINT32_MAX)
		return wh_fail(c, WH_E_USAGE,
		               "PLY has no index type for %" PRIu64
		               " vertices; reduce to fewer than 4294967296",
		               nv);
	const char *real = style.is_double ? "double" : "float";
	char text[512];
	const int n = snprintf(text, sizeof text,
	                       "ply\n"
	                       "format %s 1.0\n"
	                       "comment made by whittle\n"
	                       "element vertex %" PRIu64 "\n"
	                       "property %s x\n"
	                       "property %s y\n"
	                       "property %s z\n"
	                       "element face %" PRIu64 "\n"
	                       "property list uchar %s vertex_indices\n"
	                       "end_header\n",
	                       style.ascii ? "ascii" : "binary_little_endian", nv, real, real, real,
	                       nf, nv < 0x80000000u ? "int" : "uint");
	return wh_outfile_write(c, o, text, (size_t)n);
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

/* 9 and 17 digits bring every float and double back exactly. */
static size_t put_vertices_text(char *to, wh_ply_style style, const double *xyz, size_t n)
{
	char *const start = to;
	for (size_t i = 0; i < 3 * n; i++) {
		const double v = style.is_double ? xyz[i] : wh_round_float(xyz[i]);
		to += snprintf(to, 32, "%.*g", style.is_double ? 17 : 9, v);
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

static char *put_number(char *to, uint32_t v)
{
	char digits[10];
	int n = 0;
	do {
		digits[n++] = (char)('0' + v % 10);
		v /= 10;
	} while (v);
	while (n > 0)
		*to++ = digits[--n];
	return to;
}

static size_t put_triangles_text(char *to, const uint32_t *ids, size_t n)
{
	char *const start = to;
	for (size_t i = 0; i < n; i++) {
		*to++ = '3';
		for (int k = 0; k < 3; k++) {
			*to++ = ' ';
			to = put_number(to, ids[3 * i + (size_t)k]);
		}
		*to++ = '\n';
	}
	return (size_t)(to - start);
}

wh_code wh_ply_write_triangles(wh_ctx *c, wh_outfile *o, wh_ply_style style, const uint32_t *ids,
                               size_t n)
{
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
