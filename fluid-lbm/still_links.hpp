// Walls at rest half-way on the links to solid nodes, as pictures have them in great numbers: two locations a
// link.
//
// What leaves a fluid node x along i comes back to it (Ladd 1994). With one copy of the populations both
// stand in slot[opposite i](x) and slot[i](x + c_i), and change places with the kind of the step
// (populations.hpp).
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "cells.hpp"
#include "populations.hpp"
#include "wall_links.hpp"

namespace estuary::fluid {

class StillLinks {
public:
  void clear();
  /// Rows in ascending order. `arm` goes from where torques count to the middle of the link.
  void add(Node node, int i, std::uint32_t body, const std::array<double, 3>& arm, const Populations& layout);
  [[nodiscard]] bool empty() const { return links_.empty(); }
  /// Every thread of a parallel region calls it.
  void reflect(Populations& populations, Parity parity) const;
  /// The links of nodes in rows begin <= row < end, by the calling thread alone. A step may do this for a row
  /// just before it passes over it, while the row is in the cache.
  void reflect_rows(Populations& populations, Parity parity, int begin, int end) const;
  /// How many rows away the far end of a link may lie.
  [[nodiscard]] int reach() const { return reach_; }
  /// Momentum exchange, as `reflect` left the populations; on all bodies, or on one.
  [[nodiscard]] BodyLoad load(const Populations& populations, Parity parity) const;
  [[nodiscard]] BodyLoad load(const Populations& populations, Parity parity, std::uint32_t body) const;

private:
  struct Link {
    std::ptrdiff_t at_node = 0;
    std::ptrdiff_t at_neighbour = 0;
  };
  struct Place {
    std::uint32_t body = 0;
    int direction = 0;
    std::array<double, 3> arm{};
  };
  void add_load(const Populations& populations, Parity parity, std::size_t number, BodyLoad& total) const;

  template <class Stored>
  void reflect(Stored* f, Parity parity, std::size_t begin, std::size_t end) const;

  std::vector<Link> links_;
  std::vector<Place> places_;
  std::vector<std::size_t> first_of_row_;  // of rows up to the last with a link
  int reach_ = 0;
};

}  // namespace estuary::fluid
