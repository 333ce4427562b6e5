/*
 * The partition is a k-d tree over a sample of the vertices (geom/kdtree). A vertex is at home in
 * the cell it lies in; a face goes to the cell that most of its corners are at home in, or, when
 * all three differ, to the least. A vertex that is used by a face outside its home is a cut
 * vertex; such visits are collected, and tell the last pass where to send the vertex besides its
 * home.
 *
 * Nothing that is held grows with the mesh beyond what the parameters say, whatever the order of
 * the vertices: homes come in windows (pipeline/homes), visits spill (pipeline/visits), and the
 * jobs of the last pass are cut by the records they send, not by vertices. All that grows is 16
 * bytes a chunk of faces, and only with windows.
 *
 * A share is the same over a stretch of the faces and a stretch of the vertices. Nothing has to be
 * known of the other shares: the faces of each tell which of its vertices are away from home, and
 * such a vertex is sent to its home by every share that finds it away, marked as cut, and to the
 * others' clusters by them. All other vertices go home from the one stretch they are in. Whoever
 * loads the cluster meets a vertex several times, then, and the marks of all count.
 */
#include "pipeline/ingest.h"

#include "base/chunks.h"
#include "base/sort.h"
#include "geom/kdtree.h"
#include "io/attributes.h"
#include "io/wedges.h"
#include "pipeline/homes.h"
#include "pipeline/pieces.h"
#include "pipeline/visits.h"

#include <float.h>
#include <string.h>
#include <unistd.h>

#include <xxhash.h>

enum {
	CHUNK = WH_DIGEST_CHUNK, /* vertices, faces or records a job */
	SAMPLE = 256 * 1024,     /* vertices the tree is built from, up to twice as many ... */
	SAMPLE_EACH = 64,        /* ... and no fewer than this for a cluster */
	BUFFER_LEAST = 4 * 1024, /* write buffer of a cluster */
	BUFFER_MOST = 128 * 1024,
	WINDOW_LEAST = 1024 * 1024, /* vertices */
	VISITS_MOST = 8 * 1024 * 1024
};

/* Exponents of two. */
enum {
	SIZE_MOST = 32,    /* meshes up to this size, and down to its inverse, are not scaled */
	SHIFT_MOST = 1000, /* no scale overflows, nor does its inverse */
	STEP_BITS = 26     /* steps of new positions in the size of a double mesh */
};

/* Items first .. end-1; of what is gone through, first is a multiple of CHUNK. */
typedef struct stretch {
	uint64_t first, end;
} stretch;

/* What one worker needs. */
typedef struct workspace {
	void *raw;
	double *xyz;
	uint8_t *attr;  /* records of the vertices at hand */
	uint64_t *ids;  /* corners of the faces at hand */
	uint16_t *home; /* of the vertices or corners at hand */
	wh_parcel out;
	uint64_t *away; /* visits of the faces at hand: no more than two each */
	size_t aways;
	stretch used; /* vertices, of a share */
	size_t cuts;  /* of the vertices sent; their positions come first in xyz then */
	uint64_t degenerate;
	wh_vec3 lo, hi;
} workspace;

typedef struct ingest {
	const wh_source *src;
	wh_store *store;
	wh_progress *progress;
	wh_ingest_result *result;
	const wh_ingest_params *params;
	uint32_t clusters;
	workspace *workspace;
	wh_kdtree tree;
	wh_kdpoint *sample;
	uint64_t stride; /* every stride-th vertex is in the sample */
	wh_homes homes;
	wh_visits visits;
	uint64_t first, end; /* vertices whose visits have been taken */
	wh_dispatch out;
	/* what is gone through here; without shares all of the source */
	stretch faces, vertices;
	stretch span; /* vertices that these faces use, those between them, and those above */
} ingest;

/* Chunks of a stretch are numbered from its beginning. */
static uint64_t chunk_first(const stretch *s, int64_t index)
{
	return s->first + (uint64_t)index * CHUNK;
}

static size_t chunk_size(const stretch *s, int64_t index)
{
	return wh_chunk_items(s->end - s->first, index, CHUNK);
}

static int64_t chunks_in(const stretch *s)
{
	return wh_chunks(s->end - s->first, CHUNK);
}

/* ---- pass 1: bounds and sample ------------------------------------------------------------ */

static uint64_t sample_stride(const wh_source *src, uint32_t clusters)
{
	const uint64_t wanted = (uint64_t)SAMPLE_EACH * clusters;
	return src->nv / (wanted > SAMPLE ? wanted : SAMPLE) + 1;
}

static size_t sample_size(const wh_source *src, uint32_t clusters)
{
	const uint64_t stride = sample_stride(src, clusters);
	return (size_t)((src->nv + stride - 1) / stride);
}

