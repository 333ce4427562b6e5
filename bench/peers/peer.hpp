// What the peer programs share: a mesh of float triangles in and out of PLY, a clock, a report,
// failing. Every program is called as NAME IN.ply OUT.ply FACES|P% [METHOD] and prints one line of
// JSON with the seconds of loading (until the library's own mesh stands), simplifying and saving.
#ifndef WHITTLE_BENCH_PEER_HPP
#define WHITTLE_BENCH_PEER_HPP

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>

namespace peer
{

// An array that is not filled with zeros first: what is read from a file is written once.
template <typename T>
class Buffer
{
      public:
	Buffer() = default;
	explicit Buffer(std::size_t n) : data_(new T[n]), size_(n)
	{
	}
	T *data()
	{
		return data_.get();
	}
	const T *data() const
	{
		return data_.get();
	}
	std::size_t size() const
	{
		return size_;
	}
	// Forgets the end.
	void shrink(std::size_t n)
	{
		size_ = n;
	}
	T &operator[](std::size_t i)
	{
		return data_[i];
	}
	const T &operator[](std::size_t i) const
	{
		return data_[i];
	}

      private:
	std::unique_ptr<T[]> data_;
	std::size_t size_ = 0;
};

struct Mesh {
	Buffer<float> xyz;         // three a vertex
	Buffer<std::uint32_t> ids; // three a face
	std::size_t degenerate = 0;

	std::size_t vertices() const
	{
		return xyz.size() / 3;
	}
	std::size_t faces() const
	{
		return ids.size() / 3;
	}
};

[[noreturn]] void fail(const std::string &text);

// Reads triangles; ones with a repeated corner are left out and counted. Binary little-endian
// files of float positions and nothing else go through a reader of one pass that is bound by
// memory, others through CGAL's, where the programs were built with CGAL.
Mesh read(const std::string &path);

// Writes the first nv vertices and nf faces given, binary little endian.
void write(const std::string &path, const float *xyz, std::size_t nv, const std::uint32_t *ids,
           std::size_t nf);

// A count of faces, or of the input's faces with a percent sign.
std::size_t parse_target(const char *text, std::size_t faces);

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

struct Report {
	std::string library, version;
	std::size_t faces_in, faces_out;
	double load, simplify, save;
};

void print(const Report &r);

} // namespace peer

#endif
