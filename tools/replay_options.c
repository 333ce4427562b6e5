#include "replay_options.h"

#include "cmd.h"
#include "reduce_options.h"

#include "io/outfile.h"

#include <getopt.h>

enum {
	OPT_VERTICES = 256,
	OPT_RATIO,
	OPT_ERROR,
	OPT_TEXT,
	OPT_TO,
	OPT_MEMORY,
	OPT_ASCII,
	OPT_QUANTIZE
};

static const struct option long_options[] = {
    {"output", required_argument, NULL, 'o'},
    {"faces", required_argument, NULL, 'n'},
    {"vertices", required_argument, NULL, OPT_VERTICES},
    {"ratio", required_argument, NULL, OPT_RATIO},
    {"error", required_argument, NULL, OPT_ERROR},
    {"text", required_argument, NULL, OPT_TEXT},
    {"to", required_argument, NULL, OPT_TO},
    {"memory", required_argument, NULL, OPT_MEMORY},
    {"ascii", no_argument, NULL, OPT_ASCII},
    {"quantize", no_argument, NULL, OPT_QUANTIZE},
    {"force", no_argument, NULL, 'f'},
    {"quiet", no_argument, NULL, 'q'},
    {"help", no_argument, NULL, 'h'},
    {NULL, 0, NULL, 0},
};

/* False when the argument makes no sense. */
static bool take_option(replay_options *o, int opt, const char *arg)
{
	wh_level *l = &o->limits;
	switch (opt) {
	case 'o':
		o->out.path = arg;
		return true;
	case 'n':
		return reduce_parse_target(arg, &l->faces, &l->face_ratio);
	case OPT_VERTICES:
		return reduce_parse_target(arg, &l->vertices, &l->vertex_ratio);
	case OPT_RATIO:
		return cmd_parse_share(arg, &l->face_ratio);
	case OPT_ERROR:
		return reduce_parse_error(arg, &l->error, &l->error_share);
	case OPT_TEXT:
		o->text = arg;
		return true;
	case OPT_TO:
		o->out.to = arg;
		return true;
	case OPT_MEMORY:
		return cmd_parse_memory(arg, &o->memory);
	case OPT_ASCII:
		return o->out.ascii = true;
	case OPT_QUANTIZE:
		return o->out.quantize = true;
	case 'f':
		return o->out.force = true;
	case 'q':
		return o->quiet = true;
	default:
		return o->help = true;
	}
}

/* What an option's value has to be, for messages. */
static const char *expected(int opt)
{
	switch (opt) {
	case OPT_RATIO:
		return "a share between 0 and 1, such as 0.1 or 10%";
	case OPT_ERROR:
		return "a distance above 0, in units of the file or such as 0.01%";
	case OPT_MEMORY:
		return "a size of 1M or more, such as 512M or 4G";
	default:
		return "a count such as 200K or a share such as 10%";
	}
}

int replay_options_parse(int argc, char **argv, replay_options *o)
{
	int opt;
	*o = (replay_options){0};
	opterr = 0;
	while ((opt = getopt_long(argc, argv, ":o:n:fqh", long_options, NULL)) != -1) {
		if (opt == ':')
			return cmd_usage_error(argv[0], "%s needs a value", argv[optind - 1]);
		if (opt == '?')
			return cmd_usage_error(argv[0], "%s: unknown or ambiguous option",
			                       argv[optind - 1]);
		if (!take_option(o, opt, optarg))
			return cmd_usage_error(argv[0], "'%s' is not %s", optarg, expected(opt));
	}
	if (o->help)
		return WH_OK;
	if (optind + 1 != argc)
		return cmd_usage_error(argv[0], optind == argc ? "no record given"
		                                               : "more than one record given");
	o->input = argv[optind];
	if (o->text && o->out.path && wh_outfile_same(o->text, o->out.path))
		return cmd_usage_error(argv[0], "--text and --output are one file");
	return WH_OK;
}
