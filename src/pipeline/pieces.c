#include "pipeline/pieces.h"

#include <stdio.h>
#include <sys/stat.h>
#include <unistd.h>

#define XXH_STATIC_LINKING_ONLY /* the size of its state */
#include <xxhash.h>

enum {
	VERSION = 1,
	COPY = 1 << 20, /* bytes */
	BATCH = 4096,   /* ids */
	NOTE_MOST = 1024
};
static const char MAGIC[8] = {'W', 'H', 'P', 'I', 'E', 'C', 'E', 'S'};

typedef struct piece {
	uint64_t at, faces, vertices, checksum;
} piece;

_Static_assert(sizeof(wh_pieces_head) == 56, "the head has the documented size");

static void file_name(const wh_store *s, uint32_t part, char name[WH_SPILL_NAME])
{
	(void)snprintf(name, WH_SPILL_NAME, "round%u-part%05u-%05u", s->generation, part + 1,
	               s->parts);
}

static wh_code damaged(wh_ctx *c, const wh_store *s, const char *name)
{
	return wh_fail(c, WH_E_RUN,
	               "%s/%s: the temporary file is damaged; reduce with --resume finds out what "
	               "can be used, and goes on from there",
	               s->spill->dir, name);
}

/* ---- writing ------------------------------------------------------------------------------ */

typedef struct packing {
	const wh_store *from, *to;
	int fd;
	uint8_t *buf;
	piece *table;
	uint64_t end; /* of the file so far */
} packing;

/* Appends n bytes of another file. */
static wh_code copy(wh_ctx *c, packing *p, int from, uint64_t at, uint64_t n)
{
	while (n > 0) {
		const size_t some = n < COPY ? (size_t)n : COPY;
		if (wh_poll(c) != WH_OK ||
		    wh_spill_pread(c, p->from->spill, from, p->buf, some, at) != WH_OK ||
		    wh_spill_pwrite(c, p->to->spill, p->fd, p->buf, some, p->end) != WH_OK)
			return c->err.code;
		at += some;
		n -= some;
		p->end += some;
	}
	return WH_OK;
}

/* One cluster, which needs its own file no more. */
static wh_code pack_cluster(wh_ctx *c, packing *p, uint32_t k)
{
	piece *to = &p->table[k];
	uint64_t body;
	int fd;
	*to = (piece){.at = p->end};
	if (wh_store_counts(c, p->from, k, &to->faces, &to->vertices) != WH_OK ||
	    wh_store_checksum(c, p->from, k, &to->checksum) != WH_OK ||
	    wh_store_open_body(c, p->from, k, &fd, &body) != WH_OK)
		return c->err.code;
	const wh_code code = copy(c, p, fd, body,
	                          to->faces * wh_store_face_bytes(p->from) +
	                              to->vertices * wh_store_vertex_bytes(p->from));
	(void)close(fd);
	wh_store_remove(p->from, k);
	return code;
}

/* Pieces and ids, and then what comes before them. */
static wh_code pack_all(wh_ctx *c, packing *p, wh_pieces_head *h, int ids_fd, const void *note)
{
	const size_t table_bytes = h->clusters * sizeof *p->table;
	const size_t note_at = sizeof *h, table_at = note_at + h->note_bytes;
	p->end = table_at + table_bytes;
	for (uint32_t k = 0; p->from && k < h->clusters; k++)
		if (pack_cluster(c, p, k) != WH_OK)
			return c->err.code;
	h->ids_at = p->end;
	h->checksum = XXH3_64bits_withSeed(p->table, table_bytes, XXH3_64bits(note, h->note_bytes));
	if ((p->from && copy(c, p, ids_fd, 0, h->ids * sizeof(uint64_t)) != WH_OK) ||
	    wh_spill_pwrite(c, p->to->spill, p->fd, h, sizeof *h, 0) != WH_OK ||
	    wh_spill_pwrite(c, p->to->spill, p->fd, note, h->note_bytes, note_at) != WH_OK)
		return c->err.code;
	return wh_spill_pwrite(c, p->to->spill, p->fd, p->table, table_bytes, table_at);
}

