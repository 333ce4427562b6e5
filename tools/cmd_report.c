/* whittle report: options -> what is gathered of the meshes -> one page. */
#define _POSIX_C_SOURCE 200809L
#include "page_parts.h"

#include "base/timer.h"
#include "exec/topo.h"

#include <stdio.h>
#include <string.h>

static const char help[] =
    "usage: whittle report INPUT RESULT... -o PAGE.html [--json REPORT.json]\n"
    "One HTML page of a reduction, which needs nothing else: pictures before and after,\n"
    "maps and tables of the distances, time and memory by phase, and the result to turn\n"
    "around. RESULT: one level of INPUT or several.\n\n"
    "  -o, --output FILE   where to; - is standard output\n"
    "      --json FILE     what reduce --report wrote; again for each run. Distances that\n"
    "                      it measured are not measured again, unless with --samples\n"
    "      --seams FILE    what reduce --seams wrote: do the cuts show?\n"
    "      --title TEXT    default: the name of INPUT\n"
    "      --shown N       most faces of a level on the page (400K): larger ones are reduced\n"
    "                      to that for it, and the page says so\n"
    "      --samples N     points a side that distances are measured at (as in compare)\n"
    "      --size WxH      of the pictures, in pixels (1000x750)\n"
    "      --up x|y|z      default: z when the mesh lies flat in it, else y\n"
    "      --azimuth DEG   of the pictures: to the right of the front\n"
    "      --elevation DEG above the horizon\n"
    "      --memory SIZE   ceiling of the process (default: half of what there is)\n"
    "      --threads N     0 (default): all this process may use\n"
    "      --temp-dir DIR  for what the ceiling has no room for\n"
    "  -f, --force         write over an existing page\n"
    "  -q, --quiet         no progress and no words (--no-progress: no progress)\n";

static wh_code gather(page_work *w)
{
	wh_code (*const steps[])(page_work *) = {page_files_open, page_pictures, page_compare,
	                                         page_meshes};
	wh_code code = wh_spill_open(w->c, &w->spill, w->o->temp_dir, "/tmp");
	for (size_t i = 0; code == WH_OK && i < sizeof steps / sizeof *steps; i++) {
		code = steps[i](w);
		wh_mem_trim(w->c);
	}
	return code;
}

static wh_code make_page(page_work *w)
{
	page_out out = {.c = w->c};
	if (wh_outfile_open(w->c, &out.file, w->o->output, w->o->force) != WH_OK)
		return w->c->err.code;
	if (gather(w) == WH_OK) {
		page_write(w, &out);
		(void)wh_outfile_commit(w->c, &out.file);
	}
	wh_outfile_abort(w->c, &out.file);
	return w->c->err.code;
}

static void print_words(const page_work *w, double seconds)
{
	FILE *f = strcmp(w->o->output, "-") == 0 ? stderr : stdout;
	(void)fprintf(f, "%s: %d %s, %.2f s, peak memory %.0f MiB\n", w->o->output, w->n - 1,
	              w->n == 2 ? "level" : "levels", seconds, (double)cmd_peak_rss() / 1048576.0);
	if (!w->drawn)
		(void)fprintf(f, "without pictures: this whittle was built without libpng\n");
}

int cmd_report(int argc, char **argv)
{
	report_options o;
	const int status = report_options_parse(argc, argv, &o);
	if (status != WH_OK)
		return status;
	if (o.help) {
		(void)fputs(help, stdout);
		return WH_OK;
	}
	cmd_env e;
	progress_bar bar;
	const double start = wh_seconds();
	cmd_env_init(&e, argv[0]);
	e.exec.workers = cmd_threads(argv[0], o.threads);
	progress_bar_init(&bar, !o.quiet && !o.no_progress);
	page_work w = {.c = &e.ctx,
	               .ex = &e.exec,
	               .o = &o,
	               .bar = &bar,
	               .memory = o.memory ? (size_t)o.memory : wh_topo_memory() / 2};
	const wh_code code = make_page(&w);
	progress_bar_end(&bar);
	if (code == WH_OK && !o.quiet)
		print_words(&w, wh_seconds() - start);
	page_work_free(&w);
	return code == WH_OK ? WH_OK : cmd_report_failure(&e);
}
