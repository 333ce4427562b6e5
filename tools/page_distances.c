/* What the comparison of the levels with the input says, as tables. */
#include "page_parts.h"

#include <math.h>
#include <string.h>

static double millionths(double x, double diagonal)
{
	return diagonal > 0 ? x / diagonal * 1e6 : NAN;
}

static void put_name(const page_out *o, const page_mesh *m)
{
	page_put(o, "<th scope=\"row\"><span class=\"name\">");
	page_text(o, page_name(m->path));
	page_put(o, "</span></th>");
}

static void put_cell(const page_out *o, double x)
{
	page_put(o, "<td>");
	page_real(o, x);
	page_put(o, "</td>");
}

/* ---- all levels ----------------------------------------------------------------------------- */

static bool any_colours(const page_work *w)
{
	for (int i = 1; i < w->n; i++)
		if (w->mesh[i].distance.both.colours > 0)
			return true;
	return false;
}

static void put_level(const page_out *o, const page_mesh *m, bool colours)
{
	const wh_compare *r = &m->distance;
	page_put(o, "<tr>");
	put_name(o, m);
	page_put(o, "<td>");
	page_count(o, m->faces);
	page_put(o, "</td>");
	put_cell(o, r->rms);
	put_cell(o, millionths(r->rms, r->diagonal));
	put_cell(o, r->both.max);
	put_cell(o, millionths(r->both.max, r->diagonal));
	put_cell(o, r->normal_rms);
	if (colours)
		put_cell(o, r->colour_rms);
	page_put(o, "</tr>\n");
}

static void put_levels(const page_work *w, const page_out *o)
{
	const bool colours = any_colours(w);
	page_put(
	    o, "<div class=\"scroll\" tabindex=\"0\" role=\"group\" aria-label=\"Distances of all "
	       "levels\"><table>\n"
	       "<thead><tr><th scope=\"col\">Level</th><th scope=\"col\">Triangles</th>"
	       "<th scope=\"col\">RMS</th><th scope=\"col\">&times;&#8239;10<sup>&minus;6</sup> "
	       "of the diagonal</th><th scope=\"col\">Largest</th><th scope=\"col\">&times;&#8239;"
	       "10<sup>&minus;6</sup></th><th scope=\"col\">Normals, RMS&#8239;&deg;</th>");
	page_put(o, colours ? "<th scope=\"col\">Colours, RMS of 255</th>" : "");
	page_put(o, "</tr></thead>\n<tbody>\n");
	for (int i = 1; i < w->n; i++)
		put_level(o, &w->mesh[i], colours);
	page_put(o, "</tbody></table></div>\n");
}

/* ---- one level ------------------------------------------------------------------------------ */

static const struct {
	const char *text;
	size_t offset; /* of a double in wh_distance */
} rows[] = {
    {"Mean", offsetof(wh_distance, mean)},
    {"RMS", offsetof(wh_distance, rms)},
    {"50&#8239;% within", offsetof(wh_distance, p50)},
    {"90&#8239;% within", offsetof(wh_distance, p90)},
    {"99&#8239;% within", offsetof(wh_distance, p99)},
    {"Largest", offsetof(wh_distance, max)},
};

enum { NROWS = sizeof rows / sizeof *rows };

static double value_of(const wh_distance *d, int row)
{
	double v;
	memcpy(&v, (const char *)d + rows[row].offset, sizeof v);
	return v;
}

static void put_rows(const page_out *o, const wh_compare *r)
{
	const wh_distance *const sides[] = {&r->a_to_b, &r->b_to_a, &r->both};
	for (int i = 0; i < NROWS; i++) {
		page_putf(o, "<tr><th scope=\"row\">%s</th>", rows[i].text);
		for (int k = 0; k < 3; k++)
			put_cell(o, value_of(sides[k], i));
		put_cell(o, millionths(value_of(&r->both, i), r->diagonal));
		page_put(o, "</tr>\n");
	}
}

