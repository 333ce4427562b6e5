#include "mesh/corners.h"

void wh_corners_move(const wh_corners *t, uint32_t v, uint32_t u, const uint32_t *corner,
                     uint32_t n)
{
	uint32_t *kept = &t->head[v], *moved = &t->head[u];
	uint32_t c = t->head[v];
	for (uint32_t i = 0; i < n; c = t->next[c]) {
		if (c != corner[i]) {
			*kept = c;
			kept = &t->next[c];
			continue;
		}
		*moved = c;
		moved = &t->next[c];
		t->tri[c] = u;
		i++;
	}
	*kept = c; /* all behind the last one stay */
	*moved = WH_NONE;
}

/* The only one of n ids that is not among n others; WH_NONE: there are more, or none. */
static uint32_t only_one(const uint32_t *id, const uint32_t *others, uint32_t n)
{
	uint32_t found = WH_NONE, count = 0;
	for (uint32_t i = 0; i < n; i++) {
		uint32_t k = 0;
		while (k < n && others[k] != id[i])
			k++;
		if (k < n)
			continue;
		found = id[i];
		count++;
	}
	return count == 1 ? found : WH_NONE;
}

wh_path wh_corners_path(const wh_corners *t, const uint32_t *corner, uint32_t n)
{
	uint32_t behind[WH_CORNERS_FAN], before[WH_CORNERS_FAN];
	for (uint32_t i = 0; i < n; i++) {
		behind[i] = t->tri[wh_corner_after(corner[i])];
		before[i] = t->tri[wh_corner_before(corner[i])];
	}
	return (wh_path){only_one(behind, before, n), only_one(before, behind, n)};
}
