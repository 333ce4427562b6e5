/* Numbers in text come out as the nearest double, whatever way they are written. */
#include "testing.h"

#include "base/rng.h"
#include "io/number.h"

#include <float.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static void assert_real(const char *text)
{
	char padded[512];
	double v = 0;
	(void)snprintf(padded, sizeof padded, "%s ", text);
	const char *end = wh_scan_real(padded, &v);
	const double want = strtod(text, NULL);
	if (end != padded + strlen(text) || memcmp(&v, &want, sizeof v) != 0)
		fail_msg("'%s' gave %.17g, not %.17g", text, v, want);
}

static void usual_and_unusual_notations_are_read(void **state)
{
	(void)state;
	static const char *const texts[] = {"0",
	                                    "-0",
	                                    "+1",
	                                    "1.",
	                                    ".5",
	                                    "-.5e1",
	                                    "00012.500",
	                                    "1e22",
	                                    "1e23",
	                                    "1e-22",
	                                    "1e-23",
	                                    "9007199254740993",
	                                    "9007199254740992",
	                                    "123456789012345678901234567890",
	                                    "18446744073709551616",
	                                    "0.000000000000000000000000000001",
	                                    "1.7976931348623157e308",
	                                    "5e-324",
	                                    "2.2250738585072011e-308",
	                                    "1E+05",
	                                    "0e999999999999",
	                                    "1e-999999999999",
	                                    "0.1",
	                                    "0.30000000000000004",
	                                    "3.4028235e38",
	                                    "8.5899344e9"};
	for (size_t i = 0; i < sizeof texts / sizeof texts[0]; i++)
		assert_real(texts[i]);
}

static void random_doubles_come_back_exactly(void **state)
{
	(void)state;
	static const char *const formats[] = {"%.17g", "%.9g", "%.6f", "%.3e", "%.25g"};
	wh_rng r = wh_rng_seed(7);
	for (int i = 0; i < 200000; i++) {
		const uint64_t bits = wh_rng_next(&r);
		double v;
		memcpy(&v, &bits, sizeof v);
		if (i % 2)
			v = (wh_rng_unit(&r) - 0.5) * pow(10, i % 12);
		char text[400];
		if (!isfinite(v))
			continue;
		(void)snprintf(text, sizeof text, formats[i % 5], v);
		assert_real(text);
	}
}

static void what_is_not_finite_is_recognised(void **state)
{
	(void)state;
	static const char *const texts[] = {"nan ",      "-nan ",     "NaN ",    "inf ",
	                                    "-Inf ",     "infinity ", "1.#INF ", "-1.#IND ",
	                                    "1.#QNAN0 ", "nan(0x1) "};
	for (size_t i = 0; i < sizeof texts / sizeof texts[0]; i++) {
		double v = 0;
		assert_ptr_equal(wh_scan_real(texts[i], &v), texts[i] + strlen(texts[i]) - 1);
		assert_true(!isfinite(v));
	}
}

static void other_words_are_no_numbers(void **state)
{
	(void)state;
	static const char *const texts[] = {"x ",    "- ",    ". ",          "1e ",  "1e+ ",
	                                    "1,5 ",  "0x10 ", "1.2.3 ",      "--1 ", "e5 ",
	                                    "1.5f ", "\n",    "information "};
	for (size_t i = 0; i < sizeof texts / sizeof texts[0]; i++) {
		double v = 0;
		if (wh_scan_real(texts[i], &v))
			fail_msg("'%s' was read as %g", texts[i], v);
	}
}

static void whole_numbers_keep_to_their_range(void **state)
{
	(void)state;
	uint64_t v;
	assert_non_null(wh_scan_whole("18446744073709551615 ", &v));
	assert_true(v == UINT64_MAX);
	assert_null(wh_scan_whole("18446744073709551616 ", &v));
	assert_null(wh_scan_whole("99999999999999999999 ", &v));
	assert_non_null(wh_scan_whole("-1 ", &v));
	assert_true(v == UINT64_MAX);
	assert_null(wh_scan_whole("-9999999999999999999 ", &v));
	assert_null(wh_scan_whole("1.0 ", &v));
	assert_null(wh_scan_whole("- ", &v));
	assert_null(wh_scan_whole("\n", &v));
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	    cmocka_unit_test(usual_and_unusual_notations_are_read),
	    cmocka_unit_test(random_doubles_come_back_exactly),
	    cmocka_unit_test(what_is_not_finite_is_recognised),
	    cmocka_unit_test(other_words_are_no_numbers),
	    cmocka_unit_test(whole_numbers_keep_to_their_range),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
