/*
 * store: the cluster files of a round, one for each cluster, in the spill folder.
 *
 * A file is written by appending faces first and vertices then, and committed by rename; it is
 * loaded whole, as a patch. Layout, all numbers in the byte order of the machine:
 *
 *     offset  bytes  content
 *          0      8  "WHCLUST1"
 *          8      4  version of the layout: 4
 *         12      4  bytes of a global id: 4 or 8
 *         16      4  bytes of a coordinate: 4 or 8
 *         20      4  bytes of the error bound that a vertex carries after its position: 0 or 4
 *         24      4  bytes of what a face and its corners carry (io/wedges.h)
 *         28      4  1: corners are positions in this file's vertex list; 0: global ids
 *         32      8  faces
 *         40      8  vertices
 *         48      8  XXH3 of everything after the header
 *         56      4  bytes of attributes that a vertex carries after that (io/attributes.h)
 *         60      4  zero
 *         64         faces: three corners each, with global ids each with what it carries behind
 *                    it; else all corners, then what all faces carry
 *                    vertices: global id (top bit: cut vertex, next bit: never free so far),
 *                    x, y, z, error bound, attributes
 *
 * With global ids as corners, vertices may repeat and come in any order; else they ascend. Every
 * id that a face uses is there. A cut vertex has the same id and position in every file that holds
 * it, and the same attributes; its error bound may differ, and the largest holds. Where it repeats
 * in one, the flags of all its records count.
 */
#ifndef WH_PIPELINE_STORE_H
#define WH_PIPELINE_STORE_H

#include "base/places.h"
#include "io/spill.h"
#include "mesh/patch.h"

#include <string.h>

/* How a whole store is laid out. */
typedef struct wh_store {
	wh_spill *spill;
	uint32_t generation; /* a fresh number for every store of a run: part of its files' names */
	uint32_t clusters;
	uint32_t parts;          /* 0: a file for each cluster; else see pieces.h */
	uint32_t id_bytes;       /* 4 while all ids are below 2^30 */
	uint32_t coord_bytes;    /* 4: positions are floats */
	uint32_t vertex_payload; /* bytes of the error bound */
	uint32_t attr_bytes;     /* of a vertex */
	uint32_t face_bytes;     /* of a face and its corners */
	bool local_corners;
	struct wh_pieces *pieces; /* of a store in pieces: the part's file that is being written */
	struct wh_ledger *ledger; /* of the round that fills it (pipeline/ledger.h); NULL: none */
	const struct wh_sequence
	    *sequence; /* where that round keeps its collapses, too; NULL: nowhere */
} wh_store;

/* Lays out `to` as rounds over `from` leave a store: the same clusters and records, with an error
 * bound to each vertex and local corners. The spill folder, generation and ledger are the caller's.
 */
void wh_store_lay_out(const wh_store *from, wh_store *to);

/* Writes one cluster file. Zero-initialise; not thread-safe. */
typedef struct wh_store_writer {
	uint8_t *buf;
	size_t used, cap;
	uint64_t off; /* of buf in the file */
	uint64_t faces, vertices;
	void *hash;
} wh_store_writer;

/* Bytes of a writer with such a buffer. */
static inline size_t wh_store_writer_bytes(size_t buffer)
{
	return buffer + 1024;
}

wh_code wh_store_begin(wh_ctx *c, const wh_store *s, uint32_t cluster, wh_store_writer *w,
                       size_t buffer);
/* Appends bytes that are already in file form; the caller keeps the counts in w. */
wh_code wh_store_append(wh_ctx *c, const wh_store *s, uint32_t cluster, wh_store_writer *w,
                        const void *bytes, size_t n);
/* Writes what is buffered and the header, renames, frees. */
wh_code wh_store_commit(wh_ctx *c, const wh_store *s, uint32_t cluster, wh_store_writer *w);
/* Frees a writer that is not to be committed. */
void wh_store_drop(wh_ctx *c, wh_store_writer *w);

/* Bytes of a vertex record. */
static inline size_t wh_store_vertex_bytes(const wh_store *s)
{
	return s->id_bytes + 3 * (size_t)s->coord_bytes + s->vertex_payload + s->attr_bytes;
}

