// Fluid nodes in packed memory (Populations::pack), among pores: what a step passes over instead of rows.
//
// After an odd step every population stands at its node, and an even step passes straight over the memory, a
// stretch at a time, without knowing where anything lies. The step after it takes blocks: eight nodes (at the
// end of a run fewer) that follow each other in a row, hence in memory. So do the nodes beside them in
// another row, but for those that have no memory. Where there are none of these a block is open, and its
// nodes have their neighbours at the same distances. Elsewhere it says which of its nodes have one, and
// beyond the others stands a wall, whose populations are the node's own (populations.hpp): links need no pass
// of their own.
#pragma once

#include <cstdint>
#include <vector>

#include "cells.hpp"
#include "populations.hpp"

namespace estuary::fluid {

class Blocks {
public:
  static constexpr int lanes = 8;

  /// Finds the blocks anew when cells are others than before. `populations` are packed.
  void follow(const Cells& cells, const Populations& populations);

  /// Of an open block: the place of its first node, entry 3 (dz + 1) + dy + 1 (in the plane dy + 1) for
  /// dy = dz = 0, and of the nodes beside it in the rows y + dy, z + dz.
  [[nodiscard]] const std::int32_t* open(std::size_t block) const { return &open_[block * rows_]; }
  [[nodiscard]] std::size_t open_count() const { return open_.size() / rows_; }

  /// Which lanes a population comes to from a node and from a wall. Those nodes follow each other in memory.
  struct Senders {
    std::uint8_t nodes = 0;
    std::uint8_t first = 0;  // as many lanes, the first ones
    std::uint8_t walls = 0;
  };
  /// Of any other block, for each direction: where the first node stands that sends along it. Entry 0 is the
  /// place of the block's first node.
  [[nodiscard]] const std::int32_t* walled(std::size_t block) const { return &walled_[block * directions_]; }
  [[nodiscard]] const Senders* senders(std::size_t block) const { return &senders_[block * directions_]; }
  [[nodiscard]] std::size_t walled_count() const { return walled_.size() / directions_; }

  /// Places begin <= n < end, all of fluid nodes.
  struct Stretch {
    std::int32_t begin = 0;
    std::int32_t end = 0;
  };
  [[nodiscard]] const Stretch& stretch(std::size_t number) const { return stretches_[number]; }

  /// Blocks near each other, and the same nodes as stretches: from the end of the group before on.
  struct Group {
    std::size_t open_end = 0;
    std::size_t walled_end = 0;
    std::size_t stretches_end = 0;
  };
  /// Of equal length but for the last.
  [[nodiscard]] std::size_t group_count() const { return groups_.size() - 1; }
  [[nodiscard]] const Group& before(std::size_t group) const { return groups_[group]; }
  [[nodiscard]] const Group& group(std::size_t group) const { return groups_[group + 1]; }

private:
  void add_open(const Populations& populations, std::ptrdiff_t node);
  void add_walled(const Populations& populations, std::ptrdiff_t node, int count);

  std::uint64_t changes_ = 0;
  std::size_t rows_ = 3;
  std::size_t directions_ = 9;
  std::vector<std::int32_t> open_;
  std::vector<std::int32_t> walled_;
  std::vector<Senders> senders_;
  std::vector<Stretch> stretches_;
  std::vector<Group> groups_{{}};
};

}  // namespace estuary::fluid
