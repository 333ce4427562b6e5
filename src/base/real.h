/* real: rounding of floating-point numbers. */
#ifndef WH_BASE_REAL_H
#define WH_BASE_REAL_H

/*
 * The nearest float, as a double. A cast to float and back should do, but gcc 12 drops such casts
 * when it makes vectors of them (from -O2 on), and the numbers stay as they were.
 */
static inline double wh_round_float(double x)
{
	volatile float f = (float)x;
	return (double)f;
}

/* The nearest multiple of `step`, a power of two, for |x| up to 2^51 steps; x where step is 0.
 * Beside 1.5 * 2^52 steps there is no room for less than one. */
static inline double wh_round_to(double x, double step)
{
	const double anchor = 0x1.8p52 * step;
	return (x + anchor) - anchor;
}

#endif
