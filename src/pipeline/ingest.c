/*
 * The partition is a k-d tree over a sample of the vertices (geom/kdtree). A vertex is at home in
 * the cell it lies in; a face goes to the cell that most of its corners are at home in, or, when
 * all three differ, to the least. A vertex that is used by a face outside its home is a cut
 * vertex; (vertex, cluster) pairs of such uses are collected and sorted, and tell the last pass
 * where to send the vertex besides its home. They are few: the vertices along the cuts.
 */
#include "pipeline/ingest.h"

#include "geom/kdtree.h"

#include <float.h>
#include <stdlib.h>
#include <string.h>

enum {
	CHUNK = 32 * 1024,   /* vertices or faces a job */
	SAMPLE = 256 * 1024, /* vertices the tree is built from, up to twice as many ... */
	SAMPLE_EACH = 64     /* ... and no fewer than this for a cluster */
};

/* Exponents of two. */
enum {
	SIZE_MOST = 32,    /* meshes up to this size, and down to its inverse, are not scaled */
	SHIFT_MOST = 1000, /* no scale overflows, nor does its inverse */
	STEP_BITS = 26     /* steps of new positions in the size of a double mesh */
};

/* A use of a vertex outside its home. */
typedef struct visit {
	uint64_t gid;
	uint32_t cluster;
} visit;

typedef struct visits {
	visit *item;
	size_t n, cap;
} visits;

/* Records of one chunk on their way to several clusters, grouped by cluster. */
typedef struct parcel {
	uint8_t *bytes;
	uint32_t *cluster;   /* of each record */
	uint32_t *order;     /* records by cluster, stable */
	size_t cap, n, size; /* size: bytes of a record */
} parcel;

/* What one worker needs. */
typedef struct bench {
	void *raw;
	double *xyz;
	uint64_t *ids;
	parcel out;
	visits away;
	uint64_t degenerate;
	wh_vec3 lo, hi;
	wh_vec3 *sample;
	size_t samples;
	uint32_t *start; /* clusters + 1 counters, zero between uses */
} bench;

typedef struct ingest {
	const wh_source *src;
	wh_store *store;
	wh_progress *progress;
	wh_ingest_result *result;
	uint32_t clusters;
	bench *worker;
	wh_kdtree tree;
	wh_vec3 *sample;
	size_t samples, sample_cap;
	uint64_t stride; /* every stride-th vertex is in the sample */
	uint16_t *home;
	visits away;
	wh_store_writer *writer;
} ingest;

static size_t chunk_items(uint64_t total, int64_t index)
{
	const uint64_t left = total - (uint64_t)index * CHUNK;
	return left < CHUNK ? (size_t)left : CHUNK;
}

static int64_t chunks_of(uint64_t total)
{
	return (int64_t)((total + CHUNK - 1) / CHUNK);
}

static size_t sample_size(uint32_t clusters)
{
	const size_t wanted = (size_t)SAMPLE_EACH * clusters;
	return wanted > SAMPLE ? wanted : SAMPLE;
}

/* ---- pass 1: bounds and sample ------------------------------------------------------------ */

static wh_code bounds_job(wh_ctx *c, void *arg, int64_t index, int worker)
{
	ingest *g = arg;
	bench *b = &g->worker[worker];
	const uint64_t first = (uint64_t)index * CHUNK;
	const size_t n = chunk_items(g->src->nv, index);
	if (wh_source_vertices(c, g->src, first, n, b->xyz, b->raw) != WH_OK)
		return c->err.code;
	b->lo = b->hi = wh_v3(b->xyz[0], b->xyz[1], b->xyz[2]);
	b->samples = 0;
	for (size_t i = 0; i < n; i++) {
		const double *p = &b->xyz[3 * i];
		b->lo = wh_v3(fmin(b->lo.x, p[0]), fmin(b->lo.y, p[1]), fmin(b->lo.z, p[2]));
		b->hi = wh_v3(fmax(b->hi.x, p[0]), fmax(b->hi.y, p[1]), fmax(b->hi.z, p[2]));
		if ((first + i) % g->stride == 0)
			b->sample[b->samples++] = wh_v3(p[0], p[1], p[2]);
	}
	return WH_OK;
}

