/*
 * Reals in text. With at most 19 digits m and a power of ten e, the value is m * 10^e. When m is
 * below 2^53 and |e| at most 22, both m and 10^|e| are exact doubles, so that one multiplication
 * or division rounds correctly (Clinger 1990). That is nearly every number in a scan; the rest
 * goes to the C library in the "C" locale, which is some ten times slower.
 *
 * Written, a real v is m / 10^e again, m with a fixed number of digits. Few digits are tried first:
 * where m is below 2^53, one division tells whether they bring v back (of floats: unless it ends
 * half-way between two of them, where it may be the wrong one). All seventeen digits of a double
 * come from its 53-bit integer times a power of ten in 128 bits, which is exact. What is too large
 * or too small for that is left to the C library, which takes ten times as long.
 */
#define _GNU_SOURCE
#include "io/number.h"

#include "base/real.h"

#include <float.h>
#include <locale.h>
#include <math.h>
#include <stddef.h>
#include <stdio.h>
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

/* ---- writing ------------------------------------------------------------------------------ */

enum {
	FLOAT_FEW = 6,
	FLOAT_ALL = 9, /* digits that bring any float back, ... */
	DOUBLE_FEW = 15,
	DOUBLE_ALL = 17, /* ... and any double */
	LEAST_EXPONENT = -4
};

__extension__ typedef unsigned __int128 wide;

/* Digits with the point behind the first of them, times 10^exponent. */
typedef struct decimal {
	uint64_t digits;
	int exponent;
} decimal;

char *wh_print_whole(char *to, uint64_t v)
{
	char digits[20];
	size_t n = 0;
	do {
		digits[sizeof digits - ++n] = (char)('0' + v % 10);
		v /= 10;
	} while (v);
	memcpy(to, digits + sizeof digits - n, n);
	return to + n;
}

/* A decimal of n digits as "%.ng" has it. */
static char *put_decimal(char *to, decimal d, int n)
{
	char digits[20];
	int used = n;
	for (; used > 1 && d.digits % 10 == 0; used--)
		d.digits /= 10;
	for (int i = used; i > 0; d.digits /= 10)
		digits[--i] = (char)('0' + d.digits % 10);
	for (int i = d.exponent; i < 0; i++) { /* "0.00" */
		*to++ = '0';
		if (i == d.exponent)
			*to++ = '.';
	}
	for (int i = 0; i < used || i <= d.exponent; i++) {
		if (i == d.exponent + 1 && i > 0)
			*to++ = '.';
		*to++ = i < used ? digits[i] : '0';
	}
	return to;
}

/* v > 0 to n digits; the last one may be off by one. */
static decimal round_to(double v, int exponent, int n)
{
	const int e = n - 1 - exponent;
	const double m = rint(e >= 0 ? v * power[e] : v / power[-e]);
	if (m >= power[n])
		return (decimal){(uint64_t)m / 10, exponent + 1};
	return (decimal){(uint64_t)m, exponent};
}

/* The number that a decimal of n digits is, correctly rounded when it is below 2^53. */
static double value_of(decimal d, int n)
{
	const int e = n - 1 - d.exponent;
	return e >= 0 ? (double)d.digits / power[e] : (double)d.digits * power[-e];
}

/* Half-way between two floats, to the last bit. */
static bool is_between_floats(double v)
{
	uint64_t bits;
	memcpy(&bits, &v, sizeof bits);
	return (bits & 0x1fffffff) == 0x10000000;
}

static bool brings_back(bool is_double, decimal d, int n, double v)
{
	const double back = value_of(d, n);
	if (is_double)
		return back == v;
	return !is_between_floats(back) && wh_round_float(back) == v;
}

/* The exponent of v > 0, or one less. */
static int exponent_of(double v)
{
	int e = -1;
	if (v >= 1)
		while (e + 1 <= MOST_POWER && v >= power[e + 1])
			e++;
	else
		while (v * power[-e] < 1 && e > LEAST_EXPONENT - 1)
			e--;
	return e;
}

/* All seventeen digits. False: it is too large or too small for that. */
static bool all_of_double(double v, int exponent, decimal *d)
{
	int binary;
	const uint64_t m = (uint64_t)ldexp(frexp(v, &binary), 53);
	const int shift = 53 - binary, e = DOUBLE_ALL - 1 - exponent;
	if (shift <= 0 || shift > 126 || e < 0 || e > MOST_POWER)
		return false;
	const wide product =
	    (wide)m * (uint64_t)power[e > 11 ? 11 : e] * (uint64_t)power[e > 11 ? e - 11 : 0];
	const wide half = (wide)1 << (shift - 1), rest = product & (((wide)1 << shift) - 1);
	uint64_t q = (uint64_t)(product >> shift);
	q += rest > half || (rest == half && (q & 1));
	*d = (decimal){q, exponent};
	if (q == 100000000000000000)
		*d = (decimal){q / 10, exponent + 1};
	return q >= 10000000000000000 && q <= 100000000000000000;
}

/* Digits enough for v > 0. False: the C library has to find them. */
static bool find_digits(bool is_double, double v, decimal *d, int *n)
{
	const int exponent = exponent_of(v), all = is_double ? DOUBLE_ALL : FLOAT_ALL;
	if (exponent < LEAST_EXPONENT || exponent >= all - 1)
		return false;
	for (*n = is_double ? DOUBLE_FEW : FLOAT_FEW; *n < all; *n += is_double ? 2 : 1) {
		*d = round_to(v, exponent, *n);
		if (brings_back(is_double, *d, *n, v))
			return true;
	}
	if (is_double)
		return all_of_double(v, exponent, d);
	*d = round_to(v, exponent, *n);
	return true;
}

char *wh_print_real(char *to, bool is_double, double v)
{
	decimal d;
	int n;
	if (!is_double)
		v = wh_round_float(v);
	if (v == 0 && !signbit(v)) {
		*to++ = '0';
		return to;
	}
	const double size = fabs(v);
	if (!(size > 0) || !isfinite(v) || !find_digits(is_double, size, &d, &n))
		return to +
		       snprintf(to, WH_NUMBER_TEXT, "%.*g", is_double ? DOUBLE_ALL : FLOAT_ALL, v);
	if (v < 0)
		*to++ = '-';
	return put_decimal(to, d, n);
}
