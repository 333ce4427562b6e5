// cgal_distance A.ply B.ply SAMPLES
//
// Distances of points of A from the nearest triangle of B by CGAL's tree of boxes, and of points
// of B from A: SAMPLES random points a side, uniform over the area, and all vertices. Prints one line of
// JSON; mean and RMS are of the points on the area, with their standard errors, the maximum is of
// all. Vertices that no face uses are measured, too: there should be none.

#include "soup.hpp"

#include <CGAL/AABB_traits.h>
#include <CGAL/AABB_tree.h>
#include <CGAL/AABB_triangle_primitive.h>
#include <CGAL/version.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <random>
#include <vector>

using Triangles = std::vector<peer::Kernel::Triangle_3>;
using Primitive = CGAL::AABB_triangle_primitive<peer::Kernel, Triangles::const_iterator>;
using Tree = CGAL::AABB_tree<CGAL::AABB_traits<peer::Kernel, Primitive>>;

struct Surface {
	std::vector<peer::Point> points;
	Triangles triangles;
};

static Surface read(const char *path)
{
	std::size_t degenerate;
	peer::Soup soup = peer::read_soup(path, degenerate);
	Surface s;
	for (const peer::Triangle &t : soup.triangles)
		s.triangles.emplace_back(soup.points[t[0]], soup.points[t[1]], soup.points[t[2]]);
	s.points = std::move(soup.points);
	return s;
}

// Area of all triangles up to each.
static std::vector<double> areas(const Triangles &triangles)
{
	std::vector<double> sum;
	double total = 0;
	for (const auto &t : triangles)
		sum.push_back(total += std::sqrt(t.squared_area()));
	return sum;
}

// Sums of powers of the distances of the points on the area, and the largest of all.
struct Sums {
	double d = 0, d2 = 0, d4 = 0, max2 = 0;

	void add(double squared)
	{
		d += std::sqrt(squared);
		d2 += squared;
		d4 += squared * squared;
		max2 = std::max(max2, squared);
	}
};

// Uniform in a triangle: points of the parallelogram beyond the diagonal are turned back.
static peer::Point point_in(const peer::Kernel::Triangle_3 &t, double u, double v)
{
	if (u + v > 1) {
		u = 1 - u;
		v = 1 - v;
	}
	return t[0] + u * (t[1] - t[0]) + v * (t[2] - t[0]);
}

static Sums measure(const Surface &from, const Tree &to, std::size_t samples)
{
	Sums s;
	std::mt19937_64 random(1);
	std::uniform_real_distribution<double> unit(0, 1);
	const std::vector<double> area = areas(from.triangles);
	for (std::size_t i = 0; i < samples; i++) {
		const auto at = std::upper_bound(area.begin(), area.end(), unit(random) * area.back());
		const std::size_t face = std::min<std::size_t>(at - area.begin(), area.size() - 1);
		const double u = unit(random);
		s.add(to.squared_distance(point_in(from.triangles[face], u, unit(random))));
	}
	for (const peer::Point &p : from.points)
		s.max2 = std::max(s.max2, to.squared_distance(p));
	return s;
}

static void print(const char *name, const Sums &s, std::size_t samples, const char *end)
{
	const double n = static_cast<double>(samples), mean = s.d / n, rms = std::sqrt(s.d2 / n);
	const double mean_error = std::sqrt(std::max(0.0, s.d2 / n - mean * mean) / n);
	const double square_error = std::sqrt(std::max(0.0, s.d4 / n - rms * rms * rms * rms) / n);
	std::printf("\"%s\": {\"mean\": %.9g, \"rms\": %.9g, \"max\": %.9g, \"mean_error\": %.4g, "
	            "\"rms_error\": %.4g}%s",
	            name, mean, rms, std::sqrt(s.max2), mean_error,
	            rms > 0 ? square_error / (2 * rms) : 0, end);
}

int main(int argc, char **argv)
{
	const std::size_t samples = argc == 4 ? std::strtoull(argv[3], nullptr, 10) : 0;
	if (samples == 0)
		peer::fail("usage: cgal_distance A.ply B.ply SAMPLES");
	const Surface a = read(argv[1]), b = read(argv[2]);
	Tree tree_a(a.triangles.begin(), a.triangles.end());
	Tree tree_b(b.triangles.begin(), b.triangles.end());
	tree_a.accelerate_distance_queries();
	tree_b.accelerate_distance_queries();
	const Sums ab = measure(a, tree_b, samples), ba = measure(b, tree_a, samples);
	std::printf("{\"library\": \"CGAL\", \"version\": \"%s\", ", CGAL_VERSION_STR);
	print("a_to_b", ab, samples, ", ");
	print("b_to_a", ba, samples, "}\n");
	return 0;
}
