/*
 * Reals in text. With at most 19 digits m and a power of ten e, the value is m * 10^e. When m is
 * below 2^53 and |e| at most 22, both m and 10^|e| are exact doubles, so that one multiplication
 * or division rounds correctly (Clinger 1990). That is nearly every number in a scan; the rest
 * goes to the C library in the "C" locale, which is some ten times slower.
 */
#define _GNU_SOURCE
#include "io/number.h"

#include "base/real.h"

#include <float.h>
#include <locale.h>
#include <math.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

_Static_assert(FLT_EVAL_METHOD == 0, "the fast path needs arithmetic that rounds to double");

enum { MOST_DIGITS = 19, MOST_POWER = 22 };

static const double power[MOST_POWER + 1] = {1e0,  1e1,  1e2,  1e3,  1e4,  1e5,  1e6,  1e7,
                                             1e8,  1e9,  1e10, 1e11, 1e12, 1e13, 1e14, 1e15,
                                             1e16, 1e17, 1e18, 1e19, 1e20, 1e21, 1e22};

/* What writers print for values that are not finite. */
static bool names_no_number(const char *s, size_t n)
{
	static const char *const names[] = {"nan",    "inf",     "infinity", "1.#inf",
	                                    "1.#ind", "1.#qnan", "1.#snan"};
	if (n > 0 && (*s == '-' || *s == '+')) {
		s++;
		n--;
	}
	for (size_t i = 0; i < sizeof names / sizeof names[0]; i++) {
		const size_t k = strlen(names[i]);
		if (n >= k && strncasecmp(s, names[i], k) == 0 &&
		    (n == k || names[i][0] == '1' || s[k] == '('))
			return true;
	}
	return false;
}

static const char *scan_odd(const char *s, double *v)
{
	const char *end = wh_word_end(s);
	if (!names_no_number(s, (size_t)(end - s)))
		return NULL;
	*v = (double)NAN;
	return end;
}

static const char *scan_slowly(const char *s, const char *end, double *v)
{
	/* glibc hands out its one "C" locale here: no memory is taken */
	locale_t c_locale = newlocale(LC_ALL_MASK, "C", (locale_t)0);
	char *stopped = NULL;
	*v = strtod_l(s, &stopped, c_locale);
	freelocale(c_locale);
	return stopped == end ? end : NULL;
}

/* Digits and a point from s on; *point counts the digits behind the point. */
static const char *scan_digits(const char *s, uint64_t *m, int *significant, int64_t *behind,
                               bool *any)
{
	uint64_t n = 0;
	int digits = 0;
	const char *first = s;
	for (; *s >= '0' && *s <= '9'; s++) {
		n = 10 * n + (uint64_t)(*s - '0');
		digits += digits || n;
	}
	*any = s > first;
	*behind = 0;
	if (*s == '.') {
		first = ++s;
		for (; *s >= '0' && *s <= '9'; s++) {
			n = 10 * n + (uint64_t)(*s - '0');
			digits += digits || n;
		}
		*behind = s - first;
		*any = *any || s > first;
	}
	*m = n;
	*significant = digits;
	return s;
}

/* "e-12" at s. Returns its end, NULL when damaged. Great exponents stop growing. */
static const char *scan_exponent(const char *s, int64_t *e)
{
	s++;
	const bool minus = *s == '-';
	s += minus || *s == '+';
	const char *first = s;
	int64_t n = 0;
	for (; *s >= '0' && *s <= '9'; s++)
		n = n < 1000000 ? 10 * n + (*s - '0') : n;
	*e = minus ? -n : n;
	return s > first ? s : NULL;
}

/* *last: the power of ten of the word's last digit. */
static inline const char *scan_real(const char *s, double *v, int64_t *last)
{
	const char *const word = s;
	const bool minus = *s == '-';
	uint64_t m;
	int digits;
	int64_t behind;
	int64_t e = 0;
	bool any;
	s += minus || *s == '+';
	s = scan_digits(s, &m, &digits, &behind, &any);
	if (any && (*s == 'e' || *s == 'E')) {
		s = scan_exponent(s, &e);
		if (!s)
			return NULL;
	}
	if (!any || !wh_is_blank(*s))
		return scan_odd(word, v);
	e -= behind;
	*last = e;
	if (digits > MOST_DIGITS || m > (uint64_t)1 << 53 || e < -MOST_POWER || e > MOST_POWER)
		return scan_slowly(word, s, v);
	const double r = e < 0 ? (double)m / power[-e] : (double)m * power[e];
	*v = minus ? -r : r;
	return s;
}

const char *wh_scan_real(const char *s, double *v)
{
	int64_t last;
	return scan_real(s, v, &last);
}

/* A float written with any number of digits lies within half of the last one's unit. */
static bool is_float(double v, int64_t last)
{
	const double off = fabs(v - wh_round_float(v));
	if (isinf(off) || (off > 0 && last < -MOST_POWER))
		return false;
	if (!(off > 0) || last > MOST_POWER)
		return true;
	const double unit = last < 0 ? 1 / power[-last] : power[last];
	return off <= 0.5 * unit + 0x1p-52 * fabs(v); /* v itself is rounded, and ties are common */
}

const char *wh_scan_decimal(const char *s, double *v, bool *wide)
{
	int64_t last = 0;
	s = scan_real(s, v, &last);
	if (s && !is_float(*v, last))
		*wide = true;
	return s;
}
