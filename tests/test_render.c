/* Tiny renderings have the properties that pictures must have, whatever the shading. */
#define _POSIX_C_SOURCE 200809L
#include "ply_files.h"

#include "base/rng.h"
#include "algo/synth.h"
#include "io/png.h"
#include "pipeline/picture.h"

enum { SIDE = 64 };

/* ---- samples -------------------------------------------------------------------------------- */

/* The place of a sample among those of a canvas. */
static size_t at(int x, int y)
{
	const wh_canvas v = {SIDE, SIDE, 0, SIDE, NULL};
	return wh_canvas_row(&v, (uint32_t)y) + wh_canvas_column((uint32_t)x);
}

static void places_of_samples_are_all_different(void **state)
{
	(void)state;
	static bool taken[SIDE * SIDE];
	assert_int_equal(wh_canvas_samples(SIDE, SIDE), SIDE * SIDE);
	for (int y = 0; y < SIDE; y++)
		for (int x = 0; x < SIDE; x++) {
			assert_true(at(x, y) < SIDE * SIDE && !taken[at(x, y)]);
			taken[at(x, y)] = true;
		}
}

static wh_camera plain_camera(void)
{
	wh_camera k;
	assert_true(
	    wh_camera_open(&k, wh_v3(-1, -1, -1), wh_v3(1, 1, 1), (wh_view){0, 0}, WH_UP_Y, false));
	return k;
}

static wh_look plain_look(const wh_camera *k)
{
	return (wh_look){.camera = k, .base = {1, 1, 1}, .samples = 1, .radius = 2};
}

static wh_spot spot(double x, double y, double depth)
{
	return (wh_spot){(float)x, (float)y, (float)depth, 0};
}

static void draw(wh_sample *sample, const wh_look *look, wh_spot a, wh_spot b, wh_spot c)
{
	const wh_canvas v = {SIDE, SIDE, 0, SIDE, sample};
	const wh_spot *const corner[3] = {&a, &b, &c};
	wh_canvas_face(&v, look, corner, NULL, NULL);
}

static int count(const wh_sample *sample)
{
	int n = 0;
	for (int i = 0; i < SIDE * SIDE; i++)
		n += sample[i] != 0;
	return n;
}

static double coordinate(wh_rng *g)
{
	return (wh_rng_unit(g) - 0.5) * SIDE * 1.4;
}

/* With corners on samples, too, where the edges' rule has to decide. */
static void two_faces_of_an_edge_share_no_sample_and_miss_none(void **state)
{
	(void)state;
	const wh_camera k = plain_camera();
	const wh_look look = plain_look(&k);
	wh_rng g = wh_rng_seed(1);
	for (int turn = 0; turn < 2000; turn++) {
		static wh_sample one[SIDE * SIDE], other[SIDE * SIDE], both[SIDE * SIDE];
		wh_spot p[4];
		memset(one, 0, sizeof one);
		memset(other, 0, sizeof other);
		memset(both, 0, sizeof both);
		for (int i = 0; i < 4; i++) {
			p[i] = spot(coordinate(&g), coordinate(&g), 0);
			if (turn % 2)
				p[i] = spot(floor((double)p[i].x) + 0.5,
				            floor((double)p[i].y) + 0.5, 0);
		}
		/* a cut through the face 0 1 2, from 0 to a point between 1 and 2 */
		p[3] = spot(floor((double)(p[1].x + p[2].x) / 2), (double)p[1].y, 0);
		p[2] = spot(2 * (double)p[3].x - (double)p[1].x, (double)p[1].y, 0);
		draw(both, &look, p[0], p[1], p[2]);
		draw(one, &look, p[0], p[1], p[3]);
		draw(other, &look, p[3], p[2], p[0]);
		for (int i = 0; i < SIDE * SIDE; i++) {
			assert_false(one[i] && other[i]);
			assert_int_equal(one[i] || other[i], both[i] != 0);
		}
	}
}

