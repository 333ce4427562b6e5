/*
 * measured: runs a command and says what it took.
 *
 * usage: measured OUT.json COMMAND [ARGUMENT ...]
 *
 * Wall and processor seconds and the peak of resident memory, as the kernel counts them. A program
 * of its own because that peak begins with the memory of whoever started the command: an
 * interpreter's would hide a small command's.
 */
#define _GNU_SOURCE
#include <stdio.h>
#include <stdlib.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

static double seconds(struct timeval t)
{
	return (double)t.tv_sec + 1e-6 * (double)t.tv_usec;
}

static double now(void)
{
	struct timespec t;
	clock_gettime(CLOCK_MONOTONIC, &t);
	return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

/* The status as a shell gives it. */
static int run(char **command, struct rusage *used)
{
	int status;
	pid_t child = fork();
	if (child == 0) {
		execvp(command[0], command);
		perror(command[0]);
		_exit(127);
	}
	if (child < 0 || wait4(child, &status, 0, used) != child) {
		perror("measured");
		return 126;
	}
	return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
}

int main(int argc, char **argv)
{
	if (argc < 3) {
		fprintf(stderr, "usage: measured OUT.json COMMAND [ARGUMENT ...]\n");
		return 2;
	}
	struct rusage used;
	double start = now();
	int status = run(argv + 2, &used);
	double wall = now() - start;
	FILE *out = fopen(argv[1], "w");
	if (!out) {
		perror(argv[1]);
		return 126;
	}
	fprintf(out, "{\"wall\": %.4f, \"user\": %.4f, \"system\": %.4f, \"peak_rss_kib\": %ld}\n",
	        wall, seconds(used.ru_utime), seconds(used.ru_stime), used.ru_maxrss);
	return fclose(out) == 0 ? status : 126;
}
