/*
 * rewrite: a body that cannot be read in place becomes a temporary file of fixed strides.
 *
 * What the three ways of rewriting (binary, text by lines, text by words) share. Internal to the
 * normalise module. The temporary file begins with the vertices (three floats or doubles each) and
 * the records of their attributes, if any, unless they can be read from the user's file; then
 * triangles of three 32- or 64-bit indices and what the face carries, in the host's byte order and
 * the file's order.
 */
#ifndef WH_PIPELINE_REWRITE_H
#define WH_PIPELINE_REWRITE_H

#include "exec/exec.h"
#include "io/attributes.h"
#include "io/spill.h"
#include "pipeline/facer.h"

typedef struct wh_rewrite {
	const wh_ply *ply;
	const wh_attributes *attributes; /* NULL: none */
	const wh_wedges *wedges;         /* NULL: faces carry nothing */
	const wh_exec *ex;
	wh_spill *spill;
	int fd;            /* the temporary file */
	wh_source source;  /* what comes out; vertices are usable before triangles are */
	uint64_t end;      /* bytes of the temporary file in use */
	wh_facer *facers;  /* one per worker */
	uint64_t polygons; /* of the facers whose output was taken */
	uint64_t degenerate;
	uint64_t invalid;
	_Atomic bool wider;  /* coordinates whose type is not declared have to be doubles */
	_Atomic bool bright; /* colours whose range is not declared go to 255 */
	double white;        /* of such colours: 1 or 255 */
} wh_rewrite;

/* Makes the temporary file. The vertices will be in it, at its beginning. */
wh_code wh_rewrite_open(wh_ctx *c, wh_rewrite *w, const wh_exec *ex, wh_spill *spill,
                        const wh_ply *ply, const wh_attributes *attributes,
                        const wh_wedges *wedges);
/* Forgets what was written: for a second try in another way. */
void wh_rewrite_restart(wh_rewrite *w);
/* What the text of a format that declares nothing tells as it is read. */
typedef struct wh_told {
	bool wide;   /* a coordinate has more digits than a float holds */
	bool bright; /* a colour is so far above 1 that colours go to 255 */
} wh_told;

/* Something that calls for another try was told; notes it. Thread-safe. */
bool wh_rewrite_heed(wh_rewrite *w, wh_told told);
/* What was noted is not what this try believes: restart. */
bool wh_rewrite_is_due(const wh_rewrite *w);

/* The word at s as an attribute, as wh_attribute_scan; of a text that declares nothing, colours
 * from 0 to 1 or to 255. */
const char *wh_rewrite_scan(const wh_rewrite *w, const wh_attribute *a, const char *s,
                            uint8_t *record, wh_told *told);
/* What a vertex of such a text has that tells no value: white, or 0. */
void wh_rewrite_untold(const wh_attribute *a, uint8_t *record);

/* There are so many vertices, other than the file's description says. Before any face is added. */
void wh_rewrite_set_vertices(wh_rewrite *w, uint64_t nv);
/* Frees all but the temporary file, which is closed only when keep is false. */
void wh_rewrite_close(wh_ctx *c, wh_rewrite *w, bool keep);

/* The body's vertices are of fixed size and begin at byte `base` of the file: used as they are. */
void wh_rewrite_vertices_in_place(wh_rewrite *w, uint64_t base);

/* Writes n vertices from number `first` on; the doubles are destroyed. WH_E_INPUT when one does
 * not fit the output's type or is not finite, unless the file's keep_invalid is set. Thread-safe.
 */
wh_code wh_rewrite_put_vertices(wh_ctx *c, wh_rewrite *w, uint64_t first, double *xyz, size_t n);
/* Writes the records of their attributes; does nothing where there are none. Thread-safe. */
wh_code wh_rewrite_put_attributes(wh_ctx *c, wh_rewrite *w, uint64_t first, const uint8_t *records,
                                  size_t n);

/* Bytes of a record; 0 where there are no attributes. */
static inline size_t wh_rewrite_record(const wh_rewrite *w)
{
	return w->attributes ? w->attributes->bytes : 0;
}

enum { WH_REWRITE_BATCH = 8192 };

/* Vertices written at a time, so that their records take two MiB at most. */
static inline size_t wh_rewrite_batch(const wh_rewrite *w)
{
	const size_t most = ((size_t)2 << 20) / (wh_rewrite_record(w) + 1);
	return most < WH_REWRITE_BATCH ? most : WH_REWRITE_BATCH;
}

/* All vertices are written; triangles come next, the facers are empty. */
wh_code wh_rewrite_start_faces(wh_ctx *c, wh_rewrite *w);

/* Room for what a face of n corners carries, in *room; all is as for a face of which nothing is
 * known. NULL: no memory. */
uint8_t *wh_rewrite_carried(wh_ctx *c, const wh_rewrite *w, uint8_t **room, size_t *cap, size_t n);

/* Appends the facer's triangles to the file and empties it. */
wh_code wh_rewrite_take(wh_ctx *c, wh_rewrite *w, wh_facer *f);

/* Corner index `id` (as read: negative ones as 2^64 - |v|) of an item is out of range. `place`
 * says where, such as "line 7". */
wh_code wh_rewrite_bad_index(wh_ctx *c, const wh_rewrite *w, const wh_ply_elem *e, uint64_t item,
                             uint64_t id, const char *place);

/* The list of texture coordinates of a face of n corners has so many values, which are neither two
 * for each corner nor none. */
wh_code wh_rewrite_bad_texcoords(wh_ctx *c, const wh_rewrite *w, const wh_ply_elem *e,
                                 uint64_t item, uint64_t values, uint64_t n, const char *place);

static inline bool wh_is_texcoords(uint64_t values, uint64_t n)
{
	return values == 0 || (values % 2 == 0 && values / 2 == n);
}

/* Is `id`, read from items of type t, the mark between two strips of one list? */
static inline bool wh_is_restart(uint64_t id, wh_type t)
{
	return id == UINT64_MAX || (t == WH_U32 && id == UINT32_MAX) ||
	       (t == WH_U16 && id == UINT16_MAX) || (t == WH_U8 && id == UINT8_MAX);
}

/* The elements whose items are faces or strips, and the list of their corners. */
static inline bool wh_is_face_element(const wh_ply *p, int elem)
{
	return elem == p->face || elem == p->strips;
}

static inline int wh_corner_list(const wh_ply *p, int elem)
{
	return elem == p->face ? p->corners : elem == p->strips ? p->strip_list : -1;
}

/* The three ways. Each fills the source; WH_E_IRREGULAR, with nothing recorded, from
 * wh_rewrite_lines says that lines are not items: use wh_rewrite_words. From either kind of text it
 * says so where wh_rewrite_is_due: restart. */
wh_code wh_rewrite_binary(wh_ctx *c, wh_rewrite *w);
wh_code wh_rewrite_lines(wh_ctx *c, wh_rewrite *w);
wh_code wh_rewrite_words(wh_ctx *c, wh_rewrite *w);
/* A fourth one, for PLY of any form: rply reads it (io/rply_read.h). */
wh_code wh_rewrite_rply(wh_ctx *c, wh_rewrite *w);

#endif
