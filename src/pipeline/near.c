/*
 * Idea. Space is cut into cells, some times as wide as the distance d. A cell has one of eight
 * colours, by whether its three indices are odd; vertices are gone through by the colour of their
 * cells, then by id. Cells of one colour are a whole cell apart, so what happens in one does not
 * touch the others: the order of cells does not matter, and the greedy rule (stay unless one that
 * stayed before is within d) is the same in parallel. This is a maximal independent set by colours
 * instead of random ranks (Blelloch, Fineman & Shun 2012).
 *
 * What becomes of a vertex depends on its cell and the cells next to it of lower colours, whose
 * vertices depend on cells next to those ...: eight colours are seven steps. So whoever has a block
 * of cells, and all vertices up to seven cells around it, knows everything about the block.
 * Vertices are dealt to buckets by the hash of their block, with copies for blocks that they are
 * near to; then each bucket is settled by itself. How many buckets there are and how large the
 * blocks, has no influence on the result, and a copy that lacks neighbours itself decides nothing.
 *
 * A bucket is streamed past its table once for each colour; the table holds vertices that stay,
 * chained by the hash of their cells: a million vertices within d of each other take the room of
 * one. With a distance of 0 a vertex's cell is its position, and there is one colour.
 *
 * Cost. Linear in the vertices, as long as no ball of radius d holds very many that stay, which it
 * cannot: they are d apart. Copies: from 1.1 times as many records as vertices with a d of a
 * millionth of the mesh's size, to 3 times with one of a thousandth.
 */
#include "pipeline/near.h"

#include "base/chunks.h"
#include "base/rng.h"
#include "mesh/coincident.h"

#include <math.h>
#include <string.h>

enum {
	CHUNK = 32 * 1024,   /* vertices a job */
	BUCKET = 256 * 1024, /* vertices of a bucket, while there are not too many buckets, ... */
	MOST_BUCKETS = 1024, /* ... as each has a block being filled */
	BLOCK = 256,         /* records of a bucket's block */
	PAIRS = 256,         /* of a window's block */
	HALO = 7,            /* cells around a block */
	SHIFT_LEAST = 5,     /* cells along a block, as powers of two */
	SHIFT_MOST = 10,
	COPIES = 8, /* blocks that a vertex is in or near to, at most */
	COLOURS = 8,
	TABLE_EACH = 48 /* bytes of a vertex in a table */
};

#define CELL 8.0          /* distances along a cell */
#define REACH 0.1875      /* of a cell: a distance, and what rounding may take away */
#define MOST_CELLS 0x1p49 /* an index of a cell: its error stays below what REACH has room for */
#define BLOCKS 64.0       /* along the mesh, where blocks may have the size */
#define LEAST_DISTANCE 1e-290

/* Ids of records: three bits of colour, and one for a vertex that is at home in the bucket. */
#define HOME (UINT64_C(1) << 63)
#define COLOUR_BIT 60
#define ID_MASK ((UINT64_C(1) << COLOUR_BIT) - 1)

/* A vertex that stays, in a bucket's table. */
typedef struct entry {
	double p[3];
	uint64_t id;
	uint32_t next; /* in the chain: its number + 1, or 0 */
} entry;

/* Where a vertex of the chunk at hand is to go. */
typedef struct copy {
	uint32_t bucket, index;
	bool home;
} copy;

/* What one worker needs. */
typedef struct workspace {
	void *raw;
	double *xyz;
	uint64_t *tag; /* id and colour of each of the chunk's vertices */
	copy *copies;
	size_t n_copies;
	unsigned char *block;
	entry *entry;
	size_t entries, entry_cap;
	uint32_t *slot; /* first of a chain: its number + 1, or 0 */
	size_t slots, slot_cap;
} workspace;

