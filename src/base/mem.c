#define _GNU_SOURCE
#include "base/mem.h"

#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>

enum {
	ALIGN = 64,
	MAP_FROM = 128 * 1024,
	SPARE_MIB = 16 /* of a ceiling, for what the account does not see */
};

/* Sits in the ALIGN bytes in front of every block. */
typedef struct head {
	size_t total;  /* bytes including this header */
	size_t mapped; /* 1 when it came from mmap */
} head;

_Static_assert(sizeof(head) <= ALIGN, "the header fits in front of an aligned block");

static head *head_of(void *block)
{
	return (head *)(void *)((char *)block - ALIGN);
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
	size_t peak = atomic_load_explicit(&m->peak, memory_order_relaxed);
	while (now > peak && !atomic_compare_exchange_weak(&m->peak, &peak, now)) {
	}
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

static size_t total_bytes(size_t count, size_t size)
{
	size_t bytes;
	if (__builtin_mul_overflow(count, size, &bytes) || bytes > SIZE_MAX / 2)
		return 0;
	return bytes + ALIGN;
}

static head *system_take(size_t total)
{
	if (total < MAP_FROM) {
		head *h = aligned_alloc(ALIGN, (total + ALIGN - 1) / ALIGN * ALIGN);
		if (h)
			h->mapped = 0;
		return h;
	}
	void *p = mmap(NULL, total, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
	if (p == MAP_FAILED)
		return NULL;
	head *h = p;
	h->mapped = 1;
	return h;
}

void *wh_alloc(wh_ctx *c, size_t count, size_t size)
{
	const size_t total = total_bytes(count, size);
	if (total == 0 || !account_take(c->mem, total))
		return refuse(c, total ? total : SIZE_MAX);
	head *h = system_take(total);
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
	if (p && !head_of(p)->mapped) /* fresh mappings are zero already */
		memset(p, 0, head_of(p)->total - ALIGN);
	return p;
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
	if (h->mapped && total >= MAP_FROM) {
		if (total > old && !account_take(c->mem, total - old))
			return refuse(c, total - old);
		void *p = mremap(h, old, total, MREMAP_MAYMOVE);
		if (p == MAP_FAILED) {
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
	if (h->mapped)
		(void)munmap(h, total);
	else
		free(h);
	atomic_fetch_sub(&c->mem->used, total);
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
