#include "io/names.h"

#include <stdio.h>
#include <string.h>

#include <xxhash.h>

/* Another hash for each try, should two names ever have the same one. */
static uint64_t hash_of(const char *s, size_t n, uint64_t attempt)
{
	return XXH3_64bits_withSeed(s, n, attempt) >> 1;
}

static bool is(const char *item, const char *s, size_t n)
{
	return strlen(item) == n && memcmp(item, s, n) == 0;
}

uint32_t wh_names_find(const wh_names *l, const char *s, size_t n)
{
	for (uint64_t attempt = 0;; attempt++) {
		const uint64_t *at = wh_idmap_get(&l->place, hash_of(s, n, attempt));
		if (!at)
			return UINT32_MAX;
		if (is(l->item[*at], s, n))
			return (uint32_t)*at;
	}
}

static char *copy(wh_ctx *c, const char *s, size_t n)
{
	char *to = wh_alloc(c, n + 1, 1);
	if (to) {
		memcpy(to, s, n);
		to[n] = '\0';
	}
	return to;
}

wh_code wh_names_add(wh_ctx *c, wh_names *l, const char *s, size_t n, uint32_t *at)
{
	uint64_t *place, attempt = 0;
	bool fresh = false;
	*at = wh_names_find(l, s, n);
	if (*at != UINT32_MAX)
		return WH_OK;
	if (l->n == INT32_MAX)
		return wh_fail(c, WH_E_INPUT, "more than 2 G different names");
	if (wh_reserve(c, &l->item, &l->cap, (size_t)l->n + 1, sizeof *l->item) != WH_OK)
		return c->err.code;
	do
		place = wh_idmap_put(c, &l->place, hash_of(s, n, attempt++), &fresh);
	while (place && !fresh);
	char *name = place ? copy(c, s, n) : NULL;
	if (!name)
		return c->err.code;
	*place = *at = l->n;
	l->item[l->n++] = name;
	return WH_OK;
}

void wh_list_name(char *list, size_t size, const char *name)
{
	const size_t used = strlen(list), room = size - used;
	if (used >= 3 && strcmp(list + used - 3, "...") == 0)
		return;
	if (strlen(name) + sizeof ", ..." < room)
		(void)snprintf(list + used, room, "%s%s", used ? ", " : "", name);
	else
		(void)snprintf(list + used, room, "%s...", used ? ", " : "");
}

void wh_names_free(wh_ctx *c, wh_names *l)
{
	for (uint32_t i = 0; i < l->n; i++)
		wh_free(c, l->item[i]);
	wh_free(c, l->item);
	wh_idmap_free(c, &l->place);
	*l = (wh_names){0};
}
