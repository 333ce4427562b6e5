/*
 * Idea. Everything that can be wrong with an edge shows in the star of either end, so there is
 * no table of edges: for each vertex the faces around it are listed (counting sort of corners by
 * vertex), and each of them contributes two spokes, one to either other corner. Sorted by far
 * end, equal spokes are one edge and their number is its faces; an edge is counted at its smaller
 * end. Faces of a star that share a spoke are one fan. Sorted by third corner as well, duplicate
 * faces are neighbours.
 *
 * Components are union-find forests over vertices and faces. So are boundary loops, over boundary
 * edges: the two that end a fan follow each other. That needs no orientation and never gets lost;
 * where an edge has three faces, a fan can have more than two ends and they all become one loop.
 * Boundary edges get small numbers through a bit per half-edge and a rank directory.
 *
 * Cost. Time: linear, but for the sort of each star. Memory: 12 bytes a face for the stars, 4 for
 * face components, and per vertex 8 for the directory of stars and 4 for components; the search
 * for coincident vertices takes 16 a vertex, before that. A grid of 10 M faces takes 1.9 s and
 * 23 bytes a face, 5.5 s with its vertices shuffled (one thread of a 2-core server).
 */
#include "mesh/check.h"

#include "base/rng.h"

#include <string.h>

/* ---- union-find: parent[i] == i is a root; the smaller root wins ------------------------------
 */

static void sets_init(uint32_t *parent, uint64_t n)
{
	for (uint64_t i = 0; i < n; i++)
		parent[i] = (uint32_t)i;
}

static uint32_t sets_find(uint32_t *parent, uint32_t i)
{
	while (parent[i] != i) {
		parent[i] = parent[parent[i]];
		i = parent[i];
	}
	return i;
}

/* True when the two were in different sets. */
static bool sets_join(uint32_t *parent, uint32_t a, uint32_t b)
{
	a = sets_find(parent, a);
	b = sets_find(parent, b);
	if (a == b)
		return false;
	if (a < b)
		parent[b] = a;
	else
		parent[a] = b;
	return true;
}

/* ---- bits -------------------------------------------------------------------------------------
 */

static void bit_set(uint64_t *bits, uint64_t i)
{
	bits[i / 64] |= UINT64_C(1) << (i % 64);
}

static bool bit_get(const uint64_t *bits, uint64_t i)
{
	return bits[i / 64] >> (i % 64) & 1;
}

/* ---- state ------------------------------------------------------------------------------------
 */

/* One side of a face of a star, seen from the centre. */
typedef struct spoke {
	uint64_t key;  /* far end, then the face's third corner: what sorting goes by */
	uint32_t slot; /* which face of the star */
	uint32_t out;  /* 1: the face goes from the centre to the far end; 0: the other way */
} spoke;

typedef struct checker {
	wh_ctx *c;
	const wh_mesh *m;
	wh_check *r;

	uint64_t *first;     /* nv + 1: star of v is star[first[v] .. first[v+1]-1] */
	uint32_t *star;      /* face ids */
	uint32_t *face_sets; /* faces joined through edges */

	uint64_t *on_boundary; /* bit per half-edge 3 f + k, from corner k of f to its next */
	uint64_t *ends_open;   /* bit per vertex that has a boundary edge */
	uint64_t *rank;        /* boundary half-edges before each word of on_boundary */
	uint32_t *loop_sets;   /* boundary edges, by rank, joined through fans */

	/* the star being looked at */
	uint32_t degree;
	spoke *spokes;     /* 2 degree, sorted */
	uint32_t *fan;     /* degree: union-find of its faces */
	uint64_t *fan_end; /* degree: first boundary half-edge seen of the fan with this root */
	size_t star_cap;   /* faces these three have room for */
} checker;

static bool is_invalid(const wh_mesh *m, const uint32_t *t)
{
	return t[0] >= m->nv || t[1] >= m->nv || t[2] >= m->nv;
}

static bool is_degenerate(const uint32_t *t)
{
	return t[0] == t[1] || t[1] == t[2] || t[2] == t[0];
}

static bool is_face(const wh_mesh *m, const uint32_t *t)
{
	return !is_invalid(m, t) && !is_degenerate(t);
}

static bool is_finite(wh_vec3 p)
{
	return isfinite(p.x) && isfinite(p.y) && isfinite(p.z);
}

/* ---- faces and vertices one by one --------------------------------------------------------------
 */

