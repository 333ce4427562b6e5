#define _POSIX_C_SOURCE 200809L
#include "reduce_report.h"
#include "compare_json.h"
#include "compare_seams.h"

#include "io/outfile.h"

#include <jansson.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

double reduce_faces_per_second(const wh_reduce_report *r)
{
	const uint64_t gone =
	    r->input_faces > r->output_faces ? r->input_faces - r->output_faces : 0;
	return r->seconds_total > 0 ? (double)gone / r->seconds_total : 0;
}

static void put_count(json_t *o, const char *key, uint64_t n)
{
	(void)json_object_set_new(o, key, json_integer((json_int_t)n));
}

static void put_real(json_t *o, const char *key, double x)
{
	(void)json_object_set_new(o, key, json_real(x));
}

static void put_text(json_t *o, const char *key, const char *text)
{
	(void)json_object_set_new(o, key, json_string(text));
}

static void put_flag(json_t *o, const char *key, bool on)
{
	(void)json_object_set_new(o, key, json_boolean(on));
}

static json_t *put_object(json_t *o, const char *key)
{
	json_t *child = json_object();
	(void)json_object_set_new(o, key, child);
	return child;
}

/* What went before anything was reduced, and what was asked for. */
static void put_hygiene(json_t *root, const wh_reduce_params *p, const wh_reduce_report *r)
{
	json_t *o = put_object(root, "hygiene");
	put_flag(o, "drop_invalid", p->drop_invalid);
	put_count(o, "invalid_vertices", r->invalid_vertices);
	put_count(o, "invalid_faces", r->invalid_faces);
	put_flag(o, "weld", p->weld);
	put_real(o, "weld_distance", r->weld_distance);
	put_count(o, "welded_vertices", r->welded_vertices);
	put_count(o, "collapsed_faces", r->collapsed_faces);
	put_flag(o, "drop_duplicates", p->drop_duplicates || p->weld);
	put_count(o, "duplicate_faces", r->duplicate_faces);
	put_count(o, "zero_area_faces", r->zero_area_faces);
	put_count(o, "min_component", p->min_component);
	put_count(o, "small_components", r->small_components);
	put_count(o, "small_component_faces", r->component_faces);
	put_count(o, "small_component_vertices", r->component_vertices);
}

static void put_parameters(json_t *root, const wh_reduce_params *p, const wh_reduce_report *r)
{
	json_t *o = put_object(root, "parameters");
	put_count(o, "faces", p->faces);
	put_real(o, "face_ratio", p->face_ratio);
	put_count(o, "vertices", p->vertices);
	put_real(o, "vertex_ratio", p->vertex_ratio);
	put_real(o, "error", p->error);
	put_real(o, "error_share", p->error_share);
	put_flag(o, "fast", p->fast);
	put_flag(o, "lock_boundary", p->lock_boundary);
	put_text(o, "topology", p->simplify_topology ? "simplify" : "keep");
	put_text(o, "cost", p->own ? "own" : p->cost ? p->cost : "memoryless");
	put_text(o, "own_policy", p->own && p->own->name ? p->own->name : "");
	put_text(o, "face_weight", p->face_weight ? p->face_weight : "area");
	put_text(o, "placement", p->placement ? p->placement : "usual");
	put_text(o, "attributes", p->attributes ? p->attributes : "all");
	put_text(o, "weights", p->weights ? p->weights : "");
	put_flag(o, "quantize", p->quantize);
	put_count(o, "memory_bytes", r->memory_ceiling);
	put_count(o, "cluster_faces", p->cluster_faces);
	put_count(o, "micro_faces", p->micro_faces);
	put_count(o, "final_faces", p->final_faces);
	put_real(o, "round_keep", p->round_keep);
	put_count(o, "smooth", p->smooth);
	put_flag(o, "normals", p->normals);
}

static void put_input(json_t *root, const wh_reduce_params *p, const wh_reduce_report *r)
{
	json_t *o = put_object(root, "input");
	put_text(o, "path", p->input);
	put_count(o, "bytes", r->input_bytes);
	put_count(o, "vertices", r->input_vertices);
	put_count(o, "faces", r->input_faces);
	put_count(o, "polygons", r->polygons);
	put_count(o, "degenerate_faces", r->degenerate_faces);
	put_count(o, "unreferenced_vertices", r->unreferenced_vertices);
	put_count(o, "joined_vertices", r->joined_vertices);
	put_text(o, "carried_over", r->carried);
	put_text(o, "not_carried_over", r->dropped);
	put_real(o, "diagonal", r->diagonal);
}

