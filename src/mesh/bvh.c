/*
 * Idea. A packed tree: every node has eight children, all nodes but the last of each level are
 * full, and children are found by arithmetic, so that nothing but boxes is stored. The upper tree
 * ends at pages of 512 faces, which are trees of the same kind. (Compare the packed R-trees of
 * Kamel & Faloutsos 1993; the order is that of mesh/face_order.) Boxes are floats rounded outwards.
 * Here trees are built and their pages are opened; the query is in bvh_nearest.c.
 *
 * A reader keeps pages by the clock's hand (Corbato 1968). A query that needs a page that is not
 * there fetches it; the order in which it looks at pages does not depend on what is there.
 *
 * Cost. Opened pages: 47 bytes a face. Records: 13 a face with floats. A page is opened in some 10
 * microseconds.
 */
#include "mesh/bvh.h"

#include "geom/tri.h"

#include <string.h>

/* ---- building ------------------------------------------------------------------------------- */

wh_code wh_bvh_add(wh_ctx *c, wh_bvh *t, const wh_page_entry *e)
{
	if (t->pages == UINT32_MAX / WH_BOXES)
		return wh_fail(c, WH_E_PLAN, "a surface of more than 2^37 faces");
	if (wh_reserve(c, &t->entry, &t->cap, (size_t)t->pages + 1, sizeof *t->entry) != WH_OK)
		return c->err.code;
	t->entry[t->pages++] = *e;
	t->faces += e->nf;
	return WH_OK;
}

static size_t record_bytes(const wh_bvh *t, uint32_t page)
{
	return wh_page_record_bytes(&t->layout, t->entry[page].nv, t->entry[page].nf);
}

/* The largest record, and the largest opened page. */
static size_t largest(const wh_bvh *t, bool opened)
{
	size_t most = 0;
	for (uint32_t i = 0; i < t->pages; i++) {
		const wh_page_entry *e = &t->entry[i];
		const size_t n =
		    opened ? wh_page_bytes(&t->layout, e->nv, e->nf) : record_bytes(t, i);
		most = n > most ? n : most;
	}
	return most;
}

static wh_code fetch(wh_ctx *c, const wh_bvh *t, uint32_t page, uint8_t *record)
{
	return t->fetch(c, t->user, t->entry[page].at, record_bytes(t, page), record);
}

static wh_code damaged(wh_ctx *c)
{
	return wh_fail(c, WH_E_RUN,
	               "a temporary file is damaged: its pages are not those written; "
	               "is the disk failing?");
}

wh_code wh_bvh_sample(wh_ctx *c, const wh_bvh *t, wh_vec3 *points, size_t *n)
{
	enum { PAGES = 256, EACH = WH_BVH_SAMPLE / PAGES };
	const uint32_t pages = t->pages < PAGES ? t->pages : PAGES;
	uint8_t *record = wh_alloc(c, largest(t, false), 1);
	for (uint32_t i = 0; record && i < pages; i++) {
		const uint32_t page = (uint32_t)((uint64_t)i * t->pages / pages);
		const uint32_t nv = t->entry[page].nv, each = nv < EACH ? nv : EACH;
		if (fetch(c, t, page, record) != WH_OK)
			break;
		for (uint32_t k = 0; k < each; k++)
			points[(*n)++] = wh_scale(wh_page_vertex(&t->layout, record, k * nv / each),
			                          1 / t->unit);
	}
	wh_free(c, record);
	return c->err.code;
}

void wh_bvh_bounds(const wh_bvh *t, wh_vec3 *lo, wh_vec3 *hi)
{
	*lo = t->entry[0].lo;
	*hi = t->entry[0].hi;
	for (uint32_t i = 1; i < t->pages; i++) {
		*lo = wh_lower(*lo, t->entry[i].lo);
		*hi = wh_upper(*hi, t->entry[i].hi);
	}
	*lo = wh_scale(*lo, 1 / t->unit);
	*hi = wh_scale(*hi, 1 / t->unit);
}

/* Positions of records become local ones: x * mul - sub. */
static double record_mul(const wh_bvh *t)
{
	return t->frame.scale / t->unit;
}

