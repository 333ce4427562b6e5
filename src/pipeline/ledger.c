#include "pipeline/ledger.h"

#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include <xxhash.h>

typedef struct head {
	uint32_t kind, cluster, bytes, zero;
	uint64_t checksum;
} head;

_Static_assert(sizeof(head) == 24, "the head has the documented size");

enum {
	MOST = 1 << 20,  /* bytes of an entry */
	SAVED_MOST = 512 /* the same, of a saved cluster */
};

static uint64_t checksum_of(const head *h, const void *bytes)
{
	return XXH3_64bits_withSeed(bytes, h->bytes, XXH3_64bits(h, offsetof(head, checksum)));
}

/* ---- opening ------------------------------------------------------------------------------ */

/* The record at l->end. False when there is no whole one. */
static wh_code read_record(wh_ctx *c, wh_ledger *l, uint64_t size, head *h, uint8_t **buf,
                           size_t *cap, bool *whole)
{
	*whole = false;
	if (size - l->end < sizeof *h)
		return WH_OK;
	if (wh_spill_pread(c, l->spill, l->fd, h, sizeof *h, l->end) != WH_OK)
		return c->err.code;
	if (h->kind >= WH_LEDGER_KINDS || h->cluster >= l->clusters || h->zero != 0 ||
	    h->bytes > MOST || h->bytes > size - l->end - sizeof *h)
		return WH_OK;
	if (wh_renew(c, buf, cap, (size_t)h->bytes + 1, 1) != WH_OK ||
	    wh_spill_pread(c, l->spill, l->fd, *buf, h->bytes, l->end + sizeof *h) != WH_OK)
		return c->err.code;
	*whole = checksum_of(h, *buf) == h->checksum;
	return WH_OK;
}

static wh_code read_all(wh_ctx *c, wh_ledger *l)
{
	struct stat st;
	uint8_t *buf = NULL;
	size_t cap = 0;
	head h;
	bool whole = true;
	if (fstat(l->fd, &st) != 0)
		return wh_fail_errno(c, "cannot look at '%s/%s'", l->spill->dir, l->name);
	wh_code code = WH_OK;
	while (code == WH_OK && whole) {
		code = read_record(c, l, (uint64_t)st.st_size, &h, &buf, &cap, &whole);
		if (code != WH_OK || !whole)
			break;
		l->at[h.kind][h.cluster] = l->end + 1;
		l->end += sizeof h + h.bytes;
	}
	wh_free(c, buf);
	return code;
}

static int open_file(wh_ctx *c, const wh_ledger *l)
{
	wh_ctx own = wh_ctx_fork(c);
	const int fd = wh_spill_reopen(&own, l->spill, l->name);
	return fd >= 0 ? fd : wh_spill_create(c, l->spill, l->name);
}

wh_code wh_ledger_open(wh_ctx *c, wh_ledger *l, wh_spill *spill, const char *name,
                       uint32_t clusters)
{
	*l = (wh_ledger){.spill = spill, .fd = -1, .clusters = clusters};
	(void)snprintf(l->name, sizeof l->name, "%s", name);
	(void)pthread_mutex_init(&l->growing, NULL);
	for (int i = 0; i < WH_LEDGER_KINDS; i++)
		l->at[i] = wh_calloc(c, clusters, sizeof *l->at[i]);
	wh_code code = c->err.code;
	if (code == WH_OK)
		l->fd = open_file(c, l);
	if (code == WH_OK)
		code = l->fd >= 0 ? read_all(c, l) : wh_failed(c);
	if (code != WH_OK)
		wh_ledger_close(c, l);
	return code;
}

/* ---- those of others ---------------------------------------------------------------------- */

typedef struct taking {
	wh_ctx *c;
	wh_ledger *l;
	const char *name;
} taking;

/* Copies the entries that `to` does not have, and can find them from now on. */
static wh_code copy_entries(wh_ctx *c, const wh_ledger *from, wh_ledger *to)
{
	uint8_t *buf = NULL;
	size_t cap = 0;
	wh_code code = WH_OK;
	for (uint32_t i = 0; code == WH_OK && i < WH_LEDGER_KINDS * to->clusters; i++) {
		const wh_ledger_kind kind = (wh_ledger_kind)(i / to->clusters);
		const uint32_t k = i % to->clusters;
		if (from->at[kind][k] == 0 || to->at[kind][k] != 0)
			continue;
		const uint32_t n = wh_ledger_bytes(c, from, kind, k);
		const uint64_t at = to->end + 1;
		code = wh_renew(c, &buf, &cap, (size_t)n + 1, 1);
		if (code == WH_OK)
			code = wh_ledger_get(c, from, kind, k, buf, n);
		if (code == WH_OK)
			code = wh_ledger_put(c, to, kind, k, buf, n);
		if (code == WH_OK)
			to->at[kind][k] = at;
	}
	wh_free(c, buf);
	return code;
}

static bool see_ledger(void *to, const char *name)
{
	const taking *t = to;
	wh_ledger *l = t->l, other = {.spill = l->spill, .fd = -1, .clusters = l->clusters};
	const size_t n = strlen(name), base = strlen(t->name);
	if (strncmp(name, t->name, base) != 0 || (name[base] != '\0' && name[base] != '.') ||
	    strcmp(name, l->name) == 0 || n >= sizeof other.name)
		return true;
	memcpy(other.name, name, n + 1);
	(void)pthread_mutex_init(&other.growing, NULL);
	wh_ctx own = wh_ctx_fork(t->c);
	other.fd = wh_spill_read(&own, l->spill, name);
	bool ok = other.fd >= 0; /* one that has just gone has nothing to say */
	for (int i = 0; ok && i < WH_LEDGER_KINDS; i++)
		ok = (other.at[i] = wh_calloc(&own, l->clusters, sizeof *other.at[i])) != NULL;
	if (ok && read_all(&own, &other) == WH_OK)
		(void)copy_entries(t->c, &other, l);
	wh_ledger_close(t->c, &other);
	return t->c->err.code == WH_OK;
}

