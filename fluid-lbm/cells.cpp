#include "cells.hpp"

#include <algorithm>

namespace estuary::fluid {

Cells::Cells(const Grid& grid)
    : grid_(grid),
      states_(static_cast<std::size_t>(grid.nx + 2) * static_cast<std::size_t>(grid.ny + 2), cell_outside),
      rows_(static_cast<std::size_t>(grid.ny)),
      obstacle_(static_cast<std::size_t>(grid.ny)),
      wet_solid_(static_cast<std::size_t>(grid.ny)) {
  for (int y = 0; y < grid.ny; ++y) {
    for (int x = 0; x < grid.nx; ++x) set(x, y, cell_fluid);
    rows_[static_cast<std::size_t>(y)] = {{0, grid.nx}};
  }
}

std::size_t Cells::fluid_count() const {
  std::size_t count = 0;
  for (const auto& row : rows_) {
    for (const Span span : row) count += static_cast<std::size_t>(span.end - span.begin);
  }
  return count;
}

void Cells::set(int x, int y, std::uint8_t state) {
  states_[place(x, y)] = state;
  const int ghost_x = !grid_.periodic_x ? x : (x == 0 ? grid_.nx : (x == grid_.nx - 1 ? -1 : x));
  const int ghost_y = !grid_.periodic_y ? y : (y == 0 ? grid_.ny : (y == grid_.ny - 1 ? -1 : y));
  if (ghost_x != x) states_[place(ghost_x, y)] = state;
  if (ghost_y != y) states_[place(x, ghost_y)] = state;
  if (ghost_x != x && ghost_y != y) states_[place(ghost_x, ghost_y)] = state;
}

std::size_t Cells::set_solid(int y, std::uint8_t reason, const std::vector<Span>& solid,
                             std::vector<Node>& uncovered) {
  auto& known = (reason == cell_obstacle ? obstacle_ : wet_solid_)[static_cast<std::size_t>(y)];
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
        const std::uint8_t before = state(x, y);
        const auto after = static_cast<std::uint8_t>(is ? before | reason : before & ~reason);
        set(x, y, after);
        if (before == cell_fluid) ++covered;
        if (after == cell_fluid) uncovered.push_back({x, y});
      }
    }
    x = next;
  }
  known = solid;
  rebuild_row(y);
  return covered;
}

void Cells::rebuild_row(int y) {
  auto& row = rows_[static_cast<std::size_t>(y)];
  row.clear();
  const auto& first = obstacle_[static_cast<std::size_t>(y)];
  const auto& second = wet_solid_[static_cast<std::size_t>(y)];
  std::size_t a = 0;
  std::size_t b = 0;
  int x = 0;  // everything before it is sorted out
  while (a < first.size() || b < second.size()) {
    const bool take_first = b == second.size() || (a < first.size() && first[a].begin <= second[b].begin);
    const Span solid = take_first ? first[a++] : second[b++];
    if (solid.begin > x) row.push_back({x, solid.begin});
    x = std::max(x, solid.end);
  }
  if (x < grid_.nx) row.push_back({x, grid_.nx});
}

}  // namespace estuary::fluid
