/*
 * attributes: the vertex properties that are carried beside positions, and their form on the way.
 *
 * Of a file's scalar vertex properties some are chosen (all, or by name). Each has a kind, which
 * says how the value of a new vertex is made of those around it, and a form, in which it lies in
 * the record that every vertex carries from ingest to output:
 *
 *     kind      what                                       new values
 *     colour    red, green, blue, alpha, r, g, b, with or  averaged
 *               without diffuse_ or the like in front
 *     normal    nx, ny, nz and normal_x .. of real types   averaged, lengths kept: unit stays unit
 *     texture   s, t, u, v, texture_u ...                  averaged
 *     scalar    any other real; whole numbers that are     averaged
 *               called quality, confidence, intensity ...
 *     label     any other whole number; reals that are     taken from one vertex, never averaged
 *               called label, classification ...
 *
 *     form      of                                         bytes
 *     fixed     averaged 8-bit numbers, in 256ths          2
 *     float     averaged 16-bit numbers, floats            4
 *     double    averaged 32- and 64-bit numbers, doubles   8
 *     whole     labels of whole numbers                    those of the type
 *
 * PLY holds them all. Of what other formats know by its meaning alone there are groups, each whole
 * or not there at all: red, green and blue; alpha beside them; normals; texture coordinates. Text
 * of other formats has colours from 0 to 1, which become bytes in PLY.
 *
 * A value that is never averaged comes out with the bits it went in with, however often it is
 * copied. Records are in the byte order of the machine, without gaps.
 */
#ifndef WH_IO_ATTRIBUTES_H
#define WH_IO_ATTRIBUTES_H

#include "io/ply_value.h"

#include <string.h>

typedef enum wh_kind {
	WH_KIND_COLOUR,
	WH_KIND_NORMAL,
	WH_KIND_TEXTURE,
	WH_KIND_SCALAR,
	WH_KIND_LABEL,
	WH_KINDS
} wh_kind;

/* Its name, for reports. */
const char *wh_kind_name(wh_kind kind);

typedef enum wh_form { WH_FORM_FIXED, WH_FORM_FLOAT, WH_FORM_DOUBLE, WH_FORM_WHOLE } wh_form;

typedef struct wh_attribute {
	const char *name; /* the header's */
	wh_type type;     /* in the file */
	wh_type out;      /* in a PLY output */
	wh_kind kind;
	wh_form form;
	int prop;         /* its place among the properties of the element */
	uint32_t at;      /* where it is in a record */
	uint32_t file_at; /* where it is in a binary vertex without lists */
	double weight;    /* in the cost of collapses, of a difference of 1; 0: none */
} wh_attribute;

enum { WH_MOST_ATTRIBUTES = 1024 };

typedef struct wh_attributes {
	wh_attribute *item; /* in the order of the file */
	uint32_t n;
	uint32_t bytes;      /* of a record */
	uint32_t file_bytes; /* of the values in a binary output */
	uint32_t before[3];  /* attributes that come before x, y and z in the file, ... */
	int rank[3];         /* ... and which of x, y and z comes first: they ascend in its order */
	bool weighted;       /* one of them has a weight */
	bool has_normal, has_rgb, has_alpha, has_texture;
	uint32_t normal[3];  /* places of nx, ny and nz when has_normal: all three are carried */
	uint32_t rgb[3];     /* the same of red, green and blue, ... */
	uint32_t alpha;      /* ... of alpha, only with those, ... */
	uint32_t texture[2]; /* ... and of s and t, or u and v */
} wh_attributes;

/* What an output has room for. */
enum {
	WH_HOLDS_COLOUR = 1,
	WH_HOLDS_ALPHA = 2,
	WH_HOLDS_NORMAL = 4,
	WH_HOLDS_TEXTURE = 8,
	WH_HOLDS_ALL = 255,     /* any property of vertices */
	WH_HOLDS_FACES = 256,   /* what faces carry (wedges.h) */
	WH_HOLDS_CORNERS = 512, /* what their corners do: as it is, or by doubled vertices */
	WH_HOLDS_APART = 1024   /* but texture coordinates that vertices have stay with them */
};

/* What to carry: names as below, as far as the output has room for it. */
typedef struct wh_wanted {
	const char *names;
	uint32_t holds;
} wh_wanted;

/*
 * Chooses among the vertex properties of p, which must stay open as long as *a is in use. Names:
 * NULL or "all"; "none"; or names with commas between them, where colour, normal and texture stand
 * for all of that kind that there are. WH_E_USAGE for any other name that the file does not have,
 * of vertices or faces, or more than WH_MOST_ATTRIBUTES.
 */
