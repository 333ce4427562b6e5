#define _GNU_SOURCE
#include "io/attributes.h"

#include "base/real.h"
#include "io/number.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <strings.h>

const char *wh_kind_name(wh_kind kind)
{
	static const char *const name[WH_KINDS] = {"colour", "normal", "texture", "scalar",
	                                           "label"};
	return name[kind];
}

/* ---- kinds -------------------------------------------------------------------------------- */

/* What names say, in lower case; the first rule that fits holds. */
typedef struct rule {
	const char *name;
	enum { WHOLE, BEGINS, ENDS, HAS } fits;
	wh_kind kind;
} rule;

static const rule rules[] = {
    {"red", WHOLE, WH_KIND_COLOUR},         {"green", WHOLE, WH_KIND_COLOUR},
    {"blue", WHOLE, WH_KIND_COLOUR},        {"alpha", WHOLE, WH_KIND_COLOUR},
    {"_red", ENDS, WH_KIND_COLOUR},         {"_green", ENDS, WH_KIND_COLOUR},
    {"_blue", ENDS, WH_KIND_COLOUR},        {"_alpha", ENDS, WH_KIND_COLOUR},
    {"r", WHOLE, WH_KIND_COLOUR},           {"g", WHOLE, WH_KIND_COLOUR},
    {"b", WHOLE, WH_KIND_COLOUR},           {"a", WHOLE, WH_KIND_COLOUR},
    {"nx", WHOLE, WH_KIND_NORMAL},          {"ny", WHOLE, WH_KIND_NORMAL},
    {"nz", WHOLE, WH_KIND_NORMAL},          {"normal_x", WHOLE, WH_KIND_NORMAL},
    {"normal_y", WHOLE, WH_KIND_NORMAL},    {"normal_z", WHOLE, WH_KIND_NORMAL},
    {"s", WHOLE, WH_KIND_TEXTURE},          {"t", WHOLE, WH_KIND_TEXTURE},
    {"u", WHOLE, WH_KIND_TEXTURE},          {"v", WHOLE, WH_KIND_TEXTURE},
    {"texture_", BEGINS, WH_KIND_TEXTURE},  {"label", HAS, WH_KIND_LABEL},
    {"classification", HAS, WH_KIND_LABEL}, {"class", WHOLE, WH_KIND_LABEL},
    {"class_id", WHOLE, WH_KIND_LABEL},     {"quality", HAS, WH_KIND_SCALAR},
    {"confidence", HAS, WH_KIND_SCALAR},    {"intensity", HAS, WH_KIND_SCALAR},
    {"reflectance", HAS, WH_KIND_SCALAR},   {"scalar_", BEGINS, WH_KIND_SCALAR},
};

static bool fits(const rule *r, const char *name)
{
	const size_t n = strlen(name), k = strlen(r->name);
	switch (r->fits) {
	case WHOLE:
		return strcasecmp(name, r->name) == 0;
	case BEGINS:
		return strncasecmp(name, r->name, k) == 0;
	case ENDS:
		return n > k && strcasecmp(name + n - k, r->name) == 0;
	case HAS:
		break;
	}
	return strcasestr(name, r->name) != NULL;
}

static wh_kind kind_of(const wh_ply_prop *q)
{
	const bool real = !wh_type_is_integer(q->type);
	const wh_kind otherwise = real ? WH_KIND_SCALAR : WH_KIND_LABEL;
	for (size_t i = 0; i < sizeof rules / sizeof *rules; i++) {
		if (!fits(&rules[i], q->name))
			continue;
		const wh_kind kind = rules[i].kind;
		/* whole numbers called nx or u are nobody's directions or coordinates */
		if (!real && (kind == WH_KIND_NORMAL || kind == WH_KIND_TEXTURE))
			return WH_KIND_SCALAR;
		return kind;
	}
	return otherwise;
}

