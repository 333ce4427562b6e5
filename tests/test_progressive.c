/*
 * Progressive meshes: the base is what reduce leaves, the finest level what it was given; levels
 * have the same bytes from either side and are clean; properties, large fans, threads; damage and
 * what cannot be recorded.
 */
#define _XOPEN_SOURCE 700
#include "reduce_files.h"

#include "mesh/check.h"
#include "pipeline/normalise.h"

#include <math.h>

#define XXH_INLINE_ALL
#include <xxhash.h>

typedef struct record {
	fixture f;
	char pmesh[96], level[96];
	wh_replay *replay;
	wh_replay_info info;
} record;

static void name_files(record *r)
{
	(void)snprintf(r->pmesh, sizeof r->pmesh, "%.60s/a.pmesh", r->f.root);
	(void)snprintf(r->level, sizeof r->level, "%.60s/level.ply", r->f.root);
}

static void open_record(record *r, wh_synth_kind kind, uint64_t faces)
{
	const wh_synth_params s = surface(kind, faces);
	*r = (record){0};
	make(&r->f, &s);
	name_files(r);
}

/* Reduces the input to f.out, and records the same to r->pmesh. */
static void reduce_and_record(record *r)
{
	wh_reduce_params *p = &r->f.params;
	assert_int_equal(reduce(&r->f), WH_OK);
	p->output = r->pmesh;
	p->progressive = true;
	assert_int_equal(reduce(&r->f), WH_OK);
	p->output = r->f.out;
	p->progressive = false;
	assert_int_equal(entries(r->f.temp), 0);
}

static void play(record *r)
{
	assert_int_equal(wh_replay_open(&r->f.t.ctx, &r->replay, r->pmesh, (size_t)256 << 20),
	                 WH_OK);
	wh_replay_tell(r->replay, &r->info);
}

static void done(record *r)
{
	wh_replay_close(&r->f.t.ctx, &r->replay);
	drop(&r->f);
}

/* Goes to a level and writes it. */
static void write_level(record *r, uint64_t level, const char *path, char checksum[33])
{
	const wh_replay_output out = {.path = path, .force = true};
	assert_int_equal(wh_replay_seek(&r->f.t.ctx, r->replay, level), WH_OK);
	assert_int_equal(wh_replay_write(&r->f.t.ctx, r->replay, &out, checksum), WH_OK);
}

/* A sum over the faces, from whichever corner they begin and in whichever order they are. */
static uint64_t sum_of_faces(record *r, const char *path)
{
	uint64_t sum = 0;
	wh_mesh m = load_mesh(&r->f, path);
	for (uint32_t f = 0; f < m.nf; f++)
		for (uint32_t k = 0; k < 3; k++) {
			wh_vec3 at[3];
			for (uint32_t i = 0; i < 3; i++)
				at[i] = m.pos[m.tri[3 * f + (k + i) % 3]];
			sum += XXH3_64bits(at, sizeof at);
		}
	wh_mesh_free(&r->f.t.ctx, &m);
	return sum;
}

/* ---- what a record holds ---- */

static void the_ends_are_input_and_result(void **state)
{
	(void)state;
	for (int k = 0; k < 4; k++) {
		record r;
		open_record(&r, k & 1 ? WH_SYNTH_TERRAIN : WH_SYNTH_SPHERE, 10000);
		r.f.params.faces = 800;
		r.f.params.cluster_faces = k & 2 ? 2000 : 0;
		r.f.params.round_keep = k & 2 ? 0.5 : 0;
		reduce_and_record(&r);
		play(&r);
		assert_int_equal(r.info.faces, r.f.report.input_faces);
		assert_int_equal(r.info.base_faces, 800);
		assert_int_equal(r.info.splits, r.f.report.collapses);
		assert_true(r.info.base_error > 0);
		write_level(&r, 0, r.level, NULL);
		same_bytes(r.level, r.f.out);
		write_level(&r, UINT64_MAX, r.level, NULL);
		assert_int_equal(sum_of_faces(&r, r.level), sum_of_faces(&r, r.f.in));
		write_level(&r, 0, r.level, NULL);
		same_bytes(r.level, r.f.out);
		done(&r);
	}
}

