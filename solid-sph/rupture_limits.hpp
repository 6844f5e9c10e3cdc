// When a link between two particles breaks.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

namespace estuary::solid {

/// A link breaks as soon as one of its limits is passed; 0 is no limit.
struct RuptureLimits {
  double stretch = 0;         // length over reference length, less 1
  double shear = 0;           // transverse shear strain, of shells
  double plastic_strain = 0;  // equivalent; of a shell its mean over the thickness
  double energy = 0;          // taken up, elastic and plastic, per area of the crack [J/m2]

  [[nodiscard]] bool any() const { return stretch > 0 || shear > 0 || plastic_strain > 0 || energy > 0; }
};

/// Of bodies that have broken, for what meets them.
struct TornContours {
  std::vector<std::array<std::uint32_t, 2>> pieces;  // of contours, between particles whose link is broken
  std::vector<std::uint32_t> exposed;                // particles inside contours that have lost links
};

}  // namespace estuary::solid
