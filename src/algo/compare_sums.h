/*
 * compare_sums: what measured points add up to, whatever their order, and figures made of it.
 *
 * Internal to compare. Points are summed up in chunks of fixed contents, each from nothing; a
 * worker adds its chunks to a tally, exactly (base/exact_sum), and tallies are added to one
 * another. So the schedule leaves no trace.
 */
#ifndef WH_ALGO_COMPARE_SUMS_H
#define WH_ALGO_COMPARE_SUMS_H

#include "algo/compare.h"
#include "base/exact_sum.h"

/* Sums of doubles. */
typedef enum wh_sum {
	WH_SUM_D,
	WH_SUM_D2,
	WH_SUM_ANGLE, /* between normals, radians */
	WH_SUM_ANGLE2,
	WH_SUM_COLOUR,
	WH_SUM_COLOUR2,
	WH_SUM_ZONE_D2, /* interior, band */
	WH_SUM_ZONE_COLOUR2 = WH_SUM_ZONE_D2 + 2,
	WH_SUM_REGION_D2 = WH_SUM_ZONE_COLOUR2 + 2,
	WH_SUMS = WH_SUM_REGION_D2 + WH_REGIONS
} wh_sum;

/* Counts of samples. */
typedef enum wh_tally_count {
	WH_COUNT_ANGLES,  /* that have one */
	WH_COUNT_COLOURS, /* that have one at either end */
	WH_COUNT_ZONE,
	WH_COUNT_ZONE_COLOURS = WH_COUNT_ZONE + 2,
	WH_COUNT_REGION = WH_COUNT_ZONE_COLOURS + 2,
	WH_COUNTS = WH_COUNT_REGION + WH_REGIONS
} wh_tally_count;

/* Of a chunk. Zero-initialise. */
typedef struct wh_chunk_sums {
	double sum[WH_SUMS];
	uint64_t count[WH_COUNTS];
	double max2[WH_REGIONS]; /* of a's regions, vertices included */
} wh_chunk_sums;

enum {
	WH_BIN_BITS = 7,      /* of the mantissa: bins within an octave */
	WH_BIN_OCTAVES = 256, /* below the largest distance of a frame, 2^163 */
	WH_BINS = WH_BIN_OCTAVES << WH_BIN_BITS
};

typedef struct wh_tally {
	wh_exact_sum sum[WH_SUMS];
	uint64_t count[WH_COUNTS];
	double max2[WH_REGIONS];
	uint64_t bins[WH_BINS]; /* samples by the leading bits of their distance */
} wh_tally;

uint32_t wh_bin_of(double d);

void wh_tally_add(wh_tally *t, const wh_chunk_sums *s);
void wh_tally_join(wh_tally *t, const wh_tally *part);

/* Figures of points whose distances are in units of `unit`. */
wh_distance wh_tally_describe(const wh_tally *t, uint64_t samples, uint64_t vertices, double unit);

#endif
