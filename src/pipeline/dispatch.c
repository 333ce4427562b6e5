#include "pipeline/dispatch.h"

#include <string.h>

/* ---- parcels ------------------------------------------------------------------------------ */

wh_code wh_parcel_begin(wh_ctx *c, wh_parcel *p, uint32_t clusters, size_t size, size_t room)
{
	p->n = 0;
	p->size = size;
	if (!p->start || p->clusters != clusters) {
		wh_free(c, p->start);
		p->clusters = clusters;
		p->start = wh_alloc(c, (size_t)clusters + 1, sizeof *p->start);
		if (!p->start)
			return c->err.code;
	}
	if (wh_renew(c, &p->record, &p->record_cap, room * size, 1) != WH_OK ||
	    wh_renew(c, &p->cluster, &p->cluster_cap, room, sizeof *p->cluster) != WH_OK)
		return c->err.code;
	return WH_OK;
}

void wh_parcel_free(wh_ctx *c, wh_parcel *p)
{
	wh_free(c, p->record);
	wh_free(c, p->cluster);
	wh_free(c, p->start);
	*p = (wh_parcel){0};
}

size_t wh_parcel_bytes(uint32_t clusters, size_t size, size_t room)
{
	return room * (size + sizeof(uint16_t)) + ((size_t)clusters + 1) * sizeof(uint32_t) + 256;
}

/* Counting sort, its first half: start[k + 1] becomes the start of k's records. */
void wh_parcel_lay_out(wh_parcel *p)
{
	uint32_t *start = p->start;
	memset(start, 0, ((size_t)p->clusters + 1) * sizeof *start);
	for (size_t i = 0; i < p->n; i++)
		start[p->cluster[i] + 1]++;
	uint32_t sum = 0;
	for (uint32_t k = 1; k <= p->clusters; k++) {
		const uint32_t count = start[k];
		start[k] = sum;
		sum += count;
	}
}

/* ---- writers ------------------------------------------------------------------------------ */

size_t wh_dispatch_bytes(uint32_t clusters, size_t buffer)
{
	return clusters * (wh_store_writer_bytes(buffer) + sizeof(wh_store_writer)) + 256;
}

wh_code wh_dispatch_begin(wh_ctx *c, wh_dispatch *d, const wh_store *store, size_t buffer)
{
	*d = (wh_dispatch){.store = store};
	d->writer = wh_calloc(c, store->clusters, sizeof *d->writer);
	if (!d->writer)
		return c->err.code;
	for (uint32_t k = 0; k < store->clusters; k++)
		if (wh_store_begin(c, store, k, &d->writer[k], buffer) != WH_OK)
			return c->err.code;
	return WH_OK;
}

wh_code wh_dispatch_commit(wh_ctx *c, wh_dispatch *d)
{
	for (uint32_t k = 0; k < d->store->clusters; k++)
		if (wh_store_commit(c, d->store, k, &d->writer[k]) != WH_OK)
			return c->err.code;
	return WH_OK;
}

void wh_dispatch_drop(wh_ctx *c, wh_dispatch *d)
{
	for (uint32_t k = 0; d->writer && k < d->store->clusters; k++)
		wh_store_drop(c, &d->writer[k]);
	wh_free(c, d->writer);
	d->writer = NULL;
}

/* Records of cluster k go to its file; returns how many there are in *n. */
static wh_code append(wh_ctx *c, const wh_dispatch *d, const wh_parcel *p, uint32_t k, uint32_t *n)
{
	*n = p->start[k + 1] - p->start[k];
	return wh_store_append(c, d->store, k, &d->writer[k], p->record + p->start[k] * p->size,
	                       *n * p->size);
}

wh_code wh_dispatch_faces(wh_ctx *c, wh_dispatch *d, const wh_parcel *p)
{
	for (uint32_t k = 0, n; k < p->clusters; k++) {
		if (append(c, d, p, k, &n) != WH_OK)
			return c->err.code;
		d->writer[k].faces += n;
	}
	return WH_OK;
}

wh_code wh_dispatch_vertices(wh_ctx *c, wh_dispatch *d, const wh_parcel *p)
{
	for (uint32_t k = 0, n; k < p->clusters; k++) {
		if (append(c, d, p, k, &n) != WH_OK)
			return c->err.code;
		d->writer[k].vertices += n;
	}
	return WH_OK;
}
