/*
 * Terrain: a height field on a grid of which parts are missing.
 *
 * A row of cells is kept from the left border to the right one, less at most one interval per
 * hole. Holes sit in a lattice of g x g places, so that a row meets at most g of them, from left
 * to right. A vertex is kept when a cell at it is. Spans of kept vertices and cells, numbered
 * row by row, are all that is remembered (24 bytes each, about (1 + g/2) per row): an id is
 * found by binary search, or at once next to the last one found.
 *
 * Manifold by construction. Two kept cells that touch at a corner only would need two intervals
 * of neighbouring rows that touch without overlapping; but all intervals of a hole hold the
 * hole's middle column, borders stay within the outer sixths, and between two holes, or a hole
 * and a border, at least one cell is kept in both directions. So with h holes there are h + 1
 * boundary loops, and V - E + F = 1 - h.
 *
 * Flat part: a rounded square (|x|^4 + |y|^4 < r^4, area 3.7081 r^2) in the middle.
 */
#include "algo/synth_internal.h"

static const double SIDE = 30000.0;

enum {
	AUTO_HOLES = 5,
	PLACE_MIN = 5,    /* cells across the place of a hole, at least */
	LATTICE_MAX = 100 /* places side by side: WH_SYNTH_MAX_HOLES is its square */
};

_Static_assert(LATTICE_MAX *LATTICE_MAX == WH_SYNTH_MAX_HOLES, "all holes have a place");

/* ---- which cells are kept ---- */

typedef struct interval {
	uint32_t lo, hi; /* lo .. hi-1 */
} interval;

typedef struct cutter {
	uint64_t seed, nholes;
	uint32_t rows, cols;
	uint32_t lattice; /* g */
	wh_permute place; /* holes to places */
} cutter;

static uint32_t lattice_for(uint64_t holes)
{
	uint32_t g = 1;
	while ((uint64_t)g * g < holes)
		g++;
	return g;
}

static cutter cutter_make(const wh_synth *s, uint32_t rows, uint32_t cols)
{
	cutter k = {.seed = s->seed_of_holes, .nholes = s->nholes, .rows = rows, .cols = cols};
	k.lattice = lattice_for(k.nholes);
	k.place = wh_permute_make(k.seed, (uint64_t)k.lattice * k.lattice);
	return k;
}

/* Place number i of g in the middle three fifths of n cells. */
static interval place(uint32_t i, uint32_t g, uint32_t n)
{
	const uint64_t fifth = (n + 4) / 5, middle = n > 2 * fifth ? n - 2 * fifth : 0;
	return (interval){(uint32_t)(fifth + middle * i / g),
	                  (uint32_t)(fifth + middle * (i + 1) / g)};
}

/* How far the border is drawn in, as a share of the width: wavy, and rounded at both ends. */
static double inset(uint64_t seed, double along)
{
	const double wave = 0.025 + 0.024 * synth_noise1(seed, 64.0 + 9.0 * along);
	const double end = along < 0.5 ? along : 1.0 - along;
	if (end >= 0.1)
		return wave;
	const double t = 1.0 - 10.0 * end;
	return wave + 0.1 * (1.0 - sqrt(1.0 - t * t));
}

static interval border(const cutter *k, uint32_t row)
{
	const double along = ((double)row + 0.5) / (double)k->rows;
	const double left = inset(k->seed + 1, along), right = inset(k->seed + 2, along);
	return (interval){(uint32_t)(left * (double)k->cols),
	                  k->cols - (uint32_t)(right * (double)k->cols)};
}

/* One edge of a hole: cells from its middle column, wavy and ragged. */
static double reach(uint64_t seed, uint32_t row, double t, double radius)
{
	const double wave = 1.0 + 0.3 * synth_noise1(seed, 64.0 + 3.0 * t);
	const double ragged = (double)(wh_mix64(seed + row) & 3) - 1.5;
	return radius * sqrt(1.0 - t * t) * wave + ragged;
}

static uint32_t clamp_to(double x, uint32_t low, uint32_t high)
{
	return x <= (double)low ? low : x >= (double)high ? high : (uint32_t)x;
}

/* Cells of this row that the hole in place (i, j) takes: perhaps none. */
static interval hole_cut(const cutter *k, uint32_t i, uint32_t j, uint32_t row)
{
	const uint64_t number = wh_permute_source(&k->place, (uint64_t)j * k->lattice + i);
	const interval across = place(i, k->lattice, k->cols), down = place(j, k->lattice, k->rows);
	if (number >= k->nholes)
		return (interval){0, 0};
	wh_rng rng = wh_rng_seed(k->seed + 16 + number);
	const uint64_t seed = wh_rng_next(&rng);
	const double size = 0.25 + 0.13 * wh_rng_unit(&rng);
	const double cx = 0.45 + 0.1 * wh_rng_unit(&rng), cy = 0.45 + 0.1 * wh_rng_unit(&rng);
	const double width = (double)(across.hi - across.lo), height = (double)(down.hi - down.lo);
	const double t = ((double)(row - down.lo) + 0.5 - cy * height) / (size * height);
	if (t <= -1.0 || t >= 1.0 || row == down.lo || row + 1 == down.hi)
		return (interval){0, 0};
	const double middle = (double)across.lo + cx * width;
	const uint32_t at = (uint32_t)middle;
	const double left = middle - reach(seed, row, t, size * width);
	const double right = middle + reach(seed + 1, row, t, size * width);
	return (interval){clamp_to(left, across.lo + 1, at),
	                  clamp_to(right, at + 1, across.hi - 1)};
}

