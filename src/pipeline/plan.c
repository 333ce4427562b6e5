#include "pipeline/plan.h"

#include "geom/kdtree.h"
#include "io/attributes.h"
#include "io/wedges.h"
#include "pipeline/cluster.h"
#include "pipeline/emit.h"
#include "pipeline/finish.h"
#include "pipeline/ingest.h"
#include "pipeline/inspect.h"
#include "pipeline/recut.h"
#include "pipeline/round.h"

#include <math.h>

/* ---- decisions ---------------------------------------------------------------------------- */

static const double ROUND_MARGIN = 1.25;
static const double NEAR_MARGIN = 1.03;
/* A round takes away no more than this in one go: its survey would see too few survivors. */
static const double ROUND_KEEP_LEAST = 0.02;
/* Micro-clusters, smaller still, stop earlier. */
static const double MICRO_KEEP_LEAST = 0.125;
/* Above this share there is too little to do for a round to be worth its passes. */
static const double ROUND_KEEP_MOST = 0.7;
/* A round that leaves more than this is the last one. */
static const double ROUND_NO_PROGRESS = 0.9;

/* Vertices on the border of a piece, per square root of its faces (measured). */
static const double BORDER_LEFT = 4.4;
static const double KEEP_OF_PIECE_MOST = 0.5;
/* So little always fits one pass: some 12 MiB. */
static const uint64_t FINAL_LEAST = 64ULL * 1024;

double wh_plan_skew(uint32_t cut)
{
	static const double skew[] = {0.4, 0.56, 0.43, 0.62, 0.36};
	return cut == 0 ? 0.5 : skew[(cut - 1) % (sizeof skew / sizeof *skew)];
}

uint32_t wh_plan_clusters(const wh_plan_sizes *s, uint64_t faces)
{
	if (s->cluster_faces == 0)
		return 1;
	const uint64_t n = (faces + s->cluster_faces / 2) / s->cluster_faces;
	return n < 1 ? 1 : n > WH_MAX_CLUSTERS ? WH_MAX_CLUSTERS : (uint32_t)n;
}

uint64_t wh_plan_final_limit(const wh_plan_sizes *s)
{
	if (s->final_faces)
		return s->final_faces;
	if (s->cluster_faces == 0)
		return UINT64_MAX;
	return 2 * s->cluster_faces > FINAL_LEAST ? 2 * s->cluster_faces : FINAL_LEAST;
}

/* The locked border of a piece of n faces is a share of about 4.4 / sqrt(n) of its vertices; a
 * piece that keeps less than twice that is all border, and its inside is worse than it had to be.
 */
static double keep_of_piece(double faces)
{
	return fmin(2 * BORDER_LEFT / sqrt(faces), KEEP_OF_PIECE_MOST);
}

double wh_plan_keep(const wh_plan_sizes *s, uint64_t faces, double share)
{
	const uint32_t clusters = wh_plan_clusters(s, faces);
	const double border = clusters > 1 ? keep_of_piece((double)faces / clusters) : 0;
	const double least = fmax(s->round_keep, ROUND_KEEP_LEAST);
	return fmax(ROUND_MARGIN * share, fmax(border, least));
}

double wh_plan_keep_near(double share)
{
	return fmin(NEAR_MARGIN * share, 1);
}

double wh_plan_keep_micro(const wh_plan_sizes *s, double keep)
{
	const double border = s->micro_faces ? keep_of_piece((double)s->micro_faces) : 0;
	return fmax(keep, fmax(border, MICRO_KEEP_LEAST));
}

bool wh_plan_round_pays(double share)
{
	return !(share > 0) || ROUND_MARGIN * share <= ROUND_KEEP_MOST;
}

bool wh_plan_go_on(const wh_plan_sizes *s, uint32_t clusters, uint64_t before, uint64_t after,
                   double share)
{
	return clusters > 1 && after > wh_plan_final_limit(s) &&
	       (double)after <= ROUND_NO_PROGRESS * (double)before &&
	       ROUND_MARGIN * share <= ROUND_KEEP_MOST;
}

bool wh_plan_streams(const wh_plan_sizes *s, uint32_t clusters, uint64_t faces)
{
	return clusters > 1 && faces > wh_plan_final_limit(s);
}

/* ---- what is expected --------------------------------------------------------------------- */

