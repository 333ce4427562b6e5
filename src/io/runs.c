#include "io/runs.h"

enum {
	DIGIT = 11, /* bits */
	VALUES = 1 << DIGIT,
	LEAST_ROOM = 4096, /* records */
	LEAST_BLOCK = 64,
	CHUNK = 1 << 18 /* bytes written at once */
};

/* ---- in memory ---------------------------------------------------------------------------- */

/* One digit. False: it is the same in all. */
static bool sort_digit(const wh_runs_item *from, wh_runs_item *to, size_t n, unsigned shift)
{
	size_t start[VALUES + 1] = {0};
	for (size_t i = 0; i < n; i++)
		start[(from[i].number >> shift & (VALUES - 1)) + 1]++;
	if (n == 0 || start[(from[0].number >> shift & (VALUES - 1)) + 1] == n)
		return false;
	for (size_t d = 0; d < VALUES; d++)
		start[d + 1] += start[d];
	for (size_t i = 0; i < n; i++)
		to[start[from[i].number >> shift & (VALUES - 1)]++] = from[i];
	return true;
}

/* Finds the order of the records in the buffer: least significant digits first, so that equal ones
 * keep theirs. */
static void sort_items(wh_runs *r)
{
	for (size_t i = 0; i < r->n; i++)
		r->item[i] = (wh_runs_item){wh_runs_number(r->buf + i * r->record), (uint32_t)i, 0};
	for (unsigned shift = 0; shift < 64; shift += DIGIT) {
		if (!sort_digit(r->item, r->spare, r->n, shift))
			continue;
		wh_runs_item *t = r->item;
		r->item = r->spare;
		r->spare = t;
	}
}

wh_code wh_runs_open(wh_ctx *c, wh_runs *r, wh_spill *spill, size_t record, size_t bytes,
                     uint64_t most)
{
	const size_t could = bytes / (record + 2 * sizeof *r->item),
	             fit = most < could ? (size_t)most : could;
	*r = (wh_runs){.spill = spill, .record = record, .fd = -1};
	r->room = fit > LEAST_ROOM ? fit : LEAST_ROOM;
	r->room = r->room < UINT32_MAX ? r->room : UINT32_MAX;
	r->buf = wh_alloc(c, r->room, record);
	r->item = wh_alloc(c, r->room, sizeof *r->item);
	r->spare = wh_alloc(c, r->room, sizeof *r->spare);
	return r->buf && r->item && r->spare ? WH_OK : wh_failed(c);
}

void wh_runs_close(wh_ctx *c, wh_runs *r)
{
	if (r->spill && r->fd >= 0)
		wh_spill_close_scratch(r->spill, r->fd);
	wh_free(c, r->buf);
	wh_free(c, r->item);
	wh_free(c, r->spare);
	wh_free(c, r->end);
	wh_free(c, r->front);
	*r = (wh_runs){.fd = -1};
}

/* ---- out ---------------------------------------------------------------------------------- */

static wh_code write_sorted(wh_ctx *c, wh_runs *r, uint8_t *chunk)
{
	const size_t most = CHUNK / r->record;
	for (size_t i = 0; i < r->n; i += most) {
		const size_t n = r->n - i < most ? r->n - i : most;
		for (size_t k = 0; k < n; k++)
			memcpy(chunk + k * r->record, r->buf + r->item[i + k].at * r->record,
			       r->record);
		if (wh_poll(c) != WH_OK || wh_spill_pwrite(c, r->spill, r->fd, chunk, n * r->record,
		                                           r->written * r->record) != WH_OK)
			return c->err.code;
		r->written += n;
	}
	return WH_OK;
}

/* The buffer becomes a run. */
static wh_code spill_run(wh_ctx *c, wh_runs *r)
{
	if (r->n == 0)
		return WH_OK;
	if (r->fd < 0 && (r->fd = wh_spill_scratch(c, r->spill)) < 0)
		return wh_failed(c);
	if (wh_reserve(c, &r->end, &r->cap, r->runs + 1, sizeof *r->end) != WH_OK)
		return c->err.code;
	uint8_t *chunk = wh_alloc(c, CHUNK, 1);
	if (!chunk)
		return wh_failed(c);
	sort_items(r);
	const wh_code code = write_sorted(c, r, chunk);
	wh_free(c, chunk);
	r->end[r->runs++] = r->written;
	r->n = 0;
	return code;
}

