/*
 * In steps, each a pass in parallel:
 *
 *     scan      vertices: which are finite, and the box around them
 *     near      which of them become which others (pipeline/near), when asked for
 *     vertices  those that stay are written; their new ids are their ranks among them
 *     corners   faces, once for each window of ids but the last: corners that became another one
 *     faces     the same for the last window, and what is left is written
 *
 * A window is as many ids as the map from old to new ones has room for in memory; a corner that
 * stays needs no map. With more than one, what is known of the corners lies on disk between passes,
 * and chunks of faces that have nothing to do with a window are passed over.
 */
#include "pipeline/clean.h"

#include "base/chunks.h"
#include "io/attributes.h"
#include "io/wedges.h"
#include "pipeline/near.h"
#include "pipeline/plain.h"

#include <math.h>
#include <string.h>

enum {
	CHUNK = 32 * 1024,          /* vertices or faces a job */
	WINDOW_LEAST = 1024 * 1024, /* ids, so that there are not very many passes */
	MOST_WINDOWS = 4096
};

_Static_assert(CHUNK % WH_RANK_WORD == 0, "no two jobs have bits in one word");

/* Corners whose new id is not known, or never will be. */
#define PENDING (UINT64_C(1) << 63) /* and the old id: its window has not come yet */
#define GONE UINT64_MAX             /* the vertex is not finite */
#define NO_FACE (UINT64_MAX - 1)    /* the face has a repeated corner to begin with */
#define NOT_WELDED UINT64_MAX

/* What one worker needs. */
typedef struct workspace {
	void *raw;
	double *xyz;
	uint8_t *records;
	uint64_t *ids;
	unsigned char *out; /* vertices or faces as they are written */
	size_t out_n;
	wh_vec3 lo, hi; /* of the chunk at hand; lo > hi: nothing is finite */
	wh_clean_result found;
} workspace;

typedef struct clean {
	const wh_source *source;
	const wh_clean_params *params;
	wh_progress *progress;
	wh_spill *spill;
	wh_clean_result *result;
	workspace *workspace;
	wh_rank kept;
	wh_vec3 lo, hi;
	wh_near near;
	uint64_t window, windows, first; /* first id of the window at hand */
	uint64_t *map;                   /* old ids of the window to new ones */
	int corners_fd;                  /* of what is known between windows; -1 */
	wh_plain_span *waits;            /* one for each chunk of faces */
	wh_source *out;
	uint64_t end; /* bytes of the output */
} clean;

/* ---- scan --------------------------------------------------------------------------------- */

static bool is_finite(const double *p)
{
	return isfinite(p[0]) && isfinite(p[1]) && isfinite(p[2]);
}

static wh_code scan_job(wh_ctx *c, void *arg, int64_t index, int worker)
{
	clean *k = arg;
	workspace *ws = &k->workspace[worker];
	const uint64_t first = (uint64_t)index * CHUNK;
	const size_t n = wh_chunk_items(k->source->nv, index, CHUNK);
	ws->lo = wh_v3(INFINITY, INFINITY, INFINITY);
	ws->hi = wh_v3(-INFINITY, -INFINITY, -INFINITY);
	ws->found = (wh_clean_result){0};
	if (wh_source_vertices(c, k->source, first, n, ws->xyz, ws->raw) != WH_OK)
		return c->err.code;
	for (size_t i = 0; i < n; i++) {
		const double *p = ws->xyz + 3 * i;
		if (!is_finite(p)) {
			ws->found.invalid_vertices++;
			continue;
		}
		k->kept.bits[(first + i) / WH_RANK_WORD] |= UINT64_C(1) << i % WH_RANK_WORD;
		ws->lo = wh_lower(ws->lo, wh_v3(p[0], p[1], p[2]));
		ws->hi = wh_upper(ws->hi, wh_v3(p[0], p[1], p[2]));
	}
	return WH_OK;
}

static wh_code scan_commit(wh_ctx *c, void *arg, int64_t index, int worker)
{
	(void)c;
	clean *k = arg;
	const workspace *ws = &k->workspace[worker];
	k->lo = wh_lower(k->lo, ws->lo);
	k->hi = wh_upper(k->hi, ws->hi);
	k->result->invalid_vertices += ws->found.invalid_vertices;
	wh_progress_add(k->progress, wh_chunk_items(k->source->nv, index, CHUNK));
	return WH_OK;
}

