#define _POSIX_C_SOURCE 200809L
#include "cmd.h"

#include <ctype.h>
#include <math.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>

/* The signal that asked to stop, 0 while none has: what every context's cancel points to. */
static volatile sig_atomic_t stop_signal;

static void on_stop(int sig)
{
	__atomic_store_n(&stop_signal, sig, __ATOMIC_RELAXED); /* other threads poll it */
}

/* A signal ignored by whoever started us (nohup, a background job) stays ignored. */
static void catch_stop(int sig)
{
	struct sigaction old;
	if (sigaction(sig, NULL, &old) != 0 || old.sa_handler == SIG_IGN)
		return;
	struct sigaction act = {.sa_handler = on_stop, .sa_flags = SA_RESTART};
	(void)sigemptyset(&act.sa_mask);
	(void)sigaction(sig, &act, NULL);
}

/* Broken pipes and file size limits are to come back as errors of write, with a message. */
static void ignore(int sig)
{
	struct sigaction act = {.sa_handler = SIG_IGN};
	(void)sigemptyset(&act.sa_mask);
	(void)sigaction(sig, &act, NULL);
}

void cmd_env_init(cmd_env *e, const char *name)
{
	_Static_assert(sizeof(sig_atomic_t) == sizeof(int), "the flag is polled as an int");
	memset(e, 0, sizeof *e);
	e->name = name;
	e->ctx.mem = &e->mem;
	e->ctx.cancel = &stop_signal;
	e->exec.workers = wh_exec_threads(0);
	catch_stop(SIGINT);
	catch_stop(SIGTERM);
	catch_stop(SIGHUP);
	catch_stop(SIGXCPU); /* a soft limit of CPU time: the hard one kills */
	ignore(SIGPIPE);
	ignore(SIGXFSZ);
}

void cmd_stop_on_usr1(void)
{
	catch_stop(SIGUSR1);
}

static int status_signal(void)
{
	const int sig = (int)stop_signal;
	return sig == 0 ? SIGINT : sig == SIGUSR1 ? SIGTERM : sig;
}

int cmd_failure_status(const cmd_env *e)
{
	const wh_error *err = &e->ctx.err;
	if (err->code == WH_E_INTERRUPT)
		return 128 + status_signal();
	return err->code == WH_E_IRREGULAR ? WH_E_RUN : (int)err->code;
}

int cmd_report_failure(const cmd_env *e)
{
	(void)fprintf(stderr, "whittle %s: %s\n", e->name, e->ctx.err.text);
	return cmd_failure_status(e);
}

int cmd_usage_error(const char *name, const char *fmt, ...)
{
	va_list ap;
	va_start(ap, fmt);
	(void)fprintf(stderr, "whittle %s: ", name);
	(void)vfprintf(stderr, fmt, ap);
	(void)fprintf(stderr, "; see whittle %s --help\n", name);
	va_end(ap);
	return WH_E_USAGE;
}

/* What a suffix stands for; 0 when it is none. */
static uint64_t suffix_factor(const char *s, bool binary)
{
	static const char letters[] = "KMGT";
	if (*s == '\0')
		return 1;
	const char *at = strchr(letters, toupper((unsigned char)*s));
	if (!at)
		return 0;
	s++;
	if (binary && *s == 'i') /* MiB, Mi, MB and M are the same size */
		s++;
	if (binary && *s == 'B')
		s++;
	if (*s != '\0')
		return 0;
	uint64_t factor = 1;
	for (const char *l = letters; l <= at; l++)
		factor *= binary ? 1024 : 1000;
	return factor;
}

/* Digits, then perhaps a point and at most 18 more: value = digits / scale. */
static bool parse_decimal(const char **s, uint64_t *digits, uint64_t *scale)
{
	const char *p = *s;
	bool any = false;
	bool point = false;
	*digits = 0;
	*scale = 1;
	for (;; p++) {
		if (*p == '.' && !point) {
			point = true;
			continue;
		}
		if (!isdigit((unsigned char)*p))
			break;
		any = true;
		if (__builtin_mul_overflow(*digits, 10u, digits) ||
		    __builtin_add_overflow(*digits, (uint64_t)(*p - '0'), digits))
			return false;
		if (point && __builtin_mul_overflow(*scale, 10u, scale))
			return false;
	}
	*s = p;
	return any;
}

