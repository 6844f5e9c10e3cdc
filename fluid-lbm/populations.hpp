// The populations: one copy, updated in place by the AA pattern.
//
// Source: Bailey, Myre, Walsh, Lilja, Saar, "Accelerating lattice Boltzmann fluid flow simulations using
// graphics processors", ICPP 2009. Steps of two kinds alternate. An even step reads the values of a node
// and puts them back, exchanged with their opposites; an odd step gathers from the neighbours and scatters to
// them. Both touch each memory location from one node only, so nodes can be updated in any order and in
// parallel.
//
//                                                    after an even step        after an odd step
//   population that left x along i (post-collision)  slot[opposite i](x)       slot[i](x + c_i)
//   population that reaches x along i (incoming)     slot[opposite i](x - c_i) slot[i](x)
//
// Every boundary rule reads post-collision values and writes incoming ones and is written against the two
// functions `post_collision` and `incoming`. What a rule writes for a link to a node that is no fluid is a
// place that no fluid node's post-collision value occupies, so rules can be applied in any order, and twice.
//
// Beyond a node without memory (`pack`) stands a wall at rest half-way: what left towards it is what reaches
// the node from it, one value, slot[opposite i](x) after either kind of step. Nothing has to reflect it.
//
// What is stored is the difference to the fluid at rest, f_i - w_i (reference density 1): it keeps the digits
// that carry the flow when the Mach number is small, and makes every pressure a gauge pressure.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <type_traits>
#include <utility>
#include <vector>

#include "grid.hpp"
#include "lattice.hpp"

namespace estuary::fluid {

/// Which kind of step was done last. A new state counts as `odd`: each population stands at its own node.
enum class Parity { even, odd };
constexpr std::array<Parity, 2> parities{Parity::even, Parity::odd};

/// For pairs of things of which one is for even steps.
constexpr std::size_t index_of(Parity parity) {
  return parity == Parity::even ? 0 : 1;
}

/// How a population is kept in memory and collided: in single precision half the bytes move, and twice as
/// many nodes share a vector register; f_i - w_i has 24 bits. Boundary rules compute in double precision.
enum class Storage { double_precision, single_precision };

class Populations {
public:
  /// Nodes of the grid at rest, with one layer of ghost nodes around them; D2Q9 or D3Q19 by the grid's
  /// dimension. Throws std::bad_alloc.
  explicit Populations(const Grid& grid, Storage storage = Storage::double_precision);
  /// In two dimensions.
  Populations(int nx, int ny);

  [[nodiscard]] int nx() const { return nx_; }
  [[nodiscard]] int ny() const { return ny_; }
  [[nodiscard]] int nz() const { return nz_; }
  /// Rows of nodes along x: row y + ny z.
  [[nodiscard]] int rows() const { return nz_ > 0 ? ny_ * nz_ : ny_; }
  /// Those of this process, begin <= row < end: all, unless several share the grid. Of the others there is no
  /// memory, but for `halo` layers on both sides; numbers of nodes and rows count through the whole grid.
  [[nodiscard]] int first_row() const { return first_row_; }
  [[nodiscard]] int past_row() const { return past_row_; }
  static constexpr int halo = 2;
  [[nodiscard]] bool owns(int y, int z = 0) const {
    const int row = nz_ > 0 ? z * ny_ + y : y;
    return row >= first_row_ && row < past_row_;
  }
  /// The node's number where this process holds it, as one of its own or in its halo, which may lie beyond a
  /// periodic side.
  [[nodiscard]] std::ptrdiff_t held_node(int x, int y, int z = 0) const;
  /// The number that the node has in a process which holds the whole grid.
  [[nodiscard]] std::ptrdiff_t number_in_grid(std::ptrdiff_t node) const { return node - shift_; }
  /// What a layer (a row in the plane, a plane in space) takes of one population's values, ghosts included.
  [[nodiscard]] std::ptrdiff_t layer_start(int layer) const {
    return nz_ > 0 ? node(0, -1, layer) - row_start_padding : node(0, layer) - row_start_padding;
  }
  [[nodiscard]] std::ptrdiff_t layer_size() const { return nz_ > 0 ? layer_ : pitch_; }
  [[nodiscard]] const LatticeTable& lattice() const { return lattice_; }
  [[nodiscard]] Parity parity() const { return parity_; }
  void set_parity(Parity parity) { parity_ = parity; }

  /// Number of node (x, y, z) inside a plane; ghost nodes have x = -1 or nx, y = -1 or ny, z = -1 or nz.
  [[nodiscard]] std::ptrdiff_t node(int x, int y, int z = 0) const {
    return origin_ + z * layer_ + y * pitch_ + x;
  }
  /// Of the first node of a row.
  [[nodiscard]] std::ptrdiff_t row_start(int row) const {
    return nz_ > 0 ? node(0, row % ny_, row / ny_) : node(0, row);
  }
  [[nodiscard]] std::ptrdiff_t pitch() const { return pitch_; }
  [[nodiscard]] std::ptrdiff_t layer() const { return layer_; }
  /// How far the neighbour along direction i lies in a plane.
  [[nodiscard]] std::ptrdiff_t step(int i) const { return steps_[static_cast<std::size_t>(i)]; }
  /// Where a node stands in each plane; the planes are `plane` values apart.
  [[nodiscard]] std::ptrdiff_t place(std::ptrdiff_t node) const {
    return places_.empty() ? node : places_[static_cast<std::size_t>(node)];
  }
  [[nodiscard]] std::ptrdiff_t plane() const { return plane_; }
  [[nodiscard]] std::ptrdiff_t slot(int i, std::ptrdiff_t node) const { return i * plane_ + place(node); }

