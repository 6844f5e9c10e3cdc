#include "populations.hpp"

#include <sys/mman.h>

#include <algorithm>
#include <cstdlib>
#include <new>

namespace estuary::fluid {
namespace {

constexpr std::ptrdiff_t cache_line = 8;  // doubles; half a line of floats
constexpr std::ptrdiff_t page = 512;      // doubles

constexpr std::ptrdiff_t round_up(std::ptrdiff_t value, std::ptrdiff_t unit) {
  return (value + unit - 1) / unit * unit;
}

// Node 0 of each row starts a cache line; the ghost before it lies in the line before.
constexpr std::ptrdiff_t row_pitch(int nx) {
  return round_up(cache_line + nx + 1, cache_line);
}

constexpr std::ptrdiff_t layers(int nz) {
  return nz > 0 ? nz + 2 : 1;
}

// Rows in the plane, planes in space.
int stored_layers(const Grid& grid) {
  return grid.shared() ? grid.past_layer() - grid.first_layer() + 2 * Populations::halo
                       : grid.slab_layers() + 2;
}

// Of all layers that are stored.
std::ptrdiff_t stored_rows(const Grid& grid) {
  return grid.nz > 0 ? std::ptrdiff_t{stored_layers(grid)} * (grid.ny + 2) : stored_layers(grid);
}

// The planes start a ninth (a twenty-first) of a page apart modulo the page, so that values of one node in
// different planes do not compete for the same cache sets.
std::ptrdiff_t plane_size(const Grid& grid) {
  return round_up(stored_rows(grid) * row_pitch(grid.nx), page) + (grid.nz > 0 ? 3 : 7) * cache_line;
}

void* reserve(std::size_t bytes) {
  constexpr std::size_t huge_page = std::size_t{1} << 21;
  const std::size_t alignment = bytes > 4 * huge_page ? huge_page : 4096;
  void* memory = std::aligned_alloc(alignment, (bytes + alignment - 1) / alignment * alignment);
  if (memory == nullptr) throw std::bad_alloc();
  if (alignment == huge_page)
    madvise(memory, bytes, MADV_HUGEPAGE);  // fewer address translations; may be refused
  return memory;
}

}  // namespace

Populations::Populations(int nx, int ny) : Populations(Grid{nx, ny}) {}

Populations::Populations(const Grid& grid, Storage storage)
    : lattice_(lattice_of_dimension(grid.dimension())),
      nx_(grid.nx),
      ny_(grid.ny),
      nz_(grid.nz),
      first_row_(grid.first_row()),
      past_row_(grid.past_row()),
      stored_layers_(stored_layers(grid)),
      pitch_(row_pitch(nx_)),
      layer_((ny_ + 2) * pitch_),
      plane_(plane_size(grid)),
      origin_((nz_ > 0 ? layer_ : 0) + pitch_ + cache_line),
      size_(static_cast<std::size_t>(lattice_.count * plane_)) {
  for (int i = 0; i < lattice_.count; ++i) {
    const auto& c = lattice_.velocity[i];
    steps_[static_cast<std::size_t>(i)] = c[2] * layer_ + c[1] * pitch_ + c[0];
  }
  static_assert(row_start_padding == cache_line);
  // Nodes are counted from the first stored layer, which is not the grid's where ranks share it.
  if (grid.shared()) shift_ = (halo - 1 - grid.first_layer()) * (nz_ > 0 ? layer_ : pitch_);
  origin_ += shift_;
  reserve_memory(storage);
  // Each thread touches first what it will work on.
  const std::ptrdiff_t all_rows = stored_rows(grid);
  visit([&](auto* const values) {
    for (int i = 0; i < lattice_.count; ++i) {
#pragma omp parallel for schedule(static)
      for (std::ptrdiff_t row = 0; row < all_rows; ++row) {
        std::fill_n(values + i * plane_ + row * pitch_, pitch_, 0);
      }
      std::fill_n(values + i * plane_ + all_rows * pitch_, plane_ - all_rows * pitch_, 0);
    }
  });
}

void Populations::reserve_memory(Storage storage) {
  single_.reset();
  double_.reset();
  if (storage == Storage::single_precision) {
    single_.reset(static_cast<float*>(reserve(size_ * sizeof(float))));
  } else {
    double_.reset(static_cast<double*>(reserve(size_ * sizeof(double))));
  }
}

std::ptrdiff_t Populations::held_node(int x, int y, int z) const {
  if (rows() == past_row_ - first_row_) return node(x, y, z);
  // Stored layers follow each other; of the two ways to name a layer beyond a periodic side one lies there.
  int& layer = nz_ > 0 ? z : y;
  const int count = nz_ > 0 ? nz_ : ny_;
  const int first = (nz_ > 0 ? first_row_ / ny_ : first_row_) - halo;
  if (layer < first) layer += count;
  if (layer >= first + stored_layers_) layer -= count;
  return node(x, y, z);
}

Populations::Packing Populations::packing_of(const std::vector<std::uint8_t>& needed) const {
  std::vector<std::int32_t> places(static_cast<std::size_t>(layers(nz_) * (ny_ + 2) * pitch_), -1);
  const bool space = nz_ > 0;
  std::ptrdiff_t next = 0;
  for (int z = space ? -1 : 0; z <= (space ? nz_ : 0); ++z) {
    for (int y = -1; y <= ny_; ++y) {
      // As without packing, node 0 of each row starts a cache line.
      next = round_up(next, cache_line) + cache_line - 1;
      for (int x = -1; x <= nx_; ++x) {
        const bool rim =
            x <= 0 || x >= nx_ - 1 || y <= 0 || y >= ny_ - 1 || (space && (z <= 0 || z >= nz_ - 1));
        const bool holds =
            rim || needed[(static_cast<std::size_t>(space ? z : 0) * static_cast<std::size_t>(ny_) +
                           static_cast<std::size_t>(y)) *
                              static_cast<std::size_t>(nx_) +
                          static_cast<std::size_t>(x)] != 0;
        if (holds)
          places[static_cast<std::size_t>(number_in_grid(node(x, y, z)))] = static_cast<std::int32_t>(next++);
      }
    }
  }
  return {std::move(places), round_up(next, page) + (space ? 3 : 7) * cache_line};
}

void Populations::pack(const std::vector<std::uint8_t>& needed) {
  std::vector<double> before;
  copy_to(before);
  const std::ptrdiff_t plane_before = plane_;
  Packing packing = packing_of(needed);
  const std::vector<std::int32_t>& places = packing.places;
  plane_ = packing.plane;
  size_ = static_cast<std::size_t>(lattice_.count * plane_);
  reserve_memory(storage());
  visit([&](auto* const values) {
    std::fill_n(values, size_, 0);
    for (int i = 0; i < lattice_.count; ++i) {
      for (std::size_t n = 0; n < places.size(); ++n) {
        if (places[n] < 0) continue;
        values[i * plane_ + places[n]] = static_cast<std::remove_cvref_t<decltype(*values)>>(
            before[static_cast<std::size_t>(i * plane_before) + n]);
      }
    }
  });
  places_ = std::move(packing.places);
}

void Populations::copy_to(std::vector<double>& values) const {
  if (single_) {
    values.assign(single_.get(), single_.get() + size_);
  } else {
    values.assign(double_.get(), double_.get() + size_);
  }
}

void Populations::copy_from(std::span<const double> values) {
  visit([&](auto* const to) {
    std::transform(values.begin(), values.end(), to,
                   [](double value) { return static_cast<std::remove_reference_t<decltype(*to)>>(value); });
  });
}

std::ptrdiff_t Populations::plane_of(const Grid& grid) {
  return plane_size(grid);
}

double Populations::memory_bytes(const Grid& grid, Storage storage) {
  const std::size_t bytes = storage == Storage::single_precision ? sizeof(float) : sizeof(double);
  return static_cast<double>(lattice_of_dimension(grid.dimension()).count * plane_size(grid)) *
         static_cast<double>(bytes);
}

void Populations::Release::operator()(void* memory) const {
  std::free(memory);
}

}  // namespace estuary::fluid
