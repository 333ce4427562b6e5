/*
 * The splits of a progressive mesh, coarse to fine, into a file.
 *
 * Vertices and faces get their numbers for good: those of the base its own, those of the splits in
 * their order. Then the mesh is refined as whoever reads the file will do it, with lists of corners
 * in the same order, and every split is told by what cannot be known from the mesh before it.
 *
 * Cost: linear in the faces around the vertices that are split, but for the matching of the base's
 * faces, which are sorted.
 */
#include "algo/progressive.h"

#include <math.h>
#include <stdlib.h>

enum { TURN = 3, TURN_BITS = 2, NAME_BITS = 32 };

typedef struct writer {
	const wh_progressive_run *run;
	const wh_progressive_order *order;
	uint32_t *number; /* of each vertex */
	uint32_t *face;   /* number of each face, times 4, and how far its corners are turned */
	uint8_t *moves;   /* a bit for each corner */
	wh_corners at;    /* in these numbers */
	uint32_t nv, nf;  /* so far */
	wh_pmesh_block block;
	float error, cost; /* of the split before */
} writer;

size_t wh_progressive_bytes(uint64_t nv, uint64_t nf, uint32_t attr_bytes)
{
	/* pos, step, moved, rank, head, number; tri, tri, next, face, bits */
	const size_t vertex = sizeof(wh_vec3) + sizeof(wh_progressive_step) + sizeof(uint64_t) +
	                      6 * sizeof(uint32_t) + 2 * (size_t)attr_bytes,
	             face = 12 + 12 + 12 + 4 + 1;
	return (size_t)nv * vertex + (size_t)nf * face + ((size_t)4 << 20);
}

/* ---- numbers ------------------------------------------------------------------------------ */

static wh_code differs(wh_ctx *c)
{
	return wh_fail(c, WH_E_RUN,
	               "the collapses of the run do not lead to its result: the record "
	               "of them in the temporary folder is damaged");
}

/* The step that split j undoes. */
static uint32_t step_of(const writer *w, uint32_t j)
{
	return (uint32_t)w->order->rank[w->run->steps - 1 - j];
}

static wh_code number_vertices(wh_ctx *c, writer *w)
{
	const wh_progressive_run *run = w->run;
	for (uint32_t v = 0; v < run->nv; v++)
		w->number[v] = WH_NONE;
	for (uint32_t v = 0; v < run->base->nv; v++) {
		if (run->base->gid[v] >= run->nv)
			return differs(c);
		w->number[run->base->gid[v]] = v;
	}
	for (uint32_t j = 0; j < run->steps; j++)
		w->number[run->step[step_of(w, j)].u] = run->base->nv + j;
	return WH_OK;
}

/* A face, turned so that its least vertex comes first. */
typedef struct turned {
	uint32_t at[3];
	uint32_t id, turn; /* the place of that vertex */
} turned;

static turned turn(const uint32_t t[3], uint32_t id)
{
	const uint32_t k = t[0] < t[1] ? (t[0] < t[2] ? 0 : 2) : t[1] < t[2] ? 1 : 2;
	return (turned){{t[k], t[(k + 1) % TURN], t[(k + 2) % TURN]}, id, k};
}

static int compare_turned(const void *a, const void *b)
{
	const turned *x = a, *y = b;
	for (int k = 0; k < 3; k++)
		if (x->at[k] != y->at[k])
			return x->at[k] < y->at[k] ? -1 : 1;
	return (x->id > y->id) - (x->id < y->id);
}

/* Lists the faces that are left, with the base's vertices; false when there are more. */
static bool list_left(const writer *w, turned *left)
{
	const wh_progressive_run *run = w->run;
	uint32_t n = 0;
	for (uint32_t f = 0; f < run->nf; f++) {
		if (wh_progressive_is_dead(w->order, f))
			continue;
		const uint32_t *t = &run->tri[3 * (size_t)f];
		const uint32_t of[3] = {w->number[t[0]], w->number[t[1]], w->number[t[2]]};
		if (n == run->base->nf)
			return false;
		left[n++] = turn(of, f);
	}
	return n == run->base->nf;
}

/* Each face that is left is the base's with the same corners. */
static wh_code match_faces(wh_ctx *c, writer *w, turned *left, turned *base)
{
	const uint32_t n = w->run->base->nf;
	if (!list_left(w, left))
		return differs(c);
	for (uint32_t f = 0; f < n; f++)
		base[f] = turn(&w->run->base->tri[3 * (size_t)f], f);
	qsort(left, n, sizeof *left, compare_turned);
	qsort(base, n, sizeof *base, compare_turned);
	for (uint32_t i = 0; i < n; i++) {
		if (memcmp(left[i].at, base[i].at, sizeof left[i].at) != 0)
			return differs(c);
		w->face[left[i].id] =
		    base[i].id << TURN_BITS | (base[i].turn + TURN - left[i].turn) % TURN;
	}
	return WH_OK;
}

