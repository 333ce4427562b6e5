/* whittle check: the invariants of a mesh as a table or as JSON. */
#include "cmd.h"
#include "progress_bar.h"

#include "mesh/check.h"
#include "pipeline/inspect.h"

#include <getopt.h>
#include <inttypes.h>
#include <jansson.h>
#include <stdio.h>
#include <string.h>

typedef struct options {
	const char *path;
	const char *temp_dir;
	wh_format from;
	bool json;
	bool strict;
	bool quiet;
	bool rply;
	bool weld;
	double weld_distance, weld_share;
	int64_t threads;
	int64_t memory;
} options;

static void print_help(void)
{
	(void)printf(
	    "usage: whittle check FILE [--json] [--strict] [--weld EPS] [--memory SIZE]\n"
	    "                          [--threads N] [--temp-dir DIR] [--quiet]\n\n"
	    "Counts everything that can be right or wrong with a triangle mesh. It is clean\n"
	    "when it is an oriented manifold, with or without boundary, without degenerate\n"
	    "or duplicate faces, or vertices that are not finite. An edge is folded when its\n"
	    "two faces lie on each other, their normals more than 170 degrees apart. The radius "
	    "ratio of a face is 2 r / R, of the inscribed and the\n"
	    "circumscribed circle: 1 when equilateral, 0 without area.\n\n"
	    "  --json          print JSON instead of a table\n"
	    "  --strict        exit with status 3 when the mesh is not clean\n"
	    "  --weld EPS|P%%  first make vertices that near one, as reduce --weld does\n"
	    "  --memory SIZE   ceiling of the process: 512M, 4G, K = 1024 (default: half of\n"
	    "                  the machine's, its control group's or the job's); a mesh that\n"
	    "                  is too large for it is cut into clusters on disk\n"
	    "  --temp-dir DIR  for these (default: $SLURM_TMPDIR, $TMPDIR, /tmp)\n"
	    "  --from F        FILE is ply, obj, off or stl, whatever it looks like\n"
	    "  --reader R      of PLY: whittle (default), or rply where it was built with\n"
	    "  --threads N     0 (default): all this process may use\n"
	    "  -q, --quiet     do not tell how far it is (--no-progress is the same)\n");
}

/* WH_OK, or the exit status for wrong usage. `done` when there is nothing left to do. */
static int parse(int argc, char **argv, options *o, bool *done)
{
	static const struct option longs[] = {
	    {"json", no_argument, NULL, 'j'},           {"strict", no_argument, NULL, 's'},
	    {"threads", required_argument, NULL, 't'},  {"memory", required_argument, NULL, 'm'},
	    {"temp-dir", required_argument, NULL, 'd'}, {"no-progress", no_argument, NULL, 'p'},
	    {"quiet", no_argument, NULL, 'q'},          {"from", required_argument, NULL, 'f'},
	    {"weld", required_argument, NULL, 'w'},     {"reader", required_argument, NULL, 'r'},
	    {"help", no_argument, NULL, 'h'},           {NULL, 0, NULL, 0}};
	optind = 1;
	for (int opt; (opt = getopt_long(argc, argv, "hq", longs, NULL)) != -1;) {
		switch (opt) {
		case 'j':
			o->json = true;
			break;
		case 's':
			o->strict = true;
			break;
		case 't':
			if (!cmd_parse_count(optarg, false, &o->threads) || o->threads > 4096)
				return cmd_usage_error(argv[0], "\"%s\" is no number of threads",
				                       optarg);
			break;
		case 'm':
			if (!cmd_parse_count(optarg, true, &o->memory) || o->memory == 0)
				return cmd_usage_error(argv[0], "\"%s\" is no size such as 512M",
				                       optarg);
			break;
		case 'd':
			o->temp_dir = optarg;
			break;
		case 'f':
			if (!cmd_parse_from(optarg, &o->from))
				return cmd_usage_error(
				    argv[0], "--from \"%s\" is not ply, obj, off or stl", optarg);
			break;
		case 'r':
			o->rply = strcmp(optarg, "rply") == 0;
			if (!o->rply && strcmp(optarg, "whittle") != 0)
				return cmd_usage_error(
				    argv[0], "--reader \"%s\" is not whittle or rply", optarg);
			break;
		case 'w':
			o->weld = true;
			if (!cmd_parse_weld(optarg, &o->weld_distance, &o->weld_share))
				return cmd_usage_error(
				    argv[0],
				    "--weld \"%s\" is not a distance from 0 on, in "
				    "units of the file or such as 0.001%%",
				    optarg);
			break;
		case 'p':
		case 'q':
			o->quiet = true;
			break;
		case 'h':
			print_help();
			*done = true;
			return WH_OK;
		default:
			return cmd_usage_error(argv[0], "wrong option");
		}
	}
	if (argc - optind != 1)
		return cmd_usage_error(argv[0], "one FILE is needed, %d given", argc - optind);
	o->path = argv[optind];
	return WH_OK;
}