static wh_code scan(wh_ctx *c, const wh_exec *ex, clean *k)
{
	k->lo = wh_v3(INFINITY, INFINITY, INFINITY);
	k->hi = wh_v3(-INFINITY, -INFINITY, -INFINITY);
	wh_progress_phase(k->progress, "clean", k->source->nv);
	if (wh_rank_open(c, &k->kept, k->source->nv) != WH_OK)
		return c->err.code;
	k->result->bytes_read += k->source->nv * k->source->vstride;
	return wh_exec_ordered(c, ex, wh_chunks(k->source->nv, CHUNK), scan_job, scan_commit, k);
}

/* ---- weld --------------------------------------------------------------------------------- */

static wh_code weld(wh_ctx *c, const wh_exec *ex, clean *k)
{
	const double share = k->params->distance_share;
	const wh_vec3 half = wh_sub(wh_scale(k->hi, 0.5), wh_scale(k->lo, 0.5));
	wh_near_params p = {.distance = k->params->distance,
	                    .lo = k->lo,
	                    .hi = k->hi,
	                    .window = k->window,
	                    .bucket = k->params->bucket};
	if (share > 0)
		p.distance = fmax(p.distance, 2 * share * wh_norm(half));
	k->result->distance = p.distance;
	k->result->bytes_read += k->source->nv * k->source->vstride;
	return wh_near_find(c, ex, k->progress, k->spill, k->source, &p, &k->kept, &k->near);
}

/* ---- vertices ----------------------------------------------------------------------------- */

/* Those of a chunk that stay lie side by side in the output, and so do their attributes. */
static wh_code vertex_job(wh_ctx *c, void *arg, int64_t index, int worker)
{
	const clean *k = arg;
	workspace *ws = &k->workspace[worker];
	const uint64_t first = (uint64_t)index * CHUNK, at = wh_rank_of(&k->kept, first);
	const size_t n = wh_chunk_items(k->source->nv, index, CHUNK);
	const size_t record = k->out->attributes ? k->out->attributes->bytes : 0;
	size_t stay = 0;
	wh_progress_add(k->progress, n);
	if (wh_source_vertices(c, k->source, first, n, ws->xyz, ws->raw) != WH_OK ||
	    (record && wh_source_attributes(c, k->source, first, n, ws->records, ws->raw) != WH_OK))
		return c->err.code;
	for (size_t i = 0; i < n; i++) {
		if (!wh_rank_get(&k->kept, first + i))
			continue;
		wh_plain_put_position(k->out, ws->out + stay * k->out->vstride, ws->xyz + 3 * i);
		if (record && stay != i)
			memmove(ws->records + stay * record, ws->records + i * record, record);
		stay++;
	}
	if (wh_spill_pwrite(c, k->spill, k->out->vfd, ws->out, stay * k->out->vstride,
	                    at * k->out->vstride) != WH_OK)
		return c->err.code;
	return record ? wh_spill_pwrite(c, k->spill, k->out->vfd, ws->records, stay * record,
	                                k->out->abase + at * record)
	              : WH_OK;
}

static wh_code write_vertices(wh_ctx *c, const wh_exec *ex, clean *k, int fd)
{
	const wh_source *s = k->source;
	wh_plain_lay_out(k->out, s, wh_rank_of(&k->kept, s->nv), s->attributes, s->wedges, fd);
	k->end = k->out->fbase;
	wh_progress_phase(k->progress, "clean vertices", k->source->nv);
	k->result->bytes_read += k->source->nv * k->source->vstride;
	return wh_exec_for(c, ex, wh_chunks(k->source->nv, CHUNK), vertex_job, k);
}

/* ---- corners ------------------------------------------------------------------------------ */

static void take_pairs(void *arg, const wh_near_pair *pairs, size_t n)
{
	const clean *k = arg;
	for (size_t i = 0; i < n; i++)
		k->map[pairs[i].id - k->first] = wh_rank_of(&k->kept, pairs[i].as);
}

static wh_code load_window(wh_ctx *c, clean *k, uint64_t w)
{
	k->first = w * k->window;
	if (!k->params->weld)
		return WH_OK;
	for (uint64_t i = 0; i < k->window; i++)
		k->map[i] = NOT_WELDED;
	return wh_near_pairs(c, &k->near, w, take_pairs, k);
}

/* What is known of a corner in the window at hand. */
static uint64_t resolve(const clean *k, uint64_t id)
{
	if (wh_rank_get(&k->kept, id))
		return wh_rank_of(&k->kept, id);
	if (!k->params->weld)
		return GONE;
	if (id - k->first >= k->window) /* before it, too */
		return PENDING | id;
	return k->map[id - k->first];
}

