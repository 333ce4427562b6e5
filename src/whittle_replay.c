/*
 * Progressive meshes played for the caller of the library: ceilings, limits, outputs. What a level
 * is, and how it is reached, is in algo/progressive.
 */
#include "whittle.h"

#include "algo/progressive.h"
#include "exec/topo.h"
#include "io/number.h"
#include "pipeline/finish.h"
#include "pipeline/plan.h"

#include <math.h>
#include <string.h>

struct wh_replay {
	wh_progressive p;
	wh_progressive_morph morph; /* if the caller made one */
	size_t memory;              /* ceiling */
	size_t before;              /* the account's, between calls */
};

/* ---- ceilings ----------------------------------------------------------------------------- */

/* For the time of a call the ceiling is this one's. */
static void enter(wh_ctx *c, wh_replay *r)
{
	c->err = (wh_error){0};
	r->before = c->mem->limit;
	c->mem->limit = r->memory > WH_PLAN_BASE ? r->memory - WH_PLAN_BASE / 2 : WH_PLAN_BASE / 2;
}

static wh_code leave(wh_ctx *c, const wh_replay *r, wh_code code)
{
	c->mem->limit = r->before;
	return code;
}

/* `more`: bytes beside the level's. */
static wh_code refuse_large(wh_ctx *c, const wh_replay *r, uint64_t level, size_t more)
{
	const size_t need = wh_progressive_play_bytes(&r->p.file, level) + more + WH_PLAN_BASE;
	if (need <= r->memory)
		return WH_OK;
	return wh_fail(c, WH_E_PLAN,
	               "'%s': that level needs more memory than the ceiling of %zu MiB: use "
	               "--memory %zuM, or ask for fewer faces",
	               r->p.file.ply.path, r->memory >> 20, (need >> 20) + 1);
}

static wh_code seek(wh_ctx *c, wh_replay *r, uint64_t level)
{
	const uint64_t last = r->p.file.head.splits;
	wh_progressive_morph_free(c, &r->morph);
	level = level < last ? level : last;
	return refuse_large(c, r, level, 0) == WH_OK ? wh_progressive_seek(c, &r->p, level)
	                                             : c->err.code;
}

/* ---- opening ------------------------------------------------------------------------------ */

wh_code wh_replay_open(wh_ctx *c, wh_replay **out, const char *path, size_t memory)
{
	*out = NULL;
	c->err = (wh_error){0};
	wh_replay *r = wh_calloc(c, 1, sizeof *r);
	if (!r)
		return wh_failed(c);
	r->memory = memory ? memory : wh_topo_memory() / 2;
	enter(c, r);
	wh_code code = wh_progressive_open(c, &r->p, path);
	if (code == WH_OK)
		code = seek(c, r, 0);
	(void)leave(c, r, code);
	*out = r;
	if (code != WH_OK)
		wh_replay_close(c, out);
	return code;
}

void wh_replay_close(wh_ctx *c, wh_replay **r)
{
	if (!*r)
		return;
	wh_progressive_morph_free(c, &(*r)->morph);
	wh_progressive_close(c, &(*r)->p);
	wh_free(c, *r);
	*r = NULL;
}

void wh_replay_tell(const wh_replay *r, wh_replay_info *info)
{
	const wh_progressive *p = &r->p;
	const wh_pmesh_head *h = &p->file.head;
	*info = (wh_replay_info){.splits = h->splits,
	                         .base_vertices = h->base_vertices,
	                         .base_faces = h->base_faces,
	                         .vertices = h->base_vertices + h->splits,
	                         .faces = h->faces,
	                         .file_bytes = p->file.ply.size,
	                         .input_bytes = h->input_bytes,
	                         .base_error = (double)h->error,
	                         .diagonal = h->diagonal,
	                         .coloured = p->file.attributes.has_rgb,
	                         .level = p->level,
	                         .level_vertices = p->nv,
	                         .level_faces = p->nf,
	                         .level_error = wh_progressive_error(p),
	                         .memory_least =
	                             wh_progressive_play_bytes(&p->file, h->splits) + WH_PLAN_BASE};
}

/* ---- levels ------------------------------------------------------------------------------- */

/* The larger of a count and a share of what there is. */
static uint64_t loosest(uint64_t count, double share, uint64_t of)
{
	const double part = share * (double)of;
	const uint64_t by_share = !(share > 0) ? 0 : part < 1 ? 1 : (uint64_t)(part + 0.5);
	return count > by_share ? count : by_share;
}

static double least_error(const wh_level *l, double diagonal)
{
	const double share = l->error_share * diagonal;
	if (l->error > 0 && l->error_share > 0)
		return fmin(l->error, share);
	return l->error > 0 ? l->error : share;
}

