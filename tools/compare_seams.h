/* compare_seams: what a comparison says of the band along the cuts, as a table or as JSON. */
#ifndef WH_TOOLS_COMPARE_SEAMS_H
#define WH_TOOLS_COMPARE_SEAMS_H

#include "algo/compare.h"

#include <jansson.h>

/* `reference` is the same comparison of a result that was never cut; NULL when there is none. */
void compare_seams_print(const wh_compare *r, const wh_compare *reference);
json_t *compare_seams_json(const wh_compare *r, const wh_compare *reference);

#endif
