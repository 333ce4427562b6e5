/*
 * exact_sum: a sum of non-negative doubles that does not depend on their order.
 *
 * A fixed-point number wide enough for every double, in limbs of 32 bits kept in 64: a carry is
 * needed only once in 2^30 additions. Sums of parts can be added to one another, and it never
 * matters which part a number was in. An addition takes a few nanoseconds.
 */
#ifndef WH_BASE_EXACT_SUM_H
#define WH_BASE_EXACT_SUM_H

#include <math.h>
#include <stdint.h>
#include <string.h>

/* Bit 0 of limb 0 stands for 2^-1074; the largest double ends below bit 2098, and 2^64 of them
 * below bit 2162. */
enum { WH_EXACT_LIMBS = 69, WH_EXACT_MOST = 1 << 30 };

/* Zero-initialise. */
typedef struct wh_exact_sum {
	uint64_t limb[WH_EXACT_LIMBS];
	uint32_t pending; /* additions since the last carry */
	uint32_t infinite;
} wh_exact_sum;

static inline void wh_exact_carry(wh_exact_sum *s)
{
	for (int i = 0; i + 1 < WH_EXACT_LIMBS; i++) {
		s->limb[i + 1] += s->limb[i] >> 32;
		s->limb[i] &= UINT32_MAX;
	}
	s->pending = 0;
}

/* Adds x >= 0, perhaps infinite, but a number. */
static inline void wh_exact_add(wh_exact_sum *s, double x)
{
	uint64_t bits;
	memcpy(&bits, &x, sizeof bits);
	uint32_t exponent = (uint32_t)(bits >> 52) & 2047;
	uint64_t m = bits & ((UINT64_C(1) << 52) - 1);
	if (exponent == 2047) {
		s->infinite = 1;
		return;
	}
	if (exponent > 0)
		m |= UINT64_C(1) << 52;
	else
		exponent = 1; /* subnormal: the unit is the same, the leading bit is missing */
	uint64_t *limb = s->limb + (exponent - 1) / 32;
	const uint32_t shift = (exponent - 1) % 32;
	const uint64_t low = (m & UINT32_MAX) << shift, high = (m >> 32) << shift;
	limb[0] += low & UINT32_MAX;
	limb[1] += (low >> 32) + (high & UINT32_MAX);
	limb[2] += high >> 32;
	if (++s->pending == WH_EXACT_MOST)
		wh_exact_carry(s);
}

static inline void wh_exact_join(wh_exact_sum *s, const wh_exact_sum *part)
{
	wh_exact_sum p = *part;
	wh_exact_carry(&p);
	wh_exact_carry(s);
	for (int i = 0; i < WH_EXACT_LIMBS; i++)
		s->limb[i] += p.limb[i];
	s->infinite |= p.infinite;
	wh_exact_carry(s);
}

/* The sum as a double, to a unit in the last place. */
static inline double wh_exact_value(const wh_exact_sum *sum)
{
	wh_exact_sum s = *sum;
	wh_exact_carry(&s);
	int top = WH_EXACT_LIMBS - 1;
	while (top > 2 && s.limb[top] == 0)
		top--;
	const double leading = (double)(s.limb[top] << 32 | s.limb[top - 1]);
	const double value = ldexp(leading, 32) + (double)s.limb[top - 2];
	return s.infinite ? INFINITY : ldexp(value, 32 * (top - 2) - 1074);
}

#endif
