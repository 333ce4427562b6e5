/*
 * replay_page: a progressive mesh as a page that plays it.
 */
#ifndef WH_TOOLS_REPLAY_PAGE_H
#define WH_TOOLS_REPLAY_PAGE_H

#include "replay_options.h"

enum { REPLAY_SHOWN = 200000 }; /* faces of the finest level on a page, unless asked for others */

/* Writes the page o->page, from the base up to this level. */
wh_code replay_page(wh_ctx *c, const replay_options *o, uint64_t level);

#endif
