/*
 * What attributes with weights add to the cost of an edge: how far they would be off in the place
 * that geometry chose.
 *
 * Idea. Each face around the edge says what a value would be there (blend.c); what counts is the
 * squares of the differences from their mean, which is what the value will be, with the weights of
 * the faces in fan.c, so that both parts of the cost have one unit (Garland & Heckbert 1998 put
 * both into one quadric, Hoppe 1999 made it small and memoryless). A face around vertex v with the
 * weight w says, at y from v, a(v) + g y, with g the gradient over its plane; so all of them say
 *
 *     sum w (a(v) + g y - b)^2  =  W d^2 + 2 d G y + y' T y,     d = a(v) - b
 *
 * with W, G and T the sums of w, w g and w g g' around v, and T summed over all attributes at once:
 * seven numbers of a vertex, and three for each attribute, are kept until a face around it changes.
 * An edge takes those of both ends, with its own faces in both: taking them out of one made no
 * difference to the results, and took half as much time again. RMS of the difference of colour and
 * that of distance in millionths of the diagonal, two scans at 30, 10 and 2 %, with weights of
 *
 *     0      2.69  78.4   5.09 198.4   9.22  755      5.20  42.7   7.62 141.0   11.38  658
 *     0.1    2.65  78.2   5.12 197.0   9.28  751      4.87  43.0   7.62 141.4   11.19  672
 *     0.3    2.29  78.5   4.68 197.9   9.14  753      4.01  48.0   7.32 141.4   11.32  664
 *     1      1.62  82.6   3.68 204.7   8.97  763      3.33  66.7   6.40 168.6   10.95  665
 *     3      1.27  97.5   2.73 233.2   7.06  810      3.16  89.8   6.02 228.8   10.10  780
 *     10     1.13 126.5   2.40 300.7   5.97 1031      3.14 109.7   5.91 294.9    9.75 1055
 *
 * A value that is no number differs from none.
 *
 * Time: for a vertex that is evaluated, and for one whose faces have changed, a pass over its faces
 * for each attribute, eight side by side; a few dozen operations for each edge that is asked for.
 */
#include "algo/simplify_engine.h"
#include "io/attributes.h"

#include <math.h>
#include <string.h>

/* An attribute that is a number, and one that is a label; each counts times its unit. */
typedef struct part {
	const wh_attribute *of;
	double unit;
} part;

/* What is around a vertex, seen from there: neighbours, and the faces between each and the next;
 * after the last of a closed ring the first again, then faces that are nothing. */
typedef struct round_vertex {
	wh_rows3 to;
	wh_row weight;   /* of faces */
	wh_row *value;   /* of each number: less the vertex's, times the unit */
	wh_rows3 *slope; /* of each number: its gradient over the faces, in the same unit */
} round_vertex;

/* Places in what is kept of a vertex. */
enum { WEIGHT, XX, XY, XZ, YY, YZ, ZZ, SLOPES };

struct wh_gradients {
	round_vertex around;
	bool asked[WH_ROW]; /* about this edge of the fan */
	bool has_hub;
	uint32_t numbers, labels, stride; /* of sums */
	part *number, *label;
	double *of_hub, *of_other; /* sums of both ends */
	float *sum;                /* of each vertex; the weight below 0: not known */
	size_t cap, cap_value, cap_slope, cap_of, cap_sum;
};

static bool counts(const wh_attribute *a)
{
	return a->weight > 0;
}

static bool is_number(const wh_attribute *a)
{
	return a->kind != WH_KIND_LABEL;
}

static uint32_t stride_of(const wh_attributes *as)
{
	uint32_t numbers = 0;
	for (uint32_t i = 0; i < as->n; i++)
		numbers += counts(&as->item[i]) && is_number(&as->item[i]);
	return SLOPES + 3 * numbers;
}

size_t wh_simplify_attribute_bytes(const wh_attributes *as)
{
	return as && as->weighted ? stride_of(as) * sizeof(float) : 0;
}

