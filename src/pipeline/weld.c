/*
 * Welding out of core. Corners have numbers, in the order of the file; the vertex of a corner is
 * the first corner at its position, its representative.
 *
 *     scatter  corners to buckets by the hash of their positions, in order
 *     match    bucket by bucket, a table of positions tells each corner's representative; corners
 *              that are none go to ranges of corner numbers, with their representative's; those
 *              that are one set their bit
 *     number   bits before a representative's are the number of its vertex
 *     write    range by range, in order: positions of the representatives, then triangles
 *
 * How many buckets and ranges there are has no influence on the result. A bucket is streamed past
 * its table, so that a million corners at one position take no more room than one.
 *
 * Cost: two passes over the facets and one over what is scattered; time is linear.
 */
#include "pipeline/weld.h"

#include "base/bytes.h"
#include "base/rank.h"
#include "mesh/coincident.h"
#include "pipeline/bins.h"

#include <inttypes.h>
#include <math.h>

enum {
	BATCH = 8192,           /* facets read at a time */
	BUCKET = 256 * 1024,    /* corners of a bucket, while there are not too many buckets, ... */
	MOST_BUCKETS = 2048,    /* ... as each has a block being filled */
	RANGE = 3 * 128 * 1024, /* the same for ranges, of which every worker has its own */
	MOST_RANGES = 2048,
	BLOCK = 768,       /* records of a bucket's block, ... */
	RANGE_BLOCK = 256, /* ... and of a range's */
};

/* ---- the work ----------------------------------------------------------------------------- */

/* What one worker needs. */
typedef struct workspace {
	unsigned char *raw; /* BATCH facets */
	double *xyz;        /* their corners */
	size_t n;           /* corners */
	uint32_t *bucket;   /* of each */
	wh_bins ranges;
	unsigned char *block;
	unsigned char *entry; /* different positions of a bucket, with their representatives */
	size_t entries, entry_cap;
	uint32_t *slot; /* table of them: number + 1 */
	size_t slots, slot_cap;
	uint64_t *rep; /* of the corners of a range */
	double *firsts;
} workspace;

typedef struct weld {
	const wh_soup *soup;
	wh_rewrite *rw;
	workspace *workspace;
	uint64_t corners;
	size_t key, id; /* bytes of a position, of a corner's number */
	uint32_t nbuckets, nranges;
	uint64_t range; /* corners */
	wh_bin_file bucket_file, range_file;
	wh_bins buckets;
	wh_rank firsts; /* a bit for each representative */
} weld;

static void put_id(unsigned char *to, uint64_t id, size_t size)
{
	const uint32_t small = (uint32_t)id;
	if (size == 4)
		memcpy(to, &small, 4);
	else
		memcpy(to, &id, 8);
}

static uint64_t get_id(const unsigned char *from, size_t size)
{
	return size == 4 ? wh_load32(from, false) : wh_load64(from, false);
}

/* ---- reading facets ----------------------------------------------------------------------- */

static wh_code check_corner(wh_ctx *c, const weld *w, uint64_t corner, const double *p)
{
	for (int k = 0; k < 3; k++)
		if (!isfinite(p[k]) && !w->rw->ply->keep_invalid)
			return wh_fail(c, WH_E_INPUT,
			               "'%s', facet %" PRIu64 ", corner %d: %c is not a finite "
			               "number; 'reduce --drop-invalid' goes on without such "
			               "facets",
			               w->soup->path, corner / 3, (int)(corner % 3), "xyz"[k]);
	return WH_OK;
}

/* Corners of n facets from number `first` on, into h->xyz. */
static wh_code read_facets(wh_ctx *c, const weld *w, workspace *ws, uint64_t first, size_t n)
{
	const wh_soup *s = w->soup;
	const size_t size = wh_type_size(s->type);
	if (wh_ply_pread(c, s->path, s->fd, ws->raw, (n - 1) * (size_t)s->stride + 9 * size,
	                 s->base + first * s->stride) != WH_OK)
		return c->err.code;
	ws->n = 3 * n;
	for (size_t i = 0; i < n; i++) {
		const unsigned char *from = ws->raw + i * s->stride;
		double *to = ws->xyz + 9 * i;
		for (size_t k = 0; k < 9; k++)
			to[k] = size == 4 ? (double)wh_loadf(from + 4 * k, s->swap)
			                  : wh_loadd(from + 8 * k, s->swap);
	}
	return WH_OK;
}

static size_t batch_facets(const weld *w, uint64_t first)
{
	const uint64_t left = w->soup->facets - first;
	return left < BATCH ? (size_t)left : BATCH;
}

/* ---- scatter ------------------------------------------------------------------------------ */

