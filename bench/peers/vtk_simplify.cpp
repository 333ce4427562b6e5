// vtk_simplify IN.ply OUT.ply FACES|P%
//
// VTK's vtkQuadricDecimation, as it comes, down to a number of faces.

#include "peer.hpp"

#include <vtkNew.h>
#include <vtkPLYReader.h>
#include <vtkPLYWriter.h>
#include <vtkPolyData.h>
#include <vtkQuadricDecimation.h>
#include <vtkVersion.h>

static std::size_t faces_of(vtkPolyData *mesh)
{
	return static_cast<std::size_t>(mesh->GetNumberOfPolys());
}

static void write(const char *path, vtkPolyData *mesh)
{
	vtkNew<vtkPLYWriter> writer;
	writer->SetFileName(path);
	writer->SetFileTypeToBinary();
	writer->SetInputData(mesh);
	if (!writer->Write())
		peer::fail(std::string(path) + ": cannot be written");
}

int main(int argc, char **argv)
{
	if (argc != 4)
		peer::fail("usage: vtk_simplify IN.ply OUT.ply FACES|P%");
	peer::Stopwatch clock;
	vtkNew<vtkPLYReader> reader;
	reader->SetFileName(argv[1]);
	reader->Update();
	const std::size_t before = faces_of(reader->GetOutput());
	if (before == 0)
		peer::fail(std::string(argv[1]) + ": cannot be read");
	const double load = clock.lap();
	vtkNew<vtkQuadricDecimation> decimation;
	decimation->SetInputData(reader->GetOutput());
	const auto target = static_cast<double>(peer::parse_target(argv[3], before));
	decimation->SetTargetReduction(1 - target / static_cast<double>(before));
	decimation->Update();
	const double seconds = clock.lap();
	write(argv[2], decimation->GetOutput());
	peer::print({"VTK", vtkVersion::GetVTKVersion(), before, faces_of(decimation->GetOutput()),
	             load, seconds, clock.lap()});
	return 0;
}
