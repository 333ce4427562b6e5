/*
 * dispatch: records of jobs on their way to cluster files.
 *
 * A job fills a parcel with encoded records, by the cluster each goes to: it names the clusters of
 * all of them first and then encodes each in its place. Its commit hands the parcel to the cluster
 * files' writers, a run of records for each cluster. With commits in index order, the bytes of the
 * files do not depend on the threads.
 */
#ifndef WH_PIPELINE_DISPATCH_H
#define WH_PIPELINE_DISPATCH_H

#include "pipeline/store.h"

enum { WH_MAX_CLUSTERS = 65535 }; /* so that 16 bits number the clusters and leave one value */

/* Records of one job, all of one size. Zero-initialise; one for each worker. */
typedef struct wh_parcel {
	uint16_t *cluster; /* of each record, in the order of adding */
	uint8_t *record;   /* by cluster, those of one cluster in the order of adding */
	size_t cluster_cap, record_cap;
	size_t n, size;  /* size: bytes of a record */
	uint32_t *start; /* of each cluster in `record`, and the end: clusters + 1 */
	uint32_t clusters;
} wh_parcel;

/* Empties the parcel and makes room for so many records, at most 2^32 - 1. */
wh_code wh_parcel_begin(wh_ctx *c, wh_parcel *p, uint32_t clusters, size_t size, size_t room);
void wh_parcel_free(wh_ctx *c, wh_parcel *p);

/* Bytes that a parcel of these measures takes. */
size_t wh_parcel_bytes(uint32_t clusters, size_t size, size_t room);

/* Adds a record to come. There must be room. */
static inline void wh_parcel_add(wh_parcel *p, uint32_t cluster)
{
	p->cluster[p->n++] = (uint16_t)cluster;
}

/* To be called when all records are added. */
void wh_parcel_lay_out(wh_parcel *p);

/* Where the bytes of record i go; asked for 0 .. n-1 in this order. While records are put,
 * start[k + 1] is where the next one of k goes, so that it ends where those of k end: where those
 * of k + 1 start. */
static inline uint8_t *wh_parcel_put(const wh_parcel *p, size_t i)
{
	return p->record + p->start[p->cluster[i] + 1]++ * p->size;
}

/* The writers of all cluster files of a store. Not thread-safe. */
typedef struct wh_dispatch {
	const wh_store *store;
	wh_store_writer *writer;
} wh_dispatch;

size_t wh_dispatch_bytes(uint32_t clusters, size_t buffer);

/* Begins all files, with a write buffer of so many bytes each. wh_dispatch_drop also after a
 * failure; it removes what was not committed from memory, and may be called twice. */
wh_code wh_dispatch_begin(wh_ctx *c, wh_dispatch *d, const wh_store *store, size_t buffer);
wh_code wh_dispatch_commit(wh_ctx *c, wh_dispatch *d);
void wh_dispatch_drop(wh_ctx *c, wh_dispatch *d);

/* Appends the records of a parcel; all faces come before all vertices. */
wh_code wh_dispatch_faces(wh_ctx *c, wh_dispatch *d, const wh_parcel *p);
wh_code wh_dispatch_vertices(wh_ctx *c, wh_dispatch *d, const wh_parcel *p);

#endif
