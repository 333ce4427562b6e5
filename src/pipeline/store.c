#include "pipeline/store.h"

#include "pipeline/pieces.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#define XXH_STATIC_LINKING_ONLY /* the size of its state */
#include <xxhash.h>

enum {
	VERSION = 4,
	NAME_BYTES = WH_SPILL_NAME,
	SAVE_BUFFER = 256 * 1024,
	BATCH = 256,             /* vertices encoded at a time */
	VERTEX_MOST = 8 + 24 + 4 /* bytes of a vertex without attributes */
};
static const char MAGIC[8] = {'W', 'H', 'C', 'L', 'U', 'S', 'T', '1'};

typedef struct header {
	char magic[8];
	uint32_t version, id_bytes, coord_bytes, vertex_payload, face_bytes, local_corners;
	uint64_t faces, vertices, checksum;
	uint32_t attr_bytes, zero;
} header;

_Static_assert(sizeof(header) == 64, "the header has the documented size");

enum { ABSENT = 128 }; /* in the flags of vertices whose record has not been met yet */

static void file_name(const wh_store *s, uint32_t cluster, bool part, char name[NAME_BYTES])
{
	char whole[32];
	(void)snprintf(whole, sizeof whole, "round%u-%06u", s->generation, cluster);
	if (part)
		(void)wh_spill_part(s->spill, whole, name);
	else
		memcpy(name, whole, sizeof whole);
}

void wh_store_lay_out(const wh_store *from, wh_store *to)
{
	to->clusters = from->clusters;
	to->id_bytes = from->id_bytes;
	to->coord_bytes = from->coord_bytes;
	to->vertex_payload = sizeof(float);
	to->attr_bytes = from->attr_bytes;
	to->face_bytes = from->face_bytes;
	to->local_corners = true;
}

/* ---- writing ------------------------------------------------------------------------------ */

static wh_code make_file(wh_ctx *c, const wh_store *s, uint32_t cluster)
{
	char name[NAME_BYTES];
	if (s->pieces)
		return WH_OK;
	file_name(s, cluster, true, name);
	const int fd = wh_spill_create(c, s->spill, name);
	if (fd >= 0)
		(void)close(fd);
	return fd >= 0 ? WH_OK : wh_failed(c);
}

