/*
 * What the collapses of a run do to its faces, and which of them have to come before which.
 *
 * A run makes its collapses cluster by cluster and round by round. What one does is found by doing
 * it: the corners of the vertex that goes become the other's, a face that has both is gone.
 *
 * Two collapses can be swapped when neither looks at a face that the other changes. So each face
 * keeps the highest key of the collapses that changed it, and the key of a collapse is its own cost
 * or what the faces around its two ends keep, whichever is highest. Changed are the faces of the
 * vertex that goes; those of the one that stays, where that moves; and in the place of a face that
 * is gone those beside it, between the vertex that stays and the third one. In the order of their
 * keys, equal ones in that of the run, each collapse comes behind all that it depends on and does
 * what it did in the run; and when all up to some key are done, no more is done anywhere than that
 * allows.
 *
 * Faces are known by numbers, which they carry, with their keys, from round to round: no two
 * clusters have the same face, and what is on a cut needs no second thought. The engine writes its
 * faces in an order of its own; they are found again by their corners.
 *
 * Invariants: a face that is gone keeps its corners.
 *
 * Cost: time in proportion to the faces around both ends of all collapses, 36 bytes a vertex and 33
 * a face.
 */
#include "algo/progressive.h"

#include <math.h>

enum { TURN = 3 };

size_t wh_trace_bytes(uint64_t nv, uint64_t nf, uint32_t attr_bytes)
{
	return (size_t)nv * (sizeof(uint64_t) + sizeof(wh_vec3) + 4 + attr_bytes) +
	       (size_t)nf * (24 + sizeof(wh_trace_face)) + (size_t)nf / 8 + 4096;
}

static wh_code impossible(wh_ctx *c)
{
	return wh_fail(c, WH_E_RUN,
	               "a collapse does not fit the mesh that is recorded; please "
	               "report this");
}

/* ---- begin -------------------------------------------------------------------------------- */

static wh_code fit(wh_ctx *c, wh_trace *t, const wh_patch *p)
{
	size_t pos = t->cap_v, gid = t->cap_v, head = t->cap_v;
	size_t tri = t->cap_f, next = t->cap_f, face = t->cap_f, gone = t->cap_f;
	t->cap_v = t->cap_f = 0;
	if (wh_renew(c, &t->gid, &gid, p->nv, sizeof *t->gid) != WH_OK ||
	    wh_renew(c, &t->pos, &pos, p->nv, sizeof *t->pos) != WH_OK ||
	    wh_renew(c, &t->at.head, &head, p->nv, sizeof *t->at.head) != WH_OK ||
	    wh_renew(c, &t->at.tri, &tri, p->nf, 3 * sizeof *t->at.tri) != WH_OK ||
	    wh_renew(c, &t->at.next, &next, p->nf, 3 * sizeof *t->at.next) != WH_OK ||
	    wh_renew(c, &t->face, &face, p->nf, sizeof *t->face) != WH_OK ||
	    wh_renew(c, &t->gone, &gone, p->nf, 1) != WH_OK ||
	    wh_renew(c, &t->attr, &t->cap_attr, (size_t)p->nv * p->attr_bytes, 1) != WH_OK)
		return c->err.code;
	t->cap_v = pos;
	t->cap_f = tri;
	return WH_OK;
}

wh_code wh_trace_begin(wh_ctx *c, wh_trace *t, wh_patch *p, uint32_t first)
{
	if (fit(c, t, p) != WH_OK)
		return c->err.code;
	t->nv = p->nv;
	t->nf = p->nf;
	t->attr_bytes = p->attr_bytes;
	if (p->nf == 0)
		return WH_OK;
	memcpy(t->gid, p->gid, p->nv * sizeof *t->gid);
	memcpy(t->pos, p->pos, p->nv * sizeof *t->pos);
	if (p->attr_bytes)
		memcpy(t->attr, p->attr, (size_t)p->nv * p->attr_bytes);
	memcpy(t->at.tri, p->tri, 3 * (size_t)p->nf * sizeof *p->tri);
	memset(t->gone, 0, p->nf);
	for (uint32_t v = 0; v < p->nv; v++)
		p->gid[v] = v;
	for (uint32_t f = 0; f < p->nf; f++)
		t->face[f] = (wh_trace_face){first + f, 0};
	if (p->face_bytes)
		memcpy(t->face, p->face, p->nf * sizeof *t->face);
	p->face_bytes = 0;
	wh_corners_fill(&t->at, p->nv, p->nf);
	return WH_OK;
}

