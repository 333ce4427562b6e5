/* tri: points and triangles. */
#ifndef WH_GEOM_TRI_H
#define WH_GEOM_TRI_H

#include "geom/vec3.h"

#include <stdbool.h>

#define WH_PI 3.14159265358979323846

/* The angle, from 0 to pi, whose sine (not negative) and cosine, times anything, are these. Halved
 * until few terms of the series are enough: C libraries do not agree on the last bits of theirs. */
static inline double wh_angle(double sine, double cosine)
{
	const double norm = sqrt(sine * sine + cosine * cosine);
	if (!(norm > 0))
		return 0;
	double t = sine / (norm + fabs(cosine)); /* tangent of the half */
	for (int i = 0; i < 2; i++)
		t = t / (1 + sqrt(1 + t * t));
	double sum = 0;
	for (int k = 21; k > 0; k -= 2)
		sum = 1.0 / k - t * t * sum;
	const double angle = 8 * t * sum;
	return cosine < 0 ? WH_PI - angle : angle;
}

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
 * Squared distance of the origin from the triangle abc, inside included, however thin it is: when
 * the foot of the perpendicular is inside, the height over the plane, else the distance of the
 * nearest of the three sides. Triangles on a line or in a point have no inside.
 */
static inline double wh_thin_dist2(wh_vec3 a, wh_vec3 b, wh_vec3 c)
{
	const wh_vec3 ab = wh_sub(b, a), bc = wh_sub(c, b), ca = wh_sub(a, c);
	const wh_vec3 n = wh_cross(ab, bc);
	const double nn = wh_norm2(n);
	if (nn > 0 && wh_dot(wh_cross(a, ab), n) >= 0 && wh_dot(wh_cross(b, bc), n) >= 0 &&
	    wh_dot(wh_cross(c, ca), n) >= 0) {
		const double h = wh_dot(a, n);
		return h * h / nn;
	}
	const double d_ab = wh_segment_dist2(a, ab);
	const double d_bc = wh_segment_dist2(b, bc);
	const double d_ca = wh_segment_dist2(c, ca);
	const double least = d_bc < d_ca ? d_bc : d_ca;
	return d_ab < least ? d_ab : least;
}

/* Squared distance of the origin from a side that begins at a and is not 0: `along` it to the foot
 * of the perpendicular, times its length, whose square is len2. */
static inline double wh_side_dist2(wh_vec3 a, wh_vec3 side, double along, double len2)
{
	double t = along / len2;
	t = t > 0 ? t : 0;
	t = t < 1 ? t : 1;
	return wh_norm2(wh_add(a, wh_scale(side, t)));
}

/*
 * Squared distance of p from the triangle abc, inside included. When the foot of the perpendicular
 * is inside, by its shares of the area, it is the height over the plane; else only the sides that
 * have the foot on their outer side are looked at: the nearest point is on one of them, as a corner
 * is nearest only to points that are outside of one of its sides. Where rounding may decide what is
 * inside, with angles below some thousandth, nothing is taken for granted.
 */
static inline double wh_tri_dist2(wh_vec3 p, wh_vec3 a, wh_vec3 b, wh_vec3 c)
{
	const double thin = 1e-6; /* square of the sine of the angle at a */
	const wh_vec3 pa = wh_sub(a, p), ab = wh_sub(b, a), ac = wh_sub(c, a);
	const double on_ab = -wh_dot(pa, ab), on_ac = -wh_dot(pa, ac);
	const double bb = wh_norm2(ab), cc = wh_norm2(ac), bc = wh_dot(ab, ac);
	const double whole = bb * cc - bc * bc;
	const double share_b = cc * on_ab - bc * on_ac, share_c = bb * on_ac - bc * on_ab;
	if (!(whole > thin * (bb * cc)))
		return wh_thin_dist2(pa, wh_sub(b, p), wh_sub(c, p));
	if (share_b >= 0 && share_c >= 0 && share_b + share_c <= whole) {
		const wh_vec3 n = wh_cross(ab, ac);
		const double h = wh_dot(pa, n);
		return h * h / wh_norm2(n);
	}
	double least = INFINITY;
	if (share_c < 0)
		least = wh_side_dist2(pa, ab, on_ab, bb);
	if (share_b < 0) {
		const double d = wh_side_dist2(pa, ac, on_ac, cc);
		least = d < least ? d : least;
	}
	if (share_b + share_c > whole) {
		const wh_vec3 pb = wh_sub(b, p), side = wh_sub(c, b);
		const double d = wh_side_dist2(pb, side, -wh_dot(pb, side), wh_norm2(side));
		least = d < least ? d : least;
	}
	return least;
}