wh_code wh_pieces_pack(wh_ctx *c, const wh_store *from, const wh_store *to, uint32_t part,
                       int ids_fd, uint64_t ids, const void *note, uint32_t note_bytes)
{
	char name[WH_SPILL_NAME], half[WH_SPILL_NAME];
	packing p = {.from = from, .to = to, .fd = -1};
	wh_pieces_head h = {.version = VERSION,
	                    .part = part,
	                    .parts = to->parts,
	                    .clusters = to->clusters,
	                    .note_bytes = note_bytes,
	                    .ids = ids};
	memcpy(h.magic, MAGIC, sizeof MAGIC);
	file_name(to, part, name);
	p.buf = wh_alloc(c, COPY, 1);
	p.table = wh_calloc(c, to->clusters, sizeof *p.table);
	if (p.buf && p.table)
		p.fd = wh_spill_create(c, to->spill, wh_spill_part(to->spill, name, half));
	wh_code code = p.fd >= 0 ? pack_all(c, &p, &h, ids_fd, note) : wh_failed(c);
	if (p.fd >= 0 && close(p.fd) != 0 && code == WH_OK)
		code = wh_fail_errno(c, "%s/%s: cannot write", to->spill->dir, half);
	wh_free(c, p.table);
	wh_free(c, p.buf);
	return code == WH_OK ? wh_spill_rename(c, to->spill, half, name) : code;
}

/* ---- reading ------------------------------------------------------------------------------ */

/* Opens the file of a part. Descriptor, or -1 with the failure recorded. */
static int open_part(wh_ctx *c, const wh_store *s, uint32_t part, wh_pieces_head *h)
{
	char name[WH_SPILL_NAME];
	struct stat st;
	*h = (wh_pieces_head){0};
	file_name(s, part, name);
	const int fd = wh_spill_read(c, s->spill, name);
	if (fd < 0)
		return -1;
	wh_code code = fstat(fd, &st) == 0 && (size_t)st.st_size >= sizeof *h
	                   ? wh_spill_pread(c, s->spill, fd, h, sizeof *h, 0)
	                   : damaged(c, s, name);
	/* the counts are those of the store, or they are wrong: nothing is made room for that the
	 * file does not hold */
	if (code == WH_OK &&
	    (memcmp(h->magic, MAGIC, sizeof MAGIC) != 0 || h->version != VERSION ||
	     h->part != part || h->parts != s->parts || h->clusters != s->clusters ||
	     h->note_bytes > NOTE_MOST || h->zero != 0 || h->ids_at > (uint64_t)st.st_size ||
	     h->ids != ((uint64_t)st.st_size - h->ids_at) / sizeof(uint64_t)))
		code = damaged(c, s, name);
	if (code == WH_OK)
		return fd;
	(void)close(fd);
	return -1;
}

/* Does the piece lie between the table and the ids? */
static bool is_inside(const wh_store *s, const wh_pieces_head *h, const piece *p)
{
	const uint64_t room = p->at < h->ids_at ? h->ids_at - p->at : 0;
	const uint64_t face = wh_store_face_bytes(s), vertex = wh_store_vertex_bytes(s);
	return p->faces <= room / face && p->vertices <= (room - p->faces * face) / vertex;
}

/* The pieces of clusters first .. first+n-1. */
static wh_code read_table(wh_ctx *c, const wh_store *s, int fd, const wh_pieces_head *h,
                          uint32_t first, size_t n, piece *to)
{
	if (wh_spill_pread(c, s->spill, fd, to, n * sizeof *to,
	                   sizeof *h + h->note_bytes + first * sizeof *to) != WH_OK)
		return c->err.code;
	for (size_t i = 0; i < n; i++)
		if (!is_inside(s, h, &to[i])) {
			char name[WH_SPILL_NAME];
			file_name(s, h->part, name);
			return damaged(c, s, name);
		}
	return WH_OK;
}

