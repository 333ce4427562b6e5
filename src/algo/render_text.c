/*
 * Letters of strokes: each glyph is some polylines on a grid, two digits a point (x, then y), and
 * a blank between lines. The baseline is at y = 2, capitals reach 8, small letters 6, and tails 0.
 * A pixel's ink is its distance from the nearest stroke, so that letters are smooth at any size.
 */
#include "algo/render.h"

#include <string.h>

enum {
	FIRST = ' ',
	LAST = '~',
	BASELINE = 2,
	CAPITAL = 6, /* units from the baseline */
	SPACE = 3,   /* units a blank takes, and between letters ... */
	GAP = 2
};

static const double STROKE = 0.4; /* half a stroke's width, in units; in pixels at least: */
static const double STROKE_LEAST = 0.55;

static const char *const glyphs[LAST - FIRST + 1] = {
    "", /* blank */
    "0804 0202",
    "0806 1816",
    "1218 3238 0444 0646",
    "473818070615354443321203 2921",
    "0248 0818170708 3343423233",
    "420607182837360403122244",
    "0806",
    "19070311",
    "09171301",
    "2723 0644 0446",
    "2723 0545",
    "1201",
    "0535",
    "0202",
    "0148",
    "183847433212030718",
    "071812 0222",
    "07183847460242",
    "0718384746354443321203 3515",
    "32380444",
    "480805354443321203",
    "473818070312324344351504",
    "084812",
    "15060718384746351504031232434435",
    "031232434738180706153546",
    "0606 0303",
    "1616 1201",
    "470543",
    "0646 0444",
    "074503",
    "0718384746352524 2222",
    "342314152635334446381806041242",
    "022842 1434",
    "02083847463544433202 0535",
    "4738180703123243",
    "02082846442202",
    "48080242 0535",
    "480802 0535",
    "47381807031232434525",
    "0802 4842 0545",
    "0802",
    "3833221203",
    "0802 4804 1542",
    "080242",
    "0208254842",
    "02084248",
    "183847433212030718",
    "02083847463505",
    "183847433212030718 2442",
    "02083847463505 2542",
    "473818070615354443321203",
    "0848 2822",
    "080312324348",
    "082248",
    "0812263248",
    "0842 4802",
    "082548 2522",
    "08480242",
    "19090111",
    "0841",
    "09191101",
    "062846",
    "0141",
    "0817",
    "0616263532 341403122233",
    "0802 0516263533221203",
    "3526160503122233",
    "3832 3526160503122233",
    "043435261605031232",
    "281712 0626",
    "3526160503122233 3631201001",
    "0802 0516263532",
    "0602 0808",
    "161100 1818",
    "0802 3604 1532",
    "0802",
    "0602 05162522 25364542",
    "0602 0516263532",
    "162635332212030516",
    "0600 0516263533221203",
    "3630 3526160503122233",
    "0602 051626",
    "3616051424332202",
    "181322 0626",
    "0603122233 3632",
    "062246",
    "0612253246",
    "0632 3602",
    "0622 4610",
    "06360232",
    "29181605141221",
    "0901",
    "09181625141201",
    "05163445",
};

static const char box[] = "0208484202"; /* for letters that are not here */

static const char *glyph_of(char letter)
{
	return letter >= FIRST && letter <= LAST ? glyphs[letter - FIRST] : box;
}

static int width_of(const char *glyph)
{
	int w = 0;
	if (*glyph == '\0')
		return SPACE - GAP;
	for (; *glyph; glyph += *glyph == ' ' ? 1 : 2)
		if (*glyph != ' ' && *glyph - '0' > w)
			w = *glyph - '0';
	return w;
}

/* Squared distance of (x, y) from the line between two points. */
static double from_line(double x, double y, const double a[2], const double b[2])
{
	const double dx = b[0] - a[0], dy = b[1] - a[1], px = x - a[0], py = y - a[1];
	const double len2 = dx * dx + dy * dy;
	double t = len2 > 0 ? (px * dx + py * dy) / len2 : 0;
	t = fmin(fmax(t, 0), 1);
	const double ex = px - t * dx, ey = py - t * dy;
	return ex * ex + ey * ey;
}

/* Distance of a point of the grid from the glyph's strokes. */
static double from_glyph(const char *glyph, double x, double y)
{
	double nearest = INFINITY, last[2] = {0, 0};
	bool begun = false;
	while (*glyph) {
		if (*glyph == ' ') {
			begun = false;
			glyph++;
			continue;
		}
		const double at[2] = {glyph[0] - '0', glyph[1] - '0'};
		nearest = fmin(nearest, from_line(x, y, begun ? last : at, at));
		memcpy(last, at, sizeof last);
		begun = true;
		glyph += 2;
	}
	return sqrt(nearest);
}

static void ink(uint8_t *pixel, wh_rgba colour, double cover)
{
	const uint8_t own[4] = {colour.r, colour.g, colour.b, 255};
	for (int i = 0; i < 4; i++)
		pixel[i] = (uint8_t)lrint(pixel[i] + (own[i] - pixel[i]) * cover);
}

static void draw_glyph(const wh_sheet *s, const char *glyph, double x, double y, double unit,
                       wh_rgba colour)
{
	const double half = fmax(STROKE * unit, STROKE_LEAST), margin = half + 1;
	const int64_t x0 = (int64_t)floor(x - margin), y0 = (int64_t)floor(y - 7 * unit - margin);
	const int64_t x1 = (int64_t)ceil(x + width_of(glyph) * unit + margin);
	const int64_t y1 = (int64_t)ceil(y + BASELINE * unit + margin);
	for (int64_t j = y0 > 0 ? y0 : 0; j <= y1 && j < s->h; j++)
		for (int64_t i = x0 > 0 ? x0 : 0; i <= x1 && i < s->w; i++) {
			const double gx = ((double)i + 0.5 - x) / unit;
			const double gy = (y - (double)j - 0.5) / unit + BASELINE;
			const double cover = half + 0.5 - from_glyph(glyph, gx, gy) * unit;
			if (cover > 0)
				ink(s->rgba + 4 * ((size_t)j * s->w + (size_t)i), colour,
				    fmin(cover, 1));
		}
}

double wh_render_text(const wh_sheet *s, double x, double y, double size, const char *text,
                      wh_rgba colour)
{
	const double unit = size / CAPITAL;
	for (; *text; text++) {
		if (((unsigned char)*text & 0xc0) == 0x80)
			continue; /* the rest of a letter beyond ASCII */
		const char *glyph = glyph_of(*text);
		if (s)
			draw_glyph(s, glyph, x, y, unit, colour);
		x += (width_of(glyph) + GAP) * unit;
	}
	return x - (GAP - 2 * STROKE) * unit;
}
