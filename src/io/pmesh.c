#include "io/pmesh.h"

#include <inttypes.h>
#include <math.h>
#include <unistd.h>

#define XXH_STATIC_LINKING_ONLY /* the size of a state */
#include <xxhash.h>

static const char MAGIC[8] = {'W', 'H', 'P', 'M', 'E', 'S', 'H', '1'};

enum {
	VERSION = 1,
	FIXED = 88,     /* bytes of the header before the description */
	SUMMED = 80,    /* of these under its checksum */
	PART_HEAD = 32, /* bytes of a block's head */
	PART_SUMMED = 24,
	DESCRIPTION_MOST = (WH_MOST_ATTRIBUTES + 3) * 258,
	CHUNK = 1 << 20, /* bytes of the base handled at a time */
	CHUNK_VERTICES = 4096
};

/* ---- numbers ------------------------------------------------------------------------------ */

static bool is_real(const wh_attribute *a)
{
	return a->form == WH_FORM_FLOAT || a->form == WH_FORM_DOUBLE;
}

static uint64_t load_whole(const uint8_t *at, uint32_t bytes)
{
	uint16_t half;
	switch (bytes) {
	case 1:
		return *at;
	case 2:
		memcpy(&half, at, sizeof half);
		return half;
	case 4:
		return wh_load32(at, false);
	default:
		return wh_load64(at, false);
	}
}

static void store_whole(uint8_t *at, uint32_t bytes, uint64_t v)
{
	const uint16_t half = (uint16_t)v;
	const uint32_t word = (uint32_t)v;
	switch (bytes) {
	case 1:
		*at = (uint8_t)v;
		break;
	case 2:
		memcpy(at, &half, sizeof half);
		break;
	case 4:
		memcpy(at, &word, sizeof word);
		break;
	default:
		memcpy(at, &v, sizeof v);
	}
}

uint64_t wh_pmesh_property(const wh_attribute *a, const uint8_t *record)
{
	const uint32_t bytes = wh_attribute_bytes(a);
	const uint64_t bits = load_whole(record + a->at, bytes), top = 1ULL << (8 * bytes - 1);
	if (!is_real(a))
		return bits;
	return bits & top ? ~bits & (top | (top - 1)) : bits | top;
}

void wh_pmesh_set_property(const wh_attribute *a, uint8_t *record, uint64_t ordered)
{
	const uint32_t bytes = wh_attribute_bytes(a);
	const uint64_t top = 1ULL << (8 * bytes - 1);
	if (is_real(a))
		ordered = ordered & top ? ordered ^ top : ~ordered & (top | (top - 1));
	store_whole(record + a->at, bytes, ordered);
}

/* ---- blocks in memory --------------------------------------------------------------------- */

wh_code wh_pmesh_block_make(wh_ctx *c, wh_pmesh_block *b, uint32_t properties)
{
	*b = (wh_pmesh_block){.columns = WH_PMESH_FIXED + 2 * properties};
	b->number = wh_alloc(c, (size_t)b->columns * WH_PMESH_BLOCK, sizeof *b->number);
	return b->number ? WH_OK : wh_failed(c);
}

void wh_pmesh_block_free(wh_ctx *c, wh_pmesh_block *b)
{
	wh_free(c, b->number);
	wh_free(c, b->fans.at);
	wh_free(c, b->code.at);
	wh_free(c, b->raw);
	*b = (wh_pmesh_block){0};
}

/* ---- the header out ----------------------------------------------------------------------- */

static unsigned char *put64(unsigned char *to, uint64_t v)
{
	return wh_put32(wh_put32(to, (uint32_t)v), (uint32_t)(v >> 32));
}

static unsigned char *put_float(unsigned char *to, float v)
{
	uint32_t bits;
	memcpy(&bits, &v, sizeof bits);
	return wh_put32(to, bits);
}

static unsigned char *put_double(unsigned char *to, double v)
{
	uint64_t bits;
	memcpy(&bits, &v, sizeof bits);
	return put64(to, bits);
}

static unsigned char *put_property(unsigned char *to, wh_type type, wh_type out, const char *name)
{
	const size_t all = strlen(name), n = all < UINT8_MAX ? all : UINT8_MAX;
	*to++ = (unsigned char)type;
	*to++ = (unsigned char)out;
	*to++ = (unsigned char)n;
	memcpy(to, name, n);
	return to + n;
}