  /// Places of nodes in a plane of packed memory, -1 without memory, and a plane's length.
  struct Packing {
    std::vector<std::int32_t> places;
    std::ptrdiff_t plane = 0;
  };
  /// Of a grid that this process holds alone, whatever this one's memory is like.
  [[nodiscard]] Packing packing_of(const std::vector<std::uint8_t>& needed) const;
  /// Gives up the memory of the nodes that never will be fluid nor an end of a link that some rule writes to:
  /// `needed` says so of each node (Grid::index). Nodes of the grid's outermost layer keep theirs. The nodes
  /// of a row that are left follow each other without gaps. Slots learned before are worth nothing
  /// afterwards.
  void pack(const std::vector<std::uint8_t>& needed);
  /// Places of neighbours in different rows are then at no constant distances.
  [[nodiscard]] bool packed() const { return !places_.empty(); }
  /// Whether the node has memory.
  [[nodiscard]] bool holds(std::ptrdiff_t node) const {
    return places_.empty() || places_[static_cast<std::size_t>(node)] >= 0;
  }

  [[nodiscard]] std::ptrdiff_t post_collision(Parity parity, int i, std::ptrdiff_t node) const {
    if (parity == Parity::even || !holds(node + step(i))) return slot(opposite(i), node);
    return slot(i, node + step(i));
  }
  [[nodiscard]] std::ptrdiff_t incoming(Parity parity, int i, std::ptrdiff_t node) const {
    if (parity == Parity::odd || !holds(node - step(i))) return slot(i, node);
    return slot(opposite(i), node - step(i));
  }

  /// A population, wherever it is kept.
  class Reference {
  public:
    Reference(Populations& of, std::ptrdiff_t location) : of_(of), location_(location) {}
    operator double() const { return std::as_const(of_)[location_]; }  // stands for a double
    void operator=(double value) const { of_.set(location_, value); }
    void operator+=(double value) const { of_.set(location_, std::as_const(of_)[location_] + value); }
    void operator-=(double value) const { of_.set(location_, std::as_const(of_)[location_] - value); }

  private:
    Populations& of_;
    std::ptrdiff_t location_;
  };
  [[nodiscard]] Reference operator[](std::ptrdiff_t location) { return {*this, location}; }
  [[nodiscard]] double operator[](std::ptrdiff_t location) const {
    return single_ ? static_cast<double>(single_.get()[location]) : double_.get()[location];
  }
  void set(std::ptrdiff_t location, double value) {
    if (single_) {
      single_.get()[location] = static_cast<float>(value);
    } else {
      double_.get()[location] = value;
    }
  }
  [[nodiscard]] Storage storage() const {
    return single_ ? Storage::single_precision : Storage::double_precision;
  }
  /// The whole array, null when populations are kept the other way.
  template <class Stored>
  [[nodiscard]] Stored* data() {
    if constexpr (std::is_same_v<Stored, float>) {
      return single_.get();
    } else {
      return double_.get();
    }
  }
  /// Calls `body` with the array, a pointer to float or double.
  template <class Body>
  void visit(Body&& body) {
    if (single_) {
      body(single_.get());
    } else {
      body(double_.get());
    }
  }
  /// All values, ghosts and padding included: what a copy or a checkpoint has to hold besides the parity.
  void copy_to(std::vector<double>& values) const;
  /// What `copy_to` gave.
  void copy_from(std::span<const double> values);
  [[nodiscard]] std::size_t size() const { return size_; }
  /// Values of one population, before anything is packed.
  [[nodiscard]] static std::ptrdiff_t plane_of(const Grid& grid);
  [[nodiscard]] static double memory_bytes(const Grid& grid, Storage storage = Storage::double_precision);

private:
  static constexpr std::ptrdiff_t row_start_padding = 8;  // values before node 0 of a row
  struct Release {
    void operator()(void* memory) const;
  };
  [[nodiscard]] int opposite(int i) const { return lattice_.opposite[i]; }
  void reserve_memory(Storage storage);

  LatticeTable lattice_;
  int nx_;
  int ny_;
  int nz_;
  int first_row_;
  int past_row_;
  int stored_layers_;  // ghosts or halos included
  std::ptrdiff_t pitch_;
  std::ptrdiff_t layer_;
  std::ptrdiff_t plane_;
  std::ptrdiff_t origin_;
  std::ptrdiff_t shift_ = 0;  // of it, because the first stored layer is not the grid's first
  std::size_t size_;
  std::array<std::ptrdiff_t, most_velocities> steps_{};
  std::vector<std::int32_t> places_;         // of each node inside a plane when packed, -1 without memory
  std::unique_ptr<double, Release> double_;  // one of these
  std::unique_ptr<float, Release> single_;
  Parity parity_ = Parity::odd;
};

}  // namespace estuary::fluid
