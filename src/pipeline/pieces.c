#include "pipeline/pieces.h"

#include <stdio.h>
#include <sys/stat.h>
#include <unistd.h>

#define XXH_STATIC_LINKING_ONLY /* the size of its state */
#include <xxhash.h>

enum { VERSION = 2 };
static const char MAGIC[8] = {'W', 'H', 'P', 'I', 'E', 'C', 'E', 'S'};

/* What an extent begins with. */
typedef struct extent {
	uint64_t before, bytes;
} extent;

_Static_assert(sizeof(wh_pieces_head) == 48, "the head has the documented size");
_Static_assert(sizeof(wh_piece) == 32 && sizeof(extent) == 16, "as have lines and extents");

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

wh_code wh_pieces_begin(wh_ctx *c, wh_pieces *p, const wh_store *store, uint32_t part)
{
	char name[WH_SPILL_NAME], half[WH_SPILL_NAME];
	*p = (wh_pieces){
	    .store = store, .part = part, .fd = -1, .end = sizeof(wh_pieces_head) + WH_PIECES_NOTE};
	file_name(store, part, name);
	p->table = wh_calloc(c, (size_t)store->clusters + 1, sizeof *p->table);
	if (p->table)
		p->fd = wh_spill_create(c, store->spill, wh_spill_part(store->spill, name, half));
	return p->fd >= 0 ? WH_OK : wh_failed(c);
}

wh_code wh_pieces_append(wh_ctx *c, wh_pieces *p, uint32_t cluster, const void *bytes, size_t n)
{
	wh_spill *spill = p->store->spill;
	const extent e = {.before = p->table[cluster].last, .bytes = n};
	if (wh_spill_pwrite(c, spill, p->fd, &e, sizeof e, p->end) != WH_OK ||
	    wh_spill_pwrite(c, spill, p->fd, bytes, n, p->end + sizeof e) != WH_OK)
		return c->err.code;
	p->table[cluster].last = p->end;
	p->end += sizeof e + n;
	return WH_OK;
}

void wh_pieces_end(wh_pieces *p, uint32_t cluster, uint64_t faces, uint64_t vertices,
                   uint64_t checksum)
{
	wh_piece *to = &p->table[cluster];
	to->faces = faces;
	to->vertices = vertices;
	to->checksum = checksum;
}

wh_code wh_pieces_add_ids(wh_ctx *c, wh_pieces *p, const uint64_t *id, size_t n)
{
	const uint32_t k = p->store->clusters;
	p->table[k].vertices += n;
	return wh_pieces_append(c, p, k, id, n * sizeof *id);
}

/* The table, and then what comes before it all. */
static wh_code write_ends(wh_ctx *c, const wh_pieces *p, const void *note, uint32_t note_bytes)
{
	const wh_store *s = p->store;
	const size_t table_bytes = ((size_t)s->clusters + 1) * sizeof *p->table;
	wh_pieces_head h = {.version = VERSION,
	                    .part = p->part,
	                    .parts = s->parts,
	                    .clusters = s->clusters,
	                    .note_bytes = note_bytes,
	                    .table_at = p->end};
	memcpy(h.magic, MAGIC, sizeof MAGIC);
	h.checksum = XXH3_64bits_withSeed(p->table, table_bytes, XXH3_64bits(note, note_bytes));
	if (wh_spill_pwrite(c, s->spill, p->fd, p->table, table_bytes, p->end) != WH_OK ||
	    wh_spill_pwrite(c, s->spill, p->fd, note, note_bytes, sizeof h) != WH_OK)
		return c->err.code;
	return wh_spill_pwrite(c, s->spill, p->fd, &h, sizeof h, 0);
}

wh_code wh_pieces_commit(wh_ctx *c, wh_pieces *p, bool empty, const void *note, uint32_t note_bytes)
{
	char name[WH_SPILL_NAME], half[WH_SPILL_NAME];
	const wh_store *s = p->store;
	if (empty)
		memset(p->table, 0, ((size_t)s->clusters + 1) * sizeof *p->table);
	wh_code code = write_ends(c, p, note, note_bytes);
	file_name(s, p->part, name);
	(void)wh_spill_part(s->spill, name, half);
	if (close(p->fd) != 0 && code == WH_OK)
		code = wh_fail_errno(c, "%s/%s: cannot write", s->spill->dir, half);
	p->fd = -1;
	return code == WH_OK ? wh_spill_rename(c, s->spill, half, name) : code;
}

