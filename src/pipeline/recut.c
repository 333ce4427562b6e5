/*
 * Cutting a mesh anew between two rounds. Every old cluster file holds the positions of all
 * corners of its faces, so the new home of a corner follows from its position, and no table over
 * all vertices is needed. Only vertices on the old cuts are known to several old clusters, and only
 * of them one old cluster cannot tell whether they are cut again.
 *
 * Each old cluster is loaded three times: for a sample of its vertices, to send its faces and
 * collect which new clusters use the old cut vertices, and to send its vertices. What is collected
 * are visits (pipeline/visits), which may not fit in memory; the answers go, for every old cluster
 * and its cut vertices in their order, to a file, where the pass over the vertices reads them. The
 * memory is one old cluster a worker, a write buffer a new cluster, and a fixed amount of visits.
 */
#include "pipeline/recut.h"

#include "base/sort.h"
#include "geom/kdtree.h"
#include "pipeline/dispatch.h"
#include "pipeline/round.h"
#include "pipeline/visits.h"

#include <string.h>

enum {
	SAMPLE = 256 * 1024,
	VISITS = 256 * 1024,     /* held in memory */
	AVOIDS = 64 * 1024,      /* places kept away from */
	NEVERS = 64 * 1024,      /* vertices that never were free: counted */
	PIECE = 8 * 1024,        /* answers read at once */
	BUFFER_LEAST = 4 * 1024, /* write buffer of a cluster */
	BUFFER_MOST = 64 * 1024
};

#define SEVERAL 0xffff                /* in the place of a new cluster: more than one */
#define CUT_AGAIN ((uint64_t)1 << 63) /* beside the id of an old cut vertex: the answer */

/* What one worker needs. */
typedef struct workspace {
	wh_store_workspace load;
	wh_patch patch;
	uint16_t *home; /* per vertex: the new cell it lies in */
	uint16_t *cell; /* per face: its new cluster */
	uint32_t *user; /* per vertex: the one new cluster that uses it, WH_NONE, or SEVERAL; then
	                 * the records up to and with its own */
	uint64_t *list; /* visits, or answers */
	size_t cap_home, cap_cell, cap_user, cap_list, n_list;
	wh_parcel out;
} workspace;

typedef struct recut {
	const wh_store *from;
	wh_store *to;
	wh_progress *progress;
	workspace *workspace;
	wh_kdtree tree;
	wh_kdpoint *sample;
	size_t samples;
	const wh_recut_params *params;
	wh_vec3 *avoid; /* places that the new cuts keep away from */
	size_t avoids, avoid_cap;
	uint64_t *still; /* ids of those that are cut again */
	size_t stills, still_cap;
	bool many_still;
	uint64_t stride, passed; /* every stride-th vertex is in the sample */
	uint64_t ids;            /* all are below */
	wh_visits visits;        /* of old cut vertices, in new clusters */
	int answer_fd;           /* ids of each old cluster's cut vertices, with their answers */
	uint64_t *answer;        /* where those of each old cluster begin; and the end */
	uint64_t *answered;      /* the first one of each old cluster that is open */
	wh_dispatch out;
} recut;

/* ---- where things go ---------------------------------------------------------------------- */

static wh_code fit(wh_ctx *c, workspace *ws)
{
	const size_t nv = ws->patch.nv, nf = ws->patch.nf;
	if (wh_renew(c, &ws->home, &ws->cap_home, nv, sizeof *ws->home) != WH_OK ||
	    wh_renew(c, &ws->cell, &ws->cap_cell, nf, sizeof *ws->cell) != WH_OK ||
	    wh_renew(c, &ws->user, &ws->cap_user, nv, sizeof *ws->user) != WH_OK)
		return c->err.code;
	return WH_OK;
}