/* ---- faces -------------------------------------------------------------------------------- */

static double value_of(const part *p, const uint8_t *record)
{
	return p->unit * wh_attribute_get(p->of, record);
}

static double difference(double a, double b)
{
	const double d = a - b;
	return isfinite(d) ? d : 0;
}

/* Values of the neighbours of v; none where no face is. */
static void gather_values(const wh_engine *e, uint32_t v, uint32_t faces, const part *p, wh_row *to)
{
	const wh_star *s = &e->w->star[v];
	const uint32_t *ring = wh_ring(e, v);
	const double own = value_of(p, wh_patch_attr(e->p, v));
	for (uint32_t i = 0; i <= faces && faces; i++) {
		const uint8_t *record = wh_patch_attr(e->p, ring[i < s->n ? i : 0]);
		to->at[i] = difference(value_of(p, record), own);
	}
	for (uint32_t i = faces + 1; i <= faces + WH_LANES && i < WH_ROW; i++)
		to->at[i] = 0;
}

/* Takes out what is around v; returns the number of its faces. */
static uint32_t gather(const wh_engine *e, uint32_t v, round_vertex *r)
{
	const struct wh_gradients *g = e->w->gradients;
	const wh_star *s = &e->w->star[v];
	const uint32_t *ring = wh_ring(e, v), faces = s->n ? s->n - !s->closed : 0;
	for (uint32_t i = 0; i <= faces && faces; i++) {
		const wh_vec3 at = e->w->star[ring[i < s->n ? i : 0]].pos, to = wh_sub(at, s->pos);
		r->to.x.at[i] = to.x;
		r->to.y.at[i] = to.y;
		r->to.z.at[i] = to.z;
	}
	for (uint32_t i = faces + 1; i <= faces + WH_LANES && i < WH_ROW; i++)
		r->to.x.at[i] = r->to.y.at[i] = r->to.z.at[i] = 0;
	for (uint32_t k = 0; k < g->numbers; k++)
		gather_values(e, v, faces, &g->number[k], &r->value[k]);
	return faces;
}

/* Weights and slopes of the faces. */
WH_VECTOR_CLONES static void slope_faces(round_vertex *restrict r, size_t faces, size_t numbers)
{
	for (size_t first = 0; first < faces; first += WH_LANES) {
		double bx[WH_LANES], by[WH_LANES], bz[WH_LANES]; /* of the value at the next */
		double dx[WH_LANES], dy[WH_LANES], dz[WH_LANES]; /* and at this neighbour */
		for (size_t lane = 0; lane < WH_LANES; lane++) {
			const size_t i = first + lane;
			const double ax = r->to.x.at[i], cx = r->to.x.at[i + 1];
			const double ay = r->to.y.at[i], cy = r->to.y.at[i + 1];
			const double az = r->to.z.at[i], cz = r->to.z.at[i + 1];
			const double nx = ay * cz - az * cy;
			const double ny = az * cx - ax * cz;
			const double nz = ax * cy - ay * cx;
			const double n2 = nx * nx + ny * ny + nz * nz;
			const bool is = (i < faces) & (n2 > 0) & (1 / n2 < (double)INFINITY);
			const double per = is ? 1 / n2 : 0.0;
			r->weight.at[i] = is ? n2 * wh_face_weight(n2) : 0.0;
			bx[lane] = (ny * az - nz * ay) * per;
			by[lane] = (nz * ax - nx * az) * per;
			bz[lane] = (nx * ay - ny * ax) * per;
			dx[lane] = (cy * nz - cz * ny) * per;
			dy[lane] = (cz * nx - cx * nz) * per;
			dz[lane] = (cx * ny - cy * nx) * per;
		}
		for (size_t k = 0; k < numbers; k++)
			for (size_t lane = 0; lane < WH_LANES; lane++) {
				const size_t i = first + lane;
				const double a = r->value[k].at[i], c = r->value[k].at[i + 1];
				r->slope[k].x.at[i] = dx[lane] * a + bx[lane] * c;
				r->slope[k].y.at[i] = dy[lane] * a + by[lane] * c;
				r->slope[k].z.at[i] = dz[lane] * a + bz[lane] * c;
			}
	}
}

