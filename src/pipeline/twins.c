/*
 * In steps, of which the first tells whether there is anything to do:
 *
 * - places: vertices at one position have a place, the id of one of them (pipeline/near);
 * - edges: those of faces with an end at a place of several vertices, by the window of one end;
 * - name: places instead of ends, one window at a time, for either end; to buckets by the places;
 * - match: bucket by bucket, of two opposite edges alone between two places ends are copies; to
 *   buckets by the place;
 * - join: bucket by bucket, sets of copies.
 *
 * Records that depend on each other lie in one bucket, and what comes out depends on no order, so
 * windows, buckets and workers decide nothing. Cost: sorting what lies along borders; memory is a
 * window's map and a bucket a worker; disk 32 bytes for each such edge, two times.
 */
#include "pipeline/twins.h"

#include "base/chunks.h"
#include "base/rng.h"
#include "mesh/sets.h"

#include <stdlib.h>
#include <string.h>

enum {
	CHUNK = 32 * 1024,   /* faces a job */
	BUCKET = 128 * 1024, /* records of a bucket, while there are not too many buckets */
	MOST_BUCKETS = 256,
	BLOCK = 256 /* records of a bin's block */
};

/* An edge of a face, from one end to the other. */
typedef struct edge {
	uint64_t end[2], place[2];
} edge;

/* Two vertices at a place that are copies of each other. */
typedef struct copies {
	uint64_t place, a, b;
} copies;

/* What one worker needs. */
typedef struct workspace {
	void *raw;
	uint64_t *ids;
	wh_bins edges;  /* by the window of end[0] */
	wh_bins copies; /* by place */
	void *record;   /* those of a bucket */
	size_t cap;     /* bytes */
	uint64_t *id;   /* different vertices of a place, ... */
	uint32_t *set;  /* ... and the sets they are in */
	size_t id_cap, set_cap;
	uint64_t n; /* edges found */
} workspace;

typedef struct search {
	const wh_exec *ex;
	wh_progress *progress;
	wh_spill *spill;
	const wh_source *source;
	uint64_t window, first; /* the first id of the window at hand */
	uint32_t windows, nbuckets;
	wh_rank *kept;
	wh_rank shared; /* vertices that are not alone at their place */
	wh_near places;
	uint64_t *map; /* places of the window at hand */
	wh_bin_file edge_file, half_file, named_file, copy_file;
	wh_bins half, named;
	workspace *workspace;
	wh_near *twins;
	bool any;
} search;

/* ---- places ------------------------------------------------------------------------------- */

static void set_all(wh_rank *r, uint64_t n)
{
	memset(r->bits, 0xff, (size_t)(n / WH_RANK_WORD) * sizeof *r->bits);
	if (n % WH_RANK_WORD)
		r->bits[n / WH_RANK_WORD] = (UINT64_C(1) << n % WH_RANK_WORD) - 1;
}

static void mark_shared(void *arg, const wh_near_pair *pairs, size_t n)
{
	search *s = arg;
	s->any = s->any || n > 0;
	for (size_t i = 0; i < n; i++) {
		wh_rank_set(&s->shared, pairs[i].id);
		wh_rank_set(&s->shared, pairs[i].as);
	}
}

static wh_code find_places(wh_ctx *c, search *s)
{
	const wh_near_params p = {.window = s->window};
	set_all(s->kept, s->source->nv);
	if (wh_near_find(c, s->ex, s->progress, s->spill, s->source, &p, s->kept, &s->places) !=
	    WH_OK)
		return c->err.code;
	set_all(s->kept, s->source->nv);
	if (wh_rank_open(c, &s->shared, s->source->nv) != WH_OK)
		return c->err.code;
	for (uint32_t w = 0; w < s->windows; w++)
		if (wh_near_pairs(c, &s->places, w, mark_shared, s) != WH_OK)
			return c->err.code;
	return WH_OK;
}

static void take_places(void *arg, const wh_near_pair *pairs, size_t n)
{
	const search *s = arg;
	for (size_t i = 0; i < n; i++)
		s->map[pairs[i].id - s->first] = pairs[i].as;
}

static wh_code load_window(wh_ctx *c, search *s, uint32_t w)
{
	s->first = w * s->window;
	for (uint64_t i = 0; i < s->window; i++)
		s->map[i] = s->first + i;
	return wh_near_pairs(c, &s->places, w, take_places, s);
}

/* ---- edges -------------------------------------------------------------------------------- */

