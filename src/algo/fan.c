/*
 * Place and cost of a collapse, by memoryless quadrics.
 *
 * Around vertex u every face plane passes through u. So with x the new position, A(u) the sum of
 * w n n' over the faces of u (n: their area vectors, w: a weight) and S the same over the one or
 * two faces shared by u and v,
 *
 *     cost(x) = (x-u)' A(u) (x-u) + (x-v)' A(v) (x-v) - (x-u)' S (x-u)
 *
 * exactly: six numbers a vertex, and no file coordinates anywhere. A and the sum of area vectors
 * are kept for every vertex that may move. All edges of a vertex are evaluated side by side.
 */
#include "algo/simplify_engine.h"

#include <math.h>
#include <stddef.h>
#include <string.h>

/* A boundary edge e swept along d weighs 4 |e| |e x d|^2. Lindstrom & Turk's two terms at equal
 * weights would give 9, with the length of the collapsed edge for that of e; measured on three
 * scans with boundary, 4 has the least error on all (2 and 40 the most). */
static const double BOUNDARY_WEIGHT = 4.0;

/* ---- taking out --------------------------------------------------------------------------- */

/* Loops over single lanes would store numbers one by one and load them as vectors at once, which
 * processors do not bear well. */
typedef double half __attribute__((vector_size(32)));
typedef double whole __attribute__((vector_size(64)));

#define INLINE static inline __attribute__((always_inline))

INLINE void store(double *to, const half *lo, const half *hi)
{
	const whole both = __builtin_shufflevector(*lo, *hi, 0, 1, 2, 3, 4, 5, 6, 7);
	memcpy(to, &both, sizeof both);
}

/* Four numbers of each of four stars become one number of four stars, four times. */
INLINE void transpose(const half r[4], half out[4])
{
	const half ab0 = __builtin_shufflevector(r[0], r[1], 0, 4, 2, 6);
	const half ab1 = __builtin_shufflevector(r[0], r[1], 1, 5, 3, 7);
	const half cd0 = __builtin_shufflevector(r[2], r[3], 0, 4, 2, 6);
	const half cd1 = __builtin_shufflevector(r[2], r[3], 1, 5, 3, 7);
	out[0] = __builtin_shufflevector(ab0, cd0, 0, 1, 4, 5);
	out[1] = __builtin_shufflevector(ab1, cd1, 0, 1, 4, 5);
	out[2] = __builtin_shufflevector(ab0, cd0, 2, 3, 6, 7);
	out[3] = __builtin_shufflevector(ab1, cd1, 2, 3, 6, 7);
}

/* Numbers 4 k to 4 k + 3 of eight stars. */
INLINE void take_four(const wh_star *const *s, size_t k, half lo[4], half hi[4])
{
	half r[WH_LANES];
	for (int i = 0; i < WH_LANES; i++)
		memcpy(&r[i], (const unsigned char *)s[i] + k * sizeof *r, sizeof *r);
	transpose(&r[0], lo);
	transpose(&r[4], hi);
}

/* Area vectors of four faces: between d and the neighbours one further on. */
INLINE void cross(const half d[3], const half e[3], half n[3])
{
	n[0] = d[1] * e[2] - d[2] * e[1];
	n[1] = d[2] * e[0] - d[0] * e[2];
	n[2] = d[0] * e[1] - d[1] * e[0];
}

/* The neighbours of a block and one more; behind the last one of a closed ring comes the first
 * again, and then the hub, whose faces are nothing. */
INLINE void find_block(const wh_star *star, const uint32_t *ring, const wh_star *hub, uint32_t from,
                       const wh_star *s[WH_LANES + 1])
{
	for (uint32_t i = 0; i <= WH_LANES; i++) {
		const uint32_t k = from + i;
		s[i] = k < hub->n                   ? &star[ring[k]]
		       : k == hub->n && hub->closed ? &star[ring[0]]
		                                    : hub;
	}
}

/* The face that closes the ring. */
INLINE wh_vec3 last_face(const wh_star *star, const uint32_t *ring, const wh_star *hub)
{
	if (!hub->closed)
		return wh_v3(0, 0, 0);
	return wh_cross(wh_sub(star[ring[hub->n - 1]].pos, hub->pos),
	                wh_sub(star[ring[0]].pos, hub->pos));
}

