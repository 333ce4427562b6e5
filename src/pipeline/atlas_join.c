/*
 * In steps: the copies are found (pipeline/twins.h); vertices that stay are written, without what
 * belongs to corners; then faces, window by window of vertices: a corner gets the new number of its
 * vertex and what that vertex had for it. With more than one window, what is known of the corners
 * lies on disk between passes, and chunks of faces that have nothing to do with a window are passed
 * over.
 */
#include "pipeline/atlas.h"

#include "base/chunks.h"
#include "io/attributes.h"
#include "pipeline/plain.h"
#include "pipeline/twins.h"

#include <string.h>

enum {
	CHUNK = 32 * 1024,          /* vertices or faces a job */
	WINDOW_LEAST = 1024 * 1024, /* ids, so that there are not very many passes */
	MOST_WINDOWS = 1024
};

/* A corner whose window has not come yet, and the old id. */
#define PENDING (UINT64_C(1) << 63)

/* What one worker needs. */
typedef struct workspace {
	void *raw;
	double *xyz;
	uint8_t *records; /* of the vertices at hand, as the source has them, ... */
	uint8_t *rest;    /* ... and what they keep of it */
	uint64_t *ids;
	uint8_t *carried;   /* by the faces at hand */
	unsigned char *out; /* vertices or faces as they are written */
	size_t out_n, degenerate;
} workspace;

typedef struct join {
	const wh_source *source;
	const wh_atlas_params *params;
	wh_progress *progress;
	wh_spill *spill;
	workspace *workspace;
	wh_rank kept;
	wh_near twins;
	uint64_t window, windows, first; /* first: id of the window at hand */
	uint64_t *map;                   /* old ids of the window to new ones */
	uint8_t *corner;                 /* what the corners of the window's vertices have */
	int corners_fd;                  /* of what is known between windows; -1 */
	wh_plain_span *waits;            /* one for each chunk of faces */
	wh_source *out;
	uint64_t end; /* bytes of the output */
	wh_atlas_result *result;
} join;

static size_t corner_bytes(const join *j)
{
	return j->params->wedges->corner.bytes;
}

/* Moves the values of the attributes `some` of those that the source has to a record of theirs. */
static void pick(const wh_attributes *all, const uint8_t *record, const wh_attributes *some,
                 uint8_t *to)
{
	for (uint32_t i = 0; i < some->n; i++) {
		const wh_attribute *a = &some->item[i];
		const wh_attribute *from = wh_attributes_find(all, a->prop);
		memcpy(to + a->at, record + from->at, wh_attribute_bytes(a));
	}
}

/* ---- vertices ----------------------------------------------------------------------------- */

static wh_code vertex_job(wh_ctx *c, void *arg, int64_t index, int worker)
{
	const join *j = arg;
	const wh_source *s = j->source, *o = j->out;
	workspace *ws = &j->workspace[worker];
	const uint64_t first = (uint64_t)index * CHUNK, at = wh_rank_of(&j->kept, first);
	const size_t n = wh_chunk_items(s->nv, index, CHUNK), size = j->params->rest->bytes;
	size_t stay = 0;
	wh_progress_add(j->progress, n);
	if (wh_source_vertices(c, s, first, n, ws->xyz, ws->raw) != WH_OK ||
	    (size && wh_source_attributes(c, s, first, n, ws->records, ws->raw) != WH_OK))
		return c->err.code;
	for (size_t i = 0; i < n; i++) {
		if (!wh_rank_get(&j->kept, first + i))
			continue;
		wh_plain_put_position(o, ws->out + stay * o->vstride, ws->xyz + 3 * i);
		pick(s->attributes, ws->records + i * s->attributes->bytes, j->params->rest,
		     ws->rest + stay++ * size);
	}
	if (wh_spill_pwrite(c, j->spill, o->vfd, ws->out, stay * o->vstride, at * o->vstride) !=
	    WH_OK)
		return c->err.code;
	return size ? wh_spill_pwrite(c, j->spill, o->vfd, ws->rest, stay * size,
	                              o->abase + at * size)
	            : WH_OK;
}

