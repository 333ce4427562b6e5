/*
 * Policies without a state or a formula of their own: the length of the edge; and the memoryless
 * quadrics of fan.c, at places that those did not choose.
 */
#include "algo/policy_engine.h"

static double length_cost(const wh_edge *d, wh_vec3 *x, double *weight)
{
	(void)x;
	*weight = 0; /* no distance from a surface */
	return wh_norm(d->to);
}

const struct wh_policy wh_policy_length = {
    .cost = length_cost, .usual = WH_PLACE_MIDPOINT, .near = true};

/* d'Ad */
static double form(const wh_vertex_sum *a, wh_vec3 d)
{
	return d.x * (a->xx * d.x + 2 * (a->xy * d.y + a->xz * d.z)) +
	       d.y * (a->yy * d.y + 2 * a->yz * d.z) + d.z * a->zz * d.z;
}

static double trace(const wh_vertex_sum *a)
{
	return a->xx + a->yy + a->zz;
}

/* Of a shared face, which both ends count: its part in the cost, and in the weight. */
static double shared_cost(const wh_rows3 *face, uint32_t i, wh_vec3 x, double *weight)
{
	const wh_vec3 n = wh_rows3_at(face, i);
	const double n2 = wh_norm2(n), w = wh_face_weight(n2), h = wh_dot(n, x);
	*weight -= w * n2;
	return w * h * h;
}

/* For places on the edge: there a boundary edge, which the sums of both ends hold, adds nothing. */
static double memoryless_cost(const wh_edge *d, wh_vec3 *x, double *weight)
{
	const wh_star *star = d->e->w->star;
	const wh_vertex_sum *a = &star[d->hub].sum, *b = &star[d->other].sum;
	*weight = trace(a) + trace(b);
	double cost = form(a, *x) + form(b, wh_sub(*x, d->to));
	cost -= shared_cost(&d->fan->before, d->i, *x, weight);
	cost -= shared_cost(&d->fan->after, d->i, *x, weight);
	*weight = *weight > 0 ? *weight : 0;
	return cost;
}

const struct wh_policy wh_policy_plain = {.cost = memoryless_cost, .usual = WH_PLACE_OPTIMAL};
