#include "base/status.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>

static wh_code record(wh_ctx *c, wh_code code, const char *fmt, va_list ap)
{
	if (c->err.code == WH_OK) {
		c->err.code = code;
		(void)vsnprintf(c->err.text, sizeof c->err.text, fmt, ap);
	}
	return c->err.code;
}

wh_code wh_fail(wh_ctx *c, wh_code code, const char *fmt, ...)
{
	va_list ap;
	va_start(ap, fmt);
	code = record(c, code, fmt, ap);
	va_end(ap);
	return code;
}

wh_code wh_fail_errno(wh_ctx *c, const char *fmt, ...)
{
	const int saved = errno;
	if (c->err.code != WH_OK)
		return c->err.code;
	va_list ap;
	va_start(ap, fmt);
	(void)record(c, WH_E_RUN, fmt, ap);
	va_end(ap);
	const size_t used = strlen(c->err.text);
	(void)snprintf(c->err.text + used, sizeof c->err.text - used, ": %s", strerror(saved));
	return c->err.code;
}

wh_ctx wh_ctx_fork(const wh_ctx *c)
{
	return (wh_ctx){.mem = c->mem, .cancel = c->cancel};
}

wh_code wh_poll(wh_ctx *c)
{
	if (c->cancel && __atomic_load_n(c->cancel, __ATOMIC_RELAXED))
		return wh_fail(c, WH_E_INTERRUPT, "interrupted");
	return WH_OK;
}