static wh_code number_faces(wh_ctx *c, writer *w)
{
	const uint32_t n = w->run->base->nf;
	turned *both = wh_alloc(c, 2 * (size_t)n, sizeof *both);
	const wh_code code = both ? match_faces(c, w, both, both + n) : wh_failed(c);
	wh_free(c, both);
	return code;
}

static uint32_t corner_number(const writer *w, uint32_t c)
{
	const uint32_t face = w->face[c / 3];
	return 3 * (face >> TURN_BITS) + (c % 3 + (face & 3)) % TURN;
}

/* ---- a split ------------------------------------------------------------------------------ */

/* One split on its way out. */
typedef struct split {
	const wh_progressive_step *s;
	uint32_t v, u;
	uint32_t corner[WH_PMESH_MOVED]; /* that become u's, in the order of v's list */
	uint32_t n;
	/* new faces: the step's, with their third corner, and whether they are u v a, not v u a */
	uint32_t gone[2], apex[2];
	bool uv[2];
} split;

static void put_bit(writer *w, bool bit)
{
	wh_bits_put(&w->block.fans, bit, 1);
}

/* Finds the corners that become u's in v's list, and tells of each whether it does. */
static void tell_short(writer *w, split *p)
{
	for (uint32_t c = w->at.head[p->v]; c != WH_NONE; c = w->at.next[c]) {
		const bool moves = w->moves[c >> 3] >> (c & 7) & 1;
		put_bit(w, moves);
		if (moves)
			p->corner[p->n++] = c;
	}
}

static void tell_long(writer *w, split *p, uint32_t count)
{
	uint32_t stay = 0;
	wh_bits_put_code(&w->block.fans, count, 0);
	for (uint32_t c = w->at.head[p->v]; p->n < count && c != WH_NONE; c = w->at.next[c]) {
		if (!(w->moves[c >> 3] >> (c & 7) & 1)) {
			stay++;
			continue;
		}
		wh_bits_put_code(&w->block.fans, stay, 0);
		stay = 0;
		p->corner[p->n++] = c;
	}
}

static bool is_short(const wh_corners *t, uint32_t v)
{
	uint32_t n = 0;
	for (uint32_t c = t->head[v]; c != WH_NONE && n <= WH_PMESH_SHORT; c = t->next[c])
		n++;
	return n <= WH_PMESH_SHORT;
}

static wh_code tell_corners(wh_ctx *c, writer *w, split *p)
{
	const uint32_t *moved = &w->order->moved[p->s->first], n = p->s[1].first - p->s->first;
	if (wh_bits_reserve(c, &w->block.fans, (WH_PMESH_MOVED + 2) * (uint64_t)WH_BITS_MOST) !=
	    WH_OK)
		return c->err.code;
	for (uint32_t i = 0; i < n; i++) {
		const uint32_t k = corner_number(w, moved[i]);
		w->moves[k >> 3] |= (uint8_t)(1U << (k & 7));
	}
	if (is_short(&w->at, p->v))
		tell_short(w, p);
	else
		tell_long(w, p, n);
	for (uint32_t i = 0; i < n; i++)
		w->moves[corner_number(w, moved[i]) >> 3] = 0;
	return p->n == n ? WH_OK : differs(c);
}

/* The faces that the split makes, as the collapse left them. */
static void find_faces(const writer *w, split *p)
{
	for (uint32_t i = 0; i < p->s->ngone; i++) {
		const uint32_t *t = &w->run->tri[3 * (size_t)p->s->gone[i]];
		const uint32_t k = t[0] == p->s->u ? 0 : t[1] == p->s->u ? 1 : 2;
		p->gone[i] = p->s->gone[i];
		p->uv[i] = t[(k + 1) % TURN] == p->s->v;
		p->apex[i] = w->number[t[(k + (p->uv[i] ? 2 : 1)) % TURN]];
	}
}

static void swap_faces(split *p)
{
	const split q = *p;
	for (int i = 0; i < 2; i++) {
		p->gone[i] = q.gone[1 - i];
		p->apex[i] = q.apex[1 - i];
		p->uv[i] = q.uv[1 - i];
	}
}

static bool is_first(const split *p, uint32_t i, wh_path path)
{
	return p->uv[i] && p->apex[i] == path.from;
}

static bool is_second(const split *p, uint32_t i, wh_path path)
{
	return !p->uv[i] && p->apex[i] == path.to;
}

