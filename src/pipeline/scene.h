/*
 * scene: a source of any size as the renderer sees it, in bounded memory.
 *
 * The places of the vertices on the picture, and the sums of their normals, are tables in memory:
 * 16 and 8 bytes a vertex. Where they do not fit, a window of vertices after the other is brought
 * in, and what the faces' corners have in it is filled in, in a file of as many bytes for each
 * corner: 48 and 24 a face. Chunks of faces that have no corner in a window are left out, so that
 * faces in the order of their vertices are gone through a few times, whatever the windows. The
 * picture is the same either way: places are those of the vertex alone, sums are whole numbers.
 *
 *     open -> prepare -> draw for each canvas -> close
 */
#ifndef WH_PIPELINE_SCENE_H
#define WH_PIPELINE_SCENE_H

#include "algo/render.h"
#include "exec/exec.h"
#include "io/ply.h"
#include "io/spill.h"
#include "pipeline/progress.h"
#include "pipeline/skins.h"

typedef struct wh_scene_params {
	const wh_source *source; /* without faces: a cloud of points */
	const wh_skins *skins;   /* NULL: no textures */
	wh_look look;    /* its camera is fitted; colours: those of the source's attributes */
	uint64_t window; /* vertices in memory at a time; 0: all */
} wh_scene_params;

typedef struct wh_scene wh_scene;

/* Bytes that a scene takes. */
size_t wh_scene_bytes(const wh_scene_params *p, const wh_exec *ex);

/* *s is NULL on failure. What the parameters point to must live as long. */
wh_code wh_scene_open(wh_ctx *c, wh_scene **s, const wh_exec *ex, wh_spill *spill,
                      wh_progress *progress, const wh_scene_params *p);
void wh_scene_close(wh_ctx *c, wh_scene **s);

/* Finds the places of the vertices and their normals. WH_E_IRREGULAR as wh_source_triangles. */
wh_code wh_scene_prepare(wh_ctx *c, wh_scene *s);

/* Draws all on a canvas. */
wh_code wh_scene_draw(wh_ctx *c, wh_scene *s, const wh_canvas *canvas);

#endif
