#include "peer.hpp"

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <vector>

#ifdef PEER_CGAL
#include "soup.hpp"
#endif

namespace peer
{

constexpr std::size_t face_bytes = 1 + 3 * sizeof(std::uint32_t);
constexpr std::size_t chunk_faces = 65536;

using File = std::unique_ptr<std::FILE, int (*)(std::FILE *)>;

void fail(const std::string &text)
{
	std::fprintf(stderr, "%s\n", text.c_str());
	std::exit(1);
}

static File open_file(const std::string &path, const char *mode)
{
	File f(std::fopen(path.c_str(), mode), std::fclose);
	if (!f)
		fail(path + ": cannot be opened");
	return f;
}

struct Counts {
	std::size_t vertices = 0, faces = 0;
};

// The next line of a header that is no comment, without its end.
static bool next_line(std::FILE *f, std::string &line)
{
	char text[512];
	do {
		if (!std::fgets(text, sizeof text, f))
			return false;
		line = text;
		line.erase(line.find_last_not_of("\r\n") + 1);
	} while (line.rfind("comment", 0) == 0 || line.rfind("obj_info", 0) == 0);
	return true;
}

static bool is_one_of(const std::string &s, std::initializer_list<const char *> names)
{
	return std::find(names.begin(), names.end(), s) != names.end();
}

// Reads a header up to the body; false where the file is of another dialect than the plain one.
static bool read_plain_header(std::FILE *f, Counts &n)
{
	std::string line;
	const auto is = [&](const char *text) { return next_line(f, line) && line == text; };
	if (!is("ply") || !is("format binary_little_endian 1.0"))
		return false;
	if (!next_line(f, line) ||
	    std::sscanf(line.c_str(), "element vertex %zu", &n.vertices) != 1)
		return false;
	if (!is("property float x") || !is("property float y") || !is("property float z"))
		return false;
	if (!next_line(f, line) || std::sscanf(line.c_str(), "element face %zu", &n.faces) != 1)
		return false;
	if (!next_line(f, line) || !is_one_of(line, {"property list uchar int vertex_indices",
	                                             "property list uchar uint vertex_indices",
	                                             "property list uchar int vertex_index",
	                                             "property list uchar uint vertex_index"}))
		return false;
	return is("end_header");
}

// Takes over n faces in file form, but for degenerate ones; false where one is no triangle.
static bool take_faces(const unsigned char *bytes, std::size_t n, std::uint32_t *&to,
                       std::size_t &degenerate)
{
	for (std::size_t i = 0; i < n; i++, bytes += face_bytes) {
		if (bytes[0] != 3)
			return false;
		std::memcpy(to, bytes + 1, 3 * sizeof *to);
		if (to[0] == to[1] || to[1] == to[2] || to[2] == to[0])
			degenerate++;
		else
			to += 3;
	}
	return true;
}

// False where the file is of another dialect.
static bool read_plain(const std::string &path, Mesh &m)
{
	const File f = open_file(path, "rb");
	Counts n;
	if (!read_plain_header(f.get(), n))
		return false;
	m.xyz = Buffer<float>(3 * n.vertices);
	m.ids = Buffer<std::uint32_t>(3 * n.faces);
	m.degenerate = 0;
	if (std::fread(m.xyz.data(), 3 * sizeof(float), n.vertices, f.get()) != n.vertices)
		fail(path + ": ends early");
	Buffer<unsigned char> chunk(chunk_faces * face_bytes);
	std::uint32_t *to = m.ids.data();
	for (std::size_t done = 0; done < n.faces;) {
		const std::size_t now = std::min(chunk_faces, n.faces - done);
		if (std::fread(chunk.data(), face_bytes, now, f.get()) != now)
			fail(path + ": ends early");
		if (!take_faces(chunk.data(), now, to, m.degenerate))
			return false;
		done += now;
	}
	m.ids.shrink(static_cast<std::size_t>(to - m.ids.data()));
	return true;
}

#ifdef PEER_CGAL
static Mesh read_other(const std::string &path)
{
	Mesh m;
	const Soup s = read_soup(path, m.degenerate);
	m.xyz = Buffer<float>(3 * s.points.size());
	m.ids = Buffer<std::uint32_t>(3 * s.triangles.size());
	float *x = m.xyz.data();
	for (const auto &p : s.points)
		for (int k = 0; k < 3; k++)
			*x++ = static_cast<float>(p[k]);
	std::uint32_t *id = m.ids.data();
	for (const auto &t : s.triangles)
		for (const std::size_t v : t)
			*id++ = static_cast<std::uint32_t>(v);
	return m;
}
#else
static Mesh read_other(const std::string &path)
{
	fail(path + ": not plain binary float triangles; build the peers with CGAL to read it");
}
#endif

Mesh read(const std::string &path)
{
	Mesh m;
	return read_plain(path, m) ? std::move(m) : read_other(path);
}

void write(const std::string &path, const float *xyz, std::size_t nv, const std::uint32_t *ids,
           std::size_t nf)
{
	const File f = open_file(path, "wb");
	std::fprintf(f.get(),
	             "ply\nformat binary_little_endian 1.0\nelement vertex %zu\nproperty float x\n"
	             "property float y\nproperty float z\nelement face %zu\n"
	             "property list uchar int vertex_indices\nend_header\n",
	             nv, nf);
	std::fwrite(xyz, 3 * sizeof *xyz, nv, f.get());
	Buffer<unsigned char> chunk(chunk_faces * face_bytes);
	for (std::size_t done = 0; done < nf;) {
		const std::size_t now = std::min(chunk_faces, nf - done);
		unsigned char *at = chunk.data();
		for (std::size_t i = 0; i < now; i++, ids += 3, at += face_bytes) {
			at[0] = 3;
			std::memcpy(at + 1, ids, 3 * sizeof *ids);
		}
		std::fwrite(chunk.data(), face_bytes, now, f.get());
		done += now;
	}
	if (std::fflush(f.get()) != 0 || std::ferror(f.get()))
		fail(path + ": cannot be written");
}

std::size_t parse_target(const char *text, std::size_t faces)
{
	char *end = nullptr;
	const double x = std::strtod(text, &end);
	if (end == text || x < 0)
		fail(std::string("not a number of faces: ") + text);
	return static_cast<std::size_t>(*end == '%' ? x / 100 * static_cast<double>(faces) : x);
}

void print(const Report &r)
{
	std::printf(
	    "{\"library\": \"%s\", \"version\": \"%s\", \"faces_in\": %zu, \"faces_out\": %zu, "
	    "\"load\": %.4f, \"simplify\": %.4f, \"save\": %.4f}\n",
	    r.library.c_str(), r.version.c_str(), r.faces_in, r.faces_out, r.load, r.simplify,
	    r.save);
}

} // namespace peer
