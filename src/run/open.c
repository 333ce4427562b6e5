#define _GNU_SOURCE
#include "run/run.h"

#include "io/mesh_write.h"

#include <math.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>

enum { COPY = 1 << 20 };

/* The folder of the output: where temporary files go when nothing else is said. */
wh_code wh_run_open_spill(wh_run *r)
{
	if (r->params->run_dir)
		return wh_run_open_folder(r);
	char *folder = wh_strdup(r->c, r->params->output);
	if (!folder)
		return r->c->err.code;
	char *slash = strrchr(folder, '/');
	const char *place = ".";
	if (slash) {
		slash[slash == folder ? 1 : 0] = '\0';
		place = folder;
	}
	struct stat st;
	/* beside a device or a pipe nobody wants temporary files */
	if (stat(r->params->output, &st) == 0 && !S_ISREG(st.st_mode))
		place = ".";
	const wh_code code = wh_spill_open(r->c, &r->spill, r->params->temp_dir, place);
	wh_free(r->c, folder);
	return code;
}

/* What the file holds, as far as reading it once tells. */
static void note_input(wh_run *r)
{
	wh_reduce_report *t = r->report;
	t->input_bytes = r->input.file_bytes;
	t->input_vertices = r->input.source.nv;
	t->input_faces = r->input.source.nf;
	t->polygons = r->input.polygons;
	t->degenerate_faces = r->input.degenerate;
	r->faces = t->input_faces;
	wh_run_targets(r);
}

wh_code wh_run_open_input(wh_run *r)
{
	const wh_exec ex = wh_run_workers(r, WH_PLAN_REWRITE);
	const wh_input_how how = {.from = r->from,
	                          .attributes = wh_run_wanted(r),
	                          .rply = r->rply,
	                          .keep_invalid = r->params->drop_invalid};
	wh_progress_phase(&r->progress, "open", 1);
	if (wh_input_open_how(r->c, &ex, &r->spill, r->params->input, &how, &r->input) != WH_OK)
		return r->c->err.code;
	r->input_open = true;
	if (wh_attributes_weigh(r->c, r->input.ply.path, r->params->weights,
	                        &r->input.attributes) != WH_OK)
		return r->c->err.code;
	note_input(r);
	return WH_OK;
}

static wh_code rewrite_input(wh_run *r)
{
	const wh_exec ex = wh_run_workers(r, WH_PLAN_REWRITE);
	if (wh_input_rewrite(r->c, &ex, &r->spill, &r->input) != WH_OK)
		return r->c->err.code;
	note_input(r);
	return WH_OK;
}

static void note_dropped(wh_reduce_report *t, const char *name)
{
	wh_list_name(t->dropped, sizeof t->dropped, name);
}

/* The same for a property; those of faces often have the names of some of vertices. */
static void note_property(wh_reduce_report *t, const char *name, bool of_faces)
{
	char text[300];
	(void)snprintf(text, sizeof text, of_faces ? "%.250s of faces" : "%.250s", name);
	note_dropped(t, text);
}

/* Appends the names of the attributes of a kind, and the kind. */
static void note_carried(wh_reduce_report *t, const wh_attributes *a, wh_kind kind)
{
	uint32_t left = 0;
	for (uint32_t i = 0; i < a->n; i++)
		left += a->item[i].kind == kind;
	for (uint32_t i = 0; left > 0 && i < a->n; i++) {
		if (a->item[i].kind != kind)
			continue;
		char name[300];
		(void)snprintf(name, sizeof name, --left ? "%.250s" : "%.250s (%s)",
		               a->item[i].name, wh_kind_name(kind));
		wh_list_name(t->carried, sizeof t->carried, name);
	}
}

/* Those of vertices, with what belongs to corners on the way. */
static const wh_attributes *attributes_of_file(const wh_run *r)
{
	return r->input.wedges.of_vertices ? &r->input.whole : &r->input.attributes;
}

