#include "neighbours.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace estuary::grains {
namespace {

// Cells of one size class. Grains of a class have radii within a factor of two.
template <int D>
struct Level {
  double largest_radius = 0;
  Vector<D> origin{};
  Vector<D> cell{};
  std::array<std::int64_t, static_cast<std::size_t>(D)> count{};
  std::size_t first_cell = 0;  // in the numbering of all levels

  [[nodiscard]] std::int64_t coordinate(double x, std::size_t c) const {
    return static_cast<std::int64_t>(std::floor((x - origin[c]) / cell[c]));
  }
  [[nodiscard]] std::size_t cells() const {
    std::size_t product = 1;
    for (const auto n : count) product *= static_cast<std::size_t>(n);
    return product;
  }
};

template <int D>
struct Grid {
  std::vector<Level<D>> levels;
  std::vector<std::uint8_t> level_of;     // per grain, in the former order
  std::vector<std::uint32_t> cell_start;  // first grain of each cell, in the new order
};

template <int D>
void wrap(const Domain<D>& domain, State<D>& state) {
  for (std::size_t c = 0; c < static_cast<std::size_t>(D); ++c) {
    if (!domain.periodic[c]) continue;
    const double length = domain.length(c);
    for (std::size_t i = 0; i < state.size(); ++i) {
      double& x = state.position[D * i + c];
      const double turns = std::floor((x - domain.from[c]) / length);
      if (turns == 0) continue;
      x -= turns * length;
      // Rounding may leave a grain on the far side itself.
      if (x >= domain.to[c]) x = domain.from[c];
      state.wrapped[D * i + c] += turns * length;
    }
  }
}

template <int D>
Grid<D> make_grid(const Domain<D>& domain, double reach, const State<D>& state) {
  const std::size_t n = state.size();
  Grid<D> grid;
  double smallest = std::numeric_limits<double>::infinity(), largest = 0;
  for (const double r : state.radius) {
    smallest = std::min(smallest, r);
    largest = std::max(largest, r);
  }
  // One class while it costs little: cells of twice the smallest diameter hold few more grains.
  const int classes = largest <= 2.5 * smallest
                          ? 1
                          : 1 + static_cast<int>(std::floor(std::log2(largest / smallest * (1 + 1e-12))));
  std::vector<Level<D>> all(static_cast<std::size_t>(classes));
  grid.level_of.assign(n, 0);
  for (std::size_t i = 0; i < n; ++i) {
    const int level =
        classes == 1
            ? 0
            : std::min(classes - 1, static_cast<int>(std::floor(std::log2(state.radius[i] / smallest))));
    grid.level_of[i] = static_cast<std::uint8_t>(level);
    auto& entry = all[static_cast<std::size_t>(level)];
    entry.largest_radius = std::max(entry.largest_radius, state.radius[i]);
  }
  Vector<D> low{}, high{};
  for (std::size_t c = 0; c < static_cast<std::size_t>(D); ++c) {
    low[c] = domain.from[c];
    high[c] = domain.to[c];
    if (domain.periodic[c]) continue;
    low[c] = std::numeric_limits<double>::infinity();
    high[c] = -low[c];
    for (std::size_t i = 0; i < n; ++i) {
      low[c] = std::min(low[c], state.position[D * i + c]);
      high[c] = std::max(high[c], state.position[D * i + c]);
    }
  }
  // A few stray grains far away must not make a grid larger than the medium.
  const double most_cells = std::max(64.0, 4.0 * static_cast<double>(n));
  std::size_t next = 0;
  for (Level<D>& level : all) {
    double size = 2 * level.largest_radius + reach;
    for (;; size *= 2) {
      double product = 1;
      for (std::size_t c = 0; c < static_cast<std::size_t>(D); ++c) {
        const double length = high[c] - low[c];
        level.origin[c] = low[c];
        double cells = domain.periodic[c] ? std::floor(length / size) : std::floor(length / size) + 1;
        cells = std::max(1.0, cells);
        level.cell[c] = domain.periodic[c] ? length / cells : size;
        product *= cells;
        level.count[c] = static_cast<std::int64_t>(std::min(cells, 1e9));
      }
      if (product <= most_cells) break;
    }
    level.first_cell = next;
    next += level.cells();
  }
  grid.levels = std::move(all);
  grid.cell_start.assign(next + 1, 0);
  return grid;
}

template <int D>
std::size_t cell_of(const Grid<D>& grid, const State<D>& state, std::size_t i) {
  const Level<D>& level = grid.levels[grid.level_of[i]];
  std::size_t cell = 0;
  for (std::size_t c = D; c-- > 0;) {
    const auto at =
        std::clamp<std::int64_t>(level.coordinate(state.position[D * i + c], c), 0, level.count[c] - 1);
    cell = cell * static_cast<std::size_t>(level.count[c]) + static_cast<std::size_t>(at);
  }
  return level.first_cell + cell;
}

template <class T>
void permute(std::vector<T>& values, const std::vector<std::uint32_t>& origin, std::size_t per_grain) {
  if (values.empty()) return;
  std::vector<T> old(values.size());
  old.swap(values);
  for (std::size_t i = 0; i < origin.size(); ++i)
    for (std::size_t c = 0; c < per_grain; ++c) values[per_grain * i + c] = old[per_grain * origin[i] + c];
}

// Stable counting sort: grains of one cell keep their order.
template <int D>
void sort_by_cell(Grid<D>& grid, State<D>& state, std::vector<std::uint32_t>& origin) {
  const std::size_t n = state.size();
  std::vector<std::uint32_t> cell(n);
  for (std::size_t i = 0; i < n; ++i) {
    cell[i] = static_cast<std::uint32_t>(cell_of(grid, state, i));
    ++grid.cell_start[cell[i] + 1];
  }
  for (std::size_t c = 1; c < grid.cell_start.size(); ++c) grid.cell_start[c] += grid.cell_start[c - 1];
  std::vector<std::uint32_t> next(grid.cell_start.begin(), grid.cell_start.end() - 1);
  origin.resize(n);
  for (std::size_t i = 0; i < n; ++i) origin[next[cell[i]]++] = static_cast<std::uint32_t>(i);
  constexpr std::size_t d = D, s = spin_components<D>;
  for (auto* values : {&state.position, &state.velocity, &state.force, &state.external_force, &state.wrapped})
    permute(*values, origin, d);
  for (auto* values : {&state.spin, &state.torque, &state.external_torque}) permute(*values, origin, s);
  for (auto* values : {&state.radius, &state.inverse_mass, &state.inverse_inertia})
    permute(*values, origin, 1);
  permute(state.identity, origin, 1);
  permute(grid.level_of, origin, 1);
}

struct Candidate {
  std::uint32_t partner;
  std::uint8_t image;
};

// All partners j > i within reach.
template <int D>
void collect(const Grid<D>& grid, const Domain<D>& domain, const std::array<Vector<D>, kImages<D>>& shift,
             double reach, const State<D>& state, std::size_t i, std::vector<Candidate>& row) {
  row.clear();
  const Vector<D> x = load<D>(state.position.data(), i);
  for (std::size_t l = grid.level_of[i]; l < grid.levels.size(); ++l) {
    const Level<D>& level = grid.levels[l];
    if (level.largest_radius == 0) continue;
    const double distance = state.radius[i] + level.largest_radius + reach;
    std::array<std::int64_t, static_cast<std::size_t>(D)> low{}, high{}, at{};
    for (std::size_t c = 0; c < static_cast<std::size_t>(D); ++c) {
      low[c] = level.coordinate(x[c] - distance, c);
      high[c] = level.coordinate(x[c] + distance, c);
      if (domain.periodic[c]) {
        // Never more than one turn away on each side.
        low[c] = std::max(low[c], -level.count[c]);
        high[c] = std::min(high[c], 2 * level.count[c] - 1);
      } else {
        low[c] = std::max<std::int64_t>(low[c], 0);
        high[c] = std::min(high[c], level.count[c] - 1);
      }
    }
    at = low;
    bool empty = false;
    for (std::size_t c = 0; c < static_cast<std::size_t>(D); ++c) empty = empty || low[c] > high[c];
    if (empty) continue;
    for (;;) {
      std::size_t cell = 0;
      std::uint32_t code = 0;
      for (std::size_t c = D; c-- > 0;) {
        const std::int64_t turn = at[c] < 0 ? -1 : at[c] >= level.count[c] ? 1 : 0;
        cell = cell * static_cast<std::size_t>(level.count[c]) +
               static_cast<std::size_t>(at[c] - turn * level.count[c]);
        code = code * 3 + static_cast<std::uint32_t>(turn + 1);
      }
      cell += level.first_cell;
      const std::size_t first = std::max<std::size_t>(grid.cell_start[cell], i + 1);
      for (std::size_t j = first; j < grid.cell_start[cell + 1]; ++j) {
        const Vector<D> apart = load<D>(state.position.data(), j) + shift[code] - x;
        const double touch = state.radius[i] + state.radius[j] + reach;
        if (dot(apart, apart) < touch * touch && (state.inverse_mass[i] > 0 || state.inverse_mass[j] > 0))
          row.push_back({static_cast<std::uint32_t>(j), static_cast<std::uint8_t>(code)});
      }
      std::size_t c = 0;
      while (c < static_cast<std::size_t>(D) && ++at[c] > high[c]) {
        at[c] = low[c];
        ++c;
      }
      if (c == static_cast<std::size_t>(D)) break;
    }
  }
  std::sort(row.begin(), row.end(), [](const Candidate& a, const Candidate& b) {
    return a.partner != b.partner ? a.partner < b.partner : a.image < b.image;
  });
}

// The list before, by the grains' former places.
struct FormerList {
  std::vector<std::uint32_t> row_start, partner;
  std::vector<double> history;
};

}  // namespace