static wh_vec3 vertex_at(const workspace *ws, size_t i)
{
	return wh_v3(ws->xyz[3 * i], ws->xyz[3 * i + 1], ws->xyz[3 * i + 2]);
}

static wh_code bounds_job(wh_ctx *c, void *arg, int64_t index, int worker)
{
	ingest *g = arg;
	workspace *ws = &g->workspace[worker];
	const uint64_t first = (uint64_t)index * CHUNK;
	const size_t n = wh_chunk_items(g->src->nv, index, CHUNK);
	if (wh_source_vertices(c, g->src, first, n, ws->xyz, ws->raw) != WH_OK)
		return c->err.code;
	wh_digest_add(g->params->digest, wh_source_vertex_at(g->src, first), ws->raw,
	              n * g->src->vstride);
	wh_vec3 lo = vertex_at(ws, 0), hi = lo;
	for (size_t i = 1; i < n; i++) {
		lo = wh_lower(lo, vertex_at(ws, i));
		hi = wh_upper(hi, vertex_at(ws, i));
	}
	ws->lo = lo;
	ws->hi = hi;
	const uint64_t from = (first + g->stride - 1) / g->stride;
	for (uint64_t k = from; k * g->stride < first + n; k++)
		g->sample[k] = (wh_kdpoint){vertex_at(ws, (size_t)(k * g->stride - first)),
		                            (double)(k * g->stride)};
	return WH_OK;
}

static wh_code bounds_commit(wh_ctx *c, void *arg, int64_t index, int worker)
{
	(void)c;
	ingest *g = arg;
	const workspace *ws = &g->workspace[worker];
	wh_ingest_result *r = g->result;
	if (index == 0) {
		r->lo = ws->lo;
		r->hi = ws->hi;
	}
	r->lo = wh_lower(r->lo, ws->lo);
	r->hi = wh_upper(r->hi, ws->hi);
	wh_progress_add(g->progress, wh_chunk_items(g->src->nv, index, CHUNK));
	return WH_OK;
}

/* Size of the mesh as an exponent of two, from differences of positions, which are the same
 * wherever it lies. Outliers do not count as long as there is anything else. */
static int exponent_of_size(const ingest *g, size_t samples)
{
	const wh_vec3 box[2] = {wh_scale(g->result->lo, 0.5), wh_scale(g->result->hi, 0.5)};
	double most = 0, side = 0;
	for (uint32_t axis = 0; axis < 3; axis++) {
		most = fmax(most, wh_kd_spread(g->sample, samples, axis));
		side = fmax(side, wh_kd_axis(&box[1], 0, axis) - wh_kd_axis(&box[0], 0, axis));
	}
	if (isinf(most))
		return DBL_MAX_EXP - 1;
	if (most > 0)
		return ilogb(most);
	return side > 0 ? ilogb(side) + 1 : 0;
}

/*
 * Positions stay where they are, however far from zero: the stages compute with differences of
 * them alone, and a vertex that never moves keeps every bit. Only units out of the ordinary are
 * changed, by a power of two, which changes no digit: on the way to a new position stand twelfth
 * powers of lengths.
 *
 * The step of new positions in a double mesh is a quarter of what a float's would be at the rim of
 * a mesh around zero. Whole steps are still doubles as far off as 2^26 times the size: up to there
 * a mesh whose positions are whole steps gives the same result wherever it lies.
 */
static void choose_units(const ingest *g, size_t samples)
{
	const int size = exponent_of_size(g, samples);
	const int scaled = size > SIZE_MOST ? SIZE_MOST : size < -SIZE_MOST ? -SIZE_MOST : size;
	const int shift = scaled - size < SHIFT_MOST ? scaled - size : SHIFT_MOST;
	g->result->scale = ldexp(1, shift);
	g->result->step = g->src->is_double ? ldexp(1, size + shift - STEP_BITS) : 0;
}

/* ---- pass 2: the home of each vertex ------------------------------------------------------ */

static wh_code home_job(wh_ctx *c, void *arg, int64_t index, int worker)
{
	ingest *g = arg;
	workspace *ws = &g->workspace[worker];
	const uint64_t first = chunk_first(&g->span, index);
	const size_t n = chunk_size(&g->span, index);
	if (wh_source_vertices(c, g->src, first, n, ws->xyz, ws->raw) != WH_OK)
		return c->err.code;
	for (size_t i = 0; i < n; i++) {
		const wh_vec3 p = vertex_at(ws, i);
		ws->home[i] = (uint16_t)wh_kdtree_cell(&g->tree, &p, first + i);
	}
	wh_progress_add(g->progress, n);
	return wh_homes_put(c, &g->homes, first, n, ws->home);
}

/* ---- pass 3: faces ------------------------------------------------------------------------ */

