/*
 * page_out: HTML to an output.
 *
 * All of it goes on in silence after a failure, which stays recorded in the context.
 */
#ifndef WH_TOOLS_PAGE_OUT_H
#define WH_TOOLS_PAGE_OUT_H

#include "io/outfile.h"

#include <jansson.h>

typedef struct page_out {
	wh_ctx *c;
	wh_outfile *file;
} page_out;

/* As it is. */
void page_put(const page_out *o, const char *html);
void page_put_n(const page_out *o, const char *html, size_t n);
/* As it is, after formatting; the result has less than PAGE_WORDS bytes. */
enum { PAGE_WORDS = 1024 };
void page_putf(const page_out *o, const char *fmt, ...) __attribute__((format(printf, 2, 3)));
/* Text of others: escaped for elements and quoted attributes; what is not UTF-8 is replaced. */
void page_text(const page_out *o, const char *text);
void page_base64(const page_out *o, const uint8_t *bytes, size_t n);
/* For a script element: no text in it can end that. */
void page_json(const page_out *o, const json_t *j);

/* A count with its digits in groups of three. */
void page_count(const page_out *o, uint64_t n);
/* Four digits that count; "0", "-" for what is no number. */
void page_real(const page_out *o, double x);
/* Bytes in the unit that suits them. */
void page_bytes(const page_out *o, double bytes);
/* 0.123 s, 12.3 s, 3 min 4 s. */
void page_seconds(const page_out *o, double seconds);

/* A page with {{places}}: `put` writes what belongs at the one of this name. */
void page_fill(const page_out *o, const char *html,
               void (*put)(const void *from, const page_out *o, const char *name, size_t n),
               const void *from);

/* The whole of a page: tools/page/frame.html around this one, with {{places}} as above. */
void page_put_whole(const page_out *o, const unsigned char *page,
                    void (*put)(const void *from, const page_out *o, const char *name, size_t n),
                    const void *from);

/* A script of three.js, its licence, and these two scripts in one function. */
void page_scripts(const page_out *o, const unsigned char *view, const unsigned char *what);

/* The last part of a path. */
const char *page_name(const char *path);

#endif
