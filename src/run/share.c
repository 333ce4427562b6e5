/*
 * Runs that several processes share. The one that goes on with the run, alone, is as a resumed run:
 * only at the steps whose work is cut into parts it looks at what the parts have left, takes it as
 * what an earlier process had done, and stops where there is nothing. A process that does a part
 * goes through the steps that are done, as a resumed run does, too, until it comes to the one that
 * it has a part in; it writes nothing but files of its own, and never the manifest.
 *
 *     step      what is shared                        what a part leaves
 *     ingest    stretches of the input's faces        a piece of every cluster, and a note
 *     reduce    every parts-th cluster                clusters, and a ledger
 *     settle    every parts-th cluster, on trial      collapses, and a ledger
 *
 * What is there counts, not who made it: a part that is lost is done again, one that is done twice
 * leaves the same, under names that appear when a file is whole. So the processes of one job need
 * no messages to share clusters by demand: who is done with its own goes on with those of the
 * others that have no file yet (wh_ledger_turn). Surveys, cutting anew, the last pass and the
 * output are done alone.
 */
#include "run/run.h"

#include "pipeline/pieces.h"

#include <inttypes.h>
#include <stdio.h>
#include <string.h>

/* What is known of a share of the input besides its pieces. */
typedef struct share_note {
	wh_ingest_result result;
	uint64_t digest;
	uint64_t irregular; /* it holds faces that are not triangles: the pieces are empty */
} share_note;

bool wh_run_stage_has_parts(wh_stage stage)
{
	return stage == WH_STAGE_INGEST || stage == WH_STAGE_DECIMATE;
}

bool wh_run_is_part(const wh_run *r)
{
	return wh_run_stage_has_parts(r->params->stage);
}

bool wh_run_is_job(const wh_run *r)
{
	return r->params->crew == WH_CREW_JOB;
}

static bool joins(const wh_run *r)
{
	return r->params->stage == WH_STAGE_JOIN || r->params->stage == WH_STAGE_FINISH;
}

/* Ends the run for this process, the way a failure does: wh_reduce knows better. */
static wh_code pause_run(wh_run *r)
{
	r->report->paused = true;
	return wh_fail(r->c, WH_E_PAUSE, "the stage is done");
}

/* ---- words -------------------------------------------------------------------------------- */

/* Appends "3, 5-7" to what is in text. */
static void list_parts(const bool *missing, uint32_t n, char *text, size_t room)
{
	size_t used = strlen(text);
	const size_t begin = used;
	for (uint32_t i = 0, end; i < n; i = end) {
		if (used + 32 >= room) {
			(void)snprintf(text + used, room - used, ", ...");
			return;
		}
		for (end = i + 1; end < n && missing[end] == missing[i]; end++)
			;
		if (!missing[i])
			continue;
		used += (size_t)snprintf(text + used, room - used, "%s%u", used > begin ? ", " : "",
		                         i + 1);
		if (end > i + 1)
			used += (size_t)snprintf(text + used, room - used, "-%u", end);
	}
}

/* Fails, naming the parts that have not done what they are to do. */
static wh_code tell_missing(wh_run *r, const char *what, const bool *missing)
{
	char list[256] = "";
	const uint32_t n = (uint32_t)r->book.parts;
	list_parts(missing, n, list, sizeof list);
	return wh_fail(
	    r->c, WH_E_RUN,
	    "'%s': parts that are missing of %s: %s of %u; do them (again), or reduce with "
	    "--run-dir and --resume, which does alone whatever is not done",
	    r->params->run_dir, what, list, n);
}

static wh_code too_early(wh_run *r)
{
	return wh_fail(r->c, WH_E_RUN,
	               "'%s': round %u cannot begin: %s%u %s done and joined; the parts come "
	               "first, then a join",
	               r->params->run_dir, r->params->round, r->shared ? "of the rounds only " : "",
	               r->shared, r->shared == 1 ? "is" : "are");
}

/* ---- planning ----------------------------------------------------------------------------- */

/* Parts read the file where it lies: what has to be rewritten or cleaned first, one process
 * ingests.
 */