static wh_vec3 record_sub(const wh_bvh *t)
{
	return wh_scale(t->frame.origin, t->frame.scale);
}

/* Boxes of pages: none for one whose faces are all copies of those of an earlier one. */
static void fill_lowest(wh_bvh *t)
{
	const double mul = record_mul(t);
	const wh_vec3 sub = record_sub(t);
	const uint32_t slots = wh_boxes_over(t->pages) * WH_BOXES;
	uint64_t copies = 0; /* of the last page of copies */
	for (uint32_t i = 0; i < slots; i++) {
		wh_boxes *n = &t->nodes[i / WH_BOXES];
		const wh_page_entry *e = &t->entry[i];
		if (i >= t->pages || (e->copies && e->copies == copies)) {
			wh_boxes_set_missing(n, i % WH_BOXES);
			continue;
		}
		wh_boxes_set(n, i % WH_BOXES, wh_sub(wh_scale(e->lo, mul), sub),
		             wh_sub(wh_scale(e->hi, mul), sub));
		copies = e->copies ? e->copies : copies;
	}
}

static void fill_nodes(wh_bvh *t)
{
	uint32_t children = wh_boxes_over(t->pages);
	fill_lowest(t);
	for (int level = 1; level < t->levels; level++) {
		wh_boxes *node = t->nodes + t->first[level];
		const uint32_t nodes = wh_boxes_over(children);
		for (uint32_t i = 0; i < nodes * WH_BOXES; i++) {
			wh_boxes *n = &node[i / WH_BOXES];
			if (i < children)
				wh_boxes_set_child(n, i % WH_BOXES,
				                   t->nodes + t->first[level - 1] + i);
			else
				wh_boxes_set_missing(n, i % WH_BOXES);
		}
		children = nodes;
	}
}

wh_code wh_bvh_finish(wh_ctx *c, wh_bvh *t, const wh_frame *f)
{
	t->frame = *f;
	const double mul = record_mul(t);
	wh_free(c, t->area);
	wh_free(c, t->nodes);
	t->area = wh_alloc(c, (size_t)t->pages + 1, sizeof *t->area);
	t->nodes = wh_alloc(c, wh_boxes_layout(t->pages, t->first, &t->levels), sizeof *t->nodes);
	if (!t->area || !t->nodes)
		return c->err.code;
	t->area[0] = 0;
	for (uint32_t i = 0; i < t->pages; i++)
		t->area[i + 1] = t->area[i] + t->entry[i].area * mul * mul;
	fill_nodes(t);
	return WH_OK;
}

void wh_bvh_free(wh_ctx *c, wh_bvh *t)
{
	wh_bvh_close_all(c, t);
	wh_free(c, t->nodes);
	wh_free(c, t->area);
	wh_free(c, t->records);
	wh_free(c, t->entry);
	*t = (wh_bvh){0};
}

/* ---- all pages open ------------------------------------------------------------------------- */

size_t wh_bvh_open_bytes(const wh_bvh *t)
{
	size_t sum = t->pages * sizeof(wh_page);
	for (uint32_t i = 0; i < t->pages; i++)
		sum += wh_page_bytes(&t->layout, t->entry[i].nv, t->entry[i].nf);
	return sum;
}

enum { OPEN_PAGES = 64 }; /* a job */

typedef struct opening {
	wh_bvh *t;
	size_t *at;      /* block of the first page of each job */
	uint8_t *record; /* one a worker */
	size_t each;
} opening;

static wh_code open_job(wh_ctx *c, void *arg, int64_t index, int worker)
{
	const opening *o = arg;
	wh_bvh *t = o->t;
	uint8_t *record = o->record + (size_t)worker * o->each;
	uint8_t *block = t->blocks + o->at[index];
	const uint32_t first = (uint32_t)index * OPEN_PAGES;
	for (uint32_t i = first; i < t->pages && i - first < OPEN_PAGES; i++) {
		const wh_page_entry *e = &t->entry[i];
		if (fetch(c, t, i, record) != WH_OK)
			return c->err.code;
		if (!wh_page_open(&t->layout, e, record, record_mul(t), record_sub(t), true, block,
		                  &t->open[i]))
			return damaged(c);
		block += wh_page_bytes(&t->layout, e->nv, e->nf);
	}
	return WH_OK;
}

