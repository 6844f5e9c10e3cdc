// When a link between two particles breaks.
#pragma once

namespace estuary::solid {

/// A link breaks as soon as one of its limits is passed; 0 is no limit.
struct RuptureLimits {
  double stretch = 0;         // length over reference length, less 1
  double shear = 0;           // transverse shear strain, of shells
  double plastic_strain = 0;  // equivalent; of a shell its mean over the thickness
  double energy = 0;          // taken up, elastic and plastic, per area of the crack [J/m2]

  [[nodiscard]] bool any() const { return stretch > 0 || shear > 0 || plastic_strain > 0 || energy > 0; }
};

}  // namespace estuary::solid