/* The axes whose place is behind the attributes so far and before the next one, then that one. */
static unsigned char *put_description(unsigned char *to, const wh_attributes *a, wh_type coord)
{
	static const char *const name[] = {"x", "y", "z"};
	const uint32_t n = a ? a->n : 0;
	for (uint32_t k = 0; k <= n; k++) {
		for (int place = 0; place < 3; place++) {
			int axis = place; /* the one that comes at this place */
			for (int i = 0; a && n && i < 3; i++) {
				const int before = (a->rank[0] < a->rank[i]) +
				                   (a->rank[1] < a->rank[i]) +
				                   (a->rank[2] < a->rank[i]);
				axis = before == place ? i : axis;
			}
			if ((a && n ? a->before[axis] : 0) == k)
				to = put_property(to, coord, coord, name[axis]);
		}
		if (k < n)
			to = put_property(to, a->item[k].type, a->item[k].out, a->item[k].name);
	}
	return to;
}

static wh_code write_header(wh_ctx *c, wh_outfile *o, const wh_pmesh_head *h,
                            const wh_attributes *a)
{
	unsigned char *all = wh_alloc(c, FIXED + DESCRIPTION_MOST, 1), *to = all;
	if (!all)
		return wh_failed(c);
	const size_t n =
	    (size_t)(put_description(all + FIXED, a, h->coord_bytes == 8 ? WH_F64 : WH_F32) -
	             (all + FIXED));
	memcpy(to, MAGIC, sizeof MAGIC);
	to = wh_put32(to + sizeof MAGIC, VERSION);
	to = wh_put32(to, h->coord_bytes);
	to = wh_put32(to, 3 + (a ? a->n : 0));
	to = wh_put32(to, (uint32_t)n);
	to = put64(to, h->base_vertices);
	to = put64(to, h->base_faces);
	to = put64(to, h->splits);
	to = put64(to, h->faces);
	to = put64(to, h->input_bytes);
	to = put_float(to, h->error);
	to = put_float(to, h->cost);
	to = put_double(to, h->diagonal);
	(void)put64(to, XXH3_64bits_withSeed(all, SUMMED, XXH3_64bits(all + FIXED, n)));
	const wh_code code = wh_outfile_write(c, o, all, FIXED + n);
	wh_free(c, all);
	return code;
}

/* ---- the base out ------------------------------------------------------------------------- */

/* Bytes of the base in chunks, with their checksum. */
typedef struct base_out {
	wh_ctx *c;
	wh_outfile *o;
	uint8_t *buf;
	size_t n;
	XXH3_state_t *sum;
} base_out;

static wh_code flush(base_out *b)
{
	(void)XXH3_64bits_update(b->sum, b->buf, b->n);
	const wh_code code = wh_outfile_write(b->c, b->o, b->buf, b->n);
	b->n = 0;
	return code;
}

/* Room for a few bytes more. */
static wh_code room(base_out *b, size_t n)
{
	return b->n + n <= CHUNK ? WH_OK : flush(b);
}

static void put_coordinate(base_out *b, double v, uint32_t bytes)
{
	unsigned char *to = b->buf + b->n;
	(void)(bytes == 8 ? put_double(to, v) : put_float(to, (float)v));
	b->n += bytes;
}

/* A property in the bytes of its form, the lowest first. */
static void put_form(base_out *b, const wh_attribute *a, const uint8_t *record)
{
	const uint32_t bytes = wh_attribute_bytes(a);
	const uint64_t v = load_whole(record + a->at, bytes);
	for (uint32_t i = 0; i < bytes; i++)
		b->buf[b->n++] = (uint8_t)(v >> 8 * i);
}

