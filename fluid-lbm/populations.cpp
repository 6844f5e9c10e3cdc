#include "populations.hpp"

#include <sys/mman.h>

#include <algorithm>
#include <cstdlib>
#include <new>

namespace estuary::fluid {
namespace {

constexpr std::ptrdiff_t cache_line = 8;  // doubles
constexpr std::ptrdiff_t page = 512;      // doubles

constexpr std::ptrdiff_t round_up(std::ptrdiff_t value, std::ptrdiff_t unit) {
  return (value + unit - 1) / unit * unit;
}

// Node 0 of each row starts a cache line; the ghost before it lies in the line before.
constexpr std::ptrdiff_t row_pitch(int nx) {
  return round_up(cache_line + nx + 1, cache_line);
}

// The nine planes start 448 bytes apart modulo the page, a ninth of it, so that values of one node in
// different planes do not compete for the same cache sets.
constexpr std::ptrdiff_t plane_size(int nx, int ny) {
  return round_up((ny + 2) * row_pitch(nx) + 2 * cache_line, page) + 7 * cache_line;
}

}  // namespace

Populations::Populations(int nx, int ny)
    : nx_(nx),
      ny_(ny),
      pitch_(row_pitch(nx)),
      plane_(plane_size(nx, ny)),
      origin_(pitch_ + cache_line),
      size_(static_cast<std::size_t>(Lattice::count * plane_)) {
  constexpr std::size_t huge_page = std::size_t{1} << 21;
  const std::size_t bytes = size_ * sizeof(double);
  const std::size_t alignment = bytes > 4 * huge_page ? huge_page : 4096;
  void* memory = std::aligned_alloc(alignment, (bytes + alignment - 1) / alignment * alignment);
  if (memory == nullptr) throw std::bad_alloc();
  if (alignment == huge_page)
    madvise(memory, bytes, MADV_HUGEPAGE);  // fewer address translations; may be refused
  data_.reset(static_cast<double*>(memory));
  double* values = data_.get();
  // Each thread touches first what it will work on.
  for (int i = 0; i < Lattice::count; ++i) {
#pragma omp parallel for schedule(static)
    for (int y = -1; y <= ny_; ++y) {
      std::fill_n(values + i * plane_ + (y + 1) * pitch_, pitch_, 0.0);
    }
    const std::ptrdiff_t rows = (ny_ + 2) * pitch_;
    std::fill_n(values + i * plane_ + rows, plane_ - rows, 0.0);
  }
}

double Populations::memory_bytes(int nx, int ny) {
  return static_cast<double>(Lattice::count * plane_size(nx, ny)) * sizeof(double);
}

void Populations::Release::operator()(double* memory) const {
  std::free(memory);
}

}  // namespace estuary::fluid