static bool is_pending(uint64_t id)
{
	return id & PENDING && id < NO_FACE;
}

static size_t carried_bytes(const wh_source *s)
{
	return s->wedges ? s->wedges->bytes : 0;
}

/* Faces of a chunk for the first time. */
static wh_code read_faces(wh_ctx *c, const clean *k, workspace *ws, int64_t index, size_t n)
{
	const wh_code code =
	    wh_source_triangles(c, k->source, (uint64_t)index * CHUNK, n, ws->ids, ws->raw);
	if (code != WH_OK)
		return code;
	for (size_t i = 0; i < n; i++) {
		uint64_t *t = ws->ids + 3 * i;
		const bool none = wh_plain_is_degenerate(t);
		for (int corner = 0; corner < 3; corner++)
			t[corner] = none ? NO_FACE : resolve(k, t[corner]);
	}
	return WH_OK;
}

/* What is known of a chunk's corners lies at its place. */
static uint64_t corners_at(int64_t index)
{
	return (uint64_t)index * CHUNK * 3 * sizeof(uint64_t);
}

static wh_code read_corners(wh_ctx *c, const clean *k, workspace *ws, int64_t index, size_t n)
{
	if (wh_spill_pread(c, k->spill, k->corners_fd, ws->ids, n * 3 * sizeof *ws->ids,
	                   corners_at(index)) != WH_OK)
		return c->err.code;
	for (size_t i = 0; i < 3 * n; i++)
		if (is_pending(ws->ids[i]))
			ws->ids[i] = resolve(k, ws->ids[i] & ~PENDING);
	return WH_OK;
}

static wh_code write_corners(wh_ctx *c, const clean *k, const workspace *ws, int64_t index,
                             size_t n)
{
	k->waits[index] = wh_plain_no_span();
	for (size_t i = 0; i < 3 * n; i++)
		if (is_pending(ws->ids[i]))
			wh_plain_span_add(&k->waits[index], ws->ids[i] & ~PENDING);
	return wh_spill_pwrite(c, k->spill, k->corners_fd, ws->ids, n * 3 * sizeof *ws->ids,
	                       corners_at(index));
}

static wh_code corners_job(wh_ctx *c, void *arg, int64_t index, int worker)
{
	const clean *k = arg;
	workspace *ws = &k->workspace[worker];
	const size_t n = wh_chunk_items(k->source->nf, index, CHUNK);
	wh_progress_add(k->progress, n);
	if (k->first > 0 && wh_plain_span_misses(&k->waits[index], k->first, k->window))
		return WH_OK;
	const wh_code code =
	    k->first == 0 ? read_faces(c, k, ws, index, n) : read_corners(c, k, ws, index, n);
	return code == WH_OK ? write_corners(c, k, ws, index, n) : code;
}

/* ---- faces -------------------------------------------------------------------------------- */

/* The corners of a chunk in the last window; h->raw has what the faces carry, if they do. */
static wh_code last_look(wh_ctx *c, const clean *k, workspace *ws, int64_t index, size_t n)
{
	const wh_source *s = k->source;
	if (k->windows == 1)
		return read_faces(c, k, ws, index, n);
	if (read_corners(c, k, ws, index, n) != WH_OK)
		return c->err.code;
	return s->wedges ? wh_ply_pread(c, s->path, s->ffd, ws->raw, n * s->fstride,
	                                s->fbase + (uint64_t)index * CHUNK * s->fstride)
	                 : WH_OK;
}

static wh_code face_job(wh_ctx *c, void *arg, int64_t index, int worker)
{
	const clean *k = arg;
	workspace *ws = &k->workspace[worker];
	const size_t n = wh_chunk_items(k->source->nf, index, CHUNK), each = k->source->fstride;
	const unsigned char *carried =
	    (const unsigned char *)ws->raw + each - carried_bytes(k->source);
	const wh_code code = last_look(c, k, ws, index, n);
	ws->found = (wh_clean_result){0};
	ws->out_n = 0;
	for (size_t i = 0; code == WH_OK && i < n; i++) {
		const uint64_t *t = ws->ids + 3 * i;
		if (t[0] == NO_FACE)
			ws->found.degenerate_faces++;
		else if (t[0] == GONE || t[1] == GONE || t[2] == GONE)
			ws->found.invalid_faces++;
		else if (wh_plain_is_degenerate(t))
			ws->found.collapsed_faces++;
		else
			wh_plain_put_face(k->out, ws->out + ws->out_n++ * k->out->fstride, t,
			                  carried + i * each);
	}
	return code;
}

