/*
 * Idea. In a piece the stars of vertices that are not cut are whole: what they have a part in is
 * counted there (check_parts.h). What remains is about cut vertices and edges between two of
 * them; it shows in the faces that have a cut corner. Those of all pieces, put together, are a
 * small mesh, the rim, in which the stars of the cut vertices are whole, and the same code
 * counts the remainder there.
 *
 * Components and boundary loops are sets that grow. A piece counts its own, and hands over which
 * of its rim faces, rim vertices and boundary half-edges belong to the same one. So the rim
 * begins with these joined, and goes on joining; of the components that reach into the rim,
 * it is the rim's count that holds; of loops, what its joins leave. A half-edge with one cut end
 * was counted, and is in a loop, in its piece; the rim goes on from that end.
 *
 * Cost. Of 4 L faces along a cut of L vertices each takes 12 bytes, 12 for its normal, and 4 for
 * its set; of 3 L vertices each takes 21, and a cut one 8 in the table that finds it by its id.
 */
#include "mesh/check_pieces.h"

#include "base/rng.h"
#include "mesh/check_parts.h"
#include "mesh/sets.h"

#include <string.h>

/* A boundary half-edge of the rim that was counted in its piece. */
typedef struct open_edge {
	uint32_t half_edge; /* 3 f + k, f among the rim's faces */
	uint32_t like;      /* the first in the list of the same loop */
} open_edge;

/* Vertices and faces of a piece, or of all, that have to do with cuts. */
typedef struct rim {
	uint32_t nv, nf, nopen;
	uint64_t *gid;
	uint8_t *flag;        /* WH_CUT or 0 */
	uint32_t *vertex_set; /* of a piece: the first vertex of the same component;
	                         of all: a forest */
	uint64_t *set_faces;  /* of components, at any of their vertices */
	uint32_t *tri;
	uint32_t *face_set; /* the same, of components joined by edges */
	float (*normal)[3]; /* of the faces */
	open_edge *open;
	size_t cap_gid, cap_flag, cap_vertex, cap_tri, cap_face, cap_open, cap_size, cap_normal;
} rim;

struct wh_check_workspace {
	wh_check found; /* what is whole in the piece */
	wh_face_sums sums;
	rim rim;
	uint64_t components, edge_components; /* of found, those that reach into the rim */
};

struct wh_check_pieces {
	wh_check found; /* sums */
	wh_face_sums sums;
	rim rim;
	uint64_t components, edge_components; /* sums of what the pieces have in the rim */
	uint32_t *slot; /* hash table: cut vertices of the rim by gid; WH_NONE: empty */
	uint64_t slots; /* a power of two, or 0 */
	uint32_t cuts;  /* vertices in it */
	uint32_t *map;  /* of a piece's rim vertices to all */
	size_t cap_map;
};

enum { MOST_FACES = UINT32_MAX / 3 };

/* ---- lists -------------------------------------------------------------------------------- */

static wh_code rim_reserve(wh_ctx *c, rim *s, uint64_t nv, uint64_t nf, uint64_t nopen)
{
	if (nv >= WH_NONE || nf > MOST_FACES)
		return wh_fail(c, WH_E_PLAN,
		               "the cuts between pieces have too many faces (%llu): use fewer, "
		               "larger pieces",
		               (unsigned long long)nf);
	if (wh_reserve(c, &s->gid, &s->cap_gid, nv, sizeof *s->gid) != WH_OK ||
	    wh_reserve(c, &s->flag, &s->cap_flag, nv, sizeof *s->flag) != WH_OK ||
	    wh_reserve(c, &s->vertex_set, &s->cap_vertex, nv, sizeof *s->vertex_set) != WH_OK ||
	    wh_reserve(c, &s->set_faces, &s->cap_size, nv, sizeof *s->set_faces) != WH_OK ||
	    wh_reserve(c, &s->normal, &s->cap_normal, nf, sizeof *s->normal) != WH_OK ||
	    wh_reserve(c, &s->tri, &s->cap_tri, 3 * nf, sizeof *s->tri) != WH_OK ||
	    wh_reserve(c, &s->face_set, &s->cap_face, nf, sizeof *s->face_set) != WH_OK ||
	    wh_reserve(c, &s->open, &s->cap_open, nopen, sizeof *s->open) != WH_OK)
		return c->err.code;
	return WH_OK;
}

