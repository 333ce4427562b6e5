#define _POSIX_C_SOURCE 200809L
#include "reduce_run.h"

#include "cmd.h"
#include "progress_bar.h"
#include "reduce_log.h"
#include "reduce_measure.h"
#include "reduce_report.h"
#include "reduce_words.h"

#include "io/outfile.h"
#include "io/spill.h"

#include <stdio.h>
#include <stdlib.h>
#include <sys/stat.h>
#include <unistd.h>

/* ---- before it begins --------------------------------------------------------------------- */

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
static int check_report_name(const char *command, const reduce_options *o)
{
	if (!o->report)
		return WH_OK;
	if (is_taken(o, o->report, o->params.seams))
		return cmd_usage_error(command, "--report '%s' is the input or another output",
		                       o->report);
	struct stat st;
	if (!o->params.force && stat(o->report, &st) == 0 && S_ISREG(st.st_mode))
		return cmd_usage_error(command, "--report '%s' exists already; -f replaces it",
		                       o->report);
	return WH_OK;
}

static int check_seams_name(const char *command, const reduce_options *o)
{
	const char *seams = o->params.seams;
	if (seams && is_taken(o, seams, NULL))
		return cmd_usage_error(command, "--seams '%s' is the input or another output",
		                       seams);
	return WH_OK;
}

/* A run that has come to its end leaves its output, and nothing to go on with. */
static int check_ended(const char *command, const reduce_options *o)
{
	const wh_reduce_params *p = &o->params;
	struct stat st;
	if (!p->resume || p->force || wh_spill_is_kept(p->run_dir) || stat(p->output, &st) != 0 ||
	    !S_ISREG(st.st_mode))
		return WH_OK;
	return cmd_usage_error(command,
	                       "nothing to resume in '%s': that run has ended, and '%s' is its "
	                       "output; -f makes it again",
	                       p->run_dir, p->output);
}

static int check_names(const char *command, const reduce_options *o)
{
	if (check_report_name(command, o) != WH_OK || check_seams_name(command, o) != WH_OK ||
	    check_ended(command, o) != WH_OK)
		return WH_E_USAGE;
	return reduce_measure_check(o);
}

static void print_notice(void *user, const char *text)
{
	const reduce_options *o = user;
	if (!o->quiet)
		(void)fprintf(stderr, "whittle reduce: %s\n", text);
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

/* ---- at its end --------------------------------------------------------------------------- */

static bool prints_output(const reduce_options *o)
{
	return cmd_is_dash(o->params.output) || cmd_is_dash(o->report) ||
	       cmd_is_dash(o->params.seams);
}

/* Words and report of a run that has come to its end. */
static int tell_result(const reduce_options *o, const cmd_env *env, const wh_reduce_report *r,
                       wh_code code)
{
	FILE *words = prints_output(o) ? stderr : stdout;
	wh_compare *measured = NULL;
	if (!o->quiet)
		reduce_words_summary(words, o, r);
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
		reduce_words_resume(o, argc, argv, o->params.run_dir != NULL);
	return status;
}

/* ---- the run ------------------------------------------------------------------------------ */

int reduce_run(const char *name, reduce_options *o, int argc, char **argv)
{
	const bool last = o->params.stage == WH_STAGE_ALL || o->params.stage == WH_STAGE_FINISH;
	const bool reports = o->report && o->params.stage != WH_STAGE_PLAN;
	if (last ? check_names(name, o) : reports ? check_report_name(name, o) : WH_OK)
		return WH_E_USAGE;
	cmd_env env;
	cmd_env_init(&env, name);
	if (reports && reduce_report_try(&env, o->report, o->params.force) != 0)
		return WH_E_RUN;
	progress_bar bar;
	listen(o, &bar);
	if (o->params.run_dir)
		cmd_stop_on_usr1();
	wh_reduce_report report;
	const wh_code code = wh_reduce(&env.ctx, &o->params, &report);
	progress_bar_end(&bar);
	reduce_log_stage(o, &env, &report);
	if (code != WH_OK && code != WH_E_TARGET) {
		const int failed = cmd_report_failure(&env);
		if (o->params.stage == WH_STAGE_ALL &&
		    (report.resumable || (o->params.run_dir && code == WH_E_INTERRUPT)))
			reduce_words_resume(o, argc, argv, report.resumable);
		return failed;
	}
	if (last)
		return tell_result(o, &env, &report, code);
	if (o->params.stage == WH_STAGE_PLAN)
		return WH_OK;
	if (!o->quiet)
		reduce_words_paused(cmd_is_dash(o->report) ? stderr : stdout, o, &report);
	return !o->report || reduce_report_write_stage(&env, o->report, &report) == 0 ? WH_OK
	                                                                              : WH_E_RUN;
}

int reduce_run_rank(reduce_options *o, int argc, char **argv)
{
	cmd_env env;
	if (check_names("reduce", o) != WH_OK)
		return WH_E_USAGE;
	cmd_env_init(&env, "reduce");
	cmd_stop_on_usr1();
	progress_bar bar;
	listen(o, &bar);
	wh_reduce_report report;
	const wh_code code = wh_reduce_mpi(&env.ctx, &o->params, &report);
	if (report.rank == 0)
		progress_bar_end(&bar);
	reduce_log_rank(o, &env, &report);
	if (code != WH_OK && code != WH_E_TARGET) {
		const int status = tell_rank_failure(o, &env, &report, argc, argv);
		wh_reduce_mpi_abort(status);
		return status;
	}
	return report.rank == 0 ? tell_result(o, &env, &report, code) : WH_OK;
}
