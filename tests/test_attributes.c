/*
 * Vertex properties on their way through wh_reduce: kinds and choice, every type in every dialect,
 * what new vertices get, in clusters, streamed and in memory.
 */
#define _XOPEN_SOURCE 700
#include "reduce_files.h"

#include "ply_files.h"

#include "io/attributes.h"
#include "pipeline/measure.h"

#include <math.h>

/* ---- an input: a bumpy square with properties -------------------------------------------------
 */

enum { SIDE = 60, NV = (SIDE + 1) * (SIDE + 1), NF = 2 * SIDE * SIDE };

static wh_vec3 place(uint32_t v)
{
	const double x = v % (SIDE + 1) / (double)SIDE, y = v / (SIDE + 1) / (double)SIDE;
	return wh_v3(x, y,
	             0.02 * sin(7 * x) * cos(5 * y) + 0.001 * (double)(v * 2654435761U >> 28));
}

/* Gives property `name` of vertex v. */
typedef double (*value_of)(const char *name, uint32_t v);

/* The properties of a header line by line. */
typedef struct column {
	char name[32];
	wh_type type;
} column;

static const char *const type_names[] = {"char", "uchar", "short",  "ushort", "int",
                                         "uint", "int64", "uint64", "float",  "double"};

/* The square with these properties, x, y and z among them. */
static void write_square(fixture *f, wh_ply_format format, const column *c, size_t n,
                         value_of value)
{
	char line[128];
	ply_file p = ply_begin(format);
	char *header = calloc(n + 4, sizeof line);
	(void)sprintf(header, "element vertex %d\n", NV);
	for (size_t k = 0; k < n; k++) {
		(void)snprintf(line, sizeof line, "property %s %.31s\n", type_names[c[k].type],
		               c[k].name);
		strcat(header, line);
	}
	(void)snprintf(line, sizeof line,
	               "element face %d\nproperty list uchar int vertex_indices\n", NF);
	strcat(header, line);
	ply_header(&p, header);
	free(header);
	for (uint32_t v = 0; v < NV; v++) {
		const wh_vec3 at = place(v);
		for (size_t k = 0; k < n; k++) {
			const char *name = c[k].name;
			ply_value(&p, c[k].type,
			          strcmp(name, "x") == 0   ? at.x
			          : strcmp(name, "y") == 0 ? at.y
			          : strcmp(name, "z") == 0 ? at.z
			                                   : value(name, v));
		}
		ply_item(&p);
	}
	for (uint32_t i = 0; i < NF; i++) {
		const uint32_t q = i / 2, a = q / SIDE * (SIDE + 1) + q % SIDE, b = a + SIDE + 1;
		const uint32_t t[2][3] = {{a, a + 1, b}, {a + 1, b + 1, b}};
		ply_value(&p, WH_U8, 3);
		for (int k = 0; k < 3; k++)
			ply_value(&p, WH_I32, t[i % 2][k]);
		ply_item(&p);
	}
	ply_end(&p);
	assert_int_equal(rename(p.path, f->in), 0);
}

/* ---- an output ----------------------------------------------------------------------------- */

/* All vertices of a file with all that they carry. */
typedef struct content {
	wh_spill spill;
	wh_input in;
	uint64_t nv;
	double *xyz;
	uint8_t *records;
} content;

static void read_content(fixture *f, const char *path, content *o)
{
	const wh_exec ex = {.workers = 1};
	wh_ctx *c = &f->t.ctx;
	assert_int_equal(wh_spill_open(c, &o->spill, f->root, NULL), WH_OK);
	assert_int_equal(wh_input_open_with(c, &ex, &o->spill, path, WH_FORMAT_ANY,
	                                    (wh_wanted){NULL, WH_HOLDS_ALL}, &o->in),
	                 WH_OK);
	const wh_source *s = &o->in.source;
	o->nv = s->nv;
	void *scratch = wh_alloc(c, wh_source_vertex_bytes(s, o->nv), 1);
	o->xyz = wh_alloc(c, o->nv, 3 * sizeof *o->xyz);
	o->records = wh_alloc(c, o->nv, o->in.attributes.bytes);
	assert_int_equal(wh_source_vertices(c, s, 0, o->nv, o->xyz, scratch), WH_OK);
	if (s->attributes)
		assert_int_equal(wh_source_attributes(c, s, 0, o->nv, o->records, scratch), WH_OK);
	wh_free(c, scratch);
}

static void free_content(fixture *f, content *o)
{
	wh_free(&f->t.ctx, o->xyz);
	wh_free(&f->t.ctx, o->records);
	wh_input_close(&f->t.ctx, &o->spill, &o->in);
	wh_spill_close(&f->t.ctx, &o->spill);
}

static double get(const content *o, const char *name, uint64_t v)
{
	const wh_attributes *a = &o->in.attributes;
	for (uint32_t k = 0; k < a->n; k++)
		if (strcmp(a->item[k].name, name) == 0)
			return wh_attribute_get(&a->item[k], o->records + v * a->bytes);
	fail_msg("no %s", name);
	return 0;
}

static void reduces(fixture *f)
{
	if (reduce(f) != WH_OK)
		fail_msg("%s", f->t.ctx.err.text);
	assert_int_equal(entries(f->temp), 0);
	assert_true(f->report.memory_peak <= f->params.memory);
}

static void open_square(fixture *f)
{
	open_fixture(f);
	f->params.cluster_faces = 1000;
	f->params.micro_faces = 300;
	f->params.final_faces = 1000;
	f->params.faces = 400;
}

