/*
 * Frames of a morph. A picture is drawn of a temporary PLY file, and with it go those of both ends:
 * they are not seen, but the camera is fitted to all three, and so stands still, as every frame
 * lies between the ends.
 */
#define _POSIX_C_SOURCE 200809L
#include "replay_frames.h"

#include "cmd.h"
#include "io/spill.h"
#include "pipeline/picture.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

enum { PATH = 4096, SAMPLES = 4 };
enum { FRAME, FIRST, LAST, SCENES }; /* meshes of a picture */

typedef struct frames {
	wh_ctx *c;
	wh_replay *r;
	const replay_options *o;
	wh_exec ex;
	wh_spill spill; /* of pictures */
	char mesh[SCENES][PATH];
} frames;

static bool are_pictures(const replay_options *o)
{
	const size_t n = strlen(o->out.path);
	return !o->out.to && n > 4 && strcmp(o->out.path + n - 4, ".png") == 0;
}

static wh_code too_long(const frames *f)
{
	return wh_fail(f->c, WH_E_USAGE, "the names of the frames are too long");
}

static wh_code name_frame(const frames *f, uint32_t i, char name[PATH])
{
	char word[16];
	(void)snprintf(word, sizeof word, "%04u", (unsigned)i);
	return cmd_name_with(name, PATH, f->o->out.path, word) ? WH_OK : too_long(f);
}

/* A frame that is in the way, or cannot have its name, is to be told before the work. */
static wh_code look_for_frames(const frames *f)
{
	char name[PATH];
	for (uint32_t i = 0; i < f->o->frames; i++) {
		if (name_frame(f, i, name) != WH_OK)
			return f->c->err.code;
		const bool there = access(name, F_OK) == 0;
		if (!there && errno == ENAMETOOLONG)
			return too_long(f);
		if (!f->o->out.force && there)
			return wh_fail(f->c, WH_E_USAGE,
			               "'%s' exists already; use -f to replace it", name);
	}
	return WH_OK;
}

/* ---- pictures ----------------------------------------------------------------------------- */

static wh_code write_scene(const frames *f, int which, double t)
{
	const wh_replay_output out = {.path = f->mesh[which], .to = "ply", .force = true};
	return wh_replay_write_morph(f->c, f->r, t, &out, NULL);
}

static wh_code open_scenes(frames *f)
{
	static const char *const name[SCENES] = {"frame.ply", "first.ply", "last.ply"};
	wh_replay_info info;
	wh_replay_tell(f->r, &info);
	if (f->o->look.colours && !info.coloured)
		return wh_fail(f->c, WH_E_INPUT,
		               "'%s' has no colours: its vertices lack red, green and blue; leave "
		               "out --colours",
		               f->o->input);
	if (wh_png_available(f->c) != WH_OK ||
	    wh_spill_open(f->c, &f->spill, f->o->look.temp_dir, "/tmp") != WH_OK)
		return f->c->err.code;
	for (int i = 0; i < SCENES; i++)
		if ((size_t)snprintf(f->mesh[i], PATH, "%s/%s", f->spill.dir, name[i]) >= PATH)
			return wh_fail(f->c, WH_E_USAGE, "the name of '%s' is too long",
			               f->spill.dir);
	return write_scene(f, FIRST, 0) == WH_OK ? write_scene(f, LAST, 1) : f->c->err.code;
}

static wh_code draw(const frames *f, const char *path)
{
	const replay_look *l = &f->o->look;
	const char *const paths[SCENES] = {f->mesh[FRAME], f->mesh[FIRST], f->mesh[LAST]};
	const wh_picture_cell cell = {.own_view = l->turned[0] || l->turned[1],
	                              .view = {l->turn[0], l->turn[1]}};
	const wh_picture_params p = {.paths = paths,
	                             .npaths = SCENES,
	                             .output = path,
	                             .force = f->o->out.force,
	                             .cells = &cell,
	                             .ncells = 1,
	                             .width = l->width,
	                             .height = l->height,
	                             .samples = SAMPLES,
	                             .up = l->up,
	                             .zoom = 1,
	                             .flat = l->flat,
	                             .wireframe = l->wireframe,
	                             .colours = l->colours,
	                             .background = {255, 255, 255, 255},
	                             .temp_dir = l->temp_dir,
	                             .memory = f->o->memory};
	wh_picture_report report;
	return wh_picture(f->c, &f->ex, &p, &report);
}

/* ---- all of them -------------------------------------------------------------------------- */

static wh_code make_frame(const frames *f, uint32_t i)
{
	const double t = (double)i / (f->o->frames - 1);
	char name[PATH];
	if (wh_poll(f->c) != WH_OK || name_frame(f, i, name) != WH_OK)
		return f->c->err.code;
	if (f->spill.dir)
		return write_scene(f, FRAME, t) == WH_OK ? draw(f, name) : f->c->err.code;
	wh_replay_output out = f->o->out;
	out.path = name;
	return wh_replay_write_morph(f->c, f->r, t, &out, NULL);
}

wh_code replay_frames(wh_ctx *c, wh_replay *r, const replay_options *o)
{
	frames f = {.c = c, .r = r, .o = o, .ex = {.workers = wh_exec_threads(0)}};
	wh_code code = look_for_frames(&f);
	if (code == WH_OK && are_pictures(o))
		code = open_scenes(&f);
	for (uint32_t i = 0; code == WH_OK && i < o->frames; i++)
		code = make_frame(&f, i);
	wh_spill_close(c, &f.spill);
	return code;
}
