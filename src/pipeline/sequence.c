#include "pipeline/sequence.h"

#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

enum {
	BUFFER = 1 << 17,           /* bytes */
	FACE = 3 * 4,               /* of the corners of a face */
	CORNERS = BUFFER / FACE * 3 /* at a time */
};

typedef char file_name[32];

static const char *name_of(bool corners, uint32_t generation, uint32_t cluster, file_name name)
{
	(void)snprintf(name, sizeof(file_name), "%s-%u-%u", corners ? "corners" : "sequence",
	               generation, cluster);
	return name;
}

/* ---- numbers ------------------------------------------------------------------------------ */

uint32_t wh_sequence_number_bytes(const wh_sequence *s, uint32_t i)
{
	return i < WH_SEQUENCE_PLACES
	           ? s->coord_bytes
	           : wh_attribute_bytes(&s->attributes->item[(i - WH_SEQUENCE_PLACES) / 2]);
}

uint32_t wh_sequence_numbers_bytes(const wh_sequence *s)
{
	uint32_t sum = 0;
	for (uint32_t i = 0; i < wh_sequence_numbers(s); i++)
		sum += wh_sequence_number_bytes(s, i);
	return sum;
}

uint64_t wh_sequence_get(const uint8_t *at, uint32_t bytes)
{
	uint64_t v = 0;
	for (uint32_t i = 0; i < bytes; i++)
		v |= (uint64_t)at[i] << 8 * i;
	return v;
}

static void put_number(wh_sequence_writer *w, uint64_t v, uint32_t bytes)
{
	for (uint32_t i = 0; i < bytes; i++)
		w->buf[w->used++] = (uint8_t)(v >> 8 * i);
}

static void put_coordinate(wh_sequence_writer *w, double was, double to)
{
	const wh_sequence *s = w->s;
	put_number(w,
	           wh_pmesh_difference(wh_pmesh_ordered(was * s->unscale, s->coord_bytes),
	                               wh_pmesh_ordered(to * s->unscale, s->coord_bytes),
	                               s->coord_bytes),
	           s->coord_bytes);
}

/* From where v is after the collapse, mirrored at where it was before. */
static void put_mirrored(wh_sequence_writer *w, double now, double before, double u)
{
	const wh_sequence *s = w->s;
	const uint32_t bytes = s->coord_bytes;
	const uint64_t from = wh_pmesh_ordered(now * s->unscale, bytes),
	               to = wh_pmesh_ordered(before * s->unscale, bytes);
	put_number(
	    w,
	    wh_pmesh_difference(from - (to - from), wh_pmesh_ordered(u * s->unscale, bytes), bytes),
	    bytes);
}

static void put_places(wh_sequence_writer *w, wh_vec3 now, wh_vec3 v, wh_vec3 u)
{
	put_coordinate(w, now.x, v.x);
	put_coordinate(w, now.y, v.y);
	put_coordinate(w, now.z, v.z);
	put_mirrored(w, now.x, v.x, u.x);
	put_mirrored(w, now.y, v.y, u.y);
	put_mirrored(w, now.z, v.z, u.z);
}

/* `now`: v's properties after the collapse; v's before it, and u's, are the trace's. */
static void put_properties(wh_sequence_writer *w, const uint8_t *now, uint32_t v, uint32_t u)
{
	const wh_trace *t = &w->trace;
	const wh_attributes *a = w->s->attributes;
	uint8_t *of_v = t->attr + (size_t)v * t->attr_bytes;
	const uint8_t *of_u = t->attr + (size_t)u * t->attr_bytes;
	for (uint32_t k = 0; a && k < a->n; k++) {
		const wh_attribute *item = &a->item[k];
		const uint32_t bytes = wh_attribute_bytes(item);
		const uint64_t from = wh_pmesh_property(item, now);
		put_number(w, wh_pmesh_difference(from, wh_pmesh_property(item, of_v), bytes),
		           bytes);
		put_number(w, wh_pmesh_difference(from, wh_pmesh_property(item, of_u), bytes),
		           bytes);
	}
	if (t->attr_bytes)
		memcpy(of_v, now, t->attr_bytes);
}

/* ---- out ---------------------------------------------------------------------------------- */

/* Bytes of a record at most. */
static size_t record_most(const wh_sequence *s)
{
	return sizeof(wh_sequence_step) + wh_sequence_numbers_bytes(s) + (size_t)WH_PMESH_MOVED * 4;
}

size_t wh_sequence_bytes(uint64_t nv, uint64_t nf, uint32_t attr_bytes)
{
	return wh_trace_bytes(nv, nf, attr_bytes) + BUFFER + sizeof(wh_sequence_writer);
}

