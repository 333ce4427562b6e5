/*
 * off: the header of OFF files (Geomview), text and binary, described in PLY's words.
 *
 * Kinds with normals (N), colours (C) and texture coordinates (ST) are known; behind the position
 * of a vertex they stand in that order, colours as three or four numbers. How many there really
 * are, the line of the first vertex tells. What else is on a line of a text is passed over.
 */
#ifndef WH_IO_OFF_H
#define WH_IO_OFF_H

#include "io/ply.h"

/* Parses the header of the open file. WH_E_INPUT for one that is damaged, for the kinds of other
 * dimensions, and for counts that the file's size cannot hold. On failure the caller closes *p. */
wh_code wh_off_read_header(wh_ctx *c, wh_ply *p);

#endif
