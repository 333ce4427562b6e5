/*
 * Vertices that are doubled along the borders of a texture's charts, joined: the result is the same
 * however the work is cut.
 */
#define _XOPEN_SOURCE 700
#include "ply_files.h"

#include "base/real.h"
#include "pipeline/atlas.h"

#include <sys/stat.h>

/* A sheet of SIDE x SIDE squares, cut into charts along every EACH-th line. */
enum { SIDE = 60, EACH = 12, CHARTS = SIDE / EACH, ROW = SIDE + CHARTS, COPIES = ROW * ROW };
enum { PLACES = (SIDE + 1) * (SIDE + 1) };

/* The line of column or row i of the doubled sheet. */
static int line_of(int i)
{
	return i / (EACH + 1) * EACH + i % (EACH + 1);
}

/* Copies are scattered over the file. */
static int number_of(int i, int j)
{
	return (int)((int64_t)(i * ROW + j) * 1999 % COPIES);
}

static void put_vertex(ply_file *f, int i, int j)
{
	const int x = line_of(i), y = line_of(j);
	ply_value(f, WH_F32, x);
	ply_value(f, WH_F32, y);
	ply_value(f, WH_F32, x * y % 7);
	ply_value(f, WH_F32, i);
	ply_value(f, WH_F32, j);
	ply_value(f, WH_U8, (x + y) % 256);
}

static void put_square(ply_file *f, int i, int j)
{
	const int corner[2][3][2] = {{{0, 0}, {1, 0}, {1, 1}}, {{0, 0}, {1, 1}, {0, 1}}};
	for (int k = 0; k < 2; k++) {
		ply_value(f, WH_U8, 3);
		for (int n = 0; n < 3; n++)
			ply_value(f, WH_I32, number_of(i + corner[k][n][0], j + corner[k][n][1]));
	}
}

static ply_file write_sheet(void)
{
	static int at[COPIES];
	char text[512];
	ply_file f = ply_begin(WH_PLY_LE);
	(void)snprintf(text, sizeof text,
	               "element vertex %d\nproperty float x\nproperty float y\nproperty float z\n"
	               "property float s\nproperty float t\nproperty uchar quality\n"
	               "element face %d\nproperty list uchar int vertex_indices\n",
	               COPIES, 2 * SIDE * SIDE);
	ply_header(&f, text);
	for (int n = 0; n < COPIES; n++)
		at[number_of(n / ROW, n % ROW)] = n;
	for (int n = 0; n < COPIES; n++)
		put_vertex(&f, at[n] / ROW, at[n] % ROW);
	for (int i = 0; i + 1 < ROW; i++)
		for (int j = 0; j + 1 < ROW; j++)
			if (line_of(i) != line_of(i + 1) && line_of(j) != line_of(j + 1))
				put_square(&f, i, j);
	ply_end(&f);
	return f;
}

/* Joins the file; the bytes of the result, which the caller frees. */
static char *join(const char *path, int workers, uint64_t window, size_t *size,
                  wh_atlas_result *result)
{
	testing_env t;
	wh_spill spill;
	wh_input in;
	wh_source out;
	struct stat st;
	wh_progress progress = {.telling = ATOMIC_FLAG_INIT};
	int fd;
	testing_init(&t);
	const wh_exec ex = {.workers = workers};
	const wh_input_how how = {
	    .attributes = {NULL, WH_HOLDS_ALL | WH_HOLDS_FACES | WH_HOLDS_CORNERS}};
	assert_int_equal(wh_spill_open(&t.ctx, &spill, "/tmp", NULL), WH_OK);
	assert_int_equal(wh_input_open_how(&t.ctx, &ex, &spill, path, &how, &in), WH_OK);
	assert_true(in.apart);
	const wh_atlas_params p = {.rest = &in.attributes,
	                           .wedges = &in.wedges,
	                           .budget = (size_t)64 << 20,
	                           .window = window};
	wh_source source = in.source;
	source.attributes = &in.whole;
	if (wh_atlas_join(&t.ctx, &ex, &progress, &spill, &source, &p, &out, &fd, result) != WH_OK)
		fail_msg("%s", t.ctx.err.text);
	assert_int_equal(out.nv, PLACES);
	assert_int_equal(out.nf, 2 * SIDE * SIDE);
	assert_int_equal(fstat(fd, &st), 0);
	*size = (size_t)st.st_size;
	char *bytes = malloc(*size);
	assert_non_null(bytes);
	assert_int_equal(pread(fd, bytes, *size, 0), *size);
	wh_spill_close_scratch(&spill, fd);
	wh_input_close(&t.ctx, &spill, &in);
	assert_int_equal(spill.held, 0);
	wh_spill_close(&t.ctx, &spill);
	testing_done(&t);
	return bytes;
}

static void windows_and_workers_change_nothing(void **state)
{
	(void)state;
	static const struct {
		int workers;
		uint64_t window;
	} ways[] = {{3, COPIES}, {1, COPIES - 1}, {2, 1000}, {3, 333}, {1, 64}};
	ply_file f = write_sheet();
	wh_atlas_result once, again;
	size_t size, other;
	char *bytes = join(f.path, 1, 0, &size, &once);
	assert_int_equal(once.joined, COPIES - PLACES);
	assert_int_equal(once.degenerate_faces, 0);
	for (size_t i = 0; i < sizeof ways / sizeof *ways; i++) {
		char *same = join(f.path, ways[i].workers, ways[i].window, &other, &again);
		assert_int_equal(again.joined, once.joined);
		assert_int_equal(other, size);
		assert_memory_equal(same, bytes, size);
		free(same);
	}
	free(bytes);
	(void)unlink(f.path);
}

int main(void)
{
	const struct CMUnitTest tests[] = {cmocka_unit_test(windows_and_workers_change_nothing)};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
