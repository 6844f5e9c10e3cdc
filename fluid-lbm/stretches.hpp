// Where the runs of fluid nodes stand in packed memory (Populations::pack), one after the other in the order
// in which a step needs them: asking for the places node by node would fetch a table as long as the grid.
#pragma once

#include <cstdint>
#include <vector>

#include "cells.hpp"
#include "populations.hpp"

namespace estuary::fluid {

class Stretches {
public:
  /// Finds the runs anew when cells have changed; does nothing unless memory is packed.
  void follow(const Cells& cells, const Populations& populations);

  /// Places of a stretch's first node and of the nodes beside it, in rows y + dy, z + dz: entry 3 (dz + 1) +
  /// dy
  /// + 1, of which the plane has the middle three.
  struct Stretch {
    std::int32_t length = 0;
    std::int32_t at[9] = {};
  };
  [[nodiscard]] const Stretch* begin(int row) const {
    return &stretches_[first_of_row_[static_cast<std::size_t>(row)]];
  }
  [[nodiscard]] const Stretch* end(int row) const { return begin(row + 1); }

private:
  std::uint64_t changes_ = 0;
  std::vector<Stretch> stretches_;
  std::vector<std::size_t> first_of_row_;  // and one past the last
};

}  // namespace estuary::fluid
