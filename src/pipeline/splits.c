/*
 * The order of the splits, and their way into the file.
 *
 * What the collapses do to each other is known already (algo/progressive_trace.c), so their order
 * is that of their keys, the highest last collapse first. In it vertices and faces get their
 * numbers for good: those of the base its own, those of the splits one after the other. Then each
 * split is told by what cannot be known from the mesh before it, which is: numbers of vertices,
 * found by sorting, its differences, which were recorded, and its fan (splits_fan.c).
 *
 * Cost: everything is sorted, in some 200 bytes of temporary disk a face; the memory is what the
 * caller gives.
 */
#include "pipeline/splits.h"

#include <math.h>

/* More memory than this for each sorter makes it no faster. */
static const size_t SHARE_MOST = (size_t)32 << 20;

enum {
	SORTERS = 7,     /* that hold memory at the same time */
	FIGURES = 16384, /* errors handled at once */
	PROGRESS = 1 << 16
};

/* What is here only. */
typedef struct writer {
	wh_splits_work w;
	wh_runs step;     /* by falling keys, later ones first; wh_sequence_step, and its numbers */
	uint32_t numbers; /* bytes */
	uint32_t steps, faces; /* faces: so far */
	int error_fd;          /* of each split, in their order */
	float *error;          /* some of them */
	wh_pmesh_block block;
	float last_error, last_key; /* of the split before */
} writer;

/* ---- the order ---------------------------------------------------------------------------- */

/* Keys are not negative: their bits have the order of their values. */
static uint64_t falling(float key, uint32_t place)
{
	uint32_t bits;
	memcpy(&bits, &key, sizeof bits);
	return ~wh_splits_key(bits, place);
}

static uint32_t place_of(const uint8_t *record)
{
	return (uint32_t)~wh_runs_number(record);
}

static wh_code read_steps(wh_ctx *c, writer *k, wh_sequence_reader *r)
{
	wh_sequence_step step;
	const uint8_t *numbers, *moved;
	bool more;
	for (;;) {
		if (wh_sequence_next(c, r, &step, &numbers, &moved, &more) != WH_OK || !more)
			return c->err.code;
		uint8_t *to = wh_runs_room(c, &k->step);
		if (!to)
			return c->err.code;
		const uint64_t key = falling(step.key, k->steps++);
		memcpy(to, &key, sizeof key);
		memcpy(to + sizeof key, &step, sizeof step);
		memcpy(to + sizeof key + sizeof step, numbers, k->numbers);
		k->w.turns += step.moved;
	}
}

static wh_code sort_steps(wh_ctx *c, writer *k)
{
	const wh_sequence *s = k->w.in->sequence;
	wh_sequence_reader r = {.s = s};
	k->numbers = wh_sequence_numbers_bytes(s);
	wh_code code = wh_runs_open(c, &k->step, s->spill,
	                            sizeof(uint64_t) + sizeof(wh_sequence_step) + k->numbers,
	                            k->w.share, k->w.in->collapses);
	if (code == WH_OK)
		code = read_steps(c, k, &r);
	wh_sequence_close(c, &r);
	return code == WH_OK ? wh_runs_end(c, &k->step) : code;
}

/* ---- numbers ------------------------------------------------------------------------------ */

static wh_code ask(wh_ctx *c, writer *k, uint32_t vertex, uint32_t split, uint32_t question)
{
	uint8_t *to = wh_runs_room(c, &k->w.asked);
	if (!to)
		return c->err.code;
	const uint64_t key = wh_splits_key(vertex, split);
	const wh_splits_asked asked = {k->faces, question};
	memcpy(to, &key, sizeof key);
	memcpy(to + sizeof key, &asked, sizeof asked);
	return WH_OK;
}

static wh_code number_base(wh_ctx *c, writer *k)
{
	const wh_patch *p = k->w.in->base;
	for (uint32_t v = 0; v < p->nv; v++)
		if (wh_runs_put(c, &k->w.number, wh_splits_key((uint32_t)p->gid[v], v)) != WH_OK)
			return c->err.code;
	for (uint32_t f = 0; f < p->nf; f++) {
		wh_trace_face face;
		memcpy(&face, wh_patch_face(p, f), sizeof face);
		if (wh_runs_put(c, &k->w.face, wh_splits_key(face.id, f)) != WH_OK)
			return c->err.code;
	}
	k->faces = p->nf;
	return WH_OK;
}