/* How the new faces follow from the path of those that become u's. */
static uint32_t way_of(split *p, wh_path path)
{
	const uint32_t n = p->s->ngone;
	if (n == 2 && is_second(p, 0, path) && is_first(p, 1, path))
		swap_faces(p);
	if (n == 2 && is_first(p, 0, path) && is_second(p, 1, path))
		return WH_PMESH_BOTH;
	if (n == 1 && is_first(p, 0, path))
		return WH_PMESH_FIRST;
	if (n == 1 && is_second(p, 0, path))
		return WH_PMESH_SECOND;
	return WH_PMESH_NAMED + n;
}

static void make_faces(writer *w, const split *p, uint32_t way)
{
	for (uint32_t i = 0; i < p->s->ngone; i++) {
		const uint32_t a = p->uv[i] ? p->u : p->v, b = p->uv[i] ? p->v : p->u;
		const uint32_t *t = &w->run->tri[3 * (size_t)p->gone[i]];
		const uint32_t first = p->uv[i] ? p->s->u : p->s->v;
		const uint32_t k = t[0] == first ? 0 : t[1] == first ? 1 : 2;
		if (way >= WH_PMESH_NAMED) {
			put_bit(w, p->uv[i]);
			wh_bits_put(&w->block.fans, p->apex[i], NAME_BITS);
		}
		w->face[p->gone[i]] = w->nf << TURN_BITS | (TURN - k) % TURN;
		wh_corners_face(&w->at, w->nf++, a, b, p->apex[i]);
	}
}

/* One coordinate of v and u, from where v was. */
static void tell_coordinate(const writer *w, uint32_t axis, double was, double v, double u)
{
	const wh_pmesh_block *b = &w->block;
	const uint32_t bytes = w->run->coord_bytes;
	const uint64_t from = wh_pmesh_ordered(was, bytes), to = wh_pmesh_ordered(v, bytes);
	wh_pmesh_column(b, WH_PMESH_PLACE + axis)[b->n] = wh_pmesh_difference(from, to, bytes);
	wh_pmesh_column(b, WH_PMESH_PLACE + 3 + axis)[b->n] =
	    wh_pmesh_difference(from - (to - from), wh_pmesh_ordered(u, bytes), bytes);
}

static void tell_places(const writer *w, const wh_progressive_step *s)
{
	wh_vec3 *v = &w->run->pos[s->v];
	const wh_vec3 *u = &w->run->pos[s->u];
	tell_coordinate(w, 0, v->x, s->at.x, u->x);
	tell_coordinate(w, 1, v->y, s->at.y, u->y);
	tell_coordinate(w, 2, v->z, s->at.z, u->z);
	*v = s->at;
}

static void tell_properties(const writer *w, uint32_t i)
{
	const wh_progressive_run *run = w->run;
	const wh_attributes *a = run->attributes;
	const wh_progressive_step *s = &run->step[i];
	const wh_pmesh_block *b = &w->block;
	const size_t n = run->attr_bytes;
	uint8_t *v = run->attr + s->v * n, *u = run->attr + s->u * n,
	        *fine = run->step_attr + i * n;
	for (uint32_t k = 0; a && k < a->n; k++) {
		const wh_attribute *item = &a->item[k];
		const uint32_t bytes = wh_attribute_bytes(item), column = WH_PMESH_FIXED + 2 * k;
		const uint64_t from = wh_pmesh_property(item, v);
		wh_pmesh_column(b, column)[b->n] =
		    wh_pmesh_difference(from, wh_pmesh_property(item, fine), bytes);
		wh_pmesh_column(b, column + 1)[b->n] =
		    wh_pmesh_difference(from, wh_pmesh_property(item, u), bytes);
	}
	if (n)
		memcpy(v, fine, n);
}

static void tell_falling(const wh_pmesh_block *b, uint32_t column, float *last, float now)
{
	wh_pmesh_column(b, column)[b->n] =
	    wh_pmesh_ordered((double)*last, 4) - wh_pmesh_ordered((double)now, 4);
	*last = now;
}

static wh_code tell_split(wh_ctx *c, writer *w, uint32_t j)
{
	const uint32_t i = step_of(w, j);
	const wh_progressive_step *s = &w->run->step[i];
	wh_pmesh_block *b = &w->block;
	split p = {.s = s, .v = w->number[s->v], .u = w->nv};
	if (p.v >= w->nv)
		return differs(c);
	if (tell_corners(c, w, &p) != WH_OK)
		return c->err.code;
	find_faces(w, &p);
	const uint32_t way = way_of(&p, wh_corners_path(&w->at, p.corner, p.n));
	wh_corners_move(&w->at, p.v, p.u, p.corner, p.n);
	make_faces(w, &p, way);
	w->nv++;
	wh_pmesh_column(b, WH_PMESH_V)[b->n] = p.v;
	wh_pmesh_column(b, WH_PMESH_WAY)[b->n] = way;
	tell_places(w, s);
	tell_properties(w, i);
	tell_falling(b, WH_PMESH_ERROR, &w->error, s->err);
	tell_falling(b, WH_PMESH_COST, &w->cost, s->cost);
	b->n++;
	return WH_OK;
}