/*
 * The point of the triangle abc that is nearest to p, as weights of the corners: not negative, and
 * one in sum. Goes by the regions of corners, sides and inside that p may project to (Ericson,
 * "Real-Time Collision Detection", 2005, 5.1.5). Triangles on a line or in a point may give another
 * point of theirs than the nearest.
 */
static inline void wh_tri_nearest(wh_vec3 p, wh_vec3 a, wh_vec3 b, wh_vec3 c, double w[3])
{
	const wh_vec3 ab = wh_sub(b, a), ac = wh_sub(c, a);
	const wh_vec3 ap = wh_sub(p, a), bp = wh_sub(p, b), cp = wh_sub(p, c);
	const double ab_a = wh_dot(ab, ap), ab_b = wh_dot(ab, bp), ab_c = wh_dot(ab, cp);
	const double ac_a = wh_dot(ac, ap), ac_b = wh_dot(ac, bp), ac_c = wh_dot(ac, cp);
	/* areas of p's projection with each side, times twice that of the triangle */
	const double bc_area = ab_b * ac_c - ab_c * ac_b;
	const double ca_area = ab_c * ac_a - ab_a * ac_c;
	const double ab_area = ab_a * ac_b - ab_b * ac_a;
	const double sum = bc_area + ca_area + ab_area;
	w[0] = 1;
	w[1] = w[2] = 0;
	if (ab_a <= 0 && ac_a <= 0)
		return;
	if (ab_b >= 0 && ac_b <= ab_b) {
		w[1] = 1;
		w[0] = 0;
	} else if (ac_c >= 0 && ab_c <= ac_c) {
		w[2] = 1;
		w[0] = 0;
	} else if (ab_area <= 0 && ab_a >= 0 && ab_b <= 0 && ab_a > ab_b) {
		w[1] = ab_a / (ab_a - ab_b);
		w[0] = 1 - w[1];
	} else if (ca_area <= 0 && ac_a >= 0 && ac_c <= 0 && ac_a > ac_c) {
		w[2] = ac_a / (ac_a - ac_c);
		w[0] = 1 - w[2];
	} else if (bc_area <= 0 && ac_b > ab_b && ab_c > ac_c) {
		w[2] = (ac_b - ab_b) / (ac_b - ab_b + ab_c - ac_c);
		w[1] = 1 - w[2];
		w[0] = 0;
	} else if (sum > 0) {
		w[1] = ca_area / sum;
		w[2] = ab_area / sum;
		w[0] = 1 - w[1] - w[2];
	}
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

/* The direction of the normal, of length 1 to rounding: zero for triangles so near to a line
 * that rounding decides, or with a corner that is not finite. Scaled as the radius ratio is. */
static inline wh_vec3 wh_tri_direction(wh_vec3 a, wh_vec3 b, wh_vec3 c)
{
	const wh_vec3 ab = wh_sub(b, a), ac = wh_sub(c, a);
	const double size = fmax(wh_largest_coordinate(ab), wh_largest_coordinate(ac));
	if (!(size > 0) || isinf(size))
		return wh_v3(0, 0, 0);
	const double scale = ldexp(1, -(int)fmax(ilogb(size), -1000));
	const wh_vec3 n = wh_cross(wh_scale(ab, scale), wh_scale(ac, scale));
	const double length = wh_norm(n);
	return length > 1e-13 ? wh_scale(n, 1 / length) : wh_v3(0, 0, 0);
}

#endif
