#include "io/glb_write.h"

#include "base/bytes.h"
#include "base/real.h"
#include "io/attributes.h"
#include "io/number.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>

enum {
	JSON = 8192,     /* bytes of it, at most, ... */
	URI_MOST = 4096, /* ... of which the name of a file takes as many */
	HEADERS = 28,    /* bytes: of the file, and of its two chunks */
	STEPS = 65535    /* of the longest side of the box, quantized */
};

/* glTF's numbers of types */
enum { BYTE = 5120, UBYTE = 5121, USHORT = 5123, UINT = 5125, FLOAT = 5126 };

/* ---- numbers ------------------------------------------------------------------------------ */

static unsigned char *put16(unsigned char *to, uint32_t v)
{
	to[0] = (unsigned char)v;
	to[1] = (unsigned char)(v >> 8);
	return to + 2;
}

static unsigned char *put_float(unsigned char *to, double x)
{
	const float f = (float)x;
	uint32_t v;
	memcpy(&v, &f, sizeof v);
	return wh_put32(to, v);
}

static uint32_t step_of(const wh_glb *g, double x, int axis)
{
	const double v = rint((x - g->origin[axis]) / g->step);
	return v > 0 ? v < STEPS ? (uint32_t)v : STEPS : 0;
}

/* What an sRGB value in 0 .. 1 is of the light of white (IEC 61966-2-1). Its power of 2.4 is the
 * square times the fifth root of the square, which Newton's steps find with the same bits wherever
 * numbers are IEEE's. */
static double light_of(double v)
{
	const double y = (v + 0.055) / 1.055, a = y * y;
	double root = 1;
	if (v <= 0.04045)
		return v / 12.92;
	for (int i = 0; i < 16; i++)
		root -= (root - a / (root * root * root * root)) / 5;
	return a * root;
}

/* ---- layout ------------------------------------------------------------------------------- */

static bool has_normal(const wh_glb *g)
{
	return g->attributes && g->attributes->has_normal;
}

static bool has_colour(const wh_glb *g)
{
	return g->attributes && g->attributes->has_rgb;
}

static bool has_texture(const wh_glb *g)
{
	return g->attributes && g->attributes->has_texture;
}

static void lay_out(wh_glb *g)
{
	g->normal_at = g->quantize ? 8 : 12;
	g->colour_at = g->normal_at + (!has_normal(g) ? 0 : g->quantize ? 4 : 12);
	g->texture_at = g->colour_at + (!has_colour(g) ? 0 : g->quantize ? 4 : 8);
	g->stride = g->texture_at + (has_texture(g) ? 8 : 0);
	g->small_ids = g->quantize && g->nv <= UINT16_MAX;
	for (int i = 0; has_colour(g) && i < 256; i++)
		g->light[i] = (uint16_t)rint(65535 * light_of(i / 255.0));
}

/* Where positions are counted from: the lowest corner, or, for what floats cannot hold, the
 * middle. */
static void choose_origin(wh_glb *g, const double lo[3], const double hi[3])
{
	double side = 0;
	for (int k = 0; k < 3; k++) {
		side = fmax(side, hi[k] - lo[k]);
		if (g->quantize)
			g->origin[k] = lo[k];
		else if (g->is_double)
			g->origin[k] = wh_round_float(0.5 * lo[k] + 0.5 * hi[k]);
	}
	g->step = side > 0 ? side / STEPS : 1;
}

static uint64_t vertex_bytes(const wh_glb *g)
{
	return g->nv * g->stride;
}

static uint64_t index_bytes(const wh_glb *g)
{
	return 3 * g->nf * (g->small_ids ? 2 : 4);
}

static uint64_t body_bytes(const wh_glb *g)
{
	return (vertex_bytes(g) + index_bytes(g) + 3) / 4 * 4;
}

/* ---- JSON --------------------------------------------------------------------------------- */

static char *put_triple(char *to, const char *name, const double v[3], bool is_double)
{
	to += sprintf(to, ",\"%s\":[", name);
	for (int k = 0; k < 3; k++) {
		to = wh_print_real(to, is_double, v[k]);
		*to++ = k < 2 ? ',' : ']';
	}
	return to;
}

