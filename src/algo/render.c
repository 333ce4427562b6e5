/*
 * Idea. The z-buffer (Catmull 1974) with edge functions (Pineda 1988) in whole numbers: corners
 * are rounded to 1/1024 of a sample, so that two faces with a common edge agree about every sample
 * on it, and a surface has no holes however small its faces are. Most faces of a large mesh lie
 * between the samples and are done with after a look at their box.
 *
 * A sample is one number, nearness above colour, and drawing is its maximum: without locks, and the
 * same in any order. The colour is made before it is stored, for samples that are not hidden by
 * what is there already, so nothing has to be looked up again when all faces have passed.
 *
 * Cost. 8 bytes a sample. Some 20 ns for a face between samples, 100 ns and more for others, and
 * 20 ns a sample.
 */
#include "algo/render.h"

#include <string.h>

enum {
	STEP_BITS = 10, /* of a sample's side: places of corners */
	STEP = 1 << STEP_BITS,
	COLOUR_BITS = 10, /* of a channel */
	COLOUR_MOST = (1 << COLOUR_BITS) - 1,
	SUM_BITS = 21
};

/* Corners are at most WH_CAMERA_MOST = 2^19 samples from the middle, and samples no more than 2^17:
 * 2^30 steps between them, and 2^61 for the difference of two products. */
_Static_assert((int64_t)WH_CAMERA_MOST *STEP == 1 << 29, "products of steps fit 64 bits");

static const float SUM_SCALE = 16384;       /* of a normal of weight 1 in a sum */
static const float CREASE = 0.6F;           /* cosine: sharper corners are not smoothed */
static const float EDGE_WIDTH = 0.5F;       /* pixels of an edge on each of its sides */
static const float LENGTH_FADE[2] = {1, 6}; /* of an edge, pixels: not seen, fully seen; ... */
static const float HEIGHT_FADE[2] = {1, 7}; /* ... so for the height of its face */
static const float EDGE_LIGHT = 0.02F;

/* The C library's fmin and fmax care for what is not a number, and are calls. */
static inline float at_least(float x, float least)
{
	return x > least ? x : least;
}

static inline float within_one(float x)
{
	return x > 0 ? x < 1 ? x : 1 : 0;
}

/* ---- normals -------------------------------------------------------------------------------- */

typedef struct vec3f {
	float x, y, z;
} vec3f;

static inline vec3f minus(vec3f a, vec3f b)
{
	return (vec3f){a.x - b.x, a.y - b.y, a.z - b.z};
}

static inline float dot(vec3f a, vec3f b)
{
	return a.x * b.x + a.y * b.y + a.z * b.z;
}

static inline vec3f times(vec3f a, float s)
{
	return (vec3f){a.x * s, a.y * s, a.z * s};
}