/* Is this property of the vertices in the result? */
static bool is_kept(const wh_run *r, int prop)
{
	const wh_ply *p = &r->input.ply;
	return prop == p->x || prop == p->y || prop == p->z ||
	       wh_attributes_find(attributes_of_file(r), prop);
}

/* Does the output have room for a scalar of faces? OBJ has names of materials and groups, and
 * nothing else. */
static bool is_written(const wh_run *r, const char *name)
{
	return r->to == WH_FORMAT_PLY || wh_wedges_names(&r->input.wedges, name);
}

/* The same of the faces. */
static bool is_kept_of_faces(const wh_run *r, int prop)
{
	const wh_ply *p = &r->input.ply;
	return prop == p->corners || (wh_wedges_has(&r->input.wedges, prop) &&
	                              (prop == r->input.wedges.list ||
	                               is_written(r, p->elems[p->face].props[prop].name)));
}

/* OBJ files are described twice over: what their faces carry, and what lines they have. */
static void note_element(wh_run *r, const char *name)
{
	const wh_wedges *w = &r->input.wedges;
	const bool obj = r->input.ply.kind == WH_FORMAT_OBJ;
	const bool normals = w->corner.has_normal || r->input.attributes.has_normal;
	const bool kept = (strcmp(name, "texture coordinates") == 0 && w->corner.has_texture) ||
	                  (strcmp(name, "normals") == 0 && normals) ||
	                  (strcmp(name, "materials") == 0 && w->materials && w->face.n) ||
	                  (strcmp(name, "groups") == 0 && w->groups && w->face.n) ||
	                  (strcmp(name, "material libraries") == 0 && w->bytes &&
	                   (r->to == WH_FORMAT_OBJ || r->to == WH_FORMAT_PLY));
	if (!obj || !kept)
		note_dropped(r->report, name);
}

/* What faces and corners carry, each name by itself. */
static void note_wedges(wh_run *r)
{
	wh_reduce_report *t = r->report;
	const wh_wedges *w = &r->input.wedges;
	if (w->list >= 0)
		wh_list_name(t->carried, sizeof t->carried, "texture coordinates of corners");
	if (w->normals >= 0)
		wh_list_name(t->carried, sizeof t->carried, "normals of corners");
	for (uint32_t i = 0; i < w->face.n; i++) {
		char name[300];
		if (!is_written(r, w->face.item[i].name))
			continue;
		(void)snprintf(name, sizeof name, "%.250s of faces", w->face.item[i].name);
		wh_list_name(t->carried, sizeof t->carried, name);
	}
}

/* What is carried over is named with its kind; so is everything else the file holds. */
void wh_run_list_dropped(wh_run *r)
{
	const wh_ply *p = &r->input.ply;
	for (size_t i = 0; i < p->nelems; i++) {
		const wh_ply_elem *e = &p->elems[i];
		const bool vertex = (int)i == p->vertex, face = (int)i == p->face;
		const bool obj_face = face && p->kind == WH_FORMAT_OBJ; /* its lines are named */
		if (!vertex && !face && (int)i != p->strips)
			note_element(r, e->name);
		for (int k = 0; (vertex || face) && !obj_face && k < (int)e->nprops; k++)
			if (vertex ? !is_kept(r, k) : !is_kept_of_faces(r, k))
				note_property(r->report, e->props[k].name, face);
	}
	if (r->params->quantize)
		note_dropped(r->report, "bits of positions beyond 16");
	else if (r->input.source.is_double && !r->params->ascii &&
	         (r->to == WH_FORMAT_STL || r->to == WH_FORMAT_GLB))
		note_dropped(r->report, "double precision");
	for (int kind = 0; kind < WH_KINDS; kind++)
		note_carried(r->report, attributes_of_file(r), (wh_kind)kind);
	note_wedges(r);
	if (p->textures.n && r->to != WH_FORMAT_PLY && !wh_run_style(r).texture)
		note_dropped(r->report, "names of texture files");
}

