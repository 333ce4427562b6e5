/* ply_value: one scalar of a binary PLY body, of any type, as a number. */
#ifndef WH_IO_PLY_VALUE_H
#define WH_IO_PLY_VALUE_H

#include "base/bytes.h"
#include "io/ply.h"

static inline bool wh_type_is_integer(wh_type t)
{
	return t < WH_F32;
}

/* Is the type's all-ones pattern -1? (else it is the greatest value) */
static inline bool wh_type_is_signed(wh_type t)
{
	return t == WH_I8 || t == WH_I16 || t == WH_I32 || t == WH_I64;
}

/* More digits than a float holds: coordinates of this type are kept as doubles. */
static inline bool wh_type_is_wide(wh_type t)
{
	return t == WH_F64 || (t >= WH_I32 && t <= WH_U64);
}

/* An integer scalar. Negative values come out as 2^64 - |v|: greater than any count or index
 * that a file can hold, so that one unsigned comparison refuses them. */
static inline uint64_t wh_load_integer(const unsigned char *p, wh_type t, bool swap)
{
	switch (t) {
	case WH_I8:
		return (uint64_t)(int64_t)(int8_t)p[0];
	case WH_U8:
		return p[0];
	case WH_I16:
		return (uint64_t)(int64_t)(int16_t)wh_load16(p, swap);
	case WH_U16:
		return wh_load16(p, swap);
	case WH_I32:
		return (uint64_t)(int64_t)(int32_t)wh_load32(p, swap);
	case WH_U32:
		return wh_load32(p, swap);
	case WH_I64:
	case WH_U64:
		return wh_load64(p, swap);
	case WH_F32:
	case WH_F64:
		break;
	}
	return UINT64_MAX; /* the header parser lets no real type get here */
}

static inline double wh_load_real(const unsigned char *p, wh_type t, bool swap)
{
	if (t == WH_F32)
		return (double)wh_loadf(p, swap);
	if (t == WH_F64)
		return wh_loadd(p, swap);
	const uint64_t v = wh_load_integer(p, t, swap);
	return wh_type_is_signed(t) ? (double)(int64_t)v : (double)v;
}

#endif
