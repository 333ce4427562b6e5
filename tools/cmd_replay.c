/* whittle replay: options -> open, seek, write -> words. */
#define _POSIX_C_SOURCE 200809L
#include "cmd.h"
#include "replay_frames.h"
#include "replay_page.h"

#include "base/timer.h"

#include <stdio.h>
#include <string.h>

static const char help[] =
    "usage: whittle replay FILE.pmesh -o OUT [--faces N | --vertices N | --ratio R |\n"
    "                                         --error E]\n"
    "       whittle replay FILE.pmesh -o OUT --faces N --towards M --geomorph T\n"
    "       whittle replay FILE.pmesh -o PICTURE.png --faces N --towards M --frames N\n"
    "       whittle replay FILE.pmesh --page PAGE.html\n"
    "Makes a mesh of any size of a record of whittle progressive; without a limit all of\n"
    "the mesh that was recorded. Without -o and --text: says what the record holds.\n\n"
    "  -o, --output FILE     where to; - is standard output. PLY, or as the name ends:\n"
    "                        .obj, .off, .stl, .glb; compressed if it ends in .gz, .zst\n"
    "      --to F            ply, obj, off, stl, glb, ply.gz, ... whatever OUT's name is\n"
    "  -n, --faces N|P%      triangles, no more than: 200K, 1.5M, 10%\n"
    "      --vertices N|P%   vertices, no more than\n"
    "      --ratio R         share of the triangles: 0.1\n"
    "      --error E|P%      how far the surface may have moved, as estimated, in units of\n"
    "                        the file or per cent of the bounding-box diagonal\n"
    "      --text FILE       the collapses from all of the mesh down to that size, one a\n"
    "                        line; - is standard output. A line: the vertex that goes, the\n"
    "                        one that stays; x, y, z of where that is then; the number of\n"
    "                        faces that vanish, and which; the number of faces that\n"
    "                        change a corner, and which\n"
    "      --page FILE       an HTML page that plays the record in any browser: a slider,\n"
    "                        geomorphs, wireframe, keys; up to the level of the limits\n"
    "                        above (default: 200K faces), some 50 bytes a face\n"
    "      --memory SIZE     ceiling of the process: 512M, 4G (default: half of the\n"
    "                        machine's, its control group's or the job's)\n"
    "      --ascii           text instead of binary (PLY, STL)\n"
    "      --quantize        smaller GLB: positions of 16 bits, colours, normals of 8\n"
    "  -f, --force           write over existing outputs\n"
    "  -q, --quiet           no words\n\n"
    "From one level to another without a jump; the first is that of the limits above:\n"
    "      --towards N|P%    the second level, triangles (default: all of the mesh)\n"
    "      --geomorph T      the mesh between them: at 0 as the first, at 1 as the second.\n"
    "                        It has the faces of the finer one; vertices that the coarser\n"
    "                        one lacks come out of those that they were split from\n"
    "      --frames N        N of them, from 0 to 1: the number of a frame is put in the\n"
    "                        place of %f in OUT, else before its ending. Meshes, or\n"
    "                        pictures if OUT ends in .png, from one camera:\n"
    "      --size WxH        pixels (1200x900)\n"
    "      --azimuth DEG, --elevation DEG, --up x|y|z, --flat, --wireframe, --colours,\n"
    "      --temp-dir DIR    as in render\n"
    "Leaves with status 4 when even the base of the record is larger than asked for; the\n"
    "base is written then.\n";

/* ---- words -------------------------------------------------------------------------------- */

static void print_record(FILE *f, const char *path, const wh_replay_info *i)
{
	(void)fprintf(f,
	              "%s: %llu faces, %llu vertices to %llu faces, %llu vertices in %llu "
	              "collapses\n",
	              path, (unsigned long long)i->faces, (unsigned long long)i->vertices,
	              (unsigned long long)i->base_faces, (unsigned long long)i->base_vertices,
	              (unsigned long long)i->splits);
	(void)fprintf(
	    f,
	    "%llu bytes, %.2f a vertex; the base is off by %.6g, in the unit of the coordinates\n",
	    (unsigned long long)i->file_bytes, (double)i->file_bytes / (double)i->vertices,
	    i->base_error);
}

static void print_level(FILE *f, const replay_options *o, const wh_replay_info *i, double seconds)
{
	(void)fprintf(f, "%s: level %llu of %llu, %llu faces, %llu vertices, off by %.6g\n",
	              o->out.path ? o->out.path : o->text, (unsigned long long)i->level,
	              (unsigned long long)i->splits, (unsigned long long)i->level_faces,
	              (unsigned long long)i->level_vertices, i->level_error);
	(void)fprintf(f, "%.2f s, %.2f M splits read/s, peak memory %.0f MiB\n", seconds,
	              seconds > 0 ? (double)i->level / seconds / 1e6 : 0,
	              (double)cmd_peak_rss() / 1048576.0);
}

static void print_morph(FILE *f, const replay_options *o, const wh_replay_info *i)
{
	(void)fprintf(f, "%s: ", o->out.path);
	if (o->frames)
		(void)fprintf(f, "%u frames of ", (unsigned)o->frames);
	(void)fprintf(f, "%llu faces, %llu vertices, peak memory %.0f MiB\n",
	              (unsigned long long)i->level_faces, (unsigned long long)i->level_vertices,
	              (double)cmd_peak_rss() / 1048576.0);
}

