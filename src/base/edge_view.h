/* edge_view: what a caller's own policy of collapses is told, and what it answers (whittle.h). */
#ifndef WH_BASE_EDGE_VIEW_H
#define WH_BASE_EDGE_VIEW_H

#include <stdbool.h>
#include <stdint.h>

/* An edge that may be collapsed. `origin` is the first end, in the file's units; everything else is
 * relative to it, so the first end itself is 0, 0, 0. */
typedef struct wh_edge_view {
	double origin[3];
	double second[3]; /* the other end */
	bool locked;   /* the second end stays where it is, and with it the new vertex; only faces
	                  of the first end are known */
	bool boundary; /* a boundary edge */
	bool first_open, second_open; /* the ends are on the boundary */
	uint32_t faces;               /* around both ends: */
	uint32_t shared;              /* the first ones are on the edge, one or two, and vanish; */
	uint32_t of_first;            /* then come so many that only the first end has; the rest are
	                                 the second's */
	const double (*face)[3][3];   /* their corners, counter-clockwise */
} wh_edge_view;

typedef struct wh_own_policy {
	/*
	 * What the collapse of the edge costs: the cheapest goes first. 0 or more, in any unit;
	 * infinite: not this one; a NaN is taken as that. `place` holds where the placement would
	 * put the new vertex, and may be changed unless the second end is locked. Called by several
	 * threads at once, and again whenever something around the edge has changed: the answer has
	 * to follow from the view alone, or else the result may depend on the number of threads.
	 */
	double (*cost)(void *user, const wh_edge_view *edge, double place[3]);
	void *user;
	const char *name; /* for the report, and to tell whether a resumed run goes on with the
	                     same policy */
} wh_own_policy;

#endif
