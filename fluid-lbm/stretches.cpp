#include "stretches.hpp"

namespace estuary::fluid {

void Stretches::follow(const Cells& cells, const Populations& populations) {
  if (!populations.packed() || changes_ == cells.changes()) return;
  changes_ = cells.changes();
  stretches_.clear();
  first_of_row_.clear();
  const int reach = populations.nz() > 0 ? 1 : 0;
  for (int row = 0; row < populations.rows(); ++row) {
    first_of_row_.push_back(stretches_.size());
    for (const Span span : cells.row(row)) {
      Stretch& stretch = stretches_.emplace_back();
      stretch.length = span.end - span.begin;
      const std::ptrdiff_t first = populations.row_start(row) + span.begin;
      for (int z = -reach; z <= reach; ++z) {
        for (int y = -1; y <= 1; ++y) {
          stretch.at[3 * (z + 1) + y + 1] = static_cast<std::int32_t>(
              populations.place(first + z * populations.layer() + y * populations.pitch()));
        }
      }
    }
  }
  first_of_row_.push_back(stretches_.size());
  stretches_.emplace_back();  // so that the end of the last row can be pointed at
}

}  // namespace estuary::fluid
