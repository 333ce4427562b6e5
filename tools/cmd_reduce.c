/* whittle reduce: options -> parameters -> one call -> words, report, exit status. */
#define _POSIX_C_SOURCE 200809L
#include "cmd.h"
#include "progress_bar.h"
#include "reduce_report.h"
#include "whittle.h"

#include <getopt.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

static const char help[] =
    "usage: whittle reduce IN -o OUT --faces N | --vertices N | --ratio R | --error E\n"
    "Reduces a PLY mesh within a memory ceiling; the first limit reached stops.\n"
    "Positions and faces are kept; other properties are named in the summary.\n\n"
    "  -o, --output FILE     where to; - is standard output\n"
    "  -n, --faces N|P%      triangles to keep: 200K, 1.5M, 10%\n"
    "      --vertices N|P%   vertices to keep\n"
    "      --ratio R         share of the triangles to keep: 0.1\n"
    "      --error E|P%      how far the surface may move, as estimated, in units of\n"
    "                        the file or per cent of the bounding-box diagonal\n"
    "      --lock-boundary   keep boundary edges exactly\n"
    "      --memory SIZE     ceiling of the process: 512M, 4G, K = 1024 (default: half\n"
    "                        of the machine's, its control group's or the job's)\n"
    "      --threads N       0 (default): all this process may use\n"
    "      --temp-dir DIR    default: $SLURM_TMPDIR, $TMPDIR, beside the output\n"
    "      --ascii           text instead of binary\n"
    "      --report FILE     what was done, as JSON\n"
    "  -f, --force           write over an existing output and report\n"
    "  -q, --quiet           no progress and no summary (--no-progress: no progress)\n"
    "  -v, --verbose         seconds of each phase\n"
    "Sizes that decide the result's bytes, as memory and threads never do:\n"
    "      --cluster-faces N (262144; 0: all in one), --micro-faces N (16384; 0: none)\n"
    "      --final-faces N   (1M) from which the last pass over all may start\n";

typedef struct options {
	wh_reduce_params params;
	const char *report;
	bool quiet, verbose, no_progress, help;
} options;

enum {
	OPT_VERTICES = 256,
	OPT_RATIO,
	OPT_ERROR,
	OPT_LOCK,
	OPT_MEMORY,
	OPT_THREADS,
	OPT_TEMP,
	OPT_ASCII,
	OPT_REPORT,
	OPT_CLUSTER,
	OPT_MICRO,
	OPT_FINAL,
	OPT_NO_PROGRESS
};

static const struct option long_options[] = {
    {"output", required_argument, NULL, 'o'},
    {"faces", required_argument, NULL, 'n'},
    {"vertices", required_argument, NULL, OPT_VERTICES},
    {"ratio", required_argument, NULL, OPT_RATIO},
    {"error", required_argument, NULL, OPT_ERROR},
    {"lock-boundary", no_argument, NULL, OPT_LOCK},
    {"memory", required_argument, NULL, OPT_MEMORY},
    {"threads", required_argument, NULL, OPT_THREADS},
    {"temp-dir", required_argument, NULL, OPT_TEMP},
    {"ascii", no_argument, NULL, OPT_ASCII},
    {"report", required_argument, NULL, OPT_REPORT},
    {"cluster-faces", required_argument, NULL, OPT_CLUSTER},
    {"micro-faces", required_argument, NULL, OPT_MICRO},
    {"final-faces", required_argument, NULL, OPT_FINAL},
    {"force", no_argument, NULL, 'f'},
    {"quiet", no_argument, NULL, 'q'},
    {"verbose", no_argument, NULL, 'v'},
    {"no-progress", no_argument, NULL, OPT_NO_PROGRESS},
    {"help", no_argument, NULL, 'h'},
    {NULL, 0, NULL, 0},
};

/* ---- arguments ---------------------------------------------------------------------------- */

/* The number in front of a final "%", as a share. False when there is no "%". */
static bool parse_percent(const char *text, double *share)
{
	char copy[64];
	const size_t n = strlen(text);
	if (n < 2 || n >= sizeof copy || text[n - 1] != '%')
		return false;
	memcpy(copy, text, n - 1);
	copy[n - 1] = '\0';
	if (!cmd_parse_real(copy, share))
		return false;
	*share /= 100;
	return true;
}

/* A positive count or a percentage up to 100. */
static bool parse_target(const char *text, uint64_t *count, double *share)
{
	int64_t n;
	if (parse_percent(text, share))
		return *share > 0 && *share <= 1;
	if (!cmd_parse_count(text, false, &n) || n <= 0)
		return false;
	*count = (uint64_t)n;
	return true;
}

static bool parse_size(const char *text, bool binary, uint64_t *out)
{
	int64_t n;
	if (!cmd_parse_count(text, binary, &n))
		return false;
	*out = (uint64_t)n;
	return true;
}

static bool parse_error_limit(const char *text, wh_reduce_params *p)
{
	if (parse_percent(text, &p->error_share))
		return p->error_share > 0;
	return cmd_parse_real(text, &p->error) && p->error > 0;
}

