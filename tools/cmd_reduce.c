/* whittle reduce: options -> parameters -> one call -> words, report, exit status. */
#define _POSIX_C_SOURCE 200809L
#include "cmd.h"
#include "progress_bar.h"
#include "reduce_measure.h"
#include "reduce_options.h"
#include "reduce_report.h"
#include "reduce_run.h"
#include "whittle.h"

#include "io/outfile.h"
#include "io/spill.h"

#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

static const char help[] =
    "usage: whittle reduce IN -o OUT --faces N | --vertices N | --ratio R | --error E\n"
    "Reduces a mesh within a memory ceiling; the first limit reached stops. IN: PLY,\n"
    "OBJ, OFF or STL, as its content says; - is standard input.\n"
    "Colours, normals and other properties are carried as far as OUT's format has them,\n"
    "texture coordinates and materials from PLY or OBJ to PLY or OBJ; whatever is not\n"
    "is named.\n\n"
    "  -o, --output FILE     where to; - is standard output. PLY, or as the name ends:\n"
    "                        .obj, .off, .stl, .glb; compressed if it ends in .gz, .zst;\n"
    "                        any other ending is refused\n"
    "      --to F            ply, obj, off, stl, glb, ply.gz, ... whatever OUT's name is\n"
    "      --from F          IN is ply, obj, off or stl, whatever it looks like\n"
    "      --reader R        of PLY: whittle (default), or rply where it was built with\n"
    "  -n, --faces N|P%      triangles to keep: 200K, 1.5M, 10%\n"
    "      --vertices N|P%   vertices to keep\n"
    "      --ratio R         share of the triangles to keep: 0.1\n"
    "      --error E|P%      how far the surface may move, as estimated, in units of\n"
    "                        the file or per cent of the bounding-box diagonal\n"
    "      --levels LIST     several results from one run: 1M,100K,10K or 10%,1%; OUT.ply\n"
    "                        becomes OUT-1000000.ply ..., or name it OUT%f.ply\n"
    "      --levels-error LIST   the same with limits as of --error\n"
    "      --fast            less time for a little more error\n"
    "      --lock-boundary   keep boundary edges exactly\n"
    "      --smooth N        smooth the result N times (Taubin: it does not shrink), but for\n"
    "                        its boundary\n"
    "      --normals         give the result's vertices normals, the means of its faces'\n"
    "                        (this and --smooth: results of one last pass only)\n"
    "      --topology WAY    keep (default) components, handles and boundary loops, or\n"
    "                        simplify: the small ones go, to reach the count\n"
    "      --cost C          what goes first: memoryless (default), qem, qem-normals,\n"
    "                        melax, edge-length; with --weight area, uniform or angle\n"
    "                        for qem's faces\n"
    "      --placement P     of new vertices: optimal, midpoint or endpoint\n"
    "      --drop-invalid    go on without vertices that are not finite, and their faces\n"
    "      --weld EPS|P%     first make vertices that near one, and drop copies of faces;\n"
    "                        0: equal positions\n"
    "      --drop-duplicates first drop copies of faces\n"
    "      --min-component N first drop components of fewer faces\n"
    "      --attributes LIST properties to carry: all (default), none, or names,\n"
    "                        as red,green,blue or colour,normal,texture\n"
    "      --weight-of NAME=W  let a property (colour, normal, quality ...) count in the\n"
    "                        order of collapses: off by 1, or a colour by black to\n"
    "                        white, is as bad as the surface off by W % of the diagonal\n"
    "      --memory SIZE     ceiling of the process: 512M, 4G, K = 1024 (default:\n"
    "                        half of the machine's, its control group's or the job's)\n"
    "      --threads N       0 (default): all this process may use\n"
    "      --temp-dir DIR    default: $SLURM_TMPDIR, $TMPDIR, beside the output; with\n"
    "                        --run-dir only for what a rank of MPI ingests at the time\n"
    "      --run-dir DIR     a folder to keep what is done, so that a run that was\n"
    "                        killed can be resumed; gone when the result is there\n"
    "      --resume          go on with the run in the run directory, if there is one\n"
    "      --ascii           text instead of binary (PLY, STL)\n"
    "      --quantize        smaller GLB: positions of 16 bits, colours, normals of 8\n"
    "      --report FILE     what was done, as JSON\n"
    "      --measure         how far each result is from IN, in the summary and the report\n"
    "      --samples N       points a side to measure with (default: as compare)\n"
    "      --seams FILE      vertices that two clusters used at first, as a PLY of points\n"
    "  -f, --force           write over existing outputs\n"
    "  -q, --quiet           no progress and no summary (--no-progress: no progress)\n"
    "  -v, --verbose         seconds of each phase\n"
    "Sizes that decide the result's bytes, as memory and threads never do:\n"
    "      --cluster-faces N (131072; 0: all one), --micro-faces N (16384; 0: none)\n"
    "      --final-faces N   (2 clusters') from which the last pass may be over all\n"
    "                        at once; above, it goes cluster by cluster\n"
    "      --round-keep R    (0: as few as it can) share of the faces that a round leaves at\n"
    "                        least: 0.5 makes more rounds, and each of even quality\n";

