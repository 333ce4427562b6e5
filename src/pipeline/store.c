#include "pipeline/store.h"

#include "base/sort.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#define XXH_STATIC_LINKING_ONLY /* the size of its state */
#include <xxhash.h>

enum { VERSION = 2, NAME_BYTES = 64 };
static const char MAGIC[8] = {'W', 'H', 'C', 'L', 'U', 'S', 'T', '1'};

typedef struct header {
	char magic[8];
	uint32_t version, id_bytes, coord_bytes, vertex_payload, corner_payload, local_corners;
	uint64_t faces, vertices, checksum, zero;
} header;

_Static_assert(sizeof(header) == 64, "the header has the documented size");

/* The top two bits of a stored id hold flags. */
enum { ID_BITS32 = 30, ID_BITS64 = 62 };

static void file_name(const wh_store *s, uint32_t cluster, bool part, char name[NAME_BYTES])
{
	(void)snprintf(name, NAME_BYTES, "round%u-%06u%s", s->generation, cluster,
	               part ? ".part" : "");
}

/* ---- writing ------------------------------------------------------------------------------ */

wh_code wh_store_begin(wh_ctx *c, const wh_store *s, uint32_t cluster, wh_store_writer *w,
                       size_t buffer)
{
	char name[NAME_BYTES];
	file_name(s, cluster, true, name);
	*w = (wh_store_writer){.off = sizeof(header), .cap = buffer};
	w->buf = wh_alloc(c, buffer, 1);
	w->hash = wh_alloc(c, 1, sizeof(XXH3_state_t));
	const int fd = w->buf && w->hash ? wh_spill_create(c, s->spill, name) : -1;
	if (fd < 0) {
		wh_store_drop(c, w);
		return wh_failed(c);
	}
	(void)close(fd);
	(void)XXH3_64bits_reset(w->hash);
	return WH_OK;
}

/* Files are opened for each write: there may be more of them than descriptors. */
static wh_code write_at(wh_ctx *c, const wh_store *s, uint32_t cluster, const void *bytes, size_t n,
                        uint64_t off)
{
	char name[NAME_BYTES];
	file_name(s, cluster, true, name);
	const int fd = wh_spill_reopen(c, s->spill, name);
	if (fd < 0)
		return c->err.code;
	wh_code code = wh_spill_pwrite(c, s->spill, fd, bytes, n, off);
	if (close(fd) != 0 && code == WH_OK)
		code = wh_fail_errno(c, "%s/%s: cannot write", s->spill->dir, name);
	return code;
}

static wh_code flush(wh_ctx *c, const wh_store *s, uint32_t cluster, wh_store_writer *w)
{
	if (w->used == 0)
		return WH_OK;
	(void)XXH3_64bits_update(w->hash, w->buf, w->used);
	if (write_at(c, s, cluster, w->buf, w->used, w->off) != WH_OK)
		return c->err.code;
	w->off += w->used;
	w->used = 0;
	return WH_OK;
}

wh_code wh_store_append(wh_ctx *c, const wh_store *s, uint32_t cluster, wh_store_writer *w,
                        const void *bytes, size_t n)
{
	const uint8_t *from = bytes;
	while (n > 0) {
		const size_t room = w->cap - w->used;
		const size_t take = n < room ? n : room;
		memcpy(w->buf + w->used, from, take);
		w->used += take;
		from += take;
		n -= take;
		if (w->used == w->cap && flush(c, s, cluster, w) != WH_OK)
			return c->err.code;
	}
	return WH_OK;
}