/* False when the argument makes no sense. */
static bool take_option(options *o, int opt, const char *arg)
{
	wh_reduce_params *p = &o->params;
	uint64_t n = 0;
	bool ok = true;
	switch (opt) {
	case 'o':
		p->output = arg;
		break;
	case 'n':
		ok = parse_target(arg, &p->faces, &p->face_ratio);
		break;
	case OPT_VERTICES:
		ok = parse_target(arg, &p->vertices, &p->vertex_ratio);
		break;
	case OPT_RATIO:
		ok = (parse_percent(arg, &p->face_ratio) || cmd_parse_real(arg, &p->face_ratio)) &&
		     p->face_ratio > 0 && p->face_ratio <= 1;
		break;
	case OPT_ERROR:
		ok = parse_error_limit(arg, p);
		break;
	case OPT_LOCK:
		p->lock_boundary = true;
		break;
	case OPT_MEMORY:
		ok = parse_size(arg, true, &n) && n > 0;
		p->memory = (size_t)n;
		break;
	case OPT_THREADS:
		ok = parse_size(arg, false, &n) && n <= 1024;
		p->threads = (int)n;
		break;
	case OPT_TEMP:
		p->temp_dir = arg;
		break;
	case OPT_ASCII:
		p->ascii = true;
		break;
	case OPT_REPORT:
		o->report = arg;
		break;
	case OPT_CLUSTER:
		ok = parse_size(arg, false, &p->cluster_faces) &&
		     (p->cluster_faces == 0 || p->cluster_faces >= 1000) &&
		     p->cluster_faces <= 100000000;
		break;
	case OPT_MICRO:
		ok = parse_size(arg, false, &p->micro_faces) &&
		     (p->micro_faces == 0 || p->micro_faces >= 100) && p->micro_faces <= 100000000;
		break;
	case OPT_FINAL:
		ok = parse_size(arg, false, &p->final_faces) && p->final_faces > 0;
		break;
	case 'f':
		p->force = true;
		break;
	case 'q':
		o->quiet = true;
		break;
	case 'v':
		o->verbose = true;
		break;
	case OPT_NO_PROGRESS:
		o->no_progress = true;
		break;
	default:
		o->help = true;
	}
	return ok;
}

static const char *option_name(int opt)
{
	for (const struct option *l = long_options; l->name; l++)
		if (l->val == opt)
			return l->name;
	return "?";
}

/* What an option's value has to be, for messages. */
static const char *expected(int opt)
{
	switch (opt) {
	case 'n':
	case OPT_VERTICES:
		return "a count such as 200K or a share such as 10%";
	case OPT_RATIO:
		return "a share between 0 and 1, such as 0.1 or 10%";
	case OPT_ERROR:
		return "a distance above 0, in units of the file or such as 0.01%";
	case OPT_MEMORY:
		return "a size such as 512M or 4G";
	case OPT_THREADS:
		return "a number from 0 to 1024";
	case OPT_CLUSTER:
		return "0 or a count from 1000 to 100M";
	case OPT_MICRO:
		return "0 or a count from 100 to 100M";
	default:
		return "a count above 0";
	}
}

static bool has_limit(const wh_reduce_params *p)
{
	return p->faces || p->face_ratio > 0 || p->vertices || p->vertex_ratio > 0 ||
	       p->error > 0 || p->error_share > 0;
}

/* WH_OK, or the status to leave with. */
static int parse(int argc, char **argv, options *o)
{
	int opt;
	opterr = 0;
	while ((opt = getopt_long(argc, argv, ":o:n:fqvh", long_options, NULL)) != -1) {
		if (opt == ':')
			return cmd_usage_error("reduce", "%s needs a value", argv[optind - 1]);
		if (opt == '?')
			return cmd_usage_error("reduce", "%s: unknown or ambiguous option",
			                       argv[optind - 1]);
		if (!take_option(o, opt, optarg))
			return cmd_usage_error("reduce", "--%s: '%s' is not %s", option_name(opt),
			                       optarg, expected(opt));
	}
	if (o->help)
		return WH_OK;
	if (optind + 1 != argc)
		return cmd_usage_error("reduce", optind == argc ? "no input file given"
		                                                : "more than one input file given");
	o->params.input = argv[optind];
	if (!o->params.output)
		return cmd_usage_error("reduce", "no output given: add -o FILE");
	if (!has_limit(&o->params))
		return cmd_usage_error(
		    "reduce", "no target given: add --faces, --vertices, --ratio or --error");
	return WH_OK;
}

static bool is_dash(const char *name)
{
	return name && strcmp(name, "-") == 0;
}

/* True when both names lead to one file. */
static bool same_file(const char *a, const char *b)
{
	struct stat x, y;
	if (strcmp(a, b) == 0)
		return true;
	return stat(a, &x) == 0 && stat(b, &y) == 0 && x.st_dev == y.st_dev && x.st_ino == y.st_ino;
}

