// meshopt_simplify IN.ply OUT.ply FACES|P%
//
// meshoptimizer's simplifier down to a number of faces, over the whole mesh at once.

#include "meshopt.hpp"

int main(int argc, char **argv)
{
	if (argc != 4)
		peer::fail("usage: meshopt_simplify IN.ply OUT.ply FACES|P%");
	peer::Stopwatch clock;
	const peer::Mesh mesh = peer::read(argv[1]);
	const std::size_t target = peer::parse_target(argv[3], mesh.faces());
	const double load = clock.lap();
	peer::Ids out = peer::meshopt(mesh.ids, mesh.xyz.data(), mesh.vertices(), target, 0);
	const double simplify = clock.lap();
	peer::write_used(argv[2], out, mesh.xyz.data(), mesh.vertices());
	peer::print({"meshoptimizer", peer::meshopt_version(), mesh.faces(), out.size() / 3, load,
	             simplify, clock.lap()});
	return 0;
}
