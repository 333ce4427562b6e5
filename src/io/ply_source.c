/*
 * Binary bodies at fixed strides: one large pread, then loops over columns of the records with
 * no branch per value. The commonest layouts (little-endian float x, y, z side by side; a byte 3
 * and three 32-bit indices) have loops of their own that the compiler can vectorise. Whether all
 * values are valid is summed up in the loop; only when they are not are they looked at one by
 * one, to name the first that is wrong.
 */
#define _GNU_SOURCE
#include "io/ply.h"

#include "io/attributes.h"

#include <errno.h>
#include <inttypes.h>
#include <unistd.h>

wh_code wh_ply_pread(wh_ctx *c, const char *path, int fd, void *buf, size_t n, uint64_t offset)
{
	char *to = buf;
	while (n > 0) {
		const ssize_t got = pread(fd, to, n, (off_t)offset);
		if (got < 0 && errno == EINTR)
			continue;
		if (got < 0)
			return wh_fail_errno(c, "cannot read '%s' at byte %" PRIu64, path, offset);
		if (got == 0)
			return wh_fail(c, WH_E_INPUT,
			               "'%s' ends before byte %" PRIu64
			               ", where %zu bytes more are needed: it is cut short",
			               path, offset, n);
		to += got;
		offset += (uint64_t)got;
		n -= (size_t)got;
	}
	return WH_OK;
}

/* --- which bodies are sources --- */

/* Bytes of all items; false when an item holds a list. */
static bool fixed_bytes(const wh_ply_elem *e, uint64_t *bytes)
{
	*bytes = e->count * e->stride; /* no overflow: the header's check against the file's size */
	return e->stride != 0 || e->nprops == 0 || e->count == 0;
}

static uint32_t offset_of(const wh_ply_elem *e, int prop)
{
	uint32_t off = 0;
	for (int i = 0; i < prop; i++)
		off += wh_type_size(e->props[i].type);
	return off;
}

static bool swapped(const wh_ply *p)
{
	return (p->format == WH_PLY_BE) != (WH_HOST_BIG != 0);
}

void wh_ply_vertex_source(const wh_ply *p, uint64_t base, wh_source *out)
{
	const wh_ply_elem *e = &p->elems[p->vertex];
	const int prop[3] = {p->x, p->y, p->z};
	out->path = p->path;
	out->keep_invalid = p->keep_invalid;
	out->nv = e->count;
	out->vfd = p->fd;
	out->vbase = base;
	out->vstride = (uint32_t)e->stride;
	out->vswap = swapped(p);
	out->afd = -1;
	out->is_double = false;
	for (int k = 0; k < 3; k++) {
		out->voff[k] = offset_of(e, prop[k]);
		out->vtype[k] = e->props[prop[k]].type;
		out->is_double = out->is_double || wh_type_is_wide(out->vtype[k]);
	}
}

/* As if every face were a triangle. False when a face holds another list. */
static bool triangle_layout(const wh_ply *p, uint64_t base, wh_source *out)
{
	const wh_ply_elem *e = &p->elems[p->face];
	const wh_ply_prop *list = &e->props[p->corners];
	for (size_t i = 0; i < e->nprops; i++)
		if (e->props[i].is_list && (int)i != p->corners)
			return false;
	out->nf = e->count;
	out->ffd = p->fd;
	out->fbase = base;
	out->fstride = (uint32_t)e->least + 3 * wh_type_size(list->type);
	out->count_off = offset_of(e, p->corners);
	out->count_type = list->count_type;
	out->ioff = (uint32_t)out->count_off + wh_type_size(list->count_type);
	out->itype = list->type;
	out->fswap = swapped(p);
	return true;
}

