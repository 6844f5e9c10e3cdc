// The wet surface of a participant that brings one of its own, joined to the solid's.
//
// Displacements and velocities are mapped consistently from the solid's nodes to its own. Its load comes back
// in one of two ways (Loads): as nodal forces, mapped by the transpose, which keeps force, moment and power;
// or as pressures and tractions, mapped consistently and integrated on the solid's facets, which keeps them
// smooth where its nodes are no denser than the solid's.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "coupling_scene.hpp"
#include "load_transfer.hpp"
#include "mapping.hpp"
#include "wet_motion.hpp"

namespace estuary::coupler {

class SurfaceLink {
public:
  /// Throws std::invalid_argument when the surface is not valid or cannot be mapped.
  SurfaceLink(v1::WetSurface own, const v1::WetSurface& solid, const MappingSettings& settings, Loads loads);

  [[nodiscard]] const v1::WetSurface& surface() const { return own_; }
  /// The solid's motion as its own nodes see it.
  [[nodiscard]] WetMotion motion(const WetMotion& solid) const;

  /// Nodal forces on the solid's nodes of a load, or of forces, on its own. `motion`: of the solid. `sums`:
  /// of the nodal forces on its own surface, for the conservation report.
  std::vector<double> forces(const v1::WetSurfacePressures& load, const WetMotion& motion,
                             LoadSums& sums) const;
  std::vector<double> forces(const v1::NodalForces& own, const WetMotion& motion, LoadSums& sums) const;

  /// Nodes, gap between the surfaces and defects, for the log.
  [[nodiscard]] std::string description() const;

private:
  v1::WetSurface own_;
  const v1::WetSurface& solid_;
  Mapping from_solid_;
  std::optional<Mapping> to_solid_;  // for Loads::pressures
};

}  // namespace estuary::coupler