static wh_code write_vertices(wh_ctx *c, const wh_exec *ex, join *j, int fd)
{
	const wh_attributes *rest = j->params->rest;
	wh_plain_lay_out(j->out, j->source, wh_rank_count(&j->kept), rest->n ? rest : NULL,
	                 j->params->wedges, fd);
	j->end = j->out->fbase;
	j->result->joined = j->source->nv - j->out->nv;
	wh_progress_phase(j->progress, "join vertices", j->source->nv);
	return wh_exec_for(c, ex, wh_chunks(j->source->nv, CHUNK), vertex_job, j);
}

/* ---- windows ------------------------------------------------------------------------------ */

static uint64_t window_end(const join *j)
{
	const uint64_t end = j->first + j->window;
	return end < j->source->nv ? end : j->source->nv;
}

static wh_code window_job(wh_ctx *c, void *arg, int64_t index, int worker)
{
	const join *j = arg;
	const wh_source *s = j->source;
	workspace *ws = &j->workspace[worker];
	const uint64_t at = (uint64_t)index * CHUNK;
	const size_t n = wh_chunk_items(window_end(j) - j->first, index, CHUNK);
	if (wh_source_attributes(c, s, j->first + at, n, ws->records, ws->raw) != WH_OK)
		return c->err.code;
	for (size_t i = 0; i < n; i++) {
		pick(s->attributes, ws->records + i * s->attributes->bytes,
		     &j->params->wedges->corner, j->corner + (at + i) * corner_bytes(j));
		j->map[at + i] = wh_rank_of(&j->kept, j->first + at + i);
	}
	return WH_OK;
}

static void take_twins(void *arg, const wh_near_pair *pair, size_t n)
{
	const join *j = arg;
	for (size_t i = 0; i < n; i++)
		j->map[pair[i].id - j->first] = wh_rank_of(&j->kept, pair[i].as);
}

static wh_code load_window(wh_ctx *c, const wh_exec *ex, join *j, uint64_t w)
{
	j->first = w * j->window;
	if (wh_exec_for(c, ex, wh_chunks(window_end(j) - j->first, CHUNK), window_job, j) != WH_OK)
		return c->err.code;
	return wh_near_pairs(c, &j->twins, w, take_twins, j);
}

/* ---- corners ------------------------------------------------------------------------------ */

static uint8_t *carried_by(const join *j, const workspace *ws, size_t face)
{
	return ws->carried + face * j->params->wedges->bytes;
}

/* What the source has at a face itself lies behind its corners. */
static void begin_carried(const join *j, const workspace *ws, size_t face, size_t from)
{
	const wh_wedges *w = j->params->wedges;
	const uint32_t size = w->face.bytes;
	if (size)
		memcpy(carried_by(j, ws, face) + 3 * corner_bytes(j),
		       (unsigned char *)ws->raw + (from + 1) * j->source->fstride - size, size);
}

/* Corners of n faces in the window at hand. */
static void resolve(const join *j, workspace *ws, size_t n)
{
	const size_t size = corner_bytes(j);
	for (size_t i = 0; i < 3 * n; i++) {
		const uint64_t at = (ws->ids[i] & ~PENDING) - j->first;
		if (!(ws->ids[i] & PENDING) || at >= j->window)
			continue;
		ws->ids[i] = j->map[at];
		memcpy(carried_by(j, ws, i / 3) + i % 3 * size, j->corner + at * size, size);
	}
}

/* Faces of a chunk for the first time: those that are triangles. */
static wh_code read_faces(wh_ctx *c, const join *j, workspace *ws, int64_t index, size_t *n)
{
	const size_t all = wh_chunk_items(j->source->nf, index, CHUNK);
	const wh_code code =
	    wh_source_triangles(c, j->source, (uint64_t)index * CHUNK, all, ws->ids, ws->raw);
	*n = 0;
	if (code != WH_OK)
		return code;
	for (size_t i = 0; i < all; i++) {
		const uint64_t *t = ws->ids + 3 * i;
		if (wh_plain_is_degenerate(t))
			continue;
		for (size_t k = 0; k < 3; k++)
			ws->ids[3 * *n + k] = t[k] | PENDING;
		begin_carried(j, ws, (*n)++, i);
	}
	ws->degenerate = all - *n;
	return WH_OK;
}

/* What is known of a chunk's corners lies at its place: how many faces there are and were not, the
 * corners, what is carried. */