/* Measured on scans and generated surfaces. */
static const double TOUCHED_BASE = 6.5 * 1048576; /* program and libraries */
/* Of the engine's arrays, a face: the more is collapsed, the more of them. */
static const double TOUCHED_ROUND = 95, TOUCHED_SETTLE = 126, TOUCHED_FINAL = 118;
static const double TOUCHED_CUT = 20;  /* of those that cut into micro-clusters */
static const double UNEVEN = 1.02;     /* clusters larger than their share */
static const double MICRO_LEFT = 0.03; /* that the borders of micro-clusters add */
static const double TOUCHED_RECUT = 20, TOUCHED_CHECK = 40, TOUCHED_EMIT = 42;
static const double SAVE_BUFFER = 256 * 1024;
static const double KEPT_FREE = 1.6 * 1048576; /* in a round: freed blocks that fit nowhere */
enum { MIB = 1024 * 1024 };
/* The share that a round keeps at which its borders add a third of what they hold. */
static const double BORDER_FADES = 0.108;
/* Without a count nobody knows what is left: what is assumed of a round, and of all. */
static const double GUESSED_KEEP = 0.5, GUESSED_LEFT = 0.01;
/* Vertices that a cluster has besides its own, per square root of its faces. */
static const double VISITORS = 6;

typedef struct forecast {
	const wh_plan_query *q;
	wh_plan *p;
	uint32_t attr;     /* bytes of a vertex' attributes */
	uint32_t face;     /* bytes of what a face and its corners carry */
	double id, vertex; /* bytes of an id, of a vertex record without its error bound */
	double faces;      /* now */
	double store;      /* bytes of the cluster files now */
	uint32_t clusters; /* that the mesh is cut into now */
	uint32_t cuts;     /* partitions after the first */
} forecast;

static double largest_cluster(const forecast *f)
{
	const double share = wh_kdtree_largest(f->clusters, wh_plan_skew(f->cuts));
	return f->clusters == 1 ? f->faces : UNEVEN * share * f->faces;
}

/* Layout of the cluster files: after a cut, or as a round leaves them. */
static wh_store layout(const forecast *f, bool cut)
{
	return (wh_store){.clusters = f->clusters,
	                  .id_bytes = (uint32_t)f->id,
	                  .coord_bytes = f->q->source.is_double ? 8 : 4,
	                  .vertex_payload = cut && f->p->rounds == 0 ? 0 : sizeof(float),
	                  .attr_bytes = f->attr,
	                  .face_bytes = f->face,
	                  .local_corners = !cut};
}

static void disk(forecast *f, double more)
{
	const double now = f->store + more;
	if (now > (double)f->p->peak_disk)
		f->p->peak_disk = (uint64_t)now;
}

/* Cluster files with global ids as corners, as they are after a cut ... */
static double cut_store(const forecast *f, double payload)
{
	const double clusters = f->clusters;
	const double visitors = clusters > 1 ? VISITORS * sqrt(f->faces / clusters) * clusters : 0;
	return f->faces * (3 * f->id + f->face) + (f->faces / 2 + visitors) * (f->vertex + payload);
}

/* ... and with local ones, as a round leaves them. */
static double round_store(const forecast *f, double faces)
{
	return faces * (12 + (double)f->face) + faces * 0.52 * (f->vertex + sizeof(float));
}

static double patch_of(const forecast *f, double nf)
{
	return nf * (12 + (double)f->face + 0.5 * (37 + (double)f->attr));
}

/* Bytes of a cluster as it is loaded: its file, the patch, the places of its ids. */
static double loaded(const forecast *f, double nf)
{
	const double payload = f->p->rounds > 0 ? sizeof(float) : 0;
	return nf * (3 * f->id + f->face + 0.5 * (f->vertex + payload)) + patch_of(f, nf) + nf * 2;
}

static void stage(forecast *f, wh_plan_stage s, double need, double expect)
{
	wh_plan *p = f->p;
	const size_t ceiling = f->q->memory;
	const double room = ceiling > WH_PLAN_BASE ? (double)(ceiling - WH_PLAN_BASE) : 0;
	double workers = floor(room / need);
	workers = fmax(1, fmin(workers, f->q->threads));
	if (s == WH_PLAN_FINAL)
		workers = 1;
	if (expect * workers > (double)p->stage[s].expect) {
		p->stage[s].expect = (size_t)(expect * workers);
	}
	if (need > (double)p->stage[s].need)
		p->stage[s].need = (size_t)need;
}

/* At most as many workers as there are clusters. */
static double busy(const forecast *f, double expect)
{
	const double clusters = f->clusters;
	return clusters < f->q->threads ? expect * clusters / f->q->threads : expect;
}

