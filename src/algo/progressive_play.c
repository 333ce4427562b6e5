/*
 * Playing a progressive mesh: vertex splits and edge collapses.
 *
 * A split that has been read is known in full: the corners that it turns to the new vertex, and
 * what its old one is on the other side. So to go on is to turn corners and to exchange positions,
 * and so is to go back; neither looks at the lists of corners, which stay as they are after the
 * last split that is known. Only to read the next one the mesh has to be there.
 *
 * Invariants: what a level's arrays hold is a function of the level alone; behind its last vertex
 * and face they hold what the splits will make there.
 *
 * Cost: a split turns four corners on the average; some 130 bytes a vertex. Time goes by the memory
 * that is waited for: see below.
 */
#include "algo/progressive.h"

#include <math.h>

/* ---- room --------------------------------------------------------------------------------- */

enum { MOVED_EACH = 5 /* corners turned a split, with something to spare */ };

size_t wh_progressive_play_bytes(const wh_pmesh *file, uint64_t level)
{
	const wh_pmesh_head *h = &file->head;
	const size_t attr = file->attributes.bytes,
	             columns = WH_PMESH_FIXED + 2 * file->attributes.n;
	const uint64_t blocks = (level + WH_PMESH_BLOCK - 1) / WH_PMESH_BLOCK;
	const uint64_t splits =
	    blocks * WH_PMESH_BLOCK < h->splits ? blocks * WH_PMESH_BLOCK : h->splits;
	const uint64_t faces = blocks ? file->part[blocks - 1].faces : h->base_faces;
	const size_t split =
	    sizeof(wh_vec3) + attr + 4 * sizeof(uint32_t) + 1 + MOVED_EACH * sizeof(uint32_t);
	const size_t vertex = sizeof(wh_vec3) + attr + 4;
	return (size_t)(h->base_vertices + splits) * vertex + (size_t)splits * split +
	       (size_t)faces * 24 + columns * WH_PMESH_BLOCK * 8 + ((size_t)2 << 20);
}

/* Makes an array longer, its contents kept. Splits come upon all of it in no order. */
static wh_code lengthen(wh_ctx *c, void *array_ptr, uint64_t n, size_t size)
{
	void *old, *grown;
	memcpy(&old, array_ptr, sizeof old);
	grown = wh_resize(c, old, (size_t)n, size);
	if (!grown)
		return wh_failed(c);
	wh_mem_scattered(grown);
	memcpy(array_ptr, &grown, sizeof grown);
	return WH_OK;
}

/* Arrays for so many splits, all those of their blocks. */
static wh_code make_room(wh_ctx *c, wh_progressive *p, uint64_t level)
{
	const wh_pmesh_head *h = &p->file.head;
	const uint64_t blocks = (level + WH_PMESH_BLOCK - 1) / WH_PMESH_BLOCK;
	const uint64_t n =
	    blocks * WH_PMESH_BLOCK < h->splits ? blocks * WH_PMESH_BLOCK : h->splits;
	const uint64_t nv = h->base_vertices + n,
	               nf = blocks ? p->file.part[blocks - 1].faces : h->base_faces;
	const size_t attr = p->file.attributes.bytes;
	if (p->pos && n <= p->room)
		return WH_OK;
	if (lengthen(c, &p->pos, nv, sizeof *p->pos) != WH_OK ||
	    lengthen(c, &p->at.head, nv, sizeof *p->at.head) != WH_OK ||
	    lengthen(c, &p->at.tri, 3 * nf, sizeof *p->at.tri) != WH_OK ||
	    lengthen(c, &p->at.next, 3 * nf, sizeof *p->at.next) != WH_OK ||
	    lengthen(c, &p->v, n, sizeof *p->v) != WH_OK ||
	    lengthen(c, &p->first, n + 1, sizeof *p->first) != WH_OK ||
	    lengthen(c, &p->faces, n, sizeof *p->faces) != WH_OK ||
	    lengthen(c, &p->other, n, sizeof *p->other) != WH_OK ||
	    lengthen(c, &p->error, n, sizeof *p->error) != WH_OK ||
	    lengthen(c, &p->cost, n, sizeof *p->cost) != WH_OK ||
	    (attr && lengthen(c, &p->attr, nv, attr) != WH_OK) ||
	    (attr && lengthen(c, &p->other_attr, n, attr) != WH_OK) ||
	    wh_reserve(c, &p->moved, &p->cap_moved, (size_t)n * MOVED_EACH, sizeof *p->moved) !=
	        WH_OK)
		return c->err.code;
	p->room = (uint32_t)n;
	return WH_OK;
}