static wh_code put_base(base_out *b, const wh_pmesh_head *h, const wh_attributes *a,
                        const wh_pmesh_base *base)
{
	for (uint64_t i = 0; i < 3 * h->base_vertices; i++) {
		if (room(b, 8) != WH_OK)
			return b->c->err.code;
		put_coordinate(b, base->xyz[i], h->coord_bytes);
	}
	for (uint64_t v = 0; a && v < h->base_vertices; v++)
		for (uint32_t k = 0; k < a->n; k++) {
			if (room(b, 8) != WH_OK)
				return b->c->err.code;
			put_form(b, &a->item[k], base->attr + v * a->bytes);
		}
	for (uint64_t i = 0; i < 3 * h->base_faces; i++) {
		if (room(b, 4) != WH_OK)
			return b->c->err.code;
		(void)wh_put32(b->buf + b->n, base->tri[i]);
		b->n += 4;
	}
	return flush(b);
}

wh_code wh_pmesh_write_base(wh_ctx *c, wh_outfile *o, const wh_pmesh_head *h,
                            const wh_attributes *a, const wh_pmesh_base *base)
{
	unsigned char sum[8];
	if (write_header(c, o, h, a) != WH_OK)
		return c->err.code;
	base_out b = {
	    .c = c, .o = o, .buf = wh_alloc(c, CHUNK, 1), .sum = wh_alloc(c, 1, sizeof *b.sum)};
	wh_code code = b.buf && b.sum ? WH_OK : wh_failed(c);
	if (code == WH_OK) {
		(void)XXH3_64bits_reset(b.sum);
		code = put_base(&b, h, a, base);
	}
	if (code == WH_OK) {
		(void)put64(sum, XXH3_64bits_digest(b.sum));
		code = wh_outfile_write(c, o, sum, sizeof sum);
	}
	wh_free(c, b.buf);
	wh_free(c, b.sum);
	return code;
}

/* ---- a block out -------------------------------------------------------------------------- */

/* The order that takes the fewest bits. */
static uint32_t best_order(const uint64_t *number, uint32_t n)
{
	uint32_t lengths[65] = {0}, best = 0;
	uint64_t least = UINT64_MAX;
	for (uint32_t i = 0; i < n; i++)
		lengths[wh_bit_length(number[i])]++;
	for (uint32_t k = 0; k < WH_BITS_ORDERS; k++) {
		uint64_t bits = 0;
		for (uint32_t l = 0; l <= 64; l++) /* any number of that length */
			bits += lengths[l] * (uint64_t)wh_bits_of(l ? 1ULL << (l - 1) : 0, k);
		if (bits >= least)
			continue;
		least = bits;
		best = k;
	}
	return best;
}

static wh_code put_column(wh_ctx *c, wh_pmesh_block *b, uint32_t column)
{
	const uint64_t *number = wh_pmesh_column(b, column);
	const uint32_t k = best_order(number, b->n);
	if (wh_bits_reserve(c, &b->code, 16 + (uint64_t)b->n * WH_BITS_MOST) != WH_OK)
		return c->err.code;
	wh_bits_put(&b->code, k, 8);
	for (uint32_t i = 0; i < b->n; i++)
		wh_bits_put_code(&b->code, number[i], k);
	b->code.n = (b->code.n + 7) / 8 * 8;
	return WH_OK;
}

static uint64_t block_sum(const unsigned char head[PART_HEAD], const uint8_t *body, size_t bytes)
{
	return XXH3_64bits_withSeed(head, PART_SUMMED, XXH3_64bits(body, bytes));
}

static wh_code put_fans(wh_ctx *c, wh_pmesh_block *b)
{
	const size_t bytes = (size_t)((b->fans.n + 7) / 8), at = (size_t)(b->code.n / 8);
	if (wh_bits_reserve(c, &b->code, 8 * (uint64_t)bytes) != WH_OK)
		return c->err.code;
	if (bytes)
		memcpy(b->code.at + at, b->fans.at, bytes);
	b->code.n += 8 * (uint64_t)bytes;
	return WH_OK;
}

wh_code wh_pmesh_write_block(wh_ctx *c, wh_outfile *o, wh_pmesh_block *b, const wh_pmesh_part *part)
{
	unsigned char head[PART_HEAD];
	for (uint32_t k = 0; k < b->columns; k++)
		if (put_column(c, b, k) != WH_OK)
			return c->err.code;
	if (put_fans(c, b) != WH_OK)
		return c->err.code;
	const size_t bytes = (size_t)(b->code.n / 8);
	unsigned char *to = wh_put32(wh_put32(head, (uint32_t)bytes), b->n);
	to = put_float(put_float(put64(to, part->faces), part->error), part->cost);
	(void)put64(to, block_sum(head, b->code.at, bytes));
	if (wh_outfile_write(c, o, head, sizeof head) != WH_OK ||
	    wh_outfile_write(c, o, b->code.at, bytes) != WH_OK)
		return c->err.code;
	wh_bits_clear(&b->code);
	wh_bits_clear(&b->fans);
	b->n = 0;
	return WH_OK;
}

