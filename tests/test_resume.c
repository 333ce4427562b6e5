/*
 * Runs that are stopped and resumed: in every phase, many times in one run, with other threads and
 * ceilings; with files of the run directory damaged, cut off or gone; with another input or other
 * parameters; by two processes at once. The bytes are those of a run without a break, or the words
 * say why not. (cli/resume.sh kills for real.)
 */
#define _XOPEN_SOURCE 700
#include "reduce_files.h"

#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <signal.h>
#include <stdatomic.h>
#include <sys/wait.h>
#include <time.h>

typedef struct bytes {
	char *at;
	size_t n;
} bytes;

static bytes read_file(const char *path)
{
	bytes b = {0};
	struct stat st;
	FILE *f = fopen(path, "rb");
	assert_non_null(f);
	assert_int_equal(fstat(fileno(f), &st), 0);
	b.n = (size_t)st.st_size;
	b.at = malloc(b.n + 1);
	assert_non_null(b.at);
	assert_int_equal(fread(b.at, 1, b.n, f), b.n);
	(void)fclose(f);
	return b;
}

static void write_file(const char *path, const char *at, size_t n)
{
	FILE *f = fopen(path, "wb");
	assert_non_null(f);
	assert_int_equal(fwrite(at, 1, n, f), n);
	assert_int_equal(fclose(f), 0);
}

/* ---- disks that fill up ------------------------------------------------------------------- */

/* From the call that brings it to 0 on, whatever changes a disk fails; negative: nothing does. */
static _Atomic long calls_left = -1;
static _Atomic long calls_seen;

static bool is_full(void)
{
	atomic_fetch_add(&calls_seen, 1);
	const long left = atomic_load(&calls_left);
	if (left < 0)
		return false;
	if (left > 0) {
		atomic_fetch_sub(&calls_left, 1);
		return false;
	}
	errno = ENOSPC;
	return true;
}

/* NOLINTBEGIN(bugprone-reserved-identifier): the linker's names */
ssize_t __real_pwrite(int fd, const void *buf, size_t n, off_t off);
ssize_t __real_write(int fd, const void *buf, size_t n);
int __real_ftruncate(int fd, off_t size);
int __real_fsync(int fd);
int __real_renameat(int from_dir, const char *from, int to_dir, const char *to);
int __real_linkat(int from_dir, const char *from, int to_dir, const char *to, int flags);
ssize_t __wrap_pwrite(int fd, const void *buf, size_t n, off_t off);
ssize_t __wrap_write(int fd, const void *buf, size_t n);
int __wrap_ftruncate(int fd, off_t size);
int __wrap_fsync(int fd);
int __wrap_renameat(int from_dir, const char *from, int to_dir, const char *to);
int __wrap_linkat(int from_dir, const char *from, int to_dir, const char *to, int flags);

ssize_t __wrap_pwrite(int fd, const void *buf, size_t n, off_t off)
{
	return is_full() ? -1 : __real_pwrite(fd, buf, n, off);
}

ssize_t __wrap_write(int fd, const void *buf, size_t n)
{
	return is_full() ? -1 : __real_write(fd, buf, n);
}

int __wrap_ftruncate(int fd, off_t size)
{
	return is_full() ? -1 : __real_ftruncate(fd, size);
}

int __wrap_fsync(int fd)
{
	return is_full() ? -1 : __real_fsync(fd);
}

int __wrap_renameat(int from_dir, const char *from, int to_dir, const char *to)
{
	return is_full() ? -1 : __real_renameat(from_dir, from, to_dir, to);
}

int __wrap_linkat(int from_dir, const char *from, int to_dir, const char *to, int flags)
{
	return is_full() ? -1 : __real_linkat(from_dir, from, to_dir, to, flags);
}
/* NOLINTEND(bugprone-reserved-identifier) */

/* ---- runs that are stopped ---------------------------------------------------------------- */

