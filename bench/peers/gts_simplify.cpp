// gts_simplify IN.ply OUT.ply FACES|P%
//
// GTS's coarsening with the cost and placement of Lindstrom-Turk ("volume optimized") and the
// weights and the fold angle that its own `coarsen` has as defaults, down to a number of faces.

#include "peer.hpp"

#include <gts.h>

#include <unordered_map>
#include <vector>

// Both ways round, an edge has one key.
static std::uint64_t key_of(std::uint32_t a, std::uint32_t b)
{
	return a < b ? std::uint64_t{a} << 32 | b : std::uint64_t{b} << 32 | a;
}

static GtsSurface *make_surface(const peer::Mesh &m)
{
	GtsSurface *s = gts_surface_new(gts_surface_class(), gts_face_class(), gts_edge_class(),
	                                gts_vertex_class());
	std::vector<GtsVertex *> vertices;
	vertices.reserve(m.vertices());
	for (std::size_t i = 0; i < m.xyz.size(); i += 3)
		vertices.push_back(
		    gts_vertex_new(gts_vertex_class(), m.xyz[i], m.xyz[i + 1], m.xyz[i + 2]));
	std::unordered_map<std::uint64_t, GtsEdge *> edges;
	edges.reserve(m.ids.size() / 2);
	const auto edge = [&](std::uint32_t a, std::uint32_t b) {
		GtsEdge *&e = edges[key_of(a, b)];
		if (!e)
			e = gts_edge_new(gts_edge_class(), vertices[a], vertices[b]);
		return e;
	};
	for (std::size_t i = 0; i < m.ids.size(); i += 3) {
		const std::uint32_t *f = &m.ids[i];
		gts_surface_add_face(s, gts_face_new(gts_face_class(), edge(f[0], f[1]),
		                                     edge(f[1], f[2]), edge(f[2], f[0])));
	}
	return s;
}

struct Stop {
	GtsSurface *surface;
	std::size_t faces;
};

static gboolean is_done(gdouble, guint, Stop *stop)
{
	return gts_surface_face_number(stop->surface) <= stop->faces;
}

static void simplify(GtsSurface *s, std::size_t faces)
{
	GtsVolumeOptimizedParams weights = {0.5, 0.5, 0};
	Stop stop = {s, faces};
	gts_surface_coarsen(s, reinterpret_cast<GtsKeyFunc>(gts_volume_optimized_cost), &weights,
	                    reinterpret_cast<GtsCoarsenFunc>(gts_volume_optimized_vertex), &weights,
	                    reinterpret_cast<GtsStopFunc>(is_done), &stop, G_PI / 180);
}

struct Lists {
	std::vector<float> xyz;
	std::vector<std::uint32_t> ids;
	std::unordered_map<GtsVertex *, std::uint32_t> numbers;
};

static gint list_vertex(GtsVertex *v, Lists *l)
{
	l->numbers[v] = static_cast<std::uint32_t>(l->numbers.size());
	for (const double x : {v->p.x, v->p.y, v->p.z})
		l->xyz.push_back(static_cast<float>(x));
	return 0;
}

static gint list_face(GtsFace *f, Lists *l)
{
	GtsVertex *v[3];
	gts_triangle_vertices(&f->triangle, &v[0], &v[1], &v[2]);
	for (GtsVertex *corner : v)
		l->ids.push_back(l->numbers.at(corner));
	return 0;
}

static void write(const std::string &path, GtsSurface *s)
{
	Lists l;
	gts_surface_foreach_vertex(s, reinterpret_cast<GtsFunc>(list_vertex), &l);
	gts_surface_foreach_face(s, reinterpret_cast<GtsFunc>(list_face), &l);
	peer::write(path, l.xyz.data(), l.xyz.size() / 3, l.ids.data(), l.ids.size() / 3);
}

int main(int argc, char **argv)
{
	if (argc != 4)
		peer::fail("usage: gts_simplify IN.ply OUT.ply FACES|P%");
	peer::Stopwatch clock;
	GtsSurface *surface = make_surface(peer::read(argv[1]));
	const std::size_t before = gts_surface_face_number(surface);
	const double load = clock.lap();
	simplify(surface, peer::parse_target(argv[3], before));
	const double seconds = clock.lap();
	write(argv[2], surface);
	peer::print({"GTS", PEER_GTS_VERSION, before, gts_surface_face_number(surface), load,
	             seconds, clock.lap()});
	return 0;
}
