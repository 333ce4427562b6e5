/*
 * Cutting a mesh anew between two rounds. Every old cluster file holds the positions of all
 * corners of its faces, so the new home of a corner follows from its position, and no table over
 * all vertices is needed. Only vertices on the old cuts are known to several old clusters.
 *
 * Each old cluster is loaded four times: for a sample of its vertices, to collect which new
 * clusters use the old cut vertices, to send its faces, and to send its vertices. The mesh has
 * been reduced by then; the memory is one old cluster a worker and a write buffer a new cluster.
 */
#include "pipeline/round.h"

#include "geom/kdtree.h"

#include <stdlib.h>
#include <string.h>

enum { SAMPLE = 256 * 1024 };

/* A use of an old cut vertex by a new cluster. */
typedef struct use {
	uint64_t gid;
	uint32_t cluster;
	uint8_t flag; /* the vertex's */
} use;

/* A vertex that was cut before and is cut again. */
typedef struct again {
	uint64_t gid;
	uint8_t flag; /* it has now */
} again;

typedef struct uses {
	use *item;
	size_t n, cap;
} uses;

/* What one worker needs. */
typedef struct recut_hand {
	wh_store_scratch scratch;
	wh_patch patch;
	uint32_t *home;  /* per vertex: the new cell it lies in */
	uint32_t *cell;  /* per face: its new cluster */
	uint32_t *order; /* faces by new cluster */
	uint32_t *user;  /* per vertex: the one new cluster that uses it, WH_NONE, or SEVERAL */
	uint32_t *seen;  /* per vertex: last new cluster it was sent to, plus one */
	size_t cap_home, cap_cell, cap_order, cap_user, cap_seen;
	uint32_t *start; /* per new cluster, plus two */
	uses found;
} recut_hand;

#define SEVERAL (UINT32_MAX - 1)

typedef struct recut {
	const wh_store *from;
	wh_store *to;
	wh_progress *progress;
	recut_hand *hands;
	wh_kdtree tree;
	wh_vec3 *sample;
	size_t samples, sample_cap;
	uint64_t stride, passed; /* every stride-th vertex is in the sample */
	uses old_cut;            /* sorted, unique, once collected */
	again *cut;              /* used by several new clusters, ascending */
	size_t cuts, cut_cap;
	uint64_t never; /* of them, cut in every round so far */
	wh_store_writer *writer;
} recut;

/* ---- where things go ---------------------------------------------------------------------- */

static wh_code fit(wh_ctx *c, recut_hand *h)
{
	const size_t nv = h->patch.nv, nf = h->patch.nf;
	if (wh_reserve(c, &h->home, &h->cap_home, nv, sizeof *h->home) != WH_OK ||
	    wh_reserve(c, &h->cell, &h->cap_cell, nf, sizeof *h->cell) != WH_OK ||
	    wh_reserve(c, &h->order, &h->cap_order, nf, sizeof *h->order) != WH_OK ||
	    wh_reserve(c, &h->user, &h->cap_user, nv, sizeof *h->user) != WH_OK ||
	    wh_reserve(c, &h->seen, &h->cap_seen, nv, sizeof *h->seen) != WH_OK)
		return c->err.code;
	return WH_OK;
}

/* Loads old cluster k and finds the new cluster of each face and the users of each vertex. */
static wh_code load_and_place(wh_ctx *c, const recut *r, recut_hand *h, uint32_t k)
{
	wh_patch *p = &h->patch;
	if (wh_store_load(c, r->from, k, &h->scratch, p) != WH_OK || fit(c, h) != WH_OK)
		return c->err.code;
	for (uint32_t v = 0; v < p->nv; v++) {
		h->home[v] = wh_kdtree_cell(&r->tree, &p->pos[v]);
		h->user[v] = WH_NONE;
	}
	for (uint32_t f = 0; f < p->nf; f++) {
		const uint32_t *t = &p->tri[3 * (size_t)f];
		const uint32_t cell =
		    wh_kdtree_majority(h->home[t[0]], h->home[t[1]], h->home[t[2]]);
		h->cell[f] = cell;
		for (int j = 0; j < 3; j++) {
			uint32_t *u = &h->user[t[j]];
			*u = *u == WH_NONE || *u == cell ? cell : SEVERAL;
		}
	}
	return WH_OK;
}

