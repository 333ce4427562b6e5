/* Pictures and maps, as figures with their words. */
#include "page_parts.h"

#include "algo/render.h"

#include <math.h>

static void put_image(const page_work *w, const page_out *o, const wh_png *p)
{
	page_putf(o,
	          "<img width=\"%u\" height=\"%u\" loading=\"lazy\" "
	          "src=\"data:image/png;base64,",
	          w->o->width, w->o->height);
	page_base64(o, p->at, p->bytes);
	page_put(o, "\" alt=\"");
}

static void put_share(const page_work *w, const page_out *o, const page_mesh *m)
{
	const double share =
	    w->mesh[0].faces ? (double)m->faces / (double)w->mesh[0].faces * 100 : 0;
	page_putf(o, share < 10 ? "%.2g&#8239;%%" : "%.1f&#8239;%%", share);
}

static void put_picture(const page_work *w, const page_out *o, int i)
{
	const page_mesh *m = &w->mesh[i];
	page_put(o, "<figure>");
	put_image(w, o, &m->picture);
	page_put(o, i == 0 ? "The input, " : "The result, ");
	page_text(o, page_name(m->path));
	page_putf(o, ", shaded, %llu triangles\"><figcaption><b>", (unsigned long long)m->faces);
	page_put(o, i == 0 ? "Before" : "After");
	page_put(o, "</b> &middot; <span class=\"name\">");
	page_text(o, page_name(m->path));
	page_put(o, "</span> &middot; ");
	page_count(o, m->faces);
	page_put(o, " triangles");
	if (i > 0) {
		page_put(o, " &middot; ");
		put_share(w, o, m);
	}
	page_put(o, "</figcaption></figure>\n");
}

void page_write_pictures(const page_work *w, const page_out *o)
{
	page_put(o, "<section id=\"pictures\"><h2>Before and after</h2>\n");
	if (!w->drawn)
		page_put(
		    o,
		    "<p class=\"note\">No pictures: this whittle was built without libpng.</p>\n");
	else
		page_put(
		    o, "<p>From one camera, without perspective.</p>\n<div class=\"pictures\">\n");
	for (int i = 0; w->drawn && i < w->n; i++)
		put_picture(w, o, i);
	page_put(o, w->drawn ? "</div></section>\n" : "</section>\n");
}

/* ---- maps ----------------------------------------------------------------------------------- */

/* The colours of a map from none to its range, as a gradient of CSS. */
static void put_gradient(const page_out *o)
{
	enum { STOPS = 12 };
	page_put(o, "linear-gradient(to right");
	for (int i = 0; i <= STOPS; i++) {
		float rgb[3];
		wh_render_map((double)i / STOPS, rgb);
		page_putf(o, ",rgb(%d %d %d)", (int)(sqrtf(rgb[0]) * 255 + 0.5F),
		          (int)(sqrtf(rgb[1]) * 255 + 0.5F), (int)(sqrtf(rgb[2]) * 255 + 0.5F));
	}
	page_put(o, ")");
}

static void put_legend(const page_out *o, const page_mesh *m)
{
	page_put(o, "<div class=\"legend\"><div class=\"bar\" style=\"background:");
	put_gradient(o);
	page_put(o, "\"></div><span>0</span><span>");
	page_putf(o, "%.4g</span><span>%.4g", m->range / 2, m->range);
	page_put(o, m->distance_max > m->range ? " and more</span></div>" : "</span></div>");
}

static void put_map(const page_work *w, const page_out *o, const page_mesh *m)
{
	page_put(o, "<figure>");
	put_image(w, o, &m->map);
	page_put(o, "The result, ");
	page_text(o, page_name(m->path));
	page_put(o, ", coloured by its distance from the input; largest one seen: ");
	page_putf(o, "%.4g", m->distance_max);
	page_put(o, "\"><figcaption>");
	put_legend(o, m);
	page_put(o, "<span class=\"name\">");
	page_text(o, page_name(m->path));
	page_put(o, "</span>, largest distance seen ");
	page_real(o, m->distance_max);
	if (m->distance.diagonal > 0) {
		page_put(o, ", which is ");
		page_real(o, m->distance_max / m->distance.diagonal * 100);
		page_put(o, "&#8239;% of the diagonal");
	}
	page_put(o, "</figcaption></figure>\n");
}

void page_write_maps(const page_work *w, const page_out *o)
{
	if (!w->drawn)
		return;
	page_put(o,
	         "<section id=\"maps\"><h2>Where the surface has moved</h2>\n<p>Every pixel is "
	         "coloured by the distance of the point it shows from the input, in units of the "
	         "file.");
	page_put(o, w->n > 2 ? " Each level has its own scale.</p>\n" : "</p>\n");
	page_put(o, "<div class=\"pictures\">\n");
	for (int i = 1; i < w->n; i++)
		put_map(w, o, &w->mesh[i]);
	page_put(o, "</div></section>\n");
}
