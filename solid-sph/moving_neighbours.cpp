#include "moving_neighbours.hpp"

#include <algorithm>
#include <cmath>

#include "ordered_sum.hpp"

namespace estuary::solid {

bool MovingNeighbours::stale(std::span<const double> position) const {
  const std::size_t n = position.size() / 2;
  if (built_at_.size() != position.size()) return true;
  double mean[2];
  for (std::size_t c = 0; c < 2; ++c)
    mean[c] = ordered_sum(n, [&](std::size_t i) { return position[2 * i + c] - built_at_[2 * i + c]; }) /
              static_cast<double>(std::max<std::size_t>(1, n));
  const double limit = 0.25 * margin_ * margin_;
  double largest = 0;
  for (std::size_t i = 0; i < n; ++i) {
    const double dx = position[2 * i] - built_at_[2 * i] - mean[0],
                 dy = position[2 * i + 1] - built_at_[2 * i + 1] - mean[1];
    // Written so that a NaN counts as moved; it is reported elsewhere.
    const double squared = dx * dx + dy * dy;
    largest = squared <= largest ? largest : squared;
  }
  return !(largest < limit);
}

void MovingNeighbours::need_reach(double reach) {
  if (reach <= reach_ && reach >= 0.9 * reach_) return;
  // A little in advance, so that a slow expansion does not build lists at every step.
  if (reach > reach_) built_at_.clear();
  reach_ = 1.02 * reach;
}

bool MovingNeighbours::update(std::span<const double> position) {
  if (!stale(position)) return false;
  build(position);
  return true;
}

void MovingNeighbours::build(std::span<const double> position) {
  ++builds_;
  const std::size_t n = position.size() / 2;
  built_at_.assign(position.begin(), position.end());
  neighbour_.clear();
  first_.assign(n + 1, 0);
  if (n == 0) return;
  const double reach = reach_ + margin_;
  double low[2] = {1e300, 1e300}, high[2] = {-1e300, -1e300};
  for (std::size_t i = 0; i < n; ++i)
    for (std::size_t c = 0; c < 2; ++c) {
      const double x = position[2 * i + c];
      if (!std::isfinite(x)) continue;
      low[c] = std::min(low[c], x);
      high[c] = std::max(high[c], x);
    }
  // A few strays must not cost a cell for every spacing on their way.
  double cell = reach;
  const double most = 8 * static_cast<double>(n) + 64;
  if (!std::isfinite((high[0] - low[0]) * (high[1] - low[1]) / (cell * cell))) return;  // reported elsewhere
  while (((high[0] - low[0]) / cell + 1) * ((high[1] - low[1]) / cell + 1) > most) cell *= 1.5;
  const auto columns = static_cast<std::size_t>((high[0] - low[0]) / cell) + 1,
             rows = static_cast<std::size_t>((high[1] - low[1]) / cell) + 1;
  cell_first_.assign(columns * rows + 1, 0);
  cell_of_.resize(n);
  cell_particle_.resize(n);
  const auto index = [&](double x, double from, std::size_t count) {
    const double at = (x - from) / cell;
    return at > 0 ? std::min(static_cast<std::size_t>(at), count - 1) : 0;
  };
  for (std::size_t i = 0; i < n; ++i) {
    cell_of_[i] = static_cast<std::uint32_t>(index(position[2 * i + 1], low[1], rows) * columns +
                                             index(position[2 * i], low[0], columns));
    ++cell_first_[cell_of_[i] + 1];
  }
  for (std::size_t c = 0; c < columns * rows; ++c) cell_first_[c + 1] += cell_first_[c];
  {
    std::vector<std::uint32_t> next(cell_first_.begin(), cell_first_.end() - 1);
    for (std::size_t i = 0; i < n; ++i) cell_particle_[next[cell_of_[i]]++] = static_cast<std::uint32_t>(i);
  }
  for (std::size_t i = 0; i < n; ++i) {
    const std::size_t row = cell_of_[i] / columns, column = cell_of_[i] % columns;
    const double x = position[2 * i], y = position[2 * i + 1];
    const std::size_t begin = neighbour_.size();
    for (std::size_t r = row > 0 ? row - 1 : 0; r < std::min(rows, row + 2); ++r) {
      const std::size_t from = cell_first_[r * columns + (column > 0 ? column - 1 : 0)],
                        to = cell_first_[r * columns + std::min(columns, column + 2)];
      for (std::size_t k = from; k < to; ++k) {
        const std::uint32_t j = cell_particle_[k];
        const double dx = position[2 * j] - x, dy = position[2 * j + 1] - y;
        if (dx * dx + dy * dy < reach * reach && j != i) neighbour_.push_back(j);
      }
    }
    std::sort(neighbour_.begin() + static_cast<std::ptrdiff_t>(begin), neighbour_.end());
    first_[i + 1] = static_cast<std::uint32_t>(neighbour_.size());
  }
}

}  // namespace estuary::solid
