/*
 * progressive: a mesh at any level of detail, from the collapses that reduced it, and back.
 *
 * H. Hoppe, "Progressive meshes", SIGGRAPH 1996. A run's collapses, undone one after the other,
 * lead from its result, the base, back to the mesh it began with. They are put in another order
 * than they were made in, so that each level on the way is of even quality everywhere, and written
 * as a file of vertex splits (io/pmesh.h), which can be played both ways.
 *
 *     progressive_order.c   the order, and what each collapse did to the faces
 *     progressive_write.c   the splits, coarse to fine, into a file
 *     progressive_play.c    from such a file to any level
 *     progressive_morph.c   from one level to another without a jump
 */
#ifndef WH_ALGO_PROGRESSIVE_H
#define WH_ALGO_PROGRESSIVE_H

#include "io/pmesh.h"
#include "mesh/corners.h"
#include "mesh/patch.h"

_Static_assert((int)WH_CORNERS_FAN >= (int)WH_PMESH_MOVED, "a fan has its path found");

/* ---- writing ------------------------------------------------------------------------------ */

/* A collapse of the run. */
typedef struct wh_progressive_step {
	uint32_t u, v; /* of the finest mesh: u went, v stayed */
	wh_vec3 at;    /* where v was then; once it is ordered, where it was before */
	float cost;    /* once it is ordered, the highest of what had to come before it, too */
	float err;     /* accumulated distance of v */
	uint32_t gone[2];
	uint32_t ngone; /* faces that vanished, */
	uint32_t first; /* and corners that became v's: up to where the next step's are */
} wh_progressive_step;

/* A finest mesh, the collapses that reduced it in the order in which they were made, and the
 * result. Arrays are the caller's; those of the mesh and the steps are used up. Attributes come in
 * records of attr_bytes for each. */
typedef struct wh_progressive_run {
	uint32_t nv, nf;
	wh_vec3 *pos; /* in file coordinates, as are those of the steps */
	uint8_t *attr;
	uint32_t *tri;
	wh_progressive_step *step; /* with room for one more */
	uint8_t *step_attr;        /* those of v after the collapse */
	uint32_t steps;
	uint32_t attr_bytes;
	const wh_attributes *attributes; /* NULL: none */
	const wh_patch *base;            /* the result; its global ids are vertices of the mesh */
	uint32_t coord_bytes;
	uint64_t input_bytes;
	double diagonal;
} wh_progressive_run;

/* Bytes that writing takes at most, the arrays above included but for the base. */
size_t wh_progressive_bytes(uint64_t nv, uint64_t nf, uint32_t attr_bytes);

/* Writes the file to an output, which the caller opens and commits. */
wh_code wh_progressive_write(wh_ctx *c, wh_outfile *o, const wh_progressive_run *run);

/* ---- between the two files that write ----------------------------------------------------- */

/* The steps, worked out. */
typedef struct wh_progressive_order {
	wh_corners at;   /* the mesh, reduced; faces that vanished as they were then */
	uint32_t *moved; /* corners, step by step */
	size_t cap_moved;
	uint64_t *rank; /* steps by their cost: the lower halves are their numbers */
	uint8_t *dead;  /* a bit for each face */
} wh_progressive_order;

/* Does the steps to the mesh of `run`, and finds their order. Free it, after a failure too. */
wh_code wh_progressive_sort(wh_ctx *c, const wh_progressive_run *run, wh_progressive_order *o);
void wh_progressive_order_free(wh_ctx *c, wh_progressive_order *o);

static inline bool wh_progressive_is_dead(const wh_progressive_order *o, uint32_t f)
{
	return o->dead[f >> 3] >> (f & 7) & 1;
}

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
