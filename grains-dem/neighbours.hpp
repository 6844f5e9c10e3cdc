// Which grains may touch: a Verlet list with skin (Verlet 1967), built from cells of several sizes
// (hierarchical grid, Ogarko & Luding 2012), so that its cost does not grow with the ratio of the largest to
// the smallest grain.
#pragma once

#include <array>
#include <vector>

#include "state.hpp"

namespace estuary::grains {

/// Periodic directions of the box. Distances across a periodic side are taken to the nearest image.
template <int D>
struct Domain {
  Vector<D> from{}, to{};
  std::array<bool, static_cast<std::size_t>(D)> periodic{};

  [[nodiscard]] double length(std::size_t c) const { return to[c] - from[c]; }
  /// Shift of a periodic image; codes count in base 3, component by component, 1 meaning none.
  [[nodiscard]] Vector<D> shift(std::uint32_t code) const {
    Vector<D> result{};
    for (std::size_t c = 0; c < static_cast<std::size_t>(D); ++c, code /= 3)
      result[c] = (static_cast<double>(code % 3) - 1) * length(c);
    return result;
  }
};

template <int D>
inline constexpr std::uint32_t kImages = D == 2 ? 9 : 27;

/// From here on a target is a slot and not a grain.
inline constexpr std::uint32_t kSlot = 0x80000000;

/// Work arrays that follow from the list and are rebuilt with it: the row of each pair, and where forces go
/// that cross from one block to another.
template <int D>
struct CrossForces {
  std::vector<std::uint32_t> row;            // per pair: its first grain
  std::vector<std::uint32_t> target;         // per pair: the partner, or kSlot + slot in another block
  std::vector<double> reach_squared;         // per pair: (r_i + r_j)^2
  std::vector<std::size_t> first_slot;       // per block
  std::vector<double> value;                 // per slot: force, then torque, on the partner
  std::vector<std::size_t> incoming_start;   // per block + 1
  std::vector<std::uint32_t> incoming_slot;  // ordered by slot
  std::vector<std::uint32_t> incoming_grain;
};

struct ListSettings {
  double skin = 0;               // [m]
  double range = 0;              // reach of forces beyond touching (lubrication, bonds) [m]
  double plane_range = 0;        // the same at plane walls [m]
  std::size_t history_size = 0;  // numbers kept per pair
  // What becomes of them when the two grains change roles: a stretch along the tangent of the plane and a
  // pivoting angle stay, stretches and rolling angles in space change sign.
  std::array<double, 8> turned_sign{1, 1, 1, 1, 1, 1, 1, 1};
};

/// Wraps grains into the domain, reorders them by cell, and rebuilds the list; pairs that stay keep their
/// history. `origin` receives each grain's former place. Wall contacts and bonds are renumbered by the
/// caller.
template <int D>
void rebuild_list(const Domain<D>& domain, const ListSettings& settings, State<D>& state,
                  std::vector<std::uint32_t>& origin);

template <int D>
void prepare_cross_forces(const State<D>& state, CrossForces<D>& cross);

}  // namespace estuary::grains
