#include "pipeline/cluster.h"

#include "geom/kdtree.h"

#include <math.h>
#include <string.h>

#define SHARED (UINT32_MAX - 1) /* owner of a vertex that several micro-clusters use */

enum { SAMPLE = 16 * 1024 }; /* points that a cut is worked out from */

/* Fraction of the cells left of a cut: not half, so that these cuts are not the clusters' own. */
static const double SKEW = 0.45;

/* What is known of a vertex of the cluster. */
typedef struct seat {
	uint32_t owner; /* the micro-cluster that uses it, WH_NONE, or SHARED */
	uint32_t local; /* its place in the micro-cluster at hand, or WH_NONE; while the faces are
	                   grouped, the cell that it lies in */
} seat;

struct wh_cluster_workspace {
	wh_simplify_workspace *simplify;
	wh_patch micro;
	seat *seat; /* per vertex */
	size_t cap_v;
	uint32_t *tri;  /* faces grouped by micro-cluster */
	uint32_t *cell; /* per face */
	size_t cap_f;
	uint8_t *face; /* what the faces carry, grouped like them */
	size_t cap_face;
	uint32_t *start; /* first face of each micro-cluster, and the end */
	size_t cap_cells;
};

wh_cluster_workspace *wh_cluster_workspace_new(wh_ctx *c)
{
	wh_cluster_workspace *w = wh_calloc(c, 1, sizeof *w);
	if (w)
		w->simplify = wh_simplify_workspace_new(c);
	if (w && !w->simplify) {
		wh_free(c, w);
		return NULL;
	}
	return w;
}

void wh_cluster_workspace_free(wh_ctx *c, wh_cluster_workspace *w)
{
	if (!w)
		return;
	wh_simplify_workspace_free(c, w->simplify);
	wh_patch_free(c, &w->micro);
	wh_free(c, w->seat);
	wh_free(c, w->tri);
	wh_free(c, w->cell);
	wh_free(c, w->face);
	wh_free(c, w->start);
	wh_free(c, w);
}

size_t wh_cluster_bytes(uint64_t nv, uint64_t nf, uint32_t attr_bytes, uint32_t face_bytes)
{
	const size_t patch_bytes = wh_patch_bytes(nv, nf, attr_bytes, face_bytes);
	/* seats, faces; attributes of a micro-cluster, in the worst case all of them */
	const size_t cut_bytes =
	    (size_t)nv * (8 + (size_t)attr_bytes) + (size_t)nf * (16 + 2 * (size_t)face_bytes);
	return patch_bytes + cut_bytes + wh_simplify_bytes(nv, nf, face_bytes) + ((size_t)1 << 20);
}

static wh_code fit(wh_ctx *c, wh_cluster_workspace *w, const wh_patch *p, uint32_t cells)
{
	size_t cap_tri = w->cap_f;
	if (wh_reserve(c, &w->seat, &w->cap_v, p->nv, sizeof *w->seat) != WH_OK ||
	    wh_reserve(c, &w->tri, &cap_tri, p->nf, 3 * sizeof *w->tri) != WH_OK ||
	    wh_reserve(c, &w->cell, &w->cap_f, p->nf, sizeof *w->cell) != WH_OK ||
	    (p->face_bytes &&
	     wh_reserve(c, &w->face, &w->cap_face, (size_t)p->nf * p->face_bytes, 1) != WH_OK))
		return c->err.code;
	return wh_reserve(c, &w->start, &w->cap_cells, (size_t)cells + 2, sizeof *w->start);
}

/* ---- cutting ------------------------------------------------------------------------------ */

static wh_code cut_tree(wh_ctx *c, const wh_patch *p, uint32_t cells, wh_kdtree *tree)
{
	const uint32_t stride = p->nv / SAMPLE + 1;
	const uint32_t n = (p->nv + stride - 1) / stride;
	wh_kdpoint *sample = wh_alloc(c, n, sizeof *sample);
	if (!sample)
		return wh_failed(c);
	for (uint32_t i = 0; i < n; i++)
		sample[i] = (wh_kdpoint){p->pos[(size_t)i * stride], (double)i * stride};
	const wh_code code = wh_kdtree_build(c, tree, sample, n, cells, SKEW);
	wh_free(c, sample);
	return code;
}

/* The cell of two corners, else of the first: these cuts need no more. */
static uint32_t face_cell(const seat *a, const seat *b, const seat *d)
{
	return b->local == d->local ? b->local : a->local;
}

static void note_user(seat *s, uint32_t cell)
{
	s->owner = s->owner == WH_NONE || s->owner == cell ? cell : SHARED;
}

