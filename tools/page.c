/* The frame of a report's page: tools/page/page.html with its {{places}} filled. */
#include "page_files.h"
#include "page_parts.h"
#include "whittle.h"

#include <string.h>

static const char *title_of(const page_work *w)
{
	return w->o->title ? w->o->title : page_name(w->mesh[0].path);
}

static void write_title(const page_work *w, const page_out *o)
{
	page_text(o, title_of(w));
}

static void write_version(const page_work *w, const page_out *o)
{
	(void)w;
	page_put(o, WHITTLE_VERSION);
}

static void write_css(const page_work *w, const page_out *o)
{
	(void)w;
	page_put(o, (const char *)page_css);
}

static const struct {
	const char *name;
	void (*write)(const page_work *w, const page_out *o);
} places[] = {
    {"title", write_title},
    {"version", write_version},
    {"css", write_css},
    {"figures", page_write_figures},
    {"pictures", page_write_pictures},
    {"view", page_write_view},
    {"maps", page_write_maps},
    {"distances", page_write_distances},
    {"seams", page_write_seams},
    {"runs", page_write_runs},
    {"data", page_write_data},
};

enum { NPLACES = sizeof places / sizeof *places };

static void write_place(const void *work, const page_out *o, const char *name, size_t n)
{
	for (int i = 0; i < NPLACES; i++)
		if (strlen(places[i].name) == n && strncmp(places[i].name, name, n) == 0)
			places[i].write(work, o);
}

void page_write(const page_work *w, const page_out *o)
{
	page_fill(o, (const char *)page_html, write_place, w);
}
