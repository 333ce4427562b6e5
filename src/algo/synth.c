/*
 * synth: from a number to a vertex or a face.
 *
 * A shape (synth_sphere.c, synth_torus.c, synth_terrain.c) numbers its grid's vertices and cells
 * row by row. A vertex is the shape's base point, moved along its normal by the relief, then by
 * measurement noise hashed from its number; rounded to multiples of 2^-10. A cell is two
 * triangles; the shorter diagonal where the shape says that one is much shorter, else a hash
 * decides, so that valences vary as in a scan.
 *
 * Shuffled order: slot i of the file holds vertex P(i), so that a face's corners are the
 * inverses of P; faces have a permutation of their own.
 */
#include "algo/synth_internal.h"

static const double UNIT = 0x1p-10;        /* of positions */
static const double NOISE_SPACING = 300.0; /* coarser samples get no more noise than these */
static const double TANGENTIAL = 0.15;     /* share of the noise that is not along the normal */
static const double MAX_OFFSET = 0x1p42;   /* plus a coordinate: still exact in a double */

wh_synth_params wh_synth_defaults(void)
{
	return (wh_synth_params){.kind = WH_SYNTH_SPHERE,
	                         .faces = 1000000,
	                         .noise = 0.1,
	                         .relief = 0.05,
	                         .holes = WH_SYNTH_AUTO_HOLES};
}

/* ---- opening ---- */

static wh_code check_share(wh_ctx *c, const char *what, double x, double most)
{
	if (x >= 0.0 && x <= most)
		return WH_OK;
	return wh_fail(c, WH_E_USAGE, "%s has to be between 0 and %g", what, most);
}

static wh_code check_params(wh_ctx *c, const wh_synth_params *p)
{
	if (p->faces < WH_SYNTH_MIN_FACES)
		return wh_fail(c, WH_E_USAGE, "a surface has at least %d faces",
		               WH_SYNTH_MIN_FACES);
	if (p->faces >= UINT64_C(2) * UINT32_MAX - (1u << 20))
		return wh_fail(c, WH_E_USAGE, "PLY cannot number the vertices of so many faces");
	if (p->holes != WH_SYNTH_AUTO_HOLES && p->kind != WH_SYNTH_TERRAIN)
		return wh_fail(c, WH_E_USAGE, "only a terrain has holes");
	if (p->holes < WH_SYNTH_AUTO_HOLES || p->holes > WH_SYNTH_MAX_HOLES)
		return wh_fail(c, WH_E_USAGE, "a terrain has 0 to %d holes", WH_SYNTH_MAX_HOLES);
	for (int i = 0; i < 3; i++)
		if (!(fabs(p->offset[i]) <= MAX_OFFSET))
			return wh_fail(c, WH_E_USAGE, "the offset has to stay below 2^42");
	wh_code code = check_share(c, "the noise", p->noise, 1.0);
	if (code == WH_OK)
		code = check_share(c, "the relief", p->relief, 0.2);
	if (code == WH_OK)
		code = check_share(c, "the flat share", p->flat, 0.8);
	return code;
}

/* x in units of 2^-10, rounded half up. */
static int64_t to_fixed(double x)
{
	const double y = x / UNIT + 0.5;
	const int64_t i = (int64_t)y;
	return (double)i > y ? i - 1 : i;
}

static const synth_shape *shape_of(wh_synth_kind kind)
{
	static const synth_shape *const shapes[] = {
	    [WH_SYNTH_SPHERE] = &synth_sphere,
	    [WH_SYNTH_TORUS] = &synth_torus,
	    [WH_SYNTH_TERRAIN] = &synth_terrain,
	};
	return shapes[kind];
}

static void set_params(wh_synth *s, const wh_synth_params *p)
{
	s->p = *p;
	for (int i = 0; i < 3; i++) {
		s->p.offset[i] = (double)to_fixed(p->offset[i]) * UNIT;
		s->p.is_double |= s->p.offset[i] != 0.0;
	}
	s->shape = shape_of(p->kind);
	wh_rng rng = wh_rng_seed(p->seed);
	s->seed_of_noise = wh_rng_next(&rng);
	s->seed_of_cells = wh_rng_next(&rng);
	s->seed_of_color = wh_rng_next(&rng);
	s->seed_of_holes = wh_rng_next(&rng);
}

