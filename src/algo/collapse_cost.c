/*
 * Place and cost of a collapse, by memoryless quadrics.
 *
 * Around vertex u every face plane passes through u. So with x the new position, A(u) the sum of
 * n n' over the faces of u (n: their area vectors) and S the same over the one or two faces
 * shared by u and v,
 *
 *     cost(x) = (x-u)' A(u) (x-u) + (x-v)' A(v) (x-v) - (x-u)' S (x-u)
 *
 * exactly: six numbers a vertex, and no file coordinates anywhere. A and the sum of area vectors
 * are kept for every vertex that may move, and summed afresh when a face around it changes.
 */
#include "algo/simplify_engine.h"

#include "base/real.h"

/* A boundary edge e swept along d weighs 4 |e|^2 |e x d|^2. Lindstrom & Turk's two terms at equal
 * weights would give 9, with the length of the collapsed edge for that of e; measured on three
 * scans with boundary, 4 has the least error on all (2 and 40 the most). */
static const double BOUNDARY_WEIGHT = 4.0;
/* Pulls the new vertex to the edge's midpoint where the faces leave a direction free. Stronger
 * pulls cost error: 1e-3 gives 8 % more than 1e-5 on a dragon of 87 k faces. */
static const double MIDPOINT_PULL = 1e-6;
/* Prefers short edges where the faces do not tell (flat regions). */
static const double LENGTH_TIE = 1e-6;
/* Longest step of new positions / length of the collapsed edge, both as powers of two. */
static const double STEP_MOST = 0x1p-8;

/* ---- sums --------------------------------------------------------------------------------- */

static void sum_outer(wh_vertex_sum *s, wh_vec3 n, double w)
{
	s->xx += w * n.x * n.x;
	s->xy += w * n.x * n.y;
	s->xz += w * n.x * n.z;
	s->yy += w * n.y * n.y;
	s->yz += w * n.y * n.z;
	s->zz += w * n.z * n.z;
}

static void sum_face(wh_vertex_sum *s, wh_vec3 n)
{
	sum_outer(s, n, 1.0);
	s->n = wh_add(s->n, n);
}

/* |e x d|^2 = d' (|e|^2 I - e e') d */
static void sum_boundary_edge(wh_vertex_sum *s, wh_vec3 e)
{
	const double len2 = wh_norm2(e);
	const double w = BOUNDARY_WEIGHT * len2;
	s->xx += w * len2;
	s->yy += w * len2;
	s->zz += w * len2;
	sum_outer(s, e, -w);
}

/* Sums of a free vertex from its faces; its ring is needed only when it lies on the boundary. */
void wh_sum_renew(wh_engine *e, uint32_t v, const wh_ring *r)
{
	const wh_simplify_work *w = e->w;
	wh_vertex_sum s = {0};
	for (uint32_t i = 0; i < w->count[v]; i++)
		sum_face(&s, w->normal[w->pool[w->first[v] + i]]);
	for (uint32_t i = 0; r && i < r->n; i++)
		if (on_boundary(&r->item[i]))
			sum_boundary_edge(&s, wh_sub(e->p->pos[r->item[i].id], e->p->pos[v]));
	e->w->sum[v] = s;
}

wh_code wh_sum_renew_any(wh_engine *e, uint32_t v)
{
	if (!(e->p->flag[v] & WH_BORDER)) {
		wh_sum_renew(e, v, NULL);
		return WH_OK;
	}
	if (wh_gather(e, v, &e->w->ring_w) != WH_OK)
		return e->c->err.code;
	wh_sum_renew(e, v, &e->w->ring_w);
	return WH_OK;
}

/* ---- evaluation --------------------------------------------------------------------------- */

static wh_vec3 sum_times(const wh_vertex_sum *s, wh_vec3 d)
{
	return wh_v3(s->xx * d.x + s->xy * d.y + s->xz * d.z,
	             s->xy * d.x + s->yy * d.y + s->yz * d.z,
	             s->xz * d.x + s->yz * d.y + s->zz * d.z);
}

static double sum_trace(const wh_vertex_sum *s)
{
	return s->xx + s->yy + s->zz;
}

/* Collapses with both ends free, all of edges at one vertex: evaluated side by side, so that the
 * compiler makes vectors of them. Every lane does the same operations in the same order whatever
 * the vector length, so the bits are the same on every instruction set. */
#if defined(__x86_64__) && defined(__GLIBC__) && !defined(WH_SANITIZED)
#define VECTOR_CLONES __attribute__((target_clones("avx512f", "avx2", "default")))
#else
#define VECTOR_CLONES
#endif

