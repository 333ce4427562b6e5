/*
 * plan: what decides the course of a reduction, and what it will need, worked out from counts
 * alone.
 *
 * The decisions (how many clusters, how much a round keeps, where rounds end) are functions of the
 * input's counts and the parameters; the run asks the same functions as the prediction. Memory and
 * threads decide how many clusters are worked on at a time and how large buffers are.
 *
 * Two figures for memory: what a stage may come to hold (need: capacities, an upper bound, what a
 * ceiling is held against) and what it is expected to touch (expect: what peak RSS will be).
 */
#ifndef WH_PIPELINE_PLAN_H
#define WH_PIPELINE_PLAN_H

#include "pipeline/ingest.h"

enum {
	WH_PLAN_BASE = 12 * 1024 * 1024,    /* program, libraries, stacks, small allocations */
	WH_PLAN_REWRITE = 20 * 1024 * 1024, /* a worker that rewrites text or polygons */
	WH_PLAN_ROUNDS_BEFORE_SETTLING = 2, /* with the last one, three different partitions */
	WH_PLAN_SURVEY_FACES = 8 * 1024     /* a piece of a survey */
};

/* The sizes that decide the output's bytes. */
typedef struct wh_plan_sizes {
	uint64_t cluster_faces; /* 0: one cluster */
	uint64_t micro_faces;   /* 0: none */
	uint64_t final_faces;   /* 0: two clusters', but no fewer than 64 Ki */
	double round_keep; /* share of the faces that a round leaves at least; 0: as it comes */
} wh_plan_sizes;

/* ---- decisions ---------------------------------------------------------------------------- */

/* Clusters that so many faces are cut into. */
uint32_t wh_plan_clusters(const wh_plan_sizes *s, uint64_t faces);

/* Share of the cells left of each cut in the first partition (0) and those after it: different
 * ones, so that they cut elsewhere. */
double wh_plan_skew(uint32_t cut);

/* Most faces that the last pass over all may start from. */
uint64_t wh_plan_final_limit(const wh_plan_sizes *s);

/* Share of so many faces that a round keeps when `share` of them is wanted in the end: more, as
 * what it leaves undone the last pass does in the right order, and what it overdoes nobody can
 * undo. */
double wh_plan_keep(const wh_plan_sizes *s, uint64_t faces, double share);
/* The same for the last round before the count is settled. */
double wh_plan_keep_near(double share);
/* The same inside micro-clusters. */
double wh_plan_keep_micro(const wh_plan_sizes *s, double keep);

/* True when there is enough to do for a round to be worth its passes. `share` 0: no count. */
bool wh_plan_round_pays(double share);
/* True when rounds go on after one that left `after` of `before` faces in so many clusters. */
bool wh_plan_go_on(const wh_plan_sizes *s, uint32_t clusters, uint64_t before, uint64_t after,
                   double share);
/* True when the result is settled and streamed cluster by cluster. */
bool wh_plan_streams(const wh_plan_sizes *s, uint32_t clusters, uint64_t faces);

/* ---- prediction --------------------------------------------------------------------------- */

typedef struct wh_plan_query {
	wh_source source;                    /* counts and layout */
	const struct wh_attributes *doubled; /* of the style; NULL: none */
	uint64_t rewrite_bytes; /* temporary copy of a body that cannot be used in place; 0 */
	wh_plan_sizes sizes;
	double share;  /* of the faces, wanted; 0: no count */
	size_t state;  /* bytes that the engine's policy keeps for a vertex */
	size_t memory; /* ceiling */
	int threads;
} wh_plan_query;

typedef enum wh_plan_stage {
	WH_PLAN_INGEST,
	WH_PLAN_ROUND,
	WH_PLAN_RECUT,
	WH_PLAN_SETTLE,
	WH_PLAN_FINAL,
	WH_PLAN_CHECK,
	WH_PLAN_EMIT,
	WH_PLAN_STAGES
} wh_plan_stage;

typedef struct wh_plan {
	uint32_t clusters; /* of the first partition */
	uint32_t windows;  /* that its table of vertices is handled in */
	int rounds;
	int passes; /* over the input */
	bool streams;
	struct {
		size_t need;   /* bytes with one worker; 0: the stage does not run */
		size_t expect; /* bytes touched, with as many workers as fit */
	} stage[WH_PLAN_STAGES];
	size_t least;       /* smallest ceiling that does for all stages, bytes */
	size_t peak_ram;    /* expected peak RSS */
	uint64_t peak_disk; /* of temporary files, expected */
} wh_plan;

/* For the wording of refusals. */
const char *wh_plan_stage_name(wh_plan_stage stage);

/* Fills *p. Where the ceiling is too small, p->least is above it. */
void wh_plan_make(const wh_plan_query *q, wh_plan *p);

#endif