static wh_code scatter_job(wh_ctx *c, void *arg, int64_t index, int worker)
{
	const weld *w = arg;
	workspace *ws = &w->workspace[worker];
	const uint64_t first = (uint64_t)index * BATCH;
	if (read_facets(c, w, ws, first, batch_facets(w, first)) != WH_OK)
		return c->err.code;
	for (size_t i = 0; i < ws->n; i++) {
		const double *p = ws->xyz + 3 * i;
		if (check_corner(c, w, 3 * first + i, p) != WH_OK)
			return c->err.code;
		const uint64_t high = wh_coincident_hash(wh_v3(p[0], p[1], p[2])) >> 32;
		ws->bucket[i] = (uint32_t)(high * w->nbuckets >> 32);
	}
	return WH_OK;
}

/* -0 becomes 0, so that equal positions have equal bytes. */
static void put_key(unsigned char *to, const double *p, size_t key)
{
	for (size_t k = 0; k < 3; k++) {
		const double d = p[k] + 0.0;
		const float f = (float)d;
		if (key == 12)
			memcpy(to + 4 * k, &f, 4);
		else
			memcpy(to + 8 * k, &d, 8);
	}
}

static wh_code scatter_commit(wh_ctx *c, void *arg, int64_t index, int worker)
{
	weld *w = arg;
	const workspace *ws = &w->workspace[worker];
	const uint64_t first = (uint64_t)index * BATCH * 3;
	for (size_t i = 0; i < ws->n; i++) {
		unsigned char *to = wh_bins_room(c, &w->buckets, ws->bucket[i]);
		if (!to)
			return c->err.code;
		put_key(to, ws->xyz + 3 * i, w->key);
		put_id(to + w->key, first + i, w->id);
	}
	return WH_OK;
}

/* ---- match -------------------------------------------------------------------------------- */

static uint64_t hash_key(const unsigned char *key, size_t size)
{
	uint64_t h = 0;
	for (size_t i = 0; i < size; i += 4)
		h = (h ^ wh_load32(key + i, false)) * 0x9fb21c651e98df25u;
	h ^= h >> 32;
	return h * 0xd6e8feb86659fd93u >> 20;
}

/* The slot of a position: its own, or the empty one where it belongs. */
static uint32_t *find_slot(const weld *w, const workspace *ws, const unsigned char *key)
{
	const size_t each = w->key + w->id;
	for (size_t at = hash_key(key, w->key) & (ws->slots - 1);;
	     at = (at + 1) & (ws->slots - 1)) {
		uint32_t *s = &ws->slot[at];
		if (*s == 0 || memcmp(ws->entry + (size_t)(*s - 1) * each, key, w->key) == 0)
			return s;
	}
}

/* Keeps the table half empty. */
static wh_code grow_table(wh_ctx *c, const weld *w, workspace *ws)
{
	const size_t each = w->key + w->id;
	if (2 * (ws->entries + 1) <= ws->slots)
		return WH_OK;
	const size_t slots = ws->slots ? 2 * ws->slots : 1024;
	if (slots > UINT32_MAX ||
	    wh_renew(c, &ws->slot, &ws->slot_cap, slots, sizeof *ws->slot) != WH_OK) {
		ws->slots = 0;
		return wh_fail(c, WH_E_PLAN, "'%s' has too many vertices to be welded",
		               w->soup->path);
	}
	ws->slots = slots;
	memset(ws->slot, 0, slots * sizeof *ws->slot);
	for (size_t i = 0; i < ws->entries; i++)
		*find_slot(w, ws, ws->entry + i * each) = (uint32_t)i + 1;
	return WH_OK;
}

/* The representative of a record's corner. */
static wh_code match(wh_ctx *c, const weld *w, workspace *ws, const unsigned char *record,
                     uint64_t *rep)
{
	const size_t each = w->key + w->id;
	if (grow_table(c, w, ws) != WH_OK)
		return c->err.code;
	uint32_t *s = find_slot(w, ws, record);
	if (*s == 0) {
		if (wh_reserve(c, &ws->entry, &ws->entry_cap, (ws->entries + 1) * each, 1) != WH_OK)
			return c->err.code;
		memcpy(ws->entry + ws->entries * each, record, each);
		*s = (uint32_t)++ws->entries;
	}
	*rep = get_id(ws->entry + (size_t)(*s - 1) * each + w->key, w->id);
	return WH_OK;
}

/* One record: a bit for a representative, an entry in its range for any other corner. */
static wh_code match_record(wh_ctx *c, weld *w, workspace *ws, const unsigned char *record)
{
	const uint64_t id = get_id(record + w->key, w->id);
	uint64_t rep = 0;
	if (match(c, w, ws, record, &rep) != WH_OK)
		return c->err.code;
	if (rep == id) {
		wh_rank_set(&w->firsts, id);
		return WH_OK;
	}
	unsigned char *to = wh_bins_room(c, &ws->ranges, (uint32_t)(id / w->range));
	if (!to)
		return c->err.code;
	put_id(to, id, w->id);
	put_id(to + w->id, rep, w->id);
	return WH_OK;
}

