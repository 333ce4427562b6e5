#include "pipeline/quota.h"

wh_code wh_quota_note(wh_ctx *c, wh_quota_log *log, const wh_cost_log *full)
{
	uint32_t n = 0;
	for (uint32_t b = 0; b < WH_LOG_BINS; b++)
		n += full->collapses[b] != 0;
	*log = (wh_quota_log){.item = wh_alloc(c, n, sizeof *log->item)};
	if (!log->item)
		return c->err.code;
	for (uint32_t b = 0; b < WH_LOG_BINS; b++)
		if (full->collapses[b])
			log->item[log->n++] = (wh_quota_bin){b, full->collapses[b], full->faces[b]};
	return WH_OK;
}

/* A place in the common order: everything in bins below `bin`, and of that bin the clusters
 * below `cluster`; of that cluster, `left` more. */
typedef struct place {
	uint32_t bin, cluster;
	uint64_t left;
} place;

static const place END = {UINT32_MAX, UINT32_MAX, 0};

static uint64_t amount(const wh_quota_bin *b, bool faces)
{
	return faces ? b->faces : b->collapses;
}

/* The bin of one cluster's log; NULL when it is empty there. */
static const wh_quota_bin *find_bin(const wh_quota_log *log, uint32_t bin)
{
	uint32_t lo = 0, hi = log->n;
	while (lo < hi) {
		const uint32_t mid = lo + (hi - lo) / 2;
		if (log->item[mid].bin < bin)
			lo = mid + 1;
		else
			hi = mid;
	}
	return lo < log->n && log->item[lo].bin == bin ? &log->item[lo] : NULL;
}

/* Where the order is cut so that `wanted` faces or vertices lie before the cut. `sum`: room for
 * WH_LOG_BINS. */
static place find_place(const wh_quota_log *log, uint32_t clusters, uint64_t wanted, bool faces,
                        uint64_t *sum)
{
	for (uint32_t b = 0; b < WH_LOG_BINS; b++)
		sum[b] = 0;
	for (uint32_t k = 0; k < clusters; k++)
		for (uint32_t i = 0; i < log[k].n; i++)
			sum[log[k].item[i].bin] += amount(&log[k].item[i], faces);
	uint64_t left = wanted;
	for (uint32_t b = 0; b < WH_LOG_BINS; b++) {
		if (sum[b] < left) {
			left -= sum[b];
			continue;
		}
		for (uint32_t k = 0; k < clusters; k++) {
			const wh_quota_bin *item = find_bin(&log[k], b);
			const uint64_t here = item ? amount(item, faces) : 0;
			if (here >= left && here > 0)
				return (place){b, k, left};
			left -= here;
		}
	}
	return END;
}

static bool is_behind(uint32_t bin, uint32_t cluster, place cut)
{
	return bin != cut.bin ? bin > cut.bin : cluster > cut.cluster;
}

static bool is_cut(uint32_t bin, uint32_t cluster, place cut)
{
	return bin == cut.bin && cluster == cut.cluster;
}

/* What cluster k has before both cuts. Where the order is cut through its own run, one amount says
 * where, and the other is left at all of the bin. */
static wh_quota before_cuts(const wh_quota_log *log, uint32_t k, place faces, place vertices)
{
	wh_quota q = {0};
	for (uint32_t i = 0; i < log->n; i++) {
		const wh_quota_bin *b = &log->item[i];
		if (is_behind(b->bin, k, faces) || is_behind(b->bin, k, vertices))
			break;
		q.faces += is_cut(b->bin, k, faces) ? faces.left : b->faces;
		q.vertices += is_cut(b->bin, k, vertices) ? vertices.left : b->collapses;
	}
	return q;
}

wh_code wh_quota_share(wh_ctx *c, const wh_quota_log *log, uint32_t clusters, uint64_t faces,
                       uint64_t vertices, wh_quota *share, wh_quota *sum)
{
	uint64_t *bins = wh_alloc(c, WH_LOG_BINS, sizeof *bins);
	if (!bins)
		return c->err.code;
	const place by_faces = faces ? find_place(log, clusters, faces, true, bins) : END;
	const place by_vertices = vertices ? find_place(log, clusters, vertices, false, bins) : END;
	wh_free(c, bins);
	*sum = (wh_quota){0};
	for (uint32_t k = 0; k < clusters; k++) {
		share[k] = before_cuts(&log[k], k, by_faces, by_vertices);
		sum->faces += share[k].faces;
		sum->vertices += share[k].vertices;
	}
	return WH_OK;
}