typedef struct search {
	const wh_source *source;
	wh_progress *progress;
	wh_rank *kept;
	wh_near *out;
	workspace *workspace;
	bool exact;
	double per_cell;     /* cells a unit */
	double per_distance; /* distances a unit */
	int shift;           /* cells along a block */
	uint32_t nbuckets;
	size_t key, record; /* bytes */
	wh_bin_file file;
	wh_bins buckets;
} search;

/* ---- cells -------------------------------------------------------------------------------- */

typedef struct cell {
	int64_t at[3];
} cell;

static cell cell_of(const search *s, const double *p)
{
	cell k;
	for (int i = 0; i < 3; i++)
		k.at[i] = (int64_t)floor(p[i] * s->per_cell);
	return k;
}

static uint64_t hash_cell(const int64_t *at)
{
	return wh_mix64(wh_mix64(wh_mix64((uint64_t)at[0]) ^ (uint64_t)at[1]) ^ (uint64_t)at[2]);
}

static uint64_t colour_of(const cell *k)
{
	return (uint64_t)((k->at[0] & 1) | (k->at[1] & 1) << 1 | (k->at[2] & 1) << 2);
}

static uint32_t bucket_of(const search *s, uint64_t hash)
{
	return (uint32_t)((hash >> 32) * s->nbuckets >> 32);
}

/* ---- scatter ------------------------------------------------------------------------------ */

/* Blocks along an axis that cell `at` is in, the first, or near to: one or two. */
static int blocks_near(const search *s, int64_t at, int64_t *block)
{
	const int64_t size = (int64_t)1 << s->shift, within = at & (size - 1);
	block[0] = at >> s->shift;
	block[1] = within < HALO ? block[0] - 1 : block[0] + 1;
	return within < HALO || within >= size - HALO ? 2 : 1;
}

static void add_copies(const search *s, workspace *ws, const cell *k, uint32_t index)
{
	int64_t block[3][2];
	int n[3];
	for (int i = 0; i < 3; i++)
		n[i] = blocks_near(s, k->at[i], block[i]);
	for (int x = 0; x < n[0]; x++)
		for (int y = 0; y < n[1]; y++)
			for (int z = 0; z < n[2]; z++) {
				const int64_t at[3] = {block[0][x], block[1][y], block[2][z]};
				ws->copies[ws->n_copies++] = (copy){
				    bucket_of(s, hash_cell(at)), index, x == 0 && y == 0 && z == 0};
			}
}

static wh_code scatter_job(wh_ctx *c, void *arg, int64_t index, int worker)
{
	const search *s = arg;
	workspace *ws = &s->workspace[worker];
	const uint64_t first = (uint64_t)index * CHUNK;
	const size_t n = wh_chunk_items(s->source->nv, index, CHUNK);
	ws->n_copies = 0;
	if (wh_source_vertices(c, s->source, first, n, ws->xyz, ws->raw) != WH_OK)
		return c->err.code;
	for (uint32_t i = 0; i < n; i++) {
		const double *p = ws->xyz + 3 * (size_t)i;
		if (!wh_rank_get(s->kept, first + i))
			continue;
		ws->tag[i] = first + i;
		if (s->exact) {
			const uint64_t hash = wh_coincident_hash(wh_v3(p[0], p[1], p[2]));
			ws->copies[ws->n_copies++] = (copy){bucket_of(s, hash), i, true};
			continue;
		}
		const cell k = cell_of(s, p);
		ws->tag[i] |= colour_of(&k) << COLOUR_BIT;
		add_copies(s, ws, &k, i);
	}
	return WH_OK;
}

static void put_record(const search *s, unsigned char *to, const double *p, uint64_t tag)
{
	const float narrow[3] = {(float)p[0], (float)p[1], (float)p[2]};
	if (s->key == sizeof narrow)
		memcpy(to, narrow, sizeof narrow);
	else
		memcpy(to, p, 3 * sizeof *p);
	memcpy(to + s->key, &tag, sizeof tag);
}

