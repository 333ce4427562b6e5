#include "pipeline/finish.h"

#include "pipeline/atlas.h"

#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

size_t wh_finish_bytes(uint64_t nv, uint64_t nf, uint32_t attr_bytes, uint32_t face_bytes,
                       size_t state)
{
	const size_t patch_bytes = wh_patch_bytes(nv, nf, attr_bytes, face_bytes);
	const size_t engine = wh_simplify_bytes(nv, nf, face_bytes) + (size_t)nv * state;
	/* while clusters are put together, one of them is there as a file and as a patch, too */
	const size_t loading = 2 * patch_bytes;
	return patch_bytes + (loading > engine ? loading : engine) + ((size_t)2 << 20);
}

/* ---- stitching ---------------------------------------------------------------------------- */

typedef struct copy {
	uint64_t gid;
	uint32_t at; /* place in the patch */
} copy;

typedef struct copies {
	copy *item;
	size_t n, cap;
} copies;

static int compare_copies(const void *a, const void *b)
{
	const copy *x = a, *y = b;
	if (x->gid != y->gid)
		return x->gid < y->gid ? -1 : 1;
	return (x->at > y->at) - (x->at < y->at);
}

/* Appends one cluster; notes the places of its cut vertices. */
static wh_code append(wh_ctx *c, wh_patch *p, const wh_patch *one, copies *cut)
{
	for (uint32_t v = 0; v < one->nv; v++) {
		const uint32_t at = p->nv + v;
		p->pos[at] = one->pos[v];
		p->gid[at] = one->gid[v];
		p->err[at] = one->err[v];
		p->flag[at] = 0;
		if (p->attr_bytes)
			memcpy(wh_patch_attr(p, at), wh_patch_attr(one, v), p->attr_bytes);
		if (!(one->flag[v] & WH_CUT))
			continue;
		if (wh_reserve(c, &cut->item, &cut->cap, cut->n + 1, sizeof *cut->item) != WH_OK)
			return c->err.code;
		cut->item[cut->n++] = (copy){one->gid[v], at};
	}
	uint32_t *to = &p->tri[3 * (size_t)p->nf];
	for (size_t i = 0; i < 3 * (size_t)one->nf; i++)
		to[i] = one->tri[i] + p->nv;
	if (p->face_bytes && one->nf)
		memcpy(wh_patch_face(p, p->nf), one->face, (size_t)one->nf * p->face_bytes);
	p->nv += one->nv;
	p->nf += one->nf;
	return WH_OK;
}

/* Faces use the first copy of each cut vertex; the others vanish. A bound that grew on one side
 * holds for the vertex. */
static wh_code join_copies(wh_ctx *c, wh_patch *p, copies *cut)
{
	uint32_t *map = wh_alloc(c, p->nv, sizeof *map);
	if (!map)
		return c->err.code;
	for (uint32_t v = 0; v < p->nv; v++)
		map[v] = v;
	if (cut->n)
		qsort(cut->item, cut->n, sizeof *cut->item, compare_copies);
	for (size_t i = 1; i < cut->n; i++) {
		if (cut->item[i].gid != cut->item[i - 1].gid)
			continue;
		const uint32_t first = map[cut->item[i - 1].at];
		map[cut->item[i].at] = first;
		p->err[first] = fmaxf(p->err[first], p->err[cut->item[i].at]);
	}
	for (size_t i = 0; i < 3 * (size_t)p->nf; i++)
		p->tri[i] = map[p->tri[i]];
	(void)wh_patch_compact(p, map);
	wh_free(c, map);
	return WH_OK;
}

static wh_code make_room(wh_ctx *c, const wh_store *store, wh_patch *p)
{
	uint64_t nv = 0, nf = 0;
	for (uint32_t k = 0; k < store->clusters; k++) {
		uint64_t f, v;
		if (wh_store_counts(c, store, k, &f, &v) != WH_OK)
			return c->err.code;
		nv += v;
		nf += f;
	}
	if (nv > WH_PATCH_MOST_VERTICES || nf > WH_PATCH_MOST_FACES)
		return wh_fail(c, WH_E_PLAN,
		               "the last pass would hold %llu vertices and %llu faces, more than "
		               "%" PRIu32 " or %" PRIu32 ": ask for fewer",
		               (unsigned long long)nv, (unsigned long long)nf,
		               WH_PATCH_MOST_VERTICES, WH_PATCH_MOST_FACES);
	p->attr_bytes = store->attr_bytes;
	p->face_bytes = store->face_bytes;
	if (wh_patch_reset(c, p, (uint32_t)nv, (uint32_t)nf) != WH_OK)
		return c->err.code;
	p->nv = p->nf = 0;
	return WH_OK;
}