/* With y the new place relative to the hub, e the edge from the hub to the other end, A and N the
 * sums of the hub, B and M those of the other end, and S, T the sums over the shared faces:
 *
 *     H = A + B - S     cost(y) = y'Hy - 2 y'Be + e'Be     volume kept: (N + M - T) y = M e
 *
 * H is inverted by cofactors after a shift of its diagonal that bounds its condition. */
VECTOR_CLONES static void evaluate_lanes(wh_lanes *restrict l, const wh_vertex_sum *restrict hub)
{
	const wh_vertex_sum a = *hub;
	for (int i = 0; i < WH_LANES; i++) {
		const double ex = l->ex[i], ey = l->ey[i], ez = l->ez[i];
		const double len2 = ex * ex + ey * ey + ez * ez;
		/* the edge itself, which both ends count when it is on the boundary */
		const double rim = l->rim[i] * BOUNDARY_WEIGHT * len2;
		const double p = l->px[i], q = l->py[i], r = l->pz[i];
		const double u = l->qx[i], v = l->qy[i], w = l->qz[i];
		const double hxx = a.xx + l->xx[i] - p * p - u * u - rim * (len2 - ex * ex);
		const double hyy = a.yy + l->yy[i] - q * q - v * v - rim * (len2 - ey * ey);
		const double hzz = a.zz + l->zz[i] - r * r - w * w - rim * (len2 - ez * ez);
		const double hxy = a.xy + l->xy[i] - p * q - u * v + rim * ex * ey;
		const double hxz = a.xz + l->xz[i] - p * r - u * w + rim * ex * ez;
		const double hyz = a.yz + l->yz[i] - q * r - v * w + rim * ey * ez;
		const double nx = a.n.x + l->nx[i] - p - u;
		const double ny = a.n.y + l->ny[i] - q - v;
		const double nz = a.n.z + l->nz[i] - r - w;
		const double trace = hxx + hyy + hzz;
		const double pull = MIDPOINT_PULL * trace;
		/* Be, and its form */
		const double bx = l->xx[i] * ex + l->xy[i] * ey + l->xz[i] * ez;
		const double by = l->xy[i] * ex + l->yy[i] * ey + l->yz[i] * ez;
		const double bz = l->xz[i] * ex + l->yz[i] * ey + l->zz[i] * ez;
		const double ebe = ex * bx + ey * by + ez * bz;
		/* cofactors of the shifted H */
		const double sx = hxx + pull, sy = hyy + pull, sz = hzz + pull;
		const double cxx = sy * sz - hyz * hyz, cxy = hxz * hyz - hxy * sz;
		const double cxz = hxy * hyz - hxz * sy, cyy = sx * sz - hxz * hxz;
		const double cyz = hxy * hxz - sx * hyz, czz = sx * sy - hxy * hxy;
		const double det = sx * cxx + hxy * cxy + hxz * cxz;
		const double gx = bx + 0.5 * pull * ex, gy = by + 0.5 * pull * ey;
		const double gz = bz + 0.5 * pull * ez;
		const double inv = 1.0 / det;
		double yx = (cxx * gx + cxy * gy + cxz * gz) * inv;
		double yy = (cxy * gx + cyy * gy + cyz * gz) * inv;
		double yz = (cxz * gx + cyz * gy + czz * gz) * inv;
		/* Lindstrom & Turk's first constraint: the volume under the surface stays. */
		const double mx = cxx * nx + cxy * ny + cxz * nz;
		const double my = cxy * nx + cyy * ny + cyz * nz;
		const double mz = cxz * nx + cyz * ny + czz * nz;
		const double nm = nx * mx + ny * my + nz * mz;
		const double gap =
		    l->nx[i] * ex + l->ny[i] * ey + l->nz[i] * ez - (nx * yx + ny * yy + nz * yz);
		const double step = gap / (nm > 0 ? nm : 1.0) * (nm > 0 ? 1.0 : 0.0);
		yx += mx * step;
		yy += my * step;
		yz += mz * step;
		/* A minimum far away is an artefact of a nearly singular sum; so is no minimum. */
		const double fx = yx - 0.5 * ex, fy = yy - 0.5 * ey, fz = yz - 0.5 * ez;
		const bool near = fx * fx + fy * fy + fz * fz <= 4.0 * len2;
		yx = near ? yx : 0.5 * ex;
		yy = near ? yy : 0.5 * ey;
		yz = near ? yz : 0.5 * ez;
		const double form = yx * (hxx * yx + 2.0 * (hxy * yy + hxz * yz)) +
		                    yy * (hyy * yy + 2.0 * hyz * yz) + yz * hzz * yz;
		const double cost = form - 2.0 * (yx * bx + yy * by + yz * bz) + ebe;
		l->to_x[i] = yx;
		l->to_y[i] = yy;
		l->to_z[i] = yz;
		l->weight[i] = trace;
		l->cost[i] = (cost > 0 ? cost : 0.0) + LENGTH_TIE * trace * len2;
	}
}

