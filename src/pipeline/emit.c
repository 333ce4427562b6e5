#include "pipeline/emit.h"

#include "base/idmap.h"
#include "mesh/order.h"
#include "pipeline/atlas.h"
#include "pipeline/round.h"

#include <stdlib.h>
#include <string.h>

/* What one worker needs. */
typedef struct workspace {
	wh_store_workspace load;
	wh_patch patch;
	wh_order_workspace order;
	double *xyz; /* of the vertices to write */
	size_t xyz_cap;
	uint32_t *number; /* in the output, per vertex */
	size_t number_cap;
	wh_mesh_box box;
	wh_atlas_room room;
	wh_patch *p; /* what is written: the patch, or that with doubled vertices */
} workspace;

/* One of the copies of a doubled cut vertex, which differ in their attributes. */
typedef struct cut_copy {
	uint64_t number; /* in the output */
	size_t next;     /* 1 + the place of another one; 0: none */
} cut_copy;

typedef struct emit {
	const wh_store *store;
	wh_progress *progress;
	wh_mesh_out out;
	double unscale; /* a power of two */
	workspace *workspace;
	const wh_ply_style *style;
	bool counting; /* vertices are not written yet */
	wh_idmap cut;  /* cut vertices: their number in the output; 1 + a place among the copies
	                  where they are doubled */
	cut_copy *copy;
	uint8_t *copy_attr; /* their records */
	size_t copies, cap_copy, cap_copy_attr;
	uint64_t *first; /* per cluster, and the end: number of its first vertex */
} emit;

static wh_code load_ordered(wh_ctx *c, const emit *e, workspace *ws, int64_t k)
{
	if (wh_store_load(c, e->store, (uint32_t)k, &ws->load, &ws->patch) != WH_OK)
		return c->err.code;
	ws->p = &ws->patch;
	if (wh_patch_order(c, &ws->patch, &ws->order) != WH_OK || !e->style->doubled)
		return c->err.code;
	return wh_atlas_double(c, &ws->patch, e->style->attributes, e->style->wedges,
	                       e->style->doubled, &ws->room, &ws->p);
}

/* ---- vertices ----------------------------------------------------------------------------- */

static wh_code vertices_job(wh_ctx *c, void *arg, int64_t index, int worker)
{
	const emit *e = arg;
	workspace *ws = &e->workspace[worker];
	if (load_ordered(c, e, ws, index) != WH_OK)
		return c->err.code;
	return wh_reserve(c, &ws->xyz, &ws->xyz_cap, 3 * (size_t)ws->p->nv, sizeof *ws->xyz);
}

/* Of the copies of a cut vertex, the one with such a record: 1 + its place; 0: there is none. */
static size_t find_copy(const emit *e, size_t first, const uint8_t *record, size_t bytes)
{
	while (first && memcmp(e->copy_attr + (first - 1) * bytes, record, bytes) != 0)
		first = e->copy[first - 1].next;
	return first;
}

/* *ours: the copy with such a record has this number; a new one gets it. */
static wh_code claim_copy(wh_ctx *c, emit *e, uint64_t *first, const uint8_t *record, size_t bytes,
                          uint64_t number, bool *ours)
{
	const size_t at = find_copy(e, *first, record, bytes);
	*ours = at ? e->copy[at - 1].number == number : true;
	if (at)
		return WH_OK;
	if (wh_reserve(c, &e->copy, &e->cap_copy, e->copies + 1, sizeof *e->copy) != WH_OK ||
	    wh_reserve(c, &e->copy_attr, &e->cap_copy_attr, (e->copies + 1) * bytes, 1) != WH_OK)
		return c->err.code;
	memcpy(e->copy_attr + e->copies * bytes, record, bytes);
	e->copy[e->copies++] = (cut_copy){number, *first};
	*first = e->copies;
	return WH_OK;
}

/* *ours: vertex v, which is cut, has this number; one that has none gets it. */
static wh_code claim(wh_ctx *c, emit *e, const wh_patch *p, uint32_t v, uint64_t number, bool *ours)
{
	bool fresh;
	uint64_t *value = wh_idmap_put(c, &e->cut, p->gid[v], &fresh);
	if (!value)
		return c->err.code;
	if (e->style->doubled)
		return claim_copy(c, e, value, wh_patch_attr(p, v), p->attr_bytes, number, ours);
	*ours = fresh;
	if (fresh)
		*value = number;
	return WH_OK;
}

/* The number of a cut vertex. */
static uint64_t number_of(const emit *e, const wh_patch *p, uint32_t v)
{
	const uint64_t at = *wh_idmap_get(&e->cut, p->gid[v]);
	if (!e->style->doubled)
		return at;
	return e->copy[find_copy(e, at, wh_patch_attr(p, v), p->attr_bytes) - 1].number;
}