enum { MOST_EVENTS = 4096 };

/* Counts what the run tells of its progress, asks to stop at one of these events, and keeps the
 * last notice. */
typedef struct listener {
	int stop, n, stop_at;
	char phase[MOST_EVENTS][16];
	char notice[2048]; /* all of them */
} listener;

static void listen_and_stop(void *user, const char *phase, uint64_t done, uint64_t total)
{
	(void)done, (void)total;
	listener *l = user;
	assert_true(l->n < MOST_EVENTS);
	(void)snprintf(l->phase[l->n], sizeof l->phase[0], "%s", phase);
	if (l->n++ == l->stop_at)
		__atomic_store_n(&l->stop, 1, __ATOMIC_RELAXED);
}

static void listen_to_notice(void *user, const char *text)
{
	listener *l = user;
	const size_t n = strlen(l->notice);
	(void)snprintf(l->notice + n, sizeof l->notice - n, "%s\n", text);
}

typedef struct trial {
	fixture f;
	char run[64], inside[96]; /* the run directory, and whittle's folder in it */
	listener *l;
	bytes expected;
	listener *whole; /* the events of a run without a break */
} trial;

typedef enum way { IN_MEMORY, STREAMED, TEXT_INPUT, TIDIED, WAYS } way;

static void listen(trial *t, int stop_at)
{
	*t->l = (listener){.stop_at = stop_at};
}

static void make_trial(trial *t, way w)
{
	fixture *f = &t->f;
	wh_synth_params p = surface(WH_SYNTH_TERRAIN, 8000);
	p.ascii = w == TEXT_INPUT;
	*t = (trial){0};
	make(f, &p);
	/* in memory where that can be had: all the flushing of a disk takes its time */
	(void)snprintf(t->run, sizeof t->run, "/dev/shm/whittle-resume-XXXXXX");
	if (!mkdtemp(t->run))
		(void)snprintf(t->run, sizeof t->run, "%s/run", f->root);
	else
		assert_int_equal(rmdir(t->run), 0);
	(void)snprintf(t->inside, sizeof t->inside, "%s/whittle-run", t->run);
	t->l = calloc(1, sizeof *t->l);
	t->whole = calloc(1, sizeof *t->whole);
	assert_true(t->l && t->whole);
	f->params.force = false;
	f->params.cluster_faces = 1500;
	f->params.micro_faces = 500;
	f->params.final_faces = 300;
	f->params.faces = w == STREAMED ? 4000 : 100;
	if (w == TIDIED) { /* vertices and small parts go before anything is reduced */
		f->params.weld = true;
		f->params.weld_share = 0.002;
		f->params.min_component = 50;
	}
	f->params.threads = 1; /* so that events come in one order */
	f->params.progress = listen_and_stop;
	f->params.progress_user = t->l;
	f->params.notice = listen_to_notice;
	f->params.notice_user = t->l;
	listen(t, -1);
	assert_int_equal(reduce(f), WH_OK);
	t->expected = read_file(f->out);
	assert_int_equal(unlink(f->out), 0);
	f->params.run_dir = t->run;
	listen(t, -1);
	assert_int_equal(reduce(f), WH_OK); /* with a run directory the events are others */
	*t->whole = *t->l;
	assert_int_equal(unlink(f->out), 0);
	f->t.ctx.cancel = &t->l->stop;
}

static void drop_trial(trial *t)
{
	free(t->expected.at);
	free(t->l);
	free(t->whole);
	(void)nftw(t->run, remove_one, 8, FTW_DEPTH | FTW_PHYS);
	drop(&t->f);
}

/* What the end of a run looks like; the output is removed for the next. */
static void ended_well(trial *t)
{
	bytes got = read_file(t->f.out);
	assert_int_equal(got.n, t->expected.n);
	assert_memory_equal(got.at, t->expected.at, got.n);
	free(got.at);
	assert_int_equal(unlink(t->f.out), 0);
	assert_int_equal(access(t->run, F_OK), -1);
	nothing_is_left(&t->f);
}