wh_code wh_store_commit(wh_ctx *c, const wh_store *s, uint32_t cluster, wh_store_writer *w)
{
	wh_code code = flush(c, s, cluster, w);
	if (code == WH_OK) {
		header h = {.version = VERSION,
		            .id_bytes = s->id_bytes,
		            .coord_bytes = s->coord_bytes,
		            .vertex_payload = s->vertex_payload,
		            .local_corners = s->local_corners,
		            .faces = w->faces,
		            .vertices = w->vertices,
		            .checksum = XXH3_64bits_digest(w->hash)};
		memcpy(h.magic, MAGIC, sizeof MAGIC);
		code = write_at(c, s, cluster, &h, sizeof h, 0);
	}
	if (code == WH_OK) {
		char part[NAME_BYTES], whole[NAME_BYTES];
		file_name(s, cluster, true, part);
		file_name(s, cluster, false, whole);
		code = wh_spill_rename(c, s->spill, part, whole);
	}
	wh_store_drop(c, w);
	return code;
}

void wh_store_drop(wh_ctx *c, wh_store_writer *w)
{
	wh_free(c, w->buf);
	wh_free(c, w->hash);
	w->buf = NULL;
	w->hash = NULL;
}

uint8_t *wh_store_put_face(const wh_store *s, uint8_t *at, const uint64_t gid[3])
{
	if (s->id_bytes == 4) {
		const uint32_t narrow[3] = {(uint32_t)gid[0], (uint32_t)gid[1], (uint32_t)gid[2]};
		memcpy(at, narrow, sizeof narrow);
		return at + sizeof narrow;
	}
	memcpy(at, gid, 3 * sizeof *gid);
	return at + 3 * sizeof *gid;
}

uint8_t *wh_store_put_vertex(const wh_store *s, uint8_t *at, uint64_t gid, uint8_t flag,
                             wh_vec3 pos, float err)
{
	const unsigned bits = (flag & WH_CUT ? 2U : 0U) | (flag & WH_NEVER ? 1U : 0U);
	if (s->id_bytes == 4) {
		const uint32_t id = (uint32_t)gid | bits << ID_BITS32;
		memcpy(at, &id, 4);
	} else {
		const uint64_t id = gid | (uint64_t)bits << ID_BITS64;
		memcpy(at, &id, 8);
	}
	at += s->id_bytes;
	if (s->coord_bytes == 4) {
		const float xyz[3] = {(float)pos.x, (float)pos.y, (float)pos.z};
		memcpy(at, xyz, sizeof xyz);
	} else {
		memcpy(at, &pos, sizeof pos);
	}
	at += 3 * (size_t)s->coord_bytes;
	if (s->vertex_payload)
		memcpy(at, &err, 4);
	return at + s->vertex_payload;
}

static wh_code save_vertices(wh_ctx *c, const wh_store *s, uint32_t cluster, wh_store_writer *w,
                             const wh_patch *p)
{
	uint8_t record[64];
	for (uint32_t v = 0; v < p->nv; v++) {
		const uint8_t *end =
		    wh_store_put_vertex(s, record, p->gid[v], p->flag[v], p->pos[v], p->err[v]);
		if (wh_store_append(c, s, cluster, w, record, (size_t)(end - record)) != WH_OK)
			return c->err.code;
	}
	w->vertices = p->nv;
	return WH_OK;
}

wh_code wh_store_save(wh_ctx *c, const wh_store *s, uint32_t cluster, const wh_patch *p)
{
	wh_store_writer w;
	if (wh_store_begin(c, s, cluster, &w, (size_t)1 << 20) != WH_OK)
		return c->err.code;
	w.faces = p->nf;
	if (wh_store_append(c, s, cluster, &w, p->tri, 3 * sizeof *p->tri * p->nf) != WH_OK ||
	    save_vertices(c, s, cluster, &w, p) != WH_OK) {
		wh_store_drop(c, &w);
		return c->err.code;
	}
	return wh_store_commit(c, s, cluster, &w);
}

/* ---- loading ------------------------------------------------------------------------------ */

void wh_store_scratch_free(wh_ctx *c, wh_store_scratch *s)
{
	wh_free(c, s->raw);
	wh_free(c, s->order);
	wh_free(c, s->index);
	*s = (wh_store_scratch){0};
}

static wh_code damaged(wh_ctx *c, const wh_store *s, const char *name)
{
	return wh_fail(c, WH_E_RUN,
	               "%s/%s: the temporary file is damaged; run again, on another disk if it "
	               "happens again (--temp-dir)",
	               s->spill->dir, name);
}

