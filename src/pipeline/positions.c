#include "pipeline/positions.h"

#include <string.h>

enum { PAGE = 2048 }; /* vertices: 48 KiB of positions, read in one go */

_Static_assert(sizeof(wh_vec3) == 3 * sizeof(double), "positions are read straight into pages");

wh_code wh_positions_open(wh_ctx *c, wh_positions *p, const wh_source *source, size_t most)
{
	*p = (wh_positions){.source = source, .slots = 1};
	while (p->slots < most && p->slots * PAGE < source->nv)
		p->slots *= 2;
	p->tags = wh_calloc(c, p->slots, sizeof *p->tags);
	p->pages = wh_alloc(c, p->slots * PAGE, sizeof *p->pages);
	p->raw = wh_alloc(c, wh_source_vertex_bytes(source, PAGE), 1);
	if (p->tags && p->pages && p->raw)
		return WH_OK;
	wh_positions_close(c, p);
	return c->err.code;
}

void wh_positions_close(wh_ctx *c, wh_positions *p)
{
	wh_free(c, p->raw);
	wh_free(c, p->pages);
	wh_free(c, p->tags);
	*p = (wh_positions){0};
}

static wh_code load_page(wh_ctx *c, wh_positions *p, uint64_t page, size_t slot)
{
	const uint64_t first = page * PAGE;
	const uint64_t left = p->source->nv - first;
	const size_t n = left < PAGE ? (size_t)left : PAGE;
	p->tags[slot] = 0;
	if (wh_source_vertices(c, p->source, first, n, &p->pages[slot * PAGE].x, p->raw) != WH_OK)
		return c->err.code;
	p->tags[slot] = page + 1;
	return WH_OK;
}

wh_code wh_positions_get(wh_ctx *c, wh_positions *p, uint64_t id, wh_vec3 *pos)
{
	const uint64_t page = id / PAGE;
	const size_t slot = (size_t)page & (p->slots - 1);
	if (p->tags[slot] != page + 1 && load_page(c, p, page, slot) != WH_OK)
		return c->err.code;
	*pos = p->pages[slot * PAGE + id % PAGE];
	return WH_OK;
}