static wh_form form_of(wh_type type, wh_kind kind)
{
	const uint32_t size = wh_type_size(type);
	if (!wh_type_is_integer(type))
		return size == 4 ? WH_FORM_FLOAT : WH_FORM_DOUBLE;
	if (kind == WH_KIND_LABEL)
		return WH_FORM_WHOLE;
	return size == 1 ? WH_FORM_FIXED : size == 2 ? WH_FORM_FLOAT : WH_FORM_DOUBLE;
}

/* ---- choice ------------------------------------------------------------------------------- */

/* One name of a list with commas, and its length; *list goes to the next one. */
static const char *next_name(const char **list, size_t *n)
{
	const char *name = *list;
	*n = strcspn(name, ",");
	*list = name + *n + (name[*n] == ',');
	return name;
}

static bool same(const char *a, const char *name, size_t n)
{
	return strlen(a) == n && memcmp(a, name, n) == 0;
}

/* The kinds that have a name of their own in such a list. */
enum { NAMED_KINDS = WH_KIND_TEXTURE + 1 };

static bool is_kind(const char *name, size_t n)
{
	for (int kind = 0; kind < NAMED_KINDS; kind++)
		if (same(wh_kind_name((wh_kind)kind), name, n))
			return true;
	return false;
}

/* Does this one name of the list mean a property? */
static bool means(const char *name, size_t n, const char *property, wh_kind kind)
{
	return same(property, name, n) || (is_kind(name, n) && same(wh_kind_name(kind), name, n));
}

static bool is_all(const char *wanted)
{
	return !wanted || strcmp(wanted, "all") == 0;
}

bool wh_attributes_names(const char *wanted, const char *property, wh_kind kind)
{
	if (is_all(wanted))
		return true;
	if (strcmp(wanted, "none") == 0)
		return false;
	while (*wanted) {
		size_t n;
		const char *name = next_name(&wanted, &n);
		if (means(name, n, property, kind))
			return true;
	}
	return false;
}

static bool is_wanted(const char *wanted, const wh_ply_prop *q)
{
	return wh_attributes_names(wanted, q->name, kind_of(q));
}

static bool is_position(const wh_ply *p, int elem, int prop)
{
	if (elem != p->vertex)
		return false;
	return prop == p->x || prop == p->y || prop == p->z;
}

/* Is there a property of this name that might be carried? The one list that is, of faces, is. */
static bool has_name(const wh_ply *p, int elem, const char *name, size_t n)
{
	const wh_ply_elem *e = &p->elems[elem];
	for (int i = 0; i < (int)e->nprops; i++) {
		const bool list = e->props[i].is_list &&
		                  (elem != p->face || wh_type_is_integer(e->props[i].type));
		if (!list && !is_position(p, elem, i) && same(e->props[i].name, name, n))
			return true;
	}
	return false;
}

/* Every name of the list is to mean something. */
static wh_code check_names(wh_ctx *c, const wh_ply *p, const char *wanted)
{
	if (is_all(wanted) || strcmp(wanted, "none") == 0)
		return WH_OK;
	while (*wanted) {
		size_t n;
		const char *name = next_name(&wanted, &n);
		if (!is_kind(name, n) && !has_name(p, p->vertex, name, n) &&
		    (p->face < 0 || !has_name(p, p->face, name, n)))
			return wh_fail(c, WH_E_USAGE,
			               "'%s' has no property '%.*s' that could be carried; "
			               "whittle info lists what it has",
			               p->path, n > 100 ? 100 : (int)n, name);
	}
	return WH_OK;
}

static uint32_t carried(const wh_ply *p, int elem, const char *wanted)
{
	const wh_ply_elem *e = &p->elems[elem];
	uint32_t n = 0;
	for (int i = 0; i < (int)e->nprops; i++)
		n += !e->props[i].is_list && !is_position(p, elem, i) &&
		     is_wanted(wanted, &e->props[i]);
	return n;
}

/* Puts an attribute behind the others. */
static void append(wh_attributes *a, const wh_attribute *item)
{
	wh_attribute *to = &a->item[a->n++];
	*to = *item;
	to->at = a->bytes;
	a->bytes += wh_attribute_bytes(to);
	a->file_bytes += wh_type_size(to->out);
}