static wh_code check_file(cmd_env *e, const options *o, wh_check *r, bool *is_double)
{
	progress_bar bar;
	progress_bar_init(&bar, !o->quiet);
	const wh_inspect_params p = {.path = o->path,
	                             .from = o->from,
	                             .temp_dir = o->temp_dir,
	                             .rply = o->rply,
	                             .weld = o->weld,
	                             .weld_distance = o->weld_distance,
	                             .weld_share = o->weld_share,
	                             .memory = (size_t)o->memory,
	                             .progress = progress_bar_tell,
	                             .progress_user = &bar};
	const wh_code code = wh_inspect_file(&e->ctx, &e->exec, &p, r, is_double);
	progress_bar_end(&bar);
	return code;
}

/* One line of the table and one member of the JSON. */
typedef struct row {
	const char *key;
	const char *text;
	size_t offset; /* of a uint64_t in wh_check */
	bool breaks;   /* a mesh with any is not clean */
} row;

#define ROW(member, text)                                        \
	{                                                        \
#member, text, offsetof(wh_check, member), false \
	}
#define BREAKS(member, text)                                    \
	{                                                       \
#member, text, offsetof(wh_check, member), true \
	}

static const row rows[] = {
    ROW(vertices, "vertices"),
    ROW(unreferenced_vertices, "  unreferenced"),
    ROW(duplicate_vertices, "  at the position of another"),
    BREAKS(nonfinite_vertices, "  not finite"),
    BREAKS(nonmanifold_vertices, "  non-manifold"),
    ROW(faces, "faces"),
    ROW(nonfinite_faces, "  with a vertex not finite"),
    BREAKS(degenerate_faces, "  degenerate"),
    ROW(zero_area_faces, "  of zero area"),
    BREAKS(duplicate_faces, "  duplicates"),
    ROW(edges, "edges"),
    ROW(boundary_edges, "  boundary"),
    BREAKS(nonmanifold_edges, "  non-manifold"),
    BREAKS(misoriented_edges, "  badly oriented"),
    ROW(folded_edges, "  folded"),
    ROW(components, "components"),
    ROW(edge_components, "  joined by edges only"),
    ROW(largest_component, "  faces of the largest"),
    ROW(boundary_loops, "boundary loops"),
};

enum { NROWS = sizeof rows / sizeof rows[0] };

static uint64_t value_of(const wh_check *r, const row *w)
{
	uint64_t v;
	memcpy(&v, (const char *)r + w->offset, sizeof v);
	return v;
}

static void print_corner(const char *what, wh_vec3 p, bool is_double)
{
	char x[CMD_REAL_TEXT], y[CMD_REAL_TEXT], z[CMD_REAL_TEXT];
	(void)printf("%-28s %s %s %s\n", what, cmd_real_text(p.x, is_double, x),
	             cmd_real_text(p.y, is_double, y), cmd_real_text(p.z, is_double, z));
}

