/*
 * check_pieces: a check of a mesh that is given in pieces, in bounded memory.
 *
 * The pieces are patches: a vertex that is used by other pieces too is flagged WH_CUT and has the
 * same global id in all of them; no other vertex is in two pieces. Every face is in one piece.
 * How the mesh is cut and in which order the pieces come makes no difference to any count, and
 * none to the area or the radius ratios.
 *
 *     for each piece, by any worker:    wh_check_look        (what is whole in the piece)
 *     and one at a time, in any order:  wh_check_pieces_add  (what is left, of all pieces)
 *     then once:                        wh_check_pieces_end
 */
#ifndef WH_MESH_CHECK_PIECES_H
#define WH_MESH_CHECK_PIECES_H

#include "mesh/check.h"
#include "mesh/patch.h"

/* What a worker finds in a piece, and its tables: reused for the next one. */
typedef struct wh_check_workspace wh_check_workspace;

/* NULL, failure recorded, when memory is refused. */
wh_check_workspace *wh_check_workspace_new(wh_ctx *c);
void wh_check_workspace_free(wh_ctx *c, wh_check_workspace *w);

/* Looks at a piece. Depends on nothing but the piece. Thread-safe with one workspace for each. */
wh_code wh_check_look(wh_ctx *c, wh_check_workspace *w, const wh_patch *piece);

/* Bytes that looking at a piece takes beside it: about 40 a face, with an eighth of its faces
 * along cuts. More for loose faces, that have most of the boundary. */
size_t wh_check_piece_bytes(uint64_t nv, uint64_t nf);

/* The sum over all pieces, and the faces along the cuts: some 40 bytes for each of those. */
typedef struct wh_check_pieces wh_check_pieces;

wh_check_pieces *wh_check_pieces_new(wh_ctx *c);
void wh_check_pieces_free(wh_ctx *c, wh_check_pieces *s);

/* Adds what was found in a piece. On failure the sum can only be freed. */
wh_code wh_check_pieces_add(wh_ctx *c, wh_check_pieces *s, const wh_check_workspace *w);

/*
 * Fills *r as wh_check_mesh does, from positions as the pieces have them. What is known from the
 * list of vertices alone is the caller's to add: `vertices` is what is referenced, and
 * unreferenced, coincident and non-finite vertices are 0. Takes another 25 bytes for each face
 * along the cuts. The sum can only be freed afterwards.
 */
wh_code wh_check_pieces_end(wh_ctx *c, wh_check_pieces *s, wh_check *r);

#endif
