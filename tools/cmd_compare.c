/* whittle compare: the two-sided distance of two meshes as a table or as JSON. */
#include "cmd.h"
#include "compare_json.h"
#include "compare_seams.h"

#include "progress_bar.h"

#include "pipeline/measure.h"

#include <getopt.h>
#include <inttypes.h>
#include <jansson.h>
#include <stdio.h>
#include <string.h>

typedef struct options {
	const char *path[2];
	const char *seams, *reference, *temp_dir;
	wh_format from;
	bool json, quiet;
	int64_t samples, seed, threads;
	size_t memory;
} options;

typedef struct results {
	wh_compare b;
	wh_compare reference; /* where there is one */
} results;

static void print_help(void)
{
	(void)printf(
	    "usage: whittle compare A B [--json] [--samples N] [--seed N] [--memory SIZE]\n"
	    "                       [--threads N] [--temp-dir DIR] [--seams FILE [--reference "
	    "C]]\n\n"
	    "Measures how far A and B are from each other: from points of A to the nearest point\n"
	    "of B, and the other way round. Mean, RMS and percentiles are over points spread\n"
	    "evenly over the area, the maximum also over all vertices. \"Both\" takes the points\n"
	    "of both sides as one set. The first line is the figure to quote: the larger RMS of\n"
	    "the two sides, also as a share of the diagonal of A's bounding box. Normals:\n"
	    "the angle between a point's face and the nearest face of the other mesh. Colours,\n"
	    "where both meshes have them: how far red, green and blue of a point and of the\n"
	    "nearest one are apart (root mean square of the three, 0 to 255).\n\n"
	    "  --json          print JSON instead of a table; it has a histogram as well\n"
	    "  --samples N     points a side (default: the larger mesh's faces, but 1M to 4M)\n"
	    "  --seed N        other points (default 0)\n"
	    "  --memory SIZE   ceiling of the process: 512M, 4G, K = 1024 (default: half of the\n"
	    "                  machine's, its control group's or the job's); the figures do not\n"
	    "                  depend on it\n"
	    "  --temp-dir DIR  for 35 bytes a face and more (default: $SLURM_TMPDIR, $TMPDIR,\n"
	    "                  /tmp)\n"
	    "  --from F        all files are ply, obj, off or stl, whatever they look like\n"
	    "  --threads N     0, the default: all; the figures do not depend on it\n"
	    "  -q, --quiet     do not tell how far it is (--no-progress is the same)\n\n"
	    "Do the cuts between clusters show in B, a reduced A? Its faces within three of\n"
	    "those nearest to the points of FILE are a band, beside the rest, the interior:\n\n"
	    "  --seams FILE   points along the cuts, as reduce --seams FILE writes them\n"
	    "  --reference C  A reduced to as many faces with --cluster-faces 0 --micro-faces 0.\n"
	    "                 Only a ratio of B over that of C tells of the cuts: error and faces\n"
	    "                 an area differ from place to place without them, too\n");
}

/* WH_OK, or the exit status for a value that is no count. */
static int parse_number(const char *name, const char *what, const char *text, int64_t *out)
{
	if (cmd_parse_count(text, false, out))
		return WH_OK;
	return cmd_usage_error(name, "--%s \"%s\" is no count from 0 to 2^63", what, text);
}

static int parse_option(const char *name, int opt, options *o)
{
	switch (opt) {
	case 'j':
		o->json = true;
		return WH_OK;
	case 'n':
		return cmd_parse_samples(optarg, &o->samples)
		           ? WH_OK
		           : cmd_usage_error(name, "--samples \"%s\" is no count from 1 to 1000G",
		                             optarg);
	case 'm':
		return cmd_parse_memory(optarg, &o->memory)
		           ? WH_OK
		           : cmd_usage_error(name, "\"%s\" is no size of 1M or more", optarg);
	case 'd':
		o->temp_dir = optarg;
		return WH_OK;
	case 'p':
	case 'q':
		o->quiet = true;
		return WH_OK;
	case 's':
		o->seams = optarg;
		return WH_OK;
	case 'c':
		o->reference = optarg;
		return WH_OK;
	case 'f':
		return cmd_parse_from(optarg, &o->from)
		           ? WH_OK
		           : cmd_usage_error(name, "--from \"%s\" is not ply, obj, off or stl",
		                             optarg);
	case 'r':
		return parse_number(name, "seed", optarg, &o->seed);
	case 't':
		if (parse_number(name, "threads", optarg, &o->threads) != WH_OK)
			return WH_E_USAGE;
		if (o->threads > 4096)
			return cmd_usage_error(name, "--threads is 4096 at most");
		return WH_OK;
	default:
		return cmd_usage_error(name, "wrong option");
	}
}