WH_VECTOR_CLONES static void add_up(const round_vertex *restrict r, size_t faces, size_t numbers,
                                    double *restrict sum)
{
	double t[SLOPES][WH_LANES] = {{0}};
	for (size_t first = 0; first < faces; first += WH_LANES)
		for (size_t lane = 0; lane < WH_LANES; lane++)
			t[WEIGHT][lane] += r->weight.at[first + lane];
	for (size_t k = 0; k < numbers; k++) {
		double s[3][WH_LANES] = {{0}};
		for (size_t first = 0; first < faces; first += WH_LANES)
			for (size_t lane = 0; lane < WH_LANES; lane++) {
				const size_t i = first + lane;
				const double x = r->slope[k].x.at[i], y = r->slope[k].y.at[i];
				const double z = r->slope[k].z.at[i], w = r->weight.at[i];
				const double wx = w * x, wy = w * y, wz = w * z;
				s[0][lane] += wx;
				s[1][lane] += wy;
				s[2][lane] += wz;
				t[XX][lane] += wx * x;
				t[XY][lane] += wx * y;
				t[XZ][lane] += wx * z;
				t[YY][lane] += wy * y;
				t[YZ][lane] += wy * z;
				t[ZZ][lane] += wz * z;
			}
		for (size_t j = 0; j < 3; j++)
			sum[SLOPES + 3 * k + j] = wh_sum_lanes(s[j]);
	}
	for (size_t j = 0; j < SLOPES; j++)
		sum[j] = wh_sum_lanes(t[j]);
}

/* ---- sums --------------------------------------------------------------------------------- */

/* Adds up what is around v, into `sum`, and keeps it. */
static void sum_around(const wh_engine *e, uint32_t v, double *sum)
{
	struct wh_gradients *g = e->w->gradients;
	float *kept = &g->sum[(size_t)v * g->stride];
	const uint32_t faces = gather(e, v, &g->around);
	slope_faces(&g->around, faces, g->numbers);
	add_up(&g->around, faces, g->numbers, sum);
	for (uint32_t j = 0; j < g->stride; j++)
		kept[j] = (float)sum[j];
}

/* The sums of v, as they are kept: whoever asks first gets the same as all others. */
static void find_sum(const wh_engine *e, uint32_t v, double *sum)
{
	const struct wh_gradients *g = e->w->gradients;
	const float *kept = &g->sum[(size_t)v * g->stride];
	if (kept[WEIGHT] < 0)
		sum_around(e, v, sum);
	for (uint32_t j = 0; j < g->stride; j++)
		sum[j] = (double)kept[j];
}

/* ---- costs -------------------------------------------------------------------------------- */

static double form(const double *sum, wh_vec3 y)
{
	return sum[XX] * y.x * y.x + sum[YY] * y.y * y.y + sum[ZZ] * y.z * y.z +
	       2 * (sum[XY] * y.x * y.y + sum[XZ] * y.x * y.z + sum[YZ] * y.y * y.z);
}

static double along(const double *sum, uint32_t k, wh_vec3 y)
{
	const double *s = &sum[SLOPES + 3 * k];
	return s[0] * y.x + s[1] * y.y + s[2] * y.z;
}

/* Of the numbers, at y from the hub: less what they are at the other end, which is locked. */
static double cost_of_locked(const struct wh_gradients *g, wh_vec3 y, const uint8_t *ours,
                             const uint8_t *theirs)
{
	double cost = form(g->of_hub, y);
	for (uint32_t k = 0; k < g->numbers; k++) {
		const part *p = &g->number[k];
		const double d = difference(value_of(p, ours), value_of(p, theirs));
		cost += d * (g->of_hub[WEIGHT] * d + 2 * along(g->of_hub, k, y));
	}
	return cost;
}

