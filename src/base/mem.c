#define _GNU_SOURCE
#include "base/mem.h"

#include <sched.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

enum {
	ALIGN = 64,
	MAP_FROM = 128 * 1024,
	SPARE_MIB = 16 /* of a ceiling, for what the account does not see */
};

typedef enum origin {
	FROM_LIBRARY,
	FRESH, /* pages of the system's, zero when they were taken */
	KEPT   /* pages of a block that was freed */
} origin;

/* Sits in the ALIGN bytes in front of every block. */
typedef struct head {
	size_t total; /* bytes including this header */
	origin origin;
} head;

_Static_assert(sizeof(head) <= ALIGN, "the header fits in front of an aligned block");

static head *head_of(void *block)
{
	return (head *)(void *)((char *)block - ALIGN);
}

static void raise_to(_Atomic size_t *most, size_t now)
{
	size_t old = atomic_load_explicit(most, memory_order_relaxed);
	while (now > old && !atomic_compare_exchange_weak(most, &old, now)) {
	}
}

static bool account_take(wh_mem *m, size_t bytes)
{
	if (atomic_load_explicit(&m->fail_after, memory_order_relaxed) > 0 &&
	    atomic_fetch_sub(&m->fail_after, 1) == 1)
		return false;
	const size_t now = atomic_fetch_add(&m->used, bytes) + bytes;
	if (m->limit && now > m->limit) {
		atomic_fetch_sub(&m->used, bytes);
		return false;
	}
	raise_to(&m->peak, now);
	raise_to(&m->high, now);
	return true;
}

static void *refuse(wh_ctx *c, size_t bytes)
{
	const wh_code code = c->mem->limit ? WH_E_PLAN : WH_E_RUN;
	const size_t held = atomic_load(&c->mem->used);
	(void)wh_fail(c, code,
	              "out of memory: %zu more bytes do not fit (%zu held, %zu allowed); use "
	              "--memory %zuM or more",
	              bytes, held, c->mem->limit, ((held + bytes) >> 20) + SPARE_MIB);
	return NULL;
}

static size_t whole_pages(size_t bytes)
{
	const size_t page = (size_t)sysconf(_SC_PAGESIZE);
	return (bytes + page - 1) / page * page;
}

/* What a block takes: whole pages where it has pages of its own. 0: too much. */
static size_t total_bytes(size_t count, size_t size)
{
	size_t bytes;
	if (__builtin_mul_overflow(count, size, &bytes) || bytes > SIZE_MAX / 2)
		return 0;
	bytes += ALIGN;
	return bytes < MAP_FROM ? bytes : whole_pages(bytes);
}

/* Has the system lay the pages from..end of a block at once: a page that is first touched in the
 * midst of work costs twenty times as much on virtual machines. Older systems do not know how. */
static void touch(char *block, size_t from, size_t end)
{
	(void)madvise(block + from, end - from, MADV_POPULATE_WRITE);
}

/* ---- freed blocks that are kept ------------------------------------------------------------- */

/* Sanitizers would not see a use of what has been freed. */
#ifdef WH_SANITIZED
static const uint32_t MOST_KEPT = 0;
#else
static const uint32_t MOST_KEPT = WH_MEM_KEPT;
#endif

static void lock(wh_mem *m)
{
	while (atomic_exchange_explicit(&m->busy, true, memory_order_acquire))
		(void)sched_yield();
}

static void unlock(wh_mem *m)
{
	atomic_store_explicit(&m->busy, false, memory_order_release);
}

static wh_kept take_kept(wh_mem *m, uint32_t i)
{
	const wh_kept k = m->kept[i];
	m->n_kept--;
	memmove(&m->kept[i], &m->kept[i + 1], (m->n_kept - i) * sizeof k);
	m->kept_bytes -= k.bytes;
	return k;
}