static wh_code read_faces(wh_ctx *c, const ingest *g, workspace *ws, int64_t index, size_t *n)
{
	*n = chunk_size(&g->faces, index);
	return wh_source_triangles(c, g->src, chunk_first(&g->faces, index), *n, ws->ids, ws->raw);
}

/* With windows: homes of the corners inside the window at hand. */
static wh_code corners_job(wh_ctx *c, void *arg, int64_t index, int worker)
{
	ingest *g = arg;
	workspace *ws = &g->workspace[worker];
	size_t n;
	wh_progress_add(g->progress, chunk_size(&g->faces, index));
	if (!wh_homes_wants(&g->homes, index))
		return WH_OK;
	const wh_code code = read_faces(c, g, ws, index, &n);
	if (code != WH_OK)
		return code;
	return wh_homes_fill(c, &g->homes, index, ws->ids, 3 * n, ws->home);
}

static wh_code find_corners(wh_ctx *c, const wh_exec *ex, ingest *g)
{
	const uint64_t windows = wh_homes_windows(&g->homes);
	const int64_t chunks = chunks_in(&g->faces);
	g->result->windows = windows ? windows : 1;
	if (windows == 0)
		return WH_OK;
	wh_progress_phase(g->progress, "corners", windows * (g->faces.end - g->faces.first));
	for (uint64_t w = 0; w < windows; w++) {
		if (wh_homes_window(c, &g->homes, w) != WH_OK)
			return c->err.code;
		for (int64_t i = 0; i < chunks; i++)
			if (wh_homes_wants(&g->homes, i))
				g->result->face_reads += chunk_size(&g->faces, i);
		const wh_code code = wh_exec_for(c, ex, chunks, corners_job, g);
		if (code != WH_OK)
			return code;
	}
	wh_homes_filled(c, &g->homes);
	return WH_OK;
}

static bool is_degenerate(const uint64_t *t)
{
	return t[0] == t[1] || t[1] == t[2] || t[2] == t[0];
}

/* Chooses the cluster of a face and notes who is away from home for it. */
static void place_face(workspace *ws, const uint64_t *t, const uint16_t *home)
{
	const uint32_t k = wh_kdtree_majority(home[0], home[1], home[2]);
	wh_parcel_add(&ws->out, k);
	for (int j = 0; j < 3; j++)
		if (home[j] != k)
			ws->away[ws->aways++] = wh_visit(t[j], k);
}

/* Degenerate faces are left out, and the corners of those behind them move up. */
static void place_faces(workspace *ws, size_t n)
{
	ws->aways = ws->degenerate = 0;
	for (size_t i = 0; i < n; i++) {
		const uint64_t *t = &ws->ids[3 * i];
		if (is_degenerate(t)) {
			ws->degenerate++;
			continue;
		}
		place_face(ws, t, &ws->home[3 * i]);
		if (ws->degenerate)
			memmove(&ws->ids[3 * (i - ws->degenerate)], t, 3 * sizeof *t);
	}
}

/* What faces carry lies behind their corners, and in a rewritten body none is degenerate. */
static void put_faces(const ingest *g, workspace *ws)
{
	const wh_source *s = g->src;
	const size_t size = g->store->face_bytes;
	const uint8_t *carried = (const uint8_t *)ws->raw + s->fstride - size;
	for (size_t i = 0; i < ws->out.n; i++, carried += s->fstride) {
		uint8_t *end =
		    wh_store_put_face(g->store, wh_parcel_put(&ws->out, i), &ws->ids[3 * i]);
		if (size)
			memcpy(end, carried, size);
	}
}

static wh_code face_job(wh_ctx *c, void *arg, int64_t index, int worker)
{
	ingest *g = arg;
	workspace *ws = &g->workspace[worker];
	size_t n;
	const wh_code code = read_faces(c, g, ws, index, &n);
	if (code != WH_OK)
		return code;
	wh_digest_add(g->params->digest, wh_source_face_at(g->src, chunk_first(&g->faces, index)),
	              ws->raw, n * g->src->fstride);
	if (wh_homes_corners(c, &g->homes, index, ws->ids, 3 * n, ws->home) != WH_OK ||
	    wh_parcel_begin(c, &ws->out, g->clusters, wh_store_face_bytes(g->store), CHUNK) !=
	        WH_OK)
		return c->err.code;
	place_faces(ws, n);
	wh_parcel_lay_out(&ws->out);
	put_faces(g, ws);
	ws->aways = wh_sort_unique(ws->away, ws->aways);
	return WH_OK;
}