static wh_code vertices_commit(wh_ctx *c, void *arg, int64_t index, int worker)
{
	emit *e = arg;
	workspace *ws = &e->workspace[worker];
	const wh_patch *p = ws->p;
	size_t n = 0;
	for (uint32_t v = 0; v < p->nv; v++) {
		bool ours = true;
		if ((p->flag[v] & WH_CUT) && claim(c, e, p, v, e->first[index] + n, &ours) != WH_OK)
			return c->err.code;
		if (!ours)
			continue;
		const wh_vec3 q = wh_scale(p->pos[v], e->unscale);
		ws->xyz[3 * n] = q.x;
		ws->xyz[3 * n + 1] = q.y;
		ws->xyz[3 * n + 2] = q.z;
		if (p->attr_bytes && n < v)
			memcpy(wh_patch_attr(p, (uint32_t)n), wh_patch_attr(p, v), p->attr_bytes);
		n++;
	}
	e->first[index + 1] = e->first[index] + n;
	wh_progress_add(e->progress, p->nf);
	return e->counting ? WH_OK : wh_mesh_vertices(c, &e->out, ws->xyz, p->attr, n);
}

/* ---- faces -------------------------------------------------------------------------------- */

static wh_code faces_job(wh_ctx *c, void *arg, int64_t index, int worker)
{
	const emit *e = arg;
	workspace *ws = &e->workspace[worker];
	if (load_ordered(c, e, ws, index) != WH_OK)
		return c->err.code;
	const wh_patch *p = ws->p;
	if (wh_reserve(c, &ws->number, &ws->number_cap, p->nv, sizeof *ws->number) != WH_OK)
		return c->err.code;
	uint64_t next = e->first[index];
	for (uint32_t v = 0; v < p->nv; v++) {
		const uint64_t number = p->flag[v] & WH_CUT ? number_of(e, p, v) : next;
		ws->number[v] = (uint32_t)number;
		next += number == next;
	}
	for (size_t i = 0; i < 3 * (size_t)p->nf; i++)
		p->tri[i] = ws->number[p->tri[i]];
	return WH_OK;
}

static wh_code faces_commit(wh_ctx *c, void *arg, int64_t index, int worker)
{
	(void)index;
	emit *e = arg;
	const wh_patch *p = e->workspace[worker].p;
	wh_progress_add(e->progress, p->nf);
	return wh_mesh_triangles(c, &e->out, p->tri, p->face_bytes ? p->face : NULL, p->nf);
}

/* ---- formats that need something else ----------------------------------------------------- */

static wh_code box_job(wh_ctx *c, void *arg, int64_t index, int worker)
{
	const emit *e = arg;
	workspace *ws = &e->workspace[worker];
	if (wh_store_load(c, e->store, (uint32_t)index, &ws->load, &ws->patch) != WH_OK)
		return c->err.code;
	for (uint32_t v = 0; v < ws->patch.nv; v++) {
		const wh_vec3 q = wh_scale(ws->patch.pos[v], e->unscale);
		wh_mesh_box_add(&ws->box, (const double[3]){q.x, q.y, q.z});
	}
	return WH_OK;
}

/* Bounds of all vertices: the same whichever worker meets them. */
static wh_code find_box(wh_ctx *c, const wh_exec *ex, emit *e, wh_mesh_box *box)
{
	if (wh_exec_for(c, ex, e->store->clusters, box_job, e) != WH_OK)
		return c->err.code;
	for (int i = 0; i < ex->workers; i++)
		wh_mesh_box_join(box, &e->workspace[i].box);
	return WH_OK;
}

static wh_code facets_job(wh_ctx *c, void *arg, int64_t index, int worker)
{
	const emit *e = arg;
	return load_ordered(c, e, &e->workspace[worker], index);
}

static wh_code facets_commit(wh_ctx *c, void *arg, int64_t index, int worker)
{
	(void)index;
	emit *e = arg;
	const wh_patch *p = &e->workspace[worker].patch;
	wh_progress_add(e->progress, (uint64_t)2 * p->nf);
	return wh_mesh_facets(c, &e->out, &p->pos->x, e->unscale, p->tri, p->nf);
}

/* ---- all of it ---------------------------------------------------------------------------- */

