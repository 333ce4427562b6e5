/*
 * number: decimal numbers in text, read and written, correctly rounded, whatever the locale.
 *
 * The text must have a readable byte behind its last word that ends it (a blank or line end);
 * then no call needs to know where the text ends. Thread-safe.
 */
#ifndef WH_IO_NUMBER_H
#define WH_IO_NUMBER_H

#include <stdbool.h>
#include <stdint.h>

/* Blanks end words: space, and tab to carriage return. */
static inline bool wh_is_blank(char ch)
{
	return ch == ' ' || (ch >= '\t' && ch <= '\r');
}

/* The end of the word at s. */
static inline const char *wh_word_end(const char *s)
{
	while (!wh_is_blank(*s))
		s++;
	return s;
}

/* Reads the word at s as a real number: the double nearest to it. "nan", "inf" and their like
 * (also "1.#INF") give NaN. Returns the word's end, NULL when it is no number. */
const char *wh_scan_real(const char *s, double *v);

/* The same, where nobody says whether numbers are floats or doubles: sets *wide when the digits
 * tell more than the nearest float holds. */
const char *wh_scan_decimal(const char *s, double *v, bool *wide);

/* Reads the word at s as a whole number; a negative one comes out as 2^64 - |v|. Returns the
 * word's end, NULL when it is no whole number or needs more than 64 bits. */
static inline const char *wh_scan_whole(const char *s, uint64_t *v)
{
	const bool minus = *s == '-';
	s += minus || *s == '+';
	const char *first = s;
	uint64_t n = 0;
	while (*s >= '0' && *s <= '9') {
		const uint64_t digit = (uint64_t)(*s - '0');
		if (__builtin_expect(n >= UINT64_MAX / 10, 0) &&
		    (n > UINT64_MAX / 10 || digit > UINT64_MAX % 10))
			return (const char *)0;
		n = 10 * n + digit;
		s++;
	}
	*v = minus ? 0 - n : n;
	return s > first && wh_is_blank(*s) && !(minus && n > INT64_MAX) ? s : (const char *)0;
}

/* Room for either of the following. */
enum { WH_NUMBER_TEXT = 32 };

/*
 * Writes a real: a float (v is rounded to one) or a double. The digits are those of "%.9g" or
 * "%.17g", or fewer where six to eight, or fifteen, bring the same number back. Returns the byte
 * behind them; no NUL.
 */
char *wh_print_real(char *to, bool is_double, double v);

/* The same for a whole number. */
char *wh_print_whole(char *to, uint64_t v);

#endif
