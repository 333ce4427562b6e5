#include "algo/compare_sums.h"

#include <string.h>

static const double DEGREES = 180 / 3.14159265358979323846; /* of a radian */

enum { TOP_EXPONENT = 1023 + 163, MANTISSA = 52, HISTOGRAM_BITS = 2 };

static const uint64_t TOP = (uint64_t)TOP_EXPONENT << WH_BIN_BITS; /* of 2^163 */

/* ---- bins ----------------------------------------------------------------------------------- */

uint32_t wh_bin_of(double d)
{
	uint64_t bits;
	memcpy(&bits, &d, sizeof bits);
	bits >>= MANTISSA - WH_BIN_BITS;
	if (bits >= TOP)
		return WH_BINS - 1;
	return bits < TOP - WH_BINS ? 0 : (uint32_t)(bits - (TOP - WH_BINS));
}

/* The upper end of a bin. */
static double bin_end(uint32_t bin)
{
	const uint64_t bits = (TOP - WH_BINS + bin + 1) << (MANTISSA - WH_BIN_BITS);
	double d;
	memcpy(&d, &bits, sizeof d);
	return d;
}

/* The distance that this share of the samples does not exceed. */
static double percentile(const uint64_t *bins, uint64_t samples, double share)
{
	const double want = share * (double)samples;
	uint64_t seen = 0;
	for (uint32_t b = 0; b < WH_BINS; b++) {
		seen += bins[b];
		if (seen > 0 && (double)seen >= want)
			return b == 0 ? 0 : bin_end(b);
	}
	return 0;
}

/* Bins of the histogram are whole runs of bins. */
static void fill_histogram(const uint64_t *bins, double unit, wh_histogram *h)
{
	enum { RUN = 1 << (WH_BIN_BITS - HISTOGRAM_BITS), RUNS = WH_BINS / RUN };
	uint32_t last = WH_BINS - 1;
	while (last > 0 && bins[last] == 0)
		last--;
	uint32_t run = last / RUN;
	run = run < WH_HISTOGRAM - 1 ? WH_HISTOGRAM - 1 : run; /* the first bin of them has all 0 */
	for (uint32_t i = 0; i < WH_HISTOGRAM; i++) {
		const uint32_t from = (run - (WH_HISTOGRAM - 1) + i) * RUN;
		h->end[i] = bin_end(from + RUN - 1) * unit;
		for (uint32_t b = i == 0 ? 0 : from; b < from + RUN; b++)
			h->count[i] += bins[b];
	}
}

/* ---- tallies -------------------------------------------------------------------------------- */

void wh_tally_add(wh_tally *t, const wh_chunk_sums *s)
{
	for (int i = 0; i < WH_SUMS; i++)
		if (s->sum[i] > 0)
			wh_exact_add(&t->sum[i], s->sum[i]);
	for (int i = 0; i < WH_COUNTS; i++)
		t->count[i] += s->count[i];
	for (int i = 0; i < WH_REGIONS; i++)
		t->max2[i] = fmax(t->max2[i], s->max2[i]);
}

void wh_tally_join(wh_tally *t, const wh_tally *part)
{
	for (int i = 0; i < WH_SUMS; i++)
		wh_exact_join(&t->sum[i], &part->sum[i]);
	for (int i = 0; i < WH_COUNTS; i++)
		t->count[i] += part->count[i];
	for (int i = 0; i < WH_REGIONS; i++)
		t->max2[i] = fmax(t->max2[i], part->max2[i]);
	for (int i = 0; i < WH_BINS; i++)
		t->bins[i] += part->bins[i];
}

/* ---- figures -------------------------------------------------------------------------------- */

static double mean_of(const wh_tally *t, wh_sum which, uint64_t n)
{
	return n > 0 ? wh_exact_value(&t->sum[which]) / (double)n : 0;
}

wh_distance wh_tally_describe(const wh_tally *t, uint64_t samples, uint64_t vertices, double unit)
{
	double max2 = 0;
	for (int i = 0; i < WH_REGIONS; i++)
		max2 = fmax(max2, t->max2[i]);
	wh_distance d = {.samples = samples, .vertices = vertices, .max = sqrt(max2) * unit};
	if (samples == 0)
		return d;
	d.mean = mean_of(t, WH_SUM_D, samples) * unit;
	d.rms = sqrt(mean_of(t, WH_SUM_D2, samples)) * unit;
	d.p50 = fmin(percentile(t->bins, samples, 0.50) * unit, d.max);
	d.p90 = fmin(percentile(t->bins, samples, 0.90) * unit, d.max);
	d.p99 = fmin(percentile(t->bins, samples, 0.99) * unit, d.max);
	fill_histogram(t->bins, unit, &d.histogram);
	d.normals = t->count[WH_COUNT_ANGLES];
	d.normal_mean = mean_of(t, WH_SUM_ANGLE, d.normals) * DEGREES;
	d.normal_rms = sqrt(mean_of(t, WH_SUM_ANGLE2, d.normals)) * DEGREES;
	d.colours = t->count[WH_COUNT_COLOURS];
	d.colour_mean = mean_of(t, WH_SUM_COLOUR, d.colours);
	d.colour_rms = sqrt(mean_of(t, WH_SUM_COLOUR2, d.colours));
	return d;
}