/* Neighbours' positions and the faces between them; and their sums, where `sums`. */
INLINE void take_out(const wh_star *restrict star, const uint32_t *restrict ring,
                     const wh_star *restrict hub, bool sums, wh_fan *restrict f)
{
	const wh_vec3 c = hub->pos, close = last_face(star, ring, hub);
	half carry[3] = {close.x - (half){0}, close.y - (half){0}, close.z - (half){0}};
	double *const rows[12] = {f->to.x.at, f->to.y.at, f->to.z.at, f->xx.at,
	                          f->xy.at,   f->xz.at,   f->yy.at,   f->yz.at,
	                          f->zz.at,   f->m.x.at,  f->m.y.at,  f->m.z.at};
	double *const before[3] = {f->before.x.at, f->before.y.at, f->before.z.at};
	double *const after[3] = {f->after.x.at, f->after.y.at, f->after.z.at};
	for (uint32_t b = 0; b < hub->n; b += WH_LANES) {
		const wh_star *s[WH_LANES + 1];
		half lo[4], hi[4], lo_on[3], hi_on[3], nlo[3], nhi[3];
		find_block(star, ring, hub, b, s);
		for (size_t four = 1; sums && four < 3; four++) {
			take_four(s, four, lo, hi);
			for (size_t k = 0; k < 4; k++)
				store(rows[4 * four + k] + b, &lo[k], &hi[k]);
		}
		take_four(s, 0, lo, hi);
		if (sums)
			store(rows[3] + b, &lo[3], &hi[3]);
		const double centre[3] = {c.x, c.y, c.z};
		const double end[3] = {s[WH_LANES]->pos.x, s[WH_LANES]->pos.y, s[WH_LANES]->pos.z};
		for (int k = 0; k < 3; k++) {
			const half on = end[k] - centre[k] - (half){0};
			lo[k] -= centre[k];
			hi[k] -= centre[k];
			store(rows[k] + b, &lo[k], &hi[k]);
			lo_on[k] = __builtin_shufflevector(lo[k], hi[k], 1, 2, 3, 4);
			hi_on[k] = __builtin_shufflevector(hi[k], on, 1, 2, 3, 4);
		}
		cross(lo, lo_on, nlo);
		cross(hi, hi_on, nhi);
		for (int k = 0; k < 3; k++) {
			store(after[k] + b, &nlo[k], &nhi[k]);
			lo_on[k] = __builtin_shufflevector(carry[k], nlo[k], 3, 4, 5, 6);
			hi_on[k] = __builtin_shufflevector(nlo[k], nhi[k], 3, 4, 5, 6);
			store(before[k] + b, &lo_on[k], &hi_on[k]);
			carry[k] = nhi[k];
		}
	}
}

WH_VECTOR_CLONES static void take_all(const wh_star *restrict star, const uint32_t *restrict ring,
                                      const wh_star *restrict hub, wh_fan *restrict f)
{
	take_out(star, ring, hub, true, f);
}

WH_VECTOR_CLONES static void take_faces(const wh_star *restrict star, const uint32_t *restrict ring,
                                        const wh_star *restrict hub, wh_fan *restrict f)
{
	take_out(star, ring, hub, false, f);
}

/* Which edges are boundary edges, which lead to locked vertices, and which may not be collapsed. */
static void note_edges(const wh_engine *e, const wh_star *hub, wh_fan *f)
{
	for (uint32_t i = 0; i < f->n; i++) {
		const wh_star *s = &e->w->star[f->id[i]];
		const bool rim = !f->closed && (i == 0 || i + 1 == f->n);
		/* An inner edge between two boundary vertices: collapsing it would pinch the
		 * surface. One end that is locked may be on the boundary. */
		const unsigned barred = e->surgery ? WH_LOCKED : WH_BORDER | WH_LOCKED;
		const bool pinch = !f->closed && !rim && (s->flag & barred);
		f->rim.at[i] = rim ? 1.0 : 0.0;
		f->locked.at[i] = s->flag & WH_LOCKED ? 1.0 : 0.0;
		f->bar.at[i] = pinch || hub->n + s->n > WH_MOST_AROUND ? (double)INFINITY : 0.0;
	}
}

static void clear_edges(wh_fan *f)
{
	for (size_t b = 0; b < f->n; b += WH_LANES) {
		memset(&f->rim.at[b], 0, WH_LANES * sizeof(double));
		memset(&f->locked.at[b], 0, WH_LANES * sizeof(double));
		memset(&f->bar.at[b], 0, WH_LANES * sizeof(double));
	}
}

