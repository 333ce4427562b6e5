/*
 * How wh_reduce ends when it is stopped or something fails: asked to stop in any phase, refused
 * memory, disks that are full or broken at any call, files that change or vanish under it. It
 * ends soon, with the right code and words; no output, nothing temporary, no memory stays, and
 * the input is as it was.
 *
 * The linker sends the library's system calls through the __wrap_ functions below.
 */
#define _XOPEN_SOURCE 700
#include "reduce_files.h"

#include <errno.h>
#include <limits.h>
#include <pthread.h>
#include <stdatomic.h>

/* ---- system calls that fail ---- */

typedef enum call {
	NONE,
	PREAD,
	PWRITE,
	FTRUNCATE,
	WRITE,
	FSYNC,
	OPENAT,
	RENAMEAT,
	THREAD,
	EVERY /* reads and writes: done by halves, and interrupted now and then */
} call;

enum { END_OF_FILE = -1 }; /* instead of an errno: pread finds nothing more */

/* From the call that brings `left` to 0 on, all calls of the kind fail. */
static struct fault {
	_Atomic int call;
	_Atomic int how; /* errno, or END_OF_FILE */
	_Atomic long left;
	_Atomic long seen;
} fault;

static void break_call(call which, int how, long nth)
{
	atomic_store(&fault.how, how);
	atomic_store(&fault.left, nth);
	atomic_store(&fault.seen, 0);
	atomic_store(&fault.call, (int)which);
}

static bool fails(call which)
{
	if (atomic_load(&fault.call) != (int)which)
		return false;
	atomic_fetch_add(&fault.seen, 1);
	if (atomic_fetch_sub(&fault.left, 1) > 1)
		return false;
	errno = atomic_load(&fault.how);
	return true;
}

/* Half of n bytes, or, every seventh time, an interruption: 0. */
static size_t cut_down(size_t n)
{
	if (atomic_load(&fault.call) != EVERY)
		return n;
	if (atomic_fetch_add(&fault.seen, 1) % 7 != 6)
		return (n + 1) / 2;
	errno = EINTR;
	return 0;
}

/* NOLINTBEGIN(bugprone-reserved-identifier): the linker's names */
ssize_t __real_pread(int fd, void *buf, size_t n, off_t off);
ssize_t __real_pwrite(int fd, const void *buf, size_t n, off_t off);
ssize_t __real_write(int fd, const void *buf, size_t n);
int __real_ftruncate(int fd, off_t size);
int __real_fsync(int fd);
int __real_openat(int dirfd, const char *name, int flags, mode_t mode);
int __real_renameat(int from_dir, const char *from, int to_dir, const char *to);
int __real_pthread_create(pthread_t *t, const pthread_attr_t *attr, void *(*run)(void *),
                          void *arg);

ssize_t __wrap_pread(int fd, void *buf, size_t n, off_t off);
ssize_t __wrap_pwrite(int fd, const void *buf, size_t n, off_t off);
ssize_t __wrap_write(int fd, const void *buf, size_t n);
int __wrap_ftruncate(int fd, off_t size);
int __wrap_fsync(int fd);
int __wrap_openat(int dirfd, const char *name, int flags, mode_t mode);
int __wrap_renameat(int from_dir, const char *from, int to_dir, const char *to);
int __wrap_pthread_create(pthread_t *t, const pthread_attr_t *attr, void *(*run)(void *),
                          void *arg);

ssize_t __wrap_pread(int fd, void *buf, size_t n, off_t off)
{
	if (fails(PREAD))
		return errno == END_OF_FILE ? 0 : -1;
	n = cut_down(n);
	return n ? __real_pread(fd, buf, n, off) : -1;
}

ssize_t __wrap_pwrite(int fd, const void *buf, size_t n, off_t off)
{
	if (fails(PWRITE))
		return -1;
	n = cut_down(n);
	return n ? __real_pwrite(fd, buf, n, off) : -1;
}

