/* What is done with pixels: their colours, words below them, a legend. */
#include "pipeline/picture_parts.h"

#include <inttypes.h>
#include <stdio.h>
#include <string.h>

enum {
	LEGEND_STEPS = 2, /* numbers beside the first one */
	TEXT_LEAST = 8,
	NUMBER = 32,
	WORDS = WH_PICTURE_NAME * 2
};

static const double TEXT = 1.0 / 48; /* size of capitals, of a cell's height */

static double text_size(const wh_draw *d)
{
	return fmax(d->p->height * TEXT, TEXT_LEAST);
}

static bool light_background(const wh_draw *d)
{
	const wh_rgba b = d->p->background;
	return b.a < 128 || 2 * b.r + 5 * b.g + b.b > 8 * 110;
}

static wh_rgba word_colour(const wh_draw *d)
{
	return light_background(d) ? (wh_rgba){40, 42, 46, 255} : (wh_rgba){235, 236, 238, 255};
}

/* ---- layout --------------------------------------------------------------------------------- */

void wh_draw_lay_out(wh_draw *d)
{
	const int n = d->p->ncells;
	const bool apart = d->p->take != NULL; /* below each other: each is a block of memory */
	int columns = n <= 3 ? n : (n + 1) / 2;
	while (columns > 4 && columns * columns > 2 * n)
		columns--;
	d->columns = apart ? 1 : columns;
	d->lines = (n + d->columns - 1) / d->columns;
	d->label = d->p->labels && !apart ? (uint32_t)(2.6 * text_size(d)) : 0;
	d->legend = d->p->distance_to && !apart ? (uint32_t)(6.4 * text_size(d)) : 0;
	d->sheet.w = d->p->width * (uint32_t)d->columns;
	d->sheet.h = (d->p->height + d->label) * (uint32_t)d->lines;
	d->sheet.h += d->p->labels ? d->legend : 0;
}

static uint32_t left_of(const wh_draw *d, int cell)
{
	return (uint32_t)(cell % d->columns) * d->p->width;
}

static uint32_t top_of(const wh_draw *d, int cell)
{
	return (uint32_t)(cell / d->columns) * (d->p->height + d->label);
}

/* ---- pixels --------------------------------------------------------------------------------- */

typedef struct colouring {
	wh_draw *d;
	float *factor; /* a row for each worker */
	uint64_t *covered;
} colouring;

static void put_pixel(const wh_sheet *s, size_t x, size_t y, wh_rgba c)
{
	const uint8_t bytes[4] = {c.r, c.g, c.b, c.a};
	memcpy(s->rgba + 4 * (y * s->w + x), bytes, sizeof bytes);
}

static wh_code colour_job(wh_ctx *c, void *arg, int64_t index, int worker)
{
	const colouring *s = arg;
	const wh_draw *d = s->d;
	const uint32_t w = d->p->width, h = d->p->height;
	const int cell = (int)(index / h);
	const uint32_t row = (uint32_t)(index % h);
	const wh_draw_cell *k = &d->cell[cell];
	float *factor = s->factor + (size_t)worker * w;
	(void)c;
	wh_render_hollows(k->pixels, w, h, d->p->samples, row, factor);
	for (uint32_t x = 0; x < w; x++) {
		const size_t at = (size_t)row * w + x;
		float tint[3] = {1, 1, 1};
		if (k->distance)
			wh_render_map((double)k->distance[at] / k->range, tint);
		s->covered[worker] += k->pixels[at].covered > 0;
		put_pixel(&d->sheet, left_of(d, cell) + x, top_of(d, cell) + row,
		          wh_render_colour(&k->pixels[at], d->p->samples, tint, factor[x],
		                           d->p->background));
	}
	return WH_OK;
}

static wh_code colour_cells(wh_draw *d)
{
	const size_t workers = (size_t)d->ex->workers;
	colouring s = {.d = d};
	s.factor = wh_alloc(d->c, workers * d->p->width, sizeof *s.factor);
	s.covered = wh_calloc(d->c, workers, sizeof *s.covered);
	wh_code code = d->c->err.code;
	if (code == WH_OK)
		code =
		    wh_exec_for(d->c, d->ex, (int64_t)d->p->ncells * d->p->height, colour_job, &s);
	for (size_t i = 0; code == WH_OK && i < workers; i++)
		d->r->covered += s.covered[i];
	wh_free(d->c, s.covered);
	wh_free(d->c, s.factor);
	return code;
}

static void fill_background(const wh_draw *d)
{
	for (size_t y = 0; y < d->sheet.h; y++)
		for (size_t x = 0; x < d->sheet.w; x++)
			put_pixel(&d->sheet, x, y, d->p->background);
}

