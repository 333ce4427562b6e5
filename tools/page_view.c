/* The view in three dimensions, and the data that programs may read. */
#include "page_files.h"
#include "page_parts.h"
#include "whittle.h"

static const char controls[] =
    "<div class=\"stage\">\n"
    "<canvas id=\"canvas\" tabindex=\"0\" role=\"application\" aria-label=\"The mesh in three "
    "dimensions\" aria-describedby=\"keys\"></canvas>\n"
    "<p id=\"trouble\" class=\"note\" hidden></p>\n"
    "<noscript><p class=\"note\">The view needs JavaScript.</p></noscript>\n"
    "</div>\n"
    "<div class=\"controls\">\n"
    "<fieldset id=\"levels\"><legend>Level</legend></fieldset>\n"
    "<div class=\"slider\"></div>\n" /* kept for levels without steps */
    "<div class=\"buttons\">\n"
    "<button type=\"button\" id=\"wireframe\" aria-pressed=\"false\">Wireframe</button>\n"
    "<button type=\"button\" id=\"facets\" aria-pressed=\"false\">Facets</button>\n"
    "<button type=\"button\" id=\"nearer\" aria-label=\"Zoom in\">+</button>\n"
    "<button type=\"button\" id=\"farther\" aria-label=\"Zoom out\">&minus;</button>\n"
    "<button type=\"button\" id=\"reset\">Reset</button>\n"
    "</div>\n"
    "<p id=\"count\" role=\"status\"></p>\n"
    "</div>\n"
    "<p id=\"keys\" class=\"keys\">Drag to turn; with the right button, Shift or two fingers to "
    "move; wheel or pinch to zoom. Keys: arrows turn, with Shift they move, <kbd>+</kbd> "
    "<kbd>&minus;</kbd> zoom, <kbd>W</kbd> wireframe, <kbd>F</kbd> facets, <kbd>[</kbd> "
    "<kbd>]</kbd> levels, <kbd>0</kbd> reset.</p>\n";

void page_write_view(const page_work *w, const page_out *o)
{
	page_put(o, "<section id=\"view\"><h2>The result, to turn around</h2>\n");
	if (page_three_bytes == 0)
		page_put(o, "<p class=\"note\">No view in three dimensions: this whittle was built "
		            "without three.js (Debian&rsquo;s libjs-three).</p>\n");
	else
		page_put(o, controls);
	(void)w;
	page_put(o, "</section>\n");
}

/* ---- data ----------------------------------------------------------------------------------- */

static void set_text(json_t *j, const char *key, const char *text)
{
	json_t *value = json_string(text); /* NULL when it is not UTF-8 */
	(void)json_object_set_new(j, key, value ? value : json_string("?"));
}

static void set_count(json_t *j, const char *key, uint64_t n)
{
	(void)json_object_set_new(j, key, json_integer((json_int_t)n));
}

static json_t *json_level(const page_mesh *m)
{
	const wh_compact_grid *g = &m->grid;
	json_t *j = json_object();
	set_text(j, "name", page_name(m->path));
	set_count(j, "faces", m->faces);
	set_count(j, "vertices", m->vertices);
	set_count(j, "shown_faces", m->shown.nf);
	set_count(j, "shown_vertices", m->shown.nv);
	(void)json_object_set_new(j, "step", json_real(g->step));
	(void)json_object_set_new(j, "origin",
	                          json_pack("[fff]", g->origin.x, g->origin.y, g->origin.z));
	return j;
}

static void write_json(const page_work *w, const page_out *o)
{
	static const char *const ups[] = {"x", "y", "z"};
	json_t *j = json_object(), *levels = json_array(), *runs = json_array();
	set_text(j, "whittle", WHITTLE_VERSION);
	set_text(j, "input", page_name(w->mesh[0].path));
	set_count(j, "input_faces", w->mesh[0].faces);
	if (w->drawn) { /* else the view finds them */
		set_text(j, "up", ups[w->up]);
		(void)json_object_set_new(j, "azimuth", json_real(w->view.azimuth));
		(void)json_object_set_new(j, "elevation", json_real(w->view.elevation));
	}
	for (int i = 1; i < w->n; i++)
		(void)json_array_append_new(levels, json_level(&w->mesh[i]));
	for (int i = 0; i < w->o->nruns; i++)
		(void)json_array_append(runs, w->runs[i]);
	(void)json_object_set_new(j, "levels", levels);
	(void)json_object_set_new(j, "runs", runs);
	page_put(o, "<script type=\"application/json\" id=\"data\">");
	page_json(o, j);
	page_put(o, "</script>\n");
	json_decref(j);
}

static void write_meshes(const page_work *w, const page_out *o)
{
	for (int i = 1; i < w->n; i++) {
		page_putf(o, "<script type=\"text/plain\" id=\"mesh-%d\">", i - 1);
		page_base64(o, w->mesh[i].shown.at, w->mesh[i].shown.bytes);
		page_put(o, "</script>\n");
	}
}

void page_write_data(const page_work *w, const page_out *o)
{
	write_json(w, o);
	if (page_three_bytes == 0)
		return;
	write_meshes(w, o);
	page_scripts(o, page_view, page_levels);
}
