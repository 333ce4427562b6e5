#include "pipeline/rewrite.h"

#include "base/bytes.h"
#include "base/real.h"
#include "io/number.h"
#include "io/ply_value.h"

#include <inttypes.h>
#include <math.h>
#include <string.h>

void wh_rewrite_restart(wh_rewrite *w)
{
	const wh_ply_elem *e = &w->ply->elems[w->ply->vertex];
	const int prop[3] = {w->ply->x, w->ply->y, w->ply->z};
	wh_source *s = &w->source;
	*s = (wh_source){.path = w->ply->path,
	                 .nv = e->count,
	                 .vfd = w->fd,
	                 .keep_invalid = w->ply->keep_invalid};
	s->is_double = w->wider;
	w->white = w->bright ? 255 : 1;
	for (int k = 0; k < 3; k++)
		s->is_double = s->is_double || wh_type_is_wide(e->props[prop[k]].type);
	const wh_type type = s->is_double ? WH_F64 : WH_F32;
	for (uint32_t k = 0; k < 3; k++) {
		s->vtype[k] = type;
		s->voff[k] = k * wh_type_size(type);
	}
	s->vstride = 3 * wh_type_size(type);
	s->attributes = w->attributes;
	s->wedges = w->wedges;
	s->afd = w->fd;
	s->abase = s->nv * s->vstride;
	w->end = s->abase + s->nv * wh_rewrite_record(w);
}

wh_code wh_rewrite_open(wh_ctx *c, wh_rewrite *w, const wh_exec *ex, wh_spill *spill,
                        const wh_ply *ply, const wh_attributes *attributes, const wh_wedges *wedges)
{
	*w = (wh_rewrite){.ply = ply,
	                  .attributes = attributes,
	                  .wedges = wedges,
	                  .ex = ex,
	                  .spill = spill,
	                  .fd = -1};
	w->facers = wh_calloc(c, (size_t)ex->workers, sizeof *w->facers);
	if (!w->facers)
		return c->err.code;
	w->fd = wh_spill_scratch(c, spill);
	if (w->fd < 0) {
		wh_rewrite_close(c, w, false);
		return c->err.code;
	}
	wh_rewrite_restart(w);
	for (int i = 0; i < ex->workers; i++)
		wh_facer_init(&w->facers[i], &w->source);
	return WH_OK;
}

bool wh_rewrite_heed(wh_rewrite *w, wh_told told)
{
	if (told.wide)
		w->wider = true;
	if (told.bright)
		w->bright = true;
	return wh_rewrite_is_due(w);
}

bool wh_rewrite_is_due(const wh_rewrite *w)
{
	return (w->wider && !w->source.is_double) || (w->bright && w->white <= 1);
}

/* A mean of colours from 0 to 1 may come out above 1, but not by so much. */
static const double BRIGHT = 2;

const char *wh_rewrite_scan(const wh_rewrite *w, const wh_attribute *a, const char *s,
                            uint8_t *record, wh_told *told)
{
	double v;
	if (!w->ply->undeclared || a->kind != WH_KIND_COLOUR)
		return wh_attribute_scan(a, s, record);
	const char *end = wh_scan_real(s, &v);
	if (!end)
		return NULL;
	told->bright = told->bright || v > BRIGHT;
	wh_attribute_set(a, record, v / w->white);
	return end;
}

void wh_rewrite_untold(const wh_attribute *a, uint8_t *record)
{
	wh_attribute_set(a, record, a->kind == WH_KIND_COLOUR ? wh_type_white(a->type) : 0);
}

void wh_rewrite_set_vertices(wh_rewrite *w, uint64_t nv)
{
	w->source.nv = nv;
	w->end = nv * w->source.vstride;
	for (int i = 0; i < w->ex->workers; i++)
		wh_facer_init(&w->facers[i], &w->source);
}

void wh_rewrite_close(wh_ctx *c, wh_rewrite *w, bool keep)
{
	if (!w->facers)
		return;
	for (int i = 0; i < w->ex->workers; i++)
		wh_facer_close(c, &w->facers[i]);
	wh_free(c, w->facers);
	w->facers = NULL;
	if (!keep && w->fd >= 0)
		wh_spill_close_scratch(w->spill, w->fd);
}

void wh_rewrite_vertices_in_place(wh_rewrite *w, uint64_t base)
{
	wh_ply_vertex_source(w->ply, base, &w->source);
	w->end = 0;
}

