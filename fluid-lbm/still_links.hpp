// Walls at rest half-way on the links to solid nodes, as pictures have them in great numbers: two locations a
// link.
//
// What leaves a fluid node x along i comes back to it (Ladd 1994). With one copy of the populations both
// stand in slot[opposite i](x) and slot[i](x + c_i), and change places with the kind of the step; or, where
// the solid node has no memory, both in the first, and nothing is to be done (populations.hpp).
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
  StillLinks() = default;
  explicit StillLinks(Ranks* ranks) : ranks_(ranks) {}
  void clear();
  /// Nodes in the order of rows and of x; where ranks share the grid, each adds its own. `arm` goes from
  /// where torques count to the middle of the link.
  void add(Node node, int i, std::uint32_t body, const std::array<double, 3>& arm, const Populations& layout);
  [[nodiscard]] bool empty() const { return links_.empty(); }
  /// Every thread of a parallel region calls it.
  void reflect(Populations& populations, Parity parity) const;
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

  Ranks* ranks_ = nullptr;
  std::vector<Link> links_;
  std::vector<Link> apart_;  // where some solid nodes have no memory, those to reflect
  std::vector<Place> places_;
};

}  // namespace estuary::fluid