wh_code wh_replay_find(wh_ctx *c, wh_replay *r, const wh_level *l, uint64_t *level, bool *reached)
{
	const wh_pmesh_head *h = &r->p.file.head;
	const wh_progressive_limit limit = {
	    .faces = loosest(l->faces, l->face_ratio, h->faces),
	    .vertices = loosest(l->vertices, l->vertex_ratio, h->base_vertices + h->splits),
	    .error = least_error(l, h->diagonal)};
	*level = h->splits;
	*reached = true;
	if (!limit.faces && !limit.vertices && !(limit.error > 0))
		return WH_OK;
	enter(c, r);
	return leave(c, r, wh_progressive_find(c, &r->p, &limit, level, reached));
}

wh_code wh_replay_seek(wh_ctx *c, wh_replay *r, uint64_t level)
{
	enter(c, r);
	return leave(c, r, seek(c, r, level));
}

/* ---- meshes ------------------------------------------------------------------------------- */

/* The vertices of an output. */
typedef struct shape {
	wh_vec3 *pos;
	uint8_t *attr; /* records of the file's attributes */
} shape;

/* What the output has room for of the properties of vertices, and records of that. */
typedef struct carried {
	wh_attributes attributes;
	uint8_t *records; /* NULL: those of the shape */
} carried;

/* The records of all vertices with what is left of them. */
static wh_code shorten(wh_ctx *c, const wh_progressive *p, const shape *s, carried *k)
{
	const wh_attributes *all = &p->file.attributes, *some = &k->attributes;
	k->records = wh_alloc(c, p->nv, some->bytes);
	if (!k->records)
		return wh_failed(c);
	for (uint32_t i = 0; i < some->n; i++) {
		wh_attribute *item = &some->item[i];
		const wh_attribute *was = wh_attributes_find(all, item->prop);
		item->out = was->out;
		for (size_t v = 0; v < p->nv; v++)
			memcpy(k->records + v * some->bytes + item->at,
			       s->attr + v * all->bytes + was->at, wh_attribute_bytes(item));
	}
	return WH_OK;
}

static wh_code carry(wh_ctx *c, const wh_progressive *p, const shape *s, wh_format to, carried *k)
{
	const wh_wanted held = {NULL, wh_mesh_holds(to) & (uint32_t)WH_HOLDS_ALL};
	*k = (carried){0};
	if (held.holds == WH_HOLDS_ALL || p->file.attributes.n == 0)
		return WH_OK;
	if (wh_attributes_choose(c, &p->file.ply, held, &k->attributes) != WH_OK)
		return c->err.code;
	return k->attributes.n ? shorten(c, p, s, k) : WH_OK;
}

static wh_code write_mesh(wh_ctx *c, const wh_progressive *p, const shape *s, wh_outfile *o,
                          const wh_replay_output *out, wh_format to)
{
	carried k;
	uint64_t vertices;
	wh_progress silent = {.telling = ATOMIC_FLAG_INIT};
	wh_code code = carry(c, p, s, to, &k);
	const bool whole = to == WH_FORMAT_PLY;
	const wh_attributes *a = whole ? &p->file.attributes : &k.attributes;
	const wh_patch patch = {.nv = p->nv,
	                        .nf = p->nf,
	                        .pos = s->pos,
	                        .tri = p->at.tri,
	                        .attr = whole ? s->attr : k.records,
	                        .attr_bytes = a->bytes};
	const wh_ply_style style = {.ascii = out->ascii,
	                            .is_double = p->file.head.coord_bytes == 8,
	                            .format = to,
	                            .quantize = out->quantize,
	                            .attributes = a->n ? a : NULL};
	if (code == WH_OK)
		code = wh_finish_write(c, &silent, o, style, &patch, 1, &vertices);
	wh_free(c, k.records);
	wh_attributes_free(c, &k.attributes);
	return code;
}

/* Ends an output, whole or not. */
static wh_code finish(wh_ctx *c, wh_outfile **o, wh_code code, char checksum[33])
{
	if (code == WH_OK)
		code = wh_outfile_end(c, *o);
	if (code == WH_OK && checksum)
		wh_outfile_checksum(*o, checksum);
	if (code == WH_OK)
		code = wh_outfile_commit(c, o);
	wh_outfile_abort(c, o);
	return code;
}

static wh_code write_shape(wh_ctx *c, const wh_progressive *p, const shape *s,
                           const wh_replay_output *out, char checksum[33])
{
	wh_format to;
	wh_packing packing;
	wh_outfile *o = NULL;
	if (wh_format_of_output(c, out->to, out->path, &to, &packing) != WH_OK)
		return c->err.code;
	if (out->quantize && to != WH_FORMAT_GLB)
		return wh_fail(c, WH_E_USAGE, "only GLB is written with quantized positions");
	wh_code code = wh_outfile_open(c, &o, out->path, out->force);
	if (code == WH_OK)
		code = wh_outfile_pack(c, o, packing);
	if (code == WH_OK)
		code = write_mesh(c, p, s, o, out, to);
	return finish(c, &o, code, checksum);
}

