// Between contour and particles: exactness, conservation, orientation.
#include <gtest/gtest.h>

#include <stdexcept>

#include "bodies.hpp"
#include "surface_transfer.hpp"

namespace estuary::solid {
namespace {

Body fin(Placement placement) {
  Box box = test::box_of(0.025, 0.25, 0.0025);
  box.placement = placement;
  box.clamped[static_cast<std::size_t>(Side::bottom)] = true;
  return fill(box, 920, 0.95, true);
}
const std::vector<Side> kFinSides{Side::right, Side::left, Side::top};  // the order given does not matter

class Placed : public testing::TestWithParam<Placement> {
protected:
  [[nodiscard]] static Body fin() { return estuary::solid::fin(GetParam()); }
};
INSTANTIATE_TEST_SUITE_P(Both, Placed, testing::Values(Placement::on_contour, Placement::cell_centres));

TEST(ContourLine, WalksClockwiseAlongTheTrueContour) {
  const Body body = fin(Placement::on_contour);
  const ContourLine line = contour_line(body, kFinSides);
  EXPECT_FALSE(line.closed);
  EXPECT_EQ(line.position[0], 0.0);
  EXPECT_EQ(line.position[1], 0.0);
  EXPECT_EQ(line.position[2 * line.size() - 2], 0.025);
  EXPECT_EQ(line.position[2 * line.size() - 1], 0.0);
  double length = 0, area = 0;
  for (std::size_t s = 0; s < line.segments(); ++s) {
    const double x0 = line.position[2 * s], y0 = line.position[2 * s + 1];
    const double x1 = line.position[2 * s + 2], y1 = line.position[2 * s + 3];
    length += std::hypot(x1 - x0, y1 - y0);
    area += 0.5 * (x0 * y1 - x1 * y0);
    EXPECT_LT(std::hypot(x1 - x0, y1 - y0), 1.6 * body.mean_spacing());
  }
  EXPECT_NEAR(length, 0.525, 1e-14);
  EXPECT_NEAR(area, -0.025 * 0.25, 1e-15);  // negative: clockwise, the body on the right of the walk
}

TEST(ContourLine, ClosesRoundAFreeBodyAndRefusesOppositeSides) {
  const Body body = fill(test::box_of(1, 1, 0.1), 1, 0.95, false);
  const std::vector<Side> all{Side::left, Side::top, Side::right, Side::bottom};
  const ContourLine line = contour_line(body, all);
  EXPECT_TRUE(line.closed);
  EXPECT_EQ(line.size(), 40u);
  const std::vector<Side> opposite{Side::left, Side::right};
  EXPECT_THROW(contour_line(body, opposite), std::invalid_argument);
}

template <class Field>
std::vector<double> sampled(const Body& body, const Field& field) {
  std::vector<double> u(2 * body.size());
  for (std::size_t i = 0; i < body.size(); ++i) {
    const std::array<double, 2> value = field(body.position[2 * i], body.position[2 * i + 1]);
    u[2 * i] = value[0];
    u[2 * i + 1] = value[1];
  }
  return u;
}

TEST_P(Placed, ReproducesLinearFieldsEverywhereAndCurvatureAlongASide) {
  const Body body = fin();
  const ContourLine line = contour_line(body, kFinSides);
  const Transfer transfer = contour_transfer(body, line);
  const auto linear = [](double x, double y) {
    return std::array<double, 2>{0.3 + 2 * x - y, 0.7 * y - 3 * x};
  };
  const auto bent = [](double, double y) { return std::array<double, 2>{2 * y * y, 1 - 4 * y * y}; };
  std::vector<double> straight_nodes(2 * line.size()), bent_nodes(2 * line.size());
  interpolate(transfer, sampled(body, linear), straight_nodes);
  interpolate(transfer, sampled(body, bent), bent_nodes);
  int on_sides = 0;
  for (std::size_t k = 0; k < line.size(); ++k) {
    const double x = line.position[2 * k], y = line.position[2 * k + 1];
    for (std::size_t c = 0; c < 2; ++c) {
      ASSERT_NEAR(straight_nodes[2 * k + c], linear(x, y)[c], 1e-12);
      // Next to corners and clamps only linear fields pass the filter unchanged.
      const double margin = GetParam() == Placement::on_contour ? 0.003 : 0;
      if (y > margin && y < 0.25 - margin) {
        ASSERT_NEAR(bent_nodes[2 * k + c], bent(x, y)[c], 1e-12);
        ++on_sides;
      }
    }
  }
  EXPECT_GT(on_sides, 290);
}

TEST_P(Placed, WatchedPointsReproduceQuadraticFields) {
  const Body body = fin();
  const std::vector<double> points{0.0125, 0.25, 0.0, 0.1, 0.011, 0.173, 0.025, 0.25};
  const Transfer transfer = point_transfer(body, points);
  const auto field = [](double x, double y) {
    return std::array<double, 2>{0.3 + 2 * x - y + 5 * x * y, 0.7 * y + 4 * y * y - 6 * x * x};
  };
  std::vector<double> values(points.size());
  interpolate(transfer, sampled(body, field), values);
  for (std::size_t k = 0; k < points.size() / 2; ++k)
    for (std::size_t c = 0; c < 2; ++c)
      EXPECT_NEAR(values[2 * k + c], field(points[2 * k], points[2 * k + 1])[c], 1e-12);
}

TEST_P(Placed, AForceOnANodeMeetsTheInertiaOfTheMaterialThere) {
  const Body body = fin();
  const ContourLine line = contour_line(body, kFinSides);
  const Transfer transfer = contour_transfer(body, line);
  for (std::size_t k = 0; k < line.size(); ++k) {
    double squares = 0;  // inverse of the mass moved at first, in particles of half a cell or a whole one
    for (std::size_t e = transfer.first[k]; e < transfer.first[k + 1]; ++e)
      squares += std::pow(transfer.weight[e], 2);
    const bool corner =
        k == 0 || k + 1 == line.size() ||
        (line.position[2 * k + 1] == 0.25 && (line.position[2 * k] == 0 || line.position[2 * k] == 0.025));
    EXPECT_LT(squares, corner ? 2.5 : 1.2) << line.position[2 * k] << " " << line.position[2 * k + 1];
  }
}

TEST(Transfer, ASawtoothAlongTheContourIsNeitherSeenNorLoaded) {
  const Body body = fin(Placement::on_contour);
  const ContourLine line = contour_line(body, kFinSides);
  const Transfer transfer = contour_transfer(body, line);
  std::vector<double> sawtooth(2 * body.size()), nodes(2 * line.size());
  for (std::size_t i = 0; i < body.size(); ++i)
    sawtooth[2 * i] = std::lround(body.position[2 * i + 1] / body.spacing[1]) % 2 == 0 ? 1 : -1;
  interpolate(transfer, sawtooth, nodes);
  for (std::size_t k = 2; k < line.size() - 2; ++k) {
    const double y = line.position[2 * k + 1];
    if (y > 0.001 && y < 0.249) {
      EXPECT_NEAR(nodes[2 * k], 0, 1e-14) << y;
    }
  }
}

TEST(Transfer, NodesOnAClampDoNotMoveAtAll) {
  for (const Clamp clamp : {Clamp::line, Clamp::extra_rows}) {
    Box box = test::box_of(0.025, 0.25, 0.0025);
    box.clamped[static_cast<std::size_t>(Side::bottom)] = true;
    box.clamp = clamp;
    const Body body = fill(box, 920, 0.95, true);
    const ContourLine line = contour_line(body, kFinSides);
    const Transfer transfer = contour_transfer(body, line);
    auto u = test::random_field(2 * body.size(), 0.01, 1);
    for (std::size_t i = 0; i < body.size(); ++i)
      if (body.fixed[i]) u[2 * i] = u[2 * i + 1] = 0;
    std::vector<double> nodes(2 * line.size());
    interpolate(transfer, u, nodes);
    EXPECT_EQ(nodes[0], 0);
    EXPECT_EQ(nodes[1], 0);
    EXPECT_EQ(nodes[nodes.size() - 2], 0);
    EXPECT_EQ(nodes[nodes.size() - 1], 0);
    EXPECT_NE(nodes[2], 0);
  }
}

TEST_P(Placed, ConservesForceMomentAndWork) {
  const Body body = fin();
  const ContourLine line = contour_line(body, kFinSides);
  const Transfer transfer = contour_transfer(body, line);
  // A bent shape with noise: the moment counts in the current configuration.
  auto u = test::random_field(2 * body.size(), 0.0005, 2);
  for (std::size_t i = 0; i < body.size(); ++i) {
    const double y = body.position[2 * i + 1];
    u[2 * i] += 2 * y * y;
    u[2 * i + 1] -= 0.4 * y * body.position[2 * i] * 10;
    if (body.fixed[i]) u[2 * i] = u[2 * i + 1] = 0;
  }
  std::vector<double> moved(2 * line.size());
  interpolate(transfer, u, moved);
  const auto force = test::random_field(2 * line.size(), 1.0, 4);
  std::vector<double> on_particles;
  spread(transfer, force, on_particles);
  std::array<double, 4> nodes{}, particles{};
  for (std::size_t k = 0; k < line.size(); ++k) {
    const double x = line.position[2 * k] + moved[2 * k], y = line.position[2 * k + 1] + moved[2 * k + 1];
    const double fx = force[2 * k], fy = force[2 * k + 1];
    nodes[0] += fx;
    nodes[1] += fy;
    nodes[2] += x * fy - y * fx;
    nodes[3] += moved[2 * k] * fx + moved[2 * k + 1] * fy;
  }
  for (std::size_t k = 0; k < transfer.touched.size(); ++k) {
    const std::size_t j = transfer.touched[k];
    const double x = body.position[2 * j] + u[2 * j], y = body.position[2 * j + 1] + u[2 * j + 1];
    const double fx = on_particles[2 * k], fy = on_particles[2 * k + 1];
    particles[0] += fx;
    particles[1] += fy;
    particles[2] += x * fy - y * fx;
    particles[3] += u[2 * j] * fx + u[2 * j + 1] * fy;
  }
  for (std::size_t c = 0; c < 4; ++c) EXPECT_NEAR(particles[c], nodes[c], 1e-12) << c;
}

TEST(Transfer, PeriodicLayerMovesAsOneAtItsEnds) {
  Box box = test::box_of(1.0, 0.5, 0.05);
  box.periodic = true;
  box.clamped[static_cast<std::size_t>(Side::top)] = true;
  const Body body = fill(box, 1, 0.95, true);
  const Side bottom = Side::bottom;
  const ContourLine line = contour_line(body, {&bottom, 1});
  EXPECT_EQ(line.position[0], 1.0);
  EXPECT_EQ(line.position[2 * line.size() - 2], 0.0);
  const Transfer transfer = contour_transfer(body, line);
  const auto u = test::random_field(2 * body.size(), 0.1, 8);
  std::vector<double> nodes(2 * line.size());
  interpolate(transfer, u, nodes);
  EXPECT_NEAR(nodes[0], nodes[nodes.size() - 2], 1e-14);
  EXPECT_NEAR(nodes[1], nodes[nodes.size() - 1], 1e-14);
}

TEST(UniformTraction, HasTheResultantAskedFor) {
  const Body body = fin(Placement::on_contour);
  const Side top = Side::top;
  const ContourLine line = contour_line(body, {&top, 1});
  const auto force = uniform_traction(line, 3.0, -2.0);
  double fx = 0, fy = 0;
  for (std::size_t k = 0; k < line.size(); ++k) {
    fx += force[2 * k];
    fy += force[2 * k + 1];
  }
  EXPECT_NEAR(fx, 3.0, 1e-14);
  EXPECT_NEAR(fy, -2.0, 1e-14);
  EXPECT_NEAR(force[0] / force[2], 0.5, 1e-12);
}

}  // namespace
}  // namespace estuary::solid
