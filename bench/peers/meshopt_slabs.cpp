// meshopt_slabs IN.ply OUT.ply FACES|P% [THREADS [SLACK]]
//
// What a careful user of meshoptimizer does with several cores: cuts the mesh along its longest
// axis into one slab a thread, with as many faces each, simplifies the slabs at the same time with
// their borders locked, down to SLACK (1.5) times the share wanted, joins them and simplifies the
// whole to the exact count, which thins out the borders too. Of the slacks 1 to 3 on meshes of
// 0.25 M and 10 M faces, 1.5 gives the smallest time and an error like that of 1.25. Without an
// allowance for the borders, a terrain of 0.25 M faces at 1 % has five times the error.

#include "meshopt.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <thread>
#include <vector>

using peer::Ids;
using peer::Mesh;

constexpr std::uint32_t unused = ~std::uint32_t{0};

static int longest_axis(const Mesh &m)
{
	float lo[3] = {FLT_MAX, FLT_MAX, FLT_MAX}, hi[3] = {-FLT_MAX, -FLT_MAX, -FLT_MAX};
	for (std::size_t i = 0; i < m.xyz.size(); i += 3)
		for (int k = 0; k < 3; k++) {
			lo[k] = std::min(lo[k], m.xyz[i + k]);
			hi[k] = std::max(hi[k], m.xyz[i + k]);
		}
	int axis = 0;
	for (int k = 1; k < 3; k++)
		if (hi[k] - lo[k] > hi[axis] - lo[axis])
			axis = k;
	return axis;
}

// Where a face lies along the axis.
static float place(const Mesh &m, int axis, const std::uint32_t *f)
{
	return m.xyz[3 * f[0] + axis] + m.xyz[3 * f[1] + axis] + m.xyz[3 * f[2] + axis];
}

// The places that bound n slabs of as many faces, from a sample of them.
static std::vector<float> find_bounds(const Mesh &m, int axis, std::size_t n)
{
	std::vector<float> sample;
	const std::size_t step = std::max<std::size_t>(1, m.faces() / 65536);
	for (std::size_t f = 0; f < m.faces(); f += step)
		sample.push_back(place(m, axis, &m.ids[3 * f]));
	std::sort(sample.begin(), sample.end());
	std::vector<float> bounds = {-FLT_MAX};
	for (std::size_t i = 1; i < n; i++)
		bounds.push_back(sample[i * sample.size() / n]);
	bounds.push_back(FLT_MAX);
	return bounds;
}

// A part of a mesh with vertices of its own: meshoptimizer looks at all that it is given.
struct Part {
	Ids ids;
	std::vector<float> xyz;
	std::vector<std::uint32_t> origin; // of its vertices in the mesh
};

// Numbers the vertices of `ids`, which are the mesh's, anew.
static void make_compact(const Mesh &m, Part &p)
{
	std::vector<std::uint32_t> number(m.vertices(), unused);
	for (std::size_t i = 0; i < p.ids.size(); i++) {
		std::uint32_t &v = number[p.ids[i]];
		if (v == unused) {
			v = static_cast<std::uint32_t>(p.origin.size());
			const float *x = &m.xyz[3 * std::size_t{p.ids[i]}];
			p.origin.push_back(p.ids[i]);
			p.xyz.insert(p.xyz.end(), x, x + 3);
		}
		p.ids[i] = v;
	}
}

static Part take_slab(const Mesh &m, int axis, float from, float to)
{
	std::vector<std::uint32_t> ids;
	for (std::size_t f = 0; f < m.faces(); f++) {
		const float at = place(m, axis, &m.ids[3 * f]);
		if (at >= from && at < to)
			ids.insert(ids.end(), &m.ids[3 * f], &m.ids[3 * f] + 3);
	}
	Part p;
	p.ids = Ids(ids.size());
	std::copy(ids.begin(), ids.end(), p.ids.data());
	ids = {};
	make_compact(m, p);
	return p;
}

static Ids simplify_part(const Part &p, std::size_t faces, unsigned options)
{
	Ids out = peer::meshopt(p.ids, p.xyz.data(), p.origin.size(), faces, options);
	for (std::size_t i = 0; i < out.size(); i++)
		out[i] = p.origin[out[i]];
	return out;
}

// Faces to leave in a slab of n: the share, and what its locked border, some sqrt(n) long, takes
// up.
static std::size_t slab_target(std::size_t n, double share)
{
	const auto faces = static_cast<double>(n);
	return static_cast<std::size_t>(std::min(faces, share * faces + 6 * std::sqrt(faces)));
}

// Every slab by a thread of its own; the faces left, by the mesh's vertices.
static std::vector<Ids> simplify_slabs(const Mesh &m, std::size_t slabs, double share)
{
	const int axis = longest_axis(m);
	const std::vector<float> bounds = find_bounds(m, axis, slabs);
	std::vector<Ids> out(slabs);
	std::vector<std::thread> threads;
	for (std::size_t s = 0; s < slabs; s++)
		threads.emplace_back([&, s] {
			const Part p = take_slab(m, axis, bounds[s], bounds[s + 1]);
			out[s] = simplify_part(p, slab_target(p.ids.size() / 3, share),
			                       meshopt_SimplifyLockBorder);
		});
	for (auto &t : threads)
		t.join();
	return out;
}

static Part join(const Mesh &m, const std::vector<Ids> &slabs)
{
	std::size_t n = 0;
	for (const Ids &s : slabs)
		n += s.size();
	Part p;
	p.ids = Ids(n);
	std::uint32_t *to = p.ids.data();
	for (const Ids &s : slabs)
		to = std::copy(s.data(), s.data() + s.size(), to);
	make_compact(m, p);
	return p;
}

static Ids simplify(const Mesh &m, std::size_t target, std::size_t threads, double slack)
{
	const double share = slack * static_cast<double>(target) / static_cast<double>(m.faces());
	const Part joined = join(m, simplify_slabs(m, threads, std::min(share, 1.0)));
	return simplify_part(joined, std::min(target, joined.ids.size() / 3), 0);
}

int main(int argc, char **argv)
{
	if (argc < 4 || argc > 6)
		peer::fail("usage: meshopt_slabs IN.ply OUT.ply FACES|P% [THREADS [SLACK]]");
	const std::size_t threads =
	    argc > 4 ? std::strtoul(argv[4], nullptr, 10) : std::thread::hardware_concurrency();
	const double slack = argc > 5 ? std::strtod(argv[5], nullptr) : 1.5;
	peer::Stopwatch clock;
	const Mesh mesh = peer::read(argv[1]);
	const std::size_t target = peer::parse_target(argv[3], mesh.faces());
	const double load = clock.lap();
	Ids out = simplify(mesh, target, std::max<std::size_t>(threads, 1), slack);
	const double seconds = clock.lap();
	peer::write_used(argv[2], out, mesh.xyz.data(), mesh.vertices());
	peer::print({"meshoptimizer", peer::meshopt_version(), mesh.faces(), out.size() / 3, load,
	             seconds, clock.lap()});
	return 0;
}
