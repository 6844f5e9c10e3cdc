// Both faces of a shell as its wet surface: where nodes lie and how they move, what forces on them do.
#include "shell_faces.hpp"

#include <gtest/gtest.h>

#include "bodies.hpp"
#include "running_scene.hpp"

namespace estuary::solid {
namespace {

constexpr ShellSection kPlate{.thickness = 0.2, .young_modulus = 2e5, .shear_modulus = 8e4, .density = 7.8};

TEST(ShellFaces, GoRoundTheShellWithTheOutsideOnTheLeftAndAreOpenWhereItIsHeld) {
  const std::vector<std::array<double, 2>> line{{0, 0}, {1, 0}};
  for (const int held : {0, 1, 2}) {
    Body body = fill_row(line, false, 0.25, kPlate);
    if (held > 0) body.fixed.back() = 3;
    if (held > 1) body.fixed.front() = 3;
    const ShellRow rows(body, {kPlate});
    const ShellFaces faces = shell_faces(body, rows);
    ASSERT_EQ(faces.lines.size(), held == 2 ? 2U : 1U);
    double area = 0;
    std::size_t segments = 0;
    for (const ContourLine& round : faces.lines) {
      EXPECT_EQ(round.closed, held == 0);
      segments += round.segments();
      for (std::size_t k = 0; k < round.segments(); ++k) {
        const std::size_t j = (k + 1) % round.size();
        area += 0.5 * (round.position[2 * k] * round.position[2 * j + 1] -
                       round.position[2 * k + 1] * round.position[2 * j]);
      }
    }
    EXPECT_EQ(segments, held == 0 ? 10U : held == 1 ? 9U : 8U);
    // Clockwise; what is missing at held ends adds nothing at x = 0, and half of the last triangle at x = 1.
    EXPECT_NEAR(area, held == 0 ? -0.2 : -0.1, 1e-14);
  }
  const std::vector<std::array<double, 2>> ring{{1, 0}, {0, 1}, {-1, 0}, {0, -1}};
  Body body = fill_row(ring, true, 0.3, kPlate);
  const ShellRow rows(body, {kPlate});
  EXPECT_EQ(shell_faces(body, rows).lines.size(), 2U);
}

TEST(ShellFaces, ForcesOnThemKeepForceMomentAndPower) {
  const std::vector<std::array<double, 2>> line{{0, 0}, {1, 0.3}, {1.6, -0.2}};
  Body body = fill_row(line, false, 0.2, kPlate);
  ShellRow rows(body, {kPlate});
  const ShellFaces faces = shell_faces(body, rows);
  const std::size_t n = body.size(), nodes = faces.mid_line.points();
  const std::vector<double> u = test::random_field(2 * n, 0.3, 1), v = test::random_field(2 * n, 2, 2),
                            force = test::random_field(2 * nodes, 5, 3);
  std::vector<double> history = test::random_field(2 * n, 1, 4);
  Fields fields(n);
  rows.evaluate(u, history, false, fields);
  // As the nodes have it.
  double fx = 0, fy = 0, moment = 0, power = 0;
  std::vector<double> places(2 * nodes), rates(2 * nodes);
  interpolate(faces.mid_line, u, places);
  interpolate(faces.mid_line, v, rates);
  std::size_t node = 0;
  for (const ContourLine& round : faces.lines)
    for (std::size_t k = 0; k < round.size(); ++k, ++node) {
      const auto [change, rate] = rows.fibre_motion(faces.arm.touched[faces.arm.position[node]], history);
      const double a = faces.arm.weight[node];
      const double x = round.position[2 * k] + places[2 * node] + a * change[0],
                   y = round.position[2 * k + 1] + places[2 * node + 1] + a * change[1];
      fx += force[2 * node];
      fy += force[2 * node + 1];
      moment += x * force[2 * node + 1] - y * force[2 * node];
      power += (rates[2 * node] + a * rate[0]) * force[2 * node] +
               (rates[2 * node + 1] + a * rate[1]) * force[2 * node + 1];
    }
  // As the particles have it.
  std::vector<double> pushes;
  Loading loading;
  spread(faces.mid_line, force, pushes);
  loading.couples.emplace();
  loading.couples->particle = faces.arm.touched;
  spread(faces.arm, force, loading.couples->start);
  loading.couples->end = loading.couples->start;
  std::fill(rows.moments().begin(), rows.moments().end(), 0.0);
  rows.add_moments(loading, 0, 0.5);
  power -= rows.moment_work(loading, 0, 0.5, 1, history);
  for (std::size_t k = 0; k < faces.mid_line.touched.size(); ++k) {
    const std::size_t i = faces.mid_line.touched[k];
    const double px = pushes[2 * k], py = pushes[2 * k + 1];
    fx -= px;
    fy -= py;
    moment -= (body.position[2 * i] + u[2 * i]) * py - (body.position[2 * i + 1] + u[2 * i + 1]) * px;
    power -= px * v[2 * i] + py * v[2 * i + 1];
  }
  for (const double m : rows.moments()) moment -= m;
  EXPECT_NEAR(fx, 0, 1e-12);
  EXPECT_NEAR(fy, 0, 1e-12);
  EXPECT_NEAR(moment, 0, 1e-12);
  EXPECT_NEAR(power, 0, 1e-11);
}

// Nodes of the faces go round the shell, the last of one beside the last of the other: of 10 links the
// seventh.
TEST(ShellFaces, BothFacesOfABrokenLinkAreTornAndStaySo) {
  test::RunningScene run(R"(
dimension = 2
[coupling]
mode = "transient"
window = 1e-4
end_time = 1
[solid]
kind = "shell"
polyline = [[0, 0], [1, 0]]
thickness = 0.02
spacing = 0.1
density = 1000
young_modulus = 1e6
poisson_ratio = 0.3
velocity = ["x > 0.65 ? 20 : 0", "0"]
wet = ["contour"]
rupture = { stretch = 0.05 }
)",
                         1e-4);
  run.run(1);
  EXPECT_EQ(run.result().outputs.displacements().torn_size(), 0);
  for (const int windows : {10, 5}) {
    run.run(windows);
    const auto& torn = run.result().outputs.displacements().torn();
    ASSERT_EQ(torn.size(), 2);
    EXPECT_EQ(torn[0], 6U);
    EXPECT_EQ(torn[1], 14U);
  }
}

}  // namespace
}  // namespace estuary::solid