static void rim_free(wh_ctx *c, rim *s)
{
	wh_free(c, s->gid);
	wh_free(c, s->flag);
	wh_free(c, s->vertex_set);
	wh_free(c, s->set_faces);
	wh_free(c, s->normal);
	wh_free(c, s->tri);
	wh_free(c, s->face_set);
	wh_free(c, s->open);
	*s = (rim){0};
}

/* ---- one piece ---------------------------------------------------------------------------- */

/* Scratch while the rim of a piece is taken out of it. */
typedef struct cutter {
	const wh_checker *k;
	const wh_patch *piece;
	rim *s;
	uint32_t *map;   /* the piece's vertices to the rim's */
	uint32_t *first; /* of a set, by its root: the first of the rim's in it, or WH_NONE */
} cutter;

static bool is_cut(const cutter *x, uint32_t v)
{
	return x->piece->flag[v] & WH_CUT;
}

static bool is_rim_face(const cutter *x, uint32_t f)
{
	const uint32_t *t = x->piece->tri + 3 * (size_t)f;
	return wh_checker_is_face(x->k, f) &&
	       (is_cut(x, t[0]) || is_cut(x, t[1]) || is_cut(x, t[2]));
}

static wh_code begin_sets(wh_ctx *c, cutter *x, uint64_t n)
{
	wh_free(c, x->first);
	x->first = wh_alloc(c, (size_t)n, sizeof *x->first);
	if (!x->first)
		return c->err.code;
	memset(x->first, 0xff, (size_t)n * sizeof *x->first);
	return WH_OK;
}

/* The first member of the set with this root; `candidate` when there was none. */
static uint32_t first_of(cutter *x, uint32_t root, uint32_t candidate)
{
	if (x->first[root] == WH_NONE)
		x->first[root] = candidate;
	return x->first[root];
}

/* Marks the corners of rim faces in `map`, and makes room. */
static wh_code mark_rim(wh_ctx *c, cutter *x)
{
	const wh_patch *p = x->piece;
	uint64_t nv = 0, nf = 0;
	x->map = wh_calloc(c, p->nv, sizeof *x->map);
	if (!x->map)
		return c->err.code;
	for (uint32_t f = 0; f < p->nf; f++) {
		if (!is_rim_face(x, f))
			continue;
		nf++;
		for (int i = 0; i < 3; i++)
			x->map[p->tri[3 * (size_t)f + (size_t)i]] = 1;
	}
	for (uint32_t v = 0; v < p->nv; v++)
		nv += x->map[v];
	return rim_reserve(c, x->s, nv, nf, 0);
}

/* Components that do not reach into the rim have their size; of the others it is handed over. */
static void count_sizes(const cutter *x)
{
	rim *s = x->s;
	for (uint32_t i = 0; i < s->nv; i++)
		s->set_faces[i] = 0;
	for (uint32_t v = 0; v < x->piece->nv; v++) {
		if (x->k->vertex_sets[v] != v)
			continue;
		if (x->first[v] == WH_NONE)
			wh_check_add_component(x->k->r, x->k->set_faces[v]);
		else
			s->set_faces[x->first[v]] = x->k->set_faces[v];
	}
}

/* Lists the marked vertices, and tells in how many components they are. */
static wh_code take_vertices(wh_ctx *c, cutter *x, uint64_t *components)
{
	const wh_patch *p = x->piece;
	rim *s = x->s;
	if (begin_sets(c, x, p->nv) != WH_OK)
		return c->err.code;
	s->nv = 0;
	for (uint32_t v = 0; v < p->nv; v++) {
		if (!x->map[v])
			continue;
		const uint32_t root = wh_sets_find(x->k->vertex_sets, v);
		s->gid[s->nv] = p->gid[v];
		s->flag[s->nv] = p->flag[v] & WH_CUT;
		s->vertex_set[s->nv] = first_of(x, root, s->nv);
		x->map[v] = s->nv++;
	}
	*components = wh_sets_count(s->vertex_set, s->nv);
	count_sizes(x);
	return WH_OK;
}

static wh_code take_faces(wh_ctx *c, cutter *x, uint64_t *edge_components)
{
	const wh_patch *p = x->piece;
	rim *s = x->s;
	if (begin_sets(c, x, p->nf) != WH_OK)
		return c->err.code;
	s->nf = 0;
	for (uint32_t f = 0; f < p->nf; f++) {
		if (!is_rim_face(x, f))
			continue;
		for (int i = 0; i < 3; i++)
			s->tri[3 * (size_t)s->nf + (size_t)i] =
			    x->map[p->tri[3 * (size_t)f + (size_t)i]];
		memcpy(s->normal[s->nf], x->k->normal[f], sizeof *s->normal);
		s->face_set[s->nf] = first_of(x, wh_sets_find(x->k->face_sets, f), s->nf);
		s->nf++;
	}
	*edge_components = wh_sets_count(s->face_set, s->nf);
	return WH_OK;
}

