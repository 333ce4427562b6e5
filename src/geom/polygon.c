/*
 * Quads take the diagonal whose two triangles both face the polygon's way; where both or none
 * do, the shorter one, and of two equal ones that at the smallest id.
 *
 * Larger polygons: ear clipping (Meisters 1975) in the plane of the axes that show the polygon
 * largest, with the winding of its Newell normal. An ear is a convex corner whose triangle holds
 * no reflex corner. The search starts at the smallest id and goes on behind each ear cut, which
 * spreads the cuts around the polygon. A crossed polygon may run out of ears: then the corner at
 * hand goes as it is. Time O(n r) for r reflex corners: linear when convex.
 */
#include "geom/polygon.h"

#include <stdbool.h>

/* Newell's normal, twice the area long, summed about the corner `start` and from there on. */
static wh_vec3 newell(const wh_vec3 *pos, size_t n, size_t start)
{
	wh_vec3 sum = wh_v3(0, 0, 0);
	for (size_t i = 1; i + 1 < n; i++)
		sum = wh_add(sum, wh_cross(wh_sub(pos[(start + i) % n], pos[start]),
		                           wh_sub(pos[(start + i + 1) % n], pos[start])));
	return sum;
}

static uint32_t smallest_id(const uint64_t *ids, size_t n)
{
	uint32_t best = 0;
	for (uint32_t i = 1; i < n; i++)
		if (ids[i] < ids[best])
			best = i;
	return best;
}

static void put(uint32_t *corners, size_t triangle, uint32_t a, uint32_t b, uint32_t c)
{
	corners[3 * triangle] = a;
	corners[3 * triangle + 1] = b;
	corners[3 * triangle + 2] = c;
}

/* --- quads --- */

static bool faces_along(wh_vec3 a, wh_vec3 b, wh_vec3 c, wh_vec3 normal)
{
	return wh_dot(wh_cross(wh_sub(b, a), wh_sub(c, a)), normal) > 0;
}

/* q: the corners from the smallest id on. True: cut from corner 0 to 2; false: from 1 to 3. */
static bool cut_at_first(const wh_vec3 q[4])
{
	const wh_vec3 normal = wh_cross(wh_sub(q[2], q[0]), wh_sub(q[3], q[1]));
	const bool good02 =
	    faces_along(q[0], q[1], q[2], normal) && faces_along(q[0], q[2], q[3], normal);
	const bool good13 =
	    faces_along(q[0], q[1], q[3], normal) && faces_along(q[1], q[2], q[3], normal);
	if (good02 != good13)
		return good02;
	return wh_norm2(wh_sub(q[2], q[0])) <= wh_norm2(wh_sub(q[3], q[1]));
}

static void cut_quad(const wh_vec3 *pos, uint32_t start, uint32_t *corners)
{
	uint32_t k[4];
	wh_vec3 q[4];
	for (uint32_t i = 0; i < 4; i++) {
		k[i] = (start + i) % 4;
		q[i] = pos[k[i]];
	}
	const bool first = cut_at_first(q);
	put(corners, 0, k[0], k[1], first ? k[2] : k[3]);
	put(corners, 1, first ? k[0] : k[1], k[2], k[3]);
}

/* --- ears --- */

/* Drops the axis along which the normal is longest and keeps the winding counter-clockwise.
 * Coordinates are relative to the start, so that far-off polygons keep their digits. */
static void project(const wh_vec3 *pos, size_t n, uint32_t start, wh_polygon_workspace *s)
{
	const wh_vec3 normal = newell(pos, n, start);
	const double ax = fabs(normal.x), ay = fabs(normal.y), az = fabs(normal.z);
	for (size_t i = 0; i < n; i++) {
		const wh_vec3 d = wh_sub(pos[i], pos[start]);
		const bool by_z = az >= ax && az >= ay;
		const bool by_x = !by_z && ax >= ay;
		const double along = by_z ? normal.z : by_x ? normal.x : normal.y;
		const double u = by_z ? d.x : by_x ? d.y : d.z;
		const double v = by_z ? d.y : by_x ? d.z : d.x;
		s->x[i] = along < 0 ? v : u;
		s->y[i] = along < 0 ? u : v;
	}
}

/* Twice the signed area of a, b, c in the plane. */
static double turn(const wh_polygon_workspace *s, uint32_t a, uint32_t b, uint32_t c)
{
	return (s->x[b] - s->x[a]) * (s->y[c] - s->y[a]) -
	       (s->x[c] - s->x[a]) * (s->y[b] - s->y[a]);
}

static bool same_point(const wh_polygon_workspace *s, uint32_t a, uint32_t b)
{
	return s->x[a] == s->x[b] && s->y[a] == s->y[b];
}

/* Inside or on the edge of the triangle; its own corners' positions do not count. */
static bool holds(const wh_polygon_workspace *s, uint32_t a, uint32_t b, uint32_t c, uint32_t p)
{
	return turn(s, a, b, p) >= 0 && turn(s, b, c, p) >= 0 && turn(s, c, a, p) >= 0 &&
	       !same_point(s, a, p) && !same_point(s, b, p) && !same_point(s, c, p);
}

static void judge(wh_polygon_workspace *s, uint32_t i)
{
	s->reflex[i] = turn(s, s->prev[i], i, s->next[i]) <= 0;
}

static bool is_ear(const wh_polygon_workspace *s, uint32_t i)
{
	if (s->reflex[i])
		return false;
	const uint32_t a = s->prev[i];
	const uint32_t c = s->next[i];
	for (uint32_t p = s->next[c]; p != a; p = s->next[p])
		if (s->reflex[p] && holds(s, a, i, c, p))
			return false;
	return true;
}

static void link_corners(wh_polygon_workspace *s, uint32_t n)
{
	for (uint32_t i = 0; i < n; i++) {
		s->next[i] = i + 1 < n ? i + 1 : 0;
		s->prev[i] = i > 0 ? i - 1 : n - 1;
	}
	for (uint32_t i = 0; i < n; i++)
		judge(s, i);
}

static void unlink_corner(wh_polygon_workspace *s, uint32_t i)
{
	const uint32_t a = s->prev[i];
	const uint32_t c = s->next[i];
	s->next[a] = c;
	s->prev[c] = a;
	judge(s, a);
	judge(s, c);
}

static void cut_ears(uint32_t n, uint32_t start, uint32_t *corners, wh_polygon_workspace *s)
{
	uint32_t at = start;
	for (uint32_t left = n; left > 3; left--) {
		uint32_t tried = 0;
		while (tried < left && !is_ear(s, at)) {
			at = s->next[at];
			tried++;
		}
		put(corners, n - left, s->prev[at], at, s->next[at]);
		unlink_corner(s, at);
		at = s->next[s->next[at]];
	}
	put(corners, n - 3, s->prev[at], at, s->next[at]);
}

size_t wh_polygon_cut(const wh_vec3 *pos, const uint64_t *ids, size_t n, uint32_t *corners,
                      wh_polygon_workspace *s)
{
	const uint32_t start = smallest_id(ids, n);
	if (n == 3) {
		put(corners, 0, 0, 1, 2);
	} else if (n == 4) {
		cut_quad(pos, start, corners);
	} else {
		project(pos, n, start, s);
		link_corners(s, (uint32_t)n);
		cut_ears((uint32_t)n, start, corners, s);
	}
	return n - 2;
}