/* Colours that no header declares are bytes to all who read PLY. */
static wh_type out_of(const wh_ply *p, wh_type type, wh_kind kind)
{
	const bool text = p->kind == WH_FORMAT_OBJ || p->kind == WH_FORMAT_OFF;
	return text && kind == WH_KIND_COLOUR ? WH_U8 : type;
}

static void add(wh_attributes *a, const wh_ply *p, const wh_ply_prop *q, int prop, uint32_t file_at)
{
	const wh_kind kind = kind_of(q);
	append(a, &(wh_attribute){.name = q->name,
	                          .type = q->type,
	                          .out = out_of(p, q->type, kind),
	                          .kind = kind,
	                          .form = form_of(q->type, kind),
	                          .prop = prop,
	                          .file_at = file_at});
}

/* The first attribute of a kind whose name ends so. */
static bool find_part(const wh_attributes *a, wh_kind kind, const char *ending, uint32_t *at)
{
	const size_t k = strlen(ending);
	for (*at = 0; *at < a->n; ++*at) {
		const wh_attribute *item = &a->item[*at];
		const size_t n = strlen(item->name);
		if (item->kind == kind && n >= k && strcasecmp(item->name + n - k, ending) == 0)
			return true;
	}
	return false;
}

static bool find_parts(const wh_attributes *a, wh_kind kind, const char *const ending[3],
                       uint32_t at[3])
{
	return find_part(a, kind, ending[0], &at[0]) && find_part(a, kind, ending[1], &at[1]) &&
	       find_part(a, kind, ending[2], &at[2]);
}

void wh_attributes_group(wh_attributes *a)
{
	static const char *const axes[] = {"x", "y", "z"},
	                         *const words[] = {"red", "green", "blue"},
	                         *const letters[] = {"r", "g", "b"};
	a->has_normal = find_parts(a, WH_KIND_NORMAL, axes, a->normal);
	a->has_rgb = find_parts(a, WH_KIND_COLOUR, words, a->rgb) ||
	             find_parts(a, WH_KIND_COLOUR, letters, a->rgb);
	a->has_alpha = a->has_rgb && (find_part(a, WH_KIND_COLOUR, "alpha", &a->alpha) ||
	                              find_part(a, WH_KIND_COLOUR, "a", &a->alpha));
	a->has_texture = (find_part(a, WH_KIND_TEXTURE, "s", &a->texture[0]) &&
	                  find_part(a, WH_KIND_TEXTURE, "t", &a->texture[1])) ||
	                 (find_part(a, WH_KIND_TEXTURE, "u", &a->texture[0]) &&
	                  find_part(a, WH_KIND_TEXTURE, "v", &a->texture[1]));
}

static bool is_among(uint32_t k, const uint32_t *at, int n)
{
	while (n > 0)
		if (at[--n] == k)
			return true;
	return false;
}

/* Is attribute k of a group that there is room for? */
static bool is_held(const wh_attributes *a, uint32_t k, uint32_t holds)
{
	return ((holds & WH_HOLDS_COLOUR) && a->has_rgb && is_among(k, a->rgb, 3)) ||
	       ((holds & WH_HOLDS_ALPHA) && a->has_alpha && k == a->alpha) ||
	       ((holds & WH_HOLDS_NORMAL) && a->has_normal && is_among(k, a->normal, 3)) ||
	       ((holds & WH_HOLDS_TEXTURE) && a->has_texture && is_among(k, a->texture, 2));
}

/* Leaves out what there is no room for; what is left keeps its order, but not its place among the
 * positions, which PLY alone has. */
static void keep_held(wh_attributes *a, uint32_t holds)
{
	const wh_attributes all = *a;
	*a = (wh_attributes){.item = all.item};
	for (uint32_t k = 0; k < all.n; k++)
		if (is_held(&all, k, holds)) {
			const wh_attribute item = all.item[k];
			append(a, &item);
		}
	wh_attributes_group(a);
}

