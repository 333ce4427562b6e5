/* compare_json: the figures of a comparison, for tables and as JSON. */
#ifndef WH_TOOLS_COMPARE_JSON_H
#define WH_TOOLS_COMPARE_JSON_H

#include "algo/compare.h"

#include <jansson.h>

/* One figure of a distance. */
typedef struct compare_row {
	const char *key;
	const char *text;
	size_t offset; /* of a double in wh_distance */
} compare_row;

enum { COMPARE_ROWS = 6 };
extern const compare_row compare_rows[COMPARE_ROWS];

double compare_value(const wh_distance *d, const compare_row *w);

/* In millionths of the diagonal; 0 when there is none. */
double compare_millionths(double x, double diagonal);

/* What compare_json_fill and, where there were seams, compare_seams_json wrote, but for the
 * regions. False when it is not that. */
bool compare_json_read(const json_t *j, wh_compare *r);

/* Adds all but the zones along seams to an object. Nonzero: out of memory. */
int compare_json_fill(json_t *j, const wh_compare *r);

#endif