static void a_sheet_of_faces_below_a_sample_has_no_holes(void **state)
{
	(void)state;
	enum { CELLS = 300 };
	const wh_camera k = plain_camera();
	const wh_look look = plain_look(&k);
	static wh_sample sample[SIDE * SIDE];
	static wh_spot p[CELLS + 1][CELLS + 1];
	wh_rng g = wh_rng_seed(2);
	for (int i = 0; i <= CELLS; i++)
		for (int j = 0; j <= CELLS; j++)
			p[i][j] = spot((i + wh_rng_unit(&g) * 0.8) * 0.22 - 33.1,
			               (j + wh_rng_unit(&g) * 0.8) * 0.22 - 33.1, 0);
	for (int i = 0; i < CELLS; i++)
		for (int j = 0; j < CELLS; j++) {
			draw(sample, &look, p[i][j], p[i + 1][j], p[i + 1][j + 1]);
			draw(sample, &look, p[i][j], p[i + 1][j + 1], p[i][j + 1]);
		}
	assert_int_equal(count(sample), SIDE * SIDE);
}

static void a_face_covers_as_much_as_its_area(void **state)
{
	(void)state;
	const wh_camera k = plain_camera();
	const wh_look look = plain_look(&k);
	static wh_sample sample[SIDE * SIDE];
	memset(sample, 0, sizeof sample);
	draw(sample, &look, spot(-20, -20, 0), spot(20, -20, 0), spot(-20, 20, 0));
	assert_in_range(count(sample), 780, 820);
	/* far beyond the picture on all sides */
	draw(sample, &look, spot(-9e5, -9e5, 1), spot(9e5, -8e5, 1), spot(0, 1e6, 1));
	assert_int_equal(count(sample), SIDE * SIDE);
}

static void faces_without_area_or_place_draw_nothing(void **state)
{
	(void)state;
	const wh_camera k = plain_camera();
	const wh_look look = plain_look(&k);
	static wh_sample sample[SIDE * SIDE];
	memset(sample, 0, sizeof sample);
	draw(sample, &look, spot(-20, -20, 0), spot(20, 20, 0), spot(0, 0, 0));
	draw(sample, &look, spot(3, 3, 0), spot(3, 3, 0), spot(3, 3, 0));
	draw(sample, &look, spot(-20, -20, 0), spot(20, -20, (double)NAN), spot(0, 30, 0));
	assert_int_equal(count(sample), 0);
}

/* Two slanted faces through each other: the nearer one everywhere, whichever came first. */
static void the_nearer_face_is_seen_in_any_order(void **state)
{
	(void)state;
	const wh_camera k = plain_camera();
	wh_look bright = plain_look(&k), dark = plain_look(&k);
	static wh_sample ab[SIDE * SIDE], ba[SIDE * SIDE], a[SIDE * SIDE];
	memset(ab, 0, sizeof ab);
	memset(ba, 0, sizeof ba);
	memset(a, 0, sizeof a);
	dark.base[0] = dark.base[1] = dark.base[2] = 0.1F;
	const wh_spot p[3] = {spot(-31, -31, -5), spot(31, -31, 5), spot(-31, 31, -5)};
	const wh_spot q[3] = {spot(-31, -31, 5), spot(31, -31, -5), spot(-31, 31, 5)};
	draw(a, &bright, p[0], p[1], p[2]);
	draw(ab, &bright, p[0], p[1], p[2]);
	draw(ab, &dark, q[0], q[1], q[2]);
	draw(ba, &dark, q[0], q[1], q[2]);
	draw(ba, &bright, p[0], p[1], p[2]);
	assert_memory_equal(ab, ba, sizeof ab);
	for (int y = 4; y < SIDE - 4; y++)
		for (int x = 4; x < SIDE - y - 4; x++)
			if (x < SIDE / 2 - 1 || x > SIDE / 2)
				assert_int_equal(ab[at(x, y)] == a[at(x, y)], x < SIDE / 2);
}