void wh_fan_gather(const wh_engine *e, uint32_t v, wh_fan *f)
{
	const wh_star *star = e->w->star, *hub = &star[v];
	f->id = wh_ring(e, v);
	f->n = hub->n;
	f->closed = hub->closed;
	take_all(star, f->id, hub, f);
	clear_edges(f);
	unsigned flags = 0;
	uint32_t most = 0;
	for (uint32_t i = 0; i < f->n; i++) {
		const wh_star *s = &star[f->id[i]];
		flags |= s->flag;
		most = s->n > most ? s->n : most;
	}
	if (!f->closed || (flags & WH_LOCKED) || hub->n + most > WH_MOST_AROUND)
		note_edges(e, hub, f);
}

/* ---- sums --------------------------------------------------------------------------------- */

static void sum_outer(wh_vertex_sum *s, double x, double y, double z, double w)
{
	s->xx += w * x * x;
	s->xy += w * x * y;
	s->xz += w * x * z;
	s->yy += w * y * y;
	s->yz += w * y * z;
	s->zz += w * z * z;
}

/* |e x d|^2 = d' (|e|^2 I - e e') d */
static void sum_boundary_edge(wh_vertex_sum *s, double x, double y, double z)
{
	const double len2 = x * x + y * y + z * z;
	const double w = BOUNDARY_WEIGHT * sqrt(len2);
	s->xx += w * len2;
	s->yy += w * len2;
	s->zz += w * len2;
	sum_outer(s, x, y, z, -w);
}

/* The sums of four lanes each. */
INLINE void add_lanes(const half r[4], double *to)
{
	half t[4];
	transpose(r, t);
	const half sum = (t[0] + t[1]) + (t[2] + t[3]);
	memcpy(to, &sum, sizeof sum);
}

WH_VECTOR_CLONES static void sum_faces(const wh_rows3 *restrict face, size_t n,
                                       double sum[restrict 12])
{
	half r[12] = {{0}};
	wh_row weight;
	for (size_t b = 0; b < n; b += WH_LANES)
		for (size_t lane = 0; lane < WH_LANES; lane++) {
			const size_t i = b + lane;
			const double x = face->x.at[i], y = face->y.at[i], z = face->z.at[i];
			weight.at[i] = wh_face_weight(x * x + y * y + z * z);
		}
	for (size_t i = 0; i < n; i += 4) {
		half x, y, z, w;
		memcpy(&x, &face->x.at[i], sizeof x);
		memcpy(&y, &face->y.at[i], sizeof y);
		memcpy(&z, &face->z.at[i], sizeof z);
		memcpy(&w, &weight.at[i], sizeof w);
		const half wx = w * x, wy = w * y, wz = w * z;
		r[0] += wx * x;
		r[1] += wx * y;
		r[2] += wx * z;
		r[3] += wy * y;
		r[4] += wy * z;
		r[5] += wz * z;
		r[6] += x;
		r[7] += y;
		r[8] += z;
	}
	for (size_t k = 0; k < 3; k++)
		add_lanes(&r[4 * k], &sum[4 * k]);
}

void wh_sum_make(const wh_rows3 *to, const wh_rows3 *face, uint32_t n, bool closed,
                 wh_vertex_sum *s)
{
	double sum[12];
	sum_faces(face, n, sum);
	*s = (wh_vertex_sum){
	    sum[0], sum[1], sum[2], sum[3], sum[4], sum[5], wh_v3(sum[6], sum[7], sum[8])};
	if (closed)
		return;
	sum_boundary_edge(s, to->x.at[0], to->y.at[0], to->z.at[0]);
	sum_boundary_edge(s, to->x.at[n - 1], to->y.at[n - 1], to->z.at[n - 1]);
}

/* ---- sums of all vertices at once --------------------------------------------------------- */

/* Corner k of eight faces. */
INLINE void find_corners(const wh_star *star, const uint32_t *tri, size_t k,
                         const wh_star *s[WH_LANES])
{
	for (size_t i = 0; i < WH_LANES; i++)
		s[i] = &star[tri[3 * i + k]];
}

/* Adds the terms of four faces, which come one term of all four at a time, to those of one of their
 * corners. */
