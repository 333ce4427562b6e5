/*
 * Idea. Everything that can be wrong with an edge shows in the star of either end, so there is
 * no table of edges: for each vertex the faces around it are listed (counting sort of corners by
 * vertex), and each of them contributes two spokes, one to either other corner. Sorted by far
 * end, equal spokes are one edge and their number is its faces. Faces of a star that share a
 * spoke are one fan. Sorted by third corner as well, duplicate faces are neighbours.
 *
 * An edge is counted at its smaller end among those whose stars are whole, a duplicate face at
 * its smallest corner.
 *
 * Components are union-find forests over vertices and faces. So are boundary loops, over boundary
 * edges: the two that end a fan follow each other. That needs no orientation and never gets lost;
 * where an edge has three faces, a fan can have more than two ends and they all become one loop.
 * Boundary edges get small numbers through a bit per half-edge and a rank directory.
 *
 * Cost. Time: linear, but for the sort of each star. Memory: 12 bytes a face for the stars, 12 for
 * normals, 4 for face components, and per vertex 8 for the directory of stars; later 8 a vertex for
 * components.
 */
#include "mesh/check_parts.h"

#include "geom/tri.h"
#include "mesh/patch.h"
#include "mesh/sets.h"

#include <math.h>

#define COS_10 0.98480775301220806 /* of 10 degrees */

static bool is_invalid(const wh_checker *k, const uint32_t *t)
{
	return t[0] >= k->nv || t[1] >= k->nv || t[2] >= k->nv;
}

static bool is_degenerate(const uint32_t *t)
{
	return t[0] == t[1] || t[1] == t[2] || t[2] == t[0];
}

bool wh_checker_is_face(const wh_checker *k, uint32_t f)
{
	const uint32_t *t = k->tri + 3 * (size_t)f;
	return !is_invalid(k, t) && !is_degenerate(t);
}

/* The star of v is whole here. */
static bool is_whole(const wh_checker *k, uint32_t v)
{
	return !k->flag || ((k->flag[v] & WH_CUT) != 0) == k->rim;
}

/* What v, whose star is whole, shares with w is counted here and at v, as far as w goes. */
static bool counts_at(const wh_checker *k, uint32_t v, uint32_t w)
{
	return is_whole(k, w) ? v < w : !k->rim;
}

static bool is_finite(wh_vec3 p)
{
	return isfinite(p.x) && isfinite(p.y) && isfinite(p.z);
}

/* ---- faces and vertices one by one -------------------------------------------------------- */

/* The direction of a normal; floats, so that it takes little room. */
static void find_normal(const wh_checker *k, uint32_t f, const uint32_t *t)
{
	const wh_vec3 n = wh_tri_direction(k->pos[t[0]], k->pos[t[1]], k->pos[t[2]]);
	k->normal[f][0] = (float)n.x;
	k->normal[f][1] = (float)n.y;
	k->normal[f][2] = (float)n.z;
}

static void count_face(const wh_checker *k, uint32_t f, const uint32_t *t, wh_face_sums *sums)
{
	const wh_vec3 a = k->pos[t[0]], b = k->pos[t[1]], c = k->pos[t[2]];
	const wh_vec3 n = wh_cross(wh_sub(b, a), wh_sub(c, a));
	if (n.x == 0 && n.y == 0 && n.z == 0)
		k->r->zero_area_faces++;
	if (is_finite(n))
		wh_exact_add(&sums->area, 0.5 * wh_norm(n));
	if (is_finite(a) && is_finite(b) && is_finite(c)) {
		const double ratio = wh_tri_radius_ratio(a, b, c);
		wh_exact_add(&sums->ratio, ratio);
		sums->bins[(int)(ratio * WH_RATIO_BINS)]++;
	}
	find_normal(k, f, t);
	for (int i = 0; i < 3; i++)
		wh_bit_set(k->used, t[i]);
}

static wh_code count_faces(wh_checker *k, wh_face_sums *sums)
{
	k->used = wh_calloc(k->c, (size_t)k->nv / 64 + 1, sizeof *k->used);
	k->normal = wh_alloc(k->c, k->nf, sizeof *k->normal);
	if (!k->used || !k->normal)
		return k->c->err.code;
	k->r->faces += k->nf;
	for (uint32_t f = 0; f < k->nf; f++) {
		const uint32_t *t = k->tri + 3 * (size_t)f;
		if (is_invalid(k, t))
			k->r->invalid_faces++;
		else if (is_degenerate(t))
			k->r->degenerate_faces++;
		else
			count_face(k, f, t, sums);
	}
	return WH_OK;
}

