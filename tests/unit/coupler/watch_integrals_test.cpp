#include "watch_integrals.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <map>

namespace estuary::coupler {
namespace {

TEST(SurfaceIntegrals, AreSumsOfForcesAndLengthWeightedMeansOfDisplacements) {
  v1::WetSurface surface;
  surface.set_dimension(2);
  for (const double value : {0.0, 0.0, 1.0, 0.0, 4.0, 0.0}) surface.add_reference_positions(value);
  for (const std::uint32_t node : {0U, 1U, 1U, 2U}) surface.add_connectivity(node);
  const InterfaceState state{.motion = {.displacement = {0, 1, 0, 2, 0, 6}, .velocity = {1, 0, 0, 2, 0, 0}},
                             .forces = {1, 2, 3, 4, 5, 6}};
  std::map<std::string, double> value;
  const auto sample = surface_integrals("all", surface, state, 7);
  EXPECT_EQ(sample.name(), "all");
  for (int i = 0; i < sample.quantity_size(); ++i) value[sample.quantity(i)] = sample.value(i);
  EXPECT_DOUBLE_EQ(value["force_x"], 9);
  EXPECT_DOUBLE_EQ(value["force_y"], 12);
  EXPECT_DOUBLE_EQ(value["moment"], (0 * 2 - 1 * 1) + (1 * 4 - 2 * 3) + (4 * 6 - 6 * 5));
  EXPECT_DOUBLE_EQ(value["power"], 1 * 1 + 4 * 2);
  EXPECT_DOUBLE_EQ(value["mean_displacement_x"], 0);
  EXPECT_DOUBLE_EQ(value["mean_displacement_y"], (1 * 1.5 + 3 * 4) / 4.0);
  EXPECT_DOUBLE_EQ(value["length"], std::sqrt(2.0) + 5);
  EXPECT_DOUBLE_EQ(value["iterations"], 7);
}

TEST(SurfaceIntegrals, InSpaceTheAreaCounts) {
  v1::WetSurface surface;
  surface.set_dimension(3);
  for (const double value : {0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 3.0, 0.0})
    surface.add_reference_positions(value);
  for (const std::uint32_t node : {0U, 1U, 2U}) surface.add_connectivity(node);
  InterfaceState state;
  state.motion.displacement = {0, 0, 3, 0, 0, 3, 0, 0, 3};
  state.forces.assign(9, 1.0);
  std::map<std::string, double> value;
  const auto sample = surface_integrals("all", surface, state, 1);
  for (int i = 0; i < sample.quantity_size(); ++i) value[sample.quantity(i)] = sample.value(i);
  EXPECT_DOUBLE_EQ(value["area"], 3);
  EXPECT_DOUBLE_EQ(value["mean_displacement_z"], 3);
  EXPECT_DOUBLE_EQ(value["force_z"], 3);
}

}  // namespace
}  // namespace estuary::coupler
