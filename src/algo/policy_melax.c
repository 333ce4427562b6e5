/*
 * Edge length times curvature (Melax, "A simple, fast, and effective polygon reduction algorithm",
 * 1998): u goes into v. The curvature is how far the face of u that is farthest from all faces on
 * the edge is turned from the nearest of them: 0 where all are in one plane, 1 where one is turned
 * over.
 *
 * Departure: the boundary. A boundary vertex that leaves the boundary takes the full curvature,
 * else open meshes shrink; one that moves along it, no less than the bend of the boundary there.
 * Where both ends move to a place between them, the cheaper direction counts.
 */
#include "algo/policy_engine.h"

/* The faces of a vertex as unit normals; those without an area are left out. `at`: the neighbour
 * whose faces come first; *shared: how many these are. */
static uint32_t unit_faces(const wh_engine *e, uint32_t v, uint32_t at, wh_vec3 *n,
                           uint32_t *shared)
{
	wh_vec3 area[WH_ROW];
	const wh_star *s = &e->w->star[v];
	const uint32_t count = wh_policy_faces(e, v, area), i = wh_ring_place(wh_ring(e, v), at);
	const uint32_t before = i ? i - 1 : s->n - 1;
	uint32_t used = 0;
	*shared = 0;
	for (int first = 1; first >= 0; first--) {
		for (uint32_t k = 0; k < count; k++) {
			const double norm = wh_norm(area[k]);
			if ((k == i || k == before) == (first != 0) && norm > 0)
				n[used++] = wh_scale(area[k], 1 / norm);
		}
		if (first)
			*shared = used;
	}
	return used;
}

static wh_vec3 direction(const wh_engine *e, uint32_t from, uint32_t to)
{
	const wh_vec3 d = wh_sub(e->w->star[to].pos, e->w->star[from].pos);
	const double norm = wh_norm(d);
	return norm > 0 ? wh_scale(d, 1 / norm) : d;
}

/* How far the boundary bends at v: 0 straight, 1 back. */
static double bend(const wh_engine *e, uint32_t v)
{
	const uint32_t *r = wh_ring(e, v), last = r[e->w->star[v].n - 1];
	return (1 - wh_dot(direction(e, last, v), direction(e, v, r[0]))) / 2;
}

static double curvature(const wh_edge *d, uint32_t u, uint32_t v)
{
	const wh_engine *e = d->e;
	wh_vec3 n[WH_ROW];
	uint32_t shared;
	const bool open = !e->w->star[u].closed;
	if (open && !d->rim)
		return 1;
	const uint32_t faces = unit_faces(e, u, v, n, &shared);
	double most = open ? bend(e, u) : 0;
	for (uint32_t i = shared; i < faces; i++) {
		double least = 1;
		for (uint32_t k = 0; k < shared; k++)
			least = fmin(least, (1 - wh_dot(n[i], n[k])) / 2);
		most = fmax(most, least);
	}
	return most;
}

static double melax_cost(const wh_edge *d, wh_vec3 *x, double *weight)
{
	const bool goes = x->x == d->to.x && x->y == d->to.y && x->z == d->to.z;
	const bool stays = x->x == 0 && x->y == 0 && x->z == 0;
	double most = (double)INFINITY;
	*weight = 0; /* no distance from a surface */
	if (!stays)
		most = curvature(d, d->hub, d->other);
	if (!goes)
		most = fmin(most, curvature(d, d->other, d->hub));
	return wh_norm(d->to) * most;
}

const struct wh_policy wh_policy_melax = {.cost = melax_cost, .usual = WH_PLACE_ENDPOINT};
