/*
 * Structs are written and read by tables of their fields: a new parameter or result is one more
 * row.
 */
#define _GNU_SOURCE
#include "run/manifest.h"

#include <errno.h>
#include <inttypes.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include <xxhash.h>

#define MAGIC "whittle-run 2 "

enum {
	LINE = 512,          /* bytes of a line, at most */
	CHECKSUM_LINE = 26,  /* "checksum ", 16 digits and the end of the line */
	MOST_BYTES = 1 << 26 /* of the file */
};

/* ---- tables ------------------------------------------------------------------------------- */

typedef enum field_type { FLAG, NUMBER32, NUMBER, REAL, TEXT } field_type;

/* One field of a struct, or several of one type in a row; a text: its bytes. */
typedef struct field {
	const char *name;
	field_type type;
	size_t at, n;
} field;

#define ROW(in, type, member)                          \
	{                                              \
#member, type, offsetof(in, member), 1 \
	}
#define ROWS(in, type, member, n)                      \
	{                                              \
#member, type, offsetof(in, member), n \
	}
#define TEXT_ROW(in, member)                                                 \
	{                                                                    \
#member, TEXT, offsetof(in, member), sizeof((in *)0)->member \
	}
#define END                      \
	{                        \
		NULL, FLAG, 0, 0 \
	}

static const field run_fields[] = {
    TEXT_ROW(wh_manifest, version),
    TEXT_ROW(wh_manifest, host),
    ROW(wh_manifest, NUMBER, pid),
    ROW(wh_manifest, NUMBER, started),
    ROW(wh_manifest, NUMBER, resumed),
    TEXT_ROW(wh_manifest, input),
    ROW(wh_manifest, NUMBER, input_bytes),
    ROW(wh_manifest, NUMBER, input_seconds),
    ROW(wh_manifest, NUMBER, input_nanoseconds),
    ROW(wh_manifest, NUMBER, input_digest),
    ROW(wh_manifest, FLAG, digest_of_file),
    ROW(wh_manifest, NUMBER, parts),
    ROW(wh_manifest, FLAG, shared_ingest),
    ROW(wh_manifest, NUMBER, clusters),
    ROW(wh_manifest, NUMBER, rounds),
    ROW(wh_manifest, NUMBER, peak_disk),
    ROW(wh_manifest, FLAG, streams),
    ROW(wh_manifest, NUMBER, bytes_read),
    ROW(wh_manifest, NUMBER, temp_read),
    ROW(wh_manifest, NUMBER, temp_written),
    ROW(wh_manifest, NUMBER, temp_peak),
    ROW(wh_manifest, REAL, seconds),
    END,
};

static const field choice_fields[] = {
    ROW(wh_choices, NUMBER, faces),
    ROW(wh_choices, REAL, face_ratio),
    ROW(wh_choices, NUMBER, vertices),
    ROW(wh_choices, REAL, vertex_ratio),
    ROW(wh_choices, REAL, error),
    ROW(wh_choices, REAL, error_share),
    ROW(wh_choices, FLAG, fast),
    ROW(wh_choices, FLAG, lock_boundary),
    ROW(wh_choices, FLAG, simplify_topology),
    ROW(wh_choices, FLAG, drop_invalid),
    ROW(wh_choices, FLAG, weld),
    ROW(wh_choices, REAL, weld_distance),
    ROW(wh_choices, REAL, weld_share),
    ROW(wh_choices, FLAG, drop_duplicates),
    ROW(wh_choices, NUMBER, min_component),
    ROW(wh_choices, FLAG, ascii),
    ROW(wh_choices, FLAG, quantize),
    ROW(wh_choices, FLAG, seams),
    ROW(wh_choices, NUMBER, from),
    ROW(wh_choices, NUMBER, to),
    ROW(wh_choices, NUMBER, packing),
    ROW(wh_choices, NUMBER, attributes_hash),
    ROW(wh_choices, NUMBER, weights_hash),
    ROW(wh_choices, NUMBER, cost),
    ROW(wh_choices, NUMBER, face_weight),
    ROW(wh_choices, NUMBER, placement),
    ROW(wh_choices, NUMBER, own_hash),
    ROW(wh_choices, NUMBER, levels_hash),
    ROW(wh_choices, NUMBER, cluster_faces),
    ROW(wh_choices, NUMBER, micro_faces),
    ROW(wh_choices, NUMBER, final_faces),
    ROW(wh_choices, REAL, round_keep),
    ROW(wh_choices, NUMBER, smooth),
    ROW(wh_choices, FLAG, normals),
    END,
};