static bool read_note(wh_ctx *c, const wh_store *s, int fd, const wh_pieces_head *h, void *note)
{
	piece *table = wh_alloc(c, h->clusters, sizeof *table);
	const bool ok = table &&
	                wh_spill_pread(c, s->spill, fd, note, h->note_bytes, sizeof *h) == WH_OK &&
	                read_table(c, s, fd, h, 0, h->clusters, table) == WH_OK &&
	                XXH3_64bits_withSeed(table, h->clusters * sizeof *table,
	                                     XXH3_64bits(note, h->note_bytes)) == h->checksum;
	wh_free(c, table);
	return ok;
}

bool wh_pieces_note(wh_ctx *c, const wh_store *s, uint32_t part, void *note, uint32_t note_bytes)
{
	wh_pieces_head h;
	wh_ctx own = wh_ctx_fork(c);
	const int fd = open_part(&own, s, part, &h);
	if (fd < 0)
		return false;
	const bool ok = h.note_bytes == note_bytes && read_note(&own, s, fd, &h, note);
	(void)close(fd);
	return ok;
}

wh_code wh_pieces_counts(wh_ctx *c, const wh_store *s, uint32_t cluster, uint64_t *faces,
                         uint64_t *vertices)
{
	*faces = *vertices = 0;
	for (uint32_t i = 0; i < s->parts; i++) {
		wh_pieces_head h;
		piece one = {0};
		const int fd = open_part(c, s, i, &h);
		if (fd < 0)
			return wh_failed(c);
		const wh_code code = read_table(c, s, fd, &h, cluster, 1, &one);
		(void)close(fd);
		if (code != WH_OK)
			return code;
		*faces += one.faces;
		*vertices += one.vertices;
	}
	return WH_OK;
}

wh_code wh_pieces_all_counts(wh_ctx *c, const wh_store *s, uint64_t *faces, uint64_t *vertices)
{
	piece *table = wh_alloc(c, s->clusters, sizeof *table);
	wh_code code = table ? WH_OK : wh_failed(c);
	memset(faces, 0, s->clusters * sizeof *faces);
	memset(vertices, 0, s->clusters * sizeof *vertices);
	for (uint32_t i = 0; code == WH_OK && i < s->parts; i++) {
		wh_pieces_head h;
		const int fd = open_part(c, s, i, &h);
		code = fd >= 0 ? read_table(c, s, fd, &h, 0, s->clusters, table) : wh_failed(c);
		for (uint32_t k = 0; code == WH_OK && k < s->clusters; k++) {
			faces[k] += table[k].faces;
			vertices[k] += table[k].vertices;
		}
		if (fd >= 0)
			(void)close(fd);
	}
	wh_free(c, table);
	return code;
}

static uint64_t checksum_of(XXH3_state_t *state, const void *faces, size_t nf, const void *vertices,
                            size_t nv)
{
	(void)XXH3_64bits_reset(state);
	(void)XXH3_64bits_update(state, faces, nf);
	(void)XXH3_64bits_update(state, vertices, nv);
	return XXH3_64bits_digest(state);
}

/* One piece into its two places. */
static wh_code read_piece(wh_ctx *c, const wh_store *s, uint32_t part, uint32_t cluster,
                          XXH3_state_t *state, uint8_t **faces, uint8_t **vertices)
{
	wh_pieces_head h;
	piece p = {0};
	const int fd = open_part(c, s, part, &h);
	if (fd < 0)
		return wh_failed(c);
	wh_code code = read_table(c, s, fd, &h, cluster, 1, &p);
	const size_t nf = (size_t)p.faces * wh_store_face_bytes(s);
	const size_t nv = (size_t)p.vertices * wh_store_vertex_bytes(s);
	if (code == WH_OK)
		code = wh_spill_pread(c, s->spill, fd, *faces, nf, p.at);
	if (code == WH_OK)
		code = wh_spill_pread(c, s->spill, fd, *vertices, nv, p.at + nf);
	(void)close(fd);
	if (code == WH_OK && checksum_of(state, *faces, nf, *vertices, nv) != p.checksum) {
		char name[WH_SPILL_NAME];
		file_name(s, part, name);
		code = damaged(c, s, name);
	}
	*faces += nf;
	*vertices += nv;
	return code;
}

