/*
 * pmesh: progressive mesh files. A base mesh, and the vertex splits that lead from it, one after
 * the other, to the finest mesh (Hoppe, "Progressive meshes", 1996).
 *
 * A split makes one vertex and its faces, and puts them behind those there are: so the mesh after k
 * splits, level k, is a number of vertices and faces from the first on, and each vertex and face
 * has one number for good. Every split can be undone, by the edge collapse that it was made from.
 *
 * The bytes; numbers are little-endian:
 *
 *     offset  bytes  content
 *          0      8  "WHPMESH1"
 *          8      4  version: 1
 *         12      4  bytes of a coordinate: 4 (float) or 8 (double)
 *         16      4  properties of a vertex: x, y, z and others
 *         20      4  bytes of their description
 *         24      8  vertices of the base
 *         32      8  faces of the base
 *         40      8  splits
 *         48      8  faces of the finest mesh
 *         56      8  bytes of the file that it was made from
 *         64      4  error of the base, a float (see below)
 *         68      4  cost of the last collapse, a float
 *         72      8  diagonal of that file's bounding box, a double
 *         80      8  XXH3 of what comes before, with that of the description as seed
 *         88         the description: for each property, in the order of that file, a byte for its
 *                    type there and one for that in a PLY output (ply.h), a byte for the length of
 *                    its name, and the name
 *                    the base: x, y and z of its vertices; their other properties, each in its form
 *                    (attributes.h); its faces, three numbers of 4 bytes each; 8 bytes XXH3 of all
 *                    that
 *                    blocks, each of WH_PMESH_BLOCK splits but the last, which has what is left
 *
 * A block:
 *
 *     offset  bytes  content
 *          0      4  bytes behind this head
 *          4      4  splits in it
 *          8      8  faces after it
 *         16      4  error before its last split, a float
 *         20      4  cost of its last split, a float
 *         24      8  XXH3 of the head so far, with that of what follows as seed
 *         32         columns, each a byte k and one number for each split, in the class code of
 *                    order k (base/bits.h), up to a whole byte
 *                    the fans of all splits
 *
 * Columns. A real number is taken as the whole number that its bits are, those below zero mirrored
 * so that order stays; a difference is taken modulo its width and stands as 2 d, or -2 d - 1 when
 * it is negative.
 *
 *      0         v: the vertex that is split; the new one, u, is numbered behind all others
 *      1         new faces: 0 u v s and v u t, 1 u v s, 2 v u t; 3, 4, 5: none, one or two that the
 *                fan names
 *      2, 3, 4   v's new x, y, z: the difference from where v was before
 *      5, 6, 7   u's: the difference from v's place before, mirrored at v's new one: p - (v - p)
 *      8         error before the split: how much less, as a whole number, than that of the split
 *                before it (of a block's first: than what the head before says)
 *      9         cost of the collapse, the same
 *     10 ...     for each property two columns: v's new value, u's; differences from v's old one
 *
 * Fans. Each vertex has a list of its corners, the latest first; those of the base enter face by
 * face. Of v's corners some become u's. A list of up to 32 has a bit for each, 1 for those; of a
 * longer one it is said how many there are, at most 255, and for each how many that stay come
 * before it and behind the last one, in the class code of order 0. They leave v's list and are u's
 * in the same order. Each face of them leads from one neighbour of v, behind the corner, to
 * another, before it. s is the only neighbour that one leads from and none leads to; t the only one
 * that one leads to and none leads from. A face that is named takes a bit, 1 for u v a and 0 for v
 * u a, and 32 bits, the number of a. Last the new faces' corners enter the lists, in the order in
 * which they are told here.
 *
 * Errors: of level k, the accumulated distance estimate of the worst vertex that a collapse made
 * which level k does not undo. Costs: what the collapse cost, or one that had to come before it.
 * Both fall from split to split.
 */
#ifndef WH_IO_PMESH_H
#define WH_IO_PMESH_H

#include "base/bits.h"
#include "io/attributes.h"
#include "io/outfile.h"

enum {
	WH_PMESH_BLOCK = 4096, /* splits */
	WH_PMESH_V = 0,        /* columns */
	WH_PMESH_WAY = 1,
	WH_PMESH_PLACE = 2, /* of v; of u behind it */
	WH_PMESH_ERROR = 8,
	WH_PMESH_COST = 9,
	WH_PMESH_FIXED = 10 /* columns without properties */
};

/* New faces, as column WH_PMESH_WAY has them. */
enum {
	WH_PMESH_BOTH,
	WH_PMESH_FIRST,
	WH_PMESH_SECOND,
	WH_PMESH_NAMED, /* and how many, up to 2 */
	WH_PMESH_WAYS = WH_PMESH_NAMED + 3
};

static inline uint32_t wh_pmesh_new_faces(uint64_t way)
{
	return way == WH_PMESH_BOTH ? 2 : way < WH_PMESH_NAMED ? 1 : (uint32_t)way - WH_PMESH_NAMED;
}

enum {
	WH_PMESH_SHORT = 32, /* corners of a list that have a bit each */
	WH_PMESH_MOVED = 255 /* corners that a split moves, at most */
};

typedef struct wh_pmesh_head {
	uint32_t coord_bytes;
	uint64_t base_vertices, base_faces, splits, faces; /* faces: of the finest mesh */
	uint64_t input_bytes;
	float error, cost;
	double diagonal;
} wh_pmesh_head;