wh_code wh_bvh_open_all(wh_ctx *c, const wh_exec *ex, wh_bvh *t)
{
	const int64_t jobs = (t->pages + OPEN_PAGES - 1) / OPEN_PAGES;
	opening o = {.t = t, .each = largest(t, false)};
	size_t sum = 0;
	o.at = wh_alloc(c, (size_t)jobs, sizeof *o.at);
	o.record = wh_alloc(c, (size_t)ex->workers, o.each);
	t->open = wh_alloc(c, t->pages, sizeof *t->open);
	if (!o.at || !o.record || !t->open)
		goto out;
	for (uint32_t i = 0; i < t->pages; i++) {
		if (i % OPEN_PAGES == 0)
			o.at[i / OPEN_PAGES] = sum;
		sum += wh_page_bytes(&t->layout, t->entry[i].nv, t->entry[i].nf);
	}
	t->blocks = wh_alloc(c, sum, 1);
	if (t->blocks)
		(void)wh_exec_for(c, ex, jobs, open_job, &o);
out:
	wh_free(c, o.record);
	wh_free(c, o.at);
	if (c->err.code != WH_OK)
		wh_bvh_close_all(c, t);
	return c->err.code;
}

void wh_bvh_close_all(wh_ctx *c, wh_bvh *t)
{
	wh_free(c, t->blocks);
	wh_free(c, t->open);
	t->blocks = NULL;
	t->open = NULL;
}

/* ---- a mesh in memory ----------------------------------------------------------------------- */

static wh_code fetch_memory(wh_ctx *c, void *user, uint64_t at, size_t bytes, uint8_t *record)
{
	(void)c;
	memcpy(record, (const uint8_t *)user + at, bytes);
	return WH_OK;
}

/* A power of two that brings all used positions below 2^32. */
static double unit_of(const wh_mesh *m)
{
	double most = 0;
	for (size_t i = 0; i < 3 * (size_t)m->nf; i++)
		most = fmax(most, wh_largest_coordinate(m->pos[m->tri[i]]));
	const int e = most > 0 ? ilogb(most) : 0, keep = 31;
	const int shift = e > keep ? keep - e : e < -keep ? -keep - e : 0;
	return ldexp(1, shift < 1000 ? shift : 1000);
}

static wh_code make_records(wh_ctx *c, const wh_page_soup *soup, const wh_face_item *items,
                            uint32_t nf, wh_bvh *t)
{
	wh_page_maker maker = {0};
	size_t used = 0, cap = 0;
	wh_code code = wh_page_maker_begin(c, &maker, soup->nv);
	for (uint32_t i = 0; code == WH_OK && i < nf; i += WH_PAGE_FACES) {
		const uint32_t n = nf - i < WH_PAGE_FACES ? nf - i : WH_PAGE_FACES;
		const size_t most = wh_page_record_bytes(&t->layout, 3 * n, n);
		wh_page_entry e = {.at = used};
		code = wh_reserve(c, &t->records, &cap, used + most, 1);
		if (code != WH_OK)
			break;
		used += wh_page_make(&maker, &t->layout, soup, items + i, n, t->records + used, &e);
		t->vertices += e.own;
		code = wh_bvh_add(c, t, &e);
	}
	wh_page_maker_free(c, &maker);
	return code;
}

static wh_code build_pages(wh_ctx *c, const wh_exec *ex, const wh_mesh *m, wh_vec3 *pos, wh_bvh *t)
{
	const wh_page_soup soup = {.nv = m->nv, .pos = pos, .tri = m->tri, .colour = m->colour};
	wh_face_item *items = wh_alloc(c, m->nf, sizeof *items);
	if (!items)
		return c->err.code;
	for (uint32_t v = 0; v < m->nv; v++)
		pos[v] = wh_scale(m->pos[v], t->unit);
	wh_face_items(pos, m->tri, m->nf, items);
	wh_code code = wh_face_order_parallel(c, ex, items, m->nf);
	if (code == WH_OK)
		code = make_records(c, &soup, items, m->nf, t);
	wh_free(c, items);
	return code;
}