/* True when a further output would lie where the input, a result, or the other one does. */
static bool is_taken(const reduce_options *o, const char *name, const char *other)
{
	const wh_reduce_params *p = &o->params;
	bool taken = (!cmd_is_dash(name) && wh_outfile_same(name, p->input)) ||
	             wh_outfile_same(name, p->output) || (other && wh_outfile_same(name, other));
	for (size_t i = 0; i < p->levels; i++)
		taken = taken || wh_outfile_same(name, p->level[i].output);
	return taken;
}

/* The report may replace an older one when asked to, but neither mesh. */
static int check_report_name(const reduce_options *o)
{
	if (!o->report)
		return WH_OK;
	if (is_taken(o, o->report, o->params.seams))
		return cmd_usage_error("reduce", "--report '%s' is the input or another output",
		                       o->report);
	struct stat st;
	if (!o->params.force && stat(o->report, &st) == 0 && S_ISREG(st.st_mode))
		return cmd_usage_error("reduce", "--report '%s' exists already; -f replaces it",
		                       o->report);
	return WH_OK;
}

static int check_seams_name(const reduce_options *o)
{
	const char *seams = o->params.seams;
	if (seams && is_taken(o, seams, NULL))
		return cmd_usage_error("reduce", "--seams '%s' is the input or another output",
		                       seams);
	return WH_OK;
}

/* ---- words -------------------------------------------------------------------------------- */

static const char *faces_word(uint64_t n)
{
	return n == 1 ? "face" : "faces";
}

static const char *vertices_word(uint64_t n)
{
	return n == 1 ? "vertex" : "vertices";
}

/* Says what became of the topology. */
static void print_topology(FILE *f, const wh_reduce_report *r)
{
	const struct {
		uint64_t n;
		const char *what;
	} kind[] = {{r->shells, "small parts removed"},
	            {r->holes, "holes closed"},
	            {r->necks, "handles or necks cut"},
	            {r->bridges, "bridges cut"},
	            {r->nonmanifold_split, "non-manifold vertices split"}};
	const char *between = "topology: ";
	for (size_t i = 0; i < sizeof kind / sizeof *kind; i++) {
		if (kind[i].n == 0)
			continue;
		(void)fprintf(f, "%s%llu %s", between, (unsigned long long)kind[i].n, kind[i].what);
		between = ", ";
	}
	if (between[0] == ',')
		(void)fputc('\n', f);
}

