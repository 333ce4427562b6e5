#define _GNU_SOURCE
#include "pipeline/normalise.h"

#include "base/chunks.h"
#include "io/off.h"
#include "io/rply_read.h"
#include "io/unpack.h"
#include "pipeline/rewrite.h"

#include <inttypes.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

enum {
	HEAD = 4096,    /* bytes that tell formats apart */
	PROBE = 4096,   /* faces looked at before a body is used in place */
	CHUNK = 1 << 16 /* vertices or triangles of one job when a mesh is loaded */
};

/* --- opening --- */

static wh_code nothing(wh_ctx *c, const wh_ply *p, const char *why)
{
	return wh_fail(c, WH_E_INPUT, "'%s' is no mesh: %s", p->path, why);
}

static bool has_element(const wh_ply *p, const char *name)
{
	for (size_t i = 0; i < p->nelems; i++)
		if (strcmp(p->elems[i].name, name) == 0)
			return true;
	return false;
}

static uint64_t count_of(const wh_ply *p, int elem)
{
	return elem >= 0 ? p->elems[elem].count : 0;
}

static wh_code check_content(wh_ctx *c, const wh_ply *p)
{
	if (p->vertex < 0)
		return nothing(c, p,
		               has_element(p, "vertex") ? "its vertices lack x, y or z"
		                                        : "it has no element 'vertex'");
	if (p->face < 0 && p->strips < 0)
		return nothing(c, p,
		               has_element(p, "face") || has_element(p, "tristrips")
		                   ? "its faces have no list of integers called vertex_indices"
		                   : "it has no faces (a point cloud?)");
	if (count_of(p, p->face) == 0 && count_of(p, p->strips) == 0)
		return nothing(c, p, "it has no faces (a point cloud?)");
	return WH_OK;
}

/* Looks at the first faces. WH_E_IRREGULAR: there are polygons among them. */
static wh_code probe(wh_ctx *c, const wh_source *s)
{
	const size_t n = s->nf < PROBE ? (size_t)s->nf : PROBE;
	void *raw = wh_alloc(c, wh_source_triangle_bytes(s, n), 1);
	uint64_t *ids = wh_alloc(c, n, 3 * sizeof *ids);
	wh_code code = c->err.code;
	if (raw && ids)
		code = wh_source_triangles(c, s, 0, n, ids, raw);
	wh_free(c, ids);
	wh_free(c, raw);
	return code;
}

/* A value was met that tells another form than was believed: then another try is due. */
static bool try_again(wh_rewrite *w)
{
	if (!wh_rewrite_is_due(w))
		return false;
	wh_rewrite_restart(w);
	return true;
}

static wh_code rewrite_text(wh_ctx *c, wh_rewrite *w)
{
	wh_code code = wh_rewrite_lines(c, w);
	while (code == WH_E_IRREGULAR && try_again(w))
		code = wh_rewrite_lines(c, w);
	if (code == WH_E_IRREGULAR)
		code = wh_rewrite_words(c, w);
	while (code == WH_E_IRREGULAR && try_again(w))
		code = wh_rewrite_words(c, w);
	return code;
}

static wh_code rewrite_body(wh_ctx *c, wh_rewrite *w, const wh_input *in)
{
	wh_code code;
	switch (in->ply.kind) {
	case WH_FORMAT_OBJ:
		do
			code = wh_obj_rewrite(c, w, &in->obj);
		while (code == WH_E_IRREGULAR && try_again(w));
		return code;
	case WH_FORMAT_STL:
		do
			code = wh_stl_rewrite(c, w, &in->stl);
		while (code == WH_E_IRREGULAR && try_again(w));
		return code;
	default:
		if (in->rply)
			return wh_rewrite_rply(c, w);
		return in->ply.format == WH_PLY_ASCII ? rewrite_text(c, w)
		                                      : wh_rewrite_binary(c, w);
	}
}

/* Attributes of vertices as the file has them. */
static const wh_attributes *attributes_of_file(const wh_input *in)
{
	const wh_attributes *a = in->wedges.of_vertices ? &in->whole : &in->attributes;
	return a->n ? a : NULL;
}

