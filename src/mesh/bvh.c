/*
 * Idea. A packed tree: every node has eight children, all nodes but the last of each level are
 * full, and children are found by arithmetic, so that nothing but boxes is stored. The upper tree
 * ends at pages of 512 faces, which are trees of the same kind. (Compare the packed R-trees of
 * Kamel & Faloutsos 1993; the order is that of mesh/face_order.)
 *
 * Boxes are floats rounded outwards. A query near the bulk of the surface bounds distances in
 * floats, four boxes at a time: its point is a small box itself, wide enough to hold what
 * conversion to float and the arithmetic on it can lose, so that a bound is never too large, and
 * no nearest face is missed. Far out, as with a stray vertex at 1e30, all boxes of the bulk have
 * the same distance as floats, and every face would have to be looked at: there bounds are doubles,
 * and a box is left out that is nearer by less than 2^-40 of the distance. So no query takes more
 * than some pages. Distances to faces are doubles.
 *
 * Thousands of faces at one place, in a ball that floats take for a point, have one distance in the
 * same way. A query that has tried 256 faces leaves out what is nearer by less than floats can
 * tell. Copies of one triangle, which no box tells apart, are looked at once.
 *
 * Points come in spatial order mostly. So a reader also remembers the leaves around one of them:
 * while the next ones, and the spheres in which their nearest faces must be, are inside that
 * neighbourhood, its few boxes stand for the tree.
 *
 * A reader keeps pages by the clock's hand (Corbato 1968). A query that needs a page that is not
 * there fetches it; the order in which it looks at pages does not depend on what is there.
 *
 * Cost. Opened pages: 47 bytes a face. Records: 13 a face with floats. A query takes a quarter of a
 * microsecond near the surface of 1 M faces; a page is opened in some 10.
 */
#include "mesh/bvh.h"

#include "geom/tri.h"

#include <float.h>
#include <string.h>

#ifdef __SSE2__
#include <emmintrin.h>
#endif

/* Coordinates lose up to this share as floats, and a little more in a difference. */
#define QUERY_SLACK 0x1p-23f

/* Products and sums of floats lose less than this share. */
#define BOUND_SLACK 1e-6

/* Of a distance: what is too little to look for, far out. */
#define FAR_SLACK 0x1p-40

/* Of coordinates and distances: what is too little to look for near the bulk, once ... */
#define FLOAT_SLACK 0x1p-20

/* ... so many faces have been tried, as floats tell too few of them apart. */
enum { MANY = 256 };

/* Up to here a query is near the bulk, whose coordinates are about 1, ... */
static const double NEAR = 8;
/* ... and up to here squared distances are good floats. */
static const double FLOATS_MOST = 0x1p120;

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

