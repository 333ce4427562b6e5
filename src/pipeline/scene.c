#include "pipeline/scene.h"

#include "base/chunks.h"
#include "io/attributes.h"

#include <string.h>

enum {
	CHUNK = 8 * 1024, /* vertices or faces a job: their corners stay in a core's cache */
	AHEAD = 12        /* faces whose samples are on their way from memory while one is drawn */
};

/* What one worker needs. */
typedef struct workspace {
	void *raw;
	double *xyz;
	uint8_t *records;   /* of colours */
	uint64_t *ids;      /* corners of the faces at hand, ... */
	wh_spot *spot;      /* ... and what is known of them */
	wh_normal_sum *sum; /* with windows only */
} workspace;

/* The vertices that a chunk of faces uses are among lo .. hi. */
typedef struct range {
	uint64_t lo, hi;
} range;

struct wh_scene {
	wh_scene_params p;
	const wh_exec *ex;
	wh_spill *spill;
	wh_progress *progress;
	bool windowed;
	uint64_t first, end; /* vertices in memory */
	wh_spot *spot;       /* their places, ... */
	wh_normal_sum *sum;  /* ... and sums; either may be gone when it is not needed any more */
	int spot_fd, sum_fd; /* of all corners; -1: no windows */
	range *range;        /* of each chunk of faces; NULL: no windows */
	workspace *workspace;
	const wh_canvas *canvas; /* the one at hand */
};

static uint64_t window_of(const wh_scene_params *p)
{
	const uint64_t nv = p->source->nf ? p->source->nv : 0;
	return p->window && p->window < nv ? p->window : nv;
}

static bool has_windows(const wh_scene_params *p)
{
	return p->source->nf && window_of(p) < p->source->nv;
}

static size_t raw_bytes(const wh_source *s)
{
	const size_t v = wh_source_vertex_bytes(s, CHUNK);
	const size_t f = s->nf ? wh_source_triangle_bytes(s, CHUNK) : 0;
	return v > f ? v : f;
}

/* ---- vertices ------------------------------------------------------------------------------- */

/* The colour in a record, as the renderer has it. */
static uint32_t colour_of(const wh_attributes *a, const uint8_t *record)
{
	uint32_t rgb = 0;
	for (int k = 0; k < 3; k++)
		rgb = rgb << 8 |
		      (uint32_t)(255 * wh_attribute_share(&a->item[a->rgb[k]], record) + 0.5);
	return rgb;
}

static wh_code take_colours(wh_ctx *c, const wh_scene *s, workspace *ws, uint64_t first, size_t n,
                            wh_spot *spot)
{
	const wh_attributes *a = s->p.source->attributes;
	if (!s->p.look.colours)
		return WH_OK;
	if (wh_source_attributes(c, s->p.source, first, n, ws->records, ws->raw) != WH_OK)
		return c->err.code;
	for (size_t i = 0; i < n; i++)
		spot[i].colour = colour_of(a, ws->records + i * a->bytes);
	return WH_OK;
}

/* Reads n vertices and finds their places. */
static wh_code project(wh_ctx *c, const wh_scene *s, workspace *ws, uint64_t first, size_t n,
                       wh_spot *spot)
{
	if (wh_source_vertices(c, s->p.source, first, n, ws->xyz, ws->raw) != WH_OK)
		return c->err.code;
	for (size_t i = 0; i < n; i++) {
		const double *v = ws->xyz + 3 * i;
		const wh_pixel_point q =
		    wh_camera_project(s->p.look.camera, wh_v3(v[0], v[1], v[2]));
		spot[i] = (wh_spot){(float)q.x, (float)q.y, (float)q.depth, 0};
	}
	return take_colours(c, s, ws, first, n, spot);
}

static wh_code project_job(wh_ctx *c, void *arg, int64_t index, int worker)
{
	const wh_scene *s = arg;
	const uint64_t first = (uint64_t)index * CHUNK;
	const size_t n = wh_chunk_items(s->end - s->first, index, CHUNK);
	wh_progress_add(s->progress, n);
	return project(c, s, &s->workspace[worker], s->first + first, n, s->spot + first);
}