enum { STEPS = 12 };

static void levels_are_the_same_from_both_sides_and_clean(void **state)
{
	(void)state;
	char up[STEPS + 1][33], down[33];
	record r;
	open_record(&r, WH_SYNTH_TERRAIN, 12000);
	r.f.params.faces = 500;
	reduce_and_record(&r);
	play(&r);
	double error = INFINITY;
	for (uint64_t i = 0; i <= STEPS; i++) {
		wh_check found;
		write_level(&r, i * r.info.splits / STEPS, r.level, up[i]);
		wh_mesh m = load_mesh(&r.f, r.level);
		wh_replay_tell(r.replay, &r.info);
		assert_int_equal(m.nf, r.info.level_faces);
		assert_int_equal(m.nv, r.info.level_vertices);
		assert_int_equal(wh_check_mesh(&r.f.t.ctx, &m, &found), WH_OK);
		assert_true(wh_check_clean(&found));
		assert_int_equal(found.components, 1);
		assert_true(r.info.level_error <= error);
		error = r.info.level_error;
		wh_mesh_free(&r.f.t.ctx, &m);
	}
	for (uint64_t i = STEPS + 1; i-- > 0;) {
		write_level(&r, i * r.info.splits / STEPS, r.level, down);
		assert_string_equal(down, up[i]);
	}
	done(&r);
}

static void threads_change_no_byte(void **state)
{
	(void)state;
	char first[33];
	record r;
	open_record(&r, WH_SYNTH_SPHERE, 10000);
	r.f.params.faces = 600;
	reduce_and_record(&r);
	memcpy(first, r.f.report.checksum, sizeof first);
	r.f.params.threads = 1;
	reduce_and_record(&r);
	assert_string_equal(first, r.f.report.checksum);
	drop(&r.f);
}

/* What is sorted is held in memory, or is not. */
static void memory_changes_no_byte(void **state)
{
	(void)state;
	char first[33];
	record r;
	open_record(&r, WH_SYNTH_TERRAIN, 60000);
	r.f.params.faces = 600;
	r.f.params.cluster_faces = 8000;
	r.f.params.micro_faces = 0;
	r.f.params.round_keep = 0.5;
	reduce_and_record(&r);
	memcpy(first, r.f.report.checksum, sizeof first);
	assert_true(r.f.report.rounds > 2);
	const uint64_t temp = r.f.report.temp_bytes_peak;
	r.f.params.memory = (size_t)26 << 20;
	reduce_and_record(&r);
	assert_string_equal(first, r.f.report.checksum);
	assert_true(r.f.report.temp_bytes_peak > temp);
	drop(&r.f);
}

static void levels_keep_their_limits(void **state)
{
	(void)state;
	record r;
	uint64_t level;
	bool reached;
	open_record(&r, WH_SYNTH_TERRAIN, 8000);
	r.f.params.faces = 500;
	reduce_and_record(&r);
	play(&r);
	wh_ctx *c = &r.f.t.ctx;
	for (uint64_t faces = 501; faces < 8000; faces += 777) {
		const wh_level l = {.faces = faces};
		assert_int_equal(wh_replay_find(c, r.replay, &l, &level, &reached), WH_OK);
		assert_true(reached);
		assert_int_equal(wh_replay_seek(c, r.replay, level), WH_OK);
		wh_replay_tell(r.replay, &r.info);
		assert_in_range(r.info.level_faces, faces - 1, faces);
	}
	for (double share = 0.0005; share < 0.02; share *= 2) {
		const wh_level l = {.error_share = share};
		const double error = share * r.info.diagonal;
		assert_int_equal(wh_replay_find(c, r.replay, &l, &level, &reached), WH_OK);
		assert_int_equal(wh_replay_seek(c, r.replay, level), WH_OK);
		wh_replay_tell(r.replay, &r.info);
		assert_true(r.info.level_error <= error);
		if (level > 0) {
			assert_int_equal(wh_replay_seek(c, r.replay, level - 1), WH_OK);
			wh_replay_tell(r.replay, &r.info);
			assert_true(r.info.level_error > error);
		}
	}
	const wh_level vertices = {.vertices = 1000}, less = {.faces = 499};
	assert_int_equal(wh_replay_find(c, r.replay, &vertices, &level, &reached), WH_OK);
	assert_int_equal(level + r.info.base_vertices, 1000);
	assert_int_equal(wh_replay_find(c, r.replay, &less, &level, &reached), WH_OK);
	assert_false(reached);
	assert_int_equal(level, 0);
	done(&r);
}