/* ---- the header in ------------------------------------------------------------------------ */

static wh_code bad(wh_ctx *c, const wh_pmesh *p, const char *what)
{
	return wh_fail(c, WH_E_INPUT, "'%s': %s; make it again with whittle progressive",
	               p->ply.path, what);
}

static uint64_t get64(const unsigned char *at)
{
	return wh_load64(at, WH_HOST_BIG);
}

static uint32_t get32(const unsigned char *at)
{
	return wh_load32(at, WH_HOST_BIG);
}

/* Properties in PLY's words, each with its type in an output at out[]. */
static wh_code read_properties(wh_ctx *c, wh_pmesh *p, const unsigned char *at, size_t n,
                               uint32_t count, wh_type *out)
{
	const unsigned char *end = at + n;
	char name[UINT8_MAX + 1];
	if (wh_ply_add_element(c, &p->ply, "vertex", p->head.base_vertices) != WH_OK)
		return c->err.code;
	for (uint32_t i = 0; i < count; i++) {
		if (end - at < 3 || end - at - 3 < at[2] || at[0] > WH_F64 || at[1] > WH_F64)
			return bad(c, p, "the description of its properties is damaged");
		memcpy(name, at + 3, at[2]);
		name[at[2]] = '\0';
		out[i] = (wh_type)at[1];
		if (wh_ply_add_property(c, &p->ply, name, (wh_type)at[0], false) != WH_OK)
			return c->err.code;
		at += 3 + at[2];
	}
	wh_ply_find_meaning(&p->ply);
	return p->ply.vertex == 0 ? WH_OK : bad(c, p, "it has no x, y and z");
}

static wh_code take_description(wh_ctx *c, wh_pmesh *p, const unsigned char *at, size_t n,
                                uint32_t count)
{
	wh_type out[WH_MOST_ATTRIBUTES + 3];
	wh_attributes *a = &p->attributes;
	const wh_wanted all = {NULL, WH_HOLDS_ALL};
	if (read_properties(c, p, at, n, count, out) != WH_OK ||
	    wh_attributes_choose(c, &p->ply, all, a) != WH_OK)
		return c->err.code;
	a->file_bytes = 0;
	for (uint32_t i = 0; i < a->n; i++) {
		a->item[i].out = out[a->item[i].prop];
		a->file_bytes += wh_type_size(a->item[i].out);
	}
	return WH_OK;
}

/* Counts that the file's size can hold: a split takes a bit a column at least. */
static bool is_possible(const wh_pmesh *p)
{
	const wh_pmesh_head *h = &p->head;
	const uint64_t size = p->ply.size, vertex = 3 * (uint64_t)h->coord_bytes;
	return h->base_vertices <= size / vertex && h->base_faces <= size / 12 &&
	       h->splits <= size && h->faces <= h->base_faces + 2 * h->splits &&
	       h->base_vertices + h->splits < UINT32_MAX && h->faces < UINT32_MAX / 3;
}

static wh_code take_header(wh_ctx *c, wh_pmesh *p, const unsigned char *at)
{
	wh_pmesh_head *h = &p->head;
	h->coord_bytes = get32(at + 12);
	h->base_vertices = get64(at + 24);
	h->base_faces = get64(at + 32);
	h->splits = get64(at + 40);
	h->faces = get64(at + 48);
	h->input_bytes = get64(at + 56);
	h->error = wh_loadf(at + 64, WH_HOST_BIG);
	h->cost = wh_loadf(at + 68, WH_HOST_BIG);
	h->diagonal = wh_loadd(at + 72, WH_HOST_BIG);
	if (memcmp(at, MAGIC, sizeof MAGIC) != 0)
		return wh_fail(c, WH_E_INPUT,
		               "'%s' is no record of whittle progressive (a .pmesh file)",
		               p->ply.path);
	if (get32(at + 8) != VERSION)
		return wh_fail(c, WH_E_INPUT,
		               "'%s' is of version %" PRIu32
		               " of the format; this program reads version %d",
		               p->ply.path, get32(at + 8), (int)VERSION);
	if ((h->coord_bytes != 4 && h->coord_bytes != 8) || !is_possible(p))
		return bad(c, p, "its header holds counts that the file cannot");
	return WH_OK;
}

