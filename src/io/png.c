/*
 * libpng appears in this file alone. Its memory comes from the context. It reports errors by a
 * long jump, which never leaves write_guarded.
 */
#include "io/png.h"

#ifdef WH_HAVE_PNG

#include <png.h>
#include <string.h>

enum { COMPRESSION = 5 }; /* zlib's level: above, twice the time for one per cent */

typedef struct writer {
	wh_ctx *c;
	wh_outfile *out; /* NULL: into memory */
	wh_png *in_memory;
	const wh_image *image;
	bool alpha;
	png_structp png;
	png_infop info;
} writer;

wh_code wh_png_available(wh_ctx *c)
{
	(void)c;
	return WH_OK;
}

static void on_error(png_structp png, png_const_charp text)
{
	const writer *w = png_get_error_ptr(png);
	(void)wh_fail(w->c, WH_E_RUN, "libpng cannot make the picture: %s", text);
	png_longjmp(png, 1);
}

static void on_warning(png_structp png, png_const_charp text)
{
	(void)png;
	(void)text;
}

static png_voidp take(png_structp png, png_alloc_size_t bytes)
{
	const writer *w = png_get_mem_ptr(png);
	return wh_alloc(w->c, bytes, 1);
}

static void give_back(png_structp png, png_voidp block)
{
	const writer *w = png_get_mem_ptr(png);
	wh_free(w->c, block);
}

static wh_code append(wh_ctx *c, wh_png *m, const void *bytes, size_t n)
{
	if (n > SIZE_MAX - m->bytes)
		return wh_fail(c, WH_E_RUN, "the picture is too large for memory");
	if (wh_reserve(c, &m->at, &m->cap, m->bytes + n, 1) != WH_OK)
		return c->err.code;
	memcpy(m->at + m->bytes, bytes, n);
	m->bytes += n;
	return WH_OK;
}

static void on_write(png_structp png, png_bytep bytes, size_t n)
{
	const writer *w = png_get_io_ptr(png);
	const wh_code code = w->out ? wh_outfile_write(w->c, w->out, bytes, n)
	                            : append(w->c, w->in_memory, bytes, n);
	if (code != WH_OK)
		png_longjmp(png, 1);
}

static void on_flush(png_structp png)
{
	(void)png;
}

static void write_picture(writer *w)
{
	const wh_image *m = w->image;
	png_set_write_fn(w->png, w, on_write, on_flush);
	png_set_user_limits(w->png, m->w, m->h);
	png_set_compression_level(w->png, COMPRESSION);
	png_set_IHDR(w->png, w->info, m->w, m->h, 8,
	             w->alpha ? PNG_COLOR_TYPE_RGB_ALPHA : PNG_COLOR_TYPE_RGB, PNG_INTERLACE_NONE,
	             PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
	png_set_sRGB(w->png, w->info, PNG_sRGB_INTENT_PERCEPTUAL);
	png_write_info(w->png, w->info);
	if (!w->alpha)
		png_set_filler(w->png, 0, PNG_FILLER_AFTER);
	for (uint32_t y = 0; y < m->h; y++) {
		if (wh_poll(w->c) != WH_OK)
			png_longjmp(w->png, 1);
		png_write_row(w->png, m->rgba + (size_t)y * m->w * 4);
	}
	png_write_end(w->png, NULL);
}

static wh_code write_guarded(writer *w)
{
	if (setjmp(png_jmpbuf(w->png))) /* NOLINT(cert-err52-cpp): libpng's way */
		return wh_failed(w->c);
	write_picture(w);
	return WH_OK;
}

static wh_code write_with(writer *w)
{
	w->png = png_create_write_struct_2(PNG_LIBPNG_VER_STRING, w, on_error, on_warning, w, take,
	                                   give_back);
	w->info = w->png ? png_create_info_struct(w->png) : NULL;
	wh_code code = WH_OK;
	if (!w->info)
		code = wh_fail(w->c, WH_E_RUN, "libpng cannot be used: it refused to start");
	else
		code = write_guarded(w);
	png_destroy_write_struct(&w->png, &w->info);
	return code;
}

wh_code wh_png_write(wh_ctx *c, wh_outfile *o, const wh_image *image, bool alpha)
{
	writer w = {.c = c, .out = o, .image = image, .alpha = alpha};
	return write_with(&w);
}

wh_code wh_png_encode(wh_ctx *c, wh_png *out, const wh_image *image, bool alpha)
{
	writer w = {.c = c, .in_memory = out, .image = image, .alpha = alpha};
	return write_with(&w);
}

#else

wh_code wh_png_available(wh_ctx *c)
{
	return wh_fail(c, WH_E_USAGE,
	               "this whittle was built without libpng and makes no pictures: install "
	               "libpng's headers (libpng-dev) and build it again");
}

wh_code wh_png_write(wh_ctx *c, wh_outfile *o, const wh_image *image, bool alpha)
{
	(void)o;
	(void)image;
	(void)alpha;
	return wh_png_available(c);
}

wh_code wh_png_encode(wh_ctx *c, wh_png *out, const wh_image *image, bool alpha)
{
	(void)out;
	(void)image;
	(void)alpha;
	return wh_png_available(c);
}

#endif