static void *room_of(wh_ctx *c, const search *s, wh_bins *bins, uint64_t id)
{
	return wh_bins_room(c, bins, (uint32_t)(id / s->window));
}

static wh_code take_face(wh_ctx *c, const search *s, workspace *ws, const uint64_t *t)
{
	bool at[3];
	if (t[0] == t[1] || t[1] == t[2] || t[2] == t[0])
		return WH_OK;
	for (int k = 0; k < 3; k++)
		at[k] = wh_rank_get(&s->shared, t[k]);
	for (int k = 0; k < 3; k++) {
		const int next = (k + 1) % 3;
		if (!at[k] && !at[next])
			continue;
		const edge e = {.end = {t[k], t[next]}};
		void *to = room_of(c, s, &ws->edges, t[k]);
		if (!to)
			return c->err.code;
		memcpy(to, &e, sizeof e);
		ws->n++;
	}
	return WH_OK;
}

static wh_code edges_job(wh_ctx *c, void *arg, int64_t index, int worker)
{
	const search *s = arg;
	workspace *ws = &s->workspace[worker];
	const size_t n = wh_chunk_items(s->source->nf, index, CHUNK);
	const wh_code code =
	    wh_source_triangles(c, s->source, (uint64_t)index * CHUNK, n, ws->ids, ws->raw);
	wh_progress_add(s->progress, n);
	if (code != WH_OK)
		return code;
	for (size_t i = 0; i < n; i++)
		if (take_face(c, s, ws, ws->ids + 3 * i) != WH_OK)
			return c->err.code;
	return WH_OK;
}

static wh_code find_edges(wh_ctx *c, search *s)
{
	uint64_t n = 0;
	wh_progress_phase(s->progress, "borders of charts", s->source->nf);
	const wh_code code = wh_exec_for(c, s->ex, wh_chunks(s->source->nf, CHUNK), edges_job, s);
	if (code != WH_OK)
		return code;
	for (int i = 0; i < s->ex->workers; i++) {
		n += s->workspace[i].n;
		if (wh_bins_end(c, &s->workspace[i].edges) != WH_OK)
			return c->err.code;
	}
	const uint64_t buckets = n / BUCKET + 1;
	s->nbuckets = buckets > MOST_BUCKETS ? MOST_BUCKETS : (uint32_t)buckets;
	return WH_OK;
}

/* ---- name --------------------------------------------------------------------------------- */

static uint32_t bucket_of(const search *s, uint64_t a, uint64_t b)
{
	return (uint32_t)((wh_mix64(a ^ wh_mix64(b)) >> 32) * s->nbuckets >> 32);
}

/* An edge whose first end's place is known waits for the window of the other. */
static wh_code name_first(wh_ctx *c, search *s, edge *e)
{
	e->place[0] = s->map[e->end[0] - s->first];
	void *to = room_of(c, s, &s->half, e->end[1]);
	if (to)
		memcpy(to, e, sizeof *e);
	return to ? WH_OK : wh_failed(c);
}

static wh_code name_second(wh_ctx *c, search *s, edge *e)
{
	e->place[1] = s->map[e->end[1] - s->first];
	const uint64_t *p = e->place;
	const uint32_t bucket = bucket_of(s, p[0] < p[1] ? p[0] : p[1], p[0] < p[1] ? p[1] : p[0]);
	void *to = wh_bins_room(c, &s->named, bucket);
	if (to)
		memcpy(to, e, sizeof *e);
	return to ? WH_OK : wh_failed(c);
}

/* Goes through the edges of the window at hand. */
static wh_code name_bin(wh_ctx *c, search *s, const wh_bins *bins, uint32_t w,
                        wh_code (*name)(wh_ctx *c, search *s, edge *e))
{
	edge block[BLOCK];
	for (size_t k = 0; k < bins->bin[w].blocks; k++) {
		size_t n;
		if (wh_bins_read(c, bins, w, k, block, &n) != WH_OK)
			return c->err.code;
		for (size_t i = 0; i < n; i++)
			if (name(c, s, &block[i]) != WH_OK)
				return c->err.code;
	}
	return WH_OK;
}

static wh_code open_names(wh_ctx *c, search *s)
{
	s->map = wh_alloc(c, (size_t)s->window, sizeof *s->map);
	if (!s->map || wh_bin_file_open(c, &s->half_file, s->spill) != WH_OK ||
	    wh_bin_file_open(c, &s->named_file, s->spill) != WH_OK ||
	    wh_bins_open(c, &s->half, &s->half_file, s->windows, sizeof(edge), BLOCK) != WH_OK)
		return wh_failed(c);
	return wh_bins_open(c, &s->named, &s->named_file, s->nbuckets, sizeof(edge), BLOCK);
}

