// The collision operators, body forces and viscosities that variants of the step are made of: functions of
// the populations of one node, or of several in the lanes of a vector.
#pragma once

#include <cmath>

#include "collide.hpp"
#include "lanes.hpp"

namespace estuary::fluid::step {

/// Symmetric tensor; z components in three dimensions only.
template <class Value>
struct Tensor {
  Value xx{};
  Value yy{};
  Value zz{};
  Value xy{};
  Value xz{};
  Value yz{};
};

template <class Value>
struct Vector {
  Value x{};
  Value y{};
  Value z{};
};

/// Rates, the same for all nodes (a number) or each node's own (a vector).
template <class Value>
struct RatesOf {
  Value even{};
  Value odd{};
};

/// sum_i c_i c_i (f_i - f_i^eq), the equilibrium's stress being rho'/3 + rho u u.
template <class Lattice, class Value>
[[gnu::always_inline]] inline Tensor<Value> nonequilibrium_stress(const std::array<Value, Lattice::count>& f,
                                                                  const MomentsOf<Value>& m,
                                                                  const Value& inverse) {
  using Real = typename RealOf<Value>::type;
  Tensor<Value> s;
  unrolled<static_cast<int>(Lattice::half.size())>([&](auto index) __attribute__((always_inline)) {
    constexpr auto i = static_cast<std::size_t>(Lattice::half[static_cast<std::size_t>(index())]);
    constexpr auto c = Lattice::velocity[i];
    const Value sum = f[i] + f[static_cast<std::size_t>(Lattice::opposite[i])];
    if constexpr (c[0] != 0) s.xx += sum;
    if constexpr (c[1] != 0) s.yy += sum;
    if constexpr (c[2] != 0) s.zz += sum;
    if constexpr (c[0] * c[1] == 1) s.xy += sum;
    if constexpr (c[0] * c[1] == -1) s.xy -= sum;
    if constexpr (c[0] * c[2] == 1) s.xz += sum;
    if constexpr (c[0] * c[2] == -1) s.xz -= sum;
    if constexpr (c[1] * c[2] == 1) s.yz += sum;
    if constexpr (c[1] * c[2] == -1) s.yz -= sum;
  });
  const Value isotropic = m.excess * Real(1.0 / 3.0);
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

// Written for few operations: in cache the step is limited by arithmetic. With s and d the sum and the
// difference of two opposite populations, which the moments need anyway, both leave as a + b and a - b,
// a = (1 - rate_even) s/2 + rate_even f_even^eq, b the same with d and the odd part. Constants are gathered
// outside the loop over nodes.
struct Trt {
  template <class Lattice, class Force, class Value, class Rate>
  [[gnu::always_inline]] static void relax(std::array<Value, Lattice::count>& f, const MomentsOf<Value>& m,
                                           const Vector<Value>& force, const Value& inverse,
                                           const RatesOf<Rate>& rates) {
    using Real = typename RealOf<Value>::type;
    const Rate kept_even = Real(0.5) * (1 - rates.even);
    const Rate kept_odd = Real(0.5) * (1 - rates.odd);
    const Rate half_left_even = 1 - Real(0.5) * rates.even;
    const Rate half_left_odd = 1 - Real(0.5) * rates.odd;
    Value isotropic = rates.even * (m.excess - inverse * (Real(1.5) * square_of<Lattice>(m)));
    if constexpr (Force::second_order) {
      Value along_force = m.momentum_x * force.x + m.momentum_y * force.y;
      if constexpr (Lattice::dimension == 3) along_force += m.momentum_z * force.z;
      isotropic -= half_left_even * inverse * (3 * along_force);
    }
    f[0] = (1 - rates.even) * f[0] + Real(Lattice::weight[0]) * isotropic;
    unrolled<static_cast<int>(Lattice::half.size())>([&](auto index) __attribute__((always_inline)) {
      constexpr auto i = static_cast<std::size_t>(Lattice::half[static_cast<std::size_t>(index())]);
      constexpr auto o = static_cast<std::size_t>(Lattice::opposite[i]);
      constexpr auto weight = Real(Lattice::weight[i]);
      const Value momentum = along<Lattice, i>(m.momentum_x, m.momentum_y, m.momentum_z);
      Value even = weight * isotropic + (Real(4.5) * weight * rates.even) * inverse * (momentum * momentum);
      Value odd = (3 * weight * rates.odd) * momentum;
      if constexpr (Force::any) {
        const Value pushed = along<Lattice, i>(force.x, force.y, force.z);
        if constexpr (Force::second_order) {
          even += (9 * weight * half_left_even) * inverse * (momentum * pushed);
          odd += (3 * weight * half_left_odd) * pushed;
        } else {
          odd += (3 * weight) * pushed;
        }
      }
      even += kept_even * (f[i] + f[o]);
      odd += kept_odd * (f[i] - f[o]);
      f[i] = even + odd;
      f[o] = even - odd;
    });
  }
};

/// Two equal rates.
struct Bgk {
  template <class Lattice, class Force, class Value, class Rate>
  [[gnu::always_inline]] static void relax(std::array<Value, Lattice::count>& f, const MomentsOf<Value>& m,
                                           const Vector<Value>& force, const Value& inverse,
                                           const RatesOf<Rate>& rates) {
    Trt::relax<Lattice, Force>(f, m, force, inverse, RatesOf<Rate>{rates.even, rates.even});
  }
};

/// Rebuilds all populations from density, velocity and the relaxed second central moments, with every higher
/// central moment at equilibrium. With the trace relaxed like the shear this is the recursive regularised
/// operator, whose recursion for the higher Hermite coefficients says the same; with the trace set to
/// equilibrium (`trace_at_equilibrium`) it is the central-moment operator, which damps sound more.
template <bool trace_at_equilibrium>
struct CentralMoments {
  // Raw moments of one pair of axes, less those of the fluid at rest, from central ones.
  template <class Value>
  struct Pair {
    Value ab{};
    Value aab{};
    Value abb{};
    Value aabb{};
  };
  // Arguments: density, its excess, velocities, half forces, stresses less rho'/3 + 1/3.
  template <class Value>
  [[gnu::always_inline]] static Pair<Value> pair(const Value& density, const Value& excess, const Value& ua,
                                                 const Value& ub, const Value& ka, const Value& kb,
                                                 const Value& saa, const Value& sbb, const Value& kab) {
    using Real = typename RealOf<Value>::type;
    const Value kaa = density * Real(1.0 / 3.0) + saa;
    const Value kbb = density * Real(1.0 / 3.0) + sbb;
    const Value kaab = kb * Real(1.0 / 3.0);
    const Value kabb = ka * Real(1.0 / 3.0);
    Pair<Value> m;
    m.ab = kab + ua * kb + ub * ka + density * ua * ub;
    m.aab = kaab + ub * kaa + 2 * ua * kab + 2 * ua * ub * ka + ua * ua * kb + density * ua * ua * ub;
    m.abb = kabb + ua * kbb + 2 * ub * kab + 2 * ua * ub * kb + ub * ub * ka + density * ua * ub * ub;
    m.aabb = excess * Real(1.0 / 9.0) + 2 * ub * kaab + 2 * ua * kabb + ub * ub * kaa + ua * ua * kbb +
             4 * ua * ub * kab + 2 * ua * ub * (ub * ka + ua * kb) + density * ua * ua * ub * ub;
    return m;
  }

  // A population along a diagonal and one along an axis, from what is odd and even in its sign.
  template <int a, int b, class Value>
  [[gnu::always_inline]] static Value diagonal(const Pair<Value>& p) {
    using Real = typename RealOf<Value>::type;
    const Value even = a * b > 0 ? p.aabb + p.ab : p.aabb - p.ab;
    const Value odd = a * b > 0 ? p.aab + p.abb : p.aab - p.abb;
    return Real(0.25) * (b > 0 ? even + odd : even - odd);
  }
  template <int sign, class Value>
  [[gnu::always_inline]] static Value axial(const Value& odd, const Value& even) {
    using Real = typename RealOf<Value>::type;
    return Real(0.5) * (sign > 0 ? even + odd : even - odd);
  }

  template <class Lattice, class Force, class Value, class Rate>
  [[gnu::always_inline]] static void relax(std::array<Value, Lattice::count>& f, const MomentsOf<Value>& m,
                                           const Vector<Value>& force, const Value& inverse,
                                           const RatesOf<Rate>& rates) {
    using Real = typename RealOf<Value>::type;
    constexpr bool space = Lattice::dimension == 3;
    const Value density = 1 + m.excess;
    const Value ux = m.momentum_x * inverse;
    const Value uy = m.momentum_y * inverse;
    const Value uz = space ? m.momentum_z * inverse : Value{};
    Tensor<Value> s = nonequilibrium_stress<Lattice>(f, m, inverse);
    Vector<Value> k;
    if constexpr (Force::any) {
      // The momentum in `m` holds half the force, of which the populations know nothing.
      k = {Real(0.5) * force.x, Real(0.5) * force.y, Real(0.5) * force.z};
      s.xx += 2 * ux * k.x;
      s.yy += 2 * uy * k.y;
      s.xy += ux * k.y + uy * k.x;
      if constexpr (space) {
        s.zz += 2 * uz * k.z;
        s.xz += ux * k.z + uz * k.x;
        s.yz += uy * k.z + uz * k.y;
      }
    }
    const Rate left = 1 - rates.even;
    if constexpr (trace_at_equilibrium) {
      const Value mean = space ? (s.xx + s.yy + s.zz) * Real(1.0 / 3.0) : (s.xx + s.yy) * Real(0.5);
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
    const Vector<Value> j{m.momentum_x + k.x, m.momentum_y + k.y, m.momentum_z + k.z};
    const Value third = m.excess * Real(1.0 / 3.0);
    const Value xx = third + s.xx + 2 * ux * k.x + density * ux * ux;
    const Value yy = third + s.yy + 2 * uy * k.y + density * uy * uy;
    const Value zz = space ? third + s.zz + 2 * uz * k.z + density * uz * uz : Value{};
    const Pair<Value> xy = pair(density, m.excess, ux, uy, k.x, k.y, s.xx, s.yy, s.xy);
    Pair<Value> xz;
    Pair<Value> yz;
    if constexpr (space) {
      xz = pair(density, m.excess, ux, uz, k.x, k.z, s.xx, s.zz, s.xz);
      yz = pair(density, m.excess, uy, uz, k.y, k.z, s.yy, s.zz, s.yz);
    }
    unrolled<Lattice::count>([&](auto index) __attribute__((always_inline)) {
      constexpr auto i = static_cast<std::size_t>(index());
      constexpr auto c = Lattice::velocity[i];
      if constexpr (c[0] != 0 && c[1] != 0) {
        f[i] = diagonal<c[0], c[1]>(xy);
      } else if constexpr (c[0] != 0 && c[2] != 0) {
        f[i] = diagonal<c[0], c[2]>(xz);
      } else if constexpr (c[1] != 0 && c[2] != 0) {
        f[i] = diagonal<c[1], c[2]>(yz);
      } else if constexpr (c[0] != 0) {
        f[i] = axial<c[0]>(j.x - (xy.abb + xz.abb), xx - (xy.aabb + xz.aabb));
      } else if constexpr (c[1] != 0) {
        f[i] = axial<c[1]>(j.y - (xy.aab + yz.abb), yy - (xy.aabb + yz.aabb));
      } else if constexpr (c[2] != 0) {
        f[i] = axial<c[2]>(j.z - (xz.aab + yz.aab), zz - (xz.aabb + yz.aabb));
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
  template <class Value>
  [[gnu::always_inline]] static Value even_part(const CollisionParameters& p, const Value& stress_norm) {
    using Real = typename RealOf<Value>::type;
    const double tau = 3.0 * p.law.base_viscosity + 0.5;
    const double c = p.law.smagorinsky_constant;
    const Value square = Real(tau * tau) + Real(18.0 * c * c) * stress_norm;
    return Real(0.5) * (Real(tau) + each_lane(square, [](Real x) { return std::sqrt(x); })) - Real(0.5);
  }
};
struct GeneralisedNewtonianViscosity {
  static constexpr bool varies = true;
  template <class Value>
  [[gnu::always_inline]] static Value even_part(const CollisionParameters& p, const Value& stress_norm) {
    using Real = typename RealOf<Value>::type;
    return each_lane(stress_norm, [&p](Real x) {
      return static_cast<Real>(3.0 * (*p.viscosities)(1.5 * static_cast<double>(x)));
    });
  }
};

// Rates of a node whose viscosity depends on its stress.
template <class Lattice, class Viscosity, class Value>
[[gnu::always_inline]] inline RatesOf<Value> local_rates(const std::array<Value, Lattice::count>& f,
                                                         const MomentsOf<Value>& m,
                                                         const Vector<Value>& force, const Value& inverse,
                                                         const CollisionParameters& parameters) {
  using Real = typename RealOf<Value>::type;
  Tensor<Value> s = nonequilibrium_stress<Lattice>(f, m, inverse);
  const Value ux = m.momentum_x * inverse;
  const Value uy = m.momentum_y * inverse;
  s.xx += ux * force.x;
  s.yy += uy * force.y;
  s.xy += Real(0.5) * (ux * force.y + uy * force.x);
  Value square = s.xx * s.xx + s.yy * s.yy + 2 * s.xy * s.xy;
  if constexpr (Lattice::dimension == 3) {
    const Value uz = m.momentum_z * inverse;
    s.zz += uz * force.z;
    s.xz += Real(0.5) * (ux * force.z + uz * force.x);
    s.yz += Real(0.5) * (uy * force.z + uz * force.y);
    square += s.zz * s.zz + 2 * (s.xz * s.xz + s.yz * s.yz);
  }
  const Value norm = each_lane(2 * square, [](Real x) { return std::sqrt(x); });
  const Value even = Viscosity::even_part(parameters, norm * inverse);
  // 1 / (even + 1/2) and 1 / (magic / even + 1/2) with one division: it is what takes longest here.
  const Value first = even + Real(0.5);
  const Value second = Real(parameters.magic_parameter) + Real(0.5) * even;
  const Value share = 1 / (first * second);
  return {second * share, even * first * share};
}

}  // namespace estuary::fluid::step