/* Room for clusters that turn out larger than they should. */
static const double RESERVE = 1.15;

static double cluster_need(const forecast *f, double nf)
{
	const wh_store s = layout(f, true);
	return (double)wh_round_bytes(&s, (uint64_t)(0.55 * RESERVE * nf), (uint64_t)(RESERVE * nf),
	                              f->q->state);
}

/* Of the state that the engine's policy keeps, a face. */
static double state_of(const forecast *f)
{
	return 0.5 * (double)f->q->state;
}

/* A round that keeps a share of the faces. */
static void round_of(forecast *f, double keep)
{
	const double nf = largest_cluster(f), micro = (double)f->q->sizes.micro_faces;
	const bool cut = micro > 0 && nf > 2 * micro;
	const double whole =
	    cut ? (wh_plan_keep_micro(&f->q->sizes, keep) + MICRO_LEFT) * nf + micro : nf;
	const double expect = loaded(f, nf) + (cut ? TOUCHED_CUT * nf : 0) +
	                      (TOUCHED_ROUND + state_of(f)) * fmin(whole, nf + micro) +
	                      SAVE_BUFFER + (cut ? KEPT_FREE : 0);
	stage(f, WH_PLAN_ROUND, cluster_need(f, nf), busy(f, expect));
	const double border =
	    BORDER_LEFT / sqrt(f->faces / f->clusters) * exp(-pow(keep / BORDER_FADES, 2));
	/* micro-clusters that keep as much as the whole are all that is done */
	const bool last = cut && wh_plan_keep_micro(&f->q->sizes, keep) <= keep;
	const double left = keep + (f->clusters > 1 ? border : 0) + (last ? MICRO_LEFT : 0);
	const double after = fmin(f->faces * left, f->faces);
	const double next = round_store(f, after);
	disk(f, next);
	f->store = next;
	f->faces = after;
	f->p->rounds++;
}

static void recut(forecast *f)
{
	const double old = largest_cluster(f);
	const wh_store from = layout(f, false);
	const uint32_t clusters = wh_plan_clusters(&f->q->sizes, (uint64_t)f->faces);
	const size_t need = wh_recut_bytes(&from, clusters, (uint64_t)(0.55 * RESERVE * old),
	                                   (uint64_t)(RESERVE * old), (uint64_t)(0.52 * f->faces));
	stage(f, WH_PLAN_RECUT, (double)need, busy(f, loaded(f, old) + TOUCHED_RECUT * old));
	f->cuts++;
	f->clusters = clusters;
	const double next = cut_store(f, sizeof(float));
	disk(f, next);
	f->store = next;
}

static void settle(forecast *f, double target)
{
	const double nf = largest_cluster(f);
	const double expect = loaded(f, nf) + (TOUCHED_SETTLE + state_of(f)) * nf + SAVE_BUFFER;
	stage(f, WH_PLAN_SETTLE, cluster_need(f, nf), busy(f, expect));
	const double next = round_store(f, target);
	disk(f, next);
	f->store = next;
	f->faces = target;
	f->p->rounds++;
	const wh_store s = layout(f, false);
	const uint64_t most_v = (uint64_t)(0.55 * RESERVE * nf), most_f = (uint64_t)(RESERVE * nf);
	stage(f, WH_PLAN_CHECK, (double)wh_inspect_bytes(&s, most_v, most_f),
	      busy(f, loaded(f, nf) + TOUCHED_CHECK * nf));
	stage(f, WH_PLAN_EMIT, (double)wh_emit_bytes(&s, f->q->doubled, most_v, most_f),
	      busy(f, loaded(f, nf) + TOUCHED_EMIT * nf));
}

/* The rounds of a run without a count are those of one that keeps as much as it can. */
static double share_of(const forecast *f)
{
	const double all = (double)f->q->source.nf;
	return f->q->share > 0 ? f->q->share * all / f->faces : 0;
}

static void rounds(forecast *f)
{
	const wh_plan_sizes *s = &f->q->sizes;
	if (f->clusters == 1 && (s->micro_faces == 0 || f->faces <= 2 * (double)s->micro_faces))
		return;
	for (bool on = wh_plan_round_pays(share_of(f)); on;) {
		const uint32_t clusters = f->clusters;
		const double before = f->faces;
		if (f->p->rounds > 0)
			recut(f);
		round_of(f, f->q->share > 0 ? wh_plan_keep(s, (uint64_t)f->faces, share_of(f))
		                            : GUESSED_KEEP);
		on = wh_plan_go_on(s, clusters, (uint64_t)before, (uint64_t)f->faces, share_of(f));
	}
}