/* In memory at the end, or streamed from clusters. */
static void choose_end(fixture *f, bool streamed)
{
	f->params.faces = streamed ? 2000 : 400;
}

/* ---- kinds --------------------------------------------------------------------------------- */

static void kinds_follow_from_name_and_type(void **state)
{
	(void)state;
	static const struct {
		const char *name;
		wh_type type;
		wh_kind kind;
		uint32_t bytes;
	} rows[] = {
	    {"red", WH_U8, WH_KIND_COLOUR, 2},
	    {"Green", WH_U16, WH_KIND_COLOUR, 4},
	    {"diffuse_blue", WH_U8, WH_KIND_COLOUR, 2},
	    {"alpha", WH_F32, WH_KIND_COLOUR, 4},
	    {"r", WH_F64, WH_KIND_COLOUR, 8},
	    {"g", WH_I32, WH_KIND_COLOUR, 8},
	    {"nx", WH_F32, WH_KIND_NORMAL, 4},
	    {"normal_z", WH_F64, WH_KIND_NORMAL, 8},
	    {"ny", WH_I8, WH_KIND_SCALAR, 2},
	    {"s", WH_F32, WH_KIND_TEXTURE, 4},
	    {"texture_u", WH_F32, WH_KIND_TEXTURE, 4},
	    {"quality", WH_F32, WH_KIND_SCALAR, 4},
	    {"intensity", WH_U8, WH_KIND_SCALAR, 2},
	    {"confidence", WH_I64, WH_KIND_SCALAR, 8},
	    {"anything", WH_F64, WH_KIND_SCALAR, 8},
	    {"anything", WH_U8, WH_KIND_LABEL, 1},
	    {"flags", WH_I32, WH_KIND_LABEL, 4},
	    {"object_id", WH_U64, WH_KIND_LABEL, 8},
	    {"scalar_Classification", WH_F32, WH_KIND_LABEL, 4},
	    {"label", WH_U16, WH_KIND_LABEL, 2},
	};
	testing_env t;
	testing_init(&t);
	for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
		char name[32] = {0};
		(void)snprintf(name, sizeof name, "%s", rows[i].name);
		wh_ply_prop props[] = {{.name = (char[]){"x"}, .type = WH_F32},
		                       {.name = name, .type = rows[i].type},
		                       {.name = (char[]){"y"}, .type = WH_F32},
		                       {.name = (char[]){"z"}, .type = WH_F32}};
		wh_ply_elem e = {.name = (char[]){"vertex"}, .props = props, .nprops = 4};
		const wh_ply p = {.elems = &e, .nelems = 1, .x = 0, .y = 2, .z = 3};
		wh_attributes a;
		assert_int_equal(
		    wh_attributes_choose(&t.ctx, &p, (wh_wanted){NULL, WH_HOLDS_ALL}, &a), WH_OK);
		assert_int_equal(a.n, 1);
		if (a.item[0].kind != rows[i].kind || a.bytes != rows[i].bytes)
			fail_msg("%s: %s, %u bytes", name, wh_kind_name(a.item[0].kind), a.bytes);
		assert_int_equal(a.item[0].file_at, 4);
		assert_int_equal(a.before[1], 1);
		wh_attributes_free(&t.ctx, &a);
	}
	testing_done(&t);
}

/* ---- types and dialects -------------------------------------------------------------------- */

/* Linear in the place, within the range of the type that the name ends in. */
static double linear(const char *name, uint32_t v)
{
	static const double most[] = {100, 200, 30000, 60000, 2e9, 4e9, 1e15, 1e15, 10, 10};
	const wh_vec3 at = place(v);
	const int type = atoi(name + strlen(name) - 1);
	return rint(most[type] * (0.2 + 0.4 * at.x + 0.3 * at.y));
}

static const column all_types[] = {
    {"quality_2", WH_I16}, {"z", WH_F32},         {"quality_8", WH_F32}, {"quality_0", WH_I8},
    {"x", WH_F32},         {"quality_1", WH_U8},  {"quality_9", WH_F64}, {"quality_3", WH_U16},
    {"quality_4", WH_I32}, {"quality_5", WH_U32}, {"y", WH_F32},         {"quality_6", WH_I64},
    {"quality_7", WH_U64},
};
enum { ALL_TYPES = sizeof all_types / sizeof *all_types };

static void has_columns(const content *o, const column *c, size_t n)
{
	const wh_ply_elem *e = &o->in.ply.elems[o->in.ply.vertex];
	assert_int_equal(e->nprops, n);
	for (size_t k = 0; k < n; k++) {
		assert_string_equal(e->props[k].name, c[k].name);
		assert_int_equal(e->props[k].type, c[k].type);
	}
}

/* Of a linear function the values of new vertices are those of their places, nearly. */
static void is_linear(const content *o)
{
	const wh_attributes *a = &o->in.attributes;
	for (uint32_t k = 0; k < a->n; k++) {
		const int type = atoi(a->item[k].name + strlen(a->item[k].name) - 1);
		static const double most[] = {100, 200, 30000, 60000, 2e9, 4e9, 1e15, 1e15, 10, 10};
		for (uint64_t v = 0; v < o->nv; v++) {
			const double x = o->xyz[3 * v], y = o->xyz[3 * v + 1];
			const double want = most[type] * (0.2 + 0.4 * x + 0.3 * y);
			const double is = wh_attribute_get(&a->item[k], o->records + v * a->bytes);
			if (!(fabs(is - want) <= 0.02 * most[type] + 1))
				fail_msg("%s of vertex %d: %g, not %g", a->item[k].name, (int)v, is,
				         want);
		}
	}
}

