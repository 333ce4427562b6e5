/*
 * whittle: reduces triangle meshes larger than memory. The public interface of libwhittle.
 *
 * Calls return a wh_code; the context keeps the first failure as a sentence for the user
 * (base/status.h), which names remedies as the command's options: --memory is params->memory, and
 * so on. The library never prints, never exits and keeps no mutable globals. One call at a time may
 * use an account of memory (wh_mem), and so the contexts that share it:
 *
 *     wh_mem memory = {0};
 *     wh_ctx context = {.mem = &memory};
 *     wh_reduce_params params = wh_reduce_defaults();
 *     wh_reduce_report report;
 *     params.input = "scan.ply";
 *     params.output = "small.ply";
 *     params.faces = 1000000;
 *     if (wh_reduce(&context, &params, &report) != WH_OK)
 *             fprintf(stderr, "%s\n", context.err.text);
 */
#ifndef WHITTLE_H
#define WHITTLE_H

#define WHITTLE_VERSION "0.1.0"

#include "base/edge_view.h"
#include "base/mem.h"
#include "base/status.h"

/*
 * A run can be shared by processes on several machines that see one run directory, in stages: one
 * plans it; then each ingests a part of the input; one joins what they left, and goes on to the
 * next round; each decimates a part of its clusters; one joins again ...; one finishes. Every
 * stage can be done again at any time, and by two at once: only of PLAN, JOIN and FINISH there
 * should be one at a time. ALL does whatever is not done.
 */
typedef enum wh_stage {
	WH_STAGE_ALL,
	WH_STAGE_PLAN,     /* makes the run directory */
	WH_STAGE_INGEST,   /* one part */
	WH_STAGE_DECIMATE, /* one part of a round */
	WH_STAGE_JOIN,     /* needs all parts; goes on to where parts can share again */
	WH_STAGE_FINISH    /* needs all parts; goes on to the end */
} wh_stage;

/* Who does the parts. */
typedef enum wh_crew {
	WH_CREW_LOOSE, /* processes that come and go, each for one part: their number is fixed by
	                  PLAN, and JOIN refuses while the part of one is missing */
	WH_CREW_JOB    /* the processes of one job, which are all there at every stage: PLAN takes
	                  over a run of any number of parts, JOIN gives missing ones out again, and
	                  who is done helps the others */
} wh_crew;

/* A result on the way to the last one: its limits, as in wh_reduce_params, and where it goes. */
typedef struct wh_level {
	uint64_t faces;
	double face_ratio;
	uint64_t vertices;
	double vertex_ratio, error, error_share;
	const char *output; /* a path; of the last output's format */
} wh_level;

enum { WH_LEVELS_MOST = 64 };

