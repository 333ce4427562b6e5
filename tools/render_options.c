#include "render_options.h"

#include "cmd.h"

#include <getopt.h>
#include <stdlib.h>
#include <string.h>

enum {
	OPT_SIZE = 256,
	OPT_VIEW,
	OPT_AZIMUTH,
	OPT_ELEVATION,
	OPT_UP,
	OPT_ZOOM,
	OPT_PERSPECTIVE,
	OPT_BACKGROUND,
	OPT_SAMPLES,
	OPT_FLAT,
	OPT_WIREFRAME,
	OPT_COLOURS,
	OPT_TEXTURE,
	OPT_DISTANCE,
	OPT_RANGE,
	OPT_SHEET,
	OPT_MEMORY,
	OPT_THREADS,
	OPT_TEMP,
	OPT_NO_PROGRESS
};

static const struct option long_options[] = {
    {"output", required_argument, NULL, 'o'},
    {"size", required_argument, NULL, OPT_SIZE},
    {"view", required_argument, NULL, OPT_VIEW},
    {"azimuth", required_argument, NULL, OPT_AZIMUTH},
    {"elevation", required_argument, NULL, OPT_ELEVATION},
    {"up", required_argument, NULL, OPT_UP},
    {"zoom", required_argument, NULL, OPT_ZOOM},
    {"perspective", no_argument, NULL, OPT_PERSPECTIVE},
    {"background", required_argument, NULL, OPT_BACKGROUND},
    {"samples", required_argument, NULL, OPT_SAMPLES},
    {"flat", no_argument, NULL, OPT_FLAT},
    {"wireframe", no_argument, NULL, OPT_WIREFRAME},
    {"colours", no_argument, NULL, OPT_COLOURS},
    {"colors", no_argument, NULL, OPT_COLOURS},
    {"texture", optional_argument, NULL, OPT_TEXTURE},
    {"distance-to", required_argument, NULL, OPT_DISTANCE},
    {"range", required_argument, NULL, OPT_RANGE},
    {"contact-sheet", no_argument, NULL, OPT_SHEET},
    {"memory", required_argument, NULL, OPT_MEMORY},
    {"threads", required_argument, NULL, OPT_THREADS},
    {"temp-dir", required_argument, NULL, OPT_TEMP},
    {"force", no_argument, NULL, 'f'},
    {"quiet", no_argument, NULL, 'q'},
    {"no-progress", no_argument, NULL, OPT_NO_PROGRESS},
    {"help", no_argument, NULL, 'h'},
    {NULL, 0, NULL, 0},
};

/* ---- values --------------------------------------------------------------------------------- */

typedef struct named_view {
	const char *name;
	wh_view view;
} named_view;

static const named_view views[] = {
    {"front", {0, 0}}, {"right", {90, 0}},   {"back", {180, 0}},      {"left", {270, 0}},
    {"top", {0, 90}},  {"bottom", {0, -90}}, {"iso", {45, 35.26439}},
};

enum { NVIEWS = sizeof views / sizeof *views };

/* The view that a list of names begins with; *list goes on behind it. NULL: none of that name. */
static const named_view *take_view(const char **list)
{
	const size_t n = strcspn(*list, ",");
	for (int i = 0; i < NVIEWS; i++)
		if (strlen(views[i].name) == n && strncmp(views[i].name, *list, n) == 0) {
			*list += n + ((*list)[n] == ',');
			return &views[i];
		}
	return NULL;
}

static bool are_views(const char *list)
{
	int n = 0;
	while (*list && n++ < RENDER_VIEWS_MOST)
		if (!take_view(&list))
			return false;
	return n > 0 && *list == '\0';
}