/* Starts a run and stops it at an event. False: it came to its end before. */
static bool stopped_at(trial *t, int event)
{
	listen(t, event);
	t->f.params.threads = 1;
	const wh_code code = reduce(&t->f);
	if (code == WH_OK) {
		ended_well(t);
		return false;
	}
	assert_int_equal(code, WH_E_INTERRUPT);
	nothing_is_left(&t->f);
	return true;
}

static void resume(trial *t, int variant)
{
	listen(t, -1);
	t->f.params.resume = true;
	t->f.params.threads = 1 + variant % 3;
	t->f.params.memory = (size_t)(variant % 2 ? 64 : 256) << 20;
	const wh_code code = reduce(&t->f);
	if (code != WH_OK)
		fail_msg("resuming: %s", t->f.t.ctx.err.text);
	t->f.params.resume = false;
}

/* The first event of a phase that comes after `from`, and `more` after it. */
static int event_of(const trial *t, const char *phase, int more)
{
	for (int i = 0; i < t->whole->n; i++)
		if (strcmp(t->whole->phase[i], phase) == 0)
			return i + more;
	fail_msg("no phase '%s'", phase);
	return 0;
}

static bool begins_phase(const listener *l, int i)
{
	return i == 0 || strcmp(l->phase[i], l->phase[i - 1]) != 0;
}

static void every_phase_can_be_resumed(void **state)
{
	(void)state;
	for (int w = 0; w < WAYS; w++) {
		trial t;
		int stopped = 0, resumed = 0;
		make_trial(&t, (way)w);
		for (int i = 0; i < t.whole->n; i++) {
			if (!begins_phase(t.whole, i) && (w == TIDIED || i % 6 != 0))
				continue;
			if (!stopped_at(&t, i))
				continue;
			stopped++;
			const bool kept = t.f.report.resumable;
			assert_int_equal(access(t.inside, F_OK), kept ? 0 : -1);
			resume(&t, i);
			assert_int_equal(t.f.report.resumed, kept);
			resumed += kept;
			ended_well(&t);
		}
		if (stopped < (w == TIDIED ? 10 : 20) || resumed < (w == TIDIED ? 5 : 12))
			fail_msg("%d stopped, %d resumed", stopped, resumed);
		drop_trial(&t);
	}
}

/* Every process comes a little further than the one before it. */
static void a_run_may_be_stopped_many_times(void **state)
{
	(void)state;
	for (int w = 0; w < TEXT_INPUT; w++) { /* beyond ingest text is like the rest */
		trial t;
		int stops = 0;
		make_trial(&t, (way)w);
		t.f.params.resume = true;
		for (int i = 0; stopped_at(&t, i); i++) {
			stops++;
			assert_true(stops < MOST_EVENTS);
		}
		if (t.f.report.resumed < 4)
			fail_msg("resumed %d times of %d", (int)t.f.report.resumed, stops);
		assert_true(t.f.report.seconds_total > 0);
		drop_trial(&t);
	}
}