/* ---- other meshes ---- */

/* A disc of rings around one vertex, with properties of every form; the middle has more faces than
 * a vertex may have neighbours. */
static void write_disc(const char *path, int sectors, int rings)
{
	FILE *f = fopen(path, "w");
	assert_non_null(f);
	(void)fprintf(f,
	              "ply\nformat ascii 1.0\nelement vertex %d\nproperty float nx\n"
	              "property float x\nproperty float y\nproperty uchar red\n"
	              "property float z\nproperty double quality\nproperty short label\n"
	              "property uint intensity\nelement face %d\n"
	              "property list uchar int vertex_indices\nend_header\n",
	              1 + sectors * rings, sectors * (2 * rings - 1));
	(void)fprintf(f, "0.5 0 0 7 0 0.1 -3 9\n");
	for (int k = 0; k < rings; k++)
		for (int i = 0; i < sectors; i++) {
			const double a = 6.283185307179586 * i / sectors, d = k + 1;
			(void)fprintf(f, "%.9g %.9g %.9g %d %.9g %.17g %d %d\n", cos(a), d * cos(a),
			              d * sin(a), (i * 7 + k * 40) % 256, 0.05 * sin(3 * a) * d * d,
			              a / 3, i % 5 - 2, i * 1000 + k);
		}
	for (int i = 0; i < sectors; i++) {
		const int next = (i + 1) % sectors;
		(void)fprintf(f, "3 0 %d %d\n", 1 + i, 1 + next);
		for (int k = 0; k + 1 < rings; k++) {
			const int a = 1 + k * sectors + i, b = 1 + k * sectors + next;
			(void)fprintf(f, "3 %d %d %d\n3 %d %d %d\n", a, a + sectors, b, b,
			              a + sectors, b + sectors);
		}
	}
	(void)fclose(f);
}

/* A sum over the vertices of the finest level with all they carry, in whichever order they are. */
static uint64_t sum_of_vertices(record *r)
{
	uint64_t sum = 0;
	char line[256];
	const wh_replay_output out = {.path = r->level, .force = true, .ascii = true};
	assert_int_equal(wh_replay_seek(&r->f.t.ctx, r->replay, UINT64_MAX), WH_OK);
	assert_int_equal(wh_replay_write(&r->f.t.ctx, r->replay, &out, NULL), WH_OK);
	FILE *f = fopen(r->level, "r");
	assert_non_null(f);
	while (fgets(line, sizeof line, f) && strcmp(line, "end_header\n") != 0)
		continue;
	for (uint64_t v = 0; v < r->info.vertices; v++) {
		assert_non_null(fgets(line, sizeof line, f));
		sum += XXH3_64bits(line, strlen(line));
	}
	(void)fclose(f);
	return sum;
}

static void properties_and_large_fans_come_back(void **state)
{
	(void)state;
	char finest[33], again[33];
	record r = {0};
	open_fixture(&r.f);
	name_files(&r);
	write_disc(r.f.in, 300, 6);
	r.f.params.faces = 330;
	r.f.params.cluster_faces = 0;
	reduce_and_record(&r);
	play(&r);
	assert_true(isfinite(r.info.base_error));
	write_level(&r, 0, r.level, NULL);
	same_bytes(r.level, r.f.out);
	write_level(&r, UINT64_MAX, r.level, finest);
	assert_int_equal(sum_of_faces(&r, r.level), sum_of_faces(&r, r.f.in));
	write_level(&r, r.info.splits / 2, r.level, NULL);
	write_level(&r, UINT64_MAX, r.level, again);
	assert_string_equal(again, finest);
	const uint64_t sum = sum_of_vertices(&r);
	wh_replay_close(&r.f.t.ctx, &r.replay);
	r.f.params.faces = UINT32_MAX; /* nothing is collapsed: the base is the input */
	reduce_and_record(&r);
	play(&r);
	assert_int_equal(r.info.splits, 0);
	assert_true(sum == sum_of_vertices(&r));
	done(&r);
}