static wh_code read_header(wh_ctx *c, wh_pmesh *p)
{
	unsigned char fixed[FIXED];
	if (p->ply.size < FIXED)
		return wh_fail(c, WH_E_INPUT,
		               "'%s' is no record of whittle progressive (a .pmesh file): it has "
		               "%" PRIu64 " bytes",
		               p->ply.path, p->ply.size);
	if (wh_ply_pread(c, p->ply.path, p->ply.fd, fixed, FIXED, 0) != WH_OK ||
	    take_header(c, p, fixed) != WH_OK)
		return c->err.code;
	const uint32_t count = get32(fixed + 16), n = get32(fixed + 20);
	if (count < 3 || count > WH_MOST_ATTRIBUTES + 3 || n > DESCRIPTION_MOST)
		return bad(c, p, "its header is damaged");
	unsigned char *text = wh_alloc(c, n, 1);
	wh_code code =
	    text ? wh_ply_pread(c, p->ply.path, p->ply.fd, text, n, FIXED) : wh_failed(c);
	if (code == WH_OK &&
	    XXH3_64bits_withSeed(fixed, SUMMED, XXH3_64bits(text, n)) != get64(fixed + SUMMED))
		code = bad(c, p, "its header is damaged");
	if (code == WH_OK)
		code = take_description(c, p, text, n, count);
	wh_free(c, text);
	p->base = FIXED + (uint64_t)n;
	return code;
}

/* ---- where the blocks are ----------------------------------------------------------------- */

static uint64_t base_bytes(const wh_pmesh *p)
{
	const wh_pmesh_head *h = &p->head;
	return h->base_vertices * (3 * (uint64_t)h->coord_bytes + p->attributes.bytes) +
	       12 * h->base_faces;
}

/* Splits of block i. */
static uint64_t splits_of(const wh_pmesh *p, uint64_t i)
{
	const uint64_t left = p->head.splits - i * WH_PMESH_BLOCK;
	return left < WH_PMESH_BLOCK ? left : WH_PMESH_BLOCK;
}

wh_code wh_pmesh_damaged(wh_ctx *c, const wh_pmesh *p, uint64_t i, const char *what)
{
	return wh_fail(c, WH_E_INPUT,
	               "'%s': block %" PRIu64 " of %" PRIu64 ", at byte %" PRIu64
	               ", is damaged: %s; make the file again with whittle progressive",
	               p->ply.path, i + 1, p->parts, p->part[i].at, what);
}

static wh_code read_part(wh_ctx *c, wh_pmesh *p, uint64_t i, uint64_t at)
{
	unsigned char head[PART_HEAD];
	wh_pmesh_part *part = &p->part[i];
	part->at = at;
	if (wh_ply_pread(c, p->ply.path, p->ply.fd, head, PART_HEAD, at) != WH_OK)
		return c->err.code;
	part->bytes = get32(head);
	part->splits = get32(head + 4);
	part->faces = get64(head + 8);
	part->error = wh_loadf(head + 16, WH_HOST_BIG);
	part->cost = wh_loadf(head + 20, WH_HOST_BIG);
	const uint64_t before = i ? p->part[i - 1].faces : p->head.base_faces;
	if (part->splits != splits_of(p, i) || part->faces < before ||
	    part->faces > before + 2 * (uint64_t)part->splits)
		return wh_pmesh_damaged(c, p, i, "its counts are not those of the header");
	if (part->bytes > p->ply.size - at - PART_HEAD)
		return wh_pmesh_damaged(c, p, i, "the file ends inside it");
	return WH_OK;
}