static uint64_t corners_at(const join *j, int64_t index)
{
	return (uint64_t)index *
	       (2 * sizeof(uint64_t) + CHUNK * (3 * sizeof(uint64_t) + j->params->wedges->bytes));
}

static wh_code read_corners(wh_ctx *c, const join *j, workspace *ws, int64_t index, size_t *n)
{
	uint64_t head[2], at = corners_at(j, index);
	if (wh_spill_pread(c, j->spill, j->corners_fd, head, sizeof head, at) != WH_OK)
		return c->err.code;
	*n = (size_t)head[0];
	ws->degenerate = (size_t)head[1];
	const size_t bytes = *n * 3 * sizeof *ws->ids;
	at += sizeof head;
	if (wh_spill_pread(c, j->spill, j->corners_fd, ws->ids, bytes, at) != WH_OK)
		return c->err.code;
	return wh_spill_pread(c, j->spill, j->corners_fd, ws->carried,
	                      *n * j->params->wedges->bytes, at + bytes);
}

static wh_code write_corners(wh_ctx *c, const join *j, const workspace *ws, int64_t index, size_t n)
{
	const uint64_t head[2] = {n, ws->degenerate};
	const size_t bytes = n * 3 * sizeof *ws->ids;
	uint64_t at = corners_at(j, index);
	j->waits[index] = wh_plain_no_span();
	for (size_t i = 0; i < 3 * n; i++)
		if (ws->ids[i] & PENDING)
			wh_plain_span_add(&j->waits[index], ws->ids[i] & ~PENDING);
	if (wh_spill_pwrite(c, j->spill, j->corners_fd, head, sizeof head, at) != WH_OK)
		return c->err.code;
	at += sizeof head;
	if (wh_spill_pwrite(c, j->spill, j->corners_fd, ws->ids, bytes, at) != WH_OK)
		return c->err.code;
	return wh_spill_pwrite(c, j->spill, j->corners_fd, ws->carried,
	                       n * j->params->wedges->bytes, at + bytes);
}

/* The faces of a chunk, with all that is known in the window at hand. */
static wh_code get_faces(wh_ctx *c, const join *j, workspace *ws, int64_t index, size_t *n)
{
	const wh_code code =
	    j->first == 0 ? read_faces(c, j, ws, index, n) : read_corners(c, j, ws, index, n);
	if (code == WH_OK)
		resolve(j, ws, *n);
	return code;
}

static wh_code corners_job(wh_ctx *c, void *arg, int64_t index, int worker)
{
	const join *j = arg;
	workspace *ws = &j->workspace[worker];
	size_t n = 0;
	wh_progress_add(j->progress, wh_chunk_items(j->source->nf, index, CHUNK));
	if (j->first > 0 && wh_plain_span_misses(&j->waits[index], j->first, j->window))
		return WH_OK;
	const wh_code code = get_faces(c, j, ws, index, &n);
	return code == WH_OK ? write_corners(c, j, ws, index, n) : code;
}

/* ---- faces -------------------------------------------------------------------------------- */

static wh_code face_job(wh_ctx *c, void *arg, int64_t index, int worker)
{
	const join *j = arg;
	workspace *ws = &j->workspace[worker];
	size_t n = 0;
	const wh_code code = get_faces(c, j, ws, index, &n);
	ws->out_n = 0;
	for (size_t i = 0; code == WH_OK && i < n; i++) {
		if (wh_plain_is_degenerate(ws->ids + 3 * i))
			ws->degenerate++;
		else
			wh_plain_put_face(j->out, ws->out + ws->out_n++ * j->out->fstride,
			                  ws->ids + 3 * i, carried_by(j, ws, i));
	}
	return code;
}

static wh_code face_commit(wh_ctx *c, void *arg, int64_t index, int worker)
{
	join *j = arg;
	const workspace *ws = &j->workspace[worker];
	const size_t bytes = ws->out_n * j->out->fstride;
	j->result->degenerate_faces += ws->degenerate;
	j->out->nf += ws->out_n;
	j->end += bytes;
	wh_progress_add(j->progress, wh_chunk_items(j->source->nf, index, CHUNK));
	return wh_spill_pwrite(c, j->spill, j->out->ffd, ws->out, bytes, j->end - bytes);
}

