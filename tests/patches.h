/* patches: small ones, drawn by tests. */
#ifndef WH_TESTS_PATCHES_H
#define WH_TESTS_PATCHES_H

#include "testing.h"

#include "mesh/patch.h"

/* Room for a patch whose vertices are free and numbered from 0. */
static inline void patch_room(testing_env *t, wh_patch *p, uint32_t nv, uint32_t nf)
{
	assert_int_equal(wh_patch_reset(&t->ctx, p, nv, nf), WH_OK);
	for (uint32_t v = 0; v < nv; v++) {
		p->gid[v] = v;
		p->flag[v] = 0;
		p->err[v] = 0;
	}
}

#endif