static wh_code face_commit(wh_ctx *c, void *arg, int64_t index, int worker)
{
	ingest *g = arg;
	const workspace *ws = &g->workspace[worker];
	g->result->degenerate += ws->degenerate;
	g->result->faces += ws->out.n;
	wh_progress_add(g->progress, chunk_size(&g->faces, index));
	if (wh_visits_add(c, &g->visits, ws->away, ws->aways) != WH_OK)
		return c->err.code;
	return wh_dispatch_faces(c, &g->out, &ws->out);
}

/* ---- pass 4: vertices --------------------------------------------------------------------- */

/* Records that the taken vertices below `gid` are sent as: one for their home, one a visit. */
static uint64_t records_below(const ingest *g, uint64_t gid)
{
	return gid - g->first + wh_visits_find(&g->visits, gid);
}

/* The first of the taken vertices that has so many records or more before it. */
static uint64_t vertex_of_record(const ingest *g, uint64_t record)
{
	uint64_t lo = g->first, hi = g->end;
	while (lo < hi) {
		const uint64_t mid = lo + (hi - lo) / 2;
		if (records_below(g, mid) < record)
			lo = mid + 1;
		else
			hi = mid;
	}
	return lo;
}

/* A vertex goes home from the stretch it is in, and from where it is away. */
static bool goes_home(const ingest *g, uint64_t gid, size_t at)
{
	return gid - g->vertices.first < g->vertices.end - g->vertices.first ||
	       (at < g->visits.n && wh_visit_vertex(g->visits.item[at]) == gid);
}

/* Of vertices first .. first+n-1, those that are at home and those visiting; at home comes first.
 */
static void add_vertices(const ingest *g, workspace *ws, uint64_t first, size_t n)
{
	const wh_visits *v = &g->visits;
	size_t at = wh_visits_find(v, first);
	for (size_t i = 0; i < n; i++) {
		if (goes_home(g, first + i, at))
			wh_parcel_add(&ws->out, ws->home[i]);
		for (; at < v->n && wh_visit_vertex(v->item[at]) == first + i; at++)
			wh_parcel_add(&ws->out, wh_visit_cluster(v->item[at]));
	}
}

/* The position has been sent: it may make room for that of the next cut vertex. */
static void keep_cut(workspace *ws, size_t i)
{
	memmove(&ws->xyz[3 * ws->cuts++], &ws->xyz[3 * i], 3 * sizeof *ws->xyz);
}

static uint32_t record_bytes(const wh_source *src)
{
	return src->attributes ? src->attributes->bytes : 0;
}

static void put_vertices(const ingest *g, workspace *ws, uint64_t first, size_t n)
{
	const uint32_t record = record_bytes(g->src);
	const wh_visits *v = &g->visits;
	size_t at = wh_visits_find(v, first), sent = 0;
	for (size_t i = 0; i < n; i++) {
		const uint64_t gid = first + i;
		if (!goes_home(g, gid, at))
			continue;
		const wh_vec3 p = wh_scale(vertex_at(ws, i), g->result->scale);
		const size_t visited = at;
		while (at < v->n && wh_visit_vertex(v->item[at]) == gid)
			at++;
		const uint8_t flag = at > visited ? WH_CUT | WH_NEVER : 0;
		for (size_t k = visited; k <= at; k++) {
			uint8_t *end = wh_store_put_vertex(
			    g->store, wh_parcel_put(&ws->out, sent++), gid, flag, p, 0);
			if (record)
				memcpy(end, ws->attr + i * record, record);
		}
		if (at > visited)
			keep_cut(ws, i);
	}
}

/* Sends about CHUNK records: those of the vertices that begin in this part of all. */
static wh_code vertex_job(wh_ctx *c, void *arg, int64_t index, int worker)
{
	ingest *g = arg;
	workspace *ws = &g->workspace[worker];
	const uint64_t first = vertex_of_record(g, (uint64_t)index * CHUNK);
	const size_t n = (size_t)(vertex_of_record(g, ((uint64_t)index + 1) * CHUNK) - first);
	if (wh_source_vertices(c, g->src, first, n, ws->xyz, ws->raw) != WH_OK ||
	    (g->src->attributes &&
	     wh_source_attributes(c, g->src, first, n, ws->attr, ws->raw) != WH_OK) ||
	    wh_homes_get(c, &g->homes, first, n, ws->home) != WH_OK ||
	    wh_parcel_begin(c, &ws->out, g->clusters, wh_store_vertex_bytes(g->store),
	                    CHUNK + g->clusters) != WH_OK)
		return c->err.code;
	ws->cuts = 0;
	add_vertices(g, ws, first, n);
	wh_parcel_lay_out(&ws->out);
	put_vertices(g, ws, first, n);
	wh_progress_add(g->progress, n);
	return WH_OK;
}