static void both_sides_of_a_face_look_the_same(void **state)
{
	(void)state;
	const wh_camera k = plain_camera();
	wh_look look = plain_look(&k);
	static wh_sample a[SIDE * SIDE], b[SIDE * SIDE];
	wh_rng g = wh_rng_seed(3);
	for (int turn = 0; turn < 50; turn++) {
		wh_spot p[3];
		memset(a, 0, sizeof a);
		memset(b, 0, sizeof b);
		for (int i = 0; i < 3; i++)
			p[i] = spot(coordinate(&g), coordinate(&g), coordinate(&g));
		draw(a, &look, p[0], p[1], p[2]);
		draw(b, &look, p[0], p[2], p[1]);
		for (int i = 0; i < SIDE * SIDE; i++) /* depth and colour within rounding */
			assert_true(llabs((long long)(a[i] >> 32) - (long long)(b[i] >> 32)) < 64);
	}
}

static void edges_are_drawn_darker(void **state)
{
	(void)state;
	const wh_camera k = plain_camera();
	wh_look look = plain_look(&k);
	static wh_sample a[SIDE * SIDE], b[SIDE * SIDE];
	memset(a, 0, sizeof a);
	memset(b, 0, sizeof b);
	const wh_spot p[3] = {spot(-30, -30, 0), spot(30, -30, 0), spot(-30, 30, 0)};
	look.samples = 4;
	draw(a, &look, p[0], p[1], p[2]);
	look.wireframe = true;
	draw(b, &look, p[0], p[1], p[2]);
	const size_t inside = at(20, 20), rim = at(20, 2);
	assert_true(a[inside] == b[inside]);
	assert_true((uint32_t)b[rim] < (uint32_t)a[rim]);
}

static void sums_of_normals_are_those_of_a_sphere(void **state)
{
	(void)state;
	/* a pyramid of six faces seen from above: its tip points at the viewer */
	const wh_camera k = plain_camera();
	wh_normal_sum sum = 0;
	wh_look look = plain_look(&k);
	static wh_sample flat[SIDE * SIDE], smooth[SIDE * SIDE];
	memset(flat, 0, sizeof flat);
	memset(smooth, 0, sizeof smooth);
	const wh_spot tip = spot(0, 0, -4);
	wh_spot ring[6];
	for (int i = 0; i < 6; i++)
		ring[i] = spot(20 * cos(i * 1.0471975512), -20 * sin(i * 1.0471975512), 0);
	for (int i = 0; i < 6; i++) {
		const wh_spot *const c[3] = {&tip, &ring[i], &ring[(i + 1) % 6]};
		wh_normal_sum add[3];
		wh_render_normals(&k, c, add);
		sum += add[0];
	}
	look.smooth = true;
	const wh_canvas v = {SIDE, SIDE, 0, SIDE, smooth};
	const wh_normal_sum *const sums[3] = {&sum, &sum, &sum};
	for (int i = 0; i < 6; i++) {
		const wh_spot *const c[3] = {&tip, &ring[i], &ring[(i + 1) % 6]};
		wh_canvas_face(&v, &look, c, sums, NULL);
	}
	const wh_spot level[3] = {spot(-31, -31, 9), spot(-31, 90, 9), spot(90, -31, 9)};
	look.smooth = false;
	draw(flat, &look, level[0], level[1], level[2]);
	for (int y = 24; y < 40; y++) /* as a level face's */
		for (int x = 24; x < 40; x++) {
			const uint32_t a = smooth[at(x, y)] & 1023, b = flat[at(x, y)] & 1023;
			assert_true(a + 4 > b && b + 4 > a);
		}
}

/* ---- pixels --------------------------------------------------------------------------------- */

static void slopes_are_even_and_grooves_are_hollow(void **state)
{
	(void)state;
	static wh_pixel p[SIDE * SIDE];
	float factor[SIDE];
	for (int groove = 0; groove < 2; groove++) {
		for (int y = 0; y < SIDE; y++)
			for (int x = 0; x < SIDE; x++) {
				const double depth =
				    groove ? -1.5 * fabs(x - 31.0) : 0.7 * x - 0.4 * y;
				p[y * SIDE + x] = (wh_pixel){.depth = (float)depth, .covered = 1};
			}
		wh_render_hollows(p, SIDE, SIDE, 1, 32, factor);
		for (int x = 4; x < SIDE - 4 && !groove; x++)
			assert_true(fabsf(factor[x] - 1) < 1e-4F);
		if (groove)
			assert_true(factor[31] < 0.7F && factor[20] > factor[31]);
	}
}