static uint64_t get_record(const search *s, const unsigned char *from, double *p)
{
	float narrow[3];
	uint64_t tag;
	if (s->key == sizeof narrow) {
		memcpy(narrow, from, sizeof narrow);
		for (int i = 0; i < 3; i++)
			p[i] = (double)narrow[i];
	} else {
		memcpy(p, from, 3 * sizeof *p);
	}
	memcpy(&tag, from + s->key, sizeof tag);
	return tag;
}

static wh_code scatter_commit(wh_ctx *c, void *arg, int64_t index, int worker)
{
	search *s = arg;
	const workspace *ws = &s->workspace[worker];
	for (size_t i = 0; i < ws->n_copies; i++) {
		const copy *k = &ws->copies[i];
		unsigned char *to = wh_bins_room(c, &s->buckets, k->bucket);
		if (!to)
			return c->err.code;
		put_record(s, to, ws->xyz + 3 * (size_t)k->index,
		           ws->tag[k->index] | (k->home ? HOME : 0));
	}
	wh_progress_add(s->progress, wh_chunk_items(s->source->nv, index, CHUNK));
	return WH_OK;
}

/* ---- a bucket's table --------------------------------------------------------------------- */

static uint64_t hash_place(const search *s, const double *p)
{
	if (s->exact)
		return wh_coincident_hash(wh_v3(p[0], p[1], p[2]));
	const cell k = cell_of(s, p);
	return hash_cell(k.at);
}

static void chain(const search *s, workspace *ws, uint32_t number)
{
	entry *e = &ws->entry[number];
	uint32_t *slot = &ws->slot[hash_place(s, e->p) & (ws->slots - 1)];
	e->next = *slot;
	*slot = number + 1;
}

/* Keeps half of the slots empty. */
static wh_code make_room(wh_ctx *c, const search *s, workspace *ws)
{
	if (wh_reserve(c, &ws->entry, &ws->entry_cap, ws->entries + 1, sizeof *ws->entry) != WH_OK)
		return c->err.code;
	if (2 * (ws->entries + 1) <= ws->slots)
		return WH_OK;
	const size_t slots = ws->slots ? 2 * ws->slots : 1024;
	ws->slots = 0;
	if (slots > UINT32_MAX / 2)
		return wh_fail(c, WH_E_PLAN, "'%s' has too many vertices to be welded",
		               s->source->path);
	if (wh_renew(c, &ws->slot, &ws->slot_cap, slots, sizeof *ws->slot) != WH_OK)
		return c->err.code;
	ws->slots = slots;
	memset(ws->slot, 0, slots * sizeof *ws->slot);
	for (uint32_t i = 0; i < ws->entries; i++)
		chain(s, ws, i);
	return WH_OK;
}

/* Square of the distance, of which 1 is the limit. */
static double distance_sq(const search *s, const double *p, const double *q)
{
	double sum = 0;
	for (int i = 0; i < 3; i++) {
		const double d = (p[i] - q[i]) * s->per_distance;
		sum += d * d;
	}
	return sum;
}

/* The nearest that stays, of those in a chain. */
static void look_in_chain(const search *s, const workspace *ws, uint64_t hash, const double *p,
                          const entry **best, double *best_sq)
{
	for (uint32_t i = ws->slot[hash & (ws->slots - 1)]; i; i = ws->entry[i - 1].next) {
		const entry *e = &ws->entry[i - 1];
		if (s->exact) {
			if (e->p[0] == p[0] && e->p[1] == p[1] && e->p[2] == p[2])
				*best = e;
			continue;
		}
		const double sq = distance_sq(s, p, e->p);
		if (sq > 1 || (*best && (sq > *best_sq || (sq == *best_sq && e->id > (*best)->id))))
			continue;
		*best = e;
		*best_sq = sq;
	}
}

