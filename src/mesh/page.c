#include "mesh/page.h"

#include "base/rng.h"

#include <float.h>
#include <string.h>

enum { HEAD = 2 * sizeof(uint32_t), LINE = 64 };

/* A vertex's place holds its number in the page at hand, and whether a page had it. */
static const uint32_t NOWHERE = (1U << 30) - 1, SEEN = 1U << 31;

/* ---- copies --------------------------------------------------------------------------------- */

/* Of positions; 0 and -0 are one. */
static uint64_t point_hash(wh_vec3 p)
{
	const double xyz[3] = {p.x + 0.0, p.y + 0.0, p.z + 0.0};
	uint64_t hash = 0;
	for (int k = 0; k < 3; k++) {
		uint64_t bits;
		memcpy(&bits, &xyz[k], sizeof bits);
		hash = wh_mix64(hash ^ bits);
	}
	return hash;
}

/* Of a triangle, whatever the order of its corners, and however often one of them is there. */
static uint64_t triangle_hash(wh_vec3 a, wh_vec3 b, wh_vec3 d)
{
	const uint64_t x = point_hash(a), y = point_hash(b), z = point_hash(d);
	const uint64_t sum = x + (y != x ? y : 0) + (z != x && z != y ? z : 0);
	return sum ? sum : 1;
}

/* ---- records -------------------------------------------------------------------------------- */

static size_t coord_bytes(const wh_page_layout *l)
{
	return l->is_double ? sizeof(double) : sizeof(float);
}

static size_t vertex_bytes(const wh_page_layout *l)
{
	return 3 * coord_bytes(l) + (l->coloured ? 3 * sizeof(float) : 0) +
	       (l->numbered ? sizeof(uint64_t) : 0);
}

size_t wh_page_record_bytes(const wh_page_layout *l, uint32_t nv, uint32_t nf)
{
	return HEAD + nv * vertex_bytes(l) + (size_t)nf * 3 * sizeof(uint16_t);
}

wh_code wh_page_maker_begin(wh_ctx *c, wh_page_maker *m, uint32_t nv)
{
	if (wh_renew(c, &m->place, &m->cap, nv ? nv : 1, sizeof *m->place) != WH_OK)
		return c->err.code;
	for (uint32_t v = 0; v < nv; v++)
		m->place[v] = NOWHERE;
	return WH_OK;
}

void wh_page_maker_free(wh_ctx *c, wh_page_maker *m)
{
	wh_free(c, m->place);
	m->place = NULL;
	m->cap = 0;
}

bool wh_page_maker_has(const wh_page_maker *m, uint32_t v)
{
	return m->place[v] & SEEN;
}

/* Lists the vertices that no page had (fresh) or others, behind `nv` of them. */
static uint32_t list_vertices(wh_page_maker *m, const wh_page_soup *soup, const wh_face_item *items,
                              uint32_t n, bool fresh, uint32_t nv)
{
	for (size_t i = 0; i < 3 * (size_t)n; i++) {
		const uint32_t v = soup->tri[3 * (size_t)items[i / 3].face + i % 3];
		uint32_t *place = &m->place[v];
		if ((*place & ~SEEN) != NOWHERE || fresh == ((*place & SEEN) != 0))
			continue;
		*place = (*place & SEEN) | nv;
		m->vertex[nv++] = v;
	}
	return nv;
}

static uint64_t item_hash(const wh_page_soup *soup, const wh_face_item *item)
{
	const uint32_t *t = soup->tri + 3 * (size_t)item->face;
	return triangle_hash(soup->pos[t[0]], soup->pos[t[1]], soup->pos[t[2]]);
}

/* The hash of the triangle that all faces are, or 0. */
static uint64_t find_copies(const wh_page_soup *soup, const wh_face_item *items, uint32_t n)
{
	const uint64_t hash = item_hash(soup, items);
	for (uint32_t i = 1; i < n; i++)
		if (item_hash(soup, items + i) != hash)
			return 0;
	return hash;
}

static uint8_t *put_position(const wh_page_layout *l, wh_vec3 p, uint8_t *at)
{
	const float narrow[3] = {(float)p.x, (float)p.y, (float)p.z};
	memcpy(at, l->is_double ? (const void *)&p : (const void *)narrow, 3 * coord_bytes(l));
	return at + 3 * coord_bytes(l);
}

static uint8_t *put_vertices(const wh_page_maker *m, const wh_page_layout *l,
                             const wh_page_soup *soup, uint32_t nv, uint8_t *at)
{
	for (uint32_t i = 0; i < nv; i++)
		at = put_position(l, soup->pos[m->vertex[i]], at);
	for (uint32_t i = 0; l->coloured && i < nv; i++) {
		memcpy(at, soup->colour + 3 * (size_t)m->vertex[i], 3 * sizeof(float));
		at += 3 * sizeof(float);
	}
	for (uint32_t i = 0; l->numbered && i < nv; i++) {
		const uint64_t id = soup->id ? soup->id[m->vertex[i]] : m->vertex[i];
		memcpy(at, &id, sizeof id);
		at += sizeof id;
	}
	return at;
}