/* The report may replace an older one when asked to, but neither mesh. */
static int check_report_name(const options *o)
{
	if (!o->report)
		return WH_OK;
	if (same_file(o->report, o->params.output) || same_file(o->report, o->params.input))
		return cmd_usage_error("reduce", "--report '%s' is the input or the output",
		                       o->report);
	struct stat st;
	if (!o->params.force && stat(o->report, &st) == 0 && S_ISREG(st.st_mode))
		return cmd_usage_error("reduce", "--report '%s' exists already; -f replaces it",
		                       o->report);
	return WH_OK;
}

/* Threads that the batch system or the user set for all programs; 0 when nothing is said. */
static int threads_of_environment(void)
{
	static const char *const names[] = {"SLURM_CPUS_PER_TASK", "OMP_NUM_THREADS"};
	for (size_t i = 0; i < sizeof names / sizeof *names; i++) {
		int64_t n;
		const char *text =
		    getenv(names[i]); /* NOLINT(concurrency-mt-unsafe): one thread yet */
		if (text && cmd_parse_count(text, false, &n) && n >= 1 && n <= 1024)
			return (int)n;
	}
	return 0;
}

/* ---- words -------------------------------------------------------------------------------- */

static const char *faces_word(uint64_t n)
{
	return n == 1 ? "face" : "faces";
}

static const char *vertices_word(uint64_t n)
{
	return n == 1 ? "vertex" : "vertices";
}

static void print_notes(FILE *f, const wh_reduce_report *r)
{
	if (r->unchanged)
		(void)fprintf(f, "the target is no smaller than the input: copied unchanged\n");
	if (r->one_less)
		(void)fprintf(
		    f, "%llu faces instead of %llu: a closed surface has an even number\n",
		    (unsigned long long)r->output_faces, (unsigned long long)r->target_faces);
	if (r->dropped[0])
		(void)fprintf(f, "not carried over (positions and faces only): %s\n", r->dropped);
	if (r->degenerate_faces)
		(void)fprintf(f, "dropped %llu degenerate %s\n",
		              (unsigned long long)r->degenerate_faces,
		              faces_word(r->degenerate_faces));
	if (r->unreferenced_vertices)
		(void)fprintf(f, "dropped %llu %s without faces\n",
		              (unsigned long long)r->unreferenced_vertices,
		              vertices_word(r->unreferenced_vertices));
	if (r->nonmanifold_kept)
		(void)fprintf(f, "kept %llu non-manifold %s in place\n",
		              (unsigned long long)r->nonmanifold_kept,
		              vertices_word(r->nonmanifold_kept));
}

static void print_summary(FILE *f, const options *o, const wh_reduce_report *r)
{
	(void)fprintf(f, "%s: %llu faces -> %s: %llu faces, %llu vertices\n", o->params.input,
	              (unsigned long long)r->input_faces, o->params.output,
	              (unsigned long long)r->output_faces, (unsigned long long)r->output_vertices);
	print_notes(f, r);
	(void)fprintf(f, "%.1f s, %.2f M faces/s, peak memory %.0f MiB, temporary disk %.0f MiB\n",
	              r->seconds_total, reduce_faces_per_second(r) / 1e6,
	              (double)cmd_peak_rss() / 1048576.0, (double)r->temp_bytes_peak / 1048576.0);
	if (!o->verbose)
		return;
	for (int i = 0; i < WH_PHASES; i++)
		(void)fprintf(f, "  %-9s %8.2f s\n", wh_phase_name((wh_phase)i), r->seconds[i]);
}

int cmd_reduce(int argc, char **argv)
{
	options o = {.params = wh_reduce_defaults()};
	const int status = parse(argc, argv, &o);
	if (status != WH_OK)
		return status;
	if (o.help) {
		(void)fputs(help, stdout);
		return WH_OK;
	}
	const int report_status = check_report_name(&o);
	if (report_status != WH_OK)
		return report_status;
	if (o.params.threads == 0)
		o.params.threads = threads_of_environment();
	cmd_env env;
	cmd_env_init(&env, "reduce");
	if (o.report && reduce_report_try(&env, o.report, o.params.force) != 0)
		return WH_E_RUN;
	progress_bar bar;
	progress_bar_init(&bar, !o.quiet && !o.no_progress);
	o.params.progress = progress_bar_tell;
	o.params.progress_user = &bar;
	wh_reduce_report report;
	const wh_code code = wh_reduce(&env.ctx, &o.params, &report);
	progress_bar_end(&bar);
	if (code != WH_OK && code != WH_E_TARGET)
		return cmd_report_failure(&env);
	if (!o.quiet)
		print_summary(is_dash(o.params.output) || is_dash(o.report) ? stderr : stdout, &o,
		              &report);
	if (o.report && reduce_report_write(&env, o.report, &o.params, &report) != 0)
		return WH_E_RUN;
	return code == WH_OK ? WH_OK : cmd_report_failure(&env);
}