ssize_t __wrap_write(int fd, const void *buf, size_t n)
{
	if (fails(WRITE))
		return -1;
	n = cut_down(n);
	return n ? __real_write(fd, buf, n) : -1;
}

int __wrap_ftruncate(int fd, off_t size)
{
	return fails(FTRUNCATE) ? -1 : __real_ftruncate(fd, size);
}

int __wrap_fsync(int fd)
{
	return fails(FSYNC) ? -1 : __real_fsync(fd);
}

int __wrap_openat(int dirfd, const char *name, int flags, mode_t mode)
{
	return fails(OPENAT) ? -1 : __real_openat(dirfd, name, flags, mode);
}

int __wrap_renameat(int from_dir, const char *from, int to_dir, const char *to)
{
	return fails(RENAMEAT) ? -1 : __real_renameat(from_dir, from, to_dir, to);
}

int __wrap_pthread_create(pthread_t *t, const pthread_attr_t *attr, void *(*run)(void *), void *arg)
{
	return fails(THREAD) ? EAGAIN : __real_pthread_create(t, attr, run, arg);
}
/* NOLINTEND(bugprone-reserved-identifier) */

/* ---- runs ---- */

typedef struct bytes {
	char *at;
	size_t n;
} bytes;

static bytes read_file(const char *path)
{
	bytes b;
	FILE *f = fopen(path, "rb");
	assert_non_null(f);
	assert_int_equal(fseek(f, 0, SEEK_END), 0);
	b.n = (size_t)ftell(f);
	rewind(f);
	b.at = malloc(b.n);
	assert_non_null(b.at);
	assert_int_equal(fread(b.at, 1, b.n, f), b.n);
	(void)fclose(f);
	return b;
}

/* Binary bodies are used in place, text is rewritten into a temporary file. */
static void make_small(fixture *f, bool text)
{
	wh_synth_params p = surface(WH_SYNTH_TERRAIN, 8000);
	p.ascii = text;
	make(f, &p);
	f->params.cluster_faces = 1500;
	f->params.micro_faces = 500;
	f->params.final_faces = 300;
	f->params.faces = 100;
}

/* What every run that did not come to its end has in common. */
static void ended_cleanly(fixture *f, const bytes *input, size_t held)
{
	assert_true(f->t.ctx.err.text[0] != '\0');
	assert_int_equal((size_t)f->t.mem.used, held);
	nothing_is_left(f);
	bytes now = read_file(f->in);
	assert_int_equal(now.n, input->n);
	assert_memory_equal(now.at, input->at, now.n);
	free(now.at);
}

/* ---- asked to stop ---- */

enum { MOST_EVENTS = 4096 };

typedef struct event {
	char phase[24];
	uint64_t done;
} event;

/* Counts what the run tells of its progress, and asks to stop at the n-th time. */
typedef struct listener {
	int stop, n, stop_at;
	event seen[MOST_EVENTS];
} listener;

static void listen_and_stop(void *user, const char *phase, uint64_t done, uint64_t total)
{
	(void)total;
	listener *l = user;
	event *e = &l->seen[l->n];
	assert_true(l->n < MOST_EVENTS);
	(void)snprintf(e->phase, sizeof e->phase, "%s", phase);
	e->done = done;
	if (l->n++ == l->stop_at)
		__atomic_store_n(&l->stop, 1, __ATOMIC_RELAXED);
}

static bool phase_seen(const listener *l, const char *phase)
{
	for (int i = 0; i < l->n; i++)
		if (strcmp(l->seen[i].phase, phase) == 0)
			return true;
	return false;
}

static bool is_first_of_phase(const listener *l, int i)
{
	return i == 0 || strcmp(l->seen[i].phase, l->seen[i - 1].phase) != 0;
}

