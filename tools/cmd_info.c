/* whittle info: what a mesh file holds, from its header; bounds by streaming the vertices. */
#define _POSIX_C_SOURCE 200809L
#include "cmd.h"
#include "base/bytes.h"
#include "pipeline/normalise.h"

#include <ctype.h>
#include <float.h>
#include <getopt.h>
#include <inttypes.h>
#include <jansson.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

static const char help[] =
    "usage: whittle info FILE [option ...]\n"
    "Prints what a PLY, OBJ, OFF or STL file (-: standard input) holds: format,\n"
    "elements, properties, bytes, bounds. Nothing is loaded; bounds take one pass\n"
    "over the vertices. Those of STL are corners, three a facet, not yet welded.\n\n"
    "      --json         as JSON\n"
    "      --bounds       bounds of a text file too, which has to be parsed for them\n"
    "      --no-bounds    the header alone\n"
    "      --from F       FILE is ply, obj, off or stl, whatever it looks like\n"
    "      --threads N    0 (default): all this process may use\n";

enum { CHUNK = 65536, TOKEN_MAX = 128, FORMAT_TEXT = 32 };

typedef struct options {
	const char *path;
	bool json, help, bounds, no_bounds;
	wh_format from;
	int64_t threads;
} options;

enum { OPT_JSON = 256, OPT_BOUNDS, OPT_NO_BOUNDS, OPT_FROM, OPT_THREADS };

static const struct option long_options[] = {
    {"json", no_argument, NULL, OPT_JSON},
    {"bounds", no_argument, NULL, OPT_BOUNDS},
    {"no-bounds", no_argument, NULL, OPT_NO_BOUNDS},
    {"from", required_argument, NULL, OPT_FROM},
    {"threads", required_argument, NULL, OPT_THREADS},
    {"help", no_argument, NULL, 'h'},
    {NULL, 0, NULL, 0},
};

/* WH_OK, or the exit status after a message. */
static int parse_options(options *o, int argc, char **argv)
{
	const char *name = argv[0];
	int opt;
	*o = (options){0};
	opterr = 0;
	while ((opt = getopt_long(argc, argv, ":h", long_options, NULL)) != -1) {
		if (opt == '?')
			return cmd_usage_error(name, "%s is no option", argv[optind - 1]);
		if (opt == ':')
			return cmd_usage_error(name, "%s needs a value", argv[optind - 1]);
		o->json |= opt == OPT_JSON;
		o->bounds |= opt == OPT_BOUNDS;
		o->no_bounds |= opt == OPT_NO_BOUNDS;
		o->help |= opt == 'h';
		if (opt == OPT_FROM && !cmd_parse_from(optarg, &o->from))
			return cmd_usage_error(name, "--from \"%s\" is not ply, obj, off or stl",
			                       optarg);
		if (opt == OPT_THREADS &&
		    (!cmd_parse_count(optarg, false, &o->threads) || o->threads > 4096))
			return cmd_usage_error(name, "--threads does not take \"%s\"", optarg);
	}
	if (o->help)
		return WH_OK;
	if (o->bounds && o->no_bounds)
		return cmd_usage_error(name, "--bounds and --no-bounds contradict each other");
	if (argc - optind != 1)
		return cmd_usage_error(name, "one FILE is needed");
	o->path = argv[optind];
	return WH_OK;
}

/* ---- bounds ---- */

typedef struct box {
	double min[3], max[3];
	uint64_t n; /* points inside */
} box;

static const box empty_box = {{DBL_MAX, DBL_MAX, DBL_MAX}, {-DBL_MAX, -DBL_MAX, -DBL_MAX}, 0};

static void box_add(box *b, const double p[3])
{
	for (int i = 0; i < 3; i++) {
		b->min[i] = p[i] < b->min[i] ? p[i] : b->min[i];
		b->max[i] = p[i] > b->max[i] ? p[i] : b->max[i];
	}
	b->n++;
}

