/*
 * Quadric error metrics (Garland & Heckbert, "Surface simplification using quadric error metrics",
 * 1997): every vertex sums the squared distances from the planes of the faces that went into it.
 * Weights of planes: one each, their area, or their area by the angle at the corner (Garland's
 * thesis, 1999). Each boundary edge adds the plane through it that stands on its face.
 *
 * The other one here has one plane a vertex, across its normal, which is the file's or the mean of
 * its faces' by the same weights.
 *
 * Quadrics are about the place of their vertex, and are moved when it moves: that keeps all digits.
 * They start anew with every run of the engine: a larger mesh, which is reduced in rounds, has in
 * each the planes of the surface that the round before left.
 *
 * Place: the minimum of the sum; where it is not one, or far away, the least along the edge.
 */
#include "algo/policy_engine.h"

#include "geom/tri.h"
#include "io/attributes.h"

#include <string.h>

/* A plane of a boundary edge weighs so many times the square of the edge; or as so many faces,
 * where one is as good as any other. RMS on a range scan with much boundary and on a bunny, at 1 %:
 * 842 and 1545 with 1, 796 and 1545 with 3, 1008 and 1618 with 30; and with 1, 10 and 30 faces
 * 1419, 1274 and 1309 on the first. */
static const double BOUNDARY_WEIGHT = 3, BOUNDARY_FACES = 10;

/* ---- weights ------------------------------------------------------------------------------ */

/* What the face with its corner between edges a and b counts there. */
static double weight_of(wh_weight kind, wh_vec3 a, wh_vec3 b)
{
	const double twice = wh_norm(wh_cross(a, b));
	if (kind == WH_WEIGHT_UNIFORM)
		return 1;
	if (kind == WH_WEIGHT_AREA)
		return 0.5 * twice;
	return 0.5 * twice * wh_angle(twice, wh_dot(a, b)) / WH_PI;
}

/* ---- planes ------------------------------------------------------------------------------- */

/* Calls visit for each corner of each face that has an area: the face's unit normal and weight. */
static void each_corner(const wh_engine *e,
                        void (*visit)(const wh_engine *e, uint32_t v, wh_vec3 n, double weight))
{
	const wh_patch *p = e->p;
	const wh_weight kind = e->params->policy.weight;
	for (uint32_t f = 0; f < p->nf; f++) {
		const uint32_t *t = &p->tri[3 * (size_t)f];
		const wh_vec3 side[3] = {wh_sub(p->pos[t[1]], p->pos[t[0]]),
		                         wh_sub(p->pos[t[2]], p->pos[t[1]]),
		                         wh_sub(p->pos[t[0]], p->pos[t[2]])};
		const wh_vec3 area = wh_cross(side[0], side[1]);
		const double norm = wh_norm(area);
		for (size_t k = 0; norm > 0 && k < 3; k++)
			visit(e, t[k], wh_scale(area, 1 / norm),
			      weight_of(kind, side[k], wh_scale(side[(k + 2) % 3], -1)));
	}
}

static void add_plane(const wh_engine *e, uint32_t v, wh_vec3 n, double weight)
{
	wh_quadric_add_plane(&e->w->quadric[v], n, 0, weight);
}

/* Of the boundary edge from v to ring[i], whose face is between ring[i] and ring[next]. */
static void add_boundary_edge(const wh_engine *e, uint32_t v, uint32_t i, uint32_t next)
{
	const wh_star *star = e->w->star, *s = &star[v];
	const uint32_t *ring = wh_ring(e, v);
	const wh_vec3 edge = wh_sub(star[ring[i]].pos, s->pos);
	const wh_vec3 face = wh_cross(edge, wh_sub(star[ring[next]].pos, s->pos));
	const wh_vec3 n = wh_cross(edge, face);
	const double norm = wh_norm(n);
	const bool uniform = e->params->policy.weight == WH_WEIGHT_UNIFORM;
	const double weight = uniform ? BOUNDARY_FACES : BOUNDARY_WEIGHT * wh_norm2(edge);
	if (norm > 0)
		add_plane(e, v, wh_scale(n, 1 / norm), weight);
}

static void add_boundary(const wh_engine *e)
{
	for (uint32_t v = 0; v < e->p->nv; v++) {
		const wh_star *s = &e->w->star[v];
		if (s->n == 0 || s->closed)
			continue;
		add_boundary_edge(e, v, 0, 1);
		add_boundary_edge(e, v, s->n - 1, s->n - 2);
	}
}

