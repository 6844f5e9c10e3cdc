// Rules at the sides of the grid: four in two dimensions, six in three.
//
// wall: half-way bounce-back; the wall lies half a spacing outside the outermost nodes and may move (Ladd, J.
// Fluid Mech. 271 (1994)).
//
// velocity: the outermost nodes lie on the side and have the given velocity (Zou, He, Phys. Fluids 9 (1997);
// in three dimensions with the transverse correction of Hecht, Harting, J. Stat. Mech. (2010) P01018). Or all
// populations of the node are rebuilt from density, velocity and the stress of the ones known and bounced
// back (Latt, Chopard, Malaspinas, Deville, Michler, Phys. Rev. E 77 (2008)), which stands higher Reynolds
// numbers.
//
// pressure: the outermost nodes lie on the side and have the given pressure, no velocity along the side, and
// hence (continuity) no change of the velocity across it: equilibrium with these, non-equilibrium part of the
// inner neighbour (Guo, Zheng, Shi, Chin. Phys. 11 (2002)). The rule of Zou and He for a pressure is used
// only where there is no inner neighbour: it hardly lets out the velocity mode that changes sign from node to
// node and from step to step, which the flow carries towards an outlet.
//
// outflow: does not reflect. The characteristic waves that leave are taken from the inside, the one that
// enters relaxes to the given pressure: Izquierdo, Fueyo, Phys. Rev. E 78 (2008), after Poinsot, Lele, J.
// Comput. Phys. 101 (1992); non-equilibrium part of the inner neighbour.
//
// periodic: what leaves enters at the opposite side.
//
// Corners and edges of open sides: velocity and pressure as far as one of the sides gives them, the rest and
// the non-equilibrium part from the neighbour that is inner to all of them (the rule of Guo, Zheng, Shi
// again).
//
// Where walls meet, a population that both would reflect belongs to the one later in the order left to
// front, and each gives the component of velocity along its normal. Where an open side meets a wall, the wall
// reflects first.
#pragma once

#include <array>
#include <vector>

#include "cells.hpp"
#include "collide.hpp"
#include "halo.hpp"
#include "populations.hpp"

namespace estuary::fluid {

enum class SideKind { wall, velocity, pressure, periodic, regularised_velocity, outflow };
enum SideName { left = 0, right = 1, bottom = 2, top = 3, back = 4, front = 5 };
inline constexpr std::array<const char*, 6> side_names{"left", "right", "bottom", "top", "back", "front"};

/// Nodes lie on the side.
[[nodiscard]] constexpr bool is_open(SideKind kind) {
  return kind != SideKind::wall && kind != SideKind::periodic;
}

struct Side {
  SideKind kind = SideKind::wall;
  /// velocity: one value per node of the side, in order of the axes that it has (x before y before z). wall:
  /// empty when at rest, else for the points -1/2, 0, 1/2, ..., n - 1/2 of each axis. Lattice units.
  std::vector<double> velocity_x;
  std::vector<double> velocity_y;
  std::vector<double> velocity_z;  // three dimensions only
  /// pressure, outflow: density excess rho' = 3 p per node, lattice units.
  std::vector<double> excess;
  /// outflow: rate at which the pressure relaxes to the given one, per step.
  double relaxation = 0;
  std::vector<Moments> next;  // outflow: of each node, while a step is completed
};

using Sides = std::array<Side, 6>;

/// Number of sides of a grid of this dimension.
[[nodiscard]] constexpr int side_count(int dimension) {
  return 2 * dimension;
}

/// How this process's layers get what they need of the neighbours'; without a halo all are its own.
struct SlabExchange {
  Halo* halo = nullptr;
  /// Rules look at nodes beside their own.
  bool everything = false;
};

/// Copies across periodic sides and between slabs, reflects at walls. Called by every thread of a parallel
/// region, before the links' rule. `parity` is the populations' own, which a parallel region changes only at
/// its end.
void exchange_and_reflect(Populations& populations, Parity parity, const Sides& sides,
                          const SlabExchange& slab = {});

/// Completes the outermost nodes of open sides. After the links' rule, whose populations it needs.
/// `acceleration` is the body force whose half is part of the velocity. `again` says that this was done since
/// the last step: an outflow, which looks at what left its nodes, then stays as it is.
void complete_open_sides(Populations& populations, Parity parity, const Cells& cells, Sides& sides,
                         EquilibriumModel equilibrium, const std::array<double, 3>& acceleration = {},
                         bool again = false);

}  // namespace estuary::fluid
