/*
 * Copies of a face have the same corners, so ingest sent them to the same cluster: a table of the
 * cluster's faces finds them all. Components are not that local. A cluster joins its vertices into
 * parts; a part with no cut vertex is a component, and the others are joined, by the ids of their
 * cut vertices, in one forest over all of these. What a part counts goes to the root. Only then is
 * it known which parts go, and a second pass finds the same parts again.
 *
 * Sums and sets depend on no order, so any worker may take any cluster. Cost: linear; a few bytes
 * a face and vertex of the clusters at hand, and 60 for each cut vertex.
 */
#include "pipeline/sift.h"

#include "base/idmap.h"
#include "base/rng.h"
#include "geom/vec3.h"
#include "mesh/sets.h"
#include "pipeline/round.h"

#include <string.h>

/* A part of a cluster, or all that was joined with one. */
typedef struct part {
	uint64_t faces, vertices; /* vertices: those not cut */
} part;

/* What one worker needs. */
typedef struct workspace {
	wh_store_workspace load;
	wh_patch patch;
	uint32_t *set;  /* parts: a forest over the vertices */
	part *part;     /* of each root */
	uint32_t *slot; /* table of faces: number + 1 */
	size_t set_cap, part_cap, slot_cap;
	uint32_t *map; /* for a patch that loses vertices */
	size_t map_cap;
	wh_sift_result found;
} workspace;

typedef struct sift {
	const wh_store *from, *to;
	const wh_sift_params *params;
	wh_progress *progress;
	workspace *workspace;
	wh_sift_result *result;
	/* cut vertices, by number */
	wh_idmap number;
	uint32_t *set;
	part *part; /* of roots */
	size_t set_cap, part_cap;
	uint32_t cuts;
	uint64_t faces_out, unreferenced; /* of the second pass */
} sift;

/* ---- one cluster -------------------------------------------------------------------------- */

static void sort_three(uint32_t *t)
{
	for (int pass = 0; pass < 2; pass++)
		for (int i = 0; i < 2; i++)
			if (t[i] > t[i + 1]) {
				const uint32_t swap = t[i];
				t[i] = t[i + 1];
				t[i + 1] = swap;
			}
}

static void corners_of(const wh_patch *p, uint32_t f, uint32_t t[3])
{
	memcpy(t, p->tri + 3 * (size_t)f, 3 * sizeof *t);
	sort_three(t);
}

/* Puts face f into the table; false when one with its corners is there. */
static bool put_face(workspace *ws, size_t mask, const wh_patch *p, uint32_t f, uint32_t as)
{
	uint32_t t[3], other[3];
	corners_of(p, f, t);
	size_t at = wh_mix64(((uint64_t)t[0] << 32 | t[1]) ^ wh_mix64(t[2])) & mask;
	for (; ws->slot[at]; at = (at + 1) & mask) {
		corners_of(p, ws->slot[at] - 1, other);
		if (memcmp(t, other, sizeof t) == 0)
			return false;
	}
	ws->slot[at] = as + 1;
	return true;
}

static size_t table_size(uint64_t faces)
{
	size_t slots = 64;
	while (slots < 2 * faces)
		slots *= 2;
	return slots;
}

/* Face f becomes the one in place `to`, with all that it carries. */
static void move_face(wh_patch *p, uint32_t to, uint32_t f)
{
	memmove(p->tri + 3 * (size_t)to, p->tri + 3 * (size_t)f, 3 * sizeof *p->tri);
	if (p->face_bytes)
		memmove(wh_patch_face(p, to), wh_patch_face(p, f), p->face_bytes);
}

/* Counts the copies, and moves the faces behind them up. */
static wh_code drop_duplicates(wh_ctx *c, workspace *ws, bool drop)
{
	wh_patch *p = &ws->patch;
	const size_t slots = table_size(p->nf);
	uint32_t left = 0;
	if (wh_renew(c, &ws->slot, &ws->slot_cap, slots, sizeof *ws->slot) != WH_OK)
		return c->err.code;
	memset(ws->slot, 0, slots * sizeof *ws->slot);
	for (uint32_t f = 0; f < p->nf; f++) {
		const bool first = put_face(ws, slots - 1, p, f, drop ? left : f);
		ws->found.duplicate_faces += !first;
		if (drop && !first)
			continue;
		move_face(p, left++, f);
	}
	p->nf = left;
	return WH_OK;
}