static wh_code make_room(wh_engine *e)
{
	struct wh_simplify_workspace *w = e->w;
	if (wh_renew(e->c, &w->quadric, &w->cap_quadric, e->p->nv, sizeof *w->quadric) != WH_OK)
		return e->c->err.code;
	memset(w->quadric, 0, e->p->nv * sizeof *w->quadric);
	return WH_OK;
}

static wh_code begin_faces(wh_engine *e)
{
	if (make_room(e) != WH_OK)
		return e->c->err.code;
	each_corner(e, add_plane);
	add_boundary(e);
	return WH_OK;
}

/* ---- planes of vertices ------------------------------------------------------------------- */

/* Normals are summed where the quadric's linear part, which is 0, will be. */
static void add_normal(const wh_engine *e, uint32_t v, wh_vec3 n, double weight)
{
	wh_quadric *q = &e->w->quadric[v];
	q->b = wh_add(q->b, wh_scale(n, weight));
	q->weight += weight;
}

static bool file_normal(const wh_engine *e, uint32_t v, wh_vec3 *n)
{
	const wh_attributes *as = e->params->attributes;
	if (!as || !as->has_normal)
		return false;
	double *const to[3] = {&n->x, &n->y, &n->z};
	for (int k = 0; k < 3; k++)
		*to[k] = wh_attribute_get(&as->item[as->normal[k]], wh_patch_attr(e->p, v));
	return wh_norm2(*n) > 0 && isfinite(wh_norm2(*n));
}

/* One plane weighs as much as the faces around the vertex in its normal; or one, where those do. */
static wh_code begin_normals(wh_engine *e)
{
	const bool uniform = e->params->policy.weight == WH_WEIGHT_UNIFORM;
	if (make_room(e) != WH_OK)
		return e->c->err.code;
	each_corner(e, add_normal);
	for (uint32_t v = 0; v < e->p->nv; v++) {
		wh_vec3 n = e->w->quadric[v].b;
		const double weight = uniform ? 1 : e->w->quadric[v].weight;
		(void)file_normal(e, v, &n);
		e->w->quadric[v] = (wh_quadric){0};
		const double norm = wh_norm(n);
		if (norm > 0)
			add_plane(e, v, wh_scale(n, 1 / norm), weight);
	}
	add_boundary(e);
	return WH_OK;
}

/* ---- costs -------------------------------------------------------------------------------- */

/* Of both ends, about the hub. */
static wh_quadric sum_of(const wh_edge *d)
{
	const wh_quadric *q = d->e->w->quadric;
	const wh_quadric other = wh_quadric_moved(&q[d->other], wh_scale(d->to, -1));
	return wh_quadric_sum(&q[d->hub], &other);
}

static double qem_cost(const wh_edge *d, wh_vec3 *x, double *weight)
{
	const wh_quadric q = sum_of(d);
	*weight = q.weight;
	return wh_quadric_at(&q, *x);
}

static wh_vec3 qem_best(const wh_edge *d)
{
	const wh_quadric q = sum_of(d);
	wh_vec3 x;
	if (wh_quadric_minimum(&q, &x) &&
	    wh_norm2(wh_sub(x, wh_scale(d->to, 0.5))) <= 4 * wh_norm2(d->to))
		return x;
	return wh_quadric_minimum_along(&q, d->to);
}

/* Both into that of the vertex that stays, about its new place. The trial is worked out from the
 * end that is the hub. */
static void qem_merge(wh_engine *e, const wh_trial *t)
{
	const wh_star *star = e->w->star;
	wh_quadric *q = e->w->quadric;
	const wh_quadric u = wh_quadric_moved(&q[t->u], wh_sub(t->x, star[t->u].pos));
	const wh_quadric v = wh_quadric_moved(&q[t->v], wh_sub(t->x, star[t->v].pos));
	q[t->v] = wh_quadric_sum(&u, &v);
}

const struct wh_policy wh_policy_qem = {.begin = begin_faces,
                                        .cost = qem_cost,
                                        .best = qem_best,
                                        .merge = qem_merge,
                                        .usual = WH_PLACE_OPTIMAL,
                                        .near = true,
                                        .bytes = sizeof(wh_quadric)};

const struct wh_policy wh_policy_normals = {.begin = begin_normals,
                                            .cost = qem_cost,
                                            .best = qem_best,
                                            .merge = qem_merge,
                                            .usual = WH_PLACE_OPTIMAL,
                                            .near = true,
                                            .bytes = sizeof(wh_quadric)};