static wh_code bounds_commit(wh_ctx *c, void *arg, int64_t index, int worker)
{
	ingest *g = arg;
	const bench *b = &g->worker[worker];
	wh_ingest_result *r = g->result;
	if (index == 0) {
		r->lo = b->lo;
		r->hi = b->hi;
	}
	r->lo = wh_v3(fmin(r->lo.x, b->lo.x), fmin(r->lo.y, b->lo.y), fmin(r->lo.z, b->lo.z));
	r->hi = wh_v3(fmax(r->hi.x, b->hi.x), fmax(r->hi.y, b->hi.y), fmax(r->hi.z, b->hi.z));
	if (wh_reserve(c, &g->sample, &g->sample_cap, g->samples + b->samples, sizeof *g->sample))
		return c->err.code;
	memcpy(g->sample + g->samples, b->sample, b->samples * sizeof *b->sample);
	g->samples += b->samples;
	wh_progress_add(g->progress, chunk_items(g->src->nv, index));
	return WH_OK;
}

/* Size of the mesh as an exponent of two, from differences of positions, which are the same
 * wherever it lies. Outliers do not count as long as there is anything else. */
static int exponent_of_size(const ingest *g)
{
	const wh_vec3 box[2] = {wh_scale(g->result->lo, 0.5), wh_scale(g->result->hi, 0.5)};
	double most = 0, side = 0;
	for (uint32_t axis = 0; axis < 3; axis++) {
		most = fmax(most, wh_spread(g->sample, g->samples, axis));
		side = fmax(side, wh_axis(&box[1], axis) - wh_axis(&box[0], axis));
	}
	if (isinf(most))
		return DBL_MAX_EXP - 1;
	if (most > 0)
		return ilogb(most);
	return side > 0 ? ilogb(side) + 1 : 0;
}

/*
 * Positions stay where they are, however far from zero: the stages compute with differences of
 * them alone, and a vertex that never moves keeps every bit. Only units out of the ordinary are
 * changed, by a power of two, which changes no digit: on the way to a new position stand twelfth
 * powers of lengths.
 *
 * The step of new positions in a double mesh is a quarter of what a float's would be at the rim of
 * a mesh around zero. Whole steps are still doubles as far off as 2^26 times the size: up to there
 * a mesh whose positions are whole steps gives the same result wherever it lies.
 */
static void choose_units(const ingest *g)
{
	const int size = exponent_of_size(g);
	const int scaled = size > SIZE_MOST ? SIZE_MOST : size < -SIZE_MOST ? -SIZE_MOST : size;
	const int shift = scaled - size < SHIFT_MOST ? scaled - size : SHIFT_MOST;
	g->result->scale = ldexp(1, shift);
	g->result->step = g->src->is_double ? ldexp(1, size + shift - STEP_BITS) : 0;
}

/* ---- pass 2: the cell of each vertex ------------------------------------------------------ */

static wh_vec3 vertex_at(const bench *b, size_t i)
{
	return wh_v3(b->xyz[3 * i], b->xyz[3 * i + 1], b->xyz[3 * i + 2]);
}

static wh_code home_job(wh_ctx *c, void *arg, int64_t index, int worker)
{
	ingest *g = arg;
	bench *b = &g->worker[worker];
	const uint64_t first = (uint64_t)index * CHUNK;
	const size_t n = chunk_items(g->src->nv, index);
	if (wh_source_vertices(c, g->src, first, n, b->xyz, b->raw) != WH_OK)
		return c->err.code;
	for (size_t i = 0; i < n; i++) {
		const wh_vec3 p = vertex_at(b, i);
		g->home[first + i] = (uint16_t)wh_kdtree_cell(&g->tree, &p);
	}
	wh_progress_add(g->progress, n);
	return WH_OK;
}

/* ---- records to clusters ------------------------------------------------------------------ */

static wh_code parcel_make(wh_ctx *c, parcel *p, size_t size, size_t cap)
{
	*p = (parcel){.size = size, .cap = cap};
	p->bytes = wh_alloc(c, cap, size);
	p->cluster = wh_alloc(c, cap, sizeof *p->cluster);
	p->order = wh_alloc(c, cap, sizeof *p->order);
	return p->bytes && p->cluster && p->order ? WH_OK : c->err.code;
}

static void parcel_free(wh_ctx *c, parcel *p)
{
	wh_free(c, p->bytes);
	wh_free(c, p->cluster);
	wh_free(c, p->order);
	*p = (parcel){0};
}

/* Grows a parcel to hold one more record. */
static wh_code parcel_room(wh_ctx *c, parcel *p)
{
	if (p->n < p->cap)
		return WH_OK;
	size_t cap_bytes = p->cap * p->size, cap_cluster = p->cap, cap_order = p->cap;
	const size_t need = 2 * p->cap;
	if (wh_reserve(c, &p->bytes, &cap_bytes, need * p->size, 1) != WH_OK ||
	    wh_reserve(c, &p->cluster, &cap_cluster, need, sizeof *p->cluster) != WH_OK ||
	    wh_reserve(c, &p->order, &cap_order, need, sizeof *p->order) != WH_OK)
		return c->err.code;
	p->cap = need;
	return WH_OK;
}

