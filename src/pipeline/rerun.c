#include "pipeline/rerun.h"

#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

const char *wh_rerun_name(uint32_t k, wh_rerun_file name)
{
	(void)snprintf(name, sizeof(wh_rerun_file), "collapses-%u", k);
	return name;
}

/* Bytes of a collapse with its attributes. */
static size_t record(const wh_rerun *r)
{
	return sizeof(wh_collapse) + r->attr_bytes;
}

static wh_code make_room(wh_ctx *c, wh_rerun *r)
{
	return wh_renew(c, &r->buf, &r->cap, WH_RERUN_BUFFER * record(r), 1);
}

wh_code wh_rerun_begin(wh_ctx *c, wh_rerun *r, wh_spill *spill, uint32_t k)
{
	wh_rerun_file name;
	char part[WH_SPILL_NAME];
	if (make_room(c, r) != WH_OK)
		return c->err.code;
	r->spill = spill;
	r->cluster = k;
	r->used = 0;
	r->off = 0;
	r->fd = wh_spill_create(c, spill, wh_spill_part(spill, wh_rerun_name(k, name), part));
	return r->fd >= 0 ? WH_OK : wh_failed(c);
}

static wh_code flush(wh_ctx *c, wh_rerun *r)
{
	const size_t n = r->used * record(r);
	const uint64_t at = r->off;
	r->used = 0;
	r->off += n;
	return wh_spill_pwrite(c, r->spill, r->fd, r->buf, n, at);
}

wh_code wh_rerun_put(wh_ctx *c, void *to, const wh_collapse *one, const uint8_t *attr)
{
	wh_rerun *r = to;
	uint8_t *at = r->buf + r->used++ * record(r);
	memcpy(at, one, sizeof *one);
	if (r->attr_bytes)
		memcpy(at + sizeof *one, attr, r->attr_bytes);
	return r->used < WH_RERUN_BUFFER ? WH_OK : flush(c, r);
}

wh_code wh_rerun_end(wh_ctx *c, wh_rerun *r, wh_code code)
{
	wh_rerun_file name;
	char part[WH_SPILL_NAME];
	if (code == WH_OK)
		code = flush(c, r);
	(void)close(r->fd);
	if (code != WH_OK)
		return code;
	(void)wh_spill_part(r->spill, wh_rerun_name(r->cluster, name), part);
	return wh_spill_rename(c, r->spill, part, name);
}

static wh_code damaged(wh_ctx *c, const wh_rerun *r)
{
	return wh_fail(c, WH_E_RUN, "a temporary file of collapses in '%s' is damaged",
	               r->spill->dir);
}

/* Reads what comes next into the buffer. */
static wh_code fill(wh_ctx *c, wh_rerun *r, uint64_t size)
{
	const uint64_t left = (size - r->off) / record(r);
	if (left == 0)
		return damaged(c, r);
	r->used = left < WH_RERUN_BUFFER ? (uint32_t)left : WH_RERUN_BUFFER;
	const uint64_t at = r->off;
	r->off += r->used * record(r);
	return wh_spill_pread(c, r->spill, r->fd, r->buf, r->used * record(r), at);
}

/* Both vertices are there still: so nothing goes in circles either. */
static bool is_possible(const wh_rerun *r, const wh_patch *p, const wh_collapse *one)
{
	return one->u < p->nv && one->v < p->nv && one->u != one->v && r->into[one->u] == one->u &&
	       r->into[one->v] == one->v;
}

static wh_code perform(wh_ctx *c, wh_rerun *r, uint64_t size, wh_rerun_limit limit, wh_patch *p,
                       wh_simplify_result *result)
{
	while (limit.faces && limit.collapses && r->off < size) {
		if (wh_poll(c) != WH_OK || fill(c, r, size) != WH_OK)
			return c->err.code;
		for (uint32_t i = 0; i < r->used && limit.collapses; i++) {
			const uint8_t *at = r->buf + i * record(r);
			wh_collapse one;
			memcpy(&one, at, sizeof one);
			if (one.faces > limit.faces)
				return WH_OK;
			if (!is_possible(r, p, &one))
				return damaged(c, r);
			wh_redo(p, r->into, &one);
			if (r->attr_bytes)
				memcpy(wh_patch_attr(p, one.v), at + sizeof one, r->attr_bytes);
			wh_simplify_result_note(result, one.cost, one.weight, (double)one.err);
			limit.faces -= one.faces;
			limit.collapses--;
		}
	}
	return WH_OK;
}

wh_code wh_rerun_perform(wh_ctx *c, wh_rerun *r, wh_spill *spill, uint32_t k, wh_rerun_limit limit,
                         wh_patch *p, wh_simplify_result *result)
{
	wh_rerun_file name;
	struct stat st;
	(void)wh_rerun_name(k, name);
	*result = (wh_simplify_result){0};
	if (make_room(c, r) != WH_OK ||
	    wh_renew(c, &r->into, &r->cap_into, p->nv, sizeof *r->into) != WH_OK)
		return c->err.code;
	r->spill = spill;
	r->off = 0;
	r->fd = wh_spill_read(c, spill, name);
	if (r->fd < 0)
		return wh_failed(c);
	wh_redo_begin(p, r->into);
	wh_code code =
	    fstat(r->fd, &st) == 0 ? WH_OK : wh_fail_errno(c, "cannot look at '%s'", name);
	if (code == WH_OK)
		code = perform(c, r, (uint64_t)st.st_size, limit, p, result);
	(void)close(r->fd);
	wh_redo_end(p, r->into);
	wh_spill_remove(spill, name);
	return code;
}

void wh_rerun_free(wh_ctx *c, wh_rerun *r)
{
	wh_free(c, r->buf);
	wh_free(c, r->into);
	*r = (wh_rerun){0};
}
