/*
 * render: triangles to a picture, any number of them, in any order, by any number of threads.
 *
 *     faces -> canvas (a depth and a colour for each sample) -> pixels -> picture
 *
 * A canvas holds the rows of a picture, or some of them, at several samples a pixel. Each sample
 * keeps the nearest face that covers it. Which of two faces at the same depth is kept depends on
 * their colours, not on who came first: so the picture does not depend on the schedule, nor on
 * how it is cut into canvases. Samples on an edge of two faces belong to exactly one of them.
 *
 * Light is added up as it is, and stored as its square root, which is near enough to the curve of
 * screens and the same on all machines. Everything here is serial but wh_canvas_face and its kin,
 * which may draw on the same canvas at the same time.
 */
#ifndef WH_ALGO_RENDER_H
#define WH_ALGO_RENDER_H

#include "base/mem.h"
#include "geom/camera.h"

#include <stdatomic.h>

enum { WH_RENDER_SAMPLES_MOST = 8 }; /* along the side of a pixel */

/* ---- faces to samples ----------------------------------------------------------------------- */

/* Nearness above, colour below: the greatest is the nearest. 0: nothing is there. */
typedef _Atomic uint64_t wh_sample;

/*
 * Samples lie in tiles of 32 x 16, a page of memory each, and in these in pieces of 4 x 2, a cache
 * line each: faces that follow each other are near each other, but not always side by side.
 */
typedef struct wh_canvas {
	uint32_t w, h;   /* samples of the whole picture */
	uint32_t y0, y1; /* rows y0 .. y1-1 of it are here */
	wh_sample *sample;
} wh_canvas;

enum { WH_TILE_W = 32, WH_TILE_H = 16, WH_TILE = WH_TILE_W * WH_TILE_H };

/* Tiles side by side in a canvas of this width. */
static inline size_t wh_canvas_across(uint32_t w)
{
	return ((size_t)w + WH_TILE_W - 1) / WH_TILE_W;
}

/* Samples that a canvas of so many rows takes, all zero to begin with. */
static inline size_t wh_canvas_samples(uint32_t w, uint32_t rows)
{
	return wh_canvas_across(w) * (((size_t)rows + WH_TILE_H - 1) / WH_TILE_H) * WH_TILE;
}

/* Where a sample is: the sum of one number for its row and one for its column. */
static inline size_t wh_canvas_row(const wh_canvas *v, uint32_t y)
{
	const size_t r = y - v->y0;
	return r / WH_TILE_H * wh_canvas_across(v->w) * WH_TILE + r % WH_TILE_H / 2 * 64 +
	       r % 2 * 4;
}

static inline size_t wh_canvas_column(uint32_t column)
{
	const size_t x = column;
	return x / WH_TILE_W * WH_TILE + x % WH_TILE_W / 4 * 8 + x % 4;
}

/* A vertex as the canvas sees it: as wh_camera_project gives it. 16 bytes, so that one look into
 * a large table brings all of it. */
typedef struct wh_spot {
	float x, y, depth;
	uint32_t colour; /* 0xRRGGBB */
} wh_spot;

/*
 * The sum of the normals of a vertex's faces, each weighted by the face's angle there (Thuermer &
 * Wuethrich 1998): three whole numbers of 21 bits, so that a sum is the same in any order. It
 * overflows with more than ten full turns around one vertex, which spoils its shading only: a
 * normal that is far from a face's is not used for it.
 */
typedef uint64_t wh_normal_sum;

/* What a face adds to the sums of its corners. */
void wh_render_normals(const wh_camera *k, const wh_spot *const corner[3], wh_normal_sum add[3]);

typedef struct wh_look {
	const wh_camera *camera;
	float base[3];  /* colour of the surface, as light */
	int samples;    /* along the side of a pixel */
	bool colours;   /* the corners' colours instead */
	bool smooth;    /* normals from the sums; else those of the faces */
	bool wireframe; /* edges are drawn */
	double radius;  /* of points, in samples */
} wh_look;

/* A face with this corner will be drawn soon: has the samples there brought near. */
void wh_canvas_expect(const wh_canvas *v, const wh_spot *corner);

/* The texture of a face: a picture of rows from top to bottom, four bytes a pixel, which goes on
 * for ever in all directions; and where the corners are in it, v upwards. */
typedef struct wh_skin {
	uint32_t w, h;
	const uint8_t *rgba;
	float uv[3][2];
} wh_skin;

/* Draws one face; `normal` may be NULL when the look is not smooth, `skin` when it has no texture.
 * Thread-safe. */
void wh_canvas_face(const wh_canvas *v, const wh_look *look, const wh_spot *const corner[3],
                    const wh_normal_sum *const normal[3], const wh_skin *skin);

/* Draws one point, as a small ball. Thread-safe. */
void wh_canvas_point(const wh_canvas *v, const wh_look *look, const wh_spot *spot);

/* ---- samples to pixels ---------------------------------------------------------------------- */

typedef struct wh_pixel {
	float depth;       /* of its nearest sample, ... */
	uint8_t place;     /* ... which is this one, row by row; undefined where none is covered */
	uint8_t covered;   /* samples that are */
	uint16_t light[3]; /* mean of those, as light: 65535 is white */
} wh_pixel;

/* Makes a row of pixels from the canvas, which holds all its rows of samples, and empties these:
 * the canvas is ready for other rows then. */
void wh_render_row(const wh_canvas *v, int samples, uint32_t row, wh_pixel *out);

/* The point of the picture that a pixel's nearest sample shows. */
wh_pixel_point wh_render_point(uint32_t w, uint32_t h, int samples, uint32_t x, uint32_t y,
                               const wh_pixel *p);

/*
 * How much light reaches the pixels of a row from all around, into `factor`: below 1 in hollows,
 * above 1 on ridges, 1 where all is even. From the depths of the pixels around, whatever the
 * faces; `pixels` is the whole picture of w x h.
 */
void wh_render_hollows(const wh_pixel *pixels, uint32_t w, uint32_t h, int samples, uint32_t row,
                       float *factor);

/* A colour of the picture: 0 .. 255, alpha not multiplied in. */
typedef struct wh_rgba {
	uint8_t r, g, b, a;
} wh_rgba;

/* The colour of a pixel on a background, with the light of the surface times `tint` (each 0 .. 1)
 * and `factor`. */
wh_rgba wh_render_colour(const wh_pixel *p, int samples, const float tint[3], float factor,
                         wh_rgba background);

/* ---- colours and words ---------------------------------------------------------------------- */

/* A colour for 0 .. 1, as light: in steps that look even, from pale yellow through
 * red to dark violet. */
void wh_render_map(double x, float rgb[3]);

/* A picture to draw in: four bytes a pixel. */
typedef struct wh_sheet {
	uint32_t w, h;
	uint8_t *rgba;
} wh_sheet;

/* Draws text with its baseline's left end at (x, y), capitals `size` pixels high; letters beyond
 * ASCII come out as boxes. Returns where it ends; with a NULL sheet that is all it does. */
double wh_render_text(const wh_sheet *s, double x, double y, double size, const char *text,
                      wh_rgba colour);

#endif
