/* A caller's own policy (base/edge_view.h): the faces around an edge, written down for it. */
#include "algo/policy_engine.h"

#include <string.h>

enum { MOST_FACES = 2 * WH_MOST_AROUND };

typedef struct scene {
	wh_edge_view view;
	uint32_t n;
	double face[MOST_FACES][3][3];
	wh_vec3 hub;
	double unit; /* of the file, in units of the run */
} scene;

static void put(const scene *s, double to[3], wh_vec3 at)
{
	to[0] = at.x * s->unit;
	to[1] = at.y * s->unit;
	to[2] = at.z * s->unit;
}

/* The faces of vertex v; with `shared` those that have the neighbour `at`, else the others. */
static void add_faces(const wh_engine *e, uint32_t v, uint32_t at, bool shared, scene *s)
{
	const wh_star *star = e->w->star;
	const uint32_t *ring = wh_ring(e, v), n = star[v].n - !star[v].closed;
	for (uint32_t i = 0; i < n; i++) {
		const uint32_t a = ring[i], b = ring[i + 1 < star[v].n ? i + 1 : 0];
		if ((a == at || b == at) != shared)
			continue;
		double(*face)[3] = s->face[s->n++];
		put(s, face[0], wh_sub(star[v].pos, s->hub));
		put(s, face[1], wh_sub(star[a].pos, s->hub));
		put(s, face[2], wh_sub(star[b].pos, s->hub));
	}
}

static void look(const wh_edge *d, scene *s)
{
	const wh_engine *e = d->e;
	const wh_star *star = e->w->star;
	s->unit = e->params->policy.unscale;
	s->hub = star[d->hub].pos;
	s->n = 0;
	s->view = (wh_edge_view){.locked = d->locked,
	                         .boundary = d->rim,
	                         .first_open = !d->fan->closed,
	                         .second_open = (star[d->other].flag & WH_BORDER) != 0};
	put(s, s->view.origin, s->hub);
	put(s, s->view.second, d->to);
	add_faces(e, d->hub, d->other, true, s);
	s->view.shared = s->n;
	add_faces(e, d->hub, d->other, false, s);
	s->view.of_first = s->n - s->view.shared;
	if (!d->locked)
		add_faces(e, d->other, d->hub, false, s);
	s->view.faces = s->n;
	s->view.face = (const double(*)[3][3])s->face;
}

static double own_cost(const wh_edge *d, wh_vec3 *x, double *weight)
{
	const wh_own_policy *own = d->e->params->policy.own;
	scene s;
	double place[3];
	look(d, &s);
	put(&s, place, *x);
	*weight = 0;
	const double cost = own->cost(own->user, &s.view, place);
	const wh_vec3 moved = wh_scale(wh_v3(place[0], place[1], place[2]), 1 / s.unit);
	if (isfinite(wh_norm2(moved)))
		*x = moved;
	return cost;
}

const struct wh_policy wh_policy_own = {.cost = own_cost, .usual = WH_PLACE_OPTIMAL};
