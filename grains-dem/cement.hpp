// Cement between grains as the fluid sees it: geometry alone. Strength is the bonds' (bonds.hpp).
//
//   bridges  cones between near grains whose ends are C_p of each grain's diameter, as chains of balls
//   coating  every grain thicker by C_c of the mean radius, for the fluid only
//   random   voxels that touch a grain or earlier cement, one by one at random, until the wanted share of the
//            pores is filled
//
// Source: the DEM-LBM thesis (Mansouri 2014), 5.4; Powder Technology 208 (2011) 532. Bodies are added to the
// grains that the fluid is told of, a voxel as the ball (disc) of its volume.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "neighbours.hpp"

namespace estuary::grains {

struct CementScene {
  enum class Model { none, bridges, coating, random };
  Model model = Model::none;
  double diameter_ratio = 0;   // C_p of bridges
  double distance_ratio = 0;   // of bridges: largest gap / mean diameter of the two
  double thickness_ratio = 0;  // C_c of the coating
  double saturation = 0;       // wanted of random cement: cement volume / pore volume before
  double voxel = 0;            // edge of the voxels that are cement, or in which it is measured [m]
  std::int64_t seed = 1;
  std::vector<double> from, to;  // box that is cemented (random) and measured [m]
};

template <int D>
struct Cement {
  std::vector<double> centre, radius;  // of the bodies, D and one per body [m]
  std::vector<std::uint32_t> owner;    // the grain that each body sticks to
  double coating = 0;                  // [m]
  double saturation = 0;               // cement volume / pore volume before
  double porosity = 1;                 // of the box, with the cement
  [[nodiscard]] std::size_t bodies() const { return radius.size(); }
};

/// Cement of grains at `position` (D each) with true radii `radius`. Throws std::invalid_argument when the
/// wanted saturation cannot be reached.
template <int D>
Cement<D> make_cement(const CementScene& scene, const Domain<D>& domain, std::span<const double> position,
                      std::span<const double> radius);

}  // namespace estuary::grains