/* Of a block, and where it is. */
typedef struct wh_pmesh_part {
	uint64_t at;
	uint32_t bytes, splits;
	uint64_t faces;
	float error, cost;
} wh_pmesh_part;

/* The splits of a block: columns of numbers, and fans. */
typedef struct wh_pmesh_block {
	uint32_t columns, n; /* n: splits */
	uint64_t *number;    /* WH_PMESH_BLOCK to a column */
	wh_bits_out fans;    /* on their way out */
	wh_bits_in fan;      /* on their way in */
	wh_bits_out code;    /* scratch of writing */
	uint8_t *raw;        /* scratch of reading */
	size_t raw_cap;
} wh_pmesh_block;

static inline uint64_t *wh_pmesh_column(const wh_pmesh_block *b, uint32_t k)
{
	return b->number + (size_t)k * WH_PMESH_BLOCK;
}

/* Room for a block of meshes whose vertices have so many other properties. Free it, after a failure
 * too. */
wh_code wh_pmesh_block_make(wh_ctx *c, wh_pmesh_block *b, uint32_t properties);
void wh_pmesh_block_free(wh_ctx *c, wh_pmesh_block *b);

/* Differences of reals and whole numbers of `bytes` bytes, as columns have them: wh_pmesh_real and
 * its opposite make a whole number of the bits of a real; `difference` is of whole numbers. */
static inline uint64_t wh_pmesh_ordered(double v, uint32_t bytes)
{
	if (bytes == 8) {
		uint64_t bits;
		memcpy(&bits, &v, sizeof bits);
		return bits >> 63 ? ~bits : bits | 1ULL << 63;
	}
	const float f = (float)v;
	uint32_t bits;
	memcpy(&bits, &f, sizeof bits);
	return bits >> 31 ? (uint32_t)~bits : bits | 1U << 31;
}

static inline double wh_pmesh_real(uint64_t ordered, uint32_t bytes)
{
	if (bytes == 8) {
		const uint64_t bits = ordered >> 63 ? ordered ^ 1ULL << 63 : ~ordered;
		double v;
		memcpy(&v, &bits, sizeof v);
		return v;
	}
	const uint32_t low = (uint32_t)ordered, bits = low >> 31 ? low ^ 1U << 31 : ~low;
	float f;
	memcpy(&f, &bits, sizeof f);
	return (double)f;
}

/* What stands for to - from. */
static inline uint64_t wh_pmesh_difference(uint64_t from, uint64_t to, uint32_t bytes)
{
	const uint32_t spare = 64 - 8 * bytes;
	const int64_t d = (int64_t)((to - from) << spare) >> spare;
	return ((uint64_t)d << 1) ^ (uint64_t)(d >> 63);
}

/* The number that such a difference leads to. */
static inline uint64_t wh_pmesh_add(uint64_t from, uint64_t difference, uint32_t bytes)
{
	const uint64_t to = from + (difference >> 1 ^ (0 - (difference & 1)));
	return bytes < 8 ? to & ((1ULL << 8 * bytes) - 1) : to;
}

/* A property in a vertex's record, as a whole number; and back. */
uint64_t wh_pmesh_property(const wh_attribute *a, const uint8_t *record);
void wh_pmesh_set_property(const wh_attribute *a, uint8_t *record, uint64_t ordered);

/* ---- out ---------------------------------------------------------------------------------- */

/* A mesh in memory. */
typedef struct wh_pmesh_base {
	const double *xyz;   /* in file coordinates */
	const uint8_t *attr; /* records; NULL without attributes */
	const uint32_t *tri;
} wh_pmesh_base;

/* Header and base. `a` may be NULL: no properties besides positions. */
wh_code wh_pmesh_write_base(wh_ctx *c, wh_outfile *o, const wh_pmesh_head *h,
                            const wh_attributes *a, const wh_pmesh_base *base);
/* A block, which is emptied; of `part` the faces, error and cost are the caller's. */
wh_code wh_pmesh_write_block(wh_ctx *c, wh_outfile *o, wh_pmesh_block *b,
                             const wh_pmesh_part *part);

/* ---- in ----------------------------------------------------------------------------------- */

/* An open file. */
typedef struct wh_pmesh {
	wh_ply ply; /* the file, and its properties in PLY's words */
	wh_attributes attributes;
	wh_pmesh_head head;
	uint64_t base; /* byte offset */
	wh_pmesh_part *part;
	uint64_t parts;
} wh_pmesh;

/* Opens a file and reads all of it but the base and the blocks' bodies. WH_E_INPUT, naming the
 * place, for what is no such file or damaged: then, too, close it. */
wh_code wh_pmesh_open(wh_ctx *c, wh_pmesh *p, const char *path);
void wh_pmesh_close(wh_ctx *c, wh_pmesh *p);

/* Reads the base into arrays that hold it; corners are in range. */
wh_code wh_pmesh_read_base(wh_ctx *c, const wh_pmesh *p, double *xyz, uint8_t *attr, uint32_t *tri);
/* Reads block i: its columns are whole, and what follows is at b->fan. */
wh_code wh_pmesh_read_block(wh_ctx *c, const wh_pmesh *p, uint64_t i, wh_pmesh_block *b);

/* A split of block i makes no sense. */
wh_code wh_pmesh_damaged(wh_ctx *c, const wh_pmesh *p, uint64_t i, const char *what);

#endif