static wh_code list_cuts(wh_ctx *c, ingest *g, const workspace *ws)
{
	wh_cut_list *cuts = g->params->cuts;
	if (!cuts || ws->cuts == 0)
		return WH_OK;
	const size_t each = 3 * sizeof *ws->xyz;
	const uint64_t at = cuts->n * each;
	cuts->n += ws->cuts;
	return wh_spill_pwrite(c, g->store->spill, cuts->fd, ws->xyz, ws->cuts * each, at);
}

static wh_code vertex_commit(wh_ctx *c, void *arg, int64_t index, int worker)
{
	(void)index;
	ingest *g = arg;
	const workspace *ws = &g->workspace[worker];
	if (list_cuts(c, g, ws) != WH_OK)
		return c->err.code;
	return wh_dispatch_vertices(c, &g->out, &ws->out);
}

static uint64_t count_vertices(const wh_visits *v)
{
	uint64_t n = 0;
	for (size_t i = 0; i < v->n; i++)
		n += i == 0 || wh_visit_vertex(v->item[i]) != wh_visit_vertex(v->item[i - 1]);
	return n;
}

/* The cut vertices of a share are those of others, too: they are listed, and not only counted. */
static wh_code list_ids(wh_ctx *c, const ingest *g)
{
	uint64_t batch[WH_PIECES_IDS];
	size_t held = 0;
	const wh_visits *v = &g->visits;
	for (size_t i = 0; g->params->share && i < v->n; i++) {
		const uint64_t id = wh_visit_vertex(v->item[i]);
		if (held == 0 || batch[held - 1] != id)
			batch[held++] = id;
		const bool last = i + 1 == v->n ||
		                  (held == WH_PIECES_IDS && wh_visit_vertex(v->item[i + 1]) != id);
		if (!last)
			continue;
		if (wh_pieces_add_ids(c, g->store->pieces, batch, held) != WH_OK)
			return c->err.code;
		held = 0;
	}
	return WH_OK;
}

static wh_code send_vertices(wh_ctx *c, const wh_exec *ex, ingest *g)
{
	const stretch *span = &g->span;
	wh_progress_phase(g->progress, "vertices", span->end - span->first);
	g->result->vertex_reads += span->end - span->first;
	g->result->record_reads += span->end - span->first;
	if (wh_visits_seal(c, &g->visits) != WH_OK)
		return c->err.code;
	for (uint64_t at = 0; at < span->end; at = g->visits.end) {
		if (wh_visits_take(c, &g->visits, at) != WH_OK)
			return c->err.code;
		g->first = at > span->first ? at : span->first;
		g->end = g->visits.end < span->end ? g->visits.end : span->end;
		if (g->first >= g->end)
			continue;
		g->result->cut_vertices += count_vertices(&g->visits);
		if (list_ids(c, g) != WH_OK)
			return c->err.code;
		const int64_t jobs = wh_chunks(records_below(g, g->end), CHUNK);
		if (wh_exec_ordered(c, ex, jobs, vertex_job, vertex_commit, g) != WH_OK)
			return c->err.code;
	}
	return WH_OK;
}

/* ---- memory ------------------------------------------------------------------------------- */

static size_t larger(size_t a, size_t b)
{
	return a > b ? a : b;
}

static size_t raw_bytes(const wh_source *src)
{
	return larger(wh_source_vertex_bytes(src, CHUNK), wh_source_triangle_bytes(src, CHUNK));
}

void wh_ingest_describe(const wh_source *src, uint32_t clusters, wh_store *store)
{
	store->clusters = clusters;
	store->id_bytes = src->nv < (uint64_t)1 << 30 ? 4 : 8;
	store->coord_bytes = src->is_double ? 8 : 4;
	store->vertex_payload = 0;
	store->attr_bytes = record_bytes(src);
	store->face_bytes = src->wedges ? src->wedges->bytes : 0;
	store->local_corners = false;
}

static size_t workspace_bytes(const wh_source *src, const wh_ingest_params *params)
{
	wh_store store;
	wh_ingest_describe(src, params->clusters, &store);
	const size_t record = larger(wh_store_face_bytes(&store), wh_store_vertex_bytes(&store));
	const size_t each =
	    3 * sizeof(double) + 3 * sizeof(uint64_t) + 3 * sizeof(uint16_t) + 2 * sizeof(uint64_t);
	return raw_bytes(src) + CHUNK * (each + record_bytes(src)) +
	       wh_parcel_bytes(params->clusters, record, CHUNK + params->clusters) + 1024;
}

static wh_homes_params homes_params(const wh_source *src, const wh_ingest_params *params)
{
	return (wh_homes_params){.vertices = src->nv,
	                         .window = params->window,
	                         .chunks = (uint64_t)wh_chunks(src->nf, CHUNK),
	                         .chunk_corners = 3 * (size_t)CHUNK};
}

