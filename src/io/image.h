/*
 * image: pictures from files, for textures: PNG through libpng, JPEG through libjpeg.
 *
 * Where whittle was built without one of them, its files are refused in words.
 */
#ifndef WH_IO_IMAGE_H
#define WH_IO_IMAGE_H

#include "io/png.h"

enum { WH_IMAGE_SIDE_MOST = 65536 };

/* Reads the file at `path`, as its first bytes say what it is; m->rgba is to be freed with wh_free.
 * WH_E_INPUT when it is no such picture, or a damaged one. */
wh_code wh_image_read(wh_ctx *c, const char *path, wh_image *m);

/* The same of n bytes that were read from `path`, of either kind (png.c, jpeg.c). */
wh_code wh_png_read(wh_ctx *c, const char *path, const uint8_t *bytes, size_t n, wh_image *m);
wh_code wh_jpeg_read(wh_ctx *c, const char *path, const uint8_t *bytes, size_t n, wh_image *m);

/* Room for the pixels of a picture of this size. */
wh_code wh_image_make(wh_ctx *c, const char *path, uint64_t w, uint64_t h, wh_image *m);

#endif