static wh_code read_header(wh_ctx *c, const wh_store *s, int fd, const char *name, header *h)
{
	if (wh_spill_pread(c, s->spill, fd, h, sizeof *h, 0) != WH_OK)
		return c->err.code;
	if (memcmp(h->magic, MAGIC, sizeof MAGIC) != 0 || h->version != VERSION ||
	    h->id_bytes != s->id_bytes || h->coord_bytes != s->coord_bytes ||
	    h->vertex_payload != s->vertex_payload || h->corner_payload != 0 ||
	    h->local_corners != s->local_corners || h->zero != 0 || h->faces >= UINT32_MAX / 3 ||
	    h->vertices >= UINT32_MAX)
		return damaged(c, s, name);
	return WH_OK;
}

static wh_code read_whole(wh_ctx *c, const wh_store *s, uint32_t cluster, wh_store_scratch *sc,
                          header *h)
{
	char name[NAME_BYTES];
	file_name(s, cluster, false, name);
	const int fd = wh_spill_read(c, s->spill, name);
	if (fd < 0)
		return wh_failed(c);
	wh_code code = read_header(c, s, fd, name, h);
	if (code == WH_OK) {
		const size_t n = (size_t)h->faces * wh_store_face_bytes(s) +
		                 (size_t)h->vertices * wh_store_vertex_bytes(s);
		struct stat st; /* no memory for counts that the file does not hold */
		if (fstat(fd, &st) != 0 || (uint64_t)st.st_size != sizeof *h + n)
			code = damaged(c, s, name);
		if (code == WH_OK)
			code = wh_renew(c, &sc->raw, &sc->raw_cap, n, 1);
		if (code == WH_OK)
			code = wh_spill_pread(c, s->spill, fd, sc->raw, n, sizeof *h);
		if (code == WH_OK && XXH3_64bits(sc->raw, n) != h->checksum)
			code = damaged(c, s, name);
	}
	(void)close(fd);
	return code;
}

static uint64_t record_gid(const wh_store *s, const uint8_t *at, uint8_t *flag)
{
	uint64_t id;
	unsigned bits;
	if (s->id_bytes == 4) {
		uint32_t narrow;
		memcpy(&narrow, at, 4);
		bits = narrow >> ID_BITS32;
		id = narrow & (((uint32_t)1 << ID_BITS32) - 1);
	} else {
		memcpy(&id, at, 8);
		bits = (unsigned)(id >> ID_BITS64);
		id &= ((uint64_t)1 << ID_BITS64) - 1;
	}
	*flag = (uint8_t)((bits & 2 ? WH_CUT : 0) | (bits & 1 ? WH_NEVER : 0));
	return id;
}

static void decode_vertex(const wh_store *s, const uint8_t *at, wh_patch *p, uint32_t v)
{
	p->gid[v] = record_gid(s, at, &p->flag[v]);
	at += s->id_bytes;
	if (s->coord_bytes == 4) {
		float xyz[3];
		memcpy(xyz, at, sizeof xyz);
		p->pos[v] = wh_v3((double)xyz[0], (double)xyz[1], (double)xyz[2]);
	} else {
		memcpy(&p->pos[v], at, sizeof p->pos[v]);
	}
	at += 3 * (size_t)s->coord_bytes;
	p->err[v] = 0;
	if (s->vertex_payload)
		memcpy(&p->err[v], at, 4);
}

/* Bits that a number takes. */
static uint32_t width(uint64_t x)
{
	uint32_t bits = 0;
	for (; x; x >>= 1)
		bits++;
	return bits;
}

/* One number a record, whose order is that of the ids, and of the records where ids are the same:
 * an id less the least one, then the record's place. False when both do not fit in 64 bits, which
 * no mesh comes near. */
