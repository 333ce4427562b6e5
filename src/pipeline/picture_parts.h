/* picture_parts: what the parts of the picture module share. Internal to it. */
#ifndef WH_PIPELINE_PICTURE_PARTS_H
#define WH_PIPELINE_PICTURE_PARTS_H

#include "pipeline/fit.h"
#include "pipeline/normalise.h"
#include "pipeline/picture.h"
#include "pipeline/scene.h"

/* What a worker takes beside tables, in a scene or elsewhere. */
enum { WH_DRAW_WORKER_BYTES = 2 * 1024 * 1024 };

typedef struct wh_draw_file {
	wh_input input;
	bool open;
	wh_skins skins;
} wh_draw_file;

typedef struct wh_draw_cell {
	const wh_picture_cell *what;
	wh_camera camera;
	uint64_t faces, points; /* of its file */
	wh_pixel *pixels;
	float *distance; /* of each pixel's nearest sample; NULL: not asked for */
	double range, distance_max;
} wh_draw_cell;

typedef struct wh_draw {
	wh_ctx *c;
	const wh_picture_params *p;
	const wh_exec *ex;
	wh_picture_report *r;
	size_t memory;
	wh_progress progress;
	wh_spill spill;
	wh_draw_file file[WH_PICTURE_CELLS];
	wh_draw_cell cell[WH_PICTURE_CELLS];
	wh_fit fit;
	wh_sheet sheet;     /* the whole picture */
	int columns, lines; /* of cells */
	uint32_t label;     /* pixels below a cell */
	uint32_t legend;    /* pixels below all of them */
} wh_draw;

/* Bytes that are left of the ceiling. */
size_t wh_draw_budget(const wh_draw *d);

/* Columns, lines, and the size of the sheet, from the parameters alone. */
void wh_draw_lay_out(wh_draw *d);

/* Measures the distances of all pixels from the other mesh, and finds their range. */
wh_code wh_draw_distances(wh_draw *d);

/* Fills the sheet: cells, labels, legend. */
wh_code wh_draw_sheet(wh_draw *d);

#endif