static const field phase_fields[] = {
    ROW(wh_phase_report, REAL, seconds),       ROW(wh_phase_report, REAL, serial),
    ROW(wh_phase_report, REAL, busy),          ROWS(wh_phase_report, REAL, model, WH_SCALING),
    ROW(wh_phase_report, NUMBER, bytes_read),  ROW(wh_phase_report, NUMBER, bytes_written),
    ROW(wh_phase_report, NUMBER, memory_peak), END,
};

static const field step_fields[] = {
    ROW(wh_step, FLAG, kept),
    ROW(wh_step, NUMBER32, store.generation),
    ROW(wh_step, NUMBER32, store.clusters),
    ROW(wh_step, NUMBER32, store.parts),
    ROW(wh_step, NUMBER32, store.id_bytes),
    ROW(wh_step, NUMBER32, store.coord_bytes),
    ROW(wh_step, NUMBER32, store.vertex_payload),
    ROW(wh_step, NUMBER32, store.attr_bytes),
    ROW(wh_step, NUMBER32, store.face_bytes),
    ROW(wh_step, FLAG, store.local_corners),
    ROW(wh_step, NUMBER, faces),
    ROW(wh_step, NUMBER, unreferenced),
    ROW(wh_step, NUMBER, work.collapses),
    ROW(wh_step, NUMBER, work.vertices),
    ROWS(wh_step, NUMBER, work.changes, WH_TOPOLOGIES),
    ROW(wh_step, REAL, work.highest_cost),
    ROW(wh_step, REAL, work.highest_err),
    ROW(wh_step, REAL, work.cost_distance),
    ROW(wh_step, FLAG, work.exhausted),
    ROW(wh_step, NUMBER32, work.fixed),
    ROW(wh_step, NUMBER32, work.border),
    ROW(wh_step, REAL, max_cost),
    ROW(wh_step, REAL, micro_cost),
    ROW(wh_step, NUMBER, never_free),
    ROW(wh_step, FLAG, reached),
    ROW(wh_step, FLAG, one_less),
    ROW(wh_step, NUMBER, input_vertices),
    ROW(wh_step, NUMBER, input_faces),
    ROW(wh_step, NUMBER, polygons),
    ROW(wh_step, NUMBER, degenerate),
    ROW(wh_step, FLAG, is_double),
    ROW(wh_step, NUMBER, clean.invalid_vertices),
    ROW(wh_step, NUMBER, clean.invalid_faces),
    ROW(wh_step, NUMBER, clean.welded_vertices),
    ROW(wh_step, NUMBER, clean.degenerate_faces),
    ROW(wh_step, NUMBER, clean.collapsed_faces),
    ROW(wh_step, NUMBER, clean.bytes_read),
    ROW(wh_step, REAL, clean.distance),
    ROW(wh_step, NUMBER, clean.joined_vertices),
    ROW(wh_step, NUMBER, sift.faces),
    ROW(wh_step, NUMBER, sift.duplicate_faces),
    ROW(wh_step, NUMBER, sift.zero_area_faces),
    ROW(wh_step, NUMBER, sift.small_components),
    ROW(wh_step, NUMBER, sift.component_faces),
    ROW(wh_step, NUMBER, sift.component_vertices),
    ROW(wh_step, NUMBER, sift.unreferenced),
    ROWS(wh_step, REAL, ingest.lo, 3),
    ROWS(wh_step, REAL, ingest.hi, 3),
    ROW(wh_step, REAL, ingest.scale),
    ROW(wh_step, REAL, ingest.step),
    ROW(wh_step, NUMBER, ingest.faces),
    ROW(wh_step, NUMBER, ingest.degenerate),
    ROW(wh_step, NUMBER, ingest.cut_vertices),
    ROW(wh_step, NUMBER, ingest.windows),
    ROW(wh_step, NUMBER, ingest.face_reads),
    ROW(wh_step, NUMBER, cuts),
    ROW(wh_step, NUMBER, cuts_checksum),
    ROW(wh_step, NUMBER, result),
    ROW(wh_step, NUMBER, level.target_faces),
    ROW(wh_step, NUMBER, level.target_vertices),
    ROW(wh_step, NUMBER, level.vertices),
    ROW(wh_step, NUMBER, level.faces),
    ROW(wh_step, NUMBER, level.bytes),
    ROW(wh_step, NUMBER, level.boundary_edges),
    ROW(wh_step, NUMBER, level.nonmanifold_edges),
    ROW(wh_step, NUMBER, level.components),
    ROW(wh_step, REAL, level.cost_distance),
    ROW(wh_step, REAL, level.accumulated_error),
    ROW(wh_step, FLAG, level.checked),
    ROW(wh_step, FLAG, level.streamed),
    ROW(wh_step, FLAG, level.one_less),
    ROW(wh_step, FLAG, level.exhausted),
    TEXT_ROW(wh_step, level.checksum),
    END,
};