wh_code wh_synth_open(wh_ctx *c, wh_synth **out, const wh_synth_params *p)
{
	*out = NULL;
	wh_code code = check_params(c, p);
	if (code != WH_OK)
		return code;
	wh_synth *s = wh_calloc(c, 1, sizeof *s);
	if (!s)
		return c->err.code;
	set_params(s, p);
	code = s->shape->plan(c, s);
	if (code != WH_OK) {
		wh_synth_close(c, &s);
		return code;
	}
	synth_relief_init(&s->relief, p->seed ^ UINT64_C(0x7265), p->relief * s->shape->size,
	                  s->shape->longest, s->spacing);
	s->vertex_order = wh_permute_make(p->seed ^ UINT64_C(0x7665), s->nv);
	s->face_order = wh_permute_make(p->seed ^ UINT64_C(0x6661), 2 * s->ncells);
	*out = s;
	return WH_OK;
}

void wh_synth_close(wh_ctx *c, wh_synth **s)
{
	if (!*s)
		return;
	wh_free(c, (*s)->vertices.span);
	wh_free(c, (*s)->vertices.row_start);
	wh_free(c, (*s)->cells.span);
	wh_free(c, (*s)->cells.row_start);
	wh_free(c, *s);
	*s = NULL;
}

uint64_t wh_synth_vertices(const wh_synth *s)
{
	return s->nv;
}

uint64_t wh_synth_faces(const wh_synth *s)
{
	return 2 * s->ncells;
}

uint64_t wh_synth_holes(const wh_synth *s)
{
	return s->nholes;
}

void wh_synth_offset(const wh_synth *s, double offset[3])
{
	for (int i = 0; i < 3; i++)
		offset[i] = s->p.offset[i];
}

/* ---- vertices ---- */

/* Sum of four uniform numbers, deviation 1, never beyond 3.5: near enough to normal. */
static double bell(uint64_t h)
{
	const uint64_t sum = (h & 0xffff) + (h >> 16 & 0xffff) + (h >> 32 & 0xffff) + (h >> 48);
	return ((double)sum - 131070.0) / 37837.0;
}

static double centred(uint64_t bits)
{
	return (double)(bits & 0xfffff) * 0x1p-19 - 1.0;
}

static wh_vec3 measured(const wh_synth *s, uint64_t vertex, wh_vec3 at, wh_vec3 normal)
{
	const double spacing = s->spacing < NOISE_SPACING ? s->spacing : NOISE_SPACING;
	const double deviation = s->p.noise * spacing;
	const uint64_t h = wh_mix64(s->seed_of_noise + 2 * vertex);
	const uint64_t g = wh_mix64(s->seed_of_noise + 2 * vertex + 1);
	const wh_vec3 side = wh_v3(centred(g), centred(g >> 20), centred(g >> 40));
	return wh_add(at, wh_add(wh_scale(normal, deviation * bell(h)),
	                         wh_scale(side, deviation * TANGENTIAL)));
}

typedef struct relieved {
	wh_vec3 point, normal;
	double height, rough;
} relieved;

/* The surface without measurement noise. */
static relieved surface_at(const wh_synth *s, wh_vec3 param, synth_cursor *k)
{
	const synth_base b = s->shape->base(s, param);
	relieved r = {.point = b.point, .normal = b.normal};
	if (b.mask > 0.0) {
		r.height = b.mask * synth_relief_at(&s->relief, b.point, k, &r.rough);
		r.point = wh_add(b.point, wh_scale(b.normal, r.height));
	}
	return r;
}

static void normal_at(const wh_synth *s, wh_vec3 param, wh_vec3 here, synth_cursor *k,
                      double normal[3])
{
	wh_vec3 step[2];
	s->shape->steps(s, param, step);
	const wh_vec3 a = surface_at(s, wh_add(param, step[0]), k).point;
	const wh_vec3 b = surface_at(s, wh_add(param, step[1]), k).point;
	const wh_vec3 n = wh_cross(wh_sub(a, here), wh_sub(b, here));
	const double scale = 1.0 / wh_norm(n);
	normal[0] = n.x * scale;
	normal[1] = n.y * scale;
	normal[2] = n.z * scale;
}

