/*
 * policy: which collapse comes first, and where it puts its vertex, other than by the engine's own
 * memoryless quadrics. Each policy is a file; the queue loop, the legality of a collapse and the
 * error limit are the engine's, whatever the policy.
 *
 *     policy.c           the table of policies; an edge evaluated: places tried, the cheapest taken
 *     policy_qem.c       quadrics that are summed up (Garland & Heckbert 1997), from faces or from
 *                        vertex normals, with their weights
 *     policy_melax.c     edge length times curvature (Melax 1998)
 *     policy_plain.c     edge length alone; the memoryless quadrics, for other placements
 *     policy_own.c       a caller's own
 *
 * What a policy sums up lasts as long as the run of wh_simplify: it starts from the faces of the
 * patch that is given.
 */
#ifndef WH_ALGO_POLICY_H
#define WH_ALGO_POLICY_H

#include "base/edge_view.h"

#include <stddef.h>

typedef enum wh_cost {
	WH_COST_MEMORYLESS, /* with the usual placement: the engine's own, and no policy at all */
	WH_COST_QEM,
	WH_COST_NORMALS, /* quadrics of one plane a vertex, across its normal */
	WH_COST_MELAX,
	WH_COST_LENGTH,
	WH_COST_OWN,
	WH_COSTS
} wh_cost;

/* How much a face counts in the quadrics and the normals of its corners. */
typedef enum wh_weight {
	WH_WEIGHT_AREA,
	WH_WEIGHT_UNIFORM, /* as any other */
	WH_WEIGHT_ANGLE,   /* area times the angle at the corner / pi */
	WH_WEIGHTS
} wh_weight;

typedef enum wh_placement {
	WH_PLACE_USUAL, /* of the cost: one of those below */
	WH_PLACE_OPTIMAL,
	WH_PLACE_MIDPOINT,
	WH_PLACE_ENDPOINT,
	WH_PLACEMENTS
} wh_placement;

/* What is wanted. Zero: the engine's own. */
typedef struct wh_policy_choice {
	wh_cost cost;
	wh_weight weight;
	wh_placement placement;
	const wh_own_policy *own; /* with WH_COST_OWN */
	double unscale;           /* positions times this are in the file's units; for `own` */
} wh_policy_choice;

/* Names as users write them. False for others. */
bool wh_cost_parse(const char *name, wh_cost *cost);
bool wh_weight_parse(const char *name, wh_weight *weight);
bool wh_placement_parse(const char *name, wh_placement *placement);

/* Bytes that a policy keeps for each vertex while wh_simplify runs. */
size_t wh_policy_bytes(const wh_policy_choice *choice);

#endif
