/*
 * glb_write: the binary form of glTF 2.0, one mesh, streamed.
 *
 * A header of JSON with the counts and the bounds; then the vertices, each with its position,
 * normal (NORMAL, a unit vector), colour (COLOR_0, proportional to light, with alpha) and texture
 * coordinates (TEXCOORD_0, whose v counts down from the top of the picture) side by side; then the
 * indices. Where all faces have one texture, a material names its file. Part of mesh_write.
 *
 *                    position      normal        colour         texture     index
 *     plain          3 floats      3 floats      4 x 16 bits    2 floats    32 bits
 *     quantized      3 x 16 bits   3 x 8 bits    4 x 8 bits     2 floats    16 bits where they do
 *
 * Quantized (KHR_mesh_quantization), a node brings positions back from steps of 1/65535 of the
 * longest side of the box. As plain positions are floats, doubles are written as distances from the
 * middle of the box, and a node moves them there.
 */
#ifndef WH_IO_GLB_WRITE_H
#define WH_IO_GLB_WRITE_H

#include "io/outfile.h"
#include "io/ply.h"

typedef struct wh_glb {
	const struct wh_attributes *attributes; /* NULL: none */
	bool quantize, is_double, small_ids;
	double origin[3]; /* taken off all positions */
	double step;      /* of quantized positions */
	uint32_t stride;  /* bytes of a vertex */
	uint32_t normal_at, colour_at, texture_at;
	const char *texture; /* the name of its file; NULL: none */
	uint64_t nv, nf;
	uint16_t light[256]; /* of colours that are bytes: 65535 times what COLOR_0 has */
} wh_glb;

/* WH_E_USAGE for more than 4 GiB. */
wh_code wh_glb_fits(wh_ctx *c, wh_ply_style style, uint64_t nv, uint64_t nf);
/* Header, JSON, and what comes before the first vertex. WH_E_USAGE for more than 4 GiB. */
wh_code wh_glb_begin(wh_ctx *c, wh_glb *g, wh_outfile *out, wh_ply_style style, uint64_t nv,
                     uint64_t nf, const double lo[3], const double hi[3]);
/* Both write at `to` and return where they end. A vertex takes 40 bytes at most. */
unsigned char *wh_glb_vertices(const wh_glb *g, unsigned char *to, const double *xyz,
                               const uint8_t *records, size_t n);
unsigned char *wh_glb_triangles(const wh_glb *g, unsigned char *to, const uint32_t *ids, size_t n);
wh_code wh_glb_end(wh_ctx *c, const wh_glb *g, wh_outfile *out);

#endif
