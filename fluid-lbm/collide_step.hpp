// The one text of the step, for every lattice and option. Included by the files that compile variants of it.
#pragma once

#include <cmath>

#include "collide.hpp"

namespace estuary::fluid::step {

/// Symmetric tensor; z components in three dimensions only.
struct Tensor {
  double xx = 0;
  double yy = 0;
  double zz = 0;
  double xy = 0;
  double xz = 0;
  double yz = 0;
};

struct Vector {
  double x = 0;
  double y = 0;
  double z = 0;
};

/// sum_i c_i c_i (f_i - f_i^eq), the equilibrium's stress being rho'/3 + rho u u.
template <class Lattice>
[[gnu::always_inline]] inline Tensor nonequilibrium_stress(const std::array<double, Lattice::count>& f,
                                                           const Moments& m, double inverse) {
  Tensor s;
  unrolled<Lattice::count>([&](auto index) __attribute__((always_inline)) {
    constexpr auto i = static_cast<std::size_t>(index());
    constexpr auto c = Lattice::velocity[i];
    if constexpr (c[0] != 0) s.xx += f[i];
    if constexpr (c[1] != 0) s.yy += f[i];
    if constexpr (c[2] != 0) s.zz += f[i];
    if constexpr (c[0] * c[1] == 1) s.xy += f[i];
    if constexpr (c[0] * c[1] == -1) s.xy -= f[i];
    if constexpr (c[0] * c[2] == 1) s.xz += f[i];
    if constexpr (c[0] * c[2] == -1) s.xz -= f[i];
    if constexpr (c[1] * c[2] == 1) s.yz += f[i];
    if constexpr (c[1] * c[2] == -1) s.yz -= f[i];
  });
  const double isotropic = m.excess * (1.0 / 3.0);
  s.xx -= isotropic + inverse * m.momentum_x * m.momentum_x;
  s.yy -= isotropic + inverse * m.momentum_y * m.momentum_y;
  s.xy -= inverse * m.momentum_x * m.momentum_y;
  if constexpr (Lattice::dimension == 3) {
    s.zz -= isotropic + inverse * m.momentum_z * m.momentum_z;
    s.xz -= inverse * m.momentum_x * m.momentum_z;
    s.yz -= inverse * m.momentum_y * m.momentum_z;
  }
  return s;
}

// Written for few operations: in cache the step is limited by arithmetic. Constants are gathered outside the
// loop over nodes.
struct Trt {
  template <class Lattice, class Force>
  [[gnu::always_inline]] static void relax(std::array<double, Lattice::count>& f, const Moments& m,
                                           const Vector& force, double inverse, const Rates& rates) {
    const double half_even = 0.5 * rates.even;
    const double half_odd = 0.5 * rates.odd;
    const double kept = 1.0 - half_even - half_odd;  // of a population
    const double exchanged = half_odd - half_even;   // of its opposite
    const double square = square_of<Lattice>(m);
    double isotropic = rates.even * (m.excess - inverse * (1.5 * square));
    double along_force = 0;
    if constexpr (Force::second_order) {
      along_force = m.momentum_x * force.x + m.momentum_y * force.y;
      if constexpr (Lattice::dimension == 3) along_force += m.momentum_z * force.z;
      isotropic -= (1.0 - half_even) * inverse * (3.0 * along_force);
    }
    f[0] = (1.0 - rates.even) * f[0] + Lattice::weight[0] * isotropic;
    unrolled<static_cast<int>(Lattice::half.size())>([&](auto index) __attribute__((always_inline)) {
      constexpr auto i = static_cast<std::size_t>(Lattice::half[static_cast<std::size_t>(index())]);
      constexpr auto o = static_cast<std::size_t>(Lattice::opposite[i]);
      const double momentum = along<Lattice, i>(m.momentum_x, m.momentum_y, m.momentum_z);
      double even = Lattice::weight[i] * isotropic +
                    (4.5 * Lattice::weight[i] * rates.even) * inverse * (momentum * momentum);
      double odd = (3.0 * Lattice::weight[i] * rates.odd) * momentum;
      if constexpr (Force::any) {
        const double pushed = along<Lattice, i>(force.x, force.y, force.z);
        if constexpr (Force::second_order) {
          even += (9.0 * Lattice::weight[i] * (1.0 - half_even)) * inverse * (momentum * pushed);
          odd += (3.0 * Lattice::weight[i] * (1.0 - half_odd)) * pushed;
        } else {
          odd += (3.0 * Lattice::weight[i]) * pushed;
        }
      }
      const double one = f[i];
      const double other = f[o];
      f[i] = kept * one + exchanged * other + (even + odd);
      f[o] = kept * other + exchanged * one + (even - odd);
    });
  }
};

struct Bgk {
  template <class Lattice, class Force>
  [[gnu::always_inline]] static void relax(std::array<double, Lattice::count>& f, const Moments& m,
                                           const Vector& force, double inverse, const Rates& rates) {
    double along_force = 0;
    if constexpr (Force::second_order) {
      along_force = m.momentum_x * force.x + m.momentum_y * force.y;
      if constexpr (Lattice::dimension == 3) along_force += m.momentum_z * force.z;
    }
    unrolled<Lattice::count>([&](auto index) __attribute__((always_inline)) {
      constexpr auto i = static_cast<std::size_t>(index());
      f[i] -= rates.even * (f[i] - equilibrium<Lattice>(index(), m, inverse));
      if constexpr (Force::any) {
        const double pushed = along<Lattice, i>(force.x, force.y, force.z);
        if constexpr (Force::second_order) {
          const double momentum = along<Lattice, i>(m.momentum_x, m.momentum_y, m.momentum_z);
          f[i] += (Lattice::weight[i] * (1.0 - 0.5 * rates.even)) *
                  (3.0 * pushed + inverse * (9.0 * momentum * pushed - 3.0 * along_force));
        } else {
          f[i] += (3.0 * Lattice::weight[i]) * pushed;
        }
      }
    });
  }
};

/// Rebuilds all populations from density, velocity and the relaxed second central moments, with every higher
/// central moment at equilibrium. With the trace relaxed like the shear this is the recursive regularised
/// operator, whose recursion for the higher Hermite coefficients says the same; with the trace set to
/// equilibrium (`trace_at_equilibrium`) it is the central-moment operator, which damps sound more.
template <bool trace_at_equilibrium>
struct CentralMoments {
  // Raw moments of one pair of axes, less those of the fluid at rest, from central ones.
  struct Pair {
    double ab = 0;
    double aab = 0;
    double abb = 0;
    double aabb = 0;
  };
  // Arguments: density, its excess, velocities, half forces, stresses less rho'/3 + 1/3.
  [[gnu::always_inline]] static Pair pair(double density, double excess, double ua, double ub, double ka,
                                          double kb, double saa, double sbb, double kab) {
    const double kaa = density * (1.0 / 3.0) + saa;
    const double kbb = density * (1.0 / 3.0) + sbb;
    const double kaab = kb * (1.0 / 3.0);
    const double kabb = ka * (1.0 / 3.0);
    Pair m;
    m.ab = kab + ua * kb + ub * ka + density * ua * ub;
    m.aab = kaab + ub * kaa + 2 * ua * kab + 2 * ua * ub * ka + ua * ua * kb + density * ua * ua * ub;
    m.abb = kabb + ua * kbb + 2 * ub * kab + 2 * ua * ub * kb + ub * ub * ka + density * ua * ub * ub;
    m.aabb = excess * (1.0 / 9.0) + 2 * ub * kaab + 2 * ua * kabb + ub * ub * kaa + ua * ua * kbb +
             4 * ua * ub * kab + 2 * ua * ub * (ub * ka + ua * kb) + density * ua * ua * ub * ub;
    return m;
  }

