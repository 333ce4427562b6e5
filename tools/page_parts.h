/*
 * page_parts: what a report's page is made of, and who makes it. Internal to report.
 *
 *     page_files_open, page_pictures, page_compare, page_meshes   gather; each may fail
 *     page_write                                                  writes all of it into
 * tools/page/report.html
 */
#ifndef WH_TOOLS_PAGE_PARTS_H
#define WH_TOOLS_PAGE_PARTS_H

#include "cmd.h"
#include "page_out.h"
#include "progress_bar.h"
#include "report_options.h"

#include "algo/compare.h"
#include "io/spill.h"
#include "mesh/compact.h"
#include "pipeline/picture.h"

#include <jansson.h>

/* The input, or a level. */
typedef struct page_mesh {
	const char *path;
	uint64_t faces, vertices, bytes; /* faces: triangles */
	wh_png picture;
	wh_png map;                 /* of its distance from the input, ... */
	double range, distance_max; /* ... the last colour, and the largest one seen */
	wh_compare distance;        /* the input is a, the level b */
	wh_compact shown;           /* what the page holds of it; its faces may be fewer */
	wh_compact_grid grid;
	const json_t *measured; /* by the run that made it; NULL: by none */
} page_mesh;

typedef struct page_work {
	wh_ctx *c;
	const wh_exec *ex;
	const report_options *o;
	progress_bar *bar;
	wh_spill spill;
	size_t memory;                /* ceiling */
	page_mesh mesh[REPORT_FILES]; /* the input, and the levels */
	int n;
	json_t *runs[REPORT_FILES]; /* as many as options name */
	bool drawn;                 /* there are pictures: built with libpng */
	wh_up up;
	wh_view view;
} page_work;

/* Looks at the files, and reads the reports. */
wh_code page_files_open(page_work *w);
/* Pictures from one camera, and maps of the distances. */
wh_code page_pictures(page_work *w);
wh_code page_compare(page_work *w);
/* What of the levels can be turned around. */
wh_code page_meshes(page_work *w);
void page_work_free(page_work *w);

/* Everything that has been gathered, as one page. */
void page_write(const page_work *w, const page_out *o);

/* Sections of it; each writes nothing where there is nothing to say. */
void page_write_figures(const page_work *w, const page_out *o);
void page_write_pictures(const page_work *w, const page_out *o);
void page_write_maps(const page_work *w, const page_out *o);
void page_write_distances(const page_work *w, const page_out *o);
void page_write_histograms(const page_work *w, const page_out *o);
void page_write_seams(const page_work *w, const page_out *o);
void page_write_view(const page_work *w, const page_out *o);
void page_write_runs(const page_work *w, const page_out *o);
void page_write_data(const page_work *w, const page_out *o);

#endif