/* Half-edge 3 f + i of the piece is on the boundary and has one end, of two, cut. */
static bool is_open_edge(const cutter *x, uint32_t f, uint32_t i)
{
	const uint32_t *t = x->piece->tri + 3 * (size_t)f;
	return wh_bit_get(x->k->on_boundary, 3 * (uint64_t)f + i) &&
	       is_cut(x, t[i]) != is_cut(x, t[(i + 1) % 3]);
}

static wh_code take_open_edge(wh_ctx *c, cutter *x, uint64_t half_edge, uint32_t rim_half_edge)
{
	rim *s = x->s;
	if (wh_reserve(c, &s->open, &s->cap_open, (size_t)s->nopen + 1, sizeof *s->open) != WH_OK)
		return c->err.code;
	const uint32_t number = wh_checker_boundary_number(x->k, half_edge);
	const uint32_t root = wh_sets_find(x->k->loop_sets, number);
	s->open[s->nopen] = (open_edge){rim_half_edge, first_of(x, root, s->nopen)};
	s->nopen++;
	return WH_OK;
}

static wh_code take_open_edges(wh_ctx *c, cutter *x)
{
	rim *s = x->s;
	if (begin_sets(c, x, x->k->boundary_total) != WH_OK)
		return c->err.code;
	s->nopen = 0;
	uint32_t at = 0;
	for (uint32_t f = 0; f < x->piece->nf; f++) {
		if (!is_rim_face(x, f))
			continue;
		for (uint32_t i = 0; i < 3; i++)
			if (is_open_edge(x, f, i) &&
			    take_open_edge(c, x, 3 * (uint64_t)f + i, 3 * at + i) != WH_OK)
				return c->err.code;
		at++;
	}
	return WH_OK;
}

static wh_code take_rim(wh_ctx *c, wh_check_workspace *w, const wh_checker *k,
                        const wh_patch *piece)
{
	cutter x = {.k = k, .piece = piece, .s = &w->rim};
	if (mark_rim(c, &x) == WH_OK && take_vertices(c, &x, &w->components) == WH_OK &&
	    take_faces(c, &x, &w->edge_components) == WH_OK)
		(void)take_open_edges(c, &x);
	wh_free(c, x.first);
	wh_free(c, x.map);
	return c->err.code;
}

wh_code wh_check_look(wh_ctx *c, wh_check_workspace *w, const wh_patch *piece)
{
	w->found = (wh_check){0};
	w->sums = (wh_face_sums){0};
	wh_check_box_begin(&w->found);
	wh_checker k = {.c = c,
	                .nv = piece->nv,
	                .nf = piece->nf,
	                .pos = piece->pos,
	                .tri = piece->tri,
	                .flag = piece->flag,
	                .r = &w->found};
	wh_code code = wh_checker_run(&k, &w->sums);
	if (code == WH_OK)
		code = take_rim(c, w, &k, piece);
	wh_checker_free(&k);
	return code;
}

wh_check_workspace *wh_check_workspace_new(wh_ctx *c)
{
	return wh_calloc(c, 1, sizeof(wh_check_workspace));
}

void wh_check_workspace_free(wh_ctx *c, wh_check_workspace *w)
{
	if (w)
		rim_free(c, &w->rim);
	wh_free(c, w);
}

/* ---- all of them -------------------------------------------------------------------------- */

wh_check_pieces *wh_check_pieces_new(wh_ctx *c)
{
	wh_check_pieces *s = wh_calloc(c, 1, sizeof *s);
	if (s)
		wh_check_box_begin(&s->found);
	return s;
}

void wh_check_pieces_free(wh_ctx *c, wh_check_pieces *s)
{
	if (s) {
		rim_free(c, &s->rim);
		wh_free(c, s->slot);
		wh_free(c, s->map);
	}
	wh_free(c, s);
}