bool wh_ply_direct(const wh_ply *p, wh_source *out)
{
	*out = (wh_source){0};
	if (p->format == WH_PLY_ASCII || p->vertex < 0 || p->face < p->vertex ||
	    (p->strips >= 0 && p->elems[p->strips].count > 0))
		return false;
	uint64_t at = p->body;
	uint64_t bytes;
	for (int i = 0; i < p->face; i++) {
		if (!fixed_bytes(&p->elems[i], &bytes))
			return false;
		if (i == p->vertex)
			wh_ply_vertex_source(p, at, out);
		at += bytes;
	}
	return triangle_layout(p, at, out) && (p->size - at) / out->fstride >= out->nf;
}

size_t wh_source_vertex_bytes(const wh_source *s, size_t n)
{
	return n * s->vstride; /* records of attributes are read to where they belong */
}

size_t wh_source_triangle_bytes(const wh_source *s, size_t n)
{
	return n * s->fstride;
}

/* --- vertices --- */

static bool packed_floats(const wh_source *s)
{
	return s->voff[1] == s->voff[0] + 4 && s->voff[2] == s->voff[0] + 8 && !s->vswap &&
	       s->vtype[0] == WH_F32 && s->vtype[1] == WH_F32 && s->vtype[2] == WH_F32;
}

/* The loop for packed floats; inlined with a constant stride where that is known. */
static inline void decode_floats(const unsigned char *from, size_t stride, size_t n, double *xyz)
{
	for (size_t i = 0; i < n; i++) {
		float v[3];
		memcpy(v, from + i * stride, sizeof v);
		xyz[3 * i] = (double)v[0];
		xyz[3 * i + 1] = (double)v[1];
		xyz[3 * i + 2] = (double)v[2];
	}
}

static void decode_column(const wh_source *s, int axis, const unsigned char *from, size_t n,
                          double *xyz)
{
	const wh_type t = s->vtype[axis];
	for (size_t i = 0; i < n; i++, from += s->vstride)
		xyz[3 * i + (size_t)axis] = wh_load_real(from, t, s->vswap);
}

static void decode_vertices(const wh_source *s, const unsigned char *from, size_t n, double *xyz)
{
	if (packed_floats(s) && s->vstride == 12)
		decode_floats(from, 12, n, xyz);
	else if (packed_floats(s))
		decode_floats(from + s->voff[0], s->vstride, n, xyz);
	else
		for (int axis = 0; axis < 3; axis++)
			decode_column(s, axis, from + s->voff[axis], n, xyz);
}

static bool not_finite(double v)
{
	uint64_t u;
	memcpy(&u, &v, sizeof u);
	return (u & 0x7ff0000000000000u) == 0x7ff0000000000000u;
}

static wh_code check_finite(wh_ctx *c, const wh_source *s, uint64_t first, size_t n,
                            const double *xyz)
{
	bool bad = false;
	for (size_t i = 0; i < 3 * n; i++)
		bad |= not_finite(xyz[i]);
	if (!bad)
		return WH_OK;
	size_t i = 0;
	while (!not_finite(xyz[i]))
		i++;
	return wh_fail(c, WH_E_INPUT,
	               "'%s', vertex %" PRIu64 ": %c is %g, not a finite number; 'reduce "
	               "--drop-invalid' goes on without such vertices "
	               "and their faces",
	               s->path, first + i / 3, "xyz"[i % 3], xyz[i]);
}

wh_code wh_source_vertices(wh_ctx *c, const wh_source *s, uint64_t first, size_t n, double *xyz,
                           void *raw)
{
	const uint64_t at = s->vbase + first * s->vstride;
	if (wh_ply_pread(c, s->path, s->vfd, raw, n * s->vstride, at) != WH_OK)
		return c->err.code;
	decode_vertices(s, raw, n, xyz);
	return s->keep_invalid ? WH_OK : check_finite(c, s, first, n, xyz);
}

/* --- attributes --- */

/* One attribute of n vertices after the other: what is done to it does not change in the loop. */
static void load_attributes(const wh_source *s, const unsigned char *from, size_t n,
                            uint8_t *records)
{
	const wh_attributes *a = s->attributes;
	for (uint32_t k = 0; k < a->n; k++) {
		const wh_attribute *item = &a->item[k];
		for (size_t i = 0; i < n; i++)
			wh_attribute_load(item, from + i * s->vstride + item->file_at, s->vswap,
			                  records + i * a->bytes);
	}
}

