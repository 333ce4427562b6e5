/*
 * pieces: a store whose clusters lie in pieces, a file for each process that shared the ingest.
 *
 * The file of a part grows as its process goes along, by whatever the write buffer of a cluster
 * holds, and gets its name when it is whole. Each such extent tells where the one before it is of
 * the same cluster: so the file is written in one go, and nothing that is held grows with it. A
 * cluster is the faces of all its pieces, in the order of the parts, and their vertices. All
 * numbers are in the byte order of the machine:
 *
 *     offset  bytes  content
 *          0      8  "WHPIECES"
 *          8      4  version of the layout: 2
 *         12      4  part, from 0
 *         16      4  of so many
 *         20      4  clusters
 *         24      4  bytes of the note
 *         28      4  zero
 *         32      8  offset of the table
 *         40      8  XXH3 of the note and the table
 *         48   1024  note: what its writer wants to keep, and room
 *       1072         extents, each: the offset of the one before it of the same piece, or 0; bytes
 *                    of its own (8 each); these bytes. Those of a piece, in their order, are what
 *                    follows the header in a cluster file
 *                    table: for each cluster the offset of its last extent, or 0; its faces, its
 *                    vertices, the XXH3 of the piece (8 each); then, as of one more cluster without
 *                    faces, ids of cut vertices, ascending, 8 bytes each
 */
#ifndef WH_PIPELINE_PIECES_H
#define WH_PIPELINE_PIECES_H

#include "pipeline/store.h"

/* What a part's file begins with. */
typedef struct wh_pieces_head {
	char magic[8];
	uint32_t version, part, parts, clusters, note_bytes, zero;
	uint64_t table_at, checksum;
} wh_pieces_head;

/* A line of the table. */
typedef struct wh_piece {
	uint64_t last, faces, vertices, checksum;
} wh_piece;

/* The file of one part, while it is written. Zero-initialise; not thread-safe. */
typedef struct wh_pieces {
	const wh_store *store; /* spill, generation, clusters and parts are set */
	uint32_t part;
	int fd;
	uint64_t end; /* of the file so far */
	wh_piece *table;
} wh_pieces;

enum { WH_PIECES_IDS = 4096, WH_PIECES_NOTE = 1024 }; /* at most: ids at a time, bytes of a note */

/* Bytes of memory that writing takes. */
static inline size_t wh_pieces_bytes(uint32_t clusters)
{
	return ((size_t)clusters + 1) * sizeof(wh_piece) + 256;
}

wh_code wh_pieces_begin(wh_ctx *c, wh_pieces *p, const wh_store *store, uint32_t part);
/* Appends bytes of a cluster, of which there are faces first. */
wh_code wh_pieces_append(wh_ctx *c, wh_pieces *p, uint32_t cluster, const void *bytes, size_t n);
/* The piece is whole. */
void wh_pieces_end(wh_pieces *p, uint32_t cluster, uint64_t faces, uint64_t vertices,
                   uint64_t checksum);
/* Appends up to WH_PIECES_IDS ids of cut vertices, ascending over all calls. */
wh_code wh_pieces_add_ids(wh_ctx *c, wh_pieces *p, const uint64_t *id, size_t n);
/* All pieces are whole, or, with `empty`, there are none after all: the file gets its name. */
wh_code wh_pieces_commit(wh_ctx *c, wh_pieces *p, bool empty, const void *note,
                         uint32_t note_bytes);
/* Frees it, whether it was committed or not. */
void wh_pieces_drop(wh_ctx *c, wh_pieces *p);

/* Reads the note of a part. False, with nothing recorded, when its file is not there, or not whole
 * as far as its table. */
bool wh_pieces_note(wh_ctx *c, const wh_store *s, uint32_t part, void *note, uint32_t note_bytes);

/* How many different vertices the parts list as cut. */
wh_code wh_pieces_count_ids(wh_ctx *c, const wh_store *s, uint64_t *n);

/* Counts of one cluster; and of all, when `faces` and `vertices` hold one for each. */
wh_code wh_pieces_counts(wh_ctx *c, const wh_store *s, uint32_t cluster, uint64_t *faces,
                         uint64_t *vertices);
wh_code wh_pieces_all_counts(wh_ctx *c, const wh_store *s, uint64_t *faces, uint64_t *vertices);

/* Reads a cluster as a cluster file would hold it, into ws->raw: faces, then vertices.
 * WH_E_RUN when a piece is gone or damaged. */
wh_code wh_pieces_read(wh_ctx *c, const wh_store *s, uint32_t cluster, wh_store_workspace *ws,
                       uint64_t *faces, uint64_t *vertices);

/* Removes all files of the store. */
void wh_pieces_remove(const wh_store *s);

#endif