static const field written_fields[] = {
    ROW(wh_written, NUMBER, result),      ROW(wh_written, NUMBER, output_bytes),
    ROW(wh_written, NUMBER, seams_bytes), TEXT_ROW(wh_written, output),
    TEXT_ROW(wh_written, seams),          END,
};

_Static_assert(sizeof(wh_vec3) == 3 * sizeof(double), "a place is three reals in a row");

const char *wh_step_name(wh_step_kind kind)
{
	static const char *const name[WH_STEP_KINDS] = {"ingest", "survey", "reduce",
	                                                "recut",  "settle", "write"};
	return name[kind];
}

static size_t item_bytes(field_type type)
{
	return type == FLAG ? sizeof(bool) : type == NUMBER32 ? sizeof(uint32_t) : 8;
}

/* Item i of a field, as 64 bits. */
static uint64_t item(const void *in, const field *f, size_t i)
{
	const char *at = (const char *)in + f->at + i * item_bytes(f->type);
	uint64_t wide = 0;
	uint32_t narrow;
	switch (f->type) {
	case FLAG:
		return *(const bool *)at;
	case NUMBER32:
		memcpy(&narrow, at, sizeof narrow);
		return narrow;
	default:
		memcpy(&wide, at, sizeof wide);
		return wide;
	}
}

static bool put_item(void *in, const field *f, size_t i, uint64_t value)
{
	char *at = (char *)in + f->at + i * item_bytes(f->type);
	const uint32_t narrow = (uint32_t)value;
	switch (f->type) {
	case FLAG:
		*(bool *)at = value != 0;
		return value <= 1;
	case NUMBER32:
		memcpy(at, &narrow, sizeof narrow);
		return value == narrow;
	default:
		memcpy(at, &value, sizeof value);
		return true;
	}
}

/* ---- writing ------------------------------------------------------------------------------ */

typedef struct text {
	char *at;
	size_t n, cap;
} text;

static wh_code put(wh_ctx *c, text *t, const char *line)
{
	const size_t n = strlen(line);
	if (wh_reserve(c, &t->at, &t->cap, t->n + n + 1, 1) != WH_OK)
		return c->err.code;
	memcpy(t->at + t->n, line, n + 1);
	t->n += n;
	return WH_OK;
}

static bool is_zero(const void *in, const field *f)
{
	for (size_t i = 0; i < f->n; i++)
		if (f->type == TEXT ? ((const char *)in)[f->at] != '\0' : item(in, f, i) != 0)
			return false;
	return true;
}