/* ---- sample ------------------------------------------------------------------------------- */

static wh_code sample_job(wh_ctx *c, void *arg, int64_t index, int worker)
{
	const recut *r = arg;
	recut_hand *h = &r->hands[worker];
	return wh_store_load(c, r->from, (uint32_t)index, &h->scratch, &h->patch);
}

static wh_code sample_commit(wh_ctx *c, void *arg, int64_t index, int worker)
{
	(void)index;
	recut *r = arg;
	const wh_patch *p = &r->hands[worker].patch;
	for (uint32_t v = 0; v < p->nv; v++) {
		if (r->passed++ % r->stride != 0)
			continue;
		if (wh_reserve(c, &r->sample, &r->sample_cap, r->samples + 1, sizeof *r->sample))
			return c->err.code;
		r->sample[r->samples++] = p->pos[v];
	}
	return WH_OK;
}

static wh_code take_sample(wh_ctx *c, const wh_exec *ex, recut *r)
{
	uint64_t max_v, max_f, faces, vertices;
	if (wh_round_extent(c, r->from, &max_v, &max_f, &faces, &vertices) != WH_OK)
		return c->err.code;
	r->stride = vertices / SAMPLE + 1;
	return wh_exec_ordered(c, ex, r->from->clusters, sample_job, sample_commit, r);
}

/* ---- pass 1: which old cut vertices are cut again ----------------------------------------- */

static wh_code uses_add(wh_ctx *c, uses *u, use one)
{
	if (wh_reserve(c, &u->item, &u->cap, u->n + 1, sizeof *u->item) != WH_OK)
		return c->err.code;
	u->item[u->n++] = one;
	return WH_OK;
}

static wh_code collect_job(wh_ctx *c, void *arg, int64_t index, int worker)
{
	const recut *r = arg;
	recut_hand *h = &r->hands[worker];
	if (load_and_place(c, r, h, (uint32_t)index) != WH_OK)
		return c->err.code;
	const wh_patch *p = &h->patch;
	h->found.n = 0;
	for (uint32_t v = 0; v < p->nv; v++)
		if ((p->flag[v] & WH_CUT) &&
		    uses_add(c, &h->found, (use){p->gid[v], h->user[v], p->flag[v]}) != WH_OK)
			return c->err.code;
	return WH_OK;
}

static wh_code collect_commit(wh_ctx *c, void *arg, int64_t index, int worker)
{
	(void)index;
	recut *r = arg;
	const uses *u = &r->hands[worker].found;
	for (size_t i = 0; i < u->n; i++)
		if (uses_add(c, &r->old_cut, u->item[i]) != WH_OK)
			return c->err.code;
	return WH_OK;
}

static int compare_uses(const void *a, const void *b)
{
	const use *x = a, *y = b;
	if (x->gid != y->gid)
		return x->gid < y->gid ? -1 : 1;
	return (x->cluster > y->cluster) - (x->cluster < y->cluster);
}

/* An old cut vertex is cut again when its faces go to more than one new cluster. */
static wh_code find_cut_again(wh_ctx *c, recut *r)
{
	const uses *u = &r->old_cut;
	if (u->n)
		qsort(u->item, u->n, sizeof *u->item, compare_uses);
	for (size_t i = 0; i < u->n;) {
		size_t end = i + 1;
		while (end < u->n && u->item[end].gid == u->item[i].gid)
			end++;
		if (u->item[i].cluster != u->item[end - 1].cluster ||
		    u->item[end - 1].cluster == SEVERAL) {
			if (wh_reserve(c, &r->cut, &r->cut_cap, r->cuts + 1, sizeof *r->cut) !=
			    WH_OK)
				return c->err.code;
			r->cut[r->cuts++] = (again){u->item[i].gid, u->item[i].flag};
			r->never += (u->item[i].flag & WH_NEVER) != 0;
		}
		i = end;
	}
	return WH_OK;
}