static void box_join(box *b, const box *other)
{
	if (!other->n)
		return;
	const uint64_t n = b->n + other->n;
	box_add(b, other->min);
	box_add(b, other->max);
	b->n = n;
}

/* Halves first: the span of two finite numbers may be infinite. */
static double box_diagonal(const box *b)
{
	double half[3];
	for (int i = 0; i < 3; i++)
		half[i] = 0.5 * b->max[i] - 0.5 * b->min[i];
	return 2.0 * hypot(hypot(half[0], half[1]), half[2]);
}

/* One worker's share of the pass. */
typedef struct scan_part {
	box bounds;
	double *xyz;
	void *scratch;
} scan_part;

typedef struct scan {
	wh_source source;
	scan_part *part;
} scan;

static wh_code scan_chunk(wh_ctx *c, void *arg, int64_t index, int worker)
{
	scan *s = arg;
	scan_part *part = &s->part[worker];
	const uint64_t first = (uint64_t)index * CHUNK, left = s->source.nv - first;
	const size_t n = left < CHUNK ? (size_t)left : CHUNK;
	const wh_code code = wh_source_vertices(c, &s->source, first, n, part->xyz, part->scratch);
	for (size_t i = 0; code == WH_OK && i < n; i++)
		box_add(&part->bounds, part->xyz + 3 * i);
	return code;
}

static wh_code scan_open(wh_ctx *c, scan *s, size_t workers)
{
	s->part = wh_calloc(c, workers, sizeof *s->part);
	for (size_t i = 0; s->part && i < workers; i++) {
		scan_part *part = &s->part[i];
		part->bounds = empty_box;
		part->xyz = wh_alloc(c, (size_t)3 * CHUNK, sizeof(double));
		part->scratch = wh_alloc(c, wh_source_vertex_bytes(&s->source, CHUNK), 1);
	}
	return c->err.code;
}

static void scan_close(wh_ctx *c, scan *s, size_t workers)
{
	for (size_t i = 0; s->part && i < workers; i++) {
		wh_free(c, s->part[i].xyz);
		wh_free(c, s->part[i].scratch);
	}
	wh_free(c, s->part);
}

/* Vertices of fixed size behind elements of fixed size: true, and the byte where they begin. */
static bool find_vertices(const wh_ply *p, uint64_t *base)
{
	*base = p->body;
	for (int i = 0; i < p->vertex; i++) {
		if (p->elems[i].stride == 0 && p->elems[i].count > 0)
			return false;
		*base += p->elems[i].count * p->elems[i].stride;
	}
	return p->elems[p->vertex].stride != 0;
}

static wh_code source_bounds(cmd_env *e, const wh_source *source, box *out)
{
	scan s = {.source = *source};
	const size_t workers = (size_t)e->exec.workers;
	if (scan_open(&e->ctx, &s, workers) == WH_OK) {
		const int64_t chunks = (int64_t)((s.source.nv + CHUNK - 1) / CHUNK);
		(void)wh_exec_for(&e->ctx, &e->exec, chunks, scan_chunk, &s);
		for (size_t i = 0; i < workers; i++)
			box_join(out, &s.part[i].bounds);
	}
	scan_close(&e->ctx, &s, workers);
	return e->ctx.err.code;
}

static wh_code binary_bounds(cmd_env *e, const wh_ply *p, uint64_t base, box *out)
{
	wh_source source = {0};
	wh_ply_vertex_source(p, base, &source);
	return source_bounds(e, &source, out);
}

/* The corners of binary STL's facets, where they lie: all first ones, all second ones, ... */
static wh_code facet_bounds(cmd_env *e, const wh_ply *p, box *out)
{
	wh_code code = WH_OK;
	for (uint32_t k = 0; code == WH_OK && k < 3; k++) {
		wh_source source = {.path = p->path,
		                    .nv = p->elems[p->face].count,
		                    .vfd = p->fd,
		                    .vbase = p->body,
		                    .vstride = WH_STL_FACET,
		                    .vswap = WH_HOST_BIG};
		for (uint32_t axis = 0; axis < 3; axis++) {
			source.voff[axis] = 12 + 12 * k + 4 * axis;
			source.vtype[axis] = WH_F32;
		}
		code = source_bounds(e, &source, out);
	}
	return code;
}