static bool make_order(const wh_store *s, const uint8_t *records, uint32_t n, uint64_t *order,
                       uint32_t *place_bits)
{
	const size_t size = wh_store_vertex_bytes(s);
	uint64_t least = UINT64_MAX, most = 0;
	uint8_t flag;
	for (uint32_t i = 0; i < n; i++) {
		order[i] = record_gid(s, records + i * size, &flag);
		least = order[i] < least ? order[i] : least;
		most = order[i] > most ? order[i] : most;
	}
	*place_bits = width(n);
	if (width(most - least) + *place_bits > 64)
		return false;
	for (uint32_t i = 0; i < n; i++)
		order[i] = (order[i] - least) << *place_bits | i;
	return true;
}

/* Decodes records in any order, with repeats, ascending by id and each once. */
static wh_code decode_sorted(wh_ctx *c, const wh_store *s, const uint8_t *records, uint32_t n,
                             wh_store_scratch *sc, wh_patch *p, bool *ok)
{
	const size_t size = wh_store_vertex_bytes(s);
	uint32_t place_bits, nv = 0;
	if (wh_renew(c, &sc->order, &sc->order_cap, n, sizeof *sc->order) != WH_OK)
		return c->err.code;
	*ok = make_order(s, records, n, sc->order, &place_bits);
	if (!*ok)
		return WH_OK;
	wh_sort(sc->order, n);
	for (uint32_t i = 0; i < n; i++) {
		const size_t at = sc->order[i] & (((uint64_t)1 << place_bits) - 1);
		decode_vertex(s, records + at * size, p, nv);
		if (nv > 0 && p->gid[nv] == p->gid[nv - 1])
			p->err[nv - 1] = fmaxf(p->err[nv - 1], p->err[nv]);
		else
			nv++;
	}
	p->nv = nv;
	return WH_OK;
}

static wh_code decode_vertices(wh_ctx *c, const wh_store *s, const uint8_t *records, uint32_t n,
                               wh_store_scratch *sc, wh_patch *p, bool *ok)
{
	const size_t size = wh_store_vertex_bytes(s);
	*ok = true;
	for (uint32_t v = 0; v < n; v++) {
		decode_vertex(s, records + v * size, p, v);
		if (v > 0 && p->gid[v] <= p->gid[v - 1])
			return decode_sorted(c, s, records, n, sc, p, ok);
	}
	return WH_OK;
}

/* From global ids to places in an ascending list: the ids' range is cut into as many slots as
 * there are ids, and each slot knows where its ids begin. */
typedef struct locator {
	const uint64_t *gid;
	const uint32_t *slot;
	uint64_t first, last;
	uint32_t shift;
} locator;

static wh_code locator_build(wh_ctx *c, wh_store_scratch *sc, const wh_patch *p, locator *l)
{
	*l = (locator){.gid = p->gid, .first = p->gid[0], .last = p->gid[p->nv - 1]};
	while ((l->last - l->first) >> l->shift >= 2 * (uint64_t)p->nv)
		l->shift++;
	const size_t slots = (size_t)((l->last - l->first) >> l->shift) + 2;
	if (wh_renew(c, &sc->index, &sc->index_cap, slots, sizeof *sc->index) != WH_OK)
		return wh_failed(c);
	size_t next = 0;
	for (uint32_t v = 0; v < p->nv; v++) {
		const size_t k = (size_t)((p->gid[v] - l->first) >> l->shift);
		while (next <= k)
			sc->index[next++] = v;
	}
	while (next < slots)
		sc->index[next++] = p->nv;
	l->slot = sc->index;
	return WH_OK;
}

static uint32_t locate(const locator *l, uint64_t gid)
{
	if (gid < l->first || gid > l->last)
		return WH_NONE;
	const size_t k = (size_t)((gid - l->first) >> l->shift);
	uint32_t lo = l->slot[k], hi = l->slot[k + 1];
	while (lo < hi) {
		const uint32_t mid = lo + (hi - lo) / 2;
		if (l->gid[mid] < gid)
			lo = mid + 1;
		else
			hi = mid;
	}
	return l->gid[lo] == gid ? lo : WH_NONE;
}

