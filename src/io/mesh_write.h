/*
 * mesh_write: a mesh to an output in any of the formats, streamed.
 *
 * First wh_mesh_begin; then all vertices and all triangles, or, where wh_mesh_wants_facets, facets
 * alone; then wh_mesh_end. The bytes depend on the mesh and the style alone. PLY, OFF, OBJ and text
 * hold doubles where the style says so; STL and GLB have floats only.
 *
 * Normals of vertices have the numbers of these in OBJ; those of corners numbers of their own.
 *
 * Colours: OBJ has three numbers from 0 to 1 behind a position, OFF four bytes in decimal, GLB four
 * numbers of 16 bits that are proportional to light. Those of a PLY file, and all that are bytes,
 * are taken for sRGB, as photographs and screens have it.
 */
#ifndef WH_IO_MESH_WRITE_H
#define WH_IO_MESH_WRITE_H

#include "io/glb_write.h"
#include "io/outfile.h"
#include "io/ply.h"
#include "io/wedges.h"

/* Bounds of the vertices. Zero-initialised, it holds no vertex. */
typedef struct wh_mesh_box {
	double lo[3], hi[3];
	bool any;
} wh_mesh_box;

void wh_mesh_box_add(wh_mesh_box *b, const double p[3]);
void wh_mesh_box_join(wh_mesh_box *b, const wh_mesh_box *other);

/* What a format has room for beside positions and triangles: WH_HOLDS_... of io/attributes.h. The
 * attributes of a style for it have nothing else. */
uint32_t wh_mesh_holds(wh_format format);
/* Bytes that a mesh of these counts takes at least. */
uint64_t wh_mesh_least_bytes(wh_ply_style style, uint64_t nv, uint64_t nf);
/* True when the header holds the bounds, which have to be found first. */
bool wh_mesh_wants_box(wh_ply_style style);
/* True when triangles are written with their positions, and vertices not at all. */
bool wh_mesh_wants_facets(wh_ply_style style);

/* Texture coordinates, or a normal, that were written for a vertex. */
enum { WH_MESH_WEDGES = 4, WH_MESH_RECENT = WH_MESH_WEDGES * 16384 };
typedef struct wh_mesh_wedge {
	uint32_t vertex;
	double value[3];
	uint64_t number; /* from 1; 0: an empty place */
} wh_mesh_wedge;

/* What corners of OBJ refer to. */
typedef struct wh_mesh_listed {
	const char *word;      /* that its lines begin with, ... */
	uint32_t width;        /* ... the numbers in them, ... */
	bool wide;             /* ... and whether those are doubles */
	uint64_t n;            /* written */
	wh_mesh_wedge *recent; /* WH_MESH_RECENT of them; NULL: corners have none */
} wh_mesh_listed;

/* A mesh on its way out. */
typedef struct wh_mesh_out {
	wh_outfile *out;
	wh_ply_style style;
	wh_glb glb;
	/* OBJ: */
	wh_mesh_listed texcoords, normals;
	uint64_t label[2]; /* of the last face: material and group */
} wh_mesh_out;

/* The header. `box` may be NULL where nobody wants it. WH_E_USAGE when the format cannot hold so
 * many vertices or faces. */
wh_code wh_mesh_begin(wh_ctx *c, wh_mesh_out *m, wh_outfile *out, wh_ply_style style, uint64_t nv,
                      uint64_t nf, const wh_mesh_box *box);
/* n vertices (3n doubles), with n records of the style's attributes, if it has any. */
wh_code wh_mesh_vertices(wh_ctx *c, const wh_mesh_out *m, const double *xyz, const uint8_t *records,
                         size_t n);
/* n triangles (3n indices), with n records of what they carry where the style has wedges. */
wh_code wh_mesh_triangles(wh_ctx *c, wh_mesh_out *m, const uint32_t *ids, const uint8_t *records,
                          size_t n);
/* n triangles of the vertices at xyz, whose coordinates are multiplied by `scale`. */
wh_code wh_mesh_facets(wh_ctx *c, const wh_mesh_out *m, const double *xyz, double scale,
                       const uint32_t *ids, size_t n);
/* What is left to be written. */
wh_code wh_mesh_end(wh_ctx *c, const wh_mesh_out *m);
/* Frees what wh_mesh_begin took, after a failure too. */
void wh_mesh_free_out(wh_ctx *c, wh_mesh_out *m);

#endif
