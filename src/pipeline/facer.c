#include "pipeline/facer.h"

#include <math.h>
#include <string.h>

void wh_facer_init(wh_facer *f, const wh_source *source)
{
	*f = (wh_facer){.source = source,
	                .index_size = source->nv > UINT32_MAX ? 8 : 4,
	                .wedges = source->wedges};
}

void wh_facer_close(wh_ctx *c, wh_facer *f)
{
	wh_positions_close(c, &f->positions);
	wh_free(c, f->cutter);
	wh_free(c, f->ids);
	wh_free(c, f->which);
	wh_free(c, f->pos);
	wh_free(c, f->cut);
	wh_free(c, f->out);
	*f = (wh_facer){0};
}

/* What a triangle of corners `at` of a face of n carries. */
static void put_carried(const wh_facer *f, size_t n, const uint32_t at[3], unsigned char *to)
{
	const wh_wedges *w = f->wedges;
	const size_t size = w->corner.bytes;
	for (uint32_t k = 0; k < 3; k++)
		if (f->carried)
			memcpy(to + k * size, f->carried + at[k] * size, size);
		else
			wh_wedges_no_corner(w, to + k * size);
	if (f->carried)
		memcpy(to + 3 * size, f->carried + n * size, w->face.bytes);
	else
		memset(to + 3 * size, 0, w->face.bytes);
}

/* A triangle of three corners of a face of n. */
static wh_code put(wh_ctx *c, wh_facer *f, const uint64_t *ids, size_t n, const uint32_t at[3])
{
	const uint64_t a = ids[at[0]], b = ids[at[1]], d = ids[at[2]];
	const size_t carried = f->wedges ? f->wedges->bytes : 0;
	const size_t size = 3 * (size_t)f->index_size + carried;
	if (a == b || b == d || d == a)
		return WH_OK;
	const size_t used = f->out_n * size;
	if (used + size > f->out_cap &&
	    wh_reserve(c, &f->out, &f->out_cap, used + size, 1) != WH_OK)
		return c->err.code;
	if (carried)
		put_carried(f, n, at, f->out + used + size - carried);
	if (f->index_size == 4) {
		const uint32_t t[3] = {(uint32_t)a, (uint32_t)b, (uint32_t)d};
		memcpy(f->out + used, t, sizeof t);
	} else {
		const uint64_t t[3] = {a, b, d};
		memcpy(f->out + used, t, sizeof t);
	}
	f->out_n++;
	return WH_OK;
}

wh_code wh_facer_put(wh_ctx *c, wh_facer *f, uint64_t a, uint64_t b, uint64_t d)
{
	return put(c, f, (const uint64_t[]){a, b, d}, 3, (const uint32_t[]){0, 1, 2});
}

/* --- polygons --- */

static wh_code prepare(wh_ctx *c, wh_facer *f)
{
	if (f->positions.pages)
		return WH_OK;
	f->cutter = wh_alloc(c, 1, sizeof *f->cutter);
	f->ids = wh_alloc(c, WH_POLYGON_MOST, sizeof *f->ids);
	f->which = wh_alloc(c, WH_POLYGON_MOST, sizeof *f->which);
	f->pos = wh_alloc(c, WH_POLYGON_MOST, sizeof *f->pos);
	f->cut = wh_alloc(c, WH_POLYGON_MOST, 3 * sizeof *f->cut);
	if (!f->cutter || !f->ids || !f->which || !f->pos || !f->cut)
		return c->err.code;
	return wh_positions_open(c, &f->positions, f->source, WH_POSITIONS_MOST);
}

static bool three_different(const uint64_t *ids, size_t n)
{
	size_t i = 1;
	while (i < n && ids[i] == ids[0])
		i++;
	for (size_t k = i + 1; k < n; k++)
		if (ids[k] != ids[0] && ids[k] != ids[i])
			return true;
	return false;
}

/* Copies the corners without those that repeat the one before them; and which ones they are. */
static size_t without_repeats(const uint64_t *ids, size_t n, uint64_t *to, uint32_t *which)
{
	size_t k = 0;
	for (size_t i = 0; i < n; i++)
		if (ids[i] != ids[i > 0 ? i - 1 : n - 1]) {
			which[k] = (uint32_t)i;
			to[k++] = ids[i];
		}
	return k;
}

/* Looks at the corners' positions where one of them may not be finite. */
static wh_code look_for_invalid(wh_ctx *c, wh_facer *f, const uint64_t *ids, size_t n, bool *found)
{
	*found = false;
	if (!f->source->keep_invalid)
		return WH_OK;
	if (prepare(c, f) != WH_OK)
		return c->err.code;
	for (size_t i = 0; i < n && !*found; i++) {
		wh_vec3 p;
		if (wh_positions_get(c, &f->positions, ids[i], &p) != WH_OK)
			return c->err.code;
		*found = !isfinite(p.x) || !isfinite(p.y) || !isfinite(p.z);
	}
	return WH_OK;
}

static wh_code add_fan(wh_ctx *c, wh_facer *f, const uint64_t *ids, size_t n)
{
	size_t tip = 0;
	for (size_t i = 1; i < n; i++)
		tip = ids[i] < ids[tip] ? i : tip;
	for (size_t i = 0; i < n; i++) {
		const uint32_t at[3] = {(uint32_t)tip, (uint32_t)i,
		                        (uint32_t)(i + 1 < n ? i + 1 : 0)};
		if (put(c, f, ids, n, at) != WH_OK)
			return c->err.code;
	}
	return WH_OK;
}

static wh_code add_polygon(wh_ctx *c, wh_facer *f, const uint64_t *ids, size_t n)
{
	if (prepare(c, f) != WH_OK)
		return c->err.code;
	const size_t all = n;
	n = without_repeats(ids, n, f->ids, f->which);
	for (size_t i = 0; i < n; i++)
		if (wh_positions_get(c, &f->positions, f->ids[i], &f->pos[i]) != WH_OK)
			return c->err.code;
	const size_t triangles = wh_polygon_cut(f->pos, f->ids, n, f->cut, f->cutter);
	for (size_t i = 0; i < triangles; i++) {
		const uint32_t *t = f->cut + 3 * i;
		const uint32_t at[3] = {f->which[t[0]], f->which[t[1]], f->which[t[2]]};
		if (put(c, f, ids, all, at) != WH_OK)
			return c->err.code;
	}
	return WH_OK;
}

wh_code wh_facer_add(wh_ctx *c, wh_facer *f, const uint64_t *ids, size_t n)
{
	f->polygons += n > 3;
	if (!three_different(ids, n)) {
		f->degenerate++;
		return WH_OK;
	}
	if (n == 3)
		return put(c, f, ids, 3, (const uint32_t[]){0, 1, 2});
	bool invalid;
	if (look_for_invalid(c, f, ids, n, &invalid) != WH_OK)
		return c->err.code;
	f->invalid += invalid;
	if (invalid)
		return WH_OK;
	return n > WH_POLYGON_MOST ? add_fan(c, f, ids, n) : add_polygon(c, f, ids, n);
}

/* --- strips --- */

void wh_facer_strip_start(wh_facer *f)
{
	f->have = 0;
	f->odd = false;
}

wh_code wh_facer_strip_corner(wh_ctx *c, wh_facer *f, uint64_t id)
{
	wh_code code = WH_OK;
	if (f->have == 2) {
		code = f->odd ? wh_facer_put(c, f, f->b, f->a, id)
		              : wh_facer_put(c, f, f->a, f->b, id);
		f->odd = !f->odd;
	} else {
		f->have++;
	}
	f->a = f->b;
	f->b = id;
	return code;
}
