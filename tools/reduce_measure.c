#define _POSIX_C_SOURCE 200809L
#include "reduce_measure.h"

#include "compare_json.h"
#include "progress_bar.h"

#include "io/outfile.h"
#include "pipeline/measure.h"

#include <stdlib.h>
#include <string.h>

/* A result that is read again: one of the levels, or the output. */
static const char *result_of(const wh_reduce_params *p, size_t i)
{
	return i < p->levels ? p->level[i].output : p->output;
}

static bool is_left_out(const wh_reduce_params *p, const wh_reduce_report *r, size_t i)
{
	return i < p->levels && r->level[i].left_out;
}

static bool writes_glb(const wh_reduce_params *p)
{
	return p->to ? strncmp(p->to, "glb", 3) == 0
	             : wh_format_of_name(p->output) == WH_FORMAT_GLB;
}

int reduce_measure_check(const reduce_options *o)
{
	const wh_reduce_params *p = &o->params;
	if (!o->measure)
		return WH_OK;
	if (wh_ply_is_read_once(p->input))
		return cmd_usage_error("reduce", "--measure needs an input that can be read again: "
		                                 "save it to a file first");
	for (size_t i = 0; i <= p->levels; i++)
		if (cmd_is_dash(result_of(p, i)) || wh_outfile_same(p->input, result_of(p, i)))
			return cmd_usage_error("reduce", "--measure needs an output that is a "
			                                 "file of its own");
	if (cmd_is_dash(p->seams))
		return cmd_usage_error("reduce", "--measure needs --seams to be a file");
	if (writes_glb(p))
		return cmd_usage_error("reduce", "--measure cannot read glb: write another format");
	return WH_OK;
}

/* Lists the results that are there. */
static size_t list_results(const wh_reduce_params *p, const wh_reduce_report *r,
                           wh_compare *measured, wh_measure_other *other)
{
	size_t n = 0;
	for (size_t i = 0; i <= p->levels; i++)
		if (!is_left_out(p, r, i))
			other[n++] =
			    (wh_measure_other){result_of(p, i), WH_FORMAT_ANY, &measured[i]};
	return n;
}

/* The folder of a file, to be freed. */
static char *folder_of(const char *path)
{
	const char *slash = strrchr(path, '/');
	if (!slash)
		return strdup(".");
	return strndup(path, slash == path ? 1 : (size_t)(slash - path));
}

/* Temporary files go where those of the run went. */
static wh_code measure_in(wh_ctx *c, const reduce_options *o, const wh_reduce_report *r,
                          const char *folder, wh_compare *measured)
{
	progress_bar bar;
	wh_measure_other other[WH_LEVELS_MOST + 1];
	wh_measure_params p = {.a = o->params.input,
	                       .other = other,
	                       .others = list_results(&o->params, r, measured, other),
	                       .seams = o->params.seams,
	                       .samples = (uint64_t)o->samples,
	                       .temp_dir = o->params.temp_dir,
	                       .fallback = folder,
	                       .memory = r->memory_ceiling,
	                       .progress = progress_bar_tell,
	                       .progress_user = &bar};
	if (o->params.from)
		(void)cmd_parse_from(o->params.from, &p.from);
	const wh_exec ex = {.workers = r->threads};
	progress_bar_init(&bar, !o->quiet && !o->no_progress);
	const wh_code code = wh_measure_files(c, &ex, &p);
	progress_bar_end(&bar);
	return code;
}

wh_code reduce_measure(const reduce_options *o, const cmd_env *env, const wh_reduce_report *r,
                       wh_compare **measured)
{
	wh_ctx c = wh_ctx_fork(&env->ctx);
	char *folder = folder_of(o->params.output);
	*measured = calloc(o->params.levels + 1, sizeof **measured);
	const wh_code code = folder && *measured ? measure_in(&c, o, r, folder, *measured)
	                                         : wh_fail(&c, WH_E_RUN, "out of memory");
	free(folder);
	if (code == WH_OK)
		return WH_OK;
	free(*measured);
	*measured = NULL;
	(void)fprintf(stderr,
	              "whittle %s: the mesh was written, but its distance not measured (whittle "
	              "compare does it): %s\n",
	              env->name, c.err.text);
	return code;
}

static void print_one(FILE *f, const wh_compare *m)
{
	(void)fprintf(f,
	              "measured: RMS %.6g (%.2f millionths of the diagonal), mean %.6g, 99 %% "
	              "%.6g, max %.6g\n",
	              m->rms, compare_millionths(m->rms, m->diagonal), m->both.mean, m->both.p99,
	              m->both.max);
	if (m->banded)
		(void)fprintf(f, "along the seams: RMS %.6g, elsewhere %.6g\n", m->band.rms,
		              m->interior.rms);
}

void reduce_measure_print(FILE *f, const reduce_options *o, const wh_reduce_report *r,
                          const wh_compare *measured)
{
	const wh_reduce_params *p = &o->params;
	for (size_t i = 0; i <= p->levels; i++) {
		if (is_left_out(p, r, i))
			continue;
		if (p->levels > 0)
			(void)fprintf(f, "%s ", result_of(p, i));
		print_one(f, &measured[i]);
	}
}