static void every_type_survives_in_every_dialect(void **state)
{
	(void)state;
	char first[33] = "";
	for (int format = WH_PLY_ASCII; format <= WH_PLY_BE; format++)
		for (int ascii = 0; ascii <= 1; ascii++) {
			fixture f;
			content o;
			open_square(&f);
			write_square(&f, (wh_ply_format)format, all_types, ALL_TYPES, linear);
			f.params.ascii = ascii;
			reduces(&f);
			assert_true(f.report.clusters >= 4 && f.report.rounds >= 1);
			read_content(&f, f.out, &o);
			assert_int_equal(o.nv, f.report.output_vertices);
			has_columns(&o, all_types, ALL_TYPES);
			is_linear(&o);
			free_content(&f, &o);
			/* the dialect leaves no trace */
			if (!ascii && !first[0])
				memcpy(first, f.report.checksum, sizeof first);
			else if (!ascii)
				assert_string_equal(first, f.report.checksum);
			drop(&f);
		}
}

/* Values that have nothing to do with one another, of every bit of a type. */
static double scattered(const char *name, uint32_t v)
{
	const uint32_t k = (v + 1) * 2654435761U ^ (uint32_t)name[0] * 40503U;
	return (double)(k >> 8) / 131072.0; /* 0 to 128 with 17 bits behind the point */
}

/* Vertices that stay keep every bit of theirs; the locked ones on the boundary all stay. */
static void vertices_that_stay_keep_every_bit(void **state)
{
	(void)state;
	fixture f;
	content in, out;
	size_t found = 0;
	open_square(&f);
	f.params.lock_boundary = true;
	f.params.faces = 1500;
	write_square(&f, WH_PLY_BE, all_types, ALL_TYPES, scattered);
	reduces(&f);
	read_content(&f, f.in, &in);
	read_content(&f, f.out, &out);
	const size_t bytes = in.in.attributes.bytes;
	assert_true(in.in.attributes.n >= 10 && out.in.attributes.bytes == bytes);
	for (uint32_t v = 0; v < NV; v++) {
		const uint32_t x = v % (SIDE + 1), y = v / (SIDE + 1);
		for (uint64_t u = 0; u < out.nv && (x % SIDE == 0 || y % SIDE == 0); u++)
			if (memcmp(&in.xyz[3 * v], &out.xyz[3 * u], 24) == 0) {
				assert_memory_equal(in.records + v * bytes, out.records + u * bytes,
				                    bytes);
				found++;
			}
	}
	assert_int_equal(found, 4 * SIDE);
	free_content(&f, &in);
	free_content(&f, &out);
	drop(&f);
}

/* ---- other formats ------------------------------------------------------------------------- */

static const column coloured[] = {{"x", WH_F32},    {"y", WH_F32},      {"z", WH_F32},
                                  {"nx", WH_F32},   {"ny", WH_F32},     {"nz", WH_F32},
                                  {"red", WH_U8},   {"green", WH_U8},   {"blue", WH_U8},
                                  {"alpha", WH_U8}, {"quality", WH_F32}};

enum { COLOURED = sizeof coloured / sizeof *coloured };

static double colours_and_normals(const char *name, uint32_t v)
{
	if (name[0] == 'n')
		return name[1] == 'z' ? 0.8 : name[1] == 'y' ? -0.6 : 0;
	return strcmp(name, "quality") == 0 ? v : (double)(v * 7 % 256);
}

/* Of all vertices, which are those of the square: the value that they had, as a share of white
 * where it is a colour. */
static void has_shares(const content *o, bool alpha)
{
	const wh_attributes *a = &o->in.attributes;
	assert_int_equal(o->nv, NV);
	for (uint64_t v = 0; v < NV; v++) {
		uint32_t of = 0; /* the output has another order */
		while (of < NV && ((float)place(of).x != (float)o->xyz[3 * v] ||
		                   (float)place(of).y != (float)o->xyz[3 * v + 1]))
			of++;
		assert_true(of < NV);
		for (uint32_t k = 0; k < a->n; k++) {
			const wh_attribute *item = &a->item[k];
			const uint8_t *record = o->records + v * a->bytes;
			const double want = colours_and_normals(item->name, of);
			if (!alpha && strcmp(item->name, "alpha") == 0)
				assert_true(wh_attribute_share(item, record) == 1);
			else if (item->kind == WH_KIND_COLOUR)
				assert_true(rint(255 * wh_attribute_share(item, record)) == want);
			else
				assert_true((float)wh_attribute_get(item, record) == (float)want);
		}
	}
}

/* From PLY to one format and on to another: what both hold is the same at the end. */
static void formats_hand_on_what_they_hold(void **state)
{
	(void)state;
	static const struct {
		const char *format, *carried, *dropped;
		uint32_t n;
	} to[] = {{"obj", "red, green, blue (colour), nx, ny, nz (normal)", "alpha, quality", 6},
	          {"off", "red, green, blue, alpha (colour), nx, ny, nz (normal)", "quality", 7},
	          {"ply", "red, green, blue, alpha (colour), nx, ny, nz (normal), quality (scalar)",
	           "", 8}};
	for (size_t i = 0; i < 3; i++)
		for (size_t k = 0; k < 3; k++) {
			fixture f;
			content o;
			open_square(&f);
			f.params.faces = 2 * (uint64_t)NF;
			write_square(&f, WH_PLY_LE, coloured, COLOURED, colours_and_normals);
			f.params.to = to[i].format;
			f.params.ascii = true; /* else PLY is copied */
			reduces(&f);
			assert_string_equal(f.report.carried, to[i].carried);
			assert_string_equal(f.report.dropped, to[i].dropped);
			f.params.input = f.out;
			f.params.output = f.in;
			f.params.to = to[k].format;
			f.params.ascii = false;
			reduces(&f);
			read_content(&f, f.in, &o);
			/* OFF has an alpha always */
			const uint32_t n = i == 0 && k == 1    ? 7
			                   : to[k].n < to[i].n ? to[k].n
			                                       : to[i].n;
			assert_int_equal(o.in.attributes.n, n);
			has_shares(&o, i > 0);
			free_content(&f, &o);
			drop(&f);
		}
}

