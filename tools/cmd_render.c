/* whittle render: options -> parameters -> one call -> a line of words. */
#define _POSIX_C_SOURCE 200809L
#include "cmd.h"
#include "progress_bar.h"
#include "render_options.h"

#include "base/timer.h"

#include <stdio.h>
#include <string.h>

static const char help[] =
    "usage: whittle render FILE... -o PICTURE.png\n"
    "A picture of a mesh (PLY, OBJ, OFF, STL), or of a cloud of points, of any size.\n\n"
    "  -o, --output FILE      where to; - is standard output\n"
    "      --size WxH         pixels (1200x900; of each on a contact sheet: 640x480)\n"
    "      --view NAME        front, back, left, right, top, bottom or iso (default: from\n"
    "                         the front, half right and above)\n"
    "      --azimuth DEG      to the right of the front\n"
    "      --elevation DEG    above the horizon\n"
    "      --up x|y|z         default: z when the mesh lies flat in it, else y\n"
    "      --zoom N           1 (default): all just fits\n"
    "      --perspective      default: parallel rays\n"
    "      --flat             shows the faces; default: smooth across edges\n"
    "      --wireframe        draws the edges, too\n"
    "      --colours          as in the file (red, green, blue of its vertices)\n"
    "      --texture[=IMAGE]  with the textures that the file names, or with this PNG or JPEG\n"
    "      --distance-to FILE coloured by the distance from this mesh, with a legend;\n"
    "      --range MAX        the last colour is this distance, in units of the file\n"
    "      --contact-sheet    several FILEs side by side, or one from six sides, or\n"
    "                         --view front,left,top; one camera for all\n"
    "      --background COL   white (default), black, grey, transparent, 1a2b3c\n"
    "      --samples N        N x N a pixel, 1 to 8 (4)\n"
    "      --memory SIZE      ceiling of the process (default: half of what there is)\n"
    "      --threads N        0 (default): all this process may use\n"
    "      --temp-dir DIR     for what the ceiling has no room for\n"
    "  -f, --force            write over an existing picture\n"
    "  -q, --quiet            no progress and no words (--no-progress: no progress)\n";

static void print_words(const render_options *o, const wh_picture_report *r, double seconds)
{
	FILE *f = strcmp(o->p.output, "-") == 0 ? stderr : stdout;
	(void)fprintf(f, "%s: %u x %u pixels, ", o->p.output, r->width, r->height);
	if (r->faces)
		(void)fprintf(f, "%llu faces, ", (unsigned long long)r->faces);
	(void)fprintf(f, "%llu vertices, %.2f s, peak memory %.0f MiB\n",
	              (unsigned long long)r->vertices, seconds, (double)cmd_peak_rss() / 1048576.0);
	if (r->range > 0)
		(void)fprintf(f, "last colour at a distance of %.6g, largest one seen %.6g\n",
		              r->range, r->distance_max);
	if (r->covered == 0)
		(void)fprintf(f, "nothing is seen of the mesh from there\n");
}

int cmd_render(int argc, char **argv)
{
	render_options o;
	const int status = render_options_parse(argc, argv, &o);
	if (status != WH_OK)
		return status;
	if (o.help) {
		(void)fputs(help, stdout);
		return WH_OK;
	}
	cmd_env e;
	progress_bar bar;
	wh_picture_report r;
	const double start = wh_seconds();
	cmd_env_init(&e, argv[0]);
	e.exec.workers = cmd_threads(argv[0], o.threads);
	progress_bar_init(&bar, !o.quiet && !o.no_progress);
	o.p.progress = progress_bar_tell;
	o.p.progress_user = &bar;
	const wh_code code = wh_picture(&e.ctx, &e.exec, &o.p, &r);
	progress_bar_end(&bar);
	if (code != WH_OK)
		return cmd_report_failure(&e);
	if (!o.quiet)
		print_words(&o, &r, wh_seconds() - start);
	return WH_OK;
}
