#include "report_options.h"

#include "cmd.h"
#include "io/ply.h"
#include "render_options.h"

#include <getopt.h>
#include <string.h>

enum {
	OPT_JSON = 256,
	OPT_SEAMS,
	OPT_TITLE,
	OPT_SHOWN,
	OPT_SAMPLES,
	OPT_SIZE,
	OPT_UP,
	OPT_AZIMUTH,
	OPT_ELEVATION,
	OPT_MEMORY,
	OPT_THREADS,
	OPT_TEMP,
	OPT_NO_PROGRESS
};

static const struct option long_options[] = {
    {"output", required_argument, NULL, 'o'},
    {"json", required_argument, NULL, OPT_JSON},
    {"seams", required_argument, NULL, OPT_SEAMS},
    {"title", required_argument, NULL, OPT_TITLE},
    {"shown", required_argument, NULL, OPT_SHOWN},
    {"samples", required_argument, NULL, OPT_SAMPLES},
    {"size", required_argument, NULL, OPT_SIZE},
    {"up", required_argument, NULL, OPT_UP},
    {"azimuth", required_argument, NULL, OPT_AZIMUTH},
    {"elevation", required_argument, NULL, OPT_ELEVATION},
    {"memory", required_argument, NULL, OPT_MEMORY},
    {"threads", required_argument, NULL, OPT_THREADS},
    {"temp-dir", required_argument, NULL, OPT_TEMP},
    {"force", no_argument, NULL, 'f'},
    {"quiet", no_argument, NULL, 'q'},
    {"no-progress", no_argument, NULL, OPT_NO_PROGRESS},
    {"help", no_argument, NULL, 'h'},
    {NULL, 0, NULL, 0},
};

enum { WIDTH = 1000, HEIGHT = 750, SHOWN = 400000, SHOWN_LEAST = 100, SHOWN_MOST = 5000000 };

static bool parse_count(const char *text, bool binary, int64_t least, int64_t most, int64_t *n)
{
	return cmd_parse_count(text, binary, n) && *n >= least && *n <= most;
}

static bool parse_turn(report_options *o, int which, const char *text)
{
	o->turned[which] = true;
	return render_parse_angle(text, &o->turn[which]);
}

static bool take_value(report_options *o, int opt, const char *arg)
{
	switch (opt) {
	case OPT_JSON:
		if (o->nruns == REPORT_FILES)
			return false;
		o->runs[o->nruns++] = arg;
		return true;
	case OPT_SHOWN:
		return parse_count(arg, false, SHOWN_LEAST, SHOWN_MOST, &o->shown);
	case OPT_SAMPLES:
		return parse_count(arg, false, 1, INT64_MAX, &o->samples);
	case OPT_SIZE:
		return render_parse_size(arg, &o->width, &o->height);
	case OPT_UP:
		return render_parse_up(arg, &o->up);
	case OPT_AZIMUTH:
		return parse_turn(o, 0, arg);
	case OPT_ELEVATION:
		return parse_turn(o, 1, arg);
	case OPT_MEMORY:
		return parse_count(arg, true, 1, INT64_MAX, &o->memory);
	case OPT_THREADS:
		return parse_count(arg, false, 0, 4096, &o->threads);
	default:
		return true;
	}
}

static bool take_option(report_options *o, int opt, const char *arg)
{
	if (opt == 'o')
		o->output = arg;
	if (opt == OPT_SEAMS)
		o->seams = arg;
	if (opt == OPT_TITLE)
		o->title = arg;
	if (opt == OPT_TEMP)
		o->temp_dir = arg;
	o->force |= opt == 'f';
	o->quiet |= opt == 'q';
	o->no_progress |= opt == OPT_NO_PROGRESS;
	o->help |= opt == 'h';
	return take_value(o, opt, arg);
}

static const char *option_name(int opt)
{
	for (const struct option *l = long_options; l->name; l++)
		if (l->val == opt)
			return l->name;
	return "";
}

static int complete(const report_options *o, const char *name)
{
	if (o->npaths < 2)
		return cmd_usage_error(name, "INPUT and RESULT are needed: the mesh as it was, and "
		                             "what became of it");
	if (!o->output)
		return cmd_usage_error(name, "-o PAGE.html is missing");
	for (int i = 0; i < o->npaths; i++)
		if (wh_ply_is_read_once(o->paths[i]))
			return cmd_usage_error(name,
			                       "'%s' can be read only once, and a page takes more: "
			                       "save it to a file first",
			                       o->paths[i]);
	if (o->npaths > REPORT_FILES)
		return cmd_usage_error(name, "a page holds no more than %d levels",
		                       REPORT_FILES - 1);
	return WH_OK;
}

int report_options_parse(int argc, char **argv, report_options *o)
{
	const char *name = argv[0];
	int opt;
	*o = (report_options){.up = WH_UP_GUESS, .shown = SHOWN, .width = WIDTH, .height = HEIGHT};
	opterr = 0;
	optind = 1;
	while ((opt = getopt_long(argc, argv, ":o:fqh", long_options, NULL)) != -1) {
		if (opt == '?')
			return cmd_usage_error(name, "%s is no option", argv[optind - 1]);
		if (opt == ':')
			return cmd_usage_error(name, "%s needs a value", argv[optind - 1]);
		if (!take_option(o, opt, optarg))
			return cmd_usage_error(name, "--%s does not take \"%s\"", option_name(opt),
			                       optarg);
	}
	o->paths = (const char *const *)argv + optind;
	o->npaths = argc - optind;
	return o->help ? WH_OK : complete(o, name);
}