/* Says what went before anything was reduced. */
static void print_hygiene(FILE *f, const wh_reduce_params *p, const wh_reduce_report *r)
{
	const struct {
		uint64_t n;
		const char *what;
		uint64_t faces;
		const char *how;
	} kind[] = {
	    {r->invalid_vertices, "vertices that are not finite", r->invalid_faces,
	     "faces with them"},
	    {r->welded_vertices, "vertices, welded to others", r->collapsed_faces,
	     "faces that lost a corner so"},
	    {p->weld || p->drop_duplicates ? r->duplicate_faces : 0, "copies of faces", 0, NULL},
	    {r->small_components, "small components", r->component_faces, "faces of them"}};
	for (size_t i = 0; i < sizeof kind / sizeof *kind; i++) {
		if (kind[i].n == 0)
			continue;
		(void)fprintf(f, "dropped %llu %s", (unsigned long long)kind[i].n, kind[i].what);
		if (kind[i].how)
			(void)fprintf(f, ", %llu %s", (unsigned long long)kind[i].faces,
			              kind[i].how);
		(void)fputc('\n', f);
	}
}

/* Are both files in one folder? */
static bool lie_together(const char *a, const char *b)
{
	const char *const path[] = {a, b};
	struct stat st[2];
	char folder[PATH_MAX];
	for (int i = 0; i < 2; i++) {
		const char *slash = strrchr(path[i], '/');
		const size_t n = slash ? (size_t)(slash + 1 - path[i]) : 0;
		if (n + 2 > sizeof folder)
			return false;
		(void)snprintf(folder, sizeof folder, "%.*s.", (int)n, path[i]);
		if (stat(folder, &st[i]) != 0)
			return false;
	}
	return st[0].st_dev == st[1].st_dev && st[0].st_ino == st[1].st_ino;
}

/* Says what has to lie beside the result. */
static void print_references(FILE *f, const wh_reduce_params *p, const wh_reduce_report *r)
{
	if (r->refers[0])
		(void)fprintf(f, "refers to %s%s\n", r->refers,
		              lie_together(p->input, p->output)
		                  ? ""
		                  : ": put them beside it, as they are beside the input");
}

/* Says so when the limits leave all as it was. */
static void print_nothing_to_do(FILE *f, const wh_reduce_report *r)
{
	const bool vertices = r->target_faces == 0;
	const uint64_t target = vertices ? r->target_vertices : r->target_faces,
	               there = vertices ? r->input_vertices : r->input_faces;
	if (r->unchanged)
		(void)fprintf(f, "the target is no smaller than the input: copied unchanged\n");
	else if (target >= there && there > 0)
		(void)fprintf(f, "nothing to reduce: the target is %llu %s, the input has %llu\n",
		              (unsigned long long)target,
		              vertices ? vertices_word(target) : faces_word(target),
		              (unsigned long long)there);
}

static void print_notes(FILE *f, const reduce_options *o, const wh_reduce_report *r)
{
	print_nothing_to_do(f, r);
	if (r->one_less)
		(void)fprintf(
		    f, "%llu faces instead of %llu: a closed surface has an even number\n",
		    (unsigned long long)r->output_faces, (unsigned long long)r->target_faces);
	if (r->carried[0])
		(void)fprintf(f, "carried over: %s\n", r->carried);
	if (r->dropped[0])
		(void)fprintf(f, "not carried over: %s\n", r->dropped);
	print_references(f, &o->params, r);
	if (r->degenerate_faces)
		(void)fprintf(f, "dropped %llu degenerate %s\n",
		              (unsigned long long)r->degenerate_faces,
		              faces_word(r->degenerate_faces));
	if (r->unreferenced_vertices)
		(void)fprintf(f, "dropped %llu %s without faces\n",
		              (unsigned long long)r->unreferenced_vertices,
		              vertices_word(r->unreferenced_vertices));
	if (r->joined_vertices)
		(void)fprintf(f, "joined %llu copies of vertices along borders of charts\n",
		              (unsigned long long)r->joined_vertices);
	print_hygiene(f, &o->params, r);
	print_topology(f, r);
	if (r->nonmanifold_kept)
		(void)fprintf(f, "kept %llu non-manifold %s in place\n",
		              (unsigned long long)r->nonmanifold_kept,
		              vertices_word(r->nonmanifold_kept));
}

static void print_phase(FILE *f, const char *name, const wh_phase_report *p, int threads)
{
	const double full = p->seconds * threads;
	(void)fprintf(f, "  %-9s %8.2f s, threads %3.0f %% busy\n", name, p->seconds,
	              full > 0 ? 100 * p->busy / full : 0);
}

