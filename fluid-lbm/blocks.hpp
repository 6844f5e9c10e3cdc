// Fluid nodes among many solid ones, eight places of memory at a time: what a step passes over where runs of
// fluid nodes are short, without a branch that depends on how long they are.
//
// A block is eight places that follow each other (in each population a cache line in double precision, half
// of one in single) and says which of them are fluid nodes; the nodes of a block have their neighbours at the
// same distances. Walls at rest half-way on the links (still_links.hpp) are
// part of the pass, and only of odd steps: what left the nodes stands at the nodes after an even step, where
// the next odd step would find it if the wall were not looked for beyond the link; it is put there before the
// nodes are stepped, and what leaves them then is taken back from there.
#pragma once

#include <cstdint>
#include <vector>

#include "cells.hpp"
#include "populations.hpp"
#include "still_links.hpp"

namespace estuary::fluid {

class Blocks {
public:
  static constexpr int lanes = 8;

  /// Finds the blocks anew when cells or `links`, which may be null, are others than before. Links stay as
  /// they are while cells do not change, and outlive the blocks.
  void follow(const Cells& cells, const Populations& populations, const StillLinks* links);

  /// Place of lane 0 in the row itself and in the rows beside it, y + dy, z + dz: entry 3 (dz + 1) + dy + 1,
  /// in the plane dy + 1.
  [[nodiscard]] const std::int32_t* places(std::size_t block) const { return &places_[block * rows_]; }
  /// Bits of the lanes that are fluid.
  [[nodiscard]] unsigned fluid(std::size_t block) const { return fluid_[block]; }
  [[nodiscard]] std::size_t count() const { return fluid_.size(); }

  /// Blocks begin <= n < end, which lie near each other, all lanes being fluid up to `full`, and the links of
  /// their nodes.
  struct Group {
    std::size_t begin = 0;
    std::size_t full = 0;
    std::size_t end = 0;
    std::size_t links_begin = 0;
    std::size_t links_end = 0;
  };
  /// Of equal length but for the last.
  [[nodiscard]] const std::vector<Group>& groups() const { return groups_; }
  [[nodiscard]] const StillLinks* links() const { return links_; }

private:
  struct Found {
    std::int32_t places[9] = {};
    std::uint8_t fluid = 0;
  };
  void close_group(std::vector<Found>& found, std::size_t links_end);

  std::uint64_t changes_ = 0;
  const StillLinks* links_ = nullptr;
  std::size_t rows_ = 3;
  std::vector<std::int32_t> places_;
  std::vector<std::uint8_t> fluid_;
  std::vector<Group> groups_;
};

}  // namespace estuary::fluid
