/*
 * How far a collapse moves the surface: the largest distance, over some points of the surface as it
 * was and as it will be, from the other one. The points are the ends, the new place and the middles
 * of the edges of both stars; the other surface is the faces of the collapse, before or after.
 *
 * The estimate for the new vertex is the worse of the two ends' estimates plus that: distances add
 * up by the triangle inequality, so errors never shrink. Measured on four scans with limits of 0.02
 * to 1 % of the diagonal, the real maximum is 0.5 to 1.9 times the limit, mostly 0.8 to 1.2.
 *
 * Distances from one point to all faces are worked out side by side, eight at a time; what does not
 * depend on the point is worked out once for each surface. For a ring of n vertices: 2.5 n points
 * times n faces.
 */
#include "algo/simplify_engine.h"

#include <math.h>

/* Triangles abc, as many as fill all lanes, and what their distances from points have in common. */
typedef struct surface {
	size_t n; /* a multiple of WH_LANES */
	wh_rows3 a, b, c;
	wh_rows3 ab, bc, ca;
	wh_rows3 normal;                    /* ab x bc */
	wh_rows3 left_ab, left_bc, left_ca; /* each side x normal: inside is where these are >= 0 */
	wh_row per_normal, per_ab, per_bc, per_ca; /* 1 / squared length; 0 for 0 */
} surface;

/* The largest distance so far, and that beyond which looking on is of no use; squared. */
typedef struct stretch {
	double far2, limit2;
} stretch;

static void put(wh_rows3 *r, size_t i, wh_vec3 v)
{
	r->x.at[i] = v.x;
	r->y.at[i] = v.y;
	r->z.at[i] = v.z;
}

static void add_face(surface *s, wh_vec3 a, wh_vec3 b, wh_vec3 c)
{
	put(&s->a, s->n, a);
	put(&s->b, s->n, b);
	put(&s->c, s->n, c);
	s->n++;
}

/* What face i comes to a point in: the hub or the other end before, the new place after. */
static wh_vec3 tip(const wh_trial *t, uint32_t i, bool after)
{
	return after ? t->to : wh_scale(t->edge, t->theirs.at[i]);
}

static inline double per(double length2)
{
	return length2 > 0 ? 1 / length2 : 0;
}

WH_VECTOR_CLONES static void prepare(surface *restrict s)
{
	for (size_t first = 0; first < s->n; first += WH_LANES)
		for (size_t lane = 0; lane < WH_LANES; lane++) {
			const size_t i = first + lane;
			const double abx = s->b.x.at[i] - s->a.x.at[i];
			const double aby = s->b.y.at[i] - s->a.y.at[i];
			const double abz = s->b.z.at[i] - s->a.z.at[i];
			const double bcx = s->c.x.at[i] - s->b.x.at[i];
			const double bcy = s->c.y.at[i] - s->b.y.at[i];
			const double bcz = s->c.z.at[i] - s->b.z.at[i];
			const double cax = s->a.x.at[i] - s->c.x.at[i];
			const double cay = s->a.y.at[i] - s->c.y.at[i];
			const double caz = s->a.z.at[i] - s->c.z.at[i];
			const double nx = aby * bcz - abz * bcy;
			const double ny = abz * bcx - abx * bcz;
			const double nz = abx * bcy - aby * bcx;
			s->ab.x.at[i] = abx;
			s->ab.y.at[i] = aby;
			s->ab.z.at[i] = abz;
			s->bc.x.at[i] = bcx;
			s->bc.y.at[i] = bcy;
			s->bc.z.at[i] = bcz;
			s->ca.x.at[i] = cax;
			s->ca.y.at[i] = cay;
			s->ca.z.at[i] = caz;
			s->normal.x.at[i] = nx;
			s->normal.y.at[i] = ny;
			s->normal.z.at[i] = nz;
			s->left_ab.x.at[i] = aby * nz - abz * ny;
			s->left_ab.y.at[i] = abz * nx - abx * nz;
			s->left_ab.z.at[i] = abx * ny - aby * nx;
			s->left_bc.x.at[i] = bcy * nz - bcz * ny;
			s->left_bc.y.at[i] = bcz * nx - bcx * nz;
			s->left_bc.z.at[i] = bcx * ny - bcy * nx;
			s->left_ca.x.at[i] = cay * nz - caz * ny;
			s->left_ca.y.at[i] = caz * nx - cax * nz;
			s->left_ca.z.at[i] = cax * ny - cay * nx;
			s->per_normal.at[i] = per(nx * nx + ny * ny + nz * nz);
			s->per_ab.at[i] = per(abx * abx + aby * aby + abz * abz);
			s->per_bc.at[i] = per(bcx * bcx + bcy * bcy + bcz * bcz);
			s->per_ca.at[i] = per(cax * cax + cay * cay + caz * caz);
		}
}

/* Squared distance of the origin from the segment that goes from a along d; per: 1 / d^2. */
static inline double side2(double ax, double ay, double az, double dx, double dy, double dz,
                           double per_d)
{
	const double along = -(ax * dx + ay * dy + az * dz) * per_d;
	const double t = along > 0 ? along < 1 ? along : 1 : 0;
	const double x = ax + t * dx, y = ay + t * dy, z = az + t * dz;
	return x * x + y * y + z * z;
}