/* ---- words ---------------------------------------------------------------------------------- */

static const char *name_of(const char *path)
{
	const char *slash = strrchr(path, '/');
	return slash ? slash + 1 : path;
}

/* 1234567 as "1 234 567". */
static void group(uint64_t n, char out[NUMBER])
{
	char digits[NUMBER];
	const int len = snprintf(digits, sizeof digits, "%" PRIu64, n);
	int at = 0;
	for (int i = 0; i < len; i++) {
		if (i > 0 && (len - i) % 3 == 0)
			out[at++] = ' ';
		out[at++] = digits[i];
	}
	out[at] = '\0';
}

/* In the middle of a cell's label, smaller where it is too long. */
static void draw_label(const wh_draw *d, int cell)
{
	const wh_picture_cell *k = d->cell[cell].what;
	char number[NUMBER], words[WORDS];
	const uint64_t faces = d->cell[cell].faces, points = d->cell[cell].points;
	group(faces ? faces : points, number);
	(void)snprintf(words, sizeof words, "%.*s  %s %s%s%s", WH_PICTURE_NAME,
	               name_of(d->p->paths[k->file]), number, faces ? "faces" : "points",
	               k->view_name ? "  " : "", k->view_name ? k->view_name : "");
	double size = text_size(d);
	const double room = d->p->width * 0.94;
	const double wide = wh_render_text(NULL, 0, 0, size, words, d->p->background);
	if (wide > room)
		size *= room / wide;
	const double x = left_of(d, cell) + (d->p->width - fmin(wide, room)) / 2;
	const double y = top_of(d, cell) + d->p->height + 1.5 * text_size(d);
	(void)wh_render_text(&d->sheet, x, y, size, words, word_colour(d));
}

/* ---- legend --------------------------------------------------------------------------------- */

typedef struct bar {
	double x, y, w, h;
} bar;

/* As much of it as there is room for. */
static void draw_bar(const wh_draw *d, const bar *b)
{
	const int64_t x0 = (int64_t)b->x, y0 = (int64_t)b->y, w = (int64_t)b->w;
	for (int64_t y = y0 > 0 ? y0 : 0; y < y0 + (int64_t)b->h && y < d->sheet.h; y++)
		for (int64_t x = x0; x < x0 + w && x < d->sheet.w; x++) {
			float rgb[3];
			uint8_t v[3];
			wh_render_map(((double)(x - x0) + 0.5) / (double)w, rgb);
			for (int i = 0; i < 3; i++)
				v[i] = (uint8_t)(sqrtf(rgb[i]) * 255 + 0.5F);
			put_pixel(&d->sheet, (size_t)x, (size_t)y,
			          (wh_rgba){v[0], v[1], v[2], 255});
		}
}

static void draw_number(const wh_draw *d, const bar *b, int step, double size)
{
	const double share = (double)step / LEGEND_STEPS, range = d->r->range;
	const bool more = step == LEGEND_STEPS && d->r->distance_max > range;
	char text[NUMBER];
	(void)snprintf(text, sizeof text, "%.4g%s", range * share, more ? "+" : "");
	const double wide = wh_render_text(NULL, 0, 0, size, text, d->p->background);
	const double x = b->x + (b->w - wide) * share;
	(void)wh_render_text(&d->sheet, x, b->y + b->h + 1.7 * size, size, text, word_colour(d));
}

/* In the lower left corner. */
static void draw_legend(const wh_draw *d)
{
	const double size = text_size(d), margin = 1.3 * size;
	char words[WORDS];
	bar b = {.x = floor(margin), .h = ceil(0.9 * size)};
	b.w = floor(fmin(d->p->width * 0.4, d->sheet.w - 2 * margin));
	b.y = floor(d->sheet.h - margin - 1.7 * size - b.h);
	(void)snprintf(words, sizeof words, "distance to %.*s", WH_PICTURE_NAME,
	               name_of(d->p->distance_to));
	(void)wh_render_text(&d->sheet, b.x, b.y - 0.8 * size, size, words, word_colour(d));
	draw_bar(d, &b);
	for (int i = 0; i <= LEGEND_STEPS; i++)
		draw_number(d, &b, i, size);
}

wh_code wh_draw_sheet(wh_draw *d)
{
	fill_background(d);
	if (colour_cells(d) != WH_OK)
		return d->c->err.code;
	for (int i = 0; d->label && i < d->p->ncells; i++)
		draw_label(d, i);
	if (d->legend)
		draw_legend(d);
	return WH_OK;
}