/* Colours that no header declares: from 0 to 1 or to 255; a vertex without one is white. */
static void undeclared_colours_are_understood(void **state)
{
	(void)state;
	static const struct {
		const char *text;
		double red[3]; /* of 255; -1: no colours */
	} files[] = {
	    {"v 0 0 0 0 0 0\nv 1 0 0 1 1 1\nv 0 1 0 .2 .5 0.5\nf 1 2 3\n", {0, 255, 51}},
	    {"v 0 0 0 0 0 0\nv 1 0 0 1 1 1\nv 0 1 0 51 255 0\nf 1 2 3\n", {0, 1, 51}},
	    {"v 0 0 0\nv 1 0 0 1\nv 0 1 0 .2 .5 0.5 # 8\nf 1 2 3\n", {-1, -1, -1}},
	    {"v 0 0 0 .2 0 0\nv 1 0 0 1\nv 0 1 0 # .2 .2 .2\nf 1 2 3\n", {51, 255, 255}},
	    {"COFF 3 1 0\n0 0 0 51 0 0 255\n1 0 0 0 0 0 255\n0 1 0 255 1 1 255\n3 0 1 2\n",
	     {51, 0, 255}},
	    {"COFF 3 1 0\n0 0 0 .2 0 0\n1 0 0 0 0 0\n0 1 0\n3 0 1 2\n", {51, 0, 255}},
	    {"COFF 3 1 0\n0 0 0 51 0 0\n1 0\n0 0 0 0\n0 1 0 # white\n3 0 1 2\n",
	     {51, 0, 255}}, /* word by word */
	    {"COFF 3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n", {-1, -1, -1}},
	    {"NCOFF 3 1 0\n0 0 0 0 0 1 .2 0 0 1\n1 0 0 0 0 1 0 0 0 1\n0 1 0 0 0 1 1 1 1 1\n3 0 1 "
	     "2\n",
	     {51, 0, 255}},
	};
	for (size_t i = 0; i < sizeof files / sizeof *files; i++) {
		fixture f;
		content o;
		open_fixture(&f);
		ply_file p = ply_write(files[i].text);
		assert_int_equal(rename(p.path, f.in), 0);
		read_content(&f, f.in, &o);
		const wh_attributes *a = &o.in.attributes;
		assert_int_equal(a->has_rgb, files[i].red[0] >= 0);
		for (uint64_t v = 0; v < 3 && a->has_rgb; v++) {
			const double share =
			    wh_attribute_share(&a->item[a->rgb[0]], o.records + v * a->bytes);
			if (rint(255 * share) != files[i].red[v])
				fail_msg("%s: red of vertex %d is %g", files[i].text, (int)v,
				         255 * share);
		}
		free_content(&f, &o);
		drop(&f);
	}
}

/* Text that is not one item a line, and lists beside the scalars of vertices. */
static void odd_layouts_give_the_same_values(void **state)
{
	(void)state;
	static const char *const files[] = {
	    "ply format ascii", /* the header is written below */
	    "binary",
	};
	for (size_t i = 0; i < 2; i++) {
		fixture f;
		content o;
		open_fixture(&f);
		const bool text = files[i][0] == 'p';
		ply_file p = ply_begin(text ? WH_PLY_ASCII : WH_PLY_BE);
		ply_header(&p, "element vertex 4\nproperty uchar red\nproperty float x\n"
		               "property list uchar int near\nproperty int64 id\n"
		               "property float y\nproperty float z\nproperty double w\n"
		               "element face 2\nproperty list uchar int vertex_indices\n");
		for (uint32_t v = 0; v < 4; v++) {
			ply_value(&p, WH_U8, 50 * v);
			ply_value(&p, WH_F32, v & 1);
			ply_value(&p, WH_U8, v);
			for (uint32_t k = 0; k < v; k++)
				ply_value(&p, WH_I32, k);
			if (text) /* more digits than a double has */
				(void)fprintf(p.f, "%lld\n", 9007199254740993LL + v);
			else
				ply_bytes(&p, 9007199254740993ULL + v, 8);
			ply_value(&p, WH_F32, v >> 1);
			ply_value(&p, WH_F32, 0);
			ply_value(&p, WH_F64, 0.1 * v);
		}
		for (int k = 0; k < 8; k++)
			ply_value(&p, k % 4 ? WH_I32 : WH_U8,
			          (const double[]){3, 0, 1, 2, 3, 1, 3, 2}[k]);
		ply_end(&p);
		assert_int_equal(rename(p.path, f.in), 0);
		read_content(&f, f.in, &o);
		assert_int_equal(o.in.attributes.n, 3);
		for (uint64_t v = 0; v < 4; v++) {
			uint64_t id;
			const wh_attribute *a = &o.in.attributes.item[1];
			memcpy(&id, o.records + v * o.in.attributes.bytes + a->at, 8);
			assert_true(id == 9007199254740993ULL + v);
			assert_true(get(&o, "red", v) == 50.0 * (double)v);
			assert_true(get(&o, "w", v) == 0.1 * (double)v);
		}
		free_content(&f, &o);
		drop(&f);
	}
}