static wh_code rewrite(wh_ctx *c, const wh_exec *ex, wh_spill *spill, wh_input *in,
                       bool needs_faces)
{
	wh_rewrite w;
	if (wh_rewrite_open(c, &w, ex, spill, &in->ply, attributes_of_file(in),
	                    wh_wedges_of_file(&in->wedges) ? &in->wedges : NULL) != WH_OK)
		return c->err.code;
	wh_code code = rewrite_body(c, &w, in);
	if (code == WH_OK && needs_faces && w.source.nf == 0)
		code = nothing(c, &in->ply, "none of its faces has three different corners");
	if (code == WH_OK) {
		in->source = w.source;
		in->temp_fd = w.fd;
		in->polygons = w.polygons;
		in->degenerate = w.degenerate;
		in->invalid_polygons = w.invalid;
	}
	wh_rewrite_close(c, &w, code == WH_OK);
	return code;
}

wh_code wh_input_rewrite(wh_ctx *c, const wh_exec *ex, wh_spill *spill, wh_input *in)
{
	return in->temp_fd < 0 ? rewrite(c, ex, spill, in, true) : WH_OK;
}

static wh_code make_source(wh_ctx *c, const wh_exec *ex, wh_spill *spill, wh_input *in)
{
	wh_code code = WH_E_IRREGULAR;
	if (!in->rply && in->ply.kind != WH_FORMAT_STL && !wh_wedges_of_file(&in->wedges) &&
	    wh_ply_direct(&in->ply, &in->source))
		code = probe(c, &in->source);
	in->apart = in->wedges.of_vertices;
	in->source.attributes = attributes_of_file(in);
	in->source.wedges = NULL;
	return code == WH_E_IRREGULAR ? rewrite(c, ex, spill, in, true) : code;
}

/* --- which format --- */

static wh_code unknown(wh_ctx *c, const wh_ply *p)
{
	return wh_fail(c, WH_E_INPUT,
	               "'%s' is no PLY, OBJ, OFF or STL file, as far as its beginning and its name "
	               "tell; say which it is with --from",
	               p->path);
}

/* What came out is the file from then on. */
static wh_code take_over(wh_ctx *c, wh_input *in, int fd, uint64_t size)
{
	wh_ply *p = &in->ply;
	struct stat st;
	if (fstat(fd, &st) != 0)
		return wh_fail_errno(c, "cannot examine the temporary file of '%s'", p->path);
	(void)close(p->fd);
	p->fd = fd;
	p->size = size;
	p->changed = st.st_mtim;
	in->unpacked = true;
	return WH_OK;
}

/* Takes in a stream, or decompresses a file. */
static wh_code unpack(wh_ctx *c, wh_spill *spill, wh_input *in)
{
	wh_ply *p = &in->ply;
	uint64_t size;
	if (!spill->dir && wh_spill_open(c, spill, NULL, "/tmp") != WH_OK)
		return c->err.code;
	const int fd = wh_unpack(c, spill, p, &in->file_bytes, &size);
	if (fd < 0)
		return wh_failed(c);
	wh_code code = p->is_stream ? WH_OK : wh_ply_unchanged(c, p);
	if (code == WH_OK)
		code = take_over(c, in, fd, size);
	if (code != WH_OK)
		wh_spill_close_scratch(spill, fd);
	return code;
}

static wh_code unpack_if_due(wh_ctx *c, wh_spill *spill, wh_input *in)
{
	char head[4];
	const wh_ply *p = &in->ply;
	const size_t n = p->size < sizeof head ? (size_t)p->size : sizeof head;
	in->file_bytes = p->size;
	if (p->is_stream)
		return unpack(c, spill, in);
	if (wh_ply_pread(c, p->path, p->fd, head, n, 0) != WH_OK)
		return c->err.code;
	return wh_packing_of_bytes(head, n) == WH_PACKING_NONE ? WH_OK : unpack(c, spill, in);
}

