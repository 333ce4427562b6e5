/* reduce_words: what a reduction says to its user when it ends. */
#ifndef WH_TOOLS_REDUCE_WORDS_H
#define WH_TOOLS_REDUCE_WORDS_H

#include "reduce_options.h"

#include <stdio.h>

/* What came of it. */
void reduce_words_summary(FILE *f, const reduce_options *o, const wh_reduce_report *r);

/* What the phases took that this process went through, a line each. */
void reduce_words_phases(FILE *f, const wh_reduce_report *r);

/* What comes next, after a stage that is not the last. */
void reduce_words_paused(FILE *f, const reduce_options *o, const wh_reduce_report *r);

/* The command that goes on with what this one, argv, has done; `kept`: it has done something. */
void reduce_words_resume(const reduce_options *o, int argc, char **argv, bool kept);

#endif