bool wh_run_shares_input(const wh_run *r)
{
	const wh_input *in = &r->input;
	return !r->params->seams && !wh_run_has_hygiene(r) && !r->rply && !in->unpacked &&
	       !in->apart && in->ply.kind == WH_FORMAT_PLY && in->source.ffd == in->ply.fd &&
	       in->source.vfd == in->ply.fd;
}

static wh_code scan(wh_run *r)
{
	wh_exec ex = r->exec;
	wh_ingest_params p = {.clusters = r->plan.clusters};
	wh_ingest_result done;
	(void)wh_ingest_fit(&r->input.source, wh_run_budget(r), &ex, &p);
	wh_run_phase_begin(r);
	const wh_code code = wh_ingest_scan(r->c, &ex, &r->progress, &r->input.source,
	                                    r->plan.clusters, &r->spill, &done);
	wh_run_count_reads(r, &done);
	return wh_run_phase_end(r, WH_PHASE_INGEST, code);
}

/* Nothing is ingested yet: the input may be cut into other parts. What there are of the same ones
 * stays. */
static void forget_plan(wh_run *r)
{
	wh_manifest *m = &r->book;
	wh_store s = {.spill = &r->spill, .parts = (uint32_t)m->parts};
	if (m->parts == r->params->parts)
		return;
	wh_pieces_remove(&s);
	m->parts = 0;
	m->shared_ingest = false;
}

/* Everything that the parts need is in the run directory afterwards. */
static wh_code plan_parts(wh_run *r)
{
	wh_manifest *m = &r->book;
	if (wh_run_is_job(r) && m->steps == 0)
		forget_plan(r);
	if (wh_run_is_job(r) && m->parts != r->params->parts && m->steps > 0) {
		m->parts = r->params->parts;
		return wh_manifest_write(r->c, &r->spill, m) == WH_OK ? pause_run(r)
		                                                      : r->c->err.code;
	}
	if (m->parts != 0 && r->params->parts != m->parts)
		return wh_fail(r->c, WH_E_USAGE,
		               "'%s' holds a run that was planned for %" PRIu64
		               " parts: use as many, or another --run-dir",
		               r->params->run_dir, m->parts);
	if (m->parts != 0 || m->steps > 0) /* planned, or more than that */
		return pause_run(r);
	if (wh_run_look(r) != WH_OK)
		return r->c->err.code;
	if (!wh_run_copies(r) && (wh_run_plan(r) != WH_OK || wh_run_foresee_disks(r) != WH_OK ||
	                          (wh_run_shares_input(r) && scan(r) != WH_OK)))
		return r->c->err.code;
	m->parts = r->params->parts;
	m->shared_ingest = wh_run_shares_input(r) && !wh_run_copies(r);
	return wh_run_sign_plan(r) == WH_OK ? pause_run(r) : r->c->err.code;
}

/* ---- ingest in parts ---------------------------------------------------------------------- */

static wh_store common_store(const wh_run *r)
{
	wh_store s = {.spill = (wh_spill *)&r->spill, .parts = (uint32_t)r->book.parts};
	wh_ingest_describe(&r->input.source, r->plan.clusters, &s);
	return s;
}

/* The share goes into the part's file; `own`: a folder for what nobody else has to see. */
static wh_code ingest_share(wh_run *r, wh_spill *own, wh_pieces *to)
{
	wh_store store = *to->store;
	wh_exec ex = r->exec;
	const wh_ingest_share share = {
	    .scratch = own, .part = r->params->part, .parts = store.parts};
	_Atomic uint64_t digest = 0;
	wh_ingest_params p = {.clusters = store.clusters, .digest = &digest, .share = &share};
	share_note note = {0};
	store.pieces = to;
	(void)wh_ingest_fit(&r->input.source, wh_run_budget(r), &ex, &p);
	wh_code code =
	    wh_ingest(r->c, &ex, &r->progress, &r->input.source, &p, &store, &note.result);
	if (code == WH_OK)
		code = wh_input_unchanged(r->c, &r->input);
	wh_run_count_reads(r, &note.result);
	note.digest = atomic_load(&digest);
	note.irregular = code == WH_E_IRREGULAR;
	if (code != WH_OK && !note.irregular)
		return code;
	return wh_pieces_commit(r->c, to, note.irregular, &note, sizeof note);
}

