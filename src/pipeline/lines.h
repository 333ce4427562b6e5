/*
 * lines: a text file in chunks of whole lines, for formats whose lines begin with a tag.
 *
 * A line belongs to the chunk where it begins, so that chunks can be read in any order and at the
 * same time. A backslash at the end of a line joins the next one to it, where the format says so.
 * Memory per worker: a chunk, or the longest line if that is longer.
 */
#ifndef WH_PIPELINE_LINES_H
#define WH_PIPELINE_LINES_H

#include "io/number.h"
#include "io/ply.h"

enum { WH_LINES_CHUNK = 1 << 20 }; /* bytes */

typedef struct wh_lines {
	const wh_ply *file; /* open; the text is all of it */
	char eol;
	bool joins; /* a backslash in front of a line end takes it away */
	int64_t chunks;
} wh_lines;

/* A chunk's lines; one per worker. Zero-initialise. */
typedef struct wh_lines_part {
	char *text;
	size_t cap;
	size_t n;      /* bytes, and a line end behind them */
	size_t at;     /* start of the next line */
	size_t stop;   /* lines that begin here or behind are not the chunk's */
	uint64_t base; /* offset in the file of text[0] */
} wh_lines_part;

wh_lines wh_lines_of(const wh_ply *file, char eol, bool joins);

/* Reads a chunk. WH_E_INPUT for a line too long to be one. */
wh_code wh_lines_load(wh_ctx *c, const wh_lines *l, int64_t chunk, wh_lines_part *p);
void wh_lines_free(wh_ctx *c, wh_lines_part *p);

/* The first word of the next line that has one, NULL behind the chunk's last. The text goes on to
 * a line end, at which every scan stops. */
const char *wh_lines_next(const wh_lines *l, wh_lines_part *p);

/* The next word of the line at s, or its end. */
static inline const char *wh_lines_word(const wh_lines *l, const char *s)
{
	while (wh_is_blank(*s) && *s != l->eol)
		s++;
	return s;
}

/* Is the word at s this one? */
bool wh_lines_is(const char *s, const char *word);

/* The number, from 1, of the line of a place in the part's text: counts from the file's beginning,
 * for messages. 0 when the file cannot be read. */
uint64_t wh_lines_number(wh_ctx *c, const wh_lines *l, const wh_lines_part *p, const char *s);

#endif