/* The one that a vertex becomes; NULL: none. */
static const entry *find_near(const search *s, const workspace *ws, const double *p)
{
	const entry *best = NULL;
	double best_sq = 0;
	int64_t lo[3], hi[3], at[3];
	if (ws->slots == 0)
		return NULL;
	if (s->exact) {
		look_in_chain(s, ws, hash_place(s, p), p, &best, &best_sq);
		return best;
	}
	for (int i = 0; i < 3; i++) {
		lo[i] = (int64_t)floor(p[i] * s->per_cell - REACH);
		hi[i] = (int64_t)floor(p[i] * s->per_cell + REACH);
	}
	for (at[0] = lo[0]; at[0] <= hi[0]; at[0]++)
		for (at[1] = lo[1]; at[1] <= hi[1]; at[1]++)
			for (at[2] = lo[2]; at[2] <= hi[2]; at[2]++)
				look_in_chain(s, ws, hash_cell(at), p, &best, &best_sq);
	return best;
}

/* ---- match -------------------------------------------------------------------------------- */

static wh_code note_pair(wh_ctx *c, const search *s, int worker, uint64_t id, uint64_t as)
{
	const wh_near_pair pair = {id, as};
	wh_bins *bins = &s->out->pairs[worker];
	unsigned char *to = wh_bins_room(c, bins, (uint32_t)(id / s->out->window));
	if (!to)
		return c->err.code;
	memcpy(to, &pair, sizeof pair);
	wh_rank_clear(s->kept, id);
	return WH_OK;
}

/* A copy of a vertex may meet the other one, where two blocks share a bucket: then it is known what
 * becomes of both. */
static wh_code settle(wh_ctx *c, const search *s, workspace *ws, int worker, const double *p,
                      uint64_t tag)
{
	const uint64_t id = tag & ID_MASK;
	const entry *as = find_near(s, ws, p);
	if (as)
		return as->id != id && (tag & HOME) ? note_pair(c, s, worker, id, as->id) : WH_OK;
	if (make_room(c, s, ws) != WH_OK)
		return c->err.code;
	const uint32_t number = (uint32_t)ws->entries++;
	ws->entry[number] = (entry){.p = {p[0], p[1], p[2]}, .id = id};
	chain(s, ws, number);
	return WH_OK;
}

static wh_code settle_colour(wh_ctx *c, const search *s, workspace *ws, int worker, uint32_t bucket,
                             uint64_t colour)
{
	for (size_t k = 0; k < s->buckets.bin[bucket].blocks; k++) {
		size_t n;
		double p[3];
		if (wh_bins_read(c, &s->buckets, bucket, k, ws->block, &n) != WH_OK)
			return c->err.code;
		for (size_t i = 0; i < n; i++) {
			const uint64_t tag = get_record(s, ws->block + i * s->record, p);
			if ((tag >> COLOUR_BIT & (COLOURS - 1)) == colour &&
			    settle(c, s, ws, worker, p, tag) != WH_OK)
				return c->err.code;
		}
	}
	return WH_OK;
}

static wh_code match_job(wh_ctx *c, void *arg, int64_t index, int worker)
{
	const search *s = arg;
	workspace *ws = &s->workspace[worker];
	const uint32_t bucket = (uint32_t)index;
	ws->entries = 0;
	if (ws->slots)
		memset(ws->slot, 0, ws->slots * sizeof *ws->slot);
	for (uint64_t colour = 0; colour < (s->exact ? 1 : COLOURS); colour++)
		if (settle_colour(c, s, ws, worker, bucket, colour) != WH_OK)
			return c->err.code;
	wh_progress_add(s->progress, s->source->nv / s->nbuckets);
	return WH_OK;
}

/* ---- measures ----------------------------------------------------------------------------- */

static uint32_t bucket_count(const wh_source *source, uint64_t each)
{
	const uint64_t k = source->nv / (each ? each : BUCKET) + 1;
	return k > MOST_BUCKETS ? MOST_BUCKETS : (uint32_t)k;
}