static wh_code cloud_job(wh_ctx *c, void *arg, int64_t index, int worker)
{
	const wh_scene *s = arg;
	workspace *ws = &s->workspace[worker];
	const size_t n = wh_chunk_items(s->p.source->nv, index, CHUNK);
	if (project(c, s, ws, (uint64_t)index * CHUNK, n, ws->spot) != WH_OK)
		return c->err.code;
	for (size_t i = 0; i < n; i++)
		wh_canvas_point(s->canvas, &s->p.look, ws->spot + i);
	wh_progress_add(s->progress, n);
	return WH_OK;
}

/* ---- faces ---------------------------------------------------------------------------------- */

static wh_code read_faces(wh_ctx *c, const wh_scene *s, workspace *ws, int64_t index, size_t n)
{
	return wh_source_triangles(c, s->p.source, (uint64_t)index * CHUNK, n, ws->ids, ws->raw);
}

/* A loop of nothing but loads: many of them wait for memory at the same time. */
static void gather_spots(const wh_scene *s, workspace *ws, size_t corners)
{
	for (size_t i = 0; i < corners; i++)
		ws->spot[i] = s->spot[ws->ids[i]];
}

/* The places of the corners of a chunk, and their ids. */
static wh_code get_corners(wh_ctx *c, const wh_scene *s, workspace *ws, int64_t index, size_t n)
{
	const size_t bytes = 3 * n * sizeof *ws->spot;
	const uint64_t off = (uint64_t)index * CHUNK * 3 * sizeof *ws->spot;
	const wh_code code = read_faces(c, s, ws, index, n);
	if (code != WH_OK)
		return code;
	if (s->windowed)
		return wh_spill_pread(c, s->spill, s->spot_fd, ws->spot, bytes, off);
	gather_spots(s, ws, 3 * n);
	return WH_OK;
}

static void corners_at(const workspace *ws, size_t face, const wh_spot *corner[3])
{
	for (size_t k = 0; k < 3; k++)
		corner[k] = ws->spot + 3 * face + k;
}

/* Adds the normals of a chunk's faces to those corners that are in memory. */
static wh_code normals_job(wh_ctx *c, void *arg, int64_t index, int worker)
{
	const wh_scene *s = arg;
	workspace *ws = &s->workspace[worker];
	const size_t n = wh_chunk_items(s->p.source->nf, index, CHUNK);
	wh_progress_add(s->progress, n);
	if (s->windowed && (s->range[index].lo >= s->end || s->range[index].hi < s->first))
		return WH_OK;
	const wh_code code = get_corners(c, s, ws, index, n);
	if (code != WH_OK)
		return code;
	for (size_t i = 0; i < n; i++) {
		const wh_spot *corner[3];
		wh_normal_sum add[3];
		corners_at(ws, i, corner);
		wh_render_normals(s->p.look.camera, corner, add);
		for (size_t k = 0; k < 3; k++) {
			const uint64_t id = ws->ids[3 * i + k] - s->first;
			if (id < s->end - s->first)
				(void)__atomic_fetch_add(&s->sum[id], add[k], __ATOMIC_RELAXED);
		}
	}
	return WH_OK;
}

static wh_code get_sums(wh_ctx *c, const wh_scene *s, const workspace *ws, int64_t index, size_t n)
{
	if (!s->windowed || !s->p.look.smooth)
		return WH_OK;
	return wh_spill_pread(c, s->spill, s->sum_fd, ws->sum, 3 * n * sizeof *ws->sum,
	                      (uint64_t)index * CHUNK * 3 * sizeof *ws->sum);
}