INLINE void add_terms(wh_star *star, const uint32_t *corner, const half r[9])
{
	half middle[4], last[4];
	const half tail[4] = {r[5], r[6], r[7], r[8]};
	transpose(&r[1], middle);
	transpose(tail, last);
	for (size_t i = 0; i < 4; i++) {
		wh_vertex_sum *s = &star[corner[3 * i]].sum;
		half a, b;
		memcpy(&a, &s->xy, sizeof a);
		memcpy(&b, &s->zz, sizeof b);
		a += middle[i];
		b += last[i];
		s->xx += r[0][i];
		memcpy(&s->xy, &a, sizeof a);
		memcpy(&s->zz, &b, sizeof b);
	}
}

_Static_assert(offsetof(wh_vertex_sum, zz) == 5 * sizeof(double) &&
                   offsetof(wh_vertex_sum, n.z) == 8 * sizeof(double),
               "the terms of a sum are in the order of add_terms");

/* The nine terms of four faces. */
INLINE void find_terms(const half n[3], half r[9])
{
	const half n2 = n[0] * n[0] + n[1] * n[1] + n[2] * n[2];
	half w;
	for (int i = 0; i < 4; i++)
		w[i] = wh_face_weight(n2[i]);
	const half wx = w * n[0], wy = w * n[1], wz = w * n[2];
	r[0] = wx * n[0];
	r[1] = wx * n[1];
	r[2] = wx * n[2];
	r[3] = wy * n[1];
	r[4] = wy * n[2];
	r[5] = wz * n[2];
	r[6] = n[0];
	r[7] = n[1];
	r[8] = n[2];
}

/* Adds what eight faces give to the sums of their corners, faces in their order. */
INLINE void add_faces(wh_star *star, const uint32_t *tri)
{
	const wh_star *s[WH_LANES];
	half lo[3][4], hi[3][4], n[3], r[9];
	for (size_t k = 0; k < 3; k++) {
		find_corners(star, tri, k, s);
		take_four(s, 0, lo[k], hi[k]);
	}
	for (size_t h = 0; h < 2; h++) {
		const half *a = h ? hi[0] : lo[0], *b = h ? hi[1] : lo[1], *d = h ? hi[2] : lo[2];
		const half e[3] = {b[0] - a[0], b[1] - a[1], b[2] - a[2]};
		const half g[3] = {d[0] - a[0], d[1] - a[1], d[2] - a[2]};
		cross(e, g, n);
		find_terms(n, r);
		for (size_t k = 0; k < 3; k++)
			add_terms(star, &tri[12 * h + k], r);
	}
}

WH_VECTOR_CLONES static void add_all_faces(wh_star *star, const uint32_t *tri, size_t nf)
{
	for (size_t f = 0; f + WH_LANES <= nf; f += WH_LANES)
		add_faces(star, &tri[3 * f]);
}

/* The faces that are left over, filled up with one that is a point. */
static void add_last_faces(wh_star *star, const uint32_t *tri, size_t nf)
{
	uint32_t full[3 * WH_LANES];
	for (size_t i = 0; i < (size_t)3 * WH_LANES; i++)
		full[i] = i < 3 * nf ? tri[i] : tri[0];
	add_all_faces(star, full, WH_LANES);
}

void wh_stars_sum(wh_star *star, const uint32_t *tri, size_t nf)
{
	const size_t blocks = nf / WH_LANES * WH_LANES;
	add_all_faces(star, tri, blocks);
	if (blocks < nf)
		add_last_faces(star, &tri[3 * blocks], nf - blocks);
}

/* ---- evaluation --------------------------------------------------------------------------- */

/* A symmetric matrix. */
typedef struct symmetric {
	double xx, xy, xz, yy, yz, zz;
} symmetric;

INLINE wh_vec3 times(symmetric m, wh_vec3 d)
{
	return wh_v3(m.xx * d.x + m.xy * d.y + m.xz * d.z, m.xy * d.x + m.yy * d.y + m.yz * d.z,
	             m.xz * d.x + m.yz * d.y + m.zz * d.z);
}

/* d'md */
INLINE double form(symmetric m, wh_vec3 d)
{
	return d.x * (m.xx * d.x + 2.0 * (m.xy * d.y + m.xz * d.z)) +
	       d.y * (m.yy * d.y + 2.0 * m.yz * d.z) + d.z * m.zz * d.z;
}