void wh_face_sums_join(wh_face_sums *sum, const wh_face_sums *part)
{
	wh_exact_join(&sum->area, &part->area);
	wh_exact_join(&sum->ratio, &part->ratio);
	for (int i = 0; i <= WH_RATIO_BINS; i++)
		sum->bins[i] += part->bins[i];
}

/* The lower end of the bin in which one face in 20 has been seen. */
static double fifth_percentile(const uint64_t *bins, uint64_t faces)
{
	uint64_t seen = 0;
	for (int i = 0; i <= WH_RATIO_BINS; i++) {
		seen += bins[i];
		if (seen > 0 && 20 * seen >= faces)
			return (double)i / WH_RATIO_BINS;
	}
	return 0;
}

void wh_face_sums_end(const wh_face_sums *sum, wh_check *r)
{
	uint64_t faces = 0;
	for (int i = 0; i <= WH_RATIO_BINS; i++)
		faces += sum->bins[i];
	for (int i = 0; i <= WH_RATIO_BINS; i++) {
		const int part = i * WH_RADIUS_RATIOS / WH_RATIO_BINS;
		r->radius_ratios[part < WH_RADIUS_RATIOS ? part : WH_RADIUS_RATIOS - 1] +=
		    sum->bins[i];
	}
	r->area = wh_exact_value(&sum->area);
	r->radius_ratio_mean = faces ? wh_exact_value(&sum->ratio) / (double)faces : 0;
	r->radius_ratio_p5 = fifth_percentile(sum->bins, faces);
}

void wh_check_box_begin(wh_check *r)
{
	r->lo = wh_v3(INFINITY, INFINITY, INFINITY);
	r->hi = wh_v3(-INFINITY, -INFINITY, -INFINITY);
}

void wh_check_box_end(wh_check *r)
{
	if (!(r->lo.x <= r->hi.x))
		r->lo = r->hi = wh_v3(0, 0, 0);
}

void wh_check_box_join(wh_check *r, const wh_check *other)
{
	r->lo = wh_lower(r->lo, other->lo);
	r->hi = wh_upper(r->hi, other->hi);
}

static void grow_box(wh_check *r, wh_vec3 p)
{
	r->lo = wh_lower(r->lo, p);
	r->hi = wh_upper(r->hi, p);
}

static void count_vertices(wh_checker *k)
{
	for (uint32_t v = 0; v < k->nv; v++) {
		if (!wh_bit_get(k->used, v))
			continue;
		k->r->referenced_vertices += is_whole(k, v);
		if (is_finite(k->pos[v]))
			grow_box(k->r, k->pos[v]);
	}
}

/* ---- stars -------------------------------------------------------------------------------- */

static size_t boundary_words(const wh_checker *k)
{
	return (size_t)(3 * (uint64_t)k->nf / 64 + 1);
}

static wh_code alloc_tables(wh_checker *k)
{
	k->first = wh_calloc(k->c, (size_t)k->nv + 1, sizeof *k->first);
	k->on_boundary = wh_calloc(k->c, boundary_words(k), sizeof *k->on_boundary);
	k->ends_open = wh_calloc(k->c, (size_t)k->nv / 64 + 1, sizeof *k->ends_open);
	if (k->face_sets)
		return k->c->err.code;
	k->face_sets = wh_alloc(k->c, k->nf, sizeof *k->face_sets);
	if (k->face_sets)
		wh_sets_init(k->face_sets, k->nf);
	return k->c->err.code;
}

/* Counting sort of the corners by vertex: star sizes, their sums, then the faces. */
wh_code wh_checker_stars(wh_checker *k)
{
	if (alloc_tables(k) != WH_OK)
		return k->c->err.code;
	for (uint32_t f = 0; f < k->nf; f++) {
		const uint32_t *t = k->tri + 3 * (size_t)f;
		for (int i = 0; i < 3 && wh_checker_is_face(k, f); i++)
			k->first[t[i]] += is_whole(k, t[i]);
	}
	for (uint64_t v = 1; v <= k->nv; v++)
		k->first[v] += k->first[v - 1]; /* the end of each star, for now */
	k->star = wh_alloc(k->c, (size_t)k->first[k->nv], sizeof *k->star);
	if (!k->star)
		return k->c->err.code;
	for (uint32_t f = k->nf; f-- > 0;) {
		const uint32_t *t = k->tri + 3 * (size_t)f;
		for (int i = 0; i < 3 && wh_checker_is_face(k, f); i++)
			if (is_whole(k, t[i]))
				k->star[--k->first[t[i]]] = f;
	}
	return WH_OK;
}

