#include "surface_link.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace estuary::coupler {
namespace {

// A closed circle walked clockwise, so that the fluid is outside.
v1::WetSurface circle(int nodes, std::uint64_t identity, double turn) {
  v1::WetSurface surface;
  surface.set_identity(identity);
  surface.set_dimension(2);
  surface.set_closed(true);
  for (int i = 0; i < nodes; ++i) {
    const double angle = turn - 2 * std::numbers::pi * i / nodes;
    surface.add_reference_positions(2 + std::cos(angle));
    surface.add_reference_positions(std::sin(angle));
    surface.add_connectivity(static_cast<std::uint32_t>(i));
    surface.add_connectivity(static_cast<std::uint32_t>((i + 1) % nodes));
  }
  return surface;
}

// A slow turn with a swelling: displacement and velocity of every node.
WetMotion some_motion(const v1::WetSurface& surface) {
  WetMotion motion;
  for (int i = 0; i < surface.reference_positions_size(); i += 2) {
    const double x = surface.reference_positions(i), y = surface.reference_positions(i + 1);
    motion.displacement.insert(motion.displacement.end(), {0.01 * x - 0.02 * y, 0.03 * x});
    motion.velocity.insert(motion.velocity.end(), {0.5 - y, x});
  }
  return motion;
}

v1::WetSurfacePressures hydrostatic(const v1::WetSurface& surface) {
  v1::WetSurfacePressures load;
  load.set_surface(surface.identity());
  for (int i = 1; i < surface.reference_positions_size(); i += 2) {
    load.add_pressure(100 - 30 * surface.reference_positions(i));
    load.add_viscous_traction(1.0);
    load.add_viscous_traction(0.5);
  }
  return load;
}

// Between the same nodes a mapping is no change, whichever way the load goes.
TEST(SurfaceLink, BetweenTheSameNodesNothingChanges) {
  const auto solid = circle(24, 1, 0);
  const auto motion = some_motion(solid);
  const auto direct = consistent_nodal_forces(solid, motion.displacement, hydrostatic(solid));
  for (const Loads loads : {Loads::forces, Loads::pressures}) {
    for (const auto kind :
         {MappingKind::nearest_neighbour, MappingKind::nearest_projection, MappingKind::thin_plate_spline}) {
      const SurfaceLink link(circle(24, 2, 0), solid, {.kind = kind, .support_radius = 0}, loads);
      const auto moved = link.motion(motion);
      LoadSums sums;
      const auto forces = link.forces(hydrostatic(link.surface()), motion, sums);
      for (std::size_t i = 0; i < forces.size(); ++i) {
        EXPECT_NEAR(moved.displacement[i], motion.displacement[i], 1e-12);
        EXPECT_NEAR(forces[i], direct.force(static_cast<int>(i)), 1e-10);
      }
    }
  }
}

// Contact forces of grains, and loads of a fluid, on nodes of their own: sum and power come through.
TEST(SurfaceLink, ForcesKeepSumAndPower) {
  const auto solid = circle(24, 1, 0);
  const auto motion = some_motion(solid);
  const SurfaceLink link(circle(37, 2, 0.1), solid,
                         {.kind = MappingKind::thin_plate_spline, .support_radius = 0}, Loads::forces);
  const auto expect_kept = [&](const std::vector<double>& forces, const LoadSums& own) {
    const LoadSums received = sum_load(solid, motion.displacement, motion.velocity, forces);
    EXPECT_NEAR(received.force[0], own.force[0], 1e-9);
    EXPECT_NEAR(received.force[1], own.force[1], 1e-9);
    EXPECT_NEAR(received.moment, own.moment, 1e-8);
    EXPECT_NEAR(received.power, own.power, 1e-8);
    EXPECT_GT(std::abs(own.power), 1e-3);
  };
  LoadSums own;
  expect_kept(link.forces(hydrostatic(link.surface()), motion, own), own);
  v1::NodalForces contact;
  contact.set_surface(2);
  contact.mutable_force()->Resize(74, 0.0);
  contact.set_force(20, 3.0);
  contact.set_force(21, -4.0);
  expect_kept(link.forces(contact, motion, own), own);
}

}  // namespace
}  // namespace estuary::coupler
