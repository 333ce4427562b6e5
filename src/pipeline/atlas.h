/*
 * atlas: vertices that are doubled along the borders of a texture's charts become one, and are
 * doubled again.
 *
 * Where each vertex has one pair of texture coordinates, a mesh is cut open along the borders of
 * its charts: either side has copies of the vertices on it, at the same positions. Joined, the
 * copies are one vertex, and what differs belongs to the corners of faces (io/wedges.h). Nothing
 * but copies along such cuts is joined: not what merely touches.
 */
#ifndef WH_PIPELINE_ATLAS_H
#define WH_PIPELINE_ATLAS_H

#include "exec/exec.h"
#include "io/spill.h"
#include "io/wedges.h"
#include "mesh/patch.h"
#include "pipeline/progress.h"

/* ---- joining ------------------------------------------------------------------------------ */

typedef struct wh_atlas_params {
	const wh_attributes *rest; /* those that vertices keep; may have none */
	const wh_wedges *wedges;   /* what is to be carried by corners and faces */
	size_t budget;             /* bytes of memory; decides nothing but time */
	uint64_t window;           /* vertices handled at a time; 0: as there is memory for */
} wh_atlas_params;

typedef struct wh_atlas_result {
	uint64_t joined; /* vertices that became another one */
	uint64_t degenerate_faces;
	uint64_t bytes_read; /* of the source's files */
} wh_atlas_result;

/*
 * Makes *out, in the scratch file *fd of the spill folder, from a source whose attributes are those
 * of vertices as the file has them. A joined vertex keeps what the first of its copies has besides
 * its corners' attributes. Faces keep their order, vertices too. WH_E_PLAN when the least that
 * works is more than the budget; WH_E_IRREGULAR as wh_source_triangles.
 */
wh_code wh_atlas_join(wh_ctx *c, const wh_exec *ex, wh_progress *progress, wh_spill *spill,
                      const wh_source *source, const wh_atlas_params *params, wh_source *out,
                      int *fd, wh_atlas_result *result);

/* The least memory it takes with so many workers, and the bytes of temporary disk, the result
 * included, as far as counts tell. */
size_t wh_atlas_bytes(const wh_source *source, const wh_wedges *wedges, int workers);
uint64_t wh_atlas_disk(const wh_source *source, const wh_wedges *wedges);

/* ---- doubling ----------------------------------------------------------------------------- */

/* Room that is kept from one patch to the next; zero to begin with. */
typedef struct wh_atlas_room {
	wh_patch patch;
	uint32_t *first, *next, *corner; /* a list of different corners for each vertex */
	uint32_t *tri;                   /* for each face, which of them it has */
	size_t cap_first, cap_next, cap_corner, cap_tri;
} wh_atlas_room;

/*
 * Doubles the vertices of a patch, so that each has one corner: attributes become `whole`, which
 * are `rest` (NULL: none) with those of the wedges' corners, or the last of these: in the others
 * corners may go on to differ. Copies lie side by side; ids and flags are the same. A corner
 * without texture coordinates or normal gets 0. The patch is the room's own, valid until the next
 * call.
 */
wh_code wh_atlas_double(wh_ctx *c, const wh_patch *p, const wh_attributes *rest,
                        const wh_wedges *wedges, const wh_attributes *whole, wh_atlas_room *room,
                        wh_patch **doubled);
void wh_atlas_room_free(wh_ctx *c, wh_atlas_room *room);
/* Bytes of the room for a patch of these counts, about. */
size_t wh_atlas_room_bytes(uint64_t nv, uint64_t nf, const wh_attributes *whole);

#endif