/* Finds the cell of each face and the owner of each vertex, and counts the faces of each cell. */
static void place_faces(wh_cluster_workspace *w, const wh_patch *p, uint32_t cells)
{
	memset(w->start, 0, ((size_t)cells + 2) * sizeof *w->start);
	for (uint32_t f = 0; f < p->nf; f++) {
		const uint32_t *t = &p->tri[3 * (size_t)f];
		seat *a = &w->seat[t[0]], *b = &w->seat[t[1]], *d = &w->seat[t[2]];
		const uint32_t cell = face_cell(a, b, d);
		note_user(a, cell);
		note_user(b, cell);
		note_user(d, cell);
		w->cell[f] = cell;
		w->start[cell + 2]++;
	}
}

static void group_faces(wh_cluster_workspace *w, const wh_patch *p, uint32_t cells)
{
	for (uint32_t k = 0; k < cells; k++)
		w->start[k + 2] += w->start[k + 1];
	for (uint32_t f = 0; f < p->nf; f++) { /* start[k+1] runs from k's begin to its end */
		const size_t to = w->start[w->cell[f] + 1]++;
		memcpy(&w->tri[3 * to], &p->tri[3 * (size_t)f], 3 * sizeof *w->tri);
		if (p->face_bytes)
			memcpy(w->face + to * p->face_bytes, wh_patch_face(p, f), p->face_bytes);
	}
}

/* Groups the faces of p by micro-cluster into w->tri and finds who uses each vertex. */
static wh_code cut(wh_ctx *c, wh_cluster_workspace *w, const wh_patch *p, uint32_t cells)
{
	if (fit(c, w, p, cells) != WH_OK)
		return c->err.code;
	wh_kdtree tree;
	if (cut_tree(c, p, cells, &tree) != WH_OK)
		return c->err.code;
	for (uint32_t v = 0; v < p->nv; v++)
		w->seat[v] = (seat){WH_NONE, wh_kdtree_cell(&tree, &p->pos[v], v)};
	wh_kdtree_free(c, &tree);
	place_faces(w, p, cells);
	group_faces(w, p, cells);
	for (uint32_t v = 0; v < p->nv; v++)
		w->seat[v].local = WH_NONE;
	return WH_OK;
}

/* ---- one micro-cluster -------------------------------------------------------------------- */

/* Copies micro-cluster k out of p; its vertices' gid is their place in p. */
static wh_code take_out(wh_ctx *c, wh_cluster_workspace *w, const wh_patch *p, uint32_t k)
{
	const uint32_t nf = w->start[k + 1] - w->start[k];
	wh_patch *m = &w->micro;
	m->attr_bytes = p->attr_bytes;
	m->face_bytes = p->face_bytes;
	/* three a face in the worst case; a little more than half a one in practice */
	if (wh_patch_reset(c, m, 3 * nf < p->nv ? 3 * nf : p->nv, nf) != WH_OK)
		return c->err.code;
	const uint32_t *from = &w->tri[3 * (size_t)w->start[k]];
	uint32_t nv = 0;
	for (size_t i = 0; i < 3 * (size_t)nf; i++) {
		const uint32_t v = from[i];
		seat *s = &w->seat[v];
		if (s->local == WH_NONE) {
			s->local = nv;
			m->pos[nv] = p->pos[v];
			m->err[nv] = p->err[v];
			m->gid[nv] = v;
			m->flag[nv] =
			    (uint8_t)((p->flag[v] & WH_CUT) | (s->owner == SHARED ? WH_CUT : 0));
			if (p->attr_bytes)
				memcpy(wh_patch_attr(m, nv), wh_patch_attr(p, v), p->attr_bytes);
			nv++;
		}
		m->tri[i] = s->local;
	}
	m->nv = nv;
	if (p->face_bytes && nf)
		memcpy(m->face, w->face + (size_t)w->start[k] * p->face_bytes,
		       (size_t)nf * p->face_bytes);
	for (uint32_t i = 0; i < nv; i++)
		w->seat[m->gid[i]].local = WH_NONE;
	return WH_OK;
}

/* Puts what is left of the micro-cluster back, its faces after the nf that p has so far. */
static void put_back(const wh_patch *m, wh_patch *p, uint32_t *nf)
{
	for (uint32_t v = 0; v < m->nv; v++) {
		p->pos[m->gid[v]] = m->pos[v];
		p->err[m->gid[v]] = m->err[v];
		if (p->attr_bytes)
			memcpy(wh_patch_attr(p, (uint32_t)m->gid[v]), wh_patch_attr(m, v),
			       p->attr_bytes);
	}
	uint32_t *to = &p->tri[3 * (size_t)*nf];
	for (size_t i = 0; i < 3 * (size_t)m->nf; i++)
		to[i] = (uint32_t)m->gid[m->tri[i]];
	if (p->face_bytes && m->nf)
		memcpy(wh_patch_face(p, *nf), m->face, (size_t)m->nf * p->face_bytes);
	*nf += m->nf;
}

