#define _GNU_SOURCE
#include "stage_file.h"

#include <limits.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

enum { MOST = 1 << 20 }; /* bytes of the file */

static bool file_name(const char *run_dir, const char *end, char name[PATH_MAX])
{
	const int n = snprintf(name, PATH_MAX, "%s/whittle-run/arguments%s", run_dir, end);
	return n > 0 && n < PATH_MAX;
}

static wh_code put_text(wh_ctx *c, FILE *f, const char *name, const char *text)
{
	if (fwrite(text, strlen(text) + 1, 1, f) == 1)
		return WH_OK;
	return wh_fail_errno(c, "cannot write '%s'", name);
}

wh_code stage_file_write(wh_ctx *c, const char *run_dir, int argc, char **argv)
{
	char name[PATH_MAX], part[PATH_MAX], end[32], here[PATH_MAX];
	(void)snprintf(end, sizeof end, ".%ld.part", (long)getpid());
	if (!file_name(run_dir, "", name) || !file_name(run_dir, end, part))
		return wh_fail(c, WH_E_USAGE, "the name of the run directory is too long");
	if (!getcwd(here, sizeof here))
		return wh_fail_errno(c, "cannot name the working directory");
	FILE *f = fopen(part, "we");
	if (!f)
		return wh_fail_errno(c, "cannot write '%s'", part);
	wh_code code = put_text(c, f, part, here);
	for (int i = 0; code == WH_OK && i < argc; i++)
		code = put_text(c, f, part, argv[i]);
	if (code == WH_OK && (fflush(f) != 0 || fsync(fileno(f)) != 0))
		code = wh_fail_errno(c, "cannot write '%s'", part);
	if (fclose(f) != 0 && code == WH_OK)
		code = wh_fail_errno(c, "cannot write '%s'", part);
	if (code == WH_OK && rename(part, name) != 0)
		code = wh_fail_errno(c, "cannot rename '%s' to '%s'", part, name);
	if (code != WH_OK)
		(void)unlink(part);
	return code;
}

/* Finds the strings in so many bytes of text. */
static wh_code split(wh_ctx *c, const char *name, size_t n, stage_file *s)
{
	int strings = 0;
	for (size_t i = 0; i < n; i++)
		strings += s->text[i] == '\0';
	if (strings < 2 || s->text[n - 1] != '\0')
		return wh_fail(c, WH_E_RUN, "'%s' is damaged: plan again", name);
	s->argv = wh_alloc(c, (size_t)strings, sizeof *s->argv);
	if (!s->argv)
		return wh_failed(c);
	char *at = s->text;
	s->folder = at;
	s->argc = strings - 1;
	for (int i = 0; i < s->argc; i++)
		s->argv[i] = at += strlen(at) + 1;
	s->argv[s->argc] = NULL;
	return WH_OK;
}

wh_code stage_file_read(wh_ctx *c, const char *run_dir, stage_file *s)
{
	char name[PATH_MAX];
	*s = (stage_file){0};
	if (!file_name(run_dir, "", name))
		return wh_fail(c, WH_E_USAGE, "the name of the run directory is too long");
	FILE *f = fopen(name, "re");
	if (!f)
		return wh_fail_errno(
		    c,
		    "'%s' holds no run in stages, or one that is finished: whittle "
		    "plan with --run-dir and --parts makes one ('%s')",
		    run_dir, name);
	s->text = wh_alloc(c, MOST, 1);
	const size_t n = s->text ? fread(s->text, 1, MOST, f) : 0;
	wh_code code = s->text ? WH_OK : wh_failed(c);
	if (code == WH_OK && ferror(f))
		code = wh_fail_errno(c, "cannot read '%s'", name);
	(void)fclose(f);
	return code == WH_OK ? split(c, name, n, s) : code;
}

void stage_file_free(wh_ctx *c, stage_file *s)
{
	wh_free(c, s->argv);
	wh_free(c, s->text);
	*s = (stage_file){0};
}