/* At the beginning of each phase, in it, and at its end, as far as it tells of them. */
static bool worth_a_stop(const listener *l, int i)
{
	return is_first_of_phase(l, i) || is_first_of_phase(l, i - 1) || i + 1 == l->n ||
	       is_first_of_phase(l, i + 1);
}

/* Stops at the first n events of a whole run, as far as they are worth it. */
static void stop_at_each(fixture *f, const listener *whole, int n)
{
	listener *l = calloc(1, sizeof *l);
	const bytes input = read_file(f->in);
	const size_t held = f->t.mem.used;
	assert_non_null(l);
	f->params.progress_user = l;
	f->t.ctx.cancel = &l->stop;
	for (int i = 0; i < n; i++) {
		if (!worth_a_stop(whole, i))
			continue;
		*l = (listener){.stop_at = i};
		const wh_code code = reduce(f);
		if (code != WH_OK) {
			assert_int_equal(code, WH_E_INTERRUPT);
			ended_cleanly(f, &input, held);
			continue;
		}
		/* too late: all bytes were on their way */
		assert_string_equal(whole->seen[i].phase, "write");
		assert_true(whole->seen[i].done > 0);
		assert_int_equal(unlink(f->out), 0);
	}
	f->t.ctx.cancel = NULL;
	free(input.at);
	free(l);
}

static void every_phase_can_be_stopped(void **state)
{
	(void)state;
	enum { MOST = 13 };
	static const char *const in_memory[MOST] = {
	    "open",  "bounds", "partition",  "faces", "vertices", "survey", "decimate",
	    "recut", "stitch", "final pass", "check", "order",    "write"};
	static const char *const streamed[MOST] = {"open",     "bounds", "partition", "faces",
	                                           "vertices", "survey", "decimate",  "recut",
	                                           "settle",   "check",  "write"};
	for (int way = 0; way < 3; way++) { /* binary; text; with a streamed result */
		fixture f;
		const char *const *must = way == 2 ? streamed : in_memory;
		make_small(&f, way == 1);
		if (way == 2)
			f.params.faces = 4000;
		f.params.threads = 1; /* the order of events is that of the first run */
		f.params.progress = listen_and_stop;
		listener *whole = calloc(1, sizeof *whole);
		assert_non_null(whole);
		whole->stop_at = -1;
		f.params.progress_user = whole;
		assert_int_equal(reduce(&f), WH_OK);
		assert_int_equal(unlink(f.out), 0);
		for (size_t i = 0; i < MOST && must[i]; i++)
			if (!phase_seen(whole, must[i]))
				fail_msg("no phase '%s'", must[i]);
		/* beyond the rewriting, text is like any other input */
		stop_at_each(&f, whole, way == 1 ? 3 : whole->n);
		free(whole);
		drop(&f);
	}
}

/* The request comes while several workers are at it. */
static void several_workers_stop(void **state)
{
	(void)state;
	fixture f;
	make_small(&f, false);
	f.params.threads = 4;
	f.params.progress = listen_and_stop;
	listener *l = calloc(1, sizeof *l);
	assert_non_null(l);
	const bytes input = read_file(f.in);
	const size_t held = f.t.mem.used;
	f.params.progress_user = l;
	f.t.ctx.cancel = &l->stop;
	for (int i = 0;; i += 7) {
		*l = (listener){.stop_at = i};
		if (reduce(&f) == WH_OK)
			break;
		assert_true(i < MOST_EVENTS);
		assert_int_equal(f.t.ctx.err.code, WH_E_INTERRUPT);
		ended_cleanly(&f, &input, held);
	}
	assert_true(l->n > 20);
	free(input.at);
	free(l);
	drop(&f);
}

/* ---- refused memory ---- */