/* Loads old cluster k and finds the new cluster of each face and the users of each vertex. */
static wh_code load_and_place(wh_ctx *c, const recut *r, workspace *ws, int64_t k)
{
	wh_patch *p = &ws->patch;
	if (wh_store_load(c, r->from, (uint32_t)k, &ws->load, p) != WH_OK || fit(c, ws) != WH_OK)
		return c->err.code;
	for (uint32_t v = 0; v < p->nv; v++) {
		ws->home[v] = (uint16_t)wh_kdtree_cell(&r->tree, &p->pos[v], p->gid[v]);
		ws->user[v] = WH_NONE;
	}
	for (uint32_t f = 0; f < p->nf; f++) {
		const uint32_t *t = &p->tri[3 * (size_t)f];
		const uint32_t cell =
		    wh_kdtree_majority(ws->home[t[0]], ws->home[t[1]], ws->home[t[2]]);
		ws->cell[f] = (uint16_t)cell;
		for (int j = 0; j < 3; j++) {
			uint32_t *u = &ws->user[t[j]];
			*u = *u == WH_NONE || *u == cell ? cell : SEVERAL;
		}
	}
	return WH_OK;
}

/* ---- sample ------------------------------------------------------------------------------- */

static wh_code sample_job(wh_ctx *c, void *arg, int64_t index, int worker)
{
	const recut *r = arg;
	workspace *ws = &r->workspace[worker];
	return wh_store_load(c, r->from, (uint32_t)index, &ws->load, &ws->patch);
}

/* New cuts should not run along the old ones: they keep away from a sample of the old cut vertices,
 * or, where every vertex is to become free, from all those that never were. */
static bool keeps_away_from(const recut *r, uint8_t flag, bool sampled)
{
	return r->params->free_all ? flag & WH_NEVER : sampled && flag & WH_CUT;
}

static wh_code avoid(wh_ctx *c, recut *r, wh_vec3 place)
{
	if (r->avoids == AVOIDS)
		return WH_OK;
	if (wh_reserve(c, &r->avoid, &r->avoid_cap, r->avoids + 1, sizeof *r->avoid) != WH_OK)
		return c->err.code;
	r->avoid[r->avoids++] = place;
	return WH_OK;
}

static wh_code sample_commit(wh_ctx *c, void *arg, int64_t index, int worker)
{
	(void)index;
	recut *r = arg;
	const wh_patch *p = &r->workspace[worker].patch;
	for (uint32_t v = 0; v < p->nv; v++) {
		const bool sampled = r->passed++ % r->stride == 0;
		if (sampled)
			r->sample[r->samples++] = (wh_kdpoint){p->pos[v], (double)p->gid[v]};
		if (keeps_away_from(r, p->flag[v], sampled) && avoid(c, r, p->pos[v]) != WH_OK)
			return c->err.code;
	}
	if (p->nv && p->gid[p->nv - 1] >= r->ids)
		r->ids = p->gid[p->nv - 1] + 1;
	return WH_OK;
}

static uint64_t sample_stride(uint64_t vertices)
{
	return vertices / SAMPLE + 1;
}

static size_t sample_size(uint64_t vertices)
{
	const uint64_t stride = sample_stride(vertices);
	return (size_t)((vertices + stride - 1) / stride);
}

static wh_code build_tree(wh_ctx *c, const wh_exec *ex, recut *r, uint64_t vertices)
{
	r->stride = sample_stride(vertices);
	r->sample = wh_alloc(c, sample_size(vertices), sizeof *r->sample);
	if (!r->sample ||
	    wh_exec_ordered(c, ex, r->from->clusters, sample_job, sample_commit, r) != WH_OK ||
	    wh_kdtree_build_clear(c, &r->tree, r->sample, r->samples, r->to->clusters,
	                          r->params->skew, r->avoid, r->avoids) != WH_OK)
		return c->err.code;
	wh_free(c, r->sample);
	wh_free(c, r->avoid);
	r->sample = NULL;
	r->avoid = NULL;
	return WH_OK;
}

/* ---- pass 1: faces ------------------------------------------------------------------------ */

/* Notes who uses the old cut vertices of a cluster that has been placed. */
static wh_code collect(wh_ctx *c, workspace *ws)
{
	const wh_patch *p = &ws->patch;
	if (wh_renew(c, &ws->list, &ws->cap_list, p->nv, sizeof *ws->list) != WH_OK)
		return c->err.code;
	ws->n_list = 0;
	for (uint32_t v = 0; v < p->nv; v++)
		if (p->flag[v] & WH_CUT)
			ws->list[ws->n_list++] = wh_visit(p->gid[v], ws->user[v]);
	return WH_OK;
}