wh_code wh_source_attributes(wh_ctx *c, const wh_source *s, uint64_t first, size_t n,
                             uint8_t *records, void *raw)
{
	const size_t size = s->attributes->bytes;
	if (s->afd >= 0)
		return wh_ply_pread(c, s->path, s->afd, records, n * size, s->abase + first * size);
	if (wh_ply_pread(c, s->path, s->vfd, raw, n * s->vstride, s->vbase + first * s->vstride) !=
	    WH_OK)
		return c->err.code;
	load_attributes(s, raw, n, records);
	return WH_OK;
}

/* --- triangles --- */

static bool all_threes(const wh_source *s, const unsigned char *from, size_t n)
{
	if (s->count_off < 0)
		return true;
	from += s->count_off;
	bool bad = false;
	if (wh_type_size(s->count_type) == 1)
		for (size_t i = 0; i < n; i++)
			bad |= from[i * s->fstride] != 3;
	else
		for (size_t i = 0; i < n; i++)
			bad |= wh_load_integer(from + i * s->fstride, s->count_type, s->fswap) != 3;
	return !bad;
}

/* 32-bit indices of the host's byte order. Negative ones become 2^31 and more, in range only for
 * unsigned types. */
static inline void decode_u32(const unsigned char *from, size_t stride, size_t n, uint64_t *ids)
{
	for (size_t i = 0; i < n; i++) {
		uint32_t v[3];
		memcpy(v, from + i * stride, sizeof v);
		ids[3 * i] = v[0];
		ids[3 * i + 1] = v[1];
		ids[3 * i + 2] = v[2];
	}
}

static void decode_triangles(const wh_source *s, const unsigned char *from, size_t n, uint64_t *ids)
{
	/* read as unsigned, a negative index is still too great unless there are that many vertices
	 */
	const bool plain =
	    !s->fswap && (s->itype == WH_U32 || (s->itype == WH_I32 && s->nv <= 0x80000000u));
	if (plain && s->fstride == 13 && s->ioff == 1) {
		decode_u32(from + 1, 13, n, ids);
	} else if (plain) {
		decode_u32(from + s->ioff, s->fstride, n, ids);
	} else {
		const uint32_t size = wh_type_size(s->itype);
		for (size_t i = 0; i < n; i++)
			for (size_t k = 0; k < 3; k++)
				ids[3 * i + k] = wh_load_integer(
				    from + i * s->fstride + s->ioff + k * size, s->itype, s->fswap);
	}
}

static wh_code check_range(wh_ctx *c, const wh_source *s, uint64_t first, size_t n,
                           const uint64_t *ids)
{
	bool bad = false;
	for (size_t i = 0; i < 3 * n; i++)
		bad |= ids[i] >= s->nv;
	if (!bad)
		return WH_OK;
	size_t i = 0;
	while (ids[i] < s->nv)
		i++;
	int64_t shown = (int64_t)ids[i];
	if (s->itype == WH_I32)
		shown = (int32_t)ids[i];
	return wh_fail(c, WH_E_INPUT,
	               "'%s', face %" PRIu64 ": corner index %" PRId64
	               " is out of range (the file has %" PRIu64
	               " vertices); remove such faces first",
	               s->path, first + i / 3, shown, s->nv);
}

wh_code wh_source_triangles(wh_ctx *c, const wh_source *s, uint64_t first, size_t n, uint64_t *ids,
                            void *raw)
{
	const uint64_t at = s->fbase + first * s->fstride;
	if (wh_ply_pread(c, s->path, s->ffd, raw, n * s->fstride, at) != WH_OK)
		return c->err.code;
	if (!all_threes(s, raw, n))
		return WH_E_IRREGULAR;
	decode_triangles(s, raw, n, ids);
	return check_range(c, s, first, n, ids);
}
