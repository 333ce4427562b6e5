/*
 * ply: headers, bodies and output of PLY files (Greg Turk's format, and the dialects in use).
 *
 * A file is first opened (wh_ply_open: header parsed, nothing else read). Its body is then seen
 * as a wh_source: positions and triangles at fixed strides in some file. A binary file of
 * triangles is such a source as it stands; anything else (text, polygons, strips, lists inside
 * vertices) is first rewritten into a temporary file of that form (pipeline/normalise).
 * Counts are 64-bit. No count is believed before the file's size can hold it.
 */
#ifndef WH_IO_PLY_H
#define WH_IO_PLY_H

#include "base/mem.h"
#include "io/format.h"
#include "io/names.h"

#include <time.h>

typedef enum wh_type {
	WH_I8,
	WH_U8,
	WH_I16,
	WH_U16,
	WH_I32,
	WH_U32,
	WH_I64, /* not standard PLY, but written by some programs (int64, long) */
	WH_U64,
	WH_F32,
	WH_F64
} wh_type;

/* Bytes of a scalar of this type. */
static inline uint32_t wh_type_size(wh_type t)
{
	static const uint8_t size[] = {1, 1, 2, 2, 4, 4, 8, 8, 4, 8};
	return size[t];
}

typedef struct wh_ply_prop {
	char *name;
	wh_type type; /* of the scalar, or of the list's items */
	bool is_list;
	wh_type count_type; /* lists only; an integer type */
} wh_ply_prop;

typedef struct wh_ply_elem {
	char *name;
	uint64_t count;
	wh_ply_prop *props;
	size_t nprops;
	uint64_t stride; /* bytes of one binary item; 0 when it holds a list */
	uint64_t least;  /* bytes of the smallest binary item (all lists empty) */
	size_t line;     /* of the header that declares it, from 1 */
} wh_ply_elem;

typedef enum wh_ply_format { WH_PLY_ASCII, WH_PLY_LE, WH_PLY_BE } wh_ply_format;

typedef struct wh_ply {
	char *path;
	int fd;                  /* open for reading; owned */
	bool is_stream;          /* its bytes come once, and nobody knows how many */
	uint64_t size;           /* bytes of the file; 0 for a stream */
	struct timespec changed; /* time of its last change when it was opened */
	uint64_t body;           /* byte offset of the first body byte */
	wh_ply_format format;
	wh_format kind;  /* another format's file is described in PLY's words (see below) */
	char comment;    /* text: what this begins, up to the line's end, is none; 0: nothing */
	bool open_ended; /* text: what is left of an item's line is passed over */
	bool
	    undeclared; /* text: coordinates are doubles where their digits tell more than floats */
	bool keep_invalid; /* set by who opened it: vertices that are not finite are read as they
	                      are, and polygons that use them left out, instead of refused */
	char eol;          /* byte that ends a line: '\n' (also after '\r'), or '\r' alone */
	wh_ply_elem *elems;
	size_t nelems;
	wh_names textures; /* files that comments call TextureFile */
	/* what comments call MaterialFile, Material and Group: the names behind the values 1, 2 ...
	 * of the faces' properties material and group; as OBJ files have them (read_obj.h) */
	wh_names libraries, materials, groups;
	size_t header_lines;
	/* what whittle works on; -1 where the file has none */
	int vertex;     /* element with x, y, z */
	int face;       /* element with a list of corner indices */
	int strips;     /* element with triangle strips */
	int x, y, z;    /* properties of vertex */
	int corners;    /* list property of face (vertex_indices, vertex_index, ...) */
	int strip_list; /* list property of strips */
} wh_ply;

/*
 * Opens `path`, or standard input for "-", and parses the header. WH_E_INPUT for a file that is
 * missing, unreadable or not regular, a damaged header, or counts that the file's size cannot hold;
 * WH_E_RUN when reading fails. The message names the file and the header line. On failure *p is
 * empty. Close with wh_ply_close.
 */
wh_code wh_ply_open(wh_ctx *c, wh_ply *p, const char *path);
void wh_ply_close(wh_ctx *c, wh_ply *p);

/*
 * The two steps of wh_ply_open, for files that may turn out to be of another format: opens the
 * file, which may be a stream here, then parses the header of what is open (p->fd, p->size), which
 * may not. After a failure of either, *p is empty.
 */
wh_code wh_ply_attach(wh_ctx *c, wh_ply *p, const char *path);
wh_code wh_ply_read_header(wh_ctx *c, wh_ply *p);

/* Is this standard input, or a pipe or socket by name: something that is not there a second time?
 */
bool wh_ply_is_read_once(const char *path);

/*
 * Describes an open file of another format: adds an element; adds a property to the last one, a
 * list when is_list is set (with counts of the items' type). Names are copied.
 */
wh_code wh_ply_add_element(wh_ctx *c, wh_ply *p, const char *name, uint64_t count);
wh_code wh_ply_add_property(wh_ctx *c, wh_ply *p, const char *name, wh_type type, bool is_list);
/* The description is complete: finds what whittle works on. */
void wh_ply_find_meaning(wh_ply *p);

/* WH_E_RUN when the file was written to since it was opened (other size or time of change): what
 * was read of it may not fit together. */
wh_code wh_ply_unchanged(wh_ctx *c, const wh_ply *p);

struct wh_attributes;
struct wh_wedges;