static wh_code name_places(wh_ctx *c, search *s)
{
	if (open_names(c, s) != WH_OK)
		return c->err.code;
	for (uint32_t w = 0; w < s->windows; w++) {
		if (load_window(c, s, w) != WH_OK)
			return c->err.code;
		for (int i = 0; i < s->ex->workers; i++)
			if (name_bin(c, s, &s->workspace[i].edges, w, name_first) != WH_OK)
				return c->err.code;
	}
	wh_bin_file_close(&s->edge_file);
	if (wh_bins_end(c, &s->half) != WH_OK)
		return c->err.code;
	for (uint32_t w = 0; w < s->windows; w++)
		if (load_window(c, s, w) != WH_OK ||
		    name_bin(c, s, &s->half, w, name_second) != WH_OK)
			return c->err.code;
	wh_bin_file_close(&s->half_file);
	wh_free(c, s->map);
	s->map = NULL;
	return wh_bins_end(c, &s->named);
}

/* ---- match -------------------------------------------------------------------------------- */

/* All records of a bucket, of one set of bins, behind the n that are there. */
static wh_code load_bucket(wh_ctx *c, workspace *ws, const wh_bins *bins, uint32_t b, size_t *n)
{
	const size_t blocks = bins->bin[b].blocks;
	if (wh_reserve(c, &ws->record, &ws->cap, (*n + blocks * bins->per_block) * bins->record,
	               1) != WH_OK)
		return c->err.code;
	for (size_t k = 0; k < blocks; k++) {
		size_t got;
		if (wh_bins_read(c, bins, b, k, (char *)ws->record + *n * bins->record, &got) !=
		    WH_OK)
			return c->err.code;
		*n += got;
	}
	return WH_OK;
}

static int compare_ids(uint64_t a, uint64_t b)
{
	return (a > b) - (a < b);
}

static uint64_t low(const edge *e)
{
	return e->place[0] < e->place[1] ? e->place[0] : e->place[1];
}

static uint64_t high(const edge *e)
{
	return e->place[0] < e->place[1] ? e->place[1] : e->place[0];
}

static int compare_edges(const void *a, const void *b)
{
	const edge *x = a, *y = b;
	const int by_low = compare_ids(low(x), low(y));
	return by_low ? by_low : compare_ids(high(x), high(y));
}

static bool same_places(const edge *x, const edge *y)
{
	return low(x) == low(y) && high(x) == high(y);
}

static wh_code note_copies(wh_ctx *c, const search *s, workspace *ws, uint64_t place, uint64_t a,
                           uint64_t b)
{
	const copies pair = {place, a, b};
	if (a == b)
		return WH_OK;
	void *to = wh_bins_room(c, &ws->copies, bucket_of(s, place, 0));
	if (to)
		memcpy(to, &pair, sizeof pair);
	return to ? WH_OK : wh_failed(c);
}

/* Two edges alone between two places. */
static wh_code match_two(wh_ctx *c, const search *s, workspace *ws, const edge *x, const edge *y)
{
	if (x->place[0] != y->place[1] || x->place[0] == x->place[1])
		return WH_OK;
	if (note_copies(c, s, ws, x->place[0], x->end[0], y->end[1]) != WH_OK)
		return c->err.code;
	return note_copies(c, s, ws, x->place[1], x->end[1], y->end[0]);
}

static wh_code match_job(wh_ctx *c, void *arg, int64_t index, int worker)
{
	const search *s = arg;
	workspace *ws = &s->workspace[worker];
	size_t n = 0, end;
	if (load_bucket(c, ws, &s->named, (uint32_t)index, &n) != WH_OK)
		return c->err.code;
	edge *e = ws->record;
	if (n)
		qsort(e, n, sizeof *e, compare_edges);
	for (size_t i = 0; i < n; i = end) {
		for (end = i + 1; end < n && same_places(&e[i], &e[end]); end++)
			;
		if (end == i + 2 && match_two(c, s, ws, &e[i], &e[i + 1]) != WH_OK)
			return c->err.code;
	}
	return WH_OK;
}