wh_code wh_attributes_choose(wh_ctx *c, const wh_ply *p, wh_wanted wanted, wh_attributes *a)
{
	*a = (wh_attributes){0};
	if (check_names(c, p, wanted.names) != WH_OK)
		return c->err.code;
	return wh_attributes_choose_of(c, p, p->vertex, wanted, a);
}

wh_code wh_attributes_choose_of(wh_ctx *c, const wh_ply *p, int elem, wh_wanted wanted,
                                wh_attributes *a)
{
	const wh_ply_elem *e = &p->elems[elem];
	const uint32_t n = carried(p, elem, wanted.names);
	*a = (wh_attributes){0};
	if (n > WH_MOST_ATTRIBUTES && wanted.holds == WH_HOLDS_ALL)
		return wh_fail(c, WH_E_USAGE,
		               "'%s' has %" PRIu32
		               " %s properties, of which %d can be carried: name those that "
		               "matter with --attributes",
		               p->path, n, elem == p->vertex ? "vertex" : "face",
		               WH_MOST_ATTRIBUTES);
	if (n == 0 || wanted.holds == 0)
		return WH_OK;
	a->item = wh_alloc(c, n, sizeof *a->item);
	if (!a->item)
		return c->err.code;
	a->rank[0] = p->x;
	a->rank[1] = p->y;
	a->rank[2] = p->z;
	uint32_t file_at = 0;
	for (int i = 0; i < (int)e->nprops; i++) {
		const wh_ply_prop *q = &e->props[i];
		if (is_position(p, elem, i))
			a->before[i == p->x ? 0 : i == p->y ? 1 : 2] = a->n;
		else if (!q->is_list && is_wanted(wanted.names, q))
			add(a, p, q, i, file_at);
		file_at += wh_type_size(q->type);
	}
	wh_attributes_group(a);
	if (wanted.holds != WH_HOLDS_ALL)
		keep_held(a, wanted.holds);
	return WH_OK;
}

static bool is_of_corners(const wh_attributes *a, uint32_t k)
{
	return is_among(k, a->texture, 2) || (a->has_normal && is_among(k, a->normal, 3));
}

wh_code wh_attributes_part(wh_ctx *c, const wh_attributes *a, bool of_corners, wh_attributes *part)
{
	*part = (wh_attributes){.item = wh_alloc(c, a->n, sizeof *a->item)};
	if (!part->item)
		return wh_failed(c);
	for (uint32_t k = 0; of_corners && k < 2; k++)
		append(part, &a->item[a->texture[k]]);
	for (uint32_t k = 0; of_corners && a->has_normal && k < 3; k++)
		append(part, &a->item[a->normal[k]]);
	for (uint32_t k = 0; !of_corners && k < a->n; k++)
		if (!is_of_corners(a, k))
			append(part, &a->item[k]);
	wh_attributes_group(part);
	return WH_OK;
}

wh_code wh_attributes_both(wh_ctx *c, const wh_attributes *a, const wh_attributes *b, bool texture,
                           wh_attributes *both)
{
	*both = (wh_attributes){.item = wh_alloc(c, (size_t)a->n + b->n, sizeof *a->item)};
	if (!both->item)
		return wh_failed(c);
	for (uint32_t k = 0; k < a->n; k++)
		append(both, &a->item[k]);
	for (uint32_t k = 0; k < b->n; k++)
		if (texture || b->item[k].kind != WH_KIND_TEXTURE)
			append(both, &b->item[k]);
	wh_attributes_group(both);
	return WH_OK;
}

void wh_attributes_free(wh_ctx *c, wh_attributes *a)
{
	wh_free(c, a->item);
	*a = (wh_attributes){0};
}

/* The weight of a value whose kind as a whole weighs w: white differs from black in three colours,
 * and in all of what their type holds. */
static double weight_of(const wh_attribute *a, double w)
{
	return a->kind == WH_KIND_COLOUR ? w / sqrt(3) / wh_type_white(a->type) : w;
}

