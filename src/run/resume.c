/*
 * A run that can be resumed is a row of steps, each a function of the input, the parameters and the
 * steps before it. The manifest keeps what came out of the steps that are done. A process that
 * resumes the run goes through its stages from the beginning, as the first one did, but takes the
 * results of steps that are done from the manifest, until it comes to the first that is not: so
 * there is one course of things, not two. Inside a step, the ledger says which clusters are done.
 *
 *     folder                       when it appears            when it goes
 *     manifest                     first, then at each step   last
 *     roundG-K                     cluster K is whole         the next store is, in the manifest
 *     collapses-K                  the trial of cluster K is  its cluster is settled
 *     step-N                       step N begins              it is in the manifest
 *     cuts                         ingest, for --seams        last
 *     *.TOKEN.part                 half done                  its process ends, or the next begins
 *
 * Cluster files are removed only after the manifest that no longer needs them was flushed. Whoever
 * resumes a run reads all clusters of its store first; where one is damaged, the store before it
 * will do if it is still there, and else everything starts again from the input.
 *
 * Two processes in one folder: a second one is refused while the first is alive on the same host.
 * Where that cannot be known, nothing wrong comes of it, as every file is the same whoever writes
 * it, appears whole, and is checked when it is read; the process that finds another one's token in
 * the manifest gives up. No lock is taken.
 */
#define _GNU_SOURCE
#include "run/run.h"

#include "base/timer.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/random.h>
#include <time.h>
#include <unistd.h>
#include <xxhash.h>

static void notice(const wh_run *r, const char *text)
{
	if (r->params->notice)
		r->params->notice(r->params->notice_user, text);
}

/* ---- who ---------------------------------------------------------------------------------- */

/* A word that no other process has. */
static void make_token(char token[WH_SPILL_TAG])
{
	unsigned char r[5];
	if (getrandom(r, sizeof r, 0) != (ssize_t)sizeof r) {
		const uint32_t pid = (uint32_t)getpid();
		memset(r, 0, sizeof r);
		memcpy(r, &pid, sizeof pid);
	}
	for (size_t i = 0; i < sizeof r; i++)
		(void)snprintf(token + 2 * i, 3, "%02x", r[i]);
}

/* When a process began, in ticks since the machine did; 0: nobody knows, or it has ended and only
 * its parent has not looked yet. */
static uint64_t start_of(uint64_t pid)
{
	char name[40], text[512];
	(void)snprintf(name, sizeof name, "/proc/%" PRIu64 "/stat", pid);
	FILE *f = fopen(name, "re");
	if (!f)
		return 0;
	const size_t n = fread(text, 1, sizeof text - 1, f);
	(void)fclose(f);
	text[n] = '\0';
	const char *at = strrchr(text, ')'); /* the name before it may hold anything */
	if (!at || strlen(at) < 3 || at[2] == 'Z' || at[2] == 'X')
		return 0;
	for (int i = 2; at && i < 22; i++)
		at = strchr(at + 1, ' ');
	return at ? strtoull(at, NULL, 10) : 0;
}

static void name_host(char *host, size_t n)
{
	if (gethostname(host, n) != 0)
		host[0] = '\0';
	host[n - 1] = '\0';
	for (char *at = host; *at; at++)
		if ((unsigned char)*at < ' ')
			*at = '?';
}

static void sign(wh_run *r)
{
	wh_manifest *m = &r->book;
	(void)snprintf(m->token, sizeof m->token, "%s", r->spill.tag);
	(void)snprintf(m->version, sizeof m->version, "%s", WHITTLE_VERSION);
	name_host(m->host, sizeof m->host);
	m->pid = (uint64_t)getpid();
	m->started = start_of(m->pid);
}

/* True when the process that signed is at work: on this host, and not a later one of its number. */
static bool is_at_work(const wh_manifest *m)
{
	char host[sizeof m->host];
	name_host(host, sizeof host);
	return strcmp(host, m->host) == 0 && m->pid != (uint64_t)getpid() && m->started != 0 &&
	       start_of(m->pid) == m->started;
}