bool render_parse_size(const char *text, uint32_t *w, uint32_t *h)
{
	char copy[32];
	int64_t a, b;
	if (strlen(text) >= sizeof copy)
		return false;
	memcpy(copy, text, strlen(text) + 1);
	char *x = strchr(copy, 'x');
	if (x)
		*x = '\0';
	if (!cmd_parse_count(copy, false, &a) || !cmd_parse_count(x ? x + 1 : copy, false, &b))
		return false;
	if (a < 1 || b < 1 || a > WH_PICTURE_SIDE_MOST || b > WH_PICTURE_SIDE_MOST)
		return false;
	*w = (uint32_t)a;
	*h = (uint32_t)b;
	return true;
}

/* A name, or six hexadecimal digits, perhaps behind a #. */
static bool parse_colour(const char *text, wh_rgba *c)
{
	static const struct {
		const char *name;
		wh_rgba c;
	} names[] = {{"white", {255, 255, 255, 255}},
	             {"black", {0, 0, 0, 255}},
	             {"grey", {128, 128, 128, 255}},
	             {"gray", {128, 128, 128, 255}},
	             {"transparent", {0, 0, 0, 0}}};
	for (size_t i = 0; i < sizeof names / sizeof *names; i++)
		if (strcmp(text, names[i].name) == 0) {
			*c = names[i].c;
			return true;
		}
	text += *text == '#';
	if (strlen(text) != 6 || strspn(text, "0123456789abcdefABCDEF") != 6)
		return false;
	const unsigned long v = strtoul(text, NULL, 16);
	*c = (wh_rgba){(uint8_t)(v >> 16), (uint8_t)(v >> 8 & 0xff), (uint8_t)(v & 0xff), 255};
	return true;
}

bool render_parse_up(const char *text, int *up)
{
	if (strcmp(text, "auto") == 0)
		*up = WH_UP_GUESS;
	else if (strlen(text) == 1 && *text >= 'x' && *text <= 'z')
		*up = *text - 'x';
	else
		return false;
	return true;
}

static bool parse_memory(const char *text, size_t *memory)
{
	int64_t n;
	if (!cmd_parse_count(text, true, &n) || n == 0)
		return false;
	*memory = (size_t)n;
	return true;
}

static bool parse_samples(const char *text, int *samples)
{
	int64_t n;
	if (!cmd_parse_count(text, false, &n) || n < 1 || n > WH_RENDER_SAMPLES_MOST)
		return false;
	*samples = (int)n;
	return true;
}

bool render_parse_angle(const char *text, double *degrees)
{
	return cmd_parse_real(text, degrees) && *degrees >= -360 && *degrees <= 360;
}

static bool parse_turn(const char *text, int which, render_options *o)
{
	o->turned[which] = true;
	return render_parse_angle(text, &o->turn[which]);
}

static bool parse_positive(const char *text, double least, double most, double *x)
{
	return cmd_parse_real(text, x) && *x >= least && *x <= most && *x > 0;
}

/* ---- options -------------------------------------------------------------------------------- */

static bool take_value(render_options *o, int opt, const char *arg)
{
	wh_picture_params *p = &o->p;
	switch (opt) {
	case OPT_SIZE:
		o->sized = true;
		return render_parse_size(arg, &p->width, &p->height);
	case OPT_VIEW:
		o->views = arg;
		return are_views(arg);
	case OPT_AZIMUTH:
		return parse_turn(arg, 0, o);
	case OPT_ELEVATION:
		return parse_turn(arg, 1, o);
	case OPT_UP:
		return render_parse_up(arg, &p->up);
	case OPT_ZOOM:
		return parse_positive(arg, 0.01, 100, &p->zoom);
	case OPT_BACKGROUND:
		return parse_colour(arg, &p->background);
	case OPT_SAMPLES:
		return parse_samples(arg, &p->samples);
	case OPT_RANGE:
		return parse_positive(arg, 0, 1e300, &p->range);
	case OPT_MEMORY:
		return parse_memory(arg, &p->memory);
	case OPT_THREADS:
		return cmd_parse_count(arg, false, &o->threads) && o->threads <= 4096;
	default:
		return true;
	}
}

