/*
 * check: every invariant of an indexed triangle mesh, counted.
 *
 * Nothing is assumed about the mesh but the sizes of its arrays: any soup of triangles can be
 * checked. Faces that are no triangles (a repeated corner, an index out of range) are counted and
 * then left out of everything else: they have no edges, no area, and reference no vertex.
 */
#ifndef WH_MESH_CHECK_H
#define WH_MESH_CHECK_H

#include "mesh/mesh.h"

enum {
	WH_COMPONENT_SIZES = 48, /* powers of two */
	WH_RADIUS_RATIOS = 16    /* parts that the range of radius ratios is cut into */
};

typedef struct wh_check {
	uint64_t vertices;
	uint64_t faces;
	uint64_t referenced_vertices; /* corners of at least one face */
	uint64_t unreferenced_vertices;
	uint64_t nonfinite_vertices; /* a coordinate is infinite or not a number */
	uint64_t duplicate_vertices; /* at the position of a vertex with a smaller id */
	uint64_t nonfinite_faces;    /* a corner of theirs is; they are left out of everything else.
	                              * Found when files are read: 0 for a mesh in memory */
	uint64_t welded_vertices, collapsed_faces; /* that went as the file was read, when asked */

	uint64_t invalid_faces;    /* an index is out of range */
	uint64_t degenerate_faces; /* a vertex is two of the corners */
	uint64_t zero_area_faces;  /* three different vertices on a line, to the last bit */
	uint64_t duplicate_faces;  /* the same three vertices, in any order, as an earlier face */

	uint64_t edges;                /* pairs of vertices that are a side of some face */
	uint64_t boundary_edges;       /* of one face */
	uint64_t nonmanifold_edges;    /* of three faces or more */
	uint64_t misoriented_edges;    /* of two faces that traverse it in the same direction */
	uint64_t folded_edges;         /* of two faces whose normals, both seen from one side of the
	                                * surface, are more than 170 degrees apart: they lie on each
	                                * other */
	uint64_t nonmanifold_vertices; /* the faces around it, joined through its edges, are more
	                                * than one fan; the ends of a non-manifold edge are not
	                                * counted for that alone */

	uint64_t components;                          /* of faces joined through shared vertices */
	uint64_t component_sizes[WH_COMPONENT_SIZES]; /* [k]: components of 2^k faces or more, and
	                                               * fewer than 2^(k+1) */
	uint64_t largest_component;                   /* faces */
	uint64_t edge_components; /* of faces joined through shared edges: never fewer */
	uint64_t boundary_loops;  /* closed walks along the boundary, from each edge to the one at
	                           * the other end of the same fan */
	int64_t euler;            /* referenced vertices - edges + faces */
	int64_t genus;            /* handles of all components; -1 unless manifold and oriented */

	uint64_t radius_ratios[WH_RADIUS_RATIOS]; /* faces by their radius ratio, as told next;
	                                           * [k]: k/16 or more, less than (k+1)/16, and the
	                                           * last one also of 1 */
	double radius_ratio_mean; /* of faces with finite corners: twice the radius of the inscribed
	                           * circle over the circumscribed one's; 1: equilateral,
	                           * 0: no area; 0 if there are none */
	double radius_ratio_p5;   /* one face in 20 has no more; up to 0.001 below the exact
	                           * percentile */

	double area;    /* of all faces whose corners are finite; their order does not matter */
	wh_vec3 lo, hi; /* corners of the box around the finite referenced vertices; 0 if none */
} wh_check;

/*
 * Fills *r. Fails only when memory is refused (about 40 bytes a face beside the mesh) or when
 * the caller asks to stop; *r is undefined then. Serial.
 */
wh_code wh_check_mesh(wh_ctx *c, const wh_mesh *m, wh_check *r);

/* True for an oriented manifold, with or without boundary, in which no face is degenerate,
 * invalid or a duplicate, and no vertex is not finite. Unreferenced or coincident vertices and zero
 * areas are no fault here. */
bool wh_check_clean(const wh_check *r);

#endif