static void a_word_that_is_no_number_is_named(void **state)
{
	(void)state;
	fixture f;
	open_fixture(&f);
	ply_file p = ply_write("ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\n"
	                       "property float y\nproperty float z\nproperty uchar red\n"
	                       "element face 1\nproperty list uchar int vertex_indices\n"
	                       "end_header\n0 0 0 1\n1 0 0 crimson\n0 1 0 3\n3 0 1 2\n");
	assert_int_equal(rename(p.path, f.in), 0);
	f.params.ascii = true; /* else it would be copied */
	f.params.face_ratio = 0.5;
	assert_int_equal(reduce(&f), WH_E_INPUT);
	assert_non_null(strstr(f.t.ctx.err.text, "line 12"));
	assert_non_null(strstr(f.t.ctx.err.text, "crimson"));
	assert_non_null(strstr(f.t.ctx.err.text, "--attributes"));
	nothing_is_left(&f);
	f.params.attributes = "none";
	assert_int_not_equal(reduce(&f), WH_E_INPUT);
	drop(&f);
}

/* ---- values -------------------------------------------------------------------------------- */

static const column scan[] = {{"x", WH_F32},     {"y", WH_F32},      {"z", WH_F32},
                              {"nx", WH_F32},    {"ny", WH_F32},     {"nz", WH_F32},
                              {"red", WH_U8},    {"green", WH_U8},   {"blue", WH_U8},
                              {"label", WH_I32}, {"quality", WH_F32}};
enum { SCAN = sizeof scan / sizeof *scan };
static const double labels[] = {-5, 7, 1000003, 2147483647};

static double scanned(const char *name, uint32_t v)
{
	const wh_vec3 at = place(v);
	const double slope = 0.14 * cos(7 * at.x), n = sqrt(1 + slope * slope);
	if (name[0] == 'n')
		return name[1] == 'x' ? -slope / n : name[1] == 'y' ? 0 : 1 / n;
	if (name[0] == 'l')
		return labels[(at.x > 0.5) + 2 * (at.y > 0.5)];
	if (name[0] == 'q')
		return at.x * at.y;
	return rint(127 + 100 * sin((name[0] == 'r' ? 9 : name[0] == 'g' ? 5 : 3) * at.x));
}

static void labels_are_never_averaged(void **state)
{
	(void)state;
	for (int streamed = 0; streamed <= 1; streamed++) {
		fixture f;
		content o;
		open_square(&f);
		write_square(&f, WH_PLY_LE, scan, SCAN, scanned);
		choose_end(&f, streamed);
		reduces(&f);
		assert_int_equal(f.report.streamed, streamed);
		read_content(&f, f.out, &o);
		for (uint64_t v = 0; v < o.nv; v++) {
			const double l = get(&o, "label", v);
			const double x = o.xyz[3 * v], y = o.xyz[3 * v + 1];
			bool known = false;
			for (int k = 0; k < 4; k++)
				known = known || l == labels[k];
			assert_true(known);
			if (fabs(x - 0.5) > 0.15 && fabs(y - 0.5) > 0.15)
				assert_true(l == labels[(x > 0.5) + 2 * (y > 0.5)]);
		}
		free_content(&f, &o);
		drop(&f);
	}
}

/* Every tenth vertex, by chance, has a label of its own. */
static double speckled(const char *name, uint32_t v)
{
	return name[0] == 'l' ? (v * 2654435761u >> 16) % 10 == 0 : scanned(name, v);
}

static void labels_go_by_majority(void **state)
{
	(void)state;
	for (int streamed = 0; streamed <= 1; streamed++) {
		fixture f;
		content o;
		uint64_t stray = 0;
		open_square(&f);
		write_square(&f, WH_PLY_LE, scan, SCAN, speckled);
		choose_end(&f, streamed);
		reduces(&f);
		read_content(&f, f.out, &o);
		for (uint64_t v = 0; v < o.nv; v++)
			stray += get(&o, "label", v) > 0;
		print_message("%u of %u labels are of the minority\n", (unsigned)stray,
		              (unsigned)o.nv);
		assert_true(o.nv > 100 && stray * (streamed ? 12 : 40) < o.nv);
		free_content(&f, &o);
		drop(&f);
	}
}

static void normals_stay_unit_vectors(void **state)
{
	(void)state;
	for (int streamed = 0; streamed <= 1; streamed++) {
		fixture f;
		content o;
		open_square(&f);
		write_square(&f, WH_PLY_LE, scan, SCAN, scanned);
		choose_end(&f, streamed);
		reduces(&f);
		read_content(&f, f.out, &o);
		for (uint64_t v = 0; v < o.nv; v++) {
			const wh_vec3 n =
			    wh_v3(get(&o, "nx", v), get(&o, "ny", v), get(&o, "nz", v));
			assert_true(fabs(wh_norm(n) - 1) < 1e-6);
			assert_true(n.z > 0.95);
		}
		free_content(&f, &o);
		drop(&f);
	}
}

