#include "pipeline/homes.h"

#include <string.h>

static bool in_memory(const wh_homes *h)
{
	return h->window >= h->vertices;
}

static bool windowed(const wh_homes_params *p)
{
	return p->window != 0 && p->window < p->vertices;
}

size_t wh_homes_bytes(const wh_homes_params *p)
{
	const uint64_t held = windowed(p) ? p->window : p->vertices;
	const uint64_t ranges = windowed(p) ? p->chunks : 0;
	return (size_t)held * sizeof(uint16_t) + (size_t)ranges * sizeof(wh_homes_range) + 128;
}

size_t wh_homes_bytes_after(const wh_homes_params *p)
{
	return windowed(p) ? 0 : wh_homes_bytes(p);
}

wh_code wh_homes_open(wh_ctx *c, wh_homes *h, wh_spill *spill, const wh_homes_params *p)
{
	*h = (wh_homes){.spill = spill,
	                .base = p->base,
	                .vertices = p->vertices,
	                .window = windowed(p) ? p->window : p->vertices,
	                .chunk_corners = p->chunk_corners,
	                .first = p->base,
	                .end = windowed(p) ? p->base : p->base + p->vertices,
	                .vertex_fd = -1,
	                .corner_fd = -1};
	h->table = wh_alloc(c, h->window, sizeof *h->table);
	if (!h->table || in_memory(h))
		return c->err.code;
	h->range = wh_alloc(c, p->chunks, sizeof *h->range);
	h->vertex_fd = h->range ? wh_spill_scratch(c, spill) : -1;
	h->corner_fd = h->vertex_fd >= 0 ? wh_spill_scratch(c, spill) : -1;
	return h->corner_fd >= 0 ? WH_OK : wh_failed(c);
}

void wh_homes_close(wh_ctx *c, wh_homes *h)
{
	if (!h->spill)
		return;
	wh_homes_filled(c, h);
	wh_free(c, h->table);
	if (h->vertex_fd >= 0)
		wh_spill_close_scratch(h->spill, h->vertex_fd);
	if (h->corner_fd >= 0)
		wh_spill_close_scratch(h->spill, h->corner_fd);
	*h = (wh_homes){0};
}

/* ---- vertices ----------------------------------------------------------------------------- */

wh_code wh_homes_put(wh_ctx *c, const wh_homes *h, uint64_t first, size_t n, const uint16_t *home)
{
	if (!in_memory(h))
		return wh_spill_pwrite(c, h->spill, h->vertex_fd, home, n * sizeof *home,
		                       (first - h->base) * sizeof *home);
	memcpy(h->table + (first - h->base), home, n * sizeof *home);
	return WH_OK;
}

wh_code wh_homes_get(wh_ctx *c, const wh_homes *h, uint64_t first, size_t n, uint16_t *home)
{
	if (!in_memory(h))
		return wh_spill_pread(c, h->spill, h->vertex_fd, home, n * sizeof *home,
		                      (first - h->base) * sizeof *home);
	memcpy(home, h->table + (first - h->base), n * sizeof *home);
	return WH_OK;
}

/* ---- corners ------------------------------------------------------------------------------ */

uint64_t wh_homes_windows(const wh_homes *h)
{
	return in_memory(h) ? 0 : (h->vertices + h->window - 1) / h->window;
}

wh_code wh_homes_window(wh_ctx *c, wh_homes *h, uint64_t w)
{
	const uint64_t last = h->base + h->vertices;
	h->first = h->base + w * h->window;
	h->end = last - h->first < h->window ? last : h->first + h->window;
	return wh_homes_get(c, h, h->first, (size_t)(h->end - h->first), h->table);
}

bool wh_homes_wants(const wh_homes *h, int64_t chunk)
{
	return h->first == h->base ||
	       (h->range[chunk].lo < h->end && h->range[chunk].hi >= h->first);
}

static wh_homes_range find_range(const uint64_t *corner, size_t n)
{
	wh_homes_range r = {UINT64_MAX, 0};
	for (size_t i = 0; i < n; i++) {
		r.lo = corner[i] < r.lo ? corner[i] : r.lo;
		r.hi = corner[i] > r.hi ? corner[i] : r.hi;
	}
	return r;
}

wh_code wh_homes_fill(wh_ctx *c, wh_homes *h, int64_t chunk, const uint64_t *corner, size_t n,
                      uint16_t *room)
{
	if (h->first == h->base)
		h->range[chunk] = find_range(corner, n);
	if (!wh_homes_wants(h, chunk) || h->range[chunk].lo >= h->end)
		return WH_OK;
	const uint64_t off = (uint64_t)chunk * h->chunk_corners * sizeof *room;
	const bool begun = h->range[chunk].lo < h->first; /* by an earlier window */
	if (begun && wh_spill_pread(c, h->spill, h->corner_fd, room, n * sizeof *room, off))
		return c->err.code;
	const uint64_t size = h->end - h->first;
	for (size_t i = 0; i < n; i++)
		if (corner[i] - h->first < size)
			room[i] = h->table[corner[i] - h->first];
		else if (!begun)
			room[i] = 0;
	return wh_spill_pwrite(c, h->spill, h->corner_fd, room, n * sizeof *room, off);
}

void wh_homes_filled(wh_ctx *c, wh_homes *h)
{
	if (in_memory(h))
		return;
	wh_free(c, h->table);
	wh_free(c, h->range);
	h->table = NULL;
	h->range = NULL;
}

/* A loop of nothing but loads: many of them wait for memory at the same time. */
wh_code wh_homes_corners(wh_ctx *c, const wh_homes *h, int64_t chunk, const uint64_t *corner,
                         size_t n, uint16_t *home)
{
	if (!in_memory(h))
		return wh_spill_pread(c, h->spill, h->corner_fd, home, n * sizeof *home,
		                      (uint64_t)chunk * h->chunk_corners * sizeof *home);
	for (size_t i = 0; i < n; i++)
		home[i] = h->table[corner[i] - h->base];
	return WH_OK;
}