static wh_code collect_commit(wh_ctx *c, recut *r, workspace *ws, int64_t index)
{
	if (wh_visits_add(c, &r->visits, ws->list, ws->n_list) != WH_OK)
		return c->err.code;
	for (size_t i = 0; i < ws->n_list; i++)
		ws->list[i] = wh_visit_vertex(ws->list[i]);
	r->answer[index + 1] = r->answer[index] + ws->n_list;
	return wh_spill_pwrite(c, r->from->spill, r->answer_fd, ws->list,
	                       ws->n_list * sizeof *ws->list, r->answer[index] * sizeof *ws->list);
}

static wh_code faces_job(wh_ctx *c, void *arg, int64_t index, int worker)
{
	const recut *r = arg;
	workspace *ws = &r->workspace[worker];
	if (load_and_place(c, r, ws, index) != WH_OK || collect(c, ws) != WH_OK ||
	    wh_parcel_begin(c, &ws->out, r->to->clusters, wh_store_face_bytes(r->to),
	                    ws->patch.nf) != WH_OK)
		return c->err.code;
	const wh_patch *p = &ws->patch;
	for (uint32_t f = 0; f < p->nf; f++)
		wh_parcel_add(&ws->out, ws->cell[f]);
	wh_parcel_lay_out(&ws->out);
	for (uint32_t f = 0; f < p->nf; f++) {
		const uint32_t *t = &p->tri[3 * (size_t)f];
		const uint64_t gid[3] = {p->gid[t[0]], p->gid[t[1]], p->gid[t[2]]};
		uint8_t *end = wh_store_put_face(r->to, wh_parcel_put(&ws->out, f), gid);
		if (p->face_bytes)
			memcpy(end, wh_patch_face(p, f), p->face_bytes);
	}
	return WH_OK;
}

static wh_code faces_commit(wh_ctx *c, void *arg, int64_t index, int worker)
{
	recut *r = arg;
	workspace *ws = &r->workspace[worker];
	wh_progress_add(r->progress, ws->patch.nf);
	if (collect_commit(c, r, ws, index) != WH_OK)
		return c->err.code;
	return wh_dispatch_faces(c, &r->out, &ws->out);
}

/* ---- which old cut vertices are cut again ------------------------------------------------- */

/* Of the visits taken: an old cut vertex is cut again when its faces go to several new clusters. */
static bool is_cut_again(const wh_visits *v, uint64_t gid)
{
	const size_t i = wh_visits_find(v, gid);
	return wh_visit_cluster(v->item[i]) == SEVERAL ||
	       (i + 1 < v->n && wh_visit_vertex(v->item[i + 1]) == gid);
}

/* Answers for the cut vertices of one old cluster, as far as the visits taken go. */
static wh_code answer_job(wh_ctx *c, void *arg, int64_t index, int worker)
{
	recut *r = arg;
	workspace *ws = &r->workspace[worker];
	const uint64_t end = r->answer[index + 1];
	uint64_t *next = &r->answered[index];
	if (wh_renew(c, &ws->list, &ws->cap_list, PIECE, sizeof *ws->list) != WH_OK)
		return c->err.code;
	for (size_t n = PIECE, done = n; done == n && *next < end; *next += done) {
		const uint64_t off = *next * sizeof *ws->list;
		n = end - *next < PIECE ? (size_t)(end - *next) : PIECE;
		done = 0;
		if (wh_spill_pread(c, r->from->spill, r->answer_fd, ws->list, n * sizeof *ws->list,
		                   off) != WH_OK)
			return c->err.code;
		for (; done < n && ws->list[done] < r->visits.end; done++)
			if (is_cut_again(&r->visits, ws->list[done]))
				ws->list[done] |= CUT_AGAIN;
		if (wh_spill_pwrite(c, r->from->spill, r->answer_fd, ws->list,
		                    done * sizeof *ws->list, off) != WH_OK)
			return c->err.code;
	}
	return WH_OK;
}

static wh_code answers_open(wh_ctx *c, recut *r)
{
	const size_t n = (size_t)r->from->clusters + 1;
	r->answer = wh_calloc(c, n, sizeof *r->answer);
	r->answered = wh_alloc(c, n, sizeof *r->answered);
	r->answer_fd = r->answer && r->answered ? wh_spill_scratch(c, r->from->spill) : -1;
	return r->answer_fd >= 0 ? WH_OK : wh_failed(c);
}