static void count_faces(const wh_mesh *m, wh_check *r)
{
	for (uint32_t f = 0; f < m->nf; f++) {
		const uint32_t *t = m->tri + 3 * (size_t)f;
		if (is_invalid(m, t)) {
			r->invalid_faces++;
			continue;
		}
		if (is_degenerate(t)) {
			r->degenerate_faces++;
			continue;
		}
		const wh_vec3 a = m->pos[t[0]];
		const wh_vec3 n = wh_cross(wh_sub(m->pos[t[1]], a), wh_sub(m->pos[t[2]], a));
		if (n.x == 0 && n.y == 0 && n.z == 0)
			r->zero_area_faces++;
		if (is_finite(n))
			r->area += 0.5 * wh_norm(n);
	}
}

static void grow_box(wh_check *r, wh_vec3 p)
{
	r->lo = wh_v3(fmin(r->lo.x, p.x), fmin(r->lo.y, p.y), fmin(r->lo.z, p.z));
	r->hi = wh_v3(fmax(r->hi.x, p.x), fmax(r->hi.y, p.y), fmax(r->hi.z, p.z));
}

static void count_vertices(const checker *k)
{
	wh_check *r = k->r;
	bool any = false;
	for (uint32_t v = 0; v < k->m->nv; v++) {
		const bool finite = is_finite(k->m->pos[v]);
		const bool used = k->first[v] < k->first[v + 1];
		r->nonfinite_vertices += !finite;
		r->referenced_vertices += used;
		if (!used || !finite)
			continue;
		if (!any)
			r->lo = r->hi = k->m->pos[v];
		any = true;
		grow_box(r, k->m->pos[v]);
	}
	r->unreferenced_vertices = r->vertices - r->referenced_vertices;
}

/* ---- coincident vertices
 * -------------------------------------------------------------------------- */

static uint64_t hash_position(wh_vec3 p)
{
	const double xyz[3] = {p.x + 0.0, p.y + 0.0, p.z + 0.0}; /* -0 becomes 0 */
	uint64_t bits[3];
	memcpy(bits, xyz, sizeof bits);
	return wh_mix64(wh_mix64(wh_mix64(bits[0]) ^ bits[1]) ^ bits[2]);
}

static bool same_position(wh_vec3 a, wh_vec3 b)
{
	return a.x == b.x && a.y == b.y && a.z == b.z;
}

/* One pass of a stable radix sort, by 11 of the upper 32 bits. */
static void sort_pass(const uint64_t *from, uint64_t *to, size_t n, int shift)
{
	size_t at[2048] = {0};
	for (size_t i = 0; i < n; i++)
		at[from[i] >> shift & 2047]++;
	size_t sum = 0;
	for (int d = 0; d < 2048; d++) {
		const size_t count = at[d];
		at[d] = sum;
		sum += count;
	}
	for (size_t i = 0; i < n; i++)
		to[at[from[i] >> shift & 2047]++] = from[i];
}

/*
 * Coincident vertices among ids[0 .. n-1] (low halves), whose hashes agree. Nearly always they
 * coincide all or n is 2; so: take the first, strike out its equals, go on with the rest.
 */
static uint64_t count_coincident(const wh_mesh *m, uint64_t *ids, size_t n)
{
	uint64_t duplicates = 0;
	while (n > 1) {
		const wh_vec3 p = m->pos[(uint32_t)ids[0]];
		size_t kept = 0;
		for (size_t i = 1; i < n; i++)
			if (!same_position(p, m->pos[(uint32_t)ids[i]]))
				ids[kept++] = ids[i];
		duplicates += n - 1 - kept;
		n = kept;
	}
	return duplicates;
}

/* Sorts the finite vertices by half of a hash of their position, then compares equals. */
static wh_code count_duplicate_vertices(wh_ctx *c, const wh_mesh *m, wh_check *r)
{
	uint64_t *a = wh_alloc(c, m->nv, sizeof *a);
	uint64_t *b = wh_alloc(c, m->nv, sizeof *b);
	if (!a || !b)
		goto out;
	size_t n = 0;
	for (uint32_t v = 0; v < m->nv; v++)
		if (is_finite(m->pos[v]))
			a[n++] = (hash_position(m->pos[v]) & ~(uint64_t)UINT32_MAX) | v;
	sort_pass(a, b, n, 32);
	sort_pass(b, a, n, 43);
	if (wh_poll(c) != WH_OK)
		goto out;
	sort_pass(a, b, n, 53);
	for (size_t i = 0, end; i < n; i = end) {
		for (end = i + 1; end < n && b[end] >> 32 == b[i] >> 32;)
			end++;
		r->duplicate_vertices += count_coincident(m, b + i, end - i);
	}
out:
	wh_free(c, b);
	wh_free(c, a);
	return c->err.code;
}

/* ---- stars --------------------------------------------------------------------------------------
 */

