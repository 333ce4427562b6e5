/*
 * libjpeg appears in this file alone. It reports errors by a call that must not return: a long
 * jump, which never leaves read_guarded. Its own memory, some rows of the picture (all of a
 * progressive one), is not in the account.
 */
#include "io/image.h"

#ifdef WH_HAVE_JPEG

#include <setjmp.h>
#include <stdio.h>

#include <jpeglib.h>

typedef struct reader {
	struct jpeg_error_mgr errors; /* first: libjpeg hands back a pointer to it */
	jmp_buf back;
	wh_ctx *c;
	const char *path;
	wh_image *m;
	uint8_t *row;
	struct jpeg_decompress_struct jpeg;
} reader;

static void on_error(j_common_ptr jpeg)
{
	reader *r = (reader *)jpeg->err;
	char text[JMSG_LENGTH_MAX];
	jpeg->err->format_message(jpeg, text);
	(void)wh_fail(r->c, WH_E_INPUT, "'%s' is a damaged JPEG picture: %s", r->path, text);
	longjmp(r->back, 1);
}

static void on_message(j_common_ptr jpeg)
{
	(void)jpeg;
}

static void need(const reader *r, wh_code code)
{
	if (code != WH_OK)
		longjmp(((reader *)r)->back, 1);
}

static void read_rows(reader *r)
{
	struct jpeg_decompress_struct *j = &r->jpeg;
	const size_t w = r->m->w;
	while (j->output_scanline < j->output_height) {
		uint8_t *to = r->m->rgba + 4 * w * j->output_scanline;
		need(r, wh_poll(r->c));
		(void)jpeg_read_scanlines(j, &r->row, 1);
		for (size_t x = 0; x < w; x++, to += 4) {
			for (size_t k = 0; k < 3; k++)
				to[k] = r->row[3 * x + k];
			to[3] = 255;
		}
	}
}

static void read_picture(reader *r, const uint8_t *bytes, size_t n)
{
	struct jpeg_decompress_struct *j = &r->jpeg;
	jpeg_mem_src(j, bytes, n);
	(void)jpeg_read_header(j, TRUE);
	j->out_color_space = JCS_RGB;
	j->dct_method = JDCT_ISLOW;
	(void)jpeg_start_decompress(j);
	need(r, wh_image_make(r->c, r->path, j->output_width, j->output_height, r->m));
	r->row = wh_alloc(r->c, j->output_width, 3);
	need(r, r->row ? WH_OK : r->c->err.code);
	read_rows(r);
	(void)jpeg_finish_decompress(j);
}

static wh_code read_guarded(reader *r, const uint8_t *bytes, size_t n)
{
	if (setjmp(r->back)) /* NOLINT(cert-err52-cpp): libjpeg's way */
		return wh_failed(r->c);
	jpeg_create_decompress(&r->jpeg);
	read_picture(r, bytes, n);
	return WH_OK;
}

wh_code wh_jpeg_read(wh_ctx *c, const char *path, const uint8_t *bytes, size_t n, wh_image *m)
{
	reader *r = wh_calloc(c, 1, sizeof *r);
	if (!r)
		return c->err.code;
	r->c = c;
	r->path = path;
	r->m = m;
	r->jpeg.err = jpeg_std_error(&r->errors);
	r->errors.error_exit = on_error;
	r->errors.output_message = on_message;
	const wh_code code = read_guarded(r, bytes, n);
	jpeg_destroy_decompress(&r->jpeg);
	wh_free(c, r->row);
	wh_free(c, r);
	return code;
}

#else

wh_code wh_jpeg_read(wh_ctx *c, const char *path, const uint8_t *bytes, size_t n, wh_image *m)
{
	(void)bytes;
	(void)n;
	(void)m;
	return wh_fail(
	    c, WH_E_USAGE,
	    "'%s': this whittle was built without libjpeg; convert the picture to PNG, or "
	    "install libjpeg's headers (libjpeg62-turbo-dev) and build it again",
	    path);
}

#endif