void wh_pieces_drop(wh_ctx *c, wh_pieces *p)
{
	if (p->table && p->fd >= 0)
		(void)close(p->fd);
	wh_free(c, p->table);
	*p = (wh_pieces){.fd = -1};
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
	     h->note_bytes > WH_PIECES_NOTE || h->zero != 0 || h->table_at > (uint64_t)st.st_size ||
	     (uint64_t)st.st_size - h->table_at != ((uint64_t)s->clusters + 1) * sizeof(wh_piece)))
		code = damaged(c, s, name);
	if (code == WH_OK)
		return fd;
	(void)close(fd);
	return -1;
}

/* Does the file hold so much? */
static bool is_sound(const wh_store *s, const wh_pieces_head *h, const wh_piece *p)
{
	const uint64_t face = wh_store_face_bytes(s), vertex = wh_store_vertex_bytes(s);
	return p->last < h->table_at && p->faces <= h->table_at / face &&
	       p->vertices <= h->table_at / vertex &&
	       p->faces * face + p->vertices * vertex <= h->table_at;
}

/* The lines of the table from `first` on. */
static wh_code read_table(wh_ctx *c, const wh_store *s, int fd, const wh_pieces_head *h,
                          uint32_t first, size_t n, wh_piece *to)
{
	if (wh_spill_pread(c, s->spill, fd, to, n * sizeof *to, h->table_at + first * sizeof *to) !=
	    WH_OK)
		return c->err.code;
	for (size_t i = 0; i < n; i++)
		if (first + i < h->clusters && !is_sound(s, h, &to[i])) {
			char name[WH_SPILL_NAME];
			file_name(s, h->part, name);
			return damaged(c, s, name);
		}
	return WH_OK;
}

