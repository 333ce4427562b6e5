/*
 * Compare the packed R-trees of Kamel & Faloutsos 1993, and Leutenegger's STR 1997.
 *
 * Cost. 16 bytes a face; n log n, 1 M faces in about 0.2 s.
 */
#include "mesh/face_order.h"

#include "base/rng.h"

#include <float.h>

enum { W = 8 };

void wh_face_items(const wh_vec3 *pos, const uint32_t *tri, uint32_t nf, wh_face_item *items)
{
	const wh_vec3 origin = pos[tri[3 * (size_t)(nf / 2)]];
	for (uint32_t i = 0; i < nf; i++) {
		const uint32_t *t = tri + 3 * (size_t)i;
		const wh_vec3 a = wh_sub(pos[t[0]], origin), b = wh_sub(pos[t[1]], origin);
		const wh_vec3 d = wh_sub(pos[t[2]], origin);
		items[i] = (wh_face_item){
		    {(float)(a.x + b.x + d.x), (float)(a.y + b.y + d.y), (float)(a.z + b.z + d.z)},
		    i};
	}
}

static int widest_axis(const wh_face_item *items, size_t n)
{
	float lo[3] = {FLT_MAX, FLT_MAX, FLT_MAX};
	float hi[3] = {-FLT_MAX, -FLT_MAX, -FLT_MAX};
	for (size_t i = 0; i < n; i++) {
		for (int k = 0; k < 3; k++) {
			const float x = items[i].at[k];
			lo[k] = x < lo[k] ? x : lo[k];
			hi[k] = x > hi[k] ? x : hi[k];
		}
	}
	int axis = 0;
	for (int k = 1; k < 3; k++)
		if (hi[k] - lo[k] > hi[axis] - lo[axis])
			axis = k;
	return axis;
}

static void swap_items(wh_face_item *a, wh_face_item *b)
{
	const wh_face_item x = *a;
	*a = *b;
	*b = x;
}

/* The middle one of three items, two of them picked by a hash so that no regular order of the
 * input is a bad one. */
static float pick_pivot(const wh_face_item *items, size_t n, int axis)
{
	const uint64_t r = wh_mix64(n);
	const float a = items[(uint32_t)r % n].at[axis];
	const float b = items[(r >> 32) % n].at[axis];
	const float c = items[n / 2].at[axis];
	if (a < b)
		return b < c ? b : a < c ? c : a;
	return a < c ? a : b < c ? c : b;
}

/* Hoare's selection: 0 < mid < n; then none of the first mid items is above any of the rest. */
static void select_items(wh_face_item *items, size_t n, size_t mid, int axis)
{
	size_t from = 0, to = n; /* what is outside from .. to-1 is on its side already */
	for (;;) {
		const float pivot = pick_pivot(items + from, to - from, axis);
		size_t i = from, j = to - 1;
		for (;;) {
			while (items[i].at[axis] < pivot)
				i++;
			while (items[j].at[axis] > pivot)
				j--;
			if (i >= j)
				break;
			swap_items(items + i++, items + j--);
		}
		/* below i all are at most the pivot, above j at least; i is j or j + 1 */
		if (mid < i)
			to = i;
		else if (mid > j + 1)
			from = j + 1;
		else
			return;
	}
}

/* Orders items into aligned runs of at most `stop`, a power of eight. */
static void split(wh_face_item *items, size_t n, size_t stop)
{
	while (n > stop) {
		size_t child = stop;
		while (child * W < n)
			child *= W;
		const size_t children = (n + child - 1) / child;
		const size_t mid = (children + 1) / 2 * child;
		select_items(items, n, mid, widest_axis(items, n));
		split(items, mid, stop);
		items += mid;
		n -= mid;
	}
}

typedef struct split_job {
	wh_face_item *items;
	size_t n;
	size_t run; /* items of one job */
} split_job;

static wh_code split_run(wh_ctx *c, void *arg, int64_t index, int worker)
{
	const split_job *s = arg;
	const size_t first = (size_t)index * s->run;
	split(s->items + first, s->n - first < s->run ? s->n - first : s->run, W);
	(void)c;
	(void)worker;
	return WH_OK;
}

void wh_face_order(wh_face_item *items, size_t n)
{
	split(items, n, W);
}

/* The topmost splits serially, the rest in up to 64 jobs. */
wh_code wh_face_order_parallel(wh_ctx *c, const wh_exec *ex, wh_face_item *items, size_t n)
{
	size_t run = W;
	while (run * W * W < n)
		run *= W;
	split(items, n, run);
	split_job s = {items, n, run};
	return wh_exec_for(c, ex, (int64_t)((n + run - 1) / run), split_run, &s);
}
