/* The positions that ingest listed lie in a scratch file until their number is known, which the
 * header of the output begins with. */
#include "run/run.h"

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

wh_code wh_run_write_seams(wh_run *r)
{
	const wh_ply_style style = {.is_double = r->input.source.is_double};
	if (!r->seams)
		return WH_OK;
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
