// A triangle soup from any PLY file, by CGAL's reader.
#ifndef WHITTLE_BENCH_SOUP_HPP
#define WHITTLE_BENCH_SOUP_HPP

#include "peer.hpp"

#include <CGAL/IO/PLY.h>
#include <CGAL/Simple_cartesian.h>

#include <array>
#include <fstream>
#include <vector>

namespace peer
{

using Kernel = CGAL::Simple_cartesian<double>;
using Point = Kernel::Point_3;
using Triangle = std::array<std::size_t, 3>;

struct Soup {
	std::vector<Point> points;
	std::vector<Triangle> triangles;
};

inline bool is_degenerate(const std::vector<std::size_t> &f)
{
	return f[0] == f[1] || f[1] == f[2] || f[2] == f[0];
}

// Reads triangles; ones with a repeated corner are left out and counted.
inline Soup read_soup(const std::string &path, std::size_t &degenerate)
{
	Soup s;
	std::vector<std::vector<std::size_t>> polygons;
	std::ifstream in(path, std::ios::binary);
	if (!in || !CGAL::IO::read_PLY(in, s.points, polygons))
		fail(path + ": cannot be read as PLY");
	s.triangles.reserve(polygons.size());
	degenerate = 0;
	for (const auto &f : polygons) {
		if (f.size() != 3)
			fail(path + ": has faces that are not triangles");
		if (is_degenerate(f))
			degenerate++;
		else
			s.triangles.push_back({f[0], f[1], f[2]});
	}
	return s;
}

} // namespace peer

#endif