wh_code wh_pieces_read(wh_ctx *c, const wh_store *s, uint32_t cluster, wh_store_scratch *scratch,
                       uint64_t *faces, uint64_t *vertices)
{
	if (wh_pieces_counts(c, s, cluster, faces, vertices) != WH_OK)
		return c->err.code;
	if (*faces >= UINT32_MAX / 3 || *vertices >= UINT32_MAX)
		return wh_fail(c, WH_E_RUN, "%s: cluster %u is damaged", s->spill->dir, cluster);
	const size_t nf = (size_t)*faces * wh_store_face_bytes(s);
	const size_t nv = (size_t)*vertices * wh_store_vertex_bytes(s);
	if (wh_renew(c, &scratch->raw, &scratch->raw_cap, nf + nv, 1) != WH_OK)
		return c->err.code;
	uint8_t *f = scratch->raw, *v = scratch->raw + nf;
	XXH3_state_t *state = wh_alloc(c, 1, sizeof *state);
	wh_code code = state ? WH_OK : wh_failed(c);
	for (uint32_t i = 0; code == WH_OK && i < s->parts; i++)
		code = read_piece(c, s, i, cluster, state, &f, &v);
	wh_free(c, state);
	return code;
}

void wh_pieces_remove(const wh_store *s)
{
	for (uint32_t i = 0; i < s->parts; i++) {
		char name[WH_SPILL_NAME];
		file_name(s, i, name);
		wh_spill_remove(s->spill, name);
	}
}

/* ---- ids ---------------------------------------------------------------------------------- */

/* The ids of one part, some at a time. */
typedef struct reader {
	uint64_t next, end; /* in the file, counted in ids */
	uint32_t at, n;     /* of those at hand */
	uint64_t item[BATCH];
} reader;

static wh_code refill(wh_ctx *c, const wh_store *s, uint32_t part, reader *r)
{
	wh_pieces_head h;
	const uint64_t left = r->end - r->next;
	r->at = 0;
	r->n = left < BATCH ? (uint32_t)left : BATCH;
	if (r->n == 0)
		return WH_OK;
	const int fd = open_part(c, s, part, &h);
	if (fd < 0)
		return wh_failed(c);
	const wh_code code = wh_spill_pread(c, s->spill, fd, r->item, r->n * sizeof *r->item,
	                                    h.ids_at + r->next * sizeof *r->item);
	(void)close(fd);
	r->next += r->n;
	return code;
}

/* Goes on to the least id that is greater than the last one; UINT64_MAX: there is none. */
static wh_code next_id(wh_ctx *c, const wh_store *s, reader *r, uint64_t last, bool first,
                       uint64_t *id)
{
	*id = UINT64_MAX;
	for (uint32_t i = 0; i < s->parts; i++) {
		while (r[i].at < r[i].n && !first && r[i].item[r[i].at] <= last)
			if (++r[i].at == r[i].n && refill(c, s, i, &r[i]) != WH_OK)
				return c->err.code;
		if (r[i].at < r[i].n && r[i].item[r[i].at] < *id)
			*id = r[i].item[r[i].at];
	}
	return WH_OK;
}

wh_code wh_pieces_count_ids(wh_ctx *c, const wh_store *s, uint64_t *n)
{
	reader *r = wh_calloc(c, s->parts, sizeof *r);
	wh_code code = r ? WH_OK : wh_failed(c);
	*n = 0;
	for (uint32_t i = 0; code == WH_OK && i < s->parts; i++) {
		wh_pieces_head h;
		const int fd = open_part(c, s, i, &h);
		if (fd >= 0)
			(void)close(fd);
		r[i].end = fd >= 0 ? h.ids : 0;
		code = fd >= 0 ? refill(c, s, i, &r[i]) : wh_failed(c);
	}
	uint64_t id = 0;
	for (bool first = true; code == WH_OK && id != UINT64_MAX; first = false) {
		code = next_id(c, s, r, id, first, &id);
		*n += code == WH_OK && id != UINT64_MAX;
	}
	wh_free(c, r);
	return code;
}