static void put_output(json_t *root, const wh_reduce_params *p, const wh_reduce_report *r)
{
	json_t *o = put_object(root, "output");
	put_text(o, "path", p->output);
	put_count(o, "bytes", r->output_bytes);
	put_count(o, "vertices", r->output_vertices);
	put_count(o, "faces", r->output_faces);
	put_text(o, "checksum_xxh3_128", r->checksum);
	put_text(o, "refers_to", r->refers);
	if (!r->checked)
		return; /* copied, or not looked at for want of memory */
	put_count(o, "boundary_edges", r->boundary_edges);
	put_count(o, "boundary_loops", r->boundary_loops);
	put_count(o, "nonmanifold_edges", r->nonmanifold_edges);
	put_count(o, "nonmanifold_vertices", r->nonmanifold_vertices);
	put_count(o, "misoriented_edges", r->misoriented_edges);
	put_count(o, "duplicate_faces", r->output_duplicate_faces);
	put_count(o, "zero_area_faces", r->output_zero_area_faces);
	put_count(o, "folded_edges", r->folded_edges);
	put_count(o, "components", r->components);
	(void)json_object_set_new(o, "euler_characteristic", json_integer(r->euler));
}

/* a is the input, b a result. */
static void put_measured(json_t *root, const wh_compare *measured)
{
	json_t *o = put_object(root, "measured");
	(void)compare_json_fill(o, measured);
	if (measured->banded)
		(void)json_object_set_new(o, "seams", compare_seams_json(measured, NULL));
}

/* The results before the last, which the rest of the report is about. */
static void put_levels(json_t *root, const wh_reduce_params *p, const wh_reduce_report *r,
                       const wh_compare *measured)
{
	json_t *list = json_array();
	for (size_t i = 0; i < p->levels; i++) {
		const wh_level_report *l = &r->level[i];
		json_t *o = json_object();
		put_text(o, "path", p->level[i].output);
		put_count(o, "target_faces", l->target_faces);
		put_real(o, "target_error",
		         p->level[i].error > 0 ? p->level[i].error
		                               : p->level[i].error_share * r->diagonal);
		put_flag(o, "left_out", l->left_out);
		put_count(o, "bytes", l->bytes);
		put_count(o, "vertices", l->vertices);
		put_count(o, "faces", l->faces);
		put_text(o, "checksum_xxh3_128", l->checksum);
		put_flag(o, "streamed", l->streamed);
		put_flag(o, "one_less", l->one_less);
		put_flag(o, "exhausted", l->exhausted);
		put_real(o, "cost_distance", l->cost_distance);
		put_real(o, "accumulated_estimate", l->accumulated_error);
		if (l->checked) {
			put_count(o, "boundary_edges", l->boundary_edges);
			put_count(o, "nonmanifold_edges", l->nonmanifold_edges);
			put_count(o, "components", l->components);
		}
		if (measured && !l->left_out)
			put_measured(o, &measured[i]);
		(void)json_array_append_new(list, o);
	}
	(void)json_object_set_new(root, "levels", list);
}

static void put_topology(json_t *root, const wh_reduce_report *r)
{
	json_t *o = put_object(root, "topology");
	put_count(o, "shells_removed", r->shells);
	put_count(o, "holes_closed", r->holes);
	put_count(o, "necks_cut", r->necks);
	put_count(o, "bridges_cut", r->bridges);
	put_count(o, "nonmanifold_vertices_split", r->nonmanifold_split);
}

static void put_outcome(json_t *root, const wh_reduce_report *r)
{
	json_t *t = put_object(root, "target");
	put_count(t, "faces", r->target_faces);
	put_count(t, "vertices", r->target_vertices);
	put_flag(t, "unchanged", r->unchanged);
	put_flag(t, "one_less", r->one_less);
	put_flag(t, "exhausted", r->exhausted);
	json_t *e = put_object(root, "error");
	put_real(e, "cost_distance", r->cost_distance);
	put_real(e, "accumulated_estimate", r->accumulated_error);
	put_count(root, "nonmanifold_vertices_kept", r->nonmanifold_kept);
	put_topology(root, r);
	put_flag(root, "streamed", r->streamed);
	put_count(root, "never_free_vertices", r->never_free_vertices);
}