/* What face i of the chunk carries lies at the end of its bytes. */
static bool find_skin(const wh_scene *s, const workspace *ws, size_t i, wh_skin *skin)
{
	const wh_source *src = s->p.source;
	const size_t end = (i + 1) * src->fstride;
	return wh_skins_find(s->p.skins, src->wedges,
	                     (unsigned char *)ws->raw + end - src->wedges->bytes, skin);
}

static wh_code draw_job(wh_ctx *c, void *arg, int64_t index, int worker)
{
	const wh_scene *s = arg;
	workspace *ws = &s->workspace[worker];
	const size_t n = wh_chunk_items(s->p.source->nf, index, CHUNK);
	wh_code code = get_corners(c, s, ws, index, n);
	if (code == WH_OK)
		code = get_sums(c, s, ws, index, n);
	if (code != WH_OK)
		return code;
	for (size_t i = 0; i < n; i++) {
		wh_skin skin;
		const wh_spot *corner[3];
		const wh_normal_sum *sum[3] = {NULL, NULL, NULL};
		if (i + AHEAD < n)
			wh_canvas_expect(s->canvas, ws->spot + 3 * (i + AHEAD));
		corners_at(ws, i, corner);
		for (size_t k = 0; k < 3 && s->p.look.smooth; k++)
			sum[k] = s->windowed ? ws->sum + 3 * i + k : s->sum + ws->ids[3 * i + k];
		const bool skinned = s->p.skins && find_skin(s, ws, i, &skin);
		wh_canvas_face(s->canvas, &s->p.look, corner, sum, skinned ? &skin : NULL);
	}
	wh_progress_add(s->progress, n);
	return WH_OK;
}

/* ---- windows -------------------------------------------------------------------------------- */

static range range_of(const uint64_t *ids, size_t n)
{
	range r = {UINT64_MAX, 0};
	for (size_t i = 0; i < n; i++) {
		r.lo = ids[i] < r.lo ? ids[i] : r.lo;
		r.hi = ids[i] > r.hi ? ids[i] : r.hi;
	}
	return r;
}

/* Fills in the chunk's corners that are in memory, in one of the two files: items of `size` bytes
 * from a table. */
static wh_code fill(wh_ctx *c, const wh_scene *s, workspace *ws, int64_t index, int fd, size_t size)
{
	const size_t n = wh_chunk_items(s->p.source->nf, index, CHUNK), bytes = 3 * n * size;
	const uint64_t off = (uint64_t)index * CHUNK * 3 * size;
	const bool is_spot = fd == s->spot_fd;
	unsigned char *item = is_spot ? (unsigned char *)ws->spot : (unsigned char *)ws->sum;
	const unsigned char *table =
	    is_spot ? (const unsigned char *)s->spot : (const unsigned char *)s->sum;
	if (s->range[index].lo < s->first) { /* an earlier window has begun it */
		if (wh_spill_pread(c, s->spill, fd, item, bytes, off) != WH_OK)
			return c->err.code;
	} else {
		memset(item, 0, bytes);
	}
	for (size_t i = 0; i < 3 * n; i++) {
		const uint64_t id = ws->ids[i] - s->first;
		if (id < s->end - s->first)
			memcpy(item + i * size, table + id * size, size);
	}
	return wh_spill_pwrite(c, s->spill, fd, item, bytes, off);
}

static wh_code fill_job(wh_ctx *c, const wh_scene *s, int64_t index, int worker, bool sums)
{
	workspace *ws = &s->workspace[worker];
	const size_t n = wh_chunk_items(s->p.source->nf, index, CHUNK);
	range *r = &s->range[index];
	wh_progress_add(s->progress, n);
	if ((sums || s->first > 0) && (r->lo >= s->end || r->hi < s->first))
		return WH_OK;
	const wh_code code = read_faces(c, s, ws, index, n);
	if (code != WH_OK)
		return code;
	if (!sums && s->first == 0)
		*r = range_of(ws->ids, 3 * n);
	if (r->lo >= s->end)
		return WH_OK;
	return sums ? fill(c, s, ws, index, s->sum_fd, sizeof *ws->sum)
	            : fill(c, s, ws, index, s->spot_fd, sizeof *ws->spot);
}