static wh_code match_job(wh_ctx *c, void *arg, int64_t index, int worker)
{
	weld *w = arg;
	workspace *ws = &w->workspace[worker];
	const uint32_t b = (uint32_t)index;
	ws->entries = 0;
	if (ws->slots)
		memset(ws->slot, 0, ws->slots * sizeof *ws->slot);
	for (size_t k = 0; k < w->buckets.bin[b].blocks; k++) {
		size_t n;
		if (wh_bins_read(c, &w->buckets, b, k, ws->block, &n) != WH_OK)
			return c->err.code;
		for (size_t i = 0; i < n; i++)
			if (match_record(c, w, ws, ws->block + i * w->buckets.record) != WH_OK)
				return c->err.code;
	}
	return WH_OK;
}

/* ---- write -------------------------------------------------------------------------------- */

/* Representatives of the range's corners; by default they are their own. */
static wh_code load_range(wh_ctx *c, const weld *w, workspace *ws, uint32_t k, uint64_t first,
                          size_t n)
{
	for (size_t i = 0; i < n; i++)
		ws->rep[i] = first + i;
	for (int i = 0; i < w->rw->ex->workers; i++) {
		const wh_bins *b = &w->workspace[i].ranges;
		for (size_t j = 0; j < b->bin[k].blocks; j++) {
			size_t got;
			if (wh_bins_read(c, b, k, j, ws->block, &got) != WH_OK)
				return c->err.code;
			for (size_t m = 0; m < got; m++) {
				const unsigned char *from = ws->block + m * b->record;
				ws->rep[get_id(from, w->id) - first] = get_id(from + w->id, w->id);
			}
		}
	}
	return WH_OK;
}

/* Positions of the representatives among the corners of a batch. */
static wh_code write_positions(wh_ctx *c, const weld *w, workspace *ws, const uint64_t *rep,
                               uint64_t first)
{
	size_t n = 0;
	for (size_t i = 0; i < ws->n; i++) {
		if (rep[i] != first + i)
			continue;
		memcpy(ws->firsts + 3 * n++, ws->xyz + 3 * i, 3 * sizeof *ws->xyz);
	}
	return n ? wh_rewrite_put_vertices(c, w->rw, wh_rank_of(&w->firsts, first), ws->firsts, n)
	         : WH_OK;
}

static wh_code add_triangles(wh_ctx *c, const weld *w, wh_facer *f, const uint64_t *rep, size_t n)
{
	for (size_t i = 0; i < n; i += 3) {
		const uint64_t ids[3] = {wh_rank_of(&w->firsts, rep[i]),
		                         wh_rank_of(&w->firsts, rep[i + 1]),
		                         wh_rank_of(&w->firsts, rep[i + 2])};
		if (wh_facer_add(c, f, ids, 3) != WH_OK)
			return c->err.code;
	}
	return WH_OK;
}

static wh_code write_job(wh_ctx *c, void *arg, int64_t index, int worker)
{
	const weld *w = arg;
	workspace *ws = &w->workspace[worker];
	const uint64_t first = (uint64_t)index * w->range, left = w->corners - first;
	const size_t n = left < w->range ? (size_t)left : (size_t)w->range;
	if (load_range(c, w, ws, (uint32_t)index, first, n) != WH_OK)
		return c->err.code;
	for (size_t at = 0; at < n; at += 3 * (size_t)BATCH) {
		const size_t facets = (n - at) / 3 < BATCH ? (n - at) / 3 : BATCH;
		if (read_facets(c, w, ws, (first + at) / 3, facets) != WH_OK ||
		    write_positions(c, w, ws, ws->rep + at, first + at) != WH_OK)
			return c->err.code;
	}
	return add_triangles(c, w, &w->rw->facers[worker], ws->rep, n);
}

static wh_code write_commit(wh_ctx *c, void *arg, int64_t index, int worker)
{
	const weld *w = arg;
	(void)index;
	return wh_rewrite_take(c, w->rw, &w->rw->facers[worker]);
}

/* ---- all of it ---------------------------------------------------------------------------- */

static uint32_t share_out(uint64_t n, uint64_t each, uint32_t most)
{
	const uint64_t k = (n + each - 1) / each;
	return k < 1 ? 1 : k > most ? most : (uint32_t)k;
}

static void plan(weld *w)
{
	w->corners = 3 * w->soup->facets;
	w->key = (size_t)3 * wh_type_size(w->soup->type);
	w->id = w->corners > UINT32_MAX ? 8 : 4;
	w->nbuckets = share_out(w->corners, BUCKET, MOST_BUCKETS);
	const uint32_t ranges = share_out(w->corners, RANGE, MOST_RANGES);
	w->range = (w->soup->facets + ranges - 1) / ranges * 3;
	w->nranges = share_out(w->corners, w->range, MOST_RANGES);
}