static void print_levels(FILE *f, const wh_reduce_params *p, const wh_reduce_report *r)
{
	for (size_t i = 0; i < p->levels; i++) {
		const wh_level_report *l = &r->level[i];
		if (l->left_out)
			(void)fprintf(f, "%s: left out, as it would be no smaller than the input\n",
			              p->level[i].output);
		else
			(void)fprintf(f, "%s: %llu %s, %llu %s%s\n", p->level[i].output,
			              (unsigned long long)l->faces, faces_word(l->faces),
			              (unsigned long long)l->vertices, vertices_word(l->vertices),
			              l->exhausted ? ": more than asked for" : "");
	}
}

static void print_summary(FILE *f, const reduce_options *o, const wh_reduce_report *r)
{
	print_levels(f, &o->params, r);
	(void)fprintf(f, "%s: %llu faces -> %s: %llu faces, %llu vertices\n", o->params.input,
	              (unsigned long long)r->input_faces, o->params.output,
	              (unsigned long long)r->output_faces, (unsigned long long)r->output_vertices);
	print_notes(f, o, r);
	(void)fprintf(
	    f, "%.1f s, %.2f M faces removed/s, peak memory %.0f MiB, temporary disk %.0f MiB\n",
	    r->seconds_total, reduce_faces_per_second(r) / 1e6, (double)cmd_peak_rss() / 1048576.0,
	    (double)r->temp_bytes_peak / 1048576.0);
	if (!o->verbose)
		return;
	for (int i = 0; i < WH_PHASES; i++)
		print_phase(f, wh_phase_name((wh_phase)i), &r->phase[i], r->threads);
}

static bool prints_output(const reduce_options *o)
{
	return cmd_is_dash(o->params.output) || cmd_is_dash(o->report) ||
	       cmd_is_dash(o->params.seams);
}

static void print_notice(void *user, const char *text)
{
	const reduce_options *o = user;
	if (!o->quiet)
		(void)fprintf(stderr, "whittle reduce: %s\n", text);
}

/* An argument as a shell takes it. */
static void print_quoted(FILE *f, const char *arg)
{
	static const char plain[] = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ"
	                            "0123456789_-+=./,:@%";
	if (*arg && arg[strspn(arg, plain)] == '\0') {
		(void)fputs(arg, f);
		return;
	}
	(void)fputc('\'', f);
	for (; *arg; arg++)
		(void)fputs(*arg == '\'' ? "'\\''" : (char[2]){*arg, '\0'}, f);
	(void)fputc('\'', f);
}

/* The command that goes on with what this one has done. */
static void print_how_to_resume(const reduce_options *o, int argc, char **argv, bool kept)
{
	if (kept)
		(void)fprintf(stderr, "whittle reduce: what is done is kept in '%s'; to go on%s:\n",
		              o->params.run_dir,
		              wh_mpi_processes() > 1 ? ", by any number of processes" : "");
	else
		(void)fputs("whittle reduce: nothing was done yet; to start again:\n", stderr);
	(void)fputs("  whittle", stderr);
	for (int i = 0; i < argc; i++) {
		(void)fputc(' ', stderr);
		print_quoted(stderr, argv[i]);
		if (i == 0 && !o->params.resume)
			(void)fputs(" --resume", stderr);
	}
	(void)fputc('\n', stderr);
}

/* ---- stages ------------------------------------------------------------------------------- */

/* What comes next, after a stage that is not the last. */
static void print_paused(const reduce_options *o, const wh_reduce_report *r)
{
	const wh_reduce_params *p = &o->params;
	if (p->stage != WH_STAGE_JOIN)
		(void)printf("done\n");
	else if (r->next_round)
		(void)printf("joined; next: whittle stage decimate --round %u\n", r->next_round);
	else
		(void)printf("joined; next: whittle stage finish\n");
}