/* What is reported of a resumed run is what is reported of any. */
static void reports_are_the_same(void **state)
{
	(void)state;
	trial t;
	make_trial(&t, STREAMED);
	listen(&t, -1);
	assert_int_equal(reduce(&t.f), WH_OK);
	const wh_reduce_report a = t.f.report;
	assert_int_equal(unlink(t.f.out), 0);
	assert_true(stopped_at(&t, event_of(&t, "settle", 2)));
	assert_true(t.f.report.resumable);
	resume(&t, 1);
	const wh_reduce_report *b = &t.f.report;
	assert_int_equal(b->resumed, 1);
	assert_false(b->resumable);
	assert_int_equal(a.rounds, b->rounds);
	assert_int_equal(a.clusters, b->clusters);
	assert_int_equal(a.cut_vertices, b->cut_vertices);
	assert_int_equal(a.output_faces, b->output_faces);
	assert_int_equal(a.output_vertices, b->output_vertices);
	assert_int_equal(a.never_free_vertices, b->never_free_vertices);
	assert_int_equal(a.streamed, b->streamed);
	assert_int_equal(a.input_bytes, b->input_bytes);
	assert_int_equal(a.components, b->components);
	assert_true(a.cost_distance >= b->cost_distance && a.cost_distance <= b->cost_distance);
	assert_string_equal(a.checksum, b->checksum);
	assert_string_equal(a.dropped, b->dropped);
	for (int i = 0; i < WH_PHASE_SETTLE; i++)
		assert_true(b->phase[i].bytes_written >= a.phase[i].bytes_written / 2);
	ended_well(&t);
	drop_trial(&t);
}

static void seams_are_the_same(void **state)
{
	(void)state;
	trial t;
	char seams[96];
	make_trial(&t, IN_MEMORY);
	(void)snprintf(seams, sizeof seams, "%s/seams.ply", t.f.root);
	t.f.params.seams = seams;
	listen(&t, -1);
	t.f.params.run_dir = NULL;
	assert_int_equal(reduce(&t.f), WH_OK);
	t.f.params.run_dir = t.run;
	bytes expected = read_file(seams);
	assert_int_equal(unlink(seams), 0);
	assert_int_equal(unlink(t.f.out), 0);
	for (int i = 0; i < 4; i++) {
		static const char *const phase[] = {"faces", "survey", "recut", "write"};
		assert_true(stopped_at(&t, event_of(&t, phase[i], 0)));
		assert_int_equal(access(seams, F_OK), -1);
		resume(&t, i);
		bytes got = read_file(seams);
		assert_int_equal(got.n, expected.n);
		assert_memory_equal(got.at, expected.at, got.n);
		free(got.at);
		assert_int_equal(unlink(seams), 0);
		ended_well(&t);
	}
	free(expected.at);
	drop_trial(&t);
}

/* Room is made, and the run goes on; the last calls are those that make the output's name last. */
static void full_disks_can_be_resumed(void **state)
{
	(void)state;
	enum { POINTS = 30 };
	for (int w = 0; w < WAYS; w++) {
		trial t;
		int failed = 0, resumed = 0;
		make_trial(&t, (way)w);
		listen(&t, -1);
		atomic_store(&calls_seen, 0);
		assert_int_equal(reduce(&t.f), WH_OK);
		const long calls = atomic_load(&calls_seen);
		ended_well(&t);
		for (long i = 0; i <= calls; i += i + 10 < calls ? calls / POINTS : 1) {
			listen(&t, -1);
			t.f.params.threads = 1;
			atomic_store(&calls_left, i);
			const wh_code code = reduce(&t.f);
			atomic_store(&calls_left, -1);
			if (code == WH_OK) {
				ended_well(&t);
				continue;
			}
			failed++;
			assert_int_equal(code, WH_E_RUN);
			assert_int_equal(entries(t.f.temp), 0);
			resumed += t.f.report.resumable;
			assert_int_equal(access(t.inside, F_OK), t.f.report.resumable ? 0 : -1);
			resume(&t, (int)i);
			ended_well(&t);
		}
		if (failed < POINTS / 2 || resumed < POINTS / 4)
			fail_msg("%d failed, %d resumed", failed, resumed);
		drop_trial(&t);
	}
}

/* ---- damage ------------------------------------------------------------------------------- */

enum { MOST_FILES = 64 };

/* The files of a folder. */
typedef struct snapshot {
	char name[MOST_FILES][64];
	bytes file[MOST_FILES];
	int n;
} snapshot;

static void path_in(const trial *t, const char *name, char path[PATH_MAX])
{
	(void)snprintf(path, PATH_MAX, "%s/%s", t->inside, name);
}

