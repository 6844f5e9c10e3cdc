// Meshes as walls in space: the force of any shape, rest and rolling, turning drums, STL files.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>
#include <fstream>
#include <random>

#include "assemblies.hpp"
#include "critical_points.hpp"
#include "mesh_file.hpp"

namespace estuary::grains {
namespace {

using test::add_grain;

// A floor of n x n squares of two triangles each, of size `pitch`, at the heights that `height` gives.
template <class Height>
Wall<3> terrain(std::uint32_t n, double pitch, const ContactConstants& constants, const Height& height) {
  Wall<3> wall;
  wall.constants = constants;
  for (std::uint32_t j = 0; j <= n; ++j)
    for (std::uint32_t i = 0; i <= n; ++i)
      wall.node.insert(wall.node.end(), {pitch * (i - 0.5 * n), pitch * (j - 0.5 * n), height(i, j)});
  for (std::uint32_t j = 0; j < n; ++j)
    for (std::uint32_t i = 0; i < n; ++i) {
      const std::uint32_t a = i + (n + 1) * j, b = a + 1, c = a + n + 1, d = c + 1;
      wall.facet.insert(wall.facet.end(), {a, b, d, a, d, c});
    }
  return wall;
}

struct Pull {
  Vector<3> force{};     // per stiffness
  double potential = 0;  // likewise
  double index = 0;      // sum
};

Pull pull_of(const Wall<3>& wall, const Vector<3>& x, double r) {
  std::vector<std::uint32_t> near(wall.facets());
  for (std::uint32_t f = 0; f < near.size(); ++f) near[f] = f;
  Pull pull;
  for (const CriticalPoint<3>& point : critical_points(wall, near, x, r).points) {
    pull.force = pull.force - point.index * point.overlap * point.normal;
    pull.potential += 0.5 * point.index * point.overlap * point.overlap;
    pull.index += point.index;
  }
  return pull;
}

TEST(Mesh, ForceIsTheGradientOfAPotentialOverAnyTerrain) {
  // Peaks, pits, ridges, saddles and folds of random heights under a grain that reaches over several of them:
  // the force is the gradient, and what is touched counts once where it is one piece (Euler characteristic
  // 1).
  std::mt19937 random(3);
  std::uniform_real_distribution<double> unit(-1, 1);
  int compared = 0, counted = 0;
  for (int shape = 0; shape < 40; ++shape) {
    Wall<3> wall = terrain(4, 0.5, {}, [&](auto, auto) { return 0.25 * unit(random); });
    link_facets(wall);
    for (int place = 0; place < 50; ++place) {
      const Vector<3> x{0.4 * unit(random), 0.4 * unit(random), 0.75 + 0.3 * unit(random)};
      const double r = 0.8, h = 1e-6;
      const Pull pull = pull_of(wall, x, r);
      counted += std::abs(pull.index - 1) < 1e-12 ? 1 : 0;
      ++compared;
      for (std::size_t c = 0; c < 3; ++c) {
        Vector<3> before = x, after = x;
        before[c] -= h;
        after[c] += h;
        const double slope =
            (pull_of(wall, after, r).potential - pull_of(wall, before, r).potential) / (2 * h);
        ASSERT_NEAR(pull.force[c], -slope, 1e-4) << shape << ' ' << place << ' ' << c;
      }
    }
  }
  // The rest reaches the surface in several pieces, or round a peak's foot.
  EXPECT_GT(counted, compared * 6 / 10);
}

TEST(Mesh, FlatPieceIsAPlaneWhereverItsEdgesLie) {
  Wall<3> wall = terrain(6, 0.25, {}, [](auto, auto) { return 0.0; });
  link_facets(wall);
  for (const Vector<3>& x : {Vector<3>{0, 0, 0.9},
                             {0.125, 0.125, 0.9},
                             {0.25, 0, 0.9},
                             {0.07, 0.03, 0.9},
                             {0.1, 0.25, -0.9},
                             {0.25, 0.25, 0.9}}) {
    const Pull pull = pull_of(wall, x, 1);
    EXPECT_NEAR(pull.force[0], 0, 1e-12);
    EXPECT_NEAR(pull.force[1], 0, 1e-12);
    EXPECT_NEAR(pull.force[2], x[2] > 0 ? 0.1 : -0.1, 1e-12);  // on either side
    EXPECT_EQ(pull.index, 1);
  }
}

TEST(Mesh, RollsOverManyTrianglesAsOnAPlane) {
  auto settings = test::free_space<3>(1e6, 0.5, 0.4);
  settings.gravity = {2, 0.7, -10};
  settings.law.rolling = RollingLaw::spring;
  settings.constants.rolling_friction = 0.01;
  settings.constants.pivoting_friction = 0.01;
  settings.constants.rolling_stiffness = 1e6;
  settings.constants.rolling_damping = 0.3;
  InitialGrains<3> grains;
  add_grain<3>(grains, {0, 0, 0.01}, {0.1, 0, 0}, 0.01);
  Wall<3> plane;
  plane.normal = {0, 0, 1};
  plane.constants = settings.constants;
  Dynamics<3> on_plane(settings, grains, {plane});
  Dynamics<3> on_mesh(settings, grains,
                      {terrain(40, 0.013, settings.constants, [](auto, auto) { return 0.0; })});
  for (int part = 0; part < 10; ++part) {
    on_plane.advance(0.02, 1000);
    on_mesh.advance(0.02, 1000);
    for (std::size_t c = 0; c < 3; ++c) {
      ASSERT_NEAR(on_mesh.unwrapped(0)[c], on_plane.unwrapped(0)[c], 1e-9);
      ASSERT_NEAR(on_mesh.state().spin[c], on_plane.state().spin[c], 1e-7);
      ASSERT_NEAR(on_mesh.wall_force(0)[c], on_plane.wall_force(0)[c], 1e-6);
    }
  }
  EXPECT_GT(on_plane.unwrapped(0)[0], 0.04);
}

// The inside of a cube of edge 2 around the middle, twelve triangles.
Wall<3> cube(double half, const ContactConstants& constants) {
  Wall<3> wall;
  wall.constants = constants;
  for (int k = 0; k < 8; ++k)
    for (int c = 0; c < 3; ++c) wall.node.push_back((k >> c & 1) != 0 ? half : -half);
  wall.facet = {0, 1, 3, 0, 3, 2, 4, 5, 7, 4, 7, 6, 0, 1, 5, 0, 5, 4,
                2, 3, 7, 2, 7, 6, 0, 2, 6, 0, 6, 4, 1, 3, 7, 1, 7, 5};
  return wall;
}

TEST(Mesh, CornerHoldsASphereByThreeContacts) {
  auto settings = test::free_space<3>(1e6, 0.3);
  settings.gravity = {-6, -7, -8};
  InitialGrains<3> grains;
  add_grain<3>(grains, {-0.0895, -0.0895, -0.0895}, {}, 0.01);
  Dynamics<3> dynamics(settings, grains, {cube(0.1, settings.constants)});
  dynamics.advance(0.3, 60000);
  const auto contacts = dynamics.contacts();
  ASSERT_EQ(contacts.size(), 3u);
  const Vector<3> force = dynamics.wall_force(0);
  for (std::size_t c = 0; c < 3; ++c)
    EXPECT_NEAR(force[c], settings.gravity[c] * grains.mass[0], 1e-5 * grains.mass[0]);
  EXPECT_NEAR(dynamics.energy_error(), 0, 5e-3);
}

TEST(Mesh, GasStaysInItsBoxWithItsEnergy) {
  auto settings = test::free_space<3>(1e5, 1);
  InitialGrains<3> grains;
  std::mt19937 random(2);
  std::uniform_real_distribution<double> unit(-1, 1);
  for (const double z : {-0.05, 0.0, 0.05})
    for (const double y : {-0.05, 0.0, 0.05})
      for (const double x : {-0.05, 0.0, 0.05})
        add_grain<3>(grains, {x, y, z}, {unit(random), unit(random), unit(random)}, 0.01);
  Dynamics<3> dynamics(settings, grains, {cube(0.1, settings.constants)});
  const double before = dynamics.energies().total();
  dynamics.advance(0.5, 20000);
  EXPECT_NEAR(dynamics.energies().total(), before, 2e-3 * before);
  for (const double x : dynamics.state().position) EXPECT_LT(std::abs(x), 0.0905);
}

TEST(Mesh, TurningDrumCarriesASphereAndPaysForIt) {
  // A cube turns about z; the spheres in it are thrown about. Its nodes come round to where they were, and
  // what it gives is what the grains have and lose.
  auto settings = test::free_space<3>(1e5, 0.5, 0.5);
  settings.gravity = {0, -10, 0};
  InitialGrains<3> grains;
  for (int k = 0; k < 5; ++k) add_grain<3>(grains, {0.03 * (k - 2), -0.05, 0.01 * k}, {}, 0.012);
  Dynamics<3> dynamics(settings, grains, {cube(0.1, settings.constants)});
  const std::vector<double> nodes = dynamics.walls()[0].node;
  dynamics.wall_spin = [](std::size_t, double) { return Spin<3>{0, 0, 2 * std::numbers::pi}; };
  dynamics.advance(1, 40000);
  for (std::size_t k = 0; k < nodes.size(); ++k) EXPECT_NEAR(dynamics.walls()[0].node[k], nodes[k], 1e-9);
  EXPECT_GT(dynamics.state().ledger.given, 0.1 * 10 * grains.mass[0]);
  EXPECT_NEAR(dynamics.energy_error(), 0, 5e-3);
  for (std::size_t i = 0; i < 5; ++i) {
    const Vector<3> x = dynamics.unwrapped(i);
    EXPECT_LT(std::hypot(x[0], x[1]), 0.1 * std::sqrt(2.0));
  }
}

TEST(Polyline, TurnsAboutItsPivot) {
  // A flail of one segment, a metre long, hits a disc at rest at its end: twice the speed of the end.
  auto settings = test::free_space<2>(1e8, 1);
  InitialGrains<2> grains;
  add_grain<2>(grains, {0.9, 0.02}, {}, 0.01);
  Wall<2> flail;
  flail.node = {0, 0, 1, 0};
  flail.facet = {0, 1};
  flail.constants = settings.constants;
  Dynamics<2> dynamics(settings, grains, {flail});
  dynamics.wall_spin = [](std::size_t, double) { return Spin<2>{1.0}; };
  dynamics.advance(0.02, 8000);
  EXPECT_NEAR(dynamics.state().velocity[1], 2 * 0.9, 0.02);
  EXPECT_NEAR(dynamics.walls()[0].node[3], std::sin(0.02), 1e-9);
}

class Stl : public testing::Test {
protected:
  std::filesystem::path file(const std::string& content) {
    std::filesystem::path path = std::filesystem::path(testing::TempDir()) / "mesh_test.stl";
    std::ofstream(path, std::ios::binary) << content;
    return path;
  }
  std::string what(const std::string& content) {
    try {
      read_stl(file(content));
    } catch (const std::invalid_argument& error) {
      return error.what();
    }
    return "";
  }
};

TEST_F(Stl, TextAndBinaryGiveTheSameMesh) {
  // Two triangles that share an edge, and a third without area.
  const std::array<float, 27> corner{0,    0, 0, 1, 0, 0, 0, 1, 0, 1, 0, 0, 1, 1,
                                     0.5F, 0, 1, 0, 0, 0, 0, 1, 1, 0, 1, 1, 0};
  std::string text = "solid plate\n", binary(84, ' ');
  const std::uint32_t triangles = 3;
  std::memcpy(binary.data() + 80, &triangles, 4);
  for (std::size_t t = 0; t < 3; ++t) {
    text += "facet normal 0 0 1\nouter loop\n";
    binary.append(12, '\0');
    for (std::size_t k = 0; k < 3; ++k) {
      const float* x = corner.data() + 9 * t + 3 * k;
      text +=
          "vertex " + std::to_string(x[0]) + " " + std::to_string(x[1]) + " " + std::to_string(x[2]) + "\n";
      binary.append(reinterpret_cast<const char*>(x), 12);
    }
    text += "endloop\nendfacet\n";
    binary.append(2, '\0');
  }
  const TriangleMesh from_text = read_stl(file(text + "endsolid plate\n"));
  const TriangleMesh from_binary = read_stl(file(binary));
  EXPECT_EQ(from_text.node, from_binary.node);
  EXPECT_EQ(from_text.triangle, from_binary.triangle);
  EXPECT_EQ(from_text.node.size(), 12u);
  EXPECT_THAT(from_text.triangle, testing::ElementsAre(0, 1, 2, 1, 3, 2));
}

TEST_F(Stl, SaysWhatIsWrong) {
  EXPECT_THAT(what("Hello"), testing::HasSubstr("neither a text nor a binary STL file"));
  EXPECT_THAT(what("solid x\nvertex 1 2\nvertex"), testing::HasSubstr("corner 0 is no three numbers"));
  EXPECT_THAT(what("solid x\nvertex 1 2 3\nvertex 1 2 3"), testing::HasSubstr("last triangle is incomplete"));
  EXPECT_THAT(what("solid x\nendsolid x\n"), testing::HasSubstr("holds no triangle"));
  EXPECT_THAT(what(""), testing::HasSubstr("mesh_test.stl"));
  EXPECT_THROW(read_stl("/nowhere/at/all.stl"), std::invalid_argument);
}

}  // namespace
}  // namespace estuary::grains