static void add_to_entry(wh_page_entry *e, wh_vec3 a, wh_vec3 b, wh_vec3 d)
{
	e->lo = wh_lower(e->lo, wh_lower(a, wh_lower(b, d)));
	e->hi = wh_upper(e->hi, wh_upper(a, wh_upper(b, d)));
	e->area += 0.5 * wh_norm(wh_cross(wh_sub(b, a), wh_sub(d, a)));
}

static uint8_t *put_faces(const wh_page_maker *m, const wh_page_soup *soup,
                          const wh_face_item *items, wh_page_entry *e, uint8_t *at)
{
	const wh_vec3 some = soup->pos[m->vertex[0]];
	e->lo = e->hi = some;
	e->area = 0;
	for (uint32_t i = 0; i < e->nf; i++) {
		const uint32_t *t = soup->tri + 3 * (size_t)items[i].face;
		uint16_t corner[3];
		for (int k = 0; k < 3; k++)
			corner[k] = (uint16_t)m->place[t[k]];
		memcpy(at, corner, sizeof corner);
		at += sizeof corner;
		add_to_entry(e, soup->pos[t[0]], soup->pos[t[1]], soup->pos[t[2]]);
	}
	return at;
}

size_t wh_page_make(wh_page_maker *m, const wh_page_layout *l, const wh_page_soup *soup,
                    const wh_face_item *items, uint32_t n, uint8_t *record, wh_page_entry *e)
{
	e->nf = n;
	e->copies = find_copies(soup, items, n);
	e->own = list_vertices(m, soup, items, n, true, 0);
	e->nv = list_vertices(m, soup, items, n, false, e->own);
	memcpy(record, &e->nv, sizeof e->nv);
	memcpy(record + sizeof e->nv, &e->nf, sizeof e->nf);
	uint8_t *at = put_vertices(m, l, soup, e->nv, record + HEAD);
	at = put_faces(m, soup, items, e, at);
	for (uint32_t i = 0; i < e->nv; i++)
		m->place[m->vertex[i]] = SEEN | NOWHERE;
	return (size_t)(at - record);
}

wh_vec3 wh_page_vertex(const wh_page_layout *l, const uint8_t *record, uint32_t v)
{
	const uint8_t *at = record + HEAD + (size_t)v * 3 * coord_bytes(l);
	wh_vec3 p;
	if (l->is_double) {
		memcpy(&p, at, sizeof p);
		return p;
	}
	float narrow[3];
	memcpy(narrow, at, sizeof narrow);
	return wh_v3((double)narrow[0], (double)narrow[1], (double)narrow[2]);
}

/* ---- boxes ---------------------------------------------------------------------------------- */

static float float_below(double x)
{
	if (x < -(double)FLT_MAX)
		return -INFINITY;
	if (x > (double)FLT_MAX)
		return FLT_MAX;
	const float f = (float)x;
	return (double)f > x ? nextafterf(f, -INFINITY) : f;
}

static float float_above(double x)
{
	return -float_below(-x);
}

void wh_boxes_set(wh_boxes *n, uint32_t slot, wh_vec3 lo, wh_vec3 hi)
{
	n->lo[0][slot] = float_below(lo.x);
	n->lo[1][slot] = float_below(lo.y);
	n->lo[2][slot] = float_below(lo.z);
	n->hi[0][slot] = float_above(hi.x);
	n->hi[1][slot] = float_above(hi.y);
	n->hi[2][slot] = float_above(hi.z);
}

void wh_boxes_set_missing(wh_boxes *n, uint32_t slot)
{
	for (int k = 0; k < 3; k++) {
		n->lo[k][slot] = INFINITY;
		n->hi[k][slot] = -INFINITY;
	}
}

void wh_boxes_set_child(wh_boxes *n, uint32_t slot, const wh_boxes *child)
{
	wh_boxes_set_missing(n, slot);
	for (int k = 0; k < 3; k++) {
		for (int s = 0; s < WH_BOXES; s++) {
			const float lo = child->lo[k][s], hi = child->hi[k][s];
			n->lo[k][slot] = lo < n->lo[k][slot] ? lo : n->lo[k][slot];
			n->hi[k][slot] = hi > n->hi[k][slot] ? hi : n->hi[k][slot];
		}
	}
}

uint32_t wh_boxes_over(uint32_t children)
{
	return children / WH_BOXES + (children % WH_BOXES != 0);
}

uint32_t wh_boxes_layout(uint32_t children, uint32_t *first, int *levels)
{
	uint32_t total = 0;
	*levels = 0;
	do {
		children = wh_boxes_over(children);
		first[(*levels)++] = total;
		total += children;
	} while (children > 1);
	return total;
}

/* ---- opened pages --------------------------------------------------------------------------- */

static size_t aligned(size_t bytes)
{
	return (bytes + LINE - 1) / LINE * LINE;
}

size_t wh_page_bytes(const wh_page_layout *l, uint32_t nv, uint32_t nf)
{
	uint32_t first[WH_PAGE_LEVELS];
	int levels;
	return aligned(nv * sizeof(wh_vec3)) +
	       wh_boxes_layout(nf, first, &levels) * sizeof(wh_boxes) +
	       aligned(l->coloured ? (size_t)nv * 3 * sizeof(float) : 0) +
	       aligned(l->numbered ? nv * sizeof(uint64_t) : 0) +
	       aligned((size_t)nf * 3 * sizeof(uint16_t));
}