static wh_code face_commit(wh_ctx *c, void *arg, int64_t index, int worker)
{
	clean *k = arg;
	const workspace *ws = &k->workspace[worker];
	const size_t bytes = ws->out_n * k->out->fstride;
	k->result->invalid_faces += ws->found.invalid_faces;
	k->result->degenerate_faces += ws->found.degenerate_faces;
	k->result->collapsed_faces += ws->found.collapsed_faces;
	k->out->nf += ws->out_n;
	k->end += bytes;
	wh_progress_add(k->progress, wh_chunk_items(k->source->nf, index, CHUNK));
	return wh_spill_pwrite(c, k->spill, k->out->ffd, ws->out, bytes, k->end - bytes);
}

static wh_code open_windows(wh_ctx *c, clean *k)
{
	if (k->params->weld) {
		k->map = wh_alloc(c, (size_t)k->window, sizeof *k->map);
		if (!k->map)
			return wh_failed(c);
	}
	if (k->windows == 1)
		return WH_OK;
	k->waits = wh_alloc(c, (size_t)wh_chunks(k->source->nf, CHUNK), sizeof *k->waits);
	k->corners_fd = wh_spill_scratch(c, k->spill);
	return k->waits && k->corners_fd >= 0 ? WH_OK : wh_failed(c);
}

static wh_code write_faces(wh_ctx *c, const wh_exec *ex, clean *k)
{
	const int64_t chunks = wh_chunks(k->source->nf, CHUNK);
	if (open_windows(c, k) != WH_OK)
		return c->err.code;
	wh_progress_phase(k->progress, "clean faces", k->windows * k->source->nf);
	k->result->bytes_read += k->source->nf * k->source->fstride;
	for (uint64_t w = 0; w < k->windows; w++) {
		if (load_window(c, k, w) != WH_OK)
			return c->err.code;
		const wh_code code = w + 1 < k->windows
		                         ? wh_exec_for(c, ex, chunks, corners_job, k)
		                         : wh_exec_ordered(c, ex, chunks, face_job, face_commit, k);
		if (code != WH_OK)
			return code;
	}
	return WH_OK;
}

/* ---- memory ------------------------------------------------------------------------------- */

static size_t workspace_bytes(const wh_source *s)
{
	const size_t v = wh_source_vertex_bytes(s, CHUNK), f = wh_source_triangle_bytes(s, CHUNK);
	const size_t record = s->attributes ? s->attributes->bytes : 0;
	return (v > f ? v : f) + CHUNK * (24 + record + 24 + 24 + carried_bytes(s));
}

static size_t window_bytes(const wh_source *s, const wh_clean_params *p, uint64_t window)
{
	return (p->weld ? (size_t)window * sizeof(uint64_t) : 0) +
	       (window < s->nv ? (size_t)wh_chunks(s->nf, CHUNK) * sizeof(wh_plain_span) : 0);
}

static uint64_t least_window(const wh_source *s)
{
	const uint64_t share = s->nv / MOST_WINDOWS + 1;
	const uint64_t least = share > WINDOW_LEAST ? share : WINDOW_LEAST;
	return least < s->nv ? least : s->nv + 1;
}

/* Near vertices are looked for before the map is made. */
static size_t bytes_of(const wh_source *s, const wh_clean_params *p, int workers, uint64_t window)
{
	const size_t near = p->weld ? wh_near_bytes(s, workers, s->nv / window + 1) : 0;
	const size_t map = window_bytes(s, p, window);
	return wh_rank_bytes(s->nv) + (size_t)workers * workspace_bytes(s) +
	       (near > map ? near : map) + 4096;
}

size_t wh_clean_bytes(const wh_source *source, const wh_clean_params *params, int workers)
{
	return bytes_of(source, params, workers, least_window(source));
}

uint64_t wh_clean_disk(const wh_source *s, const wh_clean_params *params)
{
	const uint64_t vertex =
	    (s->is_double ? 24 : 12) + (s->attributes ? s->attributes->bytes : 0);
	const uint64_t face = (s->nv > UINT32_MAX ? 24 : 12) + carried_bytes(s);
	const uint64_t result = s->nv * vertex + s->nf * face;
	const uint64_t corners = s->nf * 24;
	const uint64_t near = params->weld ? wh_near_disk(s) : 0;
	return result + (near > corners || !params->weld ? near : corners);
}

