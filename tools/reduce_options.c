#include "reduce_options.h"

#include "cmd.h"

#include <getopt.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum {
	OPT_VERTICES = 256,
	OPT_RATIO,
	OPT_ERROR,
	OPT_FAST,
	OPT_LOCK,
	OPT_SMOOTH,
	OPT_NORMALS,
	OPT_TOPOLOGY,
	OPT_LEVELS,
	OPT_LEVELS_ERROR,
	OPT_COST,
	OPT_FACE_WEIGHT,
	OPT_PLACEMENT,
	OPT_DROP_INVALID,
	OPT_WELD,
	OPT_DROP_DUPLICATES,
	OPT_MIN_COMPONENT,
	OPT_ATTRIBUTES,
	OPT_WEIGHT,
	OPT_MEMORY,
	OPT_THREADS,
	OPT_TEMP,
	OPT_RUN_DIR,
	OPT_PARTS,
	OPT_RESUME,
	OPT_ASCII,
	OPT_QUANTIZE,
	OPT_FROM,
	OPT_READER,
	OPT_TO,
	OPT_REPORT,
	OPT_SEAMS,
	OPT_CLUSTER,
	OPT_MICRO,
	OPT_FINAL,
	OPT_ROUND_KEEP,
	OPT_NO_PROGRESS,
	OPT_MEASURE,
	OPT_SAMPLES,
	OPT_JSON
};

static const struct option long_options[] = {
    {"output", required_argument, NULL, 'o'},
    {"faces", required_argument, NULL, 'n'},
    {"vertices", required_argument, NULL, OPT_VERTICES},
    {"ratio", required_argument, NULL, OPT_RATIO},
    {"error", required_argument, NULL, OPT_ERROR},
    {"fast", no_argument, NULL, OPT_FAST},
    {"lock-boundary", no_argument, NULL, OPT_LOCK},
    {"smooth", required_argument, NULL, OPT_SMOOTH},
    {"normals", no_argument, NULL, OPT_NORMALS},
    {"levels", required_argument, NULL, OPT_LEVELS},
    {"levels-error", required_argument, NULL, OPT_LEVELS_ERROR},
    {"topology", required_argument, NULL, OPT_TOPOLOGY},
    {"cost", required_argument, NULL, OPT_COST},
    {"weight", required_argument, NULL, OPT_FACE_WEIGHT},
    {"placement", required_argument, NULL, OPT_PLACEMENT},
    {"drop-invalid", no_argument, NULL, OPT_DROP_INVALID},
    {"weld", required_argument, NULL, OPT_WELD},
    {"drop-duplicates", no_argument, NULL, OPT_DROP_DUPLICATES},
    {"min-component", required_argument, NULL, OPT_MIN_COMPONENT},
    {"attributes", required_argument, NULL, OPT_ATTRIBUTES},
    {"weight-of", required_argument, NULL, OPT_WEIGHT},
    {"memory", required_argument, NULL, OPT_MEMORY},
    {"threads", required_argument, NULL, OPT_THREADS},
    {"temp-dir", required_argument, NULL, OPT_TEMP},
    {"reader", required_argument, NULL, OPT_READER},
    {"from", required_argument, NULL, OPT_FROM},
    {"to", required_argument, NULL, OPT_TO},
    {"run-dir", required_argument, NULL, OPT_RUN_DIR},
    {"parts", required_argument, NULL, OPT_PARTS},
    {"resume", no_argument, NULL, OPT_RESUME},
    {"ascii", no_argument, NULL, OPT_ASCII},
    {"quantize", no_argument, NULL, OPT_QUANTIZE},
    {"report", required_argument, NULL, OPT_REPORT},
    {"seams", required_argument, NULL, OPT_SEAMS},
    {"cluster-faces", required_argument, NULL, OPT_CLUSTER},
    {"micro-faces", required_argument, NULL, OPT_MICRO},
    {"final-faces", required_argument, NULL, OPT_FINAL},
    {"round-keep", required_argument, NULL, OPT_ROUND_KEEP},
    {"force", no_argument, NULL, 'f'},
    {"quiet", no_argument, NULL, 'q'},
    {"verbose", no_argument, NULL, 'v'},
    {"no-progress", no_argument, NULL, OPT_NO_PROGRESS},
    {"measure", no_argument, NULL, OPT_MEASURE},
    {"samples", required_argument, NULL, OPT_SAMPLES},
    {"json", no_argument, NULL, OPT_JSON},
    {"help", no_argument, NULL, 'h'},
    {NULL, 0, NULL, 0},
};

/* ---- arguments ---------------------------------------------------------------------------- */

