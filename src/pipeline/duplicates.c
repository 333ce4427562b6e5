/*
 * Coincident positions have the same hash. The hashes are cut into equal lots; a pass over the
 * vertices collects the positions of a few lots, and each lot is then searched by itself. Lots of
 * different positions have about the same size, so room is made for little more than that. Where
 * a lot becomes full, most of it coincides: one of each is kept, and there is room again.
 */
#include "pipeline/duplicates.h"

#include "base/chunks.h"
#include "mesh/coincident.h"

#include <string.h>

enum {
	CHUNK = 32 * 1024, /* vertices a job */
	LOTS = 16,         /* held at a time */
	MOST_PASSES = 1000
};

typedef struct lot {
	wh_vec3 *pos;
	uint32_t n;
	size_t cap;
	uint64_t duplicates;
} lot;

/* What one worker needs. */
typedef struct reader {
	void *raw;
	double *xyz;
	wh_vec3 *pos; /* of the chunk's vertices in this pass */
	uint8_t *lot;
	uint32_t n;
} reader;

typedef struct search {
	const wh_source *src;
	wh_progress *progress;
	reader *reader;
	uint32_t passes, pass;
	size_t room; /* of a lot */
	lot lots[LOTS];
} search;

/* ---- reading ------------------------------------------------------------------------------ */

/* The lot of a position among those of all passes. The lower half of the hash tells: inside a lot
 * the upper one is sorted by. */
static uint32_t lot_of(const search *s, wh_vec3 p)
{
	const uint64_t low = wh_coincident_hash(p) & UINT32_MAX;
	return (uint32_t)(low * s->passes * LOTS >> 32);
}

static wh_code read_job(wh_ctx *c, void *arg, int64_t index, int worker)
{
	const search *s = arg;
	reader *r = &s->reader[worker];
	const size_t n = wh_chunk_items(s->src->nv, index, CHUNK);
	if (wh_source_vertices(c, s->src, (uint64_t)index * CHUNK, n, r->xyz, r->raw) != WH_OK)
		return c->err.code;
	r->n = 0;
	for (size_t i = 0; i < n; i++) {
		const wh_vec3 p = wh_v3(r->xyz[3 * i], r->xyz[3 * i + 1], r->xyz[3 * i + 2]);
		const uint32_t at = lot_of(s, p);
		if (at / LOTS != s->pass)
			continue;
		r->pos[r->n] = p;
		r->lot[r->n++] = (uint8_t)(at % LOTS);
	}
	return WH_OK;
}

/* Keeps one of each position. */
static wh_code thin_out(wh_ctx *c, lot *l)
{
	uint64_t *marks = wh_calloc(c, (size_t)l->n / 64 + 1, sizeof *marks);
	uint64_t found;
	if (!marks || wh_coincident_count(c, l->pos, l->n, marks, &found) != WH_OK) {
		wh_free(c, marks);
		return c->err.code;
	}
	uint32_t kept = 0;
	for (uint32_t i = 0; i < l->n; i++)
		if (!(marks[i / 64] >> (i % 64) & 1))
			l->pos[kept++] = l->pos[i];
	l->n = kept;
	l->duplicates += found;
	wh_free(c, marks);
	return WH_OK;
}

/* Room for one more. A lot that hardly gets thinner has more room coming to it. */
static wh_code make_room(wh_ctx *c, lot *l)
{
	if (l->n < l->cap)
		return WH_OK;
	if (thin_out(c, l) != WH_OK)
		return c->err.code;
	if (l->n < l->cap - l->cap / 8)
		return WH_OK;
	return wh_reserve(c, &l->pos, &l->cap, l->cap + 1, sizeof *l->pos);
}

static wh_code read_commit(wh_ctx *c, void *arg, int64_t index, int worker)
{
	search *s = arg;
	const reader *r = &s->reader[worker];
	for (uint32_t i = 0; i < r->n; i++) {
		lot *l = &s->lots[r->lot[i]];
		if (make_room(c, l) != WH_OK)
			return c->err.code;
		l->pos[l->n++] = r->pos[i];
	}
	wh_progress_add(s->progress, wh_chunk_items(s->src->nv, index, CHUNK));
	return WH_OK;
}

