#include "mesh/collapse.h"

void wh_redo_begin(const wh_patch *p, uint32_t *into)
{
	for (uint32_t v = 0; v < p->nv; v++)
		into[v] = v;
}

/* Where a vertex has gone in the end. The way there is halved for the next who asks. */
static uint32_t end_of(uint32_t *into, uint32_t v)
{
	while (into[v] != v) {
		into[v] = into[into[v]];
		v = into[v];
	}
	return v;
}

void wh_redo_end(wh_patch *p, uint32_t *into)
{
	uint32_t *to = p->tri;
	for (uint32_t f = 0; f < p->nf; f++) {
		const uint32_t *t = &p->tri[3 * (size_t)f];
		const uint32_t a = end_of(into, t[0]), b = end_of(into, t[1]),
		               d = end_of(into, t[2]);
		if (a == b || b == d || d == a)
			continue;
		*to++ = a;
		*to++ = b;
		*to++ = d;
	}
	p->nf = (uint32_t)((size_t)(to - p->tri) / 3);
	(void)wh_patch_compact(p, into);
}