void wh_trace_free(wh_ctx *c, wh_trace *t)
{
	wh_free(c, t->gid);
	wh_free(c, t->pos);
	wh_free(c, t->attr);
	wh_free(c, t->at.head);
	wh_free(c, t->at.tri);
	wh_free(c, t->at.next);
	wh_free(c, t->face);
	wh_free(c, t->gone);
	*t = (wh_trace){0};
}

/* ---- keys --------------------------------------------------------------------------------- */

/* The highest key around v; corners of faces that are gone leave its list. */
static float key_around(const wh_trace *t, uint32_t v)
{
	uint32_t *link = &t->at.head[v];
	float key = 0;
	for (uint32_t c = *link; c != WH_NONE; c = t->at.next[c]) {
		if (t->gone[c / 3])
			continue;
		key = fmaxf(key, t->face[c / 3].key);
		*link = c;
		link = &t->at.next[c];
	}
	*link = WH_NONE;
	return key;
}

/* Raises the keys of the faces of v, or of those of them that have a, too. How many there are. */
static uint32_t raise(const wh_trace *t, uint32_t v, uint32_t a, float key)
{
	uint32_t n = 0;
	for (uint32_t c = t->at.head[v]; c != WH_NONE; c = t->at.next[c]) {
		if (t->gone[c / 3] || (a != v && t->at.tri[wh_corner_after(c)] != a &&
		                       t->at.tri[wh_corner_before(c)] != a))
			continue;
		t->face[c / 3].key = fmaxf(t->face[c / 3].key, key);
		n++;
	}
	return n;
}

/* The faces beside one that is gone, between v and a; where there are none, all of both. */
static void raise_beside(const wh_trace *t, uint32_t v, uint32_t a, float key)
{
	if (raise(t, v, a, key) > 0)
		return;
	(void)raise(t, v, v, key);
	(void)raise(t, a, a, key);
}

/* ---- a collapse --------------------------------------------------------------------------- */

/* A face of u and v, whose corner c is u's, goes. */
static wh_code bury(wh_ctx *c, const wh_trace *t, uint32_t corner, uint32_t v, wh_trace_step *s)
{
	const uint32_t after = t->at.tri[wh_corner_after(corner)];
	if (s->faces == 2)
		return impossible(c);
	t->gone[corner / 3] = 1;
	s->uv[s->faces] = after == v;
	s->apex[s->faces] = after == v ? t->at.tri[wh_corner_before(corner)] : after;
	s->id[s->faces++] = t->face[corner / 3].id;
	return WH_OK;
}

/* The corners of u become v's; faces with both are gone. */
static wh_code turn_corners(wh_ctx *c, wh_trace *t, uint32_t u, uint32_t v, wh_trace_step *s)
{
	const wh_corners *at = &t->at;
	for (uint32_t k = at->head[u], next; k != WH_NONE; k = next) {
		next = at->next[k];
		if (at->tri[wh_corner_after(k)] == v || at->tri[wh_corner_before(k)] == v) {
			if (bury(c, t, k, v, s) != WH_OK)
				return c->err.code;
			continue;
		}
		if (t->n == WH_PMESH_MOVED)
			return impossible(c);
		t->moved[t->n++] = k;
		t->face[k / 3].key = s->key;
		at->tri[k] = v;
		wh_corners_enter(at, k);
	}
	at->head[u] = WH_NONE;
	return WH_OK;
}