static wh_code count_job(wh_ctx *c, void *arg, int64_t index, int worker)
{
	(void)worker;
	search *s = arg;
	lot *l = &s->lots[index];
	uint64_t found;
	if (wh_coincident_count(c, l->pos, l->n, NULL, &found) != WH_OK)
		return c->err.code;
	l->duplicates += found;
	l->n = 0;
	return WH_OK;
}

/* ---- the passes --------------------------------------------------------------------------- */

/* A little more than a lot's share. */
static size_t room_of(uint64_t nv, uint32_t passes)
{
	const uint64_t share = nv / passes / LOTS;
	return (size_t)(share + share / 16) + 1024;
}

static size_t reader_bytes(const wh_source *src)
{
	return wh_source_vertex_bytes(src, CHUNK) + CHUNK * (size_t)(24 + 24 + 1);
}

static size_t pass_bytes(const wh_source *src, const wh_exec *ex, size_t room)
{
	const size_t workers = (size_t)ex->workers, counting = workers < LOTS ? workers : LOTS;
	return LOTS * room * sizeof(wh_vec3) + counting * room * 16 + workers * reader_bytes(src);
}

static wh_code plan_passes(wh_ctx *c, const wh_exec *ex, search *s, size_t budget)
{
	for (s->passes = 1; s->passes <= MOST_PASSES; s->passes++) {
		s->room = room_of(s->src->nv, s->passes);
		if (s->room < UINT32_MAX / 2 && pass_bytes(s->src, ex, s->room) <= budget)
			return WH_OK;
	}
	return wh_fail(c, WH_E_PLAN,
	               "looking for coincident vertices takes more than %zu MiB of memory: raise "
	               "--memory or lower --threads",
	               budget >> 20);
}

static wh_code make(wh_ctx *c, search *s, int workers)
{
	for (int i = 0; i < LOTS; i++) {
		s->lots[i].pos = wh_alloc(c, s->room, sizeof(wh_vec3));
		s->lots[i].cap = s->room;
	}
	s->reader = wh_calloc(c, (size_t)workers, sizeof *s->reader);
	for (int i = 0; s->reader && i < workers; i++) {
		reader *r = &s->reader[i];
		r->raw = wh_alloc(c, wh_source_vertex_bytes(s->src, CHUNK), 1);
		r->xyz = wh_alloc(c, CHUNK, 3 * sizeof *r->xyz);
		r->pos = wh_alloc(c, CHUNK, sizeof *r->pos);
		r->lot = wh_alloc(c, CHUNK, sizeof *r->lot);
	}
	return c->err.code;
}

static void drop(wh_ctx *c, search *s, int workers)
{
	for (int i = 0; s->reader && i < workers; i++) {
		wh_free(c, s->reader[i].raw);
		wh_free(c, s->reader[i].xyz);
		wh_free(c, s->reader[i].pos);
		wh_free(c, s->reader[i].lot);
	}
	wh_free(c, s->reader);
	for (int i = 0; i < LOTS; i++)
		wh_free(c, s->lots[i].pos);
}

wh_code wh_duplicate_vertices(wh_ctx *c, const wh_exec *ex, wh_progress *progress,
                              const wh_source *src, size_t budget, uint64_t *count)
{
	search s = {.src = src, .progress = progress};
	*count = 0;
	if (plan_passes(c, ex, &s, budget) != WH_OK)
		return c->err.code;
	const int64_t chunks = wh_chunks(src->nv, CHUNK);
	wh_code code = make(c, &s, ex->workers);
	wh_progress_phase(progress, "coincident vertices", src->nv * s.passes);
	for (s.pass = 0; code == WH_OK && s.pass < s.passes; s.pass++) {
		code = wh_exec_ordered(c, ex, chunks, read_job, read_commit, &s);
		if (code == WH_OK)
			code = wh_exec_for(c, ex, LOTS, count_job, &s);
	}
	for (int i = 0; i < LOTS; i++)
		*count += s.lots[i].duplicates;
	drop(c, &s, ex->workers);
	return code;
}