INLINE symmetric cofactors(symmetric m)
{
	return (symmetric){m.yy * m.zz - m.yz * m.yz, m.xz * m.yz - m.xy * m.zz,
	                   m.xy * m.yz - m.xz * m.yy, m.xx * m.zz - m.xz * m.xz,
	                   m.xy * m.xz - m.xx * m.yz, m.xx * m.yy - m.xy * m.xy};
}

/* What both ends have, less what they share: the faces with area vectors p and q, and the edge e
 * itself, which weighs `rim` (0 but on the boundary). */
INLINE symmetric join(const wh_vertex_sum *a, symmetric b, wh_vec3 p, wh_vec3 q, wh_vec3 e,
                      double rim)
{
	const double len2 = wh_norm2(e);
	const wh_vec3 pw = wh_scale(p, wh_face_weight(wh_norm2(p)));
	const wh_vec3 qw = wh_scale(q, wh_face_weight(wh_norm2(q)));
	return (symmetric){a->xx + b.xx - pw.x * p.x - qw.x * q.x - rim * (len2 - e.x * e.x),
	                   a->xy + b.xy - pw.x * p.y - qw.x * q.y + rim * e.x * e.y,
	                   a->xz + b.xz - pw.x * p.z - qw.x * q.z + rim * e.x * e.z,
	                   a->yy + b.yy - pw.y * p.y - qw.y * q.y - rim * (len2 - e.y * e.y),
	                   a->yz + b.yz - pw.y * p.z - qw.y * q.z + rim * e.y * e.z,
	                   a->zz + b.zz - pw.z * p.z - qw.z * q.z - rim * (len2 - e.z * e.z)};
}

/* The least of y'Hy - 2 y'Be where n y = volume: H, shifted, is inverted by cofactors, and the
 * constraint, Lindstrom & Turk's first, met along the inverse times n. */
INLINE wh_vec3 minimum(symmetric h, wh_vec3 be, wh_vec3 e, wh_vec3 n, double volume,
                       double midpoint_pull)
{
	const double pull = midpoint_pull * (h.xx + h.yy + h.zz);
	const symmetric shifted = {h.xx + pull, h.xy, h.xz, h.yy + pull, h.yz, h.zz + pull};
	const symmetric c = cofactors(shifted);
	const double det = shifted.xx * c.xx + h.xy * c.xy + h.xz * c.xz;
	const wh_vec3 g = wh_add(be, wh_scale(e, 0.5 * pull));
	const wh_vec3 y = wh_scale(times(c, g), 1.0 / det);
	const wh_vec3 m = times(c, n);
	const double nm = wh_dot(n, m), gap = volume - wh_dot(n, y);
	const double step = gap / (nm > 0 ? nm : 1.0) * (nm > 0 ? 1.0 : 0.0);
	return wh_add(y, wh_scale(m, step));
}

/* With y the new place relative to the hub, e the edge from the hub to the other end, A and N the
 * sums of the hub, B and M those of the other end, and S, T the sums over the shared faces:
 *
 *     H = A + B - S     cost(y) = y'Hy - 2 y'Be + e'Be     volume kept: (N + M - T) y = M e
 *
 * Where the other end is locked y = e, and the terms in B cancel. */
WH_VECTOR_CLONES static void evaluate(wh_fan *restrict f, const wh_vertex_sum *restrict hub,
                                      double midpoint_pull, double length_tie)
{
	const wh_vertex_sum a = *hub;
	const size_t n = f->n;
	for (size_t block = 0; block < n; block += WH_LANES)
		for (size_t lane = 0; lane < WH_LANES; lane++) {
			const size_t i = block + lane;
			const wh_vec3 e = wh_rows3_at(&f->to, i), m = wh_rows3_at(&f->m, i);
			const wh_vec3 p = wh_rows3_at(&f->before, i), q = wh_rows3_at(&f->after, i);
			const symmetric b = {f->xx.at[i], f->xy.at[i], f->xz.at[i],
			                     f->yy.at[i], f->yz.at[i], f->zz.at[i]};
			const double len2 = wh_norm2(e);
			/* the edge itself, which both ends count when it is on the boundary */
			const double rim = f->rim.at[i] * BOUNDARY_WEIGHT * sqrt(len2);
			const symmetric h = join(&a, b, p, q, e, rim);
			const wh_vec3 be = times(b, e), all = wh_sub(wh_sub(wh_add(a.n, m), p), q);
			wh_vec3 y = minimum(h, be, e, all, wh_dot(m, e), midpoint_pull);
			/* A minimum far away is an artefact of a nearly singular sum; so is no
			 * minimum. */
			const wh_vec3 middle = wh_scale(e, 0.5);
			const bool near = wh_norm2(wh_sub(y, middle)) <= 4.0 * len2;
			y.x = near ? y.x : middle.x;
			y.y = near ? y.y : middle.y;
			y.z = near ? y.z : middle.z;
			y = wh_add(y, wh_scale(wh_sub(e, y), f->locked.at[i]));
			/* of faces that are hardly there, rounding errors are left */
			const double rest = h.xx + h.yy + h.zz, trace = rest > 0 ? rest : 0.0;
			const double cost = form(h, y) - 2.0 * wh_dot(y, be) + wh_dot(e, be);
			f->place.x.at[i] = y.x;
			f->place.y.at[i] = y.y;
			f->place.z.at[i] = y.z;
			f->weight.at[i] = trace;
			f->cost.at[i] =
			    (cost > 0 ? cost : 0.0) + length_tie * trace * len2 + f->bar.at[i];
		}
}