static wh_code open_windows(wh_ctx *c, join *j)
{
	const uint64_t most = j->window < j->source->nv ? j->window : j->source->nv;
	j->map = wh_alloc(c, (size_t)most, sizeof *j->map);
	j->corner = wh_alloc(c, (size_t)most, corner_bytes(j));
	if (!j->map || !j->corner)
		return wh_failed(c);
	if (j->windows == 1)
		return WH_OK;
	j->waits = wh_alloc(c, (size_t)wh_chunks(j->source->nf, CHUNK), sizeof *j->waits);
	j->corners_fd = wh_spill_scratch(c, j->spill);
	return j->waits && j->corners_fd >= 0 ? WH_OK : wh_failed(c);
}

static wh_code write_faces(wh_ctx *c, const wh_exec *ex, join *j)
{
	const int64_t chunks = wh_chunks(j->source->nf, CHUNK);
	if (open_windows(c, j) != WH_OK)
		return c->err.code;
	wh_progress_phase(j->progress, "join faces", j->windows * j->source->nf);
	for (uint64_t w = 0; w < j->windows; w++) {
		if (load_window(c, ex, j, w) != WH_OK)
			return c->err.code;
		const wh_code code = w + 1 < j->windows
		                         ? wh_exec_for(c, ex, chunks, corners_job, j)
		                         : wh_exec_ordered(c, ex, chunks, face_job, face_commit, j);
		if (code != WH_OK)
			return code;
	}
	return WH_OK;
}

/* ---- memory ------------------------------------------------------------------------------- */

static size_t raw_bytes(const wh_source *s)
{
	const size_t v = wh_source_vertex_bytes(s, CHUNK), f = wh_source_triangle_bytes(s, CHUNK);
	return v > f ? v : f;
}

static size_t out_bytes(const wh_wedges *w)
{
	return CHUNK * (3 * sizeof(double) + (size_t)w->bytes);
}

static size_t workspace_bytes(const wh_source *s, const wh_wedges *w)
{
	return raw_bytes(s) + out_bytes(w) +
	       CHUNK * (3 * sizeof(double) + 2 * (size_t)s->attributes->bytes +
	                3 * sizeof(uint64_t) + (size_t)w->bytes);
}

static uint64_t least_window(const wh_source *s)
{
	const uint64_t share = s->nv / MOST_WINDOWS + 1;
	const uint64_t least = share > WINDOW_LEAST ? share : WINDOW_LEAST;
	return least < s->nv ? least : s->nv;
}

/* Copies are found before anything else is held. */
static size_t bytes_of(const wh_source *s, const wh_wedges *w, int workers, uint64_t window)
{
	const size_t spans = (size_t)wh_chunks(s->nf, CHUNK) * sizeof(wh_plain_span);
	const size_t twins = wh_twins_bytes(s, workers, window);
	const size_t own = (size_t)window * (sizeof(uint64_t) + w->corner.bytes) + spans +
	                   (size_t)workers * workspace_bytes(s, w);
	return wh_rank_bytes(s->nv) + (twins > own ? twins : own) + 4096;
}

size_t wh_atlas_bytes(const wh_source *source, const wh_wedges *wedges, int workers)
{
	return bytes_of(source, wedges, workers, least_window(source));
}

uint64_t wh_atlas_disk(const wh_source *s, const wh_wedges *w)
{
	const uint64_t vertex =
	    (s->is_double ? 24 : 12) + (s->attributes ? s->attributes->bytes : 0);
	const uint64_t index = s->nv > UINT32_MAX ? 8 : 4;
	const uint64_t result = s->nv * vertex + s->nf * (3 * index + w->bytes);
	const uint64_t corners = s->nf * (24 + (uint64_t)w->bytes), near = wh_near_disk(s);
	return result + (near > corners ? near : corners);
}