static inline vec3f cross(vec3f a, vec3f b)
{
	return (vec3f){a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

/* 0 for vectors without a length. */
static inline vec3f unit(vec3f a)
{
	const float n = sqrtf(dot(a, a));
	return n > 0 ? times(a, 1 / n) : (vec3f){0, 0, 0};
}

static inline vec3f straight(const wh_camera *k, const wh_spot *s)
{
	if (k->eye == 0)
		return (vec3f){s->x, s->y, s->depth};
	const wh_vec3 p = wh_camera_straighten(k, (double)s->x, (double)s->y, (double)s->depth);
	return (vec3f){(float)p.x, (float)p.y, (float)p.z};
}

/* Within 1e-4 (Abramowitz & Stegun 4.4.45); the C library's differs from one to the other. */
static inline float arc_cosine(float x)
{
	const float a = within_one(fabsf(x));
	const float r =
	    sqrtf(1 - a) * (1.5707288F + a * (-0.2121144F + a * (0.0742610F - a * 0.0187293F)));
	return x < 0 ? 3.14159265F - r : r;
}

static inline int64_t rounded(float x)
{
	return (int64_t)(x + (x < 0 ? -0.5F : 0.5F));
}

/* Negative parts borrow from the ones above, and give back when the sum is taken apart. */
static inline wh_normal_sum pack(vec3f n, float weight)
{
	const vec3f s = times(n, weight * SUM_SCALE);
	return (uint64_t)rounded(s.x) + ((uint64_t)rounded(s.y) << SUM_BITS) +
	       ((uint64_t)rounded(s.z) << (2 * SUM_BITS));
}

static inline int32_t take_lowest(uint64_t *sum)
{
	const int64_t low = (int64_t)((*sum & ((1U << SUM_BITS) - 1)) ^ (1U << (SUM_BITS - 1))) -
	                    (1 << (SUM_BITS - 1));
	*sum = (*sum - (uint64_t)low) >> SUM_BITS;
	return (int32_t)low;
}

static inline vec3f unpack(wh_normal_sum sum)
{
	const float x = (float)take_lowest(&sum), y = (float)take_lowest(&sum);
	return unit((vec3f){x, y, (float)take_lowest(&sum)});
}

void wh_render_normals(const wh_camera *k, const wh_spot *const corner[3], wh_normal_sum add[3])
{
	const vec3f a = straight(k, corner[0]), b = straight(k, corner[1]);
	const vec3f c = straight(k, corner[2]);
	const vec3f ab = minus(b, a), bc = minus(c, b), ca = minus(a, c);
	const vec3f n = unit(cross(ab, bc));
	const vec3f u = unit(ab), v = unit(bc), w = unit(ca);
	add[0] = pack(n, arc_cosine(-dot(u, w)));
	add[1] = pack(n, arc_cosine(-dot(u, v)));
	add[2] = pack(n, arc_cosine(-dot(v, w)));
}

/* ---- light ---------------------------------------------------------------------------------- */

/*
 * A soft light from above on the left of the viewer, a weaker one from where the viewer is, and
 * some from all around, more of it from above. Directions are towards the light, of length 1.
 */
static const vec3f KEY = {-0.4364F, -0.5819F, -0.6862F};
static const vec3f HALFWAY = {-0.2377F, -0.3169F, -0.9182F}; /* between key and viewer */
static const float KEY_LIGHT = 0.68F, HEAD_LIGHT = 0.18F, SKY_LIGHT = 0.17F, GROUND_LIGHT = 0.06F;
static const float GLOSS = 0.05F;
static const float WRAP = 0.2F; /* of the key light reaches beyond where its rays graze */

/* Light of a white surface, and what its gloss adds. */
static inline float shade(vec3f n, float *gloss)
{
	const float key = at_least((dot(n, KEY) + WRAP) / (1 + WRAP), 0);
	const float head = at_least(-n.z, 0);
	const float sky = 0.5F - 0.5F * n.y;
	float g = at_least(dot(n, HALFWAY), 0);
	g *= g;
	g *= g;
	g *= g;
	*gloss = GLOSS * g * g;
	return KEY_LIGHT * key + HEAD_LIGHT * head + GROUND_LIGHT +
	       (SKY_LIGHT - GROUND_LIGHT) * sky;
}

static inline uint32_t channel(float light)
{
	const float v = sqrtf(within_one(light));
	return (uint32_t)(v * COLOUR_MOST + 0.5F);
}

static inline uint32_t encode(const float rgb[3])
{
	return channel(rgb[0]) << (2 * COLOUR_BITS) | channel(rgb[1]) << COLOUR_BITS |
	       channel(rgb[2]);
}

/* A channel of 0xRRGGBB as light. */
static inline float light_of(uint32_t colour, int shift)
{
	const float v = (float)(colour >> shift & 0xff) / 255;
	return v * v;
}

/* ---- samples -------------------------------------------------------------------------------- */

/* Whole numbers in the order of the floats, upside down. */
static inline uint64_t depth_key(float depth)
{
	uint32_t u;
	depth += 0.0F; /* one zero */
	memcpy(&u, &depth, sizeof u);
	return (uint64_t)(u & 0x80000000U ? u : ~u & 0x7fffffffU) << 32;
}

static inline float depth_of(uint64_t sample)
{
	const uint32_t key = (uint32_t)(sample >> 32);
	const uint32_t u = key & 0x80000000U ? key : ~key & 0x7fffffffU;
	float depth;
	memcpy(&depth, &u, sizeof depth);
	return depth;
}

/* Nothing nearer is there yet. */
static inline bool may_show(wh_sample *s, uint64_t key)
{
	return (key | UINT32_MAX) > atomic_load_explicit(s, memory_order_relaxed);
}

static inline void put(wh_sample *s, uint64_t value)
{
	uint64_t old = atomic_load_explicit(s, memory_order_relaxed);
	while (value > old && !atomic_compare_exchange_weak_explicit(
	                          s, &old, value, memory_order_relaxed, memory_order_relaxed)) {
	}
}

/* ---- faces ---------------------------------------------------------------------------------- */

typedef struct spot {
	int64_t x, y; /* in steps from the upper left corner of the picture */
} spot;

/* A line from a corner to the next: 0 on it, positive inside, in steps squared. */
typedef struct edge {
	int64_t at, dx, dy; /* in the middle of the first sample; for a sample to the right, down */
	float per_pixel;    /* distance from the line: this times `at` */
	float seen;         /* how much of it, 0 .. 1 */
} edge;

typedef struct face {
	const wh_look *look;
	const wh_skin *skin;
	const wh_spot *corner[3];
	const wh_normal_sum *sum[3];
	int64_t x0, x1, y0, y1; /* samples that may be inside, the last ones included */
	edge edge[3];           /* opposite to corners 0, 1, 2 */
	bool bias[3];           /* samples on the edge are the other face's */
	double per_area;
	bool front;
} face;

/* What is known of a face once its first sample has to be coloured. */
typedef struct paint {
	bool ready;
	vec3f normal[3];
	vec3f colour[3];
} paint;

static inline spot place_of(const wh_canvas *v, const wh_spot *s)
{
	return (spot){lrint((double)s->x * STEP) + (int64_t)v->w * (STEP / 2),
	              lrint((double)s->y * STEP) + (int64_t)v->h * (STEP / 2)};
}

static inline int64_t least(int64_t a, int64_t b)
{
	return a < b ? a : b;
}

static inline int64_t most(int64_t a, int64_t b)
{
	return a > b ? a : b;
}

/* The first and the last sample with its middle in lo .. hi. */
static inline void samples_between(int64_t lo, int64_t hi, int64_t *first, int64_t *last)
{
	*first = (lo + STEP / 2 - 1) >> STEP_BITS;
	*last = (hi - STEP / 2) >> STEP_BITS;
}

/* False when no sample of the canvas is in the face's box: so are most. */
static inline bool find_box(const wh_canvas *v, const spot p[3], face *f)
{
	samples_between(least(p[0].x, least(p[1].x, p[2].x)), most(p[0].x, most(p[1].x, p[2].x)),
	                &f->x0, &f->x1);
	samples_between(least(p[0].y, least(p[1].y, p[2].y)), most(p[0].y, most(p[1].y, p[2].y)),
	                &f->y0, &f->y1);
	f->x0 = most(f->x0, 0);
	f->x1 = least(f->x1, (int64_t)v->w - 1);
	f->y0 = most(f->y0, v->y0);
	f->y1 = least(f->y1, (int64_t)v->y1 - 1);
	return f->x0 <= f->x1 && f->y0 <= f->y1;
}

/* The edge from p to q of a face whose area, seen with y down, is positive that way round. */
static inline void set_edge(face *f, int i, spot p, spot q)
{
	const int64_t dx = q.x - p.x, dy = q.y - p.y;
	const int64_t sx = f->x0 * STEP + STEP / 2, sy = f->y0 * STEP + STEP / 2;
	f->bias[i] = !(dy > 0 || (dy == 0 && dx < 0)); /* one of p -> q and q -> p */
	f->edge[i].at = dx * (sy - p.y) - dy * (sx - p.x);
	f->edge[i].dx = -dy * STEP;
	f->edge[i].dy = dx * STEP;
}

static float fade(double x, const float between[2])
{
	const float t = within_one(((float)x - between[0]) / (between[1] - between[0]));
	return t * t * (3 - 2 * t);
}

/* How far inside the edges a sample is, in pixels, tells whether it is on one of them. Both faces
 * of an edge find the same length; only where they are thin, as at the rim, do they differ. */
static void set_edge_widths(face *f, const spot p[3], double area)
{
	const double pixel = (double)STEP * f->look->samples;
	double longest = 0;
	for (int i = 0; i < 3; i++) {
		const spot *a = &p[(i + 1) % 3], *b = &p[(i + 2) % 3];
		const double x = (double)(b->x - a->x), y = (double)(b->y - a->y);
		const double length = sqrt(x * x + y * y);
		f->edge[i].per_pixel = (float)(1 / (length * pixel));
		f->edge[i].seen = fade(length / pixel, LENGTH_FADE);
		longest = fmax(longest, length);
	}
	for (int i = 0; i < 3; i++)
		f->edge[i].seen *= fade(area / (longest * pixel), HEIGHT_FADE);
}

/* False when it covers no sample of the canvas for sure. */
static inline bool set_up(const wh_canvas *v, const wh_look *look, const wh_spot *const corner[3],
                          face *f)
{
	if (isnan(corner[0]->depth + corner[1]->depth + corner[2]->depth))
		return false;
	spot p[3] = {place_of(v, corner[0]), place_of(v, corner[1]), place_of(v, corner[2])};
	if (!find_box(v, p, f))
		return false;
	const int64_t area =
	    (p[1].x - p[0].x) * (p[2].y - p[0].y) - (p[1].y - p[0].y) * (p[2].x - p[0].x);
	if (area == 0)
		return false;
	f->front = area < 0; /* seen counter-clockwise, with y down */
	const int second = f->front ? 2 : 1, third = f->front ? 1 : 2;
	f->look = look;
	set_edge(f, 0, p[second], p[third]);
	set_edge(f, second, p[third], p[0]);
	set_edge(f, third, p[0], p[second]);
	f->per_area = 1 / fabs((double)area);
	if (look->wireframe)
		set_edge_widths(f, p, fabs((double)area));
	for (int i = 0; i < 3; i++)
		f->corner[i] = corner[i];
	return true;
}

/* The normals are those of the side that is seen; sharp corners have the face's. */
static void get_ready(const face *f, paint *p)
{
	const vec3f a = straight(f->look->camera, f->corner[0]);
	const vec3f b = straight(f->look->camera, f->corner[1]);
	const vec3f c = straight(f->look->camera, f->corner[2]);
	const vec3f own = unit(cross(minus(b, a), minus(c, b)));
	const float side = f->front ? 1 : -1;
	for (int i = 0; i < 3; i++) {
		const vec3f n = f->look->smooth ? unpack(*f->sum[i]) : own;
		p->normal[i] = times(dot(n, own) < CREASE ? own : n, side);
		const uint32_t rgb = f->corner[i]->colour;
		p->colour[i] = (vec3f){light_of(rgb, 16), light_of(rgb, 8), light_of(rgb, 0)};
	}
	p->ready = true;
}

static inline vec3f mixed(const vec3f v[3], const float w[3])
{
	return (vec3f){v[0].x * w[0] + v[1].x * w[1] + v[2].x * w[2],
	               v[0].y * w[0] + v[1].y * w[1] + v[2].y * w[2],
	               v[0].z * w[0] + v[1].z * w[1] + v[2].z * w[2]};
}

/* How much of an edge is seen at a sample: 0 beside them. */
static float edge_at(const face *f, const int64_t at[3])
{
	float seen = 0;
	for (int i = 0; i < 3; i++)
		if ((float)at[i] * f->edge[i].per_pixel < EDGE_WIDTH)
			seen = at_least(seen, f->edge[i].seen);
	return seen;
}

/* ---- textures ------------------------------------------------------------------------------- */

/* Pixel (x, y) of a texture, as light. */
static inline vec3f texel(const wh_skin *s, int64_t x, int64_t y)
{
	const int64_t w = s->w, h = s->h;
	x = (x % w + w) % w;
	y = (y % h + h) % h;
	const uint8_t *p = s->rgba + 4 * (size_t)(y * w + x);
	const vec3f c = {(float)p[0] / 255, (float)p[1] / 255, (float)p[2] / 255};
	return (vec3f){c.x * c.x, c.y * c.y, c.z * c.z};
}

static inline vec3f between(vec3f a, vec3f b, float t)
{
	return (vec3f){a.x + t * (b.x - a.x), a.y + t * (b.y - a.y), a.z + t * (b.z - a.z)};
}

/* Weights of the corners on the face itself: with perspective, those on the picture favour what is
 * far away. */
static void straighten_weights(const face *f, const float w[3], double out[3])
{
	const wh_camera *k = f->look->camera;
	double sum = 0;
	for (int i = 0; i < 3; i++) {
		const double near =
		    k->eye > 0 ? 1 - (double)f->corner[i]->depth / (k->samples * k->eye) : 1;
		out[i] = (double)w[i] * near;
		sum += out[i];
	}
	for (int i = 0; i < 3; i++)
		out[i] /= sum;
}

/* The light of the texture at a sample, between the four pixels around it. */
static vec3f texture_at(const face *f, const float w[3])
{
	const wh_skin *s = f->skin;
	double t[3], u = 0, v = 0;
	straighten_weights(f, w, t);
	for (int i = 0; i < 3; i++) {
		u += t[i] * (double)s->uv[i][0];
		v += t[i] * (double)s->uv[i][1];
	}
	const double x = (u - floor(u)) * s->w - 0.5, y = (1 - (v - floor(v))) * s->h - 0.5;
	if (!(fabs(x) + fabs(y) < 1e9))
		return texel(s, 0, 0);
	const int64_t i = (int64_t)floor(x), j = (int64_t)floor(y);
	const float fx = (float)(x - (double)i), fy = (float)(y - (double)j);
	return between(between(texel(s, i, j), texel(s, i + 1, j), fx),
	               between(texel(s, i, j + 1), texel(s, i + 1, j + 1), fx), fy);
}

static uint32_t colour_of(const face *f, paint *p, const int64_t at[3], const float w[3])
{
	if (!p->ready)
		get_ready(f, p);
	float gloss;
	const float light = shade(unit(mixed(p->normal, w)), &gloss);
	float rgb[3] = {f->look->base[0], f->look->base[1], f->look->base[2]};
	if (f->look->colours || f->skin) {
		const vec3f own = f->skin ? texture_at(f, w) : mixed(p->colour, w);
		rgb[0] = own.x;
		rgb[1] = own.y;
		rgb[2] = own.z;
	}
	const float edges = f->look->wireframe ? edge_at(f, at) : 0;
	for (int i = 0; i < 3; i++) {
		rgb[i] = rgb[i] * light + gloss;
		rgb[i] += (EDGE_LIGHT - rgb[i]) * edges;
	}
	return encode(rgb);
}

/* Samples i0 .. i1 of the row at whose first one the edges have these values are inside. */
static inline void find_span(const face *f, const int64_t row[3], int64_t *i0, int64_t *i1)
{
	*i0 = 0;
	*i1 = f->x1 - f->x0;
	for (int i = 0; i < 3; i++) {
		const int64_t at = row[i] - f->bias[i], dx = f->edge[i].dx;
		if (at >= 0 && at + dx * *i1 >= 0)
			continue;
		if (dx > 0)
			*i0 = most(*i0, (-at + dx - 1) / dx);
		else
			*i1 = dx < 0 && at >= 0 ? least(*i1, at / -dx) : -1;
	}
}

static inline void draw_sample(wh_sample *s, const face *f, paint *p, const int64_t at[3])
{
	const double second = (double)at[1] * f->per_area, third = (double)at[2] * f->per_area;
	const double z = (double)f->corner[0]->depth;
	const double depth = z + second * ((double)f->corner[1]->depth - z) +
	                     third * ((double)f->corner[2]->depth - z);
	const uint64_t key = depth_key((float)depth);
	if (!may_show(s, key))
		return;
	const float w[3] = {(float)(1 - second - third), (float)second, (float)third};
	put(s, key | colour_of(f, p, at, w));
}

void wh_canvas_expect(const wh_canvas *v, const wh_spot *corner)
{
	const float x = corner->x + (float)v->w * 0.5F, y = corner->y + (float)v->h * 0.5F;
	if (x >= 0 && x < (float)v->w && y >= (float)v->y0 && y < (float)v->y1)
		__builtin_prefetch(
		    v->sample + wh_canvas_row(v, (uint32_t)y) + wh_canvas_column((uint32_t)x), 1);
}

void wh_canvas_face(const wh_canvas *v, const wh_look *look, const wh_spot *const corner[3],
                    const wh_normal_sum *const normal[3], const wh_skin *skin)
{
	face f;
	if (!set_up(v, look, corner, &f))
		return;
	paint p = {0};
	f.skin = skin;
	for (int i = 0; i < 3; i++)
		f.sum[i] = look->smooth ? normal[i] : NULL;
	int64_t row[3] = {f.edge[0].at, f.edge[1].at, f.edge[2].at};
	for (int64_t y = f.y0; y <= f.y1; y++) {
		int64_t i0, i1;
		find_span(&f, row, &i0, &i1);
		wh_sample *s = v->sample + wh_canvas_row(v, (uint32_t)y);
		for (int64_t i = i0; i <= i1; i++) {
			const int64_t at[3] = {row[0] + i * f.edge[0].dx, row[1] + i * f.edge[1].dx,
			                       row[2] + i * f.edge[2].dx};
			draw_sample(s + wh_canvas_column((uint32_t)(f.x0 + i)), &f, &p, at);
		}
		for (int i = 0; i < 3; i++)
			row[i] += f.edge[i].dy;
	}
}

/* ---- points --------------------------------------------------------------------------------- */

/* The colour where a small ball has this normal. */
static uint32_t colour_of_point(const wh_look *look, const wh_spot *point, vec3f n)
{
	float gloss, rgb[3];
	const float light = shade(n, &gloss);
	for (int i = 0; i < 3; i++) {
		const float own =
		    look->colours ? light_of(point->colour, 16 - 8 * i) : look->base[i];
		rgb[i] = own * light;
	}
	return encode(rgb);
}

void wh_canvas_point(const wh_canvas *v, const wh_look *look, const wh_spot *point)
{
	if (isnan(point->depth))
		return;
	const double x = (double)point->x + v->w / 2.0 - 0.5, r = look->radius;
	const double y = (double)point->y + v->h / 2.0 - 0.5;
	const int64_t x0 = most((int64_t)ceil(x - r), 0), y0 = most((int64_t)ceil(y - r), v->y0);
	const int64_t x1 = least((int64_t)floor(x + r), (int64_t)v->w - 1);
	const int64_t y1 = least((int64_t)floor(y + r), (int64_t)v->y1 - 1);
	for (int64_t j = y0; j <= y1; j++)
		for (int64_t i = x0; i <= x1; i++) {
			const double dx = ((double)i - x) / r, dy = ((double)j - y) / r;
			const double in = 1 - dx * dx - dy * dy;
			if (in < 0)
				continue;
			const vec3f n = {(float)dx, (float)dy, (float)-sqrt(in)};
			const uint64_t key = depth_key(point->depth + (float)r * n.z);
			wh_sample *s = v->sample + wh_canvas_row(v, (uint32_t)j) +
			               wh_canvas_column((uint32_t)i);
			if (may_show(s, key))
				put(s, key | colour_of_point(look, point, n));
		}
}

/* ---- pixels --------------------------------------------------------------------------------- */

/* Samples of one pixel, added up. */
typedef struct pixel_sum {
	uint64_t nearest;
	int place, covered;
	uint64_t light[3]; /* squares of channels */
} pixel_sum;

static inline void add_sample(pixel_sum *p, uint64_t sample, int place)
{
	if (sample == 0)
		return;
	if (sample > p->nearest) {
		p->nearest = sample;
		p->place = place;
	}
	p->covered++;
	for (int i = 0; i < 3; i++) {
		const uint64_t v = sample >> (COLOUR_BITS * (2 - i)) & COLOUR_MOST;
		p->light[i] += v * v;
	}
}

static wh_pixel pixel_of(const pixel_sum *p)
{
	wh_pixel out = {.covered = (uint8_t)p->covered, .place = (uint8_t)p->place};
	if (p->covered == 0)
		return out;
	out.depth = depth_of(p->nearest);
	const uint64_t full = (uint64_t)COLOUR_MOST * COLOUR_MOST * (uint64_t)p->covered;
	for (int i = 0; i < 3; i++)
		out.light[i] = (uint16_t)((p->light[i] * 65535 + full / 2) / full);
	return out;
}

void wh_render_row(const wh_canvas *v, int samples, uint32_t row, wh_pixel *out)
{
	const uint32_t n = (uint32_t)samples;
	for (uint32_t x = 0; x < v->w / n; x++) {
		pixel_sum p = {0};
		for (uint32_t k = 0; k < n * n; k++) {
			wh_sample *s = v->sample + wh_canvas_row(v, row * n + k / n) +
			               wh_canvas_column(x * n + k % n);
			const uint64_t sample = atomic_load_explicit(s, memory_order_relaxed);
			add_sample(&p, sample, (int)k);
			if (sample)
				atomic_store_explicit(s, 0, memory_order_relaxed);
		}
		out[x] = pixel_of(&p);
	}
}

wh_pixel_point wh_render_point(uint32_t w, uint32_t h, int samples, uint32_t x, uint32_t y,
                               const wh_pixel *p)
{
	const double n = samples;
	const int across = p->place % samples, down = p->place / samples;
	return (wh_pixel_point){(x - w / 2.0) * n + across + 0.5, (y - h / 2.0) * n + down + 0.5,
	                        (double)p->depth};
}