static void take_snapshot(const trial *t, snapshot *s)
{
	char path[PATH_MAX];
	DIR *d = opendir(t->inside);
	assert_non_null(d);
	s->n = 0;
	for (const struct dirent *e = readdir(d); e; e = readdir(d)) {
		if (e->d_name[0] == '.')
			continue;
		assert_true(s->n < MOST_FILES);
		path_in(t, e->d_name, path);
		(void)snprintf(s->name[s->n], sizeof s->name[0], "%.63s", e->d_name);
		s->file[s->n++] = read_file(path);
	}
	(void)closedir(d);
}

static void free_snapshot(snapshot *s)
{
	for (int i = 0; i < s->n; i++)
		free(s->file[i].at);
}

static void bring_back(const trial *t, const snapshot *s)
{
	char path[PATH_MAX];
	(void)nftw(t->run, remove_one, 8, FTW_DEPTH | FTW_PHYS);
	assert_int_equal(mkdir(t->run, 0700), 0);
	assert_int_equal(mkdir(t->inside, 0700), 0);
	for (int i = 0; i < s->n; i++) {
		path_in(t, s->name[i], path);
		write_file(path, s->file[i].at, s->file[i].n);
	}
}

typedef enum damage {
	FLIP_HEAD,
	FLIP_MIDDLE,
	FLIP_END,
	HALVE,
	EMPTY,
	LONGER,
	REMOVE,
	DAMAGES
} damage;

static void do_damage(const trial *t, const snapshot *s, int i, damage d)
{
	char path[PATH_MAX];
	bytes b = s->file[i];
	path_in(t, s->name[i], path);
	if (d == REMOVE) {
		assert_int_equal(unlink(path), 0);
		return;
	}
	char *copy = malloc(b.n + 8);
	assert_non_null(copy);
	memcpy(copy, b.at, b.n);
	memset(copy + b.n, 7, 8);
	if (d <= FLIP_END && b.n)
		copy[d == FLIP_HEAD ? 0 : d == FLIP_MIDDLE ? b.n / 2 : b.n - 1] ^= 0x10;
	write_file(path, copy, d == HALVE ? b.n / 2 : d == EMPTY ? 0 : d == LONGER ? b.n + 8 : b.n);
	free(copy);
}

/* Resumes with file i of the snapshot damaged: the bytes are right, or a manifest is refused. */
static void resume_damaged(trial *t, const snapshot *s, int i, damage d)
{
	bring_back(t, s);
	do_damage(t, s, i, d);
	listen(t, -1);
	t->f.params.resume = true;
	const wh_code code = reduce(&t->f);
	t->f.params.resume = false;
	if (strcmp(s->name[i], "manifest") != 0) {
		if (code != WH_OK)
			fail_msg("%s, damage %d: %s", s->name[i], (int)d, t->f.t.ctx.err.text);
		ended_well(t);
		return;
	}
	assert_int_equal(code, d == REMOVE ? WH_E_USAGE : WH_E_RUN);
	assert_non_null(strstr(t->f.t.ctx.err.text, t->inside));
	assert_non_null(strstr(t->f.t.ctx.err.text, "remove"));
	nothing_is_left(&t->f);
	assert_true(entries(t->inside) >= s->n - 1); /* and nothing was touched */
}