static void add_counts(wh_check *sum, const wh_check *one)
{
	sum->faces += one->faces;
	sum->referenced_vertices += one->referenced_vertices;
	sum->invalid_faces += one->invalid_faces;
	sum->degenerate_faces += one->degenerate_faces;
	sum->zero_area_faces += one->zero_area_faces;
	sum->duplicate_faces += one->duplicate_faces;
	sum->edges += one->edges;
	sum->boundary_edges += one->boundary_edges;
	sum->nonmanifold_edges += one->nonmanifold_edges;
	sum->misoriented_edges += one->misoriented_edges;
	sum->folded_edges += one->folded_edges;
	for (int k = 0; k < WH_COMPONENT_SIZES; k++)
		sum->component_sizes[k] += one->component_sizes[k];
	if (one->largest_component > sum->largest_component)
		sum->largest_component = one->largest_component;
	sum->nonmanifold_vertices += one->nonmanifold_vertices;
	sum->components += one->components;
	sum->edge_components += one->edge_components;
	sum->boundary_loops += one->boundary_loops;
	wh_check_box_join(sum, one);
}

/* Where the cut vertex with this id is, or may be put. */
static uint32_t *slot_of(wh_check_pieces *s, uint64_t gid)
{
	uint64_t i = wh_mix64(gid) & (s->slots - 1);
	while (s->slot[i] != WH_NONE && s->rim.gid[s->slot[i]] != gid)
		i = (i + 1) & (s->slots - 1);
	return s->slot + i;
}

/* Room in the table for `more` cut vertices, leaving a third of it empty. */
static wh_code reserve_slots(wh_ctx *c, wh_check_pieces *s, uint32_t more)
{
	uint64_t slots = s->slots ? s->slots : 1024;
	while (2 * slots < 3 * ((uint64_t)s->cuts + more))
		slots *= 2;
	if (slots == s->slots)
		return WH_OK;
	wh_free(c, s->slot);
	s->slots = 0;
	s->slot = wh_alloc(c, (size_t)slots, sizeof *s->slot);
	if (!s->slot)
		return c->err.code;
	memset(s->slot, 0xff, (size_t)slots * sizeof *s->slot);
	s->slots = slots;
	for (uint32_t v = 0; v < s->rim.nv; v++)
		if (s->rim.flag[v])
			*slot_of(s, s->rim.gid[v]) = v;
	return WH_OK;
}

static uint32_t new_vertex(rim *all, uint64_t gid, uint8_t flag)
{
	const uint32_t v = all->nv++;
	all->gid[v] = gid;
	all->flag[v] = flag;
	all->vertex_set[v] = v;
	all->set_faces[v] = 0;
	return v;
}

static uint32_t cut_vertex(wh_check_pieces *s, uint64_t gid)
{
	uint32_t *at = slot_of(s, gid);
	if (*at == WH_NONE) {
		*at = new_vertex(&s->rim, gid, WH_CUT);
		s->cuts++;
	}
	return *at;
}

static void add_vertices(wh_check_pieces *s, const rim *one)
{
	for (uint32_t v = 0; v < one->nv; v++) {
		s->map[v] =
		    one->flag[v] ? cut_vertex(s, one->gid[v]) : new_vertex(&s->rim, one->gid[v], 0);
		s->rim.set_faces[s->map[v]] += one->set_faces[v];
		/* the first of a component comes before the others */
		(void)wh_sets_join(s->rim.vertex_set, s->map[v], s->map[one->vertex_set[v]]);
	}
}

static void add_faces(wh_check_pieces *s, const rim *one)
{
	rim *all = &s->rim;
	for (uint32_t i = 0; i < one->nopen; i++)
		all->open[all->nopen + i] = (open_edge){one->open[i].half_edge + 3 * all->nf,
		                                        one->open[i].like + all->nopen};
	for (uint32_t f = 0; f < one->nf; f++) {
		all->face_set[all->nf + f] = one->face_set[f] + all->nf;
		memcpy(all->normal[all->nf + f], one->normal[f], sizeof *one->normal);
	}
	for (size_t i = 0; i < 3 * (size_t)one->nf; i++)
		all->tri[3 * (size_t)all->nf + i] = s->map[one->tri[i]];
	all->nf += one->nf;
	all->nopen += one->nopen;
}

wh_code wh_check_pieces_add(wh_ctx *c, wh_check_pieces *s, const wh_check_workspace *w)
{
	const rim *one = &w->rim;
	rim *all = &s->rim;
	if (rim_reserve(c, all, (uint64_t)all->nv + one->nv, (uint64_t)all->nf + one->nf,
	                (uint64_t)all->nopen + one->nopen) != WH_OK ||
	    wh_reserve(c, &s->map, &s->cap_map, one->nv, sizeof *s->map) != WH_OK ||
	    reserve_slots(c, s, one->nv) != WH_OK)
		return c->err.code;
	add_counts(&s->found, &w->found);
	wh_face_sums_join(&s->sums, &w->sums);
	s->components += w->components;
	s->edge_components += w->edge_components;
	add_vertices(s, one);
	add_faces(s, one);
	return WH_OK;
}

