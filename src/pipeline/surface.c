#include "pipeline/surface.h"

#include "pipeline/ingest.h"
#include "pipeline/normalise.h"
#include "pipeline/round.h"

#include <string.h>

enum {
	CLUSTER_FACES = 64 * 1024,       /* decides where samples fall: never follows from memory */
	REWRITE_BYTES = 20 * 1024 * 1024 /* a worker that rewrites text or polygons */
};

/* What one worker needs. */
typedef struct workspace {
	wh_store_workspace load;
	wh_patch patch;
	wh_page_maker maker;
	wh_face_item *items;
	float *colour;
	uint8_t *out; /* records of the cluster at hand */
	size_t out_cap, out_n;
	wh_page_entry *entry;
	uint32_t pages;
	uint64_t own; /* its vertices that no other cluster has */
} workspace;

typedef struct making {
	wh_surface *s;
	const wh_source *src;
	wh_store store;
	wh_ingest_result cut;
	wh_progress *progress;
	uint64_t max_v, max_f; /* of a cluster */
	workspace *workspace;
	struct part {
		wh_page_entry *entry;
		uint32_t pages;
	} * part; /* of each cluster */
	_Atomic uint64_t bytes, own;
} making;

/* ---- one cluster to pages ------------------------------------------------------------------- */

static void get_colours(const wh_attributes *a, const wh_patch *p, float *colour)
{
	for (uint32_t v = 0; v < p->nv; v++)
		for (size_t k = 0; k < 3; k++) {
			const wh_attribute *item = &a->item[a->rgb[k]];
			const double x = 255 * wh_attribute_get(item, wh_patch_attr(p, v));
			colour[3 * (size_t)v + k] = (float)(x / wh_type_white(item->type));
		}
}

static uint32_t pages_of(uint64_t faces)
{
	return (uint32_t)((faces + WH_PAGE_FACES - 1) / WH_PAGE_FACES);
}

static wh_code make_pages(wh_ctx *c, const making *m, workspace *ws)
{
	const wh_patch *p = &ws->patch;
	const wh_page_layout *l = &m->s->tree.layout;
	const wh_page_soup soup = {p->nv, p->pos, p->tri, ws->colour, p->gid};
	if (wh_page_maker_begin(c, &ws->maker, p->nv) != WH_OK)
		return c->err.code;
	for (uint32_t i = 0; i < p->nf; i += WH_PAGE_FACES) {
		const uint32_t n = p->nf - i < WH_PAGE_FACES ? p->nf - i : WH_PAGE_FACES;
		const size_t most = wh_page_record_bytes(l, 3 * n, n);
		if (wh_reserve(c, &ws->out, &ws->out_cap, ws->out_n + most, 1) != WH_OK)
			return c->err.code;
		wh_page_entry *e = &ws->entry[ws->pages++];
		e->at = ws->out_n;
		ws->out_n +=
		    wh_page_make(&ws->maker, l, &soup, ws->items + i, n, ws->out + ws->out_n, e);
	}
	for (uint32_t v = 0; v < p->nv; v++)
		ws->own += wh_page_maker_has(&ws->maker, v) && !(p->flag[v] & WH_CUT);
	return WH_OK;
}

static wh_code order_cluster(wh_ctx *c, const making *m, uint32_t cluster, workspace *ws)
{
	ws->pages = 0;
	ws->own = 0;
	ws->out_n = 0;
	if (wh_store_load(c, &m->store, cluster, &ws->load, &ws->patch) != WH_OK)
		return c->err.code;
	if (ws->patch.nf == 0)
		return WH_OK;
	if (ws->colour)
		get_colours(m->src->attributes, &ws->patch, ws->colour);
	wh_face_items(ws->patch.pos, ws->patch.tri, ws->patch.nf, ws->items);
	wh_face_order(ws->items, ws->patch.nf);
	return make_pages(c, m, ws);
}

/* The pages of a cluster go wherever the file ends when they are made: entries say where. */
static wh_code page_job(wh_ctx *c, void *arg, int64_t index, int worker)
{
	making *m = arg;
	workspace *ws = &m->workspace[worker];
	wh_surface *s = m->s;
	if (order_cluster(c, m, (uint32_t)index, ws) != WH_OK)
		return c->err.code;
	wh_store_remove(&m->store, (uint32_t)index);
	const uint64_t at = atomic_fetch_add(&m->bytes, ws->out_n);
	for (uint32_t i = 0; i < ws->pages; i++)
		ws->entry[i].at += at;
	wh_progress_add(m->progress, ws->patch.nf);
	atomic_fetch_add(&m->own, ws->own);
	struct part *part = &m->part[index];
	part->pages = ws->pages;
	part->entry = wh_alloc(c, ws->pages, sizeof *part->entry);
	if (!part->entry)
		return c->err.code;
	memcpy(part->entry, ws->entry, ws->pages * sizeof *part->entry);
	return ws->out_n ? wh_spill_pwrite(c, s->spill, s->fd, ws->out, ws->out_n, at) : WH_OK;
}

