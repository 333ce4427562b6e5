/* ply_files: small PLY files for tests, written value by value in any format. */
#ifndef WH_TESTS_PLY_FILES_H
#define WH_TESTS_PLY_FILES_H

#include "testing.h"

#include "io/ply_value.h"
#include "pipeline/normalise.h"

#include <inttypes.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

typedef struct ply_file {
	char path[64];
	FILE *f;
	wh_ply_format format;
	int eol; /* line end of the header: '\n', '\r', or 0 for CR LF */
} ply_file;

static inline ply_file ply_begin(wh_ply_format format)
{
	ply_file p = {.path = "/tmp/whittle-test-XXXXXX", .format = format, .eol = '\n'};
	const int fd = mkstemp(p.path);
	assert_true(fd >= 0);
	p.f = fdopen(fd, "wb");
	assert_non_null(p.f);
	return p;
}

/* Header lines, each ended by '\n' in `text`, come out with the file's line end. */
static inline void ply_text(ply_file *p, const char *text)
{
	for (; *text; text++) {
		if (*text != '\n')
			(void)fputc(*text, p->f);
		else if (p->eol)
			(void)fputc(p->eol, p->f);
		else
			(void)fputs("\r\n", p->f);
	}
}

static inline void ply_header(ply_file *p, const char *elements)
{
	static const char *const formats[] = {"ascii", "binary_little_endian", "binary_big_endian"};
	ply_text(p, "ply\nformat ");
	ply_text(p, formats[p->format]);
	ply_text(p, " 1.0\n");
	ply_text(p, elements);
	ply_text(p, "end_header\n");
}

static inline void ply_bytes(ply_file *p, uint64_t bits, uint32_t size)
{
	for (uint32_t i = 0; i < size; i++) {
		const uint32_t k = p->format == WH_PLY_BE ? size - 1 - i : i;
		(void)fputc((int)(bits >> (8 * k) & 0xff), p->f);
	}
}

/* One value of type t. */
static inline void ply_value(ply_file *p, wh_type t, double v)
{
	uint64_t bits = 0;
	if (p->format == WH_PLY_ASCII) {
		(void)fprintf(p->f, "%.17g ", v);
		return;
	}
	if (t == WH_F32) {
		const float f = (float)v;
		uint32_t u;
		memcpy(&u, &f, sizeof u);
		bits = u;
	} else if (t == WH_F64) {
		memcpy(&bits, &v, sizeof bits);
	} else {
		bits = v < 0 ? (uint64_t)(int64_t)v : (uint64_t)v;
	}
	ply_bytes(p, bits, wh_type_size(t));
}

/* Ends an item: a line in text, nothing in binary. */
static inline void ply_item(ply_file *p)
{
	if (p->format == WH_PLY_ASCII)
		ply_text(p, "\n");
}

static inline void ply_end(ply_file *p)
{
	assert_int_equal(fclose(p->f), 0);
}

/* A whole text file in one go. */
static inline ply_file ply_write(const char *text)
{
	ply_file p = ply_begin(WH_PLY_ASCII);
	ply_text(&p, text);
	ply_end(&p);
	return p;
}

/* Loads the file with so many workers and removes it. The result, with its message in t. */
static inline wh_code ply_load(testing_env *t, const ply_file *p, int workers, wh_mesh *m,
                               bool *is_double, uint64_t *degenerate)
{
	wh_spill spill;
	const wh_exec ex = {.workers = workers};
	assert_int_equal(wh_spill_open(&t->ctx, &spill, "/tmp", NULL), WH_OK);
	const wh_code code =
	    wh_load_mesh(&t->ctx, &ex, &spill, p->path, WH_FORMAT_ANY, m, is_double, degenerate);
	assert_int_equal(spill.held, 0);
	wh_spill_close(&t->ctx, &spill);
	(void)unlink(p->path);
	return code;
}

/* The file must be refused as bad input, with all of the words (up to a NULL) in the message. */
static inline void ply_assert_refused(const ply_file *p, ...)
{
	testing_env t;
	wh_mesh m;
	testing_init(&t);
	const wh_code code = ply_load(&t, p, 2, &m, NULL, NULL);
	if (code != WH_E_INPUT)
		fail_msg("not refused as bad input: %d %s", code, t.ctx.err.text);
	va_list ap;
	va_start(ap, p);
	for (const char *word = va_arg(ap, const char *); word; word = va_arg(ap, const char *))
		if (!strstr(t.ctx.err.text, word))
			fail_msg("no '%s' in: %s", word, t.ctx.err.text);
	va_end(ap);
	assert_non_null(strstr(t.ctx.err.text, p->path));
	testing_done(&t);
}

#endif
