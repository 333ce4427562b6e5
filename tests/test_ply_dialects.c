/* Bodies: the same mesh written in every dialect loads as the same mesh. */
#define _GNU_SOURCE
#include "ply_files.h"

#include "base/rng.h"

/* A fan around vertex 0 with whole-number coordinates, which every type can hold. */
enum { NV = 12, NF = 10 };

static double coordinate(int v, int axis)
{
	return axis == 0 ? v : axis == 1 ? (v * v) % 7 : v % 3;
}

static int corner(int f, int k)
{
	return k == 0 ? 0 : f + k;
}

static const char *name_of(wh_rng *r, wh_type t)
{
	static const char *const names[][2] = {
	    {"char", "int8"},     {"uchar", "uint8"},   {"short", "int16"}, {"ushort", "uint16"},
	    {"int", "int32"},     {"uint", "uint32"},   {"long", "int64"},  {"ulong", "uint64"},
	    {"float", "float32"}, {"double", "float64"}};
	return names[t][wh_rng_next(r) % 2];
}

/* One property of the file to come: what it is and of which types. */
typedef struct column {
	char what; /* x, y, z: coordinates; c: corners; u: unused scalar; l: unused list */
	wh_type type, count_type;
} column;

typedef struct element {
	char what; /* v, f, or u for unused */
	int count;
	column columns[8];
	int n;
} element;

static wh_type any(wh_rng *r, int from, int to)
{
	return (wh_type)(from + (int)(wh_rng_next(r) % (uint64_t)(to - from + 1)));
}

static column unused_column(wh_rng *r, bool lists)
{
	const bool list = lists && wh_rng_next(r) % 3 == 0;
	return (column){list ? 'l' : 'u', any(r, WH_I8, WH_F64), any(r, WH_I8, WH_U64)};
}

/* Puts the needed columns in a random order with unused ones between them. */
static void plan(wh_rng *r, element *e, const char *needed, bool lists)
{
	const size_t n = strlen(needed);
	const size_t shift = n ? wh_rng_next(r) % n : 0;
	e->n = 0;
	for (size_t i = 0; i < n; i++) {
		const char what = needed[(i + shift) % n];
		while (wh_rng_next(r) % 3 == 0 && e->n < 4)
			e->columns[e->n++] = unused_column(r, lists);
		e->columns[e->n++] =
		    (column){what, what == 'c' ? any(r, WH_I8, WH_U64) : any(r, WH_I8, WH_F64),
		             any(r, WH_I8, WH_U64)};
	}
	while (wh_rng_next(r) % 2 && e->n < 7)
		e->columns[e->n++] = unused_column(r, lists);
}

static void write_header(wh_rng *r, ply_file *p, const element *e, int n)
{
	char text[4096];
	size_t at = 0;
	for (int i = 0; i < n; i++) {
		at += (size_t)snprintf(text + at, sizeof text - at, "element %s %d\n",
		                       e[i].what == 'v'   ? "vertex"
		                       : e[i].what == 'f' ? "face"
		                                          : "extra",
		                       e[i].count);
		for (int k = 0; k < e[i].n; k++) {
			const column *q = &e[i].columns[k];
			const char name[2] = {q->what, '\0'};
			if (q->what == 'c' || q->what == 'l')
				at += (size_t)snprintf(
				    text + at, sizeof text - at, "property list %s %s %s\n",
				    name_of(r, q->count_type), name_of(r, q->type),
				    q->what == 'c' ? "vertex_indices" : "other");
			else
				at += (size_t)snprintf(text + at, sizeof text - at,
				                       "property %s %s\n", name_of(r, q->type),
				                       q->what == 'u' ? "unused" : name);
		}
	}
	ply_header(p, text);
}

static void write_column(wh_rng *r, ply_file *p, const column *q, int item)
{
	if (q->what == 'c') {
		ply_value(p, q->count_type, 3);
		for (int k = 0; k < 3; k++)
			ply_value(p, q->type, corner(item, k));
	} else if (q->what == 'l') {
		const int n = (int)(wh_rng_next(r) % 5);
		ply_value(p, q->count_type, n);
		for (int k = 0; k < n; k++)
			ply_value(p, q->type, k);
	} else {
		ply_value(p, q->type, q->what == 'u' ? 77 : coordinate(item, q->what - 'x'));
	}
}

static void assert_is_the_fan(const ply_file *p, int workers, const char *why)
{
	testing_env t;
	wh_mesh m;
	testing_init(&t);
	if (ply_load(&t, p, workers, &m, NULL, NULL) != WH_OK)
		fail_msg("%s: %s", why, t.ctx.err.text);
	assert_int_equal(m.nv, NV);
	assert_int_equal(m.nf, NF);
	for (int v = 0; v < NV; v++) {
		const double got[3] = {m.pos[v].x, m.pos[v].y, m.pos[v].z};
		for (int axis = 0; axis < 3; axis++)
			assert_true(got[axis] == coordinate(v, axis));
	}
	for (int f = 0; f < NF; f++)
		for (int k = 0; k < 3; k++)
			assert_int_equal(m.tri[3 * f + k], corner(f, k));
	wh_mesh_free(&t.ctx, &m);
	testing_done(&t);
}

