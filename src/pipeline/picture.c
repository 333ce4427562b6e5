#include "pipeline/picture.h"

#include "exec/topo.h"
#include "io/png.h"
#include "pipeline/atlas.h"
#include "pipeline/fit.h"
#include "pipeline/normalise.h"
#include "pipeline/picture_parts.h"
#include "pipeline/scene.h"

#include <string.h>

enum {
	BASE_BYTES = 12 * 1024 * 1024,    /* program, libraries, stacks, small allocations */
	OPEN_BYTES = 32 * 1024 * 1024,    /* enough to look at the input and refuse it in words */
	REWRITE_BYTES = 20 * 1024 * 1024, /* a worker that rewrites text or polygons */
	SPARE_BYTES = 2 * 1024 * 1024,    /* libpng, rounding of blocks to pages */
	WINDOW_LEAST = 16 * 1024          /* vertices */
};

static const float CLAY[3] = {0.78F, 0.735F, 0.665F};
static const float PLAIN[3] = {0.94F, 0.94F, 0.94F}; /* below other colours */
static const double FLAT = 0.5;                      /* height over width of what lies flat */
static const wh_view THREE_QUARTERS = {30, 16}, FROM_ABOVE = {30, 38};
static const double POINT_SHARE = 0.3; /* of the picture's area for a cloud's points */

size_t wh_draw_budget(const wh_draw *d)
{
	const size_t used = atomic_load(&d->c->mem->used) + BASE_BYTES;
	return d->memory > used ? d->memory - used : 0;
}

static wh_code too_small(const wh_draw *d, const char *what, size_t need)
{
	const size_t all = atomic_load(&d->c->mem->used) + BASE_BYTES + need;
	return wh_fail(d->c, WH_E_PLAN,
	               "%s needs more memory than the ceiling of %zu MiB: use --memory %zuM, or "
	               "a smaller --size",
	               what, d->memory >> 20, (all >> 20) + 4);
}

/* ---- input ---------------------------------------------------------------------------------- */

static wh_code check_colours(wh_ctx *c, const wh_input *in)
{
	if (in->attributes.has_rgb)
		return WH_OK;
	return wh_fail(c, WH_E_INPUT,
	               "'%s' has no colours: its vertices lack red, green and blue; leave out "
	               "--colours",
	               in->ply.path);
}

/* Textures that the ceiling has no room for are refused with one that has. */
static wh_code load_skins(wh_draw *d, wh_draw_file *f)
{
	d->c->mem->limit = d->memory > BASE_BYTES / 2 ? d->memory - BASE_BYTES / 2 : 1;
	return wh_skins_load(d->c, &f->input, d->p->texture_file, &f->skins);
}

enum { TEXTURED = WH_HOLDS_FACES | WH_HOLDS_CORNERS };

static wh_code join_once(wh_draw *d, const wh_exec *ex, wh_input *in)
{
	const wh_atlas_params p = {
	    .rest = &in->attributes, .wedges = &in->wedges, .budget = wh_draw_budget(d)};
	wh_source joined;
	wh_atlas_result done;
	int fd;
	d->c->mem->limit = d->memory > BASE_BYTES / 2 ? d->memory - BASE_BYTES / 2 : 1;
	const wh_source source = in->source;
	const wh_code code =
	    wh_atlas_join(d->c, ex, &d->progress, &d->spill, &source, &p, &joined, &fd, &done);
	if (code == WH_OK)
		wh_input_replace(&d->spill, in, &joined, fd);
	return code;
}

/* Texture coordinates of vertices become those of corners. */
static wh_code join_charts(wh_draw *d, const wh_exec *ex, wh_input *in)
{
	wh_code code = join_once(d, ex, in);
	if (code != WH_E_IRREGULAR)
		return code;
	code = wh_input_rewrite(d->c, ex, &d->spill, in);
	return code == WH_OK ? join_once(d, ex, in) : code;
}

/* As many workers as there is memory for when bodies are rewritten. */
static wh_exec rewriters(const wh_draw *d)
{
	const size_t fit = wh_draw_budget(d) / REWRITE_BYTES;
	wh_exec ex = *d->ex;
	if ((size_t)ex.workers > fit)
		ex.workers = fit ? (int)fit : 1;
	return ex;
}