static wh_code fill_spots_job(wh_ctx *c, void *arg, int64_t index, int worker)
{
	return fill_job(c, arg, index, worker, false);
}

static wh_code fill_sums_job(wh_ctx *c, void *arg, int64_t index, int worker)
{
	return fill_job(c, arg, index, worker, true);
}

static uint64_t windows(const wh_scene *s)
{
	const uint64_t w = window_of(&s->p);
	return w ? (s->p.source->nv + w - 1) / w : 1;
}

static void to_window(wh_scene *s, uint64_t w)
{
	const uint64_t size = window_of(&s->p), nv = s->p.source->nv;
	s->first = w * size;
	s->end = nv - s->first < size ? nv : s->first + size;
}

static wh_code over_faces(wh_ctx *c, wh_scene *s, wh_job job)
{
	return wh_exec_for(c, s->ex, wh_chunks(s->p.source->nf, CHUNK), job, s);
}

/* ---- stages --------------------------------------------------------------------------------- */

static wh_code find_places(wh_ctx *c, wh_scene *s)
{
	const wh_source *src = s->p.source;
	const uint64_t faces = s->windowed ? windows(s) * src->nf : 0;
	wh_progress_phase(s->progress, "project", src->nv + faces);
	for (uint64_t w = 0; w < windows(s); w++) {
		to_window(s, w);
		wh_code code =
		    wh_exec_for(c, s->ex, wh_chunks(s->end - s->first, CHUNK), project_job, s);
		if (code == WH_OK && s->windowed)
			code = over_faces(c, s, fill_spots_job);
		if (code != WH_OK)
			return code;
	}
	return WH_OK;
}

static wh_code find_normals(wh_ctx *c, wh_scene *s)
{
	const uint64_t passes = s->windowed ? 2 * windows(s) : 1;
	const size_t size = window_of(&s->p);
	wh_progress_phase(s->progress, "normals", passes * s->p.source->nf);
	if (s->windowed) {
		wh_free(c, s->spot);
		s->spot = NULL;
	}
	s->sum = wh_alloc(c, size, sizeof *s->sum);
	wh_mem_scattered(s->sum);
	if (!s->sum)
		return c->err.code;
	for (uint64_t w = 0; w < windows(s); w++) {
		to_window(s, w);
		memset(s->sum, 0, size * sizeof *s->sum);
		wh_code code = over_faces(c, s, normals_job);
		if (code == WH_OK && s->windowed)
			code = over_faces(c, s, fill_sums_job);
		if (code != WH_OK)
			return code;
	}
	return WH_OK;
}

wh_code wh_scene_prepare(wh_ctx *c, wh_scene *s)
{
	if (s->p.source->nf == 0)
		return WH_OK;
	const wh_code code = find_places(c, s);
	return code == WH_OK && s->p.look.smooth ? find_normals(c, s) : code;
}

wh_code wh_scene_draw(wh_ctx *c, wh_scene *s, const wh_canvas *canvas)
{
	const wh_source *src = s->p.source;
	s->canvas = canvas;
	if (src->nf == 0)
		return wh_exec_for(c, s->ex, wh_chunks(src->nv, CHUNK), cloud_job, s);
	return over_faces(c, s, draw_job);
}

/* ---- memory --------------------------------------------------------------------------------- */

static size_t record_bytes(const wh_scene_params *p)
{
	return p->look.colours ? CHUNK * (size_t)p->source->attributes->bytes : 0;
}

static size_t workspace_bytes(const wh_scene_params *p)
{
	const size_t sums = has_windows(p) ? sizeof(wh_normal_sum) : 0;
	return sizeof(workspace) + raw_bytes(p->source) +
	       (size_t)CHUNK * 3 * (sizeof(double) + sizeof(uint64_t) + sizeof(wh_spot) + sums) +
	       record_bytes(p) + 512;
}