static wh_code find_cut_again(wh_ctx *c, const wh_exec *ex, recut *r)
{
	const int64_t n = r->from->clusters;
	if (wh_visits_seal(c, &r->visits) != WH_OK)
		return c->err.code;
	memcpy(r->answered, r->answer, (size_t)n * sizeof *r->answered);
	for (uint64_t first = 0; first < r->ids; first = r->visits.end)
		if (wh_visits_take(c, &r->visits, first) != WH_OK ||
		    wh_exec_for(c, ex, n, answer_job, r) != WH_OK)
			return c->err.code;
	wh_visits_close(c, &r->visits);
	return WH_OK;
}

/* ---- pass 2: vertices --------------------------------------------------------------------- */

/* From here on the flags say which vertices are cut by the new clusters. */
static wh_code read_answers(wh_ctx *c, const recut *r, workspace *ws, int64_t index)
{
	wh_patch *p = &ws->patch;
	const uint64_t first = r->answer[index];
	const size_t n = (size_t)(r->answer[index + 1] - first);
	if (wh_renew(c, &ws->list, &ws->cap_list, n, sizeof *ws->list) != WH_OK ||
	    wh_spill_pread(c, r->from->spill, r->answer_fd, ws->list, n * sizeof *ws->list,
	                   first * sizeof *ws->list) != WH_OK)
		return c->err.code;
	size_t at = 0;
	for (uint32_t v = 0; v < p->nv; v++) {
		if (!(p->flag[v] & WH_CUT))
			p->flag[v] = ws->user[v] == SEVERAL ? WH_CUT : 0;
		else if (!(ws->list[at++] & CUT_AGAIN))
			p->flag[v] = 0;
	}
	return WH_OK;
}

/* Visits of vertices with several users, in the patch's own numbering. */
static wh_code list_users(wh_ctx *c, workspace *ws)
{
	const wh_patch *p = &ws->patch;
	size_t n = 0;
	for (size_t i = 0; i < 3 * (size_t)p->nf; i++)
		n += ws->user[p->tri[i]] == SEVERAL;
	if (wh_renew(c, &ws->list, &ws->cap_list, n, sizeof *ws->list) != WH_OK)
		return c->err.code;
	n = 0;
	for (size_t i = 0; i < 3 * (size_t)p->nf; i++)
		if (ws->user[p->tri[i]] == SEVERAL)
			ws->list[n++] = wh_visit(p->tri[i], ws->cell[i / 3]);
	ws->n_list = wh_sort_unique(ws->list, n);
	return WH_OK;
}

/* Adds vertex v once for every cluster that uses it; *at: the first of ws->list that is not its. */
static void add_vertex(workspace *ws, uint32_t v, size_t *at)
{
	if (ws->user[v] != SEVERAL)
		wh_parcel_add(&ws->out, ws->user[v]);
	for (; *at < ws->n_list && wh_visit_vertex(ws->list[*at]) == v; ++*at)
		wh_parcel_add(&ws->out, wh_visit_cluster(ws->list[*at]));
	ws->user[v] = (uint32_t)ws->out.n; /* from now on: the records up to and with its own */
}

static void put_vertex(const wh_store *s, const wh_patch *p, uint32_t v, uint8_t *to)
{
	to = wh_store_put_vertex(s, to, p->gid[v], p->flag[v], p->pos[v], p->err[v]);
	if (p->attr_bytes)
		memcpy(to, wh_patch_attr(p, v), p->attr_bytes);
}

static wh_code vertices_job(wh_ctx *c, void *arg, int64_t index, int worker)
{
	const recut *r = arg;
	workspace *ws = &r->workspace[worker];
	if (load_and_place(c, r, ws, index) != WH_OK || read_answers(c, r, ws, index) != WH_OK ||
	    list_users(c, ws) != WH_OK)
		return c->err.code;
	const wh_patch *p = &ws->patch;
	if (wh_parcel_begin(c, &ws->out, r->to->clusters, wh_store_vertex_bytes(r->to),
	                    p->nv + ws->n_list) != WH_OK)
		return c->err.code;
	size_t at = 0;
	for (uint32_t v = 0; v < p->nv; v++)
		add_vertex(ws, v, &at);
	wh_parcel_lay_out(&ws->out);
	size_t i = 0;
	for (uint32_t v = 0; v < p->nv; v++)
		for (; i < ws->user[v]; i++)
			put_vertex(r->to, p, v, wh_parcel_put(&ws->out, i));
	return WH_OK;
}