static size_t visits_room(const wh_ingest_params *params)
{
	return larger(params->visits, wh_visits_least(params->clusters));
}

size_t wh_ingest_bytes(const wh_source *src, const wh_exec *ex, const wh_ingest_params *params)
{
	const wh_homes_params hp = homes_params(src, params);
	const size_t always = (size_t)ex->workers * workspace_bytes(src, params) +
	                      wh_kdtree_bytes(params->clusters) +
	                      (params->share ? wh_pieces_bytes(params->clusters) : 0) + 1024;
	const size_t sample = sample_size(src, params->clusters) * sizeof(wh_kdpoint);
	const size_t out = wh_homes_bytes_after(&hp) + wh_visits_bytes(visits_room(params)) +
	                   wh_dispatch_bytes(params->clusters, params->buffer);
	return always + larger(larger(sample, wh_homes_bytes(&hp)), out);
}

/* As few windows as fit, of one size, given that the smallest size fits. */
static void fit_window(const wh_source *src, size_t budget, const wh_exec *ex,
                       wh_ingest_params *params)
{
	params->window = 0;
	if (wh_ingest_bytes(src, ex, params) <= budget)
		return;
	uint64_t windows = 2;
	for (;; windows++) {
		params->window = (src->nv + windows - 1) / windows;
		if (params->window <= WINDOW_LEAST || wh_ingest_bytes(src, ex, params) <= budget)
			break;
	}
	if (params->window < WINDOW_LEAST)
		params->window = WINDOW_LEAST;
}

size_t wh_ingest_fit(const wh_source *src, size_t budget, wh_exec *ex, wh_ingest_params *params)
{
	params->buffer = BUFFER_LEAST;
	params->visits = 0;
	params->window = WINDOW_LEAST;
	while (ex->workers > 1 && wh_ingest_bytes(src, ex, params) > budget)
		ex->workers--;
	const size_t least = wh_ingest_bytes(src, ex, params);
	if (least > budget)
		return least;
	fit_window(src, budget, ex, params);
	/* of what is left, a half for write buffers and a quarter for visits */
	const size_t spare = budget - wh_ingest_bytes(src, ex, params);
	const size_t buffer = BUFFER_LEAST + spare / 2 / params->clusters;
	params->buffer = buffer < BUFFER_MOST ? buffer : BUFFER_MOST;
	const size_t visits = wh_visits_least(params->clusters) + spare / 4 / sizeof(uint64_t);
	params->visits = visits < VISITS_MOST ? visits : VISITS_MOST;
	return wh_ingest_bytes(src, ex, params);
}

static wh_code workspaces_make(wh_ctx *c, ingest *g, int workers)
{
	g->workspace = wh_calloc(c, (size_t)workers, sizeof *g->workspace);
	for (int i = 0; g->workspace && i < workers; i++) {
		workspace *ws = &g->workspace[i];
		ws->raw = wh_alloc(c, raw_bytes(g->src), 1);
		ws->xyz = wh_alloc(c, CHUNK, 3 * sizeof *ws->xyz);
		if (g->src->attributes)
			ws->attr = wh_alloc(c, CHUNK, record_bytes(g->src));
		ws->ids = wh_alloc(c, CHUNK, 3 * sizeof *ws->ids);
		ws->home = wh_alloc(c, CHUNK, 3 * sizeof *ws->home);
		ws->away = wh_alloc(c, CHUNK, 2 * sizeof *ws->away);
	}
	return c->err.code;
}

static void workspaces_free(wh_ctx *c, ingest *g, int workers)
{
	for (int i = 0; g->workspace && i < workers; i++) {
		workspace *ws = &g->workspace[i];
		wh_free(c, ws->raw);
		wh_free(c, ws->xyz);
		wh_free(c, ws->attr);
		wh_free(c, ws->ids);
		wh_free(c, ws->home);
		wh_free(c, ws->away);
		wh_parcel_free(c, &ws->out);
	}
	wh_free(c, g->workspace);
}

/* ---- all of it ---------------------------------------------------------------------------- */

/* Reads all vertices. */
static wh_code take_sample(wh_ctx *c, const wh_exec *ex, ingest *g)
{
	g->stride = sample_stride(g->src, g->clusters);
	g->sample = wh_alloc(c, sample_size(g->src, g->clusters), sizeof *g->sample);
	if (!g->sample)
		return c->err.code;
	wh_progress_phase(g->progress, "bounds", g->src->nv);
	g->result->vertex_reads += g->src->nv;
	return wh_exec_ordered(c, ex, wh_chunks(g->src->nv, CHUNK), bounds_job, bounds_commit, g);
}

