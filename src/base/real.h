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

#endif
