/*
 * The page that plays a progressive mesh: tools/page/play.html, with the finest level and its
 * splits as columns of little-endian numbers, which tools/page/play.js undoes and does again.
 */
#include "replay_page.h"

#include "cmd.h"
#include "page_files.h"
#include "page_out.h"

#include "algo/progressive.h"

#include <math.h>
#include <string.h>

typedef struct play_page {
	const replay_options *o;
	const wh_progressive *p; /* at the finest level of the page */
	wh_vec3 middle;
	double scale; /* the level has a diagonal of 1 */
} play_page;

/* ---- columns ------------------------------------------------------------------------------ */

static uint32_t scaled(double x, double middle, double scale)
{
	const float f = (float)((x - middle) * scale);
	uint32_t bits;
	memcpy(&bits, &f, sizeof bits);
	return bits;
}

static uint32_t coordinate(const play_page *g, const wh_vec3 *at, size_t i)
{
	const wh_vec3 *v = &at[i / 3];
	return i % 3 == 0   ? scaled(v->x, g->middle.x, g->scale)
	       : i % 3 == 1 ? scaled(v->y, g->middle.y, g->scale)
	                    : scaled(v->z, g->middle.z, g->scale);
}

static uint32_t get_place(const play_page *g, size_t i)
{
	return coordinate(g, g->p->pos, i);
}

static uint32_t get_other(const play_page *g, size_t i)
{
	return coordinate(g, g->p->other, i);
}

static uint32_t get_corner(const play_page *g, size_t i)
{
	return g->p->at.tri[i];
}

static uint32_t get_vertex(const play_page *g, size_t i)
{
	return g->p->v[i];
}

static uint32_t get_made(const play_page *g, size_t i)
{
	return g->p->faces[i];
}

static uint32_t get_turned(const play_page *g, size_t i)
{
	return g->p->first[i + 1] - g->p->first[i];
}

static uint32_t get_turns(const play_page *g, size_t i)
{
	return g->p->moved[i];
}

/* Red, green or blue, from 0 to 255, of one of a row of records. */
static uint32_t colour(const play_page *g, const uint8_t *records, size_t i)
{
	const wh_attributes *a = &g->p->file.attributes;
	const wh_attribute *item = &a->item[a->rgb[i % 3]];
	return (uint32_t)lrint(255 * wh_attribute_share(item, records + i / 3 * a->bytes));
}

static uint32_t get_colour(const play_page *g, size_t i)
{
	return colour(g, g->p->attr, i);
}

static uint32_t get_other_colour(const play_page *g, size_t i)
{
	return colour(g, g->p->other_attr, i);
}

enum { CHUNK = 3 * 1024 }; /* numbers: base64 of three bytes ends on a letter */

/* n numbers of 4 bytes or 1. */
static void put_column(const play_page *g, const page_out *o, const char *name, size_t n,
                       uint32_t (*get)(const play_page *g, size_t i), bool bytes)
{
	uint8_t chunk[4 * CHUNK];
	page_putf(o, "<script type=\"text/plain\" id=\"%s\">", name);
	for (size_t i = 0; i < n && wh_poll(o->c) == WH_OK; i += CHUNK) {
		const size_t most = n - i < CHUNK ? n - i : CHUNK;
		for (size_t k = 0; k < most; k++)
			if (bytes)
				chunk[k] = (uint8_t)get(g, i + k);
			else
				(void)wh_put32(chunk + 4 * k, get(g, i + k));
		page_base64(o, chunk, bytes ? most : 4 * most);
	}
	page_put(o, "</script>\n");
}

/* ---- places of the page ------------------------------------------------------------------- */

static void write_title(const play_page *g, const page_out *o)
{
	page_text(o, page_name(g->o->input));
}

static void write_words(const play_page *g, const page_out *o)
{
	const wh_pmesh_head *h = &g->p->file.head;
	page_put(o, "From ");
	page_count(o, h->base_faces);
	page_put(o, " to ");
	page_count(o, g->p->nf);
	page_put(o, " triangles, a vertex at a time");
	if (g->p->level < h->splits) {
		page_put(o, "; the file goes on to ");
		page_count(o, h->faces);
	}
	page_put(o, ".");
}