/* The beginning of the file tells; where it does not, the name does. */
static wh_code find_kind(wh_ctx *c, wh_ply *p, wh_format from)
{
	char head[HEAD];
	const size_t n = p->size < HEAD ? (size_t)p->size : HEAD;
	if (wh_ply_pread(c, p->path, p->fd, head, n, 0) != WH_OK)
		return c->err.code;
	if (n == 0)
		return wh_fail(c, WH_E_INPUT, "'%s' is empty", p->path);
	p->eol = wh_format_eol(head, n);
	p->kind = from;
	if (p->kind == WH_FORMAT_ANY)
		p->kind = wh_format_of_bytes(head, n, p->size);
	if (p->kind == WH_FORMAT_ANY)
		p->kind = wh_format_of_name(p->path);
	return p->kind == WH_FORMAT_ANY || p->kind == WH_FORMAT_GLB ? unknown(c, p) : WH_OK;
}

static wh_code describe(wh_ctx *c, const wh_exec *ex, wh_input *in)
{
	switch (in->ply.kind) {
	case WH_FORMAT_OBJ:
		return wh_obj_look(c, ex, &in->ply, &in->obj);
	case WH_FORMAT_OFF:
		return wh_off_read_header(c, &in->ply);
	case WH_FORMAT_STL:
		return wh_stl_look(c, ex, &in->ply, &in->stl);
	default:
		return wh_ply_read_header(c, &in->ply);
	}
}

wh_code wh_input_describe(wh_ctx *c, const wh_exec *ex, wh_spill *spill, const char *path,
                          wh_format from, wh_input *in)
{
	*in = (wh_input){.temp_fd = -1};
	wh_code code = wh_ply_attach(c, &in->ply, path);
	if (code != WH_OK)
		return code;
	code = unpack_if_due(c, spill, in);
	if (code == WH_OK)
		code = find_kind(c, &in->ply, from);
	if (code == WH_OK)
		code = describe(c, ex, in);
	if (code != WH_OK)
		wh_input_close(c, spill, in);
	return code;
}

wh_code wh_input_open(wh_ctx *c, const wh_exec *ex, wh_spill *spill, const char *path,
                      wh_format from, wh_input *in)
{
	return wh_input_open_with(c, ex, spill, path, from, (wh_wanted){"none", 0}, in);
}

/* Vertices' attributes, and which of them go to the corners. */
static wh_code choose_of_vertices(wh_ctx *c, wh_wanted wanted, wh_input *in)
{
	const wh_wanted held = {wanted.names, wanted.holds & WH_HOLDS_ALL};
	wh_wanted read = held;
	if ((wanted.holds & WH_HOLDS_CORNERS) &&
	    !(wanted.holds & WH_HOLDS_APART)) /* the output has them there, if not at vertices */
		read.holds |= WH_HOLDS_TEXTURE;
	if (wh_attributes_choose(c, &in->ply, read, &in->whole) != WH_OK ||
	    wh_wedges_choose(c, &in->ply, wanted, &in->whole, &in->wedges) != WH_OK)
		return c->err.code;
	if (in->wedges.of_vertices)
		return wh_attributes_part(c, &in->whole, false, &in->attributes);
	wh_attributes_free(c, &in->whole);
	if (wh_attributes_choose(c, &in->ply, held, &in->attributes) != WH_OK)
		return c->err.code;
	/* PLY has a list for texture coordinates of corners, but none for normals */
	return in->wedges.corner.n
	           ? wh_attributes_both(c, &in->attributes, &in->wedges.corner,
	                                !(wanted.holds & WH_HOLDS_FACES), &in->whole)
	           : WH_OK;
}

/* Names that the comments of a PLY file give. */
static void take_names(wh_input *in)
{
	const wh_ply *p = &in->ply;
	wh_wedges *w = &in->wedges;
	w->textures = &p->textures;
	w->materials = p->materials.n ? &p->materials : NULL;
	w->groups = p->groups.n ? &p->groups : NULL;
	w->libraries = &p->libraries;
}

