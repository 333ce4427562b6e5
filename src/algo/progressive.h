/*
 * progressive: a mesh at any level of detail, from the collapses that reduced it, and back.
 *
 * H. Hoppe, "Progressive meshes", SIGGRAPH 1996. A run's collapses, undone one after the other,
 * lead from its result, the base, back to the mesh it began with. They are put in another order
 * than they were made in, so that each level on the way is of even quality everywhere, and written
 * as a file of vertex splits (io/pmesh.h; pipeline/splits), which can be played both ways.
 *
 *     progressive_trace.c   what each collapse does to the faces, and when it may be undone
 *     progressive_play.c    from such a file to any level
 *     progressive_morph.c   from one level to another without a jump
 */
#ifndef WH_ALGO_PROGRESSIVE_H
#define WH_ALGO_PROGRESSIVE_H

#include "io/pmesh.h"
#include "mesh/corners.h"
#include "mesh/patch.h"

_Static_assert((int)WH_CORNERS_FAN >= (int)WH_PMESH_MOVED, "a fan has its path found");

/* ---- recording ---------------------------------------------------------------------------- */

/* What a face carries from one round to the next, while a run is recorded. */
typedef struct wh_trace_face {
	uint32_t id; /* for good */
	float key;   /* highest of the collapses that changed it */
} wh_trace_face;

/* A patch as it was before the first of its collapses, which are done to it one by one. */
typedef struct wh_trace {
	uint32_t nv, nf;
	uint64_t *gid; /* of each vertex */
	wh_vec3 *pos;
	uint8_t *attr;
	uint32_t attr_bytes;
	wh_corners at;                  /* lists may hold corners of faces that are gone */
	wh_trace_face *face;            /* of each face */
	uint8_t *gone;                  /* of each face: it has vanished */
	uint32_t moved[WH_PMESH_MOVED]; /* corners that the last collapse moved */
	uint32_t n;                     /* how many */
	size_t cap_v, cap_f, cap_attr;
} wh_trace;

/* What a collapse did: what undoes it (io/pmesh.h). */
typedef struct wh_trace_step {
	float key; /* what it cost, or one that has to come before it */
	uint32_t way, faces;
	uint32_t id[2], apex[2]; /* of the faces that vanished, in the order in which the split
	                            makes them; the third vertices' global ids */
	bool uv[2];              /* they are u v a, not v u a */
} wh_trace_step;

/* Bytes of a trace of patches of these counts. */
size_t wh_trace_bytes(uint64_t nv, uint64_t nf, uint32_t attr_bytes);

/*
 * Takes p down. Its faces carry what an earlier trace left them, or nothing yet: then their ids
 * count up from `first`. Until the end p has places for global ids, and faces carry nothing. A
 * trace may be begun again; free it, after a failure too.
 */
wh_code wh_trace_begin(wh_ctx *c, wh_trace *t, wh_patch *p, uint32_t first);
/* The collapse of u into v, which are places at the beginning; v is at x then. */
wh_code wh_trace_collapse(wh_ctx *c, wh_trace *t, uint32_t u, uint32_t v, wh_vec3 x, float cost,
                          wh_trace_step *step);
/* The collapses made p of what was taken down: global ids, and what faces carry. */
wh_code wh_trace_end(wh_ctx *c, const wh_trace *t, wh_patch *p);
void wh_trace_free(wh_ctx *c, wh_trace *t);

/* ---- playing ------------------------------------------------------------------------------ */

/* A file being played. The mesh of the level is the first nv vertices and nf faces. */
typedef struct wh_progressive {
	wh_pmesh file;
	uint32_t nv, nf;
	wh_vec3 *pos;
	uint8_t *attr;  /* records of file.attributes; NULL: there are none */
	wh_corners at;  /* lists as they are after the last split that is known */
	uint32_t level; /* splits that are done */
	uint32_t known; /* splits that were read: nothing beyond was looked at */
	/* of each split that is known: */
	uint32_t *v;
	uint32_t *first; /* of its corners in `moved`; the next one's follow */
	uint8_t *faces;  /* that it makes */
	wh_vec3 *other;  /* where v is on the other side of it; u's place is in pos */
	uint8_t *other_attr;
	float *error, *cost; /* before it */
	uint32_t *moved;     /* corners that become u's */
	size_t cap_moved;
	uint32_t room; /* splits that there is room for */
	wh_pmesh_block block;
} wh_progressive;

/* Opens a file at level 0, the base. Close it, after a failure too. */
wh_code wh_progressive_open(wh_ctx *c, wh_progressive *p, const char *path);
void wh_progressive_close(wh_ctx *c, wh_progressive *p);

/* Bytes that a file takes which is open or not begun, played up to a level. */
size_t wh_progressive_play_bytes(const wh_pmesh *file, uint64_t level);

/* What levels are asked for by; 0 where it is not. */
typedef struct wh_progressive_limit {
	uint64_t faces, vertices; /* no more than that */
	double error;             /* no more, in units of the file */
} wh_progressive_limit;

/* The coarsest level that keeps the error, or the finest that keeps a count; of several limits the
 * finest level. *kept: the base is no finer than asked for. Reads two blocks at most. */
wh_code wh_progressive_find(wh_ctx *c, wh_progressive *p, const wh_progressive_limit *limit,
                            uint64_t *level, bool *kept);

/* Goes to a level that there is, forward or back. What a level holds does not depend on the way
 * there. */
wh_code wh_progressive_seek(wh_ctx *c, wh_progressive *p, uint64_t level);

/* ---- between two levels -------------------------------------------------------------------- */

/* Vertices and faces of the finer level, which `p` is at; each vertex is somewhere between its
 * place there and that of its ancestor at the coarser one. */
typedef struct wh_progressive_morph {
	const wh_progressive *p;
	bool coarsens;   /* from the finer level to the coarser one */
	wh_vec3 *coarse; /* the coarser level: positions, ... */
	uint8_t *coarse_attr;
	uint32_t *ancestor; /* ... and the vertex there that each one was split from, or is */
	wh_vec3 *pos;       /* in between, as it was asked for last */
	uint8_t *attr;
} wh_progressive_morph;

/* Bytes that one takes beside what is played. */
size_t wh_progressive_morph_bytes(const wh_pmesh *file, uint64_t from, uint64_t to);

/* Goes to both levels, and to the finer one last, where `p` has to stay. Free it, after a failure
 * too. */
wh_code wh_progressive_morph_make(wh_ctx *c, wh_progressive *p, uint64_t from, uint64_t to,
                                  wh_progressive_morph *m);
void wh_progressive_morph_free(wh_ctx *c, wh_progressive_morph *m);

/* Fills m->pos and m->attr with what is between: 0 is `from`, 1 is `to`, each to the bit. */
void wh_progressive_morph_at(const wh_progressive_morph *m, double t);

/* The error of the level at hand. */
static inline double wh_progressive_error(const wh_progressive *p)
{
	if (p->level == p->file.head.splits)
		return 0;
	if (p->level < p->known)
		return (double)p->error[p->level];
	return (double)(p->level ? p->error[p->level - 1] : p->file.head.error);
}

#endif
