#define _POSIX_C_SOURCE 200809L
#include "reduce_words.h"

#include "cmd.h"
#include "reduce_report.h"

#include <limits.h>
#include <string.h>
#include <sys/stat.h>

/* ---- the summary -------------------------------------------------------------------------- */

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

/* What a phase took. */
static void print_phase(FILE *f, wh_phase phase, const wh_reduce_report *r)
{
	const wh_phase_report *p = &r->phase[phase];
	const double full = p->seconds * r->threads;
	(void)fprintf(f, "  %-9s %8.2f s, threads %3.0f %% busy\n", wh_phase_name(phase),
	              p->seconds, full > 0 ? 100 * p->busy / full : 0);
}

void reduce_words_phases(FILE *f, const wh_reduce_report *r)
{
	for (int i = 0; i < WH_PHASES; i++)
		if (r->phase[i].seconds > 0)
			print_phase(f, (wh_phase)i, r);
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

void reduce_words_summary(FILE *f, const reduce_options *o, const wh_reduce_report *r)
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
	for (int i = 0; o->verbose && i < WH_PHASES; i++)
		print_phase(f, (wh_phase)i, r);
}

/* ---- what comes next ---------------------------------------------------------------------- */

void reduce_words_paused(FILE *f, const reduce_options *o, const wh_reduce_report *r)
{
	const wh_reduce_params *p = &o->params;
	if (p->stage != WH_STAGE_JOIN)
		(void)fprintf(f, "done\n");
	else if (r->next_round)
		(void)fprintf(f, "joined; next: whittle stage decimate --round %u\n",
		              r->next_round);
	else
		(void)fprintf(f, "joined; next: whittle stage finish\n");
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

void reduce_words_resume(const reduce_options *o, int argc, char **argv, bool kept)
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