/* The row of the lattice that this row of cells crosses; g when none. */
static uint32_t lattice_row(const cutter *k, uint32_t row)
{
	for (uint32_t j = 0; j < k->lattice; j++) {
		const interval down = place(j, k->lattice, k->rows);
		if (row >= down.lo && row < down.hi)
			return j;
	}
	return k->lattice;
}

/* Kept cells of one row, left to right: at most LATTICE_MAX + 1 spans. */
static size_t kept_cells(const cutter *k, uint32_t row, interval *out)
{
	interval rest = border(k, row);
	size_t n = 0;
	const uint32_t j = k->nholes ? lattice_row(k, row) : k->lattice;
	for (uint32_t i = 0; j < k->lattice && i < k->lattice; i++) {
		const interval cut = hole_cut(k, i, j, row);
		if (cut.lo == cut.hi)
			continue;
		out[n++] = (interval){rest.lo, cut.lo};
		rest.lo = cut.hi;
	}
	out[n++] = rest;
	return n;
}

static uint64_t count_cells(const cutter *k)
{
	interval kept[LATTICE_MAX + 1];
	uint64_t total = 0;
	for (uint32_t row = 0; row < k->rows; row++) {
		const size_t n = kept_cells(k, row, kept);
		for (size_t i = 0; i < n; i++)
			total += kept[i].hi - kept[i].lo;
	}
	return total;
}

/* ---- ragged grids ---- */

static wh_code ragged_push(wh_ctx *c, synth_ragged *r, uint32_t row, interval in)
{
	const wh_code code = wh_reserve(c, &r->span, &r->cap, r->nspans + 1, sizeof *r->span);
	if (code != WH_OK)
		return code;
	r->span[r->nspans++] = (synth_span){r->total, row, in.lo, in.hi};
	r->total += in.hi - in.lo;
	return WH_OK;
}

/* Span that holds item `id`; the hint is the last answer. */
static const synth_span *ragged_find(const synth_ragged *r, uint64_t id, size_t *hint)
{
	size_t low = 0, high = r->nspans; /* the answer is in low .. high-1 */
	const size_t near = *hint;
	if (r->span[near].first <= id)
		low = near;
	if (near + 2 < r->nspans && r->span[near + 2].first > id)
		high = near + 2;
	while (high - low > 1) {
		const size_t middle = low + (high - low) / 2;
		if (r->span[middle].first <= id)
			low = middle;
		else
			high = middle;
	}
	*hint = low;
	return &r->span[low];
}

/* Number of the item in this row and column, which must be kept. */
static uint64_t ragged_id(const synth_ragged *r, uint32_t row, uint32_t col)
{
	const synth_span *sp = &r->span[r->row_start[row]];
	while (col >= sp->hi)
		sp++;
	return sp->first + (col - sp->lo);
}

/* Vertices of a row: all corners of the kept cells above and below, two sorted lists merged. */
static wh_code push_vertices(wh_ctx *c, synth_ragged *r, uint32_t row, const interval *a, size_t na,
                             const interval *b, size_t nb)
{
	size_t i = 0, j = 0;
	while (i < na || j < nb) {
		interval all = j == nb || (i < na && a[i].lo < b[j].lo) ? a[i] : b[j];
		for (;;) {
			const interval *next = NULL;
			if (i < na && a[i].lo <= all.hi)
				next = &a[i++];
			else if (j < nb && b[j].lo <= all.hi)
				next = &b[j++];
			if (!next)
				break;
			all.hi = next->hi > all.hi ? next->hi : all.hi;
		}
		const wh_code code = ragged_push(c, r, row, (interval){all.lo, all.hi + 1});
		if (code != WH_OK)
			return code;
	}
	return WH_OK;
}

static wh_code fill_rows(wh_ctx *c, wh_synth *s, const cutter *k)
{
	interval kept[2][LATTICE_MAX + 1];
	size_t n[2] = {0, 0}; /* the row above, by parity */
	wh_code code = WH_OK;
	for (uint32_t row = 0; code == WH_OK && row <= k->rows; row++) {
		const uint32_t here = row & 1, above = here ^ 1;
		n[here] = row < k->rows ? kept_cells(k, row, kept[here]) : 0;
		s->cells.row_start[row] = (uint32_t)s->cells.nspans;
		s->vertices.row_start[row] = (uint32_t)s->vertices.nspans;
		for (size_t i = 0; code == WH_OK && i < n[here]; i++)
			code = ragged_push(c, &s->cells, row, kept[here][i]);
		if (code == WH_OK)
			code = push_vertices(c, &s->vertices, row, kept[above], n[above],
			                     kept[here], n[here]);
	}
	return code;
}