wh_code wh_store_begin(wh_ctx *c, const wh_store *s, uint32_t cluster, wh_store_writer *w,
                       size_t buffer)
{
	*w = (wh_store_writer){.off = sizeof(header), .cap = buffer};
	w->buf = wh_alloc(c, buffer, 1);
	w->hash = wh_alloc(c, 1, sizeof(XXH3_state_t));
	if (!w->buf || !w->hash || make_file(c, s, cluster) != WH_OK) {
		wh_store_drop(c, w);
		return wh_failed(c);
	}
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

static wh_code write_out(wh_ctx *c, const wh_store *s, uint32_t cluster, wh_store_writer *w,
                         const uint8_t *bytes, size_t n)
{
	if (n == 0)
		return WH_OK;
	(void)XXH3_64bits_update(w->hash, bytes, n);
	if ((s->pieces ? wh_pieces_append(c, s->pieces, cluster, bytes, n)
	               : write_at(c, s, cluster, bytes, n, w->off)) != WH_OK)
		return c->err.code;
	w->off += n;
	return WH_OK;
}

static wh_code flush(wh_ctx *c, const wh_store *s, uint32_t cluster, wh_store_writer *w)
{
	const size_t n = w->used;
	w->used = 0;
	return write_out(c, s, cluster, w, w->buf, n);
}

wh_code wh_store_append(wh_ctx *c, const wh_store *s, uint32_t cluster, wh_store_writer *w,
                        const void *bytes, size_t n)
{
	const uint8_t *from = bytes;
	if (w->used == 0 && n >= w->cap) { /* as good as a full buffer */
		if (write_out(c, s, cluster, w, from, n) != WH_OK)
			return c->err.code;
		n = 0;
	}
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

/* The header, and the name. */
static wh_code commit_file(wh_ctx *c, const wh_store *s, uint32_t cluster, const wh_store_writer *w,
                           uint64_t checksum)
{
	char part[NAME_BYTES], whole[NAME_BYTES];
	header h = {.version = VERSION,
	            .id_bytes = s->id_bytes,
	            .coord_bytes = s->coord_bytes,
	            .vertex_payload = s->vertex_payload,
	            .face_bytes = s->face_bytes,
	            .local_corners = s->local_corners,
	            .faces = w->faces,
	            .vertices = w->vertices,
	            .checksum = checksum,
	            .attr_bytes = s->attr_bytes};
	memcpy(h.magic, MAGIC, sizeof MAGIC);
	if (write_at(c, s, cluster, &h, sizeof h, 0) != WH_OK)
		return c->err.code;
	file_name(s, cluster, true, part);
	file_name(s, cluster, false, whole);
	return wh_spill_rename(c, s->spill, part, whole);
}

wh_code wh_store_commit(wh_ctx *c, const wh_store *s, uint32_t cluster, wh_store_writer *w)
{
	wh_code code = flush(c, s, cluster, w);
	const uint64_t checksum = XXH3_64bits_digest(w->hash);
	if (code == WH_OK && s->pieces)
		wh_pieces_end(s->pieces, cluster, w->faces, w->vertices, checksum);
	else if (code == WH_OK)
		code = commit_file(c, s, cluster, w, checksum);
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

/* With attributes, which may be long, vertices go one by one. */
static wh_code save_with_attributes(wh_ctx *c, const wh_store *s, uint32_t cluster,
                                    wh_store_writer *w, const wh_patch *p)
{
	uint8_t one[VERTEX_MOST];
	for (uint32_t v = 0; v < p->nv; v++) {
		const uint8_t *end =
		    wh_store_put_vertex(s, one, p->gid[v], p->flag[v], p->pos[v], p->err[v]);
		if (wh_store_append(c, s, cluster, w, one, (size_t)(end - one)) != WH_OK ||
		    wh_store_append(c, s, cluster, w, wh_patch_attr(p, v), p->attr_bytes) != WH_OK)
			return c->err.code;
	}
	w->vertices = p->nv;
	return WH_OK;
}

static wh_code save_vertices(wh_ctx *c, const wh_store *s, uint32_t cluster, wh_store_writer *w,
                             const wh_patch *p)
{
	uint8_t batch[BATCH * VERTEX_MOST];
	for (uint32_t v = 0; v < p->nv;) {
		const uint32_t end = p->nv - v < BATCH ? p->nv : v + BATCH;
		uint8_t *at = batch;
		for (; v < end; v++)
			at =
			    wh_store_put_vertex(s, at, p->gid[v], p->flag[v], p->pos[v], p->err[v]);
		if (wh_store_append(c, s, cluster, w, batch, (size_t)(at - batch)) != WH_OK)
			return c->err.code;
	}
	w->vertices = p->nv;
	return WH_OK;
}

wh_code wh_store_save(wh_ctx *c, const wh_store *s, uint32_t cluster, const wh_patch *p)
{
	wh_store_writer w;
	if (wh_store_begin(c, s, cluster, &w, SAVE_BUFFER) != WH_OK)
		return c->err.code;
	w.faces = p->nf;
	if (wh_store_append(c, s, cluster, &w, p->tri, 3 * sizeof *p->tri * p->nf) != WH_OK ||
	    (s->face_bytes &&
	     wh_store_append(c, s, cluster, &w, p->face, (size_t)p->nf * s->face_bytes) != WH_OK) ||
	    (s->attr_bytes ? save_with_attributes(c, s, cluster, &w, p)
	                   : save_vertices(c, s, cluster, &w, p)) != WH_OK) {
		wh_store_drop(c, &w);
		return c->err.code;
	}
	return wh_store_commit(c, s, cluster, &w);
}

/* ---- loading ------------------------------------------------------------------------------ */

static size_t body_bytes(const wh_store *s, uint64_t nv, uint64_t nf)
{
	return (size_t)nf * wh_store_face_bytes(s) + (size_t)nv * wh_store_vertex_bytes(s);
}

wh_code wh_store_workspace_fit(wh_ctx *c, const wh_store *s, wh_store_workspace *ws, uint64_t nv,
                               uint64_t nf)
{
	return wh_renew(c, &ws->raw, &ws->raw_cap, body_bytes(s, nv, nf), 1);
}

void wh_store_workspace_free(wh_ctx *c, wh_store_workspace *s)
{
	wh_free(c, s->raw);
	wh_places_free(c, &s->places);
	*s = (wh_store_workspace){0};
}

static wh_code damaged(wh_ctx *c, const wh_store *s, const char *name)
{
	return wh_fail(c, WH_E_RUN,
	               "%s/%s: the temporary file is damaged; run again%s, on another disk if it "
	               "happens again (%s)",
	               s->spill->dir, name, s->spill->kept ? " with --resume" : "",
	               s->spill->kept ? "--run-dir" : "--temp-dir");
}

static wh_code read_header(wh_ctx *c, const wh_store *s, int fd, const char *name, header *h)
{
	if (wh_spill_pread(c, s->spill, fd, h, sizeof *h, 0) != WH_OK)
		return c->err.code;
	if (memcmp(h->magic, MAGIC, sizeof MAGIC) != 0 || h->version != VERSION ||
	    h->id_bytes != s->id_bytes || h->coord_bytes != s->coord_bytes ||
	    h->vertex_payload != s->vertex_payload || h->attr_bytes != s->attr_bytes ||
	    h->face_bytes != s->face_bytes || h->local_corners != s->local_corners ||
	    h->zero != 0 || h->faces > WH_PATCH_MOST_FACES || h->vertices > WH_PATCH_MOST_VERTICES)
		return damaged(c, s, name);
	return WH_OK;
}

static wh_code read_whole(wh_ctx *c, const wh_store *s, uint32_t cluster, wh_store_workspace *ws,
                          header *h)
{
	char name[NAME_BYTES];
	if (s->parts) {
		*h = (header){0};
		return wh_pieces_read(c, s, cluster, ws, &h->faces, &h->vertices);
	}
	file_name(s, cluster, false, name);
	const int fd = wh_spill_read(c, s->spill, name);
	if (fd < 0)
		return wh_failed(c);
	wh_code code = read_header(c, s, fd, name, h);
	if (code == WH_OK) {
		const size_t n = body_bytes(s, h->vertices, h->faces);
		struct stat st; /* no memory for counts that the file does not hold */
		if (fstat(fd, &st) != 0 || (uint64_t)st.st_size != sizeof *h + n)
			code = damaged(c, s, name);
		if (code == WH_OK)
			code = wh_renew(c, &ws->raw, &ws->raw_cap, n, 1);
		if (code == WH_OK)
			code = wh_spill_pread(c, s->spill, fd, ws->raw, n, sizeof *h);
		if (code == WH_OK && XXH3_64bits(ws->raw, n) != h->checksum)
			code = damaged(c, s, name);
	}
	(void)close(fd);
	return code;
}

wh_code wh_store_verify(wh_ctx *c, const wh_store *s, uint32_t cluster, wh_store_workspace *ws,
                        uint64_t *checksum)
{
	header h;
	const wh_code code = read_whole(c, s, cluster, ws, &h);
	*checksum = code == WH_OK ? h.checksum : 0;
	return code;
}

static uint64_t record_gid(const uint8_t *at, uint32_t id_bytes, uint8_t *flag)
{
	uint64_t id;
	unsigned bits;
	if (id_bytes == 4) {
		uint32_t narrow;
		memcpy(&narrow, at, 4);
		bits = narrow >> WH_STORE_BITS32;
		id = narrow & (((uint32_t)1 << WH_STORE_BITS32) - 1);
	} else {
		memcpy(&id, at, 8);
		bits = (unsigned)(id >> WH_STORE_BITS64);
		id &= ((uint64_t)1 << WH_STORE_BITS64) - 1;
	}
	*flag = (uint8_t)((bits & 2 ? WH_CUT : 0) | (bits & 1 ? WH_NEVER : 0));
	return id;
}

static wh_vec3 record_position(const uint8_t *at, uint32_t coord_bytes)
{
	if (coord_bytes == 4) {
		float xyz[3];
		memcpy(xyz, at, sizeof xyz);
		return wh_v3((double)xyz[0], (double)xyz[1], (double)xyz[2]);
	}
	wh_vec3 pos;
	memcpy(&pos, at, sizeof pos);
	return pos;
}

/* The ids in the order of the file, which they may already ascend in. */
static bool read_ids(const wh_store *s, const uint8_t *records, uint32_t n, uint64_t *ids)
{
	const size_t size = wh_store_vertex_bytes(s);
	bool ascend = true;
	uint8_t flag;
	for (uint32_t i = 0; i < n; i++) {
		ids[i] = record_gid(records + i * size, s->id_bytes, &flag);
		ascend &= i == 0 || ids[i] > ids[i - 1];
	}
	return ascend;
}

/* Inlined with the commonest layout as constants. */
static inline void put_vertices(const wh_store *s, const uint8_t *records, uint32_t n,
                                const wh_places *places, wh_patch *p)
{
	const size_t size = wh_store_vertex_bytes(s);
	for (uint32_t i = 0; i < n; i++, records += size) {
		uint8_t flag;
		uint32_t v = i;
		const uint64_t gid = record_gid(records, s->id_bytes, &flag);
		float err = 0;
		if (s->vertex_payload)
			memcpy(&err, records + size - s->attr_bytes - 4, 4);
		if (places) {
			(void)wh_places_find(places, gid, &v);
			if (!(p->flag[v] & ABSENT)) {
				p->err[v] = fmaxf(p->err[v], err);
				p->flag[v] |= flag;
				continue;
			}
		}
		p->gid[v] = gid;
		p->flag[v] = flag;
		p->pos[v] = record_position(records + s->id_bytes, s->coord_bytes);
		p->err[v] = err;
		if (s->attr_bytes)
			memcpy(wh_patch_attr(p, v), records + size - s->attr_bytes, s->attr_bytes);
	}
}

static void put_vertices_of(const wh_store *s, const uint8_t *records, uint32_t n,
                            const wh_places *places, wh_patch *p)
{
	wh_store common = {.id_bytes = 4, .coord_bytes = 4};
	if (s->id_bytes != 4 || s->coord_bytes != 4 || s->attr_bytes) {
		put_vertices(s, records, n, places, p);
	} else if (s->vertex_payload == 0) {
		put_vertices(&common, records, n, places, p);
	} else {
		common.vertex_payload = 4;
		put_vertices(&common, records, n, places, p);
	}
}

/* Decodes the records, ascending by id and each once; where an id repeats, the largest error bound
 * holds. */
static wh_code decode_vertices(wh_ctx *c, const wh_store *s, const uint8_t *records,
                               wh_store_workspace *ws, wh_patch *p, bool *ok)
{
	const uint32_t n = p->nv;
	*ok = true;
	if (n == 0)
		return WH_OK;
	const bool ascend = read_ids(s, records, n, p->gid);
	*ok = ascend || !s->local_corners;
	if (s->local_corners) {
		put_vertices_of(s, records, n, NULL, p);
		return WH_OK;
	}
	if (wh_places_fill(c, &ws->places, p->gid, n) != WH_OK)
		return c->err.code;
	memset(p->flag, ABSENT, n);
	put_vertices_of(s, records, n, ascend ? NULL : &ws->places, p);
	p->nv = ws->places.n;
	return WH_OK;
}

static uint64_t stored_corner(const uint8_t *faces, uint32_t id_bytes, size_t i)
{
	if (id_bytes == 4) {
		uint32_t id;
		memcpy(&id, faces + 4 * i, 4);
		return id;
	}
	uint64_t id;
	memcpy(&id, faces + 8 * i, 8);
	return id;
}

/* Corners by global id; `used` marks their vertices. False when one is not there. Inlined with
 * constants. */
static inline bool put_faces(const uint8_t *faces, uint32_t id_bytes, const wh_places *places,
                             uint32_t levels, wh_patch *p, uint8_t *used)
{
	wh_places own = *places; /* which no mark, being a byte, can be part of */
	own.levels = levels;
	const size_t corners = 3 * (size_t)p->nf;
	uint32_t *tri = p->tri;
	bool ok = true;
	for (size_t i = 0; i < corners; i++) {
		uint32_t v;
		ok &= wh_places_find(&own, stored_corner(faces, id_bytes, i), &v);
		tri[i] = v;
		used[v] = 1;
	}
	return ok;
}

/* The same where corners are places. */
static bool copy_faces(const uint8_t *faces, wh_patch *p, uint8_t *used)
{
	const size_t corners = 3 * (size_t)p->nf;
	const uint32_t *tri = p->tri;
	const uint32_t nv = p->nv;
	bool ok = true;
	memcpy(p->tri, faces, corners * sizeof *tri);
	for (size_t i = 0; i < corners; i++) {
		const bool inside = tri[i] < nv;
		used[inside ? tri[i] : 0] = 1;
		ok &= inside;
	}
	return ok;
}

/* The same for faces that carry something. */
static bool put_carrying_faces(const wh_store *s, const uint8_t *faces, const wh_places *places,
                               wh_patch *p, uint8_t *used)
{
	const size_t size = wh_store_face_bytes(s);
	bool ok = true;
	for (uint32_t f = 0; f < p->nf; f++, faces += size) {
		for (size_t k = 0; k < 3; k++) {
			uint32_t v;
			ok &= wh_places_find(places, stored_corner(faces, s->id_bytes, k), &v);
			p->tri[3 * (size_t)f + k] = v;
			used[v] = 1;
		}
		memcpy(wh_patch_face(p, f), faces + size - s->face_bytes, s->face_bytes);
	}
	return ok;
}

static bool decode_faces(const wh_store *s, const uint8_t *faces, const wh_places *places,
                         wh_patch *p, uint8_t *used)
{
	if (p->nv == 0)
		return p->nf == 0;
	memset(used, 0, p->nv);
	if (s->local_corners && s->face_bytes && p->nf)
		memcpy(p->face, faces + 12 * (size_t)p->nf, (size_t)p->nf * s->face_bytes);
	if (s->local_corners)
		return copy_faces(faces, p, used);
	if (s->face_bytes)
		return put_carrying_faces(s, faces, places, p, used);
	if (s->id_bytes == 4 && places->levels == 1)
		return put_faces(faces, 4, places, 1, p, used);
	return put_faces(faces, s->id_bytes, places, places->levels, p, used);
}

/* Drops vertices of no face: the owners of unused ids, and ends of what other clusters took. */
static wh_code drop_unreferenced(wh_ctx *c, wh_store_workspace *ws, wh_patch *p,
                                 const uint8_t *used)
{
	uint32_t unused = 0;
	for (uint32_t v = 0; v < p->nv; v++) {
		unused += !used[v];
		ws->unreferenced += !used[v] && !(p->flag[v] & WH_CUT);
	}
	if (unused == 0)
		return WH_OK;
	uint32_t *map = wh_places_room(c, &ws->places, p->nv);
	if (!map)
		return c->err.code;
	(void)wh_patch_compact(p, map);
	return WH_OK;
}

wh_code wh_store_load(wh_ctx *c, const wh_store *s, uint32_t cluster, wh_store_workspace *ws,
                      wh_patch *p)
{
	header h;
	p->attr_bytes = s->attr_bytes;
	p->face_bytes = s->face_bytes;
	if (read_whole(c, s, cluster, ws, &h) != WH_OK ||
	    wh_patch_reset(c, p, (uint32_t)h.vertices, (uint32_t)h.faces) != WH_OK)
		return c->err.code;
	ws->unreferenced = 0;
	if (h.faces == 0 && h.vertices == 0)
		return WH_OK; /* an empty cell: nothing was allocated either */
	uint8_t *records = ws->raw + (size_t)h.faces * wh_store_face_bytes(s);
	uint8_t *used = records; /* once they have been read: a byte a vertex */
	bool ok;
	if (decode_vertices(c, s, records, ws, p, &ok) != WH_OK)
		return c->err.code;
	if (!ok || !decode_faces(s, ws->raw, &ws->places, p, used)) {
		char name[NAME_BYTES];
		file_name(s, cluster, false, name);
		return damaged(c, s, name);
	}
	return drop_unreferenced(c, ws, p, used);
}

wh_code wh_store_checksum(wh_ctx *c, const wh_store *s, uint32_t cluster, uint64_t *checksum)
{
	char name[NAME_BYTES];
	header h;
	file_name(s, cluster, false, name);
	const int fd = wh_spill_read(c, s->spill, name);
	if (fd < 0)
		return wh_failed(c);
	const wh_code code = read_header(c, s, fd, name, &h);
	(void)close(fd);
	*checksum = code == WH_OK ? h.checksum : 0;
	return code;
}

void wh_store_remove(const wh_store *s, uint32_t cluster)
{
	char name[NAME_BYTES];
	if (s->parts) {
		if (cluster == 0)
			wh_pieces_remove(s);
		return;
	}
	file_name(s, cluster, false, name);
	wh_spill_remove(s->spill, name);
}

wh_code wh_store_counts(wh_ctx *c, const wh_store *s, uint32_t cluster, uint64_t *faces,
                        uint64_t *vertices)
{
	char name[NAME_BYTES];
	if (s->parts)
		return wh_pieces_counts(c, s, cluster, faces, vertices);
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