static size_t record_bytes(const wh_source *source)
{
	return (source->is_double ? 24 : 12) + sizeof(uint64_t);
}

static double longest_side(const wh_near_params *p)
{
	return fmax(p->hi.x - p->lo.x, fmax(p->hi.y - p->lo.y, p->hi.z - p->lo.z));
}

static double farthest(const wh_near_params *p)
{
	const double lo = fmax(fabs(p->lo.x), fmax(fabs(p->lo.y), fabs(p->lo.z)));
	const double hi = fmax(fabs(p->hi.x), fmax(fabs(p->hi.y), fabs(p->hi.z)));
	return fmax(lo, hi);
}

static wh_code choose_cells(wh_ctx *c, search *s, const wh_near_params *p)
{
	s->exact = p->distance == 0;
	if (s->exact)
		return WH_OK;
	s->per_distance = 1 / p->distance;
	s->per_cell = s->per_distance / CELL;
	if (p->distance < LEAST_DISTANCE || farthest(p) * s->per_cell >= MOST_CELLS)
		return wh_fail(
		    c, WH_E_USAGE,
		    "%g is too small a distance to weld vertices of '%s' within, whose "
		    "coordinates go up to %g: use 0, for equal positions, or more than %g",
		    p->distance, s->source->path, farthest(p), farthest(p) / MOST_CELLS / CELL);
	const double cells = longest_side(p) * s->per_cell / BLOCKS;
	s->shift = cells > 1 ? ilogb(cells) : 0;
	s->shift = s->shift < SHIFT_LEAST  ? SHIFT_LEAST
	           : s->shift > SHIFT_MOST ? SHIFT_MOST
	                                   : s->shift;
	return WH_OK;
}

static size_t workspace_bytes(const wh_source *source)
{
	return wh_source_vertex_bytes(source, CHUNK) +
	       CHUNK * (3 * sizeof(double) + sizeof(uint64_t) + COPIES * sizeof(copy)) +
	       BLOCK * record_bytes(source);
}

size_t wh_near_bytes(const wh_source *source, int workers, uint64_t windows)
{
	const uint64_t of_bucket = source->nv / bucket_count(source, 0) + 1;
	const size_t table = (size_t)(of_bucket * TABLE_EACH);
	return (size_t)workers *
	           (workspace_bytes(source) + 2 * table +
	            (size_t)windows * (PAIRS * sizeof(wh_near_pair) + sizeof(wh_bin))) +
	       bucket_count(source, 0) * (BLOCK * record_bytes(source) + 8 * sizeof(wh_bin));
}

uint64_t wh_near_disk(const wh_source *source)
{
	return source->nv * (record_bytes(source) * 3 / 2 + sizeof(wh_near_pair));
}

/* ---- all of it ---------------------------------------------------------------------------- */

static wh_code open_workspaces(wh_ctx *c, search *s, int workers, uint32_t windows)
{
	s->workspace = wh_calloc(c, (size_t)workers, sizeof *s->workspace);
	s->out->pairs = wh_calloc(c, (size_t)workers, sizeof *s->out->pairs);
	if (!s->workspace || !s->out->pairs)
		return wh_failed(c);
	s->out->workers = workers;
	for (int i = 0; i < workers; i++) {
		workspace *ws = &s->workspace[i];
		ws->raw = wh_alloc(c, wh_source_vertex_bytes(s->source, CHUNK), 1);
		ws->xyz = wh_alloc(c, CHUNK, 3 * sizeof *ws->xyz);
		ws->tag = wh_alloc(c, CHUNK, sizeof *ws->tag);
		ws->copies = wh_alloc(c, CHUNK, COPIES * sizeof *ws->copies);
		ws->block = wh_alloc(c, BLOCK, s->record);
		if (!ws->raw || !ws->xyz || !ws->tag || !ws->copies || !ws->block ||
		    wh_bins_open(c, &s->out->pairs[i], &s->out->file, windows, sizeof(wh_near_pair),
		                 PAIRS) != WH_OK)
			return wh_failed(c);
	}
	return WH_OK;
}

