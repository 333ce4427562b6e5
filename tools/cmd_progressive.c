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
    "      --cluster-faces N (131072; 0: all one), --micro-faces N (0: none)\n"
    "      --round-keep R    (0.5) share of the faces that a round leaves at least. With\n"
    "                        less, or with micro-clusters, it takes less time, but levels\n"
    "                        may be half as far off again. The base is what reduce leaves\n"
    "                        with the same sizes\n\n"
    "Meshes of any size go within --memory (40M do), on some 200 bytes of temporary disk\n"
    "a face. Changes of topology, and what faces and their corners carry, cannot be\n"
    "recorded; the base has to fit one last pass (--final-faces).\n";

enum { BASE_PER_CENT = 1 };
static const double ROUND_KEEP = 0.5;

int cmd_progressive(int argc, char **argv)
{
	reduce_options o = {.params = wh_reduce_defaults(), .share = BASE_PER_CENT / 100.0};
	o.params.progressive = true;
	/* on cuts collapses come late, behind dearer ones beside them: the shorter the rounds, the
	 * less there is of that */
	o.params.micro_faces = 0;
	o.params.round_keep = ROUND_KEEP;
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