/* Heads of all blocks, which tell where the next one is. */
static wh_code find_parts(wh_ctx *c, wh_pmesh *p)
{
	const uint64_t base = base_bytes(p) + 8;
	if (base > p->ply.size - p->base)
		return bad(c, p, "it ends inside the base mesh");
	uint64_t at = p->base + base;
	p->parts = (p->head.splits + WH_PMESH_BLOCK - 1) / WH_PMESH_BLOCK;
	if (p->parts > (p->ply.size - at) / PART_HEAD)
		return bad(c, p, "it ends before its last block");
	p->part = wh_calloc(c, (size_t)p->parts, sizeof *p->part);
	if (!p->part)
		return wh_failed(c);
	for (uint64_t i = 0; i < p->parts; i++) {
		if (wh_poll_at(c, i) != WH_OK || read_part(c, p, i, at) != WH_OK)
			return c->err.code;
		at += PART_HEAD + p->part[i].bytes;
	}
	if (p->parts && p->part[p->parts - 1].faces != p->head.faces)
		return wh_pmesh_damaged(c, p, p->parts - 1, "its faces are not all");
	return at == p->ply.size ? WH_OK : bad(c, p, "there is something behind its last block");
}

wh_code wh_pmesh_open(wh_ctx *c, wh_pmesh *p, const char *path)
{
	*p = (wh_pmesh){0};
	if (wh_ply_attach(c, &p->ply, path) != WH_OK || read_header(c, p) != WH_OK)
		return c->err.code;
	return find_parts(c, p);
}

void wh_pmesh_close(wh_ctx *c, wh_pmesh *p)
{
	wh_attributes_free(c, &p->attributes);
	wh_free(c, p->part);
	if (p->ply.path)
		wh_ply_close(c, &p->ply);
	*p = (wh_pmesh){0};
}

/* ---- the base in -------------------------------------------------------------------------- */

typedef struct base_in {
	wh_ctx *c;
	const wh_pmesh *p;
	uint8_t *buf;
	uint64_t at; /* of what is next in the file */
	XXH3_state_t *sum;
} base_in;

/* The next n <= CHUNK bytes. */
static wh_code next(base_in *b, size_t n)
{
	if (wh_poll(b->c) != WH_OK ||
	    wh_ply_pread(b->c, b->p->ply.path, b->p->ply.fd, b->buf, n, b->at) != WH_OK)
		return b->c->err.code;
	(void)XXH3_64bits_update(b->sum, b->buf, n);
	b->at += n;
	return WH_OK;
}

static wh_code get_positions(base_in *b, double *xyz)
{
	const uint32_t bytes = b->p->head.coord_bytes;
	const uint64_t all = 3 * b->p->head.base_vertices;
	for (uint64_t i = 0; i < all; i += CHUNK_VERTICES) {
		const uint64_t n = all - i < CHUNK_VERTICES ? all - i : CHUNK_VERTICES;
		if (next(b, (size_t)n * bytes) != WH_OK)
			return b->c->err.code;
		for (uint64_t k = 0; k < n; k++) {
			const uint8_t *at = b->buf + k * bytes;
			xyz[i + k] = bytes == 8 ? wh_loadd(at, WH_HOST_BIG)
			                        : (double)wh_loadf(at, WH_HOST_BIG);
		}
	}
	return WH_OK;
}

static void get_record(const wh_attributes *a, const uint8_t *from, uint8_t *record)
{
	for (uint32_t k = 0; k < a->n; k++) {
		const uint32_t bytes = wh_attribute_bytes(&a->item[k]);
		uint64_t v = 0;
		for (uint32_t i = 0; i < bytes; i++)
			v |= (uint64_t)*from++ << 8 * i;
		store_whole(record + a->item[k].at, bytes, v);
	}
}

static wh_code get_records(base_in *b, uint8_t *attr)
{
	const wh_attributes *a = &b->p->attributes;
	const uint64_t all = b->p->head.base_vertices;
	const uint64_t most = a->bytes ? CHUNK / a->bytes : 0;
	for (uint64_t i = 0; a->bytes && i < all; i += most) {
		const uint64_t n = all - i < most ? all - i : most;
		if (next(b, (size_t)n * a->bytes) != WH_OK)
			return b->c->err.code;
		for (uint64_t k = 0; k < n; k++)
			get_record(a, b->buf + k * a->bytes, attr + (i + k) * a->bytes);
	}
	return WH_OK;
}