/* Bytes of a face. */
static inline size_t wh_store_face_bytes(const wh_store *s)
{
	return 3 * (size_t)(s->local_corners ? 4 : s->id_bytes) + s->face_bytes;
}

/* The top two bits of a stored id hold flags. */
enum { WH_STORE_BITS32 = 30, WH_STORE_BITS64 = 62 };

/* Encodes one face with global ids as corners but for what it carries, which comes next; returns
 * the byte after it. */
static inline uint8_t *wh_store_put_face(const wh_store *s, uint8_t *at, const uint64_t gid[3])
{
	if (s->id_bytes == 4) {
		const uint32_t narrow[3] = {(uint32_t)gid[0], (uint32_t)gid[1], (uint32_t)gid[2]};
		memcpy(at, narrow, sizeof narrow);
		return at + sizeof narrow;
	}
	memcpy(at, gid, 3 * sizeof *gid);
	return at + 3 * sizeof *gid;
}

/* Encodes one vertex record but for the attributes, which come next; of the flags, WH_CUT and
 * WH_NEVER. Returns the byte after it. */
static inline uint8_t *wh_store_put_vertex(const wh_store *s, uint8_t *at, uint64_t gid,
                                           uint8_t flag, wh_vec3 pos, float err)
{
	const unsigned bits = (flag & WH_CUT ? 2U : 0U) | (flag & WH_NEVER ? 1U : 0U);
	if (s->id_bytes == 4) {
		const uint32_t id = (uint32_t)gid | bits << WH_STORE_BITS32;
		memcpy(at, &id, 4);
	} else {
		const uint64_t id = gid | (uint64_t)bits << WH_STORE_BITS64;
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

/* The workspace of loads, grown as needed and reused; zero-initialise. */
typedef struct wh_store_workspace {
	uint8_t *raw; /* the file without its header */
	size_t raw_cap;
	wh_places places;      /* of the vertices */
	uint64_t unreferenced; /* of the last load: vertices of no face, not cut, dropped */
} wh_store_workspace;

/* Bytes of a workspace that loads clusters of these counts. */
static inline size_t wh_store_workspace_bytes(const wh_store *s, uint64_t nv, uint64_t nf)
{
	return (size_t)nf * wh_store_face_bytes(s) + (size_t)nv * wh_store_vertex_bytes(s) +
	       wh_places_bytes(nv, s->id_bytes == 4 ? 30 : 32) + 1024;
}

/* Makes room for clusters of up to these counts, so that none of them finds too little and has to
 * get new memory. */
wh_code wh_store_workspace_fit(wh_ctx *c, const wh_store *s, wh_store_workspace *ws, uint64_t nv,
                               uint64_t nf);
void wh_store_workspace_free(wh_ctx *c, wh_store_workspace *s);

/* Loads a cluster into p: vertices ascending by global id, those without faces dropped, only
 * WH_CUT and WH_NEVER set in the flags. A damaged file is WH_E_RUN. */
wh_code wh_store_load(wh_ctx *c, const wh_store *s, uint32_t cluster, wh_store_workspace *ws,
                      wh_patch *p);

/* Writes a patch as cluster `cluster` of a store with local corners. */
wh_code wh_store_save(wh_ctx *c, const wh_store *s, uint32_t cluster, const wh_patch *p);

/* Reads a cluster's file and looks whether it is whole. WH_E_RUN when it is gone or damaged. */
wh_code wh_store_verify(wh_ctx *c, const wh_store *s, uint32_t cluster, wh_store_workspace *ws,
                        uint64_t *checksum);

/* The checksum in the header of a cluster's file. */
wh_code wh_store_checksum(wh_ctx *c, const wh_store *s, uint32_t cluster, uint64_t *checksum);

/* Removes a cluster's file; of a store in pieces all files, with cluster 0. */
void wh_store_remove(const wh_store *s, uint32_t cluster);

/* Counts in the header of a cluster's file. */
wh_code wh_store_counts(wh_ctx *c, const wh_store *s, uint32_t cluster, uint64_t *faces,
                        uint64_t *vertices);

#endif
