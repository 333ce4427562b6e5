/*
 * The policies by name, and an edge evaluated by one: each place that the placement has is tried,
 * and the cheapest is taken; of two that cost the same, the one nearer to the first tried.
 *
 * Cost: the edges of a vertex one after the other, in plain code; ten times that of fan.c.
 */
#include "algo/policy_engine.h"

#include <string.h>

static const struct named {
	const char *name;
	const struct wh_policy *policy;
} costs[WH_COSTS] = {
    [WH_COST_MEMORYLESS] = {"memoryless", &wh_policy_plain},
    [WH_COST_QEM] = {"qem", &wh_policy_qem},
    [WH_COST_NORMALS] = {"qem-normals", &wh_policy_normals},
    [WH_COST_MELAX] = {"melax", &wh_policy_melax},
    [WH_COST_LENGTH] = {"edge-length", &wh_policy_length},
    [WH_COST_OWN] = {"own", &wh_policy_own},
};

static const char *const weights[WH_WEIGHTS] = {"area", "uniform", "angle"};
static const char *const placements[WH_PLACEMENTS] = {"usual", "optimal", "midpoint", "endpoint"};

/* ---- names -------------------------------------------------------------------------------- */

/* The place of a name among n; -1: it is not there. */
static int find(const char *const *list, int n, const char *name)
{
	for (int i = 0; i < n; i++)
		if (strcmp(list[i], name) == 0)
			return i;
	return -1;
}

bool wh_cost_parse(const char *name, wh_cost *cost)
{
	for (int i = 0; i < WH_COST_OWN; i++)
		if (strcmp(costs[i].name, name) == 0) {
			*cost = (wh_cost)i;
			return true;
		}
	return false;
}

bool wh_weight_parse(const char *name, wh_weight *weight)
{
	const int i = find(weights, WH_WEIGHTS, name);
	*weight = i < 0 ? WH_WEIGHT_AREA : (wh_weight)i;
	return i >= 0;
}

bool wh_placement_parse(const char *name, wh_placement *placement)
{
	const int i = find(placements, WH_PLACEMENTS, name);
	*placement = i < 0 ? WH_PLACE_USUAL : (wh_placement)i;
	return i > 0;
}

/* ---- the engine's ------------------------------------------------------------------------- */

/* The engine's own costs in the engine's own places are its own business. */
static const struct wh_policy *policy_of(const wh_policy_choice *k)
{
	if (k->cost == WH_COST_MEMORYLESS &&
	    (k->placement == WH_PLACE_USUAL || k->placement == WH_PLACE_OPTIMAL))
		return NULL;
	return costs[k->cost].policy;
}

size_t wh_policy_bytes(const wh_policy_choice *choice)
{
	const struct wh_policy *p = policy_of(choice);
	return p ? p->bytes : 0;
}

void wh_policy_choose(wh_engine *e)
{
	const wh_policy_choice *k = &e->params->policy;
	e->policy = policy_of(k);
	if (e->policy)
		e->placement = k->placement == WH_PLACE_USUAL ? e->policy->usual : k->placement;
}

wh_code wh_policy_begin(wh_engine *e)
{
	return e->policy->begin ? e->policy->begin(e) : WH_OK;
}

void wh_policy_merge(wh_engine *e, const wh_trial *t)
{
	if (e->policy->merge)
		e->policy->merge(e, t);
}

bool wh_policy_is_wide(const wh_engine *e)
{
	return !e->policy->near;
}

uint32_t wh_policy_faces(const wh_engine *e, uint32_t v, wh_vec3 *face)
{
	const wh_star *star = e->w->star, *s = &star[v];
	const uint32_t *ring = wh_ring(e, v), n = s->n - !s->closed;
	for (uint32_t i = 0; i < n; i++)
		face[i] = wh_cross(wh_sub(star[ring[i]].pos, s->pos),
		                   wh_sub(star[ring[i + 1 < s->n ? i + 1 : 0]].pos, s->pos));
	return n;
}

/* ---- an edge ------------------------------------------------------------------------------ */

enum { MOST_PLACES = 2 };

/* The places to try. */
static uint32_t places(const wh_edge *d, wh_vec3 at[MOST_PLACES])
{
	const wh_fan *f = d->fan;
	at[0] = d->to;
	if (d->locked)
		return 1;
	switch (d->e->placement) {
	case WH_PLACE_MIDPOINT:
		at[0] = wh_scale(d->to, 0.5);
		return 1;
	case WH_PLACE_ENDPOINT:
		at[0] = wh_v3(0, 0, 0);
		at[1] = d->to;
		return 2;
	default:
		at[0] = d->e->policy->best ? d->e->policy->best(d) : wh_rows3_at(&f->place, d->i);
		return 1;
	}
}

/* What is below nothing is a rounding error; what is no number is no answer. */
static double sane(double cost)
{
	return cost > 0 ? cost : cost <= 0 ? 0 : (double)INFINITY;
}

static void evaluate(const wh_edge *d, wh_fan *f)
{
	wh_vec3 at[MOST_PLACES];
	const uint32_t n = places(d, at), i = d->i;
	f->cost.at[i] = (double)INFINITY;
	f->weight.at[i] = 0;
	for (uint32_t k = 0; k < n; k++) {
		double weight = 0;
		wh_vec3 x = at[k];
		const double raw = sane(d->e->policy->cost(d, &x, &weight));
		/* where the faces do not tell, short edges go first */
		const double cost = raw + d->e->manner->length_tie * weight * wh_norm2(d->to);
		if (k > 0 && !(cost < f->cost.at[i]))
			continue;
		x = d->locked ? d->to : x;
		f->cost.at[i] = cost;
		f->weight.at[i] = weight;
		f->place.x.at[i] = x.x;
		f->place.y.at[i] = x.y;
		f->place.z.at[i] = x.z;
	}
}

void wh_policy_evaluate(const wh_engine *e, uint32_t hub, wh_fan *f)
{
	if (e->placement == WH_PLACE_OPTIMAL && !e->policy->best)
		wh_fan_evaluate(f, &e->w->star[hub].sum, e->manner);
	for (uint32_t i = 0; i < f->n; i++) {
		const wh_edge d = {.e = e,
		                   .fan = f,
		                   .i = i,
		                   .hub = hub,
		                   .other = f->id[i],
		                   .to = wh_rows3_at(&f->to, i),
		                   .rim = f->rim.at[i] > 0,
		                   .locked = f->locked.at[i] > 0};
		if (isinf(f->bar.at[i]))
			f->cost.at[i] = (double)INFINITY;
		else
			evaluate(&d, f);
		f->cost.at[i] += f->bar.at[i];
	}
}

double wh_policy_least(const wh_engine *e, uint32_t v)
{
	wh_fan *f = &e->w->fan;
	double least = (double)INFINITY;
	wh_fan_gather(e, v, f);
	wh_policy_evaluate(e, v, f);
	for (uint32_t i = 0; i < f->n; i++)
		least = f->cost.at[i] < least ? f->cost.at[i] : least;
	return least;
}
