/*
 * simplify_engine: what the files of the engine share; nobody else includes it but tests.
 *
 *     simplify.c       the queue loop: from vertices in the queue to collapses
 *     star.c           stars: the vertices and, in order, who is around them
 *     fan.c            a star taken out to work on; place and cost of the collapses of its edges
 *     trial.c          one collapse worked out: link condition, turning faces
 *     stretch.c        how far it moves the surface
 *     surgery.c        collapses that the link condition forbids, with a change of topology
 *     blend.c          the attributes of the vertex that a collapse makes
 *     blend_cost.c     what they add to the costs of edges
 *     policy*.c        other costs and places than those of fan.c (policy.h)
 *     wedge.c          what faces and their corners carry: borders, and what happens along them
 */
#ifndef WH_ALGO_SIMPLIFY_ENGINE_H
#define WH_ALGO_SIMPLIFY_ENGINE_H

#include "algo/queue.h"
#include "algo/simplify.h"
#include "geom/quadric.h"

#include <math.h>
#include <string.h>

enum {
	WH_RING_INLINE = 16, /* neighbours that a star holds itself: a cache line */
	/* A vertex with more neighbours than this is locked, and no other is made: else a hub of n
	 * faces would take time n^2. */
	WH_MOST_AROUND = 128,
	WH_LANES = 8
};

/* What the faces and boundary edges around a vertex add up to; of faces w n n', with n the area
 * vector and w the weight of wh_face_weight. */
typedef struct wh_vertex_sum {
	double xx, xy, xz, yy, yz, zz; /* A, boundary terms included */
	wh_vec3 n;                     /* sum of area vectors */
} wh_vertex_sum;

/* A vertex and its neighbours, counter-clockwise: with each and the next one it has a face. An
 * interior vertex has one with the last and the first, too; a boundary vertex has not. Three cache
 * lines: costs need the first two, the third is the ring. */
typedef struct wh_star {
	_Alignas(64) wh_vec3 pos;
	wh_vertex_sum sum; /* of a free vertex; 0 of a locked one */
	double guess;      /* what its cheapest collapse may cost by now */
	uint32_t n;        /* neighbours; 0 when it is locked or gone */
	uint8_t flag;      /* the patch's */
	bool closed;       /* interior */
	/* unused ones are WH_NONE; where there are more, ring[0] is their place in the overflow */
	_Alignas(64) uint32_t ring[WH_RING_INLINE];
} wh_star;

/* One number for each neighbour or face of a star, in whole vectors. */
enum { WH_ROW = WH_MOST_AROUND + WH_LANES };
typedef struct wh_row {
	_Alignas(64) double at[WH_ROW];
} wh_row;

/* Three rows. */
typedef struct wh_rows3 {
	wh_row x, y, z;
} wh_rows3;

/* Loops over lanes become vectors only where it is part of them. */
static inline __attribute__((always_inline)) wh_vec3 wh_rows3_at(const wh_rows3 *r, size_t i)
{
	return wh_v3(r->x.at[i], r->y.at[i], r->z.at[i]);
}

/* The sum of all lanes, in an order that halves of vectors have. */
static inline double wh_sum_lanes(const double v[WH_LANES])
{
	return ((v[0] + v[4]) + (v[2] + v[6])) + ((v[1] + v[5]) + (v[3] + v[7]));
}

/* The star of a vertex, the hub, taken out. Positions are relative to the hub. */
typedef struct wh_fan {
	uint32_t n;
	bool closed;
	const uint32_t *id;     /* the hub's ring, until it changes */
	wh_rows3 to;            /* neighbours */
	wh_rows3 before, after; /* area vectors of the faces before and after each; 0 if none */
	wh_row xx, xy, xz, yy, yz, zz; /* their sums: A, */
	wh_rows3 m;                    /* and area vectors */
	wh_row rim;                    /* 1 on a boundary edge, else 0 */
	wh_row locked;                 /* 1 where the neighbour is locked, else 0 */
	wh_row bar; /* added to the cost: infinite where an edge may not be collapsed */
	/* results: new place, cost, weight of the faces */
	wh_rows3 place;
	wh_row cost, weight;
} wh_fan;

/* The collapse of an edge of a fan, worked out: the neighbours of the new vertex, counter-clockwise
 * and relative to the hub. Each face around the new vertex was a face of one of the ends before. */
