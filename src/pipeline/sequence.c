#include "pipeline/sequence.h"

#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

typedef char file_name[32];

static const char *name_of(uint32_t generation, uint32_t cluster, file_name name)
{
	(void)snprintf(name, sizeof(file_name), "sequence-%u-%u", generation, cluster);
	return name;
}

/* Bytes of a collapse with its attributes. */
static size_t record(uint32_t attr_bytes)
{
	return sizeof(wh_sequence_item) + attr_bytes;
}

/* ---- out ---------------------------------------------------------------------------------- */

wh_code wh_sequence_begin(wh_ctx *c, wh_sequence_writer *w, wh_spill *spill, uint32_t generation,
                          uint32_t cluster, const wh_patch *patch)
{
	file_name name;
	w->spill = spill;
	w->patch = patch;
	w->used = 0;
	w->off = 0;
	if (wh_renew(c, &w->buf, &w->cap, WH_SEQUENCE_BUFFER * record(patch->attr_bytes), 1) !=
	    WH_OK)
		return c->err.code;
	w->fd = wh_spill_create(c, spill, name_of(generation, cluster, name));
	return w->fd >= 0 ? WH_OK : wh_failed(c);
}

static wh_code flush(wh_ctx *c, wh_sequence_writer *w)
{
	const size_t n = w->used * record(w->patch->attr_bytes);
	const uint64_t at = w->off;
	w->used = 0;
	w->off += n;
	return wh_spill_pwrite(c, w->spill, w->fd, w->buf, n, at);
}

wh_code wh_sequence_put(wh_ctx *c, void *to, const wh_collapse *one, const uint8_t *attr)
{
	wh_sequence_writer *w = to;
	const wh_patch *p = w->patch;
	const wh_sequence_item item = {p->gid[one->u], p->gid[one->v], one->at, (float)one->cost,
	                               one->err};
	uint8_t *at = w->buf + w->used++ * record(p->attr_bytes);
	memcpy(at, &item, sizeof item);
	if (p->attr_bytes)
		memcpy(at + sizeof item, attr, p->attr_bytes);
	return w->used < WH_SEQUENCE_BUFFER ? WH_OK : flush(c, w);
}

wh_code wh_sequence_end(wh_ctx *c, wh_sequence_writer *w, wh_code code)
{
	if (code == WH_OK)
		code = flush(c, w);
	(void)close(w->fd);
	return code;
}

/* ---- which ones --------------------------------------------------------------------------- */

wh_code wh_sequence_keep(wh_ctx *c, wh_sequence *s, uint32_t generation, uint32_t clusters)
{
	if (wh_reserve(c, &s->part, &s->cap, s->n + 1, sizeof *s->part) != WH_OK)
		return c->err.code;
	s->part[s->n++] = (wh_sequence_part){generation, clusters};
	return WH_OK;
}

void wh_sequence_drop(wh_spill *spill, uint32_t generation, uint32_t clusters)
{
	file_name name;
	for (uint32_t k = 0; k < clusters; k++)
		wh_spill_remove(spill, name_of(generation, k, name));
}

void wh_sequence_free(wh_ctx *c, wh_sequence *s)
{
	wh_free(c, s->part);
	s->part = NULL;
	s->n = s->cap = 0;
}

/* ---- in ----------------------------------------------------------------------------------- */

/* Opens a file; *n: its collapses. Descriptor or -1. */
static int open_file(wh_ctx *c, const wh_sequence *s, uint32_t generation, uint32_t cluster,
                     uint64_t *n)
{
	file_name name;
	struct stat st;
	const int fd = wh_spill_read(c, s->spill, name_of(generation, cluster, name));
	if (fd < 0)
		return fd;
	if (fstat(fd, &st) != 0) {
		(void)wh_fail_errno(c, "cannot look at '%s/%s'", s->spill->dir, name);
		(void)close(fd);
		return -1;
	}
	*n = (uint64_t)st.st_size / record(s->attr_bytes);
	return fd;
}

wh_code wh_sequence_count(wh_ctx *c, const wh_sequence *s, uint64_t *n)
{
	*n = 0;
	for (size_t i = 0; i < s->n; i++)
		for (uint32_t k = 0; k < s->part[i].clusters; k++) {
			uint64_t one;
			const int fd = open_file(c, s, s->part[i].generation, k, &one);
			if (fd < 0)
				return wh_failed(c);
			(void)close(fd);
			*n += one;
		}
	return WH_OK;
}

/* What is read and shown. */
typedef struct showing {
	const wh_sequence *s;
	uint8_t *buf;
	wh_code (*see)(wh_ctx *c, void *to, const wh_sequence_item *item, const uint8_t *attr);
	void *to;
} showing;

static wh_code show_some(wh_ctx *c, const showing *w, size_t n)
{
	const size_t each = record(w->s->attr_bytes);
	for (size_t i = 0; i < n; i++) {
		wh_sequence_item item;
		const uint8_t *at = w->buf + i * each;
		memcpy(&item, at, sizeof item);
		if (w->see(c, w->to, &item, at + sizeof item) != WH_OK)
			return wh_failed(c);
	}
	return WH_OK;
}

static wh_code show_file(wh_ctx *c, const showing *w, int fd, uint64_t n)
{
	const size_t each = record(w->s->attr_bytes);
	for (uint64_t i = 0; i < n; i += WH_SEQUENCE_BUFFER) {
		const uint64_t left = n - i;
		const size_t some =
		    left < WH_SEQUENCE_BUFFER ? (size_t)left : (size_t)WH_SEQUENCE_BUFFER;
		if (wh_poll(c) != WH_OK ||
		    wh_spill_pread(c, w->s->spill, fd, w->buf, some * each, i * each) != WH_OK ||
		    show_some(c, w, some) != WH_OK)
			return c->err.code;
	}
	return WH_OK;
}

static wh_code show_all(wh_ctx *c, const showing *w)
{
	for (size_t i = 0; i < w->s->n; i++)
		for (uint32_t k = 0; k < w->s->part[i].clusters; k++) {
			uint64_t n;
			const int fd = open_file(c, w->s, w->s->part[i].generation, k, &n);
			const wh_code code = fd < 0 ? wh_failed(c) : show_file(c, w, fd, n);
			if (fd >= 0)
				(void)close(fd);
			if (code != WH_OK)
				return code;
		}
	return WH_OK;
}

wh_code wh_sequence_each(wh_ctx *c, const wh_sequence *s,
                         wh_code (*see)(wh_ctx *c, void *to, const wh_sequence_item *item,
                                        const uint8_t *attr),
                         void *to)
{
	const showing w = {.s = s,
	                   .buf = wh_alloc(c, WH_SEQUENCE_BUFFER, record(s->attr_bytes)),
	                   .see = see,
	                   .to = to};
	const wh_code code = w.buf ? show_all(c, &w) : wh_failed(c);
	wh_free(c, w.buf);
	return code;
}