/* WH_OK, or the exit status for wrong usage. `done` when there is nothing left to do. */
static int parse(int argc, char **argv, options *o, bool *done)
{
	static const struct option longs[] = {{"json", no_argument, NULL, 'j'},
	                                      {"samples", required_argument, NULL, 'n'},
	                                      {"seed", required_argument, NULL, 'r'},
	                                      {"threads", required_argument, NULL, 't'},
	                                      {"seams", required_argument, NULL, 's'},
	                                      {"reference", required_argument, NULL, 'c'},
	                                      {"from", required_argument, NULL, 'f'},
	                                      {"memory", required_argument, NULL, 'm'},
	                                      {"temp-dir", required_argument, NULL, 'd'},
	                                      {"no-progress", no_argument, NULL, 'p'},
	                                      {"quiet", no_argument, NULL, 'p'},
	                                      {"help", no_argument, NULL, 'h'},
	                                      {NULL, 0, NULL, 0}};
	optind = 1;
	for (int opt; (opt = getopt_long(argc, argv, "hq", longs, NULL)) != -1;) {
		if (opt == 'h') {
			print_help();
			*done = true;
			return WH_OK;
		}
		if (parse_option(argv[0], opt, o) != WH_OK)
			return WH_E_USAGE;
	}
	if (argc - optind != 2)
		return cmd_usage_error(argv[0], "two files are needed, %d given", argc - optind);
	if (strcmp(argv[optind], "-") == 0 && strcmp(argv[optind + 1], "-") == 0)
		return cmd_usage_error(argv[0], "only one of the two can be standard input");
	if (o->reference && !o->seams)
		return cmd_usage_error(argv[0], "--reference needs --seams");
	o->path[0] = argv[optind];
	o->path[1] = argv[optind + 1];
	return WH_OK;
}

static wh_code compare_files(cmd_env *e, const options *o, results *r)
{
	progress_bar bar;
	progress_bar_init(&bar, !o->quiet);
	const wh_measure_other other[] = {{o->path[1], o->from, &r->b},
	                                  {o->reference, o->from, &r->reference}};
	const wh_measure_params p = {.a = o->path[0],
	                             .from = o->from,
	                             .other = other,
	                             .others = o->reference ? 2 : 1,
	                             .seams = o->seams,
	                             .samples = (uint64_t)o->samples,
	                             .seed = (uint64_t)o->seed,
	                             .temp_dir = o->temp_dir,
	                             .memory = o->memory,
	                             .progress = progress_bar_tell,
	                             .progress_user = &bar};
	const wh_code code = wh_measure_files(&e->ctx, &e->exec, &p);
	progress_bar_end(&bar);
	return code;
}

static const double MOST_DIGITS = 1e7; /* larger numbers have no room in a column */

static void print_row(const char *text, const double x[3], const char *format)
{
	(void)printf("%-26s", text);
	for (int i = 0; i < 3; i++)
		(void)printf(x[i] < MOST_DIGITS ? format : "%14.6g", x[i]);
	(void)printf("\n");
}

static void print_block(const wh_compare *r, const char *title, double factor, const char *format)
{
	const wh_distance *const d[] = {&r->a_to_b, &r->b_to_a, &r->both};
	(void)printf("%s\n", title);
	for (int i = 0; i < COMPARE_ROWS; i++) {
		double x[3];
		char text[32];
		for (int k = 0; k < 3; k++)
			x[k] = compare_value(d[k], compare_rows + i) * factor;
		(void)snprintf(text, sizeof text, "  %s", compare_rows[i].text);
		print_row(text, x, format);
	}
}