/* The same, but one that was killed just now has a moment to go. */
static bool stays_at_work(wh_run *r)
{
	enum { TURNS = 40 };
	const struct timespec turn = {.tv_nsec = 50L * 1000 * 1000};
	bool there = is_at_work(&r->book);
	for (int i = 0; there && i < TURNS && wh_poll(r->c) == WH_OK; i++) {
		(void)nanosleep(&turn, NULL);
		there = is_at_work(&r->book);
	}
	return there;
}

/* ---- parameters and input ----------------------------------------------------------------- */

static uint64_t hash_of(const char *text)
{
	return text ? XXH3_64bits(text, strlen(text)) : 0;
}

/* The limits of the levels; where they go does not matter. */
static uint64_t hash_of_levels(const wh_reduce_params *p)
{
	uint64_t hash = 0;
	for (size_t i = 0; i < p->levels; i++) {
		const wh_level *l = &p->level[i];
		const uint64_t counts[] = {hash, l->faces, l->vertices};
		const double reals[] = {l->face_ratio, l->vertex_ratio, l->error, l->error_share};
		hash = XXH3_64bits(reals, sizeof reals) ^ XXH3_64bits(counts, sizeof counts);
	}
	return hash;
}

static wh_choices choices_of(const wh_run *r)
{
	const wh_reduce_params *p = r->params;
	return (wh_choices){.from = r->from,
	                    .to = r->to,
	                    .packing = r->packing,
	                    .attributes_hash = hash_of(p->attributes),
	                    .weights_hash = hash_of(p->weights),
	                    .cost = r->policy.cost,
	                    .face_weight = r->policy.weight,
	                    .placement = r->policy.placement,
	                    .levels_hash = hash_of_levels(p),
	                    .own_hash = hash_of(p->own ? p->own->name : NULL),
	                    .faces = p->faces,
	                    .vertices = p->vertices,
	                    .cluster_faces = p->cluster_faces,
	                    .micro_faces = p->micro_faces,
	                    .final_faces = p->final_faces,
	                    .round_keep = p->round_keep,
	                    .smooth = p->smooth,
	                    .normals = p->normals,
	                    .face_ratio = p->face_ratio,
	                    .vertex_ratio = p->vertex_ratio,
	                    .error = p->error,
	                    .error_share = p->error_share,
	                    .drop_invalid = p->drop_invalid,
	                    .weld = p->weld,
	                    .weld_distance = p->weld_distance,
	                    .weld_share = p->weld_share,
	                    .drop_duplicates = p->drop_duplicates,
	                    .min_component = p->min_component,
	                    .ascii = p->ascii,
	                    .quantize = p->quantize,
	                    .seams = p->seams != NULL,
	                    .simplify_topology = p->simplify_topology,
	                    .fast = p->fast,
	                    .lock_boundary = p->lock_boundary};
}

static void note_input(wh_run *r)
{
	wh_manifest *m = &r->book;
	const wh_ply *p = &r->input.ply;
	(void)snprintf(m->input, sizeof m->input, "%s", r->params->input);
	for (char *at = m->input; *at; at++)
		if ((unsigned char)*at < ' ')
			*at = '?';
	m->input_bytes = p->size;
	m->input_seconds = (uint64_t)p->changed.tv_sec;
	m->input_nanoseconds = (uint64_t)p->changed.tv_nsec;
	m->input_digest = atomic_load(&r->digest);
}

static wh_code other_input(wh_run *r, const char *what)
{
	return wh_fail(
	    r->c, WH_E_INPUT,
	    "%s: not the input that the run in '%s' began with (%s): %s; use that one, or "
	    "another --run-dir",
	    r->params->input, r->params->run_dir, r->book.input, what);
}

