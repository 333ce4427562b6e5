/* morton: places along the Z curve through a box (Morton 1966): bits of x, y, z interleaved. */
#ifndef WH_GEOM_MORTON_H
#define WH_GEOM_MORTON_H

#include "geom/vec3.h"

#include <stdint.h>

/* Spreads 21 bits to every third place. */
static inline uint64_t wh_morton_spread(uint64_t x)
{
	x &= 0x1fffff;
	x = (x | x << 32) & 0x1f00000000ffffu;
	x = (x | x << 16) & 0x1f0000ff0000ffu;
	x = (x | x << 8) & 0x100f00f00f00f00fu;
	x = (x | x << 4) & 0x10c30c30c30c30c3u;
	x = (x | x << 2) & 0x1249249249249249u;
	return x;
}

/* Key of p in a box with corner lo; `scale` is (2^21 - 1) / its longest side (0 for a point). */
static inline uint64_t wh_morton_key(wh_vec3 p, wh_vec3 lo, double scale)
{
	const uint64_t x = (uint64_t)((p.x - lo.x) * scale);
	const uint64_t y = (uint64_t)((p.y - lo.y) * scale);
	const uint64_t z = (uint64_t)((p.z - lo.z) * scale);
	return wh_morton_spread(x) | wh_morton_spread(y) << 1 | wh_morton_spread(z) << 2;
}

#endif