/* Formats that hold less get the bytes that reduce writes, too. */
static void other_formats_are_those_of_reduce(void **state)
{
	(void)state;
	static const char *const to[] = {"obj", "off", "stl", "glb"};
	record r = {0};
	open_fixture(&r.f);
	name_files(&r);
	write_disc(r.f.in, 40, 5);
	r.f.params.faces = 100;
	reduce_and_record(&r);
	play(&r);
	for (size_t k = 0; k < sizeof to / sizeof *to; k++) {
		const wh_replay_output out = {.path = r.level, .to = to[k], .force = true};
		r.f.params.to = to[k];
		r.f.params.attributes = "none"; /* so that all go by the same order */
		assert_int_equal(wh_replay_write(&r.f.t.ctx, r.replay, &out, NULL), WH_OK);
		assert_int_equal(reduce(&r.f), WH_OK);
		same_bytes(r.level, r.f.out);
	}
	done(&r);
}

/* ---- between two levels ---- */

static void make_morph(record *r, uint64_t from, uint64_t to)
{
	assert_int_equal(wh_replay_morph(&r->f.t.ctx, r->replay, from, to), WH_OK);
}

static void write_morph(record *r, double t, char checksum[33])
{
	const wh_replay_output out = {.path = r->level, .force = true};
	assert_int_equal(wh_replay_write_morph(&r->f.t.ctx, r->replay, t, &out, checksum), WH_OK);
}

static bool same_place(wh_vec3 a, wh_vec3 b)
{
	return a.x == b.x && a.y == b.y && a.z == b.z;
}

/* The same sum over the faces of a morph whose corners are at three places. */
static uint64_t sum_of_open_faces(record *r)
{
	uint64_t sum = 0;
	wh_mesh m = load_mesh(&r->f, r->level);
	for (uint32_t f = 0; f < m.nf; f++)
		for (uint32_t k = 0; k < 3; k++) {
			wh_vec3 at[3];
			for (uint32_t i = 0; i < 3; i++)
				at[i] = m.pos[m.tri[3 * f + (k + i) % 3]];
			if (!same_place(at[0], at[1]) && !same_place(at[1], at[2]) &&
			    !same_place(at[2], at[0]))
				sum += XXH3_64bits(at, sizeof at);
		}
	wh_mesh_free(&r->f.t.ctx, &m);
	return sum;
}

static void a_morph_begins_and_ends_at_its_levels(void **state)
{
	(void)state;
	char fine[33], got[33];
	record r;
	open_record(&r, WH_SYNTH_TERRAIN, 6000);
	r.f.params.faces = 300;
	reduce_and_record(&r);
	play(&r);
	const uint64_t a = r.info.splits / 9, b = 2 * r.info.splits / 3;
	write_level(&r, b, r.level, fine);
	write_level(&r, a, r.level, NULL);
	const uint64_t coarse = sum_of_faces(&r, r.level);
	for (int back = 0; back < 2; back++) {
		make_morph(&r, back ? b : a, back ? a : b);
		write_morph(&r, back ? 0 : 1, got);
		assert_string_equal(got, fine);
		write_morph(&r, back ? 1 : 0, got);
		assert_string_not_equal(got, fine);
		assert_true(sum_of_open_faces(&r) == coarse);
	}
	make_morph(&r, b, b);
	write_morph(&r, 0.5, got);
	assert_string_equal(got, fine);
	write_level(&r, b, r.level, got);
	assert_string_equal(got, fine);
	done(&r);
}

