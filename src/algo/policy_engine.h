/* policy_engine: what the files of the policies share with the engine and with each other. */
#ifndef WH_ALGO_POLICY_ENGINE_H
#define WH_ALGO_POLICY_ENGINE_H

#include "algo/simplify_engine.h"

/* An edge of a fan. Places are relative to the hub. */
typedef struct wh_edge {
	const wh_engine *e;
	const wh_fan *fan;
	uint32_t i; /* in the fan */
	uint32_t hub, other;
	wh_vec3 to; /* the other end */
	bool rim;   /* a boundary edge */
	bool locked;
} wh_edge;

struct wh_policy {
	/* A run begins: stars are made, the patch has all its faces yet. NULL: nothing to do. */
	wh_code (*begin)(wh_engine *e);
	/* What the edge costs with its vertex at x, which the policy may move; *weight: what costs
	 * are divided by to be squared distances, 0 where they are none. */
	double (*cost)(const wh_edge *d, wh_vec3 *x, double *weight);
	/* The best place. NULL: that of the memoryless quadrics. */
	wh_vec3 (*best)(const wh_edge *d);
	/* A collapse is about to be made. NULL: nothing is kept of it. */
	void (*merge)(wh_engine *e, const wh_trial *t);
	wh_placement usual;
	bool near;    /* a collapse changes the costs of the new vertex' edges alone */
	size_t bytes; /* kept for each vertex */
};

extern const struct wh_policy wh_policy_qem, wh_policy_normals, wh_policy_melax, wh_policy_length,
    wh_policy_plain, wh_policy_own;

/* The faces of the free vertex v as area vectors, counter-clockwise; returns how many. */
uint32_t wh_policy_faces(const wh_engine *e, uint32_t v, wh_vec3 *face);

#endif