/* ---- there and back ----------------------------------------------------------------------- */

/* v's position and attributes, on one side of split j and on the other. */
static void exchange(const wh_progressive *p, uint32_t j)
{
	const size_t n = p->file.attributes.bytes;
	wh_vec3 *at = &p->pos[p->v[j]];
	const wh_vec3 was = *at;
	*at = p->other[j];
	p->other[j] = was;
	uint8_t *a = p->attr + p->v[j] * n, *b = p->other_attr + j * n;
	for (size_t i = 0; i < n; i++) {
		const uint8_t byte = a[i];
		a[i] = b[i];
		b[i] = byte;
	}
}

static void turn_corners(const wh_progressive *p, uint32_t j, uint32_t to)
{
	for (uint32_t i = p->first[j]; i < p->first[j + 1]; i++)
		p->at.tri[p->moved[i]] = to;
}

/* Split `level`. */
static void go_on(wh_progressive *p)
{
	const uint32_t j = p->level++;
	turn_corners(p, j, p->nv++);
	p->nf += p->faces[j];
	exchange(p, j);
}

/* The collapse that it came from. */
static void go_back(wh_progressive *p)
{
	const uint32_t j = --p->level;
	turn_corners(p, j, p->v[j]);
	p->nv--;
	p->nf -= p->faces[j];
	exchange(p, j);
}

/* ---- reading a split ---------------------------------------------------------------------- */

/* What is read at the moment: split `at` of block `block`. */
typedef struct reading {
	wh_ctx *c;
	wh_progressive *p;
	uint64_t block;
	uint32_t at;
	uint64_t most_faces; /* after the block */
	float error, cost;   /* of the split before */
} reading;

static wh_code nonsense(const reading *r, const char *what)
{
	return wh_pmesh_damaged(r->c, &r->p->file, r->block, what);
}

static uint64_t number(const reading *r, uint32_t column)
{
	return wh_pmesh_column(&r->p->block, column)[r->at];
}

/* The first corners of v's list, no more than one above those of a short one. */
static uint32_t list_short(const wh_corners *t, uint32_t v, uint32_t list[WH_PMESH_SHORT + 1])
{
	uint32_t n = 0;
	for (uint32_t c = t->head[v]; c != WH_NONE && n <= WH_PMESH_SHORT; c = t->next[c])
		list[n++] = c;
	return n;
}

static uint32_t take_short(const reading *r, const uint32_t *list, uint32_t n, uint32_t *moved)
{
	const uint64_t bits = wh_bits_get(&r->p->block.fan, n);
	uint32_t m = 0;
	for (uint32_t i = 0; i < n; i++) {
		moved[m] = list[i];
		m += (uint32_t)(bits >> i & 1);
	}
	return m;
}

static wh_code take_long(const reading *r, uint32_t v, uint32_t *moved, uint32_t *m)
{
	const wh_corners *t = &r->p->at;
	wh_bits_in *in = &r->p->block.fan;
	const uint64_t count = wh_bits_get_code(in, 0);
	uint32_t c = t->head[v];
	if (count > WH_PMESH_MOVED)
		return nonsense(r, "a split turns too many corners");
	for (*m = 0; *m < count && in->n <= in->end; c = t->next[c]) {
		for (uint64_t stay = wh_bits_get_code(in, 0); stay > 0 && c != WH_NONE; stay--)
			c = t->next[c];
		if (c == WH_NONE)
			break;
		moved[(*m)++] = c;
	}
	return *m == count ? WH_OK : nonsense(r, "a split turns corners that are not there");
}

/* The corners that become u's, into the room behind those that are known; none of u's own. */
static wh_code take_corners(const reading *r, uint32_t v, uint32_t *m)
{
	wh_progressive *p = r->p;
	const uint32_t at = p->first[p->known];
	uint32_t list[WH_PMESH_SHORT + 1];
	if (wh_reserve(r->c, &p->moved, &p->cap_moved, (size_t)at + WH_PMESH_MOVED + 1,
	               sizeof *p->moved) != WH_OK)
		return r->c->err.code;
	const uint32_t n = list_short(&p->at, v, list);
	if (n > WH_PMESH_SHORT)
		return take_long(r, v, &p->moved[at], m);
	*m = take_short(r, list, n, &p->moved[at]);
	return WH_OK;
}