/* Passes the collapses of a micro-cluster on as those of the cluster. */
typedef struct relay {
	const wh_collapse_sink *sink;
	const wh_patch *micro;
} relay;

static wh_code pass_on(wh_ctx *c, void *to, const wh_collapse *one, const uint8_t *attr)
{
	const relay *r = to;
	wh_collapse outer = *one;
	outer.u = (uint32_t)r->micro->gid[one->u];
	outer.v = (uint32_t)r->micro->gid[one->v];
	return r->sink->put(c, r->sink->to, &outer, attr);
}

static wh_code reduce_micros(wh_ctx *c, wh_cluster_workspace *w, wh_patch *p,
                             const wh_cluster_params *params, wh_simplify_result *result)
{
	const uint32_t cells = (p->nf + params->micro_faces - 1) / params->micro_faces;
	if (cut(c, w, p, cells) != WH_OK)
		return c->err.code;
	wh_simplify_params inner = params->all;
	inner.max_cost = params->micro_cost;
	relay outer = {params->all.sink, &w->micro};
	const wh_collapse_sink sink = {pass_on, &outer};
	inner.sink = outer.sink ? &sink : NULL;
	uint32_t nf = 0;
	for (uint32_t k = 0; k < cells; k++) {
		wh_simplify_result one;
		if (wh_poll(c) != WH_OK || take_out(c, w, p, k) != WH_OK ||
		    wh_simplify(c, w->simplify, &w->micro, &inner, &one) != WH_OK)
			return c->err.code;
		put_back(&w->micro, p, &nf);
		wh_simplify_result_add(result, &one);
	}
	p->nf = nf;
	(void)wh_patch_compact(p, &w->seat->owner); /* seats are free now */
	return WH_OK;
}

/* Micro-clusters that go as far as the whole would leave little to do but along their cuts, and the
 * next round's are elsewhere. */
static bool micros_do(const wh_cluster_params *params)
{
	const wh_simplify_params *all = &params->all;
	return isfinite(all->max_cost) && params->micro_cost >= all->max_cost &&
	       !all->target_faces && !all->target_vertices;
}

wh_code wh_cluster_reduce(wh_ctx *c, wh_cluster_workspace *w, wh_patch *p,
                          const wh_cluster_params *params, wh_simplify_result *result)
{
	*result = (wh_simplify_result){0};
	if (params->micro_faces && p->nf > 2 * (uint64_t)params->micro_faces) {
		if (reduce_micros(c, w, p, params, result) != WH_OK)
			return c->err.code;
		if (micros_do(params))
			return WH_OK;
	}
	wh_simplify_result last;
	if (wh_simplify(c, w->simplify, p, &params->all, &last) != WH_OK)
		return c->err.code;
	wh_simplify_result_add(result, &last);
	result->fixed = last.fixed;
	result->exhausted = last.exhausted;
	result->border = last.border;
	return WH_OK;
}

wh_code wh_cluster_survey(wh_ctx *c, wh_cluster_workspace *w, wh_patch *p, uint32_t piece_faces,
                          uint32_t pieces, const wh_simplify_params *params, wh_survey *survey)
{
	const uint32_t cells = (p->nf + piece_faces - 1) / piece_faces;
	if (cells == 0)
		return WH_OK;
	if (cut(c, w, p, cells) != WH_OK)
		return c->err.code;
	pieces = pieces < cells ? pieces : cells;
	wh_simplify_params inner = *params;
	inner.log = survey->log;
	for (uint32_t i = 0; i < pieces; i++) {
		const uint32_t k =
		    (uint32_t)((2 * (uint64_t)i + 1) * cells / (2 * (uint64_t)pieces));
		wh_simplify_result one;
		if (wh_poll(c) != WH_OK || take_out(c, w, p, k) != WH_OK)
			return c->err.code;
		for (uint32_t v = 0; v < w->micro.nv; v++)
			survey->free_vertices += !(w->micro.flag[v] & WH_CUT);
		if (wh_simplify(c, w->simplify, &w->micro, &inner, &one) != WH_OK)
			return c->err.code;
	}
	return WH_OK;
}