/* Counting sort of the corners by vertex: star sizes, their sums, then the faces. */
static wh_code build_stars(checker *k)
{
	const wh_mesh *m = k->m;
	k->first = wh_calloc(k->c, (size_t)m->nv + 1, sizeof *k->first);
	k->star = wh_alloc(k->c, m->nf, 3 * sizeof *k->star);
	if (!k->first || !k->star)
		return k->c->err.code;
	for (uint32_t f = 0; f < m->nf; f++) {
		const uint32_t *t = m->tri + 3 * (size_t)f;
		if (wh_poll_at(k->c, f) != WH_OK)
			return k->c->err.code;
		for (int i = 0; i < 3 && is_face(m, t); i++)
			k->first[t[i]]++;
	}
	for (uint64_t v = 1; v <= m->nv; v++)
		k->first[v] += k->first[v - 1]; /* the end of each star, for now */
	for (uint32_t f = m->nf; f-- > 0;) {
		const uint32_t *t = m->tri + 3 * (size_t)f;
		if (wh_poll_at(k->c, f) != WH_OK)
			return k->c->err.code;
		for (int i = 0; i < 3 && is_face(m, t); i++)
			k->star[--k->first[t[i]]] = f;
	}
	return WH_OK;
}

static wh_code reserve_star(checker *k, uint64_t degree)
{
	if (degree <= k->star_cap)
		return WH_OK;
	const size_t cap = (size_t)degree * 2;
	wh_free(k->c, k->spokes);
	wh_free(k->c, k->fan);
	wh_free(k->c, k->fan_end);
	k->spokes = wh_alloc(k->c, cap, 2 * sizeof *k->spokes);
	k->fan = wh_alloc(k->c, cap, sizeof *k->fan);
	k->fan_end = wh_alloc(k->c, cap, sizeof *k->fan_end);
	k->star_cap = cap;
	return k->spokes && k->fan && k->fan_end ? WH_OK : k->c->err.code;
}

/* Shell's sort: an insertion sort for the usual dozen, and tolerable for a hub's million. */
static void sort_spokes(spoke *s, size_t n)
{
	size_t gap = 1;
	while (gap < n / 16)
		gap = 3 * gap + 1;
	for (; gap > 0; gap /= 3) {
		for (size_t i = gap; i < n; i++) {
			const spoke x = s[i];
			size_t j = i;
			for (; j >= gap && s[j - gap].key > x.key; j -= gap)
				s[j] = s[j - gap];
			s[j] = x;
		}
	}
}

static uint64_t spoke_key(uint32_t far_end, uint32_t third)
{
	return (uint64_t)far_end << 32 | third;
}

static uint32_t far_end(const spoke *s)
{
	return (uint32_t)(s->key >> 32);
}

/* Which corner of t is v. */
static uint32_t corner_of(const uint32_t *t, uint32_t v)
{
	return t[0] == v ? 0 : t[1] == v ? 1 : 2;
}

/* Lists and sorts the spokes of v; every face is its own fan. */
static wh_code look_at(checker *k, uint32_t v)
{
	const uint64_t from = k->first[v];
	const uint64_t degree = k->first[v + 1] - from;
	if (reserve_star(k, degree) != WH_OK)
		return k->c->err.code;
	k->degree = (uint32_t)degree;
	for (uint32_t i = 0; i < k->degree; i++) {
		const uint32_t *t = k->m->tri + 3 * (size_t)k->star[from + i];
		const uint32_t at = corner_of(t, v);
		const uint32_t next = t[(at + 1) % 3], prev = t[(at + 2) % 3];
		k->spokes[2 * (size_t)i] = (spoke){spoke_key(next, prev), i, 1};
		k->spokes[2 * (size_t)i + 1] = (spoke){spoke_key(prev, next), i, 0};
	}
	sort_spokes(k->spokes, 2 * (size_t)k->degree);
	sets_init(k->fan, degree);
	return WH_OK;
}

/* Spokes of the same edge as the first of s[0 .. n-1]. */
static size_t edge_run(const spoke *s, size_t n)
{
	size_t run = 1;
	while (run < n && far_end(s + run) == far_end(s))
		run++;
	return run;
}

/* The half-edge of a spoke of v: 3 f + the corner it starts from. */
static uint64_t half_edge(const checker *k, uint32_t v, const spoke *s)
{
	const uint32_t f = k->star[k->first[v] + s->slot];
	const uint32_t at = corner_of(k->m->tri + 3 * (size_t)f, v);
	return 3 * (uint64_t)f + (s->out ? at : (at + 2) % 3);
}

/* ---- edges and fans
 * ------------------------------------------------------------------------------- */

