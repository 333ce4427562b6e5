// cgal_simplify IN.ply OUT.ply FACES|P% lt|gh|gh-tri|gh-prob
//
// CGAL's edge collapse down to a number of faces, with Lindstrom-Turk's cost and placement or
// one of the Garland-Heckbert policies (gh is the classic one: a plane a face). CGAL's own stop
// predicates count edges; the one here counts faces, so that the output has FACES or one less.
// A soup that is not an oriented manifold is made one first, by orienting its faces and
// splitting vertices and edges, and the report says how much that added.

#include "soup.hpp"

#include <CGAL/Polygon_mesh_processing/orient_polygon_soup.h>
#include <CGAL/Polygon_mesh_processing/polygon_soup_to_polygon_mesh.h>
#include <CGAL/Polygon_mesh_processing/repair_polygon_soup.h>
#include <CGAL/Surface_mesh.h>
#include <CGAL/Surface_mesh_simplification/Policies/Edge_collapse/GarlandHeckbert_plane_policies.h>
#include <CGAL/Surface_mesh_simplification/Policies/Edge_collapse/GarlandHeckbert_probabilistic_plane_policies.h>
#include <CGAL/Surface_mesh_simplification/Policies/Edge_collapse/GarlandHeckbert_triangle_policies.h>
#include <CGAL/Surface_mesh_simplification/Policies/Edge_collapse/LindstromTurk_cost.h>
#include <CGAL/Surface_mesh_simplification/Policies/Edge_collapse/LindstromTurk_placement.h>
#include <CGAL/Surface_mesh_simplification/edge_collapse.h>
#include <CGAL/version.h>

#include <functional>
#include <map>

namespace SMS = CGAL::Surface_mesh_simplification;
namespace PMP = CGAL::Polygon_mesh_processing;
using Mesh = CGAL::Surface_mesh<peer::Point>;

// Asked before every collapse: true once no more than `faces` are left.
struct Face_stop {
	std::size_t faces;

	template <typename Cost, typename Profile>
	bool operator()(const Cost &, const Profile &profile, std::size_t, std::size_t) const
	{
		return profile.surface_mesh().number_of_faces() <= faces;
	}
};

static void collapse_lt(Mesh &mesh, std::size_t faces)
{
	SMS::edge_collapse(mesh, Face_stop{faces},
	                   CGAL::parameters::get_cost(SMS::LindstromTurk_cost<Mesh>())
	                       .get_placement(SMS::LindstromTurk_placement<Mesh>()));
}

template <typename Policies>
static void collapse_gh(Mesh &mesh, std::size_t faces)
{
	const Policies policies(mesh);
	SMS::edge_collapse(mesh, Face_stop{faces},
	                   CGAL::parameters::get_cost(policies.get_cost())
	                       .get_placement(policies.get_placement()));
}

using Collapse = std::function<void(Mesh &, std::size_t)>;

static const std::map<std::string, Collapse> methods = {
    {"lt", collapse_lt},
    {"gh", collapse_gh<SMS::GarlandHeckbert_plane_policies<Mesh, peer::Kernel>>},
    {"gh-tri", collapse_gh<SMS::GarlandHeckbert_triangle_policies<Mesh, peer::Kernel>>},
    {"gh-prob", collapse_gh<SMS::GarlandHeckbert_probabilistic_plane_policies<Mesh, peer::Kernel>>},
};

// Polygon_mesh_processing wants a soup of resizable polygons here and there; arrays do for these.
static void make_manifold(peer::Soup &s)
{
	if (PMP::is_polygon_soup_a_polygon_mesh(s.triangles)) {
		std::fprintf(stderr, "repair: none needed\n");
		return;
	}
	const std::size_t duplicates = PMP::merge_duplicate_polygons_in_polygon_soup(
	    s.points, s.triangles, CGAL::parameters::erase_all_duplicates(false));
	const std::size_t before = s.points.size();
	PMP::orient_polygon_soup(s.points, s.triangles);
	std::fprintf(stderr,
	             "repair: %zu duplicate faces dropped, %zu vertices added by splitting\n",
	             duplicates, s.points.size() - before);
}

static Mesh make_mesh(peer::Soup &s)
{
	Mesh mesh;
	PMP::remove_isolated_points_in_polygon_soup(s.points, s.triangles);
	make_manifold(s);
	PMP::polygon_soup_to_polygon_mesh(s.points, s.triangles, mesh);
	return mesh;
}

static void write(const std::string &path, Mesh &mesh)
{
	mesh.collect_garbage();
	std::ofstream out(path, std::ios::binary);
	CGAL::IO::set_binary_mode(out);
	if (!out || !CGAL::IO::write_PLY(out, mesh) || !out.flush())
		peer::fail(path + ": cannot be written");
}

int main(int argc, char **argv)
{
	if (argc != 5 || methods.find(argv[4]) == methods.end())
		peer::fail("usage: cgal_simplify IN.ply OUT.ply FACES|P% lt|gh|gh-tri|gh-prob");
	peer::Stopwatch clock;
	std::size_t degenerate;
	peer::Soup soup = peer::read_soup(argv[1], degenerate);
	Mesh mesh = make_mesh(soup);
	soup = {};
	const std::size_t before = mesh.number_of_faces();
	const double load = clock.lap();
	methods.at(argv[4])(mesh, peer::parse_target(argv[3], before));
	const double simplify = clock.lap();
	write(argv[2], mesh);
	peer::print({"CGAL", CGAL_VERSION_STR, before, mesh.number_of_faces(), load, simplify,
	             clock.lap()});
	return 0;
}