/* One NAME=W of n bytes. */
static wh_code weigh_one(wh_ctx *c, const char *path, const char *text, size_t n, wh_attributes *a)
{
	char word[32] = {0}; /* wh_scan_real wants a blank behind it */
	const char *equals = memchr(text, '=', n);
	const size_t name = equals ? (size_t)(equals - text) : n;
	const size_t digits = equals ? n - name - 1 : 0;
	double w = -1;
	if (digits > 0 && digits < sizeof word - 1) {
		memcpy(word, equals + 1, digits);
		word[digits] = ' ';
		if (wh_scan_real(word, &w) != word + digits)
			w = -1;
	}
	if (!(w >= 0) || !isfinite(w))
		return wh_fail(c, WH_E_USAGE,
		               "weight '%.*s': give a property and a number from 0 on, such as "
		               "colour=0.5",
		               n > 100 ? 100 : (int)n, text);
	bool found = false;
	for (uint32_t i = 0; i < a->n; i++) {
		wh_attribute *item = &a->item[i];
		if (!same(item->name, text, name) &&
		    !(is_kind(text, name) && same(wh_kind_name(item->kind), text, name)))
			continue;
		found = true;
		item->weight = weight_of(item, w);
	}
	if (!found)
		return wh_fail(
		    c, WH_E_USAGE,
		    "weight '%.*s': '%s' has no such vertex property, or it is not carried, or "
		    "belongs to corners, as those of textures do",
		    n > 100 ? 100 : (int)n, text, path);
	return WH_OK;
}

wh_code wh_attributes_weigh(wh_ctx *c, const char *path, const char *weights, wh_attributes *a)
{
	while (weights && *weights) {
		size_t n;
		const char *one = next_name(&weights, &n);
		if (weigh_one(c, path, one, n, a) != WH_OK)
			return c->err.code;
	}
	for (uint32_t i = 0; i < a->n; i++)
		a->weighted = a->weighted || a->item[i].weight > 0;
	return WH_OK;
}

const wh_attribute *wh_attributes_find(const wh_attributes *a, int prop)
{
	uint32_t lo = 0, hi = a ? a->n : 0;
	while (lo < hi) { /* they ascend */
		const uint32_t mid = lo + (hi - lo) / 2;
		if (a->item[mid].prop == prop)
			return &a->item[mid];
		if (a->item[mid].prop < prop)
			lo = mid + 1;
		else
			hi = mid;
	}
	return NULL;
}

/* ---- values ------------------------------------------------------------------------------- */

static double clamp(double v, double lo, double hi)
{
	return v < lo ? lo : v > hi ? hi : v;
}

/* The least and the greatest value of a whole type. */
static void range_of(wh_type type, double *lo, double *hi)
{
	const int bits = 8 * (int)wh_type_size(type) - wh_type_is_signed(type);
	*hi = ldexp(1, bits) - 1; /* of 64 bits: rounded up */
	*lo = wh_type_is_signed(type) ? -ldexp(1, bits) : 0;
}

double wh_type_white(wh_type type)
{
	double lo, hi;
	if (!wh_type_is_integer(type))
		return 1;
	range_of(type, &lo, &hi);
	return hi;
}

/* The nearest whole number of the type, as its bits. */
static uint64_t whole(wh_type type, double v)
{
	double lo, hi;
	range_of(type, &lo, &hi);
	const double r = v > lo ? clamp(rint(v), lo, hi) : isnan(v) ? 0 : lo;
	if (type == WH_U64)
		return r >= 0x1p64 ? UINT64_MAX : (uint64_t)r;
	return r >= 0x1p63 ? INT64_MAX : (uint64_t)(int64_t)r;
}

/* The lowest bytes of v, little-endian. */
static void store_low(unsigned char *to, uint64_t v, uint32_t size)
{
	for (uint32_t i = 0; i < size; i++)
		to[i] = (unsigned char)(v >> 8 * i);
}

