/*
 * The map of colours is a path through OKLab (Ottosson 2020) in 16 equal steps of lightness, from
 * 0.955 to 0.29, while the hue turns from yellow through orange and red to violet: equal steps look
 * equal, also without colours. It begins light, so that shape is seen well where there is little
 * to tell, and what stands out is dark.
 */
#include "algo/render.h"

enum { STEPS = 16 };

/* Values of a screen, 0 .. 255. */
static const uint8_t path[STEPS + 1][3] = {
    {243, 242, 215}, {237, 227, 187}, {233, 210, 159}, {232, 192, 131}, {232, 173, 106},
    {232, 152, 83},  {231, 130, 66},  {228, 106, 56},  {218, 87, 62},   {204, 70, 71},
    {188, 54, 79},   {171, 39, 85},   {153, 24, 90},   {134, 7, 93},    {113, 1, 93},
    {92, 1, 90},     {71, 0, 84},
};

void wh_render_map(double x, float rgb[3])
{
	const double at = fmin(fmax(x, 0), 1) * STEPS;
	const int i = at < STEPS ? (int)at : STEPS - 1;
	const double t = at - i;
	for (int k = 0; k < 3; k++) {
		const double v = (path[i][k] + (path[i + 1][k] - path[i][k]) * t) / 255;
		rgb[k] = (float)(v * v);
	}
}