static wh_code digest_input(wh_run *r)
{
	const wh_exec ex = wh_run_workers(r, WH_PLAN_REWRITE);
	const wh_input *in = &r->input;
	atomic_store(&r->digest, 0);
	wh_progress_phase(&r->progress, "compare the input", 1);
	if (r->book.digest_of_file)
		return wh_digest_file(r->c, &ex, &in->ply, &r->digest);
	if (in->source.ffd < 0)
		return other_input(r, "its faces were all triangles");
	if (wh_digest_source(r->c, &ex, &in->source, &r->digest) != WH_OK)
		return r->c->err.code;
	return wh_digest_header(r->c, &ex, &in->ply, &r->digest);
}

/* The content counts; a file that was not written to since then has it. */
static wh_code compare_input(wh_run *r)
{
	const wh_manifest *m = &r->book;
	const wh_ply *p = &r->input.ply;
	char what[96];
	if (p->size != m->input_bytes) {
		(void)snprintf(what, sizeof what, "it has %" PRIu64 " bytes and had %" PRIu64,
		               p->size, m->input_bytes);
		return other_input(r, what);
	}
	if ((uint64_t)p->changed.tv_sec == m->input_seconds &&
	    (uint64_t)p->changed.tv_nsec == m->input_nanoseconds) {
		atomic_store(&r->digest, m->input_digest);
		return WH_OK;
	}
	if (digest_input(r) != WH_OK)
		return r->c->err.code;
	if (atomic_load(&r->digest) != m->input_digest)
		return other_input(r, "it was written to, and its content is another one");
	return WH_OK;
}

static void note_sums(wh_run *r)
{
	wh_manifest *m = &r->book;
	memcpy(m->phase, r->report->phase, sizeof m->phase);
	m->bytes_read = r->report->bytes_read;
	m->temp_read = atomic_load(&r->spill.bytes_read);
	m->temp_written = atomic_load(&r->spill.bytes_written);
	m->temp_peak = atomic_load(&r->spill.peak);
	m->seconds = wh_seconds() - r->start;
	m->clusters = r->plan.clusters;
	m->rounds = (uint64_t)r->plan.rounds;
	m->peak_disk = r->plan.peak_disk;
	m->streams = r->plan.streams;
}

static wh_code look(wh_run *r)
{
	wh_progress_phase(&r->progress, "open", 1);
	if (wh_input_look(r->c, &r->exec, &r->spill, r->params->input, r->from, wh_run_wanted(r),
	                  &r->input) != WH_OK)
		return r->c->err.code;
	r->input_open = true;
	return wh_attributes_weigh(r->c, r->params->input, r->params->weights,
	                           &r->input.attributes);
}

wh_code wh_run_compare_input(wh_run *r)
{
	return compare_input(r);
}

wh_code wh_run_look(wh_run *r)
{
	wh_reduce_report *t = r->report;
	if (look(r) != WH_OK || (r->book.parts && compare_input(r) != WH_OK))
		return r->c->err.code;
	t->input_bytes = r->input.file_bytes;
	t->input_vertices = r->input.source.nv;
	t->input_faces = r->input.source.nf;
	r->faces = t->input_faces;
	wh_run_targets(r);
	return WH_OK;
}

wh_code wh_run_sign_plan(wh_run *r)
{
	note_input(r);
	note_sums(r);
	return wh_manifest_write(r->c, &r->spill, &r->book);
}

wh_code wh_run_reopen_input(wh_run *r)
{
	const wh_step *s = &r->book.step[0];
	wh_reduce_report *t = r->report;
	if (look(r) != WH_OK || compare_input(r) != WH_OK)
		return r->c->err.code;
	note_input(r);
	t->input_bytes = r->input.file_bytes;
	t->input_vertices = r->input.source.nv = s->input_vertices;
	t->input_faces = r->input.source.nf = s->input_faces;
	r->input.source.is_double = s->is_double;
	t->polygons = s->polygons;
	t->degenerate_faces = s->degenerate;
	r->faces = t->input_faces;
	wh_run_targets(r);
	return wh_run_plan(r);
}