static void put_phase(json_t *phases, const char *name, const wh_phase_report *p)
{
	json_t *o = put_object(phases, name), *model = json_array();
	put_real(o, "seconds", p->seconds);
	put_real(o, "serial_seconds", p->serial);
	put_real(o, "busy_seconds", p->busy);
	for (int k = 0; k < WH_SCALING; k++)
		(void)json_array_append_new(model, json_real(p->model[k]));
	(void)json_object_set_new(o, "model_seconds", model);
	put_count(o, "bytes_read", p->bytes_read);
	put_count(o, "bytes_written", p->bytes_written);
	put_count(o, "memory_bytes_peak", p->memory_peak);
}

static void put_costs(json_t *root, const wh_reduce_report *r)
{
	put_count(root, "clusters", r->clusters);
	put_count(root, "windows", r->windows);
	put_count(root, "rounds", r->rounds);
	put_count(root, "cut_vertices", r->cut_vertices);
	put_count(root, "threads", (uint64_t)r->threads);
	put_count(root, "ranks", r->ranks ? (uint64_t)r->ranks : 1);
	put_count(root, "resumed", r->resumed);
	put_count(root, "peak_rss_bytes", cmd_peak_rss());
	put_count(root, "temp_bytes_peak", r->temp_bytes_peak);
	put_count(root, "bytes_read", r->bytes_read);
	put_count(root, "bytes_written", r->bytes_written);
	json_t *s = put_object(root, "seconds");
	for (int i = 0; i < WH_PHASES; i++)
		put_real(s, wh_phase_name((wh_phase)i), r->phase[i].seconds);
	put_real(s, "total", r->seconds_total);
	json_t *phases = put_object(root, "phases");
	for (int i = 0; i < WH_PHASES; i++)
		put_phase(phases, wh_phase_name((wh_phase)i), &r->phase[i]);
}

static wh_code write_text(wh_ctx *c, const char *path, bool force, const json_t *root)
{
	wh_outfile *o;
	char *text = json_dumps(root, JSON_INDENT(2) | JSON_REAL_PRECISION(9));
	if (!text)
		return wh_fail(c, WH_E_RUN, "out of memory");
	if (wh_outfile_open(c, &o, path, force) == WH_OK) {
		(void)wh_outfile_write(c, o, text, strlen(text));
		(void)wh_outfile_write(c, o, "\n", 1);
		(void)wh_outfile_commit(c, &o);
	}
	free(text);
	return c->err.code;
}

int reduce_report_try(const cmd_env *e, const char *path, bool force)
{
	struct stat st;
	wh_ctx c = wh_ctx_fork(&e->ctx);
	wh_outfile *o;
	if (strcmp(path, "-") == 0 || (stat(path, &st) == 0 && !S_ISREG(st.st_mode)))
		return 0;
	if (wh_outfile_open(&c, &o, path, force) == WH_OK) {
		wh_outfile_abort(&c, &o);
		return 0;
	}
	(void)fprintf(stderr, "whittle %s: --report: %s\n", e->name, c.err.text);
	return -1;
}

/* The report goes to `path`, and from memory. 0, or -1 after printing why not: `what` is there. */
static int write_report(const cmd_env *e, const char *path, bool force, json_t *root,
                        const char *what)
{
	wh_ctx c = wh_ctx_fork(&e->ctx);
	const wh_code code = write_text(&c, path, force, root);
	json_decref(root);
	if (code != WH_OK)
		(void)fprintf(stderr, "whittle %s: %s, but not the report: %s\n", e->name, what,
		              c.err.text);
	return code == WH_OK ? 0 : -1;
}

int reduce_report_write_stage(const cmd_env *e, const char *path, const wh_reduce_report *r)
{
	json_t *root = json_object();
	put_text(root, "version", WHITTLE_VERSION);
	put_costs(root, r);
	return write_report(e, path, true, root, "the stage was done");
}

int reduce_report_write(const cmd_env *e, const char *path, const wh_reduce_params *p,
                        const wh_reduce_report *r, const wh_compare *measured)
{
	json_t *root = json_object();
	put_text(root, "version", WHITTLE_VERSION);
	put_parameters(root, p, r);
	put_input(root, p, r);
	put_hygiene(root, p, r);
	put_output(root, p, r);
	put_outcome(root, r);
	put_levels(root, p, r, measured);
	put_costs(root, r);
	put_real(root, "faces_per_second", reduce_faces_per_second(r));
	if (measured)
		put_measured(root, &measured[p->levels]);
	return write_report(e, path, p->force, root, "the mesh was written");
}