static char *put_node(const wh_glb *g, char *to)
{
	if (g->quantize)
		to += sprintf(to, "\"extensionsUsed\":[\"KHR_mesh_quantization\"],"
		                  "\"extensionsRequired\":[\"KHR_mesh_quantization\"],");
	to += sprintf(to, "\"scene\":0,\"scenes\":[{\"nodes\":[0]}],\"nodes\":[{\"mesh\":0");
	if (g->quantize || g->is_double)
		to = put_triple(to, "translation", g->origin, true);
	if (g->quantize)
		to = put_triple(to, "scale", (const double[]){g->step, g->step, g->step}, true);
	return to + sprintf(to, "}],");
}

/* A name that would be too long is left out. */
static bool names_texture(const wh_glb *g)
{
	return has_texture(g) && g->texture && 3 * strlen(g->texture) < URI_MOST;
}

/* The name of a file as a relative reference (RFC 3986): all but letters, digits and a few more in
 * hexadecimal. */
static char *put_uri(char *to, const char *name)
{
	static const char plain[] = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789"
	                            "-._~/";
	for (; *name; name++) {
		if (strchr(plain, *name))
			*to++ = *name;
		else if (*name == '\\') /* as some programs write them */
			*to++ = '/';
		else
			to += sprintf(to, "%%%02X", (unsigned char)*name);
	}
	return to;
}

static char *put_material(const wh_glb *g, char *to)
{
	if (!names_texture(g))
		return to;
	to += sprintf(to, "\"images\":[{\"uri\":\"");
	to = put_uri(to, g->texture);
	return to + sprintf(to, "\"}],\"textures\":[{\"source\":0}],\"materials\":[{"
	                        "\"pbrMetallicRoughness\":{\"baseColorTexture\":{\"index\":0},"
	                        "\"metallicFactor\":0}}],");
}

static char *put_mesh(const wh_glb *g, char *to)
{
	int accessor = 2;
	to += sprintf(to, "\"meshes\":[{\"primitives\":[{\"attributes\":{\"POSITION\":0");
	if (has_normal(g))
		to += sprintf(to, ",\"NORMAL\":%d", accessor++);
	if (has_colour(g))
		to += sprintf(to, ",\"COLOR_0\":%d", accessor++);
	if (has_texture(g))
		to += sprintf(to, ",\"TEXCOORD_0\":%d", accessor);
	return to + sprintf(to, "},\"indices\":1,\"mode\":4%s}]}],",
	                    names_texture(g) ? ",\"material\":0" : "");
}

/* The bounds as they will be read. */
static char *put_bounds(const wh_glb *g, char *to, const double lo[3], const double hi[3])
{
	double least[3], most[3];
	for (int k = 0; k < 3; k++) {
		least[k] = g->quantize ? step_of(g, lo[k], k) : lo[k] - g->origin[k];
		most[k] = g->quantize ? step_of(g, hi[k], k) : hi[k] - g->origin[k];
	}
	to = put_triple(to, "min", least, false);
	return put_triple(to, "max", most, false);
}

static char *put_accessors(const wh_glb *g, char *to, const double lo[3], const double hi[3])
{
	to += sprintf(to,
	              "\"accessors\":[{\"bufferView\":0,\"componentType\":%d,\"count\":%" PRIu64
	              ",\"type\":\"VEC3\"",
	              g->quantize ? USHORT : FLOAT, g->nv);
	to = put_bounds(g, to, lo, hi);
	to += sprintf(to,
	              "},{\"bufferView\":1,\"componentType\":%d,\"count\":%" PRIu64
	              ",\"type\":\"SCALAR\"}",
	              g->small_ids ? USHORT : UINT, 3 * g->nf);
	if (has_normal(g))
		to += sprintf(to,
		              ",{\"bufferView\":0,\"byteOffset\":%u,\"componentType\":%d%s,"
		              "\"count\":%" PRIu64 ",\"type\":\"VEC3\"}",
		              g->normal_at, g->quantize ? BYTE : FLOAT,
		              g->quantize ? ",\"normalized\":true" : "", g->nv);
	if (has_colour(g))
		to += sprintf(to,
		              ",{\"bufferView\":0,\"byteOffset\":%u,\"componentType\":%d,"
		              "\"normalized\":true,\"count\":%" PRIu64 ",\"type\":\"VEC4\"}",
		              g->colour_at, g->quantize ? UBYTE : USHORT, g->nv);
	if (has_texture(g))
		to += sprintf(to,
		              ",{\"bufferView\":0,\"byteOffset\":%u,\"componentType\":%d,"
		              "\"count\":%" PRIu64 ",\"type\":\"VEC2\"}",
		              g->texture_at, FLOAT, g->nv);
	return to + sprintf(to, "],");
}