static wh_code add_face(const reading *r, bool uv, uint32_t u, uint32_t v, uint32_t a)
{
	wh_progressive *p = r->p;
	if (a >= p->nv || p->nf >= r->most_faces)
		return nonsense(r, "a split makes a face that cannot be");
	wh_corners_face(&p->at, p->nf++, uv ? u : v, uv ? v : u, a);
	return WH_OK;
}

static wh_code add_named(const reading *r, uint32_t count, uint32_t u, uint32_t v)
{
	wh_bits_in *in = &r->p->block.fan;
	for (uint32_t i = 0; i < count && in->n <= in->end; i++) {
		const bool uv = wh_bits_get(in, 1);
		if (add_face(r, uv, u, v, (uint32_t)wh_bits_get(in, 32)) != WH_OK)
			return r->c->err.code;
	}
	return WH_OK;
}

static wh_code add_faces(const reading *r, uint32_t way, uint32_t u, uint32_t v, wh_path path)
{
	if (way >= WH_PMESH_NAMED)
		return add_named(r, wh_pmesh_new_faces(way), u, v);
	if (way != WH_PMESH_SECOND && add_face(r, true, u, v, path.from) != WH_OK)
		return r->c->err.code;
	if (way != WH_PMESH_FIRST && add_face(r, false, u, v, path.to) != WH_OK)
		return r->c->err.code;
	return WH_OK;
}

/* One coordinate of v, which is at *from, and of u: where they are then. */
static void take_coordinate(const reading *r, uint32_t axis, double from, double *v, double *u)
{
	const uint32_t bytes = r->p->file.head.coord_bytes;
	const uint64_t was = wh_pmesh_ordered(from, bytes);
	const uint64_t to = wh_pmesh_add(was, number(r, WH_PMESH_PLACE + axis), bytes);
	*v = wh_pmesh_real(to, bytes);
	*u = wh_pmesh_real(
	    wh_pmesh_add(was - (to - was), number(r, WH_PMESH_PLACE + 3 + axis), bytes), bytes);
}

static void take_places(const reading *r, uint32_t v, uint32_t u)
{
	wh_progressive *p = r->p;
	wh_vec3 *at = &p->pos[v], *to = &p->other[p->known], *new = &p->pos[u];
	const wh_vec3 was = *at;
	take_coordinate(r, 0, was.x, &at->x, &new->x);
	take_coordinate(r, 1, was.y, &at->y, &new->y);
	take_coordinate(r, 2, was.z, &at->z, &new->z);
	*to = was;
}

static void take_properties(const reading *r, uint32_t v, uint32_t u)
{
	wh_progressive *p = r->p;
	const wh_attributes *a = &p->file.attributes;
	const size_t n = a->bytes;
	uint8_t *at = p->attr + v * n, *new = p->attr + u *n;
	if (n)
		memcpy(p->other_attr + p->known * n, at, n);
	for (uint32_t k = 0; k < a->n; k++) {
		const wh_attribute *item = &a->item[k];
		const uint32_t bytes = wh_attribute_bytes(item), column = WH_PMESH_FIXED + 2 * k;
		const uint64_t was = wh_pmesh_property(item, at);
		wh_pmesh_set_property(item, at, wh_pmesh_add(was, number(r, column), bytes));
		wh_pmesh_set_property(item, new, wh_pmesh_add(was, number(r, column + 1), bytes));
	}
}

/* A figure that falls by as much. */
static float fall(float from, uint64_t by)
{
	return (float)wh_pmesh_real(wh_pmesh_ordered((double)from, 4) - by, 4);
}

static wh_code read_split(reading *r)
{
	wh_progressive *p = r->p;
	const uint32_t u = p->nv, j = p->known, before = p->nf;
	const uint64_t v = number(r, WH_PMESH_V), way = number(r, WH_PMESH_WAY);
	uint32_t m = 0;
	if (v >= u || way >= WH_PMESH_WAYS)
		return nonsense(r, "a split has no such vertex");
	if (take_corners(r, (uint32_t)v, &m) != WH_OK)
		return r->c->err.code;
	const uint32_t *moved = &p->moved[p->first[j]];
	const wh_path path = wh_corners_path(&p->at, moved, m);
	wh_corners_move(&p->at, (uint32_t)v, u, moved, m);
	if (add_faces(r, (uint32_t)way, u, (uint32_t)v, path) != WH_OK)
		return r->c->err.code;
	take_places(r, (uint32_t)v, u);
	take_properties(r, (uint32_t)v, u);
	p->error[j] = r->error = fall(r->error, number(r, WH_PMESH_ERROR));
	p->cost[j] = r->cost = fall(r->cost, number(r, WH_PMESH_COST));
	p->v[j] = (uint32_t)v;
	p->faces[j] = (uint8_t)(p->nf - before);
	p->first[j + 1] = p->first[j] + m;
	p->nv++;
	p->level = ++p->known;
	return WH_OK;
}