/* Another format's text: by way of the temporary file that a reduction would make. */
static wh_code rewritten_bounds(cmd_env *e, wh_input *in, wh_spill *spill, box *out)
{
	if (!spill->dir && wh_spill_open(&e->ctx, spill, NULL, "/tmp") != WH_OK)
		return e->ctx.err.code;
	const wh_code code = wh_input_rewrite(&e->ctx, &e->exec, spill, in);
	return code == WH_OK ? source_bounds(e, &in->source, out) : code;
}

/* The next number of a text body. */
static bool read_number(FILE *f, double *out)
{
	char token[TOKEN_MAX];
	size_t n = 0;
	int ch = getc_unlocked(f);
	while (ch != EOF && isspace(ch))
		ch = getc_unlocked(f);
	for (; ch != EOF && !isspace(ch) && n + 1 < sizeof token; ch = getc_unlocked(f))
		token[n++] = (char)ch;
	token[n] = '\0';
	char *end;
	*out = strtod(token, &end);
	return n > 0 && *end == '\0';
}

/* A number in front of a list as a count; one that cannot be a count runs into the end. */
static uint64_t list_length(double v)
{
	if (!(v >= 1.0))
		return 0;
	return v < 0x1p63 ? (uint64_t)v : UINT64_MAX;
}

/* One item of an element; the first three of `at` are x, y, z when it is a vertex. */
static bool read_item(FILE *f, const wh_ply *p, const wh_ply_elem *e, double at[3])
{
	for (size_t i = 0; i < e->nprops; i++) {
		double v;
		if (!read_number(f, &v))
			return false;
		for (int k = 0; k < 3; k++)
			if ((const int[]){p->x, p->y, p->z}[k] == (int)i)
				at[k] = v;
		double unused;
		for (uint64_t rest = e->props[i].is_list ? list_length(v) : 0; rest > 0; rest--)
			if (!read_number(f, &unused))
				return false;
	}
	return true;
}

static bool all_finite(const double p[3])
{
	return isfinite(p[0]) && isfinite(p[1]) && isfinite(p[2]);
}

static wh_code read_text(wh_ctx *c, FILE *f, const wh_ply *p, box *out)
{
	for (int i = 0; i <= p->vertex; i++) {
		const wh_ply_elem *e = &p->elems[i];
		for (uint64_t j = 0; j < e->count; j++) {
			double at[3] = {0.0, 0.0, 0.0};
			if (j % CHUNK == 0 && wh_poll(c) != WH_OK)
				return c->err.code;
			if (!read_item(f, p, e, at) || !all_finite(at))
				return wh_fail(c, WH_E_INPUT,
				               "'%s', %s %" PRIu64 ": a finite number is expected",
				               p->path, e->name, j);
			if (i == p->vertex)
				box_add(out, at);
		}
	}
	return WH_OK;
}

static wh_code text_bounds(wh_ctx *c, const wh_ply *p, box *out)
{
	const int fd = dup(p->fd);
	FILE *f = fd >= 0 ? fdopen(fd, "rb") : NULL;
	if (!f && fd >= 0)
		(void)close(fd);
	if (!f)
		return wh_fail_errno(c, "cannot open '%s' again", p->path);
	wh_code code = WH_OK;
	if (fseeko(f, (off_t)p->body, SEEK_SET) != 0)
		code = wh_fail_errno(c, "cannot read '%s'", p->path);
	if (code == WH_OK)
		code = read_text(c, f, p, out);
	(void)fclose(f);
	return code;
}

