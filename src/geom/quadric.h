/*
 * quadric: the sum of weighted squared distances of a point from planes (Garland & Heckbert 1997),
 * about an origin of the caller's: p'Ap + 2 b'p + c. Away from it digits are lost, so it should be
 * near.
 */
#ifndef WH_GEOM_QUADRIC_H
#define WH_GEOM_QUADRIC_H

#include "geom/vec3.h"

#include <stdbool.h>

typedef struct wh_quadric {
	double xx, xy, xz, yy, yz, zz; /* A */
	wh_vec3 b;
	double c;
	double weight; /* of all its planes */
} wh_quadric;

/* Adds the plane n p + d = 0; n is as long as 1. */
static inline void wh_quadric_add_plane(wh_quadric *q, wh_vec3 n, double d, double weight)
{
	const wh_vec3 wn = wh_scale(n, weight);
	q->xx += wn.x * n.x;
	q->xy += wn.x * n.y;
	q->xz += wn.x * n.z;
	q->yy += wn.y * n.y;
	q->yz += wn.y * n.z;
	q->zz += wn.z * n.z;
	q->b = wh_add(q->b, wh_scale(wn, d));
	q->c += weight * d * d;
	q->weight += weight;
}

/* Both about the same origin. */
static inline wh_quadric wh_quadric_sum(const wh_quadric *a, const wh_quadric *b)
{
	return (wh_quadric){a->xx + b->xx,      a->xy + b->xy, a->xz + b->xz,
	                    a->yy + b->yy,      a->yz + b->yz, a->zz + b->zz,
	                    wh_add(a->b, b->b), a->c + b->c,   a->weight + b->weight};
}

/* Ap */
static inline wh_vec3 wh_quadric_times(const wh_quadric *q, wh_vec3 p)
{
	return wh_v3(q->xx * p.x + q->xy * p.y + q->xz * p.z,
	             q->xy * p.x + q->yy * p.y + q->yz * p.z,
	             q->xz * p.x + q->yz * p.y + q->zz * p.z);
}

static inline double wh_quadric_at(const wh_quadric *q, wh_vec3 p)
{
	return wh_dot(p, wh_quadric_times(q, p)) + 2 * wh_dot(q->b, p) + q->c;
}

/* The same about an origin that is `to` away from the one before. */
static inline wh_quadric wh_quadric_moved(const wh_quadric *q, wh_vec3 to)
{
	wh_quadric m = *q;
	m.b = wh_add(q->b, wh_quadric_times(q, to));
	m.c = wh_quadric_at(q, to);
	return m;
}

/* Where it is least. False where the planes leave a direction free, or nearly. */
static inline bool wh_quadric_minimum(const wh_quadric *q, wh_vec3 *p)
{
	const double cxx = q->yy * q->zz - q->yz * q->yz, cxy = q->xz * q->yz - q->xy * q->zz;
	const double cxz = q->xy * q->yz - q->xz * q->yy, cyy = q->xx * q->zz - q->xz * q->xz;
	const double cyz = q->xy * q->xz - q->xx * q->yz, czz = q->xx * q->yy - q->xy * q->xy;
	const double det = q->xx * cxx + q->xy * cxy + q->xz * cxz;
	const double trace = q->xx + q->yy + q->zz;
	if (!(det > 1e-9 * trace * trace * trace))
		return false;
	const wh_vec3 b = wh_scale(q->b, -1 / det);
	*p = wh_v3(cxx * b.x + cxy * b.y + cxz * b.z, cxy * b.x + cyy * b.y + cyz * b.z,
	           cxz * b.x + cyz * b.y + czz * b.z);
	return true;
}

/* The same on the segment from the origin to `end`: its middle where all of it is alike. */
static inline wh_vec3 wh_quadric_minimum_along(const wh_quadric *q, wh_vec3 end)
{
	const double bend = wh_dot(end, wh_quadric_times(q, end)), slope = wh_dot(end, q->b);
	const double at = bend > 1e-12 * q->weight * wh_norm2(end) ? -slope / bend : 0.5;
	return wh_scale(end, at < 0 ? 0 : at > 1 ? 1 : at);
}

#endif
