#include "blocks.hpp"

#include <algorithm>

namespace estuary::fluid {
namespace {

constexpr std::size_t blocks_per_group = 32;  // 18 kB of populations in the plane
constexpr std::uint8_t all_lanes = 0xff;

}  // namespace

void Blocks::close_group(std::vector<Found>& found, std::size_t links_end) {
  const auto full = std::stable_partition(found.begin(), found.end(),
                                          [](const Found& block) { return block.fluid == all_lanes; });
  const Group before = groups_.empty() ? Group{} : groups_.back();
  groups_.push_back({before.end, before.end + static_cast<std::size_t>(full - found.begin()),
                     before.end + found.size(), before.links_end, links_end});
  for (const Found& block : found) {
    places_.insert(places_.end(), block.places, block.places + rows_);
    fluid_.push_back(block.fluid);
  }
  found.clear();
}

void Blocks::follow(const Cells& cells, const Populations& populations, const StillLinks* links) {
  if (changes_ == cells.changes() && links_ == links) return;
  changes_ = cells.changes();
  links_ = links;
  places_.clear();
  fluid_.clear();
  groups_.clear();
  const int reach = populations.nz() > 0 ? 1 : 0;
  rows_ = reach > 0 ? 9 : 3;
  std::vector<Found> found;
  for (int row = 0; row < populations.rows(); ++row) {
    bool first = true;  // the block before is of another row
    for (const Span span : cells.row(row)) {
      for (int x = span.begin; x < span.end;) {
        const std::ptrdiff_t node = populations.row_start(row) + x;
        const std::ptrdiff_t place = populations.place(node);
        const auto lane = static_cast<int>(place % lanes);
        std::int32_t places[9];
        std::size_t entry = 0;
        for (int z = -reach; z <= reach; ++z) {
          for (int y = -1; y <= 1; ++y) {
            const std::ptrdiff_t beside = node + z * populations.layer() + y * populations.pitch();
            places[entry++] = static_cast<std::int32_t>(populations.place(beside) - lane);
          }
        }
        if (first || !std::equal(places, places + rows_, found.back().places)) {
          if (found.size() == blocks_per_group)
            close_group(found, links != nullptr ? links->first_from(place, populations) : 0);
          std::copy_n(places, rows_, found.emplace_back().places);
          first = false;
        }
        const int count = std::min(lanes - lane, span.end - x);
        found.back().fluid |= static_cast<std::uint8_t>(((1U << count) - 1U) << lane);
        x += count;
      }
    }
  }
  if (!found.empty()) close_group(found, links != nullptr ? links->count() : 0);
}

}  // namespace estuary::fluid