/* Low places green, high ones grey, rough ones darker, and a grain over all. */
static void color_at(const wh_synth *s, uint64_t vertex, const relieved *r, uint8_t color[3])
{
	const double most = s->relief.height > 0.0 ? s->relief.height : 1.0;
	const double high = synth_smoothstep(0.5 + 0.8 * r->height / most);
	const double grain = 10.0 * centred(wh_mix64(s->seed_of_color + vertex));
	const double dim = 1.0 - 0.3 * r->rough;
	const double low_end[3] = {92.0, 128.0, 74.0}, high_end[3] = {206.0, 200.0, 190.0};
	for (int i = 0; i < 3; i++) {
		const double v = (low_end[i] + (high_end[i] - low_end[i]) * high) * dim + grain;
		color[i] = (uint8_t)(v + 0.5); /* between 41 and 217 by the constants above */
	}
}

void synth_vertex_at(const wh_synth *s, uint64_t slot, synth_cursor *k, synth_vertex *v)
{
	const uint64_t vertex = s->p.shuffled ? wh_permute_at(&s->vertex_order, slot) : slot;
	const wh_vec3 param = s->shape->param(s, vertex, k);
	const relieved r = surface_at(s, param, k);
	const wh_vec3 p = measured(s, vertex, r.point, r.normal);
	v->fixed[0] = to_fixed(p.x);
	v->fixed[1] = to_fixed(p.y);
	v->fixed[2] = to_fixed(p.z);
	if (s->p.normals)
		normal_at(s, param, r.point, k, v->normal);
	if (s->p.colors)
		color_at(s, vertex, &r, v->color);
}

/* ---- faces ---- */

/* The cell's diagonal: 0 from corner 0 to 2, 1 from 1 to 3. */
static unsigned diagonal(const wh_synth *s, uint64_t cell, double skew)
{
	if (skew > 0.2)
		return 0;
	if (skew < -0.2)
		return 1;
	return wh_mix64(s->seed_of_cells + cell) & 1;
}

void synth_face_at(const wh_synth *s, uint64_t slot, synth_cursor *k, uint64_t ids[3])
{
	/* corners of the two triangles, for either diagonal */
	static const uint8_t corner[2][2][3] = {{{0, 1, 2}, {0, 2, 3}}, {{0, 1, 3}, {1, 2, 3}}};
	const uint64_t face = s->p.shuffled ? wh_permute_at(&s->face_order, slot) : slot;
	synth_quad q;
	s->shape->quad(s, face / 2, k, &q);
	const uint8_t *at = corner[diagonal(s, face / 2, q.skew)][face & 1];
	if (!s->p.shuffled) {
		for (int i = 0; i < 3; i++)
			ids[i] = q.v[at[i]];
		return;
	}
	const uint64_t turn = wh_mix64(s->seed_of_cells ^ ~face) % 3;
	for (uint64_t i = 0; i < 3; i++)
		ids[i] = wh_permute_source(&s->vertex_order, q.v[at[(i + turn) % 3]]);
}

/* ---- in memory ---- */

wh_code wh_synth_mesh(wh_ctx *c, const wh_synth *s, wh_mesh *m)
{
	*m = (wh_mesh){0};
	if (s->nv >= UINT32_MAX || 2 * s->ncells >= UINT32_MAX)
		return wh_fail(c, WH_E_PLAN, "a mesh in memory has fewer than 2^32 - 1 faces");
	const wh_code code = wh_mesh_alloc(c, m, (uint32_t)s->nv, (uint32_t)(2 * s->ncells));
	if (code != WH_OK)
		return code;
	synth_cursor k;
	synth_cursor_init(&k);
	for (uint32_t i = 0; i < m->nv; i++) {
		synth_vertex v;
		synth_vertex_at(s, i, &k, &v);
		m->pos[i] = wh_v3((double)v.fixed[0] * UNIT + s->p.offset[0],
		                  (double)v.fixed[1] * UNIT + s->p.offset[1],
		                  (double)v.fixed[2] * UNIT + s->p.offset[2]);
	}
	for (uint32_t i = 0; i < m->nf; i++) {
		uint64_t ids[3];
		synth_face_at(s, i, &k, ids);
		for (uint32_t j = 0; j < 3; j++)
			m->tri[3 * (size_t)i + j] = (uint32_t)ids[j];
	}
	return WH_OK;
}
