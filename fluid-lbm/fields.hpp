// Macroscopic fields, from the incoming populations (boundary rules applied, collision not yet done).
#pragma once

#include <array>
#include <cstdint>
#include <cstdlib>
#include <new>
#include <optional>
#include <string>
#include <vector>

#include "cells.hpp"
#include "collide.hpp"
#include "populations.hpp"
#include "ranks.hpp"
#include "sides.hpp"

namespace estuary::fluid {

/// Memory that a vector does not touch when it grows, and that reads as zero until it is written: of values
/// for all nodes of a grid that ranks share, each rank's memory holds those that it deals with.
template <class Value>
struct UntouchedMemory {
  using value_type = Value;
  UntouchedMemory() = default;
  template <class Other>
  UntouchedMemory(const UntouchedMemory<Other>& /*other*/) {}  // as allocators are made of each other
  [[nodiscard]] Value* allocate(std::size_t count) {
    void* const memory = std::calloc(count, sizeof(Value));
    if (memory == nullptr) throw std::bad_alloc();
    return static_cast<Value*>(memory);
  }
  void deallocate(Value* memory, std::size_t /*count*/) { std::free(memory); }
  template <class Other>
  void construct(Other* /*at*/) {}
  template <class Other, class... From>
  void construct(Other* at, From&&... from) {
    ::new (static_cast<void*>(at)) Other(std::forward<From>(from)...);
  }
  friend bool operator==(const UntouchedMemory& /*a*/, const UntouchedMemory& /*b*/) { return true; }
};
using NodeValues = std::vector<double, UntouchedMemory<double>>;

/// One value per node (Grid::index), x fastest, lattice units; zero in the solid. Where ranks share the grid,
/// each knows those of its own rows, and others as far as they were given to it.
struct Fields {
  NodeValues excess;  // rho' = 3 p
  NodeValues velocity_x;
  NodeValues velocity_y;
  NodeValues velocity_z;  // three dimensions only
};

/// To be called by all ranks: the first one gets the fields of all rows, or everyone those of some nodes.
void gather_fields(Ranks* ranks, const Grid& grid, Fields& fields);
void share_fields(Ranks* ranks, const Grid& grid, const std::vector<Node>& nodes, Fields& fields);

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
[[nodiscard]] FieldSums sum_fields(const Fields& fields, const Cells& cells, const Sides& sides,
                                   Ranks* ranks = nullptr);

struct VelocityChange {
  double change = 0;  // square of the L2 norm of the difference to the velocities given
  double norm = 0;    // square of the L2 norm
};
/// Compares the velocities with `previous` and stores them there.
VelocityChange update_velocities(const Fields& now, const Cells& cells, NodeValues& previous_x,
                                 NodeValues& previous_y, NodeValues& previous_z, Ranks* ranks = nullptr);

/// First node (in order of rows) where the density is not finite, not positive, or the speed not below the
/// speed of sound.
struct BadNode {
  Node node;
  bool finite = false;
  double speed = 0;  // lattice units
  double excess = 0;
};
[[nodiscard]] std::optional<BadNode> find_bad_node(const Fields& fields, const Cells& cells,
                                                   Ranks* ranks = nullptr);

}  // namespace estuary::fluid