/* Puts a block in its place among those kept; one with those that it touches. False: no room. */
static bool put_kept(wh_mem *m, char *at, size_t bytes)
{
	uint32_t i = 0;
	while (i < m->n_kept && m->kept[i].at < at)
		i++;
	if (i > 0 && m->kept[i - 1].at + m->kept[i - 1].bytes == at) {
		const wh_kept before = take_kept(m, --i);
		at = before.at;
		bytes += before.bytes;
	}
	if (i < m->n_kept && at + bytes == m->kept[i].at)
		bytes += take_kept(m, i).bytes;
	if (m->n_kept >= MOST_KEPT)
		return false;
	memmove(&m->kept[i + 1], &m->kept[i], (m->n_kept - i) * sizeof *m->kept);
	m->kept[i] = (wh_kept){at, bytes};
	m->n_kept++;
	m->kept_bytes += bytes;
	return true;
}

/* The place of the smallest kept block of so many bytes, else of the largest of all. */
static uint32_t best_kept(const wh_mem *m, size_t bytes)
{
	uint32_t best = 0;
	for (uint32_t i = 1; i < m->n_kept; i++) {
		const size_t b = m->kept[best].bytes, x = m->kept[i].bytes;
		if (b < bytes ? x > b : x >= bytes && x < b)
			best = i;
	}
	return best;
}

/* Gives kept blocks back until they and those held are no more than the peak, or all of them. */
static void trim(wh_mem *m, bool all)
{
	lock(m);
	while (m->n_kept &&
	       (all || atomic_load(&m->used) + m->kept_bytes > atomic_load(&m->peak))) {
		const wh_kept k = take_kept(m, m->n_kept - 1);
		(void)munmap(k.at, k.bytes);
	}
	unlock(m);
}

static void keep(wh_mem *m, void *at, size_t bytes)
{
	lock(m);
	const bool fits = atomic_load(&m->used) + m->kept_bytes + bytes <= atomic_load(&m->peak) &&
	                  put_kept(m, at, bytes);
	unlock(m);
	if (!fits)
		(void)munmap(at, bytes);
}

/* A kept block, cut or grown to whole pages of so many bytes; NULL: there is none. */
static void *reuse(wh_mem *m, size_t bytes)
{
	lock(m);
	const wh_kept k = m->n_kept ? take_kept(m, best_kept(m, bytes)) : (wh_kept){NULL, 0};
	unlock(m);
	if (!k.at || k.bytes == bytes)
		return k.at;
	if (k.bytes > bytes) {
		keep(m, (char *)k.at + bytes, k.bytes - bytes);
		return k.at;
	}
	trim(m, false);
	void *p = mremap(k.at, k.bytes, bytes, MREMAP_MAYMOVE);
	if (p != MAP_FAILED) {
		touch(p, k.bytes, bytes);
		return p;
	}
	keep(m, k.at, k.bytes);
	return NULL;
}

/* ---- blocks --------------------------------------------------------------------------------- */

