/* What a page needs of the meshes, through the library's calls. */
#define _POSIX_C_SOURCE 200809L
#include "compare_json.h"
#include "page_parts.h"

#include "pipeline/measure.h"
#include "pipeline/normalise.h"
#include "whittle.h"

#include <fcntl.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

enum {
	SAMPLES = 4,                   /* of the pictures, along the side of a pixel */
	BASE_BYTES = 12 * 1024 * 1024, /* program, libraries, stacks */
	REPORT_MOST = 16 * 1024 * 1024 /* bytes of a JSON file */
};

/* ---- files ---------------------------------------------------------------------------------- */

static wh_code look_at(page_work *w, const char *path, page_mesh *m)
{
	wh_input in;
	m->path = path;
	if (wh_input_look(w->c, w->ex, &w->spill, path, WH_FORMAT_ANY, (wh_wanted){"none", 0},
	                  &in) != WH_OK)
		return w->c->err.code;
	m->faces = in.source.nf;
	m->vertices = in.source.nv;
	m->bytes = in.file_bytes;
	wh_input_close(w->c, &w->spill, &in);
	return WH_OK;
}

static wh_code read_run(page_work *w, const char *path, json_t **run)
{
	json_error_t why;
	struct stat st;
	const int fd = open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK); /* a pipe must not block */
	if (fd < 0)
		return wh_fail_errno(w->c, "cannot open '%s'", path);
	if (fstat(fd, &st) != 0 || !S_ISREG(st.st_mode) || st.st_size > REPORT_MOST) {
		(void)close(fd);
		return wh_fail(
		    w->c, WH_E_INPUT,
		    "'%s' is no report: --json takes the file that reduce --report wrote", path);
	}
	*run = json_loadfd(fd, JSON_REJECT_DUPLICATES, &why);
	(void)close(fd);
	if (!*run)
		return wh_fail(w->c, WH_E_INPUT,
		               "'%s', line %d: %s; --json takes what reduce --report wrote", path,
		               why.line, why.text);
	if (!json_is_object(*run) || !json_is_object(json_object_get(*run, "output")))
		return wh_fail(w->c, WH_E_INPUT,
		               "'%s' is not what reduce --report wrote: it tells of no output",
		               path);
	return WH_OK;
}

/* An object of a report tells of this file: by its name and size. */
static bool tells_of(const json_t *o, const page_mesh *m)
{
	const char *path = json_string_value(json_object_get(o, "path"));
	const json_int_t bytes = json_integer_value(json_object_get(o, "bytes"));
	return path && strcmp(page_name(path), page_name(m->path)) == 0 &&
	       (uint64_t)bytes == m->bytes;
}

/* Finds the levels that a run has measured from the same input. */
static void match_run(page_work *w, const json_t *run)
{
	const json_t *list = json_object_get(run, "levels"), *level;
	size_t at;
	if (!tells_of(json_object_get(run, "input"), &w->mesh[0]))
		return;
	for (int i = 1; i < w->n; i++) {
		page_mesh *m = &w->mesh[i];
		if (tells_of(json_object_get(run, "output"), m))
			m->measured = json_object_get(run, "measured");
		json_array_foreach(list, at, level) if (tells_of(level, m)) m->measured =
		    json_object_get(level, "measured");
	}
}

wh_code page_files_open(page_work *w)
{
	progress_bar_tell(w->bar, "open", 0, 1);
	w->n = w->o->npaths;
	for (int i = 0; i < w->n; i++)
		if (look_at(w, w->o->paths[i], &w->mesh[i]) != WH_OK)
			return w->c->err.code;
	for (int i = 0; i < w->o->nruns; i++) {
		if (read_run(w, w->o->runs[i], &w->runs[i]) != WH_OK)
			return w->c->err.code;
		match_run(w, w->runs[i]);
	}
	return WH_OK;
}

void page_work_free(page_work *w)
{
	for (int i = 0; i < w->n; i++) {
		wh_free(w->c, w->mesh[i].picture.at);
		wh_free(w->c, w->mesh[i].map.at);
		wh_compact_free(w->c, &w->mesh[i].shown);
	}
	for (int i = 0; i < w->o->nruns; i++)
		json_decref(w->runs[i]);
	wh_spill_close(w->c, &w->spill);
}

