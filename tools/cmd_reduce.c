/* whittle reduce: options -> parameters -> one run, alone or as one of several processes. */
#include "cmd.h"
#include "reduce_options.h"
#include "reduce_run.h"

#include <stdio.h>

static const char help[] =
    "usage: whittle reduce IN -o OUT --faces N | --vertices N | --ratio R | --error E\n"
    "Reduces a mesh within a memory ceiling; the first limit reached stops. IN: PLY,\n"
    "OBJ, OFF or STL, as its content says; - is standard input.\n"
    "Colours, normals and other properties are carried as far as OUT's format has them,\n"
    "texture coordinates and materials from PLY or OBJ to PLY or OBJ; whatever is not\n"
    "is named.\n\n"
    "  -o, --output FILE     where to; - is standard output. PLY, or as the name ends:\n"
    "                        .obj, .off, .stl, .glb; compressed if it ends in .gz, .zst;\n"
    "                        any other ending is refused\n"
    "      --to F            ply, obj, off, stl, glb, ply.gz, ... whatever OUT's name is\n"
    "      --from F          IN is ply, obj, off or stl, whatever it looks like\n"
    "      --reader R        of PLY: whittle (default), or rply where it was built with\n"
    "  -n, --faces N|P%      triangles to keep: 200K, 1.5M, 10%\n"
    "      --vertices N|P%   vertices to keep\n"
    "      --ratio R         share of the triangles to keep: 0.1\n"
    "      --error E|P%      how far the surface may move, as estimated, in units of\n"
    "                        the file or per cent of the bounding-box diagonal\n"
    "      --levels LIST     several results from one run: 1M,100K,10K or 10%,1%; OUT.ply\n"
    "                        becomes OUT-1000000.ply ..., or name it OUT%f.ply\n"
    "      --levels-error LIST   the same with limits as of --error\n"
    "      --fast            less time for a little more error\n"
    "      --lock-boundary   keep boundary edges exactly\n"
    "      --smooth N        smooth the result N times (Taubin: it does not shrink), but for\n"
    "                        its boundary\n"
    "      --normals         give the result's vertices normals, the means of its faces'\n"
    "                        (this and --smooth: results of one last pass only)\n"
    "      --topology WAY    keep (default) components, handles and boundary loops, or\n"
    "                        simplify: the small ones go, to reach the count\n"
    "      --cost C          what goes first: memoryless (default), qem, qem-normals,\n"
    "                        melax, edge-length; with --weight area, uniform or angle\n"
    "                        for qem's faces\n"
    "      --placement P     of new vertices: optimal, midpoint or endpoint\n"
    "      --drop-invalid    go on without vertices that are not finite, and their faces\n"
    "      --weld EPS|P%     first make vertices that near one, and drop copies of faces;\n"
    "                        0: equal positions\n"
    "      --drop-duplicates first drop copies of faces\n"
    "      --min-component N first drop components of fewer faces\n"
    "      --attributes LIST properties to carry: all (default), none, or names,\n"
    "                        as red,green,blue or colour,normal,texture\n"
    "      --weight-of NAME=W  let a property (colour, normal, quality ...) count in the\n"
    "                        order of collapses: off by 1, or a colour by black to\n"
    "                        white, is as bad as the surface off by W % of the diagonal\n"
    "      --memory SIZE     ceiling of the process: 512M, 4G, K = 1024 (default:\n"
    "                        half of the machine's, its control group's or the job's)\n"
    "      --threads N       0 (default): all this process may use\n"
    "      --temp-dir DIR    default: $SLURM_TMPDIR, $TMPDIR, beside the output; with\n"
    "                        --run-dir only for what a rank of MPI ingests at the time\n"
    "      --run-dir DIR     a folder to keep what is done, so that a run that was\n"
    "                        killed can be resumed; gone when the result is there\n"
    "      --resume          go on with the run in the run directory, if there is one\n"
    "      --ascii           text instead of binary (PLY, STL)\n"
    "      --quantize        smaller GLB: positions of 16 bits, colours, normals of 8\n"
    "      --report FILE     what was done, as JSON\n"
    "      --measure         how far each result is from IN, in the summary and the report\n"
    "      --samples N       points a side to measure with (default: as compare)\n"
    "      --seams FILE      vertices that two clusters used at first, as a PLY of points\n"
    "  -f, --force           write over existing outputs\n"
    "  -q, --quiet           no progress and no summary (--no-progress: no progress)\n"
    "  -v, --verbose         seconds of each phase\n"
    "Sizes that decide the result's bytes, as memory and threads never do:\n"
    "      --cluster-faces N (131072; 0: all one), --micro-faces N (16384; 0: none)\n"
    "      --final-faces N   (2 clusters', 64 Ki at least) up to which the last pass is\n"
    "                        over all at once; above, it goes cluster by cluster\n"
    "      --round-keep R    (0: as few as it can) share of the faces that a round leaves at\n"
    "                        least: 0.5 makes more rounds, and each of even quality\n";

int cmd_reduce(int argc, char **argv)
{
	reduce_options o = {.params = wh_reduce_defaults()};
	const int status = reduce_options_parse(argc, argv, false, &o);
	if (status != WH_OK)
		return status;
	if (o.help) {
		(void)fputs(help, stdout);
		return WH_OK;
	}
	return wh_mpi_processes() > 1 ? reduce_run_rank(&o, argc, argv)
	                              : reduce_run(argv[0], &o, argc, argv);
}
