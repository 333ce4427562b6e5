/* whittle generate: seeded scan-like surfaces of any size, streamed. */
#define _POSIX_C_SOURCE 200809L
#include "cmd.h"
#include "algo/synth.h"
#include "base/timer.h"
#include "io/outfile.h"

#include <getopt.h>
#include <stdio.h>
#include <string.h>

static const char help[] =
    "usage: whittle generate -o OUT --faces N [option ...]\n"
    "Writes a surface that looks like a scan, as PLY. Same options, same bytes.\n\n"
    "  -o, --output FILE     where to; - is standard output\n"
    "  -n, --faces N         about how many: the grid has the last word; K, M, G\n"
    "      --shape NAME      sphere (default), torus or terrain\n"
    "      --order NAME      scan: row by row (default); shuffled: vertices,\n"
    "                        faces and corners in random order\n"
    "      --seed N          another surface of the same kind (default 0)\n"
    "      --relief S        height of hills / radius or half side (default 0.05)\n"
    "      --noise S         measurement noise / sample spacing (default 0.1)\n"
    "      --flat SHARE      share of samples in planes, noise apart: caps of the\n"
    "                        sphere, top and bottom of the torus, a plateau (0)\n"
    "      --holes N         in a terrain (default: up to 5)\n"
    "      --double          positions as double\n"
    "      --offset X,Y,Z    added to all positions, as double; rounded to 1/1024\n"
    "      --colours         red, green, blue at the vertices (also --colors)\n"
    "      --normals         nx, ny, nz at the vertices\n"
    "      --ascii           text instead of binary\n"
    "      --threads N       0 (default): all this process may use\n"
    "  -f, --force           write over an existing file\n"
    "  -q, --quiet           do not print what was made\n";

typedef struct options {
	wh_synth_params synth;
	const char *output;
	int64_t faces, seed, threads;
	bool force, quiet, help;
} options;

enum {
	OPT_SHAPE = 256,
	OPT_ORDER,
	OPT_SEED,
	OPT_RELIEF,
	OPT_NOISE,
	OPT_FLAT,
	OPT_HOLES,
	OPT_DOUBLE,
	OPT_OFFSET,
	OPT_COLORS,
	OPT_NORMALS,
	OPT_ASCII,
	OPT_THREADS
};

static const struct option long_options[] = {
    {"output", required_argument, NULL, 'o'},
    {"faces", required_argument, NULL, 'n'},
    {"shape", required_argument, NULL, OPT_SHAPE},
    {"order", required_argument, NULL, OPT_ORDER},
    {"seed", required_argument, NULL, OPT_SEED},
    {"relief", required_argument, NULL, OPT_RELIEF},
    {"noise", required_argument, NULL, OPT_NOISE},
    {"flat", required_argument, NULL, OPT_FLAT},
    {"holes", required_argument, NULL, OPT_HOLES},
    {"double", no_argument, NULL, OPT_DOUBLE},
    {"offset", required_argument, NULL, OPT_OFFSET},
    {"colours", no_argument, NULL, OPT_COLORS},
    {"colors", no_argument, NULL, OPT_COLORS},
    {"normals", no_argument, NULL, OPT_NORMALS},
    {"ascii", no_argument, NULL, OPT_ASCII},
    {"threads", required_argument, NULL, OPT_THREADS},
    {"force", no_argument, NULL, 'f'},
    {"quiet", no_argument, NULL, 'q'},
    {"help", no_argument, NULL, 'h'},
    {NULL, 0, NULL, 0},
};

/* Index of a name in a list that ends with NULL, or -1. */
static int find_name(const char *name, const char *const *names)
{
	for (int i = 0; names[i]; i++)
		if (strcmp(names[i], name) == 0)
			return i;
	return -1;
}

static bool parse_shape(const char *text, wh_synth_kind *out)
{
	static const char *const names[] = {
	    [WH_SYNTH_SPHERE] = "sphere",
	    [WH_SYNTH_TORUS] = "torus",
	    [WH_SYNTH_TERRAIN] = "terrain",
	    NULL,
	};
	const int i = find_name(text, names);
	if (i >= 0)
		*out = (wh_synth_kind)i;
	return i >= 0;
}

static bool parse_order(const char *text, bool *shuffled)
{
	static const char *const names[] = {"scan", "shuffled", NULL};
	const int i = find_name(text, names);
	*shuffled = i == 1;
	return i >= 0;
}