/* Lists the vertices that never were free and are not now; several clusters may list one. Once
 * there are many, each counted once, the list is not gone on with. */
static wh_code note_still(wh_ctx *c, recut *r, const wh_patch *p)
{
	for (uint32_t v = 0; v < p->nv; v++) {
		if (!(p->flag[v] & WH_NEVER))
			continue;
		if (r->stills == (size_t)2 * NEVERS) {
			r->stills = wh_sort_unique(r->still, r->stills);
			r->many_still = r->stills >= NEVERS;
		}
		if (r->many_still)
			return WH_OK;
		if (wh_reserve(c, &r->still, &r->still_cap, r->stills + 1, sizeof *r->still) !=
		    WH_OK)
			return c->err.code;
		r->still[r->stills++] = p->gid[v];
	}
	return WH_OK;
}

static wh_code vertices_commit(wh_ctx *c, void *arg, int64_t index, int worker)
{
	(void)index;
	recut *r = arg;
	const workspace *ws = &r->workspace[worker];
	wh_progress_add(r->progress, ws->patch.nf);
	if (note_still(c, r, &ws->patch) != WH_OK)
		return c->err.code;
	return wh_dispatch_vertices(c, &r->out, &ws->out);
}

/* ---- all of it ---------------------------------------------------------------------------- */

static wh_code distribute(wh_ctx *c, const wh_exec *ex, recut *r, size_t buffer)
{
	const int64_t n = r->from->clusters;
	if (answers_open(c, r) != WH_OK ||
	    wh_visits_open(c, &r->visits, r->from->spill, r->ids, VISITS) != WH_OK ||
	    wh_dispatch_begin(c, &r->out, r->to, buffer) != WH_OK ||
	    wh_exec_ordered(c, ex, n, faces_job, faces_commit, r) != WH_OK ||
	    find_cut_again(c, ex, r) != WH_OK ||
	    wh_exec_ordered(c, ex, n, vertices_job, vertices_commit, r) != WH_OK)
		return c->err.code;
	return wh_dispatch_commit(c, &r->out);
}

/* Room for the largest cluster. */
static wh_code workspace_fit(wh_ctx *c, workspace *ws, const wh_store *from, uint64_t nv,
                             uint64_t nf)
{
	ws->patch.attr_bytes = from->attr_bytes;
	ws->patch.face_bytes = from->face_bytes;
	if (wh_store_workspace_fit(c, from, &ws->load, nv, nf) != WH_OK ||
	    wh_patch_reset(c, &ws->patch, (uint32_t)nv, (uint32_t)nf) != WH_OK)
		return c->err.code;
	return fit(c, ws);
}

static void workspaces_free(wh_ctx *c, recut *r, int workers)
{
	for (int i = 0; r->workspace && i < workers; i++) {
		workspace *ws = &r->workspace[i];
		wh_store_workspace_free(c, &ws->load);
		wh_patch_free(c, &ws->patch);
		wh_parcel_free(c, &ws->out);
		wh_free(c, ws->home);
		wh_free(c, ws->cell);
		wh_free(c, ws->user);
		wh_free(c, ws->list);
	}
	wh_free(c, r->workspace);
}

/* The layout of the new store: that of the old one, with global ids. */
static void describe_store(const wh_store *from, wh_store *to)
{
	to->id_bytes = from->id_bytes;
	to->coord_bytes = from->coord_bytes;
	to->vertex_payload = from->vertex_payload;
	to->attr_bytes = from->attr_bytes;
	to->face_bytes = from->face_bytes;
	to->local_corners = false;
}

static size_t larger(size_t a, size_t b)
{
	return a > b ? a : b;
}

/* A worker holds a cluster, where its parts go, and its parcel: all vertices, and in the worst
 * case one more for every corner. */