static void count_zero_areas(workspace *ws)
{
	const wh_patch *p = &ws->patch;
	for (uint32_t f = 0; f < p->nf; f++) {
		const uint32_t *t = p->tri + 3 * (size_t)f;
		const wh_vec3 a = p->pos[t[0]];
		const wh_vec3 n = wh_cross(wh_sub(p->pos[t[1]], a), wh_sub(p->pos[t[2]], a));
		ws->found.zero_area_faces += n.x == 0 && n.y == 0 && n.z == 0;
	}
}

static wh_code find_parts(wh_ctx *c, workspace *ws)
{
	const wh_patch *p = &ws->patch;
	if (wh_reserve(c, &ws->set, &ws->set_cap, p->nv, sizeof *ws->set) != WH_OK ||
	    wh_reserve(c, &ws->part, &ws->part_cap, p->nv, sizeof *ws->part) != WH_OK)
		return c->err.code;
	wh_sets_init(ws->set, p->nv);
	for (uint32_t f = 0; f < p->nf; f++) {
		const uint32_t *t = p->tri + 3 * (size_t)f;
		(void)wh_sets_join(ws->set, t[0], t[1]);
		(void)wh_sets_join(ws->set, t[1], t[2]);
	}
	memset(ws->part, 0, p->nv * sizeof *ws->part);
	for (uint32_t v = 0; v < p->nv; v++)
		ws->part[wh_sets_find(ws->set, v)].vertices += !(p->flag[v] & WH_CUT);
	for (uint32_t f = 0; f < p->nf; f++)
		ws->part[wh_sets_find(ws->set, p->tri[3 * (size_t)f])].faces++;
	return WH_OK;
}

/* Loads a cluster and finds what it is made of. */
static wh_code look(wh_ctx *c, const sift *s, workspace *ws, uint32_t cluster)
{
	ws->found = (wh_sift_result){0};
	if (wh_store_load(c, s->from, cluster, &ws->load, &ws->patch) != WH_OK)
		return c->err.code;
	if (ws->patch.nf == 0)
		return WH_OK;
	count_zero_areas(ws);
	if (drop_duplicates(c, ws, s->params->drop_duplicates) != WH_OK)
		return c->err.code;
	return s->params->min_component ? find_parts(c, ws) : WH_OK;
}

/* ---- the first pass ----------------------------------------------------------------------- */

static wh_code look_job(wh_ctx *c, void *arg, int64_t index, int worker)
{
	const sift *s = arg;
	return look(c, s, &s->workspace[worker], (uint32_t)index);
}

/* The number of a cut vertex. */
static wh_code number_of(wh_ctx *c, sift *s, uint64_t gid, uint32_t *number)
{
	bool fresh;
	uint64_t *at = wh_idmap_put(c, &s->number, gid, &fresh);
	if (!at)
		return c->err.code;
	if (fresh) {
		if (wh_reserve(c, &s->set, &s->set_cap, (size_t)s->cuts + 1, sizeof *s->set) !=
		        WH_OK ||
		    wh_reserve(c, &s->part, &s->part_cap, (size_t)s->cuts + 1, sizeof *s->part) !=
		        WH_OK)
			return c->err.code;
		s->set[s->cuts] = s->cuts;
		s->part[s->cuts] = (part){.vertices = 1};
		*at = s->cuts++;
	}
	*number = (uint32_t)*at;
	return WH_OK;
}

/* Joins two of the cut vertices, and what they count. */
static void join(sift *s, uint32_t a, uint32_t b)
{
	a = wh_sets_find(s->set, a);
	b = wh_sets_find(s->set, b);
	if (!wh_sets_join(s->set, a, b))
		return;
	const uint32_t root = a < b ? a : b, other = a < b ? b : a;
	s->part[root].faces += s->part[other].faces;
	s->part[root].vertices += s->part[other].vertices;
}