/* What to do. Zero-initialise with wh_reduce_defaults. */
typedef struct wh_reduce_params {
	const char *input;  /* PLY, OBJ, OFF or STL file */
	const char *from;   /* its format: "ply", "obj", "off" or "stl"; NULL: what it looks like */
	const char *reader; /* of PLY: NULL or "whittle", or "rply" where the library was built with
	                       it (WH_E_USAGE elsewhere); decides no byte of the result */
	const char *output; /* path, or "-" for standard output */
	const char *to;     /* its format: "ply", "obj", "off", "stl" or "glb", and with ".gz" or
	                       ".zst" behind it compressed; NULL: as its name ends, or else PLY */
	bool force;         /* write over an existing output */
	bool ascii;         /* text instead of binary */
	bool quantize;      /* GLB with positions of 16 bits, normals and colours of 8 */
	bool progressive;   /* the output is no mesh but a progressive one (io/pmesh.h): the result,
	                       which is its base, and every collapse that led there; to be played
	                       with wh_replay_open. Levels, run directories, changes of topology,
	                       forms of the output and what faces carry do not go with it */
	const char *seams;  /* NULL, or a path for the cut vertices of the first partition: a binary
	                       PLY of positions; empty when there is one cluster */

	/* Limits; the first one reached stops. At least one must be set. */
	uint64_t faces;      /* triangles; 0: none */
	double face_ratio;   /* share of the input's triangles in (0, 1]; 0: none */
	uint64_t vertices;   /* 0: none */
	double vertex_ratio; /* 0: none */
	double error;        /* accumulated distance, in units of the file; 0: none */
	double error_share;  /* the same as a share of the bounding-box diagonal; 0: none */

	/* More results from the same run, the largest first, each the beginning of the next; the
	 * limits above are those of the last one. Each appears as soon as it is whole, and stays
	 * when the run fails after that. One that would be no smaller than the input is left
	 * out. */
	const wh_level *level;
	size_t levels; /* at most WH_LEVELS_MOST */

	bool simplify_topology; /* small parts, holes and handles go when their size is below the
	                           error of the moment; else the topology stays as it is */
	bool fast;              /* less time for a little more error */
	bool lock_boundary;     /* boundary edges stay exactly as they are */
	/* What is done to each result when it is there; neither for results that are streamed
	 * (WH_E_PLAN) nor for progressive meshes: */
	uint32_t smooth; /* times it is smoothed (Taubin 1995), its boundary excepted */
	bool normals;    /* vertices get normals, the means of their faces': for those that they
	                    have, or new ones */

	/* Which collapse comes first, and where it puts its vertex. NULL: the usual.
	 * cost: "memoryless" (the usual, and much the fastest), "qem", "qem-normals", "melax",
	 * "edge-length". face_weight, of faces in the quadrics of qem and the normals of
	 * qem-normals: "area" (the usual), "uniform", "angle". placement: "optimal", "midpoint",
	 * "endpoint"; the usual one is the first that goes with the cost: endpoint for melax,
	 * midpoint for edge-length, else optimal. */
	const char *cost, *face_weight, *placement;
	const wh_own_policy *own; /* a cost of the caller's own, instead; NULL: none */
	/* What goes before anything is reduced, in this order (pipeline/clean.h, sift.h): */
	bool drop_invalid;      /* vertices that are not finite, and their faces; else they are a
	                           failure */
	bool weld;              /* vertices within the distance of others become one with them */
	bool drop_duplicates;   /* all but one of faces with the same vertices; so does welding;
	                           done after it */
	double weld_distance;   /* in units of the file; 0: equal positions */
	double weld_share;      /* the same as a share of the bounding-box diagonal; 0: none */
	uint64_t min_component; /* components of fewer triangles, joined by vertices; 0: none */

	/* Scalar properties of vertices, and of faces and their corners, that are carried over:
	 * NULL or "all"; "none"; or names with commas between them, where colour, normal and
	 * texture stand for all of that kind. */
	const char *attributes;
	/* Attributes in the cost of collapses: NULL, or NAME=W with commas between them, with such
	 * names. A value that is off by 1 (a colour: as from black to white; a label: at all) costs
	 * as much as a surface that is off by W per cent of the bounding box's diagonal. */
	const char *weights;

	size_t memory;        /* ceiling of the process, bytes; 0: half of what there is */
	int threads;          /* 0: all that the process may use */
	const char *temp_dir; /* NULL: $SLURM_TMPDIR, $TMPDIR, the output's folder */

	/* A run that can be resumed keeps its temporary files in a folder of its own inside this
	 * one, which is made where it does not exist. They stay when the run fails or is killed,
	 * and go with the folder (unless something else is in it) when the result is there. NULL:
	 * no such run; else temp_dir means nothing. */
	const char *run_dir;
	bool resume; /* go on with the run in run_dir, where there is one; without it such a run is
	                refused. What decides the result's bytes must be the same. */
	wh_stage stage;
	uint32_t parts; /* of PLAN: how many there are to be; else 0 or the same number */
	uint32_t part;  /* of INGEST and DECIMATE, from 0 */
	uint32_t round; /* of DECIMATE, from 1 */
	wh_crew crew;   /* who does the parts */
	/* Told in a sentence what a resumed run goes on from. May be NULL. */
	void (*notice)(void *user, const char *text);
	void *notice_user;

	/* Sizes that decide the output's bytes; they never follow from memory or threads. */
	uint64_t cluster_faces; /* faces of a cluster, at most 100 M; 0: one cluster */
	uint64_t micro_faces;   /* faces of a micro-cluster, at most 100 M; 0: none */
	uint64_t final_faces;   /* with no more than this, the last pass is over all in memory;
	                           else the result is streamed; 0: two clusters', 64 Ki at least */
	double round_keep;      /* share of the faces that a round leaves at least, below 0.9; 0: as
	                           few as it can */

	/* Told now and then: what is being done and how far it is. May be NULL. */
	void (*progress)(void *user, const char *phase, uint64_t done, uint64_t total);
	void *progress_user;
} wh_reduce_params;

