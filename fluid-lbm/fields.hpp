// Macroscopic fields, from the incoming populations (boundary rules applied, collision not yet done).
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "cells.hpp"
#include "collide.hpp"
#include "populations.hpp"
#include "sides.hpp"

namespace estuary::fluid {

/// One value per node (Grid::index), x fastest, lattice units; zero in the solid.
struct Fields {
  std::vector<double> excess;  // rho' = 3 p
  std::vector<double> velocity_x;
  std::vector<double> velocity_y;
  std::vector<double> velocity_z;  // three dimensions only
};

[[nodiscard]] Moments incoming_moments(const Populations& populations, Node node);

/// `shift` is added to every velocity: half the acceleration of a body force.
void compute_fields(const Populations& populations, const Cells& cells, EquilibriumModel equilibrium,
                    Fields& fields, const std::array<double, 3>& shift = {});

/// Starts all nodes at equilibrium with the given fields, as if their collision had just been done.
void set_equilibrium(Populations& populations, const Fields& fields, EquilibriumModel equilibrium);

/// Integrals over the fluid, the same for any number of threads. A node on an open side stands for half a
/// cell.
struct FieldSums {
  double area = 0;
  double excess = 0;          // of rho'
  double kinetic_energy = 0;  // of u.u/2 (density 1)
  double maximum_speed = 0;
  double momentum_x = 0;
  double momentum_y = 0;
  double momentum_z = 0;
};
[[nodiscard]] FieldSums sum_fields(const Fields& fields, const Cells& cells, const Sides& sides);

struct VelocityChange {
  double change = 0;  // square of the L2 norm of the difference to the velocities given
  double norm = 0;    // square of the L2 norm
};
/// Compares the velocities with `previous` and stores them there.
VelocityChange update_velocities(const Fields& now, const Cells& cells, std::vector<double>& previous_x,
                                 std::vector<double>& previous_y, std::vector<double>& previous_z);

/// First node (in order of rows) where the density is not finite, not positive, or the speed not below the
/// speed of sound.
struct BadNode {
  Node node;
  bool finite = false;
  double speed = 0;  // lattice units
  double excess = 0;
};
[[nodiscard]] std::optional<BadNode> find_bad_node(const Fields& fields, const Cells& cells);

}  // namespace estuary::fluid