/* Split j, which is read from the record of its collapse. */
static wh_code number_split(wh_ctx *c, writer *k, const uint8_t *record, uint32_t j)
{
	wh_splits_work *w = &k->w;
	wh_sequence_step s;
	memcpy(&s, record + sizeof(uint64_t), sizeof s);
	if (wh_runs_put(c, &w->number, wh_splits_key(s.u, w->in->base->nv + j)) != WH_OK ||
	    wh_runs_put(c, &w->place, wh_splits_key(place_of(record), j)) != WH_OK ||
	    ask(c, k, s.v, j, WH_SPLITS_FAN) != WH_OK)
		return c->err.code;
	for (uint32_t i = 0; i < s.faces; i++) {
		if (s.way >= WH_PMESH_NAMED && ask(c, k, s.apex[i], j, WH_SPLITS_APEX + i) != WH_OK)
			return c->err.code;
		if (wh_runs_put(c, &w->face, wh_splits_key(s.face[i], k->faces + i)) != WH_OK)
			return c->err.code;
	}
	k->faces += s.faces;
	k->error[j % FIGURES] = s.err;
	return WH_OK;
}

static wh_code write_errors(wh_ctx *c, writer *k, uint32_t from, uint32_t n)
{
	return wh_spill_pwrite(c, k->w.in->sequence->spill, k->error_fd, k->error,
	                       n * sizeof *k->error, (uint64_t)from * sizeof *k->error);
}

static wh_code read_errors(wh_ctx *c, writer *k, uint32_t from)
{
	const uint32_t n = k->steps - from < FIGURES ? k->steps - from : FIGURES;
	return wh_spill_pread(c, k->w.in->sequence->spill, k->error_fd, k->error,
	                      n * sizeof *k->error, (uint64_t)from * sizeof *k->error);
}

static wh_code number_splits(wh_ctx *c, writer *k)
{
	for (uint32_t j = 0; j < k->steps; j++) {
		const uint8_t *record = wh_runs_next(c, &k->step);
		if (!record || number_split(c, k, record, j) != WH_OK)
			return wh_failed(c);
		const uint32_t n = j % FIGURES + 1;
		if ((n == FIGURES || j + 1 == k->steps) &&
		    write_errors(c, k, j + 1 - n, n) != WH_OK)
			return c->err.code;
	}
	return k->faces == k->w.in->faces ? WH_OK : wh_splits_differ(c);
}

/* What a level's error is: the worst so far, in the order of the collapses. */
static wh_code accumulate_errors(wh_ctx *c, writer *k)
{
	float worst = 0;
	for (uint32_t from = (k->steps + FIGURES - 1) / FIGURES * FIGURES; from > 0;) {
		from -= FIGURES;
		const uint32_t n = k->steps - from < FIGURES ? k->steps - from : FIGURES;
		if (read_errors(c, k, from) != WH_OK)
			return c->err.code;
		for (uint32_t i = n; i-- > 0;)
			k->error[i] = worst = fmaxf(worst, k->error[i]);
		if (write_errors(c, k, from, n) != WH_OK)
			return c->err.code;
	}
	k->last_error = worst;
	return WH_OK;
}

static wh_code number_all(wh_ctx *c, writer *k)
{
	wh_splits_work *w = &k->w;
	wh_spill *spill = w->in->sequence->spill;
	const uint64_t vertices = (uint64_t)w->in->base->nv + k->steps;
	k->error_fd = wh_spill_scratch(c, spill);
	k->error = wh_alloc(c, FIGURES, sizeof *k->error);
	if (k->error_fd < 0 || !k->error ||
	    wh_runs_open(c, &w->number, spill, 8, w->share, vertices) != WH_OK ||
	    wh_runs_open(c, &w->face, spill, 8, w->share, w->in->faces) != WH_OK ||
	    wh_runs_open(c, &w->place, spill, 8, w->share, k->steps) != WH_OK ||
	    wh_runs_open(c, &w->asked, spill, 8 + sizeof(wh_splits_asked), w->share, k->steps) !=
	        WH_OK ||
	    number_base(c, k) != WH_OK || number_splits(c, k) != WH_OK ||
	    accumulate_errors(c, k) != WH_OK || wh_runs_end(c, &w->number) != WH_OK ||
	    wh_runs_end(c, &w->face) != WH_OK || wh_runs_end(c, &w->place) != WH_OK ||
	    wh_runs_end(c, &w->asked) != WH_OK)
		return wh_failed(c);
	return WH_OK;
}