static char *put_buffers(const wh_glb *g, char *to)
{
	to +=
	    sprintf(to, "\"bufferViews\":[{\"buffer\":0,\"byteLength\":%" PRIu64, vertex_bytes(g));
	if (g->stride != 12)
		to += sprintf(to, ",\"byteStride\":%u", g->stride);
	return to + sprintf(to,
	                    ",\"target\":34962},{\"buffer\":0,\"byteOffset\":%" PRIu64
	                    ",\"byteLength\":%" PRIu64
	                    ",\"target\":34963}],\"buffers\":[{\"byteLength\":%" PRIu64 "}]}",
	                    vertex_bytes(g), index_bytes(g), body_bytes(g));
}

static size_t put_json(const wh_glb *g, const double lo[3], const double hi[3], char text[JSON])
{
	char *to = text;
	to += sprintf(to, "{\"asset\":{\"version\":\"2.0\",\"generator\":\"whittle\"},");
	to = put_node(g, to);
	to = put_mesh(g, to);
	to = put_material(g, to);
	to = put_accessors(g, to, lo, hi);
	to = put_buffers(g, to);
	while ((to - text) % 4 != 0)
		*to++ = ' ';
	return (size_t)(to - text);
}

static wh_glb describe(wh_ply_style style, uint64_t nv, uint64_t nf)
{
	wh_glb g = {.attributes = style.attributes,
	            .quantize = style.quantize,
	            .is_double = style.is_double,
	            .texture = style.texture,
	            .nv = nv,
	            .nf = nf};
	lay_out(&g);
	return g;
}

wh_code wh_glb_fits(wh_ctx *c, wh_ply_style style, uint64_t nv, uint64_t nf)
{
	const wh_glb g = describe(style, nv, nf);
	if (nv < UINT32_MAX && nf < UINT32_MAX && body_bytes(&g) <= UINT32_MAX - JSON - HEADERS)
		return WH_OK;
	return wh_fail(c, WH_E_USAGE,
	               "%" PRIu64 " vertices and %" PRIu64
	               " faces do not fit a GLB file, which ends at 4 GiB; reduce to fewer, "
	               "or write PLY",
	               nv, nf);
}

wh_code wh_glb_begin(wh_ctx *c, wh_glb *g, wh_outfile *out, wh_ply_style style, uint64_t nv,
                     uint64_t nf, const double lo[3], const double hi[3])
{
	char json[JSON];
	unsigned char head[20], bin[8];
	if (wh_glb_fits(c, style, nv, nf) != WH_OK)
		return c->err.code;
	*g = describe(style, nv, nf);
	choose_origin(g, lo, hi);
	const size_t n = put_json(g, lo, hi, json);
	const uint32_t body = (uint32_t)body_bytes(g);
	unsigned char *to = wh_put32(head, 0x46546c67); /* "glTF" */
	to = wh_put32(to, 2);
	to = wh_put32(to, (uint32_t)(HEADERS + n) + body);
	to = wh_put32(to, (uint32_t)n);
	(void)wh_put32(to, 0x4e4f534a);                  /* "JSON" */
	(void)wh_put32(wh_put32(bin, body), 0x004e4942); /* "BIN" */
	if (wh_outfile_write(c, out, head, sizeof head) != WH_OK ||
	    wh_outfile_write(c, out, json, n) != WH_OK)
		return c->err.code;
	return wh_outfile_write(c, out, bin, sizeof bin);
}

