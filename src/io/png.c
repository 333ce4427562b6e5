/*
 * libpng appears in this file alone. Its memory comes from the context. It reports errors by a
 * long jump, which never leaves write_guarded and read_guarded.
 */
#include "io/image.h"

#ifdef WH_HAVE_PNG

#include <string.h>

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

/* ---- reading ------------------------------------------------------------------------------ */

typedef struct reader {
	wh_ctx *c;
	const char *path;
	const uint8_t *bytes;
	size_t n, at;
	wh_image *image;
	png_structp png;
	png_infop info;
} reader;

static void on_read_error(png_structp png, png_const_charp text)
{
	const reader *r = png_get_error_ptr(png);
	(void)wh_fail(r->c, WH_E_INPUT, "'%s' is a damaged PNG picture: %s", r->path, text);
	png_longjmp(png, 1);
}

static png_voidp take_to_read(png_structp png, png_alloc_size_t bytes)
{
	const reader *r = png_get_mem_ptr(png);
	return wh_alloc(r->c, bytes, 1);
}

static void give_back_read(png_structp png, png_voidp block)
{
	const reader *r = png_get_mem_ptr(png);
	wh_free(r->c, block);
}

static void on_read(png_structp png, png_bytep to, size_t n)
{
	reader *r = png_get_io_ptr(png);
	if (n > r->n - r->at)
		png_error(png, "it is cut short");
	memcpy(to, r->bytes + r->at, n);
	r->at += n;
}

/* Whatever it holds, it comes out as four bytes a pixel. */
static int set_transforms(const reader *r)
{
	png_set_expand(r->png);
	png_set_scale_16(r->png);
	png_set_gray_to_rgb(r->png);
	png_set_add_alpha(r->png, 255, PNG_FILLER_AFTER);
	return png_set_interlace_handling(r->png);
}

static void read_picture(const reader *r, int *passes)
{
	wh_image *m = r->image;
	png_set_read_fn(r->png, (void *)r, on_read);
	png_set_user_limits(r->png, WH_IMAGE_SIDE_MOST, WH_IMAGE_SIDE_MOST);
	png_read_info(r->png, r->info);
	*passes = set_transforms(r);
	png_read_update_info(r->png, r->info);
	if (wh_image_make(r->c, r->path, png_get_image_width(r->png, r->info),
	                  png_get_image_height(r->png, r->info), m) != WH_OK)
		png_longjmp(r->png, 1);
	for (; *passes > 0; --*passes)
		for (uint32_t y = 0; y < m->h; y++)
			png_read_row(r->png, m->rgba + (size_t)y * m->w * 4, NULL);
}

static wh_code read_guarded(const reader *r, int *passes)
{
	if (setjmp(png_jmpbuf(r->png))) /* NOLINT(cert-err52-cpp): libpng's way */
		return wh_failed(r->c);
	read_picture(r, passes);
	return WH_OK;
}

wh_code wh_png_read(wh_ctx *c, const char *path, const uint8_t *bytes, size_t n, wh_image *m)
{
	reader r = {.c = c, .path = path, .bytes = bytes, .n = n, .image = m};
	int passes = 0;
	r.png = png_create_read_struct_2(PNG_LIBPNG_VER_STRING, &r, on_read_error, on_warning, &r,
	                                 take_to_read, give_back_read);
	r.info = r.png ? png_create_info_struct(r.png) : NULL;
	wh_code code = WH_OK;
	if (!r.info)
		code = wh_fail(c, WH_E_RUN, "libpng cannot be used: it refused to start");
	else
		code = read_guarded(&r, &passes);
	png_destroy_read_struct(&r.png, &r.info, NULL);
	return code;
}

#else

wh_code wh_png_read(wh_ctx *c, const char *path, const uint8_t *bytes, size_t n, wh_image *m)
{
	(void)path;
	(void)bytes;
	(void)n;
	(void)m;
	return wh_png_available(c);
}

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
