// What the peer programs share: a triangle soup in and out of PLY, a clock, failing.
// Reading and writing are CGAL's; they are timed apart from the simplification itself.
#ifndef WHITTLE_BENCH_PEER_HPP
#define WHITTLE_BENCH_PEER_HPP

#include <CGAL/IO/PLY.h>
#include <CGAL/Simple_cartesian.h>

#include <array>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <string>
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

[[noreturn]] inline void fail(const std::string &text)
{
	std::fprintf(stderr, "%s\n", text.c_str());
	std::exit(1);
}

// Seconds since the last lap.
class Stopwatch
{
      public:
	double lap()
	{
		const auto now = std::chrono::steady_clock::now();
		const double s = std::chrono::duration<double>(now - last_).count();
		last_ = now;
		return s;
	}

      private:
	std::chrono::steady_clock::time_point last_ = std::chrono::steady_clock::now();
};

inline bool is_degenerate(const std::vector<std::size_t> &f)
{
	return f[0] == f[1] || f[1] == f[2] || f[2] == f[0];
}

// Reads triangles; ones with a repeated corner are left out and counted.
inline Soup read(const std::string &path, std::size_t &degenerate)
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

// A count of faces, or of the input's faces with a percent sign.
inline std::size_t parse_target(const char *text, std::size_t faces)
{
	char *end = nullptr;
	const double x = std::strtod(text, &end);
	if (end == text || x < 0)
		fail(std::string("not a number of faces: ") + text);
	return static_cast<std::size_t>(*end == '%' ? x / 100 * static_cast<double>(faces) : x);
}

} // namespace peer

#endif