/* Of a body that could be used in place, when rply reads it all the same. */
static uint64_t rply_bytes(const wh_run *r)
{
	const wh_source *s = &r->input.source;
	const uint64_t vertex = (s->is_double ? 24 : 12) + r->input.attributes.bytes;
	if (!r->rply || s->ffd < 0 || s->ffd != r->input.ply.fd)
		return 0;
	return s->nv * vertex + s->nf * (s->nv > UINT32_MAX ? 24 : 12);
}

static wh_plan make_plan(const wh_run *r)
{
	const wh_plan_query q = {.source = wh_input_joined(&r->input),
	                         .doubled = wh_run_style(r).doubled,
	                         .rewrite_bytes = wh_input_temp_bytes(&r->input) +
	                                          wh_run_clean_disk(r) + rply_bytes(r),
	                         .sizes = r->sizes,
	                         .share = wh_run_target_ratio(r),
	                         .state = wh_run_state_bytes(r),
	                         .memory = r->memory,
	                         .threads = r->exec.workers};
	wh_plan p;
	wh_plan_make(&q, &p);
	return p;
}

/* What a run through two plans needs. */
static void join_plans(wh_plan *p, const wh_plan *q)
{
	for (int i = 0; i < WH_PLAN_STAGES; i++) {
		if (q->stage[i].need > p->stage[i].need)
			p->stage[i].need = q->stage[i].need;
		if (q->stage[i].expect > p->stage[i].expect)
			p->stage[i].expect = q->stage[i].expect;
	}
	p->rounds = q->rounds > p->rounds ? q->rounds : p->rounds;
	p->streams = p->streams || q->streams;
	p->least = q->least > p->least ? q->least : p->least;
	p->peak_ram = q->peak_ram > p->peak_ram ? q->peak_ram : p->peak_ram;
	p->peak_disk = q->peak_disk > p->peak_disk ? q->peak_disk : p->peak_disk;
}

/* The last result's plan, and those of the levels before it. */
static void make_plans(wh_run *r)
{
	r->plan = make_plan(r);
	for (size_t i = 0; i < r->params->levels; i++) {
		wh_run_aim(r, i);
		const wh_plan p = make_plan(r);
		if (!wh_run_is_no_smaller(r))
			join_plans(&r->plan, &p);
	}
	wh_run_aim(r, r->params->levels);
}

/* A result has no fewer faces than its target, and hardly ever less than half as many vertices. */
static void least_counts(const wh_run *r, uint64_t *nv, uint64_t *nf)
{
	const wh_reduce_report *t = r->report;
	*nf = t->target_faces < t->input_faces ? t->target_faces : t->input_faces;
	*nv = t->target_vertices < t->input_vertices ? t->target_vertices : t->input_vertices;
	if (*nv < *nf / 2)
		*nv = *nf / 2;
}

/* What GLB has no room for is told before it is made. */
static wh_code fits_format(wh_run *r)
{
	uint64_t nv, nf;
	least_counts(r, &nv, &nf);
	return r->to == WH_FORMAT_GLB ? wh_glb_fits(r->c, wh_run_style(r), nv, nf) : WH_OK;
}

/* And what its disk has no room for; how much is left of it when it is packed nobody knows. */
static wh_code fits_disk(wh_run *r)
{
	uint64_t nv, nf;
	least_counts(r, &nv, &nf);
	if (r->packing != WH_PACKING_NONE || r->params->progressive ||
	    (!wh_run_is_last(r) && wh_run_is_no_smaller(r)))
		return WH_OK;
	return wh_outfile_foresee(r->c, r->aim.output,
	                          wh_mesh_least_bytes(wh_run_style(r), nv, nf));
}

static wh_code for_all_results(wh_run *r, wh_code (*fits)(wh_run *r))
{
	wh_code code = WH_OK;
	for (size_t i = 0; code == WH_OK && i < wh_run_results(r); i++) {
		wh_run_aim(r, i);
		code = fits(r);
	}
	wh_run_aim(r, r->params->levels);
	return code;
}

wh_code wh_run_foresee_disks(wh_run *r)
{
	r->spill.planned = r->plan.peak_disk;
	return wh_spill_foresee(r->c, &r->spill) == WH_OK ? for_all_results(r, fits_disk)
	                                                  : r->c->err.code;
}

