#include "compare_json.h"

#include <string.h>

const compare_row compare_rows[COMPARE_ROWS] = {
    {"mean", "mean", offsetof(wh_distance, mean)}, {"rms", "RMS", offsetof(wh_distance, rms)},
    {"max", "max", offsetof(wh_distance, max)},    {"p50", "50 %", offsetof(wh_distance, p50)},
    {"p90", "90 %", offsetof(wh_distance, p90)},   {"p99", "99 %", offsetof(wh_distance, p99)},
};

double compare_value(const wh_distance *d, const compare_row *w)
{
	double v;
	memcpy(&v, (const char *)d + w->offset, sizeof v);
	return v;
}

double compare_millionths(double x, double diagonal)
{
	return diagonal > 0 ? x / diagonal * 1e6 : 0;
}

/* {"mean": x, ...}, all times the factor. */
static json_t *json_figures(const wh_distance *d, double factor)
{
	json_t *j = json_object();
	for (int i = 0; i < COMPARE_ROWS; i++)
		(void)json_object_set_new(j, compare_rows[i].key,
		                          json_real(compare_value(d, compare_rows + i) * factor));
	return j;
}

static json_t *json_normals(const wh_distance *d)
{
	json_t *j = json_object();
	(void)json_object_set_new(j, "mean", json_real(d->normal_mean));
	(void)json_object_set_new(j, "rms", json_real(d->normal_rms));
	(void)json_object_set_new(j, "samples", json_integer((json_int_t)d->normals));
	return j;
}

static json_t *json_colours(const wh_distance *d)
{
	json_t *j = json_object();
	(void)json_object_set_new(j, "mean", json_real(d->colour_mean));
	(void)json_object_set_new(j, "rms", json_real(d->colour_rms));
	(void)json_object_set_new(j, "samples", json_integer((json_int_t)d->colours));
	return j;
}

/* {"end": [upper ends of the bins], "count": [samples in them]} */
static json_t *json_histogram(const wh_histogram *h)
{
	json_t *j = json_object(), *end = json_array(), *count = json_array();
	for (int i = 0; i < WH_HISTOGRAM; i++) {
		(void)json_array_append_new(end, json_real(h->end[i]));
		(void)json_array_append_new(count, json_integer((json_int_t)h->count[i]));
	}
	(void)json_object_set_new(j, "end", end);
	(void)json_object_set_new(j, "count", count);
	return j;
}

static json_t *json_side(const wh_distance *d, double diagonal)
{
	json_t *j = json_figures(d, 1);
	(void)json_object_set_new(j, "samples", json_integer((json_int_t)d->samples));
	(void)json_object_set_new(j, "vertices", json_integer((json_int_t)d->vertices));
	(void)json_object_set_new(j, "normal", json_normals(d));
	if (d->colours > 0)
		(void)json_object_set_new(j, "colour", json_colours(d));
	if (diagonal > 0) {
		const double millionths = compare_millionths(1, diagonal);
		(void)json_object_set_new(j, "percent", json_figures(d, millionths / 1e4));
		(void)json_object_set_new(j, "millionths", json_figures(d, millionths));
	}
	(void)json_object_set_new(j, "histogram", json_histogram(&d->histogram));
	return j;
}

static json_t *json_region_side(uint64_t samples, double rms, double max)
{
	json_t *j = json_object();
	(void)json_object_set_new(j, "samples", json_integer((json_int_t)samples));
	(void)json_object_set_new(j, "rms", json_real(rms));
	(void)json_object_set_new(j, "max", json_real(max));
	return j;
}

static json_t *json_region(const wh_compare_region *g)
{
	json_t *j = json_object();
	(void)json_object_set_new(j, "min", json_pack("[f, f, f]", g->lo.x, g->lo.y, g->lo.z));
	(void)json_object_set_new(j, "max", json_pack("[f, f, f]", g->hi.x, g->hi.y, g->hi.z));
	(void)json_object_set_new(j, "faces", json_integer((json_int_t)g->faces));
	(void)json_object_set_new(j, "area", json_real(g->area));
	(void)json_object_set_new(
	    j, "a_to_b", json_region_side(g->a_to_b.samples, g->a_to_b.rms, g->a_to_b.max));
	(void)json_object_set_new(
	    j, "b_to_a", json_region_side(g->b_to_a.samples, g->b_to_a.rms, g->b_to_a.max));
	return j;
}

