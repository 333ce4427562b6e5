/*
 * simplify: reduces one patch by edge collapses in near-greedy order, in place.
 *
 * Serial and reentrant: parallelism is many of these, each with its own workspace. The result
 * depends on the patch and the parameters alone.
 */
#ifndef WH_ALGO_SIMPLIFY_H
#define WH_ALGO_SIMPLIFY_H

#include "algo/policy.h"
#include "mesh/collapse.h"

struct wh_attributes;
struct wh_wedges;

/* Log of a run: sixteen bins of cost to every power of two, over all doubles >= 0. */
enum { WH_LOG_MANTISSA = 4, WH_LOG_BINS = 2048 << WH_LOG_MANTISSA };

typedef struct wh_cost_log {
	uint32_t collapses[WH_LOG_BINS];
	uint32_t faces[WH_LOG_BINS]; /* that they took away */
} wh_cost_log;

/* Changes of topology. */
typedef enum wh_topology {
	WH_SHELL,  /* a part that was removed */
	WH_HOLE,   /* a boundary loop that was closed */
	WH_NECK,   /* a cut along a triangle: a handle that is gone, or one part that is two */
	WH_BRIDGE, /* a cut along an edge between two boundary vertices */
	WH_TOPOLOGIES
} wh_topology;

typedef struct wh_simplify_params {
	uint32_t target_faces;               /* stop at or below this many faces; 0: no limit */
	uint32_t target_vertices;            /* stop at or below this many vertices; 0: no limit */
	uint64_t most_faces, most_collapses; /* stop before more faces are taken than this, or after
	                                        so many collapses; 0: no limit */
	double max_cost;                     /* no collapse above this cost; INFINITY: no limit */
	double max_err;       /* no collapse whose accumulated distance exceeds this; INFINITY */
	bool fast;            /* a looser order, for fewer evaluations, and more regular faces */
	bool lock_boundary;   /* vertices on boundary edges stay as they are */
	bool float_positions; /* new positions are rounded to float */
	double step; /* a power of two: new positions are whole steps away from an old one, so that
	                moving the mesh does not round them anew; 0: as they come */
	bool free_topology; /* where a collapse would change the topology by less than the error of
	                       the moment it may, where there is no sink */
	bool insist; /* a last pass: out of candidates, look at all edges again while that helps,
	                and let faces turn over in the end; the last vertices are taken in exact
	                order */
	bool no_overshoot; /* where only one face is left to go and no boundary edge to take it,
	                      stop one above the target instead of one below */
	wh_cost_log *log;  /* is added to; NULL: no log */
	bool log_in_order; /* a collapse counts at the highest cost so far, not at its own: the
	                      collapses below a bin are the first ones of the run */
	const wh_collapse_sink *sink; /* gets every collapse; NULL: nobody */
	bool track_err; /* accumulated distances are worked out even where max_err allows any */
	const struct wh_attributes *attributes; /* what the patch's records hold; NULL: nothing */
	const struct wh_wedges
	    *wedges;           /* what the records of the patch's faces hold; NULL: nothing */
	double attribute_unit; /* an attribute that is off by 1 with a weight of 1 costs as much as
	                          a surface that is off by this distance */
	wh_policy_choice policy; /* other costs and places: they go neither with weights of
	                            attributes nor, but for the memoryless cost, with
	                            free_topology */
} wh_simplify_params;

typedef struct wh_simplify_result {
	uint64_t collapses;
	int64_t vertices;                /* that are gone; a neck adds one */
	uint64_t changes[WH_TOPOLOGIES]; /* of topology, of each kind */
	double highest_cost;             /* of the collapses done */
	double highest_err;              /* accumulated distance bound of the worst vertex made */
	double cost_distance; /* the highest cost as a distance: sqrt(cost / weight of its faces) */
	bool exhausted;       /* stopped because no legal collapse was left within the limits */
	uint32_t fixed;       /* non-manifold vertices found and kept */
	uint32_t border;      /* boundary vertices found at the start */
} wh_simplify_result;

/* Adds a collapse: its cost, the weight of the faces that it is the sum over, and the accumulated
 * distance of the vertex made. */
void wh_simplify_result_note(wh_simplify_result *r, double cost, double weight, double err);

/* Adds what another run did: sums and extremes. `exhausted`, `fixed` and `border` stay. */
void wh_simplify_result_add(wh_simplify_result *sum, const wh_simplify_result *one);

typedef struct wh_simplify_workspace wh_simplify_workspace;

/* A workspace, to be reused for any number of patches by one thread at a time. */
wh_simplify_workspace *wh_simplify_workspace_new(wh_ctx *c);
void wh_simplify_workspace_free(wh_ctx *c, wh_simplify_workspace *w);

/* Bytes of workspace that a patch of these counts takes, the patch itself not included; without
 * those of a policy (wh_policy_bytes). */
size_t wh_simplify_bytes(uint64_t nv, uint64_t nf, uint32_t face_bytes);
/* What attributes with weights add to that for each vertex. */
size_t wh_simplify_attribute_bytes(const struct wh_attributes *as);

/*
 * Reduces p. Cut and fixed vertices stay; vertices on non-manifold or inconsistently oriented
 * edges, and those whose faces form more than one fan, are found here and fixed. Surviving
 * vertices keep their order, their gid and their flags; p's arrays are compacted.
 *
 * Topology: an edge is collapsed only when the link condition holds (Dey, Edelsbrunner, Guha,
 * Nekhayev 1999), so components, handles and boundary loops stay, unless `free_topology`; a
 * manifold stays one even then. A vertex is collapsed into a
 * locked one only if this makes no edge or face between locked vertices, which another piece
 * could make too.
 *
 * On failure (memory, interruption) p is unusable but can be freed.
 */
wh_code wh_simplify(wh_ctx *c, wh_simplify_workspace *w, wh_patch *p,
                    const wh_simplify_params *params, wh_simplify_result *result);

/* Upper end of a bin of the log, as a cost. */
double wh_log_cost(uint32_t bin);

#endif
