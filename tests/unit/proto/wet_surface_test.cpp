// What is refused when a surface or a field on it is received, and that the message names it.
#include "wet_surface.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <limits>
#include <string>

namespace estuary {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

constexpr double nan = std::numeric_limits<double>::quiet_NaN();
constexpr double infinity = std::numeric_limits<double>::infinity();

/// Three nodes in a plane joined by two segments.
v1::WetSurface polyline() {
  v1::WetSurface surface;
  surface.set_identity(42);
  surface.set_dimension(2);
  for (const double x : {0.0, 0.0, 0.0, 1.0, 0.5, 1.5}) surface.add_reference_positions(x);
  for (const unsigned node : {0U, 1U, 1U, 2U}) surface.add_connectivity(node);
  return surface;
}

v1::WetSurface triangle() {
  v1::WetSurface surface;
  surface.set_dimension(3);
  for (const double x : {0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0}) surface.add_reference_positions(x);
  for (const unsigned node : {0U, 1U, 2U}) surface.add_connectivity(node);
  return surface;
}

template <typename Check>
std::string refusal(Check check) {
  try {
    check();
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return {};
}

std::string surface_refusal(const v1::WetSurface& surface) {
  return refusal([&] { check_wet_surface(surface); });
}

TEST(WetSurface, ThatIsValidIsTaken) {
  EXPECT_EQ(surface_refusal(polyline()), "");
  EXPECT_EQ(surface_refusal(triangle()), "");
  EXPECT_EQ(node_count(polyline()), 3U);
  EXPECT_EQ(node_count(triangle()), 3U);
  EXPECT_EQ(node_count(v1::WetSurface{}), 0U);
}

TEST(WetSurface, NeedsTwoOrThreeDimensions) {
  for (const unsigned dimension : {0U, 1U, 4U, 4000000000U}) {
    auto surface = polyline();
    surface.set_dimension(dimension);
    EXPECT_THAT(surface_refusal(surface), HasSubstr("WetSurface.dimension")) << dimension;
  }
}

TEST(WetSurface, NeedsWholeFinitePositions) {
  auto surface = polyline();
  surface.add_reference_positions(1.0);
  EXPECT_THAT(surface_refusal(surface), HasSubstr("WetSurface.reference_positions: has 7 values"));
  surface.clear_reference_positions();
  EXPECT_THAT(surface_refusal(surface), HasSubstr("WetSurface.reference_positions: has 0 values"));
  surface = polyline();
  surface.set_reference_positions(5, nan);
  EXPECT_THAT(surface_refusal(surface),
              AllOf(HasSubstr("WetSurface.reference_positions"), HasSubstr("component 1 of node 2 is nan")));
  surface.set_reference_positions(5, -infinity);
  EXPECT_THAT(surface_refusal(surface), HasSubstr("is -inf"));
}

TEST(WetSurface, NeedsFacetsOfExistingDifferentNodes) {
  auto surface = polyline();
  surface.set_connectivity(2, 3);
  EXPECT_THAT(surface_refusal(surface), HasSubstr("WetSurface.connectivity: facet 1 names node 3"));
  surface.set_connectivity(2, 2);
  EXPECT_THAT(surface_refusal(surface), HasSubstr("facet 1 names node 2 twice"));
  surface = polyline();
  surface.add_connectivity(0);
  EXPECT_THAT(surface_refusal(surface), HasSubstr("has 5 entries"));
  surface.clear_connectivity();
  EXPECT_THAT(surface_refusal(surface), HasSubstr("has 0 entries"));
  auto solid = triangle();
  solid.set_connectivity(2, 0);
  EXPECT_THAT(surface_refusal(solid), HasSubstr("facet 0 names node 0 twice"));
}

TEST(WetSurface, NeedsFewerThanTenMillionNodes) {
  auto surface = triangle();
  surface.mutable_reference_positions()->Resize(30'000'000, 0.0);
  EXPECT_THAT(surface_refusal(surface), HasSubstr("holds 10000000 nodes"));
  surface.mutable_reference_positions()->Resize(30'000'000 - 3, 0.0);
  EXPECT_EQ(surface_refusal(surface), "");
}

v1::Displacements displacements() {
  v1::Displacements field;
  field.set_surface(42);
  field.mutable_displacement()->Resize(6, 0.1);
  field.mutable_velocity()->Resize(6, 0.0);
  return field;
}

TEST(SurfaceFields, ThatAreValidAreTaken) {
  EXPECT_NO_THROW(check_displacements(displacements(), polyline()));
  v1::WetSurfacePressures pressures;
  pressures.set_surface(42);
  pressures.mutable_pressure()->Resize(3, 1.0);
  EXPECT_NO_THROW(check_pressures(pressures, polyline()));
  pressures.mutable_viscous_traction()->Resize(6, 1.0);
  EXPECT_NO_THROW(check_pressures(pressures, polyline()));
  v1::NodalForces forces;
  forces.set_surface(42);
  forces.mutable_force()->Resize(6, 1.0);
  EXPECT_NO_THROW(check_forces(forces, polyline()));
}

TEST(SurfaceFields, OfAnotherSurfaceAreRefused) {
  auto field = displacements();
  field.set_surface(41);
  EXPECT_THAT(refusal([&] { check_displacements(field, polyline()); }),
              HasSubstr("Displacements.surface: belongs to the surface 41; the surface of this run is 42"));
  EXPECT_THAT(refusal([&] { check_pressures({}, polyline()); }), HasSubstr("WetSurfacePressures.surface"));
  EXPECT_THAT(refusal([&] { check_forces({}, polyline()); }), HasSubstr("NodalForces.surface"));
}

TEST(SurfaceFields, OfAnotherLengthAreRefused) {
  auto field = displacements();
  field.add_displacement(0.0);
  EXPECT_THAT(refusal([&] { check_displacements(field, polyline()); }),
              HasSubstr("Displacements.displacement: has 7 values; the surface has 3 nodes and needs 6"));
  field = displacements();
  field.clear_velocity();
  EXPECT_THAT(refusal([&] { check_displacements(field, polyline()); }),
              HasSubstr("Displacements.velocity: has 0 values"));
  v1::WetSurfacePressures pressures;
  pressures.set_surface(42);
  pressures.mutable_pressure()->Resize(6, 1.0);
  EXPECT_THAT(refusal([&] { check_pressures(pressures, polyline()); }),
              HasSubstr("WetSurfacePressures.pressure: has 6 values"));
  pressures.mutable_pressure()->Resize(3, 1.0);
  pressures.mutable_viscous_traction()->Resize(3, 1.0);
  EXPECT_THAT(refusal([&] { check_pressures(pressures, polyline()); }),
              HasSubstr("WetSurfacePressures.viscous_traction: has 3 values"));
  v1::NodalForces forces;
  forces.set_surface(42);
  EXPECT_THAT(refusal([&] { check_forces(forces, polyline()); }),
              HasSubstr("NodalForces.force: has 0 values"));
}

TEST(SurfaceFields, TornFacetsAreThoseOfASurfaceThatTearsInOrder) {
  v1::WetSurface surface = polyline();
  auto field = displacements();
  field.add_torn(0);
  EXPECT_THAT(refusal([&] { check_displacements(field, surface); }), HasSubstr("does not tear"));
  surface.set_tears(true);
  EXPECT_NO_THROW(check_displacements(field, surface));
  field.add_torn(1);
  EXPECT_NO_THROW(check_displacements(field, surface));
  field.set_torn(1, 0);
  EXPECT_THAT(refusal([&] { check_displacements(field, surface); }), HasSubstr("names facet 0 at place 1"));
  field.set_torn(1, 2);
  EXPECT_THAT(refusal([&] { check_displacements(field, surface); }), HasSubstr("names facet 2 at place 1"));
}

TEST(SurfaceFields, ThatAreNotFiniteAreRefusedWithTheirPlace) {
  auto field = displacements();
  field.set_velocity(3, infinity);
  EXPECT_THAT(refusal([&] { check_displacements(field, polyline()); }),
              HasSubstr("Displacements.velocity: component 1 of node 1 is inf"));
  v1::WetSurfacePressures pressures;
  pressures.set_surface(42);
  pressures.mutable_pressure()->Resize(3, 1.0);
  pressures.set_pressure(2, nan);
  EXPECT_THAT(refusal([&] { check_pressures(pressures, polyline()); }),
              HasSubstr("WetSurfacePressures.pressure: component 0 of node 2 is nan"));
}

}  // namespace
}  // namespace estuary