static wh_code choose(wh_ctx *c, wh_wanted wanted, wh_input *in)
{
	if (choose_of_vertices(c, wanted, in) != WH_OK)
		return c->err.code;
	if (in->ply.kind == WH_FORMAT_PLY)
		take_names(in);
	if (in->ply.kind == WH_FORMAT_OBJ) {
		in->wedges.materials = &in->obj.materials;
		in->wedges.groups = &in->obj.groups;
		in->wedges.libraries = &in->obj.libraries;
	}
	return WH_OK;
}

static wh_code check_rply(wh_ctx *c, const wh_ply *p)
{
	if (wh_rply_available(c) != WH_OK)
		return c->err.code;
	if (p->kind != WH_FORMAT_PLY)
		return wh_fail(
		    c, WH_E_USAGE,
		    "'%s' is no PLY file, and rply reads nothing else: leave out --reader",
		    p->path);
	return WH_OK;
}

wh_code wh_input_open_how(wh_ctx *c, const wh_exec *ex, wh_spill *spill, const char *path,
                          const wh_input_how *how, wh_input *in)
{
	wh_code code = wh_input_describe(c, ex, spill, path, how->from, in);
	if (code != WH_OK)
		return code;
	in->ply.keep_invalid = how->keep_invalid;
	in->rply = how->rply;
	if (how->rply)
		code = check_rply(c, &in->ply);
	if (code == WH_OK)
		code = check_content(c, &in->ply);
	if (code == WH_OK)
		code = choose(c, how->attributes, in);
	if (code == WH_OK)
		code = make_source(c, ex, spill, in);
	if (code != WH_OK)
		wh_input_close(c, spill, in);
	return code;
}

wh_code wh_input_open_with(wh_ctx *c, const wh_exec *ex, wh_spill *spill, const char *path,
                           wh_format from, wh_wanted attributes, wh_input *in)
{
	const wh_input_how how = {.from = from, .attributes = attributes};
	return wh_input_open_how(c, ex, spill, path, &how, in);
}

/* Vertices of a fixed size, behind others of fixed sizes, are used as they are. */
static bool points_in_place(const wh_ply *p, wh_source *s)
{
	uint64_t at = p->body;
	if (p->format == WH_PLY_ASCII || p->elems[p->vertex].stride == 0)
		return false;
	for (int i = 0; i < p->vertex; i++) {
		if (p->elems[i].stride == 0 && p->elems[i].count > 0)
			return false;
		at += p->elems[i].stride * p->elems[i].count;
	}
	*s = (wh_source){.ffd = -1};
	wh_ply_vertex_source(p, at, s);
	return true;
}

static bool has_faces(const wh_ply *p)
{
	return count_of(p, p->face) > 0 || count_of(p, p->strips) > 0;
}

static wh_code open_points(wh_ctx *c, const wh_exec *ex, wh_spill *spill, wh_input *in)
{
	const wh_ply *p = &in->ply;
	if (p->kind == WH_FORMAT_PLY && points_in_place(p, &in->source)) {
		in->source.attributes = attributes_of_file(in);
		return WH_OK;
	}
	const wh_code code = rewrite(c, ex, spill, in, false);
	in->source.nf = 0;
	return code;
}

wh_code wh_input_open_any(wh_ctx *c, const wh_exec *ex, wh_spill *spill, const char *path,
                          wh_format from, wh_wanted wanted, wh_input *in)
{
	wh_code code = wh_input_describe(c, ex, spill, path, from, in);
	if (code != WH_OK)
		return code;
	const bool faces = has_faces(&in->ply);
	if (faces)
		code = check_content(c, &in->ply);
	else if (count_of(&in->ply, in->ply.vertex) == 0)
		code = wh_fail(c, WH_E_INPUT, "'%s' has no vertices with x, y and z", in->ply.path);
	if (code == WH_OK)
		code = choose(c, wanted, in);
	if (code == WH_OK)
		code = faces ? make_source(c, ex, spill, in) : open_points(c, ex, spill, in);
	if (code != WH_OK)
		wh_input_close(c, spill, in);
	return code;
}

