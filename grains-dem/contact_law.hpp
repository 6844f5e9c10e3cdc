// The laws of one contact between two grains, or a grain and a wall, and their constants.
//
//   normal      linear viscoelastic (Cundall & Strack 1979): F_n = max(0, k_n overlap + nu_n closing speed),
//   with the
//               damping that gives the restitution coefficient whatever the speed; the force is cut off at
//               zero, so that a separating contact never pulls. Hertz (spheres): F_n = 4/3 E* sqrt(R*
//               overlap^3), damped after Tsuji, Tanaka & Ishida 1992.
//   tangential  pure Coulomb sliding, F_t = mu F_n against the sliding velocity; or a spring with damping
//   whose
//               stretch is turned with the contact and rewound when the Coulomb limit is reached.
//   rolling     resisting moment limited to mu_r F_n, mu_r = coefficient x (r_i + r_j): growing with the
//   relative spin
//               (Zhu & Yu 2006), or a spring-slider; in space the same for pivoting about the normal.
//   cohesion    a constant attraction while grains touch.
#pragma once

#include <cstddef>
#include <string_view>

#include "vector.hpp"

namespace estuary::grains {

enum class NormalLaw { linear, hertz };
enum class FrictionLaw { none, coulomb, spring };
enum class RollingLaw { none, viscous, spring };

/// Which laws act: chosen once, compiled as one variant.
struct LawChoice {
  NormalLaw normal = NormalLaw::linear;
  FrictionLaw friction = FrictionLaw::spring;
  RollingLaw rolling = RollingLaw::none;
  bool cohesive = false;
};

/// Constants of a kind of contact, ready for the kernel.
struct ContactConstants {
  double normal_stiffness = 0;      // linear: k_n [N/m]; Hertz: 4/3 E* [Pa]
  double damping = 0;               // nu_n = damping x sqrt(m*) (linear) or x sqrt(m* S_n) (Hertz)
  double friction = 0;              // mu
  double tangential_stiffness = 0;  // linear: k_t [N/m]; Hertz: 8 G* [Pa]
  double inverse_tangential_stiffness = 0;
  double tangential_damping = 0;  // nu_t = this x nu_n
  double rolling_friction = 0;    // mu_r / (r_i + r_j)
  double pivoting_friction = 0;
  double rolling_damping = 0;    // viscous law: mu'_r [N m s]; spring: share of the critical damping
  double rolling_stiffness = 0;  // spring: moment per angle / R*^2 [N/m]
  double cohesion = 0;           // [N]
};

/// Damping / sqrt(k_n m*) that makes the uncut linear contact restitute `restitution` (1.12 of the thesis).
double linear_damping_ratio(double restitution);
/// Restitution of the linear contact with the cut at zero force, which ends earlier than the uncut one (a
/// little above `restitution`); Schwager & Poeschel 2007.
double cut_restitution(double restitution);
/// Duration of a linear contact [s] (1.9): pi / sqrt(k_n/m* - (nu_n/2m*)^2).
double linear_contact_time(double normal_stiffness, double restitution, double effective_mass);
/// Duration of an elastic Hertz contact [s]: 2.87 (m*^2 / (R* E*^2 v))^(1/5).
double hertz_contact_time(double effective_modulus, double effective_mass, double effective_radius,
                          double speed);

/// Energy that left grains at contacts, and that moving walls gave them [J; J/m in the plane].
struct EnergyLedger {
  double normal = 0;      // dissipated by normal damping and the cut-off
  double tangential = 0;  // by sliding and tangential damping
  double rolling = 0;     // by rolling and pivoting resistance
  double given = 0;       // work of moving walls and of grains that move as prescribed
  EnergyLedger& operator+=(const EnergyLedger& other) {
    normal += other.normal;
    tangential += other.tangential;
    rolling += other.rolling;
    given += other.given;
    return *this;
  }
  [[nodiscard]] double dissipated() const { return normal + tangential + rolling; }
};

/// Numbers a contact remembers: the tangential stretch, then the rolling angles (and the pivoting angle).
template <int D, FrictionLaw F, RollingLaw R>
inline constexpr std::size_t history_size = (F == FrictionLaw::spring ? spin_components<D> : 0) +
                                            (R == RollingLaw::spring ? (D == 2 ? 1 : 4) : 0);

template <int D>
std::size_t history_size_of(const LawChoice& law);

/// Geometry and motion of one contact; j is the other grain or the wall. Along the tangent vectors have one
/// component in the plane, on the tangent (-n_y, n_x), and three in space.
template <int D>
struct ContactKinematics {
  Vector<D> normal;       // unit, from i to j
  double overlap;         // > 0 [m]
  double closing;         // speed of approach [m/s]
  Spin<D> sliding;        // tangential velocity of j relative to i at the contact [m/s]
  Spin<D> spin;           // of i relative to j [rad/s]
  double radius_sum;      // r_i + r_j; the diameter of i at a wall
  double reduced_radius;  // R* = r_i r_j / (r_i + r_j)
  double root_mass;       // sqrt(m*)
  double slowing;         // time by which the force's velocity is later than `closing`, over m* [s/kg]
};

template <int D>
struct ContactForce {
  double along;      // force on i along the normal (negative: repulsion); on j the opposite
  Spin<D> friction;  // tangential force on i
  Spin<D> moment;    // rolling and pivoting resistance on i; on j the opposite

  /// Force on i.
  [[nodiscard]] Vector<D> vector(const Vector<D>& normal) const {
    if constexpr (D == 2) {
      return {along * normal[0] - friction[0] * normal[1], along * normal[1] + friction[0] * normal[0]};
    } else {
      return along * normal + friction;
    }
  }
  /// Torque of the force about i, per length of the arm.
  [[nodiscard]] Spin<D> torque(const Vector<D>& normal) const {
    if constexpr (D == 2) {
      return friction;
    } else {
      return arm_times_force(normal, friction);
    }
  }
};

/// Splits the velocity of j relative to i (of the centres) and the velocity that spins make at the contact,
/// turning = arm_i spin_i + arm_j spin_j, into approach and sliding.
template <int D>
inline void split_velocity(ContactKinematics<D>& k, const Vector<D>& velocity, const Spin<D>& turning) {
  k.closing = -dot(velocity, k.normal);
  if constexpr (D == 2) {
    k.sliding[0] = velocity[1] * k.normal[0] - velocity[0] * k.normal[1] - turning[0];
  } else {
    k.sliding = velocity + k.closing * k.normal - spin_times_arm(turning, k.normal);
  }
}

}  // namespace estuary::grains
