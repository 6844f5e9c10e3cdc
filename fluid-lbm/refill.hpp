// Gives populations to nodes that a moving solid has left.
//
// Density: mean of the fluid neighbours. Velocity: the wall's. Non-equilibrium part: that of the neighbour
// that lies best along the wall's normal (Caiazzo, Prog. Comput. Fluid Dyn. 8 (2008); Chikatamarla, Ansumali,
// Karlin, Europhys. Lett. 74 (2006)); or none. Where a whole layer of nodes is uncovered at once, as between
// two equilibria of a steady iteration, nodes are filled layer by layer from the fluid into the gap.
#pragma once

#include <array>
#include <functional>
#include <vector>

#include "cells.hpp"
#include "collide.hpp"
#include "halo.hpp"
#include "populations.hpp"
#include "surface.hpp"

namespace estuary::fluid {

/// The wall next to a node: unit normal into the fluid, velocity [lattice units].
struct WallPoint {
  std::array<double, 3> normal{};
  std::array<double, 3> velocity{};
};

enum class RefillRule { extrapolated_nonequilibrium, equilibrium };

/// `uncovered` holds nodes that `cells` already counts as fluid. Returns how many had no fluid node to start
/// from and were set to equilibrium at density 1 with the wall's velocity. With a halo every rank fills its
/// own nodes, of the same list.
std::size_t refill(Populations& populations, const Cells& cells, std::vector<Node> uncovered,
                   const std::function<WallPoint(Node)>& wall_at, EquilibriumModel equilibrium,
                   RefillRule rule = RefillRule::extrapolated_nonequilibrium, Halo* halo = nullptr);
std::size_t refill(Populations& populations, const Cells& cells, std::vector<Node> uncovered,
                   const Surface& surface, EquilibriumModel equilibrium, Halo* halo = nullptr);

}  // namespace estuary::fluid