/* All entries, in the order of the clusters. */
static wh_code list_pages(wh_ctx *c, making *m)
{
	for (uint32_t k = 0; k < m->store.clusters; k++)
		for (uint32_t i = 0; i < m->part[k].pages; i++)
			if (wh_bvh_add(c, &m->s->tree, &m->part[k].entry[i]) != WH_OK)
				return c->err.code;
	m->s->tree.vertices += atomic_load(&m->own);
	return WH_OK;
}

/* ---- memory --------------------------------------------------------------------------------- */

/* Bytes of records of a cluster whose faces share vertices no more than `nv` says: pages have some
 * of them twice. */
static size_t out_bytes(const making *m, uint64_t nv, uint64_t nf)
{
	const uint64_t twice = nv + nv / 2 < 3 * nf ? nv + nv / 2 : 3 * nf;
	const size_t each = wh_page_record_bytes(&m->s->tree.layout, 1, 0);
	return (size_t)twice * each + (size_t)nf * 6 + (size_t)pages_of(nf) * 64;
}

static size_t workspace_bytes(const making *m, uint64_t nv, uint64_t nf)
{
	const size_t colour = m->s->tree.layout.coloured ? 3 * sizeof(float) : 0;
	return wh_store_workspace_bytes(&m->store, nv, nf) +
	       wh_patch_bytes(nv, nf, m->store.attr_bytes, m->store.face_bytes) +
	       (size_t)nv * (sizeof(uint32_t) + colour) + (size_t)nf * sizeof(wh_face_item) +
	       out_bytes(m, nv, nf) + pages_of(nf) * sizeof(wh_page_entry) + sizeof(workspace);
}

static wh_code workspaces_make(wh_ctx *c, making *m, int workers)
{
	m->workspace = wh_calloc(c, (size_t)workers, sizeof *m->workspace);
	for (int i = 0; m->workspace && i < workers; i++) {
		workspace *ws = &m->workspace[i];
		ws->patch.attr_bytes = m->store.attr_bytes;
		ws->patch.face_bytes = m->store.face_bytes;
		ws->items = wh_alloc(c, (size_t)m->max_f, sizeof *ws->items);
		ws->entry = wh_alloc(c, pages_of(m->max_f), sizeof *ws->entry);
		if (m->s->tree.layout.coloured)
			ws->colour = wh_alloc(c, (size_t)m->max_v, 3 * sizeof *ws->colour);
		if (wh_store_workspace_fit(c, &m->store, &ws->load, m->max_v, m->max_f) != WH_OK ||
		    wh_patch_reset(c, &ws->patch, (uint32_t)m->max_v, (uint32_t)m->max_f) !=
		        WH_OK ||
		    wh_page_maker_begin(c, &ws->maker, (uint32_t)m->max_v) != WH_OK ||
		    wh_renew(c, &ws->out, &ws->out_cap, out_bytes(m, m->max_v, m->max_f), 1) !=
		        WH_OK)
			break;
	}
	return c->err.code;
}

static void workspaces_free(wh_ctx *c, making *m, int workers)
{
	for (int i = 0; m->workspace && i < workers; i++) {
		workspace *ws = &m->workspace[i];
		wh_store_workspace_free(c, &ws->load);
		wh_patch_free(c, &ws->patch);
		wh_page_maker_free(c, &ws->maker);
		wh_free(c, ws->items);
		wh_free(c, ws->entry);
		wh_free(c, ws->colour);
		wh_free(c, ws->out);
	}
	wh_free(c, m->workspace);
	m->workspace = NULL;
}

static wh_code too_small(wh_ctx *c, const wh_surface_params *p, size_t need, size_t ceiling)
{
	const size_t base = ceiling > p->budget ? ceiling - p->budget : 0;
	return wh_fail(c, WH_E_PLAN,
	               "reading '%s' needs more memory than the ceiling of %zu MiB: use --memory "
	               "%zuM",
	               p->path, ceiling >> 20, ((need + base) >> 20) + 2);
}

/* ---- all clusters --------------------------------------------------------------------------- */

static uint32_t clusters_of(uint64_t faces)
{
	const uint64_t n = faces / CLUSTER_FACES + 1;
	return n < WH_MAX_CLUSTERS ? (uint32_t)n : WH_MAX_CLUSTERS;
}

static wh_code ingest(wh_ctx *c, const wh_exec *ex, making *m, const wh_surface_params *p,
                      size_t ceiling)
{
	wh_ingest_params ip = {.clusters = clusters_of(m->src->nf)};
	wh_exec few = *ex;
	const size_t need = wh_ingest_fit(m->src, p->budget, &few, &ip);
	if (need > p->budget)
		return too_small(c, p, need, ceiling);
	return wh_ingest(c, &few, m->progress, m->src, &ip, &m->store, &m->cut);
}