static void what_the_camera_shows_can_be_found_again(void **state)
{
	(void)state;
	wh_rng g = wh_rng_seed(4);
	for (int turn = 0; turn < 500; turn++) {
		wh_camera k;
		const wh_view view = {wh_rng_unit(&g) * 360, wh_rng_unit(&g) * 180 - 90};
		const double lo[2] = {-0.4, -0.9}, hi[2] = {0.8, 0.7};
		assert_true(wh_camera_open(&k, wh_v3(4e6, -5, 2), wh_v3(4e6 + 10, 3, 9), view,
		                           (wh_up)(turn % 3), turn % 2));
		wh_camera_fit(&k, lo, hi, 4000, 3000, 1.3);
		const wh_vec3 p = wh_v3(4e6 + 10 * wh_rng_unit(&g), 8 * wh_rng_unit(&g) - 5,
		                        2 + 7 * wh_rng_unit(&g));
		const wh_vec3 q = wh_camera_unproject(&k, wh_camera_project(&k, p));
		assert_true(wh_norm(wh_sub(p, q)) < 1e-7);
	}
}

static void straight_views_show_the_axes(void **state)
{
	(void)state;
	wh_camera k;
	const wh_vec3 lo = {-1, -1, -1}, hi = {1, 1, 1};
	assert_true(wh_camera_open(&k, lo, hi, (wh_view){0, 0}, WH_UP_Z, false));
	assert_true(k.right.x == 1 && k.up.z == 1 && k.back.y == -1);
	assert_true(wh_camera_open(&k, lo, hi, (wh_view){90, 0}, WH_UP_Y, false));
	assert_true(k.back.x == 1 && k.up.y == 1 && k.right.z == -1);
	assert_true(wh_camera_open(&k, lo, hi, (wh_view){0, 90}, WH_UP_Y, false));
	assert_true(k.back.y == 1 && k.up.z == -1 && k.right.x == 1);
	assert_false(wh_camera_open(&k, lo, lo, (wh_view){0, 0}, WH_UP_Y, false));
}

/* ---- files ---------------------------------------------------------------------------------- */

static const char picture_path[] = "/tmp/whittle-test-render.png";

static void need_png(testing_env *t)
{
	if (wh_png_available(&t->ctx) != WH_OK) {
		print_message("%s: skipped\n", t->ctx.err.text);
		skip();
	}
}

static wh_picture_params params_of(const char *const *path, const wh_picture_cell *cell)
{
	return (wh_picture_params){.paths = path,
	                           .npaths = 1,
	                           .output = picture_path,
	                           .force = true,
	                           .cells = cell,
	                           .ncells = 1,
	                           .width = 80,
	                           .height = 60,
	                           .samples = 3,
	                           .up = WH_UP_GUESS,
	                           .zoom = 1,
	                           .temp_dir = "/tmp",
	                           .background = {255, 255, 255, 255}};
}

/* Bytes of the picture that these parameters give; wh_free. */
static uint8_t *render(testing_env *t, const wh_picture_params *p, int workers, size_t *n,
                       wh_picture_report *r)
{
	const wh_exec ex = {.workers = workers};
	if (wh_picture(&t->ctx, &ex, p, r) != WH_OK)
		fail_msg("%s", t->ctx.err.text);
	FILE *f = fopen(p->output, "rb");
	assert_non_null(f);
	enum { MOST = 1 << 20 };
	uint8_t *bytes = wh_alloc(&t->ctx, MOST, 1);
	*n = fread(bytes, 1, MOST, f);
	assert_true(*n > 100 && *n < MOST);
	(void)fclose(f);
	return bytes;
}