static void vertices_go_straight(void **state)
{
	(void)state;
	record r;
	wh_mesh m[3];
	uint32_t moving = 0;
	open_record(&r, WH_SYNTH_SPHERE, 2000);
	r.f.params.faces = 200;
	reduce_and_record(&r);
	play(&r);
	make_morph(&r, 0, UINT64_MAX);
	for (int k = 0; k < 3; k++) {
		write_morph(&r, k * k * 0.25, NULL); /* 0, 0.25, 1 */
		m[k] = load_mesh(&r.f, r.level);
		assert_int_equal(m[k].nv, r.info.vertices);
	}
	for (uint32_t v = 0; v < m[0].nv; v++) {
		const wh_vec3 way = wh_sub(m[2].pos[v], m[0].pos[v]);
		const wh_vec3 off = wh_sub(m[1].pos[v], wh_add(m[0].pos[v], wh_scale(way, 0.25)));
		assert_true(wh_norm(off) <= 1e-6 * r.info.diagonal);
		moving += wh_norm(way) > 0;
	}
	assert_true(moving > m[0].nv / 2);
	for (int k = 0; k < 3; k++)
		wh_mesh_free(&r.f.t.ctx, &m[k]);
	done(&r);
}

/* A hill with normals, colours and labels. */
static void write_hill(const char *path, int side)
{
	FILE *f = fopen(path, "w");
	assert_non_null(f);
	(void)fprintf(
	    f,
	    "ply\nformat ascii 1.0\nelement vertex %d\nproperty float x\nproperty float y\n"
	    "property float z\nproperty float nx\nproperty float ny\nproperty float nz\n"
	    "property uchar red\nproperty int label\nelement face %d\n"
	    "property list uchar int vertex_indices\nend_header\n",
	    side * side, 2 * (side - 1) * (side - 1));
	for (int i = 0; i < side * side; i++) {
		const double x = 2.0 * (i % side) / (side - 1) - 1,
		             y = 2.0 * (i / side) / (side - 1) - 1;
		const double n = sqrt(1 + 4 * x * x + 4 * y * y);
		(void)fprintf(f, "%.9g %.9g %.9g %.9g %.9g %.9g %d %d\n", x, y, 2 - x * x - y * y,
		              2 * x / n, 2 * y / n, 1 / n, (i * 37) % 256, i % 3);
	}
	for (int y = 0; y + 1 < side; y++)
		for (int x = 0; x + 1 < side; x++) {
			const int a = y * side + x;
			(void)fprintf(f, "3 %d %d %d\n3 %d %d %d\n", a, a + 1, a + side, a + 1,
			              a + side + 1, a + side);
		}
	(void)fclose(f);
}

typedef struct hill_vertex {
	wh_vec3 at, normal;
	int red, label;
} hill_vertex;

/* The vertices of a morph. */
static void read_hill(record *r, double t, uint32_t n, hill_vertex *v)
{
	char line[256];
	const wh_replay_output out = {.path = r->level, .force = true, .ascii = true};
	assert_int_equal(wh_replay_write_morph(&r->f.t.ctx, r->replay, t, &out, NULL), WH_OK);
	FILE *f = fopen(r->level, "r");
	assert_non_null(f);
	while (fgets(line, sizeof line, f) && strcmp(line, "end_header\n") != 0)
		continue;
	for (uint32_t i = 0; i < n; i++)
		assert_int_equal(fscanf(f, "%lf%lf%lf%lf%lf%lf%d%d", &v[i].at.x, &v[i].at.y,
		                        &v[i].at.z, &v[i].normal.x, &v[i].normal.y, &v[i].normal.z,
		                        &v[i].red, &v[i].label),
		                 8);
	(void)fclose(f);
}

static double angle(wh_vec3 a, wh_vec3 b)
{
	return atan2(wh_norm(wh_cross(a, b)), wh_dot(a, b));
}

enum { HILL = 15, HILL_VERTICES = HILL * HILL };