static wh_mesh load(fixture *f, const char *path)
{
	const wh_exec ex = {.workers = 1};
	wh_ctx *c = &f->t.ctx;
	wh_spill spill;
	wh_mesh m;
	assert_int_equal(wh_spill_open(c, &spill, f->root, NULL), WH_OK);
	assert_int_equal(wh_load_mesh(c, &ex, &spill, path, WH_FORMAT_ANY, &m, NULL, NULL), WH_OK);
	wh_spill_close(c, &spill);
	return m;
}

/* Measures the input against the output; along the cuts, too, where `seams` is a file of them. */
static wh_compare measure(fixture *f, const char *seams)
{
	const wh_exec ex = {.workers = 2};
	wh_compare r;
	const wh_measure_other other = {f->out, WH_FORMAT_ANY, &r};
	const wh_measure_params p = {.a = f->in,
	                             .other = &other,
	                             .others = 1,
	                             .seams = seams,
	                             .samples = 100000,
	                             .temp_dir = f->temp,
	                             .memory = (size_t)256 << 20};
	assert_int_equal(wh_measure_files(&f->t.ctx, &ex, &p), WH_OK);
	return r;
}

/* Attributes ride along: they change no bit of positions or faces. */
static void geometry_does_not_notice(void **state)
{
	(void)state;
	for (int streamed = 0; streamed <= 1; streamed++) {
		fixture f;
		open_square(&f);
		write_square(&f, WH_PLY_LE, scan, SCAN, scanned);
		choose_end(&f, streamed);
		reduces(&f);
		assert_string_equal(f.report.carried,
		                    "red, green, blue (colour), nx, ny, nz (normal), quality "
		                    "(scalar), label (label)");
		assert_string_equal(f.report.dropped, "");
		wh_mesh with = load(&f, f.out);
		assert_true(measure(&f, NULL).both.colours > 0);
		f.params.attributes = "none";
		reduces(&f);
		assert_string_equal(f.report.carried, "");
		assert_string_equal(f.report.dropped,
		                    "nx, ny, nz, red, green, blue, label, quality");
		wh_mesh without = load(&f, f.out);
		assert_int_equal(measure(&f, NULL).both.colours, 0);
		assert_int_equal(with.nv, without.nv);
		assert_int_equal(with.nf, without.nf);
		assert_memory_equal(with.pos, without.pos, with.nv * sizeof *with.pos);
		assert_memory_equal(with.tri, without.tri, 3 * with.nf * sizeof *with.tri);
		wh_mesh_free(&f.t.ctx, &with);
		wh_mesh_free(&f.t.ctx, &without);
		drop(&f);
	}
}

static void threads_leave_no_trace(void **state)
{
	(void)state;
	for (int streamed = 0; streamed <= 1; streamed++) {
		fixture f;
		char sum[33];
		open_square(&f);
		write_square(&f, WH_PLY_ASCII, scan, SCAN, scanned);
		choose_end(&f, streamed);
		f.params.threads = 1;
		reduces(&f);
		memcpy(sum, f.report.checksum, sizeof sum);
		f.params.threads = 2;
		f.params.memory = (size_t)64 << 20;
		reduces(&f);
		assert_string_equal(sum, f.report.checksum);
		drop(&f);
	}
}

/* ---- choice -------------------------------------------------------------------------------- */

static void names_choose_what_is_carried(void **state)
{
	(void)state;
	fixture f;
	content o;
	open_square(&f);
	write_square(&f, WH_PLY_LE, scan, SCAN, scanned);
	f.params.attributes = "colour,label";
	reduces(&f);
	assert_string_equal(f.report.carried, "red, green, blue (colour), label (label)");
	assert_string_equal(f.report.dropped, "nx, ny, nz, quality");
	read_content(&f, f.out, &o);
	static const column left[] = {{"x", WH_F32},    {"y", WH_F32},    {"z", WH_F32},
	                              {"red", WH_U8},   {"green", WH_U8}, {"blue", WH_U8},
	                              {"label", WH_I32}};
	has_columns(&o, left, 7);
	free_content(&f, &o);
	f.params.attributes = "label,lable";
	assert_int_equal(reduce(&f), WH_E_USAGE);
	assert_non_null(strstr(f.t.ctx.err.text, "'lable'"));
	drop(&f);
}

/* ---- trouble ------------------------------------------------------------------------------- */

static double holes(const char *name, uint32_t v)
{
	if (name[0] == 'q')
		return v % 3 ? (double)(v % 2 ? NAN : INFINITY) : 0.5;
	if (name[0] == 'n')
		return v % 2 ? (double)NAN : name[1] == 'z';
	return scanned(name, v);
}

static void values_that_are_no_numbers_do_no_harm(void **state)
{
	(void)state;
	fixture f;
	content o;
	uint64_t numbers = 0;
	open_square(&f);
	write_square(&f, WH_PLY_LE, scan, SCAN, holes);
	reduces(&f);
	read_content(&f, f.out, &o);
	for (uint64_t v = 0; v < o.nv; v++) {
		const double q = get(&o, "quality", v);
		numbers += q == 0.5;
		assert_true(q == 0.5 || !isfinite(q));
		assert_true(get(&o, "red", v) >= 20);
	}
	assert_true(numbers > o.nv / 2); /* numbers are preferred to what is none */
	free_content(&f, &o);
	drop(&f);
}

static double by_number(const char *name, uint32_t v)
{
	return atoi(name + 7) + place(v).x;
}

