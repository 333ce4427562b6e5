#include "algo/compare_band.h"

#include <string.h>

enum { CHUNK = 4096, PAGES = 16 }; /* points, or pages, of one job */

typedef struct finder {
	const wh_bvh *t;
	const wh_compare_params *p;
	wh_bvh_reader *reader;
	wh_vec3 *points; /* CHUNK a worker */
	uint8_t *band;
	uint8_t *touched; /* a bit a vertex */
} finder;

size_t wh_band_bytes(const wh_bvh *t)
{
	return (size_t)t->pages * (WH_PAGE_FACES / 8);
}

static size_t touched_bytes(const wh_bvh *t)
{
	return (size_t)(t->ids / 8 + 1);
}

size_t wh_band_work_bytes(const wh_bvh *t, const wh_exec *ex)
{
	return touched_bytes(t) + (size_t)ex->workers * CHUNK * sizeof(wh_vec3);
}

static void set_bit(uint8_t *bits, uint64_t i)
{
	(void)__atomic_fetch_or(&bits[i / 8], (uint8_t)(1U << i % 8), __ATOMIC_RELAXED);
}

static bool has_bit(const uint8_t *bits, uint64_t i)
{
	return __atomic_load_n(&bits[i / 8], __ATOMIC_RELAXED) >> i % 8 & 1;
}

static wh_code get_points(wh_ctx *c, const wh_compare_params *p, uint64_t first, size_t n,
                          wh_vec3 *points)
{
	if (p->fetch_cuts)
		return p->fetch_cuts(c, p->cuts_user, first, n, points);
	memcpy(points, p->cuts + first, n * sizeof *points);
	return WH_OK;
}

static wh_code find_job(wh_ctx *c, void *arg, int64_t index, int worker)
{
	const finder *s = arg;
	const uint64_t first = (uint64_t)index * CHUNK, left = s->p->ncuts - first;
	const size_t n = left < CHUNK ? (size_t)left : CHUNK;
	wh_vec3 *points = s->points + (size_t)worker * CHUNK;
	wh_bvh_face near = {WH_NONE, 0};
	wh_code code = get_points(c, s->p, first, n, points);
	for (size_t i = 0; code == WH_OK && i < n; i++) {
		double d2;
		code = wh_bvh_nearest(c, &s->reader[worker],
		                      wh_frame_local(&s->t->frame, points[i]), &near, &d2);
		if (code == WH_OK)
			set_bit(s->band, (uint64_t)near.page * WH_PAGE_FACES + near.face);
	}
	return code;
}

static bool page_has_any(const finder *s, uint32_t page)
{
	const uint8_t *bits = s->band + (size_t)page * (WH_PAGE_FACES / 8);
	for (int i = 0; i < WH_PAGE_FACES / 8; i++)
		if (bits[i])
			return true;
	return false;
}

/* Touches the vertices of the page's faces in the band. */
static wh_code touch(wh_ctx *c, const finder *s, uint32_t page, wh_bvh_reader *r)
{
	if (!page_has_any(s, page))
		return WH_OK;
	const wh_page *g = wh_bvh_page(c, r, page);
	if (!g)
		return wh_failed(c);
	for (uint32_t i = 0; i < 3 * g->nf; i++)
		if (wh_band_has(s->band, page, i / 3))
			set_bit(s->touched, g->id[g->tri[i]]);
	return WH_OK;
}

/* Adds the page's faces that have a touched vertex. */
static wh_code widen(wh_ctx *c, const finder *s, uint32_t page, wh_bvh_reader *r)
{
	const wh_page *g = wh_bvh_page(c, r, page);
	if (!g)
		return wh_failed(c);
	for (uint32_t i = 0; i < 3 * g->nf; i++)
		if (has_bit(s->touched, g->id[g->tri[i]]))
			set_bit(s->band, (uint64_t)page * WH_PAGE_FACES + i / 3);
	return WH_OK;
}

typedef wh_code (*page_step)(wh_ctx *c, const finder *s, uint32_t page, wh_bvh_reader *r);

static wh_code over_pages(wh_ctx *c, const finder *s, int64_t index, int worker, page_step step)
{
	const uint32_t first = (uint32_t)index * PAGES;
	wh_code code = WH_OK;
	for (uint32_t i = first; code == WH_OK && i < s->t->pages && i - first < PAGES; i++)
		code = step(c, s, i, &s->reader[worker]);
	return code;
}

static wh_code touch_job(wh_ctx *c, void *arg, int64_t index, int worker)
{
	return over_pages(c, arg, index, worker, touch);
}

static wh_code widen_job(wh_ctx *c, void *arg, int64_t index, int worker)
{
	return over_pages(c, arg, index, worker, widen);
}

wh_code wh_compare_band(wh_ctx *c, const wh_exec *ex, wh_bvh_reader *reader,
                        const wh_compare_params *p, uint8_t *band)
{
	finder s = {.t = reader->t,
	            .p = p,
	            .reader = reader,
	            .points = wh_alloc(c, (size_t)ex->workers * CHUNK, sizeof *s.points),
	            .band = band,
	            .touched = wh_calloc(c, touched_bytes(reader->t), 1)};
	const int64_t pages = (s.t->pages + PAGES - 1) / PAGES;
	memset(band, 0, wh_band_bytes(s.t));
	wh_code code = c->err.code;
	if (code == WH_OK)
		code = wh_exec_for(c, ex, (int64_t)((p->ncuts + CHUNK - 1) / CHUNK), find_job, &s);
	for (int ring = 0; code == WH_OK && ring < WH_BAND_RINGS; ring++) {
		code = wh_exec_for(c, ex, pages, touch_job, &s);
		if (code == WH_OK)
			code = wh_exec_for(c, ex, pages, widen_job, &s);
	}
	wh_free(c, s.touched);
	wh_free(c, s.points);
	return code;
}