/* What another process found so. */
static wh_code read_scan(wh_ctx *c, ingest *g)
{
	wh_scan scan;
	wh_spill *spill = g->store->spill;
	const size_t samples = sample_size(g->src, g->clusters);
	const int fd = wh_spill_read(c, spill, WH_SCAN_NAME);
	wh_code code = fd >= 0 ? wh_spill_pread(c, spill, fd, &scan, sizeof scan, 0) : wh_failed(c);
	const bool ours = code == WH_OK && scan.vertices == g->src->nv &&
	                  scan.faces == g->src->nf && scan.clusters == g->clusters &&
	                  scan.samples == samples && scan.zero == 0;
	g->sample = ours ? wh_alloc(c, samples, sizeof *g->sample) : NULL;
	if (g->sample)
		code = wh_spill_pread(c, spill, fd, g->sample, samples * sizeof *g->sample,
		                      sizeof scan);
	if (fd >= 0)
		(void)close(fd);
	if (code == WH_OK &&
	    (!g->sample || XXH3_64bits(g->sample, samples * sizeof *g->sample) != scan.checksum))
		code = wh_fail(c, WH_E_RUN,
		               "%s/" WH_SCAN_NAME ": damaged, or of another input: plan again",
		               spill->dir);
	if (code == WH_OK) {
		g->result->lo = scan.lo;
		g->result->hi = scan.hi;
	}
	return code;
}

static wh_code build_tree(wh_ctx *c, const wh_exec *ex, ingest *g)
{
	const size_t samples = sample_size(g->src, g->clusters);
	if ((g->params->share ? read_scan(c, g) : take_sample(c, ex, g)) != WH_OK)
		return c->err.code;
	choose_units(g, samples);
	if (wh_kdtree_build(c, &g->tree, g->sample, samples, g->clusters, 0.5) != WH_OK)
		return c->err.code;
	wh_free(c, g->sample);
	g->sample = NULL;
	return WH_OK;
}

/* One of so many parts of all chunks. */
static stretch part_of(uint64_t items, uint32_t part, uint32_t parts)
{
	const uint64_t chunks = (uint64_t)wh_chunks(items, CHUNK);
	const uint64_t first = chunks * part / parts * CHUNK,
	               end = chunks * (part + 1) / parts * CHUNK;
	return (stretch){first, end < items ? end : items};
}

/* Widens the worker's bounds of the ids that the share's faces use. */
static wh_code span_job(wh_ctx *c, void *arg, int64_t index, int worker)
{
	ingest *g = arg;
	workspace *ws = &g->workspace[worker];
	size_t n;
	const wh_code code = read_faces(c, g, ws, index, &n);
	for (size_t i = 0; code == WH_OK && i < 3 * n; i++) {
		ws->used.first = ws->ids[i] < ws->used.first ? ws->ids[i] : ws->used.first;
		ws->used.end = ws->ids[i] >= ws->used.end ? ws->ids[i] + 1 : ws->used.end;
	}
	return code;
}

static wh_code choose_stretches(wh_ctx *c, const wh_exec *ex, ingest *g)
{
	const wh_ingest_share *share = g->params->share;
	const wh_source *src = g->src;
	g->faces = part_of(src->nf, share ? share->part : 0, share ? share->parts : 1);
	g->vertices = part_of(src->nv, share ? share->part : 0, share ? share->parts : 1);
	g->span = g->vertices;
	if (!share)
		return WH_OK;
	for (int i = 0; i < ex->workers; i++)
		g->workspace[i].used = g->vertices;
	g->result->face_reads += g->faces.end - g->faces.first;
	const wh_code code = wh_exec_for(c, ex, chunks_in(&g->faces), span_job, g);
	for (int i = 0; i < ex->workers; i++) {
		const stretch *used = &g->workspace[i].used;
		g->span.first = used->first < g->span.first ? used->first : g->span.first;
		g->span.end = used->end > g->span.end ? used->end : g->span.end;
	}
	g->span.first -= g->span.first % CHUNK;
	return code;
}

/* Where that goes which nobody else has to see. */
static wh_spill *scratch_of(const ingest *g)
{
	return g->params->share ? g->params->share->scratch : g->store->spill;
}

static wh_code find_homes(wh_ctx *c, const wh_exec *ex, ingest *g)
{
	wh_homes_params hp = homes_params(g->src, g->params);
	hp.base = g->span.first;
	hp.vertices = g->span.end - g->span.first;
	if (wh_homes_open(c, &g->homes, scratch_of(g), &hp) != WH_OK)
		return c->err.code;
	wh_progress_phase(g->progress, "partition", hp.vertices);
	g->result->vertex_reads += hp.vertices;
	if (wh_exec_for(c, ex, chunks_in(&g->span), home_job, g) != WH_OK)
		return c->err.code;
	return find_corners(c, ex, g);
}