/* Clang 14 gives the chosen clone a name of its own, which other files cannot call. */
void wh_fan_evaluate(wh_fan *f, const wh_vertex_sum *hub, const wh_manner *manner)
{
	evaluate(f, hub, manner->midpoint_pull, manner->length_tie);
}

/* ---- guesses ------------------------------------------------------------------------------ */

WH_VECTOR_CLONES static void cost_of_moving(const wh_rows3 *restrict to, size_t n,
                                            const wh_vertex_sum *restrict sum, double length_tie,
                                            double *restrict cost)
{
	const symmetric a = {sum->xx, sum->xy, sum->xz, sum->yy, sum->yz, sum->zz};
	const double tie = length_tie * (a.xx + a.yy + a.zz);
	for (size_t b = 0; b < n; b += WH_LANES)
		for (size_t lane = 0; lane < WH_LANES; lane++) {
			const wh_vec3 d = wh_rows3_at(to, b + lane);
			const double moved = form(a, d);
			cost[b + lane] = (moved > 0 ? moved : 0.0) + tie * wh_norm2(d);
		}
}

double wh_guess(const wh_rows3 *to, uint32_t n, const wh_vertex_sum *sum, const wh_manner *manner)
{
	wh_row cost;
	double least = INFINITY;
	cost_of_moving(to, n, sum, manner->length_tie, cost.at);
	for (uint32_t i = 0; i < n; i++)
		least = cost.at[i] < least ? cost.at[i] : least;
	return least;
}

/* Neighbours' positions from the hub. */
WH_VECTOR_CLONES static void take_spokes(const wh_star *restrict star,
                                         const uint32_t *restrict ring, const wh_star *restrict hub,
                                         wh_rows3 *restrict to)
{
	double *const rows[3] = {to->x.at, to->y.at, to->z.at};
	const double centre[3] = {hub->pos.x, hub->pos.y, hub->pos.z};
	for (uint32_t b = 0; b < hub->n; b += WH_LANES) {
		const wh_star *s[WH_LANES + 1];
		half lo[4], hi[4];
		find_block(star, ring, hub, b, s);
		take_four(s, 0, lo, hi);
		for (int k = 0; k < 3; k++) {
			lo[k] -= centre[k];
			hi[k] -= centre[k];
			store(rows[k] + b, &lo[k], &hi[k]);
		}
	}
}

void wh_star_guess(wh_engine *e, uint32_t v)
{
	wh_star *s = &e->w->star[v];
	wh_rows3 *to = &e->w->fan.to;
	take_spokes(e->w->star, wh_ring(e, v), s, to);
	if (!s->closed)
		for (uint32_t i = 0; i < s->n; i += s->n - 1)
			sum_boundary_edge(&s->sum, to->x.at[i], to->y.at[i], to->z.at[i]);
	s->guess = wh_guess(to, s->n, &s->sum, e->manner);
}

void wh_star_renew(wh_engine *e, uint32_t v)
{
	wh_star *s = &e->w->star[v];
	wh_fan *f = &e->w->fan;
	take_faces(e->w->star, wh_ring(e, v), s, f);
	wh_sum_make(&f->to, &f->after, s->n, s->closed, &s->sum);
	s->guess = wh_guess(&f->to, s->n, &s->sum, e->manner);
}