wh_code wh_ledger_take(wh_ctx *c, wh_ledger *l, const char *name)
{
	taking t = {.c = c, .l = l, .name = name};
	wh_spill_each(l->spill, see_ledger, &t);
	return c->err.code;
}

void wh_ledger_close(wh_ctx *c, wh_ledger *l)
{
	if (!l->spill)
		return;
	if (l->fd >= 0)
		(void)close(l->fd);
	for (int i = 0; i < WH_LEDGER_KINDS; i++)
		wh_free(c, l->at[i]);
	(void)pthread_mutex_destroy(&l->growing);
	*l = (wh_ledger){0};
}

/* ---- turns -------------------------------------------------------------------------------- */

/* Clusters lie in rows of one for each part; the last row may not be full. */
static uint32_t rows_of(const wh_ledger *l, uint32_t clusters)
{
	return clusters / l->parts + (clusters % l->parts != 0);
}

uint32_t wh_ledger_turns(const wh_ledger *l, uint32_t clusters)
{
	if (!l || l->parts == 0)
		return clusters;
	return rows_of(l, clusters) * (l->helps ? l->parts : 1);
}

bool wh_ledger_turn(const wh_ledger *l, uint32_t clusters, int64_t turn, uint32_t *cluster)
{
	uint64_t k = (uint64_t)turn;
	if (l && l->parts > 0) {
		const uint32_t rows = rows_of(l, clusters);
		uint64_t row = k, to_neighbour = 0;
		if (k >= rows) {
			row = rows - 1 - (k - rows) / (l->parts - 1);
			to_neighbour = 1 + (k - rows) % (l->parts - 1);
		}
		k = row * l->parts + (l->part + to_neighbour) % l->parts;
	}
	*cluster = (uint32_t)k;
	return k < clusters;
}

/* ---- entries ------------------------------------------------------------------------------ */

wh_code wh_ledger_put(wh_ctx *c, wh_ledger *l, wh_ledger_kind kind, uint32_t cluster,
                      const void *bytes, uint32_t n)
{
	head h = {.kind = (uint32_t)kind, .cluster = cluster, .bytes = n};
	h.checksum = checksum_of(&h, bytes);
	uint8_t *record = wh_alloc(c, sizeof h + n, 1);
	if (!record)
		return c->err.code;
	memcpy(record, &h, sizeof h);
	if (n)
		memcpy(record + sizeof h, bytes, n);
	(void)pthread_mutex_lock(&l->growing);
	const wh_code code = wh_spill_pwrite(c, l->spill, l->fd, record, sizeof h + n, l->end);
	if (code == WH_OK)
		l->end += sizeof h + n;
	(void)pthread_mutex_unlock(&l->growing);
	wh_free(c, record);
	return code;
}

uint32_t wh_ledger_bytes(wh_ctx *c, const wh_ledger *l, wh_ledger_kind kind, uint32_t cluster)
{
	head h;
	if (!l || l->at[kind][cluster] == 0 ||
	    wh_spill_pread(c, l->spill, l->fd, &h, sizeof h, l->at[kind][cluster] - 1) != WH_OK)
		return 0;
	return h.bytes;
}

wh_code wh_ledger_get(wh_ctx *c, const wh_ledger *l, wh_ledger_kind kind, uint32_t cluster,
                      void *bytes, uint32_t n)
{
	return wh_spill_pread(c, l->spill, l->fd, bytes, n,
	                      l->at[kind][cluster] - 1 + sizeof(head));
}

/* ---- saved clusters ----------------------------------------------------------------------- */

wh_code wh_ledger_saved(wh_ctx *c, const wh_store *store, uint32_t cluster, const void *result,
                        uint32_t n)
{
	uint8_t entry[SAVED_MOST];
	uint64_t checksum;
	if (!store->ledger || n > SAVED_MOST - sizeof checksum)
		return WH_OK;
	if (wh_store_checksum(c, store, cluster, &checksum) != WH_OK)
		return c->err.code;
	memcpy(entry, &checksum, sizeof checksum);
	memcpy(entry + sizeof checksum, result, n);
	return wh_ledger_put(c, store->ledger, WH_LEDGER_SAVED, cluster, entry,
	                     (uint32_t)sizeof checksum + n);
}

bool wh_ledger_is_saved(wh_ctx *c, const wh_store *store, uint32_t cluster, wh_store_workspace *ws,
                        void *result, uint32_t n)
{
	uint8_t entry[SAVED_MOST];
	uint64_t checksum, found;
	const uint32_t bytes = (uint32_t)sizeof checksum + n;
	wh_ctx own = wh_ctx_fork(c);
	if (wh_ledger_bytes(&own, store->ledger, WH_LEDGER_SAVED, cluster) != bytes ||
	    wh_ledger_get(&own, store->ledger, WH_LEDGER_SAVED, cluster, entry, bytes) != WH_OK)
		return false;
	if ((store->ledger->trusts ? wh_store_checksum(&own, store, cluster, &found)
	                           : wh_store_verify(&own, store, cluster, ws, &found)) != WH_OK)
		return false;
	memcpy(&checksum, entry, sizeof checksum);
	if (checksum != found)
		return false;
	memcpy(result, entry + sizeof checksum, n);
	return true;
}