typedef struct wh_trial {
	uint32_t u, v;    /* u goes, v stays; the hub is one of them */
	wh_vec3 edge;     /* from the hub to the other end */
	wh_vec3 to;       /* from the hub to the new place */
	wh_vec3 x;        /* the new place itself */
	bool into_locked; /* v is locked; else the hub is v */
	double cost, weight;
	uint32_t nshared; /* faces on uv: 1 or 2 */
	uint32_t apex[2]; /* their third corners */
	wh_vec3 lost[2];  /* their area vectors */
	uint32_t n, faces;
	bool closed;
	uint32_t id[WH_ROW];
	wh_row theirs;  /* 1 where face i was the other end's, 0 where it was the hub's */
	wh_rows3 at;    /* neighbours; after the last of a closed ring the first again */
	wh_rows3 spoke; /* neighbours from the new place */
	/* area vectors, as they were and as they will be: i is of the face before neighbour i, i +
	 * 1 of the one after it; 0 where there is none */
	wh_rows3 old, fresh;
	wh_row old_weight, fresh_weight;
	wh_row gain[9]; /* what the sum of neighbour i gains */
} wh_trial;

enum { WH_OF_U = 1, WH_OF_V = 2 }; /* bits */

/* Some neighbours of the new vertex of a collapse, in order: its ring, or one of its two. */
typedef struct wh_sheet {
	uint32_t n;
	bool closed;
	uint32_t id[WH_ROW];
	uint8_t of[WH_ROW];   /* which of the ends had it as a neighbour */
	uint8_t face[WH_ROW]; /* whose the face behind it was */
} wh_sheet;

/* A collapse with a change of topology: u and v go to the same place, as one vertex or two. */
typedef struct wh_surgery {
	wh_topology kind;
	uint32_t u, v;
	uint32_t w;            /* the third vertex of the triangle; WH_NONE where there is none */
	uint32_t second;       /* when it is done: w's double, or w */
	uint32_t nshared;      /* faces that go */
	wh_vec3 at;            /* the new place */
	double size2;          /* what has to be small, squared */
	wh_sheet sheet[2];     /* v's and u's rings; a hole has one */
	uint32_t inner, outer; /* w's ring in two */
	uint32_t inside[WH_ROW], outside[WH_ROW];
} wh_surgery;

/* Stand in rings for the new vertices while those still have their former names. */
static inline uint32_t wh_holder(uint32_t sheet)
{
	return UINT32_MAX - 2 - sheet;
}

static inline bool wh_is_holder(uint32_t id)
{
	return id == wh_holder(0) || id == wh_holder(1);
}

static inline uint32_t wh_surgery_sheets(const wh_surgery *s)
{
	return s->kind == WH_HOLE ? 1 : 2;
}

/* A whole part of the surface. */
enum { WH_SHELL_MOST = 16 }; /* vertices */
typedef struct wh_shell {
	uint32_t n, faces;
	uint32_t id[WH_SHELL_MOST];
	double size2, weight; /* its diagonal, squared; its faces' weight, as costs have it */
	float err;            /* the worst accumulated distance */
} wh_shell;

/* The place of a vertex among the pairs around another, while stars are built. */
typedef struct wh_mark {
	uint32_t tick;
	uint16_t first, second;
} wh_mark;

enum { WH_OVERFLOW_CLASSES = 3 }; /* rings of up to 32, 64, 128 */

struct wh_simplify_workspace {
	wh_trial trial;
	wh_fan fan;
	wh_surgery surgery;
	wh_queue queue;
	wh_star *star;
	wh_mark *mark;
	uint32_t *first; /* per vertex: its faces in `corner`, while stars are built */
	size_t cap_star, cap_mark, cap_first;
	uint32_t *corner;
	size_t cap_corner;
	/* while faces carry something: the faces of each ring, side by side with it */
	uint32_t *slot, *overflow_slot;
	size_t cap_slot, cap_overflow_slot;
	struct wh_wedge_plan *wedge;
	struct wh_gradients *gradients; /* of blend_cost.c; NULL until attributes have weights */
	wh_quadric *quadric;            /* of policy_qem.c: one for each vertex, about its place */
	size_t cap_quadric;
	uint32_t *overflow; /* rings that are too long for their stars */
	size_t overflow_cap, overflow_used;
	uint32_t overflow_free[WH_OVERFLOW_CLASSES];
	uint32_t tick;
};