wh_code wh_attributes_choose(wh_ctx *c, const wh_ply *p, wh_wanted wanted, wh_attributes *a);
/* The same among the scalars of any element; names that it does not have are passed over. */
wh_code wh_attributes_choose_of(wh_ctx *c, const wh_ply *p, int elem, wh_wanted wanted,
                                wh_attributes *a);
void wh_attributes_free(wh_ctx *c, wh_attributes *a);

/* Of attributes with texture coordinates: these, u first, and behind them normals, which belong to
 * the corners of faces where vertices are doubled (wedges.h); or, unless of_corners, the others, in
 * their order. *part refers to what a does. */
wh_code wh_attributes_part(wh_ctx *c, const wh_attributes *a, bool of_corners, wh_attributes *part);
/* Those of a, and behind them those of b, with texture coordinates or without. */
wh_code wh_attributes_both(wh_ctx *c, const wh_attributes *a, const wh_attributes *b, bool texture,
                           wh_attributes *both);

/* Finds what belongs together, when all of its parts are carried: normals, colours, coordinates. */
void wh_attributes_group(wh_attributes *a);

/* True when such a list means a property of this name and kind. */
bool wh_attributes_names(const char *wanted, const char *name, wh_kind kind);

/*
 * Sets weights: NULL, or NAME=W with commas between them, where colour, normal and texture stand
 * for all of that kind; the last one that fits holds. W is for a difference of 1 in a value; of
 * colours, for one as from black to white; of labels, for any. WH_E_USAGE, naming `path`, for a
 * name that is not carried, or a W that is no number from 0 on.
 */
wh_code wh_attributes_weigh(wh_ctx *c, const char *path, const char *weights, wh_attributes *a);

/* What vertex property number `prop` is carried as; NULL when it is not. `a` may be NULL. */
const wh_attribute *wh_attributes_find(const wh_attributes *a, int prop);

/* Bytes that an attribute takes in a record. */
static inline uint32_t wh_attribute_bytes(const wh_attribute *a)
{
	return a->form == WH_FORM_FIXED   ? 2
	       : a->form == WH_FORM_FLOAT ? 4
	       : a->form == WH_FORM_WHOLE ? wh_type_size(a->type)
	                                  : 8;
}

/* The value of a colour at its brightest: the greatest whole number of its type, or 1. */
double wh_type_white(wh_type type);

enum { WH_FIXED_ONE = 256 }; /* 1 in the fixed form */

/* The value in a record as a number; 64-bit labels lose digits. */
static inline double wh_attribute_get(const wh_attribute *a, const uint8_t *record)
{
	const uint8_t *at = record + a->at;
	uint16_t u;
	float f;
	double d;
	switch (a->form) {
	case WH_FORM_FIXED:
		memcpy(&u, at, sizeof u);
		return (a->type == WH_I8 ? (double)(int16_t)u : (double)u) / WH_FIXED_ONE;
	case WH_FORM_FLOAT:
		memcpy(&f, at, sizeof f);
		return (double)f;
	case WH_FORM_DOUBLE:
		memcpy(&d, at, sizeof d);
		return d;
	case WH_FORM_WHOLE:
		break;
	}
	return wh_load_real(at, a->type, false);
}

/* The value of a colour as a share of the brightest, in 0 .. 1: of whole numbers as rounded to
 * their type. */
double wh_attribute_share(const wh_attribute *a, const uint8_t *record);

/* Puts a value into a record, rounded and clamped to what the form holds. */
void wh_attribute_set(const wh_attribute *a, uint8_t *record, double v);

/* The same with a scalar of the file's type, every bit of it. */
void wh_attribute_load(const wh_attribute *a, const unsigned char *scalar, bool swap,
                       uint8_t *record);

/* The same with the word at s (io/number.h). Returns the word's end, NULL when it is no number. */
const char *wh_attribute_scan(const wh_attribute *a, const char *s, uint8_t *record);

/* The value as a scalar of the output's type, little-endian; rounded and clamped to it. Returns the
 * byte behind it. */
unsigned char *wh_attribute_store(const wh_attribute *a, const uint8_t *record, unsigned char *to);

/* The same in text, in fewer than WH_ATTRIBUTE_TEXT bytes. */
enum { WH_ATTRIBUTE_TEXT = 32 };
char *wh_attribute_print(const wh_attribute *a, const uint8_t *record, char *to);

#endif
