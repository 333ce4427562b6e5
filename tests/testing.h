/* testing: what all unit tests include before anything else of cmocka's, and small helpers. */
#ifndef WH_TESTS_TESTING_H
#define WH_TESTS_TESTING_H

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "base/mem.h"

/* A context with its own account: declare one per test, check with testing_done. */
typedef struct testing_env {
	wh_mem mem;
	wh_ctx ctx;
} testing_env;

static inline void testing_init(testing_env *t)
{
	*t = (testing_env){0};
	t->ctx.mem = &t->mem;
}

/* Fails the test when any block of the account was not freed, or not given back. */
static inline void testing_done(testing_env *t)
{
	assert_int_equal((size_t)t->mem.used, 0);
	assert_int_equal(t->mem.kept_bytes, 0);
}

#endif