static void a_hundred_properties_are_not_too_many(void **state)
{
	(void)state;
	fixture f;
	content o;
	column c[103] = {{"x", WH_F32}, {"y", WH_F32}, {"z", WH_F32}};
	for (int k = 0; k < 100; k++) {
		(void)snprintf(c[3 + k].name, sizeof c->name, "number_%d", k);
		c[3 + k].type = k % 2 ? WH_F64 : WH_F32;
	}
	open_square(&f);
	write_square(&f, WH_PLY_LE, c, 103, by_number);
	reduces(&f);
	read_content(&f, f.out, &o);
	has_columns(&o, c, 103);
	for (uint64_t v = 0; v < o.nv; v++)
		for (int k = 0; k < 100; k++)
			assert_true(fabs(get(&o, c[3 + k].name, v) - k - o.xyz[3 * v]) < 0.03);
	assert_non_null(strstr(f.report.carried, "..."));
	free_content(&f, &o);
	drop(&f);
}

static void too_many_properties_are_refused_in_words(void **state)
{
	(void)state;
	enum { MANY = WH_MOST_ATTRIBUTES + 1 };
	fixture f;
	content o;
	column *c = calloc(MANY + 3, sizeof *c);
	for (int k = 0; k < MANY + 3; k++) {
		(void)snprintf(c[k].name, sizeof c->name, "number_%d", k);
		c[k].type = WH_U8;
	}
	for (int k = 0; k < 3; k++) {
		(void)snprintf(c[k].name, sizeof c->name, "%c", "xyz"[k]);
		c[k].type = WH_F32;
	}
	open_square(&f);
	write_square(&f, WH_PLY_LE, c, MANY + 3, scanned);
	free(c);
	assert_int_equal(reduce(&f), WH_E_USAGE);
	assert_non_null(strstr(f.t.ctx.err.text, "--attributes"));
	nothing_is_left(&f);
	f.params.attributes = "number_700,number_9";
	reduces(&f);
	read_content(&f, f.out, &o);
	assert_int_equal(o.in.attributes.n, 2);
	assert_string_equal(o.in.attributes.item[0].name, "number_9");
	assert_string_equal(o.in.attributes.item[1].name, "number_700");
	free_content(&f, &o);
	drop(&f);
}

static void refused_memory_leaks_nothing(void **state)
{
	(void)state;
	for (int format = WH_PLY_ASCII; format <= WH_PLY_LE; format++) {
		fixture f;
		wh_code code = WH_E_RUN;
		open_square(&f);
		write_square(&f, (wh_ply_format)format, scan, SCAN, scanned);
		f.params.threads = 1;
		choose_end(&f, format == WH_PLY_LE);
		for (long fail = 1; code != WH_OK; fail += fail / 6 + 1) {
			f.t.mem.fail_after = fail;
			code = reduce(&f);
			assert_int_equal(f.t.mem.used, 0);
			if (code != WH_OK)
				nothing_is_left(&f);
		}
		drop(&f);
	}
}

/* ---- seams --------------------------------------------------------------------------------- */

/* A rough sphere, coloured in stripes that no cut knows of. */
static void write_coloured(fixture *f, uint64_t faces)
{
	wh_ctx *c = &f->t.ctx;
	wh_synth_params sp = surface(WH_SYNTH_SPHERE, faces);
	wh_synth *s;
	wh_mesh m;
	assert_int_equal(wh_synth_open(c, &s, &sp), WH_OK);
	assert_int_equal(wh_synth_mesh(c, s, &m), WH_OK);
	wh_synth_close(c, &s);
	char header[300];
	ply_file p = ply_begin(WH_PLY_LE);
	(void)snprintf(header, sizeof header,
	               "element vertex %u\nproperty float x\nproperty float y\nproperty float z\n"
	               "property uchar red\nproperty uchar green\nproperty uchar blue\n"
	               "element face %u\nproperty list uchar int vertex_indices\n",
	               m.nv, m.nf);
	ply_header(&p, header);
	for (uint32_t v = 0; v < m.nv; v++) {
		const wh_vec3 q = wh_scale(m.pos[v], 1 / wh_norm(m.pos[v]));
		ply_value(&p, WH_F32, m.pos[v].x);
		ply_value(&p, WH_F32, m.pos[v].y);
		ply_value(&p, WH_F32, m.pos[v].z);
		ply_value(&p, WH_U8, rint(127 + 100 * sin(20 * q.x + 7 * q.y)));
		ply_value(&p, WH_U8, rint(127 + 100 * sin(17 * q.y - 9 * q.z)));
		ply_value(&p, WH_U8, rint(127 + 100 * sin(23 * q.z + 5 * q.x)));
	}
	for (uint32_t i = 0; i < m.nf; i++) {
		ply_value(&p, WH_U8, 3);
		for (size_t k = 0; k < 3; k++)
			ply_value(&p, WH_I32, m.tri[3 * (size_t)i + k]);
	}
	ply_end(&p);
	wh_mesh_free(c, &m);
	assert_int_equal(rename(p.path, f->in), 0);
}

static wh_compare measure_colours(fixture *f, const char *seams)
{
	const wh_compare r = measure(f, seams);
	assert_int_equal(r.both.colours, 200000);
	return r;
}

/* Difference of colour in the band along the cuts over that elsewhere. */
static double band_over_rest(const wh_compare *r)
{
	return r->band.colour_rms / r->interior.colour_rms;
}