/* ---- all of it ---------------------------------------------------------------------------- */

/* What a level's error is: the worst so far, in the order of the collapses. */
static void accumulate_errors(const writer *w)
{
	float worst = 0;
	for (uint32_t j = w->run->steps; j-- > 0;) {
		wh_progressive_step *s = &w->run->step[step_of(w, j)];
		s->err = worst = fmaxf(worst, s->err);
	}
}

static wh_code write_splits(wh_ctx *c, writer *w, wh_outfile *o)
{
	const uint32_t n = w->run->steps;
	for (uint32_t j = 0; j < n; j++) {
		if (tell_split(c, w, j) != WH_OK)
			return c->err.code;
		if (w->block.n < WH_PMESH_BLOCK && j + 1 < n)
			continue;
		const wh_pmesh_part part = {.faces = w->nf, .error = w->error, .cost = w->cost};
		if (wh_poll(c) != WH_OK || wh_pmesh_write_block(c, o, &w->block, &part) != WH_OK)
			return c->err.code;
	}
	return WH_OK;
}

/* Positions and attributes of the base. */
static wh_code write_base(wh_ctx *c, const writer *w, wh_outfile *o)
{
	const wh_progressive_run *run = w->run;
	const wh_patch *p = run->base;
	const wh_progressive_step *last = run->steps ? &run->step[step_of(w, 0)] : NULL;
	const wh_pmesh_head h = {.coord_bytes = run->coord_bytes,
	                         .base_vertices = p->nv,
	                         .base_faces = p->nf,
	                         .splits = run->steps,
	                         .faces = run->nf,
	                         .input_bytes = run->input_bytes,
	                         .error = last ? last->err : 0,
	                         .cost = last ? last->cost : 0,
	                         .diagonal = run->diagonal};
	wh_vec3 *pos = wh_alloc(c, p->nv, sizeof *pos);
	if (!pos)
		return wh_failed(c);
	for (uint32_t v = 0; v < p->nv; v++)
		pos[v] = run->pos[p->gid[v]];
	const wh_pmesh_base base = {&pos->x, p->attr, p->tri};
	const wh_code code = wh_pmesh_write_base(c, o, &h, run->attributes, &base);
	wh_free(c, pos);
	return code;
}

static wh_code make_room(wh_ctx *c, writer *w)
{
	const wh_progressive_run *run = w->run;
	w->number = wh_alloc(c, run->nv, sizeof *w->number);
	w->face = wh_alloc(c, run->nf, sizeof *w->face);
	w->moves = wh_calloc(c, 3 * (size_t)run->nf / 8 + 1, 1);
	w->at.tri = wh_alloc(c, 3 * (size_t)run->nf, sizeof *w->at.tri);
	if (!w->number || !w->face || !w->moves || !w->at.tri)
		return wh_failed(c);
	return wh_pmesh_block_make(c, &w->block, run->attributes ? run->attributes->n : 0);
}

/* The lists of the reduced mesh are not needed any more: their room is that of the new ones. */
static void begin(writer *w)
{
	const wh_patch *p = w->run->base;
	w->at.next = w->order->at.next;
	w->at.head = w->order->at.head;
	w->nv = p->nv;
	w->nf = p->nf;
	memcpy(w->at.tri, p->tri, 3 * (size_t)p->nf * sizeof *p->tri);
	wh_corners_fill(&w->at, p->nv, p->nf);
	accumulate_errors(w);
	if (w->run->steps) {
		w->error = w->run->step[step_of(w, 0)].err;
		w->cost = w->run->step[step_of(w, 0)].cost;
	}
}

static wh_code write_all(wh_ctx *c, writer *w, wh_outfile *o)
{
	if (make_room(c, w) != WH_OK || number_vertices(c, w) != WH_OK ||
	    number_faces(c, w) != WH_OK)
		return c->err.code;
	begin(w);
	return write_base(c, w, o) == WH_OK ? write_splits(c, w, o) : c->err.code;
}

wh_code wh_progressive_write(wh_ctx *c, wh_outfile *o, const wh_progressive_run *run)
{
	wh_progressive_order order;
	writer w = {.run = run, .order = &order};
	wh_code code = wh_progressive_sort(c, run, &order);
	if (code == WH_OK)
		code = write_all(c, &w, o);
	wh_free(c, w.number);
	wh_free(c, w.face);
	wh_free(c, w.moves);
	wh_free(c, w.at.tri);
	wh_pmesh_block_free(c, &w.block);
	wh_progressive_order_free(c, &order);
	return code;
}
