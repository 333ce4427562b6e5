/* whittle: the command. Finds the subcommand, runs it, and makes sure its words were written. */
#include "cmd.h"
#include "whittle.h"

#include <stdio.h>
#include <string.h>

typedef struct command {
	const char *name;
	int (*run)(int argc, char **argv);
	const char *args;
	const char *what;
} command;

static const command commands[] = {
    {"reduce", cmd_reduce, "IN -o OUT --faces N", "reduce a mesh to a size or an error"},
    {"progressive", cmd_progressive, "IN -o FILE.pmesh", "reduce it, and record every collapse"},
    {"replay", cmd_replay, "FILE.pmesh -o OUT", "a mesh of any size from such a record"},
    {"plan", cmd_plan, "IN --faces N", "what reduce would take: memory, disk, rounds"},
    {"stage", cmd_stage, "STAGE --run-dir DIR", "a part of a run on several machines"},
    {"info", cmd_info, "FILE", "what a mesh file holds, from its header"},
    {"check", cmd_check, "FILE", "manifold, boundary, components, defects"},
    {"compare", cmd_compare, "A B", "two-sided distance of two meshes"},
    {"render", cmd_render, "FILE -o PICTURE.png", "a picture of a mesh of any size"},
    {"report", cmd_report, "IN OUT -o PAGE.html", "one page that shows what became of a mesh"},
    {"generate", cmd_generate, "-o OUT --faces N", "make a scan-like surface of any size"},
};

enum { NCOMMANDS = sizeof commands / sizeof commands[0] };

static void print_help(FILE *f)
{
	(void)fprintf(f, "whittle reduces triangle meshes that are larger than memory.\n\n"
	                 "usage: whittle COMMAND ...\n\n");
	for (int i = 0; i < NCOMMANDS; i++)
		(void)fprintf(f, "  %-11s %-21s %s\n", commands[i].name, commands[i].args,
		              commands[i].what);
	(void)fprintf(
	    f, "\n  whittle COMMAND --help   the options of one command\n"
	       "  whittle --version\n\n"
	       "Numbers take the suffixes K, M and G.\n"
	       "Exit status: 0 done, 1 failure in the run, 2 wrong usage, 3 bad input,\n"
	       "4 target not reachable (best mesh written), 5 memory ceiling cannot be met,\n"
	       "130 or 143 interrupted.\n");
}

static const command *find_command(const char *name)
{
	for (int i = 0; i < NCOMMANDS; i++)
		if (strcmp(commands[i].name, name) == 0)
			return &commands[i];
	return NULL;
}

static int no_command(const char *name)
{
	(void)fprintf(stderr, "whittle: there is no command \"%s\"; see whittle --help\n", name);
	return WH_E_USAGE;
}

static int help_of(char *name)
{
	static char option[] = "--help";
	char *words[] = {name, option, NULL};
	const command *cmd = find_command(name);
	return cmd ? cmd->run(2, words) : no_command(name);
}

static int dispatch(int argc, char **argv)
{
	if (argc < 2) {
		print_help(stderr);
		return WH_E_USAGE;
	}
	const char *first = argv[1];
	if (strcmp(first, "help") == 0 && argc > 2)
		return help_of(argv[2]);
	if (strcmp(first, "--help") == 0 || strcmp(first, "-h") == 0 ||
	    strcmp(first, "help") == 0) {
		print_help(stdout);
		return WH_OK;
	}
	if (strcmp(first, "--version") == 0 || strcmp(first, "-V") == 0) {
		(void)printf("whittle %s\n%s", WHITTLE_VERSION,
		             wh_mpi_is_built_in() ? "built with MPI\n" : "");
		return WH_OK;
	}
	const command *cmd = find_command(first);
	return cmd ? cmd->run(argc - 1, argv + 1) : no_command(first);
}

int main(int argc, char **argv)
{
	const int status = dispatch(argc, argv);
	if (fflush(stdout) == 0 && !ferror(stdout))
		return status;
	(void)fprintf(stderr, "whittle: standard output could not be written\n");
	return status ? status : WH_E_RUN;
}