static wh_code put_field(wh_ctx *c, text *t, const void *in, const field *f)
{
	char line[LINE];
	size_t n = (size_t)snprintf(line, sizeof line, "%s", f->name);
	if (f->type == TEXT)
		n += (size_t)snprintf(line + n, sizeof line - n, " %s", (const char *)in + f->at);
	for (size_t i = 0; f->type != TEXT && i < f->n; i++)
		n += (size_t)snprintf(line + n, sizeof line - n,
		                      f->type == REAL ? " 0x%016" PRIx64 : " %" PRIu64,
		                      item(in, f, i));
	(void)snprintf(line + n, sizeof line - n, "\n");
	return put(c, t, line);
}

static wh_code put_struct(wh_ctx *c, text *t, const char *title, const void *in, const field *table)
{
	char line[LINE];
	(void)snprintf(line, sizeof line, "[%s]\n", title);
	wh_code code = put(c, t, line);
	for (const field *f = table; code == WH_OK && f->name; f++)
		if (!is_zero(in, f))
			code = put_field(c, t, in, f);
	return code;
}

static wh_code put_all(wh_ctx *c, text *t, const wh_manifest *m)
{
	char line[LINE];
	(void)snprintf(line, sizeof line, MAGIC "%s\n", m->token);
	if (put(c, t, line) != WH_OK || put_struct(c, t, "run", m, run_fields) != WH_OK ||
	    put_struct(c, t, "parameters", &m->choices, choice_fields) != WH_OK)
		return c->err.code;
	for (int i = 0; i < WH_PHASES; i++) {
		(void)snprintf(line, sizeof line, "phase %s", wh_phase_name((wh_phase)i));
		if (put_struct(c, t, line, &m->phase[i], phase_fields) != WH_OK)
			return c->err.code;
	}
	for (size_t i = 0; i < m->steps; i++) {
		(void)snprintf(line, sizeof line, "step %s", wh_step_name(m->step[i].kind));
		if (put_struct(c, t, line, &m->step[i], step_fields) != WH_OK)
			return c->err.code;
	}
	for (size_t i = 0; i < m->n_written; i++)
		if (put_struct(c, t, "written", &m->written[i], written_fields) != WH_OK)
			return c->err.code;
	(void)snprintf(line, sizeof line, "checksum %016" PRIx64 "\n",
	               (uint64_t)XXH3_64bits(t->at, t->n));
	return put(c, t, line);
}

wh_code wh_manifest_write(wh_ctx *c, wh_spill *spill, const wh_manifest *m)
{
	char part[WH_SPILL_NAME];
	text t = {0};
	wh_code code = put_all(c, &t, m);
	const int fd = code == WH_OK
	                   ? wh_spill_create(c, spill, wh_spill_part(spill, WH_MANIFEST_NAME, part))
	                   : -1;
	if (fd >= 0) {
		code = wh_spill_pwrite(c, spill, fd, t.at, t.n, 0);
		if (close(fd) != 0 && code == WH_OK)
			code = wh_fail_errno(c, "cannot write '%s/%s'", spill->dir, part);
	} else if (code == WH_OK) {
		code = wh_failed(c);
	}
	wh_free(c, t.at);
	/* the files that it speaks of have their names for good before it has its own */
	if (code == WH_OK)
		code = wh_spill_flush(c, spill);
	if (code == WH_OK)
		code = wh_spill_flush_file(c, spill, part);
	if (code == WH_OK)
		code = wh_spill_rename(c, spill, part, WH_MANIFEST_NAME);
	return code == WH_OK ? wh_spill_flush(c, spill) : code;
}

/* ---- reading ------------------------------------------------------------------------------ */

/* Where the fields of the lines at hand go. */
typedef struct section {
	void *to;
	const field *table;
} section;

static const field *find_field(const field *table, const char *name, size_t n)
{
	for (const field *f = table; f && f->name; f++)
		if (strlen(f->name) == n && strncmp(f->name, name, n) == 0)
			return f;
	return NULL;
}

static bool get_numbers(void *to, const field *f, const char *value)
{
	for (size_t i = 0; i < f->n; i++) {
		char *end;
		errno = 0;
		const uint64_t v = strtoull(value, &end, 0);
		if (end == value || errno != 0 || !put_item(to, f, i, v))
			return false;
		value = end;
	}
	return *value == '\0';
}

