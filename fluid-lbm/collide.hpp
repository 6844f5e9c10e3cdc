// Collision and streaming in one pass over the fluid nodes.
//
// Sources: BGK: Qian, d'Humieres, Lallemand 1992. Two relaxation times: Ginzburg, Verhaeghe, d'Humieres,
// Commun. Comput. Phys. 3 (2008); with the magic parameter (tau+ - 1/2)(tau- - 1/2) = 3/16 a straight
// half-way wall stands exactly half-way. Recursive regularised: Malaspinas, arXiv 1505.06900 (2015). Central
// moments with all higher ones at equilibrium: De Rosis, Phys. Rev. E 95 (2017); De Rosis, Coreixas, Phys.
// Fluids 32 (2020) for D3Q19. Equilibria, in terms of rho' = rho - 1 and the momentum j:
//   incompressible  He, Luo, J. Stat. Phys. 88 (1997):  f_i - w_i = w_i [rho' + 3 c.j + 9/2 (c.j)^2 - 3/2
//   j.j],        u = j compressible    second order in the Mach number:    f_i - w_i = w_i [rho' + 3 c.j +
//   (9/2 (c.j)^2 - 3/2 j.j)/rho],  u = j/rho
// Pressure is rho'/3 in both. Recursive regularised and central moments have the full product form of their
// lattice and are compressible.
#pragma once

#include <array>
#include <cstddef>
#include <string>

#include "cells.hpp"
#include "lattice.hpp"
#include "populations.hpp"
#include "viscosity.hpp"