static uint64_t stored_corner(const wh_store *s, const uint8_t *faces, size_t i)
{
	if (s->local_corners || s->id_bytes == 4) {
		uint32_t id;
		memcpy(&id, faces + 4 * i, 4);
		return id;
	}
	uint64_t id;
	memcpy(&id, faces + 8 * i, 8);
	return id;
}

static wh_code decode_faces(wh_ctx *c, const wh_store *s, const uint8_t *faces,
                            wh_store_scratch *sc, wh_patch *p, bool *ok)
{
	const size_t corners = 3 * (size_t)p->nf;
	*ok = true;
	if (corners == 0)
		return WH_OK;
	if (s->local_corners) {
		memcpy(p->tri, faces, corners * sizeof *p->tri);
		for (size_t i = 0; i < corners; i++)
			*ok = *ok && p->tri[i] < p->nv;
		return WH_OK;
	}
	locator l;
	if (p->nv == 0) {
		*ok = false;
		return WH_OK;
	}
	if (locator_build(c, sc, p, &l) != WH_OK)
		return c->err.code;
	for (size_t i = 0; i < corners; i++) {
		p->tri[i] = locate(&l, stored_corner(s, faces, i));
		*ok = *ok && p->tri[i] != WH_NONE;
	}
	return WH_OK;
}

/* Vertices of no face: the owners of unused ids, and ends of what other clusters took. */
static wh_code drop_unreferenced(wh_ctx *c, wh_store_scratch *sc, wh_patch *p)
{
	if (wh_renew(c, &sc->index, &sc->index_cap, p->nv, sizeof *sc->index) != WH_OK)
		return c->err.code;
	uint32_t *used = sc->index;
	memset(used, 0, p->nv * sizeof *used);
	for (size_t i = 0; i < 3 * (size_t)p->nf; i++)
		used[p->tri[i]] = 1;
	for (uint32_t v = 0; v < p->nv; v++)
		sc->unreferenced += !used[v] && !(p->flag[v] & WH_CUT);
	(void)wh_patch_compact(p, sc->index);
	return WH_OK;
}

wh_code wh_store_load(wh_ctx *c, const wh_store *s, uint32_t cluster, wh_store_scratch *scratch,
                      wh_patch *p)
{
	header h;
	if (read_whole(c, s, cluster, scratch, &h) != WH_OK ||
	    wh_patch_reset(c, p, (uint32_t)h.vertices, (uint32_t)h.faces) != WH_OK)
		return c->err.code;
	scratch->unreferenced = 0;
	if (h.faces == 0 && h.vertices == 0)
		return WH_OK; /* an empty cell: nothing was allocated either */
	const uint8_t *records = scratch->raw + (size_t)h.faces * wh_store_face_bytes(s);
	bool ok;
	if (decode_vertices(c, s, records, p->nv, scratch, p, &ok) != WH_OK ||
	    (ok && decode_faces(c, s, scratch->raw, scratch, p, &ok) != WH_OK))
		return c->err.code;
	if (!ok) {
		char name[NAME_BYTES];
		file_name(s, cluster, false, name);
		return damaged(c, s, name);
	}
	return drop_unreferenced(c, scratch, p);
}

void wh_store_remove(const wh_store *s, uint32_t cluster)
{
	char name[NAME_BYTES];
	file_name(s, cluster, false, name);
	wh_spill_remove(s->spill, name);
}

wh_code wh_store_counts(wh_ctx *c, const wh_store *s, uint32_t cluster, uint64_t *faces,
                        uint64_t *vertices)
{
	char name[NAME_BYTES];
	file_name(s, cluster, false, name);
	const int fd = wh_spill_read(c, s->spill, name);
	if (fd < 0)
		return c->err.code;
	header h;
	const wh_code code = read_header(c, s, fd, name, &h);
	(void)close(fd);
	*faces = code == WH_OK ? h.faces : 0;
	*vertices = code == WH_OK ? h.vertices : 0;
	return code;
}