/* How a run weighs time, error and the shape of faces against each other; see simplify.c. */
typedef struct wh_manner {
	/* Of the guess, where a vertex that was never evaluated waits: less means evaluating
	 * vertices too early, more, too late. */
	double guess_share;
	/* A vertex is taken although its edge got dearer since by up to this many buckets, 1/32 of
	 * a power of two each: going back costs an evaluation. */
	uint32_t slack;
	/* Pulls the new vertex to the edge's midpoint where the faces leave a direction free. */
	double midpoint_pull;
	/* Prefers short edges where the faces do not tell (flat regions). */
	double length_tie;
} wh_manner;

/* One run. */
typedef struct wh_engine {
	wh_ctx *c;
	struct wh_simplify_workspace *w;
	wh_patch *p;
	const wh_simplify_params *params;
	const wh_manner *manner;
	const struct wh_policy *policy; /* NULL: the costs and places of fan.c */
	wh_placement placement;         /* with a policy */
	wh_simplify_result *result;
	bool weighted;                  /* attributes have weights */
	const struct wh_wedges *wedges; /* faces carry this; NULL: nothing */
	uint32_t faces, vertices;       /* alive */
	uint64_t taken;                 /* faces, by collapses */
	bool full;                      /* a collapse would have taken one too many */
	uint32_t still; /* faces between locked vertices: the first ones of p->tri */
	bool surgery;   /* topology may change */
	bool lenient;   /* faces may turn over */
	uint32_t dead;  /* with surgery: the last vertex to go; ring[0] of each is the one before */
} wh_engine;

/* Work that is the same for all lanes: the compiler makes vectors of it. Every lane does the same
 * operations in the same order whatever the vector length, so the bits are the same on every
 * instruction set. */
#if defined(__x86_64__) && defined(__GLIBC__) && !defined(WH_SANITIZED)
#define WH_VECTOR_CLONES __attribute__((target_clones("avx512f", "avx2", "default")))
#else
#define WH_VECTOR_CLONES
#endif

/*
 * The weight of a face beside its squared volume, from its squared area vector: about to the power
 * of -1/4, straight from one power of two to the next in the bits (exponent and mantissa taken as
 * one number are a logarithm, nearly). Without it large faces count for too much, with a power of
 * -1/2 for too little: RMS over that of Lindstrom-Turk's squared volumes, on 11 meshes at 10, 1 and
 * 0.1 %: 1.003, 0.985, 0.998.
 */
static inline double wh_face_weight(double n2)
{
	const uint64_t one = 1023ULL << 52; /* the bits of 1.0 */
	uint64_t bits;
	double w;
	memcpy(&bits, &n2, sizeof bits);
	bits = one + one / 4 - (bits >> 2);
	memcpy(&w, &bits, sizeof w);
	return w;
}

/* A face may turn by at most acos of this in one collapse. There is no rule against thin faces:
 * scans are full of them, and collapses that pass through them are needed (refusing to thin a
 * face below 2 area / sum of squared edges = 0.02 stopped a dragon at eight times its count).
 * Against turning over in several steps a face may not pass to the other side of the mean direction
 * around the edge. */
static const double WH_MIN_COSINE = 0.2;

/* ---- star.c ------------------------------------------------------------------------------- */

/* Makes the stars of the patch: finds boundary vertices, and fixes those that are not manifold.
 * Faces between locked vertices become the first ones of p->tri. */
wh_code wh_stars_build(wh_engine *e);

/* The faces and vertices that are left, back into the patch. */
void wh_stars_unbuild(wh_engine *e);

static inline uint32_t *wh_ring(const wh_engine *e, uint32_t v)
{
	wh_star *s = &e->w->star[v];
	return s->n <= WH_RING_INLINE ? s->ring : &e->w->overflow[s->ring[0]];
}

/* Where a neighbour is in a ring that has it. */
static inline uint32_t wh_ring_place(const uint32_t *ring, uint32_t id)
{
	uint32_t i = 0;
	while (ring[i] != id)
		i++;
	return i;
}

/* v's ring becomes these n neighbours, at most WH_MOST_AROUND. */
wh_code wh_ring_set(wh_engine *e, uint32_t v, const uint32_t *id, uint32_t n);

