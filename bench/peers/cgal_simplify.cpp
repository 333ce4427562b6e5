// cgal_simplify IN.ply OUT.ply FACES|P% lt|gh|gh-tri|gh-prob [OUT.ply FACES|P%]...
// cgal_simplify --normalise IN.ply OUT.ply
//
// CGAL's edge collapse down to a number of faces, with Lindstrom-Turk's cost and placement or
// one of the Garland-Heckbert policies (gh is the classic one: a plane a face). CGAL's own stop
// predicates count edges; the one here counts faces, so that the output has FACES or one less.
// A soup that is not an oriented manifold is made one first, by orienting its faces and
// splitting vertices and edges, and the report says how much that added.
//
// Further pairs, each of fewer faces, are written on the way: the collapses do not depend on where
// they will stop, so one course gives the meshes of several. Those it does not get to are what it
// ended with.
//
// --normalise writes the mesh as it is before the first collapse, without faces that have a
// repeated corner or one that is not finite: the same input for everybody.

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

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <utility>

namespace SMS = CGAL::Surface_mesh_simplification;
namespace PMP = CGAL::Polygon_mesh_processing;
using Mesh = CGAL::Surface_mesh<peer::Point>;

static void write(const std::string &path, Mesh mesh)
{
	mesh.collect_garbage();
	std::ofstream out(path, std::ios::binary);
	CGAL::IO::set_binary_mode(out);
	if (!out || !CGAL::IO::write_PLY(out, mesh) || !out.flush())
		peer::fail(path + ": cannot be written");
}

struct Target {
	std::string path;
	std::size_t faces;
};

// The targets that are left, the one of most faces first.
class Course
{
      public:
	explicit Course(std::vector<Target> targets) : targets_(std::move(targets))
	{
	}

	// Writes what the mesh has come down to; true when that was the last one.
	bool reach(const Mesh &mesh)
	{
		while (next_ < targets_.size() && mesh.number_of_faces() <= targets_[next_].faces)
			write_next(mesh);
		return next_ == targets_.size();
	}

	void end(const Mesh &mesh)
	{
		while (next_ < targets_.size())
			write_next(mesh);
	}

	// Spent on writing, all in all.
	double seconds() const
	{
		return seconds_;
	}

      private:
	void write_next(const Mesh &mesh)
	{
		peer::Stopwatch clock;
		write(targets_[next_++].path, mesh);
		seconds_ += clock.lap();
	}

	std::vector<Target> targets_;
	std::size_t next_ = 0;
	double seconds_ = 0;
};

// Asked before every collapse.
struct Face_stop {
	Course *course;

	template <typename Cost, typename Profile>
	bool operator()(const Cost &, const Profile &profile, std::size_t, std::size_t) const
	{
		return course->reach(profile.surface_mesh());
	}
};

static void collapse_lt(Mesh &mesh, Course &course)
{
	SMS::edge_collapse(mesh, Face_stop{&course},
	                   CGAL::parameters::get_cost(SMS::LindstromTurk_cost<Mesh>())
	                       .get_placement(SMS::LindstromTurk_placement<Mesh>()));
}

template <typename Policies>
static void collapse_gh(Mesh &mesh, Course &course)
{
	const Policies policies(mesh);
	SMS::edge_collapse(mesh, Face_stop{&course},
	                   CGAL::parameters::get_cost(policies.get_cost())
	                       .get_placement(policies.get_placement()));
}

using Collapse = std::function<void(Mesh &, Course &)>;

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

// Drops faces with a corner that is nowhere; returns how many.
static std::size_t drop_nonfinite(peer::Soup &s)
{
	const auto is_nowhere = [&](std::size_t v) {
		const peer::Point &p = s.points[v];
		return !std::isfinite(p.x()) || !std::isfinite(p.y()) || !std::isfinite(p.z());
	};
	const auto has_nowhere = [&](const peer::Triangle &t) {
		return std::any_of(t.begin(), t.end(), is_nowhere);
	};
	const std::size_t before = s.triangles.size();
	s.triangles.erase(std::remove_if(s.triangles.begin(), s.triangles.end(), has_nowhere),
	                  s.triangles.end());
	return before - s.triangles.size();
}

static int normalise(const char *in, const char *out)
{
	std::size_t degenerate;
	peer::Soup soup = peer::read_soup(in, degenerate);
	const std::size_t nonfinite = drop_nonfinite(soup);
	Mesh mesh = make_mesh(soup);
	write(out, mesh);
	std::printf("normalised: %zu faces, %zu degenerate and %zu not finite dropped\n",
	            static_cast<std::size_t>(mesh.number_of_faces()), degenerate, nonfinite);
	return 0;
}

// OUT.ply FACES METHOD [OUT.ply FACES]...
static std::vector<Target> parse_targets(int argc, char **argv, std::size_t faces)
{
	std::vector<Target> targets = {{argv[2], peer::parse_target(argv[3], faces)}};
	for (int i = 5; i < argc; i += 2)
		targets.push_back({argv[i], peer::parse_target(argv[i + 1], faces)});
	return targets;
}

int main(int argc, char **argv)
{
	if (argc == 4 && std::string(argv[1]) == "--normalise")
		return normalise(argv[2], argv[3]);
	if (argc < 5 || argc % 2 == 0 || methods.find(argv[4]) == methods.end())
		peer::fail("usage: cgal_simplify IN.ply OUT.ply FACES|P% lt|gh|gh-tri|gh-prob "
		           "[OUT.ply FACES|P%]...\n"
		           "       cgal_simplify --normalise IN.ply OUT.ply");
	peer::Stopwatch clock;
	std::size_t degenerate;
	peer::Soup soup = peer::read_soup(argv[1], degenerate);
	Mesh mesh = make_mesh(soup);
	soup = {};
	const std::size_t before = mesh.number_of_faces();
	const double load = clock.lap();
	Course course(parse_targets(argc, argv, before));
	methods.at(argv[4])(mesh, course);
	course.end(mesh);
	const double simplify = clock.lap() - course.seconds();
	peer::print({"CGAL", CGAL_VERSION_STR, before, mesh.number_of_faces(), load, simplify,
	             course.seconds()});
	return 0;
}