/* Three numbers with commas between them. */
static bool parse_triple(const char *text, double out[3])
{
	char copy[256];
	const size_t n = strlen(text);
	if (n >= sizeof copy)
		return false;
	memcpy(copy, text, n + 1);
	char *rest = copy;
	for (int i = 0; i < 3; i++) {
		char *comma = strchr(rest, ',');
		if ((comma != NULL) != (i < 2))
			return false;
		if (comma)
			*comma = '\0';
		if (!cmd_parse_real(rest, &out[i]))
			return false;
		if (comma)
			rest = comma + 1;
	}
	return true;
}

/* False when the argument makes no sense; the option's name is then in long_options. */
static bool take_option(options *o, int opt, const char *arg)
{
	wh_synth_params *p = &o->synth;
	switch (opt) {
	case 'o':
		o->output = arg;
		return true;
	case 'n':
		return cmd_parse_count(arg, false, &o->faces);
	case OPT_SHAPE:
		return parse_shape(arg, &p->kind);
	case OPT_ORDER:
		return parse_order(arg, &p->shuffled);
	case OPT_SEED:
		return cmd_parse_count(arg, false, &o->seed);
	case OPT_RELIEF:
		return cmd_parse_real(arg, &p->relief);
	case OPT_NOISE:
		return cmd_parse_real(arg, &p->noise);
	case OPT_FLAT:
		return cmd_parse_real(arg, &p->flat);
	case OPT_HOLES:
		return cmd_parse_count(arg, false, &p->holes);
	case OPT_OFFSET:
		p->is_double = true;
		return parse_triple(arg, p->offset);
	case OPT_THREADS:
		return cmd_parse_count(arg, false, &o->threads) && o->threads <= 4096;
	default:
		break;
	}
	p->is_double |= opt == OPT_DOUBLE;
	p->colors |= opt == OPT_COLORS;
	p->normals |= opt == OPT_NORMALS;
	p->ascii |= opt == OPT_ASCII;
	o->force |= opt == 'f';
	o->quiet |= opt == 'q';
	o->help |= opt == 'h';
	return true;
}

static const char *option_name(int opt)
{
	for (const struct option *l = long_options; l->name; l++)
		if (l->val == opt)
			return l->name;
	return "";
}

/* WH_OK, or the exit status after a message. */
static int parse_options(options *o, int argc, char **argv)
{
	const char *name = argv[0];
	int opt;
	*o = (options){.synth = wh_synth_defaults()};
	opterr = 0;
	while ((opt = getopt_long(argc, argv, ":o:n:fqh", long_options, NULL)) != -1) {
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
	if (optind < argc)
		return cmd_usage_error(name, "do not know what to do with \"%s\"", argv[optind]);
	if (!o->output)
		return cmd_usage_error(name, "-o OUT is missing");
	if (!o->faces)
		return cmd_usage_error(name, "--faces N is missing");
	o->synth.faces = (uint64_t)o->faces;
	o->synth.seed = (uint64_t)o->seed;
	return WH_OK;
}

/* What was made goes to standard output, unless the mesh itself went there. */
static void report(const options *o, const wh_synth *s, uint64_t bytes, double seconds)
{
	/* NOLINTNEXTLINE(clang-analyzer-core.NonNullParamChecker): parse_options refuses none */
	FILE *f = strcmp(o->output, "-") == 0 ? stderr : stdout;
	const uint64_t faces = wh_synth_faces(s);
	(void)fprintf(f, "%s: %llu vertices, %llu faces", o->output,
	              (unsigned long long)wh_synth_vertices(s), (unsigned long long)faces);
	if (o->synth.kind == WH_SYNTH_TERRAIN)
		(void)fprintf(f, ", %llu holes", (unsigned long long)wh_synth_holes(s));
	(void)fprintf(f, ", %llu bytes, %.2f s\n", (unsigned long long)bytes, seconds);
}

static wh_code generate(cmd_env *e, const options *o)
{
	wh_ctx *c = &e->ctx;
	wh_synth *s = NULL;
	wh_outfile *out = NULL;
	const double start = wh_seconds();
	uint64_t bytes = 0;
	if (wh_format_only(c, o->output, "ply") != WH_OK ||
	    wh_synth_open(c, &s, &o->synth) != WH_OK)
		return c->err.code;
	wh_code code = wh_outfile_open(c, &out, o->output, o->force);
	if (code != WH_OK)
		goto close_synth;
	code = wh_synth_write(c, &e->exec, s, out);
	if (code != WH_OK)
		goto close_out;
	bytes = wh_outfile_bytes(out);
	code = wh_outfile_commit(c, &out);
	if (code == WH_OK && !o->quiet)
		report(o, s, bytes, wh_seconds() - start);
close_out:
	wh_outfile_abort(c, &out);
close_synth:
	wh_synth_close(c, &s);
	return code;
}

int cmd_generate(int argc, char **argv)
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
	return generate(&e, &o) == WH_OK ? WH_OK : cmd_report_failure(&e);
}
