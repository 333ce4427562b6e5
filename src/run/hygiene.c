/*
 * What goes before anything is reduced: vertices that are not finite or near others, by cleaning
 * the source before it is ingested, or copies of vertices along the borders of charts, by joining
 * them; copies of faces and small components, by sifting the clusters after it. All are part of the
 * step that reads the input. The counts of the input in the report
 * are those of the file; so are shares that the user asks for.
 */
#include "run/run.h"

#include "pipeline/atlas.h"

static wh_clean_params clean_params(const wh_reduce_params *p)
{
	return (wh_clean_params){.drop_invalid = p->drop_invalid,
	                         .weld = p->weld,
	                         .distance = p->weld_distance,
	                         .distance_share = p->weld_share};
}

static bool cleans(const wh_run *r)
{
	return r->params->drop_invalid || r->params->weld;
}

static bool sifts(const wh_run *r)
{
	return r->params->weld || r->params->drop_duplicates || r->params->min_component > 0;
}

bool wh_run_has_hygiene(const wh_run *r)
{
	return cleans(r) || sifts(r);
}

/* The source as its vertices are in the file. */
static wh_source apart(const wh_run *r)
{
	wh_source s = r->input.source;
	s.attributes = &r->input.whole;
	return s;
}

static wh_code join_charts(wh_run *r)
{
	const wh_source source = apart(r);
	const wh_atlas_params p = {
	    .rest = &r->input.attributes, .wedges = &r->input.wedges, .budget = wh_run_budget(r)};
	wh_source joined;
	wh_atlas_result done;
	int fd;
	const wh_code code = wh_atlas_join(r->c, &r->exec, &r->progress, &r->spill, &source, &p,
	                                   &joined, &fd, &done);
	if (code != WH_OK)
		return code;
	wh_mem_trim(r->c);
	r->report->bytes_read += done.bytes_read;
	r->clean.joined_vertices = done.joined;
	r->clean.degenerate_faces = done.degenerate_faces;
	wh_input_replace(&r->spill, &r->input, &joined, fd);
	return WH_OK;
}

size_t wh_run_clean_bytes(const wh_run *r)
{
	const wh_clean_params p = clean_params(r->params);
	const wh_source source = apart(r);
	if (r->input.apart)
		return wh_atlas_bytes(&source, &r->input.wedges, 1);
	return cleans(r) ? wh_clean_bytes(&r->input.source, &p, 1) : 0;
}

uint64_t wh_run_clean_disk(const wh_run *r)
{
	const wh_clean_params p = clean_params(r->params);
	const wh_source source = apart(r);
	if (r->input.apart)
		return wh_atlas_disk(&source, &r->input.wedges);
	return cleans(r) ? wh_clean_disk(&r->input.source, &p) : 0;
}

wh_code wh_run_clean_input(wh_run *r)
{
	const wh_clean_params p = clean_params(r->params);
	wh_source cleaned;
	int fd;
	if (r->input.apart)
		return join_charts(r);
	if (!cleans(r))
		return WH_OK;
	const wh_code code = wh_clean(r->c, &r->exec, &r->progress, &r->spill, &r->input.source, &p,
	                              wh_run_budget(r), &cleaned, &fd, &r->clean);
	if (code != WH_OK)
		return code;
	wh_mem_trim(r->c);
	r->report->bytes_read += r->clean.bytes_read;
	r->clean.invalid_faces += r->input.invalid_polygons;
	if (fd >= 0)
		wh_input_replace(&r->spill, &r->input, &cleaned, fd);
	return WH_OK;
}

wh_code wh_run_sift(wh_run *r)
{
	const wh_sift_params p = {.drop_duplicates = r->params->weld || r->params->drop_duplicates,
	                          .min_component = r->params->min_component};
	uint64_t max_v, max_f, faces, vertices;
	wh_store next = {.spill = &r->spill, .generation = r->generations};
	bool changed;
	if (!sifts(r))
		return WH_OK;
	if (wh_round_extent(r->c, &r->store, &max_v, &max_f, &faces, &vertices) != WH_OK)
		return r->c->err.code;
	const wh_exec ex = wh_run_workers(r, wh_sift_bytes(&r->store, max_v, max_f));
	if (wh_sift(r->c, &ex, &r->progress, &r->store, &p, &next, &changed, &r->sift) != WH_OK)
		return r->c->err.code;
	wh_mem_trim(r->c);
	if (!changed)
		return WH_OK;
	wh_round_remove(&r->store);
	r->store = next;
	r->generations++;
	return WH_OK;
}

void wh_run_note_hygiene(wh_run *r)
{
	wh_reduce_report *t = r->report;
	const wh_clean_result *k = &r->clean;
	const wh_sift_result *s = &r->sift;
	t->invalid_vertices = k->invalid_vertices;
	t->invalid_faces = k->invalid_faces;
	t->welded_vertices = k->welded_vertices;
	t->collapsed_faces = k->collapsed_faces;
	t->joined_vertices = k->joined_vertices;
	t->weld_distance = k->distance;
	t->degenerate_faces += k->degenerate_faces;
	t->duplicate_faces = s->duplicate_faces;
	t->zero_area_faces = s->zero_area_faces;
	t->small_components = s->small_components;
	t->component_faces = s->component_faces;
	t->component_vertices = s->component_vertices;
	wh_run_note_unreferenced(r, s->unreferenced);
	if (sifts(r))
		r->faces = s->faces;
}