static void write_log_to(const char *path, const cmd_env *env, const wh_reduce_report *r)
{
	char host[256] = "";
	FILE *f = fopen(path, "ae");
	if (!f)
		return; /* a log is no reason to fail */
	(void)gethostname(host, sizeof host - 1);
	(void)fprintf(f, "%s, process %ld: %.2f s, %d threads, peak memory %.0f MiB: %s\n", host,
	              (long)getpid(), r->seconds_total, r->threads,
	              (double)cmd_peak_rss() / 1048576.0,
	              env->ctx.err.code == WH_OK ? "done" : env->ctx.err.text);
	for (int i = 0; i < WH_PHASES; i++)
		if (r->phase[i].seconds > 0)
			print_phase(f, wh_phase_name((wh_phase)i), &r->phase[i], r->threads);
	(void)fclose(f);
}

/* With -v each stage tells in a file of its own, in the run directory, how it went. */
static void write_log(const reduce_options *o, const cmd_env *env, const wh_reduce_report *r)
{
	static const char *const name[] = {"all", "plan", "ingest", "decimate", "join", "finish"};
	const wh_reduce_params *p = &o->params;
	char path[PATH_MAX];
	if (!o->verbose || p->stage == WH_STAGE_ALL || p->stage == WH_STAGE_PLAN)
		return;
	size_t n = (size_t)snprintf(path, sizeof path, "%s/log-%s", p->run_dir, name[p->stage]);
	if (p->stage == WH_STAGE_DECIMATE && n < sizeof path)
		n += (size_t)snprintf(path + n, sizeof path - n, "-%u", p->round);
	if ((p->stage == WH_STAGE_DECIMATE || p->stage == WH_STAGE_INGEST) && n < sizeof path)
		n += (size_t)snprintf(path + n, sizeof path - n, "-part-%05u", p->part + 1);
	if (n < sizeof path)
		write_log_to(path, env, r);
}

/* ---- ranks -------------------------------------------------------------------------------- */

/* The same for each process of an MPI job. */
static void write_rank_log(const reduce_options *o, const cmd_env *env, const wh_reduce_report *r)
{
	const char *dir = o->params.run_dir;
	char path[PATH_MAX];
	if (!o->verbose || !dir ||
	    (size_t)snprintf(path, sizeof path, "%s/log-rank-%05d", dir, r->rank) >= sizeof path)
		return;
	(void)mkdir(dir, 0777); /* it may have gone with the end of the run */
	write_log_to(path, env, r);
}

/* Says what stopped this rank; returns the status. Those that the others' end has stopped have
 * nothing to say. */
static int tell_rank_failure(const reduce_options *o, const cmd_env *env, const wh_reduce_report *r,
                             int argc, char **argv)
{
	char host[256] = "";
	if (env->ctx.err.code == WH_E_INTERRUPT && r->rank != 0)
		return cmd_failure_status(env);
	(void)gethostname(host, sizeof host - 1);
	if (r->ranks > 1 && env->ctx.err.code != WH_E_INTERRUPT)
		(void)fprintf(stderr, "whittle reduce: process %d of %d, on %s, ends the run:\n",
		              r->rank, r->ranks, host);
	const int status = cmd_report_failure(env);
	if (env->ctx.err.code == WH_E_INTERRUPT || env->ctx.err.code == WH_E_RUN)
		print_how_to_resume(o, argc, argv, o->params.run_dir != NULL);
	return status;
}

/* ---- all of it ---------------------------------------------------------------------------- */

/* Words and report of a run that has come to its end. */
static int tell_result(const reduce_options *o, const cmd_env *env, const wh_reduce_report *r,
                       wh_code code)
{
	FILE *words = prints_output(o) ? stderr : stdout;
	wh_compare *measured = NULL;
	if (!o->quiet)
		print_summary(words, o, r);
	const wh_code failed = o->measure ? reduce_measure(o, env, r, &measured) : WH_OK;
	if (measured && !o->quiet)
		reduce_measure_print(words, o, r, measured);
	const bool told =
	    !o->report || reduce_report_write(env, o->report, &o->params, r, measured) == 0;
	free(measured);
	if (!told)
		return WH_E_RUN;
	if (failed != WH_OK)
		return failed == WH_E_INTERRUPT ? cmd_report_failure(env) : (int)failed;
	return code == WH_OK ? WH_OK : cmd_report_failure(env);
}