static bool is_first(const wh_trace_step *s, uint32_t i, wh_path path)
{
	return s->uv[i] && s->apex[i] == path.from;
}

static bool is_second(const wh_trace_step *s, uint32_t i, wh_path path)
{
	return !s->uv[i] && s->apex[i] == path.to;
}

static void swap_faces(wh_trace_step *s)
{
	const wh_trace_step was = *s;
	for (int i = 0; i < 2; i++) {
		s->id[i] = was.id[1 - i];
		s->apex[i] = was.apex[1 - i];
		s->uv[i] = was.uv[1 - i];
	}
}

/* How the faces that are gone follow from the path of those that are not. */
static uint32_t way_of(wh_trace_step *s, wh_path path)
{
	if (s->faces == 2 && is_second(s, 0, path) && is_first(s, 1, path))
		swap_faces(s);
	if (s->faces == 2 && is_first(s, 0, path) && is_second(s, 1, path))
		return WH_PMESH_BOTH;
	if (s->faces == 1 && is_first(s, 0, path))
		return WH_PMESH_FIRST;
	if (s->faces == 1 && is_second(s, 0, path))
		return WH_PMESH_SECOND;
	return WH_PMESH_NAMED + s->faces;
}

wh_code wh_trace_collapse(wh_ctx *c, wh_trace *t, uint32_t u, uint32_t v, wh_vec3 x, float cost,
                          wh_trace_step *s)
{
	if (u >= t->nv || v >= t->nv || u == v)
		return impossible(c);
	const wh_vec3 was = t->pos[v];
	*s = (wh_trace_step){.key = fmaxf(cost, fmaxf(key_around(t, u), key_around(t, v)))};
	t->n = 0;
	if (turn_corners(c, t, u, v, s) != WH_OK)
		return c->err.code;
	if (x.x != was.x || x.y != was.y || x.z != was.z)
		(void)raise(t, v, v, s->key);
	t->pos[v] = x;
	for (uint32_t i = 0; i < s->faces; i++)
		raise_beside(t, v, s->apex[i], s->key);
	s->way = way_of(s, wh_corners_path(&t->at, t->moved, t->n));
	for (uint32_t i = 0; i < s->faces; i++)
		s->apex[i] = (uint32_t)t->gid[s->apex[i]];
	return WH_OK;
}

/* ---- end ---------------------------------------------------------------------------------- */

/* The corner of a face that is left with these vertices, which then is found. WH_NONE: none. */
static uint32_t find_face(const wh_trace *t, const uint64_t v[3])
{
	for (uint32_t c = t->at.head[v[0]]; c != WH_NONE; c = t->at.next[c])
		if (!t->gone[c / 3] && t->at.tri[wh_corner_after(c)] == v[1] &&
		    t->at.tri[wh_corner_before(c)] == v[2]) {
			t->gone[c / 3] = 1;
			return c;
		}
	return WH_NONE;
}

static wh_code hand_over(wh_ctx *c, const wh_trace *t, const wh_patch *p)
{
	for (uint32_t f = 0; f < p->nf; f++) {
		const uint32_t *at = &p->tri[(size_t)TURN * f];
		const uint64_t v[3] = {p->gid[at[0]], p->gid[at[1]], p->gid[at[2]]};
		const uint32_t found = find_face(t, v);
		if (found == WH_NONE)
			return impossible(c);
		memcpy(wh_patch_face(p, f), &t->face[found / 3], sizeof *t->face);
	}
	return WH_OK;
}

wh_code wh_trace_end(wh_ctx *c, const wh_trace *t, wh_patch *p)
{
	p->face_bytes = sizeof *t->face;
	if (wh_reserve(c, &p->face, &p->cap_face, (size_t)p->nf * p->face_bytes, 1) != WH_OK ||
	    hand_over(c, t, p) != WH_OK)
		return c->err.code;
	for (uint32_t v = 0; v < p->nv; v++)
		p->gid[v] = t->gid[p->gid[v]];
	return WH_OK;
}