/* Each part with cut vertices is handed over; h->slot, a table no more, keeps the number of one of
 * them for each root. */
static wh_code hand_over(wh_ctx *c, sift *s, workspace *ws)
{
	const wh_patch *p = &ws->patch;
	if (wh_renew(c, &ws->slot, &ws->slot_cap, p->nv, sizeof *ws->slot) != WH_OK)
		return c->err.code;
	memset(ws->slot, 0xff, p->nv * sizeof *ws->slot);
	for (uint32_t v = 0; v < p->nv; v++) {
		uint32_t number = 0;
		if (!(p->flag[v] & WH_CUT))
			continue;
		if (number_of(c, s, p->gid[v], &number) != WH_OK)
			return c->err.code;
		const uint32_t root = wh_sets_find(ws->set, v);
		if (ws->slot[root] == WH_NONE) {
			part *to = &s->part[wh_sets_find(s->set, number)];
			to->faces += ws->part[root].faces;
			to->vertices += ws->part[root].vertices;
			ws->slot[root] = number;
		} else {
			join(s, ws->slot[root], number);
		}
	}
	for (uint32_t v = 0; v < p->nv; v++) /* what is whole here */
		if (ws->set[v] == v && ws->slot[v] == WH_NONE &&
		    ws->part[v].faces < s->params->min_component) {
			s->result->small_components++;
			s->result->component_faces += ws->part[v].faces;
			s->result->component_vertices += ws->part[v].vertices;
		}
	return WH_OK;
}

static wh_code look_commit(wh_ctx *c, void *arg, int64_t index, int worker)
{
	(void)index;
	sift *s = arg;
	workspace *ws = &s->workspace[worker];
	wh_progress_add(s->progress, ws->patch.nf);
	s->result->faces += ws->patch.nf;
	s->result->duplicate_faces += ws->found.duplicate_faces;
	s->result->zero_area_faces += ws->found.zero_area_faces;
	return ws->patch.nf && s->params->min_component ? hand_over(c, s, ws) : WH_OK;
}

/* All is joined: parents become roots, so that workers may look without changing anything. */
static void sum_up(sift *s)
{
	for (uint32_t i = 0; i < s->cuts; i++) {
		s->set[i] = wh_sets_find(s->set, i);
		if (s->set[i] != i || s->part[i].faces >= s->params->min_component)
			continue;
		s->result->small_components++;
		s->result->component_faces += s->part[i].faces;
		s->result->component_vertices += s->part[i].vertices;
	}
}

/* ---- the second pass ---------------------------------------------------------------------- */

/* Sets the faces of each root to 0 where its component goes. */
static void judge_parts(const sift *s, workspace *ws)
{
	const wh_patch *p = &ws->patch;
	for (uint32_t v = 0; v < p->nv; v++) {
		if (!(p->flag[v] & WH_CUT))
			continue;
		const uint64_t *number = wh_idmap_get(&s->number, p->gid[v]);
		ws->part[wh_sets_find(ws->set, v)].faces = s->part[s->set[*number]].faces;
	}
	for (uint32_t v = 0; v < p->nv; v++)
		if (ws->set[v] == v && ws->part[v].faces < s->params->min_component)
			ws->part[v].faces = 0;
}

static void drop_parts(const sift *s, workspace *ws)
{
	wh_patch *p = &ws->patch;
	uint32_t left = 0;
	judge_parts(s, ws);
	for (uint32_t f = 0; f < p->nf; f++) {
		const uint32_t *t = p->tri + 3 * (size_t)f;
		if (ws->part[wh_sets_find(ws->set, t[0])].faces > 0)
			move_face(p, left++, f);
	}
	p->nf = left;
}