static void print_page(const replay_options *o, const wh_replay_info *i)
{
	(void)printf("%s: %llu to %llu faces; open it in a browser\n", o->page,
	             (unsigned long long)i->base_faces, (unsigned long long)i->level_faces);
}

/* ---- what is asked for -------------------------------------------------------------------- */

static wh_code write_text(wh_ctx *c, wh_replay *r, const replay_options *o, uint64_t level)
{
	if (wh_replay_seek(c, r, UINT64_MAX) != WH_OK)
		return c->err.code;
	return wh_replay_text(c, r, level, o->text, o->out.force);
}

/* Text and mesh of a level; `seconds`: to get there. */
static wh_code make(wh_ctx *c, wh_replay *r, const replay_options *o, uint64_t level,
                    double *seconds)
{
	const double start = wh_seconds();
	const wh_code code = o->text ? write_text(c, r, o, level) : wh_replay_seek(c, r, level);
	*seconds = wh_seconds() - start;
	if (code != WH_OK || !o->out.path)
		return code;
	return wh_replay_write(c, r, &o->out, NULL);
}

/* A morph from a level to the other one. *reached becomes false where the base is no smaller. */
static wh_code make_morph(wh_ctx *c, wh_replay *r, const replay_options *o, uint64_t level,
                          bool *reached)
{
	uint64_t other;
	bool there;
	if (wh_replay_find(c, r, &o->towards, &other, &there) != WH_OK ||
	    wh_replay_morph(c, r, level, other) != WH_OK)
		return c->err.code;
	*reached &= there;
	return o->frames ? replay_frames(c, r, o)
	                 : wh_replay_write_morph(c, r, o->t, &o->out, NULL);
}

static wh_code refuse_smaller(wh_ctx *c, const replay_options *o, const wh_replay_info *i)
{
	return wh_fail(c, WH_E_TARGET,
	               "'%s' has no fewer than %llu faces, %llu vertices; that base was written: "
	               "record it with a smaller target",
	               o->input, (unsigned long long)i->base_faces,
	               (unsigned long long)i->base_vertices);
}

/* The page goes up to the level that the limits mean; without any to one that browsers bear. That
 * there is room for it is found out here, and *r is closed. */
static wh_code make_page(wh_ctx *c, wh_replay **r, const replay_options *o)
{
	const wh_level *l = &o->limits, usual = {.faces = REPLAY_SHOWN};
	const bool limited = l->faces || l->vertices || l->face_ratio > 0 || l->vertex_ratio > 0 ||
	                     l->error > 0 || l->error_share > 0;
	wh_replay_info info;
	uint64_t level;
	bool reached;
	if (wh_replay_find(c, *r, limited ? l : &usual, &level, &reached) != WH_OK ||
	    wh_replay_seek(c, *r, level) != WH_OK)
		return c->err.code;
	wh_replay_tell(*r, &info);
	wh_replay_close(c, r);
	if (replay_page(c, o, level) != WH_OK)
		return c->err.code;
	if (!o->quiet)
		print_page(o, &info);
	return reached || !limited ? WH_OK : refuse_smaller(c, o, &info);
}

static wh_code play(wh_ctx *c, wh_replay *r, const replay_options *o)
{
	wh_replay_info info;
	uint64_t level;
	bool reached;
	double seconds = 0;
	const bool dash = (o->out.path && strcmp(o->out.path, "-") == 0) ||
	                  (o->text && strcmp(o->text, "-") == 0);
	FILE *words = dash ? stderr : stdout;
	wh_replay_tell(r, &info);
	if (!o->quiet)
		print_record(words, o->input, &info);
	if (!o->out.path && !o->text)
		return WH_OK;
	if (wh_replay_find(c, r, &o->limits, &level, &reached) != WH_OK)
		return c->err.code;
	const bool morph = o->geomorph || o->frames;
	if ((morph ? make_morph(c, r, o, level, &reached) : make(c, r, o, level, &seconds)) !=
	    WH_OK)
		return c->err.code;
	wh_replay_tell(r, &info);
	if (!o->quiet && morph)
		print_morph(words, o, &info);
	else if (!o->quiet)
		print_level(words, o, &info, seconds);
	return reached ? WH_OK : refuse_smaller(c, o, &info);
}

int cmd_replay(int argc, char **argv)
{
	replay_options o;
	const int status = replay_options_parse(argc, argv, &o);
	if (status != WH_OK)
		return status;
	if (o.help) {
		(void)fputs(help, stdout);
		return WH_OK;
	}
	cmd_env env;
	cmd_env_init(&env, argv[0]);
	wh_replay *r;
	wh_code code = wh_replay_open(&env.ctx, &r, o.input, o.memory);
	if (code == WH_OK)
		code = o.page ? make_page(&env.ctx, &r, &o) : play(&env.ctx, r, &o);
	wh_replay_close(&env.ctx, &r);
	return code == WH_OK ? WH_OK : cmd_report_failure(&env);
}
