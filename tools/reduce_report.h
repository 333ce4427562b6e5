/* reduce_report: the report of a reduction as JSON. */
#ifndef WH_TOOLS_REDUCE_REPORT_H
#define WH_TOOLS_REDUCE_REPORT_H

#include "cmd.h"
#include "whittle.h"

struct wh_compare;

/* Faces removed in a second of the whole run. */
double reduce_faces_per_second(const wh_reduce_report *r);

/* Finds out, before the work begins, whether `path` can be written. 0, or -1 after printing why
 * not. Leaves no trace. */
int reduce_report_try(const cmd_env *e, const char *path, bool force);

/* Writes the report to `path` ("-": standard output). `measured`: NULL, or the distances of
 * the input from each level and from the output, which is the last. 0, or -1 after printing why
 * not. */
int reduce_report_write(const cmd_env *e, const char *path, const wh_reduce_params *p,
                        const wh_reduce_report *r, const struct wh_compare *measured);

/* The same of a stage that is not the last of its run, but only what it took; an older report of it
 * is replaced. */
int reduce_report_write_stage(const cmd_env *e, const char *path, const wh_reduce_report *r);

#endif