/* Phases in the order in which they run. */
typedef enum wh_phase {
	WH_PHASE_OPEN,     /* header; rewriting of text, polygons and strips */
	WH_PHASE_INGEST,   /* input to cluster files */
	WH_PHASE_SURVEY,   /* cost limit of a round */
	WH_PHASE_DECIMATE, /* rounds over the clusters */
	WH_PHASE_RECUT,    /* cutting anew between rounds */
	WH_PHASE_SETTLE,   /* rounds that end at the exact count, of a result that is streamed */
	WH_PHASE_STITCH,   /* clusters to one mesh */
	WH_PHASE_FINAL,    /* last collapses, to the exact count */
	WH_PHASE_CHECK,    /* topology of the result */
	WH_PHASE_WRITE,    /* order and output */
	WH_PHASES
} wh_phase;

/* Name of a phase, for reports. */
const char *wh_phase_name(wh_phase phase);

enum { WH_SCALING = 9 }; /* 1, 2, 4 ... 256 threads */

/* What one phase took. */
typedef struct wh_phase_report {
	double seconds;
	double serial;            /* of these, seconds with one thread at work */
	double busy;              /* seconds that all threads were at work, together */
	double model[WH_SCALING]; /* seconds that it would take with 2^k threads if nothing but
	                             whittle held them up: serial parts, the longest job, what has
	                             to be done one after the other */
	uint64_t bytes_read, bytes_written; /* files; the page cache may serve them */
	uint64_t memory_peak; /* most bytes that whittle held in it, by its own account */
} wh_phase_report;

/* What became of a level. */
typedef struct wh_level_report {
	uint64_t target_faces, target_vertices; /* as worked out; 0: none */
	uint64_t vertices, faces, bytes;
	uint64_t boundary_edges, nonmanifold_edges, components; /* where checked */
	double cost_distance, accumulated_error;
	bool left_out; /* it would be no smaller than the input; the rest is 0 */
	bool checked, streamed, one_less, exhausted;
	char checksum[33];
} wh_level_report;

/* What was done. Of several results, the last. */
typedef struct wh_reduce_report {
	uint64_t input_bytes, input_vertices, input_faces; /* faces: triangles */
	uint64_t polygons;              /* input faces with more than three corners */
	uint64_t degenerate_faces;      /* dropped: a vertex repeated */
	uint64_t unreferenced_vertices; /* dropped: in no face */
	/* dropped because the parameters say so: */
	uint64_t invalid_vertices, invalid_faces;  /* not finite, and what used them */
	uint64_t welded_vertices, collapsed_faces; /* became another vertex; lost a corner so */
	double weld_distance;                      /* as worked out */
	uint64_t joined_vertices; /* copies of others along the borders of a texture's charts */
	uint64_t duplicate_faces; /* copies of a face */
	uint64_t small_components, component_faces, component_vertices;
	uint64_t zero_area_faces; /* counted, not dropped, where one of the last three was asked
	                             for: three different vertices on a line */
	char carried[512]; /* vertex properties besides x, y and z that the output has, by name,
	                      each kind behind its last: "red, green, blue (colour), nx, ny, nz
	                      (normal)"; then those of corners and faces */
	char dropped[512]; /* what else the file holds and the output does not, by name,
	                      comma-separated */
	char refers[512];  /* files that the output names as the input does, and that have to lie
	                      beside it: of materials, and pictures */
	double diagonal;   /* of the input's bounding box */

	uint64_t output_bytes, output_vertices, output_faces;
	uint64_t collapses; /* of a progressive mesh */
	uint64_t boundary_edges, nonmanifold_edges, components, boundary_loops;
	uint64_t misoriented_edges, nonmanifold_vertices;
	uint64_t output_duplicate_faces, output_zero_area_faces,
	    folded_edges; /* as mesh/check.h has them */
	int64_t euler;
	char checksum[33]; /* XXH3-128 of the output's bytes, hexadecimal */
	bool checked;      /* the edges, components, loops and Euler characteristic are known: a
	                      streamed result with very many cut vertices may need more memory for
	                      them than there is */
	bool streamed;     /* the last round was cluster by cluster, as was the output */
	bool resumable;    /* after a failure: run_dir keeps what has been done */
	bool paused; /* what was asked for is done, and the run is not: the stage comes before the
	                end, and nothing but the input's counts is told here */
	uint32_t next_round; /* of a JOIN that paused: to be decimated in parts */

	uint64_t target_faces, target_vertices; /* as worked out; 0: none */
	bool unchanged;            /* the target was no smaller than the input: copied */
	bool one_less;             /* one face fewer than asked for: parity forbids the count */
	bool exhausted;            /* stopped above the target: nothing legal was left */
	uint64_t nonmanifold_kept; /* vertices locked because they are not manifold */
	/* With simplify_topology: vertices doubled because they were not manifold; parts removed;
	 * boundary loops closed; cuts along a triangle, each of which opens a handle or makes two
	 * parts of one; cuts along an edge between two boundary vertices. */
	uint64_t nonmanifold_split, shells, holes, necks, bridges;
	double cost_distance;     /* cost of the dearest collapse, as a distance */
	double accumulated_error; /* estimated distance of the worst vertex; 0 without a limit */

	uint64_t clusters, cut_vertices; /* of the first partition */
	uint64_t windows; /* in which it went through the vertices; 1: memory held a table of all */
	uint64_t rounds;
	uint64_t never_free_vertices; /* of the output: on a cut in every round; 65536: or more */
	int threads;
	size_t memory_ceiling, memory_peak; /* peak: whittle's own account */
	uint64_t temp_bytes_peak, bytes_read, bytes_written;
	wh_phase_report phase[WH_PHASES];
	double seconds_total;
	wh_level_report level[WH_LEVELS_MOST]; /* of each of params->level, once it is there */
	uint64_t resumed; /* times; seconds and bytes are those of all processes together */
	int ranks,
	    rank; /* of wh_reduce_mpi: processes, and which one this is; phases are its own */
} wh_reduce_report;