static void last_rounds(forecast *f)
{
	const double target =
	    fmin(f->faces, fmax(f->q->share, GUESSED_LEFT) * (double)f->q->source.nf);
	f->p->streams = true;
	while (f->p->rounds < WH_PLAN_ROUNDS_BEFORE_SETTLING) {
		if (f->p->rounds > 0)
			recut(f);
		round_of(f, wh_plan_keep_near(share_of(f)));
	}
	recut(f);
	settle(f, target);
}

static void last_pass(forecast *f)
{
	const uint64_t nf = (uint64_t)f->faces, nv = nf / 2;
	stage(f, WH_PLAN_FINAL,
	      1.08 * (double)wh_finish_bytes(nv, nf, f->attr, f->face, f->q->state),
	      f->faces * (TOUCHED_FINAL + state_of(f)) + patch_of(f, f->faces));
}

static void largest_last_pass(forecast *f)
{
	const double most =
	    fmin((double)wh_plan_final_limit(&f->q->sizes), (double)f->q->source.nf);
	const size_t need =
	    wh_finish_bytes((uint64_t)(most / 2), (uint64_t)most, f->attr, f->face, f->q->state);
	if (need > f->p->stage[WH_PLAN_FINAL].need)
		f->p->stage[WH_PLAN_FINAL].need = need;
}

static void ingest(forecast *f)
{
	wh_plan *p = f->p;
	wh_exec ex = {.workers = f->q->threads};
	wh_ingest_params in = {.clusters = p->clusters};
	const wh_source *src = &f->q->source;
	const size_t ceiling = f->q->memory;
	p->stage[WH_PLAN_INGEST].need = wh_ingest_fit(src, 0, &(wh_exec){.workers = 1}, &in);
	(void)wh_ingest_fit(src, ceiling > WH_PLAN_BASE ? ceiling - WH_PLAN_BASE : 0, &ex, &in);
	const double full = cut_store(f, 0) / p->clusters;
	if (full < (double)in.buffer)
		in.buffer = (size_t)full;
	in.visits = 0;
	p->stage[WH_PLAN_INGEST].expect = wh_ingest_bytes(src, &ex, &in);

	p->windows = in.window ? (uint32_t)((src->nv + in.window - 1) / in.window) : 1;
	p->passes = p->windows > 1 ? 4 + (int)p->windows : 4;
	f->store = cut_store(f, 0);
	const double side = p->windows > 1 ? 6 * f->faces : 0; /* cells of the corners */
	disk(f, (double)f->q->rewrite_bytes + side);
}

const char *wh_plan_stage_name(wh_plan_stage stage)
{
	static const char *const name[WH_PLAN_STAGES] = {
	    "reading the input", "a cluster",          "cutting anew",     "a cluster",
	    "the final pass",    "checking a cluster", "writing a cluster"};
	return name[stage];
}

void wh_plan_make(const wh_plan_query *q, wh_plan *p)
{
	*p = (wh_plan){.clusters = wh_plan_clusters(&q->sizes, q->source.nf)};
	const double id = q->source.nv < (uint64_t)1 << 30 ? 4 : 8;
	const uint32_t attr = q->source.attributes ? q->source.attributes->bytes : 0;
	forecast f = {.q = q,
	              .p = p,
	              .attr = attr,
	              .face = q->source.wedges ? q->source.wedges->bytes : 0,
	              .id = id,
	              .vertex = id + (q->source.is_double ? 24 : 12) + attr,
	              .clusters = p->clusters,
	              .faces = (double)q->source.nf};
	ingest(&f);
	rounds(&f);
	if (wh_plan_streams(&q->sizes, f.clusters, (uint64_t)f.faces))
		last_rounds(&f);
	else
		last_pass(&f);
	if (!(q->share > 0)) /* anything may be left, a last pass of the largest size included */
		largest_last_pass(&f);
	double most = 0, need = 0;
	for (int s = 0; s < WH_PLAN_STAGES; s++) {
		most = fmax(most, (double)p->stage[s].expect);
		need = fmax(need, (double)p->stage[s].need);
	}
	p->peak_ram = (size_t)(most + TOUCHED_BASE);
	p->least = (((size_t)need + WH_PLAN_BASE) / MIB + 2) * MIB;
}