bool reduce_parse_target(const char *text, uint64_t *count, double *share)
{
	int64_t n;
	if (cmd_parse_percent(text, share))
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

bool reduce_parse_error(const char *text, double *error, double *share)
{
	if (cmd_parse_percent(text, share))
		return *share > 0;
	return cmd_parse_real(text, error) && *error > 0;
}

static bool parse_topology(const char *text, bool *simplify)
{
	*simplify = strcmp(text, "simplify") == 0;
	return *simplify || strcmp(text, "keep") == 0;
}

static bool parse_weld(const char *text, wh_reduce_params *p)
{
	p->weld = true;
	return cmd_parse_weld(text, &p->weld_distance, &p->weld_share);
}

/* Appends to the list of weights. */
static bool add_weight(reduce_options *o, const char *arg)
{
	const size_t used = strlen(o->weights), room = sizeof o->weights - used;
	const int n = snprintf(o->weights + used, room, "%s%s", used ? "," : "", arg);
	o->params.weights = o->weights;
	return strchr(arg, '=') && n > 0 && (size_t)n < room;
}

/* The switch that an option turns on; NULL: it is none. */
static bool *switch_of(reduce_options *o, int opt)
{
	wh_reduce_params *p = &o->params;
	switch (opt) {
	case OPT_FAST:
		return &p->fast;
	case OPT_LOCK:
		return &p->lock_boundary;
	case OPT_NORMALS:
		return &p->normals;
	case OPT_DROP_INVALID:
		return &p->drop_invalid;
	case OPT_DROP_DUPLICATES:
		return &p->drop_duplicates;
	case OPT_RESUME:
		return &p->resume;
	case OPT_ASCII:
		return &p->ascii;
	case OPT_QUANTIZE:
		return &p->quantize;
	case 'f':
		return &p->force;
	case 'q':
		return &o->quiet;
	case 'v':
		return &o->verbose;
	case OPT_NO_PROGRESS:
		return &o->no_progress;
	case OPT_MEASURE:
		return &o->measure;
	case OPT_JSON:
		return &o->json;
	case 'h':
		return &o->help;
	default:
		return NULL;
	}
}

/* Where the value of an option is kept as it is; NULL: it has to be understood. */
static const char **text_of(reduce_options *o, int opt)
{
	wh_reduce_params *p = &o->params;
	switch (opt) {
	case 'o':
		return &p->output;
	case OPT_ATTRIBUTES:
		return &p->attributes;
	case OPT_LEVELS:
		return &o->levels;
	case OPT_LEVELS_ERROR:
		return &o->levels_error;
	case OPT_COST:
		return &p->cost;
	case OPT_FACE_WEIGHT:
		return &p->face_weight;
	case OPT_PLACEMENT:
		return &p->placement;
	case OPT_TEMP:
		return &p->temp_dir;
	case OPT_READER:
		return &p->reader;
	case OPT_TO:
		return &p->to;
	case OPT_REPORT:
		return &o->report;
	case OPT_SEAMS:
		return &p->seams;
	default:
		return NULL;
	}
}

/* False when the argument makes no sense. */
static bool take_value(reduce_options *o, int opt, const char *arg)
{
	wh_reduce_params *p = &o->params;
	uint64_t n = 0;
	wh_format format;
	bool ok = true;
	switch (opt) {
	case 'n':
		ok = reduce_parse_target(arg, &p->faces, &p->face_ratio);
		break;
	case OPT_VERTICES:
		ok = reduce_parse_target(arg, &p->vertices, &p->vertex_ratio);
		break;
	case OPT_RATIO:
		ok = cmd_parse_share(arg, &p->face_ratio);
		break;
	case OPT_ERROR:
		ok = reduce_parse_error(arg, &p->error, &p->error_share);
		break;
	case OPT_TOPOLOGY:
		ok = parse_topology(arg, &p->simplify_topology);
		break;
	case OPT_WELD:
		ok = parse_weld(arg, p);
		break;
	case OPT_MIN_COMPONENT:
		ok = parse_size(arg, false, &p->min_component) && p->min_component > 0;
		break;
	case OPT_WEIGHT:
		ok = add_weight(o, arg);
		break;
	case OPT_MEMORY:
		ok = cmd_parse_memory(arg, &p->memory);
		break;
	case OPT_THREADS:
		ok = parse_size(arg, false, &n) && n <= 1024;
		p->threads = (int)n;
		break;
	case OPT_FROM:
		ok = cmd_parse_from(arg, &format);
		p->from = arg;
		break;
	case OPT_SAMPLES:
		ok = cmd_parse_samples(arg, &o->samples);
		break;
	case OPT_RUN_DIR:
		ok = *arg != '\0';
		p->run_dir = arg;
		break;
	case OPT_PARTS:
		ok = parse_size(arg, false, &n) && n >= 1 && n <= 65536;
		p->parts = (uint32_t)n;
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
	case OPT_SMOOTH:
		ok = parse_size(arg, false, &n) && n <= 1000;
		p->smooth = (uint32_t)n;
		break;
	case OPT_ROUND_KEEP:
		ok = cmd_parse_real(arg, &p->round_keep) && p->round_keep >= 0 &&
		     p->round_keep < 0.9;
		break;
	default:
		ok = false;
	}
	return ok;
}

/* False when the argument makes no sense. */
static bool take_option(reduce_options *o, int opt, const char *arg)
{
	bool *on = switch_of(o, opt);
	const char **text = text_of(o, opt);
	if (on)
		*on = true;
	else if (text)
		*text = arg;
	else
		return take_value(o, opt, arg);
	return true;
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
		return "a count above 0, such as 200K, or a share up to 100%, such as 10%";
	case OPT_RATIO:
		return "a share between 0 and 1, such as 0.1 or 10%";
	case OPT_ERROR:
		return "a distance above 0, in units of the file or such as 0.01%";
	case OPT_TOPOLOGY:
		return "keep or simplify";
	case OPT_WELD:
		return "a distance from 0 on, in units of the file or such as 0.001%";
	case OPT_MEMORY:
		return "a size of 1M or more, such as 512M or 4G";
	case OPT_THREADS:
		return "a number from 0 to 1024";
	case OPT_WEIGHT:
		return "a property and a weight, such as colour=0.5";
	case OPT_RUN_DIR:
		return "the name of a folder";
	case OPT_SAMPLES:
		return "a count from 1 to 1000G";
	case OPT_PARTS:
		return "a number from 1 to 65536";
	case OPT_CLUSTER:
		return "0 or a count from 1000 to 100M";
	case OPT_FROM:
		return "ply, obj, off or stl";
	case OPT_MICRO:
		return "0 or a count from 100 to 100M";
	case OPT_SMOOTH:
		return "a count from 1 to 1000";
	case OPT_ROUND_KEEP:
		return "a share from 0 to below 0.9";
	default:
		return "a count above 0";
	}
}