static void damage_is_found(void **state)
{
	(void)state;
	static const struct {
		way w;
		const char *phase;
		int more;
		const char *must; /* beginning of a name that has to be there */
	} moment[] = {{IN_MEMORY, "decimate", 3, "step-"},
	              {IN_MEMORY, "recut", 2, "round"},
	              {IN_MEMORY, "write", 0, "round"},
	              {STREAMED, "settle", 3, "collapses-"}};
	for (size_t m = 0; m < sizeof moment / sizeof *moment; m++) {
		trial t;
		snapshot s;
		bool seen = false;
		make_trial(&t, moment[m].w);
		assert_true(stopped_at(&t, event_of(&t, moment[m].phase, moment[m].more)));
		take_snapshot(&t, &s);
		for (int i = 0; i < s.n; i++)
			seen =
			    seen || strncmp(s.name[i], moment[m].must, strlen(moment[m].must)) == 0;
		assert_true(seen);
		for (int i = 0; i < s.n; i++)
			for (int d = 0; d < DAMAGES; d++)
				if (strncmp(s.name[i], "round", 5) != 0 || (i + d) % 3 == 0)
					resume_damaged(&t, &s, i, (damage)d);
		free_snapshot(&s);
		drop_trial(&t);
	}
}

/* The clusters of the store are gone through before anything else: the words tell. */
static void a_damaged_store_is_told(void **state)
{
	(void)state;
	trial t;
	snapshot s;
	make_trial(&t, IN_MEMORY);
	assert_true(stopped_at(&t, event_of(&t, "decimate", 1)));
	take_snapshot(&t, &s);
	for (int i = 0; i < s.n; i++)
		if (strcmp(s.name[i], "round0-000002") == 0)
			do_damage(&t, &s, i, FLIP_MIDDLE);
	resume(&t, 0);
	assert_non_null(strstr(t.l->notice, "cluster 2 of round 0"));
	assert_non_null(strstr(t.l->notice, "the input again"));
	ended_well(&t);
	free_snapshot(&s);
	drop_trial(&t);
}

/* ---- what must be the same ---------------------------------------------------------------- */

static void refused(trial *t, wh_code code, const char *words)
{
	listen(t, -1);
	assert_int_equal(reduce(&t->f), code);
	if (!strstr(t->f.t.ctx.err.text, words))
		fail_msg("no '%s' in: %s", words, t->f.t.ctx.err.text);
	nothing_is_left(&t->f);
	assert_int_equal(access(t->inside, F_OK), 0);
}

static void other_parameters_are_refused(void **state)
{
	(void)state;
	trial t;
	make_trial(&t, IN_MEMORY);
	assert_true(stopped_at(&t, event_of(&t, "decimate", 1)));
	refused(&t, WH_E_USAGE, "add --resume");
	const wh_reduce_params same = t.f.params;
	t.f.params.resume = true;
	t.f.params.faces = 200;
	refused(&t, WH_E_USAGE, "faces was 100 and is 200;");
	t.f.params.fast = true;
	refused(&t, WH_E_USAGE, "faces was 100 and is 200, fast was off and is on");
	t.f.params = same;
	t.f.params.resume = true;
	t.f.params.seams = "never.ply";
	refused(&t, WH_E_USAGE, "seams was off");
	t.f.params = same;
	t.f.params.resume = true;
	t.f.params.min_component = 7;
	refused(&t, WH_E_USAGE, "min_component was 0 and is 7");
	t.f.params = same;
	t.f.params.resume = true;
	t.f.params.error = 0.1;
	refused(&t, WH_E_USAGE, "error was 0 and is 0.1");
	t.f.params = same;
	resume(&t, 0);
	ended_well(&t);
	t.f.params.resume = true;
	t.f.params.run_dir = NULL;
	listen(&t, -1);
	assert_int_equal(reduce(&t.f), WH_E_USAGE);
	drop_trial(&t);
}