/* ---- out ---------------------------------------------------------------------------------- */

static uint64_t *column(const writer *k, uint32_t i)
{
	return &wh_pmesh_column(&k->block, i)[k->block.n];
}

/* Differences of places, and of properties. */
static void tell_numbers(const writer *k, const uint8_t *numbers)
{
	const wh_sequence *s = k->w.in->sequence;
	for (uint32_t i = 0; i < wh_sequence_numbers(s); i++) {
		const uint32_t bytes = wh_sequence_number_bytes(s, i);
		const uint32_t to = i < WH_SEQUENCE_PLACES
		                        ? WH_PMESH_PLACE + i
		                        : WH_PMESH_FIXED + i - WH_SEQUENCE_PLACES;
		*column(k, to) = wh_sequence_get(numbers, bytes);
		numbers += bytes;
	}
}

static uint64_t fall(float *last, float now)
{
	const uint64_t by = wh_pmesh_ordered((double)*last, 4) - wh_pmesh_ordered((double)now, 4);
	*last = now;
	return by;
}

/* The answer to a question of split j. */
static wh_code take_told(wh_ctx *c, writer *k, uint32_t j, uint32_t question, wh_splits_told *told)
{
	const uint8_t *record = wh_runs_next(c, &k->w.told);
	if (!record || wh_runs_number(record) != wh_splits_key(j, question))
		return c->err.code ? c->err.code : wh_splits_differ(c);
	memcpy(told, record + sizeof(uint64_t), sizeof *told);
	return WH_OK;
}

static wh_code put_long_fan(wh_ctx *c, writer *k, const wh_splits_told *told)
{
	wh_splits_work *w = &k->w;
	wh_bits_out *fans = &k->block.fans;
	wh_bits_clear(&w->bits);
	if (wh_bits_reserve(c, &w->bits, told->bits) != WH_OK ||
	    wh_spill_pread(c, w->in->sequence->spill, w->fan_fd, w->bits.at, (told->bits + 7) / 8,
	                   told->fan) != WH_OK)
		return c->err.code;
	w->bits.n = told->bits;
	for (uint32_t i = 0; i < told->bits; i++)
		wh_bits_put(fans, w->bits.at[i >> 3] >> (i & 7) & 1, 1);
	return WH_OK;
}

static wh_code tell_fan(wh_ctx *c, writer *k, const wh_splits_told *told)
{
	wh_bits_out *fans = &k->block.fans;
	if (wh_bits_reserve(c, fans, told->bits + 4 * (uint64_t)WH_BITS_MOST) != WH_OK)
		return c->err.code;
	if (told->bits > 32)
		return put_long_fan(c, k, told);
	wh_bits_put(fans, told->fan, told->bits);
	return WH_OK;
}

/* The faces' third vertices, where the fan does not tell. */
static wh_code tell_apexes(wh_ctx *c, writer *k, const wh_sequence_step *s, uint32_t j)
{
	for (uint32_t i = 0; s->way >= WH_PMESH_NAMED && i < s->faces; i++) {
		wh_splits_told apex = {0};
		if (take_told(c, k, j, WH_SPLITS_APEX + i, &apex) != WH_OK)
			return c->err.code;
		wh_bits_put(&k->block.fans, s->uv[i], 1);
		wh_bits_put(&k->block.fans, apex.number, 32);
	}
	return WH_OK;
}

static wh_code tell_split(wh_ctx *c, writer *k, const uint8_t *record, uint32_t j)
{
	wh_sequence_step s;
	wh_splits_told told = {0};
	memcpy(&s, record + sizeof(uint64_t), sizeof s);
	if (take_told(c, k, j, WH_SPLITS_FAN, &told) != WH_OK || tell_fan(c, k, &told) != WH_OK ||
	    tell_apexes(c, k, &s, j) != WH_OK)
		return c->err.code;
	*column(k, WH_PMESH_V) = told.number;
	*column(k, WH_PMESH_WAY) = s.way;
	tell_numbers(k, record + sizeof(uint64_t) + sizeof s);
	*column(k, WH_PMESH_ERROR) = fall(&k->last_error, k->error[j % FIGURES]);
	*column(k, WH_PMESH_COST) = fall(&k->last_key, s.key);
	k->faces += s.faces;
	k->block.n++;
	return WH_OK;
}