/* ---- the rim ----------------------------------------------------------------------------- */

/* The loops that pieces left open: their half-edges are known as boundary, and can be met at
 * their cut ends. */
static void mark_open_edges(wh_checker *k, const rim *s)
{
	for (uint32_t i = 0; i < s->nopen; i++) {
		const uint32_t h = s->open[i].half_edge;
		wh_bit_set(k->on_boundary, h);
		wh_bit_set(k->ends_open, s->tri[h]);
		wh_bit_set(k->ends_open, s->tri[h / 3 * 3 + (h + 1) % 3]);
	}
}

static void join_open_edges(wh_checker *k, const rim *s)
{
	for (uint32_t i = 0; i < s->nopen; i++) {
		const uint32_t like = s->open[s->open[i].like].half_edge;
		(void)wh_sets_join(k->loop_sets,
		                   wh_checker_boundary_number(k, s->open[i].half_edge),
		                   wh_checker_boundary_number(k, like));
	}
}

/* Counts in the rim what no piece could. The face sets change hands: the checker frees them. */
static wh_code count_rim(wh_ctx *c, wh_check_pieces *s, wh_check *r)
{
	rim *all = &s->rim;
	wh_checker k = {.c = c,
	                .nv = all->nv,
	                .nf = all->nf,
	                .tri = all->tri,
	                .flag = all->flag,
	                .rim = true,
	                .normal = all->normal,
	                .face_sets = all->face_set,
	                .r = r};
	all->face_set = NULL;
	all->cap_face = 0;
	wh_code code = wh_checker_stars(&k);
	if (code == WH_OK)
		code = wh_checker_edges(&k);
	if (code == WH_OK) {
		mark_open_edges(&k, all);
		code = wh_checker_number_boundary(&k);
	}
	if (code == WH_OK) {
		join_open_edges(&k, all);
		code = wh_checker_loops(&k);
	}
	if (code == WH_OK)
		r->edge_components = wh_sets_count(k.face_sets, k.nf);
	wh_checker_free(&k);
	return code;
}

/* A root comes before the others of its set. */
static void sum_sizes(rim *s, wh_check *r)
{
	for (uint32_t v = 0; v < s->nv; v++) {
		const uint32_t root = wh_sets_find(s->vertex_set, v);
		if (root != v)
			s->set_faces[root] += s->set_faces[v];
	}
	for (uint32_t v = 0; v < s->nv; v++)
		if (s->vertex_set[v] == v)
			wh_check_add_component(r, s->set_faces[v]);
}

wh_code wh_check_pieces_end(wh_ctx *c, wh_check_pieces *s, wh_check *r)
{
	wh_free(c, s->slot);
	wh_free(c, s->map);
	wh_free(c, s->rim.gid);
	s->slot = s->map = NULL;
	s->rim.gid = NULL;
	wh_check rest = {0};
	wh_check_box_begin(&rest);
	if (count_rim(c, s, &rest) != WH_OK)
		return c->err.code;
	rest.referenced_vertices = s->cuts;
	rest.components = wh_sets_count(s->rim.vertex_set, s->rim.nv);
	sum_sizes(&s->rim, &rest);
	*r = s->found;
	add_counts(r, &rest);
	r->components -= s->components;
	r->edge_components -= s->edge_components;
	wh_check_box_end(r);
	wh_face_sums_end(&s->sums, r);
	r->vertices = r->referenced_vertices;
	wh_check_derive(r);
	return WH_OK;
}

size_t wh_check_piece_bytes(uint64_t nv, uint64_t nf)
{
	const uint64_t open = 3 * nf < 2 * nv ? 3 * nf : 2 * nv; /* boundary edges: no more */
	const uint64_t most = nf > open ? nf : open;
	const uint64_t tables = 12 * nf + 4 * nf + nf + nv / 4 + 4 * open;
	const uint64_t stars = 12 * nf + 8 * nv, rim_part = (28 * nf + 21 * nv) / 8;
	const uint64_t taking = 12 * nv + 4 * (most > nv ? most : nv) + rim_part;
	return (size_t)(tables + (stars > taking ? stars : taking)) + 65536;
}