/* Of the numbers, at y from the hub and z from the other end: less their mean. */
static double cost_of_free(const struct wh_gradients *g, wh_vec3 y, wh_vec3 z, const uint8_t *ours,
                           const uint8_t *theirs)
{
	const double w = g->of_other[WEIGHT], all = g->of_hub[WEIGHT] + w;
	double cost = form(g->of_hub, y) + form(g->of_other, z);
	if (!(all > 0))
		return 0;
	for (uint32_t k = 0; k < g->numbers; k++) {
		const part *p = &g->number[k];
		const double d = difference(value_of(p, theirs), value_of(p, ours));
		const double other = along(g->of_other, k, z);
		const double sum = along(g->of_hub, k, y) + w * d + other;
		cost += d * (w * d + 2 * other) - sum * sum / all;
	}
	return cost;
}

/* Labels that change are wrong in all faces around the end that had them. */
static double cost_of_labels(const struct wh_gradients *g, const uint8_t *ours,
                             const uint8_t *theirs, double lost)
{
	double cost = 0;
	for (uint32_t k = 0; k < g->labels; k++) {
		const part *p = &g->label[k];
		const uint32_t at = p->of->at;
		if (memcmp(ours + at, theirs + at, wh_attribute_bytes(p->of)) != 0)
			cost += p->unit * p->unit * lost;
	}
	return cost;
}

static double cost_of(const wh_engine *e, uint32_t hub, const wh_fan *f, uint32_t i)
{
	struct wh_gradients *g = e->w->gradients;
	const wh_vec3 y = wh_rows3_at(&f->place, i), edge = wh_rows3_at(&f->to, i);
	const uint8_t *ours = wh_patch_attr(e->p, hub), *theirs = wh_patch_attr(e->p, f->id[i]);
	double lost = g->of_hub[WEIGHT], cost;
	if (wh_is_locked(e, f->id[i])) {
		cost = cost_of_locked(g, y, ours, theirs);
	} else {
		find_sum(e, f->id[i], g->of_other);
		cost = cost_of_free(g, y, wh_sub(y, edge), ours, theirs);
		if (2 * wh_dot(y, edge) <= wh_norm2(edge))
			lost = g->of_other[WEIGHT];
	}
	cost += cost_of_labels(g, ours, theirs, lost);
	return cost > 0 && isfinite(cost) ? cost : 0;
}

bool wh_blend_weigh(const wh_engine *e, uint32_t hub, wh_fan *f, uint32_t i)
{
	struct wh_gradients *g = e->w->gradients;
	if (g->asked[i])
		return false;
	if (!g->has_hub)
		find_sum(e, hub, g->of_hub);
	g->asked[i] = g->has_hub = true;
	f->cost.at[i] += cost_of(e, hub, f, i);
	return true;
}

void wh_blend_fan(const wh_engine *e)
{
	struct wh_gradients *g = e->w->gradients;
	memset(g->asked, 0, e->w->fan.n * sizeof *g->asked);
	g->has_hub = false;
}

void wh_blend_changed(wh_engine *e, uint32_t v)
{
	struct wh_gradients *g = e->w->gradients;
	g->sum[(size_t)v * g->stride + WEIGHT] = -1;
}

/* ---- guesses ------------------------------------------------------------------------------ */