int compare_json_fill(json_t *j, const wh_compare *r)
{
	json_t *regions = json_array();
	int bad = json_object_set_new(j, "diagonal", json_real(r->diagonal));
	bad |= json_object_set_new(j, "rms", json_real(r->rms));
	if (r->diagonal > 0)
		bad |= json_object_set_new(j, "rms_millionths",
		                           json_real(compare_millionths(r->rms, r->diagonal)));
	bad |= json_object_set_new(j, "normal_rms", json_real(r->normal_rms));
	if (r->both.colours > 0)
		bad |= json_object_set_new(j, "colour_rms", json_real(r->colour_rms));
	bad |= json_object_set_new(j, "a_to_b", json_side(&r->a_to_b, r->diagonal));
	bad |= json_object_set_new(j, "b_to_a", json_side(&r->b_to_a, r->diagonal));
	bad |= json_object_set_new(j, "both", json_side(&r->both, r->diagonal));
	for (uint32_t i = 0; i < r->regions; i++)
		bad |= json_array_append_new(regions, json_region(&r->region[i]));
	return bad | json_object_set_new(j, "regions", regions);
}

/* ---- reading -------------------------------------------------------------------------------- */

/* Reads of one object; `bad` once something was not there, or not what it should be. */
typedef struct reading {
	const json_t *j;
	bool bad;
} reading;

static double read_real(reading *g, const char *key)
{
	const json_t *v = json_object_get(g->j, key);
	g->bad |= !json_is_number(v);
	return json_number_value(v);
}

static uint64_t read_count(reading *g, const char *key)
{
	const json_t *v = json_object_get(g->j, key);
	g->bad |= !json_is_integer(v) || json_integer_value(v) < 0;
	return (uint64_t)json_integer_value(v);
}

static void read_histogram(reading *g, const json_t *j, wh_histogram *h)
{
	const json_t *end = json_object_get(j, "end"), *count = json_object_get(j, "count");
	g->bad |= json_array_size(end) != WH_HISTOGRAM || json_array_size(count) != WH_HISTOGRAM;
	for (int i = 0; !g->bad && i < WH_HISTOGRAM; i++) {
		const json_t *e = json_array_get(end, (size_t)i);
		const json_t *n = json_array_get(count, (size_t)i);
		g->bad |= !json_is_number(e) || !json_is_integer(n) || json_integer_value(n) < 0;
		h->end[i] = json_number_value(e);
		h->count[i] = (uint64_t)json_integer_value(n);
	}
}

/* Mean, RMS and samples of another kind of difference; none where there is no such object. */
static void read_means(reading *g, const char *key, double *mean, double *rms, uint64_t *n)
{
	reading of = {.j = json_object_get(g->j, key)};
	if (!of.j)
		return;
	*mean = read_real(&of, "mean");
	*rms = read_real(&of, "rms");
	*n = read_count(&of, "samples");
	g->bad |= of.bad;
}

static bool read_side(const json_t *j, wh_distance *d)
{
	reading g = {.j = j};
	for (int i = 0; i < COMPARE_ROWS; i++) {
		const double v = read_real(&g, compare_rows[i].key);
		memcpy((char *)d + compare_rows[i].offset, &v, sizeof v);
	}
	d->samples = read_count(&g, "samples");
	d->vertices = read_count(&g, "vertices");
	read_means(&g, "normal", &d->normal_mean, &d->normal_rms, &d->normals);
	read_means(&g, "colour", &d->colour_mean, &d->colour_rms, &d->colours);
	read_histogram(&g, json_object_get(j, "histogram"), &d->histogram);
	return !g.bad;
}

static bool read_zone(const json_t *j, wh_compare_zone *z)
{
	reading g = {.j = j};
	z->faces = read_count(&g, "faces");
	z->area = read_real(&g, "area");
	z->samples = read_count(&g, "samples");
	z->rms = read_real(&g, "rms");
	return !g.bad;
}

bool compare_json_read(const json_t *j, wh_compare *r)
{
	reading g = {.j = j};
	const json_t *seams = json_object_get(j, "seams");
	*r = (wh_compare){.banded = seams};
	r->diagonal = read_real(&g, "diagonal");
	r->rms = read_real(&g, "rms");
	r->normal_rms = read_real(&g, "normal_rms");
	r->colour_rms = json_number_value(json_object_get(j, "colour_rms"));
	const bool sides = read_side(json_object_get(j, "a_to_b"), &r->a_to_b) &&
	                   read_side(json_object_get(j, "b_to_a"), &r->b_to_a) &&
	                   read_side(json_object_get(j, "both"), &r->both);
	return !g.bad && sides &&
	       (!seams || (read_zone(json_object_get(seams, "band"), &r->band) &&
	                   read_zone(json_object_get(seams, "interior"), &r->interior)));
}