static void write_data(const play_page *g, const page_out *o)
{
	static const char *const ups[] = {"x", "y", "z"};
	const wh_progressive *p = g->p;
	const replay_look *l = &g->o->look;
	const wh_pmesh_head *h = &p->file.head;
	json_t *j = json_pack("{s:I, s:I}", "base_vertices", (json_int_t)h->base_vertices,
	                      "base_faces", (json_int_t)h->base_faces);
	if (l->up >= 0)
		(void)json_object_set_new(j, "up", json_string(ups[l->up]));
	if (l->turned[0])
		(void)json_object_set_new(j, "azimuth", json_real(l->turn[0]));
	if (l->turned[1])
		(void)json_object_set_new(j, "elevation", json_real(l->turn[1]));
	page_put(o, "<script type=\"application/json\" id=\"data\">");
	page_json(o, j);
	page_put(o, "</script>\n");
	json_decref(j);
	put_column(g, o, "place", 3 * (size_t)p->nv, get_place, false);
	put_column(g, o, "corner", 3 * (size_t)p->nf, get_corner, false);
	put_column(g, o, "vertex", p->level, get_vertex, false);
	put_column(g, o, "other", 3 * (size_t)p->level, get_other, false);
	put_column(g, o, "made", p->level, get_made, true);
	put_column(g, o, "turned", p->level, get_turned, true);
	put_column(g, o, "turns", p->first[p->level], get_turns, false);
	if (p->file.attributes.has_rgb) {
		put_column(g, o, "colour", 3 * (size_t)p->nv, get_colour, true);
		put_column(g, o, "other-colour", 3 * (size_t)p->level, get_other_colour, true);
	}
	page_scripts(o, page_view, page_play);
}

static void write_place(const void *page, const page_out *o, const char *name, size_t n)
{
	static const struct {
		const char *name;
		void (*write)(const play_page *g, const page_out *o);
	} places[] = {{"title", write_title}, {"words", write_words}, {"data", write_data}};
	for (size_t i = 0; i < sizeof places / sizeof *places; i++)
		if (strlen(places[i].name) == n && strncmp(places[i].name, name, n) == 0)
			places[i].write(page, o);
}

/* ---- the whole ---------------------------------------------------------------------------- */

static void find_frame(play_page *g)
{
	const wh_progressive *p = g->p;
	wh_vec3 lo = wh_v3(INFINITY, INFINITY, INFINITY), hi = wh_scale(lo, -1);
	for (uint32_t v = 0; v < p->nv; v++) {
		lo = wh_lower(lo, p->pos[v]);
		hi = wh_upper(hi, p->pos[v]);
	}
	const double size = wh_norm(wh_sub(hi, lo));
	g->middle = wh_add(wh_scale(lo, 0.5), wh_scale(hi, 0.5));
	g->scale = size > 0 && isfinite(1 / size) ? 1 / size : 1;
}

static wh_code write_page(wh_ctx *c, const replay_options *o, const wh_progressive *p)
{
	play_page g = {.o = o, .p = p};
	page_out out = {.c = c};
	if (wh_outfile_open(c, &out.file, o->page, o->out.force) != WH_OK)
		return c->err.code;
	find_frame(&g);
	page_put_whole(&out, page_play_html, write_place, &g);
	if (c->err.code == WH_OK)
		(void)wh_outfile_commit(c, &out.file);
	wh_outfile_abort(c, &out.file);
	return c->err.code;
}

wh_code replay_page(wh_ctx *c, const replay_options *o, uint64_t level)
{
	wh_progressive p;
	if (page_three_bytes == 0)
		return wh_fail(c, WH_E_USAGE,
		               "this whittle was built without three.js, which plays on the page "
		               "(Debian: libjs-three)");
	wh_code code = wh_progressive_open(c, &p, o->input);
	if (code == WH_OK)
		code = wh_progressive_seek(c, &p, level);
	if (code == WH_OK)
		code = write_page(c, o, &p);
	wh_progressive_close(c, &p);
	return code;
}