/* Takes a neighbour out of v's ring. */
wh_code wh_ring_remove(wh_engine *e, uint32_t v, uint32_t id);

/* Puts a neighbour in the place of another. */
void wh_ring_replace(wh_engine *e, uint32_t v, uint32_t id, uint32_t by);

static inline bool wh_is_locked(const wh_engine *e, uint32_t v)
{
	return e->w->star[v].flag & WH_LOCKED;
}

/* ---- fan.c -------------------------------------------------------------------------------- */

/* Takes the star of the free vertex v out, with the sums of its neighbours. */
void wh_fan_gather(const wh_engine *e, uint32_t v, wh_fan *f);

/* Place and cost of the collapse of each edge. */
void wh_fan_evaluate(wh_fan *f, const wh_vertex_sum *hub, const wh_manner *manner);

/* The sum of a vertex, from n area vectors (0 where there is no face) and, when it is on the
 * boundary, its two boundary edges; `n` neighbours at `to`. */
void wh_sum_make(const wh_rows3 *to, const wh_rows3 *face, uint32_t n, bool closed,
                 wh_vertex_sum *s);

/* What the cheapest collapse of a vertex may cost, judged by what is around it alone: the cost of
 * moving it to a neighbour. The truth is mostly between a thirtieth and the whole of that. */
double wh_guess(const wh_rows3 *to, uint32_t n, const wh_vertex_sum *sum, const wh_manner *manner);

/* Adds to the sums of vertices what these faces are to their corners, boundary terms left out. */
void wh_stars_sum(wh_star *star, const uint32_t *tri, size_t nf);

/* Adds its boundary terms to the sum of the free vertex v, and makes its guess. The workspace's fan
 * is lost. */
void wh_star_guess(wh_engine *e, uint32_t v);

/* Sum and guess of the free vertex v. The workspace's fan is lost. */
void wh_star_renew(wh_engine *e, uint32_t v);

/* ---- trial.c ------------------------------------------------------------------------------ */

/* Works out the collapse of the fan's edge i: its new place and its neighbours. False when the link
 * condition forbids it. */
bool wh_trial_make(const wh_engine *e, const wh_fan *f, uint32_t hub, uint32_t i, wh_trial *t);

/* True when no face turns too much. */
bool wh_trial_sound(const wh_engine *e, wh_trial *t);

/* Makes it so: rings, positions, sums and guesses. What was gathered of the hub before is lost. */
wh_code wh_trial_commit(wh_engine *e, wh_trial *t);

/* ---- stretch.c ---------------------------------------------------------------------------- */

/* Estimate of the distance between the original surface and the one after the collapse: exact where
 * it is within the limit, else anything above. */
double wh_trial_distance(const wh_engine *e, const wh_trial *t);

/* ---- surgery.c ---------------------------------------------------------------------------- */

/* What a collapse that wh_trial_make has just refused becomes when topology may change. False when
 * it is not possible like this either. */
bool wh_surgery_find(const wh_engine *e, const wh_trial *t, wh_surgery *s);

/* Estimate of the distance between the original surface and the one after it. */
double wh_surgery_distance(const wh_engine *e, const wh_surgery *s);

/* Makes it so; `err` is that distance. What was gathered of a fan before is lost. */
wh_code wh_surgery_perform(wh_engine *e, wh_surgery *s, double err);

/* Calls visit(to, v) for all free vertices v that it has changed, for some more than once. */
void wh_surgery_each(const wh_engine *e, const wh_surgery *s, void (*visit)(wh_engine *, uint32_t),
                     wh_engine *to);

/* The whole part of the surface that the free vertex v is in. False when it has more than
 * WH_SHELL_MOST vertices, or a locked one. */
bool wh_shell_find(const wh_engine *e, uint32_t v, wh_shell *s);
/* ---- blend.c ------------------------------------------------------------------------------ */

/* Gives the vertex that stays the attributes that the surface has in its new place. To be called
 * for a collapse between free vertices before it is made so; a locked vertex keeps its own. */
void wh_blend(const wh_engine *e, const wh_trial *t);
/* The same, made of both ends alone: for collapses that are not worked out whole. */
void wh_blend_ends(const wh_engine *e, wh_trial *t);
/* The same for a corner: `record` are those of the vertex that stays, of the one that goes and of
 * the new neighbours; what the surface has in the new place goes to `to`. */