/* The new flags of an old cut vertex. */
static uint8_t flag_again(const recut *r, uint64_t gid)
{
	size_t lo = 0, hi = r->cuts;
	while (lo < hi) {
		const size_t mid = lo + (hi - lo) / 2;
		if (r->cut[mid].gid < gid)
			lo = mid + 1;
		else
			hi = mid;
	}
	return lo < r->cuts && r->cut[lo].gid == gid ? r->cut[lo].flag : 0;
}

/* ---- pass 2 and 3: faces, then vertices --------------------------------------------------- */

static wh_code place_job(wh_ctx *c, void *arg, int64_t index, int worker)
{
	const recut *r = arg;
	recut_hand *h = &r->hands[worker];
	if (load_and_place(c, r, h, (uint32_t)index) != WH_OK)
		return c->err.code;
	const wh_patch *p = &h->patch;
	const uint32_t cells = r->to->clusters;
	memset(h->start, 0, ((size_t)cells + 2) * sizeof *h->start);
	for (uint32_t f = 0; f < p->nf; f++)
		h->start[h->cell[f] + 2]++;
	for (uint32_t k = 0; k < cells; k++)
		h->start[k + 2] += h->start[k + 1];
	for (uint32_t f = 0; f < p->nf; f++)
		h->order[h->start[h->cell[f] + 1]++] = f;
	return WH_OK;
}

static wh_code send_face(wh_ctx *c, recut *r, const wh_patch *p, uint32_t f, uint32_t k)
{
	const uint32_t *t = &p->tri[3 * (size_t)f];
	uint64_t wide[3];
	uint32_t narrow[3];
	for (int j = 0; j < 3; j++) {
		wide[j] = p->gid[t[j]];
		narrow[j] = (uint32_t)wide[j];
	}
	r->writer[k].faces++;
	if (r->to->id_bytes == 4)
		return wh_store_append(c, r->to, k, &r->writer[k], narrow, sizeof narrow);
	return wh_store_append(c, r->to, k, &r->writer[k], wide, sizeof wide);
}

static wh_code faces_commit(wh_ctx *c, void *arg, int64_t index, int worker)
{
	(void)index;
	recut *r = arg;
	const recut_hand *h = &r->hands[worker];
	for (uint32_t k = 0; k < r->to->clusters; k++)
		for (uint32_t i = h->start[k]; i < h->start[k + 1]; i++)
			if (send_face(c, r, &h->patch, h->order[i], k) != WH_OK)
				return c->err.code;
	wh_progress_add(r->progress, h->patch.nf);
	return WH_OK;
}

static wh_code send_vertex(wh_ctx *c, recut *r, const recut_hand *h, uint32_t v, uint32_t k)
{
	const wh_patch *p = &h->patch;
	const uint8_t fresh = h->user[v] == SEVERAL ? WH_CUT : 0;
	const uint8_t flag = p->flag[v] & WH_CUT ? flag_again(r, p->gid[v]) : fresh;
	uint8_t record[64];
	const uint8_t *end =
	    wh_store_put_vertex(r->to, record, p->gid[v], flag, p->pos[v], p->err[v]);
	r->writer[k].vertices++;
	return wh_store_append(c, r->to, k, &r->writer[k], record, (size_t)(end - record));
}

static wh_code vertices_commit(wh_ctx *c, void *arg, int64_t index, int worker)
{
	(void)index;
	recut *r = arg;
	recut_hand *h = &r->hands[worker];
	memset(h->seen, 0, h->patch.nv * sizeof *h->seen);
	for (uint32_t k = 0; k < r->to->clusters; k++)
		for (uint32_t i = h->start[k]; i < h->start[k + 1]; i++)
			for (int j = 0; j < 3; j++) {
				const uint32_t v =
				    h->patch.tri[3 * (size_t)h->order[i] + (size_t)j];
				if (h->seen[v] == k + 1)
					continue;
				h->seen[v] = k + 1;
				if (send_vertex(c, r, h, v, k) != WH_OK)
					return c->err.code;
			}
	wh_progress_add(r->progress, h->patch.nf);
	return WH_OK;
}

/* ---- all of it ---------------------------------------------------------------------------- */

