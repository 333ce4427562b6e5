/* A report's page: tools/page/report.html with its {{places}} filled. */
#include "page_files.h"
#include "page_parts.h"

#include <string.h>

static const char *title_of(const page_work *w)
{
	return w->o->title ? w->o->title : page_name(w->mesh[0].path);
}

static void write_title(const page_work *w, const page_out *o)
{
	page_text(o, title_of(w));
}

static const struct {
	const char *name;
	void (*write)(const page_work *w, const page_out *o);
} places[] = {
    {"title", write_title},
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
	page_put_whole(o, page_report, write_place, w);
}