static void print_normals(const wh_compare *r)
{
	const double mean[] = {r->a_to_b.normal_mean, r->b_to_a.normal_mean, r->both.normal_mean};
	const double rms[] = {r->a_to_b.normal_rms, r->b_to_a.normal_rms, r->both.normal_rms};
	(void)printf("degrees between normals\n");
	print_row("  mean", mean, "%14.4f");
	print_row("  RMS", rms, "%14.4f");
}

static void print_colours(const wh_compare *r)
{
	const double mean[] = {r->a_to_b.colour_mean, r->b_to_a.colour_mean, r->both.colour_mean};
	const double rms[] = {r->a_to_b.colour_rms, r->b_to_a.colour_rms, r->both.colour_rms};
	if (r->both.colours == 0)
		return;
	(void)printf("difference of colours, of 255\n");
	print_row("  mean", mean, "%14.4f");
	print_row("  RMS", rms, "%14.4f");
}

/* The figure to quote. */
static void print_rms(const wh_compare *r)
{
	(void)printf("%-26s%14.6g", "two-sided RMS distance", r->rms);
	if (r->diagonal > 0)
		(void)printf(" = %.2f millionths of the diagonal",
		             compare_millionths(r->rms, r->diagonal));
	(void)printf("\n");
}

static void print_table(const wh_compare *r)
{
	const double percent = compare_millionths(1, r->diagonal) / 1e4;
	print_rms(r);
	(void)printf("%-26s%14s%14s%14s\n", "", "A to B", "B to A", "both");
	print_block(r, "distance", 1, "%14.6g");
	if (r->diagonal > 0) {
		print_block(r, "% of the diagonal", percent, "%14.6f");
		print_block(r, "millionths of the diagonal", percent * 1e4, "%14.2f");
	}
	print_normals(r);
	print_colours(r);
	(void)printf("%-26s%14" PRIu64 "%14" PRIu64 "%14" PRIu64 "\n", "samples", r->a_to_b.samples,
	             r->b_to_a.samples, r->both.samples);
	(void)printf("%-26s%14" PRIu64 "%14" PRIu64 "%14" PRIu64 "\n", "vertices",
	             r->a_to_b.vertices, r->b_to_a.vertices, r->both.vertices);
	(void)printf("%-26s%14.9g\n", "diagonal of A", r->diagonal);
}

static json_t *json_seams(const options *o, const results *r)
{
	return compare_seams_json(&r->b, o->reference ? &r->reference : NULL);
}

static json_t *json_path(const char *path)
{
	json_t *name = json_string(path); /* NULL when the path is not UTF-8 */
	return name ? name : json_null();
}

static wh_code print_json(wh_ctx *c, const options *o, const results *all)
{
	const wh_compare *r = &all->b;
	json_t *j = json_object();
	int bad = json_object_set_new(j, "a", json_path(o->path[0]));
	bad |= json_object_set_new(j, "b", json_path(o->path[1]));
	bad |= compare_json_fill(j, r);
	if (o->seams)
		bad |= json_object_set_new(j, "seams", json_seams(o, all));
	if (!bad)
		bad = json_dumpf(j, stdout, JSON_INDENT(2));
	json_decref(j);
	(void)printf("\n");
	return bad ? wh_fail(c, WH_E_RUN, "the JSON could not be written") : WH_OK;
}

int cmd_compare(int argc, char **argv)
{
	options o = {0};
	bool done = false;
	const int usage = parse(argc, argv, &o, &done);
	if (usage != WH_OK || done)
		return usage;
	cmd_env e;
	results r = {0};
	cmd_env_init(&e, argv[0]);
	e.exec.workers = cmd_threads(argv[0], o.threads);
	if (compare_files(&e, &o, &r) != WH_OK)
		return cmd_report_failure(&e);
	if (o.json)
		return print_json(&e.ctx, &o, &r) == WH_OK ? WH_OK : cmd_report_failure(&e);
	print_table(&r.b);
	if (o.seams)
		compare_seams_print(&r.b, o.reference ? &r.reference : NULL);
	return WH_OK;
}
