#include "algo/compare_band.h"

#include "algo/compare.h"

#include <string.h>

enum { CHUNK = 4096 }; /* points of one job */

typedef struct finder {
	const wh_bvh *t;
	const wh_frame *f;
	const wh_vec3 *points;
	uint64_t n;
	uint32_t *nearest; /* face of each point */
} finder;

static wh_code find_job(wh_ctx *c, void *arg, int64_t index, int worker)
{
	const finder *s = arg;
	const uint64_t first = (uint64_t)index * CHUNK;
	const uint64_t end = s->n - first < CHUNK ? s->n : first + CHUNK;
	uint32_t hint = WH_NONE;
	(void)c;
	(void)worker;
	for (uint64_t i = first; i < end; i++) {
		(void)wh_bvh_dist2(s->t, wh_frame_local(s->f, s->points[i]), &hint);
		s->nearest[i] = hint;
	}
	return WH_OK;
}

/* Adds the faces that share a vertex with one of the band. `touched`: a byte a vertex. */
static void widen(const wh_mesh *m, uint8_t *band, uint8_t *touched)
{
	for (size_t i = 0; i < 3 * (size_t)m->nf; i++)
		if (band[i / 3])
			touched[m->tri[i]] = 1;
	for (size_t i = 0; i < 3 * (size_t)m->nf; i++)
		if (touched[m->tri[i]])
			band[i / 3] = 1;
}

wh_code wh_compare_band(wh_ctx *c, const wh_exec *ex, const wh_bvh *t, const wh_frame *f,
                        const wh_vec3 *points, uint64_t n, uint8_t *band)
{
	finder s = {.t = t,
	            .f = f,
	            .points = points,
	            .n = n,
	            .nearest = wh_alloc(c, (size_t)n, sizeof *s.nearest)};
	uint8_t *touched = wh_calloc(c, t->mesh.nv, 1);
	wh_code code = c->err.code;
	if (code == WH_OK)
		code = wh_exec_for(c, ex, (int64_t)((n + CHUNK - 1) / CHUNK), find_job, &s);
	if (code == WH_OK) {
		memset(band, 0, t->mesh.nf);
		for (uint64_t i = 0; i < n; i++)
			band[s.nearest[i]] = 1;
		for (int ring = 0; ring < WH_BAND_RINGS; ring++)
			widen(&t->mesh, band, touched);
	}
	wh_free(c, touched);
	wh_free(c, s.nearest);
	return code;
}