/* Clang 14 gives the chosen clone a name of its own, which other files cannot call. */
void wh_lanes_evaluate(wh_lanes *l, const wh_vertex_sum *hub)
{
	evaluate_lanes(l, hub);
}

void wh_lanes_set(const wh_engine *e, wh_lanes *l, int lane, const wh_collapse *k)
{
	const wh_vertex_sum *s = &e->w->sum[k->u];
	const wh_vec3 edge = wh_sub(e->p->pos[k->u], e->p->pos[k->v]);
	const wh_vec3 p = e->w->normal[k->shared[0]];
	const wh_vec3 q = k->nshared == 2 ? e->w->normal[k->shared[1]] : wh_v3(0, 0, 0);
	l->ex[lane] = edge.x;
	l->ey[lane] = edge.y;
	l->ez[lane] = edge.z;
	l->xx[lane] = s->xx;
	l->xy[lane] = s->xy;
	l->xz[lane] = s->xz;
	l->yy[lane] = s->yy;
	l->yz[lane] = s->yz;
	l->zz[lane] = s->zz;
	l->nx[lane] = s->n.x;
	l->ny[lane] = s->n.y;
	l->nz[lane] = s->n.z;
	l->px[lane] = p.x;
	l->py[lane] = p.y;
	l->pz[lane] = p.z;
	l->qx[lane] = q.x;
	l->qy[lane] = q.y;
	l->qz[lane] = q.z;
	l->rim[lane] = k->nshared == 1 ? 1.0 : 0.0;
}

/* v stays where it is, so only the faces of u change. */
static void evaluate_into_locked(const wh_engine *e, wh_collapse *k)
{
	const wh_vertex_sum *s = &e->w->sum[k->u];
	const wh_vec3 edge = wh_sub(e->p->pos[k->v], e->p->pos[k->u]);
	k->x = e->p->pos[k->v];
	k->weight = sum_trace(s);
	k->cost =
	    fmax(wh_dot(edge, sum_times(s, edge)), 0.0) + LENGTH_TIE * k->weight * wh_norm2(edge);
}

/* No longer than this share of the edge, whatever the mesh as a whole is like. */
static double step_beside(const wh_engine *e, wh_vec3 edge)
{
	const double len2 = wh_norm2(edge);
	const double step = e->params->step, enough = step / STEP_MOST;
	if (len2 >= enough * enough)
		return step;
	return len2 > 0 ? ldexp(STEP_MOST, ilogb(sqrt(len2))) : 0;
}

/* The place y away from `hub`, an end of the edge. Steps are counted from the hub: where positions
 * have no bits below a step this place has none either, and its sum is exact; and a plane across
 * an axis stays one. */
static wh_vec3 new_position(const wh_engine *e, wh_vec3 hub, wh_vec3 y, wh_vec3 edge)
{
	if (e->params->float_positions) {
		const wh_vec3 x = wh_add(hub, y);
		return wh_v3(wh_round_float(x.x), wh_round_float(x.y), wh_round_float(x.z));
	}
	const double step = e->params->step > 0 ? step_beside(e, edge) : 0;
	return wh_add(
	    hub, wh_v3(wh_round_to(y.x, step), wh_round_to(y.y, step), wh_round_to(y.z, step)));
}

void wh_lanes_get(const wh_engine *e, const wh_lanes *l, int lane, wh_collapse *k)
{
	const wh_vec3 y = wh_v3(l->to_x[lane], l->to_y[lane], l->to_z[lane]);
	const wh_vec3 edge = wh_v3(l->ex[lane], l->ey[lane], l->ez[lane]);
	k->x = new_position(e, e->p->pos[k->v], y, edge);
	k->cost = l->cost[lane];
	k->weight = l->weight[lane];
}

void wh_collapse_evaluate(wh_engine *e, wh_collapse *k)
{
	if (e->p->flag[k->v] & WH_LOCKED) {
		evaluate_into_locked(e, k);
		return;
	}
	wh_lanes *l = &e->w->lanes;
	wh_lanes_set(e, l, 0, k);
	wh_lanes_evaluate(l, &e->w->sum[k->v]);
	wh_lanes_get(e, l, 0, k);
}
