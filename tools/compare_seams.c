#include "compare_seams.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>

static double density(const wh_compare_zone *z)
{
	return z->area > 0 ? (double)z->faces / z->area : 0;
}

static void print_ratio(const char *text, double ratio)
{
	if (isnan(ratio))
		(void)printf("%-26s%14s\n", text, "undefined");
	else
		(void)printf("%-26s%14.4f\n", text, ratio);
}

static void print_zones(const wh_compare *r, const char *title)
{
	(void)printf("%-26s%14s%14s\n", title, "band", "interior");
	(void)printf("%-26s%14" PRIu64 "%14" PRIu64 "\n", "  faces", r->band.faces,
	             r->interior.faces);
	(void)printf("%-26s%14.6g%14.6g\n", "  area", r->band.area, r->interior.area);
	(void)printf("%-26s%14.6g%14.6g\n", "  RMS", r->band.rms, r->interior.rms);
	print_ratio("  ratio of RMS", wh_compare_rms_ratio(r));
	print_ratio("  ratio of faces / area", wh_compare_density_ratio(r));
	if (r->band.colours > 0)
		(void)printf("%-26s%14.4f%14.4f\n", "  RMS of colours", r->band.colour_rms,
		             r->interior.colour_rms);
}

void compare_seams_print(const wh_compare *r, const wh_compare *reference)
{
	print_zones(r, "along the seams, in B");
	if (!reference)
		return;
	print_zones(reference, "there in the reference");
	(void)printf("B over the reference\n");
	print_ratio("  ratio of RMS", wh_compare_rms_ratio(r) / wh_compare_rms_ratio(reference));
	print_ratio("  ratio of faces / area",
	            wh_compare_density_ratio(r) / wh_compare_density_ratio(reference));
}

/* JSON has no NaN. */
static json_t *json_ratio(double ratio)
{
	return isfinite(ratio) ? json_real(ratio) : json_null();
}

static json_t *json_zone(const wh_compare_zone *z)
{
	json_t *j = json_object();
	(void)json_object_set_new(j, "faces", json_integer((json_int_t)z->faces));
	(void)json_object_set_new(j, "area", json_real(z->area));
	(void)json_object_set_new(j, "density", json_real(density(z)));
	(void)json_object_set_new(j, "samples", json_integer((json_int_t)z->samples));
	(void)json_object_set_new(j, "rms", json_real(z->rms));
	if (z->colours > 0)
		(void)json_object_set_new(j, "colour_rms", json_real(z->colour_rms));
	return j;
}

static json_t *json_zones(const wh_compare *r)
{
	json_t *j = json_object();
	(void)json_object_set_new(j, "band", json_zone(&r->band));
	(void)json_object_set_new(j, "interior", json_zone(&r->interior));
	(void)json_object_set_new(j, "rms_ratio", json_ratio(wh_compare_rms_ratio(r)));
	(void)json_object_set_new(j, "density_ratio", json_ratio(wh_compare_density_ratio(r)));
	return j;
}

json_t *compare_seams_json(const wh_compare *r, const wh_compare *reference)
{
	json_t *j = json_zones(r);
	if (!reference)
		return j;
	(void)json_object_set_new(j, "reference", json_zones(reference));
	(void)json_object_set_new(
	    j, "rms_ratio_over_reference",
	    json_ratio(wh_compare_rms_ratio(r) / wh_compare_rms_ratio(reference)));
	(void)json_object_set_new(
	    j, "density_ratio_over_reference",
	    json_ratio(wh_compare_density_ratio(r) / wh_compare_density_ratio(reference)));
	return j;
}