template <int D>
void rebuild_list(const Domain<D>& domain, const ListSettings& settings, State<D>& state,
                  std::vector<std::uint32_t>& origin) {
  const std::size_t n = state.size();
  const double reach = settings.skin + settings.range;
  wrap(domain, state);
  Grid<D> grid = make_grid(domain, reach, state);
  FormerList former{std::move(state.row_start), std::move(state.partner), std::move(state.history)};
  sort_by_cell(grid, state, origin);
  std::array<Vector<D>, kImages<D>> shift;
  for (std::uint32_t code = 0; code < kImages<D>; ++code) shift[code] = domain.shift(code);

  const std::size_t blocks = block_count(n);
  const std::size_t memory = settings.history_size;
  struct Part {
    std::vector<std::uint32_t> partner;
    std::vector<std::uint8_t> image;
    std::vector<double> root_mass, history;
  };
  std::vector<Part> parts(blocks);
  state.row_start.assign(n + 1, 0);
#pragma omp parallel for schedule(static) if (blocks >= kParallelBlocks)
  for (std::size_t b = 0; b < blocks; ++b) {
    Part& part = parts[b];
    std::vector<Candidate> row;
    for (std::size_t i = block_begin(b); i < block_end(b, n); ++i) {
      collect(grid, domain, shift, reach, state, i, row);
      state.row_start[i + 1] = static_cast<std::uint32_t>(row.size());
      for (const Candidate& candidate : row) {
        const std::size_t j = candidate.partner;
        part.partner.push_back(candidate.partner);
        part.image.push_back(candidate.image);
        part.root_mass.push_back(std::sqrt(1 / (state.inverse_mass[i] + state.inverse_mass[j])));
        if (memory == 0) continue;
        const std::size_t at = part.history.size();
        part.history.resize(at + memory, 0.0);
        if (former.row_start.empty()) continue;
        const bool turned = origin[i] > origin[j];
        const std::uint32_t first = turned ? origin[j] : origin[i];
        const std::uint32_t second = turned ? origin[i] : origin[j];
        for (std::uint32_t k = former.row_start[first]; k < former.row_start[first + 1]; ++k) {
          if (former.partner[k] != second) continue;
          std::copy_n(former.history.data() + memory * k, memory, part.history.data() + at);
          if (turned)
            for (std::size_t h = 0; h < memory; ++h) part.history[at + h] *= settings.turned_sign[h];
          break;
        }
      }
    }
  }
  for (std::size_t i = 0; i < n; ++i) state.row_start[i + 1] += state.row_start[i];
  const std::size_t pairs = state.row_start[n];
  state.partner.resize(pairs);
  state.image.resize(pairs);
  state.root_mass.resize(pairs);
  // A few numbers more, so that a law without memory has an address too.
  state.history.assign(memory * pairs + 8, 0.0);
  for (std::size_t b = 0; b < blocks; ++b) {
    const auto at = static_cast<std::ptrdiff_t>(state.row_start[block_begin(b)]);
    const Part& part = parts[b];
    std::copy(part.partner.begin(), part.partner.end(), state.partner.begin() + at);
    std::copy(part.image.begin(), part.image.end(), state.image.begin() + at);
    std::copy(part.root_mass.begin(), part.root_mass.end(), state.root_mass.begin() + at);
    std::copy(part.history.begin(), part.history.end(),
              state.history.begin() + at * static_cast<std::ptrdiff_t>(memory));
  }
  state.reference_position = state.position;
}

