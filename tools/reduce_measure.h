/* reduce_measure: the distances of the results of a reduction from its input. */
#ifndef WH_TOOLS_REDUCE_MEASURE_H
#define WH_TOOLS_REDUCE_MEASURE_H

#include "algo/compare.h"
#include "cmd.h"
#include "reduce_options.h"

#include <stdio.h>

/* Asked for, and can it be done? WH_OK, or the status to leave with after words that say why not.
 */
int reduce_measure_check(const reduce_options *o);

/*
 * Reads input and results again, by the means of the run: *measured, to be freed, has the figures
 * of each of its levels, but for those left out, and of the output behind them. On failure it is
 * NULL, and words say why.
 */
wh_code reduce_measure(const reduce_options *o, const cmd_env *env, const wh_reduce_report *r,
                       wh_compare **measured);

/* For the summary. */
void reduce_measure_print(FILE *f, const reduce_options *o, const wh_reduce_report *r,
                          const wh_compare *measured);

#endif
