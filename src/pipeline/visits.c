/*
 * The range of vertices is divided among drawers, files of equal spans. Memory that is full of
 * visits is sorted and rid of repeats; if that does not make room, all go to their drawers, each
 * drawer's in one piece. Taking reads the drawer at hand. One that holds more than fits is read as
 * often as it takes: each time the visits of the upper vertices are left out, more of them as
 * memory fills up, until the rest fits.
 *
 * Every vertex has at most 2^16 different visits, so that some vertex always fits. The cost is one
 * write and, when a drawer fits in memory, one read of every visit that did not fit at once.
 */
#include "pipeline/visits.h"

#include "base/sort.h"

#include <stdio.h>
#include <string.h>
#include <unistd.h>

enum { NAME_BYTES = 16, ROOM_FIRST = 64 * 1024 };

size_t wh_visits_least(uint32_t clusters)
{
	const size_t each = (size_t)clusters + 1;
	return each < 1024 ? 4096 : 4 * each;
}

wh_code wh_visits_open(wh_ctx *c, wh_visits *v, wh_spill *spill, uint64_t vertices, size_t room)
{
	*v = (wh_visits){.spill = spill, .vertices = vertices, .most = room};
	v->span = vertices / WH_VISIT_DRAWERS + 1;
	v->cap = room < ROOM_FIRST ? room : ROOM_FIRST;
	v->item = wh_alloc(c, v->cap, sizeof *v->item);
	return v->item ? WH_OK : c->err.code;
}

static void drawer_name(unsigned drawer, char name[NAME_BYTES])
{
	(void)snprintf(name, NAME_BYTES, "visits-%03u", drawer);
}

void wh_visits_close(wh_ctx *c, wh_visits *v)
{
	char name[NAME_BYTES];
	for (unsigned d = 0; v->spilled && d < WH_VISIT_DRAWERS; d++) {
		drawer_name(d, name);
		wh_spill_remove(v->spill, name);
	}
	wh_free(c, v->item);
	*v = (wh_visits){0};
}

/* ---- in ----------------------------------------------------------------------------------- */

static wh_code put_away(wh_ctx *c, wh_visits *v, unsigned drawer, const uint64_t *item, size_t n)
{
	char name[NAME_BYTES];
	drawer_name(drawer, name);
	const int fd = v->held[drawer] ? wh_spill_reopen(c, v->spill, name)
	                               : wh_spill_create(c, v->spill, name);
	if (fd < 0)
		return wh_failed(c);
	v->spilled = true;
	wh_code code = wh_spill_pwrite(c, v->spill, fd, item, n * sizeof *item,
	                               v->held[drawer] * sizeof *item);
	if (close(fd) != 0 && code == WH_OK)
		code = wh_fail_errno(c, "%s/%s: cannot write", v->spill->dir, name);
	v->held[drawer] += n;
	return code;
}

/* All that memory holds, which is sorted, goes to the drawers. */
static wh_code clear(wh_ctx *c, wh_visits *v)
{
	size_t at = 0;
	for (unsigned d = 0; d < WH_VISIT_DRAWERS && at < v->n; d++) {
		const size_t from = at;
		at = wh_visits_find(v, (d + 1) * v->span);
		if (at > from && put_away(c, v, d, v->item + from, at - from) != WH_OK)
			return c->err.code;
	}
	v->n = 0;
	return WH_OK;
}

/* Makes room in memory that is full. */
static wh_code grow_or_clear(wh_ctx *c, wh_visits *v)
{
	if (v->cap < v->most) {
		const size_t cap = 2 * v->cap < v->most ? 2 * v->cap : v->most;
		uint64_t *item = wh_resize(c, v->item, cap, sizeof *item);
		if (!item)
			return c->err.code;
		v->item = item;
		v->cap = cap;
		return WH_OK;
	}
	v->n = wh_sort_unique(v->item, v->n);
	return v->n > v->cap / 2 ? clear(c, v) : WH_OK;
}

wh_code wh_visits_add(wh_ctx *c, wh_visits *v, const uint64_t *item, size_t n)
{
	while (n > 0) {
		const size_t room = v->cap - v->n, take = n < room ? n : room;
		memcpy(v->item + v->n, item, take * sizeof *item);
		v->n += take;
		item += take;
		n -= take;
		if (v->n == v->cap && grow_or_clear(c, v) != WH_OK)
			return c->err.code;
	}
	return WH_OK;
}

wh_code wh_visits_seal(wh_ctx *c, wh_visits *v)
{
	v->n = wh_sort_unique(v->item, v->n);
	v->first = 0;
	v->end = v->vertices;
	return v->spilled ? clear(c, v) : WH_OK;
}

/* ---- out ---------------------------------------------------------------------------------- */

size_t wh_visits_find(const wh_visits *v, uint64_t vertex)
{
	size_t lo = 0, hi = v->n;
	while (lo < hi) {
		const size_t mid = lo + (hi - lo) / 2;
		if (wh_visit_vertex(v->item[mid]) < vertex)
			lo = mid + 1;
		else
			hi = mid;
	}
	return lo;
}

/* Keeps those of the n visits read behind the ones there are whose vertices are wanted. */
static void keep_wanted(wh_visits *v, size_t n)
{
	const uint64_t *from = v->item + v->n;
	for (size_t i = 0; i < n; i++) {
		const uint64_t vertex = wh_visit_vertex(from[i]);
		if (vertex >= v->first && vertex < v->end)
			v->item[v->n++] = from[i];
	}
}

/* Makes room in full memory: without repeats, and, if that is not enough, without the vertices of
 * the upper half. That leaves some, as one vertex has fewer visits than a half. */
static void make_room(wh_visits *v)
{
	v->n = wh_sort_unique(v->item, v->n);
	if (v->n <= v->cap / 2)
		return;
	v->end = wh_visit_vertex(v->item[v->n / 2]);
	v->n = wh_visits_find(v, v->end);
}

static wh_code read_drawer(wh_ctx *c, wh_visits *v, unsigned drawer)
{
	char name[NAME_BYTES];
	drawer_name(drawer, name);
	const int fd = wh_spill_read(c, v->spill, name);
	if (fd < 0)
		return wh_failed(c);
	wh_code code = WH_OK;
	for (uint64_t at = 0; code == WH_OK && at < v->held[drawer];) {
		const uint64_t left = v->held[drawer] - at;
		const size_t room = v->cap - v->n, n = left < room ? (size_t)left : room;
		code = wh_spill_pread(c, v->spill, fd, v->item + v->n, n * sizeof *v->item,
		                      at * sizeof *v->item);
		if (code != WH_OK)
			break;
		keep_wanted(v, n);
		if (v->n == v->cap)
			make_room(v);
		at += n;
	}
	(void)close(fd);
	v->n = wh_sort_unique(v->item, v->n);
	return code;
}

wh_code wh_visits_take(wh_ctx *c, wh_visits *v, uint64_t first)
{
	if (!v->spilled)
		return WH_OK;
	const unsigned drawer = (unsigned)(first / v->span);
	const uint64_t end = (drawer + 1) * v->span;
	v->n = 0;
	v->first = first;
	v->end = end < v->vertices ? end : v->vertices;
	return v->held[drawer] ? read_drawer(c, v, drawer) : WH_OK;
}