/* What a reduction would take, from the input's header and the parameters alone. */
typedef struct wh_plan_report {
	uint64_t input_bytes, input_vertices, input_faces; /* as the header says */
	uint64_t target_faces, target_vertices;            /* 0: none */
	bool unchanged;                                    /* the input would be copied */
	bool rewritten; /* text, polygons or strips: a temporary copy is made first; the faces are
	                   those of the header, polygons not yet cut into triangles */
	uint32_t clusters, windows;
	int rounds, passes; /* passes: over the input */
	bool streamed;
	bool shared_input; /* parts can ingest: not what has to be rewritten or unpacked first, and
	                      not with seams */
	int threads;
	size_t memory_ceiling;
	size_t memory_least; /* smallest ceiling that would not be refused */
	size_t peak_rss;     /* expected */
	uint64_t temp_bytes_peak;
} wh_plan_report;

/* Defaults of everything but input, output and limits. */
wh_reduce_params wh_reduce_defaults(void);

/*
 * Reduces a mesh. c->mem->limit is set from params->memory for the time of the call.
 *
 *     WH_OK           done; a stage before the end leaves so, too, with report->paused
 *     WH_E_TARGET     the target could not be reached; the best mesh was written
 *     WH_E_USAGE      parameters that make no sense; a resumed run with others than before
 *     WH_E_INPUT      the input cannot be read, is damaged, or is not the resumed run's
 *     WH_E_PLAN       the ceiling, or a disk, is foreseen to be too small
 *     WH_E_RUN        a disk is full or fails; a stage that came too early, and what it misses
 *     WH_E_INTERRUPT  the poll of the context asked to end
 *
 * The report is filled with the first two. With the others no output appears under its name, save
 * levels that were whole before, and perhaps the seams, where it is the output's last step that
 * fails; and nothing temporary is left but what params->run_dir keeps.
 */
wh_code wh_reduce(wh_ctx *c, const wh_reduce_params *params, wh_reduce_report *report);

/* How many processes a launcher (mpirun, srun) has started of this program, by the environment; 1:
 * none has. */
int wh_mpi_processes(void);
bool wh_mpi_is_built_in(void);

/*
 * wh_reduce by all processes of an MPI job, each of which calls it, once in its life: they share
 * the run in params->run_dir, OUTPUT.run where it is NULL, which all must see. The memory and the
 * threads are those of a process; by default the machine's are divided. The result is that of
 * wh_reduce. The first process tells the progress and has the whole report. WH_E_USAGE where MPI is
 * not built in. After a failure, once it is told, wh_reduce_mpi_abort must be called: it ends all
 * processes with that exit status; what was done can be resumed, by any number of them.
 */
wh_code wh_reduce_mpi(wh_ctx *c, const wh_reduce_params *params, wh_reduce_report *report);
void wh_reduce_mpi_abort(int status);

/*
 * Predicts what wh_reduce would do with these parameters (no output is needed). WH_OK, or
 * WH_E_PLAN where the ceiling is too small, with the report filled all the same; any other failure
 * is one that wh_reduce would begin with, too. Nothing but the header and the first faces is read.
 */
wh_code wh_plan_reduce(wh_ctx *c, const wh_reduce_params *params, wh_plan_report *report);