static bool has_limit(const wh_reduce_params *p)
{
	return p->faces || p->face_ratio > 0 || p->vertices || p->vertex_ratio > 0 ||
	       p->error > 0 || p->error_share > 0;
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

int reduce_options_parse(int argc, char **argv, bool plan, reduce_options *o)
{
	int opt;
	opterr = 0;
	while ((opt = getopt_long(argc, argv, ":o:n:fqvh", long_options, NULL)) != -1) {
		if (opt == ':')
			return cmd_usage_error(argv[0], "%s needs a value", argv[optind - 1]);
		if (opt == '?')
			return cmd_usage_error(argv[0], "%s: unknown or ambiguous option",
			                       argv[optind - 1]);
		if (!take_option(o, opt, optarg))
			return cmd_usage_error(argv[0], "--%s: '%s' is not %s", option_name(opt),
			                       optarg, expected(opt));
	}
	if (o->help)
		return WH_OK;
	if (o->params.threads == 0)
		o->params.threads = threads_of_environment();
	else if (!plan && wh_mpi_processes() == 1) /* launchers bind processes to processors */
		(void)cmd_threads(argv[0], o->params.threads);
	if (optind + 1 != argc)
		return cmd_usage_error(argv[0], optind == argc ? "no input file given"
		                                               : "more than one input file given");
	o->params.input = argv[optind];
	if (o->json && !plan)
		return cmd_usage_error(argv[0], "--json is an option of plan; use --report FILE");
	if (o->params.parts && !plan)
		return cmd_usage_error(argv[0], "--parts is an option of plan");
	if (plan && !o->params.parts != !o->params.run_dir)
		return cmd_usage_error(argv[0],
		                       "--run-dir and --parts go together: DIR is made for "
		                       "so many parts; see whittle stage --help");
	if (o->samples && !o->measure && !plan)
		return cmd_usage_error(argv[0], "--samples needs --measure");
	if (!o->params.output && (!plan || o->params.run_dir))
		return cmd_usage_error(argv[0], "no output given: add -o FILE");
	if (o->params.resume && !o->params.run_dir)
		return cmd_usage_error(argv[0], "--resume needs the --run-dir to go on with");
	if (o->levels || o->levels_error) {
		if (has_limit(&o->params) || (o->levels && o->levels_error))
			return cmd_usage_error(argv[0],
			                       "--levels is instead of --faces, --vertices, "
			                       "--ratio, --error and --levels-error");
		return levels_options_take(argv[0], o);
	}
	if (!has_limit(&o->params))
		o->params.face_ratio = o->share;
	if (!has_limit(&o->params))
		return cmd_usage_error(
		    argv[0], "no target given: add --faces, --vertices, --ratio or --error");
	return WH_OK;
}