/* As many workers as fit, then as large a window: they decide nothing else. */
static wh_code fit(wh_ctx *c, join *j, wh_exec *ex)
{
	const wh_source *s = j->source;
	const wh_wedges *w = j->params->wedges;
	const size_t budget = j->params->budget;
	while (ex->workers > 1 && wh_atlas_bytes(s, w, ex->workers) > budget)
		ex->workers--;
	const size_t least = wh_atlas_bytes(s, w, ex->workers);
	if (least > budget)
		return wh_fail(c, WH_E_PLAN,
		               "joining the charts of '%s' takes %zu MiB of memory, and there are "
		               "%zu: raise --memory",
		               s->path, (least >> 20) + 1, budget >> 20);
	j->window = j->params->window ? j->params->window : s->nv;
	while (j->window > least_window(s) && bytes_of(s, w, ex->workers, j->window) > budget)
		j->window = j->window / 2 > least_window(s) ? j->window / 2 : least_window(s);
	j->windows = (s->nv + j->window - 1) / j->window;
	return WH_OK;
}

/* ---- all of it ---------------------------------------------------------------------------- */

static wh_code open_workspaces(wh_ctx *c, join *j, int workers)
{
	const wh_source *s = j->source;
	const wh_wedges *w = j->params->wedges;
	j->workspace = wh_calloc(c, (size_t)workers, sizeof *j->workspace);
	for (int i = 0; j->workspace && i < workers; i++) {
		workspace *ws = &j->workspace[i];
		ws->raw = wh_alloc(c, raw_bytes(s), 1);
		ws->xyz = wh_alloc(c, CHUNK, 3 * sizeof *ws->xyz);
		ws->records = wh_alloc(c, CHUNK, s->attributes->bytes);
		ws->rest = wh_alloc(c, CHUNK, (size_t)j->params->rest->bytes + 1);
		ws->ids = wh_alloc(c, CHUNK, 3 * sizeof *ws->ids);
		ws->carried = wh_alloc(c, CHUNK, w->bytes);
		ws->out = wh_alloc(c, out_bytes(w), 1);
	}
	return c->err.code;
}

static void close_all(wh_ctx *c, join *j, int workers)
{
	for (int i = 0; j->workspace && i < workers; i++) {
		workspace *ws = &j->workspace[i];
		wh_free(c, ws->raw);
		wh_free(c, ws->xyz);
		wh_free(c, ws->records);
		wh_free(c, ws->rest);
		wh_free(c, ws->ids);
		wh_free(c, ws->carried);
		wh_free(c, ws->out);
	}
	wh_free(c, j->workspace);
	wh_free(c, j->map);
	wh_free(c, j->corner);
	wh_free(c, j->waits);
	wh_rank_close(c, &j->kept);
	wh_near_close(c, &j->twins);
	if (j->corners_fd >= 0)
		wh_spill_close_scratch(j->spill, j->corners_fd);
}

static wh_code rebuild(wh_ctx *c, const wh_exec *ex, join *j, int *fd)
{
	if (open_workspaces(c, j, ex->workers) != WH_OK)
		return c->err.code;
	*fd = wh_spill_scratch(c, j->spill);
	if (*fd < 0)
		return wh_failed(c);
	wh_code code = write_vertices(c, ex, j, *fd);
	if (code == WH_OK)
		code = write_faces(c, ex, j);
	if (code == WH_OK)
		return WH_OK;
	wh_spill_close_scratch(j->spill, *fd);
	*fd = -1;
	return code;
}

wh_code wh_atlas_join(wh_ctx *c, const wh_exec *ex, wh_progress *progress, wh_spill *spill,
                      const wh_source *source, const wh_atlas_params *params, wh_source *out,
                      int *fd, wh_atlas_result *result)
{
	join j = {.source = source,
	          .params = params,
	          .progress = progress,
	          .spill = spill,
	          .twins = {.file = {.fd = -1}},
	          .corners_fd = -1,
	          .out = out,
	          .result = result};
	wh_exec own = *ex;
	*result = (wh_atlas_result){.bytes_read = 3 * source->nv * source->vstride +
	                                          2 * source->nf * source->fstride};
	*fd = -1;
	if (fit(c, &j, &own) != WH_OK || wh_rank_open(c, &j.kept, source->nv) != WH_OK)
		return c->err.code;
	wh_code code = wh_twins_find(c, &own, progress, spill, source, j.window, &j.kept, &j.twins);
	if (code == WH_OK)
		code = rebuild(c, &own, &j, fd);
	close_all(c, &j, own.workers);
	return code;
}
