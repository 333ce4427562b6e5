// meshopt_colour IN.ply OUT.ply FACES WEIGHT keep|update
//
// meshoptimizer's simplifier with colours as attributes, as its documentation has it: red, green and
// blue from 0 to 1, all of one weight, no error limit. keep: a subset of the vertices
// (meshopt_simplifyWithAttributes); update: positions and colours are moved, too
// (meshopt_simplifyWithUpdate). Reads what `whittle reduce --attributes colour` writes: floats x, y, z
// and bytes red, green, blue, then triangles, little endian. Prints the number of faces.
//
// Debian 12's meshoptimizer has neither function; see compare_colours for how this is built.

#include <meshoptimizer.h>

#include <cfloat>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <iterator>
#include <sstream>
#include <string>
#include <vector>

namespace
{

struct Mesh {
	std::vector<float> xyz, rgb;
	std::vector<unsigned> ids;
};

constexpr std::size_t VERTEX = 15, FACE = 13; // bytes

[[noreturn]] void fail(const std::string &text)
{
	std::fprintf(stderr, "meshopt_colour: %s\n", text.c_str());
	std::exit(1);
}

std::size_t count_of(const std::string &header, const std::string &element)
{
	const std::size_t at = header.find("element " + element + " ");
	if (at == std::string::npos)
		fail("no element " + element);
	return std::strtoull(header.c_str() + at + element.size() + 9, nullptr, 10);
}

Mesh read(const char *path)
{
	static const char properties[] =
	    "property float x\nproperty float y\nproperty float z\nproperty uchar red\n"
	    "property uchar green\nproperty uchar blue\nelement face";
	std::ifstream f(path, std::ios::binary);
	const std::string all((std::istreambuf_iterator<char>(f)), {});
	const std::size_t end = all.find("end_header\n");
	if (end == std::string::npos || all.find(properties) > end)
		fail(std::string(path) + " has another layout");
	const std::size_t nv = count_of(all, "vertex"), nf = count_of(all, "face");
	const char *at = all.data() + end + 11;
	if (all.size() - end - 11 != nv * VERTEX + nf * FACE)
		fail(std::string(path) + " has another size");
	Mesh m;
	for (std::size_t i = 0; i < nv; i++, at += VERTEX) {
		float p[3];
		std::memcpy(p, at, sizeof p);
		m.xyz.insert(m.xyz.end(), p, p + 3);
		for (int k = 0; k < 3; k++)
			m.rgb.push_back(static_cast<float>(static_cast<unsigned char>(at[12 + k])) / 255);
	}
	for (std::size_t i = 0; i < nf; i++, at += FACE) {
		unsigned t[3];
		std::memcpy(t, at + 1, sizeof t);
		m.ids.insert(m.ids.end(), t, t + 3);
	}
	return m;
}

unsigned char byte_of(float v)
{
	return static_cast<unsigned char>(v <= 0 ? 0 : v >= 1 ? 255 : v * 255 + 0.5f);
}

void write(const char *path, const Mesh &m)
{
	const std::size_t nv = m.xyz.size() / 3;
	std::vector<unsigned> number(nv, ~0u), used;
	for (const unsigned v : m.ids)
		if (number[v] == ~0u) {
			number[v] = static_cast<unsigned>(used.size());
			used.push_back(v);
		}
	std::ofstream f(path, std::ios::binary);
	f << "ply\nformat binary_little_endian 1.0\nelement vertex " << used.size()
	  << "\nproperty float x\nproperty float y\nproperty float z\nproperty uchar red\n"
	     "property uchar green\nproperty uchar blue\nelement face "
	  << m.ids.size() / 3 << "\nproperty list uchar int vertex_indices\nend_header\n";
	for (const unsigned v : used) {
		f.write(reinterpret_cast<const char *>(&m.xyz[3 * v]), 12);
		for (int k = 0; k < 3; k++)
			f.put(static_cast<char>(byte_of(m.rgb[3 * v + k])));
	}
	for (std::size_t i = 0; i < m.ids.size(); i += 3) {
		f.put(3);
		for (int k = 0; k < 3; k++)
			f.write(reinterpret_cast<const char *>(&number[m.ids[i + k]]), 4);
	}
	if (!f.flush())
		fail(std::string("cannot write ") + path);
}

} // namespace

int main(int argc, char **argv)
{
	if (argc != 6)
		fail("usage: meshopt_colour IN.ply OUT.ply FACES WEIGHT keep|update");
	Mesh m = read(argv[1]);
	const std::size_t nv = m.xyz.size() / 3, target = 3 * std::strtoull(argv[3], nullptr, 10);
	const float w = std::strtof(argv[4], nullptr), weights[3] = {w, w, w};
	std::size_t n;
	if (std::strcmp(argv[5], "update") == 0) {
		n = meshopt_simplifyWithUpdate(m.ids.data(), m.ids.size(), m.xyz.data(), nv, 12,
		                               m.rgb.data(), 12, weights, 3, nullptr, target, FLT_MAX,
		                               0, nullptr);
	} else {
		std::vector<unsigned> out(m.ids.size());
		n = meshopt_simplifyWithAttributes(out.data(), m.ids.data(), m.ids.size(),
		                                   m.xyz.data(), nv, 12, m.rgb.data(), 12, weights, 3,
		                                   nullptr, target, FLT_MAX, 0, nullptr);
		m.ids.swap(out);
	}
	m.ids.resize(n);
	write(argv[2], m);
	std::printf("%zu\n", n / 3);
	return 0;
}
