#include "mesh/smooth.h"

#include "mesh/corners.h"

/* The paper's filter with a pass band up to 1/LAMBDA + 1/MU = 0.11: the whole way there and back
 * takes nothing off waves longer than some 20 edges. */
static const double LAMBDA = 0.5, MU = -0.53;

/* ---- what moves --------------------------------------------------------------------------- */

/* Faces of both a and b; a's corners are looked through. */
static uint32_t faces_of_edge(const wh_corners *t, uint32_t a, uint32_t b)
{
	uint32_t n = 0;
	for (uint32_t c = t->head[a]; c != WH_NONE; c = t->next[c])
		n += t->tri[wh_corner_after(c)] == b || t->tri[wh_corner_before(c)] == b;
	return n;
}

/* Vertices move whose edges all have two faces. */
static wh_code find_moving(wh_ctx *c, const wh_mesh *m, bool *moves)
{
	wh_corners t = {.tri = m->tri,
	                .next = wh_alloc(c, 3 * (size_t)m->nf, sizeof *t.next),
	                .head = wh_alloc(c, m->nv, sizeof *t.head)};
	const wh_code code = t.next && t.head ? WH_OK : wh_failed(c);
	if (code == WH_OK)
		wh_corners_fill(&t, m->nv, m->nf);
	for (uint32_t v = 0; code == WH_OK && v < m->nv; v++)
		moves[v] = true;
	for (size_t k = 0; code == WH_OK && k < 3 * (size_t)m->nf; k++) {
		const uint32_t a = m->tri[k], b = m->tri[wh_corner_after((uint32_t)k)];
		if (faces_of_edge(&t, a, b) != 2)
			moves[a] = moves[b] = false;
	}
	wh_free(c, t.next);
	wh_free(c, t.head);
	return code;
}

/* ---- steps -------------------------------------------------------------------------------- */

/* Where a vertex is drawn to. */
typedef struct pull {
	wh_vec3 sum;
	uint32_t n; /* neighbours, each counted with both faces of its edge */
} pull;

/* Every vertex goes a share of the way to the mean of its neighbours. */
static void step(const wh_mesh *m, const bool *moves, double share, pull *of)
{
	for (uint32_t v = 0; v < m->nv; v++)
		of[v] = (pull){{0, 0, 0}, 0};
	for (size_t k = 0; k < 3 * (size_t)m->nf; k++) {
		const uint32_t a = m->tri[k], b = m->tri[wh_corner_after((uint32_t)k)];
		of[a].sum = wh_add(of[a].sum, m->pos[b]);
		of[b].sum = wh_add(of[b].sum, m->pos[a]);
		of[a].n++;
		of[b].n++;
	}
	for (uint32_t v = 0; v < m->nv; v++) {
		if (!moves[v] || of[v].n == 0)
			continue;
		const wh_vec3 mean = wh_scale(of[v].sum, 1.0 / of[v].n);
		m->pos[v] = wh_add(m->pos[v], wh_scale(wh_sub(mean, m->pos[v]), share));
	}
}

size_t wh_smooth_bytes(uint64_t nv, uint64_t nf)
{
	return (size_t)nv * (1 + sizeof(pull) + 4) + (size_t)nf * 12;
}

wh_code wh_smooth(wh_ctx *c, const wh_mesh *m, uint32_t times)
{
	bool *moves = wh_alloc(c, m->nv, sizeof *moves);
	pull *of = wh_alloc(c, m->nv, sizeof *of);
	wh_code code = moves && of ? find_moving(c, m, moves) : wh_failed(c);
	for (uint32_t i = 0; code == WH_OK && i < times; i++) {
		step(m, moves, LAMBDA, of);
		step(m, moves, MU, of);
		code = wh_poll(c);
	}
	wh_free(c, moves);
	wh_free(c, of);
	return code;
}

/* ---- normals ------------------------------------------------------------------------------ */

void wh_mesh_normals(const wh_mesh *m, wh_vec3 *normal)
{
	for (uint32_t v = 0; v < m->nv; v++)
		normal[v] = wh_v3(0, 0, 0);
	for (uint32_t f = 0; f < m->nf; f++) {
		const uint32_t *t = &m->tri[3 * (size_t)f];
		const wh_vec3 area = wh_cross(wh_sub(m->pos[t[1]], m->pos[t[0]]),
		                              wh_sub(m->pos[t[2]], m->pos[t[0]]));
		for (int k = 0; k < 3; k++)
			normal[t[k]] = wh_add(normal[t[k]], area);
	}
	for (uint32_t v = 0; v < m->nv; v++) {
		const double norm = wh_norm(normal[v]);
		normal[v] = wh_scale(normal[v], norm > 0 ? 1 / norm : 0);
	}
}