static wh_code open_file(wh_draw *d, int i)
{
	wh_ctx *c = d->c;
	wh_draw_file *f = &d->file[i];
	const wh_exec ex = rewriters(d);
	const wh_wanted wanted = {"all", (d->p->colours ? WH_HOLDS_COLOUR : 0U) |
	                                     (d->p->texture ? TEXTURED : 0U)};
	if (wh_input_open_any(c, &ex, &d->spill, d->p->paths[i], WH_FORMAT_ANY, wanted,
	                      &f->input) != WH_OK)
		return c->err.code;
	f->open = true;
	if (f->input.apart) {
		const wh_code code = join_charts(d, &ex, &f->input);
		if (code != WH_OK)
			return code;
	}
	if (d->p->colours && check_colours(c, &f->input) != WH_OK)
		return c->err.code;
	return d->p->texture ? load_skins(d, f) : WH_OK;
}

/* A name mistyped is to be told before the work. */
static wh_code try_other(wh_draw *d)
{
	wh_input in;
	if (!d->p->distance_to || wh_ply_is_read_once(d->p->distance_to))
		return WH_OK;
	if (wh_input_look(d->c, d->ex, &d->spill, d->p->distance_to, WH_FORMAT_ANY,
	                  (wh_wanted){"none", 0}, &in) != WH_OK)
		return d->c->err.code;
	wh_input_close(d->c, &d->spill, &in);
	return WH_OK;
}

static wh_code open_files(wh_draw *d)
{
	wh_progress_phase(&d->progress, "open", 1);
	if (try_other(d) != WH_OK)
		return d->c->err.code;
	for (int i = 0; i < d->p->npaths; i++)
		if (open_file(d, i) != WH_OK)
			return d->c->err.code;
	return WH_OK;
}

/* Faces that are not triangles were met behind a triangle's size, nobody knows in which of them. */
static wh_code rewrite_files(wh_draw *d)
{
	const wh_exec ex = rewriters(d);
	for (int i = 0; i < d->p->npaths; i++)
		if (d->file[i].input.source.nf > 0 &&
		    wh_input_rewrite(d->c, &ex, &d->spill, &d->file[i].input) != WH_OK)
			return d->c->err.code;
	return WH_OK;
}

static void close_files(wh_draw *d)
{
	for (int i = 0; i < d->p->npaths; i++)
		if (d->file[i].open) {
			wh_input_close(d->c, &d->spill, &d->file[i].input);
			wh_skins_free(d->c, &d->file[i].skins);
			d->file[i].open = false;
		}
}

/* ---- camera --------------------------------------------------------------------------------- */

static wh_exec fit_workers(const wh_draw *d, const wh_source *s)
{
	wh_exec ex = *d->ex;
	while (ex.workers > 1 && wh_fit_bytes(s, &ex) > wh_draw_budget(d))
		ex.workers /= 2;
	return ex;
}

static wh_code find_box(wh_draw *d)
{
	wh_code code = WH_OK;
	d->fit = wh_fit_none();
	for (int i = 0; code == WH_OK && i < d->p->npaths; i++) {
		const wh_source *s = &d->file[i].input.source;
		const wh_exec ex = fit_workers(d, s);
		code = wh_fit_box(d->c, &ex, &d->progress, s, &d->fit);
	}
	return code;
}

static wh_up guess_up(const wh_box *b)
{
	const double x = b->hi.x - b->lo.x, y = b->hi.y - b->lo.y, z = b->hi.z - b->lo.z;
	return z < FLAT * fmin(x, y) ? WH_UP_Z : WH_UP_Y;
}

static wh_code aim_camera(wh_draw *d, const wh_picture_cell *cell, wh_camera *k)
{
	const wh_picture_params *p = d->p;
	const wh_box *b = &d->fit.box;
	const wh_up guess = guess_up(b), up = p->up == WH_UP_GUESS ? guess : (wh_up)p->up;
	const wh_view suits = guess == WH_UP_Z && up == WH_UP_Z ? FROM_ABOVE : THREE_QUARTERS;
	const wh_view view = cell->own_view ? cell->view : suits;
	if (cell == d->p->cells) {
		d->r->up = up;
		d->r->view = view;
	}
	if (!wh_camera_open(k, b->lo, b->hi, view, up, p->perspective))
		return wh_fail(d->c, WH_E_INPUT,
		               "'%s' cannot be drawn: the box around its %llu vertices has no "
		               "size that numbers hold (%g %g %g to %g %g %g)",
		               p->paths[0], (unsigned long long)d->r->vertices, b->lo.x, b->lo.y,
		               b->lo.z, b->hi.x, b->hi.y, b->hi.z);
	return WH_OK;
}