/* What a rewritten body will look like, as far as the header tells. */
static void expect_rewrite(const wh_ply *p, wh_source *s)
{
	const wh_ply_elem *v = &p->elems[p->vertex];
	wh_ply_vertex_source(p, 0, s);
	const uint64_t strips = p->strips >= 0 ? p->elems[p->strips].count : 0;
	s->nf = p->face >= 0 ? p->elems[p->face].count : 0;
	if (s->nf == 0 && strips > 0) /* a corner each, and two at the beginning */
		s->nf = (p->size - p->body) / 5;
	s->fstride = 3 * (s->nv > UINT32_MAX ? 8 : 4);
	s->ffd = -1;
	if (p->kind == WH_FORMAT_STL) /* twice as many faces as vertices, once it is welded */
		s->nv = s->nf / 2 + 2;
	if (p->format == WH_PLY_ASCII || v->stride == 0 || p->kind == WH_FORMAT_STL) {
		s->vstride = s->is_double ? 24 : 12;
		s->vfd = -1;
	}
}

static wh_code look(wh_ctx *c, wh_input *in)
{
	wh_source *s = &in->source;
	const wh_code code = in->ply.kind != WH_FORMAT_STL && !wh_wedges_of_file(&in->wedges) &&
	                             wh_ply_direct(&in->ply, s)
	                         ? probe(c, s)
	                         : WH_E_IRREGULAR;
	if (code == WH_E_IRREGULAR) {
		*s = (wh_source){0};
		expect_rewrite(&in->ply, s);
		s->fstride += wh_wedges_of_file(&in->wedges) ? in->wedges.bytes : 0;
	}
	in->apart = in->wedges.of_vertices;
	*s = wh_input_joined(in);
	return code == WH_E_IRREGULAR ? WH_OK : code;
}

wh_code wh_input_look(wh_ctx *c, const wh_exec *ex, wh_spill *spill, const char *path,
                      wh_format from, wh_wanted wanted, wh_input *in)
{
	wh_code code = wh_input_describe(c, ex, spill, path, from, in);
	if (code != WH_OK)
		return code;
	code = check_content(c, &in->ply);
	if (code == WH_OK)
		code = choose(c, wanted, in);
	if (code == WH_OK)
		code = look(c, in);
	if (code != WH_OK)
		wh_input_close(c, spill, in);
	return code;
}

wh_source wh_input_joined(const wh_input *in)
{
	wh_source s = in->source;
	s.attributes = in->attributes.n ? &in->attributes : NULL;
	s.wedges = in->wedges.bytes ? &in->wedges : NULL;
	if (!in->apart)
		return s;
	s.vfd = s.ffd = -1;
	s.vstride = s.is_double ? 24 : 12;
	s.fstride = 3 * (s.nv > UINT32_MAX ? 8U : 4U) + in->wedges.bytes;
	return s;
}

/* What welding takes beyond the clusters that come after it: corners in buckets and in ranges
 * (weld.h), and those of a text. */
static uint64_t weld_bytes(const wh_ply *p, const wh_source *s)
{
	return p->kind != WH_FORMAT_STL ? 0 : s->nf * (p->format == WH_PLY_ASCII ? 80 : 44);
}

/* Texture coordinates and normals of an OBJ file, on their way to who has them. */
static uint64_t list_bytes(const wh_input *in)
{
	uint64_t n = 0;
	if (in->obj.start && in->wedges.corner.has_texture)
		n += wh_obj_list_bytes(&in->obj, WH_OBJ_TEXCOORDS);
	if (in->obj.start && (in->wedges.corner.has_normal || in->attributes.has_normal))
		n += wh_obj_list_bytes(&in->obj, WH_OBJ_NORMALS);
	return n;
}

