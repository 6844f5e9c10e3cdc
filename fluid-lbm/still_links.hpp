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
#include "row_shares.hpp"
#include "wall_links.hpp"

namespace estuary::fluid {

class StillLinks {
public:
  StillLinks() = default;
  explicit StillLinks(Ranks* ranks) : ranks_(ranks) {}
  void clear();
  /// Rows in ascending order; where ranks share the grid, each adds its own. `arm` goes from where torques
  /// count to the middle of the link.
  void add(Node node, int i, std::uint32_t body, const std::array<double, 3>& arm, const Populations& layout);
  [[nodiscard]] bool empty() const { return links_.empty(); }
  /// Every thread of a parallel region calls it.
  void reflect(Populations& populations, Parity parity) const;
  /// The same for what leaves the nodes in the step that follows `parity`, by a thread that passes over the
  /// rows of `share` and is about to step `row`: rows that neither it nor another thread will touch any more,
  /// while they are in the cache.
  void reflect_behind(Populations& populations, Parity parity, const RowShare& share, int row) const;
  /// And when all threads have stepped their rows.
  void reflect_rest(Populations& populations, Parity parity, const RowShare& share) const;
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

  void reflect_rows(Populations& populations, Parity parity, int begin, int end) const;
  template <class Stored>
  void reflect(Stored* f, Parity parity, std::size_t begin, std::size_t end) const;

  Ranks* ranks_ = nullptr;
  std::vector<Link> links_;
  std::vector<Place> places_;
  std::vector<std::size_t> first_of_row_;  // of rows up to the last with a link
  int reach_ = 0;                          // how many rows away the far end of a link may lie
};

}  // namespace estuary::fluid