/* Points at the middle of the box, and shows all that is inside the fence. */
static wh_code make_camera(wh_draw *d, const wh_picture_cell *cell, wh_camera *k)
{
	wh_code code = aim_camera(d, cell, k);
	wh_fit *f = &d->fit;
	const wh_fit none = wh_fit_none();
	memcpy(f->lo, none.lo, sizeof f->lo);
	memcpy(f->hi, none.hi, sizeof f->hi);
	for (int i = 0; code == WH_OK && i < d->p->npaths; i++) {
		const wh_source *s = &d->file[i].input.source;
		const wh_exec ex = fit_workers(d, s);
		code = wh_fit_camera(d->c, &ex, &d->progress, s, k, f);
	}
	if (code == WH_OK && f->lo[0] <= f->hi[0])
		wh_camera_fit(k, f->lo, f->hi, (double)d->p->width * d->p->samples,
		              (double)d->p->height * d->p->samples, d->p->zoom);
	return code;
}

/* ---- a cell --------------------------------------------------------------------------------- */

/* Bytes of the samples of so many rows of pixels. */
static size_t rows_bytes(const wh_draw *d, uint32_t rows)
{
	const uint32_t n = (uint32_t)d->p->samples;
	return wh_canvas_samples(d->p->width * n, rows * n) * sizeof(wh_sample);
}

/* The most rows of pixels that fit in so many bytes; 1 at least. */
static uint32_t rows_in(const wh_draw *d, size_t bytes)
{
	uint32_t lo = 1, hi = d->p->height;
	while (lo < hi) {
		const uint32_t mid = hi - (hi - lo) / 2;
		if (rows_bytes(d, mid) <= bytes)
			lo = mid;
		else
			hi = mid - 1;
	}
	return lo;
}

/* Rows at a time and vertices at a time, so that both fit: the vertices whole when they leave half
 * of the room, else as many as half of it holds. */
static wh_code share_memory(const wh_draw *d, wh_exec *ex, wh_scene_params *s, uint32_t *rows)
{
	const size_t all = wh_draw_budget(d), room = all > SPARE_BYTES ? all - SPARE_BYTES : 0;
	const size_t each = sizeof(wh_spot) + sizeof(wh_normal_sum);
	s->window = d->p->window;
	while (ex->workers > 1 && (size_t)ex->workers * WH_DRAW_WORKER_BYTES > room / 4)
		ex->workers--;
	size_t scene = wh_scene_bytes(s, ex);
	*rows = rows_in(d, room > scene + room / 2 ? room - scene : room / 2);
	if (scene + rows_bytes(d, *rows) > room) {
		s->window = WINDOW_LEAST;
		scene = wh_scene_bytes(s, ex);
		if (scene + rows_bytes(d, *rows) > room)
			return too_small(d, "the picture",
			                 2 * (scene + rows_bytes(d, 1)) + SPARE_BYTES);
		s->window += (room - rows_bytes(d, *rows) - scene) / each;
	}
	if (d->p->band && d->p->band < *rows)
		*rows = d->p->band;
	return WH_OK;
}

typedef struct resolving {
	const wh_canvas *canvas;
	const wh_draw *d;
	wh_pixel *pixels;
} resolving;

static wh_code resolve_job(wh_ctx *c, void *arg, int64_t index, int worker)
{
	const resolving *s = arg;
	const uint32_t n = (uint32_t)s->d->p->samples;
	const uint32_t row = s->canvas->y0 / n + (uint32_t)index;
	(void)c;
	(void)worker;
	wh_render_row(s->canvas, s->d->p->samples, row, s->pixels + (size_t)row * s->d->p->width);
	return WH_OK;
}

