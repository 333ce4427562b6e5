#define _GNU_SOURCE
#include "run/run.h"

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

static wh_code ingest_once(wh_run *r)
{
	wh_exec ex = r->exec;
	if (wh_run_plan(r) != WH_OK)
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

void wh_run_count_reads(wh_run *r, const wh_ingest_result *done)
{
	const wh_source *s = &r->input.source;
	r->report->bytes_read += done->vertex_reads * s->vstride + done->face_reads * s->fstride;
	if (s->attributes)
		r->report->bytes_read +=
		    done->record_reads * (s->afd < 0 ? s->vstride : s->attributes->bytes);
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
	wh_run_count_reads(r, &r->ingest);
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