static void failed_allocations_leave_nothing(void **state)
{
	(void)state;
	for (int text = 0; text < 2; text++) {
		fixture f;
		int failures = 0;
		make_small(&f, text);
		const bytes input = read_file(f.in);
		const size_t held = f.t.mem.used;
		for (long after = 1;; after += 1 + after / 5) {
			f.t.mem.fail_after = after;
			if (reduce(&f) == WH_OK)
				break;
			assert_true(after < 1000000);
			ended_cleanly(&f, &input, held);
			failures++;
		}
		f.t.mem.fail_after = 0;
		assert_true(failures > 20);
		free(input.at);
		drop(&f);
	}
}

/* Seams appear with the result or not at all. */
static void failed_allocations_leave_no_seams(void **state)
{
	(void)state;
	fixture f;
	char seams[sizeof f.out_dir + 16];
	make_small(&f, false);
	(void)snprintf(seams, sizeof seams, "%s/seams.ply", f.out_dir);
	f.params.seams = seams;
	const bytes input = read_file(f.in);
	const size_t held = f.t.mem.used;
	int failures = 0;
	for (long after = 1;; after += 1 + after / 5, failures++) {
		f.t.mem.fail_after = after;
		if (reduce(&f) == WH_OK)
			break;
		assert_true(after < 1000000);
		ended_cleanly(&f, &input, held);
	}
	f.t.mem.fail_after = 0;
	assert_true(failures > 20);
	assert_int_equal(entries(f.out_dir), 2);
	assert_int_equal(entries(f.temp), 0);
	free(input.at);
	drop(&f);
}

/* ---- broken disks ---- */

/* Where in the sequence of a kind of calls each phase begins. */
typedef struct chart {
	int n;
	char phase[64][24];
	long first[64]; /* number of its first call, if it makes any */
} chart;

static void draw_chart(void *user, const char *phase, uint64_t done, uint64_t total)
{
	(void)total;
	chart *c = user;
	if (done != 0)
		return;
	assert_true(c->n < 64);
	(void)snprintf(c->phase[c->n], sizeof c->phase[c->n], "%s", phase);
	c->first[c->n++] = atomic_load(&fault.seen) + 1;
}

/* How a failure is to be told: the code, words of the message, phases that it was met in. */
typedef struct expected {
	wh_code code;
	const char *words[3];
	const char *phases[9];
} expected;

/* Lets the n-th call and all later ones fail. */
static void fail_at(fixture *f, call which, int how, long n, const expected *e)
{
	const bytes input = read_file(f->in);
	const size_t held = f->t.mem.used;
	break_call(which, how, n);
	const wh_code code = reduce(f);
	break_call(NONE, 0, 0);
	const char *said = f->t.ctx.err.text;
	if (code != e->code && !(how == END_OF_FILE && code == WH_E_INPUT))
		fail_msg("code %d: %s", (int)code, said);
	for (int i = 0; i < 3 && e->words[i]; i++)
		if (!strstr(said, e->words[i]))
			fail_msg("no '%s' in: %s", e->words[i], said);
	if (!strstr(said, f->root))
		fail_msg("no file named: %s", said);
	ended_cleanly(f, &input, held);
	free(input.at);
}

/* Lets the first call fail of each of the first phases that makes any, and the last one of the
 * run. */
static void fail_in_each_phase(fixture *f, call which, int how, int most, const expected *e)
{
	chart whole = {0}, now;
	f->params.progress = draw_chart;
	f->params.progress_user = &whole;
	break_call(which, how, LONG_MAX);
	assert_int_equal(reduce(f), WH_OK);
	const long calls = atomic_load(&fault.seen);
	assert_int_equal(unlink(f->out), 0);
	f->params.progress_user = &now;
	for (int k = 0; k <= whole.n && k < most; k++) {
		const long next = k + 1 < whole.n ? whole.first[k + 1] : calls + 1;
		const long first = k < whole.n ? whole.first[k] : calls;
		if (k < whole.n && first >= next)
			continue;
		now = (chart){0};
		fail_at(f, which, how, first, e);
		if (k < whole.n)
			assert_string_equal(now.phase[now.n - 1], whole.phase[k]);
	}
	for (int i = 0; i < 9 && e->phases[i]; i++) {
		int k = 0;
		while (k < whole.n && (strcmp(whole.phase[k], e->phases[i]) != 0 ||
		                       (k + 1 < whole.n && whole.first[k] == whole.first[k + 1])))
			k++;
		if (k == whole.n)
			fail_msg("calls of kind %d: none in '%s'", (int)which, e->phases[i]);
	}
	f->params.progress = NULL;
	f->params.progress_user = NULL;
}

