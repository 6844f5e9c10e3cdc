// Memory without the solid's nodes, as among the pores of a picture.
#include <gtest/gtest.h>
#include <omp.h>

#include <algorithm>
#include <random>
#include <stdexcept>
#include <string>
#include <vector>

#include "flow_cases.hpp"

namespace estuary::fluid {
namespace {

// Blobs and single nodes at random, most of the box; the outermost nodes as they come.
std::vector<std::uint16_t> grains_of(const Grid& grid) {
  std::mt19937 random(7);
  std::vector<std::uint16_t> solid(grid.size(), 0);
  std::uniform_int_distribution<int> any(0, 1 << 30);
  const int depth = grid.layers();
  const int blobs = static_cast<int>(grid.size()) / (depth > 1 ? 140 : 84);
  for (int blob = 0; blob < blobs; ++blob) {
    const int x0 = any(random) % grid.nx;
    const int y0 = any(random) % grid.ny;
    const int z0 = any(random) % depth;
    const int radius = blob % 9;
    for (int z = std::max(z0 - radius, 0); z <= std::min(z0 + radius, depth - 1); ++z) {
      for (int y = std::max(y0 - radius, 0); y <= std::min(y0 + radius, grid.ny - 1); ++y) {
        for (int x = std::max(x0 - radius, 0); x <= std::min(x0 + radius, grid.nx - 1); ++x) {
          const int square = (x - x0) * (x - x0) + (y - y0) * (y - y0) + (z - z0) * (z - z0);
          if (square <= radius * radius) solid[grid.index(x, y, z)] = 1;
        }
      }
    }
  }
  return solid;
}

Grid grid_of(int nx, int ny, int nz = 0) {
  Grid grid{nx, ny, 1.0, 0.0, 0.0};
  grid.nz = nz;
  return grid;
}

FlowSettings settings_of(const Grid& grid, bool all_periodic, Storage storage) {
  const bool space = grid.nz > 0;
  FlowSettings settings;
  settings.grid = grid;
  settings.rates = relaxation_rates(0.02, 3.0 / 16.0);
  settings.storage = storage;
  const int sides = side_count(settings.grid.dimension());
  if (all_periodic) {
    settings.grid.periodic_x = settings.grid.periodic_y = true;
    settings.grid.periodic_z = space;
    for (int s = 0; s < sides; ++s) settings.sides[static_cast<std::size_t>(s)].kind = SideKind::periodic;
    settings.force = storage == Storage::double_precision ? ForceModel::guo : ForceModel::none;
    settings.acceleration = {1e-5, -2e-5, space ? 1e-5 : 0.0};
    return settings;
  }
  const auto nodes = static_cast<std::size_t>(settings.grid.rows());
  Side& inlet = settings.sides[left];
  inlet.kind = SideKind::velocity;
  inlet.velocity_x.assign(nodes, 0.03);
  inlet.velocity_y.assign(nodes, 0.0);
  inlet.velocity_z.assign(space ? nodes : 0, 0.0);
  settings.sides[right].kind = SideKind::outflow;
  settings.sides[right].relaxation = 0.25;
  settings.sides[right].excess.assign(nodes, 0.0);
  // A sliding wall as well.
  Side& lid = settings.sides[top];
  const auto points =
      static_cast<std::size_t>((2 * settings.grid.nx + 1) * (space ? 2 * settings.grid.nz + 1 : 1));
  lid.velocity_x.assign(points, 0.02);
  lid.velocity_y.assign(points, 0.0);
  lid.velocity_z.assign(space ? points : 0, 0.0);
  return settings;
}

struct Result {
  struct Moment {
    Fields fields;
    BodyLoad load;
  };
  std::vector<Moment> moments;
  bool packed = false;
  int threads = 0;
};

// A body where nothing sees it. Where there may be others, solid nodes next to the fluid keep their memory.
void place_body_in_a_grain(Flow& flow, const std::vector<std::uint16_t>& solid) {
  const Grid& grid = flow.grid();
  const int reach = grid.nz > 0 ? 1 : 0;
  for (int z = reach; z < grid.layers() - reach; ++z) {
    for (int y = 1; y + 1 < grid.ny; ++y) {
      for (int x = 1; x + 1 < grid.nx; ++x) {
        bool inside = true;
        for (int dz = -reach; dz <= reach; ++dz)
          for (int dy = -1; dy <= 1; ++dy)
            for (int dx = -1; dx <= 1; ++dx)
              inside = inside && solid[grid.index(x + dx, y + dy, z + dz)] != 0;
        if (!inside) continue;
        const double centre[] = {double(x), double(y), double(z)};
        const int dimension = grid.dimension();
        const auto turns = static_cast<std::size_t>(dimension == 3 ? 3 : 1);
        const auto axes = static_cast<std::size_t>(dimension);
        flow.place_bodies(
            {dimension, {centre, centre + axes}, {0.3}, std::vector(axes, 0.0), std::vector(turns, 0.0)},
            {WallRule::linear}, false);
        return;
      }
    }
  }
  FAIL() << "no node inside the grains";
}

Result run(FlowSettings settings, bool drop, int threads, bool other_walls = false) {
  omp_set_num_threads(threads);
  settings.drop_solid_nodes = drop;
  Flow flow(settings);
  const std::vector<std::uint16_t> solid = grains_of(settings.grid);
  flow.set_solid_nodes(solid, other_walls);
  if (other_walls) place_body_in_a_grain(flow, solid);
  Fields start;
  std::mt19937 random(3);
  std::uniform_real_distribution<double> any(-0.01, 0.01);
  for (std::size_t n = 0; n < settings.grid.size(); ++n) {
    start.velocity_x.push_back(any(random));
    start.velocity_y.push_back(any(random));
    if (settings.grid.nz > 0) start.velocity_z.push_back(any(random));
    start.excess.push_back(any(random));
  }
  set_equilibrium(flow.populations(), start, settings.equilibrium);
  Result result;
  const auto look = [&] {
    Result::Moment& moment = result.moments.emplace_back();
    flow.compute_fields(moment.fields);
    moment.load = flow.solid_nodes_load();
  };
  // Saved, gone on with and looked at after odd and after even steps.
  Flow::State state;
  flow.run(15);
  flow.copy_to(state);
  flow.run(6);
  flow.give_back(state, {}, {}, 1.0);
  flow.run(10);
  look();
  flow.run(1);
  look();
  flow.copy_to(state);
  flow.run(5);
  flow.give_back(state, {}, {}, 1.0);
  flow.run(3);
  look();
  result.packed = flow.populations().packed();
  result.threads = flow.threads();
  return result;
}

void expect_same(const Result& one, const Result& other, const std::string& which) {
  ASSERT_EQ(one.moments.size(), other.moments.size());
  for (std::size_t n = 0; n < one.moments.size(); ++n) {
    const Result::Moment& a = one.moments[n];
    const Result::Moment& b = other.moments[n];
    EXPECT_EQ(a.fields.velocity_x, b.fields.velocity_x) << which << ' ' << n;
    EXPECT_EQ(a.fields.velocity_y, b.fields.velocity_y) << which << ' ' << n;
    EXPECT_EQ(a.fields.velocity_z, b.fields.velocity_z) << which << ' ' << n;
    EXPECT_EQ(a.fields.excess, b.fields.excess) << which << ' ' << n;
    EXPECT_EQ(a.load.force, b.load.force) << which << ' ' << n;
    EXPECT_EQ(a.load.torque, b.load.torque) << which << ' ' << n;
  }
  EXPECT_NE(one.moments.front().load.torque[2], 0.0) << which;
}

// Every kind of side, both lattices and precisions: not a bit of the flow or of the loads changes against a
// step along whole rows.
TEST(Packing, ChangesNoBit) {
  const int threads_before = omp_get_max_threads();
  for (const bool space : {false, true}) {
    const Grid grid = space ? grid_of(31, 19, 17) : grid_of(71, 53);
    for (const bool all_periodic : {false, true}) {
      for (const Storage storage : {Storage::double_precision, Storage::single_precision}) {
        const FlowSettings settings = settings_of(grid, all_periodic, storage);
        const std::string which = variant_name(settings.step()) + (all_periodic ? " periodic" : "");
        const Result rows = run(settings, false, 1, true);
        const auto& velocity = rows.moments.front().fields.velocity_x;
        EXPECT_GT(*std::max_element(velocity.begin(), velocity.end()), 1e-4);
        const Result packed = run(settings, true, 1);
        EXPECT_TRUE(packed.packed) << which;
        expect_same(packed, rows, which);
        const Result beside = run(settings, true, 1, true);
        EXPECT_TRUE(beside.packed) << which;
        expect_same(beside, rows, which + " with other walls");
      }
    }
  }
  omp_set_num_threads(threads_before);
}

// Nor do threads that share the groups of blocks; enough nodes for three of them.
TEST(Packing, ChangesNoBitOnThreads) {
  const int threads_before = omp_get_max_threads();
  for (const bool all_periodic : {false, true}) {
    const FlowSettings settings = settings_of(grid_of(311, 93), all_periodic, Storage::double_precision);
    const Result rows = run(settings, false, 1, true);
    for (const int threads : {2, 3}) {
      const std::string which = std::to_string(threads) + (all_periodic ? " threads, periodic" : " threads");
      const Result packed = run(settings, true, threads);
      EXPECT_TRUE(packed.packed) << which;
      EXPECT_EQ(packed.threads, threads);
      expect_same(packed, rows, which);
    }
    expect_same(run(settings, false, 3), rows, "3 threads, not packed");
  }
  omp_set_num_threads(threads_before);
}

// Nor with any variant of the step in double precision.
TEST(Packing, ChangesNoBitOfAnyVariant) {
  const int threads_before = omp_get_max_threads();
  int variants = 0;
  for (const bool space : {false, true}) {
    FlowSettings settings =
        settings_of(space ? grid_of(23, 15, 9) : grid_of(47, 37), true, Storage::double_precision);
    settings.law.smagorinsky_constant = 0.17;
    settings.law.base_viscosity = settings.law.consistency = 0.02;
    settings.law.index = 0.7;
    settings.law.smallest = 1e-3;
    settings.law.largest = 1;
    for (const auto collision : {CollisionModel::trt, CollisionModel::bgk,
                                 CollisionModel::recursive_regularised, CollisionModel::central_moment}) {
      for (const auto equilibrium : {EquilibriumModel::incompressible, EquilibriumModel::compressible}) {
        for (const auto force : {ForceModel::none, ForceModel::guo, ForceModel::unshifted}) {
          for (const auto viscosity : {ViscosityModel::constant, ViscosityModel::smagorinsky,
                                       ViscosityModel::generalised_newtonian}) {
            settings.collision = collision;
            settings.equilibrium = equilibrium;
            settings.force = force;
            settings.viscosity = viscosity;
            if (!collide_and_stream(settings.step())) continue;
            ++variants;
            const std::string which = variant_name(settings.step());
            const Result packed = run(settings, true, 1);
            EXPECT_TRUE(packed.packed) << which;
            expect_same(packed, run(settings, false, 1, true), which);
          }
        }
      }
    }
  }
  EXPECT_EQ(variants, 80);
  omp_set_num_threads(threads_before);
}

// Bodies need the memory of solid nodes beside the fluid.
TEST(Packing, RefusesOtherWallsWhenToldOfNone) {
  Flow flow(settings_of(grid_of(71, 53), true, Storage::double_precision));
  flow.set_solid_nodes(grains_of(flow.grid()));
  EXPECT_THROW(flow.place_bodies({2, {5, 5}, {0.3}, {0, 0}, {0}}, {WallRule::linear}, false),
               std::logic_error);
  EXPECT_THROW(flow.set_wet_surface(2, {0, 1, 1, 0}), std::logic_error);
}

// Where there is little to save nothing is moved.
TEST(Packing, LeavesOpenFlowsAlone) {
  FlowSettings settings = settings_of(grid_of(71, 53), true, Storage::double_precision);
  Flow flow(settings);
  std::vector<std::uint16_t> solid(settings.grid.size(), 0);
  for (int n = 0; n < 12; ++n)
    solid[settings.grid.index(5 * n % settings.grid.nx, 3 * n % settings.grid.ny)] = 1;
  flow.set_solid_nodes(solid);
  EXPECT_FALSE(flow.populations().packed());
}

}  // namespace
}  // namespace estuary::fluid