/* ---- what is needed soon ------------------------------------------------------------------ */

/*
 * Splits come upon the mesh in no order, so each corner of a list is far from the one before it,
 * and reading would wait for memory most of the time. Which vertices come is known for a whole
 * block: the lists of the next ones are walked ahead of time, all of them side by side and one step
 * a split. What was read there may have changed by then, which costs time and nothing else: reading
 * takes 0.3 of the time.
 */
enum { SCOUTS = 12 };

typedef struct scouts {
	uint32_t corner[SCOUTS]; /* where each is; WH_NONE: at the end */
} scouts;

/* The vertex of the block's split i, if it is there already. */
static uint32_t vertex_ahead(const reading *r, uint32_t i)
{
	const uint64_t v = i < r->p->block.n ? wh_pmesh_column(&r->p->block, WH_PMESH_V)[i] : 0;
	return v < r->p->nv ? (uint32_t)v : 0;
}

static void expect_corner(const wh_corners *t, uint32_t corner)
{
	__builtin_prefetch(&t->next[corner]);
	__builtin_prefetch(&t->tri[corner]);
}

/* Before split r->at. */
static void look_ahead(const reading *r, scouts *s)
{
	const wh_progressive *p = r->p;
	const wh_corners *t = &p->at;
	__builtin_prefetch(&t->head[vertex_ahead(r, r->at + 2 * SCOUTS)]);
	__builtin_prefetch(&p->pos[vertex_ahead(r, r->at + SCOUTS)]);
	for (uint32_t i = 0; i < SCOUTS; i++) {
		if (s->corner[i] == WH_NONE)
			continue;
		/* of the neighbours two get new corners */
		__builtin_prefetch(&t->head[t->tri[wh_corner_after(s->corner[i])]]);
		s->corner[i] = t->next[s->corner[i]];
		if (s->corner[i] != WH_NONE)
			expect_corner(t, s->corner[i]);
	}
	const uint32_t first = t->head[vertex_ahead(r, r->at + SCOUTS)];
	s->corner[r->at % SCOUTS] = first;
	if (first != WH_NONE)
		expect_corner(t, first);
}

/* The figures that the first split of a block falls from. */
static void begin_block(reading *r)
{
	const wh_pmesh *f = &r->p->file;
	r->error = r->block ? f->part[r->block - 1].error : f->head.error;
	r->cost = r->block ? f->part[r->block - 1].cost : f->head.cost;
	r->most_faces = f->part[r->block].faces;
}

/* All splits of the next block; the mesh is at the last one that is known. */
static wh_code read_block(wh_ctx *c, wh_progressive *p)
{
	reading r = {.c = c, .p = p, .block = p->known / WH_PMESH_BLOCK};
	const wh_bits_in *in = &p->block.fan;
	scouts ahead;
	if (wh_poll(c) != WH_OK || wh_pmesh_read_block(c, &p->file, r.block, &p->block) != WH_OK)
		return c->err.code;
	begin_block(&r);
	memset(&ahead, 0xff, sizeof ahead); /* WH_NONE */
	for (r.at = 0; r.at < p->block.n; r.at++) {
		look_ahead(&r, &ahead);
		if (read_split(&r) != WH_OK)
			return c->err.code;
		if (in->n > in->end)
			return nonsense(&r, "it ends inside its fans");
	}
	return p->nf == r.most_faces ? WH_OK : nonsense(&r, "it makes other faces than it says");
}

/* ---- the whole ---------------------------------------------------------------------------- */

wh_code wh_progressive_open(wh_ctx *c, wh_progressive *p, const char *path)
{
	*p = (wh_progressive){0};
	if (wh_pmesh_open(c, &p->file, path) != WH_OK)
		return c->err.code;
	return wh_pmesh_block_make(c, &p->block, p->file.attributes.n);
}