/* Orders the records by cluster (counting sort; `start` holds clusters + 1 zeros, and again
 * afterwards). */
static void parcel_sort(parcel *p, uint32_t clusters, uint32_t *start)
{
	for (size_t i = 0; i < p->n; i++)
		start[p->cluster[i] + 1]++;
	for (uint32_t k = 0; k < clusters; k++)
		start[k + 1] += start[k];
	for (size_t i = 0; i < p->n; i++)
		p->order[start[p->cluster[i]]++] = (uint32_t)i;
	memset(start, 0, ((size_t)clusters + 1) * sizeof *start);
}

static wh_code parcel_deliver(wh_ctx *c, ingest *g, const parcel *p, bool are_faces)
{
	for (size_t i = 0; i < p->n; i++) {
		const uint32_t r = p->order[i], k = p->cluster[r];
		wh_store_writer *w = &g->writer[k];
		if (wh_store_append(c, g->store, k, w, p->bytes + r * p->size, p->size) != WH_OK)
			return c->err.code;
		if (are_faces)
			w->faces++;
		else
			w->vertices++;
	}
	return WH_OK;
}

/* ---- pass 3: faces ------------------------------------------------------------------------ */

static int compare_visits(const void *x, const void *y)
{
	const visit *a = x, *b = y;
	if (a->gid != b->gid)
		return a->gid < b->gid ? -1 : 1;
	return (a->cluster > b->cluster) - (a->cluster < b->cluster);
}

static void visits_unique(visits *v)
{
	if (v->n == 0)
		return;
	qsort(v->item, v->n, sizeof *v->item, compare_visits);
	size_t kept = 1;
	for (size_t i = 1; i < v->n; i++)
		if (compare_visits(&v->item[i], &v->item[kept - 1]) != 0)
			v->item[kept++] = v->item[i];
	v->n = kept;
}

static wh_code visits_add(wh_ctx *c, visits *v, uint64_t gid, uint32_t cluster)
{
	if (wh_reserve(c, &v->item, &v->cap, v->n + 1, sizeof *v->item) != WH_OK)
		return c->err.code;
	v->item[v->n++] = (visit){gid, cluster};
	return WH_OK;
}

static void put_face(const wh_store *s, uint8_t *at, const uint64_t *t)
{
	if (s->id_bytes == 8) {
		memcpy(at, t, 24);
		return;
	}
	const uint32_t narrow[3] = {(uint32_t)t[0], (uint32_t)t[1], (uint32_t)t[2]};
	memcpy(at, narrow, sizeof narrow);
}

static wh_code face_job(wh_ctx *c, void *arg, int64_t index, int worker)
{
	ingest *g = arg;
	bench *b = &g->worker[worker];
	const size_t n = chunk_items(g->src->nf, index);
	const wh_code code =
	    wh_source_triangles(c, g->src, (uint64_t)index * CHUNK, n, b->ids, b->raw);
	if (code != WH_OK)
		return code;
	b->out.n = b->away.n = b->degenerate = 0;
	for (size_t i = 0; i < n; i++) {
		const uint64_t *t = &b->ids[3 * i];
		if (t[0] == t[1] || t[1] == t[2] || t[2] == t[0]) {
			b->degenerate++;
			continue;
		}
		const uint32_t home[3] = {g->home[t[0]], g->home[t[1]], g->home[t[2]]};
		const uint32_t k = wh_kdtree_majority(home[0], home[1], home[2]);
		put_face(g->store, b->out.bytes + b->out.n * b->out.size, t);
		b->out.cluster[b->out.n++] = k;
		for (int j = 0; j < 3; j++)
			if (home[j] != k && visits_add(c, &b->away, t[j], k) != WH_OK)
				return c->err.code;
	}
	visits_unique(&b->away);
	parcel_sort(&b->out, g->clusters, b->start);
	return WH_OK;
}

static wh_code face_commit(wh_ctx *c, void *arg, int64_t index, int worker)
{
	ingest *g = arg;
	const bench *b = &g->worker[worker];
	const size_t n = g->away.n + b->away.n;
	if (wh_reserve(c, &g->away.item, &g->away.cap, n, sizeof(visit)) != WH_OK)
		return c->err.code;
	if (b->away.n)
		memcpy(g->away.item + g->away.n, b->away.item, b->away.n * sizeof(visit));
	g->away.n = n;
	g->result->degenerate += b->degenerate;
	g->result->faces += b->out.n;
	wh_progress_add(g->progress, chunk_items(g->src->nf, index));
	return parcel_deliver(c, g, &b->out, true);
}