static wh_code draw_bands(wh_draw *d, const wh_exec *ex, wh_scene *scene, uint64_t items,
                          uint32_t rows, wh_pixel *pixels)
{
	const uint32_t n = (uint32_t)d->p->samples, height = d->p->height;
	const uint64_t bands = (height + rows - 1) / rows;
	wh_canvas v = {.w = d->p->width * n, .h = height * n};
	v.sample = wh_calloc(d->c, wh_canvas_samples(v.w, rows * n), sizeof *v.sample);
	wh_mem_scattered(v.sample);
	wh_code code = d->c->err.code;
	d->r->bands = bands > d->r->bands ? bands : d->r->bands;
	wh_progress_phase(&d->progress, "draw", bands * items);
	for (uint32_t y = 0; code == WH_OK && y < height; y += rows) {
		const uint32_t end = height - y < rows ? height : y + rows;
		resolving s = {&v, d, pixels};
		v.y0 = y * n;
		v.y1 = end * n;
		code = wh_scene_draw(d->c, scene, &v);
		if (code == WH_OK)
			code = wh_exec_for(d->c, ex, end - y, resolve_job, &s);
	}
	wh_free(d->c, v.sample);
	return code;
}

static wh_look look_of(const wh_draw *d, const wh_draw_cell *cell, const wh_source *s)
{
	const wh_picture_params *p = d->p;
	const float *base = p->distance_to ? PLAIN : CLAY;
	const double area = (double)p->width * p->height;
	const double spread = sqrt(area * POINT_SHARE / (double)s->nv);
	return (wh_look){.camera = &cell->camera,
	                 .base = {base[0], base[1], base[2]},
	                 .samples = p->samples,
	                 .colours = p->colours && !p->distance_to,
	                 .smooth = !p->flat && s->nf > 0,
	                 .wireframe = p->wireframe,
	                 .radius = p->samples * fmin(fmax(spread, 0.7), 4)};
}

static wh_code draw_cell(wh_draw *d, wh_draw_cell *cell)
{
	wh_draw_file *f = &d->file[cell->what->file];
	const wh_source *src = &f->input.source;
	wh_exec ex = *d->ex;
	wh_scene_params s = {.source = src, .look = look_of(d, cell, src)};
	wh_scene *scene = NULL;
	uint32_t rows = 1;
	cell->faces = src->nf;
	cell->points = src->nv;
	s.skins = d->p->texture && !d->p->distance_to ? &f->skins : NULL;
	if (share_memory(d, &ex, &s, &rows) != WH_OK)
		return d->c->err.code;
	wh_code code = wh_scene_open(d->c, &scene, &ex, &d->spill, &d->progress, &s);
	if (code == WH_OK)
		code = wh_scene_prepare(d->c, scene);
	if (code == WH_OK)
		code = draw_bands(d, &ex, scene, src->nf ? src->nf : src->nv, rows, cell->pixels);
	wh_scene_close(d->c, &scene);
	const uint64_t windows = s.window && src->nf ? (src->nv + s.window - 1) / s.window : 1;
	d->r->windows = windows > d->r->windows ? windows : d->r->windows;
	return code;
}

/* ---- the whole ------------------------------------------------------------------------------ */

/* What stays until the end: pixels of all cells, and the picture. */
static wh_code reserve_pixels(wh_draw *d)
{
	const size_t cell = (size_t)d->p->width * d->p->height;
	const size_t sheet = (size_t)d->sheet.w * d->sheet.h * 4;
	const size_t all = cell * sizeof(wh_pixel) * (size_t)d->p->ncells + sheet;
	if (d->sheet.w > WH_PICTURE_SIDE_MOST || d->sheet.h > WH_PICTURE_SIDE_MOST)
		return wh_fail(d->c, WH_E_USAGE,
		               "the picture would have %u x %u pixels; %d a side are the most",
		               d->sheet.w, d->sheet.h, WH_PICTURE_SIDE_MOST);
	if (all > wh_draw_budget(d))
		return too_small(d, "the picture", all + rows_bytes(d, 1) + SPARE_BYTES);
	d->sheet.rgba = wh_alloc(d->c, sheet, 1);
	for (int i = 0; i < d->p->ncells; i++) {
		d->cell[i].what = &d->p->cells[i];
		d->cell[i].pixels = wh_alloc(d->c, cell, sizeof *d->cell[i].pixels);
	}
	return d->c->err.code;
}

static void free_pixels(wh_draw *d)
{
	for (int i = 0; i < d->p->ncells; i++) {
		wh_free(d->c, d->cell[i].distance);
		wh_free(d->c, d->cell[i].pixels);
		d->cell[i] = (wh_draw_cell){0};
	}
	wh_free(d->c, d->sheet.rgba);
	d->sheet.rgba = NULL;
}