static bool take_option(render_options *o, int opt, const char *arg)
{
	wh_picture_params *p = &o->p;
	if (opt == 'o')
		p->output = arg;
	if (opt == OPT_DISTANCE)
		p->distance_to = arg;
	if (opt == OPT_TEMP)
		p->temp_dir = arg;
	p->perspective |= opt == OPT_PERSPECTIVE;
	p->flat |= opt == OPT_FLAT;
	p->wireframe |= opt == OPT_WIREFRAME;
	p->colours |= opt == OPT_COLOURS;
	p->texture |= opt == OPT_TEXTURE;
	if (opt == OPT_TEXTURE)
		p->texture_file = arg;
	p->force |= opt == 'f';
	o->sheet |= opt == OPT_SHEET;
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

/* ---- cells ---------------------------------------------------------------------------------- */

/* False when there are too many. */
static bool add_cell(render_options *o, int file, const named_view *v)
{
	if (o->p.ncells == WH_PICTURE_CELLS)
		return false;
	wh_picture_cell *cell = &o->cells[o->p.ncells++];
	*cell = (wh_picture_cell){.file = file, .own_view = v || o->turned[0] || o->turned[1]};
	if (v) {
		cell->view = v->view;
		cell->view_name = o->sheet && strchr(o->views, ',') ? v->name : NULL;
	} else if (cell->own_view) {
		cell->view = (wh_view){30, 16};
	}
	if (o->turned[0])
		cell->view.azimuth = o->turn[0];
	if (o->turned[1])
		cell->view.elevation = o->turn[1];
	return true;
}

/* Every file in every view. */
static bool make_cells(render_options *o)
{
	for (int file = 0; file < o->p.npaths; file++) {
		const char *list = o->views;
		if (!list && !add_cell(o, file, NULL))
			return false;
		while (list && *list)
			if (!add_cell(o, file, take_view(&list)))
				return false;
	}
	return true;
}

static int put_together(render_options *o, const char *name)
{
	wh_picture_params *p = &o->p;
	const bool turned = o->turned[0] || o->turned[1];
	if (o->sheet && p->npaths == 1 && !o->views && !turned)
		o->views = "front,right,top,back,left,iso";
	if (turned && o->views && strchr(o->views, ','))
		return cmd_usage_error(name, "several views with --azimuth or --elevation would "
		                             "all be the same");
	if (!make_cells(o))
		return cmd_usage_error(name, "a picture holds no more than %d meshes and views",
		                       WH_PICTURE_CELLS);
	if (p->ncells > 1 && !o->sheet)
		return cmd_usage_error(name, "several files or views go side by side with "
		                             "--contact-sheet");
	if (p->range > 0 && !p->distance_to)
		return cmd_usage_error(name, "--range needs --distance-to");
	if (p->colours && p->distance_to)
		return cmd_usage_error(name, "--colours and --distance-to are two colours for "
		                             "one surface");
	p->labels = o->sheet;
	if (o->sheet && !o->sized) {
		p->width = 640;
		p->height = 480;
	}
	return WH_OK;
}

int render_options_parse(int argc, char **argv, render_options *o)
{
	const char *name = argv[0];
	int opt;
	*o = (render_options){.p = {.width = 1200,
	                            .height = 900,
	                            .samples = 4,
	                            .up = WH_UP_GUESS,
	                            .zoom = 1,
	                            .background = {255, 255, 255, 255}}};
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
	if (o->help)
		return WH_OK;
	o->p.paths = (const char *const *)argv + optind;
	o->p.npaths = argc - optind;
	o->p.cells = o->cells;
	if (o->p.npaths == 0)
		return cmd_usage_error(name, "FILE is missing");
	if (!o->p.output)
		return cmd_usage_error(name, "-o PICTURE.png is missing");
	if (o->p.npaths > WH_PICTURE_CELLS)
		return cmd_usage_error(name, "a picture holds no more than %d meshes",
		                       WH_PICTURE_CELLS);
	return put_together(o, name);
}
