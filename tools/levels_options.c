/* The lists of --levels and --levels-error: limits, their order, the names of their files. */
#include "cmd.h"
#include "reduce_options.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { ITEM = 32 }; /* bytes of an item of a list */

typedef struct item {
	char text[ITEM];
	wh_level level;
	double order; /* ascending: from the largest result to the least */
} item;

/* ---- limits ------------------------------------------------------------------------------- */

static bool parse_item(item *it, bool errors)
{
	wh_level *l = &it->level;
	*l = (wh_level){0};
	if (errors) {
		const bool ok = reduce_parse_error(it->text, &l->error, &l->error_share);
		it->order = l->error > 0 ? l->error : l->error_share;
		return ok;
	}
	const bool ok = reduce_parse_target(it->text, &l->faces, &l->face_ratio);
	it->order = l->faces ? -(double)l->faces : -l->face_ratio;
	return ok;
}

static bool is_share(const item *it)
{
	return it->level.face_ratio > 0 || it->level.error_share > 0;
}

static int compare_items(const void *a, const void *b)
{
	const item *x = a, *y = b;
	return (x->order > y->order) - (x->order < y->order);
}

/* Takes the list apart. Returns how many items there are; 0: it makes no sense. */
static size_t parse_list(const char *list, bool errors, item it[WH_LEVELS_MOST + 1])
{
	size_t n = 0;
	for (const char *at = list;; at++) {
		const size_t length = strcspn(at, ",");
		if (n > WH_LEVELS_MOST || length >= sizeof it->text)
			return 0;
		memcpy(it[n].text, at, length);
		it[n].text[length] = '\0';
		if (!parse_item(&it[n], errors) || is_share(&it[n]) != is_share(&it[0]))
			return 0;
		n++;
		at += length;
		if (*at == '\0')
			break;
	}
	qsort(it, n, sizeof *it, compare_items);
	for (size_t i = 1; i < n; i++)
		if (!(it[i].order > it[i - 1].order))
			return 0;
	return n;
}

/* ---- names -------------------------------------------------------------------------------- */

/* A limit as a part of a name: 1000000, 10pct, 0.5. */
static void word_of(const item *it, char word[ITEM + 8])
{
	const size_t n = strlen(it->text);
	if (it->level.faces)
		(void)snprintf(word, ITEM + 8, "%llu", (unsigned long long)it->level.faces);
	else if (it->text[n - 1] == '%')
		(void)snprintf(word, ITEM + 8, "%.*spct", (int)n - 1, it->text);
	else
		(void)snprintf(word, ITEM + 8, "%s", it->text);
}

/* The name of a level's output, put behind the *used bytes of those before it; NULL: there is no
 * room. */
static const char *name_of(reduce_options *o, size_t *used, const char *path, const char *word)
{
	char *name = o->names + *used;
	if (!cmd_name_with(name, sizeof o->names - *used, path, word))
		return NULL;
	*used += strlen(name) + 1;
	return name;
}

/* ---- both --------------------------------------------------------------------------------- */

static void set_last(wh_reduce_params *p, const wh_level *l)
{
	p->faces = l->faces;
	p->face_ratio = l->face_ratio;
	p->error = l->error;
	p->error_share = l->error_share;
}

int levels_options_take(const char *command, reduce_options *o)
{
	item it[WH_LEVELS_MOST + 1];
	const bool errors = o->levels_error != NULL;
	const char *list = errors ? o->levels_error : o->levels;
	const char *path = o->params.output ? o->params.output : "out.ply"; /* of a plan */
	const size_t n = parse_list(list, errors, it);
	if (n == 0)
		return cmd_usage_error(command,
		                       "--levels%s: '%s' is not a list of %s, all different, all "
		                       "of one kind, such as %s",
		                       errors ? "-error" : "", list,
		                       errors ? "distances or shares" : "counts or shares",
		                       errors ? "0.1,0.5,2 or 0.01%,0.1%" : "1M,100K or 10%,1%");
	if (strcmp(path, "-") == 0)
		return cmd_usage_error(command, "several levels do not go to standard output");
	size_t used = 0;
	for (size_t i = 0; i < n; i++) {
		char word[ITEM + 8];
		word_of(&it[i], word);
		it[i].level.output = name_of(o, &used, path, word);
		if (!it[i].level.output)
			return cmd_usage_error(command, "the names of the outputs are too long");
	}
	for (size_t i = 0; i + 1 < n; i++)
		o->level[i] = it[i].level;
	set_last(&o->params, &it[n - 1].level);
	o->params.output = it[n - 1].level.output;
	o->params.level = o->level;
	o->params.levels = n - 1;
	return WH_OK;
}
