// meshoptimizer's simplifier as the two programs with it call it: positions as floats, borders
// free, no error limit. It keeps a subset of the vertices.
#ifndef WHITTLE_BENCH_MESHOPT_HPP
#define WHITTLE_BENCH_MESHOPT_HPP

#include "peer.hpp"

#include <meshoptimizer.h>

#include <algorithm>
#include <cfloat>

namespace peer
{

using Ids = Buffer<std::uint32_t>;

inline Ids meshopt(const Ids &ids, const float *xyz, std::size_t nv, std::size_t faces,
                   unsigned options)
{
	Ids out(ids.size());
	out.shrink(meshopt_simplify(out.data(), ids.data(), ids.size(), xyz, nv, 3 * sizeof(float),
	                            3 * faces, FLT_MAX, options, nullptr));
	return out;
}

inline std::string meshopt_version()
{
	return std::to_string(MESHOPTIMIZER_VERSION / 1000) + "." +
	       std::to_string(MESHOPTIMIZER_VERSION % 1000 / 10);
}

// Writes the faces and the vertices they use.
inline void write_used(const std::string &path, Ids &ids, const float *xyz, std::size_t nv)
{
	Buffer<float> used(3 * std::min(nv, ids.size()));
	const std::size_t n = meshopt_optimizeVertexFetch(used.data(), ids.data(), ids.size(), xyz,
	                                                  nv, 3 * sizeof(float));
	write(path, used.data(), n, ids.data(), ids.size() / 3);
}

} // namespace peer

#endif
