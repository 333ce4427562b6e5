/*
 * wedges: what faces and their corners carry, beside what vertices do (io/attributes.h).
 *
 * A mesh is joined by its positions alone; what belongs to a corner (texture coordinates) or to a
 * face (material, texture number, colour, flags) may differ from one face to the next. All of it
 * lies in one record for each face: that of the first corner, of the second, of the third, and that
 * of the face. The corners of a vertex with equal records are one wedge of it (Hoppe 1999).
 *
 *     carried         from                                            new values
 *     corners' u, v   PLY: a list of reals called texcoord, two for   averaged inside a chart; on
 *                     each corner; OBJ: vt; PLY and OFF: s and t,     its border always old ones
 *                     or the like, of vertices, with normals
 *     corners'        OBJ: vn, where those of a vertex differ         the same: hard edges are
 *     nx, ny, nz      (pipeline/read_obj.h)                           borders
 *     faces' labels   whole numbers but those below; OBJ: usemtl, g   a face keeps its own; where
 *                                                                     they change is a border
 *     faces' others   reals, colours, flags, quality ...              a face keeps its own
 *                     (attributes.h)
 *
 * A corner without texture coordinates, or without a normal, has NaN in their place.
 *
 * Files whose vertices have texture coordinates have each vertex on a border of charts two or more
 * times. On the way it is one, with corners that differ (pipeline/atlas.h), and it is doubled again
 * when it is written.
 */
#ifndef WH_IO_WEDGES_H
#define WH_IO_WEDGES_H

#include "io/attributes.h"
#include "io/names.h"

/* What the list of normals of an OBJ file's corners is called. */
#define WH_WEDGES_NORMALS "normals"

typedef struct wh_wedges {
	wh_attributes corner; /* u and v, or nx, ny and nz, or both in this order; or nothing */
	wh_attributes face;
	uint32_t bytes;   /* of a face's record; 0: nothing is carried */
	int list;         /* the property of faces that holds u and v; -1: they are not carried */
	int normals;      /* the same of nx, ny and nz */
	bool of_vertices; /* the file has the corners' attributes at its vertices */
	uint32_t labels;  /* of the face's attributes, that borders are made by */
	/* what the labels called texnumber, material and group stand for, and the files that
	 * describe the materials, owned by others; NULL: nothing of that kind */
	const wh_names *textures, *materials, *groups, *libraries;
} wh_wedges;

/* Chooses among the properties of faces and corners of p, which must stay open as long as *w is in
 * use; `wanted` as for wh_attributes_choose, which is the one to complain about it. `vertices`: the
 * attributes of vertices, whose texture coordinates are carried at corners where there are no
 * others. */
wh_code wh_wedges_choose(wh_ctx *c, const wh_ply *p, wh_wanted wanted,
                         const wh_attributes *vertices, wh_wedges *w);
void wh_wedges_free(wh_ctx *c, wh_wedges *w);

/* A property of faces is carried. `w` may be NULL. */
bool wh_wedges_has(const wh_wedges *w, int prop);

/* True when the file has some of it at faces and their corners themselves. */
static inline bool wh_wedges_of_file(const wh_wedges *w)
{
	return w->face.n > 0 || (w->corner.n > 0 && !w->of_vertices);
}

/* Corner k of a face's record, and the part of the face. */
static inline uint8_t *wh_wedges_corner(const wh_wedges *w, uint8_t *record, uint32_t k)
{
	return record + (size_t)k * w->corner.bytes;
}

static inline const uint8_t *wh_wedges_face(const wh_wedges *w, const uint8_t *record)
{
	return record + 3 * (size_t)w->corner.bytes;
}

/* A corner of which nothing is known. */
void wh_wedges_no_corner(const wh_wedges *w, uint8_t *corner);

/* True when a corner has texture coordinates, which go to uv then. */
bool wh_wedges_uv(const wh_wedges *w, const uint8_t *corner, double uv[2]);

/* The same of its normal. */
bool wh_wedges_normal(const wh_wedges *w, const uint8_t *corner, double n[3]);

/* What the values of a property of faces are the names of, 1 more than their places: materials or
 * groups; NULL: of nothing. */
const wh_names *wh_wedges_names(const wh_wedges *w, const char *property);

/* True when two faces have the same labels. */
bool wh_wedges_same_face(const wh_wedges *w, const uint8_t *a, const uint8_t *b);

#endif