static wh_code distribute(wh_ctx *c, const wh_exec *ex, ingest *g)
{
	if (wh_visits_open(c, &g->visits, scratch_of(g), g->src->nv, visits_room(g->params)) !=
	        WH_OK ||
	    wh_dispatch_begin(c, &g->out, g->store, g->params->buffer) != WH_OK)
		return c->err.code;
	wh_progress_phase(g->progress, "faces", g->faces.end - g->faces.first);
	g->result->face_reads += g->faces.end - g->faces.first;
	const wh_code code = wh_exec_ordered(c, ex, chunks_in(&g->faces), face_job, face_commit, g);
	if (code != WH_OK)
		return code;
	if (send_vertices(c, ex, g) != WH_OK)
		return c->err.code;
	return wh_dispatch_commit(c, &g->out);
}

wh_code wh_ingest(wh_ctx *c, const wh_exec *ex, wh_progress *progress, const wh_source *src,
                  const wh_ingest_params *params, wh_store *store, wh_ingest_result *result)
{
	*result = (wh_ingest_result){0};
	if (src->nv > WH_VISIT_VERTICES)
		return wh_fail(c, WH_E_PLAN, "%s: more than 2^48 vertices", src->path);
	wh_ingest_describe(src, params->clusters, store);
	if (params->cuts)
		params->cuts->n = 0;
	if (params->digest)
		atomic_store(params->digest, 0);
	ingest g = {.src = src,
	            .store = store,
	            .progress = progress,
	            .result = result,
	            .params = params,
	            .clusters = params->clusters};
	wh_code code = workspaces_make(c, &g, ex->workers);
	if (code == WH_OK)
		code = build_tree(c, ex, &g);
	if (code == WH_OK)
		code = choose_stretches(c, ex, &g);
	if (code == WH_OK)
		code = find_homes(c, ex, &g);
	if (code == WH_OK)
		code = distribute(c, ex, &g);
	wh_dispatch_drop(c, &g.out);
	wh_visits_close(c, &g.visits);
	wh_homes_close(c, &g.homes);
	wh_free(c, g.sample);
	wh_kdtree_free(c, &g.tree);
	workspaces_free(c, &g, ex->workers);
	return code;
}

/* ---- the scan for shares ------------------------------------------------------------------ */

static wh_code write_scan(wh_ctx *c, wh_spill *spill, const wh_scan *scan, const void *sample)
{
	char part[WH_SPILL_NAME];
	const size_t bytes = (size_t)scan->samples * sizeof(wh_kdpoint);
	const int fd = wh_spill_create(c, spill, wh_spill_part(spill, WH_SCAN_NAME, part));
	if (fd < 0)
		return wh_failed(c);
	wh_code code = wh_spill_pwrite(c, spill, fd, scan, sizeof *scan, 0);
	if (code == WH_OK)
		code = wh_spill_pwrite(c, spill, fd, sample, bytes, sizeof *scan);
	if (close(fd) != 0 && code == WH_OK)
		code = wh_fail_errno(c, "%s/%s: cannot write", spill->dir, part);
	return code == WH_OK ? wh_spill_rename(c, spill, part, WH_SCAN_NAME) : code;
}

wh_code wh_ingest_scan(wh_ctx *c, const wh_exec *ex, wh_progress *progress, const wh_source *src,
                       uint32_t clusters, wh_spill *spill, wh_ingest_result *result)
{
	_Atomic uint64_t digest = 0;
	*result = (wh_ingest_result){0};
	const wh_ingest_params params = {.clusters = clusters, .digest = &digest};
	ingest g = {.src = src,
	            .progress = progress,
	            .result = result,
	            .params = &params,
	            .clusters = clusters};
	wh_code code = workspaces_make(c, &g, ex->workers);
	if (code == WH_OK)
		code = take_sample(c, ex, &g);
	if (code == WH_OK) {
		wh_scan scan = {.lo = result->lo,
		                .hi = result->hi,
		                .vertices = src->nv,
		                .faces = src->nf,
		                .digest = atomic_load(&digest),
		                .samples = sample_size(src, clusters),
		                .clusters = clusters};
		scan.checksum = XXH3_64bits(g.sample, scan.samples * sizeof *g.sample);
		code = write_scan(c, spill, &scan, g.sample);
	}
	wh_free(c, g.sample);
	workspaces_free(c, &g, ex->workers);
	return code;
}

wh_code wh_ingest_scanned(wh_ctx *c, wh_spill *spill, uint64_t *digest)
{
	wh_scan scan = {0};
	const int fd = wh_spill_read(c, spill, WH_SCAN_NAME);
	if (fd < 0)
		return wh_failed(c);
	const wh_code code = wh_spill_pread(c, spill, fd, &scan, sizeof scan, 0);
	(void)close(fd);
	*digest = scan.digest;
	return code;
}