/* A run that has come to its end leaves its output, and nothing to go on with. */
static int check_ended(const reduce_options *o)
{
	const wh_reduce_params *p = &o->params;
	struct stat st;
	if (!p->resume || p->force || wh_spill_is_kept(p->run_dir) || stat(p->output, &st) != 0 ||
	    !S_ISREG(st.st_mode))
		return WH_OK;
	return cmd_usage_error("reduce",
	                       "nothing to resume in '%s': that run has ended, and '%s' is its "
	                       "output; -f makes it again",
	                       p->run_dir, p->output);
}

static int check_names(const reduce_options *o)
{
	if (check_report_name(o) != WH_OK || check_seams_name(o) != WH_OK ||
	    check_ended(o) != WH_OK)
		return WH_E_USAGE;
	return reduce_measure_check(o);
}

/* Progress and notices go to the user. */
static void listen(reduce_options *o, progress_bar *bar)
{
	progress_bar_init(bar, !o->quiet && !o->no_progress);
	o->params.progress = progress_bar_tell;
	o->params.progress_user = bar;
	o->params.notice = print_notice;
	o->params.notice_user = o;
}

int reduce_run(const char *name, reduce_options *o, int argc, char **argv)
{
	const bool last = o->params.stage == WH_STAGE_ALL || o->params.stage == WH_STAGE_FINISH;
	if (last && check_names(o) != WH_OK)
		return WH_E_USAGE;
	cmd_env env;
	cmd_env_init(&env, name);
	if (last && o->report && reduce_report_try(&env, o->report, o->params.force) != 0)
		return WH_E_RUN;
	progress_bar bar;
	listen(o, &bar);
	if (o->params.run_dir)
		cmd_stop_on_usr1();
	wh_reduce_report report;
	const wh_code code = wh_reduce(&env.ctx, &o->params, &report);
	progress_bar_end(&bar);
	write_log(o, &env, &report);
	if (code != WH_OK && code != WH_E_TARGET) {
		const int failed = cmd_report_failure(&env);
		if (o->params.stage == WH_STAGE_ALL &&
		    (report.resumable || (o->params.run_dir && code == WH_E_INTERRUPT)))
			print_how_to_resume(o, argc, argv, report.resumable);
		return failed;
	}
	if (last)
		return tell_result(o, &env, &report, code);
	if (!o->quiet && o->params.stage != WH_STAGE_PLAN)
		print_paused(o, &report);
	return WH_OK;
}

/* One of several processes: the first one tells, all the same way as if it were alone. */
static int run_rank(reduce_options *o, int argc, char **argv)
{
	cmd_env env;
	if (check_names(o) != WH_OK)
		return WH_E_USAGE;
	cmd_env_init(&env, "reduce");
	cmd_stop_on_usr1();
	progress_bar bar;
	listen(o, &bar);
	wh_reduce_report report;
	const wh_code code = wh_reduce_mpi(&env.ctx, &o->params, &report);
	if (report.rank == 0)
		progress_bar_end(&bar);
	write_rank_log(o, &env, &report);
	if (code != WH_OK && code != WH_E_TARGET) {
		const int status = tell_rank_failure(o, &env, &report, argc, argv);
		wh_reduce_mpi_abort(status);
		return status;
	}
	return report.rank == 0 ? tell_result(o, &env, &report, code) : WH_OK;
}

int cmd_reduce(int argc, char **argv)
{
	reduce_options o = {.params = wh_reduce_defaults()};
	const int status = reduce_options_parse(argc, argv, false, &o);
	if (status != WH_OK)
		return status;
	if (o.help) {
		(void)fputs(help, stdout);
		return WH_OK;
	}
	return wh_mpi_processes() > 1 ? run_rank(&o, argc, argv)
	                              : reduce_run(argv[0], &o, argc, argv);
}