static wh_code match_edges(wh_ctx *c, search *s)
{
	if (wh_bin_file_open(c, &s->copy_file, s->spill) != WH_OK)
		return c->err.code;
	for (int i = 0; i < s->ex->workers; i++)
		if (wh_bins_open(c, &s->workspace[i].copies, &s->copy_file, s->nbuckets,
		                 sizeof(copies), BLOCK) != WH_OK)
			return c->err.code;
	if (wh_exec_for(c, s->ex, s->nbuckets, match_job, s) != WH_OK)
		return c->err.code;
	for (int i = 0; i < s->ex->workers; i++)
		if (wh_bins_end(c, &s->workspace[i].copies) != WH_OK)
			return c->err.code;
	wh_bin_file_close(&s->named_file);
	return WH_OK;
}

/* ---- join --------------------------------------------------------------------------------- */

static int compare_copies(const void *a, const void *b)
{
	const copies *x = a, *y = b;
	return compare_ids(x->place, y->place);
}

static int compare_numbers(const void *a, const void *b)
{
	return compare_ids(*(const uint64_t *)a, *(const uint64_t *)b);
}

static uint32_t place_of(const uint64_t *id, size_t n, uint64_t which)
{
	const uint64_t *at = bsearch(&which, id, n, sizeof *id, compare_numbers);
	return (uint32_t)(at - id);
}

static wh_code note_twin(wh_ctx *c, const search *s, int worker, uint64_t id, uint64_t as)
{
	const wh_near_pair pair = {id, as};
	void *to = room_of(c, s, &s->twins->pairs[worker], id);
	if (!to)
		return c->err.code;
	memcpy(to, &pair, sizeof pair);
	wh_rank_clear(s->kept, id);
	return WH_OK;
}

/* The n pairs of one place. */
static wh_code join_place(wh_ctx *c, const search *s, int worker, const copies *pair, size_t n)
{
	workspace *ws = &s->workspace[worker];
	if (wh_reserve(c, &ws->id, &ws->id_cap, 2 * n, sizeof *ws->id) != WH_OK ||
	    wh_reserve(c, &ws->set, &ws->set_cap, 2 * n, sizeof *ws->set) != WH_OK)
		return c->err.code;
	for (size_t i = 0; i < n; i++) {
		ws->id[2 * i] = pair[i].a;
		ws->id[2 * i + 1] = pair[i].b;
	}
	qsort(ws->id, 2 * n, sizeof *ws->id, compare_numbers);
	size_t ids = 0;
	for (size_t i = 0; i < 2 * n; i++)
		if (i == 0 || ws->id[i] != ws->id[ids - 1])
			ws->id[ids++] = ws->id[i];
	wh_sets_init(ws->set, ids);
	for (size_t i = 0; i < n; i++)
		(void)wh_sets_join(ws->set, place_of(ws->id, ids, pair[i].a),
		                   place_of(ws->id, ids, pair[i].b));
	for (uint32_t i = 0; i < ids; i++) {
		const uint32_t root = wh_sets_find(ws->set, i);
		if (root != i && note_twin(c, s, worker, ws->id[i], ws->id[root]) != WH_OK)
			return c->err.code;
	}
	return WH_OK;
}

static wh_code join_job(wh_ctx *c, void *arg, int64_t index, int worker)
{
	const search *s = arg;
	workspace *ws = &s->workspace[worker];
	size_t n = 0, end;
	for (int i = 0; i < s->ex->workers; i++)
		if (load_bucket(c, ws, &s->workspace[i].copies, (uint32_t)index, &n) != WH_OK)
			return c->err.code;
	copies *pair = ws->record;
	if (n)
		qsort(pair, n, sizeof *pair, compare_copies);
	for (size_t i = 0; i < n; i = end) {
		for (end = i + 1; end < n && pair[end].place == pair[i].place; end++)
			;
		if (join_place(c, s, worker, pair + i, end - i) != WH_OK)
			return c->err.code;
	}
	return WH_OK;
}

/* ---- all of it ---------------------------------------------------------------------------- */

size_t wh_twins_bytes(const wh_source *source, int workers, uint64_t window)
{
	const uint64_t windows = source->nv / window + 1;
	const size_t map = (size_t)(window < source->nv ? window : source->nv) * sizeof(uint64_t);
	const size_t each =
	    wh_source_triangle_bytes(source, CHUNK) + (size_t)CHUNK * 3 * sizeof(uint64_t) +
	    (size_t)windows * BLOCK * (sizeof(edge) + sizeof(wh_near_pair)) +
	    (size_t)BUCKET * 2 * sizeof(edge) + (size_t)MOST_BUCKETS * BLOCK * sizeof(copies);
	const size_t near = wh_near_bytes(source, workers, windows);
	const size_t own =
	    map + (size_t)workers * each + (windows + MOST_BUCKETS) * BLOCK * sizeof(edge);
	return wh_rank_bytes(source->nv) + (near > own ? near : own);
}

