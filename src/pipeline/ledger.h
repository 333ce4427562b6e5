/*
 * ledger: which clusters of a round are done, in a file of a kept spill folder, so that a run that
 * was killed need not do them again.
 *
 * An entry says that a piece of work on a cluster is done and what came out of it besides files;
 * it is written when those have their names. A job asks for its entry first. The file is a row of
 * records, in the byte order of the machine:
 *
 *     offset  bytes  content
 *          0      4  piece of work: one of wh_ledger_kind
 *          4      4  cluster
 *          8      4  bytes of what follows the record's head
 *         12      4  zero
 *         16      8  XXH3 of the head before it, and of what follows
 *         24         what follows
 *
 * A record that is not whole ends the row, whatever is behind it: that work is done again. Of two
 * about the same the later one holds. Memory: eight bytes for each kind and cluster.
 *
 * Several processes that share a round keep a ledger each, NAME.WORD beside the NAME of the one
 * that goes on from there; the latter takes over what is in theirs.
 */
#ifndef WH_PIPELINE_LEDGER_H
#define WH_PIPELINE_LEDGER_H

#include "pipeline/store.h"

#include <pthread.h>

typedef enum wh_ledger_kind {
	WH_LEDGER_SAVED, /* the cluster's file in the store that the round fills */
	WH_LEDGER_TRIAL, /* the file of its collapses */
	WH_LEDGER_KINDS
} wh_ledger_kind;

enum { WH_LEDGER_NAME = 32 };

typedef struct wh_ledger {
	wh_spill *spill;
	char name[WH_LEDGER_NAME];
	int fd;
	uint32_t clusters;
	uint64_t end;                  /* of the whole records */
	uint64_t *at[WH_LEDGER_KINDS]; /* where the record of each cluster is; 0: none */
	pthread_mutex_t growing;       /* held while a record is appended */
	uint32_t part, parts;          /* this process does every parts-th cluster; 0 parts: all */
	bool helps;  /* and then those of the other parts that are not there yet */
	bool trusts; /* a saved cluster is taken for whole when its header is that of the entry: who
	                loads it looks at the rest */
} wh_ledger;

/* Opens the ledger of that name for a round over so many clusters; what is in it holds. */
wh_code wh_ledger_open(wh_ctx *c, wh_ledger *l, wh_spill *spill, const char *name,
                       uint32_t clusters);
/* Takes over the entries of the ledgers of its folder that are called NAME or NAME.WORD. */
wh_code wh_ledger_take(wh_ctx *c, wh_ledger *l, const char *name);
/*
 * The order in which this process goes through the clusters of a round: by turns, of which some are
 * of none (wh_ledger_turn is false). Its own come first, upwards. Where it helps, it goes on with
 * those of the others, downwards, so that it meets each of them late, and every process begins with
 * another neighbour: what has its file by then is passed over, and the little that two do at the
 * same time comes out the same. NULL: all are its own.
 */
uint32_t wh_ledger_turns(const wh_ledger *l, uint32_t clusters);
bool wh_ledger_turn(const wh_ledger *l, uint32_t clusters, int64_t turn, uint32_t *cluster);
/* True for a cluster that is this process' own. */
static inline bool wh_ledger_owns(const wh_ledger *l, uint32_t cluster)
{
	return !l || l->parts == 0 || cluster % l->parts == l->part;
}
/* Closes it; the file stays. A ledger of zeros is left alone. */
void wh_ledger_close(wh_ctx *c, wh_ledger *l);

/* Adds an entry. Thread-safe. */
wh_code wh_ledger_put(wh_ctx *c, wh_ledger *l, wh_ledger_kind kind, uint32_t cluster,
                      const void *bytes, uint32_t n);
/* Bytes of an entry that was there when the ledger was opened, or was taken; 0: none. NULL is an
 * empty ledger. */
uint32_t wh_ledger_bytes(wh_ctx *c, const wh_ledger *l, wh_ledger_kind kind, uint32_t cluster);
/* Reads it. */
wh_code wh_ledger_get(wh_ctx *c, const wh_ledger *l, wh_ledger_kind kind, uint32_t cluster,
                      void *bytes, uint32_t n);

/*
 * The same for a cluster that was saved, with the checksum of its file. wh_ledger_is_saved: true,
 * with `result` filled, when there is an entry and the file is whole and the one it speaks of.
 * Nothing is recorded as a failure. Both do nothing where the store has no ledger.
 */
wh_code wh_ledger_saved(wh_ctx *c, const wh_store *store, uint32_t cluster, const void *result,
                        uint32_t n);
bool wh_ledger_is_saved(wh_ctx *c, const wh_store *store, uint32_t cluster, wh_store_workspace *ws,
                        void *result, uint32_t n);

#endif