static wh_code write_job(wh_ctx *c, void *arg, int64_t index, int worker)
{
	const sift *s = arg;
	workspace *ws = &s->workspace[worker];
	if (look(c, s, ws, (uint32_t)index) != WH_OK)
		return c->err.code;
	wh_progress_add(s->progress, ws->patch.nf);
	if (s->params->min_component && ws->patch.nf) {
		drop_parts(s, ws);
		if (wh_reserve(c, &ws->map, &ws->map_cap, ws->patch.nv, sizeof *ws->map) != WH_OK)
			return c->err.code;
		(void)wh_patch_compact(&ws->patch, ws->map);
	}
	return wh_store_save(c, s->to, (uint32_t)index, &ws->patch);
}

static wh_code write_commit(wh_ctx *c, void *arg, int64_t index, int worker)
{
	(void)c;
	(void)index;
	sift *s = arg;
	s->faces_out += s->workspace[worker].patch.nf;
	s->result->unreferenced += s->workspace[worker].load.unreferenced;
	return WH_OK;
}

/* ---- all of it ---------------------------------------------------------------------------- */

size_t wh_sift_bytes(const wh_store *store, uint64_t nv, uint64_t nf)
{
	const size_t table = table_size(nf) * sizeof(uint32_t);
	return wh_store_workspace_bytes(store, nv, nf) +
	       wh_patch_bytes(nv, nf, store->attr_bytes, store->face_bytes) + table +
	       (size_t)nv * (sizeof(part) + 3 * sizeof(uint32_t));
}

static wh_code workspaces_make(wh_ctx *c, sift *s, int workers, uint64_t max_v, uint64_t max_f)
{
	s->workspace = wh_calloc(c, (size_t)workers, sizeof *s->workspace);
	for (int i = 0; s->workspace && i < workers; i++) {
		workspace *ws = &s->workspace[i];
		ws->patch.attr_bytes = s->from->attr_bytes;
		ws->patch.face_bytes = s->from->face_bytes;
		if (wh_store_workspace_fit(c, s->from, &ws->load, max_v, max_f) != WH_OK ||
		    wh_patch_reset(c, &ws->patch, (uint32_t)max_v, (uint32_t)max_f) != WH_OK)
			break;
	}
	return c->err.code;
}

static void close_all(wh_ctx *c, sift *s, int workers)
{
	for (int i = 0; s->workspace && i < workers; i++) {
		workspace *ws = &s->workspace[i];
		wh_store_workspace_free(c, &ws->load);
		wh_patch_free(c, &ws->patch);
		wh_free(c, ws->set);
		wh_free(c, ws->part);
		wh_free(c, ws->slot);
		wh_free(c, ws->map);
	}
	wh_free(c, s->workspace);
	wh_idmap_free(c, &s->number);
	wh_free(c, s->set);
	wh_free(c, s->part);
}

static wh_code run(wh_ctx *c, const wh_exec *ex, sift *s, wh_store *to, bool *changed)
{
	wh_sift_result *r = s->result;
	if (wh_exec_ordered(c, ex, s->from->clusters, look_job, look_commit, s) != WH_OK)
		return c->err.code;
	sum_up(s);
	*changed = r->component_faces > 0 || (s->params->drop_duplicates && r->duplicate_faces > 0);
	if (!*changed)
		return WH_OK;
	wh_progress_phase(s->progress, "sift", r->faces);
	wh_store_lay_out(s->from, to);
	s->to = to;
	if (wh_exec_ordered(c, ex, s->from->clusters, write_job, write_commit, s) != WH_OK)
		return c->err.code;
	r->faces = s->faces_out;
	return WH_OK;
}

wh_code wh_sift(wh_ctx *c, const wh_exec *ex, wh_progress *progress, const wh_store *from,
                const wh_sift_params *params, wh_store *to, bool *changed, wh_sift_result *result)
{
	sift s = {.from = from, .params = params, .progress = progress, .result = result};
	uint64_t max_v, max_f, faces, vertices;
	*result = (wh_sift_result){0};
	*changed = false;
	if (wh_round_extent(c, from, &max_v, &max_f, &faces, &vertices) != WH_OK)
		return c->err.code;
	wh_progress_phase(progress, "sift", faces);
	wh_code code = workspaces_make(c, &s, ex->workers, max_v, max_f);
	if (code == WH_OK)
		code = run(c, ex, &s, to, changed);
	close_all(c, &s, ex->workers);
	return code;
}