/* The same in the byte order of the machine. */
static void keep_low(uint8_t *to, uint64_t v, uint32_t size)
{
	const uint8_t b = (uint8_t)v;
	const uint16_t h = (uint16_t)v;
	const uint32_t w = (uint32_t)v;
	memcpy(to,
	       size == 1   ? (const void *)&b
	       : size == 2 ? &h
	       : size == 4 ? &w
	                   : (void *)&v,
	       size);
}

void wh_attribute_set(const wh_attribute *a, uint8_t *record, double v)
{
	uint8_t *at = record + a->at;
	double lo, hi;
	float f;
	switch (a->form) {
	case WH_FORM_FIXED:
		range_of(a->type, &lo, &hi);
		keep_low(
		    at, (uint64_t)(int64_t)rint(clamp(isnan(v) ? 0 : v, lo, hi) * WH_FIXED_ONE), 2);
		break;
	case WH_FORM_FLOAT:
		f = (float)v;
		memcpy(at, &f, sizeof f);
		break;
	case WH_FORM_DOUBLE:
		memcpy(at, &v, sizeof v);
		break;
	case WH_FORM_WHOLE:
		keep_low(at, whole(a->type, v), wh_type_size(a->type));
	}
}

void wh_attribute_load(const wh_attribute *a, const unsigned char *scalar, bool swap,
                       uint8_t *record)
{
	uint8_t *at = record + a->at;
	if (a->form == WH_FORM_WHOLE) {
		keep_low(at, wh_load_integer(scalar, a->type, swap), wh_type_size(a->type));
	} else if (a->type == WH_F32) { /* as bits: a number that is none keeps its own */
		const uint32_t bits = wh_load32(scalar, swap);
		memcpy(at, &bits, sizeof bits);
	} else if (a->type == WH_F64) {
		const uint64_t bits = wh_load64(scalar, swap);
		memcpy(at, &bits, sizeof bits);
	} else {
		wh_attribute_set(a, record, wh_load_real(scalar, a->type, swap));
	}
}

const char *wh_attribute_scan(const wh_attribute *a, const char *s, uint8_t *record)
{
	double v;
	uint64_t n;
	if (a->form == WH_FORM_WHOLE && wh_type_size(a->type) == 8) { /* no double holds them all */
		const char *end = wh_scan_whole(s, &n);
		if (end) {
			keep_low(record + a->at, n, 8);
			return end;
		}
	}
	const char *end = wh_scan_real(s, &v);
	if (end)
		wh_attribute_set(a, record, v);
	return end;
}

/* Bits of the value as a whole number of the output's type. */
static uint64_t whole_of(const wh_attribute *a, const uint8_t *record)
{
	if (a->form == WH_FORM_WHOLE)
		return wh_load_integer(record + a->at, a->type, false);
	const double v = wh_attribute_get(a, record);
	return whole(a->out,
	             a->out == a->type ? v : v * wh_type_white(a->out) / wh_type_white(a->type));
}

double wh_attribute_share(const wh_attribute *a, const uint8_t *record)
{
	const double v = wh_attribute_get(a, record), white = wh_type_white(a->type);
	if (!(v > 0))
		return 0;
	return v >= white ? 1 : (wh_type_is_integer(a->type) ? rint(v) : v) / white;
}

unsigned char *wh_attribute_store(const wh_attribute *a, const uint8_t *record, unsigned char *to)
{
	const uint32_t size = wh_type_size(a->out);
	if (a->out == WH_F32)
		store_low(to, wh_load32(record + a->at, false), size);
	else if (a->out == WH_F64)
		store_low(to, wh_load64(record + a->at, false), size);
	else
		store_low(to, whole_of(a, record), size);
	return to + size;
}

char *wh_attribute_print(const wh_attribute *a, const uint8_t *record, char *to)
{
	if (!wh_type_is_integer(a->out))
		return wh_print_real(to, a->out == WH_F64, wh_attribute_get(a, record));
	const uint64_t v = whole_of(a, record);
	if (wh_type_is_signed(a->out) && (int64_t)v < 0) {
		*to++ = '-';
		return wh_print_whole(to, 0 - v);
	}
	return wh_print_whole(to, v);
}
