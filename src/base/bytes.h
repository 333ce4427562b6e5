/* bytes: explicit little- and big-endian loads and stores on unaligned memory. */
#ifndef WH_BASE_BYTES_H
#define WH_BASE_BYTES_H

#include <stdbool.h>
#include <stdint.h>
#include <string.h>

#if __BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__
#define WH_HOST_BIG 0
#else
#define WH_HOST_BIG 1
#endif

/* `swap` is true when the data's byte order is not the host's. */
static inline uint16_t wh_load16(const void *p, bool swap)
{
	uint16_t v;
	memcpy(&v, p, sizeof v);
	return swap ? __builtin_bswap16(v) : v;
}

static inline uint32_t wh_load32(const void *p, bool swap)
{
	uint32_t v;
	memcpy(&v, p, sizeof v);
	return swap ? __builtin_bswap32(v) : v;
}

static inline uint64_t wh_load64(const void *p, bool swap)
{
	uint64_t v;
	memcpy(&v, p, sizeof v);
	return swap ? __builtin_bswap64(v) : v;
}

static inline float wh_loadf(const void *p, bool swap)
{
	const uint32_t u = wh_load32(p, swap);
	float v;
	memcpy(&v, &u, sizeof v);
	return v;
}

static inline double wh_loadd(const void *p, bool swap)
{
	const uint64_t u = wh_load64(p, swap);
	double v;
	memcpy(&v, &u, sizeof v);
	return v;
}

/* The four bytes of v, the lowest one first; returns what is behind them. */
static inline unsigned char *wh_put32(unsigned char *to, uint32_t v)
{
	v = wh_load32(&v, WH_HOST_BIG);
	memcpy(to, &v, sizeof v);
	return to + sizeof v;
}

#endif