/* Squared distance of p from the nearest face: where the foot of the perpendicular is inside, it is
 * the height over the plane, else the nearest of the three sides is. */
WH_VECTOR_CLONES static double nearest2(const surface *restrict s, wh_vec3 p)
{
	double least[WH_LANES];
	for (size_t lane = 0; lane < WH_LANES; lane++)
		least[lane] = (double)INFINITY;
	for (size_t first = 0; first < s->n; first += WH_LANES)
		for (size_t lane = 0; lane < WH_LANES; lane++) {
			const size_t i = first + lane;
			const double ax = s->a.x.at[i] - p.x, bx = s->b.x.at[i] - p.x;
			const double ay = s->a.y.at[i] - p.y, by = s->b.y.at[i] - p.y;
			const double az = s->a.z.at[i] - p.z, bz = s->b.z.at[i] - p.z;
			const double cx = s->c.x.at[i] - p.x;
			const double cy = s->c.y.at[i] - p.y;
			const double cz = s->c.z.at[i] - p.z;
			const double in_ab = ax * s->left_ab.x.at[i] + ay * s->left_ab.y.at[i] +
			                     az * s->left_ab.z.at[i];
			const double in_bc = bx * s->left_bc.x.at[i] + by * s->left_bc.y.at[i] +
			                     bz * s->left_bc.z.at[i];
			const double in_ca = cx * s->left_ca.x.at[i] + cy * s->left_ca.y.at[i] +
			                     cz * s->left_ca.z.at[i];
			const double height = ax * s->normal.x.at[i] + ay * s->normal.y.at[i] +
			                      az * s->normal.z.at[i];
			const double plane2 = height * height * s->per_normal.at[i];
			const double ab2 = side2(ax, ay, az, s->ab.x.at[i], s->ab.y.at[i],
			                         s->ab.z.at[i], s->per_ab.at[i]);
			const double bc2 = side2(bx, by, bz, s->bc.x.at[i], s->bc.y.at[i],
			                         s->bc.z.at[i], s->per_bc.at[i]);
			const double ca2 = side2(cx, cy, cz, s->ca.x.at[i], s->ca.y.at[i],
			                         s->ca.z.at[i], s->per_ca.at[i]);
			const double bc_ca2 = bc2 < ca2 ? bc2 : ca2;
			const double sides2 = ab2 < bc_ca2 ? ab2 : bc_ca2;
			const bool inside =
			    (in_ab >= 0) & (in_bc >= 0) & (in_ca >= 0) & (s->per_normal.at[i] > 0);
			const double d2 = inside ? plane2 : sides2;
			least[lane] = d2 < least[lane] ? d2 : least[lane];
		}
	double all = least[0];
	for (size_t lane = 1; lane < WH_LANES; lane++)
		all = least[lane] < all ? least[lane] : all;
	return all;
}

/* The faces around the ends before the collapse, or (`after`) around the new vertex. */
static void gather(const wh_engine *e, const wh_trial *t, bool after, surface *s)
{
	s->n = 0;
	for (uint32_t i = 0; i < t->faces; i++)
		add_face(s, tip(t, i, after), wh_rows3_at(&t->at, i), wh_rows3_at(&t->at, i + 1));
	const wh_vec3 hub = e->w->star[t->into_locked ? t->u : t->v].pos;
	for (uint32_t i = 0; !after && i < t->nshared; i++)
		add_face(s, wh_v3(0, 0, 0), t->edge, wh_sub(e->w->star[t->apex[i]].pos, hub));
	while (s->n % WH_LANES) /* a face that is there twice changes nothing */
		add_face(s, wh_rows3_at(&s->a, 0), wh_rows3_at(&s->b, 0), wh_rows3_at(&s->c, 0));
	prepare(s);
}

static void stretch_to(const surface *s, wh_vec3 point, stretch *most)
{
	if (most->far2 <= most->limit2)
		most->far2 = fmax(most->far2, nearest2(s, point));
}

double wh_trial_distance(const wh_engine *e, const wh_trial *t)
{
	surface before, after;
	const double base = fmax((double)e->p->err[t->u], (double)e->p->err[t->v]);
	const double left = e->params->max_err - base;
	stretch s = {.far2 = 0, .limit2 = left > 0 ? left * left : 0};
	gather(e, t, true, &after);
	stretch_to(&after, wh_v3(0, 0, 0), &s);
	if (!t->into_locked)
		stretch_to(&after, t->edge, &s);
	if (!(s.far2 <= s.limit2))
		return base + sqrt(s.far2);
	gather(e, t, false, &before);
	if (!t->into_locked)
		stretch_to(&before, t->to, &s);
	for (uint32_t i = 0; i < t->n; i++) {
		const wh_vec3 q = wh_rows3_at(&t->at, i);
		const uint32_t last = i ? i - 1 : t->n - 1;
		stretch_to(&before, wh_scale(wh_add(q, t->to), 0.5), &s);
		if (i < t->faces)
			stretch_to(&after, wh_scale(wh_add(q, tip(t, i, false)), 0.5), &s);
		if (last < t->faces && (i == t->faces || t->theirs.at[i] != t->theirs.at[last]))
			stretch_to(&after, wh_scale(wh_add(q, tip(t, last, false)), 0.5), &s);
	}
	return base + sqrt(s.far2);
}
