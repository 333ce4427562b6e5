/*
 * The finite positions are sorted by half of a hash; equals are then compared, so that the hash
 * decides nothing but the time. The sort is stable: of coincident positions the first stays first.
 */
#include "mesh/coincident.h"

#include "base/rng.h"

#include <string.h>

uint64_t wh_coincident_hash(wh_vec3 p)
{
	const double xyz[3] = {p.x + 0.0, p.y + 0.0, p.z + 0.0}; /* -0 becomes 0 */
	uint64_t bits[3];
	memcpy(bits, xyz, sizeof bits);
	return wh_mix64(wh_mix64(wh_mix64(bits[0]) ^ bits[1]) ^ bits[2]);
}

static bool same_position(wh_vec3 a, wh_vec3 b)
{
	return a.x == b.x && a.y == b.y && a.z == b.z;
}

/* One pass of a stable radix sort, by 11 of the upper 32 bits. */
static void sort_pass(const uint64_t *from, uint64_t *to, size_t n, int shift)
{
	size_t at[2048] = {0};
	for (size_t i = 0; i < n; i++)
		at[from[i] >> shift & 2047]++;
	size_t sum = 0;
	for (int d = 0; d < 2048; d++) {
		const size_t count = at[d];
		at[d] = sum;
		sum += count;
	}
	for (size_t i = 0; i < n; i++)
		to[at[from[i] >> shift & 2047]++] = from[i];
}

static void mark(uint64_t *marks, uint64_t id)
{
	const uint32_t i = (uint32_t)id;
	if (marks)
		marks[i / 64] |= UINT64_C(1) << (i % 64);
}

/*
 * Coincident positions among ids[0 .. n-1] (low halves), whose hashes agree. Nearly always they
 * coincide all or n is 2; so: take the first, strike out its equals, go on with the rest.
 */
static uint64_t count_equals(const wh_vec3 *pos, uint64_t *ids, size_t n, uint64_t *marks)
{
	uint64_t equals = 0;
	while (n > 1) {
		const wh_vec3 p = pos[(uint32_t)ids[0]];
		size_t kept = 0;
		for (size_t i = 1; i < n; i++) {
			if (same_position(p, pos[(uint32_t)ids[i]]))
				mark(marks, ids[i]);
			else
				ids[kept++] = ids[i];
		}
		equals += n - 1 - kept;
		n = kept;
	}
	return equals;
}

wh_code wh_coincident_count(wh_ctx *c, const wh_vec3 *pos, uint32_t nv, uint64_t *marks,
                            uint64_t *count)
{
	*count = 0;
	uint64_t *a = wh_alloc(c, nv, sizeof *a);
	uint64_t *b = wh_alloc(c, nv, sizeof *b);
	if (!a || !b)
		goto out;
	size_t n = 0;
	for (uint32_t v = 0; v < nv; v++)
		if (isfinite(pos[v].x) && isfinite(pos[v].y) && isfinite(pos[v].z))
			a[n++] = (wh_coincident_hash(pos[v]) & ~(uint64_t)UINT32_MAX) | v;
	sort_pass(a, b, n, 32);
	sort_pass(b, a, n, 43);
	sort_pass(a, b, n, 53);
	for (size_t i = 0, end; i < n; i = end) {
		for (end = i + 1; end < n && b[end] >> 32 == b[i] >> 32;)
			end++;
		*count += count_equals(pos, b + i, end - i, marks);
	}
out:
	wh_free(c, b);
	wh_free(c, a);
	return c->err.code;
}