static wh_code ingest_part(wh_run *r)
{
	wh_spill own = {.dirfd = -1};
	share_note note;
	if (r->book.steps > 0 || !r->book.shared_ingest)
		return pause_run(r);
	if (wh_run_look(r) != WH_OK || wh_run_plan(r) != WH_OK)
		return r->c->err.code;
	const wh_store to = common_store(r);
	if (wh_pieces_note(r->c, &to, r->params->part, &note, sizeof note))
		return pause_run(r);
	r->c->mem->limit = r->memory - WH_PLAN_BASE / 2;
	if (wh_spill_open(r->c, &own, r->params->temp_dir, r->params->run_dir) != WH_OK)
		return r->c->err.code;
	wh_run_phase_begin(r);
	wh_pieces file = {0};
	wh_code code = wh_pieces_begin(r->c, &file, &to, r->params->part);
	if (code == WH_OK)
		code = ingest_share(r, &own, &file);
	wh_pieces_drop(r->c, &file);
	r->report->bytes_read += atomic_load(&own.bytes_read);
	code = wh_run_phase_end(r, WH_PHASE_INGEST, wh_run_end_part(r, code));
	wh_spill_close(r->c, &own);
	return code;
}

/* Reads the notes of all parts; those that are not there are told, or *all is false. */
static wh_code read_notes(wh_run *r, const wh_store *s, share_note *note, bool *all)
{
	bool *missing = wh_calloc(r->c, s->parts, sizeof *missing);
	wh_code code = missing ? WH_OK : wh_failed(r->c);
	*all = true;
	for (uint32_t i = 0; code == WH_OK && i < s->parts; i++) {
		missing[i] = !wh_pieces_note(r->c, s, i, &note[i], sizeof *note);
		*all = *all && !missing[i];
	}
	if (code == WH_OK && !*all && joins(r))
		code = tell_missing(r, "ingest", missing);
	wh_free(r->c, missing);
	return code;
}

static void add_note(wh_run *r, const share_note *n)
{
	wh_ingest_result *sum = &r->ingest;
	const wh_ingest_result one = n->result;
	if (sum->scale == 0)
		*sum = (wh_ingest_result){
		    .lo = one.lo, .hi = one.hi, .scale = one.scale, .step = one.step};
	sum->faces += one.faces;
	sum->degenerate += one.degenerate;
	sum->windows = one.windows > sum->windows ? one.windows : sum->windows;
	atomic_fetch_add(&r->digest, n->digest);
}

/* Takes what the parts ingested. */
static wh_code take_shares(wh_run *r, const wh_store *s, const share_note *note)
{
	uint64_t vertices;
	r->ingest = (wh_ingest_result){0};
	atomic_store(&r->digest, 0);
	for (uint32_t i = 0; i < s->parts; i++)
		add_note(r, &note[i]);
	if (wh_ingest_scanned(r->c, &r->spill, &vertices) != WH_OK ||
	    wh_digest_header(r->c, &r->exec, &r->input.ply, &r->digest) != WH_OK ||
	    wh_pieces_count_ids(r->c, s, &r->ingest.cut_vertices) != WH_OK)
		return r->c->err.code;
	atomic_fetch_add(&r->digest, vertices);
	r->c->mem->limit = r->memory - WH_PLAN_BASE / 2;
	r->spill.planned = r->plan.peak_disk;
	r->store = *s;
	return WH_OK;
}

wh_code wh_run_take_ingest(wh_run *r, bool *taken)
{
	*taken = false;
	if (!r->journaled || !r->book.shared_ingest)
		return WH_OK;
	if (wh_run_plan(r) != WH_OK || wh_run_compare_input(r) != WH_OK)
		return r->c->err.code;
	wh_store s = common_store(r);
	s.generation = r->generations++;
	share_note *note = wh_calloc(r->c, s.parts, sizeof *note);
	bool all = false;
	wh_code code = note ? read_notes(r, &s, note, &all) : wh_failed(r->c);
	for (uint32_t i = 0; code == WH_OK && all && i < s.parts; i++)
		all = !note[i].irregular;
	if (code == WH_OK && all)
		code = take_shares(r, &s, note);
	else if (code == WH_OK)
		wh_pieces_remove(&s);
	*taken = all;
	wh_free(r->c, note);
	return code;
}