static void colours_are_as_good_along_the_cuts(void **state)
{
	(void)state;
	for (int streamed = 0; streamed <= 1; streamed++) {
		fixture f;
		char seams[96];
		open_fixture(&f);
		write_coloured(&f, 40000);
		(void)snprintf(seams, sizeof seams, "%s/seams.ply", f.root);
		f.params.seams = seams;
		f.params.faces = streamed ? 8000 : 2000;
		reduces(&f);
		assert_int_equal(f.report.streamed, streamed);
		const wh_compare here = measure_colours(&f, seams);
		f.params.seams = NULL;
		f.params.cluster_faces = f.params.micro_faces = 0;
		reduces(&f);
		const wh_compare whole = measure_colours(&f, seams);
		print_message("band over rest %.3f, uncut %.3f; RMS %.3f, uncut %.3f\n",
		              band_over_rest(&here), band_over_rest(&whole), here.colour_rms,
		              whole.colour_rms);
		assert_true(band_over_rest(&here) < 1.1 * band_over_rest(&whole));
		assert_true(here.colour_rms < 1.05 * whole.colour_rms);
		drop(&f);
	}
}

/* ---- weights ------------------------------------------------------------------------------- */

static void weights_keep_colours(void **state)
{
	(void)state;
	for (int streamed = 0; streamed <= 1; streamed++) {
		fixture f;
		char sum[33];
		open_fixture(&f);
		write_coloured(&f, 40000);
		f.params.faces = streamed ? 8000 : 2000;
		reduces(&f);
		memcpy(sum, f.report.checksum, sizeof sum);
		const double without = measure_colours(&f, NULL).colour_rms;
		f.params.weights = "colour=0";
		reduces(&f);
		assert_string_equal(sum, f.report.checksum);
		f.params.weights = "colour=1";
		reduces(&f);
		assert_int_equal(f.report.output_faces, f.params.faces);
		memcpy(sum, f.report.checksum, sizeof sum);
		const double with = measure_colours(&f, NULL).colour_rms;
		print_message("RMS of colours %.3f, with a weight %.3f\n", without, with);
		assert_true(with < 0.8 * without);
		f.params.threads = 1;
		reduces(&f);
		assert_string_equal(sum, f.report.checksum);
		drop(&f);
	}
}

/* How far vertices lie on the wrong side of the lines between labels, added up. */
static double mislabelled(fixture *f)
{
	content o;
	double sum = 0;
	read_content(f, f->out, &o);
	for (uint64_t v = 0; v < o.nv; v++) {
		const double x = o.xyz[3 * v] - 0.5, y = o.xyz[3 * v + 1] - 0.5;
		const double want = labels[(x > 0) + 2 * (y > 0)];
		sum += get(&o, "label", v) != want ? fmin(fabs(x), fabs(y)) : 0;
	}
	free_content(f, &o);
	return sum;
}

static void weights_keep_labels_and_bear_holes(void **state)
{
	(void)state;
	fixture f;
	open_square(&f);
	write_square(&f, WH_PLY_LE, scan, SCAN, scanned);
	f.params.faces = 200;
	reduces(&f);
	const double without = mislabelled(&f);
	f.params.weights = "label=5";
	reduces(&f);
	assert_true(mislabelled(&f) < 0.5 * without);
	write_square(&f, WH_PLY_LE, scan, SCAN, holes);
	f.params.weights = "quality=1,normal=1,label=1,red=1";
	reduces(&f);
	assert_int_equal(f.report.output_faces, 200);
	drop(&f);
}

static void senseless_weights_are_refused(void **state)
{
	(void)state;
	static const char *const bad[] = {"colour",    "colour=",   "colour=-1", "colour=x",
	                                  "colour=1e", "nothing=1", "=1",        "red=1,colour=nan",
	                                  "red=0.5,,", "x=1"};
	fixture f;
	open_square(&f);
	write_square(&f, WH_PLY_LE, scan, SCAN, scanned);
	for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
		f.params.weights = bad[i];
		if (reduce(&f) != WH_E_USAGE)
			fail_msg("%s", bad[i]);
		nothing_is_left(&f);
	}
	f.params.weights = "red=1";
	f.params.attributes = "normal";
	assert_int_equal(reduce(&f), WH_E_USAGE);
	assert_non_null(strstr(f.t.ctx.err.text, "carried"));
	drop(&f);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	    cmocka_unit_test(kinds_follow_from_name_and_type),
	    cmocka_unit_test(every_type_survives_in_every_dialect),
	    cmocka_unit_test(vertices_that_stay_keep_every_bit),
	    cmocka_unit_test(formats_hand_on_what_they_hold),
	    cmocka_unit_test(undeclared_colours_are_understood),
	    cmocka_unit_test(odd_layouts_give_the_same_values),
	    cmocka_unit_test(a_word_that_is_no_number_is_named),
	    cmocka_unit_test(labels_are_never_averaged),
	    cmocka_unit_test(labels_go_by_majority),
	    cmocka_unit_test(normals_stay_unit_vectors),
	    cmocka_unit_test(geometry_does_not_notice),
	    cmocka_unit_test(threads_leave_no_trace),
	    cmocka_unit_test(names_choose_what_is_carried),
	    cmocka_unit_test(values_that_are_no_numbers_do_no_harm),
	    cmocka_unit_test(a_hundred_properties_are_not_too_many),
	    cmocka_unit_test(too_many_properties_are_refused_in_words),
	    cmocka_unit_test(refused_memory_leaks_nothing),
	    cmocka_unit_test(colours_are_as_good_along_the_cuts),
	    cmocka_unit_test(weights_keep_colours),
	    cmocka_unit_test(weights_keep_labels_and_bear_holes),
	    cmocka_unit_test(senseless_weights_are_refused),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
