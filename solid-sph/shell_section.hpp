// The cross-section of a shell: resultants of membrane, transverse shear and bending from their strains,
// elastic or elasto-plastic without points through the thickness, and when a link of it breaks.
//
// Plasticity on resultants (Ilyushin 1956; Crisfield 1981). With the thickness h, c = 2 / sqrt(3) in plane
// strain and 1 in plane stress, the equivalent stress of normal force N, moment M and shear force T is
//     s^2 = a^2 + b^2 + |a b| / sqrt(3) + 3 w (T / h)^2,   a = N / (c h),   b = 6 M / (c psi h^2),
// psi = 1 yields with the skin, psi = 3/2 with the whole section. Between both psi grows with the plastic
// curvature so that the moment of a rectangular section in pure bending is exact for perfect plasticity:
//     M / M_p = 1 - 1 / (3 k^2),   k - 3/2 + 1 / (2 k^2) = plastic curvature / curvature at first yield.
// Flow is associated in the space of (N, M, T), the return implicit, and hardening follows the plastic strain
// averaged over the thickness by work (h yield dp = N de_p + M dk_p + T dg_p). The membrane strain of a
// plastic section is logarithmic and flow keeps the volume: the sheet thins as it is stretched.
#pragma once

#include <cstddef>

#include "plasticity.hpp"
#include "rupture_limits.hpp"

namespace estuary::solid {

/// What psi of the yield condition does.
enum class Hinge { growing, section, skin };

/// Artificial viscosity of a row's links; 0: none. With the links' length L, the thickness h and c^2 = E' /
/// rho
struct ShellViscosity {
  // Monaghan's, of links that grow shorter: shares of critical damping of the shortest waves along the row,
  // `quadratic` times the speed at which a link closes over c.
  double linear = 0, quadratic = 0;
  // Times rho c min(L, h) and the section's area and moment. Of critical damping of the shortest waves
  // `bending` is the share bending min(L, h) / L; `shear` (with k = 5/6 and nu = 0.3) 3.7 times itself at
  // h = L and 3.2 times itself in thin shells.
  double shear = 0, bending = 0;
  double normal_filter = 0;  // share of the way to its neighbours' mean that a fibre turns in every step

  [[nodiscard]] bool any() const { return linear > 0 || quadratic > 0 || shear > 0 || bending > 0; }
};

struct ShellSection {
  double thickness = 0;                         // [m]; 0: the body is no shell
  double young_modulus = 0, shear_modulus = 0;  // E' and G [Pa]
  double shear_correction = 5.0 / 6.0;          // k
  double density = 0;                           // [kg/m3]
  Plasticity plasticity = {};                   // without a yield stress: elastic
  double plane_factor = 1;                      // c
  Hinge hinge = Hinge::growing;
  double shear_weight = 1;  // w
  RuptureLimits rupture = {};
  ShellViscosity viscosity = {};

  [[nodiscard]] bool plastic() const { return !plasticity.yield.empty(); }
  [[nodiscard]] double membrane() const { return young_modulus * thickness; }
  [[nodiscard]] double shear() const { return shear_correction * shear_modulus * thickness; }
  [[nodiscard]] double bending() const { return membrane() * thickness * thickness / 12; }
};

/// Normal force, shear force and moment (N/m, N/m, N m/m), or the strains they do work on.
struct SectionVector {
  double membrane = 0, shear = 0, bending = 0;
};

/// What a section remembers: plastic strains (membrane, shear, bending), equivalent plastic strain, plastic
/// curvature so far over that at first yield, work dissipated per length [J/m2].
inline constexpr std::size_t kSectionHistory = 6;

struct SectionAnswer {
  SectionVector resultant;
  double stored = 0;      // per length [J/m2]
  double dissipated = 0;  // in this increment, likewise
};

/// Resultants of strains (membrane logarithmic) from the history at the increment's start; `next`, when
/// given, receives that at its end and may be `history` itself.
SectionAnswer flow(const ShellSection& section, const SectionVector& strain, const double* history,
                   double* next);

/// psi after a plastic curvature, in units of the curvature at first yield.
double hinge_parameter(Hinge hinge, double plastic_curvature);

/// Moment at which the whole section yields under it alone, at plastic strain 0 [N m/m].
double limit_moment(const ShellSection& section);

}  // namespace estuary::solid
