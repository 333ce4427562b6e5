/* whittle stage: one stage of a run that whittle plan made a directory for. */
#define _GNU_SOURCE
#include "reduce_run.h"
#include "stage_file.h"

#include <getopt.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

static const char help[] =
    "usage: whittle stage ingest   --run-dir DIR --part I/N\n"
    "       whittle stage join     --run-dir DIR\n"
    "       whittle stage decimate --run-dir DIR --part I/N --round R\n"
    "       whittle stage finish   --run-dir DIR\n"
    "Does one stage of a run that several processes share, on any machines that see the\n"
    "run directory and the input. The sequence, as whittle plan IN -o OUT --faces N\n"
    "--run-dir DIR --parts N prints it:\n\n"
    "  plan -> N x ingest -> join -> N x decimate 1 -> join -> N x decimate 2 ... -> finish\n\n"
    "The parts of a stage, I from 1 to N, may run at the same time, in any order, again,\n"
    "and twice. join and finish tell which parts are missing, with status 1; rounds that\n"
    "the plan did not foresee are done by finish, and of those that it foresaw too many\n"
    "the stages have nothing to do. The result is that of whittle reduce, which with\n"
    "--run-dir and --resume can finish such a run, too, at any point. Options are those\n"
    "given to plan; these hold for the stage:\n\n"
    "      --memory SIZE, --threads N, --temp-dir DIR   as for reduce; DIR (default:\n"
    "                 $SLURM_TMPDIR, $TMPDIR, the run directory) is for what ingest has\n"
    "                 in hand and may be on the node\n"
    "  -f, --force    replace what has the name of FILE, or, in finish, of the result\n"
    "  -q, --quiet, --no-progress\n"
    "  -v, --verbose  seconds of each phase, to DIR/log-STAGE-part-I\n"
    "      --report FILE   what the stage took, as JSON; of finish: what the run did\n";

enum {
	OPT_RUN_DIR = 256,
	OPT_PART,
	OPT_ROUND,
	OPT_MEMORY,
	OPT_THREADS,
	OPT_TEMP,
	OPT_REPORT,
	OPT_NO_PROGRESS
};

static const struct option long_options[] = {
    {"run-dir", required_argument, NULL, OPT_RUN_DIR},
    {"part", required_argument, NULL, OPT_PART},
    {"round", required_argument, NULL, OPT_ROUND},
    {"memory", required_argument, NULL, OPT_MEMORY},
    {"threads", required_argument, NULL, OPT_THREADS},
    {"temp-dir", required_argument, NULL, OPT_TEMP},
    {"report", required_argument, NULL, OPT_REPORT},
    {"force", no_argument, NULL, 'f'},
    {"quiet", no_argument, NULL, 'q'},
    {"verbose", no_argument, NULL, 'v'},
    {"no-progress", no_argument, NULL, OPT_NO_PROGRESS},
    {"help", no_argument, NULL, 'h'},
    {NULL, 0, NULL, 0},
};

static const struct {
	const char *name;
	wh_stage stage;
	bool parts, rounds;
} stages[] = {
    {"ingest", WH_STAGE_INGEST, true, false},
    {"decimate", WH_STAGE_DECIMATE, true, true},
    {"join", WH_STAGE_JOIN, false, false},
    {"finish", WH_STAGE_FINISH, false, false},
};

typedef struct stage_options {
	size_t stage; /* its place among the stages */
	const char *run_dir, *temp_dir, *report;
	uint32_t part, parts, round; /* part from 1; 0: not given */
	size_t memory;
	int threads; /* -1: not given */
	bool force, quiet, verbose, no_progress, help;
} stage_options;

static bool parse_number(const char *text, int64_t least, int64_t most, uint32_t *out)
{
	int64_t n;
	if (!cmd_parse_count(text, false, &n) || n < least || n > most)
		return false;
	*out = (uint32_t)n;
	return true;
}

/* "3/16", or "3". */
static bool parse_part(const char *text, stage_options *o)
{
	char first[16];
	const size_t n = strcspn(text, "/");
	if (n >= sizeof first)
		return false;
	memcpy(first, text, n);
	first[n] = '\0';
	o->parts = 0;
	if (text[n] == '/' && !parse_number(text + n + 1, 1, 65536, &o->parts))
		return false;
	return parse_number(first, 1, o->parts ? o->parts : 65536, &o->part);
}

static bool take_option(stage_options *o, int opt, const char *arg)
{
	uint32_t n = 0;
	switch (opt) {
	case OPT_RUN_DIR:
		o->run_dir = arg;
		return *arg != '\0';
	case OPT_TEMP:
		o->temp_dir = arg;
		return *arg != '\0';
	case OPT_PART:
		return parse_part(arg, o);
	case OPT_REPORT:
		o->report = arg;
		return *arg != '\0';
	case OPT_ROUND:
		return parse_number(arg, 1, 1000, &o->round);
	case OPT_THREADS:
		o->threads = parse_number(arg, 0, 1024, &n) ? (int)n : -1;
		return o->threads >= 0;
	case OPT_MEMORY:
		return cmd_parse_memory(arg, &o->memory);
	case OPT_NO_PROGRESS:
		return o->no_progress = true;
	case 'f':
		return o->force = true;
	case 'q':
		return o->quiet = true;
	case 'v':
		return o->verbose = true;
	default:
		return o->help = true;
	}
}

