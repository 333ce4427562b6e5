/*
 * Hollows. A pixel is compared with pairs of others, opposite to each other, at three distances:
 * where both are nearer to the viewer it lies in a hollow and gets less light from around, where
 * both are farther away on a ridge. The slopes to the two cancel on planes at any angle, so that
 * no normal is needed and a coarse mesh shows no facets by it. This is the idea of ambient
 * occlusion from depths (Bavoil, Sainz, Dimitrov 2008) on both sides of even. Pixels much nearer
 * or farther belong to other parts of the mesh and do not count.
 *
 * Cost. 48 looks at neighbours a pixel.
 */
#include "algo/render.h"

enum { PAIRS = 8, DISTANCES = 3, TAPS = PAIRS * DISTANCES };

static const double REACH[DISTANCES] = {0.0035, 0.011, 0.032}; /* of the picture's smaller side */
static const float STEEP = 3;   /* slope from which on a neighbour is another part */
static const float DEEP = 1.6F; /* strength in hollows, on ridges */
static const float HIGH = 0.22F;
static const float BRIGHTEST = 1.12F;

/* Half a circle of directions. */
static const double DIRECTION[PAIRS][2] = {
    {1, 0}, {0.92388, 0.38268},  {0.70711, 0.70711},  {0.38268, 0.92388},
    {0, 1}, {-0.38268, 0.92388}, {-0.70711, 0.70711}, {-0.92388, 0.38268}};

/* A pair of neighbours: at x, y and at -x, -y. */
typedef struct tap {
	int x, y;
	float per_depth; /* makes a slope of a difference in depth */
} tap;

static void make_taps(uint32_t w, uint32_t h, int samples, tap taps[TAPS])
{
	const double side = w < h ? w : h;
	for (int d = 0; d < DISTANCES; d++)
		for (int i = 0; i < PAIRS; i++) {
			const double r = fmax(REACH[d] * side, d + 1.5);
			tap *t = &taps[d * PAIRS + i];
			t->x = (int)lrint(r * DIRECTION[i][0]);
			t->y = (int)lrint(r * DIRECTION[i][1]);
			t->per_depth =
			    (float)(1 / (samples * sqrt((double)(t->x * t->x + t->y * t->y))));
		}
}

/* The neighbour at x, y; NULL when nothing is seen there. */
static const wh_pixel *neighbour(const wh_pixel *pixels, uint32_t w, uint32_t h, int64_t x,
                                 int64_t y)
{
	if (x < 0 || y < 0 || x >= w || y >= h)
		return NULL;
	const wh_pixel *p = pixels + (size_t)y * w + (size_t)x;
	return p->covered ? p : NULL;
}

/* Sine of a slope, less where it is too steep. */
static float rise(float slope)
{
	const float steep = fabsf(slope) / STEEP;
	if (!(steep < 1))
		return 0;
	return slope / sqrtf(1 + slope * slope) * (1 - steep * steep);
}

static float hollow_at(const wh_pixel *pixels, uint32_t w, uint32_t h, const tap taps[TAPS],
                       uint32_t x, uint32_t y)
{
	const wh_pixel *p = pixels + (size_t)y * w + x;
	float sum = 0;
	for (int i = 0; i < TAPS; i++) {
		const tap *t = taps + i;
		const int64_t dx = t->x, dy = t->y;
		const wh_pixel *a = neighbour(pixels, w, h, x + dx, y + dy);
		const wh_pixel *b = neighbour(pixels, w, h, x - dx, y - dy);
		if (a && b)
			sum += rise((p->depth - a->depth) * t->per_depth) +
			       rise((p->depth - b->depth) * t->per_depth);
	}
	return sum / TAPS;
}

void wh_render_hollows(const wh_pixel *pixels, uint32_t w, uint32_t h, int samples, uint32_t row,
                       float *factor)
{
	tap taps[TAPS];
	make_taps(w, h, samples, taps);
	for (uint32_t x = 0; x < w; x++) {
		factor[x] = 1;
		if (!pixels[(size_t)row * w + x].covered)
			continue;
		const float depth = hollow_at(pixels, w, h, taps, x, row);
		if (depth > 0)
			factor[x] = 1 / (1 + DEEP * depth);
		else
			factor[x] = fminf(1 - HIGH * depth, BRIGHTEST);
	}
}

static float light_of(uint8_t v)
{
	return (float)v / 255 * ((float)v / 255);
}

static uint8_t value_of(float light)
{
	return (uint8_t)(sqrtf(fminf(fmaxf(light, 0), 1)) * 255 + 0.5F);
}

wh_rgba wh_render_colour(const wh_pixel *p, int samples, const float tint[3], float factor,
                         wh_rgba background)
{
	if (p->covered == 0)
		return background;
	const uint8_t back[3] = {background.r, background.g, background.b};
	const float cover = (float)p->covered / (float)(samples * samples);
	const float rest = (1 - cover) * (float)background.a / 255;
	uint8_t out[3];
	for (int i = 0; i < 3; i++) {
		const float own = fminf((float)p->light[i] / 65535 * tint[i] * factor, 1);
		out[i] = value_of((own * cover + light_of(back[i]) * rest) / (cover + rest));
	}
	return (wh_rgba){out[0], out[1], out[2], (uint8_t)((cover + rest) * 255 + 0.5F)};
}
