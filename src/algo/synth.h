/*
 * synth: seeded surfaces that look like scans, of any size, made in little memory.
 *
 * Every vertex and every face is a function of the parameters and its number alone, so that
 * they can be had in any order, by any number of threads, and none needs to be remembered.
 * The same parameters give the same bytes from every compiler and on every machine.
 *
 * Shapes (units: think of millimetres; all coordinates stay below 2^14 in size)
 *   sphere   closed, genus 0, radius 10000 and relief on it; the surface of a box grid, so
 *            that there is no seam and no pole; the six box corners have valence 3 to 6
 *   torus    closed, genus 1, radii 9000 and 3600
 *   terrain  a height field of 30000 x 30000 with a wavy outer border and holes in it
 *
 * Relief is a sum of octaves of gradient noise down to a few sample spacings; a low octave says
 * where the fine ones are strong, so that there are detailed and smooth regions. Measurement
 * noise goes mostly along the normal. Positions are multiples of 2^-10, which a float holds
 * exactly; adding the offset in double is exact too.
 */
#ifndef WH_ALGO_SYNTH_H
#define WH_ALGO_SYNTH_H

#include "exec/exec.h"
#include "mesh/mesh.h"

typedef enum wh_synth_kind { WH_SYNTH_SPHERE, WH_SYNTH_TORUS, WH_SYNTH_TERRAIN } wh_synth_kind;

enum { WH_SYNTH_MIN_FACES = 12, WH_SYNTH_AUTO_HOLES = -1, WH_SYNTH_MAX_HOLES = 10000 };

typedef struct wh_synth_params {
	wh_synth_kind kind;
	uint64_t faces; /* wanted; the grid's nearest count is made (within 1 % from 10 k on) */
	uint64_t seed;
	bool shuffled;  /* vertices and faces in a random order, corners rotated; else row by row */
	bool is_double; /* positions as double; always so with an offset */
	double offset[3]; /* added to all positions; rounded to multiples of 2^-10; below 2^42 */
	double noise;     /* deviation of the measurement noise / sample spacing, 0 to 1 */
	double relief;    /* height of the relief / (radius, tube radius, half side), 0 to 0.2 */
	double
	    flat; /* about this share of the samples lies in planes, noise apart, 0 to 0.8: on the
	           * sphere six caps, on the torus top and bottom, on the terrain a plateau */
	int64_t holes; /* terrain only; WH_SYNTH_AUTO_HOLES: up to five, as many as fit */
	bool colors;   /* uchar red, green, blue at every vertex */
	bool normals;  /* float nx, ny, nz of the surface without measurement noise */
	bool ascii;
} wh_synth_params;

/* A million-face sphere row by row, with modest noise and relief. */
wh_synth_params wh_synth_defaults(void);

typedef struct wh_synth wh_synth;

/* Chooses the grid. WH_E_USAGE names the parameter that makes no sense. Memory: a few bytes per
 * grid row of a terrain, none otherwise. */
wh_code wh_synth_open(wh_ctx *c, wh_synth **s, const wh_synth_params *p);
void wh_synth_close(wh_ctx *c, wh_synth **s);

uint64_t wh_synth_vertices(const wh_synth *s);
uint64_t wh_synth_faces(const wh_synth *s);
uint64_t wh_synth_holes(const wh_synth *s);
/* The offset in use, after rounding. */
void wh_synth_offset(const wh_synth *s, double offset[3]);

struct wh_outfile;

/* Streams the whole PLY file: buffers of some hundred KiB per worker. */
wh_code wh_synth_write(wh_ctx *c, const wh_exec *ex, const wh_synth *s, struct wh_outfile *o);

/* The same surface as a mesh in memory. WH_E_PLAN when it has 2^32 - 1 vertices or faces or
 * more. */
wh_code wh_synth_mesh(wh_ctx *c, const wh_synth *s, wh_mesh *m);

#endif
