/* How the levels were made: what reduce --report wrote, as far as it is there. */
#include "page_parts.h"

#include <math.h>
#include <string.h>

/* A number of an object within objects: "seconds.total". NAN when there is none. */
static double number(const json_t *j, const char *keys)
{
	char key[64];
	for (;;) {
		const size_t n = strcspn(keys, ".");
		if (n >= sizeof key)
			return NAN;
		memcpy(key, keys, n);
		key[n] = '\0';
		j = json_object_get(j, key);
		if (keys[n] == '\0')
			return json_is_number(j) ? json_number_value(j) : NAN;
		keys += n + 1;
	}
}

static void put_whole(const page_out *o, double x)
{
	if (!(fabs(x) < 1e15)) {
		page_real(o, x);
		return;
	}
	page_put(o, x < 0 ? "&minus;" : "");
	page_count(o, (uint64_t)fabs(x));
}

/* ---- figures at the head of the page -------------------------------------------------------- */

static void put_figure(const page_out *o, const char *what)
{
	page_putf(o, "<div><dt>%s</dt><dd>", what);
}

/* The level that all figures of one level are of: the first, which the view begins with. */
static const page_mesh *head_level(const page_work *w)
{
	return &w->mesh[1];
}

/* Under a figure: its level, where there are several, and what else there is to say. */
static void put_of_level(const page_work *w, const page_out *o, double percent, const char *of)
{
	if (w->n > 2) {
		page_put(o, "<dd class=\"sub name\">");
		page_text(o, page_name(head_level(w)->path));
		page_put(o, "</dd>");
	}
	page_put(o, "<dd class=\"sub\">");
	page_real(o, percent);
	page_putf(o, "&#8239;%% of the %s</dd>", of);
}

static void put_size(const page_work *w, const page_out *o)
{
	const uint64_t from = w->mesh[0].faces, to = head_level(w)->faces;
	put_figure(o, "Triangles");
	page_count(o, from);
	page_put(o, " <span class=\"to\">&rarr;</span> ");
	page_count(o, to);
	page_put(o, "</dd>");
	if (from > 0)
		put_of_level(w, o, (double)to / (double)from * 100, "input");
	page_put(o, "</div>\n");
}

static void put_error(const page_work *w, const page_out *o)
{
	const wh_compare *r = &head_level(w)->distance;
	put_figure(o, "RMS distance");
	page_real(o, r->rms);
	page_put(o, "</dd>");
	if (r->diagonal > 0)
		put_of_level(w, o, r->rms / r->diagonal * 100, "diagonal");
	page_put(o, "</div>\n");
}

/* Of all runs together. */
static void put_costs(const page_work *w, const page_out *o)
{
	double seconds = 0, memory = 0;
	for (int i = 0; i < w->o->nruns; i++) {
		seconds += fmax(number(w->runs[i], "seconds.total"), 0);
		memory = fmax(memory, number(w->runs[i], "peak_rss_bytes"));
	}
	if (seconds > 0) {
		put_figure(o, w->o->nruns > 1 ? "Time, all runs" : "Time");
		page_seconds(o, seconds);
		page_put(o, "</dd></div>\n");
	}
	if (memory > 0) {
		put_figure(o, w->o->nruns > 1 ? "Peak memory, all runs" : "Peak memory");
		page_bytes(o, memory);
		page_put(o, "</dd></div>\n");
	}
}

void page_write_figures(const page_work *w, const page_out *o)
{
	put_size(w, o);
	put_error(w, o);
	put_costs(w, o);
}

/* ---- phases --------------------------------------------------------------------------------- */

typedef struct scale {
	double seconds, memory; /* the largest of any phase */
	double threads;
} scale;

static double phase_memory(const json_t *phase)
{
	return number(phase, "memory_bytes_peak");
}

static scale find_scale(const json_t *run, json_t *phases)
{
	scale s = {0, 0, fmax(number(run, "threads"), 1)};
	const char *name;
	json_t *phase;
	json_object_foreach(phases, name, phase)
	{
		s.seconds = fmax(s.seconds, number(phase, "seconds"));
		s.memory = fmax(s.memory, phase_memory(phase));
	}
	return s;
}

/* A bar, and in it how much of it was work; shares of the whole width. */
static void put_bar(const page_out *o, const char *kind, double share, double inner)
{
	page_putf(o,
	          "<td class=\"chart\"><svg class=\"%s\" viewBox=\"0 0 100 10\" "
	          "preserveAspectRatio=\"none\" aria-hidden=\"true\"><rect width=\"%.2f\" "
	          "height=\"10\"/>",
	          kind, share * 100);
	if (inner > 0)
		page_putf(o, "<rect class=\"inner\" width=\"%.2f\" height=\"10\"/>",
		          fmin(inner, share) * 100);
	page_put(o, "</svg></td>");
}

