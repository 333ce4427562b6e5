/*
 * format: the mesh formats whittle knows, by name, by file name and by content.
 *
 * Thread-safe; nothing here reads a file.
 */
#ifndef WH_IO_FORMAT_H
#define WH_IO_FORMAT_H

#include "base/status.h"

typedef enum wh_format {
	WH_FORMAT_ANY, /* not said: to be found out */
	WH_FORMAT_PLY,
	WH_FORMAT_OBJ, /* Wavefront */
	WH_FORMAT_OFF, /* Geomview, with the kinds that have colours, normals and the like */
	WH_FORMAT_STL, /* text and binary */
	WH_FORMAT_GLB  /* glTF 2.0 in one binary file; only written */
} wh_format;

/* How a file is compressed. */
typedef enum wh_packing { WH_PACKING_NONE, WH_PACKING_GZIP, WH_PACKING_ZSTD } wh_packing;

/* "ply", "obj", ...; "any" for WH_FORMAT_ANY. */
const char *wh_format_name(wh_format f);
/* The format of that name, in small letters or capitals. False: there is none. */
bool wh_format_parse(const char *name, wh_format *f);

/* By the last part of a file's name, where ".gz" and ".zst" do not count. */
wh_format wh_format_of_name(const char *path);
wh_packing wh_packing_of_name(const char *path);

/*
 * How an output is written: as `to` says ("obj", or "ply.gz"), or, where it is NULL, as the name
 * of the file ends; as PLY where that has no ending (one without a letter is none), or is NULL.
 * WH_E_USAGE: there is no such format.
 */
wh_code wh_format_of_output(wh_ctx *c, const char *to, const char *path, wh_format *f,
                            wh_packing *packing);

/* For outputs of one kind, whose ending ("png") is given: WH_E_USAGE when the name has another. */
wh_code wh_format_only(wh_ctx *c, const char *path, const char *ending);

/* By the first n bytes of a file of `size` bytes. WH_FORMAT_ANY: they do not tell. */
wh_format wh_format_of_bytes(const char *head, size_t n, uint64_t size);
wh_packing wh_packing_of_bytes(const char *head, size_t n);

/* True when the bytes are the beginning of a binary STL file of that size, whatever its header
 * says: then the size follows from the count behind the header. */
bool wh_format_is_binary_stl(const char *head, size_t n, uint64_t size);

enum { WH_STL_HEADER = 80, WH_STL_BODY = 84, WH_STL_FACET = 50 }; /* bytes of binary STL */

/* The byte that ends the lines of a text that begins so: LF, or CR where there is no LF. */
char wh_format_eol(const char *head, size_t n);

#endif
