/* whittle progressive: the options of reduce -> one run that is recorded -> words. */
#include "cmd.h"
#include "reduce_options.h"
#include "reduce_run.h"

#include <stdio.h>

static const char help[] =
    "usage: whittle progressive IN -o FILE.pmesh\n"
    "Reduces a mesh as whittle reduce does, and records every collapse: FILE.pmesh holds\n"
    "the result and how to come back from there to all of IN, vertex by vertex; whittle\n"
    "replay makes a mesh of any size of it, forward or backward, with the same bytes.\n\n"
    "  -o, --output FILE     where to; - is standard output\n"
    "  -n, --faces N|P%      how far down: faces of the base (default: 1%)\n"
    "      --vertices, --ratio, --error, --fast, --lock-boundary, --cost, --weight,\n"
    "      --placement, --attributes, --weight-of, --drop-invalid, --weld,\n"
    "      --drop-duplicates, --min-component, --memory, --threads, --temp-dir,\n"
    "      --final-faces, --report, -f, -q, -v: as for reduce\n"
    "      --cluster-faces N (0: all one), --micro-faces N (0: none)\n"
    "                        all one gives the best levels; in clusters it is faster and\n"
    "                        runs on all threads, but levels may be half as far off again.\n"
    "                        The base is what reduce leaves with the same sizes\n\n"
    "The mesh and its collapses have to fit the memory ceiling, some 200 bytes a face;\n"
    "else the run is refused with status 5 before it begins. Changes of topology, and\n"
    "what faces and their corners carry, cannot be recorded.\n";

enum { BASE_PER_CENT = 1 };

int cmd_progressive(int argc, char **argv)
{
	reduce_options o = {.params = wh_reduce_defaults(), .share = BASE_PER_CENT / 100.0};
	o.params.progressive = true;
	/* on cuts collapses come late, behind dearer ones beside them: levels would be the worse */
	o.params.cluster_faces = o.params.micro_faces = 0;
	const int status = reduce_options_parse(argc, argv, false, &o);
	if (status != WH_OK)
		return status;
	if (o.help) {
		(void)fputs(help, stdout);
		return WH_OK;
	}
	if (o.measure)
		return cmd_usage_error(argv[0], "--measure compares meshes: replay one first");
	return reduce_run(argv[0], &o, argc, argv);
}