static size_t workspace_bytes(const wh_store *from, uint32_t clusters, uint64_t nv, uint64_t nf)
{
	wh_store to;
	describe_store(from, &to);
	const size_t faces = wh_parcel_bytes(clusters, wh_store_face_bytes(&to), (size_t)nf);
	const size_t corners = 3 * (size_t)nf;
	const size_t most = larger(corners, (size_t)nv); /* every vertex has a corner */
	const size_t vertices = wh_parcel_bytes(clusters, wh_store_vertex_bytes(&to), most);
	return wh_store_workspace_bytes(from, nv, nf) +
	       wh_patch_bytes(nv, nf, from->attr_bytes, from->face_bytes) + 6 * (size_t)nv +
	       2 * (size_t)nf + 8 * larger(most, PIECE) + larger(faces, vertices) + 1024;
}

/* Held all the time. */
static size_t always_bytes(const wh_store *from, uint32_t clusters)
{
	return wh_kdtree_bytes(clusters) + 16 * ((size_t)from->clusters + 1) + 4096;
}

/* The sample, and after that visits and the new files. */
static size_t stage_bytes(uint64_t vertices, uint32_t clusters, size_t buffer)
{
	return larger(sample_size(vertices) * sizeof(wh_kdpoint) +
	                  3 * (size_t)AVOIDS * sizeof(wh_vec3),
	              wh_visits_bytes(VISITS) + 3 * (size_t)NEVERS * sizeof(uint64_t) +
	                  wh_dispatch_bytes(clusters, buffer));
}

size_t wh_recut_bytes(const wh_store *from, uint32_t clusters, uint64_t max_vertices,
                      uint64_t max_faces, uint64_t vertices)
{
	return always_bytes(from, clusters) +
	       workspace_bytes(from, clusters, max_vertices, max_faces) +
	       stage_bytes(vertices, clusters, BUFFER_LEAST);
}

wh_code wh_recut_fit(wh_ctx *c, const wh_store *from, uint32_t clusters, size_t budget, wh_exec *ex,
                     size_t *buffer, size_t *need)
{
	uint64_t max_v, max_f, faces, vertices;
	if (wh_round_extent(c, from, &max_v, &max_f, &faces, &vertices) != WH_OK)
		return c->err.code;
	const size_t each = workspace_bytes(from, clusters, max_v, max_f);
	const size_t always = always_bytes(from, clusters);
	const size_t rest = always + stage_bytes(vertices, clusters, BUFFER_LEAST);
	while (ex->workers > 1 && rest + (size_t)ex->workers * each > budget)
		ex->workers--;
	const size_t all = (size_t)ex->workers * each;
	*need = rest + all;
	*buffer = BUFFER_LEAST;
	if (*need > budget)
		return WH_OK;
	*buffer += (budget - *need) / clusters;
	*buffer = *buffer < BUFFER_MOST ? *buffer : BUFFER_MOST;
	*need = always + all + stage_bytes(vertices, clusters, *buffer);
	return WH_OK;
}

wh_code wh_recut(wh_ctx *c, const wh_exec *ex, wh_progress *progress, const wh_store *from,
                 wh_store *to, const wh_recut_params *params, uint64_t *never_free)
{
	describe_store(from, to);
	recut r = {.from = from, .to = to, .progress = progress, .params = params, .answer_fd = -1};
	uint64_t max_v, max_f, faces, vertices;
	wh_code code = wh_round_extent(c, from, &max_v, &max_f, &faces, &vertices);
	wh_progress_phase(progress, "recut", 2 * faces);
	r.workspace = wh_calloc(c, (size_t)ex->workers, sizeof *r.workspace);
	for (int i = 0; r.workspace && code == WH_OK && i < ex->workers; i++)
		code = workspace_fit(c, &r.workspace[i], from, max_v, max_f);
	if (code == WH_OK)
		code = r.workspace ? build_tree(c, ex, &r, vertices) : wh_failed(c);
	if (code == WH_OK)
		code = distribute(c, ex, &r, params->buffer);
	const size_t stills = wh_sort_unique(r.still, r.stills);
	*never_free = stills < NEVERS ? stills : NEVERS;
	wh_dispatch_drop(c, &r.out);
	wh_visits_close(c, &r.visits);
	if (r.answer_fd >= 0)
		wh_spill_close_scratch(from->spill, r.answer_fd);
	wh_free(c, r.answer);
	wh_free(c, r.answered);
	wh_free(c, r.sample);
	wh_free(c, r.avoid);
	wh_free(c, r.still);
	wh_kdtree_free(c, &r.tree);
	workspaces_free(c, &r, ex->workers);
	return code;
}
