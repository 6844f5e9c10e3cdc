// Copies of a flow's state: kept and given back between iterations, and gathered from and scattered to ranks,
// so that a checkpoint is the same file however many wrote it.
#include <algorithm>

#include "flow.hpp"

namespace estuary::fluid {

void Flow::copy_to(State& state) const {
  populations_.copy_to(state.populations);
  state.body_memory = bodies_.links().memory().save();
  state.outline_memory = outline_links_.memory().save();
  state.grain_loads = saturated_.save();
  state.parity = populations_.parity();
  state.rules_applied = rules_applied_;
  state.sides_complete = sides_complete_;
  state.rows_complete = !halo_ || halo_->complete();
}

namespace {

// A part of one population's values, layers first <= s < past of the outermost axis.
struct LayerRange {
  int first = 0;
  int past = 0;
};

// What a rank's part of a checkpoint is: its layers, and the ghosts at the lattice's ends.
LayerRange part_of(const Grid& grid, int rank) {
  return {grid.first_layer_of(rank) - (rank == 0 ? 1 : 0),
          grid.first_layer_of(rank + 1) + (rank + 1 == grid.ranks ? 1 : 0)};
}

}  // namespace

// Links from fluid nodes to nodes that would have no memory: direction and its opposite, the nodes' numbers
// in the whole grid.
template <class Visit>
void Flow::visit_walls(const Populations::Packing& packing, Visit&& visit) const {
  const LatticeTable& lattice = populations_.lattice();
  for (int row = 0; row < grid().rows(); ++row) {
    for (const Span span : cells_.row(row)) {
      for (int x = span.begin; x < span.end; ++x) {
        const std::ptrdiff_t node = populations_.number_in_grid(populations_.row_start(row) + x);
        for (int i = 1; i < lattice.count; ++i) {
          const std::ptrdiff_t beyond = node + populations_.step(i);
          if (packing.places[static_cast<std::size_t>(beyond)] < 0)
            visit(i, lattice.opposite[i], node, beyond);
        }
      }
    }
  }
}

void Flow::gather(State& state) {
  if (!halo_) {
    copy_to(state);
    return;
  }
  Ranks& ranks = halo_->ranks();
  halo_->complete_slab(populations_);
  copy_to(state);
  state.body_memory = bodies_.links().save_memory();
  state.outline_memory = outline_links_.save_memory();
  Grid alone = grid();
  alone.ranks = 1;
  alone.rank = 0;
  const std::ptrdiff_t plane = Populations::plane_of(alone);
  const auto count = static_cast<std::size_t>(populations_.lattice().count);
  std::vector<double> whole;
  if (ranks.rank() == 0) whole.assign(count * static_cast<std::size_t>(plane), 0.0);
  std::vector<double> part;
  for (int rank = 0; rank < ranks.count(); ++rank) {
    if (ranks.rank() != 0 && ranks.rank() != rank) continue;
    const LayerRange layers = part_of(grid(), rank);
    const auto size = static_cast<std::size_t>((layers.past - layers.first) * populations_.layer_size());
    const std::ptrdiff_t there = populations_.number_in_grid(populations_.layer_start(layers.first));
    for (std::size_t i = 0; i < count; ++i) {
      const auto plane_number = static_cast<std::ptrdiff_t>(i);
      part.resize(size);
      if (ranks.rank() == rank) {
        const auto here = plane_number * populations_.plane() + populations_.layer_start(layers.first);
        std::copy_n(state.populations.begin() + here, size, part.begin());
        if (rank > 0) ranks.send(0, std::as_bytes(std::span(part)));
      } else {
        ranks.receive(rank, std::as_writable_bytes(std::span(part)));
      }
      if (ranks.rank() == 0)
        std::copy(part.begin(), part.end(), whole.begin() + plane_number * plane + there);
    }
  }
  state.populations = std::move(whole);
  if (ranks.rank() != 0 || !packs_alone_) return;
  const std::vector<std::uint8_t> needed = needed_nodes();
  if (needed.empty()) return;
  const Populations::Packing packing = populations_.packing_of(needed);
  std::vector<double> packed(count * static_cast<std::size_t>(packing.plane), 0.0);
  for (std::size_t i = 0; i < count; ++i) {
    for (std::size_t n = 0; n < packing.places.size(); ++n) {
      if (packing.places[n] < 0) continue;
      packed[i * static_cast<std::size_t>(packing.plane) + static_cast<std::size_t>(packing.places[n])] =
          state.populations[i * static_cast<std::size_t>(plane) + n];
    }
  }
  // After an odd step what left towards a wall stands beyond it.
  if (state.parity == Parity::odd) {
    visit_walls(packing, [&](int i, int opposite, std::ptrdiff_t node, std::ptrdiff_t beyond) {
      packed[static_cast<std::size_t>(opposite * packing.plane +
                                      packing.places[static_cast<std::size_t>(node)])] =
          state.populations[static_cast<std::size_t>(i * plane + beyond)];
    });
  }
  state.populations = std::move(packed);
}

void Flow::scatter(State& state) {
  if (!halo_) return;
  Ranks& ranks = halo_->ranks();
  Grid alone = grid();
  alone.ranks = 1;
  alone.rank = 0;
  const std::ptrdiff_t plane = Populations::plane_of(alone);
  const auto count = static_cast<std::size_t>(populations_.lattice().count);
  if (ranks.rank() == 0 && packs_alone_) {
    const std::vector<std::uint8_t> needed = needed_nodes();
    if (!needed.empty()) {
      const Populations::Packing packing = populations_.packing_of(needed);
      std::vector<double> unpacked(count * static_cast<std::size_t>(plane), 0.0);
      for (std::size_t i = 0; i < count; ++i) {
        for (std::size_t n = 0; n < packing.places.size(); ++n) {
          if (packing.places[n] < 0) continue;
          unpacked[i * static_cast<std::size_t>(plane) + n] =
              state.populations[i * static_cast<std::size_t>(packing.plane) +
                                static_cast<std::size_t>(packing.places[n])];
        }
      }
      visit_walls(packing, [&](int i, int opposite, std::ptrdiff_t node, std::ptrdiff_t beyond) {
        unpacked[static_cast<std::size_t>(i * plane + beyond)] = state.populations[static_cast<std::size_t>(
            opposite * packing.plane + packing.places[static_cast<std::size_t>(node)])];
      });
      state.populations = std::move(unpacked);
    }
  }
  const std::vector<double> whole = std::move(state.populations);
  state.populations.assign(populations_.size(), 0.0);
  const int end = grid().slab_layers();
  const std::ptrdiff_t layer_size = populations_.layer_size();
  const auto start_in_whole = [&](int layer) {
    return populations_.number_in_grid(populations_.layer_start(layer));
  };
  std::vector<double> part;
  for (int rank = 0; rank < ranks.count(); ++rank) {
    if (ranks.rank() != 0 && ranks.rank() != rank) continue;
    const int first = grid().first_layer_of(rank) - Populations::halo;
    const int past = grid().first_layer_of(rank + 1) + Populations::halo;
    part.resize(static_cast<std::size_t>((past - first) * layer_size));
    for (std::size_t i = 0; i < count; ++i) {
      const auto plane_number = static_cast<std::ptrdiff_t>(i);
      if (ranks.rank() == 0) {
        for (int layer = first; layer < past; ++layer) {
          // Beyond the ghosts at an end lies what the other end has, or nothing.
          int from = layer;
          if (grid().periodic_slabs() && layer < -1) from += end;
          if (grid().periodic_slabs() && layer > end) from -= end;
          const auto to = part.begin() + (layer - first) * layer_size;
          if (from < -1 || from > end) {
            std::fill_n(to, layer_size, 0.0);
          } else {
            std::copy_n(whole.begin() + plane_number * plane + start_in_whole(from), layer_size, to);
          }
        }
        if (rank > 0) ranks.send(rank, std::as_bytes(std::span(part)));
      } else {
        ranks.receive(0, std::as_writable_bytes(std::span(part)));
      }
      if (ranks.rank() == rank)
        std::copy(part.begin(), part.end(),
                  state.populations.begin() + plane_number * populations_.plane() +
                      populations_.layer_start(first));
    }
  }
  state.rows_complete = true;
}

std::size_t Flow::values_of_whole_state() const {
  const auto count = static_cast<std::size_t>(populations_.lattice().count);
  if (!halo_) return populations_.size();
  if (packs_alone_) {
    const std::vector<std::uint8_t> needed = needed_nodes();
    if (!needed.empty()) return count * static_cast<std::size_t>(populations_.packing_of(needed).plane);
  }
  Grid alone = grid();
  alone.ranks = 1;
  alone.rank = 0;
  return count * static_cast<std::size_t>(Populations::plane_of(alone));
}

void Flow::give_back(const State& state, std::span<const double> positions,
                     std::span<const double> velocities, double velocity_scale) {
  if (wet_) place(positions, velocities, velocity_scale, false);
  populations_.copy_from(state.populations);
  bodies_.links().memory().restore(state.body_memory);
  outline_links_.memory().restore(state.outline_memory);
  saturated_.restore(state.grain_loads);
  populations_.set_parity(state.parity);
  rules_applied_ = state.rules_applied;
  sides_complete_ = state.sides_complete;
  if (halo_) halo_->set_complete(state.rows_complete);
}

}  // namespace estuary::fluid
