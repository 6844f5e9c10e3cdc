// Populations in single precision.
#include <gtest/gtest.h>
#include <omp.h>

#include "flow_cases.hpp"

namespace estuary::fluid {
namespace {

FlowSettings lid(int n, Storage storage, CollisionModel collision) {
  FlowSettings settings = cases::box(n, n, 0.05, cases::all_walls);
  settings.sides[top].velocity_x.assign(static_cast<std::size_t>(2 * n + 1), 0.1);
  settings.sides[top].velocity_y.assign(static_cast<std::size_t>(2 * n + 1), 0.0);
  settings.storage = storage;
  settings.collision = collision;
  if (collision == CollisionModel::central_moment || collision == CollisionModel::recursive_regularised)
    settings.equilibrium = EquilibriumModel::compressible;
  return settings;
}

double largest_difference(const NodeValues& a, const NodeValues& b) {
  double largest = 0;
  for (std::size_t k = 0; k < a.size(); ++k) largest = std::max(largest, std::abs(a[k] - b[k]));
  return largest;
}

// Arithmetic with 24 bits on what differs from the fluid at rest: a population near a wall is some 2 % of the
// lid's momentum flux, each of the thousands of steps rounds it to 6e-8 of itself, and velocities of the
// cavity agree to some 1e-5 of the lid's.
TEST(SinglePrecision, FollowsDoublePrecision) {
  for (const CollisionModel collision :
       {CollisionModel::trt, CollisionModel::bgk, CollisionModel::central_moment,
        CollisionModel::recursive_regularised}) {
    Flow exact(lid(40, Storage::double_precision, collision));
    Flow rounded(lid(40, Storage::single_precision, collision));
    EXPECT_EQ(rounded.bytes_per_update(), 72);
    exact.run(4001);
    rounded.run(4001);
    const Fields a = cases::fields_of(exact);
    const Fields b = cases::fields_of(rounded);
    const double difference = std::max(largest_difference(a.velocity_x, b.velocity_x),
                                       largest_difference(a.velocity_y, b.velocity_y));
    EXPECT_LT(difference, 0.1 * 3e-5) << int(collision);
    EXPECT_GT(difference, 0) << int(collision);
  }
}

// A channel with open sides, a body with interpolated walls and a wet surface: every rule writes both kinds.
TEST(SinglePrecision, SameBitsForAnyNumberOfThreadsAndAfterARestore) {
  const int threads_before = omp_get_max_threads();
  std::vector<std::vector<double>> results;
  for (const int threads : {1, 3}) {
    omp_set_num_threads(threads);
    FlowSettings settings = cases::box(311, 93, 0.01, cases::channel);
    settings.storage = Storage::single_precision;
    settings.sides[left].velocity_x.assign(93, 0.05);
    settings.sides[left].velocity_y.assign(93, 0.0);
    settings.sides[right].excess.assign(93, 0.0);
    Flow flow(settings);
    const auto body = cases::disc(60.3, 41.2, 14.1, 90);
    flow.set_wet_surface(body.nodes(), body.connectivity);
    flow.move_wet_surface(body.positions, body.at_rest(), 1.0);
    flow.place_bodies({2, {150.2, 50.1}, {9.3}, {0, 0}, {0}}, {WallRule::one_point}, false);
    cases::start(flow, cases::uneven_fields(311, 93, 0.05));
    flow.run(30);
    Flow::State state;
    flow.copy_to(state);
    flow.run(21);
    results.emplace_back();
    flow.populations().copy_to(results.back());
    flow.give_back(state, body.positions, body.at_rest(), 1.0);
    flow.run(21);
    results.emplace_back();
    flow.populations().copy_to(results.back());
  }
  omp_set_num_threads(threads_before);
  for (std::size_t k = 1; k < results.size(); ++k) EXPECT_EQ(results[0], results[k]) << k;
}

TEST(SinglePrecision, GoesWithoutForcesAndWithConstantViscosity) {
  for (const int dimension : {2, 3}) {
    StepChoice choice{.dimension = dimension, .storage = Storage::single_precision};
    EXPECT_NE(collide_and_stream(choice), nullptr);
    choice.force = ForceModel::guo;
    EXPECT_EQ(collide_and_stream(choice), nullptr);
    choice.force = ForceModel::none;
    choice.viscosity = ViscosityModel::smagorinsky;
    EXPECT_EQ(collide_and_stream(choice), nullptr);
  }
}

}  // namespace
}  // namespace estuary::fluid
