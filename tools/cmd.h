/*
 * cmd: what the subcommands of the whittle command share.
 *
 * Each cmd_NAME receives its own argument vector (argv[0] is the subcommand's name) and returns
 * the exit status. Messages go to standard error as "whittle NAME: text".
 */
#ifndef WH_TOOLS_CMD_H
#define WH_TOOLS_CMD_H

#include "base/mem.h"
#include "exec/exec.h"
#include "io/format.h"

int cmd_reduce(int argc, char **argv);
int cmd_progressive(int argc, char **argv);
int cmd_replay(int argc, char **argv);
int cmd_plan(int argc, char **argv);
int cmd_stage(int argc, char **argv);
int cmd_info(int argc, char **argv);
int cmd_check(int argc, char **argv);
int cmd_compare(int argc, char **argv);
int cmd_render(int argc, char **argv);
int cmd_report(int argc, char **argv);
int cmd_generate(int argc, char **argv);

/* A context with an account and the signal flag, for one subcommand. */
typedef struct cmd_env {
	const char *name;
	wh_mem mem;
	wh_ctx ctx;
	wh_exec exec;
} cmd_env;

void cmd_env_init(cmd_env *e, const char *name);

/* SIGUSR1 asks to stop, too, as batch systems send it; the status is that of SIGTERM. */
void cmd_stop_on_usr1(void);

/* The exit status of the recorded failure (128 + signal when interrupted). */
int cmd_failure_status(const cmd_env *e);

/* Prints the recorded failure and returns its exit status (128 + signal when interrupted). */
int cmd_report_failure(const cmd_env *e);

/* Prints "whittle NAME: text" and where to find help; returns the status for wrong usage. */
int cmd_usage_error(const char *name, const char *fmt, ...) __attribute__((format(printf, 2, 3)));

/* Parses "4M", "1.5k", "200000" (suffixes k, M, G, powers of 1000; with binary, of 1024). False
 * when it is not such a number or does not fit in 63 bits. */
bool cmd_parse_count(const char *text, bool binary, int64_t *out);

/* Points to measure at: a count from 1 to 10^12. */
bool cmd_parse_samples(const char *text, int64_t *out);

/* The threads to work with: so many, or all processors when it is 0. More than there are processors
 * are taken, too, with a warning. */
int cmd_threads(const char *name, int64_t asked);

/* A ceiling of memory: a size of 1M or more. */
bool cmd_parse_memory(const char *text, size_t *bytes);

/* A share above 0, up to 1: "0.1", "10%". */
bool cmd_parse_share(const char *text, double *share);

/* True for the name of standard input or output; name may be NULL. */
bool cmd_is_dash(const char *name);

/* Parses the name of a format that can be read. */
bool cmd_parse_from(const char *text, wh_format *out);

/* The name of one of several outputs: `path` with the word in the place of %f, else before its
 * endings. False when there is no room. */
bool cmd_name_with(char *name, size_t room, const char *path, const char *word);

/* Parses a finite decimal number. */
bool cmd_parse_real(const char *text, double *out);

/* The number in front of a final "%", as a share. False when there is no "%". */
bool cmd_parse_percent(const char *text, double *share);

/* Parses a distance to weld vertices within: from 0 on, or a share above 0 such as "0.001%". Sets
 * one of the two. */
bool cmd_parse_weld(const char *text, double *distance, double *share);

/* A coordinate for people: nine digits, which tell any float from its neighbours, or as many more
 * as a double takes. Returns text. */
enum { CMD_REAL_TEXT = 32 };
const char *cmd_real_text(double x, bool is_double, char text[CMD_REAL_TEXT]);

/* Most memory this process ever had resident, in bytes. */
size_t cmd_peak_rss(void);

#endif