/* Narrows in place: the floats never overtake the doubles. */
static void to_floats(double *xyz, size_t n)
{
	unsigned char *to = (unsigned char *)xyz;
	for (size_t i = 0; i < 3 * n; i++) {
		const float v = (float)xyz[i];
		memcpy(to + 4 * i, &v, sizeof v);
	}
}

wh_code wh_rewrite_put_vertices(wh_ctx *c, wh_rewrite *w, uint64_t first, double *xyz, size_t n)
{
	const bool is_double = w->source.is_double;
	for (size_t i = 0; i < 3 * n; i++)
		if (!isfinite(is_double ? xyz[i] : wh_round_float(xyz[i])) && !w->ply->keep_invalid)
			return wh_fail(c, WH_E_INPUT,
			               "'%s', vertex %" PRIu64
			               ": %c is not a finite number%s; 'reduce --drop-invalid' "
			               "goes on without such vertices and their faces",
			               w->ply->path, first + i / 3, "xyz"[i % 3],
			               isfinite(xyz[i]) ? " of type float" : "");
	if (!is_double)
		to_floats(xyz, n);
	return wh_spill_pwrite(c, w->spill, w->fd, xyz, n * w->source.vstride,
	                       first * w->source.vstride);
}

wh_code wh_rewrite_put_attributes(wh_ctx *c, wh_rewrite *w, uint64_t first, const uint8_t *records,
                                  size_t n)
{
	const size_t size = wh_rewrite_record(w);
	if (size == 0)
		return WH_OK;
	return wh_spill_pwrite(c, w->spill, w->fd, records, n * size,
	                       w->source.abase + first * size);
}

wh_code wh_rewrite_start_faces(wh_ctx *c, wh_rewrite *w)
{
	wh_source *s = &w->source;
	s->ffd = w->fd;
	s->fbase = w->end;
	s->nf = 0;
	s->itype = s->nv > UINT32_MAX ? WH_U64 : WH_U32;
	s->fstride = 3 * wh_type_size(s->itype) + (w->wedges ? w->wedges->bytes : 0);
	s->count_off = -1;
	w->polygons = w->degenerate = w->invalid = 0;
	for (int i = 0; i < w->ex->workers; i++) {
		w->facers[i].out_n = 0;
		w->facers[i].polygons = w->facers[i].degenerate = w->facers[i].invalid = 0;
	}
	return wh_poll(c);
}

uint8_t *wh_rewrite_carried(wh_ctx *c, const wh_rewrite *w, uint8_t **room, size_t *cap, size_t n)
{
	const wh_wedges *we = w->wedges;
	const size_t corners = n * we->corner.bytes;
	if (wh_reserve(c, room, cap, corners + we->face.bytes + 1, 1) != WH_OK)
		return NULL;
	for (size_t i = 0; i < n; i++)
		wh_wedges_no_corner(we, *room + i * we->corner.bytes);
	memset(*room + corners, 0, we->face.bytes);
	return *room;
}

wh_code wh_rewrite_take(wh_ctx *c, wh_rewrite *w, wh_facer *f)
{
	const size_t bytes = f->out_n * w->source.fstride;
	if (wh_spill_pwrite(c, w->spill, w->fd, f->out, bytes, w->end) != WH_OK)
		return c->err.code;
	w->end += bytes;
	w->source.nf += f->out_n;
	w->polygons += f->polygons;
	w->degenerate += f->degenerate;
	w->invalid += f->invalid;
	f->out_n = 0;
	f->polygons = f->degenerate = f->invalid = 0;
	return WH_OK;
}

wh_code wh_rewrite_bad_index(wh_ctx *c, const wh_rewrite *w, const wh_ply_elem *e, uint64_t item,
                             uint64_t id, const char *place)
{
	return wh_fail(c, WH_E_INPUT,
	               "'%s', %s %" PRIu64 " (%s): corner index %" PRId64
	               " is out of range (the file has %" PRIu64
	               " vertices); remove such faces first",
	               w->ply->path, e->name, item, place, (int64_t)id, w->source.nv);
}

wh_code wh_rewrite_bad_texcoords(wh_ctx *c, const wh_rewrite *w, const wh_ply_elem *e,
                                 uint64_t item, uint64_t values, uint64_t n, const char *place)
{
	return wh_fail(c, WH_E_INPUT,
	               "'%s', %s %" PRIu64 " (%s): %s has %" PRIu64 " values for %" PRIu64
	               " corners, where there are two for each, or none at all; --attributes none "
	               "goes on without them",
	               w->ply->path, e->name, item, place, e->props[w->wedges->list].name, values,
	               n);
}