/* ---- pictures ------------------------------------------------------------------------------- */

static wh_code take_picture(wh_ctx *c, void *user, int cell, const wh_picture_look *look)
{
	page_work *w = user;
	page_mesh *m = &w->mesh[cell];
	m->faces = look->faces;
	m->vertices = look->vertices;
	return wh_png_encode(c, &m->picture, &look->image, true);
}

static wh_code take_map(wh_ctx *c, void *user, int cell, const wh_picture_look *look)
{
	page_work *w = user;
	page_mesh *m = &w->mesh[cell + 1];
	m->range = look->range;
	m->distance_max = look->distance_max;
	return wh_png_encode(c, &m->map, &look->image, true);
}

/* Every file from the camera that shows all of them; cells: files from `first` on. */
static wh_code draw(page_work *w, int first, const char *distance_to,
                    wh_code (*take)(wh_ctx *, void *, int, const wh_picture_look *))
{
	wh_picture_report r;
	wh_picture_cell cells[REPORT_FILES];
	wh_picture_params p = {.paths = w->o->paths,
	                       .npaths = w->n,
	                       .cells = cells,
	                       .ncells = w->n - first,
	                       .take = take,
	                       .take_user = w,
	                       .width = w->o->width,
	                       .height = w->o->height,
	                       .samples = SAMPLES,
	                       .up = w->o->up,
	                       .zoom = 1,
	                       .distance_to = distance_to,
	                       .temp_dir = w->o->temp_dir,
	                       .memory = w->memory,
	                       .progress = progress_bar_tell,
	                       .progress_user = w->bar};
	for (int i = first; i < w->n; i++) {
		wh_picture_cell *cell = &cells[i - first];
		*cell =
		    (wh_picture_cell){.file = i, .own_view = w->o->turned[0] || w->o->turned[1]};
		cell->view.azimuth = w->o->turned[0] ? w->o->turn[0] : 30;
		cell->view.elevation = w->o->turned[1] ? w->o->turn[1] : 16;
	}
	const wh_code code = wh_picture(w->c, w->ex, &p, &r);
	w->up = r.up;
	w->view = r.view;
	return code;
}

wh_code page_pictures(page_work *w)
{
	wh_ctx asked = wh_ctx_fork(w->c);
	w->drawn = wh_png_available(&asked) == WH_OK;
	if (!w->drawn)
		return WH_OK;
	const wh_code code = draw(w, 0, NULL, take_picture);
	return code == WH_OK ? draw(w, 1, w->mesh[0].path, take_map) : code;
}

/* ---- distances ------------------------------------------------------------------------------ */

/* A context for calls that take a ceiling for the process to be theirs alone: with an account of
 * its own, beside what the page holds already. *memory is what that leaves. */
static wh_ctx open_account(const page_work *w, wh_mem *mem, size_t *memory)
{
	const size_t held = atomic_load(&w->c->mem->used);
	wh_ctx c = wh_ctx_fork(w->c);
	*mem = (wh_mem){0};
	c.mem = mem;
	*memory = w->memory > held ? w->memory - held : 1;
	return c;
}

/* The figures of the run that made the level, where it has those that are wanted. */
static bool is_measured(const page_work *w, page_mesh *level)
{
	return level->measured && w->o->samples == 0 &&
	       compare_json_read(level->measured, &level->distance) &&
	       (level->distance.banded || !w->o->seams);
}

static wh_code measure(page_work *w, const wh_measure_other *other, size_t n)
{
	wh_mem mem;
	size_t memory;
	wh_ctx c = open_account(w, &mem, &memory);
	const wh_measure_params p = {.a = w->mesh[0].path,
	                             .other = other,
	                             .others = n,
	                             .seams = w->o->seams,
	                             .samples = (uint64_t)w->o->samples,
	                             .temp_dir = w->o->temp_dir,
	                             .memory = memory,
	                             .progress = progress_bar_tell,
	                             .progress_user = w->bar};
	const wh_code code = wh_measure_files(&c, w->ex, &p);
	if (code != WH_OK)
		w->c->err = c.err;
	return code;
}