wh_code wh_finish_stitch(wh_ctx *c, const wh_store *store, wh_progress *progress, wh_patch *p,
                         uint64_t *unreferenced)
{
	wh_store_workspace ws = {0};
	wh_patch one = {0};
	copies cut = {0};
	*unreferenced = 0;
	wh_progress_phase(progress, "stitch", store->clusters);
	wh_code code = make_room(c, store, p);
	for (uint32_t k = 0; code == WH_OK && k < store->clusters; k++) {
		code = wh_poll(c);
		if (code == WH_OK)
			code = wh_store_load(c, store, k, &ws, &one);
		if (code == WH_OK)
			code = append(c, p, &one, &cut);
		*unreferenced += ws.unreferenced;
		wh_progress_add(progress, 1);
	}
	wh_store_workspace_free(c, &ws);
	wh_patch_free(c, &one);
	if (code == WH_OK)
		code = join_copies(c, p, &cut);
	wh_free(c, cut.item);
	return code;
}

/* ---- output ------------------------------------------------------------------------------- */

enum { WRITE_CHUNK = 16 * 1024 };

static void find_box(const wh_patch *p, double unscale, wh_mesh_box *box)
{
	for (uint32_t v = 0; v < p->nv; v++) {
		const wh_vec3 q = wh_scale(p->pos[v], unscale);
		wh_mesh_box_add(box, (const double[3]){q.x, q.y, q.z});
	}
}

static wh_code write_patch(wh_ctx *c, wh_progress *progress, wh_outfile *out, wh_ply_style style,
                           const wh_patch *p, double scale)
{
	double *xyz = wh_alloc(c, WRITE_CHUNK, 3 * sizeof *xyz);
	if (!xyz)
		return c->err.code;
	wh_progress_phase(progress, "write", (uint64_t)p->nv + p->nf);
	wh_mesh_box box = {0};
	wh_mesh_out m = {0};
	if (wh_mesh_wants_box(style))
		find_box(p, 1 / scale, &box);
	wh_code code = wh_mesh_begin(c, &m, out, style, p->nv, p->nf, &box);
	const bool facets = wh_mesh_wants_facets(style);
	for (uint32_t v = 0; code == WH_OK && !facets && v < p->nv; v += WRITE_CHUNK) {
		const uint32_t n = p->nv - v < WRITE_CHUNK ? p->nv - v : WRITE_CHUNK;
		for (uint32_t i = 0; i < n; i++) {
			const wh_vec3 q = wh_scale(p->pos[v + i], 1 / scale);
			xyz[3 * (size_t)i] = q.x;
			xyz[3 * (size_t)i + 1] = q.y;
			xyz[3 * (size_t)i + 2] = q.z;
		}
		code = wh_mesh_vertices(c, &m, xyz, p->attr ? wh_patch_attr(p, v) : NULL, n);
		wh_progress_add(progress, n);
	}
	for (uint32_t f = 0; code == WH_OK && f < p->nf; f += WRITE_CHUNK) {
		const uint32_t n = p->nf - f < WRITE_CHUNK ? p->nf - f : WRITE_CHUNK;
		const uint32_t *tri = &p->tri[3 * (size_t)f];
		code = facets ? wh_mesh_facets(c, &m, &p->pos->x, 1 / scale, tri, n)
		              : wh_mesh_triangles(c, &m, tri,
		                                  p->face_bytes ? wh_patch_face(p, f) : NULL, n);
		wh_progress_add(progress, n);
		if (code == WH_OK)
			code = wh_poll(c);
	}
	if (code == WH_OK)
		code = wh_mesh_end(c, &m);
	wh_mesh_free_out(c, &m);
	wh_free(c, xyz);
	return code;
}

wh_code wh_finish_write(wh_ctx *c, wh_progress *progress, wh_outfile *out, wh_ply_style style,
                        const wh_patch *p, double scale, uint64_t *vertices)
{
	wh_atlas_room room = {0};
	wh_patch *doubled;
	*vertices = p->nv;
	if (!style.doubled)
		return write_patch(c, progress, out, style, p, scale);
	wh_code code =
	    wh_atlas_double(c, p, style.attributes, style.wedges, style.doubled, &room, &doubled);
	style.attributes = style.doubled;
	if (code == WH_OK)
		code = write_patch(c, progress, out, style, doubled, scale);
	*vertices = room.patch.nv;
	wh_atlas_room_free(c, &room);
	return code;
}
