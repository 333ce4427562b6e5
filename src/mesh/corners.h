/*
 * corners: for each vertex of a mesh a list of its corners, kept up while vertices are split.
 *
 * Corner c is corner c % 3 of face c / 3. Lists are singly linked, the latest corner first: what
 * order they have follows from the order in which corners enter them.
 */
#ifndef WH_MESH_CORNERS_H
#define WH_MESH_CORNERS_H

#include "mesh/mesh.h"

typedef struct wh_corners {
	uint32_t *tri;  /* the vertex of each corner */
	uint32_t *next; /* the next corner of the same vertex; WH_NONE: none */
	uint32_t *head; /* the first corner of each vertex */
} wh_corners;

/* The corners of the same face behind and before it. */
static inline uint32_t wh_corner_after(uint32_t c)
{
	return c % 3 == 2 ? c - 2 : c + 1;
}

static inline uint32_t wh_corner_before(uint32_t c)
{
	return c % 3 == 0 ? c + 2 : c - 1;
}

/* Puts a corner in front of its vertex' list. */
static inline void wh_corners_enter(const wh_corners *t, uint32_t c)
{
	t->next[c] = t->head[t->tri[c]];
	t->head[t->tri[c]] = c;
}

/* Lists of nf faces, of vertices below nv. */
static inline void wh_corners_fill(const wh_corners *t, uint32_t nv, uint32_t nf)
{
	for (uint32_t v = 0; v < nv; v++)
		t->head[v] = WH_NONE;
	for (uint32_t c = 0; c < 3 * nf; c++)
		wh_corners_enter(t, c);
}

/* These n corners of v, in the order of its list, become u's, which has none. */
void wh_corners_move(const wh_corners *t, uint32_t v, uint32_t u, const uint32_t *corner,
                     uint32_t n);

/* Makes face f of these corners. */
static inline void wh_corners_face(const wh_corners *t, uint32_t f, uint32_t a, uint32_t b,
                                   uint32_t d)
{
	const uint32_t corner[3] = {a, b, d};
	for (uint32_t k = 0; k < 3; k++) {
		t->tri[3 * f + k] = corner[k];
		wh_corners_enter(t, 3 * f + k);
	}
}

enum { WH_CORNERS_FAN = 255 }; /* corners that are looked at together, at most */

/* Where the faces of some corners of one vertex lead from and to, as steps from the neighbour
 * behind each corner to the one before it. */
typedef struct wh_path {
	uint32_t from,
	    to; /* the neighbour where no step ends, where none begins; WH_NONE: not one */
} wh_path;

/* n <= WH_CORNERS_FAN. */
wh_path wh_corners_path(const wh_corners *t, const uint32_t *corner, uint32_t n);

#endif
