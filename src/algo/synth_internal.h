/* synth_internal: what the files of synth share. Nobody else includes this. */
#ifndef WH_ALGO_SYNTH_INTERNAL_H
#define WH_ALGO_SYNTH_INTERNAL_H

#include "algo/synth.h"
#include "base/permute.h"

/* ---- relief: a sum of octaves of gradient noise (synth_relief.c) ---- */

enum { SYNTH_OCTAVES = 10 };

typedef struct synth_octave {
	double frequency; /* lattice cells per unit of length */
	double weight;
	double shift[3]; /* makes lattice coordinates positive, and octaves unlike each other */
	uint64_t seed;
} synth_octave;

typedef struct synth_relief {
	int n;
	double height; /* of the sum */
	synth_octave octave[SYNTH_OCTAVES];
} synth_relief;

/* The last lattice cell of every octave: neighbours in a row mostly share it. */
typedef struct synth_cell {
	uint32_t x, y, z;
	wh_vec3 slope[8];
} synth_cell;

/* What one worker keeps from one vertex to the next, for speed alone. Start with
 * synth_cursor_init. */
typedef struct synth_cursor {
	synth_cell cell[SYNTH_OCTAVES];
	size_t vertex_span, cell_span; /* where the last id was found in the ragged grids */
} synth_cursor;

void synth_cursor_init(synth_cursor *k);

/* Octaves from wavelength `longest` down to a few spacings. */
void synth_relief_init(synth_relief *r, uint64_t seed, double height, double longest,
                       double spacing);

/* Height at a point; *rough, in (0, 1], is how much fine detail there is. */
double synth_relief_at(const synth_relief *r, wh_vec3 p, synth_cursor *k, double *rough);

/* Smooth value noise on a line, in (-1, 1); x >= 0. */
double synth_noise1(uint64_t seed, double x);

/* Clamped to [0, 1], then 3t^2 - 2t^3. */
double synth_smoothstep(double t);

/* Sine and cosine of an angle in turns, |turns| <= 4: ours, as the C library's are not the same
 * on all machines. */
void synth_sincos(double turns, double *sine, double *cosine);

/* ---- ragged: rows of spans of kept grid items (synth_terrain.c) ---- */

typedef struct synth_span {
	uint64_t first;       /* number of its first item */
	uint32_t row, lo, hi; /* columns lo .. hi-1 of this row */
} synth_span;

typedef struct synth_ragged {
	synth_span *span; /* in order of row, then column */
	size_t nspans, cap;
	uint32_t *row_start; /* of every row, and one more: first span */
	uint64_t total;
} synth_ragged;

/* ---- shapes ---- */

/* A point of the surface before relief and noise. */
typedef struct synth_base {
	wh_vec3 point;
	wh_vec3 normal; /* the direction of relief */
	double mask;    /* how much of the relief there is: 0 on flat parts */
} synth_base;

/* A grid cell: corners counter-clockwise from outside. skew > 0: the diagonal 0-2 is the shorter
 * one; < 0: 1-3; near 0: either will do. */
typedef struct synth_quad {
	uint64_t v[4];
	double skew;
} synth_quad;

typedef struct synth_shape {
	const char *name;
	double size;    /* what the relief is a share of */
	double longest; /* wavelength of relief */
	/* Chooses the grid: sets nv, ncells, spacing, dim. */
	wh_code (*plan)(wh_ctx *c, wh_synth *s);
	/* The surface parameter of a vertex: whatever `base` understands. */
	wh_vec3 (*param)(const wh_synth *s, uint64_t vertex, synth_cursor *k);
	synth_base (*base)(const wh_synth *s, wh_vec3 param);
	/* Two small steps of the parameter, the second to the left of the first from outside. */
	void (*steps)(const wh_synth *s, wh_vec3 param, wh_vec3 step[2]);
	void (*quad)(const wh_synth *s, uint64_t cell, synth_cursor *k, synth_quad *q);
} synth_shape;

extern const synth_shape synth_sphere, synth_torus, synth_terrain;

struct wh_synth {
	wh_synth_params p;
	const synth_shape *shape;
	uint64_t nv, ncells;
	uint64_t dim[3]; /* grid cells along each axis */
	double spacing;  /* mean distance of neighbouring samples */
	double flat_at;  /* shape's own: where flat parts begin */
	uint64_t nholes;
	uint64_t seed_of_noise, seed_of_cells, seed_of_color, seed_of_holes;
	synth_relief relief;
	wh_permute vertex_order, face_order;
	synth_ragged vertices, cells; /* terrain */
};

/* ---- elements (synth.c) ---- */

typedef struct synth_vertex {
	int64_t fixed[3]; /* position without offset, in units of 2^-10 */
	double normal[3]; /* only when asked for */
	uint8_t color[3]; /* only when asked for */
} synth_vertex;

/* Vertex and face number `slot` of the file. */
void synth_vertex_at(const wh_synth *s, uint64_t slot, synth_cursor *k, synth_vertex *v);
void synth_face_at(const wh_synth *s, uint64_t slot, synth_cursor *k, uint64_t ids[3]);

#endif
