// openmesh_simplify IN.ply OUT.ply FACES|P%
//
// OpenMesh's decimater with its quadric module, down to a number of faces. Half-edge collapses: it
// keeps a subset of the vertices.

#include "peer.hpp"

#include <OpenMesh/Core/IO/MeshIO.hh>
#include <OpenMesh/Core/Mesh/TriMesh_ArrayKernelT.hh>
#include <OpenMesh/Core/System/config.h>
#include <OpenMesh/Tools/Decimater/DecimaterT.hh>
#include <OpenMesh/Tools/Decimater/ModQuadricT.hh>

using Mesh = OpenMesh::TriMesh_ArrayKernelT<>;

static void simplify(Mesh &mesh, std::size_t faces)
{
	OpenMesh::Decimater::DecimaterT<Mesh> decimater(mesh);
	OpenMesh::Decimater::ModQuadricT<Mesh>::Handle quadric;
	decimater.add(quadric);
	decimater.module(quadric).unset_max_err();
	if (!decimater.initialize())
		peer::fail("OpenMesh: no decimater");
	decimater.decimate_to_faces(0, faces);
	mesh.garbage_collection();
}

static std::string version()
{
	return std::to_string(OM_GET_VER) + "." + std::to_string(OM_GET_MAJ);
}

int main(int argc, char **argv)
{
	if (argc != 4)
		peer::fail("usage: openmesh_simplify IN.ply OUT.ply FACES|P%");
	peer::Stopwatch clock;
	Mesh mesh;
	if (!OpenMesh::IO::read_mesh(mesh, argv[1]))
		peer::fail(std::string(argv[1]) + ": cannot be read");
	const std::size_t before = mesh.n_faces();
	const double load = clock.lap();
	simplify(mesh, peer::parse_target(argv[3], before));
	const double seconds = clock.lap();
	if (!OpenMesh::IO::write_mesh(mesh, argv[2], OpenMesh::IO::Options::Binary))
		peer::fail(std::string(argv[2]) + ": cannot be written");
	peer::print({"OpenMesh", version(), before, mesh.n_faces(), load, seconds, clock.lap()});
	return 0;
}
