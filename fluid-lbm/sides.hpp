// Rules at the four sides of the grid.
//
// wall: half-way bounce-back; the wall lies half a spacing outside the outermost nodes and may move (Ladd, J.
// Fluid Mech. 271 (1994)).
//
// velocity: the outermost nodes lie on the side and have the given velocity (Zou, He, Phys. Fluids 9 (1997)).
//
// pressure: the outermost nodes lie on the side and have the given pressure, no velocity along the side, and
// hence (continuity) no change of the velocity across it: equilibrium with these, non-equilibrium part of the
// inner neighbour (Guo, Zheng, Shi, Chin. Phys. 11 (2002)). The rule of Zou and He for a pressure is used
// only where there is no inner neighbour: it hardly lets out the velocity mode that changes sign from node to
// node and from step to step, which the flow carries towards an outlet.
//
// periodic: what leaves enters at the opposite side.
#pragma once

#include <array>
#include <vector>

#include "cells.hpp"
#include "collide.hpp"
#include "populations.hpp"

namespace estuary::fluid {

enum class SideKind { wall, velocity, pressure, periodic };
enum SideName { left = 0, right = 1, bottom = 2, top = 3 };
inline constexpr std::array<const char*, 4> side_names{"left", "right", "bottom", "top"};

struct Side {
  SideKind kind = SideKind::wall;
  /// velocity: one value per node along the side, in order of x or y. wall: empty when at rest, else two per
  /// node and one more, at positions -1/2, 0, 1/2, ..., n - 1/2. Lattice units.
  std::vector<double> velocity_x;
  std::vector<double> velocity_y;
  /// pressure: density excess rho' = 3 p per node, lattice units.
  std::vector<double> excess;
};

using Sides = std::array<Side, 4>;

/// Copies across periodic sides, reflects at walls. Called by every thread of a parallel region, before the
/// links' rule. `parity` is the populations' own, which a parallel region changes only at its end. links'
/// rule.
void exchange_and_reflect(Populations& populations, Parity parity, const Sides& sides);

/// Completes the outermost nodes of velocity and pressure sides. After the links' rule, whose populations it
/// needs.
void complete_open_sides(Populations& populations, Parity parity, const Cells& cells, const Sides& sides,
                         EquilibriumModel equilibrium);

}  // namespace estuary::fluid