/* As many workers as fit, then as large a window: they decide nothing else. */
static wh_code fit(wh_ctx *c, clean *k, size_t budget, wh_exec *ex)
{
	const wh_source *s = k->source;
	while (ex->workers > 1 && wh_clean_bytes(s, k->params, ex->workers) > budget)
		ex->workers--;
	const size_t least = wh_clean_bytes(s, k->params, ex->workers);
	if (least > budget)
		return wh_fail(c, WH_E_PLAN,
		               "cleaning the vertices of '%s' takes %zu MiB of memory, and there "
		               "are %zu: raise --memory",
		               s->path, (least >> 20) + 1, budget >> 20);
	k->window = k->params->window ? k->params->window : s->nv + 1;
	while (k->window > least_window(s) &&
	       bytes_of(s, k->params, ex->workers, k->window) > budget)
		k->window = k->window / 2 > least_window(s) ? k->window / 2 : least_window(s);
	k->windows = k->params->weld ? s->nv / k->window + 1 : 1;
	return WH_OK;
}

static wh_code open_workspaces(wh_ctx *c, clean *k, int workers)
{
	const wh_source *s = k->source;
	const size_t v = wh_source_vertex_bytes(s, CHUNK), f = wh_source_triangle_bytes(s, CHUNK);
	k->workspace = wh_calloc(c, (size_t)workers, sizeof *k->workspace);
	for (int i = 0; k->workspace && i < workers; i++) {
		workspace *ws = &k->workspace[i];
		ws->raw = wh_alloc(c, v > f ? v : f, 1);
		ws->xyz = wh_alloc(c, CHUNK, 3 * sizeof *ws->xyz);
		if (s->attributes)
			ws->records = wh_alloc(c, CHUNK, s->attributes->bytes);
		ws->ids = wh_alloc(c, CHUNK, 3 * sizeof *ws->ids);
		ws->out = wh_alloc(c, CHUNK, 3 * sizeof(double) + carried_bytes(s));
	}
	return c->err.code;
}

static void close_all(wh_ctx *c, clean *k, int workers)
{
	for (int i = 0; k->workspace && i < workers; i++) {
		workspace *ws = &k->workspace[i];
		wh_free(c, ws->raw);
		wh_free(c, ws->xyz);
		wh_free(c, ws->records);
		wh_free(c, ws->ids);
		wh_free(c, ws->out);
	}
	wh_free(c, k->workspace);
	wh_free(c, k->map);
	wh_free(c, k->waits);
	wh_rank_close(c, &k->kept);
	wh_near_close(c, &k->near);
	if (k->corners_fd >= 0)
		wh_spill_close_scratch(k->spill, k->corners_fd);
}

/* ---- all of it ---------------------------------------------------------------------------- */

static wh_code rebuild(wh_ctx *c, const wh_exec *ex, clean *k, int *fd)
{
	*fd = wh_spill_scratch(c, k->spill);
	if (*fd < 0)
		return wh_failed(c);
	wh_code code = write_vertices(c, ex, k, *fd);
	k->result->welded_vertices = k->source->nv - k->result->invalid_vertices - k->out->nv;
	if (code == WH_OK)
		code = write_faces(c, ex, k);
	if (code == WH_OK)
		return WH_OK;
	wh_spill_close_scratch(k->spill, *fd);
	*fd = -1;
	return code;
}

wh_code wh_clean(wh_ctx *c, const wh_exec *ex, wh_progress *progress, wh_spill *spill,
                 const wh_source *source, const wh_clean_params *params, size_t budget,
                 wh_source *out, int *fd, wh_clean_result *result)
{
	clean k = {.source = source,
	           .params = params,
	           .progress = progress,
	           .spill = spill,
	           .result = result,
	           .near = {.file = {.fd = -1}},
	           .corners_fd = -1,
	           .out = out};
	wh_exec own = *ex;
	*result = (wh_clean_result){0};
	*out = *source;
	*fd = -1;
	if (fit(c, &k, budget, &own) != WH_OK)
		return c->err.code;
	wh_code code = open_workspaces(c, &k, own.workers);
	if (code == WH_OK)
		code = scan(c, &own, &k);
	if (code == WH_OK && params->weld && result->invalid_vertices < source->nv)
		code = weld(c, &own, &k);
	if (code == WH_OK && wh_rank_count(&k.kept) < source->nv)
		code = rebuild(c, &own, &k, fd);
	close_all(c, &k, own.workers);
	return code;
}