wh_code wh_run_refuse_early(wh_run *r)
{
	int most = 0;
	make_plans(r);
	if (for_all_results(r, fits_format) != WH_OK)
		return r->c->err.code;
	const wh_polish polish = wh_run_polish(r);
	const wh_ply_style style = wh_run_style(r);
	if (wh_polish_check(r->c, &polish, &style) != WH_OK)
		return r->c->err.code;
	if (r->plan.streams && wh_polish_is_any(&polish))
		return wh_run_refuse_polish(r);
	const size_t cleaning = wh_run_clean_bytes(r);
	wh_run_plan_record(r);
	if (cleaning && r->plan.least < cleaning + WH_PLAN_BASE)
		r->plan.least = cleaning + WH_PLAN_BASE;
	if (cleaning > wh_run_budget(r))
		return wh_run_too_small(r, "cleaning the vertices", cleaning);
	for (int i = 1; i < WH_PLAN_STAGES; i++)
		if (r->plan.stage[i].need > r->plan.stage[most].need)
			most = i;
	if (r->plan.stage[most].need <= wh_run_budget(r))
		return wh_run_refuse_record(r);
	return wh_run_too_small(r, wh_plan_stage_name((wh_plan_stage)most), 0);
}

static wh_code ingest_once(wh_run *r)
{
	wh_exec ex = r->exec;
	if (wh_run_refuse_early(r) != WH_OK)
		return r->c->err.code;
	r->c->mem->limit = r->memory - WH_PLAN_BASE / 2; /* from here on the ceiling is exact */
	if (wh_run_foresee_disks(r) != WH_OK || wh_run_clean_input(r) != WH_OK)
		return r->c->err.code;
	wh_ingest_params p = {.clusters = r->plan.clusters,
	                      .cuts = r->params->seams ? &r->cuts : NULL,
	                      .digest = r->journaled ? &r->digest : NULL};
	(void)wh_ingest_fit(&r->input.source, wh_run_budget(r), &ex, &p);
	r->store = (wh_store){.spill = &r->spill, .generation = r->generations++};
	return wh_ingest(r->c, &ex, &r->progress, &r->input.source, &p, &r->store, &r->ingest);
}

static void count_input_reads(wh_run *r)
{
	const wh_source *s = &r->input.source;
	r->report->bytes_read += 3 * s->nv * s->vstride + r->ingest.face_reads * s->fstride;
	if (s->attributes)
		r->report->bytes_read += s->nv * (s->afd < 0 ? s->vstride : s->attributes->bytes);
}

/* Of a body that was rewritten, the file counts. */
static wh_code finish_digest(wh_run *r)
{
	if (!r->journaled)
		return WH_OK;
	r->book.digest_of_file = r->input.temp_fd >= 0;
	if (!r->book.digest_of_file)
		return wh_digest_header(r->c, &r->exec, &r->input.ply, &r->digest);
	atomic_store(&r->digest, 0);
	return wh_digest_file(r->c, &r->exec, &r->input.ply, &r->digest);
}

static wh_code ingest_input(wh_run *r)
{
	wh_code code = ingest_once(r);
	if (code == WH_E_IRREGULAR) { /* faces that are not triangles behind a triangle's size */
		if (rewrite_input(r) != WH_OK)
			return r->c->err.code;
		code = ingest_once(r);
	}
	if (code == WH_OK)
		code = wh_run_sift(r);
	if (code == WH_OK)
		code = finish_digest(r);
	if (code == WH_OK)
		code = wh_input_unchanged(r->c, &r->input);
	if (code != WH_OK)
		return code;
	count_input_reads(r);
	wh_input_drop_temp(&r->spill, &r->input);
	return WH_OK;
}