/* ---- rounds in parts ---------------------------------------------------------------------- */

/* True when no part, or none that is to come, can have left anything of the next shared step. */
static bool is_beyond_plan(const wh_run *r)
{
	return r->shared + 1 > r->book.rounds;
}

/* How many clusters the ledger knows nothing of; `missing`: whose they are. */
static uint32_t count_missing(wh_run *r, const wh_ledger *l, wh_ledger_kind kind, bool *missing)
{
	uint32_t n = 0;
	for (uint32_t k = 0; k < l->clusters; k++)
		if (wh_ledger_bytes(r->c, l, kind, k) == 0) {
			missing[k % r->book.parts] = true;
			n++;
		}
	return n;
}

/* A join that has done something ends where the parts are needed again; one that has not finds
 * them done, or tells which are missing. (Those of an MPI job are at hand, and do what is.) */
static wh_code join_parts(wh_run *r, const wh_ledger *l, wh_ledger_kind kind)
{
	const bool finish = r->params->stage == WH_STAGE_FINISH;
	char what[32];
	if (r->joined && finish)
		return WH_OK;
	bool *missing = wh_calloc(r->c, (size_t)r->book.parts, sizeof *missing);
	if (!missing)
		return wh_failed(r->c);
	const uint32_t left = count_missing(r, l, kind, missing);
	wh_code code = r->c->err.code;
	(void)snprintf(what, sizeof what, "round %u", r->shared + 1);
	if (code != WH_OK || left == 0 || (finish && is_beyond_plan(r))) {
		;
	} else if (!finish && (r->joined || left == l->clusters || wh_run_is_job(r))) {
		r->report->next_round = r->shared + 1;
		code = pause_run(r);
	} else {
		code = tell_missing(r, what, missing);
	}
	wh_free(r->c, missing);
	return code;
}

wh_code wh_run_parts(wh_run *r, const wh_ledger *l, wh_ledger_kind kind)
{
	if (r->params->stage == WH_STAGE_ALL)
		return WH_OK;
	if (!wh_run_is_part(r))
		return join_parts(r, l, kind);
	if (r->params->round == r->shared + 1)
		return WH_OK;
	return r->params->round <= r->shared ? pause_run(r) : too_early(r);
}

wh_code wh_run_alone(wh_run *r)
{
	if (!wh_run_is_part(r))
		return WH_OK;
	return r->params->round <= r->shared ? pause_run(r) : too_early(r);
}

wh_code wh_run_end_part(wh_run *r, wh_code code)
{
	if (code != WH_OK || !wh_run_is_part(r))
		return code;
	return wh_spill_flush(r->c, &r->spill) == WH_OK ? pause_run(r) : r->c->err.code;
}

wh_code wh_run_end_rounds(wh_run *r)
{
	return wh_run_is_part(r) || r->params->stage == WH_STAGE_JOIN ? pause_run(r) : WH_OK;
}

/* ---- which stage -------------------------------------------------------------------------- */

wh_code wh_run_stage(wh_run *r)
{
	switch (r->params->stage) {
	case WH_STAGE_PLAN:
		return plan_parts(r);
	case WH_STAGE_INGEST:
		return ingest_part(r);
	case WH_STAGE_DECIMATE:
		if (r->book.steps > 0)
			return WH_OK;
		if (wh_run_look(r) != WH_OK)
			return r->c->err.code;
		return wh_run_copies(r) ? pause_run(r) : too_early(r);
	default:
		return WH_OK;
	}
}

wh_code wh_run_sensible_stage(wh_ctx *c, const wh_reduce_params *p)
{
	const bool part = p->stage == WH_STAGE_INGEST || p->stage == WH_STAGE_DECIMATE;
	if (p->stage != WH_STAGE_ALL && !p->run_dir)
		return wh_fail(c, WH_E_USAGE, "a run in stages needs a --run-dir");
	if (p->parts > WH_PARTS_MOST || (p->stage == WH_STAGE_PLAN && p->parts == 0) ||
	    (part && p->part >= WH_PARTS_MOST) || (part && p->parts && p->part >= p->parts) ||
	    (p->stage == WH_STAGE_DECIMATE && p->round == 0))
		return wh_fail(c, WH_E_USAGE, "part, parts or round out of range");
	return WH_OK;
}