wh_code wh_bvh_build(wh_ctx *c, const wh_exec *ex, const wh_mesh *m, wh_bvh *t)
{
	*t = (wh_bvh){.layout = {.is_double = true, .coloured = m->colour, .numbered = true},
	              .unit = unit_of(m),
	              .ids = m->nv};
	wh_vec3 *pos = wh_alloc(c, m->nv, sizeof *pos);
	const wh_code code = pos ? build_pages(c, ex, m, pos, t) : c->err.code;
	wh_free(c, pos);
	t->fetch = fetch_memory;
	t->user = t->records;
	if (code != WH_OK)
		wh_bvh_free(c, t);
	return code;
}

/* ---- readers -------------------------------------------------------------------------------- */

size_t wh_bvh_reader_bytes(const wh_bvh *t)
{
	return largest(t, false) + t->pages * sizeof(uint32_t) + 1024;
}

size_t wh_bvh_slot_bytes(const wh_bvh *t)
{
	return largest(t, true) + sizeof(wh_page) + sizeof(uint32_t) + sizeof(bool);
}

wh_code wh_bvh_reader_open(wh_ctx *c, wh_bvh_reader *r, const wh_bvh *t, uint32_t slots, bool boxes)
{
	*r = (wh_bvh_reader){.t = t, .boxes = boxes};
	if (t->open && boxes)
		return WH_OK;
	const uint32_t least = slots < WH_BVH_SLOTS_LEAST ? WH_BVH_SLOTS_LEAST : slots;
	r->slots = least < t->pages ? least : t->pages;
	r->each = largest(t, true);
	r->slot = wh_calloc(c, t->pages, sizeof *r->slot);
	r->holds = wh_alloc(c, r->slots, sizeof *r->holds);
	r->used = wh_calloc(c, r->slots, sizeof *r->used);
	r->page = wh_alloc(c, r->slots, sizeof *r->page);
	r->blocks = wh_alloc(c, r->slots, r->each);
	r->record = wh_alloc(c, largest(t, false), 1);
	if (c->err.code != WH_OK)
		wh_bvh_reader_close(c, r);
	return c->err.code;
}

void wh_bvh_reader_close(wh_ctx *c, wh_bvh_reader *r)
{
	wh_free(c, r->slot);
	wh_free(c, r->holds);
	wh_free(c, r->used);
	wh_free(c, r->page);
	wh_free(c, r->blocks);
	wh_free(c, r->record);
	*r = (wh_bvh_reader){0};
}

/* A slot whose page was not asked for lately; never that of the last call. */
static uint32_t free_slot(wh_bvh_reader *r)
{
	if (r->filled < r->slots)
		return r->filled++;
	while (r->used[r->hand]) {
		r->used[r->hand] = false;
		r->hand = (r->hand + 1) % r->slots;
	}
	const uint32_t slot = r->hand;
	r->hand = (r->hand + 1) % r->slots;
	r->slot[r->holds[slot]] = 0;
	return slot;
}

static wh_code bring(wh_ctx *c, wh_bvh_reader *r, uint32_t page, uint32_t *slot)
{
	const wh_bvh *t = r->t;
	*slot = free_slot(r);
	r->holds[*slot] = page;
	r->fetched++;
	if (fetch(c, t, page, r->record) != WH_OK)
		return c->err.code;
	if (!wh_page_open(&t->layout, &t->entry[page], r->record, record_mul(t), record_sub(t),
	                  r->boxes, r->blocks + *slot * r->each, &r->page[*slot]))
		return damaged(c);
	r->slot[page] = *slot + 1;
	return WH_OK;
}

const wh_page *wh_bvh_bring(wh_ctx *c, wh_bvh_reader *r, uint32_t page)
{
	uint32_t slot = r->slot[page];
	if (slot == 0) {
		if (bring(c, r, page, &slot) != WH_OK)
			return NULL;
	} else {
		slot--;
	}
	r->used[slot] = true;
	return &r->page[slot];
}