static void make_sphere(testing_env *t, const char *path, uint64_t faces, bool shuffled)
{
	wh_synth_params p = wh_synth_defaults();
	wh_synth *s = NULL;
	wh_outfile *o = NULL;
	const wh_exec ex = {.workers = 1};
	p.faces = faces;
	p.shuffled = shuffled;
	assert_int_equal(wh_synth_open(&t->ctx, &s, &p), WH_OK);
	assert_int_equal(wh_outfile_open(&t->ctx, &o, path, true), WH_OK);
	assert_int_equal(wh_synth_write(&t->ctx, &ex, s, o), WH_OK);
	assert_int_equal(wh_outfile_commit(&t->ctx, &o), WH_OK);
	wh_synth_close(&t->ctx, &s);
}

static void bytes_do_not_depend_on_threads_windows_and_bands(void **state)
{
	(void)state;
	testing_env t;
	testing_init(&t);
	need_png(&t);
	static const char path[] = "/tmp/whittle-test-render.ply";
	const char *const paths[] = {path};
	const wh_picture_cell cell = {0};
	wh_picture_params p = params_of(paths, &cell);
	wh_picture_report r;
	for (int kind = 0; kind < 4; kind++) {
		size_t n, m;
		make_sphere(&t, path, 30000, kind % 2);
		p.window = p.band = 0;
		p.flat = kind == 2;
		p.wireframe = kind == 3;
		p.perspective = kind == 1;
		uint8_t *whole = render(&t, &p, 1, &n, &r);
		assert_int_equal(r.bands, 1);
		assert_int_equal(r.windows, 1);
		for (int workers = 1; workers <= 3; workers++) {
			p.window = workers == 1 ? 0 : 4000;
			p.band = (uint32_t)(13 * (workers - 1));
			uint8_t *parts = render(&t, &p, workers, &m, &r);
			assert_int_equal(n, m);
			assert_memory_equal(whole, parts, n);
			wh_free(&t.ctx, parts);
		}
		assert_int_equal(r.windows, 4);
		assert_int_equal(r.bands, 3);
		wh_free(&t.ctx, whole);
	}
	(void)unlink(path);
	(void)unlink(picture_path);
	testing_done(&t);
}

/* A square, and what else is asked for, as text. */
static wh_picture_report render_text(const char *text, bool expect, const char *words)
{
	testing_env t;
	testing_init(&t);
	need_png(&t);
	ply_file f = ply_write(text);
	const char *const paths[] = {f.path};
	const wh_picture_cell cell = {.own_view = true};
	wh_picture_params p = params_of(paths, &cell);
	p.up = WH_UP_Y;
	const wh_exec ex = {.workers = 1};
	wh_picture_report r;
	const wh_code code = wh_picture(&t.ctx, &ex, &p, &r);
	if ((code == WH_OK) != expect)
		fail_msg("%d %s", code, t.ctx.err.text);
	if (words && !strstr(t.ctx.err.text, words))
		fail_msg("no '%s' in: %s", words, t.ctx.err.text);
	(void)unlink(f.path);
	(void)unlink(picture_path);
	testing_done(&t);
	return r;
}

#define POSITIONS "property float x\nproperty float y\nproperty float z\n"
#define FACES "property list uchar int vertex_indices\n"

static void a_square_covers_its_share_of_the_picture(void **state)
{
	(void)state;
	const wh_picture_report r = render_text(
	    "ply\nformat ascii 1.0\nelement vertex 4\n" POSITIONS "element face 1\n" FACES
	    "end_header\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3\n",
	    true, NULL);
	const double side = 60 * 0.92;
	assert_true((double)r.covered > (side - 1) * (side - 1));
	assert_true((double)r.covered < (side + 2) * (side + 2));
	assert_int_equal(r.faces, 2);
}

static void a_vertex_far_away_does_not_make_the_rest_vanish(void **state)
{
	(void)state;
	const wh_picture_report r = render_text(
	    "ply\nformat ascii 1.0\nelement vertex 9\n" POSITIONS "element face 4\n" FACES
	    "end_header\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n0 0 1\n1 0 1\n1 1 1\n0 1 1\n-1e30 0 3e29\n"
	    "4 0 1 2 3\n4 4 5 6 7\n3 0 1 4\n3 4 5 8\n",
	    true, NULL);
	assert_true(r.covered > 55 * 55);
}

