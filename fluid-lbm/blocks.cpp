#include "blocks.hpp"

#include <algorithm>

namespace estuary::fluid {
namespace {

constexpr int blocks_per_group = 32;  // 18 kB of populations in the plane

// Of the eight nodes from `node` on all nodes beside and around have memory.
bool is_open(const Populations& populations, std::ptrdiff_t node) {
  const int reach = populations.nz() > 0 ? 1 : 0;
  for (int z = -reach; z <= reach; ++z) {
    for (int y = -1; y <= 1; ++y) {
      const std::ptrdiff_t row = node + z * populations.layer() + y * populations.pitch();
      for (int x = -1; x <= Blocks::lanes; ++x) {
        if (!populations.holds(row + x)) return false;
      }
    }
  }
  return true;
}

}  // namespace

void Blocks::add_open(const Populations& populations, std::ptrdiff_t node) {
  const int reach = populations.nz() > 0 ? 1 : 0;
  for (int z = -reach; z <= reach; ++z) {
    for (int y = -1; y <= 1; ++y) {
      open_.push_back(static_cast<std::int32_t>(
          populations.place(node + z * populations.layer() + y * populations.pitch())));
    }
  }
}

void Blocks::add_walled(const Populations& populations, std::ptrdiff_t node, int count) {
  const auto nodes = static_cast<std::uint8_t>((1U << count) - 1U);
  const auto own = static_cast<std::int32_t>(populations.place(node));
  for (int i = 0; i < static_cast<int>(directions_); ++i) {
    const std::ptrdiff_t sender = node - populations.step(i);
    std::int32_t first = own;
    unsigned from = 0;
    int senders = 0;
    for (int k = count - 1; k >= 0; --k) {
      if (!populations.holds(sender + k)) continue;
      first = static_cast<std::int32_t>(populations.place(sender + k));
      from |= 1U << k;
      ++senders;
    }
    walled_.push_back(first);
    senders_.push_back({static_cast<std::uint8_t>(from), static_cast<std::uint8_t>((1U << senders) - 1U),
                        static_cast<std::uint8_t>(nodes & ~from)});
  }
}

void Blocks::follow(const Cells& cells, const Populations& populations) {
  if (changes_ == cells.changes()) return;
  changes_ = cells.changes();
  open_.clear();
  walled_.clear();
  senders_.clear();
  stretches_.clear();
  groups_.assign(1, {});
  rows_ = populations.nz() > 0 ? 9 : 3;
  directions_ = static_cast<std::size_t>(populations.lattice().count);
  int blocks = 0;  // of the group
  const auto close_group = [&] {
    groups_.push_back({open_count(), walled_count(), stretches_.size()});
    blocks = 0;
  };
  for (int row = 0; row < populations.rows(); ++row) {
    for (const Span span : cells.row(row)) {
      for (int x = span.begin; x < span.end; x += lanes) {
        const int count = std::min(lanes, span.end - x);
        const std::ptrdiff_t node = populations.row_start(row) + x;
        const auto begin = static_cast<std::int32_t>(populations.place(node));
        if (blocks == 0 || stretches_.back().end != begin) stretches_.push_back({begin, begin});
        stretches_.back().end += count;
        if (count == lanes && is_open(populations, node)) {
          add_open(populations, node);
        } else {
          add_walled(populations, node, count);
        }
        if (++blocks == blocks_per_group) close_group();
      }
    }
  }
  if (blocks > 0) close_group();
}

}  // namespace estuary::fluid