/* Leaves the box empty when bounds are not asked for or not to be had cheaply. */
static wh_code find_bounds(cmd_env *e, const options *o, wh_input *in, wh_spill *spill, box *out)
{
	const wh_ply *p = &in->ply;
	uint64_t base;
	if (p->vertex < 0 || o->no_bounds)
		return WH_OK;
	if (p->format == WH_PLY_ASCII && !o->bounds)
		return WH_OK;
	if (p->format == WH_PLY_ASCII)
		return p->kind == WH_FORMAT_PLY ? text_bounds(&e->ctx, p, out)
		                                : rewritten_bounds(e, in, spill, out);
	if (p->kind == WH_FORMAT_STL)
		return facet_bounds(e, p, out);
	return find_vertices(p, &base) ? binary_bounds(e, p, base, out) : WH_OK;
}

/* ---- printing ---- */

/* PLY's words for its own encodings; for other formats, their names in front of them. */
static const char *format_name(const wh_ply *p, char text[FORMAT_TEXT])
{
	static const char *const names[] = {
	    [WH_PLY_ASCII] = "ascii",
	    [WH_PLY_LE] = "binary_little_endian",
	    [WH_PLY_BE] = "binary_big_endian",
	};
	if (p->kind == WH_FORMAT_PLY)
		return names[p->format];
	(void)snprintf(text, FORMAT_TEXT, "%s %s", wh_format_name(p->kind),
	               p->format == WH_PLY_ASCII ? "ascii" : "binary");
	return text;
}

static const char *type_name(wh_type type)
{
	static const char *const names[] = {
	    [WH_I8] = "char",   [WH_U8] = "uchar",  [WH_I16] = "short", [WH_U16] = "ushort",
	    [WH_I32] = "int",   [WH_U32] = "uint",  [WH_I64] = "int64", [WH_U64] = "uint64",
	    [WH_F32] = "float", [WH_F64] = "double"};
	return names[type];
}

static void print_element(const wh_ply_elem *e)
{
	(void)printf("element %s: %" PRIu64, e->name, e->count);
	if (e->stride)
		(void)printf(" of %" PRIu64 " bytes", e->stride);
	(void)printf("\n");
	for (size_t i = 0; i < e->nprops; i++) {
		const wh_ply_prop *p = &e->props[i];
		if (p->is_list)
			(void)printf("  %-16s list of %s, count %s\n", p->name, type_name(p->type),
			             type_name(p->count_type));
		else
			(void)printf("  %-16s %s\n", p->name, type_name(p->type));
	}
}

static void print_text(const wh_ply *p, const box *b)
{
	char text[FORMAT_TEXT];
	(void)printf("file: %s\nformat: %s\nbytes: %" PRIu64 " (header %" PRIu64 ")\n", p->path,
	             format_name(p, text), p->size, p->body);
	for (size_t i = 0; i < p->nelems; i++)
		print_element(&p->elems[i]);
	for (int i = 0; b->n && i < 3; i++) {
		const int prop = (const int[]){p->x, p->y, p->z}[i];
		const bool is_double = p->elems[p->vertex].props[prop].type != WH_F32;
		char from[CMD_REAL_TEXT], to[CMD_REAL_TEXT];
		(void)printf("%c: %s to %s\n", "xyz"[i], cmd_real_text(b->min[i], is_double, from),
		             cmd_real_text(b->max[i], is_double, to));
	}
	if (b->n)
		(void)printf("diagonal: %.10g\n", box_diagonal(b));
}

/* Names and paths are bytes; what is not UTF-8 gets question marks. */
static json_t *json_name(const char *text)
{
	json_t *j = json_string(text);
	char *copy = j ? NULL : strdup(text);
	if (!copy)
		return j;
	for (char *s = copy; *s; s++)
		if ((unsigned char)*s > 126)
			*s = '?';
	j = json_string(copy);
	free(copy);
	return j;
}

static json_t *json_count(uint64_t n)
{
	return json_integer((json_int_t)n);
}

static json_t *json_property(const wh_ply_prop *p)
{
	json_t *j = json_object();
	(void)json_object_set_new(j, "name", json_name(p->name));
	(void)json_object_set_new(j, "type", json_string(type_name(p->type)));
	(void)json_object_set_new(j, "list", json_boolean(p->is_list));
	if (p->is_list)
		(void)json_object_set_new(j, "count_type", json_string(type_name(p->count_type)));
	return j;
}

