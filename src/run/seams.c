/* The positions that ingest listed lie in a scratch file until their number is known, which the
 * header of the output begins with. */
#include "run/run.h"

static const char CUTS[] = "cuts"; /* name of the file in a run directory */

enum { BATCH = 2048 }; /* positions copied at a time */

static void close_list(wh_run *r)
{
	if (r->cuts.fd >= 0)
		wh_spill_close_scratch(&r->spill, r->cuts.fd);
	r->cuts.fd = -1;
}

wh_code wh_run_open_seams(wh_run *r)
{
	if (!r->params->seams)
		return WH_OK;
	if (r->journaled) {
		if (!wh_run_is_begun(r)) /* else it is there */
			r->cuts.fd = wh_spill_create(r->c, &r->spill, CUTS);
		return r->c->err.code;
	}
	if (wh_outfile_open(r->c, &r->seams, r->params->seams, r->params->force) != WH_OK)
		return r->c->err.code;
	r->cuts.fd = wh_spill_scratch(r->c, &r->spill);
	return r->c->err.code;
}

static wh_code copy_positions(wh_run *r, wh_ply_style style)
{
	const size_t each = 3 * sizeof(double);
	double *xyz = wh_alloc(r->c, BATCH, each);
	wh_code code = r->c->err.code;
	for (uint64_t at = 0; code == WH_OK && at < r->cuts.n; at += BATCH) {
		const uint64_t left = r->cuts.n - at;
		const size_t n = left < BATCH ? (size_t)left : BATCH;
		code = wh_spill_pread(r->c, &r->spill, r->cuts.fd, xyz, n * each, at * each);
		if (code == WH_OK)
			code = wh_ply_write_vertices(r->c, r->seams, style, xyz, n);
	}
	wh_free(r->c, xyz);
	return code;
}

wh_code wh_run_keep_seams(wh_run *r, wh_step *step)
{
	uint64_t size;
	if (!r->journaled || !r->params->seams)
		return WH_OK;
	step->cuts = r->cuts.n;
	return wh_spill_checksum(r->c, &r->spill, CUTS, &size, &step->cuts_checksum);
}

wh_code wh_run_recall_seams(wh_run *r, const wh_step *step)
{
	if (!r->params->seams)
		return WH_OK;
	r->cuts.n = step->cuts;
	r->cuts.fd = wh_spill_read(r->c, &r->spill, CUTS);
	return r->cuts.fd >= 0 ? WH_OK : wh_failed(r->c);
}

wh_code wh_run_write_seams(wh_run *r, bool last)
{
	const wh_ply_style style = {.is_double = r->input.source.is_double};
	if (!r->params->seams || r->journaled != last)
		return WH_OK;
	if (r->journaled &&
	    wh_outfile_open_tagged(r->c, &r->seams, r->params->seams,
	                           r->params->force || r->replace_seams, r->spill.tag) != WH_OK)
		return r->c->err.code;
	wh_code code = wh_ply_write_header(r->c, r->seams, style, r->cuts.n, 0);
	if (code == WH_OK)
		code = copy_positions(r, style);
	close_list(r);
	return code;
}

void wh_run_close_seams(wh_run *r)
{
	close_list(r);
	wh_outfile_abort(r->c, &r->seams);
}