uint64_t wh_input_temp_bytes(const wh_input *in)
{
	const wh_source *s = &in->source;
	const uint64_t unpacked = in->unpacked ? in->ply.size : 0;
	struct stat st;
	if (in->apart && s->ffd < 0) /* what joining takes is not counted here */
		return unpacked +
		       (in->ply.format == WH_PLY_ASCII || wh_wedges_of_file(&in->wedges)
		            ? s->nv * ((uint64_t)s->vstride + in->whole.bytes) + s->nf * s->fstride
		            : 0);
	if (s->ffd < 0)
		return unpacked + s->nf * s->fstride +
		       (s->vfd < 0 ? s->nv * ((uint64_t)s->vstride + in->attributes.bytes) : 0) +
		       weld_bytes(&in->ply, s) + list_bytes(in);
	return unpacked +
	       (in->temp_fd >= 0 && fstat(in->temp_fd, &st) == 0 ? (uint64_t)st.st_size : 0);
}

wh_code wh_input_unchanged(wh_ctx *c, const wh_input *in)
{
	return in->unpacked ? WH_OK : wh_ply_unchanged(c, &in->ply); /* then it was read at once */
}

void wh_input_replace(wh_spill *spill, wh_input *in, const wh_source *source, int fd)
{
	if (in->temp_fd >= 0)
		wh_spill_close_scratch(spill, in->temp_fd);
	in->temp_fd = fd;
	in->source = *source;
	in->apart = false;
}

void wh_input_drop_temp(wh_spill *spill, wh_input *in)
{
	if (in->unpacked && in->ply.fd >= 0) {
		wh_spill_close_scratch(spill, in->ply.fd);
		in->ply.fd = -1;
	}
	if (in->temp_fd >= 0)
		wh_spill_close_scratch(spill, in->temp_fd);
	in->temp_fd = -1;
}

void wh_input_close(wh_ctx *c, wh_spill *spill, wh_input *in)
{
	if (in->ply.path)
		wh_input_drop_temp(spill, in);
	wh_obj_free(c, &in->obj);
	wh_stl_free(c, &in->stl);
	wh_attributes_free(c, &in->attributes);
	wh_attributes_free(c, &in->whole);
	wh_wedges_free(c, &in->wedges);
	wh_ply_close(c, &in->ply);
	*in = (wh_input){.temp_fd = -1};
	in->ply.fd = -1;
}

/* --- loading --- */

typedef struct loader {
	const wh_source *s;
	wh_mesh *m;
	uint32_t *kept; /* triangles of each chunk that are not degenerate */
	void **raw;     /* one per worker */
	uint64_t **ids;
} loader;

static wh_code load_vertices(wh_ctx *c, void *arg, int64_t index, int worker)
{
	const loader *l = arg;
	const uint64_t first = (uint64_t)index * CHUNK;
	return wh_source_vertices(c, l->s, first, wh_chunk_items(l->s->nv, index, CHUNK),
	                          &l->m->pos[first].x, l->raw[worker]);
}

static wh_code load_triangles(wh_ctx *c, void *arg, int64_t index, int worker)
{
	const loader *l = arg;
	const uint64_t first = (uint64_t)index * CHUNK;
	const size_t n = wh_chunk_items(l->s->nf, index, CHUNK);
	const uint64_t *t = l->ids[worker];
	uint32_t *to = l->m->tri + 3 * first;
	const wh_code code = wh_source_triangles(c, l->s, first, n, l->ids[worker], l->raw[worker]);
	if (code != WH_OK)
		return code;
	for (size_t i = 0; i < n; i++, t += 3) {
		to[0] = (uint32_t)t[0];
		to[1] = (uint32_t)t[1];
		to[2] = (uint32_t)t[2];
		to += t[0] != t[1] && t[1] != t[2] && t[2] != t[0] ? 3 : 0;
	}
	l->kept[index] = (uint32_t)((size_t)(to - (l->m->tri + 3 * first)) / 3);
	return WH_OK;
}

/* Closes the gaps that degenerate triangles left at the chunks' ends. */
static void close_gaps(const loader *l)
{
	uint32_t nf = 0;
	for (int64_t i = 0; i < wh_chunks(l->s->nf, CHUNK); i++) {
		const uint32_t *from = l->m->tri + 3 * (size_t)i * CHUNK;
		memmove(l->m->tri + 3 * (size_t)nf, from, 3 * (size_t)l->kept[i] * sizeof *from);
		nf += l->kept[i];
	}
	l->m->nf = nf;
}