bool cmd_parse_count(const char *text, bool binary, int64_t *out)
{
	uint64_t digits, scale, value;
	if (!parse_decimal(&text, &digits, &scale))
		return false;
	const uint64_t factor = suffix_factor(text, binary);
	if (factor == 0 || __builtin_mul_overflow(digits, factor, &value))
		return false;
	/* 1.0005K is no count, but 1.3G bytes are as many whole ones as fit */
	if (value % scale != 0 && !(binary && factor > 1))
		return false;
	value /= scale;
	if (value > INT64_MAX)
		return false;
	*out = (int64_t)value;
	return true;
}

int cmd_threads(const char *name, int64_t asked)
{
	const int processors = wh_exec_threads(0);
	if (asked > processors)
		(void)fprintf(stderr,
		              "whittle %s: warning: %lld threads on %d processor%s: no faster than "
		              "%d, and each takes memory\n",
		              name, (long long)asked, processors, processors == 1 ? "" : "s",
		              processors);
	return wh_exec_threads((int)asked);
}

bool cmd_parse_samples(const char *text, int64_t *out)
{
	return cmd_parse_count(text, false, out) && *out >= 1 && *out <= 1000000000000;
}

bool cmd_parse_percent(const char *text, double *share)
{
	char copy[64];
	const size_t n = strlen(text);
	if (n < 2 || n >= sizeof copy || text[n - 1] != '%')
		return false;
	memcpy(copy, text, n - 1);
	copy[n - 1] = '\0';
	if (!cmd_parse_real(copy, share))
		return false;
	*share /= 100;
	return true;
}

bool cmd_parse_memory(const char *text, size_t *bytes)
{
	int64_t n;
	if (!cmd_parse_count(text, true, &n) || n < 1 << 20)
		return false;
	*bytes = (size_t)n;
	return true;
}

bool cmd_parse_share(const char *text, double *share)
{
	return (cmd_parse_percent(text, share) || cmd_parse_real(text, share)) && *share > 0 &&
	       *share <= 1;
}

bool cmd_parse_weld(const char *text, double *distance, double *share)
{
	if (cmd_parse_percent(text, share))
		return *share > 0 && *share <= 1;
	return cmd_parse_real(text, distance) && *distance >= 0;
}

const char *cmd_real_text(double x, bool is_double, char text[CMD_REAL_TEXT])
{
	int digits = 9;
	do
		(void)snprintf(text, CMD_REAL_TEXT, "%.*g", digits, x);
	while (is_double && digits++ < 17 && strtod(text, NULL) != x);
	return text;
}

bool cmd_is_dash(const char *name)
{
	return name && strcmp(name, "-") == 0;
}

bool cmd_parse_from(const char *text, wh_format *out)
{
	return wh_format_parse(text, out) && *out != WH_FORMAT_GLB;
}

bool cmd_parse_real(const char *text, double *out)
{
	char *end;
	if (*text == '\0' || isspace((unsigned char)*text))
		return false;
	const double v = strtod(text, &end);
	if (*end != '\0' || !isfinite(v))
		return false;
	*out = v;
	return true;
}

size_t cmd_peak_rss(void)
{
	struct rusage u;
	char line[128];
	unsigned long kib = 0;
	/* of this program alone; what getrusage says includes the process that it was started from
	 */
	FILE *f = fopen("/proc/self/status", "re");
	while (f && kib == 0 && fgets(line, sizeof line, f))
		if (strncmp(line, "VmHWM:", 6) == 0)
			kib = strtoul(line + 6, NULL, 10);
	if (f)
		(void)fclose(f);
	if (kib)
		return (size_t)kib * 1024;
	return getrusage(RUSAGE_SELF, &u) == 0 ? (size_t)u.ru_maxrss * 1024 : 0;
}

/* Where the endings of a file's name begin: "ply", or "ply.gz" with what it is packed in. */
static size_t endings_of(const char *path)
{
	const char *slash = strrchr(path, '/'), *name = slash ? slash + 1 : path;
	const char *dot = strrchr(name, '.');
	if (!dot || dot == name)
		return strlen(path);
	size_t at = (size_t)(dot - path);
	if (strcmp(dot, ".gz") != 0 && strcmp(dot, ".zst") != 0)
		return at;
	for (const char *c = dot - 1; c > name; c--)
		if (*c == '.')
			return (size_t)(c - path);
	return at;
}

bool cmd_name_with(char *name, size_t room, const char *path, const char *word)
{
	const char *mark = strstr(path, "%f");
	const size_t at = mark ? (size_t)(mark - path) : endings_of(path);
	const int n = snprintf(name, room, "%.*s%s%s%s", (int)at, path, mark ? "" : "-", word,
	                       path + at + (mark ? 2 : 0));
	return n >= 0 && (size_t)n < room;
}
