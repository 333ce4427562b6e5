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
 *
 * Where both meshes have colours, the difference of colour of a sample is that between its own
 * colour, interpolated in its face, and that of the nearest point of the other mesh: the root of
 * the mean square of the differences in red, green and blue.
 *
 * Do the cuts between clusters show in b, a reduced a? Given points along the cuts, the faces of b
 * near them form a band, and the rest of it the interior; a sample of b belongs to the zone of the
 * face it is on, a sample of a to that of the face nearest to it. Error and faces an area differ
 * between the zones also where no cut has left a trace: the mesh may be rougher where it was cut,
 * and large faces are more often nearest to a point than small ones. So the ratios of band and
 * interior mean something only beside those of a result of as many faces that was never cut, with
 * the same points: no trace is left when they are equal.
 */
#ifndef WH_ALGO_COMPARE_H
#define WH_ALGO_COMPARE_H

#include "mesh/bvh.h"

/* Gives points first .. first+n-1 of a list, finite. Called by several threads. */
typedef wh_code (*wh_points_fetch)(wh_ctx *c, void *user, uint64_t first, size_t n,
                                   wh_vec3 *points);

typedef struct wh_compare_params {
	uint64_t samples; /* a side; 0: as many as the larger mesh has faces, from 1 to 4 million */
	uint64_t seed;    /* sample i is a function of seed and i alone */
	const wh_vec3 *cuts; /* points along cuts, finite; NULL: no band is asked for, but ... */
	uint64_t ncuts;
	wh_points_fetch fetch_cuts; /* ... by this, where it is not NULL */
	void *cuts_user;
	size_t memory; /* bytes for pages of a surface that is not open as a whole, and all else
	                  that comparing holds; 0: as much as there is */
	void (*tell)(void *user, uint64_t n); /* n points more are measured; may be NULL */
	void *tell_user;
} wh_compare_params;

/*
 * Distances of samples by size. Four bins to each power of two, of equal width: upper ends
 * are 1.25, 1.5, 1.75 and 2 times powers of two. The last bin is that of the largest distance, and
 * the first one has everything below as well, so that the bins reach down to 2^-16 of it.
 */
enum { WH_HISTOGRAM = 64 };

typedef struct wh_histogram {
	double end[WH_HISTOGRAM]; /* upper ends, in the units of the meshes; 0 without samples */
	uint64_t count[WH_HISTOGRAM];
} wh_histogram;

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
	uint64_t colours;   /* samples with a colour at either end */
	double colour_mean; /* of their differences of colour, from 0 to 255 */
	double colour_rms;
	wh_histogram histogram;
} wh_distance;

enum { WH_BAND_RINGS = 3 }; /* the band is this many faces wide on either side of the cuts */

/* The band along the cuts, or all the rest of b. */
typedef struct wh_compare_zone {
	uint64_t faces; /* of b */
	double area;
	uint64_t samples; /* of both sides */
	double rms;       /* of their distances; 0 if there are none */
	uint64_t colours; /* samples that have a difference of colour */
	double colour_rms;
} wh_compare_zone;

/*
 * A part of a: as many of its faces as of any other part, next to each other in the spatial order,
 * or 512 of them where a has fewer than 32 Ki. A sample of b belongs to that of the face nearest
 * to it.
 */
enum { WH_REGIONS = 64 };

typedef struct wh_compare_region {
	wh_vec3 lo, hi; /* around its faces */
	uint64_t faces;
	double area;
	struct {
		uint64_t samples;
		double rms; /* of their distances; 0 if there are none, as is the next */
		double max;
	} a_to_b, b_to_a;
} wh_compare_region;

typedef struct wh_compare {
	double diagonal;    /* of the box around a: what relative figures are relative to */
	wh_distance a_to_b; /* points of a, distances from b */
	wh_distance b_to_a;
	wh_distance both;  /* the samples of both sides as one set */
	double rms;        /* the larger of the two sides' RMS: what "two-sided RMS" means in
	                    * comparisons of simplifiers, ours included */
	double normal_rms; /* the larger of the two sides' */
	double colour_rms; /* the larger of the two sides', where both meshes have colours */
	wh_compare_zone band, interior; /* all 0 when no band is asked for */
	bool banded;                    /* it was */
	uint32_t regions;               /* WH_REGIONS at most */
	wh_compare_region region[WH_REGIONS];
} wh_compare;

/* Samples a side that the parameters ask for. */
uint64_t wh_compare_samples(const wh_bvh *a, const wh_bvh *b, const wh_compare_params *params);

/*
 * Measures a against b, whose pages are all added; finishes both in one frame. With a band, b's
 * vertices must have numbers. The result is the same, to the bit, for any number of threads and
 * any memory: what does not fit is read again. WH_E_PLAN when the memory is not even enough for
 * that.
 */
wh_code wh_compare_surfaces(wh_ctx *c, const wh_exec *ex, wh_bvh *a, wh_bvh *b,
                            const wh_compare_params *params, wh_compare *r);

/*
 * The same of meshes in memory. WH_E_INPUT when one has no faces or a position in use is not
 * finite; faces must be valid (wh_check), but may be degenerate.
 */
wh_code wh_compare_meshes(wh_ctx *c, const wh_exec *ex, const wh_mesh *a, const wh_mesh *b,
                          const wh_compare_params *params, wh_compare *r);

/* Band over interior: RMS, and faces an area. Not a number when either has none. */
double wh_compare_rms_ratio(const wh_compare *r);
double wh_compare_density_ratio(const wh_compare *r);

#endif
