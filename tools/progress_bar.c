#define _POSIX_C_SOURCE 200809L
#include "progress_bar.h"

#include "base/timer.h"

#include <stdio.h>
#include <string.h>
#include <unistd.h>

static const double TERMINAL_INTERVAL = 0.1, LINE_INTERVAL = 10.0;
enum { WIDTH = 24 };

void progress_bar_init(progress_bar *b, bool on)
{
	*b = (progress_bar){.on = on, .terminal = isatty(STDERR_FILENO) != 0};
	b->last = wh_seconds();
}

static void format_left(double seconds, char *out, size_t n)
{
	if (seconds < 100)
		(void)snprintf(out, n, "%.0f s left", seconds);
	else if (seconds < 6000)
		(void)snprintf(out, n, "%.0f min left", seconds / 60);
	else
		(void)snprintf(out, n, "%.1f h left", seconds / 3600);
}

static void draw_bar(double share)
{
	char bar[WIDTH + 1];
	const int full = (int)(share * WIDTH);
	for (int i = 0; i < WIDTH; i++)
		bar[i] = i < full ? '#' : '.';
	bar[WIDTH] = '\0';
	(void)fprintf(stderr, "[%s] ", bar);
}

void progress_bar_tell(void *user, const char *phase, uint64_t done, uint64_t total)
{
	progress_bar *b = user;
	if (!b->on)
		return;
	const double now = wh_seconds();
	if (!b->phase || strcmp(phase, b->phase) != 0) {
		b->phase = phase;
		b->phase_start = now;
	}
	if (now - b->last < (b->terminal ? TERMINAL_INTERVAL : LINE_INTERVAL))
		return;
	b->last = now;
	const double share = total ? (double)done / (double)total : 0;
	const double spent = now - b->phase_start;
	char left[32] = "";
	if (done > 0 && spent > 0.5)
		format_left(spent * (1 - share) / share, left, sizeof left);
	if (b->terminal) {
		(void)fputs("\r\033[K", stderr);
		draw_bar(share);
	}
	char rate[32] = "";
	if (total > 100000 && spent > 0) /* few things are clusters, not faces or vertices */
		(void)snprintf(rate, sizeof rate, "  %.2f M/s", (double)done / spent / 1e6);
	(void)fprintf(stderr, "whittle: %s %.0f%%%s%s%s", phase, 100 * share, rate,
	              *left ? "  " : "", left);
	if (!b->terminal)
		(void)fputc('\n', stderr);
	(void)fflush(stderr);
	b->drawn = b->terminal;
}

void progress_bar_end(progress_bar *b)
{
	if (b->drawn)
		(void)fputs("\r\033[K", stderr);
	b->drawn = false;
}