static void describe(const making *m, const wh_surface_params *p, wh_bvh *t)
{
	const wh_attributes *a = m->src->attributes;
	t->layout = (wh_page_layout){.is_double = m->src->is_double,
	                             .coloured = p->colours && a && a->has_rgb,
	                             .numbered = p->numbered};
	t->unit = m->cut.scale;
	t->ids = m->src->nv;
	t->vertices = m->cut.cut_vertices;
}

static wh_code write_pages(wh_ctx *c, const wh_exec *ex, making *m, const wh_surface_params *p,
                           size_t ceiling)
{
	uint64_t faces, vertices;
	if (wh_round_extent(c, &m->store, &m->max_v, &m->max_f, &faces, &vertices) != WH_OK)
		return c->err.code;
	if (faces == 0)
		return wh_fail(c, WH_E_INPUT,
		               "'%s' has nothing to compare: none of its faces has three different "
		               "corners",
		               p->path);
	const size_t each = workspace_bytes(m, m->max_v, m->max_f);
	const size_t entries =
	    4 * (pages_of(faces) + (size_t)m->store.clusters) * sizeof(wh_page_entry);
	if (entries + each > p->budget)
		return too_small(c, p, entries + each, ceiling);
	wh_exec few = *ex;
	const size_t fit = (p->budget - entries) / each;
	if ((size_t)few.workers > fit)
		few.workers = (int)fit;
	wh_progress_phase(m->progress, "order", faces);
	wh_code code = workspaces_make(c, m, few.workers);
	m->part = wh_calloc(c, m->store.clusters, sizeof *m->part);
	if (code == WH_OK)
		code = c->err.code;
	if (code == WH_OK)
		code = wh_exec_for(c, &few, m->store.clusters, page_job, m);
	workspaces_free(c, m, few.workers);
	if (code == WH_OK)
		code = list_pages(c, m);
	for (uint32_t k = 0; m->part && k < m->store.clusters; k++)
		wh_free(c, m->part[k].entry);
	wh_free(c, m->part);
	return code;
}

static wh_code fetch_page(wh_ctx *c, void *user, uint64_t at, size_t bytes, uint8_t *record)
{
	wh_surface *s = user;
	return wh_spill_pread(c, s->spill, s->fd, record, bytes, at);
}

static wh_code make(wh_ctx *c, const wh_exec *ex, wh_progress *progress, const wh_source *src,
                    const wh_surface_params *p, size_t ceiling, wh_surface *s)
{
	making m = {.s = s,
	            .src = src,
	            .store = {.spill = s->spill, .generation = p->number},
	            .progress = progress};
	wh_code code = ingest(c, ex, &m, p, ceiling);
	if (code != WH_OK)
		return code;
	wh_mem_trim(c);
	describe(&m, p, &s->tree);
	s->tree.fetch = fetch_page;
	s->tree.user = s;
	s->fd = wh_spill_scratch(c, s->spill);
	code = s->fd >= 0 ? write_pages(c, ex, &m, p, ceiling) : wh_failed(c);
	wh_mem_trim(c);
	return code;
}

/* Again, where faces that are not triangles were met behind a triangle's size. */
static wh_code make_again(wh_ctx *c, const wh_exec *ex, const wh_exec *few, wh_progress *progress,
                          wh_input *in, const wh_surface_params *p, size_t ceiling, wh_surface *s)
{
	wh_spill *spill = s->spill;
	wh_surface_close(c, s);
	*s = (wh_surface){.spill = spill, .fd = -1};
	const wh_code code = wh_input_rewrite(c, few, spill, in);
	return code == WH_OK ? make(c, ex, progress, &in->source, p, ceiling, s) : code;
}

wh_code wh_surface_open(wh_ctx *c, const wh_exec *ex, wh_spill *spill, wh_progress *progress,
                        const wh_surface_params *p, size_t ceiling, wh_surface *s)
{
	wh_input in;
	wh_exec few = *ex;
	const size_t fit = p->budget / REWRITE_BYTES;
	if ((size_t)few.workers > fit)
		few.workers = fit ? (int)fit : 1;
	*s = (wh_surface){.spill = spill, .fd = -1};
	wh_progress_phase(progress, "open", 1);
	wh_code code =
	    wh_input_open_with(c, &few, spill, p->path, p->from,
	                       (wh_wanted){p->colours ? "colour" : "none", WH_HOLDS_ALL}, &in);
	if (code != WH_OK)
		return code;
	code = make(c, ex, progress, &in.source, p, ceiling, s);
	if (code == WH_E_IRREGULAR)
		code = make_again(c, ex, &few, progress, &in, p, ceiling, s);
	if (code == WH_OK)
		code = wh_input_unchanged(c, &in);
	wh_input_close(c, spill, &in);
	return code;
}

void wh_surface_close(wh_ctx *c, wh_surface *s)
{
	wh_bvh_free(c, &s->tree);
	if (s->spill && s->fd >= 0)
		wh_spill_close_scratch(s->spill, s->fd);
	*s = (wh_surface){.fd = -1};
}