static void another_input_is_refused(void **state)
{
	(void)state;
	for (int w = 0; w < WAYS; w += 2) {
		trial t;
		make_trial(&t, (way)w);
		bytes in = read_file(t.f.in);
		assert_true(stopped_at(&t, event_of(&t, "recut", 0)));
		t.f.params.resume = true;
		write_file(t.f.in, in.at, in.n - 1);
		refused(&t, WH_E_INPUT, w ? "bytes and had" : "");
		char *face = in.at + in.n - (w ? 2 : 4); /* the last index; text: its last digit */
		char *vertex = in.at + in.n / 4;         /* text: a digit, or the next is one */
		vertex += *vertex < '0';
		*face ^= 1;
		write_file(t.f.in, in.at, in.n);
		refused(&t, WH_E_INPUT, "content is another one");
		*face ^= 1;
		*vertex ^= 1;
		write_file(t.f.in, in.at, in.n);
		refused(&t, WH_E_INPUT, "content is another one");
		*vertex ^= 1;
		write_file(t.f.in, in.at, in.n); /* written to, but the same */
		resume(&t, 0);
		ended_well(&t);
		free(in.at);
		drop_trial(&t);
	}
}

/* ---- the folder --------------------------------------------------------------------------- */

static void resuming_nothing_starts(void **state)
{
	(void)state;
	trial t;
	char mine[128];
	make_trial(&t, IN_MEMORY);
	resume(&t, 0);
	assert_int_equal(t.f.report.resumed, 0);
	ended_well(&t);
	assert_int_equal(mkdir(t.run, 0700), 0);
	resume(&t, 0);
	ended_well(&t);
	/* what is the user's stays */
	assert_int_equal(mkdir(t.run, 0700), 0);
	(void)snprintf(mine, sizeof mine, "%s/mine", t.run);
	write_file(mine, "x", 1);
	resume(&t, 0);
	assert_int_equal(entries(t.run), 1);
	assert_int_equal(unlink(t.f.out), 0);
	assert_int_equal(mkdir(t.inside, 0700), 0);
	(void)snprintf(mine, sizeof mine, "%s/mine", t.inside);
	write_file(mine, "x", 1);
	refused(&t, WH_E_USAGE, "holds files, but no run");
	assert_int_equal(entries(t.inside), 1);
	drop_trial(&t);
}

/* An input that is no good leaves no folder. */
static void failures_before_the_first_step_leave_nothing(void **state)
{
	(void)state;
	trial t;
	make_trial(&t, IN_MEMORY);
	assert_int_equal(truncate(t.f.in, 5000), 0);
	listen(&t, -1);
	assert_int_equal(reduce(&t.f), WH_E_INPUT);
	assert_int_equal(access(t.run, F_OK), -1);
	assert_int_equal(mkdir(t.run, 0700), 0);
	assert_int_equal(reduce(&t.f), WH_E_INPUT);
	assert_int_equal(entries(t.run), 0);
	nothing_is_left(&t.f);
	drop_trial(&t);
}

/* An output that the run itself wrote is no obstacle to its end; any other one is. */
static void outputs_of_the_run_may_be_there(void **state)
{
	(void)state;
	trial t;
	make_trial(&t, IN_MEMORY);
	assert_true(stopped_at(&t, event_of(&t, "check", 0)));
	write_file(t.f.out, "mine", 4);
	t.f.params.resume = true;
	listen(&t, -1);
	assert_int_equal(reduce(&t.f), WH_E_USAGE);
	assert_non_null(strstr(t.f.t.ctx.err.text, "exists already"));
	assert_true(t.f.report.resumable);
	assert_int_equal(unlink(t.f.out), 0);
	resume(&t, 0);
	ended_well(&t);
	drop_trial(&t);
}

/* The same when the run that wrote it ended before it was left, its clusters are gone, and the one
 * that began again from the input was stopped, too. */
static void outputs_stay_the_runs_own(void **state)
{
	(void)state;
	trial t;
	char command[PATH_MAX];
	make_trial(&t, IN_MEMORY);
	atomic_store(&calls_seen, 0);
	assert_int_equal(reduce(&t.f), WH_OK);
	const long calls = atomic_load(&calls_seen);
	ended_well(&t);
	atomic_store(&calls_left,
	             calls - 1); /* the last is for the folder, once the name is there */
	assert_int_equal(reduce(&t.f), WH_E_RUN);
	atomic_store(&calls_left, -1);
	assert_int_equal(access(t.f.out, F_OK), 0);
	(void)snprintf(command, sizeof command, "rm %s/round*", t.inside);
	assert_int_equal(system(command), 0); /* NOLINT(cert-env33-c): a name of our own */
	t.f.params.resume = true;
	listen(&t, event_of(&t, "decimate", 3));
	assert_int_equal(reduce(&t.f), WH_E_INTERRUPT);
	assert_non_null(strstr(t.l->notice, "from the input again"));
	resume(&t, 0);
	ended_well(&t);
	drop_trial(&t);
}