static void normals_turn_evenly_and_labels_jump(void **state)
{
	(void)state;
	record r = {0};
	static hill_vertex from[HILL_VERTICES], to[HILL_VERTICES], mid[HILL_VERTICES];
	uint32_t turning = 0;
	open_fixture(&r.f);
	name_files(&r);
	write_hill(r.f.in, HILL);
	r.f.params.faces = 60;
	r.f.params.cluster_faces = 0;
	reduce_and_record(&r);
	play(&r);
	make_morph(&r, 0, UINT64_MAX);
	read_hill(&r, 0, HILL_VERTICES, from);
	read_hill(&r, 1, HILL_VERTICES, to);
	read_hill(&r, 0.75, HILL_VERTICES, mid);
	for (uint32_t v = 0; v < HILL_VERTICES; v++) {
		const double all = angle(from[v].normal, to[v].normal);
		assert_true(fabs(wh_norm(mid[v].normal) - 1) < 1e-5);
		assert_true(fabs(angle(from[v].normal, mid[v].normal) - 0.75 * all) < 1e-5);
		assert_true(fabs(angle(mid[v].normal, to[v].normal) - 0.25 * all) < 1e-5);
		assert_true(fabs(mid[v].red - 0.25 * from[v].red - 0.75 * to[v].red) <= 0.8);
		assert_int_equal(mid[v].label, to[v].label);
		turning += all > 0.1;
	}
	assert_true(turning > 10);
	done(&r);
}

static void what_is_no_morph_is_refused(void **state)
{
	(void)state;
	record r;
	open_record(&r, WH_SYNTH_SPHERE, 2000);
	r.f.params.faces = 200;
	reduce_and_record(&r);
	play(&r);
	wh_ctx *c = &r.f.t.ctx;
	const wh_replay_output out = {.path = r.level, .force = true};
	static const double wrong[] = {-0.01, 1.01, NAN, INFINITY};
	assert_int_equal(wh_replay_write_morph(c, r.replay, 0, &out, NULL), WH_E_USAGE);
	make_morph(&r, 0, 100);
	for (size_t i = 0; i < sizeof wrong / sizeof *wrong; i++)
		assert_int_equal(wh_replay_write_morph(c, r.replay, wrong[i], &out, NULL),
		                 WH_E_USAGE);
	assert_int_equal(wh_replay_seek(c, r.replay, 5), WH_OK);
	assert_int_equal(wh_replay_write_morph(c, r.replay, 0, &out, NULL), WH_E_USAGE);
	assert_int_equal(access(r.level, F_OK), -1);
	done(&r);
}

/* ---- text ---- */

/* Every line is a collapse: vertices and faces that are there, each of which goes once. */
static void the_text_tells_every_collapse(void **state)
{
	(void)state;
	char path[96];
	record r;
	open_record(&r, WH_SYNTH_TERRAIN, 3000);
	r.f.params.faces = 300;
	reduce_and_record(&r);
	play(&r);
	(void)snprintf(path, sizeof path, "%.60s/text", r.f.root);
	assert_int_equal(wh_replay_seek(&r.f.t.ctx, r.replay, UINT64_MAX), WH_OK);
	assert_int_equal(wh_replay_text(&r.f.t.ctx, r.replay, 0, path, false), WH_OK);
	FILE *f = fopen(path, "r");
	assert_non_null(f);
	uint64_t faces = r.info.faces, lines = 0;
	unsigned long u, v, n, id;
	double x, y, z;
	while (fscanf(f, "%lu %lu %lf %lf %lf %lu", &u, &v, &x, &y, &z, &n) == 6) {
		lines++;
		assert_int_equal(u, r.info.vertices - lines);
		assert_true(v < u);
		assert_in_range(n, 1, 2);
		faces -= n;
		for (unsigned long i = 0; i < n; i++) {
			assert_int_equal(fscanf(f, "%lu", &id), 1);
			assert_int_equal(id, faces + i);
		}
		assert_int_equal(fscanf(f, "%lu", &n), 1);
		for (unsigned long i = 0; i < n; i++) {
			assert_int_equal(fscanf(f, "%lu", &id), 1);
			assert_true(id < faces);
		}
	}
	assert_int_equal(lines, r.info.splits);
	assert_int_equal(faces, r.info.base_faces);
	(void)fclose(f);
	done(&r);
}

/* ---- what is refused ---- */

static wh_code play_through(record *r)
{
	wh_replay *p;
	wh_code code = wh_replay_open(&r->f.t.ctx, &p, r->pmesh, (size_t)256 << 20);
	if (code == WH_OK)
		code = wh_replay_seek(&r->f.t.ctx, p, UINT64_MAX);
	wh_replay_close(&r->f.t.ctx, &p);
	return code;
}