static void put_details(const page_out *o, const page_mesh *m, bool open)
{
	page_put(o, open ? "<details open><summary>" : "<details><summary>");
	page_put(o, "Both directions: <span class=\"name\">");
	page_text(o, page_name(m->path));
	page_put(o, "</span></summary>\n<div class=\"scroll\" tabindex=\"0\" role=\"group\" "
	            "aria-label=\"Distances in both directions\"><table>\n<thead><tr>"
	            "<th scope=\"col\">Distance</th><th scope=\"col\">Input to result</th>"
	            "<th scope=\"col\">Result to input</th><th scope=\"col\">Both</th>"
	            "<th scope=\"col\">&times;&#8239;10<sup>&minus;6</sup> of the diagonal</th>"
	            "</tr></thead>\n<tbody>\n");
	put_rows(o, &m->distance);
	page_put(o, "</tbody></table></div>\n<p class=\"small\">");
	page_count(o, m->distance.both.samples);
	page_put(o, " points spread evenly over both surfaces, and ");
	page_count(o, m->distance.both.vertices);
	page_put(o, " vertices for the largest distance.</p></details>\n");
}

void page_write_distances(const page_work *w, const page_out *o)
{
	page_put(o,
	         "<section id=\"distances\"><h2>Distances</h2>\n<p>Measured both ways, from points "
	         "of one surface to the nearest point of the other, in units of the file. RMS: "
	         "the larger of the two directions&rsquo;. The diagonal of the input&rsquo;s box "
	         "is ");
	page_real(o, w->mesh[1].distance.diagonal);
	page_put(o, ".</p>\n");
	put_levels(w, o);
	page_write_histograms(w, o);
	for (int i = 1; i < w->n; i++)
		put_details(o, &w->mesh[i], w->n == 2);
	page_put(o, "</section>\n");
}

/* ---- seams ---------------------------------------------------------------------------------- */

static bool has_band(const page_mesh *m)
{
	return m->distance.band.faces > 0 && m->distance.interior.faces > 0;
}

static void put_seam(const page_out *o, const page_mesh *m)
{
	const wh_compare *r = &m->distance;
	page_put(o, "<tr>");
	put_name(o, m);
	page_put(o, "<td>");
	page_count(o, r->band.faces);
	page_put(o, "</td><td>");
	page_count(o, r->interior.faces);
	page_put(o, "</td>");
	put_cell(o, r->band.rms);
	put_cell(o, r->interior.rms);
	put_cell(o, wh_compare_rms_ratio(r));
	put_cell(o, wh_compare_density_ratio(r));
	page_put(o, "</tr>\n");
}

/* Given on the command line, or to the run that measured. */
static bool has_seams(const page_work *w)
{
	for (int i = 1; i < w->n; i++)
		if (w->mesh[i].distance.banded)
			return true;
	return false;
}

void page_write_seams(const page_work *w, const page_out *o)
{
	if (!has_seams(w))
		return;
	page_put(o,
	         "<section id=\"seams\"><h2>Along the cuts</h2>\n<p>Faces within three of the cuts "
	         "between clusters, beside all others. A ratio of 1 means no trace; rough places "
	         "and flat ones differ without cuts, too, so ratios near 1 are no proof, and "
	         "others no fault, until the same is measured of a result that was never "
	         "cut.</p>\n");
	page_put(o, "<div class=\"scroll\" tabindex=\"0\" role=\"group\" aria-label=\"Figures "
	            "along the cuts\"><table>\n<thead><tr><th scope=\"col\">Level</th>"
	            "<th scope=\"col\">Faces in the band</th><th scope=\"col\">Others</th>"
	            "<th scope=\"col\">RMS in the band</th><th scope=\"col\">Elsewhere</th>"
	            "<th scope=\"col\">Ratio</th><th scope=\"col\">Ratio of faces an area</th>"
	            "</tr></thead>\n<tbody>\n");
	int none = 0;
	for (int i = 1; i < w->n; i++)
		if (has_band(&w->mesh[i]))
			put_seam(o, &w->mesh[i]);
		else
			none++;
	page_put(o, "</tbody></table></div>\n");
	if (none > 0)
		page_put(o,
		         "<p class=\"note\">Where a level is not listed there were no cuts, or no "
		         "faces apart from them.</p>\n");
	page_put(o, "</section>\n");
}