  template <class Lattice, class Force>
  [[gnu::always_inline]] static void relax(std::array<double, Lattice::count>& f, const Moments& m,
                                           const Vector& force, double inverse, const Rates& rates) {
    constexpr bool space = Lattice::dimension == 3;
    const double density = 1.0 + m.excess;
    const double ux = m.momentum_x * inverse;
    const double uy = m.momentum_y * inverse;
    const double uz = space ? m.momentum_z * inverse : 0.0;
    Tensor s = nonequilibrium_stress<Lattice>(f, m, inverse);
    Vector k;
    if constexpr (Force::any) {
      // The momentum in `m` holds half the force, of which the populations know nothing.
      k = {0.5 * force.x, 0.5 * force.y, 0.5 * force.z};
      s.xx += 2 * ux * k.x;
      s.yy += 2 * uy * k.y;
      s.xy += ux * k.y + uy * k.x;
      if constexpr (space) {
        s.zz += 2 * uz * k.z;
        s.xz += ux * k.z + uz * k.x;
        s.yz += uy * k.z + uz * k.y;
      }
    }
    const double left = 1.0 - rates.even;
    if constexpr (trace_at_equilibrium) {
      const double mean = space ? (s.xx + s.yy + s.zz) * (1.0 / 3.0) : (s.xx + s.yy) * 0.5;
      s.xx -= mean;
      s.yy -= mean;
      if constexpr (space) s.zz -= mean;
    }
    s.xx *= left;
    s.yy *= left;
    s.xy *= left;
    if constexpr (space) {
      s.zz *= left;
      s.xz *= left;
      s.yz *= left;
    }
    const Vector j{m.momentum_x + k.x, m.momentum_y + k.y, m.momentum_z + k.z};
    const double third = m.excess * (1.0 / 3.0);
    const double xx = third + s.xx + 2 * ux * k.x + density * ux * ux;
    const double yy = third + s.yy + 2 * uy * k.y + density * uy * uy;
    const double zz = space ? third + s.zz + 2 * uz * k.z + density * uz * uz : 0.0;
    const Pair xy = pair(density, m.excess, ux, uy, k.x, k.y, s.xx, s.yy, s.xy);
    Pair xz;
    Pair yz;
    if constexpr (space) {
      xz = pair(density, m.excess, ux, uz, k.x, k.z, s.xx, s.zz, s.xz);
      yz = pair(density, m.excess, uy, uz, k.y, k.z, s.yy, s.zz, s.yz);
    }
    unrolled<Lattice::count>([&](auto index) __attribute__((always_inline)) {
      constexpr auto i = static_cast<std::size_t>(index());
      constexpr auto c = Lattice::velocity[i];
      constexpr auto diagonal = [](int a, int b, const Pair& p) __attribute__((always_inline)) {
        return 0.25 * (a * b * p.ab + b * p.aab + a * p.abb + p.aabb);
      };
      if constexpr (c[0] != 0 && c[1] != 0) {
        f[i] = diagonal(c[0], c[1], xy);
      } else if constexpr (c[0] != 0 && c[2] != 0) {
        f[i] = diagonal(c[0], c[2], xz);
      } else if constexpr (c[1] != 0 && c[2] != 0) {
        f[i] = diagonal(c[1], c[2], yz);
      } else if constexpr (c[0] != 0) {
        f[i] = 0.5 * (c[0] * j.x + xx - c[0] * (xy.abb + xz.abb) - (xy.aabb + xz.aabb));
      } else if constexpr (c[1] != 0) {
        f[i] = 0.5 * (c[1] * j.y + yy - c[1] * (xy.aab + yz.abb) - (xy.aabb + yz.aabb));
      } else if constexpr (c[2] != 0) {
        f[i] = 0.5 * (c[2] * j.z + zz - c[2] * (xz.aab + yz.aab) - (xz.aabb + yz.aabb));
      } else {
        f[i] = m.excess - (xx + yy + zz) + (xy.aabb + xz.aabb + yz.aabb);
      }
    });
  }
};

struct NoForce {
  static constexpr bool any = false;
  static constexpr bool second_order = false;
};
struct GuoForce {
  static constexpr bool any = true;
  static constexpr bool second_order = true;
};
struct UnshiftedForce {
  static constexpr bool any = true;
  static constexpr bool second_order = false;
};

struct ConstantViscosity {
  static constexpr bool varies = false;
};
struct SmagorinskyViscosity {
  static constexpr bool varies = true;
  // 2 tau = tau_0 + sqrt(tau_0^2 + 18 C^2 sqrt(2 Pi:Pi) / rho)
  [[gnu::always_inline]] static double even_part(const CollisionParameters& p, double stress_norm) {
    const double tau = 3.0 * p.law.base_viscosity + 0.5;
    const double c = p.law.smagorinsky_constant;
    return 0.5 * (tau + std::sqrt(tau * tau + 18.0 * c * c * stress_norm)) - 0.5;
  }
};
struct GeneralisedNewtonianViscosity {
  static constexpr bool varies = true;
  static double even_part(const CollisionParameters& p, double stress_norm) {
    return 3.0 * viscosity_from_stress(p.law, 1.5 * stress_norm);
  }
};

// Rates of a node whose viscosity depends on its stress.
template <class Lattice, class Viscosity>
[[gnu::always_inline]] inline Rates local_rates(const std::array<double, Lattice::count>& f, const Moments& m,
                                                const Vector& force, double inverse,
                                                const CollisionParameters& parameters) {
  Tensor s = nonequilibrium_stress<Lattice>(f, m, inverse);
  const double ux = m.momentum_x * inverse;
  const double uy = m.momentum_y * inverse;
  s.xx += ux * force.x;
  s.yy += uy * force.y;
  s.xy += 0.5 * (ux * force.y + uy * force.x);
  double square = s.xx * s.xx + s.yy * s.yy + 2 * s.xy * s.xy;
  if constexpr (Lattice::dimension == 3) {
    const double uz = m.momentum_z * inverse;
    s.zz += uz * force.z;
    s.xz += 0.5 * (ux * force.z + uz * force.x);
    s.yz += 0.5 * (uy * force.z + uz * force.y);
    square += s.zz * s.zz + 2 * (s.xz * s.xz + s.yz * s.yz);
  }
  const double even = Viscosity::even_part(parameters, std::sqrt(2 * square) * inverse);
  return {1.0 / (even + 0.5), 1.0 / (parameters.magic_parameter / even + 0.5)};
}

// One node, its values read at `place[i] + x`. Kept apart from the loop: what is declared inside the
// body of a simd loop is given an array per vector lane, and the loop is not vectorised.
template <class Lattice, class Collision, class Equilibrium, class Force, class Viscosity, class Stored>
[[gnu::always_inline]] inline void update(const std::array<Stored*, Lattice::count>& place, std::ptrdiff_t x,
                                          const CollisionParameters& parameters) {
  std::array<double, Lattice::count> f;
  unrolled<Lattice::count>([&](auto index) __attribute__((always_inline)) {
    constexpr auto i = static_cast<std::size_t>(index());
    f[i] = static_cast<double>(place[i][x]);
  });
  Moments m = moments_of<Lattice>(f);
  const double inverse = Equilibrium::inverse_density(m.excess);
  Vector force;
  if constexpr (Force::any) {
    const double density = Equilibrium::density(m.excess);
    force = {density * parameters.acceleration[0], density * parameters.acceleration[1],
             density * parameters.acceleration[2]};
    if constexpr (Force::second_order) {
      m.momentum_x += 0.5 * force.x;
      m.momentum_y += 0.5 * force.y;
      m.momentum_z += 0.5 * force.z;
    }
  }
  if constexpr (Viscosity::varies) {
    const Rates rates = local_rates<Lattice, Viscosity>(f, m, force, inverse, parameters);
    Collision::template relax<Lattice, Force>(f, m, force, inverse, rates);
  } else {
    Collision::template relax<Lattice, Force>(f, m, force, inverse, parameters.rates);
  }
  unrolled<Lattice::count>([&](auto index) __attribute__((always_inline)) {
    constexpr auto i = static_cast<std::size_t>(index());
    place[static_cast<std::size_t>(Lattice::opposite[i])][x] = static_cast<Stored>(f[i]);
  });
}

// The value that leaves along i goes where the one that came along the opposite of i was read, after either
// kind of step: reading places are all that distinguishes the two kinds.
template <class Lattice, class Collision, class Equilibrium, class Force, class Viscosity, class Stored>
void pass(Populations& populations, Parity parity, const std::vector<std::vector<Span>>& rows,
          const CollisionParameters& parameters) {
  const CollisionParameters own = parameters;
#pragma omp for schedule(static)
  for (int row = 0; row < populations.rows(); ++row) {
    std::array<Stored*, Lattice::count> place;
    for (int i = 0; i < Lattice::count; ++i) {
      place[static_cast<std::size_t>(i)] =
          populations.data<Stored>() + populations.incoming(parity, i, populations.row_start(row));
    }
    for (const Span span : rows[static_cast<std::size_t>(row)]) {
#pragma omp simd
      for (int x = span.begin; x < span.end; ++x) {
        update<Lattice, Collision, Equilibrium, Force, Viscosity>(place, x, own);
      }
    }
  }
}

/// The variant of one lattice, or null.
template <class Lattice, class Viscosity, class Force, class Stored = double>
CollideAndStream variant(const StepChoice& choice) {
  const bool compressible = choice.equilibrium == EquilibriumModel::compressible;
  switch (choice.collision) {
    case CollisionModel::trt:
      return compressible ? &pass<Lattice, Trt, Compressible, Force, Viscosity, Stored>
                          : &pass<Lattice, Trt, Incompressible, Force, Viscosity, Stored>;
    case CollisionModel::bgk:
      return compressible ? &pass<Lattice, Bgk, Compressible, Force, Viscosity, Stored>
                          : &pass<Lattice, Bgk, Incompressible, Force, Viscosity, Stored>;
    case CollisionModel::recursive_regularised:
    case CollisionModel::central_moment:
      break;
  }
  if constexpr (!Force::any || Force::second_order) {
    if (!compressible) return nullptr;
    return choice.collision == CollisionModel::central_moment
               ? &pass<Lattice, CentralMoments<true>, Compressible, Force, Viscosity, Stored>
               : &pass<Lattice, CentralMoments<false>, Compressible, Force, Viscosity, Stored>;
  }
  return nullptr;
}

// Each in a file of its own.
CollideAndStream plane_without_force(const StepChoice& choice);
CollideAndStream plane_with_force(const StepChoice& choice);
CollideAndStream plane_with_varying_viscosity(const StepChoice& choice);
CollideAndStream space_without_force(const StepChoice& choice);
CollideAndStream space_with_force(const StepChoice& choice);
CollideAndStream space_with_varying_viscosity(const StepChoice& choice);
CollideAndStream in_single_precision(const StepChoice& choice);

}  // namespace estuary::fluid::step