static void a_cloud_of_points_is_drawn(void **state)
{
	(void)state;
	wh_picture_report r = render_text("ply\nformat ascii 1.0\nelement vertex 3\n" POSITIONS
	                                  "end_header\n0 0 0\n1 0 0\n0 1 0\n",
	                                  true, NULL);
	assert_int_equal(r.faces, 0);
	assert_in_range(r.covered, 3 * 30, 3 * 90);
}

static void what_cannot_be_drawn_is_refused_in_words(void **state)
{
	(void)state;
	(void)render_text("ply\nformat ascii 1.0\nelement vertex 3\n" POSITIONS
	                  "element face 1\n" FACES "end_header\n1 2 3\n1 2 3\n1 2 3\n3 0 1 2\n",
	                  false, "has no size");
	(void)render_text("ply\nformat ascii 1.0\nelement vertex 3\n" POSITIONS
	                  "element face 1\n" FACES "end_header\n1 2 3\nnan 2 3\n1 2 4\n3 0 1 2\n",
	                  false, "vertex 1");
	(void)render_text("ply\nformat ascii 1.0\nelement vertex 0\n" POSITIONS "end_header\n",
	                  false, "no vertices");
	(void)render_text("ply\nformat ascii 1.0\nelement vertex 1\n" POSITIONS
	                  "element face 1\n" FACES "end_header\n1 2 3\n3 0 1 2\n",
	                  false, "out of range");
}

static void refused_memory_leaves_nothing_behind(void **state)
{
	(void)state;
	testing_env t;
	testing_init(&t);
	need_png(&t);
	ply_file f =
	    ply_write("ply\nformat ascii 1.0\nelement vertex 4\n" POSITIONS "element face 2\n" FACES
	              "end_header\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2\n3 0 2 3\n");
	const char *const paths[] = {f.path};
	const wh_picture_cell cell = {0};
	wh_picture_params p = params_of(paths, &cell);
	p.distance_to = f.path;
	p.window = 2;
	const wh_exec ex = {.workers = 1};
	wh_picture_report r;
	wh_code code = WH_E_RUN;
	for (long i = 1; code != WH_OK; i++) {
		assert_true(i < 1000);
		t.ctx.err = (wh_error){0};
		t.mem.fail_after = i;
		code = wh_picture(&t.ctx, &ex, &p, &r);
		t.mem.fail_after = 0;
		assert_int_equal((size_t)t.mem.used, 0);
		if (code != WH_OK) {
			assert_int_not_equal(t.ctx.err.code, WH_OK);
			assert_int_not_equal(access(picture_path, F_OK), 0);
		}
	}
	if (!(r.distance_max < 5e-6))
		fail_msg("%g", r.distance_max);
	(void)unlink(f.path);
	(void)unlink(picture_path);
	testing_done(&t);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	    cmocka_unit_test(places_of_samples_are_all_different),
	    cmocka_unit_test(two_faces_of_an_edge_share_no_sample_and_miss_none),
	    cmocka_unit_test(a_sheet_of_faces_below_a_sample_has_no_holes),
	    cmocka_unit_test(a_face_covers_as_much_as_its_area),
	    cmocka_unit_test(faces_without_area_or_place_draw_nothing),
	    cmocka_unit_test(the_nearer_face_is_seen_in_any_order),
	    cmocka_unit_test(both_sides_of_a_face_look_the_same),
	    cmocka_unit_test(edges_are_drawn_darker),
	    cmocka_unit_test(sums_of_normals_are_those_of_a_sphere),
	    cmocka_unit_test(slopes_are_even_and_grooves_are_hollow),
	    cmocka_unit_test(what_the_camera_shows_can_be_found_again),
	    cmocka_unit_test(straight_views_show_the_axes),
	    cmocka_unit_test(bytes_do_not_depend_on_threads_windows_and_bands),
	    cmocka_unit_test(a_square_covers_its_share_of_the_picture),
	    cmocka_unit_test(a_vertex_far_away_does_not_make_the_rest_vanish),
	    cmocka_unit_test(a_cloud_of_points_is_drawn),
	    cmocka_unit_test(what_cannot_be_drawn_is_refused_in_words),
	    cmocka_unit_test(refused_memory_leaves_nothing_behind),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