/* ---- vertices ----------------------------------------------------------------------------- */

static unsigned char *put_position(const wh_glb *g, unsigned char *to, const double xyz[3])
{
	for (int k = 0; k < 3; k++)
		to = g->quantize ? put16(to, step_of(g, xyz[k], k))
		                 : put_float(to, xyz[k] - g->origin[k]);
	return g->quantize ? put16(to, 0) : to;
}

/* glTF has unit vectors only: what is none points up. */
static unsigned char *put_normal(const wh_glb *g, unsigned char *to, const uint8_t *record)
{
	const wh_attributes *a = g->attributes;
	double n[3], norm2 = 0;
	for (int k = 0; k < 3; k++) {
		n[k] = wh_attribute_get(&a->item[a->normal[k]], record);
		norm2 += n[k] * n[k];
	}
	const double norm = sqrt(norm2);
	const bool unit = norm > 0 && isfinite(norm);
	for (int k = 0; k < 3; k++) {
		const double v = unit ? n[k] / norm : k == 2;
		if (g->quantize)
			*to++ = (unsigned char)(int8_t)rint(127 * v);
		else
			to = put_float(to, v);
	}
	if (g->quantize)
		*to++ = 0;
	return to;
}

static unsigned char *put_channel(const wh_glb *g, unsigned char *to, uint32_t of_65535)
{
	if (!g->quantize)
		return put16(to, of_65535);
	*to = (unsigned char)((of_65535 + 128) / 257);
	return to + 1;
}

static uint32_t channel_of(const wh_glb *g, const wh_attribute *item, const uint8_t *record)
{
	const double share = wh_attribute_share(item, record);
	if (item->type == WH_U8)
		return g->light[(int)rint(255 * share)];
	return (uint32_t)rint(65535 * light_of(share));
}

static unsigned char *put_colour(const wh_glb *g, unsigned char *to, const uint8_t *record)
{
	const wh_attributes *a = g->attributes;
	for (int k = 0; k < 3; k++)
		to = put_channel(g, to, channel_of(g, &a->item[a->rgb[k]], record));
	const double alpha = a->has_alpha ? wh_attribute_share(&a->item[a->alpha], record) : 1;
	return put_channel(g, to, (uint32_t)rint(65535 * alpha));
}

static unsigned char *put_texture(const wh_glb *g, unsigned char *to, const uint8_t *record)
{
	const wh_attributes *a = g->attributes;
	to = put_float(to, wh_attribute_get(&a->item[a->texture[0]], record));
	return put_float(to, 1 - wh_attribute_get(&a->item[a->texture[1]], record));
}

unsigned char *wh_glb_vertices(const wh_glb *g, unsigned char *to, const double *xyz,
                               const uint8_t *records, size_t n)
{
	for (size_t i = 0; i < n; i++) {
		to = put_position(g, to, xyz + 3 * i);
		if (has_normal(g))
			to = put_normal(g, to, records + i * g->attributes->bytes);
		if (has_colour(g))
			to = put_colour(g, to, records + i * g->attributes->bytes);
		if (has_texture(g))
			to = put_texture(g, to, records + i * g->attributes->bytes);
	}
	return to;
}

/* ---- indices ------------------------------------------------------------------------------ */

unsigned char *wh_glb_triangles(const wh_glb *g, unsigned char *to, const uint32_t *ids, size_t n)
{
	for (size_t i = 0; i < 3 * n; i++)
		to = g->small_ids ? put16(to, ids[i]) : wh_put32(to, ids[i]);
	return to;
}

wh_code wh_glb_end(wh_ctx *c, const wh_glb *g, wh_outfile *out)
{
	const uint64_t used = vertex_bytes(g) + index_bytes(g);
	return wh_outfile_write(c, out, (const unsigned char[3]){0},
	                        (size_t)(body_bytes(g) - used));
}
