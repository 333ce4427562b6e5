/*
 * names: a list of different names, each with its place: files, materials, groups.
 *
 * As long as it is not added to, it may be looked at by any number of threads.
 */
#ifndef WH_IO_NAMES_H
#define WH_IO_NAMES_H

#include "base/idmap.h"

typedef struct wh_names {
	char **item; /* owned */
	uint32_t n;
	size_t cap;
	wh_idmap place; /* of their hashes */
} wh_names;

/* Adds the n bytes at s unless they are there; *at becomes their place. */
wh_code wh_names_add(wh_ctx *c, wh_names *l, const char *s, size_t n, uint32_t *at);

/* The place of a name; UINT32_MAX when it is not there. */
uint32_t wh_names_find(const wh_names *l, const char *s, size_t n);

/* Appends a name to a list in words, "a, b", of so many bytes; one too long ends in "...". */
void wh_list_name(char *list, size_t size, const char *name);

void wh_names_free(wh_ctx *c, wh_names *l);

#endif
