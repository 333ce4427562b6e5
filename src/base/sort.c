/*
 * Most significant byte first, every part in place (McIlroy, Bostic & McIlroy's American flag
 * sort): count how many numbers have each value of the byte, then swap each into its part, then
 * sort the parts by the next byte. Leading bytes that are the same in all numbers are skipped;
 * short parts are sorted by insertion.
 */
#include "base/sort.h"

enum { SHORT = 32, VALUES = 256 };

static void insertion(uint64_t *item, size_t n)
{
	for (size_t i = 1; i < n; i++) {
		const uint64_t x = item[i];
		size_t j = i;
		for (; j > 0 && item[j - 1] > x; j--)
			item[j] = item[j - 1];
		item[j] = x;
	}
}

static unsigned byte_of(uint64_t x, unsigned shift)
{
	return (unsigned)(x >> shift) & 0xff;
}

/* Shift of the highest byte in which the numbers differ; 0 when none does. `*sorted` tells whether
 * they ascend already. */
static unsigned highest_difference(const uint64_t *item, size_t n, int *sorted)
{
	uint64_t differ = 0;
	*sorted = 1;
	for (size_t i = 1; i < n; i++) {
		differ |= item[i] ^ item[0];
		*sorted &= item[i - 1] <= item[i];
	}
	unsigned shift = 0;
	while (differ >> shift > 0xff)
		shift += 8;
	return shift;
}

static void sort(uint64_t *item, size_t n)
{
	if (n <= SHORT) {
		insertion(item, n);
		return;
	}
	int sorted;
	const unsigned shift = highest_difference(item, n, &sorted);
	if (sorted)
		return;
	size_t next[VALUES] = {0}, end[VALUES];
	for (size_t i = 0; i < n; i++)
		next[byte_of(item[i], shift)]++;
	size_t sum = 0;
	for (unsigned b = 0; b < VALUES; b++) {
		const size_t count = next[b];
		next[b] = sum;
		sum += count;
		end[b] = sum;
	}
	for (unsigned b = 0; b < VALUES; b++)
		while (next[b] < end[b]) {
			uint64_t x = item[next[b]];
			for (unsigned to = byte_of(x, shift); to != b; to = byte_of(x, shift)) {
				const uint64_t other = item[next[to]];
				item[next[to]++] = x;
				x = other;
			}
			item[next[b]++] = x;
		}
	size_t first = 0;
	for (unsigned b = 0; shift > 0 && b < VALUES; b++) {
		sort(item + first, end[b] - first);
		first = end[b];
	}
}

size_t wh_sort_unique(uint64_t *item, size_t n)
{
	sort(item, n);
	size_t kept = n > 0;
	for (size_t i = 1; i < n; i++)
		if (item[i] != item[kept - 1])
			item[kept++] = item[i];
	return kept;
}