/* ---- what is whole ------------------------------------------------------------------------ */

typedef struct inspection {
	wh_store store;
	wh_store_workspace *workspace; /* one for each worker */
	_Atomic uint32_t bad;          /* a cluster that is damaged, or UINT32_MAX */
} inspection;

static wh_code inspect_job(wh_ctx *c, void *arg, int64_t index, int worker)
{
	inspection *n = arg;
	uint64_t checksum;
	wh_ctx own = wh_ctx_fork(c);
	const wh_code code =
	    wh_store_verify(&own, &n->store, (uint32_t)index, &n->workspace[worker], &checksum);
	if (code == WH_E_RUN)
		atomic_store(&n->bad, (uint32_t)index);
	else if (code != WH_OK)
		return wh_fail(c, code, "%s", own.err.text);
	return WH_OK;
}

/* Reads all clusters of a store. *bad: one that is not whole, or UINT32_MAX. */
static wh_code inspect(wh_run *r, const wh_store *store, uint32_t *bad)
{
	uint64_t max_v, max_f, faces, vertices;
	wh_ctx own = wh_ctx_fork(r->c);
	inspection n = {.store = *store, .bad = UINT32_MAX};
	n.store.spill = &r->spill;
	*bad = 0;
	if (wh_round_extent(&own, &n.store, &max_v, &max_f, &faces, &vertices) != WH_OK)
		return own.err.code == WH_E_RUN ? WH_OK
		                                : wh_fail(r->c, own.err.code, "%s", own.err.text);
	const wh_exec ex = wh_run_workers(r, wh_store_workspace_bytes(&n.store, max_v, max_f));
	n.workspace = wh_calloc(r->c, (size_t)ex.workers, sizeof *n.workspace);
	wh_code code = r->c->err.code;
	if (code == WH_OK)
		code = wh_exec_for(r->c, &ex, store->clusters, inspect_job, &n);
	for (int i = 0; n.workspace && i < ex.workers; i++)
		wh_store_workspace_free(r->c, &n.workspace[i]);
	wh_free(r->c, n.workspace);
	*bad = atomic_load(&n.bad);
	return code;
}

/* The list for --seams. */
static bool cuts_are_whole(wh_run *r)
{
	uint64_t size, checksum;
	wh_ctx own = wh_ctx_fork(r->c);
	return !r->book.choices.seams ||
	       (wh_spill_checksum(&own, &r->spill, "cuts", &size, &checksum) == WH_OK &&
	        checksum == r->book.step[0].cuts_checksum);
}

static void tell_damage(wh_run *r, const wh_step *s, uint32_t bad, bool before)
{
	char text[256];
	(void)snprintf(text, sizeof text,
	               "cluster %u of round %u in '%.100s' is damaged or gone: going on from %s",
	               bad, s->store.generation, r->spill.dir,
	               before ? "the round before it"
	                      : "the input again, as the round before it is gone too");
	notice(r, text);
}

/* Forgets the steps behind the last one whose store is whole. */
static wh_code find_whole_store(wh_run *r)
{
	wh_manifest *m = &r->book;
	size_t told = 0;
	uint32_t first_bad = 0;
	for (size_t n = m->steps; n > 0; n--) {
		const wh_step *s = &m->step[n - 1];
		uint32_t bad;
		if (!s->kept)
			continue;
		if (inspect(r, &s->store, &bad) != WH_OK)
			return r->c->err.code;
		if (bad == UINT32_MAX && cuts_are_whole(r)) {
			if (told)
				tell_damage(r, &m->step[told - 1], first_bad, true);
			m->steps = told ? n : m->steps;
			return WH_OK;
		}
		if (!told)
			first_bad = bad;
		told = told ? told : n;
	}
	if (told && first_bad == UINT32_MAX)
		notice(
		    r,
		    "the list of cut vertices is damaged or gone: starting again from the input");
	else if (told)
		tell_damage(r, &m->step[told - 1], first_bad, false);
	for (size_t n = 0; n < m->steps; n++) /* the parts' files are not to be taken again */
		if (m->step[n].kind == WH_STEP_INGEST && m->step[n].store.parts) {
			wh_store pieces = m->step[n].store;
			pieces.spill = &r->spill;
			wh_round_remove(&pieces);
		}
	m->steps = 0;
	return WH_OK;
}