/* Of the numbers, when a vertex takes the place and the values of each neighbour. */
WH_VECTOR_CLONES static void cost_of_becoming(const round_vertex *restrict r, size_t n,
                                              size_t numbers, const double *restrict sum,
                                              double *restrict cost)
{
	for (size_t first = 0; first < n; first += WH_LANES) {
		for (size_t lane = 0; lane < WH_LANES; lane++) {
			const size_t i = first + lane;
			const double x = r->to.x.at[i], y = r->to.y.at[i], z = r->to.z.at[i];
			cost[i] = x * (sum[XX] * x + 2 * (sum[XY] * y + sum[XZ] * z)) +
			          y * (sum[YY] * y + 2 * sum[YZ] * z) + sum[ZZ] * z * z;
		}
		for (size_t k = 0; k < numbers; k++)
			for (size_t lane = 0; lane < WH_LANES; lane++) {
				const size_t i = first + lane;
				const double *s = &sum[SLOPES + 3 * k], d = r->value[k].at[i];
				const double said = s[0] * r->to.x.at[i] + s[1] * r->to.y.at[i] +
				                    s[2] * r->to.z.at[i];
				cost[i] += d * (sum[WEIGHT] * d - 2 * said);
			}
	}
}

double wh_blend_guess(const wh_engine *e, uint32_t v)
{
	struct wh_gradients *g = e->w->gradients;
	const uint32_t n = e->w->star[v].n;
	wh_row cost;
	double least = INFINITY;
	sum_around(e, v, g->of_other);
	cost_of_becoming(&g->around, n, g->numbers, g->of_other, cost.at);
	for (uint32_t i = 0; i < n; i++)
		least = cost.at[i] < least ? cost.at[i] : least;
	return least > 0 && isfinite(least) ? least : 0;
}

/* ---- beginning, end ----------------------------------------------------------------------- */

void wh_gradients_free(wh_ctx *c, struct wh_gradients *g)
{
	if (!g)
		return;
	wh_free(c, g->number);
	wh_free(c, g->around.value);
	wh_free(c, g->around.slope);
	wh_free(c, g->of_hub);
	wh_free(c, g->sum);
	wh_free(c, g);
}

/* Room for n numbers and labels in all, for what is around a vertex, and for all sums. */
static wh_code make_room(wh_ctx *c, struct wh_gradients *g, uint32_t n, uint32_t nv)
{
	if (wh_reserve(c, &g->number, &g->cap, n, sizeof *g->number) != WH_OK ||
	    wh_reserve(c, &g->around.value, &g->cap_value, g->numbers, sizeof *g->around.value) !=
	        WH_OK ||
	    wh_reserve(c, &g->around.slope, &g->cap_slope, g->numbers, sizeof *g->around.slope) !=
	        WH_OK ||
	    wh_reserve(c, &g->of_hub, &g->cap_of, 2 * (size_t)g->stride, sizeof *g->of_hub) !=
	        WH_OK ||
	    wh_reserve(c, &g->sum, &g->cap_sum, (size_t)nv * g->stride, sizeof *g->sum) != WH_OK)
		return c->err.code;
	g->label = g->number + g->numbers;
	g->of_other = g->of_hub + g->stride;
	return WH_OK;
}

/* Sets apart the numbers and the labels that count. */
static void sort_out(struct wh_gradients *g, const wh_attributes *as, double unit)
{
	uint32_t numbers = 0;
	g->labels = 0;
	for (uint32_t i = 0; i < as->n; i++) {
		const wh_attribute *a = &as->item[i];
		if (counts(a))
			*(is_number(a) ? &g->number[numbers++] : &g->label[g->labels++]) =
			    (part){a, a->weight * unit};
	}
}

wh_code wh_blend_begin(wh_engine *e)
{
	const wh_attributes *as = e->params->attributes;
	struct wh_gradients *g = e->w->gradients;
	uint32_t all = 0;
	if (!g)
		g = e->w->gradients = wh_calloc(e->c, 1, sizeof *g);
	if (!g)
		return e->c->err.code;
	for (uint32_t i = 0; i < as->n; i++)
		all += counts(&as->item[i]);
	g->stride = stride_of(as);
	g->numbers = (g->stride - SLOPES) / 3;
	if (make_room(e->c, g, all, e->p->nv) != WH_OK)
		return e->c->err.code;
	sort_out(g, as, e->params->attribute_unit);
	for (uint32_t v = 0; v < e->p->nv; v++)
		wh_blend_changed(e, v);
	return WH_OK;
}
