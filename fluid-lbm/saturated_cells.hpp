// Grains in the fluid as partially saturated cells: the collision at a node depends on how much of its cell
// the grains cover, so that nothing jumps when a grain moves across nodes and no node has to be refilled.
//
// Source: Noble, Torczynski, Int. J. Mod. Phys. C 9 (1998), with the exchange of Holdych (PhD thesis, Univ.
// of Illinois 2003) and Strack, Cook, Int. J. Numer. Meth. Fluids 55 (2007). With the share e of the cell
// that is solid and t = tau+ - 1/2, the node's populations after the collision are
//   f* = (1 - B) f*_fluid + B f + B Omega,    B = e t / (1 - e + t),
//   Omega_i = f_o - f_i + f_i^eq(rho, u_grain) - f_o^eq(rho, u_grain)        (o opposite of i)
// and the grain feels - sum_i B Omega_i c_i, at the node, per step. A covered cell bounces back on the spot;
// with f_o^eq(rho, u) of the fluid's own velocity instead, as first published, it would let density diffuse
// through the grain. The momentum among what is turned back is relaxed a little, so that a grain's push does
// not ring in it (`turning` in the source). Where several grains share a cell B is divided by their shares;
// when they overlap the shares are reduced to add up to one.
//
// Works with every collision operator, because the fluid's own collision is done first and then replaced in
// part. A body force acts on a cell's fluid part only; the force on a grain does not contain the buoyancy of
// a body force.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "cells.hpp"
#include "collide.hpp"
#include "fields.hpp"
#include "populations.hpp"
#include "ranks.hpp"

namespace estuary::fluid {

/// Discs or spheres in lattice coordinates and lattice units; components interleaved, `dimension` per grain.
struct Grains {
  int dimension = 2;
  std::vector<double> centre;
  std::vector<double> radius;
  std::vector<double> velocity;
  std::vector<double> spin;  // one per disc (counter-clockwise), three per sphere
  [[nodiscard]] std::size_t count() const { return radius.size(); }
  friend bool operator==(const Grains&, const Grains&) = default;
};

/// Lattice units; torque one per disc, three per sphere.
struct GrainLoads {
  std::vector<double> force;
  std::vector<double> torque;
};

class SaturatedCells {
public:
  /// Where ranks share the grid, every one knows all covered cells and treats its own.
  explicit SaturatedCells(const Grid& grid, Ranks* ranks = nullptr);

  /// Finds the covered cells, unless the grains are where they were. Outside of a parallel region.
  void place(const Grains& grains, const Cells& cells);
  [[nodiscard]] bool empty() const { return grains_.count() == 0; }
  [[nodiscard]] const Grains& grains() const { return grains_; }

  /// Before and after the pass of a step, by every thread of a parallel region; `parity` is that before the
  /// step for both.
  void keep(const Populations& populations, Parity parity);
  void replace(Populations& populations, Parity parity, const CollisionParameters& parameters,
               EquilibriumModel equilibrium);
  /// Gives covered cells the velocity the collision works with: the mean of before and after the grains'
  /// push, without a body force's half step. That of the grain where it covers the whole cell.
  void blend_velocities(Fields& fields, double even_rate) const;

  /// Mean over the time since `restart_loads`, by the trapezoidal rule: what covered cells give back rings
  /// from one step to the next, and the mean of two steps does not (Ladd, J. Fluid Mech. 271 (1994)).
  [[nodiscard]] GrainLoads mean_loads() const;
  void restart_loads();
  /// For copies of the state: whether there was a step, its forces, its torques.
  [[nodiscard]] std::vector<double> save() const;
  void restore(const std::vector<double>& last);
  /// Share of each cell that is solid, one per node (Grid::index).
  void fractions(std::vector<double>& shares) const;

private:
  // One grain in one cell.
  struct Cover {
    std::int32_t grain = 0;
    Node node;
    double fraction = 0;
    std::array<double, 3> arm{};  // from the grain's centre to the node
  };
  struct Cell {
    std::ptrdiff_t node = 0;  // Grid::index
    std::uint32_t first = 0;  // of `order_`
    std::uint32_t count = 0;
    double fraction = 0;
  };
  template <class Lattice>
  void replace_all(Populations& populations, Parity parity, const CollisionParameters& parameters,
                   EquilibriumModel equilibrium);
  // Of the grain's matter at the node, lattice units.
  [[nodiscard]] std::array<double, 3> velocity_at(const Cover& cover) const;
  void find_covers(const Cells& cells);
  void gather_cells();
  void find_owners();
  // Pushes of all ranks on the grains that several of them see.
  void share_pushes();
  // Force and torque on a grain in this step, from its pushes.
  template <std::size_t dimension>
  void add_pushes(std::size_t grain, double* force, double* torque) const;

  Grid grid_;
  Ranks* ranks_;
  // Where ranks share the grid: force and torque on each grain, then the pushes on those of several ranks.
  std::vector<double> of_step_;
  std::vector<std::int32_t> owner_of_grain_;  // rank of all its cells; -1: none or several
  Grains grains_;
  bool placed_ = false;
  std::vector<std::vector<Cover>> of_grain_;
  std::vector<Cover> covers_;                // grain by grain
  std::vector<std::size_t> first_of_grain_;  // and one past the last
  std::vector<Cell> cells_;
  std::vector<std::uint32_t> order_;   // covers, cell by cell
  std::vector<std::int32_t> cell_of_;  // per node, -1 without
  std::vector<double> kept_;           // populations before the collision, cell by cell
  std::vector<double> push_;           // on each cover in the last step, three components
  std::vector<double> force_sum_, torque_sum_;
  std::vector<double> last_force_, last_torque_;  // of the last step
  bool has_last_ = false;
  std::size_t steps_ = 0;
};

}  // namespace estuary::fluid