/* Takes the next piece of a block. */
static void *take(uint8_t **block, size_t bytes)
{
	void *const at = *block;
	*block += aligned(bytes);
	return bytes ? at : NULL;
}

static void lay_out(const wh_page_layout *l, void *block, wh_page *p)
{
	uint8_t *at = block;
	const uint32_t nodes = wh_boxes_layout(p->nf, p->first, &p->levels);
	p->pos = take(&at, p->nv * sizeof *p->pos);
	p->boxes = take(&at, nodes * sizeof *p->boxes);
	p->colour = take(&at, l->coloured ? (size_t)p->nv * 3 * sizeof(float) : 0);
	p->id = take(&at, l->numbered ? p->nv * sizeof(uint64_t) : 0);
	p->tri = take(&at, (size_t)p->nf * 3 * sizeof *p->tri);
}

static uint64_t face_hash(const wh_page *p, uint32_t face)
{
	const uint16_t *t = p->tri + 3 * (size_t)face;
	return triangle_hash(p->pos[t[0]], p->pos[t[1]], p->pos[t[2]]);
}

static void set_face(const wh_page *p, uint32_t face, wh_boxes *n, uint32_t slot)
{
	const uint16_t *t = p->tri + 3 * (size_t)face;
	const wh_vec3 a = p->pos[t[0]], b = p->pos[t[1]], d = p->pos[t[2]];
	wh_boxes_set(n, slot, wh_lower(a, wh_lower(b, d)), wh_upper(a, wh_upper(b, d)));
}

static bool same_box(const wh_boxes *n, uint32_t slot, const wh_boxes *m, uint32_t other)
{
	for (int k = 0; k < 3; k++)
		if (n->lo[k][slot] != m->lo[k][other] || n->hi[k][slot] != m->hi[k][other])
			return false;
	return true;
}

/* Boxes of the faces; `last` is the last face that has one. */
static void make_leaves(wh_page *p)
{
	const uint32_t slots = wh_boxes_over(p->nf) * WH_BOXES;
	for (uint32_t i = 0, last = 0; i < slots; i++) {
		wh_boxes *n = &p->boxes[i / WH_BOXES];
		if (i >= p->nf) {
			wh_boxes_set_missing(n, i % WH_BOXES);
			continue;
		}
		set_face(p, i, n, i % WH_BOXES);
		if (i > 0 &&
		    same_box(n, i % WH_BOXES, &p->boxes[last / WH_BOXES], last % WH_BOXES) &&
		    face_hash(p, i) == face_hash(p, last))
			wh_boxes_set_missing(n, i % WH_BOXES);
		else
			last = i;
	}
}

static void make_boxes(wh_page *p)
{
	uint32_t children = wh_boxes_over(p->nf);
	make_leaves(p);
	for (int level = 1; level < p->levels; level++) {
		wh_boxes *node = p->boxes + p->first[level];
		const uint32_t nodes = wh_boxes_over(children);
		for (uint32_t i = 0; i < nodes * WH_BOXES; i++) {
			if (i >= children)
				wh_boxes_set_missing(&node[i / WH_BOXES], i % WH_BOXES);
			else
				wh_boxes_set_child(&node[i / WH_BOXES], i % WH_BOXES,
				                   p->boxes + p->first[level - 1] + i);
		}
		children = nodes;
	}
}

static bool corners_are_good(const wh_page *p)
{
	uint32_t most = 0;
	for (size_t i = 0; i < 3 * (size_t)p->nf; i++)
		most = p->tri[i] > most ? p->tri[i] : most;
	return most < p->nv;
}

bool wh_page_open(const wh_page_layout *l, const wh_page_entry *e, const uint8_t *record,
                  double mul, wh_vec3 sub, bool boxes, void *block, wh_page *p)
{
	uint32_t counts[2];
	memcpy(counts, record, sizeof counts);
	if (counts[0] != e->nv || counts[1] != e->nf)
		return false;
	*p = (wh_page){.nv = e->nv, .nf = e->nf};
	lay_out(l, block, p);
	for (uint32_t v = 0; v < p->nv; v++)
		p->pos[v] = wh_sub(wh_scale(wh_page_vertex(l, record, v), mul), sub);
	const uint8_t *at = record + HEAD + (size_t)p->nv * 3 * coord_bytes(l);
	if (l->coloured)
		memcpy(p->colour, at, (size_t)p->nv * 3 * sizeof(float));
	at += l->coloured ? (size_t)p->nv * 3 * sizeof(float) : 0;
	if (l->numbered)
		memcpy(p->id, at, p->nv * sizeof(uint64_t));
	at += l->numbered ? p->nv * sizeof(uint64_t) : 0;
	memcpy(p->tri, at, (size_t)p->nf * 3 * sizeof *p->tri);
	if (!corners_are_good(p))
		return false;
	if (boxes)
		make_boxes(p);
	return true;
}
