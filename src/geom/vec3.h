/* vec3: three doubles and the arithmetic on them. */
#ifndef WH_GEOM_VEC3_H
#define WH_GEOM_VEC3_H

#include <math.h>

typedef struct wh_vec3 {
	double x, y, z;
} wh_vec3;

static inline wh_vec3 wh_v3(double x, double y, double z)
{
	return (wh_vec3){x, y, z};
}

static inline wh_vec3 wh_add(wh_vec3 a, wh_vec3 b)
{
	return wh_v3(a.x + b.x, a.y + b.y, a.z + b.z);
}

static inline wh_vec3 wh_sub(wh_vec3 a, wh_vec3 b)
{
	return wh_v3(a.x - b.x, a.y - b.y, a.z - b.z);
}

static inline wh_vec3 wh_scale(wh_vec3 a, double s)
{
	return wh_v3(a.x * s, a.y * s, a.z * s);
}

/* Corners of a box around two: a's coordinates where b's are not beyond them. */
static inline wh_vec3 wh_lower(wh_vec3 a, wh_vec3 b)
{
	return wh_v3(b.x < a.x ? b.x : a.x, b.y < a.y ? b.y : a.y, b.z < a.z ? b.z : a.z);
}

static inline wh_vec3 wh_upper(wh_vec3 a, wh_vec3 b)
{
	return wh_v3(b.x > a.x ? b.x : a.x, b.y > a.y ? b.y : a.y, b.z > a.z ? b.z : a.z);
}

static inline double wh_dot(wh_vec3 a, wh_vec3 b)
{
	return a.x * b.x + a.y * b.y + a.z * b.z;
}

static inline wh_vec3 wh_cross(wh_vec3 a, wh_vec3 b)
{
	return wh_v3(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x);
}

static inline double wh_norm2(wh_vec3 a)
{
	return wh_dot(a, a);
}

static inline double wh_norm(wh_vec3 a)
{
	return sqrt(wh_norm2(a));
}

#endif