/* Faces of this edge with the same third corner as one before; each counted where v, far end and
 * third are in ascending order, which is once. */
static void count_duplicate_faces(checker *k, uint32_t v, const spoke *s, size_t n)
{
	for (size_t i = 1; i < n; i++)
		if (s[i].key == s[i - 1].key && v < far_end(s) && far_end(s) < (uint32_t)s[i].key)
			k->r->duplicate_faces++;
}

/* An edge with its n faces, seen from its smaller end v. */
static void count_edge(checker *k, uint32_t v, const spoke *s, size_t n)
{
	wh_check *r = k->r;
	r->edges++;
	if (n == 1) {
		r->boundary_edges++;
		bit_set(k->on_boundary, half_edge(k, v, s));
		bit_set(k->ends_open, v);
		bit_set(k->ends_open, far_end(s));
		return;
	}
	r->nonmanifold_edges += n > 2;
	r->misoriented_edges += n == 2 && s[0].out == s[1].out;
	for (size_t i = 1; i < n; i++)
		(void)sets_join(k->face_sets, k->star[k->first[v] + s[0].slot],
		                k->star[k->first[v] + s[i].slot]);
	count_duplicate_faces(k, v, s, n);
}

/* Joins the faces of each edge of the star into fans; returns how many fans there are. */
static uint32_t join_fans(checker *k)
{
	uint32_t fans = k->degree;
	const size_t n = 2 * (size_t)k->degree;
	for (size_t i = 1; i < n; i++)
		if (far_end(k->spokes + i) == far_end(k->spokes + i - 1))
			fans -= sets_join(k->fan, k->spokes[i - 1].slot, k->spokes[i].slot);
	return fans;
}

static void count_star(checker *k, uint32_t v)
{
	const size_t n = 2 * (size_t)k->degree;
	for (size_t i = 0, run; i < n; i += run) {
		run = edge_run(k->spokes + i, n - i);
		if (v < far_end(k->spokes + i))
			count_edge(k, v, k->spokes + i, run);
	}
	k->r->nonmanifold_vertices += join_fans(k) > 1;
}

static wh_code count_edges(checker *k)
{
	for (uint32_t v = 0; v < k->m->nv; v++) {
		if (wh_poll_at(k->c, v) != WH_OK || look_at(k, v) != WH_OK)
			return k->c->err.code;
		count_star(k, v);
	}
	return WH_OK;
}

/* ---- boundary loops
 * ------------------------------------------------------------------------------- */

static size_t boundary_words(const checker *k)
{
	return (size_t)(3 * (uint64_t)k->m->nf / 64 + 1);
}

static void build_rank(checker *k)
{
	uint64_t sum = 0;
	for (size_t w = 0; w < boundary_words(k); w++) {
		k->rank[w] = sum;
		sum += (uint64_t)__builtin_popcountll(k->on_boundary[w]);
	}
}

/* Number of a boundary half-edge among all of them. */
static uint32_t boundary_number(const checker *k, uint64_t h)
{
	const uint64_t below = k->on_boundary[h / 64] & ((UINT64_C(1) << (h % 64)) - 1);
	return (uint32_t)(k->rank[h / 64] + (uint64_t)__builtin_popcountll(below));
}

/* Joins the boundary edges that end the same fan of v. Returns how many joins were news. */
static uint32_t join_fan_ends(checker *k, uint32_t v)
{
	const uint64_t none = UINT64_MAX;
	const size_t n = 2 * (size_t)k->degree;
	uint32_t joined = 0;
	for (uint32_t i = 0; i < k->degree; i++)
		k->fan_end[i] = none;
	for (size_t i = 0, run; i < n; i += run) {
		run = edge_run(k->spokes + i, n - i);
		if (run > 1)
			continue;
		uint64_t *end = k->fan_end + sets_find(k->fan, k->spokes[i].slot);
		const uint64_t h = half_edge(k, v, k->spokes + i);
		if (*end == none)
			*end = h;
		else
			joined += sets_join(k->loop_sets, boundary_number(k, *end),
			                    boundary_number(k, h));
	}
	return joined;
}

static wh_code count_loops(checker *k)
{
	const uint64_t n = k->r->boundary_edges;
	if (n >= WH_NONE)
		return wh_fail(k->c, WH_E_PLAN,
		               "a mesh with 2^32 boundary edges cannot be checked");
	k->rank = wh_alloc(k->c, boundary_words(k), sizeof *k->rank);
	k->loop_sets = wh_alloc(k->c, (size_t)n, sizeof *k->loop_sets);
	if (!k->rank || !k->loop_sets)
		return k->c->err.code;
	build_rank(k);
	sets_init(k->loop_sets, n);
	k->r->boundary_loops = n;
	for (uint32_t v = 0; v < k->m->nv; v++) {
		if (!bit_get(k->ends_open, v))
			continue;
		if (wh_poll_at(k->c, v) != WH_OK || look_at(k, v) != WH_OK)
			return k->c->err.code;
		(void)join_fans(k);
		k->r->boundary_loops -= join_fan_ends(k, v);
	}
	return WH_OK;
}

