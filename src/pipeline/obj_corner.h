/*
 * obj_corner: corners of the faces of OBJ, "7", "7/8", "7//9" or "-1/-1/-1", and what a file does
 * with the normals that they refer to.
 */
#ifndef WH_PIPELINE_OBJ_CORNER_H
#define WH_PIPELINE_OBJ_CORNER_H

#include <stdbool.h>
#include <stdint.h>

/* A number as it is written: from 1, or back from the end. 0: there is none. Numbers too large for
 * any file stay too large. */
typedef struct wh_obj_index {
	uint64_t n;
	bool back;
} wh_obj_index;

typedef struct wh_obj_corner {
	wh_obj_index vertex, texcoord, normal;
} wh_obj_corner;

/* The corner at s, which ends in a blank at the latest. False: no such thing. */
bool wh_obj_corner_scan(const char *s, wh_obj_corner *corner);

/* Its place in a list, `before` of whose items are in front of the face. UINT64_MAX: none. */
static inline uint64_t wh_obj_index_id(wh_obj_index i, uint64_t before)
{
	if (i.back)
		return i.n > 0 && i.n <= before ? before - i.n : UINT64_MAX;
	return i.n - 1; /* 0 wraps */
}

/* What corners do with normals. Zero to begin with. */
typedef struct wh_obj_habit {
	bool used;    /* some corner has one */
	bool bare;    /* some has none */
	bool apart;   /* some has another number than its vertex */
	bool varied;  /* some face has more than one */
	bool counted; /* both numbers are counted back, and fit when as many normals more ... */
	int64_t more; /* ... than vertices are in front of the lines that were looked at */
} wh_obj_habit;

/* Adds a corner of a face that began with `first`. vertices, normals: how many there were in the
 * lines that were looked at, before the face. */
void wh_obj_habit_add(wh_obj_habit *h, const wh_obj_corner *corner, const wh_obj_corner *first,
                      uint64_t vertices, uint64_t normals);
/* Adds that of other lines, in front of which there were so many. */
void wh_obj_habit_join(wh_obj_habit *h, const wh_obj_habit *part, uint64_t vertices,
                       uint64_t normals);

/* Whose normals they are. */
typedef enum wh_obj_normals {
	WH_OBJ_NORMALS_UNUSED,
	WH_OBJ_NORMALS_FLAT,        /* each face has one, which its plane tells as well */
	WH_OBJ_NORMALS_OF_VERTICES, /* each vertex has the one of its own number */
	WH_OBJ_NORMALS_OF_CORNERS
} wh_obj_normals;

wh_obj_normals wh_obj_habit_tells(const wh_obj_habit *h);

#endif