static void small_fails(bool text, call which, int how, const expected *e)
{
	fixture f;
	make_small(&f, text);
	fail_in_each_phase(&f, which, how, text ? 3 : INT_MAX, e);
	drop(&f);
}

static void reads_that_fail_are_named_with_their_byte(void **state)
{
	(void)state;
	const expected e = {
	    WH_E_RUN,
	    {"byte", "Input/output error"},
	    {"bounds", "partition", "faces", "vertices", "survey", "decimate", "recut", "stitch"}};
	small_fails(false, PREAD, EIO, &e);
	const expected text = {WH_E_RUN, {"byte", "Input/output error"}, {"open", "bounds"}};
	small_fails(true, PREAD, EIO, &text);
}

static void files_cut_short_during_the_run_are_named(void **state)
{
	(void)state;
	const expected e = {
	    WH_E_RUN,
	    {"byte"},
	    {"bounds", "partition", "faces", "vertices", "survey", "decimate", "recut", "stitch"}};
	small_fails(false, PREAD, END_OF_FILE, &e);
	small_fails(true, PREAD, END_OF_FILE, &(expected){WH_E_RUN, {NULL}, {"open", "bounds"}});
}

static void a_disk_that_fills_up_is_named_with_a_remedy(void **state)
{
	(void)state;
	const expected binary = {
	    WH_E_RUN, {"no space left", "--temp-dir", "bytes"}, {"vertices", "decimate", "recut"}};
	const expected text = {WH_E_RUN, {"no space left", "--temp-dir", "bytes"}, {"open"}};
	const expected output = {WH_E_RUN, {"no space left", "out.ply", "bytes"}, {"write"}};
	small_fails(false, PWRITE, ENOSPC, &binary);
	small_fails(false, FTRUNCATE, EDQUOT, &binary);
	small_fails(true, FTRUNCATE, ENOSPC, &text);
	small_fails(true, PWRITE, EFBIG, &text);
	small_fails(false, WRITE, ENOSPC, &output);
}

static void a_disk_too_full_for_the_list_of_seams_is_named(void **state)
{
	(void)state;
	const expected e = {WH_E_RUN, {"no space left", "--temp-dir", "bytes"}, {NULL}};
	fixture f;
	char seams[sizeof f.out_dir + 16];
	make_small(&f, false);
	(void)snprintf(seams, sizeof seams, "%s/seams.ply", f.out_dir);
	f.params.seams = seams;
	for (long n = 1; n < 4; n++)
		fail_at(&f, PWRITE, ENOSPC, n, &e);
	drop(&f);
}

/* Write buffers hold all faces of a small cluster. */
static void a_disk_that_fills_up_with_faces_is_named(void **state)
{
	(void)state;
	fixture f;
	const wh_synth_params p = surface(WH_SYNTH_TERRAIN, 100000);
	make(&f, &p);
	f.params.cluster_faces = 50000;
	f.params.faces = 1000;
	chart c = {0};
	f.params.progress = draw_chart;
	f.params.progress_user = &c;
	fail_at(&f, PWRITE, ENOSPC, 1, &(expected){WH_E_RUN, {"no space left", "--temp-dir"}, {0}});
	assert_string_equal(c.phase[c.n - 1], "faces");
	drop(&f);
}

