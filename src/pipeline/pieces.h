/*
 * pieces: a store whose clusters lie in pieces, a file for each process that shared the ingest.
 *
 * A share (ingest.h) is put together in a spill folder of its own process, as a store like any
 * other; then all its cluster files become one file of the common folder, which gets its name when
 * it is whole. A cluster is the faces of all its pieces, in the order of the parts, and their
 * vertices. All numbers are in the byte order of the machine:
 *
 *     offset  bytes  content
 *          0      8  "WHPIECES"
 *          8      4  version of the layout: 1
 *         12      4  part, from 0
 *         16      4  of so many
 *         20      4  clusters
 *         24      4  bytes of the note
 *         28      4  zero
 *         32      8  ids of cut vertices
 *         40      8  offset of them
 *         48      8  XXH3 of the note and the table
 *         56         note: what its writer wants to keep
 *                    table: for each cluster the offset of its piece, its faces, its vertices, the
 *                    XXH3 of the piece
 *                    pieces: as in a cluster file after the header
 *                    ids, ascending, 8 bytes each
 */
#ifndef WH_PIPELINE_PIECES_H
#define WH_PIPELINE_PIECES_H

#include "pipeline/store.h"

/* What a part's file begins with. */
typedef struct wh_pieces_head {
	char magic[8];
	uint32_t version, part, parts, clusters, note_bytes, zero;
	uint64_t ids, ids_at, checksum;
} wh_pieces_head;

/*
 * Packs the cluster files of `from`, which lies in another spill folder and goes, into the file of
 * one part of `to` (spill, generation, clusters and parts set). `ids_fd`: a file of from's folder
 * with so many ids. `from` NULL: the pieces are empty.
 */
wh_code wh_pieces_pack(wh_ctx *c, const wh_store *from, const wh_store *to, uint32_t part,
                       int ids_fd, uint64_t ids, const void *note, uint32_t note_bytes);

/* Reads the note of a part. False, with nothing recorded, when its file is not there, or not whole
 * as far as its table. */
bool wh_pieces_note(wh_ctx *c, const wh_store *s, uint32_t part, void *note, uint32_t note_bytes);

/* How many different vertices the parts list as cut. */
wh_code wh_pieces_count_ids(wh_ctx *c, const wh_store *s, uint64_t *n);

/* Counts of one cluster; and of all, when `faces` and `vertices` hold one for each. */
wh_code wh_pieces_counts(wh_ctx *c, const wh_store *s, uint32_t cluster, uint64_t *faces,
                         uint64_t *vertices);
wh_code wh_pieces_all_counts(wh_ctx *c, const wh_store *s, uint64_t *faces, uint64_t *vertices);

/* Reads a cluster as a cluster file would hold it, into scratch->raw: faces, then vertices.
 * WH_E_RUN when a piece is gone or damaged. */
wh_code wh_pieces_read(wh_ctx *c, const wh_store *s, uint32_t cluster, wh_store_scratch *scratch,
                       uint64_t *faces, uint64_t *vertices);

/* Removes all files of the store. */
void wh_pieces_remove(const wh_store *s);

#endif