wh_code page_compare(page_work *w)
{
	wh_measure_other other[REPORT_FILES];
	size_t n = 0;
	for (int i = 1; i < w->n; i++) {
		page_mesh *level = &w->mesh[i];
		if (!is_measured(w, level))
			other[n++] =
			    (wh_measure_other){level->path, WH_FORMAT_ANY, &level->distance};
	}
	return n > 0 ? measure(w, other, n) : WH_OK;
}

/* ---- meshes --------------------------------------------------------------------------------- */

/* Reduces a level that is too large for a page to a file of the spill folder. */
static wh_code reduce_level(page_work *w, const page_mesh *level, const char *to)
{
	wh_reduce_params p = wh_reduce_defaults();
	wh_reduce_report r;
	wh_mem mem;
	wh_ctx own = open_account(w, &mem, &p.memory);
	p.input = level->path;
	p.output = to;
	p.force = true;
	p.attributes = "none";
	p.faces = (uint64_t)w->o->shown;
	p.threads = w->ex->workers;
	p.temp_dir = w->o->temp_dir;
	p.progress = progress_bar_tell;
	p.progress_user = w->bar;
	const wh_code code = wh_reduce(&own, &p, &r);
	if (code == WH_E_TARGET) /* it is as small as it gets, and the page tells how small */
		return WH_OK;
	w->c->err = own.err;
	return code;
}

/* Room for the mesh that is shown, and its bytes. */
static wh_code refuse_early(const page_work *w)
{
	const uint64_t nf = (uint64_t)w->o->shown, nv = nf / 2;
	const size_t need = wh_compact_bytes(nv, nf) + nv * sizeof(wh_vec3) + 12 * nf;
	const size_t all = atomic_load(&w->c->mem->used) + BASE_BYTES + need;
	if (all <= w->memory)
		return WH_OK;
	return wh_fail(w->c, WH_E_PLAN,
	               "a page of %lld faces a level needs more memory than the ceiling of %zu "
	               "MiB: use --memory %zuM, or a smaller --shown",
	               (long long)w->o->shown, w->memory >> 20, (all >> 20) + 1);
}

/* Of all that faces use and is a number. */
static wh_compact_grid grid_of(const wh_mesh *m)
{
	wh_vec3 lo = wh_v3(INFINITY, INFINITY, INFINITY), hi = wh_scale(lo, -1);
	for (size_t i = 0; i < 3 * (size_t)m->nf; i++) {
		const wh_vec3 p = m->pos[m->tri[i]];
		if (!isfinite(p.x) || !isfinite(p.y) || !isfinite(p.z))
			continue;
		lo = wh_lower(lo, p);
		hi = wh_upper(hi, p);
	}
	return wh_compact_grid_of(lo, hi);
}

static wh_code show_level(page_work *w, int i, wh_mesh *m)
{
	page_mesh *level = &w->mesh[i];
	char to[4096];
	const char *path = level->path;
	if (level->faces > (uint64_t)w->o->shown) {
		const int n = snprintf(to, sizeof to, "%s/shown.ply", w->spill.dir);
		if (n < 0 || (size_t)n >= sizeof to)
			return wh_fail(w->c, WH_E_RUN, "the name of the folder '%s' is too long",
			               w->spill.dir);
		path = to;
		if (reduce_level(w, level, to) != WH_OK)
			return w->c->err.code;
	}
	const wh_code code =
	    wh_load_mesh(w->c, w->ex, &w->spill, path, WH_FORMAT_ANY, m, NULL, NULL);
	if (code == WH_OK && path == level->path) {
		level->faces = m->nf;
		level->vertices = m->nv;
	}
	level->grid = grid_of(m);
	return code == WH_OK ? wh_compact_encode(w->c, m, &level->grid, &level->shown) : code;
}

wh_code page_meshes(page_work *w)
{
	wh_code code = refuse_early(w);
	for (int i = 1; code == WH_OK && i < w->n; i++) {
		wh_mesh m = {0};
		code = show_level(w, i, &m);
		wh_mesh_free(w->c, &m);
	}
	return code;
}