uint8_t *wh_runs_room(wh_ctx *c, wh_runs *r)
{
	if (r->n == r->room && spill_run(c, r) != WH_OK)
		return NULL;
	return r->buf + r->n++ * r->record;
}

/* ---- in ----------------------------------------------------------------------------------- */

/* Of two runs, which comes first. */
static bool is_before(const wh_runs_item *a, const wh_runs_item *b)
{
	return a->number != b->number ? a->number < b->number : a->run < b->run;
}

/* Lets what is at place i sink to where it belongs. */
static void sink(wh_runs_item *heap, size_t n, size_t i)
{
	const wh_runs_item own = heap[i];
	for (size_t k; (k = 2 * i + 1) < n; i = k) {
		if (k + 1 < n && is_before(&heap[k + 1], &heap[k]))
			k++;
		if (is_before(&own, &heap[k]))
			break;
		heap[i] = heap[k];
	}
	heap[i] = own;
}

/* The records of run k that are next. */
static wh_code refill(wh_ctx *c, wh_runs *r, size_t k)
{
	wh_runs_front *f = &r->front[k];
	const uint64_t left = f->end - f->next;
	f->n = (uint32_t)(left < r->block ? left : r->block);
	f->at = 0;
	const uint64_t from = f->next * r->record;
	f->next += f->n;
	return wh_spill_pread(c, r->spill, r->fd, r->buf + k * r->block * r->record,
	                      f->n * r->record, from);
}

static const uint8_t *shown(const wh_runs *r, size_t k)
{
	return r->buf + (k * r->block + r->front[k].at) * r->record;
}

/* The buffer is a block for each run now. */
static wh_code make_fronts(wh_ctx *c, wh_runs *r)
{
	r->block = r->room / r->runs;
	if (r->block < LEAST_BLOCK) {
		r->block = LEAST_BLOCK;
		wh_free(c, r->buf);
		r->buf = wh_alloc(c, r->runs * LEAST_BLOCK, r->record);
	}
	wh_free(c, r->item);
	wh_free(c, r->spare);
	r->spare = NULL;
	r->item = wh_alloc(c, r->runs, sizeof *r->item);
	r->front = wh_alloc(c, r->runs, sizeof *r->front);
	return r->buf && r->item && r->front ? WH_OK : wh_failed(c);
}

wh_code wh_runs_end(wh_ctx *c, wh_runs *r)
{
	if (r->fd < 0) {
		sort_items(r);
		wh_free(c, r->spare);
		r->spare = NULL;
	} else if (spill_run(c, r) != WH_OK || make_fronts(c, r) != WH_OK) {
		return c->err.code;
	}
	return wh_runs_rewind(c, r);
}

wh_code wh_runs_rewind(wh_ctx *c, wh_runs *r)
{
	r->shown = false;
	r->left = r->fd < 0 ? r->n : r->runs;
	for (size_t k = 0; k < r->runs; k++) {
		r->front[k] = (wh_runs_front){.next = k ? r->end[k - 1] : 0, .end = r->end[k]};
		if (refill(c, r, k) != WH_OK)
			return c->err.code;
		r->item[k] = (wh_runs_item){wh_runs_number(shown(r, k)), 0, (uint32_t)k};
	}
	for (size_t k = r->runs / 2; k-- > 0;)
		sink(r->item, r->runs, k);
	return WH_OK;
}

/* Goes on in the run at the top. */
static wh_code advance(wh_ctx *c, wh_runs *r)
{
	const uint32_t k = r->item[0].run;
	wh_runs_front *f = &r->front[k];
	if (++f->at == f->n && f->next < f->end &&
	    (wh_poll(c) != WH_OK || refill(c, r, k) != WH_OK))
		return c->err.code;
	if (f->at < f->n)
		r->item[0].number = wh_runs_number(shown(r, k));
	else
		r->item[0] = r->item[--r->left];
	if (r->left)
		sink(r->item, r->left, 0);
	return WH_OK;
}

const uint8_t *wh_runs_next(wh_ctx *c, wh_runs *r)
{
	if (r->fd < 0)
		return r->left ? r->buf + r->item[r->n - r->left--].at * r->record : NULL;
	if (r->shown && advance(c, r) != WH_OK)
		return NULL;
	r->shown = r->left > 0;
	return r->left ? shown(r, r->item[0].run) : NULL;
}
