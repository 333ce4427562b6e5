/* Stars as they are built: rings in order, and sums that are those of the faces around. */
#include "testing.h"

#include "algo/simplify_engine.h"
#include "base/rng.h"

#include <math.h>
#include <string.h>

enum { SIDE = 40 };

typedef struct fixture {
	testing_env t;
	wh_patch p;
	wh_simplify_params params;
	wh_simplify_result result;
	wh_engine e;
} fixture;

/* A rough square whose rows `locked` and up are cut vertices, so that faces between those stay as
 * they are; every fifth face is turned to another first corner. */
static void open_square(fixture *f, uint32_t locked)
{
	*f = (fixture){0};
	testing_init(&f->t);
	wh_ctx *c = &f->t.ctx;
	const uint32_t n = SIDE + 1;
	wh_rng g = wh_rng_seed(11);
	assert_int_equal(wh_patch_reset(c, &f->p, n * n, 2 * SIDE * SIDE), WH_OK);
	for (uint32_t v = 0; v < f->p.nv; v++) {
		f->p.pos[v] = wh_v3(v % n + 0.3 * wh_rng_unit(&g), v / n, wh_rng_unit(&g));
		f->p.gid[v] = v;
		f->p.flag[v] = v / n >= locked ? WH_CUT : 0;
	}
	uint32_t *t = f->p.tri;
	for (uint32_t i = 0; i < f->p.nf; i++, t += 3) {
		const uint32_t a = i / 2 % SIDE + i / 2 / SIDE * n;
		const uint32_t lower[3] = {a, a + 1, a + n}, upper[3] = {a + 1, a + n + 1, a + n};
		for (uint32_t k = 0; k < 3; k++)
			t[k] = (i % 2 ? upper : lower)[(k + (i % 5 == 0)) % 3];
	}
	static const wh_manner manner = {1, 0, 1e-6, 1e-10};
	f->e = (wh_engine){.c = c,
	                   .manner = &manner,
	                   .w = wh_simplify_workspace_new(c),
	                   .p = &f->p,
	                   .params = &f->params,
	                   .result = &f->result,
	                   .faces = f->p.nf,
	                   .vertices = f->p.nv};
	assert_int_equal(wh_stars_build(&f->e), WH_OK);
}

static void drop(fixture *f)
{
	wh_simplify_workspace_free(&f->t.ctx, f->e.w);
	wh_patch_free(&f->t.ctx, &f->p);
	testing_done(&f->t);
}

static void sums_are_those_of_the_faces_around(void **state)
{
	(void)state;
	for (uint32_t locked = SIDE / 2; locked <= SIDE + 1; locked += SIDE / 2 + 1) {
		fixture f;
		open_square(&f, locked);
		uint32_t free_vertices = 0;
		for (uint32_t v = 0; v < f.p.nv; v++) {
			wh_star *s = &f.e.w->star[v], built = *s;
			if (s->n == 0) {
				const wh_vertex_sum none = {0};
				assert_memory_equal(&s->sum, &none, sizeof none);
				continue;
			}
			wh_star_renew(&f.e, v);
			const double *a = &built.sum.xx, *b = &s->sum.xx;
			for (int i = 0; i < 9; i++)
				assert_true(fabs(a[i] - b[i]) <= 1e-12 * s->sum.zz);
			assert_true(fabs(built.guess - s->guess) <= 1e-9 * s->guess);
			free_vertices++;
		}
		assert_int_equal(free_vertices, locked > SIDE ? f.p.nv : locked * (SIDE + 1));
		drop(&f);
	}
}

static void rings_go_round(void **state)
{
	(void)state;
	fixture f;
	open_square(&f, SIDE + 1);
	const uint32_t n = SIDE + 1;
	for (uint32_t v = 0; v < f.p.nv; v++) {
		const wh_star *s = &f.e.w->star[v];
		const uint32_t x = v % n, y = v / n, *r = wh_ring(&f.e, v);
		const bool inside = x && y && x < SIDE && y < SIDE;
		assert_int_equal(s->closed, inside);
		for (uint32_t i = 0; i + !inside < s->n; i++) { /* each step keeps to the left */
			const uint32_t a = r[i], b = r[(i + 1) % s->n];
			const wh_vec3 e = wh_sub(f.p.pos[a], s->pos),
			              g = wh_sub(f.p.pos[b], s->pos);
			assert_true(e.x * g.y - e.y * g.x > 0);
		}
	}
	drop(&f);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	    cmocka_unit_test(sums_are_those_of_the_faces_around),
	    cmocka_unit_test(rings_go_round),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