const wh_page *wh_bvh_page(wh_ctx *c, wh_bvh_reader *r, uint32_t page)
{
	if (r->slots == 0)
		return &r->t->open[page];
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

/* ---- the query ------------------------------------------------------------------------------ */

/* Four floats in one register, and four truths: all bits set or none. */
typedef float lanes __attribute__((vector_size(16)));
typedef int32_t truths __attribute__((vector_size(16)));

/* Something still to be looked at. */
typedef struct todo {
	double bound; /* its squared distance is at least this */
	int level;    /* of the node; -1: a page or a face */
	uint32_t id;
} todo;

enum { TODO_MAX = (WH_BVH_LEVELS + WH_PAGE_LEVELS) * WH_BOXES };

typedef struct query {
	wh_vec3 p;
	bool far;
	lanes lo[3], hi[3]; /* the box around p, in all lanes; near ones only */
	double best;        /* squared distance of the nearest face so far */
	double limit;       /* bounds from here on cannot be nearer than best; ... */
	float short_limit;  /* ... as a float, which is 0 only if it is */
	uint32_t tried;     /* faces so far */
	wh_bvh_face face;
	todo stack[TODO_MAX]; /* nearest on top within the children of one node */
	int depth;
} query;

/* What is too little to look for after many faces: more than boxes of floats can tell. */
static double patient_limit(const query *q)
{
	const double d = sqrt(q->best), slack = wh_largest_coordinate(q->p) + d;
	const double less = fmax(d - slack * FLOAT_SLACK, 0);
	return less * less;
}

static void set_limit(query *q, double limit)
{
	q->limit = limit;
	if (limit < (double)FLT_MIN)
		q->short_limit = limit > 0 ? FLT_MIN : 0;
	else
		q->short_limit = limit < (double)FLT_MAX ? (float)limit : FLT_MAX;
}

static void limit_to_best(query *q)
{
	if (q->far)
		set_limit(q, q->best * (1 - FAR_SLACK));
	else
		set_limit(q, q->tried < MANY ? q->best * (1 + BOUND_SLACK) : patient_limit(q));
}

static void try_face(query *q, uint32_t page, const wh_page *g, uint32_t face)
{
	const uint16_t *t = g->tri + 3 * (size_t)face;
	const double d = wh_tri_dist2(q->p, g->pos[t[0]], g->pos[t[1]], g->pos[t[2]]);
	const bool many = ++q->tried == MANY;
	if (d < q->best) {
		q->best = d;
		q->face = (wh_bvh_face){page, face};
		limit_to_best(q);
	} else if (many) {
		limit_to_best(q);
	}
}

static lanes load_lanes(const float *x)
{
	lanes v;
	memcpy(&v, x, sizeof v);
	return v;
}

/* Lane by lane; both are numbers. */
static lanes greater(lanes x, lanes y)
{
#ifdef __SSE2__
	return _mm_max_ps(x, y);
#else
	const truths more = x > y;
	return (lanes)(((truths)x & more) | ((truths)y & ~more));
#endif
}

/* Lower bounds of the squared distances to four boxes, from slot s on. */
static lanes bound_boxes(const query *q, const wh_boxes *n, int s)
{
	lanes sum = {0};
	for (int k = 0; k < 3; k++) {
		const lanes under = load_lanes(n->lo[k] + s) - q->hi[k];
		const lanes over = q->lo[k] - load_lanes(n->hi[k] + s);
		const lanes d = greater(greater(under, over), (lanes){0});
		sum += d * d;
	}
	return sum;
}

/* Bit i: lane i is true. */
static unsigned bits_of(truths t)
{
#ifdef __SSE2__
	return (unsigned)_mm_movemask_ps((lanes)t);
#else
	const truths bit = t & (truths){1, 2, 4, 8};
	return (unsigned)(bit[0] | bit[1] | bit[2] | bit[3]);
#endif
}

/* Puts a child into the stack, above those of its siblings (from base on) that are farther. */
static void push(query *q, int base, todo x)
{
	int i = q->depth++;
	for (; i > base && q->stack[i - 1].bound < x.bound; i--)
		q->stack[i] = q->stack[i - 1];
	q->stack[i] = x;
}

static void open_near(query *q, const wh_boxes *n, const todo *x)
{
	const int base = q->depth;
	for (int s = 0; s < WH_BOXES; s += 4) {
		const lanes bound = bound_boxes(q, n, s);
		for (unsigned near = bits_of(bound < q->short_limit); near; near &= near - 1) {
			const int lane = __builtin_ctz(near);
			push(q, base,
			     (todo){(double)bound[lane], x->level - 1,
			            x->id * WH_BOXES + (uint32_t)(s + lane)});
		}
	}
}

/* How far x is outside of lo .. hi. */
static double outside(double x, double lo, double hi)
{
	return x < lo ? lo - x : x > hi ? x - hi : 0;
}

static void open_far(query *q, const wh_boxes *n, const todo *x)
{
	const int base = q->depth;
	for (int s = 0; s < WH_BOXES; s++) {
		const double dx = outside(q->p.x, (double)n->lo[0][s], (double)n->hi[0][s]);
		const double dy = outside(q->p.y, (double)n->lo[1][s], (double)n->hi[1][s]);
		const double dz = outside(q->p.z, (double)n->lo[2][s], (double)n->hi[2][s]);
		const double bound = dx * dx + dy * dy + dz * dz;
		if (bound < q->limit)
			push(q, base, (todo){bound, x->level - 1, x->id * WH_BOXES + (uint32_t)s});
	}
}

/* Looks at the faces of a leaf. */
static void try_leaf(query *q, uint32_t page, const wh_page *g, uint32_t leaf)
{
	const wh_boxes *n = &g->boxes[leaf]; /* level 0 comes first */
	for (int s = 0; s < WH_BOXES; s += 4) {
		const lanes bound = bound_boxes(q, n, s);
		for (unsigned near = bits_of(bound < q->short_limit); near; near &= near - 1) {
			const int lane = __builtin_ctz(near);
			if ((double)bound[lane] < q->limit)
				try_face(q, page, g, leaf * WH_BOXES + (uint32_t)(s + lane));
		}
	}
}

static void open_node(query *q, const wh_boxes *n, const todo *x)
{
	if (q->far)
		open_far(q, n, x);
	else
		open_near(q, n, x);
}

static void search_page(query *q, uint32_t page, const wh_page *g)
{
	const int base = q->depth;
	q->stack[q->depth++] = (todo){0, g->levels - 1, 0};
	while (q->depth > base) {
		const todo x = q->stack[--q->depth];
		if (x.bound >= q->limit)
			continue;
		if (x.level < 0)
			try_face(q, page, g, x.id);
		else if (x.level == 0 && !q->far)
			try_leaf(q, page, g, x.id);
		else
			open_node(q, g->boxes + g->first[x.level] + x.id, &x);
	}
}

static void start(query *q, wh_vec3 p, bool far)
{
	const double xyz[3] = {p.x, p.y, p.z};
	q->p = p;
	q->far = far;
	for (int k = 0; k < 3 && !far; k++) {
		const float x = (float)xyz[k], slack = fabsf(x) * QUERY_SLACK + FLT_MIN;
		q->lo[k] = (lanes){0} + (x - slack);
		q->hi[k] = (lanes){0} + (x + slack);
	}
	q->best = INFINITY;
	set_limit(q, INFINITY);
	q->tried = 0;
	q->face = (wh_bvh_face){0, 0};
	q->depth = 0;
}

static wh_code search(wh_ctx *c, wh_bvh_reader *r, query *q)
{
	const wh_bvh *t = r->t;
	q->stack[q->depth++] = (todo){0, t->levels - 1, 0};
	while (q->depth > 0) {
		const todo x = q->stack[--q->depth];
		if (x.bound >= q->limit)
			continue;
		if (x.level >= 0) {
			open_node(q, t->nodes + t->first[x.level] + x.id, &x);
			continue;
		}
		const wh_page *g = wh_bvh_page(c, r, x.id);
		if (!g)
			return wh_failed(c);
		search_page(q, x.id, g);
	}
	return WH_OK;
}

/* ---- neighbourhoods ------------------------------------------------------------------------- */

enum {
	USES_LEAST = 3, /* fewer are not worth it: then ... */
	PAUSE = 32      /* ... so many queries pass before the next one */
};

/* Its radius beyond the distance at its centre, in sizes of a leaf, and in steps from point to
 * point. */
static const double LEAVES = 1, STEPS = 3;

/* Forgets what an earlier row of points left. */
static void start_row(wh_bvh_around *a, wh_vec3 p)
{
	a->last = p;
	a->step = 0;
	a->radius = 0;
	a->n = a->pause = 0;
	a->uses = USES_LEAST;
}

/* Everything that may be nearer than the best is inside. */
static bool is_inside(const wh_bvh_around *a, const query *q)
{
	const double slack = 1 + 1e-9;
	if (!(a->radius > 0))
		return false;
	return (wh_norm(wh_sub(q->p, a->centre)) + sqrt(q->best)) * slack <= a->radius;
}

static wh_code search_around(wh_ctx *c, wh_bvh_reader *r, query *q)
{
	wh_bvh_around *a = &r->around;
	a->uses++;
	for (uint32_t s = 0; s < a->n; s += 4) {
		const lanes bound = bound_boxes(q, &a->boxes[s / WH_BOXES], s % WH_BOXES);
		for (unsigned near = bits_of(bound < q->short_limit); near; near &= near - 1) {
			const int lane = __builtin_ctz(near);
			const uint32_t i = s + (uint32_t)lane;
			if ((double)bound[lane] >= q->limit)
				continue;
			const wh_page *g = wh_bvh_page(c, r, a->leaf[i].page);
			if (!g)
				return wh_failed(c);
			try_leaf(q, a->leaf[i].page, g, a->leaf[i].node);
		}
	}
	return WH_OK;
}

/* Adds a leaf, whose box is in `slot` of a node. */
static void add_leaf(wh_bvh_around *a, uint32_t page, uint32_t leaf, const wh_boxes *n,
                     uint32_t slot)
{
	wh_boxes *to = &a->boxes[a->n / WH_BOXES];
	const uint32_t at = a->n % WH_BOXES;
	if (at == 0)
		for (uint32_t s = 0; s < WH_BOXES; s++)
			wh_boxes_set_missing(to, s);
	for (int k = 0; k < 3; k++) {
		to->lo[k][at] = n->lo[k][slot];
		to->hi[k][at] = n->hi[k][slot];
	}
	a->leaf[a->n].page = page;
	a->leaf[a->n++].node = leaf;
}

/* Adds the leaves of a page inside the limit; false when there are too many. */
static bool gather_page(query *q, wh_bvh_around *a, uint32_t page, const wh_page *g)
{
	const int base = q->depth;
	wh_boxes only;
	if (g->levels == 1) {
		wh_boxes_set_child(&only, 0, g->boxes);
		if (a->n < WH_BVH_AROUND)
			add_leaf(a, page, 0, &only, 0);
		return a->n < WH_BVH_AROUND;
	}
	q->stack[q->depth++] = (todo){0, g->levels - 1, 0};
	while (q->depth > base) {
		const todo x = q->stack[--q->depth];
		if (x.level > 0) {
			open_near(q, g->boxes + g->first[x.level] + x.id, &x);
			continue;
		}
		if (a->n == WH_BVH_AROUND)
			return false;
		add_leaf(a, page, x.id, g->boxes + g->first[1] + x.id / WH_BOXES, x.id % WH_BOXES);
	}
	return true;
}

/* All leaves no farther than the limit; WH_OK also where there are too many, and none kept. */
static wh_code gather(wh_ctx *c, wh_bvh_reader *r, query *q)
{
	const wh_bvh *t = r->t;
	wh_bvh_around *a = &r->around;
	a->n = 0;
	q->depth = 0;
	q->stack[q->depth++] = (todo){0, t->levels - 1, 0};
	while (q->depth > 0) {
		const todo x = q->stack[--q->depth];
		if (x.level >= 0) {
			open_near(q, t->nodes + t->first[x.level] + x.id, &x);
			continue;
		}
		const wh_page *g = wh_bvh_page(c, r, x.id);
		if (!g)
			return wh_failed(c);
		if (!gather_page(q, a, x.id, g)) {
			a->radius = 0;
			a->pause = PAUSE;
			return WH_OK;
		}
	}
	return WH_OK;
}

/* The size of the leaf that a face is in. */
static double leaf_size(const wh_page *g, uint32_t face)
{
	const wh_boxes *n = &g->boxes[face / WH_BOXES];
	double size = 0;
	for (int k = 0; k < 3; k++) {
		float lo = INFINITY, hi = -INFINITY;
		for (int s = 0; s < WH_BOXES; s++) {
			lo = n->lo[k][s] < lo ? n->lo[k][s] : lo;
			hi = n->hi[k][s] > hi ? n->hi[k][s] : hi;
		}
		size = (double)(hi - lo) > size ? (double)(hi - lo) : size;
	}
	return size;
}

/* The neighbourhood of the point that has just been found, unless the last ones were of little
 * use. */
static wh_code look_around(wh_ctx *c, wh_bvh_reader *r, query *q)
{
	wh_bvh_around *a = &r->around;
	a->radius = 0;
	if (a->uses < USES_LEAST)
		a->pause = PAUSE;
	a->uses = USES_LEAST;
	if (a->pause > 0) {
		a->pause--;
		return WH_OK;
	}
	const wh_page *g = wh_bvh_page(c, r, q->face.page);
	if (!g)
		return wh_failed(c);
	a->uses = 0;
	a->centre = q->p;
	a->radius = sqrt(q->best) + LEAVES * leaf_size(g, q->face.face) + STEPS * a->step;
	set_limit(q, a->radius * a->radius * (1 + BOUND_SLACK));
	return gather(c, r, q);
}

/* ---- all of it ------------------------------------------------------------------------------ */

static wh_code try_guess(wh_ctx *c, wh_bvh_reader *r, const wh_bvh_face *guess, query *q)
{
	if (guess->page == WH_NONE) {
		start_row(&r->around, q->p);
		return WH_OK;
	}
	const wh_page *g = wh_bvh_page(c, r, guess->page);
	if (!g)
		return wh_failed(c);
	try_face(q, guess->page, g, guess->face);
	return WH_OK;
}

/* A running mean that a single jump does not change much. */
static void note_step(wh_bvh_around *a, wh_vec3 p)
{
	const double step = wh_norm(wh_sub(p, a->last)), most = 3 * a->step;
	a->last = p;
	if (!(a->step > 0))
		a->step = step;
	else
		a->step += ((step < most ? step : most) - a->step) / 16;
}

static wh_code nearest_near(wh_ctx *c, wh_bvh_reader *r, query *q)
{
	note_step(&r->around, q->p);
	if (is_inside(&r->around, q))
		return search_around(c, r, q);
	const wh_code code = search(c, r, q);
	if (code != WH_OK || !(q->best < FLOATS_MOST))
		return code;
	return look_around(c, r, q);
}

static bool is_near(wh_vec3 p)
{
	return fabs(p.x) <= NEAR && fabs(p.y) <= NEAR && fabs(p.z) <= NEAR;
}

wh_code wh_bvh_nearest(wh_ctx *c, wh_bvh_reader *r, wh_vec3 p, wh_bvh_face *near, double *d2)
{
	query q;
	start(&q, p, !is_near(p));
	wh_code code = try_guess(c, r, near, &q);
	if (code == WH_OK)
		code = q.far ? search(c, r, &q) : nearest_near(c, r, &q);
	r->tried += q.tried;
	if (code == WH_OK && !q.far && !(q.best < FLOATS_MOST)) { /* all is far away */
		start(&q, p, true);
		code = search(c, r, &q);
		r->tried += q.tried;
	}
	*near = q.face;
	*d2 = q.best;
	return code;
}
