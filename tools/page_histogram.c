/*
 * Distances of the samples as histograms, one for each level, over one logarithmic axis. Bins have
 * an equal width within an octave, so a bar's area is what its bin holds.
 */
#include "page_parts.h"

#include <math.h>

enum { WIDTH = 400, HEIGHT = 120, TICKS_MOST = 6 };

/* Logarithms to base 10 of the ends of the axis. */
typedef struct axis {
	double from, to;
} axis;

/* Lower end of a bin. */
static double begin_of(const wh_histogram *h, int i)
{
	return i > 0 ? h->end[i - 1] : h->end[0] / 1.25;
}

static axis find_axis(const page_work *w)
{
	axis a = {INFINITY, -INFINITY};
	for (int k = 1; k < w->n; k++) {
		const wh_histogram *h = &w->mesh[k].distance.both.histogram;
		for (int i = 0; i < WH_HISTOGRAM; i++) {
			if (h->count[i] == 0 || !(h->end[i] > 0))
				continue;
			a.from = fmin(a.from, log10(begin_of(h, i)));
			a.to = fmax(a.to, log10(h->end[i]));
		}
	}
	return a;
}

static double place_of(const axis *a, double distance)
{
	return (log10(distance) - a->from) / (a->to - a->from);
}

/* Share of the samples in a bin by the width of its bar; 0 where there is nothing. */
static double height_of(const axis *a, const wh_distance *d, int i)
{
	const wh_histogram *h = &d->histogram;
	if (h->count[i] == 0)
		return 0;
	const double wide = place_of(a, h->end[i]) - place_of(a, begin_of(h, i));
	return (double)h->count[i] / (double)d->samples / wide;
}

static double highest(const axis *a, const wh_distance *d)
{
	double most = 0;
	for (int i = 0; i < WH_HISTOGRAM; i++)
		most = fmax(most, height_of(a, d, i));
	return most;
}

static void put_bars(const page_out *o, const axis *a, const wh_distance *d)
{
	const double most = highest(a, d);
	for (int i = 0; i < WH_HISTOGRAM; i++) {
		if (d->histogram.count[i] == 0)
			continue;
		const double x = place_of(a, begin_of(&d->histogram, i)) * WIDTH;
		const double end = place_of(a, d->histogram.end[i]) * WIDTH;
		const double high = fmax(height_of(a, d, i) / most * HEIGHT, 0.8);
		page_putf(o, "<rect x=\"%.2f\" y=\"%.2f\" width=\"%.2f\" height=\"%.2f\"/>", x,
		          HEIGHT - high, fmax(end - x - 0.4, 0.4), high);
	}
}

static void put_mark(const page_out *o, const axis *a, double distance)
{
	const double x = place_of(a, distance);
	if (distance > 0 && x >= 0 && x <= 1)
		page_putf(o, "<path d=\"M%.2f 0V%d\"/>", x * WIDTH, HEIGHT);
}

/* Powers of ten, as many as there is room for. */
static void put_ticks(const page_out *o, const axis *a)
{
	const int first = (int)ceil(a->from), last = (int)floor(a->to);
	const int step = (last - first) / TICKS_MOST + 1;
	page_put(o, "<div class=\"ticks\" aria-hidden=\"true\">");
	for (int i = first; i <= last; i += step)
		page_putf(o, "<span style=\"left:%.2f%%\">%.12g</span>",
		          place_of(a, pow(10, i)) * 100, pow(10, i));
	page_put(o, "</div>");
}

static void put_histogram(const page_out *o, const axis *a, const page_mesh *m)
{
	const wh_distance *d = &m->distance.both;
	page_putf(o,
	          "<figure class=\"histogram\"><svg viewBox=\"0 0 %d %d\" "
	          "preserveAspectRatio=\"none\" role=\"img\" aria-label=\"Histogram of the "
	          "distances: half of the samples within %.4g, 99 %% within %.4g, all within "
	          "%.4g\">",
	          WIDTH, HEIGHT, d->p50, d->p99, d->max);
	put_bars(o, a, d);
	put_mark(o, a, d->p50);
	put_mark(o, a, d->p99);
	page_put(o, "</svg>");
	put_ticks(o, a);
	page_put(o, "<figcaption><span class=\"name\">");
	page_text(o, page_name(m->path));
	page_put(o, "</span> &middot; half within ");
	page_real(o, d->p50);
	page_put(o, " &middot; 99&#8239;% within ");
	page_real(o, d->p99);
	page_put(o, "</figcaption></figure>\n");
}

void page_write_histograms(const page_work *w, const page_out *o)
{
	const axis a = find_axis(w);
	if (!(a.from < a.to)) /* nothing has moved */
		return;
	page_put(o, "<h3>How many samples are how far</h3>\n<p class=\"small\">Distances of both "
	            "directions, on a logarithmic axis; what is nearer than its beginning is in "
	            "the first bar. Lines: half and 99&#8239;% of the samples are no farther.</p>\n"
	            "<div class=\"pictures\">\n");
	for (int i = 1; i < w->n; i++)
		if (w->mesh[i].distance.both.max > 0)
			put_histogram(o, &a, &w->mesh[i]);
	page_put(o, "</div>\n");
}
