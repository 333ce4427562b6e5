#include "replay_options.h"

#include "cmd.h"
#include "reduce_options.h"

#include "io/outfile.h"
#include "render_options.h"

#include <getopt.h>
#include <string.h>

enum {
	OPT_VERTICES = 256,
	OPT_RATIO,
	OPT_ERROR,
	OPT_TEXT,
	OPT_PAGE,
	OPT_TO,
	OPT_MEMORY,
	OPT_ASCII,
	OPT_QUANTIZE,
	OPT_GEOMORPH,
	OPT_TOWARDS,
	OPT_FRAMES,
	OPT_SIZE,
	OPT_AZIMUTH,
	OPT_ELEVATION,
	OPT_UP,
	OPT_WIREFRAME,
	OPT_FLAT,
	OPT_COLOURS,
	OPT_TEMP
};

enum { WIDTH = 1200, HEIGHT = 900 };
static const wh_view USUAL = {30, 16};

static const struct option long_options[] = {
    {"output", required_argument, NULL, 'o'},
    {"faces", required_argument, NULL, 'n'},
    {"vertices", required_argument, NULL, OPT_VERTICES},
    {"ratio", required_argument, NULL, OPT_RATIO},
    {"error", required_argument, NULL, OPT_ERROR},
    {"text", required_argument, NULL, OPT_TEXT},
    {"page", required_argument, NULL, OPT_PAGE},
    {"to", required_argument, NULL, OPT_TO},
    {"memory", required_argument, NULL, OPT_MEMORY},
    {"ascii", no_argument, NULL, OPT_ASCII},
    {"quantize", no_argument, NULL, OPT_QUANTIZE},
    {"geomorph", required_argument, NULL, OPT_GEOMORPH},
    {"towards", required_argument, NULL, OPT_TOWARDS},
    {"frames", required_argument, NULL, OPT_FRAMES},
    {"size", required_argument, NULL, OPT_SIZE},
    {"azimuth", required_argument, NULL, OPT_AZIMUTH},
    {"elevation", required_argument, NULL, OPT_ELEVATION},
    {"up", required_argument, NULL, OPT_UP},
    {"wireframe", no_argument, NULL, OPT_WIREFRAME},
    {"flat", no_argument, NULL, OPT_FLAT},
    {"colours", no_argument, NULL, OPT_COLOURS},
    {"colors", no_argument, NULL, OPT_COLOURS},
    {"temp-dir", required_argument, NULL, OPT_TEMP},
    {"force", no_argument, NULL, 'f'},
    {"quiet", no_argument, NULL, 'q'},
    {"help", no_argument, NULL, 'h'},
    {NULL, 0, NULL, 0},
};

static bool take_turn(replay_look *l, int which, const char *arg)
{
	l->turned[which] = true;
	return render_parse_angle(arg, &l->turn[which]);
}

static bool take_frames(replay_options *o, const char *arg)
{
	int64_t n;
	if (!cmd_parse_count(arg, false, &n) || n < REPLAY_FRAMES_LEAST || n > REPLAY_FRAMES_MOST)
		return false;
	o->frames = (uint32_t)n;
	return true;
}

/* Those of a morph and its pictures. */
static bool take_morph(replay_options *o, int opt, const char *arg)
{
	replay_look *l = &o->look;
	switch (opt) {
	case OPT_GEOMORPH:
		o->geomorph = true;
		return cmd_parse_real(arg, &o->t) && o->t >= 0 && o->t <= 1;
	case OPT_TOWARDS:
		return reduce_parse_target(arg, &o->towards.faces, &o->towards.face_ratio);
	case OPT_FRAMES:
		return take_frames(o, arg);
	case OPT_SIZE:
		return render_parse_size(arg, &l->width, &l->height);
	case OPT_AZIMUTH:
		return take_turn(l, 0, arg);
	case OPT_ELEVATION:
		return take_turn(l, 1, arg);
	case OPT_UP:
		return render_parse_up(arg, &l->up);
	case OPT_TEMP:
		l->temp_dir = arg;
		return true;
	case OPT_WIREFRAME:
		return l->wireframe = true;
	case OPT_FLAT:
		return l->flat = true;
	default:
		return l->colours = true;
	}
}

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
	case OPT_PAGE:
		o->page = arg;
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
	case 'h':
		return o->help = true;
	default:
		return take_morph(o, opt, arg);
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
	case OPT_GEOMORPH:
		return "a number from 0 to 1";
	case OPT_FRAMES:
		return "a number of frames from 2 to 1M";
	case OPT_SIZE:
		return "a size in pixels, such as 1200x900";
	case OPT_AZIMUTH:
	case OPT_ELEVATION:
		return "an angle in degrees, from -360 to 360";
	case OPT_UP:
		return "an axis: x, y, z, or auto";
	default:
		return "a count above 0, such as 200K, or a share up to 100%, such as 10%";
	}
}

static int check_morph(const char *name, const replay_options *o)
{
	const bool towards = o->towards.faces || o->towards.face_ratio > 0;
	if (o->geomorph && o->frames)
		return cmd_usage_error(name, "--geomorph is one mesh, --frames are many: give one "
		                             "of the two");
	if (towards && !o->geomorph && !o->frames)
		return cmd_usage_error(name, "--towards needs --geomorph T or --frames N");
	if (o->page && wh_outfile_same(o->page, o->input))
		return cmd_usage_error(name, "--page '%s' is the record itself", o->page);
	if (o->page && (o->out.path || o->text || o->geomorph || o->frames))
		return cmd_usage_error(name, "--page has all levels and morphs on it: leave out "
		                             "-o, --text, --geomorph and --frames");
	if (!o->geomorph && !o->frames)
		return WH_OK;
	if (!o->out.path)
		return cmd_usage_error(name, "a morph needs -o FILE");
	if (o->text)
		return cmd_usage_error(name, "--text tells the collapses of a level, not of a "
		                             "morph: leave one of the two out");
	if (o->frames && strcmp(o->out.path, "-") == 0)
		return cmd_usage_error(name, "several frames do not go to standard output");
	return WH_OK;
}

int replay_options_parse(int argc, char **argv, replay_options *o)
{
	int opt;
	*o = (replay_options){.look = {.width = WIDTH,
	                               .height = HEIGHT,
	                               .up = WH_UP_GUESS,
	                               .turn = {USUAL.azimuth, USUAL.elevation}}};
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
	return check_morph(argv[0], o);
}
