#include "cmd.h"

int cmd_generate(int argc, char **argv)
{
	(void)argc;
	return cmd_usage_error(argv[0], "this command is not there yet");
}