/* ---- pass 4: vertices --------------------------------------------------------------------- */

/* First visit of a vertex >= gid. */
static size_t visits_from(const visits *v, uint64_t gid)
{
	size_t lo = 0, hi = v->n;
	while (lo < hi) {
		const size_t mid = lo + (hi - lo) / 2;
		if (v->item[mid].gid < gid)
			lo = mid + 1;
		else
			hi = mid;
	}
	return lo;
}

static wh_code send_vertex(wh_ctx *c, ingest *g, parcel *out, uint32_t cluster, uint64_t gid,
                           bool cut, wh_vec3 p)
{
	if (parcel_room(c, out) != WH_OK)
		return c->err.code;
	(void)wh_store_put_vertex(g->store, out->bytes + out->n * out->size, gid, cut, p, 0);
	out->cluster[out->n++] = cluster;
	return WH_OK;
}

static wh_code vertex_job(wh_ctx *c, void *arg, int64_t index, int worker)
{
	ingest *g = arg;
	bench *b = &g->worker[worker];
	const uint64_t first = (uint64_t)index * CHUNK;
	const size_t n = chunk_items(g->src->nv, index);
	if (wh_source_vertices(c, g->src, first, n, b->xyz, b->raw) != WH_OK)
		return c->err.code;
	b->out.n = 0;
	size_t v = visits_from(&g->away, first);
	for (size_t i = 0; i < n; i++) {
		const uint64_t gid = first + i;
		const wh_vec3 p = wh_scale(vertex_at(b, i), g->result->scale);
		const bool cut = v < g->away.n && g->away.item[v].gid == gid;
		if (send_vertex(c, g, &b->out, g->home[gid], gid, cut, p) != WH_OK)
			return c->err.code;
		for (; v < g->away.n && g->away.item[v].gid == gid; v++)
			if (send_vertex(c, g, &b->out, g->away.item[v].cluster, gid, cut, p) !=
			    WH_OK)
				return c->err.code;
	}
	parcel_sort(&b->out, g->clusters, b->start);
	return WH_OK;
}

static wh_code vertex_commit(wh_ctx *c, void *arg, int64_t index, int worker)
{
	ingest *g = arg;
	wh_progress_add(g->progress, chunk_items(g->src->nv, index));
	return parcel_deliver(c, g, &g->worker[worker].out, false);
}

/* ---- all of it ---------------------------------------------------------------------------- */

static size_t larger(size_t a, size_t b)
{
	return a > b ? a : b;
}

static size_t raw_bytes(const wh_source *src)
{
	return larger(wh_source_vertex_bytes(src, CHUNK), wh_source_triangle_bytes(src, CHUNK));
}

static wh_code benches_make(wh_ctx *c, ingest *g, int workers)
{
	const size_t face = 3 * (size_t)g->store->id_bytes;
	const size_t record = larger(face, wh_store_vertex_bytes(g->store));
	g->worker = wh_calloc(c, (size_t)workers, sizeof *g->worker);
	for (int i = 0; g->worker && i < workers; i++) {
		bench *b = &g->worker[i];
		b->raw = wh_alloc(c, raw_bytes(g->src), 1);
		b->xyz = wh_alloc(c, CHUNK, 3 * sizeof *b->xyz);
		b->ids = wh_alloc(c, CHUNK, 3 * sizeof *b->ids);
		b->sample = wh_alloc(c, CHUNK, sizeof *b->sample);
		b->start = wh_calloc(c, (size_t)g->clusters + 1, sizeof *b->start);
		if (!b->raw || !b->xyz || !b->ids || !b->sample || !b->start ||
		    parcel_make(c, &b->out, record, CHUNK) != WH_OK)
			return c->err.code;
	}
	return g->worker ? WH_OK : c->err.code;
}

static void benches_free(wh_ctx *c, ingest *g, int workers)
{
	for (int i = 0; g->worker && i < workers; i++) {
		bench *b = &g->worker[i];
		wh_free(c, b->raw);
		wh_free(c, b->xyz);
		wh_free(c, b->ids);
		wh_free(c, b->sample);
		wh_free(c, b->start);
		wh_free(c, b->away.item);
		parcel_free(c, &b->out);
	}
	wh_free(c, g->worker);
}

static void set_record_size(ingest *g, int workers, size_t size)
{
	for (int i = 0; i < workers; i++)
		g->worker[i].out.size = size;
}