static wh_code reserve_star(wh_checker *k, uint64_t degree)
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
static void sort_spokes(wh_spoke *s, size_t n)
{
	size_t gap = 1;
	while (gap < n / 16)
		gap = 3 * gap + 1;
	for (; gap > 0; gap /= 3) {
		for (size_t i = gap; i < n; i++) {
			const wh_spoke x = s[i];
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

static uint32_t far_end(const wh_spoke *s)
{
	return (uint32_t)(s->key >> 32);
}

static uint32_t third_corner(const wh_spoke *s)
{
	return (uint32_t)s->key;
}

/* Which corner of t is v. */
static uint32_t corner_of(const uint32_t *t, uint32_t v)
{
	return t[0] == v ? 0 : t[1] == v ? 1 : 2;
}

/* Lists and sorts the spokes of v; every face is its own fan. */
static wh_code look_at(wh_checker *k, uint32_t v)
{
	const uint64_t from = k->first[v];
	const uint64_t degree = k->first[v + 1] - from;
	if (reserve_star(k, degree) != WH_OK)
		return k->c->err.code;
	k->degree = (uint32_t)degree;
	for (uint32_t i = 0; i < k->degree; i++) {
		const uint32_t *t = k->tri + 3 * (size_t)k->star[from + i];
		const uint32_t at = corner_of(t, v);
		const uint32_t next = t[(at + 1) % 3], prev = t[(at + 2) % 3];
		k->spokes[2 * (size_t)i] = (wh_spoke){spoke_key(next, prev), i, 1};
		k->spokes[2 * (size_t)i + 1] = (wh_spoke){spoke_key(prev, next), i, 0};
	}
	sort_spokes(k->spokes, 2 * (size_t)k->degree);
	wh_sets_init(k->fan, degree);
	return WH_OK;
}

/* Spokes of the same edge as the first of s[0 .. n-1]. */
static size_t edge_run(const wh_spoke *s, size_t n)
{
	size_t run = 1;
	while (run < n && far_end(s + run) == far_end(s))
		run++;
	return run;
}

/* The half-edge of a spoke of v: 3 f + the corner it starts from. */
static uint64_t half_edge(const wh_checker *k, uint32_t v, const wh_spoke *s)
{
	const uint32_t f = k->star[k->first[v] + s->slot];
	const uint32_t at = corner_of(k->tri + 3 * (size_t)f, v);
	return 3 * (uint64_t)f + (s->out ? at : (at + 2) % 3);
}

/* ---- edges and fans -------------------------------------------------------------------------- */

/* Faces of this edge with the same third corner as one before. Each is seen from its other two
 * corners in turn; the smaller one counts. */
static void count_duplicate_faces(wh_checker *k, uint32_t v, const wh_spoke *s, size_t n)
{
	for (size_t i = 1; i < n; i++)
		if (s[i].key == s[i - 1].key && far_end(s) < third_corner(s + i) &&
		    counts_at(k, v, third_corner(s + i)))
			k->r->duplicate_faces++;
}

/* Two faces that lie on each other: their normals are opposite, or, where they disagree about the
 * side, the same. */
static bool is_folded(const wh_checker *k, uint32_t v, const wh_spoke *s)
{
	const float *a = k->normal[k->star[k->first[v] + s[0].slot]];
	const float *b = k->normal[k->star[k->first[v] + s[1].slot]];
	const double dot =
	    (double)a[0] * (double)b[0] + (double)a[1] * (double)b[1] + (double)a[2] * (double)b[2];
	return (s[0].out == s[1].out ? -dot : dot) < -COS_10;
}

/* An edge with its n faces, seen from v, where it counts. */
static void count_edge(wh_checker *k, uint32_t v, const wh_spoke *s, size_t n)
{
	wh_check *r = k->r;
	r->edges++;
	if (n == 1) {
		r->boundary_edges++;
		wh_bit_set(k->on_boundary, half_edge(k, v, s));
		wh_bit_set(k->ends_open, v);
		wh_bit_set(k->ends_open, far_end(s));
		return;
	}
	r->nonmanifold_edges += n > 2;
	r->misoriented_edges += n == 2 && s[0].out == s[1].out;
	r->folded_edges += n == 2 && is_folded(k, v, s);
	for (size_t i = 1; i < n; i++)
		(void)wh_sets_join(k->face_sets, k->star[k->first[v] + s[0].slot],
		                   k->star[k->first[v] + s[i].slot]);
	count_duplicate_faces(k, v, s, n);
}

/* Joins the faces of each edge of the star into fans; returns how many fans there are. */
static uint32_t join_fans(wh_checker *k)
{
	uint32_t fans = k->degree;
	const size_t n = 2 * (size_t)k->degree;
	for (size_t i = 1; i < n; i++)
		if (far_end(k->spokes + i) == far_end(k->spokes + i - 1))
			fans -= wh_sets_join(k->fan, k->spokes[i - 1].slot, k->spokes[i].slot);
	return fans;
}

static void count_star(wh_checker *k, uint32_t v)
{
	const size_t n = 2 * (size_t)k->degree;
	for (size_t i = 0, run; i < n; i += run) {
		run = edge_run(k->spokes + i, n - i);
		if (counts_at(k, v, far_end(k->spokes + i)))
			count_edge(k, v, k->spokes + i, run);
	}
	k->r->nonmanifold_vertices += join_fans(k) > 1;
}

wh_code wh_checker_edges(wh_checker *k)
{
	for (uint32_t v = 0; v < k->nv; v++) {
		if (wh_poll_at(k->c, v) != WH_OK || look_at(k, v) != WH_OK)
			return k->c->err.code;
		count_star(k, v);
	}
	return WH_OK;
}

/* ---- boundary loops -------------------------------------------------------------------------- */

static void build_rank(wh_checker *k)
{
	uint64_t sum = 0;
	for (size_t w = 0; w < boundary_words(k); w++) {
		k->rank[w] = sum;
		sum += (uint64_t)__builtin_popcountll(k->on_boundary[w]);
	}
	k->boundary_total = sum;
}

uint32_t wh_checker_boundary_number(const wh_checker *k, uint64_t h)
{
	const uint64_t below = k->on_boundary[h / 64] & ((UINT64_C(1) << (h % 64)) - 1);
	return (uint32_t)(k->rank[h / 64] + (uint64_t)__builtin_popcountll(below));
}

/* Joins the boundary edges that end the same fan of v. Returns how many joins were news. */
static uint32_t join_fan_ends(wh_checker *k, uint32_t v)
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
		uint64_t *end = k->fan_end + wh_sets_find(k->fan, k->spokes[i].slot);
		const uint64_t h = half_edge(k, v, k->spokes + i);
		if (*end == none)
			*end = h;
		else
			joined += wh_sets_join(k->loop_sets, wh_checker_boundary_number(k, *end),
			                       wh_checker_boundary_number(k, h));
	}
	return joined;
}

wh_code wh_checker_number_boundary(wh_checker *k)
{
	k->rank = wh_alloc(k->c, boundary_words(k), sizeof *k->rank);
	if (!k->rank)
		return k->c->err.code;
	build_rank(k);
	if (k->boundary_total >= WH_NONE)
		return wh_fail(k->c, WH_E_PLAN,
		               "a mesh with 2^32 boundary edges cannot be checked");
	k->loop_sets = wh_alloc(k->c, (size_t)k->boundary_total, sizeof *k->loop_sets);
	if (!k->loop_sets)
		return k->c->err.code;
	wh_sets_init(k->loop_sets, k->boundary_total);
	return WH_OK;
}

wh_code wh_checker_loops(wh_checker *k)
{
	k->r->boundary_loops += k->r->boundary_edges;
	for (uint32_t v = 0; v < k->nv; v++) {
		if (!wh_bit_get(k->ends_open, v))
			continue;
		if (wh_poll_at(k->c, v) != WH_OK || look_at(k, v) != WH_OK)
			return k->c->err.code;
		(void)join_fans(k);
		k->r->boundary_loops -= join_fan_ends(k, v);
	}
	return WH_OK;
}

/* Nothing after the loops needs them. */
static void drop_stars(wh_checker *k)
{
	wh_free(k->c, k->fan_end);
	wh_free(k->c, k->fan);
	wh_free(k->c, k->spokes);
	wh_free(k->c, k->star);
	wh_free(k->c, k->first);
	k->fan_end = NULL;
	k->fan = NULL;
	k->spokes = NULL;
	k->star = NULL;
	k->first = NULL;
	k->star_cap = 0;
}

/* ---- components --------------------------------------------------------------------------- */

/* Trees of the face forest that hold a face. */
static void count_edge_components(wh_checker *k)
{
	for (uint32_t f = 0; f < k->nf; f++)
		k->r->edge_components += k->face_sets[f] == f && wh_checker_is_face(k, f);
}

static void count_vertex_components(wh_checker *k)
{
	for (uint32_t v = 0; v < k->nv; v++)
		k->r->components += k->vertex_sets[v] == v && wh_bit_get(k->used, v);
	for (uint32_t f = 0; f < k->nf; f++)
		if (wh_checker_is_face(k, f))
			k->set_faces[wh_sets_find(k->vertex_sets, k->tri[3 * (size_t)f])]++;
}

void wh_check_add_component(wh_check *r, uint64_t faces)
{
	if (faces == 0)
		return;
	r->component_sizes[63 - __builtin_clzll(faces)]++;
	r->largest_component = faces > r->largest_component ? faces : r->largest_component;
}

static wh_code count_components(wh_checker *k)
{
	count_edge_components(k);
	k->vertex_sets = wh_alloc(k->c, k->nv, sizeof *k->vertex_sets);
	k->set_faces = wh_calloc(k->c, k->nv, sizeof *k->set_faces);
	if (!k->vertex_sets || !k->set_faces)
		return k->c->err.code;
	wh_sets_init(k->vertex_sets, k->nv);
	for (uint32_t f = 0; f < k->nf; f++) {
		const uint32_t *t = k->tri + 3 * (size_t)f;
		if (!wh_checker_is_face(k, f))
			continue;
		(void)wh_sets_join(k->vertex_sets, t[0], t[1]);
		(void)wh_sets_join(k->vertex_sets, t[0], t[2]);
	}
	count_vertex_components(k);
	return WH_OK;
}

/* ---- the whole ---------------------------------------------------------------------------- */

wh_code wh_checker_run(wh_checker *k, wh_face_sums *sums)
{
	if (count_faces(k, sums) != WH_OK)
		return k->c->err.code;
	count_vertices(k);
	if (wh_checker_stars(k) != WH_OK || wh_checker_edges(k) != WH_OK ||
	    wh_checker_number_boundary(k) != WH_OK || wh_checker_loops(k) != WH_OK)
		return k->c->err.code;
	drop_stars(k);
	return count_components(k);
}

static bool is_oriented_manifold(const wh_check *r)
{
	return r->nonmanifold_edges == 0 && r->nonmanifold_vertices == 0 &&
	       r->misoriented_edges == 0;
}

/* Of a component: euler = 2 - 2 genus - loops. Summed over all of them. */
void wh_check_derive(wh_check *r)
{
	const uint64_t good = r->faces - r->degenerate_faces - r->invalid_faces;
	r->euler = (int64_t)r->referenced_vertices - (int64_t)r->edges + (int64_t)good;
	r->genus = -1;
	if (is_oriented_manifold(r))
		r->genus = (2 * (int64_t)r->components - (int64_t)r->boundary_loops - r->euler) / 2;
}

bool wh_check_clean(const wh_check *r)
{
	return is_oriented_manifold(r) && r->degenerate_faces == 0 && r->invalid_faces == 0 &&
	       r->duplicate_faces == 0 && r->nonfinite_vertices == 0;
}

void wh_checker_free(wh_checker *k)
{
	drop_stars(k);
	wh_free(k->c, k->loop_sets);
	wh_free(k->c, k->rank);
	wh_free(k->c, k->ends_open);
	wh_free(k->c, k->on_boundary);
	wh_free(k->c, k->vertex_sets);
	wh_free(k->c, k->set_faces);
	if (!k->rim)
		wh_free(k->c, k->normal);
	wh_free(k->c, k->face_sets);
	wh_free(k->c, k->used);
}