static bool get_field(const section *s, const char *line)
{
	const char *space = strchr(line, ' ');
	if (!space)
		return false;
	const field *f = find_field(s->table, line, (size_t)(space - line));
	if (!f)
		return false;
	if (f->type != TEXT)
		return get_numbers(s->to, f, space + 1);
	if (strlen(space + 1) >= f->n)
		return false;
	memcpy((char *)s->to + f->at, space + 1, strlen(space + 1) + 1);
	return true;
}

static wh_code add_written(wh_ctx *c, wh_manifest *m, const wh_written *w)
{
	if (wh_reserve(c, &m->written, &m->written_cap, m->n_written + 1, sizeof *m->written) !=
	    WH_OK)
		return c->err.code;
	m->written[m->n_written++] = *w;
	return WH_OK;
}

/* A title opens a section. */
static wh_code open_section(wh_ctx *c, wh_manifest *m, const char *title, section *s)
{
	*s = (section){0};
	if (strcmp(title, "[run]") == 0)
		*s = (section){m, run_fields};
	if (strcmp(title, "[parameters]") == 0)
		*s = (section){&m->choices, choice_fields};
	if (strcmp(title, "[written]") == 0) {
		if (add_written(c, m, &(wh_written){0}) != WH_OK)
			return c->err.code;
		*s = (section){&m->written[m->n_written - 1], written_fields};
	}
	char full[LINE];
	for (int i = 0; i < WH_PHASES; i++) {
		(void)snprintf(full, sizeof full, "[phase %s]", wh_phase_name((wh_phase)i));
		if (strcmp(title, full) == 0)
			*s = (section){&m->phase[i], phase_fields};
	}
	for (int i = 0; i < WH_STEP_KINDS; i++) {
		(void)snprintf(full, sizeof full, "[step %s]", wh_step_name((wh_step_kind)i));
		if (strcmp(title, full) != 0)
			continue;
		if (wh_manifest_add(c, m, &(wh_step){.kind = (wh_step_kind)i}) != WH_OK)
			return c->err.code;
		*s = (section){&m->step[m->steps - 1], step_fields};
	}
	return WH_OK;
}

static wh_code damaged(wh_ctx *c, const wh_spill *s)
{
	return wh_fail(c, WH_E_RUN,
	               "'%s/" WH_MANIFEST_NAME
	               "' is damaged, and with it the run: remove the folder and start again",
	               s->dir);
}

/* Takes a text that ends in NUL apart. */
static wh_code parse(wh_ctx *c, const wh_spill *s, wh_manifest *m, char *at)
{
	section now = {0};
	char *end = strchr(at, '\n');
	if (!end || (size_t)(end - at) >= sizeof MAGIC - 1 + sizeof m->token)
		return damaged(c, s);
	*end = '\0';
	(void)snprintf(m->token, sizeof m->token, "%s", at + sizeof MAGIC - 1);
	for (at = end + 1; *at; at = end + 1) {
		end = strchr(at, '\n');
		if (!end)
			return damaged(c, s);
		*end = '\0';
		if (*at == '[') {
			if (open_section(c, m, at, &now) != WH_OK)
				return c->err.code;
		} else if (!get_field(&now, at)) {
			return damaged(c, s);
		}
	}
	return WH_OK;
}

static wh_code other_version(wh_ctx *c, const wh_spill *s, const char *what)
{
	return wh_fail(c, WH_E_USAGE,
	               "'%s' holds a run of another version of whittle (%s), whose result may "
	               "differ: finish it with that one, or remove the folder and start again",
	               s->dir, what);
}

static wh_code check_and_parse(wh_ctx *c, const wh_spill *s, wh_manifest *m, char *at, size_t n)
{
	char line[LINE];
	at[n] = '\0';
	if (strlen(at) != n || n < CHECKSUM_LINE || strncmp(at, "whittle-run ", 12) != 0)
		return damaged(c, s);
	const size_t body = n - CHECKSUM_LINE;
	(void)snprintf(line, sizeof line, "checksum %016" PRIx64 "\n",
	               (uint64_t)XXH3_64bits(at, body));
	if (strcmp(at + body, line) != 0)
		return damaged(c, s);
	if (strncmp(at, MAGIC, sizeof MAGIC - 1) != 0)
		return other_version(c, s, "another layout of the manifest");
	at[body] = '\0';
	if (parse(c, s, m, at) != WH_OK)
		return c->err.code;
	if (strcmp(m->version, WHITTLE_VERSION) != 0)
		return other_version(c, s, m->version);
	return WH_OK;
}

