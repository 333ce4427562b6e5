#include "mesh/frame.h"

#include <stdint.h>
#include <stdlib.h>

enum {
	TAIL = 8,            /* one in so many is no part of the bulk, at either end of an axis */
	EXPONENT_MOST = 160, /* of local coordinates: sixth powers of lengths do not overflow */
	SHIFT_MOST = 960     /* no scale overflows */
};

static int by_value(const void *a, const void *b)
{
	const double x = *(const double *)a, y = *(const double *)b;
	return (x > y) - (x < y);
}

static int by_x(const void *a, const void *b)
{
	return by_value(&((const wh_vec3 *)a)->x, &((const wh_vec3 *)b)->x);
}

static int by_y(const void *a, const void *b)
{
	return by_value(&((const wh_vec3 *)a)->y, &((const wh_vec3 *)b)->y);
}

static int by_z(const void *a, const void *b)
{
	return by_value(&((const wh_vec3 *)a)->z, &((const wh_vec3 *)b)->z);
}

static double axis_of(const wh_vec3 *p, int axis)
{
	return axis == 0 ? p->x : axis == 1 ? p->y : p->z;
}

static int exponent_of(double x)
{
	int e = 0;
	if (x > 0)
		(void)frexp(x, &e); /* x < 2^e */
	return e;
}

/* How far from the origin, halved, a coordinate of the box may be. */
static double reach_of(double lo, double hi, double middle)
{
	return fmax(hi / 2 - middle / 2, middle / 2 - lo / 2);
}

wh_frame wh_frame_of_points(wh_vec3 *points, size_t n, wh_vec3 lo, wh_vec3 hi)
{
	static int (*const order[3])(const void *, const void *) = {by_x, by_y, by_z};
	const size_t tail = n / TAIL;
	double spread = 0, reach = 0, middle[3];
	for (int k = 0; k < 3; k++) {
		qsort(points, n, sizeof *points, order[k]);
		const double from = axis_of(&points[tail], k);
		const double to = axis_of(&points[n - 1 - tail], k);
		middle[k] = axis_of(&points[n / 2], k);
		spread = fmax(spread, to / 2 - from / 2);
		reach = fmax(reach, reach_of(axis_of(&lo, k), axis_of(&hi, k), middle[k]));
	}
	int e = exponent_of(spread > 0 ? spread : reach);
	const int most = exponent_of(reach) + 1;
	e = e < most - EXPONENT_MOST ? most - EXPONENT_MOST : e;
	e = e < -SHIFT_MOST ? -SHIFT_MOST : e > SHIFT_MOST ? SHIFT_MOST : e;
	return (wh_frame){wh_v3(middle[0], middle[1], middle[2]), ldexp(1, -e)};
}