static json_t *json_element(const wh_ply_elem *e)
{
	json_t *j = json_object(), *props = json_array();
	(void)json_object_set_new(j, "name", json_name(e->name));
	(void)json_object_set_new(j, "count", json_count(e->count));
	(void)json_object_set_new(j, "item_bytes", e->stride ? json_count(e->stride) : json_null());
	for (size_t i = 0; i < e->nprops; i++)
		(void)json_array_append_new(props, json_property(&e->props[i]));
	(void)json_object_set_new(j, "properties", props);
	return j;
}

static json_t *json_triple(const double v[3])
{
	return json_pack("[f, f, f]", v[0], v[1], v[2]);
}

static json_t *json_bounds(const box *b)
{
	if (!b->n)
		return json_null();
	json_t *j = json_object();
	(void)json_object_set_new(j, "min", json_triple(b->min));
	(void)json_object_set_new(j, "max", json_triple(b->max));
	const double diagonal = box_diagonal(b);
	(void)json_object_set_new(j, "diagonal",
	                          isfinite(diagonal) ? json_real(diagonal) : json_null());
	return j;
}

static uint64_t count_of(const wh_ply *p, int elem)
{
	return elem < 0 ? 0 : p->elems[elem].count;
}

static wh_code print_json(wh_ctx *c, const wh_ply *p, const box *b)
{
	char text_name[FORMAT_TEXT];
	json_t *j = json_object(), *elems = json_array();
	for (size_t i = 0; i < p->nelems; i++)
		(void)json_array_append_new(elems, json_element(&p->elems[i]));
	(void)json_object_set_new(j, "path", json_name(p->path));
	(void)json_object_set_new(j, "format", json_string(format_name(p, text_name)));
	(void)json_object_set_new(j, "bytes", json_count(p->size));
	(void)json_object_set_new(j, "header_bytes", json_count(p->body));
	(void)json_object_set_new(j, "vertices", json_count(count_of(p, p->vertex)));
	(void)json_object_set_new(j, "faces", json_count(count_of(p, p->face)));
	(void)json_object_set_new(j, "elements", elems);
	(void)json_object_set_new(j, "bounds", json_bounds(b));
	char *text = json_dumps(j, JSON_INDENT(2));
	json_decref(j);
	if (!text)
		return wh_fail(c, WH_E_RUN, "out of memory");
	(void)puts(text);
	free(text);
	return WH_OK;
}

/* The header is printed also when the vertices turn out to be damaged. */
static wh_code print_info(cmd_env *e, const options *o, wh_input *in, wh_spill *spill)
{
	box b = empty_box;
	wh_code code = find_bounds(e, o, in, spill, &b);
	if (code != WH_OK)
		b = empty_box;
	if (code == WH_E_INTERRUPT)
		return code;
	if (!o->json)
		print_text(&in->ply, &b);
	else if (print_json(&e->ctx, &in->ply, &b) != WH_OK)
		code = e->ctx.err.code;
	return code;
}

static wh_code info(cmd_env *e, const options *o)
{
	wh_input in;
	wh_spill spill = {0};
	wh_code code = wh_input_describe(&e->ctx, &e->exec, &spill, o->path, o->from, &in);
	if (code == WH_OK) {
		code = print_info(e, o, &in, &spill);
		wh_input_close(&e->ctx, &spill, &in);
	}
	wh_spill_close(&e->ctx, &spill);
	return code;
}

int cmd_info(int argc, char **argv)
{
	options o;
	cmd_env e;
	const int status = parse_options(&o, argc, argv);
	if (status != WH_OK)
		return status;
	if (o.help) {
		(void)fputs(help, stdout);
		return WH_OK;
	}
	cmd_env_init(&e, argv[0]);
	e.exec.workers = cmd_threads(argv[0], o.threads);
	return info(&e, &o) == WH_OK ? WH_OK : cmd_report_failure(&e);
}