static void *map(wh_mem *m, size_t bytes)
{
	void *p = mmap(NULL, bytes, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
	if (p == MAP_FAILED) {
		trim(m, true);
		p = mmap(NULL, bytes, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
	}
	if (p == MAP_FAILED)
		return NULL;
	touch(p, 0, bytes);
	return p;
}

/* A block with pages of its own, larger or smaller. One that was put together of several may not be
 * moved as a whole: then it is copied. NULL: neither was possible. */
static void *move(wh_mem *m, void *block, size_t old, size_t bytes)
{
	void *p = mremap(block, old, bytes, MREMAP_MAYMOVE);
	if (p != MAP_FAILED) {
		if (old < bytes)
			touch(p, old, bytes);
		return p;
	}
	p = map(m, bytes);
	if (!p)
		return NULL;
	memcpy(p, block, old < bytes ? old : bytes);
	(void)munmap(block, old);
	return p;
}

/* A block that the account has room for. */
static head *take(wh_mem *m, size_t total)
{
	head *h;
	if (total < MAP_FROM) {
		h = aligned_alloc(ALIGN, (total + ALIGN - 1) / ALIGN * ALIGN);
		if (h)
			h->origin = FROM_LIBRARY;
		return h;
	}
	h = reuse(m, total);
	if (h) {
		h->origin = KEPT;
		return h;
	}
	trim(m, false);
	h = map(m, total);
	if (h)
		h->origin = FRESH;
	return h;
}

void *wh_alloc(wh_ctx *c, size_t count, size_t size)
{
	const size_t total = total_bytes(count, size);
	if (total == 0 || !account_take(c->mem, total))
		return refuse(c, total ? total : SIZE_MAX);
	head *h = take(c->mem, total);
	if (!h) {
		atomic_fetch_sub(&c->mem->used, total);
		return refuse(c, total);
	}
	h->total = total;
	return (char *)h + ALIGN;
}

void *wh_calloc(wh_ctx *c, size_t count, size_t size)
{
	void *p = wh_alloc(c, count, size);
	if (p && head_of(p)->origin != FRESH) /* fresh pages are zero already */
		memset(p, 0, head_of(p)->total - ALIGN);
	return p;
}

void wh_mem_scattered(void *block)
{
	const size_t large = (size_t)2 << 20;
	char *start = block;
	if (!block || head_of(block)->origin == FROM_LIBRARY)
		return;
	char *end = start + head_of(block)->total - ALIGN;
	start +=
	    (large - (uintptr_t)start % large) % large; /* what is beside them stays as it is */
	if (start < end && (size_t)(end - start) >= large)
		(void)madvise(start, (size_t)(end - start) / large * large, MADV_HUGEPAGE);
}

void *wh_resize(wh_ctx *c, void *block, size_t count, size_t size)
{
	if (!block)
		return wh_alloc(c, count, size);
	head *h = head_of(block);
	const size_t old = h->total;
	const size_t total = total_bytes(count, size);
	if (total == 0)
		return refuse(c, SIZE_MAX);
	if (h->origin != FROM_LIBRARY && total >= MAP_FROM) {
		if (total > old && !account_take(c->mem, total - old))
			return refuse(c, total - old);
		trim(c->mem, false);
		void *p = move(c->mem, h, old, total);
		if (!p) {
			if (total > old)
				atomic_fetch_sub(&c->mem->used, total - old);
			return refuse(c, total);
		}
		if (total < old)
			atomic_fetch_sub(&c->mem->used, old - total);
		h = p;
		h->total = total;
		return (char *)h + ALIGN;
	}
	void *p = wh_alloc(c, count, size);
	if (!p)
		return NULL;
	memcpy(p, block, (old < total ? old : total) - ALIGN);
	wh_free(c, block);
	return p;
}

void wh_free(wh_ctx *c, void *block)
{
	if (!block)
		return;
	head *h = head_of(block);
	const size_t total = h->total;
	const bool was_last = atomic_fetch_sub(&c->mem->used, total) == total;
	if (h->origin == FROM_LIBRARY)
		free(h);
	else
		keep(c->mem, h, total);
	if (was_last)
		trim(c->mem, true);
}

void wh_mem_trim(wh_ctx *c)
{
	trim(c->mem, true);
}

wh_code wh_reserve(wh_ctx *c, void *array_ptr, size_t *cap, size_t need, size_t size)
{
	if (need <= *cap)
		return WH_OK;
	size_t grown = *cap < 16 ? 16 : *cap * 2;
	if (grown < need)
		grown = need;
	void *old;
	memcpy(&old, array_ptr, sizeof old);
	void *p = wh_resize(c, old, grown, size);
	if (!p)
		return c->err.code;
	memcpy(array_ptr, &p, sizeof p);
	*cap = grown;
	return WH_OK;
}

wh_code wh_renew(wh_ctx *c, void *array_ptr, size_t *cap, size_t need, size_t size)
{
	if (need <= *cap)
		return WH_OK;
	void *p;
	memcpy(&p, array_ptr, sizeof p);
	wh_free(c, p);
	p = wh_alloc(c, need, size);
	memcpy(array_ptr, &p, sizeof p);
	*cap = p ? need : 0;
	return p ? WH_OK : c->err.code;
}

char *wh_strdup(wh_ctx *c, const char *s)
{
	const size_t n = strlen(s) + 1;
	char *p = wh_alloc(c, n, 1);
	if (p)
		memcpy(p, s, n);
	return p;
}
