#define _POSIX_C_SOURCE 200809L
#include "reduce_log.h"

#include "reduce_words.h"

#include <limits.h>
#include <stdio.h>
#include <sys/stat.h>
#include <unistd.h>

static void write_to(const char *path, const cmd_env *env, const wh_reduce_report *r)
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
	reduce_words_phases(f, r);
	(void)fclose(f);
}

void reduce_log_stage(const reduce_options *o, const cmd_env *env, const wh_reduce_report *r)
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
		write_to(path, env, r);
}

void reduce_log_rank(const reduce_options *o, const cmd_env *env, const wh_reduce_report *r)
{
	const char *dir = o->params.run_dir;
	char path[PATH_MAX];
	if (!o->verbose || !dir ||
	    (size_t)snprintf(path, sizeof path, "%s/log-rank-%05d", dir, r->rank) >= sizeof path)
		return;
	(void)mkdir(dir, 0777); /* it may have gone with the end of the run */
	write_to(path, env, r);
}