/* What an option's value has to be, for messages. */
static const char *expected(int opt)
{
	switch (opt) {
	case OPT_PART:
		return "a part such as 3/16, from 1/16 to 16/16, of 65536 at most";
	case OPT_ROUND:
		return "a round from 1 to 1000";
	case OPT_THREADS:
		return "a number of threads from 0 to 1024";
	case OPT_MEMORY:
		return "a size of 1M or more, such as 512M or 4G";
	case OPT_REPORT:
		return "the name of a file";
	default:
		return "the name of a folder";
	}
}

static bool find_stage(const char *name, stage_options *o)
{
	for (o->stage = 0; o->stage < sizeof stages / sizeof *stages; o->stage++)
		if (strcmp(name, stages[o->stage].name) == 0)
			return true;
	return false;
}

/* WH_OK, or the status to leave with. */
static int parse(int argc, char **argv, stage_options *o)
{
	int opt;
	opterr = 0;
	while ((opt = getopt_long(argc, argv, ":fqvh", long_options, NULL)) != -1) {
		if (opt == ':')
			return cmd_usage_error("stage", "%s needs a value", argv[optind - 1]);
		if (opt == '?')
			return cmd_usage_error("stage", "%s: unknown or ambiguous option",
			                       argv[optind - 1]);
		if (!take_option(o, opt, optarg))
			return cmd_usage_error("stage", "'%s' is not %s", optarg, expected(opt));
	}
	if (o->help)
		return WH_OK;
	if (optind + 1 != argc || !find_stage(argv[optind], o))
		return cmd_usage_error("stage", "give one of ingest, decimate, join and finish");
	if (!o->run_dir)
		return cmd_usage_error("stage", "no run directory given: add --run-dir DIR");
	if (stages[o->stage].parts != (o->part > 0))
		return cmd_usage_error("stage", o->part ? "%s has no parts" : "%s needs --part I/N",
		                       stages[o->stage].name);
	if (stages[o->stage].rounds != (o->round > 0))
		return cmd_usage_error("stage",
		                       o->round ? "%s has no rounds" : "%s needs --round R",
		                       stages[o->stage].name);
	return WH_OK;
}

/* The name of a folder, which exists, from anywhere. */
static wh_code resolve(wh_ctx *c, const char *name, char path[PATH_MAX])
{
	if (!realpath(name, path))
		return wh_fail_errno(c, "cannot find the folder '%s'", name);
	return WH_OK;
}

/* The name of a file from anywhere: the stage enters the folder of the plan. */
static wh_code make_absolute(wh_ctx *c, const char *name, char path[PATH_MAX])
{
	char here[PATH_MAX] = "";
	const bool is_whole = *name == '/' || cmd_is_dash(name);
	if (!is_whole && !getcwd(here, sizeof here))
		return wh_fail_errno(c, "cannot name the working directory");
	if ((size_t)snprintf(path, PATH_MAX, "%s%s%s", here, is_whole ? "" : "/", name) >= PATH_MAX)
		return wh_fail(c, WH_E_USAGE, "the name of the report is too long");
	return WH_OK;
}

/* Where its folders and files are, from anywhere. */
typedef struct places {
	char run_dir[PATH_MAX], temp_dir[PATH_MAX], report[PATH_MAX];
} places;

static wh_code find_places(wh_ctx *c, const stage_options *o, places *at)
{
	if (resolve(c, o->run_dir, at->run_dir) != WH_OK ||
	    (o->temp_dir && resolve(c, o->temp_dir, at->temp_dir) != WH_OK) ||
	    (o->report && make_absolute(c, o->report, at->report) != WH_OK))
		return c->err.code;
	return WH_OK;
}

/* What the stage was given goes before what the plan was, whose report is that of the whole run. */
static void merge(const stage_options *o, const places *at, reduce_options *r)
{
	wh_reduce_params *p = &r->params;
	p->stage = stages[o->stage].stage;
	p->run_dir = at->run_dir;
	p->resume = true;
	p->part = o->part ? o->part - 1 : 0;
	p->parts = o->parts;
	p->round = o->round;
	if (o->temp_dir)
		p->temp_dir = at->temp_dir;
	if (o->memory)
		p->memory = o->memory;
	if (o->threads >= 0)
		p->threads = o->threads;
	if (o->report || p->stage != WH_STAGE_FINISH)
		r->report = o->report ? at->report : NULL;
	p->force = p->force || o->force;
	r->quiet = o->quiet;
	r->verbose = o->verbose;
	r->no_progress = o->no_progress;
}

static int run_stage(cmd_env *env, const stage_options *o, int argc, char **argv)
{
	places at;
	stage_file plan;
	reduce_options r = {.params = wh_reduce_defaults()};
	if (find_places(&env->ctx, o, &at) != WH_OK)
		return cmd_report_failure(env);
	if (stage_file_read(&env->ctx, at.run_dir, &plan) == WH_OK && chdir(plan.folder) != 0)
		(void)wh_fail_errno(&env->ctx, "cannot enter '%s', where the run was planned",
		                    plan.folder);
	int status = env->ctx.err.code == WH_OK ? WH_OK : cmd_report_failure(env);
	optind = 0; /* options are parsed a second time */
	if (status == WH_OK)
		status = reduce_options_parse(plan.argc, plan.argv, true, &r);
	if (status == WH_OK) {
		merge(o, &at, &r);
		status = reduce_run("stage", &r, argc, argv);
	}
	stage_file_free(&env->ctx, &plan);
	return status;
}

int cmd_stage(int argc, char **argv)
{
	stage_options o = {.threads = -1};
	const int status = parse(argc, argv, &o);
	if (status != WH_OK)
		return status;
	if (o.help) {
		(void)fputs(help, stdout);
		return WH_OK;
	}
	cmd_env env;
	cmd_env_init(&env, "stage");
	return run_stage(&env, &o, argc, argv);
}
