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

/* Is there no step with this neighbour at the other end? */
static bool is_end(const wh_corners *t, const uint32_t *corner, uint32_t n, uint32_t id, bool from)
{
	for (uint32_t i = 0; i < n; i++) {
		const uint32_t c = corner[i];
		if (t->tri[from ? wh_corner_before(c) : wh_corner_after(c)] == id)
			return false;
	}
	return true;
}

wh_path wh_corners_path(const wh_corners *t, const uint32_t *corner, uint32_t n)
{
	uint32_t from = 0, to = 0;
	wh_path p = {WH_NONE, WH_NONE};
	for (uint32_t i = 0; i < n; i++) {
		const uint32_t a = t->tri[wh_corner_after(corner[i])];
		const uint32_t b = t->tri[wh_corner_before(corner[i])];
		if (is_end(t, corner, n, a, true)) {
			p.from = a;
			from++;
		}
		if (is_end(t, corner, n, b, false)) {
			p.to = b;
			to++;
		}
	}
	return (wh_path){from == 1 ? p.from : WH_NONE, to == 1 ? p.to : WH_NONE};
}
