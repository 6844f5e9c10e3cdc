// Load of the fluid on the nodes of a wet surface: gauge pressure and viscous traction, from the fluid nodes
// in front of each.
//
// At each wet node a linear function is fitted to the values of the fluid nodes on its wet side by moving
// least squares (Lancaster, Salkauskas, Math. Comput. 37 (1981)) and evaluated at the node. Fluid nodes that
// another part of the surface hides, as on the other face of a thin fin, take no part. Where too few nodes
// are left for a linear fit their weighted mean is used, where there are none the nearest one in front; both
// are counted. The viscous stress follows from the non-equilibrium part, sigma = -(1 - 1/(2 tau+)) sum_i c_i
// c_i (f_i - f_i^eq) (Krueger, Varnik, Raabe, Phys. Rev. E 79 (2009)).
#pragma once

#include <vector>

#include "cells.hpp"
#include "collide.hpp"
#include "links.hpp"
#include "populations.hpp"
#include "surface.hpp"

namespace estuary::fluid {

struct WetLoadCounts {
  std::size_t linear = 0;
  std::size_t mean = 0;
  std::size_t nearest = 0;
  std::size_t without = 0;  // no fluid in front anywhere near: the load is zero
};

class WetLoad {
public:
  /// Radius of the neighbourhood used for a fit [spacings].
  static constexpr double radius = 3.0;

  /// Chooses fluid nodes and weights for the surface as it is placed now.
  void build(const Surface& surface, const Cells& cells);
  /// Lattice units; one value per wet node, traction two. `traction` may be null. Populations with boundary
  /// rules applied.
  void evaluate(const Populations& populations, EquilibriumModel equilibrium, Rates rates,
                std::vector<double>& pressure, std::vector<double>* traction, Ranks* ranks = nullptr);
  [[nodiscard]] const WetLoadCounts& counts() const { return counts_; }

private:
  struct Support {
    Node node;
    double dx = 0;  // from the wet node [spacings]
    double dy = 0;
    double weight = 0;
  };
  struct WetNode {
    std::uint32_t index = 0;
    double x = 0;  // in coordinates of the grid
    double y = 0;
    double normal_x = 0;  // unit normal into the fluid
    double normal_y = 0;
  };
  [[nodiscard]] WetNode in_grid(const Surface& surface, const Grid& grid, std::uint32_t wet_node) const;
  void find_near_segments(const Surface& surface, const WetNode& wet, double reach);
  [[nodiscard]] bool hidden(const WetNode& wet, double x, double y) const;
  void find_visible(const Surface& surface, const Cells& cells, const WetNode& wet);
  bool find_nearest(const Surface& surface, const Cells& cells, const WetNode& wet);
  // The populations that reach the supports' nodes, one support after another, of whichever rank they are.
  void share_populations(const Populations& populations, Ranks* ranks);
  bool fit_linear();
  void fit_mean();

  std::vector<Support> candidates_;
  std::vector<const Segment*> near_;
  std::vector<Support> supports_;   // of all wet nodes, one after another
  std::vector<std::size_t> first_;  // of each wet node, and one past the last
  std::vector<double> normals_;
  std::vector<double> shared_;  // what `share_populations` gathered; empty without ranks
  WetLoadCounts counts_;
};

/// Completes `traction` so that the consistent load of piecewise linear pressure and traction adds up to
/// `force`, and to its moment when `match_moment` (not with periodic sides, where a moment has no meaning).
/// What is missing, because pressure peaks at corners are narrower than a spacing, is added as the field of a
/// rigid motion: the smoothest one with that force and moment. Lattice units, positions in lattice
/// coordinates.
void match_total(const Surface& surface, const Force& force, bool match_moment,
                 const std::vector<double>& pressure, std::vector<double>& traction);

/// Completes `traction` at every node so that the consistent load of piecewise linear pressure and traction
/// has the sum and, but for the ends and corners of a line, the moment of `node_forces`: what a node lacks is
/// divided by the length of surface that belongs to it.
void match_nodes(const Surface& surface, const std::vector<double>& node_forces,
                 const std::vector<double>& pressure, std::vector<double>& traction);

}  // namespace estuary::fluid
