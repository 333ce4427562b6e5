#include "base/idmap.h"

#include "base/rng.h"

enum { LEAST_SLOTS = 64 };

/* The slot of an id, or the free one where it belongs. */
static size_t find(const uint64_t *slot, size_t slots, uint64_t id)
{
	size_t i = (size_t)wh_mix64(id) & (slots - 1);
	while (slot[2 * i] != 0 && slot[2 * i] != id + 1)
		i = (i + 1) & (slots - 1);
	return i;
}

static wh_code grow(wh_ctx *c, wh_idmap *m)
{
	const size_t slots = m->slots ? 2 * m->slots : LEAST_SLOTS;
	uint64_t *slot = wh_calloc(c, slots, 2 * sizeof *slot);
	if (!slot)
		return c->err.code;
	for (size_t i = 0; i < m->slots; i++) {
		if (m->slot[2 * i] == 0)
			continue;
		const size_t to = find(slot, slots, m->slot[2 * i] - 1);
		slot[2 * to] = m->slot[2 * i];
		slot[2 * to + 1] = m->slot[2 * i + 1];
	}
	wh_free(c, m->slot);
	m->slot = slot;
	m->slots = slots;
	return WH_OK;
}

uint64_t *wh_idmap_put(wh_ctx *c, wh_idmap *m, uint64_t id, bool *fresh)
{
	if (4 * (m->n + 1) > 3 * m->slots && grow(c, m) != WH_OK)
		return NULL;
	const size_t i = find(m->slot, m->slots, id);
	*fresh = m->slot[2 * i] == 0;
	m->n += *fresh;
	m->slot[2 * i] = id + 1;
	return &m->slot[2 * i + 1];
}

const uint64_t *wh_idmap_get(const wh_idmap *m, uint64_t id)
{
	if (m->slots == 0)
		return NULL;
	const size_t i = find(m->slot, m->slots, id);
	return m->slot[2 * i] ? &m->slot[2 * i + 1] : NULL;
}

void wh_idmap_free(wh_ctx *c, wh_idmap *m)
{
	wh_free(c, m->slot);
	*m = (wh_idmap){0};
}