namespace estuary::fluid {

class Blocks;

enum class CollisionModel { trt, bgk, recursive_regularised, central_moment };
enum class EquilibriumModel { incompressible, compressible };
/// Body force: none; Guo, Zheng, Shi, Phys. Rev. E 65 (2002), with the velocity (j + F/2)/rho; or 3 w_i c.F
/// added after the collision with the velocity j/rho, first order in time, to repeat older studies.
enum class ForceModel { none, guo, unshifted };

/// Relaxation rates per step of the even and the odd part; BGK uses the first only.
struct Rates {
  double even = 1;
  double odd = 1;
};

/// What a step needs to know besides the populations, lattice units.
struct CollisionParameters {
  Rates rates;
  std::array<double, 3> acceleration{};  // body force per mass
  double magic_parameter = 3.0 / 16.0;   // where the viscosity varies
  ViscosityLaw law;
  const ViscosityTable* viscosities = nullptr;  // of a generalised Newtonian fluid
};

/// 1/rho and rho where the equilibrium has them.
struct Incompressible {
  template <class Value>
  [[gnu::always_inline]] static Value inverse_density(const Value&) {
    return Value{} + 1;
  }
  template <class Value>
  [[gnu::always_inline]] static Value density(const Value&) {
    return Value{} + 1;
  }
};
struct Compressible {
  template <class Value>
  [[gnu::always_inline]] static Value inverse_density(const Value& excess) {
    return 1 / (1 + excess);
  }
  template <class Value>
  [[gnu::always_inline]] static Value density(const Value& excess) {
    return 1 + excess;
  }
};

/// Density excess rho' and momentum of one node, or of several at a time (lanes.hpp).
template <class Value>
struct MomentsOf {
  Value excess{};
  Value momentum_x{};
  Value momentum_y{};
  Value momentum_z{};  // three dimensions only
};
using Moments = MomentsOf<double>;

/// From sums and differences of opposite populations, which the collision needs as well.
template <class Lattice, class Value>
[[gnu::always_inline]] inline MomentsOf<Value> moments_of(const std::array<Value, Lattice::count>& f) {
  MomentsOf<Value> m;
  unrolled<static_cast<int>(Lattice::half.size())>([&](auto index) __attribute__((always_inline)) {
    constexpr auto n = static_cast<std::size_t>(index());
    constexpr auto i = static_cast<std::size_t>(Lattice::half[n]);
    constexpr auto o = static_cast<std::size_t>(Lattice::opposite[i]);
    constexpr auto c = Lattice::velocity[i];
    const Value sum = f[i] + f[o];
    const Value difference = f[i] - f[o];
    // The first of `half` point along the axes. No sum starts from zero: strict arithmetic may not drop it.
    if constexpr (n == 0) {
      m.excess = f[0] + sum;
      m.momentum_x = difference;
    } else {
      m.excess += sum;
      if constexpr (n == 1) m.momentum_y = difference;
      if constexpr (n == 2 && Lattice::dimension == 3) m.momentum_z = difference;
      if constexpr (n >= Lattice::dimension) {
        if constexpr (c[0] == 1) m.momentum_x += difference;
        if constexpr (c[0] == -1) m.momentum_x -= difference;
        if constexpr (c[1] == 1) m.momentum_y += difference;
        if constexpr (c[1] == -1) m.momentum_y -= difference;
        if constexpr (c[2] == 1) m.momentum_z += difference;
        if constexpr (c[2] == -1) m.momentum_z -= difference;
      }
    }
  });
  return m;
}

/// c_i . (x, y, z) without the products with zero and one, which strict arithmetic may not drop.
template <class Lattice, std::size_t i, class Value>
[[gnu::always_inline]] inline Value along(const Value& x, const Value& y, const Value& z) {
  constexpr auto c = Lattice::velocity[i];
  Value sum{};
  if constexpr (c[0] != 0) sum = c[0] > 0 ? x : -x;
  if constexpr (c[1] != 0) {
    if constexpr (c[0] == 0) {
      sum = c[1] > 0 ? y : -y;
    } else if constexpr (c[1] > 0) {
      sum += y;
    } else {
      sum -= y;
    }
  }
  if constexpr (c[2] != 0) {
    if constexpr (c[0] == 0 && c[1] == 0) {
      sum = c[2] > 0 ? z : -z;
    } else if constexpr (c[2] > 0) {
      sum += z;
    } else {
      sum -= z;
    }
  }
  return sum;
}

/// j.j of the moments.
template <class Lattice, class Value>
[[gnu::always_inline]] inline Value square_of(const MomentsOf<Value>& m) {
  const Value square = m.momentum_x * m.momentum_x + m.momentum_y * m.momentum_y;
  if constexpr (Lattice::dimension == 3) return square + m.momentum_z * m.momentum_z;
  return square;
}

/// f_i - w_i at equilibrium.
template <class Lattice>
[[gnu::always_inline]] inline double equilibrium(int i, const Moments& m, double inverse_density) {
  const auto& c = Lattice::velocity[static_cast<std::size_t>(i)];
  double along_c = c[0] * m.momentum_x + c[1] * m.momentum_y;
  if constexpr (Lattice::dimension == 3) along_c += c[2] * m.momentum_z;
  return Lattice::weight[static_cast<std::size_t>(i)] *
         (m.excess + 3.0 * along_c +
          inverse_density * (4.5 * along_c * along_c - 1.5 * square_of<Lattice>(m)));
}

/// What a step passes over.
struct FluidNodes {
  const std::vector<std::vector<Span>>& rows;  // runs of each row
  const Blocks* blocks = nullptr;              // the same among many solid nodes; needed in packed memory
};

/// Does one step of the kind that follows `parity`, the kind of the step before; the caller notes the new
/// parity. The boundary rules must have been applied. To be called by every thread of a parallel region (or
/// outside one).
using CollideAndStream = void (*)(Populations&, Parity, const FluidNodes&, const CollisionParameters&);

/// Which compiled variant of the step.
struct StepChoice {
  int dimension = 2;
  CollisionModel collision = CollisionModel::trt;
  EquilibriumModel equilibrium = EquilibriumModel::incompressible;
  ForceModel force = ForceModel::none;
  ViscosityModel viscosity = ViscosityModel::constant;
  Storage storage = Storage::double_precision;
};
/// Null for a combination that does not exist: recursive regularised and central moments are compressible
/// only; the unshifted force goes with BGK and TRT at constant viscosity; single precision without a body
/// force and at constant viscosity.
[[nodiscard]] CollideAndStream collide_and_stream(const StepChoice& choice);

/// "d2q9-trt-incompressible", with "-guo", "-smagorinsky", ... where they are on.
[[nodiscard]] std::string variant_name(const StepChoice& choice);

/// Rates of the viscosity (lattice units) and of the magic parameter.
[[nodiscard]] Rates relaxation_rates(double viscosity, double magic_parameter);

}  // namespace estuary::fluid
