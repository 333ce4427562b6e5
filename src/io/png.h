/*
 * png: pictures as PNG files, through libpng.
 *
 * Where whittle was built without libpng all of this is there too, and refuses in words.
 */
#ifndef WH_IO_PNG_H
#define WH_IO_PNG_H

#include "io/outfile.h"

/* Rows from top to bottom, four bytes a pixel: red, green, blue, alpha (not multiplied in). */
typedef struct wh_image {
	uint32_t w, h;
	uint8_t *rgba;
} wh_image;

/* WH_E_USAGE, with the remedy, when whittle was built without libpng: to be asked before work. */
wh_code wh_png_available(wh_ctx *c);

/* A PNG file in memory: zero-initialise; the caller frees `at` by wh_free. */
typedef struct wh_png {
	uint8_t *at;
	size_t bytes, cap;
} wh_png;

/* Appends the picture to an output; without its alpha unless `alpha`. A pixel at least. */
wh_code wh_png_write(wh_ctx *c, wh_outfile *o, const wh_image *image, bool alpha);
/* The same into memory, behind what is there. */
wh_code wh_png_encode(wh_ctx *c, wh_png *out, const wh_image *image, bool alpha);

#endif