static wh_code unchanged(wh_draw *d)
{
	for (int i = 0; i < d->p->npaths; i++)
		if (wh_ply_unchanged(d->c, &d->file[i].input.ply) != WH_OK)
			return d->c->err.code;
	return WH_OK;
}

static void count_all(wh_draw *d)
{
	*d->r = (wh_picture_report){0};
	for (int i = 0; i < d->p->npaths; i++) {
		d->r->faces += d->file[i].input.source.nf;
		d->r->vertices += d->file[i].input.source.nv;
	}
}

static wh_code draw_all(wh_draw *d)
{
	count_all(d);
	wh_code code = reserve_pixels(d);
	if (code == WH_OK)
		code = find_box(d);
	for (int i = 0; code == WH_OK && i < d->p->ncells; i++) {
		code = make_camera(d, d->cell[i].what, &d->cell[i].camera);
		if (code == WH_OK)
			code = draw_cell(d, &d->cell[i]);
	}
	return code == WH_OK ? unchanged(d) : code;
}

static wh_code write_picture(wh_draw *d, wh_outfile **out)
{
	const wh_image image = {d->sheet.w, d->sheet.h, d->sheet.rgba};
	d->r->width = image.w;
	d->r->height = image.h;
	wh_progress_phase(&d->progress, "write", 1);
	const wh_code code = wh_png_write(d->c, *out, &image, d->p->background.a < 255);
	return code == WH_OK ? wh_outfile_commit(d->c, out) : code;
}

/* Cells below each other, without labels. */
static wh_code give_away(const wh_draw *d)
{
	const size_t bytes = (size_t)d->sheet.w * d->p->height * 4;
	wh_code code = WH_OK;
	for (int i = 0; code == WH_OK && i < d->p->ncells; i++) {
		const wh_picture_look look = {
		    .image = {d->sheet.w, d->p->height, d->sheet.rgba + bytes * (size_t)i},
		    .faces = d->cell[i].faces,
		    .vertices = d->cell[i].points,
		    .range = d->cell[i].range,
		    .distance_max = d->cell[i].distance_max};
		code = d->p->take(d->c, d->p->take_user, i, &look);
	}
	return code;
}

static wh_code make_picture(wh_draw *d, wh_outfile **out)
{
	wh_code code = open_files(d);
	d->c->mem->limit = d->memory > BASE_BYTES / 2 ? d->memory - BASE_BYTES / 2 : 1;
	if (code == WH_OK)
		code = draw_all(d);
	if (code == WH_E_IRREGULAR) {
		free_pixels(d);
		code = rewrite_files(d);
		if (code == WH_OK)
			code = draw_all(d);
	}
	close_files(d);
	if (code == WH_OK && d->p->distance_to)
		code = wh_draw_distances(d);
	if (code == WH_OK)
		code = wh_draw_sheet(d);
	if (code != WH_OK)
		return code;
	return d->p->take ? give_away(d) : write_picture(d, out);
}

wh_code wh_picture(wh_ctx *c, const wh_exec *ex, const wh_picture_params *p, wh_picture_report *r)
{
	wh_draw d = {
	    .c = c,
	    .p = p,
	    .ex = ex,
	    .r = r,
	    .memory = p->memory ? p->memory : wh_topo_memory() / 2,
	    .progress = {.fn = p->progress, .user = p->progress_user, .telling = ATOMIC_FLAG_INIT}};
	wh_outfile *out = NULL;
	wh_picture_params own = *p; /* a legend takes its place from the picture */
	const size_t old_limit = c->mem->limit;
	d.p = &own;
	wh_draw_lay_out(&d);
	if (!p->labels && d.legend < p->height / 2)
		own.height -= d.legend;
	*r = (wh_picture_report){0};
	if (wh_png_available(c) != WH_OK ||
	    (!p->take && wh_format_only(c, p->output, "png") != WH_OK))
		return c->err.code;
	c->mem->limit = d.memory > OPEN_BYTES ? d.memory - BASE_BYTES / 2 : OPEN_BYTES;
	wh_code code = wh_spill_open(c, &d.spill, p->temp_dir, "/tmp");
	if (code == WH_OK && !p->take)
		code = wh_outfile_open(c, &out, p->output, p->force);
	if (code == WH_OK)
		code = make_picture(&d, &out);
	wh_outfile_abort(c, &out);
	free_pixels(&d);
	wh_spill_close(c, &d.spill);
	c->mem->limit = old_limit;
	return code;
}
