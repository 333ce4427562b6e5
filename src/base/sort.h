/* sort: numbers into ascending order, in place. */
#ifndef WH_BASE_SORT_H
#define WH_BASE_SORT_H

#include <stddef.h>
#include <stdint.h>

/* Sorts and leaves each number once, at the front. Returns how many there are. Takes time in
 * proportion to n times the bytes in which the numbers differ, and no memory. */
size_t wh_sort_unique(uint64_t *item, size_t n);

#endif
