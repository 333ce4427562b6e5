#define _GNU_SOURCE
#include "run/run.h"

#include <string.h>
#include <sys/stat.h>

/* Opens an output for a look. Pipes and devices are not opened twice. */
static wh_code try_one(wh_run *r, const char *path, bool replace)
{
	struct stat st;
	wh_outfile *o;
	if (strcmp(path, "-") == 0 || (stat(path, &st) == 0 && !S_ISREG(st.st_mode)))
		return WH_OK;
	const wh_code code =
	    wh_outfile_open_tagged(r->c, &o, path, r->params->force || replace, r->spill.tag);
	wh_outfile_abort(r->c, &o);
	return code;
}

wh_code wh_run_try_output(wh_run *r)
{
	const wh_reduce_params *p = r->params;
	for (size_t i = 0; i < p->levels; i++)
		if (try_one(r, p->level[i].output, r->replace_level[i]) != WH_OK)
			return r->c->err.code;
	if (!r->journaled)
		return WH_OK;
	if (try_one(r, p->output, r->replace_level[p->levels]) != WH_OK ||
	    (p->seams && try_one(r, p->seams, r->replace_seams) != WH_OK))
		return r->c->err.code;
	return WH_OK;
}

wh_code wh_run_open_output(wh_run *r, wh_outfile **out)
{
	const wh_reduce_params *p = r->params;
	if (*out)
		return WH_OK;
	const wh_code code =
	    r->journaled ? wh_outfile_open_tagged(r->c, out, r->aim.output,
	                                          p->force || r->replace_level[r->at], r->spill.tag)
	                 : wh_outfile_open(r->c, out, r->aim.output, p->force);
	return code == WH_OK ? wh_outfile_pack(r->c, *out, r->packing) : code;
}

/* From here on what appears under the outputs' names may be our own. */
static wh_code record(wh_run *r, const wh_outfile *out)
{
	wh_step step = {.kind = WH_STEP_WRITE, .result = r->at};
	wh_written w = {.result = r->at, .output_bytes = wh_outfile_bytes(out)};
	wh_outfile_checksum(out, w.output);
	if (!wh_run_is_last(r)) {
		wh_run_note_level(r, &w);
		step.level = r->report->level[r->at];
	} else if (r->seams) {
		w.seams_bytes = wh_outfile_bytes(r->seams);
		wh_outfile_checksum(r->seams, w.seams);
	}
	if (r->journaled && wh_manifest_note_written(r->c, &r->book, &w) != WH_OK)
		return r->c->err.code;
	return wh_run_note_step(r, &step);
}

wh_code wh_run_commit(wh_run *r, wh_outfile **out)
{
	if (wh_outfile_end(r->c, *out) != WH_OK)
		return r->c->err.code;
	const bool last = wh_run_is_last(r);
	if (last) {
		r->report->output_bytes = wh_outfile_bytes(*out);
		wh_outfile_checksum(*out, r->report->checksum);
	}
	if ((last && wh_run_write_seams(r, true) != WH_OK) || record(r, *out) != WH_OK)
		return r->c->err.code;
	if (last && r->seams && wh_outfile_commit(r->c, &r->seams) != WH_OK)
		return r->c->err.code;
	return wh_outfile_commit(r->c, out);
}
