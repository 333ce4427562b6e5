#include "pipeline/obj_corner.h"

#include "io/number.h"

/* The number at s; returns its end. */
static const char *scan_index(const char *s, wh_obj_index *i)
{
	*i = (wh_obj_index){.back = *s == '-'};
	s += i->back || *s == '+';
	for (; *s >= '0' && *s <= '9'; s++)
		i->n = i->n < UINT64_MAX / 16 ? 10 * i->n + (uint64_t)(*s - '0') : i->n;
	return s;
}

bool wh_obj_corner_scan(const char *s, wh_obj_corner *corner)
{
	corner->texcoord = corner->normal = (wh_obj_index){0};
	const char *end = scan_index(s, &corner->vertex);
	if (end == s || !(end[-1] >= '0' && end[-1] <= '9') || (*end != '/' && !wh_is_blank(*end)))
		return false;
	if (*end == '/')
		end = scan_index(end + 1, &corner->texcoord);
	if (*end == '/')
		(void)scan_index(end + 1, &corner->normal);
	return corner->vertex.n > 0 || !corner->vertex.back;
}

void wh_obj_habit_add(wh_obj_habit *h, const wh_obj_corner *corner, const wh_obj_corner *first,
                      uint64_t vertices, uint64_t normals)
{
	const wh_obj_index v = corner->vertex, n = corner->normal;
	if (n.n == 0) {
		h->bare = true;
		return;
	}
	h->used = true;
	h->varied |= n.n != first->normal.n || n.back != first->normal.back;
	if (v.back != n.back) {
		h->apart = true;
	} else if (!v.back) {
		h->apart |= v.n != n.n;
	} else {
		const int64_t more =
		    (int64_t)(vertices - v.n) - (int64_t)(normals - n.n); /* modulo 2^64 */
		h->apart |= h->counted && h->more != more;
		h->counted = true;
		h->more = more;
	}
}

void wh_obj_habit_join(wh_obj_habit *h, const wh_obj_habit *part, uint64_t vertices,
                       uint64_t normals)
{
	h->used |= part->used;
	h->bare |= part->bare;
	h->varied |= part->varied;
	h->apart |= part->apart || (part->counted && part->more != (int64_t)(normals - vertices));
}

wh_obj_normals wh_obj_habit_tells(const wh_obj_habit *h)
{
	if (!h->used)
		return WH_OBJ_NORMALS_UNUSED;
	if (!h->varied)
		return WH_OBJ_NORMALS_FLAT;
	return h->apart || h->bare ? WH_OBJ_NORMALS_OF_CORNERS : WH_OBJ_NORMALS_OF_VERTICES;
}