static wh_code writers_begin(wh_ctx *c, ingest *g, size_t buffer)
{
	g->writer = wh_calloc(c, g->clusters, sizeof *g->writer);
	for (uint32_t k = 0; g->writer && k < g->clusters; k++)
		if (wh_store_begin(c, g->store, k, &g->writer[k], buffer) != WH_OK)
			return c->err.code;
	return g->writer ? WH_OK : c->err.code;
}

static wh_code writers_commit(wh_ctx *c, ingest *g)
{
	for (uint32_t k = 0; k < g->clusters; k++)
		if (wh_store_commit(c, g->store, k, &g->writer[k]) != WH_OK)
			return c->err.code;
	return WH_OK;
}

static wh_code partition(wh_ctx *c, const wh_exec *ex, ingest *g)
{
	const int64_t n = chunks_of(g->src->nv);
	g->stride = g->src->nv / sample_size(g->clusters) + 1;
	wh_progress_phase(g->progress, "bounds", g->src->nv);
	if (wh_exec_ordered(c, ex, n, bounds_job, bounds_commit, g) != WH_OK)
		return c->err.code;
	choose_units(g);
	if (wh_kdtree_build(c, &g->tree, g->sample, g->samples, g->clusters, 0.5) != WH_OK)
		return c->err.code;
	wh_free(c, g->sample);
	g->sample = NULL;
	g->home = wh_alloc(c, g->src->nv, sizeof *g->home);
	if (!g->home)
		return c->err.code;
	wh_progress_phase(g->progress, "partition", g->src->nv);
	return wh_exec_for(c, ex, n, home_job, g);
}

static wh_code distribute(wh_ctx *c, const wh_exec *ex, ingest *g, size_t buffer)
{
	if (writers_begin(c, g, buffer) != WH_OK)
		return c->err.code;
	set_record_size(g, ex->workers, 3 * (size_t)g->store->id_bytes);
	wh_progress_phase(g->progress, "faces", g->src->nf);
	const wh_code code =
	    wh_exec_ordered(c, ex, chunks_of(g->src->nf), face_job, face_commit, g);
	if (code != WH_OK)
		return code;
	visits_unique(&g->away);
	for (size_t i = 0; i < g->away.n; i++)
		g->result->cut_vertices += i == 0 || g->away.item[i].gid != g->away.item[i - 1].gid;
	set_record_size(g, ex->workers, wh_store_vertex_bytes(g->store));
	wh_progress_phase(g->progress, "vertices", g->src->nv);
	if (wh_exec_ordered(c, ex, chunks_of(g->src->nv), vertex_job, vertex_commit, g) != WH_OK)
		return c->err.code;
	return writers_commit(c, g);
}

size_t wh_ingest_bytes(const wh_source *src, const wh_exec *ex, const wh_ingest_params *params)
{
	const size_t bench_bytes = raw_bytes(src) + CHUNK * (size_t)(24 + 24 + 24 + 40 + 16);
	const size_t writers = (size_t)params->clusters * (params->buffer + 1024);
	const size_t sample = 2 * sample_size(params->clusters) * sizeof(wh_vec3);
	const size_t table = (size_t)src->nv * sizeof(uint16_t);
	return (size_t)ex->workers * bench_bytes + larger(sample, writers) + table;
}

wh_code wh_ingest(wh_ctx *c, const wh_exec *ex, wh_progress *progress, const wh_source *src,
                  const wh_ingest_params *params, wh_store *store, wh_ingest_result *result)
{
	*result = (wh_ingest_result){0};
	store->clusters = params->clusters;
	store->id_bytes = src->nv < (uint64_t)1 << 31 ? 4 : 8;
	store->coord_bytes = src->is_double ? 8 : 4;
	store->vertex_payload = 0;
	store->local_corners = false;
	ingest g = {.src = src,
	            .store = store,
	            .progress = progress,
	            .result = result,
	            .clusters = params->clusters};
	wh_code code = benches_make(c, &g, ex->workers);
	if (code == WH_OK)
		code = partition(c, ex, &g);
	if (code == WH_OK)
		code = distribute(c, ex, &g, params->buffer);
	for (uint32_t k = 0; g.writer && k < g.clusters; k++)
		wh_store_drop(c, &g.writer[k]);
	wh_free(c, g.writer);
	wh_free(c, g.away.item);
	wh_free(c, g.home);
	wh_free(c, g.sample);
	wh_kdtree_free(c, &g.tree);
	benches_free(c, &g, ex->workers);
	return code;
}