void wh_blend_corner(const wh_trial *t, const struct wh_attributes *as,
                     const uint8_t *const *record, uint8_t *to);

/* Gives the vertex that stays the attributes of the end that it is put at, or is nearer to. */
void wh_blend_take(const wh_engine *e, const wh_trial *t);

/* ---- blend_cost.c ------------------------------------------------------------------------- */

struct wh_gradients;
void wh_gradients_free(wh_ctx *c, struct wh_gradients *g);

/* What attributes with weights add to costs: to be called when the stars have been made; of the fan
 * that has just been evaluated, whose costs have nothing of it yet; and for each vertex when faces
 * around it, or values at their corners, have changed. */
wh_code wh_blend_begin(wh_engine *e);
void wh_blend_fan(const wh_engine *e);
void wh_blend_changed(wh_engine *e, uint32_t v);

/* What they add to the guess of a free vertex (wh_guess). */
double wh_blend_guess(const wh_engine *e, uint32_t v);

/* Adds to the cost of the fan's edge i how far attributes would be off after its collapse. False
 * when that was done before. */
bool wh_blend_weigh(const wh_engine *e, uint32_t hub, wh_fan *f, uint32_t i);

/* ---- policy.c ----------------------------------------------------------------------------- */

/* Sets the engine's policy and placement. */
void wh_policy_choose(wh_engine *e);

/* Place and cost of the collapse of each edge of the fan that was gathered of `hub`. */
void wh_policy_evaluate(const wh_engine *e, uint32_t hub, wh_fan *f);

/* The cost of the cheapest edge of the free vertex v. The workspace's fan is lost. */
double wh_policy_least(const wh_engine *e, uint32_t v);

/* A run begins, with its stars made and all its faces in the patch. */
wh_code wh_policy_begin(wh_engine *e);

/* A collapse is about to be made. */
void wh_policy_merge(wh_engine *e, const wh_trial *t);

/* True when a collapse may change the costs of more edges than those of the new vertex. */
bool wh_policy_is_wide(const wh_engine *e);

/* ---- wedge.c ------------------------------------------------------------------------------ */

/* All of these are for patches whose faces carry something. */

/* Room, before stars are built. */
wh_code wh_wedges_begin(wh_engine *e);

/* The faces around v, each between a neighbour and the next one in its ring. */
static inline uint32_t *wh_slots(const wh_engine *e, uint32_t v)
{
	const wh_star *s = &e->w->star[v];
	return s->n <= WH_RING_INLINE ? &e->w->slot[(size_t)v * WH_RING_INLINE]
	                              : &e->w->overflow_slot[s->ring[0]];
}

/* The ring of v was set: these are its faces. */
wh_code wh_slots_set(wh_engine *e, uint32_t v, const uint32_t *face);

/* Stars are built: finds the vertices that are on borders. */
void wh_wedges_mark(wh_engine *e);

/* Of a fan that was gathered: edges that may not be collapsed, or only into the other end, and what
 * moving along a border costs. */
void wh_wedges_bar(const wh_engine *e, uint32_t hub, wh_fan *f);

/* What corners will carry after the collapse of edge i. False when that would turn a triangle of
 * the texture over, or make a chart vanish. */
bool wh_wedges_plan(wh_engine *e, uint32_t hub, const wh_fan *f, uint32_t i, const wh_trial *t);

/* Makes it so, with the trial's commit in between. */
void wh_wedges_before(wh_engine *e, const wh_trial *t);
wh_code wh_wedges_after(wh_engine *e, const wh_trial *t);

/* What corners will carry after a change of topology. False when one of its ends is on a border of
 * charts, or a triangle of the texture would turn over. */
bool wh_wedges_plan_surgery(wh_engine *e, const wh_surgery *s, const wh_trial *t);

/* Makes it so, with wh_surgery_perform in between. */
void wh_wedges_before_surgery(wh_engine *e);
wh_code wh_wedges_after_surgery(wh_engine *e, const wh_surgery *s);

/* The faces around v are gone. */
void wh_wedges_drop(wh_engine *e, uint32_t v);

/* Faces that are gone leave the patch. */
void wh_wedges_compact(wh_engine *e);

#endif