static wh_code open_workspace(wh_ctx *c, const weld *w, workspace *ws, wh_bin_file *ranges)
{
	const size_t record = w->key + w->id, block = BLOCK * record, pair = (size_t)2 * w->id;
	ws->raw = wh_alloc(c, BATCH, w->soup->stride);
	ws->xyz = wh_alloc(c, BATCH, 9 * sizeof *ws->xyz);
	ws->bucket = wh_alloc(c, BATCH, 3 * sizeof *ws->bucket);
	ws->block = wh_alloc(c, block > RANGE_BLOCK * pair ? block : RANGE_BLOCK * pair, 1);
	ws->firsts = wh_alloc(c, BATCH, 9 * sizeof *ws->firsts);
	if (!ws->raw || !ws->xyz || !ws->bucket || !ws->block || !ws->firsts)
		return wh_failed(c);
	return wh_bins_open(c, &ws->ranges, ranges, w->nranges, 2 * w->id, RANGE_BLOCK);
}

static wh_code open_weld(wh_ctx *c, weld *w)
{
	wh_spill *spill = w->rw->spill;
	if (wh_bin_file_open(c, &w->bucket_file, spill) != WH_OK ||
	    wh_bin_file_open(c, &w->range_file, spill) != WH_OK)
		return c->err.code;
	w->workspace = wh_calloc(c, (size_t)w->rw->ex->workers, sizeof *w->workspace);
	if (!w->workspace || wh_rank_open(c, &w->firsts, w->corners) != WH_OK)
		return wh_failed(c);
	for (int i = 0; i < w->rw->ex->workers; i++)
		if (open_workspace(c, w, &w->workspace[i], &w->range_file) != WH_OK)
			return c->err.code;
	return wh_bins_open(c, &w->buckets, &w->bucket_file, w->nbuckets, w->key + w->id, BLOCK);
}

static void close_weld(wh_ctx *c, weld *w)
{
	for (int i = 0; w->workspace && i < w->rw->ex->workers; i++) {
		workspace *ws = &w->workspace[i];
		wh_bins_close(c, &ws->ranges);
		wh_free(c, ws->raw);
		wh_free(c, ws->xyz);
		wh_free(c, ws->bucket);
		wh_free(c, ws->block);
		wh_free(c, ws->firsts);
		wh_free(c, ws->entry);
		wh_free(c, ws->slot);
		wh_free(c, ws->rep);
	}
	wh_free(c, w->workspace);
	wh_rank_close(c, &w->firsts);
	wh_bins_close(c, &w->buckets);
	wh_bin_file_close(&w->bucket_file);
	wh_bin_file_close(&w->range_file);
}

/* Tables go, ranges come. */
static wh_code turn_over(wh_ctx *c, weld *w)
{
	wh_bins_close(c, &w->buckets);
	wh_bin_file_close(&w->bucket_file);
	for (int i = 0; i < w->rw->ex->workers; i++) {
		workspace *ws = &w->workspace[i];
		wh_free(c, ws->entry);
		wh_free(c, ws->slot);
		ws->entry = NULL;
		ws->slot = NULL;
		ws->rep = wh_alloc(c, (size_t)w->range, sizeof *ws->rep);
		if (!ws->rep || wh_bins_end(c, &ws->ranges) != WH_OK)
			return wh_failed(c);
	}
	return WH_OK;
}

static wh_code run(wh_ctx *c, weld *w)
{
	const wh_exec *ex = w->rw->ex;
	const int64_t batches = (int64_t)((w->soup->facets + BATCH - 1) / BATCH);
	if (wh_exec_ordered(c, ex, batches, scatter_job, scatter_commit, w) != WH_OK ||
	    wh_bins_end(c, &w->buckets) != WH_OK ||
	    wh_exec_for(c, ex, w->nbuckets, match_job, w) != WH_OK || turn_over(c, w) != WH_OK)
		return c->err.code;
	wh_rewrite_set_vertices(w->rw, wh_rank_count(&w->firsts));
	if (wh_rewrite_start_faces(c, w->rw) != WH_OK)
		return c->err.code;
	return wh_exec_ordered(c, ex, w->nranges, write_job, write_commit, w);
}

wh_code wh_weld(wh_ctx *c, wh_rewrite *rw, const wh_soup *s)
{
	weld w = {.soup = s, .rw = rw, .bucket_file = {.fd = -1}, .range_file = {.fd = -1}};
	plan(&w);
	wh_code code = open_weld(c, &w);
	if (code == WH_OK)
		code = run(c, &w);
	close_weld(c, &w);
	return code;
}
