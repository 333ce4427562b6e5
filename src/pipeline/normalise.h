/*
 * normalise: any mesh file becomes a wh_source, positions and triangles at fixed strides.
 *
 * Other formats are described in PLY's words first: then their bodies are rewritten as PLY's are.
 * Binary files of triangles are used in place. Text is parsed in parallel by chunks of lines,
 * with a serial token reader behind it for bodies that do not keep one element to a line.
 * Polygons are triangulated by a rule from corner positions and ids alone, strips unrolled.
 */
#ifndef WH_PIPELINE_NORMALISE_H
#define WH_PIPELINE_NORMALISE_H

#include "exec/exec.h"
#include "io/attributes.h"
#include "io/spill.h"
#include "io/wedges.h"
#include "mesh/mesh.h"
#include "pipeline/read_obj.h"
#include "pipeline/read_stl.h"

typedef struct wh_input {
	wh_ply ply;          /* ply.kind says what it really is */
	wh_obj obj;          /* of an OBJ file */
	wh_stl stl;          /* of an STL file */
	uint64_t file_bytes; /* of the user's file, packed or not */
	bool unpacked;       /* ply is open on a temporary file, of what was compressed or came
	                        through a pipe */
	wh_source source;    /* refers to ply or to the temporary file below, and to attributes */
	wh_attributes attributes; /* besides positions; none when they were not asked for */
	wh_wedges wedges;         /* the same of faces and corners */
	wh_attributes whole; /* attributes with those of corners, as vertices have them that are
	                        doubled where these differ; empty when corners carry nothing.
	                        Without texture coordinates where the output has those of corners */
	bool apart;          /* so the source has them, and is to be joined: see wh_input_joined */
	int temp_fd;         /* rewritten triangles, and vertices unless they could stay in place;
	                        -1 when the whole body is used in place. Nameless: see spill.h */
	uint64_t polygons;   /* faces with more than three corners */
	uint64_t
	    degenerate; /* faces with fewer than three different corners, dropped (see below) */
	bool rply;      /* rply reads the body */
	uint64_t invalid_polygons; /* with a corner that is not finite, dropped; only when kept */
} wh_input;

/* How a file is to be opened. */
typedef struct wh_input_how {
	wh_format from;       /* its format; WH_FORMAT_ANY: what it looks like */
	wh_wanted attributes; /* vertex properties to read, as wh_attributes_choose says */
	bool rply;            /* let rply read it: PLY only, and where the build has it */
	bool keep_invalid;    /* vertices that are not finite are no failure (io/ply.h) */
} wh_input_how;

/*
 * Opens the file, or standard input for "-", unpacks it where it is compressed, takes it into a
 * temporary file where it comes through a pipe, and describes it in in->ply, whatever is in it;
 * there is no source yet. `from`: its format, WH_FORMAT_ANY to find that out from the content,
 * or else the name. OBJ and text of STL are gone through to be counted. `spill` is opened where
 * it is needed, if it is not open yet. WH_E_INPUT for a damaged header, or no format
 * that is known.
 */
wh_code wh_input_describe(wh_ctx *c, const wh_exec *ex, wh_spill *spill, const char *path,
                          wh_format from, wh_input *in);
/*
 * Opens the file and makes its source. `spill` is where a rewritten body goes. Files without a
 * vertex element, without faces or with zero faces are WH_E_INPUT ("is no mesh").
 * A rewritten body leaves out degenerate triangles and counts them; one used in place may hold
 * triangles with repeated corners, which readers drop themselves.
 */
wh_code wh_input_open(wh_ctx *c, const wh_exec *ex, wh_spill *spill, const char *path,
                      wh_format from, wh_input *in);
/* The same with all that can be said about it, such as what vertices and faces carry besides
 * positions. *in must stay where it is. */
wh_code wh_input_open_how(wh_ctx *c, const wh_exec *ex, wh_spill *spill, const char *path,
                          const wh_input_how *how, wh_input *in);
wh_code wh_input_open_with(wh_ctx *c, const wh_exec *ex, wh_spill *spill, const char *path,
                           wh_format from, wh_wanted wanted, wh_input *in);
/*
 * A body that is used in place turned out to have faces that are no triangles (WH_E_IRREGULAR): it
 * is rewritten after all, from the file as it is open. Does nothing for one that was. After a
 * failure *in is still to be closed.
 */
wh_code wh_input_rewrite(wh_ctx *c, const wh_exec *ex, wh_spill *spill, wh_input *in);
/*
 * The same, but a body that would have to be rewritten is not: the source then has the counts of
 * the header, the layout that a rewritten one would have, and no file (vfd and ffd -1).
 */
wh_code wh_input_look(wh_ctx *c, const wh_exec *ex, wh_spill *spill, const char *path,
                      wh_format from, wh_wanted wanted, wh_input *in);
/* The same as wh_input_open_with, but a file need not have faces: without, the source is its
 * vertices. */
wh_code wh_input_open_any(wh_ctx *c, const wh_exec *ex, wh_spill *spill, const char *path,
                          wh_format from, wh_wanted wanted, wh_input *in);
void wh_input_close(wh_ctx *c, wh_spill *spill, wh_input *in);

/* What the source will be, as far as counts tell, where it is apart (pipeline/atlas.h). Else it is
 * the source. */
wh_source wh_input_joined(const wh_input *in);

/* A body that was made out of this one's takes its place, in the scratch file fd. */
void wh_input_replace(wh_spill *spill, wh_input *in, const wh_source *source, int fd);

/* Bytes of the temporary file, or that it would have after a look; 0 when there is none. */
uint64_t wh_input_temp_bytes(const wh_input *in);
/* WH_E_RUN when the user's file was written to since it was opened, as wh_ply_unchanged. */
wh_code wh_input_unchanged(wh_ctx *c, const wh_input *in);
/* Removes the temporary files: the source cannot be read any more. */
void wh_input_drop_temp(wh_spill *spill, wh_input *in);

/*
 * All of a source as a mesh in memory, degenerate triangles dropped, vertices in order
 * (unreferenced ones kept). WH_E_PLAN when it has 2^32 - 1 vertices or faces or more;
 * WH_E_IRREGULAR as wh_source_triangles.
 */
wh_code wh_source_mesh(wh_ctx *c, const wh_exec *ex, const wh_source *s, wh_mesh *m);

/*
 * The whole file as a mesh in memory, degenerate triangles dropped, vertices in file order
 * (unreferenced ones kept). WH_E_PLAN when it has 2^32 - 1 vertices or faces or more. When
 * `is_double` is not NULL it receives whether positions are doubles. Degenerate faces are
 * counted in *degenerate when it is not NULL.
 */
wh_code wh_load_mesh(wh_ctx *c, const wh_exec *ex, wh_spill *spill, const char *path,
                     wh_format from, wh_mesh *m, bool *is_double, uint64_t *degenerate);

#endif