template <int D>
void prepare_cross_forces(const State<D>& state, CrossForces<D>& cross) {
  const std::size_t n = state.size(), blocks = block_count(n);
  cross.row.resize(state.partner.size());
  for (std::size_t i = 0; i < n; ++i)
    std::fill(cross.row.begin() + state.row_start[i], cross.row.begin() + state.row_start[i + 1],
              static_cast<std::uint32_t>(i));
  cross.target = state.partner;
  cross.reach_squared.resize(state.partner.size());
  for (std::size_t k = 0; k < state.partner.size(); ++k) {
    const double touch = state.radius[cross.row[k]] + state.radius[state.partner[k]];
    cross.reach_squared[k] = touch * touch;
  }
  cross.first_slot.assign(blocks + 1, 0);
  cross.incoming_start.assign(blocks + 1, 0);
  std::vector<std::uint32_t> target;
  for (std::size_t b = 0; b < blocks; ++b) {
    const std::size_t end = block_end(b, n);
    for (std::size_t k = state.row_start[block_begin(b)]; k < state.row_start[end]; ++k)
      if (state.partner[k] >= end) {
        cross.target[k] = kSlot + static_cast<std::uint32_t>(target.size());
        target.push_back(state.partner[k]);
        ++cross.incoming_start[state.partner[k] / kBlockSize + 1];
      }
    cross.first_slot[b + 1] = target.size();
  }
  for (std::size_t b = 0; b < blocks; ++b) cross.incoming_start[b + 1] += cross.incoming_start[b];
  std::vector<std::size_t> next(cross.incoming_start.begin(), cross.incoming_start.end() - 1);
  cross.incoming_slot.resize(target.size());
  cross.incoming_grain.resize(target.size());
  for (std::size_t slot = 0; slot < target.size(); ++slot) {
    const std::size_t at = next[target[slot] / kBlockSize]++;
    cross.incoming_slot[at] = static_cast<std::uint32_t>(slot);
    cross.incoming_grain[at] = target[slot];
  }
  cross.value.assign(target.size() * static_cast<std::size_t>(D + spin_components<D>), 0.0);
}

template void rebuild_list<2>(const Domain<2>&, const ListSettings&, State<2>&, std::vector<std::uint32_t>&);
template void rebuild_list<3>(const Domain<3>&, const ListSettings&, State<3>&, std::vector<std::uint32_t>&);
template void prepare_cross_forces<2>(const State<2>&, CrossForces<2>&);
template void prepare_cross_forces<3>(const State<3>&, CrossForces<3>&);

}  // namespace estuary::grains
