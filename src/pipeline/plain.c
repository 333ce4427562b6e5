#include "pipeline/plain.h"

#include <string.h>

void wh_plain_lay_out(wh_source *to, const wh_source *from, uint64_t nv,
                      const wh_attributes *attributes, const wh_wedges *wedges, int fd)
{
	const wh_type type = from->is_double ? WH_F64 : WH_F32;
	*to = (wh_source){.path = from->path,
	                  .nv = nv,
	                  .vfd = fd,
	                  .vstride = 3 * wh_type_size(type),
	                  .is_double = from->is_double,
	                  .attributes = attributes,
	                  .afd = fd,
	                  .wedges = wedges,
	                  .ffd = fd,
	                  .count_off = -1,
	                  .itype = nv > UINT32_MAX ? WH_U64 : WH_U32};
	for (uint32_t i = 0; i < 3; i++) {
		to->vtype[i] = type;
		to->voff[i] = i * wh_type_size(type);
	}
	to->abase = nv * to->vstride;
	to->fbase = to->abase + nv * (attributes ? attributes->bytes : 0);
	to->fstride = 3 * wh_type_size(to->itype) + (wedges ? wedges->bytes : 0);
}

void wh_plain_put_position(const wh_source *s, unsigned char *at, const double xyz[3])
{
	const float narrow[3] = {(float)xyz[0], (float)xyz[1], (float)xyz[2]};
	if (s->is_double)
		memcpy(at, xyz, 3 * sizeof *xyz);
	else
		memcpy(at, narrow, sizeof narrow);
}

void wh_plain_put_face(const wh_source *s, unsigned char *at, const uint64_t corner[3],
                       const void *carried)
{
	const uint32_t narrow[3] = {(uint32_t)corner[0], (uint32_t)corner[1], (uint32_t)corner[2]};
	const size_t corners = 3 * (size_t)wh_type_size(s->itype);
	if (s->itype == WH_U32)
		memcpy(at, narrow, sizeof narrow);
	else
		memcpy(at, corner, 3 * sizeof *corner);
	if (s->wedges)
		memcpy(at + corners, carried, s->wedges->bytes);
}
