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

/* ---- writing ---- */

/* What is written brings v back, in as many digits as it takes or fewer than "%.17g" has. */
static void assert_written(double v, bool is_double)
{
	char text[WH_NUMBER_TEXT + 1], all[64];
	char *end = wh_print_real(text, is_double, v);
	assert_true(end <= text + WH_NUMBER_TEXT);
	*end = '\0';
	(void)snprintf(all, sizeof all, "%.*g", is_double ? 17 : 9, v);
	const double back = is_double ? strtod(text, NULL) : (double)strtof(text, NULL);
	if (memcmp(&back, &v, sizeof v) != 0 || strlen(text) > strlen(all))
		fail_msg("%s was written as '%s'", all, text);
}

static void what_is_written_comes_back(void **state)
{
	(void)state;
	static const double odd[] = {0,
	                             -0.0,
	                             1,
	                             -1,
	                             0.1,
	                             9.9999999999999991,
	                             0.099999999999999992,
	                             99999.999999999985,
	                             1e15,
	                             123456789012345680,
	                             9007199254740994,
	                             9007199254740991,
	                             0.0001,
	                             0.00009999,
	                             5e-324,
	                             1.7976931348623157e308,
	                             0.30000000000000004,
	                             5000000.25};
	wh_rng r = wh_rng_seed(11);
	for (size_t i = 0; i < sizeof odd / sizeof odd[0]; i++) {
		assert_written(odd[i], true);
		if (fabs(odd[i]) <= (double)FLT_MAX)
			assert_written((double)(float)odd[i], false);
	}
	for (int i = 0; i < 100000; i++) {
		const uint64_t bits = wh_rng_next(&r);
		const uint32_t half = (uint32_t)bits;
		double v;
		float f;
		memcpy(&v, &bits, sizeof v);
		memcpy(&f, &half, sizeof f);
		if (i % 4) /* what coordinates look like */
			v = (wh_rng_unit(&r) - 0.5) * pow(10, i % 24 - 5);
		if (i % 4 == 3)
			v = rint(v * 1000) / 1000;
		if (i % 4)
			f = (float)v;
		if (isfinite(v))
			assert_written(v, true);
		if (isfinite(f))
			assert_written((double)f, false);
	}
}

static void few_digits_stay_few(void **state)
{
	(void)state;
	static const struct {
		double v;
		const char *text;
	} known[] = {{0.1, "0.1"},     {-12.5, "-12.5"},     {1000, "1000"}, {0.00025, "0.00025"},
	             {1e6, "1000000"}, {123.456, "123.456"}, {0, "0"},       {-7, "-7"}};
	for (size_t i = 0; i < sizeof known / sizeof known[0]; i++)
		for (int is_double = 0; is_double <= 1; is_double++) {
			char text[WH_NUMBER_TEXT + 1];
			*wh_print_real(text, is_double, known[i].v) = '\0';
			assert_string_equal(text, known[i].text);
		}
	char text[WH_NUMBER_TEXT + 1];
	*wh_print_whole(text, UINT64_MAX) = '\0';
	assert_string_equal(text, "18446744073709551615");
	*wh_print_whole(text, 0) = '\0';
	assert_string_equal(text, "0");
}

int main(void)
{
	const struct CMUnitTest tests[] = {
	    cmocka_unit_test(usual_and_unusual_notations_are_read),
	    cmocka_unit_test(random_doubles_come_back_exactly),
	    cmocka_unit_test(what_is_not_finite_is_recognised),
	    cmocka_unit_test(other_words_are_no_numbers),
	    cmocka_unit_test(whole_numbers_keep_to_their_range),
	    cmocka_unit_test(what_is_written_comes_back),
	    cmocka_unit_test(few_digits_stay_few),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