static void print_table(const wh_check *r, bool is_double)
{
	for (int i = 0; i < NROWS; i++)
		(void)printf("%-28s %12" PRIu64 "\n", rows[i].text, value_of(r, rows + i));
	(void)printf("%-28s %12" PRId64 "\n", "Euler characteristic", r->euler);
	if (r->genus >= 0)
		(void)printf("%-28s %12" PRId64 "\n", "genus", r->genus);
	else
		(void)printf("%-28s %12s\n", "genus", "undefined");
	(void)printf("%-28s %12.9g\n", "area", r->area);
	(void)printf("%-28s %12.4f\n", "radius ratio, mean", r->radius_ratio_mean);
	(void)printf("%-28s %12.3f\n", "  5 % of the faces below", r->radius_ratio_p5);
	print_corner("box from", r->lo, is_double);
	print_corner("box to", r->hi, is_double);
	if (r->welded_vertices || r->collapsed_faces)
		(void)printf("%-28s %12" PRIu64 "\n%-28s %12" PRIu64 "\n", "welded vertices",
		             r->welded_vertices, "faces lost by welding", r->collapsed_faces);
	(void)printf("%-28s %12s\n", "clean", wh_check_clean(r) ? "yes" : "no");
}

static json_t *json_counts(const uint64_t *count, int n)
{
	json_t *a = json_array();
	while (n > 0 && count[n - 1] == 0)
		n--;
	for (int i = 0; i < n; i++)
		(void)json_array_append_new(a, json_integer((json_int_t)count[i]));
	return a;
}

/* The keys of what keeps the mesh from being clean. */
static json_t *json_broken(const wh_check *r)
{
	json_t *a = json_array();
	for (int i = 0; i < NROWS; i++)
		if (rows[i].breaks && value_of(r, rows + i) > 0)
			(void)json_array_append_new(a, json_string(rows[i].key));
	return a;
}

static json_t *json_point(wh_vec3 p)
{
	return json_pack("[f, f, f]", p.x, p.y, p.z);
}

static wh_code print_json(wh_ctx *c, const char *path, const wh_check *r)
{
	json_t *j = json_object();
	json_t *name = json_string(path); /* NULL when the path is not UTF-8 */
	int bad = json_object_set_new(j, "file", name ? name : json_null());
	for (int i = 0; i < NROWS; i++)
		bad |= json_object_set_new(j, rows[i].key,
		                           json_integer((json_int_t)value_of(r, rows + i)));
	bad |= json_object_set_new(j, "euler", json_integer(r->euler));
	bad |= json_object_set_new(j, "genus", r->genus < 0 ? json_null() : json_integer(r->genus));
	bad |= json_object_set_new(j, "area", json_real(r->area));
	bad |= json_object_set_new(j, "radius_ratio_mean", json_real(r->radius_ratio_mean));
	bad |= json_object_set_new(j, "radius_ratio_p5", json_real(r->radius_ratio_p5));
	bad |= json_object_set_new(j, "radius_ratios",
	                           json_counts(r->radius_ratios, WH_RADIUS_RATIOS));
	bad |= json_object_set_new(j, "component_sizes",
	                           json_counts(r->component_sizes, WH_COMPONENT_SIZES));
	bad |=
	    json_object_set_new(j, "welded_vertices", json_integer((json_int_t)r->welded_vertices));
	bad |=
	    json_object_set_new(j, "collapsed_faces", json_integer((json_int_t)r->collapsed_faces));
	bad |= json_object_set_new(j, "min", json_point(r->lo));
	bad |= json_object_set_new(j, "max", json_point(r->hi));
	bad |= json_object_set_new(j, "clean", json_boolean(wh_check_clean(r)));
	bad |= json_object_set_new(j, "broken", json_broken(r));
	if (!bad)
		bad = json_dumpf(j, stdout, JSON_INDENT(2));
	json_decref(j);
	(void)printf("\n");
	return bad ? wh_fail(c, WH_E_RUN, "the JSON could not be written") : WH_OK;
}

int cmd_check(int argc, char **argv)
{
	options o = {0};
	bool done = false;
	const int usage = parse(argc, argv, &o, &done);
	if (usage != WH_OK || done)
		return usage;
	cmd_env e;
	wh_check r = {0};
	bool is_double = false;
	cmd_env_init(&e, argv[0]);
	e.exec.workers = cmd_threads(argv[0], o.threads);
	if (check_file(&e, &o, &r, &is_double) != WH_OK)
		return cmd_report_failure(&e);
	if (!o.json)
		print_table(&r, is_double);
	else if (print_json(&e.ctx, o.path, &r) != WH_OK)
		return cmd_report_failure(&e);
	return o.strict && !wh_check_clean(&r) ? WH_E_INPUT : WH_OK;
}