static void close_search(wh_ctx *c, search *s, int workers)
{
	for (int i = 0; s->workspace && i < workers; i++) {
		workspace *ws = &s->workspace[i];
		wh_free(c, ws->raw);
		wh_free(c, ws->xyz);
		wh_free(c, ws->tag);
		wh_free(c, ws->copies);
		wh_free(c, ws->block);
		wh_free(c, ws->entry);
		wh_free(c, ws->slot);
	}
	wh_free(c, s->workspace);
	wh_bins_close(c, &s->buckets);
	wh_bin_file_close(&s->file);
}

static wh_code run(wh_ctx *c, const wh_exec *ex, search *s)
{
	const int64_t chunks = wh_chunks(s->source->nv, CHUNK);
	wh_progress_phase(s->progress, "weld", 2 * s->source->nv);
	if (wh_exec_ordered(c, ex, chunks, scatter_job, scatter_commit, s) != WH_OK ||
	    wh_bins_end(c, &s->buckets) != WH_OK ||
	    wh_exec_for(c, ex, s->nbuckets, match_job, s) != WH_OK)
		return c->err.code;
	for (int i = 0; i < ex->workers; i++)
		if (wh_bins_end(c, &s->out->pairs[i]) != WH_OK)
			return c->err.code;
	s->out->block = wh_alloc(c, PAIRS, sizeof(wh_near_pair));
	return s->out->block ? WH_OK : wh_failed(c);
}

wh_code wh_near_find(wh_ctx *c, const wh_exec *ex, wh_progress *progress, wh_spill *spill,
                     const wh_source *source, const wh_near_params *params, wh_rank *kept,
                     wh_near *n)
{
	search s = {.source = source,
	            .progress = progress,
	            .kept = kept,
	            .out = n,
	            .nbuckets = bucket_count(source, params->bucket),
	            .record = record_bytes(source),
	            .file = {.fd = -1}};
	*n = (wh_near){.window = params->window, .file = {.fd = -1}};
	s.key = s.record - sizeof(uint64_t);
	const uint32_t windows = (uint32_t)(source->nv / params->window + 1);
	wh_code code = choose_cells(c, &s, params);
	if (code == WH_OK)
		code = wh_bin_file_open(c, &n->file, spill);
	if (code == WH_OK)
		code = wh_bin_file_open(c, &s.file, spill);
	if (code == WH_OK)
		code = wh_bins_open(c, &s.buckets, &s.file, s.nbuckets, s.record, BLOCK);
	if (code == WH_OK)
		code = open_workspaces(c, &s, ex->workers, windows);
	if (code == WH_OK)
		code = run(c, ex, &s);
	close_search(c, &s, ex->workers);
	return code;
}

void wh_near_close(wh_ctx *c, wh_near *n)
{
	for (int i = 0; i < n->workers; i++)
		wh_bins_close(c, &n->pairs[i]);
	wh_free(c, n->pairs);
	wh_free(c, n->block);
	wh_bin_file_close(&n->file);
	*n = (wh_near){.file = {.fd = -1}};
}

wh_code wh_near_pairs(wh_ctx *c, wh_near *n, uint64_t window,
                      void (*take)(void *arg, const wh_near_pair *pairs, size_t n), void *arg)
{
	const uint32_t bin = (uint32_t)window;
	for (int i = 0; i < n->workers; i++)
		for (size_t k = 0; k < n->pairs[i].bin[bin].blocks; k++) {
			size_t count;
			if (wh_bins_read(c, &n->pairs[i], bin, k, n->block, &count) != WH_OK)
				return c->err.code;
			take(arg, n->block, count);
		}
	return WH_OK;
}