/* ---- components ---------------------------------------------------------------------------------
 */

/* Trees of the face forest that hold a face. */
static void count_edge_components(checker *k)
{
	for (uint32_t f = 0; f < k->m->nf; f++)
		if (k->face_sets[f] == f && is_face(k->m, k->m->tri + 3 * (size_t)f))
			k->r->edge_components++;
}

/* Every face joins its corners; what was news is one component less. */
static wh_code count_components(checker *k)
{
	const wh_mesh *m = k->m;
	uint32_t *sets = wh_alloc(k->c, m->nv, sizeof *sets);
	if (!sets)
		return k->c->err.code;
	sets_init(sets, m->nv);
	k->r->components = k->r->referenced_vertices;
	for (uint32_t f = 0; f < m->nf && wh_poll_at(k->c, f) == WH_OK; f++) {
		const uint32_t *t = m->tri + 3 * (size_t)f;
		if (!is_face(m, t))
			continue;
		k->r->components -= sets_join(sets, t[0], t[1]);
		k->r->components -= sets_join(sets, t[0], t[2]);
	}
	wh_free(k->c, sets);
	return k->c->err.code;
}

/* ---- the whole
 * ------------------------------------------------------------------------------------ */

static bool is_oriented_manifold(const wh_check *r)
{
	return r->nonmanifold_edges == 0 && r->nonmanifold_vertices == 0 &&
	       r->misoriented_edges == 0;
}

/* Of a component: euler = 2 - 2 genus - loops. Summed over all of them. */
static void derive_topology(wh_check *r)
{
	const uint64_t good = r->faces - r->degenerate_faces - r->invalid_faces;
	r->euler = (int64_t)r->referenced_vertices - (int64_t)r->edges + (int64_t)good;
	r->genus = -1;
	if (is_oriented_manifold(r))
		r->genus = (2 * (int64_t)r->components - (int64_t)r->boundary_loops - r->euler) / 2;
}

static wh_code alloc_tables(checker *k)
{
	k->face_sets = wh_alloc(k->c, k->m->nf, sizeof *k->face_sets);
	k->on_boundary = wh_calloc(k->c, boundary_words(k), sizeof *k->on_boundary);
	k->ends_open = wh_calloc(k->c, (size_t)k->m->nv / 64 + 1, sizeof *k->ends_open);
	if (!k->face_sets || !k->on_boundary || !k->ends_open)
		return k->c->err.code;
	sets_init(k->face_sets, k->m->nf);
	return WH_OK;
}

static void free_tables(checker *k)
{
	wh_free(k->c, k->fan_end);
	wh_free(k->c, k->fan);
	wh_free(k->c, k->spokes);
	wh_free(k->c, k->loop_sets);
	wh_free(k->c, k->rank);
	wh_free(k->c, k->ends_open);
	wh_free(k->c, k->on_boundary);
	wh_free(k->c, k->face_sets);
	wh_free(k->c, k->star);
	wh_free(k->c, k->first);
}

static wh_code check_topology(checker *k)
{
	wh_code code = build_stars(k);
	if (code == WH_OK)
		code = alloc_tables(k);
	if (code != WH_OK)
		return code;
	count_vertices(k);
	code = count_edges(k);
	if (code == WH_OK)
		code = count_loops(k);
	if (code != WH_OK)
		return code;
	count_edge_components(k);
	code = count_components(k);
	if (code == WH_OK)
		derive_topology(k->r);
	return code;
}

wh_code wh_check_mesh(wh_ctx *c, const wh_mesh *m, wh_check *r)
{
	checker k = {.c = c, .m = m, .r = r};
	*r = (wh_check){.vertices = m->nv, .faces = m->nf};
	wh_code code = count_duplicate_vertices(c, m, r);
	if (code != WH_OK)
		return code;
	count_faces(m, r);
	code = wh_poll(c);
	if (code == WH_OK)
		code = check_topology(&k);
	free_tables(&k);
	return code;
}

bool wh_check_clean(const wh_check *r)
{
	return is_oriented_manifold(r) && r->degenerate_faces == 0 && r->invalid_faces == 0 &&
	       r->duplicate_faces == 0;
}