/* ---- the folder --------------------------------------------------------------------------- */

static wh_code refuse(wh_run *r, wh_code code, const char *what)
{
	return wh_fail(r->c, code, "'%s' %s", r->params->run_dir, what);
}

static wh_code may_begin(wh_run *r)
{
	if (wh_spill_is_used(&r->spill))
		return wh_fail(r->c, WH_E_USAGE,
		               "'%s' holds files, but no run: remove it, or use another --run-dir",
		               r->spill.dir);
	return WH_OK;
}

static wh_code may_go_on(wh_run *r, const wh_choices *choices)
{
	char what[512];
	if (!r->params->resume)
		return refuse(r, WH_E_USAGE,
		              "holds a run that is not finished: add --resume to go on with it, or "
		              "remove the folder to start again");
	if (stays_at_work(r)) {
		(void)snprintf(what, sizeof what,
		               "is in use by process %" PRIu64 ": wait for its end, or end it",
		               r->book.pid);
		return refuse(r, WH_E_USAGE, what);
	}
	if (!wh_choices_differ(&r->book.choices, choices, what, sizeof what))
		return WH_OK;
	return wh_fail(r->c, WH_E_USAGE,
	               "'%s' holds a run with other parameters: %s; use the same ones, or another "
	               "--run-dir",
	               r->params->run_dir, what);
}

/* The last process may have come as far as to give outputs their names. */
static void look_at_outputs(wh_run *r)
{
	wh_manifest *m = &r->book;
	const wh_reduce_params *p = r->params;
	for (size_t i = 0; i < wh_run_results(r); i++)
		wh_outfile_clear(r->c, wh_run_result(r, i).output, m->token);
	if (p->seams)
		wh_outfile_clear(r->c, p->seams, m->token);
	for (size_t n = 0; n < m->n_written; n++) {
		const wh_written *w = &m->written[n];
		if (w->result > p->levels)
			continue;
		r->replace_level[w->result] = wh_outfile_is(
		    r->c, wh_run_result(r, w->result).output, w->output_bytes, w->output);
		if (w->result == p->levels)
			r->replace_seams =
			    p->seams && wh_outfile_is(r->c, p->seams, w->seams_bytes, w->seams);
	}
}

static void take_sums(wh_run *r)
{
	const wh_manifest *m = &r->book;
	memcpy(r->report->phase, m->phase, sizeof m->phase);
	r->report->bytes_read = m->bytes_read;
	atomic_store(&r->spill.bytes_read, m->temp_read);
	atomic_store(&r->spill.bytes_written, m->temp_written);
	atomic_store(&r->spill.peak, m->temp_peak);
	r->start -= m->seconds;
	r->report->resumed = m->resumed;
}

static void tell_state(wh_run *r)
{
	const wh_manifest *m = &r->book;
	unsigned rounds = 0;
	char text[160];
	for (size_t i = 1; i < m->steps; i++)
		rounds += m->step[i].kept && m->step[i].kind != WH_STEP_RECUT;
	if (m->steps == 0)
		(void)snprintf(text, sizeof text, "resumed from the input: nothing was done yet");
	else
		(void)snprintf(text, sizeof text,
		               "resumed: the input is in clusters; rounds that are done: %u",
		               rounds);
	notice(r, text);
}

/* A stage is no new beginning; an MPI job that plans is. */
static bool is_new_beginning(const wh_run *r)
{
	return r->params->stage == WH_STAGE_ALL ||
	       (r->params->stage == WH_STAGE_PLAN && wh_run_is_job(r));
}