static void wait_in_the_round(void *user, const char *phase, uint64_t done, uint64_t total)
{
	(void)total;
	if (strcmp(phase, "decimate") != 0 || done == 0)
		return;
	const int *fd = user;
	(void)!write(*fd, "x", 1);
	for (;;)
		(void)pause();
}

static void a_second_process_is_refused(void **state)
{
	(void)state;
	trial t;
	int fd[2];
	char one;
	make_trial(&t, IN_MEMORY);
	assert_int_equal(pipe(fd), 0);
	const pid_t child = fork();
	assert_true(child >= 0);
	if (child == 0) {
		t.f.params.progress = wait_in_the_round;
		t.f.params.progress_user = &fd[1];
		(void)reduce(&t.f);
		_exit(1);
	}
	assert_int_equal(read(fd[0], &one, 1), 1);
	t.f.params.resume = true;
	refused(&t, WH_E_USAGE, "is in use by process");
	assert_int_equal(kill(child, SIGKILL), 0);
	resume(&t, 0); /* which nobody has waited for yet */
	ended_well(&t);
	(void)waitpid(child, NULL, 0);
	(void)close(fd[0]);
	(void)close(fd[1]);
	drop_trial(&t);
}

/* The folder is taken away from a process that is at work: it says so and touches nothing. */
typedef struct thief {
	trial *t;
	snapshot s;
	bool done;
} thief;

static void take_over(void *user, const char *phase, uint64_t done, uint64_t total)
{
	(void)total, (void)done;
	thief *h = user;
	char path[PATH_MAX];
	if (h->done || strcmp(phase, "recut") != 0)
		return;
	h->done = true;
	path_in(h->t, "manifest", path);
	write_file(path, "whittle-run 2 0123456789\n", 25);
}

static void a_process_that_lost_its_folder_gives_up(void **state)
{
	(void)state;
	trial t;
	make_trial(&t, IN_MEMORY);
	thief h = {.t = &t};
	t.f.params.progress = take_over;
	t.f.params.progress_user = &h;
	listen(&t, -1);
	assert_int_equal(reduce(&t.f), WH_E_RUN);
	assert_non_null(strstr(t.f.t.ctx.err.text, "taken over"));
	assert_false(t.f.report.resumable);
	assert_true(entries(t.inside) > 1);
	nothing_is_left(&t.f);
	drop_trial(&t);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	    cmocka_unit_test(every_phase_can_be_resumed),
	    cmocka_unit_test(a_run_may_be_stopped_many_times),
	    cmocka_unit_test(reports_are_the_same),
	    cmocka_unit_test(seams_are_the_same),
	    cmocka_unit_test(full_disks_can_be_resumed),
	    cmocka_unit_test(damage_is_found),
	    cmocka_unit_test(a_damaged_store_is_told),
	    cmocka_unit_test(other_parameters_are_refused),
	    cmocka_unit_test(another_input_is_refused),
	    cmocka_unit_test(resuming_nothing_starts),
	    cmocka_unit_test(failures_before_the_first_step_leave_nothing),
	    cmocka_unit_test(outputs_of_the_run_may_be_there),
	    cmocka_unit_test(outputs_stay_the_runs_own),
	    cmocka_unit_test(a_second_process_is_refused),
	    cmocka_unit_test(a_process_that_lost_its_folder_gives_up),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