static wh_code open_loader(wh_ctx *c, loader *l, int workers)
{
	const size_t v = wh_source_vertex_bytes(l->s, CHUNK);
	const size_t t = wh_source_triangle_bytes(l->s, CHUNK);
	l->kept = wh_alloc(c, (size_t)wh_chunks(l->s->nf, CHUNK), sizeof *l->kept);
	l->raw = wh_calloc(c, (size_t)workers, sizeof *l->raw);
	l->ids = wh_calloc(c, (size_t)workers, sizeof *l->ids);
	if (!l->kept || !l->raw || !l->ids)
		return c->err.code;
	for (int i = 0; i < workers; i++) {
		l->raw[i] = wh_alloc(c, v > t ? v : t, 1);
		l->ids[i] = wh_alloc(c, CHUNK, 3 * sizeof **l->ids);
		if (!l->raw[i] || !l->ids[i])
			return c->err.code;
	}
	return WH_OK;
}

static void close_loader(wh_ctx *c, loader *l, int workers)
{
	for (int i = 0; i < workers; i++) {
		if (l->raw)
			wh_free(c, l->raw[i]);
		if (l->ids)
			wh_free(c, l->ids[i]);
	}
	wh_free(c, l->ids);
	wh_free(c, l->raw);
	wh_free(c, l->kept);
}

wh_code wh_source_mesh(wh_ctx *c, const wh_exec *ex, const wh_source *s, wh_mesh *m)
{
	loader l = {.s = s, .m = m};
	*m = (wh_mesh){0};
	if (s->nv >= UINT32_MAX || s->nf >= UINT32_MAX)
		return wh_fail(c, WH_E_PLAN,
		               "'%s' has %" PRIu64 " vertices and %" PRIu64
		               " triangles, more than can be loaded at once",
		               s->path, s->nv, s->nf);
	if (wh_mesh_alloc(c, m, (uint32_t)s->nv, (uint32_t)s->nf) != WH_OK)
		return c->err.code;
	wh_code code = open_loader(c, &l, ex->workers);
	if (code == WH_OK)
		code = wh_exec_for(c, ex, wh_chunks(s->nv, CHUNK), load_vertices, &l);
	if (code == WH_OK)
		code = wh_exec_for(c, ex, wh_chunks(s->nf, CHUNK), load_triangles, &l);
	if (code == WH_OK)
		close_gaps(&l);
	close_loader(c, &l, ex->workers);
	if (code != WH_OK)
		wh_mesh_free(c, m);
	return code;
}

/* --- files --- */

static wh_code load_source(wh_ctx *c, const wh_exec *ex, wh_spill *spill, wh_input *in, wh_mesh *m)
{
	wh_code code = wh_source_mesh(c, ex, &in->source, m);
	if (code != WH_E_IRREGULAR)
		return code;
	code = wh_input_rewrite(c, ex, spill, in);
	return code == WH_OK ? wh_source_mesh(c, ex, &in->source, m) : code;
}

wh_code wh_load_mesh(wh_ctx *c, const wh_exec *ex, wh_spill *spill, const char *path,
                     wh_format from, wh_mesh *m, bool *is_double, uint64_t *degenerate)
{
	wh_input in;
	*m = (wh_mesh){0};
	wh_code code = wh_input_open(c, ex, spill, path, from, &in);
	if (code != WH_OK)
		return code;
	code = load_source(c, ex, spill, &in, m);
	if (code == WH_OK && is_double)
		*is_double = in.source.is_double;
	if (code == WH_OK && degenerate)
		*degenerate = in.degenerate + (in.source.nf - m->nf);
	if (code == WH_OK && m->nf == 0)
		code = nothing(c, &in.ply, "none of its faces has three different corners");
	if (code != WH_OK)
		wh_mesh_free(c, m);
	wh_input_close(c, spill, &in);
	return code;
}