static wh_code write_splits(wh_ctx *c, wh_progress *progress, writer *k, wh_outfile *o)
{
	k->faces = k->w.in->base->nf;
	for (uint32_t j = 0; j < k->steps; j++) {
		if (j % FIGURES == 0 && read_errors(c, k, j) != WH_OK)
			return c->err.code;
		const uint8_t *record = wh_runs_next(c, &k->step);
		if (!record || tell_split(c, k, record, j) != WH_OK)
			return wh_failed(c);
		if (k->block.n < WH_PMESH_BLOCK && j + 1 < k->steps)
			continue;
		const wh_pmesh_part part = {
		    .faces = k->faces, .error = k->last_error, .cost = k->last_key};
		wh_progress_add(progress, k->block.n);
		if (wh_poll(c) != WH_OK || wh_pmesh_write_block(c, o, &k->block, &part) != WH_OK)
			return c->err.code;
	}
	return WH_OK;
}

/* The key of the first split, which is the highest. */
static wh_code begin_again(wh_ctx *c, writer *k)
{
	wh_sequence_step s = {0};
	if (wh_runs_rewind(c, &k->step) != WH_OK)
		return c->err.code;
	const uint8_t *record = k->steps ? wh_runs_next(c, &k->step) : NULL;
	if (record)
		memcpy(&s, record + sizeof(uint64_t), sizeof s);
	k->last_key = s.key;
	return wh_runs_rewind(c, &k->step);
}

static wh_code write_base(wh_ctx *c, const writer *k, wh_outfile *o)
{
	const wh_splits *in = k->w.in;
	const wh_sequence *s = in->sequence;
	const wh_patch *p = in->base;
	const wh_pmesh_head h = {.coord_bytes = s->coord_bytes,
	                         .base_vertices = p->nv,
	                         .base_faces = p->nf,
	                         .splits = k->steps,
	                         .faces = in->faces,
	                         .input_bytes = in->input_bytes,
	                         .error = k->last_error,
	                         .cost = k->last_key,
	                         .diagonal = in->diagonal};
	wh_vec3 *pos = wh_alloc(c, p->nv, sizeof *pos);
	if (!pos)
		return wh_failed(c);
	for (uint32_t v = 0; v < p->nv; v++)
		pos[v] = wh_scale(p->pos[v], s->unscale);
	const wh_pmesh_base base = {&pos->x, p->attr, p->tri};
	const wh_code code = wh_pmesh_write_base(c, o, &h, s->attributes, &base);
	wh_free(c, pos);
	return code;
}

static wh_code write_all(wh_ctx *c, wh_progress *progress, writer *k, wh_outfile *o)
{
	const wh_attributes *a = k->w.in->sequence->attributes;
	wh_progress_phase(progress, "order", k->w.in->faces);
	if (sort_steps(c, k) != WH_OK || number_all(c, k) != WH_OK ||
	    wh_splits_find_corners(c, progress, &k->w) != WH_OK ||
	    wh_splits_find_fans(c, &k->w) != WH_OK || begin_again(c, k) != WH_OK)
		return c->err.code;
	wh_progress_phase(progress, "write", k->steps);
	if (wh_pmesh_block_make(c, &k->block, a ? a->n : 0) != WH_OK ||
	    write_base(c, k, o) != WH_OK)
		return c->err.code;
	return write_splits(c, progress, k, o);
}

static void free_all(wh_ctx *c, writer *k)
{
	wh_splits_work *w = &k->w;
	wh_spill *spill = w->in->sequence->spill;
	wh_runs_close(c, &k->step);
	wh_runs_close(c, &w->number);
	wh_runs_close(c, &w->face);
	wh_runs_close(c, &w->place);
	wh_runs_close(c, &w->moved);
	wh_runs_close(c, &w->corner);
	wh_runs_close(c, &w->asked);
	wh_runs_close(c, &w->told);
	if (w->fan_fd >= 0)
		wh_spill_close_scratch(spill, w->fan_fd);
	if (k->error_fd >= 0)
		wh_spill_close_scratch(spill, k->error_fd);
	wh_free(c, w->bits.at);
	wh_free(c, k->error);
	wh_pmesh_block_free(c, &k->block);
}

wh_code wh_splits_write(wh_ctx *c, wh_progress *progress, wh_outfile *o, const wh_splits *s)
{
	const size_t share = s->memory / SORTERS;
	writer k = {.w = {.in = s, .fan_fd = -1, .share = share < SHARE_MOST ? share : SHARE_MOST},
	            .error_fd = -1};
	const wh_code code = write_all(c, progress, &k, o);
	free_all(c, &k);
	return code;
}