static wh_code get_corners(base_in *b, uint32_t *tri)
{
	const uint64_t all = 3 * b->p->head.base_faces;
	for (uint64_t i = 0; i < all; i += CHUNK / 4) {
		const uint64_t n = all - i < CHUNK / 4 ? all - i : CHUNK / 4;
		if (next(b, (size_t)n * 4) != WH_OK)
			return b->c->err.code;
		for (uint64_t k = 0; k < n; k++) {
			tri[i + k] = get32(b->buf + 4 * k);
			if (tri[i + k] >= b->p->head.base_vertices)
				return bad(b->c, b->p, "a face of the base has no such vertex");
		}
	}
	return WH_OK;
}

static wh_code get_base(base_in *b, double *xyz, uint8_t *attr, uint32_t *tri)
{
	if (get_positions(b, xyz) != WH_OK || get_records(b, attr) != WH_OK ||
	    get_corners(b, tri) != WH_OK)
		return b->c->err.code;
	const uint64_t sum = XXH3_64bits_digest(b->sum);
	if (wh_ply_pread(b->c, b->p->ply.path, b->p->ply.fd, b->buf, 8, b->at) != WH_OK)
		return b->c->err.code;
	return sum == get64(b->buf)
	           ? WH_OK
	           : bad(b->c, b->p, "its base mesh is damaged (the checksum is another)");
}

wh_code wh_pmesh_read_base(wh_ctx *c, const wh_pmesh *p, double *xyz, uint8_t *attr, uint32_t *tri)
{
	base_in b = {.c = c,
	             .p = p,
	             .at = p->base,
	             .buf = wh_alloc(c, CHUNK, 1),
	             .sum = wh_alloc(c, 1, sizeof *b.sum)};
	wh_code code = b.buf && b.sum ? WH_OK : wh_failed(c);
	if (code == WH_OK) {
		(void)XXH3_64bits_reset(b.sum);
		code = get_base(&b, xyz, attr, tri);
	}
	wh_free(c, b.buf);
	wh_free(c, b.sum);
	return code;
}

/* ---- a block in --------------------------------------------------------------------------- */

static wh_code get_column(wh_ctx *c, const wh_pmesh *p, uint64_t i, wh_pmesh_block *b,
                          uint32_t column)
{
	wh_bits_in *in = &b->fan;
	uint64_t *number = wh_pmesh_column(b, column);
	const uint32_t k = in->n < in->end ? (uint32_t)wh_bits_get(in, 8) : WH_BITS_ORDERS;
	if (k >= WH_BITS_ORDERS)
		return wh_pmesh_damaged(c, p, i, "a column is missing");
	for (uint32_t s = 0; s < b->n && in->n <= in->end; s++)
		number[s] = wh_bits_get_code(in, k);
	in->n = (in->n + 7) / 8 * 8;
	return in->n <= in->end ? WH_OK : wh_pmesh_damaged(c, p, i, "it ends inside a column");
}

wh_code wh_pmesh_read_block(wh_ctx *c, const wh_pmesh *p, uint64_t i, wh_pmesh_block *b)
{
	const wh_pmesh_part *part = &p->part[i];
	const size_t bytes = PART_HEAD + (size_t)part->bytes;
	if (wh_reserve(c, &b->raw, &b->raw_cap, bytes + WH_BITS_PAD, 1) != WH_OK ||
	    wh_ply_pread(c, p->ply.path, p->ply.fd, b->raw, bytes, part->at) != WH_OK)
		return c->err.code;
	memset(b->raw + bytes, 0, WH_BITS_PAD);
	if (block_sum(b->raw, b->raw + PART_HEAD, part->bytes) != get64(b->raw + PART_SUMMED))
		return wh_pmesh_damaged(c, p, i, "its checksum is another");
	b->n = part->splits;
	b->fan = (wh_bits_in){.at = b->raw + PART_HEAD, .end = 8 * (uint64_t)part->bytes};
	for (uint32_t k = 0; k < b->columns; k++)
		if (get_column(c, p, i, b, k) != WH_OK)
			return c->err.code;
	return WH_OK;
}
