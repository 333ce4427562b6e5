/* whittle plan: options -> parameters -> prediction -> a table or JSON. */
#include "cmd.h"
#include "reduce_options.h"
#include "reduce_run.h"
#include "stage_file.h"

#include <inttypes.h>
#include <jansson.h>
#include <stdio.h>

static const char help[] =
    "usage: whittle plan IN --faces N | --vertices N | --ratio R | --error E\n"
    "Says what whittle reduce would take with the same options, without doing it:\n"
    "clusters, memory, temporary disk, passes, rounds. Reads the header only.\n\n"
    "  --memory SIZE, --threads N, --cluster-faces N, ...   as for reduce\n"
    "  --json   print JSON instead of a table\n\n"
    "  -o OUT --run-dir DIR --parts N   also begin a run there that several processes\n"
    "           will share, and print its stages: see whittle stage --help\n\n"
    "Leaves with status 5 when reduce would refuse the ceiling; the table then says\n"
    "which one would do. With --error alone nobody knows how much will be left:\n"
    "rounds, memory and disk are then a rough guess.\n";

static void row_count(const char *what, uint64_t n)
{
	(void)printf("%-28s %14" PRIu64 "\n", what, n);
}

static void row_size(const char *what, double bytes)
{
	(void)printf("%-28s %14.1f MiB\n", what, bytes / 1048576);
}

static void print_table(const wh_plan_report *r)
{
	row_count("input faces", r->input_faces);
	row_count("input vertices", r->input_vertices);
	row_size("input file", (double)r->input_bytes);
	if (r->target_faces)
		row_count("target faces", r->target_faces);
	if (r->target_vertices)
		row_count("target vertices", r->target_vertices);
	if (r->unchanged) {
		(void)printf("the target is no smaller than the input: it would be copied\n");
		return;
	}
	row_count("clusters", r->clusters);
	row_count("rounds", (uint64_t)r->rounds);
	row_count("passes over the input", (uint64_t)r->passes);
	row_count("windows of the vertex table", r->windows);
	(void)printf("%-28s %14s\n", "output is streamed", r->streamed ? "yes" : "no");
	row_count("threads", (uint64_t)r->threads);
	row_size("memory ceiling", (double)r->memory_ceiling);
	row_size("smallest ceiling that does", (double)r->memory_least);
	if (r->target_faces == 0 && r->target_vertices == 0)
		(void)printf("No count is given: what follows, and the rounds, are guesses.\n");
	row_size("memory expected", (double)r->peak_rss);
	row_size("temporary disk expected", (double)r->temp_bytes_peak);
	if (r->rewritten)
		(void)printf("The body has to be rewritten first; its faces are the header's.\n");
}

/* ---- stages ------------------------------------------------------------------------------- */

/* One line of the sequence: the stage, its round (0: it has none), in parts or not. */
typedef void stage_fn(void *to, const char *stage, int round, bool parts);

/* The stages of a run, in their order. */
static void each_stage(const wh_plan_report *r, stage_fn *fn, void *to)
{
	const int rounds = r->unchanged ? 0 : r->rounds;
	if (r->shared_input)
		fn(to, "ingest", 0, true);
	for (int i = 1; i <= rounds; i++) {
		fn(to, "join", 0, false);
		fn(to, "decimate", i, true);
	}
	fn(to, "finish", 0, false);
}

static void print_stage(void *to, const char *stage, int round, bool parts)
{
	const reduce_options *o = to;
	(void)printf("  whittle stage %s --run-dir %s", stage, o->params.run_dir);
	if (round)
		(void)printf(" --round %d", round);
	if (parts)
		(void)printf(" --part I/%u", o->params.parts);
	(void)printf("\n");
}

static void print_stages(reduce_options *o, const wh_plan_report *r)
{
	(void)printf(
	    "The run directory is made. Stages, each after the one before it, and those of\n"
	    "parts for every I from 1 to %u, in any order:\n",
	    o->params.parts);
	each_stage(r, print_stage, o);
	if (!r->shared_input && !r->unchanged)
		(void)printf("The input has to be %s first: the first join ingests it alone.\n",
		             o->params.seams ? "gone through in order" : "rewritten");
}