static void no_damage_goes_unseen(void **state)
{
	(void)state;
	record r;
	open_record(&r, WH_SYNTH_SPHERE, 1000);
	r.f.params.faces = 100;
	reduce_and_record(&r);
	struct stat st;
	assert_int_equal(stat(r.pmesh, &st), 0);
	assert_int_equal(play_through(&r), WH_OK);
	for (long at = 0; at < st.st_size; at += at < 300 ? 1 : 61) {
		FILE *f = fopen(r.pmesh, "r+");
		assert_non_null(f);
		assert_int_equal(fseek(f, at, SEEK_SET), 0);
		const int was = fgetc(f);
		for (int turn = 0; turn < 2; turn++) {
			assert_int_equal(fseek(f, at, SEEK_SET), 0);
			(void)fputc(turn ? was : was ^ (1 << at % 8), f);
			assert_int_equal(fflush(f), 0);
			assert_int_equal(play_through(&r), turn ? WH_OK : WH_E_INPUT);
		}
		(void)fclose(f);
	}
	for (off_t size = st.st_size - 1; size > 0; size -= 501) {
		assert_int_equal(truncate(r.pmesh, size), 0);
		assert_int_equal(play_through(&r), WH_E_INPUT);
		assert_non_null(strstr(r.f.t.ctx.err.text, r.pmesh));
	}
	drop(&r.f);
}

static void refused(record *r, wh_code code, const char *words)
{
	assert_int_equal(reduce(&r->f), code);
	assert_non_null(strstr(r->f.t.ctx.err.text, words));
	assert_int_equal(entries(r->f.temp), 0);
	assert_int_equal(access(r->pmesh, F_OK), -1);
}

static void what_cannot_be_recorded_is_refused(void **state)
{
	(void)state;
	record r;
	open_record(&r, WH_SYNTH_SPHERE, 200000);
	wh_reduce_params *p = &r.f.params;
	p->output = r.pmesh;
	p->progressive = true;
	p->faces = 1000;
	p->simplify_topology = true;
	refused(&r, WH_E_USAGE, "topology");
	p->simplify_topology = false;
	p->ascii = true;
	refused(&r, WH_E_USAGE, "replayed");
	p->ascii = false;
	p->cluster_faces = 50000;
	p->memory = (size_t)27 << 20;
	refused(&r, WH_E_PLAN, "recording the collapses needs more memory");
	p->memory = (size_t)256 << 20;
	p->final_faces = 50000;
	p->faces = 100000;
	refused(&r, WH_E_USAGE, "--final-faces");
	drop(&r.f);
}

static void a_level_above_the_ceiling_is_refused(void **state)
{
	(void)state;
	record r;
	open_record(&r, WH_SYNTH_SPHERE, 100000);
	r.f.params.faces = 1000;
	reduce_and_record(&r);
	wh_ctx *c = &r.f.t.ctx;
	assert_int_equal(wh_replay_open(c, &r.replay, r.pmesh, (size_t)16 << 20), WH_OK);
	assert_int_equal(wh_replay_seek(c, r.replay, UINT64_MAX), WH_E_PLAN);
	assert_non_null(strstr(c->err.text, "--memory"));
	done(&r);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	    cmocka_unit_test(the_ends_are_input_and_result),
	    cmocka_unit_test(levels_are_the_same_from_both_sides_and_clean),
	    cmocka_unit_test(threads_change_no_byte),
	    cmocka_unit_test(memory_changes_no_byte),
	    cmocka_unit_test(levels_keep_their_limits),
	    cmocka_unit_test(properties_and_large_fans_come_back),
	    cmocka_unit_test(other_formats_are_those_of_reduce),
	    cmocka_unit_test(a_morph_begins_and_ends_at_its_levels),
	    cmocka_unit_test(vertices_go_straight),
	    cmocka_unit_test(normals_turn_evenly_and_labels_jump),
	    cmocka_unit_test(what_is_no_morph_is_refused),
	    cmocka_unit_test(the_text_tells_every_collapse),
	    cmocka_unit_test(no_damage_goes_unseen),
	    cmocka_unit_test(what_cannot_be_recorded_is_refused),
	    cmocka_unit_test(a_level_above_the_ceiling_is_refused),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
