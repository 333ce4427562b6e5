/*
 * picture: files of any size to a picture, or to several side by side, within a ceiling.
 *
 * One camera for all files, fitted to what they show together. A file without faces is drawn as
 * a cloud of points. The picture is the same, byte for byte, for any number of threads and any
 * ceiling: what does not fit is drawn in bands of rows (algo/render) and windows of vertices
 * (pipeline/scene).
 */
#ifndef WH_PIPELINE_PICTURE_H
#define WH_PIPELINE_PICTURE_H

#include "algo/render.h"
#include "exec/exec.h"
#include "io/png.h"
#include "pipeline/progress.h"

enum {
	WH_PICTURE_CELLS = 36,        /* pictures side by side, at most */
	WH_PICTURE_SIDE_MOST = 32768, /* pixels */
	WH_PICTURE_NAME = 96
};

/* Which axis is up, by the shape of the box: z when the mesh lies flat in it, as maps do; else y.
 */
enum { WH_UP_GUESS = -1 };

/* One of the pictures. */
typedef struct wh_picture_cell {
	int file;      /* of the paths */
	bool own_view; /* else the view that suits the mesh */
	wh_view view;
	const char *view_name; /* for the label; may be NULL */
} wh_picture_cell;

/* What is seen of the meshes in one cell. */
typedef struct wh_picture_look {
	wh_image image;
	uint64_t faces, vertices;   /* of its file */
	double range, distance_max; /* as in the report, of this cell */
} wh_picture_look;

typedef struct wh_picture_params {
	const char *const *paths;
	int npaths;
	const char *output; /* path, or "-" for standard output */
	bool force;
	const wh_picture_cell *cells;
	int ncells;
	bool labels; /* below each cell: name, faces, view */
	/* NULL: all cells are one picture in `output`. Else each is a picture by itself, with a
	 * range of its own and neither label nor legend, which is given away in the order of the
	 * cells and is gone after the call; nothing is written. */
	wh_code (*take)(wh_ctx *c, void *user, int cell, const wh_picture_look *look);
	void *take_user;

	uint32_t width, height; /* of a cell, pixels, without its label */
	int samples;            /* along the side of a pixel: 1 .. WH_RENDER_SAMPLES_MOST */
	int up;                 /* wh_up, or WH_UP_GUESS */
	double zoom;            /* 1: all just fits */
	bool perspective, flat, wireframe, colours;
	bool texture;             /* as the files say, ... */
	const char *texture_file; /* ... or this one; NULL: none */
	wh_rgba background;

	const char *distance_to; /* coloured by the distance from this mesh; NULL: not */
	double range;            /* distance of the last colour, file units; 0: suits the mesh */

	const char *temp_dir;    /* NULL: $SLURM_TMPDIR, $TMPDIR, /tmp */
	size_t memory;           /* ceiling of the process, bytes; 0: half of what there is */
	uint64_t window;         /* tests: vertices in memory at most; 0: as the memory says */
	uint32_t band;           /* tests: rows of pixels drawn at a time; 0: as the memory says */
	wh_progress_fn progress; /* may be NULL */
	void *progress_user;
} wh_picture_params;

/* What was drawn. */
typedef struct wh_picture_report {
	uint32_t width, height;
	uint64_t faces, vertices; /* of all files */
	uint64_t covered;         /* pixels that show something */
	double range;             /* distance of the last colour; 0: none asked for */
	double distance_max;      /* of the pixels */
	wh_up up;                 /* as drawn in the first cell, ... */
	wh_view view;             /* ... seen from there */
	uint64_t bands, windows;  /* most of any cell */
} wh_picture_report;

/*
 * WH_E_INPUT for damaged files and such without a size; WH_E_PLAN when the ceiling is too low,
 * with a size that would do; WH_E_USAGE when there is no libpng or the output exists already.
 * c->mem->limit is set for the time of the call. On failure no output appears.
 */
wh_code wh_picture(wh_ctx *c, const wh_exec *ex, const wh_picture_params *p, wh_picture_report *r);

#endif