static void other_failures_are_named(void **state)
{
	(void)state;
	const expected writing = {
	    WH_E_RUN, {"Input/output error", "byte"}, {"vertices", "decimate", "recut"}};
	small_fails(false, PWRITE, EIO, &writing);
	const expected output = {WH_E_RUN, {"Input/output error", "out.ply"}, {"write"}};
	small_fails(false, WRITE, EIO, &output);
	const expected opening = {WH_E_RUN,
	                          {"Too many open files"},
	                          {"partition", "vertices", "survey", "decimate", "recut"}};
	small_fails(false, OPENAT, EMFILE, &opening);
	const expected naming = {
	    WH_E_RUN, {"Input/output error"}, {"vertices", "decimate", "recut", "write"}};
	small_fails(false, RENAMEAT, EIO, &naming);
}

/* The first flush is of the file, the second of the folder: by then the output has its name, and
 * what it replaced is gone. */
static void flushes_that_fail_are_failures(void **state)
{
	(void)state;
	fixture f;
	make_small(&f, false);
	const expected e = {WH_E_RUN, {"Input/output error", "out.ply"}, {NULL}};
	fail_at(&f, FSYNC, EIO, 1, &e);
	break_call(FSYNC, EIO, 2);
	assert_int_equal(reduce(&f), WH_E_RUN);
	break_call(NONE, 0, 0);
	assert_non_null(strstr(f.t.ctx.err.text, "written whole"));
	assert_int_equal(entries(f.out_dir), 1);
	assert_int_equal(access(f.out, R_OK), 0);
	assert_int_equal(entries(f.temp), 0);
	drop(&f);
}

static void short_counts_and_interrupted_calls_change_nothing(void **state)
{
	(void)state;
	for (int text = 0; text < 2; text++) {
		fixture f;
		char whole[33];
		make_small(&f, text);
		assert_int_equal(reduce(&f), WH_OK);
		memcpy(whole, f.report.checksum, sizeof whole);
		break_call(EVERY, 0, 0);
		assert_int_equal(reduce(&f), WH_OK);
		assert_true(atomic_load(&fault.seen) > 100);
		break_call(NONE, 0, 0);
		assert_string_equal(f.report.checksum, whole);
		drop(&f);
	}
}

/* OpenMP's libraries would end the process. */
static void threads_that_cannot_be_started_are_done_without(void **state)
{
	(void)state;
	fixture f;
	char whole[33];
	make_small(&f, false);
	f.params.threads = 1;
	assert_int_equal(reduce(&f), WH_OK);
	memcpy(whole, f.report.checksum, sizeof whole);
	f.params.threads = 6;
	for (long n = 1; n < 10; n++) {
		break_call(THREAD, 0, n);
		assert_int_equal(reduce(&f), WH_OK);
		break_call(NONE, 0, 0);
		assert_string_equal(f.report.checksum, whole);
	}
	drop(&f);
}

/* ---- what others do meanwhile ---- */

typedef struct meddler {
	fixture *f;
	const char *phase; /* when it begins, */
	void (*act)(fixture *f);
	bool done;
} meddler;

static void meddle(void *user, const char *phase, uint64_t done, uint64_t total)
{
	(void)total;
	meddler *m = user;
	if (done != 0 || m->done || strcmp(phase, m->phase) != 0)
		return;
	m->done = true;
	m->act(m->f);
}

static void append_to_input(fixture *f)
{
	FILE *i = fopen(f->in, "ab");
	assert_non_null(i);
	assert_true(fputs("more", i) >= 0);
	assert_int_equal(fclose(i), 0);
}

static void cut_input(fixture *f)
{
	assert_int_equal(truncate(f->in, 3000), 0);
}

static void remove_input(fixture *f)
{
	assert_int_equal(unlink(f->in), 0);
}

static void empty_folder(const char *folder)
{
	assert_int_equal(nftw(folder, remove_one, 8, FTW_DEPTH | FTW_PHYS), 0);
}

static void remove_temp(fixture *f)
{
	empty_folder(f->temp);
}

