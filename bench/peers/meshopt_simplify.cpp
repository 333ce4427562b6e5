// meshopt_simplify IN.ply OUT.ply FACES|P%
//
// meshoptimizer's simplifier (borders free, no error limit) down to a number of faces. It works
// on floats and keeps a subset of the vertices; unused ones are left out of the output.

#include "peer.hpp"

#include <meshoptimizer.h>

#include <cfloat>

using Indices = std::vector<unsigned int>;

static std::vector<float> floats_of(const peer::Soup &s)
{
	std::vector<float> xyz;
	xyz.reserve(3 * s.points.size());
	for (const auto &p : s.points)
		for (int k = 0; k < 3; k++)
			xyz.push_back(static_cast<float>(p[k]));
	return xyz;
}

static Indices indices_of(const peer::Soup &s)
{
	Indices ids;
	ids.reserve(3 * s.triangles.size());
	for (const auto &t : s.triangles)
		for (const std::size_t v : t)
			ids.push_back(static_cast<unsigned int>(v));
	return ids;
}

static Indices simplify(const Indices &ids, const std::vector<float> &xyz, std::size_t faces)
{
	Indices out(ids.size());
	out.resize(meshopt_simplify(out.data(), ids.data(), ids.size(), xyz.data(), xyz.size() / 3,
	                            3 * sizeof(float), 3 * faces, FLT_MAX, 0, nullptr));
	return out;
}

static void write(const std::string &path, Indices ids, const std::vector<float> &xyz)
{
	std::vector<float> used(xyz.size());
	const std::size_t nv = meshopt_optimizeVertexFetch(
	    used.data(), ids.data(), ids.size(), xyz.data(), xyz.size() / 3, 3 * sizeof(float));
	std::ofstream out(path, std::ios::binary);
	out << "ply\nformat binary_little_endian 1.0\nelement vertex " << nv
	    << "\nproperty float x\nproperty float y\nproperty float z\nelement face "
	    << ids.size() / 3 << "\nproperty list uchar int vertex_indices\nend_header\n";
	out.write(reinterpret_cast<const char *>(used.data()),
	          static_cast<std::streamsize>(nv * 3 * sizeof(float)));
	for (std::size_t i = 0; i < ids.size(); i += 3) {
		out.put(3);
		out.write(reinterpret_cast<const char *>(&ids[i]), 3 * sizeof(unsigned int));
	}
	if (!out.flush())
		peer::fail(path + ": cannot be written");
}

int main(int argc, char **argv)
{
	if (argc != 4)
		peer::fail("usage: meshopt_simplify IN.ply OUT.ply FACES|P%");
	peer::Stopwatch clock;
	std::size_t degenerate;
	const peer::Soup soup = peer::read(argv[1], degenerate);
	const std::vector<float> xyz = floats_of(soup);
	const Indices ids = indices_of(soup);
	const double load = clock.lap();
	const Indices out = simplify(ids, xyz, peer::parse_target(argv[3], ids.size() / 3));
	const double collapse = clock.lap();
	write(argv[2], out, xyz);
	std::printf("meshoptimizer: %zu -> %zu faces (%zu degenerate dropped), load %.2f s, "
	            "collapse %.2f s, write %.2f s\n",
	            ids.size() / 3, out.size() / 3, degenerate, load, collapse, clock.lap());
	return 0;
}