/* Positions and triangles at fixed strides in a file. Holds no memory; owns no descriptor. */
typedef struct wh_source {
	const char *path; /* of the user's file, for messages */
	uint64_t nv, nf;  /* vertices, triangles */
	int vfd;          /* positions: */
	uint64_t vbase;   /*   byte offset of vertex 0 */
	uint32_t vstride; /*   bytes from one vertex to the next */
	uint32_t voff[3]; /*   x, y, z within a vertex */
	wh_type vtype[3];
	bool vswap;
	bool is_double;    /* positions have more than float precision: write doubles */
	bool keep_invalid; /* vertices that are not finite are no failure */
	const struct wh_attributes *attributes; /* carried beside positions; NULL: none */
	int afd; /* their records; -1: their scalars lie beside the positions */
	uint64_t abase;
	const struct wh_wedges *wedges; /* carried by faces and corners; NULL: nothing. Their
	                                   records lie at the end of each triangle */
	int ffd;                        /* triangles: */
	uint64_t fbase;
	uint32_t fstride;
	int64_t count_off; /*   corner count within a face; -1: none stored, always 3 */
	wh_type count_type;
	uint32_t ioff; /*   first of the three indices within a face */
	wh_type itype;
	bool fswap;
} wh_source;

/*
 * True when the binary body of p can be a source as it stands: fixed-size vertices, behind them
 * faces with no other list than the corners, and bytes enough for triangles (the counts
 * themselves are verified on reading).
 */
bool wh_ply_direct(const wh_ply *p, wh_source *out);

/* Of a binary file whose vertices are of fixed size and begin at byte `base`: fills the part of
 * `out` that is about vertices, and the path. */
void wh_ply_vertex_source(const wh_ply *p, uint64_t base, wh_source *out);

/* Exactly n bytes of the file at `offset`; WH_E_INPUT when it ends before them. Thread-safe. */
wh_code wh_ply_pread(wh_ctx *c, const char *path, int fd, void *buf, size_t n, uint64_t offset);

/* Bytes of `raw` that reading n vertices or n triangles at once needs. */
size_t wh_source_vertex_bytes(const wh_source *s, size_t n);
size_t wh_source_triangle_bytes(const wh_source *s, size_t n);

/*
 * Reads vertices first .. first+n-1 into xyz (3n doubles). WH_E_INPUT for a truncated body or,
 * unless keep_invalid is set, a coordinate that is not finite (names the vertex). Thread-safe with
 * one `raw` per thread.
 */
wh_code wh_source_vertices(wh_ctx *c, const wh_source *s, uint64_t first, size_t n, double *xyz,
                           void *raw);

/* Reads the attributes of the same vertices as records, one behind the other; only where there are
 * attributes. Failures and threads as above. */
wh_code wh_source_attributes(wh_ctx *c, const wh_source *s, uint64_t first, size_t n,
                             uint8_t *records, void *raw);

/*
 * Reads triangles first .. first+n-1 into ids (3n indices, all < s->nv). WH_E_INPUT for a
 * truncated body or an index out of range (names the face and the index). WH_E_IRREGULAR, with
 * nothing recorded, when a stored corner count is not 3.
 */
wh_code wh_source_triangles(wh_ctx *c, const wh_source *s, uint64_t first, size_t n, uint64_t *ids,
                            void *raw);

/* How a mesh is written. */
typedef struct wh_ply_style {
	bool ascii;                             /* text instead of binary little endian */
	bool is_double;                         /* positions as double instead of float */
	wh_format format;                       /* of mesh_write; WH_FORMAT_ANY is PLY */
	bool quantize;                          /* GLB: positions of 16 bits, the rest of 8 */
	const struct wh_attributes *attributes; /* written beside positions; NULL: none */
	const struct wh_wedges *wedges; /* the same of faces, in PLY and OBJ; NULL: nothing */
	/* the attributes of vertices that are doubled where their corners differ in one of them,
	 * which the corners have no more then (pipeline/atlas.h); NULL: none is. Whoever doubles
	 * them makes these the attributes. */
	const struct wh_attributes *doubled;
	const char *texture; /* GLB: the one picture that all faces have, a file beside the output;
	                        NULL: none */
} wh_ply_style;

struct wh_outfile;

/* Writes the header: vertices with x, y, z and the attributes, in the order of their file; faces
 * with vertex_indices (list uchar int, or uint from 2^31 vertices on; WH_E_USAGE from 2^32 on). */
wh_code wh_ply_write_header(wh_ctx *c, struct wh_outfile *o, wh_ply_style style, uint64_t nv,
                            uint64_t nf);
/* Appends n vertices (3n doubles) without attributes; all vertices come before all faces. */
wh_code wh_ply_write_vertices(wh_ctx *c, struct wh_outfile *o, wh_ply_style style,
                              const double *xyz, size_t n);
/* The same with the records of their attributes, where the style has any. */
wh_code wh_ply_write_records(wh_ctx *c, struct wh_outfile *o, wh_ply_style style, const double *xyz,
                             const uint8_t *records, size_t n);
/* Appends n triangles (3n indices), with the records of what they carry where the style has
 * wedges. */
wh_code wh_ply_write_triangles(wh_ctx *c, struct wh_outfile *o, wh_ply_style style,
                               const uint32_t *ids, const uint8_t *records, size_t n);

#endif