static wh_code distribute(wh_ctx *c, const wh_exec *ex, recut *r, size_t buffer)
{
	const int64_t n = r->from->clusters;
	r->writer = wh_calloc(c, r->to->clusters, sizeof *r->writer);
	for (uint32_t k = 0; r->writer && k < r->to->clusters; k++)
		if (wh_store_begin(c, r->to, k, &r->writer[k], buffer) != WH_OK)
			break;
	if (c->err.code != WH_OK ||
	    wh_exec_ordered(c, ex, n, place_job, faces_commit, r) != WH_OK ||
	    wh_exec_ordered(c, ex, n, place_job, vertices_commit, r) != WH_OK)
		return c->err.code;
	for (uint32_t k = 0; k < r->to->clusters; k++)
		if (wh_store_commit(c, r->to, k, &r->writer[k]) != WH_OK)
			return c->err.code;
	return WH_OK;
}

static wh_code hands_make(wh_ctx *c, recut *r, int workers)
{
	r->hands = wh_calloc(c, (size_t)workers, sizeof *r->hands);
	for (int i = 0; r->hands && i < workers; i++)
		r->hands[i].start =
		    wh_alloc(c, (size_t)r->to->clusters + 2, sizeof *r->hands[i].start);
	return c->err.code;
}

static void hands_free(wh_ctx *c, recut *r, int workers)
{
	for (int i = 0; r->hands && i < workers; i++) {
		recut_hand *h = &r->hands[i];
		wh_store_scratch_free(c, &h->scratch);
		wh_patch_free(c, &h->patch);
		wh_free(c, h->home);
		wh_free(c, h->cell);
		wh_free(c, h->order);
		wh_free(c, h->user);
		wh_free(c, h->seen);
		wh_free(c, h->start);
		wh_free(c, h->found.item);
	}
	wh_free(c, r->hands);
}

static wh_code cut_once(wh_ctx *c, const wh_exec *ex, recut *r, double skew)
{
	wh_kdtree_free(c, &r->tree);
	r->old_cut.n = r->cuts = 0;
	r->never = 0;
	if (wh_kdtree_build(c, &r->tree, r->sample, r->samples, r->to->clusters, skew) != WH_OK ||
	    wh_exec_ordered(c, ex, r->from->clusters, collect_job, collect_commit, r) != WH_OK)
		return c->err.code;
	return find_cut_again(c, r);
}

/* Where the curves of three partitions meet in one vertex, it has been cut in all of them. That is
 * rare: with other cuts it will not be so. */
static wh_code find_cuts(wh_ctx *c, const wh_exec *ex, recut *r, const wh_recut_params *p)
{
	static const double shift[] = {0, 0.07, -0.06, 0.13, -0.11, 0.03};
	wh_code code = WH_OK;
	for (size_t i = 0; i < sizeof shift / sizeof *shift; i++) {
		code = cut_once(c, ex, r, p->skew + shift[i]);
		if (code != WH_OK || !p->free_all || r->never == 0)
			break;
	}
	return code;
}

wh_code wh_round_recut(wh_ctx *c, const wh_exec *ex, wh_progress *progress, const wh_store *from,
                       wh_store *to, const wh_recut_params *params, uint64_t *never_free)
{
	to->id_bytes = from->id_bytes;
	to->coord_bytes = from->coord_bytes;
	to->vertex_payload = from->vertex_payload;
	to->local_corners = false;
	recut r = {.from = from, .to = to, .progress = progress};
	uint64_t max_v, max_f, faces, vertices;
	wh_code code = wh_round_extent(c, from, &max_v, &max_f, &faces, &vertices);
	wh_progress_phase(progress, "recut", 2 * faces);
	if (code == WH_OK)
		code = hands_make(c, &r, ex->workers);
	if (code == WH_OK)
		code = take_sample(c, ex, &r);
	if (code == WH_OK)
		code = find_cuts(c, ex, &r, params);
	if (code == WH_OK)
		code = distribute(c, ex, &r, params->buffer);
	*never_free = r.never;
	for (uint32_t k = 0; r.writer && k < to->clusters; k++)
		wh_store_drop(c, &r.writer[k]);
	wh_free(c, r.writer);
	wh_free(c, r.old_cut.item);
	wh_free(c, r.cut);
	wh_free(c, r.sample);
	wh_kdtree_free(c, &r.tree);
	hands_free(c, &r, ex->workers);
	return code;
}
