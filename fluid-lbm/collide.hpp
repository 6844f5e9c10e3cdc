// Collision and streaming in one pass over the fluid nodes.
//
// Sources: BGK: Qian, d'Humieres, Lallemand 1992. Two relaxation times: Ginzburg, Verhaeghe, d'Humieres,
// Commun. Comput. Phys. 3 (2008); with the magic parameter (tau+ - 1/2)(tau- - 1/2) = 3/16 a straight
// half-way wall stands exactly half-way. Equilibria, in terms of rho' = rho - 1 and the momentum j:
//   incompressible  He, Luo, J. Stat. Phys. 88 (1997):  f_i - w_i = w_i [rho' + 3 c.j + 9/2 (c.j)^2 - 3/2
//   j.j],        u = j compressible    second order in the Mach number:    f_i - w_i = w_i [rho' + 3 c.j +
//   (9/2 (c.j)^2 - 3/2 j.j)/rho],  u = j/rho
// Pressure is rho'/3 in both.
#pragma once

#include <array>
#include <cstddef>
#include <string>

#include "cells.hpp"
#include "lattice.hpp"
#include "populations.hpp"

namespace estuary::fluid {

enum class CollisionModel { trt, bgk };
enum class EquilibriumModel { incompressible, compressible };

/// Relaxation rates per step of the even and the odd part; BGK uses the first only.
struct Rates {
  double even = 1;
  double odd = 1;
};

/// 1/rho where the equilibrium has it.
struct Incompressible {
  static constexpr const char* name = "incompressible";
  [[gnu::always_inline]] static double inverse_density(double) { return 1.0; }
};
struct Compressible {
  static constexpr const char* name = "compressible";
  [[gnu::always_inline]] static double inverse_density(double excess) { return 1.0 / (1.0 + excess); }
};

/// Density excess rho' and momentum of one node.
struct Moments {
  double excess = 0;
  double momentum_x = 0;
  double momentum_y = 0;
};

template <class Lattice>
[[gnu::always_inline]] inline Moments moments_of(const std::array<double, Lattice::count>& f) {
  Moments m;
  unrolled<Lattice::count>([&](auto index) __attribute__((always_inline)) {
    constexpr auto i = static_cast<std::size_t>(index());
    constexpr auto c = Lattice::velocity[i];
    m.excess += f[i];
    if constexpr (c[0] == 1) m.momentum_x += f[i];
    if constexpr (c[0] == -1) m.momentum_x -= f[i];
    if constexpr (c[1] == 1) m.momentum_y += f[i];
    if constexpr (c[1] == -1) m.momentum_y -= f[i];
  });
  return m;
}

/// f_i - w_i at equilibrium.
template <class Lattice>
[[gnu::always_inline]] inline double equilibrium(int i, const Moments& m, double inverse_density) {
  const auto& c = Lattice::velocity[static_cast<std::size_t>(i)];
  const double along = c[0] * m.momentum_x + c[1] * m.momentum_y;
  const double square = m.momentum_x * m.momentum_x + m.momentum_y * m.momentum_y;
  return Lattice::weight[static_cast<std::size_t>(i)] *
         (m.excess + 3.0 * along + inverse_density * (4.5 * along * along - 1.5 * square));
}

/// Does one step of the kind that follows `parity`, the kind of the step before; the caller notes the new
/// one. The boundary rules must have been applied. To be called by every thread of a parallel region (or
/// outside one).
using CollideAndStream = void (*)(Populations&, Parity, const Cells&, Rates);
[[nodiscard]] CollideAndStream collide_and_stream(CollisionModel collision, EquilibriumModel equilibrium);

/// "d2q9-trt-incompressible".
[[nodiscard]] std::string variant_name(CollisionModel collision, EquilibriumModel equilibrium);

/// Rates of the viscosity (lattice units) and of the magic parameter.
[[nodiscard]] Rates relaxation_rates(double viscosity, double magic_parameter);

}  // namespace estuary::fluid