static wh_code note_ingest(wh_run *r)
{
	wh_step step = {.kind = WH_STEP_INGEST,
	                .kept = true,
	                .store = r->store,
	                .input_vertices = r->report->input_vertices,
	                .input_faces = r->report->input_faces,
	                .polygons = r->report->polygons,
	                .degenerate = r->report->degenerate_faces,
	                .is_double = r->input.source.is_double,
	                .clean = r->clean,
	                .sift = r->sift,
	                .ingest = r->ingest};
	return wh_run_keep_seams(r, &step) == WH_OK ? wh_run_note_step(r, &step) : r->c->err.code;
}

/* What an earlier process ingested. */
static wh_code recall_ingest(wh_run *r, const wh_step *step)
{
	r->c->mem->limit = r->memory - WH_PLAN_BASE / 2;
	r->spill.planned = r->plan.peak_disk;
	r->store = step->store;
	r->store.spill = &r->spill;
	r->generations = step->store.generation + 1;
	r->clean = step->clean;
	r->sift = step->sift;
	r->ingest = step->ingest;
	return wh_run_recall_seams(r, step);
}

static wh_code nothing_left(wh_run *r)
{
	const wh_reduce_report *t = r->report;
	if (t->component_faces)
		return wh_fail(r->c, WH_E_INPUT,
		               "%s: no component has %llu faces or more: nothing to reduce; lower "
		               "--min-component",
		               r->input.ply.path, (unsigned long long)r->params->min_component);
	return wh_fail(r->c, WH_E_INPUT, "%s: all %llu faces are degenerate%s: nothing to reduce",
	               r->input.ply.path, (unsigned long long)t->input_faces,
	               wh_run_has_hygiene(r) ? ", or become so without vertices that go" : "");
}

wh_code wh_run_ingest(wh_run *r)
{
	wh_step step;
	const bool done = wh_run_recall_step(r, WH_STEP_INGEST, &step);
	bool taken = false;
	if (!done && wh_run_take_ingest(r, &taken) != WH_OK)
		return r->c->err.code;
	if (!taken && (done ? recall_ingest(r, &step) : ingest_input(r)) != WH_OK)
		return r->c->err.code;
	if (taken)
		count_input_reads(r);
	if (!done && note_ingest(r) != WH_OK)
		return r->c->err.code;
	wh_reduce_report *t = r->report;
	r->faces = r->ingest.faces;
	t->degenerate_faces += r->ingest.degenerate;
	wh_run_note_hygiene(r);
	if (t->joined_vertices)
		wh_run_targets(r);
	t->cut_vertices = r->ingest.cut_vertices;
	t->clusters = r->store.clusters;
	t->windows = r->ingest.windows;
	const double scale = r->ingest.scale;
	t->diagonal = wh_norm(wh_sub(wh_scale(r->ingest.hi, scale), wh_scale(r->ingest.lo, scale)));
	t->diagonal /= scale;
	if (r->faces == 0)
		return nothing_left(r);
	wh_run_limit_error(r);
	wh_run_begin_record(r);
	return WH_OK;
}

/* The target is no smaller than the input: its bytes are the result. */
wh_code wh_run_copy_input(wh_run *r, wh_outfile **out)
{
	wh_reduce_report *t = r->report;
	t->unchanged = true;
	t->output_vertices = t->input_vertices;
	t->output_faces = t->input_faces;
	const uint64_t size = r->input.ply.size; /* unpacked */
	uint8_t *buf = wh_alloc(r->c, COPY, 1);
	wh_run_phase_begin(r);
	wh_code code = r->c->err.code;
	for (uint64_t at = 0; code == WH_OK && at < size; at += COPY) {
		const uint64_t left = size - at;
		const size_t n = left < COPY ? (size_t)left : COPY;
		code = wh_poll(r->c);
		if (code == WH_OK)
			code = wh_ply_pread(r->c, r->input.ply.path, r->input.ply.fd, buf, n, at);
		if (code == WH_OK)
			code = wh_outfile_write(r->c, *out, buf, n);
	}
	wh_free(r->c, buf);
	if (code == WH_OK)
		code = wh_input_unchanged(r->c, &r->input);
	if (code == WH_OK)
		code = wh_run_commit(r, out);
	return wh_run_phase_end(r, WH_PHASE_WRITE, code);
}