static bool read_note(wh_ctx *c, const wh_store *s, int fd, const wh_pieces_head *h, void *note)
{
	const size_t lines = (size_t)h->clusters + 1;
	wh_piece *table = wh_alloc(c, lines, sizeof *table);
	const bool ok =
	    table && wh_spill_pread(c, s->spill, fd, note, h->note_bytes, sizeof *h) == WH_OK &&
	    read_table(c, s, fd, h, 0, lines, table) == WH_OK &&
	    XXH3_64bits_withSeed(table, lines * sizeof *table, XXH3_64bits(note, h->note_bytes)) ==
	        h->checksum;
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
		wh_piece one = {0};
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
	wh_piece *table = wh_alloc(c, s->clusters, sizeof *table);
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

/* Bytes `at` and following of a piece, whose first nf lie at `faces` and the others at `vertices`.
 */
static wh_code read_bytes(wh_ctx *c, const wh_store *s, int fd, uint64_t off, uint64_t at,
                          uint64_t n, uint64_t nf, uint8_t *faces, uint8_t *vertices)
{
	const uint64_t first = at >= nf ? 0 : n < nf - at ? n : nf - at;
	if (first > 0 && wh_spill_pread(c, s->spill, fd, faces + at, (size_t)first, off) != WH_OK)
		return c->err.code;
	if (n == first)
		return WH_OK;
	return wh_spill_pread(c, s->spill, fd, vertices + (at + first - nf), (size_t)(n - first),
	                      off + first);
}

/* The extents of a piece, from the last one to the first. */
static wh_code read_extents(wh_ctx *c, const wh_store *s, uint32_t part, int fd, const wh_piece *p,
                            uint64_t nf, uint64_t nv, uint8_t *faces, uint8_t *vertices)
{
	uint64_t left = nf + nv;
	for (uint64_t off = p->last; left > 0;) {
		extent e;
		if (wh_spill_pread(c, s->spill, fd, &e, sizeof e, off) != WH_OK)
			return c->err.code;
		if (e.bytes > left || e.bytes == 0 || e.before >= off) {
			char name[WH_SPILL_NAME];
			file_name(s, part, name);
			return damaged(c, s, name);
		}
		left -= e.bytes;
		if (read_bytes(c, s, fd, off + sizeof e, left, e.bytes, nf, faces, vertices) !=
		    WH_OK)
			return c->err.code;
		off = e.before;
	}
	return WH_OK;
}

/* One piece into its two places. */
static wh_code read_piece(wh_ctx *c, const wh_store *s, uint32_t part, uint32_t cluster,
                          XXH3_state_t *state, uint8_t **faces, uint8_t **vertices)
{
	wh_pieces_head h;
	wh_piece p = {0};
	const int fd = open_part(c, s, part, &h);
	if (fd < 0)
		return wh_failed(c);
	wh_code code = read_table(c, s, fd, &h, cluster, 1, &p);
	const size_t nf = (size_t)p.faces * wh_store_face_bytes(s);
	const size_t nv = (size_t)p.vertices * wh_store_vertex_bytes(s);
	if (code == WH_OK)
		code = read_extents(c, s, part, fd, &p, nf, nv, *faces, *vertices);
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

wh_code wh_pieces_read(wh_ctx *c, const wh_store *s, uint32_t cluster, wh_store_workspace *ws,
                       uint64_t *faces, uint64_t *vertices)
{
	if (wh_pieces_counts(c, s, cluster, faces, vertices) != WH_OK)
		return c->err.code;
	if (*faces > WH_PATCH_MOST_FACES || *vertices > WH_PATCH_MOST_VERTICES)
		return wh_fail(c, WH_E_RUN, "%s: cluster %u is damaged", s->spill->dir, cluster);
	const size_t nf = (size_t)*faces * wh_store_face_bytes(s);
	const size_t nv = (size_t)*vertices * wh_store_vertex_bytes(s);
	if (wh_renew(c, &ws->raw, &ws->raw_cap, nf + nv, 1) != WH_OK)
		return c->err.code;
	uint8_t *f = ws->raw, *v = ws->raw + nf;
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

/* The ids of one part, from the greatest to the least, an extent at a time. */
typedef struct reader {
	uint64_t next;  /* extent; 0: there is none */
	size_t n;       /* ids at hand */
	uint64_t *item; /* WH_PIECES_IDS of them */
} reader;

static wh_code refill(wh_ctx *c, const wh_store *s, uint32_t part, int fd, reader *r)
{
	extent e;
	if (r->next == 0)
		return WH_OK;
	if (wh_spill_pread(c, s->spill, fd, &e, sizeof e, r->next) != WH_OK)
		return c->err.code;
	r->n = (size_t)(e.bytes / sizeof *r->item);
	if (r->n == 0 || r->n > WH_PIECES_IDS || e.before >= r->next) {
		char name[WH_SPILL_NAME];
		file_name(s, part, name);
		return damaged(c, s, name);
	}
	const uint64_t at = r->next + sizeof e;
	r->next = e.before;
	return wh_spill_pread(c, s->spill, fd, r->item, r->n * sizeof *r->item, at);
}

/* Opens the part for as long as it takes. */
static wh_code refill_part(wh_ctx *c, const wh_store *s, uint32_t part, bool first, reader *r)
{
	wh_pieces_head h;
	wh_piece ids = {0};
	const int fd = open_part(c, s, part, &h);
	if (fd < 0)
		return wh_failed(c);
	wh_code code = first ? read_table(c, s, fd, &h, s->clusters, 1, &ids) : WH_OK;
	if (first)
		r->next = ids.last;
	if (code == WH_OK)
		code = refill(c, s, part, fd, r);
	(void)close(fd);
	return code;
}

/* The greatest id at hand. False: there is none. */
static bool greatest_id(const reader *r, uint32_t parts, uint64_t *id)
{
	bool found = false;
	for (uint32_t i = 0; i < parts; i++) {
		if (r[i].n == 0 || (found && r[i].item[r[i].n - 1] <= *id))
			continue;
		*id = r[i].item[r[i].n - 1];
		found = true;
	}
	return found;
}

/* Every reader leaves this id behind. */
static wh_code pass_id(wh_ctx *c, const wh_store *s, reader *r, uint64_t id)
{
	for (uint32_t i = 0; i < s->parts; i++) {
		if (r[i].n == 0 || r[i].item[r[i].n - 1] != id)
			continue;
		if (--r[i].n == 0 && r[i].next > 0 && refill_part(c, s, i, false, &r[i]) != WH_OK)
			return c->err.code;
	}
	return WH_OK;
}

static wh_code count_ids(wh_ctx *c, const wh_store *s, reader *r, uint64_t *n)
{
	uint64_t id = 0;
	for (uint32_t i = 0; i < s->parts; i++)
		if (refill_part(c, s, i, true, &r[i]) != WH_OK)
			return c->err.code;
	for (*n = 0; greatest_id(r, s->parts, &id); ++*n)
		if (pass_id(c, s, r, id) != WH_OK)
			return c->err.code;
	return WH_OK;
}

wh_code wh_pieces_count_ids(wh_ctx *c, const wh_store *s, uint64_t *n)
{
	reader *r = wh_calloc(c, s->parts, sizeof *r);
	uint64_t *room = wh_alloc(c, (size_t)s->parts * WH_PIECES_IDS, sizeof *room);
	for (uint32_t i = 0; r && room && i < s->parts; i++)
		r[i].item = room + (size_t)i * WH_PIECES_IDS;
	const wh_code code = r && room ? count_ids(c, s, r, n) : wh_failed(c);
	wh_free(c, room);
	wh_free(c, r);
	return code;
}