/* The corners of all faces, as they are before the first collapse. */
static wh_code keep_corners(wh_ctx *c, wh_sequence_writer *w, uint32_t generation, uint32_t cluster)
{
	file_name name;
	const wh_trace *t = &w->trace;
	const size_t all = 3 * (size_t)t->nf;
	const int fd = wh_spill_create(c, w->s->spill, name_of(true, generation, cluster, name));
	wh_code code = fd >= 0 ? WH_OK : wh_failed(c);
	for (size_t i = 0; code == WH_OK && i < all; i += CORNERS) {
		const size_t n = all - i < CORNERS ? all - i : CORNERS;
		for (size_t k = 0; k < n; k++) {
			const uint32_t id = (uint32_t)t->gid[t->at.tri[i + k]];
			memcpy(w->buf + 4 * k, &id, sizeof id);
		}
		code = wh_spill_pwrite(c, w->s->spill, fd, w->buf, 4 * n, 4 * i);
	}
	if (fd >= 0)
		(void)close(fd);
	return code;
}

wh_code wh_sequence_begin(wh_ctx *c, wh_sequence_writer *w, const wh_sequence *s,
                          uint32_t generation, uint32_t cluster, wh_patch *patch, uint32_t first)
{
	file_name name;
	const bool fresh = patch->face_bytes == 0;
	w->s = s;
	w->patch = patch;
	w->used = 0;
	w->off = 0;
	w->fd = -1;
	if (wh_renew(c, &w->buf, &w->cap, BUFFER, 1) != WH_OK ||
	    wh_trace_begin(c, &w->trace, patch, first) != WH_OK ||
	    (fresh && keep_corners(c, w, generation, cluster) != WH_OK))
		return c->err.code;
	w->fd = wh_spill_create(c, s->spill, name_of(false, generation, cluster, name));
	return w->fd >= 0 ? WH_OK : wh_failed(c);
}

static wh_code flush(wh_ctx *c, wh_sequence_writer *w)
{
	const uint64_t at = w->off;
	const size_t n = w->used;
	w->used = 0;
	w->off += n;
	return wh_spill_pwrite(c, w->s->spill, w->fd, w->buf, n, at);
}

static void put_step(wh_sequence_writer *w, const wh_trace_step *s, uint32_t u, uint32_t v,
                     float err)
{
	const wh_trace *t = &w->trace;
	const wh_sequence_step step = {.u = (uint32_t)t->gid[u],
	                               .v = (uint32_t)t->gid[v],
	                               .face = {s->id[0], s->id[1]},
	                               .apex = {s->apex[0], s->apex[1]},
	                               .key = s->key,
	                               .err = err * (float)w->s->unscale,
	                               .moved = t->n,
	                               .way = (uint8_t)s->way,
	                               .faces = (uint8_t)s->faces,
	                               .uv = {s->uv[0], s->uv[1]}};
	memcpy(w->buf + w->used, &step, sizeof step);
	w->used += sizeof step;
}

wh_code wh_sequence_put(wh_ctx *c, void *to, const wh_collapse *one, const uint8_t *attr)
{
	wh_sequence_writer *w = to;
	wh_trace *t = &w->trace;
	const uint32_t u = (uint32_t)w->patch->gid[one->u], v = (uint32_t)w->patch->gid[one->v];
	const wh_vec3 before = t->pos[v];
	wh_trace_step s;
	if (BUFFER - w->used < record_most(w->s) && flush(c, w) != WH_OK)
		return c->err.code;
	if (wh_trace_collapse(c, t, u, v, one->at, (float)one->cost, &s) != WH_OK)
		return c->err.code;
	put_step(w, &s, u, v, one->err);
	put_places(w, one->at, before, t->pos[u]);
	put_properties(w, attr, v, u);
	for (uint32_t i = 0; i < t->n; i++) {
		memcpy(w->buf + w->used, &t->face[t->moved[i] / 3].id, sizeof(uint32_t));
		w->used += sizeof(uint32_t);
	}
	return WH_OK;
}

wh_code wh_sequence_end(wh_ctx *c, wh_sequence_writer *w, wh_patch *patch, wh_code code)
{
	if (code == WH_OK)
		code = flush(c, w);
	if (code == WH_OK)
		code = wh_trace_end(c, &w->trace, patch);
	if (w->fd >= 0)
		(void)close(w->fd);
	return code;
}

void wh_sequence_writer_free(wh_ctx *c, wh_sequence_writer *w)
{
	wh_trace_free(c, &w->trace);
	wh_free(c, w->buf);
	*w = (wh_sequence_writer){0};
}

/* ---- which ones --------------------------------------------------------------------------- */

wh_code wh_sequence_keep(wh_ctx *c, wh_sequence *s, uint32_t generation, uint32_t clusters)
{
	if (wh_reserve(c, &s->part, &s->cap, s->n + 1, sizeof *s->part) != WH_OK)
		return c->err.code;
	s->part[s->n++] = (wh_sequence_part){generation, clusters};
	return WH_OK;
}

