#include "mapping.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>
#include <random>

namespace estuary::coupler {
namespace {

using testing::HasSubstr;

v1::WetSurface surface_of(const std::vector<double>& positions, std::uint32_t dimension,
                          const std::vector<std::uint32_t>& connectivity) {
  v1::WetSurface surface;
  surface.set_identity(1);
  surface.set_dimension(dimension);
  surface.mutable_reference_positions()->Assign(positions.begin(), positions.end());
  surface.mutable_connectivity()->Assign(connectivity.begin(), connectivity.end());
  return surface;
}

// An open line y(x) over 0..1; `places` are the x of the nodes in order of the connectivity.
template <typename Height>
v1::WetSurface line_at(const std::vector<double>& places, const Height& height) {
  std::vector<double> positions;
  std::vector<std::uint32_t> connectivity;
  for (std::size_t i = 0; i < places.size(); ++i) {
    positions.insert(positions.end(), {places[i], height(places[i])});
    if (i > 0)
      connectivity.insert(connectivity.end(),
                          {static_cast<std::uint32_t>(i - 1), static_cast<std::uint32_t>(i)});
  }
  return surface_of(positions, 2, connectivity);
}

std::vector<double> even(int nodes) {
  std::vector<double> places;
  for (int i = 0; i < nodes; ++i) places.push_back(static_cast<double>(i) / (nodes - 1));
  return places;
}

std::vector<double> uneven(int nodes, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> anywhere(0, 1);
  std::vector<double> places{0, 1};
  while (static_cast<int>(places.size()) < nodes) places.push_back(anywhere(random));
  std::sort(places.begin(), places.end());
  return places;
}

double flat(double) {
  return 0.3;
}
double arch(double x) {
  return 0.4 * std::sin(2 * x);
}

// Unit sphere of 2 n^2 triangles, turned by `turn`, so that two of them do not match.
v1::WetSurface sphere(int n, double turn) {
  std::vector<double> positions;
  std::vector<std::uint32_t> connectivity;
  for (int i = 0; i <= n; ++i) {
    for (int j = 0; j < n; ++j) {
      const double polar = std::numbers::pi * (0.02 + 0.96 * i / n),
                   angle = turn + 2 * std::numbers::pi * j / n;
      positions.insert(positions.end(), {std::sin(polar) * std::cos(angle), std::sin(polar) * std::sin(angle),
                                         std::cos(polar)});
      if (i == 0) continue;
      const auto node = [n](int a, int b) { return static_cast<std::uint32_t>(a * n + b % n); };
      for (const auto k :
           {node(i - 1, j), node(i, j), node(i, j + 1), node(i - 1, j), node(i, j + 1), node(i - 1, j + 1)})
        connectivity.push_back(k);
    }
  }
  return surface_of(positions, 3, connectivity);
}

std::vector<double> field_on(const v1::WetSurface& surface, const auto& f) {
  std::vector<double> values;
  const auto dimension = static_cast<int>(surface.dimension());
  for (int i = 0; i < surface.reference_positions_size(); i += dimension)
    values.push_back(f(surface.reference_positions(i), surface.reference_positions(i + 1),
                       dimension == 3 ? surface.reference_positions(i + 2) : 0.0));
  return values;
}

double largest_difference(const std::vector<double>& a, const std::vector<double>& b) {
  double largest = 0;
  for (std::size_t i = 0; i < a.size(); ++i) largest = std::max(largest, std::abs(a[i] - b[i]));
  return largest;
}

struct Method {
  const char* name;
  MappingSettings settings;
  bool linear;  // exact for linear fields between surfaces of one shape
};
const std::vector<Method> methods = {
    {"nearest neighbour", {MappingKind::nearest_neighbour, 0}, false},
    {"nearest projection", {MappingKind::nearest_projection, 0}, true},
    {"thin plate", {MappingKind::thin_plate_spline, 0}, true},
    {"Wendland C2", {MappingKind::wendland_c2, 0.5}, true},
    {"Wendland C4", {MappingKind::wendland_c4, 0.5}, true},
};

TEST(Mapping, KeepsConstantsAndLinearFieldsAsEachMethodPromises) {
  const auto source = line_at(uneven(40, 1), flat);
  const auto target = line_at(uneven(57, 2), flat);
  for (const auto& method : methods) {
    const Mapping mapping = make_mapping(method.settings, source, target);
    ASSERT_EQ(mapping.targets(), 57U);
    const auto constant = [](double, double, double) { return 7.5; };
    EXPECT_LT(
        largest_difference(mapping.consistent(field_on(source, constant), 1), field_on(target, constant)),
        1e-10)
        << method.name;
    const auto linear = [](double x, double y, double) { return 2 - 3 * x + y; };
    const double error =
        largest_difference(mapping.consistent(field_on(source, linear), 1), field_on(target, linear));
    if (method.linear) {
      EXPECT_LT(error, 1e-10) << method.name;
    } else {
      EXPECT_GT(error, 1e-3) << method.name;
    }
  }
}

// Radial basis functions keep linear fields off the source as well, on curved surfaces and in space.
TEST(Mapping, RadialBasisFunctionsKeepLinearFieldsBetweenSurfacesThatDoNotTouch) {
  const auto linear = [](double x, double y, double z) { return 1 + 2 * x - 3 * y + 0.5 * z; };
  for (const auto& method : methods) {
    if (method.settings.kind == MappingKind::nearest_neighbour ||
        method.settings.kind == MappingKind::nearest_projection)
      continue;
    const auto low = line_at(even(40), arch);
    const auto high = line_at(even(29), [](double x) { return arch(x) + 0.01; });
    const auto across = make_mapping(method.settings, low, high);
    EXPECT_LT(largest_difference(across.consistent(field_on(low, linear), 1), field_on(high, linear)), 1e-9)
        << method.name;
    const auto one = sphere(12, 0), other = sphere(9, 0.3);
    const auto between = make_mapping(method.settings, one, other);
    EXPECT_LT(largest_difference(between.consistent(field_on(one, linear), 1), field_on(other, linear)), 1e-9)
        << method.name;
  }
}

TEST(Mapping, OnItsOwnNodesEveryMethodGivesTheValuesBack) {
  const auto source = sphere(8, 0);
  const auto wild = field_on(source, [](double x, double y, double z) { return std::sin(9 * x) + y * z; });
  for (const auto& method : methods)
    EXPECT_LT(largest_difference(make_mapping(method.settings, source, source).consistent(wild, 1), wild),
              1e-10)
        << method.name;
}

// Sums of forces, and power with any motion; moments where linear fields are exact.
TEST(Mapping, TransposedKeepsSumsPowerAndMoments) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> number(-1, 1);
  const auto source = line_at(uneven(40, 3), flat);
  const auto target = line_at(uneven(61, 4), flat);
  std::vector<double> force(2 * 61), motion(2 * 40);
  for (double& value : force) value = number(random);
  for (double& value : motion) value = number(random);
  const auto sum = [](const std::vector<double>& values, std::size_t axis) {
    double total = 0;
    for (std::size_t i = axis; i < values.size(); i += 2) total += values[i];
    return total;
  };
  const auto moment = [](const v1::WetSurface& surface, const std::vector<double>& shift,
                         const std::vector<double>& f) {
    double total = 0;
    for (std::size_t i = 0; i < f.size(); i += 2)
      total += (surface.reference_positions(static_cast<int>(i)) + shift[i]) * f[i + 1] -
               (surface.reference_positions(static_cast<int>(i + 1)) + shift[i + 1]) * f[i];
    return total;
  };
  for (const auto& method : methods) {
    const Mapping mapping = make_mapping(method.settings, source, target);
    const auto received = mapping.conservative(force, 2);
    const auto moved = mapping.consistent(motion, 2);
    for (const std::size_t axis : {0U, 1U})
      EXPECT_NEAR(sum(received, axis), sum(force, axis), 1e-10) << method.name;
    EXPECT_NEAR(std::inner_product(received.begin(), received.end(), motion.begin(), 0.0),
                std::inner_product(force.begin(), force.end(), moved.begin(), 0.0), 1e-10)
        << method.name;
    if (method.linear) {
      EXPECT_NEAR(moment(source, motion, received), moment(target, moved, force), 1e-9) << method.name;
    }
  }
}

// Error of a smooth field when both surfaces are refined by two.
TEST(Mapping, ConvergesWithItsOrder) {
  const auto smooth = [](double x, double y, double) { return std::sin(3 * x) + y * y; };
  const auto error = [&](const MappingSettings& settings, int nodes) {
    const auto source = line_at(even(nodes), arch);
    const auto target = line_at(even(nodes * 7 / 5), arch);
    return largest_difference(make_mapping(settings, source, target).consistent(field_on(source, smooth), 1),
                              field_on(target, smooth));
  };
  const auto order = [&](const MappingSettings& settings) {
    return std::log2(error(settings, 80) / error(settings, 160));
  };
  EXPECT_NEAR(order({MappingKind::nearest_neighbour, 0}), 1.0, 0.2);
  EXPECT_NEAR(order({MappingKind::nearest_projection, 0}), 2.0, 0.2);
  // Its native space allows 3/2 at the ends of an open line.
  EXPECT_NEAR(order({MappingKind::thin_plate_spline, 0}), 1.5, 0.15);
  EXPECT_GT(order({MappingKind::wendland_c2, 0.5}), 1.8);
  EXPECT_GT(order({MappingKind::wendland_c4, 0.5}), 1.8);
}

TEST(Mapping, NodesMayBeOutOfOrderAndMoreThanOnce) {
  const auto in_order = line_at(even(30), flat);
  const auto target = line_at(even(43), flat);
  // The same line, its nodes shuffled, two of them twice.
  std::vector<std::uint32_t> number(30);
  std::iota(number.begin(), number.end(), 0U);
  std::shuffle(number.begin(), number.end(), std::mt19937(8));
  std::vector<double> positions(64);
  std::vector<std::uint32_t> connectivity;
  for (std::uint32_t i = 0; i < 30; ++i) {
    positions[2 * number[i]] = in_order.reference_positions(static_cast<int>(2 * i));
    positions[2 * number[i] + 1] = 0.3;
    if (i > 0) connectivity.insert(connectivity.end(), {number[i - 1], number[i]});
  }
  for (std::size_t c = 0; c < 4; ++c) positions[60 + c] = positions[10 + c];
  connectivity.insert(connectivity.end(), {5, 30, 6, 31});  // segments without length
  const auto shuffled = surface_of(positions, 2, connectivity);
  const auto linear = [](double x, double, double) { return 4 - x; };
  for (const auto& method : methods) {
    const auto plain =
        make_mapping(method.settings, in_order, target).consistent(field_on(in_order, linear), 1);
    const auto odd =
        make_mapping(method.settings, shuffled, target).consistent(field_on(shuffled, linear), 1);
    EXPECT_LT(largest_difference(plain, odd), 1e-9) << method.name;
  }
}

TEST(Mapping, SaysWhatCannotBeMapped) {
  const auto source = line_at(even(20), flat);
  const auto target = line_at(even(33), flat);
  const auto complaint = [&](const MappingSettings& settings, const v1::WetSurface& from,
                             const v1::WetSurface& to) {
    try {
      (void)make_mapping(settings, from, to);
    } catch (const std::invalid_argument& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  EXPECT_THAT(complaint({MappingKind::wendland_c2, 0.001}, source, target), HasSubstr("support_radius"));
  EXPECT_THAT(complaint({MappingKind::wendland_c4, 1e6}, source, target), HasSubstr("nearly dependent"));
  EXPECT_THAT(complaint({MappingKind::thin_plate_spline, 0}, line_at(even(5000), flat), target),
              HasSubstr("nearest-projection"));
  EXPECT_THAT(complaint({}, source, sphere(4, 0)), HasSubstr("dimensions"));
  const Mapping mapping = make_mapping({}, source, target);
  EXPECT_THROW((void)mapping.consistent(std::vector<double>(19), 1), std::invalid_argument);
  EXPECT_THROW((void)mapping.conservative(std::vector<double>(20), 1), std::invalid_argument);
}

TEST(Mapping, QualityShowsGapsBetweenTheSurfaces) {
  const auto source = line_at(even(20), flat);
  const auto apart = line_at(even(33), [](double x) { return flat(x) + 0.02; });
  const auto mapping = make_mapping({}, source, apart);
  const auto quality = quality_of(mapping, source, apart);
  EXPECT_NEAR(quality.largest_distance, 0.02, 1e-12);
  EXPECT_LT(quality.constant_defect, 1e-14);
}

// The tree finds what looking at every facet finds.
TEST(Mapping, NearestProjectionFindsTheNearestOfAllFacets) {
  const auto source = sphere(14, 0);
  const auto target = sphere(11, 0.7);
  const auto mapping = make_mapping({}, source, target);
  const auto& x = source.reference_positions();
  const auto places = mapping.consistent({x.data(), static_cast<std::size_t>(x.size())}, 3);
  for (std::size_t k = 0; k < mapping.targets(); ++k) {
    const auto gap_to = [&](double px, double py, double pz) {
      return std::hypot(px - target.reference_positions(static_cast<int>(3 * k)),
                        py - target.reference_positions(static_cast<int>(3 * k + 1)),
                        pz - target.reference_positions(static_cast<int>(3 * k + 2)));
    };
    const double found = gap_to(places[3 * k], places[3 * k + 1], places[3 * k + 2]);
    for (int f = 0; f < source.connectivity_size(); f += 3) {
      // Points of each triangle on a fine barycentric grid: none is nearer.
      for (int a = 0; a <= 4; ++a) {
        for (int b = 0; a + b <= 4; ++b) {
          double p[3] = {0, 0, 0};
          const double w[3] = {a / 4.0, b / 4.0, (4 - a - b) / 4.0};
          for (int c = 0; c < 3; ++c)
            for (int d = 0; d < 3; ++d)
              p[d] += w[c] * x[static_cast<int>(3 * source.connectivity(f + c)) + d];
          ASSERT_LE(found, gap_to(p[0], p[1], p[2]) + 1e-12);
        }
      }
    }
  }
}

}  // namespace
}  // namespace estuary::coupler