static wh_code go_on(wh_run *r)
{
	const bool staged = !is_new_beginning(r);
	look_at_outputs(r);
	r->book.resumed += !staged;
	take_sums(r);
	sign(r);
	r->journaled = true;
	if (wh_spill_tidy(r->c, &r->spill) != WH_OK ||
	    wh_manifest_write(r->c, &r->spill, &r->book) != WH_OK)
		return r->c->err.code;
	wh_manifest *m = &r->book;
	if (m->steps > 0 && m->step[m->steps - 1].kind == WH_STEP_WRITE)
		m->steps--; /* it is done again */
	if (staged)         /* whoever loads a cluster finds out whether it is whole */
		return WH_OK;
	if (find_whole_store(r) != WH_OK)
		return r->c->err.code;
	tell_state(r);
	return WH_OK;
}

static wh_code begin(wh_run *r, const wh_choices *choices)
{
	r->book.choices = *choices;
	sign(r);
	r->journaled = true;
	return wh_spill_tidy(r->c, &r->spill) == WH_OK
	           ? wh_manifest_write(r->c, &r->spill, &r->book)
	           : r->c->err.code;
}

static wh_code needs_run(wh_run *r)
{
	return refuse(r, WH_E_RUN,
	              "holds no run: whittle plan with --run-dir and --parts makes one");
}

/* The stages that only read what the others have left. */
static wh_code may_take_part(wh_run *r, const wh_choices *choices)
{
	char what[512];
	wh_manifest *m = &r->book;
	const uint64_t parts = r->params->parts;
	if (wh_choices_differ(&m->choices, choices, what, sizeof what))
		return wh_fail(r->c, WH_E_USAGE, "'%s' holds a run with other parameters: %s",
		               r->params->run_dir, what);
	if ((parts && parts != m->parts) || r->params->part >= m->parts)
		return wh_fail(r->c, WH_E_USAGE, "'%s' holds a run of %" PRIu64 " parts, from 1",
		               r->params->run_dir, m->parts);
	r->journaled = true;
	return WH_OK;
}

static wh_code open_staged(wh_run *r, const wh_choices *choices, bool found)
{
	if (!found && r->params->stage != WH_STAGE_PLAN)
		return needs_run(r);
	if (wh_run_is_part(r))
		return may_take_part(r, choices);
	if (found && may_go_on(r, choices) != WH_OK)
		return r->c->err.code;
	if (found && r->params->stage != WH_STAGE_PLAN && r->book.parts == 0)
		return refuse(r, WH_E_USAGE,
		              "holds a run that was not planned in parts: reduce with --resume "
		              "goes on with it");
	return found ? go_on(r) : may_begin(r) == WH_OK ? begin(r, choices) : r->c->err.code;
}

wh_code wh_run_open_folder(wh_run *r)
{
	char token[WH_SPILL_TAG];
	bool found;
	const wh_choices choices = choices_of(r);
	make_token(token);
	if (wh_spill_keep(r->c, &r->spill, r->params->run_dir, token) != WH_OK ||
	    wh_manifest_read(r->c, &r->spill, &r->book, &found) != WH_OK)
		return r->c->err.code;
	if (r->params->stage != WH_STAGE_ALL)
		return open_staged(r, &choices, found);
	if ((found ? may_go_on(r, &choices) : may_begin(r)) != WH_OK)
		return r->c->err.code;
	r->report->resumable = r->book.steps > 0; /* also when that fails */
	return found ? go_on(r) : begin(r, &choices);
}

bool wh_run_is_begun(const wh_run *r)
{
	return r->journaled && r->book.steps > 0;
}

/* ---- steps -------------------------------------------------------------------------------- */

static void ledger_name(size_t step, char name[WH_LEDGER_NAME])
{
	(void)snprintf(name, WH_LEDGER_NAME, "step-%zu", step);
}