size_t wh_emit_bytes(const wh_store *store, const struct wh_attributes *doubled, uint64_t nv,
                     uint64_t nf)
{
	return (doubled ? wh_atlas_room_bytes(nv, nf, doubled) : 0) +
	       wh_store_workspace_bytes(store, nv, nf) +
	       wh_patch_bytes(nv, nf, store->attr_bytes, store->face_bytes) +
	       (size_t)nv * (24 + 4) + wh_patch_order_bytes(nv, nf, store->face_bytes);
}

/* Room for the largest cluster. */
static wh_code workspaces_fit(wh_ctx *c, const emit *e, int workers)
{
	uint64_t nv, nf, faces, vertices;
	if (wh_round_extent(c, e->store, &nv, &nf, &faces, &vertices) != WH_OK)
		return c->err.code;
	for (int i = 0; i < workers; i++) {
		workspace *ws = &e->workspace[i];
		ws->patch.attr_bytes = e->store->attr_bytes;
		ws->patch.face_bytes = e->store->face_bytes;
		if (wh_store_workspace_fit(c, e->store, &ws->load, nv, nf) != WH_OK ||
		    wh_patch_reset(c, &ws->patch, (uint32_t)nv, (uint32_t)nf) != WH_OK)
			return c->err.code;
	}
	return WH_OK;
}

/* Where vertices are doubled nobody knows beforehand how many there will be. */
static wh_code count_vertices(wh_ctx *c, const wh_exec *ex, emit *e, uint64_t *vertices)
{
	const int64_t n = e->store->clusters;
	if (!e->style->doubled)
		return WH_OK;
	e->counting = true;
	const wh_code code = wh_exec_ordered(c, ex, n, vertices_job, vertices_commit, e);
	e->counting = false;
	*vertices = e->first[n];
	return code;
}

static wh_code both_passes(wh_ctx *c, const wh_exec *ex, emit *e, uint64_t vertices)
{
	const int64_t n = e->store->clusters;
	if (wh_exec_ordered(c, ex, n, vertices_job, vertices_commit, e) != WH_OK)
		return c->err.code;
	if (e->first[n] != vertices)
		return wh_fail(c, WH_E_RUN,
		               "the clusters hold %llu vertices and not %llu: a fault of whittle's",
		               (unsigned long long)e->first[n], (unsigned long long)vertices);
	return wh_exec_ordered(c, ex, n, faces_job, faces_commit, e);
}

static wh_code write_all(wh_ctx *c, const wh_exec *ex, emit *e, wh_outfile *out, wh_ply_style style,
                         uint64_t *vertices, uint64_t faces)
{
	wh_mesh_box box = {0};
	wh_progress_phase(e->progress, "write", (style.doubled ? 3 : 2) * faces);
	if ((wh_mesh_wants_box(style) && find_box(c, ex, e, &box) != WH_OK) ||
	    count_vertices(c, ex, e, vertices) != WH_OK)
		return c->err.code;
	style.attributes = style.doubled ? style.doubled : style.attributes;
	if (wh_mesh_begin(c, &e->out, out, style, *vertices, faces, &box) != WH_OK)
		return c->err.code;
	const wh_code code =
	    wh_mesh_wants_facets(style)
	        ? wh_exec_ordered(c, ex, e->store->clusters, facets_job, facets_commit, e)
	        : both_passes(c, ex, e, *vertices);
	return code == WH_OK ? wh_mesh_end(c, &e->out) : code;
}

wh_code wh_emit(wh_ctx *c, const wh_exec *ex, wh_progress *progress, const wh_store *store,
                wh_outfile *out, wh_ply_style style, double scale, uint64_t *vertices,
                uint64_t faces)
{
	emit e = {.store = store,
	          .progress = progress,
	          .style = &style,
	          .unscale = 1 / scale,
	          .workspace = wh_calloc(c, (size_t)ex->workers, sizeof *e.workspace),
	          .first = wh_calloc(c, (size_t)store->clusters + 1, sizeof *e.first)};
	if (e.workspace && e.first && workspaces_fit(c, &e, ex->workers) == WH_OK)
		(void)write_all(c, ex, &e, out, style, vertices, faces);
	for (int i = 0; e.workspace && i < ex->workers; i++) {
		wh_store_workspace_free(c, &e.workspace[i].load);
		wh_patch_free(c, &e.workspace[i].patch);
		wh_order_workspace_free(c, &e.workspace[i].order);
		wh_free(c, e.workspace[i].xyz);
		wh_free(c, e.workspace[i].number);
		wh_atlas_room_free(c, &e.workspace[i].room);
	}
	wh_free(c, e.workspace);
	wh_free(c, e.first);
	wh_mesh_free_out(c, &e.out);
	wh_idmap_free(c, &e.cut);
	wh_free(c, e.copy);
	wh_free(c, e.copy_attr);
	return c->err.code;
}
