/*
 * check_parts: the counting that checks of whole meshes and of pieces have in common.
 *
 * Internal to check. A checker looks at one list of triangles in which some vertices are flagged
 * WH_CUT and the others are not. The star of a vertex is whole here or it is not:
 *
 *                      whole stars    edges, faces and fans counted
 *     mesh (no flags)  all            all
 *     piece            not cut        those with an end, a corner, a centre that is not cut
 *     rim             cut            the rest: those all of whose vertices are cut
 *
 * where the rim is made of all faces, of all pieces, that have a cut corner. A piece and the
 * rim together thus count everything once.
 */
#ifndef WH_MESH_CHECK_PARTS_H
#define WH_MESH_CHECK_PARTS_H

#include "base/exact_sum.h"
#include "mesh/check.h"

/* One side of a face of a star, seen from the centre. */
typedef struct wh_spoke {
	uint64_t key;  /* far end, then the face's third corner: what sorting goes by */
	uint32_t slot; /* which face of the star */
	uint32_t out;  /* 1: the face goes from the centre to the far end; 0: the other way */
} wh_spoke;

/* Sums over faces; the faces' order leaves no trace. Zero-initialise. */
enum { WH_RATIO_BINS = 1024 };

typedef struct wh_face_sums {
	wh_exact_sum area;
	wh_exact_sum ratio;               /* radius ratios */
	uint64_t bins[WH_RATIO_BINS + 1]; /* faces by radius ratio; the last one: of exactly 1 */
} wh_face_sums;

typedef struct wh_checker {
	wh_ctx *c;
	uint32_t nv, nf;
	const wh_vec3 *pos; /* nv; the rim needs none */
	const uint32_t *tri;
	const uint8_t *flag; /* nv: WH_CUT or not; NULL: a whole mesh */
	float (*normal)[3];  /* nf, of length 1, or 0 where there is none; of the rim they are
	                        given, and the caller's */
	bool rim;            /* whole are the stars of cut vertices */
	wh_check *r;         /* counts are added here */

	uint64_t *used;        /* bit per vertex that has a face */
	uint64_t *first;       /* nv + 1: star of v is star[first[v] .. first[v+1]-1] */
	uint32_t *star;        /* face ids */
	uint32_t *face_sets;   /* faces joined through counted edges */
	uint32_t *vertex_sets; /* vertices joined through faces */
	uint32_t *set_faces;   /* faces of each root of them */

	uint64_t *on_boundary;   /* bit per half-edge 3 f + k, from corner k of f to its next */
	uint64_t *ends_open;     /* bit per vertex that has a boundary edge */
	uint64_t *rank;          /* boundary half-edges before each word of on_boundary */
	uint32_t *loop_sets;     /* boundary half-edges, by rank, joined through fans */
	uint64_t boundary_total; /* boundary half-edges */

	/* the star being looked at */
	uint32_t degree;
	wh_spoke *spokes;  /* 2 degree, sorted */
	uint32_t *fan;     /* degree: union-find of its faces */
	uint64_t *fan_end; /* degree: first boundary half-edge seen of the fan with this root */
	size_t star_cap;   /* faces these three have room for */
} wh_checker;

static inline void wh_bit_set(uint64_t *bits, uint64_t i)
{
	bits[i / 64] |= UINT64_C(1) << (i % 64);
}

static inline bool wh_bit_get(const uint64_t *bits, uint64_t i)
{
	return bits[i / 64] >> (i % 64) & 1;
}

/* Face f has three different corners, all in range. */
bool wh_checker_is_face(const wh_checker *k, uint32_t f);

/* All of the stages below and those before them, for a mesh or a piece: counts everything but
 * what is derived and the sizes of components, makes vertex_sets and frees the stars. The box,
 * which the caller begins, grows over all vertices that are used; areas and shapes are added to
 * *sums. */
wh_code wh_checker_run(wh_checker *k, wh_face_sums *sums);

/* For the rim, whose face_sets are given, in this order. Lists the stars. */
wh_code wh_checker_stars(wh_checker *k);
/* Counts edges, duplicate faces and fans; joins face_sets. */
wh_code wh_checker_edges(wh_checker *k);
/* Numbers the boundary half-edges, each a loop_set of its own. */
wh_code wh_checker_number_boundary(wh_checker *k);
uint32_t wh_checker_boundary_number(const wh_checker *k, uint64_t half_edge);
/* Joins them through fans; adds the counted boundary edges less the joins to boundary_loops. */
wh_code wh_checker_loops(wh_checker *k);

void wh_checker_free(wh_checker *k);

void wh_face_sums_join(wh_face_sums *sum, const wh_face_sums *part);
/* Sets the area and the radius ratios of *r. */
void wh_face_sums_end(const wh_face_sums *sum, wh_check *r);

/* Counts a component of so many faces by its size. */
void wh_check_add_component(wh_check *r, uint64_t faces);

/* Euler characteristic and genus, when all else has been counted. */
void wh_check_derive(wh_check *r);
/* An empty box (lo > hi); one that holds another's as well; 0 instead of one that stayed empty. */
void wh_check_box_begin(wh_check *r);
void wh_check_box_join(wh_check *r, const wh_check *other);
void wh_check_box_end(wh_check *r);

#endif
