#include "pipeline/bins.h"

wh_code wh_bin_file_open(wh_ctx *c, wh_bin_file *f, wh_spill *spill)
{
	*f = (wh_bin_file){.spill = spill, .fd = wh_spill_scratch(c, spill)};
	return f->fd >= 0 ? WH_OK : wh_failed(c);
}

void wh_bin_file_close(wh_bin_file *f)
{
	if (f->spill && f->fd >= 0)
		wh_spill_close_scratch(f->spill, f->fd);
	f->fd = -1;
}

wh_code wh_bins_open(wh_ctx *c, wh_bins *b, wh_bin_file *file, uint32_t n, size_t record,
                     size_t per_block)
{
	*b = (wh_bins){.file = file, .n = n, .record = record, .per_block = per_block};
	b->bin = wh_calloc(c, n, sizeof *b->bin);
	b->buffer = wh_alloc(c, n, record * per_block);
	return b->bin && b->buffer ? WH_OK : wh_failed(c);
}

void wh_bins_close(wh_ctx *c, wh_bins *b)
{
	for (uint32_t i = 0; b->bin && i < b->n; i++)
		wh_free(c, b->bin[i].block);
	wh_free(c, b->bin);
	wh_free(c, b->buffer);
	*b = (wh_bins){0};
}

static unsigned char *bin_buffer(const wh_bins *b, uint32_t i)
{
	return b->buffer + (size_t)i * b->record * b->per_block;
}

/* Writes the buffer of a bin, whose last block it stays until it is full again. */
static wh_code bin_write(wh_ctx *c, wh_bins *b, uint32_t i)
{
	wh_bin *k = &b->bin[i];
	const size_t bytes = b->record * b->per_block;
	if (k->used == 0)
		return WH_OK;
	if (wh_reserve(c, &k->block, &k->cap, k->blocks + 1, sizeof *k->block) != WH_OK)
		return c->err.code;
	k->block[k->blocks++] = atomic_fetch_add(&b->file->end, bytes);
	return wh_spill_pwrite(c, b->file->spill, b->file->fd, bin_buffer(b, i),
	                       k->used * b->record, k->block[k->blocks - 1]);
}

unsigned char *wh_bins_room(wh_ctx *c, wh_bins *b, uint32_t i)
{
	wh_bin *k = &b->bin[i];
	if (k->used == b->per_block) {
		if (bin_write(c, b, i) != WH_OK)
			return NULL;
		k->used = 0;
	}
	return bin_buffer(b, i) + b->record * k->used++;
}

wh_code wh_bins_end(wh_ctx *c, wh_bins *b)
{
	for (uint32_t i = 0; i < b->n; i++)
		if (bin_write(c, b, i) != WH_OK)
			return c->err.code;
	wh_free(c, b->buffer);
	b->buffer = NULL;
	return WH_OK;
}

wh_code wh_bins_read(wh_ctx *c, const wh_bins *b, uint32_t i, size_t k, void *to, size_t *n)
{
	const wh_bin *from = &b->bin[i];
	*n = k + 1 < from->blocks ? b->per_block : from->used;
	return wh_spill_pread(c, b->file->spill, b->file->fd, to, *n * b->record, from->block[k]);
}