static void list_stage(void *to, const char *stage, int round, bool parts)
{
	json_t *one = json_pack("{s:s, s:b}", "stage", stage, "parts", parts);
	if (round)
		(void)json_object_set_new(one, "round", json_integer(round));
	(void)json_array_append_new(to, one);
}

/* ---- the plan ----------------------------------------------------------------------------- */

static wh_code print_json(wh_ctx *c, const reduce_options *o, const wh_plan_report *r)
{
	const char *path = o->params.input;
	json_t *name = json_string(path); /* NULL when the path is not UTF-8 */
	json_t *j = json_pack(
	    "{s:o, s:I, s:I, s:I, s:I, s:I, s:b, s:b, s:i, s:i, s:i, s:i, s:b, s:i, s:I, s:I, s:I, "
	    "s:I}",
	    "file", name ? name : json_null(), "input_bytes", (json_int_t)r->input_bytes,
	    "input_vertices", (json_int_t)r->input_vertices, "input_faces",
	    (json_int_t)r->input_faces, "target_faces", (json_int_t)r->target_faces,
	    "target_vertices", (json_int_t)r->target_vertices, "unchanged", r->unchanged,
	    "rewritten", r->rewritten, "clusters", (int)r->clusters, "windows", (int)r->windows,
	    "rounds", r->rounds, "passes", r->passes, "streamed", r->streamed, "threads",
	    r->threads, "memory_ceiling", (json_int_t)r->memory_ceiling, "memory_least",
	    (json_int_t)r->memory_least, "peak_rss_bytes", (json_int_t)r->peak_rss,
	    "temp_bytes_peak", (json_int_t)r->temp_bytes_peak);
	if (o->params.run_dir) {
		json_t *stages = json_array();
		each_stage(r, list_stage, stages);
		(void)json_object_set_new(j, "parts", json_integer(o->params.parts));
		(void)json_object_set_new(j, "stages", stages);
	}
	const int bad = !j || json_dumpf(j, stdout, JSON_INDENT(2)) != 0;
	json_decref(j);
	(void)printf("\n");
	return bad ? wh_fail(c, WH_E_RUN, "the JSON could not be written") : WH_OK;
}

/* Makes the run directory and leaves the options there. Returns the status. */
static int begin_run(cmd_env *env, reduce_options *o, int argc, char **argv)
{
	o->params.stage = WH_STAGE_PLAN;
	o->params.resume = true; /* planning again is no harm */
	const int status = reduce_run(argv[0], o, argc, argv);
	if (status != WH_OK)
		return status;
	return stage_file_write(&env->ctx, o->params.run_dir, argc, argv) == WH_OK
	           ? WH_OK
	           : cmd_report_failure(env);
}

int cmd_plan(int argc, char **argv)
{
	reduce_options o = {.params = wh_reduce_defaults()};
	const int status = reduce_options_parse(argc, argv, true, &o);
	if (status != WH_OK)
		return status;
	if (o.help) {
		(void)fputs(help, stdout);
		return WH_OK;
	}
	cmd_env env;
	cmd_env_init(&env, argv[0]);
	wh_plan_report report;
	const wh_code code = wh_plan_reduce(&env.ctx, &o.params, &report);
	if (code != WH_OK && code != WH_E_PLAN)
		return cmd_report_failure(&env);
	if (code == WH_OK && o.params.run_dir) {
		const int failed = begin_run(&env, &o, argc, argv);
		if (failed)
			return failed;
	}
	if (!o.json)
		print_table(&report);
	else if (print_json(&env.ctx, &o, &report) != WH_OK)
		return cmd_report_failure(&env);
	if (!o.json && code == WH_OK && o.params.run_dir)
		print_stages(&o, &report);
	return code == WH_OK ? WH_OK : cmd_report_failure(&env);
}