/* The one of that name, and those of the parts. */
static void remove_ledgers(wh_run *r, const char *name)
{
	char prefix[WH_LEDGER_NAME + 1];
	(void)snprintf(prefix, sizeof prefix, "%s.", name);
	wh_spill_remove(&r->spill, name);
	wh_spill_remove_all(&r->spill, prefix);
}

bool wh_run_recall_step(wh_run *r, wh_step_kind kind, wh_step *step)
{
	char name[WH_LEDGER_NAME];
	if (!r->journaled || r->recalled >= r->book.steps)
		return false;
	if (r->book.step[r->recalled].kind != kind) { /* cannot be; what follows is done again */
		r->book.steps = r->recalled;
		return false;
	}
	ledger_name(r->recalled, name);
	if (!wh_run_is_part(r))
		remove_ledgers(r, name);
	r->shared += kind == WH_STEP_REDUCE || kind == WH_STEP_SETTLE;
	*step = r->book.step[r->recalled++];
	return true;
}

wh_ledger *wh_run_ledger(wh_run *r, uint32_t clusters, wh_ledger_kind kind)
{
	char name[WH_LEDGER_NAME], own[WH_LEDGER_NAME];
	wh_ledger *l = &r->ledger;
	const bool part = wh_run_is_part(r);
	if (!r->journaled)
		return NULL;
	ledger_name(r->recalled, name);
	(void)snprintf(own, sizeof own, part ? "%.12s.%.*s" : "%.12s", name, WH_SPILL_TAG - 1,
	               r->spill.tag);
	if (wh_ledger_open(r->c, l, &r->spill, own, clusters) != WH_OK ||
	    wh_ledger_take(r->c, l, name) != WH_OK || wh_run_parts(r, l, kind) != WH_OK)
		return NULL;
	l->trusts = r->params->stage != WH_STAGE_ALL && !part;
	l->parts = part ? (uint32_t)r->book.parts : 0;
	l->part = r->params->part;
	l->helps = wh_run_is_job(r);
	return l;
}

wh_code wh_run_note_step(wh_run *r, const wh_step *step)
{
	if (!r->journaled)
		return WH_OK;
	if (!wh_manifest_is_ours(r->c, &r->spill, r->book.token))
		return refuse(
		    r, WH_E_RUN,
		    "was taken over by another process, or its manifest is gone: this one "
		    "ends here");
	if (step->kind == WH_STEP_INGEST)
		note_input(r);
	note_sums(r);
	if (wh_manifest_add(r->c, &r->book, step) != WH_OK ||
	    wh_manifest_write(r->c, &r->spill, &r->book) != WH_OK)
		return r->c->err.code;
	r->recalled++;
	r->joined = true;
	r->shared += step->kind == WH_STEP_REDUCE || step->kind == WH_STEP_SETTLE;
	if (r->ledger.spill) {
		char name[WH_LEDGER_NAME];
		memcpy(name, r->ledger.name, sizeof name);
		wh_ledger_close(r->c, &r->ledger);
		remove_ledgers(r, name);
	}
	return WH_OK;
}

void wh_run_forget(wh_run *r, const wh_store *store)
{
	if (!wh_run_is_part(r))
		wh_round_remove(store);
}

/* What is done stays, whole files only. A run that has done nothing leaves nothing. */
void wh_run_close_folder(wh_run *r, wh_code code)
{
	const bool whole = code == WH_OK;
	wh_ledger_close(r->c, &r->ledger);
	if (r->journaled && wh_manifest_is_ours(r->c, &r->spill, r->book.token)) {
		r->report->resumable = !whole && (r->book.steps > 0 || r->book.parts > 0);
		if (!r->report->resumable)
			wh_spill_discard(r->c, &r->spill, WH_MANIFEST_NAME, whole || r->spill.made);
	}
	wh_manifest_free(r->c, &r->book);
}