void wh_progressive_close(wh_ctx *c, wh_progressive *p)
{
	wh_free(c, p->pos);
	wh_free(c, p->attr);
	wh_free(c, p->at.tri);
	wh_free(c, p->at.next);
	wh_free(c, p->at.head);
	wh_free(c, p->v);
	wh_free(c, p->first);
	wh_free(c, p->faces);
	wh_free(c, p->other);
	wh_free(c, p->other_attr);
	wh_free(c, p->error);
	wh_free(c, p->cost);
	wh_free(c, p->moved);
	wh_pmesh_block_free(c, &p->block);
	wh_pmesh_close(c, &p->file);
	*p = (wh_progressive){0};
}

/* The base; there is room. */
static wh_code begin(wh_ctx *c, wh_progressive *p)
{
	if (wh_pmesh_read_base(c, &p->file, &p->pos->x, p->attr, p->at.tri) != WH_OK)
		return c->err.code;
	p->nv = (uint32_t)p->file.head.base_vertices;
	p->nf = (uint32_t)p->file.head.base_faces;
	p->first[0] = 0;
	wh_corners_fill(&p->at, p->nv, p->nf);
	return WH_OK;
}

wh_code wh_progressive_seek(wh_ctx *c, wh_progressive *p, uint64_t level)
{
	const bool fresh = !p->pos;
	if (make_room(c, p, level) != WH_OK || (fresh && begin(c, p) != WH_OK))
		return c->err.code;
	while (p->level < level && p->level < p->known)
		go_on(p);
	while (p->level < level)
		if (read_block(c, p) != WH_OK)
			return c->err.code;
	while (p->level > level)
		go_back(p);
	return WH_OK;
}

/* ---- which level -------------------------------------------------------------------------- */

/* The last level with no more faces, in the block where they become more. */
static wh_code find_faces(wh_ctx *c, wh_progressive *p, uint64_t faces, uint64_t *level)
{
	const wh_pmesh *f = &p->file;
	uint64_t i = 0, have;
	while (i < f->parts && f->part[i].faces <= faces)
		i++;
	*level = i < f->parts ? i * WH_PMESH_BLOCK : f->head.splits;
	if (i == f->parts)
		return WH_OK;
	if (wh_pmesh_read_block(c, f, i, &p->block) != WH_OK)
		return c->err.code;
	have = i ? f->part[i - 1].faces : f->head.base_faces;
	for (uint32_t k = 0; k < p->block.n; k++, ++*level) {
		have += wh_pmesh_new_faces(wh_pmesh_column(&p->block, WH_PMESH_WAY)[k]);
		if (have > faces)
			break;
	}
	return WH_OK;
}

/* The first level whose error is no larger. */
static wh_code find_error(wh_ctx *c, wh_progressive *p, double error, uint64_t *level)
{
	const wh_pmesh *f = &p->file;
	uint64_t i = 0;
	while (i < f->parts && (double)f->part[i].error > error)
		i++;
	*level = i < f->parts ? i * WH_PMESH_BLOCK : f->head.splits;
	if (i == f->parts)
		return WH_OK;
	if (wh_pmesh_read_block(c, f, i, &p->block) != WH_OK)
		return c->err.code;
	float now = i ? f->part[i - 1].error : f->head.error;
	for (uint32_t k = 0; k < p->block.n; k++, ++*level) {
		now = fall(now, wh_pmesh_column(&p->block, WH_PMESH_ERROR)[k]);
		if ((double)now <= error)
			break;
	}
	return WH_OK;
}

wh_code wh_progressive_find(wh_ctx *c, wh_progressive *p, const wh_progressive_limit *limit,
                            uint64_t *level, bool *kept)
{
	const wh_pmesh_head *h = &p->file.head;
	uint64_t by_faces = 0, by_error = 0, by_vertices = 0;
	if (limit->faces && find_faces(c, p, limit->faces, &by_faces) != WH_OK)
		return c->err.code;
	if (limit->error > 0 && find_error(c, p, limit->error, &by_error) != WH_OK)
		return c->err.code;
	if (limit->vertices > h->base_vertices)
		by_vertices = limit->vertices - h->base_vertices;
	*level = by_faces > by_error ? by_faces : by_error;
	*level = by_vertices > *level ? by_vertices : *level;
	*level = *level < h->splits ? *level : h->splits;
	*kept = (!limit->faces || h->base_faces <= limit->faces) &&
	        (!limit->vertices || h->base_vertices <= limit->vertices);
	return WH_OK;
}
