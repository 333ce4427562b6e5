/*
 * compare_band: the faces of a surface along a line of points.
 *
 * Internal to compare.
 */
#ifndef WH_ALGO_COMPARE_BAND_H
#define WH_ALGO_COMPARE_BAND_H

#include "algo/compare.h"

/* Bytes of a band's bits, and of all that marking it takes beside readers. */
size_t wh_band_bytes(const wh_bvh *t);
size_t wh_band_work_bytes(const wh_bvh *t, const wh_exec *ex);

/*
 * Marks the faces of the finished surface that are nearest to one of the params' cuts, or no more
 * than WH_BAND_RINGS steps from one that is, from face to face over a shared vertex. `band` has a
 * bit for each face of a page, 64 bytes a page. `reader`: one a worker, with boxes. The result does
 * not depend on ex.
 */
wh_code wh_compare_band(wh_ctx *c, const wh_exec *ex, wh_bvh_reader *reader,
                        const wh_compare_params *p, uint8_t *band);

static inline bool wh_band_has(const uint8_t *band, uint32_t page, uint32_t face)
{
	const uint64_t i = (uint64_t)page * WH_PAGE_FACES + face;
	return band[i / 8] >> i % 8 & 1;
}

#endif