static void write_random(wh_rng *r, ply_file *p)
{
	element e[4];
	const bool lists = wh_rng_next(r) % 2;
	const int vertex = (int)(wh_rng_next(r) % 4);
	int face = (int)(wh_rng_next(r) % 3);
	face += face >= vertex;
	for (int i = 0; i < 4; i++) {
		e[i].what = i == vertex ? 'v' : i == face ? 'f' : 'u';
		e[i].count = i == vertex ? NV : i == face ? NF : (int)(wh_rng_next(r) % 4);
		plan(r, &e[i], i == vertex ? "xyz" : i == face ? "c" : "", lists);
	}
	write_header(r, p, e, 4);
	for (int i = 0; i < 4; i++) {
		for (int item = 0; item < e[i].count; item++) {
			for (int k = 0; k < e[i].n; k++)
				write_column(r, p, &e[i].columns[k], item);
			if (e[i].n > 0)
				ply_item(p);
		}
	}
	ply_end(p);
}

static void types_orders_and_formats_do_not_matter(void **state)
{
	(void)state;
	for (uint64_t seed = 0; seed < 1500; seed++) {
		wh_rng r = wh_rng_seed(seed);
		ply_file p = ply_begin((wh_ply_format)(seed % 3));
		char why[64];
		(void)snprintf(why, sizeof why, "seed %d", (int)seed);
		p.eol = seed % 5 == 0 ? '\r' : seed % 7 == 0 ? 0 : '\n';
		write_random(&r, &p);
		assert_is_the_fan(&p, 1 + (int)(seed % 3), why);
	}
}

static void lines_of_text_need_not_be_items(void **state)
{
	(void)state;
	ply_file p = ply_begin(WH_PLY_ASCII);
	ply_header(&p,
	           "element face 10\nproperty list uchar int vertex_indices\nelement vertex 12\n"
	           "property float x\nproperty float y\nproperty float z\n");
	for (int f = 0; f < NF; f++)
		for (int k = -1; k < 3; k++)
			(void)fprintf(p.f, "%d%s", k < 0 ? 3 : corner(f, k),
			              k == f % 3 ? "\n\n" : " \t");
	for (int v = 0; v < NV; v++)
		for (int k = 0; k < 3; k++)
			(void)fprintf(p.f, " %g ", coordinate(v, k));
	ply_end(&p); /* all vertices in one line, without an end */
	assert_is_the_fan(&p, 2, "words");
}

static void words_behind_the_items_of_lines_are_passed_over(void **state)
{
	(void)state;
	ply_file p = ply_begin(WH_PLY_ASCII);
	ply_header(&p, "element vertex 12\nproperty float x\nproperty float y\nproperty float z\n"
	               "element face 10\nproperty list uchar int vertex_indices\n");
	for (int v = 0; v < NV; v++)
		(void)fprintf(p.f, "%g %g %g 1 2 3\n", coordinate(v, 0), coordinate(v, 1),
		              coordinate(v, 2));
	for (int f = 0; f < NF; f++)
		(void)fprintf(p.f, "\n 3 %d %d %d 255 255\n", corner(f, 0), corner(f, 1),
		              corner(f, 2));
	ply_end(&p);
	assert_is_the_fan(&p, 2, "longer lines");
}

static void bytes_behind_the_last_item_are_accepted(void **state)
{
	(void)state;
	for (int format = WH_PLY_ASCII; format <= WH_PLY_BE; format++) {
		ply_file p = ply_begin((wh_ply_format)format);
		ply_header(&p, "element vertex 12\nproperty float x\nproperty float y\n"
		               "property float z\nelement face 10\n"
		               "property list uchar int vertex_indices\n");
		for (int v = 0; v < NV; v++) {
			for (int k = 0; k < 3; k++)
				ply_value(&p, WH_F32, coordinate(v, k));
			ply_item(&p);
		}
		for (int f = 0; f < NF; f++) {
			ply_value(&p, WH_U8, 3);
			for (int k = 0; k < 3; k++)
				ply_value(&p, WH_I32, corner(f, k));
			ply_item(&p);
		}
		(void)fputs("what else\n is here 1 2 3\n", p.f);
		ply_end(&p);
		assert_is_the_fan(&p, 2, "trailing bytes");
	}
}

/* Doubles keep their digits, floats are rounded once. */
static void precision_follows_the_type(void **state)
{
	(void)state;
	static const char *const types[] = {"float", "double", "int", "short"};
	static const bool wide[] = {false, true, true, false};
	for (int i = 0; i < 4; i++) {
		char text[512];
		(void)snprintf(text, sizeof text,
		               "ply\nformat ascii 1.0\nelement vertex 3\nproperty %s x\n"
		               "property float y\nproperty float z\nelement face 1\n"
		               "property list uchar int vertex_indices\nend_header\n"
		               "16777217 0 0\n1 0 0\n0 1 0\n3 0 1 2\n",
		               types[i]);
		ply_file p = ply_write(text);
		testing_env t;
		wh_mesh m;
		bool is_double;
		testing_init(&t);
		assert_int_equal(ply_load(&t, &p, 2, &m, &is_double, NULL), WH_OK);
		assert_int_equal(is_double, wide[i]);
		assert_true(m.pos[0].x == (wide[i] ? 16777217.0 : 16777216.0));
		wh_mesh_free(&t.ctx, &m);
		testing_done(&t);
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	    cmocka_unit_test(types_orders_and_formats_do_not_matter),
	    cmocka_unit_test(lines_of_text_need_not_be_items),
	    cmocka_unit_test(words_behind_the_items_of_lines_are_passed_over),
	    cmocka_unit_test(bytes_behind_the_last_item_are_accepted),
	    cmocka_unit_test(precision_follows_the_type),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
