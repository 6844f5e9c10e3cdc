#include "cells.hpp"

#include <algorithm>

namespace estuary::fluid {
namespace {

std::size_t list_of(std::uint8_t reason) {
  return reason == cell_obstacle ? 0 : (reason == cell_wet_solid ? 1 : 2);
}

}  // namespace

Cells::Cells(const Grid& grid)
    : grid_(grid),
      states_(static_cast<std::size_t>(grid.nx + 2) * static_cast<std::size_t>(grid.ny + 2) *
                  static_cast<std::size_t>(grid.nz > 0 ? grid.nz + 2 : 1),
              cell_outside),
      rows_(static_cast<std::size_t>(grid.rows())) {
  for (auto& of_reason : solid_) of_reason.resize(rows_.size());
  for (int z = 0; z < grid.layers(); ++z) {
    for (int y = 0; y < grid.ny; ++y) {
      for (int x = 0; x < grid.nx; ++x) set(x, y, z, cell_fluid);
    }
  }
  for (auto& row : rows_) row = {{0, grid.nx}};
}

std::size_t Cells::fluid_count() const {
  std::size_t count = 0;
  for (const auto& row : rows_) {
    for (const Span span : row) count += static_cast<std::size_t>(span.end - span.begin);
  }
  return count;
}

void Cells::set(int x, int y, int z, std::uint8_t state) {
  const auto image = [](bool periodic, int at, int count) {
    return !periodic ? at : (at == 0 ? count : (at == count - 1 ? -1 : at));
  };
  const int image_x = image(grid_.periodic_x, x, grid_.nx);
  const int image_y = image(grid_.periodic_y, y, grid_.ny);
  const int image_z = image(grid_.periodic_z, z, grid_.nz);
  for (const int k : {z, image_z}) {
    for (const int j : {y, image_y}) {
      states_[place(x, j, k)] = state;
      states_[place(image_x, j, k)] = state;
      if (image_z == z && image_y == y) return;
    }
  }
}

std::size_t Cells::set_solid(int row, std::uint8_t reason, const std::vector<Span>& solid,
                             std::vector<Node>& uncovered) {
  auto& known = solid_[list_of(reason)][static_cast<std::size_t>(row)];
  const int y = row % grid_.ny;
  const int z = row / grid_.ny;
  if (known == solid) return 0;
  std::size_t covered = 0;
  // Walks both lists of runs at once, from one change of either to the next, and touches only what differs.
  std::size_t old_run = 0;
  std::size_t new_run = 0;
  int x = 0;
  while (x < grid_.nx) {
    while (old_run < known.size() && known[old_run].end <= x) ++old_run;
    while (new_run < solid.size() && solid[new_run].end <= x) ++new_run;
    const auto inside = [x](const std::vector<Span>& runs, std::size_t run) {
      return run < runs.size() && runs[run].begin <= x;
    };
    const auto change = [this, x](const std::vector<Span>& runs, std::size_t run) {
      if (run == runs.size()) return grid_.nx;
      return runs[run].begin > x ? runs[run].begin : runs[run].end;
    };
    const bool was = inside(known, old_run);
    const bool is = inside(solid, new_run);
    const int next = std::min({grid_.nx, change(known, old_run), change(solid, new_run)});
    if (was != is) {
      for (; x < next; ++x) {
        const std::uint8_t before = state(x, y, z);
        const auto after = static_cast<std::uint8_t>(is ? before | reason : before & ~reason);
        set(x, y, z, after);
        if (before == cell_fluid) ++covered;
        if (after == cell_fluid) uncovered.push_back({x, y, z});
      }
    }
    x = next;
  }
  known = solid;
  rebuild_row(row);
  return covered;
}

void Cells::rebuild_row(int number) {
  ++changes_;
  auto& row = rows_[static_cast<std::size_t>(number)];
  row.clear();
  std::array<std::size_t, 3> next{};
  int x = 0;  // everything before it is sorted out
  while (true) {
    // The run that begins first among those not yet taken.
    const Span* first = nullptr;
    std::size_t taken = 0;
    for (std::size_t list = 0; list < solid_.size(); ++list) {
      const auto& runs = solid_[list][static_cast<std::size_t>(number)];
      if (next[list] < runs.size() && (first == nullptr || runs[next[list]].begin < first->begin)) {
        first = &runs[next[list]];
        taken = list;
      }
    }
    if (first == nullptr) break;
    ++next[taken];
    if (first->begin > x) row.push_back({x, first->begin});
    x = std::max(x, first->end);
  }
  if (x < grid_.nx) row.push_back({x, grid_.nx});
}

}  // namespace estuary::fluid