static void remove_out_dir(fixture *f)
{
	empty_folder(f->out_dir);
}

/* Runs with somebody who acts at the beginning of a phase; gives back what came of it. */
static wh_code with(fixture *f, const char *phase, void (*act)(fixture *f))
{
	meddler m = {.f = f, .phase = phase, .act = act};
	make_small(f, false);
	f->params.progress = meddle;
	f->params.progress_user = &m;
	const wh_code code = reduce(f);
	assert_true(m.done);
	return code;
}

/* The clock of file systems is coarse: a change right after the file was made might not show. */
static void an_input_that_is_written_to_meanwhile_is_refused(void **state)
{
	(void)state;
	static const char *const phases[] = {"bounds", "partition", "faces", "vertices"};
	for (size_t i = 0; i < 4; i++) {
		fixture f;
		assert_int_equal(with(&f, phases[i], append_to_input), WH_E_RUN);
		assert_non_null(strstr(f.t.ctx.err.text, "changed while it was read"));
		assert_non_null(strstr(f.t.ctx.err.text, f.in));
		nothing_is_left(&f);
		drop(&f);
		assert_int_equal(with(&f, phases[i], cut_input), WH_E_INPUT);
		assert_non_null(strstr(f.t.ctx.err.text, "cut short"));
		assert_non_null(strstr(f.t.ctx.err.text, f.in));
		nothing_is_left(&f);
		drop(&f);
	}
}

/* It is open: its bytes stay as long as they are needed. */
static void an_input_that_is_removed_meanwhile_is_read_on(void **state)
{
	(void)state;
	fixture f;
	assert_int_equal(with(&f, "bounds", remove_input), WH_OK);
	assert_int_equal(f.report.output_faces, 100);
	drop(&f);
}

static void folders_removed_meanwhile_are_named(void **state)
{
	(void)state;
	static const char *const phases[] = {"faces",    "vertices", "survey",
	                                     "decimate", "recut",    "stitch"};
	for (size_t i = 0; i < sizeof phases / sizeof *phases; i++) {
		fixture f;
		assert_int_equal(with(&f, phases[i], remove_temp), WH_E_RUN);
		assert_non_null(strstr(f.t.ctx.err.text, f.temp));
		assert_non_null(strstr(f.t.ctx.err.text, "gone"));
		assert_int_equal(entries(f.out_dir), 0);
		drop(&f);
	}
	fixture f;
	assert_int_equal(with(&f, "final pass", remove_out_dir), WH_E_RUN);
	assert_non_null(strstr(f.t.ctx.err.text, f.out));
	assert_int_equal(entries(f.temp), 0);
	assert_int_equal(access(f.out_dir, F_OK), -1);
	drop(&f);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	    cmocka_unit_test(every_phase_can_be_stopped),
	    cmocka_unit_test(several_workers_stop),
	    cmocka_unit_test(failed_allocations_leave_nothing),
	    cmocka_unit_test(failed_allocations_leave_no_seams),
	    cmocka_unit_test(reads_that_fail_are_named_with_their_byte),
	    cmocka_unit_test(files_cut_short_during_the_run_are_named),
	    cmocka_unit_test(a_disk_that_fills_up_is_named_with_a_remedy),
	    cmocka_unit_test(a_disk_too_full_for_the_list_of_seams_is_named),
	    cmocka_unit_test(a_disk_that_fills_up_with_faces_is_named),
	    cmocka_unit_test(other_failures_are_named),
	    cmocka_unit_test(flushes_that_fail_are_failures),
	    cmocka_unit_test(short_counts_and_interrupted_calls_change_nothing),
	    cmocka_unit_test(threads_that_cannot_be_started_are_done_without),
	    cmocka_unit_test(an_input_that_is_written_to_meanwhile_is_refused),
	    cmocka_unit_test(an_input_that_is_removed_meanwhile_is_read_on),
	    cmocka_unit_test(folders_removed_meanwhile_are_named),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