wh_code wh_manifest_read(wh_ctx *c, wh_spill *spill, wh_manifest *m, bool *found)
{
	struct stat st;
	*m = (wh_manifest){0};
	*found = fstatat(spill->dirfd, WH_MANIFEST_NAME, &st, 0) == 0;
	if (!*found)
		return WH_OK;
	if (!S_ISREG(st.st_mode) || st.st_size > MOST_BYTES)
		return damaged(c, spill);
	const int fd = wh_spill_read(c, spill, WH_MANIFEST_NAME);
	if (fd < 0)
		return wh_failed(c);
	char *at = wh_alloc(c, (size_t)st.st_size + 1, 1);
	wh_code code = c->err.code;
	if (code == WH_OK)
		code = wh_spill_pread(c, spill, fd, at, (size_t)st.st_size, 0);
	if (code == WH_OK)
		code = check_and_parse(c, spill, m, at, (size_t)st.st_size);
	(void)close(fd);
	wh_free(c, at);
	if (code != WH_OK)
		wh_manifest_free(c, m);
	return code;
}

bool wh_manifest_is_ours(wh_ctx *c, wh_spill *spill, const char *token)
{
	char line[sizeof MAGIC + WH_SPILL_TAG] = "", ours[sizeof MAGIC + WH_SPILL_TAG];
	wh_ctx own = wh_ctx_fork(c);
	const int n = snprintf(ours, sizeof ours, MAGIC "%s\n", token);
	const int fd = wh_spill_read(&own, spill, WH_MANIFEST_NAME);
	const bool ok = fd >= 0 && wh_spill_pread(&own, spill, fd, line, (size_t)n, 0) == WH_OK &&
	                strcmp(line, ours) == 0;
	if (fd >= 0)
		(void)close(fd);
	return ok;
}

/* ---- in memory ---------------------------------------------------------------------------- */

void wh_manifest_free(wh_ctx *c, wh_manifest *m)
{
	wh_free(c, m->step);
	wh_free(c, m->written);
	*m = (wh_manifest){0};
}

wh_code wh_manifest_add(wh_ctx *c, wh_manifest *m, const wh_step *step)
{
	if (wh_reserve(c, &m->step, &m->cap, m->steps + 1, sizeof *m->step) != WH_OK)
		return c->err.code;
	m->step[m->steps++] = *step;
	return WH_OK;
}

wh_code wh_manifest_note_written(wh_ctx *c, wh_manifest *m, const wh_written *w)
{
	for (size_t i = 0; i < m->n_written; i++)
		if (m->written[i].result == w->result) {
			m->written[i] = *w;
			return WH_OK;
		}
	return add_written(c, m, w);
}

/* A parameter as people write it. */
static void describe(const field *f, uint64_t value, char *out, size_t n)
{
	double real;
	memcpy(&real, &value, sizeof real);
	if (f->type == REAL)
		(void)snprintf(out, n, "%.9g", real);
	else if (f->type == FLAG)
		(void)snprintf(out, n, "%s", value ? "on" : "off");
	else
		(void)snprintf(out, n, "%" PRIu64, value);
}

bool wh_choices_differ(const wh_choices *was, const wh_choices *is, char *out, size_t n)
{
	size_t used = 0;
	*out = '\0';
	for (const field *f = choice_fields; f->name; f++) {
		const uint64_t a = item(was, f, 0), b = item(is, f, 0);
		char before[32], now[32];
		if (a == b)
			continue;
		describe(f, a, before, sizeof before);
		describe(f, b, now, sizeof now);
		if (used < n)
			used += (size_t)snprintf(out + used, n - used, "%s%s was %s and is %s",
			                         used ? ", " : "", f->name, before, now);
	}
	return used > 0;
}