wh_code wh_replay_write(wh_ctx *c, wh_replay *r, const wh_replay_output *out, char checksum[33])
{
	const shape s = {r->p.pos, r->p.attr};
	enter(c, r);
	return leave(c, r, write_shape(c, &r->p, &s, out, checksum));
}

/* ---- morphs ------------------------------------------------------------------------------- */

static wh_code morph(wh_ctx *c, wh_replay *r, uint64_t from, uint64_t to)
{
	const uint64_t last = r->p.file.head.splits;
	from = from < last ? from : last;
	to = to < last ? to : last;
	wh_progressive_morph_free(c, &r->morph);
	if (refuse_large(c, r, from > to ? from : to,
	                 wh_progressive_morph_bytes(&r->p.file, from, to)) != WH_OK)
		return c->err.code;
	return wh_progressive_morph_make(c, &r->p, from, to, &r->morph);
}

wh_code wh_replay_morph(wh_ctx *c, wh_replay *r, uint64_t from, uint64_t to)
{
	enter(c, r);
	return leave(c, r, morph(c, r, from, to));
}

wh_code wh_replay_write_morph(wh_ctx *c, wh_replay *r, double t, const wh_replay_output *out,
                              char checksum[33])
{
	const wh_progressive_morph *m = &r->morph;
	const shape s = {m->pos, m->attr};
	if (!m->p)
		return wh_fail(c, WH_E_USAGE,
		               "there is no morph to be written: call wh_replay_morph");
	if (!(t >= 0 && t <= 1))
		return wh_fail(c, WH_E_USAGE, "a morph goes from 0 to 1, and has no %g", t);
	enter(c, r);
	wh_progressive_morph_at(m, t);
	return leave(c, r, write_shape(c, &r->p, &s, out, checksum));
}

/* ---- text --------------------------------------------------------------------------------- */

enum { FACES_A_TIME = 16, LINE = (FACES_A_TIME + 8) * WH_NUMBER_TEXT };

static char *put_whole(char *to, uint64_t n)
{
	to = wh_print_whole(to, n);
	*to++ = ' ';
	return to;
}

static char *put_place(char *to, const wh_progressive *p, wh_vec3 at)
{
	const double xyz[3] = {at.x, at.y, at.z};
	for (int k = 0; k < 3; k++) {
		to = wh_print_real(to, p->file.head.coord_bytes == 8, xyz[k]);
		*to++ = ' ';
	}
	return to;
}

/* The collapse of split j, which was undone just now. */
static wh_code write_line(wh_ctx *c, const wh_progressive *p, uint32_t j, wh_outfile *o)
{
	const uint32_t *moved = &p->moved[p->first[j]], n = p->first[j + 1] - p->first[j];
	char *line = wh_outfile_room(c, o, LINE), *to = line;
	if (!line)
		return wh_failed(c);
	to = put_whole(put_whole(to, p->nv), p->v[j]);
	to = put_whole(put_place(to, p, p->pos[p->v[j]]), p->faces[j]);
	for (uint32_t i = 0; i < p->faces[j]; i++)
		to = put_whole(to, (uint64_t)p->nf + i);
	to = put_whole(to, n);
	for (uint32_t i = 0; i < n; i++) {
		if (i > 0 && i % FACES_A_TIME == 0) {
			wh_outfile_advance(o, (size_t)(to - line));
			line = to = wh_outfile_room(c, o, LINE);
			if (!line)
				return wh_failed(c);
		}
		to = put_whole(to, moved[i] / 3);
	}
	to[-1] = '\n';
	wh_outfile_advance(o, (size_t)(to - line));
	return WH_OK;
}

static wh_code write_lines(wh_ctx *c, wh_progressive *p, uint64_t level, wh_outfile *o)
{
	while (p->level > level) {
		const uint32_t j = p->level - 1;
		if (wh_poll_at(c, j) != WH_OK || wh_progressive_seek(c, p, j) != WH_OK ||
		    write_line(c, p, j, o) != WH_OK)
			return wh_failed(c);
	}
	return WH_OK;
}

wh_code wh_replay_text(wh_ctx *c, wh_replay *r, uint64_t level, const char *path, bool force)
{
	wh_outfile *o = NULL;
	enter(c, r);
	wh_code code = wh_outfile_open(c, &o, path, force);
	if (code == WH_OK)
		code = write_lines(c, &r->p, level, o);
	return leave(c, r, finish(c, &o, code, NULL));
}