/* ---- progressive meshes ------------------------------------------------------------------- */

/*
 * A progressive mesh that is played (H. Hoppe, "Progressive meshes", SIGGRAPH 1996): the file that
 * wh_reduce leaves with params.progressive. Level 0 is its base, the result of that reduction; each
 * level has one vertex split more than the one before it, which makes one vertex, and one face or
 * two (rarely none); the last is the finest mesh, which was reduced. Vertices and faces of a level
 * are the first ones of the next. The bytes of a level do not depend on the way there.
 *
 * One may be used by one thread at a time, all calls with contexts of the same account. After a
 * failure of wh_replay_seek or what calls it, only closing is of use.
 */
typedef struct wh_replay wh_replay;

typedef struct wh_replay_info {
	uint64_t splits; /* of all levels */
	uint64_t base_vertices, base_faces;
	uint64_t vertices, faces; /* of the finest mesh */
	uint64_t file_bytes, input_bytes;
	double base_error; /* accumulated distance estimate, as of wh_reduce_params.error */
	double diagonal;   /* of the bounding box of the file that was reduced */
	bool coloured;     /* vertices have red, green and blue */
	uint64_t level;    /* at hand; splits done */
	uint64_t level_vertices, level_faces;
	double level_error;
	size_t memory_least; /* smallest ceiling that the finest level takes */
} wh_replay_info;

/*
 * Opens a file at its base. `memory`: ceiling of the process in bytes, which holds for every call
 * with it; 0: half of what there is. WH_E_INPUT, naming the place, for what is damaged or no such
 * file; WH_E_PLAN when the base does not fit. On failure *r is NULL.
 */
wh_code wh_replay_open(wh_ctx *c, wh_replay **r, const char *path, size_t memory);
/* NULL is allowed. *r becomes NULL. */
void wh_replay_close(wh_ctx *c, wh_replay **r);
void wh_replay_tell(const wh_replay *r, wh_replay_info *info);

/*
 * The level that these limits mean (`output` does not count): the finest with no more faces or
 * vertices, shares being those of the finest mesh, or the coarsest with no larger error; of several
 * the finest, as the first one reached stops a reduction. No limit: the last level. *reached: false
 * when even the base has more faces or vertices; then *level is 0.
 */
wh_code wh_replay_find(wh_ctx *c, wh_replay *r, const wh_level *limits, uint64_t *level,
                       bool *reached);
/* Goes to a level, forward or back; beyond the last one, to that. WH_E_PLAN, naming a ceiling that
 * does, when it does not fit; WH_E_INPUT when the file is damaged on the way. */
wh_code wh_replay_seek(wh_ctx *c, wh_replay *r, uint64_t level);

/* How a level is written; the members mean what those of wh_reduce_params do. */
typedef struct wh_replay_output {
	const char *path, *to;
	bool force, ascii, quantize;
} wh_replay_output;

/* Writes the level at hand. Of level 0 the bytes are those of the reduction's own output. checksum:
 * XXH3-128 of them, hexadecimal; NULL: nobody wants it. On failure no output appears. */
wh_code wh_replay_write(wh_ctx *c, wh_replay *r, const wh_replay_output *out, char checksum[33]);

/*
 * A morph from one level to another, either of which may be the finer one: its vertices and faces
 * are those of the finer level, which is at hand then; a vertex that the coarser one lacks begins,
 * or ends, at the place of the vertex that it was split from. Memory: that level's, and some 60
 * bytes a vertex. Failures are those of wh_replay_seek. Whatever goes to another level ends it.
 */
wh_code wh_replay_morph(wh_ctx *c, wh_replay *r, uint64_t from, uint64_t to);
/* Writes the mesh at t, from 0, the first level to the bit, to 1, the second: positions and all
 * that can be averaged along lines, normals along great circles, labels as at the nearer end. Faces
 * that only the finer level has have two corners at one place at the coarser end. */
wh_code wh_replay_write_morph(wh_ctx *c, wh_replay *r, double t, const wh_replay_output *out,
                              char checksum[33]);

/*
 * Writes the collapses from the level at hand back to a coarser one, at which it ends, one a line,
 * to a file ("-": standard output): the vertex that goes and the one that stays; x, y and z of
 * where that is then; the number of faces that vanish, and which; the number of faces that change a
 * corner, and which. Numbers have blanks between them; vertices and faces have their numbers of all
 * levels.
 */
wh_code wh_replay_text(wh_ctx *c, wh_replay *r, uint64_t level, const char *path, bool force);

#endif
