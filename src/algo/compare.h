/*
 * compare: how far two surfaces are from each other.
 *
 * The distance of a point from a surface is to the nearest point of any of its triangles, exact
 * up to rounding. Each side is sampled: points spread over its area, one in each of n strata of
 * equal area, and all of its vertices. Mean, RMS and percentiles are of the area samples, so they
 * do not depend on how a surface is cut into triangles; the maximum is of samples and vertices.
 * Vertices that no face uses play no part.
 *
 * The normal deviation of a sample is the angle between the normals of the face it is on and of
 * the face nearest to it. On an edge or a corner one of the faces there is nearest: which one
 * depends on the meshes and the samples alone. Opposite orientations differ by 180 degrees.
 */
#ifndef WH_ALGO_COMPARE_H
#define WH_ALGO_COMPARE_H

#include "exec/exec.h"
#include "mesh/mesh.h"

typedef struct wh_compare_params {
	uint64_t samples; /* a side; 0: 1 million, or the faces of the larger mesh if more */
	uint64_t seed;    /* sample i is a function of seed and i alone */
} wh_compare_params;

/* Distances in the units of the meshes. */
typedef struct wh_distance {
	uint64_t samples;  /* points on the area */
	uint64_t vertices; /* vertices measured beside them */
	double mean;
	double rms;
	double max;
	double p50, p90, p99; /* of the samples this share is no farther; within 1 % */
	uint64_t normals;     /* samples with a normal at either end: no degenerate face there */
	double normal_mean;   /* of their normal deviation, degrees */
	double normal_rms;
} wh_distance;

typedef struct wh_compare {
	double diagonal;    /* of the box around a: what relative figures are relative to */
	wh_distance a_to_b; /* points of a, distances from b */
	wh_distance b_to_a;
	wh_distance both;  /* the samples of both sides as one set */
	double rms;        /* the larger of the two sides' RMS: what "two-sided RMS" means in
	                    * comparisons of simplifiers, ours included */
	double normal_rms; /* the larger of the two sides' */
} wh_compare;

/*
 * Measures a against b. WH_E_INPUT when one has no faces or a position in use is not finite;
 * faces must be valid (wh_check), but may be degenerate. The result is the same, to the bit, for
 * any number of threads.
 */
wh_code wh_compare_meshes(wh_ctx *c, const wh_exec *ex, const wh_mesh *a, const wh_mesh *b,
                          const wh_compare_params *params, wh_compare *r);

#endif