static void put_phase(const page_out *o, const char *name, const json_t *phase, const scale *s)
{
	const double seconds = number(phase, "seconds"), memory = phase_memory(phase);
	const double busy = number(phase, "busy_seconds") / s->threads;
	page_put(o, "<tr><th scope=\"row\">");
	page_text(o, name);
	page_put(o, "</th>");
	put_bar(o, "time", s->seconds > 0 ? seconds / s->seconds : 0,
	        s->seconds > 0 ? busy / s->seconds : 0);
	page_put(o, "<td>");
	page_seconds(o, seconds);
	page_put(o, "</td>");
	if (s->memory > 0) {
		put_bar(o, "memory", memory > 0 ? memory / s->memory : 0, 0);
		page_put(o, "<td>");
		page_bytes(o, memory > 0 ? memory : 0);
		page_put(o, "</td>");
	}
	page_put(o, "<td>");
	page_bytes(o, fmax(number(phase, "bytes_read"), 0));
	page_put(o, "</td><td>");
	page_bytes(o, fmax(number(phase, "bytes_written"), 0));
	page_put(o, "</td></tr>\n");
}

static void put_phases(const page_out *o, const json_t *run)
{
	json_t *phases = json_object_get(run, "phases");
	const scale s = find_scale(run, phases);
	const char *name;
	json_t *phase;
	if (s.seconds <= 0)
		return;
	page_put(o, "<h4>Time and memory by phase</h4>\n<div class=\"scroll\" tabindex=\"0\" "
	            "role=\"group\" "
	            "aria-label=\"Phases\"><table class=\"phases\">\n<thead><tr>"
	            "<th scope=\"col\">Phase</th><th scope=\"col\" colspan=\"2\">Time</th>");
	page_put(o, s.memory > 0 ? "<th scope=\"col\" colspan=\"2\">Memory</th>" : "");
	page_put(
	    o, "<th scope=\"col\">Read</th><th scope=\"col\">Written</th></tr></thead>\n<tbody>\n");
	json_object_foreach(phases, name, phase) if (number(phase, "seconds") > 0)
	    put_phase(o, name, phase, &s);
	page_put(o, "</tbody></table></div>\n<p class=\"small\">The strong part of a bar: threads "
	            "at work, on average, of ");
	put_whole(o, s.threads);
	page_put(o, ".</p>\n");
}

/* ---- lists of figures ----------------------------------------------------------------------- */

typedef enum kind { COUNT, REAL, BYTES, SECONDS } kind;

typedef struct item {
	const char *keys, *text;
	kind kind;
} item;

static const item costs[] = {
    {"seconds.total", "Time", SECONDS},
    {"faces_per_second", "Triangles removed a second", COUNT},
    {"threads", "Threads", COUNT},
    {"ranks", "Processes", COUNT},
    {"peak_rss_bytes", "Peak memory", BYTES},
    {"parameters.memory_bytes", "Ceiling", BYTES},
    {"temp_bytes_peak", "Temporary disk", BYTES},
    {"bytes_read", "Read", BYTES},
    {"bytes_written", "Written", BYTES},
    {"clusters", "Clusters", COUNT},
    {"rounds", "Rounds", COUNT},
    {"windows", "Windows of vertices", COUNT},
    {"cut_vertices", "Vertices on cuts", COUNT},
    {"never_free_vertices", "On cuts in every round", COUNT},
    {"resumed", "Times resumed", COUNT},
};

static const item result[] = {
    {"output.faces", "Triangles", COUNT},
    {"output.vertices", "Vertices", COUNT},
    {"output.bytes", "File", BYTES},
    {"output.components", "Components", COUNT},
    {"output.boundary_loops", "Boundary loops", COUNT},
    {"output.boundary_edges", "Boundary edges", COUNT},
    {"output.nonmanifold_edges", "Non-manifold edges", COUNT},
    {"output.euler_characteristic", "Euler characteristic", COUNT},
    {"error.cost_distance", "Dearest collapse, as a distance", REAL},
    {"error.accumulated_estimate", "Estimated error", REAL},
};

static const item topology[] = {
    {"topology.shells_removed", "Small parts removed", COUNT},
    {"topology.holes_closed", "Holes closed", COUNT},
    {"topology.necks_cut", "Handles and necks cut", COUNT},
    {"topology.bridges_cut", "Bridges cut", COUNT},
    {"topology.nonmanifold_vertices_split", "Vertices split", COUNT},
    {"nonmanifold_vertices_kept", "Non-manifold vertices kept", COUNT},
};

