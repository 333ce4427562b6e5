/* tri: points and triangles. */
#ifndef WH_GEOM_TRI_H
#define WH_GEOM_TRI_H

#include "geom/vec3.h"

#include <stdbool.h>

/* Squared distance of the origin from the segment between a and a + ab; ab may be 0. */
static inline double wh_segment_dist2(wh_vec3 a, wh_vec3 ab)
{
	const double along = -wh_dot(a, ab);
	const double len2 = wh_norm2(ab);
	if (!(along > 0) || !(len2 > 0))
		return wh_norm2(a);
	const double t = along < len2 ? along / len2 : 1;
	return wh_norm2(wh_add(a, wh_scale(ab, t)));
}

/*
 * Squared distance of p from the triangle abc, inside included. When the foot of the
 * perpendicular is inside, it is the height over the plane; else the nearest of the three sides
 * is. Triangles on a line or in a point have no inside and need no other care.
 */
static inline double wh_tri_dist2(wh_vec3 p, wh_vec3 a, wh_vec3 b, wh_vec3 c)
{
	const wh_vec3 pa = wh_sub(a, p), pb = wh_sub(b, p), pc = wh_sub(c, p);
	const wh_vec3 ab = wh_sub(b, a), bc = wh_sub(c, b), ca = wh_sub(a, c);
	const wh_vec3 n = wh_cross(ab, bc);
	const double nn = wh_norm2(n);
	const bool in_ab = wh_dot(wh_cross(pa, ab), n) >= 0;
	const bool in_bc = wh_dot(wh_cross(pb, bc), n) >= 0;
	const bool in_ca = wh_dot(wh_cross(pc, ca), n) >= 0;
	if (in_ab && in_bc && in_ca && nn > 0) {
		const double h = wh_dot(pa, n);
		return h * h / nn;
	}
	const double d_ab = wh_segment_dist2(pa, ab);
	const double d_bc = wh_segment_dist2(pb, bc);
	const double d_ca = wh_segment_dist2(pc, ca);
	return fmin(d_ab, fmin(d_bc, d_ca));
}

static inline double wh_largest_coordinate(wh_vec3 a)
{
	return fmax(fabs(a.x), fmax(fabs(a.y), fabs(a.z)));
}

/*
 * Twice the radius of the inscribed circle over that of the circumscribed one: 1 for equilateral
 * triangles, 0 for those on a line; corners are finite. Only the shape matters: sides are first
 * scaled to about 1 by a power of two, so that a scaled mesh has the same bits and no size over-
 * or underflows.
 */
static inline double wh_tri_radius_ratio(wh_vec3 a, wh_vec3 b, wh_vec3 c)
{
	wh_vec3 ab = wh_sub(b, a), bc = wh_sub(c, b), ca = wh_sub(a, c);
	const double size = fmax(wh_largest_coordinate(ab), wh_largest_coordinate(bc));
	if (!(size > 0) || isinf(size))
		return 0;
	const double scale = ldexp(1, -(int)fmax(ilogb(size), -1000));
	ab = wh_scale(ab, scale);
	bc = wh_scale(bc, scale);
	ca = wh_scale(ca, scale);
	/* r = 2 A / (|ab| + |bc| + |ca|), R = |ab| |bc| |ca| / (4 A), and |ab x bc| = 2 A */
	const double x = wh_norm(ab), y = wh_norm(bc), z = wh_norm(ca);
	const double product = (x + y + z) * x * y * z;
	return product > 0 ? fmin(4 * wh_norm2(wh_cross(ab, bc)) / product, 1) : 0;
}

#endif