void wh_sequence_drop(wh_spill *spill, uint32_t generation, uint32_t clusters)
{
	file_name name;
	for (uint32_t k = 0; k < clusters; k++) {
		wh_spill_remove(spill, name_of(false, generation, k, name));
		wh_spill_remove(spill, name_of(true, generation, k, name));
	}
}

void wh_sequence_free(wh_ctx *c, wh_sequence *s)
{
	wh_free(c, s->part);
	s->part = NULL;
	s->n = s->cap = 0;
}

/* ---- in ----------------------------------------------------------------------------------- */

static void close_file(wh_sequence_reader *r)
{
	if (r->open)
		(void)close(r->fd);
	r->open = false;
}

void wh_sequence_close(wh_ctx *c, wh_sequence_reader *r)
{
	close_file(r);
	wh_free(c, r->buf);
	r->buf = NULL;
}

static wh_code open_file(wh_ctx *c, wh_sequence_reader *r)
{
	file_name name;
	struct stat st;
	const wh_sequence *s = r->s;
	name_of(r->corners, s->part[r->part].generation, r->cluster, name);
	r->fd = wh_spill_read(c, s->spill, name);
	if (r->fd < 0)
		return wh_failed(c);
	r->open = true;
	if (fstat(r->fd, &st) != 0)
		return wh_fail_errno(c, "cannot look at '%s/%s'", s->spill->dir, name);
	r->off = 0;
	r->end = (uint64_t)st.st_size;
	return WH_OK;
}

/* The next file that is not empty; corners are in those of the first part. *more: there is one. */
static wh_code next_file(wh_ctx *c, wh_sequence_reader *r, bool *more)
{
	const wh_sequence *s = r->s;
	const size_t parts = r->corners && s->n > 1 ? 1 : s->n;
	while (r->off == r->end && r->part < parts) {
		if (r->open)
			r->cluster++;
		close_file(r);
		if (r->cluster == s->part[r->part].clusters) {
			r->part++;
			r->cluster = 0;
		} else if (open_file(c, r) != WH_OK) {
			return c->err.code;
		}
	}
	*more = r->off < r->end;
	return WH_OK;
}

/* At least n bytes in the buffer, or all that the file has. */
static wh_code fetch(wh_ctx *c, wh_sequence_reader *r, size_t n)
{
	if (r->n - r->at >= n)
		return WH_OK;
	memmove(r->buf, r->buf + r->at, r->n - r->at);
	r->n -= r->at;
	r->at = 0;
	const uint64_t left = r->end - r->off;
	const size_t some = left < BUFFER - r->n ? (size_t)left : BUFFER - r->n;
	if (wh_poll(c) != WH_OK ||
	    wh_spill_pread(c, r->s->spill, r->fd, r->buf + r->n, some, r->off) != WH_OK)
		return c->err.code;
	r->off += some;
	r->n += some;
	return WH_OK;
}

/* The same of the next file where this one is at its end. *more: there is something. */
static wh_code fetch_next(wh_ctx *c, wh_sequence_reader *r, size_t n, bool *more)
{
	if (!r->buf && !(r->buf = wh_alloc(c, BUFFER, 1)))
		return wh_failed(c);
	*more = r->at < r->n;
	if (!*more && next_file(c, r, more) != WH_OK)
		return c->err.code;
	return *more ? fetch(c, r, n) : WH_OK;
}

static wh_code damaged(wh_ctx *c)
{
	return wh_fail(c, WH_E_RUN,
	               "the record of the collapses in the temporary folder is damaged");
}

wh_code wh_sequence_next(wh_ctx *c, wh_sequence_reader *r, wh_sequence_step *step,
                         const uint8_t **numbers, const uint8_t **moved, bool *more)
{
	const size_t fixed = sizeof *step + wh_sequence_numbers_bytes(r->s);
	if (fetch_next(c, r, record_most(r->s), more) != WH_OK || !*more)
		return c->err.code;
	if (r->n - r->at < fixed)
		return damaged(c);
	memcpy(step, r->buf + r->at, sizeof *step);
	*numbers = r->buf + r->at + sizeof *step;
	*moved = r->buf + r->at + fixed;
	if (step->moved > WH_PMESH_MOVED || step->faces > 2 || step->way >= WH_PMESH_WAYS ||
	    r->n - r->at - fixed < 4 * (size_t)step->moved)
		return damaged(c);
	r->at += fixed + 4 * (size_t)step->moved;
	return WH_OK;
}

wh_code wh_sequence_corners(wh_ctx *c, wh_sequence_reader *r, uint32_t corner[3])
{
	bool more;
	if (fetch_next(c, r, FACE, &more) != WH_OK)
		return c->err.code;
	if (!more || r->n - r->at < FACE)
		return damaged(c);
	memcpy(corner, r->buf + r->at, FACE);
	r->at += FACE;
	return WH_OK;
}