size_t wh_scene_bytes(const wh_scene_params *p, const wh_exec *ex)
{
	const bool windowed = has_windows(p);
	const size_t sum = p->look.smooth ? sizeof(wh_normal_sum) : 0;
	const size_t each = windowed ? sizeof(wh_spot) : sizeof(wh_spot) + sum;
	const size_t ranges =
	    windowed ? (size_t)wh_chunks(p->source->nf, CHUNK) * sizeof(range) : 0;
	return (size_t)window_of(p) * each + ranges + (size_t)ex->workers * workspace_bytes(p) +
	       sizeof(wh_scene) + 1024;
}

static wh_code open_workspaces(wh_ctx *c, wh_scene *s)
{
	s->workspace = wh_calloc(c, (size_t)s->ex->workers, sizeof *s->workspace);
	for (int i = 0; s->workspace && i < s->ex->workers; i++) {
		workspace *ws = &s->workspace[i];
		ws->raw = wh_alloc(c, raw_bytes(s->p.source), 1);
		ws->xyz = wh_alloc(c, CHUNK, 3 * sizeof *ws->xyz);
		ws->records = wh_alloc(c, record_bytes(&s->p), 1);
		ws->ids = wh_alloc(c, CHUNK, 3 * sizeof *ws->ids);
		ws->spot = wh_alloc(c, CHUNK, 3 * sizeof *ws->spot);
		ws->sum = s->windowed ? wh_alloc(c, CHUNK, 3 * sizeof *ws->sum) : NULL;
	}
	return c->err.code;
}

static wh_code open_windows(wh_ctx *c, wh_scene *s)
{
	s->range = wh_alloc(c, (size_t)wh_chunks(s->p.source->nf, CHUNK), sizeof *s->range);
	s->spot_fd = s->range ? wh_spill_scratch(c, s->spill) : -1;
	s->sum_fd = s->spot_fd >= 0 ? wh_spill_scratch(c, s->spill) : -1;
	return s->sum_fd >= 0 ? WH_OK : wh_failed(c);
}

wh_code wh_scene_open(wh_ctx *c, wh_scene **out, const wh_exec *ex, wh_spill *spill,
                      wh_progress *progress, const wh_scene_params *p)
{
	wh_scene *s = wh_calloc(c, 1, sizeof *s);
	*out = s;
	if (!s)
		return c->err.code;
	s->p = *p;
	s->ex = ex;
	s->spill = spill;
	s->progress = progress;
	s->windowed = has_windows(p);
	s->spot_fd = s->sum_fd = -1;
	wh_code code = open_workspaces(c, s);
	if (code == WH_OK && s->windowed)
		code = open_windows(c, s);
	if (code == WH_OK && p->source->nf) {
		s->spot = wh_alloc(c, (size_t)window_of(p), sizeof *s->spot);
		wh_mem_scattered(s->spot);
		code = c->err.code;
	}
	if (code != WH_OK)
		wh_scene_close(c, out);
	return code;
}

void wh_scene_close(wh_ctx *c, wh_scene **scene)
{
	wh_scene *s = *scene;
	if (!s)
		return;
	for (int i = 0; s->workspace && i < s->ex->workers; i++) {
		wh_free(c, s->workspace[i].raw);
		wh_free(c, s->workspace[i].xyz);
		wh_free(c, s->workspace[i].records);
		wh_free(c, s->workspace[i].ids);
		wh_free(c, s->workspace[i].spot);
		wh_free(c, s->workspace[i].sum);
	}
	if (s->spot_fd >= 0)
		wh_spill_close_scratch(s->spill, s->spot_fd);
	if (s->sum_fd >= 0)
		wh_spill_close_scratch(s->spill, s->sum_fd);
	wh_free(c, s->range);
	wh_free(c, s->workspace);
	wh_free(c, s->sum);
	wh_free(c, s->spot);
	wh_free(c, s);
	*scene = NULL;
}