static wh_code open_twins(wh_ctx *c, search *s)
{
	wh_near *t = s->twins;
	t->pairs = wh_calloc(c, (size_t)s->ex->workers, sizeof *t->pairs);
	t->block = wh_alloc(c, BLOCK, sizeof(wh_near_pair));
	if (!t->pairs || !t->block || wh_bin_file_open(c, &t->file, s->spill) != WH_OK)
		return wh_failed(c);
	t->workers = s->ex->workers;
	for (int i = 0; i < t->workers; i++)
		if (wh_bins_open(c, &t->pairs[i], &t->file, s->windows, sizeof(wh_near_pair),
		                 BLOCK) != WH_OK)
			return c->err.code;
	return WH_OK;
}

static wh_code open_workspaces(wh_ctx *c, search *s)
{
	s->workspace = wh_calloc(c, (size_t)s->ex->workers, sizeof *s->workspace);
	if (!s->workspace || wh_bin_file_open(c, &s->edge_file, s->spill) != WH_OK)
		return wh_failed(c);
	for (int i = 0; i < s->ex->workers; i++) {
		workspace *ws = &s->workspace[i];
		ws->raw = wh_alloc(c, wh_source_triangle_bytes(s->source, CHUNK), 1);
		ws->ids = wh_alloc(c, CHUNK, 3 * sizeof *ws->ids);
		if (!ws->raw || !ws->ids ||
		    wh_bins_open(c, &ws->edges, &s->edge_file, s->windows, sizeof(edge), BLOCK) !=
		        WH_OK)
			return wh_failed(c);
	}
	return WH_OK;
}

static void close_search(wh_ctx *c, search *s)
{
	for (int i = 0; s->workspace && i < s->ex->workers; i++) {
		workspace *ws = &s->workspace[i];
		wh_bins_close(c, &ws->edges);
		wh_bins_close(c, &ws->copies);
		wh_free(c, ws->raw);
		wh_free(c, ws->ids);
		wh_free(c, ws->record);
		wh_free(c, ws->id);
		wh_free(c, ws->set);
	}
	wh_free(c, s->workspace);
	wh_free(c, s->map);
	wh_bins_close(c, &s->half);
	wh_bins_close(c, &s->named);
	wh_bin_file_close(&s->edge_file);
	wh_bin_file_close(&s->half_file);
	wh_bin_file_close(&s->named_file);
	wh_bin_file_close(&s->copy_file);
	wh_rank_close(c, &s->shared);
	wh_near_close(c, &s->places);
}

static wh_code find_copies(wh_ctx *c, search *s)
{
	if (open_workspaces(c, s) != WH_OK)
		return c->err.code;
	const wh_code code = find_edges(c, s);
	if (code != WH_OK)
		return code;
	if (name_places(c, s) != WH_OK || match_edges(c, s) != WH_OK)
		return c->err.code;
	return wh_exec_for(c, s->ex, s->nbuckets, join_job, s);
}

wh_code wh_twins_find(wh_ctx *c, const wh_exec *ex, wh_progress *progress, wh_spill *spill,
                      const wh_source *source, uint64_t window, wh_rank *kept, wh_near *twins)
{
	search s = {.ex = ex,
	            .progress = progress,
	            .spill = spill,
	            .source = source,
	            .window = window,
	            .windows = (uint32_t)(source->nv / window + 1),
	            .kept = kept,
	            .places = {.file = {.fd = -1}},
	            .edge_file = {.fd = -1},
	            .half_file = {.fd = -1},
	            .named_file = {.fd = -1},
	            .copy_file = {.fd = -1},
	            .twins = twins};
	*twins = (wh_near){.window = window, .file = {.fd = -1}};
	wh_code code = find_places(c, &s);
	if (code == WH_OK)
		code = open_twins(c, &s);
	if (code == WH_OK && s.any)
		code = find_copies(c, &s);
	for (int i = 0; code == WH_OK && i < ex->workers; i++)
		code = wh_bins_end(c, &twins->pairs[i]);
	close_search(c, &s);
	return code;
}