static wh_code build_rows(wh_ctx *c, wh_synth *s, const cutter *k)
{
	s->cells.row_start = wh_alloc(c, (size_t)k->rows + 1, sizeof(uint32_t));
	s->vertices.row_start = wh_alloc(c, (size_t)k->rows + 1, sizeof(uint32_t));
	if (!s->cells.row_start || !s->vertices.row_start)
		return c->err.code;
	return fill_rows(c, s, k);
}

/* ---- the grid ---- */

/* Holes that have room in a grid of n x n cells. */
static uint64_t room_for_holes(uint64_t n)
{
	const uint64_t fifth = (n + 4) / 5;
	const uint64_t g = n > 2 * fifth ? (n - 2 * fifth) / PLACE_MIN : 0;
	return g > LATTICE_MAX ? WH_SYNTH_MAX_HOLES : g * g;
}

static wh_code choose_holes(wh_ctx *c, wh_synth *s)
{
	const uint64_t room = room_for_holes((uint64_t)sqrt((double)s->p.faces / 2.0));
	if (s->p.holes == WH_SYNTH_AUTO_HOLES) {
		s->nholes = room < AUTO_HOLES ? room : AUTO_HOLES;
		return WH_OK;
	}
	s->nholes = (uint64_t)s->p.holes;
	if (s->nholes <= room)
		return WH_OK;
	return wh_fail(c, WH_E_USAGE, "%llu faces have room for %llu holes at most",
	               (unsigned long long)s->p.faces, (unsigned long long)room);
}

static uint64_t distance(uint64_t x, uint64_t y)
{
	return x > y ? x - y : y - x;
}

/* Rows and columns so that the kept cells are as near as can be to half the wanted faces: a
 * square grid scaled by the share it keeps, then the widths around it. */
static cutter choose_grid(const wh_synth *s)
{
	const uint64_t want = (s->p.faces + 1) / 2;
	double n = sqrt((double)want);
	cutter best = cutter_make(s, (uint32_t)n, (uint32_t)n);
	for (int i = 0; i < 3; i++) {
		n *= sqrt((double)want / (double)count_cells(&best));
		best = cutter_make(s, (uint32_t)n, (uint32_t)n);
	}
	/* no fewer than the square that choose_holes had in mind */
	const uint32_t rows = best.rows, floor = (uint32_t)sqrt((double)want);
	const uint32_t least = best.cols > floor + 3 ? best.cols - 3 : floor;
	uint64_t off = UINT64_MAX;
	for (uint32_t cols = least; cols <= least + 6; cols++) {
		const cutter k = cutter_make(s, rows, cols);
		const uint64_t d = distance(count_cells(&k), want);
		if (d < off) {
			off = d;
			best = k;
		}
	}
	return best;
}

static wh_code plan(wh_ctx *c, wh_synth *s)
{
	wh_code code = choose_holes(c, s);
	if (code != WH_OK)
		return code;
	const cutter k = choose_grid(s);
	s->dim[0] = k.cols;
	s->dim[1] = k.rows;
	s->spacing = SIDE / (double)k.cols;
	s->flat_at = s->p.flat / 3.7081;
	code = build_rows(c, s, &k);
	s->nv = s->vertices.total;
	s->ncells = s->cells.total;
	return code;
}

/* ---- the surface ---- */

static wh_vec3 param(const wh_synth *s, uint64_t v, synth_cursor *cursor)
{
	const synth_span *sp = ragged_find(&s->vertices, v, &cursor->vertex_span);
	const double col = (double)(sp->lo + (v - sp->first));
	return wh_v3(SIDE * (col / (double)s->dim[0] - 0.5),
	             SIDE * ((double)sp->row / (double)s->dim[1] - 0.5), 0.0);
}

static synth_base base(const wh_synth *s, wh_vec3 at)
{
	double mask = 1.0;
	if (s->p.flat > 0.0) { /* rounded distance from the middle, against the plateau's */
		const double x = at.x / SIDE, y = at.y / SIDE;
		const double far = sqrt(x * x * x * x + y * y * y * y);
		mask = synth_smoothstep((far - s->flat_at) * 20.0);
	}
	return (synth_base){at, wh_v3(0.0, 0.0, 1.0), mask};
}

static void steps(const wh_synth *s, wh_vec3 at, wh_vec3 step[2])
{
	(void)at;
	step[0] = wh_v3(0.5 * s->spacing, 0.0, 0.0);
	step[1] = wh_v3(0.0, 0.5 * s->spacing, 0.0);
}

static void quad(const wh_synth *s, uint64_t cell, synth_cursor *cursor, synth_quad *q)
{
	const synth_span *sp = ragged_find(&s->cells, cell, &cursor->cell_span);
	const uint32_t col = sp->lo + (uint32_t)(cell - sp->first);
	const uint64_t below = ragged_id(&s->vertices, sp->row, col);
	const uint64_t above = ragged_id(&s->vertices, sp->row + 1, col);
	*q = (synth_quad){{below, below + 1, above + 1, above}, 0.0};
}

const synth_shape synth_terrain = {"terrain", 15000.0, 6000.0, plan, param, base, steps, quad};