static void put_item(const page_out *o, const item *t, double x)
{
	page_putf(o, "<div><dt>%s</dt><dd>", t->text);
	if (t->kind == BYTES)
		page_bytes(o, x);
	else if (t->kind == SECONDS)
		page_seconds(o, x);
	else if (t->kind == COUNT)
		put_whole(o, x);
	else
		page_real(o, x);
	page_put(o, "</dd></div>\n");
}

static void put_list(const page_out *o, const char *title, const json_t *run, const item *items,
                     size_t n)
{
	page_putf(o, "<div class=\"list\"><h4>%s</h4><dl>\n", title);
	for (size_t i = 0; i < n; i++) {
		const double x = number(run, items[i].keys);
		if (isfinite(x))
			put_item(o, &items[i], x);
	}
	page_put(o, "</dl></div>\n");
}

static const struct {
	const char *title;
	const item *items;
	size_t n;
} lists[] = {
    {"What it took", costs, sizeof costs / sizeof *costs},
    {"What came out", result, sizeof result / sizeof *result},
    {"Topology", topology, sizeof topology / sizeof *topology},
};

/* ---- parameters ----------------------------------------------------------------------------- */

static void put_value(const page_out *o, const json_t *v)
{
	if (json_is_string(v))
		page_text(o, *json_string_value(v) ? json_string_value(v) : "none");
	else if (json_is_boolean(v))
		page_put(o, json_is_true(v) ? "yes" : "no");
	else if (json_is_integer(v))
		put_whole(o, (double)json_integer_value(v));
	else if (json_is_number(v))
		page_real(o, json_number_value(v));
	else
		page_put(o, "&ndash;");
}

/* Names of JSON as words. */
static void put_key(const page_out *o, const char *key)
{
	char words[64];
	size_t n = strlen(key);
	n = n < sizeof words ? n : sizeof words - 1;
	for (size_t i = 0; i < n; i++)
		words[i] = key[i];
	words[n] = '\0';
	for (char *s = words; (s = strchr(s, '_')) != NULL;)
		*s = ' ';
	page_text(o, words);
}

static void put_parameters(const page_out *o, const json_t *run)
{
	const char *key;
	json_t *value;
	page_put(o, "<div class=\"list\"><h4>Parameters</h4><dl>\n");
	json_object_foreach(json_object_get(run, "parameters"), key, value)
	{
		page_put(o, "<div><dt>");
		put_key(o, key);
		page_put(o, "</dt><dd>");
		put_value(o, value);
		page_put(o, "</dd></div>\n");
	}
	page_put(o, "</dl></div>\n");
}

/* ---- a run ---------------------------------------------------------------------------------- */

static void put_text(const page_out *o, const json_t *run, const char *object, const char *key,
                     const char *before)
{
	const json_t *v = json_object_get(json_object_get(run, object), key);
	if (!json_is_string(v) || !*json_string_value(v))
		return;
	page_put(o, before);
	page_text(o, json_string_value(v));
}

static void put_words(const page_out *o, const json_t *run)
{
	const json_t *version = json_object_get(run, "version");
	page_put(o, "<p class=\"small\">whittle ");
	page_text(o, json_is_string(version) ? json_string_value(version) : "?");
	put_text(o, run, "output", "checksum_xxh3_128", "; XXH3 of the result ");
	put_text(o, run, "input", "carried_over", "; carried over: ");
	put_text(o, run, "input", "not_carried_over", "; not carried over: ");
	page_put(o, "</p>\n");
}

static void put_run(const page_out *o, const json_t *run)
{
	const char *path =
	    json_string_value(json_object_get(json_object_get(run, "output"), "path"));
	page_put(o, "<section class=\"run\"><h3>");
	page_text(o, path ? page_name(path) : "?");
	page_put(o, "</h3>\n");
	put_phases(o, run);
	page_put(o, "<div class=\"lists\">\n");
	for (size_t i = 0; i < sizeof lists / sizeof *lists; i++)
		put_list(o, lists[i].title, run, lists[i].items, lists[i].n);
	put_parameters(o, run);
	page_put(o, "</div>\n");
	put_words(o, run);
	page_put(o, "</section>\n");
}

void page_write_runs(const page_work *w, const page_out *o)
{
	if (w->o->nruns == 0)
		return;
	page_put(o, w->o->nruns > 1 ? "<section id=\"runs\"><h2>The runs</h2>\n"
	                            : "<section id=\"runs\"><h2>The run</h2>\n");
	for (int i = 0; i < w->o->nruns; i++)
		put_run(o, w->runs[i]);
	page_put(o, "</section>\n");
}
